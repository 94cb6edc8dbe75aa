//! Wavefront OBJ, read by `tobj`. Polygons are cut into fans around their first vertex; points,
//! lines, normals, texture coordinates and materials are left out.

use std::path::Path;

use tobj::{LoadError, LoadOptions};

use crate::error::{Error, ErrorKind, Place, Result};
use crate::input::{InputLimit, InputLimits, contained};
use crate::scene::mesh::Mesh;
use crate::scene::read::list_of;

/// The triangles of all objects, or of the one with the given name.
///
/// # Errors
/// `InvalidMesh` that points at the line for a broken file; also where no object has that name, no
/// triangle is left, or the file is beyond a limit.
pub fn read(path: &Path, bytes: &[u8], object: Option<&str>, limits: &InputLimits) -> Result<Mesh> {
    let read = contained("tobj", ErrorKind::InvalidMesh, || decode(path, bytes, object, limits));
    read.map_err(|error| error.or_at(Place::File(path.to_path_buf())))
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidMesh, message)
}

fn decode(path: &Path, bytes: &[u8], object: Option<&str>, limits: &InputLimits) -> Result<Mesh> {
    check_counts(bytes, limits)?;
    let options =
        LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    // Materials do not matter here, and a missing .mtl must not stop the mesh.
    let loaded = tobj::load_obj_buf(&mut &bytes[..], &options, |_| Err(LoadError::OpenFileFailed));
    let models = match loaded {
        Ok((models, _)) => models,
        Err(error) => {
            let error = invalid(format!("not a Wavefront OBJ file: {error}"));
            return Err(match first_invalid_line(path, bytes) {
                Some(place) => error.at(place),
                None => error,
            });
        }
    };
    let mut mesh = Mesh::default();
    for model in models.iter().filter(|model| object.is_none_or(|name| model.name == name)) {
        let base = mesh.vertices.len() as u32;
        mesh.vertices.extend(model.mesh.positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]));
        mesh.indices.extend(model.mesh.indices.iter().map(|index| base + index));
    }
    if !mesh.indices.is_empty() {
        return Ok(mesh);
    }
    Err(match object {
        None => invalid("the file has no triangles"),
        Some(name) => {
            let names = list_of(models.iter().map(|model| model.name.as_str()));
            invalid(format!("no object `{name}` with triangles"))
                .note(format!("the objects here are: {names}"))
        }
    })
}

/// Counts what the file makes, before tobj allocates it: vertices, triangles of its polygons, and
/// objects, of each of which it keeps half a kilobyte.
fn check_counts(bytes: &[u8], limits: &InputLimits) -> Result<()> {
    let (mut vertices, mut triangles, mut objects) = (0, 0, 0);
    for line in bytes.split(|byte| *byte == b'\n') {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => vertices += 1,
            Some(b"f") => triangles += (words.count() as u64).saturating_sub(2),
            Some(b"o" | b"g" | b"usemtl" | b"mtllib") => objects += 1,
            _ => {}
        }
    }
    let check = |limit, count| limits.check(limit, count, ErrorKind::InvalidMesh);
    check(InputLimit::MeshVertices, vertices)?;
    check(InputLimit::MeshTriangles, triangles)?;
    check(InputLimit::MeshValues, objects)
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
            return Some(Place::Text { file: path.display().to_string(), text: text.into(), span });
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

    fn load(text: &str, object: Option<&str>) -> Result<Mesh> {
        read(Path::new("m.obj"), text.as_bytes(), object, &InputLimits::default())
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
        assert!(error.render().contains("the objects here are: quad, other"), "{error:?}");
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
        assert!(read(Path::new("m.obj"), &[0xff, 0xfe, 0], None, &InputLimits::default()).is_err());
    }

    #[test]
    fn counts_are_compared_with_limits_before_anything_is_read() {
        // Four vertices, and two triangles of a polygon of four corners.
        for (limit, most) in
            [(InputLimit::MeshVertices, 4), (InputLimit::MeshTriangles, 2), (InputLimit::MeshValues, 1)]
        {
            let read = |most| {
                let limits = InputLimits::default().with(limit, most);
                read(Path::new("m.obj"), QUAD.as_bytes(), None, &limits)
            };
            assert!(read(most).is_ok());
            let error = read(most - 1).unwrap_err();
            assert!(error.to_string().contains(&format!("`{}` of {}", limit.name(), most - 1)), "{error}");
            assert!(error.to_string().contains("m.obj"), "{error}");
        }
    }
}
