//! Access to single texels by integer coordinates: `OpImageFetch`, `OpImageRead`, `OpImageWrite`,
//! and the texel that `OpImageTexelPointer` and `OpUntypedImageTexelPointerEXT` give to atomic
//! instructions.
//!
//! Outside the image a store has no effect and a read gives zeros
//! ([`MemoryPolicy`](crate::machine::MemoryPolicy)).

use crate::machine::format::Class;
use crate::machine::{Reg, TrapCode};
use crate::math::array;
use crate::module::ty::Type;
use crate::module::{Id, Instruction, Opcode};
use crate::ops::access::Access;
use crate::ops::image::declared::{check_texel, texel_result, view_of, view_of_type};
use crate::ops::image::operands::Operands;
use crate::ops::image::reader::LaneReader;
use crate::ops::image::texel_ref::TexelRef;
use crate::ops::image::view::View;
use crate::ops::image::{ImageOp, TexelRegisters};
use crate::ops::integer_operand::ReadAs;
use crate::ops::op::Op as Operation;
use crate::ops::pointer::{Pointer, PointerBase};
use crate::ops::translate::{IdValue, Translator};
use crate::ops::untyped_pointer::pointer_to;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// An operation that reads a texel.
#[derive(Clone, Debug, PartialEq)]
pub struct TexelRead {
    /// The registers of the result.
    pub to: TexelRegisters,
    /// The texel.
    pub texel: TexelRef,
}

impl TexelRead {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        self.texel.registers().for_each(|reg| visit(Access::Read(reg, 1)));
        visit(Access::Write(self.to.to, self.to.registers()));
    }

    /// The texel for a lane.
    pub fn eval<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> Result<[u64; 4], TrapCode> {
        match self.texel.resolve(reader) {
            Ok((image, index)) => Ok(image.format().decode(image.load(index))),
            // Zeros, with missing components of the format filled in (Vulkan, robustImageAccess2).
            Err(TrapCode::ImageOutOfBounds) if !self.texel.traps_outside(reader) => {
                Ok(reader.image(self.texel.view, self.texel.image)?.format().decode(0))
            }
            Err(code) => Err(code),
        }
    }
}

/// An operation that writes a texel.
#[derive(Clone, Debug, PartialEq)]
pub struct TexelWrite {
    /// The first register of each of four components.
    pub from: [Reg; 4],
    /// The class of the values: it tells how integers are extended.
    pub class: Class,
    /// The texel that is written.
    pub texel: TexelRef,
}

impl TexelWrite {
    /// Whether its components are floats.
    pub fn is_float(&self) -> bool {
        self.class == Class::Float
    }

    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        let registers = if self.texel.view.wide { 2 } else { 1 };
        self.texel.registers().for_each(|reg| visit(Access::Read(reg, 1)));
        self.from.iter().for_each(|&reg| visit(Access::Read(reg, registers)));
        visit(Access::Effect);
    }

    /// Runs it for a lane.
    pub fn eval<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> Result<(), TrapCode> {
        let (image, index) = match self.texel.resolve(reader) {
            Err(TrapCode::ImageOutOfBounds) if !self.texel.traps_outside(reader) => return Ok(()),
            found => found?,
        };
        let words = array::map(self.from, |reg| match (self.texel.view.wide, self.class) {
            (true, _) => reader.wide(reg),
            (false, Class::Sint) => i64::from(reader.integer(reg)) as u64,
            (false, _) => u64::from(reader.word(reg)),
        });
        image.store(index, image.format().encode(words, self.class == Class::Sint));
        Ok(())
    }
}

