//! Which level each rule has: its default, or what the user said.

use crate::error::names::{list_of, nearest};
use crate::error::{Error, ErrorKind, Result};
use crate::sanitize::rule::{self, Level, Rule};
use crate::sorted::SortedMap;

/// The levels of rules.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Levels {
    by_id: SortedMap<&'static str, Level>,
}

/// The default of every rule.
static DEFAULTS: Levels = Levels { by_id: SortedMap::new() };

impl Levels {
    /// The default of every rule.
    pub fn defaults() -> &'static Self {
        &DEFAULTS
    }

    /// Sets the level of the rule with an id.
    ///
    /// # Errors
    /// `InvalidArgument` where no rule has the id, with those that are like it.
    pub fn set(&mut self, id: &str, level: Level) -> Result<()> {
        self.by_id.insert(Self::rule(id)?.id, level);
        Ok(())
    }

    /// The rule with an id, whose level can be set.
    ///
    /// # Errors
    /// `InvalidArgument` where no rule has the id, with those that are like it.
    pub fn rule(id: &str) -> Result<&'static Rule> {
        rule::find(id).ok_or_else(|| unknown(id))
    }

    /// Sets the level of all rules that deny by default, or warn.
    pub fn set_all(&mut self, level: Level) {
        self.by_id.extend(rule::all().map(|rule| (rule.id, level)));
    }

    /// These levels for some rules, and all others allowed.
    #[must_use]
    pub fn restricted_to(self, rules: &[&'static Rule]) -> Self {
        let mut restricted = Self::default();
        restricted.set_all(Level::Allow);
        restricted.by_id.extend(rules.iter().map(|rule| (rule.id, self.of(rule))));
        restricted
    }

    /// These levels, and over them those that others set.
    #[must_use]
    pub fn overridden_by(mut self, others: &Self) -> Self {
        self.by_id.extend(others.by_id.iter().map(|(&id, &level)| (id, level)));
        self
    }

    /// The level of a rule.
    pub fn of(&self, rule: &Rule) -> Level {
        self.by_id.get(rule.id).copied().unwrap_or_else(|| rule.kind.default_level())
    }
}

fn unknown(id: &str) -> Error {
    let ids = || rule::all().map(|rule| rule.id);
    let error = Error::new(ErrorKind::InvalidArgument, format!("the sanitizer has no rule `{id}`"));
    match nearest(id, ids()) {
        Some(near) => error.note(format!("did you mean `{near}`?")),
        None => error.note(format!("rules: {}", list_of(ids()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_the_default_unless_it_is_set() {
        let mut levels = Levels::default();
        assert_eq!(levels.of(&rule::arithmetic::NAN_OUTPUT), Level::Warn);
        levels.set("nan-output", Level::Deny).expect("a rule");
        assert_eq!(levels.of(&rule::arithmetic::NAN_OUTPUT), Level::Deny);
        let error = levels.set("nan-outputs", Level::Allow).expect_err("no rule");
        assert_eq!(error.message(), "the sanitizer has no rule `nan-outputs`");
        assert_eq!(error.notes(), ["did you mean `nan-output`?"]);
    }
}
