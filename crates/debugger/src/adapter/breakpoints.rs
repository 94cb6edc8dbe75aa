//! Breakpoints at lines, functions and instructions.

use emmy_dap_types::requests::{
    BreakpointLocationsArguments, SetBreakpointsArguments, SetFunctionBreakpointsArguments,
    SetInstructionBreakpointsArguments,
};
use emmy_dap_types::responses::{
    BreakpointLocationsResponse, SetBreakpointsResponse, SetFunctionBreakpointsResponse,
    SetInstructionBreakpointsResponse,
};
use emmy_dap_types::types::{Breakpoint as ShownBreakpoint, BreakpointLocation, Source};
use serde_json::json;

use crate::debugger::{Breakpoint, BreakpointId, BreakpointPlace, SourcePosition};

use super::disassembly::shader_and_offset;
use super::protocol::{Answer, Refusal, Request, body};
use super::sources::{Sources, path_of_uri};
use super::{Adapter, Launched};

/// What is set by one request, in the place of what the request before has set.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Group {
    /// The lines of a file with this path.
    Path(String),
    /// The lines of a text with this reference.
    Reference(i64),
    Functions,
    Instructions,
}

/// Where a client wants a breakpoint.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Wanted {
    /// A line, from 1.
    Line(u32),
    Function(String),
    Instruction {
        address: String,
        bytes: i64,
    },
}

/// What a client says of a breakpoint.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Spec {
    wanted: Wanted,
    condition: Option<String>,
    hit_condition: Option<String>,
    log: Option<String>,
}

impl Spec {
    fn at(wanted: Wanted) -> Self {
        Self { wanted, condition: None, hit_condition: None, log: None }
    }
}

/// A breakpoint that a client has asked for.
#[derive(Clone, Debug)]
struct RequestedBreakpoint {
    id: BreakpointId,
    group: Group,
    spec: Spec,
}

/// All that a client has asked for, whether something is launched or not.
#[derive(Debug, Default)]
pub(super) struct RequestedBreakpoints {
    all: Vec<RequestedBreakpoint>,
    last: u32,
}

impl RequestedBreakpoints {
    /// A number that no breakpoint has had.
    pub(super) fn new_id(&mut self) -> BreakpointId {
        self.last += 1;
        BreakpointId(self.last)
    }

    /// The last number that a breakpoint has.
    pub(super) fn last(&self) -> BreakpointId {
        BreakpointId(self.last)
    }

    /// Has numbers of new breakpoints follow one that somebody else has given.
    pub(super) fn number_after(&mut self, last: BreakpointId) {
        self.last = self.last.max(last.0);
    }

    /// Removes a breakpoint; whether there was one of this number.
    pub(super) fn remove(&mut self, id: BreakpointId) -> bool {
        let count = self.all.len();
        self.all.retain(|requested| requested.id != id);
        self.all.len() < count
    }

    /// Puts breakpoints in the place of those of a group; those that stay keep their numbers.
    fn set(&mut self, group: &Group, specs: Vec<Spec>) -> Vec<BreakpointId> {
        let (mut before, others) = std::mem::take(&mut self.all)
            .into_iter()
            .partition::<Vec<_>, _>(|requested| requested.group == *group);
        self.all = others;
        let mut ids = Vec::new();
        for spec in specs {
            let kept = before.iter().position(|requested| requested.spec == spec);
            let id = match kept {
                Some(at) => before.swap_remove(at).id,
                None => self.new_id(),
            };
            ids.push(id);
            self.all.push(RequestedBreakpoint { id, group: group.clone(), spec });
        }
        ids
    }

    /// The reason that a client is told for a stop.
    pub(super) fn reason(&self, id: BreakpointId) -> &'static str {
        match self.all.iter().find(|requested| requested.id == id).map(|requested| &requested.group) {
            Some(Group::Functions) => "function breakpoint",
            Some(Group::Instructions) => "instruction breakpoint",
            _ => "breakpoint",
        }
    }
}

impl Adapter {
    pub(super) fn set_breakpoints(&mut self, request: &Request) -> Answer {
        let arguments: SetBreakpointsArguments = request.arguments()?;
        let group = self.group_of(&arguments.source)?;
        let specs = arguments.breakpoints.unwrap_or_default().into_iter().map(|one| Spec {
            wanted: Wanted::Line(self.client.line_from(one.line)),
            condition: given(one.condition),
            hit_condition: given(one.hit_condition),
            log: given(one.log_message),
        });
        let breakpoints = self.set(&group, specs.collect());
        body(SetBreakpointsResponse { breakpoints })
    }

    pub(super) fn set_function_breakpoints(&mut self, request: &Request) -> Answer {
        let arguments: SetFunctionBreakpointsArguments = request.arguments()?;
        let specs = arguments.breakpoints.into_iter().map(|one| Spec {
            condition: given(one.condition),
            hit_condition: given(one.hit_condition),
            ..Spec::at(Wanted::Function(one.name))
        });
        let breakpoints = self.set(&Group::Functions, specs.collect());
        body(SetFunctionBreakpointsResponse { breakpoints })
    }

