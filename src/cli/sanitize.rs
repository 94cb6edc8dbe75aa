//! `--sanitize` and the flags that go with it: which rules are checked, and how findings are told.

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args, ValueEnum};

use crate::cli::output;
use anyhit_base::atomic_file;
use anyhit_base::error::{Error, Result};
use anyhit_base::input::{InputLimit, InputLimits, read_argument};
use anyhit_base::progress::Work;
use anyhit_cases::sanitized::{SanitizedRun, deny, run_sanitized, sanitize_one};
use anyhit_cases::source_tree::SourceTree;
use anyhit_cases::suite::findings_sarif;
use anyhit_debugger::session::ResolvedRequest;
use anyhit_engine::machine::Resources;
use anyhit_engine::pipeline::Stats;
use anyhit_sanitize::{Finding, FindingRecord, Findings, Level, Levels, formats};
use anyhit_scene::sanitize_table::scene_levels;
use anyhit_scene::{Assembled, ResolvedScene};

/// The sanitizer, and what is told of findings, its own and those of `--many-seeds`.
#[derive(Args, Clone, Debug)]
#[command(group = ArgGroup::new("checks").multiple(true))]
#[command(next_help_heading = "Sanitizer")]
pub(super) struct SanitizeArgs {
    /// Check the shaders while they run for undefined behaviour, uses of undefined values, and
    /// NaNs; exit with 6 if a finding is denied
    #[arg(long, group = "checks")]
    sanitize: bool,
    /// Do not report this rule (`all` for every rule)
    #[arg(long, value_name = "RULE", requires = "checks")]
    allow: Vec<String>,
    /// Report this rule, but do not fail
    #[arg(long, value_name = "RULE", requires = "checks")]
    warn: Vec<String>,
    /// Fail if this rule is broken
    #[arg(long, value_name = "RULE", requires = "checks")]
    deny: Vec<String>,
    /// Format of printed findings
    #[arg(long, value_name = "FORMAT", default_value = "text", requires = "checks")]
    findings: FindingFormat,
    /// Also write the findings to this file (`-` for standard output) as SARIF 2.1.0, for code
    /// scanning
    #[arg(long, value_name = "FILE", requires = "checks")]
    sarif: Option<PathBuf>,
    /// Also write the findings to this file (`-` for standard output) as a JSON array
    #[arg(long, value_name = "FILE", requires = "checks")]
    findings_json: Option<PathBuf>,
    /// Do not report the findings that this file lists; `--write-baseline` writes such a file
    #[arg(long, value_name = "FILE", requires = "checks")]
    baseline: Option<PathBuf>,
    /// Write all findings to this file, as known findings
    #[arg(long, value_name = "FILE", requires = "checks", conflicts_with = "baseline")]
    write_baseline: Option<PathBuf>,
}

/// How findings are printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum FindingFormat {
    /// Source lines with labels, for people.
    #[default]
    Text,
    /// A list of objects.
    Json,
    /// SARIF 2.1.0, for code scanning.
    Sarif,
    /// GitHub Actions annotations.
    Github,
}

impl FindingFormat {
    /// The flag by which findings are printed as data, of which standard output has nothing else.
    fn data_flag(self) -> Option<&'static str> {
        match self {
            Self::Text | Self::Github => None,
            Self::Json => Some("--findings json"),
            Self::Sarif => Some("--findings sarif"),
        }
    }

    /// Keeps standard output for findings that are printed as data.
    ///
    /// # Errors
    /// As [`output::claim_stdout`].
    pub(super) fn claim_stdout(self) -> Result<()> {
        self.data_flag().map_or(Ok(()), output::claim_stdout)
    }

    /// Prints findings for other tools; nothing as text, which has more than records do.
    ///
    /// # Errors
    /// `Io`.
    pub(super) fn print_records(self, findings: &[FindingRecord]) -> Result<()> {
        match self {
            Self::Text => Ok(()),
            Self::Json => output::print_data(format_args!("{}\n", formats::json(findings))),
            Self::Sarif => output::print_data(findings_sarif(findings)),
            Self::Github => output::print_commands(formats::github(findings)),
        }
    }
}

