//! Reads the lines of a part of a Wavefront OBJ file.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::ControlFlow;

use crate::mesh::obj::notes::Notes;
use crate::mesh::obj::text::{self, Words, number, numbers};

/// No texture coordinate, no normal, no vertex.
pub(super) const NONE: u32 = u32::MAX;

/// A vertex of a group: the indices of its attributes.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub position: u32,
    pub texcoord: u32,
    pub normal: u32,
}

/// Values of lines, in their order.
#[derive(Default)]
pub(super) struct Values {
    pub positions: Vec<[f32; 3]>,
    /// The colours of the first positions; empty where none has one.
    pub colors: Vec<Option<[f32; 3]>>,
    pub texcoords: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
}

impl Values {
    /// Numbers of positions, texture coordinates and normals.
    pub(super) fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.texcoords.len(), self.normals.len()]
    }

    /// Adds the values behind these.
    pub(super) fn append(&mut self, other: Self) {
        if !other.colors.is_empty() {
            self.colors.resize(self.positions.len(), None);
            self.colors.extend(other.colors);
        }
        self.positions.extend(other.positions);
        self.texcoords.extend(other.texcoords);
        self.normals.extend(other.normals);
    }
}

/// The faces of a part of a file.
#[derive(Default)]
pub(super) struct Faces {
    /// The corners of all faces.
    pub corners: Vec<Corner>,
    /// The number of corners of each face.
    pub counts: Vec<u32>,
    pub changes: Vec<Change>,
    /// Numbers of positions, texture coordinates and normals that the corners need.
    pub needed: [usize; 3],
}

/// A line after which faces belong to another group.
pub(super) struct Change {
    /// Number of faces of the part before it.
    pub faces: usize,
    pub line: usize,
    pub to: ChangeTo,
}

pub(super) enum ChangeTo {
    /// A group of this name.
    Name(String),
    /// A material, by its place among all.
    Material(Option<usize>),
}

/// Where a part of a file is.
#[derive(Clone, Copy)]
pub(super) struct PartPlace {
    /// The number of its first line.
    pub line: usize,
    /// Numbers of positions, texture coordinates and normals before it.
    pub before: [usize; 3],
}

/// What all parts of a file share.
pub(super) struct FileContext<'f> {
    /// Numbers of positions, texture coordinates and normals of the file.
    pub totals: [usize; 3],
    /// The places of the materials by their names.
    pub materials: HashMap<&'f str, usize>,
}

/// What indices refer to, and the first word of its lines.
const KINDS: [(&str, &str); 3] = [("position", "v"), ("texture coordinate", "vt"), ("normal", "vn")];

/// The content of the lines of a part of a file.
pub(super) struct Lines<'f> {
    context: &'f FileContext<'f>,
    before: [usize; 3],
    /// A line that cannot be read has a value of zeros, so that the others keep their indices.
    pub values: Values,
    /// The indices of such values, by their kinds: faces that use them are left out.
    pub broken: [Vec<u32>; 3],
    pub faces: Faces,
    pub notes: Notes,
}

impl<'f> Lines<'f> {
    /// Reads the lines of a part.
    pub(super) fn of(bytes: &[u8], place: PartPlace, context: &'f FileContext<'f>) -> Self {
        let mut own = Self {
            context,
            before: place.before,
            values: Values::default(),
            broken: Default::default(),
            faces: Faces::default(),
            notes: Notes::default(),
        };
        let _: ControlFlow<()> = text::statements(bytes, place.line, |line, text| {
            own.read(line, Words(text));
            ControlFlow::Continue(())
        });
        own
    }

    #[inline]
    fn read(&mut self, line: usize, mut words: Words<'_>) {
        match words.next().unwrap_or_default() {
            b"v" => self.position(line, words),
            b"vt" => {
                let texcoord = texcoord(words).unwrap_or_else(|message| self.broken(line, 1, &message));
                self.values.texcoords.push(texcoord);
            }
            b"vn" => {
                let normal = numbers(&mut words).unwrap_or_else(|message| self.broken(line, 2, &message));
                self.values.normals.push(normal);
            }
            b"f" => self.face(line, words),
            b"o" | b"g" => {
                let name = words.name();
                let name = if name.is_empty() { Cow::Borrowed(UNNAMED) } else { name };
                self.change(line, ChangeTo::Name(name.into_owned()));
            }
            b"usemtl" => {
                let material = self.context.materials.get(&*words.name());
                self.change(line, ChangeTo::Material(material.copied()));
            }
            b"l" => self.notes.add(line, "a line (`l`)"),
            b"p" => self.notes.add(line, "a point (`p`)"),
            // Others read material libraries; shading groups and display attributes change no
            // triangle.
            b"" | b"mtllib" | b"s" | b"mg" | b"bevel" | b"c_interp" | b"d_interp" | b"lod" => {}
            other => self.notes.add(line, format!("`{}`", text::shown(other))),
        }
    }

