//! Checks superinstructions against the operations that they stand for, by executing both
//! symbolically.

use std::ops::Range;
use std::sync::LazyLock;

use rustc_hash::FxHashMap;

use crate::machine::Reg;
use crate::math::array;
use crate::ops::access::Access;
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::op::Op;
use crate::ops::superop::function::{Function, PairShape, has_operand};
use crate::ops::superop::{SuperCode, SuperOp, takes_float};
use crate::ops::symbolic::{State, ValueNumber, ValueTable};

/// The symbolic value of a register or the accumulator while superinstructions run.
#[derive(Clone, Copy, Debug)]
struct SymbolicWord {
    value: ValueNumber,
    /// Whether a NaN in it is the canonical one.
    canonical: bool,
}

/// The function with a number.
fn function(number: u16) -> Option<Function> {
    static FUNCTIONS: LazyLock<FxHashMap<u16, Function>> =
        LazyLock::new(|| functions().map(|function| (function as u16, function)).collect());
    FUNCTIONS.get(&number).copied()
}

fn functions() -> impl Iterator<Item = Function> {
    let special = [
        Function::Move,
        Function::MoveMasked,
        Function::CanonicalizeNan,
        Function::CanonicalizeNanMasked,
        Function::Square,
        Function::Other,
    ];
    let kernels = Function::kernels().into_iter().map(|(_, function)| function);
    let pairs = Function::PAIRS.iter().map(|pair| pair.3);
    special.into_iter().chain(kernels).chain(pairs)
}

/// How many operands a function has.
fn operand_count(function: Function) -> usize {
    if let Some(kernel) = kernel(function) {
        return kernel.operands.iter().take_while(|&&words| words > 0).count();
    }
    match Function::PAIRS.iter().find(|pair| pair.3 == function) {
        Some(&(first, second, shape, _)) => match shape {
            PairShape::Then | PairShape::After => 3,
            PairShape::ThenWith | PairShape::WithItself => 2,
            PairShape::Chain | PairShape::Last => operand_count(first) + operand_count(second) - 1,
        },
        None => 1,
    }
}

fn kernel(function: Function) -> Option<&'static LaneKernel> {
    static KERNELS: LazyLock<Vec<(&'static LaneKernel, Function)>> = LazyLock::new(Function::kernels);
    KERNELS.iter().find(|&&(_, known)| known == function).map(|&(kernel, _)| kernel)
}

/// Applies a function to symbolic operands.
fn calculate(
    function: Function,
    from: &[SymbolicWord],
    table: &mut ValueTable,
) -> Result<SymbolicWord, String> {
    if let Some(kernel) = kernel(function) {
        for (at, held) in from.iter().enumerate() {
            if !held.canonical && !takes_float(kernel, at) {
                return Err(format!("{kernel:?} sees the bits of a NaN"));
            }
        }
        let values: Vec<ValueNumber> = from.iter().map(|held| held.value).collect();
        let is_number = matches!(function, Function::UToF | Function::SToF | Function::Step);
        let canonical = kernel.float_result != 32 || is_number;
        return Ok(SymbolicWord { value: table.regular(kernel, 0, &values), canonical });
    }
    if function == Function::Square {
        return calculate(Function::FMul, &[from[0], from[0]], table);
    }
    let pair = Function::PAIRS.iter().find(|pair| pair.3 == function);
    let &(first, second, shape, _) = pair.ok_or_else(|| format!("{function:?} is no pair"))?;
    let (own, others) = from.split_at(operand_count(first));
    let inner = calculate(first, own, table)?;
    let operands: Vec<SymbolicWord> = match shape {
        PairShape::Then | PairShape::ThenWith | PairShape::Chain => [&[inner][..], others].concat(),
        PairShape::After | PairShape::Last => [others, &[inner]].concat(),
        PairShape::WithItself => vec![own[0], inner],
    };
    calculate(second, &operands, table)
}

/// Executes a range of operations both ways, symbolically, and compares the results.
struct SuperopChecker<'a, 'b> {
    ops: &'a [Op],
    table: &'b mut ValueTable,
    expected: State<'a>,
    /// The registers that superinstructions and the operations between them have written.
    found: FxHashMap<Reg, SymbolicWord>,
    begin: State<'a>,
    is_observed: &'b dyn Fn(Reg) -> bool,
    accumulator: Option<SymbolicWord>,
    next: usize,
}

impl SuperCode {
    /// Compares the superops of a straight-line range of operations with the operations themselves.
    /// The registers must hold the same values before each operation that is no superop, and after
    /// the range in all registers that `is_observed` names. `begin` is the state before the range.
    ///
    /// # Errors
    /// Returns the first difference.
    pub fn verify(
        &self,
        ops: &[Op],
        range: Range<usize>,
        begin: &State<'_>,
        table: &mut ValueTable,
        is_observed: &dyn Fn(Reg) -> bool,
    ) -> Result<(), String> {
        let mut check = SuperopChecker {
            ops,
            table,
            expected: begin.clone(),
            found: FxHashMap::default(),
            begin: begin.clone(),
            is_observed,
            accumulator: None,
            next: range.start,
        };
        let [first, end] = array::map([range.start, range.end], |op| self.first[op] as usize);
        for (superop, &op) in self.superops[first..end].iter().zip(&self.op_of[first..end]) {
            let number = superop.opcode >> 4;
            let function = function(number).ok_or_else(|| format!("no function has number {number}"))?;
            let done = match function {
                Function::Other => check.other(op as usize),
                _ => check.superop(superop, function),
            };
            done.map_err(|problem| {
                format!("operation {op} ({:?}), {function:?}: {problem}", ops[op as usize])
            })?;
        }
        check.expect_up_to(range.end);
        let mut written: Vec<Reg> = check.found.keys().copied().collect();
        for op in &ops[range] {
            op.accesses(|access| {
                if let Access::Write(first, count) = access {
                    written.extend((first.0..first.0 + count).map(Reg));
                }
            });
        }
        written.sort_unstable();
        written.dedup();
        written
            .into_iter()
            .filter(|&reg| is_observed(reg))
            .try_for_each(|reg| check.expect_register(reg, true))
    }
}

