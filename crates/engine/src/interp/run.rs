//! The interpreter's loop: runs the operations of blocks and follows their terminators.

use smallvec::SmallVec;

use crate::interp::superop;
use crate::machine::{
    Batch, Bindings, BlockIndex, Lanes, Mask, Observer, OpIndex, ShaderIndex, Stop, TrapCode,
};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::op::Op;
use crate::program::{OptimizedCode, Program, Superblock, Terminator};

/// The instructions that count for one that hands the batch to the pipeline: a trace, a call, a
/// report, a barrier.
const STOP_COST: u32 = 64;

/// Runs a batch of one lane, of the only shader, until it stops, under an observer if there is one.
pub fn run_lane(
    batch: &mut Batch<1>,
    program: &Program,
    bindings: &Bindings,
    observer: Option<&mut dyn Observer<1>>,
) -> Stop<1> {
    match observer {
        Some(mut observer) => run_shader(ShaderIndex(0), batch, program, bindings, &mut observer),
        None => run(batch, program, bindings, &mut ()),
    }
}

/// As [`run`], for a shader of a pipeline: reports to the observer that its batch begins to run, or
/// goes on, and that it stopped.
pub fn run_shader<const W: usize, O: Observer<W>>(
    shader: ShaderIndex,
    batch: &mut Batch<W>,
    program: &Program,
    bindings: &Bindings,
    observer: &mut O,
) -> Stop<W>
where
    LaneKernel: Width<W>,
{
    match batch.paused {
        true => observer.continued(shader, batch),
        false => observer.resumed(shader, batch),
    }
    let stop = run(batch, program, bindings, observer);
    if stop != Stop::Paused {
        observer.stopped(shader, batch);
    }
    stop
}

/// Runs a batch until it stops. As a generic function, it is compiled in the crate that calls it:
/// other crates than this one call [`run_lane`].
pub fn run<const W: usize, O: Observer<W>>(
    batch: &mut Batch<W>,
    program: &Program,
    bindings: &Bindings,
    observer: &mut O,
) -> Stop<W>
where
    LaneKernel: Width<W>,
{
    let OptimizedCode { ops, supercode, superblocks, .. } = &program.optimized;
    let ops = if O::is_active() { &program.ops } else { ops };
    let supercode =
        supercode.as_ref().filter(|_| !O::is_active() && LaneKernel::has_superops(&batch.registers));
    loop {
        let block = &program.blocks[batch.block.index()];
        // After a stop the block is continued, not entered again.
        if O::is_active() && batch.op == block.first && !batch.paused {
            observer.block(batch);
        }
        // Without an observer, blocks that follow each other form a superblock.
        let superblock = if O::is_active() {
            Superblock { end: block.end, last: batch.block }
        } else {
            superblocks[batch.block.index()]
        };
        while batch.op < superblock.end {
            if O::is_active() && !std::mem::take(&mut batch.paused) && observer.before(batch, batch.op) {
                batch.paused = true;
                return Stop::Paused;
            }
            if let Some(supercode) = supercode
                && let Some((registers, mask)) = LaneKernel::as_64(&mut batch.registers, batch.mask)
            {
                let rest = batch.op.0..superblock.end.0;
                batch.op = OpIndex(superop::run(supercode, registers, ops, rest, mask));
                if batch.op == superblock.end {
                    break;
                }
            }
            let op = &ops[batch.op.index()];
            if let Op::LaneKernel { kernel, to, from } = op {
                // Most operations are kernels, which never stop.
                Width::<W>::run(*kernel, &mut batch.registers, *to, from);
                if O::is_active() {
                    observer.after(batch, bindings, batch.op);
                }
                batch.op = batch.op.plus(1);
                continue;
            }
            if let Op::Stop(_) | Op::Barrier = op {
                batch.consume_fuel(batch.mask, STOP_COST, batch.op);
                if batch.mask.is_empty() {
                    break;
                }
                let stop = match op {
                    Op::Stop(stop) => stop.stop(batch),
                    _ => Stop::Barrier { mask: batch.mask },
                };
                batch.op = batch.op.plus(1);
                return stop;
            }
            batch.silent = program.silent.get(batch.op.index()) == Some(&true);
            op.eval(batch, bindings);
            // Terminators and the pipeline, which may trap too, are never silent.
            batch.silent = false;
            if batch.mask.is_empty() {
                break;
            }
            if O::is_active() {
                observer.after(batch, bindings, batch.op);
            }
            batch.op = batch.op.plus(1);
        }
        batch.block = superblock.last;
        if O::is_active()
            && !batch.mask.is_empty()
            && !std::mem::take(&mut batch.paused)
            && observer.terminator(batch)
        {
            batch.paused = true;
            return Stop::Paused;
        }
        if !execute_terminator(batch, program, &program.blocks[superblock.last.index()].terminator, observer)
        {
            return Stop::Done;
        }
    }
}

