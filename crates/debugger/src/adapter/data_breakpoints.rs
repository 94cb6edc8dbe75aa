//! Data breakpoints: variables and memory whose writes stop the invocation.

use emmy_dap_types::requests::{DataBreakpointInfoArguments, SetDataBreakpointsArguments};
use emmy_dap_types::types::{DataBreakpoint as WantedDataBreakpoint, DataBreakpointAccessType};
use serde_json::{Value, json};

use crate::debugger::{BreakpointId, Debugger, VariablePlace, Watch, WatchedWords, Write};

use super::Adapter;
use super::breakpoints::{from_hit, given};
use super::protocol::{Answer, Request};
use super::stopped::Handle;

/// Something that can be watched.
#[derive(Clone, Debug)]
struct KnownData {
    name: String,
    /// The words that are watched for it: of a payload, also those of the shaders that it is given.
    words: Vec<WatchedWords>,
    place: VariablePlace,
}

/// Something that is watched.
#[derive(Clone, Debug)]
struct WatchedData {
    id: BreakpointId,
    /// Which of the things that can be.
    known: usize,
    condition: Option<String>,
    from_hit: u64,
}

/// What can be watched, and what is.
#[derive(Debug, Default)]
pub(super) struct DataBreakpoints {
    /// What a client was told an id of: `data-1` is the first.
    known: Vec<KnownData>,
    /// What is watched.
    watched: Vec<WatchedData>,
}

impl DataBreakpoints {
    fn find(&self, id: &str) -> Option<usize> {
        let number: usize = id.strip_prefix("data-")?.parse().ok()?;
        number.checked_sub(1).filter(|&at| at < self.known.len())
    }

    /// Removes what is watched under a number; whether there was something.
    pub(super) fn remove(&mut self, id: BreakpointId) -> bool {
        let count = self.watched.len();
        self.watched.retain(|data| data.id != id);
        self.watched.len() < count
    }
}

impl Adapter {
    pub(super) fn data_breakpoint_info(&mut self, request: &Request) -> Answer {
        let arguments: DataBreakpointInfoArguments = request.arguments()?;
        let name = arguments.name.trim().to_owned();
        let launched = self.stopped()?;
        let handle = arguments.variables_reference.filter(|&reference| reference > 0);
        let (frame, expression) = match handle {
            None => (launched.frame(arguments.frame_id)?, name),
            Some(reference) => match launched.stopped.handle(reference)?.clone() {
                Handle::Scope(frame, _) => (frame, name),
                Handle::Place { frame, expression, .. } => match expression {
                    Some(whole) if name.starts_with('[') => (frame, format!("{whole}{name}")),
                    Some(whole) => (frame, format!("{whole}.{name}")),
                    None => (frame, name),
                },
            },
        };
        let found = launched.console.debugger.place(&frame, &expression).and_then(|place| {
            let watches = launched.console.debugger.watches_of(BreakpointId(0), &frame, &place)?;
            let words = watches.into_iter().map(|watch| watch.words).collect();
            Ok(KnownData { name: expression.clone(), words, place })
        });
        Ok(match found {
            // That nothing can be watched is the answer, and the reason is shown.
            Err(why) => json!({ "dataId": null, "description": format!("{expression}: {why}") }),
            Ok(known) => {
                self.data_breakpoints.known.push(known);
                json!({
                    "dataId": format!("data-{}", self.data_breakpoints.known.len()),
                    "description": expression,
                    "accessTypes": ["write"],
                    "canPersist": false,
                })
            }
        })
    }

    pub(super) fn set_data_breakpoints(&mut self, request: &Request) -> Answer {
        let arguments: SetDataBreakpointsArguments = request.arguments()?;
        let mut watched = Vec::new();
        let mut shown: Vec<Value> = Vec::new();
        for wanted in arguments.breakpoints {
            let id = self.breakpoints.new_id();
            shown.push(match self.watch(id, &wanted) {
                Err(why) => json!({ "id": id.0, "verified": false, "message": why }),
                Ok(watch) => {
                    watched.push(watch);
                    json!({ "id": id.0, "verified": true })
                }
            });
        }
        self.data_breakpoints.watched = watched;
        self.apply_data_breakpoints();
        Ok(json!({ "breakpoints": shown }))
    }

    /// What a client wants to be watched.
    ///
    /// # Errors
    /// Why it cannot be, in words.
    fn watch(&self, id: BreakpointId, wanted: &WantedDataBreakpoint) -> Result<WatchedData, String> {
        if !matches!(wanted.access_type, None | Some(DataBreakpointAccessType::Write)) {
            return Err("only writes are watched".into());
        }
        let known = self.data_breakpoints.find(&wanted.data_id);
        let known = known.ok_or_else(|| format!("`{}` is not known in this run", wanted.data_id))?;
        let condition = given(wanted.condition.clone());
        condition.as_deref().map_or(Ok(()), Debugger::check_expression)?;
        let from_hit = from_hit(given(wanted.hit_condition.clone()).as_deref())?;
        Ok(WatchedData { id, known, condition, from_hit })
    }

    /// Gives the debugger what is watched.
    fn apply_data_breakpoints(&mut self) {
        let DataBreakpoints { known, watched } = &self.data_breakpoints;
        let watches = watched.iter().flat_map(|data| {
            known[data.known].words.iter().map(|words| Watch {
                condition: data.condition.clone(),
                from_hit: data.from_hit,
                ..Watch::new(Some(data.id), words.clone())
            })
        });
        let watches: Vec<Watch> = watches.collect();
        if let Some(launched) = &mut self.launched {
            let own = &launched.console_breakpoints;
            let is_own = |watch: &&Watch| watch.breakpoint.is_some_and(|id| own.contains(&id));
            let of_console = launched.console.debugger.watches().iter().filter(is_own).cloned();
            let watches = watches.into_iter().chain(of_console).collect();
            launched.console.debugger.set_watches(watches);
        }
    }

    /// Which breakpoints a write hits, and what it has changed in words.
    pub(super) fn written(&self, write: &Write) -> (Vec<u32>, String) {
        let watches = self.launched.as_ref().map_or(&[][..], |launched| launched.console.debugger.watches());
        let id = watches.get(write.watch).and_then(|watch| watch.breakpoint);
        let DataBreakpoints { known, watched } = &self.data_breakpoints;
        let Some(data) = watched.iter().find(|data| Some(data.id) == id) else {
            // The console watches it.
            return (id.into_iter().map(|id| id.0).collect(), String::new());
        };
        let known = &known[data.known];
        let [before, after] = [&write.before, &write.after].map(|words| known.place.value_of(words));
        let text = match before == after {
            true => format!("{}: {after}, as before", known.name),
            false => format!("{}: {before} -> {after}", known.name),
        };
        (vec![data.id.0], text)
    }
}
