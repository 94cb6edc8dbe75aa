//! Undefined contents of buffers and images that the scene does not fill: what a shader loads
//! before one has stored it is undefined.

use crate::cause::OpPlace;
use crate::checks::atomic::follow;
use crate::checks::lanes::workgroup_lanes;
use crate::rule::memory;
use crate::sanitizer::Sanitizer;
use crate::unwritten::UnwrittenPart;
use anyhit_engine::machine::{Batch, Bindings, Mask, Reg, ShadowRegisters};
use anyhit_engine::ops::atomic::{AtomicOp, AtomicTarget};
use anyhit_engine::ops::cooperative::VectorProduct;
use anyhit_engine::ops::cooperative::matrix::MatrixAccess;
use anyhit_engine::ops::image::ImageOp;
use anyhit_engine::ops::image::reader::LaneReader;
use anyhit_engine::ops::image::sample::SampleKind;
use anyhit_engine::ops::memory::{BufferRef, Chunk, access_location};

/// A load into consecutive registers has run.
pub(crate) fn load<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    chunk: &Chunk,
    to: Reg,
) {
    for lane in buffer_lanes(sanitizer, batch, chunk).lanes() {
        let Some((buffer, offset)) = access_location(batch, lane, bindings, chunk) else { continue };
        let width = chunk.width / 8;
        if sanitizer.unwritten.byte(buffer, offset, width * chunk.count).is_none() {
            continue;
        }
        for scalar in 0..chunk.count {
            let at = offset + u64::from(scalar * width);
            if let Some(part) = sanitizer.unwritten.byte(buffer, at, width) {
                let byte = part.at as u64 - buffer.offset();
                let cause = unwritten_byte(sanitizer, batch, lane, place, chunk, (part, byte));
                shadow.undefine(to.plus(scalar), Mask::lane(lane), cause);
            }
        }
    }
}

/// A product of a matrix in a buffer has run: all of its result is undefined where one component
/// of the matrix is.
pub(crate) fn product<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    product: &VectorProduct,
) {
    let chunk = &product.matrix;
    for lane in buffer_lanes(sanitizer, batch, chunk).lanes() {
        let Some((buffer, offset)) = access_location(batch, lane, bindings, chunk) else { continue };
        let mut lines = product.lines_in_memory(&batch.registers, lane);
        let found = lines.find_map(|(at, bytes)| sanitizer.unwritten.byte(buffer, offset + at, bytes));
        if let Some(part) = found {
            let byte = part.at as u64 - buffer.offset();
            let cause = unwritten_byte(sanitizer, batch, lane, place, chunk, (part, byte));
            shadow.undefine_span(product.to, product.rows, Mask::lane(lane), cause);
        }
    }
}

/// A store has run.
pub(crate) fn store<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    chunk: &Chunk,
) {
    for lane in buffer_lanes(sanitizer, batch, chunk).lanes() {
        if let Some((buffer, offset)) = access_location(batch, lane, bindings, chunk) {
            sanitizer.unwritten.write_bytes(buffer, offset, chunk.width / 8 * chunk.count);
        }
    }
}

/// A store of a matrix has run: each of its components is written.
pub(crate) fn store_matrix<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    access: &MatrixAccess,
) {
    for lane in buffer_lanes(sanitizer, batch, &access.memory).lanes() {
        if let Some((buffer, offset)) = access_location(batch, lane, bindings, &access.memory) {
            for (at, bytes) in access.components_in_memory(&batch.registers, lane) {
                sanitizer.unwritten.write_bytes(buffer, offset + at, bytes);
            }
        }
    }
}

