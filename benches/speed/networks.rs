//! A small neural network: three layers of 64 neurons with weights of f16, as cooperative vectors,
//! as loops of a shader, and as loops of Rust on the same thread.

use std::sync::Arc;

use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{Compute, RunOptions};
use half::f16;

use crate::frames::program;
use crate::table::Table;

const WIDTH: usize = 64;
const LAYERS: usize = 3;

/// Numbers of f16 between -1/8 and 1/8.
fn numbers(count: usize) -> Vec<f16> {
    (0..count).map(|at| f16::from_f32((at * 7919 % 257) as f32 / 1028.0 - 0.125)).collect()
}

/// The network by its definition, in the order of sums of docs/cooperative.md.
fn evaluate(weights: &[f16], input: &[f16]) -> Vec<f16> {
    let mut x = input.to_vec();
    for layer in 0..LAYERS {
        let matrix = &weights[layer * WIDTH * WIDTH..][..WIDTH * WIDTH];
        let bias = &weights[LAYERS * WIDTH * WIDTH + layer * WIDTH..][..WIDTH];
        let row = |row: usize| {
            let factors = matrix[row * WIDTH..][..WIDTH].iter().zip(&x);
            let sum = factors.fold(0f32, |sum, (a, x)| sum + a.to_f32() * x.to_f32());
            f16::from_f32(sum + bias[row].to_f32()).max(f16::ZERO)
        };
        x = (0..WIDTH).map(row).collect();
    }
    x
}

pub fn run(table: &mut Table) {
    let table = &*table;
    let count = table.size(4096, 64);
    let bytes =
        |numbers: &[f16]| -> Vec<u8> { numbers.iter().flat_map(|number| number.to_le_bytes()).collect() };
    let (weights, inputs) = (numbers(LAYERS * (WIDTH + 1) * WIDTH), numbers(count * WIDTH));
    let expected: Vec<u8> =
        inputs.chunks_exact(WIDTH).flat_map(|input| bytes(&evaluate(&weights, input))).collect();
    if table.wants("network in Rust") {
        table.rate("network in Rust", "evaluations", count as u64, || {
            let sum: f32 =
                inputs.chunks_exact(WIDTH).map(|input| evaluate(&weights, input)[0].to_f32()).sum();
            format!("sum of first neurons {sum}")
        });
    }
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for (name, shader, count) in [
        ("network of cooperative vectors", "network.comp", count),
        ("network of loops", "network-loops.comp", count / 16),
    ] {
        if !table.wants(name) {
            continue;
        }
        let groups = count.div_ceil(WIDTH).max(1);
        let compute = Compute::new(program(shader)).expect("a compute shader");
        let outputs: Arc<Buffer> = Buffer::zeroed(groups * 64 * WIDTH * 2);
        let mut read = bytes(&inputs);
        read.resize(outputs.bytes().len(), 0);
        let resources = Resources::default()
            .bind(0, 1, Descriptor::Buffer(outputs.clone()))
            .bind(0, 2, Descriptor::Buffer(Buffer::new(&bytes(&weights))))
            .bind(0, 3, Descriptor::Buffer(Buffer::new(&read)));
        table.rate(name, "evaluations", (groups * 64) as u64, || {
            let run = || compute.run(&resources, [groups as u32, 1, 1], RunOptions::default());
            one.install(run).expect("no trap");
            String::new()
        });
        let found = outputs.bytes();
        let checked = found.len().min(expected.len());
        assert!(found[..checked] == expected[..checked], "{name}: another result than Rust's");
    }
}
