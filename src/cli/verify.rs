//! `anyhit verify`: compares hits that a GPU recorded with those of this crate.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use crate::cli::input::InputLimitArgs;
use crate::cli::{numbers, output};
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind, ErrorReport, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, read_argument, read_regular};
use anyhit_base::progress::Work;
use anyhit_base::sorted::sort;
use anyhit_cases::recording::compare::{AgainstDriver, Agreement, HitComparison};
use anyhit_cases::recording::{Comparison, Recording};

/// Compare hits recorded on a GPU with those of anyhit.
///
/// Limits apply to `reference.*` where a file contains it, otherwise to `driver.*`; an exceeded
/// limit is a failed expectation. docs/verify.md describes how to record hits.
#[derive(Args, Clone, Debug)]
pub(super) struct VerifyArgs {
    /// Recordings (`.safetensors`), or folders that contain them
    #[arg(value_name = "FILE|DIR", required = true)]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    limits: InputLimitArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Recorded hits to which the limits apply
    #[arg(long, value_enum, default_value_t = Baseline::Auto)]
    against: Baseline,
    /// Number of a file's hits that anyhit may miss
    #[arg(long, value_name = "N")]
    max_missed: Option<usize>,
    /// Number of anyhit's hits that a file may lack
    #[arg(long, value_name = "N")]
    max_extra: Option<usize>,
    /// Number of a file's hits that anyhit may find on another primitive at another t
    #[arg(long, value_name = "N")]
    max_other: Option<usize>,
    /// Greatest error of t, in units in the last place; t of boxes, which the recorded shader
    /// computes, is not checked
    #[arg(long, value_name = "ULP", value_parser = numbers::not_negative)]
    max_ulp: Option<f64>,
}

/// The recorded hits against which limits are checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Baseline {
    /// The reference where a file has one, otherwise the driver
    Auto,
    /// `reference.*` only
    Reference,
    /// `driver.*` only
    Driver,
}

/// The report on all recordings, which `--json` prints.
#[derive(Debug, Serialize)]
struct VerifyReport {
    files: Vec<VerifiedFile>,
    /// The limits that were exceeded, in words.
    failures: Vec<String>,
    /// Files that cannot be used, then limits that were exceeded.
    errors: Vec<ErrorReport>,
}

#[derive(Debug, Serialize)]
struct VerifiedFile {
    file: String,
    #[serde(flatten)]
    comparison: Comparison,
}

/// Runs the command.
///
/// # Errors
/// `Expectation` where a limit is passed; `InvalidRecording` for files that cannot be used, after
/// the others were compared.
pub(super) fn run(args: VerifyArgs) -> Result<()> {
    let (mut files, mut errors) = (Vec::new(), Vec::new());
    let limits = args.limits.limits();
    let recordings = recordings(&args.paths).map_err(|error| output::json_error(args.json, error))?;
    let work = Work::counted("comparing recordings", recordings.len() as u64);
    for (path, named) in recordings {
        // Only what is named may be a pipe.
        let bytes = match named {
            true => read_argument(&path, InputLimit::FileBytes, &limits),
            false => read_regular(&path, None, InputLimit::FileBytes, &limits).map_err(of_recording),
        };
        match bytes.and_then(|bytes| Recording::of_file(&path, &bytes)) {
            Ok(recording) => {
                files.push(VerifiedFile {
                    file: escape::path(&path).to_string(),
                    comparison: recording.compare(),
                });
            }
            Err(error) => errors.push(error),
        }
        work.advance(1);
    }
    drop(work);
    let failures: Vec<String> = files.iter().flat_map(|file| args.failures(file)).collect();
    // A file that could not be read comes first, as the first error gives the exit code.
    errors.extend(failures.iter().map(|text| Error::new(ErrorKind::Expectation, text.clone())));
    let report = VerifyReport { files, failures, errors: errors.iter().map(ErrorReport::of).collect() };
    if args.json {
        let json = serde_json::to_string_pretty(&report)
            .map_err(|error| Error::new(ErrorKind::Io, error.to_string()))?;
        output::print(format_args!("{json}\n"))?;
    } else if !report.files.is_empty() {
        output::print(text(&report.files, args.against))?;
    }
    if errors.is_empty() { Ok(()) } else { Err(Error::several(errors)) }
}

