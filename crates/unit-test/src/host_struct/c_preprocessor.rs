//! The part of C's preprocessor on which layouts depend: conditions, macros without parameters, and
//! `#pragma pack`. Files are not included.

use std::cell::Cell;
use std::collections::HashMap;

use crate::host_struct::c_tokens::{Token, tokens};
use crate::host_struct::source_file::{MAX_DEPTH, SourceFile};
use anyhit_base::error::{Error, ErrorKind, Result};

/// Tokens that macros may expand to.
const MAX_TOKENS: usize = 4_000_000;

/// A token behind the preprocessor, with the packing in force.
#[derive(Clone, Debug)]
pub(super) struct PackedToken {
    pub(super) token: Token,
    /// The largest alignment of a member, of `#pragma pack`.
    pub(super) pack: Option<usize>,
}

/// One `#if`.
struct Condition {
    is_active: bool,
    /// A branch before was taken, or the condition around is not active.
    is_done: bool,
}

/// Runs the preprocessor over a file. `__cplusplus` is defined.
///
/// # Errors
/// `InvalidSource` at a directive that makes no sense.
pub(super) fn preprocess(file: &SourceFile) -> Result<Vec<PackedToken>> {
    let all = tokens(&file.text);
    let mut macros: HashMap<String, Option<Vec<Token>>> = HashMap::new();
    macros.insert("__cplusplus".into(), Some(tokens("202002L")));
    let mut conditions: Vec<Condition> = Vec::new();
    let (mut pack, mut stack) = (None, Vec::new());
    let mut out = Vec::new();
    let mut budget = MAX_TOKENS;
    let mut at = 0;
    while let Some(token) = all.get(at) {
        let is_active = conditions.iter().all(|condition| condition.is_active);
        if !(token.is("#") && token.starts_line) {
            at += 1;
            if is_active {
                expand(token, &macros, 0, &mut budget, &mut |token| out.push(PackedToken { token, pack }));
                if budget == 0 {
                    return Err(error(file, token, "macros expand to too much text"));
                }
            }
            continue;
        }
        let count = all[at + 1..].iter().take_while(|token| !token.starts_line).count();
        let line = &all[at + 1..at + 1 + count];
        at += 1 + count;
        let [directive, rest @ ..] = line else { continue };
        let evaluate = |tokens: &[Token]| {
            let steps = Cell::new(MAX_TOKENS);
            let value = Evaluator { tokens, at: 0, macros: &macros, steps: &steps }.whole();
            value.ok_or_else(|| error(file, directive, "this condition cannot be evaluated"))
        };
        let is_defined = || rest.first().is_some_and(|name| macros.contains_key(&name.text));
        match directive.text.as_str() {
            "if" | "ifdef" | "ifndef" => {
                let holds = is_active
                    && match directive.text.as_str() {
                        "if" => evaluate(rest)? != 0,
                        "ifdef" => is_defined(),
                        _ => !is_defined(),
                    };
                conditions.push(Condition { is_active: holds, is_done: holds || !is_active });
            }
            "elif" | "else" | "elifdef" | "elifndef" => {
                let Some(condition) = conditions.last_mut() else {
                    return Err(error(file, directive, "no `#if` precedes it"));
                };
                let holds = !condition.is_done
                    && match directive.text.as_str() {
                        "elif" => evaluate(rest)? != 0,
                        "elifdef" => is_defined(),
                        "elifndef" => !is_defined(),
                        _ => true,
                    };
                condition.is_active = holds;
                condition.is_done |= holds;
            }
            "endif" => {
                let without_if = || error(file, directive, "no `#if` precedes it");
                conditions.pop().ok_or_else(without_if)?;
            }
            _ if !is_active => {}
            "define" => {
                if let [name, body @ ..] = rest {
                    // A parenthesis that touches the name begins parameters.
                    let has_parameters =
                        body.first().is_some_and(|token| token.is("(") && token.span.start == name.span.end);
                    macros.insert(name.text.clone(), (!has_parameters).then(|| body.to_vec()));
                }
            }
            "undef" => {
                if let [name, ..] = rest {
                    macros.remove(&name.text);
                }
            }
            "pragma" if rest.first().is_some_and(|token| token.is("pack")) => {
                let words: Vec<&str> = rest.iter().map(|token| token.text.as_str()).collect();
                let number = words.iter().find_map(|word| word.parse::<usize>().ok());
                if number.is_some_and(|number| !number.is_power_of_two() || number > 16) {
                    return Err(error(file, directive, "`#pragma pack` requires 1, 2, 4, 8 or 16"));
                }
                if words.contains(&"push") {
                    stack.push(pack);
                    pack = number.or(pack);
                } else if words.contains(&"pop") {
                    pack = stack.pop().unwrap_or_default();
                } else {
                    pack = number;
                }
            }
            _ => {}
        }
    }
    Ok(out)
}

