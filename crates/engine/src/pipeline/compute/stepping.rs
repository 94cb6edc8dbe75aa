//! One invocation of a dispatch that runs in steps, with its workgroup.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use crate::machine::{Batch, Bindings, Observer, Resources, TaskWatch, Watchdog, Workgroup};
use crate::math::array;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::Trapped;
use crate::pipeline::compute::Compute;
use crate::pipeline::observer::Event;
use crate::pipeline::stepping::Resumed;
use crate::pipeline::workgroup::{InvocationLimits, Observers, WorkgroupRunner, WorkgroupState};
use anyhit_base::error::Result;

/// One invocation of a dispatch with the others of its workgroup, which barriers and workgroup
/// memory need. It runs under the fuel of invocations.
#[derive(Clone, Debug)]
pub struct SteppedDispatch<const W: usize> {
    compute: Compute,
    bindings: Bindings,
    group: Arc<Workgroup>,
    id: [u32; 3],
    watch: Arc<TaskWatch>,
    /// The place of the invocation in its workgroup.
    place: usize,
    company: Company,
    state: Option<WorkgroupState<W>>,
    ended: bool,
}

/// The company in which a stepped invocation runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Company {
    /// The observer observes all of its workgroup.
    Observed,
    /// The observer observes its batch only.
    Batch,
    /// It has a batch of its own, which alone is observed; the others of its workgroup share
    /// batches. Results are the same where those need not run one after the other.
    Alone,
}

/// Everything about a [`SteppedDispatch`] that changes while it runs, but for the memory that its
/// resources share.
#[derive(Clone, Debug)]
pub struct DispatchState<const W: usize> {
    state: Option<WorkgroupState<W>>,
    /// The words of the workgroup's memory.
    memory: Vec<u32>,
    ended: bool,
}

impl<const W: usize> SteppedDispatch<W>
where
    LaneKernel: Width<W>,
{
    /// The invocation with a `GlobalInvocationId`, which has not begun.
    ///
    /// # Errors
    /// `InvalidArgument` for an invocation outside the dispatch.
    pub fn new(
        compute: Compute,
        resources: &Resources,
        groups: [u32; 3],
        id: [u32; 3],
        company: Company,
    ) -> Result<Self> {
        compute.check_invocation(groups, id)?;
        let bindings = resources.bindings(compute.program.bindings());
        let group = Arc::new(compute.group(compute.group_of(groups, id), groups));
        let watch = Watchdog::new(compute.launch_limits, compute.group_size()).watch();
        watch.begin_task(compute.group_size());
        let local: [u32; 3] = array::from_fn(|axis| id[axis] % group.size[axis]);
        let is_it = |place: &u32| group.local_id(compute.layout.index_of(*place)) == local;
        let place = (0..compute.group_size() as u32).find(is_it).unwrap_or(0) as usize;
        Ok(Self { compute, bindings, group, id, watch, place, company, state: None, ended: false })
    }

    fn run_on(&mut self, observer: &mut dyn Observer<W>, on_event: &mut dyn FnMut(Event)) -> Resumed {
        if self.ended {
            return Resumed::Ended;
        }
        let limits = InvocationLimits { fuel: self.compute.fuel, subgroup_size: self.compute.subgroup_size };
        let (program, layout) = (&self.compute.program, self.compute.layout);
        let mut observers = Observers::new(observer, on_event).with_traversal(true);
        let runner = match self.state.take() {
            Some(state) => {
                WorkgroupRunner::resumed(program, limits, &self.bindings, layout, &self.watch, state)
            }
            None => {
                let mut runner =
                    WorkgroupRunner::<W>::new(program, limits, &self.bindings, layout, &self.watch);
                if self.company != Company::Observed {
                    runner = runner.following(self.place, self.company == Company::Alone);
                }
                runner.begin_one(&self.group, &mut observers);
                runner
            }
        };
        let (ended, state) = runner.run_to_pause(&self.group, &mut observers);
        (self.state, self.ended) = (Some(state), ended);
        match ended {
            true => Resumed::Ended,
            false => Resumed::Paused,
        }
    }

    /// The company in which the invocation runs.
    pub fn company(&self) -> Company {
        self.company
    }

    /// `GlobalInvocationId` of the invocation.
    pub fn id(&self) -> [u32; 3] {
        self.id
    }

    /// The workgroup.
    pub fn workgroup(&self) -> &Arc<Workgroup> {
        &self.group
    }

    /// The shader.
    pub fn compute(&self) -> &Compute {
        &self.compute
    }

    /// The shader's bindings.
    pub fn bindings(&self) -> &Bindings {
        &self.bindings
    }

    /// The trap that ended the workgroup, once there is one.
    pub fn trapped(&self) -> Option<&Trapped> {
        self.state.as_ref()?.trapped.as_ref()
    }

    /// A copy of the state, to be put back later.
    pub fn state(&self) -> DispatchState<W> {
        let memory = self.group.memory.words().iter().map(|word| word.load(Relaxed)).collect();
        DispatchState { state: self.state.clone(), memory, ended: self.ended }
    }

    /// Puts a state back.
    pub fn set_state(&mut self, state: &DispatchState<W>) {
        (self.state, self.ended) = (state.state.clone(), state.ended);
        for (word, &value) in self.group.memory.words().iter().zip(&state.memory) {
            word.store(value, Relaxed);
        }
    }

    /// The batch that runs, with the invocation's lane if it is in it.
    pub fn batch(&self) -> Option<&Batch<W>> {
        self.state.as_ref().filter(|_| !self.ended)?.current()
    }

    /// The batch that runs.
    pub fn batch_mut(&mut self) -> Option<&mut Batch<W>> {
        self.state.as_mut().filter(|_| !self.ended)?.current_mut()
    }
}

/// As those of [`SteppedLaunch`](crate::pipeline::SteppedLaunch).
macro_rules! resume {
    ($($lanes:literal),*) => {$(
        impl SteppedDispatch<$lanes> {
            /// Runs from where it stands until the observer pauses it or the whole workgroup has
            /// run. Events are those of the ray queries of the batch that runs; they name their
            /// lanes.
            pub fn resume(
                &mut self,
                observer: &mut dyn Observer<$lanes>,
                on_event: &mut dyn FnMut(Event),
            ) -> Resumed {
                self.run_on(observer, on_event)
            }
        }
    )*};
}
resume!(1, 64, 128);
