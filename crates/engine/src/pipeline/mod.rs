//! Ray-tracing pipelines: shader groups, the shader binding table, traces and launches.
//!
//! The interpreter stops at an instruction that needs the pipeline; the pipeline executes it and
//! resumes the shader. Everything in progress is on one explicit [`stack`]: shaders and, between
//! them, the traces and calls that they wait for. So the recursion limit and the call stack of an
//! error message come from one data structure, and the host's stack does not recurse.

pub mod bands;
pub mod compute;
pub mod device;
mod flags;
pub mod group;
mod hit_object;
mod host_ray;
mod host_scene;
pub mod launch;
pub mod observed_launch;
mod observer;
mod opaque_batch;
mod order;
mod payload;
mod report;
mod run_options;
pub mod sbt;
mod single_shader;
pub mod stack;
mod stats;
pub mod stepping;
mod tasks;
mod trace;
mod tracing;
mod trapped;
mod workgroup;
mod written_memory;

use std::fmt;
use std::sync::Arc;

use crate::accel::RecordIndex;
use crate::machine::invocation::DEFAULT_SUBGROUP_SIZE;
use crate::machine::{LaunchLimits, Resources, ShaderIndex};
use crate::module::interface::Stage;
use crate::ops::pointer::storage;
use crate::program::Program;
use crate::program::race_analysis::{LaunchExtent, Memory};
use anyhit_base::error::{Error, ErrorKind, Result};

pub use bands::{Band, BandedLaunch, NotStreamed, StreamedImage};
pub use compute::{Company, Compute, DispatchState, ObservedInvocation, RunPart, SteppedDispatch};
pub use device::{DeviceFeatures, DeviceLimits, DeviceProfile};
pub use flags::PipelineFlags;
pub use group::{Group, HitGroup};
pub use host_ray::{RayOperands, RayOutcome, ShadowWord};
pub use host_scene::HostScene;
pub use launch::Launch;
pub use observer::{Caller, Event, PipelineObserver};
pub use payload::{describe_with_members, source_file};
pub use run_options::{BatchWidth, RunOptions};
pub use sbt::{Sbt, SbtRecord};
pub use stats::{Elided, ShaderStats, Stats};
pub use stepping::{ActiveShader, LaunchState, Resumed, SteppedLaunch};
pub use tracing::trace_operands;
pub use trapped::Trapped;
pub use trapped::{source_line, source_line_of, trap_error, with_limit, with_location};
pub use written_memory::WrittenMemory;
pub use written_memory::once;

/// The instructions that an invocation may execute, counted at back edges, calls and stops (a
/// trace, a call of a callable shader, a report, a barrier: 64 instructions each), unless set
/// otherwise. A call costs as much as the function called has instructions.
pub const DEFAULT_FUEL: u64 = 1 << 28;
/// `maxPipelineRayRecursionDepth`, unless set otherwise; what NVIDIA's driver reports.
pub const DEFAULT_RECURSION: u32 = 31;
/// How deeply callable shaders may call each other, unless set otherwise: Vulkan sets no limit but
/// the size of the stack.
pub const DEFAULT_CALLABLE_DEPTH: u32 = 1024;
/// The greatest depth of callable shaders that can be set.
pub const GREATEST_CALLABLE_DEPTH: u32 = 1 << 14;

/// Bytes of registers, for each invocation, of shaders that call each other, unless set otherwise.
/// A batch of 64 invocations takes 64 times as many.
pub const DEFAULT_STACK_SIZE: u64 = 1 << 23;

/// Shaders, groups and the shader binding table.
#[derive(Clone)]
#[must_use]
pub struct Pipeline {
    /// The programs that groups name.
    #[doc(hidden)]
    pub programs: Vec<Arc<Program>>,
    /// The shader groups.
    #[doc(hidden)]
    pub groups: Vec<Group>,
    /// The shader binding table.
    #[doc(hidden)]
    pub sbt: Sbt,
    /// `maxPipelineRayRecursionDepth`
    #[doc(hidden)]
    pub max_recursion: u32,
    /// How deeply callable shaders may call each other.
    #[doc(hidden)]
    pub max_callable_depth: u32,
    /// How many bytes of registers the shaders of an invocation may hold where one of them traces
    /// or calls another.
    #[doc(hidden)]
    pub max_stack_size: u64,
    /// Instructions that an invocation may execute; see [`DEFAULT_FUEL`].
    #[doc(hidden)]
    pub fuel: u64,
    /// The limits of a whole launch.
    #[doc(hidden)]
    pub launch_limits: LaunchLimits,
    /// `SubgroupSize`
    #[doc(hidden)]
    pub subgroup_size: u32,
    /// The flags that the pipeline is created with.
    #[doc(hidden)]
    pub flags: PipelineFlags,
    /// `maxRayDispatchInvocationCount`
    #[doc(hidden)]
    pub max_invocations: u64,
    /// `maxShaderBindingTableRecordIndex`
    #[doc(hidden)]
    pub max_record_index: u64,
}

