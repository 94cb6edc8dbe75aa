//! `motion` and `srt` of `[[instance]]`.

use crate::read::{OneOrMore, Parse, Table, TomlValue};
use crate::transform_entry::{Rotation, parse_transform, scale_vector};
use anyhit_engine::accel::{Motion, Srt};

/// Reads the motion of an instance, given its transform at time 0.
pub(super) fn motion(table: &Table<'_>, transform: [[f32; 4]; 3]) -> Option<Motion> {
    let key = table.value("motion").and_then(MatrixKey::parse);
    let Some(keys) = table.value("srt") else {
        return key.map(|key| Motion::Matrix([transform, key.0]));
    };
    let other_keys = ["motion", "transform", "scale", "rotate", "translate"];
    if let Some(other) = other_keys.into_iter().find(|other| table.has(other)) {
        return table.value(other)?.wrong(format!("`srt` is the whole transform and excludes `{other}`"));
    }
    let [first, second] = <[SrtKey; 2]>::parse(keys)?;
    Some(Motion::Srt(Box::new([first.0, second.0])))
}

/// A transform with the keys of an instance's.
struct MatrixKey([[f32; 4]; 3]);

impl Parse for MatrixKey {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let matrix = parse_transform(&table);
        let given = ["transform", "scale", "rotate", "translate"].iter().any(|key| table.has(key));
        table.finish();
        if !given {
            return value.wrong("a motion needs `transform` at time 1, or `scale`, `rotate` and `translate`");
        }
        matrix.map(Self)
    }
}

/// `VkSRTDataNV`
struct SrtKey(Srt);

impl Parse for SrtKey {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let rest = Srt::default();
        let scale = table.value("scale").map_or(Some(rest.scale), |value| {
            OneOrMore::parse(value).and_then(|scale| scale_vector(value, &scale))
        });
        let rotate = table.optional::<Rotation>("rotate");
        let quaternion = table.optional("quaternion");
        if let (Some(value), true) = (table.value("rotate"), table.has("quaternion")) {
            return value.wrong("`rotate` and `quaternion` exclude each other");
        }
        let rotation = rotate.map(|rotation| rotation.quaternion());
        let key = Srt {
            scale: scale?,
            shear: table.or("shear", rest.shear),
            pivot: table.or("pivot", rest.pivot),
            quaternion: quaternion.or(rotation).unwrap_or(rest.quaternion),
            translation: table.or("translate", rest.translation),
        };
        table.finish();
        Some(Self(key))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::files::EmbeddedFiles;
    use crate::resolve::{LoadOptions, load_text};
    use anyhit_engine::accel::Primitive;

    /// A scene of one triangle with an instance of these keys; its matrix at a time, or the
    /// mistakes.
    fn matrix(instance: &str, time: f32) -> Result<[[f32; 4]; 3], String> {
        let text = format!(
            "version = 1\n[geometry.a]\ntype = 'triangles'\nvertices = [[0,0,0],[1,0,0],[0,1,0]]\n\
             [[instance]]\ngeometry = 'a'\n{instance}"
        );
        let scene = load_text(Path::new("scene.toml"), &text, &EmbeddedFiles(&[]), &LoadOptions::default());
        let scene = scene.map_err(|error| error.to_string())?;
        Ok(scene.tlas[0].1.instances()[0].object_to_world(time))
    }

    #[test]
    fn matrix_and_srt_keys_are_read() {
        let moved = "translate = [0, 2, 0]\nmotion = { translate = [4, 2, 0], scale = 3 }";
        let expected = [[1.5, 0.0, 0.0, 1.0], [0.0, 1.5, 0.0, 2.0], [0.0, 0.0, 1.5, 0.0]];
        assert_eq!(matrix(moved, 0.25), Ok(expected));
        let turned = "[[instance.srt]]\npivot = [1, 0, 0]\n\
                      [[instance.srt]]\npivot = [1, 0, 0]\nrotate = { axis = [0, 0, 2], degrees = 180 }\n\
                      translate = [0, 0, 4]";
        // Half way between (0, 0, 0, 1) and (0, 0, 1, 0): a right angle about z.
        let expected = [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 2.0]];
        assert_eq!(matrix(turned, 0.5), Ok(expected));
    }

    #[test]
    fn vertices_at_both_times_come_from_lists_or_buffers() {
        let vertex = |geometry: &str| {
            let text = format!(
                "version = 1\n[geometry.a]\ntype = 'triangles'\n{geometry}\n[[instance]]\ngeometry = 'a'"
            );
            let path = Path::new("scene.toml");
            let scene = load_text(path, &text, &EmbeddedFiles(&[]), &LoadOptions::default());
            let scene = scene.map_err(|error| error.to_string())?;
            match scene.tlas[0].1.instances()[0].blas.primitive(0, 0, 0.5) {
                Some(Primitive::Triangle(vertices)) => Ok(vertices[1]),
                other => Err(format!("{other:?}")),
            }
        };
        let lists = "vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n\
                     vertices_t1 = [[0, 0, 0], [3, 0, 4], [0, 1, 0]]";
        assert_eq!(vertex(lists), Ok([2.0, 0.0, 2.0]));
        // Index 2 comes first, so that the vertices are renamed; the geometry is scaled by two.
        let buffers = "vertex_data = { f16 = [9, 9, 9, 1, 0, 0, 0, 0, 0, 0, 1, 0] }\n\
                       vertex_data_t1 = { f16 = [9, 9, 9, 3, 0, 4, 0, 0, 0, 0, 1, 0] }\n\
                       vertex_format = 'r16g16b16_sfloat'\nindex_data = { u32 = [2, 1, 3] }\nscale = 2";
        assert_eq!(vertex(buffers), Ok([4.0, 0.0, 4.0]));
        let few = vertex("vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nvertices_t1 = [[0, 0, 0]]");
        assert!(few.is_err_and(|text| text.contains("1 vertices at time 1, but 3 at time 0")));
    }

    #[test]
    fn mistakes_are_named() {
        let wrong = |text, part: &str| {
            let message = matrix(text, 0.0).expect_err("a mistake");
            assert!(message.contains(part), "{message}");
        };
        wrong("motion = { }", "a motion needs `transform` at time 1");
        wrong("motion = { scale = 0 }", "at time 1 is singular");
        wrong("scale = 2\nsrt = [{ }, { }]", "excludes `scale`");
        wrong("srt = [{ }]", "2");
        wrong("srt = [{ }, { quaternion = [0, 0, 0, 0] }]", "at time 1 is singular");
    }
}
