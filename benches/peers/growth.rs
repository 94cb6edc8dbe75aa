//! How the tree grows beside Embree's: time to build, memory, and rays, for more and more
//! triangles, and the memory of each kind of primitive.

use std::time::Instant;

use anyhit_engine::accel::GeometryFlags;

use crate::installed::{Installed, Printed};
use crate::scene_files::{PICTURE, write_scene};
use crate::scenes::{self, Scene};
use crate::table::Table;
use crate::{clock, traverse};

/// Sides of the heightfields, of two triangles a cell.
const SIDES: [u32; 6] = [22, 71, 224, 707, 2236, 7072];

/// What is measured of one scene, here or there.
struct Figures {
    /// Processor time and wall time of the build, in milliseconds.
    build: [f64; 2],
    /// Bytes of geometry and tree.
    bytes: f64,
    /// Millions of rays a second of processor time, one at a time and in packets.
    rates: [f64; 2],
}

/// Prints the tables; heightfields have up to so many triangles.
///
/// # Errors
/// Where Embree's program does not run.
pub fn run(installed: &Installed, most: u32) -> Result<(), String> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    println!("Builds by {threads} threads, rays by one. Here / Embree:\n");
    println!(
        "| triangles | build, ms of CPU time | build, ms | bytes a triangle | single Mrays/s | packets, Mrays/s |"
    );
    println!("|---|---|---|---|---|---|");
    for side in SIDES.into_iter().filter(|side| 2 * side * side <= most) {
        let scene = scenes::heightfield(side);
        let count = 2 * side * side;
        let here = here(&scene, count);
        let there = there(installed, &scene, threads)?;
        print_row(count, &here, &there);
    }
    println!("\n| primitives | bytes a primitive here | Embree | ratio |");
    println!("|---|---|---|---|");
    let kinds: [(&str, u32, Scene); 3] = [
        ("131,072 triangles", 131_072, scenes::heightfield(256)),
        ("10,000 spheres", 10_000, scenes::spheres(10_000)),
        ("30,090 linear swept spheres", 30_090, scenes::meadow(30_000)),
    ];
    for (name, count, scene) in &kinds {
        write_scene(&installed.share.join("scenes/growth"), scene);
        let printed = installed.embree(&["/share/scenes/growth", "0", "1"])?;
        let each = |bytes: f64| bytes / f64::from(*count);
        let (here, there) =
            (each(scene.built(GeometryFlags::OPAQUE).memory_size() as f64), each(number(&printed, "bytes")?));
        println!("| {name} | {here:.0} | {there:.0} | {:.2} |", here / there);
    }
    Ok(())
}

fn print_row(count: u32, here: &Figures, there: &Figures) {
    let each = |figures: &Figures| figures.bytes / f64::from(count);
    println!(
        "| {count} | {:.1} / {:.1} | {:.1} / {:.1} | {:.0} / {:.0} | {:.2} / {:.2} | {:.2} / {:.2} |",
        here.build[0],
        there.build[0],
        here.build[1],
        there.build[1],
        each(here),
        each(there),
        here.rates[0],
        there.rates[0],
        here.rates[1],
        there.rates[1],
    );
}

fn here(scene: &Scene, count: u32) -> Figures {
    let runs = if count < 1_000_000 { 7 } else { 1 };
    let mut builds: Vec<[f64; 2]> = (0..runs)
        .map(|_| {
            // As there, the data is copied before, and all of it is dropped behind.
            let tlas = scene.tlas(GeometryFlags::OPAQUE);
            let (cpu, wall) = (clock::process(), Instant::now());
            scene.build(&tlas);
            [clock::process() - cpu, wall.elapsed()].map(|time| 1e3 * time.as_secs_f64())
        })
        .collect();
    builds.sort_by(|a, b| a[1].total_cmp(&b[1]));
    let tlas = scene.tlas(GeometryFlags::OPAQUE);
    let rates = traverse::both_rates(&Table::new(true, None), &tlas, scene, PICTURE);
    // The rays have built it.
    let bytes = tlas.instances()[0].blas.memory_size() as f64;
    Figures { build: builds[builds.len() / 2], bytes, rates }
}

fn there(installed: &Installed, scene: &Scene, threads: usize) -> Result<Figures, String> {
    write_scene(&installed.share.join("scenes/growth"), scene);
    let run = |rays: &str| installed.embree(&["/share/scenes/growth", rays, &threads.to_string()]);
    let built = run("0")?;
    let rate = |rays: &str| number(&run(rays)?, "rate");
    Ok(Figures {
        build: [number(&built, "build")?, number(&built, "wall")?],
        bytes: number(&built, "bytes")?,
        rates: [rate("1")?, rate("8")?],
    })
}

fn number(printed: &Printed, name: &str) -> Result<f64, String> {
    printed.get(name).copied().ok_or_else(|| format!("no `{name}` in {printed:?}"))
}
