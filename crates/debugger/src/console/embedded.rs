//! A console beside an editor, which steps and shows output by itself.

use crate::debugger::{Debugger, StopReason};

use super::Console;
use super::command::COMMANDS;
use super::listing::Listing;

/// What a command did beside its answer.
#[derive(Clone, Debug, Default)]
pub struct CommandEffect {
    /// Why the debugger stopped where it is now, if it moved.
    pub stop: Option<StopReason>,
    /// Whether a value was set.
    pub edited: bool,
}

impl Console {
    /// A console that does not begin the session, and repeats nothing that shaders print.
    pub fn embedded(debugger: Debugger) -> Self {
        Self { is_embedded: true, ..Self::unbegun(debugger, Listing::new(false)) }
    }

    /// Whether a word is the name of a command, or another spelling of it.
    pub fn is_command(word: &str) -> bool {
        COMMANDS.iter().any(|command| command.names.contains(&word))
    }

    /// Looks at a frame, counted from the innermost.
    pub fn look_at(&mut self, frame: usize) {
        self.frame = frame;
    }

    /// Whether the last command was interrupted.
    pub fn was_interrupted(&self) -> bool {
        matches!(self.effect.stop, Some(StopReason::Interrupted))
    }

    /// What the commands since did beside their answers.
    pub fn take_effect(&mut self) -> CommandEffect {
        std::mem::take(&mut self.effect)
    }
}
