//! Selects superinstructions for the operations of a program.

use std::ops::Range;
use std::sync::LazyLock;

use rustc_hash::FxHashMap;

use crate::machine::Reg;
use crate::math::array;
use crate::ops::glsl;
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::op::Op;
use crate::ops::superop::function::{Function, PairShape, has_operand, opcode};
use crate::ops::superop::{Operands, SuperCode, SuperOp};

/// How the result of an operation is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResultUse {
    /// The number of reads, if all are by operations of the same superblock that name its register
    /// alone, and no other operation writes that register; else `None`.
    pub reads: Option<u32>,
    /// Whether an operation may observe the payload of a NaN: any that does not read it as a float.
    pub nan_payload_observed: bool,
}

impl ResultUse {
    /// The use of a result of which nothing is known.
    pub const UNKNOWN: Self = Self { reads: None, nan_payload_observed: true };
}

/// Whether an operation reads an operand as a float of 32 bits, so that it treats all NaNs alike.
pub fn takes_float(kernel: &'static LaneKernel, operand: usize) -> bool {
    // PackHalf2x16 keeps as many bits of a NaN's payload as fit.
    kernel.float_operands[operand] == 32 && !kernel.is(&glsl::parts::Half)
}

/// What a lane kernel computes, if it has an opcode or is a clamp.
#[derive(Clone, Copy)]
enum KnownFunction {
    Single(Function),
    Clamp([Function; 2]),
}

fn known_function(kernel: &'static LaneKernel) -> Option<KnownFunction> {
    static KNOWN: LazyLock<FxHashMap<usize, KnownFunction>> = LazyLock::new(|| {
        let single: FxHashMap<usize, Function> =
            Function::kernels().into_iter().map(|(kernel, function)| (address(kernel), function)).collect();
        let clamp = |kernel: &'static LaneKernel| {
            let [lower, upper] = glsl::clamp_parts(kernel)?
                .map(|part| single.get(&address(part.kernel(kernel.width)?)).copied());
            Some((address(kernel), KnownFunction::Clamp([lower?, upper?])))
        };
        let clamps = glsl::FAMILIES.iter().flat_map(|family| family.kernels).filter_map(clamp);
        single.iter().map(|(&at, &function)| (at, KnownFunction::Single(function))).chain(clamps).collect()
    });
    KNOWN.get(&address(kernel)).copied()
}

/// The address that identifies a lane kernel.
fn address(kernel: &'static LaneKernel) -> usize {
    std::ptr::from_ref(kernel) as usize
}

/// An operation, or a pair of them, for which a superinstruction is being selected.
#[derive(Clone, Copy)]
struct Planned {
    function: Function,
    to: u8,
    from: Operands<u8>,
    operands: usize,
    result_use: ResultUse,
    /// Whether the function reads its first operand twice.
    reads_first_twice: bool,
    /// Whether the result is a float that may be a NaN with any payload.
    float: bool,
    op: u32,
}

impl Planned {
    /// Plans an operation that becomes no superinstruction.
    fn other(at: usize, result_use: ResultUse) -> Self {
        let function = Function::Other;
        let from = Operands::default();
        Self {
            function,
            to: 0,
            from,
            operands: 0,
            result_use,
            reads_first_twice: false,
            float: false,
            op: at as u32,
        }
    }

    /// Whether it has an opcode that reads its constants as uniform operands while the operand
    /// `acc_operand`, counted from one, is in the accumulator (0 for none).
    fn is_uniform(&self, acc_operand: usize, constants: &Constants) -> bool {
        let (uniform, shift_amounts) = (self.function.uniform(), self.function.shift_amounts());
        let mut operands = self.from[..self.operands].iter().enumerate();
        uniform != 0
            && acc_operand < 2
            && operands.all(|(operand, &register)| {
                let limit = if has_operand(shift_amounts, operand) { 31 } else { u32::MAX };
                !has_operand(uniform, operand) || constants.word(register).is_some_and(|word| word <= limit)
            })
    }
}

