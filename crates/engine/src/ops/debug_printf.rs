//! Texts that shaders write: `NonSemantic.DebugPrintf` with the formats of `GL_EXT_debug_printf`,
//! and the message of `OpAbortKHR`.
//!
//! `%[flags][width][.precision][vN][h|l|ll]conversion` with the conversions d i u o x X f F e E g G
//! a A c p and s, for an `OpString`. `vN` (2 to 4) prints a
//! vector, its components parted by `, `; `l` asks for 64 bits and changes nothing, as the
//! argument's own type says how wide it is. An argument whose type does not fit the conversion is
//! converted to it.

use std::fmt::Write as _;
use std::sync::Arc;

use crate::machine::{AccessFault, Batch, Bindings, Reg, TrapCode};
use crate::ops::access::Access;

pub use translate::{abort, translate};

mod translate;

/// The name of the instruction set.
pub const SET: &str = "NonSemantic.DebugPrintf";

/// The type of an argument's components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrintScalar {
    /// `bool`
    Bool,
    /// Bits, and whether it has a sign.
    Int(u32, bool),
    /// The number of bits.
    Float(u32),
}

/// An argument.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Argument {
    /// A scalar or a vector.
    Numbers {
        /// The type of a component.
        scalar: PrintScalar,
        /// The first register of each component.
        components: Vec<Reg>,
    },
    /// An `OpString`.
    Text(Arc<str>),
    /// The registers of an array of 8-bit integers: a text in UTF-8, up to its first zero.
    Characters(Vec<Reg>),
}

/// Writes a text for each running lane.
#[derive(Clone, Debug, PartialEq)]
pub struct PrintOp {
    /// Where the text goes.
    pub output: PrintOutput,
    /// The arguments.
    pub arguments: Arc<[Argument]>,
}

/// Destination of a text.
#[derive(Clone, Debug, PartialEq)]
pub enum PrintOutput {
    /// `DebugPrintf` prints it in this format.
    Printed(Arc<str>),
    /// `OpAbortKHR` ends the invocation with it.
    Abort,
}

impl PrintOp {
    /// Returns true if the text is printed: that of an abort is not.
    pub fn prints(&self) -> bool {
        matches!(self.output, PrintOutput::Printed(_))
    }

    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        visit(Access::Effect);
        for argument in &*self.arguments {
            let words = if argument.is_wide() { 2 } else { 1 };
            argument.registers().iter().for_each(|&reg| visit(Access::Read(reg, words)));
        }
    }

    /// Runs the operation for the running lanes.
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        match &self.output {
            PrintOutput::Printed(format) => {
                let Some(printed) = &bindings.printed else { return };
                for lane in batch.mask.lanes() {
                    let mut arguments = self.arguments.iter().map(|argument| argument.values(batch, lane));
                    let launch_id = batch.invocations.launch_id(lane);
                    printed.push(bindings.printed_bytes, launch_id, || format_text(format, &mut arguments));
                }
            }
            PrintOutput::Abort => {
                for lane in batch.mask.lanes() {
                    let values = self.arguments.iter().map(|argument| argument.values(batch, lane));
                    let message = abort_message(values.collect());
                    batch.record_access_fault(lane, AccessFault::Message(message.into()));
                }
                batch.trap(batch.mask, TrapCode::Aborted, batch.op);
            }
        }
    }
}

impl Argument {
    /// The first register of each component or character.
    pub fn registers(&self) -> &[Reg] {
        match self {
            Self::Numbers { components, .. } => components,
            Self::Text(_) => &[],
            Self::Characters(registers) => registers,
        }
    }

    fn is_wide(&self) -> bool {
        matches!(self, Self::Numbers { scalar, .. } if scalar.is_wide())
    }

