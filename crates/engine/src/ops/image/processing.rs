//! Image processing (`SPV_QCOM_image_processing`, `SPV_QCOM_image_processing2`): weighted samples,
//! box filters and block matching (Vulkan, "Weight Image Sampling", "Block Matching", "Box Filter
//! Sampling").
//!
//! Sums run over rows, and within them over columns, in ascending order from the first term on,
//! each operation rounded to nearest even; fractions have all bits of a binary32. The sides of a
//! box are clamped to 1 to 64 texels. A block that exceeds the reference image traps its lane: its
//! result is undefined.

use crate::machine::format::Class;
use crate::machine::image::{Dimension, Image, Position};
use crate::machine::sampler::{ReductionMode, Sampler};
use crate::machine::{Reg, TrapCode};
use crate::math::array;
use crate::module::{Id, Instruction, Opcode};
use crate::ops::access::Access;
use crate::ops::image::declared::{texel_result, view_of};
use crate::ops::image::filter::Lookup;
use crate::ops::image::reader::LaneReader;
use crate::ops::image::view::View;
use crate::ops::image::{ImageOp, TexelRegisters};
use crate::ops::op::Op as Operation;
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// The longest side of a box (`maxBoxFilterBlockSize`).
const MAX_BOX_SIDE: f32 = 64.0;

/// An image with its sampler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampledImageRef {
    view: View,
    image: Reg,
    sampler: Reg,
}

/// The kind of image processing.
#[derive(Clone, Debug, PartialEq)]
pub enum ProcessKind {
    /// The mean of a box, with the registers of its sides.
    BoxFilter(Words),
    /// A sum weighted by another image.
    Weighted(SampledImageRef),
    /// A comparison of blocks.
    BlockMatch {
        /// The reference image.
        reference: SampledImageRef,
        /// The block's first texel there.
        at: Words,
        /// Width and height of the block.
        size: Words,
        /// Whether differences are squared.
        squared: bool,
        /// The positions in the target.
        mode: BlockMatchMode,
    },
}

/// The positions in the target image at which a block is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockMatchMode {
    /// One comparison at the coordinate.
    Single,
    /// Four comparisons: at the coordinate and at the three texels to its right.
    Gather,
    /// A search in the window of the target's sampler for the least or the greatest difference.
    Window,
}

/// An operation of image processing.
#[derive(Clone, Debug, PartialEq)]
pub struct ProcessOp {
    /// The registers of the result.
    pub to: TexelRegisters,
    target: SampledImageRef,
    coordinate: Words,
    kind: ProcessKind,
}

impl ProcessOp {
    /// The handles of the target image and, where there is one, of the weights or the reference.
    pub fn images(&self) -> impl Iterator<Item = Reg> {
        let other = match &self.kind {
            ProcessKind::Weighted(weights) => Some(weights.image),
            ProcessKind::BlockMatch { reference, .. } => Some(reference.image),
            ProcessKind::BoxFilter(_) => None,
        };
        [self.target.image].into_iter().chain(other)
    }

