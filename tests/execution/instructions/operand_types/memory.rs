//! Memory of every type: loads and stores, and atomic instructions on each width that they exist
//! for.

use std::fmt::Write;

use anyhit_engine::machine::{Buffer, Descriptor, Resources};

use crate::execution::instructions::operand_types::exact;
use crate::execution::instructions::operand_types::refused::not_refused;
use crate::execution::instructions::operand_types::types::{self, KINDS, Kind};
use crate::execution::instructions::operand_types::{bytes, literal, scalars};
use crate::execution::instructions::run::{INVOCATIONS, Shader};

/// An atomic instruction, and what it leaves of an old value and its operand.
type New = fn(Kind, u64, u64) -> u64;

fn signed(kind: Kind, bits: u64) -> i128 {
    kind.number(bits, true)
}

/// Those on integers.
const ON_INTEGERS: &[(&str, bool, New)] = &[
    ("AtomicExchange", true, |_, _, b| b),
    ("AtomicIIncrement", false, |_, a, _| a.wrapping_add(1)),
    ("AtomicIDecrement", false, |_, a, _| a.wrapping_sub(1)),
    ("AtomicIAdd", true, |_, a, b| a.wrapping_add(b)),
    ("AtomicISub", true, |_, a, b| a.wrapping_sub(b)),
    ("AtomicSMin", true, |kind, a, b| if signed(kind, b) < signed(kind, a) { b } else { a }),
    ("AtomicUMin", true, |_, a, b| a.min(b)),
    ("AtomicSMax", true, |kind, a, b| if signed(kind, b) > signed(kind, a) { b } else { a }),
    ("AtomicUMax", true, |_, a, b| a.max(b)),
    ("AtomicAnd", true, |_, a, b| a & b),
    ("AtomicOr", true, |_, a, b| a | b),
    ("AtomicXor", true, |_, a, b| a ^ b),
];

/// Those on floats.
const ON_FLOATS: &[(&str, bool, New)] = &[
    ("AtomicExchange", true, |_, _, b| b),
    ("AtomicFAddEXT", true, exact::add),
    ("AtomicFMinEXT", true, |kind, a, b| if exact::to_f64(kind, b) < exact::to_f64(kind, a) { b } else { a }),
    ("AtomicFMaxEXT", true, |kind, a, b| if exact::to_f64(kind, b) > exact::to_f64(kind, a) { b } else { a }),
];

/// The declarations of two buffers of a type: what was there, and what is read.
fn buffers(kind: Kind) -> (String, String) {
    let name = kind.name();
    let annotations = format!(
        "OpDecorate %array ArrayStride {}
         OpDecorate %block Block
         OpMemberDecorate %block 0 Offset 0
         OpDecorate %memory DescriptorSet 0
         OpDecorate %memory Binding 1
         OpDecorate %old DescriptorSet 0
         OpDecorate %old Binding 2",
        kind.bits() / 8
    );
    let to = if kind == Kind::U32 {
        String::new()
    } else {
        format!("%to_it = OpTypePointer StorageBuffer %{name}")
    };
    let declarations = types::declarations()
        + &format!(
            "%array = OpTypeRuntimeArray %{name}
             %block = OpTypeStruct %array
             %to_block = OpTypePointer StorageBuffer %block
             {to}
             %memory = OpVariable %to_block StorageBuffer
             %old = OpVariable %to_block StorageBuffer
             %n = OpConstant %uint 2000\n"
        );
    (annotations, declarations)
}

