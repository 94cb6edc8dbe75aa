//! A resolved scene: plain descriptions with all files loaded.

use std::collections::HashMap;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use crate::address_entry::{AddressChoice, AddressOf};
use crate::encoding::Data;
use crate::file::{MissingDescriptors, RayEntry};
use crate::files::SceneFiles;
use crate::image::PixelEncoding;
use crate::mesh::model::Model;
use crate::read::Document;
use crate::resources::{Output, Resource};
use crate::specialization::{SpecializationKey, SpecializationValue};
use anyhit_base::error::Place;
use anyhit_base::escape;
use anyhit_base::sorted::SortedSet;
use anyhit_compile::SourceSettings;
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::{LaunchLimits, MemoryPolicy, PrintedBytes};
use anyhit_engine::module::Module;
use anyhit_engine::pipeline::{DeviceProfile, PipelineFlags};

/// A scene with all files loaded.
#[derive(Clone)]
pub struct ResolvedScene {
    /// The path of the scene's own file.
    pub path: PathBuf,
    /// The acceleration structures, by name.
    pub tlas: Vec<(String, Arc<Tlas>)>,
    /// The names of the geometries of each instance, parallel to `tlas`.
    pub geometry_names: Vec<Vec<Arc<[String]>>>,
    /// Every file with shaders, once.
    pub shaders: Vec<ShaderModule>,
    /// Modules that are loaded already, as data is laid out by their structs: by their indices in
    /// `shaders`, without specialization.
    pub loaded: HashMap<usize, Arc<Module>>,
    /// `[pipeline]`
    pub pipeline: ResolvedPipeline,
    /// `[pipelines.NAME]`, which passes name.
    pub pipelines: Vec<ResolvedPipeline>,
    /// The contents of the descriptor sets, sorted by set, binding and element.
    pub resources: Vec<ResolvedBinding>,
    /// Buffers without a binding of their own, in the order of their names.
    pub unbound: Vec<UnboundBuffer>,
    /// What nothing reads, so that its files were not opened.
    pub unread: Vec<UnreadPart>,
    /// The content of models that no reader reads.
    pub unread_contents: Vec<UnreadContents>,
    /// What keeps its address, although nothing in the scene names it any more.
    pub kept_addresses: SortedSet<String>,
    /// Dispatches of compute shaders, in order; a ray-tracing launch comes before them.
    pub dispatches: Vec<ResolvedDispatch>,
    /// What `[[pass]]` lists, in order; without it the launch and the dispatches are the passes.
    pub passes: Vec<ResolvedPass>,
    /// The push constants' bytes.
    pub push_constants: Data,
    /// The device that the scene is for.
    pub device: DeviceProfile,
    /// How many bytes of what shaders print are kept.
    pub printed_bytes: PrintedBytes,
    /// What happens on an access outside its buffer or image.
    pub memory: MemoryPolicy,
    /// What happens at a descriptor that shaders use and nothing is bound to.
    pub missing_descriptors: MissingDescriptors,
    /// Width, height and depth of the launch.
    pub launch: [u32; 3],
    /// The rays that `trace-one-ray` offers.
    pub rays: Vec<RayEntry>,
    /// The scene's own document, whose `[expect]` the harness reads.
    pub document: Document,
    /// Notes for the scene's author, a line each: old names that the scene uses.
    pub notes: Vec<String>,
    /// How files that shaders and expectations name are read: those beside the scene's own.
    pub files: SceneFiles,
}

/// The path, the launch, and the names of what the scene has.
impl fmt::Debug for ResolvedScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 64;
        let resources = self.resources.iter().map(|one| &one.name).take(SHOWN);
        let structures = self.tlas.iter().map(|(name, tlas)| (name, tlas.instances().len()));
        f.debug_struct("ResolvedScene")
            .field("path", &self.path)
            .field("launch", &self.launch)
            .field("instances", &structures.take(SHOWN).collect::<Vec<_>>())
            .field("shaders", &self.shaders.iter().map(|one| &one.name).take(SHOWN).collect::<Vec<_>>())
            .field("resources", &resources.collect::<Vec<_>>())
            .field("passes", &self.passes.len())
            .field("dispatches", &self.dispatches.len())
            .finish_non_exhaustive()
    }
}