/// The words of constants, indexed by register number.
struct Constants(Vec<Option<u32>>);

impl Constants {
    fn of(constants: &[(Reg, u32)]) -> Self {
        let direct = constants
            .iter()
            .filter_map(|&(reg, constant)| Some((usize::from(direct_register(reg)?), constant)));
        let mut words = vec![None; direct.clone().map(|(register, _)| register + 1).max().unwrap_or(0)];
        direct.for_each(|(register, constant)| words[register] = Some(constant));
        Self(words)
    }

    fn word(&self, register: u8) -> Option<u32> {
        self.0.get(usize::from(register)).copied().flatten()
    }
}

/// The value that the accumulator holds while superinstructions are selected.
struct AccumulatorState {
    /// The register whose value it is.
    register: u8,
    /// The superinstruction that computed it and the number of reads of the value, where these are
    /// known.
    result: Option<(usize, u32)>,
    /// How many reads were from the accumulator.
    accumulator_reads: u32,
}

impl SuperCode {
    /// Selects superinstructions for the operations. `superblocks` are their ranges; no operation
    /// writes the registers of `constants`, which every batch has in all lanes.
    pub fn of(
        ops: &[Op],
        superblocks: impl IntoIterator<Item = Range<usize>>,
        uses: &[ResultUse],
        constants: &[(Reg, u32)],
    ) -> Self {
        let mut code = Self::default();
        let constants = Constants::of(constants);
        let mut planned = Vec::new();
        for superblock in superblocks {
            for at in superblock {
                plan(at, &ops[at], uses[at], &constants, &mut planned);
            }
            let mut held = None;
            planned.drain(..).for_each(|planned| code.add(planned, &mut held, &constants));
            code.release_accumulator(held);
        }
        let mut first = 0;
        code.first = (0..=ops.len() as u32)
            .map(|op| {
                while code.op_of.get(first).is_some_and(|&of| of < op) {
                    first += 1;
                }
                first as u32
            })
            .collect();
        code
    }

    fn add(&mut self, mut planned: Planned, held: &mut Option<AccumulatorState>, constants: &Constants) {
        let mut acc_operand = 0;
        if let Some(held) = held {
            let operands = &mut planned.from[..planned.operands];
            if planned.function.commutes() && operands[0] != held.register && operands[1] == held.register {
                operands.swap(0, 1);
            }
            // A chain has the accumulator as its first operand, or reads only registers.
            let candidates = if operands.len() > 3 { &operands[..1] } else { operands };
            if let Some(index) = candidates.iter().position(|&register| register == held.register) {
                acc_operand = index + 1;
                held.accumulator_reads += if planned.reads_first_twice && index == 0 { 2 } else { 1 };
            }
        }
        if let (Function::FMul, 1, [a, b, ..], Some(held)) =
            (planned.function, acc_operand, planned.from, held.as_mut())
            && a == b
        {
            // Both operands are the accumulator: the product is a square.
            (planned.function, planned.operands) = (Function::Square, 1);
            held.accumulator_reads += 1;
        }
        let function = planned.function;
        if let (Function::MoveMasked, 1, Some(held)) = (function, acc_operand, held.as_mut())
            && held.result.is_some_and(|(_, reads)| reads == held.accumulator_reads)
            && let Some(last) = self.superops.last_mut()
            && last.opcode == opcode(Function::CanonicalizeNan, false, 1, true)
        {
            // The canonicalized value has no other use: its register is not written.
            *last = SuperOp {
                opcode: opcode(Function::CanonicalizeNanMasked, false, 1, true),
                to: planned.to,
                ..*last
            };
            held.result = None;
            return;
        }
        let observed = planned.float && planned.result_use.nan_payload_observed;
        let code = opcode(function, planned.is_uniform(acc_operand, constants), acc_operand, !observed);
        self.push(SuperOp { opcode: code, to: planned.to, from: planned.from }, planned.op);
        if observed {
            let canonicalize = SuperOp {
                opcode: opcode(Function::CanonicalizeNan, false, 1, true),
                to: planned.to,
                from: planned.from,
            };
            self.push(canonicalize, planned.op);
        }
        match function {
            Function::Other => self.release_accumulator(held.take()),
            // The accumulator is no copy of the register, whose inactive lanes keep their values.
            Function::MoveMasked => {
                if acc_operand == 0 {
                    self.release_accumulator(held.take());
                    *held = Some(AccumulatorState {
                        register: planned.from[0],
                        result: None,
                        accumulator_reads: 0,
                    });
                }
            }
            _ => {
                self.release_accumulator(held.take());
                let superop = self.superops.len() - 1;
                *held = Some(AccumulatorState {
                    register: planned.to,
                    result: planned.result_use.reads.map(|reads| (superop, reads)),
                    accumulator_reads: 0,
                });
            }
        }
    }

