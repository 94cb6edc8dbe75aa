//! Translates image instructions to operations.

use smallvec::SmallVec;

use crate::module::ty::{ImageType, Type, TypeId};
use crate::module::{Instruction, Module, Opcode};
use crate::ops::image::{IMPLICIT, access, footprint, processing, query, sample};
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Translates image instructions; `false` for an instruction of another section.
///
/// # Errors
/// `InvalidModule` where it breaks a rule, `UnsupportedModule` where this crate does not run it.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    match opcode {
        Opcode::SampledImage => {
            check_sampled_image(translator, instruction)?;
            let (image, sampler) = (translator.operand(instruction, 0)?, translator.operand(instruction, 1)?);
            translator.define_result(instruction, SmallVec::from_slice(&[image[0], sampler[0]]));
        }
        Opcode::Image => {
            let sampled = translator.type_of(translator.id(instruction, 0)?)?;
            let result = translator.result_type(instruction)?;
            if !matches!(*translator.module.ty(sampled), Type::SampledImage(image) if image == result) {
                return Err(translator.invalid("OpImage requires a sampled image of its result type"));
            }
            let words = translator.operand(instruction, 0)?;
            translator.define_result(instruction, SmallVec::from_slice(&words[..1]));
        }
        // Code 0 says that all texels were resident; no other code occurs.
        Opcode::ImageSparseTexelsResident => {
            let resident = translator.constant(1)?;
            translator.define_result(instruction, SmallVec::from_slice(&[resident]));
        }
        _ if IMPLICIT.contains(&opcode) && !translator.derivatives => {
            return Err(translator.invalid(format!(
                "{opcode} requires implicit derivatives, which only fragment stages and compute with a \
                 derivative group have (SPIR-V 3.3.10, \"{opcode}\"): specify the level of detail or \
                 gradients explicitly"
            )));
        }
        _ => {
            return Ok(sample::translate(translator, instruction)?
                || access::translate(translator, instruction)?
                || query::translate(translator, instruction)?
                || footprint::translate(translator, instruction)?
                || processing::translate(translator, instruction)?);
        }
    }
    Ok(true)
}

/// Returns true if `OpSampledImage` may make a sampled image around one image type of an image of
/// another: they differ at most in `Depth`, which Vulkan ignores ("Depth is ignored", "Validation
/// Rules within a Module") and `spirv-val` does not compare.
fn are_combined(module: &Module, found: TypeId, wanted: TypeId) -> bool {
    match (module.ty(found), module.ty(wanted)) {
        (Type::Image(found), Type::Image(wanted)) => ImageType { depth: wanted.depth, ..*found } == *wanted,
        _ => found == wanted,
    }
}

/// Checks that `OpSampledImage` combines a sampler with an image of its result's type.
fn check_sampled_image(translator: &Translator<'_>, instruction: &Instruction) -> Result<()> {
    let result = translator.result_type(instruction)?;
    let Type::SampledImage(image) = *translator.module.ty(result) else {
        return Err(translator.invalid("the result of OpSampledImage is not a sampled image"));
    };
    let found = translator.type_of(translator.id(instruction, 0)?)?;
    if !are_combined(translator.module, found, image) {
        return Err(
            translator.invalid("the image of OpSampledImage does not have the image type of its result")
        );
    }
    let sampler = translator.type_of(translator.id(instruction, 1)?)?;
    match *translator.module.ty(sampler) {
        Type::Sampler => Ok(()),
        _ => Err(translator.invalid("the sampler operand of OpSampledImage is not a sampler")),
    }
}
