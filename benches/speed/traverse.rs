//! Benchmarks of traversal and intersection alone, on one thread, and of their scaling.

use anyhit_engine::accel::{Counters, Cursor, GeometryFlags, Packet, RayFlags, Tlas, TraceRay};
use anyhit_engine::geometry::Ray;

use crate::scenes::{self, Scene};
use crate::table::Table;

/// Traces rays one by one; returns the number of hits and a description of the work for each ray.
fn trace(tlas: &Tlas, traces: &[TraceRay]) -> (u64, String) {
    let any = ends_at_any_hit(traces);
    let mut cursor = Cursor::new(tlas, traces[0]);
    let mut hits = 0;
    if tlas.is_fully_opaque(traces[0].flags) {
        hits = traces.iter().filter(|trace| cursor.trace_opaque(tlas, trace, any).is_some()).count() as u64;
    } else {
        for trace in traces {
            cursor.reset(tlas, *trace);
            while cursor.proceed(tlas).is_some() {}
            hits += u64::from(cursor.committed().is_some());
        }
    }
    let mut counters = Counters::default();
    let sample = traces.iter().step_by(traces.len().div_ceil(2000));
    let sampled = sample.clone().count() as f64;
    for trace in sample {
        cursor.reset(tlas, *trace);
        while cursor.proceed_observed(tlas, &mut counters).is_some() {}
    }
    let each = |count: u64| count as f64 / sampled;
    let note = format!(
        "{:.1} nodes, {:.1} tests a ray, {:.0} % hit",
        each(counters.nodes),
        each(counters.primitives),
        100.0 * hits as f64 / traces.len() as f64
    );
    (hits, note)
}

/// Traces rays in packets of 64.
fn trace_packets(tlas: &Tlas, traces: &[TraceRay]) -> (u64, String) {
    let any = ends_at_any_hit(traces);
    let (mut packet, mut found) = (Packet::default(), Vec::new());
    let mut hits = 0;
    for traces in traces.chunks(64) {
        assert!(packet.trace(tlas, traces, any, &mut found), "no shader decides");
        hits += found.iter().flatten().count() as u64;
    }
    (hits, format!("{:.0} % hit", 100.0 * hits as f64 / traces.len() as f64))
}

/// Whether any hit ends these rays.
fn ends_at_any_hit(traces: &[TraceRay]) -> bool {
    traces[0].flags.contains(RayFlags::TERMINATE_ON_FIRST_HIT)
}

/// The rays of a picture, those of a tile of 8 x 8 pixels one after the other, as launches have
/// them.
fn tiles(scene: &Scene, [width, height]: [u32; 2]) -> Vec<Ray> {
    let rays = scene.camera.rays([width, height]);
    let tiles = (0..height).step_by(8).flat_map(|y| (0..width).step_by(8).map(move |x| (x, y)));
    let pixels = tiles.flat_map(|(x, y)| (0..64u32).map(move |at| (x + at % 8, y + at / 8)));
    pixels.filter(|&(x, y)| x < width && y < height).map(|(x, y)| rays[(y * width + x) as usize]).collect()
}

