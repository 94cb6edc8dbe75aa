//! How values lie in registers and in buffers.

use anyhit_engine::module::Module;
use anyhit_engine::module::constant::ConstantValue;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{Definition, Id};
use anyhit_engine::ops::pointer::{PointeeLayout, pointer_word_count, storage};
use anyhit_engine::ops::translate::array_length;

/// The most words of a value that is read or written as a whole.
pub(super) const MAX_WORDS: u32 = 1 << 16;

/// How many words a value of a type has in registers, as
/// [`TypedValue::of_type`](anyhit_explain::values::TypedValue::of_type) reads them; `None` for
/// types without values, and beyond [`MAX_WORDS`].
pub(super) fn word_count(module: &Module, ty: TypeId) -> Option<u32> {
    let times = |part: TypeId, count: u32| word_count(module, part)?.checked_mul(count);
    let count = match module.ty(ty) {
        Type::Bool | Type::Image(_) | Type::Sampler | Type::RayQuery | Type::HitObject { .. } => 1,
        Type::Int { width, .. } | Type::Float { width, .. } => width.div_ceil(32),
        Type::SampledImage(_) | Type::AccelerationStructure => 2,
        &Type::Vector { component: part, count } | &Type::Matrix { column: part, count } => {
            times(part, count)?
        }
        &Type::Array { element, length, .. } => {
            times(element, u32::try_from(array_length(module, length)).ok()?)?
        }
        Type::Struct { members, .. } => members_words(module, members.iter().map(|member| member.ty))?,
        &Type::Pointer { storage_class, .. } => pointer_word_count(storage_class),
        _ => return None,
    };
    Some(count).filter(|&count| count <= MAX_WORDS)
}

/// The words of several members together.
pub(super) fn members_words(module: &Module, mut members: impl Iterator<Item = TypeId>) -> Option<u32> {
    members.try_fold(0_u32, |sum, member| {
        sum.checked_add(word_count(module, member)?).filter(|&sum| sum <= MAX_WORDS)
    })
}

/// A scalar in a buffer: its byte offset and its bits. One of 64 bits counts as two.
pub(super) type BufferScalar = (u64, u32);

/// The scalars of a value in a buffer, in the order of its words in registers.
///
/// # Errors
/// The message where the type says nothing of its layout, or the value is too large.
pub(super) fn buffer_scalars(
    module: &Module,
    ty: TypeId,
    offset: u64,
    layout: PointeeLayout,
) -> Result<Vec<BufferScalar>, String> {
    let name = || module.describe_type(ty);
    word_count(module, ty).ok_or_else(|| format!("{} cannot be read as a whole", name()))?;
    let mut scalars = Vec::new();
    let found = collect_scalars(module, ty, offset, layout, &mut scalars);
    found.map(|()| scalars).ok_or_else(|| format!("the memory layout of {} is unknown", name()))
}

fn collect_scalars(
    module: &Module,
    ty: TypeId,
    offset: u64,
    layout: PointeeLayout,
    scalars: &mut Vec<BufferScalar>,
) -> Option<()> {
    let mut repeat = |part: TypeId, count: u64, stride: u32, layout: PointeeLayout| {
        (0..count).try_for_each(|at| {
            let offset = at.checked_mul(stride.into())?.checked_add(offset)?;
            collect_scalars(module, part, offset, layout, scalars)
        })
    };
    match module.ty(ty) {
        Type::Int { width: 64, .. }
        | Type::Float { width: 64, .. }
        | Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. } => {
            scalars.extend([(offset, 32), (offset.checked_add(4)?, 32)]);
            Some(())
        }
        Type::Int { width, .. } | Type::Float { width, .. } => {
            scalars.push((offset, *width));
            Some(())
        }
        &Type::Vector { component, count } => {
            let stride = layout.component_stride.or_else(|| scalar_bytes(module, component))?;
            repeat(component, count.into(), stride, PointeeLayout::default())
        }
        &Type::Matrix { column, count } => {
            let (stride, layout) = column_layout(module, column, layout)?;
            repeat(column, count.into(), stride, layout)
        }
        &Type::Array { element, length, stride } => {
            repeat(element, array_length(module, length) as u64, stride?, layout)
        }
        Type::Struct { members, .. } => members.iter().try_for_each(|member| {
            let offset = offset.checked_add(member.offset?.into())?;
            collect_scalars(module, member.ty, offset, PointeeLayout::of_matrix(member.matrix), scalars)
        }),
        _ => None,
    }
}

