//! Memory instructions (SPIR-V 3.3.8), pointers as values and device addresses.

use std::sync::Arc;

use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};

use crate::execution::instructions::run::{INVOCATIONS, Shader};

const PHYSICAL: &str = "OpCapability PhysicalStorageBufferAddresses";

/// `%table`: a storage buffer of 64-bit words at binding 1, read with `%address_of_N`.
const TABLE: &str = "
    %table_words = OpTypeRuntimeArray %ulong
    %table_block = OpTypeStruct %table_words
    %ptr_StorageBuffer_table = OpTypePointer StorageBuffer %table_block
    %ptr_StorageBuffer_ulong = OpTypePointer StorageBuffer %ulong
    %table = OpVariable %ptr_StorageBuffer_table StorageBuffer
    %ptr_uint = OpTypePointer PhysicalStorageBuffer %uint
    %ptr_ulong = OpTypePointer PhysicalStorageBuffer %ulong";
const TABLE_LAYOUT: &str = "
    OpDecorate %table_words ArrayStride 8
    OpDecorate %table_block Block
    OpMemberDecorate %table_block 0 Offset 0
    OpDecorate %table DescriptorSet 0
    OpDecorate %table Binding 1
    OpDecorate %ptr_uint ArrayStride 4";

/// A buffer of these words with a device address, and the table that tells it.
fn addressed(words: &[u32]) -> (Resources, Arc<Buffer>) {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let data = Buffer::new(&bytes);
    let mut resources = Resources::default();
    let address = resources.memory.add_buffer(&data);
    let table = Buffer::new(&address.to_le_bytes());
    (resources.bind(0, 1, Descriptor::Buffer(table)), data)
}

fn words(buffer: &Buffer) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(&buffer.bytes())
}

#[test]
fn a_computed_index_reaches_every_element_of_a_variable() {
    // The array is written as a whole and by constant indices, read by a computed one.
    let found = Shader {
        declarations: "
            %array = OpTypeArray %uint %u4
            %ptr_Function_array = OpTypePointer Function %array
            %values = OpConstantComposite %array %u10 %u11 %u12 %u13",
        body: "
            %variable = OpVariable %ptr_Function_array Function
            OpStore %variable %values
            %last = OpAccessChain %ptr_Function_uint %variable %u3
            OpStore %last %u20
            %index = OpUMod %uint %id %u4
            %chosen = OpAccessChain %ptr_Function_uint %variable %index
            %value = OpLoad %uint %chosen
            out 0 %value",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        assert_eq!(words[0], [10, 11, 12, 20][id % 4]);
    }
}

#[test]
fn device_addresses_load_and_store() {
    let shader = Shader {
        capabilities: PHYSICAL,
        annotations: TABLE_LAYOUT,
        declarations: TABLE,
        body: "
            %slot = OpAccessChain %ptr_StorageBuffer_ulong %table %u0 %u0
            %address = OpLoad %ulong %slot
            %pointer = OpConvertUToPtr %ptr_uint %address
            %first = OpLoad %uint %pointer Aligned 4
            out 0 %first
            %second_pointer = OpPtrAccessChain %ptr_uint %pointer %u1
            %second = OpLoad %uint %second_pointer Aligned 4
            out 1 %second
            %minus_one = OpSNegate %int %u1
            %back_pointer = OpPtrAccessChain %ptr_uint %second_pointer %minus_one
            %back = OpLoad %uint %back_pointer Aligned 4
            out 2 %back
            %number = OpConvertPtrToU %ulong %second_pointer
            %halves = OpBitcast %uint2 %number
            %low = OpCompositeExtract %uint %halves 0
            %high = OpCompositeExtract %uint %halves 1
            out 3 %low
            out 4 %high
            %cast = OpBitcast %ptr_uint %halves
            %again = OpLoad %uint %cast Aligned 4
            out 5 %again
            %same = OpPtrEqual %bool %second_pointer %cast
            %same_word = OpSelect %uint %same %u1 %u0
            out 6 %same_word
            %distance = OpPtrDiff %int %pointer %second_pointer
            %distance_bits = OpBitcast %uint %distance
            out 7 %distance_bits
            %own_index = OpIAdd %uint %id %u2
            %own = OpPtrAccessChain %ptr_uint %pointer %own_index
            OpStore %own %id Aligned 4",
        ..Shader::default()
    };
    let mut stored = Vec::new();
    let found = shader
        .run_with(&mut || {
            let (resources, data) = addressed(&[[7, 8].as_slice(), &[99; INVOCATIONS]].concat());
            stored.push(data);
            resources
        })
        .unwrap_or_else(|error| panic!("{}", error.render()));
    for words in &found {
        // The first region begins at 2^32; element 1 lies 4 bytes further.
        assert_eq!(words[..8], [7, 8, 7, 4, 1, 8, 1, u32::MAX]);
    }
    let expected: Vec<u32> = [7, 8].into_iter().chain(0..INVOCATIONS as u32).collect();
    for data in stored {
        assert_eq!(words(&data), expected);
    }
}

