//! A scene file, changed and launched from Rust.

mod change;

use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytemuck::{AnyBitPattern, NoUninit};
use serde::Serialize;

use crate::loaded_scene::change::{Change, no_instance};
use crate::many_seeds::{ManySeeds, run_command};
use crate::observe::fresh_resources;
use crate::sanitized::run_sanitized;
use crate::typed_scene;
use anyhit_base::error::names::nearest;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_compile::SourceSettings;
use anyhit_debugger::{ExplainRequest, Session};
use anyhit_engine::accel::TlasInstance;
use anyhit_engine::accel::motion::Motion;
use anyhit_engine::machine::printed::PrintedLine;
use anyhit_engine::machine::{Descriptor, Resources};
use anyhit_engine::module::Module;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::WrittenMemory;
use anyhit_engine::pipeline::{Pipeline, RunOptions, Stats};
use anyhit_explain::render::{self, RenderOptions};
use anyhit_sanitize::WarningReports;
use anyhit_scene::addresses::Addresses;
use anyhit_scene::assemble::read;
use anyhit_scene::resolved::ShaderCode;
use anyhit_scene::resolved::UnreadPart;
use anyhit_scene::sanitize_table::scene_levels;
use anyhit_scene::{Assembled, LoadOptions, ResolvedScene, SceneFiles, assemble, load, load_text};
use anyhit_unit_test::bound::{self, Bound};
use anyhit_unit_test::data::HostBytes;
use anyhit_unit_test::scene::Scene;
use anyhit_unit_test::struct_data::StructData;
use anyhit_unit_test::texels::Texels;
use anyhit_unit_test::value::Value;

