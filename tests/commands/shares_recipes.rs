//! The recipes of `docs/scale.md`: their commands run as local processes, and the report that is
//! merged is that of one run.

use std::path::Path;
use std::process::Command;

use pretty_assertions::assert_eq;

use crate::support::files::root;
use crate::support::program::{Ran, anyhit, ran, scratch};

/// What the recipes call `shaders`.
const SHADERS: &str = "shaders/pass/testing";

/// A line for a shell, in a folder where the program is found, with variables.
fn shell(line: &str, folder: &Path, variables: &[(&str, String)]) -> Ran {
    let program = Path::new(env!("CARGO_BIN_EXE_anyhit")).parent().expect("a folder");
    let path = std::env::var_os("PATH").unwrap_or_default();
    let paths = std::iter::once(program.to_path_buf()).chain(std::env::split_paths(&path));
    let mut command = Command::new("sh");
    // Names of tests are paths: the tests are found from the repository's root.
    let line = line.replace(" shaders ", &format!(" {SHADERS} "));
    let line = line.replace("/results/", "results/").replace("results/", &format!("{}/", folder.display()));
    command.args(["-c", &line]).env("PATH", std::env::join_paths(paths).expect("paths"));
    command.envs(variables.iter().map(|(name, value)| (name, value)));
    ran(command)
}

/// The merged results of a folder, beside one run.
fn compare(folder: &Path, merge: &str) {
    let whole = anyhit(&["test", SHADERS]);
    let merged = shell(merge, folder, &[]);
    assert_eq!((&merged.out, merged.code), (&whole.out, Some(0)), "{}", merged.err);
    assert!(!whole.out.is_empty());
}

fn page() -> String {
    std::fs::read_to_string(root().join("docs/scale.md")).expect("the page").replace("\r\n", "\n")
}

/// The line of a text that holds some words, without blanks around it.
fn line<'a>(text: &'a str, words: &str) -> &'a str {
    text.lines().find(|line| line.contains(words)).unwrap_or_else(|| panic!("no line with {words}")).trim()
}

/// The value at a path of keys in YAML of blocks, as the manifest has it: a key stands further in
/// than the one before.
fn yaml<'a>(text: &'a str, keys: &[&str]) -> Option<&'a str> {
    let depth = |line: &str| line.len() - line.trim_start_matches([' ', '-']).len();
    let mut lines = text.lines().filter(|line| !line.trim_start().starts_with('#')).peekable();
    let (mut inside, mut value) = (0, None);
    for key in keys {
        let wanted = format!("{key}:");
        let found = lines
            .by_ref()
            .take_while(|line| depth(line) >= inside)
            .find(|line| line.trim_start_matches([' ', '-']).starts_with(&wanted))?;
        value = Some(found.trim_start_matches([' ', '-'])[wanted.len()..].trim());
        inside = depth(found) + 1;
    }
    value
}

#[test]
fn the_kubernetes_job_does_every_share() {
    let manifest =
        std::fs::read_to_string(root().join("examples/scale/kubernetes-job.yaml")).expect("the manifest");
    // An indexed Job (https://kubernetes.io/docs/concepts/workloads/controllers/job).
    for (keys, expected) in [
        (&["apiVersion"][..], "batch/v1"),
        (&["kind"], "Job"),
        (&["metadata", "name"], "anyhit-shaders"),
        (&["spec", "completionMode"], "Indexed"),
        (&["spec", "completions"], "4"),
        (&["spec", "template", "spec", "restartPolicy"], "Never"),
        (&["spec", "template", "spec", "containers", "name"], "anyhit"),
        (&["spec", "template", "spec", "containers", "command"], "[\"sh\", \"-c\"]"),
        (&["spec", "template", "spec", "containers", "volumeMounts", "mountPath"], "/results"),
        (&["spec", "template", "spec", "volumes", "persistentVolumeClaim", "claimName"], "anyhit-results"),
    ] {
        assert_eq!(yaml(&manifest, keys), Some(expected), "{keys:?}");
    }
    assert!(!manifest.contains('\t'));
    let command = line(&manifest, "anyhit test").trim_start_matches("- ");
    let folder = scratch("recipe-kubernetes");
    for index in 0..4 {
        let ran = shell(command, &folder, &[("JOB_COMPLETION_INDEX", index.to_string())]);
        assert_eq!(ran.code, Some(0), "{}", ran.err);
    }
    // A pod that is started again leaves the same.
    shell(command, &folder, &[("JOB_COMPLETION_INDEX", "2".to_owned())]);
    compare(&folder, "anyhit merge results/*.json");
}

#[test]
fn the_slurm_array_does_every_share() {
    let page = page();
    let script = page.split("```bash\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a script");
    assert!(script.starts_with("#!/bin/bash\n#SBATCH --array=1-4 "), "{script}");
    let folder = scratch("recipe-slurm");
    for task in 1..=4 {
        let variables =
            [("SLURM_ARRAY_TASK_ID", task.to_string()), ("SLURM_ARRAY_TASK_COUNT", "4".to_owned())];
        let ran = shell(line(script, "anyhit test"), &folder, &variables);
        assert_eq!(ran.code, Some(0), "{}", ran.err);
    }
    let merge = line(&page, "sbatch --dependency").split('\'').nth(1).expect("the command");
    compare(&folder, merge);
}

