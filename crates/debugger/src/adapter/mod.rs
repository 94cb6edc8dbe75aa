//! A debug adapter: it answers the requests of an editor (Debug Adapter Protocol) with the debugger
//! of one invocation or ray.
//!
//! An [`Adapter`] is a state machine. A message goes in, messages come out, and while the
//! invocation runs, [`Adapter::run`] makes it go on until it stops or another thread interrupts it.
//! Files are read by its [`Host`] alone.

mod breakpoints;
mod clipboard;
mod commands;
mod data_breakpoints;
mod disassembly;
mod exceptions;
mod frames;
mod initialize;
mod launch;
mod launch_arguments;
mod memory;
mod protocol;
mod running;
pub mod server;
mod sources;
mod stopped;
mod threads;
mod values;

use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::{Value, json};

use crate::console::Console;
use crate::debugger::{BreakpointId, FindingFilter, Stepping};
use crate::session::{ExplainRequest, Session};
use anyhit_base::error::Error;
use anyhit_scene::{LoadOptions, ResolvedScene};

use breakpoints::RequestedBreakpoints;
use data_breakpoints::DataBreakpoints;
use exceptions::{Exception, ExceptionFilters};
use initialize::Client;
use launch_arguments::LaunchArguments;
use protocol::{Answer, Outbox, Refusal, Request};
use sources::Sources;
use stopped::StoppedState;

/// The number of the thread that is the invocation that is debugged.
const THREAD: i64 = 1;

/// Requests of the protocol that make no sense here, and what does instead. Clients ask for those
/// behind the first only where a capability says so.
const REFUSED: &[(&str, &str)] = &[
    ("attach", "attaching is not supported: `launch` a scene with a pixel, a ray or an invocation"),
    ("goto", GOTO),
    ("gotoTargets", GOTO),
    (
        "restartFrame",
        "a frame cannot be restarted: go back to its call with `stepBack`, or `rfinish` in the console",
    ),
    ("stepInTargets", "`stepIn` enters the first call of a line; set a breakpoint to stop in another one"),
    ("terminateThreads", "lanes of a subgroup run together: `terminate` ends all"),
    ("writeMemory", "memory is written by variable name: use `setVariable` or `setExpression`"),
];

/// Why nothing can be jumped to.
const GOTO: &str = "a jump would skip instructions whose results are needed later: \
                    use `reverseContinue` to go back to a step, and `setVariable` to change a value";

/// Where an adapter finds files.
pub trait Host {
    /// Reads a scene with everything that it names.
    ///
    /// # Errors
    /// All mistakes of the scene and its files.
    fn scene(&self, path: &Path, options: &LoadOptions) -> Result<ResolvedScene, Error>;

    /// The text of a source file; `None` where there is none that can be read.
    fn text(&self, path: &Path) -> Option<String>;

    /// A path from the root of the file system.
    fn absolute(&self, path: &Path) -> PathBuf;
}

/// What an invocation does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    /// Runs to its first line.
    Begin,
    Resume,
    ResumeBack,
    Step(Stepping),
    StepBack(Stepping),
    /// Goes on with what was interrupted.
    Proceed,
    /// Makes the step that traps, which ends it.
    Trap,
}

/// How far a session has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Nothing is launched yet, or everything has ended.
    Idle,
    /// The client sets breakpoints.
    Configuring,
    Stopped,
    Running(Motion),
    /// Everything has ended; the client has been told.
    Terminated,
}

/// What was launched.
struct Launched {
    /// The debugger, with the commands of a console.
    console: Console,
    /// Breakpoints that commands have set.
    console_breakpoints: Vec<BreakpointId>,
    sources: Sources,
    /// The invocation or ray in words.
    name: String,
    stopped: StoppedState,
    /// How many lines of output were sent.
    sent_output: usize,
    /// The error of the step that is next, which traps.
    trap: Option<Error>,
    /// Why it stopped, where that is an exception.
    exception: Option<Exception>,
    /// What was loaded, and what of it is debugged: it may be run again beside.
    session: Session,
    request: ExplainRequest,
    /// Which findings of the sanitizer stop it.
    findings: Option<FindingFilter>,
}

