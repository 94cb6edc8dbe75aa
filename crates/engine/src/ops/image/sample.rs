//! Sampling and gathering, with a level of detail from an operand or from derivatives, and the
//! query for that level.

use crate::machine::image::Dimension;
use crate::machine::{Reg, TrapCode};
use crate::math::array;
use crate::module::ty::Type;
use crate::module::{Instruction, Opcode};
use crate::ops::access::Access;
use crate::ops::arithmetic::FDiv;
use crate::ops::derivative::derivative;
use crate::ops::image::declared::{texel_result, view_of};
use crate::ops::image::filter::Lookup;
use crate::ops::image::operands::{self, Operands};
use crate::ops::image::reader::LaneReader;
use crate::ops::image::view::View;
use crate::ops::image::{ImageOp, TexelRegisters};
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::op::Op as Operation;
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// The result that is computed from the texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleKind {
    /// A filtered value.
    Filter,
    /// One component of four texels; a register holds the component's number.
    Gather(Reg),
    /// Four texels, each compared with the reference.
    GatherDref,
    /// The level of detail that would be sampled (`OpImageQueryLod`).
    QueryLod,
}

/// An operation that samples or gathers.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleOp {
    /// The registers of the result.
    pub to: TexelRegisters,
    /// The result that is computed from the texels.
    pub kind: SampleKind,
    /// The declared view of the image.
    pub view: View,
    /// The image's handle.
    pub image: Reg,
    /// The sampler's handle.
    pub sampler: Reg,
    /// (s, t, r), as many as there are, then the array coordinate.
    pub coordinate: Words,
    /// The divisor of the coordinates and the reference (`Proj`).
    pub divisor: Option<Reg>,
    /// `D_ref`, the reference of a depth comparison.
    pub reference: Option<Reg>,
    /// Image operands.
    pub operands: Operands,
}

impl SampleOp {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        let component = if let SampleKind::Gather(component) = self.kind { Some(component) } else { None };
        let optional = [self.divisor, self.reference, component].into_iter().flatten();
        let registers = [self.image, self.sampler].into_iter().chain(optional);
        registers
            .chain(self.coordinate.iter().copied())
            .chain(self.operands.registers())
            .for_each(|reg| visit(Access::Read(reg, 1)));
        visit(Access::Write(self.to.to, self.to.registers()));
    }

    /// The value for a lane.
    pub fn eval<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> Result<[u64; 4], TrapCode> {
        let image = match self.kind {
            SampleKind::QueryLod => reader.image(self.view, self.image)?,
            _ => reader.texels(self.view, self.image)?,
        };
        let sampler = reader.sampler(self.sampler)?;
        let plain = matches!(self.view.dimension, Dimension::D1 | Dimension::D2);
        if self.reference.is_some() && sampler.compare_op.is_none()
            || sampler.unnormalized_coordinates && !plain
        {
            return Err(TrapCode::SamplerMismatch);
        }
        let divisor = self.divisor.map(|reg| reader.float(reg));
        let divided = |value: f32| divisor.map_or(value, |divisor| value / divisor);
        let components = self.components();
        let mut lookup = Lookup::new(image, sampler);
        lookup.reference = self.reference.map(|reg| divided(reader.float(reg)));
        lookup.offset = self.operands.texel_offset(reader);
        for (axis, &reg) in self.coordinate.iter().enumerate() {
            if axis < components {
                lookup.at[axis] = divided(reader.float(reg));
            } else {
                lookup.layer = reader.float(reg);
            }
        }
        let lod = self.operands.lane_lod(reader);
        Ok(match self.kind {
            SampleKind::Filter => {
                let [bias, min_lod] = self.operands.bias_and_min_lod(reader);
                lookup.sample(lod, bias, min_lod)
            }
            SampleKind::QueryLod => {
                let [level, lambda] = array::map(lookup.query_lod(lod), |value| u64::from(value.to_bits()));
                [level, lambda, 0, 0]
            }
            SampleKind::Gather(_) | SampleKind::GatherDref => {
                let component =
                    if let SampleKind::Gather(reg) = self.kind { reader.word(reg).min(3) } else { 0 };
                let offsets = self.operands.offsets.as_ref().map(|offsets| {
                    array::from_fn(|at| {
                        [reader.integer(offsets[2 * at]), reader.integer(offsets[2 * at + 1])]
                    })
                });
                lookup.gather(component as usize, offsets)
            }
        })
    }

    /// How many components (s, t, r) has: for a cube it is a direction.
    fn components(&self) -> usize {
        components(self.view.dimension)
    }
}

fn components(dimension: Dimension) -> usize {
    if dimension.is_cube() { 3 } else { dimension.axes() }
}

