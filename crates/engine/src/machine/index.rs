//! Indices into the lists of programs and pipelines, each a type of its own: none can be passed
//! where another one is meant, or a register, or a count.

use std::fmt;

/// Defines types of indices.
macro_rules! indices {
    ($($(#[$attribute:meta])* $index:ident)*) => {
        $(
            $(#[$attribute])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
            #[repr(transparent)]
            pub struct $index(pub u32);

            impl $index {
                /// The index of an item of a list, which has fewer than 2^32.
                #[inline]
                #[must_use]
                pub const fn new(index: usize) -> Self {
                    Self(index as u32)
                }

                /// The index, to take the item of a list.
                #[inline]
                #[must_use]
                pub const fn index(self) -> usize {
                    self.0 as usize
                }

                /// The index `count` items further on.
                #[inline]
                #[must_use]
                pub const fn plus(self, count: u32) -> Self {
                    Self(self.0 + count)
                }

                /// The index of the item before it; `None` for the first.
                #[inline]
                #[must_use]
                pub const fn previous(self) -> Option<Self> {
                    match self.0.checked_sub(1) {
                        Some(index) => Some(Self(index)),
                        None => None,
                    }
                }
            }

            impl fmt::Display for $index {
                fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                    fmt::Display::fmt(&self.0, f)
                }
            }
        )*
    };
}

indices! {
    /// A block of a program: its index in [`Program::blocks`](crate::program::Program::blocks).
    BlockIndex
    /// An operation of a program: its index in [`Program::ops`](crate::program::Program::ops). The
    /// terminators of the blocks are counted on after the last operation, as in
    /// [`Program::origins`](crate::program::Program::origins).
    OpIndex
    /// A shader of a pipeline: the index of its program in
    /// [`Pipeline::programs`](crate::pipeline::Pipeline::programs). A compute shader is number 0.
    ShaderIndex
}
