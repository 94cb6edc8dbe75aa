//! Wavefront OBJ with the .mtl files that it names. Polygons become triangles; points, lines and
//! free-form geometry are left out.

mod groups;
mod library;
mod lines;
mod notes;
mod polygon;
mod text;

use std::collections::{HashMap, HashSet};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use crate::files::{Files, sibling};
use crate::mesh::Mesh;
use crate::mesh::invalid;
use crate::mesh::listed::{Listed, ListedPart, ModelNode, Numbers};
use crate::mesh::material::{Material, PictureSource, Texture, TextureSlot};
use crate::mesh::obj::groups::{BrokenFile, Group};
use crate::mesh::obj::library::{GivenMaterial, Map};
use crate::mesh::obj::lines::{FileContext, PartPlace};
use crate::mesh::obj::notes::Notes;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, threads};
use anyhit_engine::machine::sampler::{AddressMode, Sampler};

/// An open file: its groups, in the order of the model's parts.
#[derive(Debug)]
pub struct ObjFile {
    groups: Vec<Group>,
}

impl ObjFile {
    /// Opens a file and lists what is in it.
    ///
    /// # Errors
    /// `InvalidMesh` where no triangle is left, a polygon is too complex, or the file is beyond a
    /// limit.
    pub(super) fn open(path: &Path, bytes: &[u8], files: &dyn Files) -> Result<(Listed, Self)> {
        decode(path, bytes, files).map_err(|error| error.or_at(Place::File(path.to_path_buf())))
    }

    /// The triangles of a group.
    pub(super) fn triangles(&self, group: usize) -> Mesh {
        let Group { positions, indices, .. } = &self.groups[group];
        Mesh { vertices: positions.clone(), indices: indices.clone() }
    }

    /// The numbers of an attribute of a group.
    pub(super) fn attribute(&self, group: usize, name: &str) -> Numbers {
        let (values, components) = numbers(&self.groups[group], name);
        Numbers { components, values: values.to_vec() }
    }
}

fn numbers<'g>(group: &'g Group, name: &str) -> (&'g [f32], usize) {
    match name {
        "normal" => (group.normals.as_flattened(), 3),
        "texcoord_0" => (group.texcoords.as_flattened(), 2),
        "color_0" => (group.colors.as_flattened(), 3),
        _ => (group.positions.as_flattened(), 3),
    }
}

const ATTRIBUTES: [&str; 4] = ["position", "normal", "texcoord_0", "color_0"];

/// The bytes of a part, about, that a thread reads at once.
const PART: usize = 1 << 18;

fn decode(path: &Path, bytes: &[u8], files: &dyn Files) -> Result<(Listed, ObjFile)> {
    let text = text::decoded(bytes);
    let (parts, contents) = contents_of_parts(text::parts(&text, PART));
    contents.check(&files.limits())?;
    // Groups are those of the names that the file uses; what an .mtl file says of them comes later,
    // and a missing one does not stop the mesh.
    let names = contents.used.iter().map(|(name, _)| name.as_str());
    let context = FileContext { totals: contents.counts(), materials: names.zip(0..).collect() };
    let read = groups::read(&parts, &context).map_err(|broken| error_of(path, &text, broken));
    let (all, notes) = read?;
    let mut library = MaterialReader { path, files, notes, of_libraries: Vec::new() };
    let (materials, textures) = library.read(&contents)?;
    let MaterialReader { notes, of_libraries, .. } = library;
    let mut unread = notes.list(None);
    unread.extend(of_libraries);
    let mut objects: Vec<(String, Vec<Group>)> = Vec::new();
    let mut places: HashMap<String, usize> = HashMap::new();
    for group in all {
        let at = *places.entry(group.name.clone()).or_insert_with(|| {
            objects.push((group.name.clone(), Vec::new()));
            objects.len() - 1
        });
        objects[at].1.push(group);
    }
    if objects.is_empty() {
        let error = invalid("the file has no triangles");
        return Err(match &unread[..] {
            [] => error,
            unread => error.note(format!("not read: {}", unread.join("; "))),
        });
    }
    let mut groups = Vec::new();
    let mut meshes = Vec::new();
    for (name, of_object) in objects {
        meshes.push((Some(name), of_object.iter().map(listed).collect()));
        groups.extend(of_object);
    }
    let node = |mesh| ModelNode { name: None, mesh, world: glam::DMat4::IDENTITY };
    let nodes = (0..meshes.len()).map(node).collect();
    let listed = Listed { meshes, nodes, materials, textures, cameras: Vec::new(), unread };
    Ok((listed, ObjFile { groups }))
}

