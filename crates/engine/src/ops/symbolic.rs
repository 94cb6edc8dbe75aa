//! Symbolic execution of operations, for checks of the optimizer.
//!
//! The value of a register is an expression of the values that registers have where the code
//! begins. Equal expressions get equal numbers (hash-based value numbering), so that two sequences
//! of operations are compared by comparing numbers. The execution is that of one active lane: a
//! masked store is a store.

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::machine::Reg;
use crate::ops::access::{Access, RegCopy};
use crate::ops::conversion::{self, Conversion};
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::op::Op;
use crate::ops::{arithmetic, bit, glsl, relational_logical as logical};

/// The number of an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ValueNumber(u32);

/// The operands of an expression.
pub type Values = SmallVec<[ValueNumber; 4]>;

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Expression {
    /// The value of a register at the beginning.
    Initial(Reg),
    /// A register that has not been written.
    Undefined(Reg),
    Constant(u32),
    /// A word of the result of a regular operation, whose kernel is named by its address.
    Regular {
        kernel: usize,
        word: u32,
        operands: Values,
    },
    /// A word of the result of an irregular operation, after a number of effects.
    Irregular {
        op: u32,
        effects: u32,
        word: u32,
        operands: OperandList,
    },
}

/// The number of a list of operands: each word of a result that depends on thousands of registers
/// names them by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct OperandList(u32);

/// The value numbers of all expressions so far.
#[derive(Debug, Default)]
pub struct ValueTable {
    numbers: FxHashMap<Expression, ValueNumber>,
    expressions: Vec<Expression>,
    /// The numbers of lists of operands, and the lists.
    list_numbers: FxHashMap<Values, OperandList>,
    lists: Vec<Values>,
    /// The numbers of irregular operations, by their text without renamable registers.
    irregular: FxHashMap<String, u32>,
    /// The addresses of kernels that commute.
    commuting: Vec<usize>,
    /// The kernels in expressions, by address.
    kernels: FxHashMap<usize, &'static LaneKernel>,
}

impl ValueTable {
    /// Returns a table without expressions.
    pub fn new() -> Self {
        let families: [&'static crate::ops::lane_kernel::OpFamily; 18] = [
            &arithmetic::IAdd,
            &arithmetic::IMul,
            &arithmetic::FAdd,
            &arithmetic::FMul,
            &bit::BitwiseOr,
            &bit::BitwiseXor,
            &bit::BitwiseAnd,
            &logical::LogicalEqual,
            &logical::LogicalNotEqual,
            &logical::LogicalOr,
            &logical::LogicalAnd,
            &logical::IEqual,
            &logical::INotEqual,
            &logical::FOrdEqual,
            &logical::FUnordNotEqual,
            &glsl::UMin,
            &glsl::SMin,
            &glsl::UMax,
        ];
        let more = [&glsl::SMax, &logical::FOrdNotEqual];
        let kernels = families.into_iter().chain(more).flat_map(|family| family.kernels);
        let words = kernels.filter(|kernel| kernel.operands == [1, 1, 0] && kernel.words == 1);
        Self { commuting: words.map(address).collect(), ..Self::default() }
    }

    fn number(&mut self, expression: Expression) -> ValueNumber {
        if let Some(&known) = self.numbers.get(&expression) {
            return known;
        }
        let value = ValueNumber(self.expressions.len() as u32);
        self.expressions.push(expression.clone());
        self.numbers.insert(expression, value);
        value
    }

    /// The value of a register at the beginning.
    pub fn initial(&mut self, reg: Reg) -> ValueNumber {
        self.number(Expression::Initial(reg))
    }

    /// The value of a register that has not been written.
    pub fn undefined(&mut self, reg: Reg) -> ValueNumber {
        self.number(Expression::Undefined(reg))
    }

    /// A word known before running.
    pub fn constant(&mut self, word: u32) -> ValueNumber {
        self.number(Expression::Constant(word))
    }

    /// The word of a constant.
    pub fn word_of(&self, value: ValueNumber) -> Option<u32> {
        match self.expressions[value.0 as usize] {
            Expression::Constant(word) => Some(word),
            _ => None,
        }
    }

