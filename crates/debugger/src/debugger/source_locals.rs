//! The local variables of a function: those of debug information, else those that `OpName` names.

use std::sync::Arc;

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use anyhit_engine::module::debug_scopes::{
    DebugScopes, LocationForm, ScopePosition, SourceType, VariableLocation,
};
use anyhit_engine::module::ty::Type;
use anyhit_engine::module::{Function, Id, Module, Opcode};

/// What Slang puts before the name of a variable that holds a copy for debuggers.
const COPY_PREFIX: &str = "_dbgvar_";
/// The tool of glslang in the generator word (SPIR-V registry).
const GLSLANG: u32 = 8;
/// What glslang calls its own variables: arguments of calls, arrays that are indexed.
const GLSLANG_TEMPORARIES: [&str; 2] = ["param", "indexable"];

/// A local variable of a function.
#[derive(Clone, Debug)]
pub(super) struct SourceLocal {
    pub(super) name: Arc<str>,
    pub(super) line: Option<u32>,
    /// How many scopes are between it and the instruction: 0 for the innermost scope.
    pub(super) depth: u32,
    pub(super) is_parameter: bool,
    /// Its type in the source, where debug information tells.
    pub(super) ty: Option<SourceType>,
    /// Where its values are, ascending by offset.
    pub(super) locations: Vec<VariableLocation>,
    /// The variable whose copy for debuggers the declaration names.
    pub(super) original: Option<Id>,
    /// Whether the declaration names a copy for debuggers whose original is in values.
    pub(super) is_copy: bool,
}

/// The local variables that are visible at a position of a function.
pub(super) fn locals_of(
    module: &Module,
    function: &Function,
    position: Option<ScopePosition>,
) -> Vec<SourceLocal> {
    let debug = module.debug_scopes();
    match position {
        Some(position) => debug_locals(module, debug, function, position),
        None => named_locals(module, function),
    }
}

fn debug_locals(
    module: &Module,
    debug: &DebugScopes,
    function: &Function,
    position: ScopePosition,
) -> Vec<SourceLocal> {
    let all = debug.locations_between(function.offset, module.end_of(function));
    let depths: FxHashMap<u32, u32> = debug.chain(position.scope).zip(0..).collect();
    let visible = debug.variables.iter().zip(0..);
    let locals = visible.filter_map(|(variable, index)| {
        let &depth = depths.get(&variable.scope)?;
        let is_here = |one: &&VariableLocation| one.variable == index && one.inlined == position.inlined;
        let locations: Vec<VariableLocation> = all.iter().filter(is_here).cloned().collect();
        let declared = locations.iter().find(|one| one.form == LocationForm::Declared);
        let copy = declared.filter(|one| is_debug_copy(module, one.value, &variable.name));
        let original = copy.and_then(|copy| original_of(module, function, copy.value, &variable.name));
        let is_copy = copy.is_some() && original.is_none();
        Some(SourceLocal {
            name: variable.name.clone(),
            line: variable.line,
            depth,
            is_parameter: variable.argument > 0,
            ty: Some(variable.ty.clone()),
            locations,
            original,
            is_copy,
        })
    });
    locals.collect()
}

/// Whether a variable is Slang's copy of another for debuggers. Copies in functions that the
/// compiler has inlined have no names; neither do their originals.
fn is_debug_copy(module: &Module, id: Id, name: &str) -> bool {
    const SLANG: u32 = 40;
    match module.name(id).and_then(|name| name.strip_prefix(COPY_PREFIX)) {
        Some(original) => original == name,
        None => module.generator >> 16 == SLANG && !module.debug_info.names.contains_key(&id),
    }
}

/// The variable that another is a copy of, where it is certain: the only one of its type and name.
fn original_of(module: &Module, function: &Function, copy: Id, name: &str) -> Option<Id> {
    let named = variables(function).filter(|&id| {
        id != copy
            && module.debug_info.names.get(&id).is_some_and(|known| known == name)
            && module.pointee(id) == module.pointee(copy)
    });
    let found: SmallVec<[Id; 2]> = named.take(2).collect();
    match found[..] {
        [one] => Some(one),
        _ => None,
    }
}

/// The variables of a function.
fn variables(function: &Function) -> impl Iterator<Item = Id> {
    let first = function.blocks.first().map_or(&[][..], |block| &block.instructions);
    let variables = first.iter().filter(|instruction| instruction.opcode == Opcode::Variable);
    variables.filter_map(|instruction| instruction.result)
}

/// The local variables and values that have names, in a function without scopes.
fn named_locals(module: &Module, function: &Function) -> Vec<SourceLocal> {
    let mut locals: Vec<SourceLocal> = Vec::new();
    let mut indices: FxHashMap<&str, usize> = FxHashMap::default();
    let location = |offset: u32, value: Id, form: LocationForm| VariableLocation {
        offset,
        variable: 0,
        inlined: None,
        value,
        form,
        path: SmallVec::new(),
    };
    let parameters = function.parameters.iter().map(|&(id, ty)| (id, ty, function.offset, true));
    let all = function.instructions().filter_map(|one| {
        let id = one.result?;
        Some((id, module.type_of(id)?, one.offset, false))
    });
    let uses = first_uses(module, function);
    for (id, ty, offset, is_parameter) in parameters.chain(all) {
        let Some(name) = module.name(id).filter(|name| !is_temporary(module, name)) else { continue };
        let is_variable = is_parameter || variables(function).any(|variable| variable == id);
        let is_pointer = matches!(module.ty(ty), Type::Pointer { .. });
        let (form, offset) = match (is_pointer, is_variable, is_parameter) {
            (true, true, true) => (LocationForm::Declared, offset),
            (true, true, false) => (LocationForm::Declared, uses.get(&id).copied().unwrap_or(u32::MAX)),
            // The result of an access chain, which is named for what it leads to.
            (true, false, _) => (LocationForm::Pointer, offset),
            (false, ..) => (LocationForm::Direct, offset),
        };
        let value = location(offset, id, form);
        // A variable stands for itself; values of one name are those of one variable.
        if form != LocationForm::Declared
            && let Some(&index) = indices.get(name)
        {
            locals[index].locations.push(value);
            continue;
        }
        if form != LocationForm::Declared {
            indices.insert(name, locals.len());
        }
        locals.push(SourceLocal {
            name: name.into(),
            // Without a declaration in debug information, that of the first use.
            line: module.debug_info.line_at(offset).map(|line| line.line),
            depth: 0,
            is_parameter,
            ty: None,
            locations: vec![value],
            original: None,
            is_copy: false,
        });
    }
    locals
}

fn is_temporary(module: &Module, name: &str) -> bool {
    let glslang = module.generator >> 16 == GLSLANG && GLSLANG_TEMPORARIES.contains(&name);
    glslang || name.starts_with(COPY_PREFIX)
}

/// By variable of a function: the word offset of the first instruction that uses it.
fn first_uses(module: &Module, function: &Function) -> FxHashMap<Id, u32> {
    let mut uses = FxHashMap::default();
    for instruction in function.instructions() {
        for id in module.operand_ids(instruction) {
            uses.entry(id).or_insert(instruction.offset);
        }
    }
    uses
}
