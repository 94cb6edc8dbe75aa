//! The syntax of `scene.toml`: the content of a file before names are resolved and files loaded.
//!
//! The keys of the format are read here and in `geometry`, `generate`, `data` and `camera`; they
//! are documented in `docs/scene.md`.

use std::collections::hash_map::Entry as MapEntry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::data::DataPieces;
use crate::data_sources::DataSources;
use crate::device;
use crate::entry::{Entries, Entry};
use crate::files::EmbeddedFiles;
use crate::geometry::GeometryEntry;
use crate::instance_entry::InstanceEntry;
use crate::models::ModelEntry;
use crate::open_models::OpenModels;
use crate::pass_entry::{DispatchEntry, PassEntry, PassKey, launch};
use crate::read::{
    Diagnostics, Document, Named, OneOrMore, Parse, Span, Spanned, Table, TomlSource, TomlValue,
};
use crate::resources::ResourceEntry;
use crate::specialization::{SpecializationKey, SpecializationValue};
use crate::typed_scalars::{self, TypedScalars};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_compile::{CompilerFlags, Language, LanguageName, STAGE_NAMES};
use anyhit_engine::accel::{RayFlags, TraceRay};
use anyhit_engine::geometry::{Precision, Ray};
use anyhit_engine::machine::MemoryPolicy;
use anyhit_engine::machine::sampler::Sampler;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::{DeviceProfile, Pipeline, PipelineFlags, RayOperands, check_callable_depth};
use anyhit_engine::reflect::{Layout, Rules};

/// The version of the format that this crate reads.
pub const VERSION: u32 = 1;

/// One file of a scene.
#[derive(Clone, Debug)]
pub struct SceneFile {
    /// The file itself, for `[expect]`.
    pub document: Document,
    /// Files whose content is read first.
    pub include: Vec<Spanned<String>>,
    /// `[geometry.NAME]`
    pub geometry: Vec<Entry<GeometryEntry>>,
    /// `[[model]]`
    pub models: Vec<ModelEntry>,
    /// `[[instance]]`
    pub instances: Vec<InstanceEntry>,
    /// `[shaders.NAME]`
    pub shaders: Vec<Entry<ShaderEntry>>,
    /// `[device]`
    pub device: Option<DeviceProfile>,
    /// `[pipeline]`
    pub pipeline: Option<PipelineEntry>,
    /// `[pipelines.NAME]`
    pub pipelines: Vec<Entry<NamedPipelineEntry>>,
    /// `[samplers.NAME]`
    pub samplers: Vec<Entry<Sampler>>,
    /// `[resources.NAME]`
    pub resources: Vec<Entry<ResourceEntry>>,
    /// `push_constants`
    pub push_constants: Option<DataPieces>,
    /// `[[dispatch]]`
    pub dispatches: Vec<DispatchEntry>,
    /// `[[pass]]`
    pub passes: Vec<PassEntry>,
    /// `precision`
    pub precision: Option<Precision>,
    /// `launch`
    pub launch: Option<Spanned<[u32; 3]>>,
    /// `[[ray]]`
    pub rays: Vec<RayEntry>,
    /// `[[variant]]`
    pub variants: Arc<Variants>,
}