/// A scene file with everything that it names: load it, change it, launch it, as often as wanted.
///
/// ```
/// use anyhit::LoadedScene;
///
/// # fn main() -> anyhit::Result<()> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
/// let mut scene = LoadedScene::open("shaders/pass/ray-query/compute/scene.toml")?;
/// assert_eq!(scene.launch()?.read_buffer::<u32>("outputs")?, [54, 38, 54, 38]);
/// // Far away nothing is met.
/// scene.set_transform(0, [[1.0, 0.0, 0.0, 100.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])?;
/// assert_eq!(scene.launch()?.read_buffer::<u32>("outputs")?, [0; 4]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
#[must_use]
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

    /// Replaces the content of a buffer, by the resource's name in the scene. Its size stays, and
    /// scalars and strides must be those of the shaders: what runs the scene compares them.
    /// [`LoadedScene::set_buffer_bytes`] gives it another size.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no buffer of that name, or of another size.
    pub fn set_buffer<T: NoUninit>(&mut self, name: &str, elements: &[T]) -> Result<&mut Self> {
        self.set_sized_buffer(name, HostBytes::of_slice(elements))
    }

    /// As [`LoadedScene::set_buffer`], with an array of another language; as
    /// [`LoadedScene::set_buffer_bytes`], with bytes.
    ///
    /// # Errors
    /// As there.
    #[doc(hidden)]
    pub fn set_buffer_of(&mut self, name: &str, given: HostBytes) -> Result<&mut Self> {
        match given.is_raw() {
            true => self.change(Change::Buffer(name.to_owned(), given)),
            false => self.set_sized_buffer(name, given),
        }
    }

    fn set_sized_buffer(&mut self, name: &str, given: HostBytes) -> Result<&mut Self> {
        self.read_if_unread(name)?;
        let known = self.scene.resources.iter().find(|one| one.name == name);
        let size = known.and_then(|one| one.resource.buffer_size().ok().flatten());
        let unbound = || self.scene.unbound.iter().find(|one| one.name == name)?.data.size().ok();
        match size.or_else(unbound) {
            Some(size) if size != given.bytes.len() as u64 => {
                let message = format!(
                    "the buffer `{name}` has {size} bytes in the scene, but `{}` has {}",
                    given.rust.name, given.rust.size
                );
                Err(invalid(message).note("change its size with `set_buffer_bytes`"))
            }
            _ => self.change(Change::Buffer(name.to_owned(), given)),
        }
    }

    /// Replaces the content of a buffer by bytes, little-endian, whatever types the shaders
    /// declare. The buffer has their size.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no buffer of that name.
    pub fn set_buffer_bytes(&mut self, name: &str, bytes: &[u8]) -> Result<&mut Self> {
        self.change(Change::Buffer(name.to_owned(), HostBytes::raw(bytes)))
    }

    /// The device address of a buffer or an acceleration structure, by its name: for data that
    /// replace the scene's. It stays, whatever is changed.
    ///
    /// # Errors
    /// `InvalidArgument` where nothing of that name has an address: a buffer of type `buffer` has
    /// one, one that says `address = true`, and what an `address_of` names.
    pub fn address_of(&self, name: &str) -> Result<u64> {
        let mut errors = Vec::new();
        let addresses = Addresses::assign(&self.scene, &mut errors);
        if !errors.is_empty() {
            return Err(Error::several(errors));
        }
        addresses.of_name(name).ok_or_else(|| {
            let names = addresses.names();
            unknown("address of a buffer or acceleration structure", name, names)
        })
    }

    /// Replaces the scene's push constants. Size and scalars must be those of the shaders: what
    /// runs the scene compares them.
    ///
    /// # Errors
    /// `InvalidArgument` where no shader of the scene declares push constants.
    pub fn set_push_constants<T: NoUninit + Debug>(&mut self, constants: &T) -> Result<&mut Self> {
        self.push_constants(HostBytes::of(constants))
    }

    /// Replaces the scene's push constants by a struct that is written by the names of its members.
    ///
    /// # Errors
    /// As [`LoadedScene::set_push_constants`].
    pub fn set_push_constants_data(&mut self, constants: &StructData) -> Result<&mut Self> {
        self.push_constants(constants.given())
    }

    /// Replaces the scene's push constants by bytes, little-endian, whatever types the shaders
    /// declare.
    ///
    /// # Errors
    /// As [`LoadedScene::set_push_constants`].
    pub fn set_push_constants_bytes(&mut self, bytes: &[u8]) -> Result<&mut Self> {
        self.push_constants(HostBytes::raw(bytes))
    }

    /// As [`LoadedScene::set_push_constants`], with an array of another language.
    ///
    /// # Errors
    /// As there.
    #[doc(hidden)]
    pub fn set_push_constants_of(&mut self, given: HostBytes) -> Result<&mut Self> {
        self.push_constants(given)
    }

    fn push_constants(&mut self, given: HostBytes) -> Result<&mut Self> {
        for shader in &self.scene.shaders {
            let module = self.module(&shader.name)?;
            if module.variables.iter().any(|variable| variable.storage_class == storage::PUSH_CONSTANT) {
                return self.change(Change::PushConstants(given));
            }
        }
        Err(invalid("no shader of the scene declares push constants".into()))
    }

    /// Replaces the data of a shader record: of a ray generation, miss, hit or callable record by
    /// its `name`, or by the name of a shader that no other record has.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such record, or several.
    pub fn set_shader_record<T: NoUninit + Debug>(&mut self, name: &str, record: &T) -> Result<&mut Self> {
        self.change(Change::ShaderRecord(name.to_owned(), HostBytes::of(record)))
    }

    /// Replaces the data of a shader record by a struct that is written by the names of its
    /// members.
    ///
    /// # Errors
    /// As [`LoadedScene::set_shader_record`].
    pub fn set_shader_record_data(&mut self, name: &str, record: &StructData) -> Result<&mut Self> {
        self.change(Change::ShaderRecord(name.to_owned(), record.given()))
    }

    /// Replaces the data of a shader record by bytes, little-endian, whatever types the shader
    /// declares.
    ///
    /// # Errors
    /// As [`LoadedScene::set_shader_record`].
    pub fn set_shader_record_bytes(&mut self, name: &str, bytes: &[u8]) -> Result<&mut Self> {
        self.change(Change::ShaderRecord(name.to_owned(), HostBytes::raw(bytes)))
    }

    /// The module of a shader, by its name below `[shaders]`, for [`StructData`]; a source is
    /// compiled. Specialization constants have their default values.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene uses no shader of that name; mistakes in it.
    pub fn module(&self, name: &str) -> Result<Arc<Module>> {
        let shaders = &self.scene.shaders;
        let found = shaders.iter().position(|one| one.name == name);
        let index = found.ok_or_else(|| unknown("shader", name, shaders.iter().map(|one| &*one.name)))?;
        match self.scene.loaded.get(&index) {
            Some(module) => Ok(module.clone()),
            None => read(&shaders[index], &self.scene.files).map(Arc::new),
        }
    }

    /// How an instance moves, by its `InstanceId`; `None` for one at rest.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such instance.
    pub fn motion(&self, instance: usize) -> Result<Option<&Motion>> {
        Ok(self.instance(instance)?.motion.as_ref())
    }

    /// The transform of an instance at rest, by its `InstanceId`; of one that moves its transform
    /// at time 0.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such instance.
    pub fn transform(&self, instance: usize) -> Result<[[f32; 4]; 3]> {
        let found = self.instance(instance)?;
        Ok(found.motion.as_ref().and_then(|motion| motion.at(0.0)).unwrap_or(found.transform))
    }

    fn instance(&self, instance: usize) -> Result<&TlasInstance> {
        let instances = self.scene.tlas.first().map_or(&[][..], |(_, tlas)| tlas.instances());
        instances.get(instance).ok_or_else(|| no_instance(instance, instances.len()))
    }

    /// Replaces the transform of an instance, by its `InstanceId`: three rows of four numbers. An
    /// instance that moved is at rest then, as where Vulkan's instance is replaced by one without
    /// motion: to move a motion along would round both of its keys. [`LoadedScene::set_motion`]
    /// sets them.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such instance, `InvalidScene` for a matrix that no
    /// instance may have.
    pub fn set_transform(&mut self, instance: usize, rows: [[f32; 4]; 3]) -> Result<&mut Self> {
        self.change(Change::Transform(instance, rows))
    }

    /// Replaces the motion of an instance, by its `InstanceId`; one at rest moves from then on.
    ///
    /// # Errors
    /// As [`LoadedScene::set_transform`].
    pub fn set_motion(&mut self, instance: usize, motion: Motion) -> Result<&mut Self> {
        self.change(Change::Motion(instance, motion))
    }

    /// Replaces a shader, by its name below `[shaders]`, by a source text in the language of
    /// the extension of `file_name`. No file with this name is read; its folder is the first in
    /// which includes are searched. Entry points keep their names.
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
    /// As [`LoadedScene::open`], and `InvalidArgument` for a scene without a ray generation shader.
    pub fn set_launch_size(&mut self, size: [u32; 2]) -> Result<&mut Self> {
        if self.scene.all_pipelines().all(|pipeline| pipeline.sbt.raygen.is_empty()) {
            return Err(invalid("the scene has no launch to resize, only dispatches".into()));
        }
        let options = LoadOptions { size: Some(size), ..self.options.clone() };
        let mut scene = self.source.read(&options)?;
        self.changes.iter().try_for_each(|change| change.apply(&mut scene))?;
        (self.options, self.scene) = (options, scene);
        Ok(self)
    }

    /// The scene, ready to run, with its changes compared with what its shaders declare.
    fn assembled(&self) -> Result<Assembled> {
        let assembled = assemble(&self.scene)?;
        self.changes.iter().try_for_each(|change| change.check(&self.scene, &assembled))?;
        Ok(assembled)
    }

    fn change(&mut self, change: Change) -> Result<&mut Self> {
        match &change {
            Change::Buffer(name, _) => self.read_if_unread(name)?,
            // It may read what the shader before it did not.
            Change::Shader(..) if !self.scene.unread.is_empty() => drop(self.read_all()?),
            _ => {}
        }
        change.apply(&mut self.scene)?;
        self.changes.push(change);
        Ok(self)
    }

    /// Reads every file if a part of the scene was left out that has this name.
    fn read_if_unread(&mut self, name: &str) -> Result<()> {
        match self.scene.unread.iter().any(|part| part.name == name) {
            true => self.read_all().map(drop),
            false => Ok(()),
        }
    }

    /// Reads every file that the scene names, and makes all changes again. Without it, files that
    /// nothing reads are only checked to be there, and pictures are decoded when a shader first
    /// reads a texel (docs/scene.md, "What is read").
    ///
    /// # Errors
    /// As [`LoadedScene::open`].
    pub fn read_all(&mut self) -> Result<&mut Self> {
        let mut source = self.source.clone();
        source.files.read_all = true;
        let mut scene = source.read(&self.options)?;
        self.changes.iter().try_for_each(|change| change.apply(&mut scene))?;
        (self.source, self.scene) = (source, scene);
        Ok(self)
    }

    /// Runs the passes of the scene: its launch, where it has a ray generation shader, and then its
    /// dispatches, or what `[[pass]]` lists. Buffers and images begin as the scene describes them.
    ///
    /// # Errors
    /// Every mistake in shaders, groups and images, each at its place in the scene; the first trap.
    pub fn launch(&self) -> Result<SceneOutcome> {
        let assembled = self.assembled()?;
        let resources = own_resources(&assembled);
        let stats = assembled.run(&resources, RunOptions::default())?;
        Ok(self.outcome(&assembled, None, stats, resources))
    }

    /// The pipeline of the scene, and a [`Scene`] of its first acceleration structure with
    /// everything that the scene binds, to trace rays of one's own.
    /// What no shader of the scene reads is not bound unless [`LoadedScene::read_all`] was called.
    ///
    /// ```
    /// use anyhit::{LoadedScene, Ray};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let loaded = LoadedScene::open("shaders/pass/sphere/closest-hit/scene.toml")?;
    /// let (pipeline, scene) = loaded.pipeline()?;
    /// let traced = pipeline.trace(&scene, Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]))?;
    /// assert_eq!(traced.hit().t, 3.5);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Every mistake in shaders, groups and images; `InvalidArgument` for a scene without an
    /// acceleration structure.
    pub fn pipeline(&self) -> Result<(Pipeline, Scene)> {
        let Some((_, tlas)) = self.scene.tlas.first() else {
            return Err(invalid("the scene has no acceleration structure".into()));
        };
        let assembled = self.assembled()?;
        let resources = own_resources(&assembled);
        Ok((assembled.pipeline, Scene::of_parts(tlas.clone(), resources)))
    }

    /// Runs the passes of the scene as [`LoadedScene::launch`] does, under the sanitizer: it checks
    /// what no driver tells, such as reads of what nobody has written. Returns what it only warns
    /// of. The table `[sanitize]` of the scene sets the levels of rules.
    ///
    /// ```
    /// use anyhit::{ErrorKind, LoadedScene};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let scene = LoadedScene::open("shaders/sanitize/pow-domain/scene.toml")?;
    /// let error = scene.sanitize().unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Finding);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `Finding` for what it denies, all in one error; else as [`LoadedScene::launch`].
    pub fn sanitize(&self) -> Result<WarningReports> {
        let assembled = self.assembled()?;
        let resources = fresh_resources(&assembled);
        let run = run_sanitized(&self.scene, &assembled, &resources, &scene_levels(&self.scene.document)?)?;
        run.findings.into_warnings(run.outcome.map(|_| ()))
    }

    /// Runs the passes of the scene as [`LoadedScene::launch`] does, once more for each of so many
    /// seeds, from which is drawn what the specifications leave open: in what order any-hit shaders
    /// run, and how often, for one. Returns the differences of outputs that are only warned of. The
    /// table `[sanitize]` of the scene sets the levels of rules.
    ///
    /// ```
    /// use anyhit::{ErrorKind, LoadedScene};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let scene = LoadedScene::open("shaders/many-seeds/anyhit-order/scene.toml")?;
    /// let error = scene.many_seeds(8).unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Finding);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `Finding` for the differences that are denied, all in one error; `InvalidArgument` for no
    /// seed; else as [`LoadedScene::launch`].
    pub fn many_seeds(&self, seeds: u64) -> Result<WarningReports> {
        let assembled = self.assembled()?;
        let drawn = ManySeeds {
            seeds: 0..seeds,
            levels: scene_levels(&self.scene.document)?,
            command: Some(run_command(&self.scene)),
            ..ManySeeds::default()
        };
        let outcome = assembled.run(&fresh_resources(&assembled), RunOptions::default());
        drawn.run(&self.scene, &assembled)?.into_warnings(outcome.map(|_| ()))
    }

    /// Runs one pass alone, by its name or its number from 0: on buffers and images as the scene
    /// describes them, not as the passes before it leave them.
    ///
    /// # Errors
    /// As [`LoadedScene::launch`], and `InvalidArgument` where the scene has no such pass.
    pub fn launch_pass(&self, pass: &str) -> Result<SceneOutcome> {
        let assembled = self.assembled()?;
        let number = assembled.pass_number(pass)?;
        let resources = own_resources(&assembled);
        let stats = assembled.run_pass(&assembled.passes[number], &resources, RunOptions::default())?;
        Ok(self.outcome(&assembled, Some(number), stats, resources))
    }

    /// Runs the passes one after the other, as [`LoadedScene::launch`] does, and returns what each
    /// of them left behind: buffers and images as they are after it, its own counts and lines.
    ///
    /// # Errors
    /// As [`LoadedScene::launch`].
    pub fn launch_each(&self) -> Result<Vec<SceneOutcome>> {
        let assembled = self.assembled()?;
        let mut resources = own_resources(&assembled);
        let mut outcomes = Vec::new();
        for (number, pass) in assembled.passes.iter().enumerate() {
            if number > 0 {
                let found = assembled.pass_resources(pass, &resources);
                let written = WrittenMemory::of(assembled.pass_programs(pass), &found);
                resources = written.copied(&resources);
            }
            let stats = assembled.run_pass(pass, &resources, RunOptions::default());
            let stats = stats.map_err(|error| assembled.in_pass(number, error))?;
            outcomes.push(self.outcome(&assembled, Some(number), stats, resources.clone()));
        }
        Ok(outcomes)
    }

    fn outcome(
        &self,
        assembled: &Assembled,
        pass: Option<usize>,
        stats: Stats,
        resources: Resources,
    ) -> SceneOutcome {
        let bound = self.scene.resources.iter().filter(|one| one.element == 0);
        let bound = bound.map(|one| (one.name.clone(), Found::Binding([one.set, one.binding])));
        let unbound = self.scene.unbound.iter().filter_map(|one| {
            let (address, _) = resources.memory.named_buffer(&one.name)?;
            Some((one.name.clone(), Found::Address(address)))
        });
        let programs = assembled.programs().cloned().collect();
        let shared = assembled.passes.iter().flat_map(|pass| &pass.own_bindings);
        let readers = shared.flat_map(|own| [own.at, own.kept]).map(|kept| {
            let readers = assembled.readers_of(kept).into_iter();
            (kept, readers.map(|(program, at)| (program.clone(), at)).collect())
        });
        let readers = readers.collect();
        SceneOutcome {
            pass: pass.map(|number| assembled.passes[number].key(number)),
            stats,
            printed: resources.printed.as_ref().map_or_else(Vec::new, |printed| printed.take()),
            names: bound.chain(unbound).collect(),
            unread: self.scene.unread.clone(),
            bound: Bound { programs, roots: typed_scene::roots(assembled), resources, readers },
        }
    }

    /// A session that explains or debugs what it is asked for.
    ///
    /// # Errors
    /// As [`LoadedScene::launch`].
    #[doc(hidden)]
    pub fn session(&self) -> Result<Session> {
        Session::new(self.scene.clone())
    }

    /// Explains a ray, a pixel or an invocation, as `anyhit trace-one-ray` prints it: a pixel
    /// (`[u32; 2]` or a launch index `[u32; 3]`), the name of a `[[ray]]`, a
    /// [`Ray`](anyhit_engine::geometry::Ray), or any other [`ExplainRequest`].
    ///
    /// ```
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let scene = anyhit::LoadedScene::open("shaders/pass/frames/ping-pong/scene.toml")?;
    /// let text = scene.explain([1, 0])?;
    /// assert!(text.contains("pixel (1, 0)"), "{text}");
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`Session::run`]; a trap is part of the text.
    pub fn explain(&self, request: impl Into<ExplainRequest>) -> Result<String> {
        let (transcript, _) = self.session()?.run(&request.into())?;
        Ok(render::text(&transcript, RenderOptions { summary: true, ..RenderOptions::default() }))
    }
}

