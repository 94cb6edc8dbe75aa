//! Image instructions (SPIR-V 3.3.10).
//!
//! Sampling takes an explicit level of detail: implicit derivatives do not exist in ray-tracing
//! stages. Linear filtering follows Vulkan 16.9 with weights in f32: no 8-bit subtexel steps.

use rspirv::spirv::Op as Opcode;
use smallvec::SmallVec;

use crate::error::Result;
use crate::machine::image::{AddressMode, Filter, Format, Image, Sampler};
use crate::machine::{Batch, Bindings, Descriptor, Mask, Reg, TrapCode};
use crate::module::Instruction;
use crate::module::ty::{ImageType, Type};
use crate::ops::decode::{Decoder, Words};
use crate::ops::op::{Access, Op as Operation};

/// Opcodes decoded here.
pub const OPCODES: &[Opcode] = &[
    Opcode::SampledImage,
    Opcode::Image,
    Opcode::ImageSampleExplicitLod,
    Opcode::ImageFetch,
    Opcode::ImageRead,
    Opcode::ImageWrite,
    Opcode::ImageQuerySize,
    Opcode::ImageQuerySizeLod,
];

/// An operation on images of two dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "a variant's line tells its fields")]
pub enum Op {
    /// Filters a texture: handles of image and sampler, two coordinate rows, four result rows.
    Sample { to: Reg, image: Reg, sampler: Reg, coordinate: [Reg; 2] },
    /// Reads a texel at integer coordinates into four rows.
    Read { to: Reg, image: Reg, coordinate: [Reg; 2] },
    /// Writes a texel at integer coordinates from four consecutive rows.
    Write { from: Reg, image: Reg, coordinate: [Reg; 2] },
    /// Width and height.
    Size { to: Reg, image: Reg },
}

impl Op {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut impl FnMut(Access)) {
        match *self {
            Self::Sample { to, image, sampler, coordinate } => {
                visit(Access::Read(image, 1));
                visit(Access::Read(sampler, 1));
                coordinate.iter().for_each(|&reg| visit(Access::Read(reg, 1)));
                visit(Access::Write(to, 4));
            }
            Self::Read { to, image, coordinate } => {
                visit(Access::Read(image, 1));
                coordinate.iter().for_each(|&reg| visit(Access::Read(reg, 1)));
                visit(Access::Write(to, 4));
            }
            Self::Write { from, image, coordinate } => {
                visit(Access::Read(image, 1));
                coordinate.iter().for_each(|&reg| visit(Access::Read(reg, 1)));
                visit(Access::Read(from, 4));
                visit(Access::Effect);
            }
            Self::Size { to, image } => {
                visit(Access::Read(image, 1));
                visit(Access::Write(to, 2));
            }
        }
    }

    /// Runs the operation for the running lanes.
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        for lane in batch.mask.lanes() {
            let word = |batch: &Batch<W>, reg: Reg| batch.registers[reg].0[lane];
            let (Self::Sample { image, .. }
            | Self::Read { image, .. }
            | Self::Write { image, .. }
            | Self::Size { image, .. }) = *self;
            let done = match bindings.descriptor(word(batch, image)) {
                Some(Descriptor::Image(image) | Descriptor::ImageSampler(image, _)) => match *self {
                    Self::Sample { to, sampler, coordinate, .. } => {
                        let at = coordinate.map(|reg| f32::from_bits(word(batch, reg)));
                        match bindings.descriptor(word(batch, sampler)) {
                            Some(Descriptor::Sampler(sampler) | Descriptor::ImageSampler(_, sampler)) => {
                                let texel = sample(image, sampler, at);
                                batch.registers.set_lane_words(to, lane, texel);
                                Ok(())
                            }
                            _ => Err(TrapCode::DescriptorMissing),
                        }
                    }
                    Self::Read { to, coordinate, .. } => {
                        let texel = image.texel(coordinate.map(|reg| word(batch, reg)));
                        texel.ok_or(TrapCode::ImageOutOfBounds).map(|texel| {
                            batch.registers.set_lane_words(to, lane, decode_texel(image.format(), texel));
                        })
                    }
                    Self::Write { from, coordinate, .. } => {
                        let texel = std::array::from_fn(|at| word(batch, from.plus(at as u32)));
                        let at = coordinate.map(|reg| word(batch, reg));
                        let written = image.set_texel(at, encode_texel(image.format(), texel));
                        written.ok_or(TrapCode::ImageOutOfBounds)
                    }
                    Self::Size { to, .. } => {
                        batch.registers.set_lane_words(to, lane, image.extent());
                        Ok(())
                    }
                },
                _ => Err(TrapCode::DescriptorMissing),
            };
            if let Err(code) = done {
                let op = batch.op;
                batch.trap(Mask::lane(lane), code, op);
            }
        }
    }
}