/// The words of scalars among whole words of their buffer, from the first that holds one of them
/// on; between scalars there may be gaps.
pub(super) fn scalars_among(scalars: &[BufferScalar], words: &[u32]) -> Option<Vec<u32>> {
    let first = scalars.iter().map(|&(offset, _)| offset).min()? / 4 * 4;
    let word = |&(offset, width): &BufferScalar| {
        let at = offset - first;
        let word = words.get((at / 4) as usize)? >> (8 * (at % 4));
        Some(word & u32::MAX >> (32 - width))
    };
    scalars.iter().map(word).collect()
}

/// Whether a type is an array of blocks, each in a buffer of its own.
pub(super) fn is_array_of_blocks(module: &Module, mut ty: TypeId) -> bool {
    while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = *module.ty(ty) {
        ty = element;
    }
    matches!(module.ty(ty), Type::Struct { block: true, .. })
}

/// The stride of a matrix's columns in a buffer, and the layout of each.
pub(super) fn column_layout(
    module: &Module,
    column: TypeId,
    layout: PointeeLayout,
) -> Option<(u32, PointeeLayout)> {
    let matrix = layout.matrix?;
    Some(match (matrix.row_major, module.ty(column)) {
        (true, &Type::Vector { component, .. }) => {
            let layout = PointeeLayout { matrix: None, component_stride: Some(matrix.stride) };
            (scalar_bytes(module, component)?, layout)
        }
        _ => (matrix.stride, PointeeLayout::default()),
    })
}

/// The bytes of a scalar.
pub(super) fn scalar_bytes(module: &Module, ty: TypeId) -> Option<u32> {
    match *module.ty(ty) {
        Type::Int { width, .. } | Type::Float { width, .. } => Some(width / 8),
        _ => None,
    }
}

/// The words of a constant; `None` where it has to be calculated.
pub(super) fn constant_words(module: &Module, id: Id) -> Option<Vec<u32>> {
    let Some(Definition::Constant(index)) = module.definition(id) else { return None };
    let constant = &module.constants[index as usize];
    let count = word_count(module, constant.ty)?;
    Some(match &constant.value {
        &ConstantValue::Scalar(bits) => [bits as u32, (bits >> 32) as u32][..count.min(2) as usize].to_vec(),
        ConstantValue::Composite(parts) => {
            let mut words = Vec::new();
            for &part in parts {
                words.extend(constant_words(module, part)?);
            }
            Some(words).filter(|words| words.len() == count as usize)?
        }
        ConstantValue::Null => vec![0; count as usize],
        _ => return None,
    })
}

/// The most parts of a value that is put together from them.
const MAX_PARTS: usize = 4096;

/// The types of the parts of a value; `None` where it has none.
pub(super) fn child_types(module: &Module, ty: TypeId) -> Option<Vec<TypeId>> {
    let count = |count: usize| Some(count).filter(|&count| count <= MAX_PARTS);
    Some(match module.ty(ty) {
        Type::Struct { members, .. } => members.iter().map(|member| member.ty).collect(),
        &Type::Vector { component: part, count: parts } | &Type::Matrix { column: part, count: parts } => {
            vec![part; count(parts as usize)?]
        }
        &Type::Array { element, length, .. } => vec![element; count(array_length(module, length))?],
        _ => return None,
    })
}
