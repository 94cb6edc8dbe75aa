//! Atomic instructions (SPIR-V 3.3.20) on buffers, device addresses and variables.

use std::sync::Arc;

use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{BatchWidth, Launch, Pipeline, RunOptions};
use anyhit_engine::program::{Inlining, LowerOptions};

use crate::execution::instructions::run::{INVOCATIONS, Shader};
use crate::execution::instructions::workgroup::{Workgroup, compute};

const COUNTER_LAYOUT: &str = "
    OpDecorate %counter_block Block
    OpMemberDecorate %counter_block 0 Offset 0
    OpMemberDecorate %counter_block 1 Offset 4
    OpMemberDecorate %counter_block 2 Offset 8
    OpDecorate %counters DescriptorSet 0
    OpDecorate %counters Binding 1";
const COUNTERS: &str = "
    %counter_block = OpTypeStruct %uint %float %ulong
    %ptr_StorageBuffer_counters = OpTypePointer StorageBuffer %counter_block
    %ptr_StorageBuffer_float = OpTypePointer StorageBuffer %float
    %ptr_StorageBuffer_ulong = OpTypePointer StorageBuffer %ulong
    %counters = OpVariable %ptr_StorageBuffer_counters StorageBuffer
    %quarter = OpConstant %float 0.25
    %large = OpConstant %ulong 0x100000000L";

/// Runs a body that finds `%count` (uint), `%sum` (float) and `%wide` (ulong) and gives what is
/// left in these 16 bytes, and what the invocations wrote.
fn run(start: [u32; 4], body: &str) -> ([u32; 4], Vec<[u32; 16]>) {
    let body = format!(
        "%count = OpAccessChain %ptr_StorageBuffer_uint %counters %u0
         %sum = OpAccessChain %ptr_StorageBuffer_float %counters %u1
         %wide = OpAccessChain %ptr_StorageBuffer_ulong %counters %u2
         {body}"
    );
    let shader = Shader {
        capabilities: "OpCapability Int64Atomics\nOpCapability AtomicFloat32AddEXT",
        annotations: COUNTER_LAYOUT,
        declarations: COUNTERS,
        body: &body,
        ..Shader::default()
    };
    let mut buffers: Vec<Arc<Buffer>> = Vec::new();
    let found = shader.run_with(&mut || {
        let bytes: Vec<u8> = start.iter().flat_map(|word| word.to_le_bytes()).collect();
        let buffer = Buffer::new(&bytes);
        buffers.push(buffer.clone());
        Resources::default().bind(0, 1, Descriptor::Buffer(buffer))
    });
    let found = found.unwrap_or_else(|error| panic!("{}", error.render()));
    let left: Vec<Vec<u32>> =
        buffers.iter().map(|buffer| bytemuck::pod_collect_to_vec(&buffer.bytes())).collect();
    assert!(left.iter().all(|words| *words == left[0]), "the widths leave different counters");
    (left[0][..].try_into().unwrap(), found)
}

#[test]
fn tickets_are_drawn_in_launch_order() {
    let (left, found) = run(
        [5, 0, 0, 0],
        "%ticket = OpAtomicIAdd %uint %count %u1 %u0 %u2
         out 0 %ticket",
    );
    assert_eq!(left[0], 5 + 2 * INVOCATIONS as u32);
    for (id, words) in found.iter().enumerate() {
        assert_eq!(words[0], 5 + 2 * id as u32);
    }
}

