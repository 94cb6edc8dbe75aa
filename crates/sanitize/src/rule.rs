//! The rules that the sanitizer checks while shaders run: their ids, what must hold, who says so,
//! and what to do about it.

/// Defines the rules of a section, and the list of them.
macro_rules! rules {
    ($($name:ident $id:literal $kind:ident $holds:literal $source:literal $help:literal)*) => {
        $(
            #[doc = $holds]
            pub static $name: $crate::rule::Rule = $crate::rule::Rule {
                id: $id,
                kind: $crate::rule::RuleKind::$kind,
                holds: $holds,
                source: $source,
                help: $help,
            };
        )*
        /// The rules of this section.
        pub static RULES: &[&$crate::rule::Rule] = &[$(&$name),*];
    };
}

pub mod arithmetic;
pub mod choice;
pub mod contract;
pub mod hit_object;
pub mod image;
pub mod memory;
pub mod module;
pub mod query;
pub mod race;
pub mod stop;
pub mod structure;
pub mod subgroup;
pub mod trace;
pub mod traversal;
pub mod uniformity;

use std::fmt;

use serde::{Deserialize, Serialize};

/// What happens to a finding: nothing, a warning, or an error that ends the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Nobody is told.
    Allow,
    /// It is told, and the run passes.
    Warn,
    /// It is told, and the run fails.
    Deny,
}

impl Level {
    /// The name in scenes and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Allow => "allow",
            Self::Warn => "warn",
            Self::Deny => "deny",
        }
    }
}

/// What breaking a rule means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RuleKind {
    /// Undefined behaviour: anything may happen from the instruction on.
    UndefinedBehavior,
    /// An undefined value, which is reported where something depends on it: a branch, an index, an
    /// address, a ray or an output.
    UndefinedValue,
    /// A choice that the specification leaves open, on which the outputs of a run depend.
    OpenChoice,
    /// Legal, but rarely meant.
    Lint,
    /// A limit of this crate or of the run: what is behind it nobody knows.
    Limit,
    /// What this crate does not run.
    Gap,
}

impl RuleKind {
    /// The level of rules of this kind unless the user says otherwise.
    pub fn default_level(self) -> Level {
        match self {
            Self::UndefinedBehavior | Self::UndefinedValue | Self::OpenChoice | Self::Limit | Self::Gap => {
                Level::Deny
            }
            Self::Lint => Level::Warn,
        }
    }

    /// The kind in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::UndefinedBehavior => "undefined behaviour",
            Self::UndefinedValue => "undefined value",
            Self::OpenChoice => "open choice",
            Self::Lint => "lint",
            Self::Limit => "limit",
            Self::Gap => "unsupported",
        }
    }

    /// Whose matter a finding is: `bug` is the shader's or the scene's, `gap` is this crate's,
    /// and `stop` is a run that ended before anybody knew.
    pub fn class(self) -> &'static str {
        match self {
            Self::UndefinedBehavior | Self::UndefinedValue | Self::OpenChoice | Self::Lint => "bug",
            Self::Limit => "stop",
            Self::Gap => "gap",
        }
    }
}

/// A rule of the specifications, or a lint.
#[derive(Debug)]
pub struct Rule {
    /// Its name, by which levels are set: `int-div-zero`.
    pub id: &'static str,
    /// What breaking it means.
    pub kind: RuleKind,
    /// What must hold, as a sentence.
    pub holds: &'static str,
    /// The section or VUID that says so; of a lint, why it is told.
    pub source: &'static str,
    /// What to do about a finding.
    pub help: &'static str,
}

impl PartialEq for Rule {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

impl Eq for Rule {}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id)
    }
}

/// All rules, section by section.
pub fn all() -> impl Iterator<Item = &'static Rule> {
    let sections = [
        trace::RULES,
        query::RULES,
        traversal::RULES,
        hit_object::RULES,
        contract::RULES,
        structure::RULES,
        subgroup::RULES,
        uniformity::RULES,
        memory::RULES,
        race::RULES,
        module::RULES,
        arithmetic::RULES,
        choice::RULES,
        image::RULES,
    ];
    sections.into_iter().flatten().copied()
}

/// The rules that end a run: their levels cannot be set.
pub fn of_stops() -> impl Iterator<Item = &'static Rule> {
    stop::RULES.iter().copied()
}

/// The rule with an id.
pub fn find(id: &str) -> Option<&'static Rule> {
    all().find(|rule| rule.id == id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_id_is_there_once_and_is_found() {
        let mut ids: Vec<&str> = all().chain(of_stops()).map(|rule| rule.id).collect();
        ids.sort_unstable();
        let twice: Vec<_> = ids.windows(2).filter(|pair| pair[0] == pair[1]).collect();
        assert!(twice.is_empty(), "{twice:?}");
        assert!(all().all(|rule| find(rule.id) == Some(rule)));
        assert_eq!(find("no-such-rule"), None);
    }

    #[test]
    fn lints_warn_and_everything_undefined_denies() {
        let level = |id| find(id).expect("a rule").kind.default_level();
        assert_eq!(
            [level("nan-output"), level("pow-domain"), level("int-div-zero")],
            [Level::Warn, Level::Deny, Level::Deny]
        );
    }
}