pub fn run(table: &mut Table) {
    let table = &*table;
    let row = |name: &str, flags: RayFlags, make: &dyn Fn() -> Scene| {
        let together = format!("{name} together");
        // Packets do not trace boxes, as shaders decide about them.
        if table.wants(&together) && name != "traverse boxes" {
            let scene = make();
            let tlas = scene.tlas(GeometryFlags::OPAQUE);
            measure_with(table, &together, &tlas, &tiles(&scene, table.picture), flags, trace_packets);
        }
        if table.wants(name) {
            let scene = make();
            measure(
                table,
                name,
                &scene.tlas(GeometryFlags::OPAQUE),
                &scene.camera.rays(table.picture),
                flags,
            );
        }
    };
    let (grid, many, blades) = (table.size(256, 8), table.size(10_000, 50), table.size(30_000, 50));
    let (every, any) = (RayFlags::default(), RayFlags::TERMINATE_ON_FIRST_HIT);
    row("traverse triangles", every, &|| scenes::heightfield(grid));
    row("traverse splinters", every, &|| scenes::splinters(blades));
    row("traverse spheres", every, &|| scenes::spheres(many));
    row("traverse boxes", every, &|| scenes::boxes(many));
    row("traverse swept spheres", every, &|| scenes::meadow(blades));
    row("traverse triangles any hit", any, &|| scenes::heightfield(grid));
    if table.wants("traverse 64 instances") {
        let scene = scenes::heightfield(grid);
        measure(table, "traverse 64 instances", &scene.tiled(), &scene.camera.rays(table.picture), every);
    }
    if table.wants("traverse 64 instances together") {
        let scene = scenes::heightfield(grid);
        let rays = tiles(&scene, table.picture);
        let name = "traverse 64 instances together";
        measure_with(table, name, &scene.tiled(), &rays, every, trace_packets);
    }
    // Rays that go nowhere, as a total internal reflection makes that nobody handles: origins on
    // the ground, all among the boxes of the tree.
    for (name, trace) in [
        ("direction zero, triangles", trace as TraceFn),
        ("direction zero, triangles together", trace_packets),
    ] {
        if table.wants(name) {
            let scene = scenes::heightfield(grid);
            let rays: Vec<Ray> = scene.camera.rays(table.picture).iter().map(nowhere).collect();
            measure_with(table, name, &scene.tlas(GeometryFlags::OPAQUE), &rays, every, trace);
        }
    }
    for (name, trace) in [
        ("traverse triangles shuffled together", trace_packets as TraceFn),
        ("traverse triangles shuffled", trace),
    ] {
        if table.wants(name) {
            let scene = scenes::heightfield(grid);
            let rays = scene.camera.shuffled_rays(table.picture);
            measure_with(table, name, &scene.tlas(GeometryFlags::OPAQUE), &rays, every, trace);
        }
    }
}

/// A ray from the ground below another one's way, with a direction of zero.
fn nowhere(ray: &Ray) -> Ray {
    let [x, y, z] = ray.origin;
    let down = if ray.direction[1] < 0.0 { -y / ray.direction[1] } else { 1.0 };
    let origin = [x + down * ray.direction[0], 0.0, z + down * ray.direction[2]];
    Ray { origin, direction: [0.0; 3], ..*ray }
}

/// A way to trace rays; returns the number of hits and a description.
type TraceFn = fn(&Tlas, &[TraceRay]) -> (u64, String);

/// Measures rays through a structure, one by one: millions a second.
pub fn measure(table: &Table, name: &str, tlas: &Tlas, rays: &[Ray], flags: RayFlags) -> Option<f64> {
    measure_with(table, name, tlas, rays, flags, trace)
}

/// Measures the rays of a scene's picture one by one and in packets: millions a second.
#[allow(dead_code, reason = "the comparison with peers asks for it")]
pub fn both_rates(table: &Table, tlas: &Tlas, scene: &Scene, picture: [u32; 2]) -> [f64; 2] {
    let every = RayFlags::default();
    let single = measure_with(table, "single rays", tlas, &scene.camera.rays(picture), every, trace);
    let packets = measure_with(table, "packets", tlas, &tiles(scene, picture), every, trace_packets);
    [single, packets].map(|rate| rate.unwrap_or(f64::NAN))
}

/// Measures the traversal of rays by cursors or by packets.
fn measure_with(
    table: &Table,
    name: &str,
    tlas: &Tlas,
    rays: &[Ray],
    flags: RayFlags,
    trace: TraceFn,
) -> Option<f64> {
    let operands = |ray: &Ray| TraceRay { ray: *ray, flags, cull_mask: 0xFF, time: 0.0 };
    let traces: Vec<_> = rays.iter().map(operands).collect();
    let mut hits = 0;
    let rate = table.rate(name, "rays", rays.len() as u64, || {
        let (found, note) = trace(tlas, &traces);
        hits = found;
        note
    });
    if rate.is_some() {
        table.hits(hits);
    }
    rate
}