    fn push(&mut self, superop: SuperOp, op: u32) {
        self.superops.push(superop);
        self.op_of.push(op);
    }

    /// Replaces the accumulator's value: the old one is not stored if all its reads were from the
    /// accumulator.
    fn release_accumulator(&mut self, held: Option<AccumulatorState>) {
        if let Some(AccumulatorState { result: Some((superop, reads)), accumulator_reads, .. }) = held
            && reads == accumulator_reads
        {
            self.superops[superop].opcode &= !1;
        }
    }
}

/// Appends the functions of an operation: none if it does nothing, two if it is a clamp.
fn plan(at: usize, op: &Op, result_use: ResultUse, constants: &Constants, planned: &mut Vec<Planned>) {
    let known = match op {
        _ if op.is_noop() => return,
        Op::LaneKernel { kernel, .. } => known_function(kernel),
        _ => op.copy().map(|copy| {
            KnownFunction::Single(if copy.is_masked { Function::MoveMasked } else { Function::Move })
        }),
    };
    let result = match known {
        Some(KnownFunction::Single(function)) => {
            plan_single(at, op, function, result_use, constants).map(|one| push(planned, one))
        }
        Some(KnownFunction::Clamp(both)) => plan_clamp(at, op, both, result_use).map(|both| {
            both.into_iter().for_each(|one| push(planned, one));
        }),
        None => None,
    };
    if result.is_none() {
        push(planned, Planned::other(at, result_use));
    }
}

/// The number of a direct register, as superinstructions name it.
fn direct_register(reg: Reg) -> Option<u8> {
    u8::try_from(reg.0).ok()
}

fn plan_clamp(
    at: usize,
    op: &Op,
    [lower, upper]: [Function; 2],
    result_use: ResultUse,
) -> Option<[Planned; 2]> {
    let Op::LaneKernel { kernel, to, from } = op else { return None };
    let (to, [a, low, high]) = (direct_register(*to)?, from.map(direct_register));
    let (a, low, high) = (a?, low?, high?);
    if to == high {
        return None;
    }
    let float = kernel.float_result == 32;
    let half = |function, from, result_use| Planned {
        function,
        to,
        from: operands(from),
        operands: 2,
        result_use,
        reads_first_twice: false,
        float,
        op: at as u32,
    };
    let inner = ResultUse { reads: Some(1), nan_payload_observed: false };
    Some([half(lower, [a, low, low], inner), half(upper, [to, high, high], result_use)])
}

