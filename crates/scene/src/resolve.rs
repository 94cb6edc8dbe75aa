//! Resolves a scene's files: names become indices, files become bytes.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::assign_addresses;
use crate::data::DataPieces;
use crate::data_sources::DataSources;
use crate::encoding::Data;
use crate::entry::Entry;
use crate::file::{NamedPipelineEntry, PipelineEntry, RayEntry, SceneFile, ShaderEntry};
use crate::files::{Counted, Files, SceneFiles};
use crate::geometry::GeometryEntry;
use crate::instance_entry::InstanceEntry;
use crate::mesh_piece::SceneMeshes;
use crate::models::ModelEntry;
use crate::open_models::{MeshSelection, OpenModels};
use crate::pass_entry::{DispatchEntry, PassEntry};
use crate::read::{Diagnostics, Document, Spanned, unknown_name};
use crate::read_file::read_limited;
use crate::resolve::kept_places::KeptPlace;
use crate::resolve::modules::{ModuleKey, SceneModules};
use crate::resolve::variants::chosen_variant;
use crate::resolved::{ResolvedGroup, ResolvedScene, ShaderModule, UnreadContents, UnreadPart};
use crate::resources::ResourceEntry;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::InputLimit;
use anyhit_base::progress::Work;
use anyhit_base::sorted::{SortedSet, sort};
use anyhit_engine::geometry::Precision;
use anyhit_engine::machine::PrintedBytes;
use anyhit_engine::machine::sampler::Sampler;
use anyhit_engine::module::Module;
use anyhit_engine::pipeline::DeviceProfile;
use anyhit_engine::reflect::lookup::DataBlock;

mod bindings;
mod kept_places;
mod modules;
mod passes;
mod structures;
mod unread;
mod variants;
mod views;

/// The options by which a command line changes a scene.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// The launch's width and height (`--size`); images without a size and cameras follow.
    pub size: Option<[u32; 2]>,
    /// How intersections are computed (`--precision`), instead of the scene's own choice.
    pub precision: Option<Precision>,
    /// The name of the `[[variant]]` of the scene's own file to use (`--variant`).
    pub variant: Option<String>,
    /// Whether storage images that are only filled may exceed the limit of images in memory,
    /// because the launch outputs them in bands.
    pub streams: bool,
    /// Whether shaders alone trace rays, so that acceleration structures that none of them reaches
    /// are not needed.
    pub only_shaders_trace: bool,
}

/// Reads a scene with everything that it names.
///
/// # Errors
/// All mistakes of the scene and its files in one error.
pub fn load(path: &Path, files: &dyn Files, options: &LoadOptions) -> Result<ResolvedScene> {
    load_bytes(path, files.read_limited(path, InputLimit::SceneBytes)?, files, options)
}

/// Reads a scene from the bytes of its file; `path` is where its relative paths start from.
///
/// # Errors
/// As [`load`].
pub fn load_bytes(
    path: &Path,
    bytes: Vec<u8>,
    files: &dyn Files,
    options: &LoadOptions,
) -> Result<ResolvedScene> {
    load_shared_text(path, text_of(path, bytes)?.into(), files, options)
}

/// Reads a scene from a text; its relative paths are relative to the folder of `path`.
///
/// # Errors
/// As [`load`].
pub fn load_text(path: &Path, text: &str, files: &dyn Files, options: &LoadOptions) -> Result<ResolvedScene> {
    load_shared_text(path, text.into(), files, options)
}

/// [`load_text`] of a text that the scene keeps.
fn load_shared_text(
    path: &Path,
    text: Arc<str>,
    files: &dyn Files,
    options: &LoadOptions,
) -> Result<ResolvedScene> {
    let _work = Work::new("loading the scene");
    let limits = files.limits();
    let report = Diagnostics::within(limits);
    let most = InputLimit::SceneBytes;
    limits.check(most, text.len() as u64, ErrorKind::InvalidScene)?;
    let own = SceneFile::parse(path, text, &report)?;
    resolve_file(own, files, options, report)
}

/// A scene file that is parsed once and loaded several times, as its variants are.
#[derive(Clone, Debug)]
pub struct ParsedScene(Arc<(SceneFile, Vec<String>)>);

