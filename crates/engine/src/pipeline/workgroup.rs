//! Runs workgroups: batches of lanes run until each lane has ended or waits at a barrier, and then
//! from the barrier on.
//!
//! A workgroup larger than a batch is spread over several; several small ones share a batch. A
//! barrier requires that every invocation of the workgroup arrives at the same instruction, in
//! whichever batch it is. So neither the results of a workgroup nor its traps depend on the batch
//! width.

use std::ops::Range;
use std::sync::Arc;

use smallvec::SmallVec;

use crate::interp;
use crate::machine::{
    Batch, Bindings, BlockIndex, Exit, LaneTrap, Mask, Observer, OpIndex, ShaderIndex, Stop, TaskWatch,
    TrapCode, Workgroup,
};
use crate::math::array;
use crate::math::permutation::Permutation;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::op::Op;
use crate::pipeline::observer::Event;
use crate::pipeline::stats::Stats;
use crate::pipeline::trapped::{Trapped, source_line, trap_error, with_limit};
use crate::program::{Program, Terminator, WorkgroupLayout};
use anyhit_base::error::Error;

/// Bytes of workgroup memory of all workgroups that share a batch, where that is more than one.
const MAX_SHARED_BYTES: u32 = 1 << 24;

/// Lanes of a batch that wait at a barrier.
#[derive(Clone, Copy, Debug)]
struct WaitingLanes<const W: usize> {
    block: BlockIndex,
    /// The operation after the barrier.
    op: OpIndex,
    mask: Mask<W>,
}

/// A batch of the workgroups' invocations, with its lanes that wait at barriers.
#[derive(Clone, Debug)]
struct WorkgroupBatch<const W: usize> {
    batch: Batch<W>,
    waiting: SmallVec<[WaitingLanes<W>; 1]>,
    /// Lanes that go on in this round, after those that run.
    next: SmallVec<[WaitingLanes<W>; 1]>,
    /// The lanes that run, or would if the observer had not paused them.
    running: Mask<W>,
    /// The positions of its invocations among those of all batches, in the order of its lanes.
    positions: Range<usize>,
    /// Whether it runs as if there were no observer.
    is_unobserved: bool,
}

/// What a round of the batches came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Round {
    /// Every lane has ended or waits at a barrier, and some wait.
    AtBarrier,
    /// Every lane has ended.
    Over,
    /// The observer paused a batch; the round is to be resumed.
    Paused,
}

/// Everything about running workgroups that changes, but for the memory that they share.
#[derive(Clone, Debug)]
pub(super) struct WorkgroupState<const W: usize> {
    batches: Vec<WorkgroupBatch<W>>,
    /// The batch that runs in this round; those before it have run.
    at: usize,
    stats: Stats,
    pub trapped: Option<Trapped>,
    /// The index of the workgroup that has trapped.
    trapped_group: u64,
}

impl<const W: usize> WorkgroupState<W> {
    /// The batch that runs, or is the next to run.
    pub(super) fn current(&self) -> Option<&Batch<W>> {
        Some(&self.batches.get(self.at)?.batch)
    }

    /// The batch that runs, or is the next to run.
    pub(super) fn current_mut(&mut self) -> Option<&mut Batch<W>> {
        Some(&mut self.batches.get_mut(self.at)?.batch)
    }

    /// The batch, by its number, and the lane of the invocation at a position among those of all.
    fn place(&self, position: usize) -> (usize, usize) {
        let number = self.batches.partition_point(|member| member.positions.end <= position);
        (number, position - self.batches[number].positions.start)
    }
}

/// The observers of running workgroups.
pub(super) struct Observers<'a, O> {
    observer: O,
    on_event: Option<&'a mut dyn FnMut(Event)>,
    /// Whether ray queries report what their traversals test, too.
    traversal: bool,
}

impl Observers<'_, ()> {
    pub(super) fn none() -> Self {
        Self { observer: (), on_event: None, traversal: false }
    }
}

impl<'a, O> Observers<'a, O> {
    pub(super) fn interpreter_only(observer: O) -> Self {
        Self { observer, on_event: None, traversal: false }
    }

    pub(super) fn new(observer: O, on_event: &'a mut dyn FnMut(Event)) -> Self {
        Self { observer, on_event: Some(on_event), traversal: false }
    }

