//! What a debugger needs of debug information: lexical scopes, local variables and where their
//! values are, calls that the compiler inlined.
//!
//! It is read when somebody first asks ([`Module::debug_scopes`]), as only debuggers do.

use std::collections::HashMap;
use std::sync::Arc;

use smallvec::SmallVec;

use crate::module::debug_info::SourceLine;
use crate::module::{BasicBlock, Function, Id, Module};

/// The lexical scopes of a module, and what is declared in them. All lists that have offsets are
/// ascending by them.
#[derive(Clone, Debug, Default)]
pub struct DebugScopes {
    /// Functions and blocks of the source.
    pub scopes: Vec<LexicalScope>,
    /// By the id of an `OpFunction`: its scope.
    pub functions: HashMap<Id, u32>,
    /// Local variables and parameters.
    pub variables: Vec<SourceVariable>,
    /// Where the values of variables are.
    pub locations: Vec<VariableLocation>,
    /// The scope of the instructions from a word offset on, to the end of their block; `None` where
    /// they are of none.
    pub scope_changes: Vec<(u32, Option<ScopePosition>)>,
    /// Calls that the compiler inlined.
    pub inlined_calls: Vec<InlinedCall>,
    /// By the id of a module's variable: the line where it is declared.
    pub global_lines: HashMap<Id, u32>,
}

/// A function of the source, or a block in one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LexicalScope {
    /// The function's name; `None` for a block.
    pub function: Option<Arc<str>>,
    /// Index into [`DebugScopes::scopes`] of the scope around it; `None` for a function.
    pub parent: Option<u32>,
    /// Index into [`DebugInfo::files`](crate::module::debug_info::DebugInfo::files).
    pub file: Option<u32>,
    /// The first line, where the compiler tells it.
    pub line: Option<u32>,
}

/// A variable of the source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceVariable {
    /// Its name.
    pub name: Arc<str>,
    /// Its type.
    pub ty: SourceType,
    /// The line where it is declared, where the compiler tells it.
    pub line: Option<u32>,
    /// Index into [`DebugScopes::scopes`].
    pub scope: u32,
    /// The number of a parameter, from 1; 0 for another variable.
    pub argument: u32,
}

/// The type of a variable of the source.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceType {
    /// Its name, if it is a struct.
    pub name: Option<Arc<str>>,
    /// How many members, elements or components it has; 0 for a type that has none, and where debug
    /// information does not tell.
    pub parts: u32,
}

/// Where a value of a variable, or of a part of it, is from an instruction on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VariableLocation {
    /// The word offset of the `DebugDeclare` or `DebugValue`.
    pub offset: u32,
    /// Index into [`DebugScopes::variables`].
    pub variable: u32,
    /// Index into [`DebugScopes::inlined_calls`] of the call whose variable it is.
    pub inlined: Option<u32>,
    /// What holds it.
    pub value: Id,
    /// How `value` holds it.
    pub form: LocationForm,
    /// The indices of members and elements that lead from the variable to the part.
    pub path: SmallVec<[u32; 2]>,
}

/// How an id holds the value of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LocationForm {
    /// It is a pointer to the variable, as long as the variable lives (`DebugDeclare`).
    Declared,
    /// It is a pointer to the value (`DebugValue` with `Deref`).
    Pointer,
    /// It is the value (`DebugValue`).
    Direct,
    /// It is neither: the expression of the instruction calculates something else from it.
    Calculated,
}

/// Where an instruction stands in the source: a scope, and the inlined call that it is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScopePosition {
    /// Index into [`DebugScopes::scopes`].
    pub scope: u32,
    /// Index into [`DebugScopes::inlined_calls`].
    pub inlined: Option<u32>,
}

/// A call that the compiler inlined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InlinedCall {
    /// The line of the call.
    pub line: u32,
    /// The scope that the call stands in.
    pub scope: u32,
    /// The inlined call that it stands in, where it does.
    pub inlined: Option<u32>,
}

impl DebugScopes {
    /// The scope of the instruction at a word offset of a function: that of debug information, else
    /// that of the whole function.
    pub fn position(&self, function: &Function, offset: u32) -> Option<ScopePosition> {
        let block = function.blocks.iter().rfind(|block| block.offset <= offset);
        let start = block.map_or(function.offset, |block| block.offset);
        let after = self.scope_changes.partition_point(|&(from, _)| from <= offset);
        let last = self.scope_changes[..after].last().filter(|&&(from, _)| from >= start);
        let whole = || self.functions.get(&function.id).map(|&scope| ScopePosition { scope, inlined: None });
        last.and_then(|&(_, position)| position).or_else(whole)
    }

    /// A scope and those around it, up to its function.
    pub fn chain(&self, scope: u32) -> impl Iterator<Item = u32> {
        // A chain that is no chain, as in an invalid module, ends.
        let parent = |&scope: &u32| self.scopes.get(scope as usize)?.parent;
        std::iter::successors(Some(scope), parent).take(self.scopes.len())
    }

    /// The name of the function that a scope is of.
    pub fn function_name(&self, scope: u32) -> Option<&Arc<str>> {
        self.chain(scope).find_map(|scope| self.scopes.get(scope as usize)?.function.as_ref())
    }

    /// The line of an inlined call.
    pub fn call_line(&self, call: InlinedCall) -> Option<SourceLine> {
        let file = self.chain(call.scope).find_map(|scope| self.scopes.get(scope as usize)?.file)?;
        Some(SourceLine { file, line: call.line, column: 0 })
    }

    /// The locations in a function, of which `from..to` are the word offsets.
    pub fn locations_between(&self, from: u32, to: u32) -> &[VariableLocation] {
        let at = |offset| self.locations.partition_point(|one| one.offset < offset);
        &self.locations[at(from)..at(to.max(from))]
    }
}

impl Module {
    /// The function that a word offset is in.
    #[doc(hidden)]
    pub fn function_at(&self, offset: u32) -> Option<&Function> {
        let after = self.functions.partition_point(|function| function.offset <= offset);
        self.functions[..after].last()
    }

    /// The word offset at which the function behind a function begins.
    #[doc(hidden)]
    pub fn end_of(&self, function: &Function) -> u32 {
        let after = self.functions.partition_point(|other| other.offset <= function.offset);
        self.functions.get(after).map_or(self.words.len() as u32, |next| next.offset)
    }

    /// The block of a function that a word offset is in: from its label on.
    #[doc(hidden)]
    pub fn block_at<'a>(&self, function: &'a Function, offset: u32) -> Option<&'a BasicBlock> {
        function.blocks.iter().rfind(|block| block.offset <= offset)
    }
}
