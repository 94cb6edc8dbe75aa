//! The text of .obj and .mtl files: encodings, statements and words.

use std::borrow::Cow;
use std::ops::ControlFlow;

/// The bytes of a file without a byte-order mark, in lines that end with a line feed. UTF-16
/// becomes UTF-8.
pub(super) fn decoded(bytes: &[u8]) -> Cow<'_, [u8]> {
    let text = match bytes {
        [0xef, 0xbb, 0xbf, text @ ..] => text.into(),
        [0xff, 0xfe, units @ ..] => utf8(units, u16::from_le_bytes),
        [0xfe, 0xff, units @ ..] => utf8(units, u16::from_be_bytes),
        text => text.into(),
    };
    if memchr::memchr(b'\n', &text).is_some() || memchr::memchr(b'\r', &text).is_none() {
        return text;
    }
    text.iter().map(|&byte| if byte == b'\r' { b'\n' } else { byte }).collect::<Vec<u8>>().into()
}

fn utf8(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Cow<'_, [u8]> {
    let units = bytes.as_chunks().0.iter().map(|two| unit(*two));
    char::decode_utf16(units)
        .map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER))
        .collect::<String>()
        .into_bytes()
        .into()
}

/// The text of bytes that are UTF-8, or else Latin-1.
pub(super) fn text_of(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.into(),
        Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect::<String>().into(),
    }
}

/// A word as messages show it: its first characters.
pub(super) fn shown(word: &[u8]) -> String {
    const MOST: usize = 40;
    let text = text_of(word);
    match text.char_indices().nth(MOST) {
        None => text.into_owned(),
        Some((end, _)) => format!("{}...", &text[..end]),
    }
}

/// Calls `read` with the statements of a text and their lines, the first of which has this number,
/// until it breaks. A statement is a line, or several that end with `\` except for the last one.
#[inline]
pub(super) fn statements<B>(
    bytes: &[u8],
    mut line: usize,
    mut read: impl FnMut(usize, &[u8]) -> ControlFlow<B>,
) -> ControlFlow<B> {
    let mut start = 0;
    // A statement of several lines up to here, and the number of its first line.
    let (mut joined, mut first) = (Vec::new(), line);
    for end in memchr::memchr_iter(b'\n', bytes) {
        let text = &bytes[start..end];
        if let Some(backslash) = continuation(text) {
            if joined.is_empty() {
                first = line;
            }
            joined.extend_from_slice(&text[..backslash]);
            joined.push(b' ');
        } else if joined.is_empty() {
            read(line, text)?;
        } else {
            joined.extend_from_slice(text);
            read(first, &std::mem::take(&mut joined))?;
        }
        (start, line) = (end + 1, line + 1);
    }
    match joined.is_empty() {
        true => read(line, &bytes[start..]),
        false => read(first, &[&joined, &bytes[start..]].concat()),
    }
}

/// The place of the backslash at the end of a line that continues in the next one.
#[inline]
fn continuation(line: &[u8]) -> Option<usize> {
    let last = line.iter().rposition(|byte| !matches!(byte, b' ' | b'\t' | b'\r'))?;
    (line[last] == b'\\').then_some(last)
}

/// A text in parts of whole statements, each of so many bytes at least but for the last one.
pub(super) fn parts(bytes: &[u8], least: usize) -> Vec<&[u8]> {
    let least = least.max(1);
    let mut parts = Vec::new();
    let (mut start, mut from) = (0, least - 1);
    while let Some(rest) = bytes.get(from..)
        && let Some(length) = memchr::memchr(b'\n', rest)
    {
        let end = from + length;
        if continuation(&bytes[start..end]).is_some() {
            from = end + 1;
            continue;
        }
        parts.push(&bytes[start..=end]);
        (start, from) = (end + 1, end.saturating_add(least));
    }
    parts.push(&bytes[start..]);
    parts
}

/// The words of a statement up to a comment; what follows the last one that was read.
#[derive(Clone, Copy)]
pub(super) struct Words<'a>(pub &'a [u8]);

