//! Buffers: words that all invocations share, read and written atomically.

use std::fmt;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, PoisonError};

use bytemuck::allocation::zeroed_slice_box;

use crate::math::array;

/// The words of a buffer. They are boxed, as only boxes take memory that the system clears when it
/// is first touched.
pub(crate) type Words = Arc<Box<[AtomicU32]>>;

/// A buffer, or the range of one that a descriptor refers to (`VkDescriptorBufferInfo`): all ranges
/// of a buffer are views of the same memory. The size is in bytes and need not be a multiple of
/// four.
pub struct Buffer {
    /// The words of the whole memory.
    memory: Words,
    /// The word where the range begins.
    first: usize,
    size: u64,
    null: bool,
    /// The buffer's name, where this is a range of it that may be less than all.
    view_of: Option<Arc<str>>,
}

impl Buffer {
    /// What the offset of a view is a multiple of, in bytes. No device requires less
    /// (`minStorageBufferOffsetAlignment`), and with it no word belongs to two views in part.
    pub const OFFSET_ALIGNMENT: u64 = 4;

    /// A buffer that holds these bytes.
    #[must_use]
    pub fn new(bytes: &[u8]) -> Arc<Self> {
        Self::with_size(bytes, bytes.len())
    }

    /// A buffer of a size in bytes that begins with these, or with as many of them as it has; the
    /// rest is zero.
    #[doc(hidden)]
    pub fn with_size(bytes: &[u8], size: usize) -> Arc<Self> {
        let mut memory = zeros(size);
        let words = Arc::get_mut(&mut memory).expect("nobody else has it");
        let (whole, rest) = bytes[..bytes.len().min(size)].as_chunks();
        for (word, bytes) in words.iter_mut().zip(whole) {
            *word.get_mut() = u32::from_le_bytes(*bytes);
        }
        if let Some(word) = words.get_mut(whole.len()) {
            let mut last = [0; 4];
            last[..rest.len()].copy_from_slice(rest);
            *word.get_mut() = u32::from_le_bytes(last);
        }
        Self::whole(memory, size as u64)
    }

    /// A buffer of zeros.
    #[must_use]
    pub fn zeroed(size: usize) -> Arc<Self> {
        Self::whole(zeros(size), size as u64)
    }

    fn whole(memory: Words, size: u64) -> Arc<Self> {
        Arc::new(Self { memory, first: 0, size, null: false, view_of: None })
    }

    /// The buffer of a null descriptor (`nullDescriptor`): whatever the policy, loads give 0,
    /// stores are dropped, and `OpArrayLength` gives 0.
    #[must_use]
    pub fn null() -> Arc<Self> {
        Arc::new(Self { memory: Words::default(), first: 0, size: 0, null: true, view_of: None })
    }

    /// The range of `range` bytes at an offset in bytes, as a buffer with the same memory; `None`
    /// where it goes beyond this one, or the offset is no multiple of
    /// [`Buffer::OFFSET_ALIGNMENT`]. Messages call this buffer by its name.
    #[must_use]
    pub fn view(&self, offset: u64, range: u64, name: &str) -> Option<Arc<Self>> {
        let inside = offset.checked_add(range)? <= self.size && offset.is_multiple_of(Self::OFFSET_ALIGNMENT);
        inside.then(|| {
            let first = self.first + (offset / 4) as usize;
            Arc::new(Self {
                memory: self.memory.clone(),
                first,
                size: range,
                null: self.null,
                view_of: Some(name.into()),
            })
        })
    }

    /// A buffer of this range in a copy of the memory. The closure returns the copied words: for
    /// all buffers with one memory the same ones.
    pub(crate) fn copied(&self, copy: impl FnOnce(&Words) -> Words) -> Arc<Self> {
        let memory = copy(&self.memory);
        let Self { first, size, null, ref view_of, .. } = *self;
        Arc::new(Self { memory, first, size, null, view_of: view_of.clone() })
    }

    /// Where the memory lies: equal for all views of a buffer, and for these alone.
    #[doc(hidden)]
    pub fn memory_id(&self) -> usize {
        Arc::as_ptr(&self.memory).addr()
    }

