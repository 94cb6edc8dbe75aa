//! What is known of the registers of the batch that runs, until they are written again.

use rustc_hash::FxHashMap;

use anyhit_engine::machine::{Batch, Reg};
use anyhit_engine::ops::access::{Access, RegCopy};
use anyhit_engine::ops::op::Op;

/// How the value of a register came about, lane by lane.
#[derive(Clone, Debug)]
pub(super) struct LiveValue<T> {
    /// How it did.
    pub made_of: T,
    /// The lanes for which that holds.
    lanes: Vec<bool>,
}

impl<T> LiveValue<T> {
    /// Whether it holds for a lane.
    pub(super) fn holds(&self, lane: usize) -> bool {
        self.lanes[lane]
    }
}

/// How the values of registers came about.
#[derive(Debug)]
pub(super) struct LiveRegisters<T>(FxHashMap<Reg, LiveValue<T>>);

impl<T> Default for LiveRegisters<T> {
    fn default() -> Self {
        Self(FxHashMap::default())
    }
}

impl<T: Clone> LiveRegisters<T> {
    /// Forgets all registers, as another batch runs.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// How the value of a register came about, if that is known.
    pub(super) fn get(&self, register: Reg) -> Option<&LiveValue<T>> {
        self.0.get(&register)
    }

    /// Notes how the value of a register came about, in those running lanes for which a condition
    /// holds.
    pub(super) fn set<const W: usize>(
        &mut self,
        register: Reg,
        made_of: T,
        batch: &Batch<W>,
        holds: impl Fn(usize) -> bool,
    ) {
        let lanes = (0..W).map(|lane| batch.mask.contains(lane) && holds(lane)).collect();
        self.0.insert(register, LiveValue { made_of, lanes });
    }

    /// Forgets the registers that an operation has written, but for those that it moved.
    pub(super) fn follow<const W: usize>(&mut self, executed: &Op, batch: &Batch<W>) {
        if self.0.is_empty() {
            return;
        }
        if let Some(RegCopy { to, from, .. }) = executed.copy()
            && let Some(LiveValue { made_of, lanes }) = self.0.get(&from).cloned()
        {
            return self.set(to, made_of, batch, |lane| lanes[lane]);
        }
        executed.accesses(|access| {
            if let Access::Write(first, count) = access {
                (0..count).for_each(|word| {
                    self.0.remove(&first.plus(word));
                });
            }
        });
    }
}