#[test]
fn a_linked_list_is_followed() {
    // struct Node { uint value; Node* next; } at 0 and 16 of one buffer; a null pointer ends it.
    let shader = Shader {
        capabilities: PHYSICAL,
        annotations: &format!(
            "{TABLE_LAYOUT}
             OpDecorate %node Block
             OpMemberDecorate %node 0 Offset 0
             OpMemberDecorate %node 1 Offset 8"
        ),
        declarations: &format!(
            "{TABLE}
             OpTypeForwardPointer %ptr_node PhysicalStorageBuffer
             %node = OpTypeStruct %uint %ptr_node
             %ptr_node = OpTypePointer PhysicalStorageBuffer %node
             %ptr_ptr_node = OpTypePointer PhysicalStorageBuffer %ptr_node
             %zero_long = OpConstant %ulong 0L"
        ),
        body: "
            %slot = OpAccessChain %ptr_StorageBuffer_ulong %table %u0 %u0
            %address = OpLoad %ulong %slot
            %head = OpBitcast %ptr_node %address
            OpBranch %loop
            %loop = OpLabel
            %here = OpPhi %ptr_node %head %entry %next %continue
            %sum = OpPhi %uint %u0 %entry %more %continue
            %here_number = OpConvertPtrToU %ulong %here
            %ends = OpIEqual %bool %here_number %zero_long
            OpLoopMerge %done %continue None
            OpBranchConditional %ends %done %go
            %go = OpLabel
            %value_pointer = OpAccessChain %ptr_uint %here %u0
            %value = OpLoad %uint %value_pointer Aligned 8
            %more = OpIAdd %uint %sum %value
            %next_pointer = OpAccessChain %ptr_ptr_node %here %u1
            %next = OpLoad %ptr_node %next_pointer Aligned 8
            OpBranch %continue
            %continue = OpLabel
            OpBranch %loop
            %done = OpLabel
            out 0 %sum",
        ..Shader::default()
    };
    let found = shader.run_with(&mut || addressed(&[3, 0, 16, 1, 4, 0, 0, 0]).0);
    let found = found.unwrap_or_else(|error| panic!("{}", error.render()));
    for words in found {
        assert_eq!(words[0], 7);
    }
}

#[test]
fn bad_addresses_trap_and_are_named() {
    let shader = |load: &str| {
        let body = format!(
            "%slot = OpAccessChain %ptr_StorageBuffer_ulong %table %u0 %u0
             %address = OpLoad %ulong %slot
             {load}
             out 0 %value"
        );
        let shader = Shader {
            capabilities: PHYSICAL,
            annotations: TABLE_LAYOUT,
            declarations: TABLE,
            body: &body,
            ..Shader::default()
        };
        let error = shader.run_with(&mut || addressed(&[1, 2]).0).expect_err("a trap");
        assert_eq!(error.kind(), ErrorKind::Trap);
        (error.message().to_owned(), error.notes()[0].clone())
    };
    assert_eq!(
        shader(
            "%pointer = OpConvertUToPtr %ptr_uint %address
             %beyond = OpPtrAccessChain %ptr_uint %pointer %u2
             %value = OpLoad %uint %beyond Aligned 4"
        ),
        (
            "a buffer is accessed beyond its end through a device address".to_owned(),
            "4 bytes at address 0x100000008: at the end of the buffer at 0x100000000, which has 8 bytes"
                .to_owned()
        )
    );
    assert_eq!(
        shader(
            "%one = OpUConvert %ulong %u1
             %odd = OpIAdd %ulong %address %one
             %pointer = OpConvertUToPtr %ptr_uint %odd
             %value = OpLoad %uint %pointer Aligned 4"
        ),
        (
            "a device address is not aligned as the instruction promises".to_owned(),
            "4 bytes at address 0x100000001: offset 1 of the buffer at 0x100000000, which has 8 bytes"
                .to_owned()
        )
    );
    assert_eq!(
        shader(
            "%pointer = OpConvertUToPtr %ptr_uint %id
             %value = OpLoad %uint %pointer Aligned 4"
        ),
        ("an access through a null pointer".to_owned(), "4 bytes at address 0x0".to_owned())
    );
}

