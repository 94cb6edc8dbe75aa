//! The words of the code: comments are sentences in at most 100 columns, and no two public types
//! have one name.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::support::files;

/// Where this project's own Rust code lies.
const FOLDERS: &[&str] =
    &["src", "crates", "tests", "benches", "examples", "judges/src", "judges/tests", "fuzz", "python/src"];

/// Columns of a line with a comment.
const COLUMNS: usize = 100;

/// Every Rust file below some folders: its path from the root, with slashes, and its text.
fn sources(folders: &[&str]) -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all = Vec::new();
    for folder in folders {
        for path in files::with_extension(&root.join(folder), "rs") {
            let name = path.strip_prefix(root).expect("a path below the root");
            let name = name.to_string_lossy().replace('\\', "/");
            if name.contains("/target/") {
                continue;
            }
            all.push((name, fs::read_to_string(&path).expect("a readable file")));
        }
    }
    assert!(all.len() > 700, "only {} sources below {folders:?}", all.len());
    all
}

/// The text of a line that is nothing but a comment, without its marks.
fn comment(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let marks = ["///", "//!", "//"].into_iter().find(|marks| line.starts_with(marks))?;
    Some(line[marks.len()..].trim())
}

/// Whether a line is one of documentation.
fn is_doc(line: &str) -> bool {
    let line = line.trim_start();
    line.starts_with("///") || line.starts_with("//!")
}

fn report(mistakes: &[String]) {
    assert!(mistakes.is_empty(), "{} places:\n{}", mistakes.len(), mistakes.join("\n"));
}

#[test]
fn comments_fit_into_100_columns() {
    let mut mistakes = Vec::new();
    for (name, text) in sources(FOLDERS) {
        let mut is_code = false;
        for (number, line) in text.lines().enumerate() {
            is_code ^= comment(line).is_some_and(|text| text.starts_with("```"));
            // An address cannot be broken, and an example is code.
            let breaks = !is_code && comment(line).is_some_and(|text| text.contains(' '));
            if breaks && line.chars().count() > COLUMNS {
                mistakes.push(format!("{name}:{}: {} columns", number + 1, line.chars().count()));
            }
        }
    }
    report(&mistakes);
}

#[test]
fn comments_say_something() {
    let mut mistakes = Vec::new();
    for (name, text) in sources(FOLDERS) {
        let lines: Vec<&str> = text.lines().collect();
        for (number, line) in lines.iter().enumerate() {
            let Some(text) = comment(line) else { continue };
            let is_first = number == 0 || comment(lines[number - 1]).is_none();
            let is_last = lines.get(number + 1).is_none_or(|next| comment(next).is_none());
            if !is_first {
                continue;
            }
            if text.starts_with("The same") {
                mistakes.push(format!("{name}:{}: say what it is: {text}", number + 1));
            }
            // A word of the specification in quotation marks names its source.
            let quotes = text.starts_with('`') || text.starts_with("[`");
            if is_doc(line) && is_last && !quotes && !text.is_empty() && !text.contains(' ') {
                mistakes.push(format!("{name}:{}: one word is no sentence: {text}", number + 1));
            }
        }
    }
    report(&mistakes);
}

#[test]
fn no_two_public_types_have_one_name() {
    let mut types: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (file, text) in sources(&["src", "crates"]) {
        for line in text.lines() {
            // Those at the top of a file; what a function or a module of tests has is its own
            // affair.
            let Some(rest) = line.strip_prefix("pub ") else { continue };
            let mut words = rest.split_whitespace();
            if !matches!(words.next(), Some("struct" | "enum" | "union" | "trait")) {
                continue;
            }
            let name: String = words
                .next()
                .unwrap_or_default()
                .chars()
                .take_while(|&part| part.is_alphanumeric() || part == '_')
                .collect();
            types.entry(name).or_default().push(file.clone());
        }
    }
    assert!(types.len() > 200, "{}", types.len());
    let twice = types.iter().filter(|(_, files)| files.len() > 1);
    let mistakes: Vec<String> = twice.map(|(name, files)| format!("{name}: {}", files.join(", "))).collect();
    report(&mistakes);
}