/// A pipeline of the scene. What `[pipeline]` says of fuel, limits and subgroups holds for
/// dispatches, too.
#[derive(Clone, Debug, Default)]
pub struct ResolvedPipeline {
    /// Its name; `None` for `[pipeline]`.
    pub name: Option<String>,
    /// The shader groups, each once.
    pub groups: Vec<ResolvedGroup>,
    /// The shader binding table.
    pub sbt: ShaderBindingTable,
    /// The pipeline's flags.
    pub flags: PipelineFlags,
    /// `maxPipelineRayRecursionDepth`, if the scene sets it.
    pub max_recursion_depth: Option<u32>,
    /// The number of invocations in a subgroup, if the scene sets it.
    pub subgroup_size: Option<u32>,
    /// How deeply callable shaders may call each other, if the scene sets it.
    pub max_callable_depth: Option<u32>,
    /// Bytes of registers of the shaders that call each other, if the scene sets it.
    pub max_stack_size: Option<u64>,
    /// Instructions that an invocation may execute, counted at back edges, calls and stops, if
    /// the scene sets it.
    pub fuel: Option<u64>,
    /// The limits of each launch and dispatch.
    pub launch_limits: LaunchLimits,
}

/// A file with shaders.
#[derive(Clone, Debug)]
pub struct ShaderModule {
    /// The name in the scene.
    pub name: String,
    /// The file.
    pub path: PathBuf,
    /// Its content.
    pub code: ShaderCode,
    /// Where the scene names it.
    pub place: Place,
}

/// The content of a [`ShaderModule`].
#[derive(Clone, PartialEq, Eq)]
pub enum ShaderCode {
    /// The bytes of a SPIR-V module.
    SpirV(Vec<u8>),
    /// Source text that must be compiled first, and how.
    Source(Vec<u8>, SourceSettings),
}

/// The language's way and the number of bytes.
impl fmt::Debug for ShaderCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SpirV(bytes) => write!(f, "SpirV({} bytes)", bytes.len()),
            Self::Source(bytes, settings) => write!(f, "Source({} bytes, {settings:?})", bytes.len()),
        }
    }
}

/// One entry point with its specialization.
#[derive(Clone, Debug)]
pub struct ResolvedShader {
    /// Index into [`ResolvedScene::shaders`].
    pub module: usize,
    /// The entry point's name.
    pub entry: String,
    /// The specialization constants and their values.
    pub specialization: Vec<(SpecializationKey, SpecializationValue)>,
    /// Where the scene names it.
    pub place: Place,
}

impl PartialEq for ResolvedShader {
    fn eq(&self, other: &Self) -> bool {
        self.module == other.module
            && self.entry == other.entry
            && self.specialization == other.specialization
    }
}

/// A dispatch of a compute shader.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedDispatch {
    /// The shader.
    pub shader: ResolvedShader,
    /// The number of workgroups along x, y and z, unless a buffer holds them.
    pub groups: [u32; 3],
    /// Where they are read, if a buffer holds them.
    pub indirect: Option<IndirectSize>,
    /// The bytes of its own push constants; `None` for the scene's.
    pub push_constants: Option<Data>,
}

/// One pass of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedPass {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// What it finds instead of what is bound.
    pub rebindings: Vec<Rebinding>,
    /// What it runs.
    pub work: ResolvedPassWork,
}

/// What a pass runs.
#[derive(Clone, Debug, PartialEq)]
pub enum ResolvedPassWork {
    /// A launch of a pipeline.
    Launch {
        /// The index of a named pipeline; `None` for `[pipeline]`.
        pipeline: Option<usize>,
        /// Index of the ray generation record.
        raygen: usize,
        /// Width, height and depth, unless a buffer holds them.
        size: [u32; 3],
        /// Where they are read, if a buffer holds them.
        indirect: Option<Box<IndirectSize>>,
        /// Its own push constants; `None` for the scene's.
        push_constants: Option<Data>,
    },
    /// The dispatch with this index in [`ResolvedScene::dispatches`].
    Dispatch(usize),
}

