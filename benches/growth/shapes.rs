//! Modules of growing size, by the shape of what grows in them: loading and lowering.

use std::path::Path;
use std::sync::Arc;

use rspirv::spirv::{ExecutionModel, Op, StorageClass};

use anyhit_engine::{module, program};

use crate::curve::Curve;
use crate::measure::Work;
use crate::module_writer::Writer;

/// The curves of modules.
pub fn curves() -> Vec<Curve> {
    let sizes = [1 << 11, 1 << 13, 1 << 15, 1 << 17];
    let smaller = [1 << 9, 1 << 11, 1 << 13, 1 << 15];
    vec![
        shape("module: instructions in a line", sizes, straight),
        shape("module: functions", smaller, functions),
        shape("module: nested branches", [1 << 7, 1 << 9, 1 << 11, 1 << 13], branches),
        shape("module: branches in a row", smaller, guarded_blocks),
        shape("module: cases of a switch", [1 << 8, 1 << 10, 1 << 12, 1 << 14], switch),
        shape("module: loops", [1 << 7, 1 << 9, 1 << 11, 1 << 13], loops),
        shape("module: members of a composite", [900, 3_600, 14_400, 57_600], composite),
        shape("module: variables", smaller, variables),
        shape("module: access chains", smaller, chains),
        shape("module: constants", smaller, constants),
        shape("module: entry points", [1 << 4, 1 << 6, 1 << 8, 1 << 10], entry_points),
        Curve::linear(
            "smoke: blocks that are not entered",
            [1 << 7, 1 << 9, 1 << 11, 1 << 13],
            |folder, n| {
                std::fs::write(folder.join("m.spv"), guarded_blocks(n)).expect("a temporary file");
                Work::command(["smoke", "m.spv"])
            },
        ),
        Curve::linear("inspect: instructions", [1 << 10, 1 << 12, 1 << 14, 1 << 16], |folder, n| {
            std::fs::write(folder.join("m.spv"), straight(n)).expect("a temporary file");
            Work::command(["inspect", "m.spv"])
        }),
    ]
}

/// Loads a module and lowers all its entry points.
fn shape(name: &'static str, sizes: [usize; 4], write: fn(usize) -> Vec<u8>) -> Curve {
    Curve::linear(name, sizes, move |_: &Path, n| {
        let bytes = write(n);
        Work::call(move || {
            let module = Arc::new(module::load(&bytes).expect("a valid module"));
            for entry_point in &module.entry_points {
                let _ = program::lower(&module, entry_point).expect("a supported module");
            }
        })
    })
}

fn compute() -> Writer {
    Writer::new(ExecutionModel::GLCompute)
}

/// A sum of products in one block, of `n` instructions.
pub fn straight(n: usize) -> Vec<u8> {
    let mut it = compute();
    let zero = it.constant(0);
    let (x, uint) = (it.load_word(zero), it.uint);
    let mut sum = x;
    for at in 0..n {
        let op = [Op::IAdd, Op::IMul, Op::BitwiseXor][at % 3];
        sum = it.result(op, uint, &[sum, x]);
    }
    it.store_word(zero, sum);
    it.finish()
}

fn functions(n: usize) -> Vec<u8> {
    let mut it = compute();
    let (zero, uint) = (it.constant(0), it.uint);
    let ty = it.global(Op::TypeFunction, &[uint, uint]);
    let mut sum = it.load_word(zero);
    for at in 0..n as u32 {
        let number = it.constant(at + 2);
        let function = it.function(ty, uint, |it, x| it.result(Op::IMul, uint, &[x, number]));
        sum = it.result(Op::FunctionCall, uint, &[function, sum]);
    }
    it.store_word(zero, sum);
    it.finish()
}

/// `n` branches in each other, each of which stores.
fn branches(n: usize) -> Vec<u8> {
    let mut it = compute();
    let (zero, bool) = (it.constant(0), it.bool);
    let x = it.load_word(zero);
    let mut merges = Vec::new();
    for at in 0..n as u32 {
        let number = it.constant(at);
        let more = it.result(Op::UGreaterThan, bool, &[x, number]);
        merges.push(it.begin_if(more));
        it.store_word(zero, number);
    }
    merges.into_iter().rev().for_each(|merge| it.end_if(merge));
    it.finish()
}

/// `n` branches one behind the other, to blocks that are entered for one input each.
fn guarded_blocks(n: usize) -> Vec<u8> {
    let mut it = compute();
    let (zero, bool) = (it.constant(0), it.bool);
    let x = it.load_word(zero);
    for at in 0..n as u32 {
        let number = it.constant(0xABCD_0000 + at);
        let same = it.result(Op::IEqual, bool, &[x, number]);
        let merge = it.begin_if(same);
        it.store_word(zero, number);
        it.end_if(merge);
    }
    it.finish()
}

