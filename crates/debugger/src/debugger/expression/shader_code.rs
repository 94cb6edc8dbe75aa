//! Instructions of SPIR-V for an expression: each is run by the interpreter, in a module of its
//! own, so that its result has the bits that a shader would get.

use std::sync::Arc;

use crate::debugger::expression::numbers::{
    Calculated, CalculatedValue, ComponentBits, NumberShape, ScalarType, mask, signed,
};
use anyhit_base::error::Result;
use anyhit_engine::interp;
use anyhit_engine::machine::{Batch, Bindings, Exit, Mask};
use anyhit_engine::module::{Id, Opcode, load};
use anyhit_engine::ops::translate::IdValue;
use anyhit_engine::program::{LowerOptions, Optimization, lower_with};

/// An instruction that calculates a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Instruction {
    /// Of SPIR-V itself, by its opcode.
    Core(Opcode),
    /// Of `GLSL.std.450`, by its number.
    Extended(u32),
}

/// `Matrix`, `Shader`, `Float16`, `Float64`, `Int64`, `Int16`, `Int8`
const CAPABILITIES: [u32; 7] = [0, 1, 9, 10, 11, 22, 39];
/// `GLCompute`
const COMPUTE: u32 = 5;
/// `LocalSize`
const LOCAL_SIZE: u32 = 17;
/// `GLSL450`
const MEMORY_MODEL_GLSL: u32 = 1;
/// Instructions that the interpreter may execute; there are no loops.
const FUEL: u64 = 1 << 16;

/// Runs an instruction on operands.
///
/// # Errors
/// That there is no such instruction for values of these types.
pub(super) fn run(
    instruction: Instruction,
    (ty, shape): (ScalarType, NumberShape),
    operands: &[CalculatedValue],
) -> Result<CalculatedValue> {
    let mut code = ModuleWords::new();
    let result = code.function(instruction, (ty, shape), operands);
    let module = Arc::new(load(&code.bytes())?);
    let options = LowerOptions { optimization: Optimization::None, verify: false, ..LowerOptions::default() };
    let program = lower_with(&module, &module.entry_points[0], options)?;
    let mut batch: Batch<1> = program.batch();
    program.begin(&mut batch, Mask::ALL, FUEL);
    interp::run_lane(&mut batch, &program, &Bindings::default(), None);
    let registers = match program.id_values.find(0, Id(result)) {
        Some(IdValue::Words(registers)) if batch.exits[0] == Exit::Returned => registers,
        _ => unreachable!("bug in anyhit: an instruction without a result"),
    };
    let words: Vec<u32> = registers.iter().map(|&register| batch.registers[register].0[0]).collect();
    let each = if ty.width() == 64 { 2 } else { 1 };
    let bits = words.chunks(each).map(|words| {
        let high = words.get(1).copied().unwrap_or(0);
        u64::from(words[0]) | u64::from(high) << 32
    });
    Ok(CalculatedValue::new(ty, shape, bits.map(|bits| bits & mask(ty)).collect()))
}

/// Runs an instruction on operands; `name` is the function that the expression calls.
pub(super) fn call(
    name: &str,
    instruction: Instruction,
    result: (ScalarType, NumberShape),
    operands: &[CalculatedValue],
) -> Calculated {
    run(instruction, result, operands).map_err(|_| {
        let types: Vec<String> = operands.iter().map(CalculatedValue::type_name).collect();
        format!("`{name}` is not defined for {}", types.join(" and "))
    })
}

/// The words of a module under construction.
struct ModuleWords {
    words: Vec<u32>,
    next: u32,
    /// The types that have been declared, with their ids.
    types: Vec<((ScalarType, NumberShape), u32)>,
}

impl ModuleWords {
    /// The import of `GLSL.std.450`.
    const IMPORT: u32 = 1;
    /// The function.
    const MAIN: u32 = 2;

