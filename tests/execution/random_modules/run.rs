//! A module's data, and what the interpreter makes of it.

use std::sync::Arc;

use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{BatchWidth, Compute, RunOptions};
use anyhit_engine::program::{Inlining, LowerOptions, Optimization, Program};

use super::evaluate::Memory;
use super::generate::{BUFFERS, Generated, HEAD, INPUTS, OUTPUTS, SHARED};
use super::random::Random;

/// Where the last buffer lies: the first of the device's allocations begins there.
pub const ADDRESS: u64 = 1 << 32;

/// What the buffers hold before: edge values, small numbers and any numbers.
pub fn memory(generated: &Generated, seed: u64) -> Memory {
    const EDGES: [u32; 10] =
        [0, 1, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF, 31, 0x0001_0000, 0x3F80_0000, 0xC040_0000, 0x3C00_BC00];
    let mut random = Random::new(seed, 1);
    let mut words = |count: usize| -> Vec<u8> {
        let words = (0..count).map(|_| match random.below(3) {
            0 => random.pick(&EDGES),
            1 => random.below(16) as u32,
            _ => random.next() as u32,
        });
        words.flat_map(u32::to_le_bytes).collect()
    };
    let count = generated.invocations();
    let mut inputs = words(HEAD + INPUTS * count);
    inputs[..8].copy_from_slice(&ADDRESS.to_le_bytes());
    let buffers = vec![
        inputs,
        vec![0; OUTPUTS * count * 4],
        words(generated.element_sizes[0] as usize * count / 4 + 1),
        words(SHARED),
        words(generated.element_sizes[1] as usize * count / 4 + 1),
    ];
    assert_eq!(buffers.len(), BUFFERS);
    Memory { buffers, address: ADDRESS }
}

/// How a module becomes a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lowered {
    /// As users have it.
    Usual,
    /// With every call a real one.
    Called,
    /// With every pass of the optimizer off: the reference.
    Unoptimized,
}

/// All ways to lower a module.
pub const LOWERINGS: &[Lowered] = &[Lowered::Usual, Lowered::Called, Lowered::Unoptimized];

/// The one place where a module is lowered.
fn lower(module: &Arc<anyhit::Module>, lowered: Lowered) -> anyhit::Result<Program> {
    let usual = LowerOptions::default();
    let options = match lowered {
        Lowered::Usual => usual,
        Lowered::Called => LowerOptions { inlining: Inlining::Never, ..usual },
        Lowered::Unoptimized => LowerOptions { optimization: Optimization::None, ..usual },
    };
    anyhit_engine::program::lower_with(module, &module.entry_points[0], options)
}

/// What the interpreter leaves in the buffers, by lowering and lanes.
pub fn interpret(
    words: &[u32],
    before: &Memory,
    generated: &Generated,
    check: &mut dyn FnMut(&str, &Memory) -> Result<(), String>,
) -> Result<(), String> {
    let told = |error: anyhit::Error| format!("refused: {}", error.render());
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let module = Arc::new(anyhit_engine::module::load(&bytes).map_err(told)?);
    for &lowered in LOWERINGS {
        if lowered == Lowered::Called && generated.module.functions.len() == 1 {
            continue;
        }
        let program = lower(&module, lowered).map_err(told)?;
        let compute = Compute::new(program)
            .and_then(|compute| compute.subgroup_size(generated.subgroup))
            .map_err(told)?;
        for lanes in BatchWidth::ALL {
            let buffers: Vec<Arc<Buffer>> = before.buffers.iter().map(|bytes| Buffer::new(bytes)).collect();
            let mut resources = Resources::default();
            for (binding, buffer) in buffers[..BUFFERS - 1].iter().enumerate() {
                resources = resources.bind(0, binding as u32, Descriptor::Buffer(buffer.clone()));
            }
            assert_eq!(resources.memory.add_buffer(&buffers[BUFFERS - 1]), before.address);
            let groups = [generated.groups, 1, 1];
            let result = compute.run(&resources, groups, RunOptions::of(lanes));
            let way = format!("{lowered:?}, {lanes} lanes");
            result.map_err(|error| format!("trapped ({way}): {}", error.render()))?;
            let after = Memory {
                buffers: buffers.iter().map(|buffer| buffer.bytes()).collect(),
                address: before.address,
            };
            check(&way, &after)?;
        }
    }
    Ok(())
}

/// Where two results part; all NaNs are one.
pub fn difference(generated: &Generated, expected: &Memory, found: &Memory) -> Option<String> {
    for (binding, (expected, found)) in expected.buffers.iter().zip(&found.buffers).enumerate() {
        if expected == found {
            continue;
        }
        let (expected, found) = (one_nan(generated, binding, expected), one_nan(generated, binding, found));
        if let Some(at) = expected.iter().zip(&found).position(|(one, other)| one != other) {
            let word = at / 4 * 4;
            let number = |bytes: &[u8]| {
                bytes.get(word..word + 4).map_or(0, |word| u32::from_le_bytes(word.try_into().unwrap()))
            };
            let size = match binding {
                0 | 3 => 4,
                1 => OUTPUTS * 4,
                2 => generated.element_sizes[0] as usize,
                _ => generated.element_sizes[1] as usize,
            };
            return Some(format!(
                "buffer {binding}, element {}, byte {}: expected {:#x}, found {:#x}",
                word / size,
                word % size,
                number(&expected),
                number(&found)
            ));
        }
    }
    None
}

fn one_nan(generated: &Generated, binding: usize, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let which = match binding {
        2 => 0,
        4 => 1,
        _ => return bytes,
    };
    let size = generated.element_sizes[which] as usize;
    if size == 0 {
        return bytes;
    }
    for element in bytes.chunks_exact_mut(size) {
        for &(at, width) in &generated.floats[which] {
            let place = &mut element[at as usize..][..width as usize / 8];
            let bits = place.iter().rev().fold(0, |bits, byte| bits << 8 | u64::from(*byte));
            if super::arithmetic::float(bits, width).is_nan() {
                place.fill(0xFF);
            }
        }
    }
    bytes
}
