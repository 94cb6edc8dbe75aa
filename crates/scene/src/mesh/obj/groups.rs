//! Makes the groups of a Wavefront OBJ file with shared vertices.
//!
//! A thread numbers the corners of a part while others read the next parts: each position has a
//! list of the vertices that were made of it.

use std::collections::{HashMap, HashSet, VecDeque};

use crate::mesh::obj::lines::{
    ChangeTo, Corner, Faces, FileContext, Lines, NONE, PartPlace, UNNAMED, Values,
};
use crate::mesh::obj::notes::Notes;
use crate::mesh::obj::{polygon, text};
use anyhit_base::input::threads;

/// A longer list of the vertices of one position continues in a hash map.
const MAX_LIST: usize = 8;

/// The colour of a vertex without one where others of its group have one.
const WHITE: [f32; 3] = [1.0; 3];

/// The triangles of an object with one material. Each attribute is that of all vertices, or empty.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Group {
    pub name: String,
    /// A place among the materials of the file.
    pub material: Option<usize>,
    pub positions: Vec<[f32; 3]>,
    pub texcoords: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
    pub colors: Vec<[f32; 3]>,
    /// Three for each triangle.
    pub indices: Vec<u32>,
}

/// Why a file has no groups.
#[derive(Debug)]
pub(super) enum BrokenFile {
    /// The polygon of this number, from 0, takes too long to cut into triangles.
    Polygon(usize),
    TooManyVertices,
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

/// The state between two parts.
struct Reader {
    values: Values,
    /// The indices of values that cannot be read.
    broken: [HashSet<u32>; 3],
    /// Faces whose vertices are in parts that follow.
    waiting: VecDeque<Faces>,
    name: String,
    material: Option<usize>,
    /// The line from which on faces belong to the group.
    line: usize,
    /// Number of polygons that are read.
    polygons: usize,
    /// For each position the first vertex of the group that was made of it.
    first_vertices: Vec<u32>,
    /// The vertices that are in no list, as theirs are long.
    unlisted: HashMap<[u32; 3], u32>,
    vertices: Vec<Vertex>,
    indices: Vec<u32>,
    groups: Vec<Group>,
    notes: Notes,
}

/// The groups of a file, which is given in parts of whole lines, and notes on it.
pub(super) fn read(
    parts: &[(&[u8], PartPlace)],
    context: &FileContext<'_>,
) -> Result<(Vec<Group>, Notes), BrokenFile> {
    let mut reader = Reader {
        values: Values::default(),
        broken: Default::default(),
        waiting: VecDeque::new(),
        name: UNNAMED.to_owned(),
        material: None,
        line: 1,
        polygons: 0,
        first_vertices: Vec::new(),
        unlisted: HashMap::new(),
        vertices: Vec::new(),
        indices: Vec::new(),
        groups: Vec::new(),
        notes: Notes::default(),
    };
    let mut result = Ok(());
    threads::in_order(parts.len(), &|at| Lines::of(parts[at].0, parts[at].1, context), &mut |lines| {
        result = reader.add(lines);
        result.is_ok()
    });
    result?;
    reader.finish_group();
    Ok((reader.groups, reader.notes))
}

impl Reader {
    /// Adds the next lines of a file.
    fn add(&mut self, lines: Lines<'_>) -> Result<(), BrokenFile> {
        self.values.append(lines.values);
        self.first_vertices.resize(self.values.positions.len(), NONE);
        self.notes.append(lines.notes);
        for (all, of_part) in self.broken.iter_mut().zip(lines.broken) {
            all.extend(of_part);
        }
        self.waiting.push_back(lines.faces);
        let known = self.values.counts();
        while let Some(faces) = self.waiting.front()
            && faces.needed.iter().zip(known).all(|(needed, known)| *needed <= known)
            && let Some(faces) = self.waiting.pop_front()
        {
            self.add_part(faces)?;
        }
        Ok(())
    }

    /// Adds faces between which the group and the material may change.
    fn add_part(&mut self, part: Faces) -> Result<(), BrokenFile> {
        let Faces { corners, counts, changes, .. } = part;
        let (mut done, mut rest) = (0, &corners[..]);
        for change in changes {
            self.add_faces(&counts[done..change.faces], &mut rest)?;
            done = change.faces;
            match change.to {
                ChangeTo::Name(to) => {
                    self.finish_group();
                    (self.name, self.line) = (to, change.line);
                }
                ChangeTo::Material(to) => {
                    if to != self.material {
                        self.finish_group();
                        self.line = change.line;
                    }
                    self.material = to;
                }
            }
        }
        self.add_faces(&counts[done..], &mut rest)
    }

