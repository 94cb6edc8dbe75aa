//! Image processing and footprints, by hand.

use std::sync::Arc;

use anyhit_engine::machine::format::{Component, Format};
use anyhit_engine::machine::image::{Dimension, Image, ImageShape, SampleWeight};
use anyhit_engine::machine::sampler::{AddressMode, BlockMatchWindow, Filter, Sampler};
use anyhit_engine::machine::{Descriptor, Resources};

use crate::execution::instructions::run::Shader;

const ANNOTATIONS: &str = "
    OpDecorate %images DescriptorSet 0
    OpDecorate %images Binding 1
    OpDecorate %sampler DescriptorSet 0
    OpDecorate %sampler Binding 2
    OpDecorate %weights DescriptorSet 0
    OpDecorate %weights Binding 3
    OpDecorate %separable DescriptorSet 0
    OpDecorate %separable Binding 4";
const DECLARATIONS: &str = "
    %image = OpTypeImage %float 2D 0 0 0 1 Unknown
    %ptr_image = OpTypePointer UniformConstant %image
    %images = OpVariable %ptr_image UniformConstant
    %sampler_type = OpTypeSampler
    %ptr_sampler = OpTypePointer UniformConstant %sampler_type
    %sampler = OpVariable %ptr_sampler UniformConstant
    %sampled_type = OpTypeSampledImage %image
    %weight_image = OpTypeImage %float 2D 0 1 0 1 Unknown
    %ptr_weights = OpTypePointer UniformConstant %weight_image
    %weights = OpVariable %ptr_weights UniformConstant
    %sampled_weights = OpTypeSampledImage %weight_image
    %separable_image = OpTypeImage %float 1D 0 1 0 1 Unknown
    %ptr_separable = OpTypePointer UniformConstant %separable_image
    %separable = OpVariable %ptr_separable UniformConstant
    %sampled_separable = OpTypeSampledImage %separable_image
    %f0 = OpConstant %float 0.0
    %half_one = OpConstant %float 0.5
    %f1 = OpConstant %float 1.0
    %f1_5 = OpConstant %float 1.5
    %f2 = OpConstant %float 2.0
    %quarter = OpConstant %float 0.25
    %sixty_fourth = OpConstant %float 0.015625
    %at_corner = OpConstantComposite %float2 %f2 %f1
    %at_middle = OpConstantComposite %float2 %f1_5 %f1
    %two_by_two = OpConstantComposite %float2 %f2 %f2
    %two_by_one = OpConstantComposite %float2 %f2 %f1
    %at_second_row = OpConstantComposite %float2 %f1 %f1_5
    %at_top = OpConstantComposite %float2 %f1 %half_one
    %at_seam = OpConstantComposite %float2 %quarter %sixty_fourth
    %at_00 = OpConstantComposite %uint2 %u0 %u0
    %at_11 = OpConstantComposite %uint2 %u1 %u1
    %at_01 = OpConstantComposite %uint2 %u0 %u1
    %at_21 = OpConstantComposite %uint2 %u2 %u1
    %footprint = OpTypeStruct %bool %uint2 %uint2 %uint2 %uint %uint";

/// Runs a body that finds `%s`, the image with its sampler.
fn run(body: &str, image: &Arc<Image>, sampler: Sampler, weights: [&Arc<Image>; 2]) -> [u32; 16] {
    let shader = Shader {
        capabilities: "
            OpCapability TextureSampleWeightedQCOM
            OpCapability TextureBoxFilterQCOM
            OpCapability TextureBlockMatchQCOM
            OpCapability TextureBlockMatch2QCOM
            OpCapability ImageFootprintNV",
        annotations: ANNOTATIONS,
        declarations: DECLARATIONS,
        body: &format!(
            "%image_value = OpLoad %image %images
             %sampler_value = OpLoad %sampler_type %sampler
             %s = OpSampledImage %sampled_type %image_value %sampler_value
             {body}"
        ),
        ..Shader::default()
    };
    let found = shader.run_with(&mut || {
        let descriptor = |image: &Arc<Image>| Descriptor::Image(image.clone());
        Resources::default()
            .bind(0, 1, descriptor(image))
            .bind(0, 2, Descriptor::Sampler(Arc::new(sampler)))
            .bind(0, 3, descriptor(weights[0]))
            .bind(0, 4, descriptor(weights[1]))
    });
    found.unwrap_or_else(|error| panic!("{}", error.render()))[0]
}

