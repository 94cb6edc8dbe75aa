//! Pictures of a failed comparison, saved for people.

use std::path::{Path, PathBuf};

#[cfg(feature = "reports")]
use crate::case::Loaded;
use crate::expect::PictureDifference;
#[cfg(feature = "reports")]
use crate::picture_page::failed_picture;
use anyhit_base::atomic_file;
use anyhit_base::error::{Error, Result};
#[cfg(feature = "reports")]
use anyhit_debugger::{Session, shell};
use anyhit_scene::image::Rgba8;

/// Saves `expected.png`, `found.png` and `difference.png` in a folder named after test and image.
pub(super) fn save(folder: &Path, test: &str, picture: &PictureDifference) -> Result<Vec<PathBuf>> {
    let folder = folder.join(inside(test)).join(inside(&picture.name));
    std::fs::create_dir_all(&folder).map_err(|error| Error::io(&folder, error))?;
    let pictures =
        [("expected", &picture.expected), ("found", &picture.found), ("difference", &picture.difference())];
    pictures.into_iter().map(|(name, picture)| write(folder.join(format!("{name}.png")), picture)).collect()
}

/// Saves `page.html` beside the pictures: both and their difference, with the explanations of the
/// pixels that differ most, if that is wanted.
#[cfg(feature = "reports")]
pub(super) fn save_page(
    folder: &Path,
    test: &str,
    picture: &PictureDifference,
    loaded: &Loaded,
    explains: bool,
    is_variant: bool,
) -> Result<PathBuf> {
    let single = loaded.assembled.single_launch(None)?;
    let [width, height] = picture.found.extent;
    // A pixel of another picture is no launch index of the scene's launch.
    let is_launched = single.size == [width, height, 1] && !loaded.assembled.is_frame();
    let session = match explains && is_launched {
        true => Some(Session::new(loaded.scene.clone())?),
        false => None,
    };
    let scene = shell::word(&loaded.scene.path.to_string_lossy());
    // The scene of a variant does not know its name.
    let command = (is_launched && !is_variant)
        .then(|| [format!("anyhit trace-one-ray {scene}") + " --pixel ", String::new()]);
    let page = failed_picture(test, picture, session.as_ref(), command)?;
    let path = folder.join(inside(test)).join(inside(&picture.name)).join("page.html");
    atomic_file::write_unsynced(&path, page.html())?;
    Ok(path)
}

/// A name as a path that leads further in: scenes name their tests and images as they like.
fn inside(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_./()".contains(c) { c } else { '-' };
    let name: String = name.trim_start_matches(['.', '/']).chars().map(plain).collect();
    name.replace("..", "-")
}

fn write(path: PathBuf, picture: &Rgba8) -> Result<PathBuf> {
    atomic_file::write_unsynced(&path, picture.encode_png()?)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_no_way_out() {
        for (name, expected) in [
            ("rays::leaf (2)", "rays--leaf-(2)".to_owned()),
            ("../../etc/a", "etc/a".into()),
            ("/etc/a", "etc/a".into()),
            ("a/../../b", "a/-/-/b".into()),
            ("a/..", "a/-".into()),
            ("..", String::new()),
            ("a/./b\\..\\c:d", "a/./b---c-d".into()),
        ] {
            assert_eq!(inside(name), expected, "{name}");
        }
    }

    #[test]
    fn pictures_are_saved_inside_their_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let own = folder.path().join("own");
        let one = Rgba8 { extent: [1, 1], pixels: vec![0; 4] };
        for name in ["../out", "/out", "a/../../out"] {
            let pixel = one.pixels.clone();
            let picture = PictureDifference::new(name, one.extent, pixel.clone(), pixel).expect("one size");
            let saved = save(&own, "../test", &picture).expect("a writable folder");
            assert_eq!(saved.len(), 3);
            for path in saved {
                assert!(
                    path.canonicalize().expect("a file").starts_with(own.canonicalize().expect("a folder"))
                );
            }
        }
    }
}