    fn values<const W: usize>(&self, batch: &Batch<W>, lane: usize) -> Vec<Value> {
        let word = |reg: Reg| batch.registers[reg].0[lane];
        match self {
            Self::Numbers { scalar, components } => {
                let value = |&reg: &Reg| {
                    let high = if scalar.is_wide() { word(reg.plus(1)) } else { 0 };
                    scalar.value(u64::from(word(reg)) | u64::from(high) << 32)
                };
                components.iter().map(value).collect()
            }
            Self::Text(text) => vec![Value::Text(text.clone())],
            Self::Characters(registers) => {
                let bytes = registers.iter().map(|&reg| word(reg) as u8);
                let bytes: Vec<u8> = bytes.take_while(|&byte| byte != 0).collect();
                vec![Value::Text(String::from_utf8_lossy(&bytes).into())]
            }
        }
    }
}

/// The message of an abort: the texts before the first number are the format of what follows, and
/// values that it has no place for are behind it.
fn abort_message(values: Vec<Vec<Value>>) -> String {
    let mut values = values.into_iter().peekable();
    let mut format = String::new();
    while let Some([Value::Text(text)]) = values.peek().map(Vec::as_slice) {
        format += text;
        values.next();
    }
    let mut message = match values.peek() {
        Some(_) => format_text(&format, &mut values),
        None => format,
    };
    for value in values {
        let parts: Vec<String> = value.iter().map(Value::to_string).collect();
        let separator = if message.is_empty() { "" } else { " " };
        message += separator;
        message += &match parts.len() {
            1 => parts.concat(),
            _ => format!("({})", parts.join(", ")),
        };
    }
    message
}

impl PrintScalar {
    fn is_wide(self) -> bool {
        matches!(self, Self::Int(64, _) | Self::Float(64))
    }

    fn value(self, bits: u64) -> Value {
        match self {
            Self::Bool => Value::Unsigned(bits),
            Self::Int(width, true) => Value::Signed((bits << (64 - width)) as i64 >> (64 - width), width),
            Self::Int(..) => Value::Unsigned(bits),
            Self::Float(16) => Value::Float(half::f16::from_bits(bits as u16).to_f64()),
            Self::Float(32) => Value::Float(f32::from_bits(bits as u32).into()),
            Self::Float(_) => Value::Float(f64::from_bits(bits)),
        }
    }
}

/// A number to print, a signed one with its width, for the conversions that show bits; or a text.
#[derive(Clone, Debug, PartialEq)]
enum Value {
    Signed(i64, u32),
    Unsigned(u64),
    Float(f64),
    Text(Arc<str>),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Signed(value, _) => value.fmt(f),
            Self::Unsigned(value) => value.fmt(f),
            Self::Float(value) => value.fmt(f),
            Self::Text(text) => text.fmt(f),
        }
    }
}

/// The part of a directive between `%` and the conversion.
#[derive(Clone, Copy, Debug, Default)]
struct FormatSpec {
    left: bool,
    plus: bool,
    space: bool,
    alternate: bool,
    zero: bool,
    width: usize,
    precision: Option<usize>,
}

/// The text of a format; arguments beyond the last print as `%?`.
fn format_text(format: &str, arguments: &mut impl Iterator<Item = Vec<Value>>) -> String {
    let mut text = String::new();
    let mut rest = format;
    while let Some(at) = rest.find('%') {
        text.push_str(&rest[..at]);
        rest = &rest[at + 1..];
        if let Some(after) = rest.strip_prefix('%') {
            text.push('%');
            rest = after;
            continue;
        }
        let (spec, conversion, after) = parse_directive(rest);
        rest = after;
        let values = arguments.next().unwrap_or_default();
        if values.is_empty() {
            text.push_str("%?");
        }
        for (at, value) in values.iter().enumerate() {
            if at > 0 {
                text.push_str(", ");
            }
            format_value(&mut text, spec, conversion, value);
        }
    }
    text.push_str(rest);
    text
}

