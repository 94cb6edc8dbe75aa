//! Draws the plot: one panel for each scene, time to the right, error upwards; lower left is
//! better.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;

/// One contender in one scene.
pub struct Point {
    pub name: &'static str,
    pub nanoseconds: f64,
    /// p99 in ulp.
    pub p99: f64,
    /// Share of wrong decisions.
    pub wrong: f64,
}

/// A scene's contenders.
pub struct Panel {
    pub scene: &'static str,
    pub points: Vec<Point>,
}

const COLUMNS: usize = 3;

type Drawn<T> = Result<T, Box<dyn std::error::Error>>;

pub fn draw(path: &Path, panels: &[Panel], names: &[&'static str]) -> Drawn<()> {
    let rows = panels.len().div_ceil(COLUMNS);
    let size = (1080, 90 + 270 * rows as u32);
    let area = SVGBackend::new(path, size).into_drawing_area();
    area.fill(&WHITE)?;
    let (legend, body) = area.split_vertically(90);
    draw_legend(&legend, names)?;
    for (panel, cell) in panels.iter().zip(body.split_evenly((rows, COLUMNS))) {
        draw_panel(&cell, panel, names)?;
    }
    area.present()?;
    Ok(())
}

fn colour(names: &[&str], name: &str) -> RGBColor {
    const COLOURS: [RGBColor; 11] = [
        RGBColor(0xD5, 0x5E, 0x00),
        RGBColor(0x00, 0x72, 0xB2),
        RGBColor(0x56, 0xB4, 0xE9),
        RGBColor(0x00, 0x9E, 0x73),
        RGBColor(0x8C, 0x56, 0x4B),
        RGBColor(0xE6, 0x9F, 0x00),
        RGBColor(0xCC, 0x79, 0xA7),
        RGBColor(0x7F, 0x7F, 0x7F),
        RGBColor(0x6A, 0x3D, 0x9A),
        RGBColor(0xB2, 0xA1, 0x1E),
        RGBColor(0x11, 0x11, 0x11),
    ];
    let place = names.iter().position(|other| *other == name).unwrap_or(0);
    COLOURS[place % COLOURS.len()]
}

fn draw_legend<B: DrawingBackend>(area: &DrawingArea<B, Shift>, names: &[&'static str]) -> Drawn<()>
where
    B::ErrorType: 'static,
{
    let text = ("sans-serif", 14).into_font().color(&BLACK);
    area.draw(&Text::new(
        "Error of t (99th percentile, units in the last place) against time per ray; a ring: wrong decisions",
        (14, 8),
        ("sans-serif", 15).into_font().color(&BLACK),
    ))?;
    for (place, name) in names.iter().enumerate() {
        let (x, y) = (20 + 178 * (place % 6) as i32, 40 + 24 * (place / 6) as i32);
        area.draw(&Circle::new((x, y + 6), 6, colour(names, name).filled()))?;
        area.draw(&Text::new(*name, (x + 12, y - 1), text.clone()))?;
    }
    Ok(())
}

fn draw_panel<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    panel: &Panel,
    names: &[&'static str],
) -> Drawn<()>
where
    B::ErrorType: 'static,
{
    let most = panel.points.iter().fold(0f64, |a, p| a.max(p.nanoseconds)) * 1.12;
    // log10 by hand, with room for the least error there can be.
    let height = |ulp: f64| ulp.max(0.3).log10();
    let top = panel.points.iter().fold(1f64, |a, p| a.max(height(p.p99))).ceil() + 0.3;
    let mut chart = ChartBuilder::on(area)
        .caption(panel.scene, ("sans-serif", 15))
        .margin(10)
        .x_label_area_size(34)
        .y_label_area_size(52)
        .build_cartesian_2d(0f64..most, -0.7f64..top)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_labels(5)
        .y_labels(7)
        .x_desc("ns per ray")
        .y_desc("ulp")
        .y_label_formatter(&|y| {
            if y.fract().abs() < 1e-6 && *y >= 0.0 { format!("{}", 10f64.powf(*y)) } else { String::new() }
        })
        .draw()?;
    // Half a unit: nothing can be nearer.
    chart.draw_series(std::iter::once(PathElement::new(
        vec![(0.0, height(0.5)), (most, height(0.5))],
        RGBColor(0xBB, 0xBB, 0xBB),
    )))?;
    for point in &panel.points {
        let colour = colour(names, point.name);
        let at = (point.nanoseconds, height(point.p99));
        chart.draw_series(std::iter::once(Circle::new(at, 5, colour.filled())))?;
        if point.wrong > 0.0 {
            chart.draw_series(std::iter::once(Circle::new(at, 9, colour.stroke_width(2))))?;
        }
    }
    Ok(())
}
