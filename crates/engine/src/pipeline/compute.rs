//! Compute shaders and their dispatches.

mod invocation;
mod stepping;

use std::ops::Range;
use std::sync::Arc;

use crate::machine::{
    Bindings, ChoiceKind, LaunchLimits, LaunchObserver, Observer, OpenChoices, OrderPart, Resources,
    TaskWatch, Watchdog, Workgroup,
};
use crate::math::array;
use crate::math::permutation::Permutation;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::op::Op;
use crate::pipeline::order::{GroupOrder, OrderMatters};
use crate::pipeline::run_options::{BatchWidth, RunOptions};
use crate::pipeline::single_shader::Ended;
use crate::pipeline::stats::Stats;
use crate::pipeline::tasks::{TaskQueue, TaskResults};
use crate::pipeline::trapped::{Trapped, spent_together, timed_out};
use crate::pipeline::workgroup::{InvocationLimits, Observers, WorkgroupRunner};
use crate::pipeline::{DEFAULT_FUEL, Event, Pipeline, check_subgroup_size};
use crate::program::race_analysis::{self, LaunchExtent, Memory};
use crate::program::{Program, WorkgroupLayout};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::InputLimit;

pub use invocation::{ObservedInvocation, RunPart};
pub use stepping::{Company, DispatchState, SteppedDispatch};

/// A compute shader (`VkComputePipelineCreateInfo`), ready to be dispatched.
///
/// ```
/// use anyhit_engine::machine::{Buffer, Descriptor, Resources};
/// use anyhit_engine::pipeline::Compute;
/// use anyhit::{Module, Program};
///
/// # fn main() -> anyhit::Result<()> {
/// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../spirv-fixtures/pass/compute/prefix-sum");
/// let module = Module::open(format!("{folder}/main.comp.spv"))?;
/// let compute = Compute::new(Program::of(&module, "main")?)?;
/// let sums = Buffer::zeroed(256 * 4);
/// let resources = Resources::default().bind(0, 1, Descriptor::Buffer(sums.clone()));
/// compute.dispatch(&resources, [1, 1, 1])?;
/// // 0 + 1 + ... + 255
/// assert_eq!(sums.load(255 * 4, 32), Some(32_640));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Compute {
    /// The shader.
    pub program: Arc<Program>,
    /// Instructions that an invocation may execute; see [`DEFAULT_FUEL`].
    pub fuel: u64,
    /// The limits of a whole dispatch; none unless set.
    pub launch_limits: LaunchLimits,
    /// `SubgroupSize`
    pub subgroup_size: u32,
    layout: WorkgroupLayout,
    /// Whether atomic instructions on workgroup memory depend on the schedule.
    mixes_atomics: bool,
}

/// What is drawn of the order in which a dispatch runs.
#[derive(Clone, Debug, Default)]
struct DrawnOrder {
    /// The numbers of the workgroups.
    groups: Option<Permutation>,
    /// The places of invocations in each of them.
    places: Option<Permutation>,
    /// Whether invocations run one after the other up to the next barrier.
    one_by_one: bool,
}

/// What the threads of a dispatch share.
struct DispatchTasks<'a> {
    bindings: &'a Bindings,
    tasks: &'a TaskQueue,
    watchdog: &'a Arc<Watchdog>,
    /// Workgroups along each axis, and all of them.
    groups: [u32; 3],
    count: u64,
    groups_per_task: u64,
    group_order: GroupOrder,
    drawn: DrawnOrder,
    /// Whether workgroups may run in any order.
    is_free: bool,
    on_progress: &'a (dyn Fn(u64) + Sync),
}

impl DispatchTasks<'_> {
    /// The positions of a task's workgroups.
    fn range(&self, task: u64) -> Range<u64> {
        task * self.groups_per_task..self.count.min((task + 1) * self.groups_per_task)
    }
}

