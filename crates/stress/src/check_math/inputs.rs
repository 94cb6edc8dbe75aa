//! The inputs: all of a format, every n-th, or pairs near boundaries.

use std::fmt;

use crate::check_math::CheckMathSettings;
use crate::check_math::float_width::FloatWidth;
use crate::check_math::function::CheckedFunction;

/// The inputs of one function, by number.
#[derive(Debug)]
pub struct Inputs {
    format: FloatWidth,
    count: u64,
    kind: InputKind,
}

#[derive(Debug)]
enum InputKind {
    /// Input n is `n * stride + first`; of two operands, both in one number.
    Every { stride: u64, first: u64 },
    /// Input n is drawn by a generator that is seeded with n.
    Drawn { seed: u64, pairs: bool },
}

impl Inputs {
    /// The inputs of a function.
    pub fn of(function: &CheckedFunction, format: FloatWidth, settings: &CheckMathSettings) -> Self {
        let pairs = function.operands() == 2;
        let bits = format.width() * if pairs { 2 } else { 1 };
        let stride = match (format, pairs) {
            // All numbers of f16 are few enough to test at any stride.
            (FloatWidth::Half, false) => 1,
            _ => settings.stride.max(1),
        };
        if bits <= 32 {
            let first = settings.seed % stride;
            let count = ((1u64 << bits) - first).div_ceil(stride);
            return Self { format, count, kind: InputKind::Every { stride, first } };
        }
        let count = if format == FloatWidth::Double { settings.samples } else { settings.pairs };
        Self { format, count, kind: InputKind::Drawn { seed: settings.seed, pairs } }
    }

    /// How many there are.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The bits of the operands of an input.
    #[inline]
    pub fn at(&self, number: u64) -> [u64; 2] {
        match self.kind {
            InputKind::Every { stride, first } => {
                let bits = number * stride + first;
                match self.format {
                    FloatWidth::Half => [bits & 0xFFFF, bits >> 16],
                    _ => [bits, 0],
                }
            }
            InputKind::Drawn { seed, pairs } => {
                let mut draw = Draw { format: self.format, state: splitmix64(splitmix64(seed) ^ number) };
                if pairs { draw.pair(number) } else { [draw.number(), 0] }
            }
        }
    }
}

