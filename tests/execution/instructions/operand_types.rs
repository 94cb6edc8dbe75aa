//! Operands of every type: for each instruction with numeric operands, each combination of types
//! and widths that the specification allows runs and gives the right values, and what it does not
//! allow is refused. [`rules`] is the table, [`judge`] says what comes out.

mod arbitrary;
mod exact;
mod grammar;
mod group;
mod images;
mod indices;
mod judge;
mod matrices;
mod memory;
mod parts;
mod refused;
mod rules;
mod special;
mod types;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::Arc;

use anyhit_engine::machine::{Buffer, Descriptor, Resources};

use crate::execution::instructions::run::{INVOCATIONS, Shader};
use judge::{Expected, judge};
use rules::Rule;
use types::{KINDS, Kind, Ty, hash};

/// Scalars of each kind that an invocation reads: four operands of four components, and behind them
/// indices below 2, 3 and 4.
const SLOTS: usize = 19;
const INDICES: usize = 16;

/// An instruction with operands of some types.
#[derive(Clone, Debug)]
struct Case {
    name: &'static str,
    glsl: bool,
    pair: bool,
    /// The result's, then those of the operands.
    types: Vec<Ty>,
    /// What stands in front of the operands: the scope of a subgroup instruction, and its
    /// operation.
    head: &'static str,
    /// Literals behind the operands.
    tail: Vec<usize>,
}

impl Case {
    fn new(rule: &Rule, glsl: bool, types: Vec<Ty>) -> Self {
        let head = match rule.name.strip_prefix("GroupNonUniform") {
            Some("All" | "Any" | "AllEqual" | "BroadcastFirst" | "Shuffle" | "ShuffleXor") => "%u3",
            Some(_) => ["%u3 Reduce", "%u3 InclusiveScan", "%u3 ExclusiveScan"][types[0].count % 3],
            None => "",
        };
        Self { name: rule.name, glsl, pair: rule.pair, types, head, tail: Vec::new() }
    }

    /// The instruction with these operands.
    fn text(&self, result: &str, operands: &str) -> String {
        let name = self.types[0].name();
        let ty = if self.pair { format!("pair_{name}") } else { name };
        let tail: String = self.tail.iter().map(|literal| format!(" {literal}")).collect();
        match self.glsl {
            true => format!("%{result} = OpExtInst %{ty} %glsl {}{operands}", self.name),
            false => format!("%{result} = Op{} %{ty} {}{operands}{tail}", self.name, self.head),
        }
    }
}

/// What the operands are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    /// Read from memory, other values in every lane.
    Read,
    /// Constants, which are folded.
    Constant,
    /// The first is read, the others are constants.
    Mixed,
}

impl Mode {
    fn is_constant(self, operand: usize) -> bool {
        self == Self::Constant || self == Self::Mixed && operand > 0
    }
}

/// The instructions of both tables.
fn table() -> Vec<(Rule, bool)> {
    let core = rules::parse(rules::CORE).into_iter().chain(rules::parse(rules::GROUP));
    let core = core.map(|rule| (rule, false));
    core.chain(rules::parse(rules::GLSL).into_iter().map(|rule| (rule, true))).collect()
}