impl DrawnOrder {
    /// The number of the workgroup at a position.
    fn group(&self, position: u64) -> u64 {
        self.groups.as_ref().map_or(position, |groups| groups.at(position))
    }
}

/// The number of invocations of a task, in whole workgroups: enough that taking a task costs
/// little.
const TASK_INVOCATIONS: u64 = 1024;

impl Compute {
    /// A compute shader with the default fuel and subgroups of 32.
    ///
    /// # Errors
    /// `InvalidArgument` where the program is of another stage, `UnsupportedModule` where a
    /// workgroup of it holds more registers than the limit.
    pub fn new(program: impl Into<Arc<Program>>) -> Result<Self> {
        let program = program.into();
        let Some(layout) = program.workgroup else {
            let message =
                format!("entry point `{}` is {}, not GLCompute", program.name, program.stage.name());
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        };
        let invocations = layout.size.iter().map(|&side| u64::from(side)).fold(1, u64::saturating_mul);
        let registers = invocations.saturating_mul(program.register_count.into());
        let limits = &program.module.limits;
        limits
            .check(InputLimit::WorkgroupRegisters, registers, ErrorKind::UnsupportedModule)
            .map_err(|error| error.context(format!("entry point `{}`", program.name)))?;
        let subgroup_size = crate::machine::invocation::DEFAULT_SUBGROUP_SIZE;
        let mixes_atomics = race_analysis::mixes_workgroup_atomics(&program);
        let launch_limits = LaunchLimits::default();
        Ok(Self { program, fuel: DEFAULT_FUEL, launch_limits, subgroup_size, layout, mixes_atomics })
    }

    /// Returns the shader without any optimisation; see [`Program::unoptimized`].
    ///
    /// # Errors
    /// As [`crate::program::lower()`].
    pub fn unoptimized(&self) -> Result<Self> {
        Ok(Self { program: Arc::new(self.program.unoptimized()?), ..self.clone() })
    }

    /// Returns the shader that the sanitizer observes; see [`Program::for_sanitizer`].
    ///
    /// # Errors
    /// As [`crate::program::lower()`].
    pub fn for_sanitizer(&self) -> Result<Self> {
        Ok(Self { program: Arc::new(self.program.for_sanitizer()?), ..self.clone() })
    }

    /// Sets the limits of a whole dispatch.
    #[must_use]
    pub fn launch_limits(self, limits: LaunchLimits) -> Self {
        Self { launch_limits: limits, ..self }
    }

    /// Sets how many instructions an invocation may execute; see [`DEFAULT_FUEL`].
    #[must_use]
    pub fn fuel(self, instructions: u64) -> Self {
        Self { fuel: instructions, ..self }
    }

