//! Scaling benchmarks: building and tracing with primitives and instances, loading and lowering
//! with instructions. All of it together also records its values in `benches/speed/growth.tsv`, and
//! draws `docs/growth.svg`.

use std::fmt::Write as _;
use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;

use anyhit_engine::accel::RayFlags;

use crate::figure::{Drawn, Marker, MarkerShape, field, power_of_ten, recorded};
use crate::ready::{build, load_and_lower};
use crate::table::Table;
use crate::traverse::measure;
use crate::{scenes, synthetic};

/// A line in a panel of the figure: a name, and for each size the cost.
type Series = (String, Vec<(f64, f64)>);

/// A panel: the cost, the size, and its lines.
type Panel = (&'static str, &'static str, Vec<Series>);

/// Costs and sizes of the panels.
const PANELS: [(&str, &str); 3] = [
    ("ms to build", "primitives or instances"),
    ("ns a ray", "primitives or instances"),
    ("ms to load and lower", "instructions"),
];

const RECORD: &str = "benches/speed/growth.tsv";

fn series(name: &str) -> Series {
    (name.to_owned(), Vec::new())
}

pub fn run(table: &Table) {
    let mut builds = series("triangles, built");
    let mut rays = series("triangles");
    // 10^7 triangles take some GiB, and half a minute to build.
    let mut cells = table.size(vec![7, 22, 71, 224, 707], vec![4]);
    if std::env::var_os("LARGE").is_some() {
        cells.push(2236);
    }
    for cells in cells {
        let count = 2 * cells * cells;
        let (building, tracing) =
            (format!("growth build {count} triangles"), format!("growth traverse {count} triangles"));
        if !table.wants(&building) && !table.wants(&tracing) {
            continue;
        }
        let scene = scenes::heightfield(cells);
        note(&mut builds, count, build(table, &building, &scene));
        let tlas = scene.tlas(anyhit_engine::accel::GeometryFlags::OPAQUE);
        let rate = measure(table, &tracing, &tlas, &scene.camera.rays(table.picture), RayFlags::default());
        note(&mut rays, count, rate.map(|rate| 1e3 / rate));
    }
    let mut placings = series("instances, placed");
    let mut through = series("instances of 128 triangles");
    for side in table.size(vec![1, 3, 10, 32, 100, 316], vec![3]) {
        let count = side * side;
        let (building, tracing) =
            (format!("growth build {count} instances"), format!("growth traverse {count} instances"));
        if !table.wants(&building) && !table.wants(&tracing) {
            continue;
        }
        let scene = scenes::heightfield(8);
        let blas = scene.blas(anyhit_engine::accel::GeometryFlags::OPAQUE);
        let took = table.time(&building, || {
            let tlas = scenes::placed(&blas, side);
            format!("{} instances", tlas.instances().len())
        });
        note(&mut placings, count, took);
        let tlas = scenes::placed(&blas, side);
        let rate = measure(table, &tracing, &tlas, &scene.camera.rays(table.picture), RayFlags::default());
        note(&mut through, count, rate.map(|rate| 1e3 / rate));
    }
    // The largest module among those of published renderers has 98,390 instructions.
    let mut lines =
        ["load, functions", "lower, functions", "load, one function", "lower, one function"].map(series);
    for count in table.size(vec![1_000, 10_000, 98_390, 300_000], vec![1_000]) {
        for (at, (name, each)) in [("functions", 400), ("one function", count)].into_iter().enumerate() {
            let name = format!("{count} instructions in {name}");
            let took = load_and_lower(table, &name, || {
                synthetic::module(count, each).iter().flat_map(|word| word.to_le_bytes()).collect()
            });
            for (line, took) in lines[2 * at..2 * at + 2].iter_mut().zip(took) {
                note(line, count as u32, took);
            }
        }
    }
    let all = [vec![builds, placings], vec![rays, through], lines.into()];
    let panels: Vec<Panel> =
        PANELS.into_iter().zip(all).map(|((cost, size), lines)| (cost, size, lines)).collect();
    let complete = panels.iter().flat_map(|panel| &panel.2).all(|(_, points)| points.len() > 1);
    if complete {
        record(&panels).expect("a file");
        draw_recorded().expect("a figure");
        println!("wrote docs/growth.svg");
    }
}

fn note(line: &mut Series, count: u32, value: Option<f64>) {
    line.1.extend(value.map(|value| (f64::from(count), value)));
}

/// Writes the values of all panels.
fn record(panels: &[Panel]) -> Drawn<()> {
    let mut text =
        "# panel, series, size, cost: written by `cargo bench --bench speed`, drawn as docs/growth.svg.\n"
            .to_owned();
    for (cost, _, lines) in panels {
        for (name, points) in lines {
            for (size, value) in points {
                writeln!(text, "{cost}\t{name}\t{size}\t{value}")?;
            }
        }
    }
    Ok(std::fs::write(Path::new(env!("CARGO_MANIFEST_DIR")).join(RECORD), text)?)
}

