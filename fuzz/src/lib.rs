//! What the fuzz targets share with `tests/input/robustness.rs`: what reads, and how its files are
//! changed.
#![allow(dead_code, reason = "tests use what targets do not")]

#[path = "../../tests/input/robustness/binary.rs"]
mod binary;
#[path = "../../tests/input/robustness/mutators.rs"]
pub mod mutators;
#[path = "../../tests/input/robustness/seeds.rs"]
mod seeds;
#[path = "../../tests/input/robustness/subjects.rs"]
pub mod subjects;
mod support;
#[path = "../../tests/input/robustness/text.rs"]
mod text;

pub use libfuzzer_sys;

use mutators::Mutate;
use support::mutate::Random;

/// A target of a subject, with a mutator that knows the structure of its files.
#[macro_export]
macro_rules! target {
    ($subject:ident, $mutator:ident) => {
        $crate::libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
            $crate::subjects::$subject(bytes);
        });

        $crate::libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
            $crate::mutated(data, size, max_size, seed, $crate::mutators::$mutator)
        });
    };
}

/// Changes the first `size` bytes of `data` and gives their new count: one time in four as
/// libFuzzer does, which knows its dictionary and what comparisons wanted.
pub fn mutated(data: &mut [u8], size: usize, max_size: usize, seed: u32, mutate: Mutate) -> usize {
    let mut random = Random(u64::from(seed));
    if random.below(4) == 0 {
        return libfuzzer_sys::fuzzer_mutate(data, size, max_size);
    }
    let original = (String::new(), data[..size].to_vec());
    let mutant = mutate(&original, &original, &mut random);
    let length = mutant.len().min(max_size).min(data.len());
    data[..length].copy_from_slice(&mutant[..length]);
    length
}
