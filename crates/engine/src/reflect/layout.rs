//! Offsets, sizes and strides of a type's parts.
//!
//! Buffers, push constants and shader records carry their layout in the module (`Offset`,
//! `ArrayStride`, `MatrixStride`). Payloads, callable data, hit attributes and registers carry
//! none: their scalars follow each other without gaps, in the order of the declaration and column
//! by column, each of 8, 16 or 32 bits in four bytes and each of 64 bits in eight; a bool is a
//! `u32`, 0 or 1. So `#[repr(C)] struct { normal: [f32; 3], t: f32, hits: u32 }` is the payload
//! `{ vec3 normal; float t; uint hits; }`.

use crate::module::Module;
use crate::module::ty::{MatrixLayout, Type, TypeId};
use crate::ops::pointer::{pointer_word_count, storage};
use crate::ops::translate::array_length;

/// Words of a value that is read or written as a whole, at most.
pub const MAX_WORDS: u32 = 1 << 16;

/// Which rules place a value's parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rules {
    /// Scalars and handles without gaps: payloads, callable data, hit attributes, registers.
    Packed,
    /// By the module's decorations: buffers, push constants, shader records.
    Explicit,
}

/// A type of a module with the rules that place its parts.
#[derive(Clone, Copy, Debug)]
pub struct Layout<'a> {
    /// The module.
    pub module: &'a Module,
    /// The type.
    pub ty: TypeId,
    /// The rules.
    pub rules: Rules,
    /// How the matrices of the member around lie.
    pub matrix: Option<MatrixLayout>,
}

impl<'a> Layout<'a> {
    /// A type under rules.
    pub fn new(module: &'a Module, ty: TypeId, rules: Rules) -> Self {
        Self { module, ty, rules, matrix: None }
    }

    /// A part of it, under the same rules.
    pub fn part(self, ty: TypeId) -> Self {
        Self { ty, ..self }
    }

    /// Returns whether offsets and strides are those that the module declares.
    pub fn explicit(self) -> bool {
        self.rules == Rules::Explicit
    }

    /// Size in bytes; a runtime array at the end counts as nothing.
    pub fn size(self) -> usize {
        match self.module.ty(self.ty) {
            Type::Bool => 4,
            Type::Int { width, .. } | Type::Float { width, .. } => scalar_size(*width, self.rules),
            Type::Vector { component, count } => {
                let component = self.part(*component).size();
                spread(*count as usize, self.component_stride(component), component)
            }
            Type::Matrix { column, count } => match self.matrix.filter(|_| self.explicit()) {
                Some(layout) if layout.row_major => {
                    let row = self.scalar(*column).size().saturating_mul(*count as usize);
                    spread(self.lanes(*column), layout.stride as usize, row)
                }
                Some(layout) => spread(*count as usize, layout.stride as usize, self.part(*column).size()),
                None => self.part(*column).size().saturating_mul(*count as usize),
            },
            Type::Array { element, length, stride } => match array_length(self.module, *length) {
                0 => 0,
                length => {
                    // Once, as arrays nest.
                    let size = self.part(*element).size();
                    let stride = stride.filter(|_| self.explicit()).map_or(size, |stride| stride as usize);
                    spread(length, stride, size)
                }
            },
            Type::Struct { members, .. } if !self.explicit() => {
                let sizes = members.iter().map(|member| self.part(member.ty).size());
                sizes.fold(0, usize::saturating_add)
            }
            Type::Struct { .. } => {
                let ends = self.members().map(|(offset, member)| member.size().saturating_add(offset));
                ends.max().unwrap_or(0)
            }
            // Pointers in buffers are device addresses; other pointers and handles have registers.
            Type::Pointer { .. } if self.explicit() => 8,
            &Type::Pointer { storage_class, .. } => 4 * pointer_word_count(storage_class) as usize,
            Type::Image(_) | Type::Sampler | Type::RayQuery | Type::HitObject { .. } if !self.explicit() => 4,
            Type::SampledImage(_) | Type::AccelerationStructure if !self.explicit() => 8,
            _ => 0,
        }
    }

    /// Number of registers of a value; `None` for types without values, such as runtime arrays, and
    /// beyond [`MAX_WORDS`].
    pub fn word_count(self) -> Option<u32> {
        let packed = Self { rules: Rules::Packed, ..self };
        let count = u32::try_from(packed.size() / 4).ok().filter(|count| *count <= MAX_WORDS)?;
        self.has_value().then_some(count)
    }

