//! The meaning of a program, by walking its tree for one invocation after the other.

use std::cell::Cell;

use crate::execution::random_programs::program::{
    COMPONENTS, ELEMENTS, Function, INPUTS, OUTPUTS, Program, Real, Selector, Statement, Truth, VARIABLES,
    Vector, Wide, Word,
};

/// What all invocations leave in their outputs.
pub fn run(program: &Program, inputs: &[u32], invocations: usize) -> Vec<u32> {
    run_watched(program, inputs, invocations).0
}

/// As [`run`], and of each invocation whether a driver is no judge of it. It divides by a float
/// outside of 2^-126 to 2^126, as for those alone Vulkan says how exact `OpFDiv` is ("Precision of
/// Core SPIR-V Instructions"). It meets a subnormal number, which a driver that does not keep them
/// may take for zero. Or it divides a zero, whose sign Mesa loses.
pub fn run_watched(program: &Program, inputs: &[u32], invocations: usize) -> (Vec<u32>, Vec<bool>) {
    let (mut left, mut open) = (Vec::new(), Vec::new());
    for id in 0..invocations {
        let mut machine = Machine {
            program,
            inputs: &inputs[id * INPUTS..(id + 1) * INPUTS],
            outputs: [0; OUTPUTS],
            id: id as u32,
            open: Cell::new(false),
        };
        let main = program.functions.last().expect("an entry point");
        let mut pointed = 0;
        let result = machine.call(main, [0, 0], &mut pointed);
        machine.outputs[OUTPUTS - 1] ^= result;
        left.extend(machine.outputs);
        open.push(machine.open.get());
    }
    (left, open)
}

struct Machine<'a> {
    program: &'a Program,
    inputs: &'a [u32],
    outputs: [u32; OUTPUTS],
    id: u32,
    /// Whether a result was met that no driver judges.
    open: Cell<bool>,
}

/// The variables of a function that runs.
struct Frame<'a> {
    parameters: [u32; 2],
    pointed: &'a mut u32,
    words: [u32; VARIABLES],
    wides: [u64; VARIABLES],
    reals: [f32; VARIABLES],
    vectors: [[u32; COMPONENTS]; VARIABLES],
    elements: [u32; ELEMENTS],
    rounds: Vec<u32>,
}

/// How a statement ends.
enum End {
    Next,
    Break,
    Continue,
    Return(u32),
}

