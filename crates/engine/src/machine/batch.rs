//! A batch: up to W invocations of one entry point, and the block in which each of them is.
//!
//! Lanes diverge at branches: the batch always runs the lowest block in which a lane waits. As a
//! program's blocks are in structured order (a merge block after everything that it merges, a
//! loop's merge after the loop), lanes reconverge at the merge block, and no stack of masks is
//! needed.

use std::sync::Arc;

use crate::machine::hit_object::HitObjects;
use crate::machine::index::{BlockIndex, OpIndex};
use crate::machine::invocation::Invocations;
use crate::machine::lanes::{Mask, Reg, Registers};
use crate::machine::out_of_bounds::OutOfBoundsIndices;
use crate::machine::ray_query::RayQueries;
use crate::machine::trap::{AccessFault, Exit, LaneTrap, TrapCode};
use crate::machine::turns::Turns;
use crate::machine::watchdog::{SLICE, TaskWatch};

/// Turns of loops are noted while a lane has no more fuel than this, for the report.
const LAST_FUEL: u64 = 1 << 16;

/// Lanes that wait at the beginning of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Waiting<const W: usize> {
    block: BlockIndex,
    mask: Mask<W>,
}

/// A call in progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<const W: usize> {
    /// The block that runs when every lane has returned.
    pub return_to: BlockIndex,
    /// The lanes that called.
    pub mask: Mask<W>,
    /// The number of entries of the waiting list that belong to callers.
    base: usize,
}

/// Up to W invocations of one entry point; plain data, so that a copy is a checkpoint.
#[derive(Clone, Debug)]
pub struct Batch<const W: usize> {
    /// The register file.
    pub registers: Registers<W>,
    /// The state that builtins read.
    pub invocations: Box<Invocations<W>>,
    /// The lanes that run now.
    pub mask: Mask<W>,
    /// The operation that runs next.
    pub op: OpIndex,
    /// The block that runs now.
    pub block: BlockIndex,
    /// Whether an observer paused the batch before the operation or terminator that runs next.
    pub paused: bool,
    /// Whether traps of the operation that runs are suppressed, as the optimizer eliminates it; see
    /// [`Program::silent`](crate::program::Program::silent).
    pub silent: bool,
    /// How each lane ended, meaningful once it has.
    pub exits: [Exit; W],
    /// The byte offset or device address of the access at which a lane trapped; for a trace, the
    /// rule that its ray breaks; 0 where the trap has no such value. Meaningful once the lane has
    /// trapped.
    pub fault_value: [u64; W],
    /// The indices that were outside their arrays, whether or not an access through them follows.
    pub out_of_bounds_indices: OutOfBoundsIndices<W>,
    /// The ray queries that variables hold.
    pub queries: RayQueries,
    /// The hit objects that variables hold.
    pub hit_objects: HitObjects,
    /// The number of reorder instructions that were executed, summed over lanes.
    pub reorders: u64,
    /// What ends the launch that it belongs to, where it belongs to one.
    pub watch: Option<Arc<TaskWatch>>,
    /// The registers of loops' variables, which [`Batch::turns`] notes.
    pub watched: Arc<[Reg]>,
    /// The last turns of loops, of lanes that have little fuel left.
    pub turns: Turns,
    /// Details of accesses that trapped, with their lanes; see [`Batch::access_fault`].
    access_faults: Vec<(usize, AccessFault)>,
    /// The lanes that have not been stopped.
    live: Mask<W>,
    /// The lanes that have trapped.
    trapped: Mask<W>,
    /// The fuel of each lane, less what it has consumed without the others. Fuel is consumed at
    /// back edges and calls.
    fuel: [u64; W],
    /// The fuel that every live lane has consumed together with all others.
    consumed_together: u64,
    /// A lower bound of the live lanes' `fuel`, and how much a lane may consume before
    /// [`Batch::consume_last_fuel`] is called.
    min_fuel: u64,
    /// Instructions charged to all lanes and not yet to the launch, but for what live lanes have
    /// consumed together since `settled`.
    charged: u64,
    /// What of `consumed_together` is in `charged`.
    settled: u64,
    /// Lanes that wait at later blocks, the lowest block last.
    waiting: Vec<Waiting<W>>,
    frames: Vec<Frame<W>>,
}

