//! Breakpoints: where they are asked for, and the table in which a run looks them up.

use anyhit_engine::module::Opcode;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use anyhit_base::sorted::sort_by_key;
use anyhit_engine::machine::{RayQueryEvent, RayQueryStep, ShaderIndex};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::translate::Origin;
use anyhit_engine::pipeline::Event;

use super::course::{Moment, Time};
use super::source_map::{LineIndex, SourceMap, SourcePosition};
use super::traversal_names::{instance_verdict_name, verdict_name};

/// The number of a breakpoint, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BreakpointId(pub u32);

/// Where a breakpoint stops.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BreakpointPlace {
    /// Where a line of a file begins; where no code is on it, on the next line that has some.
    Line {
        /// The file, by its name or the last components of it.
        file: String,
        /// The line, from 1.
        line: u32,
    },
    /// Where a function of this name begins; `main` is the entry point of a shader.
    Function(String),
    /// Before an instruction with an opcode, `OpTraceRayKHR` or `TraceRayKHR`.
    Opcode(String),
    /// Before an instruction of a shader.
    Instruction {
        /// The shader, by its number in the pipeline.
        shader: u32,
        /// Where the instruction begins, in words from the start of the module.
        offset: u32,
    },
    /// Where a shader of a stage begins.
    Stage(Stage),
    /// Where the traversal of a ray or ray query has decided.
    Traversal(TraversalFilter),
}

/// Decisions of a traversal: those in which all that is given matches.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TraversalFilter {
    /// `InstanceId`
    pub instance: Option<u32>,
    /// `RayGeometryIndexKHR`
    pub geometry: Option<u32>,
    /// `PrimitiveId`
    pub primitive: Option<u32>,
    /// What was decided: `opaque`, `candidate`, `missed`, `masked`, ...
    pub verdict: Option<String>,
    /// Only candidates that an any-hit shader decides on.
    pub any_hit: bool,
}

/// A breakpoint.
#[derive(Clone, Debug)]
pub struct Breakpoint {
    /// Its number.
    pub id: BreakpointId,
    /// Where it stops.
    pub place: BreakpointPlace,
    /// Where that is in the sources; empty where the invocation has no such place.
    pub resolved: Vec<SourcePosition>,
    /// Whether it stops anywhere.
    pub is_enabled: bool,
    /// It stops only where this expression holds.
    pub condition: Option<String>,
    /// It stops from this hit on; 0 and 1 for the first.
    pub from_hit: u64,
    /// Instead of stopping it prints this text, in which `{expression}` stands for a value.
    pub log: Option<String>,
    /// Its hits on the way forwards.
    pub hits: HitLog,
}

/// Hits of a breakpoint on the way forwards: the step that was next, and for a decision of a
/// traversal the number of the event before it, ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HitLog(Vec<(Time, usize)>);

impl HitLog {
    /// Adds a hit, once however often the run passes it.
    pub(super) fn add(&mut self, time: Time, event: usize) {
        if let Err(at) = self.0.binary_search(&(time, event)) {
            self.0.insert(at, (time, event));
        }
    }

    /// Whether the run has passed a hit on the way forwards.
    pub(super) fn contains(&self, time: Time, event: usize) -> bool {
        self.0.binary_search(&(time, event)).is_ok()
    }

    /// The number of hits up to one, included.
    pub(super) fn count_to(&self, time: Time, event: usize) -> u64 {
        self.0.partition_point(|&hit| hit <= (time, event)) as u64
    }

    /// The number of hits up to a step.
    pub fn count(&self, time: Time) -> u64 {
        self.count_to(time, usize::MAX)
    }

    /// Removes the hits behind a step, from which the run goes another way.
    pub(super) fn forget_after(&mut self, time: Time) {
        self.0.truncate(self.count(time) as usize);
    }
}

impl Breakpoint {
    /// A breakpoint that always stops.
    pub fn new(id: BreakpointId, place: BreakpointPlace) -> Self {
        Self {
            id,
            place,
            resolved: Vec::new(),
            is_enabled: true,
            condition: None,
            from_hit: 0,
            log: None,
            hits: HitLog::default(),
        }
    }

