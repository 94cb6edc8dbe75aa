//! Memory that invocations share otherwise than by atomic instructions that commute: it is found
//! before running, and the launch keeps one schedule.

use std::sync::Arc;

use anyhit_engine::machine::format::{Component, Format};
use anyhit_engine::machine::image::{Image, ImageShape};
use anyhit_engine::machine::sampler::Sampler;
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit_engine::program::race_analysis::{LaunchExtent, Memory};

use crate::execution::instructions::run::Shader;

const OUT: Memory = Memory::Binding(Binding { set: 0, binding: 0 });

/// A further output, `%cells`, at binding 1; a storage image at binding 2; a push constant.
const ANNOTATIONS: &str = "
    OpDecorate %cells DescriptorSet 0
    OpDecorate %cells Binding 1
    OpDecorate %picture DescriptorSet 0
    OpDecorate %picture Binding 2
    OpDecorate %wide_words ArrayStride 8
    OpDecorate %wide_block Block
    OpMemberDecorate %wide_block 0 Offset 0
    OpDecorate %wide_cells DescriptorSet 0
    OpDecorate %wide_cells Binding 3
    OpDecorate %counts DescriptorSet 0
    OpDecorate %counts Binding 4
    OpDecorate %texture DescriptorSet 0
    OpDecorate %texture Binding 5
    OpDecorate %launch_size BuiltIn LaunchSizeKHR
    OpDecorate %push_block Block
    OpMemberDecorate %push_block 0 Offset 0";
const DECLARATIONS: &str = "
    %u64 = OpConstant %uint 64
    %cells = OpVariable %ptr_StorageBuffer_out_block StorageBuffer
    %launch_size = OpVariable %ptr_Input_uint3 Input
    %push_block = OpTypeStruct %uint
    %ptr_push_block = OpTypePointer PushConstant %push_block
    %ptr_push_uint = OpTypePointer PushConstant %uint
    %push = OpVariable %ptr_push_block PushConstant
    %image = OpTypeImage %float 2D 0 0 0 2 R32f
    %ptr_image = OpTypePointer UniformConstant %image
    %picture = OpVariable %ptr_image UniformConstant
    %int2 = OpTypeVector %int 2
    %one = OpConstant %int 1
    %zero = OpConstant %int 0
    %right = OpConstantComposite %int2 %one %zero
    %wide_words = OpTypeRuntimeArray %ulong
    %wide_block = OpTypeStruct %wide_words
    %ptr_wide_block = OpTypePointer StorageBuffer %wide_block
    %ptr_StorageBuffer_ulong = OpTypePointer StorageBuffer %ulong
    %wide_cells = OpVariable %ptr_wide_block StorageBuffer
    %count_image = OpTypeImage %uint 2D 0 0 0 2 R32ui
    %ptr_count_image = OpTypePointer UniformConstant %count_image
    %counts = OpVariable %ptr_count_image UniformConstant
    %ptr_texel = OpTypePointer Image %uint
    %read_image = OpTypeImage %float 2D 0 0 0 1 Unknown
    %sampled = OpTypeSampledImage %read_image
    %ptr_sampled = OpTypePointer UniformConstant %sampled
    %texture = OpVariable %ptr_sampled UniformConstant
    %zero_float = OpConstant %float 0.0
    %middle = OpConstantComposite %float2 %zero_float %zero_float
    %four = OpConstantComposite %float4 %zero_float %zero_float %zero_float %zero_float";

/// What a launch of some size shares, the body finding `%x`, `%y`, `%width` and `%pushed`.
fn shared(body: &str, size: [u32; 3]) -> Option<Memory> {
    shared_with(body, size, &Resources::default())
}

fn shared_with(body: &str, size: [u32; 3], resources: &Resources) -> Option<Memory> {
    let body = format!(
        "%x = OpCompositeExtract %uint %launch_id_value 0
         %y = OpCompositeExtract %uint %launch_id_value 1
         %xy_unsigned = OpVectorShuffle %uint2 %launch_id_value %launch_id_value 0 1
         %xy = OpBitcast %int2 %xy_unsigned
         %size = OpLoad %uint3 %launch_size
         %width = OpCompositeExtract %uint %size 0
         %push_pointer = OpAccessChain %ptr_push_uint %push %u0
         %pushed = OpLoad %uint %push_pointer
         {body}"
    );
    let shader =
        Shader { annotations: ANNOTATIONS, declarations: DECLARATIONS, body: &body, ..Shader::default() };
    LaunchExtent { count: size, local: [1; 3], resources }.shared(&[&shader.program()])
}

