//! What each id stands for.

use std::collections::HashMap;

use crate::module::{Definition, Id};

/// A map from id to definition.
///
/// Ids count from 1 with few gaps in what compilers write, so most stand in a table; a module may
/// use any id below 2^32 all the same, and those beyond the table stand in a map.
#[derive(Clone, Debug, Default)]
pub struct Definitions {
    table: Vec<Option<Definition>>,
    map: HashMap<Id, Definition>,
}

impl Definitions {
    /// An empty map with a table for ids below `dense`: bound that by the size of the module.
    pub(super) fn new(dense: usize) -> Self {
        Self { table: vec![None; dense], map: HashMap::new() }
    }

    /// What an id stands for; `None` where nothing defines it.
    pub fn find(&self, id: Id) -> Option<Definition> {
        match self.table.get(id.0 as usize) {
            Some(definition) => *definition,
            None => self.map.get(&id).copied(),
        }
    }

    /// Defines an id; the definition that it replaces.
    pub(super) fn insert(&mut self, id: Id, definition: Definition) -> Option<Definition> {
        match self.table.get_mut(id.0 as usize) {
            Some(place) => place.replace(definition),
            None => self.map.insert(id, definition),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_in_and_beyond_the_table_are_found() {
        let mut definitions = Definitions::new(4);
        for id in [0, 3, 4, u32::MAX] {
            assert_eq!(definitions.find(Id(id)), None);
            assert_eq!(definitions.insert(Id(id), Definition::Constant(id)), None);
        }
        for id in [0, 3, 4, u32::MAX] {
            assert_eq!(definitions.find(Id(id)), Some(Definition::Constant(id)));
            assert_eq!(definitions.insert(Id(id), Definition::Other), Some(Definition::Constant(id)));
        }
    }
}
