//! Which of the noted values of a variable hold at an instruction, and how its parts make the
//! whole.

use std::collections::HashSet;

use smallvec::SmallVec;

use crate::debugger::id_places::IdPlaces;
use crate::debugger::source_locals::SourceLocal;
use crate::debugger::variable_place::VariablePlace;
use anyhit_engine::module::debug_scopes::VariableLocation;
use anyhit_engine::module::ty::TypeId;
use anyhit_engine::module::{BasicBlock, Function, Module};
use anyhit_engine::reflect::{Layout, Rules};

/// The locations, of those of one variable in ascending order, that hold at a word offset of a
/// function: the last ones on each way that leads there. More than one cannot be told apart.
pub(super) fn reaching<'l>(
    module: &Module,
    function: &Function,
    locations: &[&'l VariableLocation],
    here: u32,
) -> Vec<&'l VariableLocation> {
    let mut found: Vec<&VariableLocation> = Vec::new();
    let Some(start) = function.blocks.iter().rposition(|block| block.offset <= here) else { return found };
    let mut visited = HashSet::new();
    // Blocks, each with the offset up to which it counts.
    let mut worklist = vec![(start, here)];
    while let Some((block, end)) = worklist.pop() {
        // Parameters stand before the first block.
        let first = if block == 0 { function.offset } else { function.blocks[block].offset };
        let last = locations.iter().rfind(|one| (first..end).contains(&one.offset));
        match last {
            Some(last) if found.iter().any(|known| known.offset == last.offset) => {}
            Some(last) => found.push(last),
            None => {
                for before in predecessors(module, function, block) {
                    if visited.insert(before) {
                        worklist.push((before, end_of_block(module, function, before)));
                    }
                }
            }
        }
    }
    found
}

fn end_of_block(module: &Module, function: &Function, block: usize) -> u32 {
    function.blocks.get(block + 1).map_or_else(|| module.end_of(function), |next| next.offset)
}

/// The blocks that branch to a block.
fn predecessors<'a>(
    module: &'a Module,
    function: &'a Function,
    block: usize,
) -> impl Iterator<Item = usize> + 'a {
    let label = function.blocks[block].label;
    let branches = move |(at, from): (usize, &BasicBlock)| {
        let last = from.instructions.last()?;
        module.branch_targets(last).contains(&label).then_some(at)
    };
    function.blocks.iter().enumerate().filter_map(branches)
}

/// A part of a variable, or all of it.
#[derive(Clone, Debug)]
pub(super) struct FoundPart<'l> {
    /// The indices that lead to it.
    pub(super) path: &'l SmallVec<[u32; 2]>,
    /// Where it was noted: of two values of a part, the later one holds.
    pub(super) offset: u32,
    pub(super) place: VariablePlace,
}

/// The place of a variable, given those of its parts; those that are missing are unavailable for a
/// reason.
pub(super) fn assemble(
    places: &IdPlaces<'_>,
    local: &SourceLocal,
    parts: &[FoundPart<'_>],
    why: &str,
) -> VariablePlace {
    let module = &places.program.module;
    let all: Vec<(&[u32], u32, &VariablePlace)> =
        parts.iter().map(|part| (&part.path[..], part.offset, &part.place)).collect();
    let ty = match all[..] {
        [([], _, whole)] => Some(whole.ty()),
        [] => whole_type(module, local),
        _ => type_with_parts(module, local, &all),
    };
    match ty {
        Some(ty) => join(places, ty, &all, why),
        None if all.is_empty() => VariablePlace::unavailable(&places.context, places.void(), why),
        None => {
            let why = "the compiler split it into parts, and its type is unknown";
            VariablePlace::unavailable(&places.context, places.void(), why)
        }
    }
}

/// The place of a value of a type, given those of its parts.
fn join(
    places: &IdPlaces<'_>,
    ty: TypeId,
    parts: &[(&[u32], u32, &VariablePlace)],
    why: &str,
) -> VariablePlace {
    let whole = parts.iter().filter(|(path, ..)| path.is_empty()).max_by_key(|(_, offset, _)| *offset);
    let noted = whole.map_or(0, |(_, offset, _)| *offset);
    let later: Vec<_> =
        parts.iter().filter(|(path, offset, _)| !path.is_empty() && *offset >= noted).collect();
    let types = child_types(&places.program.module, ty);
    let (false, Some(types)) = (later.is_empty(), types) else {
        return match whole {
            Some((.., place)) => (*place).clone(),
            None => VariablePlace::unavailable(&places.context, ty, why),
        };
    };
    let part = |(at, part): (u32, TypeId)| {
        let mut these: Vec<(&[u32], u32, &VariablePlace)> = later
            .iter()
            .filter(|(path, ..)| path[0] == at)
            .map(|(path, offset, place)| (&path[1..], *offset, *place))
            .collect();
        let rest = whole.and_then(|(.., place)| place.child(at.into()).ok());
        if let Some(rest) = &rest {
            these.push((&[], noted, rest));
        }
        join(places, part, &these, why)
    };
    VariablePlace::parts(&places.context, ty, (0..).zip(types).map(part).collect())
}

/// The type of a variable of which no value is known.
fn whole_type(module: &Module, local: &SourceLocal) -> Option<TypeId> {
    let whole = local.locations.iter().filter(|one| one.path.is_empty());
    let mut types = whole.filter_map(|one| module.pointee(one.value).or_else(|| module.type_of(one.value)));
    types.next()
}

/// The type of the module that has parts of these types: of several, the one that has the name of
/// the variable's type.
fn type_with_parts(
    module: &Module,
    local: &SourceLocal,
    parts: &[(&[u32], u32, &VariablePlace)],
) -> Option<TypeId> {
    let source = local.ty.as_ref();
    let fits = |ty: &TypeId| {
        let count = child_types(module, *ty).map_or(0, |types| types.len());
        source.is_none_or(|source| source.parts == 0 || source.parts as usize == count)
            && parts.iter().all(|(path, _, place)| part_type(module, *ty, path) == Some(place.ty()))
    };
    let mut candidates = (0..module.types.len() as u32).map(TypeId).filter(fits).peekable();
    let first = *candidates.peek()?;
    let wanted = source.and_then(|source| source.name.as_deref());
    let is_named = |ty: &TypeId| {
        let id = module.id_of_type(*ty);
        wanted.is_some() && id.and_then(|id| module.name(id)) == wanted
    };
    Some(candidates.find(is_named).unwrap_or(first))
}

/// The most parts of a value that is put together from them.
const MAX_PARTS: usize = 4096;

/// The types of the parts of a value; `None` where it has none, or very many.
fn child_types(module: &Module, ty: TypeId) -> Option<Vec<TypeId>> {
    let layout = Layout::new(module, ty, Rules::Packed);
    let types = || (0..layout.child_count()).filter_map(|at| layout.child(at)).map(|(_, part)| part.ty);
    (1..=MAX_PARTS).contains(&layout.child_count()).then(|| types().collect())
}

/// The type of the part that indices lead to.
fn part_type(module: &Module, ty: TypeId, path: &[u32]) -> Option<TypeId> {
    let whole = Layout::new(module, ty, Rules::Packed);
    let found = path.iter().try_fold(whole, |layout, &at| layout.child(at as usize).map(|(_, part)| part));
    found.map(|part| part.ty)
}
