//! Image operations under the sanitizer: what is undefined or no number among their operands, and
//! samplers that do not fit the instruction.

use crate::checks::births;
use crate::checks::lanes::{nan_lanes, special_lanes};
use crate::report::Sink;
use crate::report::specials::SpecialSink;
use crate::rule::{Rule, image, module};
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::image::Image;
use anyhit_engine::machine::sampler::{AddressMode, Filter, Sampler};
use anyhit_engine::machine::{Batch, Bindings, Mask, OpIndex, ShadowRegisters};
use anyhit_engine::ops::image::ImageOp;
use anyhit_engine::ops::image::access::TexelWrite;
use anyhit_engine::ops::image::operands::Operands;
use anyhit_engine::ops::image::reader::LaneReader;
use anyhit_engine::ops::image::sample::{SampleKind, SampleOp};
use anyhit_engine::ops::value_registers::Words;

/// Offsets of texels that every device has: `minTexelOffset` to `maxTexelOffset`.
const OFFSETS: [i32; 2] = [-8, 7];
/// Offsets of gathers that devices have in practice. The specification asks for less.
const GATHER_OFFSETS: [i32; 2] = [-32, 31];

/// An image operation has run.
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    op: OpIndex,
    operation: &ImageOp,
) {
    match operation {
        ImageOp::Write(write) => return check_write(sanitizer, batch, bindings, shadow, op, write),
        ImageOp::Sample(sample) => {
            check_numbers(sanitizer, batch, shadow, op, sample);
            let gathers = matches!(sample.kind, SampleKind::Gather(_) | SampleKind::GatherDref);
            let limits = if gathers { GATHER_OFFSETS } else { OFFSETS };
            let Operands { offset, offsets, .. } = &sample.operands;
            check_offsets(sanitizer, batch, op, [offset, offsets], limits);
            check_sampler(sanitizer, batch, bindings, op, sample);
            if let SampleKind::Gather(component) = sample.kind {
                let component = &batch.registers[component];
                let outside = Mask::from_fn(|lane| component.0[lane] > 3) & batch.mask;
                sanitizer.tell(batch, &module::GATHER_COMPONENT, op, outside, |lane| {
                    format!("the component of a gather is {}", component.0[lane] as i32)
                });
            }
        }
        ImageOp::Read(read) => check_offsets(sanitizer, batch, op, [&read.texel.offset, &None], OFFSETS),
        _ => {}
    }
    sanitizer.depend_on_reads(batch, shadow, op, Sink::Coordinate, &mut |visit| operation.accesses(visit));
}

fn check_write<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    op: OpIndex,
    write: &TexelWrite,
) {
    for register in write.texel.registers() {
        sanitizer.depend(batch, shadow, op, register, Sink::Coordinate);
    }
    // Components that no image here has are dropped.
    let handles = &batch.registers[write.texel.image];
    let (mut rest, mut channels) = (batch.mask, 0);
    while let Some(lane) = rest.lowest() {
        rest = rest.without(Mask::equal(handles, handles.0[lane]));
        let reader = LaneReader::new(&batch.registers, lane, bindings);
        let image = reader.image(write.texel.view, write.texel.image);
        channels = channels.max(image.map_or(0, |image| image.format().channels));
    }
    for &register in write.from.iter().take(channels.into()) {
        sanitizer.depend(batch, shadow, op, register, Sink::Image);
        let handle = batch.mask.lowest().map_or(0, |lane| batch.registers[write.texel.image].0[lane]);
        let sink = SpecialSink::Image(handle);
        births::reach(sanitizer, batch, shadow, op, register, batch.mask, sink);
    }
}

