//! Rewrites recorded expectations: values in scene files, and whole files beside them.
//!
//! Only the bytes of a value change: comments, order and form of a file stay as they are.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::error::{Error, ErrorKind, Result};
use crate::harness::expect::Fix;
use crate::scene::read::{Span, TomlSource};

/// Writes changes to the files that they are of, and gives the files in order.
///
/// # Errors
/// `Expectation` where two changes of one value disagree (two variants leave different results),
/// `Io` where a file cannot be written or has changed meanwhile.
pub fn bless(fixes: Vec<Fix>) -> Result<Vec<PathBuf>> {
    let mut files: BTreeMap<PathBuf, Vec<u8>> = BTreeMap::new();
    let mut texts: BTreeMap<PathBuf, Vec<(Span, String)>> = BTreeMap::new();
    for fix in fixes {
        match fix {
            Fix::File(path, bytes) => match files.insert(path.clone(), bytes.clone()) {
                Some(other) if other != bytes => return Err(disagreement(path.display().to_string())),
                _ => {}
            },
            Fix::Text(span, text) => {
                texts.entry(span.source.path.clone()).or_default().push((span, text));
            }
        }
    }
    for (path, changes) in texts {
        // There is a change wherever there is a path.
        let Some(source) = changes.first().map(|(span, _)| span.source.clone()) else { continue };
        let now = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
        if *now != *source.text {
            let message = format!("{}: changed while its tests ran", path.display());
            return Err(Error::new(ErrorKind::Io, message));
        }
        files.insert(path, changed(&source, changes)?.into_bytes());
    }
    for (path, bytes) in &files {
        std::fs::write(path, bytes).map_err(|error| Error::io(path, error))?;
    }
    Ok(files.into_keys().collect())
}

/// A text with other words in some places.
fn changed(source: &TomlSource, mut changes: Vec<(Span, String)>) -> Result<String> {
    changes.sort_by_key(|(span, _)| (span.range.start, span.range.end));
    changes.dedup();
    let mut text = String::new();
    let mut end = 0;
    for (span, new) in &changes {
        if span.range.start < end {
            let place = span.place();
            return Err(disagreement(source.path.display().to_string()).at(place));
        }
        text.push_str(&source.text[end..span.range.start]);
        text.push_str(new);
        end = span.range.end;
    }
    text.push_str(&source.text[end..]);
    Ok(text)
}

fn disagreement(what: String) -> Error {
    let message = format!("{what}: two runs ask for different values, so neither is written");
    Error::new(ErrorKind::Expectation, message)
        .note("variants of a scene, or several tests, share this expectation and leave different results")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn source(text: &str) -> Arc<TomlSource> {
        Arc::new(TomlSource { path: "a.toml".into(), text: text.into() })
    }

    fn at(source: &Arc<TomlSource>, old: &str, new: &str) -> (Span, String) {
        let start = source.text.find(old).expect("such a text");
        (Span { source: source.clone(), range: start..start + old.len() }, new.into())
    }

    #[test]
    fn only_values_change() {
        let source = source("a = [ 1, 2 ] # one, two\\nb='x'");
        let changes = vec![at(&source, "'x'", "\"y\""), at(&source, "2", "3.5"), at(&source, "2", "3.5")];
        assert_eq!(changed(&source, changes).unwrap(), "a = [ 1, 3.5 ] # one, two\\nb=\"y\"");
    }

    #[test]
    fn variants_must_agree() {
        let source = source("a = 1");
        let error = changed(&source, vec![at(&source, "1", "2"), at(&source, "1", "3")]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Expectation);
        assert!(error.render().contains("a.toml:1:5"), "{error:?}");
    }
}
