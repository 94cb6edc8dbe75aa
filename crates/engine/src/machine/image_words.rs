//! The memory of an image. What nothing was stored to is neither allocated, copied nor compared,
//! where it began as zeros: of a picture of which one pixel is looked at, almost all.

use std::ops::Range;
use std::sync::OnceLock;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU64};

use bytemuck::allocation::{try_zeroed_slice_box, zeroed_box};

use crate::machine::format::Format;
use anyhit_base::input::threads;

/// The words of a block: a page of memory, and a whole number of texels of every size.
const BLOCK_WORDS: usize = 512;

/// The words that hold the texels of an image, and which of them may have been stored to.
#[derive(Debug)]
pub(super) struct ImageWords {
    memory: Memory,
    /// What they were at first, in turn, where they all followed one pattern.
    fill: Option<[u64; 2]>,
}

/// The memory of an image's words.
#[derive(Debug)]
enum Memory {
    /// All words, and for each block whether anything was stored to it.
    Whole { words: Box<[AtomicU64]>, stored: Box<[AtomicBool]> },
    /// A number of words that were zeros at first: the blocks that something was stored to.
    Zeros { count: usize, blocks: Box<[OnceLock<Box<Block>>]> },
}

/// The words of a block, the last of which may be beyond the image.
type Block = [AtomicU64; BLOCK_WORDS];

/// What the texels of an image were at one time.
#[derive(Debug)]
pub struct ImageState {
    format: Format,
    fill: [u64; 2],
    /// The blocks that may not be as filled, ascending by their number.
    blocks: Vec<(usize, Box<[u64]>)>,
}

impl ImageWords {
    /// These words; `None` where there is no memory for them.
    pub(super) fn new(words: impl ExactSizeIterator<Item = u64>) -> Option<Self> {
        let mut memory: Vec<AtomicU64> = Vec::new();
        memory.try_reserve_exact(words.len()).ok()?;
        memory.extend(words.map(AtomicU64::new));
        Self::of(memory.into_boxed_slice(), None)
    }

    /// The words of these bytes; `None` where there is no memory for them.
    pub(super) fn of_bytes(bytes: &[u8]) -> Option<Self> {
        /// Words that a thread makes at once.
        const PART: usize = 1 << 17;
        let mut memory: Box<[AtomicU64]> = try_zeroed_slice_box(bytes.len().div_ceil(8)).ok()?;
        threads::fill(&mut memory, PART, &|begin, part| {
            for (to, chunk) in part.iter_mut().zip(bytes[8 * begin..].chunks(8)) {
                let mut word = [0; 8];
                word[..chunk.len()].copy_from_slice(chunk);
                *to.get_mut() = u64::from_le_bytes(word);
            }
        });
        Self::of(memory, None)
    }

    /// A number of words that are a pattern's in turn; `None` where there is no memory for them.
    pub(super) fn filled(count: usize, fill: [u64; 2]) -> Option<Self> {
        if fill == [0; 2] {
            let mut blocks = Vec::new();
            blocks.try_reserve_exact(count.div_ceil(BLOCK_WORDS)).ok()?;
            blocks.resize_with(count.div_ceil(BLOCK_WORDS), OnceLock::new);
            let memory = Memory::Zeros { count, blocks: blocks.into_boxed_slice() };
            return Some(Self { memory, fill: Some(fill) });
        }
        let filled = Self::new((0..count).map(|at| fill[at % 2]))?;
        Some(Self { fill: Some(fill), ..filled })
    }

    fn of(words: Box<[AtomicU64]>, fill: Option<[u64; 2]>) -> Option<Self> {
        let stored = try_zeroed_slice_box(words.len().div_ceil(BLOCK_WORDS)).ok()?;
        Some(Self { memory: Memory::Whole { words, stored }, fill })
    }

    /// The number of words.
    fn len(&self) -> usize {
        match &self.memory {
            Memory::Whole { words, .. } => words.len(),
            Memory::Zeros { count, .. } => *count,
        }
    }

    /// The number of blocks.
    fn block_count(&self) -> usize {
        self.len().div_ceil(BLOCK_WORDS)
    }

    #[inline]
    pub(super) fn load(&self, at: usize) -> u64 {
        match &self.memory {
            Memory::Whole { words, .. } => words[at].load(Relaxed),
            Memory::Zeros { blocks, .. } => {
                let block = blocks[at / BLOCK_WORDS].get();
                block.map_or(0, |words| words[at % BLOCK_WORDS].load(Relaxed))
            }
        }
    }