/// What one pass finds in a descriptor instead of what is bound there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rebinding {
    /// The descriptor: set, binding and array element.
    pub at: [u32; 3],
    /// Where its buffer, image or acceleration structure is bound for the others.
    pub source: RebindingSource,
}

/// The size of a dispatch or launch in a buffer: three words, which are read when the pass runs
/// (`vkCmdDispatchIndirect`, `vkCmdTraceRaysIndirectKHR`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IndirectSize {
    /// The name of the buffer.
    pub buffer: String,
    /// Where the buffer is.
    pub source: RebindingSource,
    /// Bytes from the beginning of the buffer: a multiple of 4.
    pub offset: u64,
    /// Where the scene says it.
    pub place: Place,
}

impl IndirectSize {
    /// `sizeof(VkDispatchIndirectCommand)`, which is that of `VkTraceRaysIndirectCommandKHR`.
    pub const BYTES: u64 = 12;
}

/// Whose content a [`Rebinding`] puts into a descriptor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RebindingSource {
    /// That of another descriptor: set, binding and array element.
    Bound([u32; 3]),
    /// A buffer that no descriptor refers to, by its name.
    Unbound(String),
}

/// A shader group.
#[derive(Clone, Debug, PartialEq)]
pub enum ResolvedGroup {
    /// A ray-generation shader.
    RayGeneration(ResolvedShader),
    /// A miss shader.
    Miss(ResolvedShader),
    /// A callable shader.
    Callable(ResolvedShader),
    /// A hit group.
    Hit(Box<ResolvedHitGroup>),
}

impl ResolvedGroup {
    /// Its shaders.
    pub fn shaders(&self) -> impl Iterator<Item = &ResolvedShader> {
        let shaders = match self {
            Self::RayGeneration(shader) | Self::Miss(shader) | Self::Callable(shader) => {
                [Some(shader), None, None]
            }
            Self::Hit(hit) => [hit.closest_hit.as_ref(), hit.any_hit.as_ref(), hit.intersection.as_ref()],
        };
        shaders.into_iter().flatten()
    }
}

/// A hit group; procedural where it has an intersection shader.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedHitGroup {
    /// Closest-hit shader.
    pub closest_hit: Option<ResolvedShader>,
    /// Any-hit shader.
    pub any_hit: Option<ResolvedShader>,
    /// Intersection shader.
    pub intersection: Option<ResolvedShader>,
}

/// A record of the shader binding table.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedRecord {
    /// The scene's name for it.
    pub name: Option<String>,
    /// Index into [`ResolvedPipeline::groups`]; `None` is a null handle.
    pub group: Option<usize>,
    /// The data after the handle (`ShaderRecordBufferKHR` at offset 0).
    pub data: Data,
}

/// The shader records by kind, each in its table's order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShaderBindingTable {
    /// The ray generation records; the first is launched.
    pub raygen: Vec<ResolvedRecord>,
    /// The miss records.
    pub miss: Vec<ResolvedRecord>,
    /// The hit records.
    pub hit: Vec<ResolvedRecord>,
    /// The callable records.
    pub callable: Vec<ResolvedRecord>,
}

/// A descriptor.
#[derive(Clone, Debug)]
pub struct ResolvedBinding {
    /// The scene's name for it.
    pub name: String,
    /// The descriptor set that it is kept in: its own, or
    /// [`OWN_SET`](crate::pass::OWN_SET).
    pub set: u32,
    /// The binding number in the set that it is kept in.
    pub binding: u32,
    /// The set and binding at which shaders declare it.
    pub declared_at: [u32; 2],
    /// The numbers of the passes that it is for; `None` for all that no other is for.
    pub passes: Option<Vec<usize>>,
    /// Element of an array of descriptors.
    pub element: u32,
    /// Its content.
    pub resource: Resource,
    /// Of a buffer: what it says of its device address.
    pub address: AddressChoice,
    /// Marks the image that a render saves, and how.
    pub output: Option<Output>,
    /// True if a PNG of the image has its alpha.
    pub keeps_alpha: bool,
    /// Where the scene describes it.
    pub place: Place,
}

