//! The interpreter's loop: runs the operations of blocks and follows their terminators.

use smallvec::SmallVec;

use crate::machine::{Batch, Bindings, Lanes, Mask, Observer, Stop, TrapCode};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::op::Op;
use crate::program::{OptimizedCode, Program, Superblock, Terminator};

/// The instructions that count for one that hands the batch to the pipeline: a trace, a call, a
/// report, a barrier.
const STOP_COST: u32 = 64;

/// Runs a batch until it stops.
pub fn run<const W: usize, O: Observer<W>>(
    batch: &mut Batch<W>,
    program: &Program,
    bindings: &Bindings,
    observer: &mut O,
) -> Stop<W>
where
    LaneKernel: Width<W>,
{
    let OptimizedCode { ops, supercode, superblocks } = &program.optimized;
    let ops = if O::active() { &program.ops } else { ops };
    let supercode = supercode.as_ref().filter(|_| !O::active() && LaneKernel::has_superops(&batch.registers));
    loop {
        let block = &program.blocks[batch.block as usize];
        // After a stop a block continues, it is not entered.
        if O::active() && batch.op == block.first && !batch.paused {
            observer.block(batch);
        }
        // Without an observer, blocks that follow each other form a superblock.
        let superblock = if O::active() {
            Superblock { end: block.end, last: batch.block }
        } else {
            superblocks[batch.block as usize]
        };
        while batch.op < superblock.end {
            if O::active() && !std::mem::take(&mut batch.paused) && observer.before(batch, batch.op) {
                batch.paused = true;
                return Stop::Paused;
            }
            if let Some(supercode) = supercode {
                batch.op = LaneKernel::run_superops(
                    &mut batch.registers,
                    supercode,
                    ops,
                    batch.op..superblock.end,
                    batch.mask,
                );
                if batch.op == superblock.end {
                    break;
                }
            }
            let op = &ops[batch.op as usize];
            if let Op::LaneKernel { kernel, to, from } = op {
                // Most operations are kernels, and those never stop.
                Width::<W>::run(*kernel, &mut batch.registers, *to, from);
                if O::active() {
                    observer.after(batch, bindings, batch.op);
                }
                batch.op += 1;
                continue;
            }
            if let Op::Stop(_) | Op::Barrier = op {
                batch.spend(batch.mask, STOP_COST, batch.op);
                if batch.mask.is_empty() {
                    break;
                }
                let stop = match op {
                    Op::Stop(stop) => stop.stop(batch),
                    _ => Stop::Barrier { mask: batch.mask },
                };
                batch.op += 1;
                return stop;
            }
            batch.silent = program.silent.get(batch.op as usize) == Some(&true);
            op.eval(batch, bindings);
            // Traps at the block's end, or by the pipeline, are not of such an operation.
            batch.silent = false;
            if batch.mask.is_empty() {
                break;
            }
            if O::active() {
                observer.after(batch, bindings, batch.op);
            }
            batch.op += 1;
        }
        batch.block = superblock.last;
        if !leave(batch, program, &program.blocks[superblock.last as usize].terminator, observer) {
            return Stop::Done;
        }
    }
}

/// Leaves a block; `false` when nothing is left to run.
fn leave<const W: usize, O: Observer<W>>(
    batch: &mut Batch<W>,
    program: &Program,
    end: &Terminator,
    observer: &mut O,
) -> bool {
    let mask = batch.mask;
    let from = batch.block;
    let going = if mask.is_empty() {
        batch.follow([])
    } else {
        match end {
            Terminator::Branch(target) => go(batch, program, *target),
            Terminator::BranchConditional { condition, then, other } => {
                let taken = batch.registers.mask(*condition) & mask;
                if O::active() {
                    observer.edge(from, 0, taken.count());
                    observer.edge(from, 1, mask.without(taken).count());
                }
                if taken == mask {
                    go(batch, program, *then)
                } else if taken.is_empty() {
                    go(batch, program, *other)
                } else {
                    split(batch, program, &[(*then, taken), (*other, mask.without(taken))])
                }
            }
            Terminator::Switch { selector, wide, cases, default } => {
                let low = batch.registers[*selector];
                let high = if *wide { batch.registers[selector.plus(1)] } else { Lanes::splat(0) };
                let mut edges: SmallVec<[(u32, Mask<W>); 4]> = SmallVec::new();
                for lane in mask.lanes() {
                    let value = u64::from(low.0[lane]) | u64::from(high.0[lane]) << 32;
                    let case = cases.iter().position(|case| case.0 == value);
                    let target = case.map_or(*default, |case| cases[case].1);
                    if O::active() {
                        observer.edge(from, case.unwrap_or(cases.len()) as u32, 1);
                    }
                    match edges.iter_mut().find(|edge| edge.0 == target) {
                        Some(edge) => edge.1 = edge.1 | Mask::lane(lane),
                        None => edges.push((target, Mask::lane(lane))),
                    }
                }
                split(batch, program, &edges)
            }
            Terminator::Call { function, return_to } => {
                batch.spend(mask, program.call_cost(*function), terminator(program, from));
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
                batch.trap(mask, TrapCode::Unreachable, terminator(program, from));
                batch.follow([])
            }
        }
    };
    if going {
        batch.op = program.blocks[batch.block as usize].first;
    }
    going
}

/// All running lanes continue at one block.
fn go<const W: usize>(batch: &mut Batch<W>, program: &Program, target: u32) -> bool {
    charge(batch, program, target, batch.mask);
    batch.jump(target)
}

/// The running lanes continue at several blocks.
fn split<const W: usize>(batch: &mut Batch<W>, program: &Program, edges: &[(u32, Mask<W>)]) -> bool {
    for &(target, mask) in edges {
        charge(batch, program, target, mask);
    }
    let live = batch.mask;
    batch.follow(edges.iter().map(|&(target, mask)| (target, mask & live)))
}

/// Consumes fuel of lanes at a back edge: as much as the loop has instructions, so that a lane's
/// limit depends neither on its neighbours nor on the width of its batch nor on the optimizer.
fn charge<const W: usize>(batch: &mut Batch<W>, program: &Program, to: u32, mask: Mask<W>) {
    if to <= batch.block {
        let before = to.checked_sub(1).map_or(0, |before| program.blocks[before as usize].instructions);
        let cost = program.blocks[batch.block as usize].instructions - before;
        batch.spend(mask, cost.max(1), terminator(program, batch.block));
    }
}

/// The index of the origin of a block's terminator, for the traps that it raises.
fn terminator(program: &Program, block: u32) -> u32 {
    program.ops.len() as u32 + block
}
