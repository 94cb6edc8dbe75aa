//! Reports: what is told of a finding, from the batch in which it was met.

pub mod specials;

use crate::cause::{Cause, Causes, OpPlace};
use crate::finding::{Finding, FindingKey, Findings};
use crate::levels::Levels;
use crate::names::{Argument, function_of, word_path, workgroup_path};
use crate::plan::ProgramPlan;
use crate::races::{self, Location, Race};
use crate::rule::{self, Level, Rule, contract, memory, race};
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_base::sorted::sort;
use anyhit_engine::machine::{Batch, Mask, NO_CAUSE, OpIndex, Reg, ShaderIndex, ShadowRegisters};
use anyhit_engine::module::decoration::number;
use anyhit_engine::module::names::builtin_name;
use anyhit_engine::module::{Id, Opcode};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::{source_line, source_line_of, with_location};
use anyhit_engine::program::Program;

/// What depends on a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sink {
    /// A conditional branch.
    Branch,
    /// A switch.
    Switch,
    /// An index of an array, or a part of a byte offset.
    Index,
    /// Which of several resources is used.
    Resource,
    /// A device address.
    Address,
    /// A buffer.
    Buffer,
    /// An atomic instruction.
    Atomic,
    /// The texel, level or resource of an image access.
    Coordinate,
    /// A texel that is written.
    Image,
    /// `debugPrintfEXT`.
    Print,
    /// An operand of a trace, by its name.
    Ray(&'static str),
    /// The index of a callable record.
    Record,
    /// The t of a reported intersection.
    ReportedT,
    /// The hit kind of a reported intersection.
    HitKind,
    /// The hit attributes of a reported intersection.
    Report,
    /// A hit object.
    HitObject,
    /// Other lanes of the subgroup.
    Subgroup,
    /// The payload of a ray from the host.
    Payload,
}

impl Sink {
    /// What is said of a value, or of what is computed from it.
    fn says(self) -> String {
        match self {
            Self::Branch => "reaches a branch".into(),
            Self::Switch => "reaches a switch".into(),
            Self::Index => "reaches an index".into(),
            Self::Resource => "reaches the choice of a resource".into(),
            Self::Address => "reaches a device address".into(),
            Self::Buffer => "reaches a buffer".into(),
            Self::Atomic => "reaches an atomic instruction".into(),
            Self::Coordinate => "reaches the coordinates of an image access".into(),
            Self::Image => "reaches an image".into(),
            Self::Print => "reaches printed text".into(),
            Self::Ray(operand) => format!("reaches the {operand} of a ray"),
            Self::Record => "reaches the index of a callable record".into(),
            Self::ReportedT => "reaches the t of a reported intersection".into(),
            Self::HitKind => "reaches the hit kind of a reported intersection".into(),
            Self::Report => "reaches the hit attributes of a reported intersection".into(),
            Self::HitObject => "reaches a hit object".into(),
            Self::Subgroup => "reaches other lanes of the subgroup".into(),
            Self::Payload => "is left in the payload of the ray".into(),
        }
    }
}

/// A shader that runs or waits, and the operation at which it waits.
#[derive(Clone, Copy, Debug)]
pub(super) struct CallFrame {
    pub shader: ShaderIndex,
    pub op: OpIndex,
    /// The number of the shader call, where these are told apart.
    pub call: u32,
}

/// Makes findings of what a batch does.
pub(super) struct Reporter<'a, const W: usize> {
    pub plans: &'a [ProgramPlan],
    pub levels: &'a Levels,
    pub causes: &'a Causes,
    pub findings: &'a mut Findings,
    pub frames: &'a [CallFrame],
    pub batch: &'a Batch<W>,
}

/// What a report says, before it is given place and stack.
struct Told {
    rule: &'static Rule,
    message: String,
    /// Where the report points to.
    place: OpPlace,
    label: String,
    /// What else is to be told.
    notes: Vec<String>,
    /// What tells causes at one place apart.
    cause: (ShaderIndex, u32),
    /// The word of an instruction that is no operation, where the report points to one.
    word: Option<u32>,
    /// Whether all that one line does for the cause is one report: a compiler may have split what
    /// it does with a vector into its components.
    by_line: bool,
    /// What tells it apart instead of place and cause.
    key: Option<[(ShaderIndex, u32); 2]>,
    /// Whether it only seems so: it is never more than a warning.
    is_uncertain: bool,
}

