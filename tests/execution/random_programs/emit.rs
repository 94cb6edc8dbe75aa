//! A program as SPIR-V text: a compute shader with workgroups of 32, its inputs in binding 0 and
//! its outputs in binding 1 of set 0.

use crate::execution::random_programs::program::{
    COMPONENTS, ELEMENTS, Function, INPUTS, OUTPUTS, Program, Real, Selector, Statement, Truth, VARIABLES,
    Vector, Wide, Word,
};

/// The module.
pub fn text(program: &Program) -> String {
    let mut emitter = Emitter {
        constants: String::new(),
        code: String::new(),
        next: 0,
        rounds: Vec::new(),
        loops: Vec::new(),
        decorations: String::new(),
    };
    for (at, function) in program.functions.iter().enumerate() {
        emitter.function(function, at, at + 1 == program.functions.len());
    }
    let Emitter { constants, code, decorations, .. } = emitter;
    format!(
        "OpCapability Shader
         OpCapability Int64
         OpCapability SignedZeroInfNanPreserve
         %glsl = OpExtInstImport \"GLSL.std.450\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint GLCompute %main \"main\" %invocation %given %out
         OpExecutionMode %main LocalSize 32 1 1
         OpExecutionMode %main SignedZeroInfNanPreserve 32
         OpDecorate %invocation BuiltIn GlobalInvocationId
         OpDecorate %words_in_memory ArrayStride 4
         OpDecorate %block Block
         OpMemberDecorate %block 0 Offset 0
         OpDecorate %given DescriptorSet 0
         OpDecorate %given Binding 0
         OpDecorate %out DescriptorSet 0
         OpDecorate %out Binding 1
         {decorations}
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %bool = OpTypeBool
         %uint = OpTypeInt 32 0
         %ulong = OpTypeInt 64 0
         %int = OpTypeInt 32 1
         %long = OpTypeInt 64 1
         %float = OpTypeFloat 32
         %uint2 = OpTypeVector %uint 2
         %vector = OpTypeVector %uint {COMPONENTS}
         %pair = OpTypeStruct %uint %uint
         %element_count = OpConstant %uint {ELEMENTS}
         %array = OpTypeArray %uint %element_count
         %words_in_memory = OpTypeRuntimeArray %uint
         %block = OpTypeStruct %words_in_memory
         %pointer_to_block = OpTypePointer StorageBuffer %block
         %pointer_in_memory = OpTypePointer StorageBuffer %uint
         %pointer_to_id = OpTypePointer Input %vector
         %pointer_to_uint = OpTypePointer Function %uint
         %pointer_to_ulong = OpTypePointer Function %ulong
         %pointer_to_float = OpTypePointer Function %float
         %pointer_to_vector = OpTypePointer Function %vector
         %pointer_to_array = OpTypePointer Function %array
         %function_type = OpTypeFunction %uint %uint %uint %pointer_to_uint
         %invocation = OpVariable %pointer_to_id Input
         %given = OpVariable %pointer_to_block StorageBuffer
         %out = OpVariable %pointer_to_block StorageBuffer
         %nought = OpConstant %uint 0
         %no_float = OpConstant %float 0.0
         %no_ulong = OpConstant %ulong 0L
         %no_vector = OpConstantNull %vector
         %no_array = OpConstantNull %array
         %yes = OpConstantTrue %bool
         %no = OpConstantFalse %bool
         {constants}
         {code}
         %main = OpFunction %void None %main_type
         %main_entry = OpLabel
         %main_pointed = OpVariable %pointer_to_uint Function %nought
         %main_result = OpFunctionCall %uint %function{last} %nought %nought %main_pointed
         {tail}
         OpReturn
         OpFunctionEnd",
        last = program.functions.len() - 1,
        tail = TAIL,
    )
}

/// The entry function's result meets the last output.
const TAIL: &str = "
    %tail_ids = OpLoad %vector %invocation
    %tail_id = OpCompositeExtract %uint %tail_ids 0
    %tail_base = OpIMul %uint %tail_id %output_count
    %tail_at = OpIAdd %uint %tail_base %last_output
    %tail_pointer = OpAccessChain %pointer_in_memory %out %nought %tail_at
    %tail_before = OpLoad %uint %tail_pointer
    %tail_value = OpBitwiseXor %uint %tail_before %main_result
    OpStore %tail_pointer %tail_value";

