//! Benchmarks of set-up: loading and lowering modules, building BVHs, the smallest launch.

use std::path::Path;
use std::sync::Arc;

use anyhit_engine::accel::GeometryFlags;
use anyhit_engine::pipeline::{Launch, Pipeline};

use crate::frames::program;
use crate::scenes::{self, Scene};
use crate::table::Table;

pub fn run(table: &mut Table) {
    for module in ["bench/light.rchit.spv", "demo/swept-spheres/grass.rchit.spv"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures").join(module);
        load_and_lower(table, module, || std::fs::read(path).expect("a module"));
    }
    // Modules of the user, to measure how loading and lowering scale with them.
    for path in std::env::var_os("MODULES").iter().flat_map(std::env::split_paths) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        load_and_lower(table, &name, || std::fs::read(path).expect("a module"));
    }
    let build = |name: &str, make: &dyn Fn() -> Scene| {
        if table.wants(name) {
            build(table, name, &make());
        }
    };
    let (grid, many, blades) = (table.size(256, 8), table.size(10_000, 50), table.size(30_000, 50));
    build("build triangles", &|| scenes::heightfield(grid));
    build("build spheres", &|| scenes::spheres(many));
    build("build swept spheres", &|| scenes::meadow(blades));
    if table.wants_any("one invocation") {
        let pipeline = Pipeline::builder()
            .ray_generation(program("arithmetic.rgen"))
            .expect("ray generation")
            .build()
            .expect("a valid pipeline");
        let resources = Default::default();
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        table.time("one invocation, 1000 times", || {
            for _ in 0..1000 {
                // It ends at its first store, as nothing is bound.
                let _ = launch.run_one([0; 3], [1; 3], None, None);
            }
            String::new()
        });
    }
}

/// Builds the BLAS of a scene; the milliseconds.
pub fn build(table: &Table, name: &str, scene: &Scene) -> Option<f64> {
    table.time(name, || {
        let blas = scene.built(GeometryFlags::OPAQUE);
        format!("{:?}", blas.bounds().max)
    })
}

/// Loads and lowers a module's first entry point; the milliseconds of each.
pub fn load_and_lower(table: &Table, name: &str, make: impl FnOnce() -> Vec<u8>) -> [Option<f64>; 2] {
    let (loading, lowering) = (format!("load {name}"), format!("lower {name}"));
    if !table.wants(&loading) && !table.wants(&lowering) {
        return [None, None];
    }
    let bytes = make();
    let loaded = table.time(&loading, || {
        let module = anyhit_engine::module::load(&bytes).expect("a valid module");
        format!(
            "{} instructions",
            module.functions.iter().flat_map(|f| &f.blocks).map(|b| b.instructions.len()).sum::<usize>()
        )
    });
    let module = Arc::new(anyhit_engine::module::load(&bytes).expect("a valid module"));
    let lowered = table.time(&lowering, || {
        let program =
            anyhit_engine::program::lower(&module, &module.entry_points[0]).expect("a supported module");
        format!("{} operations, {} registers", program.ops.len(), program.register_count)
    });
    [loaded, lowered]
}