/// A debug adapter for one client.
pub struct Adapter {
    host: Rc<dyn Host>,
    flags: InterruptFlags,
    outbox: Outbox,
    client: Client,
    breakpoints: RequestedBreakpoints,
    data_breakpoints: DataBreakpoints,
    /// The exception filters that are on.
    filters: ExceptionFilters,
    arguments: Option<LaunchArguments>,
    launched: Option<Launched>,
    state: State,
    /// The number of the request that made it run last.
    motion_request: i64,
    is_over: bool,
}

/// What another thread raises for an adapter that runs: a message has come.
#[derive(Clone, Debug, Default)]
pub struct InterruptFlags {
    /// Any message: a run pauses for it and goes on.
    message: Arc<AtomicBool>,
    /// A message that ends a run: also one backwards, which cannot go on later, or a command.
    stop: Arc<AtomicBool>,
    /// Number of announced messages that end a run and are not handled yet; `stop` is set while
    /// there are any.
    ending: Arc<Mutex<usize>>,
}

impl InterruptFlags {
    /// Announces a message before it is sent, or with `None` the end of all messages. A message
    /// that ends a run counts from here until the adapter has handled it, so that the flag never
    /// outlives its message.
    pub fn announce(&self, message: Option<&Value>) {
        if message.is_none_or(is_ending) {
            self.count_ending(|count| count.saturating_add(1));
        }
    }

    /// Makes a run look for messages. Called after a message is sent: a flag that is raised before
    /// could be lowered before the message arrives.
    pub fn raise(&self) {
        self.message.store(true, Relaxed);
    }

    /// Changes the number of messages that end a run, and the flag with it.
    fn count_ending(&self, change: impl FnOnce(usize) -> usize) {
        let mut count = self.ending.lock().unwrap_or_else(PoisonError::into_inner);
        *count = change(*count);
        self.stop.store(*count > 0, Relaxed);
    }

    /// Forgets messages that came before: whoever calls it looks for them then.
    pub fn lower(&self) {
        self.message.store(false, Relaxed);
    }
}

/// Whether a message asks for the end of a run.
fn is_ending(message: &Value) -> bool {
    let command = message["command"].as_str();
    command
        .is_some_and(|command| ["pause", "cancel", "terminate", "disconnect", "restart"].contains(&command))
}

impl std::fmt::Debug for Adapter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Adapter").field("state", &self.state).finish_non_exhaustive()
    }
}

impl Adapter {
    /// An adapter that no client has spoken to. Another thread raises the flags where a message has
    /// come.
    pub fn new(host: Rc<dyn Host>, flags: InterruptFlags) -> Self {
        Self {
            host,
            flags,
            outbox: Outbox::default(),
            client: Client::default(),
            breakpoints: RequestedBreakpoints::default(),
            data_breakpoints: DataBreakpoints::default(),
            filters: ExceptionFilters::default(),
            arguments: None,
            launched: None,
            state: State::Idle,
            motion_request: 0,
            is_over: false,
        }
    }

    /// Whether the invocation runs, so that [`Adapter::run`] is to be called.
    pub fn is_running(&self) -> bool {
        matches!(self.state, State::Running(_))
    }

    /// Whether the session is over.
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    /// Answers a message; returns the messages for the client, in their order.
    pub fn receive(&mut self, message: Value) -> Vec<Value> {
        let ends = is_ending(&message);
        match Request::read(message) {
            Ok(request) => self.handle(&request),
            Err((seq, refusal)) => self.outbox.respond(seq, "", Err(refusal)),
        }
        if ends {
            self.flags.count_ending(|count| count.saturating_sub(1));
        }
        self.outbox.take()
    }

    /// Tells the client of bytes that are no message.
    pub fn receive_garbage(&mut self, why: &str) -> Vec<Value> {
        self.outbox.respond(0, "", Err(Refusal::new(why)));
        self.outbox.take()
    }

