//! Which level each rule has: its default, or what the user said.

use crate::rule::{self, Level, Rule};
use anyhit_base::error::names::{list_of, nearest};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::sorted::SortedMap;

/// The levels of rules.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Levels {
    by_id: SortedMap<&'static str, Level>,
}

/// Rules that were a part of another one: where its own level is not set, each has the level that
/// is set for that one.
static SPLIT_FROM: [(&str, &str); 1] = [("race-workgroup", "race-buffer")];

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
        let is_part = |id: &str| SPLIT_FROM.iter().any(|(part, _)| *part == id);
        self.by_id.retain(|id, _| !is_part(id));
        self.by_id.extend(rule::all().filter(|rule| !is_part(rule.id)).map(|rule| (rule.id, level)));
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
        for (part, whole) in SPLIT_FROM {
            if let Some(&level) = others.by_id.get(whole) {
                self.by_id.insert(part, level);
            }
        }
        self.by_id.extend(others.by_id.iter().map(|(&id, &level)| (id, level)));
        self
    }

    /// The level of a rule.
    pub fn of(&self, rule: &Rule) -> Level {
        let set = |id: &str| self.by_id.get(id).copied();
        let of_whole =
            || SPLIT_FROM.iter().find(|(part, _)| *part == rule.id).and_then(|(_, whole)| set(whole));
        set(rule.id).or_else(of_whole).unwrap_or_else(|| rule.kind.default_level())
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

    #[test]
    fn a_rule_that_was_a_part_of_another_keeps_the_level_of_that_one() {
        use rule::race::{RACE_BUFFER, RACE_WORKGROUP};
        let set = |pairs: &[(&str, Level)]| {
            let mut levels = Levels::default();
            pairs.iter().for_each(|(id, level)| levels.set(id, *level).expect("a rule"));
            levels
        };
        let of = |levels: &Levels| [&RACE_BUFFER, &RACE_WORKGROUP].map(|rule| levels.of(rule));
        let allowed = set(&[("race-buffer", Level::Allow)]);
        assert_eq!(of(&allowed), [Level::Allow; 2]);
        let own = set(&[("race-workgroup", Level::Warn), ("race-buffer", Level::Allow)]);
        assert_eq!(of(&own), [Level::Allow, Level::Warn]);
        assert_eq!(of(&set(&[("race-workgroup", Level::Warn)])), [Level::Deny, Level::Warn]);
        let mut all = Levels::default();
        all.set_all(Level::Warn);
        assert_eq!(of(&all), [Level::Warn; 2]);
        all.set("race-buffer", Level::Allow).expect("a rule");
        assert_eq!(of(&all), [Level::Allow; 2]);
        // A flag wins over the scene, whichever of the two names each has.
        assert_eq!(of(&own.clone().overridden_by(&allowed)), [Level::Allow; 2]);
        assert_eq!(of(&allowed.overridden_by(&own)), [Level::Allow, Level::Warn]);
    }
}