fn cell(index: &str) -> String {
    format!(
        "{index}
         %pointer = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %index
         OpStore %pointer %u7"
    )
}

const CELLS: Option<Memory> = Some(Memory::Binding(Binding { set: 0, binding: 1 }));

#[test]
fn places_by_the_launch_index_are_apart() {
    // 16 words each, from word 16 x on.
    let body = "out 0 %id\nout 15 %id";
    assert_eq!(shared(body, [40, 1, 1]), None);
    assert_eq!(shared(body, [40, 2, 1]), Some(OUT), "rows of the launch fall on each other");
    let grid = cell("%row = OpIMul %uint %y %width\n%index = OpIAdd %uint %row %x");
    assert_eq!(shared(&grid, [40, 20, 1]), None);
    assert_eq!(shared(&grid, [40, 20, 2]), CELLS);
    let transposed = cell("%row = OpIMul %uint %x %width\n%index = OpIAdd %uint %row %y");
    assert_eq!(shared(&transposed, [40, 40, 1]), None);
    assert_eq!(shared(&transposed, [40, 41, 1]), CELLS, "a column is longer than the step between them");
    // (size - 1) - (y * width + x), and the same from below 0, where numbers begin anew.
    let backwards = cell(
        "%row = OpIMul %uint %y %width
         %at = OpIAdd %uint %row %x
         %last = OpISub %uint %width %u1
         %index = OpISub %uint %last %at",
    );
    assert_eq!(shared(&backwards, [40, 20, 1]), None);
    assert_eq!(shared(&backwards, [40, 20, 2]), CELLS);
    let negated = cell(
        "%row = OpIMul %uint %y %width
         %up = OpSNegate %uint %row
         %index = OpIAdd %uint %up %x",
    );
    assert_eq!(shared(&negated, [40, 20, 1]), None);
    let diagonal = cell("%index = OpISub %uint %x %y");
    assert_eq!(shared(&diagonal, [40, 20, 1]), CELLS, "x - y takes one value for every x");
    let same = cell("%index = OpISub %uint %x %x");
    assert_eq!(shared(&same, [40, 1, 1]), CELLS, "0 for every x");
    let fixed = cell("%row = OpShiftLeftLogical %uint %y %u6\n%index = OpIAdd %uint %row %x");
    assert_eq!(shared(&fixed, [64, 20, 1]), None);
    assert_eq!(shared(&fixed, [65, 20, 1]), CELLS);
}

