//! The variables that a stopped invocation sees, by the names of the source.

use std::cmp::Reverse;
use std::sync::Arc;

use smallvec::SmallVec;

use crate::debugger::id_places::IdPlaces;
use crate::debugger::lane_state::LaneState;
use crate::debugger::place_memory::PlaceContext;
use crate::debugger::source_frames::{SourceFrame, source_frames};
use crate::debugger::source_locals::{SourceLocal, locals_of};
use crate::debugger::value_paths::{FoundPart, assemble, reaching};
use crate::debugger::variable_place::VariablePlace;
use anyhit_base::sorted::{SortedSet, sort_by_key};
use anyhit_engine::machine::OpIndex;
use anyhit_engine::module::debug_scopes::{LocationForm, VariableLocation};
use anyhit_engine::module::ty::Type;
use anyhit_engine::module::{Function, GlobalVariable, Id, Module};
use anyhit_engine::ops::builtin;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;

/// The `BuiltIn` decoration.
const BUILT_IN: u32 = 11;

/// A variable of the source.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Its name; that of its type for a block without a name.
    pub name: String,
    /// What it is.
    pub kind: VariableKind,
    /// The line where it is declared, where debug information tells.
    pub declared_line: Option<u32>,
    /// Whether its declaration has been reached: before that its value is what was there before.
    pub is_declared: bool,
    /// Whether its members are named without it: it is a block without a name.
    pub is_anonymous: bool,
    /// Where its value is.
    pub place: VariablePlace,
}

/// What a variable is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names are those of the field")]
pub enum VariableKind {
    Local,
    Parameter,
    /// A value of the compiler that has no name in the source.
    Temporary,
    Payload,
    CallableData,
    HitAttribute,
    ShaderRecord,
    PushConstant,
    Global,
    Workgroup,
    Buffer,
    /// An image, a sampler, an acceleration structure.
    Resource,
    Builtin,
}

/// The variables that are visible at an operation of a program that is not optimised: those of the
/// innermost function, the innermost scope first, then those of the module.
pub fn variables_in_scope(program: &Program, op: OpIndex, state: &dyn LaneState) -> Vec<Variable> {
    let origin = program.origins.get(op.index());
    let frame = origin.and_then(|&origin| source_frames(program, origin).into_iter().next());
    let mut variables = frame.map_or_else(Vec::new, |frame| variables_in_frame(program, &frame, state));
    variables.extend(global_variables(program, state));
    variables
}

/// The local variables of a frame, those of the innermost scope first. Of two with one name, the
/// first that is declared is the one that the name means.
pub fn variables_in_frame(program: &Program, frame: &SourceFrame, state: &dyn LaneState) -> Vec<Variable> {
    let Some(function) = function_of(program, frame) else { return Vec::new() };
    let places = id_places(program, frame.origin.scope, state);
    let here = frame.origin.offset;
    let mut found: Vec<(u32, u32, Variable)> = Vec::new();
    for local in locals_of(&program.module, function, frame.position) {
        let is_parameter = local.is_parameter;
        let (place, is_declared) = place_of_local(&places, function, &local, here);
        let last = local.locations.iter().map(|one| one.offset).filter(|&offset| offset < here).max();
        let variable = Variable {
            name: local.name.to_string(),
            kind: if is_parameter { VariableKind::Parameter } else { VariableKind::Local },
            declared_line: local.line,
            is_declared,
            is_anonymous: false,
            place,
        };
        found.push((local.depth, last.unwrap_or(0), variable));
    }
    sort_by_key(&mut found, |(depth, last, variable)| (*depth, !variable.is_declared, Reverse(*last)));
    let mut variables: Vec<Variable> = found.into_iter().map(|(.., variable)| variable).collect();
    if frame.origin.scope == 0 {
        find_interface_parameters(program, state, &mut variables);
    }
    variables
}

/// The storage classes of what a shader is given, which are parameters of an entry point in Slang.
const GIVEN: [u32; 3] =
    [storage::INCOMING_RAY_PAYLOAD, storage::INCOMING_CALLABLE_DATA, storage::HIT_ATTRIBUTE];

