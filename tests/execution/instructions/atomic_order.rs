//! Atomic updates of one word by several invocations: what does not commute, or is seen by a
//! shader, runs in one schedule at every number of lanes and threads.

use std::sync::Arc;

use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{BatchWidth, RunOptions};

use crate::execution::instructions::run::{INVOCATIONS, Shader};
use crate::execution::instructions::workgroup::Workgroup;

/// Atomic instructions that change memory by an operand.
const UPDATES: [&str; 9] = ["IAdd", "ISub", "SMin", "UMin", "SMax", "UMax", "And", "Or", "Xor"];

fn updated(update: &str, old: u32, value: u32) -> u32 {
    match update {
        "IAdd" => old.wrapping_add(value),
        "ISub" => old.wrapping_sub(value),
        "SMin" => (old as i32).min(value as i32) as u32,
        "UMin" => old.min(value),
        "SMax" => (old as i32).max(value as i32) as u32,
        "UMax" => old.max(value),
        "And" => old & value,
        "Or" => old | value,
        _ => old ^ value,
    }
}

/// What is left where each invocation brings [`operand`] to an instruction of each kind, in the
/// schedule that is kept where an order can be seen: 64 invocations make the first one after the
/// other, then the second.
fn scheduled(updates: [&str; 2], start: u32, invocations: u32) -> u32 {
    let mut word = start;
    for first in (0..invocations).step_by(64) {
        for update in updates {
            for id in first..invocations.min(first + 64) {
                word = updated(update, word, operand(id));
            }
        }
    }
    word
}

/// Numbers of both signs, with bits in every place.
fn operand(id: u32) -> u32 {
    (id + 1).wrapping_mul(0x9E37_79B9)
}

/// Two ways to one word of a buffer, `%a` and `%b`, behind what computes them. The buffer is at
/// bindings 1 and 2, the first of two at binding 3, and has the device's first address.
const TWO_WAYS: &[(&str, &str)] = &[
    ("one binding", "%b = OpCopyObject %ptr_StorageBuffer_uint %a"),
    ("two bindings", "%b = OpAccessChain %ptr_StorageBuffer_uint %again %u0 %u2"),
    (
        "an element chosen while running",
        "%p = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u0
         %zero = OpLoad %uint %p
         %b = OpAccessChain %ptr_StorageBuffer_uint %many %zero %u0 %u2",
    ),
    (
        "a chosen pointer",
        "%p = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u0
         %zero = OpLoad %uint %p
         %is_zero = OpIEqual %bool %zero %u0
         %other = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u1
         %b = OpSelect %ptr_StorageBuffer_uint %is_zero %a %other",
    ),
    ("an address", "%b = OpConvertUToPtr %ptr_address %word_2"),
];

