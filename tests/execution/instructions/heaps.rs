//! Descriptor heaps (`SPV_EXT_descriptor_heap`): descriptors by index and by byte, and data between
//! them.

use std::sync::Arc;

use anyhit_base::error::{ErrorKind, TrapCode, TrapOperands};
use anyhit_engine::machine::format::{Component, Format};
use anyhit_engine::machine::image::{Dimension, Image, ImageShape};
use anyhit_engine::machine::sampler::{Filter, Sampler};
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};

use crate::execution::instructions::run::Shader;

const CAPABILITIES: &str = "
    OpCapability UntypedPointersKHR
    OpCapability DescriptorHeapEXT
    OpExtension \"SPV_KHR_untyped_pointers\"
    OpExtension \"SPV_EXT_descriptor_heap\"";
const ANNOTATIONS: &str = "
    OpName %resource_heap \"resource_heap\"
    OpDecorate %resource_heap BuiltIn ResourceHeapEXT
    OpDecorate %sampler_heap BuiltIn SamplerHeapEXT
    OpDecorateId %buffers ArrayStrideIdEXT %size
    OpDecorateId %uniforms ArrayStrideIdEXT %size
    OpDecorateId %images ArrayStrideIdEXT %image_size
    OpDecorateId %textures ArrayStrideIdEXT %image_size
    OpDecorateId %samplers ArrayStrideIdEXT %sampler_size
    OpDecorate %sparse ArrayStride 64
    OpDecorate %bytes ArrayStride 1
    OpDecorate %words Block
    OpDecorate %all_words ArrayStride 4
    OpMemberDecorate %words 0 Offset 0
    OpDecorate %fourth SpecId 7
    OpDecorate %table Block
    OpMemberDecorateIdEXT %table 0 OffsetIdEXT %u0
    OpMemberDecorateIdEXT %table 1 OffsetIdEXT %fourth
    OpMemberDecorateIdEXT %table 2 OffsetIdEXT %sixth
    OpMemberDecorate %uneven 0 Offset 8";
const DECLARATIONS: &str = "
    %heap_pointer = OpTypeUntypedPointerKHR UniformConstant
    %resource_heap = OpUntypedVariableKHR %heap_pointer UniformConstant
    %sampler_heap = OpUntypedVariableKHR %heap_pointer UniformConstant
    %untyped = OpTypeUntypedPointerKHR StorageBuffer
    %untyped_uniform = OpTypeUntypedPointerKHR Uniform
    %buffer = OpTypeBufferEXT StorageBuffer
    %buffers = OpTypeRuntimeArray %buffer
    %sparse = OpTypeRuntimeArray %buffer
    %uniform = OpTypeBufferEXT Uniform
    %uniforms = OpTypeRuntimeArray %uniform
    %size = OpConstantSizeOfEXT %uint %buffer
    %image = OpTypeImage %uint 2D 0 0 0 2 R32ui
    %images = OpTypeRuntimeArray %image
    %texture = OpTypeImage %float 2D 0 0 0 1 Unknown
    %textures = OpTypeRuntimeArray %texture
    %image_size = OpConstantSizeOfEXT %uint %image
    %sampler = OpTypeSampler
    %samplers = OpTypeRuntimeArray %sampler
    %sampler_size = OpConstantSizeOfEXT %uint %sampler
    %sampled_image = OpTypeSampledImage %texture
    %all_words = OpTypeRuntimeArray %uint
    %words = OpTypeStruct %all_words
    %ptr_words = OpTypePointer StorageBuffer %words
    %bytes = OpTypeRuntimeArray %uchar
    %fourth = OpSpecConstant %uint 128
    %two_sizes = OpSpecConstantOp %uint IMul %size %u2
    %sixth = OpSpecConstantOp %uint IAdd %fourth %two_sizes
    %table = OpTypeStruct %uint2 %buffer %images
    %uneven = OpTypeStruct %buffer
    %texel_pointer = OpTypeUntypedPointerKHR Image
    %f0 = OpConstant %float 0
    %half_one = OpConstant %float 0.5
    %corner = OpConstantComposite %float2 %half_one %half_one
    %at_10 = OpConstantComposite %uint2 %u1 %u0";

