//! Synthetic modules of any size: a ray generation shader made of functions that load, compute,
//! branch, loop and call each other, in about the shares in which real renderers do.

use crate::scenes::Random;

/// The id of an instruction's result.
type Id = u32;

/// The ids of the types, constants and variables that every module has.
mod id {
    pub const MAIN: u32 = 1;
    pub const GLSL: u32 = 2;
    pub const VOID: u32 = 3;
    pub const BOOL: u32 = 4;
    pub const UINT: u32 = 5;
    pub const FLOAT: u32 = 6;
    pub const VEC4: u32 = 7;
    pub const MAIN_TYPE: u32 = 8;
    pub const FUNCTION_TYPE: u32 = 9;
    pub const LOCAL_FLOAT: u32 = 10;
    pub const LOCAL_VEC4: u32 = 11;
    pub const ARRAY: u32 = 12;
    pub const BLOCK: u32 = 13;
    pub const BLOCK_POINTER: u32 = 14;
    pub const ELEMENT: u32 = 15;
    pub const BUFFER: u32 = 16;
    /// The constants 0 to 7 of type uint.
    pub const NUMBERS: u32 = 17;
    pub const FLOATS: u32 = 25;
    pub const NEXT: u32 = 33;
}

/// Variables of a function: half are vectors.
const VARIABLES: usize = 8;

struct Writer {
    words: Vec<u32>,
    next: Id,
    random: Random,
    instructions: usize,
    /// The functions that are defined, and how many of them are called already.
    functions: Vec<Id>,
    called: usize,
}

/// The values that a function has defined so far and may use here.
#[derive(Clone, Default)]
struct Scope {
    floats: Vec<Id>,
    vectors: Vec<Id>,
    integers: Vec<Id>,
    float_variables: Vec<Id>,
    vector_variables: Vec<Id>,
    /// The block that instructions are added to.
    block: Id,
}

/// The words of a module whose functions have about so many instructions together, and each of them
/// about `each`.
pub fn module(instructions: usize, each: usize) -> Vec<u32> {
    let words = vec![0x0723_0203, 0x0001_0400, 0, 0, 0];
    let random = Random(instructions as u64);
    let mut writer =
        Writer { words, next: id::NEXT, random, instructions: 0, functions: Vec::new(), called: 0 };
    writer.declarations();
    while writer.instructions < instructions {
        writer.function(each);
    }
    writer.main();
    writer.words[3] = writer.next;
    writer.words
}

impl Writer {
    fn op(&mut self, opcode: u32, operands: &[u32]) {
        self.words.push(opcode | (operands.len() as u32 + 1) << 16);
        self.words.extend(operands);
    }

    /// An instruction of a function.
    fn body(&mut self, opcode: u32, operands: &[u32]) {
        self.instructions += 1;
        self.op(opcode, operands);
    }

    fn fresh(&mut self) -> Id {
        self.next += 1;
        self.next - 1
    }

