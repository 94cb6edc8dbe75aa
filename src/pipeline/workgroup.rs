//! Runs workgroups: batches of lanes run until each lane has ended or waits at a barrier, and again
//! behind the barrier.
//!
//! A workgroup larger than a batch is spread over several; several small ones share a batch. At a
//! barrier it counts that every invocation of a workgroup has come to the same instruction, not
//! which batch it was in: so neither what a workgroup does nor how it fails depends on the width.

use std::ops::Range;
use std::sync::Arc;

use smallvec::SmallVec;

use crate::error::Error;
use crate::interp;
use crate::machine::{
    Batch, Bindings, Exit, Invocation, Mask, Observer, Stop, TaskWatch, Trap, TrapCode, Workgroup,
};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::op::Op;
use crate::pipeline::compute::Compute;
use crate::pipeline::group::Shader;
use crate::pipeline::launch::Stats;
use crate::pipeline::observer::Event;
use crate::pipeline::trapped::{Trapped, limit_note, source_line, trap_error};
use crate::program::{Program, Terminator, WorkgroupLayout};

/// Lanes of a batch that wait behind a barrier.
#[derive(Clone, Copy, Debug)]
struct Waiting<const W: usize> {
    block: u32,
    /// The operation behind the barrier.
    op: u32,
    mask: Mask<W>,
}

/// A batch with its lanes that wait.
#[derive(Debug)]
struct Member<const W: usize> {
    batch: Batch<W>,
    waiting: SmallVec<[Waiting<W>; 1]>,
}

/// The observers of running workgroups.
pub(super) struct Observers<'a, O> {
    observer: O,
    on_event: Option<&'a mut dyn FnMut(Event)>,
}

impl Observers<'_, ()> {
    pub fn none() -> Self {
        Self { observer: (), on_event: None }
    }
}

impl<'a, O> Observers<'a, O> {
    pub fn of_operations(observer: O) -> Self {
        Self { observer, on_event: None }
    }

    pub fn new(observer: O, on_event: &'a mut dyn FnMut(Event)) -> Self {
        Self { observer, on_event: Some(on_event) }
    }
}

/// Runs workgroups, as many at a time as fill a batch.
pub(super) struct Gang<'a, const W: usize> {
    compute: &'a Compute,
    program: &'a Program,
    bindings: &'a Bindings,
    members: Vec<Member<W>>,
    /// Workgroups that run together.
    together: usize,
    each: usize,
    layout: WorkgroupLayout,
    stats: Stats,
    trapped: Option<Trapped>,
    watch: Arc<TaskWatch>,
}

