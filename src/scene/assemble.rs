//! Makes a pipeline and its resources from a resolved scene.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

use crate::accel::Tlas;
use crate::compile;
use crate::error::{Error, ErrorKind, Result};
use crate::input::{InputLimit, InputLimits};
use crate::machine::image as machine;
use crate::machine::{Binding, Buffer, Descriptor, Resources};
use crate::module::interface::Stage;
use crate::module::{self, Module};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::{self, Compute, Launch, Pipeline, Record, Sbt, Stats};
use crate::program::{Program, lower};
use crate::scene::addresses::Addresses;
use crate::scene::descriptors;
use crate::scene::files::SceneFiles;
use crate::scene::image_entry::ImageContent;
use crate::scene::resolved::{
    self, ResolvedGroup, ResolvedPass, ResolvedRecord, ResolvedScene, ResolvedShader, ShaderCode,
    ShaderModule,
};
use crate::scene::resources::Resource;

/// A scene that can be launched.
#[derive(Clone, Debug)]
pub struct Assembled {
    /// Shaders and the shader binding table.
    pub pipeline: Pipeline,
    /// The contents of the descriptor sets.
    pub resources: Resources,
    /// Width, height and depth of the launch.
    pub size: [u32; 3],
    /// Dispatches of compute shaders, in order.
    pub dispatches: Vec<Dispatch>,
    /// Notes for the scene's author, a line each: buffers that end in a part of an element.
    pub notes: Vec<String>,
    /// What [`Assembled::run`] runs, in order.
    pub passes: Vec<Pass>,
}

/// One pass of a frame.
#[derive(Clone, Debug)]
pub enum Pass {
    /// A launch of the scene's pipeline.
    Launch(LaunchPass),
    /// The dispatch with this index in [`Assembled::dispatches`].
    Dispatch(usize),
}

/// A launch of the scene's pipeline.
#[derive(Clone, Debug)]
pub struct LaunchPass {
    /// The record of the ray generation shader; `None` for that of the pipeline.
    pub record: Option<Record>,
    /// Width, height and depth.
    pub size: [u32; 3],
    /// Push constants of its own, in place of the scene's.
    pub push_constants: Option<Arc<Buffer>>,
}

impl LaunchPass {
    /// The pipeline with the record that is launched.
    pub fn pipeline<'a>(&self, pipeline: &'a Pipeline) -> Cow<'a, Pipeline> {
        let Some(record) = &self.record else { return Cow::Borrowed(pipeline) };
        let mut own = pipeline.clone();
        own.sbt.ray_generation = Some(record.clone());
        Cow::Owned(own)
    }

    /// These resources with the push constants of the launch.
    pub fn resources<'a>(&self, resources: &'a Resources) -> Cow<'a, Resources> {
        with_push_constants(resources, &self.push_constants)
    }
}

/// These resources with other push constants, if there are any.
fn with_push_constants<'a>(resources: &'a Resources, own: &Option<Arc<Buffer>>) -> Cow<'a, Resources> {
    match own {
        None => Cow::Borrowed(resources),
        own => Cow::Owned(Resources { push_constants: own.clone(), ..resources.clone() }),
    }
}

/// A dispatch of a compute shader.
#[derive(Clone, Debug)]
pub struct Dispatch {
    /// The shader.
    pub compute: Compute,
    /// The number of workgroups along x, y and z.
    pub groups: [u32; 3],
    /// Push constants of its own, in place of the scene's.
    pub push_constants: Option<Arc<Buffer>>,
}

impl Dispatch {
    /// These resources with the push constants of the dispatch.
    pub fn resources<'a>(&self, resources: &'a Resources) -> Cow<'a, Resources> {
        with_push_constants(resources, &self.push_constants)
    }
}

impl Assembled {
    /// Whether it is more than one launch of the pipeline, or a launch that is not its first.
    pub fn is_frame(&self) -> bool {
        let own = |pass: &Pass| matches!(pass, Pass::Launch(LaunchPass { record: None, .. }));
        self.passes.iter().any(|pass| matches!(pass, Pass::Launch(_)) && !own(pass))
    }

    /// Returns the scene with programs that are not optimised; see [`Program::unoptimized`].
    ///
    /// # Errors
    /// As [`lower()`].
    pub fn unoptimized(&self) -> Result<Self> {
        let mut reference = Self { pipeline: self.pipeline.unoptimized()?, ..self.clone() };
        for dispatch in &mut reference.dispatches {
            dispatch.compute = dispatch.compute.unoptimized()?;
        }
        Ok(reference)
    }

