//! Exhaustive test of the elementary functions and the other componentwise float instructions
//! against correctly rounded results: `anyhit check-math`.
//!
//! A [`CheckedFunction`] is an instruction with a reference evaluation: one in f64 by the
//! platform's own library, which decides nearly every input by its distance from the next rounding
//! boundary, and one in arbitrary precision for the rest. The instructions use neither. [`judge`]
//! decides whether a result is correct, [`inputs`] chooses the inputs.

pub mod float_width;
pub mod function;
pub mod inputs;
pub mod judge;

use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::check_math::float_width::FloatWidth;
use crate::check_math::function::{CheckedFunction, ReferenceValue};
use crate::check_math::inputs::Inputs;
use crate::check_math::judge::Judgement;
use anyhit_base::progress::Work;
use anyhit_engine::machine::{Reg, Registers};
use anyhit_engine::ops::lane_kernel::{LaneKernel, Width};

/// The number of inputs between two reports of progress.
const BLOCK: u64 = 1 << 16;

/// The largest number of wrong results that are kept for a function.
const MAX_EXAMPLES: usize = 10;

/// The settings of a run.
#[derive(Clone, Copy, Debug)]
pub struct CheckMathSettings {
    /// Of the inputs of a function of one f32, and of the pairs of f16, one in so many is tested.
    pub stride: u64,
    /// The number of pairs for a function of two f32.
    pub pairs: u64,
    /// The number of inputs for a function of f64.
    pub samples: u64,
    /// The seed that chooses pairs and samples, and where a stride begins.
    pub seed: u64,
}

/// A wrong result of a function.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WrongResult {
    /// The bits of the operands.
    pub operands: Vec<u64>,
    /// The bits of the wrong result.
    pub found: u64,
    /// The correct result, as text.
    pub right: String,
}

/// The results for one function at one width.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckMathReport {
    /// The specification's name.
    pub function: String,
    /// Bits of the float type.
    pub width: u32,
    /// Which inputs were tested: `all`, or how they were chosen.
    pub which: String,
    /// The number of inputs that were tested.
    pub inputs: u64,
    /// How many of them arbitrary precision had to decide.
    pub precise: u64,
    /// How many results are wrong.
    pub wrong: u64,
    /// The first wrong results.
    pub examples: Vec<WrongResult>,
    /// For f64, the greatest error in units in the last place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub greatest_error: Option<f64>,
    /// How long it took.
    #[serde(serialize_with = "seconds", deserialize_with = "from_seconds")]
    pub time: Duration,
}

fn seconds<S: Serializer>(time: &Duration, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(time.as_secs_f64())
}

fn from_seconds<'de, D: Deserializer<'de>>(from: D) -> Result<Duration, D::Error> {
    Duration::try_from_secs_f64(f64::deserialize(from)?).map_err(D::Error::custom)
}

/// Tests one function at one width.
pub fn run(
    function: &'static CheckedFunction,
    format: FloatWidth,
    settings: &CheckMathSettings,
) -> CheckMathReport {
    let begin = Instant::now();
    let kernel = function.kernel(format).expect("a function that exists for this float type");
    let inputs = Inputs::of(function, format, settings);
    let total = inputs.count();
    let work = Work::counted(function.name, total);
    let found = (0..total.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let range = block * BLOCK..((block + 1) * BLOCK).min(total);
            let count = range.end - range.start;
            let found = run_block(function, format, kernel, &inputs, range);
            work.advance(count);
            found
        })
        .reduce(BlockResult::default, BlockResult::merge);
    CheckMathReport {
        function: function.name.to_owned(),
        width: format.width(),
        which: inputs.to_string(),
        inputs: total,
        precise: found.precise,
        wrong: found.wrong,
        examples: found.examples,
        greatest_error: (format == FloatWidth::Double).then_some(found.greatest_error),
        time: begin.elapsed(),
    }
}

#[derive(Default)]
struct BlockResult {
    precise: u64,
    wrong: u64,
    examples: Vec<WrongResult>,
    greatest_error: f64,
}

impl BlockResult {
    /// Merges two results in the order of inputs, so that the number of threads changes nothing.
    fn merge(mut self, other: Self) -> Self {
        self.precise += other.precise;
        self.wrong += other.wrong;
        self.examples.extend(other.examples);
        self.examples.truncate(MAX_EXAMPLES);
        self.greatest_error = self.greatest_error.max(other.greatest_error);
        self
    }
}

