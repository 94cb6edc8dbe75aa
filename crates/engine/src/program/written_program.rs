//! Programs that tests of the passes write by hand. Registers are numbers.

use std::sync::Arc;

use crate::machine::{BlockIndex, Exit, OpIndex, Reg};
use crate::module::Module;
use crate::ops::arithmetic::IAdd;
use crate::ops::memory::{BufferRef, Chunk, Length, MemoryOp};
use crate::ops::op::Op;
use crate::ops::translate::Origin;
use crate::program::{Block, OptimizedCode, Program, Terminator};

/// A program with these blocks: of each, its operations and its terminator. It has no constants,
/// variables, inputs or interface, and is not optimised.
pub(super) fn program(register_count: u32, blocks: Vec<(Vec<Op>, Terminator)>) -> Program {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../spirv-fixtures/bench/shadow.rmiss.spv");
    let module = Module::open(path).expect("a valid fixture");
    let mut program = Program::of(&module, "main").expect("a supported fixture");
    program.ops.clear();
    program.blocks.clear();
    for (ops, terminator) in blocks {
        let first = OpIndex::new(program.ops.len());
        program.ops.extend(ops);
        let end = OpIndex::new(program.ops.len());
        program.blocks.push(Block { first, end, terminator, instructions: 0 });
    }
    program.origins = vec![Origin { offset: 0, scope: 0 }; program.ops.len() + program.blocks.len()];
    program.register_count = register_count;
    program.optimized = OptimizedCode::default();
    program.watched = Arc::new([]);
    program.constants.clear();
    program.inputs.clear();
    program.interface.clear();
    program.variables.clear();
    program
}

/// A program of one block, which ends the invocation.
pub(super) fn one_block(register_count: u32, ops: Vec<Op>) -> Program {
    program(register_count, vec![(ops, EXIT)])
}

/// Ends the invocation.
pub(super) const EXIT: Terminator = Terminator::Exit(Exit::Returned);

/// Branches to a block.
pub(super) fn branch(to: u32) -> Terminator {
    Terminator::Branch(BlockIndex(to))
}

/// Branches to one of two blocks.
pub(super) fn branch_if(condition: u32, then: u32, other: u32) -> Terminator {
    Terminator::BranchConditional {
        condition: Reg(condition),
        then: BlockIndex(then),
        other: BlockIndex(other),
    }
}

/// Calls the function that begins at a block.
pub(super) fn call(function: u32, return_to: u32) -> Terminator {
    Terminator::Call { function: BlockIndex(function), return_to: BlockIndex(return_to) }
}

/// What stands for the third operand of a kernel that has two.
const UNUSED: Reg = Reg(0);

/// `to = a + b`, of 32 bits: a regular operation.
pub(super) fn add(to: u32, a: u32, b: u32) -> Op {
    add_of(32, to, a, b)
}

/// `to = a + b`, of 64 bits: operands and result are two registers each.
pub(super) fn add_pairs(to: u32, a: u32, b: u32) -> Op {
    add_of(64, to, a, b)
}

fn add_of(width: u32, to: u32, a: u32, b: u32) -> Op {
    let kernel = IAdd.kernel(width).expect("a kernel of this width");
    Op::LaneKernel { kernel, to: Reg(to), from: [Reg(a), Reg(b), UNUSED] }
}

/// Copies a register in all lanes.
pub(super) fn copy(to: u32, from: u32) -> Op {
    Op::Memory(MemoryOp::Move { to: Reg(to), from: Reg(from) })
}

/// Copies a register in the running lanes: a store to a variable.
pub(super) fn store(to: u32, from: u32) -> Op {
    Op::Memory(MemoryOp::MoveMasked { to: Reg(to), from: Reg(from) })
}

/// `to = base + 4 * index`.
pub(super) fn index(to: u32, base: Option<u32>, index: u32) -> Op {
    Op::Memory(MemoryOp::Index {
        to: Reg(to),
        base: base.map(Reg),
        index: Reg(index),
        stride: 4,
        length: Length::Unknown,
    })
}

/// Loads registers from a buffer, at an offset that a register holds.
pub(super) fn load(to: u32, count: u32, index: u32) -> Op {
    Op::Memory(MemoryOp::BufferLoad { to: Reg(to), chunk: chunk(Some(index), count) })
}

/// Writes registers to a buffer, at an offset that a register may hold: an effect.
pub(super) fn output(from: u32, count: u32, index: Option<u32>) -> Op {
    Op::Memory(MemoryOp::BufferStore { from: Reg(from), chunk: chunk(index, count) })
}

/// Scalars of the first buffer.
pub(super) fn chunk(index: Option<u32>, count: u32) -> Chunk {
    let index = index.map(Reg);
    Chunk { buffer: BufferRef::Handle(0), offset: 0, index, width: 32, count, alignment: 4 }
}
