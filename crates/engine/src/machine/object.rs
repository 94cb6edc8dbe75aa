//! Pools of objects that variables hold by handle: ray queries and hit objects.

use crate::machine::lanes::{REGISTER_POINTER, Reg, Registers};
use crate::machine::trap::TrapCode;

/// Where the handle of a ray query or hit object lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectRef {
    /// In a known register.
    Register(Reg),
    /// In the register `first + index[lane]`.
    Computed {
        /// The register for index 0.
        first: Reg,
        /// The register that holds the index.
        index: Reg,
    },
}

impl ObjectRef {
    /// The register of a lane's handle.
    ///
    /// # Errors
    /// `IndexOutOfBounds`, `NullPointer`
    #[inline]
    pub fn register<const W: usize>(self, registers: &Registers<W>, lane: usize) -> Result<Reg, TrapCode> {
        match self {
            Self::Register(reg) => Ok(reg),
            Self::Computed { first, index } => {
                let words = registers[index].0[lane];
                let register = first.computed(words);
                // An index outside its array is the greatest number.
                if words != u32::MAX && (register.0 as usize) < registers.len() {
                    Ok(register)
                } else if first.0 >= REGISTER_POINTER && words < REGISTER_POINTER {
                    Err(TrapCode::NullPointer)
                } else {
                    Err(TrapCode::IndexOutOfBounds)
                }
            }
        }
    }
}

/// A pool of the objects of a batch, by handle: 0 is none, else 1 + the index in the pool. The
/// memory of discarded objects is reused.
#[derive(Clone, Debug)]
pub struct ObjectPool<T> {
    all: Vec<T>,
    used: usize,
}

impl<T> Default for ObjectPool<T> {
    fn default() -> Self {
        Self { all: Vec::new(), used: 0 }
    }
}

impl<T: Default> ObjectPool<T> {
    /// Discards all objects; the memory stays allocated.
    pub fn clear(&mut self) {
        self.used = 0;
    }

    /// The object with a handle; where that is 0, a new one with stale contents. Also gives its
    /// handle.
    #[inline]
    pub fn get_or_insert(&mut self, handle: u32) -> (u32, &mut T) {
        let at = if handle == 0 { self.used } else { handle as usize - 1 };
        self.used = self.used.max(at + 1);
        if self.all.len() < self.used {
            self.all.resize_with(self.used, T::default);
        }
        (at as u32 + 1, &mut self.all[at])
    }

    /// The object with a handle.
    #[inline]
    pub fn get_mut(&mut self, handle: u32) -> Option<&mut T> {
        self.all[..self.used].get_mut((handle as usize).wrapping_sub(1))
    }

    /// All objects.
    pub fn iter(&self) -> std::slice::Iter<'_, T> {
        self.all[..self.used].iter()
    }

    /// The object with a handle.
    #[inline]
    pub fn get(&self, handle: u32) -> Option<&T> {
        self.all[..self.used].get((handle as usize).wrapping_sub(1))
    }
}