/// Four texels a row: 0, 1, 2, 3 and 10, 11, 12, 13.
fn plane() -> Arc<Image> {
    floats(ImageShape::plane(4, 2), &[0.0, 1.0, 2.0, 3.0, 10.0, 11.0, 12.0, 13.0])
}

fn floats(shape: ImageShape, texels: &[f32]) -> Arc<Image> {
    let bytes: Vec<u8> = texels.iter().flat_map(|texel| texel.to_le_bytes()).collect();
    Image::new(Format::new(Component::Float32, 1), shape, &bytes).expect("an image")
}

fn in_texels() -> Sampler {
    Sampler {
        address_mode: [AddressMode::ClampToEdge; 3],
        unnormalized_coordinates: true,
        ..Sampler::default()
    }
}

fn processed(body: &str, sampler: Sampler) -> Vec<f32> {
    let weights =
        floats(ImageShape { dimension: Dimension::D2Array, ..ImageShape::plane(2, 1) }, &[0.25, 0.75]);
    weights.set_sample_weight(SampleWeight { center: [0, 0], size: [2, 1], phases: 1 });
    let shape = ImageShape { dimension: Dimension::D1Array, layers: 2, ..ImageShape::plane(4, 1) };
    let separable = floats(shape, &[0.5, 0.5, 0.0, 0.0, 0.25, 0.75, 0.0, 0.0]);
    separable.set_sample_weight(SampleWeight { center: [0, 0], size: [2, 2], phases: 1 });
    let mut text = body.to_owned();
    for part in 0..4 {
        text += &format!(
            "\n%part_{part} = OpCompositeExtract %float %value {part}
             %bits_{part} = OpBitcast %uint %part_{part}
             out {part} %bits_{part}"
        );
    }
    run(&text, &plane(), sampler, [&weights, &separable])[..4]
        .iter()
        .map(|&bits| f32::from_bits(bits))
        .collect()
}

#[test]
fn boxes_are_averaged_by_what_they_cover() {
    // (1 + 2 + 11 + 12) / 4; the format lacks G and B, and A is 1.
    let whole = processed("%value = OpImageBoxFilterQCOM %float4 %s %at_corner %two_by_two", in_texels());
    assert_eq!(whole, [6.5, 0.0, 0.0, 1.0]);
    // Across (1/2, 1, 1/2), down (1/2, 1/2): (0 + 1 + 1) / 2 + (5 + 11 + 6) / 2 = 12, by 2 x 1.
    let part = processed("%value = OpImageBoxFilterQCOM %float4 %s %at_middle %two_by_one", in_texels());
    assert_eq!(part[0], 6.0);
}

#[test]
fn blocks_are_compared() {
    // 11 - 0 and 12 - 1.
    let sad = "%value = OpImageBlockMatchSADQCOM %float4 %s %at_00 %s %at_11 %at_21";
    assert_eq!(processed(sad, in_texels()), [22.0, 0.0, 0.0, 0.0]);
    let ssd = "%value = OpImageBlockMatchSSDQCOM %float4 %s %at_00 %s %at_11 %at_21";
    assert_eq!(processed(ssd, in_texels())[0], 242.0);
    // 10 against 0, 1, 2 and 3.
    let gather = "%value = OpImageBlockMatchGatherSADQCOM %float4 %s %at_00 %s %at_01 %at_11";
    assert_eq!(processed(gather, in_texels()), [10.0, 9.0, 8.0, 7.0]);
    let gather = "%value = OpImageBlockMatchGatherSSDQCOM %float4 %s %at_00 %s %at_01 %at_11";
    assert_eq!(processed(gather, in_texels()), [100.0, 81.0, 64.0, 49.0]);
    // 11 among 0, 1, 2 and 10, 11, 12: the same at (1, 1), farthest at (0, 0).
    let window = |greatest| Sampler {
        block_match_window: Some(BlockMatchWindow { extent: [3, 2], greatest }),
        ..in_texels()
    };
    let sad = "%value = OpImageBlockMatchWindowSADQCOM %float4 %s %at_00 %s %at_11 %at_11";
    assert_eq!(processed(sad, window(false)), [0.0, 1.0, 1.0, 0.0]);
    let ssd = "%value = OpImageBlockMatchWindowSSDQCOM %float4 %s %at_00 %s %at_11 %at_11";
    assert_eq!(processed(ssd, window(true)), [121.0, 0.0, 0.0, 0.0]);
}

