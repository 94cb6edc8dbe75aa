//! Makes a pipeline and its resources from a resolved scene.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use crate::addresses::Addresses;
use crate::file::MissingDescriptors;
use crate::files::SceneFiles;
use crate::image_entry::{ImageContent, TexelSource};
use crate::pass::{Dispatch, LaunchPass, OwnBinding, Pass, PassWork};
use crate::read::first_of;
use crate::resolved::{
    self, ResolvedGroup, ResolvedPass, ResolvedPassWork, ResolvedPipeline, ResolvedRecord, ResolvedScene,
    ResolvedShader, ShaderCode, ShaderModule,
};
use crate::resources::{BufferView, Resource};
use crate::{block_sizes, descriptors, indirect, own_bindings};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits};
use anyhit_base::progress::Work;
use anyhit_base::sorted::SortedMap;
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources, image as machine};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::ty::Type;
use anyhit_engine::module::{self, Module};
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::pipeline::{self, Compute, Launch, Pipeline, Sbt, SbtRecord};
use anyhit_engine::program::descriptors::stand_in;
use anyhit_engine::program::{Program, lower};

/// A scene that can be launched.
#[derive(Clone, Debug)]
pub struct Assembled {
    /// `[pipeline]`: shaders and the shader binding table.
    pub pipeline: Pipeline,
    /// `[pipelines.NAME]`, in the scene's order.
    pub pipelines: Vec<Pipeline>,
    /// The contents of the descriptor sets.
    pub resources: Resources,
    /// Width, height and depth of the launch.
    pub size: [u32; 3],
    /// Dispatches of compute shaders, in order.
    pub dispatches: Vec<Dispatch>,
    /// Notes for the scene's author, a line each: buffers that end in a part of an element, and
    /// descriptors that nothing is bound to.
    pub notes: Vec<String>,
    /// What [`Assembled::run`] runs, in order.
    pub passes: Vec<Pass>,
}

impl Assembled {
    /// Returns the scene with programs that are not optimised; see [`Program::unoptimized`].
    ///
    /// # Errors
    /// As [`lower()`].
    pub fn unoptimized(&self) -> Result<Self> {
        self.lowered_again(Pipeline::unoptimized, Compute::unoptimized)
    }

    /// Returns the scene with the programs that the sanitizer observes; see
    /// [`Program::for_sanitizer`].
    ///
    /// # Errors
    /// As [`lower()`].
    pub fn for_sanitizer(&self) -> Result<Self> {
        self.lowered_again(Pipeline::for_sanitizer, Compute::for_sanitizer)
    }

    fn lowered_again(
        &self,
        lower_pipeline: impl Fn(&Pipeline) -> Result<Pipeline>,
        lower_compute: impl Fn(&Compute) -> Result<Compute>,
    ) -> Result<Self> {
        let mut reference = Self { pipeline: lower_pipeline(&self.pipeline)?, ..self.clone() };
        for pipeline in &mut reference.pipelines {
            *pipeline = lower_pipeline(pipeline)?;
        }
        for dispatch in &mut reference.dispatches {
            dispatch.compute = lower_compute(&dispatch.compute)?;
        }
        Ok(reference)
    }

    /// The launch of the pipeline.
    pub fn launch(&self) -> Launch<'_> {
        Launch { pipeline: &self.pipeline, resources: &self.resources }
    }
}

/// Loads and lowers the shaders of a scene, and makes its resources.
///
/// # Errors
/// Every mistake in shaders, groups and images, each at its place in the scene, as one error.
pub fn assemble(scene: &ResolvedScene) -> Result<Assembled> {
    assemble_excluding(scene, None)
}

/// Assembles a scene without the image at a binding, which the caller binds wherever the scene
/// does: [`bind_image`].
///
/// # Errors
/// As [`assemble`].
pub fn assemble_without(scene: &ResolvedScene, excluded: &resolved::ResolvedBinding) -> Result<Assembled> {
    assemble_excluding(scene, Some(excluded))
}

