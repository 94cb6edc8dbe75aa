//! Every case of `shaders/` and every scene of `scenes/`, a test each, named by its folder:
//! `cargo test --test cases lss` runs some. No compiler is needed: the modules are fixtures.
//!
//! A case runs at 1, 64 and 128 lanes, with the optimizer and without, with bit-identical results,
//! and must meet its `[expect]`, whose values are derived by hand. `expect.stderr` beside a scene
//! holds the report of its trap, a rendering: `BLESS=1` writes it anew.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhit_cases::case::Case;
use anyhit_cases::expect::Expectations;
use anyhit_cases::many_seeds::{FloatChoices, ManySeeds, run_command};
use anyhit_cases::sanitized::run_sanitized;
use anyhit_debugger::session::ResolvedRequest;
use anyhit_engine::machine::ChoiceKind;
use anyhit_sanitize::{Findings, Levels, Rule, choices, rule};
use anyhit_scene::sanitize_table::scene_levels;
use anyhit_scene::{LoadOptions, ResolvedScene, SceneFiles, assemble, load_text};
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
    let checks: [(&str, Check); 2] = [("sanitize", sanitize), ("many-seeds", many_seeds)];
    let mut rules = Vec::new();
    for (topic, check) in checks {
        let folders = rule_folders(&root.join("shaders").join(topic));
        for folder in folders.clone() {
            let name =
                folder.strip_prefix(root.join("shaders")).expect("a folder of cases").display().to_string();
            trials.push(Trial::test(name, move || broken_and_mended(&folder, check)));
        }
        rules.extend(folders);
    }
    trials.push(Trial::test("every rule has a case", move || every_rule(&rules)));
    let choices: BTreeSet<&str> = choices::rules().map(|rule| rule.id).collect();
    let is_choice = |rule: &&Rule| choices.contains(rule.id);
    let (drawn, others): (Vec<_>, Vec<_>) = rule::all().partition(is_choice);
    for (page, rules) in [("docs/sanitize.md", others), ("docs/many-seeds.md", drawn)] {
        let path = root.join(page);
        trials.push(Trial::test(format!("sanitize: every rule stands in {page}"), move || {
            documented(&path, &rules)
        }));
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
    if run.observed.trap.is_none() {
        no_alarm(case)?;
    }
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

fn scene(case: &Case) -> Result<ResolvedScene, anyhit::Error> {
    let options = LoadOptions { size: case.size, variant: case.variant.clone(), ..LoadOptions::default() };
    anyhit_scene::load(&case.scene, &anyhit_scene::DiskFiles, &options)
}

/// `shaders/TOPIC/RULE`: a scene whose shader breaks the rule, and the shader that does not.
fn rule_folders(topic: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(topic).expect("the cases of rules");
    let mut folders: Vec<PathBuf> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
    folders.sort();
    folders
}

/// What is found in a scene with one of the shaders of a folder.
type Check = fn(&ResolvedScene) -> Result<Findings, anyhit::Error>;

/// The broken shader breaks the rule of its folder and no other, and its report is
/// `broken.findings`; the mended one breaks none.
fn broken_and_mended(folder: &Path, check: Check) -> Result<(), Failed> {
    let failed = |error: anyhit::Error| Failed::from(error.render());
    let found = |shader| scene_with(folder, shader).and_then(|scene| check(&scene)).map_err(failed);
    let broken = found("broken.")?;
    let ids: BTreeSet<&str> = broken.iter().map(|finding| finding.rule.id).collect();
    let rule = folder.file_name().and_then(std::ffi::OsStr::to_str).unwrap_or_default();
    // Places in scene files are told by the path that the scene was read from.
    let root = format!("{}/", env!("CARGO_MANIFEST_DIR"));
    let text: String = broken.iter().map(|finding| finding.render().replace(&root, "") + "\n").collect();
    if ids != BTreeSet::from([rule]) {
        return Err(format!("the broken shader breaks {ids:?}:\n{text}").into());
    }
    rendering(&folder.join("broken.findings"), &text)?;
    let mended = found("mended.")?;
    let text: String = mended.iter().map(|finding| finding.render() + "\n").collect();
    if mended.is_empty() { Ok(()) } else { Err(format!("the mended shader is not:\n{text}").into()) }
}

/// The scene of a folder with its broken or its mended shader.
fn scene_with(folder: &Path, shader: &str) -> Result<ResolvedScene, anyhit::Error> {
    let path = folder.join("scene.toml");
    let text = std::fs::read_to_string(&path).expect("a scene").replace("broken.", shader);
    load_text(&path, &text, &SceneFiles::default(), &LoadOptions::default())
}

/// What the sanitizer finds in a scene.
fn sanitize(scene: &ResolvedScene) -> Result<Findings, anyhit::Error> {
    let assembled = assemble(scene)?;
    let run = run_sanitized(scene, &assembled, &assembled.resources, &Levels::default())?;
    let mut findings = run.findings;
    if let Err(error) = &run.outcome {
        findings.add_stop(error);
    }
    Ok(findings)
}

/// What depends on drawn choices in the scene of a rule's folder; how floats are calculated is
/// drawn as far as the rule is about it.
fn many_seeds(scene: &ResolvedScene) -> Result<Findings, anyhit::Error> {
    let folder = scene.path.parent().and_then(Path::file_name);
    let about =
        ChoiceKind::ALL.into_iter().filter(|&kind| Some(choices::rule_of(kind).id.as_ref()) == folder);
    let floats = about.map(FloatChoices::that_include).max().unwrap_or_default();
    let command = Some(run_command(scene));
    ManySeeds { seeds: 0..64, floats, command, ..ManySeeds::default() }.run(scene, &assemble(scene)?)
}

/// Under the sanitizer, and with drawn choices, nothing is denied but what the scene allows, as it
/// tests this crate's choice where the specification leaves one.
fn no_alarm(case: &Case) -> Result<(), Failed> {
    let failed = |error: anyhit::Error| Failed::from(error.render());
    let scene = scene(case).map_err(failed)?;
    let assembled = assemble(&scene).map_err(failed)?;
    let levels = scene_levels(&scene.document).map_err(failed)?;
    let run = run_sanitized(&scene, &assembled, &assembled.resources, &levels).map_err(failed)?;
    let seeds = ManySeeds { seeds: 0..8, levels, ..ManySeeds::default() };
    let mut drawn = seeds.run(&scene, &assembled).map_err(failed)?;
    for at in case.rays.iter().map(|ray| ray.index) {
        let ray = ResolvedRequest::of(&scene.rays[at]).map_err(failed)?;
        drawn.extend(seeds.run_one(&scene, &assembled, &ray).map_err(failed)?);
    }
    for (what, findings) in [("the sanitizer", run.findings), ("many seeds", drawn)] {
        let denied: String = findings.denied().map(|finding| finding.render() + "\n").collect();
        if !denied.is_empty() {
            return Err(format!("{what}: this is denied:\n{denied}").into());
        }
    }
    Ok(())
}

/// Rules without a case, as no compiler of fixtures writes what breaks them. Each is tested with an
/// assembled module in `crates/sanitize/src/module_checks/tests.rs`,
/// `crates/sanitize/src/interface_types.rs` or `tests/sanitizer/modules.rs`. (`unsupported` is no
/// rule of shaders.)
const WITHOUT_CASE: [&str; 16] = [
    "as-load-source",
    "atomic-class",
    "attr-readonly",
    "fastmath-modes",
    "image-sample-operand",
    "interface-initializer",
    "non-writable",
    "nonuniform-capability",
    "payload-decoration",
    "payload-location",
    "pointer-convert",
    "record-block",
    "uniform-store",
    "unsupported",
    "volatile-load",
    "workgroup-in-rt",
];

/// A rule without a case would be told in words that nobody has read.
fn every_rule(folders: &[PathBuf]) -> Result<(), Failed> {
    let names: BTreeSet<&str> =
        folders.iter().filter_map(|folder| folder.file_name().and_then(std::ffi::OsStr::to_str)).collect();
    let mut rules: BTreeSet<&str> = rule::all().chain(rule::of_stops()).map(|rule| rule.id).collect();
    for rule in WITHOUT_CASE {
        if !rules.remove(rule) {
            return Err(format!("{rule} is no rule").into());
        }
    }
    if names == rules { Ok(()) } else { Err(format!("{:?}", names.symmetric_difference(&rules)).into()) }
}

/// The table of rules in a page is that of the code.
fn documented(page: &Path, rules: &[&Rule]) -> Result<(), Failed> {
    const BEGIN: &str = "cases sanitize` -->\n";
    const END: &str = "<!-- end of rules -->";
    let text = std::fs::read_to_string(page)?.replace("\r\n", "\n");
    let (begin, end) = (text.find(BEGIN).ok_or("no table")? + BEGIN.len(), text.find(END).ok_or("no table")?);
    let mut table = String::from("| rule | kind | what must hold |\n|---|---|---|\n");
    for rule in rules {
        table += &format!("| `{}` | {} | {} |\n", rule.id, rule.kind.name(), rule.holds);
    }
    rendering(page, &format!("{}{table}{}", &text[..begin], &text[end..]))
}

/// A fixture that no case names would be compiled, kept and never run. (Those of `bench/` are run
/// by `cargo test --benches`, those of rules have both of their shaders run above, and those of
/// `debugging/` are walked through in `debugger_walks.rs`, those in `debug/` have their variables
/// read in `source_variables.rs`.)
fn every_fixture(cases: &[Case], root: &Path) -> Result<(), Failed> {
    let mut left = BTreeSet::new();
    collect(&root.join("spirv-fixtures"), &mut left);
    let others = ["bench", "sanitize", "many-seeds", "debugging", "debug"];
    let others = others.map(|folder| root.join("spirv-fixtures").join(folder));
    let others = others.map(|folder| folder.canonicalize().expect("a folder of fixtures"));
    assert!(!left.is_empty(), "no fixtures found");
    left.retain(|path| !others.iter().any(|folder| path.starts_with(folder)));
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