    /// Where it begins in its memory, in bytes.
    #[doc(hidden)]
    #[inline]
    pub fn offset(&self) -> u64 {
        4 * self.first as u64
    }

    /// The name of the buffer that it is a view of.
    #[doc(hidden)]
    pub fn view_of(&self) -> Option<&Arc<str>> {
        self.view_of.as_ref()
    }

    /// Whether both are the same bytes of one memory.
    #[doc(hidden)]
    pub fn is_same(&self, other: &Self) -> bool {
        self.memory_id() == other.memory_id() && self.first == other.first && self.size == other.size
    }

    /// Returns true if both have the same size and hold the same bytes.
    #[doc(hidden)]
    pub fn has_equal_bytes(&self, other: &Self) -> bool {
        if self.size != other.size || self.is_same(other) {
            return self.size == other.size;
        }
        let (whole, rest) = ((self.size / 4) as usize, self.size as u32 % 4);
        let [own, others] = [self, other].map(|buffer| buffer.words());
        let differs = |at: usize| own[at].load(Relaxed) ^ others[at].load(Relaxed);
        // Bytes of the last word beyond the size are no part of the buffer.
        (0..whole).all(|at| differs(at) == 0) && (rest == 0 || differs(whole) << (32 - 8 * rest) == 0)
    }

    /// Whether it is [`Buffer::null`].
    #[must_use]
    pub fn is_null(&self) -> bool {
        self.null
    }

    /// The size in bytes.
    #[inline]
    #[must_use]
    pub fn size(&self) -> u64 {
        self.size
    }

    /// The words; a part of the last one may lie beyond the size.
    #[doc(hidden)]
    #[inline]
    pub fn words(&self) -> &[AtomicU32] {
        &self.memory[self.first..self.first + self.size.div_ceil(4) as usize]
    }

    /// The word that holds the byte at an offset inside.
    #[inline]
    fn word_at(&self, offset: u64) -> &AtomicU32 {
        &self.memory[self.first + (offset / 4) as usize]
    }

