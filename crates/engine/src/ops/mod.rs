//! The instruction set: how instructions are translated to operations, and how those run.
//!
//! Regular instructions are lane kernels ([`lane_kernel`]): a scalar closure each, in the file of
//! their section. An irregular one is a variant of its file's operation, with an arm in `translate`
//! and in `eval`. The files are of four kinds:
//!
//! * Sections of the instructions in the SPIR-V specification: `arithmetic` with `dot_product` and
//!   `mixed_dot_product`,
//!   `atomic`, `barrier`, `bit`, `composite`, `conversion`, `derivative`, `image`, `linear_algebra`
//!   (sums of products), `memory` with `load_store`, `pointer`, `address` and `untyped_pointer`,
//!   `relational_logical`, `subgroup`, and `constant` for `OpSpecConstantOp`.
//! * Extensions and extended instruction sets: `amd`, `cooperative`, `debug_printf`,
//!   `float_controls`, `glsl`, `hit_object`, `integer_functions`, `ray_query`, `ray_tracing`.
//! * `irregular`: instructions of several sections that are made of lane kernels, but not
//!   componentwise.
//! * What the others share: the translator ([`translate`]), which turns ids into registers, so that
//!   composites cost nothing when the program runs; operations ([`op`], [`lane_kernel`],
//!   [`superop`]); operands (`access`, `builtin`, `integer_operand`, `intersection_view`, `object`,
//!   `pointer_layout`, `pointer_stride`, `value_registers`); rules (`interface_check`,
//!   `layout_check`, `operand_types`, `ray_rules`, `support`); other ways to execute operations
//!   (`shadow_op`, `symbolic`).
//!
//! An operation must not need the translator, which emits it: where a section defines operations
//! of its own, they and how they run stand in its file, their translation in a file below that.

pub mod access;
pub mod address;
pub mod amd;
pub mod arithmetic;
pub mod atomic;
pub mod barrier;
pub mod bit;
pub mod builtin;
pub mod composite;
pub mod constant;
pub mod conversion;
pub mod cooperative;
pub mod debug_printf;
pub mod derivative;
pub mod dot_product;
#[cfg(test)]
mod edge_vectors;
pub mod float_controls;
pub mod glsl;
pub mod heap;
pub mod heap_descriptor;
pub mod hit_object;
pub mod image;
pub mod integer_functions;
pub mod integer_operand;
pub mod interface_check;
pub mod intersection_view;
pub mod irregular;
pub mod lane_kernel;
pub mod layout_check;
pub mod linear_algebra;
pub mod load_store;
pub mod memory;
pub mod mixed_dot_product;
pub mod object;
pub mod observed;
pub mod op;
pub mod operand_types;
pub mod pointer;
pub mod pointer_layout;
pub mod pointer_stride;
pub mod ray_query;
pub mod ray_rules;
pub mod ray_tracing;
pub mod relational_logical;

pub mod shadow_op;
pub mod shared_access;
pub mod subgroup;
pub mod superop;
pub mod support;
pub mod symbolic;
pub mod trace_operands;
pub mod translate;
pub mod untyped_pointer;
pub mod value_registers;

use crate::machine::Reg;
use crate::module::{Id, Instruction, Opcode};
use crate::ops::conversion::Conversion;
use crate::ops::integer_operand::ReadAs;
use crate::ops::lane_kernel::{InstructionSet, OpFamily};
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::{Error, ErrorKind, Result};

/// The families of every section.
pub static SECTIONS: &[&[&OpFamily]] = &[
    arithmetic::FAMILIES,
    bit::FAMILIES,
    conversion::FAMILIES,
    glsl::FAMILIES,
    integer_functions::FAMILIES,
    relational_logical::FAMILIES,
];

/// Translates an instruction of a function and checks its result against its type.
///
/// # Errors
/// Those of [`translate_instruction`], and `InvalidModule` where the result is not of its type. An
/// instruction with a value of a type that is not known here is never invalid: its rules are those
/// of the type.
#[inline]
pub fn translate_checked(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    if instruction.opcode == Opcode::Nop {
        return Ok(());
    }
    let done = translate_instruction(translator, instruction);
    let checked = done.and_then(|()| translator.check_result(instruction));
    checked.map_err(|error| unless_opaque(translator, instruction, error))
}

/// The error of an instruction that breaks a rule, unless a type of it is not known here.
#[cold]
fn unless_opaque(translator: &Translator<'_>, instruction: &Instruction, error: Error) -> Error {
    if error.kind() != ErrorKind::InvalidModule {
        return error;
    }
    let module = translator.module;
    let result = instruction.result_type.and_then(|id| module.type_with_id(id));
    let operands = module.operand_ids(instruction).into_iter().filter_map(|id| module.type_of(id));
    match result.into_iter().chain(operands).find(|&ty| module.is_opaque(ty)) {
        Some(ty) => {
            let (name, ty) = (instruction.opcode, module.describe_type(ty));
            translator.unsupported(format!("{name} with a value of type {ty} is not supported"))
        }
        None => error,
    }
}

