//! Reads the groups of a Wavefront OBJ file with triangles and polygons.
//!
//! These are the groups that `tobj` makes, which keeps 104 bytes of every face until its group ends
//! and then finds the vertices that corners share in a hash map. Here corners are numbered while
//! they are read: each position has a list of the vertices that were made of it. A file that has
//! anything else (points, lines, weights of positions, vertices behind their faces, mistakes) is
//! left to `tobj`, which also explains what is wrong with it.

use std::collections::HashMap;

use crate::scene::mesh::obj::{ObjMesh, ObjModel};

/// No texture coordinate, no normal, no vertex.
const NONE: u32 = u32::MAX;

/// A longer list of the vertices of one position continues in a hash map.
const MAX_LIST: usize = 8;

/// A vertex of a group: the indices of its attributes.
#[derive(Clone, Copy)]
struct Corner {
    position: u32,
    texcoord: u32,
    normal: u32,
}

impl Corner {
    /// The key of a hash map.
    fn key(self) -> [u32; 3] {
        [self.position, self.texcoord, self.normal]
    }
}

/// A vertex, and the next of the same position in the group.
struct Vertex {
    corner: Corner,
    next: u32,
}

/// What is read so far.
#[derive(Default)]
struct Reader {
    positions: Vec<[f32; 3]>,
    colors: Vec<[f32; 3]>,
    texcoords: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// For each position the first vertex of the group that was made of it.
    first_vertices: Vec<u32>,
    /// The vertices that are in no list, as theirs are long.
    unlisted: HashMap<[u32; 3], u32>,
    vertices: Vec<Vertex>,
    indices: Vec<u32>,
    models: Vec<ObjModel>,
}

/// The groups of a file, each with its material's place among `materials`; `None` where `tobj` must
/// read it.
pub(super) fn read(bytes: &[u8], materials: &[String]) -> Option<Vec<ObjModel>> {
    let text = std::str::from_utf8(bytes).ok()?;
    let places: HashMap<&str, usize> = materials.iter().map(String::as_str).zip(0..).collect();
    let mut reader = Reader::default();
    let (mut name, mut material) = ("unnamed_object", None);
    // Lines of one line feed after the other: a carriage return before it is white space.
    for line in lines(text.as_bytes()) {
        let mut words = Words(line);
        // Words that other characters than those of ASCII divide are read by `tobj`.
        match words.next().unwrap_or_default() {
            b"v" => reader.position(words)?,
            b"vt" => reader.texcoords.push(numbers(&mut words)?),
            b"vn" => reader.normals.push(numbers(&mut words)?),
            b"f" => reader.face(words)?,
            b"l" => return None,
            b"o" | b"g" => {
                reader.finish_group(name, material)?;
                // Behind the first character, even if that is white space.
                name = std::str::from_utf8(line).ok()?.get(1..)?.trim();
                if name.is_empty() {
                    name = "unnamed_object";
                }
            }
            b"usemtl" => {
                let wanted = std::str::from_utf8(line).ok()?.split_once(' ')?.1.trim();
                let wanted = if wanted.is_empty() { return None } else { places.get(wanted).copied() };
                if wanted != material {
                    reader.finish_group(name, material)?;
                }
                material = wanted;
            }
            [b'#', ..] => {}
            first if first.is_ascii() && !first.contains(&b'\x0B') => {}
            _ => return None,
        }
    }
    reader.finish_group(name, material)?;
    Some(reader.models)
}

impl Reader {
    /// Reads a position, and its colour if it has one.
    fn position(&mut self, mut words: Words<'_>) -> Option<()> {
        self.positions.push(numbers(&mut words)?);
        if !words.is_empty() {
            self.colors.push(numbers(&mut words)?);
            return words.is_empty().then_some(());
        }
        Some(())
    }

    /// Reads a polygon: a fan around its first corner.
    fn face(&mut self, mut words: Words<'_>) -> Option<()> {
        let (first, mut last) = (self.vertex(words.next()?)?, self.vertex(words.next()?)?);
        // A line has two corners.
        let mut next = Some(words.next()?);
        while let Some(word) = next {
            let this = self.vertex(word)?;
            self.indices.extend([first, last, this]);
            last = this;
            next = words.next();
        }
        Some(())
    }

