//! The peer obvhs, a crate of BVH builders: its BVH2 and its triangles in a plain loop.

use std::time::Duration;

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::ray::{Ray, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

use anyhit_engine::accel::GeometryData;

use crate::scene_files::PICTURE;
use crate::scenes;
use crate::table::{Measured, Table};

/// Measures rays over the terrain.
pub fn triangles() -> Measured {
    let scene = scenes::heightfield(256);
    let GeometryData::Triangles { vertices, .. } = &scene.data else { unreachable!("a scene of triangles") };
    let corner = |index: u32| Vec3A::from_array(vertices[index as usize]);
    let triangles: Vec<Triangle> = scene
        .indices()
        .chunks_exact(3)
        .map(|corners| Triangle { v0: corner(corners[0]), v1: corner(corners[1]), v2: corner(corners[2]) })
        .collect();
    let mut took = Duration::ZERO;
    let tree = build_bvh2_from_tris(&triangles, BvhBuildParams::medium_build(), &mut took);
    let leaves: Vec<RtTriangle> =
        tree.primitive_indices.iter().map(|&at| RtTriangle::from(&triangles[at as usize])).collect();
    let rays: Vec<Ray> = scene
        .camera
        .rays(PICTURE)
        .iter()
        .map(|ray| Ray::new(ray.origin.into(), ray.direction.into(), 0.0, 1e30))
        .collect();
    let mut hits = 0;
    let table = Table::of_one("obvhs", PICTURE);
    table.rate("obvhs", "rays", rays.len() as u64, || {
        hits = 0;
        for &ray in &rays {
            let mut hit = RayHit::none();
            tree.ray_traverse(ray, &mut hit, |ray, at| leaves[at].intersect(ray));
            hits += u64::from(hit.primitive_id != u32::MAX);
        }
        String::new()
    });
    table.hits(hits);
    table.into_last().expect("a row")
}
