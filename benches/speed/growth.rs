//! Scaling benchmarks: building and tracing with primitives and instances, loading and lowering
//! with instructions. All of it together also draws `docs/growth.svg`.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;

use anyhit_engine::accel::RayFlags;

use crate::ready::{build, load_and_lower};
use crate::table::Table;
use crate::traverse::measure;
use crate::{scenes, synthetic};

/// A line in a panel of the picture: a name, and for each size the cost.
type Series = (&'static str, Vec<(f64, f64)>);

pub fn run(table: &Table) {
    let mut builds: Series = ("triangles, built", Vec::new());
    let mut rays: Series = ("triangles", Vec::new());
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
    let mut placings: Series = ("instances, placed", Vec::new());
    let mut through: Series = ("instances of 128 triangles", Vec::new());
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
    let mut lines: [Series; 4] = [
        ("load, functions", Vec::new()),
        ("lower, functions", Vec::new()),
        ("load, one function", Vec::new()),
        ("lower, one function", Vec::new()),
    ];
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
    let [a, b, c, d] = lines;
    let panels = [
        ("ms to build", "primitives or instances", vec![builds, placings]),
        ("ns a ray", "primitives or instances", vec![rays, through]),
        ("ms to load and lower", "instructions", vec![a, b, c, d]),
    ];
    let complete = panels.iter().flat_map(|panel| &panel.2).all(|(_, points)| points.len() > 1);
    if complete {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/growth.svg");
        draw(&path, &panels).expect("a picture");
        println!("wrote docs/growth.svg");
    }
}

fn note(line: &mut Series, count: u32, value: Option<f64>) {
    line.1.extend(value.map(|value| (f64::from(count), value)));
}

type DrawResult<T> = Result<T, Box<dyn std::error::Error>>;
type Panel = (&'static str, &'static str, Vec<Series>);

fn draw(path: &Path, panels: &[Panel]) -> DrawResult<()> {
    let area = SVGBackend::new(path, (1080, 330)).into_drawing_area();
    area.fill(&WHITE)?;
    for (panel, cell) in panels.iter().zip(area.split_evenly((1, panels.len()))) {
        draw_panel(&cell, panel)?;
    }
    area.present()?;
    Ok(())
}

/// Draws a panel with two logarithmic axes, in which linear growth is a line of slope 1.
fn draw_panel<B: DrawingBackend>(area: &DrawingArea<B, Shift>, (cost, size, lines): &Panel) -> DrawResult<()>
where
    B::ErrorType: 'static,
{
    const COLOURS: [RGBColor; 4] = [
        RGBColor(0x00, 0x72, 0xB2),
        RGBColor(0xD5, 0x5E, 0x00),
        RGBColor(0x00, 0x9E, 0x73),
        RGBColor(0x7F, 0x7F, 0x7F),
    ];
    let points = || lines.iter().flat_map(|(_, points)| points);
    let span = |part: fn(&(f64, f64)) -> f64| {
        let values = points().map(part);
        let (low, high) = values.fold((f64::MAX, 0f64), |(low, high), x| (low.min(x), high.max(x)));
        10f64.powf(low.log10().floor())..10f64.powf(high.log10().ceil())
    };
    let mut chart = ChartBuilder::on(area)
        .caption(*cost, ("sans-serif", 15))
        .margin(10)
        .x_label_area_size(34)
        .y_label_area_size(52)
        .build_cartesian_2d(span(|point| point.0).log_scale(), span(|point| point.1).log_scale())?;
    chart.configure_mesh().light_line_style(WHITE).x_labels(6).y_labels(6).x_desc(*size).draw()?;
    for ((name, points), colour) in lines.iter().zip(COLOURS) {
        chart
            .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)).point_size(3))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 14, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE)
        .label_font(("sans-serif", 12))
        .draw()?;
    Ok(())
}
