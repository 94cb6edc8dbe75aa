//! Checks that bfloat16 and 8-bit floats appear only in instructions that allow them.
//!
//! `SPV_KHR_bfloat16` and `SPV_EXT_float8`, "Validation Rules", name the sections of the
//! specification whose instructions take such values or composites of them: constants, memory,
//! functions, conversions, composites, a few more; `OpDot` takes bfloat16, extension instructions
//! and mode settings take 8-bit floats. Pointers to them are no such values.
//!
//! This is looser than the text for `OpUndef`, which compilers emit, and for `NonSemantic`
//! instructions, which must not change what a module means.

use crate::math::float_format::FloatFormat;
use crate::module::constant::ConstantValue;
use crate::module::grammar::{is_id, walk};
use crate::module::span::{invalid, span_of};
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Instruction, Module, Opcode};
use anyhit_base::error::{Error, ErrorKind, Place, Result};

/// `SaturatedToLargestFloat8NormalConversionEXT`
pub const SATURATED: u32 = 4216;
/// `BFloat16ArithmeticINTEL`, of `SPV_INTEL_bfloat16_arithmetic`.
const BFLOAT16_ARITHMETIC: u32 = 6226;

/// The types of a module that are or contain bfloat16 or 8-bit floats.
pub(super) struct EncodedTypes {
    by_type: Vec<Option<FloatFormat>>,
    any: bool,
}

impl EncodedTypes {
    /// Examines all types. The parts of a type are declared before it, except for pointees.
    pub(super) fn of(module: &Module) -> Self {
        let mut by_type: Vec<Option<FloatFormat>> = Vec::with_capacity(module.types.len());
        for ty in &module.types {
            let part = |id: &TypeId| by_type.get(id.0 as usize).copied().flatten();
            by_type.push(match ty {
                Type::Float { .. } => ty.float_format().filter(|format| is_encoded(*format)),
                Type::Vector { component: inner, .. }
                | Type::Matrix { column: inner, .. }
                | Type::Array { element: inner, .. }
                | Type::RuntimeArray { element: inner, .. } => part(inner),
                Type::Struct { members, .. } => members.iter().find_map(|member| part(&member.ty)),
                _ => None,
            });
        }
        Self { any: by_type.iter().any(Option::is_some), by_type }
    }

    fn of_value(&self, module: &Module, id: Id) -> Option<FloatFormat> {
        let Some(Definition::Type(ty)) = module.definition(id) else {
            return self.by_type[module.type_of(id)?.0 as usize];
        };
        self.by_type[ty.0 as usize]
    }
}

fn is_encoded(format: FloatFormat) -> bool {
    matches!(format, FloatFormat::BFloat16 | FloatFormat::E4M3 | FloatFormat::E5M2)
}

/// Checks one instruction of a function.
///
/// # Errors
/// `InvalidModule` where an operand or the result is a float that it must not be used with, or a
/// result is decorated to saturate that is no conversion to an 8-bit float; `UnsupportedModule`
/// where arithmetic on bfloat16 is declared.
pub(super) fn instruction(module: &Module, encoded: &EncodedTypes, instruction: &Instruction) -> Result<()> {
    if !encoded.any {
        return Ok(());
    }
    let op = instruction.opcode;
    let at = instruction.offset as usize;
    if let Some(id) = instruction.result {
        check_saturation(module, encoded, id, instruction.result_type, op, at)?;
    }
    if allows_every_encoding(op) {
        return Ok(());
    }
    let extension = extension_of(module, op, module.operands(instruction));
    if let Some(ty) = instruction.result_type {
        check_value(module, encoded, op, extension, ty, at)?;
    }
    let literal_words = module.switch_literal_words(instruction);
    walk(&module.words, span_of(instruction), literal_words, &mut |at, kind| match is_id(kind) {
        true => check_value(module, encoded, op, extension, Id(module.words[at]), at),
        false => Ok(()),
    })
}

/// Checks the constants that `OpSpecConstantOp` defines.
///
/// # Errors
/// As [`instruction`].
pub(super) fn constants(module: &Module, encoded: &EncodedTypes) -> Result<()> {
    if !encoded.any {
        return Ok(());
    }
    for constant in &module.constants {
        let ConstantValue::Operation { opcode, operands } = &constant.value else { continue };
        if !opcode.is_known() {
            continue;
        }
        let op = *opcode;
        let at = constant.offset as usize;
        check_saturation(module, encoded, constant.id, module.id_of_type(constant.ty), op, at)?;
        if !allows_every_encoding(op) {
            for (index, &operand) in operands.iter().enumerate() {
                check_value(module, encoded, op, None, Id(operand), at + 4 + index)?;
            }
        }
    }
    Ok(())
}

