//! Descriptors as values: acceleration structures by address, whole arrays of descriptors.

use std::sync::Arc;

use anyhit::{Instance, Scene};
use anyhit_engine::machine::format::{Component, Format};
use anyhit_engine::machine::image::{Image, ImageShape};
use anyhit_engine::machine::sampler::{Filter, Sampler};
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};

use crate::execution::instructions::run::Shader;

#[test]
fn structures_are_found_by_their_address() {
    let scene = Scene::new([Instance::sphere([0.0; 3], 1.0)]).expect("a sphere");
    let shader = Shader {
        capabilities: "OpCapability RayQueryKHR",
        annotations: "
            OpDecorate %table_block Block
            OpMemberDecorate %table_block 0 Offset 0
            OpDecorate %table DescriptorSet 0
            OpDecorate %table Binding 1",
        declarations: "
            %query_type = OpTypeRayQueryKHR
            %structure_type = OpTypeAccelerationStructureKHR
            %ptr_query = OpTypePointer Function %query_type
            %table_block = OpTypeStruct %ulong
            %ptr_table = OpTypePointer StorageBuffer %table_block
            %ptr_ulong = OpTypePointer StorageBuffer %ulong
            %table = OpVariable %ptr_table StorageBuffer
            %f0 = OpConstant %float 0.0
            %f3 = OpConstant %float 3.0
            %f100 = OpConstant %float 100.0
            %minus = OpConstant %float -1.0
            %origin = OpConstantComposite %float3 %f0 %f0 %f3
            %down = OpConstantComposite %float3 %f0 %f0 %minus
            %none = OpConstantNull %ulong
            %all = OpConstant %uint 255
            %committed = OpConstant %uint 1
            %query_of = OpTypeFunction %uint %structure_type",
        body: "
            %slot = OpAccessChain %ptr_ulong %table %u0
            %address = OpLoad %ulong %slot
            %by_number = OpConvertUToAccelerationStructureKHR %structure_type %address
            %a = OpFunctionCall %uint %traced %by_number
            out 0 %a
            %halves = OpBitcast %uint2 %address
            %by_halves = OpConvertUToAccelerationStructureKHR %structure_type %halves
            %b = OpFunctionCall %uint %traced %by_halves
            out 1 %b
            %null = OpConvertUToAccelerationStructureKHR %structure_type %none
            %c = OpFunctionCall %uint %traced %null
            out 2 %c",
        functions: "
            %traced = OpFunction %uint None %query_of
            %structure = OpFunctionParameter %structure_type
            %traced_entry = OpLabel
            %query = OpVariable %ptr_query Function
            OpRayQueryInitializeKHR %query %structure %u1 %all %origin %f0 %down %f100
            %more = OpRayQueryProceedKHR %bool %query
            %kind = OpRayQueryGetIntersectionTypeKHR %uint %query %committed
            OpReturnValue %kind
            OpFunctionEnd",
        ..Shader::default()
    };
    let found = shader.run_with(&mut || {
        let mut resources = Resources::default();
        let address = resources.memory.add_structure(scene.tlas());
        resources.bind(0, 1, Descriptor::Buffer(Buffer::new(&address.to_le_bytes())))
    });
    for words in found.unwrap_or_else(|error| panic!("{}", error.render())) {
        // The opaque sphere is a hit (as a triangle's is, SPV_NV_linear_swept_spheres); null has
        // none.
        assert_eq!(words[..3], [1, 1, 0]);
    }
}