    #[inline]
    pub(super) fn store(&self, at: usize, word: u64) {
        self.word_to_store(at).store(word, Relaxed);
    }

    /// Atomically replaces a word by a function of it, and returns the old one. It stays where the
    /// function returns `None`.
    #[inline]
    pub(super) fn update(&self, at: usize, replace: impl FnMut(u64) -> Option<u64>) -> u64 {
        let (Ok(before) | Err(before)) = self.word_to_store(at).fetch_update(Relaxed, Relaxed, replace);
        before
    }

    /// A word, whose block something is stored to from now on.
    #[inline]
    fn word_to_store(&self, at: usize) -> &AtomicU64 {
        match &self.memory {
            Memory::Whole { words, stored } => {
                let stored = &stored[at / BLOCK_WORDS];
                if !stored.load(Relaxed) {
                    stored.store(true, Relaxed);
                }
                &words[at]
            }
            Memory::Zeros { blocks, .. } => {
                &blocks[at / BLOCK_WORDS].get_or_init(zeroed_box::<Block>)[at % BLOCK_WORDS]
            }
        }
    }

    /// A copy of them. Of words that were filled with zeros only the blocks that were stored to are
    /// copied.
    pub(super) fn copied(&self) -> Self {
        let word = |word: &AtomicU64| AtomicU64::new(word.load(Relaxed));
        let memory = match &self.memory {
            Memory::Whole { words, stored } => Memory::Whole {
                words: words.iter().map(word).collect(),
                stored: stored.iter().map(|stored| AtomicBool::new(stored.load(Relaxed))).collect(),
            },
            Memory::Zeros { count, blocks } => {
                let block = |block: &OnceLock<Box<Block>>| {
                    let Some(words) = block.get() else { return OnceLock::new() };
                    let copy = zeroed_box::<Block>();
                    copy.iter().zip(&**words).for_each(|(to, from)| to.store(from.load(Relaxed), Relaxed));
                    OnceLock::from(copy)
                };
                Memory::Zeros { count: *count, blocks: blocks.iter().map(block).collect() }
            }
        };
        Self { memory, fill: self.fill }
    }

    /// A copy of a range of the bytes.
    pub(super) fn bytes(&self, range: Range<usize>) -> Vec<u8> {
        let words = range.start / 8..range.end.div_ceil(8);
        let mut bytes = Vec::with_capacity(8 * words.len());
        words.for_each(|at| bytes.extend_from_slice(&self.load(at).to_le_bytes()));
        bytes.drain(..range.start % 8);
        bytes.truncate(range.len());
        bytes
    }

    /// Returns true if the first `size` bytes, all but less than a word, are equal. Blocks that
    /// both still have as filled are not read.
    pub(super) fn are_equal(&self, other: &Self, size: usize) -> bool {
        let is_untouched =
            |block: usize| self.fill == other.fill && self.is_as_filled(block) && other.is_as_filled(block);
        let is_equal = |at: usize| {
            let unused = 64 - 8 * (size - 8 * at).min(8);
            (self.load(at) ^ other.load(at)) << unused == 0
        };
        self.len() == other.len()
            && (0..self.block_count()).all(|block| is_untouched(block) || self.words_of(block).all(is_equal))
    }

    /// What they hold now, as texels of a format.
    pub(super) fn state(&self, format: Format) -> ImageState {
        let words = |block| self.words_of(block).map(|at| self.load(at)).collect();
        let blocks = (0..self.block_count()).filter(|&block| !self.is_as_filled(block));
        ImageState {
            format,
            fill: self.fill.unwrap_or_default(),
            blocks: blocks.map(|block| (block, words(block))).collect(),
        }
    }

    /// The blocks of words that are not what they were, as ranges of their words.
    pub(super) fn unlike(&self, before: &ImageState) -> impl Iterator<Item = Range<usize>> {
        let may_differ = |&block: &usize| !self.is_as_filled(block) || before.block(block).is_some();
        let differs = |words: &Range<usize>| words.clone().any(|at| self.load(at) != before.word(at));
        (0..self.block_count()).filter(may_differ).map(|block| self.words_of(block)).filter(differs)
    }

    /// Whether a block is known to hold the pattern that all were filled with.
    fn is_as_filled(&self, block: usize) -> bool {
        match &self.memory {
            Memory::Whole { stored, .. } => self.fill.is_some() && !stored[block].load(Relaxed),
            Memory::Zeros { blocks, .. } => blocks[block].get().is_none(),
        }
    }