impl<const W: usize> Batch<W> {
    /// A batch whose registers are the given file (constants filled in, the rest zero).
    pub fn new(registers: Registers<W>) -> Self {
        Self {
            registers,
            invocations: Box::default(),
            mask: Mask::NONE,
            op: OpIndex(0),
            block: BlockIndex(0),
            paused: false,
            silent: false,
            exits: [Exit::Returned; W],
            fault_value: [0; W],
            access_faults: Vec::new(),
            out_of_bounds_indices: OutOfBoundsIndices::default(),
            queries: RayQueries::default(),
            hit_objects: HitObjects::default(),
            reorders: 0,
            watch: None,
            watched: Arc::default(),
            turns: Turns::default(),
            live: Mask::NONE,
            trapped: Mask::NONE,
            fuel: [0; W],
            consumed_together: 0,
            min_fuel: 0,
            charged: 0,
            settled: 0,
            waiting: Vec::new(),
            frames: Vec::new(),
        }
    }

    /// Puts the lanes of a mask at the beginning of a block, each with its fuel, counted in
    /// instructions.
    pub fn begin(&mut self, mask: Mask<W>, block: BlockIndex, op: OpIndex, fuel: u64) {
        self.mask = mask;
        self.live = mask;
        self.trapped = Mask::NONE;
        self.block = block;
        self.op = op;
        self.paused = false;
        self.silent = false;
        self.fault_value = [0; W];
        self.access_faults.clear();
        self.out_of_bounds_indices.clear();
        self.exits = [Exit::Returned; W];
        self.fuel = [fuel; W];
        self.consumed_together = 0;
        self.min_fuel = slice(fuel);
        self.charged = 0;
        self.settled = 0;
        self.turns.clear();
        self.waiting.clear();
        self.frames.clear();
        self.queries.clear();
        self.hit_objects.clear();
        self.reorders = 0;
    }

    /// The lanes that have not ended.
    pub fn live(&self) -> Mask<W> {
        self.live
    }

    /// The lanes that have trapped.
    #[inline]
    pub fn trapped(&self) -> Mask<W> {
        self.trapped
    }

    /// The calls in progress, the outermost first.
    pub fn frames(&self) -> &[Frame<W>] {
        &self.frames
    }

    /// The block at the begin of which a lane waits for others; `None` for one that does not.
    pub fn waits_at(&self, lane: usize) -> Option<BlockIndex> {
        self.waiting.iter().find(|waiting| waiting.mask.contains(lane)).map(|waiting| waiting.block)
    }

    /// The operation at which the batch stopped: the one before that which runs next.
    pub fn stopped_at(&self) -> OpIndex {
        self.op.previous().unwrap_or_default()
    }

    /// Lets the running lanes go on at the given blocks and chooses the block that runs next.
    ///
    /// The edges must have disjoint masks; all running lanes that are on no edge have returned from
    /// the running function. `false` when nothing is left to run.
    #[inline]
    pub fn follow(&mut self, edges: impl IntoIterator<Item = (BlockIndex, Mask<W>)>) -> bool {
        for (block, mask) in edges {
            if !mask.is_empty() {
                self.wait(block, mask);
            }
        }
        self.next()
    }

    /// The common case of [`Batch::follow`]: all running lanes go on at one block.
    #[inline]
    pub fn jump(&mut self, block: BlockIndex) -> bool {
        let base = self.frames.last().map_or(0, |frame| frame.base);
        if self.waiting[base..].last().is_none_or(|lowest| block < lowest.block) && !self.mask.is_empty() {
            self.block = block;
            return true;
        }
        let mask = self.mask;
        self.follow([(block, mask)])
    }

    /// Calls a function: its first block runs next, and `return_to` when every lane has returned.
    pub fn call(&mut self, block: BlockIndex, return_to: BlockIndex) {
        self.frames.push(Frame { return_to, mask: self.mask, base: self.waiting.len() });
        self.block = block;
    }