struct Emitter {
    decorations: String,
    constants: String,
    code: String,
    next: usize,
    /// The phis of the loops around, and their merge and continue labels.
    rounds: Vec<String>,
    loops: Vec<(String, String)>,
}

impl Emitter {
    fn line(&mut self, line: impl AsRef<str>) {
        self.code += line.as_ref();
        self.code.push('\n');
    }

    fn name(&mut self) -> String {
        self.next += 1;
        format!("%n{}", self.next)
    }

    /// An instruction with a result.
    fn value(&mut self, instruction: &str, ty: &str, operands: &[&str]) -> String {
        let name = self.name();
        self.line(format!("{name} = {instruction} %{ty} {}", operands.join(" ")));
        name
    }

    /// A core instruction, or one of `GLSL.std.450`.
    fn operation(&mut self, operation: &str, ty: &str, operands: &[&str]) -> String {
        const GLSL: [&str; 12] = [
            "UMin", "UMax", "SMin", "SMax", "SAbs", "FindILsb", "FindSMsb", "FindUMsb", "FAbs", "Floor",
            "Trunc", "Sqrt",
        ];
        if GLSL.contains(&operation) {
            let operands = [&["%glsl", operation], operands].concat();
            return self.value("OpExtInst", ty, &operands);
        }
        self.value(&format!("Op{operation}"), ty, operands)
    }

    fn constant(&mut self, value: u32) -> String {
        let name = self.name();
        self.constants += &format!("{name} = OpConstant %uint {value}\n");
        name
    }

    fn wide_constant(&mut self, value: u64) -> String {
        let name = self.name();
        self.constants += &format!("{name} = OpConstant %ulong {value}L\n");
        name
    }

    fn label(&mut self, label: &str) {
        self.line(format!("{label} = OpLabel"));
    }

    fn function(&mut self, function: &Function, at: usize, last: bool) {
        if last {
            self.constants += &format!(
                "%output_count = OpConstant %uint {OUTPUTS}\n%last_output = OpConstant %uint {}\n\
                 %input_count = OpConstant %uint {INPUTS}\n",
                OUTPUTS - 1
            );
        }
        self.line(format!("%function{at} = OpFunction %uint None %function_type"));
        for parameter in 0..2 {
            self.line(format!("%f{at}p{parameter} = OpFunctionParameter %uint"));
        }
        self.line(format!("%f{at}pointed = OpFunctionParameter %pointer_to_uint"));
        self.label(&format!("%f{at}entry"));
        let types = [
            ("word", "uint", "nought"),
            ("wide", "ulong", "no_ulong"),
            ("real", "float", "no_float"),
            ("vector", "vector", "no_vector"),
        ];
        for (name, ty, start) in types {
            for variable in 0..VARIABLES {
                self.line(format!("%f{at}{name}{variable} = OpVariable %pointer_to_{ty} Function"));
                let _ = start;
            }
        }
        self.line(format!("%f{at}elements = OpVariable %pointer_to_array Function"));
        // A pointer to a variable of its own is passed on, as one to an array's element may not be.
        for (name, _, start) in types {
            for variable in 0..VARIABLES {
                self.line(format!("OpStore %f{at}{name}{variable} %{start}"));
            }
        }
        self.line(format!("OpStore %f{at}elements %no_array"));
        self.line(format!("%f{at}ids = OpLoad %vector %invocation"));
        self.line(format!("%f{at}id = OpCompositeExtract %uint %f{at}ids 0"));
        let scope = Scope { at };
        self.body(&function.body, &scope);
        let result = self.word(&function.result, &scope);
        self.line(format!("OpReturnValue {result}"));
        self.line("OpFunctionEnd");
    }

    fn body(&mut self, body: &[Statement], scope: &Scope) {
        for statement in body {
            self.statement(statement, scope);
        }
    }

    fn store(&mut self, pointer: &str, value: &str) {
        self.line(format!("OpStore {pointer} {value}"));
    }

    /// A branch on a condition around or into blocks that meet behind it.
    fn branch(&mut self, condition: &str, yes: &str, no: &str, merge: &str) {
        self.line(format!("OpSelectionMerge {merge} None"));
        self.line(format!("OpBranchConditional {condition} {yes} {no}"));
    }

    fn go(&mut self, label: &str) {
        self.line(format!("OpBranch {label}"));
    }

