//! The steps of `action.yml`, as a runner of GitHub carries them out: against a folder of archives
//! in place of a release, and the program that was built for this test, or the one that
//! `ANYHIT_ACTION_PROGRAM` names.
//!
//! The runner here knows what the action uses of the workflow syntax: steps that `run`, their `if`,
//! `env` and `working-directory`, and expressions of `inputs`, `github` and `steps`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use crate::support::program::scratch;
use crate::support::skipped::{self, test_name};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// `inputs.x` and the like, by name.
type Context = BTreeMap<String, String>;

#[derive(Default)]
struct Step {
    fields: BTreeMap<String, String>,
    env: Vec<(String, String)>,
}

/// A scalar of YAML as the action has them: plain, or in either kind of quotes.
fn scalar(text: &str) -> String {
    let text = text.trim();
    let inside = |quote| text.strip_prefix(quote)?.strip_suffix(quote);
    inside('\'').or_else(|| inside('"')).unwrap_or(text).to_owned()
}

/// The defaults of the inputs, and the steps.
fn action() -> (Context, Vec<Step>) {
    let text = std::fs::read_to_string(Path::new(ROOT).join("action.yml")).expect("the action");
    let (head, steps_text) = text.split_once("  steps:\n").expect("steps");
    let mut context = Context::new();
    let mut input = "";
    for line in head.lines().skip_while(|line| *line != "inputs:").take_while(|line| *line != "outputs:") {
        if let Some(default) = line.strip_prefix("    default:") {
            context.insert(format!("inputs.{input}"), scalar(default));
        } else if let Some(name) = line.strip_prefix("  ").and_then(|line| line.strip_suffix(':')) {
            input = name;
        }
    }
    let mut steps = Vec::new();
    let mut block = String::new();
    for line in steps_text.lines().filter(|line| !line.trim_start().starts_with('#')) {
        if line.starts_with("    - ") {
            steps.push(Step::default());
        }
        let Some((key, value)) = line.get(6..).and_then(|line| line.split_once(':')) else { continue };
        let step = steps.last_mut().expect("a step begins with a dash");
        match key.strip_prefix("  ") {
            Some(key) if block == "env" => step.env.push((key.into(), scalar(value))),
            Some(_) => {}
            None => {
                block = key.to_owned();
                step.fields.insert(key.into(), scalar(value));
            }
        }
    }
    (context, steps)
}

/// A name of a context, a text in quotes, or the first of several that is not empty.
fn value(expression: &str, context: &Context) -> String {
    let one = |part: &str| match part.trim().strip_prefix('\'') {
        Some(text) => text.trim_end_matches('\'').to_owned(),
        None => context.get(part.trim()).cloned().unwrap_or_default(),
    };
    expression.split("||").map(one).find(|value| !value.is_empty()).unwrap_or_default()
}

/// A text with the values of its expressions.
fn expanded(text: &str, context: &Context) -> String {
    let mut parts = text.split("${{");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (expression, rest) = part.split_once("}}").expect("an expression ends");
        out += &value(expression, context);
        out += rest;
    }
    out
}

/// Whether a step runs, given whether all before it did well.
fn runs(condition: &str, context: &Context, well: bool) -> bool {
    let parts: Vec<&str> = condition.split("&&").map(str::trim).filter(|part| !part.is_empty()).collect();
    let holds = |part: &str| match (part.split_once("!="), part.split_once("==")) {
        (Some((left, right)), _) => value(left, context) != value(right, context),
        (_, Some((left, right))) => value(left, context) == value(right, context),
        _ => panic!("a condition of another kind: {part}"),
    };
    (well || parts.contains(&"always()"))
        && parts.iter().filter(|part| **part != "always()").all(|part| holds(part))
}

struct Ran {
    /// Whether all steps did well.
    well: bool,
    out: String,
    context: Context,
    /// The names of the steps that ran.
    steps: Vec<String>,
}

const ARCHIVE: &str = "anyhit-x86_64-unknown-linux-musl.tar.gz";

/// A folder with the archive of a release, which is packed once for all tests.
static RELEASE: LazyLock<PathBuf> = LazyLock::new(|| {
    let releases = scratch("action-release");
    let name = ARCHIVE.trim_end_matches(".tar.gz");
    let packed = releases.join(name);
    std::fs::create_dir(&packed).expect("a folder");
    let program = std::env::var_os("ANYHIT_ACTION_PROGRAM");
    let program = program.unwrap_or_else(|| env!("CARGO_BIN_EXE_anyhit").into());
    std::fs::copy(program, packed.join("anyhit")).expect("the program");
    let pack = format!("tar -cf - {name} | gzip -1 > {ARCHIVE} && sha256sum {ARCHIVE} > {ARCHIVE}.sha256");
    let packed = Command::new("bash").args(["-o", "pipefail", "-c", &pack]).current_dir(&releases).status();
    assert!(packed.expect("bash").success());
    releases
});

