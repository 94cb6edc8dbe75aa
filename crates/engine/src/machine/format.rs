//! Texel formats: how numbers lie in a texel's bits, and the conversions from and to them.
//!
//! Conversions follow Vulkan, "Fixed-Point Data Conversion", "Floating-Point Format Conversions"
//! and "Shared Exponent to RGB". Where these leave a choice, this crate rounds to nearest even (a
//! half to the even neighbour), takes NaN to 0 in fixed-point formats, overflows of 16-,
//! 11- and 10-bit floats to infinity, and clamps integers that a format cannot hold to its range.

use std::sync::LazyLock;

use half::f16;

use crate::math::array;
use crate::math::srgb;
use anyhit_base::error::{Error, ErrorKind, Result};

/// How a component is stored; the packed kinds describe all components of a texel at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Component {
    /// 8 bits, 0 to 1.
    Unorm8,
    /// 8 bits, -1 to 1.
    Snorm8,
    /// 16 bits, 0 to 1.
    Unorm16,
    /// 16 bits, -1 to 1.
    Snorm16,
    /// 16 bits, binary16 of IEEE 754.
    Float16,
    /// 32 bits, binary32 of IEEE 754.
    Float32,
    /// 8 bits, unsigned integer.
    Uint8,
    /// 8 bits, signed integer.
    Sint8,
    /// 16 bits, unsigned integer.
    Uint16,
    /// 16 bits, signed integer.
    Sint16,
    /// 32 bits, unsigned integer.
    Uint32,
    /// 32 bits, signed integer.
    Sint32,
    /// 64 bits, unsigned integer.
    Uint64,
    /// 64 bits, signed integer.
    Sint64,
    /// 10 bits each for R (lowest), G, B, and 2 for A, 0 to 1 (`A2B10G10R10_UNORM_PACK32`).
    Unorm10A2,
    /// 10 bits each for R (lowest), G, B, and 2 for A, unsigned integers
    /// (`A2B10G10R10_UINT_PACK32`).
    Uint10A2,
    /// Unsigned floats of 11 bits for R (lowest) and G, 10 for B (`B10G11R11_UFLOAT_PACK32`).
    Float11B10,
    /// 9 bits each for R (lowest), G, B, and one exponent of 5 (`E5B9G9R9_UFLOAT_PACK32`).
    SharedExponent,
}

/// The class of numbers that a shader reads from a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Class {
    /// A float, binary32 of IEEE 754.
    Float,
    /// Signed integers.
    Sint,
    /// Unsigned integers.
    Uint,
}

/// A texel format: one kind of component, one to four times, in the order R G B A.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use]
pub struct Format {
    /// The kind of every component.
    pub component: Component,
    /// The number of channels, 1 to 4.
    pub channels: u8,
    /// Whether R, G and B are stored sRGB-encoded; `Unorm8` only.
    pub srgb: bool,
}

impl Format {
    /// Four channels of binary32.
    pub const RGBA32F: Self = Self::new(Component::Float32, 4);
    /// Four channels of 8 bits, sRGB-encoded.
    pub const RGBA8_SRGB: Self = Self { component: Component::Unorm8, channels: 4, srgb: true };