impl ParsedScene {
    /// Keeps a file that was read; `None` where the report about it has mistakes, which each load
    /// of the file is to return.
    pub fn keep(file: &SceneFile, report: &Diagnostics) -> Option<Self> {
        let notes = report.take_notes();
        report.is_empty().then(|| Self(Arc::new((file.clone(), notes))))
    }

    /// Resolves the file as [`load`] does, without reading it again.
    ///
    /// # Errors
    /// As [`load`].
    pub fn load(&self, files: &dyn Files, options: &LoadOptions) -> Result<ResolvedScene> {
        let (file, notes) = &*self.0;
        let report = Diagnostics::within(files.limits());
        notes.iter().for_each(|note| report.note(note.clone()));
        resolve_file(file.clone(), files, options, report)
    }
}

/// Two files are equal if they have the same path and text.
impl PartialEq for ParsedScene {
    fn eq(&self, other: &Self) -> bool {
        self.0.0.source() == other.0.0.source()
    }
}

impl Eq for ParsedScene {}

/// Reads what a file includes, and resolves them; `report` is that of its parsing.
fn resolve_file(
    own: SceneFile,
    files: &dyn Files,
    options: &LoadOptions,
    report: Diagnostics,
) -> Result<ResolvedScene> {
    let files = Counted::new(files);
    let mut parts = Vec::new();
    include(own, &files, &report, &mut Vec::new(), &mut parts);
    let resolver = Resolver::new(parts, &files, options, &report);
    let scene = resolver.resolve();
    report.finish()?;
    Ok(scene.expect("bug in anyhit: a scene failed without an error"))
}

/// Refuses a module where a scene file is needed.
///
/// # Errors
/// `InvalidScene`.
pub fn refuse_module(path: &Path, bytes: &[u8]) -> Result<()> {
    // SPIR-V, section 2.3, "Magic Number": in either byte order.
    if !matches!(bytes, [0x03, 0x02, 0x23, 0x07, ..] | [0x07, 0x23, 0x02, 0x03, ..]) {
        return Ok(());
    }
    let message = "the file is a SPIR-V module, expected a scene or test file (TOML)";
    Err(Error::new(ErrorKind::InvalidScene, message).at(Place::File(path.to_path_buf())).note(
        "help: pass modules to `anyhit run`, `smoke` or `inspect`, or create a scene with `anyhit scene \
         --init MODULE`",
    ))
}

fn text_of(path: &Path, bytes: Vec<u8>) -> Result<String> {
    refuse_module(path, &bytes)?;
    String::from_utf8(bytes).map_err(|error| {
        let message = format!("not UTF-8 at byte {}", error.utf8_error().valid_up_to());
        Error::new(ErrorKind::InvalidScene, message).at(Place::File(path.to_path_buf()))
    })
}

/// Appends a file to `parts`, after the files that it includes.
fn include(
    file: SceneFile,
    files: &dyn Files,
    report: &Diagnostics,
    open: &mut Vec<PathBuf>,
    parts: &mut Vec<SceneFile>,
) {
    open.push(file.source().path.clone());
    for wanted in &file.include {
        let path = file.source().sibling(&wanted.value);
        if open.contains(&path) {
            report.push(wanted.span.error("cyclic include"));
            continue;
        }
        let count = (parts.len() + open.len() + 1) as u64;
        if let Err(error) = files.limits().check(InputLimit::SceneFiles, count, ErrorKind::InvalidScene) {
            // Each further one would be told so, and there may be as many as the file has lines.
            report.push(error.at(wanted.span.place()));
            break;
        }
        let read = read_limited(files, &wanted.value, &wanted.span, InputLimit::SceneBytes);
        let part = read
            .and_then(|bytes| text_of(&path, bytes))
            .and_then(|text| SceneFile::parse(&path, text, report));
        if let Some(part) = report.keep(part) {
            include(part, files, report, open, parts);
        }
    }
    open.pop();
    parts.push(file);
}

