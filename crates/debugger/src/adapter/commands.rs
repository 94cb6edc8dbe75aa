//! The debug console of a client: beside expressions it takes the commands of
//! `trace-one-ray --interactive`.

use emmy_dap_types::requests::{CompletionsArguments, EvaluateArguments};
use emmy_dap_types::responses::{CompletionsResponse, EvaluateResponse};
use emmy_dap_types::types::{CompletionItem, CompletionItemType, EvaluateArgumentsContext};
use serde_json::{Value, json};

use crate::console::{Console, Reply};
use crate::debugger::{BreakpointId, StopReason};

use super::protocol::{Answer, Refusal, Request, body};
use super::{Adapter, Launched, State};

/// What makes any line a command, also one that is an expression.
const COMMAND_MARK: char = ':';

impl Adapter {
    /// Answers `evaluate`: in the console, what is no expression here may be a command.
    pub(super) fn evaluate_or_execute(&mut self, request: &Request) {
        let value = self.evaluate(request);
        let (answer, quits) = match self.command_line(request, &value) {
            Some((line, frame)) => self.execute(&line, frame),
            None => (value, false),
        };
        let is_cancelled = answer.is_err();
        self.outbox.respond(request.seq, &request.command, answer);
        if quits {
            return self.terminate();
        }
        let Ok(launched) = self.launched() else { return };
        let effect = launched.console.take_effect();
        if effect.stop.is_some() || effect.edited {
            (launched.trap, launched.exception) = (None, None);
            launched.forget_output();
        }
        match effect.stop {
            // A run that is not over goes on with the next request to move.
            Some(StopReason::Interrupted) if is_cancelled => {
                self.stopped_because(json!({ "reason": "pause" }))
            }
            Some(stop) => self.stop(stop),
            None if effect.edited => self.tell_of_edit(),
            None => {}
        }
    }

    /// The command that a client means, and the frame that it is about.
    fn command_line(&self, request: &Request, value: &Answer) -> Option<(String, Option<i64>)> {
        let arguments: EvaluateArguments = request.arguments().ok()?;
        let is_console = matches!(arguments.context, Some(EvaluateArgumentsContext::Repl));
        if !is_console || self.state != State::Stopped {
            return None;
        }
        let text = arguments.expression.trim();
        let marked = text.strip_prefix(COMMAND_MARK);
        let first = text.split_whitespace().next().unwrap_or_default();
        let line = match marked {
            Some(line) => line.trim(),
            None if value.is_err() && Console::is_command(first) => text,
            None => return None,
        };
        Some((line.to_owned(), arguments.frame_id))
    }

    /// Executes a command; returns the answer, and whether the session is over.
    fn execute(&mut self, line: &str, frame: Option<i64>) -> (Answer, bool) {
        let last = self.breakpoints.last();
        let flags = self.flags.clone();
        let executed = self.stopped().map_err(|refusal| refusal.message).and_then(|launched| {
            launched.look_at(frame)?;
            let before = launched.breakpoint_ids();
            launched.console.debugger.number_breakpoints_after(last);
            // Only what ends it interrupts it: it is one request.
            launched.console.debugger.interrupted_by(flags.stop);
            let reply = launched.console.execute(line);
            launched.console.debugger.interrupted_by(flags.message);
            let own = (last.0 + 1..=launched.console.debugger.last_breakpoint_id().0).map(BreakpointId);
            launched.console_breakpoints.extend(own);
            Ok((reply, before))
        });
        let (Reply { text, quits, failed }, before) = match executed {
            Ok(executed) => executed,
            Err(why) => return (Err(Refusal::new(why)), false),
        };
        self.keep_breakpoints_of_console(&before);
        let text = text.trim_end().to_owned();
        let is_interrupted =
            self.launched.as_ref().is_some_and(|launched| launched.console.was_interrupted());
        let answer = match (is_interrupted, failed) {
            (true, _) => Err(Refusal::new("cancelled")),
            (_, true) => Err(Refusal::new(text)),
            _ => body(EvaluateResponse { result: text, ..EvaluateResponse::default() }),
        };
        (answer, quits)
    }

