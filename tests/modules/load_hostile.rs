//! Whatever the bytes: loading ends soon, with a module that can be asked or an error that can be
//! shown. The compiled fixtures, damaged at random; `fuzz/` does the same without end.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhit::ErrorKind;
use anyhit_engine::module::load;
use anyhit_engine::module::ty::TypeId;
use proptest::prelude::*;

/// One small and one large module of each compiler, and one with debug information.
const SEEDS: [&str; 5] = [
    "pass/control-flow/switch/main.rgen.spv",
    "pass/intersection/sphere-in-box/main.rint.spv",
    "pass/functions/parameters/main.rgen.gVS.spv",
    "demo/swept-spheres/main.rgen.spv",
    "demo/swept-spheres/swept_spheres.slang.g2.spv",
];

/// A hundred times what an undamaged module takes in a debug build on a slow machine.
const PATIENCE: Duration = Duration::from_secs(5);

fn seed(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures").join(name);
    fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Loads, and asks a module everything; nothing of it may panic.
fn probe(bytes: &[u8]) {
    let start = Instant::now();
    match load(bytes) {
        Ok(module) => {
            for index in 0..module.types.len() {
                let ty = TypeId(index as u32);
                assert!(!module.describe_type(ty).is_empty());
                let _ = (module.size_of(ty), module.scalar_count(ty));
            }
            for entry in &module.entry_points {
                let _ = module.interface_of(entry);
            }
            for block in module.functions.iter().flat_map(|function| &function.blocks) {
                for instruction in &block.instructions {
                    let _ = module.debug_info.line_at(instruction.offset);
                    let _ = (module.operand_ids(instruction), module.branch_targets(instruction));
                }
            }
        }
        Err(error) => {
            assert!(matches!(error.kind(), ErrorKind::InvalidModule | ErrorKind::UnsupportedModule));
            assert!(error.places().next().is_some(), "an error without a place: {error}");
            assert!(!error.render().is_empty());
        }
    }
    assert!(start.elapsed() < PATIENCE, "took {:?}", start.elapsed());
}

#[test]
fn the_seeds_themselves_load() {
    for name in SEEDS {
        assert!(load(&seed(name)).is_ok(), "{name}");
    }
}

#[test]
fn every_word_boundary_is_a_place_to_end() {
    let bytes = seed(SEEDS[0]);
    for length in (0..bytes.len()).step_by(4) {
        probe(&bytes[..length]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn flipped_bits_do_no_harm(
        name in prop::sample::select(&SEEDS[..]),
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8u8), 1..12),
    ) {
        let mut bytes = seed(name);
        for (at, bit) in flips {
            let at = at.index(bytes.len());
            bytes[at] ^= 1 << bit;
        }
        probe(&bytes);
    }

    #[test]
    fn overwritten_words_do_no_harm(
        name in prop::sample::select(&SEEDS[..]),
        writes in prop::collection::vec(
            (any::<prop::sample::Index>(), prop_oneof![0..600u32, Just(u32::MAX), any::<u32>()]),
            1..4,
        ),
    ) {
        let mut bytes = seed(name);
        for (at, word) in writes {
            // The header stays: behind it is where the meaning is.
            let at = 20 + 4 * at.index(bytes.len() / 4 - 5);
            bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
        }
        probe(&bytes);
    }

    #[test]
    fn instructions_left_out_or_doubled_do_no_harm(
        name in prop::sample::select(&SEEDS[..]),
        picks in prop::collection::vec((any::<prop::sample::Index>(), any::<bool>()), 1..4),
    ) {
        let bytes = seed(name);
        let words: Vec<u32> =
            bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
        let mut instructions = Vec::new();
        let mut at = 5;
        while at < words.len() {
            let end = at + (words[at] >> 16) as usize;
            instructions.push(&words[at..end]);
            at = end;
        }
        for (at, double) in picks {
            let at = at.index(instructions.len());
            if double {
                instructions.insert(at, instructions[at]);
            } else {
                instructions.remove(at);
            }
        }
        let damaged = words[..5].iter().chain(instructions.iter().copied().flatten());
        probe(&damaged.flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>());
    }

    #[test]
    fn noise_behind_a_header_does_no_harm(noise in prop::collection::vec(any::<u32>(), 0..64)) {
        let header = [0x0723_0203, 0x0001_0600, 0, u32::MAX, 0];
        probe(&header.iter().chain(&noise).flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>());
    }
}