impl SanitizeArgs {
    /// Whether `--sanitize` is given.
    pub(super) fn is_requested(&self) -> bool {
        self.sanitize
    }

    /// The file that findings are written to as SARIF.
    pub(super) fn sarif(&self) -> Option<&Path> {
        self.sarif.as_deref()
    }

    /// The file that findings are written to as JSON.
    pub(super) fn findings_json(&self) -> Option<&Path> {
        self.findings_json.as_deref()
    }

    /// Keeps standard output for findings, where they are printed there as data. Called before
    /// anything else is printed.
    ///
    /// # Errors
    /// As [`output::claim_stdout`].
    pub(super) fn claim_stdout(&self) -> Result<()> {
        self.findings.claim_stdout()?;
        self.claim_stdout_for_files()
    }

    /// Keeps standard output for files of findings that are written there.
    ///
    /// # Errors
    /// As [`output::claim_stdout`].
    pub(super) fn claim_stdout_for_files(&self) -> Result<()> {
        output::claim_stdout_for([("--sarif -", self.sarif()), ("--findings-json -", self.findings_json())])
    }

    /// How findings are printed.
    pub(super) fn format(&self) -> FindingFormat {
        self.findings
    }

    /// The baseline of the findings that are known, if there is one.
    ///
    /// # Errors
    /// `Io`, and `ResourceLimit` for a large file.
    pub(super) fn known(&self) -> Result<Option<String>> {
        let Some(path) = &self.baseline else { return Ok(None) };
        let bytes = read_argument(path, InputLimit::FileBytes, &InputLimits::default())?;
        Ok(Some(String::from_utf8_lossy(&bytes).into_owned()))
    }

    /// The file in which all findings are to be listed as known ones, if there is one.
    pub(super) fn baseline_to_write(&self) -> Option<&Path> {
        self.write_baseline.as_deref()
    }

    /// The levels of rules that the flags set, as they are typed.
    pub(super) fn level_flags(&self) -> String {
        let flags = [("--allow", &self.allow), ("--warn", &self.warn), ("--deny", &self.deny)];
        let typed: Vec<String> =
            flags.iter().flat_map(|(flag, ids)| ids.iter().map(move |id| format!("{flag} {id}"))).collect();
        typed.join(" ")
    }

    /// The levels of rules that the flags set.
    ///
    /// # Errors
    /// `InvalidArgument` for a rule that does not exist.
    pub(super) fn given_levels(&self) -> Result<Levels> {
        let mut levels = Levels::default();
        let given = [(&self.allow, Level::Allow), (&self.warn, Level::Warn), (&self.deny, Level::Deny)];
        for (ids, level) in given {
            for id in ids {
                match id.as_str() {
                    "all" => levels.set_all(level),
                    id => levels.set(id, level)?,
                }
            }
        }
        Ok(levels)
    }

    /// The levels of rules: those of the scene, and over them those that the flags set.
    pub(super) fn levels(&self, scene: &ResolvedScene) -> Result<Levels> {
        Ok(scene_levels(&scene.document)?.overridden_by(&self.given_levels()?))
    }

    /// Runs a scene's launches and dispatches.
    ///
    /// # Errors
    /// Of the arguments, and of lowering.
    pub(super) fn run(
        &self,
        scene: &ResolvedScene,
        assembled: &Assembled,
        resources: &Resources,
    ) -> Result<SanitizedRun> {
        let work = Work::new("running under the sanitizer");
        let run = run_sanitized(scene, assembled, resources, &self.levels(scene)?);
        drop(work);
        run.or_else(|error| self.refuse(error, &scene.path))
    }