#[test]
fn every_kind_returns_what_was_there_and_leaves_the_new_value() {
    // Only invocation 3 takes part, so that each step follows from the last.
    let (left, found) = run(
        [10, 1f32.to_bits(), 7, 0],
        "%mine = OpIEqual %bool %id %u3
         OpSelectionMerge %end None
         OpBranchConditional %mine %yes %end
         %yes = OpLabel
         %a = OpAtomicIIncrement %uint %count %u1 %u0     ; 10 -> 11
         out 0 %a
         %b = OpAtomicIDecrement %uint %count %u1 %u0     ; 11 -> 10
         out 1 %b
         %c = OpAtomicISub %uint %count %u1 %u0 %u3       ; 10 -> 7
         out 2 %c
         %d = OpAtomicXor %uint %count %u1 %u0 %u2        ; 7 -> 5
         out 3 %d
         %e = OpAtomicOr %uint %count %u1 %u0 %u8         ; 5 -> 13
         out 4 %e
         %f = OpAtomicAnd %uint %count %u1 %u0 %u12       ; 13 -> 12
         out 5 %f
         %g = OpAtomicUMin %uint %count %u1 %u0 %u9       ; 12 -> 9
         out 6 %g
         %h = OpAtomicUMax %uint %count %u1 %u0 %u11      ; 9 -> 11
         out 7 %h
         %i = OpAtomicExchange %uint %count %u1 %u0 %u20  ; 11 -> 20
         out 8 %i
         %j = OpAtomicCompareExchange %uint %count %u1 %u0 %u0 %u1 %u19  ; 20 stays
         out 9 %j
         %k = OpAtomicCompareExchange %uint %count %u1 %u0 %u0 %u1 %u20  ; 20 -> 1
         out 10 %k
         OpAtomicStore %count %u1 %u0 %u30
         %l = OpAtomicLoad %uint %count %u1 %u0
         out 11 %l
         %m = OpAtomicFAddEXT %float %sum %u1 %u0 %quarter
         %m_bits = OpBitcast %uint %m
         out 12 %m_bits
         %n = OpAtomicIAdd %ulong %wide %u1 %u0 %large
         %n_low = OpUConvert %uint %n
         out 13 %n_low
         %o = OpAtomicSMax %ulong %wide %u1 %u0 %large
         %o_halves = OpBitcast %uint2 %o
         %o_high = OpCompositeExtract %uint %o_halves 1
         out 14 %o_high
         OpBranch %end
         %end = OpLabel",
    );
    assert_eq!(left, [30, 1.25f32.to_bits(), 7, 1]);
    let expected = [10, 11, 10, 7, 5, 13, 12, 9, 11, 20, 20, 30, 1f32.to_bits(), 7, 1, 0];
    for (id, words) in found.iter().enumerate() {
        assert_eq!(*words, if id == 3 { expected } else { [0; 16] }, "invocation {id}");
    }
}

#[test]
fn sums_without_a_reader_commute() {
    let count = INVOCATIONS as u32;
    let (left, _) = run(
        [0, 0, 0xFFFF_FFFF, 0],
        "%one = OpUConvert %ulong %u1
         %a = OpAtomicIAdd %uint %count %u1 %u0 %id
         %b = OpAtomicIAdd %ulong %wide %u1 %u0 %one",
    );
    // 0xFFFF_FFFF + 40 carries into the upper word.
    assert_eq!(left, [count * (count - 1) / 2, 0, count - 1, 1]);
}

/// Instructions on `%count`, `%wide` and `%id`, of which an order between invocations can be seen;
/// and some of which it cannot.
const MIXED: &[&str] = &[
    "%a = OpAtomicIAdd %uint %count %u1 %u0 %id
     %b = OpAtomicXor %uint %count %u1 %u0 %triple",
    "%a = OpAtomicUMax %uint %count %u1 %u0 %triple
     %b = OpAtomicISub %uint %count %u1 %u0 %id",
    "%a = OpAtomicOr %uint %count %u1 %u0 %id
     %b = OpAtomicAnd %uint %count %u1 %u0 %triple",
    "%a = OpAtomicXor %uint %count %u1 %u0 %triple
     OpStore %count %id",
    "%a = OpAtomicIAdd %uint %count %u1 %u0 %id
     %b = OpLoad %uint %count
     %c = OpAtomicXor %uint %other %u1 %u0 %b",
    // Only the upper half of what is returned is read.
    "%x = OpUConvert %ulong %id
     %shift = OpShiftLeftLogical %ulong %x %u31
     %a = OpAtomicIAdd %ulong %wide %u1 %u0 %shift
     %halves = OpBitcast %uint2 %a
     %high = OpCompositeExtract %uint %halves 1
     %b = OpIMul %uint %high %triple
     %c = OpAtomicXor %uint %other %u1 %u0 %b",
    "%a = OpAtomicIAdd %uint %count %u1 %u0 %id
     %b = OpAtomicISub %uint %count %u1 %u0 %triple",
];

