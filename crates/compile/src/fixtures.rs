//! `spirv-fixtures/`: the compiled form of every source under `shaders/` and of the example
//! renderer, with a record of how each was made, so that tests need no compiler and never run a
//! module that is older than its source.
//!
//! `shaders/a/b.rchit` has its fixture at `spirv-fixtures/a/b.rchit.spv`, and
//! `examples/renderer/c.slang` at `spirv-fixtures/renderer/c.slang.spv`. Comments in the source
//! request flags and further fixtures:
//!
//! ```text
//! //@ flags: -g            the flags of the fixture itself
//! //@ also O0: -O0         a further fixture, b.rchit.O0.spv
//! ```
//!
//! `spirv-fixtures/RECORDS.toml` keeps, per fixture, the tool and its version, the flags, and the
//! hashes of source (with its includes) and module.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::source::hash::bytes_hash;
use super::{CompileOptions, Language, Source, tool};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::sorted::{SortedMap, sort, sort_by};
use anyhit_base::{atomic_file, escape};

/// The folder of most sources, in the root of the repository.
pub const SOURCES: &str = "shaders";
/// All folders of sources, each with what stands before the names of its fixtures.
const SOURCE_FOLDERS: [(&str, &str); 2] = [(SOURCES, ""), ("examples/renderer", "renderer/")];
/// The folder of the compiled modules, in the root of the repository.
pub const FIXTURES: &str = "spirv-fixtures";
/// The name of the record file, in [`FIXTURES`].
pub const RECORDS: &str = "RECORDS.toml";

/// How one fixture was made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixtureRecord {
    /// Compiler and version.
    pub tool: String,
    /// Flags, as in the source's comment; empty for none.
    pub flags: String,
    /// [`Source::content_hash`].
    pub source: String,
    /// SHA-256 of the module's bytes.
    pub module: String,
}

/// The records by fixture name (relative to [`FIXTURES`], with `/`).
type Records = SortedMap<String, FixtureRecord>;

/// A fixture that a source requests.
struct RequestedFixture {
    /// The path relative to [`FIXTURES`], with `/`.
    name: String,
    /// The path of the source relative to the root, with `/`.
    source: String,
    flags: String,
}

/// What [`regenerate`] did.
#[derive(Debug, Default)]
pub struct FixtureReport {
    /// Fixtures written, by name.
    pub written: Vec<String>,
    /// The number of fixtures that were up to date.
    pub kept: usize,
    /// Fixtures and records removed because no source requests them.
    pub removed: Vec<String>,
    /// Stale fixtures that could not be made, because this build or machine lacks the compiler.
    pub skipped: Vec<(String, Error)>,
}

/// Updates the fixtures of a repository: compiles those whose source, flags
/// or module no longer match the record (all, with `force`), and removes those without a source.
///
/// A missing compiler is no error: the fixtures that would need it are listed in the report.
///
/// # Errors
/// What [`Source::compile`] reports about the sources, all in one; [`ErrorKind::Io`].
pub fn regenerate(root: &Path, force: bool) -> Result<FixtureReport> {
    let folder = root.join(FIXTURES);
    let mut records = read_records(&folder)?;
    let mut report = FixtureReport::default();
    let mut errors = Vec::new();
    let requested = requested(root)?;
    for fixture in &requested {
        let source = Source::read_in(root, &fixture.source)?;
        let path = folder.join(&fixture.name);
        let hash = source.content_hash();
        let record = records.get(&fixture.name);
        let module = fs::read(&path).ok();
        if !force && stale_reason(record, &fixture.flags, &hash, module.as_deref()).is_none() {
            report.kept += 1;
            continue;
        }
        match make(&source, &fixture.flags) {
            Ok((spirv, tool)) => {
                write(&path, &spirv)?;
                let module = bytes_hash(&spirv);
                let flags = fixture.flags.clone();
                records.insert(fixture.name.clone(), FixtureRecord { tool, flags, source: hash, module });
                report.written.push(fixture.name.clone());
            }
            Err(error) if error.kind() == ErrorKind::UnsupportedTool => {
                report.skipped.push((fixture.name.clone(), error));
            }
            Err(error) => errors.push(error),
        }
    }
    let known = |name: &str| requested.iter().any(|fixture| fixture.name == name);
    for name in files(&folder, &|path| path.extension().is_some_and(|extension| extension == "spv"))? {
        if !known(&name) {
            let path = folder.join(&name);
            fs::remove_file(&path).map_err(|error| Error::io(&path, error))?;
            report.removed.push(name);
        }
    }
    records.retain(|name, _| known(name));
    write_records(&folder, &records)?;
    if errors.is_empty() { Ok(report) } else { Err(Error::several(errors)) }
}

