//! Which record of the shader binding table a ray calls.

use std::fmt;

/// The index of a record in its table: hit, miss or callable. That of a hit record may have more
/// than 32 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(transparent)]
pub struct RecordIndex(pub u64);

impl RecordIndex {
    /// The index of a hit record (Vulkan, "Hit Group Shader Binding Table"): the low 4 bits of
    /// stride and offset count.
    #[inline]
    pub fn of_hit(instance_offset: u32, geometry: u32, stride: u32, offset: u32) -> Self {
        let of_geometry = u64::from(geometry) * u64::from(stride & 0xF);
        Self(u64::from(instance_offset) + of_geometry + u64::from(offset & 0xF))
    }

    /// The index of a miss record: the low 16 bits of a trace's miss index.
    #[inline]
    pub fn of_miss(miss_index: u32) -> Self {
        Self((miss_index & 0xFFFF).into())
    }

    /// The item of a table at this index; `None` beyond its end.
    #[inline]
    pub fn get<T>(self, table: &[T]) -> Option<&T> {
        table.get(usize::try_from(self.0).ok()?)
    }
}

impl fmt::Display for RecordIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hit_index_masks_offset_and_stride_to_four_bits() {
        let of_hit = |instance_offset, geometry, stride, offset| {
            RecordIndex::of_hit(instance_offset, geometry, stride, offset).0
        };
        assert_eq!(of_hit(10, 2, 3, 1), 17);
        assert_eq!(of_hit(10, 2, 0x13, 0x21), 17);
        assert_eq!(of_hit(0xFF_FFFF, 0xFF_FFFF, 15, 15), 0xFF_FFFF + 0xFF_FFFF * 15 + 15);
    }
}