#[test]
fn threads_change_nothing() {
    // Enough for many tasks of a launch.
    const SIZE: [u32; 3] = [512, 32, 1];
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let (one, many) = (pool(1), pool(4));
    for body in MIXED {
        let body = format!(
            "%count = OpAccessChain %ptr_StorageBuffer_uint %counters %u0
             %other = OpAccessChain %ptr_StorageBuffer_uint %counters %u3
             %wide = OpAccessChain %ptr_StorageBuffer_ulong %counters %u2
             %y = OpCompositeExtract %uint %launch_id_value 1
             %row = OpIMul %uint %y %u31
             %place = OpIAdd %uint %id %row
             %triple = OpIMul %uint %place %u3
             {body}"
        );
        let shader = Shader {
            capabilities: "OpCapability Int64Atomics",
            annotations: &format!("{COUNTER_LAYOUT}\nOpMemberDecorate %counter_block 3 Offset 16"),
            declarations: &COUNTERS.replace("%uint %float %ulong", "%uint %float %ulong %uint"),
            body: &body,
            ..Shader::default()
        };
        let pipeline = Pipeline::builder()
            .ray_generation(shader.program())
            .expect("a shader")
            .build()
            .expect("a pipeline");
        let left = |threads: &rayon::ThreadPool, lanes: BatchWidth| {
            let counters = Buffer::zeroed(24);
            let resources = Resources::default().bind(0, 1, Descriptor::Buffer(counters.clone()));
            let resources = resources.bind(0, 0, Descriptor::Buffer(Buffer::zeroed(4)));
            let launch = Launch { pipeline: &pipeline, resources: &resources };
            let ran = threads.install(|| launch.run(SIZE, RunOptions::of(lanes)));
            ran.unwrap_or_else(|error| panic!("{}", error.render()));
            counters.bytes()
        };
        let expected = left(&one, BatchWidth::Of64);
        for (lanes, runs) in BatchWidth::ALL.into_iter().zip([2, 6, 2]) {
            for _ in 0..runs {
                assert_eq!(left(&many, lanes), expected, "{lanes} lanes: {body}");
            }
        }
    }
}

#[test]
fn workgroup_memory_does_not_depend_on_the_width() {
    let compute = Workgroup {
        size: 192,
        interface: "%count",
        declarations: "
            %ptr_shared = OpTypePointer Workgroup %uint
            %count = OpVariable %ptr_shared Workgroup",
        body: "
            %triple = OpIMul %uint %i %3
            %a = OpAtomicIAdd %uint %count %2 %0 %i
            %b = OpAtomicXor %uint %count %2 %0 %triple
            OpControlBarrier %2 %2 %264
            %sum = OpLoad %uint %count
            %pointer = OpAccessChain %ptr_uint %out %0 %g
            OpStore %pointer %sum",
        ..Workgroup::default()
    }
    .compute();
    let dispatch = |lanes: BatchWidth| {
        let out = Buffer::zeroed(4 * 192 * 40);
        let resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
        let groups = [40, 1, 1];
        compute
            .run(&resources, groups, RunOptions::of(lanes))
            .unwrap_or_else(|error| panic!("{}", error.render()));
        out.bytes()
    };
    let expected = dispatch(BatchWidth::Of64);
    for lanes in BatchWidth::ALL {
        assert_eq!(dispatch(lanes), expected, "{lanes} lanes");
    }
}

#[test]
fn variables_of_the_lane_count_for_themselves() {
    let found = Shader {
        declarations: "
            %array = OpTypeArray %uint %u2
            %ptr_Private_array = OpTypePointer Private %array
            %variable = OpVariable %ptr_Private_array Private",
        body: "
            %index = OpUMod %uint %id %u2
            %pointer = OpAccessChain %ptr_Private_uint %variable %index
            OpStore %pointer %id
            %old = OpAtomicIAdd %uint %pointer %u1 %u0 %u5
            out 0 %old
            %first = OpAccessChain %ptr_Private_uint %variable %u0
            %a = OpAtomicIAdd %uint %first %u1 %u0 %u1
            %b = OpLoad %uint %first
            out 1 %b",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        let id = id as u32;
        assert_eq!(words[..2], [id, if id.is_multiple_of(2) { id + 6 } else { 1 }]);
    }
}