/// Parses what follows a `%`: specification, conversion, and the rest of the format.
fn parse_directive(format: &str) -> (FormatSpec, char, &str) {
    let mut spec = FormatSpec::default();
    let mut rest = format;
    let number = |rest: &mut &str| {
        let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let value = rest[..digits].parse::<usize>().unwrap_or(0).min(256);
        *rest = &rest[digits..];
        value
    };
    loop {
        match rest.chars().next() {
            Some('-') => spec.left = true,
            Some('+') => spec.plus = true,
            Some(' ') => spec.space = true,
            Some('#') => spec.alternate = true,
            Some('0') => spec.zero = true,
            _ => break,
        }
        rest = &rest[1..];
    }
    spec.width = number(&mut rest);
    if let Some(after) = rest.strip_prefix('.') {
        rest = after;
        spec.precision = Some(number(&mut rest));
    }
    if let Some(after) = rest.strip_prefix('v') {
        // The number of components is that of the argument.
        rest = after.trim_start_matches(|c: char| c.is_ascii_digit());
    }
    rest = rest.trim_start_matches(['h', 'l']);
    let conversion = rest.chars().next().unwrap_or('d');
    // `%ul` is the other spelling of `%lu`.
    let rest = &rest[conversion.len_utf8().min(rest.len())..];
    let rest = if matches!(conversion, 'u' | 'd' | 'i' | 'x') {
        rest.strip_prefix('l').unwrap_or(rest)
    } else {
        rest
    };
    (spec, conversion, rest)
}

fn format_value(text: &mut String, spec: FormatSpec, conversion: char, value: &Value) {
    if let Value::Text(shown) = value {
        let shown: String = shown.chars().take(spec.precision.unwrap_or(usize::MAX)).collect();
        let width = spec.width;
        // Writing to a string does not fail.
        let _ = match spec.left {
            true => write!(text, "{shown:<width$}"),
            false => write!(text, "{shown:>width$}"),
        };
        return;
    }
    let float = match *value {
        Value::Text(_) => 0.0,
        Value::Signed(value, _) => value as f64,
        Value::Unsigned(value) => value as f64,
        Value::Float(value) => value,
    };
    let (signed, bits) = match *value {
        Value::Text(_) => (0, 0),
        Value::Signed(value, width) => (i128::from(value), value as u64 & u64::MAX >> (64 - width)),
        Value::Unsigned(value) => (i128::from(value), value),
        Value::Float(value) => (i128::from(value as i64), value as i64 as u64),
    };
    let (negative, digits) = match conversion {
        'd' | 'i' => (signed < 0, signed.unsigned_abs().to_string()),
        'u' => (false, bits.to_string()),
        'x' | 'X' | 'o' | 'p' => {
            let digits = match conversion {
                'x' | 'p' => format!("{bits:x}"),
                'X' => format!("{bits:X}"),
                _ => format!("{bits:o}"),
            };
            let prefix = match conversion {
                'p' => "0x",
                _ if !spec.alternate || bits == 0 => "",
                'x' => "0x",
                'X' => "0X",
                _ => "0",
            };
            (false, format!("{prefix}{digits}"))
        }
        'c' => (false, char::from(bits as u8).to_string()),
        _ => {
            let digits = format_magnitude(conversion.to_ascii_lowercase(), float.abs(), spec);
            let digits = if conversion.is_uppercase() { digits.to_uppercase() } else { digits };
            (float.is_sign_negative() && !float.is_nan(), digits)
        }
    };
    let is_integer = matches!(conversion, 'd' | 'i' | 'u' | 'x' | 'X' | 'o' | 'p');
    let missing = spec.precision.filter(|_| is_integer).map_or(0, |least| least.saturating_sub(digits.len()));
    let digits = "0".repeat(missing) + &digits;
    let sign = match (negative, is_integer && !matches!(conversion, 'd' | 'i')) {
        (true, _) => "-",
        (false, true) => "",
        (false, false) if spec.plus && conversion != 'c' => "+",
        (false, false) if spec.space && conversion != 'c' => " ",
        (false, false) => "",
    };
    let fill = spec.width.saturating_sub(sign.len() + digits.len());
    let zeros = spec.zero && !spec.left && float.is_finite() && !(is_integer && spec.precision.is_some());
    let _ = match (spec.left, zeros) {
        (true, _) => write!(text, "{sign}{digits}{}", " ".repeat(fill)),
        (false, true) => write!(text, "{sign}{}{digits}", "0".repeat(fill)),
        (false, false) => write!(text, "{}{sign}{digits}", " ".repeat(fill)),
    };
}