fn switch(n: usize) -> Vec<u8> {
    let mut it = compute();
    let zero = it.constant(0);
    let x = it.load_word(zero);
    let merge = it.fresh();
    let labels: Vec<u32> = (0..n).map(|_| it.fresh()).collect();
    it.op(Op::SelectionMerge, &[merge, 0]);
    let cases = labels.iter().enumerate().flat_map(|(at, &label)| [at as u32, label]);
    let operands: Vec<u32> = [x, merge].into_iter().chain(cases).collect();
    it.op(Op::Switch, &operands);
    for (at, label) in labels.into_iter().enumerate() {
        let number = it.constant(at as u32 * 3);
        it.op(Op::Label, &[label]);
        it.store_word(zero, number);
        it.op(Op::Branch, &[merge]);
    }
    it.op(Op::Label, &[merge]);
    it.finish()
}

fn loops(n: usize) -> Vec<u8> {
    let mut it = compute();
    let zero = it.constant(0);
    let count = it.load_word(zero);
    for _ in 0..n {
        it.repeat(count, |it, turn| it.store_word(turn, turn));
    }
    it.finish()
}

/// An array of `n` members that is constructed, and a constant one.
fn composite(n: usize) -> Vec<u8> {
    let mut it = compute();
    let (zero, uint) = (it.constant(0), it.uint);
    let (length, three) = (it.constant(n as u32), it.constant(3));
    let array = it.global(Op::TypeArray, &[uint, length]);
    let constant = it.global_of(Op::ConstantComposite, array, &vec![three; n]);
    let x = it.load_word(zero);
    let whole = it.result(Op::CompositeConstruct, array, &vec![x; n]);
    let changed = it.result(Op::CompositeInsert, array, &[x, constant, n as u32 / 2]);
    let last = n as u32 - 1;
    let parts = [whole, changed].map(|array| it.result(Op::CompositeExtract, uint, &[array, last]));
    let sum = it.result(Op::IAdd, uint, &parts);
    it.store_word(zero, sum);
    it.finish()
}

fn variables(n: usize) -> Vec<u8> {
    let mut it = compute();
    let (zero, uint) = (it.constant(0), it.uint);
    let mut sum = it.load_word(zero);
    let variables: Vec<u32> = (0..n).map(|_| it.local(uint)).collect();
    for &variable in &variables {
        it.op(Op::Store, &[variable, sum]);
        sum = it.result(Op::IAdd, uint, &[sum, sum]);
    }
    for &variable in &variables {
        let value = it.result(Op::Load, uint, &[variable]);
        sum = it.result(Op::BitwiseXor, uint, &[sum, value]);
    }
    it.store_word(zero, sum);
    it.finish()
}

/// `n` chains through 16 structs in each other.
fn chains(n: usize) -> Vec<u8> {
    const DEPTH: usize = 16;
    let mut it = compute();
    let (zero, one, uint) = (it.constant(0), it.constant(1), it.uint);
    let mut ty = uint;
    for _ in 0..DEPTH {
        ty = it.global(Op::TypeStruct, &[uint, ty]);
    }
    let variable = it.local(ty);
    let pointer = it.pointer(StorageClass::Function, uint);
    let x = it.load_word(zero);
    let mut sum = x;
    for at in 0..n {
        let mut indices = vec![one; 1 + at % DEPTH];
        if at % DEPTH + 1 < DEPTH {
            indices.push(zero);
        }
        let place = it.result(Op::AccessChain, pointer, &[&[variable][..], &indices].concat());
        it.op(Op::Store, &[place, sum]);
        let value = it.result(Op::Load, uint, &[place]);
        sum = it.result(Op::IAdd, uint, &[value, x]);
    }
    it.store_word(zero, sum);
    it.finish()
}

fn constants(n: usize) -> Vec<u8> {
    let mut it = compute();
    let (zero, uint) = (it.constant(0), it.uint);
    let mut sum = it.load_word(zero);
    for at in 0..n as u32 {
        let number = it.constant(at.wrapping_mul(2_654_435_761));
        sum = it.result([Op::IAdd, Op::BitwiseXor][at as usize % 2], uint, &[sum, number]);
    }
    it.store_word(zero, sum);
    it.finish()
}

fn entry_points(n: usize) -> Vec<u8> {
    let mut it = compute();
    let zero = it.constant(0);
    for at in 0..n as u32 {
        let number = it.constant(at);
        it.store_word(zero, number);
        it.end_entry_point(&format!("main{at}"));
    }
    it.bytes()
}