    /// Whether the shaders have a place where it stops. Those of traversal may have one.
    pub fn is_somewhere(&self) -> bool {
        match &self.place {
            BreakpointPlace::Line { .. }
            | BreakpointPlace::Function(_)
            | BreakpointPlace::Instruction { .. } => !self.resolved.is_empty(),
            BreakpointPlace::Opcode(name) => Opcode::by_name(name).is_some(),
            BreakpointPlace::Stage(_) | BreakpointPlace::Traversal(_) => true,
        }
    }
}

/// Breakpoints as a run looks them up.
#[derive(Clone, Debug, Default)]
pub struct BreakpointTable {
    lines: FxHashMap<LineIndex, SmallVec<[BreakpointId; 1]>>,
    functions: FxHashMap<(ShaderIndex, u32), SmallVec<[BreakpointId; 1]>>,
    opcodes: FxHashMap<Opcode, SmallVec<[BreakpointId; 1]>>,
    /// By shader and word offset.
    instructions: FxHashMap<(ShaderIndex, u32), SmallVec<[BreakpointId; 1]>>,
    /// By stage.
    pub stages: Vec<(BreakpointId, Stage)>,
    /// Decisions of traversals.
    pub traversal: Vec<(BreakpointId, TraversalFilter)>,
}

impl BreakpointTable {
    /// Adds a breakpoint; returns the lines that it stops at.
    pub fn add(
        &mut self,
        id: BreakpointId,
        place: &BreakpointPlace,
        sources: &SourceMap,
    ) -> Vec<SourcePosition> {
        match place {
            BreakpointPlace::Line { file, line } => self.add_lines(id, file, *line, sources),
            BreakpointPlace::Function(name) => self.add_functions(id, name, sources),
            BreakpointPlace::Opcode(name) => {
                Opcode::by_name(name)
                    .into_iter()
                    .for_each(|opcode| self.opcodes.entry(opcode).or_default().push(id));
                Vec::new()
            }
            BreakpointPlace::Instruction { shader, offset } => {
                let Some(sites) = sources.shaders().get(*shader as usize) else { return Vec::new() };
                let at = (ShaderIndex::new(*shader as usize), *offset);
                self.instructions.entry(at).or_default().push(id);
                let is_it = |origin: &&Origin| origin.offset == *offset;
                let found = sites.program.origins.iter().find(is_it);
                found.and_then(|origin| sites.position(origin.offset)).into_iter().collect()
            }
            BreakpointPlace::Stage(stage) => {
                self.stages.push((id, *stage));
                Vec::new()
            }
            BreakpointPlace::Traversal(filter) => {
                self.traversal.push((id, filter.clone()));
                Vec::new()
            }
        }
    }

    fn add_lines(
        &mut self,
        id: BreakpointId,
        file: &str,
        line: u32,
        sources: &SourceMap,
    ) -> Vec<SourcePosition> {
        let mut resolved = Vec::new();
        let behind: Vec<_> = sources.lines_of(file).filter(|(_, at)| at.line >= line).collect();
        // A line without code stands for the next one that has some, in each file that is meant.
        for (index, at) in &behind {
            let is_first = behind.iter().all(|(_, other)| other.file != at.file || other.line >= at.line);
            if is_first {
                self.lines.entry(*index).or_default().push(id);
                resolved.push(*at);
            }
        }
        resolved
    }

    fn add_functions(&mut self, id: BreakpointId, name: &str, sources: &SourceMap) -> Vec<SourcePosition> {
        let mut resolved = Vec::new();
        for (shader, sites) in sources.shaders().iter().enumerate() {
            for scope in 0..sites.program.scopes.len() as u32 {
                let is_entry = scope == 0 && sites.program.name == name;
                if is_entry || sites.function_name(scope) == name {
                    let shader = ShaderIndex::new(shader);
                    self.functions.entry((shader, scope)).or_default().push(id);
                    resolved.extend(sources.line(sites.first_line(scope)));
                }
            }
        }
        sort_by_key(&mut resolved, |at| (at.file, at.line));
        resolved.dedup();
        resolved
    }