    /// Returns whether the type is one of values with a fixed size.
    fn has_value(self) -> bool {
        match self.module.ty(self.ty) {
            Type::Struct { members, .. } => members.iter().all(|member| self.part(member.ty).has_value()),
            Type::Vector { component: part, .. }
            | Type::Matrix { column: part, .. }
            | Type::Array { element: part, .. } => self.part(*part).has_value(),
            _ => self.is_scalar(),
        }
    }

    /// Returns whether values of the type are single scalars, addresses or handles.
    pub fn is_scalar(self) -> bool {
        match self.module.ty(self.ty) {
            Type::Struct { .. }
            | Type::Vector { .. }
            | Type::Matrix { .. }
            | Type::Array { .. }
            | Type::RuntimeArray { .. } => false,
            _ => Self { rules: Rules::Packed, ..self }.size() > 0,
        }
    }

    /// Offset and bits of each word of a value, in the order of its registers; a scalar of 64 bits
    /// has two.
    pub fn words(self) -> Vec<(usize, u32)> {
        let halves = |(offset, scalar): (usize, Self)| match scalar.size() {
            8 => [Some((offset, 32)), Some((offset + 4, 32))],
            size => [Some((offset, 8 * size as u32)), None],
        };
        self.scalars().into_iter().flat_map(halves).flatten().collect()
    }

    /// Returns whether values of the type hold device addresses.
    pub fn has_addresses(self) -> bool {
        match *self.module.ty(self.ty) {
            Type::Pointer { storage_class, .. } => storage_class == storage::PHYSICAL_STORAGE_BUFFER,
            Type::Struct { .. } => self.members().any(|(_, part)| part.has_addresses()),
            _ => self.element().is_some_and(|(element, _)| element.has_addresses()),
        }
    }

    /// Number of parts that [`Layout::child`] finds: members, elements, columns or components; 0
    /// for a runtime array, whose bytes say how many it has.
    pub fn child_count(self) -> usize {
        match self.module.ty(self.ty) {
            Type::Struct { members, .. } => members.len(),
            Type::Vector { count, .. } | Type::Matrix { count, .. } => *count as usize,
            Type::Array { length, .. } => array_length(self.module, *length),
            _ => 0,
        }
    }

    /// Offset and layout of the part at an index: a member, an element, a column, a component. A
    /// runtime array has them at every index.
    pub fn child(self, at: usize) -> Option<(usize, Self)> {
        match (self.module.ty(self.ty), self.element()) {
            (_, Some((element, length))) => {
                let exists = length.is_none_or(|length| at < length);
                exists.then(|| (at.saturating_mul(self.stride()), element))
            }
            (Type::Struct { members, .. }, _) => (at < members.len()).then(|| self.member(at)),
            _ => self.parts().get(at).copied(),
        }
    }

    /// Layout of the elements of an array, and their number, which a runtime array does not have;
    /// `None` for other types.
    pub fn element(self) -> Option<(Self, Option<usize>)> {
        match *self.module.ty(self.ty) {
            Type::Array { element, length, .. } => {
                Some((self.part(element), Some(array_length(self.module, length))))
            }
            Type::RuntimeArray { element, .. } => Some((self.part(element), None)),
            _ => None,
        }
    }

    /// Bytes between the elements of an array; 0 for what is none.
    pub fn stride(self) -> usize {
        match *self.module.ty(self.ty) {
            Type::Array { element, stride, .. } | Type::RuntimeArray { element, stride } => {
                let packed = || self.part(element).size();
                stride.filter(|_| self.explicit()).map_or_else(packed, |stride| stride as usize)
            }
            _ => 0,
        }
    }

    /// Offset and layout of a struct's member.
    pub fn member(self, at: usize) -> (usize, Self) {
        let Type::Struct { members, .. } = self.module.ty(self.ty) else { return (0, self) };
        let member = Self { matrix: members[at].matrix, ..self.part(members[at].ty) };
        let sizes = || members[..at].iter().map(|member| self.part(member.ty).size());
        let packed = || sizes().fold(0, usize::saturating_add);
        let offset = members[at].offset.filter(|_| self.explicit());
        (offset.map_or_else(packed, |offset| offset as usize), member)
    }