/// The merged parts of a scene: later definitions of a name replace earlier ones.
struct Resolver<'a> {
    files: &'a dyn Files,
    report: &'a Diagnostics,
    options: LoadOptions,
    geometry: ByName<GeometryEntry>,
    models: Vec<ModelEntry>,
    open_models: OpenModels,
    /// The names that models give to their geometries and meshes.
    mesh_names: HashMap<String, Result<MeshSelection>>,
    instances: Vec<InstanceEntry>,
    shader_entries: ByName<ShaderEntry>,
    samplers: ByName<Sampler>,
    resource_entries: ByName<ResourceEntry>,
    /// Where resources are kept that are bound somewhere, by their names.
    kept_places: HashMap<String, KeptPlace>,
    device: Option<DeviceProfile>,
    pipeline: Option<PipelineEntry>,
    pipelines: ByName<NamedPipelineEntry>,
    push_constants: Option<DataPieces>,
    dispatches: Vec<DispatchEntry>,
    passes: Vec<PassEntry>,
    precision: Precision,
    launch: [u32; 3],
    /// Whether a file or the command line says how large the launch is.
    has_launch: bool,
    rays: Vec<RayEntry>,
    own: Document,
    /// Those of all files of the scene.
    documents: Vec<Document>,
    /// What nothing reads.
    unread: Vec<UnreadPart>,
    modules: Vec<ShaderModule>,
    /// The modules by their paths, and by what they are compiled with.
    module_places: HashMap<ModuleKey, usize>,
    /// The groups of all pipelines, one after the other.
    groups: Vec<ResolvedGroup>,
    /// The files of modules that were loaded before a shader of the scene named them.
    read_early: RefCell<HashMap<ModuleKey, ShaderModule>>,
    /// The modules that were loaded early, for what they declare, by their paths.
    loaded: RefCell<HashMap<ModuleKey, Result<Arc<Module>>>>,
}

impl<'a> Resolver<'a> {
    fn new(
        parts: Vec<SceneFile>,
        files: &'a dyn Files,
        options: &LoadOptions,
        report: &'a Diagnostics,
    ) -> Self {
        let own = parts.last().expect("bug in anyhit: a scene without a file").document.clone();
        let documents = parts.iter().map(|part| part.document.clone()).collect();
        let mut all = Self {
            files,
            report,
            options: options.clone(),
            geometry: ByName::default(),
            models: Vec::new(),
            open_models: OpenModels::default(),
            mesh_names: HashMap::new(),
            instances: Vec::new(),
            shader_entries: ByName::default(),
            samplers: ByName::default(),
            resource_entries: ByName::default(),
            kept_places: HashMap::new(),
            device: None,
            pipeline: None,
            pipelines: ByName::default(),
            push_constants: None,
            dispatches: Vec::new(),
            passes: Vec::new(),
            precision: Precision::default(),
            launch: [1; 3],
            has_launch: options.size.is_some(),
            rays: Vec::new(),
            own,
            documents,
            unread: Vec::new(),
            modules: Vec::new(),
            module_places: HashMap::new(),
            groups: Vec::new(),
            read_early: RefCell::default(),
            loaded: RefCell::default(),
        };
        let mut variants = Arc::default();
        for part in parts {
            // The last part is the scene's own file, whose variants are used.
            variants = part.variants;
            all.geometry.merge(part.geometry);
            all.shader_entries.merge(part.shaders);
            all.samplers.merge(part.samplers);
            all.resource_entries.merge(part.resources);
            all.instances.extend(part.instances);
            all.models.extend(part.models);
            all.device = part.device.or(all.device);
            all.pipeline = part.pipeline.or(all.pipeline);
            all.pipelines.merge(part.pipelines);
            all.push_constants = part.push_constants.or(all.push_constants);
            all.precision = part.precision.unwrap_or(all.precision);
            all.has_launch |= part.launch.is_some();
            all.launch = part.launch.map_or(all.launch, |launch| launch.value);
            if !part.dispatches.is_empty() {
                all.dispatches = part.dispatches;
            }
            if !part.passes.is_empty() {
                all.passes = part.passes;
            }
            if !part.rays.is_empty() {
                all.rays = part.rays;
            }
        }
        if let Some(variant) = chosen_variant(options, &variants, report) {
            let unknown = |entry: &Entry<ShaderEntry>| all.shader_entries.get(&entry.name.value).is_none();
            for entry in variant.shaders.iter().filter(|entry| unknown(entry)) {
                let message = format!("no shader `{}` to replace", entry.name.value);
                report.push(entry.name.span.error(message));
            }
            all.shader_entries.merge(variant.shaders.clone());
        }
        all.precision = options.precision.unwrap_or(all.precision);
        if let Some([width, height]) = options.size {
            all.launch = [width, height, all.launch[2]];
        }
        all
    }

