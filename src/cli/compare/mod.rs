//! `anyhit trace-one-ray --compare`: where two runs part.

mod parting;

use std::path::Path;

use serde_json::Value;

use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_debugger::command;
use anyhit_debugger::session::ExplainRequest;
use anyhit_engine::geometry::Precision;
use anyhit_explain::Transcript;
use anyhit_scene::files::{DiskFiles, Files};

pub(super) use parting::text;

/// What a run is compared with.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Other {
    /// Another pixel of the scene.
    Pixel(ExplainRequest),
    /// Intersections of another precision.
    Precision(Precision),
    /// The transcript of an earlier run.
    Saved(String),
    /// Another scene, with the request.
    Scene(String),
}

impl Other {
    /// Reads what `--compare` was given.
    ///
    /// # Errors
    /// `InvalidArgument` for a pixel or a precision that is none.
    pub(super) fn parse(text: &str) -> Result<Self> {
        match text.split_once('=') {
            Some(("pixel", pixel)) => command::pixel(pixel).map(ExplainRequest::Pixel).map(Self::Pixel),
            Some(("precision", name)) => {
                let found = Precision::ALL.into_iter().find(|one| one.name() == name);
                found.map(Self::Precision).ok_or_else(|| {
                    let all = Precision::ALL.map(Precision::name).join(", ");
                    Error::new(ErrorKind::InvalidArgument, format!("`{name}` is not a precision"))
                        .note(format!("the precisions are {all}"))
                })
            }
            _ if text.ends_with(".json") => Ok(Self::Saved(text.to_owned())),
            _ => Ok(Self::Scene(text.to_owned())),
        }
    }
}

/// The JSON of a transcript, with the digits that are printed.
///
/// # Errors
/// `Io` where it cannot be written.
pub(super) fn json(transcript: &Transcript) -> Result<Value> {
    let text = serde_json::to_string(transcript);
    let value = text.and_then(|text| serde_json::from_str(&text));
    value.map_err(|error| Error::new(ErrorKind::Io, error.to_string()))
}

/// Reads a transcript that `--json` printed.
///
/// # Errors
/// `Io` where the file cannot be read, `InvalidArgument` where it is no transcript of this version.
pub(super) fn read(path: &str) -> Result<Value> {
    let bytes = DiskFiles.read(Path::new(path))?;
    let invalid = |why: String| {
        Error::new(ErrorKind::InvalidArgument, format!("`{path}` is not a transcript: {why}"))
            .note("`anyhit trace-one-ray SCENE --json` prints a transcript")
    };
    let value: Value = serde_json::from_slice(&bytes).map_err(|error| invalid(error.to_string()))?;
    if value["version"] != anyhit_explain::transcript::VERSION || !value["root"].is_object() {
        return Err(invalid("`version` 1 and `root` are missing".to_owned()));
    }
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_compared_with_is_told_by_its_form() {
        assert_eq!(Other::parse("pixel=3,4").unwrap(), Other::Pixel(ExplainRequest::Pixel([3, 4, 0])));
        assert_eq!(Other::parse("precision=exact").unwrap(), Other::Precision(Precision::Exact));
        assert_eq!(Other::parse("before.json").unwrap(), Other::Saved("before.json".into()));
        assert_eq!(Other::parse("a=b/scene.toml").unwrap(), Other::Scene("a=b/scene.toml".into()));
        assert!(Other::parse("pixel=3").is_err());
        assert!(Other::parse("precision=good").unwrap_err().message().contains("`good` is not a precision"));
    }
}
