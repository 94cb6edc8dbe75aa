//! The structs of a module that lie in buffers, found by name, and the blocks that it declares.
//!
//! A compiler lays out one struct of the source several ways: Slang writes `Light_std140`,
//! `Light_std430` and `Light_natural`, glslang several structs that are all called `Light`. A name
//! means a struct only where that leaves no choice.

use std::collections::HashSet;
use std::fmt::Write;

use crate::machine::Binding;
use crate::module::decoration::number;
use crate::module::heap::Heap;
use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Module};
use crate::ops::pointer::storage;
use crate::ops::translate::array_length;
use crate::reflect::heap::{HeapUse, heap_uses};
use crate::reflect::{Layout, Rules};
use anyhit_base::error::names::{list_of, nearest};
use anyhit_base::error::{Error, ErrorKind, Result};

/// Layouts of one name that are told apart.
const DISTINCT: usize = 64;

/// What Slang appends to the name of a struct for the rules of its layout.
const SUFFIXES: &[&str] = &["_natural", "_std140", "_std430", "_scalar", "_c", "_default"];

/// A variable with a layout, other than by the name of its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataBlock {
    /// The push constants.
    PushConstants,
    /// The data of a shader record.
    ShaderRecord,
    /// A uniform or storage buffer.
    Buffer(Binding),
    /// A buffer at an index of the resource heap.
    Heap(u32),
}

/// The structs of a module whose members all have an `Offset`, in the module's order.
pub fn structs(module: &Module) -> impl Iterator<Item = TypeId> + '_ {
    let laid_out = |ty: &Type| match ty {
        Type::Struct { members, .. } => {
            !members.is_empty() && members.iter().all(|member| member.offset.is_some())
        }
        _ => false,
    };
    let all = module.types.iter().enumerate();
    all.filter(move |(_, ty)| laid_out(ty)).map(|(index, _)| TypeId(index as u32))
}

/// The layout of a struct by its name, by the name of what it lies in with a path of members
/// (`Params.sun`), or by its id (`%12`).
///
/// A name without the suffix that Slang appends for a layout (`_natural`, `_std140`, `_std430`)
/// means the struct with it, where all that it may mean lie alike.
///
/// # Errors
/// `InvalidArgument` where there is none, where names are stripped, and, with all of them, where
/// there are several layouts.
pub fn find<'a>(module: &'a Module, name: &str) -> Result<Layout<'a>> {
    if let Some(id) = name.strip_prefix('%').and_then(|id| id.parse().ok()) {
        let found = structs(module).find(|ty| module.id_of_type(*ty) == Some(Id(id)));
        let missing = || invalid(format!("`{name}` is not a struct with a layout"));
        return found.map(|ty| explicit(module, ty)).ok_or_else(missing);
    }
    let mut path = name.split('.');
    let first = path.next().unwrap_or_default();
    path.try_fold(find_named(module, first)?, |owner, member| {
        let Type::Struct { members, .. } = module.ty(owner.ty) else { return Ok(owner) };
        let found = members.iter().find(|one| one.name == member);
        let ty = found.and_then(|member| pointed_struct(module, member.ty));
        ty.map(|ty| explicit(module, ty)).ok_or_else(|| {
            let what = module.describe_type(owner.ty);
            let why =
                if found.is_some() { "is neither a struct nor a pointer to one" } else { "does not exist" };
            invalid(format!("`{name}`: the member `{member}` of {what} {why}")).note_lines(layout_note(owner))
        })
    })
}

fn find_named<'a>(module: &'a Module, name: &str) -> Result<Layout<'a>> {
    let named = |wanted: &dyn Fn(&str) -> bool| -> Vec<TypeId> {
        structs(module).filter(|ty| name_of(module, *ty).is_some_and(wanted)).collect()
    };
    let mut found = named(&|known| known == name);
    if found.is_empty() {
        found = named(&|known| base_name(known) == name);
    }
    let found = distinct(found.into_iter().map(|ty| explicit(module, ty)).collect());
    match found[..] {
        [one] => Ok(one),
        [] => Err(unknown(module, name)),
        _ => {
            let message = format!("`{name}` has {} layouts in the module: select one of them", found.len());
            let list: Vec<_> = found.iter().take(40).map(|layout| choice(*layout)).collect();
            Err(invalid(message).note_lines(list.join("\n")))
        }
    }
}