    /// The declared view, the image's handle and the sampler's: those of the target, then those of
    /// the weights or the reference.
    pub fn sampled_images(&self) -> impl Iterator<Item = (View, Reg, Reg)> + Clone {
        let other = match self.kind {
            ProcessKind::Weighted(weights) => Some(weights),
            ProcessKind::BlockMatch { reference, .. } => Some(reference),
            ProcessKind::BoxFilter(_) => None,
        };
        let parts = |one: SampledImageRef| (one.view, one.image, one.sampler);
        [Some(self.target), other].into_iter().flatten().map(parts)
    }

    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        let mut read = |reg: Reg| visit(Access::Read(reg, 1));
        [self.target.image, self.target.sampler].into_iter().for_each(&mut read);
        self.coordinate.iter().copied().for_each(&mut read);
        match &self.kind {
            ProcessKind::BoxFilter(sides) => sides.iter().copied().for_each(&mut read),
            ProcessKind::Weighted(weights) => {
                [weights.image, weights.sampler].into_iter().for_each(&mut read)
            }
            ProcessKind::BlockMatch { reference, at, size, .. } => {
                [reference.image, reference.sampler].into_iter().for_each(&mut read);
                at.iter().chain(size).copied().for_each(&mut read);
            }
        }
        visit(Access::Write(self.to.to, self.to.registers()));
    }

    /// The value for a lane.
    pub fn eval<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> Result<[u64; 4], TrapCode> {
        let find = |sampled: SampledImageRef| -> Result<(&Image, &Sampler), TrapCode> {
            Ok((reader.texels(sampled.view, sampled.image)?, reader.sampler(sampled.sampler)?))
        };
        let (image, sampler) = find(self.target)?;
        let floats = |words: &Words| array::map([0, 1], |at: usize| reader.float(words[at]));
        let value = match &self.kind {
            ProcessKind::BoxFilter(sides) => {
                box_filter(image, sampler, floats(&self.coordinate), floats(sides))
            }
            ProcessKind::Weighted(weights) => {
                weighted_sample(image, sampler, floats(&self.coordinate), find(*weights)?.0)?
            }
            ProcessKind::BlockMatch { reference, at, size, squared, mode } => {
                let integers =
                    |words: &Words| array::map([0, 1], |axis: usize| i64::from(reader.word(words[axis])));
                let (other, _) = find(*reference)?;
                let (at, size) = (integers(at), integers(size));
                let extent = array::map(other.level_extent(0), i64::from);
                if (0..2).any(|axis| size[axis] < 1 || at[axis] + size[axis] > extent[axis]) {
                    return Err(TrapCode::ImageOutOfBounds);
                }
                let comparison =
                    BlockComparison { image, sampler, reference: other, at, size, squared: *squared };
                comparison.compare(integers(&self.coordinate), *mode)?
            }
        };
        Ok(array::map(value, |part| u64::from(part.to_bits())))
    }
}

/// Coordinates in texels of level 0.
fn unnormalized(image: &Image, sampler: &Sampler, coordinate: [f32; 2]) -> [f32; 2] {
    let extent = image.level_extent(0);
    let scale = |axis: usize| if sampler.unnormalized_coordinates { 1.0 } else { extent[axis] as f32 };
    array::from_fn(|axis| coordinate[axis] * scale(axis))
}

fn texel(image: &Image, sampler: &Sampler, at: [i64; 2]) -> [f32; 4] {
    Lookup::new(image, sampler).plane_texel(at)
}

/// Values combined by the sampler's reduction mode.
#[derive(Default)]
struct Reduction(Option<[f32; 4]>);

impl Reduction {
    fn add(&mut self, mode: ReductionMode, value: [f32; 4]) {
        self.0 = Some(match self.0 {
            None => value,
            Some(before) => array::from_fn(|part| match mode {
                ReductionMode::WeightedAverage => before[part] + value[part],
                ReductionMode::Min => before[part].min(value[part]),
                ReductionMode::Max => before[part].max(value[part]),
            }),
        });
    }

    fn value(&self) -> [f32; 4] {
        self.0.unwrap_or_default()
    }
}

/// `OpImageBoxFilterQCOM`
fn box_filter(image: &Image, sampler: &Sampler, coordinate: [f32; 2], sides: [f32; 2]) -> [f32; 4] {
    let centre = unnormalized(image, sampler, coordinate);
    let mode = sampler.reduction_mode;
    // NaN counts as 1.
    let sides = array::map(sides, |side| if side >= 1.0 { side.min(MAX_BOX_SIDE) } else { 1.0 });
    let axis = |axis: usize| {
        let start = centre[axis] - sides[axis] / 2.0;
        let first = start.floor();
        let start = if start.is_finite() { start - first } else { 0.0 };
        let (last, end) = ((start + sides[axis]).ceil() as usize, (start + sides[axis]).fract());
        let weights = (0..last).map(move |at| match at {
            0 => 1.0 - start,
            at if at + 1 == last && end != 0.0 => end,
            _ => 1.0,
        });
        // `as` saturates, and converts NaN to 0.
        (i64::from(first as i32), weights.collect::<Vec<f32>>())
    };
    let ((i, across), (j, down)) = (axis(0), axis(1));
    let mut sum = Reduction::default();
    for (y, vertical) in down.iter().enumerate() {
        for (x, horizontal) in across.iter().enumerate() {
            let texel = texel(image, sampler, [i + x as i64, j + y as i64]);
            let weight = if mode == ReductionMode::WeightedAverage { horizontal * vertical } else { 1.0 };
            sum.add(mode, array::map(texel, |part| weight * part));
        }
    }
    match mode {
        ReductionMode::WeightedAverage => {
            let scale = 1.0 / (sides[1] * sides[0]);
            array::map(sum.value(), |part| scale * part)
        }
        ReductionMode::Min | ReductionMode::Max => sum.value(),
    }
}

