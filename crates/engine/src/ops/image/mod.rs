//! Image instructions (SPIR-V 3.3.10): their translation and their operations.
//!
//! * [`sample`]: sampling and gathering with an explicit level of detail; the arithmetic, from
//!   Vulkan's "Image Operations", is in [`filter`], [`level`], [`address`] and [`cube`].
//! * [`access`]: fetches, reads, writes and texel pointers.
//! * [`query`]: sizes, levels, samples; [`footprint`]: which texels would be read.
//! * [`processing`]: weighted samples, box filters, block matching.
//! * [`view`], [`texel_ref`], [`reader`]: what operations hold of an image, of a texel and of a
//!   lane; [`declared`]: what instructions declare of the first two.
//!
//! Instructions that need implicit derivatives run in compute shaders with a derivative group, and
//! are rejected in other shaders when they are lowered: ray-tracing stages have none. Sparse forms
//! give residency code 0: every texel is resident.

pub mod access;
pub mod address;
pub mod cube;
pub mod declared;
pub mod filter;
#[cfg(test)]
mod filter_tests;
pub mod footprint;
pub mod level;
pub mod operands;
pub mod processing;
pub mod query;
pub mod reader;
pub mod sample;
pub mod texel_ref;
mod translate;
pub mod view;

use crate::module::Opcode;

use crate::machine::{AccessFault, Batch, Bindings, Mask, Reg, Registers, TrapCode};
use anyhit_base::error::Result;

use crate::ops::access::Access;
use crate::ops::image::reader::LaneReader;
use crate::ops::image::view::View;
use crate::ops::shared_access::{SharedPart, SharedUse, SharedVisitor};

pub use translate::translate;

/// Opcodes translated here; see [`IMPLICIT`] too.
pub const OPCODES: &[Opcode] = &[
    Opcode::SampledImage,
    Opcode::Image,
    Opcode::ImageTexelPointer,
    Opcode::UntypedImageTexelPointerEXT,
    Opcode::ImageSampleImplicitLod,
    Opcode::ImageSampleDrefImplicitLod,
    Opcode::ImageSampleProjImplicitLod,
    Opcode::ImageSampleProjDrefImplicitLod,
    Opcode::ImageQueryLod,
    Opcode::ImageSparseSampleImplicitLod,
    Opcode::ImageSparseSampleDrefImplicitLod,
    Opcode::ImageSampleExplicitLod,
    Opcode::ImageSampleDrefExplicitLod,
    Opcode::ImageSampleProjExplicitLod,
    Opcode::ImageSampleProjDrefExplicitLod,
    Opcode::ImageGather,
    Opcode::ImageDrefGather,
    Opcode::ImageFetch,
    Opcode::ImageRead,
    Opcode::ImageWrite,
    Opcode::ImageQuerySize,
    Opcode::ImageQuerySizeLod,
    Opcode::ImageQueryLevels,
    Opcode::ImageQuerySamples,
    Opcode::ImageSparseSampleExplicitLod,
    Opcode::ImageSparseSampleDrefExplicitLod,
    Opcode::ImageSparseGather,
    Opcode::ImageSparseDrefGather,
    Opcode::ImageSparseFetch,
    Opcode::ImageSparseRead,
    Opcode::ImageSparseTexelsResident,
    Opcode::ImageSampleFootprintNV,
];

/// Opcodes that need implicit derivatives, and are rejected by name where there are none.
pub const IMPLICIT: &[Opcode] = &[
    Opcode::ImageSampleImplicitLod,
    Opcode::ImageSampleDrefImplicitLod,
    Opcode::ImageSampleProjImplicitLod,
    Opcode::ImageSampleProjDrefImplicitLod,
    Opcode::ImageSparseSampleImplicitLod,
    Opcode::ImageSparseSampleDrefImplicitLod,
    Opcode::ImageQueryLod,
];

/// An operation on images.
#[derive(Clone, Debug, PartialEq)]
pub enum ImageOp {
    /// Samples or gathers.
    Sample(Box<sample::SampleOp>),
    /// Reads a texel.
    Read(Box<access::TexelRead>),
    /// Writes a texel.
    Write(Box<access::TexelWrite>),
    /// Reads sizes and counts of an image.
    Query(query::QueryOp),
    /// Gives the texels that a sample would read.
    Footprint(Box<footprint::FootprintOp>),
    /// Filters and compares blocks of texels.
    Process(Box<processing::ProcessOp>),
}