    /// The launch of the pipeline.
    pub fn launch(&self) -> Launch<'_> {
        Launch { pipeline: &self.pipeline, resources: &self.resources }
    }

    /// How many invocations [`Assembled::run`] runs, shaders that they call not counted; of more
    /// than 2^64 the greatest number.
    pub fn invocations(&self) -> u64 {
        let count = |sides: [u32; 3]| sides.iter().fold(1, |all: u64, &side| all.saturating_mul(side.into()));
        let dispatch = |one: &Dispatch| count(one.groups).saturating_mul(count(one.compute.workgroup_size()));
        let pass = |pass: &Pass| match pass {
            Pass::Launch(launch) => count(launch.size),
            Pass::Dispatch(index) => dispatch(&self.dispatches[*index]),
        };
        self.passes.iter().map(pass).fold(0, u64::saturating_add)
    }

    /// Runs the passes of the scene on these resources, W lanes at a time; `done` receives how many
    /// more invocations have ended.
    ///
    /// # Errors
    /// The first trap, as [`Launch::run`] and [`Compute::run`] report it.
    pub fn run<const W: usize>(&self, resources: &Resources, done: &(dyn Fn(u64) + Sync)) -> Result<Stats>
    where
        LaneKernel: Width<W>,
    {
        let mut stats = Stats::default();
        for pass in &self.passes {
            stats = stats.plus(&self.run_pass::<W>(pass, resources, done)?);
        }
        Ok(stats)
    }

    /// Runs one of its passes.
    ///
    /// # Errors
    /// As [`Assembled::run`].
    pub fn run_pass<const W: usize>(
        &self,
        pass: &Pass,
        resources: &Resources,
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<Stats>
    where
        LaneKernel: Width<W>,
    {
        match pass {
            Pass::Launch(launch) => {
                let (pipeline, resources) = (launch.pipeline(&self.pipeline), launch.resources(resources));
                Launch { pipeline: &pipeline, resources: &resources }.run::<W>(launch.size, done)
            }
            Pass::Dispatch(index) => {
                let dispatch = &self.dispatches[*index];
                dispatch.compute.run::<W>(&dispatch.resources(resources), dispatch.groups, done)
            }
        }
    }
}

/// Loads and lowers the shaders of a scene, and makes its resources.
///
/// # Errors
/// Every mistake in shaders, groups and images, each at its place in the scene, as one error.
pub fn assemble(scene: &ResolvedScene) -> Result<Assembled> {
    assemble_excluding(scene, None)
}

/// Assembles a scene without one binding, that of an image which the caller binds.
///
/// # Errors
/// As [`assemble`].
pub fn assemble_without(scene: &ResolvedScene, excluded: &resolved::ResolvedBinding) -> Result<Assembled> {
    assemble_excluding(scene, Some((excluded.set, excluded.binding, excluded.element)))
}

fn assemble_excluding(scene: &ResolvedScene, excluded: Option<(u32, u32, u32)>) -> Result<Assembled> {
    let mut errors = Vec::new();
    let addresses = &Addresses::assign(scene, &mut errors);
    let mut shaders = Shaders { scene, loaded: HashMap::new(), addresses, programs: Vec::new() };
    let built = pipeline(&mut shaders, &mut errors);
    let (pipeline, raygen) = match built {
        Ok((pipeline, raygen)) => (Ok(pipeline), raygen),
        Err(error) => (Err(error), Vec::new()),
    };
    let dispatches = dispatches(&mut shaders, &mut errors);
    let resources = resources(scene, excluded, addresses, &mut errors);
    let pipeline = match pipeline {
        // A pipeline that lacks a shader fails for that reason, which is already reported.
        Err(error) if errors.is_empty() => {
            errors.push(error);
            None
        }
        other => other.ok(),
    };
    for (name, tlas) in &scene.tlas {
        let checks = [
            scene.device.check_structure(tlas),
            scene.pipeline_flags.check_structure(tlas),
            pipeline.as_ref().map_or(Ok(()), |pipeline| pipeline.check_motion(tlas)),
        ];
        let context = |error: Error| error.context(format!("acceleration structure `{name}`"));
        errors.extend(checks.into_iter().filter_map(|check| check.err().map(context)));
    }
    let programs = shaders.programs.iter().map(|(.., program)| &**program);
    errors.extend(descriptors::mismatches(scene, programs));
    let own = |dispatch: &Dispatch| scene.device.check_module(&dispatch.compute.program.module).err();
    errors.extend(dispatches.iter().filter_map(own));
    let warnings = shaders.warnings();
    let (Some(pipeline), true) = (pipeline, errors.is_empty()) else {
        let error = deduplicate(errors, scene.files.limits.get(InputLimit::ErrorsShown));
        // A binding that is not where the source says, for one, is only understood by them.
        return Err(warnings.into_iter().fold(error, Error::note));
    };
    let mut notes = descriptors::stride_notes(scene, shaders.programs.iter().map(|(.., program)| &**program));
    notes.splice(0..0, warnings);
    let passes = passes(scene, &pipeline, &raygen, dispatches.len(), addresses)?;
    Ok(Assembled { pipeline, resources, size: scene.launch, dispatches, notes, passes })
}