fn words(words: &[u32]) -> Descriptor {
    Descriptor::Buffer(Buffer::new(&words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>()))
}

fn image(component: Component, texels: [u32; 2]) -> Descriptor {
    let shape = ImageShape { dimension: Dimension::D2, extent: [2, 1, 1], layers: 1, levels: 1, samples: 1 };
    let bytes: Vec<u8> = texels.iter().flat_map(|texel| texel.to_le_bytes()).collect();
    Descriptor::Image(Image::new(Format::new(component, 1), shape, &bytes).expect("an image"))
}

/// Buffers at 3, 4 and 6, a storage image at 7, textures at 8, a linear sampler at 2, and data.
fn resources() -> Resources {
    let mut all = Resources::default();
    let heap = Binding::RESOURCE_HEAP;
    all.insert(heap, 3, words(&[30, 31, 32, 33]));
    all.insert(heap, 4, words(&[40, 41, 42, 43]));
    all.insert(heap, 6, words(&[60, 61, 62, 63]));
    all.insert(heap, 7, image(Component::Uint32, [70, 71]));
    all.insert(heap, 8, image(Component::Float32, [1.0_f32.to_bits(), 2.0_f32.to_bits()]));
    let linear = Sampler { mag_filter: Filter::Linear, min_filter: Filter::Linear, ..Sampler::default() };
    all.insert(Binding::SAMPLER_HEAP, 2, Descriptor::Sampler(Arc::new(linear)));
    all.insert(heap.heap_data(), 0, words(&[100, 101, 102, 103]));
    all
}

fn shader(body: &str) -> Shader<'_> {
    Shader {
        capabilities: CAPABILITIES,
        annotations: ANNOTATIONS,
        declarations: DECLARATIONS,
        body,
        invocations: Some(2),
        ..Shader::default()
    }
}

/// The words of the second invocation.
fn run(body: &str) -> [u32; 16] {
    shader(body).run_with(&mut resources).unwrap_or_else(|error| panic!("{}", error.render()))[1]
}

fn error(body: &str) -> anyhit_base::error::Error {
    shader(body).run_with(&mut resources).expect_err("the shader runs, though it should not")
}

#[test]
fn the_size_of_a_descriptor_is_a_constant() {
    assert_eq!(run("out 0 %size\nout 1 %image_size\nout 2 %sampler_size")[..3], [32; 3]);
}