    /// After a command: numbers that it has given are taken, and breakpoints that it has deleted
    /// are the client's no longer.
    fn keep_breakpoints_of_console(&mut self, before: &[BreakpointId]) {
        let Some(launched) = &self.launched else { return };
        let last = launched.console.debugger.last_breakpoint_id();
        let left = launched.breakpoint_ids();
        self.breakpoints.number_after(last);
        for &id in before.iter().filter(|id| !left.contains(id)) {
            if self.breakpoints.remove(id) | self.data_breakpoints.remove(id) {
                let breakpoint = json!({ "id": id.0, "verified": false });
                self.outbox.event("breakpoint", json!({ "reason": "removed", "breakpoint": breakpoint }));
            }
        }
    }

    /// Cancels the run that a request began, if it still goes on.
    pub(super) fn cancel(&mut self, request: &Request) {
        let cancelled = request.arguments.get("requestId").and_then(Value::as_i64);
        let is_meant = self.is_running() && cancelled == Some(self.motion_request);
        self.outbox.respond(request.seq, &request.command, Ok(Value::Null));
        if is_meant {
            self.paused();
        }
    }

    pub(super) fn completions(&mut self, request: &Request) -> Answer {
        let arguments: CompletionsArguments = request.arguments()?;
        let client = self.client;
        let launched = self.stopped()?;
        launched.look_at(arguments.frame_id)?;
        let number = arguments.line.map_or(1, |line| client.line_from(line));
        let line = arguments.text.split('\n').nth(number as usize - 1).unwrap_or_default();
        let line = &line[..byte_of(line, client.column_from(arguments.column))];
        let begin = line.len() - line.strip_prefix(COMMAND_MARK).unwrap_or(line).len();
        let (start, words) = match begin {
            0 => launched.console.complete_expression(line),
            _ => launched.console.complete(&line[begin..]),
        };
        let start = begin + start;
        let first = line[..start].encode_utf16().count() as u32 + 1;
        let length = line[start..].encode_utf16().count() as i64;
        let item = |label: String| CompletionItem {
            type_field: Some(match Console::is_command(&label) && line[begin..start].trim().is_empty() {
                true => CompletionItemType::Keyword,
                false => CompletionItemType::Variable,
            }),
            label,
            start: Some(client.column(first)),
            length: Some(length),
            ..CompletionItem::default()
        };
        body(CompletionsResponse { targets: words.into_iter().map(item).collect() })
    }
}

impl Launched {
    /// Has the console look at a frame, by its number, or at the innermost one.
    fn look_at(&mut self, frame: Option<i64>) -> Result<(), String> {
        let frame = self.frame(frame)?;
        let at = self.console.debugger.stack().iter().position(|one| *one == frame);
        self.console.look_at(at.ok_or("commands apply only to the followed invocation")?);
        Ok(())
    }

    /// The numbers of all breakpoints and data breakpoints.
    fn breakpoint_ids(&self) -> Vec<BreakpointId> {
        let debugger = &self.console.debugger;
        let breakpoints = debugger.breakpoints().iter().map(|one| one.id);
        let watches = debugger.watches().iter().filter_map(|watch| watch.breakpoint);
        breakpoints.chain(watches).collect()
    }

    /// After something was set by hand: what was printed behind it is no longer there.
    pub(super) fn forget_output(&mut self) {
        self.sent_output = self.sent_output.min(self.console.debugger.all_output().len());
    }
}

/// The byte at which a column begins, from 1, in UTF-16 code units.
fn byte_of(line: &str, column: u32) -> usize {
    let mut units = 1;
    for (at, character) in line.char_indices() {
        if units >= column {
            return at;
        }
        units += character.len_utf16() as u32;
    }
    line.len()
}

#[cfg(test)]
mod tests {
    use super::byte_of;

    #[test]
    fn columns_are_utf_16() {
        // `é` is 2 bytes and 1 unit, the clef 4 bytes and 2 units.
        let line = "aé𝄞b";
        assert_eq!([1, 2, 3, 5, 6, 99].map(|column| byte_of(line, column)), [0, 1, 3, 7, 8, 8]);
    }
}
