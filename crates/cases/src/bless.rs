//! Rewrites recorded expectations: values in scene files, and whole files beside them.
//!
//! Only the bytes of a value change: comments, order and form of a file stay as they are. Several
//! processes may do so at once, the shards of a suite say: each locks a file, reads it anew, and
//! puts its values where they stand by now. Each file is whole at any moment.

mod merge;

use std::path::{Path, PathBuf};

use crate::expect::Fix;
use anyhit_base::atomic_file::{self, FileLock};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, read_regular};
use anyhit_base::sorted::{SortedMap, sort, sort_by_key};
use anyhit_scene::read::{Span, TomlSource};
use merge::Merge;

/// Writes changes to the files that they are of, and gives the files in order. A file is read again
/// within the limits that it was read with.
///
/// # Errors
/// `Expectation` where two changes of one value disagree (two variants leave different results):
/// then nothing is written. `Io` where a file cannot be written, or was changed meanwhile in what
/// is not recorded; a note lists the files that were written all the same.
pub fn bless(fixes: Vec<Fix>, limits: &InputLimits) -> Result<Vec<PathBuf>> {
    let mut files: SortedMap<PathBuf, Vec<u8>> = SortedMap::new();
    let mut texts: SortedMap<PathBuf, Vec<(Span, String)>> = SortedMap::new();
    for fix in fixes {
        match fix {
            Fix::File(path, bytes) => match files.insert(path.clone(), bytes.clone()) {
                Some(other) if other != bytes => return Err(disagreement(escape::path(&path).to_string())),
                _ => {}
            },
            Fix::Text(span, text) => {
                texts.entry(span.source.path.clone()).or_default().push((span, text));
            }
        }
    }
    for changes in texts.values_mut() {
        settle(changes)?;
    }
    let written = files.iter().map(|(path, bytes)| (path, atomic_file::write(path, bytes)));
    let renewed = texts.iter().map(|(path, changes)| (path, renew(path, changes, limits)));
    let (mut done, mut errors) = (Vec::new(), Vec::new());
    for (path, result) in written.chain(renewed) {
        match result {
            Ok(()) => done.push(path.clone()),
            Err(error) => errors.push(error),
        }
    }
    sort(&mut done);
    if errors.is_empty() {
        return Ok(done);
    }
    let error = Error::several(errors);
    Err(done.iter().fold(error, |error, path| error.note(format!("renewed: {}", escape::path(&path)))))
}

/// Changes of one text in order, each once.
fn settle(changes: &mut Vec<(Span, String)>) -> Result<()> {
    sort_by_key(changes, |(span, _)| (span.range.start, span.range.end));
    changes.dedup();
    for pair in changes.windows(2) {
        let [(before, _), (span, _)] = pair else { continue };
        if span.range.start < before.range.end {
            let place = span.place();
            return Err(disagreement(escape::path(&span.source.path).to_string()).at(place));
        }
    }
    Ok(())
}

/// Puts changes, in order, into the file as it is by now.
fn renew(path: &Path, changes: &[(Span, String)], limits: &InputLimits) -> Result<()> {
    // There is a change wherever there is a path.
    let Some((Span { source, .. }, _)) = changes.first() else { return Ok(()) };
    let _lock = FileLock::of(path)?;
    // Another process may have put anything there meanwhile, a pipe as well.
    let now = String::from_utf8(read_regular(path, None, InputLimit::SceneBytes, limits)?)
        .map_err(|error| Error::io(path, std::io::Error::new(std::io::ErrorKind::InvalidData, error)))?;
    let text = if *now == *source.text {
        changed(&now, changes.iter().map(|(span, new)| (span.range.clone(), new.as_str())))
    } else {
        merged(source, &now, changes)?
    };
    if text == now { Ok(()) } else { atomic_file::write(path, text) }
}

/// A text with other words in some places, which are in order.
fn changed<'a>(old: &str, changes: impl Iterator<Item = (std::ops::Range<usize>, &'a str)>) -> String {
    let mut text = String::new();
    let mut end = 0;
    for (range, new) in changes {
        text.push_str(&old[end..range.start]);
        text.push_str(new);
        end = range.end;
    }
    text.push_str(&old[end..]);
    text
}

/// Changes of a text that another process changed since it was read.
fn merged(source: &TomlSource, now: &str, changes: &[(Span, String)]) -> Result<String> {
    let refused = |why: String| {
        let message = format!("{} changed while its tests ran", escape::path(&source.path));
        Error::new(ErrorKind::Io, message).note(why).note("no values were written: run the tests again")
    };
    let merge = Merge::of(&source.text, now).map_err(&refused)?;
    let mut moved = Vec::new();
    for (span, new) in changes {
        let Some(range) = merge.range(&span.range) else {
            let was = &source.text[span.range.clone()];
            return Err(refused(format!("`{was}` is no longer in the file")));
        };
        match &now[range.clone()] {
            there if there == new => {}
            there if *there == source.text[span.range.clone()] => moved.push((range, new.as_str())),
            there => {
                let note = format!("another run wrote `{there}` where this one finds `{new}`");
                return Err(disagreement(escape::path(&source.path).to_string()).at(span.place()).note(note));
            }
        }
    }
    sort_by_key(&mut moved, |(range, _)| range.start);
    Ok(changed(now, moved.into_iter()))
}