/// Lists every fixture of a repository that does not match its source, one line each. Needs no
/// compiler.
///
/// # Errors
/// [`ErrorKind::Io`], and [`ErrorKind::InvalidSource`] or [`ErrorKind::InvalidArgument`] for a
/// source or a record that cannot be read.
pub fn check(root: &Path) -> Result<Vec<String>> {
    let folder = root.join(FIXTURES);
    let mut records = read_records(&folder)?;
    let mut problems = Vec::new();
    let requested = requested(root)?;
    for fixture in &requested {
        let hash = Source::read_in(root, &fixture.source)?.content_hash();
        let module = fs::read(folder.join(&fixture.name)).ok();
        let record = records.remove(&fixture.name);
        if let Some(reason) = stale_reason(record.as_ref(), &fixture.flags, &hash, module.as_deref()) {
            problems.push(format!("{FIXTURES}/{}: {reason} ({})", fixture.name, fixture.source));
        }
    }
    for name in records.keys() {
        problems.push(format!("{FIXTURES}/{RECORDS}: `{name}` has no source"));
    }
    for name in files(&folder, &|path| path.file_name().is_none_or(|name| name != RECORDS))? {
        if !requested.iter().any(|fixture| fixture.name == name) {
            problems.push(format!("{FIXTURES}/{name}: no source requests it"));
        }
    }
    Ok(problems)
}

/// Why a fixture is out of date; `None` if it is not.
fn stale_reason(
    record: Option<&FixtureRecord>,
    flags: &str,
    source: &str,
    module: Option<&[u8]>,
) -> Option<&'static str> {
    let Some(module) = module else { return Some("the fixture is missing") };
    let Some(record) = record else { return Some("the fixture has no record") };
    if record.source != source {
        Some("the source or an include of it has changed since the fixture was made")
    } else if record.flags != flags {
        Some("the source requests other flags than the fixture was made with")
    } else if record.module != bytes_hash(module) {
        Some("the fixture differs from the recorded module")
    } else {
        None
    }
}

fn make(source: &Source, flags: &str) -> Result<(Vec<u8>, String)> {
    let tool = tool(source.language())?;
    let options = CompileOptions::from_flags(flags.split_whitespace())?;
    Ok((source.compile(&options)?, tool))
}

/// All fixtures that the sources under a root request, sorted by name.
fn requested(root: &Path) -> Result<Vec<RequestedFixture>> {
    let mut requested = Vec::new();
    let mut sources = Vec::new();
    for (folder, before) in SOURCE_FOLDERS {
        let names = files(&root.join(folder), &|path| Language::of(path).is_some())?;
        sources.extend(names.iter().map(|name| (format!("{folder}/{name}"), format!("{before}{name}"))));
    }
    for (source, name) in sources {
        let source = Source::read_in(root, &source)?;
        let mut flags = String::new();
        for line in source.text().lines() {
            let Some(request) = line.trim_start().strip_prefix("//@") else { continue };
            let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
            match request.split_once(':').map(|(head, flags)| (head.trim(), words(flags))) {
                Some(("flags", text)) => flags = text,
                Some((head, flags)) if suffix(head).is_some() => {
                    let name = format!("{name}.{}.spv", suffix(head).unwrap_or_default());
                    requested.push(RequestedFixture { name, source: source.name().to_owned(), flags });
                }
                _ => return Err(unknown_request(&source, line)),
            }
        }
        let source = source.name().to_owned();
        requested.push(RequestedFixture { name: format!("{name}.spv"), source, flags });
    }
    sort_by(&mut requested, |a, b| a.name.cmp(&b.name));
    Ok(requested)
}

/// The suffix that `also SUFFIX` gives.
fn suffix(head: &str) -> Option<&str> {
    let suffix = head.strip_prefix("also ")?.trim();
    let valid = !suffix.is_empty() && suffix.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    valid.then_some(suffix)
}

fn unknown_request(source: &Source, line: &str) -> Error {
    let start = line.as_ptr() as usize - source.text().as_ptr() as usize;
    let place = Place::Text {
        file: source.name().to_owned(),
        text: source.text().clone(),
        span: start..start + line.len(),
    };
    Error::new(ErrorKind::InvalidSource, "unknown `//@` comment")
        .at(place)
        .note("expected `//@ flags: FLAGS` or `//@ also SUFFIX: FLAGS`")
}