/// What the scene runs, in order: what `[[pass]]` lists, else the launch and then the dispatches.
fn passes(
    scene: &ResolvedScene,
    pipeline: &Pipeline,
    raygen: &[Option<Record>],
    dispatches: usize,
    addresses: &Addresses,
) -> Result<Vec<Pass>> {
    let pass = |pass: &ResolvedPass| {
        Ok(match pass {
            ResolvedPass::Dispatch(index) => Pass::Dispatch(*index),
            ResolvedPass::Launch { raygen: index, size, push_constants } => {
                let data = push_constants.as_ref().map(|data| data.encode(addresses)).transpose()?;
                let push_constants = data.as_deref().map(Buffer::new);
                Pass::Launch(LaunchPass { record: raygen[*index].clone(), size: *size, push_constants })
            }
        })
    };
    if !scene.passes.is_empty() {
        return scene.passes.iter().map(pass).collect();
    }
    let own = LaunchPass { record: None, size: scene.launch, push_constants: None };
    let launch = pipeline.sbt.ray_generation.is_some().then_some(Pass::Launch(own));
    Ok(launch.into_iter().chain((0..dispatches).map(Pass::Dispatch)).collect())
}

/// Removes duplicate errors, as several groups may name one shader. A missing tool is reported only
/// once. Only those that are shown are compared: thousands are not, each with each other.
fn deduplicate(errors: Vec<Error>, most: u64) -> Error {
    let most = usize::try_from(most).unwrap_or(usize::MAX).max(1);
    let mut distinct: Vec<Error> = Vec::new();
    for error in errors {
        let is_duplicate = |known: &Error| {
            let anywhere = error.kind() == ErrorKind::UnsupportedTool;
            known.message() == error.message() && (anywhere || known.places().eq(error.places()))
        };
        if !distinct.iter().take(most).any(is_duplicate) {
            distinct.push(error);
        }
    }
    Error::first_of(distinct, most)
}

/// The shaders of a scene; each module is loaded once, and each entry point is lowered once.
struct Shaders<'a> {
    scene: &'a ResolvedScene,
    loaded: HashMap<usize, Result<Arc<Module>>>,
    addresses: &'a Addresses,
    programs: Vec<(&'a ResolvedShader, Stage, Arc<Program>)>,
}

impl<'a> Shaders<'a> {
    fn module(&mut self, index: usize) -> Result<Arc<Module>> {
        if let Some(module) = self.scene.loaded.get(&index) {
            return Ok(module.clone());
        }
        let shader = &self.scene.shaders[index];
        let read = || read(shader, &self.scene.files).map(Arc::new);
        self.loaded.entry(index).or_insert_with(read).clone()
    }

    /// What the compilers of its sources warned of, a line each.
    fn warnings(&self) -> Vec<String> {
        let most =
            usize::try_from(self.scene.files.limits.get(InputLimit::ErrorsShown)).unwrap_or(usize::MAX);
        let mut warnings = Vec::new();
        for index in 0..self.scene.shaders.len() {
            let own = self.loaded.get(&index).and_then(|module| module.as_ref().ok());
            let Some(module) = self.scene.loaded.get(&index).or(own) else { continue };
            for warning in &module.warnings {
                let text = format!("warning of the compiler: {warning}");
                if warnings.len() < most && !warnings.contains(&text) {
                    warnings.push(text);
                }
            }
        }
        warnings
    }