/// Translates sampling and gathering; `false` for any other instruction.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    let implicit = super::IMPLICIT.contains(&opcode);
    let (compared, projected, gathers, sparse) = match opcode {
        Opcode::ImageSampleImplicitLod => (false, false, false, false),
        Opcode::ImageSampleDrefImplicitLod => (true, false, false, false),
        Opcode::ImageSparseSampleImplicitLod => (false, false, false, true),
        Opcode::ImageSparseSampleDrefImplicitLod => (true, false, false, true),
        Opcode::ImageSampleProjImplicitLod => (false, true, false, false),
        Opcode::ImageSampleProjDrefImplicitLod => (true, true, false, false),
        Opcode::ImageQueryLod => (false, false, false, false),
        Opcode::ImageSampleExplicitLod => (false, false, false, false),
        Opcode::ImageSampleDrefExplicitLod => (true, false, false, false),
        Opcode::ImageSampleProjExplicitLod => (false, true, false, false),
        Opcode::ImageSampleProjDrefExplicitLod => (true, true, false, false),
        Opcode::ImageGather => (false, false, true, false),
        Opcode::ImageDrefGather => (true, false, true, false),
        Opcode::ImageSparseSampleExplicitLod => (false, false, false, true),
        Opcode::ImageSparseSampleDrefExplicitLod => (true, false, false, true),
        Opcode::ImageSparseGather => (false, false, true, true),
        Opcode::ImageSparseDrefGather => (true, false, true, true),
        _ => return Ok(false),
    };
    let id = translator.id(instruction, 0)?;
    let view = view_of(translator, id)?;
    let &[image, sampler] = &translator.words(id)?[..] else {
        return Err(translator.invalid("the operand must be a sampled image"));
    };
    if view.multisampled || view.dimension == Dimension::Buffer {
        return Err(translator.invalid(
            "texel buffers and multisampled images can be fetched or read, not sampled (SPIR-V 3.3.10)",
        ));
    }
    let dref_or_component =
        if compared || gathers { Some(translator.operand(instruction, 2)?[0]) } else { None };
    let at = 2 + usize::from(dref_or_component.is_some());
    let mut operands = Operands::read(translator, instruction, at, implicit)?;
    let mut coordinate = float_coordinates(translator, instruction)?;
    let dimension = view.dimension;
    let queries = opcode == Opcode::ImageQueryLod;
    // A query has no array coordinate.
    let count = components(dimension) + usize::from(dimension.is_arrayed() && !queries);
    if coordinate.len() < count + usize::from(projected) {
        return Err(
            translator.invalid(format!("{} coordinates are too few for this image", coordinate.len()))
        );
    }
    if projected && (dimension.is_arrayed() || dimension.is_cube()) {
        return Err(translator.invalid("arrays and cubes cannot be sampled with projection (SPIR-V 3.3.10)"));
    }
    if gathers
        && !matches!(dimension, Dimension::D2 | Dimension::D2Array | Dimension::Cube | Dimension::CubeArray)
    {
        return Err(translator.invalid("only 2D and cube images can be gathered (SPIR-V 3.3.10)"));
    }
    let mut dref_or_component = dref_or_component;
    if implicit && projected {
        // The derivatives are those of the coordinates after the division.
        let divisor = coordinate[count];
        for value in coordinate[..count].iter_mut().chain(dref_or_component.as_mut()) {
            *value = translator.emit_uncontrolled(divide_kernel(), &[*value, divisor])?;
        }
    }
    if implicit {
        // The level of detail of the coordinates' own derivatives (Vulkan, "Implicit derivatives").
        let mut gradients = [Words::new(), Words::new()];
        for (axis, gradient) in gradients.iter_mut().enumerate() {
            for &part in &coordinate[..components(dimension)] {
                gradient.push(derivative(translator, part, 32, axis as u32)?);
            }
        }
        operands.gradients = Some(gradients);
    }
    let short = |gradient: &Words| gradient.len() < components(dimension);
    if operands.gradients.iter().flatten().any(short) {
        return Err(translator.invalid("the gradients have fewer components than the coordinate"));
    }
    if !gathers && operands.lod.is_none() && operands.gradients.is_none() {
        return Err(translator
            .invalid("an explicit level of detail requires the image operand Lod or Grad (SPIR-V 3.3.10)"));
    }
    let divisor = (projected && !implicit).then(|| coordinate[count]);
    let kind = match dref_or_component {
        Some(component) if gathers && !compared => SampleKind::Gather(component),
        _ if gathers => SampleKind::GatherDref,
        _ if queries => SampleKind::QueryLod,
        _ => SampleKind::Filter,
    };
    let to = texel_result(translator, instruction, sparse, !queries)?;
    let sample = SampleOp {
        to,
        kind,
        view,
        image,
        sampler,
        coordinate: coordinate[..count].into(),
        divisor,
        reference: dref_or_component.filter(|_| compared),
        operands,
    };
    translator.emit(Operation::Image(ImageOp::Sample(Box::new(sample))));
    Ok(true)
}

fn divide_kernel() -> &'static LaneKernel {
    FDiv.kernel(32).expect("bug in anyhit: FDiv has no kernel for 32 bits")
}

/// The coordinates of operand 1.
fn float_coordinates(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<Words> {
    let id = translator.id(instruction, 1)?;
    let ty = translator.type_of(id)?;
    let scalar = match *translator.module.ty(ty) {
        Type::Vector { component, .. } => component,
        _ => ty,
    };
    if !matches!(translator.module.ty(scalar), Type::Float { .. }) {
        return Err(translator
            .invalid("the coordinate of a sample must be a float scalar or vector")
            .note("SPIR-V 3.3.10: unless the Kernel capability is declared, it must be floating point"));
    }
    operands::numeric_components(translator, id)
}
