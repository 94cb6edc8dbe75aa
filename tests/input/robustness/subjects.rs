//! What reads what strangers wrote: modules, sources, scenes, meshes, pictures, recordings, command
//! lines. A subject takes any bytes and says whether they were accepted; whatever the bytes, it
//! ends soon and does not panic.

use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::InputLimit;
use anyhit_cases::expect::Expectations;
use anyhit_cases::recording::Recording;
use anyhit_cases::smoke::{SmokeOptions, SmokeReport};
use anyhit_engine::machine::{Bindings, Mask, Resources, Stop};
use anyhit_engine::module::ty::TypeId;
use anyhit_engine::program::lower;
use anyhit_engine::{interp, module};
use anyhit_scene::image::Picture;
use anyhit_scene::mesh::listed::AnimationTime;
use anyhit_scene::mesh::model::{MeshFormat, Model};
use anyhit_scene::{DiskFiles, Files, LoadOptions, assemble, load_text};

/// Registers of a program beyond which it is not run: a batch of them takes memory that the test
/// need not have.
const MAX_REGISTERS: u32 = 20_000;

/// Looks at an error as whoever prints it does. A reader's panic is an error of the file, unless
/// the panic was in this project's own code around the reader.
pub fn refused(error: &Error) -> bool {
    assert!(!error.render().is_empty());
    assert!(!error.message().is_empty(), "an error without a message");
    for note in std::iter::once(error).chain(error.others()).flat_map(Error::notes) {
        let place = note.strip_prefix("the file violates an assumption at `").unwrap_or_default();
        assert!(!is_ours(place), "a panic of our own: {}: {place}", error.message());
    }
    false
}

/// Whether a panic's location is in a crate of this project: relative as its own workspace is
/// compiled, absolute as `fuzz/` compiles it. Other crates lie in a registry, the standard library
/// in `/rustc`.
fn is_ours(place: &str) -> bool {
    let place = place.replace('\\', "/");
    let absolute = root().display().to_string().replace('\\', "/");
    let inside = place.strip_prefix(&format!("{absolute}/")).unwrap_or(&place);
    inside.starts_with("src/") || inside.starts_with("crates/")
}

/// Loads a module, and asks it everything.
pub fn load(bytes: &[u8]) -> bool {
    let module = match module::load(bytes) {
        Ok(module) => module,
        Err(error) => {
            assert!(matches!(error.kind(), ErrorKind::InvalidModule | ErrorKind::UnsupportedModule));
            assert!(error.places().next().is_some(), "an error without a place: {error}");
            return refused(&error);
        }
    };
    for index in 0..module.types.len() {
        let ty = TypeId(index as u32);
        assert!(!module.describe_type(ty).is_empty());
        let _ = (module.size_of(ty), module.scalar_count(ty));
    }
    for entry in &module.entry_points {
        let _ = module.interface_of(entry);
    }
    let words = module.words.len();
    assert!(module.validate().iter().all(|finding| finding.word < words && !finding.fix.is_empty()));
    for block in module.functions.iter().flat_map(|function| &function.blocks) {
        for instruction in &block.instructions {
            let _ = module.debug_info.line_at(instruction.offset);
            let _ = (module.operand_ids(instruction), module.branch_targets(instruction));
        }
    }
    true
}

/// Loads a module, lowers and optimizes each entry point, and runs it on five lanes of a batch
/// without resources, going on behind each stop as if the pipeline had done nothing.
pub fn execute(bytes: &[u8]) -> bool {
    let Ok(module) = module::load(bytes) else { return false };
    let module = Arc::new(module);
    let mut is_run = false;
    for entry in &module.entry_points {
        let Ok(program) = lower(&module, entry) else { continue };
        if program.register_count > MAX_REGISTERS {
            continue;
        }
        is_run = true;
        let bindings: Bindings = Resources::default().bindings(program.bindings());
        let mut batch = program.batch::<64>();
        program.begin(&mut batch, Mask::first(5), 20_000);
        for _ in 0..64 {
            if interp::run(&mut batch, &program, &bindings, &mut ()) == Stop::Done {
                break;
            }
        }
    }
    is_run
}

/// Runs each entry point of a module with resources, rays and hits that its types ask for.
pub fn smoke(bytes: &[u8]) -> bool {
    let Ok(module) = module::load(bytes) else { return false };
    let options = SmokeOptions::default().fuel(4096).total_fuel(1 << 16);
    let report = SmokeReport::of(&Arc::new(module), options);
    let text = report.text();
    assert!(!text.contains("bug in anyhit"), "{text}");
    report.is_ok()
}

/// Compiles WGSL, and loads what came of it.
#[cfg(feature = "wgsl")]
pub fn wgsl(bytes: &[u8]) -> bool {
    use anyhit_compile::{CompileOptions, Source};
    let text = String::from_utf8_lossy(bytes);
    let source = Source::from_text("fuzzed.wgsl", text).expect("a name that says the language");
    match source.compile(&CompileOptions::default()) {
        // What naga writes is read here, or refused with an error as any module.
        Ok(words) => {
            load(&words);
            true
        }
        Err(error) => refused(&error),
    }
}

/// The files of this repository, and no others.
struct Repository;