    /// Notes that the next value of a kind cannot be read. Returns zeros.
    #[cold]
    fn broken<T: Default>(&mut self, line: usize, kind: usize, message: &str) -> T {
        let index = self.before[kind] + self.values.counts()[kind];
        self.broken[kind].extend(u32::try_from(index).ok());
        let (what, word) = KINDS[kind];
        self.notes.add(line, format!("a {what} (`{word}`) and the faces that use it: {message}"));
        T::default()
    }

    fn change(&mut self, line: usize, to: ChangeTo) {
        self.faces.changes.push(Change { faces: self.faces.counts.len(), line, to });
    }

    /// Reads a position and its colour. A fourth number without others is the weight of a curve.
    fn position(&mut self, line: usize, mut words: Words<'_>) {
        let position = numbers(&mut words).unwrap_or_else(|message| {
            words = Words(b"");
            self.broken(line, 0, &message)
        });
        self.values.positions.push(position);
        if words.0.trim_ascii_start().is_empty() {
            return;
        }
        let mut color = [0.0; 3];
        let mut count = 0;
        for (at, word) in words.enumerate() {
            count = at + 1;
            match (number(word), color.get_mut(at)) {
                (Ok(number), Some(channel)) => *channel = number,
                (Ok(_), None) => {}
                (Err(_), _) => {
                    self.notes.add(line, "words behind a position");
                    return;
                }
            }
        }
        match count {
            0 | 1 => {}
            2 => self.notes.add(line, "two numbers behind a position: a colour has three"),
            _ => {
                let colors = &mut self.values.colors;
                colors.resize(self.values.positions.len() - 1, None);
                colors.push(Some(color));
            }
        }
    }

    fn face(&mut self, line: usize, words: Words<'_>) {
        let first = self.faces.corners.len();
        for word in words {
            match self.corner(word) {
                Ok(corner) => self.faces.corners.push(corner),
                Err(message) => {
                    self.notes.add(line, format!("a face (`f`): {message}"));
                    self.faces.corners.truncate(first);
                    // A polygon without corners: those behind it keep their numbers.
                    if words.count() > 2 {
                        self.faces.counts.push(0);
                    }
                    return;
                }
            }
        }
        match u32::try_from(self.faces.corners.len() - first) {
            Ok(count @ 3..) => self.faces.counts.push(count),
            _ => {
                self.faces.corners.truncate(first);
                self.notes.add(line, "a face of fewer than three corners");
            }
        }
    }

    /// Reads a corner, `position[/texcoord[/normal]]`.
    #[inline]
    fn corner(&mut self, word: &[u8]) -> Result<Corner, String> {
        let mut indices = [NONE; 3];
        let counts = self.values.counts();
        let mut rest = word;
        for at in 0..3 {
            let end = rest.iter().position(|byte| *byte == b'/').unwrap_or(rest.len());
            let (digits, behind) = rest.split_at(end);
            if !digits.is_empty() || at == 0 {
                let (known, total) = (self.before[at] + counts[at], self.context.totals[at]);
                let Some(index) = index_of(digits, known, total) else {
                    return Err(wrong_index(word, digits, at, known, total));
                };
                let needed = &mut self.faces.needed[at];
                *needed = (index as usize + 1).max(*needed);
                indices[at] = index;
            }
            let Some((_, behind)) = behind.split_first() else {
                let [position, texcoord, normal] = indices;
                return Ok(Corner { position, texcoord, normal });
            };
            rest = behind;
        }
        Err(format!("`{}` has more than three indices", text::shown(word)))
    }
}

/// The name of faces before the first `o` or `g`.
pub(super) const UNNAMED: &str = "unnamed_object";

/// Reads a texture coordinate, whose second number may be left out.
fn texcoord(mut words: Words<'_>) -> Result<[f32; 2], String> {
    let [u] = numbers(&mut words)?;
    let v = words.next().map_or(Ok(0.0), number)?;
    Ok([u, v])
}

/// An index, counted from 0, among the elements of a file: written from 1 on, or from the last one
/// that is known backwards from -1 on.
#[inline]
fn index_of(digits: &[u8], known: usize, total: usize) -> Option<u32> {
    let (is_negative, value) = match digits {
        [b'-', value @ ..] => (true, value),
        value => (false, value),
    };
    let mut number = 0_usize;
    for byte in value {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            return None;
        }
        // What is too large for any file stays so.
        number = number.saturating_mul(10).saturating_add(digit.into());
    }
    let found = if is_negative { known.checked_sub(number)? } else { number.checked_sub(1)? };
    (number > 0 && found < total && found < NONE as usize).then_some(found as u32)
}