/// Vulkan, "Offset and Stride Assignment": a member is aligned as its type is.
#[test]
fn an_atomic_on_a_misaligned_member_is_invalid() {
    let error = Shader {
        annotations: "
            OpMemberDecorate %block 0 Offset 2
            OpDecorate %block Block
            OpDecorate %buffer DescriptorSet 0
            OpDecorate %buffer Binding 0",
        declarations: "
            %block = OpTypeStruct %uint
            %ptr_block = OpTypePointer StorageBuffer %block
            %buffer = OpVariable %ptr_block StorageBuffer",
        body: "
            %pointer = OpAccessChain %ptr_StorageBuffer_uint %buffer %u0
            %old = OpAtomicIAdd %uint %pointer %u1 %u0 %u1",
        ..Shader::default()
    }
    .refused();
    assert_eq!(error.kind(), ErrorKind::InvalidModule);
    assert!(error.message().ends_with("at offset 2 is not aligned to 4 bytes"), "{}", error.render());
}

#[test]
fn the_least_and_the_greatest_of_signed_integers_and_floats() {
    let shader = Shader {
        capabilities: "OpCapability AtomicFloat32MinMaxEXT",
        annotations: COUNTER_LAYOUT,
        declarations: &format!("{COUNTERS}\n%five = OpConstant %float 5"),
        body: "
            %count = OpAccessChain %ptr_StorageBuffer_uint %counters %u0
            %sum = OpAccessChain %ptr_StorageBuffer_float %counters %u1
            %minus = OpSNegate %uint %id
            %a = OpAtomicSMin %uint %count %u1 %u0 %minus
            %f = OpConvertUToF %float %id
            %low = OpFSub %float %five %f
            %b = OpAtomicFMinEXT %float %sum %u1 %u0 %low
            %c = OpAtomicFMaxEXT %float %sum %u1 %u0 %quarter",
        ..Shader::default()
    };
    let mut buffers = Vec::new();
    let found = shader.run_with(&mut || {
        let buffer = Buffer::new(&[0; 16]);
        buffers.push(buffer.clone());
        Resources::default().bind(0, 1, Descriptor::Buffer(buffer))
    });
    found.unwrap_or_else(|error| panic!("{}", error.render()));
    for buffer in buffers {
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&buffer.bytes());
        // The last invocation brings the least: -39, and 5 - 39, below the 0.25 that follows it.
        assert_eq!(words[..2], [(INVOCATIONS as u32 - 1).wrapping_neg(), 0.25f32.to_bits()]);
    }
}

#[test]
fn memory_behind_an_address_is_counted_in() {
    let shader = Shader {
        capabilities: "OpCapability PhysicalStorageBufferAddresses\nOpCapability Int64Atomics",
        annotations: COUNTER_LAYOUT,
        declarations: &format!(
            "{COUNTERS}
             %ptr_uint = OpTypePointer PhysicalStorageBuffer %uint
             %ptr_ulong = OpTypePointer PhysicalStorageBuffer %ulong
             %sixteen = OpConstant %ulong 16L
             %eight = OpConstant %ulong 8L"
        ),
        body: "
            %slot = OpAccessChain %ptr_StorageBuffer_ulong %counters %u2
            %address = OpLoad %ulong %slot
            %first = OpConvertUToPtr %ptr_uint %address
            %old = OpAtomicIAdd %uint %first %u1 %u0 %u3
            out 0 %old
            %second_address = OpIAdd %ulong %address %eight
            %second = OpConvertUToPtr %ptr_ulong %second_address
            %old_wide = OpAtomicUMax %ulong %second %u1 %u0 %large
            %old_low = OpUConvert %uint %old_wide
            out 1 %old_low",
        ..Shader::default()
    };
    let mut counted = Vec::new();
    let found = shader.run_with(&mut || {
        let data = Buffer::new(&[1, 0, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0]);
        let mut resources = Resources::default();
        let address = resources.memory.add_buffer(&data);
        let mut bytes = vec![0; 8];
        bytes.extend(address.to_le_bytes());
        counted.push(data);
        resources.bind(0, 1, Descriptor::Buffer(Buffer::new(&bytes)))
    });
    let found = found.unwrap_or_else(|error| panic!("{}", error.render()));
    for (id, words) in found.iter().enumerate() {
        assert_eq!(words[..2], [1 + 3 * id as u32, if id == 0 { 9 } else { 0 }]);
    }
    for buffer in counted {
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&buffer.bytes());
        assert_eq!(words, [1 + 3 * INVOCATIONS as u32, 0, 0, 1]);
    }
}