impl fmt::Display for Inputs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            InputKind::Every { stride: 1, .. } => f.write_str("all"),
            InputKind::Every { stride, first } => write!(f, "every {stride}th from {first} on"),
            InputKind::Drawn { seed, .. } => write!(f, "random, seed {seed}"),
        }
    }
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014).
fn splitmix64(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Draws floats where functions break.
struct Draw {
    format: FloatWidth,
    state: u64,
}

/// Numbers that matter to some function, and small integers and their halves.
const EDGES: [f64; 32] = [
    0.0,
    1.0,
    2.0,
    3.0,
    4.0,
    5.0,
    7.0,
    8.0,
    9.0,
    10.0,
    0.5,
    0.25,
    0.75,
    1.5,
    2.5,
    1.0 / 3.0,
    std::f64::consts::PI,
    std::f64::consts::FRAC_PI_2,
    std::f64::consts::FRAC_PI_4,
    std::f64::consts::E,
    std::f64::consts::LN_2,
    std::f64::consts::SQRT_2,
    24.0,
    126.0,
    127.0,
    128.0,
    149.0,
    88.722_84,
    103.972_08,
    16_777_215.0,
    16_777_217.0,
    f64::INFINITY,
];

impl Draw {
    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        splitmix64(self.state)
    }

    fn below(&mut self, count: u64) -> u64 {
        self.bits() % count
    }

    fn mask(&self) -> u64 {
        u64::MAX >> (64 - self.format.width())
    }

    /// Any bits, a number of moderate size, or an edge and its neighbours.
    fn number(&mut self) -> u64 {
        match self.below(4) {
            0 => self.bits() & self.mask(),
            1 => self.edge(),
            _ => self.moderate(20),
        }
    }

    /// A number within some powers of two of 1.
    fn moderate(&mut self, reach: u64) -> u64 {
        let exponent = self.below(2 * reach + 1) as i32 - reach as i32;
        let fraction = (self.bits() >> 11) as f64 / (1u64 << 53) as f64;
        let value = (1.0 + fraction) * 2f64.powi(exponent);
        let value = if self.below(2) == 0 { value } else { -value };
        self.format.bits_of(value)
    }

    fn edge(&mut self) -> u64 {
        let steps = self.below(9) as i64 - 4;
        let steps = if self.below(2) == 0 { 0 } else { steps };
        let sign = self.below(2) << (self.format.width() - 1);
        let magnitude = match self.below(4) {
            // The ends of the denormals and of all numbers.
            0 => [0, 1, self.format.bits_of(1.0) / 127, self.format.infinity() - 1][self.below(4) as usize],
            _ => self.format.bits_of(EDGES[self.below(EDGES.len() as u64) as usize]),
        };
        sign | magnitude.saturating_add_signed(steps) & (self.mask() >> 1)
    }

    /// Two numbers; the family follows from the input's number.
    fn pair(&mut self, number: u64) -> [u64; 2] {
        let format = self.format;
        match number % 8 {
            0 => [self.bits() & self.mask(), self.bits() & self.mask()],
            1 => [self.edge(), self.edge()],
            2 => [self.edge(), self.number()],
            3 => [self.number(), self.edge()],
            // Near one to a large power: the result is of moderate size.
            4 => {
                let steps = self.below(1 << 12) as i64 - (1 << 11);
                let near = format.bits_of(1.0).wrapping_add_signed(steps);
                let size = -(format.value(near).ln().abs().max(1e-300)).log2();
                let exponent = size + self.below(12) as f64 - 5.0;
                let fraction = 1.0 + (self.bits() >> 40) as f64 / (1u64 << 24) as f64;
                let power = fraction * 2f64.powf(exponent.floor());
                [near, format.bits_of(if self.below(2) == 0 { power } else { -power })]
            }
            // A short significand to a small integer or half of one: exact powers, and ties.
            5 => {
                let base = (1 + self.below(1 << 13)) as f64 * 2f64.powi(self.below(40) as i32 - 26);
                let power = (self.below(33) as f64 - 8.0) / [1.0, 1.0, 2.0, 4.0][self.below(4) as usize];
                [format.bits_of(base), format.bits_of(power)]
            }
            // Results near the ends of the range: 2^t with t near 128, -126 or -150.
            6 => {
                let base = self.moderate(30) & (self.mask() >> 1);
                let ends: [f64; 3] = match format {
                    FloatWidth::Double => [1024.0, -1022.0, -1075.0],
                    _ => [128.0, -126.0, -150.0],
                };
                let end = ends[self.below(3) as usize] + (self.below(4001) as f64 - 2000.0) / 1000.0;
                let logarithm = format.value(base).log2();
                [base, format.bits_of(if logarithm == 0.0 { 1.0 } else { end / logarithm })]
            }
            // Both of moderate size.
            _ => [self.moderate(8), self.moderate(6)],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check_math::function::FUNCTIONS;

    const SETTINGS: CheckMathSettings = CheckMathSettings { stride: 3, pairs: 1000, samples: 10, seed: 7 };

    #[test]
    fn a_stride_begins_where_the_seed_says_and_reaches_the_end() {
        let sin = FUNCTIONS.iter().find(|function| function.name == "Sin").unwrap();
        let inputs = Inputs::of(sin, FloatWidth::Single, &SETTINGS);
        // 1, 4, ... 2^32 - 3
        assert_eq!([inputs.at(0)[0], inputs.at(inputs.count() - 1)[0]], [1, (1 << 32) - 3]);
        assert_eq!(Inputs::of(sin, FloatWidth::Half, &SETTINGS).count(), 1 << 16);
    }

    #[test]
    fn pairs_are_the_same_for_a_seed_and_reach_all_kinds() {
        let pow = FUNCTIONS.iter().find(|function| function.name == "Pow").unwrap();
        let inputs = Inputs::of(pow, FloatWidth::Single, &SETTINGS);
        assert_eq!(inputs.count(), 1000);
        let again = Inputs::of(pow, FloatWidth::Single, &SETTINGS);
        let mut kinds = [0; 5];
        for number in 0..1000 {
            assert_eq!(inputs.at(number), again.at(number));
            let [a, b] = inputs.at(number).map(|bits| f32::from_bits(bits as u32));
            let value = f64::from(a).powf(b.into()).abs();
            let kind = match value {
                _ if value.is_nan() => 0,
                _ if value > f64::from(f32::MAX) => 1,
                _ if value < f64::from(f32::MIN_POSITIVE) => 2,
                1.0 => 3,
                _ => 4,
            };
            kinds[kind] += 1;
        }
        assert!(kinds.iter().all(|&count| count > 10), "{kinds:?}");
    }
}
