//! `OpImageSampleFootprintNV` (`SPV_NV_shader_image_footprint`; Vulkan, "Texel Footprint
//! Evaluation"): which groups of texels a sampling instruction would read.
//!
//! Only addresses clamped to the edge have a defined footprint, others trap their lane; so does a
//! sampler with anisotropy, whose probes are implementation-defined. A texel whose weight is 0 is
//! not read. The requested granularity always suffices, and is reported as 0.

use crate::machine::image::Dimension;
use crate::machine::sampler::AddressMode;
use crate::machine::{Reg, TrapCode};
use crate::math::array;
use crate::module::ty::Type;
use crate::module::{Instruction, Opcode};
use crate::ops::access::Access;
use crate::ops::derivative::derivative;
use crate::ops::image::ImageOp;
use crate::ops::image::declared::view_of;
use crate::ops::image::filter::Lookup;
use crate::ops::image::operands::Operands;
use crate::ops::image::reader::LaneReader;
use crate::ops::image::view::View;
use crate::ops::op::Op as Operation;
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// An operation that gives the footprint of a sample.
#[derive(Clone, Debug, PartialEq)]
pub struct FootprintOp {
    /// The first register of the result: whether one level is read; anchor; offset; mask of two
    /// words; level; granularity.
    pub to: Reg,
    registers: u32,
    /// The declared view of the image.
    pub view: View,
    /// The image's handle.
    pub image: Reg,
    pub(super) sampler: Reg,
    coordinate: Words,
    granularity: Reg,
    coarse: Reg,
    operands: Operands,
}

/// Width, height and depth of a group of texels; `None` for a granularity without groups.
fn group_extent(granularity: u32, axes: usize) -> Option<[u32; 3]> {
    let plane = |at: u32| match at {
        1 => Some([2, 2]),
        2 => Some([4, 2]),
        3 => Some([4, 4]),
        4 => Some([8, 4]),
        5 => Some([8, 8]),
        6 => Some([16, 8]),
        7 => Some([16, 16]),
        11 => Some([64, 64]),
        12 => Some([128, 64]),
        13 => Some([128, 128]),
        14 => Some([256, 128]),
        15 => Some([256, 256]),
        _ => None,
    };
    if axes == 2 {
        return plane(granularity).map(|[width, height]| [width, height, 1]);
    }
    match granularity {
        1 => Some([2, 2, 2]),
        3 => Some([4, 4, 2]),
        10 => Some([16, 16, 16]),
        11 => Some([32, 16, 16]),
        12 => Some([32, 32, 16]),
        13 => Some([32, 32, 32]),
        14 => Some([64, 32, 32]),
        _ => None,
    }
}

