//! The words of an image, made when something first reads them.

use std::fmt;
use std::sync::{Arc, OnceLock};

use crate::machine::image_words::ImageWords;
use anyhit_base::error::{Error, ErrorKind, Result};

/// Gives the bytes of all texels of an image, in the order of an image. Several threads may wait
/// for it: it must not wait for a task of their pool.
pub(crate) type ReadTexels = dyn Fn() -> Result<Vec<u8>> + Send + Sync;

/// The words of an image.
#[derive(Debug)]
pub(super) struct LazyWords {
    words: OnceLock<ImageWords>,
    /// Of words that are made late, where they come from.
    source: Option<Source>,
}

/// Where words come from, and how many bytes of texels they hold.
#[derive(Clone)]
struct Source {
    read: Arc<ReadTexels>,
    size: u64,
    failure: OnceLock<Arc<Error>>,
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Source").field("size", &self.size).finish_non_exhaustive()
    }
}

impl Source {
    fn words(&self) -> Result<ImageWords> {
        let invalid = |message: String| Error::new(ErrorKind::InvalidImage, message);
        let bytes = (self.read)()?;
        if bytes.len() as u64 != self.size {
            return Err(invalid(format!("found {} bytes for an image of {}", bytes.len(), self.size)));
        }
        ImageWords::of_bytes(&bytes)
            .ok_or_else(|| invalid(format!("not enough memory for {} bytes", self.size)))
    }
}

impl From<ImageWords> for LazyWords {
    fn from(words: ImageWords) -> Self {
        Self { words: words.into(), source: None }
    }
}

impl LazyWords {
    /// Words of so many bytes, read when something needs them.
    pub(super) fn later(size: u64, read: Arc<ReadTexels>) -> Self {
        Self { words: OnceLock::new(), source: Some(Source { read, size, failure: OnceLock::new() }) }
    }

    /// The words; zeros where they cannot be read.
    #[inline]
    pub(super) fn get(&self) -> &ImageWords {
        match self.words.get() {
            Some(words) => words,
            None => self.make(),
        }
    }

    #[cold]
    fn make(&self) -> &ImageWords {
        self.words.get_or_init(|| {
            let source =
                self.source.as_ref().expect("bug in anyhit: an image has neither words nor a source");
            source.words().unwrap_or_else(|error| {
                let _ = source.failure.set(Arc::new(error));
                let count = usize::try_from(source.size.div_ceil(8)).unwrap_or(usize::MAX);
                let zeros = ImageWords::filled(count, [0; 2]).or_else(|| ImageWords::filled(0, [0; 2]));
                zeros.expect("bug in anyhit: no memory for no words")
            })
        })
    }

    /// Whether they are made.
    pub(super) fn are_read(&self) -> bool {
        self.words.get().is_some()
    }

    /// Why they cannot be read; they are read first.
    #[inline]
    pub(super) fn failure(&self) -> Option<&Arc<Error>> {
        let source = self.source.as_ref()?;
        self.get();
        source.failure.get()
    }

    /// A copy. What is not read is not read for it.
    pub(super) fn copied(&self) -> Self {
        match (self.words.get(), &self.source) {
            (Some(words), source) if source.as_ref().is_none_or(|source| source.failure.get().is_none()) => {
                words.copied().into()
            }
            (_, source) => Self { words: OnceLock::new(), source: source.clone() },
        }
    }

    /// Whether both are known to be equal without being read.
    pub(super) fn have_one_source(&self, other: &Self) -> bool {
        let is_unread = !self.are_read() && !other.are_read();
        let sources = self.source.as_ref().zip(other.source.as_ref());
        is_unread && sources.is_some_and(|(own, other)| Arc::ptr_eq(&own.read, &other.read))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    fn counted(bytes: Result<Vec<u8>>, count: &Arc<AtomicU32>) -> Arc<ReadTexels> {
        let count = count.clone();
        Arc::new(move || {
            count.fetch_add(1, Ordering::Relaxed);
            bytes.clone()
        })
    }

    #[test]
    fn words_are_read_once_and_only_when_needed() {
        let count = Arc::default();
        let words = LazyWords::later(9, counted(Ok(vec![1, 0, 0, 0, 0, 0, 0, 2, 3]), &count));
        let copy = words.copied();
        assert!(words.have_one_source(&copy));
        assert_eq!((words.are_read(), count.load(Ordering::Relaxed)), (false, 0));
        assert_eq!((words.get().load(0), words.get().load(1)), (0x0200_0000_0000_0001, 3));
        assert!(words.failure().is_none());
        assert_eq!(count.load(Ordering::Relaxed), 1);
        // A copy of what is read reads nothing.
        assert_eq!(words.copied().get().load(1), 3);
        assert_eq!(count.load(Ordering::Relaxed), 1);
        assert_eq!(copy.get().load(1), 3);
        assert_eq!(count.load(Ordering::Relaxed), 2);
    }

    #[test]
    fn what_cannot_be_read_is_zeros_with_a_reason() {
        let count = Arc::default();
        let broken = Err(Error::new(ErrorKind::Io, "it is gone"));
        let words = LazyWords::later(8, counted(broken, &count));
        for words in [&words, &words.copied()] {
            assert_eq!(words.failure().expect("a failure").message(), "it is gone");
            assert_eq!(words.get().load(0), 0);
        }
        let short = LazyWords::later(8, counted(Ok(vec![0; 7]), &count));
        let message = short.failure().expect("a failure").message().to_owned();
        assert_eq!(message, "found 7 bytes for an image of 8");
    }
}