    /// A word of the result of a regular operation.
    pub fn regular(
        &mut self,
        kernel: &'static LaneKernel,
        word: u32,
        operands: &[ValueNumber],
    ) -> ValueNumber {
        let (mut kernel, mut operands) = (kernel, Values::from_slice(operands));
        // A clamp is a minimum of a maximum.
        if let (Some([lower, upper]), 1, [a, low, high]) =
            (glsl::clamp_parts(kernel), kernel.words, &operands[..])
            && let (Some(lower), Some(upper)) = (lower.kernel(kernel.width), upper.kernel(kernel.width))
        {
            let (low, high) = ([*a, *low], *high);
            let inner = self.regular(lower, 0, &low);
            return self.regular(upper, 0, &[inner, high]);
        }
        // A value that was shifted to the right by at least one bit is not negative.
        if let (Some(signed), Some(unsigned)) =
            (conversion::kernel(Conversion::SToF, 32, 32), conversion::kernel(Conversion::UToF, 32, 32))
            && kernel == signed
            && self.is_shifted_right(operands[0])
        {
            kernel = unsigned;
        }
        if self.commuting.contains(&address(kernel)) {
            operands[..2].sort_unstable();
        }
        self.kernels.insert(address(kernel), kernel);
        self.number(Expression::Regular { kernel: address(kernel), word, operands })
    }

    fn is_shifted_right(&self, value: ValueNumber) -> bool {
        let Expression::Regular { kernel, operands, .. } = &self.expressions[value.0 as usize] else {
            return false;
        };
        let shift = bit::ShiftRightLogical.kernel(32).map(address);
        shift == Some(*kernel) && self.word_of(operands[1]).is_some_and(|by| (1..32).contains(&by))
    }

    fn list(&mut self, operands: &Values) -> OperandList {
        if let Some(&known) = self.list_numbers.get(operands) {
            return known;
        }
        let number = OperandList(self.lists.len() as u32);
        self.lists.push(operands.clone());
        self.list_numbers.insert(operands.clone(), number);
        number
    }

    fn irregular(&mut self, op: u32, effects: u32, word: u32, operands: OperandList) -> ValueNumber {
        self.number(Expression::Irregular { op, effects, word, operands })
    }

    /// The first operands in which two expressions differ, for messages.
    pub fn difference(&self, one: ValueNumber, other: ValueNumber) -> [String; 2] {
        let [a, b] = [one, other].map(|value| &self.expressions[value.0 as usize]);
        let operands = match (a, b) {
            (
                Expression::Regular { kernel, word, operands },
                Expression::Regular { kernel: kernel2, word: word2, operands: operands2 },
            ) if (kernel, word) == (kernel2, word2) => Some((operands, operands2)),
            (
                Expression::Irregular { op, effects, word, operands },
                Expression::Irregular { op: op2, effects: effects2, word: word2, operands: operands2 },
            ) if (op, effects, word) == (op2, effects2, word2) => {
                Some((&self.lists[operands.0 as usize], &self.lists[operands2.0 as usize]))
            }
            _ => None,
        };
        let parts = operands.and_then(|(a, b)| a.iter().zip(b).find(|(a, b)| a != b));
        match parts {
            Some((&a, &b)) => self.difference(a, b),
            None => [one, other].map(|value| self.describe(value)),
        }
    }

    /// An expression for messages.
    pub fn describe(&self, value: ValueNumber) -> String {
        self.describe_to(value, 4)
    }

    fn describe_to(&self, value: ValueNumber, depth: u32) -> String {
        let list = |operands: &Values| {
            if depth == 0 {
                return "...".to_owned();
            }
            let each = operands.iter().take(4).map(|&operand| self.describe_to(operand, depth - 1));
            each.collect::<Vec<_>>().join(", ")
        };
        match &self.expressions[value.0 as usize] {
            Expression::Initial(reg) => format!("r{}", reg.0),
            Expression::Undefined(reg) => format!("undefined r{}", reg.0),
            Expression::Constant(word) => format!("{word:#x}"),
            Expression::Regular { kernel, operands, .. } => {
                format!("{:?}({})", self.kernels[kernel], list(operands))
            }
            Expression::Irregular { op, effects, word, operands } => {
                let name = self.irregular.iter().find(|(_, number)| *number == op);
                let name = name.map_or("?", |(name, _)| name);
                format!(
                    "word {word} of {name} behind {effects} effects ({})",
                    list(&self.lists[operands.0 as usize])
                )
            }
        }
    }
}

/// The address that identifies a kernel.
fn address(kernel: &'static LaneKernel) -> usize {
    std::ptr::from_ref(kernel) as usize
}

/// An effect: the operation without its registers, and what it reads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Effect {
    op: u32,
    /// The values that it reads.
    pub operands: Values,
}

/// Registers that operations read or write without naming them.
#[derive(Clone, Debug, Default)]
pub struct ImplicitRegisters {
    /// The registers of variables with computed indices.
    pub addressed: Vec<Reg>,
    /// The registers of payloads, callable data and hit attributes, which the pipeline reads where
    /// a batch stops.
    pub read_by_pipeline: Vec<Reg>,
    /// The registers of those, of other interface variables and of builtins, which the pipeline may
    /// write there.
    pub written_by_pipeline: Vec<Reg>,
}

