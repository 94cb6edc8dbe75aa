//! A bound of what the declarations of a module copy.

use anyhit_base::error::{Error, ErrorKind, Place, Result};

/// Bounds the copies that a few words can request (a group's decorations for each target).
pub(super) struct CopyBudget {
    left: usize,
}

impl CopyBudget {
    pub(super) fn new(words: usize) -> Self {
        Self { left: 16 * words + 65_536 }
    }

    pub(super) fn spend(&mut self, words: usize, at: usize) -> Result<()> {
        match self.left.checked_sub(words) {
            Some(left) => {
                self.left = left;
                Ok(())
            }
            None => Err(Error::new(
                ErrorKind::UnsupportedModule,
                "the module copies more decorations or modes than anyhit supports for its size",
            )
            .at(Place::Word(at))),
        }
    }
}
