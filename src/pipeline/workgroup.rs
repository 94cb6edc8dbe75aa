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

use crate::error::Error;
use crate::interp;
use crate::machine::{
    Batch, Bindings, BlockIndex, Exit, Invocation, LaneTrap, Mask, Observer, OpIndex, ShaderIndex, Stop,
    TaskWatch, TrapCode, Workgroup,
};
use crate::math::permutation::Permutation;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::op::Op;
use crate::pipeline::observer::Event;
use crate::pipeline::stats::Stats;
use crate::pipeline::trapped::{Trapped, source_line, trap_error, with_limit};
use crate::program::{Program, Terminator, WorkgroupLayout};

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
#[derive(Debug)]
struct WorkgroupBatch<const W: usize> {
    batch: Batch<W>,
    waiting: SmallVec<[WaitingLanes<W>; 1]>,
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

    /// Ray queries report every node, instance and primitive that they test, too.
    pub(super) fn with_traversal(self) -> Self {
        Self { traversal: true, ..self }
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
    batches: Vec<WorkgroupBatch<W>>,
    /// The number of workgroups that run together.
    concurrent: usize,
    group_size: usize,
    layout: WorkgroupLayout,
    /// The places of invocations in the order of lanes, if they are drawn.
    places: Option<Permutation>,
    stats: Stats,
    trapped: Option<Trapped>,
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
        let group_size = layout.size.iter().product::<u32>() as usize;
        // A call returns when all lanes of its batch have returned. So workgroups with barriers in
        // calls must not share a batch: each waits only for itself.
        let has_calls =
            program.blocks.iter().any(|block| matches!(block.terminator, Terminator::Call { .. }));
        let has_barriers = program.ops.iter().any(|op| matches!(op, Op::Barrier));
        let fitting = MAX_SHARED_BYTES.checked_div(layout.memory).unwrap_or(u32::MAX) as usize;
        let side_by_side = (W / group_size).min(fitting).max(1);
        let concurrent = if has_calls && has_barriers { 1 } else { side_by_side };
        let batches = (0..(group_size * concurrent).div_ceil(W))
            .map(|_| {
                let mut batch = program.batch();
                batch.watch = Some(watch.clone());
                WorkgroupBatch { batch, waiting: SmallVec::new() }
            })
            .collect();
        let (stats, trapped) = (Stats::default(), None);
        let watch = watch.clone();
        let places = None;
        Self {
            program,
            limits,
            bindings,
            batches,
            concurrent,
            group_size,
            layout,
            places,
            stats,
            trapped,
            watch,
        }
    }

    /// Returns the runner with the invocations of each workgroup at other places.
    pub(super) fn placed(self, places: Option<Permutation>) -> Self {
        Self { places, ..self }
    }

    /// Runs workgroups. Returns the trap of the first workgroup that has one.
    pub(super) fn run<O: Observer<W>>(
        mut self,
        groups: &mut dyn Iterator<Item = Workgroup>,
        observers: &mut Observers<'_, O>,
    ) -> (Stats, Option<Trapped>) {
        for member in &mut self.batches {
            member.batch.queries.events = observers.on_event.is_some().then(Vec::new);
            member.batch.queries.records_traversal = observers.traversal;
        }
        let mut groups = groups.map(Arc::new).peekable();
        while groups.peek().is_some() {
            let running: Vec<_> = groups.by_ref().take(self.concurrent).collect();
            let first = running[0].index().saturating_mul(self.group_size as u64);
            if self.watch.is_over() || self.watch.is_beyond(first) {
                break;
            }
            self.watch.begin_batch();
            self.begin(&running, observers);
            while self.advance(&running, observers) {}
            let charged = self.batches.iter_mut().map(|member| member.batch.take_charged());
            self.watch.charge(charged.sum());
            let used = (running.len() * self.group_size).div_ceil(W);
            for member in &self.batches[..used] {
                self.stats.ray_queries += member.batch.queries.initialized;
                self.stats.zero_directions += member.batch.queries.zero_directions;
            }
        }
        (self.stats, self.trapped)
    }

    /// The positions of a workgroup's invocations among the lanes of all batches.
    fn positions(&self, group: usize) -> Range<usize> {
        group * self.group_size..(group + 1) * self.group_size
    }

    fn begin<O: Observer<W>>(&mut self, groups: &[Arc<Workgroup>], observers: &mut Observers<'_, O>) {
        let used = groups.len() * self.group_size;
        for (at, member) in self.batches.iter_mut().enumerate() {
            member.waiting.clear();
            let lanes = used.saturating_sub(at * W).min(W);
            for lane in 0..lanes {
                let position = at * W + lane;
                let group = &groups[position / self.group_size];
                let place = (position % self.group_size) as u32;
                let drawn = self.places.as_ref().map_or(place, |places| places.at(place.into()) as u32);
                let local_index = self.layout.index_of(drawn);
                let invocation = Invocation {
                    launch_id: group.global_id(local_index),
                    launch_size: std::array::from_fn(|axis| group.count[axis] * group.size[axis]),
                    subgroup_size: self.limits.subgroup_size,
                    workgroup: Some(group.clone()),
                    local_index,
                    subgroup_order: place,
                    ..Invocation::default()
                };
                member.batch.invocations.set(lane, invocation);
            }
            if lanes == 0 {
                continue;
            }
            let mask = Mask::first(lanes);
            self.program.begin(&mut member.batch, mask, self.limits.fuel);
            if O::is_active() {
                observers.observer.began(ShaderIndex(0), &mut member.batch);
            }
            self.watch.charge(u64::from(self.program.entry_cost()) * u64::from(mask.count()));
            member.waiting.push(WaitingLanes { block: member.batch.block, op: member.batch.op, mask });
            self.stats.count(self.program.stage, mask.count());
        }
    }

