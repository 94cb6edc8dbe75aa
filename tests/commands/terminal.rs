//! The program in terminals of 80 and 120 columns: progress, Ctrl-C, the prompt of the debugger,
//! and the short help.

use std::path::Path;

use crate::support::program::{at, scratch};
use crate::support::skipped::{is_ignored, skipped, test_name};
use crate::support::terminal::{Terminal, run};

const COLUMNS: [u16; 2] = [80, 120];
const DEMO: &str = "scenes/swept-spheres.toml";

/// Writes the scene of the demo with 100 times the grass, which takes seconds to read and build.
fn write_large_scene(folder: &Path) -> String {
    let root = env!("CARGO_MANIFEST_DIR");
    let read = |name: &str| {
        let text = std::fs::read_to_string(format!("{root}/scenes/{name}.toml")).expect("a scene");
        text.replace("\"../", &format!("\"{root}/"))
    };
    let geometry = read("swept-spheres-geometry").replace("count = 30_000", "count = 3_000_000");
    let scene = read("swept-spheres").replace("swept-spheres-geometry", "large-geometry");
    std::fs::write(folder.join("large-geometry.toml"), geometry).expect("a file");
    std::fs::write(folder.join("large.toml"), scene).expect("a file");
    at(folder, "large.toml")
}

/// Work of seconds is shown in the last line of the terminal, and Ctrl-C leaves nothing of it.
/// `names` are those of phases, one of which takes long.
fn shows(names: &[&str], arguments: &[&str]) {
    let is_bar = |line: &String| names.iter().any(|name| line.starts_with(&format!("{name}  ")));
    for columns in COLUMNS {
        let terminal = Terminal::start(arguments, columns);
        let lines = terminal.wait_until(names[0], &|lines| lines.iter().any(is_bar));
        assert_eq!(lines.iter().filter(|line| is_bar(line)).count(), 1, "{columns} columns: {lines:#?}");
        assert!(lines.last().is_some_and(is_bar), "the last line: {lines:#?}");
        terminal.interrupt();
        let (code, lines, _) = terminal.finish();
        assert_eq!(code, None, "{names:?}: a signal ends it: {lines:#?}");
        assert!(!lines.iter().any(is_bar), "{names:?}: {lines:#?}");
    }
}

/// Returns true if Ctrl-C ends programs; if not, `test` is skipped.
fn can_interrupt(test: &str) -> bool {
    const SIGINT: i32 = 2;
    if is_ignored(SIGINT) {
        skipped(test, "the caller ignores SIGINT");
    }
    !is_ignored(SIGINT)
}

#[test]
fn large_scenes_show_their_progress() {
    if can_interrupt(test_name!()) {
        let folder = scratch("terminal-large");
        let (scene, picture) = (write_large_scene(&folder), at(&folder, "large.png"));
        // The first ray builds the acceleration structure.
        let phases = ["loading the scene", "building the scene", "rendering"];
        shows(&phases, &["render", &scene, "--size", "8x8", "-o", &picture]);
    }
}

#[test]
fn launches_show_their_progress() {
    if can_interrupt(test_name!()) {
        let picture = at(&scratch("terminal-launch"), "picture.png");
        shows(&["rendering"], &["render", DEMO, "--size", "8000x8000", "-o", &picture]);
    }
}

#[test]
fn pages_and_heat_maps_show_their_progress() {
    if can_interrupt(test_name!()) {
        let folder = scratch("terminal-pages");
        let (page, heat) = (at(&folder, "page.html"), at(&folder, "heat.png"));
        shows(&["counting the cost of pixels"], &["render", DEMO, "--size", "4000x4000", "--html", &page]);
        let ulps = ["render", DEMO, "--size", "4000x4000", "--heat", "ulps", "-o", &heat];
        shows(&["measuring rounding errors"], &ulps);
    }
}

#[test]
fn repeated_runs_show_their_progress() {
    if can_interrupt(test_name!()) {
        let picture = at(&scratch("terminal-runs"), "picture.png");
        let render = ["render", DEMO, "--size", "320x180", "-o", &picture];
        shows(&["running perturbed"], &[&render[..], &["--perturb", "100000"]].concat());
        shows(&["running with random choices"], &[&render[..], &["--many-seeds", "100000"]].concat());
    }
}

#[test]
fn suites_and_modules_show_their_progress() {
    if can_interrupt(test_name!()) {
        shows(&["testing"], &["test", "shaders/pass", "--many-seeds", "1000", "--jobs", "1"]);
        shows(&["running modules"], &["smoke", "spirv-fixtures", "--jobs", "1"]);
    }
}

/// Short work shows nothing, and no escape sequence moves the caret.
#[test]
fn short_work_shows_no_progress() {
    for columns in COLUMNS {
        let (code, lines, printed) =
            run(&["inspect", "spirv-fixtures/pass/sphere/closest-hit/main.rmiss.spv"], columns);
        assert_eq!(code, Some(0), "{lines:#?}");
        assert!(!printed.contains("\u{1b}[2K") && !printed.contains('%'), "{printed:?}");
    }
}

#[cfg(feature = "debugger")]
#[test]
fn the_debugger_completes_files_and_lines() {
    for columns in COLUMNS {
        let mut terminal = Terminal::start(&["trace-one-ray", "--interactive"], columns);
        let lines = terminal.wait_for("(anyhit)");
        assert!(lines[0].contains("`help`"), "the first line: {lines:#?}");
        terminal.write("b main.rg\t");
        terminal.wait_for("b main.rgen:");
        terminal.write("9999\t\u{15}b main.rgen:\t\t");
        // Lines with code follow the file's name.
        let is_line = |line: &String| {
            let mut words = line.split_whitespace();
            words.clone().count() > 1
                && words.all(|word| {
                    word.strip_prefix("main.rgen:").is_some_and(|line| line.parse::<u32>().is_ok())
                })
        };
        terminal.wait_until("the lines of main.rgen", &|lines| lines.iter().any(is_line));
        terminal.write("\u{15}p 1 +\r");
        terminal.wait_for("at character 4 of the expression");
        terminal.write("quit\r");
        assert_eq!(terminal.finish().0, Some(0));
    }
}

/// `-h` has a line for each option, whose text is cut where the terminal is narrow.
#[test]
fn the_short_help_has_a_line_for_each_option() {
    let program = anyhit::cli::command();
    for command in program.get_subcommands().map(clap::Command::get_name) {
        let (code, lines, _) = run(&[command, "-h"], 120);
        assert_eq!(code, Some(0), "{command}");
        let begin = lines.iter().position(|line| line == "Options:").expect("options");
        let end = lines.iter().position(|line| line == "Exit codes:").expect("exit codes");
        for line in lines[begin..end].iter().filter(|line| line.starts_with(' ')) {
            assert!(line.trim_start().starts_with('-'), "{command} -h: {line:?} is no option");
        }
        let count = lines[begin..end].iter().filter(|line| line.starts_with(' ')).count();
        let (code, narrow, _) = run(&[command, "-h"], 80);
        assert_eq!(code, Some(0), "{command}");
        let is_option = |line: &&String| line.trim_start().starts_with('-');
        assert_eq!(narrow.iter().filter(is_option).count(), count, "{command}: {narrow:#?}");
    }
}