impl SceneFile {
    /// Reads a scene's text.
    ///
    /// # Errors
    /// `InvalidScene` with the mistakes where nothing more can be read from the text: no TOML, no
    /// version, another version. All other mistakes go to the report.
    pub fn parse(path: impl Into<PathBuf>, text: impl Into<Arc<str>>, report: &Diagnostics) -> Result<Self> {
        let (path, text): (PathBuf, Arc<str>) = (path.into(), text.into());
        let (mut geometry, mut instances) = (Vec::new(), Vec::new());
        let mut take = |key: &str, value: TomlValue<'_>| match key {
            "geometry" => geometry.extend(Entries::parse(value).unwrap_or_default().0),
            _ => instances.extend(<Vec<_>>::parse(value).unwrap_or_default()),
        };
        let apart = Diagnostics::within(*report.limits());
        let document = match Document::parse_apart(&path, text.clone(), &apart, &mut take) {
            Some(document) => document,
            None => {
                geometry.clear();
                instances.clear();
                Document::parse_within(path, text, report.limits())?
            }
        };
        version(&document)?;
        let mut file = Self::read(&document.root(report), &document);
        drop(document);
        file.geometry.append(&mut geometry);
        file.instances.append(&mut instances);
        // Large scenes consist of them.
        file.document.forget(&["geometry", "instance"]);
        Ok(file)
    }

    /// Reads the root table of a document.
    fn read(root: &Table<'_>, document: &Document) -> Self {
        let _: Option<u32> = root.optional("version");
        let _: Option<String> = root.optional("title");
        // The harness reads these tables; here they may hold anything.
        let _ = (root.value("expect"), root.value("sanitize"));
        let file = Self {
            include: root.optional::<OneOrMore<_>>("include").map_or(Vec::new(), |paths| paths.0),
            geometry: entries(root, "geometry"),
            models: root.or("model", Vec::new()),
            instances: root.or("instance", Vec::new()),
            shaders: entries(root, "shaders"),
            device: root.optional("device"),
            pipeline: root.optional("pipeline"),
            pipelines: entries(root, "pipelines"),
            samplers: entries(root, "samplers"),
            resources: entries(root, "resources"),
            push_constants: root.optional("push_constants"),
            dispatches: root.or("dispatch", Vec::new()),
            passes: root.or("pass", Vec::new()),
            precision: root.optional("precision"),
            launch: launch(root),
            rays: root.or("ray", Vec::new()),
            variants: Arc::new(Variants::of(root.or("variant", Vec::new()))),
            document: document.clone(),
        };
        root.finish();
        file
    }

    /// The file's path and text.
    pub fn source(&self) -> &Arc<TomlSource> {
        self.document.source()
    }
}

/// The root table of a scene.
impl Parse for SceneFile {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        Some(Self::read(&table, &value.to_document()))
    }
}

/// Checks the version, on which everything else depends.
fn version(document: &Document) -> Result<()> {
    let report = Diagnostics::default();
    let root = document.root(&report);
    let top = Span { source: document.source().clone(), range: 0..0 };
    let Some(value) = root.value("version") else {
        return Err(top.error("a scene must begin with its format version: `version = 1`"));
    };
    match <Spanned<u32>>::parse(value) {
        Some(Spanned { value: VERSION, .. }) => Ok(()),
        Some(Spanned { value: other, span }) if other < VERSION => {
            let message = format!("unknown version {other} of the scene format");
            Err(span.error(message).note(format!("help: write `version = {VERSION}`")))
        }
        Some(Spanned { value: other, span }) => {
            let own = env!("CARGO_PKG_VERSION");
            Err(Error::new(
                ErrorKind::UnsupportedFile,
                format!("version {other} of the scene format is not supported"),
            )
            .at_with(span.place(), format!("anyhit {own} supports version {VERSION}"))
            .note(format!("help: update anyhit to a release newer than {own}")))
        }
        None => report.finish(),
    }
}

/// The named tables under a key.
fn entries<T: Parse>(root: &Table<'_>, key: &'static str) -> Vec<Entry<T>> {
    root.or(key, Entries::default()).0
}

