//! What ids stand for while functions are lowered.

use rustc_hash::FxHashMap;

use crate::module::id_map::IdMap;
use crate::module::{Id, Module};
use crate::ops::pointer::Pointer;
use crate::ops::value_registers::Words;

/// What an id stands for while its function is lowered.
#[derive(Clone, Debug)]
pub enum IdValue {
    /// A value in registers.
    Words(Words),
    /// A pointer that is known at least in part.
    Pointer(Box<Pointer>),
}

/// What ids stood for when a program was lowered, for debuggers: a program that is not optimised
/// keeps them.
#[derive(Clone, Debug, Default)]
pub struct IdValues {
    /// The values of constants and of variables of the module.
    globals: FxHashMap<Id, IdValue>,
    /// By inlined call, the values of its function.
    locals: FxHashMap<(u32, Id), IdValue>,
}

impl IdValues {
    /// What an id stands for in an inlined call, or in the whole module; `None` where the program
    /// does not use it.
    #[inline]
    pub fn find(&self, scope: u32, id: Id) -> Option<&IdValue> {
        self.locals.get(&(scope, id)).or_else(|| self.globals.get(&id))
    }

    /// Records what an id of a function stands for. The last record of an id holds.
    pub(super) fn record(&mut self, scope: u32, id: Id, value: &IdValue) {
        self.locals.insert((scope, id), value.clone());
    }
}

/// The values of ids: those of a module's constants and variables stay, those of a function last as
/// long as it is lowered.
#[derive(Debug)]
pub(super) struct Values {
    globals: FxHashMap<Id, IdValue>,
    /// The values of the function that is lowered, behind those of the functions that it is inlined
    /// into.
    locals: Vec<(Id, IdValue)>,
    /// By id: its last index in `locals`. The entry there may belong to another id by now.
    local_indices: IdMap<u32>,
}

impl Values {
    /// Returns a map without values.
    pub(super) fn new(module: &Module) -> Self {
        Self {
            globals: FxHashMap::default(),
            locals: Vec::new(),
            local_indices: IdMap::like(&module.definitions),
        }
    }

    /// The value of an id.
    pub(super) fn find(&self, id: Id) -> Option<&IdValue> {
        self.local(id).or_else(|| self.globals.get(&id))
    }

    /// The value of an id of the function that is lowered.
    #[inline]
    pub(super) fn local(&self, id: Id) -> Option<&IdValue> {
        let (owner, value) = self.locals.get(self.local_indices.find(id)? as usize)?;
        (*owner == id).then_some(value)
    }

    /// Gives an id of the function that is lowered its value.
    pub(super) fn define(&mut self, id: Id, value: IdValue) {
        let known = self.local_indices.find(id).and_then(|index| self.locals.get_mut(index as usize));
        match known.filter(|(owner, _)| *owner == id) {
            Some((_, known)) => *known = value,
            None => {
                self.local_indices.insert(id, self.locals.len() as u32);
                self.locals.push((id, value));
            }
        }
    }

    /// Gives a constant or a variable of the module its value.
    pub(super) fn define_global(&mut self, id: Id, value: IdValue) {
        self.globals.insert(id, value);
    }

    /// Adds the values of constants and variables of the module to a record.
    pub(super) fn add_globals(self, record: &mut IdValues) {
        record.globals = self.globals;
    }

    /// The number of values of functions; [`Values::truncate_locals`] goes back to it.
    pub(super) fn local_count(&self) -> usize {
        self.locals.len()
    }

    /// Discards the values of functions but for the first `locals`.
    pub(super) fn truncate_locals(&mut self, locals: usize) {
        self.locals.truncate(locals);
    }
}