    /// Lets ray queries report every node, instance and primitive that they test, or not.
    pub(super) fn with_traversal(self, traversal: bool) -> Self {
        Self { traversal, ..self }
    }
}

/// What a dispatch sets for each invocation.
#[derive(Clone, Copy, Debug)]
pub(super) struct InvocationLimits {
    /// Instructions that it may execute.
    pub fuel: u64,
    /// `SubgroupSize`
    pub subgroup_size: u32,
}

/// Runs workgroups, at a time as many as fill a batch.
pub(super) struct WorkgroupRunner<'a, const W: usize> {
    program: &'a Program,
    limits: InvocationLimits,
    bindings: &'a Bindings,
    state: WorkgroupState<W>,
    /// The number of workgroups that run together.
    concurrent: usize,
    group_size: usize,
    layout: WorkgroupLayout,
    /// The places of invocations in the order of lanes, if they are drawn.
    places: Option<Permutation>,
    watch: Arc<TaskWatch>,
}

impl<'a, const W: usize> WorkgroupRunner<'a, W>
where
    LaneKernel: Width<W>,
{
    pub(super) fn new(
        program: &'a Program,
        limits: InvocationLimits,
        bindings: &'a Bindings,
        layout: WorkgroupLayout,
        watch: &Arc<TaskWatch>,
    ) -> Self {
        let state = WorkgroupState {
            batches: Vec::new(),
            at: 0,
            stats: Stats::default(),
            trapped: None,
            trapped_group: 0,
        };
        let mut runner = Self::resumed(program, limits, bindings, layout, watch, state);
        let count = runner.group_size * runner.concurrent;
        runner.state.batches = runner.batches_of(0..count).collect();
        runner
    }

    /// A runner of one workgroup in which an observer follows the invocation at a position only:
    /// batches without it are not observed. With `alone`, it has a batch of its own.
    pub(super) fn following(self, position: usize, alone: bool) -> Self {
        let mut batches: Vec<_> = match alone {
            false => self.batches_of(0..self.group_size).collect(),
            true => {
                let parts = [0..position, position..position + 1, position + 1..self.group_size];
                parts.into_iter().flat_map(|part| self.batches_of(part)).collect()
            }
        };
        for member in &mut batches {
            member.is_unobserved = !member.positions.contains(&position);
        }
        Self { state: WorkgroupState { batches, ..self.state }, ..self }
    }

    /// Batches of the invocations at some positions.
    fn batches_of(&self, positions: Range<usize>) -> impl Iterator<Item = WorkgroupBatch<W>> {
        positions.clone().step_by(W).map(move |first| {
            let mut batch = self.program.batch();
            batch.watch = Some(self.watch.clone());
            WorkgroupBatch {
                batch,
                waiting: SmallVec::new(),
                next: SmallVec::new(),
                running: Mask::NONE,
                positions: first..positions.end.min(first + W),
                is_unobserved: false,
            }
        })
    }

    /// A runner that goes on with a state.
    pub(super) fn resumed(
        program: &'a Program,
        limits: InvocationLimits,
        bindings: &'a Bindings,
        layout: WorkgroupLayout,
        watch: &Arc<TaskWatch>,
        state: WorkgroupState<W>,
    ) -> Self {
        let group_size = layout.size.iter().product::<u32>() as usize;
        // A call returns when all lanes of its batch have returned. So workgroups with barriers in
        // calls must not share a batch: each waits only for itself.
        let has_calls =
            program.blocks.iter().any(|block| matches!(block.terminator, Terminator::Call { .. }));
        let has_barriers = program.ops.iter().any(|op| matches!(op, Op::Barrier));
        let fitting = MAX_SHARED_BYTES.checked_div(layout.memory).unwrap_or(u32::MAX) as usize;
        let side_by_side = (W / group_size).min(fitting).max(1);
        let concurrent = if has_calls && has_barriers { 1 } else { side_by_side };
        let (watch, places) = (watch.clone(), None);
        Self { program, limits, bindings, state, concurrent, group_size, layout, places, watch }
    }

    /// Returns the runner with the invocations of each workgroup at other places.
    pub(super) fn placed(self, places: Option<Permutation>) -> Self {
        Self { places, ..self }
    }

    /// Runs workgroups. Returns the trap of the first workgroup that has one. The runner can run
    /// others then, and reuses the memory of its batches.
    pub(super) fn run<O: Observer<W>>(
        &mut self,
        groups: &mut dyn Iterator<Item = Workgroup>,
        observers: &mut Observers<'_, O>,
    ) -> (Stats, Option<Trapped>) {
        self.record_queries(observers);
        let mut groups = groups.map(Arc::new).peekable();
        while groups.peek().is_some() {
            let running: Vec<_> = groups.by_ref().take(self.concurrent).collect();
            // All later ones stand behind the first of these.
            let first = running.iter().map(|group| group.index()).min().unwrap_or(0);
            let first = first.saturating_mul(self.group_size as u64);
            if self.watch.is_over() || self.watch.is_beyond(first) {
                break;
            }
            self.watch.begin_batch();
            self.begin(&running, observers);
            while self.advance(&running, observers) != Round::Over {}
            let state = &mut self.state;
            let charged = state.batches.iter_mut().map(|member| member.batch.take_charged());
            self.watch.charge(charged.sum());
            let used = (running.len() * self.group_size).div_ceil(W);
            for member in &state.batches[..used] {
                state.stats.ray_queries += member.batch.queries.initialized;
                state.stats.zero_directions += member.batch.queries.zero_directions;
            }
        }
        (std::mem::take(&mut self.state.stats), self.state.trapped.take())
    }

    /// Begins one workgroup, to be run by [`WorkgroupRunner::run_to_pause`].
    pub(super) fn begin_one<O: Observer<W>>(
        &mut self,
        group: &Arc<Workgroup>,
        observers: &mut Observers<'_, O>,
    ) {
        self.record_queries(observers);
        self.begin(std::slice::from_ref(group), observers);
    }

    /// Runs one workgroup until the observer pauses it; `true` when all of it has ended. Returns
    /// the state to go on with, too.
    pub(super) fn run_to_pause<O: Observer<W>>(
        mut self,
        group: &Arc<Workgroup>,
        observers: &mut Observers<'_, O>,
    ) -> (bool, WorkgroupState<W>) {
        let ended = loop {
            match self.advance(std::slice::from_ref(group), observers) {
                Round::AtBarrier => {}
                Round::Over => break true,
                Round::Paused => break false,
            }
        };
        (ended, self.state)
    }

    /// Lets ray queries record what observers are told.
    fn record_queries<O>(&mut self, observers: &Observers<'_, O>) {
        for member in &mut self.state.batches {
            let is_recorded = observers.on_event.is_some() && !member.is_unobserved;
            member.batch.queries.events = is_recorded.then(Vec::new);
            member.batch.queries.records_traversal = observers.traversal && !member.is_unobserved;
        }
    }

    /// The positions of a workgroup's invocations among the lanes of all batches.
    fn positions(&self, group: usize) -> Range<usize> {
        group * self.group_size..(group + 1) * self.group_size
    }

    fn begin<O: Observer<W>>(&mut self, groups: &[Arc<Workgroup>], observers: &mut Observers<'_, O>) {
        let used = groups.len() * self.group_size;
        for member in &mut self.state.batches {
            member.waiting.clear();
            let positions = member.positions.start..member.positions.end.min(used);
            let invocations = &mut member.batch.invocations;
            let Workgroup { count, size, .. } = &*groups[0];
            let launch_size = array::from_fn(|axis| count[axis] * size[axis]);
            invocations.begin_workgroups(launch_size, self.limits.subgroup_size);
            for (lane, position) in positions.clone().enumerate() {
                let group = &groups[position / self.group_size];
                let place = (position % self.group_size) as u32;
                let drawn = self.places.as_ref().map_or(place, |places| places.at(place.into()) as u32);
                invocations.set_in_workgroup(lane, group, self.layout.index_of(drawn), place);
            }
            if positions.is_empty() {
                continue;
            }
            let mask = Mask::first(positions.len());
            self.program.begin(&mut member.batch, mask, self.limits.fuel);
            if O::is_active() && !member.is_unobserved {
                observers.observer.began(ShaderIndex(0), &mut member.batch);
            }
            self.watch.charge(u64::from(self.program.entry_cost()) * u64::from(mask.count()));
            member.waiting.push(WaitingLanes { block: member.batch.block, op: member.batch.op, mask });
            self.state.stats.count(self.program.stage, mask.count());
        }
    }

    /// Runs every waiting lane until it ends or arrives at a barrier.
    fn advance<O: Observer<W>>(
        &mut self,
        groups: &[Arc<Workgroup>],
        observers: &mut Observers<'_, O>,
    ) -> Round {
        while let Some(member) = self.state.batches.get_mut(self.state.at) {
            // A round that was paused in this batch goes on there.
            if member.running.is_empty() {
                self.watch.look_at_clock();
                if self.watch.expired().is_some() {
                    member.batch.look_soon();
                }
                member.next = std::mem::take(&mut member.waiting);
            }
            let has_run = match O::is_active() && member.is_unobserved {
                true => member.run(self.program, self.bindings, &mut Observers::none()),
                false => member.run(self.program, self.bindings, observers),
            };
            if !has_run {
                return Round::Paused;
            }
            self.state.at += 1;
        }
        self.state.at = 0;
        let has_returned =
            |member: &WorkgroupBatch<W>| member.waiting.is_empty() && member.batch.trapped().is_empty();
        if self.state.batches.iter().all(has_returned) {
            return Round::Over;
        }
        for (group, workgroup) in groups.iter().enumerate() {
            self.resolve_barrier(group, workgroup);
        }
        match self.state.batches.iter().all(|member| member.waiting.is_empty()) {
            true => Round::Over,
            false => Round::AtBarrier,
        }
    }

    /// Checks that either all invocations of a workgroup wait at the same barrier or none waits;
    /// otherwise traps and ends the workgroup.
    fn resolve_barrier(&mut self, group: usize, workgroup: &Workgroup) {
        let positions = self.positions(group);
        let exit = |at: usize| {
            let (number, lane) = self.state.place(at);
            self.state.batches[number].batch.exits[lane]
        };
        let traps = positions.clone().filter_map(|at| match exit(at) {
            Exit::Trapped(trap) => Some((at, trap)),
            _ => None,
        });
        // Those that a limit stopped behind another invocation have nothing to report.
        let trapped = traps.clone().find(|(_, trap)| trap.code != TrapCode::Callee);
        let ends = traps.count() > 0;
        if let Some((at, trap)) = trapped {
            self.report(at, trap, workgroup, None);
        }
        if ends {
            return self.end(positions);
        }
        let barrier = |at: usize| {
            let (number, lane) = self.state.place(at);
            let waiting = &self.state.batches[number].waiting;
            waiting.iter().find(|waiting| waiting.mask.contains(lane))?.op.previous()
        };
        let Some(first) = positions.clone().find(|&at| barrier(at).is_some()) else { return };
        let Some(other) = positions.clone().find(|&at| barrier(at) != barrier(first)) else { return };
        let (number, lane) = self.state.place(other);
        let local_index = self.state.batches[number].batch.invocations.local_index(lane);
        let [x, y, z] = workgroup.local_id(local_index);
        let note = match barrier(other) {
            None => format!("local invocation ({x}, {y}, {z}) ended without reaching it"),
            Some(op) => {
                let line = source_line(self.program, op);
                format!("local invocation ({x}, {y}, {z}) waits at another barrier{line}")
            }
        };
        let op = barrier(first).unwrap_or_default();
        self.report(first, LaneTrap { code: TrapCode::BarrierDivergence, op }, workgroup, Some(note));
        self.end(positions);
    }

    /// Ends all invocations of a workgroup.
    fn end(&mut self, positions: Range<usize>) {
        for at in positions {
            let (number, lane) = self.state.place(at);
            let member = &mut self.state.batches[number];
            member.batch.exit(Mask::lane(lane), Exit::Returned);
            for waiting in &mut member.waiting {
                waiting.mask = waiting.mask.without(Mask::lane(lane));
            }
            member.waiting.retain(|waiting| !waiting.mask.is_empty());
        }
    }

    /// Records a trap, if its workgroup is the first that has one.
    fn report(&mut self, at: usize, trap: LaneTrap, workgroup: &Workgroup, note: Option<String>) {
        if self.state.trapped.is_some() && self.state.trapped_group <= workgroup.index() {
            return;
        }
        self.state.trapped_group = workgroup.index();
        let (number, lane) = self.state.place(at);
        let batch = &self.state.batches[number].batch;
        let invocations = &batch.invocations;
        let local = workgroup.local_id(invocations.local_index(lane));
        let ids = [workgroup.id, local, invocations.launch_id(lane)];
        let [group, local, global] = ids.map(|[x, y, z]| format!("({x}, {y}, {z})"));
        let mut error: Error = trap_error(ShaderIndex(0), self.program, &[], batch, lane, trap);
        if let Some(note) = note {
            error = error.note(note);
        }
        let (stage, name) = (self.program.stage.name(), &self.program.name);
        error = with_limit(error, trap.code, self.limits.fuel, Some(self.watch.watchdog()));
        error = error.note(format!(
            "in {stage} `{name}`, workgroup {group}, local invocation {local}, global invocation id {global}"
        ));
        let offset = self.program.origins.get(trap.op.index()).map_or(0, |origin| origin.offset);
        let (launch_id, code, fault_value) =
            (invocations.launch_id(lane), trap.code, batch.fault_value[lane]);
        self.state.trapped =
            Some(Trapped { launch_id, code, fault_value, shader: ShaderIndex(0), offset, error });
    }
}

