//! A scene file, changed and launched from Rust.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytemuck::{AnyBitPattern, NoUninit};

use crate::accel::{Tlas, TlasInstance};
use crate::compile::SourceSettings;
use crate::debug::render::{self, RenderOptions};
use crate::debug::{Request, Session};
use crate::error::{Error, ErrorKind, Result};
use crate::harness::bound::{self, Bound};
use crate::harness::texels::Texels;
use crate::harness::value::Value;
use crate::machine::printed::PrintedLine;
use crate::pipeline::Stats;
use crate::scene::read::nearest;
use crate::scene::resolved::ShaderCode;
use crate::scene::resources::Resource;
use crate::scene::{LoadOptions, ResolvedScene, SceneFiles, assemble, load, load_text};

/// A scene file with everything that it names: load it, change it, launch it, as often as wanted.
///
/// ```
/// use anyhit::LoadedScene;
///
/// # fn main() -> anyhit::Result<()> {
/// let mut scene = LoadedScene::open("shaders/pass/ray-query/compute/scene.toml")?;
/// assert_eq!(scene.launch()?.read_buffer::<u32>("outputs")?, [54, 38, 54, 38]);
/// // Far away nothing is met.
/// scene.set_transform(0, [[1.0, 0.0, 0.0, 100.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])?;
/// assert_eq!(scene.launch()?.read_buffer::<u32>("outputs")?, [0; 4]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct LoadedScene {
    source: Source,
    options: LoadOptions,
    scene: ResolvedScene,
    /// In order; they are made again where the scene is read again.
    changes: Vec<Change>,
}

/// Where the scene's text is.
#[derive(Clone, Debug)]
struct Source {
    path: PathBuf,
    /// `None` for that of the file.
    text: Option<String>,
    files: SceneFiles,
}

impl Source {
    fn read(&self, options: &LoadOptions) -> Result<ResolvedScene> {
        match &self.text {
            None => load(&self.path, &self.files, options),
            Some(text) => load_text(&self.path, text, &self.files, options),
        }
    }
}

/// A change of a scene.
#[derive(Clone, Debug)]
enum Change {
    Buffer(String, Vec<u8>),
    PushConstants(Vec<u8>),
    Transform(usize, [[f32; 4]; 3]),
    Shader(String, PathBuf, ShaderCode),
    MaxRecursion(u32),
}