/// Runs a list of atomic instructions, each on its own element of every invocation.
fn run(kind: Kind, list: &[(&str, bool, New)]) {
    let (annotations, mut declarations) = buffers(kind);
    let edges: Vec<u64> = kind
        .edges()
        .iter()
        .copied()
        .filter(|&bits| !kind.is_float() || !exact::to_f64(kind, bits).is_nan())
        .collect();
    let operand = |at: usize| edges[(at * 7 + 3) % edges.len()];
    let initial = |at: usize| edges[at * 5 % edges.len()];
    let name = kind.name();
    let pointer = if kind == Kind::U32 { "ptr_StorageBuffer_uint" } else { "to_it" };
    let _ = writeln!(declarations, "%each = OpConstant %uint {}", list.len() + 1);
    let mut body = String::from("%base = OpIMul %uint %id %each\n");
    for (at, &(opcode, takes, _)) in list.iter().enumerate() {
        let _ = writeln!(declarations, "%k{at} = OpConstant %{name} {}", literal(kind, operand(at)));
        let value = if takes { format!(" %k{at}") } else { String::new() };
        let _ = writeln!(
            body,
            "%x{at} = OpIAdd %uint %base %u{at}
             %p{at} = OpAccessChain %{pointer} %memory %u0 %x{at}
             %o{at} = OpAccessChain %{pointer} %old %u0 %x{at}
             %r{at} = Op{opcode} %{name} %p{at} %u1 %u0{value}
             OpStore %o{at} %r{at}"
        );
    }
    // A comparison, a load and a store on the last element.
    let at = list.len();
    let _ = writeln!(declarations, "%k{at} = OpConstant %{name} {}", literal(kind, operand(at)));
    let compare = match kind.is_float() {
        true => String::new(),
        false => format!("%c{at} = OpAtomicCompareExchange %{name} %p{at} %u1 %u0 %u0 %k{at} %l{at}\n"),
    };
    let _ = writeln!(
        body,
        "%x{at} = OpIAdd %uint %base %u{at}
         %p{at} = OpAccessChain %{pointer} %memory %u0 %x{at}
         %o{at} = OpAccessChain %{pointer} %old %u0 %x{at}
         %l{at} = OpAtomicLoad %{name} %p{at} %u1 %u0
         OpAtomicStore %o{at} %u1 %u0 %l{at}
         {compare}"
    );
    let count = INVOCATIONS * (list.len() + 1);
    let start = bytes(kind, (0..count).map(initial));
    let mut kept = Vec::new();
    let mut resources = || {
        let (memory, old) = (Buffer::new(&start), Buffer::zeroed(start.len()));
        kept.push([memory.clone(), old.clone()]);
        Resources::default().bind(0, 1, Descriptor::Buffer(memory)).bind(0, 2, Descriptor::Buffer(old))
    };
    let shader = Shader {
        capabilities: "OpCapability StorageBuffer16BitAccess\nOpCapability Int64Atomics",
        annotations: &annotations,
        declarations: &declarations,
        body: &body,
        ..Shader::default()
    };
    shader.run_with(&mut resources).unwrap_or_else(|error| panic!("{name}: {}", error.render()));
    // At each width, with the optimizer and without.
    assert_eq!(kept.len(), 6);
    for [memory, old] in &kept {
        let (memory, old) = (scalars(kind, &memory.bytes()), scalars(kind, &old.bytes()));
        for at in 0..count {
            let which = at % (list.len() + 1);
            let (opcode, expected) = match list.get(which) {
                Some(&(opcode, _, new)) => (opcode, new(kind, initial(at), operand(which)) & kind.mask()),
                None if kind.is_float() => ("AtomicLoad", initial(at)),
                None => ("AtomicCompareExchange", operand(which)),
            };
            assert_eq!(memory[at], expected, "{opcode} of {name}, element {at}: {:#x}", initial(at));
            assert_eq!(old[at], initial(at), "{opcode} of {name}, element {at}");
        }
    }
}

#[test]
fn atomics_on_every_width_that_they_exist_for() {
    for kind in [Kind::I32, Kind::U32, Kind::I64, Kind::U64] {
        run(kind, ON_INTEGERS);
    }
    for kind in [Kind::F16, Kind::F32, Kind::F64] {
        run(kind, ON_FLOATS);
    }
}

#[test]
fn an_atomic_has_one_type() {
    let mut bodies = Vec::new();
    for kind in KINDS {
        for other in KINDS.into_iter().filter(|&other| other != kind) {
            let at = bodies.len();
            let [a, b] = [kind.name(), other.name()];
            bodies.push(format!(
                "%v{at} = OpVariable %function_{a} Function\n%r{at} = OpAtomicExchange %{a} %v{at} %one %zero %zero_{b}"
            ));
            bodies.push(format!(
                "%v{0} = OpVariable %function_{a} Function\n%r{0} = OpAtomicExchange %{b} %v{0} %one %zero %zero_{a}",
                at + 1
            ));
        }
    }
    assert_eq!(not_refused(&bodies), []);
}