impl VerifyArgs {
    /// The limits that a file exceeds.
    fn failures(&self, file: &VerifiedFile) -> Vec<String> {
        let Some((what, hits)) = baseline_hits(&file.comparison, self.against) else { return Vec::new() };
        let mut failures = Vec::new();
        let name = &file.file;
        let counts = [
            ("missed", hits.missed, self.max_missed),
            ("extra", hits.extra, self.max_extra),
            ("on another primitive", hits.other_primitive, self.max_other),
        ];
        for (word, count, limit) in counts {
            if let Some(limit) = limit.filter(|&limit| count > limit) {
                failures.push(format!(
                    "{name}: {} {word} against {what}, more than {}",
                    grouped(count),
                    grouped(limit)
                ));
            }
        }
        let max = hits.t_ulp.map_or(0.0, |t_ulp| t_ulp.max);
        // NaN exceeds every limit.
        if let Some(limit) = self.max_ulp.filter(|&limit| max.is_nan() || max > limit)
            && !file.comparison.is_procedural()
        {
            failures.push(format!("{name}: t is {max} ulp off against {what}, more than {limit}"));
        }
        failures
    }
}

/// The comparison that limits are checked against.
fn baseline_hits(comparison: &Comparison, against: Baseline) -> Option<(&'static str, &HitComparison)> {
    let reference = comparison.reference.as_ref().map(|one| ("reference", &one.hits));
    let driver = comparison.driver.as_ref().map(|one| ("driver", &one.hits));
    match against {
        Baseline::Auto => reference.or(driver),
        Baseline::Reference => reference,
        Baseline::Driver => driver,
    }
}

/// What is wrong with a file that was found, as an error of a recording.
fn of_recording(error: Error) -> Error {
    if error.kind() == ErrorKind::Io {
        return error;
    }
    let own = Error::new(ErrorKind::InvalidRecording, error.message());
    error.notes().iter().fold(own, |own, note| own.note(note))
}