    /// An instruction with a result.
    fn result(&mut self, opcode: u32, ty: Id, operands: &[u32]) -> Id {
        let id = self.fresh();
        self.body(opcode, &[&[ty, id], operands].concat());
        id
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.random.bits() % limit as u64) as usize
    }

    fn one_of(&mut self, ids: &[Id]) -> Id {
        // The most recent values are used most.
        let back = self.below(ids.len().min(16)).min(self.below(ids.len().min(16)));
        ids[ids.len() - 1 - back]
    }

    fn declarations(&mut self) {
        self.op(17, &[4479]); // RayTracingKHR
        self.op(10, &text("SPV_KHR_ray_tracing"));
        self.op(11, &[&[id::GLSL][..], &text("GLSL.std.450")].concat());
        self.op(14, &[0, 1]);
        self.op(15, &[&[5313, id::MAIN][..], &text("main"), &[id::BUFFER]].concat());
        self.op(71, &[id::BUFFER, 34, 0]);
        self.op(71, &[id::BUFFER, 33, 0]);
        self.op(71, &[id::ARRAY, 6, 4]);
        self.op(71, &[id::BLOCK, 2]);
        self.op(72, &[id::BLOCK, 0, 35, 0]);
        self.op(19, &[id::VOID]);
        self.op(20, &[id::BOOL]);
        self.op(21, &[id::UINT, 32, 0]);
        self.op(22, &[id::FLOAT, 32]);
        self.op(23, &[id::VEC4, id::FLOAT, 4]);
        self.op(33, &[id::MAIN_TYPE, id::VOID]);
        self.op(33, &[id::FUNCTION_TYPE, id::FLOAT, id::FLOAT, id::UINT]);
        self.op(32, &[id::LOCAL_FLOAT, 7, id::FLOAT]);
        self.op(32, &[id::LOCAL_VEC4, 7, id::VEC4]);
        self.op(29, &[id::ARRAY, id::FLOAT]);
        self.op(30, &[id::BLOCK, id::ARRAY]);
        self.op(32, &[id::BLOCK_POINTER, 12, id::BLOCK]);
        self.op(32, &[id::ELEMENT, 12, id::FLOAT]);
        self.op(59, &[id::BLOCK_POINTER, id::BUFFER, 12]);
        for number in 0..8 {
            self.op(43, &[id::UINT, id::NUMBERS + number, number]);
            self.op(43, &[id::FLOAT, id::FLOATS + number, (0.25 * number as f32).to_bits()]);
        }
    }

    /// `float function(float, uint)`
    fn function(&mut self, instructions: usize) {
        let [function, x, n, block] = [0; 4].map(|_| self.fresh());
        self.body(54, &[id::FLOAT, function, 0, id::FUNCTION_TYPE]);
        self.body(55, &[id::FLOAT, x]);
        self.body(55, &[id::UINT, n]);
        let mut scope = self.begin(block);
        scope.floats.push(x);
        scope.integers.push(n);
        let end = self.instructions + instructions;
        while self.instructions + 2 < end {
            self.statement(&mut scope, 0);
        }
        let value = self.one_of(&scope.floats);
        self.body(254, &[value]);
        self.body(56, &[]);
        self.functions.push(function);
    }

    /// Calls the functions that are not called yet.
    fn main(&mut self) {
        let block = self.fresh();
        self.body(54, &[id::VOID, id::MAIN, 0, id::MAIN_TYPE]);
        let scope = self.begin(block);
        let mut sum = scope.floats[0];
        while self.called < self.functions.len() {
            let function = self.functions[self.called];
            self.called += 1;
            let value = self.result(57, id::FLOAT, &[function, sum, id::NUMBERS + 1]);
            sum = self.result(129, id::FLOAT, &[sum, value]);
        }
        let place = self.result(65, id::ELEMENT, &[id::BUFFER, id::NUMBERS, id::NUMBERS]);
        self.body(62, &[place, sum]);
        self.body(253, &[]);
        self.body(56, &[]);
    }

    fn begin(&mut self, block: Id) -> Scope {
        self.body(248, &[block]);
        let mut scope = Scope { block, ..Scope::default() };
        for at in 0..VARIABLES {
            let (ty, variables) = match at % 2 {
                0 => (id::LOCAL_FLOAT, &mut scope.float_variables),
                _ => (id::LOCAL_VEC4, &mut scope.vector_variables),
            };
            variables.push(self.result(59, ty, &[7]));
        }
        scope.floats.extend((0..8).map(|number| id::FLOATS + number));
        scope.integers.extend((0..8).map(|number| id::NUMBERS + number));
        let vector = self.result(80, id::VEC4, &[id::FLOATS, id::FLOATS + 1, id::FLOATS + 2, id::FLOATS + 3]);
        scope.vectors.push(vector);
        scope
    }

    fn statement(&mut self, scope: &mut Scope, depth: usize) {
        let (a, b) = (self.one_of(&scope.floats), self.one_of(&scope.floats));
        let (v, w) = (self.one_of(&scope.vectors), self.one_of(&scope.vectors));
        let (i, j) = (self.one_of(&scope.integers), self.one_of(&scope.integers));
        let number = self.below(4) as u32;
        let variable = self.one_of(&scope.float_variables);
        let vector_variable = self.one_of(&scope.vector_variables);
        match self.below(100) {
            0..=15 => scope.floats.push(self.result(61, id::FLOAT, &[variable])),
            16..=23 => scope.vectors.push(self.result(61, id::VEC4, &[vector_variable])),
            24..=31 => self.body(62, &[variable, a]),
            32..=36 => self.body(62, &[vector_variable, v]),
            37..=42 => {
                let part = self.result(65, id::LOCAL_FLOAT, &[vector_variable, id::NUMBERS + number]);
                match number {
                    0 => self.body(62, &[part, a]),
                    _ => scope.floats.push(self.result(61, id::FLOAT, &[part])),
                }
            }
            43..=47 => {
                let place = self.result(65, id::ELEMENT, &[id::BUFFER, id::NUMBERS, i]);
                scope.floats.push(self.result(61, id::FLOAT, &[place]));
            }
            // FAdd, FSub, FMul, FDiv
            48..=60 => {
                scope.floats.push(self.result([129, 131, 133, 136][number as usize], id::FLOAT, &[a, b]))
            }
            61..=66 => {
                scope.vectors.push(self.result([129, 131, 133, 133][number as usize], id::VEC4, &[v, w]));
            }
            67..=68 => scope.vectors.push(self.result(142, id::VEC4, &[v, a])),
            69..=72 => scope.floats.push(self.result(81, id::FLOAT, &[v, number])),
            73..=74 => scope.vectors.push(self.result(80, id::VEC4, &[a, b, a, b])),
            75..=76 => scope.vectors.push(self.result(79, id::VEC4, &[v, w, 3 - number, number, 4, 7])),
            77 => scope.floats.push(self.result(148, id::FLOAT, &[v, w])),
            // FMin, FMax, Sqrt, FAbs
            78..=81 => {
                let (instruction, operands) = [(37, 2), (40, 2), (31, 1), (4, 1)][number as usize];
                let operands = [&[id::GLSL, instruction][..], &[a, b][..operands]].concat();
                scope.floats.push(self.result(12, id::FLOAT, &operands));
            }
            // IAdd, IMul, BitwiseXor, ShiftRightLogical
            82..=86 => {
                let opcode = [128, 132, 198, 194][number as usize];
                scope.integers.push(self.result(opcode, id::UINT, &[i, j]));
            }
            87 => scope.floats.push(self.result(112, id::FLOAT, &[i])),
            88 => {
                let less = self.result(184, id::BOOL, &[a, b]);
                scope.floats.push(self.result(169, id::FLOAT, &[less, a, b]));
            }
            89..=90 if !self.functions.is_empty() => {
                // Mostly a function that is not called yet.
                let function = match self.called < self.functions.len() && number > 0 {
                    true => self.functions[self.called],
                    false => self.one_of(&self.functions.clone()),
                };
                self.called += usize::from(self.functions.get(self.called) == Some(&function));
                scope.floats.push(self.result(57, id::FLOAT, &[function, a, i]));
            }
            91..=97 if depth < 4 => self.emit_if(scope, depth, [a, b]),
            98..=99 if depth < 3 => self.emit_loop(scope, depth, i),
            _ => scope.floats.push(self.result(127, id::FLOAT, &[a])),
        }
    }

    fn statements(&mut self, scope: &mut Scope, depth: usize) {
        for _ in 0..3 + self.below(5) {
            self.statement(scope, depth);
        }
    }

    /// `if`, `else` and a value from both.
    fn emit_if(&mut self, scope: &mut Scope, depth: usize, [a, b]: [Id; 2]) {
        let less = self.result(184, id::BOOL, &[a, b]);
        let [then, other, merge] = [0; 3].map(|_| self.fresh());
        self.body(247, &[merge, 0]);
        self.body(250, &[less, then, other]);
        let mut values = Vec::new();
        for block in [then, other] {
            self.body(248, &[block]);
            let mut inner = Scope { block, ..scope.clone() };
            self.statements(&mut inner, depth + 1);
            values.extend([self.one_of(&inner.floats), inner.block]);
            self.body(249, &[merge]);
        }
        self.body(248, &[merge]);
        scope.block = merge;
        scope.floats.push(self.result(245, id::FLOAT, &values));
    }

    /// A loop with an integer as its trip count, and a sum.
    fn emit_loop(&mut self, scope: &mut Scope, depth: usize, count: Id) {
        let [head, test, body, more, merge, next, sum] = [0; 7].map(|_| self.fresh());
        let before = scope.block;
        self.body(249, &[head]);
        self.body(248, &[head]);
        let round = self.result(245, id::UINT, &[id::NUMBERS, before, next, more]);
        let value = self.result(245, id::FLOAT, &[id::FLOATS, before, sum, more]);
        self.body(246, &[merge, more, 0]);
        self.body(249, &[test]);
        self.body(248, &[test]);
        let again = self.result(176, id::BOOL, &[round, count]);
        self.body(250, &[again, body, merge]);
        self.body(248, &[body]);
        let mut inner = Scope { block: body, ..scope.clone() };
        inner.floats.push(value);
        inner.integers.push(round);
        self.statements(&mut inner, depth + 1);
        let last = self.one_of(&inner.floats);
        self.body(249, &[more]);
        self.body(248, &[more]);
        self.body(128, &[id::UINT, next, round, id::NUMBERS + 1]);
        self.body(129, &[id::FLOAT, sum, value, last]);
        self.body(249, &[head]);
        self.body(248, &[merge]);
        scope.block = merge;
        scope.floats.push(value);
    }
}

/// A literal string.
fn text(text: &str) -> Vec<u32> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize((text.len() + 4) / 4 * 4, 0);
    bytes.chunks(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect()
}