fn assemble_excluding(
    scene: &ResolvedScene,
    excluded: Option<&resolved::ResolvedBinding>,
) -> Result<Assembled> {
    let _work = Work::new("building the scene");
    let mut errors = Vec::new();
    let addresses = &Addresses::assign(scene, &mut errors);
    let mut shaders = Shaders { scene, loaded: HashMap::new(), addresses, programs: Vec::new() };
    let built: Vec<_> = scene.all_pipelines().map(|one| pipeline(&mut shaders, one, &mut errors)).collect();
    let dispatches = dispatches(&mut shaders, &mut errors);
    let mut resources = resources(scene, excluded, addresses, &mut errors);
    errors.extend(indirect::mistakes(scene));
    if scene.missing_descriptors == MissingDescriptors::Zeros {
        let programs = || shaders.programs.iter().map(|(.., program)| &**program);
        for binding in programs().flat_map(Program::bindings) {
            if !resources.stand_ins.contains_key(&binding) {
                resources.stand_ins.extend(stand_in(programs(), binding).map(|one| (binding, one)));
            }
        }
    }
    let mut pipelines: Vec<(Pipeline, Vec<Option<SbtRecord>>)> = Vec::new();
    // A pipeline that lacks a shader fails for that reason, which is already reported.
    let reported = !errors.is_empty();
    for (built, resolved) in built.into_iter().zip(scene.all_pipelines()) {
        match (built, &resolved.name) {
            (Ok(built), _) => pipelines.push(built),
            (Err(_), _) if reported => {}
            (Err(error), Some(name)) => errors.push(error.context(format!("pipeline `{name}`"))),
            (Err(error), None) => errors.push(error),
        }
    }
    for (name, tlas) in &scene.tlas {
        let mut checks = vec![scene.device.check_structure(tlas)];
        for (pipeline, _) in &pipelines {
            checks.extend([pipeline.flags.check_structure(tlas), pipeline.check_motion(tlas)]);
        }
        let context = |error: Error| error.context(format!("acceleration structure `{name}`"));
        errors.extend(checks.into_iter().filter_map(|check| check.err().map(context)));
    }
    let programs = shaders.programs.iter().map(|(.., program)| &**program);
    errors.extend(descriptors::mismatches(scene, programs));
    let own = |dispatch: &Dispatch| scene.device.check_module(&dispatch.compute.program.module).err();
    errors.extend(dispatches.iter().filter_map(own));
    let warnings = shaders.warnings();
    if scene.files.strict {
        errors.extend(shaders.modules().filter_map(|(shader, module)| {
            let context = |error: Error| error.context(format!("shader `{}`", shader.name));
            module.check_declarations().err().map(context)
        }));
    }
    if !errors.is_empty() {
        let error = deduplicate(errors, scene.files.limits.get(InputLimit::ErrorsShown));
        // A binding that is not where the source says, for one, is only understood by them.
        return Err(warnings.into_iter().fold(error, Error::note));
    }
    let mut passes = passes(scene, &pipelines, dispatches.len(), addresses)?;
    let ran: Vec<(String, Vec<&Program>)> = passes
        .iter()
        .enumerate()
        .map(|(number, pass)| {
            let programs = match &pass.work {
                PassWork::Launch(launch) => {
                    &pipelines[launch.pipeline.map_or(0, |index| index + 1)].0.programs[..]
                }
                PassWork::Dispatch(index) => std::slice::from_ref(&dispatches[*index].compute.program),
            };
            (pass.label(number), programs.iter().map(|program| &**program).collect())
        })
        .collect();
    let (own_bindings, errors) = own_bindings::own_bindings(scene, &ran);
    if !errors.is_empty() {
        return Err(deduplicate(errors, scene.files.limits.get(InputLimit::ErrorsShown)));
    }
    let programs = || shaders.programs.iter().map(|(.., program)| &**program);
    let of_passes = |program: &Program| -> Vec<&[OwnBinding]> {
        let has =
            |(_, programs): &(String, Vec<&Program>)| programs.iter().any(|one| std::ptr::eq(*one, program));
        let own: Vec<_> =
            ran.iter().zip(&own_bindings).filter(|(ran, _)| has(ran)).map(|(_, own)| &own[..]).collect();
        if own.is_empty() { vec![&[]] } else { own }
    };
    let mut notes = warnings;
    let undeclared = |(shader, module): (&ShaderModule, &Arc<Module>)| {
        module.declaration_warnings(&format!("shader `{}`", shader.name))
    };
    notes.extend(shaders.modules().flat_map(undeclared));
    notes.extend(descriptors::stride_notes(scene, programs(), &of_passes));
    notes.extend(descriptors::missing_note(scene, programs()));
    let all: Vec<&Pipeline> = pipelines.iter().map(|(pipeline, _)| pipeline).collect();
    notes.extend(block_sizes::notes(scene, programs(), &of_passes, &all, &dispatches, &passes));
    drop(ran);
    for (pass, own) in passes.iter_mut().zip(own_bindings) {
        pass.own_bindings = own;
    }
    let mut pipelines = pipelines.into_iter().map(|(pipeline, _)| pipeline);
    let pipeline = pipelines.next().expect("bug in anyhit: a scene without a pipeline");
    let pipelines = pipelines.collect();
    Ok(Assembled { pipeline, pipelines, resources, size: scene.launch, dispatches, notes, passes })
}