    /// GLSL's names of image formats in small letters; `srgb8_alpha8` as in OpenGL.
    #[doc(hidden)]
    pub const NAMED: &'static [(&'static str, Self)] = {
        use Component::*;
        &[
            ("r8", Self::new(Unorm8, 1)),
            ("rg8", Self::new(Unorm8, 2)),
            ("rgba8", Self::new(Unorm8, 4)),
            ("rgba8_srgb", Self { component: Unorm8, channels: 4, srgb: true }),
            ("r8_snorm", Self::new(Snorm8, 1)),
            ("rg8_snorm", Self::new(Snorm8, 2)),
            ("rgba8_snorm", Self::new(Snorm8, 4)),
            ("r16", Self::new(Unorm16, 1)),
            ("rg16", Self::new(Unorm16, 2)),
            ("rgba16", Self::new(Unorm16, 4)),
            ("r16_snorm", Self::new(Snorm16, 1)),
            ("rg16_snorm", Self::new(Snorm16, 2)),
            ("rgba16_snorm", Self::new(Snorm16, 4)),
            ("r16f", Self::new(Float16, 1)),
            ("rg16f", Self::new(Float16, 2)),
            ("rgba16f", Self::new(Float16, 4)),
            ("r32f", Self::new(Float32, 1)),
            ("rg32f", Self::new(Float32, 2)),
            ("rgba32f", Self::new(Float32, 4)),
            ("r8ui", Self::new(Uint8, 1)),
            ("rg8ui", Self::new(Uint8, 2)),
            ("rgba8ui", Self::new(Uint8, 4)),
            ("r8i", Self::new(Sint8, 1)),
            ("rg8i", Self::new(Sint8, 2)),
            ("rgba8i", Self::new(Sint8, 4)),
            ("r16ui", Self::new(Uint16, 1)),
            ("rg16ui", Self::new(Uint16, 2)),
            ("rgba16ui", Self::new(Uint16, 4)),
            ("r16i", Self::new(Sint16, 1)),
            ("rg16i", Self::new(Sint16, 2)),
            ("rgba16i", Self::new(Sint16, 4)),
            ("r32ui", Self::new(Uint32, 1)),
            ("rg32ui", Self::new(Uint32, 2)),
            ("rgba32ui", Self::new(Uint32, 4)),
            ("r32i", Self::new(Sint32, 1)),
            ("rg32i", Self::new(Sint32, 2)),
            ("rgba32i", Self::new(Sint32, 4)),
            ("r64ui", Self::new(Uint64, 1)),
            ("r64i", Self::new(Sint64, 1)),
            ("rgb10_a2", Self::new(Unorm10A2, 4)),
            ("rgb10_a2ui", Self::new(Uint10A2, 4)),
            ("r11f_g11f_b10f", Self::new(Float11B10, 3)),
            ("rgb9_e5", Self::new(SharedExponent, 3)),
        ]
    };

    /// The name of the format in scenes.
    #[doc(hidden)]
    pub fn name(self) -> &'static str {
        let named = Self::NAMED.iter().find(|(_, known)| *known == self);
        named.map_or("a format without a name", |(name, _)| name)
    }

    /// A format of linear components.
    #[must_use]
    pub const fn new(component: Component, channels: u8) -> Self {
        Self { component, channels, srgb: false }
    }

    /// Checks that texels of the format exist.
    ///
    /// # Errors
    /// `InvalidArgument` with the channels that the component has, and for sRGB of another one.
    #[doc(hidden)]
    pub fn check(self) -> Result<()> {
        use Component::*;
        let channels: &[u8] = match self.component {
            Unorm10A2 | Uint10A2 => &[4],
            Float11B10 | SharedExponent => &[3],
            Uint64 | Sint64 => &[1],
            _ => &[1, 2, 4],
        };
        let wrong = |message, note: String| Err(Error::new(ErrorKind::InvalidArgument, message).note(note));
        let Self { component, channels: given, srgb } = self;
        if !channels.contains(&given) {
            let all: Vec<String> = channels.iter().map(u8::to_string).collect();
            let all = match &all[..] {
                [rest @ .., last] if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
                _ => all.join(""),
            };
            let message = format!("no format has {given} channels of `Component::{component:?}`");
            return wrong(
                message,
                format!("write `Format::new(Component::{component:?}, N)`, where N is {all}"),
            );
        }
        if srgb && component != Unorm8 {
            let message = format!("no format stores `Component::{component:?}` sRGB-encoded");
            return wrong(message, "set `srgb` to false, or write `Format::RGBA8_SRGB`".to_owned());
        }
        Ok(())
    }

    /// The format with a number of SPIR-V's "Image Format"; `None` for `Unknown` (0) and beyond.
    #[doc(hidden)]
    pub fn declared(number: u32) -> Option<Self> {
        use Component::*;
        const FORMATS: [Format; 41] = [
            Format::new(Float32, 4),
            Format::new(Float16, 4),
            Format::new(Float32, 1),
            Format::new(Unorm8, 4),
            Format::new(Snorm8, 4),
            Format::new(Float32, 2),
            Format::new(Float16, 2),
            Format::new(Float11B10, 3),
            Format::new(Float16, 1),
            Format::new(Unorm16, 4),
            Format::new(Unorm10A2, 4),
            Format::new(Unorm16, 2),
            Format::new(Unorm8, 2),
            Format::new(Unorm16, 1),
            Format::new(Unorm8, 1),
            Format::new(Snorm16, 4),
            Format::new(Snorm16, 2),
            Format::new(Snorm8, 2),
            Format::new(Snorm16, 1),
            Format::new(Snorm8, 1),
            Format::new(Sint32, 4),
            Format::new(Sint16, 4),
            Format::new(Sint8, 4),
            Format::new(Sint32, 1),
            Format::new(Sint32, 2),
            Format::new(Sint16, 2),
            Format::new(Sint8, 2),
            Format::new(Sint16, 1),
            Format::new(Sint8, 1),
            Format::new(Uint32, 4),
            Format::new(Uint16, 4),
            Format::new(Uint8, 4),
            Format::new(Uint32, 1),
            Format::new(Uint10A2, 4),
            Format::new(Uint32, 2),
            Format::new(Uint16, 2),
            Format::new(Uint8, 2),
            Format::new(Uint16, 1),
            Format::new(Uint8, 1),
            Format::new(Uint64, 1),
            Format::new(Sint64, 1),
        ];
        FORMATS.get((number as usize).checked_sub(1)?).copied()
    }

    /// Bytes of one texel: 1, 2, 4, 8 or 16.
    #[must_use]
    pub fn texel_size(self) -> u32 {
        use Component::*;
        let channels = u32::from(self.channels);
        match self.component {
            Unorm8 | Snorm8 | Uint8 | Sint8 => channels,
            Unorm16 | Snorm16 | Float16 | Uint16 | Sint16 => 2 * channels,
            Float32 | Uint32 | Sint32 => 4 * channels,
            Uint64 | Sint64 => 8 * channels,
            Unorm10A2 | Uint10A2 | Float11B10 | SharedExponent => 4,
        }
    }

    /// The class of numbers that a shader reads from it.
    #[doc(hidden)]
    pub fn class(self) -> Class {
        use Component::*;
        match self.component {
            Uint8 | Uint16 | Uint32 | Uint64 | Uint10A2 => Class::Uint,
            Sint8 | Sint16 | Sint32 | Sint64 => Class::Sint,
            _ => Class::Float,
        }
    }

    /// Whether it is an unsigned normalized fixed-point format.
    #[doc(hidden)]
    pub fn is_unorm(self) -> bool {
        matches!(self.component, Component::Unorm8 | Component::Unorm16 | Component::Unorm10A2)
    }

    /// Returns true if its components are floats, shared exponents included.
    #[doc(hidden)]
    pub fn is_float(self) -> bool {
        use Component::{Float11B10, Float16, Float32, SharedExponent};
        matches!(self.component, Float16 | Float32 | Float11B10 | SharedExponent)
    }

    /// Whether its integers have 64 bits.
    #[doc(hidden)]
    pub fn is_wide(self) -> bool {
        matches!(self.component, Component::Uint64 | Component::Sint64)
    }

    /// The components of a texel as a shader sees them, from its bits.
    ///
    /// Floats are the bits of a binary32; integers are extended to 64 bits by their sign.
    /// Components that the format lacks are 0, a lacking A is 1 ("Conversion to RGBA").
    #[doc(hidden)]
    pub fn decode(self, bits: u128) -> [u64; 4] {
        let one = self.one();
        let mut texel = [0, 0, 0, one];
        for (channel, to) in texel.iter_mut().enumerate().take(usize::from(self.channels)) {
            *to = match self.component {
                Component::SharedExponent => shared_exponent_component(bits as u32, channel),
                _ if self.srgb && channel < 3 => u64::from(SRGB[(bits >> (8 * channel)) as usize & 0xff]),
                component => {
                    let (shift, width) = self.field(channel);
                    decode_component(component, (bits >> shift) as u64 & (u64::MAX >> (64 - width)), width)
                }
            };
        }
        texel
    }

    /// The bits of a texel, from components as a shader writes them: floats as the bits of a
    /// binary32, integers extended to 64 bits, signed ones by their sign.
    #[doc(hidden)]
    pub fn encode(self, texel: [u64; 4], signed: bool) -> u128 {
        if self.class() == Class::Float {
            let floats = array::map(texel, |bits| f32::from_bits(bits as u32));
            // The bits are kept: a conversion would quieten a signalling NaN.
            if self.component == Component::Float32 {
                return self.join(array::map(texel, |bits| bits & 0xffff_ffff));
            }
            return self.encode_numbers(array::map(floats, f64::from));
        }
        self.join(array::map(texel, |bits| {
            let value = if signed { i128::from(bits as i64) } else { i128::from(bits) };
            let (least, most) = integer_range(self.component);
            value.clamp(least, most) as u64
        }))
    }

    /// The bits of the texel nearest to four numbers, each rounded once; integers saturate.
    #[doc(hidden)]
    pub fn encode_numbers(self, color: [f64; 4]) -> u128 {
        if self.component == Component::SharedExponent {
            return u128::from(shared_exponent(color));
        }
        let mut parts = [0; 4];
        for (channel, (part, value)) in parts.iter_mut().zip(color).enumerate() {
            *part = match self.srgb && channel < 3 {
                true => srgb::code(value).into(),
                false => encode_number(self.component, self.field(channel).1, value),
            };
        }
        self.join(parts)
    }

    /// Four numbers from a texel's bits, as [`Format::decode`] gives them.
    #[doc(hidden)]
    pub fn decode_numbers(self, bits: u128) -> [f64; 4] {
        array::map(self.decode(bits), |part| match self.class() {
            Class::Float => f64::from(f32::from_bits(part as u32)),
            Class::Sint => part as i64 as f64,
            Class::Uint => part as f64,
        })
    }

    /// One in this format's class.
    #[doc(hidden)]
    pub fn one(self) -> u64 {
        if self.class() == Class::Float { u64::from(1f32.to_bits()) } else { 1 }
    }

    /// Where a channel's bits lie: shift and width.
    fn field(self, channel: usize) -> (u32, u32) {
        match self.component {
            Component::Unorm10A2 | Component::Uint10A2 => {
                (10 * channel as u32, if channel == 3 { 2 } else { 10 })
            }
            Component::Float11B10 => (11 * channel as u32, if channel == 2 { 10 } else { 11 }),
            _ => {
                let width = 8 * self.texel_size() / u32::from(self.channels);
                (width * channel as u32, width)
            }
        }
    }

    fn join(self, parts: [u64; 4]) -> u128 {
        let mut bits = 0;
        for (channel, part) in parts.into_iter().enumerate().take(usize::from(self.channels)) {
            let (shift, width) = self.field(channel);
            bits |= u128::from(part & (u64::MAX >> (64 - width))) << shift;
        }
        bits
    }
}