impl FootprintOp {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        let registers = [self.image, self.sampler, self.granularity, self.coarse];
        registers
            .into_iter()
            .chain(self.coordinate.iter().copied())
            .chain(self.operands.registers())
            .for_each(|reg| visit(Access::Read(reg, 1)));
        visit(Access::Write(self.to, self.registers));
    }

    /// The result for a lane, word by word.
    pub fn eval<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> Result<Vec<u32>, TrapCode> {
        let image = reader.image(self.view, self.image)?;
        let sampler = reader.sampler(self.sampler)?;
        let axes = self.view.dimension.axes();
        let clamped = sampler.address_mode[..axes].iter().all(|&mode| mode == AddressMode::ClampToEdge);
        if !clamped || sampler.max_anisotropy > 1.0 || sampler.unnormalized_coordinates {
            return Err(TrapCode::SamplerMismatch);
        }
        let Some(group) = group_extent(reader.word(self.granularity), axes) else {
            return Err(TrapCode::SamplerMismatch);
        };
        let mut lookup = Lookup::new(image, sampler);
        for (axis, &reg) in self.coordinate.iter().enumerate() {
            lookup.at[axis] = reader.float(reg);
        }
        lookup.offset = self.operands.texel_offset(reader);
        let [bias, min_lod] = self.operands.bias_and_min_lod(reader);
        let coarse = reader.word(self.coarse) != 0;
        let (single, level, texels) =
            lookup.footprint_texels(self.operands.lane_lod(reader), bias, min_lod, coarse);
        // A side of the neighbourhood, in groups.
        let side = if axes == 2 { 8 } else { 4 };
        let (mut anchor, mut offset, mut mask) = ([0; 3], [0; 3], 0u64);
        if let Some([low, high]) = texels {
            let first: [u32; 3] = array::from_fn(|axis| low[axis] / group[axis]);
            let last: [u32; 3] = array::from_fn(|axis| high[axis] / group[axis]);
            for axis in 0..axes {
                anchor[axis] = last[axis] / side;
                // Groups left of the anchor wrap around to the far end of the neighbourhood.
                offset[axis] = (anchor[axis] * side).saturating_sub(first[axis]);
            }
            for z in first[2]..=last[2] {
                for y in first[1]..=last[1] {
                    for x in first[0]..=last[0] {
                        let local = array::map([x, y, z], |at| at % side);
                        mask |= 1 << (local[0] + local[1] * side + local[2] * side * side);
                    }
                }
            }
        }
        let mut words = vec![u32::from(single)];
        words.extend(&anchor[..axes]);
        words.extend(&offset[..axes]);
        words.extend([mask as u32, (mask >> 32) as u32, level, 0]);
        Ok(words)
    }
}

/// Translates the instruction; `false` for any other.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    if opcode != Opcode::ImageSampleFootprintNV {
        return Ok(false);
    }
    let id = translator.id(instruction, 0)?;
    let view = view_of(translator, id)?;
    let &[image, sampler] = &translator.words(id)?[..] else {
        return Err(translator.invalid("the operand must be a sampled image"));
    };
    if !matches!(view.dimension, Dimension::D2 | Dimension::D3) || view.multisampled {
        return Err(
            translator.invalid("only 2D and 3D images have footprints (SPV_NV_shader_image_footprint)")
        );
    }
    let axes = view.dimension.axes();
    let coordinate: Words = translator.operand(instruction, 1)?[..].into();
    if coordinate.len() < axes {
        return Err(
            translator.invalid(format!("{} coordinates are too few for this image", coordinate.len()))
        );
    }
    let coordinate: Words = coordinate[..axes].into();
    let [granularity, coarse] =
        [translator.operand(instruction, 2)?[0], translator.operand(instruction, 3)?[0]];
    let explicit = translator.operands(instruction).get(4).is_some_and(|mask| mask & 6 != 0);
    let mut operands = Operands::read(translator, instruction, 4, !explicit)?;
    if !explicit {
        if !translator.derivatives {
            return Err(translator.invalid(
                "OpImageSampleFootprintNV requires implicit derivatives, which only fragment stages and \
                 compute with a derivative group have: add the image operand Lod or Grad",
            ));
        }
        let mut gradients = [Words::new(), Words::new()];
        for (axis, gradient) in gradients.iter_mut().enumerate() {
            for &part in &coordinate {
                gradient.push(derivative(translator, part, 32, axis as u32)?);
            }
        }
        operands.gradients = Some(gradients);
    }
    let ty = translator.result_type(instruction)?;
    let registers = translator.word_count(ty)?;
    let fits = matches!(translator.module.ty(ty), Type::Struct { members, .. } if members.len() == 6);
    if !fits || registers as usize != 2 * axes + 5 {
        return Err(translator
            .invalid("the result must be a struct of bool, anchor, offset, mask, level and granularity"));
    }
    let to = translator.fresh(registers)?;
    translator.emit(Operation::Image(ImageOp::Footprint(Box::new(FootprintOp {
        to,
        registers,
        view,
        image,
        sampler,
        coordinate,
        granularity,
        coarse,
        operands,
    }))));
    translator.define_result(instruction, (0..registers).map(|register| to.plus(register)).collect());
    Ok(true)
}
