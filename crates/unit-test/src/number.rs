//! Numbers of an expectation: their types, and how near a result must come.

use anyhit_base::count::grouped;
use anyhit_engine::math::float_format::FloatFormat;
use anyhit_engine::math::ulp;

/// A type that memory is looked at by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the names are the specification's")]
pub enum NumberType {
    F16,
    F32,
    F64,
    Bf16,
    E4m3,
    E5m2,
    U8,
    U16,
    U32,
    U64,
    I8,
    I16,
    I32,
    I64,
}

impl NumberType {
    /// The size in bytes.
    pub fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 | Self::E4m3 | Self::E5m2 => 1,
            Self::F16 | Self::Bf16 | Self::U16 | Self::I16 => 2,
            Self::F32 | Self::U32 | Self::I32 => 4,
            Self::F64 | Self::U64 | Self::I64 => 8,
        }
    }

    /// Whether it is a floating-point type.
    pub fn is_float(self) -> bool {
        self.format().is_some()
    }

    /// The format of a floating-point type.
    pub fn format(self) -> Option<FloatFormat> {
        Some(match self {
            Self::F16 => FloatFormat::Binary16,
            Self::F32 => FloatFormat::Binary32,
            Self::F64 => FloatFormat::Binary64,
            Self::Bf16 => FloatFormat::BFloat16,
            Self::E4m3 => FloatFormat::E4M3,
            Self::E5m2 => FloatFormat::E5M2,
            _ => return None,
        })
    }

    /// The bits at a byte offset, zero-extended; `None` outside the bytes.
    pub fn load(self, bytes: &[u8], offset: usize) -> Option<u64> {
        let part = bytes.get(offset..offset.checked_add(self.size())?)?;
        let mut word = [0; 8];
        word[..part.len()].copy_from_slice(part);
        Some(u64::from_le_bytes(word))
    }

    /// The value of its bits; exact for all but large 64-bit integers.
    pub fn value(self, bits: u64) -> f64 {
        if let Some(format) = self.format() {
            return format.value(bits);
        }
        match self {
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => bits as f64,
            Self::I8 => f64::from(bits as i8),
            Self::I16 => f64::from(bits as i16),
            Self::I32 => f64::from(bits as i32),
            _ => bits as i64 as f64,
        }
    }

    /// The value of its bits, where it is an integer type.
    pub(super) fn integer(self, bits: u64) -> Option<i128> {
        Some(match self {
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => bits.into(),
            Self::I8 => (bits as i8).into(),
            Self::I16 => (bits as i16).into(),
            Self::I32 => (bits as i32).into(),
            Self::I64 => (bits as i64).into(),
            _ => return None,
        })
    }

    fn is_nan(self, bits: u64) -> bool {
        self.is_float() && self.value(bits).is_nan()
    }

    /// The value as text: floats with enough digits to distinguish them, and their bits.
    fn describe(self, bits: u64) -> String {
        match self {
            Self::F16 | Self::Bf16 => format!("{} (bits {bits:#06x})", self.value(bits) as f32),
            Self::E4m3 | Self::E5m2 => format!("{} (bits {bits:#04x})", self.value(bits) as f32),
            Self::F32 => format!("{:?} (bits {bits:#010x})", f32::from_bits(bits as u32)),
            Self::F64 => format!("{:?} (bits {bits:#018x})", f64::from_bits(bits)),
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => bits.to_string(),
            Self::I8 => (bits as i8).to_string(),
            Self::I16 => (bits as i16).to_string(),
            Self::I32 => (bits as i32).to_string(),
            Self::I64 => (bits as i64).to_string(),
        }
    }

    /// Its bits as a scene file writes the number: read back they are the same.
    pub fn literal(self, bits: u64) -> String {
        if self.is_nan(bits) {
            return "nan".into();
        }
        match self {
            Self::F16 | Self::Bf16 | Self::E4m3 | Self::E5m2 => format!("{:?}", self.value(bits) as f32),
            Self::F32 => format!("{:?}", f32::from_bits(bits as u32)),
            Self::F64 => format!("{:?}", f64::from_bits(bits)),
            _ => self.describe(bits),
        }
    }
}

/// One expected number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExpectedNumber {
    /// `"any"`: whatever stands there.
    Any,
    /// A number: its bits, rounded once, and its value as an f64.
    Number(u64, f64),
}

/// How near a number must come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// Bit for bit; NaN stands for every NaN.
    Exact,
    /// In units in the last place of the binade of the expected value, which is not rounded: 0.5
    /// asks for correct rounding.
    Ulp(f64),
    /// |found - expected|
    Absolute(f64),
    /// |found - expected| / |expected|
    Relative(f64),
}