/// What the scene runs, in order: what `[[pass]]` lists, else the launch and then the dispatches.
/// The pipelines are `[pipeline]` and then the named ones, with their ray generation records.
fn passes(
    scene: &ResolvedScene,
    pipelines: &[(Pipeline, Vec<Option<SbtRecord>>)],
    dispatches: usize,
    addresses: &Addresses,
) -> Result<Vec<Pass>> {
    let pass = |pass: &ResolvedPass| {
        let work = match &pass.work {
            ResolvedPassWork::Dispatch(index) => PassWork::Dispatch(*index),
            ResolvedPassWork::Launch { pipeline, raygen, size, push_constants, .. } => {
                let data = push_constants.as_ref().map(|data| data.encode(addresses)).transpose()?;
                let (_, records) = &pipelines[pipeline.map_or(0, |index| index + 1)];
                PassWork::Launch(LaunchPass {
                    pipeline: *pipeline,
                    record: records[*raygen].clone(),
                    given_size: *size,
                    push_constants: data.as_deref().map(Buffer::new),
                })
            }
        };
        let (name, rebindings) = (pass.name.clone(), pass.rebindings.clone());
        let indirect = match &pass.work {
            ResolvedPassWork::Dispatch(index) => scene.dispatches[*index].indirect.as_ref(),
            ResolvedPassWork::Launch { indirect, .. } => indirect.as_deref(),
        };
        Ok(Pass { name, own_bindings: Vec::new(), rebindings, indirect: indirect.cloned(), work })
    };
    if !scene.passes.is_empty() {
        return scene.passes.iter().map(pass).collect();
    }
    let unnamed = |work, indirect| {
        let (own_bindings, rebindings) = (Vec::new(), Vec::new());
        Pass { name: None, own_bindings, rebindings, indirect, work }
    };
    let own = LaunchPass { pipeline: None, record: None, given_size: scene.launch, push_constants: None };
    let launches = pipelines[0].0.sbt.ray_generation.is_some();
    let launch = launches.then(|| unnamed(PassWork::Launch(own), None));
    let dispatches = (0..dispatches)
        .map(|index| unnamed(PassWork::Dispatch(index), scene.dispatches[index].indirect.clone()));
    Ok(launch.into_iter().chain(dispatches).collect())
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
    first_of(distinct, most)
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

    /// The modules that were loaded, in the order of the scene.
    fn modules(&self) -> impl Iterator<Item = (&ShaderModule, &Arc<Module>)> {
        self.scene.shaders.iter().enumerate().filter_map(|(index, shader)| {
            let own = || self.loaded.get(&index).and_then(|module| module.as_ref().ok());
            self.scene.loaded.get(&index).or_else(own).map(|module| (shader, module))
        })
    }

    /// What the compilers of its sources warned of, a line each.
    fn warnings(&self) -> Vec<String> {
        let most =
            usize::try_from(self.scene.files.limits.get(InputLimit::ErrorsShown)).unwrap_or(usize::MAX);
        let mut warnings = Vec::new();
        for (_, module) in self.modules() {
            for warning in &module.warnings {
                let text = format!("compiler warning: {warning}");
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
            let specialize = |module: &mut Arc<Module>, addresses| {
                let specialized = Arc::make_mut(module);
                let mut values = shader.specialization.iter();
                values.try_for_each(|(key, value)| value.specialize(specialized, key, addresses))
            };
            // Data is laid out before addresses are known, as these depend on its size.
            let has_addresses = shader.specialization.iter().any(|(_, value)| value.target().is_some());
            let mut as_laid_out = module.clone();
            specialize(&mut module, Some(self.addresses))?;
            if has_addresses && self.scene.loaded.contains_key(&shader.module) {
                specialize(&mut as_laid_out, None)?;
                if !same_array_lengths(&as_laid_out, &module) {
                    let message = "the length of an array depends on a specialization constant that is \
                        set to an address, but the layout of data in this module is computed before \
                        addresses are assigned";
                    let error = Error::new(ErrorKind::InvalidScene, message).at(shader.place.clone());
                    return Err(error.note("set `address` on the buffer and write the same number here"));
                }
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

/// Whether the arrays of one module have the same lengths under two specializations.
fn same_array_lengths(a: &Module, b: &Module) -> bool {
    let lengths = |module: &Module| -> Vec<usize> {
        let length = |ty: &Type| match *ty {
            Type::Array { length, .. } => Some(array_length(module, length)),
            _ => None,
        };
        module.types.iter().filter_map(length).collect()
    };
    lengths(a) == lengths(b)
}

/// Loads a module; a source is compiled first.
pub fn read(shader: &ShaderModule, files: &SceneFiles) -> Result<Module> {
    let context = |error: Error| error.context(escape::path(&shader.path)).at(shader.place.clone());
    match &shader.code {
        ShaderCode::SpirV(bytes) => module::load_with(bytes, files.limits).map_err(context),
        ShaderCode::Source(bytes, settings) => {
            let name = escape::path(&shader.path).to_string();
            let language = settings.language(&name).map_err(|error| error.at(shader.place.clone()))?;
            let source = match std::str::from_utf8(bytes) {
                // A file on disk may include other files.
                Ok(text) if Path::new(&shader.path).is_file() => {
                    anyhit_compile::Source::of_file(language, name, text)
                }
                Ok(text) => anyhit_compile::Source::from_text_as(language, name, text),
                Err(_) => {
                    let message = format!("{name} is not UTF-8");
                    return Err(Error::new(ErrorKind::InvalidSource, message).at(shader.place.clone()));
                }
            };
            let options =
                anyhit_compile::CompileOptions::default().debug(anyhit_compile::DebugInfoLevel::Lines);
            let options = settings.over(&options);
            let source =
                source.include_folders(&settings.include_folders).confined(files.limits, files.root.clone());
            let compiled = anyhit_compile::compile_once_with_warnings(&source, &options)
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
    let limits = &shaders.scene.pipeline;
    if let Some(operations) = limits.fuel {
        compute = compute.fuel(operations);
    }
    compute = compute.launch_limits(limits.launch_limits);
    if let Some(size) = limits.subgroup_size {
        compute = compute.subgroup_size(size).map_err(at)?;
    }
    let push_constants =
        one.push_constants.as_ref().map(|data| data.encode(shaders.addresses)).transpose()?;
    let push_constants = push_constants.as_deref().map(Buffer::new);
    Ok(Dispatch { compute, given_groups: one.groups, push_constants })
}

/// A pipeline, and all its ray generation records.
fn pipeline<'a>(
    shaders: &mut Shaders<'a>,
    resolved: &'a ResolvedPipeline,
    errors: &mut Vec<Error>,
) -> Result<(Pipeline, Vec<Option<SbtRecord>>)> {
    let device = shaders.scene.device.clone();
    let mut builder = Pipeline::builder();
    let mut groups = Vec::new();
    for group in &resolved.groups {
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
    let mut record = |record: &ResolvedRecord| -> Option<SbtRecord> {
        let group = groups.get(record.group?).copied().flatten()?;
        if record.data.is_empty() {
            return Some(SbtRecord::new(group));
        }
        match record.data.encode(addresses) {
            Ok(data) => Some(SbtRecord::with_data(group, &data)),
            Err(error) => {
                errors.push(error);
                None
            }
        }
    };
    let raygen: Vec<Option<SbtRecord>> = resolved.sbt.raygen.iter().map(&mut record).collect();
    *builder.sbt() = Sbt {
        ray_generation: raygen.first().cloned().flatten(),
        miss: resolved.sbt.miss.iter().map(&mut record).collect(),
        hit: resolved.sbt.hit.iter().map(&mut record).collect(),
        callable: resolved.sbt.callable.iter().map(&mut record).collect(),
    };
    builder = builder.device(device).flags(resolved.flags);
    if let Some(depth) = resolved.max_recursion_depth {
        builder = builder.max_recursion(depth);
    }
    if let Some(operations) = resolved.fuel {
        builder = builder.fuel(operations);
    }
    if let Some(depth) = resolved.max_callable_depth {
        builder = builder.max_callable_depth(depth);
    }
    if let Some(bytes) = resolved.max_stack_size {
        builder = builder.max_stack_size(bytes);
    }
    builder = builder.launch_limits(resolved.launch_limits);
    if let Some(size) = resolved.subgroup_size {
        builder = builder.subgroup_size(size);
    }
    Ok((builder.build()?, raygen))
}

fn resources(
    scene: &ResolvedScene,
    excluded: Option<&resolved::ResolvedBinding>,
    addresses: &Addresses,
    errors: &mut Vec<Error>,
) -> Resources {
    // The buffers that have addresses, by name.
    let mut addressed: SortedMap<&str, Arc<Buffer>> = SortedMap::new();
    for buffer in &scene.unbound {
        match buffer.data.buffer(addresses) {
            Ok(content) => drop(addressed.insert(&buffer.name, content)),
            Err(error) => errors.push(error),
        }
    }
    let mut resources =
        Resources { policy: scene.memory, printed_bytes: scene.printed_bytes, ..Resources::default() };
    let is_excluded = |one: &resolved::ResolvedBinding| {
        excluded.is_some_and(|excluded| {
            let place = |one: &resolved::ResolvedBinding| (one.set, one.binding, one.element);
            place(one) == place(excluded) || one.is_same_image(excluded)
        })
    };
    // Descriptors of one image or one buffer share it.
    let mut images: Vec<(&Arc<ImageContent>, Arc<machine::Image>)> = Vec::new();
    let mut image = |content| shared_image(&mut images, content, &scene.files.limits);
    let mut buffers: HashMap<&str, Arc<Buffer>> = HashMap::new();
    buffers.extend(addressed.iter().map(|(name, buffer)| (*name, buffer.clone())));
    let mut views: Vec<(&resolved::ResolvedBinding, &BufferView)> = Vec::new();
    for binding in &scene.resources {
        let key = Binding { set: binding.set, binding: binding.binding };
        // What lies in a heap has many names.
        if !key.is_heap() {
            resources.names.entry(key).or_insert_with(|| binding.name.as_str().into());
        }
    }
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
                match data.buffer(addresses) {
                    Ok(buffer) => {
                        buffers.insert(&binding.name, buffer.clone());
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
            // Its buffer may have a greater binding number.
            Resource::BufferView(view) => {
                views.push((binding, view));
                continue;
            }
            Resource::StorageImage(content)
            | Resource::SampledImage(content)
            | Resource::TexelBuffer(content) => image(content).map(Descriptor::Image),
            Resource::Sampler(sampler) => Ok(Descriptor::Sampler(Arc::new(*sampler))),
            Resource::CombinedImageSampler(content, sampler) => {
                let sampler = Arc::new(*sampler);
                image(content).map(|image| Descriptor::ImageSampler(image, sampler))
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
    for (binding, view) in views {
        // Without the buffer there is an error already.
        let Some(buffer) = buffers.get(view.buffer.as_str()) else { continue };
        match buffer.view(view.start(), view.range, &view.buffer) {
            Some(range) => {
                let key = Binding { set: binding.set, binding: binding.binding };
                resources.insert(key, binding.element, Descriptor::Buffer(range));
            }
            None => {
                let BufferView { buffer: name, range, .. } = view;
                let (start, size) = (view.start(), buffer.size());
                let message = format!(
                    "{range} bytes at offset {start} extend past the end of `{name}`, which has {size} \
                     bytes"
                );
                errors.push(Error::new(ErrorKind::InvalidScene, message).at(binding.place.clone()));
            }
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

/// The image of a content, which is made at its first appearance.
fn shared_image<'a>(
    known: &mut Vec<(&'a Arc<ImageContent>, Arc<machine::Image>)>,
    content: &'a Arc<ImageContent>,
    limits: &InputLimits,
) -> Result<Arc<machine::Image>> {
    if let Some((_, image)) = known.iter().find(|(other, _)| Arc::ptr_eq(other, content)) {
        return Ok(image.clone());
    }
    let image = image(content, limits)?;
    known.push((content, image.clone()));
    Ok(image)
}

/// Binds an image wherever the scene binds that of a binding, which [`assemble_without`] left out.
pub fn bind_image(
    scene: &ResolvedScene,
    at: &resolved::ResolvedBinding,
    image: &Arc<machine::Image>,
    resources: &mut Resources,
) {
    for one in scene.bindings_of_image(at) {
        let descriptor = match &one.resource {
            Resource::CombinedImageSampler(_, sampler) => {
                Descriptor::ImageSampler(image.clone(), Arc::new(*sampler))
            }
            _ => Descriptor::Image(image.clone()),
        };
        resources.insert(Binding { set: one.set, binding: one.binding }, one.element, descriptor);
    }
}

/// Creates an image.
///
/// # Errors
/// `InvalidScene` where it is too large, and as [`machine::Image::new`].
pub fn image(image: &ImageContent, limits: &InputLimits) -> Result<Arc<machine::Image>> {
    let checked = limits.check(InputLimit::ImageBytes, image.size(), ErrorKind::InvalidScene);
    checked.map_err(|error| error.context(image.too_large()))?;
    match &image.texels {
        TexelSource::Given(texel) if image.texels.are_equal(image.format) => {
            machine::Image::filled(image.format, image.shape, texel)
        }
        TexelSource::Given(texels) => machine::Image::new(image.format, image.shape, texels),
        TexelSource::Late(unread) => {
            let unread = unread.clone();
            machine::Image::later(image.format, image.shape, Arc::new(move || unread.texels()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DiskFiles, LoadOptions, load_text};

    #[test]
    fn more_invocations_than_fit_are_the_greatest_number() {
        let text = "version = 1\n[shaders.sum]\npath = '../../spirv-fixtures/pass/compute/prefix-sum/main.comp.spv'\n\
                    [[dispatch]]\nshader = 'sum'\n[[dispatch]]\nshader = 'sum'\n\
                    [resources.a]\ntype = 'storage_buffer'\nbinding = 0\nsize = 4096\n\
                    [resources.b]\ntype = 'storage_buffer'\nbinding = 1\nsize = 4096\n\
                    [resources.c]\ntype = 'storage_buffer'\nbinding = 2\nsize = 4096\n";
        let scene = load_text(Path::new("s.toml"), text, &DiskFiles, &LoadOptions::default()).unwrap();
        let mut assembled = assemble(&scene).unwrap();
        // The product wraps in one dispatch, and the sum of two.
        assembled.dispatches[0].given_groups = [u32::MAX; 3];
        assert_eq!(assembled.invocations(), u64::MAX);
        assembled.dispatches[1].given_groups = [u32::MAX; 3];
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