impl Files for Repository {
    fn read_limited(&self, path: &Path, limit: InputLimit) -> Result<Vec<u8>> {
        let outside = || Error::new(ErrorKind::Io, format!("{}: outside", path.display()));
        let mut within = PathBuf::new();
        for part in path.components() {
            match part {
                Component::CurDir => {}
                Component::Normal(name) => within.push(name),
                Component::ParentDir if within.pop() => {}
                _ => return Err(outside()),
            }
        }
        let path = root().join(within);
        if path.is_file() { DiskFiles.read_limited(&path, limit) } else { Err(outside()) }
    }
}

/// The folder of the repository: the package's own, or the one above it.
pub fn root() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = own.ancestors().find(|folder| folder.join("spirv-fixtures").is_dir());
    root.expect("the folder of the repository").to_path_buf()
}

/// Reads a scene with everything that it names and its expectations. Its first line is a comment
/// with its path, where its relative paths start from.
pub fn scene(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let path = text.lines().next().and_then(|line| line.strip_prefix("# ")).unwrap_or("scene.toml");
    let options = LoadOptions { size: Some([2, 2]), ..LoadOptions::default() };
    let loaded = load_text(Path::new(path), &text, &Repository, &options);
    let expectations = loaded.and_then(|scene| {
        assemble(&scene)?;
        Expectations::read(&scene.document)
    });
    expectations.map_or_else(|error| refused(&error), |_| true)
}

/// Reads a glTF or GLB file with all attributes, in its rest state and at a time.
pub fn gltf(bytes: &[u8]) -> bool {
    let read = |time: Option<&AnimationTime>| {
        let path = Path::new("mesh.gltf");
        let model = Model::open_at(MeshFormat::Gltf, path, bytes.to_vec(), &Repository, time)?;
        for (at, part) in model.parts.iter().enumerate() {
            model.triangles(at)?;
            for name in &part.attributes {
                // Attributes that nothing uses may be of any type.
                model.attribute(at, name).map_or_else(|error| refused(&error), |_| true);
            }
        }
        Ok(())
    };
    let time = AnimationTime { time: 0.5, animation: None };
    read(Some(&time)).map_or_else(|error| refused(&error), |()| true);
    read(None).map_or_else(|error| refused(&error), |()| true)
}

/// Reads an OBJ file.
pub fn obj(bytes: &[u8]) -> bool {
    let read = Model::open(MeshFormat::Obj, Path::new("mesh.obj"), bytes.to_vec(), &Repository);
    read.map_or_else(|error| refused(&error), |_| true)
}

/// Reads a picture as it is stored.
pub fn picture(bytes: &[u8]) -> bool {
    let read = Picture::decode(Path::new("picture"), bytes, None);
    read.map_or_else(|error| refused(&error), |_| true)
}

/// Reads a recording of a driver, and compares its rays with this project's own.
pub fn recording(bytes: &[u8]) -> bool {
    match Recording::of(bytes) {
        Ok(recording) => {
            let _ = recording.compare();
            true
        }
        Err(error) => refused(&error),
    }
}

/// Parses a command line, of an argument a line.
pub fn command_line(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let arguments = std::iter::once("anyhit").chain(text.lines());
    match anyhit::cli::command().try_get_matches_from(arguments) {
        Ok(_) => true,
        Err(error) => {
            assert!(!error.render().to_string().is_empty());
            false
        }
    }
}

/// Reads the result of a share, merges it with itself, and makes the reports of what it holds.
#[cfg(feature = "cli")]
pub fn share_result(bytes: &[u8]) -> bool {
    use anyhit_cases::shares::render::RenderResult;
    use anyhit_cases::shares::smoke::SmokeResult;
    use anyhit_cases::shares::{ShareResult, ShareResults, command_of};
    use anyhit_cases::suite::{SuiteResult, junit, report};

    fn merged<R: ShareResult>(bytes: &[u8]) -> Result<ShareResults<R>, Error> {
        let path = Path::new("fuzzed.json");
        let results = ShareResults::<R>::read(path, bytes)?.merge(ShareResults::read(path, bytes)?)?;
        let _ = (results.missing(), results.to_json()?);
        Ok(results)
    }
    let reports = |command: &str| -> Result<(), Error> {
        match command {
            "test" => {
                let results = merged::<SuiteResult>(bytes)?;
                SuiteResult::check_shares(&results)?;
                let result = SuiteResult::of_shares(&results);
                let _ = (report::json(&result), report::summary(&result), junit(&result, true)?);
                let _ =
                    result.coverage.as_ref().map(|coverage| (coverage.lcov(), report::coverage(coverage)));
                let _ =
                    (result.shadow().text(), result.shadow().json(None), result.findings(), result.timings());
            }
            "smoke" => {
                let results = merged::<SmokeResult>(bytes)?;
                SmokeResult::check_shares(&results)?;
                let result = SmokeResult::of_shares(&results);
                let _ = (result.json(), result.summary(), result.class());
                assert!(result.modules.iter().all(|module| module.text().lines().count() == 1));
            }
            "render" => drop(RenderResult::picture(&merged::<RenderResult>(bytes)?)?),
            _ => {}
        }
        Ok(())
    };
    match command_of(Path::new("fuzzed.json"), bytes).and_then(|command| reports(&command)) {
        Ok(()) => true,
        Err(error) => refused(&error),
    }
}