/// A machine of GitHub with a checked-out project.
struct Runner {
    folder: tempfile::TempDir,
}

impl Runner {
    /// With a release of the program.
    fn new() -> Self {
        let runner = Self { folder: tempfile::tempdir().expect("a folder") };
        for folder in ["workspace", "temp", "releases"] {
            std::fs::create_dir(runner.path(folder)).expect("a folder");
        }
        for file in [ARCHIVE.to_owned(), format!("{ARCHIVE}.sha256")] {
            std::fs::copy(RELEASE.join(&file), runner.path("releases").join(&file)).expect("a copy");
        }
        runner
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file of the project.
    fn file(&self, name: &str, content: &[u8]) {
        let path = self.path("workspace").join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, content).expect("a file");
    }

    /// Carries out the action's steps with inputs.
    fn run(&self, inputs: &[(&str, &str)], environment: &[(&str, &str)]) -> Ran {
        let (mut context, steps) = action();
        for (name, input) in inputs {
            let known = context.insert(format!("inputs.{name}"), (*input).into());
            assert!(known.is_some(), "the action has an input `{name}`");
        }
        let workspace = self.path("workspace");
        let text = |path: &Path| path.to_str().expect("UTF-8").to_owned();
        context.insert("github.workspace".into(), text(&workspace));
        context.insert("github.server_url".into(), "https://invalid".into());
        let [output, path, env] = ["output", "path", "env"].map(|name| self.path("temp").join(name));
        let mut ran = Ran { well: true, out: String::new(), context, steps: Vec::new() };
        let mut search = std::env::var("PATH").expect("a search path");
        std::fs::write(&path, "").expect("a file");
        for step in steps {
            let field = |name: &str| step.fields.get(name).map_or("", String::as_str);
            if !runs(field("if"), &ran.context, ran.well) || !step.fields.contains_key("run") {
                continue;
            }
            ran.steps.push(step.fields["name"].clone());
            assert_eq!(field("shell"), "bash");
            std::fs::write(&output, "").expect("a file");
            let releases = format!("file://{}", self.path("releases").display());
            let folder = workspace.join(expanded(field("working-directory"), &ran.context));
            let mut command = Command::new("bash");
            command
                .args(["--noprofile", "--norc", "-eo", "pipefail", "-c", field("run")])
                .current_dir(folder);
            command
                .env("GITHUB_ACTION_PATH", ROOT)
                .env("GITHUB_WORKSPACE", &workspace)
                .env("GITHUB_JOB", "shaders")
                .env("GITHUB_STEP_SUMMARY", self.path("temp").join("summary"))
                .env("GITHUB_OUTPUT", &output)
                .env("GITHUB_PATH", &path)
                .env("GITHUB_ENV", &env)
                .env("RUNNER_TEMP", self.path("temp"))
                .env("RUNNER_OS", "Linux")
                .env("RUNNER_ARCH", "X64")
                .env("ANYHIT_RELEASES", releases)
                .env("PATH", &search);
            command.envs(step.env.iter().map(|(name, text)| (name, expanded(text, &ran.context))));
            command.envs(environment.iter().copied());
            let done = command.output().expect("bash");
            ran.well &= done.status.success();
            for bytes in [&done.stdout, &done.stderr] {
                ran.out += &String::from_utf8_lossy(bytes);
            }
            for line in std::fs::read_to_string(&output).expect("a file").lines() {
                let (name, text) = line.split_once('=').expect("an output has a name");
                ran.context.insert(format!("steps.{}.outputs.{name}", field("id")), text.into());
            }
            for line in std::fs::read_to_string(&path).expect("a file").lines() {
                search = format!("{line}:{search}");
            }
        }
        ran
    }
}

/// A project whose one case is green for this t.
fn project(runner: &Runner, folder: &str, t: &str) {
    let module = Path::new(ROOT).join("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv");
    runner.file(&format!("{folder}/main.rchit.spv"), &std::fs::read(module).expect("a fixture"));
    let scene = format!(
        r#"version = 1
[shaders]
sphere = "main.rchit.spv"
[pipeline]
hit = [{{ closest_hit = "sphere" }}]
[geometry.ball]
type = "spheres"
positions = [[0, 0, 0]]
radii = [0.5]
[[instance]]
geometry = "ball"
[[ray]]
name = "onto it"
origin = [0, 0, 4]
direction = [0, 0, -1]
expect = {{ t = {t}, because = "4 - 1/2" }}
"#
    );
    runner.file(&format!("{folder}/ball.test.toml"), scene.as_bytes());
}

