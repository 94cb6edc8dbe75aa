//! Smoke tests of several modules: a line for each, and how many came to what.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde_json::{Map, Value, json};

use crate::cli::share::ShareArgs;
use crate::cli::smoke::verdict::{JsonReport, verdict};
use crate::cli::smoke::{FindingFiles, findings_of};
use crate::cli::{module_file, output};
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind, ErrorReport, Result};
use anyhit_base::escape;
use anyhit_base::input::InputLimits;
use anyhit_base::progress::Work;
use anyhit_cases::case::{FoundFiles, files_beneath};
use anyhit_cases::in_order::in_order;
use anyhit_cases::shares::smoke::{ModuleResult, ModuleVerdict, SmokeResult, SmokeWhole};
use anyhit_cases::shares::{ShareResults, fingerprint};
use anyhit_cases::smoke::{SmokeOptions, SmokeReport};
use anyhit_compile::SourceWords;
use anyhit_sanitize::FindingRecord;

/// How several modules are run.
pub(super) struct ModulesToRun {
    /// The limits of reading.
    pub limits: InputLimits,
    /// How sources are compiled.
    pub words: SourceWords,
    /// How each module is run.
    pub options: SmokeOptions,
    /// How many percent of its blocks an entry point has to enter.
    pub min_coverage: f64,
    /// How many modules run in parallel, 0 for one a processor.
    pub jobs: usize,
    /// The files that findings are written to.
    pub files: FindingFiles,
    /// Whether a module that lacks a declaration is rejected.
    pub strict: bool,
}

impl ModulesToRun {
    /// Runs the modules of some paths, or the share of them that is asked for.
    ///
    /// # Errors
    /// `Io` where a path is not there or a folder cannot be read; the worst class of error of a
    /// module, after all is printed.
    pub(super) fn run(&self, paths: &[PathBuf], share: &ShareArgs, json: bool) -> Result<()> {
        let files = find(paths).map_err(|error| output::json_error(json, error))?;
        let names: Vec<String> = files.iter().map(|file| escape::path(&file).to_string()).collect();
        let whole = SmokeWhole {
            modules: files.len(),
            names: fingerprint(names.iter().map(String::as_str)),
            options: format!("{:?}, at least {} %, {:?}", self.options, self.min_coverage, self.words),
        };
        let shard = share.shard_or_whole();
        let places: Vec<usize> = (0..files.len()).filter(|&place| shard.holds(place)).collect();
        let mut result = SmokeResult::default();
        let mut findings = Vec::new();
        let progress = Work::counted("running modules", places.len() as u64);
        let mut take = |(module, found): (ModuleResult, Vec<FindingRecord>)| {
            progress.advance(1);
            findings.extend(found);
            if !json {
                output::print(module.text())?;
            }
            result.modules.push(module);
            Ok(())
        };
        let work = |at: usize| self.module(places[at], &files[places[at]]);
        in_order(places.len(), self.jobs, &AtomicBool::new(false), &work, &mut take)?;
        drop(progress);
        let results = ShareResults::new(whole, shard, result);
        share.write(&results)?;
        self.files.write(&findings)?;
        print_end(&SmokeResult::of_shares(&results), json)
    }

    /// What became of a module, and what the sanitizer found in it.
    fn module(&self, place: usize, path: &Path) -> (ModuleResult, Vec<FindingRecord>) {
        let file = escape::path(&path).to_string();
        let module = module_file::read_or_compile(path, &self.limits, &self.words)
            .and_then(|module| module_file::check_declarations(path, module, self.strict));
        let module = match module {
            Ok(module) => Arc::new(module),
            Err(error) => {
                let unloaded = ModuleResult {
                    place,
                    file,
                    verdict: ModuleVerdict::of_unloaded(&error),
                    about: Some(error.to_string()),
                    class: Some(error.class()),
                    json: members(json!({ "errors": ErrorReport::all(&error) })),
                };
                return (unloaded, Vec::new());
            }
        };
        let report = SmokeReport::of(&module, self.options);
        let error = verdict(&report, self.min_coverage).err();
        let errors = error.as_ref().map_or_else(Vec::new, ErrorReport::all);
        let found = findings_of(&report, path);
        let result = ModuleResult {
            place,
            file,
            verdict: ModuleVerdict::of(&report, error.as_ref()),
            about: about(&report, error.as_ref()),
            class: error.as_ref().map(Error::class),
            json: members(serde_json::to_value(JsonReport { report: &report, errors }).unwrap_or_default()),
        };
        (result, found)
    }
}

/// The members of an object.
fn members(json: Value) -> Map<String, Value> {
    match json {
        Value::Object(members) => members,
        _ => Map::new(),
    }
}

/// What the line of a module tells behind its name: the error with the first rule that was broken,
/// else how much was reached where that is not all.
fn about(report: &SmokeReport, error: Option<&Error>) -> Option<String> {
    if let Some(error) = error {
        let traps = report.entry_points.iter().flat_map(|entry| &entry.runs).filter(|run| !run.is_note());
        let rule = traps.filter_map(|run| run.trap.as_ref()).map(|trap| &trap.rule).next();
        let reason = report.entry_points.iter().flat_map(|entry| &entry.reasons).next();
        let why = rule.or(reason).map_or_else(String::new, |why| format!(": {why}"));
        return Some(format!("{}{why}", error.message()));
    }
    let reached = report.entry_points.iter().filter_map(|entry| entry.coverage.as_ref());
    let (entered, blocks) =
        reached.fold((0, 0), |(entered, blocks), one| (entered + one.blocks_entered, blocks + one.blocks));
    (entered < blocks).then(|| format!("reached {} of {} blocks", grouped(entered), grouped(blocks)))
}

/// The report of merged shares.
///
/// # Errors
/// As [`ModulesToRun::run`].
pub(in crate::cli) fn print_merged(results: &ShareResults<SmokeResult>, json: bool) -> Result<()> {
    SmokeResult::check_shares(results)?;
    let result = SmokeResult::of_shares(results);
    if !json {
        result.modules.iter().try_for_each(|module| output::print(module.text()))?;
    }
    print_end(&result, json)
}

fn print_end(result: &SmokeResult, json: bool) -> Result<()> {
    match json {
        true => output::print_data(format_args!("{:#}\n", result.json()))?,
        false => output::print(result.summary())?,
    }
    match result.class() {
        None => Ok(()),
        Some(class) => {
            let count = result.modules.iter().filter(|module| module.class.is_some()).count();
            let (count, all) = (grouped(count), grouped(result.modules.len()));
            Err(Error::of_class(class, format!("{count} of {all} modules fail")))
        }
    }
}

/// The modules of some paths: files as they are named, and what ends in `.spv` in folders, each
/// once.
fn find(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = Vec::new();
    let mut once = FoundFiles::default();
    for path in paths {
        let found = match path.is_dir() {
            true => {
                files_beneath(path, &|file| file.extension().is_some_and(|extension| extension == "spv"))?
            }
            false => vec![path.clone()],
        };
        files.extend(found.into_iter().filter(|file| once.add(file)));
    }
    if files.is_empty() {
        let names: Vec<String> = paths.iter().map(|path| escape::path(&path).to_string()).collect();
        let message = format!("no modules in {}", names.join(", "));
        return Err(Error::new(ErrorKind::InvalidArgument, message)
            .note("folders are searched for `.spv`; name source files explicitly"));
    }
    Ok(files)
}
