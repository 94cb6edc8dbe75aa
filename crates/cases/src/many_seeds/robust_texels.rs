//! Drawn texels for robust reads outside their image or texel buffer.
//!
//! Of an image, `robustImageAccess` gives zeros, and an alpha of 0 or 1. Of a texel buffer,
//! `robustBufferAccess` gives any texel that is there, or three zeros and 0, 1 or the greatest
//! integer. This crate's own choice is that of `robustImageAccess2` and `robustBufferAccess2`:
//! zeros, and for an alpha that the format lacks 1.

use crate::many_seeds::lane_bits::set_words;
use anyhit_engine::machine::format::Class;
use anyhit_engine::machine::image::{Dimension, Image};
use anyhit_engine::machine::{Batch, Bindings, ChoiceKind, DrawnDetails, OpIndex, OpenChoices};
use anyhit_engine::math::random::Random;
use anyhit_engine::ops::image::ImageOp;
use anyhit_engine::ops::image::reader::LaneReader;
use anyhit_engine::ops::op::Op;
use anyhit_engine::program::Program;

/// Draws the texels of an operation that has read outside its image.
pub(super) fn after<const W: usize>(
    program: &Program,
    choices: &OpenChoices,
    op: OpIndex,
    executed: &Op,
    batch: &mut Batch<W>,
    bindings: &Bindings,
) {
    let Op::Image(ImageOp::Read(read)) = executed else { return };
    let Some(offset) = program.origins.get(op.index()).map(|origin| origin.offset) else { return };
    let place = u64::from(choices.shader.0) << 32 | u64::from(offset);
    for lane in batch.mask.lanes() {
        let reader = LaneReader::new(&batch.registers, lane, bindings);
        let Ok(image) = reader.image(read.texel.view, read.texel.image) else { continue };
        if image.is_null() || read.texel.resolve(reader).is_ok() {
            continue;
        }
        let launch_id = batch.invocations.launch_id(lane);
        let site = choices.site(ChoiceKind::RobustTexel, launch_id, place);
        let Some(mut random) = choices.draw(site) else { continue };
        let texel = draw(image, &mut random);
        let words = if read.to.wide { 2 } else { 1 };
        for (component, bits) in (0..read.to.count).zip(texel) {
            set_words(batch, read.to.to.plus(component * words), words, lane, bits);
        }
        choices.note(site, || DrawnDetails::Value { shader: choices.shader, op: Some(op), what: None });
    }
}

/// A texel that may be read outside an image.
fn draw(image: &Image, random: &mut Random) -> [u64; 4] {
    let format = image.format();
    let of_buffer = image.shape().dimension == Dimension::Buffer;
    let count = u64::from(image.shape().extent[0]);
    if of_buffer && random.below(2) == 0 && count > 0 {
        return format.decode(image.load(random.below(count) as usize));
    }
    let greatest = match format.class() {
        Class::Float => format.one(),
        Class::Sint => i32::MAX as u64,
        Class::Uint => u32::MAX.into(),
    };
    let alphas = [0, format.one(), greatest];
    [0, 0, 0, alphas[random.below(if of_buffer { 3 } else { 2 }) as usize]]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use anyhit_engine::machine::format::{Component, Format};
    use anyhit_engine::machine::image::ImageShape;

    fn drawn(image: &Image) -> BTreeSet<[u64; 4]> {
        (0..200).map(|seed| draw(image, &mut Random::new(seed))).collect()
    }

    #[test]
    fn outside_an_image_the_alpha_is_0_or_1() {
        let image = Image::filled(Format::new(Component::Unorm8, 4), ImageShape::plane(2, 1), &[255; 4]);
        let one = u64::from(1f32.to_bits());
        assert_eq!(drawn(&image.expect("an image")), [[0; 4], [0, 0, 0, one]].into());
    }

    #[test]
    fn outside_a_texel_buffer_any_of_its_texels_is_read() {
        let shape = ImageShape { dimension: Dimension::Buffer, ..ImageShape::plane(2, 1) };
        let bytes = [5u32, 7].map(u32::to_le_bytes).concat();
        let image = Image::new(Format::new(Component::Uint32, 1), shape, &bytes).expect("an image");
        let zeros = [0, 1, u64::from(u32::MAX)].map(|x| [0, 0, 0, x]);
        assert_eq!(drawn(&image), zeros.into_iter().chain([[5, 0, 0, 1], [7, 0, 0, 1]]).collect());
    }
}
