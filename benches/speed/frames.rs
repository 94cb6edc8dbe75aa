//! Benchmarks of whole launches: shaders and traversal together.

use std::path::Path;
use std::sync::Arc;

use anyhit_engine::accel::{GeometryFlags, Tlas};
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{Compute, Launch, Pipeline, RunOptions, Stats};
use anyhit_engine::program::Program;

use crate::scenes::{self, Scene};
use crate::table::Table;

/// The shaders of a pipeline by the names of their sources, without `.rgen` and so on; empty for
/// none.
#[derive(Clone, Copy, Default)]
struct Shaders {
    ray_generation: &'static str,
    miss: &'static [&'static str],
    closest_hit: &'static str,
    any_hit: &'static str,
    intersection: &'static str,
}

const PRIMARY: Shaders = Shaders {
    ray_generation: "primary",
    miss: &["sky"],
    closest_hit: "light",
    any_hit: "",
    intersection: "",
};

pub fn program(file: &str) -> Program {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/bench").join(format!("{file}.spv"));
    let module = anyhit::Module::open(path).expect("a valid fixture");
    Program::of(&module, "main").expect("a supported fixture")
}

fn pipeline(shaders: Shaders) -> Pipeline {
    let mut builder = Pipeline::builder();
    builder =
        builder.ray_generation(program(&format!("{}.rgen", shaders.ray_generation))).expect("ray generation");
    for miss in shaders.miss {
        builder = builder.miss(program(&format!("{miss}.rmiss"))).expect("a miss shader");
    }
    let members =
        [(shaders.closest_hit, "rchit"), (shaders.any_hit, "rahit"), (shaders.intersection, "rint")];
    let named = members.iter().filter(|(name, _)| !name.is_empty());
    builder =
        builder.hit(named.map(|(name, stage)| program(&format!("{name}.{stage}")))).expect("a hit group");
    builder.build().expect("a valid pipeline")
}

/// What the shaders read, and the buffer that they write.
fn resources(scene: &Scene, tlas: Arc<Tlas>, size: [u32; 2]) -> (Resources, Arc<Buffer>) {
    let buffer = |bytes: &[u8]| Descriptor::Buffer(Buffer::new(bytes));
    let outputs = Buffer::zeroed((size[0] * size[1] * 16) as usize);
    let resources = Resources::default()
        .bind(0, 0, Descriptor::AccelerationStructure(tlas))
        .bind(0, 1, Descriptor::Buffer(outputs.clone()))
        .bind(0, 2, buffer(bytemuck::cast_slice(&scene.camera.inputs())))
        .bind(0, 3, buffer(bytemuck::cast_slice(scene.indices())))
        .bind(0, 4, buffer(bytemuck::cast_slice(&scene.normals)))
        .bind(0, 5, buffer(bytemuck::cast_slice(&scene.spheres)));
    (resources, outputs)
}

fn describe(stats: &Stats) -> String {
    let mut text = String::new();
    for (stage, shaders) in &stats.shaders {
        let fill = shaders.invocations as f64 / shaders.batches.max(1) as f64;
        text += &format!("{} {fill:.1} lanes, ", stage.name());
    }
    text.trim_end_matches(", ").to_owned()
}

/// The number of pixels whose output marks a hit.
fn hits(outputs: &Buffer) -> u64 {
    let bytes = outputs.bytes();
    let last =
        bytes.chunks_exact(16).map(|pixel| f32::from_le_bytes([pixel[12], pixel[13], pixel[14], pixel[15]]));
    last.filter(|&t| t > 0.0).count() as u64
}

