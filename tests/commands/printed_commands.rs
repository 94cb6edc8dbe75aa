//! Command lines that messages print to be typed: they are commands with these flags. Those of the
//! sources, with something in place of what a message fills in, and those that tests have printed.

use std::fs;
use std::sync::LazyLock;

use clap::error::ErrorKind;

use crate::support::files;
use crate::support::program::anyhit;

/// The words of a line as a POSIX shell takes them; `None` for quotes that do not end.
fn shell_words(line: &str) -> Option<Vec<String>> {
    let (mut words, mut word) = (Vec::new(), None::<String>);
    let mut rest = line.chars();
    while let Some(c) = rest.next() {
        match c {
            ' ' => words.extend(word.take()),
            '"' | '\'' => {
                let word = word.get_or_insert_default();
                loop {
                    match rest.next()? {
                        end if end == c => break,
                        inside => word.push(inside),
                    }
                }
            }
            '\\' => word.get_or_insert_default().push(rest.next()?),
            plain => word.get_or_insert_default().push(plain),
        }
    }
    words.extend(word);
    Some(words)
}

/// The names of all commands.
static COMMANDS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let program = anyhit::cli::command();
    program.get_subcommands().map(|command| command.get_name().to_owned()).collect()
});

/// The command lines in a text, up to the end of the line or what a sentence quotes them with.
fn command_lines(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices("anyhit ") {
        let before = text[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || "-/_".contains(c)) {
            continue;
        }
        let line = text[at..].split(['`', '\n']).next().unwrap_or_default();
        let first = line.split([' ', '.', ':', ',']).nth(1).unwrap_or_default();
        if COMMANDS.iter().any(|command| command == first) {
            found.push(line.trim_end());
        }
    }
    found
}

/// Why a command line cannot be typed. One without arguments names a command only.
fn mistake(line: &str) -> Option<String> {
    let words = shell_words(line)?;
    if words.len() == 2 {
        return None;
    }
    let error = anyhit::cli::command().try_get_matches_from(&words).err()?;
    // What stands in place of a number is none.
    let filled_in = line.contains("PLACE");
    (!(filled_in && error.kind() == ErrorKind::ValueValidation)).then(|| error.to_string())
}

/// The string literals of Rust code, as they are printed, with `PLACE` for what is filled in.
fn literals(code: &str) -> Vec<String> {
    let mut all = Vec::new();
    for line in code.lines().map(str::trim_start).filter(|line| !line.starts_with("//")) {
        let mut text = String::new();
        let mut rest = line.chars().peekable();
        while let Some(c) = rest.next() {
            match c {
                '\\' => match rest.next() {
                    Some('n') => text.push('\n'),
                    Some(other) => text.push(other),
                    None => {}
                },
                // The end of a literal is the end of what it says.
                '"' => text.push('\n'),
                '{' if rest.peek() == Some(&'{') => {
                    rest.next();
                    text.push('{');
                }
                '{' => {
                    for inside in rest.by_ref() {
                        if inside == '}' {
                            break;
                        }
                    }
                    text.push_str("PLACE");
                }
                other => text.push(other),
            }
        }
        all.push(text);
    }
    all
}

#[test]
fn the_commands_of_messages_can_be_typed() {
    let (mut count, mut mistakes) = (0, Vec::new());
    for path in files::sources() {
        let code = fs::read_to_string(&path).expect("a readable file");
        for text in literals(&code) {
            for line in command_lines(&text) {
                count += 1;
                // `{what}` may stand for all arguments.
                mistakes.extend(
                    mistake(&line.replace("...", "")).map(|why| format!("{}: {line}: {why}", path.display())),
                );
            }
        }
    }
    assert!(count > 8, "only {count} commands in the sources");
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

/// Commands in the golden outputs, each with the name of its file.
fn printed_commands() -> Vec<(String, String)> {
    let root = files::root();
    let mut found = Vec::new();
    for extension in ["stdout", "stderr", "findings"] {
        for folder in ["tests", "shaders"] {
            for path in files::with_extension(&root.join(folder), extension) {
                let text = fs::read_to_string(&path).expect("a readable file");
                let name = path.strip_prefix(root).expect("a file of the repository").display().to_string();
                found.extend(command_lines(&text).into_iter().map(|line| (name.clone(), line.to_owned())));
            }
        }
    }
    found
}

#[test]
fn the_commands_that_tests_print_can_be_typed() {
    let commands = printed_commands();
    assert!(commands.len() > 10, "only {} commands were printed", commands.len());
    let mistakes =
        commands.iter().filter_map(|(file, line)| Some(format!("{file}: {line}: {}", mistake(line)?)));
    assert_eq!(mistakes.collect::<Vec<_>>().join("\n"), "");
}

/// Every command in a golden output works as printed: it ends as what it repeats does, and not with
/// a mistake of its arguments or its files.
#[test]
fn the_commands_that_tests_print_work() {
    // A line without arguments names a command.
    let mut commands = printed_commands();
    commands.retain(|(_, line)| line.split_whitespace().count() > 2);
    assert!(commands.len() > 30, "only {} commands", commands.len());
    let mut wrong = Vec::new();
    for (file, line) in &commands {
        let words = shell_words(line).expect("the words of a command");
        let ran = anyhit(&words[1..].iter().map(String::as_str).collect::<Vec<_>>());
        if !matches!(ran.code, Some(0 | 1 | 3..=6)) {
            wrong.push(format!("{file}: {line}: {}", ran.err));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), commands.len(), wrong.join("\n"));
}

/// The hints of an explanation are flags of the command that prints it.
#[test]
fn the_flags_of_hints_work() {
    const SAMPLES: &str = "shaders/pass/testing/samples/scene.toml";
    let explain = |flags: &[&str]| {
        let ran = anyhit(&[&["trace-one-ray", SAMPLES], flags].concat());
        assert_eq!(ran.code, Some(0), "{flags:?}: {}", ran.err);
        ran.out
    };
    let text = explain(&[]);
    let hint = text.lines().find(|line| line.contains("shows the first of them")).expect("a hint");
    for part in hint.trim_matches(|c: char| !c.is_ascii_alphanumeric() && c != '-').split(", ") {
        let (flags, _) = part.split_once(" shows ").expect("flags and what they show");
        let flags: Vec<&str> = flags.split_whitespace().collect();
        assert!(flags[0].starts_with("--"), "{hint}");
        assert_ne!(explain(&flags), text, "{flags:?}");
    }
}

#[test]
fn words_are_split_as_by_a_shell() {
    let words = |line| shell_words(line).unwrap_or_default();
    assert_eq!(
        words("anyhit run \"a b\" 'c\"d'\\''e' f=\"g h\""),
        ["anyhit", "run", "a b", "c\"d'e", "f=g h"]
    );
    assert_eq!(shell_words("anyhit \"run"), None);
    assert!(mistake("anyhit run a.toml --no-such-flag").is_some());
    assert!(mistake("anyhit trace-one-ray a.toml --ray \"-1,0,5 0,0,-1\" --t-min 0.5").is_none());
}