    /// Ends lanes.
    pub fn exit(&mut self, mask: Mask<W>, exit: Exit) {
        for lane in mask.lanes() {
            self.exits[lane] = exit;
        }
        self.trapped = match exit {
            Exit::Trapped(_) => self.trapped | mask,
            _ => self.trapped.without(mask),
        };
        self.settle();
        self.live = self.live.without(mask);
        self.mask = self.mask.without(mask);
    }

    /// Stops lanes that misbehaved at an operation.
    #[cold]
    pub fn trap(&mut self, mask: Mask<W>, code: TrapCode, op: OpIndex) {
        if self.silent {
            return;
        }
        self.exit(mask & self.mask, Exit::Trapped(LaneTrap { code, op }));
    }

    /// Records the details of an access at which a lane traps, as its registers may change later.
    #[cold]
    pub fn record_access_fault(&mut self, lane: usize, fault: AccessFault) {
        if !self.silent {
            self.access_faults.push((lane, fault));
        }
    }

    /// The details of the access at which a lane trapped.
    pub fn access_fault(&self, lane: usize) -> Option<&AccessFault> {
        self.access_faults.iter().find(|(of, _)| *of == lane).map(|(_, fault)| fault)
    }

    /// Consumes fuel of lanes; those that have too little are stopped.
    #[inline]
    pub fn consume_fuel(&mut self, mask: Mask<W>, cost: u32, op: OpIndex) {
        let cost = u64::from(cost);
        if self.min_fuel - self.consumed_together < cost {
            self.consume_last_fuel(mask, cost, op);
        } else if mask == self.live {
            self.consumed_together += cost;
        } else {
            mask.lanes().for_each(|lane| self.fuel[lane] -= cost);
            self.min_fuel -= cost;
            self.charged += cost * u64::from(mask.count());
        }
    }

    /// Adds to what is charged what live lanes have consumed together.
    fn settle(&mut self) {
        self.charged += (self.consumed_together - self.settled) * u64::from(self.live.count());
        self.settled = self.consumed_together;
    }

    /// Takes the instructions charged to all lanes since the last time.
    pub fn take_charged(&mut self) -> u64 {
        self.settle();
        std::mem::take(&mut self.charged)
    }

    /// Lets the next charge look at the watchdog.
    pub fn look_soon(&mut self) {
        self.min_fuel = self.consumed_together;
    }

    /// Does what [`Batch::consume_fuel`] does where the fuel of some lane may not cover the cost,
    /// or where it is time to look at the watchdog.
    #[cold]
    fn consume_last_fuel(&mut self, mask: Mask<W>, cost: u64, op: OpIndex) {
        self.settle();
        self.charged += cost * u64::from(mask.count());
        let watch = self.watch.clone();
        let expired = watch.as_ref().and_then(|watch| {
            watch.charge(std::mem::take(&mut self.charged));
            watch.look_at_clock();
            watch.expired()
        });
        let mut noted: Mask<W> = Mask::NONE;
        let exhausted = Mask::from_fn(|lane| {
            let left = self.fuel[lane].saturating_sub(self.consumed_together);
            let charge = if mask.contains(lane) { cost } else { 0 };
            if charge > 0 && (left <= LAST_FUEL || expired.is_some()) {
                noted = noted | Mask::lane(lane);
            }
            self.fuel[lane] = left.saturating_sub(charge);
            left < charge
        });
        self.consumed_together = 0;
        self.settled = 0;
        let over = watch.as_ref().and_then(|watch| watch.step_behind());
        for lane in noted.lanes() {
            let is_last = over.is_some() || exhausted.contains(lane);
            self.turns.note(lane, op, is_last, &self.registers, &self.watched);
        }
        self.trap(exhausted, TrapCode::OutOfFuel, op);
        if let Some(watch) = &watch {
            let stopped = exhausted.lanes().map(|lane| self.invocations.number(lane)).min();
            stopped.into_iter().for_each(|number| watch.watchdog().stop_at(number));
            if let Some(code) = over {
                self.stop(code, op);
            }
            let beyond =
                |lane: usize| self.live.contains(lane) && watch.is_beyond(self.invocations.number(lane));
            let beyond = Mask::from_fn(beyond);
            if !beyond.is_empty() {
                self.exit(beyond, Exit::Trapped(LaneTrap { code: TrapCode::Callee, op }));
            }
        }
        self.min_fuel = match expired {
            Some(_) => 0,
            None => self.live.lanes().map(|lane| slice(self.fuel[lane])).min().unwrap_or(0),
        };
    }