    fn statement(&mut self, statement: &Statement, scope: &Scope) {
        let at = scope.at;
        match statement {
            Statement::SetWord(variable, value) => {
                let value = self.word(value, scope);
                self.store(&format!("%f{at}word{variable}"), &value);
            }
            Statement::SetWide(variable, value) => {
                let value = self.wide(value, scope);
                self.store(&format!("%f{at}wide{variable}"), &value);
            }
            Statement::SetReal(variable, value) => {
                let value = self.real(value, scope);
                self.store(&format!("%f{at}real{variable}"), &value);
            }
            Statement::SetVector(variable, value) => {
                let value = self.vector(value, scope);
                self.store(&format!("%f{at}vector{variable}"), &value);
            }
            Statement::SetElement(index, value) => {
                let pointer = self.element(index, scope);
                let value = self.word(value, scope);
                self.store(&pointer, &value);
            }
            Statement::SetPointed(value) => {
                let value = self.word(value, scope);
                self.store(&format!("%f{at}pointed"), &value);
            }
            Statement::Out(slot, value) => {
                let value = self.word(value, scope);
                let slot = self.constant(*slot as u32);
                let base = self.value("OpIMul", "uint", &[&format!("%f{at}id"), "%output_count"]);
                let index = self.value("OpIAdd", "uint", &[&base, &slot]);
                let pointer = self.value("OpAccessChain", "pointer_in_memory", &["%out", "%nought", &index]);
                self.store(&pointer, &value);
            }
            Statement::If(condition, yes, no) => {
                let condition = self.truth(condition, scope);
                let [yes_label, no_label, merge] = [self.name(), self.name(), self.name()];
                self.branch(&condition, &yes_label, &no_label, &merge);
                self.label(&yes_label);
                self.body(yes, scope);
                self.go(&merge);
                self.label(&no_label);
                self.body(no, scope);
                self.go(&merge);
                self.label(&merge);
            }
            Statement::Phi(variable, condition, yes, no) => {
                let condition = self.truth(condition, scope);
                let [yes_label, no_label, merge] = [self.name(), self.name(), self.name()];
                self.branch(&condition, &yes_label, &no_label, &merge);
                self.label(&yes_label);
                // Words have no branches of their own: the values end in these blocks.
                let yes = self.word(yes, scope);
                self.go(&merge);
                self.label(&no_label);
                let no = self.word(no, scope);
                self.go(&merge);
                self.label(&merge);
                let phi = self.value("OpPhi", "uint", &[&yes, &yes_label, &no, &no_label]);
                self.store(&format!("%f{at}word{variable}"), &phi);
            }
            Statement::Loop(rounds, body) => {
                let rounds = self.word(rounds, scope);
                let seven = self.constant(7);
                let rounds = self.value("OpBitwiseAnd", "uint", &[&rounds, &seven]);
                let [before, header, first, next, merge] =
                    [self.name(), self.name(), self.name(), self.name(), self.name()];
                let [round, more] = [self.name(), self.name()];
                let one = self.constant(1);
                self.go(&before);
                self.label(&before);
                self.go(&header);
                self.label(&header);
                self.line(format!("{round} = OpPhi %uint %nought {before} {more} {next}"));
                let inside = self.value("OpULessThan", "bool", &[&round, &rounds]);
                self.line(format!("OpLoopMerge {merge} {next} None"));
                self.line(format!("OpBranchConditional {inside} {first} {merge}"));
                self.label(&first);
                self.rounds.push(round.clone());
                self.loops.push((merge.clone(), next.clone()));
                self.body(body, scope);
                self.rounds.pop();
                self.loops.pop();
                self.go(&next);
                self.label(&next);
                self.line(format!("{more} = OpIAdd %uint {round} {one}"));
                self.go(&header);
                self.label(&merge);
            }
            Statement::BreakIf(condition) | Statement::ContinueIf(condition) => {
                let condition = self.truth(condition, scope);
                let (merge, next) = self.loops.last().cloned().expect("a loop around");
                let target = if matches!(statement, Statement::BreakIf(_)) { merge } else { next };
                let [leave, stay] = [self.name(), self.name()];
                self.branch(&condition, &leave, &stay, &stay);
                self.label(&leave);
                self.go(&target);
                self.label(&stay);
            }
            Statement::ReturnIf(condition, value) => {
                let condition = self.truth(condition, scope);
                let [leave, stay] = [self.name(), self.name()];
                self.branch(&condition, &leave, &stay, &stay);
                self.label(&leave);
                let value = self.word(value, scope);
                self.line(format!("OpReturnValue {value}"));
                self.label(&stay);
            }
            Statement::Switch(selector, cases) => {
                let (selector, suffix) = match selector {
                    Selector::Word(word) => {
                        let word = self.word(word, scope);
                        let seven = self.constant(7);
                        (self.value("OpBitwiseAnd", "uint", &[&word, &seven]), "")
                    }
                    Selector::Wide(wide) => {
                        let wide = self.wide(wide, scope);
                        let seven = self.wide_constant(7);
                        (self.value("OpBitwiseAnd", "ulong", &[&wide, &seven]), "L")
                    }
                };
                let labels: Vec<String> = cases.iter().map(|_| self.name()).collect();
                let merge = self.name();
                let default = labels.last().expect("a default");
                let literals: Vec<String> = labels[..labels.len() - 1]
                    .iter()
                    .enumerate()
                    .map(|(literal, label)| format!("{literal}{suffix} {label}"))
                    .collect();
                self.line(format!("OpSelectionMerge {merge} None"));
                self.line(format!("OpSwitch {selector} {default} {}", literals.join(" ")));
                for (case, (body, falls)) in cases.iter().enumerate() {
                    self.label(&labels[case]);
                    self.body(body, scope);
                    let target = if *falls { labels.get(case + 1).unwrap_or(&merge) } else { &merge };
                    self.go(target);
                }
                self.label(&merge);
            }
            Statement::Call(function, variable, a, b, pointed) => {
                let (a, b) = (self.word(a, scope), self.word(b, scope));
                let callee = format!("%function{function}");
                let pointed = format!("%f{at}word{pointed}");
                let result = self.value("OpFunctionCall", "uint", &[&callee, &a, &b, &pointed]);
                self.store(&format!("%f{at}word{variable}"), &result);
            }
        }
    }

