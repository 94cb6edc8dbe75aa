//! What becomes of payloads: which words a shader reads of one behind the instruction that traces,
//! and what a shader leaves but its payload. Whether a closest-hit or miss shader ran cannot be
//! observed where it leaves nothing else, and of its payload only words that are not read.

use crate::machine::stop::RegSpan;
use crate::machine::{Exit, Reg};
use crate::ops::memory;
use crate::ops::op::{Access, Op};
use crate::ops::pointer::storage;
use crate::ops::ray_tracing;
use crate::program::copy_propagation::each_read;
use crate::program::{Block, Program, Terminator};

/// Words of a payload, as bits; the highest stands for all that have no bit of their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PayloadWords(u64);

impl PayloadWords {
    /// All words of a payload.
    pub const ALL: Self = Self(u64::MAX);

    /// Whether both have a word.
    pub fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// The words of a payload that lie in some registers.
    fn of(payload: RegSpan, first: Reg, count: u32) -> Self {
        let from = first.0.max(payload.first.0);
        let to = (first.0 + count).min(payload.first.0 + payload.count);
        let bit = |register: u32| 1 << (register - payload.first.0).min(63);
        Self((from..to).map(bit).fold(0, |words, bit: u64| words | bit))
    }

    fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Less what is written; the highest bit stays, as it stands for several words.
    fn without(self, other: Self) -> Self {
        Self(self.0 & !(other.0 & !(1 << 63)))
    }
}

/// What a program does with payloads.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Payloads {
    /// The words of its own payload that it may write, where it leaves nothing else behind whatever
    /// its inputs are: it stores nothing, calls no shader, and cannot trap.
    pub writes_only: Option<PayloadWords>,
    /// By operation that traces or executes a hit object, ascending: the words of its payload that
    /// may be read behind it.
    reads: Vec<(u32, PayloadWords)>,
}

impl Payloads {
    /// The words of the payload that may be read behind the operation that traces.
    pub fn reads_behind(&self, op: u32) -> PayloadWords {
        self.reads
            .binary_search_by_key(&op, |&(at, _)| at)
            .map_or(PayloadWords::ALL, |place| self.reads[place].1)
    }

    /// Looks at a program; `addressed` are registers that computed register numbers reach.
    pub fn of(program: &Program, addressed: &[(Reg, u32)]) -> Self {
        let tracing = program.ops.iter().enumerate().filter_map(|(at, op)| {
            let payload = match *op {
                Op::Stop(
                    ray_tracing::RayTracingOp::TraceRay { payload, .. }
                    | ray_tracing::RayTracingOp::HitObjectTrace { payload, .. }
                    | ray_tracing::RayTracingOp::HitObjectExecute { payload, .. },
                ) => payload,
                _ => return None,
            };
            Some((at as u32, payload))
        });
        let tracing: Vec<_> = tracing.collect();
        let mut payloads: Vec<RegSpan> = Vec::new();
        for (_, payload) in &tracing {
            if !payloads.contains(payload) {
                payloads.push(*payload);
            }
        }
        let mut reads = Vec::new();
        for payload in payloads {
            let behind = Liveness::of(program, payload, addressed);
            let of_it = tracing.iter().filter(|(_, other)| *other == payload);
            reads.extend(
                of_it.map(|&(op, _)| (op, behind.as_ref().map_or(PayloadWords::ALL, |all| all.behind(op)))),
            );
        }
        reads.sort_unstable_by_key(|&(op, _)| op);
        Self { writes_only: writes_only(program), reads }
    }
}

/// See [`Payloads::writes_only`].
fn writes_only(program: &Program) -> Option<PayloadWords> {
    let ends = |(at, block): (usize, &Block)| match &block.terminator {
        // Without back edges the program ends, however little fuel it has.
        Terminator::Branch(to) => *to as usize > at,
        Terminator::BranchConditional { then, other, .. } => (*then.min(other)) as usize > at,
        Terminator::Switch { cases, default, .. } => {
            cases.iter().map(|(_, to)| to).chain([default]).all(|to| *to as usize > at)
        }
        Terminator::Exit(Exit::Returned) => true,
        _ => false,
    };
    // What is computed from registers and goes to known registers. A load may trap.
    let harmless = |op: &Op| match op {
        Op::LaneKernel { .. } => true,
        Op::Memory(op) => {
            matches!(
                op,
                memory::MemoryOp::Move { .. }
                    | memory::MemoryOp::MoveMasked { .. }
                    | memory::MemoryOp::Index { .. }
            )
        }
        _ => false,
    };
    if !program.blocks.iter().enumerate().all(ends) || !program.ops.iter().all(harmless) {
        return None;
    }
    let Some(payload) = program.interface_registers(storage::INCOMING_RAY_PAYLOAD) else {
        return Some(PayloadWords::default());
    };
    let mut written = PayloadWords::default();
    for op in &program.ops {
        op.accesses(|access| {
            if let Access::Write(first, count) = access {
                written = written.with(PayloadWords::of(payload.span(), first, count));
            }
        });
    }
    Some(written)
}

