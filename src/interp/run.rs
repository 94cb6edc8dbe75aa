//! The loop.

use crate::machine::{Batch, Bindings, Lanes, Mask, Observer, Stop, TrapCode};
use crate::ops::op::Op;
use crate::ops::row::{Row, Width};
use crate::program::{Program, Terminator};

/// Runs a batch until it stops.
pub fn run<const W: usize, O: Observer<W>>(
    batch: &mut Batch<W>,
    program: &Program,
    bindings: &Bindings,
    observer: &mut O,
) -> Stop<W>
where
    Row: Width<W>,
{
    loop {
        let block = &program.blocks[batch.block as usize];
        while batch.op < block.end {
            if O::ACTIVE && observer.before(batch, batch.op) {
                return Stop::Paused;
            }
            let op = &program.ops[batch.op as usize];
            if let Op::Stop(stop) = op {
                let stop = stop.stop(batch);
                batch.op += 1;
                return stop;
            }
            op.eval(batch, bindings);
            if batch.mask.is_empty() {
                break;
            }
            batch.op += 1;
        }
        if !leave(batch, program, &block.terminator) {
            return Stop::Done;
        }
    }
}

/// Leaves a block; `false` when nothing is left to run.
fn leave<const W: usize>(batch: &mut Batch<W>, program: &Program, terminator: &Terminator) -> bool {
    let mask = batch.mask;
    let from = batch.block;
    let going = if mask.is_empty() {
        batch.follow([])
    } else {
        match terminator {
            Terminator::Branch(target) => {
                charge(batch, program, from, *target);
                batch.jump(*target)
            }
            Terminator::BranchConditional { condition, then, other } => {
                let taken = Mask::of(&batch.registers[*condition]) & mask;
                if taken == mask {
                    charge(batch, program, from, *then);
                    batch.jump(*then)
                } else if taken.is_empty() {
                    charge(batch, program, from, *other);
                    batch.jump(*other)
                } else {
                    batch.follow([(*then, taken), (*other, mask.without(taken))])
                }
            }
            Terminator::Switch { selector, wide, cases, default } => {
                let low = batch.registers[*selector];
                let high = if *wide { batch.registers[selector.plus(1)] } else { Lanes::splat(0) };
                let target = |lane: usize| {
                    let value = u64::from(low.0[lane]) | u64::from(high.0[lane]) << 32;
                    cases.iter().find(|case| case.0 == value).map_or(*default, |case| case.1)
                };
                let edges: Vec<_> = mask.lanes().map(|lane| (target(lane), Mask::lane(lane))).collect();
                batch.follow(edges)
            }
            Terminator::Call { function, return_to } => {
                batch.spend(program.blocks.len() as u32, block_end(program, from));
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
                batch.trap(mask, TrapCode::Unreachable, block_end(program, from));
                batch.follow([])
            }
        }
    };
    if going {
        batch.op = program.blocks[batch.block as usize].first;
    }
    going
}

/// Spends the budget at a back edge: as much as the loop has operations.
fn charge<const W: usize>(batch: &mut Batch<W>, program: &Program, from: u32, to: u32) {
    if to <= from {
        let end = block_end(program, from);
        let cost = end - program.blocks[to as usize].first + 1;
        batch.spend(cost, end.saturating_sub(1));
    }
}

fn block_end(program: &Program, block: u32) -> u32 {
    program.blocks[block as usize].end
}