/// A file with shaders.
#[derive(Clone, Debug)]
pub struct ShaderEntry {
    /// The span of its table.
    pub span: Span,
    /// The SPIR-V module.
    pub path: Option<Spanned<String>>,
    /// The source text that it comes from.
    pub source: Option<Spanned<String>>,
    /// The language of the source, where its extension or `language` says it.
    pub language: Option<Language>,
    /// The stage of GLSL, or of the one entry point that is compiled of Slang and HLSL.
    pub stage: Option<Stage>,
    /// Folders where included files are searched, after the source's own.
    pub include_folders: Vec<Spanned<String>>,
    /// Flags of the compiler of the source.
    pub compiler_flags: CompilerFlags,
    /// The entry point of references that do not name one.
    pub entry: String,
    /// Specialization constants, each by its `constant_id` or name, and their values.
    pub specialization: Vec<(SpecializationKey, SpecializationValue)>,
}

impl Parse for ShaderEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if value.text().is_some() {
            let path: Option<Spanned<String>> = Spanned::parse(value);
            let is_source = path.as_ref().is_some_and(|file| Language::of(Path::new(&file.value)).is_some());
            let (path, source) = if is_source { (None, path) } else { (path, None) };
            return Some(Self {
                span: value.span(),
                language: source.as_ref().and_then(|file| Language::of(Path::new(&file.value))),
                stage: None,
                path,
                source,
                include_folders: Vec::new(),
                compiler_flags: CompilerFlags::default(),
                entry: "main".into(),
                specialization: Vec::new(),
            });
        }
        let table = Table::new(value)?;
        let path = table.optional("path");
        let source = table.optional("source");
        let include_folders = table.or("include_folders", Vec::new());
        let stage = table.optional("stage");
        let language = language(&table, source.as_ref(), stage);
        let compiler_flags = compiler_flags(&table, source.as_ref(), language.flatten());
        let entry = table.or("entry", "main".to_string());
        let specialization = table.value("specialization").map_or(Some(Vec::new()), specialization);
        table.finish();
        if !table.has("path") && !table.has("source") {
            return value.wrong("a shader needs the `path` of its .spv file, or its `source`");
        }
        let (specialization, compiler_flags) = (specialization?, compiler_flags?);
        Some(Self {
            span: value.span(),
            path,
            source,
            language: language?,
            stage,
            include_folders,
            compiler_flags,
            entry,
            specialization,
        })
    }
}

impl Named for LanguageName {
    const WHAT: &'static str = "language";
    const NAMES: &'static [(&'static str, Self)] = &LanguageName::NAMES;
}

impl Named for Stage {
    const WHAT: &'static str = "stage";
    const NAMES: &'static [(&'static str, Self)] = &STAGE_NAMES;
}

/// Reads the language of a source; `Some(None)` where nothing says it, which is told where it is
/// compiled.
fn language(
    table: &Table<'_>,
    source: Option<&Spanned<String>>,
    stage: Option<Stage>,
) -> Option<Option<Language>> {
    let name = table.optional("language");
    let said = ["stage", "language"].map(|key| (key, table.value(key)));
    let mut said = said.into_iter().filter_map(|(key, value)| Some((key, value?)));
    let Some(source) = source else {
        return match said.next() {
            Some((key, value)) => {
                value.wrong(format!("`{key}` applies only to a `source`: a module is already compiled"))
            }
            None => Some(None),
        };
    };
    match Language::said(name, stage, Path::new(&source.value)) {
        Ok(language) => Some(language),
        Err(message) => said.next().and_then(|(_, value)| value.wrong(message)),
    }
}

/// Reads the flags of the compiler of a source; its language says which one that is.
fn compiler_flags(
    table: &Table<'_>,
    source: Option<&Spanned<String>>,
    language: Option<Language>,
) -> Option<CompilerFlags> {
    let Some(value) = table.value("compiler_flags") else { return Some(CompilerFlags::default()) };
    let flags = <OneOrMore<Spanned<String>>>::parse(value)?.0;
    if source.is_none() {
        return value.wrong("`compiler_flags` apply only to a `source`: a module is already compiled");
    }
    // Of a source in no known language this is told where it is compiled.
    let Some(language) = language else { return Some(CompilerFlags::default()) };
    let words: Vec<&str> = flags.iter().map(|flag| flag.value.as_str()).collect();
    let refused = match CompilerFlags::parse(language, &words) {
        Ok(flags) => return Some(flags),
        Err(refused) => refused,
    };
    let span = flags.get(refused.at).map_or_else(|| value.span(), |flag| flag.span.clone());
    table.report().push(span.error(refused.message).note(refused.note));
    None
}