    fn resolve(mut self) -> Option<ResolvedScene> {
        let count = self.launch.iter().fold(1_u128, |count, side| count * u128::from(*side));
        if count == 0 || count > 1 << 30 {
            let message = format!("a launch of {:?} does not have 1 to 2^30 invocations", self.launch);
            self.report.push(Error::new(ErrorKind::InvalidArgument, message));
            return None;
        }
        self.leave_out_unread();
        self.expand_models();
        self.allot_places();
        let readers = self.push_constant_readers();
        let tlas = self.structures();
        let (pipeline, pipelines) = self.all_pipelines();
        let mut dispatches = self.dispatches();
        let passes = self.passes(&mut dispatches, &pipelines);
        let unbound = self.unbound_buffers();
        let resources = self.bindings(&tlas, &unbound, !dispatches.is_empty());
        let readers: Vec<_> = readers.iter().collect();
        let push_constants = self.data(self.push_constants.as_ref(), DataBlock::PushConstants, &readers);
        self.check_rays(&passes, !pipeline.sbt.raygen.is_empty(), dispatches.len());
        if passes.is_empty() && !pipeline.sbt.raygen.is_empty() {
            self.note_default_launch("");
        }
        let geometry_names = tlas.iter().map(|(name, _)| self.geometry_names(name)).collect();
        let unread_contents = self.unread_contents();
        let scene = ResolvedScene {
            path: self.own.source().path.clone(),
            geometry_names,
            tlas: tlas.into_iter().map(|(name, tlas)| Some((name, tlas?))).collect::<Option<_>>()?,
            loaded: self.loaded_modules(),
            shaders: self.modules,
            pipeline,
            pipelines,
            resources,
            unbound,
            unread: self.unread,
            unread_contents,
            kept_addresses: SortedSet::new(),
            dispatches,
            passes,
            push_constants,
            device: self.device.unwrap_or_default(),
            printed_bytes: self
                .pipeline
                .as_ref()
                .and_then(|pipeline| pipeline.printed_bytes)
                .map_or_else(PrintedBytes::default, PrintedBytes),
            memory: self.pipeline.as_ref().and_then(|pipeline| pipeline.memory).unwrap_or_default(),
            missing_descriptors: self.pipeline.as_ref().map_or_else(Default::default, |one| one.unbound),
            launch: self.launch,
            rays: self.rays,
            document: self.own,
            notes: self.report.take_notes(),
            files: SceneFiles::like(self.files),
        };
        if self.report.is_empty() {
            assign_addresses::check(&scene, self.report);
        }
        Some(scene)
    }

    /// Lists and notes the unread content of the scene's models, by file.
    fn unread_contents(&self) -> Vec<UnreadContents> {
        let models = self.open_models.opened();
        let partial = models.iter().filter(|model| !model.unread.is_empty());
        let mut contents: Vec<_> = partial.map(|model| UnreadContents::of(model)).collect();
        // One file may be open at several times, with other animations left.
        sort(&mut contents);
        contents.dedup();
        contents.iter().for_each(|contents| self.report.note(contents.to_string()));
        contents
    }

    /// Notes that a launch has the size that no file gives; `of` says which launch.
    fn note_default_launch(&self, of: &str) {
        if !self.has_launch {
            let path = escape::path(&self.own.source().path);
            self.report.note(format!(
                "{path}: no `launch`{of}: one invocation runs; set the size with `launch = [WIDTH, HEIGHT]`"
            ));
        }
    }