/// What is wrong with a call of a shader.
pub(super) struct CallFault {
    /// The rule.
    pub rule: &'static Rule,
    /// What is wrong.
    pub message: String,
    /// What else is to be told.
    pub notes: Vec<String>,
    /// Whether it only seems so.
    pub is_uncertain: bool,
}

impl Told {
    /// A report at a place, of a cause there.
    fn at(rule: &'static Rule, place: OpPlace, message: String) -> Self {
        let (label, notes, cause) = (String::new(), Vec::new(), (place.shader, 0));
        let (word, by_line, key, is_uncertain) = (None, false, None, false);
        Self { rule, message, place, label, notes, cause, word, by_line, key, is_uncertain }
    }
}

impl<const W: usize> Reporter<'_, W> {
    fn shader(&self) -> ShaderIndex {
        self.frames.last().map_or(ShaderIndex(0), |frame| frame.shader)
    }

    fn program(&self, shader: ShaderIndex) -> Option<&Program> {
        self.plans.get(shader.index()).map(|plan| &*plan.program)
    }

    /// Reports that an instruction broke a rule in some lanes.
    pub(super) fn broken(&mut self, rule: &'static Rule, op: OpIndex, lanes: Mask<W>, message: String) {
        self.broken_by(rule, op, lanes, message, NO_CAUSE);
    }

    /// As [`Reporter::broken`], by an operand that is a NaN or infinite for a cause.
    pub(super) fn broken_by(
        &mut self,
        rule: &'static Rule,
        op: OpIndex,
        lanes: Mask<W>,
        message: String,
        operand: u32,
    ) {
        let place = OpPlace { shader: self.shader(), op };
        let notes = self.births(operand);
        self.add(Told { notes, ..Told::at(rule, place, message) }, op, lanes);
    }

    /// Reports that an instruction of the shader that runs calls another one against a rule, in
    /// some lanes.
    pub(super) fn broken_call(
        &mut self,
        fault: CallFault,
        (op, called): (OpIndex, ShaderIndex),
        lanes: Mask<W>,
    ) {
        let CallFault { rule, message, notes, is_uncertain } = fault;
        let place = OpPlace { shader: self.shader(), op };
        let told = Told { notes, cause: (called, 0), is_uncertain, ..Told::at(rule, place, message) };
        self.add(told, op, lanes);
    }

    /// Reports that an instruction that is no operation, at a word of the module, broke a rule in
    /// some lanes.
    pub(super) fn broken_at(&mut self, rule: &'static Rule, word: u32, lanes: Mask<W>, message: String) {
        let place = OpPlace { shader: self.shader(), op: OpIndex(0) };
        let cause = (place.shader, word);
        self.add(Told { word: Some(word), cause, ..Told::at(rule, place, message) }, place.op, lanes);
    }

    /// Reports that something depends on an undefined register.
    pub(super) fn undefined(
        &mut self,
        shadow: &ShadowRegisters<W>,
        op: OpIndex,
        register: Reg,
        lanes: Mask<W>,
        sink: Sink,
    ) {
        let told = |reporter: &Self, cause| reporter.tell_undefined(cause, op, sink);
        self.add_for_causes(shadow, register, op, lanes, told);
    }

    /// Reports that something depends on what is undefined for a cause.
    pub(super) fn undefined_for(&mut self, cause: u32, op: OpIndex, lanes: Mask<W>, sink: Sink) {
        if let Some(told) = self.tell_undefined(cause, op, sink) {
            self.add(told, op, lanes);
        }
    }

    /// Reports two accesses that race, the later of which is that of an operation.
    pub(super) fn race(&mut self, op: OpIndex, found: &Race) {
        let here = OpPlace { shader: self.shader(), op };
        let (Some(program), Some(other)) = (self.program(here.shader), self.program(found.other.shader))
        else {
            return;
        };
        let [x, y, z] = races::launch_id(self.batch, found.lane, program, found.other_invocation);
        let location = match found.location {
            Location::Buffer { handle: Some(handle), offset, bytes } => {
                program.describe_buffer_byte(handle, offset).unwrap_or_else(|| {
                    let name = program.describe_descriptor(handle).unwrap_or_else(|| "a buffer".to_owned());
                    format!("{} at offset {offset} of {name}", byte_count(bytes))
                })
            }
            Location::Buffer { handle: None, offset, bytes } => match program.pointee_path(op) {
                Some(path) => format!("`{path}` at offset {offset} of the buffer at a device address"),
                None => format!("{} at offset {offset} of the buffer at a device address", byte_count(bytes)),
            },
            Location::Workgroup { offset, bytes } => match workgroup_path(program, offset) {
                Some((_, path)) => format!("`{path}`"),
                None => format!("{} at offset {offset} of the workgroup's memory", byte_count(bytes)),
            },
            Location::Texel { handle } => {
                let name = program.describe_descriptor(handle);
                format!("a texel of {}", name.unwrap_or_else(|| "an image".to_owned()))
            }
        };
        // A line that loads and stores is told once, whichever of the two comes first.
        let mut key = [
            (here.shader, line_or_offset(program, op)),
            (found.other.shader, line_or_offset(other, found.other.op)),
        ];
        sort(&mut key);
        let (message, mut note) = race_words(found, [program, other], &location, [x, y, z]);
        note += &self.line(found.other);
        if let Some(handle) = found.other_handle {
            let name = other.describe_descriptor(handle).filter(|_| handle != races::ADDRESS);
            note += &format!(", through {}", name.unwrap_or_else(|| "a device address".to_owned()));
        }
        let told = Told {
            label: format!("it {} here", found.kind.says()),
            notes: vec![note],
            cause: (found.other.shader, offset(other, found.other.op)),
            key: Some(key),
            ..Told::at(found.rule, here, message)
        };
        self.add(told, op, Mask::lane(found.lane));
    }

    /// Adds what is told of each cause of a register, where anything is, in the lanes that have it.
    fn add_for_causes(
        &mut self,
        shadow: &ShadowRegisters<W>,
        register: Reg,
        op: OpIndex,
        lanes: Mask<W>,
        told: impl Fn(&Self, u32) -> Option<Told>,
    ) {
        let mut rest = lanes & shadow.caused(register);
        while let Some(lane) = rest.lowest() {
            let cause = shadow.cause(register, lane);
            let same = rest & Mask::from_fn(|lane| shadow.cause(register, lane) == cause);
            rest = rest.without(same);
            if let Some(told) = told(self, cause) {
                self.add(told, op, same);
            }
        }
    }

    fn tell_undefined(&self, cause: u32, op: OpIndex, sink: Sink) -> Option<Told> {
        let here = OpPlace { shader: self.shader(), op };
        let (cause, filled) = self.causes.unfilled(cause);
        let (cause, details) = self.causes.get(cause)?;
        let says = sink.says();
        let mut told = match cause {
            Cause::Unwritten { shader, variable, storage_class, word } => {
                let program = self.program(shader)?;
                let (module, ty) = (&*program.module, program.module.pointee(variable)?);
                let mut notes = Vec::new();
                let path = match Argument::of(module, variable) {
                    Some(argument) => {
                        let path = argument.word_path(module, ty, word);
                        let Argument { function, number, .. } = argument;
                        notes.push(format!("`{path}` is argument {number} of `{function}`"));
                        path
                    }
                    None => word_path(module, variable, ty, word),
                };
                if shader != here.shader {
                    let stage = program.stage.name();
                    notes.push(format!("`{path}` is a variable of the {stage} shader `{}`", program.name));
                } else if let Some(function) = function_of(module, variable).filter(|_| notes.is_empty()) {
                    notes.push(format!("`{path}` is a variable of the function `{function}`"));
                }
                let rule = self.rule_of_variable(shader, storage_class, sink)?;
                let message = format!("`{path}` was never written, and {says}");
                let (label, cause) = (format!("it {says} here"), (shader, variable.0));
                Told { label, notes, cause, ..Told::at(rule, here, message) }
            }
            Cause::UnwrittenShared { shader, byte } => {
                let (variable, path) = workgroup_path(self.program(shader)?, byte)?;
                let message = format!("`{path}` was never written, and {says}");
                let (label, cause) = (format!("it {says} here"), (shader, variable.0));
                Told { label, cause, ..Told::at(&memory::UNINIT_WORKGROUP, here, message) }
            }
            Cause::UnwrittenPart { place, object } => {
                let details = details?;
                let message = format!("{} was never written, and {says}", details.message);
                Told {
                    label: "it is read here".into(),
                    notes: vec![format!("it {says}{}", self.line(here))],
                    cause: (ShaderIndex(u32::MAX), object),
                    ..Told::at(details.rule, place, message)
                }
            }
            Cause::Builtin { shader, builtin, rule } => {
                let program = self.program(shader)?;
                let (stage, name) = (program.stage.name(), &program.name);
                let message = format!("{}, which this hit does not have, {says}", builtin_name(builtin));
                Told {
                    label: format!("it {says} here"),
                    notes: vec![format!(
                        "it is read in the {stage} shader `{name}`{}",
                        line_of_read(program, builtin)
                    )],
                    cause: (shader, builtin),
                    ..Told::at(rule::find(rule)?, here, message)
                }
            }
            Cause::Undef(place) => {
                let message = format!("a value that the shader leaves undefined {says}");
                Told {
                    label: "this value is undefined (OpUndef)".into(),
                    notes: vec![format!("it {says}{}", self.line(here))],
                    cause: (place.shader, line_or_offset(self.program(place.shader)?, place.op)),
                    ..Told::at(&memory::UNDEF_USE, place, message)
                }
            }
            Cause::UndefConstant { shader, id } => {
                let message = format!("a value that the shader leaves undefined {says}");
                Told {
                    label: format!("it {says} here"),
                    notes: vec![
                        "it is OpUndef, which optimizers substitute for an unwritten variable".into(),
                    ],
                    cause: (shader, id.0),
                    ..Told::at(&memory::UNDEF_USE, here, message)
                }
            }
            Cause::Broken { place, .. } => {
                let details = details?;
                let mut notes = self.births(details.operand);
                notes.push(format!("it {says}{}", self.line(here)));
                let message = format!("{}, whose result is undefined, {says}", details.message);
                let cause = (place.shader, line_or_offset(self.program(place.shader)?, place.op));
                let label = "its result is undefined".into();
                Told { label, notes, cause, ..Told::at(details.rule, place, message) }
            }
            Cause::Filled { .. } | Cause::Born { .. } => return None,
        };
        told.by_line = true;
        if filled != 0 {
            told.notes.push(format!("bitfieldInsert wrote only the bits {filled:#010x} of it"));
        }
        Some(told)
    }

    /// The rule about a variable of a shader that is not written.
    fn rule_of_variable(&self, shader: ShaderIndex, storage_class: u32, sink: Sink) -> Option<&'static Rule> {
        Some(match storage_class {
            storage::FUNCTION => &memory::UNINIT_FUNCTION,
            storage::PRIVATE => &memory::UNINIT_PRIVATE,
            storage::RAY_PAYLOAD if shader == self.shader() => &contract::PAYLOAD_RESULT_UNSET,
            storage::RAY_PAYLOAD => &contract::PAYLOAD_UNSET_READ,
            storage::CALLABLE_DATA => &contract::CALLABLE_UNSET_READ,
            storage::HIT_ATTRIBUTE if sink == Sink::Report => &contract::REPORT_ATTRIBUTES_UNSET,
            storage::HIT_ATTRIBUTE | storage::HIT_OBJECT_ATTRIBUTE_NV | storage::HIT_OBJECT_ATTRIBUTE_EXT => {
                &contract::ATTR_UNSET_READ
            }
            _ => return None,
        })
    }

    /// ` at FILE:LINE`, or nothing.
    fn line(&self, place: OpPlace) -> String {
        self.program(place.shader).map_or_else(String::new, |program| source_line(program, place.op))
    }

    /// Adds what is told about an operation of the shader that runs.
    fn add(&mut self, told: Told, op: OpIndex, lanes: Mask<W>) {
        let most = if told.is_uncertain { Level::Warn } else { Level::Deny };
        let level = self.levels.of(told.rule).min(most);
        let Some(lane) = lanes.lowest().filter(|_| level != Level::Allow) else { return };
        let (Some(program), Some(at)) = (self.program(self.shader()), self.program(told.place.shader)) else {
            return;
        };
        let place = if told.by_line { line_or_offset } else { offset }(at, told.place.op);
        let places = told.key.unwrap_or([(told.place.shader, place), told.cause]);
        let key = FindingKey { rule: told.rule.id, places };
        let launch_id = self.batch.invocations.launch_id(lane);
        let make = || {
            let error = Error::new(ErrorKind::Finding, told.message);
            let error = match told.word {
                Some(word) => at_word(at, word, error),
                None => with_location(at, told.place.op, error, &told.label),
            };
            let error = told.notes.into_iter().fold(error, Error::note);
            let (stage, name) = (program.stage.name(), &program.name);
            let invocation = program.describe_invocation(launch_id);
            let mut error = error.note(format!("in {stage} `{name}`, {invocation}"));
            let mut stack = vec![program.frame(self.shader(), op)];
            for frame in self.frames.iter().rev().skip(1) {
                let Some(caller) = self.program(frame.shader) else { continue };
                let (stage, line) = (caller.stage.name(), source_line(caller, frame.op));
                error = error.note(format!("called by {stage} `{}`{line}", caller.name));
                stack.push(caller.frame(frame.shader, frame.op));
            }
            Finding { rule: told.rule, level, count: 0, launch_id, stack, error }
        };
        // Made before it is added, as both look at the same frames.
        let new = (!self.findings.knows(&key)).then(make);
        self.findings.add(key, lanes.count(), new);
        let invocations = &self.batch.invocations;
        self.findings.note(&key, lanes.lanes().map(|lane| invocations.launch_id(lane)));
    }
}

