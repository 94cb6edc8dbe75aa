//! What instructions there are, and numbers of enumerants.

use std::collections::HashMap;
use std::sync::LazyLock;

use rspirv::grammar::{INSTRUCTION_TABLE, LogicalOperand, OperandKind, OperandQuantifier};
use rspirv::spirv::Op;

use super::Random;

pub(super) fn storage_class(random: &mut Random) -> u32 {
    const ALL: &[u32] = &[0, 1, 2, 3, 4, 6, 7, 9, 11, 12, 5328, 5329, 5338, 5339, 5342, 5343, 5349, 5385];
    ALL[random.below(ALL.len())]
}

pub(super) fn decoration(random: &mut Random) -> u32 {
    const ALL: &[u32] = &[
        0, 1, 2, 3, 4, 5, 6, 7, 11, 13, 14, 18, 19, 20, 21, 23, 24, 25, 26, 29, 30, 31, 33, 34, 35, 36, 39,
        40, 42, 44, 5300, 5355, 5356, 5386,
    ];
    ALL[random.below(ALL.len())]
}

/// One of several, seldom with an opcode that no Vulkan device offers.
pub(super) fn usual<T: Copy>(random: &mut Random, all: &[T], op: impl Fn(&T) -> Op) -> Option<T> {
    const RARE: &[&str] =
        &["Tensor", "Cooperative", "Graph", "Pipe", "Enqueue", "SubgroupAvc", "Kernel", "Event", "Untyped"];
    let rare = |one: &T| {
        let name = name(op(one));
        ["INTEL", "ARM", "ALTERA"].iter().any(|end| name.ends_with(end))
            || RARE.iter().any(|part| name.contains(part))
    };
    for _ in 0..20 {
        let one = random.pick(all)?;
        if !rare(one) || random.below(20) == 0 {
            return Some(*one);
        }
    }
    None
}

/// An opcode's name without its `Op`.
pub(super) fn name(op: Op) -> &'static str {
    static NAMES: LazyLock<HashMap<u32, &'static str>> =
        LazyLock::new(|| INSTRUCTION_TABLE.iter().map(|one| (one.opcode as u32, one.opname)).collect());
    NAMES.get(&(op as u32)).copied().unwrap_or("")
}

/// The opcodes with a result type whose operands are so many ids and nothing else.
pub(super) fn computing() -> &'static [(Op, usize)] {
    static ALL: LazyLock<Vec<(Op, usize)>> = LazyLock::new(|| {
        let plain = |operand: &LogicalOperand| {
            matches!(operand.kind, OperandKind::IdRef | OperandKind::IdScope | OperandKind::IdMemorySemantics)
                && operand.quantifier == OperandQuantifier::One
        };
        let computes = |operands: &[LogicalOperand]| {
            operands.len() > 2
                && operands[0].kind == OperandKind::IdResultType
                && operands[1].kind == OperandKind::IdResult
                && operands[2..].iter().all(plain)
        };
        let all = INSTRUCTION_TABLE.iter().filter(|one| computes(one.operands));
        all.map(|one| (one.opcode, one.operands.len() - 2)).collect()
    });
    &ALL
}

/// The other opcodes whose operands are of the same kinds.
pub(super) fn same_shape(op: Op) -> &'static [Op] {
    static ALL: LazyLock<HashMap<u32, Vec<Op>>> = LazyLock::new(|| {
        let mut by_shape: HashMap<String, Vec<Op>> = HashMap::new();
        let exits = [
            Op::Return,
            Op::Unreachable,
            Op::Kill,
            Op::IgnoreIntersectionKHR,
            Op::TerminateRayKHR,
            Op::TerminateInvocation,
        ];
        for one in INSTRUCTION_TABLE.iter() {
            let shape = match one.operands.first() {
                Some(first) if first.kind == OperandKind::IdResultType => format!("{:?}", one.operands),
                _ if exits.contains(&one.opcode) => "exit".to_owned(),
                _ => continue,
            };
            by_shape.entry(shape).or_default().push(one.opcode);
        }
        let mut all = HashMap::new();
        for alike in by_shape.values() {
            for op in alike {
                all.insert(*op as u32, alike.iter().copied().filter(|other| other != op).collect());
            }
        }
        all
    });
    ALL.get(&(op as u32)).map_or(&[], Vec::as_slice)
}