    fn new() -> Self {
        // Magic number, version 1.6, no generator, the bound and the schema.
        let mut code = Self { words: vec![0x0723_0203, 0x0001_0600, 0, 0, 0], next: 3, types: Vec::new() };
        for capability in CAPABILITIES {
            code.add(Opcode::Capability, &[capability]);
        }
        let text = |text: &str, before: &[u32]| -> Vec<u32> {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(text.len() / 4 * 4 + 4, 0);
            let words =
                bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap_or_default()));
            before.iter().copied().chain(words).collect()
        };
        code.add(Opcode::ExtInstImport, &text("GLSL.std.450", &[Self::IMPORT]));
        code.add(Opcode::MemoryModel, &[0, MEMORY_MODEL_GLSL]);
        code.add(Opcode::EntryPoint, &text("main", &[COMPUTE, Self::MAIN]));
        code.add(Opcode::ExecutionMode, &[Self::MAIN, LOCAL_SIZE, 1, 1, 1]);
        code
    }

    fn bytes(mut self) -> Vec<u8> {
        self.words[3] = self.next;
        self.words.into_iter().flat_map(u32::to_le_bytes).collect()
    }

    fn add(&mut self, opcode: Opcode, operands: &[u32]) {
        self.words.push((operands.len() as u32 + 1) << 16 | u32::from(opcode.0));
        self.words.extend_from_slice(operands);
    }

    fn id(&mut self) -> u32 {
        self.next += 1;
        self.next - 1
    }

    /// Adds an instruction whose first operand is its result.
    fn define(&mut self, opcode: Opcode, operands: &[u32]) -> u32 {
        let id = self.id();
        self.add(opcode, &[&[id], operands].concat());
        id
    }

    fn type_of(&mut self, ty: ScalarType, shape: NumberShape) -> u32 {
        if let Some((_, known)) = self.types.iter().find(|(known, _)| *known == (ty, shape)) {
            return *known;
        }
        let id = match (shape, ty) {
            (NumberShape::Scalar, ScalarType::Bool) => self.define(Opcode::TypeBool, &[]),
            (NumberShape::Scalar, ScalarType::Int(width)) => self.define(Opcode::TypeInt, &[width, 1]),
            (NumberShape::Scalar, ScalarType::Uint(width)) => self.define(Opcode::TypeInt, &[width, 0]),
            (NumberShape::Scalar, ScalarType::Float(width)) => self.define(Opcode::TypeFloat, &[width]),
            (NumberShape::Vector(count), _) => {
                let scalar = self.type_of(ty, NumberShape::Scalar);
                self.define(Opcode::TypeVector, &[scalar, count])
            }
            (NumberShape::Matrix { columns, rows } | NumberShape::Array { elements: columns, rows }, _) => {
                let column = self.type_of(ty, NumberShape::Vector(rows));
                self.define(Opcode::TypeMatrix, &[column, columns])
            }
        };
        self.types.push(((ty, shape), id));
        id
    }

    /// Adds a constant of a shape.
    fn constant(&mut self, value: &CalculatedValue) -> u32 {
        let ty = self.type_of(value.ty(), value.shape());
        let id = |code: &mut Self, opcode: Opcode, operands: &[u32]| {
            let id = code.id();
            code.add(opcode, &[&[ty, id], operands].concat());
            id
        };
        if let Some((_, count)) = value.shape().part() {
            let parts = (0..count.into()).filter_map(|at| value.part(at));
            let parts: Vec<u32> = parts.collect::<Vec<_>>().iter().map(|part| self.constant(part)).collect();
            return id(self, Opcode::ConstantComposite, &parts);
        }
        let bits = value.bits()[0];
        match value.ty() {
            ScalarType::Bool if bits != 0 => id(self, Opcode::ConstantTrue, &[]),
            ScalarType::Bool => id(self, Opcode::ConstantFalse, &[]),
            // Numbers of fewer bits than a word are extended by their signs.
            ScalarType::Int(width @ ..32) => id(self, Opcode::Constant, &[signed(bits, width) as u32]),
            ty if ty.width() == 64 => id(self, Opcode::Constant, &[bits as u32, (bits >> 32) as u32]),
            _ => id(self, Opcode::Constant, &[bits as u32]),
        }
    }

    /// Adds the function; returns the id of the result.
    fn function(
        &mut self,
        instruction: Instruction,
        (ty, shape): (ScalarType, NumberShape),
        operands: &[CalculatedValue],
    ) -> u32 {
        let void = self.define(Opcode::TypeVoid, &[]);
        let signature = self.define(Opcode::TypeFunction, &[void]);
        let result_type = self.type_of(ty, shape);
        let operands: Vec<u32> = operands.iter().map(|operand| self.constant(operand)).collect();
        self.add(Opcode::Function, &[void, Self::MAIN, 0, signature]);
        self.define(Opcode::Label, &[]);
        let result = self.id();
        let (opcode, before) = match instruction {
            Instruction::Core(opcode) => (opcode, vec![result_type, result]),
            Instruction::Extended(number) => {
                (Opcode::ExtInst, vec![result_type, result, Self::IMPORT, number])
            }
        };
        self.add(opcode, &[before, operands].concat());
        self.add(Opcode::Return, &[]);
        self.add(Opcode::FunctionEnd, &[]);
        result
    }
}

/// The components of a value, each of which is the same.
pub(super) fn spread(value: &CalculatedValue, shape: NumberShape) -> CalculatedValue {
    let bits: ComponentBits = match value.bits() {
        &[one] => std::iter::repeat_n(one, shape.components() as usize).collect(),
        bits => bits.into(),
    };
    CalculatedValue::new(value.ty(), shape, bits)
}