fn specialization(value: TomlValue<'_>) -> Option<Vec<(SpecializationKey, SpecializationValue)>> {
    let table = Table::new(value)?;
    let constant = |(name, value)| Some((SpecializationKey::of(&name), SpecializationValue::parse(value)?));
    table.iter().map(constant).collect()
}

/// A variant: other shaders for the scene, which must meet the same expectations.
#[derive(Clone, Debug)]
pub struct VariantEntry {
    /// A name for reports.
    pub name: Spanned<String>,
    /// `[variant.shaders.NAME]`: each replaces the scene's shader of that name.
    pub shaders: Vec<Entry<ShaderEntry>>,
}

/// The variants of a file, by their names.
#[derive(Clone, Debug, Default)]
pub struct Variants {
    /// All of them, in the order of the file.
    pub all: Vec<VariantEntry>,
    /// The place in `all` of the first of each name.
    places: FxHashMap<String, usize>,
    /// The places in `all` of those whose name another has that is before them.
    pub repeated: Vec<usize>,
}

impl Variants {
    fn of(all: Vec<VariantEntry>) -> Self {
        let (mut places, mut repeated) = (FxHashMap::default(), Vec::new());
        for (place, variant) in all.iter().enumerate() {
            match places.entry(variant.name.value.clone()) {
                MapEntry::Vacant(entry) => drop(entry.insert(place)),
                MapEntry::Occupied(_) => repeated.push(place),
            }
        }
        Self { all, places, repeated }
    }

    /// The first variant of a name.
    pub fn named(&self, name: &str) -> Option<&VariantEntry> {
        self.all.get(*self.places.get(name)?)
    }
}

impl Parse for VariantEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let name = table.required("name");
        let shaders = entries(&table, "shaders");
        table.finish();
        Some(Self { name: name?, shaders })
    }
}

/// `[pipeline]`: every list is in the order of its shader records.
#[derive(Clone, Debug)]
pub struct PipelineEntry {
    /// The span of its table.
    pub span: Span,
    /// The ray-generation shaders; the first is launched.
    pub raygen: Vec<GeneralEntry>,
    /// Miss shaders.
    pub miss: Vec<GeneralEntry>,
    /// Callable shaders.
    pub callable: Vec<GeneralEntry>,
    /// Hit groups.
    pub hit: Vec<HitEntry>,
    /// `maxPipelineRayRecursionDepth`
    pub max_recursion_depth: Option<u32>,
    /// The number of invocations in a subgroup.
    pub subgroup_size: Option<u32>,
    /// Instructions that an invocation may execute, counted at back edges, calls and stops.
    pub fuel: Option<u64>,
    /// Instructions that all invocations may execute together.
    pub launch_fuel: Option<u64>,
    /// How deeply callable shaders may call each other.
    pub max_callable_depth: Option<u32>,
    /// Bytes of registers of the shaders that call each other.
    pub max_stack_size: Option<u64>,
    /// How many bytes of what shaders print are kept.
    pub printed_bytes: Option<u64>,
    /// What happens on an access outside its buffer or image.
    pub memory: Option<MemoryPolicy>,
    /// What happens at a descriptor that nothing is bound to.
    pub unbound: MissingDescriptors,
    /// The pipeline's flags.
    pub flags: PipelineFlags,
}