/// Which words of a payload may be read from a place on.
struct Liveness<'a> {
    program: &'a Program,
    payload: RegSpan,
    /// By block, at its beginning.
    begins: Vec<PayloadWords>,
}

impl<'a> Liveness<'a> {
    /// `None` where reads of the payload cannot be told by their registers.
    fn of(program: &'a Program, payload: RegSpan, addressed: &[(Reg, u32)]) -> Option<Self> {
        let meets =
            |first: Reg, count: u32| PayloadWords::of(payload, first, count) != PayloadWords::default();
        for &(first, count) in addressed {
            // A computed index may reach every register of the variable.
            let holds =
                |&&(start, registers): &&(Reg, u32)| (start.0..start.0 + registers).contains(&first.0);
            let (first, count) = program.variables.iter().find(holds).copied().unwrap_or((first, count));
            if meets(first, count) {
                return None;
            }
        }
        let mut all = Self { program, payload, begins: vec![PayloadWords::default(); program.blocks.len()] };
        loop {
            let mut changed = false;
            for (at, block) in program.blocks.iter().enumerate().rev() {
                let begins = all.back(block.first..block.end, all.end(block));
                changed |= std::mem::replace(&mut all.begins[at], begins) != begins;
            }
            if !changed {
                return Some(all);
            }
        }
    }

    /// What may be read behind the end of a block.
    fn end(&self, block: &Block) -> PayloadWords {
        let begins = |block: &u32| self.begins[*block as usize];
        let mut words = match &block.terminator {
            Terminator::Branch(to) => begins(to),
            Terminator::BranchConditional { then, other, .. } => begins(then).with(begins(other)),
            Terminator::Switch { cases, default, .. } => {
                cases.iter().fold(begins(default), |words, (_, to)| words.with(begins(to)))
            }
            // The caller of this program reads the variable that it was given.
            Terminator::Exit(_) => {
                let own =
                    self.program.interface.iter().filter(|registers| is_handed_back(registers.storage_class));
                own.fold(PayloadWords::default(), |words, registers| {
                    words.with(PayloadWords::of(self.payload, registers.first, registers.count))
                })
            }
            Terminator::Unreachable => PayloadWords::default(),
            // Which call a function returns to is not followed.
            Terminator::Call { .. } | Terminator::Return => PayloadWords::ALL,
        };
        each_read(&block.terminator, |reg| words = words.with(PayloadWords::of(self.payload, reg, 1)));
        words
    }

    /// What may be read at the first of some operations, given what may be behind the last.
    fn back(&self, ops: std::ops::Range<u32>, behind: PayloadWords) -> PayloadWords {
        let ops = &self.program.ops[ops.start as usize..ops.end as usize];
        ops.iter().rev().fold(behind, |behind, op| {
            let (mut read, mut written) = (PayloadWords::default(), PayloadWords::default());
            op.accesses(|access| match access {
                Access::Read(first, count) => read = read.with(PayloadWords::of(self.payload, first, count)),
                Access::Write(first, count) => {
                    written = written.with(PayloadWords::of(self.payload, first, count))
                }
                Access::Effect => {}
            });
            behind.without(written).with(read)
        })
    }

    /// What may be read behind an operation.
    fn behind(&self, op: u32) -> PayloadWords {
        let blocks = &self.program.blocks;
        let Some(block) = blocks.iter().find(|block| (block.first..block.end).contains(&op)) else {
            return PayloadWords::ALL;
        };
        self.back(op + 1..block.end, self.end(block))
    }
}

/// Whether a shader's caller sees what is left in variables of a storage class.
fn is_handed_back(storage_class: u32) -> bool {
    matches!(storage_class, storage::INCOMING_RAY_PAYLOAD | storage::INCOMING_CALLABLE_DATA)
}
