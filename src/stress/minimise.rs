//! Makes a failing case small: fewer primitives, no matrix, short numbers.

use crate::geometry::Precision;
use crate::stress::case::Case;
use crate::stress::judge::{Failure, check_caught};

/// A case that fails, no greater than the given one in any respect, and how it fails. Tries each
/// change in turn and keeps it where the case still fails (in whatever way), until none helps.
///
/// # Panics
/// Where the given case does not fail.
pub fn minimise(case: &Case, precision: Precision) -> (Case, Failure) {
    let fails = |case: &Case| check_caught(case, precision).err();
    let mut best = case.clone();
    let mut failure = fails(&best).expect("bug in anyhit: a case that does not fail is made smaller");
    // A change that is kept makes the case smaller, so that this ends; the bound is for time.
    for _ in 0..8 {
        let before = best.clone();
        let mut try_one = |candidate: Case, best: &mut Case| {
            if let Some(how) = fails(&candidate) {
                *best = candidate;
                failure = how;
                return true;
            }
            false
        };
        let mut index = 0;
        while best.shapes.len() > 1 && index < best.shapes.len() {
            let mut fewer = best.clone();
            fewer.shapes.remove(index);
            if !try_one(fewer, &mut best) {
                index += 1;
            }
        }
        if best.transform.is_some() {
            try_one(Case { transform: None, ..best.clone() }, &mut best);
        }
        let count = best.clone().numbers().len();
        for place in 0..count {
            for simpler in simpler(*best.numbers()[place]) {
                let mut candidate = best.clone();
                *candidate.numbers()[place] = simpler;
                if try_one(candidate, &mut best) {
                    break;
                }
            }
        }
        if best == before {
            break;
        }
    }
    (best, failure)
}

/// Shorter numbers that could stand for one, the shortest first.
fn simpler(x: f32) -> Vec<f32> {
    let mut out = Vec::new();
    if x == 0.0 || !x.is_finite() {
        return out;
    }
    out.extend([0.0, 1.0f32.copysign(x)].into_iter().filter(|&y| y != x));
    for kept in [1, 2, 4, 8, 12, 16, 20] {
        let mask = u32::MAX << (24 - kept);
        let shorter = f32::from_bits(x.to_bits() & mask);
        if shorter != x {
            out.push(shorter);
        }
    }
    // +-1 must not be changed to 0 and back.
    if x.abs() == 1.0 { vec![0.0] } else { out }
}
