//! Coordinates, levels of detail and offsets of every width.

use std::fmt::Write;
use std::sync::Arc;

use anyhit_engine::machine::format::{Component, Format};
use anyhit_engine::machine::image::{Image, ImageShape};
use anyhit_engine::machine::sampler::Sampler;
use anyhit_engine::machine::{Descriptor, Resources};

use crate::execution::instructions::operand_types::exact;
use crate::execution::instructions::operand_types::literal;
use crate::execution::instructions::operand_types::types::{self, KINDS, Kind};
use crate::execution::instructions::run::Shader;

const ANNOTATIONS: &str = "
    OpDecorate %images DescriptorSet 0
    OpDecorate %images Binding 1
    OpDecorate %sampler DescriptorSet 0
    OpDecorate %sampler Binding 2";
const IMAGE: &str = "
    %image = OpTypeImage %float 2D 0 0 0 1 Unknown
    %ptr_image = OpTypePointer UniformConstant %image
    %images = OpVariable %ptr_image UniformConstant
    %sampler_type = OpTypeSampler
    %ptr_sampler = OpTypePointer UniformConstant %sampler_type
    %sampler = OpVariable %ptr_sampler UniformConstant
    %sampled_type = OpTypeSampledImage %image
";

/// Four by two texels: 0 to 3 and 10 to 13.
fn resources() -> Resources {
    let texels = [0f32, 1.0, 2.0, 3.0, 10.0, 11.0, 12.0, 13.0];
    let bytes: Vec<u8> = texels.iter().flat_map(|texel| texel.to_le_bytes()).collect();
    let image: Arc<Image> =
        Image::new(Format::new(Component::Float32, 1), ImageShape::plane(4, 2), &bytes).expect("an image");
    Resources::default().bind(0, 1, Descriptor::Image(image)).bind(
        0,
        2,
        Descriptor::Sampler(Arc::new(Sampler::default())),
    )
}

fn shader(declarations: &str, body: &str) -> anyhit::Result<Vec<[u32; 16]>> {
    let body = format!(
        "%image_value = OpLoad %image %images
         %sampler_value = OpLoad %sampler_type %sampler
         %sampled = OpSampledImage %sampled_type %image_value %sampler_value
         {body}"
    );
    let declarations = types::declarations() + IMAGE + declarations;
    let shader =
        Shader { annotations: ANNOTATIONS, declarations: &declarations, body: &body, ..Shader::default() };
    shader.run_with(&mut resources)
}

/// The body that writes a texel's first component.
fn told(body: &mut String, texel: &str, place: usize) {
    let _ = writeln!(
        body,
        "%{texel}_x = OpCompositeExtract %float %{texel} 0
         %{texel}_w = OpConvertFToU %uint %{texel}_x
         out {place} %{texel}_w"
    );
}

#[test]
fn texels_are_fetched_by_integers_of_every_width() {
    for kind in KINDS.into_iter().filter(|kind| kind.is_integer()) {
        let name = kind.name();
        // Column 3 with the offset -2, or where nothing is negative column 0 with the offset 1; row
        // 1.
        let (column, offset) = if kind.is_signed() { (3, kind.mask() - 1) } else { (0, 1) };
        let declarations = format!(
            "%column = OpConstant %{name} {}
             %row = OpConstant %{name} {}
             %none = OpConstant %{name} {}
             %step = OpConstant %{name} {}
             %at = OpConstantComposite %{name}2 %column %row
             %by = OpConstantComposite %{name}2 %step %none\n",
            literal(kind, column),
            literal(kind, 1),
            literal(kind, 0),
            literal(kind, offset)
        );
        let mut body = String::from("%fetched = OpImageFetch %float4 %image_value %at 10 %none %by\n");
        told(&mut body, "fetched", 0);
        let found = shader(&declarations, &body).unwrap_or_else(|error| panic!("{name}: {}", error.render()));
        assert!(found.iter().all(|words| words[0] == 11), "{name}: {:?}", found[0]);
    }
}

#[test]
fn a_coordinate_beyond_32_bits_is_outside() {
    for (kind, bits) in [(Kind::I64, 0x1_0000_0001), (Kind::U64, 0x1_0000_0001), (Kind::I64, 1 << 63 | 1)] {
        let name = kind.name();
        let declarations = format!(
            "%column = OpConstant %{name} {}\n%at = OpConstantComposite %{name}2 %column %column\n",
            literal(kind, bits)
        );
        let mut body = String::from("%fetched = OpImageFetch %float4 %image_value %at 2 %u0\n");
        told(&mut body, "fetched", 0);
        // The lowest 32 bits are those of the texel (1, 1), whose red is 11; outside it is 0.
        let found = shader(&declarations, &body).unwrap_or_else(|error| panic!("{}", error.render()));
        assert!(found.iter().all(|words| words[0] == 0), "{name}: {:?}", found[0]);
    }
}

#[test]
fn samples_are_taken_at_floats_of_every_width() {
    for kind in KINDS.into_iter().filter(|kind| kind.is_float()) {
        let name = kind.name();
        let number = |value: f64| literal(kind, exact::of_f64(kind, value));
        // The middle of the third texel of the second row.
        let declarations = format!(
            "%x = OpConstant %{name} {}
             %y = OpConstant %{name} {}
             %none = OpConstant %{name} {}
             %at = OpConstantComposite %{name}2 %x %y
             %still = OpConstantComposite %{name}2 %none %none\n",
            number(0.625),
            number(0.75),
            number(0.0)
        );
        let mut body = String::from(
            "%by_level = OpImageSampleExplicitLod %float4 %sampled %at 2 %none
             %by_gradients = OpImageSampleExplicitLod %float4 %sampled %at 4 %still %still\n",
        );
        told(&mut body, "by_level", 0);
        told(&mut body, "by_gradients", 1);
        let found = shader(&declarations, &body).unwrap_or_else(|error| panic!("{name}: {}", error.render()));
        assert!(found.iter().all(|words| words[..2] == [12, 12]), "{name}: {:?}", found[0]);
    }
}

#[test]
fn coordinates_of_the_other_kind_are_refused() {
    let declarations = "
        %i_at = OpConstantComposite %uint2 %u0 %u0
        %f0 = OpConstant %float 0.0
        %f_at = OpConstantComposite %float2 %f0 %f0\n";
    for body in [
        "%r = OpImageFetch %uint4 %image_value %i_at 2 %u0\n",
        "%r = OpImageSampleExplicitLod %uint4 %sampled %f_at 2 %f0\n",
        "%r = OpImageGather %float4 %sampled %f_at %f0\n",
        "%r = OpImageDrefGather %float4 %sampled %f_at %u0\n",
        "%r = OpImageFetch %float4 %image_value %f_at 2 %u0\n",
        "%r = OpImageSampleExplicitLod %float4 %sampled %i_at 2 %f0\n",
    ] {
        let error = shader(declarations, body).expect_err("refused");
        assert_eq!(error.kind(), anyhit::ErrorKind::InvalidModule, "{}", error.render());
    }
}