#[test]
fn the_github_matrix_does_every_share() {
    let page = page();
    let workflow =
        page.split("```yaml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a workflow");
    assert_eq!(yaml(workflow, &["jobs", "merge", "needs"]), Some("shaders"));
    let strategy = yaml(workflow, &["jobs", "shaders", "strategy"]).expect("a strategy");
    assert!(strategy.contains("shard: [1, 2, 3, 4]"), "{strategy}");
    let folder = scratch("recipe-github");
    let run = |words: &str| line(workflow, words).trim_start_matches("- run: ").to_owned();
    for shard in 1..=4 {
        let command =
            run("anyhit test").replace("${{ matrix.shard }}.json", &format!("results/{shard}.json"));
        let ran = shell(&command.replace("${{ matrix.shard }}", &shard.to_string()), &folder, &[]);
        assert_eq!(ran.code, Some(0), "{}", ran.err);
    }
    let merge =
        run("anyhit merge").replace("*.json", "results/*.json").replace("junit.xml", "results/junit.xml");
    compare(&folder, &merge);
    assert!(folder.join("junit.xml").is_file());
}

#[test]
fn bazel_does_every_share() {
    let page = page();
    assert!(page.contains("    shard_count = 4,\n"), "the rule");
    let folder = scratch("recipe-bazel");
    for index in 0..4 {
        let variables = [
            ("TEST_SHARD_INDEX", index.to_string()),
            ("TEST_TOTAL_SHARDS", "4".to_owned()),
            ("TEST_SHARD_STATUS_FILE", folder.join("status").display().to_string()),
        ];
        // `exec anyhit test "$@"` with the rule's arguments; Bazel itself merges no reports.
        let command = format!("anyhit test shaders --result results/{index}.json");
        let ran = shell(&command, &folder, &variables);
        assert_eq!(ran.code, Some(0), "{}", ran.err);
        assert!(folder.join("status").is_file());
    }
    compare(&folder, "anyhit merge results/*.json");
}

/// A command of a recipe that goes on over several lines: those that stand further in.
fn folded(text: &str, words: &str) -> String {
    let depth = |line: &str| line.len() - line.trim_start().len();
    let mut lines = text.lines().skip_while(|line| !line.contains(words));
    let first = lines.next().unwrap_or_else(|| panic!("no line with {words}"));
    let rest = lines.take_while(|line| {
        depth(line) >= depth(first) && !line.trim().starts_with("- ") && line.trim() != "'''"
    });
    let all = std::iter::once(first).chain(rest).map(|line| line.trim().trim_end_matches(" \\"));
    all.take_while(|line| !line.ends_with(':')).collect::<Vec<_>>().join(" ")
}

/// The commands of the recipes for GitLab and Jenkins, with the files that they publish.
#[test]
fn the_pipelines_of_gitlab_and_jenkins_do_every_share() {
    let page = std::fs::read_to_string(root().join("docs/ci-recipes.md")).expect("the page");
    let (gitlab, jenkins) = page.split_once("## Jenkins").expect("both recipes");
    for (name, recipe, program, index) in
        [("gitlab", gitlab, ".anyhit/bin/anyhit", "CI_NODE_INDEX"), ("jenkins", jenkins, "./anyhit", "SHARD")]
    {
        let folder = scratch(&format!("recipe-{name}"));
        let here = |command: String| {
            let mut command = command.replace(program, "anyhit");
            for file in ["coverage.xml", "junit.xml", "results.sarif", "code-quality.json"] {
                command = command.replace(file, &format!("results/{file}"));
            }
            command.replace(" pictures", " results/pictures")
        };
        for shard in 1..=4 {
            let variables = [(index, shard.to_string()), ("CI_NODE_TOTAL", "4".to_owned())];
            let ran = shell(&here(folded(recipe, &format!("{program} test"))), &folder, &variables);
            assert_eq!(ran.code, Some(0), "{name}: {} {}", ran.out, ran.err);
        }
        let ran = shell(&here(folded(recipe, &format!("{program} merge"))), &folder, &[]);
        assert_eq!(ran.code, Some(0), "{name}: {} {}", ran.out, ran.err);
        let read = |file: &str| {
            std::fs::read_to_string(folder.join(file))
                .unwrap_or_else(|error| panic!("{name}: {file}: {error}"))
        };
        assert!(read("coverage.xml").contains("<class name="), "{name}");
        assert!(read("results.sarif").contains("2.1.0"), "{name}");
        if name == "gitlab" {
            let quality: serde_json::Value = serde_json::from_str(&read("code-quality.json")).expect("JSON");
            assert!(quality.is_array());
        } else {
            assert!(read("junit.xml").contains("<testsuites"));
        }
    }
}