/// Workgroup memory without a layout is an array of words: a 64-bit integer there lies on any of
/// them, also where a function that is really called reaches it through a pointer.
#[test]
fn wide_integers_in_workgroup_memory_lie_on_any_word() {
    let module = Workgroup {
        size: 96,
        is_wide: true,
        capabilities: "OpCapability Int64Atomics",
        interface: "%cells",
        declarations: "
            %96 = OpConstant %uint 96
            %start = OpConstant %ulong 4294967295 0
            %cell = OpTypeStruct %uint %ulong
            %array = OpTypeArray %cell %96
            %ptr_array = OpTypePointer Workgroup %array
            %ptr_cell = OpTypePointer Workgroup %cell
            %ptr_wide = OpTypePointer Workgroup %ulong
            %cells = OpVariable %ptr_array Workgroup
            %helper_type = OpTypeFunction %void %ptr_cell",
        body: "
            %own = OpAccessChain %ptr_cell %cells %i
            %own_wide = OpAccessChain %ptr_wide %cells %i %1
            OpStore %own_wide %start
            %call = OpFunctionCall %void %helper %own
            %again = OpFunctionCall %void %helper %own
            %sum = OpLoad %ulong %own_wide
            %pointer = OpAccessChain %ptr_ulong %out %0 %i
            OpStore %pointer %sum",
        functions: "
            %helper = OpFunction %void DontInline %helper_type
            %parameter = OpFunctionParameter %ptr_cell
            %helper_entry = OpLabel
            %wide = OpAccessChain %ptr_wide %parameter %1
            %old = OpAtomicIIncrement %ulong %wide %2 %0
            OpReturn
            OpFunctionEnd",
        ..Workgroup::default()
    }
    .module();
    for inlining in [Inlining::Never, Inlining::WhereProfitable] {
        let compute = compute(&module, LowerOptions { inlining, ..LowerOptions::default() });
        for lanes in BatchWidth::ALL {
            let out = Buffer::zeroed(8 * 96);
            let resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
            compute
                .run(&resources, [1, 1, 1], RunOptions::of(lanes))
                .unwrap_or_else(|error| panic!("{inlining:?}, {lanes} lanes: {}", error.render()));
            let sums: Vec<u64> = bytemuck::pod_collect_to_vec(&out.bytes());
            assert_eq!(sums, [0x1_0000_0001; 96], "{inlining:?}, {lanes} lanes");
        }
    }
}

/// Pointers to the 64-bit integer of `%own`, a struct in workgroup memory that begins with a word:
/// where the pointer leads is known in the first alone.
const WIDE_POINTERS: &[(&str, &str)] = &[
    ("an access chain", "%p = OpAccessChain %ptr_wide %cells %i %1"),
    ("two access chains", "%p = OpInBoundsAccessChain %ptr_wide %own %1"),
    ("a copy", "%q = OpAccessChain %ptr_wide %own %1\n%p = OpCopyObject %ptr_wide %q"),
    (
        "a selection",
        "%q = OpAccessChain %ptr_wide %own %1
         %r = OpAccessChain %ptr_wide %cells %0 %1
         %p = OpSelect %ptr_wide %is_inside %q %r",
    ),
    (
        "a phi",
        "%r = OpAccessChain %ptr_wide %cells %0 %1
         OpSelectionMerge %merge None
         OpBranchConditional %is_inside %inside %merge
         %inside = OpLabel
         %q = OpAccessChain %ptr_wide %own %1
         OpBranch %merge
         %merge = OpLabel
         %p = OpPhi %ptr_wide %r %entry %q %inside",
    ),
    ("a function's result", "%p = OpFunctionCall %ptr_wide %wide_of %own"),
    (
        "a variable of pointers",
        "%q = OpAccessChain %ptr_wide %own %1\nOpStore %held %q\n%p = OpLoad %ptr_wide %held",
    ),
    (
        "the element before another",
        "%following = OpIAdd %uint %i %1
         %after = OpAccessChain %ptr_cell %cells %following
         %before = OpPtrAccessChain %ptr_cell %after %minus_one
         %p = OpAccessChain %ptr_wide %before %1",
    ),
];

