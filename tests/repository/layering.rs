//! The modules of a crate import one way only; between crates Cargo sees to that.
//!
//! The engine has the layers `pipeline -> interp -> program -> reflect -> ops -> {module, machine
//! -> accel} -> geometry -> math`, the base `{input, atomic_file} -> error -> {count, escape,
//! progress, sorted, style, threads} -> interrupt`: a module may import what stands to its right. A
//! few crates of others are named in one place only, readers of files in one file, files are
//! written in one place, and only the command line prints.

use std::fs;

use crate::support::files;

/// The layers of the crates that have some, from the top down; modules of one row do not import
/// each other.
const LAYERS: &[(&str, &[&[&str]])] = &[
    (
        "engine",
        &[
            &["pipeline"],
            &["interp"],
            &["program"],
            &["reflect"],
            &["ops"],
            &["module", "machine"],
            &["accel"],
            &["geometry"],
            &["math"],
        ],
    ),
    (
        "base",
        &[
            &["input", "atomic_file"],
            &["error"],
            &["count", "escape", "progress", "sorted", "style", "threads"],
            &["interrupt"],
        ],
    ),
];

/// Crates of others, and what may name them: a module of a crate with layers, else one of our
/// crates.
const CRATES: &[(&str, &[&str])] = &[
    // The sanitizer reads which instruction an operation comes from.
    ("rspirv", &["module", "ops", "reflect", "sanitize"]),
    ("codespan_reporting", &["error"]),
    ("naga", &["compile"]),
    ("glslang", &["compile"]),
    ("clap", &["anyhit"]),
    ("emmy_dap_types", &["debugger"]),
    // Pictures in pages, rows of shares of a picture in results, and data URIs of models.
    ("base64", &["cases", "scene"]),
    ("colorous", &["cases"]),
    ("flate2", &["cases"]),
    ("inferno", &["cases"]),
    ("noto_sans_mono_bitmap", &["cases"]),
    ("dashu_ratio", &["stress"]),
    ("dashu_float", &["stress"]),
    ("obvhs", &["stress"]),
    ("safetensors", &["cases"]),
    ("quick_xml", &["cases"]),
    ("hmac_sha256", &["compile"]),
    ("aligned_vec", &["machine"]),
    ("prefetch_index", &["math"]),
    ("jpeg_decoder", &["scene"]),
    ("signal_hook", &["anyhit"]),
];

/// Those of them that judge the results of other modules in their tests, too.
const JUDGES: &[&str] = &["dashu_ratio", "dashu_float"];

/// Readers of other crates, and the one file that may call each: it checks what the reader assumes,
/// bounds what it allocates and catches its panics.
const READERS: &[(&str, &str)] = &[
    ("MetaData::read_from_buffered", "crates/scene/src/image/openexr.rs"),
    ("jpeg_decoder::Decoder", "crates/scene/src/image/png_jpeg.rs"),
    ("png::Decoder", "crates/scene/src/image/png_jpeg.rs"),
    ("DeTable::parse", "crates/scene/src/read.rs"),
    ("SafeTensors::", "crates/cases/src/recording/tensors.rs"),
    ("naga::", "crates/compile/src/wgsl.rs"),
    ("Compiler::acquire", "crates/compile/src/glsl.rs"),
];

/// Only the command line writes to the terminal.
const PRINTS: &[&str] = &["println!", "eprintln!", "print!", "eprint!", "dbg!"];

/// What writes regular files: only `atomic_file` does so by itself.
const WRITES: &[&str] =
    &["fs::write(", "File::create", ".write(true)", "fs::rename(", "fs::copy(", "NamedTempFile"];

