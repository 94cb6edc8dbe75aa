//! Traversal and intersection alone, on one thread; and how it grows.

use anyhit::accel::{Counters, Cursor, GeometryFlags, RayFlags, Tlas, TraceRay};
use anyhit::geometry::Ray;

use crate::scenes::{self, Random, Scene};
use crate::table::Table;

/// Traces rays, and says what each did on average.
fn trace(tlas: &Tlas, rays: &[Ray], flags: RayFlags) -> String {
    let query = |ray: &Ray| TraceRay { ray: *ray, flags, cull_mask: 0xFF, time: 0.0 };
    let mut cursor = Cursor::new(tlas, query(&rays[0]));
    let mut hits = 0;
    for ray in rays {
        cursor.reset(tlas, query(ray));
        if flags.contains(RayFlags::TERMINATE_ON_FIRST_HIT) {
            cursor.end_at_any_opaque_hit();
        }
        while cursor.proceed(tlas).is_some() {}
        hits += u64::from(cursor.committed().is_some());
    }
    let mut counters = Counters::default();
    let sample = rays.iter().step_by(rays.len().div_ceil(2000));
    let sampled = sample.clone().count() as f64;
    for ray in sample {
        cursor.reset(tlas, query(ray));
        while cursor.proceed_with(tlas, &mut counters).is_some() {}
    }
    let each = |count: u64| count as f64 / sampled;
    format!(
        "{:.1} nodes, {:.1} tests a ray, {:.0} % hit",
        each(counters.nodes),
        each(counters.primitives),
        100.0 * hits as f64 / rays.len() as f64
    )
}

pub fn run(table: &mut Table) {
    let size = table.size([512, 384], [8, 6]);
    let row = |name: &str, make: &dyn Fn() -> Scene| {
        if !table.wants(name) {
            return;
        }
        let scene = make();
        let tlas = scene.tlas(GeometryFlags::OPAQUE);
        let rays = scene.camera.rays(size);
        table.rate(name, "rays", rays.len() as u64, || trace(&tlas, &rays, RayFlags::default()));
    };
    let (grid, many, blades) = (table.size(256, 8), table.size(10_000, 50), table.size(30_000, 50));
    row("traverse triangles", &|| scenes::heightfield(grid));
    row("traverse spheres", &|| scenes::spheres(many));
    row("traverse boxes", &|| scenes::boxes(many));
    row("traverse swept spheres", &|| scenes::meadow(blades));
    if table.wants_any("traverse") {
        let scene = scenes::heightfield(grid);
        let mut rays = scene.camera.rays(size);
        let count = rays.len() as u64;
        let tlas = scene.tlas(GeometryFlags::OPAQUE);
        let any = RayFlags::TERMINATE_ON_FIRST_HIT;
        table.rate("traverse triangles any hit", "rays", count, || trace(&tlas, &rays, any));
        let tiled = scene.tiled();
        table.rate("traverse 64 instances", "rays", count, || trace(&tiled, &rays, RayFlags::default()));
        let mut random = Random(3);
        for at in (1..rays.len()).rev() {
            rays.swap(at, (random.bits() % (at as u64 + 1)) as usize);
        }
        table.rate("traverse triangles shuffled", "rays", count, || trace(&tlas, &rays, RayFlags::default()));
    }
    for cells in table.size(vec![7, 22, 71, 224, 707], vec![4]) {
        let name = format!("growth traverse {} triangles", 2 * cells * cells);
        row(&name, &|| scenes::heightfield(cells));
    }
}