    /// Runs one ray of a scene, or one invocation, if that is asked for, and prints the findings
    /// with those of drawn choices.
    ///
    /// # Errors
    /// Of the arguments and the ray, and of lowering; then as [`SanitizeArgs::finish`].
    pub(super) fn run_one(
        &self,
        scene: &ResolvedScene,
        assembled: &Assembled,
        which: &ResolvedRequest,
        drawn: Option<Findings>,
    ) -> Result<()> {
        if !self.sanitize {
            return self.finish([None, drawn], Ok(Stats::default()), &scene.path).map(|_| ());
        }
        let run = sanitize_one(scene, assembled, which, &assembled.resources, &self.levels(scene)?);
        let run = run.or_else(|error| self.refuse(error, &scene.path))?;
        self.finish([Some(run.findings), drawn], run.outcome, &scene.path).map(|_| ())
    }

    /// Prints the findings of the sanitizer and those of drawn choices, as far as either was asked
    /// for, and returns the statistics of the run. `scene` is the file that was run.
    ///
    /// # Errors
    /// The trap; else `Finding` if one is denied; `Io` of the baseline's file.
    pub(super) fn finish(
        &self,
        found: [Option<Findings>; 2],
        outcome: Result<Stats>,
        scene: &Path,
    ) -> Result<Stats> {
        if found.iter().all(Option::is_none) {
            return outcome;
        }
        let mut findings = Findings::default();
        found.into_iter().flatten().for_each(|some| findings.extend(some));
        if let Some(path) = &self.write_baseline {
            atomic_file::write(path, formats::baseline(&findings.records()))?;
            return outcome;
        }
        if let Some(known) = self.known()? {
            findings.forget_known(&known);
        }
        let stats = match outcome {
            Ok(stats) => stats,
            Err(error) => return self.stop(findings, error, scene),
        };
        self.print(&findings, &findings, scene)?;
        if findings.is_empty() && self.findings == FindingFormat::Text {
            output::hint(match self.sanitize {
                _ if self.allow.iter().any(|id| id == "all")
                    && self.warn.is_empty()
                    && self.deny.is_empty() =>
                {
                    "every rule is allowed: nothing was checked"
                }
                true => "the sanitizer found nothing",
                false => "no output depends on the randomised choices",
            });
        }
        deny(&findings)?;
        Ok(stats)
    }

    /// Prints findings and the error that ended the run: in text it is printed with its rule at the
    /// end of the command, and for machines it is one of the findings.
    fn stop<T>(&self, findings: Findings, error: Error, scene: &Path) -> Result<T> {
        let mut data = findings.clone();
        data.add_stop(&error);
        self.print(&findings, &data, scene)?;
        Err(Finding::of_stop(&error).map_or(error, |finding| finding.report()))
    }

    /// As [`SanitizeArgs::stop`], of what cannot run.
    fn refuse<T>(&self, error: Error, scene: &Path) -> Result<T> {
        self.stop(Findings::default(), error, scene)
    }

    /// Prints findings as text, or those of `data` in another format.
    fn print(&self, findings: &Findings, data: &Findings, scene: &Path) -> Result<()> {
        let is_text = self.findings == FindingFormat::Text;
        let records = match is_text && self.sarif.is_none() && self.findings_json.is_none() {
            true => Vec::new(),
            false => SourceTree::of_repository().place(data.records(), scene),
        };
        if let Some(path) = &self.sarif {
            output::write_data(path, &findings_sarif(&records))?;
        }
        if let Some(path) = &self.findings_json {
            write_json(path, &records)?;
        }
        match self.findings {
            FindingFormat::Text => {
                for finding in findings {
                    output::print(finding.render())?;
                }
                Ok(())
            }
            other => other.print_records(&records),
        }
    }
}

/// Writes findings as JSON.
///
/// # Errors
/// `Io`.
pub(super) fn write_json(file: &Path, findings: &[FindingRecord]) -> Result<()> {
    output::write_data(file, &format!("{}\n", formats::json(findings)))
}
