//! Reads material libraries, `.mtl` files.

use std::borrow::Cow;
use std::ops::ControlFlow;

use crate::mesh::material::{Material, TextureMapping, TextureSlot};
use crate::mesh::obj::notes::Notes;
use crate::mesh::obj::text::{self, Words, number, numbers};

/// A material of a library.
#[derive(Debug, Default)]
pub(super) struct GivenMaterial {
    pub material: Material,
    /// Its pictures, the last one of each slot.
    pub maps: [Option<Map>; TextureSlot::COUNT],
    /// `d`
    dissolve: Option<f32>,
    /// `Tr`
    transparency: Option<f32>,
}

/// A picture of a material.
#[derive(Debug, PartialEq)]
pub(super) struct Map {
    /// The picture's path as the library gives it, with `/`.
    pub file: String,
    pub mapping: TextureMapping,
    pub is_clamped: bool,
}

/// The material of a name without values: not a metal, unlike the default of glTF.
pub(super) fn default_material(name: &str) -> Material {
    Material { name: name.to_owned(), metallic: 0.0, ..Material::default() }
}

/// The materials of a library in its order, and notes on what is not read of it.
pub(super) fn read(bytes: &[u8]) -> (Vec<GivenMaterial>, Notes) {
    let mut materials: Vec<GivenMaterial> = Vec::new();
    let mut notes = Notes::default();
    let _: ControlFlow<()> = text::statements(&text::decoded(bytes), 1, |line, text| {
        let mut words = Words(text);
        let Some(keyword) = words.next().map(text::shown) else { return ControlFlow::Continue(()) };
        if keyword.eq_ignore_ascii_case("newmtl") {
            let material = default_material(&words.name());
            materials.push(GivenMaterial { material, ..GivenMaterial::default() });
            return ControlFlow::Continue(());
        }
        let read = match materials.last_mut() {
            Some(material) => material.read(&keyword, words),
            None => Err("no `newmtl` is before it".into()),
        };
        if let Err(cause) = read {
            let cause = if cause.is_empty() { String::new() } else { format!(": {cause}") };
            notes.add(line, format!("`{keyword}`{cause}"));
        }
        ControlFlow::Continue(())
    });
    materials.iter_mut().for_each(GivenMaterial::finish);
    (materials, notes)
}