/// Linear binary32 bits of each sRGB code.
static SRGB: LazyLock<[u32; 256]> =
    LazyLock::new(|| array::from_fn(|code| (srgb::to_linear(code as f64 / 255.0) as f32).to_bits()));

fn decode_component(component: Component, bits: u64, width: u32) -> u64 {
    use Component::*;
    let float = |value: f32| u64::from(value.to_bits());
    let signed = (bits << (64 - width)) as i64 >> (64 - width);
    match component {
        Unorm8 | Unorm16 | Unorm10A2 => float(bits as f32 / (u64::MAX >> (64 - width)) as f32),
        Snorm8 | Snorm16 => float((signed as f32 / (u64::MAX >> (65 - width)) as f32).max(-1.0)),
        Float16 => float(f16::from_bits(bits as u16).to_f32()),
        // Eleven and ten bits are the upper bits of a binary16 without its sign.
        Float11B10 => float(f16::from_bits((bits << (15 - width)) as u16).to_f32()),
        Float32 | Uint8 | Uint16 | Uint32 | Uint64 | Uint10A2 => bits,
        Sint8 | Sint16 | Sint32 | Sint64 => signed as u64,
        SharedExponent => unreachable!("bug in anyhit: a shared exponent is used as a component"),
    }
}

/// A number as a component's bits, which may need masking to `width`.
fn encode_number(component: Component, width: u32, value: f64) -> u64 {
    use Component::*;
    let number = if value.is_nan() { 0.0 } else { value };
    match component {
        Unorm8 | Unorm16 | Unorm10A2 => {
            let most = (u64::MAX >> (64 - width)) as f64;
            (number.clamp(0.0, 1.0) * most).round_ties_even() as u64
        }
        Snorm8 | Snorm16 => {
            let most = (u64::MAX >> (65 - width)) as f64;
            (number.clamp(-1.0, 1.0) * most).round_ties_even() as i64 as u64
        }
        Float16 => u64::from(crate::math::float::f64_to_f16(value).to_bits()),
        Float32 => u64::from((value as f32).to_bits()),
        Float11B10 => unsigned_float(value, width - 5),
        // `as` saturates.
        Uint64 => number as u64,
        Sint64 => number as i64 as u64,
        Uint8 | Sint8 | Uint16 | Sint16 | Uint32 | Sint32 | Uint10A2 => {
            let (least, most) = integer_range(component);
            let most = if width == 2 { 3 } else { most };
            (number as i128).clamp(least, most) as u64
        }
        SharedExponent => unreachable!("bug in anyhit: a shared exponent is used as a component"),
    }
}