#[test]
fn buffers_are_found_by_constant_and_computed_indices() {
    let words = run("
        %third = OpUntypedAccessChainKHR %heap_pointer %buffers %resource_heap %u3
        %third_bytes = OpBufferPointerEXT %untyped %third
        %third_word = OpUntypedAccessChainKHR %untyped %words %third_bytes %u0 %u2
        %w32 = OpLoad %uint %third_word
        out 0 %w32
        %index = OpIAdd %uint %id %u3
        %computed = OpUntypedAccessChainKHR %heap_pointer %buffers %resource_heap %index
        %typed = OpBufferPointerEXT %ptr_words %computed
        %typed_word = OpAccessChain %ptr_StorageBuffer_uint %typed %u0 %u3
        %w43 = OpLoad %uint %typed_word
        out 1 %w43
        OpStore %typed_word %u9
        %w9 = OpLoad %uint %typed_word
        out 2 %w9
        %every_other = OpUntypedAccessChainKHR %heap_pointer %sparse %resource_heap %u2
        %sparse_bytes = OpBufferPointerEXT %untyped %every_other
        %w40 = OpLoad %uint %sparse_bytes
        out 3 %w40
        %length = OpUntypedArrayLengthKHR %uint %words %sparse_bytes 0
        out 4 %length
        %sixth_uniform = OpUntypedAccessChainKHR %heap_pointer %uniforms %resource_heap %u6
        %uniform_bytes = OpBufferPointerEXT %untyped_uniform %sixth_uniform
        %uniform_word = OpUntypedAccessChainKHR %untyped_uniform %words %uniform_bytes %u0 %id
        %w61 = OpLoad %uint %uniform_word
        out 5 %w61
        %old = OpAtomicIAdd %uint %sparse_bytes %u1 %u0 %u0
        %has_40 = OpUGreaterThanEqual %bool %old %u0
        %one = OpSelect %uint %has_40 %u1 %u0
        out 6 %one");
    assert_eq!(words[..7], [32, 43, 9, 40, 4, 61, 1]);
}

/// The heap of samplers is another one: index 2 of the resources is empty.
#[test]
fn images_and_samplers_are_loaded_from_their_heaps() {
    let words = run("
        %at_8 = OpUntypedAccessChainKHR %heap_pointer %textures %resource_heap %u8
        %the_texture = OpLoad %texture %at_8
        %twice = OpIMul %uint %id %u2
        %at_2 = OpUntypedAccessChainKHR %heap_pointer %samplers %sampler_heap %twice
        %the_sampler = OpLoad %sampler %at_2
        %is_second = OpIEqual %bool %id %u1
        OpSelectionMerge %done None
        OpBranchConditional %is_second %sample %done
        %sample = OpLabel
        %combined = OpSampledImage %sampled_image %the_texture %the_sampler
        %texel = OpImageSampleExplicitLod %float4 %combined %corner 2 %f0
        %red = OpCompositeExtract %float %texel 0
        %bits = OpBitcast %uint %red
        out 0 %bits
        OpBranch %done
        %done = OpLabel");
    // Between the texels 1 and 2.
    assert_eq!(words[0], 1.5_f32.to_bits());
}

#[test]
fn texels_of_images_in_a_heap_are_atomic() {
    let words = run("
        %at_7 = OpUntypedAccessChainKHR %heap_pointer %images %resource_heap %u7
        %texel = OpUntypedImageTexelPointerEXT %texel_pointer %image %at_7 %at_10 %u0
        %old = OpAtomicUMax %uint %texel %u1 %u0 %u9
        out 0 %old
        %the_image = OpLoad %image %at_7
        %read = OpImageRead %uint4 %the_image %at_10
        %now = OpCompositeExtract %uint %read 0
        out 1 %now");
    assert_eq!(words[..2], [71, 71]);
}

/// A byte offset leads to a struct whose members have constant and specialised offsets: `%fourth`
/// is 128 bytes, `%sixth` 192, so that the buffer is descriptor 4 and the first image descriptor 6
/// from where the struct begins.
#[test]
fn structs_lie_in_heaps_between_descriptors() {
    let words = run("
        %start = OpIMul %uint %id %u32
        %base = OpUntypedAccessChainKHR %heap_pointer %bytes %resource_heap %u0
        %member = OpUntypedAccessChainKHR %heap_pointer %table %base %u1
        %member_bytes = OpBufferPointerEXT %untyped %member
        %w40 = OpLoad %uint %member_bytes
        out 0 %w40
        %shifted = OpUntypedAccessChainKHR %heap_pointer %bytes %resource_heap %start
        %image_at = OpUntypedAccessChainKHR %heap_pointer %table %shifted %u2 %u0
        %is_second = OpIEqual %bool %id %u1
        OpSelectionMerge %done None
        OpBranchConditional %is_second %read_it %done
        %read_it = OpLabel
        %the_image = OpLoad %image %image_at
        %read = OpImageRead %uint4 %the_image %at_10
        %w71 = OpCompositeExtract %uint %read 0
        out 1 %w71
        OpBranch %done
        %done = OpLabel
        %data = OpUntypedAccessChainKHR %heap_pointer %table %base %u0 %id
        %w101 = OpLoad %uint %data
        out 2 %w101
        %both = OpUntypedAccessChainKHR %heap_pointer %table %base %u0
        %pair = OpLoad %uint2 %both
        %w100 = OpCompositeExtract %uint %pair 0
        out 3 %w100");
    assert_eq!(words[..4], [40, 71, 101, 100]);
}

#[test]
fn descriptors_that_are_not_there_trap() {
    let unbound = error(
        "
        %at = OpUntypedAccessChainKHR %heap_pointer %buffers %resource_heap %u5
        %its_bytes = OpBufferPointerEXT %untyped %at
        %word = OpLoad %uint %its_bytes
        out 0 %word",
    );
    let text = unbound.render();
    assert_eq!(unbound.trap().map(|trap| trap.code), Some(TrapCode::DescriptorMissing), "{text}");
    assert!(text.contains("`resource_heap` (the resource heap, element 5)"), "{text}");
    assert!(
        text.contains("the resource heap (`resource_heap`, a buffer and an image, 9 elements)"),
        "{text}"
    );
    let another = error(
        "
        %at = OpUntypedAccessChainKHR %heap_pointer %buffers %resource_heap %u7
        %its_bytes = OpBufferPointerEXT %untyped %at
        %word = OpLoad %uint %its_bytes
        out 0 %word",
    );
    assert_eq!(another.trap().map(|trap| trap.code), Some(TrapCode::DescriptorMissing));
}

#[test]
fn offsets_without_descriptors_trap() {
    let misaligned = error(
        "
        %offset = OpIMul %uint %id %u24
        %base = OpUntypedAccessChainKHR %heap_pointer %bytes %resource_heap %offset
        %at = OpUntypedAccessChainKHR %heap_pointer %buffers %base %u4
        %its_bytes = OpBufferPointerEXT %untyped %at
        %word = OpLoad %uint %its_bytes
        out 0 %word",
    );
    let trap = misaligned.trap().expect("a trap");
    assert_eq!(trap.code, TrapCode::DescriptorMisaligned);
    let heap = "the resource heap".to_owned();
    assert_eq!(trap.operands, TrapOperands::HeapOffset { heap, offset: 152 });
    let text = misaligned.render();
    assert!(text.contains("byte 152 of the resource heap"), "{text}");
    // 2^20 descriptors of 32 bytes.
    let outside = error(
        "
        %far = OpShiftLeftLogical %uint %u1 %u20
        %index = OpIMul %uint %id %far
        %plus = OpIAdd %uint %index %u3
        %at = OpUntypedAccessChainKHR %heap_pointer %buffers %resource_heap %plus
        %its_bytes = OpBufferPointerEXT %untyped %at
        %word = OpLoad %uint %its_bytes
        out 0 %word",
    );
    let trap = outside.trap().expect("a trap");
    assert_eq!(trap.code, TrapCode::IndexOutOfBounds);
    let heap = "the resource heap".to_owned();
    assert_eq!(trap.operands, TrapOperands::HeapOffset { heap, offset: (1 << 25) + 96 });
}

#[test]
fn what_the_extension_forbids_is_refused() {
    let refusals = [
        (
            "%at = OpUntypedAccessChainKHR %heap_pointer %uniforms %resource_heap %u6
             %its_bytes = OpBufferPointerEXT %untyped %at",
            "a pointer in StorageBuffer is made to a buffer in Uniform",
        ),
        (
            "%at = OpUntypedAccessChainKHR %heap_pointer %images %resource_heap %u7
             %its_bytes = OpBufferPointerEXT %untyped %at",
            "points to image instead of a buffer",
        ),
        (
            "%at = OpUntypedAccessChainKHR %heap_pointer %buffers %resource_heap %u3
             %whole = OpLoad %buffer %at",
            "a load reads the descriptor of a buffer",
        ),
        (
            "%at = OpUntypedAccessChainKHR %heap_pointer %uneven %resource_heap %u0
             %its_bytes = OpBufferPointerEXT %untyped %at",
            "a descriptor lies at byte 8 of its heap",
        ),
        ("%its_bytes = OpBufferPointerEXT %untyped %out", "points to struct %25 instead of a buffer"),
        (
            "%at = OpUntypedAccessChainKHR %heap_pointer %bytes %resource_heap %u0
             OpStore %at %u1",
            "UniformConstant, which is read-only",
        ),
    ];
    for (body, message) in refusals {
        let error = error(body);
        assert_eq!(error.kind(), ErrorKind::InvalidModule, "{}", error.render());
        assert!(error.render().contains(message), "{message}: {}", error.render());
    }
}