#[test]
fn whole_arrays_of_descriptors_are_loaded() {
    let shader = Shader {
        annotations: "
            OpDecorate %images DescriptorSet 0
            OpDecorate %images Binding 1
            OpDecorate %sampler DescriptorSet 0
            OpDecorate %sampler Binding 2",
        declarations: "
            %image = OpTypeImage %float 2D 0 0 0 1 Unknown
            %image_array = OpTypeArray %image %u2
            %image_arrays = OpTypeArray %image_array %u2
            %ptr_images = OpTypePointer UniformConstant %image_arrays
            %ptr_row = OpTypePointer UniformConstant %image_array
            %images = OpVariable %ptr_images UniformConstant
            %sampler_type = OpTypeSampler
            %ptr_sampler = OpTypePointer UniformConstant %sampler_type
            %sampler = OpVariable %ptr_sampler UniformConstant
            %sampled = OpTypeSampledImage %image
            %f0 = OpConstant %float 0.0
            %middle = OpConstantComposite %float2 %f0 %f0",
        body: "
            %all = OpLoad %image_arrays %images
            %third = OpCompositeExtract %image %all 1 0
            %s = OpLoad %sampler_type %sampler
            %third_sampled = OpSampledImage %sampled %third %s
            %third_texel = OpImageSampleExplicitLod %float4 %third_sampled %middle 2 %f0
            %third_value = OpCompositeExtract %float %third_texel 0
            %third_word = OpConvertFToU %uint %third_value
            out 0 %third_word
            %low = OpBitwiseAnd %uint %id %u1
            %row = OpAccessChain %ptr_row %images %low
            %pair = OpLoad %image_array %row
            %last = OpCompositeExtract %image %pair 1
            %last_sampled = OpSampledImage %sampled %last %s
            %last_texel = OpImageSampleExplicitLod %float4 %last_sampled %middle 2 %f0
            %last_value = OpCompositeExtract %float %last_texel 0
            %last_word = OpConvertFToU %uint %last_value
            out 1 %last_word",
        ..Shader::default()
    };
    let found = shader.run_with(&mut || {
        let mut resources = Resources::default();
        for element in 0..4u32 {
            let texel = (10.0 + element as f32).to_le_bytes();
            let image = Image::new(Format::new(Component::Float32, 1), ImageShape::plane(1, 1), &texel);
            let descriptor = Descriptor::Image(image.expect("an image"));
            resources.insert(Binding { set: 0, binding: 1 }, element, descriptor);
        }
        let nearest = Filter::Nearest;
        let sampler =
            Sampler { mag_filter: nearest, min_filter: nearest, mipmap_mode: nearest, ..Sampler::default() };
        resources.bind(0, 2, Descriptor::Sampler(Arc::new(sampler)))
    });
    for (id, words) in found.unwrap_or_else(|error| panic!("{}", error.render())).iter().enumerate() {
        assert_eq!(words[..2], [12, 11 + 2 * (id as u32 % 2)]);
    }
}

#[test]
fn variables_of_several_types_share_a_binding() {
    let shader = Shader {
        annotations: "
            OpDecorate %floats DescriptorSet 0
            OpDecorate %floats Binding 1
            OpDecorate %integers DescriptorSet 0
            OpDecorate %integers Binding 1",
        declarations: "
            %float_image = OpTypeImage %float 2D 0 0 0 1 Unknown
            %integer_image = OpTypeImage %uint 3D 0 0 0 1 Unknown
            %ptr_floats = OpTypePointer UniformConstant %float_image
            %ptr_integers = OpTypePointer UniformConstant %integer_image
            %floats = OpVariable %ptr_floats UniformConstant
            %integers = OpVariable %ptr_integers UniformConstant
            %at = OpConstantComposite %uint3 %u0 %u0 %u1
            %at_plane = OpConstantComposite %uint2 %u0 %u0",
        body: "
            %plane = OpLoad %float_image %floats
            %texel = OpImageFetch %float4 %plane %at_plane
            %value = OpCompositeExtract %float %texel 0
            %word = OpConvertFToU %uint %value
            out 0 %word
            %volume = OpLoad %integer_image %integers
            %numbers = OpImageFetch %uint4 %volume %at
            %number = OpCompositeExtract %uint %numbers 0
            out 1 %number",
        ..Shader::default()
    };
    let found = shader.run_with(&mut || {
        let plane =
            Image::new(Format::new(Component::Float32, 1), ImageShape::plane(1, 1), &5f32.to_le_bytes());
        let shape = ImageShape {
            dimension: anyhit_engine::machine::image::Dimension::D3,
            extent: [1, 1, 2],
            ..ImageShape::plane(1, 1)
        };
        let volume = Image::new(Format::new(Component::Uint8, 1), shape, &[6, 7]);
        let kinds = [plane, volume].map(|image| Descriptor::Image(image.expect("an image")));
        Resources::default().bind(0, 1, Descriptor::Mutable(Arc::new(kinds)))
    });
    for words in found.unwrap_or_else(|error| panic!("{}", error.render())) {
        assert_eq!(words[..2], [5, 7]);
    }
}

#[test]
fn a_hit_object_without_motion_is_at_the_beginning() {
    let found = Shader {
        capabilities: "
            OpCapability ShaderInvocationReorderNV
            OpCapability ShaderInvocationReorderEXT
            OpCapability RayTracingMotionBlurNV",
        declarations: "
            %nv_type = OpTypeHitObjectNV
            %ext_type = OpTypeHitObjectEXT
            %ptr_nv = OpTypePointer Private %nv_type
            %ptr_ext = OpTypePointer Private %ext_type
            %nv = OpVariable %ptr_nv Private
            %ext = OpVariable %ptr_ext Private
            %f0 = OpConstant %float 0.0
            %f1 = OpConstant %float 1.0
            %origin = OpConstantComposite %float3 %f0 %f0 %f0
            %direction = OpConstantComposite %float3 %f0 %f0 %f1",
        body: "
            OpHitObjectRecordMissNV %nv %u0 %origin %f0 %direction %f1
            %a = OpHitObjectGetCurrentTimeNV %float %nv
            %a_bits = OpBitcast %uint %a
            out 0 %a_bits
            OpHitObjectRecordMissEXT %ext %u0 %u0 %origin %f0 %direction %f1
            %b = OpHitObjectGetCurrentTimeEXT %float %ext
            %b_bits = OpBitcast %uint %b
            out 1 %b_bits",
        ..Shader::default()
    }
    .run();
    assert!(found.iter().all(|words| words[..2] == [0, 0]));
}

