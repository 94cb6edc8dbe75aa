//! What belongs to an id: a definition, a type, a value.

use std::collections::HashMap;

use crate::module::Id;

/// A map by id.
///
/// Ids count from 1 with few gaps in what compilers write, so most stand in a table; a module may
/// use any id below 2^32 all the same, and those beyond the table stand in a map.
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

    /// What belongs to an id.
    pub fn find(&self, id: Id) -> Option<T> {
        match self.table.get(id.0 as usize) {
            Some(value) => *value,
            None => self.map.get(&id).copied(),
        }
    }

    /// Gives an id something; what it replaces.
    pub fn insert(&mut self, id: Id, value: T) -> Option<T> {
        match self.table.get_mut(id.0 as usize) {
            Some(place) => place.replace(value),
            None => self.map.insert(id, value),
        }
    }
}

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