impl Parse for PipelineEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let list = |key| table.optional::<OneOrMore<GeneralEntry>>(key).map_or(Vec::new(), |list| list.0);
        let subgroup_size = table.optional::<Spanned<u32>>("subgroup_size");
        let odd = |size: &&Spanned<u32>| !size.value.is_power_of_two() || size.value > 128;
        if let Some(Spanned { span, .. }) = subgroup_size.as_ref().filter(odd) {
            value.report().push(span.error("a subgroup must have 1, 2, 4, ... or 128 invocations"));
        }
        let callable_depth = table.optional::<Spanned<u32>>("max_callable_depth");
        if let Some(Spanned { span, value: depth }) = &callable_depth
            && let Err(error) = check_callable_depth(*depth)
        {
            value.report().push(span.error(error.message()));
        }
        let pipeline = Self {
            span: value.span(),
            raygen: list("raygen"),
            miss: list("miss"),
            callable: list("callable"),
            hit: table.or("hit", Vec::new()),
            max_recursion_depth: table.optional("max_recursion_depth"),
            subgroup_size: subgroup_size.map(|size| size.value),
            fuel: table.optional("fuel"),
            launch_fuel: table.optional("launch_fuel"),
            max_callable_depth: callable_depth.map(|depth| depth.value),
            max_stack_size: table.optional("max_stack_size"),
            printed_bytes: table.optional("printed_bytes"),
            memory: table.optional("memory"),
            unbound: table.or("unbound", MissingDescriptors::default()),
            flags: device::flags(&table),
        };
        table.finish();
        Some(pipeline)
    }
}

/// `[pipelines.NAME]`: a pipeline that passes name.
#[derive(Clone, Debug)]
pub struct NamedPipelineEntry(pub PipelineEntry);

impl Parse for NamedPipelineEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let mut scenes_own = ["memory", "printed_bytes", "unbound"].into_iter().filter(|key| table.has(key));
        if let Some(key) = scenes_own.next() {
            let found = table.value(key)?;
            return found.wrong(format!("`{key}` applies to all passes: move it to `[pipeline]`"));
        }
        PipelineEntry::parse(value).map(Self)
    }
}

/// What happens at a descriptor that shaders use and the scene does not bind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MissingDescriptors {
    /// The access traps.
    #[default]
    Trap,
    /// There is a null descriptor: loads are zeros, stores are dropped, rays miss.
    Zeros,
}

impl Named for MissingDescriptors {
    const WHAT: &'static str = "policy for unbound descriptors";
    const NAMES: &'static [(&'static str, Self)] = &[("trap", Self::Trap), ("zeros", Self::Zeros)];
}

impl Named for MemoryPolicy {
    const WHAT: &'static str = "memory policy";
    const NAMES: &'static [(&'static str, Self)] = &[("trap", Self::Trap), ("robust", Self::Robust)];
}

/// A shader record of a raygen, miss or callable shader: `"name"` or a table.
#[derive(Clone, Debug)]
pub struct GeneralEntry {
    /// A name for reports.
    pub name: Option<String>,
    /// `None` is a null record.
    pub shader: Option<Spanned<String>>,
    /// The data after the record's handle.
    pub record: Option<DataPieces>,
}

impl Parse for GeneralEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if value.text().is_some() {
            return Some(Self { name: None, shader: Spanned::parse(value), record: None });
        }
        let table = Table::new(value)?;
        let entry = Self {
            name: table.optional("name"),
            shader: table.optional("shader"),
            record: table.optional("record"),
        };
        table.finish();
        Some(entry)
    }
}

/// A hit record; without any shader it is a null record.
#[derive(Clone, Debug)]
pub struct HitEntry {
    /// A name for reports.
    pub name: Option<String>,
    /// Its closest-hit shader.
    pub closest_hit: Option<Spanned<String>>,
    /// Its any-hit shader.
    pub any_hit: Option<Spanned<String>>,
    /// Its intersection shader, for boxes.
    pub intersection: Option<Spanned<String>>,
    /// The data after the record's handle.
    pub record: Option<DataPieces>,
}

