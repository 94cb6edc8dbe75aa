//! How findings are reported: as errors with their place, or as warnings, a line for each missing
//! declaration.

use std::fmt;

use crate::module::Module;
use crate::module::validate::ValidationFinding;
use anyhit_base::error::{Error, ErrorKind, Place, Result};

/// Names that a warning lists before it counts the others.
const MOST_NAMES: usize = 12;

impl ValidationFinding {
    /// Returns the finding as an `InvalidModule` error with place, rule and fix.
    #[must_use]
    pub fn error(&self) -> Error {
        self.diagnostic(false)
    }

    /// The finding as a diagnostic that is rendered as an error or a warning.
    #[doc(hidden)]
    pub fn diagnostic(&self, is_warning: bool) -> Error {
        let label = self.id.map(|id| format!("%{id}")).unwrap_or_default();
        Error::new(ErrorKind::InvalidModule, &*self.message)
            .at_with(Place::Word(self.word), label)
            .note(format!("rule: {}", self.rule))
            .note(format!("help: {}", self.fix))
            .with_rule(self.class.name(), is_warning)
    }
}

/// Formats the finding in one line: message, place, rule, fix.
impl fmt::Display for ValidationFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (at word {}", self.message, self.word)?;
        if let Some(id) = self.id {
            write!(f, ", %{id}")?;
        }
        write!(f, "; {}); {}", self.rule, self.fix)
    }
}

impl Module {
    /// Rejects a module that breaks a rule without which it has no defined meaning.
    ///
    /// # Errors
    /// `InvalidModule` with every fault of the module.
    pub(crate) fn check_faults(&self) -> Result<()> {
        errors_of(self.faults())
    }

    /// Returns a warning for each declaration that the module lacks, a line each, which names the
    /// module and all that requires the declaration.
    #[doc(hidden)]
    pub fn declaration_warnings(&self, name: &str) -> Vec<String> {
        let mut left: Vec<&ValidationFinding> = self.undeclared().iter().collect();
        let mut warnings = Vec::new();
        while !left.is_empty() {
            let first = left.remove(0);
            let mut names = Vec::new();
            left.retain(|one| {
                let is_same = one.class == first.class && one.fix == first.fix;
                if is_same {
                    names.push(one.name.as_str());
                }
                !is_same
            });
            let count = names.len();
            names.truncate(MOST_NAMES);
            let others = match (count - names.len(), names.join(", ")) {
                (_, names) if names.is_empty() => String::new(),
                (0, names) => format!("; also required by {names}"),
                (more, names) => format!("; also required by {names} and {more} more"),
            };
            warnings.push(format!("warning: {name}: {first}{others}"));
        }
        warnings
    }

    /// Rejects a module that lacks a declaration.
    ///
    /// # Errors
    /// `InvalidModule` with every name whose capability or extension the module does not declare.
    #[doc(hidden)]
    pub fn check_declarations(&self) -> Result<()> {
        errors_of(self.undeclared())
    }
}

fn errors_of(findings: &[ValidationFinding]) -> Result<()> {
    match findings {
        [] => Ok(()),
        all => Err(Error::several(all.iter().map(ValidationFinding::error).collect())),
    }
}
