//! The trees, and how they are read off a list of numbers. A list that ends is followed by zeros,
//! and zero always draws the smallest thing, so that shorter lists are smaller programs.

/// Words that each invocation reads.
pub const INPUTS: usize = 4;
/// Words that each invocation writes.
pub const OUTPUTS: usize = 8;
/// Variables of each type in every function.
pub const VARIABLES: usize = 3;
/// Elements of the array of every function.
pub const ELEMENTS: usize = 4;
/// Components of a vector.
pub const COMPONENTS: usize = 3;

/// A whole program: functions that call those before them, the last one is the entry point.
#[derive(Clone, Debug)]
pub struct Program {
    pub functions: Vec<Function>,
}

/// A function of two words and a pointer to a word; gives a word.
#[derive(Clone, Debug)]
pub struct Function {
    pub body: Vec<Statement>,
    pub result: Word,
}

#[derive(Clone, Debug)]
pub enum Statement {
    SetWord(usize, Word),
    SetWide(usize, Wide),
    SetReal(usize, Real),
    SetVector(usize, Vector),
    /// The array's element at an index modulo its size.
    SetElement(Word, Word),
    /// Through the pointer parameter; a variable in the entry point.
    SetPointed(Word),
    /// One of the invocation's outputs.
    Out(usize, Word),
    If(Truth, Vec<Statement>, Vec<Statement>),
    /// A variable set to a phi of two values, each computed in a branch of its own.
    Phi(usize, Truth, Word, Word),
    /// At most seven rounds; inside, `Word::Round` counts them from 0.
    Loop(Word, Vec<Statement>),
    /// Leaves the innermost loop, or goes on to its next round.
    BreakIf(Truth),
    ContinueIf(Truth),
    /// Cases for 0, 1, ... of a selector modulo 8, each with whether it falls through into the next
    /// one; the last is the default.
    Switch(Selector, Vec<(Vec<Statement>, bool)>),
    ReturnIf(Truth, Word),
    /// A variable set to the result of function n on two words and a pointer to another variable.
    Call(usize, usize, Word, Word, usize),
}

#[derive(Clone, Debug)]
pub enum Selector {
    Word(Word),
    Wide(Wide),
}

