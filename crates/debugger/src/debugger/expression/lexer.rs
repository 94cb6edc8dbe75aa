//! Splits an expression into tokens.

use crate::debugger::expression::error::ExpressionError;
use crate::debugger::expression::numbers::{CalculatedValue, ScalarType};

/// A token and the column where it begins.
#[derive(Clone, Debug)]
pub(super) struct Token {
    pub(super) column: usize,
    pub(super) kind: TokenKind,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum TokenKind {
    Name(String),
    Number(CalculatedValue),
    /// An operator or a bracket.
    Mark(&'static str),
    End,
}

impl TokenKind {
    /// The token in an error.
    pub(super) fn describe(&self) -> String {
        match self {
            Self::Name(name) => format!("`{name}`"),
            Self::Number(_) => "a number".into(),
            Self::Mark(mark) => format!("`{mark}`"),
            Self::End => "the end".into(),
        }
    }
}

/// Operators and brackets; of those that begin alike, the longest first.
const MARKS: &[&str] = &[
    "<<", ">>", "<=", ">=", "==", "!=", "&&", "||", "->", "::", "+", "-", "*", "/", "%", "<", ">", "!", "&",
    "|", "^", "~", "?", ":", "(", ")", "[", "]", ".", ",",
];

/// The tokens of an expression; the last one is the end.
pub(super) fn tokens(text: &str) -> Result<Vec<Token>, ExpressionError> {
    let mut tokens = Vec::new();
    let mut rest = text;
    loop {
        rest = rest.trim_start();
        let column = text[..text.len() - rest.len()].chars().count() + 1;
        let mut push = |kind| tokens.push(Token { column, kind });
        let Some(first) = rest.chars().next() else {
            push(TokenKind::End);
            return Ok(tokens);
        };
        let is_fraction = first == '.' && rest[1..].starts_with(|next: char| next.is_ascii_digit());
        rest = if first.is_ascii_digit() || is_fraction {
            let (number, rest) = number(rest).map_err(|message| ExpressionError::new(column, message))?;
            push(TokenKind::Number(number));
            rest
        } else if first.is_alphabetic() || first == '_' || first == '$' {
            let is_name = |next: char| next.is_alphanumeric() || next == '_' || next == '$';
            let end = rest.find(|next| !is_name(next)).unwrap_or(rest.len());
            push(TokenKind::Name(rest[..end].to_owned()));
            &rest[end..]
        } else if let Some(mark) = MARKS.iter().find(|mark| rest.starts_with(**mark)) {
            push(TokenKind::Mark(mark));
            &rest[mark.len()..]
        } else {
            let message = match first {
                '=' => "an expression cannot assign; `==` compares".to_owned(),
                _ => format!("unexpected `{first}`"),
            };
            return Err(ExpressionError::new(column, message));
        };
    }
}

/// Reads a number with its suffix; returns the text behind it.
fn number(text: &str) -> Result<(CalculatedValue, &str), String> {
    let hexadecimal = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    if let Some(digits) = hexadecimal {
        let end = digits.find(|next: char| !next.is_ascii_hexdigit()).unwrap_or(digits.len());
        let (digits, rest) = digits.split_at(end);
        let bits = u64::from_str_radix(digits, 16).map_err(|_| "a hexadecimal number exceeds 64 bits")?;
        return integer(bits, rest, true);
    }
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let mut end = digits(text);
    let mut is_float = false;
    if text[end..].starts_with('.')
        && !text[end + 1..].starts_with(|next: char| "xyzwrgbastpq".contains(next))
    {
        is_float = true;
        end += 1 + digits(&text[end + 1..]);
    }
    if text[end..].starts_with(['e', 'E']) {
        let sign = usize::from(text[end + 1..].starts_with(['+', '-']));
        let exponent = digits(&text[end + 1 + sign..]);
        if exponent > 0 {
            is_float = true;
            end += 1 + sign + exponent;
        }
    }
    let (digits, rest) = text.split_at(end);
    let is_float = is_float || rest.starts_with(['f', 'F', 'h', 'H']);
    if !is_float {
        let bits = digits.parse().map_err(|_| "a number exceeds 64 bits")?;
        return integer(bits, rest, false);
    }
    let end = rest.find(|next: char| !next.is_ascii_alphanumeric()).unwrap_or(rest.len());
    let (suffix, rest) = rest.split_at(end);
    let number = match suffix {
        "" | "f" | "F" => digits
            .parse()
            .map(|value: f32| CalculatedValue::scalar(ScalarType::Float(32), value.to_bits().into())),
        "lf" | "LF" | "l" | "L" => {
            digits.parse().map(|value: f64| CalculatedValue::scalar(ScalarType::Float(64), value.to_bits()))
        }
        "h" | "H" | "hf" | "HF" => {
            let half = digits.parse().map(half::f16::from_f64);
            half.map(|value| CalculatedValue::scalar(ScalarType::Float(16), value.to_bits().into()))
        }
        _ => return Err(format!("`{suffix}` is not a suffix of floats")),
    };
    Ok((number.map_err(|_| format!("`{digits}` is not a number"))?, rest))
}

/// An integer with a suffix: `u`, `l`, `ul`.
fn integer(bits: u64, text: &str, is_hexadecimal: bool) -> Result<(CalculatedValue, &str), String> {
    let end = text.find(|next: char| !(next.is_ascii_alphanumeric() || next == '_')).unwrap_or(text.len());
    let (suffix, rest) = text.split_at(end);
    let (signed, width) = match suffix.to_ascii_lowercase().as_str() {
        "" => (true, 32),
        "u" => (false, 32),
        "l" | "ll" => (true, 64),
        "ul" | "ull" | "lu" => (false, 64),
        _ => return Err(format!("`{suffix}` is not a suffix of integers")),
    };
    // Hexadecimal literals are bit patterns (GLSL 4.60, 4.1.3); decimal ones that an int does not
    // hold are taken as wider ones.
    let width = if bits > u32::MAX.into() { 64 } else { width };
    let beyond = bits > u64::from(u32::MAX) >> 1 && width == 32 && !is_hexadecimal;
    let ty = match (signed, beyond) {
        (true, true) => ScalarType::Uint(32),
        (true, false) => ScalarType::Int(width),
        (false, _) => ScalarType::Uint(width),
    };
    Ok((CalculatedValue::scalar(ty, bits), rest))
}
