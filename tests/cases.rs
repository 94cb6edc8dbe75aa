//! Every case of `shaders/` and every scene of `scenes/`, a test each, named by its folder:
//! `cargo test --test cases lss` runs some. No compiler is needed: the modules are fixtures.
//!
//! A case runs at 1, 64 and 128 lanes, with the optimizer and without, with bit-identical results,
//! and must meet its `[expect]`, whose values are derived by hand. `expect.stderr` beside a scene
//! holds the report of its trap, a rendering: `BLESS=1` writes it anew.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhit::internals::harness::case::Case;
use anyhit::internals::harness::expect::Expectations;
use libtest_mimic::{Arguments, Failed, Trial};
use pretty_assertions::StrComparison;

fn main() {
    let arguments = Arguments::from_args();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut trials = Vec::new();
    let mut cases = Vec::new();
    for topic in ["pass", "fail"] {
        cases.extend(Case::discover(&root.join("shaders").join(topic)).expect("the cases' scene files"));
    }
    for case in demo(root) {
        cases.push(case);
    }
    for case in &cases {
        let name = case.name(root);
        let (case, root) = (case.clone(), root.to_path_buf());
        trials.push(Trial::test(name, move || check(&case, &root)));
    }
    let (all, root) = (cases, root.to_path_buf());
    trials.push(Trial::test("every fixture is run by a case", move || every_fixture(&all, &root)));
    libtest_mimic::run(&arguments, trials).exit();
}

/// The demo's scenes and the example renderer, at a size that a debug build draws at once.
fn demo(root: &Path) -> Vec<Case> {
    let scenes =
        ["scenes/swept-spheres.toml", "scenes/swept-spheres-slang.toml", "examples/renderer/scene.toml"];
    let scenes = scenes.iter().flat_map(|scene| Case::of(&root.join(scene)).expect("a scene"));
    scenes.map(|case| Case { size: Some([24, 14]), ..case }).collect()
}

fn check(case: &Case, root: &Path) -> Result<(), Failed> {
    let run = case.run().map_err(|error| Failed::from(error.render()))?;
    case.check_optimizer().map_err(|error| Failed::from(error.render()))?;
    if case.scene.starts_with(root.join("shaders")) {
        let expectations = scene(case).and_then(|scene| Expectations::read(&scene.document));
        if let Ok(expectations) = expectations {
            if expectations.is_empty() && case.rays.is_empty() {
                return Err("the case expects nothing: it cannot fail".into());
            }
            if let Some(span) = expectations.without_reason().first() {
                let error = span.error("the values of this repository are derived: `because` is missing");
                return Err(error.render().into());
            }
        }
    }
    let path = case.scene.with_file_name("expect.stderr");
    match run.observed.trap {
        Some(trap) if case.variant.is_none() => rendering(&path, &trap.render()),
        None if path.exists() => Err(format!("{} is there, but nothing trapped", path.display()).into()),
        _ => Ok(()),
    }
}

/// Compares a rendering with its file, or writes the file where `BLESS` is set.
fn rendering(path: &Path, found: &str) -> Result<(), Failed> {
    if std::env::var_os("BLESS").is_some() {
        return std::fs::write(path, found).map_err(|error| error.to_string().into());
    }
    let expected = std::fs::read_to_string(path).unwrap_or_default().replace("\r\n", "\n");
    if expected == found {
        return Ok(());
    }
    let difference = StrComparison::new(&expected, found);
    Err(format!("{}\n{difference}\n`BLESS=1` accepts the new text", path.display()).into())
}

fn scene(case: &Case) -> anyhit::internals::error::Result<anyhit::internals::scene::ResolvedScene> {
    let options = anyhit::internals::scene::LoadOptions {
        size: case.size,
        variant: case.variant.clone(),
        ..anyhit::internals::scene::LoadOptions::default()
    };
    anyhit::internals::scene::load(&case.scene, &anyhit::internals::scene::DiskFiles, &options)
}

/// A fixture that no case names would be compiled, kept and never run. (Those of `bench/` are run
/// by `cargo test --benches`.)
fn every_fixture(cases: &[Case], root: &Path) -> Result<(), Failed> {
    let mut left = BTreeSet::new();
    collect(&root.join("spirv-fixtures"), &mut left);
    let bench = root.join("spirv-fixtures/bench").canonicalize()?;
    assert!(!left.is_empty(), "no fixtures found");
    left.retain(|path| !path.starts_with(&bench));
    for case in cases {
        let scene = scene(case).map_err(|error| Failed::from(error.render()))?;
        for module in &scene.shaders {
            left.remove(&module.path.canonicalize().map_err(|error| error.to_string())?);
        }
    }
    let names: Vec<_> = left.iter().map(|path| path.display().to_string()).collect();
    if names.is_empty() { Ok(()) } else { Err(format!("no case runs {}", names.join("\n")).into()) }
}

fn collect(folder: &Path, modules: &mut BTreeSet<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of fixtures") {
        let path = entry.expect("a readable folder").path();
        if path.is_dir() {
            collect(&path, modules);
        } else if path.extension().is_some_and(|extension| extension == "spv") {
            modules.insert(path.canonicalize().expect("a path of a file that exists"));
        }
    }
}
