//! Every compiled module of `spirv-fixtures/` loads, and holds what any shader holds.

use std::fs;
use std::path::{Path, PathBuf};

use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::load;

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

/// The expected lines and names stand in `shaders/pass/functions/parameters/main.rgen`.
#[test]
fn debug_information_leads_back_to_the_source() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = fs::read_to_string(folder.join("shaders/pass/functions/parameters/main.rgen")).unwrap();
    let line_of = |part: &str| source.lines().position(|line| line.contains(part)).unwrap() as u32 + 1;
    for flavour in ["g", "gVS"] {
        let path = format!("spirv-fixtures/pass/functions/parameters/main.rgen.{flavour}.spv");
        let module = load(&fs::read(folder.join(path)).unwrap()).unwrap();
        let text = module.debug_info.files[0].text.as_deref().unwrap();
        assert!(text.contains("quotient = floor(a / b);"), "{flavour}");
        let function = |name: &str| {
            let named = module.functions.iter().find(|function| module.name(function.id) == Some(name));
            named.unwrap_or_else(|| panic!("{flavour}: no function `{name}`"))
        };
        let line_of_first = |name: &str, opcode: &str| {
            let mut instructions = function(name).blocks.iter().flat_map(|block| &block.instructions);
            let found = instructions.find(|one| one.opcode.to_string() == opcode).unwrap();
            module.debug_info.line_at(found.offset).unwrap().line
        };
        assert_eq!(line_of_first("divide", "OpFDiv"), line_of("floor(a / b)"), "{flavour}");
        assert_eq!(line_of_first("divide", "OpFSub"), line_of("a - quotient * b"), "{flavour}");
        assert_eq!(line_of_first("consume", "OpReturnValue"), line_of("return x * 2.0"), "{flavour}");
        assert_eq!(line_of_first("split", "OpFNegate"), line_of("whole = -whole"), "{flavour}");
        let interface = module.interface_of(&module.entry_points[0]);
        let names: Vec<_> = interface.iter().map(|one| (one.name.as_str(), one.binding)).collect();
        let expected = [("gl_LaunchIDEXT", None), ("Inputs", Some(2)), ("Outputs", Some(1))];
        assert_eq!(names, expected, "{flavour}");
    }
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
