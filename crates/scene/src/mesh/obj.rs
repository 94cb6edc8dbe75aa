//! Wavefront OBJ. Polygons are cut into fans around their first vertex; points and lines are left
//! out. Materials are those of the .mtl files that it names. `groups` reads common files, `tobj`
//! all others, broken files, and .mtl files.

mod groups;

use std::cell::Cell;
use std::collections::{HashMap, HashSet};
use std::io::Read;
use std::path::{Path, PathBuf};

use tobj::{LoadError, LoadOptions, Mesh as ObjMesh, Model as ObjModel};

use crate::files::Files;
use crate::mesh::Mesh;
use crate::mesh::listed::{Listed, ListedPart, ModelNode, Numbers};
use crate::mesh::material::{Material, PictureSource, Texture, TextureSlot};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, contained, threads};
use anyhit_engine::machine::sampler::Sampler;

/// An open file: its groups, in the order of the model's parts.
#[derive(Debug)]
pub struct ObjFile {
    groups: Vec<tobj::Mesh>,
}

impl ObjFile {
    /// Opens a file and lists what is in it.
    ///
    /// # Errors
    /// `InvalidMesh` that points at the line for a broken file; also where no triangle is left, or
    /// the file is beyond a limit.
    pub(super) fn open(path: &Path, bytes: &[u8], files: &dyn Files) -> Result<(Listed, Self)> {
        let open = contained("tobj", ErrorKind::InvalidMesh, || decode(path, bytes, files));
        open.map_err(|error| error.or_at(Place::File(path.to_path_buf())))
    }

    /// The triangles of a group.
    pub(super) fn triangles(&self, group: usize) -> Mesh {
        let mesh = &self.groups[group];
        let vertices = mesh.positions.as_chunks::<3>().0.to_vec();
        Mesh { vertices, indices: mesh.indices.clone() }
    }

    /// The numbers of an attribute of a group.
    pub(super) fn attribute(&self, group: usize, name: &str) -> Numbers {
        let (values, components) = numbers(&self.groups[group], name);
        Numbers { components, values: values.to_vec() }
    }
}

fn numbers<'m>(mesh: &'m tobj::Mesh, name: &str) -> (&'m [f32], usize) {
    match name {
        "normal" => (&mesh.normals, 3),
        "texcoord_0" => (&mesh.texcoords, 2),
        "color_0" => (&mesh.vertex_color, 3),
        _ => (&mesh.positions, 3),
    }
}

const ATTRIBUTES: [&str; 4] = ["position", "normal", "texcoord_0", "color_0"];

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidMesh, message)
}

/// The bytes of a part, about, that a thread reads at once.
const PART: usize = 1 << 18;

/// A text in parts of whole lines, each of so many bytes at least but for the last one.
fn parts(mut bytes: &[u8], least: usize) -> Vec<&[u8]> {
    let mut parts = Vec::new();
    while let Some(behind) = bytes.get(least.saturating_sub(1)..)
        && let Some(end) = memchr::memchr(b'\n', behind)
    {
        let (part, rest) = bytes.split_at(least.saturating_sub(1) + end + 1);
        parts.push(part);
        bytes = rest;
    }
    parts.push(bytes);
    parts
}

fn decode(path: &Path, bytes: &[u8], files: &dyn Files) -> Result<(Listed, ObjFile)> {
    let parts = parts(bytes, PART);
    let of_parts = threads::map(parts.len(), &|at| Contents::of(parts[at]));
    let parts: Vec<_> = parts.into_iter().zip(of_parts.iter().map(Contents::counts)).collect();
    let contents = Contents::joined(of_parts);
    contents.check(&files.limits())?;
    // Groups are those of the names that the file uses; what an .mtl file says of them comes later,
    // and a missing one does not stop the mesh.
    let Contents { used, libraries, .. } = contents;
    let models = match groups::read(&parts, &used) {
        Some(models) => models,
        None => read_with_tobj(path, bytes, &used)?,
    };
    let (materials, textures) = materials(path, &used, &libraries, files)?;
    let mut objects: Vec<(String, Vec<tobj::Mesh>)> = Vec::new();
    let mut places: HashMap<String, usize> = HashMap::new();
    for model in models.into_iter().filter(|model| !model.mesh.indices.is_empty()) {
        let at = *places.entry(model.name.clone()).or_insert_with(|| {
            objects.push((model.name, Vec::new()));
            objects.len() - 1
        });
        objects[at].1.push(model.mesh);
    }
    if objects.is_empty() {
        return Err(invalid("the file has no triangles"));
    }
    let mut groups = Vec::new();
    let mut meshes = Vec::new();
    for (name, of_object) in objects {
        meshes.push((Some(name), of_object.iter().map(listed).collect()));
        groups.extend(of_object);
    }
    let node = |mesh| ModelNode { name: None, mesh, world: glam::DMat4::IDENTITY };
    let nodes = (0..meshes.len()).map(node).collect();
    Ok((
        Listed { meshes, nodes, materials, textures, cameras: Vec::new(), unread: Vec::new() },
        ObjFile { groups },
    ))
}

