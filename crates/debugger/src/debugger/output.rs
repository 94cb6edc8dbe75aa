//! What shaders and breakpoints print.

use anyhit_base::sorted::sort_by_key;
use anyhit_engine::machine::printed::PrintedLine;

use super::Debugger;
use super::course::Time;
use super::source_map::SourcePosition;
use super::tracker::Print;

/// A text that a shader or a breakpoint has printed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DebugOutput {
    /// The step behind it.
    pub time: Time,
    /// The text.
    pub text: String,
    /// The line that printed it, where that is known.
    pub position: Option<SourcePosition>,
}

impl Debugger {
    /// What shaders have printed before the step that is next.
    pub fn output(&self) -> impl Iterator<Item = &str> {
        let now = self.course.time;
        self.output.iter().filter(move |one| one.time <= now).map(|one| one.text.as_str())
    }

    /// All that shaders and breakpoints have printed, in the order in which they have: after going
    /// back, also what comes later.
    pub fn all_output(&self) -> &[DebugOutput] {
        &self.output
    }

    /// Adds a text to the output.
    pub(super) fn print(&mut self, text: String) {
        let position = self.stack().first().and_then(|frame| frame.position);
        self.output.push(DebugOutput { time: self.course.time, text, position });
    }

    /// Adds what invocations have printed, by launch index, with where they have.
    pub(super) fn add_printed(&mut self, printed: Vec<PrintedLine>, mut prints: Vec<Print>, last: Time) {
        let place = |[x, y, z]: [u32; 3]| [z, y, x];
        sort_by_key(&mut prints, |print| place(print.launch_id));
        let mut prints = prints.into_iter().peekable();
        for PrintedLine { launch_id, text, .. } in printed {
            // Of an invocation that prints too much, not all is kept.
            while prints.next_if(|print| place(print.launch_id) < place(launch_id)).is_some() {}
            let print = prints.next_if(|print| print.launch_id == launch_id);
            let time = print.map_or(last, |print| print.time.min(last));
            self.output.push(DebugOutput { time, text, position: print.and_then(|print| print.position) });
        }
    }
}
