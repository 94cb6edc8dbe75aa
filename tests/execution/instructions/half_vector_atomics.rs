//! Atomic instructions on vectors of f16 (`SPV_NV_shader_atomic_fp16_vector`).

use std::sync::Arc;

use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::format::{Component, Format};
use anyhit_engine::machine::image::{Image, ImageShape};
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use half::f16;

use crate::execution::instructions::run::{INVOCATIONS, Shader};

const ANNOTATIONS: &str = "
    OpDecorate %block Block
    OpMemberDecorate %block 0 Offset 0
    OpMemberDecorate %block 1 Offset 8
    OpMemberDecorate %block 2 Offset 16
    OpDecorate %buffer DescriptorSet 0
    OpDecorate %buffer Binding 1
    OpDecorate %image DescriptorSet 0
    OpDecorate %image Binding 2";
const DECLARATIONS: &str = "
    %half2 = OpTypeVector %half 2
    %half3 = OpTypeVector %half 3
    %half4 = OpTypeVector %half 4
    %block = OpTypeStruct %half2 %half4 %half3
    %ptr_block = OpTypePointer StorageBuffer %block
    %ptr_half2 = OpTypePointer StorageBuffer %half2
    %ptr_half3 = OpTypePointer StorageBuffer %half3
    %ptr_half4 = OpTypePointer StorageBuffer %half4
    %buffer = OpVariable %ptr_block StorageBuffer
    %image_type = OpTypeImage %float 2D 0 0 0 2 Rgba16f
    %ptr_image = OpTypePointer UniformConstant %image_type
    %ptr_texel = OpTypePointer Image %half4
    %image = OpVariable %ptr_image UniformConstant
    %h1 = OpConstant %half 1h
    %h2 = OpConstant %half 2h
    %h3 = OpConstant %half 3h
    %pair = OpConstantComposite %half2 %h1 %h2
    %triple = OpConstantComposite %half3 %h1 %h2 %h3
    %origin = OpConstantComposite %uint2 %u0 %u0";

fn shader(body: &str) -> Shader<'_> {
    Shader {
        capabilities: "OpCapability AtomicFloat16VectorNV\nOpExtension \"SPV_NV_shader_atomic_fp16_vector\"",
        annotations: ANNOTATIONS,
        declarations: DECLARATIONS,
        body,
        ..Shader::default()
    }
}

fn halves(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|&number| f16::from_f32(number).to_le_bytes()).collect()
}

/// What the invocations wrote and what they left in buffer and image, the same at every width.
fn run(body: &str) -> (Vec<[u32; 16]>, Vec<u8>, Vec<u8>) {
    let mut made: Vec<(Arc<Buffer>, Arc<Image>)> = Vec::new();
    let found = shader(body).run_with(&mut || {
        // 2,047 and 5; then -1, 2, -3 and a NaN.
        let buffer =
            Buffer::new(&halves(&[2047.0, 5.0, 0.0, 0.0, -1.0, 2.0, -3.0, f32::NAN, 0.0, 0.0, 0.0, 0.0]));
        let texel = halves(&[1.0, 2.0, 3.0, 4.0]);
        let image = Image::new(Format::new(Component::Float16, 4), ImageShape::plane(1, 1), &texel)
            .expect("an image");
        made.push((buffer.clone(), image.clone()));
        let resources = Resources::default().bind(0, 1, Descriptor::Buffer(buffer));
        resources.bind(0, 2, Descriptor::Image(image))
    });
    let found = found.unwrap_or_else(|error| panic!("{}", error.render()));
    let left: Vec<_> = made.iter().map(|(buffer, image)| (buffer.bytes(), image.bytes())).collect();
    assert!(left.iter().all(|bytes| *bytes == left[0]), "the widths leave different memory");
    let (buffer, image) = left[0].clone();
    (found, buffer, image)
}