/// Executes the terminator of a block; `false` when no lane is left to run.
fn execute_terminator<const W: usize, O: Observer<W>>(
    batch: &mut Batch<W>,
    program: &Program,
    terminator: &Terminator,
    observer: &mut O,
) -> bool {
    let mask = batch.mask;
    let from = batch.block;
    let continues = if mask.is_empty() {
        batch.follow([])
    } else {
        match terminator {
            Terminator::Branch(target) => branch_to(batch, program, *target),
            Terminator::BranchConditional { condition, then, other } => {
                let taken = batch.registers.mask(*condition) & mask;
                if O::is_active() {
                    observer.edge(from, 0, taken.count());
                    observer.edge(from, 1, mask.without(taken).count());
                }
                if taken == mask {
                    branch_to(batch, program, *then)
                } else if taken.is_empty() {
                    branch_to(batch, program, *other)
                } else {
                    diverge(batch, program, &[(*then, taken), (*other, mask.without(taken))])
                }
            }
            Terminator::Switch { selector, wide, cases, default } => {
                let low = batch.registers[*selector];
                let high = if *wide { batch.registers[selector.plus(1)] } else { Lanes::splat(0) };
                let mut edges: SmallVec<[(BlockIndex, Mask<W>); 4]> = SmallVec::new();
                for lane in mask.lanes() {
                    let value = u64::from(low.0[lane]) | u64::from(high.0[lane]) << 32;
                    let case = cases.iter().position(|case| case.0 == value);
                    let target = case.map_or(*default, |case| cases[case].1);
                    if O::is_active() {
                        observer.edge(from, case.unwrap_or(cases.len()) as u32, 1);
                    }
                    match edges.iter_mut().find(|edge| edge.0 == target) {
                        Some(edge) => edge.1 = edge.1 | Mask::lane(lane),
                        None => edges.push((target, Mask::lane(lane))),
                    }
                }
                diverge(batch, program, &edges)
            }
            Terminator::Call { function, return_to } => {
                batch.consume_fuel(mask, program.call_cost(*function), program.terminator_index(from));
                if batch.mask.is_empty() {
                    batch.follow([])
                } else {
                    batch.call(*function, *return_to);
                    true
                }
            }
            Terminator::Return => batch.follow([]),
            Terminator::Exit(exit) => {
                batch.exit(mask, *exit);
                batch.follow([])
            }
            Terminator::Unreachable => {
                batch.trap(mask, TrapCode::Unreachable, program.terminator_index(from));
                batch.follow([])
            }
        }
    };
    if continues {
        batch.op = program.blocks[batch.block.index()].first;
    }
    continues
}

/// Continues all running lanes at one block.
fn branch_to<const W: usize>(batch: &mut Batch<W>, program: &Program, target: BlockIndex) -> bool {
    consume_fuel(batch, program, target, batch.mask);
    batch.jump(target)
}

/// Continues the running lanes at several blocks: control flow diverges.
fn diverge<const W: usize>(batch: &mut Batch<W>, program: &Program, edges: &[(BlockIndex, Mask<W>)]) -> bool {
    for &(target, mask) in edges {
        consume_fuel(batch, program, target, mask);
    }
    let live = batch.mask;
    batch.follow(edges.iter().map(|&(target, mask)| (target, mask & live)))
}

/// Consumes fuel of lanes at a back edge: the number of instructions of the loop, so that a lane's
/// limit depends neither on other lanes, nor on the batch width, nor on the optimizer.
fn consume_fuel<const W: usize>(batch: &mut Batch<W>, program: &Program, to: BlockIndex, mask: Mask<W>) {
    if to <= batch.block {
        let before = to.previous().map_or(0, |before| program.blocks[before.index()].instructions);
        let cost = program.blocks[batch.block.index()].instructions - before;
        batch.consume_fuel(mask, cost.max(1), program.terminator_index(batch.block));
    }
}