/// An atomic instruction has run.
pub(crate) fn atomic<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    op: &AtomicOp,
) {
    let width = op.width / 8;
    match &op.target {
        AtomicTarget::Buffer(chunk) => {
            let lanes = buffer_lanes(sanitizer, batch, chunk);
            follow(sanitizer, batch, shadow, place, op, lanes, |sanitizer, lane, written| {
                let (buffer, offset) = access_location(batch, lane, bindings, chunk)?;
                let found = sanitizer.unwritten.byte(buffer, offset, width);
                if written.is_some() {
                    sanitizer.unwritten.write_bytes(buffer, offset, width);
                }
                let part = found?;
                let byte = part.at as u64 - buffer.offset();
                Some(unwritten_byte(sanitizer, batch, lane, place, chunk, (part, byte)))
            });
        }
        AtomicTarget::Texel(texel) if sanitizer.unwritten.has_images() => {
            follow(sanitizer, batch, shadow, place, op, batch.mask, |sanitizer, lane, written| {
                let reader = LaneReader::new(&batch.registers, lane, bindings);
                let (image, index) = texel.resolve(reader).ok()?;
                let found = sanitizer.unwritten.texel(image, index);
                if written.is_some() {
                    sanitizer.write_texel(image, index, place);
                }
                found.map(|part| sanitizer.unwritten_cause(&memory::UNINIT_IMAGE, place, part, || None))
            });
        }
        AtomicTarget::Texel(_) | AtomicTarget::Registers { .. } => {}
    }
}

/// An image operation has run.
pub(crate) fn image<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    op: &ImageOp,
) {
    if !sanitizer.unwritten.has_images() {
        return;
    }
    for lane in batch.mask.lanes() {
        let reader = LaneReader::new(&batch.registers, lane, bindings);
        let (to, found) = match op {
            ImageOp::Read(read) => {
                let Ok((image, index)) = read.texel.resolve(reader) else { continue };
                (read.to, sanitizer.unwritten.texel(image, index))
            }
            ImageOp::Write(write) => {
                if let Ok((image, index)) = write.texel.resolve(reader) {
                    sanitizer.write_texel(image, index, place);
                }
                continue;
            }
            // Which texels are filtered is not looked at.
            ImageOp::Sample(sample) if sample.kind == SampleKind::QueryLod => return,
            ImageOp::Sample(sample) => {
                let Ok(image) = reader.image(sample.view, sample.image) else { continue };
                (sample.to, sanitizer.unwritten.whole_image(image))
            }
            ImageOp::Query(_) | ImageOp::Footprint(_) | ImageOp::Process(_) => return,
        };
        if let Some(part) = found {
            let cause = sanitizer.unwritten_cause(&memory::UNINIT_IMAGE, place, part, || None);
            shadow.undefine_span(to.to, to.registers(), Mask::lane(lane), cause);
        }
    }
}

/// The number of the cause that an access of a lane loads a byte that nobody has written: the part
/// of its buffer, and its offset from where the descriptor begins.
fn unwritten_byte<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    lane: usize,
    place: OpPlace,
    chunk: &Chunk,
    (part, byte): (UnwrittenPart, u64),
) -> u32 {
    let plans = sanitizer.plans;
    let member = || {
        let program = &plans.get(place.shader.index())?.program;
        match chunk.buffer {
            BufferRef::Handle(handle) => program.describe_buffer_byte(handle, byte),
            BufferRef::Computed(register) => {
                program.describe_buffer_byte(batch.registers[register].0[lane], byte)
            }
            BufferRef::Address(_) => program.pointee_path(place.op).map(|path| format!("`{path}`")),
            BufferRef::PushConstants | BufferRef::ShaderRecord | BufferRef::Workgroup => None,
        }
    };
    sanitizer.unwritten_cause(&memory::UNINIT_BUFFER, place, part, member)
}

/// The lanes whose access is to a buffer that the scene may not have filled.
fn buffer_lanes<const W: usize>(sanitizer: &Sanitizer<'_>, batch: &Batch<W>, chunk: &Chunk) -> Mask<W> {
    match chunk.buffer {
        BufferRef::PushConstants | BufferRef::ShaderRecord => Mask::NONE,
        _ if !sanitizer.unwritten.has_buffers() => Mask::NONE,
        _ => batch.mask.without(workgroup_lanes(batch, chunk)),
    }
}
