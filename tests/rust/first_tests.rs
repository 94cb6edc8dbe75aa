//! The first tests of `docs/testing.md`, taken out of the page and run.
//!
//! `tests/rust/first_tests/` holds the files that the page shows: shaders and cases as they stand
//! there, and of the Rust tests the functions, with the folder before their shaders' names. Whoever
//! changes the page brings them in step by `BLESS=1 cargo test --test main first_tests::`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use pretty_assertions::assert_eq;

use crate::support::files::root;
use crate::support::skipped::{self, test_name};

#[cfg(feature = "glsl")]
mod lss_glsl;
mod lss_slang;
#[cfg(feature = "wgsl")]
mod triangle;

const PAGE: &str = "docs/testing.md";
const FOLDER: &str = "tests/rust/first_tests";

/// The files of the page: their names, and what this folder holds of them.
fn files() -> Vec<(PathBuf, String)> {
    let page = std::fs::read_to_string(root().join(PAGE)).expect("the page").replace("\r\n", "\n");
    let mut files = Vec::new();
    let mut open: Option<(String, String)> = None;
    for line in page.lines() {
        match &mut open {
            None => {
                let name = line.strip_prefix("```").and_then(|line| line.split_once(" file="));
                open = name.map(|(_, name)| (name.trim().to_owned(), String::new()));
            }
            Some((name, text)) if line == "```" => {
                files.push(here(name, text));
                open = None;
            }
            Some((_, text)) => {
                text.push_str(line);
                text.push('\n');
            }
        }
    }
    files
}

/// Where a file of the page stands here, and how.
fn here(name: &str, text: &str) -> (PathBuf, String) {
    match name.strip_prefix("tests/") {
        None => (Path::new(FOLDER).join(name), text.to_owned()),
        Some(name) => {
            assert_eq!(text.matches("#[test]\nfn ").count(), 1, "{name}: one test, called from here");
            let text = text.replace("#[test]\nfn ", "pub fn ");
            (Path::new(FOLDER).join(name), text.replace("\"shaders/", &format!("\"{FOLDER}/shaders/")))
        }
    }
}

#[test]
fn the_files_are_those_of_the_page() {
    let files = files();
    assert_eq!(files.len(), 9, "a shader, a test and a case in three languages");
    for (name, text) in files {
        let path = root().join(&name);
        if std::env::var_os("BLESS").is_some() {
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a writable folder");
            std::fs::write(&path, &text).expect("a writable folder");
        }
        let found = std::fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
        assert_eq!(found, text, "{}: `BLESS=1 cargo test --test main first_tests::`", name.display());
    }
}

/// Runs a case of the page; how many rays must hold.
fn case(name: &str, rays: usize) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.arg("test").arg(format!("{FOLDER}/cases/{name}.test.toml"));
    let output = command.current_dir(root()).stdin(Stdio::null()).output().expect("the program");
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(0), "{out}{err}");
    assert!(out.ends_with(&format!("{rays} passed\n")), "{out}");
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn in_glsl() {
    #[cfg(feature = "glsl")]
    lss_glsl::seen_from_above_the_normal_points_up().expect("the test of the page");
    case("lss_glsl", 2);
}

#[test]
fn in_slang() {
    if !skipped::has_slangc(test_name!()) {
        return;
    }
    lss_slang::a_cone_leans_towards_its_thin_end().expect("the test of the page");
    case("lss_slang", 1);
}

#[test]
#[cfg_attr(not(feature = "wgsl"), ignore = "needs the feature `wgsl`")]
fn in_wgsl() {
    #[cfg(feature = "wgsl")]
    triangle::the_normal_faces_the_viewer_from_both_sides().expect("the test of the page");
    case("triangle", 2);
}
