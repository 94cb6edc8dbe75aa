//! Writes SPIR-V modules: shaders that read and write the words of one storage buffer.

use std::collections::HashMap;

use rspirv::spirv::{BuiltIn, Capability, Decoration, ExecutionMode, ExecutionModel, Op, StorageClass};

/// The id of a result.
pub type Id = u32;

/// A module under construction, with a function `main` whose body is added to.
pub struct Writer {
    model: ExecutionModel,
    entry_points: Vec<u32>,
    modes: Vec<u32>,
    annotations: Vec<u32>,
    globals: Vec<u32>,
    functions: Vec<u32>,
    locals: Vec<u32>,
    /// Body of `main`, or of the function that is being written.
    body: Vec<u32>,
    next: Id,
    constants: HashMap<(Id, u32), Id>,
    pointers: HashMap<(u32, Id), Id>,
    interface: Vec<Id>,
    pub void: Id,
    pub bool: Id,
    pub uint: Id,
    pub float: Id,
    main_type: Id,
    main: Id,
    main_label: Id,
    buffer: Id,
}

impl Writer {
    /// A module with the entry point `main`, and a buffer of words at set 0, binding 1.
    pub fn new(model: ExecutionModel) -> Self {
        let mut it = Self {
            model,
            entry_points: Vec::new(),
            modes: Vec::new(),
            annotations: Vec::new(),
            globals: Vec::new(),
            functions: Vec::new(),
            locals: Vec::new(),
            body: Vec::new(),
            next: 1,
            constants: HashMap::new(),
            pointers: HashMap::new(),
            interface: Vec::new(),
            void: 0,
            bool: 0,
            uint: 0,
            float: 0,
            main_type: 0,
            main: 0,
            main_label: 0,
            buffer: 0,
        };
        it.void = it.global(Op::TypeVoid, &[]);
        it.bool = it.global(Op::TypeBool, &[]);
        it.uint = it.global(Op::TypeInt, &[32, 0]);
        it.float = it.global(Op::TypeFloat, &[32]);
        it.main_type = it.global(Op::TypeFunction, &[it.void]);
        (it.main, it.main_label) = (it.fresh(), it.fresh());
        let words = it.global(Op::TypeRuntimeArray, &[it.uint]);
        let block = it.global(Op::TypeStruct, &[words]);
        it.buffer = it.variable(StorageClass::StorageBuffer, block);
        it.decorate(words, Decoration::ArrayStride, &[4]);
        it.decorate(block, Decoration::Block, &[]);
        it.bind(it.buffer, 1);
        push(&mut it.annotations, Op::MemberDecorate, &[block, 0, Decoration::Offset as u32, 0]);
        it
    }

    pub fn fresh(&mut self) -> Id {
        self.next += 1;
        self.next - 1
    }

    /// Adds a type or another result at module scope.
    pub fn global(&mut self, op: Op, operands: &[u32]) -> Id {
        let id = self.fresh();
        push(&mut self.globals, op, &[&[id], operands].concat());
        id
    }

    /// Adds a result with a type at module scope.
    pub fn global_of(&mut self, op: Op, ty: Id, operands: &[u32]) -> Id {
        let id = self.fresh();
        push(&mut self.globals, op, &[&[ty, id], operands].concat());
        id
    }

    pub fn decorate(&mut self, target: Id, decoration: Decoration, operands: &[u32]) {
        push(&mut self.annotations, Op::Decorate, &[&[target, decoration as u32], operands].concat());
    }

    /// Binds a variable in set 0.
    pub fn bind(&mut self, variable: Id, binding: u32) {
        self.decorate(variable, Decoration::DescriptorSet, &[0]);
        self.decorate(variable, Decoration::Binding, &[binding]);
    }

    pub fn pointer(&mut self, class: StorageClass, ty: Id) -> Id {
        if let Some(&id) = self.pointers.get(&(class as u32, ty)) {
            return id;
        }
        let id = self.global(Op::TypePointer, &[class as u32, ty]);
        self.pointers.insert((class as u32, ty), id);
        id
    }

    /// A variable at module scope.
    pub fn variable(&mut self, class: StorageClass, ty: Id) -> Id {
        let (pointer, id) = (self.pointer(class, ty), self.fresh());
        push(&mut self.globals, Op::Variable, &[pointer, id, class as u32]);
        self.interface.push(id);
        id
    }

    pub fn builtin(&mut self, builtin: BuiltIn, ty: Id) -> Id {
        let id = self.variable(StorageClass::Input, ty);
        self.decorate(id, Decoration::BuiltIn, &[builtin as u32]);
        id
    }

    /// A variable of `main`.
    pub fn local(&mut self, ty: Id) -> Id {
        let (pointer, id) = (self.pointer(StorageClass::Function, ty), self.fresh());
        push(&mut self.locals, Op::Variable, &[pointer, id, StorageClass::Function as u32]);
        id
    }

    /// A constant of 32 bits.
    pub fn constant_of(&mut self, ty: Id, bits: u32) -> Id {
        if let Some(&id) = self.constants.get(&(ty, bits)) {
            return id;
        }
        let id = self.fresh();
        push(&mut self.globals, Op::Constant, &[ty, id, bits]);
        self.constants.insert((ty, bits), id);
        id
    }

    pub fn constant(&mut self, value: u32) -> Id {
        self.constant_of(self.uint, value)
    }

    pub fn number(&mut self, value: f32) -> Id {
        self.constant_of(self.float, value.to_bits())
    }

    /// Adds an instruction to the body.
    pub fn op(&mut self, op: Op, operands: &[u32]) {
        push(&mut self.body, op, operands);
    }