/// The layout of the variable at a binding; `None` where the module declares none.
pub fn variable_at(module: &Module, Binding { set, binding }: Binding) -> Option<Layout<'_>> {
    let number = |id, decoration| module.decorations.literal(id, decoration);
    let variable = module.variables.iter().find(|variable| {
        number(variable.id, number::DESCRIPTOR_SET) == Some(set)
            && number(variable.id, number::BINDING) == Some(binding)
    })?;
    Some(explicit(module, variable.ty?))
}

/// The layout of a block that a module declares; `None` where it declares none.
///
/// # Errors
/// `InvalidArgument` where several variables there lie differently.
pub fn find_block(module: &Module, block: DataBlock) -> Result<Option<Layout<'_>>> {
    let number = |id, decoration| module.decorations.literal(id, decoration);
    let mut found = Vec::new();
    for variable in &module.variables {
        let (id, class) = (variable.id, variable.storage_class);
        let is_it = match block {
            DataBlock::PushConstants => class == storage::PUSH_CONSTANT,
            DataBlock::ShaderRecord => class == storage::SHADER_RECORD_BUFFER,
            DataBlock::Buffer(Binding { set, binding }) => {
                matches!(class, storage::UNIFORM | storage::STORAGE_BUFFER)
                    && number(id, number::DESCRIPTOR_SET) == Some(set)
                    && number(id, number::BINDING) == Some(binding)
            }
            DataBlock::Heap(_) => false,
        };
        if let Some(ty) = variable.ty.filter(|_| is_it)
            && let Some(ty) = pointed_struct(module, ty)
        {
            found.push(explicit(module, ty));
        }
    }
    if let DataBlock::Heap(index) = block {
        let blocks = blocks_in_heap(module, index).into_iter();
        found.extend(blocks.filter_map(|ty| pointed_struct(module, ty)).map(|ty| explicit(module, ty)));
    }
    let found = distinct(found);
    match found[..] {
        [] => Ok(None),
        [one] => Ok(Some(one)),
        _ => {
            let list: Vec<_> = found.iter().map(|layout| choice(*layout)).collect();
            let message = format!("{} is declared with {} layouts", block.describe(), found.len());
            Err(invalid(message).note_lines(list.join("\n")))
        }
    }
}

/// The types that accesses give to the bytes of the buffer at an index of the resource heap: of
/// accesses with this index, else of those whose index is computed.
fn blocks_in_heap(module: &Module, index: u32) -> Vec<TypeId> {
    let uses = module.entry_points.iter().flat_map(|entry| heap_uses(module, entry.function));
    let uses: Vec<HeapUse> = uses.filter(|one| one.heap == Heap::Resources).collect();
    let at = |wanted: Option<u32>| {
        let here = uses.iter().filter(|one| one.index == wanted);
        here.filter_map(|one| one.block).collect::<Vec<_>>()
    };
    match at(Some(index)) {
        none if none.is_empty() => at(None),
        exact => exact,
    }
}

impl DataBlock {
    /// The buffer at an element of a binding, which may stand for the resource heap.
    pub fn of_buffer(binding: Binding, element: u32) -> Self {
        match binding {
            Binding::RESOURCE_HEAP => Self::Heap(element),
            _ => Self::Buffer(binding),
        }
    }

    /// What it is, for messages.
    pub fn describe(self) -> String {
        match self {
            Self::PushConstants => "the block of push constants".into(),
            Self::ShaderRecord => "the block of shader records".into(),
            Self::Buffer(binding) => format!("the block at {binding}"),
            Self::Heap(index) => format!("the block at index {index} of the resource heap"),
        }
    }
}

/// The strides that a module gives to a struct, ascending: of arrays of it and of pointers to it.
pub fn strides(layout: Layout<'_>) -> Vec<u32> {
    let module = layout.module;
    let strides = module.types.iter().filter_map(|ty| match *ty {
        Type::Array { element, stride, .. } | Type::RuntimeArray { element, stride } => {
            stride.filter(|_| element == layout.ty)
        }
        Type::Pointer { pointee, stride, .. } => stride.filter(|_| pointee == Some(layout.ty)),
        _ => None,
    });
    let mut strides: Vec<u32> = strides.collect();
    strides.sort_unstable();
    strides.dedup();
    strides
}