/// An f32 has 24 bits: integers up to 2^24 are themselves as f32, and up to 2^23 with 0.5 added.
#[test]
fn indices_that_pass_through_floats_stay_apart() {
    const LIMIT: u32 = 1 << 24;
    let through = |way: &str| cell(&format!("%float_x = OpConvertUToF %float %x\n{way}"));
    let plain = [
        "%index = OpConvertFToU %uint %float_x",
        "%signed = OpConvertFToS %int %float_x\n%index = OpBitcast %uint %signed",
        "%down = OpExtInst %float %glsl Floor %float_x\n%index = OpConvertFToU %uint %down",
    ];
    for way in plain {
        let body = through(way);
        assert_eq!(shared(&body, [40, 1, 1]), None, "{way}");
        assert_eq!(shared(&body, [LIMIT, 1, 1]), None, "{way}: the greatest index is 2^24 - 1");
        assert_eq!(shared(&body, [LIMIT + 1, 1, 1]), CELLS, "{way}: beyond the limit");
        assert_eq!(shared(&body, [40, 2, 1]), CELLS, "{way}: rows fall on each other");
    }
    let half = "%one_half = OpConstant %float 0.5";
    let declarations = format!("{DECLARATIONS}\n{half}");
    let with_half = |way: &str, size: [u32; 3]| {
        let body = format!("%x = OpCompositeExtract %uint %launch_id_value 0\n{}", through(way));
        let shader = Shader {
            annotations: ANNOTATIONS,
            declarations: &declarations,
            body: &body,
            ..Shader::default()
        };
        let resources = Resources::default();
        LaunchExtent { count: size, local: [1; 3], resources: &resources }.shared(&[&shader.program()])
    };
    let centre = "%centre = OpFAdd %float %float_x %one_half";
    let once = format!("{centre}\n%index = OpConvertFToU %uint %centre");
    assert_eq!(with_half(&once, [LIMIT / 2, 1, 1]), None);
    assert_eq!(with_half(&once, [LIMIT / 2 + 1, 1, 1]), CELLS, "2^23 + 1.5 is no f32");
    // Not followed: 1 is added, and a float that is scaled.
    let twice =
        format!("{centre}\n%next = OpFAdd %float %one_half %centre\n%index = OpConvertFToU %uint %next");
    assert_eq!(with_half(&twice, [40, 1, 1]), CELLS);
    let scaled =
        format!("{centre}\n%less = OpFMul %float %centre %one_half\n%index = OpConvertFToU %uint %less");
    assert_eq!(with_half(&scaled, [40, 1, 1]), CELLS, "two neighbours have one place");
    // A sum is converted as a whole, and its limit is that of the sum.
    let sum = cell(
        "%row = OpIMul %uint %y %width
         %at = OpIAdd %uint %row %x
         %float_at = OpConvertUToF %float %at
         %index = OpConvertFToU %uint %float_at",
    );
    assert_eq!(shared(&sum, [4096, 4096, 1]), None);
    assert_eq!(shared(&sum, [4096, 4097, 1]), CELLS);
    // Numbers below 0 are no launch indices.
    let before = cell(
        "%before = OpISub %uint %x %u1
         %float_x = OpConvertUToF %float %before
         %index = OpConvertFToU %uint %float_x",
    );
    assert_eq!(shared(&before, [40, 1, 1]), CELLS);
}

#[test]
fn what_cannot_be_told_counts_as_shared() {
    let pushed = cell("%row = OpIMul %uint %y %pushed\n%index = OpIAdd %uint %row %x");
    assert_eq!(shared(&pushed, [40, 20, 1]), CELLS);
    assert_eq!(shared(&pushed, [40, 1, 1]), None, "a single row needs no width");
    let given = |width: u32| Resources {
        push_constants: Some(Buffer::new(&width.to_le_bytes())),
        ..Resources::default()
    };
    assert_eq!(shared_with(&pushed, [40, 20, 1], &given(40)), None, "the width is known when it runs");
    assert_eq!(shared_with(&pushed, [40, 20, 1], &given(39)), CELLS);
    let from = cell("%index = OpIAdd %uint %x %pushed");
    assert_eq!(shared_with(&from, [40, 1, 1], &given(7)), None);
    let constant = cell("%index = OpIAdd %uint %u3 %pushed");
    assert_eq!(shared(&constant, [40, 1, 1]), CELLS);
    assert_eq!(shared(&constant, [1, 1, 1]), None, "nobody is there to share with");
    let rest = cell("%index = OpUMod %uint %x %u16");
    assert_eq!(shared(&rest, [40, 1, 1]), CELLS);
}

#[test]
fn loads_count_where_somebody_stores() {
    let load = "
        %index = OpIAdd %uint %x %u1
        %pointer = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %index
        %loaded = OpLoad %uint %pointer
        out 0 %loaded";
    assert_eq!(shared(load, [40, 1, 1]), None, "only loads");
    let neighbour = format!(
        "{load}
         %own = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %x
         OpStore %own %u7"
    );
    assert_eq!(shared(&neighbour, [40, 1, 1]), CELLS);
    let counted = format!("{load}\n%old = OpAtomicIAdd %uint %pointer %u1 %u0 %u1");
    assert_eq!(shared(&counted, [40, 1, 1]), None, "each its own");
    let counter = "
        %pointer = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u0
        %old = OpAtomicIAdd %uint %pointer %u1 %u0 %u1";
    assert_eq!(shared(counter, [40, 1, 1]), None, "atomic instructions alone");
    let read = format!("{counter}\n%loaded = OpLoad %uint %pointer\nout 0 %loaded");
    assert_eq!(shared(&read, [40, 1, 1]), CELLS);
}

