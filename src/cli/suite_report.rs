//! The reports of a suite, of one run as of merged shares: they are made of its result alone.

use std::path::Path;

use clap::ValueEnum;
use serde_json::json;

use crate::cli::output;
use crate::cli::sanitize::{FindingFormat, write_json};
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::{atomic_file, escape};
use anyhit_cases::suite::{
    Ended, KeptFinding, SuiteResult, SuiteWhole, TestResult, gitlab, junit, report, suite_sarif, summary,
};
use anyhit_sanitize::FindingRecord;

/// How results are printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum ReportFormat {
    /// Plain text
    #[default]
    Plain,
    /// Text, with an annotation per failure that GitHub shows at the shader's line
    Github,
    /// One JSON object
    Json,
    /// A JSON report of code quality that GitLab shows at the shader's line
    Gitlab,
}

/// The files that are asked for.
pub(super) struct SuiteFiles<'a> {
    /// The report as JUnit XML.
    pub junit: Option<&'a Path>,
    /// The coverage: an lcov tracefile, or XML of Cobertura for a name that ends in `.xml`.
    pub coverage: Option<&'a Path>,
    /// Failed tests and findings as SARIF.
    pub sarif: Option<&'a Path>,
    /// Findings as JSON.
    pub findings_json: Option<&'a Path>,
    /// A short report in Markdown.
    pub summary: Option<&'a Path>,
    /// How long tests took.
    pub timings: Option<&'a Path>,
    /// Whether the JUnit report tells how long tests took.
    pub with_times: bool,
}

impl SuiteFiles<'_> {
    /// Writes the files. Returns the errors of those that cannot be written.
    pub(super) fn write(&self, result: &SuiteResult) -> Vec<Error> {
        let mut unwritten = Vec::new();
        if let Some(path) = self.junit {
            let written = junit(result, self.with_times).and_then(|text| output::write_data(path, &text));
            unwritten.extend(written.err());
        }
        if let Some(path) = self.sarif {
            unwritten.extend(output::write_data(path, &suite_sarif(result)).err());
        }
        if let Some(path) = self.findings_json {
            unwritten.extend(write_json(path, &records_of(&result.findings())).err());
        }
        if let Some(path) = self.coverage {
            let text = result.coverage.as_ref().map_or_else(String::new, |all| all.text_for(path));
            unwritten.extend(output::write_data(path, &text).err());
        }
        if let Some(path) = self.summary {
            unwritten.extend(atomic_file::write(path, summary(result)).err());
        }
        if let Some(path) = self.timings {
            unwritten.extend(atomic_file::write(path, result.timings().to_json()).err());
        }
        unwritten
    }
}

/// Refuses two kinds of data for one standard output: the report as JSON has the findings already.
///
/// # Errors
/// `InvalidArgument`.
pub(super) fn check_formats(format: ReportFormat, findings: FindingFormat) -> Result<()> {
    let fits = match format {
        ReportFormat::Plain | ReportFormat::Github => true,
        ReportFormat::Json => matches!(findings, FindingFormat::Text | FindingFormat::Json),
        ReportFormat::Gitlab => findings == FindingFormat::Text,
    };
    if fits {
        return Ok(());
    }
    let name = if format == ReportFormat::Json { "json" } else { "gitlab" };
    let message = format!("`--format {name}` and `--findings` cannot both print to standard output");
    Err(Error::new(ErrorKind::InvalidArgument, message)
        .note("the report contains the findings; `--sarif FILE` writes them as SARIF"))
}

/// Keeps standard output for the data that is printed there: the report, and files.
///
/// # Errors
/// As [`output::claim_stdout`].
pub(super) fn claim_stdout(
    format: ReportFormat,
    findings: FindingFormat,
    junit: Option<&Path>,
    coverage: Option<&Path>,
) -> Result<()> {
    match format {
        ReportFormat::Plain | ReportFormat::Github => findings.claim_stdout()?,
        // The report has the findings, which are not printed a second time.
        ReportFormat::Json => output::claim_stdout("--format json")?,
        ReportFormat::Gitlab => output::claim_stdout("--format gitlab")?,
    }
    output::claim_stdout_for([("--junit -", junit), ("--coverage -", coverage)])
}