    /// Adds polygons: each as a fan around its first corner, unless that does not cover it.
    fn add_faces(&mut self, counts: &[u32], corners: &mut &[Corner]) -> Result<(), BrokenFile> {
        for &count in counts {
            let (face, rest) = corners.split_at(count as usize);
            *corners = rest;
            self.polygons += 1;
            if !self.can_be_read(face) {
                continue;
            }
            let positions = &self.values.positions;
            let position = |at: usize| positions[face[at].position as usize];
            if count == 3 || polygon::is_fan(&position, face.len()) {
                let (first, mut last) = (self.number(face[0])?, self.number(face[1])?);
                for corner in &face[2..] {
                    let this = self.number(*corner)?;
                    self.indices.extend([first, last, this]);
                    last = this;
                }
            } else {
                let ears = polygon::ears(&position, face.len());
                let ears = ears.ok_or(BrokenFile::Polygon(self.polygons - 1))?;
                let numbers: Vec<u32> =
                    face.iter().map(|corner| self.number(*corner)).collect::<Result<_, _>>()?;
                self.indices.extend(ears.as_flattened().iter().map(|corner| numbers[*corner]));
            }
        }
        Ok(())
    }

    /// Returns true if the line of a face and those of its values can be read.
    fn can_be_read(&self, face: &[Corner]) -> bool {
        let is_whole = |corner: &Corner| {
            self.broken.iter().zip(corner.key()).all(|(broken, index)| !broken.contains(&index))
        };
        let all_are_whole = self.broken.iter().all(HashSet::is_empty);
        !face.is_empty() && (all_are_whole || face.iter().all(is_whole))
    }

    /// The number of a vertex within the group; a new one gets the next.
    fn number(&mut self, corner: Corner) -> Result<u32, BrokenFile> {
        let first = &mut self.first_vertices[corner.position as usize];
        let mut at = *first;
        let mut length = 0;
        while let Some(vertex) = self.vertices.get(at as usize) {
            if vertex.corner.texcoord == corner.texcoord && vertex.corner.normal == corner.normal {
                return Ok(at);
            }
            (at, length) = (vertex.next, length + 1);
        }
        let new = u32::try_from(self.vertices.len()).ok().filter(|new| *new != NONE);
        let new = new.ok_or(BrokenFile::TooManyVertices)?;
        let mut next = NONE;
        if length < MAX_LIST {
            next = std::mem::replace(first, new);
        } else if let Some(known) = self.unlisted.get(&corner.key()) {
            return Ok(*known);
        } else {
            self.unlisted.insert(corner.key(), new);
        }
        self.vertices.push(Vertex { corner, next });
        Ok(new)
    }