#[test]
fn a_buffer_bound_twice_is_one_memory() {
    // Invocation 15 loads word 16, which is where invocation 1 stores.
    let body = "
        %index = OpIAdd %uint %x %u1
        %pointer = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %index
        %loaded = OpLoad %uint %pointer
        out 0 %loaded";
    let (one, other) = (Buffer::zeroed(4096), Buffer::zeroed(4096));
    let bound = |cells: &Arc<Buffer>| {
        let resources = Resources::default().bind(0, 0, Descriptor::Buffer(one.clone()));
        resources.bind(0, 1, Descriptor::Buffer(cells.clone()))
    };
    assert_eq!(shared_with(body, [40, 1, 1], &bound(&other)), None);
    assert_eq!(shared_with(body, [40, 1, 1], &bound(&one)), Some(OUT));
}

#[test]
fn ranges_of_one_buffer_are_one_memory_where_they_overlap() {
    // Each invocation loads cell x and stores cell x of a second binding, three words beside it.
    let pair = |index: &str, other: &str| {
        format!(
            "{index}
             %from = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %index
             %loaded = OpLoad %uint %from
             {other}
             %to = OpAccessChain %ptr_StorageBuffer_uint %more %u0 %other
             OpStore %to %loaded"
        )
    };
    let share = |body: &str, [first, second]: [(u64, u64); 2]| {
        let arena = Buffer::zeroed(4096);
        let view = |(offset, range)| Descriptor::Buffer(arena.view(offset, range, "arena").expect("a range"));
        let resources = Resources::default().bind(0, 1, view(first)).bind(0, 6, view(second));
        let annotations =
            format!("{ANNOTATIONS}\nOpDecorate %more DescriptorSet 0\nOpDecorate %more Binding 6");
        let declarations =
            format!("{DECLARATIONS}\n%more = OpVariable %ptr_StorageBuffer_out_block StorageBuffer");
        let body = format!("%x = OpCompositeExtract %uint %launch_id_value 0\n{body}");
        let shader = Shader {
            annotations: &annotations,
            declarations: &declarations,
            body: &body,
            ..Shader::default()
        };
        let extent = LaunchExtent { count: [40, 1, 1], local: [1; 3], resources: &resources };
        extent.shared(&[&shader.program()])
    };
    let same = pair("%index = OpIAdd %uint %x %u0", "%other = OpIAdd %uint %x %u0");
    assert_eq!(share(&same, [(0, 400), (0, 400)]), None, "each its own word");
    assert_eq!(share(&same, [(0, 400), (12, 400)]), CELLS, "invocation 0 stores what 3 loads");
    assert_eq!(share(&same, [(0, 400), (400, 400)]), None, "ranges beside each other");
    assert_eq!(share(&same, [(0, 404), (400, 400)]), CELLS, "and one word more");
    // Three words on in a range that begins three words earlier is the same word again.
    let back = pair("%index = OpIAdd %uint %x %u0", "%other = OpIAdd %uint %x %u3");
    assert_eq!(share(&back, [(0, 400), (0, 400)]), CELLS);
    assert_eq!(share(&back, [(12, 400), (0, 400)]), None, "each its own word");
    // Atomic instructions of two kinds, on words 5 and 6, and on word 6 of both.
    let atomics = "
        %i = OpIAdd %uint %u3 %u3
        %a = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %i
        %b = OpAccessChain %ptr_StorageBuffer_uint %more %u0 %i
        %old_a = OpAtomicIAdd %uint %a %u1 %u0 %x
        %old_b = OpAtomicXor %uint %b %u1 %u0 %x";
    assert_eq!(share(atomics, [(0, 400), (4, 400)]), None);
    assert_eq!(share(atomics, [(4, 400), (4, 200)]), CELLS);
    assert_eq!(share(&atomics.replace("Xor", "IAdd"), [(4, 400), (4, 200)]), None, "additions commute");
}

/// Two atomic instructions on cells whose indices are computed before.
fn mixed(indices: &str, first: &str, second: &str) -> String {
    format!(
        "{indices}
         %a = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %i
         %b = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %j
         %old_a = {first} %uint %a %u1 %u0 %x
         %old_b = {second} %uint %b %u1 %u0 %x"
    )
}