/// Stored words as the shader sees them: four floats' bits or four integers.
fn decode_texel(format: Format, texel: [u32; 4]) -> [u32; 4] {
    let one = 1f32.to_bits();
    match format {
        Format::Rgba32f | Format::Rgba32ui | Format::Rgba32i => texel,
        Format::R32f => [texel[0], 0, 0, one],
        Format::R32ui | Format::R32i => [texel[0], 0, 0, 1],
        Format::Rgba8 => texel[0].to_le_bytes().map(|byte| (f32::from(byte) / 255.0).to_bits()),
        Format::Rgba8Srgb => {
            let bytes = texel[0].to_le_bytes();
            let mut texel = bytes.map(|byte| crate::math::srgb::to_linear(f32::from(byte) / 255.0).to_bits());
            texel[3] = (f32::from(bytes[3]) / 255.0).to_bits();
            texel
        }
    }
}

/// What a shader writes as stored words.
fn encode_texel(format: Format, texel: [u32; 4]) -> [u32; 4] {
    let unorm = |bits: u32| (f32::from_bits(bits).clamp(0.0, 1.0) * 255.0).round_ties_even() as u8;
    match format {
        Format::Rgba32f | Format::Rgba32ui | Format::Rgba32i => texel,
        Format::R32f | Format::R32ui | Format::R32i => [texel[0], 0, 0, 0],
        Format::Rgba8 => [u32::from_le_bytes(texel.map(unorm)), 0, 0, 0],
        Format::Rgba8Srgb => {
            let srgb = |bits: u32| crate::math::srgb::from_linear(f32::from_bits(bits)).to_bits();
            let encoded = [srgb(texel[0]), srgb(texel[1]), srgb(texel[2]), texel[3]];
            [u32::from_le_bytes(encoded.map(unorm)), 0, 0, 0]
        }
    }
}

/// A filtered texel at normalized coordinates (Vulkan 16.8 and 16.9).
fn sample(image: &Image, sampler: &Sampler, at: [f32; 2]) -> [u32; 4] {
    let extent = image.extent();
    let unnormalized: [f32; 2] = std::array::from_fn(|axis| at[axis] * extent[axis] as f32);
    let fetch = |texel: [i64; 2]| {
        let wrapped = std::array::from_fn(|axis| wrap(sampler.address[axis], texel[axis], extent[axis]));
        decode_texel(image.format(), image.texel(wrapped).unwrap_or_default())
    };
    if sampler.filter == Filter::Nearest || image.format().is_integer() {
        return fetch(unnormalized.map(|coordinate| coordinate.floor() as i64));
    }
    let shifted = unnormalized.map(|coordinate| coordinate - 0.5);
    let low = shifted.map(|coordinate| coordinate.floor() as i64);
    let weight = shifted.map(|coordinate| coordinate - coordinate.floor());
    let [x, y] = low;
    let corners = [fetch([x, y]), fetch([x + 1, y]), fetch([x, y + 1]), fetch([x + 1, y + 1])];
    std::array::from_fn(|component| {
        let [a, b, c, d] = corners.map(|corner| f32::from_bits(corner[component]));
        let top = a * (1.0 - weight[0]) + b * weight[0];
        let bottom = c * (1.0 - weight[0]) + d * weight[0];
        (top * (1.0 - weight[1]) + bottom * weight[1]).to_bits()
    })
}

fn wrap(mode: AddressMode, at: i64, size: u32) -> u32 {
    let size = i64::from(size.max(1));
    let wrapped = match mode {
        AddressMode::Repeat => at.rem_euclid(size),
        AddressMode::MirroredRepeat => {
            let at = at.rem_euclid(2 * size);
            if at < size { at } else { 2 * size - 1 - at }
        }
        AddressMode::ClampToEdge => at.clamp(0, size - 1),
    };
    wrapped as u32
}

