//! What was watched held at one time, and what of it nobody had written then.

use anyhit_engine::machine::Reg;
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::reflect::value::{TypedValue, ValueContent, ValueMember, type_name};
use anyhit_engine::reflect::{Layout, Rules};

use super::unwritten::UnwrittenRegisters;

/// What stands for a value that nobody has written.
pub(super) const UNWRITTEN: &str = "<not yet written>";

/// Words at one time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WordsThen {
    /// The words.
    pub words: Vec<u32>,
    /// By word, whether nobody had written it; empty for words of memory.
    pub unwritten: Vec<bool>,
}

impl WordsThen {
    /// Words of memory.
    pub(super) fn of_memory(words: Vec<u32>) -> Self {
        Self { words, unwritten: Vec::new() }
    }

    /// The value of a type that they were.
    pub(super) fn value(&self, module: &Module, ty: TypeId) -> TypedValue {
        value(module, ty, &self.words, &self.unwritten)
    }
}

/// The registers of an invocation in one of its shaders, as they are now.
pub(super) struct RegistersNow<'a> {
    /// Reads a register.
    pub(super) word: &'a dyn Fn(Reg) -> u32,
    /// Those that nobody has written.
    pub(super) unwritten: &'a UnwrittenRegisters,
}

impl RegistersNow<'_> {
    /// What registers hold.
    pub(super) fn words(&self, registers: &[Reg]) -> WordsThen {
        WordsThen {
            words: registers.iter().map(|&reg| (self.word)(reg)).collect(),
            unwritten: registers.iter().map(|&reg| self.unwritten.contains(reg)).collect(),
        }
    }
}

fn value(module: &Module, ty: TypeId, words: &[u32], unwritten: &[bool]) -> TypedValue {
    if !unwritten.contains(&true) {
        return TypedValue::of_type(module, ty, words);
    }
    let whole = |content: ValueContent| TypedValue { ty: type_name(module, ty), content };
    let layout = Layout::new(module, ty, Rules::Packed);
    if layout.is_scalar() || !unwritten.contains(&false) {
        return whole(ValueContent::Text(UNWRITTEN.into()));
    }
    let parts = (0..layout.child_count()).filter_map(|at| layout.child(at));
    let values = parts.map(|(offset, part)| {
        let first = (offset / 4).min(words.len());
        let range = first..(first + part.size() / 4).min(words.len());
        value(module, part.ty, &words[range.clone()], &unwritten[range])
    });
    whole(match module.ty(ty) {
        Type::Struct { members, .. } => {
            let named = members.iter().zip(values);
            let named = named.map(|(member, value)| ValueMember { name: member.name.clone(), value });
            ValueContent::Members(named.collect())
        }
        _ => ValueContent::List(values.map(|value| value.content).collect()),
    })
}
