//! Values read from bytes.

use crate::module::ty::{Type, TypeId};
use crate::ops::pointer::storage;
use crate::ops::translate::array_length;
use crate::reflect::Layout;
use crate::reflect::value::{
    AddressValue, FloatValue, ScalarContent, TypedValue, ValueContent, ValueMember, type_name,
};

/// A kind of value that [`Layout::read`] builds.
pub trait FromParts: Sized {
    /// A scalar from its bytes, and those bytes; missing ones are left out.
    fn scalar(layout: Layout<'_>, bytes: &[u8], scalar: ScalarContent) -> Self;

    /// A vector, a matrix or an array, from the first byte on, with its parts.
    fn list(layout: Layout<'_>, bytes: &[u8], parts: Vec<Self>) -> Self;

    /// A struct, from the first byte on, with its members in their order.
    fn structure(layout: Layout<'_>, bytes: &[u8], members: Vec<Self>) -> Self;

    /// A value that is not read: its type has none, or the module has too many.
    fn opaque(layout: Layout<'_>) -> Self;
}

impl FromParts for ValueContent {
    fn scalar(_: Layout<'_>, _: &[u8], scalar: ScalarContent) -> Self {
        match scalar {
            ScalarContent::Bool(value) => Self::Bool(value),
            ScalarContent::Int(value) => Self::Int(value),
            ScalarContent::Uint(value) | ScalarContent::Handle(value) => Self::Uint(value),
            ScalarContent::Float(value) => Self::Float(value),
            ScalarContent::Address(address) => Self::Address(AddressValue { address, place: None }),
        }
    }

    fn list(_: Layout<'_>, _: &[u8], parts: Vec<Self>) -> Self {
        Self::List(parts)
    }

    fn structure(layout: Layout<'_>, _: &[u8], members: Vec<Self>) -> Self {
        let Type::Struct { members: declared, .. } = layout.module.ty(layout.ty) else {
            return Self::List(members);
        };
        let named = declared.iter().zip(members).enumerate().map(|(at, (member, content))| ValueMember {
            name: if member.name.is_empty() { format!("member {at}") } else { member.name.clone() },
            value: TypedValue { ty: type_name(layout.module, member.ty), content },
        });
        Self::Members(named.collect())
    }

    fn opaque(layout: Layout<'_>) -> Self {
        Self::Text(type_name(layout.module, layout.ty))
    }
}

impl Layout<'_> {
    /// Reads a value; parts that the bytes do not reach are left out of arrays and are zero
    /// elsewhere.
    ///
    /// Members may share their bytes, so that a few types make any number of parts: those beyond
    /// some sixty readings of all bytes are opaque.
    pub fn read<V: FromParts>(self, bytes: &[u8]) -> V {
        let mut budget = bytes.len().saturating_mul(64).saturating_add(1 << 16);
        self.read_within(bytes, &mut budget)
    }

    /// Reads a scalar; `None` for other types.
    pub fn read_scalar(self, bytes: &[u8]) -> Option<ScalarContent> {
        let mut bits = [0; 8];
        let size = self.size().min(bits.len()).min(bytes.len());
        bits[..size].copy_from_slice(&bytes[..size]);
        let bits = u64::from_le_bytes(bits);
        Some(match self.module.ty(self.ty) {
            _ if !self.is_scalar() => return None,
            Type::Bool => ScalarContent::Bool(bits != 0),
            &Type::Int { width, signed } => {
                let unused = 64 - width.clamp(1, 64);
                let bits = bits << unused;
                if signed {
                    ScalarContent::Int(bits as i64 >> unused)
                } else {
                    ScalarContent::Uint(bits >> unused)
                }
            }
            ty @ Type::Float { .. } => ScalarContent::Float(FloatValue::of_bits(ty.float_format()?, bits)),
            Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. } => {
                ScalarContent::Address(bits)
            }
            _ => ScalarContent::Handle(bits),
        })
    }

    /// As [`Layout::read`]; each part costs its bytes and one more.
    fn read_within<V: FromParts>(self, bytes: &[u8], budget: &mut usize) -> V {
        let list_at = |bytes: &[u8], count: usize, stride: usize, part: Self, budget: &mut usize| {
            let mut elements = Vec::new();
            for index in 0..count {
                if *budget == 0 {
                    break;
                }
                let from = bytes.get(index.saturating_mul(stride)..).unwrap_or_default();
                elements.push(part.read_within(from, budget));
            }
            elements
        };
        let list = |whole: &[u8], count, stride, part, budget: &mut usize| {
            V::list(self, whole, list_at(bytes, count, stride, part, budget))
        };
        let whole = &bytes[..bytes.len().min(self.size())];
        if *budget == 0 {
            return V::opaque(self);
        }
        *budget = budget.saturating_sub(whole.len() + 1);
        match *self.module.ty(self.ty) {
            Type::Vector { component, count } => {
                let part = self.part(component);
                list(whole, count as usize, self.component_stride(part.size()), part, budget)
            }
            Type::Matrix { column, count } => match self.matrix.filter(|_| self.explicit()) {
                Some(matrix) if matrix.row_major => {
                    let (part, rows) = (self.scalar(column), self.lanes(column));
                    let column = |index: usize| {
                        let first = bytes.get(index * part.size()..).unwrap_or_default();
                        let values = list_at(first, rows, matrix.stride as usize, part, budget);
                        let row = |row: usize| first.get(row * matrix.stride as usize..).unwrap_or_default();
                        let packed = (0..rows).flat_map(|at| row(at).iter().take(part.size()).copied());
                        V::list(self.part(column), &packed.collect::<Vec<_>>(), values)
                    };
                    V::list(self, whole, (0..count as usize).map(column).collect())
                }
                Some(matrix) => {
                    list(whole, count as usize, matrix.stride as usize, self.part(column), budget)
                }
                None => list(whole, count as usize, self.part(column).size(), self.part(column), budget),
            },
            Type::Array { element, length, .. } => {
                let part = self.part(element);
                // What the bytes reach, as a module may declare any length.
                let reached = match part.size() {
                    0 => 0,
                    size => bytes.len().div_ceil(size.max(self.stride())),
                };
                let length = array_length(self.module, length).min(reached);
                list(whole, length, self.stride(), part, budget)
            }
            Type::RuntimeArray { element, .. } => {
                let stride = self.stride().max(1);
                list(bytes, bytes.len() / stride, stride, self.part(element), budget)
            }
            Type::Struct { .. } => {
                let read = |(offset, part): (usize, Self)| {
                    part.read_within(bytes.get(offset..).unwrap_or_default(), budget)
                };
                let members = self.members().map(read).collect();
                let open = self.runtime_stride().is_some();
                V::structure(self, if open { bytes } else { whole }, members)
            }
            _ => match self.read_scalar(bytes) {
                Some(scalar) => V::scalar(self, whole, scalar),
                None => V::opaque(self),
            },
        }
    }

    /// The device addresses in a value's bytes, each with the type that it points to and the stride
    /// of such elements; those of the first parts, where there are very many.
    pub fn addresses(self, bytes: &[u8]) -> Vec<(u64, TypeId, Option<usize>)> {
        let mut found = Vec::new();
        self.collect_addresses(bytes, &mut 4096, &mut found);
        found
    }

    fn collect_addresses(
        self,
        bytes: &[u8],
        budget: &mut usize,
        found: &mut Vec<(u64, TypeId, Option<usize>)>,
    ) {
        let Some(left) = budget.checked_sub(1) else { return };
        *budget = left;
        match *self.module.ty(self.ty) {
            Type::Pointer {
                storage_class: storage::PHYSICAL_STORAGE_BUFFER,
                pointee: Some(pointee),
                stride,
            } => {
                if let Some(&address) = bytes.first_chunk() {
                    found.push((u64::from_le_bytes(address), pointee, stride.map(|stride| stride as usize)));
                }
            }
            Type::Struct { .. } => {
                for (offset, part) in self.members() {
                    part.collect_addresses(bytes.get(offset..).unwrap_or_default(), budget, found);
                }
            }
            _ => {
                let Some((part, length)) = self.element() else { return };
                let elements = bytes.chunks(self.stride().max(1));
                for element in elements.take(length.unwrap_or(usize::MAX)) {
                    if *budget == 0 {
                        break;
                    }
                    part.collect_addresses(element, budget, found);
                }
            }
        }
    }
}
