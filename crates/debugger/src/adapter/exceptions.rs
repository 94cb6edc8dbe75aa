//! What stops an invocation without a breakpoint: traps, NaNs and findings of the sanitizer.

use emmy_dap_types::requests::SetExceptionBreakpointsArguments;
use emmy_dap_types::types::ExceptionBreakpointsFilter;
use serde_json::{Value, json};

use crate::debugger::{FindingFilter, FindingsAhead};
use anyhit_base::error::Error;
use anyhit_sanitize::{Finding, Levels};
use anyhit_scene::sanitize_table::scene_levels;

use super::Adapter;
use super::protocol::{Answer, Refusal, Request};

/// The exception filter for traps.
const TRAP: &str = "trap";
/// The exception filter for operations that make a NaN of numbers.
const NAN: &str = "nan";
/// The exception filter for findings of the sanitizer.
const SANITIZER: &str = "sanitizer";

/// The exception filters that are on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ExceptionFilters {
    pub traps: bool,
    pub nans: bool,
    pub findings: Option<FindingFilter>,
}

impl Default for ExceptionFilters {
    fn default() -> Self {
        Self { traps: true, nans: false, findings: None }
    }
}

impl ExceptionFilters {
    /// The run stops at no exception.
    const OFF: Self = Self { traps: false, nans: false, findings: None };

    /// The filters that there are.
    pub(super) fn offered() -> Vec<ExceptionBreakpointsFilter> {
        let filter = |filter: &str, label: &str, description: &str| ExceptionBreakpointsFilter {
            filter: filter.to_owned(),
            label: label.to_owned(),
            description: Some(description.to_owned()),
            default: Some(filter == TRAP),
            ..ExceptionBreakpointsFilter::default()
        };
        let condition = "rules to stop at (`int-div-zero nan-output`), or `warn` to include warnings";
        vec![
            filter(TRAP, "Traps", "Stops before the step of a shader that traps"),
            filter(NAN, "NaNs", "Stops at an operation that produces a NaN from non-NaN operands"),
            ExceptionBreakpointsFilter {
                supports_condition: Some(true),
                condition_description: Some(condition.to_owned()),
                ..filter(
                    SANITIZER,
                    "Sanitizer",
                    "Stops before an instruction that breaks a rule of Vulkan or SPIR-V, or depends on an \
                     undefined value",
                )
            },
        ]
    }

    /// Turns a filter on.
    fn add(&mut self, filter: &str, condition: Option<&str>) -> Result<(), String> {
        let condition = condition.map(str::trim).filter(|condition| !condition.is_empty());
        match (filter, condition) {
            (TRAP, None) => self.traps = true,
            (NAN, None) => self.nans = true,
            (SANITIZER, condition) => self.findings = Some(findings_of(condition.unwrap_or_default())?),
            (TRAP | NAN, Some(_)) => return Err(format!("the filter `{filter}` accepts no condition")),
            _ => return Err(format!("unknown filter `{filter}`")),
        }
        Ok(())
    }
}

/// Reads the condition of the filter for findings: ids of rules, or `warn`.
fn findings_of(condition: &str) -> Result<FindingFilter, String> {
    let mut filter = FindingFilter::default();
    for word in condition.split([' ', ',', '\t']).filter(|word| !word.is_empty()) {
        match word {
            "warn" => filter.warned = true,
            id => filter.rules.push(Levels::rule(id).map_err(|error| in_a_line(&error))?),
        }
    }
    Ok(filter)
}

/// An error and its notes, without places.
fn in_a_line(error: &Error) -> String {
    error.notes().iter().fold(error.message().to_owned(), |text, note| text + "; " + note)
}

/// A stop at an exception: what an event tells, and what `exceptionInfo` adds.
#[derive(Clone, Debug)]
pub(super) struct Exception {
    /// The headline.
    pub description: String,
    /// What has happened.
    pub text: String,
    /// The body of the response to `exceptionInfo`.
    pub info: Value,
}

impl Exception {
    /// The step that is next traps.
    pub(super) fn trap(error: &Error) -> Self {
        let message = error.message();
        Self {
            description: "Paused before a trap".into(),
            text: message.to_owned(),
            info: json!({
                "exceptionId": TRAP,
                "description": message,
                "breakMode": "always",
                "details": { "message": message, "stackTrace": error.render() },
            }),
        }
    }

    /// The step before has made a NaN.
    pub(super) fn nan() -> Self {
        let message = "an operation produced a NaN from non-NaN operands";
        Self {
            description: "Paused after a NaN".into(),
            text: message.to_owned(),
            info: json!({
                "exceptionId": NAN,
                "description": message,
                "breakMode": "always",
                "details": { "message": message },
            }),
        }
    }

    /// The step that is next meets findings.
    pub(super) fn findings(findings: &[Finding]) -> Self {
        let texts: Vec<String> = findings.iter().map(finding_text).collect();
        let ids: Vec<&str> = findings.iter().map(|finding| finding.rule.id).collect();
        let details: Vec<Value> = findings.iter().map(finding_details).collect();
        let first = findings.first().map_or_else(String::new, |finding| {
            let rule = finding.rule;
            format!("{}\nrule: {}\nhelp: {}", finding.error.message(), rule.source, rule.help)
        });
        let mut main = details.first().cloned().unwrap_or_default();
        if details.len() > 1 {
            main["innerException"] = details[1..].into();
        }
        Self {
            description: format!("Paused before a finding of the sanitizer: {}", ids.join(", ")),
            text: texts.join("\n"),
            info: json!({
                "exceptionId": ids.first(),
                "description": first,
                "breakMode": "always",
                "details": main,
            }),
        }
    }
}

