//! Committed lists of messages, each with the reason why it may be.

use serde::Deserialize;

/// One of a list: the messages that it means, and why they may be.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// The message; `*` stands for any text.
    pub message: String,
    /// The rule that is cited, or why it does no harm to run the module.
    pub because: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    entry: Vec<Entry>,
}

/// Reads a list.
pub fn read(text: &str) -> Vec<Entry> {
    let List { entry } = toml::from_str(text).expect("a list of entries with `message` and `because`");
    entry
}

impl Entry {
    /// Whether a text is one of its messages.
    pub fn means(&self, text: &str) -> bool {
        let mut parts = self.message.split('*');
        let first = parts.next().unwrap_or("");
        let Some(mut rest) = text.strip_prefix(first) else { return false };
        let parts: Vec<&str> = parts.collect();
        let Some((last, middle)) = parts.split_last() else { return rest.is_empty() };
        for part in middle {
            match rest.find(part) {
                Some(at) => rest = &rest[at + part.len()..],
                None => return false,
            }
        }
        rest.len() >= last.len() && rest.ends_with(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_any_text() {
        let entry = |message: &str| Entry { message: message.into(), because: String::new() };
        assert!(entry("a*c").means("abc") && entry("a*c").means("ac") && !entry("a*c").means("acd"));
        assert!(entry("abc").means("abc") && !entry("abc").means("abcd") && !entry("b*").means("abc"));
        assert!(entry("*b*").means("abc") && entry("a*b*").means("a-b-") && !entry("a*b*b").means("ab"));
    }
}