/// The programs and limits; of groups and records the numbers.
impl fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Sbt { ray_generation, miss, hit, callable, .. } = &self.sbt;
        f.debug_struct("Pipeline")
            .field("programs", &self.programs)
            .field("groups", &self.groups.len())
            .field("has_ray_generation", &ray_generation.is_some())
            .field("miss_records", &miss.len())
            .field("hit_records", &hit.len())
            .field("callable_records", &callable.len())
            .field("max_recursion", &self.max_recursion)
            .field("fuel", &self.fuel)
            .field("launch_limits", &self.launch_limits)
            .field("subgroup_size", &self.subgroup_size)
            .field("flags", &self.flags)
            .finish_non_exhaustive()
    }
}

impl Pipeline {
    /// Begins a pipeline.
    #[must_use]
    pub fn builder() -> PipelineBuilder {
        PipelineBuilder::default()
    }

    /// A pipeline of one shader and no groups, to explain a run of it.
    #[doc(hidden)]
    pub fn of_shader(program: &Arc<Program>) -> Self {
        let mut builder = Self::builder();
        builder.shader(program.clone());
        builder.build().expect("bug in anyhit: a pipeline without groups is rejected")
    }

    /// Returns the pipeline with programs that are not optimised; see [`Program::unoptimized`].
    ///
    /// # Errors
    /// As [`crate::program::lower()`].
    #[doc(hidden)]
    pub fn unoptimized(&self) -> Result<Self> {
        self.partly_unoptimized(|_| true)
    }

    /// Returns the pipeline with the programs that the sanitizer observes; see
    /// [`Program::for_sanitizer`].
    ///
    /// # Errors
    /// As [`crate::program::lower()`].
    #[doc(hidden)]
    pub fn for_sanitizer(&self) -> Result<Self> {
        let programs = self.programs.iter().map(|program| Ok(Arc::new(program.for_sanitizer()?)));
        Ok(Self { programs: programs.collect::<Result<_>>()?, ..self.clone() })
    }

    /// [`Pipeline::unoptimized`] of the shaders that are wanted; the others stay optimised.
    ///
    /// # Errors
    /// As [`crate::program::lower()`].
    #[doc(hidden)]
    pub fn partly_unoptimized(&self, is_wanted: impl Fn(ShaderIndex) -> bool) -> Result<Self> {
        let unoptimized = |(at, program): (usize, &Arc<Program>)| match is_wanted(ShaderIndex::new(at)) {
            true => Ok(Arc::new(program.unoptimized()?)),
            false => Ok(program.clone()),
        };
        let programs = self.programs.iter().enumerate().map(unoptimized).collect::<Result<_>>()?;
        Ok(Self { programs, ..self.clone() })
    }

    /// The number of words of the largest payload that a shader declares.
    #[doc(hidden)]
    pub fn payload_words(&self) -> usize {
        let counts = self.programs.iter().filter_map(|program| {
            program
                .interface_registers(storage::INCOMING_RAY_PAYLOAD)
                .map(|registers| registers.count as usize)
        });
        counts.max().unwrap_or(0)
    }

    /// Checks what [`PipelineBuilder::build`] has checked, as its parts may have been changed
    /// since: groups, tables and the limits that are counted on.
    ///
    /// # Errors
    /// `InvalidScene` where a group or a record names what does not exist, or is of another kind;
    /// `InvalidArgument` for the size of subgroups and the depth of calls.
    #[doc(hidden)]
    pub fn check_parts(&self) -> Result<()> {
        self.groups.iter().try_for_each(|&group| check_group(&self.programs, group))?;
        self.sbt.check(&self.programs, &self.groups)?;
        check_subgroup_size(self.subgroup_size)?;
        check_callable_depth(self.max_callable_depth)
    }

