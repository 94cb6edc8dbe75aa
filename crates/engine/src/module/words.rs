//! The physical layout of a module: bytes to words, the header, and iteration over instructions.
//!
//! SPIR-V specification, section 2.3 "Physical Layout of a SPIR-V Module and Instruction".

use crate::module::Opcode;
use crate::module::span::{Span, ends_string, invalid};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::{InputLimit, InputLimits};

/// The first word of every module.
const MAGIC: u32 = 0x0723_0203;

/// Words of the header: magic, version, generator, bound, schema.
pub(crate) const HEADER_WORDS: usize = 5;

/// The header of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    /// Major and minor version.
    pub(crate) version: (u8, u8),
    /// The tool that wrote the module.
    pub(crate) generator: u32,
    /// Every id is less than this.
    pub(crate) bound: u32,
}

/// The words of a module, in this machine's byte order.
///
/// # Errors
/// `InvalidModule` if the length is no multiple of 4, or the magic number is in neither byte order.
pub(crate) fn words_of(bytes: &[u8]) -> Result<Vec<u32>> {
    let Some(first) = bytes.first_chunk::<4>() else {
        return Err(invalid(
            0,
            format!("a module begins with a header of 20 bytes, but the file has only {}", bytes.len()),
        ));
    };
    let little = u32::from_le_bytes(*first) == MAGIC;
    if !little && u32::from_be_bytes(*first) != MAGIC {
        let found = u32::from_le_bytes(*first);
        let error = invalid(
            0,
            format!("expected SPIR-V's magic number {MAGIC:#010x} in either byte order, found {found:#010x}"),
        );
        let text = bytes.iter().take(64).all(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace());
        return Err(if text {
            error.note("this looks like text: shader sources and SPIR-V assembly must be compiled first")
        } else {
            error
        });
    }
    let (chunks, rest) = bytes.as_chunks::<4>();
    if !rest.is_empty() {
        return Err(invalid(
            chunks.len(),
            format!(
                "a module consists of words of 4 bytes, but {} bytes are left over at the end",
                rest.len()
            ),
        ));
    }
    Ok(match little {
        true => chunks.iter().map(|chunk| u32::from_le_bytes(*chunk)).collect(),
        false => chunks.iter().map(|chunk| u32::from_be_bytes(*chunk)).collect(),
    })
}

/// Reads the header.
///
/// # Errors
/// `InvalidModule` for a short or invalid header, `UnsupportedModule` for a version above 1.6.
pub(crate) fn header(words: &[u32]) -> Result<Header> {
    let Some(&[_, version, generator, bound, schema]) = words.first_chunk::<HEADER_WORDS>() else {
        return Err(invalid(
            words.len(),
            format!(
                "a module begins with a header of {HEADER_WORDS} words, but the file has only {}",
                words.len()
            ),
        ));
    };
    let [low, minor, major, high] = version.to_le_bytes();
    if low != 0 || high != 0 || major == 0 {
        return Err(invalid(1, format!("expected a version (0x00MMmm00), found {version:#010x}")));
    }
    if major != 1 || minor > 6 {
        return Err(Error::new(
            ErrorKind::UnsupportedModule,
            format!("SPIR-V {major}.{minor} is newer than 1.6, the newest supported version"),
        )
        .at(Place::Word(1)));
    }
    if bound == 0 {
        return Err(invalid(3, "expected a bound above every id, found 0"));
    }
    if schema != 0 {
        return Err(invalid(4, format!("expected the reserved word 0, found {schema:#010x}")));
    }
    Ok(Header { version: (major, minor), generator, bound })
}

/// Iterates over the instructions; checks that each lies within the module.
#[derive(Clone, Debug)]
pub(crate) struct Walker<'w> {
    words: &'w [u32],
    at: usize,
    /// Instructions so far.
    count: u64,
    limits: InputLimits,
}

impl<'w> Walker<'w> {
    /// A walker at the first instruction after the header.
    pub(crate) fn new(words: &'w [u32], limits: InputLimits) -> Self {
        Self { words, at: HEADER_WORDS.min(words.len()), count: 0, limits }
    }

    /// The next instruction; `None` at the end of the module.
    ///
    /// # Errors
    /// `InvalidModule` where the word count is 0 or reaches beyond the module, `UnsupportedModule`
    /// where there are more instructions than [`InputLimit::ModuleInstructions`].
    pub(crate) fn next(&mut self) -> Result<Option<Span>> {
        let Some(&first) = self.words.get(self.at) else { return Ok(None) };
        let (opcode, count) = (Opcode::of_word(first), (first >> 16) as usize);
        let start = self.at;
        if count == 0 {
            return Err(invalid(start, format!("{} has a word count of 0, expected at least 1", opcode)));
        }
        let left = self.words.len() - start;
        if count > left {
            return Err(invalid(
                start,
                format!("{} has a word count of {count}, but the module ends after {left}", opcode),
            ));
        }
        self.count += 1;
        self.limits
            .check(InputLimit::ModuleInstructions, self.count, ErrorKind::UnsupportedModule)
            .map_err(|error| error.at(Place::Word(start)))?;
        self.at = start + count;
        Ok(Some(Span { opcode, start, end: self.at }))
    }
}