#[test]
fn any_two_updates_by_any_two_ways_are_made_in_one_schedule() {
    let pairs = || UPDATES.iter().flat_map(|&a| UPDATES.map(|b| [a, b])).enumerate();
    for (at, &(way, pointers)) in TWO_WAYS.iter().enumerate() {
        // Every pair by one way, a few by each of the others.
        for (_, updates) in pairs().filter(|(number, _)| at == 0 || number % 7 == at) {
            let [first, second] = updates;
            let body = format!(
                "%a = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %u2
                 {pointers}
                 %next = OpIAdd %uint %id %u1
                 %value = OpIMul %uint %next %golden
                 %old_a = OpAtomic{first} %uint %a %u1 %u0 %value
                 %old_b = OpAtomic{second} %uint %b %u1 %u0 %value"
            );
            let shader = Shader {
                capabilities: "OpCapability PhysicalStorageBufferAddresses\nOpCapability VariablePointers",
                annotations: "
                    OpDecorate %cells DescriptorSet 0
                    OpDecorate %cells Binding 1
                    OpDecorate %again DescriptorSet 0
                    OpDecorate %again Binding 2
                    OpDecorate %many DescriptorSet 0
                    OpDecorate %many Binding 3",
                declarations: "
                    %golden = OpConstant %uint 0x9E3779B9
                    %word_2 = OpConstant %ulong 0x100000008L
                    %blocks = OpTypeArray %out_block %u2
                    %ptr_blocks = OpTypePointer StorageBuffer %blocks
                    %ptr_address = OpTypePointer PhysicalStorageBuffer %uint
                    %cells = OpVariable %ptr_StorageBuffer_out_block StorageBuffer
                    %again = OpVariable %ptr_StorageBuffer_out_block StorageBuffer
                    %many = OpVariable %ptr_blocks StorageBuffer",
                body: &body,
                ..Shader::default()
            };
            let start = 0x0F0F_5A5A;
            let mut made = Vec::new();
            let ran = shader.run_with(&mut || {
                let bytes: Vec<u8> =
                    [0, 7, start, 8].iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
                let cells = Buffer::new(&bytes);
                made.push(cells.clone());
                let bound = |buffer: &Arc<Buffer>| Descriptor::Buffer(buffer.clone());
                let mut resources = Resources::default().bind(0, 1, bound(&cells)).bind(0, 2, bound(&cells));
                resources = resources.bind(0, 3, bound(&cells));
                let many = anyhit_engine::machine::Binding { set: 0, binding: 3 };
                resources.insert(many, 1, bound(&Buffer::zeroed(16)));
                assert_eq!(resources.memory.add_buffer(&cells), 1 << 32);
                resources
            });
            ran.unwrap_or_else(|error| panic!("{updates:?} by {way}: {}", error.render()));
            let expected = scheduled(updates, start, INVOCATIONS as u32);
            for cells in made {
                let words: Vec<u32> = bytemuck::pod_collect_to_vec(&cells.bytes());
                assert_eq!(words, [0, 7, expected, 8], "{updates:?} by {way}");
            }
        }
    }
}

#[test]
fn any_two_updates_of_workgroup_memory_are_made_in_one_schedule() {
    const INVOCATIONS: u32 = 160;
    let ways = [
        "%b = OpCopyObject %ptr_shared %a",
        "%is_zero = OpIEqual %bool %number %0\n%b = OpSelect %ptr_shared %is_zero %a %other",
    ];
    let pairs = UPDATES.iter().flat_map(|&a| UPDATES.map(|b| [a, b])).enumerate();
    for (way, updates) in pairs.map(|(number, updates)| (ways[number % 2], updates)) {
        let [first, second] = updates;
        let usual = Workgroup {
            size: INVOCATIONS,
            interface: "%word %other %given",
            annotations: "
                OpDecorate %given DescriptorSet 0
                OpDecorate %given Binding 1",
            declarations: "
                %golden = OpConstant %uint 0x9E3779B9
                %ptr_shared = OpTypePointer Workgroup %uint
                %word = OpVariable %ptr_shared Workgroup
                %other = OpVariable %ptr_shared Workgroup
                %given = OpVariable %ptr_block StorageBuffer",
            body: &format!(
                "%number_at = OpAccessChain %ptr_uint %given %0 %0
                 %number = OpLoad %uint %number_at
                 %start_at = OpAccessChain %ptr_uint %given %0 %1
                 %start = OpLoad %uint %start_at
                 %a = OpCopyObject %ptr_shared %word
                 {way}
                 OpStore %a %start
                 OpControlBarrier %2 %2 %264
                 %next = OpIAdd %uint %g %1
                 %value = OpIMul %uint %next %golden
                 %old_a = OpAtomic{first} %uint %a %2 %0 %value
                 %old_b = OpAtomic{second} %uint %b %2 %0 %value
                 OpControlBarrier %2 %2 %264
                 %left = OpLoad %uint %word
                 %left_at = OpAccessChain %ptr_uint %out %0 %g
                 OpStore %left_at %left"
            ),
            ..Workgroup::default()
        }
        .compute();
        let reference = usual.unoptimized().expect("a compute shader");
        let start = 0x0F0F_5A5Au32;
        let expected = scheduled(updates, start, INVOCATIONS);
        for compute in [&usual, &reference] {
            for lanes in BatchWidth::ALL {
                let out = Buffer::zeroed(4 * INVOCATIONS as usize);
                let given = Buffer::new(&[0, start].map(u32::to_le_bytes).concat());
                let resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
                let resources = resources.bind(0, 1, Descriptor::Buffer(given));
                // Nothing else keeps the schedule, unless the pointer may lead anywhere.
                if way == ways[0] {
                    assert_eq!(compute.shared_memory([1, 1, 1], &resources), None);
                }
                compute
                    .run(&resources, [1, 1, 1], RunOptions::of(lanes))
                    .unwrap_or_else(|error| panic!("{updates:?}: {}", error.render()));
                let words: Vec<u32> = bytemuck::pod_collect_to_vec(&out.bytes());
                assert_eq!(words, [expected; INVOCATIONS as usize], "{updates:?}, {lanes} lanes, {way}");
            }
        }
    }
}

