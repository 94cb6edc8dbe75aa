//! The table `[sanitize]` of a scene: the levels of the sanitizer's rules.

use crate::read::{Diagnostics, Document, OneOrMore, Spanned, Table};
use anyhit_base::error::Result;
use anyhit_sanitize::{Level, Levels};

/// Reads `[sanitize]`; without it every rule has its default.
///
/// # Errors
/// All mistakes of the table as one error.
pub fn scene_levels(document: &Document) -> Result<Levels> {
    let report = Diagnostics::default();
    let mut levels = Levels::default();
    let root = document.root(&report);
    if let Some(table) = root.value("sanitize").and_then(Table::new) {
        for (key, level) in [("allow", Level::Allow), ("warn", Level::Warn), ("deny", Level::Deny)] {
            let rules: Option<OneOrMore<Spanned<String>>> = table.optional(key);
            for rule in rules.into_iter().flat_map(|rules| rules.0) {
                if let Err(error) = levels.set(&rule.value, level) {
                    let mistake = rule.span.error(error.message());
                    report.push(error.notes().iter().cloned().fold(mistake, |all, note| all.note(note)));
                }
            }
        }
    }
    drop(root);
    report.finish()?;
    Ok(levels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(text: &str) -> Result<Levels> {
        let report = Diagnostics::default();
        scene_levels(&Document::parse_within("scene.toml", text, report.limits()).expect("TOML"))
    }

    #[test]
    fn a_scene_sets_the_levels_of_rules() {
        let read =
            levels("version = 1\n[sanitize]\nallow = 'pow-domain'\ndeny = ['nan-output']\n").expect("levels");
        let mut expected = Levels::default();
        expected.set("pow-domain", Level::Allow).expect("a rule");
        expected.set("nan-output", Level::Deny).expect("a rule");
        assert_eq!(read, expected);
    }

    #[test]
    fn an_unknown_rule_is_told_at_its_place() {
        let error = levels("version = 1\n[sanitize]\nallow = ['pow-domian']\n").expect_err("no such rule");
        assert!(
            error.to_string().starts_with("the sanitizer has no rule `pow-domian` (at scene.toml:3)"),
            "{error}"
        );
        assert!(error.render().contains("pow-domain"));
    }
}
