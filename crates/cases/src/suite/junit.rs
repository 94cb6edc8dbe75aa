//! The suite as JUnit XML, in the form that CI engines read: a `testsuite` for each file.

use std::io;
use std::time::Duration;

use quick_xml::Writer;
use quick_xml::events::attributes::Attribute;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};
use quick_xml::name::QName;

use crate::suite::{Ended, SuiteResult, TestResult};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;

/// The XML, with how long tests took where that is wanted. Hidden characters, some of which XML
/// cannot hold (XML 1.0, section 2.2), are escapes.
///
/// # Errors
/// `Io` where the writer of XML fails.
pub fn junit(result: &SuiteResult, with_times: bool) -> Result<String> {
    let failed = |error: io::Error| {
        Error::new(ErrorKind::Io, format!("the report as JUnit XML: {error}")).caused_by(error)
    };
    let mut report = JUnit { xml: Writer::new_with_indent(Vec::new(), b' ', 4), with_times };
    report.write(&result.tests).map_err(failed)?;
    let mut xml = report.xml.into_inner();
    xml.push(b'\n');
    String::from_utf8(xml).map_err(|error| failed(io::Error::other(error)))
}

/// A report while it is written.
struct JUnit {
    xml: Writer<Vec<u8>>,
    with_times: bool,
}

impl JUnit {
    fn write(&mut self, tests: &[TestResult]) -> io::Result<()> {
        self.xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        self.begin("testsuites", "anyhit", tests)?;
        for group in tests.chunk_by(|one, next| one.file == next.file) {
            self.begin("testsuite", &group[0].file, group)?;
            group.iter().try_for_each(|test| self.case(test))?;
            self.xml.write_event(Event::End(BytesEnd::new("testsuite")))?;
        }
        self.xml.write_event(Event::End(BytesEnd::new("testsuites")))
    }

    /// Begins an element with the totals of some tests.
    fn begin(&mut self, element: &str, name: &str, tests: &[TestResult]) -> io::Result<()> {
        let count = |ended| tests.iter().filter(|test| test.ended == ended).count().to_string();
        let mut start = BytesStart::new(element);
        start.push_attribute(("name", &*escape::line(name)));
        start.push_attribute(("tests", tests.len().to_string().as_str()));
        start.push_attribute(("failures", count(Ended::Failed).as_str()));
        start.push_attribute(("errors", count(Ended::Error).as_str()));
        self.time(&mut start, tests.iter().map(TestResult::took).sum());
        self.xml.write_event(Event::Start(start))
    }

    fn case(&mut self, test: &TestResult) -> io::Result<()> {
        let mut start = BytesStart::new("testcase");
        start.push_attribute(("classname", &*escape::line(&class_name(&test.path))));
        start.push_attribute(("name", &*escape::line(&test.name)));
        start.push_attribute(("file", &*escape::line(&test.path)));
        self.time(&mut start, test.took());
        let message = escape::text(test.message.as_deref().unwrap_or_default(), false);
        let (mut inside, text) = match test.ended {
            Ended::Passed | Ended::Renewed => return self.xml.write_event(Event::Empty(start)),
            Ended::KnownFailure => (BytesStart::new("system-out"), format!("known failure: {message}")),
            Ended::Failed => (BytesStart::new("failure"), escape::text(&test.text, false).into_owned()),
            Ended::Error => (BytesStart::new("error"), escape::text(&test.text, false).into_owned()),
        };
        if test.ended != Ended::KnownFailure {
            inside.push_attribute(Attribute { key: QName(b"message"), value: attribute(&message).into() });
            inside.push_attribute(("type", test.ended.word()));
        }
        let end = inside.to_end().into_owned();
        self.xml.write_event(Event::Start(start))?;
        self.xml.write_event(Event::Start(inside))?;
        self.xml.write_event(Event::Text(BytesText::new(&text)))?;
        self.xml.write_event(Event::End(end))?;
        self.xml.write_event(Event::End(BytesEnd::new("testcase")))
    }

    fn time(&self, start: &mut BytesStart<'_>, took: Duration) {
        if self.with_times {
            start.push_attribute(("time", format!("{:.3}", took.as_secs_f64()).as_str()));
        }
    }
}

/// The class of a test's file, by which tools group tests: its path with dots, without extensions.
fn class_name(path: &str) -> String {
    let bare = path.strip_suffix(".toml").unwrap_or(path);
    bare.strip_suffix(".test").unwrap_or(bare).trim_start_matches('/').replace('/', ".")
}

/// The value of an attribute that may have several lines. A reader turns line feeds and tabs into
/// blanks, but no references to them (XML 1.0, section 3.3.3).
fn attribute(text: &str) -> Vec<u8> {
    quick_xml::escape::escape(text).replace('\n', "&#10;").replace('\t', "&#9;").into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_paths_with_dots() {
        for (path, class) in [
            ("shaders/red/ball.test.toml", "shaders.red.ball"),
            ("shaders/red/scene.toml", "shaders.red.scene"),
            ("/outside/scene.toml", "outside.scene"),
            ("a.toml.txt", "a.toml.txt"),
        ] {
            assert_eq!(class_name(path), class);
        }
    }

    #[test]
    fn an_attribute_keeps_its_lines() {
        assert_eq!(attribute("a < \"b\"\n\tc"), b"a &lt; &quot;b&quot;&#10;&#9;c");
    }
}
