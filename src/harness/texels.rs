//! The texels of an image, read back.

use std::fmt;
use std::sync::Arc;

use crate::machine::image::{Image, Position};

/// An image whose texels a test looks at; level 0 and layer 0.
#[derive(Clone)]
pub struct Texels {
    image: Arc<Image>,
}

impl Texels {
    pub(super) fn new(image: Arc<Image>) -> Self {
        Self { image }
    }

    /// The image itself: its format, shape and bytes.
    pub fn image(&self) -> &Arc<Image> {
        &self.image
    }

    /// Width and height.
    pub fn size(&self) -> [u32; 2] {
        let [width, height, _] = self.image.shape().extent;
        [width, height]
    }

    /// R, G, B and A of a texel, as a shader reads them; integers as numbers. What the format lacks
    /// is 0, and A is 1.
    ///
    /// # Panics
    /// Where the image has no such texel.
    #[track_caller]
    pub fn at(&self, x: u32, y: u32) -> [f32; 4] {
        let position = Position { at: [x.into(), y.into(), 0], ..Position::default() };
        let [width, height] = self.size();
        let index = self.image.index(&position);
        let index = index.unwrap_or_else(|| panic!("no texel ({x}, {y}) in an image of {width} x {height}"));
        self.image.format().decode_numbers(self.image.load(index)).map(|number| number as f32)
    }

    /// All texels, row by row, the top one first.
    pub fn rows(&self) -> Vec<Vec<[f32; 4]>> {
        let [width, height] = self.size();
        (0..height).map(|y| (0..width).map(|x| self.at(x, y)).collect()).collect()
    }
}

impl fmt::Debug for Texels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size();
        writeln!(f, "{width} x {height} texels")?;
        for row in self.rows().iter().take(16) {
            writeln!(f, "{:?}", &row[..row.len().min(16)])?;
        }
        Ok(())
    }
}
