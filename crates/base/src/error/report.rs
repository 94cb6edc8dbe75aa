//! Errors for machines: their classes, and their shape in JSON.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Trap};

/// The class of an error, for machines: `--json` and the exit code report it. In the order of
/// severity: of several classes, a command reports the greatest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorClass {
    /// An expectation did not hold.
    Expectation,
    /// A shader trapped, running out of fuel or time included.
    Trap,
    /// The sanitizer denies what a shader does.
    Finding,
    /// A gap of this crate, this build or this machine.
    Unsupported,
    /// What was read exceeds a limit of [`InputLimits`](crate::input::InputLimits).
    Limit,
    /// Any other error: a mistake in an input, or what the operating system refused.
    Other,
}

impl ErrorClass {
    /// The name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Expectation => "expectation",
            Self::Trap => "trap",
            Self::Finding => "finding",
            Self::Unsupported => "unsupported",
            Self::Limit => "limit",
            Self::Other => "error",
        }
    }

    /// The exit code of the command line.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Expectation => 1,
            Self::Other => 2,
            Self::Trap => 3,
            Self::Unsupported => 4,
            Self::Limit => 5,
            Self::Finding => 6,
        }
    }
}

/// An error as every `--json` has it.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorReport {
    /// The message, one line.
    pub message: String,
    /// The name of its [`ErrorClass`].
    pub class: &'static str,
    /// Notes, such as a rule, values and callers.
    pub notes: Vec<String>,
    /// The whole report as the terminal shows it.
    pub report: String,
    /// The trap that it tells of, if it tells of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trap: Option<Trap>,
}

impl ErrorReport {
    /// The report of an error.
    pub fn of(error: &Error) -> Self {
        Self {
            message: error.message().to_owned(),
            class: error.class().name(),
            notes: error.notes().to_vec(),
            report: error.render(),
            trap: error.trap().cloned(),
        }
    }

    /// The reports of an error and of those that were found with it; the whole report of the first
    /// one tells of all.
    pub fn all(error: &Error) -> Vec<Self> {
        std::iter::once(error).chain(error.others()).map(Self::of).collect()
    }
}
