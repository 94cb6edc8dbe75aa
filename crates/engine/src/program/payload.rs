//! Liveness of payloads: which words of a payload a shader reads after the instruction that traces,
//! and whether a shader has other outputs than its payload. A closest-hit or miss shader need not
//! run if it has no other output, and writes only payload words that are not read.

use std::ops::Range;

use crate::machine::stop::RegSpan;
use crate::machine::{BlockIndex, Exit, OpIndex, Reg};
use crate::ops::access::Access;
use crate::ops::op::Op;
use crate::ops::pointer::storage;
use crate::program::copy_propagation::for_each_terminator_read;
use crate::program::{Block, Program, Terminator};

/// A set of words of a payload, as bits; the highest bit stands for all words from the 64th on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PayloadWords(u64);

impl PayloadWords {
    /// All words of a payload.
    pub const ALL: Self = Self(u64::MAX);

    /// Whether both sets contain some word.
    pub fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// The words of a payload that are in a range of registers.
    fn of(payload: RegSpan, first: Reg, count: u32) -> Self {
        let from = first.0.max(payload.first.0);
        let to = (first.0 + count).min(payload.first.0 + payload.count);
        let bit = |register: u32| 1 << (register - payload.first.0).min(63);
        Self((from..to).map(bit).fold(0, |words, bit: u64| words | bit))
    }

    fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Without words that are written; the highest bit stays, as it stands for several words.
    fn without(self, other: Self) -> Self {
        Self(self.0 & !(other.0 & !(1 << 63)))
    }
}

/// What a program does with payloads.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Payloads {
    /// The words of its own payload that it may write, if it has no other output for any input: it
    /// stores nothing, calls no shader, and cannot trap.
    pub writes_only: Option<PayloadWords>,
    /// By operation that traces or executes a hit object, ascending: the words of its payload that
    /// may be read after it.
    reads: Vec<(OpIndex, PayloadWords)>,
}

impl Payloads {
    /// The words of its payload that may be read after an operation that traces.
    pub fn read_after(&self, op: OpIndex) -> PayloadWords {
        self.reads
            .binary_search_by_key(&op, |&(at, _)| at)
            .map_or(PayloadWords::ALL, |place| self.reads[place].1)
    }

    /// Analyses a program; `addressed` are registers that computed register numbers can address.
    pub fn of(program: &Program, addressed: &[(Reg, u32)]) -> Self {
        let tracing =
            program.ops.iter().enumerate().filter_map(|(at, op)| Some((OpIndex::new(at), op.ray_payload()?)));
        let tracing: Vec<_> = tracing.collect();
        let mut payloads: Vec<RegSpan> = Vec::new();
        for (_, payload) in &tracing {
            if !payloads.contains(payload) {
                payloads.push(*payload);
            }
        }
        let mut reads = Vec::new();
        for payload in payloads {
            let liveness = Liveness::of(program, payload, addressed);
            let of_it = tracing.iter().filter(|(_, other)| *other == payload);
            reads.extend(
                of_it.map(|&(op, _)| {
                    (op, liveness.as_ref().map_or(PayloadWords::ALL, |all| all.live_after(op)))
                }),
            );
        }
        reads.sort_unstable_by_key(|&(op, _)| op);
        Self { writes_only: writes_only(program), reads }
    }
}

/// Computes [`Payloads::writes_only`].
fn writes_only(program: &Program) -> Option<PayloadWords> {
    let ends = |(at, block): (usize, &Block)| match &block.terminator {
        // Without back edges the program ends, however little fuel it has.
        Terminator::Branch(to) => to.index() > at,
        Terminator::BranchConditional { then, other, .. } => then.min(other).index() > at,
        Terminator::Switch { cases, default, .. } => {
            cases.iter().map(|(_, to)| to).chain([default]).all(|to| to.index() > at)
        }
        Terminator::Exit(Exit::Returned) => true,
        _ => false,
    };
    // Operations that compute registers from registers. A load may trap.
    if !program.blocks.iter().enumerate().all(ends) || !program.ops.iter().all(Op::only_computes) {
        return None;
    }
    let Some(payload) = program.interface_registers(storage::INCOMING_RAY_PAYLOAD) else {
        return Some(PayloadWords::default());
    };
    let mut written = PayloadWords::default();
    for op in &program.ops {
        op.accesses(|access| {
            if let Access::Write(first, count) = access {
                written = written.union(PayloadWords::of(payload.span(), first, count));
            }
        });
    }
    Some(written)
}

