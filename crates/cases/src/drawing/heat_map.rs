//! Heat maps: a colour for each number of a plane, and a legend with numbers.

use crate::drawing::bitmap_text::{self, LINE_HEIGHT};
use crate::expect::magnitude_colour;
use anyhit_base::count::grouped;
use anyhit_scene::image::Rgba8;

/// Paper and ink of the legend.
const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [0; 3];

/// The colour of numbers that are not finite.
const NOT_FINITE: [u8; 3] = [255, 0, 255];

/// The margin around everything, and the height of the bar of colours.
const MARGIN: u32 = 8;
const BAR_HEIGHT: u32 = 14;

/// The numbers of the bar.
const TICKS: u32 = 4;

/// The least width of the legend, and of the plane above it: small ones are magnified.
const LEAST_WIDTH: u32 = 320;

/// Counts below this number have their colours computed once for a plane.
const REMEMBERED_COUNTS: usize = 1 << 14;

/// How a number becomes a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeatScale {
    /// In proportion to the greatest one.
    Linear,
    /// By the logarithm of the number and 1.
    Logarithmic,
}

/// The colours of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Palette {
    /// Viridis, from dark blue to yellow: equal steps look equally far apart, also to the
    /// colour-blind and in grey.
    Viridis,
    /// One hue, from black to bright, as pictures of differences have it.
    Magnitude,
}

impl Palette {
    /// The colour of a place from 0 to 1.
    pub fn colour(self, place: f64) -> [u8; 3] {
        match self {
            Self::Viridis => colorous::VIRIDIS.eval_continuous(place).as_array(),
            Self::Magnitude => magnitude_colour(place),
        }
    }
}

/// Numbers to be shown by colours, from the first one for 0 to the last one for `top` and all
/// above.
#[derive(Clone, Copy, Debug)]
pub struct HeatMap<'a> {
    /// Width and height.
    pub extent: [u32; 2],
    /// The numbers, rows from the top.
    pub values: &'a [f64],
    /// The number of the last colour.
    pub top: f64,
    /// The mapping of numbers to places on the colour bar.
    pub scale: HeatScale,
    /// The colours.
    pub palette: Palette,
}

impl HeatMap<'_> {
    /// The colours of the numbers, a pixel each.
    pub fn plane(&self) -> Rgba8 {
        let opaque = |[r, g, b]: [u8; 3]| [r, g, b, 255];
        // Most numbers are counts, of which many pixels have the same.
        let mut of_counts = vec![None; REMEMBERED_COUNTS];
        let mut colour = |value: f64| {
            let count = value as usize;
            match of_counts.get_mut(count).filter(|_| count as f64 == value) {
                Some(known) => *known.get_or_insert_with(|| self.colour(value)),
                None => self.colour(value),
            }
        };
        let mut pixels = Vec::with_capacity(4 * self.values.len());
        self.values.iter().for_each(|&value| pixels.extend_from_slice(&opaque(colour(value))));
        Rgba8 { extent: self.extent, pixels }
    }

    /// The plane, magnified where it is small, over a legend: lines of text, and a bar of all
    /// colours with their numbers.
    pub fn picture(&self, lines: &[String]) -> Rgba8 {
        let [width, height] = self.extent;
        let factor = LEAST_WIDTH.div_ceil(width.max(1)).min((4 * LEAST_WIDTH).div_ceil(height.max(1))).max(1);
        let [plane_width, plane_height] = self.extent.map(|side| side * factor);
        let text_width = lines.iter().map(|line| bitmap_text::width(line)).max().unwrap_or(0);
        let inner = plane_width.max(LEAST_WIDTH).max(text_width);
        let legend = MARGIN + (lines.len() as u32 + 1) * (LINE_HEIGHT + 2) + BAR_HEIGHT;
        let extent = [inner + 2 * MARGIN, plane_height + legend + 2 * MARGIN];
        let [r, g, b] = PAPER;
        let paper = [r, g, b, 255].repeat(extent[0] as usize * extent[1] as usize);
        let mut picture = Rgba8 { extent, pixels: paper };
        for y in 0..plane_height {
            for x in 0..plane_width {
                let at = (y / factor) as usize * width as usize + (x / factor) as usize;
                set(&mut picture, [MARGIN + x, MARGIN + y], self.colour(self.values[at]));
            }
        }
        let mut top = plane_height + 2 * MARGIN;
        for line in lines {
            bitmap_text::draw(&mut picture, [MARGIN, top], line, INK);
            top += LINE_HEIGHT + 2;
        }
        self.draw_bar(&mut picture, top, inner);
        picture
    }

    /// Draws the bar of colours and the numbers below it.
    fn draw_bar(&self, picture: &mut Rgba8, top: u32, width: u32) {
        for x in 0..width {
            let colour = self.palette.colour(f64::from(x) / f64::from(width - 1));
            (0..BAR_HEIGHT).for_each(|y| set(picture, [MARGIN + x, top + y], colour));
        }
        for tick in 0..=TICKS {
            let text = self.tick(tick);
            // The first number begins with the bar, the last ends with it, others are in between.
            let room = width.saturating_sub(bitmap_text::width(&text));
            let left = MARGIN + room * tick / TICKS;
            bitmap_text::draw(picture, [left, top + BAR_HEIGHT + 2], &text, INK);
        }
    }

    /// The text of a number below the bar.
    fn tick(&self, tick: u32) -> String {
        let text = number(self.value_at(f64::from(tick) / f64::from(TICKS)));
        let is_exceeded = self.values.iter().any(|&value| value > self.top);
        if tick == TICKS && is_exceeded { format!(">={text}") } else { text }
    }

    /// The number of a place on the bar, from 0 to 1.
    pub fn value_at(&self, place: f64) -> f64 {
        match self.scale {
            HeatScale::Linear => place * self.top,
            HeatScale::Logarithmic => (place * self.top.ln_1p()).exp_m1(),
        }
    }

    /// The place of a number on the bar, from 0 to 1.
    fn place(&self, value: f64) -> f64 {
        if self.top <= 0.0 {
            return 0.0;
        }
        let place = match self.scale {
            HeatScale::Linear => value / self.top,
            HeatScale::Logarithmic => value.max(0.0).ln_1p() / self.top.ln_1p(),
        };
        place.clamp(0.0, 1.0)
    }

    fn colour(&self, value: f64) -> [u8; 3] {
        if value.is_finite() { self.palette.colour(self.place(value)) } else { NOT_FINITE }
    }
}