/// The range of an integer component.
fn integer_range(component: Component) -> (i128, i128) {
    let signed = |width: u32| (-(1 << (width - 1)), (1 << (width - 1)) - 1);
    match component {
        Component::Sint8 => signed(8),
        Component::Sint16 => signed(16),
        Component::Sint32 => signed(32),
        Component::Sint64 => signed(64),
        Component::Uint8 => (0, 0xff),
        Component::Uint16 => (0, 0xffff),
        Component::Uint10A2 => (0, 0x3ff),
        Component::Uint64 => (0, u64::MAX.into()),
        _ => (0, u32::MAX.into()),
    }
}

/// A float without sign: five bits of exponent, `mantissa` bits behind it; negative numbers are 0.
fn unsigned_float(value: f64, mantissa: u32) -> u64 {
    let infinity = 31 << mantissa;
    if value.is_nan() {
        return infinity | 1 << (mantissa - 1);
    }
    if value <= 0.0 {
        return 0;
    }
    if value.is_infinite() {
        return infinity;
    }
    let exponent = ((value.to_bits() >> 52) as i32 - 1023).max(-14);
    let quantum = f64::from_bits(((exponent - mantissa as i32 + 1023) as u64) << 52);
    // The hidden bit, and a carry out of the rounding, count into the exponent.
    let bits = (((exponent + 14) as u64) << mantissa) + (value / quantum).round_ties_even() as u64;
    bits.min(infinity)
}

