//! Paths of names to the parts of a type, and the part that a byte belongs to.

use crate::module::ty::{MatrixLayout, Type};
use crate::reflect::layout::Layout;

/// Fields of a layout that an error shows.
const SHOWN: usize = 24;

/// Names of the first components of a vector.
const COMPONENTS: [&str; 4] = ["x", "y", "z", "w"];

/// A scalar or vector in memory.
#[derive(Clone, Debug)]
pub struct MemoryPart<'a> {
    /// The access path from the whole: `outputs[3].normal`.
    pub path: String,
    /// The offset of its first byte from that of the whole.
    pub offset: u64,
    /// The scalar or vector.
    pub layout: Layout<'a>,
}

impl MemoryPart<'_> {
    /// The offset behind its last byte.
    pub fn end(&self) -> u64 {
        self.offset + self.layout.size() as u64
    }
}

/// The part of a layout that a byte belongs to.
#[derive(Clone, Copy, Debug)]
pub enum ScalarSearch<'a> {
    /// A scalar, and the offset of its first byte.
    Scalar(Layout<'a>, usize),
    /// No scalar, with scalars behind.
    Padding,
    /// No scalar: the layout ends before.
    Beyond,
}

impl<'a> Layout<'a> {
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
                let is_struct = matches!(self.module.ty(at.ty), Type::Struct { .. });
                let part = at.child(number).filter(|_| !is_struct);
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
                        let part = at.component_named(name).ok_or_else(|| format!("no member `{name}`"))?;
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
    fn component_named(self, name: &str) -> Option<(usize, Self)> {
        let Type::Vector { .. } = self.module.ty(self.ty) else { return None };
        let index = COMPONENTS.iter().position(|known| *known == name)?;
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

    /// Returns the scalar that holds a byte. Members may share their bytes: the first one counts.
    pub fn scalar_at(self, at: usize) -> ScalarSearch<'a> {
        match (self.module.ty(self.ty), self.element()) {
            (Type::Struct { .. }, _) => first_scalar(self.members(), at),
            (_, Some((element, length))) => {
                let (stride, length) = (self.stride(), length.unwrap_or(usize::MAX));
                match at.checked_div(stride) {
                    Some(index) if index < length => match element.scalar_at(at % stride) {
                        ScalarSearch::Scalar(found, start) => {
                            ScalarSearch::Scalar(found, index * stride + start)
                        }
                        // Behind the last element there is nothing; between two, padding.
                        ScalarSearch::Beyond if index + 1 == length => ScalarSearch::Beyond,
                        ScalarSearch::Beyond | ScalarSearch::Padding => ScalarSearch::Padding,
                    },
                    _ => ScalarSearch::Beyond,
                }
            }
            _ if self.is_scalar() && at < self.size() => ScalarSearch::Scalar(self, 0),
            _ => first_scalar(self.parts().into_iter(), at),
        }
    }

    /// Returns the scalar or vector that a byte belongs to, or that precedes the byte where it is
    /// padding, by the offsets and strides that the module declares; `None` where it declares none.
    pub fn part_at(self, byte: u64) -> Option<MemoryPart<'a>> {
        self.find_part(0, byte, String::new())
    }

    fn find_part(self, start: u64, byte: u64, path: String) -> Option<MemoryPart<'a>> {
        let within = byte - start;
        match self.module.ty(self.ty) {
            Type::Struct { members, .. } => {
                let placed = members.iter().filter_map(|member| Some((u64::from(member.offset?), member)));
                let (offset, member) =
                    placed.filter(|&(offset, _)| offset <= within).max_by_key(|&(offset, _)| offset)?;
                // naga and slangc wrap an array in a struct, whose member no source names.
                let is_wrapper =
                    members.len() == 1 && (member.name.is_empty() || member.name.starts_with("__member"));
                let at = members.iter().position(|other| std::ptr::eq(other, member)).unwrap_or(0);
                let name = match member.name.as_str() {
                    _ if is_wrapper => String::new(),
                    "" => format!("member{at}"),
                    name => name.to_owned(),
                };
                let dot = if path.is_empty() || name.is_empty() { "" } else { "." };
                let path = format!("{path}{dot}{name}");
                self.member(at).1.find_part(start + offset, byte, path)
            }
            Type::Array { element, stride: Some(stride), .. }
            | Type::RuntimeArray { element, stride: Some(stride) } => {
                let index = within.checked_div((*stride).into())?;
                let start = start + index * u64::from(*stride);
                self.part(*element).find_part(start, byte, format!("{path}[{index}]"))
            }
            Type::Matrix { column, .. } => {
                let MatrixLayout { stride, row_major } = self.matrix?;
                let index = within.checked_div(stride.into())?;
                let start = start + index * u64::from(stride);
                if !row_major {
                    return self.part(*column).find_part(start, byte, format!("{path}[{index}]"));
                }
                let component = self.scalar(*column);
                let size = component.size() as u64;
                let column = (byte - start).checked_div(size)?;
                component.find_part(start + column * size, byte, format!("{path}[{column}][{index}]"))
            }
            // A column of a matrix is a vector without gaps.
            _ => Some(MemoryPart { path, offset: start, layout: Self { matrix: None, ..self } }),
        }
    }

    /// Returns the access path to the scalar that a byte belongs to: `outputs[3].normal.x`; `None`
    /// where the byte is padding, or the type is not laid out.
    pub fn byte_path(self, byte: u64) -> Option<String> {
        let MemoryPart { mut path, offset, layout } = self.part_at(byte)?;
        let within = byte - offset;
        if within >= layout.size() as u64 {
            return None;
        }
        if let Type::Vector { .. } = layout.module.ty(layout.ty) {
            let at = within.checked_div(layout.scalar(layout.ty).size() as u64)? as usize;
            path +=
                &COMPONENTS.get(at).map_or_else(|| format!("[{at}]"), |component| format!(".{component}"));
        }
        Some(path)
    }
}