#[test]
fn whichever_word_of_a_result_is_read_the_order_matters() {
    let kinds = ["IAdd", "ISub", "SMin", "UMin", "SMax", "UMax", "And", "Or", "Xor", "Exchange"];
    for (bits, ty) in [(32, "uint"), (64, "ulong")] {
        for kind in kinds {
            for (words, read) in [
                ("none", ""),
                ("all", "%c = OpCopyObject %{ty} %old\nOpStore %own %c"),
                (
                    "the lower half",
                    "%h = OpBitcast %{halves} %old\n%l = OpCompositeExtract %{part} %h 0
                     %w = OpUConvert %{ty} %l\nOpStore %own %w",
                ),
                (
                    "the upper half",
                    "%h = OpBitcast %{halves} %old\n%l = OpCompositeExtract %{part} %h 1
                     %w = OpUConvert %{ty} %l\nOpStore %own %w",
                ),
            ] {
                let (halves, part) = if bits == 64 { ("uint2", "uint") } else { ("ushort2", "ushort") };
                let literal = if bits == 64 { "1L" } else { "1" };
                let read = read.replace("{ty}", ty).replace("{halves}", halves).replace("{part}", part);
                let program = Shader {
                    capabilities: "OpCapability Int64Atomics",
                    annotations: &format!(
                        "OpDecorate %numbers ArrayStride {}
                         OpDecorate %numbers_block Block
                         OpMemberDecorate %numbers_block 0 Offset 0
                         OpDecorate %cells DescriptorSet 0
                         OpDecorate %cells Binding 1
                         OpDecorate %results DescriptorSet 0
                         OpDecorate %results Binding 2",
                        bits / 8
                    ),
                    declarations: &format!(
                        "%ushort2 = OpTypeVector %ushort 2
                         %numbers = OpTypeRuntimeArray %{ty}
                         %numbers_block = OpTypeStruct %numbers
                         %ptr_numbers = OpTypePointer StorageBuffer %numbers_block
                         %ptr_number = OpTypePointer StorageBuffer %{ty}
                         %cells = OpVariable %ptr_numbers StorageBuffer
                         %results = OpVariable %ptr_numbers StorageBuffer
                         %one = OpConstant %{ty} {literal}"
                    ),
                    body: &format!(
                        "%cell = OpAccessChain %ptr_number %cells %u0 %u0
                         %own = OpAccessChain %ptr_number %results %u0 %id
                         %old = OpAtomic{kind} %{ty} %cell %u1 %u0 %one
                         {read}"
                    ),
                    ..Shader::default()
                }
                .program();
                // What is exchanged is left by the last one that comes.
                let expected = words != "none" || kind == "Exchange";
                assert_eq!(
                    program.order_dependent, expected,
                    "{kind} of {bits} bits, of which {words} are read"
                );
            }
        }
    }
}