/// What a finding says, and how often it has been met.
fn finding_text(finding: &Finding) -> String {
    let message = finding.error.message();
    let nth = match (finding.count, finding.count % 10, finding.count % 100) {
        (0 | 1, ..) => return message.to_owned(),
        (_, 1, tens) if tens != 11 => "st",
        (_, 2, tens) if tens != 12 => "nd",
        (_, 3, tens) if tens != 13 => "rd",
        _ => "th",
    };
    let count = finding.count;
    format!("{message} ({count}{nth} occurrence; the values are those of the first)")
}

/// All that is known of a finding.
fn finding_details(finding: &Finding) -> Value {
    let rule = finding.rule;
    json!({
        "message": finding.error.message(),
        "typeName": rule.id,
        "fullTypeName": format!("{}: {}", rule.kind.name(), rule.holds),
        "stackTrace": finding.render(),
        // These are not the protocol's.
        "rule": rule.id,
        "level": finding.level.name(),
        "source": rule.source,
        "help": rule.help,
        "times": finding.count,
    })
}

impl Adapter {
    pub(super) fn set_exception_breakpoints(&mut self, request: &Request) -> Answer {
        let arguments: SetExceptionBreakpointsArguments = request.arguments()?;
        let options = arguments.filter_options.unwrap_or_default();
        let plain = arguments.filters.iter().map(|filter| (filter, None));
        let all = plain.chain(options.iter().map(|option| (&option.filter_id, option.condition.as_deref())));
        let mut filters = ExceptionFilters::OFF;
        let mut verified = Vec::new();
        for (filter, condition) in all {
            let is_for_findings = filter == SANITIZER;
            verified.push((is_for_findings, filters.add(filter, condition)));
        }
        self.filters = filters;
        self.apply_breakpoints();
        if let Err(why) = self.apply_findings() {
            let wrong = verified.iter_mut().filter(|(is_for_findings, _)| *is_for_findings);
            wrong.for_each(|(_, result)| *result = Err(why.clone()));
        }
        let shown: Vec<Value> = verified
            .into_iter()
            .map(|(_, result)| match result {
                Ok(()) => json!({ "verified": true }),
                Err(why) => json!({ "verified": false, "message": why }),
            })
            .collect();
        Ok(json!({ "breakpoints": shown }))
    }

    /// Begins the run that knows the sanitizer's findings, or ends it, as the filters ask.
    pub(super) fn apply_findings(&mut self) -> Result<(), String> {
        let is_enabled = !self.arguments.as_ref().is_some_and(|arguments| arguments.no_debug);
        let wanted = self.filters.findings.clone().filter(|_| is_enabled);
        let Some(launched) = self.launched.as_mut().filter(|launched| launched.findings != wanted) else {
            return Ok(());
        };
        launched.findings = None;
        launched.console.debugger.stop_at_findings(None);
        let Some(filter) = wanted else { return Ok(()) };
        let (scene, request) = (launched.session.scene().clone(), launched.request.clone());
        let ahead = scene_levels(&scene.document)
            .and_then(|levels| FindingsAhead::of_scene(scene, request, levels, filter.clone()));
        launched.console.debugger.stop_at_findings(Some(ahead.map_err(|error| in_a_line(&error))?));
        launched.findings = Some(filter);
        Ok(())
    }

    pub(super) fn exception_info(&mut self) -> Answer {
        let launched = self.stopped()?;
        let exception = launched.exception.as_ref();
        let exception =
            exception.ok_or_else(|| Refusal::new("the invocation has not stopped at an exception"))?;
        Ok(exception.info.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_condition_of_the_sanitizer_names_rules() {
        let ids = |filter: FindingFilter| filter.rules.iter().map(|rule| rule.id).collect::<Vec<_>>();
        let filter = findings_of("int-div-zero, nan-output").expect("rules");
        assert!(!filter.warned);
        assert_eq!(ids(filter), ["int-div-zero", "nan-output"]);
        assert!(findings_of(" warn ").expect("a word").warned);
        let why = findings_of("nan-outputs").expect_err("no rule");
        assert!(why.contains("`nan-outputs`") && why.contains("did you mean `nan-output`?"), "{why}");
    }

    #[test]
    fn filters_are_known_by_name() {
        let mut filters = ExceptionFilters::OFF;
        assert!(filters.add("trap", None).and_then(|()| filters.add("sanitizer", Some(""))).is_ok());
        assert!(filters.traps && !filters.nans && filters.findings == Some(FindingFilter::default()));
        assert!(filters.add("nan", Some("x")).is_err() && filters.add("traps", None).is_err());
        let offered = ExceptionFilters::offered();
        assert!(offered.iter().all(|offer| filters.add(&offer.filter, None).is_ok()));
    }
}