/// Returns what the first of several parts has at an offset.
fn first_scalar<'a>(parts: impl Iterator<Item = (usize, Layout<'a>)>, at: usize) -> ScalarSearch<'a> {
    let mut is_before = false;
    for (offset, part) in parts {
        if offset > at {
            is_before = true;
            continue;
        }
        match part.scalar_at(at - offset) {
            ScalarSearch::Scalar(found, start) => return ScalarSearch::Scalar(found, offset + start),
            ScalarSearch::Padding => is_before = true,
            ScalarSearch::Beyond => {}
        }
    }
    if is_before { ScalarSearch::Padding } else { ScalarSearch::Beyond }
}

/// Cuts a list of lines where it is long, and says how many more there were.
pub fn shorten(lines: &mut Vec<String>) {
    if lines.len() > SHOWN {
        let more = lines.len() - SHOWN;
        lines.truncate(SHOWN);
        lines.push(format!("and {more} more"));
    }
}

#[cfg(test)]
mod tests {
    use crate::module::Opcode;

    use crate::module::Id;
    use crate::module::assemble::Assembler;
    use crate::reflect::{Layout, Rules};

    #[test]
    fn bytes_have_the_path_of_their_scalar() {
        const OFFSET: u32 = 35;
        const ARRAY_STRIDE: u32 = 6;
        let [vec3, float] = [7, 6];
        let mut a = Assembler::new();
        a.with_string(Opcode::MemberName, &[50, 0], "position", &[]);
        a.with_string(Opcode::MemberName, &[50, 1], "mass", &[]);
        a.with_string(Opcode::MemberName, &[52, 0], "count", &[]);
        for (member, offset) in [(0, 0), (1, 16)] {
            a.op(Opcode::MemberDecorate, &[50, member, OFFSET, offset]);
        }
        for (member, offset) in [(0, 0), (1, 16)] {
            a.op(Opcode::MemberDecorate, &[52, member, OFFSET, offset]);
        }
        a.op(Opcode::MemberDecorate, &[53, 0, OFFSET, 0]);
        a.op(Opcode::Decorate, &[51, ARRAY_STRIDE, 32]);
        a.types();
        a.op(Opcode::TypeStruct, &[50, vec3, float]);
        a.op(Opcode::TypeRuntimeArray, &[51, 50]);
        a.op(Opcode::TypeStruct, &[52, float, 51]);
        a.op(Opcode::TypeStruct, &[53, 51]);
        let module = a.loaded();
        let path = |ty: u32, byte| {
            let ty = module.type_with_id(Id(ty)).expect("a type");
            Layout::new(&module, ty, Rules::Explicit).byte_path(byte)
        };
        assert_eq!(path(52, 0).as_deref(), Some("count"));
        assert_eq!(path(52, 8), None, "padding");
        assert_eq!(path(52, 16 + 64 + 4).as_deref(), Some("member1[2].position.y"));
        assert_eq!(path(52, 16 + 12), None, "padding");
        assert_eq!(path(52, 16 + 16).as_deref(), Some("member1[0].mass"));
        // A wrapper's member has no name in a source.
        assert_eq!(path(53, 33).as_deref(), Some("[1].position.x"));
    }
}
