//! A first case for compiled shaders, written from what their modules declare.

mod fits;
mod pointees;
mod resources;
mod scene;
mod sources;
mod traces;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::init::resources::{ELEMENTS, Resources};
use crate::init::traces::BindingTable;
use crate::suite::{Outcome, Suite, SuiteOptions};
use anyhit_base::error::{Error, ErrorKind, Result, Warning};
use anyhit_base::input::{InputLimit, read_regular};
use anyhit_base::{atomic_file, escape};
use anyhit_compile::SourceWords;
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::{EntryPoint, Stage};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::reflect::{Layout, Rules};
use anyhit_scene::{RunLimits, SceneFiles};

pub use scene::{WrittenScene, scene};

/// A case that was written.
#[derive(Clone, Debug)]
pub struct WrittenCase {
    /// Its `scene.toml`.
    pub path: PathBuf,
    /// Why it does not pass yet, where it does not.
    pub failure: Option<Error>,
    /// What holds zeros, and so may need other values: resources, push constants, records and
    /// payloads, as the scene names them.
    pub zeros: Vec<String>,
}

/// Writes `scene.toml` into a folder, which is made where it is not there: shaders, a pipeline,
/// resources of the right kind and size, a primitive that suits the shaders, and a ray that meets
/// it. Then runs it once, within the limits, and records what came out, so that it passes. Modules
/// are read within the limits of `files`; where that has a root, modules and folder lie inside.
///
/// # Errors
/// `InvalidArgument` where the folder holds a scene already, or no module has a ray-tracing entry
/// point; `InvalidScene` where something lies outside the root; what loading and compiling report;
/// what the first run reports, where it cannot run.
pub fn case(
    modules: &[PathBuf],
    folder: &Path,
    files: &SceneFiles,
    limits: &RunLimits,
) -> Result<WrittenCase> {
    if let Some(root) = &files.root {
        // Before anything is written. Of the folder what is there already must lie inside.
        let there = folder.ancestors().find(|folder| folder.exists());
        let there = there.filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        for path in modules.iter().map(PathBuf::as_path).chain([there]) {
            root.resolve(path)?;
        }
    }
    let scene = folder.join("scene.toml");
    if scene.exists() {
        let message = format!("{} already exists", escape::path(&scene));
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    let mut shaders = Shaders::default();
    for path in modules {
        shaders.add(path, files, &SourceWords::default(), &is_ray_tracing)?;
    }
    if shaders.all.is_empty() {
        let message = "no module has an entry point of a ray-tracing stage";
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    shaders.check_types()?;
    std::fs::create_dir_all(folder).map_err(|error| Error::io(folder, error))?;
    let text = shaders.scene(folder)?;
    atomic_file::write(&scene, &text)?;
    let failure = record(&scene, text, files, limits)?;
    Ok(WrittenCase { path: scene, failure, zeros: shaders.zeros() })
}

/// Runs the case and writes what it finds; a launch that traps is expected to.
fn record(scene: &Path, mut text: String, files: &SceneFiles, limits: &RunLimits) -> Result<Option<Error>> {
    let mut first = None;
    let suite = Suite::find_within(&[scene.to_path_buf()], &|_, _| Ok(files.clone()))?;
    let options = SuiteOptions {
        jobs: 1,
        bless: true,
        no_explanation: true,
        limits: *limits,
        ..SuiteOptions::default()
    };
    let mut ran = Vec::new();
    suite.run(&options, &mut |finished, _| {
        ran.push(finished.clone());
        Ok(())
    })?;
    for finished in &ran {
        match &finished.outcome {
            Outcome::Broken(error) => return Err(error.clone()),
            Outcome::Failed(failure) => {
                let Some(error) = failure.errors.first() else { continue };
                let comment = |line: &str| format!("# {line}\n");
                first.get_or_insert_with(|| error.clone());
                let why: String = error.render().lines().map(comment).collect();
                let now = read_regular(scene, files.root.as_ref(), InputLimit::SceneBytes, &files.limits);
                text = now.ok().and_then(|now| String::from_utf8(now).ok()).unwrap_or(text);
                let _ = write!(
                    text,
                    "\n# `{}` does not run yet: fill the buffers and the payload as the shaders \
                     require.\n{why}",
                    finished.name
                );
                atomic_file::write(scene, &text)?;
            }
            _ => {}
        }
    }
    Ok(first)
}

/// An entry point with its name in the scene.
struct Shader {
    module: Arc<Module>,
    entry: EntryPoint,
    /// `name` or `name:entry`.
    reference: String,
}

impl Shader {
    /// Whether it reads a builtin with a word in its name.
    fn reads(&self, word: &str) -> bool {
        let variables = self.module.interface_of(&self.entry);
        let mut builtins = variables.iter().filter_map(|variable| variable.builtin);
        builtins.any(|number| {
            anyhit_engine::ops::builtin::find(number).is_some_and(|builtin| builtin.name.contains(word))
        })
    }
}

#[derive(Default)]
struct Shaders {
    /// Names, files, and how these are compiled where more than the file's name says it.
    files: Vec<(String, PathBuf, Option<SourceWords>)>,
    all: Vec<Shader>,
    /// What the compilers of sources warned of.
    warnings: Vec<Warning>,
}

impl Shaders {
    fn add(
        &mut self,
        path: &Path,
        files: &SceneFiles,
        words: &SourceWords,
        is_wanted: &dyn Fn(Stage) -> bool,
    ) -> Result<()> {
        let (module, settings) = Module::open_as(path, &files.limits, files.root.as_ref(), words)?;
        self.warnings.extend(module.warnings.iter().cloned());
        let entries = module.entry_points.iter().filter(|entry| is_wanted(entry.stage));
        let entries: Vec<EntryPoint> = entries.cloned().collect();
        let mut name = match &entries[..] {
            [] => return Ok(()),
            [only] => key(only.stage).to_owned(),
            _ => "shaders".to_owned(),
        };
        let plain = name.clone();
        let mut number = 1;
        while self.files.iter().any(|(known, ..)| *known == name) {
            number += 1;
            name = format!("{plain}_{number}");
        }
        for entry in entries {
            let reference = match entry.name.as_str() {
                "main" => name.clone(),
                other => format!("{name}:{other}"),
            };
            self.all.push(Shader { module: module.clone(), entry, reference });
        }
        let said = settings.is_some() && *words != SourceWords::default();
        self.files.push((name, path.to_path_buf(), said.then(|| words.clone())));
        Ok(())
    }

    /// The lines below `[shaders]`.
    fn file_lines(&self, folder: &Path) -> Result<String> {
        let mut out = String::new();
        for (name, path, words) in &self.files {
            let file = relative(path, folder)?;
            let value = match words {
                None => format!("{file:?}"),
                Some(words) => sources::table(&file, words, folder)?,
            };
            // Writing to a string does not fail.
            let _ = writeln!(out, "{name} = {value}");
        }
        Ok(out)
    }

    fn of(&self, stage: Stage) -> impl Iterator<Item = &Shader> {
        self.all.iter().filter(move |shader| shader.entry.stage == stage)
    }

    /// What the scene file gives zeros.
    fn zeros(&self) -> Vec<String> {
        let resources = Resources::of(&self.all, ELEMENTS);
        let mut zeros: Vec<String> = resources.buffers().map(|name| format!("[resources.{name}]")).collect();
        let (has_push_constants, has_records) = resources.has();
        zeros.extend(has_push_constants.then(|| "`push_constants`".to_owned()));
        zeros.extend(has_records.then(|| "`record` in [pipeline]".to_owned()));
        let payload = |shader: &Shader| {
            let variables = shader.module.interface_of(&shader.entry);
            variables.iter().any(|one| one.storage_class == storage::INCOMING_RAY_PAYLOAD)
        };
        zeros.extend(self.all.iter().any(payload).then(|| "`payload` of [[ray]]".to_owned()));
        zeros
    }

    /// The scene file.
    fn scene(&self, folder: &Path) -> Result<String> {
        let launches = self.of(Stage::RayGeneration).next().is_some();
        let resources = Resources::of(&self.all, ELEMENTS);
        let mut out = String::from("version = 1\ntitle = \"a first case\"\n");
        if launches {
            out.push_str("launch = [1, 1]\n");
        }
        out.push_str(&resources.push_constants().unwrap_or_default());
        out.push_str(&self.geometry());
        out.push_str("\n[shaders]\n");
        out.push_str(&self.file_lines(folder)?);
        out.push_str(&self.pipeline(&resources));
        out.push_str(&resources.text());
        if self.all.iter().any(|shader| !matches!(shader.entry.stage, Stage::RayGeneration | Stage::Callable))
        {
            out.push_str(&self.ray());
        }
        if launches {
            out.push_str(
                "\n# Recorded from a first run, not derived: check it, and explain it with `because`.\n",
            );
            out.push_str("[expect.stats]\nrays = 0\n");
        }
        Ok(out)
    }

    /// A primitive that suits what the shaders read, and an instance of it.
    fn geometry(&self) -> String {
        let reads = |word: &str| self.all.iter().any(|shader| shader.reads(word));
        let shape = if self.of(Stage::Intersection).next().is_some() {
            "type = \"aabbs\"\nboxes = [[[-1, -1, -1], [1, 1, 1]]]"
        } else if reads("LSS") {
            "type = \"lss\"\npositions = [[-1, 0, 0], [1, 0, 0]]\nradii = [0.5, 0.5]"
        } else if reads("Sphere") {
            "type = \"spheres\"\npositions = [[0, 0, 0]]\nradii = 0.5"
        } else {
            "type = \"triangles\"\nvertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]"
        };
        format!("\n[geometry.shape]\n{shape}\n\n[[instance]]\ngeometry = \"shape\"\n")
    }

    fn pipeline(&self, resources: &Resources) -> String {
        let table = self.binding_table();
        let mut out = String::from("\n[pipeline]\n");
        out.push_str(&resources.record_layouts());
        let raygen = self.of(Stage::RayGeneration).count();
        let callable = self.of(Stage::Callable).count();
        for (key, stage, shaders) in [
            ("raygen", Stage::RayGeneration, (0..raygen).map(Some).collect()),
            ("miss", Stage::Miss, table.miss),
            ("callable", Stage::Callable, (0..callable).map(Some).collect()),
        ] {
            let record = |at: Option<usize>| match at.and_then(|at| self.of(stage).nth(at)) {
                None => "{}".to_owned(),
                Some(shader) => match resources.record([shader].into_iter()) {
                    None => format!("{:?}", shader.reference),
                    Some(data) => format!("{{ shader = {:?}, record = {data} }}", shader.reference),
                },
            };
            let records: Vec<_> = shaders.into_iter().map(record).collect();
            if !records.is_empty() {
                let _ = writeln!(out, "{key} = [{}]", records.join(", "));
            }
        }
        out.push_str(&table.comment);
        let groups = self.groups();
        if groups.is_empty() {
            return out;
        }
        out.push_str("hit = [\n");
        for of_instance in groups.chunks(table.slots.len()) {
            for record in 0..table.records {
                let slot = table.slots.iter().position(|slot| *slot == record);
                let members = slot.and_then(|slot| of_instance.get(slot)).map_or(&[][..], |members| members);
                let mut keys: Vec<String> = members
                    .iter()
                    .map(|shader| format!("{} = {:?}", key(shader.entry.stage), shader.reference))
                    .collect();
                if let Some(data) = resources.record(members.iter().copied()) {
                    keys.push(format!("record = {data}"));
                }
                let line =
                    if keys.is_empty() { "{}".to_owned() } else { format!("{{ {} }}", keys.join(", ")) };
                let _ = writeln!(out, "    {line},");
            }
        }
        out.push_str("]\n");
        out
    }

    /// What the shader binding table needs for the rays that the shaders trace.
    fn binding_table(&self) -> BindingTable {
        BindingTable::of(&self.all, self.groups().len(), self.of(Stage::Miss).count())
    }

    /// A ray that meets the primitive, and an empty table that the first run fills.
    fn ray(&self) -> String {
        let mut out =
            String::from("\n[[ray]]\nname = \"head-on\"\norigin = [0.25, 0, 4]\ndirection = [0, 0, -1]\n");
        let payloads = self.all.iter().filter_map(|shader| {
            let variables = shader.module.interface_of(&shader.entry);
            let payload =
                variables.into_iter().find(|one| one.storage_class == storage::INCOMING_RAY_PAYLOAD)?;
            Some(Layout::new(&shader.module, payload.ty?, Rules::Packed).describe())
        });
        if let Some(lines) = payloads.max_by_key(Vec::len) {
            out.push_str("# The payload starts as zeros; set it with `payload = { f32 = [...] }`. It is:\n");
            for line in lines {
                let _ = writeln!(out, "#{line}");
            }
        }
        out.push_str("# Recorded from a first run, not derived: check it, and explain it with `because`.\n");
        out.push_str("[ray.expect]\n");
        out
    }
}

fn is_ray_tracing(stage: Stage) -> bool {
    !matches!(stage, Stage::Compute | Stage::Other(_))
}

fn key(stage: Stage) -> &'static str {
    match stage {
        Stage::RayGeneration => "raygen",
        Stage::Intersection => "intersection",
        Stage::AnyHit => "any_hit",
        Stage::ClosestHit => "closest_hit",
        Stage::Miss => "miss",
        Stage::Callable => "callable",
        Stage::Compute => "compute",
        _ => "shader",
    }
}

/// A path as a file in a folder names it.
fn relative(path: &Path, folder: &Path) -> Result<String> {
    let whole = |path: &Path| path.canonicalize().map_err(|error| Error::io(path, error));
    let (path, folder) = (whole(path)?, whole(folder)?);
    let common = path.components().zip(folder.components()).take_while(|(one, other)| one == other).count();
    let up = folder.components().skip(common).map(|_| "..".to_owned());
    let down = path.components().skip(common).map(|part| part.as_os_str().to_string_lossy().into_owned());
    Ok(up.chain(down).collect::<Vec<_>>().join("/"))
}