impl LoadedScene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// All mistakes of the scene and its files in one error.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::read(Source { path: path.as_ref().to_path_buf(), text: None, files: SceneFiles::default() })
    }

    /// Reads a scene from a text; its relative paths start at the folder of `path`, which need not
    /// exist.
    ///
    /// # Errors
    /// As [`LoadedScene::open`].
    pub fn from_text(path: impl AsRef<Path>, text: &str) -> Result<Self> {
        let (path, text) = (path.as_ref().to_path_buf(), Some(text.to_owned()));
        Self::read(Source { path, text, files: SceneFiles::default() })
    }

    fn read(source: Source) -> Result<Self> {
        let options = LoadOptions::default();
        let scene = source.read(&options)?;
        Ok(Self { source, options, scene, changes: Vec::new() })
    }

    /// Replaces the content of a buffer, by the resource's name in the scene.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no buffer of that name.
    pub fn set_buffer<T: NoUninit>(&mut self, name: &str, elements: &[T]) -> Result<&mut Self> {
        self.change(Change::Buffer(name.to_owned(), bytemuck::cast_slice(elements).to_vec()))
    }

    /// Replaces the scene's push constants.
    ///
    /// # Errors
    /// None: it returns a result as its siblings do.
    pub fn set_push_constants<T: NoUninit>(&mut self, constants: &T) -> Result<&mut Self> {
        self.change(Change::PushConstants(bytemuck::bytes_of(constants).to_vec()))
    }

    /// Replaces the transform of an instance, by its `InstanceId`: three rows of four numbers.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such instance, `InvalidScene` for a matrix that no
    /// instance may have.
    pub fn set_transform(&mut self, instance: usize, rows: [[f32; 4]; 3]) -> Result<&mut Self> {
        self.change(Change::Transform(instance, rows))
    }

    /// Replaces a shader, by its name below `[shaders]`, by a source text; the extension of
    /// `file_name` tells its language. Entry points keep their names.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene uses no shader of that name. Mistakes in the source are
    /// those of [`LoadedScene::launch`].
    pub fn set_shader_source(&mut self, name: &str, file_name: &str, text: &str) -> Result<&mut Self> {
        let code = ShaderCode::Source(text.as_bytes().to_vec(), SourceSettings::of(Path::new(file_name)));
        self.change(Change::Shader(name.to_owned(), file_name.into(), code))
    }

    /// Replaces a shader, by its name below `[shaders]`, by the bytes of a SPIR-V module.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene uses no shader of that name. Mistakes in the module are
    /// those of [`LoadedScene::launch`].
    pub fn set_shader_spirv(&mut self, name: &str, bytes: &[u8]) -> Result<&mut Self> {
        self.change(Change::Shader(name.to_owned(), name.into(), ShaderCode::SpirV(bytes.to_vec())))
    }

    /// Sets `maxPipelineRayRecursionDepth`.
    ///
    /// # Errors
    /// None: [`LoadedScene::launch`] tells of a depth that the scene's device has not.
    pub fn set_max_recursion(&mut self, depth: u32) -> Result<&mut Self> {
        self.change(Change::MaxRecursion(depth))
    }

    /// Sets width and height of the launch. The scene is read again: images without a size and
    /// cameras follow, and all changes are made again.
    ///
    /// # Errors
    /// As [`LoadedScene::open`].
    pub fn set_launch_size(&mut self, size: [u32; 2]) -> Result<&mut Self> {
        let options = LoadOptions { size: Some(size), ..self.options.clone() };
        let mut scene = self.source.read(&options)?;
        self.changes.iter().try_for_each(|change| change.apply(&mut scene))?;
        (self.options, self.scene) = (options, scene);
        Ok(self)
    }

    fn change(&mut self, change: Change) -> Result<&mut Self> {
        change.apply(&mut self.scene)?;
        self.changes.push(change);
        Ok(self)
    }

    /// Runs the launch, where the scene has a ray generation shader, and then its dispatches, on
    /// buffers and images as the scene describes them.
    ///
    /// # Errors
    /// Every mistake in shaders, groups and images, each at its place in the scene; the first trap.
    pub fn launch(&self) -> Result<SceneOutcome> {
        let mut assembled = assemble(&self.scene)?;
        let printed = Arc::default();
        assembled.resources.printed = Some(Arc::clone(&printed));
        let stats = assembled.run::<64>(&assembled.resources, &|_| ())?;
        let mut programs = assembled.pipeline.programs.clone();
        programs.extend(assembled.dispatches.iter().map(|dispatch| dispatch.compute.program.clone()));
        let names = self.scene.resources.iter().filter(|one| one.element == 0);
        Ok(SceneOutcome {
            stats,
            printed: printed.take(),
            names: names.map(|one| (one.name.clone(), [one.set, one.binding])).collect(),
            bound: Bound { programs, resources: assembled.resources },
        })
    }

    /// Explains a ray, a pixel or an invocation, as `anyhit trace-one-ray` prints it.
    ///
    /// # Errors
    /// As [`Session::run`]; a trap is part of the text.
    pub fn explain(&self, request: &Request) -> Result<String> {
        let (transcript, _) = Session::new(self.scene.clone())?.run(request)?;
        Ok(render::text(&transcript, RenderOptions::default()))
    }
}

impl Change {
    fn apply(&self, scene: &mut ResolvedScene) -> Result<()> {
        match self {
            Self::Buffer(name, bytes) => {
                let is_buffer = |resource: &Resource| {
                    matches!(resource, Resource::StorageBuffer(_) | Resource::UniformBuffer(_))
                };
                let all = || scene.resources.iter().filter(|one| is_buffer(&one.resource));
                let unknown = unknown("buffer", name, all().map(|one| one.name.as_str()));
                let mut buffers = scene.resources.iter_mut().filter(|one| is_buffer(&one.resource));
                let found = buffers.find(|one| one.name == *name).ok_or(unknown)?;
                if let Resource::StorageBuffer(content) | Resource::UniformBuffer(content) =
                    &mut found.resource
                {
                    *content = bytes.clone().into();
                }
            }
            Self::PushConstants(bytes) => scene.push_constants = bytes.clone().into(),
            Self::Transform(instance, rows) => {
                let count = scene.tlas.first().map_or(0, |(_, tlas)| tlas.instances().len());
                let Some((_, tlas)) = scene.tlas.first_mut().filter(|_| *instance < count) else {
                    let message = format!("the scene has no instance {instance}, only {count}");
                    return Err(invalid(message));
                };
                let mut instances: Vec<TlasInstance> = tlas.instances().to_vec();
                instances[*instance].transform = *rows;
                instances[*instance].motion = None;
                *tlas = Tlas::with_precision(instances, tlas.precision())
                    .map_err(|error| error.context(format!("instance {instance}")))?;
            }
            Self::Shader(name, path, code) => {
                let unknown = unknown("shader", name, scene.shaders.iter().map(|one| one.name.as_str()));
                let shader = scene.shaders.iter_mut().find(|one| one.name == *name).ok_or(unknown)?;
                shader.path.clone_from(path);
                shader.code.clone_from(code);
            }
            Self::MaxRecursion(depth) => scene.max_recursion_depth = Some(*depth),
        }
        Ok(())
    }
}