/// The resources of a scene that was assembled for one run; they collect what shaders print.
fn own_resources(assembled: &Assembled) -> Resources {
    Resources { printed: Some(Arc::default()), ..assembled.resources.clone() }
}

/// Result of all passes of a scene, or of one. Serde writes the pass, counts and
/// printed lines.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
#[must_use]
pub struct SceneOutcome {
    /// The pass after which this is, by its name or number; `None` after all of them.
    pub pass: Option<String>,
    /// How many rays were traced and shaders run.
    pub stats: Stats,
    /// What shaders printed (`debugPrintfEXT`), in launch order.
    pub printed: Vec<PrintedLine>,
    /// Where each resource of the scene is.
    #[serde(skip)]
    names: Vec<(String, Found)>,
    /// What no shader reads, so that it was not loaded.
    #[serde(skip)]
    unread: Vec<UnreadPart>,
    #[serde(skip)]
    pub(super) bound: Bound,
}

/// Where a resource is found.
#[derive(Clone, Copy, Debug)]
enum Found {
    /// At a set and binding.
    Binding([u32; 2]),
    /// At a device address alone.
    Address(u64),
}

impl SceneOutcome {
    /// A buffer by the names of its members; one that is bound nowhere as the type of the first
    /// pointer to it.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such buffer, or no shader uses it.
    pub fn buffer(&self, name: &str) -> Result<Value> {
        match self.find(name)? {
            Found::Binding([set, binding]) => self.bound.buffer(set, binding),
            Found::Address(address) => self.bound.buffer_at(address),
        }
    }

