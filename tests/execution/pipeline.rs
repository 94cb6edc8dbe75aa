//! Compiled shaders through a whole launch: a sphere, its closest-hit and its miss shader.

use std::path::Path;
use std::sync::Arc;

use anyhit_engine::accel::{Blas, Geometry, GeometryData, GeometryFlags, Tlas, TlasInstance};
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{BatchWidth, Launch, Pipeline, RunOptions};
use anyhit_engine::program::Program;

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

fn program(name: &str) -> Program {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/sphere/closest-hit").join(name);
    let module = Arc::new(
        anyhit_engine::module::load(&std::fs::read(path).expect("a fixture")).expect("a valid fixture"),
    );
    anyhit_engine::program::lower(&module, &module.entry_points[0]).expect("a supported fixture")
}

/// Runs the case over a square of `size` rays and gives the words of its output.
fn outputs(size: u32, width: BatchWidth) -> Vec<f32> {
    let data = GeometryData::Spheres { positions: vec![[0.0; 3]], radii: vec![0.5], indices: None };
    let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)]).expect("a valid geometry");
    let tlas = Tlas::new(vec![TlasInstance::of(blas, IDENTITY)]).expect("a valid instance");
    let mut builder = Pipeline::builder();
    builder = builder.ray_generation(program("main.rgen.spv")).expect("a ray generation shader");
    builder = builder.miss(program("main.rmiss.spv")).expect("a miss shader");
    builder = builder.hit([program("main.rchit.spv")]).expect("a hit group");
    let pipeline = builder.build().expect("a valid pipeline");
    let buffer = Buffer::zeroed((size * size * 32) as usize);
    let resources = Resources::default().bind(0, 0, Descriptor::AccelerationStructure(tlas)).bind(
        0,
        1,
        Descriptor::Buffer(buffer.clone()),
    );
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    let stats = launch.run([size, size, 1], RunOptions::of(width)).expect("no trap");
    assert_eq!(stats.rays, u64::from(size * size));
    bytemuck::pod_collect_to_vec(&buffer.bytes())
}

#[test]
fn a_sphere_is_hit_where_it_stands() {
    // Four rays a side from (x, y, 4) along -z with x and y in {-0.75, -0.25, 0.25, 0.75}; the
    // sphere of radius 1/2 meets those with |x| = |y| = 1/4: z^2 = 1/4 - 1/8 = 1/8, t = 4 - z.
    let values = outputs(4, BatchWidth::Of64);
    for y in 0..4 {
        for x in 0..4 {
            let at = (y * 4 + x) * 8;
            let [nx, ny, nz, t] = [values[at], values[at + 1], values[at + 2], values[at + 3]];
            let inside = (1..3).contains(&x) && (1..3).contains(&y);
            assert_eq!(values[at + 6], if inside { 1.0 } else { 0.0 }, "hits at {x}, {y}");
            if inside {
                let z = 0.125f64.sqrt();
                assert_eq!(t, (4.0 - z) as f32);
                let expected =
                    [if x == 1 { -0.5 } else { 0.5 }, if y == 1 { -0.5 } else { 0.5 }, 2.0 * z as f32];
                for (got, wanted) in [nx, ny, nz].into_iter().zip(expected) {
                    assert!((got - wanted).abs() < 1e-6, "normal {:?}, expected {expected:?}", [nx, ny, nz]);
                }
            } else {
                assert_eq!(t, -1.0);
            }
        }
    }
}

#[test]
fn one_lane_and_many_agree_bit_for_bit() {
    let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<_>>();
    let many = bits(outputs(65, BatchWidth::Of64));
    assert_eq!(bits(outputs(65, BatchWidth::One)), many);
    assert_eq!(bits(outputs(65, BatchWidth::Of128)), many);
}
