//! Data breakpoints: variables and memory whose writes stop the invocation.

use emmy_dap_types::requests::{DataBreakpointInfoArguments, SetDataBreakpointsArguments};
use emmy_dap_types::types::DataBreakpointAccessType;
use serde_json::{Value, json};

use crate::debug::debugger::{BreakpointId, VariablePlace, Watch, WatchedWords, Write};

use crate::debug::values::TypedValue;

use super::Adapter;
use super::protocol::{Answer, Request};
use super::stopped::Handle;

/// Something that can be watched.
#[derive(Clone, Debug)]
struct KnownData {
    name: String,
    words: WatchedWords,
    place: VariablePlace,
}

/// What can be watched, and what is.
#[derive(Debug, Default)]
pub(super) struct DataBreakpoints {
    /// What a client was told an id of: `data-1` is the first.
    known: Vec<KnownData>,
    /// What is watched, each the index of what is known, by the number of the debugger's watch.
    watched: Vec<(BreakpointId, usize)>,
}

impl DataBreakpoints {
    fn find(&self, id: &str) -> Option<usize> {
        let number: usize = id.strip_prefix("data-")?.parse().ok()?;
        number.checked_sub(1).filter(|&at| at < self.known.len())
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
        let found = launched.debugger.place(&frame, &expression).and_then(|place| {
            let words = launched.debugger.watched_words(&frame, &place)?;
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
            let refused = match (&wanted.access_type, &wanted.condition, &wanted.hit_condition) {
                (Some(DataBreakpointAccessType::Read | DataBreakpointAccessType::ReadWrite), ..) => {
                    Some("only writes are watched")
                }
                (_, Some(_), _) | (.., Some(_)) => Some("a data breakpoint has no condition"),
                _ => None,
            };
            let id = self.breakpoints.new_id();
            shown.push(match (refused, self.data_breakpoints.find(&wanted.data_id)) {
                (Some(why), _) => json!({ "id": id.0, "verified": false, "message": why }),
                (None, None) => {
                    let why = format!("`{}` is not known in this run", wanted.data_id);
                    json!({ "id": id.0, "verified": false, "message": why })
                }
                (None, Some(at)) => {
                    watched.push((id, at));
                    json!({ "id": id.0, "verified": true })
                }
            });
        }
        self.data_breakpoints.watched = watched;
        let known = &self.data_breakpoints.known;
        let watches = self.data_breakpoints.watched.iter().map(|&(id, at)| Watch {
            breakpoint: Some(id),
            words: known[at].words.clone(),
            last: None,
        });
        let watches = watches.collect();
        if let Some(launched) = &mut self.launched {
            launched.debugger.set_watches(watches);
        }
        Ok(json!({ "breakpoints": shown }))
    }

    /// Which breakpoints a write hits, and what it has changed in words.
    pub(super) fn written(&self, write: &Write) -> (Vec<u32>, String) {
        let Some(&(id, at)) = self.data_breakpoints.watched.get(write.watch) else {
            return (Vec::new(), String::new());
        };
        let known = &self.data_breakpoints.known[at];
        let (module, ty) = (known.place.module(), known.place.ty());
        let value = |words: &[u32]| TypedValue::of_type(module, ty, words);
        let text = format!("{}: {} -> {}", known.name, value(&write.before), value(&write.after));
        (vec![id.0], text)
    }
}
