//! Draws perturbed results of arithmetic within an error bound.

use crate::stability::envelope::Envelope;

/// A seeded pseudorandom generator (SplitMix64).
#[derive(Clone, Copy, Debug)]
pub(super) struct SplitMix64(pub u64);

impl SplitMix64 {
    /// Draws 64 random bits.
    pub(super) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mix64(self.0)
    }
}

/// SplitMix64's finalizer: a hash in which every bit depends on all bits of the number.
pub(super) fn mix64(number: u64) -> u64 {
    let mut z = number;
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ z >> 31
}

/// Draws perturbed results in a float type. Operands are values of that type. Exact results are
/// given in f64, with the rest that f64 rounded away where it matters.
#[derive(Debug)]
pub(super) struct Draw<'a> {
    pub random: &'a mut SplitMix64,
    pub envelope: Envelope,
    /// The width of the float type: 16 or 32.
    pub width: u32,
    /// Whether sums and products are rounded to nearest (`RoundingModeRTE`).
    pub nearest: bool,
    /// Whether products may be added without being rounded.
    pub may_contract: bool,
}

impl Draw<'_> {
    /// Draws true or false with equal odds.
    pub(super) fn coin(&mut self) -> bool {
        self.random.bits() >> 63 == 1
    }

    /// Draws from -1 to 1: half of the time uniformly, otherwise at one end.
    fn offset(&mut self) -> f64 {
        let bits = self.random.bits();
        match bits & 3 {
            0 => -1.0,
            1 => 1.0,
            _ => (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0,
        }
    }

    /// The nearest float of the type.
    pub(super) fn nearest(&self, value: f64) -> f64 {
        match self.width {
            16 => anyhit_engine::math::float::f64_to_f16(value).to_f64(),
            _ => f64::from(value as f32),
        }
    }

    fn up(&self, value: f64) -> f64 {
        match self.width {
            16 => half_up(anyhit_engine::math::float::f64_to_f16(value)).to_f64(),
            _ => f64::from((value as f32).next_up()),
        }
    }

    fn down(&self, value: f64) -> f64 {
        -self.up(-value)
    }

    /// A correctly rounded result: one of the two floats around `value` plus a rest too small for
    /// f64. It is the nearest float if the shader requires that (`RoundingModeRTE`), and on
    /// NVIDIA's driver.
    pub(super) fn rounded(&mut self, value: f64, rest: f64) -> f64 {
        let near = self.nearest(value);
        if !near.is_finite() || self.nearest || self.envelope == Envelope::Nvidia {
            return near;
        }
        let above = near < value || (near == value && rest > 0.0);
        let below = near > value || (near == value && rest < 0.0);
        match (above, below) {
            (true, _) if self.coin() => self.up(near),
            (_, true) if self.coin() => self.down(near),
            _ => near,
        }
    }

    pub(super) fn add(&mut self, a: f64, b: f64) -> f64 {
        // The error of a sum of two f64 is a f64 (Knuth's TwoSum).
        let sum = a + b;
        let part = sum - a;
        let rest = (a - (sum - part)) + (b - part);
        self.rounded(sum, if rest.is_finite() { rest } else { 0.0 })
    }

    /// A product of two floats of at most 24 bits is exact in f64.
    pub(super) fn mul(&mut self, a: f64, b: f64) -> f64 {
        self.rounded(a * b, 0.0)
    }

    /// `a * b + c`, rounded once.
    pub(super) fn fma(&mut self, a: f64, b: f64, c: f64) -> f64 {
        self.add(a * b, c)
    }

    /// `a * b + c`, rounded once or twice if contraction is allowed, otherwise twice.
    pub(super) fn mul_add(&mut self, a: f64, b: f64, c: f64) -> f64 {
        if self.may_contract && self.coin() {
            return self.fma(a, b, c);
        }
        let product = self.mul(a, b);
        self.add(product, c)
    }

    /// 2.5 units in the last place for divisors that are zero or in 2^-126..=2^126 (2^-14..=2^14 in
    /// f16); for others Vulkan specifies nothing, and the correct quotient is returned.
    pub(super) fn div(&mut self, a: f64, b: f64) -> f64 {
        let range = if self.width == 16 { 14 } else { 126 };
        let near = (2f64.powi(-range)..=2f64.powi(range)).contains(&b.abs());
        match (near, self.envelope) {
            (true, Envelope::Vulkan) => self.ulps(a / b, 2.5),
            (true, Envelope::Nvidia) => self.ulps(a / b, 2.0),
            (false, _) => self.nearest(a / b),
        }
    }

    /// Draws within `count` units in the last place of a value.
    pub(super) fn ulps(&mut self, value: f64, count: f64) -> f64 {
        let near = self.nearest(value);
        if !near.is_finite() || value == 0.0 {
            return near;
        }
        let above = self.up(near.abs()) - near.abs();
        let gap = if above.is_finite() { above } else { near.abs() - self.down(near.abs()) };
        self.near(value, count * gap)
    }

    /// Draws within an absolute distance of a value.
    pub(super) fn near(&mut self, value: f64, distance: f64) -> f64 {
        if !value.is_finite() {
            return self.nearest(value);
        }
        let aim = value + self.offset() * distance;
        let moved = self.nearest(aim);
        // Rounding must not leave the range.
        let inside = |moved: f64| (moved - value).abs() <= distance;
        let nearer = if moved > value { self.down(moved) } else { self.up(moved) };
        match (inside(moved), inside(nearer)) {
            (true, _) => moved,
            (false, true) => nearer,
            (false, false) => self.nearest(value),
        }
    }

    /// 3 units in the last place; between 0.5 and 2, where the logarithm of x is near 0, an
    /// absolute error of 2^-21 (2^-7 in f16).
    pub(super) fn log(&mut self, x: f64, log: f64) -> f64 {
        let measured = self.envelope == Envelope::Nvidia;
        if !(0.5..=2.0).contains(&x) {
            return self.ulps(log, if measured { 2.1 } else { 3.0 });
        }
        let distance = match (measured, self.width) {
            (true, _) => 4e-6,
            (false, 16) => 2f64.powi(-7),
            (false, _) => 2f64.powi(-21),
        };
        self.near(log, distance)
    }

    /// 3 + 2 |x| units in the last place (1 + 2 |x| in f16).
    pub(super) fn exp2(&mut self, x: f64) -> f64 {
        let first = if self.width == 16 { 1.0 } else { 3.0 };
        self.ulps(x.exp2(), first + 2.0 * x.abs())
    }

    /// `1 / inversesqrt(x)`
    pub(super) fn sqrt(&mut self, x: f64) -> f64 {
        if x == 0.0 || !x.is_finite() {
            return self.nearest(x.sqrt());
        }
        let inverse = self.ulps(1.0 / x.sqrt(), 2.0);
        self.div(1.0, inverse)
    }

    /// 4096 units in the last place (5 in f16).
    pub(super) fn atan(&mut self, value: f64) -> f64 {
        let count = match (self.envelope, self.width) {
            (Envelope::Nvidia, _) => 2.2,
            (Envelope::Vulkan, 16) => 5.0,
            (Envelope::Vulkan, _) => 4096.0,
        };
        self.ulps(value, count)
    }

    /// `(exp(x) + sign * exp(-x)) * 0.5`
    pub(super) fn hyperbolic(&mut self, x: f64, sign: f64) -> f64 {
        let first = if self.width == 16 { 1.0 } else { 3.0 };
        let rising = self.ulps(x.exp(), first + 2.0 * x.abs());
        let falling = self.ulps((-x).exp(), first + 2.0 * x.abs());
        let sum = self.add(rising, sign * falling);
        self.mul(sum, 0.5)
    }
}

