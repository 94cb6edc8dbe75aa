//! Floats taken apart into mantissa and exponent, and put together.

/// The exponent of a float.
pub(super) trait Exponent: Sized {
    /// The mantissa, within 0.5 and 1, and the exponent of 2; zeros, infinities and NaNs stay.
    fn frexp(self) -> (Self, i32);
    /// `self * 2^exponent`, rounded once.
    fn ldexp(self, exponent: i32) -> Self;
}

macro_rules! exponent {
    ($ty:ty, $bits:ty, $mantissa:literal, $bias:literal, $mask:literal) => {
        impl Exponent for $ty {
            #[inline(never)]
            fn frexp(self) -> (Self, i32) {
                if self == 0.0 || !self.is_finite() {
                    return (self, 0);
                }
                // A denormal is scaled into the normal range first; the product is exact.
                let scale = (1u64 << ($mantissa + 1)) as $ty;
                let denormal = self.abs() < <$ty>::MIN_POSITIVE;
                let (normal, shift) = if denormal { (self * scale, $mantissa + 1) } else { (self, 0) };
                let bits = normal.to_bits();
                let exponent = (bits >> $mantissa & $mask) as i32 - ($bias - 1) - shift;
                let bits = bits & !(($mask as $bits) << $mantissa) | (($bias - 1) as $bits) << $mantissa;
                (<$ty>::from_bits(bits), exponent)
            }
            #[inline(never)]
            fn ldexp(self, exponent: i32) -> Self {
                // Only the last of the steps can round: the others stay exact or saturate.
                let (mantissa, own) = self.frexp();
                if self == 0.0 || !self.is_finite() {
                    return self;
                }
                let sum = (i64::from(own) + i64::from(exponent)).clamp(-4096, 4096) as i32;
                let power = |e: i32| <$ty>::from_bits(((e + $bias) as $bits) << $mantissa);
                let (low, high) = (2 - $bias, $bias);
                if sum > high {
                    mantissa * power(high) * power((sum - high).min(high))
                } else if sum >= low {
                    mantissa * power(sum)
                } else {
                    // One rounding: the scaled mantissa is exact until the last product.
                    let rest = (sum - low).max(low);
                    mantissa * power(rest) * power(low)
                }
            }
        }
    };
}

exponent!(f32, u32, 23, 127, 0xFF);
exponent!(f64, u64, 52, 1023, 0x7FF);
