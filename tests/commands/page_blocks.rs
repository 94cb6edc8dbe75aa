//! The command blocks of docs/ci.md and docs/scale.md: each line runs, in the order of the page, in
//! a project whose folder `shaders` has tests.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::files::root;
use crate::support::program::scratch;
use crate::support::skipped::{self, test_name};

/// The languages and texts of a page's blocks.
fn blocks(page: &str) -> Vec<(String, String)> {
    let text = std::fs::read_to_string(root().join(page)).expect("the page").replace("\r\n", "\n");
    let parts: Vec<&str> = text.split("```").collect();
    let blocks = parts.iter().skip(1).step_by(2).filter_map(|block| block.split_once('\n'));
    blocks.map(|(language, text)| (language.to_owned(), text.to_owned())).collect()
}

/// A project with four tests and the program on its path.
struct Project {
    folder: PathBuf,
}

impl Project {
    fn new(name: &str) -> Self {
        let folder = scratch(name);
        let module = root().join("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv");
        for radius in ["0.5", "1.0", "1.5", "2.0"] {
            let tests = folder.join("shaders").join(format!("ball-{radius}"));
            std::fs::create_dir_all(&tests).expect("a folder");
            std::fs::copy(&module, tests.join("main.rchit.spv")).expect("a fixture");
            let t = 4.0 - radius.parse::<f32>().expect("a number");
            let scene = format!(
                "version = 1\n[shaders]\nsphere = \"main.rchit.spv\"\n\
                 [pipeline]\nhit = [{{ closest_hit = \"sphere\" }}]\n\
                 [geometry.ball]\ntype = \"spheres\"\npositions = [[0, 0, 0]]\nradii = [{radius}]\n\
                 [[instance]]\ngeometry = \"ball\"\n\
                 [[ray]]\nname = \"onto it\"\norigin = [0, 0, 4]\ndirection = [0, 0, -1]\n\
                 expect = {{ t = {t}, because = \"4 - the radius\" }}\n"
            );
            std::fs::write(tests.join("scene.toml"), scene).expect("a file");
        }
        Self { folder }
    }

    fn run(&self, line: &str) {
        let program = Path::new(env!("CARGO_BIN_EXE_anyhit")).parent().expect("a folder");
        let path = std::env::var_os("PATH").unwrap_or_default();
        let paths = std::iter::once(program.to_path_buf()).chain(std::env::split_paths(&path));
        let mut command = Command::new("bash");
        command.args(["-ec", line]).current_dir(&self.folder).env_remove("GITHUB_WORKSPACE");
        command.env("PATH", std::env::join_paths(paths).expect("paths"));
        let output = command.output().expect("bash");
        let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        assert!(output.status.success(), "{line}\n{}", said.concat());
        assert!(!said.concat().contains(" 0 passed"), "{line}\n{}", said.concat());
    }

    fn has(&self, files: &[&str]) {
        for file in files {
            assert!(self.folder.join(file).exists(), "{file}");
        }
    }
}

#[test]
fn of_shards_on_several_machines() {
    if !skipped::has_programs(test_name!(), &["bash"]) {
        return;
    }
    let project = Project::new("blocks-scale");
    let (mut lines, mut elsewhere) = (0, Vec::new());
    for (language, block) in blocks("docs/scale.md") {
        // Recipes of schedulers: `shares_recipes` runs them.
        if language != "text" || block.starts_with("sh_test(") {
            elsewhere.push(language);
            continue;
        }
        // A synopsis: each option in brackets is one of the command.
        if block.contains("FILE...") {
            let command = anyhit::cli::command();
            let merge = command.find_subcommand("merge").expect("a command");
            for option in block.split(['[', ']']).filter(|part| part.starts_with('-')) {
                let option = option.split(' ').next().unwrap_or_default();
                let name = option.trim_start_matches('-');
                let is = |one: &clap::Arg| {
                    one.get_long() == Some(name) || one.get_short().map(String::from).as_deref() == Some(name)
                };
                assert!(merge.get_arguments().any(is), "{option}");
            }
            continue;
        }
        for line in block.lines() {
            let line = line.replace("NAME", "ball-1.5");
            let (command, comment) = line.split_once('#').unwrap_or((&line, ""));
            if comment.contains("on four machines") {
                for shard in 1..=4 {
                    let own = command.replace("1/4", &format!("{shard}/4"));
                    let own = own.replace("1.lcov", &format!("{shard}.lcov"));
                    project.run(&own.replace("1.json", &format!("{shard}.json")));
                }
            } else {
                project.run(command);
            }
            if let Some((_, other)) = comment.split_once("or: ") {
                project.run(other);
            }
            lines += 1;
        }
    }
    assert_eq!((lines, elsewhere), (7, ["yaml", "bash", "text"].map(str::to_owned).to_vec()));
    project.has(&["1.lcov", "4.json", "junit.xml", "coverage.lcov", "timings.json", "2.json"]);
}

