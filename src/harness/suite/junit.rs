//! The suite as JUnit XML, in the form that CI engines read: a `testsuite` for each file.

use std::io;
use std::time::Duration;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};

use crate::error::{Error, ErrorKind, Result};
use crate::harness::suite::{Finished, Outcome, SuiteReport, report};

/// The XML. Characters that XML cannot hold, such as the escape codes of a terminal, are left out.
///
/// # Errors
/// `Io` where the writer of XML fails.
pub fn junit(report: &SuiteReport) -> Result<String> {
    let failed = |error: io::Error| {
        Error::new(ErrorKind::Io, format!("the report as JUnit XML: {error}")).caused_by(error)
    };
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 4);
    write(&mut writer, &report.finished).map_err(failed)?;
    let mut xml = writer.into_inner();
    xml.push(b'\n');
    String::from_utf8(xml).map_err(|error| failed(io::Error::other(error)))
}

type Xml = Writer<Vec<u8>>;

fn write(xml: &mut Xml, finished: &[Finished]) -> io::Result<()> {
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    suite(xml, "testsuites", "anyhit", finished, |xml| {
        for group in finished.chunk_by(|one, next| one.file == next.file) {
            let name = group[0].file.display().to_string();
            suite(xml, "testsuite", &name, group, |xml| group.iter().try_for_each(|test| case(xml, test)))?;
        }
        Ok(())
    })
}

/// Writes an element with the totals of some tests, around what `inside` writes.
fn suite(
    xml: &mut Xml,
    element: &str,
    name: &str,
    tests: &[Finished],
    inside: impl FnOnce(&mut Xml) -> io::Result<()>,
) -> io::Result<()> {
    let count = |wanted: fn(&Outcome) -> bool| tests.iter().filter(|test| wanted(&test.outcome)).count();
    let failures = count(|outcome| matches!(outcome, Outcome::Failed(_)));
    let errors = count(|outcome| matches!(outcome, Outcome::Broken(_)));
    xml.create_element(element)
        .with_attribute(("name", printable(name).as_str()))
        .with_attribute(("tests", tests.len().to_string().as_str()))
        .with_attribute(("failures", failures.to_string().as_str()))
        .with_attribute(("errors", errors.to_string().as_str()))
        .with_attribute(("time", seconds(tests.iter().map(|test| test.took).sum()).as_str()))
        .write_inner_content(inside)?;
    Ok(())
}

fn case(xml: &mut Xml, finished: &Finished) -> io::Result<()> {
    let name = printable(&finished.name);
    let element = xml
        .create_element("testcase")
        .with_attribute(("name", name.as_str()))
        .with_attribute(("time", seconds(finished.took).as_str()));
    let (kind, error) = match &finished.outcome {
        Outcome::Passed | Outcome::Renewed => return element.write_empty().map(drop),
        Outcome::KnownFailure(why) => {
            let why = printable(&format!("known failure: {why}"));
            return element
                .write_inner_content(|xml| {
                    xml.create_element("system-out").write_text_content(BytesText::new(&why)).map(drop)
                })
                .map(drop);
        }
        Outcome::Failed(failure) => ("failure", failure.errors.first()),
        Outcome::Broken(error) => ("error", Some(error)),
    };
    let message = printable(error.map_or("not as expected", |error| error.message()));
    let description = printable(&report::text(finished, false));
    element
        .write_inner_content(|xml| {
            xml.create_element(kind)
                .with_attribute(("message", message.as_str()))
                .with_attribute(("type", finished.outcome.word()))
                .write_text_content(BytesText::new(&description))
                .map(drop)
        })
        .map(drop)
}

fn seconds(took: Duration) -> String {
    format!("{:.3}", took.as_secs_f64())
}

/// Text without the characters that no XML document may hold (XML 1.0, section 2.2).
fn printable(text: &str) -> String {
    let is_char = |c: &char| matches!(c, '\t' | '\n' | '\r' | ' '..='\u{D7FF}' | '\u{E000}'..='\u{FFFD}' | '\u{10000}'..);
    text.chars().filter(is_char).collect()
}