impl Tolerance {
    /// What is wrong with bits of a type where a number is expected; `None` if nothing is.
    pub fn difference(self, scalar: NumberType, expected: &ExpectedNumber, found: u64) -> Option<String> {
        let ExpectedNumber::Number(bits, exact) = *expected else { return None };
        // A number beyond the range of the type is not the infinity that it rounds to, and one that
        // is not 0 is not the 0 that it rounds to.
        let is_beyond =
            exact.is_finite() && !scalar.value(bits).is_finite() || exact != 0.0 && scalar.value(bits) == 0.0;
        if bits == found && !is_beyond || scalar.is_nan(bits) && scalar.is_nan(found) {
            return None;
        }
        let value = scalar.value(found);
        let distance = match scalar.integer(bits).zip(scalar.integer(found)) {
            Some((wanted, found)) => (found - wanted).unsigned_abs() as f64,
            None => (value - exact).abs(),
        };
        let holds = distance.is_finite()
            && match self {
                Self::Exact => false,
                Self::Absolute(bound) => distance <= bound,
                Self::Relative(bound) => distance <= bound * exact.abs(),
                // Half an ulp, judged in f64, needs a hair more.
                Self::Ulp(bound) => distance / ulp_of(scalar, exact) <= bound * (1.0 + 1e-9),
            };
        if holds {
            return None;
        }
        let away = match self {
            Self::Exact if scalar == NumberType::F32 => {
                let steps = ulp::ulps(f32::from_bits(bits as u32), f32::from_bits(found as u32));
                match steps {
                    0 if value == exact => ": zeros of opposite sign, which `absolute = 0.0` accepts".into(),
                    0 | u32::MAX => String::new(),
                    steps => format!(", {} floats away", grouped(steps)),
                }
            }
            Self::Exact => String::new(),
            Self::Ulp(bound) => {
                format!(", {:.3} ulp away (allowed: {bound})", distance / ulp_of(scalar, exact))
            }
            Self::Absolute(bound) => format!(", {distance:e} away (allowed: {bound:e})"),
            Self::Relative(bound) => {
                format!(", a relative difference of {:e} (allowed: {bound:e})", distance / exact.abs())
            }
        };
        let wanted = if is_beyond { format!("{exact:?}") } else { scalar.describe(bits) };
        Some(format!("expected {wanted}, found {}{away}", scalar.describe(found)))
    }

    /// What is wrong with an integer where an integer or a float is expected. Both are compared
    /// exactly; the unit in the last place is 1.
    pub(super) fn integer_difference(
        self,
        found: i128,
        wanted: std::result::Result<i128, f64>,
    ) -> Option<String> {
        /// Up to here every float without a fraction is an `i128`.
        const WHOLE: f64 = 1e30;
        let wanted = match wanted {
            Err(float) if float.fract() == 0.0 && float.abs() < WHOLE => Ok(float as i128),
            other => other,
        };
        let (distance, size, text) = match wanted {
            Ok(number) => ((found - number).abs() as f64, (number as f64).abs(), number.to_string()),
            Err(float) => ((found as f64 - float).abs(), float.abs(), format!("{float:?}")),
        };
        let bound = match self {
            Self::Exact => 0.0,
            Self::Absolute(bound) | Self::Ulp(bound) => bound,
            Self::Relative(bound) => bound * size,
        };
        let holds = wanted == Ok(found) || distance.is_finite() && distance <= bound;
        (!holds).then(|| format!("expected {text}, found {found}, {distance} away (allowed: {bound})"))
    }
}

