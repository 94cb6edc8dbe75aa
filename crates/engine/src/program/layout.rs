//! How a shader's values lie in bytes, and the words for it in errors.
//!
//! Buffers, push constants and shader records carry their layout in the module (`Offset`,
//! `ArrayStride`, `MatrixStride`). Payloads, callable data and hit attributes carry none: here
//! their scalars follow each other without gaps, in the order of the declaration and column by
//! column, each of 8, 16 or 32 bits in four bytes and each of 64 bits in eight; a bool is a `u32`,
//! 0 or 1. So `#[repr(C)] struct { normal: [f32; 3], t: f32, hits: u32 }` is the payload `{ vec3
//! normal; float t; uint hits; }`.

use crate::module::Module;
use crate::module::ty::{MatrixLayout, Type, TypeId};
use crate::ops::translate::array_length;

/// Fields of a layout that an error shows.
const SHOWN: usize = 24;

/// Which rules place a value's parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rules {
    /// Scalars without gaps: payloads, callable data, hit attributes.
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

    /// The size in bytes; a runtime array at the end counts as nothing.
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
            Type::Array { element, length, stride } => {
                let length = array_length(self.module, *length);
                let element = self.part(*element).size();
                match stride.filter(|_| self.explicit()) {
                    Some(_) if length == 0 => 0,
                    Some(stride) => spread(length, stride as usize, element),
                    None => length.saturating_mul(element),
                }
            }
            Type::Struct { members, .. } if self.explicit() => {
                let ends = (0..members.len()).map(|at| {
                    let (offset, member) = self.member(at);
                    member.size().saturating_add(offset)
                });
                ends.max().unwrap_or(0)
            }
            Type::Struct { members, .. } => {
                let sizes = members.iter().map(|member| self.part(member.ty).size());
                sizes.fold(0, usize::saturating_add)
            }
            // A device address; other pointers do not lie in memory.
            Type::Pointer { .. } => 8,
            _ => 0,
        }
    }

    /// How the matrices of the member around lie.
    pub fn matrix(self) -> Option<MatrixLayout> {
        self.matrix
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
            Type::Bool | Type::Int { .. } | Type::Float { .. } | Type::Pointer { .. } => {
                found.push((offset, self));
            }
            Type::Struct { .. } => {
                for (at, member) in self.members() {
                    member.each_scalar(offset + at, found);
                }
            }
            Type::RuntimeArray { .. } => {}
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
            Type::Array { element, length, stride } => {
                let part = Self { ty: *element, ..self };
                let length = array_length(self.module, *length);
                let stride = stride.filter(|_| self.explicit()).map_or(part.size(), |stride| stride as usize);
                // Elements without bytes have no scalars, however many there are.
                row(if part.size() == 0 { 0 } else { length }, stride, part)
            }
            _ => Vec::new(),
        }
    }

    /// Offset and layout of the part at a path: `path[1].weight`, `normal.x`; the whole at an empty
    /// one.
    ///
    /// # Errors
    /// What does not exist, in words.
    pub fn locate(self, path: &str) -> Result<(usize, Self), String> {
        let (mut offset, mut at, mut walked) = (0usize, self, 0);
        while walked < path.len() {
            let rest = &path[walked..];
            let (found, length) = if let Some(index) = rest.strip_prefix('[') {
                let (index, _) = index.split_once(']').ok_or_else(|| format!("`{path}` lacks a `]`"))?;
                let number = index.parse::<usize>().map_err(|_| format!("`[{index}]` is not an index"))?;
                let element =
                    |element: TypeId| (number.saturating_mul(at.stride()), Self { ty: element, ..at });
                let part = match *self.module.ty(at.ty) {
                    Type::RuntimeArray { element: of, .. } => Some(element(of)),
                    Type::Array { element: of, length, .. } => {
                        (number < array_length(self.module, length)).then(|| element(of))
                    }
                    _ => at.parts().get(number).copied(),
                };
                (part.ok_or_else(|| format!("no element `{}[{number}]`", &path[..walked]))?, index.len() + 2)
            } else {
                let name = rest.trim_start_matches('.');
                let skipped = rest.len() - name.len();
                let name = &name[..name.find(['.', '[']).unwrap_or(name.len())];
                let members = match self.module.ty(at.ty) {
                    Type::Struct { members, .. } => &members[..],
                    _ => &[],
                };
                match (members.iter().position(|member| member.name == name), members) {
                    (Some(index), _) => (at.member(index), skipped + name.len()),
                    (None, []) => {
                        let part = at.component(name).ok_or_else(|| format!("no member `{name}`"))?;
                        (part, skipped + name.len())
                    }
                    // Into such a block naga puts a struct: it is used like its member.
                    (None, [only]) if only.name.is_empty() => (at.member(0), 0),
                    _ => return Err(format!("no member `{name}`")),
                }
            };
            offset = offset.saturating_add(found.0);
            at = found.1;
            walked += length;
        }
        Ok((offset, at))
    }

    /// Offset and layout of a component of a vector by its name, `x` to `w`.
    fn component(self, name: &str) -> Option<(usize, Self)> {
        let Type::Vector { .. } = self.module.ty(self.ty) else { return None };
        let index = ["x", "y", "z", "w"].iter().position(|known| *known == name)?;
        self.parts().get(index).copied()
    }

    /// The layout as lines: offset, type and path of each part that is no struct.
    pub fn describe(self) -> Vec<String> {
        let mut lines: Vec<_> =
            self.lines().into_iter().map(|(offset, text)| format!("{offset:5}  {text}")).collect();
        shorten(&mut lines);
        lines
    }

    /// The path of the part at an offset of a block.
    pub fn path_at(self, offset: usize) -> String {
        let lines = self.lines();
        let line = lines.iter().rfind(|(at, _)| *at <= offset);
        let path = line.and_then(|(_, text)| text.split_once(' ')).map_or("", |(_, path)| path);
        match path {
            "" => format!("offset {offset}"),
            path => path.to_owned(),
        }
    }

    /// Every scalar, vector and matrix of it with its offset: type and path.
    pub fn lines(self) -> Vec<(usize, String)> {
        let mut lines = Vec::new();
        self.collect_lines("", 0, &mut lines);
        lines
    }

    fn collect_lines(self, path: &str, offset: usize, lines: &mut Vec<(usize, String)>) {
        match self.module.ty(self.ty) {
            Type::Struct { members, .. } => {
                for (member, (at, layout)) in members.iter().zip(self.members()) {
                    let dot = if path.is_empty() { "" } else { "." };
                    layout.collect_lines(&format!("{path}{dot}{}", member.name), offset + at, lines);
                }
            }
            _ => lines.push((offset, format!("{} {path}", self.module.describe_type(self.ty)))),
        }
    }
}

/// Bytes from the first of `count` things to the end of the last.
fn spread(count: usize, stride: usize, each: usize) -> usize {
    count.saturating_sub(1).saturating_mul(stride).saturating_add(each)
}

/// Cuts a list of lines where it is long, and says how many more there were.
pub fn shorten(lines: &mut Vec<String>) {
    if lines.len() > SHOWN {
        let more = lines.len() - SHOWN;
        lines.truncate(SHOWN);
        lines.push(format!("and {more} more"));
    }
}

fn scalar_size(width: u32, rules: Rules) -> usize {
    match rules {
        Rules::Packed => width.div_ceil(32) as usize * 4,
        Rules::Explicit => width as usize / 8,
    }
}