    /// Stops all lanes: the running ones trap, the others end without a word.
    fn stop(&mut self, code: TrapCode, op: OpIndex) {
        let others = self.live.without(self.mask);
        self.exit(others, Exit::Trapped(LaneTrap { code: TrapCode::Callee, op }));
        self.trap(self.mask, code, op);
    }

    fn wait(&mut self, block: BlockIndex, mask: Mask<W>) {
        let base = self.frames.last().map_or(0, |frame| frame.base);
        let mut at = self.waiting.len();
        while at > base && self.waiting[at - 1].block < block {
            at -= 1;
        }
        if at > base && self.waiting[at - 1].block == block {
            self.waiting[at - 1].mask = self.waiting[at - 1].mask | mask;
        } else {
            self.waiting.insert(at, Waiting { block, mask });
        }
    }

    fn next(&mut self) -> bool {
        loop {
            let base = self.frames.last().map_or(0, |frame| frame.base);
            if self.waiting.len() > base {
                let next = self.waiting.pop().expect("bug in anyhit: the waiting list is empty");
                self.block = next.block;
                self.mask = next.mask & self.live;
            } else if let Some(frame) = self.frames.pop() {
                self.block = frame.return_to;
                self.mask = frame.mask & self.live;
                // The caller's own waiting lanes may stand before the block returned to.
                let mask = self.mask;
                if !mask.is_empty() {
                    self.wait(frame.return_to, mask);
                }
                continue;
            } else {
                self.mask = Mask::NONE;
                return false;
            }
            if !self.mask.is_empty() {
                return true;
            }
        }
    }
}

/// What a lane with so much fuel may consume before the watchdog is asked, and turns are noted.
#[inline]
fn slice(fuel: u64) -> u64 {
    fuel.saturating_sub(LAST_FUEL).min(SLICE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batch() -> Batch<4> {
        let mut batch = Batch::new(Registers::new(1));
        batch.begin(Mask::ALL, BlockIndex(0), OpIndex(0), 10);
        batch
    }

    #[test]
    fn lanes_reconverge_at_the_merge_block() {
        let mut batch = batch();
        assert!(batch.follow([(BlockIndex(1), Mask::first(1)), (BlockIndex(2), !Mask::first(1))]));
        assert_eq!((batch.block, batch.mask.count()), (BlockIndex(1), 1));
        assert!(batch.jump(BlockIndex(3)));
        assert_eq!((batch.block, batch.mask.count()), (BlockIndex(2), 3));
        assert!(batch.jump(BlockIndex(3)));
        assert_eq!((batch.block, batch.mask.count()), (BlockIndex(3), 4));
    }

    #[test]
    fn a_call_returns_when_every_lane_has() {
        let mut batch = batch();
        batch.call(BlockIndex(10), BlockIndex(1));
        assert!(batch.follow([(BlockIndex(11), Mask::first(2)), (BlockIndex(12), !Mask::first(2))]));
        assert_eq!(batch.block, BlockIndex(11));
        // The lanes in block 11 return.
        assert!(batch.follow([]));
        assert_eq!(batch.block, BlockIndex(12));
        batch.trap(Mask::lane(3), TrapCode::Unreachable, OpIndex(7));
        assert!(batch.follow([]));
        assert_eq!((batch.block, batch.mask.count()), (BlockIndex(1), 3));
        assert!(!batch.follow([]));
        assert_eq!(batch.exits[3], Exit::Trapped(LaneTrap { code: TrapCode::Unreachable, op: OpIndex(7) }));
        assert_eq!(batch.exits[0], Exit::Returned);
    }

    #[test]
    fn a_lane_without_fuel_is_stopped() {
        let mut batch = batch();
        batch.consume_fuel(Mask::ALL, 10, OpIndex(0));
        assert_eq!(batch.mask.count(), 4);
        batch.consume_fuel(Mask::first(3), 1, OpIndex(0));
        assert_eq!(batch.mask, Mask::lane(3));
    }
}