    fn program(&mut self, shader: &'a ResolvedShader, stage: Stage) -> Result<Arc<Program>> {
        if let Some((.., program)) =
            self.programs.iter().find(|(known, of, _)| *known == shader && *of == stage)
        {
            return Ok(program.clone());
        }
        let mut module = self.module(shader.module)?;
        if !shader.specialization.is_empty() {
            let specialized = Arc::make_mut(&mut module);
            for (key, value) in &shader.specialization {
                value.specialize(specialized, key, Some(self.addresses))?;
            }
        }
        let entry =
            module.entry_points.iter().find(|entry| entry.name == shader.entry && entry.stage == stage);
        let Some(entry) = entry else {
            let found: Vec<_> = module
                .entry_points
                .iter()
                .map(|entry| format!("`{}` ({})", entry.name, entry.stage.name()))
                .collect();
            let message = format!("no {} entry point `{}`", stage.name(), shader.entry);
            let error = Error::new(ErrorKind::InvalidScene, message).at(shader.place.clone());
            return Err(error.note(format!("the module has {}", found.join(", "))));
        };
        let name = &self.scene.shaders[shader.module].name;
        let program = lower(&module, entry)
            .map_err(|error| error.context(format!("shader `{name}`")).at(shader.place.clone()))?;
        let program = Arc::new(program);
        self.programs.push((shader, stage, program.clone()));
        Ok(program)
    }
}

/// Loads a module; a source is compiled first.
pub(super) fn read(shader: &ShaderModule, files: &SceneFiles) -> Result<Module> {
    let context = |error: Error| error.context(shader.path.display()).at(shader.place.clone());
    match &shader.code {
        ShaderCode::SpirV(bytes) => module::load_with(bytes, files.limits).map_err(context),
        ShaderCode::Source(bytes, settings) => {
            let name = shader.path.display().to_string();
            let language = settings.language(&name).map_err(|error| error.at(shader.place.clone()))?;
            let source = match std::str::from_utf8(bytes) {
                // A file on disk may include other files.
                Ok(text) if Path::new(&shader.path).is_file() => {
                    compile::Source::of_file(language, name, text)
                }
                Ok(text) => compile::Source::from_text_as(language, name, text),
                Err(_) => {
                    let message = format!("{name} is not UTF-8");
                    return Err(Error::new(ErrorKind::InvalidSource, message).at(shader.place.clone()));
                }
            };
            let options =
                compile::CompileOptions { debug: compile::DebugInfoLevel::Lines, ..Default::default() };
            let options = settings.over(&options);
            let source =
                source.include_folders(&settings.include_folders).confined(files.limits, files.root.clone());
            let compiled = compile::compile_once_with_warnings(&source, &options)
                .map_err(|error| error.at(shader.place.clone()))?;
            let mut module = module::load_with(&compiled.spirv, files.limits).map_err(context)?;
            module.warnings = compiled.warnings;
            Ok(module)
        }
    }
}

/// The compute shaders of a scene, each ready to be dispatched.
fn dispatches(shaders: &mut Shaders<'_>, errors: &mut Vec<Error>) -> Vec<Dispatch> {
    let scene = shaders.scene;
    let mut dispatches = Vec::new();
    for one in &scene.dispatches {
        match dispatch(shaders, one) {
            Ok(one) => dispatches.push(one),
            Err(error) => errors.push(error),
        }
    }
    dispatches
}

fn dispatch<'a>(shaders: &mut Shaders<'a>, one: &'a resolved::ResolvedDispatch) -> Result<Dispatch> {
    let at = |error: Error| error.at(one.shader.place.clone());
    let program = shaders.program(&one.shader, Stage::Compute)?;
    let mut compute = Compute::new(program).map_err(at)?;
    if let Some(operations) = shaders.scene.fuel {
        compute = compute.fuel(operations);
    }
    compute = compute.launch_limits(shaders.scene.launch_limits);
    if let Some(size) = shaders.scene.subgroup_size {
        compute = compute.subgroup_size(size).map_err(at)?;
    }
    let push_constants =
        one.push_constants.as_ref().map(|data| data.encode(shaders.addresses)).transpose()?;
    let push_constants = push_constants.as_deref().map(Buffer::new);
    Ok(Dispatch { compute, groups: one.groups, push_constants })
}

