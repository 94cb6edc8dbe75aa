//! Every fixture's entry points can be lowered.

use std::path::Path;
use std::sync::Arc;

use anyhit_engine::module::interface::Stage;

use crate::support::files;

#[test]
fn every_entry_point_lowers() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures");
    let mut count = 0;
    let mut failures = Vec::new();
    for path in files::with_extension(&root, "spv") {
        let bytes = std::fs::read(&path).expect("a readable fixture");
        let module = Arc::new(
            anyhit_engine::module::load(&bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display())),
        );
        for entry in &module.entry_points {
            count += 1;
            match anyhit_engine::program::lower(&module, entry) {
                Ok(program) => assert!(!program.blocks.is_empty()),
                Err(_) if matches!(entry.stage, Stage::Other(_)) => {}
                Err(error) => failures.push(format!("{} `{}`: {error}", path.display(), entry.name)),
            }
        }
    }
    assert!(count > 70, "only {count} entry points were found");
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
