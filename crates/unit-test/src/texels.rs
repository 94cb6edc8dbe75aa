//! The texels of an image, read back.

use std::fmt;
use std::sync::Arc;

use anyhit_engine::machine::format::{Class, Format};
use anyhit_engine::machine::image::{Image, Position};

/// An image whose texels a test looks at; level 0 and layer 0.
///
/// [`Texels::at`] gives numbers of any format. The integers of 64-bit formats need not fit into
/// them: [`Texels::at_u64`] and [`Texels::at_i64`] are exact for every integer format.
#[derive(Clone)]
#[must_use]
pub struct Texels {
    image: Arc<Image>,
}

impl Texels {
    /// The texels of an image.
    #[doc(hidden)]
    pub fn new(image: Arc<Image>) -> Self {
        Self { image }
    }

    /// The image itself: its format, shape and bytes.
    #[must_use]
    pub fn image(&self) -> &Arc<Image> {
        &self.image
    }

    /// Width and height.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        let [width, height, _] = self.image.shape().extent;
        [width, height]
    }

    /// R, G, B and A of a texel, as a shader reads them; integers as numbers. What the format lacks
    /// is 0, and A is 1.
    ///
    /// Floats and integers of up to 32 bits are exact; of 64-bit integers, those up to 2^53 are.
    ///
    /// # Panics
    /// Where the image has no such texel.
    #[track_caller]
    #[must_use]
    pub fn at(&self, x: u32, y: u32) -> [f64; 4] {
        self.image.format().decode_numbers(self.bits(x, y))
    }

    /// R, G, B and A of a texel of floats, as a shader reads them; `unorm` and `snorm` formats give
    /// floats.
    ///
    /// # Panics
    /// Where the image has no such texel, and for a format of integers.
    #[track_caller]
    #[must_use]
    pub fn at_f32(&self, x: u32, y: u32) -> [f32; 4] {
        self.parts(x, y, Class::Float, "at_f32").map(|part| f32::from_bits(part as u32))
    }

    /// R, G, B and A of a texel of unsigned integers, exactly; A is 1 where the format lacks it.
    ///
    /// # Panics
    /// Where the image has no such texel, and for a format of floats, signed or 64-bit integers.
    #[track_caller]
    #[must_use]
    pub fn at_u32(&self, x: u32, y: u32) -> [u32; 4] {
        self.assert_narrow("at_u32", "at_u64");
        self.parts(x, y, Class::Uint, "at_u32").map(|part| part as u32)
    }

    /// R, G, B and A of a texel of signed integers, exactly; A is 1 where the format lacks it.
    ///
    /// # Panics
    /// Where the image has no such texel, and for a format of floats, unsigned or 64-bit integers.
    #[track_caller]
    #[must_use]
    pub fn at_i32(&self, x: u32, y: u32) -> [i32; 4] {
        self.assert_narrow("at_i32", "at_i64");
        self.parts(x, y, Class::Sint, "at_i32").map(|part| part as i32)
    }

    /// R, G, B and A of a texel of unsigned integers of any width, exactly.
    ///
    /// # Panics
    /// Where the image has no such texel, and for a format of floats or signed integers.
    #[track_caller]
    #[must_use]
    pub fn at_u64(&self, x: u32, y: u32) -> [u64; 4] {
        self.parts(x, y, Class::Uint, "at_u64")
    }

    /// R, G, B and A of a texel of signed integers of any width, exactly.
    ///
    /// # Panics
    /// Where the image has no such texel, and for a format of floats or unsigned integers.
    #[track_caller]
    #[must_use]
    pub fn at_i64(&self, x: u32, y: u32) -> [i64; 4] {
        self.parts(x, y, Class::Sint, "at_i64").map(u64::cast_signed)
    }

    /// All texels, row by row, the top one first, each as [`Texels::at`] gives it.
    #[must_use]
    pub fn rows(&self) -> Vec<Vec<[f64; 4]>> {
        let [width, height] = self.size();
        (0..height).map(|y| (0..width).map(|x| self.at(x, y)).collect()).collect()
    }

    #[track_caller]
    fn bits(&self, x: u32, y: u32) -> u128 {
        let position = Position { at: [x.into(), y.into(), 0], ..Position::default() };
        let [width, height] = self.size();
        let index = self.image.index(&position);
        let index = index.unwrap_or_else(|| panic!("no texel ({x}, {y}) in an image of {width} x {height}"));
        self.image.load(index)
    }

    #[track_caller]
    fn parts(&self, x: u32, y: u32, class: Class, method: &str) -> [u64; 4] {
        let format = self.image.format();
        if format.class() != class {
            let kind = |class| match class {
                Class::Float => "floats",
                Class::Sint => "signed integers",
                Class::Uint => "unsigned integers",
            };
            panic!(
                "`{method}` reads {}, but the image has the format {}, of {}: call `{}`",
                kind(class),
                format.name(),
                kind(format.class()),
                exact_getter(format)
            );
        }
        format.decode(self.bits(x, y))
    }

    #[track_caller]
    fn assert_narrow(&self, method: &str, wide: &str) {
        let format = self.image.format();
        if format.is_wide() && exact_getter(format) == wide {
            panic!("`{method}` reads 32 bits, but the image has the format {}: call `{wide}`", format.name());
        }
    }
}

/// The method that reads the texels of a format without a loss.
fn exact_getter(format: Format) -> &'static str {
    match (format.class(), format.is_wide()) {
        (Class::Float, _) => "at_f32",
        (Class::Sint, false) => "at_i32",
        (Class::Uint, false) => "at_u32",
        (Class::Sint, true) => "at_i64",
        (Class::Uint, true) => "at_u64",
    }
}

/// Rows and columns that [`Texels`] prints.
const SHOWN: u32 = 16;

/// Format, size, and the first 16 texels of the first 16 rows.
impl fmt::Debug for Texels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([width, height], format) = (self.size(), self.image.format());
        writeln!(f, "{width} x {height} texels, {}", format.name())?;
        for y in 0..height.min(SHOWN) {
            let columns = 0..width.min(SHOWN);
            let row: Vec<String> = match format.class() {
                Class::Float => columns.map(|x| format!("{:?}", self.at_f32(x, y))).collect(),
                Class::Sint => columns.map(|x| format!("{:?}", self.at_i64(x, y))).collect(),
                Class::Uint => columns.map(|x| format!("{:?}", self.at_u64(x, y))).collect(),
            };
            writeln!(f, "[{}]", row.join(", "))?;
        }
        Ok(())
    }
}