    /// The data that shaders read through a block; `own` are the shaders that it is for, all of the
    /// scene where none is given.
    fn data(&self, data: Option<&DataPieces>, block: DataBlock, own: &[&Spanned<String>]) -> Data {
        let Some(data) = data else { return Data::default() };
        let modules = SceneModules { resolver: self, own };
        let data = data.resolve_for(&self.sources(), &modules, Some(block));
        self.report.keep(data).unwrap_or_default()
    }

    /// What data may name.
    fn sources(&self) -> DataSources<'_> {
        DataSources {
            files: self.files,
            aspect: self.launch[0] as f32 / self.launch[1] as f32,
            models: &self.open_models,
            meshes: Some(SceneMeshes { names: &self.mesh_names, instances: &self.instances }),
        }
    }

    /// Finds the entry with a name; reports an error if there is none.
    fn find<'e, T>(&self, entries: &'e ByName<T>, name: &Spanned<String>, what: &str) -> Option<&'e T> {
        if let Some(entry) = entries.get(&name.value) {
            return entry.content.as_ref();
        }
        if self.report.is_full() {
            self.report.count(1);
            return None;
        }
        let names = || entries.entries.iter().map(|entry| entry.name.value.as_str());
        let message = format!("no {what} is named `{}`", name.value);
        let error = unknown_name(name, message, "no such name", names);
        self.report.push(error);
        None
    }
}

/// Entries in their order, each found by its name: a scene may have hundreds of thousands.
struct ByName<T> {
    entries: Vec<Entry<T>>,
    places: HashMap<String, usize>,
}

impl<T> Default for ByName<T> {
    fn default() -> Self {
        Self { entries: Vec::new(), places: HashMap::new() }
    }
}

impl<T> ByName<T> {
    /// Adds entries; one of a known name replaces the other.
    fn merge(&mut self, more: Vec<Entry<T>>) {
        for entry in more {
            match self.places.get(&entry.name.value) {
                Some(&at) => self.entries[at] = entry,
                None => {
                    self.places.insert(entry.name.value.clone(), self.entries.len());
                    self.entries.push(entry);
                }
            }
        }
    }