#[test]
fn sums_are_taken_in_launch_order() {
    let (found, buffer, _) = run("%p = OpAccessChain %ptr_half2 %buffer %u0
         %old = OpAtomicFAddEXT %half2 %p %u1 %u0 %pair
         %bits = OpBitcast %uint %old
         out 0 %bits");
    // 2,047 + 1 = 2,048; from there on + 1 is a tie that stays on the even 2,048. 5 + 2 n is exact.
    let bits = |number: f32| u32::from(f16::from_f32(number).to_bits());
    for (id, words) in found.iter().enumerate() {
        let first = if id == 0 { 2047.0 } else { 2048.0 };
        assert_eq!(words[0], bits(first) | bits(5.0 + 2.0 * id as f32) << 16);
    }
    assert_eq!(buffer[..4], halves(&[2048.0, 5.0 + 2.0 * INVOCATIONS as f32]));
}

#[test]
fn minima_maxima_and_exchanges_go_by_component() {
    let (found, buffer, _) = run("%p = OpAccessChain %ptr_half4 %buffer %u1
         %f = OpConvertUToF %half %id
         %minus = OpFNegate %half %f
         %v = OpCompositeConstruct %half4 %f %minus %f %f
         %a = OpAtomicFMinEXT %half4 %p %u1 %u0 %v
         %b = OpAtomicFMaxEXT %half4 %p %u1 %u0 %v
         %q = OpAccessChain %ptr_half2 %buffer %u0
         %w = OpCompositeConstruct %half2 %f %minus
         %c = OpAtomicExchange %half2 %q %u1 %u0 %w
         %bits = OpBitcast %uint %c
         out 0 %bits");
    // Of the invocations 0 to 71: the minimum, then the maximum with the same value.
    // Component 0: min(-1, f), then max with f: f. 1: f's negative. 2: as the first. 3: a number
    // stands before a NaN, so 0, and then f.
    let last = (INVOCATIONS - 1) as f32;
    assert_eq!(buffer[8..16], halves(&[last, -last, last, last]));
    assert_eq!(buffer[..4], halves(&[last, -last]));
    for (id, words) in found.iter().enumerate() {
        let before = |at: f32| [f16::from_f32(at), f16::from_f32(-at)];
        let [low, high] = match id {
            0 => [f16::from_f32(2047.0), f16::from_f32(5.0)],
            _ => before((id - 1) as f32),
        };
        assert_eq!(words[0], u32::from(low.to_bits()) | u32::from(high.to_bits()) << 16);
    }
}

#[test]
fn texels_of_as_many_halves_are_changed() {
    let (_, _, image) = run("%p = OpImageTexelPointer %ptr_texel %image %origin %u0
         %v = OpCompositeConstruct %half4 %h1 %h2 %h3 %h1
         %a = OpAtomicFAddEXT %half4 %p %u1 %u0 %v");
    let count = INVOCATIONS as f32;
    assert_eq!(image, halves(&[1.0 + count, 2.0 + 2.0 * count, 3.0 + 3.0 * count, 4.0 + count]));
}

#[test]
fn other_vectors_and_other_instructions_are_invalid() {
    for (body, capabilities) in [
        (
            "%p = OpAccessChain %ptr_half3 %buffer %u2
             %a = OpAtomicFAddEXT %half3 %p %u1 %u0 %triple",
            "OpCapability AtomicFloat16VectorNV",
        ),
        (
            "%p = OpAccessChain %ptr_half2 %buffer %u0
             %a = OpAtomicLoad %half2 %p %u1 %u0",
            "OpCapability AtomicFloat16VectorNV",
        ),
        (
            "%p = OpAccessChain %ptr_half2 %buffer %u0
             %a = OpAtomicFAddEXT %half2 %p %u1 %u0 %pair",
            "OpCapability AtomicFloat16AddEXT",
        ),
    ] {
        let error = Shader { capabilities, ..shader(body) }.refused();
        assert_eq!(error.kind(), ErrorKind::InvalidModule, "{}", error.render());
        let section = "SPV_NV_shader_atomic_fp16_vector, Validation Rules";
        assert!(error.message().contains(section), "{}", error.render());
    }
}
