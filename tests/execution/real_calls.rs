//! Every case gives the same buffers whether its calls are inlined or real.

use std::path::Path;
use std::sync::Arc;

use anyhit_engine::machine::Descriptor;
use anyhit_engine::pipeline::RunOptions;
use anyhit_engine::program::{Inlining, LowerOptions, Terminator, lower_with};
use anyhit_scene::{Assembled, DiskFiles, LoadOptions};

use crate::support::files;

/// The bytes of all buffers after a launch; a trap's words where it ends in one.
fn run(assembled: &Assembled) -> (Option<String>, Vec<Vec<u8>>) {
    let trap = assembled.launch().run(assembled.size, RunOptions::default()).err();
    let descriptors = assembled.resources.descriptors.values().flatten();
    let buffers = descriptors.filter_map(|descriptor| match descriptor {
        Descriptor::Buffer(buffer) => Some(buffer.bytes()),
        _ => None,
    });
    (trap.map(|error| error.message().to_string()), buffers.collect())
}

#[test]
fn real_calls_and_inlined_ones_agree() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let mut calls = 0;
    let mut cases = 0;
    let scenes = files::with_extension(&root, "toml");
    for path in scenes.into_iter().filter(|path| path.ends_with("scene.toml")) {
        let resolved = anyhit_scene::load(&path, &DiskFiles, &LoadOptions::default()).expect("a valid scene");
        let Ok(inlined) = anyhit_scene::assemble(&resolved) else { continue };
        let mut real = anyhit_scene::assemble(&resolved).expect("what was assembled once");
        for program in &mut real.pipeline.programs {
            let module = program.module.clone();
            let has = |entry: &&anyhit_engine::module::interface::EntryPoint| {
                entry.name == program.name && entry.stage == program.stage
            };
            let entry = module.entry_points.iter().find(has).expect("the entry point");
            let lowered = lower_with(
                &module,
                entry,
                LowerOptions { inlining: Inlining::Never, ..LowerOptions::default() },
            );
            // A pointer that no register can carry must be inlined.
            let Ok(lowered) = lowered else { continue };
            calls += lowered
                .blocks
                .iter()
                .filter(|block| matches!(block.terminator, Terminator::Call { .. }))
                .count();
            *program = Arc::new(lowered);
        }
        assert!(run(&real) == run(&inlined), "{} differs with real calls", path.display());
        cases += 1;
    }
    assert!(cases >= 15, "only {cases} cases ran");
    assert!(calls >= 20, "only {calls} real calls were lowered");
}
