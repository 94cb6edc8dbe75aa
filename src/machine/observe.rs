//! Watching a batch run.

use crate::machine::batch::Batch;

/// Is told what a batch does; the unit type watches nothing and costs nothing.
pub trait Observer<const W: usize> {
    /// Whether [`Observer::before`] is called at all; a constant, so that an idle observer's code
    /// compiles away.
    const ACTIVE: bool = true;

    /// Called before each operation; `true` pauses the batch there.
    fn before(&mut self, batch: &Batch<W>, op: u32) -> bool {
        let _ = (batch, op);
        false
    }
}

impl<const W: usize> Observer<W> for () {
    const ACTIVE: bool = false;
}

impl<const W: usize> Observer<W> for &mut dyn FnMut(&Batch<W>, u32) -> bool {
    fn before(&mut self, batch: &Batch<W>, op: u32) -> bool {
        self(batch, op)
    }
}
