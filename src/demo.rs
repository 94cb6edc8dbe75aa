//! The swept-spheres scene, embedded, so that a bare `anyhit trace-one-ray` works from any folder.

use std::path::Path;

use anyhit_base::error::Result;
use anyhit_scene::files::EmbeddedFiles;
use anyhit_scene::resolve::{LoadOptions, load};
use anyhit_scene::resolved::ResolvedScene;

/// The scene's path among [`FILES`].
pub const PATH: &str = "scenes/swept-spheres.toml";

/// The scene with everything that it names, and what its shaders were compiled from, by path from
/// the crate's root.
pub const FILES: EmbeddedFiles<'static> = {
    macro_rules! embedded {
        ($($path:literal)*) => {
            EmbeddedFiles(&[$(($path, include_bytes!(concat!("../", $path)))),*])
        };
    }
    embedded! {
        "scenes/swept-spheres.toml"
        "scenes/swept-spheres-geometry.toml"
        "shaders/demo/swept-spheres/palette.png"
        "spirv-fixtures/demo/swept-spheres/main.rgen.spv"
        "spirv-fixtures/demo/swept-spheres/sky.rmiss.spv"
        "spirv-fixtures/demo/swept-spheres/shadow.rmiss.spv"
        "spirv-fixtures/demo/swept-spheres/grass.rchit.spv"
        "spirv-fixtures/demo/swept-spheres/spheres.rchit.spv"
        "spirv-fixtures/demo/swept-spheres/chains.rchit.spv"
        "spirv-fixtures/demo/swept-spheres/ground.rchit.spv"
        "shaders/demo/swept-spheres/main.rgen"
        "shaders/demo/swept-spheres/sky.rmiss"
        "shaders/demo/swept-spheres/shadow.rmiss"
        "shaders/demo/swept-spheres/grass.rchit"
        "shaders/demo/swept-spheres/spheres.rchit"
        "shaders/demo/swept-spheres/chains.rchit"
        "shaders/demo/swept-spheres/ground.rchit"
        "shaders/demo/swept-spheres/normals.glsl"
        "shaders/demo/swept-spheres/scene.glsl"
        "shaders/demo/swept-spheres/shade.glsl"
    }
};