    /// A buffer as a row of a plain Rust type; also one that is reached by its address alone.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such buffer, or its size is no multiple.
    pub fn read_buffer<T: AnyBitPattern>(&self, name: &str) -> Result<Vec<T>> {
        match self.find(name)? {
            Found::Binding([set, binding]) => bound::rows(&self.bound.buffer_bytes(set, binding)?),
            Found::Address(address) => self.bound.read_buffer_at(address),
        }
    }

    /// The texels of an image.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such image.
    pub fn image(&self, name: &str) -> Result<Texels> {
        match self.find(name)? {
            Found::Binding([set, binding]) => self.bound.image(set, binding),
            Found::Address(_) => Err(invalid(format!("`{name}` is a buffer"))),
        }
    }

    /// The descriptor of a resource, with what shaders wrote, to bind it elsewhere:
    /// `test.descriptor(0, 2, outcome.descriptor("picture")?)`. No run changes it.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such resource.
    pub fn descriptor(&self, name: &str) -> Result<Descriptor> {
        match self.find(name)? {
            Found::Binding([set, binding]) => self.bound.descriptor(set, binding),
            Found::Address(_) => self.bound.named_descriptor(name),
        }
    }

    fn find(&self, name: &str) -> Result<Found> {
        let found = self.names.iter().find(|(known, _)| known == name).map(|(_, place)| *place);
        found.ok_or_else(|| match self.unread.iter().find(|part| part.name == name) {
            Some(UnreadPart { what, reason, .. }) => invalid(format!("the {what} was not loaded: {reason}"))
                .note("help: call `read_all` of the `LoadedScene` to load everything"),
            None => unknown("resource", name, self.names.iter().map(|(known, _)| known.as_str())),
        })
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

/// Equal by the pass, counts, printed lines, buffers and images.
impl PartialEq for SceneOutcome {
    fn eq(&self, other: &Self) -> bool {
        self.pass == other.pass
            && self.stats == other.stats
            && self.printed == other.printed
            && self.bound == other.bound
    }
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

        let error = scene.set_buffer("number", &[1u32]).unwrap_err();
        assert_eq!(error.message(), "the scene has no buffer `number`");
        assert!(error.render().contains("did you mean `numbers`?"), "{}", error.render());
        let error = scene.set_transform(0, [[0.0; 4]; 3]).unwrap_err();
        assert_eq!(error.message(), "the scene has no instance 0, only 0");
        let _ = std::fs::remove_dir_all(&folder);
    }
}