/// A float without its sign, as C's conversions write it.
fn format_magnitude(conversion: char, value: f64, spec: FormatSpec) -> String {
    if value.is_nan() {
        return "nan".to_owned();
    }
    if value.is_infinite() {
        return "inf".to_owned();
    }
    let precision = spec.precision.unwrap_or(6);
    match conversion {
        'e' => scientific(value, precision),
        'g' => {
            let precision = precision.max(1);
            let exponent: i32 = scientific(value, precision - 1)
                .split_once('e')
                .and_then(|(_, exponent)| exponent.parse().ok())
                .unwrap_or(0);
            let fixed = exponent >= -4 && exponent < precision as i32;
            let digits = match fixed {
                true => format!("{value:.*}", (precision as i32 - 1 - exponent) as usize),
                false => scientific(value, precision - 1),
            };
            if spec.alternate {
                return digits;
            }
            let (mantissa, tail) = digits.split_at(digits.find('e').unwrap_or(digits.len()));
            let mantissa = match mantissa.contains('.') {
                true => mantissa.trim_end_matches('0').trim_end_matches('.'),
                false => mantissa,
            };
            format!("{mantissa}{tail}")
        }
        'a' => hexadecimal(value, spec.precision),
        _ => format!("{value:.precision$}"),
    }
}

/// `1.500000e+00`: at least two digits of exponent, with its sign.
fn scientific(value: f64, precision: usize) -> String {
    let text = format!("{value:.precision$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{mantissa}e{sign}{:02}", exponent.unsigned_abs())
}