/// What the action's scripts call.
const PROGRAMS: &[&str] = &["bash", "curl", "tar", "sha256sum"];

#[test]
fn a_green_project_passes_and_leaves_its_reports() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let runner = Runner::new();
    project(&runner, "cases", "3.5");
    let ran = runner.run(&[("cases", "cases"), ("coverage", "true")], &[]);
    assert!(ran.well, "{}", ran.out);
    assert_eq!(ran.steps, ["Install anyhit", "Run the cases"]);
    assert!(ran.out.contains("1 passed") && !ran.out.contains("::error"), "{}", ran.out);
    let reports = Path::new(&ran.context["steps.test.outputs.reports"]);
    let junit = std::fs::read(reports.join("junit.xml")).expect("the report");
    assert_eq!(junit_parser::from_reader(junit.as_slice()).expect("JUnit XML").tests, 1);
    assert!(reports.join("coverage.lcov").is_file());
    assert_eq!(ran.context["steps.test.outputs.artifact"], "anyhit-shaders");
    let summary = std::fs::read_to_string(runner.path("temp/summary")).expect("the summary");
    assert!(summary.starts_with("### anyhit: 1 passed"), "{summary}");
    let program = &ran.context["steps.install.outputs.anyhit"];
    let version = Command::new(program).arg("--version").output().expect("the installed program");
    assert_eq!(String::from_utf8_lossy(&version.stdout), concat!("anyhit ", env!("CARGO_PKG_VERSION"), "\n"));
}

#[test]
fn a_red_project_fails_with_an_annotation_from_the_root_of_the_repository() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let runner = Runner::new();
    project(&runner, "engine/shader tests/red", "3");
    project(&runner, "engine/green", "3.5");
    let inputs = [("cases", "shader tests\ngreen\n"), ("working-directory", "engine")];
    let ran = runner.run(&inputs, &[]);
    assert!(!ran.well, "{}", ran.out);
    assert!(ran.out.contains("1 passed, 1 failed"), "{}", ran.out);
    let annotation = "::error file=engine/shader tests/red/ball.test.toml,line=16,";
    assert!(ran.out.lines().any(|line| line.starts_with(annotation)), "{}", ran.out);
    assert!(Path::new(&ran.context["steps.test.outputs.reports"]).join("junit.xml").is_file());
    let summary = std::fs::read_to_string(runner.path("temp/summary")).expect("the summary");
    assert!(summary.contains("| engine/shader tests/red/ball.test.toml:16 |"), "{summary}");
    let sarif = std::fs::read_to_string(&ran.context["steps.test.outputs.sarif"]).expect("the results");
    assert!(sarif.contains("\"test-failed\"") && sarif.contains("engine/shader%20tests/red"), "{sarif}");
}

/// A folder without tests, one that is not there, and an option that is none.
#[test]
fn what_cannot_run_has_an_annotation() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let runner = Runner::new();
    project(&runner, "cases", "3.5");
    runner.file("empty/README", b"nothing");
    for (inputs, message) in [
        (&[("cases", "missing")][..], "names `missing`, which does not exist"),
        (&[("cases", "cases\nempty")], "names `empty`, which contains no test"),
        (&[("cases", "-h")], "names `-h`, which does not exist"),
        (&[("cases", " ")], "names no folder"),
        (&[("cases", "cases"), ("args", "--no-such-option")], "ended with exit code 2 before it ran a test"),
    ] {
        let ran = runner.run(inputs, &[]);
        assert!(!ran.well, "{}", ran.out);
        let annotation = "::error title=the cases were not run::";
        let told = ran.out.lines().find(|line| line.starts_with(annotation)).unwrap_or_default();
        assert!(told.contains(message), "{inputs:?}: {}", ran.out);
    }
}

