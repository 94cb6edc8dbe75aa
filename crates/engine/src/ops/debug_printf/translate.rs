//! Translates `DebugPrintf` and `OpAbortKHR` to an operation.

use crate::machine::Reg;
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Instruction, Module};
use crate::ops::address::is_physical;
use crate::ops::conversion::encoded;
use crate::ops::debug_printf::{Argument, PrintOp, PrintOutput, PrintScalar};
use crate::ops::op::Op as Operation;
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Translates a call of the instruction set; operands begin behind set and number.
///
/// # Errors
/// `InvalidModule` where the format is no string, `UnsupportedModule` where an argument cannot be
/// printed.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let format = translator.id(instruction, 2)?;
    let Some(format) = translator.module.debug_info.strings.get(&format).cloned() else {
        let error = translator.invalid("the format of a DebugPrintf is not an OpString");
        return Err(error.note("NonSemantic.DebugPrintf, Format"));
    };
    let mut arguments = Vec::new();
    for &id in &translator.operands(instruction)[3..] {
        let id = Id(id);
        if let Some(text) = translator.module.debug_info.strings.get(&id) {
            arguments.push(Argument::Text(text.clone()));
            continue;
        }
        let ty = translator.type_of(id)?;
        let words = translator.words_unchecked(id)?;
        arguments.push(numbers(translator, ty, &words)?);
    }
    let output = PrintOutput::Printed(format);
    translator.emit(Operation::Print(PrintOp { output, arguments: arguments.into() }));
    // The call has a result of type void, which nothing may use.
    Ok(())
}

/// Translates `OpAbortKHR` (`SPV_KHR_abort`), which ends the invocation.
///
/// # Errors
/// `InvalidModule` where the operand _Message_ has another type than _Message Type_,
/// `UnsupportedModule` where a part of it cannot be shown.
pub fn abort(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    const RULE: &str = "SPV_KHR_abort: Message Type must logically match the type of Message";
    let given = translator.id(instruction, 0)?;
    let Some(Definition::Type(given)) = translator.module.definition(given) else {
        return Err(translator.invalid(format!("OpAbortKHR: %{} is not a type", given.0)).note(RULE));
    };
    let message = translator.id(instruction, 1)?;
    let ty = translator.type_of(message)?;
    if translator.scalar_fingerprint(given)? != translator.scalar_fingerprint(ty)? {
        let [given, ty] = [given, ty].map(|ty| translator.module.describe_type(ty));
        return Err(translator.invalid(format!("OpAbortKHR: a message of type {ty} as {given}")).note(RULE));
    }
    let words = translator.words_unchecked(message)?;
    let mut arguments = Vec::new();
    let mut rest = &words[..];
    message_parts(translator, ty, &mut rest, &mut arguments)?;
    let output = PrintOutput::Abort;
    translator.emit(Operation::Print(PrintOp { output, arguments: arguments.into() }));
    Ok(())
}

/// The texts, scalars and vectors of a message, in their order. `words` are those of what follows.
fn message_parts(
    translator: &mut Translator<'_>,
    ty: TypeId,
    words: &mut &[Reg],
    arguments: &mut Vec<Argument>,
) -> Result<()> {
    let count = translator.word_count(ty)? as usize;
    let module = translator.module;
    let parts = match module.ty(ty) {
        Type::Array { element, .. }
            if matches!(module.ty(*element), Type::Int { width: 8, .. }) && is_text(module, ty) =>
        {
            let (characters, rest) = words.split_at(count);
            arguments.push(Argument::Characters(characters.to_vec()));
            *words = rest;
            return Ok(());
        }
        &Type::Array { element: part, .. } | &Type::Matrix { column: part, .. } => {
            vec![part; count / (translator.word_count(part)? as usize).max(1)]
        }
        Type::Struct { members, .. } => members.iter().map(|member| member.ty).collect(),
        _ => {
            let (own, rest) = words.split_at(count);
            *words = rest;
            arguments.push(numbers(translator, ty, own)?);
            return Ok(());
        }
    };
    parts.into_iter().try_for_each(|part| message_parts(translator, part, words, arguments))
}

/// Returns true if a type has the decoration `UTFEncodedKHR` (`SPV_KHR_constant_data`).
fn is_text(module: &Module, ty: TypeId) -> bool {
    const UTF_ENCODED: u32 = 5145;
    module.id_of_type(ty).is_some_and(|id| module.decorations.find(id, UTF_ENCODED).is_some())
}

/// A scalar, a vector or a device address of these words.
fn numbers(translator: &mut Translator<'_>, ty: TypeId, words: &[Reg]) -> Result<Argument> {
    let scalar = match is_physical(translator, ty) {
        true => PrintScalar::Int(64, false),
        false => scalar(translator, ty)?,
    };
    let mut components = Vec::new();
    match scalar.is_wide() {
        true => {
            for pair in words.as_chunks::<2>().0 {
                components.push(translator.pair(pair[0], pair[1])?);
            }
        }
        false => components.extend(words),
    }
    if let Some(format) = translator.float_format(ty) {
        for component in &mut components {
            *component = encoded::widen(translator, format, *component)?.0;
        }
    }
    Ok(Argument::Numbers { scalar, components })
}

fn scalar(translator: &Translator<'_>, ty: TypeId) -> Result<PrintScalar> {
    match *translator.module.ty(ty) {
        Type::Bool => Ok(PrintScalar::Bool),
        Type::Int { width, signed } => Ok(PrintScalar::Int(width, signed)),
        Type::Float { width, encoding: None } => Ok(PrintScalar::Float(width)),
        // Other formats are printed as f32: see `encoded::widen`.
        Type::Float { .. } => Ok(PrintScalar::Float(32)),
        Type::Vector { component, .. } => scalar(translator, component),
        _ => {
            let name = translator.module.describe_type(ty);
            Err(translator.unsupported(format!(
                "texts consist of scalars, vectors, strings and device addresses, not {name}"
            )))
        }
    }
}