#[test]
fn elements_of_buffer_arrays_are_chosen_by_each_lane() {
    // block[2][2] at binding 1: descriptors 0 to 3 hold 100 to 103.
    let shader = Shader {
        annotations: "
            OpDecorate %block Block
            OpMemberDecorate %block 0 Offset 0
            OpDecorate %buffers DescriptorSet 0
            OpDecorate %buffers Binding 1",
        declarations: "
            %block = OpTypeStruct %uint
            %row = OpTypeArray %block %u2
            %rows = OpTypeArray %row %u2
            %ptr_StorageBuffer_rows = OpTypePointer StorageBuffer %rows
            %buffers = OpVariable %ptr_StorageBuffer_rows StorageBuffer",
        body: "
            %x = OpUMod %uint %id %u2
            %half_id = OpUDiv %uint %id %u2
            %y = OpUMod %uint %half_id %u2
            %pointer = OpAccessChain %ptr_StorageBuffer_uint %buffers %y %x %u0
            %value = OpLoad %uint %pointer
            out 0 %value
            %fixed = OpAccessChain %ptr_StorageBuffer_uint %buffers %u1 %u0 %u0
            %fixed_value = OpLoad %uint %fixed
            out 1 %fixed_value",
        ..Shader::default()
    };
    let found = shader.run_with(&mut || {
        let mut resources = Resources::default();
        for element in 0..4u32 {
            let buffer = Buffer::new(&(100 + element).to_le_bytes());
            let binding = anyhit_engine::machine::Binding { set: 0, binding: 1 };
            resources.insert(binding, element, Descriptor::Buffer(buffer));
        }
        resources
    });
    for (id, words) in found.unwrap_or_else(|error| panic!("{}", error.render())).iter().enumerate() {
        assert_eq!(words[..2], [100 + id as u32 % 4, 102]);
    }
}