    /// A copy of the bytes.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes: Vec<u8> =
            self.words().iter().flat_map(|word| word.load(Relaxed).to_le_bytes()).collect();
        bytes.truncate(self.size as usize);
        bytes
    }

    /// The scalar of `width` bits (8, 16 or 32) at a byte offset; `None` outside the buffer, and
    /// for any other width.
    #[doc(hidden)]
    #[inline]
    pub fn load(&self, offset: u64, width: u32) -> Option<u32> {
        let bytes = u64::from(width / 8);
        if offset.checked_add(bytes)? > self.size {
            return None;
        }
        let shift = (offset % 4) as u32 * 8;
        if shift == 0 && width == 32 {
            return Some(self.word_at(offset).load(Relaxed));
        }
        if !matches!(width, 8 | 16 | 32) {
            return None;
        }
        let word = self.word_at(offset).load(Relaxed);
        let mut pair = u64::from(word);
        if shift + width > 32 {
            pair |= u64::from(self.word_at(offset + 4).load(Relaxed)) << 32;
        }
        Some((pair >> shift) as u32 & (u32::MAX >> (32 - width)))
    }

    /// Stores a scalar of `width` bits (8, 16 or 32) at a byte offset; `None` outside the buffer,
    /// and for any other width.
    #[doc(hidden)]
    #[inline]
    pub fn store(&self, offset: u64, width: u32, value: u32) -> Option<()> {
        let bytes = u64::from(width / 8);
        if offset.checked_add(bytes)? > self.size {
            return None;
        }
        if width == 32 && offset.is_multiple_of(4) {
            self.word_at(offset).store(value, Relaxed);
            return Some(());
        }
        if !matches!(width, 8 | 16 | 32) {
            return None;
        }
        let shift = (offset % 4) as u32 * 8;
        let mask = u64::from(u32::MAX >> (32 - width)) << shift;
        let bits = u64::from(value) << shift & mask;
        let put = |offset: u64, mask: u32, bits: u32| {
            if mask != 0 {
                let merge = |old: u32| Some(old & !mask | bits);
                self.word_at(offset).fetch_update(Relaxed, Relaxed, merge).ok();
            }
        };
        put(offset, mask as u32, bits as u32);
        put(offset + 4, (mask >> 32) as u32, (bits >> 32) as u32);
        Some(())
    }

    /// Reads, changes and writes 64 bits at a byte offset, atomically with respect to all other
    /// calls of this function for the same words, and returns the old bits; `None` outside the
    /// buffer or where the offset is no multiple of 4.
    #[doc(hidden)]
    pub fn update_wide(&self, offset: u64, change: impl FnOnce(u64) -> Option<u64>) -> Option<u64> {
        // Words are atomics of 32 bits: a pair needs a lock, one of several, chosen by its address.
        static LOCKS: [Mutex<()>; 64] = [const { Mutex::new(()) }; 64];
        let inside = offset.is_multiple_of(4) && offset.checked_add(8)? <= self.size;
        let pair = inside.then(|| [self.word_at(offset), self.word_at(offset + 4)])?;
        let granule = std::ptr::from_ref(pair[0]).addr() / 8;
        let guard = LOCKS[granule % LOCKS.len()].lock().unwrap_or_else(PoisonError::into_inner);
        let [low, high] = array::map(pair, |word| u64::from(word.load(Relaxed)));
        let old = low | high << 32;
        if let Some(new) = change(old) {
            pair[0].store(new as u32, Relaxed);
            pair[1].store((new >> 32) as u32, Relaxed);
        }
        drop(guard);
        Some(old)
    }

    /// The word at an aligned byte offset, for atomics; `None` outside the buffer.
    #[doc(hidden)]
    pub fn word(&self, offset: u64) -> Option<&AtomicU32> {
        let inside = offset.is_multiple_of(4) && offset.checked_add(4)? <= self.size;
        inside.then(|| self.word_at(offset))
    }
}

/// The size and the first bytes: a buffer of any size prints one line.
impl fmt::Debug for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Buffer({} bytes", self.size)?;
        if self.null {
            f.write_str(", null")?;
        }
        if let Some(name) = &self.view_of {
            write!(f, ", from {} of `{name}`", self.offset())?;
        }
        let shown = self.words().iter().take(SHOWN_BYTES / 4);
        let bytes = shown.flat_map(|word| word.load(Relaxed).to_le_bytes()).take(self.size as usize);
        let bytes: Vec<String> = bytes.map(|byte| format!("{byte:02x}")).collect();
        let more = if self.size > SHOWN_BYTES as u64 { " ..." } else { "" };
        match bytes.is_empty() {
            true => f.write_str(")"),
            false => write!(f, ": {}{more})", bytes.join(" ")),
        }
    }
}

/// Bytes that [`Buffer`] prints.
const SHOWN_BYTES: usize = 16;

/// As many words of zero as this many bytes take.
fn zeros(bytes: usize) -> Words {
    Arc::new(zeroed_slice_box(bytes.div_ceil(4)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_behind_the_given_bytes_is_zero() {
        let bytes = |given: &[u8], size| Buffer::with_size(given, size).bytes();
        assert_eq!(bytes(&[1, 2, 3, 4, 5], 10), [1, 2, 3, 4, 5, 0, 0, 0, 0, 0]);
        assert_eq!(bytes(&[1, 2, 3, 4, 5, 6, 7, 8], 7), [1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(bytes(&[1, 2, 3, 4], 8), [1, 2, 3, 4, 0, 0, 0, 0]);
        assert_eq!(bytes(&[], 3), [0, 0, 0]);
        // What is beyond the size is nobody's, the rest of its last word included.
        let words = Buffer::with_size(&[1, 2, 3, 4, 5, 6], 5);
        let words: Vec<u32> = words.words().iter().map(|word| word.load(Relaxed)).collect();
        assert_eq!(words, [u32::from_le_bytes([1, 2, 3, 4]), 5]);
    }
}
