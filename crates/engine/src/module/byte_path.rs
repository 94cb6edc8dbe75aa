//! The part of a type that a byte of memory belongs to, by the offsets and strides that lay the
//! type out.

use crate::module::Module;
use crate::module::ty::{MatrixLayout, Type, TypeId};

/// A scalar or vector in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemoryPart {
    /// The access path from the whole: `outputs[3].normal`.
    pub path: String,
    /// The offset of its first byte from that of the whole.
    pub offset: u64,
    /// Its type.
    pub ty: TypeId,
    /// The type of its scalars.
    pub scalar: TypeId,
}

impl Module {
    /// Returns the scalar or vector of a type that a byte belongs to, or that precedes the byte
    /// where it is padding; `None` where the type is not laid out.
    #[doc(hidden)]
    pub fn part_at(&self, ty: TypeId, byte: u64) -> Option<MemoryPart> {
        self.find_part(ty, 0, byte, None, String::new())
    }

    fn find_part(
        &self,
        ty: TypeId,
        start: u64,
        byte: u64,
        matrix: Option<MatrixLayout>,
        path: String,
    ) -> Option<MemoryPart> {
        let within = byte - start;
        match self.ty(ty) {
            Type::Struct { members, .. } => {
                let placed = members.iter().filter_map(|member| Some((u64::from(member.offset?), member)));
                let (offset, member) =
                    placed.filter(|&(offset, _)| offset <= within).max_by_key(|&(offset, _)| offset)?;
                // naga and slangc wrap an array in a struct, whose member no source names.
                let is_wrapper =
                    members.len() == 1 && (member.name.is_empty() || member.name.starts_with("__member"));
                let name = match member.name.as_str() {
                    _ if is_wrapper => String::new(),
                    "" => {
                        let at = members.iter().position(|other| std::ptr::eq(other, member)).unwrap_or(0);
                        format!("member{at}")
                    }
                    name => name.to_owned(),
                };
                let dot = if path.is_empty() || name.is_empty() { "" } else { "." };
                let path = format!("{path}{dot}{name}");
                self.find_part(member.ty, start + offset, byte, member.matrix, path)
            }
            Type::Array { element, stride: Some(stride), .. }
            | Type::RuntimeArray { element, stride: Some(stride) } => {
                let index = within.checked_div((*stride).into())?;
                let start = start + index * u64::from(*stride);
                self.find_part(*element, start, byte, matrix, format!("{path}[{index}]"))
            }
            Type::Matrix { column, .. } => {
                let MatrixLayout { stride, row_major } = matrix?;
                let index = within.checked_div(stride.into())?;
                if !row_major {
                    let start = start + index * u64::from(stride);
                    return self.find_part(*column, start, byte, None, format!("{path}[{index}]"));
                }
                let Type::Vector { component, .. } = *self.ty(*column) else { return None };
                let size = self.size_of(component)?;
                let column = (within - index * u64::from(stride)).checked_div(size)?;
                let start = start + index * u64::from(stride) + column * size;
                self.find_part(component, start, byte, None, format!("{path}[{column}][{index}]"))
            }
            &Type::Vector { component, .. } => {
                Some(MemoryPart { path, offset: start, ty, scalar: component })
            }
            _ => Some(MemoryPart { path, offset: start, ty, scalar: ty }),
        }
    }

    /// Returns the access path from a whole to the scalar of a type that a byte belongs to:
    /// `outputs[3].normal.x`; `None` where the byte is padding, or the type is not laid out.
    #[doc(hidden)]
    pub fn byte_path(&self, ty: TypeId, byte: u64) -> Option<String> {
        let MemoryPart { mut path, offset, ty, scalar } = self.part_at(ty, byte)?;
        let within = byte - offset;
        if within >= self.size_of(ty)? {
            return None;
        }
        if ty != scalar {
            let at = within.checked_div(self.size_of(scalar)?)? as usize;
            path += &["x", "y", "z", "w"]
                .get(at)
                .map_or_else(|| format!("[{at}]"), |component| format!(".{component}"));
        }
        Some(path)
    }
}

#[cfg(test)]
mod tests {
    use rspirv::spirv::Op;

    use crate::module::Id;
    use crate::module::assemble::Assembler;

    #[test]
    fn bytes_have_the_path_of_their_scalar() {
        const OFFSET: u32 = 35;
        const ARRAY_STRIDE: u32 = 6;
        let [vec3, float] = [7, 6];
        let mut a = Assembler::new();
        a.with_string(Op::MemberName, &[50, 0], "position", &[]);
        a.with_string(Op::MemberName, &[50, 1], "mass", &[]);
        a.with_string(Op::MemberName, &[52, 0], "count", &[]);
        for (member, offset) in [(0, 0), (1, 16)] {
            a.op(Op::MemberDecorate, &[50, member, OFFSET, offset]);
        }
        for (member, offset) in [(0, 0), (1, 16)] {
            a.op(Op::MemberDecorate, &[52, member, OFFSET, offset]);
        }
        a.op(Op::MemberDecorate, &[53, 0, OFFSET, 0]);
        a.op(Op::Decorate, &[51, ARRAY_STRIDE, 32]);
        a.types();
        a.op(Op::TypeStruct, &[50, vec3, float]);
        a.op(Op::TypeRuntimeArray, &[51, 50]);
        a.op(Op::TypeStruct, &[52, float, 51]);
        a.op(Op::TypeStruct, &[53, 51]);
        let module = a.loaded();
        let path = |ty: u32, byte| module.byte_path(module.type_with_id(Id(ty)).expect("a type"), byte);
        assert_eq!(path(52, 0).as_deref(), Some("count"));
        assert_eq!(path(52, 8), None, "padding");
        assert_eq!(path(52, 16 + 64 + 4).as_deref(), Some("member1[2].position.y"));
        assert_eq!(path(52, 16 + 12), None, "padding");
        assert_eq!(path(52, 16 + 16).as_deref(), Some("member1[0].mass"));
        // A wrapper's member has no name in a source.
        assert_eq!(path(53, 33).as_deref(), Some("[1].position.x"));
    }
}
