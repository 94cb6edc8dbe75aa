//! Image queries: sizes, levels, samples.

use crate::machine::image::Dimension;
use crate::machine::{Reg, TrapCode};
use crate::module::{Instruction, Opcode};
use crate::ops::access::Access;
use crate::ops::image::declared::{texel_result, view_of};
use crate::ops::image::reader::LaneReader;
use crate::ops::image::view::View;
use crate::ops::image::{ImageOp, TexelRegisters};
use crate::ops::integer_operand::ReadAs;
use crate::ops::op::Op as Operation;
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// The property of the image that is queried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageProperty {
    /// Width, height, depth, as many as there are, then layers (cubes in an array of cubes), of the
    /// level in a register or of level 0. A level that does not exist traps the lane.
    Size(Option<Reg>),
    /// Mip levels.
    Levels,
    /// Samples of a texel.
    Samples,
}

/// A query of a property of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueryOp {
    /// The registers of the result.
    pub to: TexelRegisters,
    /// The declared view of the image.
    pub view: View,
    /// The image's handle.
    pub image: Reg,
    /// The property of the image that is queried.
    pub property: ImageProperty,
}

impl QueryOp {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        visit(Access::Read(self.image, 1));
        if let ImageProperty::Size(Some(level)) = self.property {
            visit(Access::Read(level, 1));
        }
        visit(Access::Write(self.to.to, self.to.registers()));
    }

    /// The result for a lane.
    pub fn eval<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> Result<[u64; 4], TrapCode> {
        let image = reader.image(self.view, self.image)?;
        let shape = image.shape();
        let mut result = [0; 4];
        match self.property {
            ImageProperty::Size(level) => {
                let level = level.map_or(0, |level| reader.word(level));
                if level >= shape.levels {
                    return Err(TrapCode::ImageOutOfBounds);
                }
                let axes = shape.dimension.axes();
                let extent = shape.level_extent(level);
                for (to, side) in result.iter_mut().zip(&extent[..axes]) {
                    *to = u64::from(*side);
                }
                let each = if shape.dimension == Dimension::CubeArray { 6 } else { 1 };
                if shape.dimension.is_arrayed() {
                    result[axes] = u64::from(shape.layers / each);
                }
            }
            ImageProperty::Levels => result[0] = u64::from(shape.levels),
            ImageProperty::Samples => result[0] = u64::from(shape.samples),
        }
        Ok(result)
    }
}

/// Translates queries; `false` for any other instruction.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    let property = match opcode {
        Opcode::ImageQuerySize => ImageProperty::Size(None),
        Opcode::ImageQuerySizeLod => {
            let level = translator.id(instruction, 1)?;
            ImageProperty::Size(Some(translator.integer(level, ReadAs::Coordinate)?))
        }
        Opcode::ImageQueryLevels => ImageProperty::Levels,
        Opcode::ImageQuerySamples => ImageProperty::Samples,
        _ => return Ok(false),
    };
    let id = translator.id(instruction, 0)?;
    let view = view_of(translator, id)?;
    let image = translator.words(id)?[0];
    let to = texel_result(translator, instruction, false, false)?;
    let expected = match property {
        ImageProperty::Size(_) => view.dimension.axes() as u32 + u32::from(view.dimension.is_arrayed()),
        ImageProperty::Levels | ImageProperty::Samples => 1,
    };
    if to.count != expected {
        let message = format!("the result of a query has {} components instead of {expected}", to.count);
        return Err(translator.invalid(message).note(
            "SPIR-V 3.3.10, OpImageQuerySize: one component for each dimension of the image, and one for \
             the array",
        ));
    }
    translator.emit(Operation::Image(ImageOp::Query(QueryOp { to, view, image, property })));
    Ok(true)
}