#[test]
fn what_the_specification_allows_runs_and_gives_its_values() {
    let mut cases = Vec::new();
    for (rule, glsl) in table() {
        let legal = rule.legal();
        assert!(!legal.is_empty(), "{}: no types at all", rule.name);
        // Of many combinations, all of scalars and each fifth of vectors.
        let many = legal.len() > 200;
        for (at, types) in legal.into_iter().enumerate() {
            if !many || types[0].count == 1 || hash(&[at as u64]).is_multiple_of(5) {
                cases.push(Case::new(&rule, glsl, types));
            }
        }
    }
    cases.extend(special::cases());
    assert!(cases.len() > 4000, "{}", cases.len());
    let mut wrong = Vec::new();
    for (at, chunk) in cases.chunks(300).enumerate() {
        wrong.extend(run(chunk, Mode::Read, at as u64));
        wrong.extend(run(chunk, Mode::Constant, at as u64));
    }
    // The rest of the ways that operands come in, for a part of them.
    let some: Vec<Case> = cases.iter().step_by(5).cloned().collect();
    for (at, chunk) in some.chunks(300).enumerate() {
        wrong.extend(run(chunk, Mode::Mixed, 100 + at as u64));
    }
    wrong.truncate(60);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The bits of a slot for an invocation.
fn value(kind: Kind, seed: u64, lane: usize, slot: usize) -> u64 {
    let random = hash(&[seed, lane as u64, slot as u64, kind as u64]);
    if slot >= INDICES {
        return random % (slot - INDICES + 2) as u64;
    }
    let edges = kind.edges();
    edges[random as usize % edges.len()]
}

/// The slot of an operand's component.
fn slot(case: &Case, operand: usize, component: usize) -> usize {
    match (case.name, operand) {
        // Indices lie inside.
        ("VectorExtractDynamic", 1) => INDICES + case.types[1].count - 2,
        ("VectorInsertDynamic", 2) => INDICES + case.types[0].count - 2,
        ("GroupNonUniformShuffle" | "GroupNonUniformShuffleXor", 1) => INDICES + 2,
        _ => operand * 4 + component,
    }
}

/// The lane whose values constants have.
const CONSTANT: usize = 1_000;

/// A module that runs cases one after the other.
#[derive(Default)]
struct Builder {
    constants: String,
    body: String,
    known: BTreeSet<String>,
    /// How many results of each kind an invocation writes.
    results: BTreeMap<Kind, usize>,
    seed: u64,
}

impl Builder {
    /// The id of an index.
    fn index(&mut self, value: usize) -> String {
        let name = format!("i{value}");
        if self.known.insert(name.clone()) {
            let _ = writeln!(self.constants, "%{name} = OpConstant %uint {value}");
        }
        name
    }

    /// The id of an operand.
    fn operand(&mut self, case: &Case, mode: Mode, operand: usize) -> String {
        let ty = case.types[operand + 1];
        let constant = mode.is_constant(operand);
        let parts: Vec<String> = (0..ty.count)
            .map(|component| {
                let slot = slot(case, operand, component);
                if constant { self.constant(ty.kind, slot) } else { self.read(ty.kind, slot) }
            })
            .collect();
        if ty.count == 1 {
            return parts[0].clone();
        }
        let prefix = if constant { 'k' } else { 'v' };
        let name = format!("{prefix}_{}_{operand}", ty.name());
        if self.known.insert(name.clone()) {
            let parts = parts.iter().map(|part| format!(" %{part}")).collect::<String>();
            if constant {
                let _ = writeln!(self.constants, "%{name} = OpConstantComposite %{}{parts}", ty.name());
            } else {
                let _ = writeln!(self.body, "%{name} = OpCompositeConstruct %{}{parts}", ty.name());
            }
        }
        name
    }

    fn constant(&mut self, kind: Kind, slot: usize) -> String {
        let bits = value(kind, self.seed, CONSTANT, slot);
        let name = format!("k_{}_{slot}_", kind.name());
        if self.known.insert(name.clone()) {
            let literal = literal(kind, bits);
            let _ = match kind {
                Kind::Bool if bits == 1 => writeln!(self.constants, "%{name} = OpConstantTrue %bool"),
                Kind::Bool => writeln!(self.constants, "%{name} = OpConstantFalse %bool"),
                _ => writeln!(self.constants, "%{name} = OpConstant %{} {literal}", kind.name()),
            };
        }
        name
    }

    fn read(&mut self, kind: Kind, slot: usize) -> String {
        let name = format!("v_{}_{slot}_", kind.name());
        if self.known.insert(name.clone()) {
            let index = self.index(slot);
            if self.known.insert(format!("x_{slot}")) {
                let _ = writeln!(self.body, "%x_{slot} = OpIAdd %uint %in_base %{index}");
            }
            let (stored, kind) = (stored(kind).name(), kind.name());
            let _ = writeln!(self.body, "%p_{name} = OpAccessChain %to_{stored} %in_{kind} %u0 %x_{slot}");
            let _ = match kind {
                "bool" => writeln!(
                    self.body,
                    "%w_{name} = OpLoad %uint %p_{name}\n%{name} = OpINotEqual %bool %w_{name} %u0"
                ),
                _ => writeln!(self.body, "%{name} = OpLoad %{kind} %p_{name}"),
            };
        }
        name
    }

    /// Appends a case; the first of its results' places.
    fn case(&mut self, case: &Case, mode: Mode, at: usize) -> usize {
        let ty = case.types[0];
        let operands: String = (0..case.types.len() - 1)
            .map(|operand| format!(" %{}", self.operand(case, mode, operand)))
            .collect();
        let _ = writeln!(self.body, "{}", case.text(&format!("r{at}"), &operands));
        let members = if case.pair { 2 } else { 1 };
        let first = self.results.get(&ty.kind).copied().unwrap_or(0);
        let mut place = first;
        for member in 0..members {
            for component in 0..ty.count {
                let path = match (case.pair, ty.count) {
                    (false, 1) => String::new(),
                    (true, 1) => format!(" {member}"),
                    (false, _) => format!(" {component}"),
                    (true, _) => format!(" {member} {component}"),
                };
                let part = format!("r{at}_{member}_{component}");
                let source = if path.is_empty() {
                    format!("r{at}")
                } else {
                    let _ =
                        writeln!(self.body, "%{part} = OpCompositeExtract %{} %r{at}{path}", ty.kind.name());
                    part.clone()
                };
                self.store(ty.kind, &source, &part, place);
                place += 1;
            }
        }
        self.results.insert(ty.kind, place);
        first
    }

    fn store(&mut self, kind: Kind, source: &str, part: &str, place: usize) {
        let mut source = source.to_owned();
        if kind == Kind::Bool {
            let _ = writeln!(self.body, "%{part}_w = OpSelect %uint %{source} %u1 %u0");
            source = format!("{part}_w");
        }
        let index = self.index(place);
        let (stored, kind) = (stored(kind).name(), kind.name());
        let _ = writeln!(
            self.body,
            "%{part}_x = OpIAdd %uint %res_base_{kind} %{index}
             %{part}_p = OpAccessChain %to_{stored} %res_{kind} %u0 %{part}_x
             OpStore %{part}_p %{source}"
        );
    }

    /// Runs the module at every width, with what each kind's results are at each.
    fn run(mut self) -> Vec<BTreeMap<Kind, Vec<u64>>> {
        let mut annotations = String::new();
        let mut declarations = types::declarations();
        let mut bases = String::new();
        for ty in Ty::all() {
            let _ = writeln!(declarations, "%pair_{0} = OpTypeStruct %{0} %{0}", ty.name());
        }
        declarations += "%to_uint = OpTypePointer StorageBuffer %uint\n";
        for kind in KINDS {
            let (name, stored) = (kind.name(), stored(kind));
            let (scalar, bytes) = (stored.name(), stored.bits() / 8);
            if !matches!(kind, Kind::Bool | Kind::U32) {
                let _ = writeln!(declarations, "%to_{name} = OpTypePointer StorageBuffer %{name}");
            }
            let _ = writeln!(
                declarations,
                "%array_{name} = OpTypeRuntimeArray %{scalar}
                 %block_{name} = OpTypeStruct %array_{name}
                 %to_block_{name} = OpTypePointer StorageBuffer %block_{name}
                 %in_{name} = OpVariable %to_block_{name} StorageBuffer
                 %res_{name} = OpVariable %to_block_{name} StorageBuffer"
            );
            let at = kind as u32;
            let _ = writeln!(
                annotations,
                "OpDecorate %array_{name} ArrayStride {bytes}
                 OpDecorate %block_{name} Block
                 OpMemberDecorate %block_{name} 0 Offset 0
                 OpDecorate %in_{name} DescriptorSet 1
                 OpDecorate %in_{name} Binding {at}
                 OpDecorate %res_{name} DescriptorSet 2
                 OpDecorate %res_{name} Binding {at}"
            );
            if let Some(&count) = self.results.get(&kind) {
                let index = self.index(count);
                let _ = writeln!(bases, "%res_base_{name} = OpIMul %uint %id %{index}");
            }
        }
        let index = self.index(SLOTS);
        let body = format!("%in_base = OpIMul %uint %id %{index}\n{bases}{}", self.body);
        let declarations = format!("{declarations}{}", self.constants);
        let shader = Shader {
            capabilities: "OpCapability StorageBuffer8BitAccess
                OpCapability StorageBuffer16BitAccess
                OpCapability GroupNonUniformArithmetic",
            annotations: &annotations,
            declarations: &declarations,
            body: &body,
            ..Shader::default()
        };
        let inputs = KINDS.map(|kind| {
            let values = (0..INVOCATIONS * SLOTS).map(|at| value(kind, self.seed, at / SLOTS, at % SLOTS));
            bytes(kind, values)
        });
        let mut outputs = Vec::new();
        let mut resources = || {
            let mut resources = Resources::default();
            let mut buffers = BTreeMap::new();
            for kind in KINDS {
                let input = Descriptor::Buffer(Buffer::new(&inputs[kind as usize]));
                resources = resources.bind(1, kind as u32, input);
                if let Some(&count) = self.results.get(&kind) {
                    let size = count * INVOCATIONS * (stored(kind).bits() / 8) as usize;
                    let buffer = Buffer::zeroed(size.next_multiple_of(4));
                    resources = resources.bind(2, kind as u32, Descriptor::Buffer(buffer.clone()));
                    buffers.insert(kind, buffer);
                }
            }
            outputs.push(buffers);
            resources
        };
        shader.run_with(&mut resources).unwrap_or_else(|error| panic!("{}", error.render()));
        let read = |(&kind, buffer): (&Kind, &Arc<Buffer>)| (kind, scalars(kind, &buffer.bytes()));
        outputs.iter().map(|buffers| buffers.iter().map(read).collect()).collect()
    }
}

/// What a kind is stored as: a bool as a word.
fn stored(kind: Kind) -> Kind {
    if kind == Kind::Bool { Kind::U32 } else { kind }
}

fn bytes(kind: Kind, values: impl Iterator<Item = u64>) -> Vec<u8> {
    let size = (stored(kind).bits() / 8) as usize;
    let mut bytes: Vec<u8> = values.flat_map(|value| value.to_le_bytes().into_iter().take(size)).collect();
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

fn scalars(kind: Kind, bytes: &[u8]) -> Vec<u64> {
    let size = (stored(kind).bits() / 8) as usize;
    let value = |part: &[u8]| part.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte));
    bytes.chunks_exact(size).map(value).collect()
}