fn plan_single(
    at: usize,
    op: &Op,
    function: Function,
    result_use: ResultUse,
    constants: &Constants,
) -> Option<Planned> {
    let (to, from, operands, float) = match op {
        Op::LaneKernel { kernel, to, from } => {
            let operands = kernel.operands.iter().take_while(|&&words| words > 0).count();
            let [a, b, c] =
                array::map([from[0], from[1.min(operands - 1)], from[2.min(operands - 1)]], direct_register);
            (direct_register(*to)?, [a?, b?, c?], operands, kernel.float_result == 32)
        }
        _ => {
            let copy = op.copy()?;
            (direct_register(copy.to)?, [direct_register(copy.from)?; 3], 1, false)
        }
    };
    // Conversions of integers, and `Step`, give no NaN.
    let float = float && !matches!(function, Function::UToF | Function::SToF | Function::Step);
    let mut from = self::operands(from);
    // Opcodes with a uniform operand have it as the second one.
    if function.commutes() && constants.word(from[0]).is_some() && constants.word(from[1]).is_none() {
        from.swap(0, 1);
    }
    Some(Planned { function, to, from, operands, result_use, reads_first_twice: false, float, op: at as u32 })
}

/// The operands of a lane kernel, padded to the number that a superinstruction has.
fn operands([a, b, c]: [u8; 3]) -> Operands<u8> {
    [a, b, c, c, c, c]
}

/// Appends an operation, after merging it with those before it that form a known pair with it.
fn push(planned: &mut Vec<Planned>, mut last: Planned) {
    while let Some(both) = planned.last().and_then(|first| pair(first, &last)) {
        planned.pop();
        last = both;
    }
    planned.push(last);
}

/// Merges two operations, if they are a known pair and the first one's result has no other use.
fn pair(first: &Planned, second: &Planned) -> Option<Planned> {
    let mut pairs = Function::PAIRS
        .iter()
        .filter(|known| known.0 == first.function && known.1 == second.function)
        .peekable();
    pairs.peek()?;
    let found = |wanted: PairShape| pairs.clone().find(|known| known.2 == wanted);
    let reads = second.from[..second.operands].iter().filter(|&&register| register == first.to).count();
    if reads != 1 {
        return None;
    }
    // The operands of the second, except for the first one's result, follow those of the first.
    let chain = |function, others: &[u8]| {
        let mut from = first.from;
        let operands = first.operands + others.len();
        from[first.operands..operands].copy_from_slice(others);
        Some(Planned { function, from, operands, reads_first_twice: first.reads_first_twice, ..*second })
    };
    let [mut next, others @ ..] = second.from;
    let (mut others, last) = (others, second.operands - 1);
    if second.function.commutes() && others[0] == first.to {
        (next, others[0]) = (others[0], next);
    }
    if next == first.to
        && first.result_use.reads == Some(if second.reads_first_twice { 2 } else { 1 })
        && let Some(known) = found(PairShape::Chain)
    {
        return chain(known.3, &others[..last]);
    }
    if second.from[last] == first.to
        && first.result_use.reads == Some(1)
        && let Some(known) = found(PairShape::Last)
    {
        return chain(known.3, &second.from[..last]);
    }
    if first.result_use.reads != Some(1) || second.operands != 2 {
        return None;
    }
    let [a, b, ..] = first.from;
    let [mut c, mut d, ..] = second.from;
    if second.function.commutes() && d == first.to {
        (c, d) = (d, c);
    }
    let mut reads_first_twice = first.reads_first_twice;
    let (function, from, operands) = if c == first.to {
        let with_itself = found(PairShape::WithItself).filter(|_| d == a && second.function.commutes());
        match (with_itself, found(PairShape::Then), found(PairShape::ThenWith)) {
            (Some(known), ..) => {
                reads_first_twice = true;
                (known.3, [a, b, b], 2)
            }
            (None, Some(known), _) => (known.3, [a, b, d], 3),
            (None, None, Some(known)) => (known.3, [a, d, d], 2),
            _ => return None,
        }
    } else {
        (found(PairShape::After)?.3, [a, b, c], 3)
    };
    Some(Planned { function, from: self::operands(from), operands, reads_first_twice, ..*second })
}

#[cfg(test)]
mod tests;
