//! What this crate says of a module: whether it is valid, and whether it runs.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use anyhit::{Error, ErrorKind};

/// What we say of a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ours {
    /// It loads, and every entry point is lowered.
    Runs,
    /// A gap of ours: the message.
    Unsupported(String),
    /// It breaks a rule.
    Invalid {
        /// The message and its notes.
        text: String,
        /// Whether that names the rule.
        cited: bool,
    },
    /// A bug of ours.
    Panicked(String),
}

/// Loads a module and lowers every entry point of it.
pub fn ours(words: &[u32]) -> Ours {
    let load = || -> Result<(), Error> {
        let module = Arc::new(anyhit_engine::module::load(&bytes(words))?);
        // The worst of all entry points: a broken rule before a gap.
        let errors = module
            .entry_points
            .iter()
            .filter_map(|entry| anyhit_engine::program::lower(&module, entry).err());
        errors.min_by_key(|error| error.kind() != ErrorKind::InvalidModule).map_or(Ok(()), Err)
    };
    match catch_unwind(AssertUnwindSafe(load)) {
        Ok(Ok(())) => Ours::Runs,
        Ok(Err(error)) if error.kind() == ErrorKind::InvalidModule => {
            let mut text = error.message().to_owned();
            for note in error.notes() {
                text += "; ";
                text += note;
            }
            Ours::Invalid { cited: cites(&text), text }
        }
        Ok(Err(error)) => Ours::Unsupported(error.message().to_owned()),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            Ours::Panicked(
                text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic").to_owned(),
            )
        }
    }
}

/// Whether a text names a rule: a VUID, a section of a specification (Vulkan's by its title), an
/// extension.
pub fn cites(text: &str) -> bool {
    let section = |text: &str| text.trim_start().starts_with(|first: char| first.is_ascii_digit());
    text.contains("VUID-")
        || text.contains("SPV_")
        || text.contains("NonSemantic.")
        || text.contains("Vulkan, Offset and Stride Assignment")
        || text.split("SPIR-V, ").skip(1).any(section)
        || text.split("SPIR-V ").skip(1).any(section)
        || text.split("GLSL.std.450, ").count() > 1
}

/// The bytes of a module's words.
fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}