#[test]
fn atomic_instructions_of_two_kinds_do_not_commute() {
    let one_cell = "%i = OpIMul %uint %u2 %u3\n%j = OpIMul %uint %u3 %u2";
    let size = [40, 1, 1];
    for (a, b, together) in [
        ("OpAtomicIAdd", "OpAtomicXor", CELLS),
        ("OpAtomicIAdd", "OpAtomicISub", None),
        ("OpAtomicIAdd", "OpAtomicUMax", CELLS),
        ("OpAtomicUMin", "OpAtomicUMax", CELLS),
        ("OpAtomicSMin", "OpAtomicUMin", CELLS),
        ("OpAtomicUMax", "OpAtomicUMax", None),
        ("OpAtomicAnd", "OpAtomicOr", CELLS),
        ("OpAtomicOr", "OpAtomicOr", None),
    ] {
        assert_eq!(shared(&mixed(one_cell, a, b), size), together, "{a} {b}");
        assert_eq!(shared(&mixed(one_cell, b, a), size), together, "{b} {a}");
        let two_cells = "%i = OpIAdd %uint %u2 %u3\n%j = OpIAdd %uint %u3 %u3";
        assert_eq!(shared(&mixed(two_cells, a, b), size), None, "{a} {b} on words 5 and 6");
    }
    let (add, xor) = ("OpAtomicIAdd", "OpAtomicXor");
    // Each invocation's own two words, and the neighbour's.
    let own = "%i = OpIMul %uint %x %u2\n%j = OpIAdd %uint %i %u1";
    assert_eq!(shared(&mixed(own, add, xor), size), None);
    let neighbour = "%i = OpIAdd %uint %x %u0\n%j = OpIAdd %uint %x %u1";
    assert_eq!(shared(&mixed(neighbour, add, xor), size), CELLS);
    // Even words and odd ones, whatever the push constant is.
    let halves = "%i = OpIMul %uint %pushed %u2\n%j = OpIAdd %uint %i %u1";
    assert_eq!(shared(&mixed(halves, add, xor), size), None);
    let loaded = "%i = OpIMul %uint %pushed %u3\n%j = OpIAdd %uint %i %u1";
    assert_eq!(shared(&mixed(loaded, add, xor), size), CELLS, "three words lie on four");
    // 64 bits beside 32 in them.
    let wide = "
        %low = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u0
        %wide = OpAccessChain %ptr_StorageBuffer_ulong %wide_cells %u0 %u0
        %x_wide = OpUConvert %ulong %x
        %old_low = OpAtomicIAdd %uint %low %u1 %u0 %x
        %old_wide = OpAtomicIAdd %ulong %wide %u1 %u0 %x_wide";
    let one = Buffer::zeroed(64);
    let bound = |other: &Arc<Buffer>| {
        let resources = Resources::default().bind(0, 1, Descriptor::Buffer(one.clone()));
        resources.bind(0, 3, Descriptor::Buffer(other.clone()))
    };
    assert_eq!(shared_with(wide, size, &bound(&one)), CELLS);
    assert_eq!(shared_with(wide, size, &bound(&Buffer::zeroed(64))), None);
    // Texels.
    let texels = |coordinate: &str| {
        format!(
            "%a = OpImageTexelPointer %ptr_texel %counts %xy %u0
             %b = OpImageTexelPointer %ptr_texel %counts {coordinate} %u0
             %old_a = OpAtomicIAdd %uint %a %u1 %u0 %x
             %old_b = OpAtomicXor %uint %b %u1 %u0 %x"
        )
    };
    assert_eq!(shared(&texels("%xy"), [40, 20, 1]), None);
    let counts = Some(Memory::Binding(Binding { set: 0, binding: 4 }));
    assert_eq!(shared(&texels("%right"), [40, 20, 1]), counts);
    assert_eq!(shared(&texels("%xy"), [40, 20, 2]), counts);
}

