//! `launch` and `restart`: a scene is loaded, and one of its invocations or rays is prepared.

use serde_json::{Value, json};

use crate::console::Console;
use crate::debugger::Debugger;
use crate::session::Session;
use anyhit_base::error::Result;
use anyhit_base::escape;

use super::data_breakpoints::DataBreakpoints;
use super::launch_arguments::{LaunchArguments, check_keys};
use super::protocol::{Answer, Refusal, Request};
use super::sources::Sources;
use super::stopped::StoppedState;
use super::{Adapter, Launched, Motion, State, THREAD};

impl Adapter {
    /// Loads a scene, tells the client that breakpoints can be set, and answers.
    pub(super) fn launch(&mut self, request: &Request) {
        let is_new = matches!(self.state, State::Idle);
        let answer = match is_new {
            true => launch_arguments(request).and_then(|arguments| self.load(arguments)),
            false => Err(Refusal::new("the session has already launched; use `restart` to start again")),
        };
        let is_loaded = answer.is_ok();
        self.outbox.respond(request.seq, &request.command, answer);
        if is_loaded {
            self.state = State::Configuring;
            self.announce_breakpoints();
            self.outbox.event("initialized", Value::Null);
        } else if is_new {
            // Nothing will come of this session.
            self.outbox.event("terminated", Value::Null);
        }
    }

    /// Loads the scene anew, as its files may have changed, and begins.
    pub(super) fn restart(&mut self, request: &Request) {
        let answer = self.loaded_anew(request);
        let is_loaded = answer.is_ok();
        self.outbox.respond(request.seq, &request.command, answer);
        if is_loaded {
            self.announce_breakpoints();
            self.start();
        }
    }

    fn loaded_anew(&mut self, request: &Request) -> Answer {
        let given = request.arguments.get("arguments").filter(|given| given.is_object());
        let arguments = match (given, self.arguments.clone()) {
            (Some(given), _) => launch_arguments(&Request { arguments: given.clone(), ..request.clone() })?,
            (None, Some(arguments)) => arguments,
            (None, None) => return Err(Refusal::new("nothing has been launched")),
        };
        self.load(arguments)
    }

    fn load(&mut self, arguments: LaunchArguments) -> Answer {
        self.launched = Some(self.loaded(&arguments)?);
        // They are of buffers of the run before.
        self.data_breakpoints = DataBreakpoints::default();
        self.arguments = Some(arguments);
        Ok(Value::Null)
    }

    fn loaded(&mut self, arguments: &LaunchArguments) -> Result<Launched> {
        let (request, name) = arguments.request()?;
        let path = arguments.scene()?;
        let scene = self.host.scene(path, &arguments.options()?)?;
        let mut notes = scene.notes.clone();
        let session = Session::new(scene)?;
        notes.extend(session.assembled().notes.iter().cloned());
        let mut debugger = Debugger::of_scene(&session, &request)?;
        debugger.interrupted_by(self.flags.message.clone());
        debugger.given_up_by(self.flags.stop.clone());
        let sources = Sources::new(&debugger, &*self.host, path);
        for note in notes {
            let output = format!("note: {}\n", escape::line(&note));
            self.outbox.event("output", json!({ "category": "console", "output": output }));
        }
        Ok(Launched {
            console: Console::embedded(debugger),
            console_breakpoints: Vec::new(),
            sources,
            name,
            stopped: StoppedState::default(),
            sent_output: 0,
            trap: None,
            exception: None,
            session,
            request,
            findings: None,
        })
    }

    /// `configurationDone`: whether the invocation can begin.
    pub(super) fn configuration_done(&mut self) -> Answer {
        match self.state {
            State::Configuring => Ok(Value::Null),
            _ => Err(Refusal::new("no launch is waiting for its configuration")),
        }
    }

    /// Begins: at the first line, or on the way to a breakpoint.
    pub(super) fn start(&mut self) {
        let stops = self.arguments.as_ref().is_some_and(|arguments| arguments.stop_on_entry);
        self.outbox.event("thread", json!({ "reason": "started", "threadId": THREAD }));
        self.apply_breakpoints();
        if let Err(why) = self.apply_findings() {
            let output = format!("the sanitizer does not check this run: {why}\n");
            self.outbox.event("output", json!({ "category": "important", "output": output }));
        }
        self.state = State::Running(if stops { Motion::Begin } else { Motion::Resume });
    }
}

/// The launch configuration that a request brings.
fn launch_arguments(request: &Request) -> Result<LaunchArguments, Refusal> {
    check_keys(&request.arguments)?;
    request.arguments()
}