    fn element(&mut self, index: &Word, scope: &Scope) -> String {
        let index = self.word(index, scope);
        let index = self.value("OpUMod", "uint", &[&index, "%element_count"]);
        let elements = format!("%f{}elements", scope.at);
        self.value("OpAccessChain", "pointer_to_uint", &[&elements, &index])
    }

    fn word(&mut self, word: &Word, scope: &Scope) -> String {
        let at = scope.at;
        match word {
            Word::Constant(value) => self.constant(*value),
            Word::Input(input) => {
                let input = self.constant(*input as u32);
                let base = self.value("OpIMul", "uint", &[&format!("%f{at}id"), "%input_count"]);
                let index = self.value("OpIAdd", "uint", &[&base, &input]);
                let pointer =
                    self.value("OpAccessChain", "pointer_in_memory", &["%given", "%nought", &index]);
                self.value("OpLoad", "uint", &[&pointer])
            }
            Word::Id => format!("%f{at}id"),
            Word::Parameter(parameter) => format!("%f{at}p{parameter}"),
            Word::Pointed => self.value("OpLoad", "uint", &[&format!("%f{at}pointed")]),
            Word::Variable(variable) => self.value("OpLoad", "uint", &[&format!("%f{at}word{variable}")]),
            Word::Element(index) => {
                let pointer = self.element(index, scope);
                self.value("OpLoad", "uint", &[&pointer])
            }
            Word::Round => self.rounds.last().cloned().unwrap_or_else(|| "%nought".into()),
            Word::Unary(name, a) => {
                let a = self.word(a, scope);
                self.operation(name, "uint", &[&a])
            }
            Word::Binary(name, a, b) => {
                let (a, b) = (self.word(a, scope), self.word(b, scope));
                self.binary(name, "uint", &a, &b)
            }
            Word::Select(condition, a, b) => {
                let condition = self.truth(condition, scope);
                let (a, b) = (self.word(a, scope), self.word(b, scope));
                self.value("OpSelect", "uint", &[&condition, &a, &b])
            }
            Word::Extended(name, a, b, part) => {
                let (a, b) = (self.word(a, scope), self.word(b, scope));
                let pair = self.operation(name, "pair", &[&a, &b]);
                self.value("OpCompositeExtract", "uint", &[&pair, &part.to_string()])
            }
            Word::Field(name, a, offset, count) => {
                let offset = self.word(offset, scope);
                let count = self.word(count, scope);
                let [thirty_two, thirty_three] = [self.constant(32), self.constant(33)];
                let offset = self.value("OpUMod", "uint", &[&offset, &thirty_two]);
                let room = self.value("OpISub", "uint", &[&thirty_three, &offset]);
                let count = self.value("OpUMod", "uint", &[&count, &room]);
                let a = self.word(a, scope);
                // The signedness of the base's type does not matter to either.
                self.operation(name, "uint", &[&a, &offset, &count])
            }
            Word::Low(wide) => {
                let wide = self.wide(wide, scope);
                self.value("OpUConvert", "uint", &[&wide])
            }
            Word::High(wide) => {
                let wide = self.wide(wide, scope);
                let both = self.value("OpBitcast", "uint2", &[&wide]);
                self.value("OpCompositeExtract", "uint", &[&both, "1"])
            }
            Word::Bits(real) => {
                let real = self.real(real, scope);
                let nan = self.value("OpIsNan", "bool", &[&real]);
                let bits = self.value("OpBitcast", "uint", &[&real]);
                let one_nan = self.constant(0x7FC0_0000);
                self.value("OpSelect", "uint", &[&nan, &one_nan, &bits])
            }
            Word::Component(vector, component) => {
                let vector = self.vector(vector, scope);
                self.value("OpCompositeExtract", "uint", &[&vector, &component.to_string()])
            }
            Word::Indexed(vector, index) => {
                let vector = self.vector(vector, scope);
                let index = self.word(index, scope);
                let count = self.constant(COMPONENTS as u32);
                let index = self.value("OpUMod", "uint", &[&index, &count]);
                self.value("OpVectorExtractDynamic", "uint", &[&vector, &index])
            }
        }
    }