const SHARED_BITS: i32 = 9;
const SHARED_BIAS: i32 = 15;

/// "RGB to Shared Exponent Conversion".
fn shared_exponent(color: [f64; 4]) -> u32 {
    let power = |exponent: i32| f64::from_bits(((exponent + 1023) as u64) << 52);
    // (2^9 - 1) / 2^9 * 2^16
    let clamped = |value: f64| if value > 0.0 { value.min(65_408.0) } else { 0.0 };
    let [red, green, blue, _] = array::map(color, clamped);
    let most = red.max(green).max(blue);
    let floor_log2 = (most.to_bits() >> 52) as i32 - 1023;
    let mut exponent = if most > power(-SHARED_BIAS - 1) { floor_log2 + SHARED_BIAS + 1 } else { 0 };
    let part =
        |value: f64, exponent: i32| (value / power(exponent - SHARED_BIAS - SHARED_BITS) + 0.5).floor();
    if part(most, exponent) >= 512.0 {
        exponent += 1;
    }
    let [red, green, blue] = array::map([red, green, blue], |value| part(value, exponent) as u32);
    red | green << 9 | blue << 18 | (exponent as u32) << 27
}

/// "Shared Exponent to RGB".
fn shared_exponent_component(bits: u32, channel: usize) -> u64 {
    let exponent = (bits >> 27) as i32 - SHARED_BIAS - SHARED_BITS;
    let part = (bits >> (9 * channel) & 0x1ff) as f32;
    u64::from((part * f32::from_bits(((exponent + 127) as u32) << 23)).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;
    use Component::*;

    fn encode(component: Component, value: f32) -> u128 {
        Format::new(component, 1).encode([u64::from(value.to_bits()), 0, 0, 0], false)
    }

    fn decode(component: Component, bits: u128) -> f32 {
        f32::from_bits(Format::new(component, 1).decode(bits)[0] as u32)
    }

    #[test]
    fn unorm_rounds_to_the_even_neighbour_and_clamps() {
        // 0.5 * 255 = 127.5 and 0.5 * 65535 = 32767.5 are ties: both go to the even neighbour.
        assert_eq!(encode(Unorm8, 0.5), 128);
        assert_eq!(encode(Unorm16, 0.5), 32_768);
        // 2^-9 * 255 = 0.498, 3 * 2^-9 * 255 = 1.494, 2.5 / 255 rounded up to binary32 is above the
        // tie.
        assert_eq!([2f32.powi(-9), 3.0 * 2f32.powi(-9)].map(|x| encode(Unorm8, x)), [0, 1]);
        assert_eq!([-0.0, -1.0, f32::NEG_INFINITY, f32::NAN].map(|x| encode(Unorm8, x)), [0; 4]);
        assert_eq!([1.0, 2.0, f32::INFINITY].map(|x| encode(Unorm16, x)), [0xffff; 3]);
        assert_eq!(decode(Unorm8, 255), 1.0);
        // 51 / 255 = 1 / 5
        assert_eq!(decode(Unorm8, 51), 0.2);
        assert_eq!(decode(Unorm16, 13_107), 0.2);
    }

    #[test]
    fn snorm_has_two_codes_for_minus_one() {
        // 0.5 * 127 = 63.5: to the even 64; -0.5 to -64.
        assert_eq!([0.5, -0.5, -2.0, 1.0, f32::NAN].map(|x| encode(Snorm8, x)), [64, 0xc0, 0x81, 127, 0]);
        assert_eq!([0x80, 0x81, 0x7f, 0].map(|bits| decode(Snorm8, bits)), [-1.0, -1.0, 1.0, 0.0]);
        assert_eq!([-1.0, 0.5].map(|x| encode(Snorm16, x)), [0x8001, 16_384]);
        assert_eq!([0x8000, 0x8001].map(|bits| decode(Snorm16, bits)), [-1.0, -1.0]);
    }

    #[test]
    fn halves_round_to_even_and_overflow_to_infinity() {
        // 1 + 2^-11 lies between 1 and 1 + 2^-10; 65520 between 65504 and 2^16.
        assert_eq!(encode(Float16, 1.0 + 2f32.powi(-11)), 0x3c00);
        assert_eq!(encode(Float16, 1.0 + 3.0 * 2f32.powi(-11)), 0x3c02);
        assert_eq!([65_519.0, 65_520.0].map(|x| encode(Float16, x)), [0x7bff, 0x7c00]);
        // The least subnormal is 2^-24; half of it is a tie to 0.
        assert_eq!([2f32.powi(-24), 2f32.powi(-25), -0.0].map(|x| encode(Float16, x)), [1, 0, 0x8000]);
        assert_eq!(decode(Float16, 1), 2f32.powi(-24));
        assert!(decode(Float16, 0x7e00).is_nan());
    }

    #[test]
    fn singles_keep_all_their_bits() {
        let texel = [0x7f80_0001, 0x8000_0000, 1, 0xffc0_0000];
        assert_eq!(Format::RGBA32F.decode(Format::RGBA32F.encode(texel, false)), texel);
    }

    #[test]
    fn integers_clamp_to_their_format() {
        let encode =
            |component, value: i64, signed| Format::new(component, 1).encode([value as u64, 0, 0, 0], signed);
        assert_eq!(encode(Uint8, 256, false), 255);
        assert_eq!(encode(Uint8, -1, true), 0);
        assert_eq!(encode(Sint8, -129, true), 0x80);
        assert_eq!(encode(Sint8, 128, true), 0x7f);
        assert_eq!(encode(Sint32, 0xffff_ffff, false), 0x7fff_ffff);
        assert_eq!(encode(Uint64, -1, false), u64::MAX.into());
        assert_eq!(Format::new(Sint16, 2).decode(0x7fff_8000)[..2], [-32_768i64 as u64, 32_767]);
        assert_eq!(Format::new(Sint16, 2).decode(0)[2..], [0, 1]);
        assert_eq!(Format::new(Uint8, 1).encode_numbers([300.0, 0., 0., 0.]), 255);
        assert_eq!(Format::new(Sint64, 1).encode_numbers([f64::NEG_INFINITY, 0., 0., 0.]), 1 << 63);
    }

    #[test]
    fn ten_bits_and_two() {
        let unorm = Format::new(Unorm10A2, 4);
        assert_eq!(unorm.texel_size(), 4);
        // 0.5 * 1023 = 511.5: to 512; 0.5 * 3 = 1.5: to 2.
        let bits = unorm.encode_numbers([1.0, 0.5, 0.0, 0.5]);
        assert_eq!(bits, 1023 | 512 << 10 | 2 << 30);
        assert_eq!(unorm.decode_numbers(bits)[3], f64::from(2f32 / 3.0));
        let uint = Format::new(Uint10A2, 4);
        assert_eq!(uint.encode([2000, 5, 1023, 1], false), 1023 | 5 << 10 | 1023 << 20 | 1 << 30);
        assert_eq!(uint.encode_numbers([2000., 5., 0., 9.]), 1023 | 5 << 10 | 3 << 30);
        assert_eq!(uint.decode(0xffff_ffff), [1023, 1023, 1023, 3]);
    }

    #[test]
    fn unsigned_floats_of_eleven_and_ten_bits() {
        let format = Format::new(Float11B10, 3);
        // 1.0: exponent 15, mantissa 0.
        assert_eq!(format.encode_numbers([1.0, 0.0, 1.0, 0.0]), 15 << 6 | (15 << 5) << 22);
        // 1 + 2^-7 is a tie between 1 and 1 + 2^-6; 1 + 3 * 2^-7 between odd 1 and even 2.
        let red = |value: f64| format.encode_numbers([value, 0.0, 0.0, 0.0]);
        assert_eq!([1.0 + 2f64.powi(-7), 1.0 + 3.0 * 2f64.powi(-7)].map(red), [15 << 6, 15 << 6 | 2]);
        // A carry into the exponent: 2 - 2^-8 is nearer to 2 than to 2 - 2^-6.
        assert_eq!(red(2.0 - 2f64.powi(-8)), 16 << 6);
        // Largest finite 65024, its tie with 2^16 is 65280; the least subnormal is 2^-20.
        assert_eq!([65_024.0, 65_279.0, 65_280.0, f64::INFINITY].map(red), [0x7bf, 0x7bf, 0x7c0, 0x7c0]);
        assert_eq!([2f64.powi(-20), 2f64.powi(-21), -1.0, f64::NEG_INFINITY].map(red), [1, 0, 0, 0]);
        assert!(format.decode_numbers(red(f64::NAN))[0].is_nan());
        assert_eq!(
            format.decode_numbers(1 | 0x7bf << 11 | 1 << 22),
            [2f64.powi(-20), 65_024.0, 2f64.powi(-19), 1.0]
        );
    }

    #[test]
    fn a_shared_exponent_suits_the_largest_component() {
        let format = Format::new(SharedExponent, 3);
        // max 1: exponent floor(log2 1) + 16 = 16, quantum 2^(16 - 24) = 2^-8.
        assert_eq!(
            format.encode_numbers([1.0, 0.5, 2f64.powi(-9), 0.0]),
            256 | 128 << 9 | 1 << 18 | 16 << 27
        );
        // 511.5 / 512 would round to 512 at exponent 15: one more.
        assert_eq!(format.encode_numbers([511.75 / 512.0, 0.0, 0.0, 0.0]), 256 | 16 << 27);
        assert_eq!(format.encode_numbers([1e9, -1.0, f64::NAN, 0.0]), 511 | 31 << 27);
        assert_eq!(format.decode_numbers(511 | 31 << 27), [65_408.0, 0.0, 0.0, 1.0]);
        assert_eq!(format.decode_numbers(1), [2f64.powi(-24), 0.0, 0.0, 1.0]);
    }

    #[test]
    fn srgb_codes_are_the_nearest_floats_to_the_curve() {
        for code in 0..=255u32 {
            let bits = Format::RGBA8_SRGB.decode(u128::from(code));
            // f64 is right to far better than this, so no tie of binary32 lies between it and the
            // truth.
            let wide = srgb::to_linear(f64::from(code) / 255.0);
            let float = f32::from_bits(bits[0] as u32);
            let step = f64::from(float.next_up()) - f64::from(float);
            assert!((wide - f64::from(float)).abs() <= 0.5 * step, "{code}");
            assert!(((wide - f64::from(float)).abs() / step - 0.5).abs() > 1e-6, "{code} is near a tie");
            let mut texel = bits;
            texel[3] = u64::from(1f32.to_bits());
            assert_eq!(Format::RGBA8_SRGB.encode(texel, false), u128::from(code | 0xff00_0000));
        }
        // Alpha is linear: 0.5 * 255 = 127.5.
        assert_eq!(Format::RGBA8_SRGB.encode_numbers([0.0, 0.0, 0.0, 0.5]), 128 << 24);
    }
}