    /// The vertex of a corner, `position[/texcoord[/normal]]`.
    fn vertex(&mut self, word: &[u8]) -> Option<u32> {
        let mut parts = word.split(|byte| *byte == b'/');
        let position = index(parts.next()?, self.positions.len())?;
        let mut optional = |count: usize| match parts.next() {
            None | Some([]) => Some(NONE),
            Some(digits) => index(digits, count),
        };
        let (texcoord, normal) = (optional(self.texcoords.len())?, optional(self.normals.len())?);
        if parts.next().is_some() {
            return None;
        }
        self.number(Corner { position, texcoord, normal })
    }

    /// The number of a vertex within the group; a new one gets the next.
    fn number(&mut self, corner: Corner) -> Option<u32> {
        if self.first_vertices.len() < self.positions.len() {
            self.first_vertices.resize(self.positions.len(), NONE);
        }
        let first = &mut self.first_vertices[corner.position as usize];
        let mut at = *first;
        let mut length = 0;
        while let Some(vertex) = self.vertices.get(at as usize) {
            if vertex.corner.texcoord == corner.texcoord && vertex.corner.normal == corner.normal {
                return Some(at);
            }
            (at, length) = (vertex.next, length + 1);
        }
        let new = u32::try_from(self.vertices.len()).ok().filter(|new| *new != NONE)?;
        let mut next = NONE;
        if length < MAX_LIST {
            next = std::mem::replace(first, new);
        } else if let Some(known) = self.unlisted.get(&corner.key()) {
            return Some(*known);
        } else {
            self.unlisted.insert(corner.key(), new);
        }
        self.vertices.push(Vertex { corner, next });
        Some(new)
    }

    /// Makes a model of the triangles since the last group, if there are any.
    fn finish_group(&mut self, name: &str, material: Option<usize>) -> Option<()> {
        if self.indices.is_empty() {
            return Some(());
        }
        let mut mesh = ObjMesh { material_id: material, ..ObjMesh::default() };
        mesh.positions.reserve_exact(3 * self.vertices.len());
        for Vertex { corner, .. } in self.vertices.drain(..) {
            let position = corner.position as usize;
            self.first_vertices[position] = NONE;
            mesh.positions.extend(self.positions[position]);
            if corner.texcoord != NONE {
                mesh.texcoords.extend(self.texcoords[corner.texcoord as usize]);
            }
            if corner.normal != NONE {
                mesh.normals.extend(self.normals[corner.normal as usize]);
            }
            if !self.colors.is_empty() {
                mesh.vertex_color.extend(self.colors.get(position)?);
            }
        }
        self.unlisted.clear();
        mesh.indices = std::mem::take(&mut self.indices);
        mesh.indices.shrink_to_fit();
        self.models.push(ObjModel { mesh, name: name.to_owned() });
        Some(())
    }
}

/// The lines of a file.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut start = 0;
    memchr::memchr_iter(b'\n', bytes).chain([bytes.len()]).map(move |end| {
        let line = &bytes[start..end];
        start = end + 1;
        line
    })
}

/// The words of a line; what follows the last one that was read.
pub(super) struct Words<'a>(pub &'a [u8]);

impl Words<'_> {
    /// Whether no word is left.
    fn is_empty(&self) -> bool {
        self.0.trim_ascii_start().is_empty()
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.0.trim_ascii_start();
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(end);
        self.0 = rest;
        (!word.is_empty()).then_some(word)
    }
}

/// The next numbers of a line.
fn numbers<const N: usize>(words: &mut Words<'_>) -> Option<[f32; N]> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = std::str::from_utf8(words.next()?).ok()?.parse().ok()?;
    }
    Some(numbers)
}

