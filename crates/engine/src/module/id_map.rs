//! A map from ids to values: definitions, types.

use std::collections::HashMap;

use crate::module::{Id, Opcode};

/// A map from ids to values.
///
/// Compilers number ids from 1 with few gaps, so most are looked up in a table by index. A module
/// may use any id below 2^32, though: ids beyond the table are kept in a hash map.
#[derive(Clone, Debug, Default)]
pub struct IdMap<T> {
    table: Vec<Option<T>>,
    map: HashMap<Id, T>,
}

impl<T: Copy> IdMap<T> {
    /// An empty map with a table for ids below `dense`: bound that by the size of the module.
    pub fn new(dense: usize) -> Self {
        Self { table: vec![None; dense], map: HashMap::new() }
    }

    /// An empty map with a table for as many ids as that of another map.
    pub fn like<U>(other: &IdMap<U>) -> Self {
        Self::new(other.table.len())
    }

    /// The value of an id.
    #[inline]
    pub fn find(&self, id: Id) -> Option<T> {
        match self.table.get(id.0 as usize) {
            Some(value) => *value,
            None => self.map.get(&id).copied(),
        }
    }

    /// Sets the value of an id; returns the one that it replaces.
    #[inline]
    pub fn insert(&mut self, id: Id, value: T) -> Option<T> {
        match self.table.get_mut(id.0 as usize) {
            Some(entry) => entry.replace(value),
            None => self.map.insert(id, value),
        }
    }
}

/// Ids that an instruction of unknown opcode may define, with that opcode.
pub(super) type UnknownResults = HashMap<Id, Opcode>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_in_and_beyond_the_table_are_found() {
        let mut map = IdMap::new(4);
        for id in [0, 3, 4, u32::MAX] {
            assert_eq!(map.find(Id(id)), None);
            assert_eq!(map.insert(Id(id), id), None);
        }
        for id in [0, 3, 4, u32::MAX] {
            assert_eq!(map.find(Id(id)), Some(id));
            assert_eq!(map.insert(Id(id), 7), Some(id));
        }
    }
}