/// An error with the source line of an instruction, by its word in the module, where that is known.
pub(super) fn at_word(program: &Program, word: u32, error: Error) -> Error {
    let line = program.place_at(word).or_else(|| program.place_near(word));
    let error = line.into_iter().fold(error, Error::at);
    error.at(Place::Word(word as usize))
}

/// The message about two accesses that race, and the note about the earlier one, without its line.
fn race_words(
    found: &Race,
    programs: [&Program; 2],
    location: &str,
    [x, y, z]: [u32; 3],
) -> (String, String) {
    let (says, other_says) = (found.kind.says(), found.other_kind.says());
    let [who, other, again] = if found.rule == &race::RACE_CALLER_CALLEE {
        let [one, other] = programs.map(|program| program.stage.name());
        [
            format!("a {one} shader"),
            format!("a {other} shader of the same launch id"),
            format!("the {other} shader"),
        ]
    } else if found.is_own {
        ["an invocation", "the same invocation", "it"].map(str::to_owned)
    } else {
        let other = format!("invocation ({x}, {y}, {z})");
        ["an invocation".to_owned(), other.clone(), other]
    };
    let why = races::why(found.rule);
    (format!("{who} {says} {location}, which {other} {other_says}; {why}"), format!("{again} {other_says}"))
}