#[test]
fn imports_go_one_way() {
    let mut mistakes = Vec::new();
    let mut imports = 0;
    for source in sources() {
        let Some((_, layers)) = LAYERS.iter().find(|(name, _)| *name == source.of_crate) else { continue };
        let layer_of = |module: &str| layers.iter().position(|layer| layer.contains(&module));
        let Source { module, name, .. } = &source;
        let Some(layer) = layer_of(module) else {
            mistakes.push(format!("{name}: `{module}` stands in no layer"));
            continue;
        };
        for imported in imported_modules(&source.text) {
            imports += 1;
            match layer_of(&imported) {
                _ if imported == *module => {}
                Some(other) if other > layer && !(module == "module" && imported == "accel") => {}
                Some(_) => mistakes.push(format!("{name}: `{module}` must not import `{imported}`")),
                // A macro of the crate's root.
                None => {}
            }
        }
    }
    assert!(imports > 1000, "only {imports} imports were found: the test reads the wrong lines");
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

/// docs/architecture.md lists the crates, and the modules of the engine in this order.
#[test]
fn the_architecture_page_lists_the_layers() {
    let page = fs::read_to_string(files::root().join("docs/architecture.md")).expect("the page");
    let rows = |heading: &str| -> Vec<Vec<String>> {
        let section =
            page.split(heading).nth(1).expect("the section").split("\n## ").next().expect("its text");
        let rows = section.lines().filter_map(|line| line.strip_prefix("| `")?.split('|').next());
        rows.map(|cell| cell.split(", ").map(|one| one.trim_matches([' ', '`']).to_owned()).collect())
            .collect()
    };
    assert_eq!(rows("## Modules of the engine"), LAYERS[0].1);
    let mut crates: Vec<String> = rows("## Crates").into_iter().flatten().collect();
    crates.sort();
    let mut folders: Vec<String> = fs::read_dir(files::root().join("crates"))
        .expect("the folder of crates")
        .map(|entry| format!("crates/{}", entry.expect("an entry").file_name().to_string_lossy()))
        .chain(["src".to_owned()])
        .collect();
    folders.sort();
    assert_eq!(crates, folders);
}

/// What is compiled outside of tests, which stand at the end of a file or in one of their own.
fn without_tests<'a>(name: &str, code: &'a str) -> &'a str {
    let tests = ["#[cfg(test)]", "#[cfg(all(test"].iter().filter_map(|mark| code.find(mark)).min();
    if name.ends_with("tests.rs") { "" } else { &code[..tests.unwrap_or(code.len())] }
}

#[test]
fn crates_are_named_in_their_place() {
    let mut mistakes = Vec::new();
    let mut named = vec![false; CRATES.len()];
    for Source { module, name, text, .. } in sources() {
        let code = without_comments(&text);
        for ((one, modules), named) in CRATES.iter().zip(&mut named) {
            let code = if JUDGES.contains(one) { without_tests(&name, &code) } else { &code };
            if !contains_word(code, one, "::") {
                continue;
            }
            *named = true;
            if !modules.contains(&module.as_str()) {
                mistakes
                    .push(format!("{name}: `{one}` is named in `{module}`, only in {modules:?} it may be"));
            }
        }
        for print in PRINTS {
            if module != "anyhit" && contains_word(&code, print, "") {
                mistakes.push(format!("{name}: `{print}` outside of the program"));
            }
        }
    }
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
    assert!(named.iter().all(|&named| named), "a crate of the list is named nowhere: {named:?}");
}