/// Slang's entry points have payload and attributes as parameters, of which debug information tells
/// only values that are stored. The variable of the interface that the shader is given and that has
/// the name is the parameter; what the shader passes on may have the same name.
fn find_interface_parameters(program: &Program, state: &dyn LaneState, variables: &mut [Variable]) {
    let is_parameter = |variable: &Variable| variable.kind == VariableKind::Parameter;
    if !variables.iter().any(is_parameter) {
        return;
    }
    let places = id_places(program, 0, state);
    let given = used_variables(program).filter(|one| GIVEN.contains(&one.storage_class));
    let interface: Vec<Variable> =
        given.map(|global| global_variable(&program.module, &places, global)).collect();
    for parameter in variables.iter_mut().filter(|variable| is_parameter(variable)) {
        if let Some(own) = interface.iter().find(|one| one.name == parameter.name) {
            (parameter.place, parameter.is_declared) = (own.place.clone(), true);
        }
    }
}

/// The variables of the module that the program uses.
pub fn global_variables(program: &Program, state: &dyn LaneState) -> Vec<Variable> {
    let places = id_places(program, 0, state);
    let mut used: Vec<&GlobalVariable> = used_variables(program).collect();
    // A name of two means the one that the shader is given, not the one that it passes on.
    sort_by_key(&mut used, |one| !GIVEN.contains(&one.storage_class));
    let mut variables: Vec<Variable> =
        used.into_iter().map(|global| global_variable(&program.module, &places, global)).collect();
    sort_by_key(&mut variables, |variable| variable.kind);
    variables
}

/// The variables of module scope that a program uses.
fn used_variables(program: &Program) -> impl Iterator<Item = &GlobalVariable> {
    program.module.variables.iter().filter(|one| program.id_values.find(0, one.id).is_some())
}

/// The values of the compiler's own in the block that a frame is in, `%12`, as far as they are
/// calculated.
pub fn temporaries_in_frame(program: &Program, frame: &SourceFrame, state: &dyn LaneState) -> Vec<Variable> {
    let places = id_places(program, frame.origin.scope, state);
    let (module, here) = (&program.module, frame.origin.offset);
    let block = function_of(program, frame).and_then(|function| module.block_at(function, here));
    let instructions = block.map_or(&[][..], |block| &block.instructions);
    let results = instructions.iter().filter(|instruction| instruction.offset < here);
    let values = results.filter_map(|instruction| {
        let id = instruction.result.filter(|_| instruction.result_type.is_some())?;
        let place = places.value(id);
        (place.why_unavailable().is_none()).then(|| Variable {
            name: format!("%{}", id.0),
            kind: VariableKind::Temporary,
            declared_line: module.debug_info.line_at(instruction.offset).map(|line| line.line),
            is_declared: true,
            is_anonymous: false,
            place,
        })
    });
    values.collect()
}

/// The value of an id in a frame, whatever its name: `%12`.
pub(super) fn value_of_id(
    program: &Program,
    frame: &SourceFrame,
    state: &dyn LaneState,
    id: Id,
) -> VariablePlace {
    id_places(program, frame.origin.scope, state).value(id)
}

fn function_of<'p>(program: &'p Program, frame: &SourceFrame) -> Option<&'p Function> {
    program.module.function(program.scopes.get(frame.origin.scope as usize)?.function)
}

fn id_places<'a>(program: &'a Program, scope: u32, state: &'a dyn LaneState) -> IdPlaces<'a> {
    IdPlaces { program, context: PlaceContext::new(program), state, scope }
}

fn global_variable(module: &Module, places: &IdPlaces<'_>, global: &GlobalVariable) -> Variable {
    let place = places.pointee(global.id);
    let builtin = module.decorations.literal(global.id, BUILT_IN).and_then(builtin::find);
    let named = module.name(global.id);
    let type_name = || module.name(module.id_of_type(place.ty())?);
    let name = named.or(builtin.map(|builtin| builtin.name)).or_else(type_name);
    let is_block = matches!(module.ty(place.ty()), Type::Struct { .. });
    Variable {
        name: name.map_or_else(|| format!("%{}", global.id.0), str::to_owned),
        kind: kind_of_global(global.storage_class, builtin.is_some()),
        declared_line: module.debug_scopes().global_lines.get(&global.id).copied(),
        is_declared: true,
        // Slang gathers the uniforms of a module in one block of its own.
        is_anonymous: is_block && named.is_none_or(|name| name == "globalParams"),
        place,
    }
}