impl<'a, const W: usize> Gang<'a, W>
where
    LaneKernel: Width<W>,
{
    pub fn new(
        compute: &'a Compute,
        bindings: &'a Bindings,
        layout: WorkgroupLayout,
        watch: &Arc<TaskWatch>,
    ) -> Self {
        let program = &*compute.program;
        let each = layout.size.iter().product::<u32>() as usize;
        // A call returns when all lanes of its batch have: workgroups that wait for themselves in
        // one must not share a batch.
        let calls = program.blocks.iter().any(|block| matches!(block.terminator, Terminator::Call { .. }));
        let waits = program.ops.iter().any(|op| matches!(op, Op::Barrier));
        let together = if calls && waits { 1 } else { (W / each).max(1) };
        let members = (0..(each * together).div_ceil(W))
            .map(|_| {
                let mut batch = program.batch();
                batch.watch = Some(watch.clone());
                Member { batch, waiting: SmallVec::new() }
            })
            .collect();
        let (stats, trapped) = (Stats::default(), None);
        let watch = watch.clone();
        Self { compute, program, bindings, members, together, each, layout, stats, trapped, watch }
    }

    /// Runs workgroups; the trap of the first that has one.
    pub fn run<O: Observer<W>>(
        mut self,
        groups: &mut dyn Iterator<Item = Workgroup>,
        observers: &mut Observers<'_, O>,
    ) -> (Stats, Option<Trapped>) {
        for member in &mut self.members {
            member.batch.queries.events = observers.on_event.is_some().then(Vec::new);
        }
        let mut groups = groups.map(Arc::new).peekable();
        while groups.peek().is_some() {
            let together: Vec<_> = groups.by_ref().take(self.together).collect();
            let first = together[0].index().saturating_mul(self.each as u64);
            if self.watch.is_over() || self.watch.is_beyond(first) {
                break;
            }
            self.watch.begin_batch();
            self.begin(&together);
            while self.advance(&together, observers) {}
            let charged = self.members.iter_mut().map(|member| member.batch.take_charged());
            self.watch.charge(charged.sum());
            let used = (together.len() * self.each).div_ceil(W);
            let queries = self.members[..used].iter().map(|member| member.batch.queries.initialized);
            self.stats.ray_queries += queries.sum::<u64>();
        }
        (self.stats, self.trapped)
    }

    /// The positions of a workgroup's invocations among all lanes of the gang.
    fn positions(&self, group: usize) -> Range<usize> {
        group * self.each..(group + 1) * self.each
    }

    fn begin(&mut self, groups: &[Arc<Workgroup>]) {
        let used = groups.len() * self.each;
        for (at, member) in self.members.iter_mut().enumerate() {
            member.waiting.clear();
            let lanes = used.saturating_sub(at * W).min(W);
            for lane in 0..lanes {
                let position = at * W + lane;
                let group = &groups[position / self.each];
                let place = (position % self.each) as u32;
                let local_index = self.layout.index_of(place);
                let invocation = Invocation {
                    launch_id: group.global_id(local_index),
                    launch_size: std::array::from_fn(|axis| group.count[axis] * group.size[axis]),
                    subgroup_size: self.compute.subgroup_size,
                    workgroup: Some(group.clone()),
                    local_index,
                    place,
                    ..Invocation::default()
                };
                member.batch.invocations.set(lane, invocation);
            }
            if lanes == 0 {
                continue;
            }
            let mask = Mask::first(lanes);
            self.program.begin(&mut member.batch, mask, self.compute.fuel);
            self.watch.charge(u64::from(self.program.entry_cost()) * u64::from(mask.count()));
            member.waiting.push(Waiting { block: member.batch.block, op: member.batch.op, mask });
            self.stats.count(self.program.stage, mask.count());
        }
    }

    /// Runs every lane that waits until it ends or comes to a barrier; `false` when all have ended.
    fn advance<O: Observer<W>>(
        &mut self,
        groups: &[Arc<Workgroup>],
        observers: &mut Observers<'_, O>,
    ) -> bool {
        for member in &mut self.members {
            self.watch.look_at_clock();
            if self.watch.expired().is_some() {
                member.batch.look_soon();
            }
            for start in std::mem::take(&mut member.waiting) {
                member.run(start, self.program, self.bindings, observers);
            }
        }
        for (group, workgroup) in groups.iter().enumerate() {
            self.meet(group, workgroup);
        }
        self.members.iter().any(|member| !member.waiting.is_empty())
    }

    /// Decides at the barrier whether a workgroup goes on.
    fn meet(&mut self, group: usize, workgroup: &Workgroup) {
        let positions = self.positions(group);
        let traps = positions.clone().filter_map(|at| match self.members[at / W].batch.exits[at % W] {
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
            let waiting = &self.members[at / W].waiting;
            waiting.iter().find(|waiting| waiting.mask.contains(at % W)).map(|waiting| waiting.op)
        };
        let Some(first) = positions.clone().find(|&at| barrier(at).is_some()) else { return };
        let Some(other) = positions.clone().find(|&at| barrier(at) != barrier(first)) else { return };
        let [x, y, z] = workgroup.local_id(self.layout.index_of((other - positions.start) as u32));
        let note = match barrier(other) {
            None => format!("local invocation ({x}, {y}, {z}) has ended without it"),
            Some(op) => {
                let line = source_line(self.program, op - 1);
                format!("local invocation ({x}, {y}, {z}) waits at another barrier{line}")
            }
        };
        let op = barrier(first).map_or(0, |op| op - 1);
        self.report(first, Trap { code: TrapCode::BarrierDivergence, op }, workgroup, Some(note));
        self.end(positions);
    }

    /// Ends all invocations of a workgroup.
    fn end(&mut self, positions: Range<usize>) {
        for at in positions {
            let member = &mut self.members[at / W];
            member.batch.exit(Mask::lane(at % W), Exit::Returned);
            for waiting in &mut member.waiting {
                waiting.mask = waiting.mask.without(Mask::lane(at % W));
            }
            member.waiting.retain(|waiting| !waiting.mask.is_empty());
        }
    }

    /// Keeps the report of a trap, if it is the first.
    fn report(&mut self, at: usize, trap: Trap, workgroup: &Workgroup, note: Option<String>) {
        if self.trapped.is_some() {
            return;
        }
        let batch = &self.members[at / W].batch;
        let (lane, invocations) = (at % W, &batch.invocations);
        let local = workgroup.local_id(invocations.local_index(lane));
        let ids = [workgroup.id, local, invocations.launch_id(lane)];
        let [group, local, global] = ids.map(|[x, y, z]| format!("({x}, {y}, {z})"));
        let mut error: Error = trap_error(self.program, batch, at % W, trap);
        if let Some(note) = note {
            error = error.note(note);
        }
        let (stage, name) = (self.program.stage.name(), &self.program.name);
        let limit = limit_note(trap.code, self.compute.fuel, Some(self.watch.watchdog()));
        error = limit.into_iter().fold(error, Error::note);
        error = error.note(format!(
            "in {stage} `{name}`, workgroup {group}, local invocation {local}, global invocation id {global}"
        ));
        let offset = self.program.origins.get(trap.op as usize).map_or(0, |origin| origin.offset);
        let (launch_id, code, fault_value) =
            (invocations.launch_id(lane), trap.code, batch.fault_value[lane]);
        self.trapped = Some(Trapped { launch_id, code, fault_value, shader: Shader(0), offset, error });
    }
}

impl<const W: usize> Member<W>
where
    LaneKernel: Width<W>,
{
    /// Runs lanes until each has ended or waits.
    fn run<O: Observer<W>>(
        &mut self,
        start: Waiting<W>,
        program: &Program,
        bindings: &Bindings,
        observers: &mut Observers<'_, O>,
    ) {
        let batch = &mut self.batch;
        (batch.block, batch.op, batch.mask) = (start.block, start.op, start.mask);
        let mut running = start.mask;
        loop {
            if O::active() {
                observers.observer.resumed(0, batch);
            }
            let stop = interp::run(batch, program, bindings, &mut observers.observer);
            if O::active() {
                observers.observer.stopped(0, batch);
            }
            if let (Some(on_event), Some(events)) = (&mut observers.on_event, &mut batch.queries.events) {
                events.drain(..).for_each(|event| on_event(Event::RayQuery(event)));
            }
            match stop {
                Stop::Done => return,
                Stop::Barrier { mask } => {
                    running = running & batch.live();
                    let calling = !batch.frames().is_empty();
                    if calling && running != mask {
                        // Invocations in the call cannot wait for those outside of it.
                        batch.trap(mask, TrapCode::BarrierDivergence, batch.op - 1);
                    } else {
                        wait(&mut self.waiting, Waiting { block: batch.block, op: batch.op, mask });
                        running = running.without(mask);
                        if calling || running.is_empty() {
                            return;
                        }
                    }
                    batch.mask = Mask::NONE;
                    if !batch.follow([]) {
                        return;
                    }
                    batch.op = program.blocks[batch.block as usize].first;
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

/// Adds lanes to those that wait behind the same barrier.
fn wait<const W: usize>(waiting: &mut SmallVec<[Waiting<W>; 1]>, new: Waiting<W>) {
    match waiting.iter_mut().find(|known| known.op == new.op) {
        Some(known) => known.mask = known.mask | new.mask,
        None => waiting.push(new),
    }
}
