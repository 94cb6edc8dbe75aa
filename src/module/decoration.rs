//! Decorations of ids and of struct members.

use std::collections::HashMap;

use crate::module::Id;

/// A decoration with its literal operands, numbers as in the specification.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decoration {
    /// The decoration's number.
    pub number: u32,
    /// The words after it.
    pub operands: Vec<u32>,
}

/// All decorations of a module; groups are already applied to their targets.
#[derive(Clone, Debug, Default)]
pub struct Decorations {
    /// Of ids.
    pub of_id: HashMap<Id, Vec<Decoration>>,
    /// Of struct members: the struct's id, the member's index.
    pub of_member: HashMap<(Id, u32), Vec<Decoration>>,
}

impl Decorations {
    /// The decoration with this number on an id.
    pub fn find(&self, id: Id, number: u32) -> Option<&Decoration> {
        self.of_id.get(&id)?.iter().find(|decoration| decoration.number == number)
    }

    /// The first literal of a decoration on an id.
    pub fn literal(&self, id: Id, number: u32) -> Option<u32> {
        self.find(id, number)?.operands.first().copied()
    }
}