/// Names of artifacts differ by job, place in a matrix, shard and use in a job.
#[test]
fn artifacts_have_names_of_their_own() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let runner = Runner::new();
    project(&runner, "cases", "3.5");
    let shard = [("cases", "cases"), ("shard", "1"), ("shards", "2")];
    let named = [("cases", "cases"), ("artifact", "a b\n/c")];
    let in_matrix = [("MATRIX_JOBS", "3"), ("MATRIX_JOB", "2")];
    let mut uses = Vec::new();
    for (inputs, environment) in [
        (&[("cases", "cases")][..], &[][..]),
        (&[("cases", "cases")], &in_matrix),
        (&shard, &in_matrix),
        (&named, &in_matrix),
    ] {
        let ran = runner.run(inputs, environment);
        assert!(ran.well, "{}", ran.out);
        uses.push(ran.context["steps.test.outputs.artifact"].clone());
        assert!(Path::new(&ran.context["steps.test.outputs.reports"]).join("junit.xml").is_file());
    }
    let expected = ["anyhit-shaders", "anyhit-shaders-3-use-2", "anyhit-shaders-3-shard-1-use-3", "a_b__c"];
    assert_eq!(uses, expected);
}

/// A tag or a commit pins the version of the action's files; a branch follows the latest.
#[test]
fn a_pin_brings_the_program_of_its_release() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let runner = Runner::new();
    let server = format!("file://{}", runner.path("server").display());
    let of_version = concat!("download/v", env!("CARGO_PKG_VERSION"));
    for (reference, folder) in [
        ("2f1c0dfe9d2d2c0f0c4d1c7b8a5e6f7a8b9c0d1e", of_version),
        ("v0", of_version),
        ("v0.1", of_version),
        ("", of_version),
        ("main", "latest/download"),
        ("v-next", "latest/download"),
    ] {
        let releases = runner.path("server/owner/anyhit/releases");
        let _ = std::fs::remove_dir_all(&releases);
        std::fs::create_dir_all(releases.join(folder)).expect("a folder");
        for file in [ARCHIVE.to_owned(), format!("{ARCHIVE}.sha256")] {
            std::fs::copy(RELEASE.join(&file), releases.join(folder).join(&file)).expect("a copy");
        }
        let ran = runner.run(
            &[("repository", "owner/anyhit")],
            &[("ANYHIT_RELEASES", ""), ("SERVER", &server), ("ACTION_REF", reference)],
        );
        assert!(ran.well, "{reference}: {}", ran.out);
    }
}

#[test]
fn shards_share_the_cases() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let runner = Runner::new();
    project(&runner, "cases/a", "3.5");
    project(&runner, "cases/b", "3.5");
    for shard in ["1", "2"] {
        let ran = runner.run(&[("cases", "cases"), ("shard", shard), ("shards", "2")], &[]);
        assert!(ran.well && ran.out.contains("1 passed"), "{}", ran.out);
    }
}

#[test]
fn without_cases_the_program_is_installed_alone() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let ran = Runner::new().run(&[], &[]);
    assert!(ran.well, "{}", ran.out);
    assert_eq!(ran.steps, ["Install anyhit"]);
}

#[test]
fn what_cannot_be_installed_is_told() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let runner = Runner::new();
    for (environment, message) in [
        (&[("RUNNER_ARCH", "X86")][..], "there is no build for Linux on X86"),
        (&[("RUNNER_ARCH", "ARM64")], "anyhit-aarch64-unknown-linux-musl.tar.gz cannot be read"),
        (&[("ANYHIT_RELEASES", "")], "needs `repository`"),
    ] {
        let ran = runner.run(&[("cases", "cases")], environment);
        assert!(!ran.well && ran.out.contains(message), "{}", ran.out);
        assert!(ran.out.contains("::error title=anyhit is not installed::"), "{}", ran.out);
        assert_eq!(ran.steps, ["Install anyhit"]);
    }
    let sum = runner.path("releases").join(format!("{ARCHIVE}.sha256"));
    std::fs::write(sum, format!("{}  {ARCHIVE}\n", "0".repeat(64))).expect("a file");
    let ran = runner.run(&[], &[]);
    assert!(!ran.well && ran.out.contains("has another SHA-256"), "{}", ran.out);
}