impl ImageOp {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        match self {
            Self::Sample(op) => op.accesses(visit),
            Self::Read(op) => op.accesses(visit),
            Self::Write(op) => op.accesses(visit),
            Self::Query(op) => op.accesses(visit),
            Self::Footprint(op) => op.accesses(visit),
            Self::Process(op) => op.accesses(visit),
        }
    }

    /// See [`crate::ops::op::Op::shared_accesses`].
    pub(super) fn shared_accesses<'a>(&'a self, visit: &mut SharedVisitor<'_, 'a>) {
        match self {
            Self::Read(op) => visit(SharedUse::Load, SharedPart::Texel(&op.texel)),
            Self::Write(op) => visit(SharedUse::Store, SharedPart::Texel(&op.texel)),
            Self::Sample(op) => {
                visit(SharedUse::Load, SharedPart::Texels { image: op.image, sampler: Some(op.sampler) })
            }
            Self::Process(op) => {
                let part = |image| SharedPart::Texels { image, sampler: None };
                op.images().for_each(|image| visit(SharedUse::Load, part(image)));
            }
            Self::Query(_) | Self::Footprint(_) => {}
        }
    }

    /// The register of the image's handle, and the view through which it reads or writes texels,
    /// with the class that its operands (`SignExtend`, `ZeroExtend`) give the texels; `None` for an
    /// operation without texels.
    pub fn accessed_view(&self) -> Option<(Reg, View)> {
        match self {
            Self::Sample(op) => Some((op.image, op.operands.view(op.view))),
            Self::Read(op) => Some((op.texel.image, op.texel.view)),
            Self::Write(op) => Some((op.texel.image, View { class: op.class, ..op.texel.view })),
            Self::Query(_) | Self::Footprint(_) | Self::Process(_) => None,
        }
    }

    /// Runs the operation for the running lanes, one after the other in their order; a lane that
    /// fails traps.
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        for lane in batch.mask.lanes() {
            if let Err(code) = self.eval_lane(&mut batch.registers, lane, bindings) {
                self.record_fault(batch, lane, bindings);
                batch.trap(Mask::lane(lane), code, batch.op);
            }
        }
    }

    fn eval_lane<const W: usize>(
        &self,
        registers: &mut Registers<W>,
        lane: usize,
        bindings: &Bindings,
    ) -> Result<(), TrapCode> {
        let reader = LaneReader::new(registers, lane, bindings);
        let (to, texel) = match self {
            Self::Sample(op) => (op.to, op.eval(reader)?),
            Self::Read(op) => (op.to, op.eval(reader)?),
            Self::Query(op) => (op.to, op.eval(reader)?),
            Self::Process(op) => (op.to, op.eval(reader)?),
            Self::Write(op) => return op.eval(reader),
            Self::Footprint(op) => {
                let words = op.eval(reader)?;
                registers.set_lane_words(op.to, lane, words);
                return Ok(());
            }
        };
        to.write(registers, lane, texel);
        Ok(())
    }

    #[cold]
    fn record_fault<const W: usize>(&self, batch: &mut Batch<W>, lane: usize, bindings: &Bindings) {
        match self {
            Self::Read(op) => op.texel.record_fault(batch, lane, bindings),
            Self::Write(op) => op.texel.record_fault(batch, lane, bindings),
            Self::Sample(op) => {
                record_sampled_fault(batch, lane, [(op.view, op.image, op.sampler)].into_iter(), bindings)
            }
            Self::Query(op) => record_view_fault(batch, lane, op.view, op.image, bindings),
            Self::Footprint(op) => {
                record_sampled_fault(batch, lane, [(op.view, op.image, op.sampler)].into_iter(), bindings)
            }
            Self::Process(op) => record_sampled_fault(batch, lane, op.sampled_images(), bindings),
        }
    }
}

/// Stores the descriptor that a lane did not find: the first image or sampler of these; where all
/// of them are there, the first image.
fn record_sampled_fault<const W: usize>(
    batch: &mut Batch<W>,
    lane: usize,
    sampled: impl Iterator<Item = (View, Reg, Reg)> + Clone,
    bindings: &Bindings,
) {
    let reader = LaneReader::new(&batch.registers, lane, bindings);
    let missing = sampled.clone().find_map(|(view, image, sampler)| {
        if reader.texels(view, image).is_err() {
            return Some(view.fault(bindings, reader.word(image)));
        }
        reader.sampler(sampler).is_err().then(|| AccessFault::sampler(reader.word(sampler), bindings))
    });
    let first = || sampled.clone().next().map(|(view, image, _)| view.fault(bindings, reader.word(image)));
    if let Some(fault) = missing.or_else(first) {
        batch.record_access_fault(lane, fault);
    }
}

/// Stores the image that a lane accessed, for the report of its trap.
fn record_view_fault<const W: usize>(
    batch: &mut Batch<W>,
    lane: usize,
    view: View,
    handle: Reg,
    bindings: &Bindings,
) {
    let handle = batch.registers[handle].0[lane];
    batch.record_access_fault(lane, view.fault(bindings, handle));
}

/// Registers that an instruction's texel is written to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TexelRegisters {
    /// The first register.
    pub to: Reg,
    /// How many components.
    pub count: u32,
    /// Whether a component takes two registers.
    pub wide: bool,
}

impl TexelRegisters {
    /// How many registers the components take.
    pub fn registers(self) -> u32 {
        if self.wide { 2 * self.count } else { self.count }
    }

    fn write<const W: usize>(self, registers: &mut Registers<W>, lane: usize, texel: [u64; 4]) {
        let components = texel.iter().take(self.count as usize);
        if self.wide {
            let words = components.flat_map(|part| [*part as u32, (part >> 32) as u32]);
            registers.set_lane_words(self.to, lane, words);
        } else {
            registers.set_lane_words(self.to, lane, components.map(|part| *part as u32));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::module::assemble::Assembler;
    use crate::module::interface::Stage;
    use crate::module::{Id, Instruction};
    use crate::ops::translate::Translator;
    use anyhit_base::error::ErrorKind;

    #[test]
    fn implicit_levels_of_detail_are_refused_by_their_rule() {
        let mut a = Assembler::new();
        a.types();
        let module = a.loaded();
        for &opcode in IMPLICIT {
            let instruction = Instruction {
                opcode,
                offset: 0,
                result_type: Some(Id(1)),
                result: Some(Id(2)),
                operands: 0..0,
            };
            let mut translator = Translator::new(&module, Stage::ClosestHit);
            let error = translate(&mut translator, &instruction).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidModule, "{opcode:?}");
            assert!(error.message().starts_with(&opcode.to_string()), "{error}");
            assert!(error.message().contains("requires implicit derivatives"), "{error}");
        }
    }
}
