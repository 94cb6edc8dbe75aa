//! What the documents tell the reader to type and to open exists.

use std::fs;
use std::path::Path;
use std::process::Command;

use pretty_assertions::assert_eq;

use crate::support::files::root;

const DOCUMENTS: &[&str] = &["README.md", "CONTRIBUTING.md"];

#[test]
fn commands_are_real() {
    let mut mistakes = Vec::new();
    let mut count = 0;
    for (document, line) in shell_lines() {
        // Assignments in front of a command, like BLESS=1, are no part of it.
        let words = line.split_whitespace().skip_while(|word| word.contains('=')).collect::<Vec<&str>>();
        let wrong = match words.as_slice() {
            ["cargo", "run", rest @ ..] => {
                count += 1;
                anyhit_arguments(rest).and_then(|arguments| parse(&arguments))
            }
            ["anyhit", arguments @ ..] => {
                count += 1;
                parse(arguments)
            }
            ["cargo", "test", rest @ ..] => test_targets(rest),
            [script, ..] if script.starts_with(".ci/") => exists(script),
            ["cargo", ..] => Ok(()),
            _ => Err(format!("`{line}` is no command that this test knows")),
        };
        let mut files = words.iter().filter(|word| word.contains('/') && !word.starts_with('-'));
        let wrong = wrong.and_then(|()| files.try_for_each(|word| exists(word)));
        if let Err(wrong) = wrong {
            mistakes.push(format!("{document}: {line}: {wrong}"));
        }
    }
    assert!(count >= 4, "only {count} commands were found");
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

#[test]
fn links_lead_somewhere() {
    let mut mistakes = Vec::new();
    let mut count = 0;
    let pages = fs::read_dir(root().join("docs")).expect("the pages");
    let pages = pages.map(|entry| entry.expect("a page").file_name().into_string().expect("a plain name"));
    let pages = pages.filter(|name| name.ends_with(".md")).map(|name| format!("docs/{name}"));
    for document in DOCUMENTS.iter().map(|&name| name.to_owned()).chain(pages) {
        let text = read(&document);
        let folder = Path::new(&document).parent().unwrap_or(Path::new(""));
        for (at, _) in text.match_indices("](") {
            let target = text[at + 2..].split([')', '#']).next().unwrap_or_default();
            if target.is_empty() || target.contains("://") || target.contains(' ') {
                continue;
            }
            count += 1;
            if let Err(wrong) = exists(&folder.join(target).to_string_lossy()) {
                mistakes.push(format!("{document}: {wrong}"));
            }
        }
    }
    assert!(count >= 3, "only {count} links were found");
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

/// The README's Rust code is compiled and run, word for word.
#[test]
fn the_unit_test_of_the_readme_is_a_test() {
    let readme = read("README.md");
    let block = block(&readme, "rust");
    assert!(block.lines().count() > 10, "the block is too short:\n{block}");
    assert!(
        read("tests/rust/unit_test.rs").contains(block.trim_end()),
        "tests/rust/unit_test.rs has another test"
    );
}

/// Output that the README shows is what the command prints; `...` omits lines.
#[test]
fn the_output_of_the_readme_is_real() {
    let readme = read("README.md");
    let mut shown = block(&readme, "console").lines();
    let command = shown.next().and_then(|line| line.strip_prefix("$ anyhit ")).expect("a command");
    let output = Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .args(command.split_whitespace())
        .current_dir(root())
        .output()
        .expect("the program runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = String::from_utf8(output.stdout).expect("UTF-8");
    let mut lines = output.lines();
    let (mut count, mut adjacent) = (0, false);
    for line in shown {
        if line == "..." {
            adjacent = false;
            continue;
        }
        let printed = if adjacent { lines.next() } else { lines.find(|&printed| printed == line) };
        assert_eq!(printed, Some(line), "in the output of `anyhit {command}`:\n{output}");
        (count, adjacent) = (count + 1, true);
    }
    assert!(count >= 8, "only {count} lines are shown");
}

/// The content of a page's first block of a language.
fn block<'a>(page: &'a str, language: &str) -> &'a str {
    let fence = format!("```{language}\n");
    let start = page.find(&fence).expect("a block") + fence.len();
    page[start..].split("```").next().unwrap_or_default()
}

/// What the page about renderers shows of the example is in the example.
#[test]
fn the_page_about_renderers_shows_the_example() {
    let without_comments = |text: &str| -> String {
        let lines = text.lines().map(|line| line.split(" # ").next().unwrap_or_default().trim());
        lines.filter(|line| !line.starts_with('#')).collect::<Vec<_>>().join("\n")
    };
    let page = read("docs/renderer.md");
    let blocks = |language: &str| -> Vec<String> {
        let fence = format!("```{language}\n");
        let starts = page.match_indices(&fence).map(|(at, fence)| at + fence.len());
        starts.map(|at| without_comments(page[at..].split("\n```").next().unwrap_or_default())).collect()
    };
    let (scene, shader) = ("examples/renderer/scene.toml", "examples/renderer/raytrace.slang");
    let shown = [
        ("toml", scene, "[pipeline]"),
        ("toml", scene, "[resources.topLevelAS]"),
        ("toml", scene, "[resources.textures]"),
        ("toml", scene, "[resources.instances]"),
        ("toml", scene, "[resources.scene_info.data]"),
        ("toml", scene, "[push_constants]"),
        ("toml", scene, "[[pass]]"),
        ("slang", shader, "Instance instance"),
    ];
    for (language, file, start) in shown {
        let block = blocks(language).into_iter().find(|block| block.starts_with(start));
        let block = block.unwrap_or_else(|| panic!("the page has no block that begins with `{start}`"));
        let text = without_comments(&read(file));
        for paragraph in block.split("\n\n") {
            assert!(text.contains(paragraph), "this is not in {file}:\n{paragraph}");
        }
    }
}

/// The commands of the documents' shell blocks, without comments.
fn shell_lines() -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    for document in DOCUMENTS {
        let mut inside = false;
        for line in read(document).lines() {
            match line {
                "```sh" => inside = true,
                "```" => inside = false,
                _ if inside => {
                    let command = line.split('#').next().unwrap_or_default().trim_end();
                    if !command.is_empty() {
                        lines.push((*document, command.to_owned()));
                    }
                }
                _ => {}
            }
        }
    }
    lines
}