/// The size in bytes, as C's `sizeof`: where the module has arrays of the struct, up to the next
/// element.
pub fn padded_size(layout: Layout<'_>) -> usize {
    match (layout.runtime_stride(), &strides(layout)[..]) {
        (None, &[stride]) => layout.size().max(stride as usize),
        _ => layout.size(),
    }
}

/// Whether two types, of one module or of two, have the same members at the same offsets.
pub fn same_layout(a: Layout<'_>, b: Layout<'_>) -> bool {
    same(a, b, &mut HashSet::new())
}

fn same(a: Layout<'_>, b: Layout<'_>, seen: &mut HashSet<(TypeId, TypeId)>) -> bool {
    if std::ptr::eq(a.module, b.module) && a.ty == b.ty {
        return true;
    }
    match (a.module.ty(a.ty), b.module.ty(b.ty)) {
        (Type::Struct { members: of_a, .. }, Type::Struct { members: of_b, .. }) => {
            // A pair that differs ends the comparison, so one that was seen is alike.
            !seen.insert((a.ty, b.ty))
                || of_a.len() == of_b.len()
                    && of_a.iter().zip(of_b).all(|(of_a, of_b)| {
                        (&of_a.name, of_a.offset, of_a.matrix) == (&of_b.name, of_b.offset, of_b.matrix)
                            && same(a.part(of_a.ty), b.part(of_b.ty), seen)
                    })
        }
        (
            Type::Array { element: of_a, length: length_a, stride: stride_a },
            Type::Array { element: of_b, length: length_b, stride: stride_b },
        ) => {
            stride_a == stride_b
                && array_length(a.module, *length_a) == array_length(b.module, *length_b)
                && same(a.part(*of_a), b.part(*of_b), seen)
        }
        (
            Type::RuntimeArray { element: of_a, stride: stride_a },
            Type::RuntimeArray { element: of_b, stride: stride_b },
        ) => stride_a == stride_b && same(a.part(*of_a), b.part(*of_b), seen),
        (
            Type::Vector { component: of_a, count: a_count },
            Type::Vector { component: of_b, count: b_count },
        )
        | (Type::Matrix { column: of_a, count: a_count }, Type::Matrix { column: of_b, count: b_count }) => {
            a_count == b_count && same(a.part(*of_a), b.part(*of_b), seen)
        }
        // Both are addresses, whatever they lead to.
        (Type::Pointer { .. }, Type::Pointer { .. }) => true,
        (a, b) => a == b,
    }
}

/// The first of each group of layouts that are the same.
pub fn distinct(layouts: Vec<Layout<'_>>) -> Vec<Layout<'_>> {
    let mut kept: Vec<Layout<'_>> = Vec::new();
    for layout in layouts {
        if kept.len() == DISTINCT {
            break;
        }
        if !kept.iter().any(|known| same_layout(*known, layout)) {
            kept.push(layout);
        }
    }
    kept
}

/// The layout of which all others are the beginning, as shaders declare as much of a block as they
/// use.
pub fn longest<'a>(layouts: &[Layout<'a>]) -> Option<Layout<'a>> {
    let longest = layouts.iter().max_by_key(|layout| layout.size())?;
    layouts.iter().all(|layout| begins(*layout, *longest)).then_some(*longest)
}

/// Whether the members of a struct are the first ones of another.
fn begins(short: Layout<'_>, long: Layout<'_>) -> bool {
    let (Type::Struct { members: first, .. }, Type::Struct { members: all, .. }) =
        (short.module.ty(short.ty), long.module.ty(long.ty))
    else {
        return false;
    };
    first.len() <= all.len()
        && first.iter().zip(all).all(|(a, b)| {
            (&a.name, a.offset, a.matrix) == (&b.name, b.offset, b.matrix)
                && same_layout(short.part(a.ty), long.part(b.ty))
        })
}

/// The layout of a struct as the note of an error.
pub fn layout_note(layout: Layout<'_>) -> String {
    let size = match layout.runtime_stride() {
        Some((offset, stride)) => format!("{offset} bytes and {stride} for each element"),
        None => format!("{} bytes", layout.size()),
    };
    let mut lines = vec![format!("{}: {size}", layout.module.describe_type(layout.ty))];
    lines.extend(layout.describe());
    lines.join("\n")
}

