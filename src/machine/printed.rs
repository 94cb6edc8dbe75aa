//! The output of shaders (`NonSemantic.DebugPrintf`), collected while they run.

use std::sync::{Mutex, PoisonError};

/// A text that an invocation printed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PrintedLine {
    /// `LaunchIdKHR` of the invocation.
    pub launch_id: [u32; 3],
    /// The text, as the shader's format makes it.
    pub text: String,
}

/// Collects texts from all threads.
#[derive(Debug, Default)]
pub struct Printed {
    lines: Mutex<Vec<PrintedLine>>,
}

impl Printed {
    /// Adds a text.
    pub fn push(&self, launch_id: [u32; 3], text: String) {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner).push(PrintedLine { launch_id, text });
    }

    /// Takes all texts so far, in launch order; those of one invocation in the order of printing.
    pub fn take(&self) -> Vec<PrintedLine> {
        let mut lines = std::mem::take(&mut *self.lines.lock().unwrap_or_else(PoisonError::into_inner));
        lines.sort_by_key(|line| [line.launch_id[2], line.launch_id[1], line.launch_id[0]]);
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_come_in_launch_order() {
        let printed = Printed::default();
        for (id, text) in [([1, 0, 0], "b"), ([0, 1, 0], "d"), ([0, 0, 0], "a"), ([1, 0, 0], "c")] {
            printed.push(id, text.to_owned());
        }
        assert_eq!(printed.take().iter().map(|line| line.text.as_str()).collect::<String>(), "abcd");
        assert!(printed.take().is_empty());
    }
}