/// Runs a range of the inputs in batches of 64 lanes and judges them.
fn run_block(
    function: &CheckedFunction,
    format: FloatWidth,
    kernel: &LaneKernel,
    inputs: &Inputs,
    range: std::ops::Range<u64>,
) -> BlockResult {
    const OPERANDS: [Reg; 3] = [Reg(2), Reg(4), Reg(6)];
    let mut registers = Registers::<64>::new(8);
    let mut found = BlockResult::default();
    let mut operands = [[0u64; 2]; 64];
    let mut at = range.start;
    while at < range.end {
        let lanes = (range.end - at).min(64) as usize;
        for (lane, operands) in operands[..lanes].iter_mut().enumerate() {
            *operands = inputs.at(at + lane as u64);
            for (operand, &bits) in operands.iter().enumerate() {
                registers[OPERANDS[operand]].0[lane] = bits as u32;
                registers[OPERANDS[operand].plus(1)].0[lane] = (bits >> 32) as u32;
            }
        }
        kernel.run(&mut registers, Reg(0), &OPERANDS);
        for (lane, operands) in operands[..lanes].iter().enumerate() {
            let high = if kernel.words == 2 { u64::from(registers[Reg(1)].0[lane]) << 32 } else { 0 };
            let result = u64::from(registers[Reg(0)].0[lane]) | high;
            let judgement = function.judge(format, operands, result);
            let right = match judgement {
                Judgement::Correct => continue,
                Judgement::Precise(error) => {
                    found.precise += 1;
                    found.greatest_error = found.greatest_error.max(error);
                    continue;
                }
                Judgement::Wrong(right) => right,
            };
            found.wrong += 1;
            if found.examples.len() < MAX_EXAMPLES {
                let operands = operands[..function.operands()].to_vec();
                found.examples.push(WrongResult { operands, found: result, right });
            }
        }
        at += lanes as u64;
    }
    found
}

impl CheckedFunction {
    /// How many operands it takes.
    pub fn operands(&self) -> usize {
        match self.reference {
            ReferenceValue::Rounded(_) | ReferenceValue::Elementary(..) | ReferenceValue::Integer { .. } => 1,
            ReferenceValue::RoundedPair(_) | ReferenceValue::ElementaryPair(..) => 2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check_math::function::FUNCTIONS;

    const FEW: CheckMathSettings = CheckMathSettings { stride: 1, pairs: 20_000, samples: 60, seed: 1 };

    fn right(format: FloatWidth, settings: &CheckMathSettings, wanted: impl Fn(&CheckedFunction) -> bool) {
        let asked = FUNCTIONS.iter().filter(|function| wanted(function) && function.exists(format));
        let reports: Vec<CheckMathReport> = asked.map(|function| run(function, format, settings)).collect();
        assert!(!reports.is_empty() && reports.iter().all(|report| report.inputs > 0));
        let wrong: Vec<&CheckMathReport> = reports.iter().filter(|report| report.wrong > 0).collect();
        assert!(wrong.is_empty(), "{wrong:#x?}");
    }

    #[test]
    fn every_half_is_right_in_functions_of_one() {
        right(FloatWidth::Half, &FEW, |function| function.operands() == 1);
    }

    #[test]
    fn a_sample_of_all_is_right() {
        // Strides are odd, so that all low bits turn up.
        right(FloatWidth::Half, &CheckMathSettings { stride: 1_000_003, ..FEW }, |function| {
            function.operands() == 2
        });
        right(FloatWidth::Single, &CheckMathSettings { stride: 200_003, ..FEW }, |_| true);
    }

    #[test]
    fn doubles_are_off_by_one_unit_at_most() {
        right(FloatWidth::Double, &FEW, |_| true);
    }

    /// All f32 of all functions of one: about an hour of one core in a release build.
    #[test]
    #[ignore = "asks billions of inputs: `anyhit check-math` does the same with progress"]
    fn everything_is_right() {
        let all = CheckMathSettings { stride: 1, pairs: 1 << 28, samples: 100_000, seed: 1 };
        for format in FloatWidth::ALL {
            right(format, &all, |_| true);
        }
    }

    /// Checks that the judge rejects the neighbours of a correct result.
    #[test]
    fn a_neighbour_of_the_right_result_is_wrong() {
        for function in FUNCTIONS {
            for format in FloatWidth::ALL.into_iter().filter(|&format| function.exists(format)) {
                let kernel = function.kernel(format).expect("a kernel");
                let one = format.bits_of(1.0);
                let operands = [format.bits_of(0.75), one];
                let mut registers = Registers::<64>::new(8);
                for lane in 0..64 {
                    for (operand, bits) in operands.iter().enumerate() {
                        registers[Reg(2 + 2 * operand as u32)].0[lane] = *bits as u32;
                        registers[Reg(3 + 2 * operand as u32)].0[lane] = (*bits >> 32) as u32;
                    }
                }
                kernel.run(&mut registers, Reg(0), &[Reg(2), Reg(4), Reg(6)]);
                let high = if kernel.words == 2 { u64::from(registers[Reg(1)].0[0]) << 32 } else { 0 };
                let result = u64::from(registers[Reg(0)].0[0]) | high;
                let judge = |bits| function.judge(format, &operands, bits);
                assert!(!matches!(judge(result), Judgement::Wrong(_)), "{}", function.name);
                let bits = match function.reference {
                    ReferenceValue::Integer { bits, .. } => bits,
                    _ => format.width(),
                };
                // Two steps, as one is within 1 ulp.
                for other in [result.wrapping_add(2), result.wrapping_sub(2), result ^ 1 << (bits - 1)] {
                    // acosh(0.75) is a NaN, and so are its neighbours.
                    if !format.value(result).is_nan() {
                        let wrong = matches!(judge(other), Judgement::Wrong(_));
                        assert!(wrong, "{} {format:?} {other:#x}", function.name);
                    }
                }
            }
        }
    }
}
