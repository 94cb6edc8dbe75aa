//! What a smoke test of a module comes to, as the error that its exit code tells.

use serde::Serialize;

use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorClass, ErrorKind, ErrorReport, Result};
use anyhit_cases::sanitized::deny;
use anyhit_cases::smoke::{SmokeReport, SmokeVerdict};

/// What `--json` prints.
#[derive(Serialize)]
pub(super) struct JsonReport<'a> {
    #[serde(flatten)]
    /// What was found.
    pub report: &'a SmokeReport,
    /// What the exit code tells of.
    pub errors: Vec<ErrorReport>,
}

/// The worst verdict as an error.
///
/// # Errors
/// `Expectation` where an entry point trapped or entered too few of its blocks; `UnsupportedModule`
/// or `InvalidModule` where one does not run; of the class `Limit` where one exceeds a limit;
/// `Finding` where the sanitizer denies what is in it.
pub(super) fn verdict(report: &SmokeReport, min_coverage: f64) -> Result<()> {
    let worst = report.worst();
    if worst <= SmokeVerdict::OutOfScope {
        report.entry_points.iter().try_for_each(|entry| deny(&entry.findings))?;
        return covered(report, min_coverage);
    }
    let entries = &report.entry_points;
    let count = |verdict| entries.iter().filter(|entry| entry.result == verdict).count();
    let verdicts = [
        (SmokeVerdict::Trap, "trapped"),
        (SmokeVerdict::Unsupported, "not supported"),
        (SmokeVerdict::Limit, "over a limit"),
        (SmokeVerdict::Invalid, "invalid"),
        (SmokeVerdict::Bug, "hit a bug in anyhit"),
    ];
    let counts = verdicts.map(|(verdict, word)| (count(verdict), word));
    let parts: Vec<_> = counts
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, word)| format!("{} {word}", grouped(count)))
        .collect();
    let message = format!("of {} entry points, {}", grouped(entries.len()), parts.join(", "));
    Err(match worst {
        SmokeVerdict::Ok | SmokeVerdict::OutOfScope | SmokeVerdict::Trap => {
            Error::new(ErrorKind::Expectation, message)
        }
        SmokeVerdict::Unsupported | SmokeVerdict::Bug => Error::new(ErrorKind::UnsupportedModule, message),
        SmokeVerdict::Limit => Error::of_class(ErrorClass::Limit, message),
        SmokeVerdict::Invalid => Error::new(ErrorKind::InvalidModule, message),
    })
}

/// Whether every entry point entered enough of its blocks.
fn covered(report: &SmokeReport, percent: f64) -> Result<()> {
    let reached = report.entry_points.iter().filter_map(|entry| Some((entry, entry.coverage.as_ref()?)));
    let too_few: Vec<_> = reached.filter(|(_, reached)| !reached.is_at_least(percent)).collect();
    if too_few.is_empty() {
        return Ok(());
    }
    let [all, few] = [report.entry_points.len(), too_few.len()].map(grouped);
    let message = format!("of {all} entry points, {few} reached less than {percent} % of their blocks");
    let error = Error::new(ErrorKind::Expectation, message);
    Err(too_few.iter().fold(error, |error, (entry, reached)| {
        let [entered, blocks] = [reached.blocks_entered, reached.blocks].map(grouped);
        let share = format!("{entered} of {blocks} blocks");
        error.note(format!("{} `{}` reached {share}", entry.stage, entry.name))
    }))
}