    /// Sets `SubgroupSize`: a power of two from 1 to 128.
    ///
    /// # Errors
    /// `InvalidArgument` for any other size.
    pub fn subgroup_size(self, size: u32) -> Result<Self> {
        check_subgroup_size(size)?;
        if self.layout.derivatives.is_some() && size < 4 {
            let message = format!("derivatives require quads, but a subgroup has only {size} invocations");
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
        let least = self.program.ops.iter().map(Op::min_subgroup_size).max().unwrap_or(1);
        if size < least {
            let message = format!(
                "cooperative matrices require subgroups of at least {least} invocations, but a subgroup has only {size}"
            );
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
        Ok(Self { subgroup_size: size, ..self })
    }

    /// `WorkgroupSize`
    pub fn workgroup_size(&self) -> [u32; 3] {
        self.layout.size
    }

    /// Runs `groups` workgroups (`vkCmdDispatch`), 64 lanes at a time.
    ///
    /// # Errors
    /// As [`Compute::run`].
    pub fn dispatch(&self, resources: &Resources, groups: [u32; 3]) -> Result<Stats> {
        self.run(resources, groups, RunOptions::default())
    }

    /// Runs `groups` workgroups.
    ///
    /// # Errors
    /// `InvalidArgument` for more invocations than can be numbered; the trap of the first workgroup
    /// that has one, and in it of the lowest `LocalInvocationIndex`.
    pub fn run(&self, resources: &Resources, groups: [u32; 3], options: RunOptions<'_>) -> Result<Stats> {
        self.run_to_trap(resources, groups, options)?.map_err(|trapped| trapped.error)
    }

    /// Returns a pipeline with its shader, for names and explanations.
    ///
    /// # Errors
    /// As [`PipelineBuilder::build`](crate::pipeline::PipelineBuilder::build).
    #[doc(hidden)]
    pub fn as_pipeline(&self) -> Result<Pipeline> {
        let mut builder = Pipeline::builder();
        builder.shader(self.program.clone());
        builder.build()
    }

    /// Runs as [`Compute::run`] does under observers: in the order of the workgroups, on one
    /// thread. Events are those of ray queries. A dispatch that needs subgroups of more than 64 is
    /// not observed.
    ///
    /// # Errors
    /// As [`Compute::run`].
    pub fn run_observed(
        &self,
        resources: &Resources,
        groups: [u32; 3],
        on_event: &mut dyn FnMut(Event),
        observer: &mut dyn LaunchObserver,
    ) -> Result<Stats> {
        self.run_to_trap_observed(resources, groups, on_event, observer)?.map_err(|trapped| trapped.error)
    }

    /// Runs as [`Compute::run_observed`] does; the events of ray queries include every node,
    /// instance and primitive that their traversals test.
    ///
    /// # Errors
    /// As [`Compute::run`].
    pub fn run_observed_with_traversal(
        &self,
        resources: &Resources,
        groups: [u32; 3],
        on_event: &mut dyn FnMut(Event),
        observer: &mut dyn LaunchObserver,
    ) -> Result<Stats> {
        self.observe(resources, groups, on_event, true, observer)?.map_err(|trapped| trapped.error)
    }

    /// Runs as [`Compute::run_observed`] does; the inner result is the whole [`Trapped`], whose
    /// shader is 0.
    ///
    /// # Errors
    /// `InvalidArgument` for more invocations than can be numbered.
    pub fn run_to_trap_observed(
        &self,
        resources: &Resources,
        groups: [u32; 3],
        on_event: &mut dyn FnMut(Event),
        observer: &mut dyn LaunchObserver,
    ) -> Result<Ended> {
        self.observe(resources, groups, on_event, false, observer)
    }

    /// Runs under observers, with events of traversals on request.
    fn observe(
        &self,
        resources: &Resources,
        groups: [u32; 3],
        on_event: &mut dyn FnMut(Event),
        traversal: bool,
        observer: &mut dyn LaunchObserver,
    ) -> Result<Ended> {
        self.check_size(groups)?;
        let uses_subgroups = self.program.uses_subgroups;
        if uses_subgroups && self.subgroup_size > 64 {
            return self.run_to_trap(resources, groups, RunOptions::default());
        }
        let groups_of = groups;
        let bindings = resources.bindings(self.program.bindings());
        let count = groups.iter().map(|&side| u64::from(side)).product::<u64>();
        let mut stats = Stats::default();
        // Tasks as in `run_to_trap`, so that the same workgroups share a batch.
        let groups_per_task = self.groups_per_task();
        let dog = Watchdog::new(self.launch_limits, count.saturating_mul(self.group_size()));
        let watch = &dog.watch();
        for first in (0..count).step_by(groups_per_task as usize) {
            let size = (count - first).min(groups_per_task);
            watch.begin_task(size * self.group_size());
            let groups =
                &mut (first..count.min(first + groups_per_task)).map(|index| self.group(index, groups));
            let (task_stats, trapped) = if !uses_subgroups && self.program.order_dependent {
                let observer: &mut dyn Observer<1> = &mut *observer;
                let mut observers = Observers::new(observer, &mut *on_event).with_traversal(traversal);
                self.runner::<1>(&bindings, watch).run(groups, &mut observers)
            } else {
                let observer: &mut dyn Observer<64> = &mut *observer;
                let mut observers = Observers::new(observer, &mut *on_event).with_traversal(traversal);
                self.runner::<64>(&bindings, watch).run(groups, &mut observers)
            };
            if let Some(trapped) = trapped {
                return Ok(Err(Box::new(trapped)));
            }
            if dog.end_task(first / groups_per_task, watch.spent()).is_some() {
                let last = self.last_id(first + size - 1, groups_of);
                return Ok(Err(Box::new(spent_together(Some(&self.program), last, &dog))));
            }
            if let Some(code) = watch.timed_out() {
                let last = self.last_id(first + size - 1, groups_of);
                return Ok(Err(Box::new(timed_out(last, code, &dog))));
            }
            stats = stats.plus(&task_stats);
        }
        Ok(Ok(stats))
    }

    /// The number of workgroups of a task.
    fn groups_per_task(&self) -> u64 {
        (TASK_INVOCATIONS / self.group_size()).max(1)
    }

    /// Invocations of a workgroup.
    pub fn group_size(&self) -> u64 {
        self.layout.size.iter().map(|&side| u64::from(side)).product()
    }

    /// `GlobalInvocationId` of the last invocation of a workgroup.
    fn last_id(&self, index: u64, groups: [u32; 3]) -> [u32; 3] {
        let group = self.group(index, groups);
        array::from_fn(|axis| group.id[axis] * group.size[axis] + group.size[axis] - 1)
    }

    /// Runs as [`Compute::run`] does; the inner result is the whole [`Trapped`], whose shader is 0.
    ///
    /// # Errors
    /// `InvalidArgument` for more invocations than can be numbered.
    pub fn run_to_trap(
        &self,
        resources: &Resources,
        groups: [u32; 3],
        options: RunOptions<'_>,
    ) -> Result<Ended> {
        self.check_size(groups)?;
        let count = groups.iter().map(|&side| u64::from(side)).product::<u64>();
        let bindings = resources.bindings(self.program.bindings());
        let groups_per_task = self.groups_per_task();
        let tasks = TaskQueue::new(count.div_ceil(groups_per_task));
        let shares = self.shared_memory(groups, resources).is_some();
        let order = resources.choices.as_deref().map(|choices| self.draw_order(choices, count, shares));
        let order = order.unwrap_or_default();
        let limits = options.limits.unwrap_or(self.launch_limits);
        // Launch fuel is spent in the order of workgroups.
        let is_free = !self.program.uses_subgroups
            && !self.program.order_dependent
            && !shares
            && !self.mixes_atomics
            && resources.choices.is_none()
            && limits.fuel.is_none();
        let group_order = match is_free {
            true => GroupOrder::by_tiles(groups, self.layout.size),
            false => GroupOrder::by_index(groups),
        };
        let matters = OrderMatters {
            subgroup_size: self.program.uses_subgroups.then_some(self.subgroup_size),
            is_shared: shares || self.mixes_atomics,
        };
        let width = matters.width(self.program.order_dependent || order.one_by_one, options.width);
        let watchdog = &Watchdog::new(limits, count.saturating_mul(self.group_size()));
        let (bindings, tasks) = (&bindings, &tasks);
        let work = DispatchTasks {
            bindings,
            tasks,
            watchdog,
            groups,
            count,
            groups_per_task,
            group_order,
            drawn: order,
            is_free,
            on_progress: options.on_progress,
        };
        let worker = || match width {
            BatchWidth::One => self.run_tasks::<1>(&work),
            BatchWidth::Of64 => self.run_tasks::<64>(&work),
            BatchWidth::Of128 => self.run_tasks::<128>(&work),
        };
        Ok(tasks.run(options.most_threads(self.program.order_dependent || shares), &worker))
    }

    /// The loop of a worker thread: runs tasks until the queue is empty.
    fn run_tasks<const W: usize>(&self, work: &DispatchTasks<'_>) -> TaskResults
    where
        LaneKernel: Width<W>,
    {
        let (dog, tasks, group_order) = (work.watchdog, work.tasks, &work.group_order);
        let group_size = self.group_size();
        let mut all = TaskResults::default();
        let watch = dog.watch();
        let make = || self.runner::<W>(work.bindings, &watch).placed(work.drawn.places.clone());
        let mut runner = None;
        // The number of a trap: of its workgroup, or of the first one of its task.
        let first = |index: u64| group_order.min_index(work.range(index).start);
        for index in tasks.iter().take_while(|&index| !tasks.is_after_trap(first(index))) {
            let range = work.range(index);
            let invocations = (range.end - range.start) * group_size;
            watch.begin_task(invocations);
            let group_at = |at| self.group(group_order.index(work.drawn.group(at)), work.groups);
            let groups = &mut range.map(group_at);
            let (stats, trapped) = runner.get_or_insert_with(make).run(groups, &mut Observers::none());
            (work.on_progress)(invocations);
            let number = |trapped: &Trapped| match work.is_free {
                true => self.group_of(work.groups, trapped.launch_id),
                false => first(index),
            };
            if let Some(trapped) = &trapped {
                tasks.record_trap(number(trapped));
                if trapped.code.is_limit() {
                    let last = work.range(index).map(|at| group_order.index(at)).max().unwrap_or(0);
                    dog.stop_at(((last + 1) * group_size).saturating_sub(1));
                }
            }
            let ended = match (&trapped, watch.timed_out()) {
                (None, Some(code)) => Some(code),
                _ => None,
            };
            let trapped = trapped.map(|trapped| (number(&trapped), trapped));
            all = all.merge(TaskResults { stats, trapped });
            if let Some(code) = ended {
                let last = work.range(index).map(|at| group_order.index(at)).max().unwrap_or(0);
                dog.stop_at(((last + 1) * group_size).saturating_sub(1));
                tasks.record_trap(first(index));
                let trapped = Some((first(index), timed_out(self.last_id(last, work.groups), code, dog)));
                all = all.merge(TaskResults { stats: Stats::default(), trapped });
            }
            if let Some(over) = dog.end_task(index, watch.spent()) {
                tasks.record_trap(first(over));
                let last = work.range(over).end - 1;
                dog.stop_at((last + 1) * group_size - 1);
                let trapped = spent_together(Some(&self.program), self.last_id(last, work.groups), dog);
                let trapped = Some((first(over), trapped));
                all = all.merge(TaskResults { stats: Stats::default(), trapped });
            }
        }
        all
    }

    /// Draws the order of workgroups and of the invocations in each, as far as it may make a
    /// difference. Quads that derivatives need stay together.
    fn draw_order(&self, choices: &OpenChoices, count: u64, shares: bool) -> DrawnOrder {
        let depends = self.program.order_dependent || shares;
        let groups = OrderMatters { subgroup_size: None, is_shared: depends }.draw(choices, count);
        let quad = if self.layout.derivatives.is_some() { 4 } else { 1 };
        let is_shared = depends || self.mixes_atomics || self.layout.memory > 0;
        let kind = match self.program.sees_subgroups() {
            true => Some(ChoiceKind::SubgroupComposition),
            false => is_shared.then_some(ChoiceKind::InvocationOrder),
        };
        let draw = |kind| choices.draw_order(kind, OrderPart::Workgroup, self.group_size(), quad);
        let places = kind.and_then(draw);
        let one_by_one = is_shared && quad == 1 && choices.runs_one_by_one();
        DrawnOrder { groups, places, one_by_one }
    }

    /// Memory that the invocations of a dispatch share otherwise than by atomic instructions that
    /// commute, if there is any. They then run on one thread, in batches of 64 in their order, at
    /// every batch width.
    pub fn shared_memory(&self, groups: [u32; 3], resources: &Resources) -> Option<Memory> {
        LaunchExtent { count: groups, local: self.layout.size, resources }.shared(&[&*self.program])
    }

    /// Whether the invocations of a workgroup may share batches in any way without a change of the
    /// results.
    pub fn is_free_of_order(&self, groups: [u32; 3], resources: &Resources) -> bool {
        !self.program.uses_subgroups
            && !self.program.order_dependent
            && !self.mixes_atomics
            && self.layout.derivatives.is_none()
            && self.shared_memory(groups, resources).is_none()
    }

    /// Runs one invocation after the other under an observer, in the order of the workgroups, on
    /// one thread. The observer knows the shader as 0.
    ///
    /// # Errors
    /// As [`Compute::run`]; `UnsupportedModule` where a shader needs its subgroup.
    pub fn run_one_lane_observed(
        &self,
        resources: &Resources,
        groups: [u32; 3],
        observer: &mut dyn Observer<1>,
    ) -> Result<Stats> {
        self.check_size(groups)?;
        if self.program.uses_subgroups && self.subgroup_size > 1 {
            let message = "single invocations of a shader with subgroup instructions cannot be observed";
            return Err(Error::new(ErrorKind::UnsupportedModule, message)
                .note("set the subgroup size to 1 to run each invocation separately"));
        }
        let bindings = resources.bindings(self.program.bindings());
        let count = groups.iter().map(|&side| u64::from(side)).product::<u64>();
        let watch = &Watchdog::new(self.launch_limits, count.saturating_mul(self.group_size())).watch();
        watch.begin_task(count.saturating_mul(self.group_size()));
        let groups = &mut (0..count).map(|index| self.group(index, groups));
        let mut observers = Observers::interpreter_only(observer);
        let (stats, trapped) = self.runner::<1>(&bindings, watch).run(groups, &mut observers);
        trapped.map_or(Ok(stats), |trapped| Err(trapped.error))
    }

    /// Prepares to run workgroups, W lanes at a time.
    fn runner<'a, const W: usize>(
        &'a self,
        bindings: &'a Bindings,
        watch: &Arc<TaskWatch>,
    ) -> WorkgroupRunner<'a, W>
    where
        LaneKernel: Width<W>,
    {
        let limits = InvocationLimits { fuel: self.fuel, subgroup_size: self.subgroup_size };
        WorkgroupRunner::new(&self.program, limits, bindings, self.layout, watch)
    }

    /// Checks that the invocations of a dispatch can be numbered.
    fn check_size(&self, groups: [u32; 3]) -> Result<()> {
        let sides = groups.iter().zip(self.layout.size);
        let sides: Option<Vec<u32>> = sides.map(|(&count, size)| count.checked_mul(size)).collect();
        let count = sides
            .and_then(|sides| sides.iter().try_fold(1u64, |count, &side| count.checked_mul(u64::from(side))));
        match count {
            Some(count) if count < 1 << 40 => Ok(()),
            _ => {
                let ([x, y, z], [a, b, c]) = (groups, self.layout.size);
                let message = format!("a dispatch of {x} x {y} x {z} workgroups of {a} x {b} x {c}");
                Err(Error::new(ErrorKind::InvalidArgument, message).note(
                    "the limits are 2^32 invocations along each axis and 2^40 in total, both \
                        exclusive",
                ))
            }
        }
    }

    /// The workgroup at a linear index of a dispatch, x fastest.
    fn group(&self, index: u64, count: [u32; 3]) -> Workgroup {
        let (width, height) = (u64::from(count[0]), u64::from(count[1]));
        let id = [(index % width) as u32, (index / width % height) as u32, (index / width / height) as u32];
        let memory = crate::machine::Buffer::zeroed(self.layout.memory as usize);
        Workgroup { id, count, size: self.layout.size, memory }
    }
}