    /// Makes a group of the triangles since the last one, if there are any.
    fn finish_group(&mut self) {
        if self.indices.is_empty() {
            return;
        }
        let Values { positions, texcoords, normals, colors } = &self.values;
        let mut group = Group { name: self.name.clone(), material: self.material, ..Group::default() };
        let count = self.vertices.len();
        group.positions.reserve_exact(count);
        let mut colored = 0;
        for Vertex { corner, .. } in self.vertices.drain(..) {
            let position = corner.position as usize;
            self.first_vertices[position] = NONE;
            group.positions.push(positions[position]);
            if corner.texcoord != NONE {
                group.texcoords.push(texcoords[corner.texcoord as usize]);
            }
            if corner.normal != NONE {
                group.normals.push(normals[corner.normal as usize]);
            }
            if !colors.is_empty() {
                let color = colors.get(position).copied().flatten();
                colored += usize::from(color.is_some());
                group.colors.push(color.unwrap_or(WHITE));
            }
        }
        self.unlisted.clear();
        group.indices = std::mem::take(&mut self.indices);
        group.indices.shrink_to_fit();
        if colored == 0 {
            group.colors = Vec::new();
        } else if colored < count {
            self.notes.add(
                self.line,
                format!(
                    "colours of `{}`: some vertices have none and are white",
                    text::shown(group.name.as_bytes())
                ),
            );
        }
        let partial = |values: usize| 0 < values && values < count;
        if partial(group.texcoords.len()) {
            self.notes.add(self.line, partial_attribute(&group.name, "texture coordinate"));
            group.texcoords = Vec::new();
        }
        if partial(group.normals.len()) {
            self.notes.add(self.line, partial_attribute(&group.name, "normal"));
            group.normals = Vec::new();
        }
        self.groups.push(group);
    }
}

fn partial_attribute(group: &str, what: &str) -> String {
    format!("{what}s of `{}`: some corners have none", text::shown(group.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::obj::contents_of_parts;
    use anyhit_engine::math::random::Random;

    /// The groups as `tobj` reads them: the judge. Attributes that some vertices lack are left out.
    fn judged(text: &str, materials: &[&str]) -> Vec<Group> {
        let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
        let named = |name: &&str| tobj::Material { name: (*name).to_string(), ..Default::default() };
        let text = format!("mtllib names\n{text}");
        let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| {
            let places = materials.iter().map(|name| (*name).to_string()).zip(0..).collect();
            Ok((materials.iter().map(named).collect(), places))
        })
        .expect(&text);
        let group = |tobj::Model { mesh, name }| {
            let positions = mesh.positions.as_chunks().0.to_vec();
            let whole = |numbers: &[f32]| {
                let values = numbers.as_chunks::<3>().0.to_vec();
                if values.len() == positions.len() { values } else { Vec::new() }
            };
            let texcoords = mesh.texcoords.as_chunks().0.to_vec();
            Group {
                name,
                material: mesh.material_id,
                texcoords: if texcoords.len() == positions.len() { texcoords } else { Vec::new() },
                normals: whole(&mesh.normals),
                colors: whole(&mesh.vertex_color),
                positions,
                indices: mesh.indices,
            }
        };
        models.into_iter().map(group).filter(|group| !group.indices.is_empty()).collect()
    }

    fn read_in_parts(text: &str, part: usize, materials: &[&str]) -> (Vec<Group>, Notes) {
        let (parts, contents) = contents_of_parts(text::parts(text.as_bytes(), part));
        let context = FileContext {
            totals: contents.counts(),
            materials: materials.iter().copied().zip(0..).collect(),
        };
        read(&parts, &context).expect(text)
    }

    fn check(text: &str, materials: &[&str]) {
        let wanted = judged(text, materials);
        // As a whole, and line by line.
        for (part, threads) in [(usize::MAX, 1), (1, 1), (1, 3), (100, 2)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (found, _) = pool.install(|| read_in_parts(text, part, materials));
            assert_eq!(found, wanted, "{text}");
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
            ("# remark\n#\n\n \ts off\nmtllib x.mtl\nf 1\t2  3 \n f 2 3 4\no name\nf 1 2 3\n", &[]),
        ] {
            check(&format!("{points}{rest}"), materials);
        }
        check("v 0 0 0 1 0.5 0\nv 1 0 0 0 1 1\nv 1 1 0 0 0 0.25\nf 3 2 1\n", &[]);
        check(points, &[]);
        // Vertices behind their faces.
        check("f 1 3/1 4\nf 2 3/1 1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1 2\nv 1 1 0\nf 1 2 3\n", &[]);
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
                let corner = |position, texcoord, normal| match at % 3 {
                    0 => format!("{position}/{texcoord}/{normal}"),
                    1 => format!("{position}//{normal}"),
                    _ => format!("{position}"),
                };
                let corners: Vec<String> = (0..3).map(|_| corner(one(), one(), one())).collect();
                text += &format!("f {}\n", corners.join(" "));
            }
            check(&text, &[]);
        }
    }

    #[test]
    fn concave_polygons_keep_their_corners() {
        let text = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nvt 0 0\nf 1 2 3\nf 1/1 2 3 4 5\n";
        let (groups, _) = read_in_parts(text, usize::MAX, &[]);
        let Group { positions, indices, .. } = &groups[0];
        // The polygon's first corner is a new vertex: it has a texture coordinate.
        assert_eq!(positions.len(), 6);
        let triangles: Vec<[u32; 3]> = indices.as_chunks().0[1..].to_vec();
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
        };
        // As assimp cuts it: 4 * 4 less the notch of half of 4 * 3.
        assert_eq!(triangles.len(), 3);
        assert!(triangles.iter().all(|triangle| area(triangle) > 0.0), "{triangles:?}");
        assert_eq!(triangles.iter().map(area).sum::<f32>(), 10.0);
    }

    #[test]
    fn partial_attributes_are_noted() {
        let text = "v 0 0 0 .1 .2 .3\nv 1 0 0\nv 1 1 0 .7 .8 .9\nv 0 1 0\nvn 0 0 1\no a\nf 1//1 2//1 3\no b\nf 2 3 4\n\
                    o c\nf 2 4 2\n";
        for part in [1, usize::MAX] {
            let (groups, notes) = read_in_parts(text, part, &[]);
            assert_eq!(groups[0].colors, [[0.1, 0.2, 0.3], WHITE, [0.7, 0.8, 0.9]]);
            assert_eq!(groups[1].colors, [WHITE, [0.7, 0.8, 0.9], WHITE]);
            assert_eq!(groups[2].colors, [[0.0; 3]; 0]);
            assert!(groups.iter().all(|group| group.normals.is_empty()));
            let notes: Vec<String> = notes.list(None);
            let wanted = [
                "line 6: colours of `a`: some vertices have none and are white",
                "line 6: normals of `a`: some corners have none",
                "line 8: colours of `b`: some vertices have none and are white",
            ];
            assert_eq!(notes, wanted);
        }
    }
}