#[test]
fn whatever_descriptor_is_missing_the_bound_ones_are_told() {
    let declarations = "
        %read_image = OpTypeImage %float 2D 0 0 0 1 Unknown
        %store_image = OpTypeImage %uint 2D 0 0 0 2 R32ui
        %sampled_type = OpTypeSampledImage %read_image
        %ptr_sampled = OpTypePointer UniformConstant %sampled_type
        %ptr_image = OpTypePointer UniformConstant %store_image
        %ptr_texel = OpTypePointer Image %uint
        %sampled = OpVariable %ptr_sampled UniformConstant
        %image = OpVariable %ptr_image UniformConstant
        %cells = OpVariable %ptr_StorageBuffer_out_block StorageBuffer
        %zero = OpConstant %float 0.0
        %middle = OpConstantComposite %float2 %zero %zero
        %corner = OpConstantComposite %uint2 %u0 %u0
        %texel = OpConstantComposite %uint4 %u1 %u1 %u1 %u1";
    let annotations = "
        OpName %sampled \"sampled\"
        OpName %image \"image\"
        OpName %cells \"cells\"
        OpDecorate %sampled DescriptorSet 1
        OpDecorate %sampled Binding 0
        OpDecorate %image DescriptorSet 1
        OpDecorate %image Binding 1
        OpDecorate %cells DescriptorSet 1
        OpDecorate %cells Binding 2";
    let bodies = [
        "%s = OpLoad %sampled_type %sampled
         %c = OpImageSampleExplicitLod %float4 %s %middle 2 %zero
         %r = OpCompositeExtract %float %c 0
         %b = OpBitcast %uint %r
         out 0 %b",
        "%i = OpLoad %store_image %image\nOpImageWrite %i %corner %texel",
        "%p = OpImageTexelPointer %ptr_texel %image %corner %u0
         %v = OpAtomicIAdd %uint %p %u1 %u0 %u1",
        "%p = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u0\nOpStore %p %u1",
        "%p = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u0
         %v = OpAtomicIAdd %uint %p %u1 %u0 %u1",
    ];
    let image = || {
        Image::new(Format::new(Component::Float32, 1), ImageShape::plane(1, 1), &[0; 4]).expect("an image")
    };
    let buffer = || Descriptor::Buffer(Buffer::zeroed(4));
    let sampler = Arc::new(Sampler::default());
    let few = |resources: Resources| resources;
    let kinds = |resources: Resources| {
        let mut resources = resources
            .bind(0, 2, Descriptor::Image(image()))
            .bind(0, 3, Descriptor::Sampler(sampler.clone()))
            .bind(2, 0, Descriptor::ImageSampler(image(), sampler.clone()));
        // Of three elements the first two are unbound.
        resources.insert(Binding { set: 2, binding: 1 }, 2, buffer());
        resources
    };
    // One of them is `%out`: as many as are told, and three more.
    let many = |resources: Resources| (1..19).fold(resources, |all, at| all.bind(0, at, buffer()));
    let sixteen: Vec<String> = (0..16).map(|at| format!("set 0, binding {at} (a buffer)")).collect();
    type Bound<'a> = &'a dyn Fn(Resources) -> Resources;
    let cases: [(Bound<'_>, String); 3] = [
        (&few, "bound: set 0, binding 0 (a buffer)".to_owned()),
        (
            &kinds,
            "bound: set 0, binding 0 (a buffer); set 0, binding 2 (an image); set 0, binding 3 (a sampler); \
             set 2, binding 0 (an image with a sampler); set 2, binding 1 (a buffer, 3 elements)"
                .to_owned(),
        ),
        (&many, format!("bound: {}; and 3 more", sixteen.join("; "))),
    ];
    for body in bodies {
        for (bound, expected) in &cases {
            let shader = Shader { annotations, declarations, body, ..Shader::default() };
            let error = shader.run_with(&mut || bound(Resources::default())).expect_err(body);
            let told = error.notes().iter().find(|note| note.starts_with("bound:"));
            assert_eq!(told, Some(expected), "{body}: {}", error.render());
        }
    }
}