    fn handle(&mut self, request: &Request) {
        let seq = request.seq;
        let respond = |adapter: &mut Self, answer: Answer| {
            adapter.outbox.respond(seq, &request.command, answer);
        };
        // Those that send events behind their response, or before.
        match request.command.as_str() {
            "launch" => return self.launch(request),
            "restart" => return self.restart(request),
            "configurationDone" => {
                let answer = self.configuration_done();
                let starts = answer.is_ok();
                respond(self, answer);
                if starts {
                    self.start();
                }
                return;
            }
            "evaluate" => return self.evaluate_or_execute(request),
            "cancel" => return self.cancel(request),
            "pause" => {
                let was_running = self.is_running();
                respond(self, Ok(Value::Null));
                if was_running {
                    self.paused();
                }
                return;
            }
            "terminate" => {
                respond(self, Ok(Value::Null));
                self.terminate();
                return;
            }
            _ => {}
        }
        let was_running = self.is_running();
        let answer = self.answer(request);
        if self.is_running() && !was_running {
            self.motion_request = seq;
        }
        respond(self, answer);
    }

    /// The body of the response to a request that sends no events by itself.
    fn answer(&mut self, request: &Request) -> Answer {
        match request.command.as_str() {
            "initialize" => self.initialize(request),
            "setBreakpoints" => self.set_breakpoints(request),
            "setFunctionBreakpoints" => self.set_function_breakpoints(request),
            "setInstructionBreakpoints" => self.set_instruction_breakpoints(request),
            "setExceptionBreakpoints" => self.set_exception_breakpoints(request),
            "dataBreakpointInfo" => self.data_breakpoint_info(request),
            "setDataBreakpoints" => self.set_data_breakpoints(request),
            "breakpointLocations" => self.breakpoint_locations(request),
            "threads" => Ok(self.threads()),
            "stackTrace" => self.stack_trace(request),
            "scopes" => self.scopes(request),
            "variables" => self.variables(request),
            "completions" => self.completions(request),
            "setVariable" => self.set_variable(request),
            "setExpression" => self.set_expression(request),
            "continue" => {
                self.move_on(Motion::Resume)?;
                Ok(json!({ "allThreadsContinued": true }))
            }
            "reverseContinue" => self.move_on(Motion::ResumeBack),
            "next" => self.step(request, Stepping::Over, Motion::Step),
            "stepIn" => self.step(request, Stepping::Into, Motion::Step),
            "stepOut" => self.step(request, Stepping::Out, Motion::Step),
            "stepBack" => self.step(request, Stepping::Over, Motion::StepBack),
            "anyhit/stepTraversal" => self.move_on(Motion::Step(Stepping::Traversal)),
            "anyhit/traversal" => self.traversal(),
            "disassemble" => self.disassemble(request),
            "readMemory" => self.read_memory(request),
            "source" => self.source(request),
            "loadedSources" => self.loaded_sources(),
            "modules" => self.modules(request),
            "exceptionInfo" => self.exception_info(),
            "disconnect" => {
                self.is_over = true;
                self.state = State::Terminated;
                Ok(Value::Null)
            }
            other => Err(match REFUSED.iter().find(|(name, _)| *name == other) {
                Some((_, why)) => Refusal::shown(*why),
                None => Refusal::new(format!("the request `{other}` is not supported")),
            }),
        }
    }

    /// What was launched, while it is stopped.
    fn stopped(&mut self) -> Result<&mut Launched, Refusal> {
        match (&mut self.launched, self.state) {
            (Some(launched), State::Stopped) => Ok(launched),
            (Some(_), State::Running(_)) => Err(Refusal::new("the invocation is running")),
            (Some(_), State::Configuring) => Err(Refusal::new("the invocation has not started")),
            (Some(_), State::Terminated) => Err(Refusal::new("the invocation has ended")),
            (_, State::Idle | State::Stopped) | (None, _) => Err(Refusal::new("nothing has been launched")),
        }
    }

    /// What was launched, whatever it does.
    fn launched(&mut self) -> Result<&mut Launched, Refusal> {
        self.launched.as_mut().ok_or_else(|| Refusal::new("nothing has been launched"))
    }
}