    /// Runs every waiting lane until it ends or arrives at a barrier; `false` when all have ended.
    fn advance<O: Observer<W>>(
        &mut self,
        groups: &[Arc<Workgroup>],
        observers: &mut Observers<'_, O>,
    ) -> bool {
        for member in &mut self.batches {
            self.watch.look_at_clock();
            if self.watch.expired().is_some() {
                member.batch.look_soon();
            }
            for start in std::mem::take(&mut member.waiting) {
                member.run(start, self.program, self.bindings, observers);
            }
        }
        for (group, workgroup) in groups.iter().enumerate() {
            self.resolve_barrier(group, workgroup);
        }
        self.batches.iter().any(|member| !member.waiting.is_empty())
    }

    /// Checks that either all invocations of a workgroup wait at the same barrier or none waits;
    /// otherwise traps and ends the workgroup.
    fn resolve_barrier(&mut self, group: usize, workgroup: &Workgroup) {
        let positions = self.positions(group);
        let traps = positions.clone().filter_map(|at| match self.batches[at / W].batch.exits[at % W] {
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
            let waiting = &self.batches[at / W].waiting;
            waiting.iter().find(|waiting| waiting.mask.contains(at % W))?.op.previous()
        };
        let Some(first) = positions.clone().find(|&at| barrier(at).is_some()) else { return };
        let Some(other) = positions.clone().find(|&at| barrier(at) != barrier(first)) else { return };
        let local_index = self.batches[other / W].batch.invocations.local_index(other % W);
        let [x, y, z] = workgroup.local_id(local_index);
        let note = match barrier(other) {
            None => format!("local invocation ({x}, {y}, {z}) has ended without it"),
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
            let member = &mut self.batches[at / W];
            member.batch.exit(Mask::lane(at % W), Exit::Returned);
            for waiting in &mut member.waiting {
                waiting.mask = waiting.mask.without(Mask::lane(at % W));
            }
            member.waiting.retain(|waiting| !waiting.mask.is_empty());
        }
    }

    /// Records a trap, if it is the first.
    fn report(&mut self, at: usize, trap: LaneTrap, workgroup: &Workgroup, note: Option<String>) {
        if self.trapped.is_some() {
            return;
        }
        let batch = &self.batches[at / W].batch;
        let (lane, invocations) = (at % W, &batch.invocations);
        let local = workgroup.local_id(invocations.local_index(lane));
        let ids = [workgroup.id, local, invocations.launch_id(lane)];
        let [group, local, global] = ids.map(|[x, y, z]| format!("({x}, {y}, {z})"));
        let mut error: Error = trap_error(ShaderIndex(0), self.program, &[], batch, at % W, trap);
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
        self.trapped = Some(Trapped { launch_id, code, fault_value, shader: ShaderIndex(0), offset, error });
    }
}

impl<const W: usize> WorkgroupBatch<W>
where
    LaneKernel: Width<W>,
{
    /// Runs lanes until each has ended or waits at a barrier.
    fn run<O: Observer<W>>(
        &mut self,
        start: WaitingLanes<W>,
        program: &Program,
        bindings: &Bindings,
        observers: &mut Observers<'_, O>,
    ) {
        let batch = &mut self.batch;
        (batch.block, batch.op, batch.mask) = (start.block, start.op, start.mask);
        let mut running = start.mask;
        loop {
            if O::is_active() {
                observers.observer.resumed(ShaderIndex(0), batch);
            }
            let stop = interp::run(batch, program, bindings, &mut observers.observer);
            if O::is_active() {
                observers.observer.stopped(ShaderIndex(0), batch);
            }
            if let (Some(on_event), Some(events)) = (&mut observers.on_event, &mut batch.queries.events) {
                events.drain(..).for_each(|event| on_event(Event::RayQuery(event)));
            }
            match stop {
                Stop::Done => return,
                Stop::Barrier { mask } => {
                    running = running & batch.live();
                    let in_call = !batch.frames().is_empty();
                    if in_call && running != mask {
                        // Invocations inside a call cannot wait for those outside of it.
                        batch.trap(mask, TrapCode::BarrierDivergence, batch.stopped_at());
                    } else {
                        add_waiting(
                            &mut self.waiting,
                            WaitingLanes { block: batch.block, op: batch.op, mask },
                        );
                        running = running.without(mask);
                        if in_call || running.is_empty() {
                            return;
                        }
                    }
                    batch.mask = Mask::NONE;
                    if !batch.follow([]) {
                        return;
                    }
                    batch.op = program.blocks[batch.block.index()].first;
                }
                Stop::Paused => {}
                Stop::TraceRay { .. }
                | Stop::ExecuteCallable { .. }
                | Stop::ReportIntersection { .. }
                | Stop::HitObjectTrace { .. }
                | Stop::HitObjectExecute { .. }
                | Stop::HitObjectRecordHandle { .. } => {
                    unreachable!("bug in anyhit: a compute shader asks for a ray-tracing pipeline")
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