/// The recordings to compare, each with whether it was named itself: files, and all recordings in
/// folders, sorted.
fn recordings(paths: &[PathBuf]) -> Result<Vec<(PathBuf, bool)>> {
    let mut all = Vec::new();
    for path in paths {
        if !path.is_dir() {
            all.push((path.clone(), true));
            continue;
        }
        let before = all.len();
        collect(path, &mut all)?;
        if all.len() == before {
            let message = format!("{}: the folder contains no `.safetensors` file", escape::path(&path));
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
        sort(&mut all[before..]);
    }
    Ok(all)
}

fn collect(folder: &Path, all: &mut Vec<(PathBuf, bool)>) -> Result<()> {
    for entry in std::fs::read_dir(folder).map_err(|error| Error::io(folder, error))? {
        let entry = entry.map_err(|error| Error::io(folder, error))?;
        let path = entry.path();
        // Links to folders may go in circles.
        if entry.file_type().map_err(|error| Error::io(&path, error))?.is_dir() {
            collect(&path, all)?;
        } else if path.extension().is_some_and(|extension| extension == "safetensors") {
            all.push((path, false));
        }
    }
    Ok(())
}

/// The report for people: a table of hits, a table of what drivers recorded beside them, and the
/// first rows that are wrong.
fn text(files: &[VerifiedFile], against: Baseline) -> String {
    let mut rows = vec![HEAD.map(str::to_owned).to_vec()];
    let mut driver_rows = vec![DRIVER_HEAD.map(str::to_owned).to_vec()];
    let mut wrong = String::new();
    for file in files {
        let comparison = &file.comparison;
        let name = Path::new(&file.file)
            .file_stem()
            .map_or_else(|| file.file.clone(), |stem| stem.to_string_lossy().into_owned());
        if let Some(reference) = &comparison.reference {
            rows.push(hits_row(&name, "reference", &reference.hits));
        }
        if let Some(driver) = &comparison.driver {
            rows.push(hits_row(&name, "driver", &driver.hits));
            driver_rows.extend(driver_row(&name, driver));
        }
        if let Some((what, hits)) = baseline_hits(comparison, against) {
            for example in &hits.examples {
                // Writing to a string does not fail.
                let _ = writeln!(wrong, "{name}, {what}: {example}");
            }
        }
        for note in &comparison.notes {
            let _ = writeln!(wrong, "{name}: {note}");
        }
        for tensor in &comparison.ignored_tensors {
            let _ = writeln!(wrong, "{name}: tensor `{tensor}` is unknown and was ignored");
        }
    }
    let mut out = table(&rows);
    if driver_rows.len() > 1 {
        out.push_str("\nrows that differ from the driver's, and the greatest difference between floats\n");
        out.push_str(&table(&driver_rows));
    }
    if !wrong.is_empty() {
        out.push('\n');
        out.push_str(&wrong);
    }
    out
}

const HEAD: [&str; 13] = [
    "file", "against", "rows", "hits", "left out", "missed", "extra", "other", "ties", "p50 ulp", "p99",
    "p99.9", "max",
];

const DRIVER_HEAD: [&str; 9] = [
    "file",
    "shaders ran",
    "hit kind",
    "any-hits",
    "candidates",
    "custom index",
    "attributes",
    "positions",
    "object ray",
];

fn hits_row(name: &str, against: &str, hits: &HitComparison) -> Vec<String> {
    let HitComparison { rows, hits: count, undecidable, missed, extra, other_primitive, ties, t_ulp, .. } =
        hits;
    let mut row = vec![name.to_owned(), against.to_owned()];
    row.extend([rows, count, undecidable, missed, extra, other_primitive, ties].map(grouped));
    row.extend(match t_ulp {
        Some(t) => [t.p50, t.p99, t.p999, t.max].map(short),
        None => [(); 4].map(|()| "-".to_owned()),
    });
    row
}

/// The row of everything that a driver recorded besides hits; `None` if it recorded nothing else.
fn driver_row(name: &str, driver: &AgainstDriver) -> Option<Vec<String>> {
    let cells = [
        driver.shaders_ran,
        driver.hit_kind.or(driver.shape),
        driver.any_hit_count,
        driver.candidate_count,
        driver.instance_custom_index,
        driver.attributes,
        driver.positions_and_radii,
        driver.object_ray,
    ];
    cells.iter().any(Option::is_some).then(|| {
        let cell = |agreement: &Option<Agreement>| match agreement {
            None => "-".to_owned(),
            Some(Agreement { rows, differ, max_difference: None }) => {
                format!("{} of {}", grouped(differ), grouped(rows))
            }
            Some(Agreement { rows, differ, max_difference: Some(difference) }) => {
                format!("{} of {}, {}", grouped(differ), grouped(rows), short(*difference))
            }
        };
        std::iter::once(name.to_owned()).chain(cells.iter().map(cell)).collect()
    })
}

fn short(number: f64) -> String {
    match number {
        0.0 => "0".to_owned(),
        _ if (1e-3..1e5).contains(&number) => format!("{number:.3}"),
        _ => format!("{number:.1e}"),
    }
}

/// Columns side by side, all but the first two to the right where they are numbers.
fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut out = String::new();
    for row in rows {
        let mut line = String::new();
        for (at, (cell, &width)) in row.iter().zip(&widths).enumerate() {
            let left = at == 0 || (at == 1 && rows[0][1] == HEAD[1]);
            let gap = if at == 0 { "" } else { "  " };
            let _ = match left {
                true => write!(line, "{gap}{cell:<width$}"),
                false => write!(line, "{gap}{cell:>width$}"),
            };
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}