/// Whether an instruction is in one of the sections that both extensions name.
fn allows_every_encoding(op: Opcode) -> bool {
    matches!(
        op,
        // Memory and functions.
        Opcode::Variable | Opcode::Load | Opcode::Store | Opcode::CopyMemory | Opcode::CopyMemorySized
        | Opcode::Function | Opcode::FunctionParameter | Opcode::FunctionCall | Opcode::ReturnValue
        | Opcode::LifetimeStart | Opcode::LifetimeStop
        // Conversions.
        | Opcode::ConvertFToU | Opcode::ConvertFToS | Opcode::ConvertSToF | Opcode::ConvertUToF | Opcode::UConvert
        | Opcode::SConvert | Opcode::FConvert | Opcode::QuantizeToF16 | Opcode::SatConvertSToU | Opcode::SatConvertUToS
        | Opcode::ConvertPtrToU | Opcode::ConvertUToPtr | Opcode::Bitcast
        // Composites.
        | Opcode::VectorExtractDynamic | Opcode::VectorInsertDynamic | Opcode::VectorShuffle
        | Opcode::CompositeConstruct | Opcode::CompositeExtract | Opcode::CompositeInsert | Opcode::CopyObject
        | Opcode::Transpose | Opcode::CopyLogical | Opcode::CompositeConstructReplicateEXT
        | Opcode::CooperativeMatrixMulAddKHR | Opcode::CooperativeMatrixLengthKHR
        | Opcode::CooperativeMatrixLoadKHR | Opcode::CooperativeMatrixStoreKHR
        | Opcode::CooperativeMatrixConvertNV | Opcode::CooperativeMatrixTransposeNV
        | Opcode::CooperativeVectorLoadNV | Opcode::CooperativeVectorStoreNV
        | Opcode::CooperativeVectorMatrixMulNV | Opcode::CooperativeVectorMatrixMulAddNV
        // They check the types of their operands.
        | Opcode::FDot2MixAcc32VALVE | Opcode::FDot2MixAcc16VALVE | Opcode::FDot4MixAcc32VALVE | Opcode::AbortKHR
        | Opcode::Select | Opcode::Phi | Opcode::Undef | Opcode::PoisonKHR | Opcode::FreezeKHR
    )
}

/// The instruction set of an `OpExtInst`.
fn extension_of<'m>(module: &'m Module, op: Opcode, operands: &[u32]) -> Option<&'m str> {
    if !matches!(op, Opcode::ExtInst | Opcode::ExtInstWithForwardRefsKHR) {
        return None;
    }
    match module.definition(Id(*operands.first()?)) {
        Some(Definition::InstructionSet(at)) => Some(&module.instruction_sets[at as usize]),
        _ => None,
    }
}

fn check_value(
    module: &Module,
    encoded: &EncodedTypes,
    op: Opcode,
    extension: Option<&str>,
    id: Id,
    at: usize,
) -> Result<()> {
    let Some(format) = encoded.of_value(module, id) else { return Ok(()) };
    let (allowed, section) = match format {
        FloatFormat::BFloat16 => (op == Opcode::Dot, "SPV_KHR_bfloat16, Validation Rules"),
        _ => (extension.is_some(), "SPV_EXT_float8, Validation Rules"),
    };
    if allowed || extension.is_some_and(|set| set.starts_with("NonSemantic.")) {
        return Ok(());
    }
    let name = op;
    let described = module.describe_id(id);
    if format == FloatFormat::BFloat16 && module.capabilities.contains(&BFLOAT16_ARITHMETIC) {
        let message = format!("{name} on bfloat16_t (BFloat16ArithmeticINTEL)");
        return Err(Error::new(ErrorKind::UnsupportedModule, message).at(Place::Word(at)));
    }
    Err(invalid(at, format!("{name} must not be used with {described} ({section})")))
}

/// Checks that a result that is decorated to saturate comes from a conversion to an 8-bit float.
fn check_saturation(
    module: &Module,
    encoded: &EncodedTypes,
    id: Id,
    ty: Option<Id>,
    op: Opcode,
    at: usize,
) -> Result<()> {
    if module.decorations.find(id, SATURATED).is_none() {
        return Ok(());
    }
    // Components of a type that is not known here, as of a cooperative matrix, may be such floats.
    let is_opaque = |ty: Id| module.type_with_id(ty).is_some_and(|ty| module.is_opaque(ty));
    let format = ty.and_then(|ty| encoded.of_value(module, ty));
    let converts = matches!(op, Opcode::FConvert | Opcode::ConvertSToF | Opcode::ConvertUToF);
    match format {
        Some(FloatFormat::E4M3 | FloatFormat::E5M2) if converts => Ok(()),
        None if converts && ty.is_some_and(is_opaque) => Ok(()),
        _ => Err(invalid(
            at,
            format!(
                "SaturatedToLargestFloat8NormalConversionEXT applies to OpFConvert, OpConvertSToF and \
                 OpConvertUToF to an 8-bit float, not to {} (SPV_EXT_float8, Decoration)",
                op
            ),
        )),
    }
}
