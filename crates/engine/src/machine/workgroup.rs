//! Workgroups of a compute dispatch.

use std::sync::Arc;

use crate::machine::buffer::Buffer;
use crate::math::array;

/// A workgroup: what its invocations share.
#[derive(Clone, Debug)]
pub struct Workgroup {
    /// `WorkgroupId`
    pub id: [u32; 3],
    /// `NumWorkgroups`
    pub count: [u32; 3],
    /// `WorkgroupSize`
    pub size: [u32; 3],
    /// The variables of the Workgroup storage class. They begin as zeros, so that what a shader
    /// reads before it writes is the same every time.
    pub memory: Arc<Buffer>,
}

impl Workgroup {
    /// How many invocations it has.
    pub fn invocations(&self) -> u32 {
        self.size.iter().product()
    }

    /// The place in the dispatch, x fastest.
    pub fn index(&self) -> u64 {
        let [x, y, z] = array::map(self.id, u64::from);
        let [width, height, _] = array::map(self.count, u64::from);
        (z * height + y) * width + x
    }

    /// `LocalInvocationId` of the invocation with a `LocalInvocationIndex`.
    #[inline]
    pub fn local_id(&self, index: u32) -> [u32; 3] {
        let [width, height, _] = self.size;
        [index % width, index / width % height, index / (width * height)]
    }

    /// `GlobalInvocationId` of the invocation with a `LocalInvocationIndex`.
    #[inline]
    pub fn global_id(&self, index: u32) -> [u32; 3] {
        let local = self.local_id(index);
        // The sizes of a dispatch are checked before it begins: no product overflows.
        array::from_fn(|axis| self.id[axis] * self.size[axis] + local[axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_by_hand() {
        let memory = Buffer::zeroed(0);
        let group = Workgroup { id: [1, 0, 2], count: [3, 2, 4], size: [4, 2, 2], memory };
        assert_eq!(group.invocations(), 16);
        assert_eq!(group.index(), 2 * 6 + 1);
        // 13 = 1 * 8 + 1 * 4 + 1.
        assert_eq!(group.local_id(13), [1, 1, 1]);
        assert_eq!(group.global_id(13), [5, 1, 5]);
    }
}
