//! How an invocation runs and stops, and what the client is told of it.

use emmy_dap_types::requests::NextArguments;
use emmy_dap_types::types::SteppingGranularity;
use serde_json::{Value, json};

use crate::console::traversal_events;
use crate::debugger::{SourcePosition, Stepping, StopReason};
use anyhit_base::error::Error;
use anyhit_base::escape;

use super::exceptions::Exception;
use super::initialize::Client;
use super::protocol::{Answer, Request, body};
use super::{Adapter, Launched, Motion, State, THREAD};

impl Adapter {
    /// Makes the invocation run on, until it stops or is interrupted.
    pub fn run(&mut self) -> Vec<Value> {
        if let (State::Running(motion), Some(launched)) = (self.state, &mut self.launched) {
            let trap = launched.trap.take().filter(|_| motion == Motion::Trap);
            let debugger = &mut launched.console.debugger;
            let stop = match motion {
                Motion::Begin => debugger.begin(),
                Motion::Resume => debugger.resume(),
                Motion::ResumeBack => debugger.resume_back(),
                Motion::Step(step) => debugger.step(step),
                Motion::StepBack(step) => debugger.step_back(step),
                Motion::Proceed => debugger.proceed(),
                Motion::Trap => StopReason::End,
            };
            match trap {
                Some(error) => self.end(Some(&error)),
                // It begins anew, unless the message that has come ends it.
                None if is_given_up(motion, &stop) => {}
                None => self.stop(stop),
            }
        }
        self.outbox.take()
    }

    /// Sets off, where it is stopped.
    pub(super) fn move_on(&mut self, motion: Motion) -> Answer {
        let launched = self.stopped()?;
        let goes_back = matches!(motion, Motion::ResumeBack | Motion::StepBack(_));
        launched.exception = None;
        launched.stopped.renew(Vec::new());
        // What traps can only be left backwards.
        let motion = if launched.trap.is_some() && !goes_back { Motion::Trap } else { motion };
        self.state = State::Running(motion);
        Ok(Value::Null)
    }

    /// A request to step.
    pub(super) fn step(
        &mut self,
        request: &Request,
        step: Stepping,
        motion: impl FnOnce(Stepping) -> Motion,
    ) -> Answer {
        // All requests to step have these arguments.
        let arguments: NextArguments = request.arguments()?;
        self.check_steps(arguments.thread_id)?;
        let step = match (arguments.granularity, step) {
            (Some(SteppingGranularity::Instruction), Stepping::Over) => Stepping::OverInstruction,
            (Some(SteppingGranularity::Instruction), Stepping::Into) => Stepping::IntoInstruction,
            (_, step) => step,
        };
        self.move_on(motion(step))
    }

    /// Stops where it is, as the client asked.
    pub(super) fn paused(&mut self) {
        // It may not have made a step yet.
        if let Some(launched) = &mut self.launched
            && launched.console.debugger.stack().is_empty()
        {
            launched.console.debugger.begin();
        }
        self.stopped_because(json!({ "reason": "pause" }));
    }

    pub(super) fn stop(&mut self, stop: StopReason) {
        self.send_output();
        let no_debug = self.arguments.as_ref().is_some_and(|arguments| arguments.no_debug);
        let stops_at_traps = !no_debug && self.filters.traps;
        match stop {
            StopReason::Interrupted => self.state = State::Running(Motion::Proceed),
            StopReason::End => self.end(None),
            StopReason::Trap(error) if !stops_at_traps => self.end(Some(&error)),
            StopReason::Trap(error) => {
                let exception = Exception::trap(&error);
                if let Some(launched) = &mut self.launched {
                    launched.trap = Some(error);
                }
                self.stopped_at_exception(exception);
            }
            StopReason::Nan => self.stopped_at_exception(Exception::nan()),
            StopReason::Findings(findings) => self.stopped_at_exception(Exception::findings(&findings)),
            StopReason::Entry => self.stopped_because(json!({ "reason": "entry" })),
            StopReason::Step => self.stopped_because(json!({ "reason": "step" })),
            StopReason::Traversal(None) => {
                let description = "Paused in a traversal";
                self.stopped_because(json!({ "reason": "step", "description": description }));
            }
            StopReason::Traversal(Some(id)) => {
                self.stopped_because(json!({ "reason": "breakpoint", "hitBreakpointIds": [id.0] }));
            }
            StopReason::Beginning => {
                self.leave_nowhere();
                let description = "Paused at the start";
                self.stopped_because(json!({ "reason": "entry", "description": description }));
            }
            StopReason::Breakpoints(ids) => {
                let reason = ids.first().map_or("breakpoint", |id| self.breakpoints.reason(*id));
                let ids: Vec<u32> = ids.iter().map(|id| id.0).collect();
                self.stopped_because(json!({ "reason": reason, "hitBreakpointIds": ids }));
            }
            StopReason::Wrote(write) => {
                let (ids, text) = self.written(&write);
                self.stopped_because(json!({
                    "reason": "data breakpoint",
                    "hitBreakpointIds": ids,
                    "text": text,
                }));
            }
        }
    }