#[test]
fn wide_integers_in_workgroup_memory_lie_on_any_word_whatever_leads_there() {
    // Of 0xFFFF_FFFF and 7, what each instruction leaves.
    let updates = [
        ("%old = OpAtomicIAdd %ulong %p %2 %0 %seven", 0x1_0000_0006u64),
        ("%old = OpAtomicISub %ulong %p %2 %0 %seven", 0xFFFF_FFF8),
        ("%old = OpAtomicXor %ulong %p %2 %0 %high", 0x1_FFFF_FFFF),
        ("%old = OpAtomicUMax %ulong %p %2 %0 %high", 0x1_0000_0000),
        ("%old = OpAtomicExchange %ulong %p %2 %0 %high", 0x1_0000_0000),
        ("%old = OpAtomicCompareExchange %ulong %p %2 %0 %0 %high %start", 0x1_0000_0000),
        ("OpAtomicStore %p %2 %0 %seven", 7),
        (
            "%old = OpAtomicLoad %ulong %p %2 %0\n%more = OpIAdd %ulong %old %seven\nOpStore %p %more",
            0x1_0000_0006,
        ),
    ];
    for (at, &(way, pointer)) in WIDE_POINTERS.iter().enumerate() {
        for turn in 0..2 {
            let (update, expected) = updates[(at + 3 * turn) % updates.len()];
            let module = Workgroup {
                size: 70,
                is_wide: true,
                capabilities: "OpCapability Int64Atomics",
                interface: "%cells",
                annotations: "OpDecorate %ptr_cell ArrayStride 12",
                declarations: "
                    %minus_one = OpConstant %int -1
                    %72 = OpConstant %uint 72
                    %100 = OpConstant %uint 100
                    %start = OpConstant %ulong 0xFFFFFFFFL
                    %seven = OpConstant %ulong 7L
                    %high = OpConstant %ulong 0x100000000L
                    %cell = OpTypeStruct %uint %ulong
                    %array = OpTypeArray %cell %72
                    %ptr_array = OpTypePointer Workgroup %array
                    %ptr_cell = OpTypePointer Workgroup %cell
                    %ptr_wide = OpTypePointer Workgroup %ulong
                    %cells = OpVariable %ptr_array Workgroup
                    %ptr_held = OpTypePointer Function %ptr_wide
                    %wide_type = OpTypeFunction %ptr_wide %ptr_cell",
                variables: "%held = OpVariable %ptr_held Function",
                body: &format!(
                    "%is_inside = OpULessThan %bool %i %100
                     %own = OpAccessChain %ptr_cell %cells %i
                     %own_wide = OpAccessChain %ptr_wide %cells %i %1
                     OpStore %own_wide %start
                     {pointer}
                     {update}
                     %left = OpLoad %ulong %own_wide
                     %left_at = OpAccessChain %ptr_ulong %out %0 %i
                     OpStore %left_at %left"
                ),
                functions: "
                    %wide_of = OpFunction %ptr_wide DontInline %wide_type
                    %given = OpFunctionParameter %ptr_cell
                    %given_entry = OpLabel
                    %given_wide = OpAccessChain %ptr_wide %given %1
                    OpReturnValue %given_wide
                    OpFunctionEnd",
            }
            .module();
            for inlining in [Inlining::Never, Inlining::WhereProfitable] {
                let compute = compute(&module, LowerOptions { inlining, ..LowerOptions::default() });
                for lanes in [BatchWidth::One, BatchWidth::Of64] {
                    let out = Buffer::zeroed(8 * 70);
                    let resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
                    compute
                        .run(&resources, [1, 1, 1], RunOptions::of(lanes))
                        .unwrap_or_else(|error| panic!("{way}, {lanes} lanes: {}", error.render()));
                    let left: Vec<u64> = bytemuck::pod_collect_to_vec(&out.bytes());
                    assert_eq!(left, [expected; 70], "{way}, {lanes} lanes, {update}");
                }
            }
        }
    }
}