fn listed(group: &Group) -> ListedPart {
    let is_there = |name: &&str| !numbers(group, name).0.is_empty();
    let attributes = ATTRIBUTES.iter().filter(|name| is_there(name)).map(|name| (*name).to_string());
    ListedPart {
        material: group.material,
        vertices: group.positions.len(),
        triangles: group.indices.len() / 3,
        attributes: attributes.collect(),
    }
}

/// The error of a broken file, with the line where it is known.
fn error_of(path: &Path, text: &[u8], broken: BrokenFile) -> Error {
    match broken {
        BrokenFile::TooManyVertices => invalid("a group has more vertices than 32-bit indices can address"),
        BrokenFile::Polygon(number) => {
            let mut left = number;
            let line = text::statements(text, 1, |line, text| {
                let mut words = text::Words(text);
                let is_polygon = words.next() == Some(b"f") && words.count() > 2;
                match (is_polygon, left) {
                    (true, 0) => return ControlFlow::Break(line),
                    (true, _) => left -= 1,
                    (false, _) => {}
                }
                ControlFlow::Continue(())
            });
            let line = line.break_value().unwrap_or(1);
            invalid("the polygon is too complex to become triangles")
                .at(place(path, text, line))
                .note("to read the file, cut the polygon into smaller ones")
        }
    }
}

/// The place of a line.
fn place(path: &Path, text: &[u8], line: usize) -> Place {
    let text = text::text_of(text);
    let mut start = 0;
    let mut lines = text.split_inclusive('\n').map(|line| {
        let span = start..start + line.trim_end().len();
        start += line.len();
        span
    });
    let span = lines.nth(line - 1).unwrap_or_default();
    Place::Text { file: escape::path(&path).to_string(), text: (*text).into(), span }
}

/// What a file makes, counted before it is allocated, and the names that it uses.
#[derive(Default)]
struct Contents {
    /// Its line feeds.
    lines: usize,
    vertices: u64,
    texcoords: usize,
    normals: usize,
    /// The triangles of its polygons.
    triangles: u64,
    /// Its objects and groups, of each of which half a kilobyte is kept.
    objects: u64,
    /// Its materials with the lines of their first use.
    used: Vec<(String, usize)>,
    /// Its .mtl files with their lines.
    libraries: Vec<(String, usize)>,
}

impl Contents {
    fn of(bytes: &[u8]) -> Self {
        let mut found = Self::default();
        let _: ControlFlow<()> = text::statements(bytes, 1, |line, text| {
            let mut words = text::Words(text);
            // The last one is what follows the last line feed.
            found.lines = line - 1;
            match words.next().unwrap_or_default() {
                b"v" => found.vertices += 1,
                b"vt" => found.texcoords += 1,
                b"vn" => found.normals += 1,
                b"f" => found.triangles += (words.count() as u64).saturating_sub(2),
                b"o" | b"g" => found.objects += 1,
                b"usemtl" => {
                    found.objects += 1;
                    let name = words.name();
                    if !name.is_empty() && found.used.last().is_none_or(|(last, _)| *last != name) {
                        found.used.push((name.into_owned(), line));
                    }
                }
                b"mtllib" => {
                    let names = library::names(words);
                    found.objects += names.len() as u64;
                    found.libraries.extend(names.into_iter().map(|name| (name, line)));
                }
                _ => {}
            }
            ControlFlow::Continue(())
        });
        found
    }

