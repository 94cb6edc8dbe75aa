//! How far a device's result may lie from the exact one.
//!
//! The bounds are those of Vulkan's "Precision and Operation of SPIR-V Instructions", or the
//! greatest error that a driver was measured to make (`docs/stability.md` lists both). A result is
//! drawn within the bounds: half of the time uniformly, otherwise at one end, where decisions are
//! most likely to change. Instructions that Vulkan defines by a formula are drawn step by step.

use crate::stability::calculate::{Draw, SplitMix64};
use crate::stability::envelope::Envelope;

/// How far NVIDIA's driver reports a hit from its t, in units in the last place (all but one of a
/// thousand rays in ordinary scenes).
pub(super) const NVIDIA_T: f64 = 20.0;

/// A result that a device may give an instruction on floats of 16 or 32 bits, by Vulkan's bounds;
/// `None` if only the correct result is allowed. Sums and products in it are rounded to nearest.
pub(crate) fn device_result(name: &str, operands: [f64; 3], width: u32, seed: u64) -> Option<f64> {
    let (random, envelope) = (&mut SplitMix64(seed), Envelope::Vulkan);
    perturbed_result(name, operands, &mut Draw { random, envelope, width, nearest: true, may_contract: true })
}

/// Draws a result that an instruction on f32 or f16 may return; `None` if only the correct result
/// is allowed. Operands are those of the run.
pub(super) fn perturbed_result(name: &str, [a, b, c]: [f64; 3], draw: &mut Draw<'_>) -> Option<f64> {
    use std::f64::consts::{LN_2, PI};
    let half = draw.width == 16;
    let measured = draw.envelope == Envelope::Nvidia;
    Some(match name {
        "FAdd" => draw.add(a, b),
        "FSub" => draw.add(a, -b),
        "FMul" => draw.mul(a, b),
        "FDiv" => draw.div(a, b),
        "FmaKHR" => draw.fma(a, b, c),
        "Fma" => draw.mul_add(a, b, c),
        "FRem" | "FMod" => {
            let quotient = draw.div(a, b);
            let whole = if name == "FRem" { quotient.trunc() } else { quotient.floor() };
            draw.mul_add(-b, whole, a)
        }
        "FMix" => {
            let rest = draw.add(1.0, -c);
            let first = draw.mul(a, rest);
            draw.mul_add(b, c, first)
        }
        "SmoothStep" => {
            let (above, range) = (draw.add(c, -a), draw.add(b, -a));
            let t = draw.div(above, range).clamp(0.0, 1.0);
            let (square, rest) = (draw.mul(t, t), draw.mul_add(-2.0, t, 3.0));
            draw.mul(square, rest)
        }
        "Radians" => draw.mul(a, draw.nearest(PI / 180.0)),
        "Degrees" => draw.mul(a, draw.nearest(180.0 / PI)),
        "Fract" => draw.rounded(a - a.floor(), 0.0),
        // "The fraction 0.5 will round in a direction chosen by the implementation."
        "Round" if (a - a.trunc()).abs() == 0.5 => {
            if draw.coin() {
                a.floor()
            } else {
                a.ceil()
            }
        }
        "Exp" if measured => draw.ulps(a.exp(), 29.0),
        "Exp2" if measured => draw.ulps(a.exp2(), 1.9),
        "Exp" => draw.ulps(a.exp(), if half { 1.0 } else { 3.0 } + 2.0 * a.abs()),
        "Exp2" => draw.exp2(a),
        "Log" => draw.log(a, a.ln()),
        "Log2" => draw.log(a, a.log2()),
        "Pow" if a < 0.0 || (a == 0.0 && b <= 0.0) => return None,
        "Pow" if measured => draw.ulps(a.powf(b), 54.0),
        "Pow" => {
            let log = draw.log(a, a.log2());
            let exponent = draw.mul(b, log);
            draw.exp2(exponent)
        }
        "InverseSqrt" => draw.ulps(1.0 / a.sqrt(), if measured { 1.5 } else { 2.0 }),
        "Sqrt" if measured => draw.ulps(a.sqrt(), 0.93),
        "Sqrt" => draw.sqrt(a),
        "Sin" => draw.near(a.sin(), angle(half, measured.then_some(3.3e-7))),
        "Cos" => draw.near(a.cos(), angle(half, measured.then_some(3.9e-7))),
        "Tan" if measured => draw.ulps(a.tan(), 140.0),
        "Tan" => {
            let sine = draw.near(a.sin(), angle(half, None));
            let cosine = draw.near(a.cos(), angle(half, None));
            draw.div(sine, cosine)
        }
        "Asin" | "Acos" if !(-1.0..=1.0).contains(&a) => return None,
        "Asin" if measured => draw.ulps(a.asin(), 2.3),
        "Acos" if measured => draw.ulps(a.acos(), 2.3),
        "Asin" | "Acos" => {
            let rest = draw.mul_add(-a, a, 1.0).max(0.0);
            let root = draw.sqrt(rest);
            let (y, x) = if name == "Asin" { (a, root) } else { (root, a) };
            draw.atan(y.atan2(x))
        }
        "Atan" => draw.atan(a.atan()),
        "Atan2" => draw.atan(a.atan2(b)),
        "Sinh" if measured => draw.ulps(a.sinh(), 280.0),
        "Cosh" if measured => draw.ulps(a.cosh(), 30.0),
        "Tanh" if measured => draw.ulps(a.tanh(), 1.7),
        "Sinh" => draw.hyperbolic(a, -1.0),
        "Cosh" => draw.hyperbolic(a, 1.0),
        "Tanh" => {
            let (sinh, cosh) = (draw.hyperbolic(a, -1.0), draw.hyperbolic(a, 1.0));
            if !cosh.is_finite() {
                return None;
            }
            draw.div(sinh, cosh)
        }
        "Asinh" | "Acosh" => {
            let one = if name == "Asinh" { 1.0 } else { -1.0 };
            let square = draw.mul_add(a, a, one).max(0.0);
            let root = draw.sqrt(square);
            let sum = draw.add(a, root);
            draw.log(sum, sum.ln())
        }
        "Atanh" => {
            let (above, below) = (draw.add(1.0, a), draw.add(1.0, -a));
            let quotient = draw.div(above, below);
            let log = draw.log(quotient, quotient.log2() * LN_2);
            draw.mul(log, 0.5)
        }
        // Conversions, from floats and from integers.
        "Convert" => draw.rounded(a, 0.0),
        _ => return None,
    })
}

/// The absolute error of sine and cosine. Vulkan specifies it on [-pi, pi] and nothing beyond,
/// where the same error is used.
fn angle(half: bool, measured: Option<f64>) -> f64 {
    measured.unwrap_or(if half { 2f64.powi(-7) } else { 2f64.powi(-11) })
}