/// A symbolic state: the values of registers, and the effects so far.
#[derive(Clone)]
#[allow(missing_debug_implementations, reason = "it borrows a closure")]
pub struct State<'a> {
    registers: FxHashMap<Reg, ValueNumber>,
    /// The value of a register that has not been written.
    begin: &'a dyn Fn(Reg, &mut ValueTable) -> ValueNumber,
    implicit: &'a ImplicitRegisters,
    /// The effects so far, in order.
    pub effects: Vec<Effect>,
    /// Registers that regular operations and plain moves have written, in all lanes.
    pub written_in_all_lanes: Vec<Reg>,
}

impl<'a> State<'a> {
    /// Returns the state before the first operation.
    pub fn new(
        begin: &'a dyn Fn(Reg, &mut ValueTable) -> ValueNumber,
        implicit: &'a ImplicitRegisters,
    ) -> Self {
        Self {
            registers: FxHashMap::default(),
            begin,
            implicit,
            effects: Vec::new(),
            written_in_all_lanes: Vec::new(),
        }
    }

    /// The value of a register.
    pub fn get(&mut self, reg: Reg, table: &mut ValueTable) -> ValueNumber {
        *self.registers.entry(reg).or_insert_with(|| (self.begin)(reg, table))
    }

    /// Registers that operations read or write without naming them.
    pub fn implicit(&self) -> &'a ImplicitRegisters {
        self.implicit
    }

    /// Writes a register.
    pub fn set(&mut self, reg: Reg, value: ValueNumber) {
        self.registers.insert(reg, value);
    }

    fn read(&mut self, first: Reg, count: u32, table: &mut ValueTable, to: &mut Values) {
        for word in 0..count {
            to.push(self.get(first.plus(word), table));
        }
    }

    /// Executes an operation.
    pub fn execute(&mut self, op: &Op, table: &mut ValueTable) {
        let mut operands = Values::new();
        match op {
            Op::LaneKernel { kernel, to, from } => {
                for (&reg, &words) in from.iter().zip(&kernel.operands) {
                    self.read(reg, words, table, &mut operands);
                }
                for word in 0..kernel.words {
                    let value = table.regular(kernel, word, &operands);
                    self.set(to.plus(word), value);
                    self.written_in_all_lanes.push(to.plus(word));
                }
            }
            _ => match op.copy() {
                Some(RegCopy { to, from, is_masked }) => {
                    let value = self.get(from, table);
                    self.set(to, value);
                    if !is_masked && to != from {
                        self.written_in_all_lanes.push(to);
                    }
                }
                None => self.execute_irregular(op, table),
            },
        }
    }

    fn execute_irregular(&mut self, op: &Op, table: &mut ValueTable) {
        let implicit = self.implicit;
        let key = key(op, table);
        let mut operands = Values::new();
        let mut writes: SmallVec<[(Reg, u32); 2]> = SmallVec::new();
        let mut effect = false;
        let mut reads: SmallVec<[(Reg, u32); 4]> = SmallVec::new();
        op.accesses(|access| match access {
            Access::Read(first, count) => reads.push((first, count)),
            Access::Write(first, count) => writes.push((first, count)),
            Access::Effect => effect = true,
        });
        reads.iter().for_each(|&(first, count)| self.read(first, count, table, &mut operands));
        let (reads_addressed, writes_addressed) = op.reaches_addressed();
        if reads_addressed {
            implicit.addressed.iter().for_each(|&reg| self.read(reg, 1, table, &mut operands));
        }
        if op.stops() {
            implicit.read_by_pipeline.iter().for_each(|&reg| self.read(reg, 1, table, &mut operands));
        }
        let effects = self.effects.len() as u32;
        let list = table.list(&operands);
        let mut word = 0;
        for (first, count) in writes {
            for reg in first.0..first.0 + count {
                self.set(Reg(reg), table.irregular(key, effects, word, list));
                word += 1;
            }
        }
        let mut changes = |regs: &[Reg], state: &mut Self| {
            for &reg in regs {
                state.set(reg, table.irregular(key, effects, word, list));
                word += 1;
            }
        };
        if writes_addressed {
            changes(&implicit.addressed, self);
        }
        if op.stops() {
            changes(&implicit.written_by_pipeline, self);
        }
        if effect {
            self.effects.push(Effect { op: key, operands });
        }
    }
}

/// The number of an irregular operation, without the registers that register allocation may rename.
fn key(op: &Op, table: &mut ValueTable) -> u32 {
    const ANY: Reg = Reg(0);
    let mut plain = op.clone();
    plain.visit_single_registers(|reg, _| *reg = ANY);
    let next = table.irregular.len() as u32;
    *table.irregular.entry(format!("{plain:?}")).or_insert(next)
}
