//! The reference knows each format by its parameters alone: the value of every code by the formula
//! (-1)^s 2^(e - bias) (1 + m / 2^t), and the nearest code by counting the middles of neighbours
//! below a number. Codes, middles and the numbers near them are exact in f64.

use super::*;

/// The parameters of a format, as the papers define it.
struct ReferenceFormat {
    format: FloatFormat,
    exponent: u32,
    significand: u32,
    bias: i32,
    /// Codes of finite numbers without a sign.
    finite: u64,
    infinity: Option<u64>,
    nan: u64,
}

const FORMATS: [ReferenceFormat; 3] = [
    ReferenceFormat {
        format: FloatFormat::BFloat16,
        exponent: 8,
        significand: 7,
        bias: 127,
        finite: 0x7F80,
        infinity: Some(0x7F80),
        nan: 0x7FC0,
    },
    ReferenceFormat {
        format: FloatFormat::E4M3,
        exponent: 4,
        significand: 3,
        bias: 7,
        finite: 0x7F,
        infinity: None,
        nan: 0x7F,
    },
    ReferenceFormat {
        format: FloatFormat::E5M2,
        exponent: 5,
        significand: 2,
        bias: 15,
        finite: 0x7C,
        infinity: Some(0x7C),
        nan: 0x7E,
    },
];

impl ReferenceFormat {
    /// The number of a code without a sign, as though the exponents went on.
    fn number(&self, code: u64) -> f64 {
        let (exponent, low) = ((code >> self.significand) as i32, code & ((1 << self.significand) - 1));
        let low = low as f64 / f64::from(1u32 << self.significand);
        match exponent {
            0 => low * 2f64.powi(1 - self.bias),
            _ => (1.0 + low) * 2f64.powi(exponent - self.bias),
        }
    }

    fn sign(&self) -> u64 {
        1 << (self.exponent + self.significand)
    }

    /// The middle of a number and the next one.
    fn middle(&self, code: u64) -> f64 {
        (self.number(code) + self.number(code + 1)) / 2.0
    }

    fn nearest(&self, value: f64, saturated: bool, middles: &[f64]) -> u64 {
        if value.is_nan() {
            return self.nan;
        }
        let below = middles.partition_point(|&middle| middle < value.abs());
        // A tie belongs to the even one of two codes.
        let tie = middles.get(below).is_some_and(|&middle| middle == value.abs());
        let code = below as u64 + u64::from(tie && below % 2 == 1);
        let sign = if value.is_sign_negative() { self.sign() } else { 0 };
        match (code < self.finite, saturated) {
            (true, _) => sign | code,
            (false, true) => sign | (self.finite - 1),
            (false, false) => self.infinity.map_or(self.nan, |infinity| sign | infinity),
        }
    }
}

#[test]
fn every_code_has_the_value_of_its_formula() {
    for reference in &FORMATS {
        let mut nans = 0;
        for code in 0..reference.sign() {
            let expected = match code {
                _ if code < reference.finite => reference.number(code),
                _ if Some(code) == reference.infinity => f64::INFINITY,
                _ => f64::NAN,
            };
            let found = [code, code | reference.sign()].map(|bits| reference.format.value(bits));
            if expected.is_nan() {
                assert!(found.iter().all(|value| value.is_nan()), "{:?} {code:#x}", reference.format);
                nans += 1;
            } else {
                let expected = [expected, -expected].map(f64::to_bits);
                assert_eq!(found.map(f64::to_bits), expected, "{:?} {code:#x}", reference.format);
            }
        }
        // 2^7 - 1 significands of bfloat16, one of E4M3, three of E5M2.
        let expected =
            if reference.format == FloatFormat::E4M3 { 1 } else { (1 << reference.significand) - 1 };
        assert_eq!(nans, expected);
    }
    // The table of the paper: greatest and least numbers.
    assert_eq!([0x7E, 0x08, 0x01].map(from_e4m3), [448.0, 2f32.powi(-6), 2f32.powi(-9)]);
    assert_eq!([0x7B, 0x04, 0x01].map(from_e5m2), [57_344.0, 2f32.powi(-14), 2f32.powi(-16)]);
    assert_eq!(from_bfloat16(0x3F80), 1.0);
}

#[test]
fn every_middle_and_its_neighbours_round_to_nearest_even() {
    for reference in &FORMATS {
        let middles: Vec<f64> = (0..reference.finite).map(|code| reference.middle(code)).collect();
        let numbers = (0..reference.finite).map(|code| reference.number(code));
        let edges = [0.0, f64::from_bits(1), f64::MIN_POSITIVE, 1e300, f64::MAX, f64::INFINITY, f64::NAN];
        let edges = edges.into_iter().chain([f32::MAX.into(), f64::from(f32::MAX) + 1e22, 2f64.powi(128)]);
        let all = numbers.chain(middles.iter().copied()).chain(edges);
        // Neighbours as f64, and as f32 where it has them.
        let near = |x: f64| [x, x.next_up(), x.next_down(), f64::from((x as f32).next_up())];
        for value in all.flat_map(near).flat_map(|x| [x, -x]) {
            let expected = reference.nearest(value, false, &middles);
            let found = reference.format.round(value);
            assert_eq!(found, expected, "{:?} of {value:e}", reference.format);
            let saturated = match reference.format {
                FloatFormat::E4M3 => to_e4m3_saturated(value),
                FloatFormat::E5M2 => to_e5m2_saturated(value),
                _ => {
                    // What an f32 holds needs no rounding on the way.
                    let single = value as f32;
                    let expected = reference.nearest(single.into(), false, &middles);
                    assert_eq!(u64::from(to_bfloat16(single)), expected, "{single:e}");
                    continue;
                }
            };
            let expected = reference.nearest(value, true, &middles);
            assert_eq!(u64::from(saturated), expected, "{:?} of {value:e}, saturated", reference.format);
        }
    }
    // By hand: 464 lies in the middle of 448 and 480, and 61,440 in that of 57,344 and 65,536.
    assert_eq!([448.0, 464.0, 464.1, -500.0].map(to_e4m3), [0x7E, 0x7E, 0x7F, 0x7F]);
    assert_eq!([464.1, -500.0, f64::INFINITY].map(to_e4m3_saturated), [0x7E, 0xFE, 0x7E]);
    assert_eq!([61_439.0, 61_440.0, -1e9].map(to_e5m2), [0x7B, 0x7C, 0xFC]);
    assert_eq!([61_440.0, f64::NEG_INFINITY].map(to_e5m2_saturated), [0x7B, 0xFB]);
    // 1 + 2^-8 is a tie of bfloat16; a little more is none, though an f32 cannot tell.
    let more = 1.0 + 2f64.powi(-8) + 2f64.powi(-40);
    assert_eq!(
        [FloatFormat::BFloat16.round(1.0 + 2f64.powi(-8)), FloatFormat::BFloat16.round(more)],
        [0x3F80, 0x3F81]
    );
}

#[test]
fn formats_tell_their_parameters() {
    for reference in &FORMATS {
        let (least, greatest, significand) = reference.format.binades();
        assert_eq!(reference.format.width(), 1 + reference.exponent + reference.significand);
        assert_eq!((least, significand), (1 - reference.bias, reference.significand as i32));
        let top = reference.format.value(reference.finite - 1);
        assert!((2f64.powi(greatest)..2f64.powi(greatest + 1)).contains(&top));
    }
}