#[test]
fn the_shaders_of_a_pipeline_share_together() {
    let program = |opcode: &str| {
        let body = format!(
            "%pointer = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u0
             %old = {opcode} %uint %pointer %u1 %u0 %id"
        );
        Shader { annotations: ANNOTATIONS, declarations: DECLARATIONS, body: &body, ..Shader::default() }
            .program()
    };
    let resources = Resources::default();
    let extent = LaunchExtent { count: [40, 1, 1], local: [1; 3], resources: &resources };
    let (add, sub, or) = (program("OpAtomicIAdd"), program("OpAtomicISub"), program("OpAtomicOr"));
    assert_eq!(extent.shared(&[&add, &sub]), None);
    assert_eq!(extent.shared(&[&or]), None);
    assert_eq!(extent.shared(&[&add, &or]), CELLS);
}

#[test]
fn a_buffer_that_has_an_address_is_reached_by_it() {
    let body = "
        %pointer = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u0
        %old = OpAtomicIAdd %uint %pointer %u1 %u0 %id
        %address = OpConvertUToPtr %ptr_physical %region
        %other = OpAtomicXor %uint %address %u1 %u0 %id";
    let shader = Shader {
        capabilities: "OpCapability PhysicalStorageBufferAddresses",
        annotations: ANNOTATIONS,
        declarations: &format!(
            "{DECLARATIONS}
             %region = OpConstant %ulong 0x100000000L
             %ptr_physical = OpTypePointer PhysicalStorageBuffer %uint"
        ),
        body,
        ..Shader::default()
    };
    let program = shader.program();
    let (cells, other) = (Buffer::zeroed(64), Buffer::zeroed(64));
    for (addressed, expected) in [(&cells, Some(Memory::Addresses)), (&other, None)] {
        let mut resources = Resources::default().bind(0, 1, Descriptor::Buffer(cells.clone()));
        resources.memory.add_buffer(addressed);
        let extent = LaunchExtent { count: [40, 1, 1], local: [1; 3], resources: &resources };
        assert_eq!(extent.shared(&[&program]), expected);
    }
}

#[test]
fn an_element_chosen_while_running_is_one_of_its_binding() {
    // `%table` is bound first; the element of `%many` that is stored to is another binding's.
    let body = "
        %first = OpAccessChain %ptr_StorageBuffer_uint %table %u0 %id
        %value = OpLoad %uint %first
        %which = OpBitwiseAnd %uint %value %u1
        %pointer = OpAccessChain %ptr_StorageBuffer_uint %many %which %u0 %u0
        OpStore %pointer %id";
    let shader = Shader {
        annotations: "
            OpDecorate %table DescriptorSet 0
            OpDecorate %table Binding 1
            OpDecorate %many DescriptorSet 0
            OpDecorate %many Binding 2",
        declarations: "
            %blocks = OpTypeArray %out_block %u2
            %ptr_blocks = OpTypePointer StorageBuffer %blocks
            %table = OpVariable %ptr_StorageBuffer_out_block StorageBuffer
            %many = OpVariable %ptr_blocks StorageBuffer",
        body,
        ..Shader::default()
    };
    let resources = Resources::default();
    let extent = LaunchExtent { count: [40, 1, 1], local: [1; 3], resources: &resources };
    let many = Memory::Binding(Binding { set: 0, binding: 2 });
    assert_eq!(extent.shared(&[&shader.program()]), Some(many));
}

#[test]
fn what_a_sampler_reads_counts() {
    let body = "
        %image_value = OpLoad %image %picture
        OpImageWrite %image_value %xy %four
        %sampled_value = OpLoad %sampled %texture
        %texel = OpImageSampleExplicitLod %float4 %sampled_value %middle 2 %zero_float
        %red = OpCompositeExtract %float %texel 0
        %word = OpBitcast %uint %red
        %row = OpIMul %uint %y %width
        %index = OpIAdd %uint %row %x
        %own = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %index
        OpStore %own %word";
    let image = || {
        Image::new(Format::new(Component::Float32, 1), ImageShape::plane(1, 1), &[0; 4]).expect("an image")
    };
    let sampler = Arc::new(Sampler::default());
    let (one, other) = (image(), image());
    let picture = Some(Memory::Binding(Binding { set: 0, binding: 2 }));
    for (texture, expected) in [(&other, None), (&one, picture)] {
        let resources = Resources::default().bind(0, 2, Descriptor::Image(one.clone())).bind(
            0,
            5,
            Descriptor::ImageSampler(texture.clone(), sampler.clone()),
        );
        assert_eq!(shared_with(body, [40, 20, 1], &resources), expected);
    }
}