/// The next greater f16.
fn half_up(value: half::f16) -> half::f16 {
    let bits = value.to_bits();
    half::f16::from_bits(match bits {
        0x8000 => 1,
        _ if bits & 0x8000 != 0 => bits - 1,
        _ => bits + 1,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::allowed::perturbed_result;

    fn range(name: &str, operands: [f64; 3], width: u32, envelope: Envelope) -> (f64, f64) {
        let mut random = SplitMix64(7);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for _ in 0..4000 {
            let random = &mut random;
            let mut draw = Draw { random, envelope, width, nearest: false, may_contract: true };
            let value = perturbed_result(name, operands, &mut draw).expect("a result that may move");
            (low, high) = (low.min(value), high.max(value));
        }
        (low, high)
    }

    #[test]
    fn draws_fill_what_is_allowed_and_stay_inside() {
        let ulp = f64::from(f32::EPSILON);
        // 1 + 2^-25 lies between 1 and 1 + 2^-23; exact sums stay.
        assert_eq!(range("FAdd", [1.0, 2f64.powi(-25), 0.0], 32, Envelope::Vulkan), (1.0, 1.0 + ulp));
        // So does 1 + 2^-80, which f64 rounds to 1.
        assert_eq!(range("FAdd", [1.0, 2f64.powi(-80), 0.0], 32, Envelope::Vulkan), (1.0, 1.0 + ulp));
        assert_eq!(range("FAdd", [1.0, 2.0, 0.0], 32, Envelope::Vulkan), (3.0, 3.0));
        assert_eq!(range("FAdd", [1.0, 2f64.powi(-25), 0.0], 32, Envelope::Nvidia), (1.0, 1.0));
        // 3 / 2 = 1.5: 2.5 units are 2 floats to each side.
        assert_eq!(range("FDiv", [3.0, 2.0, 0.0], 32, Envelope::Vulkan), (1.5 - 2.0 * ulp, 1.5 + 2.0 * ulp));
        // sin 0 = 0 within 2^-11, and within 3.3e-7.
        assert_eq!(range("Sin", [0.0; 3], 32, Envelope::Vulkan), (-2f64.powi(-11), 2f64.powi(-11)));
        let (low, high) = range("Sin", [0.0; 3], 32, Envelope::Nvidia);
        assert!((-3.3e-7..-3.2e-7).contains(&low) && (3.2e-7..3.3e-7).contains(&high), "{low} {high}");
        // e^2: 3 + 2 * 2 = 7 units of 2^-21.
        let (low, high) = range("Exp", [2.0, 0.0, 0.0], 32, Envelope::Vulkan);
        let unit = 2f64.powi(-21);
        assert!(2f64.exp() - low <= 7.0 * unit && high - 2f64.exp() <= 7.0 * unit);
        assert!(2f64.exp() - low > 6.0 * unit && high - 2f64.exp() > 6.0 * unit);
        // A half rounds either way.
        assert_eq!(range("Round", [2.5, 0.0, 0.0], 32, Envelope::Vulkan), (2.0, 3.0));
        // 1 + 2^-12 in f16 is a neighbour of 1.
        let half = range("FAdd", [1.0, 2f64.powi(-12), 0.0], 16, Envelope::Vulkan);
        assert_eq!(half, (1.0, 1.0 + 2f64.powi(-10)));
        // (1 + 2^-12)^2 - (1 + 2^-11) is 2^-24 fused, and 0 with a product that is rounded down,
        // 2^-23 with one that is rounded up.
        let near = 1.0 + 2f64.powi(-12);
        let fma = range("Fma", [near, near, -1.0 - 2f64.powi(-11)], 32, Envelope::Vulkan);
        assert_eq!(fma, (0.0, 2f64.powi(-23)));
    }

    #[test]
    fn correct_results_are_left_alone() {
        let mut random = SplitMix64(1);
        let mut draw = Draw {
            random: &mut random,
            envelope: Envelope::Vulkan,
            width: 32,
            nearest: false,
            may_contract: true,
        };
        for name in ["FNegate", "FAbs", "Floor", "FMin", "FOrdLessThan", "Step"] {
            assert_eq!(perturbed_result(name, [0.3, 0.4, 0.0], &mut draw), None, "{name}");
        }
    }
}