    /// Whether a run need not be looked at for these breakpoints, given the lines that begin in it.
    pub fn only_lines(&self) -> Option<impl Iterator<Item = LineIndex> + '_> {
        let others = self.opcodes.len()
            + self.instructions.len()
            + self.stages.len()
            + self.traversal.len()
            + self.functions.len();
        (others == 0).then(|| self.lines.keys().copied())
    }

    /// Whether every instruction must be looked at, not only those where another line begins.
    pub fn looks_at_instructions(&self) -> bool {
        !self.opcodes.is_empty() || !self.instructions.is_empty()
    }

    /// Tells the breakpoints at a moment.
    pub fn arrive(&self, moment: &Moment<'_>, hit: &mut dyn FnMut(BreakpointId)) {
        if moment.begins_line
            && let Some(ids) = self.lines.get(&moment.site.line)
        {
            ids.iter().copied().for_each(&mut *hit);
        }
        if moment.begins_function && moment.site.scope == 0 {
            let stage = moment.sites.program.stage;
            self.stages.iter().filter(|(_, wanted)| *wanted == stage).for_each(|(id, _)| hit(*id));
        }
        if moment.begins_function
            && let Some(ids) = self.functions.get(&(moment.shader, moment.site.scope))
        {
            ids.iter().copied().for_each(&mut *hit);
        }
        if moment.begins_instruction
            && !self.instructions.is_empty()
            && let Some(ids) = self.instructions.get(&(moment.shader, moment.sites.offset(moment.op)))
        {
            ids.iter().copied().for_each(&mut *hit);
        }
        if moment.begins_instruction
            && !self.opcodes.is_empty()
            && let Some(ids) = self.opcodes.get(&moment.sites.opcode(moment.op))
        {
            ids.iter().copied().for_each(&mut *hit);
        }
    }
}

impl TraversalFilter {
    /// Whether an event is a decision that matches.
    pub fn matches(&self, event: &Event) -> bool {
        let given = |wanted: Option<u32>, is: Option<u32>| wanted.is_none() || wanted == is;
        let (instance, geometry, primitive, verdict) = match event {
            Event::Instance(instance, verdict) => (*instance, None, None, instance_verdict_name(*verdict)),
            Event::RayQuery(RayQueryEvent { step: RayQueryStep::Primitive(hit, verdict), .. })
            | Event::Primitive(hit, verdict) => {
                (hit.instance, Some(hit.geometry), Some(hit.primitive), verdict_name(*verdict))
            }
            Event::Candidate { candidate, .. } => {
                (candidate.instance, Some(candidate.geometry), Some(candidate.primitive), "decision")
            }
            _ => return false,
        };
        // A whole instance is meant only where nothing in it is.
        let is_whole = self.geometry.is_some() || self.primitive.is_some();
        let any_hit =
            matches!(event, Event::Candidate { candidate, shader: Some(_), .. } if !candidate.is_box());
        !(is_whole && geometry.is_none())
            && (!self.any_hit || any_hit)
            && given(self.instance, Some(instance))
            && given(self.geometry, geometry)
            && given(self.primitive, primitive)
            && match &self.verdict {
                // A candidate that an any-hit shader decides on is one where it decides, too.
                Some(wanted) => wanted == verdict || self.any_hit && any_hit && wanted == "candidate",
                // A candidate is reported twice: when it is found, and when a shader decides.
                None => verdict != "decision" || self.any_hit,
            }
    }
}

#[cfg(test)]
mod tests {
    use super::HitLog;

    #[test]
    fn hits_are_counted_once_and_by_time() {
        let mut log = HitLog::default();
        // Two events before step 5; then a second run over the first steps.
        for (time, event) in [(2, 0), (5, 1), (5, 3), (9, 0), (2, 0), (5, 1)] {
            log.add(time, event);
        }
        assert_eq!([1, 2, 4, 5, 9].map(|time| log.count(time)), [0, 1, 1, 3, 4]);
        assert_eq!([log.count_to(5, 1), log.count_to(5, 3)], [2, 3]);
        assert!(log.contains(5, 3) && !log.contains(5, 2));
        log.forget_after(5);
        assert_eq!(log.count(u64::MAX), 3);
    }
}