impl Machine<'_> {
    fn call(&mut self, function: &Function, parameters: [u32; 2], pointed: &mut u32) -> u32 {
        let mut frame = Frame {
            parameters,
            pointed,
            words: [0; VARIABLES],
            wides: [0; VARIABLES],
            reals: [0.0; VARIABLES],
            vectors: [[0; COMPONENTS]; VARIABLES],
            elements: [0; ELEMENTS],
            rounds: Vec::new(),
        };
        match self.body(&function.body, &mut frame) {
            End::Return(value) => value,
            _ => self.word(&function.result, &frame),
        }
    }

    fn body(&mut self, body: &[Statement], frame: &mut Frame<'_>) -> End {
        for statement in body {
            match self.statement(statement, frame) {
                End::Next => {}
                end => return end,
            }
        }
        End::Next
    }

    fn statement(&mut self, statement: &Statement, frame: &mut Frame<'_>) -> End {
        match statement {
            Statement::SetWord(at, value) => frame.words[*at] = self.word(value, frame),
            Statement::SetWide(at, value) => frame.wides[*at] = self.wide(value, frame),
            Statement::SetReal(at, value) => frame.reals[*at] = self.real(value, frame),
            Statement::SetVector(at, value) => frame.vectors[*at] = self.vector(value, frame),
            Statement::SetElement(index, value) => {
                let at = self.word(index, frame) as usize % ELEMENTS;
                frame.elements[at] = self.word(value, frame);
            }
            Statement::SetPointed(value) => *frame.pointed = self.word(value, frame),
            Statement::Out(at, value) => self.outputs[*at] = self.word(value, frame),
            Statement::If(condition, yes, no) => {
                let branch = if self.truth(condition, frame) { yes } else { no };
                return self.body(branch, frame);
            }
            Statement::Phi(at, condition, yes, no) => {
                let branch = if self.truth(condition, frame) { yes } else { no };
                frame.words[*at] = self.word(branch, frame);
            }
            Statement::Loop(rounds, body) => {
                for round in 0..self.word(rounds, frame) % 8 {
                    frame.rounds.push(round);
                    let end = self.body(body, frame);
                    frame.rounds.pop();
                    match end {
                        End::Next | End::Continue => {}
                        End::Break => break,
                        end => return end,
                    }
                }
            }
            Statement::BreakIf(condition) => {
                if self.truth(condition, frame) {
                    return End::Break;
                }
            }
            Statement::ContinueIf(condition) => {
                if self.truth(condition, frame) {
                    return End::Continue;
                }
            }
            Statement::Switch(selector, cases) => {
                let value = match selector {
                    Selector::Word(word) => u64::from(self.word(word, frame)),
                    Selector::Wide(wide) => self.wide(wide, frame),
                };
                let first = ((value % 8) as usize).min(cases.len() - 1);
                for (body, falls) in &cases[first..] {
                    match self.body(body, frame) {
                        End::Next if *falls => {}
                        End::Next => break,
                        end => return end,
                    }
                }
            }
            Statement::ReturnIf(condition, value) => {
                if self.truth(condition, frame) {
                    return End::Return(self.word(value, frame));
                }
            }
            Statement::Call(function, at, a, b, pointed) => {
                let parameters = [self.word(a, frame), self.word(b, frame)];
                let callee = &self.program.functions[*function];
                let mut word = frame.words[*pointed];
                let result = self.call(callee, parameters, &mut word);
                frame.words[*pointed] = word;
                frame.words[*at] = result;
            }
        }
        End::Next
    }

    fn word(&self, word: &Word, frame: &Frame<'_>) -> u32 {
        let of = |word: &Word| self.word(word, frame);
        match word {
            Word::Constant(value) => *value,
            Word::Input(at) => self.inputs[*at],
            Word::Id => self.id,
            Word::Parameter(at) => frame.parameters[*at],
            Word::Pointed => *frame.pointed,
            Word::Variable(at) => frame.words[*at],
            Word::Element(index) => frame.elements[of(index) as usize % ELEMENTS],
            Word::Round => frame.rounds.last().copied().unwrap_or_default(),
            Word::Unary(name, a) => {
                let a = of(a);
                let highest = |bits: u32| (0..32).rev().find(|at| bits >> at & 1 == 1).unwrap_or(u32::MAX);
                match *name {
                    "Not" => a ^ u32::MAX,
                    "SNegate" => 0u32.wrapping_sub(a),
                    "BitReverse" => (0..32).filter(|at| a >> at & 1 == 1).map(|at| 1 << (31 - at)).sum(),
                    "BitCount" => (0..32).map(|at| a >> at & 1).sum(),
                    "SAbs" => {
                        if a >> 31 == 1 {
                            0u32.wrapping_sub(a)
                        } else {
                            a
                        }
                    }
                    "FindILsb" => (0..32).find(|at| a >> at & 1 == 1).unwrap_or(u32::MAX),
                    "FindUMsb" => highest(a),
                    "FindSMsb" => highest(if a >> 31 == 1 { a ^ u32::MAX } else { a }),
                    other => unreachable!("{other}"),
                }
            }
            Word::Binary(name, a, b) => binary(name, of(a).into(), of(b).into(), 32) as u32,
            Word::Select(condition, a, b) => of(if self.truth(condition, frame) { a } else { b }),
            Word::Extended(name, a, b, part) => {
                let (a, b) = (of(a), of(b));
                let (low, high) = match *name {
                    "IAddCarry" => split(u64::from(a) + u64::from(b)),
                    "ISubBorrow" => (a.wrapping_sub(b), u32::from(a < b)),
                    "UMulExtended" => split(u64::from(a) * u64::from(b)),
                    "SMulExtended" => split((i64::from(a as i32) * i64::from(b as i32)) as u64),
                    other => unreachable!("{other}"),
                };
                if *part == 0 { low } else { high }
            }
            Word::Field(name, a, offset, count) => {
                let offset = of(offset) % 32;
                let count = of(count) % (33 - offset);
                let bits = (u64::from(of(a)) >> offset & ((1 << count) - 1)) as u32;
                let negative = *name == "BitFieldSExtract" && count > 0 && bits >> (count - 1) == 1;
                if negative { bits.wrapping_sub((1u64 << count) as u32) } else { bits }
            }
            Word::Low(wide) => split(self.wide(wide, frame)).0,
            Word::High(wide) => split(self.wide(wide, frame)).1,
            Word::Bits(real) => {
                let value = self.real(real, frame);
                if value.is_nan() { 0x7FC0_0000 } else { value.to_bits() }
            }
            Word::Component(vector, at) => self.vector(vector, frame)[*at],
            Word::Indexed(vector, index) => self.vector(vector, frame)[of(index) as usize % COMPONENTS],
        }
    }

    fn wide(&self, wide: &Wide, frame: &Frame<'_>) -> u64 {
        match wide {
            Wide::Constant(value) => *value,
            Wide::Variable(at) => frame.wides[*at],
            Wide::Extended(word) => self.word(word, frame).into(),
            Wide::SignExtended(word) => i64::from(self.word(word, frame) as i32) as u64,
            Wide::Unary("Not", a) => self.wide(a, frame) ^ u64::MAX,
            Wide::Unary(_, a) => 0u64.wrapping_sub(self.wide(a, frame)),
            Wide::Binary(name, a, b) => binary(name, self.wide(a, frame), self.wide(b, frame), 64),
            Wide::Select(condition, a, b) => {
                self.wide(if self.truth(condition, frame) { a } else { b }, frame)
            }
        }
    }

    fn real(&self, real: &Real, frame: &Frame<'_>) -> f32 {
        match real {
            Real::Constant(value) => *value,
            Real::Variable(at) => frame.reals[*at],
            // Exact in f64, rounded once.
            Real::Unsigned(word) => f64::from(self.word(word, frame)) as f32,
            Real::Signed(word) => f64::from(self.word(word, frame) as i32) as f32,
            Real::Unary(name, a) => {
                let a = self.seen(self.real(a, frame));
                self.seen(match *name {
                    "FNegate" => f32::from_bits(a.to_bits() ^ 1 << 31),
                    "FAbs" => f32::from_bits(a.to_bits() & !(1 << 31)),
                    "Floor" => f64::from(a).floor() as f32,
                    "Trunc" => f64::from(a).trunc() as f32,
                    // 53 >= 2 * 24 + 2 bits: rounding twice is rounding once.
                    "Sqrt" => f64::from(a).sqrt() as f32,
                    other => unreachable!("{other}"),
                })
            }
            Real::Binary(name, a, b) => {
                // As above, the f64 operation rounded to f32 is the f32 operation.
                let [a, b] = [a, b].map(|operand| f64::from(self.seen(self.real(operand, frame))));
                let result = match *name {
                    "FAdd" => a + b,
                    "FSub" => a - b,
                    "FMul" => a * b,
                    "FDiv" => {
                        let fixed = (2f64.powi(-126)..=2f64.powi(126)).contains(&b.abs());
                        // The sign of such a zero is fixed: `SignedZeroInfNanPreserve` is declared,
                        // and IEEE 754 says -0 for 0 by a negative number. Mesa folds 0 / x to +0,
                        // whatever x is, in 25.0 and in 26.2.
                        let folded_by_mesa = a == 0.0;
                        self.open.set(self.open.get() || !fixed || folded_by_mesa);
                        a / b
                    }
                    other => unreachable!("{other}"),
                };
                self.seen(result as f32)
            }
            Real::Select(condition, a, b) => {
                self.real(if self.truth(condition, frame) { a } else { b }, frame)
            }
        }
    }

    /// An operand or result of float arithmetic.
    fn seen(&self, value: f32) -> f32 {
        self.open.set(self.open.get() || value.is_subnormal());
        value
    }

    fn truth(&self, truth: &Truth, frame: &Frame<'_>) -> bool {
        match truth {
            Truth::Constant(value) => *value,
            Truth::Words(name, a, b) => {
                compare(name, self.word(a, frame).into(), self.word(b, frame).into(), 32)
            }
            Truth::Wides(name, a, b) => compare(name, self.wide(a, frame), self.wide(b, frame), 64),
            Truth::Reals(name, a, b) => {
                let [a, b] = [a, b].map(|operand| self.seen(self.real(operand, frame)));
                let order = a.partial_cmp(&b);
                let Some(order) = order else { return name.starts_with("FUnord") };
                match *name {
                    "FOrdEqual" | "FUnordEqual" => order.is_eq(),
                    "FUnordNotEqual" => order.is_ne(),
                    "FOrdLessThan" | "FUnordLessThan" => order.is_lt(),
                    "FOrdGreaterThanEqual" => order.is_ge(),
                    other => unreachable!("{other}"),
                }
            }
            Truth::Not(a) => !self.truth(a, frame),
            Truth::Both(name, a, b) => {
                let (a, b) = (self.truth(a, frame), self.truth(b, frame));
                match *name {
                    "LogicalAnd" => a && b,
                    "LogicalOr" => a || b,
                    "LogicalEqual" => a == b,
                    "LogicalNotEqual" => a != b,
                    other => unreachable!("{other}"),
                }
            }
        }
    }

    fn vector(&self, vector: &Vector, frame: &Frame<'_>) -> [u32; COMPONENTS] {
        match vector {
            Vector::Construct(words) => std::array::from_fn(|at| self.word(&words[at], frame)),
            Vector::Variable(at) => frame.vectors[*at],
            Vector::Binary(name, a, b) => {
                let (a, b) = (self.vector(a, frame), self.vector(b, frame));
                std::array::from_fn(|at| binary(name, a[at].into(), b[at].into(), 32) as u32)
            }
            Vector::Shuffle(a, b, places) => {
                let both = [self.vector(a, frame), self.vector(b, frame)].concat();
                places.map(|at| both[at])
            }
            Vector::Insert(a, word, at) => {
                let mut vector = self.vector(a, frame);
                vector[*at] = self.word(word, frame);
                vector
            }
            Vector::InsertAt(a, word, index) => {
                let mut vector = self.vector(a, frame);
                vector[self.word(index, frame) as usize % COMPONENTS] = self.word(word, frame);
                vector
            }
            Vector::Select(condition, a, b) => {
                self.vector(if self.truth(condition, frame) { a } else { b }, frame)
            }
        }
    }
}