/// `1 byte`, `4 bytes`
fn byte_count(bytes: u32) -> String {
    if bytes == 1 { "1 byte".to_owned() } else { format!("{bytes} bytes") }
}

/// ` at FILE:LINE` of the only line that loads a builtin, or nothing.
fn line_of_read(program: &Program, builtin: u32) -> String {
    let module = &program.module;
    let variables = module.variables.iter().map(|variable| variable.id);
    let mut pointers: Vec<Id> =
        variables.filter(|&id| module.decorations.literal(id, number::BUILT_IN) == Some(builtin)).collect();
    let mut loads = Vec::new();
    for one in module.instructions() {
        let chain = module.access_chain(one).map(|chain| chain.base);
        let base = chain.or_else(|| module.operands(one).first().map(|&base| Id(base)));
        if !base.is_some_and(|base| pointers.contains(&base)) {
            continue;
        }
        match one.opcode {
            opcode if opcode.selects_part() => pointers.extend(one.result),
            Opcode::Load => loads.push(source_line_of(program, one.offset)),
            _ => {}
        }
    }
    loads.dedup();
    if loads.len() == 1 { loads.remove(0) } else { String::new() }
}

/// The word of the instruction that an operation comes from.
fn offset(program: &Program, op: OpIndex) -> u32 {
    program.origins.get(op.index()).map_or(0, |origin| origin.offset)
}

/// What tells operations of different source lines apart; without lines, their instructions.
fn line_or_offset(program: &Program, op: OpIndex) -> u32 {
    let offset = offset(program, op);
    let line = program.module.debug_info.line_at(offset);
    line.map_or(offset, |line| 1 << 31 | line.file << 20 ^ line.line)
}
