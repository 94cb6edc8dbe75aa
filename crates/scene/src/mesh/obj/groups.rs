//! Reads the groups of a Wavefront OBJ file with triangles and polygons.
//!
//! These are the groups that `tobj` makes, which keeps 104 bytes of every face until its group ends
//! and then finds the vertices that corners share in a hash map. Here a thread numbers the corners
//! of a part while others read the next parts: each position has a list of the vertices that were
//! made of it. A file that has anything else (points, lines, weights of positions, vertices behind
//! their faces, mistakes) is left to `tobj`, which also explains what is wrong with it.

use std::collections::HashMap;

use crate::mesh::obj::{ObjMesh, ObjModel};
use anyhit_base::input::threads;

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

/// Values of lines, in their order.
#[derive(Default)]
struct Values {
    positions: Vec<[f32; 3]>,
    colors: Vec<[f32; 3]>,
    texcoords: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
}

/// What the lines of a part of a file say.
#[derive(Default)]
struct Lines<'b> {
    /// The numbers of positions, texture coordinates and normals before this part.
    before: [usize; 3],
    values: Values,
    /// The corners of all faces.
    corners: Vec<Corner>,
    /// How many corners each face has.
    faces: Vec<u32>,
    changes: Vec<Change<'b>>,
}

/// A line after which other faces belong to another group.
struct Change<'b> {
    /// How many faces and colours of the part are before it.
    faces: usize,
    colors: usize,
    to: ChangeTo<'b>,
}

enum ChangeTo<'b> {
    /// A group of this name.
    Name(&'b str),
    /// A material, by its place among all.
    Material(Option<usize>),
}

/// What is read so far.
#[derive(Default)]
struct Reader {
    values: Values,
    /// For each position the first vertex of the group that was made of it.
    first_vertices: Vec<u32>,
    /// The vertices that are in no list, as theirs are long.
    unlisted: HashMap<[u32; 3], u32>,
    vertices: Vec<Vertex>,
    indices: Vec<u32>,
    models: Vec<ObjModel>,
}

/// The groups of a file, each with its material's place among `materials`; `None` where `tobj` must
/// read it. The file is given in parts of whole lines, each with the numbers of positions, texture
/// coordinates and normals in it.
pub(super) fn read(parts: &[(&[u8], [usize; 3])], materials: &[String]) -> Option<Vec<ObjModel>> {
    let places: HashMap<&str, usize> = materials.iter().map(String::as_str).zip(0..).collect();
    let before: Vec<[usize; 3]> = parts
        .iter()
        .scan([0; 3], |sum, (_, counts)| {
            let before = *sum;
            sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
            Some(before)
        })
        .collect();
    let mut reader = Reader::default();
    let (mut name, mut material) = ("unnamed_object", None);
    let mut is_read = true;
    threads::in_order(parts.len(), &|at| Lines::of(parts[at].0, before[at], &places), &mut |lines| {
        is_read = lines.and_then(|lines| reader.add(lines, &mut name, &mut material)).is_some();
        is_read
    });
    if !is_read {
        return None;
    }
    reader.finish_group(name, material, reader.values.colors.len())?;
    Some(reader.models)
}

impl<'b> Lines<'b> {
    /// Reads lines; `None` where `tobj` must read the file.
    fn of(bytes: &'b [u8], before: [usize; 3], places: &HashMap<&str, usize>) -> Option<Self> {
        let text = std::str::from_utf8(bytes).ok()?;
        let mut own = Self { before, ..Self::default() };
        // Lines of one line feed after the other: a carriage return before it is white space.
        for line in lines(text.as_bytes()) {
            let mut words = Words(line);
            // Words that other characters than those of ASCII divide are read by `tobj`.
            match words.next().unwrap_or_default() {
                b"v" => own.position(words)?,
                b"vt" => own.values.texcoords.push(numbers(&mut words)?),
                b"vn" => own.values.normals.push(numbers(&mut words)?),
                b"f" => own.face(words)?,
                b"l" => return None,
                b"o" | b"g" => {
                    // Behind the first character, even if that is white space.
                    let name = std::str::from_utf8(line).ok()?.get(1..)?.trim();
                    own.change(ChangeTo::Name(if name.is_empty() { "unnamed_object" } else { name }));
                }
                b"usemtl" => {
                    let wanted = std::str::from_utf8(line).ok()?.split_once(' ')?.1.trim();
                    if wanted.is_empty() {
                        return None;
                    }
                    own.change(ChangeTo::Material(places.get(wanted).copied()));
                }
                [b'#', ..] => {}
                first if first.is_ascii() && !first.contains(&b'\x0B') => {}
                _ => return None,
            }
        }
        Some(own)
    }

    fn change(&mut self, to: ChangeTo<'b>) {
        self.changes.push(Change { faces: self.faces.len(), colors: self.values.colors.len(), to });
    }

    /// Reads a position, and its colour if it has one.
    fn position(&mut self, mut words: Words<'_>) -> Option<()> {
        self.values.positions.push(numbers(&mut words)?);
        if !words.is_empty() {
            self.values.colors.push(numbers(&mut words)?);
            return words.is_empty().then_some(());
        }
        Some(())
    }