/// Replaces a macro by its text, of so many tokens at most.
fn expand(
    token: &Token,
    macros: &HashMap<String, Option<Vec<Token>>>,
    depth: usize,
    budget: &mut usize,
    out: &mut dyn FnMut(Token),
) {
    if *budget == 0 {
        return;
    }
    *budget -= 1;
    match macros.get(&token.text) {
        Some(Some(body)) if depth < 16 => {
            for part in body.iter().filter(|part| part.text != token.text) {
                // Errors show where the macro is used.
                let part = Token { span: token.span.clone(), ..part.clone() };
                expand(&part, macros, depth + 1, budget, out);
            }
        }
        _ => out(token.clone()),
    }
}

fn error(file: &SourceFile, token: &Token, message: &str) -> Error {
    Error::new(ErrorKind::InvalidSource, message).at(file.place(token.span.clone()))
}

/// A number of C, with its suffix: `16`, `0x10u`, `1'000`.
pub(super) fn number(text: &str) -> Option<i64> {
    let text = text.replace('\'', "");
    let digits = text.trim_end_matches(['u', 'U', 'l', 'L', 'z', 'Z']);
    let lower = digits.to_ascii_lowercase();
    if let Some(digits) = lower.strip_prefix("0x") {
        return i64::from_str_radix(digits, 16).ok();
    }
    if let Some(digits) = lower.strip_prefix("0b") {
        return i64::from_str_radix(digits, 2).ok();
    }
    match lower.strip_prefix('0') {
        Some(digits) if !digits.is_empty() => i64::from_str_radix(digits, 8).ok(),
        _ => lower.parse().ok(),
    }
}

/// Binary operators with their precedence, from 1.
const OPERATORS: &[(&str, u8)] = &[
    ("||", 1),
    ("&&", 2),
    ("|", 3),
    ("^", 4),
    ("&", 5),
    ("==", 6),
    ("!=", 6),
    ("<", 7),
    (">", 7),
    ("<=", 7),
    (">=", 7),
    ("<<", 8),
    (">>", 8),
    ("+", 9),
    ("-", 9),
    ("*", 10),
    ("/", 10),
    ("%", 10),
];

/// Applies an operator; `None` where the result is not defined.
pub(super) fn apply(operator: &str, a: i64, b: i64) -> Option<i64> {
    let shift = || u32::try_from(b).ok();
    Some(match operator {
        "||" => i64::from(a != 0 || b != 0),
        "&&" => i64::from(a != 0 && b != 0),
        "|" => a | b,
        "^" => a ^ b,
        "&" => a & b,
        "==" => i64::from(a == b),
        "!=" => i64::from(a != b),
        "<" => i64::from(a < b),
        ">" => i64::from(a > b),
        "<=" => i64::from(a <= b),
        ">=" => i64::from(a >= b),
        "<<" => a.checked_shl(shift()?)?,
        ">>" => a.checked_shr(shift()?)?,
        "+" => a.checked_add(b)?,
        "-" => a.checked_sub(b)?,
        "*" => a.checked_mul(b)?,
        "/" => a.checked_div(b)?,
        "%" => a.checked_rem(b)?,
        _ => return None,
    })
}

/// The precedence of a binary operator.
pub(super) fn precedence(operator: &str) -> Option<u8> {
    OPERATORS.iter().find(|(text, _)| *text == operator).map(|(_, precedence)| *precedence)
}

/// The condition of an `#if`; names that are not defined are 0.
struct Evaluator<'a> {
    tokens: &'a [Token],
    at: usize,
    macros: &'a HashMap<String, Option<Vec<Token>>>,
    /// Macros that repeat others could take forever.
    steps: &'a Cell<usize>,
}