fn split(value: u64) -> (u32, u32) {
    (value as u32, (value >> 32) as u32)
}

/// The number that the bits of a signed integer stand for.
fn signed(bits: u64, width: u32) -> i128 {
    if bits >> (width - 1) == 1 { i128::from(bits) - (1 << width) } else { bits.into() }
}

/// An operation on integers of a width, computed in a wider one and cut off.
fn binary(name: &str, a: u64, b: u64, width: u32) -> u64 {
    let mask = u64::MAX >> (64 - width);
    let (x, y) = (i128::from(a), i128::from(b));
    let (s, t) = (signed(a, width), signed(b, width));
    let by = b % u64::from(width);
    // As the emitter makes them: never zero, signed ones never negative.
    let divisor = i128::from(b | 1);
    let positive = i128::from((b | 1) & (mask >> 1));
    let result = match name {
        "IAdd" => x + y,
        "ISub" => x - y,
        "IMul" => x.wrapping_mul(y),
        "BitwiseAnd" => x & y,
        "BitwiseOr" => x | y,
        "BitwiseXor" => x ^ y,
        "ShiftLeftLogical" => x << by,
        "ShiftRightLogical" => x >> by,
        "ShiftRightArithmetic" => s >> by,
        "UDiv" => x / divisor,
        "UMod" => x % divisor,
        "SDiv" => s / positive,
        "SRem" => s % positive,
        "SMod" => s.rem_euclid(positive),
        "UMin" => x.min(y),
        "UMax" => x.max(y),
        "SMin" => s.min(t),
        "SMax" => s.max(t),
        other => unreachable!("{other}"),
    };
    result as u64 & mask
}

fn compare(name: &str, a: u64, b: u64, width: u32) -> bool {
    let unsigned = a.cmp(&b);
    let order = if name.starts_with('S') { signed(a, width).cmp(&signed(b, width)) } else { unsigned };
    match &name[1..] {
        "Equal" => order.is_eq(),
        "NotEqual" => order.is_ne(),
        "LessThan" => order.is_lt(),
        "LessThanEqual" => order.is_le(),
        "GreaterThan" => order.is_gt(),
        "GreaterThanEqual" => order.is_ge(),
        other => unreachable!("{other}"),
    }
}