/// The pipeline, and all its ray generation records.
fn pipeline(shaders: &mut Shaders<'_>, errors: &mut Vec<Error>) -> Result<(Pipeline, Vec<Option<Record>>)> {
    let scene = shaders.scene;
    let mut builder = Pipeline::builder();
    let mut groups = Vec::new();
    for group in &scene.groups {
        let mut add = |shader, stage| match shaders.program(shader, stage) {
            Ok(program) => Some(builder.shader(program)),
            Err(error) => {
                errors.push(error);
                None
            }
        };
        let group = match group {
            ResolvedGroup::RayGeneration(shader) => {
                add(shader, Stage::RayGeneration).map(pipeline::Group::General)
            }
            ResolvedGroup::Miss(shader) => add(shader, Stage::Miss).map(pipeline::Group::General),
            ResolvedGroup::Callable(shader) => add(shader, Stage::Callable).map(pipeline::Group::General),
            ResolvedGroup::Hit(group) => Some(pipeline::Group::Hit(pipeline::HitGroup {
                closest_hit: group.closest_hit.as_ref().and_then(|shader| add(shader, Stage::ClosestHit)),
                any_hit: group.any_hit.as_ref().and_then(|shader| add(shader, Stage::AnyHit)),
                intersection: group.intersection.as_ref().and_then(|shader| add(shader, Stage::Intersection)),
            })),
        };
        groups.push(match group {
            Some(group) => Some(builder.group(group)?),
            None => None,
        });
    }
    let addresses = shaders.addresses;
    let mut record = |record: &ResolvedRecord| -> Option<Record> {
        let group = groups.get(record.group?).copied().flatten()?;
        if record.data.is_empty() {
            return Some(Record::new(group));
        }
        match record.data.encode(addresses) {
            Ok(data) => Some(Record::with_data(group, &data)),
            Err(error) => {
                errors.push(error);
                None
            }
        }
    };
    let raygen: Vec<Option<Record>> = scene.sbt.raygen.iter().map(&mut record).collect();
    *builder.sbt() = Sbt {
        ray_generation: raygen.first().cloned().flatten(),
        miss: scene.sbt.miss.iter().map(&mut record).collect(),
        hit: scene.sbt.hit.iter().map(&mut record).collect(),
        callable: scene.sbt.callable.iter().map(&mut record).collect(),
    };
    builder.device(scene.device.clone()).flags(scene.pipeline_flags);
    if let Some(depth) = scene.max_recursion_depth {
        builder.max_recursion(depth);
    }
    if let Some(operations) = scene.fuel {
        builder.fuel(operations);
    }
    if let Some(depth) = scene.max_callable_depth {
        builder.max_callable_depth(depth);
    }
    if let Some(bytes) = scene.max_stack_size {
        builder.max_stack_size(bytes);
    }
    builder.launch_limits(scene.launch_limits);
    if let Some(size) = scene.subgroup_size {
        builder.subgroup_size(size);
    }
    Ok((builder.build()?, raygen))
}

