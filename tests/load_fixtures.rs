//! Every compiled module of `spirv-fixtures/` loads, and holds what any shader holds.

use std::fs;
use std::path::{Path, PathBuf};

use anyhit::module::interface::Stage;
use anyhit::module::load;

fn modules(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            modules(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "spv") {
            found.push(path);
        }
    }
}

#[test]
fn every_fixture_loads() {
    let mut paths = Vec::new();
    modules(&Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures"), &mut paths);
    assert!(!paths.is_empty(), "no fixtures");
    paths.sort();
    let mut refused = Vec::new();
    for path in &paths {
        match load(&fs::read(path).unwrap()) {
            Ok(module) => {
                assert!(!module.entry_points.is_empty(), "{}: no entry point", path.display());
                for entry in &module.entry_points {
                    let stage = stage_of_name(path);
                    assert!(stage.is_none_or(|stage| stage == entry.stage), "{}", path.display());
                    let main = module.function(entry.function).unwrap();
                    assert!(!main.blocks.is_empty(), "{}", path.display());
                }
            }
            Err(error) => refused.push(format!("{}: {error}", path.display())),
        }
    }
    assert!(refused.is_empty(), "{} of {} refused:\n{}", refused.len(), paths.len(), refused.join("\n"));
}

/// The stage that a GLSL file's name announces.
fn stage_of_name(path: &Path) -> Option<Stage> {
    let name = path.file_name()?.to_str()?;
    let stage = |part: &str| match part {
        "rgen" => Some(Stage::RayGeneration),
        "rint" => Some(Stage::Intersection),
        "rahit" => Some(Stage::AnyHit),
        "rchit" => Some(Stage::ClosestHit),
        "rmiss" => Some(Stage::Miss),
        "rcall" => Some(Stage::Callable),
        "comp" => Some(Stage::Compute),
        _ => None,
    };
    name.split('.').find_map(stage)
}