#[derive(Clone, Debug)]
pub enum Word {
    Constant(u32),
    Input(usize),
    Id,
    Parameter(usize),
    Pointed,
    Variable(usize),
    Element(Box<Word>),
    /// The innermost loop's round; 0 outside of loops.
    Round,
    Unary(&'static str, Box<Word>),
    Binary(&'static str, Box<Word>, Box<Word>),
    Select(Box<Truth>, Box<Word>, Box<Word>),
    /// A part of the extended products and sums.
    Extended(&'static str, Box<Word>, Box<Word>, usize),
    Field(&'static str, Box<Word>, Box<Word>, Box<Word>),
    Low(Box<Wide>),
    High(Box<Wide>),
    /// The bits of a float, those of one NaN for all of them.
    Bits(Box<Real>),
    Component(Box<Vector>, usize),
    Indexed(Box<Vector>, Box<Word>),
}

#[derive(Clone, Debug)]
pub enum Wide {
    Constant(u64),
    Variable(usize),
    Extended(Box<Word>),
    SignExtended(Box<Word>),
    Unary(&'static str, Box<Wide>),
    Binary(&'static str, Box<Wide>, Box<Wide>),
    Select(Box<Truth>, Box<Wide>, Box<Wide>),
}

#[derive(Clone, Debug)]
pub enum Real {
    Constant(f32),
    Variable(usize),
    Unsigned(Box<Word>),
    Signed(Box<Word>),
    Unary(&'static str, Box<Real>),
    Binary(&'static str, Box<Real>, Box<Real>),
    Select(Box<Truth>, Box<Real>, Box<Real>),
}

#[derive(Clone, Debug)]
pub enum Truth {
    Constant(bool),
    Words(&'static str, Box<Word>, Box<Word>),
    Wides(&'static str, Box<Wide>, Box<Wide>),
    Reals(&'static str, Box<Real>, Box<Real>),
    Not(Box<Truth>),
    Both(&'static str, Box<Truth>, Box<Truth>),
}

#[derive(Clone, Debug)]
pub enum Vector {
    Construct(Box<[Word; COMPONENTS]>),
    Variable(usize),
    Binary(&'static str, Box<Vector>, Box<Vector>),
    Shuffle(Box<Vector>, Box<Vector>, [usize; COMPONENTS]),
    Insert(Box<Vector>, Box<Word>, usize),
    InsertAt(Box<Vector>, Box<Word>, Box<Word>),
    Select(Box<Truth>, Box<Vector>, Box<Vector>),
}

/// Shifts take their amount modulo the width, divisions the divisor with its lowest bit set and,
/// where they are signed, its highest bit cleared.
pub const BINARY: [&str; 18] = [
    "IAdd",
    "ISub",
    "IMul",
    "BitwiseAnd",
    "BitwiseOr",
    "BitwiseXor",
    "ShiftLeftLogical",
    "ShiftRightLogical",
    "ShiftRightArithmetic",
    "UDiv",
    "UMod",
    "SDiv",
    "SRem",
    "SMod",
    "UMin",
    "UMax",
    "SMin",
    "SMax",
];
const UNARY: [&str; 4] = ["Not", "SNegate", "BitReverse", "BitCount"];
/// `SAbs` and the searches for bits exist for words only.
const UNARY_OF_WORDS: [&str; 8] =
    ["Not", "SNegate", "BitReverse", "BitCount", "SAbs", "FindILsb", "FindSMsb", "FindUMsb"];
const COMPARISONS: [&str; 10] = [
    "IEqual",
    "INotEqual",
    "ULessThan",
    "ULessThanEqual",
    "UGreaterThan",
    "UGreaterThanEqual",
    "SLessThan",
    "SLessThanEqual",
    "SGreaterThan",
    "SGreaterThanEqual",
];
const REAL_BINARY: [&str; 4] = ["FAdd", "FSub", "FMul", "FDiv"];
const REAL_UNARY: [&str; 5] = ["FNegate", "FAbs", "Floor", "Trunc", "Sqrt"];
const REAL_COMPARISONS: [&str; 6] =
    ["FOrdEqual", "FUnordEqual", "FOrdLessThan", "FUnordLessThan", "FOrdGreaterThanEqual", "FUnordNotEqual"];
const LOGIC: [&str; 4] = ["LogicalAnd", "LogicalOr", "LogicalEqual", "LogicalNotEqual"];
const EXTENDED: [&str; 4] = ["IAddCarry", "ISubBorrow", "UMulExtended", "SMulExtended"];
const FIELDS: [&str; 2] = ["BitFieldUExtract", "BitFieldSExtract"];

/// What `Program::count` tells of.
pub const KINDS: [&str; 20] = [
    "SetWord",
    "SetWide",
    "SetReal",
    "SetVector",
    "SetElement",
    "SetPointed",
    "Out",
    "If",
    "Phi",
    "Loop",
    "BreakIf",
    "ContinueIf",
    "Switch",
    "falls through",
    "Switch on 64 bits",
    "ReturnIf",
    "Call",
    "Call in a loop",
    "Loop in a loop",
    "Return in a loop",
];

/// Numbers, read one by one.
struct Numbers<'a> {
    rest: std::slice::Iter<'a, u32>,
    /// How many functions may be called.
    callable: usize,
    loops: usize,
    /// Whether an entry point is drawn.
    entry: bool,
}

impl Program {
    /// The program of a list of numbers.
    pub fn draw(numbers: &[u32]) -> Self {
        let mut numbers = Numbers { rest: numbers.iter(), callable: 0, loops: 0, entry: false };
        let helpers = numbers.below(3);
        let mut functions = Vec::new();
        for at in 0..helpers {
            numbers.callable = at;
            functions.push(numbers.function(4));
        }
        numbers.callable = helpers;
        numbers.entry = true;
        let mut entry = numbers.function(8);
        // Variables begin with what tells invocations apart, and end in the outputs.
        let begin = (0..VARIABLES).map(|at| Statement::SetWord(at, Word::Input(at)));
        let end = [
            Word::Variable(0),
            Word::Variable(1),
            Word::Variable(2),
            Word::Low(Box::new(Wide::Variable(0))),
            Word::Bits(Box::new(Real::Variable(0))),
            Word::Component(Box::new(Vector::Variable(0)), 1),
            Word::Element(Box::new(Word::Id)),
        ];
        let end = end.into_iter().enumerate().map(|(at, word)| Statement::Out(at, word));
        entry.body = begin.chain(entry.body).chain(end).collect();
        functions.push(entry);
        Self { functions }
    }

    /// Tells of each statement's kind.
    pub fn count(&self, tell: &mut dyn FnMut(&'static str)) {
        for function in &self.functions {
            count(&function.body, 0, tell);
        }
    }
}

fn count(body: &[Statement], loops: usize, tell: &mut dyn FnMut(&'static str)) {
    for statement in body {
        let kind = match statement {
            Statement::SetWord(..) => "SetWord",
            Statement::SetWide(..) => "SetWide",
            Statement::SetReal(..) => "SetReal",
            Statement::SetVector(..) => "SetVector",
            Statement::SetElement(..) => "SetElement",
            Statement::SetPointed(..) => "SetPointed",
            Statement::Out(..) => "Out",
            Statement::If(_, yes, no) => {
                count(yes, loops, tell);
                count(no, loops, tell);
                "If"
            }
            Statement::Phi(..) => "Phi",
            Statement::Loop(_, body) => {
                if loops > 0 {
                    tell("Loop in a loop");
                }
                count(body, loops + 1, tell);
                "Loop"
            }
            Statement::BreakIf(_) => "BreakIf",
            Statement::ContinueIf(_) => "ContinueIf",
            Statement::Switch(selector, cases) => {
                if matches!(selector, Selector::Wide(_)) {
                    tell("Switch on 64 bits");
                }
                for (body, falls) in cases {
                    if *falls {
                        tell("falls through");
                    }
                    count(body, loops, tell);
                }
                "Switch"
            }
            Statement::ReturnIf(..) => {
                if loops > 0 {
                    tell("Return in a loop");
                }
                "ReturnIf"
            }
            Statement::Call(..) => {
                if loops > 0 {
                    tell("Call in a loop");
                }
                "Call"
            }
        };
        tell(kind);
    }
}

impl Numbers<'_> {
    fn next(&mut self) -> u32 {
        self.rest.next().copied().unwrap_or_default()
    }

    fn below(&mut self, count: usize) -> usize {
        self.next() as usize % count
    }

    fn one<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    fn variable(&mut self) -> usize {
        self.below(VARIABLES)
    }

    fn function(&mut self, most: usize) -> Function {
        let body = self.body(most, 3);
        Function { body, result: self.word(2) }
    }

    fn body(&mut self, most: usize, depth: usize) -> Vec<Statement> {
        let count = self.below(most + 1);
        (0..count).map(|_| self.statement(depth)).collect()
    }

    fn statement(&mut self, depth: usize) -> Statement {
        let nested = if depth > 0 { 16 } else { 9 };
        match self.below(nested) {
            0 if self.entry => Statement::Out(self.below(OUTPUTS), self.word(3)),
            0 | 1 => Statement::SetWord(self.variable(), self.word(3)),
            2 => Statement::SetWide(self.variable(), self.wide(3)),
            3 => Statement::SetReal(self.variable(), self.real(3)),
            4 => Statement::SetVector(self.variable(), self.vector(2)),
            5 => Statement::SetElement(self.word(1), self.word(2)),
            6 => Statement::SetPointed(self.word(2)),
            7 if self.loops > 0 => match self.below(2) {
                0 => Statement::BreakIf(self.truth(2)),
                _ => Statement::ContinueIf(self.truth(2)),
            },
            8 if self.callable > 0 => {
                let (function, variable) = (self.below(self.callable), self.variable());
                Statement::Call(function, variable, self.word(2), self.word(2), self.variable())
            }
            7 | 8 => Statement::Phi(self.variable(), self.truth(2), self.word(2), self.word(2)),
            9 => Statement::Phi(self.variable(), self.truth(2), self.word(2), self.word(2)),
            10 => Statement::ReturnIf(self.truth(2), self.word(1)),
            11 | 12 if self.loops < 2 => {
                let rounds = self.word(1);
                self.loops += 1;
                let body = self.body(4, depth - 1);
                self.loops -= 1;
                Statement::Loop(rounds, body)
            }
            13 | 14 => {
                let selector = match self.below(3) {
                    0 => Selector::Wide(self.wide(2)),
                    _ => Selector::Word(self.word(2)),
                };
                let count = 1 + self.below(4);
                Statement::Switch(
                    selector,
                    (0..count).map(|_| (self.body(2, depth - 1), self.below(3) == 1)).collect(),
                )
            }
            _ => Statement::If(self.truth(2), self.body(3, depth - 1), self.body(3, depth - 1)),
        }
    }

    fn constant(&mut self) -> u32 {
        const EDGES: [u32; 8] = [0, 1, 2, 31, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF, 0xFFFF_FFFE];
        match self.below(3) {
            0 => self.one(&EDGES),
            1 => self.next() % 16,
            _ => self.next(),
        }
    }

    fn word(&mut self, depth: usize) -> Word {
        let choice = self.below(if depth == 0 { 8 } else { 22 });
        let deeper = depth.saturating_sub(1);
        let boxed = |word: Word| Box::new(word);
        match choice {
            0 => Word::Constant(self.constant()),
            1 => Word::Input(self.below(INPUTS)),
            2 => Word::Id,
            3 => Word::Parameter(self.below(2)),
            4 => Word::Pointed,
            5 | 6 => Word::Variable(self.variable()),
            7 => Word::Round,
            8 => Word::Element(boxed(self.word(deeper))),
            9 => Word::Unary(self.one(&UNARY_OF_WORDS), boxed(self.word(deeper))),
            10 => {
                Word::Select(Box::new(self.truth(deeper)), boxed(self.word(deeper)), boxed(self.word(deeper)))
            }
            11 => Word::Extended(
                self.one(&EXTENDED),
                boxed(self.word(deeper)),
                boxed(self.word(deeper)),
                self.below(2),
            ),
            12 => Word::Field(
                self.one(&FIELDS),
                boxed(self.word(deeper)),
                boxed(self.word(deeper)),
                boxed(self.word(deeper)),
            ),
            13 => Word::Low(Box::new(self.wide(deeper))),
            14 => Word::High(Box::new(self.wide(deeper))),
            15 => Word::Bits(Box::new(self.real(deeper))),
            16 => Word::Component(Box::new(self.vector(deeper)), self.below(COMPONENTS)),
            17 => Word::Indexed(Box::new(self.vector(deeper)), boxed(self.word(deeper))),
            _ => Word::Binary(self.one(&BINARY), boxed(self.word(deeper)), boxed(self.word(deeper))),
        }
    }

    fn wide(&mut self, depth: usize) -> Wide {
        let choice = self.below(if depth == 0 { 3 } else { 9 });
        let deeper = depth.saturating_sub(1);
        match choice {
            0 => Wide::Constant(u64::from(self.constant()) | u64::from(self.constant()) << 32),
            1 => Wide::Variable(self.variable()),
            2 => Wide::Extended(Box::new(self.word(deeper))),
            3 => Wide::SignExtended(Box::new(self.word(deeper))),
            4 => Wide::Unary(self.one(&UNARY[..2]), Box::new(self.wide(deeper))),
            5 => Wide::Select(
                Box::new(self.truth(deeper)),
                Box::new(self.wide(deeper)),
                Box::new(self.wide(deeper)),
            ),
            // GLSL.std.450 has minima of 64 bits as well, but the shift ends the plain ones.
            _ => Wide::Binary(self.one(&BINARY), Box::new(self.wide(deeper)), Box::new(self.wide(deeper))),
        }
    }

    fn real(&mut self, depth: usize) -> Real {
        const EDGES: [f32; 8] = [0.0, 1.0, -0.0, 0.1, -2.5, 1e30, 16_777_216.0, 3.0];
        let choice = self.below(if depth == 0 { 4 } else { 9 });
        let deeper = depth.saturating_sub(1);
        match choice {
            0 => Real::Constant(self.one(&EDGES)),
            1 => Real::Variable(self.variable()),
            2 => Real::Unsigned(Box::new(self.word(deeper))),
            3 => Real::Signed(Box::new(self.word(deeper))),
            4 => Real::Unary(self.one(&REAL_UNARY), Box::new(self.real(deeper))),
            5 => Real::Select(
                Box::new(self.truth(deeper)),
                Box::new(self.real(deeper)),
                Box::new(self.real(deeper)),
            ),
            _ => {
                Real::Binary(self.one(&REAL_BINARY), Box::new(self.real(deeper)), Box::new(self.real(deeper)))
            }
        }
    }

    fn truth(&mut self, depth: usize) -> Truth {
        let choice = self.below(if depth == 0 { 1 } else { 9 });
        let deeper = depth.saturating_sub(1);
        match choice {
            0 => Truth::Constant(self.below(2) == 1),
            1 => Truth::Not(Box::new(self.truth(deeper))),
            2 => Truth::Both(self.one(&LOGIC), Box::new(self.truth(deeper)), Box::new(self.truth(deeper))),
            3 => {
                Truth::Wides(self.one(&COMPARISONS), Box::new(self.wide(deeper)), Box::new(self.wide(deeper)))
            }
            4 => Truth::Reals(
                self.one(&REAL_COMPARISONS),
                Box::new(self.real(deeper)),
                Box::new(self.real(deeper)),
            ),
            _ => {
                Truth::Words(self.one(&COMPARISONS), Box::new(self.word(deeper)), Box::new(self.word(deeper)))
            }
        }
    }

    fn vector(&mut self, depth: usize) -> Vector {
        let choice = self.below(if depth == 0 { 2 } else { 8 });
        let deeper = depth.saturating_sub(1);
        match choice {
            0 => Vector::Construct(Box::new([self.word(deeper), self.word(deeper), self.word(deeper)])),
            1 => Vector::Variable(self.variable()),
            2 => Vector::Shuffle(
                Box::new(self.vector(deeper)),
                Box::new(self.vector(deeper)),
                std::array::from_fn(|_| self.below(2 * COMPONENTS)),
            ),
            3 => Vector::Insert(
                Box::new(self.vector(deeper)),
                Box::new(self.word(deeper)),
                self.below(COMPONENTS),
            ),
            4 => Vector::InsertAt(
                Box::new(self.vector(deeper)),
                Box::new(self.word(deeper)),
                Box::new(self.word(deeper)),
            ),
            5 => Vector::Select(
                Box::new(self.truth(deeper)),
                Box::new(self.vector(deeper)),
                Box::new(self.vector(deeper)),
            ),
            _ => Vector::Binary(
                self.one(&BINARY),
                Box::new(self.vector(deeper)),
                Box::new(self.vector(deeper)),
            ),
        }
    }
}