    pub(super) fn set_instruction_breakpoints(&mut self, request: &Request) -> Answer {
        let arguments: SetInstructionBreakpointsArguments = request.arguments()?;
        let specs = arguments.breakpoints.into_iter().map(|one| {
            let (address, bytes) = (one.instruction_reference, one.offset.unwrap_or(0));
            Spec { condition: given(one.condition), ..Spec::at(Wanted::Instruction { address, bytes }) }
        });
        let breakpoints = self.set(&Group::Instructions, specs.collect());
        body(SetInstructionBreakpointsResponse { breakpoints })
    }

    pub(super) fn breakpoint_locations(&mut self, request: &Request) -> Answer {
        let arguments: BreakpointLocationsArguments = request.arguments()?;
        let client = self.client;
        let group = self.group_of(&arguments.source)?;
        let sources = &self.launched()?.sources;
        let lines = group.file(sources).map_or_else(Vec::new, |file| sources.lines_with_code(file));
        let first = client.line_from(arguments.line);
        let last = arguments.end_line.map_or(first, |line| client.line_from(line));
        let within = lines.into_iter().filter(|line| (first..=last).contains(line));
        let location = |line| BreakpointLocation { line: client.line(line), ..BreakpointLocation::default() };
        body(BreakpointLocationsResponse { breakpoints: within.map(location).collect() })
    }

    /// Which source a client means.
    fn group_of(&self, source: &Source) -> Result<Group, Refusal> {
        if let Some(reference) = source.source_reference.filter(|&reference| reference > 0) {
            return Ok(Group::Reference(reference.into()));
        }
        match source.path.as_ref().or(source.name.as_ref()) {
            Some(path) if self.client.sends_uris => Ok(Group::Path(path_of_uri(path))),
            Some(path) => Ok(Group::Path(path.clone())),
            None => Err(Refusal::new("the source has neither a path nor a sourceReference")),
        }
    }

    /// Sets the breakpoints of a group; returns them as they are.
    fn set(&mut self, group: &Group, specs: Vec<Spec>) -> Vec<ShownBreakpoint> {
        let ids = self.breakpoints.set(group, specs);
        self.apply_breakpoints();
        ids.into_iter().map(|id| self.shown_breakpoint(id)).collect()
    }

    /// Gives the debugger the breakpoints that were asked for.
    pub(super) fn apply_breakpoints(&mut self) {
        let is_enabled = !self.arguments.as_ref().is_some_and(|arguments| arguments.no_debug);
        let stops_at_nan = is_enabled && self.filters.nans;
        let Some(Launched { console, sources, console_breakpoints, .. }) = &mut self.launched else { return };
        let debugger = &mut console.debugger;
        let before = |id: BreakpointId| debugger.breakpoints().iter().find(|one| one.id == id);
        let all = self.breakpoints.all.iter().filter_map(|requested| {
            let mut breakpoint = Breakpoint::new(requested.id, place(requested, sources).ok()?);
            // A command may have disabled it.
            breakpoint.is_enabled = before(requested.id).map_or(is_enabled, |before| before.is_enabled);
            breakpoint.condition.clone_from(&requested.spec.condition);
            breakpoint.from_hit = from_hit(requested.spec.hit_condition.as_deref()).ok()?;
            breakpoint.log.clone_from(&requested.spec.log);
            breakpoint.hits = before(requested.id).map(|before| before.hits.clone()).unwrap_or_default();
            Some(breakpoint)
        });
        let of_console = console_breakpoints.iter().filter_map(|&id| before(id).cloned());
        let all = all.chain(of_console).collect();
        debugger.set_breakpoints(all);
        debugger.stop_at_nan(stops_at_nan);
    }

    /// Tells the client what became of the breakpoints that it set before something was launched.
    pub(super) fn announce_breakpoints(&mut self) {
        self.apply_breakpoints();
        let ids: Vec<BreakpointId> = self.breakpoints.all.iter().map(|requested| requested.id).collect();
        for id in ids {
            let breakpoint = self.shown_breakpoint(id);
            self.outbox.event("breakpoint", json!({ "reason": "changed", "breakpoint": breakpoint }));
        }
    }

