//! Draws the figure: one panel for each scene, time to the right, error upwards; lower left is
//! better.

use std::fmt::Write as _;
use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::figure::{Drawn, Marker, MarkerShape, field, power_of_ten, recorded};

/// One contender in one scene.
pub struct Point {
    pub name: String,
    pub nanoseconds: f64,
    /// p99 in ulp.
    pub p99: f64,
    /// True if some decisions are wrong.
    pub is_wrong: bool,
}

/// A scene's contenders.
pub struct Panel {
    pub scene: String,
    pub points: Vec<Point>,
}

const COLUMNS: usize = 3;

/// Pixels of the legend above the panels.
const LEGEND_HEIGHT: u32 = 104;

/// The contenders, the engine's own modes first, which are filled.
const MARKERS: [(&str, Marker); 7] = [
    ("exact", Marker { shape: MarkerShape::Circle, colour: RGBColor(0x00, 0x72, 0xB2), is_filled: true }),
    ("double", Marker { shape: MarkerShape::Diamond, colour: RGBColor(0xD5, 0x5E, 0x00), is_filled: true }),
    ("float", Marker { shape: MarkerShape::TriangleUp, colour: RGBColor(0x00, 0x9E, 0x73), is_filled: true }),
    (
        "careful f32",
        Marker { shape: MarkerShape::Square, colour: RGBColor(0x00, 0x00, 0x00), is_filled: false },
    ),
    ("naive f32", Marker { shape: MarkerShape::Cross, colour: RGBColor(0xB0, 0x52, 0x86), is_filled: false }),
    (
        "slabs f32",
        Marker { shape: MarkerShape::TriangleDown, colour: RGBColor(0x8A, 0x6A, 0x00), is_filled: false },
    ),
    (
        "capsule by distance",
        Marker { shape: MarkerShape::Plus, colour: RGBColor(0x66, 0x66, 0x66), is_filled: false },
    ),
];

/// Colour of the rings around contenders with wrong decisions.
const WRONG: RGBColor = RGBColor(0xC0, 0x00, 0x20);

/// Writes the values of all panels.
pub fn record(path: &Path, panels: &[Panel]) -> Drawn<()> {
    let mut text =
        "# scene, series, ns per ray, 99th percentile of the error in ulp, 1 with wrong decisions: \
                    written by\n# `cargo bench --bench time_vs_error`, drawn as docs/time-vs-error.svg.\n"
            .to_owned();
    for Panel { scene, points } in panels {
        for Point { name, nanoseconds, p99, is_wrong } in points {
            writeln!(text, "{scene}\t{name}\t{nanoseconds:.1}\t{p99:.3}\t{}", u8::from(*is_wrong))?;
        }
    }
    Ok(std::fs::write(path, text)?)
}

/// Draws recorded values.
pub fn draw_recorded(record: &Path, path: &Path) -> Drawn<()> {
    let mut panels: Vec<Panel> = Vec::new();
    for row in recorded(record)? {
        let scene: String = field(&row, 0)?;
        if panels.last().is_none_or(|panel| panel.scene != scene) {
            panels.push(Panel { scene, points: Vec::new() });
        }
        let (name, nanoseconds, p99) = (field(&row, 1)?, field(&row, 2)?, field(&row, 3)?);
        let is_wrong = field::<u8>(&row, 4)? != 0;
        panels.last_mut().expect("a panel").points.push(Point { name, nanoseconds, p99, is_wrong });
    }
    let rows = panels.len().div_ceil(COLUMNS);
    let size = (1080, LEGEND_HEIGHT + 290 * rows as u32);
    let area = SVGBackend::new(path, size).into_drawing_area();
    area.fill(&WHITE)?;
    let (legend, body) = area.split_vertically(LEGEND_HEIGHT);
    draw_legend(&legend)?;
    for (panel, cell) in panels.iter().zip(body.split_evenly((rows, COLUMNS))) {
        draw_panel(&area, &cell, panel)?;
    }
    Ok(area.present()?)
}

fn draw_legend<B: DrawingBackend>(area: &DrawingArea<B, Shift>) -> Drawn<()>
where
    B::ErrorType: 'static,
{
    let text = |size: i32| ("sans-serif", size).into_font().color(&BLACK);
    area.draw(&Text::new(
        "Error of t (99th percentile, ulp) against time per ray. Filled: precisions of anyhit. Lower left is better.",
        (14, 10),
        text(19),
    ))?;
    let wrong = ("wrong decisions", None);
    let entries = MARKERS.into_iter().map(|(name, marker)| (name, Some(marker))).chain([wrong]);
    for (place, (name, marker)) in entries.enumerate() {
        let (x, y) = (24 + 240 * (place % 4) as i32, 52 + 28 * (place / 4) as i32);
        match marker {
            Some(marker) => marker.draw(area, (x, y))?,
            None => area.draw(&Circle::new((x, y), 10, WRONG.stroke_width(2)))?,
        }
        area.draw(&Text::new(name, (x + 18, y - 8), text(18)))?;
    }
    Ok(())
}

/// Draws a panel: times from the least to the greatest one, so that near ones are apart.
fn draw_panel<B: DrawingBackend>(
    root: &DrawingArea<B, Shift>,
    area: &DrawingArea<B, Shift>,
    panel: &Panel,
) -> Drawn<()>
where
    B::ErrorType: 'static,
{
    let times = || panel.points.iter().map(|point| point.nanoseconds);
    let (least, most) =
        times().fold((f64::MAX, 0f64), |(least, most), time| (least.min(time), most.max(time)));
    let margin = (most - least).max(0.05 * most) * 0.15;
    let (least, most) = ((least - margin).max(0.0), most + margin);
    // log10 by hand, with room for the least error that a rounded result can have.
    let height = |ulp: f64| ulp.max(0.3).log10();
    let top = panel.points.iter().fold(1f64, |top, point| top.max(height(point.p99))).ceil() + 0.3;
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.scene, ("sans-serif", 19))
        .margin(10)
        .margin_right(20)
        .x_label_area_size(44)
        .y_label_area_size(58)
        .build_cartesian_2d(least..most, -0.7f64..top)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(0xDD, 0xDD, 0xDD))
        .x_labels(5)
        .y_labels(top as usize + 2)
        .label_style(("sans-serif", 17))
        .axis_desc_style(("sans-serif", 17))
        .x_desc("ns per ray")
        .y_desc("ulp")
        .x_label_formatter(&|x| format!("{}", (x * 10.0).round() / 10.0))
        .y_label_formatter(&|y| match y.fract().abs() < 1e-6 && *y >= 0.0 {
            true => power_of_ten(y.round() as i32),
            false => String::new(),
        })
        .draw()?;
    // Half a unit: nothing can be nearer.
    chart.draw_series(std::iter::once(PathElement::new(
        vec![(least, height(0.5)), (most, height(0.5))],
        RGBColor(0x99, 0x99, 0x99),
    )))?;
    // The engine's own modes come last, above all others.
    for (name, marker) in MARKERS.into_iter().rev() {
        for point in panel.points.iter().filter(|point| point.name == name) {
            let at = chart.backend_coord(&(point.nanoseconds, height(point.p99)));
            marker.draw(root, at)?;
            if point.is_wrong {
                root.draw(&Circle::new(at, 10, WRONG.stroke_width(2)))?;
            }
        }
    }
    Ok(())
}