    /// The group of a record.
    #[doc(hidden)]
    pub fn group_of(&self, record: &SbtRecord) -> Group {
        self.groups[record.group as usize]
    }

    /// The hit group of a record; `None` for a null record and beyond the table.
    #[doc(hidden)]
    pub fn hit_group(&self, record: RecordIndex) -> Option<HitGroup> {
        match self.group_of(record.get(&self.sbt.hit)?.as_ref()?) {
            Group::Hit(group) => Some(group),
            Group::General(_) => None,
        }
    }

    /// Whether a shader has no effect, whatever its inputs are.
    fn is_empty(&self, shader: ShaderIndex) -> bool {
        self.programs[shader.index()].is_empty()
    }

    /// Whether a shader's results depend on how invocations interleave. A launch then runs them one
    /// after the other, in launch order, on one thread.
    #[doc(hidden)]
    pub fn order_dependent(&self) -> bool {
        self.programs.iter().any(|program| program.order_dependent)
    }

    /// Memory that the invocations of a launch share otherwise than by atomic instructions that
    /// commute, if there is any. They then run on one thread, in batches of 64 in launch order, at
    /// every batch width.
    #[doc(hidden)]
    pub fn shared_memory(&self, size: [u32; 3], resources: &Resources) -> Option<Memory> {
        let programs: Vec<&Program> = self.programs.iter().map(|program| &**program).collect();
        LaunchExtent { count: size, local: [1; 3], resources }.shared(&programs)
    }

    /// Whether a shader uses subgroup instructions, so that whole subgroups must run together.
    #[doc(hidden)]
    pub fn uses_subgroups(&self) -> bool {
        self.programs.iter().any(|program| program.uses_subgroups)
    }

    /// The size of subgroups, if a batch must hold whole ones.
    fn whole_subgroups(&self) -> Option<u32> {
        self.uses_subgroups().then_some(self.subgroup_size)
    }
}

/// Collects shaders, groups and records.
#[derive(Clone, Debug, Default)]
#[must_use]
pub struct PipelineBuilder {
    programs: Vec<Arc<Program>>,
    groups: Vec<Group>,
    sbt: Sbt,
    max_recursion: Option<u32>,
    max_callable_depth: Option<u32>,
    max_stack_size: Option<u64>,
    fuel: Option<u64>,
    launch_limits: LaunchLimits,
    subgroup_size: Option<u32>,
    flags: PipelineFlags,
    device: DeviceProfile,
}

impl PipelineBuilder {
    /// Adds a shader.
    #[doc(hidden)]
    pub fn shader(&mut self, program: impl Into<Arc<Program>>) -> ShaderIndex {
        self.programs.push(program.into());
        ShaderIndex::new(self.programs.len() - 1)
    }

    /// Adds a group and gives its index.
    ///
    /// # Errors
    /// `InvalidScene` if a shader's stage does not fit its member of the group; `InvalidArgument`
    /// for a shader that was not added.
    #[doc(hidden)]
    pub fn group(&mut self, group: Group) -> Result<u32> {
        check_group(&self.programs, group)?;
        self.groups.push(group);
        Ok(self.groups.len() as u32 - 1)
    }

    /// Adds a ray generation shader and makes it the one that launches run.
    ///
    /// # Errors
    /// As [`PipelineBuilder::group`].
    pub fn ray_generation(mut self, program: impl Into<Arc<Program>>) -> Result<Self> {
        let shader = self.shader(program);
        let group = self.group(Group::General(shader))?;
        self.sbt.ray_generation = Some(SbtRecord::new(group));
        Ok(self)
    }

    /// Adds a miss shader as the next miss record.
    ///
    /// # Errors
    /// As [`PipelineBuilder::group`].
    pub fn miss(mut self, program: impl Into<Arc<Program>>) -> Result<Self> {
        let shader = self.shader(program);
        let group = self.group(Group::General(shader))?;
        self.sbt.miss.push(Some(SbtRecord::new(group)));
        Ok(self)
    }