impl ResolvedBinding {
    /// Whether the image here is that of another binding.
    pub fn is_same_image(&self, other: &Self) -> bool {
        self.resource.image().zip(other.resource.image()).is_some_and(|(own, other)| Arc::ptr_eq(own, other))
    }
}

/// The bindings of a scene that set how a picture of their image is encoded.
#[derive(Debug)]
pub struct ImageEncodings<'a>(Vec<&'a ResolvedBinding>);

impl ImageEncodings<'_> {
    /// The encoding of a picture of the image at a binding, as [`ResolvedScene::encoding_of`].
    pub fn of(&self, image: &ResolvedBinding) -> PixelEncoding {
        let others = || self.0.iter().copied().filter(|one| one.is_same_image(image));
        let of_image = || std::iter::once(image).chain(others());
        PixelEncoding {
            to_srgb: of_image().any(|one| one.output == Some(Output::Linear)),
            keep_alpha: of_image().any(|one| one.keeps_alpha),
        }
    }
}

/// A part of a scene that nothing reads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnreadPart {
    /// What it is, with its name: "resource `a`".
    pub what: String,
    /// Its name in the scene.
    pub name: String,
    /// The files that were not opened, as the scene names them.
    pub files: Vec<String>,
    /// Why nothing reads it.
    pub reason: &'static str,
}

/// The content of a model that no reader reads.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct UnreadContents {
    /// The file.
    pub file: PathBuf,
    /// The kinds of content, each with its number.
    pub contents: Vec<String>,
}

impl UnreadContents {
    /// The content of a model that is not read.
    pub(crate) fn of(model: &Model) -> Self {
        Self { file: model.path.clone(), contents: model.unread.clone() }
    }
}

impl fmt::Display for UnreadContents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let contents = self.contents.join("; ");
        write!(f, "{}: not read: {}", escape::path(&self.file), escape::line(&contents))
    }
}

/// A buffer that has no binding of its own: shaders reach it by its address, or by those of its
/// ranges that are bound.
#[derive(Clone, Debug)]
pub struct UnboundBuffer {
    /// The scene's name for it.
    pub name: String,
    /// Its content.
    pub data: Data,
    /// What it says of its device address.
    pub address: AddressChoice,
    /// Where the scene describes it.
    pub place: Place,
}

impl ShaderBindingTable {
    /// Its tables: ray generation, miss, hit and callable records.
    pub fn tables(&self) -> [&Vec<ResolvedRecord>; 4] {
        [&self.raygen, &self.miss, &self.hit, &self.callable]
    }

    /// Its tables, to be changed.
    pub fn tables_mut(&mut self) -> [&mut Vec<ResolvedRecord>; 4] {
        [&mut self.raygen, &mut self.miss, &mut self.hit, &mut self.callable]
    }

    /// The records of all tables.
    pub fn records(&self) -> impl Iterator<Item = &ResolvedRecord> {
        self.tables().into_iter().flatten()
    }
}

impl ResolvedScene {
    /// `[pipeline]`, then the named pipelines.
    pub fn all_pipelines(&self) -> impl Iterator<Item = &ResolvedPipeline> {
        std::iter::once(&self.pipeline).chain(&self.pipelines)
    }

    /// `[pipeline]`, then the named pipelines, to be changed.
    pub fn all_pipelines_mut(&mut self) -> impl Iterator<Item = &mut ResolvedPipeline> {
        std::iter::once(&mut self.pipeline).chain(&mut self.pipelines)
    }

    /// The pipeline with an index among the named ones, or `[pipeline]`.
    pub fn pipeline_at(&self, index: Option<usize>) -> &ResolvedPipeline {
        index.map_or(&self.pipeline, |index| &self.pipelines[index])
    }

    /// Whether it launches a pipeline.
    pub fn launches(&self) -> bool {
        match self.passes.is_empty() {
            true => !self.pipeline.sbt.raygen.is_empty(),
            false => self.passes.iter().any(|pass| matches!(pass.work, ResolvedPassWork::Launch { .. })),
        }
    }