    /// An operation on integers, kept where the specification defines it.
    fn binary(&mut self, name: &str, ty: &str, a: &str, b: &str) -> String {
        let splat = |emitter: &mut Self, value: u64| match ty {
            "ulong" => emitter.wide_constant(value),
            "uint" => emitter.constant(value as u32),
            _ => {
                let one = emitter.constant(value as u32);
                let name = emitter.name();
                emitter.constants += &format!("{name} = OpConstantComposite %vector {one} {one} {one}\n");
                name
            }
        };
        let width: u64 = if ty == "ulong" { 64 } else { 32 };
        let b = match name {
            "ShiftLeftLogical" | "ShiftRightLogical" | "ShiftRightArithmetic" => {
                let most = splat(self, width - 1);
                self.value("OpBitwiseAnd", ty, &[b, &most])
            }
            "UDiv" | "UMod" => {
                let one = splat(self, 1);
                self.value("OpBitwiseOr", ty, &[b, &one])
            }
            "SDiv" | "SRem" | "SMod" => {
                let one = splat(self, 1);
                let odd = self.value("OpBitwiseOr", ty, &[b, &one]);
                let positive = splat(self, u64::MAX >> (65 - width));
                self.value("OpBitwiseAnd", ty, &[&odd, &positive])
            }
            _ => b.to_owned(),
        };
        self.operation(name, ty, &[a, &b])
    }

    fn wide(&mut self, wide: &Wide, scope: &Scope) -> String {
        match wide {
            Wide::Constant(value) => self.wide_constant(*value),
            Wide::Variable(variable) => {
                self.value("OpLoad", "ulong", &[&format!("%f{}wide{variable}", scope.at)])
            }
            Wide::Extended(word) => {
                let word = self.word(word, scope);
                self.value("OpUConvert", "ulong", &[&word])
            }
            Wide::SignExtended(word) => {
                let word = self.word(word, scope);
                let word = self.value("OpBitcast", "int", &[&word]);
                let long = self.value("OpSConvert", "long", &[&word]);
                self.value("OpBitcast", "ulong", &[&long])
            }
            Wide::Unary(name, a) => {
                let a = self.wide(a, scope);
                self.operation(name, "ulong", &[&a])
            }
            Wide::Binary(name, a, b) => {
                let (a, b) = (self.wide(a, scope), self.wide(b, scope));
                self.binary(name, "ulong", &a, &b)
            }
            Wide::Select(condition, a, b) => {
                let condition = self.truth(condition, scope);
                let (a, b) = (self.wide(a, scope), self.wide(b, scope));
                self.value("OpSelect", "ulong", &[&condition, &a, &b])
            }
        }
    }