impl SuperopChecker<'_, '_> {
    /// Executes the operations up to `end`.
    fn expect_up_to(&mut self, end: usize) {
        for op in &self.ops[self.next..end] {
            self.expected.execute(op, self.table);
        }
        self.next = end;
    }

    fn get(&mut self, reg: Reg) -> SymbolicWord {
        match self.found.get(&reg) {
            Some(&held) => held,
            None => SymbolicWord { value: self.begin.get(reg, self.table), canonical: true },
        }
    }

    /// Checks that a register holds the expected value.
    fn expect_register(&mut self, reg: Reg, nan_payload_observed: bool) -> Result<(), String> {
        let expected = self.expected.get(reg, self.table);
        let found = self.get(reg);
        if expected != found.value {
            let [expected, found] = self.table.difference(expected, found.value);
            return Err(format!("r{} holds {found}, not {expected}", reg.0));
        }
        match found.canonical || !nan_payload_observed {
            true => Ok(()),
            false => Err(format!("r{} holds a NaN of any pattern", reg.0)),
        }
    }

    /// Executes an operation that is no superop: the registers that it reads must hold the expected
    /// values.
    fn other(&mut self, at: usize) -> Result<(), String> {
        self.expect_up_to(at);
        let op = &self.ops[at];
        let mut reads: Vec<(Reg, bool)> = Vec::new();
        if let Op::LaneKernel { kernel, from, .. } = op {
            for (operand, (&reg, &words)) in from.iter().zip(&kernel.operands).enumerate() {
                reads.extend((0..words).map(|word| (reg.plus(word), !takes_float(kernel, operand))));
            }
        } else {
            op.accesses(|access| {
                if let Access::Read(first, count) = access {
                    reads.extend((first.0..first.0 + count).map(|reg| (Reg(reg), true)));
                }
            });
        }
        if !matches!(op, Op::LaneKernel { .. }) {
            // An irregular operation may read registers that it does not name.
            let is_observed = self.is_observed;
            reads.extend(self.found.keys().filter(|&&reg| is_observed(reg)).map(|&reg| (reg, true)));
        }
        reads
            .into_iter()
            .try_for_each(|(reg, nan_payload_observed)| self.expect_register(reg, nan_payload_observed))?;
        self.expect_up_to(at + 1);
        let mut written: Vec<Reg> = Vec::new();
        op.accesses(|access| {
            if let Access::Write(first, count) = access {
                written.extend((first.0..first.0 + count).map(Reg));
            }
        });
        if !matches!(op, Op::LaneKernel { .. }) {
            let implicit = self.expected.implicit();
            written.extend(implicit.addressed.iter().chain(&implicit.written_by_pipeline));
        }
        for reg in written {
            let value = self.expected.get(reg, self.table);
            self.found.insert(reg, SymbolicWord { value, canonical: true });
        }
        self.accumulator = None;
        Ok(())
    }

    fn superop(&mut self, superop: &SuperOp, function: Function) -> Result<(), String> {
        let (uniform, at, stored) =
            (superop.opcode >> 3 & 1 == 1, usize::from(superop.opcode >> 1 & 3), superop.opcode & 1 == 1);
        let held = |check: &Self| check.accumulator.ok_or("the accumulator holds nothing".to_owned());
        let to = Reg(superop.to.into());
        match function {
            Function::MoveMasked | Function::CanonicalizeNanMasked => {
                let mut held = match at {
                    0 => self.get(Reg(superop.from[0].into())),
                    _ => held(self)?,
                };
                held.canonical |= function == Function::CanonicalizeNanMasked;
                self.accumulator = Some(held);
                self.found.insert(to, held);
                return Ok(());
            }
            Function::CanonicalizeNan => {
                let held = SymbolicWord { canonical: true, ..held(self)? };
                self.accumulator = Some(held);
                if stored {
                    self.found.insert(to, held);
                }
                return Ok(());
            }
            _ => {}
        }
        let count = operand_count(function);
        let mut from = Vec::new();
        for operand in 0..count {
            let reg = Reg(superop.from[operand].into());
            if uniform && has_operand(function.uniform(), operand) {
                let value = self.get(reg).value;
                let word = self.table.word_of(value);
                let word = word
                    .ok_or_else(|| format!("r{} is no constant but {}", reg.0, self.table.describe(value)))?;
                if has_operand(function.shift_amounts(), operand) && word > 31 {
                    return Err(format!("{word} is no amount to shift by"));
                }
            }
            from.push(if operand + 1 == at { held(self)? } else { self.get(reg) });
        }
        let result = match function {
            Function::Move => from[0],
            _ => calculate(function, &from, self.table)?,
        };
        self.accumulator = Some(result);
        if stored {
            self.found.insert(to, result);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