/// What a scene's launch and dispatches left behind.
#[derive(Clone, Debug)]
pub struct SceneOutcome {
    /// How many rays were traced and shaders run.
    pub stats: Stats,
    /// What shaders printed (`debugPrintfEXT`), in launch order.
    pub printed: Vec<PrintedLine>,
    /// Set and binding of each resource of the scene.
    names: Vec<(String, [u32; 2])>,
    bound: Bound,
}

impl SceneOutcome {
    /// A buffer by the names of its members.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such buffer, or no shader uses it.
    pub fn buffer(&self, name: &str) -> Result<Value> {
        let [set, binding] = self.place(name)?;
        self.bound.buffer(set, binding)
    }

    /// A buffer as a row of a plain Rust type.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such buffer, or its size is no multiple.
    pub fn read_buffer<T: AnyBitPattern>(&self, name: &str) -> Result<Vec<T>> {
        let [set, binding] = self.place(name)?;
        bound::rows(&self.bound.buffer_bytes(set, binding)?)
    }

    /// The texels of an image.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such image.
    pub fn image(&self, name: &str) -> Result<Texels> {
        let [set, binding] = self.place(name)?;
        self.bound.image(set, binding)
    }

    fn place(&self, name: &str) -> Result<[u32; 2]> {
        let found = self.names.iter().find(|(known, _)| known == name).map(|(_, place)| *place);
        found.ok_or_else(|| unknown("resource", name, self.names.iter().map(|(known, _)| known.as_str())))
    }
}

fn unknown<'a>(what: &str, name: &str, known: impl Iterator<Item = &'a str> + Clone) -> Error {
    let error = invalid(format!("the scene has no {what} `{name}`"));
    let all: Vec<String> = known.clone().map(|known| format!("`{known}`")).collect();
    match nearest(name, known) {
        Some(near) => error.note(format!("did you mean `{near}`?")),
        None if all.is_empty() => error.note("it has none"),
        None => error.note(format!("it has {}", all.join(", "))),
    }
}

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "version = 1\n[shaders]\nadd = 'add.wgsl'\n[[dispatch]]\nshader = 'add:add'\n\
                         [resources.numbers]\ntype = 'storage_buffer'\nbinding = 0\ndata = { u32 = [1, 2] }\n";

    fn add(more: u32) -> String {
        format!(
            "@group(0) @binding(0) var<storage, read_write> numbers: array<u32, 2>;
             @compute @workgroup_size(2)
             fn add(@builtin(local_invocation_index) at: u32) {{ numbers[at] += {more}u; }}"
        )
    }

    #[test]
    fn buffers_and_shaders_are_replaced_and_each_launch_begins_anew() {
        let folder = std::env::temp_dir().join(format!("anyhit-loaded-scene-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("add.wgsl"), add(1)).unwrap();
        let mut scene = LoadedScene::from_text(folder.join("scene.toml"), SCENE).unwrap();
        let numbers = |scene: &LoadedScene| scene.launch().unwrap().read_buffer::<u32>("numbers").unwrap();
        assert_eq!([numbers(&scene), numbers(&scene)], [[2, 3], [2, 3]]);
        scene.set_buffer("numbers", &[10u32, 20]).unwrap();
        assert_eq!(numbers(&scene), [11, 21]);
        scene.set_shader_source("add", "other.wgsl", &add(5)).unwrap();
        assert_eq!(numbers(&scene), [15, 25]);
        // What was changed before stays, where the scene is read again.
        scene.set_launch_size([4, 4]).unwrap();
        assert_eq!(numbers(&scene), [15, 25]);

        let error = scene.set_buffer("number", &[1u32]).unwrap_err();
        assert_eq!(error.message(), "the scene has no buffer `number`");
        assert!(error.render().contains("did you mean `numbers`?"), "{}", error.render());
        let error = scene.set_transform(0, [[0.0; 4]; 3]).unwrap_err();
        assert_eq!(error.message(), "the scene has no instance 0, only 0");
        let _ = std::fs::remove_dir_all(&folder);
    }
}
