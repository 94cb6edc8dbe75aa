//! Finds the values of a text in a later form of it, in which other recorded values were renewed.

use std::ops::Range;

use anyhit_base::sorted::SortedMap;
use anyhit_scene::read::Document;
use anyhit_scene::tree::{Toml, TomlMember, TomlNode};

/// The key of the tables that hold what is recorded.
const EXPECT: &str = "expect";

/// What nobody records, in such a table, either: names and reasons.
const WRITTEN_BY_HAND: &[&str] = &["name", "because", "known_failure", "file"];

/// Where the values of a text stand in a later form of it. Both have the same tables, keys and
/// lengths of arrays, and differ in recorded values alone.
pub(super) struct Merge {
    /// `None` where something stands there that was not there before.
    places: SortedMap<(usize, usize), Option<Range<usize>>>,
}

impl Merge {
    /// Compares two texts.
    ///
    /// # Errors
    /// What differs, in words, where that is more than recorded values.
    pub(super) fn of(before: &str, now: &str) -> Result<Self, String> {
        let parsed =
            |text| Document::parse("", text).map_err(|_| "the file is no longer valid TOML".to_owned());
        let (before, now) = (parsed(before)?, parsed(now)?);
        let mut merge = Self { places: SortedMap::new() };
        merge.compare(before.node(), now.node(), false, "")?;
        Ok(merge)
    }

    /// Where a value stands now.
    pub(super) fn range(&self, before: &Range<usize>) -> Option<Range<usize>> {
        self.places.get(&(before.start, before.end)).cloned().flatten()
    }

    fn compare(
        &mut self,
        before: &TomlNode,
        now: &TomlNode,
        recorded: bool,
        name: &str,
    ) -> Result<(), String> {
        let differs = || Err(format!("`{name}` changed"));
        match (&before.value, &now.value) {
            (Toml::Table(old), Toml::Table(new)) => {
                let is_filled = old.is_empty() && !new.is_empty();
                self.place(before, (!is_filled).then_some(now));
                match is_filled {
                    true if recorded => Ok(()),
                    true => differs(),
                    false => self.members(old, new, recorded, name),
                }
            }
            (Toml::Array(old), Toml::Array(new)) if old.len() == new.len() => {
                self.place(before, Some(now));
                old.iter().zip(new).try_for_each(|(old, new)| self.compare(old, new, recorded, name))
            }
            (old, new) if recorded || old == new => {
                self.place(before, Some(now));
                Ok(())
            }
            _ => differs(),
        }
    }

    fn members(
        &mut self,
        before: &[TomlMember],
        now: &[TomlMember],
        recorded: bool,
        name: &str,
    ) -> Result<(), String> {
        if before.len() != now.len() {
            return Err(format!("the keys of `{name}` changed"));
        }
        for member in before {
            let key = &member.key;
            let name = if name.is_empty() { key.to_string() } else { format!("{name}.{key}") };
            let Some(other) = now.iter().find(|other| other.key == *key) else {
                return Err(format!("`{name}` was removed"));
            };
            let by_hand = WRITTEN_BY_HAND.contains(&&**key);
            self.compare(&member.node, &other.node, (recorded || &**key == EXPECT) && !by_hand, &name)?;
        }
        Ok(())
    }

    /// A table and the first below it may stand in the same bytes: what they come to must be the
    /// same bytes, too.
    fn place(&mut self, before: &TomlNode, now: Option<&TomlNode>) {
        let now = now.map(TomlNode::range);
        let known =
            self.places.entry((before.range().start, before.range().end)).or_insert_with(|| now.clone());
        if *known != now {
            *known = None;
        }
    }
}