    fn get(&self, name: &str) -> Option<&Entry<T>> {
        self.places.get(name).map(|&at| &self.entries[at])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::EmbeddedFiles;
    use crate::resolved::{ResolvedPassWork, ResolvedRecord, ShaderCode};
    use crate::resources::Resource;
    use crate::specialization::SpecializationKey;
    use anyhit_engine::accel::{GeometryData, GeometryFlags};
    use anyhit_engine::machine::format::Format;
    use anyhit_engine::machine::sampler::Filter;

    fn scene(text: &str, options: &LoadOptions) -> ResolvedScene {
        let files = [
            ("a/s.toml", text.as_bytes()),
            ("a/all.spv", b"SPIR"),
            (
                "a/shared/geometry.toml",
                b"version = 1\n[geometry.g]\ntype = 'obj'\nfile = 'm.obj'\nopaque = true\n",
            ),
            ("a/shared/m.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ];
        load(Path::new("a/s.toml"), &EmbeddedFiles(&files), options).unwrap()
    }

    #[test]
    fn passes_are_in_order_and_name_records_or_shaders() {
        let text = "version = 1\nlaunch = [3, 2]\n[shaders.all]\npath = 'all.spv'\n\
            [pipeline]\nraygen = ['all:first', { name = 'second', shader = 'all:other' }]\n\
            [[pass]]\nraygen = 'second'\nlaunch = 5\n[[pass]]\nshader = 'all:sum'\ngroups = 4\n\
            [[pass]]\nraygen = 'all:first'\n[[pass]]\nname = 'the first record'\n";
        let scene = scene(text, &LoadOptions::default());
        let launch = |raygen, size| ResolvedPassWork::Launch {
            pipeline: None,
            raygen,
            size,
            indirect: None,
            push_constants: None,
        };
        let work: Vec<_> = scene.passes.iter().map(|pass| pass.work.clone()).collect();
        assert_eq!(
            work,
            [launch(1, [5, 1, 1]), ResolvedPassWork::Dispatch(0), launch(0, [3, 2, 1]), launch(0, [3, 2, 1])]
        );
        assert_eq!((scene.dispatches.len(), scene.dispatches[0].groups), (1, [4, 1, 1]));
    }

    #[test]
    fn a_pass_says_what_is_wrong_with_it() {
        let head = "version = 1\n[shaders.all]\npath = 'all.spv'\n[pipeline]\nraygen = 'all:first'\n";
        for (more, told) in [
            ("[[pass]]\ngroups = 1\n", "a pass must be either a launch (`pipeline`, `raygen`) or a dispatch"),
            ("[[pass]]\nraygen = 'all:fist'\n", "the pipeline has no `raygen` named `all:fist`"),
            ("[[pass]]\nraygen = 'x'\n", "available: all:first"),
            (
                "[[pass]]\nraygen = 'all:first'\n[[dispatch]]\nshader = 'all'\n",
                "`[[pass]]` and `[[dispatch]]` exclude each other",
            ),
            ("[[pass]]\npipeline = 'ao'\n", "no pipeline is named `ao`"),
            (
                "[[pass]]\npipeline = 'ao'\nshader = 'all'\n",
                "a pass must be either a launch (`pipeline`, `raygen`)",
            ),
            ("[pipelines.ao]\n[[pass]]\npipeline = 'ao'\n", "the pipeline of this pass has no `raygen`"),
            (
                "[pipelines.ao]\nmemory = 'robust'\n",
                "`memory` applies to all passes: move it to `[pipeline]`",
            ),
            (
                "[[pass]]\nraygen = 'all:first'\nname = 'a'\n[[pass]]\nshader = 'all'\nname = 'a'\n",
                "two passes are named `a`",
            ),
            ("[[pass]]\nshader = 'all'\nname = '1'\n", "numbers are the indices of passes"),
            ("[[pass]]\nshader = 'all'\n[[ray]]\npixel = [0, 0]\npass = 0\n", "a ray needs a launch"),
            ("[[pass]]\nshader = 'all'\nname = 'x'\n[[ray]]\npixel = [0, 0]\npass = 'y'\n", "passes: 0 `x`"),
            ("[[ray]]\npixel = [0, 0]\npass = 1\n", "the scene has no pass `1`"),
            ("[[pass]]\nshader = 'all'\nresources = { a = 'b' }\n", "no resource is named `a`"),
            (
                "[[pass]]\nshader = 'all'\nresources = { image = 'buffer' }\n[resources.buffer]\n\
                 type = 'buffer'\nsize = 4\n[resources.image]\ntype = 'storage_image'\nbinding = 0\n\
                 format = 'r32f'\n",
                "`buffer` is a buffer, but `image` is an image",
            ),
            (
                "[[pass]]\nshader = 'all'\nresources = { a = 'b' }\n[resources.a]\ntype = 'buffer'\nsize = 4\n\
                 [resources.b]\ntype = 'buffer'\nsize = 4\n",
                "`a` is not bound",
            ),
        ] {
            let text = format!("{head}{more}");
            let files = [("s.toml", text.as_bytes()), ("all.spv", &b"SPIR"[..])];
            let error = load(Path::new("s.toml"), &EmbeddedFiles(&files), &LoadOptions::default());
            let error = error.unwrap_err().render();
            assert!(error.contains(told), "{more}: {error}");
        }
    }

    #[test]
    fn groups_are_shared_and_records_are_not() {
        let scene = scene(
            "version = 1\n[shaders.all]\npath = 'all.spv'\nspecialization = { 3 = 7, 4 = true }\n[pipeline]\n\
             raygen = 'all:rg'\nmiss = ['all:sky', {}]\nmax_recursion_depth = 2\n\
             hit = [{ closest_hit = 'all:ch', record = { f32 = 1 } }, { name = 'b', closest_hit = 'all:ch', \
             record = { u32 = 2 } }, { closest_hit = 'all:ch', any_hit = 'all' }]\n",
            &LoadOptions::default(),
        );
        assert_eq!(scene.shaders.len(), 1);
        assert_eq!(scene.shaders[0].code, ShaderCode::SpirV(b"SPIR".to_vec()));
        let records = |list: &[ResolvedRecord]| -> Vec<(Option<usize>, Vec<u8>)> {
            list.iter().map(|record| (record.group, record.data.bytes().unwrap().to_vec())).collect()
        };
        assert_eq!(records(&scene.pipeline.sbt.raygen), [(Some(0), vec![])]);
        assert_eq!(records(&scene.pipeline.sbt.miss), [(Some(1), vec![]), (None, vec![])]);
        let hit = [(Some(2), vec![0, 0, 0x80, 0x3f]), (Some(2), vec![2, 0, 0, 0]), (Some(3), vec![])];
        assert_eq!(records(&scene.pipeline.sbt.hit), hit);
        assert_eq!(scene.pipeline.sbt.hit[1].name.as_deref(), Some("b"));
        let ResolvedGroup::Hit(group) = &scene.pipeline.groups[3] else {
            panic!("{:?}", scene.pipeline.groups[3])
        };
        assert_eq!(group.closest_hit.as_ref().unwrap().entry, "ch");
        assert!(group.intersection.is_none());
        let any_hit = group.any_hit.as_ref().unwrap();
        // Without a name of its own a reference takes the shader's entry, `main`.
        assert_eq!(any_hit.entry, "main");
        let keys: Vec<_> = any_hit.specialization.iter().map(|(key, _)| key.clone()).collect();
        assert_eq!(keys, [SpecializationKey::Id(3), SpecializationKey::Id(4)]);
        assert_eq!(scene.pipeline.max_recursion_depth, Some(2));
    }

    #[test]
    fn an_included_file_has_its_own_folder_and_can_be_overridden() {
        let text = "version = 1\ninclude = 'shared/geometry.toml'\nlaunch = [8, 4]\n[[instance]]\ngeometry = 'g'\n\
                    [[instance]]\ngeometry = ['g']\nmask = 3\nflags = 'force_opaque'\ncustom_index = 9\nsbt_offset = 2\n";
        let resolved = scene(text, &LoadOptions::default());
        let (name, tlas) = &resolved.tlas[0];
        let [first, second] = tlas.instances() else { panic!() };
        assert_eq!(name, "main");
        assert!(Arc::ptr_eq(&first.blas, &second.blas), "one list of geometries is one BLAS");
        assert_eq!(first.blas.geometries()[0].flags, GeometryFlags::OPAQUE);
        assert_eq!((first.mask, first.custom_index, first.sbt_record_offset), (0xff, 0, 0));
        assert_eq!((second.mask, second.custom_index, second.sbt_record_offset), (3, 9, 2));
        assert_eq!(second.flags.0, 4);
        assert_eq!(resolved.launch, [8, 4, 1]);
        let own = format!(
            "{text}[geometry.g]\ntype = 'aabbs'\nboxes = [[[0, 1, 2], [3, 4, 5]], [0, 0, 0, 1, 1, 1]]\n"
        );
        let resolved = scene(&own, &LoadOptions::default());
        let geometry = &resolved.tlas[0].1.instances()[0].blas.geometries()[0];
        let boxes = vec![[0., 1., 2., 3., 4., 5.], [0., 0., 0., 1., 1., 1.]];
        assert_eq!(geometry.data, GeometryData::Aabbs(boxes));
    }

    #[test]
    fn transforms_by_hand() {
        let instance = |keys: &str| {
            let text =
                format!("version = 1\n[geometry.g]\ntype = 'plane'\n[[instance]]\ngeometry = 'g'\n{keys}\n");
            scene(&text, &LoadOptions::default()).tlas[0].1.instances()[0].transform
        };
        assert_eq!(instance("")[1], [0., 1., 0., 0.]);
        // A quarter turn about z takes x to y and y to -x; the scale comes before it.
        let turned =
            instance("rotate = { axis = [0, 0, 5], degrees = 90 }\nscale = [2, 3, 4]\ntranslate = [7, 8, 9]");
        assert_eq!(turned, [[0., -3., 0., 7.], [2., 0., 0., 8.], [0., 0., 4., 9.]]);
        let flat = instance("transform = [1,2,3,4, 5,6,7,8, 9,10,12,11]");
        assert_eq!(flat, [[1., 2., 3., 4.], [5., 6., 7., 8.], [9., 10., 12., 11.]]);
    }

    #[test]
    fn images_and_cameras_follow_the_launch() {
        let text = "version = 1\nlaunch = [4, 2]\n[resources.out]\ntype = 'storage_image'\nbinding = 1\nfill = [0, 1]\n\
                    format = 'r32ui'\n[resources.camera]\ntype = 'uniform_buffer'\nset = 1\nbinding = 0\n\
                    data = [{ camera = { eye = [0, 0, 1], look_at = [0, 0, 0], fov = 90 } }, { f32 = [1, 2, 3, 4] }]\n";
        let wide = scene(text, &LoadOptions { size: Some([6, 2]), ..LoadOptions::default() });
        assert_eq!(wide.output().unwrap().name, "out");
        let Resource::StorageImage(image) = &wide.resources[0].resource else { panic!() };
        // One texel stands for all: its red is 0.
        assert_eq!((image.shape.extent, &*image.texels.bytes().unwrap()), ([6, 2, 1], &[0; 4][..]));
        let bytes = wide.resources[1].resource.data().unwrap().bytes().unwrap();
        // Two matrices of 64 bytes, then the vector; the first scale of projection_inverse is the
        // aspect ratio, 6 / 2, times tan 45 degrees.
        assert_eq!(bytes.len(), 144);
        assert_eq!(bytes[64..68], 3.0_f32.to_le_bytes());
        assert_eq!(bytes[140..], 4.0_f32.to_le_bytes());
    }

    #[test]
    fn a_ray_has_defaults() {
        let text = "version = 1\n[[ray]]\norigin = [0, 0, 1]\ndirection = [0, 0, -1]\nflags = ['opaque', 'cull_opaque']\n";
        let resolved = scene(text, &LoadOptions::default());
        let RayEntry::Given(ray) = &resolved.rays[0] else { panic!() };
        assert_eq!((ray.t_min, ray.t_max, ray.cull_mask), (0.0, f32::INFINITY, 0xff));
        assert_eq!((ray.sbt_offset, ray.sbt_stride, ray.miss_index), (0, 1, 0));
        assert_eq!(ray.flags, 0x41);
    }

    #[test]
    fn layers_come_from_files_and_samplers_from_names() {
        let pixel = |color: [u8; 4]| {
            let texels = color.to_vec();
            let format = Format { srgb: false, ..Format::RGBA8_SRGB };
            crate::image::Picture { format, extent: [1, 1], texels }
                .encode_png(crate::image::PixelEncoding::STORED)
                .unwrap()
        };
        let text = "version = 1\n[samplers.sharp]\nfilter = 'nearest'\nmin_filter = 'linear'\n[resources.a]\n\
                    type = 'combined_image_sampler'\nbinding = 0\ndimension = '2d_array'\nfile = ['r.png', 'g.png']\n\
                    sampler = 'sharp'\n[resources.b]\ntype = 'sampled_image'\nbinding = 0\nelement = 1\nfile = 'g.png'\n\
                    format = 'r32f'\n";
        let (red, green) = (pixel([255, 0, 0, 255]), pixel([0, 255, 0, 128]));
        let files = [("s.toml", text.as_bytes()), ("r.png", &red), ("g.png", &green)];
        let scene = load(Path::new("s.toml"), &EmbeddedFiles(&files), &LoadOptions::default()).unwrap();
        let Resource::CombinedImageSampler(image, sampler) = &scene.resources[0].resource else { panic!() };
        assert_eq!(
            (image.format, image.shape.extent, image.shape.layers),
            (Format::RGBA8_SRGB, [1, 1, 1], 2)
        );
        assert_eq!(*image.texels.bytes().unwrap(), [255, 0, 0, 255, 0, 255, 0, 128]);
        assert_eq!((sampler.mag_filter, sampler.min_filter), (Filter::Nearest, Filter::Linear));
        assert_eq!(scene.resources[1].element, 1);
        let Resource::SampledImage(image) = &scene.resources[1].resource else { panic!() };
        assert_eq!(*image.texels.bytes().unwrap(), 0.0_f32.to_le_bytes());
    }
}