/// An index among so many elements, counted from 0: written from 1 on, or from the last one
/// backwards from -1 on.
fn index(digits: &[u8], count: usize) -> Option<u32> {
    /// More digits than a `u32` has are read by `tobj`.
    const MOST: usize = 9;
    let (is_negative, digits) = match digits {
        [b'-', digits @ ..] => (true, digits),
        digits => (false, digits),
    };
    if digits.is_empty() || digits.len() > MOST {
        return None;
    }
    let mut number = 0;
    for digit in digits {
        let value = digit.wrapping_sub(b'0');
        if value > 9 {
            return None;
        }
        number = 10 * number + usize::from(value);
    }
    if number == 0 || number > count {
        return None;
    }
    Some((if is_negative { count - number } else { number - 1 }) as u32)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::math::random::Random;
    use crate::scene::mesh::obj::read_with_tobj;

    /// The groups as `tobj` reads them: the judge.
    fn judged(text: &str, materials: &[String]) -> Vec<ObjModel> {
        let models = read_with_tobj(Path::new("m.obj"), text.as_bytes(), materials);
        let mut models = models.expect(text);
        models.retain(|model| !model.mesh.indices.is_empty());
        models
    }

    fn check(text: &str, materials: &[&str]) {
        let materials: Vec<String> = materials.iter().map(|name| (*name).to_string()).collect();
        let found = read(text.as_bytes(), &materials).expect(text);
        assert_eq!(format!("{found:?}"), format!("{:?}", judged(text, &materials)), "{text}");
    }

    #[test]
    fn groups_are_those_of_tobj() {
        let points = "v 0 0 0\nv 1 0 0\nv 1 1 0\r\nv 0 1 0.5\n";
        for (rest, materials) in [
            ("f 1 2 3\n", &[][..]),
            ("f 1 2 3 4\nf -4 -3 -1\n", &[]),
            // The corner 1 with and without its texture coordinate, and one that is not used.
            ("vt 0.5 0.25 9\nvt 1e-3 -0.25\nf 1/1 2/2 3/1\nf 1 2/2 3/1/\nf 4 1 2\n", &[]),
            ("vn 0 0 1\nvn 0 1 0 x\nf 1//1 2//1 3//2\nf 1//2 3//2 4//-1\n", &[]),
            ("o  two words \ng\nf 1 2 3\ng other\nf 1 2 3\no unused\n", &[]),
            // A group ends where its material changes, and not where it stays.
            (
                "usemtl a\nf 1 2 3\nusemtl a\nf 1 3 4\nusemtl b c\nf 2 3 4\nusemtl none\nf 4 3 2\n",
                &["a", "b c"],
            ),
            ("# remark\n#\n\n \ts off\nmtllib x.mtl\nf 1\t2  3 \n f 2 3 4\n o name\nf 1 2 3\n", &[]),
        ] {
            check(&format!("{points}{rest}"), materials);
        }
        check("v 0 0 0 1 0.5 0\nv 1 0 0 0 1 1\nv 1 1 0 0 0 0.25\nf 3 2 1\n", &[]);
        check(points, &[]);
    }

    #[test]
    fn corners_are_numbered_like_those_of_tobj() {
        let mut random = Random::new(11);
        for size in [3, 40] {
            let mut text = String::new();
            for at in 0..size {
                text += &format!("v {at} 0 {}\nvt {} 0\nvn 0 {at} 1\n", random.unit(), random.unit());
            }
            // So many faces over few positions that lists are longer than MAX_LIST.
            for at in 0..2000 {
                if at % 700 == 699 {
                    text += "g next\n";
                }
                let mut one = || 1 + random.below(size);
                let corners: Vec<String> = (0..3 + at % 4)
                    .map(|_| match at % 3 {
                        0 => format!("{}/{}/{}", one(), one(), one()),
                        1 => format!("{}//{}", one(), one()),
                        _ => format!("{}", one()),
                    })
                    .collect();
                text += &format!("f {}\n", corners.join(" "));
            }
            check(&text, &[]);
        }
    }

    #[test]
    fn other_files_are_left_to_tobj() {
        let points = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
        for rest in [
            "f 1 2\n",
            "f 1\n",
            "f\n",
            "l 1 2\n",
            "f 1 2 4\n",
            "f 0 1 2\n",
            "f -4 1 2\n",
            "f 1/1 2 3\n",
            "f 1 2 3/1/1/1\n",
            "f /1 2 3\n",
            "f 1 2 x\n",
            "f 1 2 1234567890\n",
            "v 0 0 0 2\n",
            "v 0 0\n",
            "v 0 0 0 1 1\n",
            "v 0 0 0 1 1 x\n",
            "vt 0\n",
            "vn 0 0 x\n",
            "usemtl\n",
            "usemtl \n",
            "\u{A0}f 1 2 3\n",
            "\x0Bf 1 2 3\n",
            "f 1 2\u{A0}3\n",
            "v 0 0 0 1 1 1\nf 1 2 3\n",
        ] {
            assert!(read(format!("{points}{rest}").as_bytes(), &[]).is_none(), "{rest}");
        }
        assert!(read(b"v 0 0 \xFF\n", &[]).is_none());
    }
}
