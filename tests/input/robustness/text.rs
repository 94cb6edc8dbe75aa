//! Changes to texts: TOML, JSON, OBJ, WGSL, command lines. A text is cut into words, numbers,
//! strings, marks and spaces; most changes keep that structure.

use crate::support::mutate::Random;

/// Numbers at which readers go wrong.
const NUMBERS: &[&str] = &[
    "0",
    "1",
    "-1",
    "2",
    "3",
    "4",
    "7",
    "8",
    "16",
    "31",
    "32",
    "33",
    "64",
    "127",
    "128",
    "255",
    "256",
    "1024",
    "32768",
    "65535",
    "65536",
    "1000000",
    "2147483647",
    "2147483648",
    "-2147483648",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551615",
    "1e9",
    "1e38",
    "1e39",
    "1e308",
    "1e400",
    "-1e400",
    "1e-45",
    "1e-320",
    "0.5",
    "-0.0",
    "0.1",
    "3.4028235e38",
    "nan",
    "inf",
    "-inf",
    "0x7fffffff",
    "0b1",
    "1_000",
    "5126",
    "5125",
    "5123",
    "5121",
];

/// Words that stand for a value of a kind.
const VALUES: &[&str] = &["true", "false", "null", "[]", "{}", "\"\"", "[[]]", "\"a\"", "[0, 0, 0]"];

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Word,
    Number,
    Text,
    Mark,
    Space,
}

/// A text's tokens; together they are the text.
fn tokens(text: &str) -> Vec<(Kind, &str)> {
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let is_word = |one: char| one.is_alphanumeric() || one == '_';
        let (kind, length) = match first {
            '"' => {
                let inside = rest[1..].find(['"', '\n']).map_or(rest.len(), |at| at + 2);
                (Kind::Text, inside.min(rest.len()))
            }
            '0'..='9' => {
                let end = rest.find(|one: char| !(is_word(one) || one == '.')).unwrap_or(rest.len());
                (Kind::Number, end)
            }
            _ if is_word(first) => (Kind::Word, rest.find(|one| !is_word(one)).unwrap_or(rest.len())),
            _ if first.is_whitespace() => {
                (Kind::Space, rest.find(|one: char| !one.is_whitespace()).unwrap_or(rest.len()))
            }
            _ => (Kind::Mark, first.len_utf8()),
        };
        let (token, behind) = rest.split_at(length);
        tokens.push((kind, token));
        rest = behind;
    }
    tokens
}

/// A text with one to four changes; `other` is one of its like, from which parts are taken.
pub fn mutant(text: &str, other: &str, random: &mut Random) -> String {
    let mut text = text.to_owned();
    for _ in 0..[1, 1, 1, 2, 2, 3, 4][random.below(7)] {
        text = change(&text, other, random);
    }
    text
}

fn change(text: &str, other: &str, random: &mut Random) -> String {
    match random.below(20) {
        0..=2 => lines(text, other, random),
        3 => nested(text, random),
        4 => {
            // Bytes of any kind, which may be no UTF-8 before the lossy reading.
            let mut bytes = text.as_bytes().to_vec();
            super::binary::change(&mut bytes, other.as_bytes(), random);
            String::from_utf8_lossy(&bytes).into_owned()
        }
        _ => token(text, other, random),
    }
}

/// A change of lines: dropped, doubled, swapped, taken from the other text.
fn lines(text: &str, other: &str, random: &mut Random) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    let others: Vec<&str> = other.lines().collect();
    let at = random.below(lines.len().max(1)).min(lines.len().saturating_sub(1));
    match random.below(4) {
        0 if !lines.is_empty() => {
            lines.remove(at);
        }
        1 if !lines.is_empty() => lines.insert(at, lines[at]),
        2 if lines.len() > 1 => {
            let to = random.below(lines.len());
            lines.swap(at, to);
        }
        _ => {
            // Up to a table of the other text.
            let from = random.below(others.len().max(1));
            let some = others.iter().skip(from).take(1 + random.below(8));
            let end = at.min(lines.len());
            lines.splice(end..end, some.copied());
        }
    }
    lines.join("\n") + "\n"
}

/// A value many arrays deep.
fn nested(text: &str, random: &mut Random) -> String {
    let tokens = tokens(text);
    let numbers: Vec<usize> = (0..tokens.len()).filter(|&at| tokens[at].0 == Kind::Number).collect();
    let Some(&at) = random.pick(&numbers) else { return text.to_owned() };
    let depth = [1, 2, 10, 200, 2000][random.below(5)];
    let (open, close) = [("[", "]"), ("(", ")"), ("{\"a\":", "}")][random.below(3)];
    let mut changed = String::new();
    for (here, (_, token)) in tokens.iter().enumerate() {
        if here == at {
            changed.extend([&*open.repeat(depth), token, &*close.repeat(depth)]);
        } else {
            changed.push_str(token);
        }
    }
    changed
}

/// A change of one token.
fn token(text: &str, other: &str, random: &mut Random) -> String {
    let mut all: Vec<(Kind, &str)> = tokens(text);
    let places: Vec<usize> = (0..all.len()).filter(|&at| all[at].0 != Kind::Space).collect();
    let Some(&at) = random.pick(&places) else { return text.to_owned() };
    let kind = all[at].0;
    let others = tokens(other);
    let alike: Vec<&str> = others.iter().filter(|one| one.0 == kind).map(|one| one.1).collect();
    let new = match random.below(8) {
        0 => "",
        1 => random.pick(VALUES).copied().unwrap_or_default(),
        2 | 3 if kind == Kind::Number => random.pick(NUMBERS).copied().unwrap_or_default(),
        2 => {
            let to = *random.pick(&places).expect("one is there");
            all.swap(at, to);
            all[at].1
        }
        _ => random.pick(&alike).copied().unwrap_or_default(),
    };
    all[at].1 = new;
    all.iter().map(|one| one.1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_the_text() {
        for text in ["a = [1.5e3, \"b\\\"\"]\n# ü\n", "\"open", "", "v 1 2 3\nf 1//2"] {
            assert_eq!(tokens(text).iter().map(|one| one.1).collect::<String>(), text);
        }
    }
}