/// Reads the embedded scene.
///
/// # Errors
/// As [`load`] where the options do not suit the scene.
pub fn scene(options: &LoadOptions) -> Result<ResolvedScene> {
    load(Path::new(PATH), &FILES, options)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::accel::{Cursor, EndCaps, GeometryData, Indexing, RayFlags, TraceRay};
    use anyhit_engine::geometry::Ray;
    use anyhit_engine::module::interface::Stage;
    use anyhit_scene::DiskFiles;
    use anyhit_scene::file::RayEntry;
    use anyhit_scene::resolved::{ResolvedGroup, ResolvedShader, ShaderCode};

    fn slang() -> ResolvedScene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/swept-spheres-slang.toml");
        load(&path, &DiskFiles, &LoadOptions::default()).unwrap()
    }

    #[test]
    fn the_scene_is_what_the_tutorial_describes() {
        let scene = scene(&LoadOptions::default()).unwrap();
        let instances = scene.tlas[0].1.instances();
        let data: Vec<&GeometryData> = instances.iter().map(|i| &i.blas.geometries()[0].data).collect();
        let [
            GeometryData::LinearSweptSpheres { positions, indices: None, indexing: Indexing::List, .. },
            GeometryData::Spheres { radii, .. },
            GeometryData::LinearSweptSpheres {
                indices: Some(chains),
                indexing: Indexing::Successive,
                end_caps: EndCaps::Chained,
                ..
            },
            GeometryData::Triangles { .. },
        ] = data[..]
        else {
            panic!("{} instances", data.len())
        };
        assert_eq!((positions.len(), radii.len(), chains.len()), (60_000, 10, 80));
        let offsets: Vec<u32> = instances.iter().map(|instance| instance.sbt_record_offset).collect();
        assert_eq!(offsets, [0, 1, 2, 3]);
        // view_inverse, projection_inverse and the sun: 64 + 64 + 16 bytes of std140.
        let camera = scene.resources[2].resource.data().unwrap().bytes().unwrap();
        assert_eq!(camera.len(), 144);
    }

    #[test]
    fn the_embedded_scene_is_the_one_on_disk() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(PATH);
        let disk = load(&path, &DiskFiles, &LoadOptions::default()).unwrap();
        let embedded = scene(&LoadOptions::default()).unwrap();
        let codes = |scene: &ResolvedScene| -> Vec<ShaderCode> {
            scene.shaders.iter().map(|module| module.code.clone()).collect()
        };
        assert_eq!(codes(&disk), codes(&embedded));
        assert_eq!(disk.pipeline.groups.len(), embedded.pipeline.groups.len());
    }

    #[test]
    fn both_scenes_name_entry_points_that_exist() {
        for scene in [scene(&LoadOptions::default()).unwrap(), slang()] {
            let records = [
                scene.pipeline.sbt.raygen.len(),
                scene.pipeline.sbt.miss.len(),
                scene.pipeline.sbt.hit.len(),
            ];
            assert_eq!(records, [1, 2, 4]);
            let has = |shader: &ResolvedShader, stage: Stage| {
                let ShaderCode::SpirV(bytes) = &scene.shaders[shader.module].code else { panic!() };
                let module = anyhit_engine::module::load(bytes).unwrap();
                let entry = |e: &&_| matches_entry(e, &shader.entry, stage);
                assert!(module.entry_points.iter().any(|e| entry(&e)), "{} {stage:?}", shader.entry);
            };
            for group in &scene.pipeline.groups {
                match group {
                    ResolvedGroup::RayGeneration(shader) => has(shader, Stage::RayGeneration),
                    ResolvedGroup::Miss(shader) => has(shader, Stage::Miss),
                    ResolvedGroup::Callable(shader) => has(shader, Stage::Callable),
                    ResolvedGroup::Hit(group) => has(group.closest_hit.as_ref().unwrap(), Stage::ClosestHit),
                }
            }
        }
    }

    fn matches_entry(entry: &anyhit_engine::module::interface::EntryPoint, name: &str, stage: Stage) -> bool {
        entry.name == name && entry.stage == stage
    }

    /// The instance that the ray through the centre of a pixel hits first, by the arithmetic of
    /// the ray-generation shader in f32.
    fn seen(scene: &ResolvedScene, [x, y]: [u32; 2]) -> Option<u32> {
        let bytes = scene.resources[2].resource.data().unwrap().bytes().unwrap();
        let m: Vec<f32> = bytes.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        let times = |m: &[f32], v: [f32; 4]| -> [f32; 4] {
            std::array::from_fn(|row| (0..4).map(|column| m[4 * column + row] * v[column]).sum())
        };
        let clip = |at: u32, size: u32| 2.0 * (at as f32 + 0.5) / size as f32 - 1.0;
        let target = times(&m[16..32], [clip(x, scene.launch[0]), clip(y, scene.launch[1]), 1.0, 1.0]);
        let direction = times(&m[..16], [target[0], target[1], target[2], 0.0]);
        let origin = [m[12], m[13], m[14]];
        let ray = Ray::new(origin, [direction[0], direction[1], direction[2]]);
        let tlas = &scene.tlas[0].1;
        let mut cursor = Cursor::new(tlas, TraceRay { ray, flags: RayFlags(0), cull_mask: 0xff, time: 0.0 });
        assert!(cursor.proceed(tlas).is_none(), "everything is opaque");
        cursor.committed().map(|committed| committed.candidate.instance)
    }

    #[test]
    fn the_picture_shows_everything_and_the_ray_meets_a_chain() {
        let scene = scene(&LoadOptions::default()).unwrap();
        let mut counts = [0; 5];
        for y in (0..540).step_by(12) {
            for x in (0..960).step_by(12) {
                counts[seen(&scene, [x, y]).map_or(4, |instance| instance as usize)] += 1;
            }
        }
        // Of 3600 rays: grass, spheres, chains, ground, sky.
        assert!(counts.iter().all(|count| *count >= 20), "{counts:?}");
        let RayEntry::Pixel { pixel, .. } = &scene.rays[0] else { panic!() };
        assert_eq!(seen(&scene, pixel.value), Some(2));
    }
}