#[test]
fn texels_are_told_by_their_coordinates() {
    let accumulate = |coordinate: &str| {
        format!(
            "%next = OpIAdd %int2 %xy %right
             %image_value = OpLoad %image %picture
             %texel = OpImageRead %float4 %image_value {coordinate}
             OpImageWrite %image_value %xy %texel"
        )
    };
    assert_eq!(shared(&accumulate("%xy"), [40, 20, 1]), None);
    let picture = Some(Memory::Binding(Binding { set: 0, binding: 2 }));
    assert_eq!(shared(&accumulate("%xy"), [40, 20, 3]), picture);
    assert_eq!(shared(&accumulate("%next"), [40, 20, 1]), picture);
}

#[test]
fn one_schedule_at_every_width() {
    // Each stores its number in one cell and loads it again: `run_with` compares the widths.
    let shader = Shader {
        annotations: "
            OpDecorate %cells DescriptorSet 0
            OpDecorate %cells Binding 1",
        declarations: "%cells = OpVariable %ptr_StorageBuffer_out_block StorageBuffer",
        body: "
            %pointer = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u0
            OpStore %pointer %id
            %loaded = OpLoad %uint %pointer
            out 0 %loaded",
        ..Shader::default()
    };
    let found =
        shader.run_with(&mut || Resources::default().bind(0, 1, Descriptor::Buffer(Buffer::zeroed(4))));
    let found = found.unwrap_or_else(|error| panic!("{}", error.render()));
    // 64 together, in launch order: the last of them is read by all.
    for (id, words) in found.iter().enumerate() {
        assert_eq!(words[0], if id < 64 { 63 } else { 71 });
    }
}

#[test]
fn whatever_reads_an_image_finds_what_those_beside_it_wrote() {
    // Each writes its number and one to its own texel, then reads texel 63: that has been written
    // where 64 go together.
    let reads = [
        "%texel = OpImageSampleExplicitLod %float4 %sampled_value %near 2 %zero_float
         %read = OpCompositeExtract %float %texel 0",
        // The texels beside the coordinate, 63 and 64; the last of them has the lower x and y.
        "%texel = OpImageGather %float4 %sampled_value %between %u0
         %read = OpCompositeExtract %float %texel 3",
        "%fetched = OpImage %read_image %sampled_value
         %texel = OpImageFetch %float4 %fetched %last
         %read = OpCompositeExtract %float %texel 0",
        "%texel = OpImageRead %float4 %image_value %last
         %read = OpCompositeExtract %float %texel 0",
    ];
    for read in reads {
        let body = format!(
            "%x = OpBitcast %int %id
             %xy = OpCompositeConstruct %int2 %x %zero
             %number = OpIAdd %uint %id %u1
             %value = OpConvertUToF %float %number
             %color = OpCompositeConstruct %float4 %value %value %value %value
             %image_value = OpLoad %image %picture
             %sampled_value = OpLoad %sampled %texture
             OpImageWrite %image_value %xy %color
             {read}
             %word = OpConvertFToU %uint %read
             out 0 %word"
        );
        let found = Shader {
            annotations: ANNOTATIONS,
            declarations: &format!(
                "{DECLARATIONS}
                 %half_y = OpConstant %float 0.5
                 %near_x = OpConstant %float 0.49609375
                 %near = OpConstantComposite %float2 %near_x %half_y
                 %between_x = OpConstant %float 0.4990234375
                 %between = OpConstantComposite %float2 %between_x %half_y
                 %sixty_three = OpConstant %int 63
                 %last = OpConstantComposite %int2 %sixty_three %zero"
            ),
            body: &body,
            ..Shader::default()
        }
        .run_with(&mut || {
            let image = Image::new(Format::new(Component::Float32, 1), ImageShape::plane(128, 1), &[0; 512]);
            let image = image.expect("an image");
            let sampler = Arc::new(Sampler::default());
            let resources = Resources::default().bind(0, 2, Descriptor::Image(image.clone()));
            resources.bind(0, 5, Descriptor::ImageSampler(image, sampler))
        });
        let found = found.unwrap_or_else(|error| panic!("{read}: {}", error.render()));
        assert!(found.iter().all(|words| words[0] == 64), "{read}");
    }
}