/// The distance of neighbouring numbers of a type in the binade that holds a value.
fn ulp_of(scalar: NumberType, exact: f64) -> f64 {
    let exponent = |least: i32, most: i32| ((exact.abs().to_bits() >> 52) as i32 - 1023).clamp(least, most);
    match (scalar, scalar.format()) {
        (NumberType::F32, _) => ulp::ulp_of(exact),
        (_, Some(format)) => {
            let (least, greatest, significand) = format.binades();
            2f64.powi(exponent(least, greatest) - significand)
        }
        (_, None) => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(value: f32) -> ExpectedNumber {
        ExpectedNumber::Number(u64::from(value.to_bits()), f64::from(value))
    }

    fn holds(tolerance: Tolerance, expected: f32, found: f32) -> bool {
        tolerance.difference(NumberType::F32, &number(expected), u64::from(found.to_bits())).is_none()
    }

    #[test]
    fn exact_tells_zeros_apart_but_not_nans() {
        assert!(!holds(Tolerance::Exact, 0.0, -0.0));
        assert!(holds(Tolerance::Exact, f32::NAN, -f32::NAN));
        assert!(!holds(Tolerance::Exact, f32::NAN, 1.0));
        assert!(!holds(Tolerance::Exact, 1.0, 1.0 + f32::EPSILON));
        assert!(holds(Tolerance::Absolute(0.0), 0.0, -0.0));
    }

    #[test]
    fn tolerances_are_closed_bounds() {
        assert!(holds(Tolerance::Absolute(0.5), 1.0, 1.5));
        assert!(!holds(Tolerance::Absolute(0.5), 1.0, 1.5 + f32::EPSILON));
        assert!(holds(Tolerance::Relative(0.25), -4.0, -3.0));
        assert!(!holds(Tolerance::Relative(0.25), -4.0, -2.999));
        assert!(holds(Tolerance::Ulp(1.0), 1.0, 1.0 + f32::EPSILON));
        assert!(!holds(Tolerance::Ulp(1.0), 1.0, 1.0 + 2.0 * f32::EPSILON));
    }

    #[test]
    fn no_tolerance_lets_nan_or_infinity_through() {
        for tolerance in [Tolerance::Ulp(1e30), Tolerance::Absolute(1e30), Tolerance::Relative(1e30)] {
            assert!(!holds(tolerance, 1.0, f32::NAN), "{tolerance:?}");
            assert!(!holds(tolerance, 1.0, f32::INFINITY), "{tolerance:?}");
            assert!(holds(tolerance, f32::INFINITY, f32::INFINITY), "{tolerance:?}");
            assert!(!holds(tolerance, f32::INFINITY, 1.0), "{tolerance:?}");
            assert!(!holds(tolerance, f32::INFINITY, f32::NEG_INFINITY), "{tolerance:?}");
            let beyond = ExpectedNumber::Number(f32::INFINITY.to_bits().into(), 1e300);
            assert!(tolerance.difference(NumberType::F32, &beyond, f32::INFINITY.to_bits().into()).is_some());
        }
    }

    #[test]
    fn half_an_ulp_is_correct_rounding() {
        // 1/3 lies between two floats, 0x3eaaaaaa and 0x3eaaaaab, nearer to the latter.
        let third = ExpectedNumber::Number(0, 1.0 / 3.0);
        let found = |bits| Tolerance::Ulp(0.5).difference(NumberType::F32, &third, bits).is_none();
        assert!(found(0x3eaa_aaab));
        assert!(!found(0x3eaa_aaaa));
    }

    #[test]
    fn integers_are_compared_exactly() {
        let holds =
            |tolerance: Tolerance, found: i128, wanted| tolerance.integer_difference(found, wanted).is_none();
        for tolerance in
            [Tolerance::Exact, Tolerance::Absolute(0.0), Tolerance::Ulp(0.0), Tolerance::Relative(0.0)]
        {
            assert!(holds(tolerance, 7, Ok(7)) && holds(tolerance, 7, Err(7.0)));
            assert!(!holds(tolerance, 7, Err(7.999)) && !holds(tolerance, 7, Err(4_294_967_303.0)));
            assert!(!holds(tolerance, 0, Err(f64::NAN)) && !holds(tolerance, -1, Err(f64::INFINITY)));
            // 2^53 and 2^53 + 1 are one float.
            assert!(!holds(tolerance, (1 << 53) + 1, Ok(1 << 53)));
            assert!(!holds(tolerance, (1 << 53) + 1, Err(9_007_199_254_740_992.0)));
        }
        assert!(
            holds(Tolerance::Absolute(0.5), 7, Err(7.5)) && !holds(Tolerance::Absolute(0.5), 7, Err(7.75))
        );
        assert!(holds(Tolerance::Relative(0.5), -2, Ok(-4)) && !holds(Tolerance::Relative(0.5), -1, Ok(-4)));
    }

    #[test]
    fn integers_are_read_by_their_width_and_sign() {
        let bytes = [0xFF, 0xFF, 0xFE, 0xFF];
        assert_eq!(NumberType::I16.load(&bytes, 2), Some(0xFFFE));
        assert_eq!(NumberType::I16.describe(0xFFFE), "-2");
        assert_eq!(NumberType::U16.describe(0xFFFE), "65534");
        assert_eq!(NumberType::U16.load(&bytes, 3), None);
    }
}