#[test]
fn texels_are_weighted_by_another_image() {
    let plain = "
        %weight_value = OpLoad %weight_image %weights
        %w = OpSampledImage %sampled_weights %weight_value %sampler_value
        %value = OpImageSampleWeightedQCOM %float4 %s %at_second_row %w";
    // 11 / 4 + 12 * 3 / 4
    assert_eq!(processed(plain, in_texels())[0], 11.75);
    let separable = "
        %weight_value = OpLoad %separable_image %separable
        %w = OpSampledImage %sampled_separable %weight_value %sampler_value
        %value = OpImageSampleWeightedQCOM %float4 %s %at_top %w";
    // (1 + 2) / 2 / 4 + (11 + 12) / 2 * 3 / 4
    assert_eq!(processed(separable, in_texels())[0], 9.0);
}

/// The words of a footprint at s = 1/4, t = 1/64 of 64 x 64 texels with two levels.
fn footprint(lod: &str, coarse: &str) -> [u32; 9] {
    let shape = ImageShape { levels: 2, ..ImageShape::plane(64, 64) };
    let image = Image::zeroed(Format::new(Component::Unorm8, 1), shape).expect("an image");
    let sampler = Sampler {
        mipmap_mode: Filter::Linear,
        address_mode: [AddressMode::ClampToEdge; 3],
        ..Sampler::default()
    };
    let body = format!(
        "%found = OpImageSampleFootprintNV %footprint %s %at_seam %u1 {coarse} 2 {lod}
         %single = OpCompositeExtract %bool %found 0
         %w0 = OpSelect %uint %single %u1 %u0
         out 0 %w0
         %w1 = OpCompositeExtract %uint %found 1 0
         out 1 %w1
         %w2 = OpCompositeExtract %uint %found 1 1
         out 2 %w2
         %w3 = OpCompositeExtract %uint %found 2 0
         out 3 %w3
         %w4 = OpCompositeExtract %uint %found 2 1
         out 4 %w4
         %w5 = OpCompositeExtract %uint %found 3 0
         out 5 %w5
         %w6 = OpCompositeExtract %uint %found 3 1
         out 6 %w6
         %w7 = OpCompositeExtract %uint %found 4
         out 7 %w7
         %w8 = OpCompositeExtract %uint %found 5
         out 8 %w8"
    );
    run(&body, &image, sampler, [&image, &image])[..9].try_into().expect("nine words")
}

#[test]
fn footprints_tell_groups_of_texels() {
    // Texels 15, 16 and 0, 1 of level 0: of groups of two by two 7, 8 and 0. Group 8 is the first
    // of the second eight, one group lies before it: anchor 1, offset 1, bits 0 and 7.
    assert_eq!(footprint("%f0", "%false"), [1, 1, 0, 1, 0, 0x81, 0, 0, 0]);
    // Level 0 is the only one: nothing of the coarser.
    assert_eq!(footprint("%f0", "%true"), [1, 0, 0, 0, 0, 0, 0, 0, 0]);
    // Between both levels: of 32 x 32 texels 7, 8 and 0 alone, whose neighbour has no weight.
    assert_eq!(footprint("%half_one", "%false"), [0, 1, 0, 1, 0, 0x81, 0, 0, 0]);
    assert_eq!(footprint("%half_one", "%true"), [0, 0, 0, 0, 0, 0x18, 0, 1, 0]);
}