/// What the program is given behind `cargo run`'s own flags.
fn anyhit_arguments<'a>(words: &[&'a str]) -> Result<Vec<&'a str>, String> {
    let mut words = words.iter().copied();
    let mut arguments = Vec::new();
    while let Some(word) = words.next() {
        match word {
            "--release" => {}
            "--features" => {
                let feature = words.next().unwrap_or_default();
                let manifest = read("Cargo.toml");
                if !manifest.contains(&format!("\n{feature} = [")) {
                    return Err(format!("there is no feature {feature}"));
                }
            }
            "--" => arguments.extend(words.by_ref()),
            _ if word.starts_with('-') => return Err(format!("cargo run {word}?")),
            _ => {
                arguments.push(word);
                arguments.extend(words.by_ref());
            }
        }
    }
    Ok(arguments)
}

fn parse(arguments: &[&str]) -> Result<(), String> {
    let line = std::iter::once("anyhit").chain(arguments.iter().copied());
    anyhit::cli::command().try_get_matches_from(line).map(|_| ()).map_err(|error| error.to_string())
}

/// A name behind `--test` is a target, and a path behind that begins with a module of it.
fn test_targets(words: &[&str]) -> Result<(), String> {
    let Some(at) = words.iter().position(|&word| word == "--test") else { return Ok(()) };
    let name = words.get(at + 1).copied().unwrap_or_default();
    if !read("Cargo.toml").contains(&format!("[[test]]\nname = \"{name}\"\n")) {
        return Err(format!("there is no test {name}"));
    }
    // `rays::` is a folder, `laws::` a file in one of them.
    let tests = root().join("tests");
    let folders = || fs::read_dir(&tests).expect("the tests").map(|entry| entry.expect("an entry").path());
    let mut areas = words.iter().filter_map(|word| word.split_once("::"));
    areas.try_for_each(|(area, _)| {
        let is_file = folders().any(|folder| folder.join(format!("{area}.rs")).is_file());
        let is_known = is_file || tests.join(area).join("mod.rs").is_file();
        if is_known { Ok(()) } else { Err(format!("no test module is named {area}")) }
    })
}

fn exists(path: &str) -> Result<(), String> {
    if root().join(path).exists() { Ok(()) } else { Err(format!("{path} does not exist")) }
}

fn read(document: &str) -> String {
    fs::read_to_string(root().join(document)).expect("a readable document").replace("\r\n", "\n")
}