    /// Adds an instruction with a result to the body.
    pub fn result(&mut self, op: Op, ty: Id, operands: &[u32]) -> Id {
        let id = self.fresh();
        self.op(op, &[&[ty, id], operands].concat());
        id
    }

    /// A word of the buffer.
    pub fn word_at(&mut self, index: Id) -> Id {
        let (zero, uint) = (self.constant(0), self.uint);
        let pointer = self.pointer(StorageClass::StorageBuffer, uint);
        self.result(Op::AccessChain, pointer, &[self.buffer, zero, index])
    }

    pub fn load_word(&mut self, index: Id) -> Id {
        let at = self.word_at(index);
        self.result(Op::Load, self.uint, &[at])
    }

    pub fn store_word(&mut self, index: Id, value: Id) {
        let at = self.word_at(index);
        self.op(Op::Store, &[at, value]);
    }

    /// Adds a branch to the labels of a block and of the one behind it, and begins the former.
    pub fn begin_if(&mut self, condition: Id) -> Id {
        let [then, merge] = [self.fresh(), self.fresh()];
        self.op(Op::SelectionMerge, &[merge, 0]);
        self.op(Op::BranchConditional, &[condition, then, merge]);
        self.op(Op::Label, &[then]);
        merge
    }

    pub fn end_if(&mut self, merge: Id) {
        self.op(Op::Branch, &[merge]);
        self.op(Op::Label, &[merge]);
    }

    /// Adds a loop of `count` turns; `turn` adds to its body.
    pub fn repeat(&mut self, count: Id, turn: impl FnOnce(&mut Self, Id)) {
        let [head, test, body, more, merge] = [0; 5].map(|_| self.fresh());
        let (zero, one, uint) = (self.constant(0), self.constant(1), self.uint);
        let counter = self.local(uint);
        self.op(Op::Store, &[counter, zero]);
        self.op(Op::Branch, &[head]);
        self.op(Op::Label, &[head]);
        self.op(Op::LoopMerge, &[merge, more, 0]);
        self.op(Op::Branch, &[test]);
        self.op(Op::Label, &[test]);
        let at = self.result(Op::Load, uint, &[counter]);
        let again = self.result(Op::ULessThan, self.bool, &[at, count]);
        self.op(Op::BranchConditional, &[again, body, merge]);
        self.op(Op::Label, &[body]);
        turn(self, at);
        self.op(Op::Branch, &[more]);
        self.op(Op::Label, &[more]);
        let next = self.result(Op::IAdd, uint, &[at, one]);
        self.op(Op::Store, &[counter, next]);
        self.op(Op::Branch, &[head]);
        self.op(Op::Label, &[merge]);
    }

    /// Adds a function of one parameter, and returns it.
    pub fn function(&mut self, ty: Id, result: Id, write: impl FnOnce(&mut Self, Id) -> Id) -> Id {
        let [function, parameter, label] = [0; 3].map(|_| self.fresh());
        let main = std::mem::take(&mut self.body);
        self.op(Op::Function, &[result, function, 0, ty]);
        self.op(Op::FunctionParameter, &[result, parameter]);
        self.op(Op::Label, &[label]);
        let value = write(self, parameter);
        self.op(Op::ReturnValue, &[value]);
        self.op(Op::FunctionEnd, &[]);
        let written = std::mem::replace(&mut self.body, main);
        self.functions.extend(written);
        function
    }

    /// Ends `main`, calls it by this name, and begins another one of the same kind.
    pub fn end_entry_point(&mut self, name: &str) {
        let body = std::mem::take(&mut self.body);
        let ends = [Op::IgnoreIntersectionKHR as u32 | 1 << 16];
        push(&mut self.functions, Op::Function, &[self.void, self.main, 0, self.main_type]);
        push(&mut self.functions, Op::Label, &[self.main_label]);
        self.functions.append(&mut self.locals);
        self.functions.extend(&body);
        if !body.ends_with(&ends) {
            push(&mut self.functions, Op::Return, &[]);
        }
        push(&mut self.functions, Op::FunctionEnd, &[]);
        let operands = [&[self.model as u32, self.main][..], &text(name), &self.interface].concat();
        push(&mut self.entry_points, Op::EntryPoint, &operands);
        if self.model == ExecutionModel::GLCompute {
            let mode = [self.main, ExecutionMode::LocalSize as u32, 64, 1, 1];
            push(&mut self.modes, Op::ExecutionMode, &mode);
        }
        (self.main, self.main_label) = (self.fresh(), self.fresh());
    }

    /// The bytes of the module, with `main` at its end.
    pub fn finish(mut self) -> Vec<u8> {
        self.end_entry_point("main");
        self.bytes()
    }

    /// The bytes of the module of the entry points that were ended.
    pub fn bytes(self) -> Vec<u8> {
        let mut words = vec![0x0723_0203, 0x0001_0400, 0, self.next, 0];
        let is_compute = self.model == ExecutionModel::GLCompute;
        let capability = if is_compute { Capability::Shader } else { Capability::RayTracingKHR };
        push(&mut words, Op::Capability, &[capability as u32]);
        if !is_compute {
            push(&mut words, Op::Extension, &text("SPV_KHR_ray_tracing"));
        }
        push(&mut words, Op::MemoryModel, &[0, 1]);
        for part in [self.entry_points, self.modes, self.annotations, self.globals, self.functions] {
            words.extend(part);
        }
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }
}

fn push(words: &mut Vec<u32>, op: Op, operands: &[u32]) {
    words.push(op as u32 | (operands.len() as u32 + 1) << 16);
    words.extend(operands);
}

/// A literal string.
fn text(text: &str) -> Vec<u32> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize((text.len() + 4) / 4 * 4, 0);
    bytes.chunks(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect()
}