    /// The numbers of positions, texture coordinates and normals.
    fn counts(&self) -> [usize; 3] {
        [self.vertices as usize, self.texcoords, self.normals]
    }

    fn check(&self, limits: &InputLimits) -> Result<()> {
        let check = |limit, count| limits.check(limit, count, ErrorKind::InvalidMesh);
        check(InputLimit::MeshVertices, self.vertices)?;
        check(InputLimit::MeshTriangles, self.triangles)?;
        check(InputLimit::MeshValues, self.objects)
    }
}

/// The parts of a file with their places, and the contents of all, in which each name is once.
fn contents_of_parts(parts: Vec<&[u8]>) -> (Vec<(&[u8], PartPlace)>, Contents) {
    let of_parts = threads::map(parts.len(), &|at| Contents::of(parts[at]));
    let mut all = Contents::default();
    let mut known = [HashSet::new(), HashSet::new()];
    let mut placed = Vec::with_capacity(parts.len());
    for (bytes, part) in parts.into_iter().zip(of_parts) {
        placed.push((bytes, PartPlace { line: all.lines + 1, before: all.counts() }));
        all.vertices += part.vertices;
        all.texcoords += part.texcoords;
        all.normals += part.normals;
        all.triangles += part.triangles;
        all.objects += part.objects;
        let lists = [(&mut all.used, part.used), (&mut all.libraries, part.libraries)];
        for ((names, own), known) in lists.into_iter().zip(&mut known) {
            let new = own.into_iter().filter(|(name, _)| known.insert(name.clone()));
            names.extend(new.map(|(name, line)| (name, all.lines + line)));
        }
        all.lines += part.lines;
    }
    (placed, all)
}

/// Reads the .mtl files of a file.
struct MaterialReader<'f> {
    path: &'f Path,
    files: &'f dyn Files,
    /// Notes on the file itself.
    notes: Notes,
    /// Notes on its .mtl files.
    of_libraries: Vec<String>,
}

impl MaterialReader<'_> {
    /// The materials that the file uses; one that no .mtl file has is the default.
    fn read(&mut self, contents: &Contents) -> Result<(Vec<Material>, Vec<Texture>)> {
        let mut found: HashMap<String, (PathBuf, GivenMaterial)> = HashMap::new();
        for (name, line) in &contents.libraries {
            let library = sibling(self.path, name);
            let bytes = match self.files.read(&library) {
                Ok(bytes) => bytes,
                Err(error) if error.kind() == ErrorKind::Io => {
                    self.notes.add(
                        *line,
                        format!(
                            "the material library `{}`, which cannot be opened",
                            text::shown(name.as_bytes())
                        ),
                    );
                    continue;
                }
                Err(error) => return Err(error.at(Place::File(self.path.to_path_buf()))),
            };
            let (materials, notes) = library::read(&bytes);
            self.of_libraries.extend(notes.list(Some(&library)));
            // The last one of a name in a library, of the first library that has one.
            let own: HashMap<_, _> =
                materials.into_iter().map(|given| (given.material.name.clone(), given)).collect();
            for (name, given) in own {
                found.entry(name).or_insert_with(|| (library.clone(), given));
            }
        }
        let mut textures = Textures::default();
        let mut all = Vec::new();
        for (name, line) in &contents.used {
            let Some((library, given)) = found.get(name) else {
                if !contents.libraries.is_empty() {
                    self.notes.add(*line, "a material that no library defines");
                }
                all.push(library::default_material(name));
                continue;
            };
            let mut material = given.material.clone();
            for slot in SLOTS {
                if let Some(map) = &given.maps[slot as usize] {
                    material.textures[slot as usize] = Some(textures.place(library, map));
                    material.mappings[slot as usize] = map.mapping;
                }
            }
            all.push(material);
        }
        Ok((all, textures.all))
    }
}