    /// Reads a polygon, which has three corners at least: a line has two.
    fn face(&mut self, words: Words<'_>) -> Option<()> {
        let first = self.corners.len();
        for word in words {
            let corner = self.corner(word)?;
            self.corners.push(corner);
        }
        let count = self.corners.len() - first;
        self.faces.push(u32::try_from(count).ok().filter(|count| *count > 2)?);
        Some(())
    }

    /// A corner, `position[/texcoord[/normal]]`.
    fn corner(&self, word: &[u8]) -> Option<Corner> {
        let Values { positions, texcoords, normals, .. } = &self.values;
        let [position, texcoord, normal] = self.before;
        let mut parts = word.split(|byte| *byte == b'/');
        let position = index(parts.next()?, position + positions.len())?;
        let mut optional = |count: usize| match parts.next() {
            None | Some([]) => Some(NONE),
            Some(digits) => index(digits, count),
        };
        let texcoord = optional(texcoord + texcoords.len())?;
        let normal = optional(normal + normals.len())?;
        parts.next().is_none().then_some(Corner { position, texcoord, normal })
    }
}

impl Reader {
    /// Adds the next lines of a file, in which the group and the material may change.
    fn add<'b>(&mut self, lines: Lines<'b>, name: &mut &'b str, material: &mut Option<usize>) -> Option<()> {
        let Lines { values, corners, faces, changes, .. } = lines;
        let colors_before = self.values.colors.len();
        self.values.positions.extend(values.positions);
        self.values.colors.extend(values.colors);
        self.values.texcoords.extend(values.texcoords);
        self.values.normals.extend(values.normals);
        self.first_vertices.resize(self.values.positions.len(), NONE);
        let (mut done, mut rest) = (0, &corners[..]);
        for change in &changes {
            self.add_faces(&faces[done..change.faces], &mut rest)?;
            done = change.faces;
            let colors = colors_before + change.colors;
            match change.to {
                ChangeTo::Name(to) => {
                    self.finish_group(name, *material, colors)?;
                    *name = to;
                }
                ChangeTo::Material(to) => {
                    if to != *material {
                        self.finish_group(name, *material, colors)?;
                    }
                    *material = to;
                }
            }
        }
        self.add_faces(&faces[done..], &mut rest)
    }

    /// Adds polygons, each as a fan around its first corner.
    fn add_faces(&mut self, faces: &[u32], corners: &mut &[Corner]) -> Option<()> {
        for &count in faces {
            let (face, rest) = corners.split_at_checked(count as usize)?;
            *corners = rest;
            let [first, second, others @ ..] = face else { return None };
            let (first, mut last) = (self.number(*first)?, self.number(*second)?);
            for corner in others {
                let this = self.number(*corner)?;
                self.indices.extend([first, last, this]);
                last = this;
            }
        }
        Some(())
    }

    /// The number of a vertex within the group; a new one gets the next.
    fn number(&mut self, corner: Corner) -> Option<u32> {
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

    /// Makes a model of the triangles since the last group, if there are any. So many colours are
    /// known by now.
    fn finish_group(&mut self, name: &str, material: Option<usize>, colors: usize) -> Option<()> {
        let Values { positions, texcoords, normals, colors: all_colors } = &self.values;
        if self.indices.is_empty() {
            return Some(());
        }
        let mut mesh = ObjMesh { material_id: material, ..ObjMesh::default() };
        mesh.positions.reserve_exact(3 * self.vertices.len());
        for Vertex { corner, .. } in self.vertices.drain(..) {
            let position = corner.position as usize;
            self.first_vertices[position] = NONE;
            mesh.positions.extend(positions[position]);
            if corner.texcoord != NONE {
                mesh.texcoords.extend(texcoords[corner.texcoord as usize]);
            }
            if corner.normal != NONE {
                mesh.normals.extend(normals[corner.normal as usize]);
            }
            if colors > 0 {
                mesh.vertex_color.extend(all_colors[..colors].get(position)?);
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
    use crate::mesh::obj::{Contents, parts, read_with_tobj};
    use anyhit_engine::math::random::Random;

    /// The groups as `tobj` reads them: the judge.
    fn judged(text: &str, materials: &[String]) -> Vec<ObjModel> {
        let models = read_with_tobj(Path::new("m.obj"), text.as_bytes(), materials);
        let mut models = models.expect(text);
        models.retain(|model| !model.mesh.indices.is_empty());
        models
    }

    fn read_in_parts(bytes: &[u8], part: usize, materials: &[String]) -> Option<Vec<ObjModel>> {
        let parts: Vec<_> =
            parts(bytes, part).into_iter().map(|part| (part, Contents::of(part).counts())).collect();
        read(&parts, materials)
    }

    fn check(text: &str, materials: &[&str]) {
        let materials: Vec<String> = materials.iter().map(|name| (*name).to_string()).collect();
        let wanted = format!("{:?}", judged(text, &materials));
        // As a whole, and line by line.
        for (part, threads) in [(usize::MAX, 1), (1, 1), (1, 3), (100, 2)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| read_in_parts(text.as_bytes(), part, &materials)).expect(text);
            assert_eq!(format!("{found:?}"), wanted, "{text}");
        }
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
            let text = format!("{points}{rest}");
            for part in [1, usize::MAX] {
                assert!(read_in_parts(text.as_bytes(), part, &[]).is_none(), "{rest}");
            }
        }
        assert!(read_in_parts(b"v 0 0 \xFF\n", 1, &[]).is_none());
    }
}