impl GivenMaterial {
    /// Reads a statement; otherwise returns why it is not read.
    fn read(&mut self, keyword: &str, mut words: Words<'_>) -> Result<(), Cow<'static, str>> {
        let own = &mut self.material;
        let next = |words: &mut Words<'_>| numbers::<1>(words).map(|[number]| number);
        match &*keyword.to_ascii_lowercase() {
            "kd" => {
                let [red, green, blue] = color(words)?;
                own.base_color = [red, green, blue, 1.0];
            }
            "ka" => own.ambient = color(words)?,
            "ks" => own.specular = color(words)?,
            "ke" => own.emissive = color(words)?,
            "ns" => own.shininess = next(&mut words)?,
            "ni" => own.ior = next(&mut words)?,
            "pm" => own.metallic = next(&mut words)?,
            "pr" => own.roughness = next(&mut words)?,
            "illum" => own.illumination = next(&mut words)? as u32,
            "d" if words.clone().next() == Some(b"-halo") => {
                words.next();
                self.dissolve = Some(next(&mut words)?);
                return Err("the option `-halo`, with which `d` depends on the direction".into());
            }
            "d" => self.dissolve = Some(next(&mut words)?),
            "tr" => self.transparency = Some(next(&mut words)?),
            "map_kd" => self.map(TextureSlot::BaseColor, words)?,
            "map_ks" => self.map(TextureSlot::Specular, words)?,
            "map_ke" => self.map(TextureSlot::Emissive, words)?,
            "map_d" => self.map(TextureSlot::Alpha, words)?,
            "bump" | "map_bump" | "norm" | "map_kn" => self.map(TextureSlot::Normal, words)?,
            _ => return Err("".into()),
        }
        Ok(())
    }

    /// Reads a picture with its options.
    fn map(&mut self, slot: TextureSlot, mut words: Words<'_>) -> Result<(), Cow<'static, str>> {
        let (mut scale, mut offset) = ([1.0; 2], [0.0; 2]);
        let mut is_clamped = false;
        let mut unread: Option<String> = None;
        // What begins with a dash and is no option is a name.
        while let Some(option) = words.clone().next().filter(|word| is_option(word)) {
            words.next();
            match option {
                b"-s" => up_to_three(&mut words, &mut scale),
                b"-o" => up_to_three(&mut words, &mut offset),
                b"-clamp" => is_clamped = words.next() == Some(b"on"),
                b"-bm" => self.material.normal_scale = numbers::<1>(&mut words)?[0],
                other => {
                    match other {
                        b"-t" => up_to_three(&mut words, &mut [0.0; 2]),
                        b"-mm" => drop(numbers::<2>(&mut words)?),
                        _ => drop(words.next()),
                    }
                    unread.get_or_insert(text::shown(other));
                }
            }
        }
        let name = words.name();
        let file = name.trim_matches('"').replace('\\', "/");
        if file.is_empty() {
            return Err("a file's name is missing".into());
        }
        let transform = [[scale[0], 0.0, offset[0]], [0.0, scale[1], offset[1]]];
        let mapping = TextureMapping { texcoord: 0, transform };
        self.maps[slot as usize] = Some(Map { file, mapping, is_clamped });
        unread.map_or(Ok(()), |option| Err(format!("its option `{option}`").into()))
    }

    fn finish(&mut self) {
        let opacity = self.dissolve.or(self.transparency.map(|transparency| 1.0 - transparency));
        self.material.base_color[3] = opacity.unwrap_or(1.0);
    }
}

/// Reads red, green and blue, or one number for all.
fn color(mut words: Words<'_>) -> Result<[f32; 3], Cow<'static, str>> {
    if let Some(kind @ (b"spectral" | b"xyz")) = words.clone().next() {
        return Err(format!("colours are read as red, green and blue, not as `{}`", text::shown(kind)).into());
    }
    let [red] = numbers(&mut words)?;
    match words.clone().next() {
        None => Ok([red; 3]),
        Some(_) => {
            let [green, blue] = numbers(&mut words).map_err(|_| "one or three numbers expected")?;
            Ok([red, green, blue])
        }
    }
}

/// Reads one to three numbers, of which the third one, of the depth, has no meaning for pictures.
fn up_to_three(words: &mut Words<'_>, found: &mut [f32; 2]) {
    for at in 0..3 {
        let mut ahead = *words;
        // The last word is the picture's name, even if that is a number.
        let number = ahead.next().and_then(|word| number(word).ok());
        let Some(number) = number.filter(|_| ahead.clone().next().is_some()) else { return };
        *words = ahead;
        if let Some(found) = found.get_mut(at) {
            *found = number;
        }
    }
}

fn is_option(word: &[u8]) -> bool {
    const OPTIONS: [&[u8]; 13] = [
        b"-blendu",
        b"-blendv",
        b"-bm",
        b"-boost",
        b"-cc",
        b"-clamp",
        b"-imfchan",
        b"-mm",
        b"-o",
        b"-s",
        b"-t",
        b"-texres",
        b"-type",
    ];
    OPTIONS.contains(&word)
}

/// The names of the libraries that a `mtllib` statement lists. A name may have spaces: it ends with
/// `.mtl` or the line.
pub(super) fn names(words: Words<'_>) -> Vec<String> {
    let text = words.name();
    let mut names = Vec::new();
    let mut start = 0;
    let mut end = 0;
    for word in text.split_inclusive(char::is_whitespace) {
        end += word.len();
        let name = text[start..end].trim().trim_matches('"');
        let extension = name.as_bytes().last_chunk().unwrap_or(b"    ");
        if end == text.len() || name.is_empty() || extension.eq_ignore_ascii_case(b".mtl") {
            if !name.is_empty() {
                names.push(name.replace('\\', "/"));
            }
            start = end;
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(text: &str) -> (GivenMaterial, Vec<String>) {
        let (mut materials, notes) = read(format!("newmtl a\n{text}\n").as_bytes());
        assert_eq!(materials.len(), 1, "{text}");
        let notes = notes.list(Some("m.mtl".as_ref()));
        (materials.remove(0), notes)
    }

    #[test]
    fn values_are_read_as_they_occur() {
        let base = default_material("a");
        let with_color = |base_color: [f32; 4]| Material { base_color, ..base.clone() };
        for (text, wanted) in [
            ("Kd .1 .2 .3", with_color([0.1, 0.2, 0.3, 1.0])),
            ("\tkd .1 .2 .3 # c\r", with_color([0.1, 0.2, 0.3, 1.0])),
            // One number counts for green and blue, too.
            ("Kd 0.5", with_color([0.5, 0.5, 0.5, 1.0])),
            ("Ke 2", Material { emissive: [2.0; 3], ..base.clone() }),
            ("Tr 0.25", with_color([1.0, 1.0, 1.0, 0.75])),
            ("d 0.5\nKd 1 0 0", with_color([1.0, 0.0, 0.0, 0.5])),
            ("Tr 0\nd 0.5", with_color([1.0, 1.0, 1.0, 0.5])),
            ("illum 2.0\nNs 1e2", Material { illumination: 2, shininess: 100.0, ..base.clone() }),
            (
                "Pr 0.3\nPm 0.7\nNi 1.4\nKs .1 .2 .3\nKa .4 .5 .6",
                Material {
                    roughness: 0.3,
                    metallic: 0.7,
                    ior: 1.4,
                    specular: [0.1, 0.2, 0.3],
                    ambient: [0.4, 0.5, 0.6],
                    ..base.clone()
                },
            ),
        ] {
            let (found, notes) = one(text);
            assert_eq!(found.material, wanted, "{text}");
            assert_eq!(notes, [""; 0], "{text}");
        }
        let (latin, _) = read(b"# f\xfcr\nnewmtl f\xfcr\nKd .1 .2 .3\n");
        assert_eq!(latin[0].material.name, "für");
        let (marked, _) = read("\u{feff}newmtl a\nKd .1 .2 .3\n".as_bytes());
        assert_eq!(marked[0].material.base_color, [0.1, 0.2, 0.3, 1.0]);
    }

    #[test]
    fn odd_lines_are_notes() {
        for (text, wanted) in [
            ("Kd", "`Kd`: a number is missing"),
            ("Kd red", "`Kd`: `red` is not a number"),
            ("Kd 1 2", "`Kd`: one or three numbers expected"),
            ("Kd spectral f.rfl 1", "`Kd`: colours are read as red, green and blue, not as `spectral`"),
            ("d -halo 0.5", "`d`: the option `-halo`, with which `d` depends on the direction"),
            ("Tf 1 1 1", "`Tf`"),
            ("refl -type sphere t.png", "`refl`"),
            ("map_Kd", "`map_Kd`: a file's name is missing"),
            ("map_Kd -mm 0 1 t.png", "`map_Kd`: its option `-mm`"),
        ] {
            let (found, notes) = one(text);
            assert_eq!(notes, [format!("m.mtl:2: {wanted}")], "{text}");
            let alpha = if text.starts_with("d ") { 0.5 } else { 1.0 };
            assert_eq!(found.material.base_color, [1.0, 1.0, 1.0, alpha]);
        }
        let (none, notes) = read(b"Kd 1 1 1\nKs 1 1 1\n");
        assert!(none.is_empty());
        assert_eq!(notes.list(None)[0], "line 1: `Kd`: no `newmtl` is before it");
        // Hostile libraries have no more notes than that.
        let many: String = (0..1000).map(|at| format!("key{at}\n")).collect();
        let (_, notes) = one(&many);
        assert_eq!(notes.len(), 32);
        assert_eq!(notes[31], "m.mtl:33: further statements (969 times)");
    }

    #[test]
    fn pictures_have_options_and_spaces() {
        let plain = TextureMapping::default();
        let moved = TextureMapping { transform: [[2.0, 0.0, 0.5], [0.0, 3.0, 0.0]], ..plain };
        for (text, file, mapping, is_clamped) in [
            ("map_Kd t.png", "t.png", plain, false),
            ("map_kd\tmy tex.png  ", "my tex.png", plain, false),
            ("map_Kd -o 0.5 0 0 -s 2 3 1 my tex.png", "my tex.png", moved, false),
            ("map_Kd -s 2 3 -o 0.5 t.png", "t.png", moved, false),
            ("map_Kd -clamp on t.png # comment", "t.png", plain, true),
            ("map_Kd -clamp off t.png", "t.png", plain, false),
            ("map_Kd -blendu on -mm 0 1 t.png", "t.png", plain, false),
            ("map_Kd \"my tex.png\"", "my tex.png", plain, false),
            ("map_Kd .\\f\\t.png", "./f/t.png", plain, false),
            ("map_Kd -dash.png", "-dash.png", plain, false),
            ("map_Kd -t 1 7", "7", plain, false),
        ] {
            let (mut found, _) = one(text);
            let wanted = Map { file: file.into(), mapping, is_clamped };
            assert_eq!(found.maps[TextureSlot::BaseColor as usize].take(), Some(wanted), "{text}");
        }
        for (text, slot) in [
            ("map_Bump -bm 0.5 t.png", TextureSlot::Normal),
            ("bump -bm 0.5 t.png", TextureSlot::Normal),
            ("norm -bm 0.5 t.png", TextureSlot::Normal),
            ("map_Ke t.png", TextureSlot::Emissive),
            ("map_Ks t.png", TextureSlot::Specular),
            ("map_d t.png", TextureSlot::Alpha),
        ] {
            let (found, notes) = one(text);
            assert!(found.maps[slot as usize].is_some() && notes.is_empty(), "{text}");
            let scale = if slot == TextureSlot::Normal { 0.5 } else { 1.0 };
            assert_eq!(found.material.normal_scale, scale, "{text}");
        }
    }

    #[test]
    fn libraries_are_listed_with_spaces_and_backslashes() {
        for (text, wanted) in [
            (" a.mtl b.MTL", &["a.mtl", "b.MTL"][..]),
            (" my lib.mtl  b.mtl", &["my lib.mtl", "b.mtl"]),
            (" \"my lib.mtl\"\r", &["my lib.mtl"]),
            (" .\\f\\m.mtl", &["./f/m.mtl"]),
            (" m # all", &["m"]),
            ("", &[]),
        ] {
            assert_eq!(names(Words(text.as_bytes())), wanted, "{text}");
        }
        // Long lists take no longer for each name.
        for (text, count) in [("a.mtl ".repeat(100_000), 100_000), (" a".repeat(400_000), 1)] {
            assert_eq!(names(Words(text.as_bytes())).len(), count);
        }
        assert_eq!(names(Words(format!("a.mtl{}b", " ".repeat(400_000)).as_bytes())), ["a.mtl", "b"]);
    }
}