impl Parse for HitEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let entry = Self {
            name: table.optional("name"),
            closest_hit: table.optional("closest_hit"),
            any_hit: table.optional("any_hit"),
            intersection: table.optional("intersection"),
            record: table.optional("record"),
        };
        table.finish();
        Some(entry)
    }
}

/// A ray that `trace-one-ray` explains: through a pixel of the launch, or by its numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum RayEntry {
    /// The ray that the ray-generation shader makes at a launch index.
    Pixel {
        /// A name for reports.
        name: Option<String>,
        /// x and y of the launch index.
        pixel: Spanned<[u32; 2]>,
        /// The pass that it is looked at in; the first launch where there is none.
        pass: Option<Spanned<PassKey>>,
    },
    /// A ray by its numbers.
    Given(GivenRay),
}

impl RayEntry {
    /// Its name, if it has one.
    pub fn name(&self) -> Option<&String> {
        match self {
            Self::Pixel { name, .. } => name.as_ref(),
            Self::Given(given) => given.name.as_ref(),
        }
    }

    /// The pass that it names.
    pub fn pass(&self) -> Option<&Spanned<PassKey>> {
        match self {
            Self::Pixel { pass, .. } => pass.as_ref(),
            Self::Given(given) => given.pass.as_ref(),
        }
    }
}

/// The operands of a trace.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenRay {
    /// A name for reports.
    pub name: Option<String>,
    /// The ray's origin.
    pub origin: [f32; 3],
    /// The ray's direction, which need not be normalised.
    pub direction: [f32; 3],
    /// `RayTminKHR`
    pub t_min: f32,
    /// `RayTmaxKHR` at the start.
    pub t_max: f32,
    /// Ray flags, numbers as in SPIR-V.
    pub flags: u32,
    /// Compared with instances' masks.
    pub cull_mask: u32,
    /// `CurrentRayTimeNV`, from 0 to 1.
    pub time: f32,
    /// Offset into the hit records.
    pub sbt_offset: u32,
    /// Factor of the geometry index.
    pub sbt_stride: u32,
    /// Index of the miss record.
    pub miss_index: u32,
    /// The payload's first words; the rest is zeros.
    pub payload: Vec<u32>,
    /// The types that the scene gives to them.
    pub payload_types: Vec<TypedScalars>,
    /// The pass with whose pipeline it is traced; the first launch where there is none.
    pub pass: Option<Spanned<PassKey>>,
}

/// A ray without flags and payload, that every instance's mask lets pass, with an SBT stride of 1.
impl From<Ray> for GivenRay {
    fn from(Ray { origin, direction, t_min, t_max }: Ray) -> Self {
        Self {
            name: None,
            origin,
            direction,
            t_min,
            t_max,
            flags: 0,
            cull_mask: 0xFF,
            time: 0.0,
            sbt_offset: 0,
            sbt_stride: 1,
            miss_index: 0,
            payload: Vec::new(),
            payload_types: Vec::new(),
            pass: None,
        }
    }
}