/// Reports coordinates, levels and gradients that are NaN or infinite.
fn check_numbers<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &ShadowRegisters<W>,
    op: OpIndex,
    sample: &SampleOp,
) {
    let Operands { lod, bias, min_lod, gradients, .. } = &sample.operands;
    let divisor = sample.divisor.iter().copied();
    let coordinates = sample.coordinate.iter().copied().chain(divisor).map(|one| (one, "a coordinate"));
    let levels = [*lod, *min_lod].into_iter().flatten().map(|one| (one, "the level of detail"));
    let biases = bias.iter().map(|&one| (one, "the bias"));
    let gradients = gradients.iter().flatten().flatten().map(|&one| (one, "a gradient"));
    for (register, name) in coordinates.chain(levels).chain(biases).chain(gradients) {
        let special = special_lanes(&batch.registers, register, 32) & batch.mask;
        let special = special.without(shadow.undefined(register));
        if special.is_empty() {
            continue;
        }
        births::reach(sanitizer, batch, shadow, op, register, special, SpecialSink::Sample(name));
        let read =
            Mask::from_fn(|lane| special.contains(lane) && !sanitizer.is_born(shadow.cause(register, lane)));
        let nans = nan_lanes(&batch.registers, register, 32);
        sanitizer.tell(batch, &image::IMAGE_NAN_COORDINATE, op, read, |lane| {
            let what = if nans.contains(lane) { "a NaN" } else { "infinite" };
            format!("{name} of an image access is {what}")
        });
    }
}

/// Reports offsets of texels beyond the limits of devices.
fn check_offsets<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    offsets: [&Option<Words>; 2],
    [least, most]: [i32; 2],
) {
    for &register in offsets.into_iter().flatten().flatten() {
        let offset = |lane: usize| batch.registers[register].0[lane] as i32;
        let outside = Mask::from_fn(|lane| !(least..=most).contains(&offset(lane))) & batch.mask;
        sanitizer.tell(batch, &image::IMAGE_OFFSET, op, outside, |lane| {
            format!("an offset of {} texels, where devices take {least} to {most}", offset(lane))
        });
    }
}

/// Reports samplers whose state does not fit the instruction, or itself.
fn check_sampler<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    op: OpIndex,
    sample: &SampleOp,
) {
    let handle = |lane: usize| batch.registers[sample.sampler].0[lane];
    let mut rest = batch.mask;
    while let Some(lane) = rest.lowest() {
        let same = rest & Mask::equal(&batch.registers[sample.sampler], handle(lane));
        rest = rest.without(same);
        let reader = LaneReader::new(&batch.registers, lane, bindings);
        // What stands in for a descriptor that is not bound is of no sampler's state.
        if reader.image(sample.view, sample.image).is_ok_and(Image::is_null) {
            continue;
        }
        let Ok(sampler) = reader.sampler(sample.sampler) else { continue };
        let Some((rule, fault)) = fault_of(sampler, sample) else { continue };
        sanitizer.tell_of_program(batch, rule, op, same, |program| {
            let name = program.describe_descriptor(handle(lane));
            format!("{} {fault}", name.unwrap_or_else(|| "a sampler".to_owned()))
        });
    }
}

/// What is wrong with a sampler, by itself or for an instruction.
fn fault_of(sampler: &Sampler, sample: &SampleOp) -> Option<(&'static Rule, String)> {
    let &Sampler { min_lod, max_lod, unnormalized_coordinates, .. } = sampler;
    if min_lod > max_lod {
        let fault = format!("has the least level of detail {min_lod:?}, and the greatest {max_lod:?}");
        return Some((&image::IMAGE_LOD_RANGE, fault));
    }
    let queries = sample.kind == SampleKind::QueryLod;
    let compares = sampler.compare_op.is_some();
    let fault = match () {
        () if compares && sample.reference.is_none() && !queries => {
            "compares, and is used without a reference"
        }
        () if !unnormalized_coordinates => return None,
        () if sample.reference.is_some() => "has unnormalized coordinates, and is used with a reference",
        () if sample.divisor.is_some() => "has unnormalized coordinates, and is used with a projection",
        () if sample.operands.bias.is_some() => "has unnormalized coordinates, and is used with a bias",
        () if sample.operands.offset.is_some() || sample.operands.offsets.is_some() => {
            "has unnormalized coordinates, and is used with an offset"
        }
        () if sampler.mag_filter != sampler.min_filter => "has unnormalized coordinates, and two filters",
        () if sampler.mipmap_mode != Filter::Nearest => {
            "has unnormalized coordinates, and filters between levels"
        }
        () if min_lod != 0.0 || max_lod != 0.0 => "has unnormalized coordinates, and more than level 0",
        () if !sampler.address_mode[..2].iter().all(|&mode| clamps(mode)) => {
            "has unnormalized coordinates, and does not clamp them"
        }
        () if sampler.max_anisotropy > 1.0 => "has unnormalized coordinates, and anisotropic filtering",
        () => return None,
    };
    Some((&image::SAMPLER_MATCH, fault.to_owned()))
}