/// Translates accesses to single texels; `false` for any other instruction.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    match opcode {
        Opcode::ImageFetch | Opcode::ImageRead | Opcode::ImageSparseFetch | Opcode::ImageSparseRead => {
            let operands = Operands::read(translator, instruction, 2, false)?;
            let texel = texel_ref(translator, instruction, &operands)?;
            let sparse = matches!(opcode, Opcode::ImageSparseFetch | Opcode::ImageSparseRead);
            let to = texel_result(translator, instruction, sparse, true)?;
            if to.wide != texel.view.wide {
                return Err(translator.invalid("the texel's type is not the image's Sampled Type"));
            }
            translator.emit(Operation::Image(ImageOp::Read(Box::new(TexelRead { to, texel }))));
        }
        Opcode::ImageWrite => {
            let operands = Operands::read(translator, instruction, 3, false)?;
            let texel = texel_ref(translator, instruction, &operands)?;
            let id = translator.id(instruction, 2)?;
            let ty = translator.type_of(id)?;
            check_texel(translator, translator.id(instruction, 0)?, ty)?;
            let wide = translator.scalar_width(ty)? == 64;
            if wide != texel.view.wide {
                return Err(translator.invalid("the texel's type is not the image's Sampled Type"));
            }
            let components = translator.components(id)?;
            let zero = translator.wide_constant(0)?;
            let from = std::array::from_fn(|at| components.get(at).copied().unwrap_or(zero));
            let class = operands.class.unwrap_or(texel.view.class);
            translator.emit(Operation::Image(ImageOp::Write(Box::new(TexelWrite { from, class, texel }))));
        }
        Opcode::ImageTexelPointer | Opcode::UntypedImageTexelPointerEXT => {
            texel_pointer(translator, instruction)?
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// The texel of an instruction, whose coordinates must suffice for the image.
fn new_texel_ref(
    translator: &Translator<'_>,
    view: View,
    image: Reg,
    coordinate: Words,
    operands: &Operands,
) -> Result<TexelRef> {
    let dimension = view.dimension;
    let layer = usize::from(dimension.is_arrayed() || dimension.is_cube());
    let count = dimension.axes() + layer;
    if coordinate.len() < count {
        return Err(translator.invalid(format!("a texel of this image requires {count} coordinates")));
    }
    Ok(TexelRef {
        view,
        image,
        coordinate: coordinate[..count].into(),
        offset: operands.offset.clone(),
        level: operands.lod,
        sample: operands.sample,
    })
}

fn texel_ref(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    operands: &Operands,
) -> Result<TexelRef> {
    let id = translator.id(instruction, 0)?;
    let view = operands.view(view_of(translator, id)?);
    let image = translator.words(id)?[0];
    let coordinate = integer_coordinates(translator, instruction)?;
    new_texel_ref(translator, view, image, coordinate, operands)
}

/// The integer coordinates of operand 1.
fn integer_coordinates(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<Words> {
    let id = translator.id(instruction, 1)?;
    translator.integers(id, ReadAs::Coordinate)
}

fn texel_pointer(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let ty = translator.result_type(instruction)?;
    let Type::Pointer { storage_class, pointee, .. } = *translator.module.ty(ty) else {
        return Err(translator.invalid(format!("the result of {} must be a pointer", instruction.opcode)));
    };
    // An untyped one begins with the type of the image.
    let operands = translator.operands(instruction);
    let (image_type, operands) = match instruction.opcode {
        Opcode::UntypedImageTexelPointerEXT => {
            operands.split_first().map_or((None, &[][..]), |(&ty, rest)| (Some(Id(ty)), rest))
        }
        _ => (None, operands),
    };
    let &[image, coordinate, sample] = operands else {
        return Err(translator.invalid(format!("{} lacks operands", instruction.opcode)));
    };
    let [image, coordinate, sample] = [image, coordinate, sample].map(Id);
    let (view, pointer) = match image_type {
        None => (view_of(translator, image)?, translator.pointer(image)?),
        Some(id) => {
            let (ty, view) = view_of_type(translator, id)?;
            (view, pointer_to(translator, image, ty)?)
        }
    };
    let image = crate::ops::load_store::load(translator, &pointer)?[0];
    let coordinate = translator.integers(coordinate, ReadAs::Coordinate)?;
    let sample = translator.integer(sample, ReadAs::Coordinate)?;
    let sample = Some(sample).filter(|_| view.multisampled);
    let operands = Operands { sample, ..Operands::default() };
    let texel = new_texel_ref(translator, view, image, coordinate, &operands)?;
    let pointer = Pointer::new(PointerBase::Texel(Box::new(texel)), pointee.unwrap_or(ty), storage_class);
    if let Some(id) = instruction.result {
        translator.define(id, IdValue::Pointer(pointer.into()));
    }
    Ok(())
}