/// `OpImageSampleWeightedQCOM`
fn weighted_sample(
    image: &Image,
    sampler: &Sampler,
    coordinate: [f32; 2],
    weights: &Image,
) -> Result<[f32; 4], TrapCode> {
    let filter = weights.sample_weight().ok_or(TrapCode::ImageMismatch)?;
    let at = unnormalized(image, sampler, coordinate);
    let mode = sampler.reduction_mode;
    let phases = filter.phases.isqrt().max(1);
    let phase = array::map(at, |part| {
        let fraction = part - part.floor();
        ((fraction * phases as f32) as u32).min(phases - 1)
    });
    let first: [i64; 2] =
        array::from_fn(|axis| i64::from((at[axis] - filter.center[axis] as f32).floor() as i32));
    let separable = weights.shape().dimension == Dimension::D1Array;
    let stored = |at: [u32; 2], layer: u32| {
        let at = [i64::from(at[0]), i64::from(at[1]), 0];
        let position = Position { at, layer: i64::from(layer), ..Position::default() };
        let index = weights.index(&position).ok_or(TrapCode::ImageOutOfBounds)?;
        Ok(f32::from_bits(weights.format().decode(weights.load(index))[0] as u32))
    };
    let mut sum = Reduction::default();
    for l in 0..filter.size[1] {
        for k in 0..filter.size[0] {
            let weight = if separable {
                let packed = |at: u32, axis: usize| phases * 4 * (at / 4) + phase[axis] * 4 + at % 4;
                stored([packed(k, 0), 0], 0)? * stored([packed(l, 1), 0], 1)?
            } else {
                stored([k, l], phase[1] * phases + phase[0])?
            };
            let texel = texel(image, sampler, [first[0] + i64::from(k), first[1] + i64::from(l)]);
            match mode {
                ReductionMode::WeightedAverage => sum.add(mode, array::map(texel, |part| weight * part)),
                _ if weight != 0.0 => sum.add(mode, texel),
                _ => {}
            }
        }
    }
    Ok(sum.value())
}

/// A comparison of blocks of two images.
struct BlockComparison<'a> {
    image: &'a Image,
    sampler: &'a Sampler,
    reference: &'a Image,
    at: [i64; 2],
    size: [i64; 2],
    squared: bool,
}