/// Options reach the program, and the findings of a suite are a file more.
#[test]
fn options_are_words_of_the_program() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let runner = Runner::new();
    project(&runner, "cases", "3.5");
    let inputs =
        [("cases", "cases"), ("sanitize", "true"), ("many-seeds", "2"), ("args", "--timeout=300 --no-times")];
    let ran = runner.run(&inputs, &[]);
    assert!(ran.well && ran.out.contains("1 passed"), "{}", ran.out);
    let sarif = std::fs::read_to_string(&ran.context["steps.test.outputs.sarif"]).expect("the findings");
    assert!(sarif.contains("\"version\": \"2.1.0\""), "{sarif}");
    let junit = Path::new(&ran.context["steps.test.outputs.reports"]).join("junit.xml");
    assert!(!std::fs::read_to_string(junit).expect("the report").contains(" time="));
    // A line each, with blanks within.
    let ran = runner.run(&[("cases", "cases"), ("args", "--filter=onto it\n--fail-fast\n")], &[]);
    assert!(ran.well && ran.out.contains("1 passed"), "{}", ran.out);
    let limited = [
        ("cases", "cases"),
        ("timeout", "300"),
        ("limits", "scene-memory=2GiB file-bytes=1MiB"),
        ("result", "true"),
    ];
    let ran = runner.run(&limited, &[]);
    assert!(ran.well && ran.out.contains("1 passed"), "{}", ran.out);
    let result = std::fs::read_to_string(&ran.context["steps.test.outputs.result"]).expect("the result");
    assert!(result.contains("\"command\""), "{result:.200}");
    let ran = runner.run(&[("cases", "cases"), ("limits", "scene-bytes=10")], &[]);
    assert!(!ran.well && ran.out.contains("scene-bytes"), "{}", ran.out);
    for (input, value, told) in [
        ("many-seeds", "0", "--many-seeds"),
        ("args", "--timeout 300", "a value behind `=`"),
        ("args", "--no-such-option", "--no-such-option"),
        ("args", "--", "a value behind `=`"),
    ] {
        let ran = runner.run(&[("cases", "cases"), (input, value)], &[]);
        assert!(!ran.well && ran.out.contains(told), "{input}={value}: {}", ran.out);
    }
}

/// Inputs may be made of what a pull request says: its title, its branch.
#[test]
fn no_input_is_a_command_of_the_shell() {
    if !skipped::has_programs(test_name!(), PROGRAMS) {
        return;
    }
    let runner = Runner::new();
    project(&runner, "cases", "3.5");
    let planted = runner.path("planted");
    let touch = planted.to_str().expect("UTF-8");
    for text in [
        format!("$(touch {touch})"),
        format!("`touch {touch}`"),
        format!("; touch {touch} #"),
        format!("\"; touch {touch} #"),
        format!("x\n$(touch {touch})\n"),
        format!("a[$(touch {touch})]"),
        "--help\n*\n~".to_owned(),
    ] {
        for input in ["cases", "args", "many-seeds", "sanitize", "coverage", "shard", "shards"] {
            let mut inputs = vec![("cases", "cases")];
            inputs.push((input, &text));
            let _ = runner.run(&inputs, &[]);
            assert!(!planted.exists(), "{input}={text}");
        }
    }
    for input in ["timeout", "limits", "result", "artifact"] {
        let _ = runner.run(&[("cases", "cases"), (input, &format!("a[$(touch {touch})]"))], &[]);
        assert!(!planted.exists(), "{input}");
    }
}

/// Tags of releases: the latest of all, the latest of a major version, a patch of an older line
/// and a pre-release.
#[test]
fn only_the_latest_version_becomes_the_latest_release() {
    if !skipped::has_programs(test_name!(), &["bash", "git", "sort"]) {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join(".ci")).expect("a folder");
    for file in [".ci/release", "Cargo.toml", "CHANGELOG.md"] {
        std::fs::copy(Path::new(ROOT).join(file), folder.path().join(file)).expect("a copy");
    }
    let run = |program: &str, arguments: &[&str]| {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(folder.path());
        for (name, value) in [("AUTHOR", "a"), ("COMMITTER", "a")] {
            command.env(format!("GIT_{name}_NAME"), value).env(format!("GIT_{name}_EMAIL"), "a@example.org");
        }
        command.output().expect("it starts").status.success()
    };
    assert!(run("git", &["init", "-q"]) && run("git", &["commit", "-q", "--allow-empty", "-m", "a"]));
    for tag in ["v0", "v0.9.0", "v0.10.0", "v0.10.1", "v1.0.0", "v1.1.0-rc.1", "v1.0.1-rc.1"] {
        assert!(run("git", &["tag", tag]), "{tag}");
    }
    let latest = |arguments: &[&str]| run("bash", &[&[".ci/release", "--latest"], arguments].concat());
    assert!(latest(&["v1.0.0"]) && latest(&["v1.0.0", "v1.*"]));
    assert!(latest(&["v0.10.1", "v0.*"]));
    for others in [
        &["v0.10.1"][..],
        &["v0.10.0", "v0.*"],
        &["v0.9.0", "v0.*"],
        &["v1.1.0-rc.1"],
        &["v1.1.0-rc.1", "v1.*"],
    ] {
        assert!(!latest(others), "{others:?}");
    }
}