#[test]
fn files_are_written_in_one_place() {
    let mut mistakes = Vec::new();
    let mut uses = 0;
    for Source { module, name, text, .. } in sources() {
        let code = without_comments(&text);
        let code = without_tests(&name, &code);
        for write in WRITES {
            let is_whole = |&(at, _): &(usize, &str)| !code[..at].ends_with(char::is_alphanumeric);
            let count = code.match_indices(write).filter(is_whole).count();
            if module == "atomic_file" {
                uses += count;
            } else if count > 0 {
                mistakes.push(format!("{name}: `{write}` instead of `atomic_file::write`"));
            }
        }
    }
    assert!(uses >= 5, "only {uses} were found where files are written");
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

#[test]
fn readers_stand_behind_one_door_each() {
    let mut found = vec![false; READERS.len()];
    let mut mistakes = Vec::new();
    for Source { name, text, .. } in sources() {
        let code = without_comments(&text);
        for ((reader, file), found) in READERS.iter().zip(&mut found) {
            let names = code.match_indices(reader).any(|(at, _)| {
                // `crate::mesh::obj::` and `obj::read` are the door itself.
                let before = code[..at].chars().next_back();
                let door = code[at + reader.len()..].starts_with("read") || before == Some(':');
                !door && !before.is_some_and(|c| c.is_alphanumeric() || c == '_')
            });
            if !names {
                continue;
            }
            if name == *file {
                assert!(code.contains("contained("), "{name}: panics of `{reader}` are not caught");
                *found = true;
            } else {
                mistakes.push(format!("{name}: `{reader}` is called in {file} alone"));
            }
        }
    }
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
    assert!(found.iter().all(|&found| found), "a reader is called nowhere: {found:?}");
}

/// A source file.
struct Source {
    /// The folder of its crate in `crates`, or `anyhit`.
    of_crate: String,
    /// Its module where its crate has layers, else its crate.
    module: String,
    /// Its path from the root.
    name: String,
    text: String,
}

/// Every source file but the roots of crates.
fn sources() -> Vec<Source> {
    let read = |path: &std::path::PathBuf| {
        let inside = path.strip_prefix(files::root()).expect("a file below the root");
        let name = inside.to_string_lossy().replace('\\', "/");
        let parts: Vec<&str> = name.split('/').collect();
        let (of_crate, first) = match parts[..] {
            ["crates", of_crate, "src", first, ..] => (of_crate, first),
            ["src", first, ..] => ("anyhit", first),
            _ => panic!("{name} lies in no crate"),
        };
        let has_layers = LAYERS.iter().any(|(name, _)| *name == of_crate);
        let module = if has_layers { first.trim_end_matches(".rs") } else { of_crate };
        let (of_crate, module) = (of_crate.to_owned(), module.to_owned());
        let text = fs::read_to_string(path).expect("a readable source");
        (first != "lib.rs" && first != "main.rs").then_some(Source { of_crate, module, name, text })
    };
    files::sources().iter().filter_map(read).collect()
}

/// The modules of the crate that a text names behind `crate::`.
fn imported_modules(text: &str) -> Vec<String> {
    let code = without_comments(text);
    let mut found = Vec::new();
    // `$crate::` is a macro's own path: it names what the macro needs, wherever it is used.
    for (at, _) in code.match_indices("crate::") {
        if code[..at].ends_with('$') {
            continue;
        }
        let rest = &code[at + "crate::".len()..];
        match rest.strip_prefix('{') {
            // `use crate::{a::b, c}`: the names that stand right behind the brace or a comma of
            // its level.
            Some(group) => {
                let mut depth = 0;
                let mut name = String::new();
                let mut ended = false;
                for character in group.chars() {
                    match character {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => {
                            found.push(std::mem::take(&mut name));
                            ended = false;
                        }
                        _ if depth > 0 || ended => {}
                        c if c.is_alphanumeric() || c == '_' => name.push(c),
                        c if c.is_whitespace() && name.is_empty() => {}
                        _ => ended = true,
                    }
                }
                found.push(name);
            }
            None => found.push(rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()),
        }
    }
    found.retain(|name| !name.is_empty());
    found
}

/// A text without its line comments, doc comments included: those may name what they like.
fn without_comments(text: &str) -> String {
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

/// Whether `word` followed by `after` stands in a text, and not as the end of a longer word.
fn contains_word(text: &str, word: &str, after: &str) -> bool {
    let sought = format!("{word}{after}");
    text.match_indices(&sought).any(|(at, _)| {
        !text[..at].chars().next_back().is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':')
    })
}

#[test]
fn all_forms_of_an_import_are_read() {
    let text = "use crate::ops::lane_kernel;\nuse crate::{math::ulp, geometry::{Ray, Hit}, error};\n\
        let a = crate::accel::build(); // crate::commands::cli\n$crate::machine::Reg";
    assert_eq!(imported_modules(text), ["ops", "math", "geometry", "error", "accel"]);
    assert!(contains_word("println!(\"\")", "println!", ""));
    assert!(!contains_word("eprintln!(\"\")", "println!", ""));
    assert!(!contains_word("codespan::naga::x", "naga", "::"));
}