/// The message for a corner whose index cannot be read.
#[cold]
fn wrong_index(corner: &[u8], digits: &[u8], kind: usize, known: usize, total: usize) -> String {
    let value = digits.strip_prefix(b"-").unwrap_or(digits);
    let (is_negative, shown) = (value.len() < digits.len(), text::shown(digits));
    if digits.is_empty() {
        return format!("`{}` has no position", text::shown(corner));
    }
    if value.is_empty() || !value.iter().all(u8::is_ascii_digit) {
        return format!("`{shown}` is not an index");
    }
    let (what, word) = KINDS[kind];
    let count = if is_negative { known } else { total };
    let place = if is_negative { "before this line" } else { "in the file" };
    format!("no {what} has the index {shown}: there are {count} lines of `{word}` {place}, counted from 1")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read<'f>(text: &str, context: &'f FileContext<'f>) -> Lines<'f> {
        Lines::of(text.as_bytes(), PartPlace { line: 1, before: [0; 3] }, context)
    }

    fn context(totals: [usize; 3]) -> FileContext<'static> {
        FileContext { totals, materials: HashMap::new() }
    }

    #[test]
    fn broken_lines_are_notes_with_a_cause() {
        let context = context([3, 1, 1]);
        let points = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 \\\n0\nvn 0 0 1\n";
        for (line, message) in [
            ("v 0 0", "3 numbers expected, but 2 found"),
            ("v 0 0 # 0", "3 numbers expected, but 2 found"),
            ("v 0 x 0", "`x` is not a number"),
            ("vt", "a number is missing"),
            ("vt 0 x", "`x` is not a number"),
            ("vn 0 0", "3 numbers expected, but 2 found"),
            ("f 1 2 4", "no position has the index 4: there are 3 lines of `v` in the file"),
            ("f 0 1 2", "no position has the index 0"),
            ("f -0 1 2", "no position has the index -0"),
            ("f -4 1 2", "no position has the index -4: there are 3 lines of `v` before this line"),
            ("f 1/2 2 3", "no texture coordinate has the index 2"),
            ("f 1//-2 2 3", "no normal has the index -2"),
            ("f 1/1/1/1 2 3", "`1/1/1/1` has more than three indices"),
            ("f /1 2 3", "`/1` has no position"),
            ("f 1 2 x", "`x` is not an index"),
            ("f 1 2 -", "`-` is not an index"),
            ("f 1 2 +3", "`+3` is not an index"),
            ("f 1 2 99999999999999999999999", "no position has the index 99999999999999999999999"),
        ] {
            let lines = read(&format!("{points}{line}\nf 1 2 3 1\n"), &context);
            let notes = lines.notes.list(None);
            assert_eq!(notes.len(), 1, "{line}: {notes:?}");
            assert!(notes[0].starts_with("line 7: ") && notes[0].contains(message), "{line}: {notes:?}");
            let counts: &[u32] = if line.starts_with('f') { &[0, 4] } else { &[4] };
            assert_eq!((&lines.faces.counts[..], lines.faces.corners.len()), (counts, 4), "{line}");
            let index = |word: &str| if line.starts_with(&format!("{word} ")) { 1 } else { 0 };
            let broken = lines.broken.map(|indices| indices.len());
            assert_eq!(broken, [index("v"), usize::from(line == "vt") + index("vt"), index("vn")], "{line}");
        }
    }

    /// Lines that others read, and what they make of them.
    #[test]
    fn odd_lines_are_read() {
        let context = context([4, 1, 0]);
        let text = "v 0 0 0 1\nv 1 0 0 # here\nv 0 0 \\\n1\nv 1 2 3 .5 .25 1 9\nvt .5\nf -4/1 2/-1 3/1 # 4\nf 1 2#3\n";
        let lines = read(text, &context);
        assert_eq!(lines.values.positions, [[0., 0., 0.], [1., 0., 0.], [0., 0., 1.], [1., 2., 3.]]);
        assert_eq!(lines.values.colors, [None, None, None, Some([0.5, 0.25, 1.0])]);
        assert_eq!(lines.values.texcoords, [[0.5, 0.0]]);
        let corners: Vec<_> =
            lines.faces.corners.iter().map(|corner| (corner.position, corner.texcoord)).collect();
        assert_eq!((corners, &lines.faces.counts[..]), (vec![(0, 0), (1, 0), (2, 0)], &[3][..]));
        assert_eq!(lines.faces.needed, [3, 1, 0]);
    }
}