impl Evaluator<'_> {
    fn whole(mut self) -> Option<i64> {
        let value = self.binary(1, 0)?;
        (self.at == self.tokens.len()).then_some(value)
    }

    fn next(&mut self) -> Option<&str> {
        let token = self.tokens.get(self.at)?;
        self.at += 1;
        Some(&token.text)
    }

    fn binary(&mut self, least: u8, depth: usize) -> Option<i64> {
        let mut value = self.unary(depth)?;
        while let Some(token) = self.tokens.get(self.at) {
            let operator = token.text.clone();
            let Some(strength) = precedence(&operator).filter(|strength| *strength >= least) else { break };
            self.at += 1;
            let right = self.binary(strength + 1, depth + 1)?;
            value = apply(&operator, value, right)?;
        }
        Some(value)
    }

    fn unary(&mut self, depth: usize) -> Option<i64> {
        self.steps.set(self.steps.get().checked_sub(1)?);
        if depth > MAX_DEPTH {
            return None;
        }
        match self.next()? {
            "!" => self.unary(depth + 1).map(|value| i64::from(value == 0)),
            "-" => self.unary(depth + 1)?.checked_neg(),
            "+" => self.unary(depth + 1),
            "~" => self.unary(depth + 1).map(|value| !value),
            "(" => {
                let value = self.binary(1, depth + 1)?;
                (self.next()? == ")").then_some(value)
            }
            "defined" => {
                let mut name = self.next()?.to_owned();
                if name == "(" {
                    name = self.next()?.to_owned();
                    if self.next()? != ")" {
                        return None;
                    }
                }
                Some(i64::from(self.macros.contains_key(&name)))
            }
            text if text.starts_with(|letter: char| letter.is_ascii_digit()) => number(text),
            name => {
                let name = name.to_owned();
                let body = self.macros.get(&name);
                // `__has_include(<x>)` and the like: not known, so 0.
                if !matches!(body, Some(Some(_)))
                    && self.tokens.get(self.at).is_some_and(|token| token.is("("))
                {
                    let mut open = 0;
                    while let Some(token) = self.next() {
                        open += i32::from(token == "(") - i32::from(token == ")");
                        if open == 0 {
                            break;
                        }
                    }
                    return Some(0);
                }
                match body {
                    Some(Some(body)) if depth < MAX_DEPTH && !body.is_empty() => {
                        Evaluator { tokens: body, at: 0, ..*self }.binary(1, depth + 8)
                    }
                    _ => Some(0),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(text: &str) -> String {
        let file = SourceFile { name: "a.h".into(), text: text.into() };
        let all = preprocess(&file).expect("a file");
        let text = |one: PackedToken| match one.pack {
            Some(pack) => format!("{}@{pack}", one.token.text),
            None => one.token.text,
        };
        all.into_iter().map(text).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn conditions_macros_and_packing() {
        assert_eq!(run("#ifdef __cplusplus\na\n#else\nb\n#endif\nc"), "a c");
        assert_eq!(run("#define N 2 + 1\n#if N == 3 && !defined(M)\nx N\n#elif 1\ny\n#endif"), "x 2 + 1");
        assert_eq!(run("#if 0\n#if 1\na\n#else\nb\n#endif\n#else\nc\n#endif"), "c");
        assert_eq!(run("#define F(x) x\n#define A B\n#define B A\nF A"), "F A");
        assert_eq!(run("#pragma pack(push, 1)\na\n#pragma pack(pop)\nb"), "a@1 b");
        assert_eq!(run("#if __has_include(<glm/glm.hpp>) || UNKNOWN\na\n#endif\nb"), "b");
    }

    #[test]
    fn mistakes_are_errors() {
        for text in ["#endif", "#else", "#if 1 +\n#endif", "#pragma pack(3)", "#if 1 / 0\n#endif"] {
            let file = SourceFile { name: "a.h".into(), text: text.into() };
            assert_eq!(preprocess(&file).map(|_| ()).unwrap_err().kind(), ErrorKind::InvalidSource, "{text}");
        }
    }

    #[test]
    fn numbers_have_bases_and_suffixes() {
        for (text, value) in [("16", 16), ("0x1Fu", 31), ("1'000", 1000), ("010", 8), ("0b101", 5), ("0", 0)]
        {
            assert_eq!(number(text), Some(value), "{text}");
        }
        assert_eq!(number("1.0f"), None);
    }
}