fn resources(
    scene: &ResolvedScene,
    excluded: Option<(u32, u32, u32)>,
    addresses: &Addresses,
    errors: &mut Vec<Error>,
) -> Resources {
    // The buffers that have addresses, by name.
    let mut addressed: BTreeMap<&str, Arc<Buffer>> = BTreeMap::new();
    for buffer in &scene.unbound {
        match buffer.data.encode(addresses) {
            Ok(bytes) => drop(addressed.insert(&buffer.name, Buffer::new(&bytes))),
            Err(error) => errors.push(error),
        }
    }
    let mut resources =
        Resources { policy: scene.memory, printed_bytes: scene.printed_bytes, ..Resources::default() };
    let is_excluded = |one: &resolved::ResolvedBinding| excluded == Some((one.set, one.binding, one.element));
    for binding in scene.resources.iter().filter(|one| !is_excluded(one)) {
        let descriptor = match &binding.resource {
            Resource::NullBuffer => scene
                .device
                .check_null_descriptor("VUID-VkDescriptorBufferInfo-buffer-02998")
                .map(|()| Descriptor::Buffer(Buffer::null())),
            Resource::NullAccelerationStructure => scene
                .device
                .check_null_descriptor(
                    "VUID-VkWriteDescriptorSetAccelerationStructureKHR-pAccelerationStructures-03580",
                )
                .map(|()| Descriptor::AccelerationStructure(Tlas::empty().clone())),
            Resource::StorageBuffer(data) | Resource::UniformBuffer(data) => {
                let buffer = match data.bytes() {
                    Some(bytes) => Ok(Buffer::new(bytes)),
                    None => data.encode(addresses).map(|bytes| Buffer::new(&bytes)),
                };
                match buffer {
                    Ok(buffer) => {
                        if addresses.of_name(&binding.name).is_some() {
                            addressed.insert(&binding.name, buffer.clone());
                        }
                        Ok(Descriptor::Buffer(buffer))
                    }
                    // It has a place of its own.
                    Err(error) => {
                        errors.push(error);
                        continue;
                    }
                }
            }
            Resource::StorageImage(image) | Resource::SampledImage(image) | Resource::TexelBuffer(image) => {
                self::image(image, &scene.files.limits).map(Descriptor::Image)
            }
            Resource::Sampler(sampler) => Ok(Descriptor::Sampler(Arc::new(*sampler))),
            Resource::CombinedImageSampler(image, sampler) => {
                let sampler = Arc::new(*sampler);
                self::image(image, &scene.files.limits).map(|image| Descriptor::ImageSampler(image, sampler))
            }
            Resource::AccelerationStructure(index) => {
                Ok(Descriptor::AccelerationStructure(scene.tlas[*index].1.clone()))
            }
        };
        match descriptor {
            Ok(descriptor) => {
                let key = Binding { set: binding.set, binding: binding.binding };
                resources.insert(key, binding.element, descriptor);
            }
            Err(error) => errors.push(error.at(binding.place.clone())),
        }
    }
    if !scene.push_constants.is_empty() {
        match scene.push_constants.encode(addresses) {
            Ok(bytes) => resources.push_constants = Some(Buffer::new(&bytes)),
            Err(error) => errors.push(error),
        }
    }
    resources.memory = addresses.memory(&addressed);
    resources
}

/// Creates an image.
///
/// # Errors
/// `InvalidScene` where it is too large, and as [`machine::Image::new`].
pub fn image(image: &ImageContent, limits: &InputLimits) -> Result<Arc<machine::Image>> {
    let checked = limits.check(InputLimit::ImageBytes, image.size(), ErrorKind::InvalidScene);
    checked.map_err(|error| error.context(image.too_large()))?;
    match image.is_filled() {
        true => machine::Image::filled(image.format, image.shape, &image.texels),
        false => machine::Image::new(image.format, image.shape, &image.texels),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{DiskFiles, LoadOptions, load_text};

    #[test]
    fn more_invocations_than_fit_are_the_greatest_number() {
        let text = "version = 1\n[shaders.sum]\npath = 'spirv-fixtures/pass/compute/prefix-sum/main.comp.spv'\n\
                    [[dispatch]]\nshader = 'sum'\n[[dispatch]]\nshader = 'sum'\n\
                    [resources.a]\ntype = 'storage_buffer'\nbinding = 0\nsize = 4096\n\
                    [resources.b]\ntype = 'storage_buffer'\nbinding = 1\nsize = 4096\n\
                    [resources.c]\ntype = 'storage_buffer'\nbinding = 2\nsize = 4096\n";
        let scene = load_text(Path::new("s.toml"), text, &DiskFiles, &LoadOptions::default()).unwrap();
        let mut assembled = assemble(&scene).unwrap();
        // The product wraps in one dispatch, and the sum of two.
        assembled.dispatches[0].groups = [u32::MAX; 3];
        assert_eq!(assembled.invocations(), u64::MAX);
        assembled.dispatches[1].groups = [u32::MAX; 3];
        assert_eq!(assembled.invocations(), u64::MAX);
    }

    #[test]
    fn duplicates_are_removed_and_the_rest_counted() {
        let errors = |messages: &[&str]| {
            messages.iter().map(|text| Error::new(ErrorKind::InvalidScene, *text)).collect::<Vec<_>>()
        };
        let error = deduplicate(errors(&["a", "b", "a", "c", "d", "b"]), 2);
        assert_eq!((error.others().len(), error.not_shown()), (1, 2));
        assert_eq!((error.message(), error.others()[0].message()), ("a", "b"));
        assert_eq!(deduplicate(errors(&["a", "b"]), 0).not_shown(), 1);
    }
}
