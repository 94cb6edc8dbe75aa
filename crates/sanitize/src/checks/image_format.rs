//! Image views whose format or type of numbers is not what the shader declares: what is read there
//! is undefined, and so are the texels that are written.

use crate::cause::{Cause, CauseDetails, OpPlace};
use crate::rule::image;
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Bindings, Mask, NO_CAUSE, Reg, ShadowRegisters};
use anyhit_engine::ops::image::ImageOp;
use anyhit_engine::ops::image::reader::LaneReader;
use anyhit_engine::ops::image::sample::SampleKind;
use anyhit_engine::ops::image::view::View;

/// An access to an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImageAccess {
    /// What the instruction declares of the image.
    pub view: View,
    /// The register of the image's handle.
    pub handle: Reg,
    /// The first register of what is read, and how many there are.
    pub to: Option<(Reg, u32)>,
    /// What it does, before the image's name: `a read of`.
    pub does: &'static str,
}

/// An image operation has run.
pub(crate) fn check_image<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    operation: &ImageOp,
) {
    let access = match operation {
        ImageOp::Read(read) => {
            let (view, handle) = (read.texel.view, read.texel.image);
            ImageAccess { view, handle, to: Some((read.to.to, read.to.registers())), does: "a read of" }
        }
        ImageOp::Write(write) => {
            let view = View { class: write.class, ..write.texel.view };
            ImageAccess { view, handle: write.texel.image, to: None, does: "a write to" }
        }
        ImageOp::Sample(sample) if sample.kind != SampleKind::QueryLod => {
            let (view, handle) = (sample.operands.view(sample.view), sample.image);
            ImageAccess { view, handle, to: Some((sample.to.to, sample.to.registers())), does: "a sample of" }
        }
        ImageOp::Sample(_) | ImageOp::Query(_) | ImageOp::Footprint(_) | ImageOp::Process(_) => return,
    };
    check(sanitizer, batch, bindings, shadow, place, access);
}

/// An access to an image has run.
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    access: ImageAccess,
) {
    let ImageAccess { view, handle, to, does } = access;
    let Some((_, plan)) = sanitizer.plan() else { return };
    let handles = &batch.registers[handle];
    let mut rest = batch.mask;
    while let Some(lane) = rest.lowest() {
        let same = rest & Mask::equal(handles, handles.0[lane]);
        rest = rest.without(same);
        let reader = LaneReader::new(&batch.registers, lane, bindings);
        let bound = reader.image(view, handle).ok().filter(|image| !image.is_null());
        let Some([declared, bound]) = bound.and_then(|image| view.contradiction(image.format())) else {
            continue;
        };
        let message = || {
            let name = plan.program.describe_descriptor(handles.0[lane]);
            let name = name.unwrap_or_else(|| "an image".to_owned());
            format!("{does} {name}, which is declared with {declared}, and whose view has {bound}")
        };
        match to {
            Some((first, count)) => {
                let rule = &image::IMAGE_FORMAT;
                let number = sanitizer.cause(Cause::Broken { place, rule: rule.id }, || {
                    Some(CauseDetails { rule, message: message(), operand: NO_CAUSE })
                });
                shadow.undefine_span(first, count, same, number);
            }
            _ => sanitizer.tell(batch, &image::IMAGE_FORMAT, place.op, same, |_| message()),
        }
    }
}