    /// Offsets and layouts of all members of a struct, in order. Each is looked at once, where
    /// [`Layout::member`] adds up those before it.
    pub fn members(self) -> impl Iterator<Item = (usize, Self)> + use<'a> {
        let members = match self.module.ty(self.ty) {
            Type::Struct { members, .. } => &members[..],
            _ => &[],
        };
        let mut end = 0usize;
        members.iter().map(move |member| {
            let part = Self { matrix: member.matrix, ..self.part(member.ty) };
            let offset = member.offset.filter(|_| self.explicit());
            let offset = offset.map_or(end, |offset| offset as usize);
            if !self.explicit() || member.offset.is_none() {
                end = end.saturating_add(part.size());
            }
            (offset, part)
        })
    }

    /// Bytes between the components of a vector: a column of a row-major matrix has one in each
    /// row.
    pub fn component_stride(self, component: usize) -> usize {
        match self.matrix.filter(|_| self.explicit()) {
            Some(MatrixLayout { stride, row_major: true }) => stride as usize,
            _ => component,
        }
    }

    /// Number of components of a vector, and 1 for a scalar.
    pub fn lanes(self, vector: TypeId) -> usize {
        match self.module.ty(vector) {
            Type::Vector { count, .. } => *count as usize,
            _ => 1,
        }
    }

    /// The layout of a component of a vector, or of a scalar itself.
    pub fn scalar(self, vector: TypeId) -> Self {
        match self.module.ty(vector) {
            Type::Vector { component, .. } => self.part(*component),
            _ => self.part(vector),
        }
    }

    /// Offset and stride of the runtime array that ends a block.
    pub fn runtime_stride(self) -> Option<(usize, usize)> {
        let Type::Struct { members, .. } = self.module.ty(self.ty) else { return None };
        let (offset, last) = self.member(members.len().checked_sub(1)?);
        match self.module.ty(last.ty) {
            Type::RuntimeArray { stride, .. } => Some((offset, (*stride)? as usize)),
            _ => None,
        }
    }

    /// Offset and type of every scalar in order, matrices column by column; a runtime array has
    /// none.
    pub fn scalars(self) -> Vec<(usize, Self)> {
        let mut found = Vec::new();
        self.each_scalar(0, &mut found);
        found
    }

    fn each_scalar(self, offset: usize, found: &mut Vec<(usize, Self)>) {
        match self.module.ty(self.ty) {
            Type::Struct { .. } => {
                for (at, member) in self.members() {
                    member.each_scalar(offset + at, found);
                }
            }
            Type::RuntimeArray { .. } => {}
            _ if self.is_scalar() => found.push((offset, self)),
            _ => {
                for (at, part) in self.parts() {
                    part.each_scalar(offset + at, found);
                }
            }
        }
    }

    /// Offsets and layouts of the elements of an array, the columns of a matrix, the components of
    /// a vector.
    pub fn parts(self) -> Vec<(usize, Self)> {
        let row = |count: usize, stride: usize, part: Self| {
            (0..count).map(|index| (index * stride, part)).collect::<Vec<_>>()
        };
        match self.module.ty(self.ty) {
            Type::Vector { component, count } => {
                let part = self.part(*component);
                row(*count as usize, self.component_stride(part.size()), part)
            }
            Type::Matrix { column, count } => match self.matrix.filter(|_| self.explicit()) {
                Some(layout) if layout.row_major => {
                    row(*count as usize, self.scalar(*column).size(), self.part(*column))
                }
                Some(layout) => row(*count as usize, layout.stride as usize, self.part(*column)),
                None => row(*count as usize, self.part(*column).size(), self.part(*column)),
            },
            Type::Array { element, length, .. } => {
                let part = self.part(*element);
                let length = array_length(self.module, *length);
                // Elements without bytes have no scalars, however many there are.
                row(if part.size() == 0 { 0 } else { length }, self.stride(), part)
            }
            _ => Vec::new(),
        }
    }
}

/// Bytes from the first of `count` things to the end of the last.
fn spread(count: usize, stride: usize, each: usize) -> usize {
    count.saturating_sub(1).saturating_mul(stride).saturating_add(each)
}

fn scalar_size(width: u32, rules: Rules) -> usize {
    match rules {
        Rules::Packed => width.div_ceil(32) as usize * 4,
        Rules::Explicit => width as usize / 8,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::module::assemble::Assembler;
    use crate::module::{Id, Opcode};

    /// Arrays nest 200 deep; the size of each is that of its element.
    #[test]
    fn nested_arrays_are_measured_once() {
        let mut a = Assembler::new();
        a.types();
        a.op(Opcode::Constant, &[5, 20, 1]);
        for depth in 0..200 {
            let element = if depth == 0 { 6 } else { 100 + depth - 1 };
            a.op(Opcode::TypeArray, &[100 + depth, element, 20]);
        }
        let module = a.loaded();
        let outermost = module.type_with_id(Id(299)).unwrap();
        for rules in [Rules::Packed, Rules::Explicit] {
            assert_eq!(Layout::new(&module, outermost, rules).size(), 4, "{rules:?}");
        }
    }
}
