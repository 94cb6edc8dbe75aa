//! Drawing shared by the benchmark figures: markers, labels of powers of ten, recorded values.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;

/// Results of drawing.
pub type Drawn<T> = Result<T, Box<dyn std::error::Error>>;

/// Marker shape, which distinguishes series without colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(dead_code, reason = "each benchmark compiles this module and draws some of them")]
pub enum MarkerShape {
    Circle,
    Square,
    Diamond,
    TriangleUp,
    TriangleDown,
    Cross,
    Plus,
}

/// Appearance of the points of a series.
#[derive(Clone, Copy, Debug)]
pub struct Marker {
    pub shape: MarkerShape,
    pub colour: RGBColor,
    /// True if the shape is filled, false for an outline.
    pub is_filled: bool,
}

impl Marker {
    /// Draws the marker at a pixel of an area, with a rim of paper around it.
    pub fn draw<B: DrawingBackend>(self, area: &DrawingArea<B, Shift>, (x, y): (i32, i32)) -> Drawn<()>
    where
        B::ErrorType: 'static,
    {
        let scaled = |size: i32, points: &[(i32, i32)]| -> Vec<(i32, i32)> {
            points.iter().map(|(dx, dy)| (x + dx * size / 10, y + dy * size / 10)).collect()
        };
        let (outline, is_line): (&[(i32, i32)], bool) = match self.shape {
            MarkerShape::Circle => {
                let (paper, style) = (WHITE.filled(), ShapeStyle::from(self.colour).stroke_width(2));
                area.draw(&Circle::new((x, y), 6, paper))?;
                let style = if self.is_filled { self.colour.filled() } else { style };
                area.draw(&Circle::new((x, y), 5, style))?;
                return Ok(());
            }
            MarkerShape::Square => (&[(-8, -8), (8, -8), (8, 8), (-8, 8), (-8, -8)], false),
            MarkerShape::Diamond => (&[(0, -18), (18, 0), (0, 18), (-18, 0), (0, -18)], false),
            MarkerShape::TriangleUp => (&[(0, -11), (11, 9), (-11, 9), (0, -11)], false),
            MarkerShape::TriangleDown => (&[(0, 11), (11, -9), (-11, -9), (0, 11)], false),
            MarkerShape::Cross => (&[(-9, -9), (9, 9), (0, 0), (9, -9), (-9, 9)], true),
            MarkerShape::Plus => (&[(-11, 0), (11, 0), (0, 0), (0, -11), (0, 11)], true),
        };
        let points = scaled(5, outline);
        match is_line || !self.is_filled {
            true => {
                area.draw(&PathElement::new(points.clone(), WHITE.stroke_width(5)))?;
                area.draw(&PathElement::new(points, self.colour.stroke_width(2)))?;
            }
            false => {
                area.draw(&PathElement::new(points.clone(), WHITE.stroke_width(3)))?;
                area.draw(&Polygon::new(points, self.colour.filled()))?;
            }
        }
        Ok(())
    }
}

/// The label of a power of ten: `0.01`, `1`, `100`, and `10⁶` above a thousand or below a
/// hundredth.
pub fn power_of_ten(exponent: i32) -> String {
    if (-2..=3).contains(&exponent) {
        return format!("{}", 10f64.powi(exponent));
    }
    let digits = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let sign = if exponent < 0 { "⁻" } else { "" };
    let power = exponent.unsigned_abs().to_string();
    let power: String = power.bytes().map(|digit| digits[usize::from(digit - b'0')]).collect();
    format!("10{sign}{power}")
}

/// Reads the rows of recorded values: fields between tabs; lines that begin with `#` are comments.
pub fn recorded(path: &Path) -> Drawn<Vec<Vec<String>>> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let rows = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    Ok(rows.map(|line| line.split('\t').map(str::to_owned).collect()).collect())
}

/// A field of a recorded row.
pub fn field<T: std::str::FromStr>(row: &[String], at: usize) -> Drawn<T> {
    row.get(at).and_then(|text| text.parse().ok()).ok_or_else(|| format!("field {at} of {row:?}").into())
}