/// Decodes image instructions; `false` for an instruction of another section.
pub fn decode(decoder: &mut Decoder<'_>, opcode: Opcode, instruction: &Instruction) -> Result<bool> {
    match opcode {
        Opcode::SampledImage => {
            let (image, sampler) = (decoder.operand(instruction, 0)?, decoder.operand(instruction, 1)?);
            decoder.result(instruction, SmallVec::from_slice(&[image[0], sampler[0]]));
        }
        Opcode::Image => {
            let words = decoder.operand(instruction, 0)?;
            decoder.result(instruction, SmallVec::from_slice(&words[..1]));
        }
        Opcode::ImageSampleExplicitLod => {
            let (sampled, coordinate) = two_dimensional(decoder, instruction)?;
            let &[image, sampler] = &sampled[..] else {
                return Err(decoder.invalid("a sampled image is needed here"));
            };
            check_lod(decoder, instruction)?;
            let to = decoder.fresh(4)?;
            decoder.emit(Operation::Image(Op::Sample { to, image, sampler, coordinate }));
            texel_result(decoder, instruction, to)?;
        }
        Opcode::ImageRead | Opcode::ImageFetch => {
            let (image, coordinate) = two_dimensional(decoder, instruction)?;
            let to = decoder.fresh(4)?;
            decoder.emit(Operation::Image(Op::Read { to, image: image[0], coordinate }));
            texel_result(decoder, instruction, to)?;
        }
        Opcode::ImageWrite => {
            let (image, coordinate) = two_dimensional(decoder, instruction)?;
            let mut texel = decoder.operand(instruction, 2)?;
            while texel.len() < 4 {
                texel.push(decoder.constant(0)?);
            }
            let from = decoder.consecutive(&texel)?;
            decoder.emit(Operation::Image(Op::Write { from, image: image[0], coordinate }));
        }
        Opcode::ImageQuerySize | Opcode::ImageQuerySizeLod => {
            let id = decoder.id(instruction, 0)?;
            dimensions(decoder, id)?;
            let image = decoder.words(id)?[0];
            let to = decoder.fresh(2)?;
            decoder.emit(Operation::Image(Op::Size { to, image }));
            decoder.result(instruction, SmallVec::from_slice(&[to, to.plus(1)]));
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// Handles of the image operand, and its two coordinates.
fn two_dimensional(decoder: &mut Decoder<'_>, instruction: &Instruction) -> Result<(Words, [Reg; 2])> {
    let id = decoder.id(instruction, 0)?;
    dimensions(decoder, id)?;
    let words = decoder.words(id)?;
    let coordinate = decoder.operand(instruction, 1)?;
    match &coordinate[..] {
        &[x, y, ..] => Ok((words, [x, y])),
        _ => Err(decoder.invalid("an image of two dimensions takes two coordinates")),
    }
}

/// Refuses all but plain two-dimensional images.
fn dimensions(decoder: &Decoder<'_>, id: crate::module::Id) -> Result<()> {
    let mut ty = decoder.type_of(id)?;
    if let Type::SampledImage(image) = *decoder.module.ty(ty) {
        ty = image;
    }
    match decoder.module.ty(ty) {
        Type::Image(ImageType { dim: 1, arrayed: false, multisampled: false, .. }) => Ok(()),
        Type::Image(image) => Err(decoder.unsupported(format!(
            "images other than plain two-dimensional ones (Dim {}{})",
            image.dim,
            if image.arrayed { ", arrayed" } else { "" }
        ))),
        _ => Err(decoder.invalid("an image is needed here")),
    }
}

/// Takes the level of detail that every image of one level has, and no other image operand.
fn check_lod(decoder: &Decoder<'_>, instruction: &Instruction) -> Result<()> {
    const LOD: u32 = 2;
    const GRAD: u32 = 4;
    match decoder.operands(instruction).get(2).copied().unwrap_or(LOD) {
        LOD | GRAD => Ok(()),
        other => Err(decoder.unsupported(format!("image operands {other:#x}"))),
    }
}

fn texel_result(decoder: &mut Decoder<'_>, instruction: &Instruction, to: Reg) -> Result<()> {
    let ty = decoder.result_type(instruction)?;
    let count = decoder.word_count(ty)?.min(4);
    decoder.result(instruction, (0..count).map(|word| to.plus(word)).collect());
    Ok(())
}