/// Which words of a payload are live: may be read later.
struct Liveness<'a> {
    program: &'a Program,
    payload: RegSpan,
    /// By block: the words that are live at its beginning.
    live_in: Vec<PayloadWords>,
}

impl<'a> Liveness<'a> {
    /// `None` if computed register numbers can address the payload.
    fn of(program: &'a Program, payload: RegSpan, addressed: &[(Reg, u32)]) -> Option<Self> {
        let intersects =
            |first: Reg, count: u32| PayloadWords::of(payload, first, count) != PayloadWords::default();
        for &(first, count) in addressed {
            // A computed index may address every register of the variable.
            let holds =
                |&&(start, registers): &&(Reg, u32)| (start.0..start.0 + registers).contains(&first.0);
            let (first, count) = program.variables.iter().find(holds).copied().unwrap_or((first, count));
            if intersects(first, count) {
                return None;
            }
        }
        let mut all = Self { program, payload, live_in: vec![PayloadWords::default(); program.blocks.len()] };
        loop {
            let mut changed = false;
            for (at, block) in program.blocks.iter().enumerate().rev() {
                let live_in = all.transfer(block.ops(), all.live_out(block));
                changed |= std::mem::replace(&mut all.live_in[at], live_in) != live_in;
            }
            if !changed {
                return Some(all);
            }
        }
    }

    /// The words that are live at the end of a block.
    fn live_out(&self, block: &Block) -> PayloadWords {
        let live_in = |block: &BlockIndex| self.live_in[block.index()];
        let mut words = match &block.terminator {
            Terminator::Branch(to) => live_in(to),
            Terminator::BranchConditional { then, other, .. } => live_in(then).union(live_in(other)),
            Terminator::Switch { cases, default, .. } => {
                cases.iter().fold(live_in(default), |words, (_, to)| words.union(live_in(to)))
            }
            // The caller of this program reads the variable that it was given.
            Terminator::Exit(_) => {
                let own = self
                    .program
                    .interface
                    .iter()
                    .filter(|registers| is_returned_to_caller(registers.storage_class));
                own.fold(PayloadWords::default(), |words, registers| {
                    words.union(PayloadWords::of(self.payload, registers.first, registers.count))
                })
            }
            Terminator::Unreachable => PayloadWords::default(),
            // A return may go to any call.
            Terminator::Call { .. } | Terminator::Return => PayloadWords::ALL,
        };
        for_each_terminator_read(&block.terminator, |reg| {
            words = words.union(PayloadWords::of(self.payload, reg, 1))
        });
        words
    }

    /// The transfer function of operations: the words that are live before the first, given those
    /// that are live after the last.
    fn transfer(&self, ops: Range<usize>, live_after: PayloadWords) -> PayloadWords {
        self.program.ops[ops].iter().rev().fold(live_after, |live_after, op| {
            let (mut read, mut written) = (PayloadWords::default(), PayloadWords::default());
            op.accesses(|access| match access {
                Access::Read(first, count) => read = read.union(PayloadWords::of(self.payload, first, count)),
                Access::Write(first, count) => {
                    written = written.union(PayloadWords::of(self.payload, first, count))
                }
                Access::Effect => {}
            });
            live_after.without(written).union(read)
        })
    }

    /// The words that are live after an operation.
    fn live_after(&self, op: OpIndex) -> PayloadWords {
        let blocks = &self.program.blocks;
        let Some(block) = blocks.iter().find(|block| (block.first..block.end).contains(&op)) else {
            return PayloadWords::ALL;
        };
        self.transfer(op.index() + 1..block.end.index(), self.live_out(block))
    }
}

/// Whether a shader's caller reads variables of a storage class when the shader returns.
fn is_returned_to_caller(storage_class: u32) -> bool {
    matches!(storage_class, storage::INCOMING_RAY_PAYLOAD | storage::INCOMING_CALLABLE_DATA)
}