/// The groups of a file whose materials have these names, as `tobj` reads it.
fn read_with_tobj(path: &Path, bytes: &[u8], used: &[String]) -> Result<Vec<tobj::Model>> {
    let options =
        LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    let first = Cell::new(true);
    let loader = |_: &Path| match first.replace(false) {
        true => Ok((
            used.iter().map(|name| tobj::Material { name: name.clone(), ..Default::default() }).collect(),
            used.iter().cloned().zip(0..).collect::<HashMap<_, _>>().into_iter().collect(),
        )),
        false => Err(LoadError::OpenFileFailed),
    };
    match tobj::load_obj_buf(&mut (&b"mtllib names\n"[..]).chain(bytes), &options, loader) {
        Ok((models, _)) => Ok(models),
        Err(error) => {
            let error = invalid(format!("not a Wavefront OBJ file: {error}"));
            Err(match first_invalid_line(path, bytes) {
                Some(place) => error.at(place),
                None => error,
            })
        }
    }
}

fn listed(mesh: &tobj::Mesh) -> ListedPart {
    let vertices = mesh.positions.len() / 3;
    // Where some vertices lack a normal, the list of normals is shorter.
    let is_whole = |name: &&str| {
        let (values, components) = numbers(mesh, name);
        values.len() == components * vertices
    };
    let attributes = ATTRIBUTES.iter().filter(|name| is_whole(name)).map(|name| (*name).to_string());
    ListedPart {
        material: mesh.material_id,
        vertices,
        triangles: mesh.indices.len() / 3,
        attributes: attributes.collect(),
    }
}

/// What a file makes, counted before it is allocated, and the names that it uses.
#[derive(Default)]
struct Contents {
    vertices: u64,
    texcoords: usize,
    normals: usize,
    /// The triangles of its polygons.
    triangles: u64,
    /// Its objects and groups, of each of which half a kilobyte is kept.
    objects: u64,
    /// Its materials, in the order of their first use.
    used: Vec<String>,
    /// Its .mtl files.
    libraries: Vec<String>,
}

impl Contents {
    fn of(bytes: &[u8]) -> Self {
        let mut found = Self::default();
        for line in groups::lines(bytes) {
            let mut words = groups::Words(line);
            let word = words.next().unwrap_or_default();
            match word {
                b"v" => found.vertices += 1,
                b"vt" => found.texcoords += 1,
                b"vn" => found.normals += 1,
                b"f" => found.triangles += (words.count() as u64).saturating_sub(2),
                b"o" | b"g" => found.objects += 1,
                b"usemtl" | b"mtllib" => {
                    found.objects += 1;
                    let Ok(name) = std::str::from_utf8(words.0.trim_ascii()) else { continue };
                    let names = if word == b"usemtl" { &mut found.used } else { &mut found.libraries };
                    if !name.is_empty() && names.last().is_none_or(|last| last != name) {
                        names.push(name.to_string());
                    }
                }
                _ => {}
            }
        }
        found
    }

    /// The numbers of positions, texture coordinates and normals.
    fn counts(&self) -> [usize; 3] {
        [self.vertices as usize, self.texcoords, self.normals]
    }

    /// The contents of all parts of a file, with each name once.
    fn joined(parts: Vec<Self>) -> Self {
        let mut all = Self::default();
        let mut known = [HashSet::new(), HashSet::new()];
        for part in parts {
            all.vertices += part.vertices;
            all.texcoords += part.texcoords;
            all.normals += part.normals;
            all.triangles += part.triangles;
            all.objects += part.objects;
            for ((names, own), known) in
                [(&mut all.used, part.used), (&mut all.libraries, part.libraries)].into_iter().zip(&mut known)
            {
                names.extend(own.into_iter().filter(|name| known.insert(name.clone())));
            }
        }
        all
    }

    fn check(&self, limits: &InputLimits) -> Result<()> {
        let check = |limit, count| limits.check(limit, count, ErrorKind::InvalidMesh);
        check(InputLimit::MeshVertices, self.vertices)?;
        check(InputLimit::MeshTriangles, self.triangles)?;
        check(InputLimit::MeshValues, self.objects)
    }
}