pub fn run(table: &mut Table) {
    let table = &*table;
    let size = table.picture;
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let pixels = u64::from(size[0] * size[1]);
    let frame = |name: &str, shaders: Shaders, make: &dyn Fn() -> (Scene, Arc<Tlas>)| {
        if !table.wants(name) {
            return;
        }
        let pipeline = pipeline(shaders);
        let (scene, tlas) = make();
        let (resources, outputs) = resources(&scene, tlas, size);
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        table.rate(name, "pixels", pixels, || {
            let stats =
                one.install(|| launch.run([size[0], size[1], 1], RunOptions::default()).expect("no trap"));
            describe(&stats)
        });
        table.hits(hits(&outputs));
    };
    let (opaque, asked) = (GeometryFlags::OPAQUE, GeometryFlags::default());
    let (many, blades) = (table.size(10_000, 50), table.size(30_000, 50));
    let placed = |scene: Scene, flags| {
        let tlas = scene.tlas(flags);
        (scene, tlas)
    };
    let terrain = || placed(scenes::heightfield(table.size(256, 8)), opaque);
    frame("frame arithmetic", Shaders { ray_generation: "arithmetic", ..Shaders::default() }, &terrain);
    frame("frame triangles trivial", Shaders { closest_hit: "trivial", ..PRIMARY }, &terrain);
    frame("frame triangles light", PRIMARY, &terrain);
    frame("frame triangles heavy", Shaders { closest_hit: "heavy", ..PRIMARY }, &terrain);
    frame("frame triangles any-hit", Shaders { any_hit: "alpha", ..PRIMARY }, &|| {
        placed(scenes::heightfield(table.size(256, 8)), asked)
    });
    let shadow = Shaders { ray_generation: "shadow", miss: &["sky", "shadow"], ..PRIMARY };
    frame("frame triangles and shadow", shadow, &terrain);
    frame("frame 64 instances", PRIMARY, &|| {
        let scene = scenes::heightfield(table.size(256, 8));
        let tlas = scene.tiled();
        (scene, tlas)
    });
    let reported = Shaders { closest_hit: "sphere", intersection: "sphere", ..PRIMARY };
    frame("frame spheres by intersection", reported, &|| placed(scenes::boxes(many), opaque));
    let swept = Shaders { closest_hit: "swept", ..PRIMARY };
    frame("frame spheres", swept, &|| {
        let (scene, tlas) = placed(scenes::spheres(many), opaque);
        // The shader takes two ends a primitive.
        let ends = scene.spheres.iter().flat_map(|&s| [s, s]).collect();
        (Scene { spheres: ends, ..scene }, tlas)
    });
    frame("frame swept spheres", swept, &|| placed(scenes::meadow(blades), opaque));
    let reported = Shaders { closest_hit: "sphere", intersection: "swept", ..PRIMARY };
    frame("frame swept by intersection", reported, &|| placed(scenes::meadow_boxes(blades), opaque));
    if table.wants("frame ray query") {
        let compute = Compute::new(program("query.comp")).expect("a compute shader");
        let [width, height, _] = compute.workgroup_size();
        let (scene, tlas) = terrain();
        let (resources, outputs) = resources(&scene, tlas, size);
        let groups = [size[0] / width, size[1] / height, 1];
        table.rate("frame ray query", "pixels", pixels, || {
            one.install(|| compute.run(&resources, groups, RunOptions::default()).expect("no trap"));
            String::new()
        });
        table.hits(hits(&outputs));
    }
    if table.wants("first launch") {
        // It begins with the files of the shaders; the BVH is already built.
        let (scene, tlas) = terrain();
        table.time("first launch", || {
            let pipeline = pipeline(PRIMARY);
            let (resources, _) = resources(&scene, tlas.clone(), [8, 8]);
            let launch = Launch { pipeline: &pipeline, resources: &resources };
            one.install(|| describe(&launch.run([8, 8, 1], RunOptions::default()).expect("no trap")))
        });
    }
}

/// A launch that can be repeated: the triangles with the heavy closest-hit shader, or arithmetic
/// only.
#[allow(dead_code, reason = "the comparison with peers has no threads")]
pub fn repeatable_launch(table: &Table, heavy: bool, size: [u32; 2]) -> (Pipeline, Resources) {
    let scene = scenes::heightfield(table.size(256, 8));
    let tlas = scene.tlas(GeometryFlags::OPAQUE);
    let (resources, _) = resources(&scene, tlas, size);
    let shaders = match heavy {
        true => Shaders { closest_hit: "heavy", ..PRIMARY },
        false => Shaders { ray_generation: "arithmetic", ..Shaders::default() },
    };
    (pipeline(shaders), resources)
}