    fn real(&mut self, real: &Real, scope: &Scope) -> String {
        match real {
            Real::Constant(value) => {
                let name = self.name();
                self.constants += &format!("{name} = OpConstant %float {}\n", value.to_bits());
                name
            }
            Real::Variable(variable) => {
                self.value("OpLoad", "float", &[&format!("%f{}real{variable}", scope.at)])
            }
            Real::Unsigned(word) => {
                let word = self.word(word, scope);
                self.value("OpConvertUToF", "float", &[&word])
            }
            Real::Signed(word) => {
                let word = self.word(word, scope);
                let word = self.value("OpBitcast", "int", &[&word]);
                self.value("OpConvertSToF", "float", &[&word])
            }
            Real::Unary(name, a) => {
                let a = self.real(a, scope);
                self.operation(name, "float", &[&a])
            }
            Real::Binary(name, a, b) => {
                let (a, b) = (self.real(a, scope), self.real(b, scope));
                let value = self.operation(name, "float", &[&a, &b]);
                self.decorations += &format!("OpDecorate {value} NoContraction\n");
                value
            }
            Real::Select(condition, a, b) => {
                let condition = self.truth(condition, scope);
                let (a, b) = (self.real(a, scope), self.real(b, scope));
                self.value("OpSelect", "float", &[&condition, &a, &b])
            }
        }
    }

    fn truth(&mut self, truth: &Truth, scope: &Scope) -> String {
        match truth {
            Truth::Constant(value) => {
                if *value {
                    "%yes".into()
                } else {
                    "%no".into()
                }
            }
            Truth::Words(name, a, b) => {
                let (a, b) = (self.word(a, scope), self.word(b, scope));
                self.operation(name, "bool", &[&a, &b])
            }
            Truth::Wides(name, a, b) => {
                let (a, b) = (self.wide(a, scope), self.wide(b, scope));
                self.operation(name, "bool", &[&a, &b])
            }
            Truth::Reals(name, a, b) => {
                let (a, b) = (self.real(a, scope), self.real(b, scope));
                self.operation(name, "bool", &[&a, &b])
            }
            Truth::Not(a) => {
                let a = self.truth(a, scope);
                self.operation("LogicalNot", "bool", &[&a])
            }
            Truth::Both(name, a, b) => {
                let (a, b) = (self.truth(a, scope), self.truth(b, scope));
                self.operation(name, "bool", &[&a, &b])
            }
        }
    }

    fn vector(&mut self, vector: &Vector, scope: &Scope) -> String {
        match vector {
            Vector::Construct(words) => {
                let parts: Vec<String> = words.iter().map(|word| self.word(word, scope)).collect();
                self.value(
                    "OpCompositeConstruct",
                    "vector",
                    &parts.iter().map(String::as_str).collect::<Vec<_>>(),
                )
            }
            Vector::Variable(variable) => {
                self.value("OpLoad", "vector", &[&format!("%f{}vector{variable}", scope.at)])
            }
            Vector::Binary(name, a, b) => {
                let (a, b) = (self.vector(a, scope), self.vector(b, scope));
                self.binary(name, "vector", &a, &b)
            }
            Vector::Shuffle(a, b, places) => {
                let (a, b) = (self.vector(a, scope), self.vector(b, scope));
                let places: Vec<String> = places.iter().map(usize::to_string).collect();
                let operands: Vec<&str> =
                    [&*a, &*b].into_iter().chain(places.iter().map(String::as_str)).collect();
                self.value("OpVectorShuffle", "vector", &operands)
            }
            Vector::Insert(a, word, component) => {
                let (a, word) = (self.vector(a, scope), self.word(word, scope));
                self.value("OpCompositeInsert", "vector", &[&word, &a, &component.to_string()])
            }
            Vector::InsertAt(a, word, index) => {
                let (a, word) = (self.vector(a, scope), self.word(word, scope));
                let index = self.word(index, scope);
                let count = self.constant(COMPONENTS as u32);
                let index = self.value("OpUMod", "uint", &[&index, &count]);
                self.value("OpVectorInsertDynamic", "vector", &[&a, &word, &index])
            }
            Vector::Select(condition, a, b) => {
                let condition = self.truth(condition, scope);
                let (a, b) = (self.vector(a, scope), self.vector(b, scope));
                self.value("OpSelect", "vector", &[&condition, &a, &b])
            }
        }
    }
}

/// The function that is written.
struct Scope {
    at: usize,
}