fn disagreement(what: String) -> Error {
    let message = format!("{what}: two runs found different values, so neither was written");
    Error::new(ErrorKind::Expectation, message)
        .note("variants of a scene, or several tests, share this expectation but have different results")
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

    fn settled(mut changes: Vec<(Span, String)>) -> Result<String> {
        settle(&mut changes)?;
        let text = changes[0].0.source.text.clone();
        Ok(changed(&text, changes.iter().map(|(span, new)| (span.range.clone(), new.as_str()))))
    }

    #[test]
    fn only_values_change() {
        let source = source("a = [ 1, 2 ] # one, two\\nb='x'");
        let changes = vec![at(&source, "'x'", "\"y\""), at(&source, "2", "3.5"), at(&source, "2", "3.5")];
        assert_eq!(settled(changes).unwrap(), "a = [ 1, 3.5 ] # one, two\\nb=\"y\"");
    }

    #[test]
    fn a_file_is_read_again_within_its_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let source = Arc::new(TomlSource { path: path.clone(), text: "a = 1".into() });
        let fix = || vec![Fix::Text(at(&source, "1", "2").0, "2".into())];
        let limits = |most| InputLimits::default().with(InputLimit::SceneBytes, most);
        // Five bytes when its tests ran, and six by now.
        std::fs::write(&path, "a = 1\n").unwrap();
        let error = bless(fix(), &limits(5)).unwrap_err();
        assert!(error.message().contains("the limit `scene-bytes` of 5"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "a = 1\n");
        std::fs::write(&path, "a = 1").unwrap();
        assert_eq!(bless(fix(), &limits(5)).unwrap(), std::slice::from_ref(&path));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "a = 2");
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        let error = bless(fix(), &limits(5)).unwrap_err();
        assert!(error.message().contains("not a regular file"), "{error}");
    }

    #[test]
    fn variants_must_agree() {
        let source = source("a = 1");
        let error = settled(vec![at(&source, "1", "2"), at(&source, "1", "3")]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Expectation);
        assert!(error.render().contains("a.toml:1:5"), "{error:?}");
    }

    const BEFORE: &str = "[[ray]] # one\nname = 'a'\nexpect = { t = 1, payload = { x = [1, 2] } }\n\
        [[ray]]\nname = 'b'\n[ray.expect]\n[[ray]]\nname = 'c'\n[ray.expect]\nt = 7 # because\n";

    #[test]
    fn values_that_another_process_wrote_stay() {
        let source = source(BEFORE);
        // It filled the second ray, and renewed a value beside the one that changes here.
        let now = BEFORE
            .replace("t = 1,", "t = 1.25,")
            .replacen("[ray.expect]\n", "[ray.expect]\nmiss = true\n", 1)
            .replace("# one", "# one, and more words");
        let changes = [at(&source, "2", "2.5"), at(&source, "7", "7.5")];
        let expected = now.replace("2]", "2.5]").replace("t = 7 #", "t = 7.5 #");
        assert_eq!(merged(&source, &now, &changes).unwrap(), expected);
        // What it wrote already is there.
        assert_eq!(merged(&source, &expected, &changes).unwrap(), expected);
        // An empty table, found by its header, is filled behind another that was.
        let start = BEFORE.find("[ray.expect]").unwrap();
        let span = Span { source: source.clone(), range: start..start + "[ray.expect]".len() };
        let fill = [(span, "[ray.expect]\nmiss = true".to_owned())];
        let now = BEFORE.replace("t = 1,", "t = 1.25,");
        let filled = now.replacen("[ray.expect]\n", "[ray.expect]\nmiss = true\n", 1);
        assert_eq!(merged(&source, &now, &fill).unwrap(), filled);
        assert!(merged(&source, &filled, &fill).unwrap_err().render().contains("is no longer in the file"));
    }

    #[test]
    fn what_is_changed_by_hand_is_not_guessed() {
        let source = source(BEFORE);
        let change = [at(&source, "7", "7.5")];
        for (old, new) in [
            ("name = 'a'", "name = 'z'"),
            ("name = 'b'\n", "name = 'b'\norigin = [0, 0, 0]\n"),
            ("[[ray]]\nname = 'b'\n[ray.expect]\n", ""),
            ("t = 7", "t = 7\nmiss = false"),
            ("t = 7 # because", "t = 7\nbecause = 'derived'"),
            ("t = 7", "t = = 7"),
        ] {
            let now = BEFORE.replacen(old, new, 1);
            let error = merged(&source, &now, &change).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Io, "{now}");
            assert!(error.message().starts_with("a.toml changed while its tests ran"), "{error}");
        }
        let now = BEFORE.replace("t = 7", "t = 8");
        let error = merged(&source, &now, &change).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Expectation);
        assert!(error.render().contains("another run wrote `8` where this one finds `7.5`"), "{error:?}");
    }
}
