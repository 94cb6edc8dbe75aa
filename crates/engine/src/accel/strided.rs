//! Elements of a buffer, a stride apart.

/// Elements in a buffer, a stride apart.
#[derive(Clone, Copy, Debug)]
pub struct Strided<'a> {
    /// The buffer from the address that the build is given.
    pub bytes: &'a [u8],
    /// Bytes from one element to the next; 0 repeats the first. `None` packs them tightly.
    pub stride: Option<u64>,
}

/// The layout of the elements of a buffer.
#[derive(Clone, Copy)]
pub(super) struct StridedLayout {
    /// Where the first one begins, in bytes.
    pub begin: u64,
    /// Bytes from one element to the next; 0 repeats the first.
    pub stride: u64,
    /// Bytes of an element.
    pub size: u64,
}

impl StridedLayout {
    /// How many elements there are; `None` where a stride of 0 makes it any number.
    pub(super) fn count(&self, bytes: &[u8]) -> Option<u64> {
        let length = (bytes.len() as u64).saturating_sub(self.begin);
        match (length.checked_sub(self.size), self.stride) {
            (None, _) => Some(0),
            (Some(_), 0) => None,
            (Some(rest), stride) => Some(rest / stride + 1),
        }
    }

    /// An element's bytes, or where it would have to end.
    pub(super) fn element<'a>(&self, bytes: &'a [u8], at: u64) -> Result<&'a [u8], u64> {
        let begin = self.begin.saturating_add(self.stride.saturating_mul(at));
        let end = begin.saturating_add(self.size);
        bytes.get(begin as usize..end as usize).ok_or(end)
    }
}