/// The files under a folder that a test accepts, relative to it with `/`, sorted.
fn files(folder: &Path, accept: &dyn Fn(&Path) -> bool) -> Result<Vec<String>> {
    let mut found = Vec::new();
    let mut pending: Vec<(PathBuf, String)> = vec![(folder.to_owned(), String::new())];
    while let Some((folder, prefix)) = pending.pop() {
        if !folder.exists() {
            continue;
        }
        for entry in fs::read_dir(&folder).map_err(|error| Error::io(&folder, error))? {
            let entry = entry.map_err(|error| Error::io(&folder, error))?;
            let path = entry.path();
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            if path.is_dir() {
                pending.push((path, format!("{name}/")));
            } else if accept(&path) {
                found.push(name);
            }
        }
    }
    sort(&mut found);
    Ok(found)
}

fn read_records(folder: &Path) -> Result<Records> {
    let path = folder.join(RECORDS);
    if !path.exists() {
        return Ok(Records::new());
    }
    let text = fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
    toml::from_str(&text).map_err(|error| {
        let place = Place::Text {
            file: escape::path(&path).to_string(),
            text: text.as_str().into(),
            span: error.span().unwrap_or(0..0),
        };
        Error::new(ErrorKind::InvalidArgument, error.message().to_owned()).at(place)
    })
}

fn write_records(folder: &Path, records: &Records) -> Result<()> {
    let body = toml::to_string(records).expect("bug in anyhit: records do not serialise");
    let head = "# Written by `anyhit compile --fixtures`; how each module beside it was made.\n";
    write(&folder.join(RECORDS), format!("{head}\n{body}").as_bytes())
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(|error| Error::io(folder, error))?;
    atomic_file::write(path, bytes)
}

#[cfg(all(test, feature = "wgsl"))]
mod tests {
    use super::*;

    struct Repository(PathBuf);

    impl Repository {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("anyhit-fixtures-{name}-{}", std::process::id()));
            let _ = fs::remove_dir_all(&path);
            Self(path)
        }

        fn write(&self, name: &str, text: &str) {
            write(&self.0.join(name), text.as_bytes()).unwrap();
        }

        fn problems(&self) -> Vec<String> {
            check(&self.0).unwrap()
        }
    }

    impl Drop for Repository {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    const SHADER: &str = "@compute @workgroup_size(1) fn main() {}\n";

    #[test]
    fn regenerating_updates_everything_and_is_idempotent() {
        let repository = Repository::new("step");
        repository.write("shaders/pass/a/b.wgsl", &format!("//@ also g: -g\n{SHADER}"));
        assert_eq!(repository.problems().len(), 2, "two fixtures are missing");
        let report = regenerate(&repository.0, false).unwrap();
        assert_eq!(report.written, ["pass/a/b.wgsl.g.spv", "pass/a/b.wgsl.spv"]);
        assert_eq!(repository.problems(), [""; 0]);
        let report = regenerate(&repository.0, false).unwrap();
        assert_eq!((report.written.len(), report.kept), (0, 2));
    }

    #[test]
    fn each_kind_of_mismatch_is_reported() {
        let repository = Repository::new("ways");
        repository.write("shaders/a.wgsl", SHADER);
        repository.write("shaders/b.wgsl", SHADER);
        repository.write("shaders/c.wgsl", SHADER);
        regenerate(&repository.0, false).unwrap();
        repository.write("shaders/a.wgsl", &format!("{SHADER}// more\n"));
        repository.write("spirv-fixtures/b.wgsl.spv", "edited");
        fs::remove_file(repository.0.join("shaders/c.wgsl")).unwrap();
        let problems = repository.problems().join("\n");
        assert!(problems.contains("a.wgsl.spv: the source or an include of it has changed"), "{problems}");
        assert!(problems.contains("b.wgsl.spv: the fixture differs from the recorded module"), "{problems}");
        assert!(problems.contains("`c.wgsl.spv` has no source"), "{problems}");
        assert!(problems.contains("c.wgsl.spv: no source requests it"), "{problems}");

        let report = regenerate(&repository.0, false).unwrap();
        assert_eq!(report.removed, ["c.wgsl.spv"]);
        assert_eq!(repository.problems(), [""; 0]);
    }

    #[test]
    fn an_unknown_request_is_shown_with_its_line() {
        let repository = Repository::new("request");
        repository.write("shaders/a.wgsl", &format!("{SHADER}//@ flag: -g\n"));
        let error = check(&repository.0).unwrap_err();
        assert!(error.render().contains("shaders/a.wgsl:2:1"), "{error:?}");
    }
}
