//! Checks layouts that depend on computed constants, before anything is lowered.
//!
//! [`Module::validate`](crate::module::Module::validate) checks all others: the value of an
//! `OpSpecConstantOp` is known where instructions are translated.

use crate::module::constant::ConstantValue;
use crate::module::interface::Stage;
use crate::module::ty::Type;
use crate::module::validate::explicit_layout::LayoutFeatures;
use crate::module::validate::layout::layout_faults;
use crate::module::{Definition, Id, Module};
use crate::ops::translate::Translator;
use anyhit_base::error::{Error, ErrorKind, Place, Result};

/// Checks the layouts of a module in which the length of an array is a computed constant.
///
/// # Errors
/// `InvalidModule` with each broken rule.
pub fn check(module: &Module) -> Result<()> {
    if !has_computed_length(module) {
        return Ok(());
    }
    errors(module, LayoutFeatures::ALL)
}

/// Checks the layouts of a module under features of a device.
///
/// # Errors
/// `InvalidModule` with each broken rule.
pub fn check_with(module: &Module, features: LayoutFeatures) -> Result<()> {
    match features {
        LayoutFeatures::ALL => Ok(()),
        _ => errors(module, features),
    }
}

fn errors(module: &Module, features: LayoutFeatures) -> Result<()> {
    let length = |id: Id| {
        let computed = || Translator::new(module, Stage::RayGeneration).array_length(id).ok().map(u64::from);
        module.scalar_value(id).or_else(computed)
    };
    let faults = layout_faults(module, features, &length);
    let error = |(word, _, fault): (usize, _, crate::module::validate::explicit_layout::LayoutFault)| {
        let error = Error::new(ErrorKind::InvalidModule, fault.message).at(Place::Word(word));
        error.note(format!("rule: {}", fault.rule)).note(format!("fix: {}", fault.fix))
    };
    match faults.is_empty() {
        true => Ok(()),
        false => Err(Error::several(faults.into_iter().map(error).collect())),
    }
}

fn has_computed_length(module: &Module) -> bool {
    module.types.iter().any(|ty| match *ty {
        Type::Array { length, .. } => match module.definition(length) {
            Some(Definition::Constant(index)) => {
                matches!(module.constants[index as usize].value, ConstantValue::Operation { .. })
            }
            _ => false,
        },
        _ => false,
    })
}
