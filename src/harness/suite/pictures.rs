//! Pictures of a failed comparison, saved for people.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{ImageFormat, RgbaImage};

use crate::atomic_file;
use crate::error::{Error, ErrorKind, Result};
use crate::harness::expect::PictureDifference;

/// Saves `expected.png`, `found.png` and `difference.png` in a folder named after test and image.
pub(super) fn save(folder: &Path, test: &str, picture: &PictureDifference) -> Result<Vec<PathBuf>> {
    let plain = |c: char| if c.is_alphanumeric() || "-_./()".contains(c) { c } else { '-' };
    let name: String = test.trim_start_matches(['.', '/']).chars().map(plain).collect();
    let folder = folder.join(name.replace("..", "-")).join(&picture.name);
    std::fs::create_dir_all(&folder).map_err(|error| Error::io(&folder, error))?;
    let pictures =
        [("expected", &picture.expected), ("found", &picture.found), ("difference", &picture.difference())];
    pictures.into_iter().map(|(name, picture)| write(folder.join(format!("{name}.png")), picture)).collect()
}

fn write(path: PathBuf, picture: &RgbaImage) -> Result<PathBuf> {
    let mut png = Cursor::new(Vec::new());
    picture
        .write_to(&mut png, ImageFormat::Png)
        .map_err(|error| Error::new(ErrorKind::Io, format!("{}: {error}", path.display())))?;
    atomic_file::write_unsynced(&path, png.into_inner())?;
    Ok(path)
}