    /// Adds a callable shader as the next callable record.
    ///
    /// # Errors
    /// As [`PipelineBuilder::group`].
    pub fn callable(mut self, program: impl Into<Arc<Program>>) -> Result<Self> {
        let shader = self.shader(program);
        let group = self.group(Group::General(shader))?;
        self.sbt.callable.push(Some(SbtRecord::new(group)));
        Ok(self)
    }

    /// Adds a hit group of any of its three shaders as the next hit record.
    ///
    /// # Errors
    /// As [`PipelineBuilder::group`]; `InvalidArgument` for two shaders of one stage.
    pub fn hit(mut self, programs: impl IntoIterator<Item = Program>) -> Result<Self> {
        let mut group = HitGroup::default();
        for program in programs {
            let stage = program.stage;
            let shader = self.shader(program);
            let member = group.member(stage).ok_or_else(|| {
                let message = format!("{} cannot be part of a hit group", stage.name());
                Error::new(ErrorKind::InvalidScene, message)
            })?;
            if member.replace(shader).is_some() {
                let message = format!("a hit group has two shaders of the stage {}", stage.name());
                return Err(Error::new(ErrorKind::InvalidArgument, message));
            }
        }
        let group = self.group(Group::Hit(group))?;
        self.sbt.hit.push(Some(SbtRecord::new(group)));
        Ok(self)
    }

    /// The shader binding table, to add records with data, of shared groups or with null handles.
    pub fn sbt(&mut self) -> &mut Sbt {
        &mut self.sbt
    }

    /// Sets `maxPipelineRayRecursionDepth`.
    #[must_use]
    pub fn max_recursion(mut self, depth: u32) -> Self {
        self.max_recursion = Some(depth);
        self
    }

    /// Sets how deeply callable shaders may call each other: 1 to [`GREATEST_CALLABLE_DEPTH`].
    #[must_use]
    pub fn max_callable_depth(mut self, depth: u32) -> Self {
        self.max_callable_depth = Some(depth);
        self
    }

    /// Sets how many bytes of registers the shaders of an invocation may hold where one of them
    /// traces or calls another (as `vkCmdSetRayTracingPipelineStackSizeKHR` sets a pipeline's
    /// stack); [`DEFAULT_STACK_SIZE`] unless set.
    #[must_use]
    pub fn max_stack_size(mut self, bytes: u64) -> Self {
        self.max_stack_size = Some(bytes);
        self
    }

    /// Sets the limits of a whole launch; unless set, it has none.
    #[must_use]
    pub fn launch_limits(mut self, limits: LaunchLimits) -> Self {
        self.launch_limits = limits;
        self
    }

    /// Sets how many instructions an invocation may execute; see [`DEFAULT_FUEL`].
    #[must_use]
    pub fn fuel(mut self, instructions: u64) -> Self {
        self.fuel = Some(instructions);
        self
    }

    /// Sets `SubgroupSize`: a power of two from 1 to 128.
    #[must_use]
    pub fn subgroup_size(mut self, size: u32) -> Self {
        self.subgroup_size = Some(size);
        self
    }

    /// Sets the pipeline's flags.
    #[must_use]
    pub fn flags(mut self, flags: PipelineFlags) -> Self {
        self.flags = flags;
        self
    }

    /// Sets the device that the pipeline is for: [`PipelineBuilder::build`] refuses what it does
    /// not support.
    #[must_use]
    pub fn device(mut self, device: DeviceProfile) -> Self {
        self.device = device;
        self
    }

    /// Builds the pipeline.
    ///
    /// # Errors
    /// `InvalidScene` if a record names a group that does not exist or does not fit its table;
    /// `InvalidModule` and `InvalidScene` for what the device does not support.
    pub fn build(self) -> Result<Pipeline> {
        self.sbt.check(&self.programs, &self.groups)?;
        let size = self.subgroup_size.unwrap_or(DEFAULT_SUBGROUP_SIZE);
        check_subgroup_size(size)?;
        let limit = u32::try_from(self.device.limits.max_ray_recursion_depth).unwrap_or(u32::MAX);
        let max_recursion = self.max_recursion.unwrap_or(DEFAULT_RECURSION.min(limit));
        self.check_device(max_recursion)?;
        let max_callable_depth = self.max_callable_depth.unwrap_or(DEFAULT_CALLABLE_DEPTH);
        check_callable_depth(max_callable_depth)?;
        Ok(Pipeline {
            programs: self.programs.clone(),
            groups: self.groups.clone(),
            sbt: self.sbt.clone(),
            max_recursion,
            max_callable_depth,
            max_stack_size: self.max_stack_size.unwrap_or(DEFAULT_STACK_SIZE),
            fuel: self.fuel.unwrap_or(DEFAULT_FUEL),
            launch_limits: self.launch_limits,
            subgroup_size: self.subgroup_size.unwrap_or(DEFAULT_SUBGROUP_SIZE),
            flags: self.flags,
            max_invocations: self.device.limits.max_ray_dispatch_invocation_count,
            max_record_index: self.device.limits.max_shader_binding_table_record_index,
        })
    }

