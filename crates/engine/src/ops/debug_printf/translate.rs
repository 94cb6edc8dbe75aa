//! Translates `DebugPrintf` to an operation.

use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Instruction};
use crate::ops::address::is_physical;
use crate::ops::conversion::encoded;
use crate::ops::debug_printf::{Argument, PrintOp, PrintScalar};
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
        arguments.push(if is_physical(translator, ty) {
            let words = translator.words_unchecked(id)?;
            let address = translator.pair(words[0], words[1])?;
            Argument::Numbers { scalar: PrintScalar::Int(64, false), components: vec![address] }
        } else {
            let scalar = scalar(translator, ty)?;
            let mut components = translator.components(id)?.to_vec();
            if let Some(format) = translator.float_format(ty) {
                for component in &mut components {
                    *component = encoded::widen(translator, format, *component)?.0;
                }
            }
            Argument::Numbers { scalar, components }
        });
    }
    translator.emit(Operation::Print(PrintOp { format, arguments: arguments.into() }));
    // The call has a result of type void, which nothing may use.
    Ok(())
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
                "DebugPrintf prints scalars, vectors, strings and device addresses, not {name}"
            )))
        }
    }
}