/// The slots in the order of a material's textures.
const SLOTS: [TextureSlot; 5] = [
    TextureSlot::BaseColor,
    TextureSlot::Normal,
    TextureSlot::Specular,
    TextureSlot::Alpha,
    TextureSlot::Emissive,
];

/// The textures of a file: those of one picture that are sampled alike are one.
#[derive(Default)]
struct Textures {
    all: Vec<Texture>,
    places: HashMap<(PathBuf, bool), usize>,
}

impl Textures {
    fn place(&mut self, library: &Path, map: &Map) -> usize {
        let picture = sibling(library, &map.file);
        *self.places.entry((picture, map.is_clamped)).or_insert_with_key(|(picture, is_clamped)| {
            let mut sampler = Sampler::default();
            if *is_clamped {
                sampler.address_mode = [AddressMode::ClampToEdge; 3];
            }
            self.all.push(Texture { picture: PictureSource::File(picture.clone()), sampler });
            self.all.len() - 1
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::files::{EmbeddedFiles, LimitedFiles};
    use crate::mesh::model::{MeshFormat, Model};

    fn open(text: &str, files: &[(&str, &[u8])], limits: InputLimits) -> Result<Model> {
        let files = LimitedFiles(EmbeddedFiles(files), limits);
        Model::open(MeshFormat::Obj, Path::new("a/m.obj"), text.as_bytes().to_vec(), &files)
    }

    fn load(text: &str, object: Option<&str>) -> Result<Mesh> {
        let limits = InputLimits::default();
        let model = open(text, &[], limits)?;
        let parts = match object {
            None => model.placed(&limits)?,
            Some(name) => {
                let parts = model.parts_named(name, "object")?;
                parts.into_iter().map(|part| (part, glam::DMat4::IDENTITY)).collect()
            }
        };
        model.merged(&parts, &limits)
    }

    const QUAD: &str = "o quad\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nf 1 2 3 4\n";

    #[test]
    fn a_quad_becomes_a_fan() {
        let mesh = load(QUAD, None).unwrap();
        assert_eq!(mesh.vertices, [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.5]]);
        assert_eq!(mesh.indices, [0, 1, 2, 0, 2, 3]);
    }

    #[test]
    fn objects_are_joined_or_chosen_by_name() {
        let text = format!("{QUAD}o other\nv 5 5 5\nf -1 1 2\n");
        let all = load(&text, None).unwrap();
        let corner = |i: usize| all.vertices[all.indices[i] as usize];
        assert_eq!(all.indices.len(), 9);
        assert_eq!([corner(6), corner(7), corner(8)], [[5., 5., 5.], [0., 0., 0.], [1., 0., 0.]]);
        let other = load(&text, Some("other")).unwrap();
        assert_eq!(other.vertices[other.indices[0] as usize], [5., 5., 5.]);
        let error = load(&text, Some("third")).unwrap_err();
        assert!(error.render().contains("objects in the file: quad, other"), "{error:?}");
    }

    #[test]
    fn a_broken_line_leaves_out_the_faces_that_use_it() {
        let points = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
        let cause = "`x` is not a number";
        for (lines, unread) in [
            ("v 9 x 9\nf 1 2 5\n", &["a position (`v`) and the faces that use it: `x` is not a number"][..]),
            (
                "vt x\nf 1/2 2/1 3/1\n",
                &["a texture coordinate (`vt`) and the faces that use it: `x` is not a number"],
            ),
            ("vn 0 x 1\nf 1 2 3//-1\n", &["a normal (`vn`) and the faces that use it: `x` is not a number"]),
            ("f 1 2 x\n", &["a face (`f`): `x` is not an index"]),
            (
                "f 1 2 3 9 4\n",
                &[
                    "a face (`f`): no position has the index 9: there are 5 lines of `v` in the file, counted from 1",
                ],
            ),
        ] {
            // Behind it, the lines have the numbers that they had.
            let text = format!("{points}{lines}v 5 5 5\nvt 1 1\nvn 1 0 0\nf 1/-1/-1 2/-1/-1 -1/-1/-1\n");
            let model = open(&text, &[], InputLimits::default()).unwrap();
            let unread: Vec<String> = unread.iter().map(|note| format!("line 7: {note}")).collect();
            assert_eq!(model.unread, unread, "{text}");
            let mesh = model.triangles(0).unwrap();
            assert_eq!(mesh.vertices, [[0., 0., 0.], [1., 0., 0.], [5., 5., 5.]], "{text}");
            assert_eq!(mesh.indices, [0, 1, 2], "{text}");
            let normals = model.attribute(0, "normal").unwrap();
            assert_eq!(normals.values, [1., 0., 0.].repeat(3), "{text}");
        }
        // In parts, as large files are read, too.
        let mut text = String::from("v 0 0 0\nv 1 0 0\nv 1 1 x\n");
        for _ in 0..PART / 8 {
            text += "f 1 2 3\n";
        }
        text += "v 0 1 0\nf 1 2 4\n";
        let model = open(&text, &[], InputLimits::default()).unwrap();
        assert_eq!(model.triangles(0).unwrap().vertices, [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
        assert_eq!(model.unread, [format!("line 3: a position (`v`) and the faces that use it: {cause}")]);
        let error = load("v 0 0 0\nv 1 0\nv 1 1 1\nf 1 2 3\n", None).unwrap_err();
        assert_eq!((error.kind(), error.message()), (ErrorKind::InvalidMesh, "the file has no triangles"));
        let note =
            "not read: line 2: a position (`v`) and the faces that use it: 3 numbers expected, but 2 found";
        assert_eq!(error.notes(), [note]);
    }

    #[test]
    fn a_file_without_triangles_is_refused() {
        assert_eq!(load("v 0 0 0\n", None).unwrap_err().message(), "the file has no triangles");
        let files = EmbeddedFiles(&[]);
        assert!(Model::open(MeshFormat::Obj, Path::new("m.obj"), vec![0xff, 0xfe, 0], &files).is_err());
    }

    #[test]
    fn counts_are_compared_with_limits_before_anything_is_read() {
        // Four vertices, and two triangles of a polygon of four corners.
        for (limit, most) in
            [(InputLimit::MeshVertices, 4), (InputLimit::MeshTriangles, 2), (InputLimit::MeshValues, 1)]
        {
            let read = |most| open(QUAD, &[], InputLimits::default().with(limit, most));
            assert!(read(most).is_ok());
            let error = read(most - 1).unwrap_err();
            assert!(error.to_string().contains(&format!("`{}` of {}", limit.name(), most - 1)), "{error}");
            assert!(error.to_string().contains("m.obj"), "{error}");
        }
    }

    /// Two objects; the first has two materials, of which the .mtl file has one. The corners of the
    /// first triangle share positions with the second, but not its normals.
    const HOUSE: &str = "mtllib house.mtl\no house\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n\
        vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nvn 0 0 -1\n\
        usemtl brick\nf 1/1/1 2/2/1 3/3/1\nusemtl glass\nf 2/2/2 4/1/2 3/3/2\n\
        o roof\nusemtl brick\nf 1 2 4\n";

    const LIBRARY: &[u8] =
        b"newmtl brick\nKd 0.5 0.25 0.125\nd 0.75\nNi 1.25\nNs 8\nKs 0.1 0.2 0.3\nKe 1 2 3\n\
        illum 2\nmap_Kd pictures/brick.png\nmap_Bump -bm 0.2 bump.png\nnewmtl unused\nKd 1 0 0\n";

    #[test]
    fn groups_of_objects_and_materials_are_parts() {
        let model = open(HOUSE, &[("a/house.mtl", LIBRARY)], InputLimits::default()).unwrap();
        let names: Vec<&str> = model.parts.iter().map(|part| part.name.as_str()).collect();
        assert_eq!(names, ["house.0", "house.1", "roof"]);
        assert_eq!(model.contents(), "house (2 primitives), roof");
        let materials: Vec<usize> = model.parts.iter().map(|part| part.material).collect();
        assert_eq!(materials, [0, 1, 0]);
        assert_eq!(model.parts[0].attributes, ["position", "normal", "texcoord_0"]);
        assert_eq!(model.parts[2].attributes, ["position"]);
        let wanted = Material {
            name: "brick".into(),
            base_color: [0.5, 0.25, 0.125, 0.75],
            metallic: 0.0,
            ior: 1.25,
            shininess: 8.0,
            specular: [0.1, 0.2, 0.3],
            emissive: [1.0, 2.0, 3.0],
            illumination: 2,
            normal_scale: 0.2,
            textures: [Some(0), None, Some(1), None, None, None, None],
            ..Material::default()
        };
        assert_eq!(model.materials[0], wanted);
        // The .mtl file has no `glass`.
        let glass = Material { name: "glass".into(), metallic: 0.0, ..Material::default() };
        assert_eq!(model.materials[1..], [glass]);
        let files = ["a/pictures/brick.png", "a/bump.png"].map(|file| PictureSource::File(file.into()));
        assert!(model.textures.iter().map(|texture| &texture.picture).eq(&files));
        let texture = model.texture(0, TextureSlot::BaseColor).unwrap();
        assert_eq!(texture.picture, PictureSource::File("a/pictures/brick.png".into()));
        assert_eq!(model.texture(1, TextureSlot::BaseColor), None);
    }

    #[test]
    fn attributes_have_one_element_a_vertex() {
        let model = open(HOUSE, &[], InputLimits::default()).unwrap();
        let normals = model.attribute(1, "normal").unwrap();
        assert_eq!(normals, Numbers { components: 3, values: [0.0, 0.0, -1.0].repeat(3) });
        let coordinates = model.attribute(0, "texcoord_0").unwrap();
        assert_eq!(coordinates, Numbers { components: 2, values: vec![0., 0., 1., 0., 0., 1.] });
        let mesh = model.triangles(1).unwrap();
        assert_eq!(mesh.vertices, [[1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]);
        assert_eq!(mesh.indices, [0, 1, 2]);
    }

    #[test]
    fn a_broken_line_of_a_library_is_a_note() {
        let library: &[u8] = b"newmtl brick\nKd red\nKs .5\n";
        let model = open(HOUSE, &[("a/house.mtl", library)], InputLimits::default()).unwrap();
        assert_eq!(model.materials[0].specular, [0.5; 3]);
        let unread =
            ["line 14: a material that no library defines", "a/house.mtl:2: `Kd`: `red` is not a number"];
        assert_eq!(model.unread, unread);
        let model = open(HOUSE, &[], InputLimits::default()).unwrap();
        let unread = [
            "line 1: the material library `house.mtl`, which cannot be opened",
            "line 12: a material that no library defines (2 times)",
        ];
        assert_eq!(model.unread, unread);
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\n";

    /// As trimesh reads it: one triangle.
    #[test]
    fn lines_and_points_are_notes() {
        let limits = InputLimits::default();
        for rest in ["l 1 2 3 4\n", "p 1 2 4\n", "l 1 2\nl 3 4\np 1\np 1 2\n"] {
            let model = open(&format!("{TRIANGLE}{rest}"), &[], limits).unwrap();
            assert_eq!(model.triangles(0).unwrap().indices, [0, 1, 2], "{rest}");
            assert!(model.unread[0].starts_with("line 6: "), "{rest}");
        }
        let text = format!("{TRIANGLE}l 1 2\nl 3 4\np 1\nf 1 2\ncstype bezier\ns 1\n");
        let unread = [
            "line 6: a line (`l`) (2 times)",
            "line 8: a point (`p`)",
            "line 9: a face of fewer than three corners",
            "line 10: `cstype`",
        ];
        assert_eq!(open(&text, &[], limits).unwrap().unread, unread);
        // A file of lines alone says so.
        let error = load("v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3 1\n", None).unwrap_err();
        assert_eq!(error.message(), "the file has no triangles");
        assert_eq!(error.notes(), ["not read: line 4: a line (`l`)"]);
    }

    /// Files as other programs write them; assimp, trimesh or three.js reads each.
    #[test]
    fn files_as_they_occur_are_read() {
        for (text, count) in [
            ("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 \\\n3 4\n", 2),
            ("v 0 0 \\\n0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", 1),
            ("v 0 0 0 # a\nv 1 0 0\nv 1 1 0\nusemtl\nf 1 2 3#b\n", 1),
            ("v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0.5\nusemtl \nf 1/1 2/1 3/1\n", 1),
            ("v 0 0 0 .1 .2 .3\nv 1 0 0\nv 1 1 0 .7 .8 .9\nf 1 2 3\n", 1),
            ("\u{feff}v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", 1),
            ("f 1 2 3\rv 0 0 0\rv 1 0 0\rv 1 1 0\r", 1),
        ] {
            let mesh = load(text, None).unwrap();
            assert_eq!(mesh.indices.len(), 3 * count, "{text}");
            assert_eq!(mesh.vertices[..3], [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.]], "{text}");
        }
        let latin = b"# f\xfcr\no b\xfccher\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n".to_vec();
        let model = Model::open(MeshFormat::Obj, Path::new("m.obj"), latin, &EmbeddedFiles(&[])).unwrap();
        assert_eq!(model.meshes[0].name, "bücher");
    }

    #[test]
    fn libraries_are_found_and_searched_in_order() {
        let files: &[(&str, &[u8])] = &[
            (
                "a/a.mtl",
                "\u{feff}newmtl a\nKd 0 0 0\nnewmtl a\nKd 1 0 0\nmap_Kd t.png\nmap_Ks -clamp on t.png\n"
                    .as_bytes(),
            ),
            (
                "a/sub/b lib.mtl",
                b"newmtl a\nKd 0 1 0\nnewmtl b\nKd 0 0 1\nmap_Kd -s 2 2 t.png\nmap_d ..\\t.png\n",
            ),
        ];
        let text = format!("mtllib a.mtl sub\\b lib.mtl\n{TRIANGLE}usemtl b\nf 1 2 3\nusemtl a\nf 1 2 3\n");
        let model = open(&text, files, InputLimits::default()).unwrap();
        let colors: Vec<_> = model.materials.iter().map(|one| one.base_color).collect();
        // The last one of a library, of the first library.
        assert_eq!(colors[..2], [[0., 0., 1., 1.], [1., 0., 0., 1.]]);
        let texture = |material: usize, slot: TextureSlot| {
            let texture = &model.textures[model.materials[material].textures[slot as usize].unwrap()];
            (&texture.picture, texture.sampler.address_mode[0])
        };
        let file = |path: &str| PictureSource::File(path.into());
        let (repeat, clamp) = (AddressMode::Repeat, AddressMode::ClampToEdge);
        assert_eq!(texture(0, TextureSlot::BaseColor), (&file("a/sub/t.png"), repeat));
        assert_eq!(model.materials[0].mappings[0].transform, [[2., 0., 0.], [0., 2., 0.]]);
        assert_eq!(texture(0, TextureSlot::Alpha), (&file("a/sub/../t.png"), repeat));
        assert_eq!(texture(1, TextureSlot::BaseColor), (&file("a/t.png"), repeat));
        assert_eq!(texture(1, TextureSlot::Specular), (&file("a/t.png"), clamp));
    }
}