#[test]
fn of_tests_in_ci() {
    if !skipped::has_programs(test_name!(), &["bash"]) {
        return;
    }
    let project = Project::new("blocks-ci");
    let blocks = blocks("docs/ci.md");
    let languages: Vec<&str> = blocks.iter().map(|(language, _)| language.as_str()).collect();
    assert_eq!(languages, ["sh", "toml", "rust,ignore", "yaml", "yaml", "yaml", "text", "yaml", "yaml"]);
    let (install, test) = blocks[0].1.split_once('\n').expect("two lines");
    // `.ci/package` installs the program; the example has the lines for `cargo test`.
    assert!(install.starts_with("cargo install --locked --path anyhit "), "{install}");
    project.run(test);
    project.has(&["junit.xml"]);
    let example = |file: &str| {
        std::fs::read_to_string(root().join("examples/shader-crate").join(file)).expect("a file")
    };
    let manifest = example("Cargo.toml");
    let tests = blocks[1].1.split_once("[[test]]\n").expect("a test").1.replace("shaders", "cases");
    for line in tests.lines() {
        assert!(manifest.contains(line.split(" #").next().unwrap_or_default().trim()), "{line}");
    }
    assert!(example("tests/cases.rs").contains(&blocks[2].1.replace("shaders", "cases")));
    // The workflow, with the program where it installs it.
    let workflow = &blocks[3].1;
    let (_, script) = workflow.split_once("      - run: |\n").expect("a script");
    let script: Vec<&str> = script.lines().take_while(|line| line.starts_with("          ")).collect();
    assert_eq!(script.len(), 3, "{script:?}");
    let program = env!("CARGO_BIN_EXE_anyhit");
    project.run(&format!("mkdir -p .anyhit/bin && ln -s '{program}' .anyhit/bin/anyhit"));
    project.run(&script.join("\n"));
    project.has(&["reports/junit.xml", "reports/findings.sarif"]);
    assert!(blocks[4].1.contains("sarif_file: reports/findings.sarif"));
    // A hook is what `.pre-commit-hooks.yaml` has under its name.
    let hooks = std::fs::read_to_string(root().join(".pre-commit-hooks.yaml")).expect("the hooks");
    let value = |text: &str, key: &str| -> String {
        let line = text.lines().find_map(|line| line.trim().strip_prefix(key)).expect("a key");
        line.split('#').next().unwrap_or_default().trim().to_owned()
    };
    let id = value(&blocks[5].1, "- id: ");
    let hook = hooks.split("- id: ").find(|hook| hook.starts_with(&format!("{id}\n"))).expect("the hook");
    let arguments = value(&blocks[5].1, "args: ");
    project.run(&format!("{} {}", value(hook, "entry: "), arguments.trim_matches(['[', ']'])));
    // `.ci/judge-release` builds and runs the image.
    let containerfile = std::fs::read_to_string(root().join("Containerfile")).expect("the image");
    for line in blocks[6].1.lines() {
        assert!(containerfile.contains(&format!("#   {line}\n")), "{line}");
    }
    // The action runs in `action`; here, that its inputs are inputs.
    let inputs = |file: &str| std::fs::read_to_string(root().join(file)).expect("the inputs");
    for (block, file, known) in [(7, "action.yml", 2), (8, ".github/workflows/shader-tests.yml", 4)] {
        let declared = inputs(file);
        let (_, with) = blocks[block].1.split_once("with:\n").expect("inputs");
        let names: Vec<&str> = with.lines().filter_map(|line| line.trim().split(':').next()).collect();
        assert_eq!(names.len(), known, "{names:?}");
        for name in names {
            assert!(declared.lines().any(|line| line.trim() == format!("{name}:")), "{name}");
        }
    }
}