fn clamps(mode: AddressMode) -> bool {
    matches!(mode, AddressMode::ClampToEdge | AddressMode::ClampToBorder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::machine::Reg;
    use anyhit_engine::machine::format::Class;
    use anyhit_engine::machine::image::Dimension;
    use anyhit_engine::machine::sampler::CompareOp;
    use anyhit_engine::ops::image::TexelRegisters;
    use anyhit_engine::ops::image::view::View;

    fn sample() -> SampleOp {
        let view = View {
            dimension: Dimension::D2,
            multisampled: false,
            class: Class::Float,
            wide: false,
            format: None,
        };
        SampleOp {
            to: TexelRegisters { to: Reg(0), count: 4, wide: false },
            kind: SampleKind::Filter,
            view,
            image: Reg(4),
            sampler: Reg(5),
            coordinate: [Reg(6), Reg(7)].into_iter().collect(),
            divisor: None,
            reference: None,
            operands: Operands::default(),
        }
    }

    /// VkSamplerCreateInfo's valid usage, and that of the instructions that sample.
    #[test]
    fn samplers_of_unnormalized_coordinates_have_one_level_and_clamp() {
        let plain = Sampler {
            mipmap_mode: Filter::Nearest,
            address_mode: [AddressMode::ClampToEdge; 3],
            max_lod: 0.0,
            unnormalized_coordinates: true,
            ..Sampler::default()
        };
        let fault = |sampler: Sampler, sample: SampleOp| fault_of(&sampler, &sample).map(|(rule, _)| rule.id);
        assert_eq!(fault(plain, sample()), None);
        assert_eq!(fault(Sampler { max_lod: 1.0, ..plain }, sample()), Some("sampler-match"));
        assert_eq!(fault(Sampler { max_lod: -1.0, ..plain }, sample()), Some("image-lod-range"));
        let repeats = [AddressMode::ClampToEdge, AddressMode::Repeat, AddressMode::ClampToEdge];
        assert_eq!(fault(Sampler { address_mode: repeats, ..plain }, sample()), Some("sampler-match"));
        assert_eq!(fault(Sampler { mipmap_mode: Filter::Linear, ..plain }, sample()), Some("sampler-match"));
        assert_eq!(fault(Sampler { min_filter: Filter::Nearest, ..plain }, sample()), Some("sampler-match"));
        assert_eq!(fault(Sampler { max_anisotropy: 4.0, ..plain }, sample()), Some("sampler-match"));
        let projected = SampleOp { divisor: Some(Reg(8)), ..sample() };
        assert_eq!(fault(plain, projected.clone()), Some("sampler-match"));
        assert_eq!(fault(Sampler::default(), projected), None);
        let compares = Sampler { compare_op: Some(CompareOp::Less), ..Sampler::default() };
        assert_eq!(fault(compares, sample()), Some("sampler-match"));
        assert_eq!(fault(compares, SampleOp { reference: Some(Reg(8)), ..sample() }), None);
        assert_eq!(fault(compares, SampleOp { kind: SampleKind::QueryLod, ..sample() }), None);
    }
}
