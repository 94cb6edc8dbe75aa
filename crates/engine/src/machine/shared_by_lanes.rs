//! What lanes of a batch share: acceleration structures, workgroups.

use std::sync::Arc;

use smallvec::SmallVec;

use crate::machine::lanes::{Lanes, Mask};

/// An object for each lane. Mostly all lanes have the same one: the distinct objects are stored
/// once, and each lane has an index.
#[derive(Debug)]
pub struct SharedByLanes<T, const W: usize> {
    all: SmallVec<[Arc<T>; 1]>,
    indices: Lanes<W>,
}

impl<T, const W: usize> SharedByLanes<T, W> {
    /// Discards all objects.
    pub fn clear(&mut self) {
        self.all.clear();
    }

    /// Discards the objects, but keeps a single one: the lanes most likely have it next, too, and
    /// its reference count is shared by all threads.
    pub fn clear_several(&mut self) {
        if self.all.len() > 1 {
            self.all.clear();
        }
    }

    /// The index of an object, which is added if it is new.
    #[inline]
    fn index_of(&mut self, object: &Arc<T>) -> u32 {
        let known = self.all.iter().rposition(|known| Arc::ptr_eq(known, object));
        known.unwrap_or_else(|| {
            self.all.push(object.clone());
            self.all.len() - 1
        }) as u32
    }

    /// The distinct objects.
    pub fn all(&self) -> &[Arc<T>] {
        &self.all
    }

    /// The index of each lane's object.
    pub fn indices(&self) -> &Lanes<W> {
        &self.indices
    }

    /// Sets the object of some lanes.
    #[inline]
    pub fn set(&mut self, lanes: Mask<W>, object: &Arc<T>) {
        let index = self.index_of(object);
        for lane in lanes.lanes() {
            self.indices.0[lane] = index;
        }
    }

    /// The object of a lane; `None` where no lane has one.
    #[inline]
    pub fn get(&self, lane: usize) -> Option<&Arc<T>> {
        self.all.get(self.indices.0[lane] as usize)
    }

    /// Copies the objects of another batch.
    pub fn copy(&mut self, from: &Self) {
        let same = |(a, b): (&Arc<T>, &Arc<T>)| Arc::ptr_eq(a, b);
        if self.all.len() != from.all.len() || !self.all.iter().zip(&from.all).all(same) {
            self.all.clone_from(&from.all);
        }
        self.indices = from.indices;
    }
}

impl<T, const W: usize> Default for SharedByLanes<T, W> {
    fn default() -> Self {
        Self { all: SmallVec::new(), indices: Lanes([0; W]) }
    }
}

impl<T, const W: usize> Clone for SharedByLanes<T, W> {
    fn clone(&self) -> Self {
        Self { all: self.all.clone(), indices: self.indices }
    }
}