/// The struct that a type leads to, through arrays and pointers.
pub fn pointed_struct(module: &Module, mut ty: TypeId) -> Option<TypeId> {
    // Pointers may lead in a circle.
    for _ in 0..64 {
        ty = match *module.ty(ty) {
            Type::Array { element, .. } | Type::RuntimeArray { element, .. } => element,
            Type::Pointer { pointee, .. } => pointee?,
            Type::Struct { .. } => return Some(ty),
            _ => return None,
        }
    }
    None
}

/// The name of a struct in the source.
pub fn name_of(module: &Module, ty: TypeId) -> Option<&str> {
    module.id_of_type(ty).and_then(|id| module.name(id))
}

pub(super) fn explicit(module: &Module, ty: TypeId) -> Layout<'_> {
    Layout::new(module, ty, Rules::Explicit)
}

/// A name without what Slang appends: a layout, and a number where names repeat.
pub fn base_name(name: &str) -> &str {
    let numbered = name
        .rsplit_once('_')
        .filter(|(_, number)| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()));
    let name = numbered.map_or(name, |(name, _)| name);
    SUFFIXES.iter().find_map(|suffix| name.strip_suffix(suffix)).unwrap_or(name)
}

/// The paths of one member that lead to a struct.
fn owners(layout: Layout<'_>) -> impl Iterator<Item = String> {
    let (module, ty) = (layout.module, layout.ty);
    structs(module).flat_map(move |owner| {
        let Type::Struct { members, .. } = module.ty(owner) else { return Vec::new() };
        let inside = members.iter().filter(|member| pointed_struct(module, member.ty) == Some(ty));
        let owner = name_of(module, owner).unwrap_or_default();
        inside.map(|member| format!("{owner}.{}", member.name)).collect::<Vec<_>>()
    })
}

/// How a scene may name a struct: by its name, by a path, or by its id.
pub fn spelling(layout: Layout<'_>) -> String {
    let (module, ty) = (layout.module, layout.ty);
    let id = module.id_of_type(ty).map_or(0, |id| id.0);
    let means_this = |name: &str| find(module, name).is_ok_and(|found| same_layout(found, layout));
    let own = name_of(module, ty).unwrap_or_default();
    let named = |name: &str| structs(module).filter(|ty| name_of(module, *ty) == Some(name)).count();
    match named(own) {
        1 => own.to_owned(),
        // A path through a struct whose name repeats would ask for a list of choices again.
        _ => owners(layout)
            .take(64)
            .find(|path| named(path.split('.').next().unwrap_or_default()) == 1 && means_this(path))
            .unwrap_or_else(|| format!("%{id}")),
    }
}

/// One of several layouts: how a scene may name it, its size, and what it is in.
fn choice(layout: Layout<'_>) -> String {
    let spelled = spelling(layout);
    let mut text = format!("`{spelled}`: {} bytes", layout.size());
    if let Some(owner) = owners(layout).next().filter(|owner| *owner != spelled) {
        let _ = write!(text, ", as in `{owner}`");
    }
    text
}

fn unknown(module: &Module, name: &str) -> Error {
    let names = || structs(module).filter_map(|ty| name_of(module, ty));
    if names().next().is_none() {
        let message = format!("no struct is named `{name}`: the module contains no struct names");
        return invalid(message)
            .note("either its names (OpName) are stripped, or it has no struct with a layout");
    }
    let everywhere = (0..module.types.len() as u32).map(TypeId);
    let without_layout = everywhere
        .filter(|ty| matches!(module.ty(*ty), Type::Struct { .. }))
        .any(|ty| name_of(module, ty) == Some(name));
    let message = match without_layout {
        true => format!("struct `{name}` has no layout: no buffer, push constant block or pointer uses it"),
        false => format!("no struct of the module is named `{name}`"),
    };
    let mut error = invalid(message);
    if let Some(near) = nearest(name, names()) {
        error = error.note(format!("did you mean `{near}`?"));
    }
    let mut all: Vec<_> = names().collect();
    all.dedup();
    error.note(format!("its structs with a layout: {}", list_of(all.into_iter())))
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}
