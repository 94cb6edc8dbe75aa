//! The suite as JUnit XML, in the form that CI engines read: a `testsuite` for each file.

use std::time::Duration;

use quick_junit::{NonSuccessKind, TestCase, TestCaseStatus, TestSuite};

use crate::error::{Error, ErrorKind, Result};
use crate::harness::suite::{Finished, Outcome, SuiteReport, report};

/// The XML. What XML cannot hold, such as the codes of a terminal's colours, is left out.
///
/// # Errors
/// `Io` where the writer of XML fails.
pub fn junit(report: &SuiteReport) -> Result<String> {
    let mut xml = quick_junit::Report::new("anyhit");
    xml.set_time(time(&report.finished));
    for group in report.finished.chunk_by(|one, next| one.file == next.file) {
        let mut suite = TestSuite::new(group[0].file.display().to_string());
        suite.set_time(time(group));
        suite.add_test_cases(group.iter().map(case));
        xml.add_test_suite(suite);
    }
    xml.to_string().map_err(|error| Error::new(ErrorKind::Io, format!("the report as JUnit XML: {error}")))
}

fn time(tests: &[Finished]) -> Duration {
    tests.iter().map(|test| test.took).sum()
}

fn case(finished: &Finished) -> TestCase {
    let (kind, error) = match &finished.outcome {
        Outcome::Passed | Outcome::Renewed | Outcome::KnownFailure(_) => (None, None),
        Outcome::Failed(failure) => (Some(NonSuccessKind::Failure), failure.errors.first()),
        Outcome::Broken(error) => (Some(NonSuccessKind::Error), Some(error)),
    };
    let status = match kind {
        None => TestCaseStatus::success(),
        Some(kind) => {
            let mut status = TestCaseStatus::non_success(kind);
            status
                .set_message(error.map_or("not as expected", |error| error.message()))
                .set_type(finished.outcome.word())
                .set_description(report::text(finished, false));
            status
        }
    };
    let mut case = TestCase::new(finished.name.as_str(), status);
    case.set_time(finished.took);
    if let Outcome::KnownFailure(why) = &finished.outcome {
        case.set_system_out(format!("known failure: {why}"));
    }
    case
}