/// A number for people: whole ones with commas between thousands, others with three digits that
/// count.
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    let whole = value.round();
    if (value - whole).abs() < 1e-9 || value.abs() >= 1000.0 {
        // Without the sign of a zero.
        return grouped(format_args!("{:.0}", whole + 0.0));
    }
    let decimals = match value.abs() {
        100.0.. => 0,
        10.0.. => 1,
        1.0.. => 2,
        _ => 3,
    };
    format!("{value:.decimals$}")
}

fn set(picture: &mut Rgba8, [x, y]: [u32; 2], [r, g, b]: [u8; 3]) {
    let at = 4 * (y as usize * picture.extent[0] as usize + x as usize);
    picture.pixels[at..at + 4].copy_from_slice(&[r, g, b, 255]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let shown = [0.0, 7.0, 1234567.0, 0.25, 12.5, 99.94, 1234.5, -1500.0].map(number);
        assert_eq!(shown, ["0", "7", "1,234,567", "0.250", "12.5", "99.9", "1,235", "-1,500"]);
        assert_eq!(number(f64::INFINITY), "inf");
    }

    #[test]
    fn the_ends_of_viridis_are_those_of_its_authors() {
        // matplotlib, the first and the last of _viridis_data.
        let near = |[r, g, b]: [u8; 3], expected: [f64; 3]| {
            let found = [r, g, b].map(|channel| f64::from(channel) / 255.0);
            found.iter().zip(expected).all(|(one, other)| (one - other).abs() < 0.01)
        };
        assert!(
            near(Palette::Viridis.colour(0.0), [0.267004, 0.004874, 0.329415]),
            "{:?}",
            Palette::Viridis.colour(0.0)
        );
        assert!(
            near(Palette::Viridis.colour(1.0), [0.993248, 0.906157, 0.143936]),
            "{:?}",
            Palette::Viridis.colour(1.0)
        );
        let grey = |[r, g, b]: [u8; 3]| 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b);
        let lightness: Vec<f64> =
            (0..=20).map(|at| grey(Palette::Viridis.colour(f64::from(at) / 20.0))).collect();
        assert!(lightness.is_sorted(), "{lightness:?}");
    }

    #[test]
    fn a_plane_has_a_pixel_for_each_number_and_a_picture_its_legend() {
        let values = [0.0, 1.0, 3.0, f64::NAN];
        let map = HeatMap {
            extent: [2, 2],
            values: &values,
            top: 2.0,
            scale: HeatScale::Linear,
            palette: Palette::Viridis,
        };
        let plane = map.plane();
        assert_eq!(plane.extent, [2, 2]);
        let pixels: Vec<&[u8]> = plane.pixels.chunks_exact(4).map(|pixel| &pixel[..3]).collect();
        assert_eq!(
            pixels,
            [
                Palette::Viridis.colour(0.0),
                Palette::Viridis.colour(0.5),
                Palette::Viridis.colour(1.0),
                NOT_FINITE
            ]
        );
        assert_eq!(map.tick(0), "0");
        assert_eq!(map.tick(2), "1");
        assert_eq!(map.tick(4), ">=2", "a number is above the last one");
        let picture = map.picture(&["title".to_owned()]);
        // Two pixels are magnified to 320.
        assert_eq!(picture.extent[0], 320 + 2 * MARGIN);
        assert_eq!(picture.pixels.len(), 4 * (picture.extent[0] * picture.extent[1]) as usize);
        let at = |x: u32, y: u32| {
            let at = 4 * (y * picture.extent[0] + x) as usize;
            [picture.pixels[at], picture.pixels[at + 1], picture.pixels[at + 2]]
        };
        assert_eq!(at(MARGIN, MARGIN), Palette::Viridis.colour(0.0));
        assert_eq!(at(MARGIN + 319, MARGIN), Palette::Viridis.colour(0.5));
        assert_eq!(at(MARGIN, MARGIN + 319), Palette::Viridis.colour(1.0));
    }

    #[test]
    fn a_logarithmic_scale_goes_from_0_to_its_top() {
        let map = HeatMap {
            extent: [1, 1],
            values: &[0.0],
            top: 1023.0,
            scale: HeatScale::Logarithmic,
            palette: Palette::Viridis,
        };
        // 1 + 31 is half way from 1 to 1024 on a logarithmic scale.
        assert!((map.value_at(0.5) - 31.0).abs() < 1e-9);
        assert!((map.place(31.0) - 0.5).abs() < 1e-12);
        assert_eq!((map.place(0.0), map.place(1023.0), map.place(1e9)), (0.0, 1.0, 1.0));
    }

    #[test]
    fn a_plane_of_zeros_has_the_first_colour() {
        let map = HeatMap {
            extent: [1, 1],
            values: &[0.0],
            top: 0.0,
            scale: HeatScale::Linear,
            palette: Palette::Viridis,
        };
        assert_eq!(map.plane().pixels[..3], Palette::Viridis.colour(0.0));
    }
}