    /// The first step of all may be of no line: the first line is shown instead.
    fn leave_nowhere(&mut self) {
        if let Some(launched) = &mut self.launched
            && launched.console.debugger.stack().first().is_some_and(|frame| frame.position.is_none())
        {
            launched.console.debugger.begin();
        }
    }

    fn stopped_at_exception(&mut self, exception: Exception) {
        let event = json!({
            "reason": "exception",
            "description": exception.description,
            "text": exception.text,
        });
        if let Some(launched) = &mut self.launched {
            launched.exception = Some(exception);
        }
        self.stopped_because(event);
    }

    /// Tells the client that the invocation has stopped.
    pub(super) fn stopped_because(&mut self, mut event: Value) {
        self.state = State::Stopped;
        self.renew_stack();
        event["threadId"] = THREAD.into();
        event["allThreadsStopped"] = true.into();
        self.outbox.event("stopped", event);
    }

    /// Sends what shaders and breakpoints have printed since.
    fn send_output(&mut self) {
        let Some(launched) = &mut self.launched else { return };
        let all = launched.console.debugger.all_output();
        for printed in &all[launched.sent_output.min(all.len())..] {
            // Clients show sequences of colours, and others, as a terminal does.
            let text = escape::printed(&printed.text, false);
            let end = if text.ends_with('\n') { "" } else { "\n" };
            let mut event = json!({ "category": "stdout", "output": format!("{text}{end}") });
            launched.add_position(&mut event, printed.position, self.client);
            self.outbox.event("output", event);
        }
        launched.sent_output = all.len();
    }

    /// Ends what runs, as the client asked.
    pub(super) fn terminate(&mut self) {
        if self.launched.is_some() && self.state != State::Terminated {
            self.state = State::Terminated;
            self.outbox.event("terminated", Value::Null);
        }
    }

    /// Everything has run, or a shader has trapped.
    fn end(&mut self, trap: Option<&Error>) {
        if let Some(error) = trap {
            let mut event = json!({ "category": "stderr", "output": error.render() });
            if let Some(launched) = &self.launched {
                let frame = launched.console.debugger.stack().into_iter().next();
                launched.add_position(&mut event, frame.and_then(|frame| frame.position), self.client);
            }
            self.outbox.event("output", event);
        }
        let code = trap.map_or(0, |error| error.class().exit_code());
        self.state = State::Terminated;
        self.outbox.event("thread", json!({ "reason": "exited", "threadId": THREAD }));
        self.outbox.event("exited", json!({ "exitCode": code }));
        self.outbox.event("terminated", Value::Null);
    }

    /// What the traversal of a ray did between the step before and the one that is next, in words.
    pub(super) fn traversal(&mut self) -> Answer {
        let launched = self.stopped()?;
        Ok(json!({ "events": traversal_events::told(launched.console.debugger.events()) }))
    }
}

impl Launched {
    /// Adds the source and the line that printed it to an event.
    fn add_position(&self, event: &mut Value, position: Option<SourcePosition>, client: Client) {
        if let Some(position) = position {
            event["source"] = body(self.sources.source(position.file)).unwrap_or_default();
            event["line"] = client.line(self.sources.shown_line(position)).into();
        }
    }
}

/// Whether a run backwards was given up: it cannot go on where it was.
fn is_given_up(motion: Motion, stop: &StopReason) -> bool {
    let goes_back = matches!(motion, Motion::ResumeBack | Motion::StepBack(_));
    goes_back && matches!(stop, StopReason::Interrupted)
}