/// Prints what became of a test.
///
/// # Errors
/// `Io`.
pub(super) fn print_test(test: &TestResult, format: ReportFormat) -> Result<()> {
    match format {
        ReportFormat::Json | ReportFormat::Gitlab => Ok(()),
        ReportFormat::Plain => output::print(&test.text),
        ReportFormat::Github => {
            let annotation = report::github(test).as_deref().map(escape::workflow_annotation);
            let log = escape::printed(&test.text, false);
            let log = escape::workflow_log(&log);
            let Some(annotation) = annotation else { return output::print_commands(log) };
            // A log shows the first line of a group, and the rest where it is opened.
            let title = format!("{}  {}", test.ended.word(), escape::line(&test.name));
            let title = escape::workflow_message(&title);
            output::print_commands(format_args!("::group::{title}\n{log}::endgroup::\n{annotation}"))
        }
    }
}

/// Prints what stands behind the tests, and notes.
///
/// # Errors
/// `Io`.
pub(super) fn print_end(
    whole: &SuiteWhole,
    result: &SuiteResult,
    format: ReportFormat,
    finding_format: FindingFormat,
) -> Result<()> {
    let findings = result.findings();
    if format == ReportFormat::Gitlab {
        output::print_data(format_args!("{:#}\n", gitlab(result)))?;
    } else if format == ReportFormat::Json {
        let mut json = report::json(result);
        if whole.shadow {
            json["shadow"] = result.shadow().json(None);
        }
        if whole.perturbed.is_some() {
            json["perturbed"] = result.held_stable().into();
        }
        if !findings.is_empty() {
            json["findings"] = findings.iter().map(|finding| json!(finding.record())).collect();
        }
        output::print_data(format_args!("{json:#}\n"))?;
    } else {
        if let Some(coverage) = &result.coverage {
            output::print(report::coverage(coverage))?;
        }
        if whole.shadow {
            output::print(format_args!("\n{}\n", result.shadow().text()))?;
        }
        if let Some(how) = &whole.perturbed {
            let (held, all) = (result.held_stable(), result.tests.len());
            let [held, all] = [held, all].map(grouped);
            output::print(format_args!("\nrequired to have stable outputs: {held} of {all} tests, {how}\n"))?;
        }
        print_findings(&findings, finding_format, format)?;
        output::print(report::failed(result))?;
        output::print(report::summary(result))?;
    }
    output::notes(&result.notes());
    Ok(())
}

/// Prints findings. Those that fail a test stand in its report as text already, and in its
/// annotation for GitHub.
fn print_findings(findings: &[KeptFinding], how: FindingFormat, report: ReportFormat) -> Result<()> {
    let mut warnings = findings.iter().filter(|finding| finding.is_warning());
    match (how, report) {
        (FindingFormat::Text, _) => warnings.try_for_each(|finding| output::print(finding.text())),
        (FindingFormat::Github, ReportFormat::Github) => how.print_records(&records_of(warnings)),
        _ => how.print_records(&records_of(findings)),
    }
}

/// What other formats have of findings.
pub(super) fn records_of<'a>(findings: impl IntoIterator<Item = &'a KeptFinding>) -> Vec<FindingRecord> {
    findings.into_iter().map(|finding| finding.record().clone()).collect()
}

/// The error that becomes the exit code; everything about it is printed already.
///
/// # Errors
/// The most severe class of the tests that did not pass.
pub(super) fn verdict(result: &SuiteResult) -> Result<()> {
    let Some(class) = result.class() else { return Ok(()) };
    let message = match result.count(Ended::Error) {
        0 => match result.count(Ended::Failed) {
            1 => "1 test failed".to_owned(),
            count => format!("{} tests failed", grouped(count)),
        },
        _ => "a test could not run".to_owned(),
    };
    Err(Error::of_class(class, message))
}