fn kind_of_global(storage_class: u32, is_builtin: bool) -> VariableKind {
    match storage_class {
        _ if is_builtin => VariableKind::Builtin,
        storage::RAY_PAYLOAD | storage::INCOMING_RAY_PAYLOAD => VariableKind::Payload,
        storage::CALLABLE_DATA | storage::INCOMING_CALLABLE_DATA => VariableKind::CallableData,
        storage::HIT_ATTRIBUTE | storage::HIT_OBJECT_ATTRIBUTE_NV | storage::HIT_OBJECT_ATTRIBUTE_EXT => {
            VariableKind::HitAttribute
        }
        storage::SHADER_RECORD_BUFFER => VariableKind::ShaderRecord,
        storage::PUSH_CONSTANT => VariableKind::PushConstant,
        storage::WORKGROUP => VariableKind::Workgroup,
        storage::UNIFORM | storage::STORAGE_BUFFER => VariableKind::Buffer,
        storage::UNIFORM_CONSTANT => VariableKind::Resource,
        _ => VariableKind::Global,
    }
}

/// Where the value of a local variable is at a word offset, and whether its declaration has been
/// reached.
fn place_of_local(
    places: &IdPlaces<'_>,
    function: &Function,
    local: &SourceLocal,
    here: u32,
) -> (VariablePlace, bool) {
    let is_declared = local.locations.iter().any(|location| location.offset < here);
    let declared =
        |location: &&VariableLocation| location.form == LocationForm::Declared && location.path.is_empty();
    // The last one that is reached; before the declaration the first.
    let reached = local.locations.iter().filter(declared).rfind(|location| location.offset < here);
    if let Some(location) = reached.or_else(|| local.locations.iter().find(declared)) {
        let place = match local.original {
            Some(original) => places.pointee(original),
            None => places.pointee(location.value),
        };
        let place = match local.is_copy {
            true => place.fixed("the compiler keeps it in values; this is a copy for debuggers"),
            false => place,
        };
        return (place, is_declared);
    }
    let paths: SortedSet<&SmallVec<[u32; 2]>> = local.locations.iter().map(|one| &one.path).collect();
    let mut parts = Vec::new();
    let mut ambiguous = false;
    for path in paths {
        let of_path = |form: fn(LocationForm) -> bool| {
            let these = local.locations.iter().filter(|one| one.path == *path && form(one.form));
            reaching(&places.program.module, function, &these.collect::<Vec<_>>(), here)
        };
        // Memory holds what was stored last; a value was right where it was noted.
        let found = match of_path(|form| form == LocationForm::Pointer) {
            found if found.is_empty() => of_path(|form| form != LocationForm::Pointer),
            found => found,
        };
        match found[..] {
            [] => {}
            [one] => parts.push(FoundPart { path, offset: one.offset, place: place_of(places, one) }),
            _ => ambiguous = true,
        }
    }
    let why = match (is_declared, ambiguous) {
        (false, _) => "it is not declared yet",
        (true, true) => {
            "its value depends on the control flow that led here, and the compiler stores it nowhere"
        }
        (true, false) => "the compiler removed it here",
    };
    let place = assemble(places, local, &parts, why);
    (place, is_declared)
}

/// The place that a location tells.
fn place_of(places: &IdPlaces<'_>, location: &VariableLocation) -> VariablePlace {
    match location.form {
        LocationForm::Declared | LocationForm::Pointer => places.pointee(location.value),
        LocationForm::Direct => places.value(location.value),
        LocationForm::Calculated => {
            let why: Arc<str> = "its debug information is an expression that is not evaluated".into();
            let ty = places.program.module.type_of(location.value).unwrap_or_else(|| places.void());
            VariablePlace::unavailable(&places.context, ty, why)
        }
    }
}