    /// Everything whose address is written somewhere.
    pub fn address_targets(&self) -> Vec<&AddressOf> {
        let mut targets = Vec::new();
        let mut data = vec![&self.push_constants];
        data.extend(self.dispatches.iter().filter_map(|dispatch| dispatch.push_constants.as_ref()));
        data.extend(self.unbound.iter().map(|buffer| &buffer.data));
        data.extend(self.resources.iter().filter_map(|binding| binding.resource.data()));
        let launches = self.passes.iter().filter_map(|pass| match &pass.work {
            ResolvedPassWork::Launch { push_constants, .. } => push_constants.as_ref(),
            ResolvedPassWork::Dispatch(_) => None,
        });
        data.extend(launches);
        data.extend(self.all_pipelines().flat_map(|pipeline| pipeline.sbt.records()).map(|one| &one.data));
        for data in data {
            data.targets(&mut |of| targets.push(of));
        }
        let groups = self.all_pipelines().flat_map(|pipeline| &pipeline.groups);
        let groups = groups.flat_map(ResolvedGroup::shaders);
        let shaders = groups.chain(self.dispatches.iter().map(|dispatch| &dispatch.shader));
        let values = shaders.flat_map(|shader| &shader.specialization);
        targets.extend(values.filter_map(|(_, value)| value.target()));
        targets
    }

    /// Keeps the addresses as they are, before data that name some of them are replaced.
    pub fn keep_addresses(&mut self) {
        let targets: Vec<String> = self.address_targets().iter().map(|of| of.target.value.clone()).collect();
        self.kept_addresses.extend(targets);
    }

    /// The picture that a render saves: the storage image marked as output, or the only one.
    pub fn output(&self) -> Option<&ResolvedBinding> {
        let images = || self.resources.iter().filter(|b| matches!(b.resource, Resource::StorageImage(_)));
        let mut marked = images().filter(|binding| binding.output.is_some());
        let only = |first: &&ResolvedBinding| images().all(|other| other.is_same_image(first));
        marked.next().or_else(|| images().next().filter(only))
    }

    /// The encoding of a picture of the image at a binding: that of the image, whichever of its
    /// bindings says it.
    pub fn encoding_of(&self, image: &ResolvedBinding) -> PixelEncoding {
        self.image_encodings().of(image)
    }

    /// The bindings that set encodings, to find those of many images.
    pub fn image_encodings(&self) -> ImageEncodings<'_> {
        let sets = |one: &&ResolvedBinding| one.output == Some(Output::Linear) || one.keeps_alpha;
        ImageEncodings(self.resources.iter().filter(sets).collect())
    }

    /// The bindings of the image that is bound at one.
    pub fn bindings_of_image<'a>(
        &'a self,
        image: &'a ResolvedBinding,
    ) -> impl Iterator<Item = &'a ResolvedBinding> {
        self.resources.iter().filter(|one| one.is_same_image(image))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::image::PixelEncoding;
    use crate::{LoadOptions, SceneFiles, load_text};

    #[test]
    fn all_bindings_of_an_image_have_the_encoding_that_one_sets() {
        let text = "version = 1
            [resources.picture]
            type = 'storage_image'
            binding = 0
            size = [1, 1]
            alpha = true
            [resources.view]
            type = 'sampled_image'
            binding = 1
            image = 'picture'
            [resources.other]
            type = 'storage_image'
            binding = 2
            size = [1, 1]
            output = 'linear'";
        let (files, options) = (SceneFiles::default(), LoadOptions::default());
        let scene = load_text(Path::new("scene.toml"), text, &files, &options).unwrap();
        let encoding = |name: &str| {
            let binding = scene.resources.iter().find(|one| one.name == name).unwrap();
            assert_eq!(scene.image_encodings().of(binding), scene.encoding_of(binding));
            scene.encoding_of(binding)
        };
        let of_picture = PixelEncoding { to_srgb: false, keep_alpha: true };
        assert_eq!([encoding("picture"), encoding("view")], [of_picture; 2]);
        assert_eq!(encoding("other"), PixelEncoding { to_srgb: true, keep_alpha: false });
    }
}
