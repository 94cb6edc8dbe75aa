//! Rules about the operands of image instructions that are known from a module alone.

use crate::module_checks::Fault;
use crate::module_checks::code::EntryCode;
use anyhit_engine::module::ty::Type;
use anyhit_engine::module::{Definition, Id, Opcode};

/// The image operands that stand before `Offset` in the mask, with how many ids each has.
const BEFORE_OFFSET: [(u32, usize); 4] = [(0x1, 1), (0x2, 1), (0x4, 2), (0x8, 1)];
/// `Offset`
const OFFSET: u32 = 0x10;

pub(super) fn sample_operand(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for (opcode, instruction, operands) in code.with_operands() {
        let (Opcode::ImageTexelPointer, &[pointer, _, sample]) = (opcode, operands) else { continue };
        let image = code.module.pointee(Id(pointer)).map(|ty| code.module.ty(ty));
        let Some(Type::Image(image)) = image else { continue };
        if let Some(sample @ 1..) = code.module.scalar_value(Id(sample)).filter(|_| !image.multisampled) {
            let message = format!("a pointer to sample {sample} of an image that has no samples");
            faults.push(Fault { offset: instruction.offset, message });
        }
    }
}

pub(super) fn dynamic_offset(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for (opcode, instruction, operands) in code.with_operands() {
        let mask_at = match opcode {
            Opcode::ImageSampleImplicitLod
            | Opcode::ImageSampleExplicitLod
            | Opcode::ImageSampleProjImplicitLod
            | Opcode::ImageSampleProjExplicitLod
            | Opcode::ImageFetch => 2,
            Opcode::ImageSampleDrefImplicitLod
            | Opcode::ImageSampleDrefExplicitLod
            | Opcode::ImageSampleProjDrefImplicitLod
            | Opcode::ImageSampleProjDrefExplicitLod => 3,
            _ => continue,
        };
        let Some((&mask, ids)) = operands.get(mask_at..).and_then(<[u32]>::split_first) else { continue };
        if mask & OFFSET == 0 {
            continue;
        }
        let before = BEFORE_OFFSET.iter().filter(|(bit, _)| mask & bit != 0).map(|(_, count)| count).sum();
        let Some(&offset) = ids.get::<usize>(before) else { continue };
        if !matches!(code.module.definition(Id(offset)), Some(Definition::Constant(_))) {
            let message = "the offset of texels is no constant, which needs maintenance8".into();
            faults.push(Fault { offset: instruction.offset, message });
        }
    }
}