    fn check_device(&self, max_recursion: u32) -> Result<()> {
        let device = &self.device;
        device.check_pipeline(max_recursion, self.flags)?;
        self.flags.check_groups(&self.groups)?;
        for (at, program) in self.programs.iter().enumerate() {
            let context = |error: Error| error.context(format!("shader `{}`", program.name));
            self.flags.check_times(program).map_err(context)?;
            let known = self.programs[..at].iter().any(|other| Arc::ptr_eq(&other.module, &program.module));
            if !known {
                device.check_module(&program.module).map_err(context)?;
            }
            device.check_subgroups(program).map_err(context)?;
            let is_attribute = |class: u32| {
                [storage::HIT_ATTRIBUTE, storage::HIT_OBJECT_ATTRIBUTE_NV, storage::HIT_OBJECT_ATTRIBUTE_EXT]
                    .contains(&class)
            };
            for registers in program.interface.iter().filter(|one| is_attribute(one.storage_class)) {
                device.check_attributes(&program.name, u64::from(registers.count) * 4)?;
            }
        }
        for (table, records) in [
            ("ray generation", std::slice::from_ref(&self.sbt.ray_generation)),
            ("miss", &self.sbt.miss[..]),
            ("hit", &self.sbt.hit[..]),
            ("callable", &self.sbt.callable[..]),
        ] {
            for (at, record) in records.iter().enumerate() {
                let data = record.as_ref().and_then(|record| record.data.as_ref());
                device.check_record(table, at, data.map_or(0, |data| data.size()))?;
            }
        }
        Ok(())
    }
}

/// Checks that the shaders of a group exist and are of its stages.
fn check_group(programs: &[Arc<Program>], group: Group) -> Result<()> {
    let check = |shader: ShaderIndex, stages: &[Stage]| {
        let program = programs.get(shader.index()).ok_or_else(|| {
            Error::new(ErrorKind::InvalidArgument, format!("the pipeline has no shader {}", shader.0))
        })?;
        if stages.contains(&program.stage) {
            return Ok(());
        }
        let wanted: Vec<_> = stages.iter().map(|stage| stage.name()).collect();
        Err(Error::new(
            ErrorKind::InvalidScene,
            format!("shader `{}` is {}, not {}", program.name, program.stage.name(), wanted.join(" or ")),
        )
        .note("VUID-VkRayTracingShaderGroupCreateInfoKHR-type-03474 and others"))
    };
    match group {
        Group::General(shader) => check(shader, &[Stage::RayGeneration, Stage::Miss, Stage::Callable]),
        Group::Hit(HitGroup { closest_hit, any_hit, intersection }) => {
            let members = [
                (closest_hit, Stage::ClosestHit),
                (any_hit, Stage::AnyHit),
                (intersection, Stage::Intersection),
            ];
            let mut members = members.into_iter().filter_map(|(shader, stage)| Some((shader?, stage)));
            members.try_for_each(|(shader, stage)| check(shader, &[stage]))
        }
    }
}

/// Checks how deeply callable shaders may call each other.
pub fn check_callable_depth(depth: u32) -> Result<()> {
    if (1..=GREATEST_CALLABLE_DEPTH).contains(&depth) {
        return Ok(());
    }
    let message = format!("max_callable_depth is {depth}, expected 1 to {GREATEST_CALLABLE_DEPTH}");
    Err(Error::new(ErrorKind::InvalidArgument, message))
}

/// Checks `SubgroupSize`.
fn check_subgroup_size(size: u32) -> Result<()> {
    if !size.is_power_of_two() || size > 128 {
        let message = format!("a subgroup size must be 1, 2, 4, ... or 128, found {size}");
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    Ok(())
}