/// `0x1.8p+0`: exact where no precision is asked for, else rounded to nearest even.
fn hexadecimal(value: f64, precision: Option<usize>) -> String {
    let bits = value.to_bits();
    let (exponent, mut fraction) = ((bits >> 52) as i32, bits & ((1 << 52) - 1));
    let (mut lead, exponent) = match (exponent, fraction) {
        (0, 0) => (0, 0),
        (0, _) => (0, -1022),
        _ => (1, exponent - 1023),
    };
    let mut digits = 13;
    if let Some(kept) = precision.filter(|&kept| kept < 13) {
        let cut = 4 * (13 - kept as u32);
        let whole = lead << 52 | fraction;
        let (down, rest, half) = (whole >> cut, whole & ((1 << cut) - 1), 1u64 << (cut - 1));
        let rounded = down + u64::from(rest > half || rest == half && down & 1 == 1);
        lead = rounded >> (52 - cut);
        fraction = rounded & ((1u64 << (52 - cut)) - 1);
        digits = kept;
    }
    let text = if digits == 0 { String::new() } else { format!("{fraction:0digits$x}") };
    let text = match precision {
        Some(count) => format!("{text:0<count$}"),
        None => text.trim_end_matches('0').to_owned(),
    };
    let point = if text.is_empty() { "" } else { "." };
    format!("0x{lead}{point}{text}p{exponent:+}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_aborts_have_a_format_and_a_rest() {
        let text = |text: &str| vec![Value::Text(text.into())];
        let seven = vec![Value::Unsigned(7)];
        let pair = vec![Value::Float(0.5), Value::Float(-2.0)];
        for (values, expected) in [
            (vec![], ""),
            (vec![text("50% of 3")], "50% of 3"),
            // The example of SPV_KHR_abort: two strings and a value.
            (vec![text("test: "), text("%u"), seven.clone()], "test: 7"),
            (vec![text("%v2f, %u"), pair.clone(), seven.clone()], "0.500000, -2.000000, 7"),
            (vec![text("count"), seven.clone(), pair.clone()], "count 7 (0.5, -2)"),
            (vec![seven.clone(), text("%u")], "7 %u"),
            (vec![text("%u of %u"), seven.clone()], "7 of %?"),
        ] {
            assert_eq!(abort_message(values), expected);
        }
    }

    fn print(format: &str, value: Value) -> String {
        format_text(format, &mut [vec![value]].into_iter())
    }

    #[test]
    fn integers() {
        // The output of C's printf, by its definition (ISO C 7.23.6.1).
        assert_eq!(print("[%d]", Value::Signed(-5, 32)), "[-5]");
        assert_eq!(print("%5d|", Value::Signed(42, 32)), "   42|");
        assert_eq!(print("%-5d|", Value::Signed(42, 32)), "42   |");
        assert_eq!(print("%05d", Value::Signed(-42, 32)), "-0042");
        assert_eq!(print("%+d", Value::Signed(42, 32)), "+42");
        assert_eq!(print("%.4d", Value::Signed(42, 32)), "0042");
        assert_eq!(print("%u", Value::Signed(-1, 32)), "4294967295");
        assert_eq!(print("%x", Value::Unsigned(0xABC)), "abc");
        assert_eq!(print("%#X", Value::Unsigned(0xABC)), "0XABC");
        assert_eq!(print("%o", Value::Unsigned(8)), "10");
        assert_eq!(print("%lu", Value::Unsigned(u64::MAX)), "18446744073709551615");
        assert_eq!(print("%ul!", Value::Unsigned(7)), "7!");
        assert_eq!(print("%lx", Value::Unsigned(1 << 40)), "10000000000");
        assert_eq!(print("100%% %i", Value::Signed(1, 32)), "100% 1");
    }

    #[test]
    fn floats() {
        assert_eq!(print("%f", Value::Float(1.5)), "1.500000");
        assert_eq!(print("%.2f", Value::Float(-0.125)), "-0.12"); // ties to even
        assert_eq!(print("%8.3f", Value::Float(3.25)), "   3.250");
        assert_eq!(print("%e", Value::Float(12345.678)), "1.234568e+04");
        assert_eq!(print("%.1E", Value::Float(0.00025)), "2.5E-04");
        assert_eq!(print("%g", Value::Float(0.0001)), "0.0001");
        assert_eq!(print("%g", Value::Float(100000.0)), "100000");
        assert_eq!(print("%g", Value::Float(1000000.0)), "1e+06");
        assert_eq!(print("%g", Value::Float(0.00001)), "1e-05");
        assert_eq!(print("%a", Value::Float(1.5)), "0x1.8p+0");
        assert_eq!(print("%.1a", Value::Float(1.96875)), "0x2.0p+0");
        assert_eq!(print("%A", Value::Float(0.1)), "0X1.999999999999AP-4");
        assert_eq!(print("%f", Value::Float(f64::NEG_INFINITY)), "-inf");
        assert_eq!(print("%F", Value::Float(f64::NAN)), "NAN");
        assert_eq!(print("%05.1f", Value::Float(-2.0)), "-02.0");
    }

    #[test]
    fn strings_and_addresses() {
        let shown = || Value::Text("abc".into());
        assert_eq!(print("<%s>", shown()), "<abc>");
        assert_eq!(print("<%5s>", shown()), "<  abc>");
        assert_eq!(print("<%-5.2s>", shown()), "<ab   >");
        assert_eq!(print("%p", Value::Unsigned(0x1_0000_0010)), "0x100000010");
    }

    #[test]
    fn vectors_and_missing_arguments() {
        let mut arguments =
            [vec![Value::Float(1.0), Value::Float(2.5)], vec![Value::Unsigned(3)]].into_iter();
        assert_eq!(format_text("v = %1.1v2f, n = %d, %d", &mut arguments), "v = 1.0, 2.5, n = 3, %?");
    }
}