/// The materials that a file uses, of its .mtl files; one that none of them has is the default, as
/// is each where a file is missing.
fn materials(
    path: &Path,
    used: &[String],
    libraries: &[String],
    files: &dyn Files,
) -> Result<(Vec<Material>, Vec<Texture>)> {
    let mut found: HashMap<String, (PathBuf, tobj::Material)> = HashMap::new();
    for library in libraries {
        let library = path.parent().unwrap_or(Path::new("")).join(library);
        let text = match files.read(&library) {
            Ok(text) => text,
            Err(error) if error.kind() == ErrorKind::Io => continue,
            Err(error) => return Err(error.at(Place::File(path.to_path_buf()))),
        };
        let read = tobj::load_mtl_buf(&mut &text[..]);
        let (materials, _) = read.map_err(|error| {
            invalid(format!("not a material library: {error}")).at(Place::File(library.clone()))
        })?;
        for material in materials {
            found.entry(material.name.clone()).or_insert((library.clone(), material));
        }
    }
    let mut textures = Vec::new();
    let mut places: HashMap<PathBuf, usize> = HashMap::new();
    let mut all = Vec::new();
    for name in used {
        let Some((library, given)) = found.get(name) else {
            all.push(Material { name: name.clone(), metallic: 0.0, ..Material::default() });
            continue;
        };
        let mut material = material_of(given);
        let maps = [
            (TextureSlot::BaseColor, &given.diffuse_texture),
            (TextureSlot::Normal, &given.normal_texture),
            (TextureSlot::Specular, &given.specular_texture),
            (TextureSlot::Alpha, &given.dissolve_texture),
        ];
        let emissive = given.unknown_param.get("map_Ke").cloned();
        for (slot, file) in maps.into_iter().chain([(TextureSlot::Emissive, &emissive)]) {
            let Some(file) = file else { continue };
            // Flags such as `-bm 0.2` stand before the name.
            let name =
                file.rsplit_once(' ').filter(|_| file.starts_with('-')).map_or(&**file, |(_, name)| name);
            let picture = library.parent().unwrap_or(Path::new("")).join(name.replace('\\', "/"));
            let texture = *places.entry(picture).or_insert_with_key(|picture| {
                let picture = PictureSource::File(picture.clone());
                textures.push(Texture { picture, sampler: Sampler::default() });
                textures.len() - 1
            });
            material.textures[slot as usize] = Some(texture);
        }
        all.push(material);
    }
    Ok((all, textures))
}

fn material_of(given: &tobj::Material) -> Material {
    let [red, green, blue] = given.diffuse.unwrap_or([1.0; 3]);
    let default = Material::default();
    let unknown = |key: &str| given.unknown_param.get(key);
    let number = |key: &str| unknown(key).and_then(|text| text.trim().parse::<f32>().ok());
    let emissive = unknown("Ke").and_then(|text| {
        let numbers: Option<Vec<f32>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        <[f32; 3]>::try_from(numbers?).ok()
    });
    Material {
        name: given.name.clone(),
        base_color: [red, green, blue, given.dissolve.unwrap_or(1.0)],
        metallic: number("Pm").unwrap_or(0.0),
        roughness: number("Pr").unwrap_or(default.roughness),
        emissive: given.emissive.or(emissive).unwrap_or_default(),
        ior: given.optical_density.unwrap_or(default.ior),
        ambient: given.ambient.unwrap_or_default(),
        specular: given.specular.unwrap_or_default(),
        shininess: given.shininess.unwrap_or_default(),
        illumination: given.illumination_model.unwrap_or_default().into(),
        ..default
    }
}

/// Finds the first invalid line, given the number of vertices before it: the errors of tobj have no
/// line number.
fn first_invalid_line(path: &Path, bytes: &[u8]) -> Option<Place> {
    let text = std::str::from_utf8(bytes).ok()?;
    // The numbers of positions, texture coordinates and normals.
    let mut counts = [0_i64; 3];
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let mut words = line.split_whitespace();
        let invalid_line = match words.next() {
            Some("v") => count_line(&mut counts[0], words, 3),
            Some("vt") => count_line(&mut counts[1], words, 2),
            Some("vn") => count_line(&mut counts[2], words, 3),
            Some("f") => !words.all(|corner| is_corner(corner, counts)),
            _ => false,
        };
        if invalid_line {
            let span = start..start + line.trim_end().len();
            return Some(Place::Text { file: escape::path(&path).to_string(), text: text.into(), span });
        }
        start += line.len();
    }
    None
}

/// Counts a line of numbers; returns whether it is invalid.
fn count_line<'w>(count: &mut i64, words: impl Iterator<Item = &'w str>, least: usize) -> bool {
    let numbers: Vec<Option<f32>> = words.map(|word| word.parse().ok()).collect();
    *count += 1;
    numbers.len() < least || numbers.iter().any(Option::is_none)
}

/// Whether the indices of a corner, `position[/texture[/normal]]`, exist.
fn is_corner(corner: &str, counts: [i64; 3]) -> bool {
    corner.split('/').zip(counts).enumerate().all(|(i, (word, count))| match word.parse::<i64>() {
        Ok(index) => (1..=count).contains(&index) || (-count..0).contains(&index),
        Err(_) => word.is_empty() && i > 0,
    })
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
    fn a_broken_line_is_shown() {
        for (text, line) in [
            ("v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n", "m.obj:2:1"),
            ("v 0 0 0\nv 1 0\n", "m.obj:2:1"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 9\n", "m.obj:5:1"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 three\n", "m.obj:4:1"),
        ] {
            let error = load(text, None).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidMesh);
            assert!(error.render().contains(line), "{text}: {error:?}");
        }
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
    fn a_broken_library_is_named() {
        let library: &[u8] = b"newmtl brick\nKd red\n";
        let error = open(HOUSE, &[("a/house.mtl", library)], InputLimits::default()).unwrap_err();
        assert!(error.message().starts_with("not a material library"), "{error}");
        assert!(error.to_string().contains("a/house.mtl"), "{error}");
    }
}