/// Translates an instruction that is neither a terminator nor part of the control flow.
///
/// # Errors
/// `InvalidModule` where it breaks a rule, `UnsupportedModule` where this crate does not run it, or
/// does not know its opcode.
pub fn translate_instruction(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    operand_types::check(translator, instruction)?;
    let opcode = instruction.opcode;
    if let Some(family) = lane_kernel::family(InstructionSet::Core, opcode.0.into()) {
        return componentwise(translator, family, instruction, 0);
    }
    if !opcode.is_known() {
        return Err(translator.unsupported(format!("{opcode} is unknown")));
    }
    let done = composite::translate(translator, instruction)?
        || pointer::translate(translator, instruction)?
        || address::translate(translator, instruction)?
        || heap::translate(translator, instruction)?
        || untyped_pointer::translate(translator, instruction)?
        || dot_product::translate(translator, instruction)?
        || mixed_dot_product::translate(translator, instruction)?
        || subgroup::translate(translator, instruction)?
        || derivative::translate(translator, instruction)?
        || atomic::translate(translator, instruction)?
        || barrier::translate(translator, instruction)?
        || cooperative::translate(translator, instruction)?
        || linear_algebra::translate(translator, instruction)?
        || irregular::translate(translator, instruction)?
        || ray_tracing::translate(translator, instruction)?
        || ray_query::translate(translator, instruction)?
        || hit_object::translate(translator, instruction)?
        || image::translate(translator, instruction)?;
    if done {
        return Ok(());
    }
    Err(translator.unsupported(format!("{opcode} is not supported")))
}

/// Applies a family's kernel to each component of the operands from `first` on.
pub fn componentwise(
    translator: &mut Translator<'_>,
    family: &'static OpFamily,
    instruction: &Instruction,
    first: usize,
) -> Result<()> {
    let ids = &translator.operands(instruction)[first..];
    let arity = family.kernels[0].operands.iter().filter(|&&words| words > 0).count();
    if ids.len() < arity {
        return Err(translator.invalid(format!("{} requires {arity} operands", family.name)));
    }
    let ty = translator.type_of(Id(ids[0]))?;
    let width = translator.scalar_width(ty)?;
    let kernel = family.kernel(width);
    let kernel = kernel.ok_or_else(|| {
        translator.unsupported(format!("{} on {width}-bit operands is not supported", family.name))
    })?;
    let mut operands: [Words; 3] = Default::default();
    for at in 0..arity {
        let id = Id(ids[at]);
        operands[at] = match free_width(family, at) {
            Some(read_as) => translator.integers(id, read_as)?,
            None if translator.type_of(id)? == ty => translator.components_of(id, width)?,
            None => {
                let (components, own) = translator.components_of_width(id)?;
                if own != width {
                    return Err(translator.invalid(format!("operand {at} of {} has {own} bits", family.name)));
                }
                components
            }
        };
        if operands[at].len() != operands[0].len() {
            return Err(translator.invalid(format!("the operands of {} differ in size", family.name)));
        }
    }
    let mut words = Words::new();
    for component in 0..operands[0].len() {
        let mut from = [Reg(0); 3];
        for (at, operand) in operands[..arity].iter().enumerate() {
            from[at] = operand[component];
        }
        let to = translator.emit_kernel(kernel, &from[..arity])?;
        words.push(to);
        if kernel.words == 2 {
            words.push(to.plus(1));
        }
    }
    if *family == bit::BitCount {
        words = convert_counts(translator, instruction, &words)?;
    }
    // The two words of a 64-bit component are consecutive, as for every value.
    translator.define_result(instruction, words);
    Ok(())
}

/// How an operand is read whose width is independent of that of the others.
fn free_width(family: &'static OpFamily, at: usize) -> Option<ReadAs> {
    if at != 1 {
        return None;
    }
    if [&bit::ShiftLeftLogical, &bit::ShiftRightLogical, &bit::ShiftRightArithmetic].contains(&family) {
        return Some(ReadAs::Unsigned);
    }
    (*family == glsl::Ldexp).then_some(ReadAs::Number)
}

/// Converts counts of bits (one word each, unsigned and below 256) to the width of the result.
fn convert_counts(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    words: &[Reg],
) -> Result<Words> {
    let width = translator.result_type(instruction).and_then(|ty| translator.scalar_width(ty))?;
    let Some(kernel) = conversion::kernel(Conversion::U, 32, width) else { return Ok(words.into()) };
    let counts =
        words.iter().map(|&word| translator.emit_kernel(kernel, &[word])).collect::<Result<Words>>()?;
    Ok(translator.expand_components(&counts, width))
}