impl<const W: usize> WorkgroupBatch<W>
where
    LaneKernel: Width<W>,
{
    /// Runs lanes until each has ended or waits at a barrier; `false` where the observer paused one
    /// of them.
    fn run<O: Observer<W>>(
        &mut self,
        program: &Program,
        bindings: &Bindings,
        observers: &mut Observers<'_, O>,
    ) -> bool {
        loop {
            if self.running.is_empty() {
                if self.next.is_empty() {
                    return true;
                }
                let start = self.next.remove(0);
                let batch = &mut self.batch;
                (batch.block, batch.op, batch.mask) = (start.block, start.op, start.mask);
                self.running = start.mask;
            }
            if !self.run_on(program, bindings, observers) {
                return false;
            }
            self.running = Mask::NONE;
        }
    }

    /// Lets the running lanes go on; `false` where the observer paused them.
    fn run_on<O: Observer<W>>(
        &mut self,
        program: &Program,
        bindings: &Bindings,
        observers: &mut Observers<'_, O>,
    ) -> bool {
        let batch = &mut self.batch;
        loop {
            let stop = interp::run_shader(ShaderIndex(0), batch, program, bindings, &mut observers.observer);
            if let (Some(on_event), Some(events)) = (&mut observers.on_event, &mut batch.queries.events) {
                events.drain(..).for_each(|event| on_event(Event::RayQuery(event)));
            }
            match stop {
                Stop::Done => return true,
                Stop::Barrier { mask } => {
                    self.running = self.running & batch.live();
                    let in_call = !batch.frames().is_empty();
                    if in_call && self.running != mask {
                        // Invocations inside a call cannot wait for those outside of it.
                        batch.trap(mask, TrapCode::BarrierDivergence, batch.stopped_at());
                    } else {
                        add_waiting(
                            &mut self.waiting,
                            WaitingLanes { block: batch.block, op: batch.op, mask },
                        );
                        self.running = self.running.without(mask);
                        if in_call || self.running.is_empty() {
                            return true;
                        }
                    }
                    batch.mask = Mask::NONE;
                    if !batch.follow([]) {
                        return true;
                    }
                    batch.op = program.blocks[batch.block.index()].first;
                }
                Stop::Paused => return false,
                Stop::TraceRay { .. }
                | Stop::ExecuteCallable { .. }
                | Stop::ReportIntersection { .. }
                | Stop::HitObjectTrace { .. }
                | Stop::HitObjectExecute { .. }
                | Stop::HitObjectRecordHandle { .. } => {
                    unreachable!("bug in anyhit: a compute shader requires a ray-tracing pipeline")
                }
            }
        }
    }
}

/// Adds lanes to those that wait at the same barrier.
fn add_waiting<const W: usize>(waiting: &mut SmallVec<[WaitingLanes<W>; 1]>, new: WaitingLanes<W>) {
    match waiting.iter_mut().find(|known| known.op == new.op) {
        Some(known) => known.mask = known.mask | new.mask,
        None => waiting.push(new),
    }
}