impl GivenRay {
    /// The operands of the trace, with a payload that is large enough for every shader of a
    /// pipeline.
    ///
    /// # Errors
    /// [`ErrorKind::InvalidArgument`]: more payload is given than the shaders declare.
    /// [`ErrorKind::InvalidScene`]: scalars of other types than any shader declares there.
    pub fn operands(&self, pipeline: &Pipeline) -> Result<RayOperands> {
        let words = pipeline.payload_words();
        if self.payload.len() > words {
            let given = 4 * self.payload.len();
            let message =
                format!("the ray's payload has {given} bytes, but the shaders declare {}", 4 * words);
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
        let layouts = pipeline.programs.iter().filter_map(|program| {
            let registers = program.interface_registers(storage::INCOMING_RAY_PAYLOAD)?;
            Some(Layout::new(&program.module, registers.ty, Rules::Packed))
        });
        if let Some(error) = typed_scalars::check_layouts(layouts, &self.payload_types) {
            return Err(error);
        }
        let mut payload = self.payload.clone();
        payload.resize(words, 0);
        let ray =
            Ray { origin: self.origin, direction: self.direction, t_min: self.t_min, t_max: self.t_max };
        Ok(RayOperands {
            trace: TraceRay { ray, flags: RayFlags(self.flags), cull_mask: self.cull_mask, time: self.time },
            sbt_offset: self.sbt_offset,
            sbt_stride: self.sbt_stride,
            miss_index: self.miss_index,
            payload,
        })
    }
}

#[derive(Clone, Copy)]
pub(crate) struct RayFlag(u32);

impl Named for Precision {
    const WHAT: &'static str = "precision";
    const NAMES: &'static [(&'static str, Self)] = &[
        (Self::Float.name(), Self::Float),
        (Self::Double.name(), Self::Double),
        (Self::Exact.name(), Self::Exact),
    ];
}

/// SPIR-V, "Ray Flags"
impl Named for RayFlag {
    const WHAT: &'static str = "ray flag";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("opaque", Self(1)),
        ("no_opaque", Self(2)),
        ("terminate_on_first_hit", Self(4)),
        ("skip_closest_hit_shader", Self(8)),
        ("cull_back_facing_triangles", Self(0x10)),
        ("cull_front_facing_triangles", Self(0x20)),
        ("cull_opaque", Self(0x40)),
        ("cull_no_opaque", Self(0x80)),
        ("skip_triangles", Self(0x100)),
        ("skip_aabbs", Self(0x200)),
        ("force_opacity_micromap_2_state", Self(0x400)),
    ];
}

impl Parse for RayEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let name = table.optional("name");
        // The harness reads this table.
        let _ = table.value("expect");
        let pass = table.optional("pass");
        if table.has("pixel") {
            let pixel = table.required("pixel");
            table.finish();
            return Some(Self::Pixel { name, pixel: pixel?, pass });
        }
        let (origin, direction) = (table.required("origin"), table.required("direction"));
        let (t_min, t_max) = (table.or("t_min", 0.0), table.or("t_max", f32::INFINITY));
        let flags = table.optional::<OneOrMore<RayFlag>>("flags");
        let flags = flags.map_or(0, |flags| flags.0.iter().fold(0, |all, flag| all | flag.0));
        let (cull_mask, miss_index) = (table.or("cull_mask", 0xff), table.or("miss_index", 0));
        let (sbt_offset, sbt_stride) = (table.or("sbt_offset", 0), table.or("sbt_stride", 1));
        let time = table.or("time", 0.0);
        let payload = table.value("payload").map_or_else(|| Some(Default::default()), payload);
        table.finish();
        let (origin, direction) = (origin?, direction?);
        let (payload, payload_types) = payload?;
        Some(Self::Given(GivenRay {
            name,
            origin,
            direction,
            t_min,
            t_max,
            flags,
            cull_mask,
            time,
            sbt_offset,
            sbt_stride,
            miss_index,
            payload,
            payload_types,
            pass,
        }))
    }
}

/// Reads a ray's payload: data in whole words, and their types.
fn payload(value: TomlValue<'_>) -> Option<(Vec<u32>, Vec<TypedScalars>)> {
    let data = DataPieces::parse(value)?;
    let (bytes, typed) =
        match data.encode_typed(&DataSources::files(&EmbeddedFiles(&[]), &OpenModels::default())) {
            Ok(encoded) => encoded,
            Err(_) => return value.wrong("a ray requires its payload as data in place: `{ f32 = [1, 2] }`"),
        };
    let words = bytes.chunks_exact(4);
    if !words.remainder().is_empty() {
        return value.wrong(format!(
            "the size of a payload must be a multiple of 4 bytes, found {} bytes",
            bytes.len()
        ));
    }
    Some((words.map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect(), typed))
}
