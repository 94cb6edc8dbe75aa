//! Writes the scenes and shaders as files that the peers read.
//!
//! `SHARE/scenes/NAME/` holds little-endian numbers: `inputs` (what the shaders read of the
//! camera), `rays` (origin, tmin, direction, tmax), `transforms` (three rows of four a matrix), and
//! of `vertices`, `normals`, `indices`, `spheres` (centre and radius), `ends` (two spheres a
//! primitive) and `boxes` (corners) what the scene has.

use std::path::Path;

use anyhit_engine::accel::GeometryData;
use anyhit_engine::geometry::Ray;

use crate::scenes::{self, Scene};

/// The size of the pictures.
pub const PICTURE: [u32; 2] = [1024, 768];

/// Writes all of them below `share`.
pub fn write(share: &Path) {
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let terrain = scenes::heightfield(256);
    scene(&share.join("scenes/terrain"), &terrain, &[identity]);
    let shuffled = share.join("scenes/terrain-shuffled");
    scene(&shuffled, &terrain, &[identity]);
    rays(&shuffled, &terrain.camera.shuffled_rays(PICTURE));
    scene(&share.join("scenes/tiled"), &terrain, &scenes::tiles(8).collect::<Vec<_>>());
    let spheres = share.join("scenes/spheres");
    scene(&spheres, &scenes::spheres(10_000), &[identity]);
    boxes(&spheres, &scenes::boxes(10_000));
    let meadow = share.join("scenes/meadow");
    scene(&meadow, &scenes::meadow(30_000), &[identity]);
    boxes(&meadow, &scenes::meadow_boxes(30_000));
    let shaders = share.join("shaders");
    std::fs::create_dir_all(&shaders).expect("a folder");
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/bench");
    for entry in std::fs::read_dir(fixtures).expect("the fixtures") {
        let path = entry.expect("an entry").path();
        std::fs::copy(&path, shaders.join(path.file_name().expect("a name"))).expect("a copy");
    }
}

/// Writes a scene that is placed once, in place of what the folder held.
pub fn write_scene(folder: &Path, one: &Scene) {
    // A scene of another kind leaves other files.
    let _ = std::fs::remove_dir_all(folder);
    scene(folder, one, &[[[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]]);
}

fn scene(folder: &Path, scene: &Scene, transforms: &[[[f32; 4]; 3]]) {
    std::fs::create_dir_all(folder).expect("a folder");
    let file = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).expect("a file");
    file("inputs", bytemuck::cast_slice(&scene.camera.inputs()));
    rays(folder, &scene.camera.rays(PICTURE));
    file("transforms", bytemuck::cast_slice(transforms));
    match &scene.data {
        GeometryData::Triangles { vertices, .. } => {
            file("vertices", bytemuck::cast_slice(vertices));
            file("normals", bytemuck::cast_slice(&scene.normals));
            file("indices", bytemuck::cast_slice(scene.indices()));
        }
        GeometryData::Spheres { .. } => file("spheres", bytemuck::cast_slice(&scene.spheres)),
        _ => file("ends", bytemuck::cast_slice(&scene.spheres)),
    }
}

fn rays(folder: &Path, rays: &[Ray]) {
    let rays: Vec<[f32; 8]> = rays
        .iter()
        .map(|ray| {
            let ([x, y, z], [dx, dy, dz]) = (ray.origin, ray.direction);
            [x, y, z, 0.0, dx, dy, dz, 1e30]
        })
        .collect();
    std::fs::write(folder.join("rays"), bytemuck::cast_slice(&rays)).expect("a file");
}

fn boxes(folder: &Path, scene: &Scene) {
    let GeometryData::Aabbs(boxes) = &scene.data else { unreachable!("a scene of boxes") };
    std::fs::write(folder.join("boxes"), bytemuck::cast_slice(boxes)).expect("a file");
}