/// Draws the recorded values: `cargo bench --bench speed -- --draw`.
pub fn draw_recorded() -> Drawn<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut panels: Vec<Panel> = PANELS.map(|(cost, size)| (cost, size, Vec::new())).into();
    for row in recorded(&root.join(RECORD))? {
        let (cost, name): (String, String) = (field(&row, 0)?, field(&row, 1)?);
        let panel = panels.iter_mut().find(|panel| panel.0 == cost).ok_or("an unknown panel")?;
        let at = panel.2.iter().position(|line| line.0 == name).unwrap_or_else(|| {
            panel.2.push(series(&name));
            panel.2.len() - 1
        });
        panel.2[at].1.push((field(&row, 2)?, field(&row, 3)?));
    }
    let path = root.join("docs/growth.svg");
    let area = SVGBackend::new(&path, (1080, 400)).into_drawing_area();
    area.fill(&WHITE)?;
    for (panel, cell) in panels.iter().zip(area.split_evenly((1, panels.len()))) {
        draw_panel(&area, &cell, panel)?;
    }
    Ok(area.present()?)
}

/// Marks of the lines of a panel. Lines that run together differ in their strokes, too: the later
/// ones are thinner.
const MARKERS: [Marker; 4] = [
    Marker { shape: MarkerShape::Circle, colour: RGBColor(0x00, 0x72, 0xB2), is_filled: true },
    Marker { shape: MarkerShape::Square, colour: RGBColor(0xD5, 0x5E, 0x00), is_filled: true },
    Marker { shape: MarkerShape::TriangleUp, colour: RGBColor(0x00, 0x00, 0x00), is_filled: false },
    Marker { shape: MarkerShape::Cross, colour: RGBColor(0xB0, 0x52, 0x86), is_filled: false },
];
const STROKES: [u32; 4] = [4, 4, 1, 1];

/// Draws a panel with two logarithmic axes, in which linear growth is a line of slope 1: its title
/// and the names of its lines, and below them the curves.
fn draw_panel<B: DrawingBackend>(
    root: &DrawingArea<B, Shift>,
    area: &DrawingArea<B, Shift>,
    (cost, size, lines): &Panel,
) -> Drawn<()>
where
    B::ErrorType: 'static,
{
    let (header, body) = area.split_vertically(76);
    header.draw(&Text::new(*cost, (14, 8), ("sans-serif", 21).into_font().color(&BLACK)))?;
    // Two columns where there are four lines.
    let rows = lines.len().div_ceil(2).max(2);
    for (at, ((name, _), marker)) in lines.iter().zip(MARKERS).enumerate() {
        let (x, y) = (14 + 172 * (at / rows) as i32, 42 + 20 * (at % rows) as i32);
        let stroke = marker.colour.stroke_width(STROKES[at]);
        header.draw(&PathElement::new(vec![(x, y), (x + 26, y)], stroke))?;
        marker.draw(&header, (x + 13, y))?;
        let text = ("sans-serif", 17).into_font().color(&BLACK);
        header.draw(&Text::new(name.as_str(), (x + 32, y - 7), text))?;
    }
    let points = || lines.iter().flat_map(|(_, points)| points);
    // Axes count powers of ten, as labels at whole ones are wanted.
    let span = |part: fn(&(f64, f64)) -> f64| {
        let values = points().map(part);
        let (low, high) = values.fold((f64::MAX, 0f64), |(low, high), x| (low.min(x), high.max(x)));
        low.log10().floor()..high.log10().ceil()
    };
    let (across, up) = (span(|point| point.0), span(|point| point.1));
    let label = |exponent: &f64| match exponent.fract().abs() < 1e-6 {
        true => power_of_ten(exponent.round() as i32),
        false => String::new(),
    };
    let mut chart = ChartBuilder::on(&body)
        .margin(12)
        .margin_right(24)
        .x_label_area_size(46)
        .y_label_area_size(58)
        .build_cartesian_2d(across.clone(), up.clone())?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(0xDD, 0xDD, 0xDD))
        .x_labels((across.end - across.start) as usize + 1)
        .y_labels((up.end - up.start) as usize + 1)
        .x_label_formatter(&label)
        .y_label_formatter(&label)
        .label_style(("sans-serif", 17))
        .axis_desc_style(("sans-serif", 17))
        .x_desc(*size)
        .draw()?;
    for ((_, points), (marker, stroke)) in lines.iter().zip(MARKERS.into_iter().zip(STROKES)) {
        let at: Vec<_> = points.iter().map(|(size, cost)| (size.log10(), cost.log10())).collect();
        chart.draw_series(LineSeries::new(at.iter().copied(), marker.colour.stroke_width(stroke)))?;
        at.iter().try_for_each(|point| marker.draw(root, chart.backend_coord(point)))?;
    }
    Ok(())
}