/// Reads a literal string: its text (invalid UTF-8 is replaced) and the number of its words,
/// including the one with the terminating zero byte. `None` if there is no zero byte.
pub(crate) fn string(words: &[u32]) -> Option<(String, usize)> {
    let count = words.iter().position(|&word| ends_string(word))? + 1;
    Some((lossy_string(&words[..count]), count))
}

/// The text up to the first zero byte, or to the end of the words where there is none.
pub(crate) fn lossy_string(words: &[u32]) -> String {
    let mut bytes = Vec::with_capacity(words.len() * 4);
    for word in words {
        bytes.extend_from_slice(&word.to_le_bytes());
        if ends_string(*word) {
            break;
        }
    }
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first_place(error: &Error) -> Option<Place> {
        error.places().next().map(|(place, _)| place.clone())
    }

    #[test]
    fn both_byte_orders_give_the_same_words() {
        let words = [MAGIC, 0x0001_0600, 7, 9, 0];
        let little: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let big: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
        assert_eq!(words_of(&little).unwrap(), words);
        assert_eq!(words_of(&big).unwrap(), words);
        assert_eq!(header(&words).unwrap(), Header { version: (1, 6), generator: 7, bound: 9 });
    }

    #[test]
    fn text_is_distinguished_from_garbled_words() {
        let text = words_of(b"#version 460\nvoid main() {}\n").unwrap_err();
        assert!(text.notes()[0].contains("looks like text"), "{text}");
        assert!(words_of(&[0xff; 8]).unwrap_err().notes().is_empty());
    }

    #[test]
    fn lengths_and_headers_are_checked() {
        let places = |bytes: &[u8]| first_place(&words_of(bytes).unwrap_err());
        assert_eq!(places(&[]), Some(Place::Word(0)));
        assert_eq!(places(&[3, 2, 0x23]), Some(Place::Word(0)));
        assert_eq!(places(&[3, 2, 0x23, 7, 0]), Some(Place::Word(1)));
        let place = |words: &[u32]| first_place(&header(words).unwrap_err());
        assert_eq!(place(&[MAGIC, 0x0001_0000, 0, 1]), Some(Place::Word(4)));
        assert_eq!(place(&[MAGIC, 0x0101_0000, 0, 1, 0]), Some(Place::Word(1)));
        assert_eq!(place(&[MAGIC, 0x0001_0000, 0, 0, 0]), Some(Place::Word(3)));
        assert_eq!(place(&[MAGIC, 0x0001_0000, 0, 1, 5]), Some(Place::Word(4)));
        let newer = header(&[MAGIC, 0x0001_0700, 0, 1, 0]).unwrap_err();
        assert_eq!(newer.kind(), ErrorKind::UnsupportedModule);
    }

    #[test]
    fn the_walker_refuses_counts_that_leave_the_module() {
        let mut words = vec![MAGIC, 0x0001_0000, 0, 1, 0, 0x0002_0011, 1];
        words.push(0x0003_0011);
        let mut walker = Walker::new(&words, InputLimits::default());
        assert_eq!(walker.next().unwrap(), Some(Span { opcode: Opcode::Capability, start: 5, end: 7 }));
        let error = walker.next().unwrap_err();
        assert_eq!(first_place(&error), Some(Place::Word(7)));
        assert_eq!(error.message(), "OpCapability has a word count of 3, but the module ends after 1");
        words[7] = 17;
        let mut walker = Walker::new(&words, InputLimits::default());
        walker.next().unwrap();
        assert_eq!(first_place(&walker.next().unwrap_err()), Some(Place::Word(7)));
    }

    #[test]
    fn strings_end_at_their_zero_byte_and_may_hold_any_bytes() {
        let abc = u32::from_le_bytes(*b"abc\0");
        assert_eq!(string(&[abc, 5]), Some(("abc".into(), 1)));
        assert_eq!(string(&[u32::from_le_bytes(*b"abcd"), 0]), Some(("abcd".into(), 2)));
        assert_eq!(string(&[u32::from_le_bytes(*b"abcd")]), None);
        assert_eq!(lossy_string(&[u32::from_le_bytes(*b"abcd")]), "abcd");
        assert_eq!(string(&[u32::from_le_bytes([b'a', 0xff, 0, b'x'])]), Some(("a\u{fffd}".into(), 1)));
    }
}