impl BlockComparison<'_> {
    fn compare(&self, target: [i64; 2], mode: BlockMatchMode) -> Result<[f32; 4], TrapCode> {
        let red = |x: u32, y: u32| self.difference([target[0] + i64::from(x), target[1] + i64::from(y)])[0];
        match mode {
            BlockMatchMode::Single => Ok(self.difference(target)),
            BlockMatchMode::Gather => Ok(array::map([0, 1, 2, 3], |x| red(x, 0))),
            BlockMatchMode::Window => {
                let window = self.sampler.block_match_window.ok_or(TrapCode::SamplerMismatch)?;
                let mut found =
                    [if window.greatest { f32::NEG_INFINITY } else { f32::INFINITY }, 0.0, 0.0, 0.0];
                for x in 0..window.extent[0] {
                    for y in 0..window.extent[1] {
                        let difference = red(x, y);
                        let better =
                            if window.greatest { difference > found[0] } else { difference < found[0] };
                        if better {
                            found = [difference, x as f32, y as f32, 0.0];
                        }
                    }
                }
                Ok(found)
            }
        }
    }

    /// The difference between the block of the reference and the block at a position of the target.
    fn difference(&self, target: [i64; 2]) -> [f32; 4] {
        let mode = self.sampler.reduction_mode;
        let averages = mode == ReductionMode::WeightedAverage;
        let square = |part: f32| if self.squared { part * part } else { part };
        let mut sum = Reduction::default();
        for y in 0..self.size[1] {
            for x in 0..self.size[0] {
                let own = texel(self.image, self.sampler, [target[0] + x, target[1] + y]);
                let other = texel(self.reference, self.sampler, [self.at[0] + x, self.at[1] + y]);
                let difference: [f32; 4] = array::from_fn(|part| (other[part] - own[part]).abs());
                sum.add(mode, if averages { array::map(difference, square) } else { difference });
            }
        }
        if averages { sum.value() } else { array::map(sum.value(), square) }
    }
}

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::ImageSampleWeightedQCOM,
    Opcode::ImageBoxFilterQCOM,
    Opcode::ImageBlockMatchSSDQCOM,
    Opcode::ImageBlockMatchSADQCOM,
    Opcode::ImageBlockMatchWindowSSDQCOM,
    Opcode::ImageBlockMatchWindowSADQCOM,
    Opcode::ImageBlockMatchGatherSSDQCOM,
    Opcode::ImageBlockMatchGatherSADQCOM,
];

/// Translates image processing; `false` for any other instruction.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    if !OPCODES.contains(&opcode) {
        return Ok(false);
    }
    let planes = [Dimension::D2];
    let target = sampled(translator, instruction, 0, &planes)?;
    let coordinate = pair(translator, instruction, 1)?;
    let kind = match opcode {
        Opcode::ImageBoxFilterQCOM => ProcessKind::BoxFilter(pair(translator, instruction, 2)?),
        Opcode::ImageSampleWeightedQCOM => {
            let kinds = [Dimension::D2Array, Dimension::D1Array];
            ProcessKind::Weighted(sampled(translator, instruction, 2, &kinds)?)
        }
        _ => {
            let squared = matches!(
                opcode,
                Opcode::ImageBlockMatchSSDQCOM
                    | Opcode::ImageBlockMatchWindowSSDQCOM
                    | Opcode::ImageBlockMatchGatherSSDQCOM
            );
            let mode = match opcode {
                Opcode::ImageBlockMatchSSDQCOM | Opcode::ImageBlockMatchSADQCOM => BlockMatchMode::Single,
                Opcode::ImageBlockMatchGatherSSDQCOM | Opcode::ImageBlockMatchGatherSADQCOM => {
                    BlockMatchMode::Gather
                }
                _ => BlockMatchMode::Window,
            };
            ProcessKind::BlockMatch {
                reference: sampled(translator, instruction, 2, &planes)?,
                at: pair(translator, instruction, 3)?,
                size: pair(translator, instruction, 4)?,
                squared,
                mode,
            }
        }
    };
    let to = texel_result(translator, instruction, false, false)?;
    translator.emit(Operation::Image(ImageOp::Process(Box::new(ProcessOp { to, target, coordinate, kind }))));
    Ok(true)
}

fn sampled(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    at: usize,
    dimensions: &[Dimension],
) -> Result<SampledImageRef> {
    let id: Id = translator.id(instruction, at)?;
    let view = view_of(translator, id)?;
    let &[image, sampler] = &translator.words(id)?[..] else {
        return Err(translator.invalid("the operand must be a sampled image"));
    };
    if !dimensions.contains(&view.dimension) || view.multisampled || view.class != Class::Float {
        return Err(translator
            .invalid("image processing does not support this kind of image (SPV_QCOM_image_processing)"));
    }
    Ok(SampledImageRef { view, image, sampler })
}

fn pair(translator: &mut Translator<'_>, instruction: &Instruction, at: usize) -> Result<Words> {
    let words = translator.operand(instruction, at)?;
    match words.len() {
        2 => Ok(words),
        count => {
            Err(translator.invalid(format!("the operand has {count} words instead of being a vector of two")))
        }
    }
}