#[test]
fn an_address_that_leads_nowhere_is_told_by_its_distance_from_the_nearest_buffer() {
    // Regions of 4 GiB: 16 bytes at 0x1_0000_0000 and, bound as `%table` too, 8 at 0x2_0000_0000.
    const FIRST: u64 = 0x1_0000_0000;
    const SECOND: u64 = 0x2_0000_0000;
    let first = "buffer at 0x100000000, which has 16 bytes";
    let second = "buffer, `table` (set 0, binding 1, element 0) at 0x200000000, which has 8 bytes";
    let inside = "buffer `table` (set 0, binding 1, element 0) at 0x200000000, which has 8 bytes";
    let apart = first.replace("buffer", "buffer,");
    for (address, expected) in [
        (0x1_0000, format!("4294901760 bytes before the nearest {apart}")),
        (FIRST - 4, format!("4 bytes before the nearest {apart}")),
        (FIRST + 14, format!("offset 14 of the {first}")),
        (FIRST + 16, format!("at the end of the {first}")),
        (FIRST + 20, format!("4 bytes past the end of the nearest {apart}")),
        // Halfway between the end of the one and the beginning of the other.
        (FIRST + 0x8000_0004, format!("2147483636 bytes past the end of the nearest {apart}")),
        (FIRST + 0x8000_000C, format!("2147483636 bytes before the nearest {second}")),
        (SECOND - 1, format!("1 bytes before the nearest {second}")),
        (SECOND + 5, format!("offset 5 of the {inside}")),
        (SECOND + 8, format!("at the end of the {inside}")),
        (SECOND + 9, format!("1 bytes past the end of the nearest {second}")),
    ] {
        for access in [
            "OpStore %p %u1 Aligned 4",
            "%v = OpLoad %uint %p Aligned 4\nout 0 %v",
            "%v = OpAtomicIAdd %uint %p %u1 %u0 %u1",
        ] {
            // The table is read, too, so that its slot has a name.
            let body = format!(
                "%slot = OpAccessChain %ptr_StorageBuffer_ulong %table %u0 %u0
                 %p = OpConvertUToPtr %ptr_uint %asked
                 {access}
                 %last = OpLoad %ulong %slot
                 OpStore %slot %last"
            );
            let error = Shader {
                capabilities: PHYSICAL,
                annotations: &format!("OpName %table \"table\"{TABLE_LAYOUT}"),
                declarations: &format!("{TABLE}\n%asked = OpConstant %ulong {address:#x}L"),
                body: &body,
                ..Shader::default()
            }
            .run_with(&mut || {
                let mut resources = Resources::default();
                let second = Buffer::zeroed(8);
                assert_eq!(resources.memory.add_buffer(&Buffer::zeroed(16)), FIRST);
                assert_eq!(resources.memory.add_buffer(&second), SECOND);
                resources.bind(0, 1, Descriptor::Buffer(second))
            })
            .expect_err(&body);
            let expected = format!("4 bytes at address {address:#x}: {expected}");
            assert_eq!(error.notes()[0], expected, "{}", error.render());
        }
    }
}

/// A block begins at its offset in its bank, and each bank has bytes of its own.
#[test]
fn push_constants_lie_in_banks() {
    let shader = Shader {
        capabilities: "
            OpCapability PushConstantBanksNV
            OpExtension \"SPV_NV_push_constant_bank\"",
        annotations: "
            OpDecorate %constants Block
            OpMemberDecorate %constants 0 Offset 0
            OpMemberDecorate %constants 1 Offset 4
            OpDecorate %first MemberOffsetNV 4
            OpDecorate %third BankNV 3
            OpDecorate %third MemberOffsetNV 8
            OpDecorate %fifth BankNV 5",
        declarations: "
            %constants = OpTypeStruct %uint %uint
            %ptr_constants = OpTypePointer PushConstant %constants
            %ptr_PushConstant_uint = OpTypePointer PushConstant %uint
            %first = OpVariable %ptr_constants PushConstant
            %third = OpVariable %ptr_constants PushConstant
            %fifth = OpVariable %ptr_constants PushConstant",
        body: "
            %first_1 = OpAccessChain %ptr_PushConstant_uint %first %u1
            %w12 = OpLoad %uint %first_1
            out 0 %w12
            %third_0 = OpAccessChain %ptr_PushConstant_uint %third %u0
            %w32 = OpLoad %uint %third_0
            out 1 %w32
            %fifth_1 = OpAccessChain %ptr_PushConstant_uint %fifth %u1
            %w51 = OpLoad %uint %fifth_1
            out 2 %w51",
        invocations: Some(1),
        ..Shader::default()
    };
    let words = |words: [u32; 4]| Buffer::new(&words.map(u32::to_le_bytes).concat());
    let mut resources = || {
        let mut all = Resources { push_constants: Some(words([10, 11, 12, 13])), ..Resources::default() };
        all.insert(Binding::push_constant_bank(3), 0, Descriptor::Buffer(words([30, 31, 32, 33])));
        all.insert(Binding::push_constant_bank(5), 0, Descriptor::Buffer(words([50, 51, 52, 53])));
        all
    };
    let found = shader.run_with(&mut resources).unwrap_or_else(|error| panic!("{}", error.render()));
    assert_eq!(found[0][..3], [12, 32, 51]);
    let mut unset = || Resources { push_constants: Some(words([0; 4])), ..Resources::default() };
    let error = shader.run_with(&mut unset).expect_err("no bank is set").render();
    assert!(error.contains("bank 3 of the push constants"), "{error}");
}