impl<'a> Words<'a> {
    /// The rest as one name. A comment behind a name has spaces around its `#`.
    pub(super) fn name(self) -> Cow<'a, str> {
        let is_space = |at: usize| self.0.get(at).is_none_or(u8::is_ascii_whitespace);
        let is_comment = |at: &usize| self.0[*at] == b'#' && is_space(at - 1) && is_space(at + 1);
        let end = (1..self.0.len()).find(is_comment).unwrap_or(self.0.len());
        text_of(self.0[..end].trim_ascii())
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.0.trim_ascii_start();
        let is_end = |byte: &u8| byte.is_ascii_whitespace() || *byte == b'#';
        let end = rest.iter().position(is_end).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(end);
        self.0 = rest;
        (!word.is_empty()).then_some(word)
    }
}

/// The number that a word is.
#[inline]
pub(super) fn number(word: &[u8]) -> Result<f32, String> {
    let parsed = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
    parsed.ok_or_else(|| not_a_number(word))
}

#[cold]
fn not_a_number(word: &[u8]) -> String {
    format!("`{}` is not a number", shown(word))
}

/// The next numbers of a statement.
#[inline]
pub(super) fn numbers<const N: usize>(words: &mut Words<'_>) -> Result<[f32; N], String> {
    let mut numbers = [0.0; N];
    for (at, found) in numbers.iter_mut().enumerate() {
        let Some(word) = words.next() else { return Err(missing_number(N, at)) };
        *found = number(word)?;
    }
    Ok(numbers)
}

#[cold]
fn missing_number(count: usize, found: usize) -> String {
    match count {
        1 => "a number is missing".to_string(),
        _ => format!("{count} numbers expected, but {found} found"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joined(text: &str) -> Vec<(usize, String)> {
        let mut all = Vec::new();
        let end = statements(text.as_bytes(), 1, |line, text| {
            all.push((line, text_of(text).into_owned()));
            ControlFlow::<()>::Continue(())
        });
        assert!(end.is_continue());
        all
    }

    #[test]
    fn statements_continue_behind_a_backslash() {
        let text = "f 1 \\\n2 \\ \r\n 3\nv\\w\n\nlast \\";
        let wanted = [(1, "f 1  2   3"), (4, "v\\w"), (5, ""), (6, "last \\")];
        assert_eq!(joined(text), wanted.map(|(line, text)| (line, text.to_string())));
        // Parts end where statements do.
        for least in 0..text.len() {
            let parts = parts(text.as_bytes(), least);
            assert_eq!(parts.concat(), text.as_bytes(), "{least}");
            assert!(
                parts
                    .iter()
                    .all(|part| continuation(part.trim_ascii_end()).is_none() || part.ends_with(b"last \\"))
            );
        }
        assert_eq!(parts(text.as_bytes(), 1).len(), 4);
    }

    #[test]
    fn encodings_become_text() {
        let plain = "v ü\nf\n".as_bytes();
        let utf16 =
            |unit: fn(u16) -> [u8; 2]| "\u{feff}v ü\nf\n".encode_utf16().flat_map(unit).collect::<Vec<u8>>();
        assert_eq!(&*decoded("\u{feff}v ü\nf\n".as_bytes()), plain);
        assert_eq!(&*decoded(&utf16(u16::to_le_bytes)), plain);
        assert_eq!(&*decoded(&utf16(u16::to_be_bytes)), plain);
        assert_eq!(&*decoded(b"v 1\rf\r"), b"v 1\nf\n");
        assert_eq!(&*decoded(b"v 1\r\nf\r"), b"v 1\r\nf\r");
        assert_eq!(text_of(b"f\xfcr"), "für");
        assert_eq!(text_of("für".as_bytes()), "für");
    }

    #[test]
    fn comments_end_words_and_names() {
        let words = |text: &'static str| Words(text.as_bytes()).collect::<Vec<_>>();
        assert_eq!(words(" 1 2#3 4"), [b"1", b"2"]);
        assert_eq!(words("#1 2"), [b""; 0]);
        for (text, name) in [
            (" a # red", "a"),
            (" a#1", "a#1"),
            // The name that a well-known exporter makes.
            (" Material #25", "Material #25"),
            (" #b", "#b"),
            (" # b", ""),
            ("  two  words \r", "two  words"),
            (" a #", "a"),
        ] {
            assert_eq!(Words(text.as_bytes()).name(), name, "{text}");
        }
    }
}
