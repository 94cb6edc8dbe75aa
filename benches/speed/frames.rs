//! Whole launches: shaders and traversal together.

use std::path::Path;
use std::sync::Arc;

use anyhit::accel::{GeometryFlags, Tlas};
use anyhit::machine::{Buffer, Descriptor, Resources};
use anyhit::pipeline::{Launch, Pipeline, Stats};
use anyhit::program::Program;

use crate::scenes::{self, Camera, Scene};
use crate::table::Table;

/// The shaders of a pipeline by the names of their sources, without `.rgen` and so on; empty for none.
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
    builder.ray_generation(program(&format!("{}.rgen", shaders.ray_generation))).expect("ray generation");
    for miss in shaders.miss {
        builder.miss(program(&format!("{miss}.rmiss"))).expect("a miss shader");
    }
    let members =
        [(shaders.closest_hit, "rchit"), (shaders.any_hit, "rahit"), (shaders.intersection, "rint")];
    let named = members.iter().filter(|(name, _)| !name.is_empty());
    builder.hit(named.map(|(name, stage)| program(&format!("{name}.{stage}")))).expect("a hit group");
    builder.build().expect("a valid pipeline")
}

fn resources(scene: &Scene, tlas: Arc<Tlas>, size: [u32; 2]) -> Resources {
    let Camera { eye, forward, right, up } = scene.camera;
    let light = [0.5f32, 0.75, 0.433];
    let inputs: Vec<f32> =
        [eye, forward, right, up, light].iter().flat_map(|&[x, y, z]| [x, y, z, 0.0]).collect();
    let indices = match &scene.data {
        anyhit::accel::GeometryData::Triangles { indices: Some(indices), .. } => indices.clone(),
        _ => vec![0],
    };
    let buffer = |bytes: &[u8]| Descriptor::Buffer(Buffer::new(bytes));
    Resources::default()
        .bind(0, 0, Descriptor::AccelerationStructure(tlas))
        .bind(0, 1, Descriptor::Buffer(Buffer::zeroed((size[0] * size[1] * 16) as usize)))
        .bind(0, 2, buffer(bytemuck::cast_slice(&inputs)))
        .bind(0, 3, buffer(bytemuck::cast_slice(&indices)))
        .bind(0, 4, buffer(bytemuck::cast_slice(&scene.normals)))
        .bind(0, 5, buffer(bytemuck::cast_slice(&scene.spheres)))
}

fn describe(stats: &Stats) -> String {
    let mut text = String::new();
    for (stage, shaders) in &stats.shaders {
        let fill = shaders.invocations as f64 / shaders.batches.max(1) as f64;
        text += &format!("{} {fill:.1} lanes, ", stage.name());
    }
    text.trim_end_matches(", ").to_owned()
}

pub fn run(table: &mut Table) {
    let size = table.size([512, 384], [8, 6]);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let pixels = u64::from(size[0] * size[1]);
    let frame = |table: &Table, name: &str, shaders: Shaders, scene: &Scene, tlas: &Arc<Tlas>| {
        if !table.wants(name) {
            return;
        }
        let pipeline = pipeline(shaders);
        let resources = resources(scene, tlas.clone(), size);
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        table.rate(name, "pixels", pixels, || {
            let stats = one.install(|| launch.run::<32>([size[0], size[1], 1], &|_| ()).expect("no trap"));
            describe(&stats)
        });
    };
    if table.wants_any("frame") {
        let (opaque, asked) = (GeometryFlags::OPAQUE, GeometryFlags::default());
        let terrain = scenes::heightfield(table.size(256, 8));
        let placed = terrain.tlas(opaque);
        frame(
            table,
            "frame arithmetic",
            Shaders { ray_generation: "arithmetic", ..Shaders::default() },
            &terrain,
            &placed,
        );
        frame(
            table,
            "frame triangles trivial",
            Shaders { closest_hit: "trivial", ..PRIMARY },
            &terrain,
            &placed,
        );
        frame(table, "frame triangles light", PRIMARY, &terrain, &placed);
        frame(table, "frame triangles heavy", Shaders { closest_hit: "heavy", ..PRIMARY }, &terrain, &placed);
        let alpha = Shaders { any_hit: "alpha", ..PRIMARY };
        frame(table, "frame triangles any-hit", alpha, &terrain, &terrain.tlas(asked));
        let shadow = Shaders { ray_generation: "shadow", miss: &["sky", "shadow"], ..PRIMARY };
        frame(table, "frame triangles and shadow", shadow, &terrain, &placed);
        frame(table, "frame 64 instances", PRIMARY, &terrain, &terrain.tiled());
        let many = table.size(10_000, 50);
        let boxes = scenes::boxes(many);
        let reported = Shaders { closest_hit: "sphere", intersection: "sphere", ..PRIMARY };
        frame(table, "frame spheres by intersection", reported, &boxes, &boxes.tlas(opaque));
        let spheres = scenes::spheres(many);
        // The shader takes two ends a primitive.
        let ends = spheres.spheres.iter().flat_map(|&s| [s, s]).collect();
        let spheres = Scene { spheres: ends, ..spheres };
        let swept = Shaders { closest_hit: "swept", ..PRIMARY };
        frame(table, "frame spheres", swept, &spheres, &spheres.tlas(opaque));
        let meadow = scenes::meadow(table.size(30_000, 50));
        frame(table, "frame swept spheres", swept, &meadow, &meadow.tlas(opaque));
    }
    if table.wants_any("threads") {
        let terrain = scenes::heightfield(table.size(256, 8));
        let pipeline = pipeline(Shaders { closest_hit: "heavy", ..PRIMARY });
        let resources = resources(&terrain, terrain.tlas(GeometryFlags::OPAQUE), size);
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        for threads in [1, 2, 4] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            table.rate(&format!("threads {threads}, triangles heavy"), "pixels", pixels, || {
                pool.install(|| launch.run::<32>([size[0], size[1], 1], &|_| ()).expect("no trap"));
                String::new()
            });
        }
    }
}
