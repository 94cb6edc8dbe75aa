//! The hash of a source with all that it includes.

use std::borrow::Cow;
use std::sync::Arc;

use hmac_sha256::Hash as Sha256;

use super::{Source, has_computed_include};
use anyhit_base::sorted::SortedMap;

impl Source {
    /// SHA-256, in hexadecimal, of the text and of all the files that it includes.
    ///
    /// A module is a function of this hash, the compiler's name and version, and the flags. Line
    /// ends do not count, so that a checkout with CR LF hashes alike.
    #[must_use]
    pub fn content_hash(&self) -> String {
        hash(&self.closure(), |text| text.replace("\r\n", "\n").into())
    }

    /// SHA-256, in hexadecimal, of the text and of all the files that it includes, byte for byte;
    /// `None` where a text includes a file that only a preprocessor can name.
    pub(crate) fn exact_hash(&self) -> Option<String> {
        let closure = self.closure();
        let is_known = !closure.values().any(|text| has_computed_include(text));
        is_known.then(|| hash(&closure, |text| text.into()))
    }
}

fn hash(closure: &SortedMap<String, Arc<str>>, text_of: impl Fn(&str) -> Cow<'_, str>) -> String {
    let mut hasher = Sha256::new();
    for (name, text) in closure {
        let text = text_of(text);
        // Lengths are hashed, too: otherwise text that moves between files would not change the
        // hash.
        for part in [name.as_bytes(), text.as_bytes()] {
            hasher.update((part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
    }
    hex(&hasher.finalize())
}

/// SHA-256 of bytes, in hexadecimal.
pub fn bytes_hash(bytes: &[u8]) -> String {
    hex(&Sha256::hash(bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_sees_includes_and_names_but_not_line_ends() {
        let folder = std::env::temp_dir().join(format!("anyhit-source-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        let hash = || Source::read_in(&folder, "a.rmiss").unwrap().content_hash();
        write("a.rmiss", "#include \"sub/b.glsl\"\nvoid main() {}\n");
        write("sub/b.glsl", "#include \"../c.glsl\"\n");
        write("c.glsl", "#include \"sub/b.glsl\"\nconst int x = 1;\n");
        let first = hash();
        write("c.glsl", "#include \"sub/b.glsl\"\r\nconst int x = 1;\r\n");
        assert_eq!(hash(), first, "line ends count");
        let exact = || Source::read_in(&folder, "a.rmiss").unwrap().exact_hash();
        let with_carriage_returns = exact();
        write("c.glsl", "#include \"sub/b.glsl\"\nconst int x = 1;\n");
        assert_ne!(exact(), with_carriage_returns);
        write("c.glsl", "#include \"sub/b.glsl\"\nconst int x = 2;\n");
        assert_ne!(hash(), first, "an include of an include does not count");
        write("c.glsl", "#define FILE \"d.glsl\"\n#include FILE\n");
        assert_eq!(exact(), None, "only a preprocessor knows that file");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn the_hash_of_the_empty_message_is_that_of_the_standard() {
        // FIPS 180-4's example value for the empty message.
        let expected = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
        assert_eq!(bytes_hash(b""), expected);
    }
}