/// A literal of a kind: signed ones are sign-extended (SPIR-V 2.2.1).
fn literal(kind: Kind, bits: u64) -> String {
    match kind.bits() {
        64 => format!("{bits:#x}L"),
        _ if kind.is_signed() => kind.own_number(bits).to_string(),
        _ => format!("{bits:#x}"),
    }
}

/// Runs cases and holds their results against the judge; one line for each case that is wrong.
fn run(cases: &[Case], mode: Mode, seed: u64) -> Vec<String> {
    let mut builder = Builder { seed, ..Builder::default() };
    let places: Vec<usize> =
        cases.iter().enumerate().map(|(at, case)| builder.case(case, mode, at)).collect();
    let counts = builder.results.clone();
    let mut wrong = Vec::new();
    let runs = builder.run();
    assert_eq!(runs.len(), 6, "one run for each width, with the optimizer and without");
    for (case, &place) in cases.iter().zip(&places) {
        let kind = case.types[0].kind;
        let mut told = false;
        for lane in 0..INVOCATIONS {
            let operands = |lane: usize| -> Vec<Vec<u64>> {
                let of = |(operand, ty): (usize, &Ty)| {
                    let lane = if mode.is_constant(operand) { CONSTANT } else { lane };
                    (0..ty.count).map(|part| value(ty.kind, seed, lane, slot(case, operand, part))).collect()
                };
                case.types[1..].iter().enumerate().map(of).collect()
            };
            let expected = match case.head {
                "" => judge(case, &operands(lane)),
                _ => group::judge(case, lane, &operands),
            };
            for (part, expected) in expected.into_iter().enumerate() {
                for results in &runs {
                    let found = results[&kind][lane * counts[&kind] + place + part];
                    if !agrees(kind, expected, found) && !told {
                        told = true;
                        let types: Vec<String> = case.types.iter().map(|ty| ty.name()).collect();
                        wrong.push(format!(
                            "{mode:?} {} {types:?} of {:x?}, part {part}: {found:#x}, not {expected:x?}",
                            case.name,
                            operands(lane)
                        ));
                    }
                }
            }
        }
    }
    wrong
}

fn agrees(kind: Kind, expected: Expected, found: u64) -> bool {
    let nan = |bits: u64| kind.is_float() && exact::to_f64(kind, bits).is_nan();
    // Floats of one sign are ordered as their bits are.
    let order = |bits: u64| match bits >> (kind.bits() - 1) & 1 {
        0 => i128::from(bits),
        _ => -i128::from(bits & (kind.mask() >> 1)),
    };
    match expected {
        Expected::Undefined => true,
        Expected::Bits(bits) => bits == found || nan(bits) && nan(found),
        Expected::Near(bits, steps) => {
            nan(bits) && nan(found)
                || !nan(bits) && !nan(found) && (order(bits) - order(found)).abs() <= i128::from(steps)
        }
    }
}
