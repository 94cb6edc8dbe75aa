//! `--many-seeds` and `--perturb` on outputs that differ.

use rspirv::spirv::{BuiltIn, ExecutionModel, Op};

use crate::curve::Curve;
use crate::measure::Work;
use crate::module_writer::{Id, Writer};
use crate::scene_text::{SceneText, compute_scene, write};

/// Invocations of a group.
const GROUP: usize = 64;

/// The curves of repeated runs.
pub fn curves() -> Vec<Curve> {
    let sizes = [1 << 10, 1 << 12, 1 << 14, 1 << 16];
    let bytes = [1 << 16, 1 << 18, 1 << 20, 1 << 22];
    let seeds = ["run", "scene.toml", "--many-seeds", "2"];
    let perturb = ["run", "scene.toml", "--perturb", "2"];
    vec![
        Curve::linear("many-seeds: words that differ", sizes, move |folder, n| {
            write(folder, "main.spv", arrivals());
            write(folder, "scene.toml", compute_scene(n / GROUP, &words(n + 1)));
            Work::command_that_exits(6, seeds)
        }),
        Curve::linear("many-seeds: bytes beside one that differs", bytes, move |folder, n| {
            write(folder, "main.spv", arrivals());
            write(folder, "scene.toml", compute_scene(1, &words(n / 4)));
            Work::command_that_exits(6, seeds)
        }),
        Curve::linear("many-seeds: pixels that are the same", sizes, move |folder, n| {
            SceneText::picture(n).write(folder);
            Work::command(seeds)
        }),
        Curve::linear("perturb: words that differ", sizes, move |folder, n| {
            write(folder, "main.spv", quotients());
            write(folder, "scene.toml", compute_scene(n / GROUP, &words(n + 1)));
            Work::command_that_exits(1, perturb)
        }),
        Curve::linear("perturb: pixels that differ", sizes, move |folder, n| {
            SceneText::picture(n).write(folder);
            Work::command_that_exits(1, ["run", "scene.toml", "--perturb", "2", "--tolerance", "0"])
        }),
        Curve::linear("perturb: bytes beside one that differs", bytes, move |folder, n| {
            write(folder, "main.spv", quotients());
            write(folder, "scene.toml", compute_scene(1, &words(n / 4)));
            Work::command_that_exits(1, perturb)
        }),
    ]
}

fn words(n: usize) -> String {
    format!("[resources.words]\ntype = \"storage_buffer\"\nbinding = 1\ndata = {{ zeros = {} }}\n", 4 * n)
}

/// A module that writes a word for each invocation, from 1 on; `value` writes it.
pub fn for_each_invocation(value: impl FnOnce(&mut Writer, Id) -> Id) -> Vec<u8> {
    let mut it = Writer::new(ExecutionModel::GLCompute);
    let (uint, one) = (it.uint, it.constant(1));
    let triple = it.global(Op::TypeVector, &[uint, 3]);
    let id = it.builtin(BuiltIn::GlobalInvocationId, triple);
    let id = it.result(Op::Load, triple, &[id]);
    let number = it.result(Op::CompositeExtract, uint, &[id, 0]);
    let value = value(&mut it, number);
    let at = it.result(Op::IAdd, uint, &[number, one]);
    it.store_word(at, value);
    it.finish()
}

/// Stores how many invocations came before.
fn arrivals() -> Vec<u8> {
    for_each_invocation(|it, _| {
        let (uint, zero, one) = (it.uint, it.constant(0), it.constant(1));
        let counter = it.word_at(zero);
        it.result(Op::AtomicIAdd, uint, &[counter, one, zero, one])
    })
}

/// Stores a quotient, which devices round as they like.
fn quotients() -> Vec<u8> {
    for_each_invocation(|it, number| {
        let (uint, float, seven) = (it.uint, it.float, it.number(7.0));
        let x = it.result(Op::ConvertUToF, float, &[number]);
        let quotient = it.result(Op::FDiv, float, &[x, seven]);
        it.result(Op::Bitcast, uint, &[quotient])
    })
}