    /// A breakpoint as a client is told of it: where it stops, or why it does not.
    fn shown_breakpoint(&self, id: BreakpointId) -> ShownBreakpoint {
        let unverified = |message: String| ShownBreakpoint {
            id: Some(id.0.into()),
            message: Some(message),
            ..ShownBreakpoint::default()
        };
        let Some(requested) = self.breakpoints.all.iter().find(|requested| requested.id == id) else {
            return unverified("the breakpoint does not exist".into());
        };
        if let Err(why) = from_hit(requested.spec.hit_condition.as_deref()) {
            return unverified(why);
        }
        let Some(Launched { console, sources, .. }) = &self.launched else {
            return unverified("nothing has been launched yet".into());
        };
        let debugger = &console.debugger;
        if let Err(why) = place(requested, sources) {
            return unverified(why);
        }
        let found = debugger.breakpoints().iter().find(|breakpoint| breakpoint.id == id);
        let resolved = found.map_or(&[][..], |breakpoint| &breakpoint.resolved);
        let file = requested.group.file(sources);
        let is_own = |position: &&SourcePosition| file.is_none_or(|file| position.file == file);
        match resolved.iter().find(is_own) {
            Some(&position) => ShownBreakpoint {
                id: Some(id.0.into()),
                verified: true,
                source: Some(sources.source(position.file)),
                line: Some(self.client.line(sources.shown_line(position))),
                ..ShownBreakpoint::default()
            },
            None if found.is_some_and(Breakpoint::is_somewhere) => {
                ShownBreakpoint { id: Some(id.0.into()), verified: true, ..ShownBreakpoint::default() }
            }
            None => unverified(nowhere(requested, sources)),
        }
    }
}

impl Group {
    /// The file that it is about.
    fn file(&self, sources: &Sources) -> Option<u32> {
        match self {
            Self::Path(path) => sources.by_path(path),
            Self::Reference(reference) => sources.by_reference(*reference),
            Self::Functions | Self::Instructions => None,
        }
    }
}

/// A text that is not empty.
pub(super) fn given(text: Option<String>) -> Option<String> {
    text.filter(|text| !text.trim().is_empty())
}

/// Where the debugger is to stop.
fn place(requested: &RequestedBreakpoint, sources: &Sources) -> Result<BreakpointPlace, String> {
    Ok(match &requested.spec.wanted {
        Wanted::Line(line) => match (requested.group.file(sources), &requested.group) {
            (Some(file), _) => BreakpointPlace::Line {
                file: sources.name(file).to_owned(),
                line: sources.line_from(file, *line),
            },
            // Several files may end so.
            (None, Group::Path(path)) => BreakpointPlace::Line { file: path.clone(), line: *line },
            (None, _) => return Err("no source has this reference".into()),
        },
        Wanted::Function(name) => match name.starts_with("Op") {
            true => BreakpointPlace::Opcode(name.clone()),
            false => BreakpointPlace::Function(name.clone()),
        },
        Wanted::Instruction { address, bytes } => {
            let (shader, offset) = shader_and_offset(address, *bytes).map_err(|refusal| refusal.message)?;
            let shader = u32::try_from(shader).map_err(|_| format!("shader {shader} does not exist"))?;
            BreakpointPlace::Instruction { shader, offset }
        }
    })
}

/// Why a breakpoint stops nowhere.
fn nowhere(requested: &RequestedBreakpoint, sources: &Sources) -> String {
    match (&requested.spec.wanted, requested.group.file(sources)) {
        (Wanted::Line(_), None) => "no shader of this scene has code from this file".into(),
        (Wanted::Line(_), Some(_)) => "the file has no code at or after this line".into(),
        (Wanted::Function(name), _) => format!("no shader of this scene has a function `{name}`"),
        (Wanted::Instruction { address, .. }, _) => format!("no instruction is at {address}"),
    }
}

/// From which hit on a breakpoint stops: `3` and `>= 3` from the third on, `> 3` from the fourth.
pub(super) fn from_hit(condition: Option<&str>) -> Result<u64, String> {
    let Some(condition) = condition else { return Ok(0) };
    let text = condition.trim();
    let (number, more) = match (text.strip_prefix(">="), text.strip_prefix('>')) {
        (Some(number), _) => (number, 0),
        (None, Some(number)) => (number, 1),
        (None, None) => (text, 0),
    };
    let number: Result<u64, _> = number.trim().parse();
    number
        .map(|number| number.saturating_add(more))
        .map_err(|_| format!("`{text}` is not a hit count: expected N, `>= N` or `> N`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_hits() {
        assert_eq!(from_hit(None), Ok(0));
        assert_eq!(from_hit(Some("3")), Ok(3));
        assert_eq!(from_hit(Some(" >= 3")), Ok(3));
        assert_eq!(from_hit(Some(">3")), Ok(4));
        assert!(from_hit(Some("% 2")).is_err());
    }

    #[test]
    fn breakpoints_that_stay_keep_their_numbers() {
        let mut all = RequestedBreakpoints::default();
        let lines = |lines: &[u32]| lines.iter().map(|&line| Spec::at(Wanted::Line(line))).collect();
        let group = Group::Path("a".into());
        assert_eq!(all.set(&group, lines(&[3, 5])), [BreakpointId(1), BreakpointId(2)]);
        assert_eq!(all.set(&group, lines(&[5, 7])), [BreakpointId(2), BreakpointId(3)]);
        assert_eq!(all.set(&Group::Functions, Vec::new()), []);
        assert_eq!(all.all.len(), 2);
    }
}