    fn words_of(&self, block: usize) -> Range<usize> {
        block * BLOCK_WORDS..((block + 1) * BLOCK_WORDS).min(self.len())
    }
}

impl ImageState {
    /// The texel that was at an index as `Image::index` gives it.
    pub fn load(&self, index: usize) -> u128 {
        texel(self.format, index, |at| self.word(at))
    }

    pub(super) fn word(&self, at: usize) -> u64 {
        self.block(at / BLOCK_WORDS).map_or(self.fill[at % 2], |words| words[at % BLOCK_WORDS])
    }

    fn block(&self, number: usize) -> Option<&[u64]> {
        let found = self.blocks.binary_search_by_key(&number, |(block, _)| *block).ok()?;
        Some(&self.blocks[found].1)
    }
}

/// A texel of words.
#[inline]
pub(super) fn texel(format: Format, index: usize, word: impl Fn(usize) -> u64) -> u128 {
    let size = format.texel_size() as usize;
    let word = |at: usize| u128::from(word(at));
    if size == 16 {
        return word(2 * index) | word(2 * index + 1) << 64;
    }
    let byte = index * size;
    (word(byte / 8) >> (byte % 8 * 8)) & ((1 << (8 * size)) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(count: usize, state: &ImageState) -> Vec<u64> {
        (0..count).map(|at| state.word(at)).collect()
    }

    fn starts(ranges: impl Iterator<Item = Range<usize>>) -> Vec<usize> {
        ranges.map(|range| range.start).collect()
    }

    #[test]
    fn blocks_that_differ_are_found_whatever_they_were_filled_with() {
        let count = 3 * BLOCK_WORDS + 5;
        for fill in [[0; 2], [7, 9]] {
            let filled = || (0..count).map(|at| fill[at % 2]);
            for words in
                [ImageWords::filled(count, fill), ImageWords::new(filled().collect::<Vec<_>>().into_iter())]
            {
                let words = words.expect("memory");
                let before = words.state(Format::RGBA32F);
                assert_eq!(words.unlike(&before).count(), 0);
                // No difference: a value that is stored again, and one that was put back.
                words.store(1, fill[1]);
                words.store(BLOCK_WORDS, 1);
                words.store(BLOCK_WORDS, fill[0]);
                words.update(count - 1, |word| Some(word + 1));
                assert_eq!(starts(words.unlike(&before)), [3 * BLOCK_WORDS]);
                assert_eq!(all(count, &before), filled().collect::<Vec<_>>());
                let after = words.state(Format::RGBA32F);
                let mut wanted: Vec<u64> = filled().collect();
                wanted[count - 1] += 1;
                assert_eq!(all(count, &after), wanted);
                // What was stored long ago, and is as it was filled now.
                words.store(count - 1, fill[(count - 1) % 2]);
                assert_eq!(starts(words.unlike(&after)), [3 * BLOCK_WORDS]);
                assert_eq!(words.unlike(&before).count(), 0);
                // A copy has the words, and stays as they were.
                words.store(BLOCK_WORDS + 1, 3);
                let copy = words.copied();
                words.store(0, 4);
                wanted[count - 1] -= 1;
                wanted[BLOCK_WORDS + 1] = 3;
                assert_eq!(all(count, &copy.state(Format::RGBA32F)), wanted);
                assert_eq!(starts(copy.unlike(&before)), [BLOCK_WORDS]);
            }
        }
    }

    #[test]
    fn zeros_and_their_copies_hold_only_blocks_that_were_stored_to() {
        let held =
            |words: &ImageWords| (0..words.block_count()).filter(|&at| !words.is_as_filled(at)).count();
        let zeros = ImageWords::filled(100 * BLOCK_WORDS + 1, [0; 2]).expect("memory");
        let ray = zeros.copied();
        ray.store(70 * BLOCK_WORDS, 5);
        assert_eq!(ray.update(100 * BLOCK_WORDS, |word| Some(word + 6)), 0);
        assert_eq!([&zeros, &ray, &ray.copied()].map(held), [0, 2, 2]);
        assert_eq!([0, 70, 100].map(|block| ray.copied().load(block * BLOCK_WORDS)), [0, 5, 6]);
        assert!(!zeros.are_equal(&ray, 8 * zeros.len()));
        assert!(matches!(&zeros.memory, Memory::Zeros { blocks, .. } if blocks.len() == 101));
    }

    #[test]
    fn there_is_no_memory_for_everything() {
        assert!(ImageWords::filled(usize::MAX / 16, [0; 2]).is_none());
        assert!(ImageWords::filled(usize::MAX / 16, [1; 2]).is_none());
    }
}
