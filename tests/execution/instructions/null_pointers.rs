//! The null pointer: no resource and no variable shares its value, and whatever goes through it
//! traps.
//!
//! "Null is no resource": in every module here the first descriptor, and the first row of a
//! variable, is one that a pointer of zeros would name.

use std::sync::Arc;

use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::{Buffer, Descriptor, MemoryPolicy, Resources};

use crate::execution::instructions::run::Shader;
use crate::execution::instructions::workgroup::Workgroup;

/// `%cells`, a storage buffer at binding 1 of which every body takes the address first, so that it
/// is the first descriptor: { uint[2], mat2x3 (row-major), uint[] }. `%blocks`, two of them at
/// binding 2.
const ANNOTATIONS: &str = "
    OpDecorate %pair ArrayStride 4
    OpDecorate %rest ArrayStride 4
    OpDecorate %ptr_cell ArrayStride 4
    OpDecorate %cell_block Block
    OpMemberDecorate %cell_block 0 Offset 0
    OpMemberDecorate %cell_block 1 Offset 8
    OpMemberDecorate %cell_block 1 RowMajor
    OpMemberDecorate %cell_block 1 MatrixStride 8
    OpMemberDecorate %cell_block 2 Offset 32
    OpDecorate %cells DescriptorSet 0
    OpDecorate %cells Binding 1
    OpDecorate %blocks DescriptorSet 0
    OpDecorate %blocks Binding 2
    OpMemberDecorate %physical_struct 0 Offset 0
    OpMemberDecorate %physical_struct 1 Offset 4";
const DECLARATIONS: &str = "
    %pair = OpTypeArray %uint %u2
    %rest = OpTypeRuntimeArray %uint
    %mat = OpTypeMatrix %float3 2
    %cell_block = OpTypeStruct %pair %mat %rest
    %ptr_cells = OpTypePointer StorageBuffer %cell_block
    %ptr_pair = OpTypePointer StorageBuffer %pair
    %ptr_cell = OpTypePointer StorageBuffer %uint
    %ptr_mat = OpTypePointer StorageBuffer %mat
    %block_array = OpTypeArray %cell_block %u2
    %ptr_blocks = OpTypePointer StorageBuffer %block_array
    %cells = OpVariable %ptr_cells StorageBuffer
    %blocks = OpVariable %ptr_blocks StorageBuffer
    %null_block = OpConstantNull %ptr_cells
    %null = OpConstantNull %ptr_cell
    %null_mat = OpConstantNull %ptr_mat
    %null_blocks = OpConstantNull %ptr_blocks
    %undefined = OpUndef %ptr_cell
    %holder = OpTypeStruct %uint %ptr_cell
    %holders = OpTypeArray %holder %u2
    %null_holders = OpConstantNull %holders
    %ptr_Function_ptr = OpTypePointer Function %ptr_cell
    %ptr_Private_ptr = OpTypePointer Private %ptr_cell
    %ptr_Private_holders = OpTypePointer Private %holders
    %private_numbers = OpTypeStruct %uint %pair
    %ptr_numbers = OpTypePointer Private %private_numbers
    %numbers = OpVariable %ptr_numbers Private
    %private_pointer = OpVariable %ptr_Private_ptr Private
    %private_holders = OpVariable %ptr_Private_holders Private %null_holders
    %null_numbers = OpConstantNull %ptr_numbers
    %null_private = OpConstantNull %ptr_Private_uint
    %null_function = OpConstantNull %ptr_Function_uint
    %physical_struct = OpTypeStruct %uint %uint
    %ptr_physical_struct = OpTypePointer PhysicalStorageBuffer %physical_struct
    %ptr_physical = OpTypePointer PhysicalStorageBuffer %uint
    %no_address = OpConstant %ulong 0L
    %uint_of_ptr = OpTypeFunction %uint %ptr_cell
    %ptr_of_ptr = OpTypeFunction %ptr_cell %ptr_cell";
const FUNCTIONS: &str = "
    %read = OpFunction %uint None %uint_of_ptr
    %given = OpFunctionParameter %ptr_cell
    %read_label = OpLabel
    %read_value = OpLoad %uint %given
    OpReturnValue %read_value
    OpFunctionEnd
    %is_null = OpFunction %uint None %uint_of_ptr
    %asked = OpFunctionParameter %ptr_cell
    %is_null_label = OpLabel
    %is_null_bool = OpPtrEqual %bool %asked %null
    %is_null_word = OpSelect %uint %is_null_bool %u1 %u0
    OpReturnValue %is_null_word
    OpFunctionEnd
    %same = OpFunction %ptr_cell None %ptr_of_ptr
    %passed = OpFunctionParameter %ptr_cell
    %same_label = OpLabel
    OpReturnValue %passed
    OpFunctionEnd";

fn shader(body: &str) -> String {
    format!(
        "%local = OpVariable %ptr_Function_ptr Function
         %local_number = OpVariable %ptr_Function_uint Function
         %cell = OpAccessChain %ptr_cell %cells %u0 %u0
         %cell_value = OpLoad %uint %cell
         OpStore %local_number %cell_value
         %odd_word = OpBitwiseAnd %uint %id %u1
         %odd = OpIEqual %bool %odd_word %u1
         %chosen = OpSelect %ptr_cell %odd %null %cell
         {body}"
    )
}

fn text<'a>(body: &'a str) -> Shader<'a> {
    Shader {
        capabilities: "OpCapability VariablePointers\nOpCapability PhysicalStorageBufferAddresses",
        annotations: ANNOTATIONS,
        declarations: DECLARATIONS,
        body,
        functions: FUNCTIONS,
        ..Shader::default()
    }
}

/// The words of `%cells`: 7 and 8, the floats 0 to 5, then 9.
fn cells() -> Arc<Buffer> {
    let floats = (0..6).map(|at| (at as f32).to_bits());
    let words = [7, 8].into_iter().chain(floats).chain([9]);
    Buffer::new(&words.flat_map(u32::to_le_bytes).collect::<Vec<u8>>())
}

fn resources(policy: MemoryPolicy) -> (Resources, Arc<Buffer>) {
    let cells = cells();
    let mut resources = Resources { policy, ..Resources::default() };
    resources = resources.bind(0, 1, Descriptor::Buffer(cells.clone()));
    (resources, cells)
}

fn run(body: &str) -> Vec<[u32; 16]> {
    let body = shader(body);
    let found = text(&body).run_with(&mut || resources(MemoryPolicy::Trap).0);
    found.unwrap_or_else(|error| panic!("{}", error.render()))
}

#[test]
fn null_equals_null_and_no_resource() {
    let found = run("%e0 = OpPtrEqual %bool %cells %null_block
         %w0 = OpSelect %uint %e0 %u1 %u0
         out 0 %w0
         %e1 = OpPtrEqual %bool %cell %null
         %w1 = OpSelect %uint %e1 %u1 %u0
         out 1 %w1
         %e2 = OpPtrNotEqual %bool %cell %null
         %w2 = OpSelect %uint %e2 %u1 %u0
         out 2 %w2
         %w3 = OpFunctionCall %uint %is_null %null
         out 3 %w3
         %w4 = OpFunctionCall %uint %is_null %cell
         out 4 %w4
         %w5 = OpFunctionCall %uint %is_null %chosen
         out 5 %w5
         OpStore %local %chosen
         %p6 = OpLoad %ptr_cell %local
         %w6 = OpFunctionCall %uint %is_null %p6
         out 6 %w6
         %p7 = OpLoad %ptr_cell %private_pointer
         %w7 = OpFunctionCall %uint %is_null %p7
         out 7 %w7
         %c8 = OpAccessChain %ptr_Private_ptr %private_holders %odd_word %u1
         %p8 = OpLoad %ptr_cell %c8
         %w8 = OpFunctionCall %uint %is_null %p8
         out 8 %w8
         OpStore %c8 %cell
         %p9 = OpLoad %ptr_cell %c8
         %w9 = OpFunctionCall %uint %is_null %p9
         out 9 %w9
         %p10 = OpFunctionCall %ptr_cell %same %chosen
         %w10 = OpFunctionCall %uint %is_null %p10
         out 10 %w10
         OpSelectionMerge %merge None
         OpBranchConditional %odd %then %merge
         %then = OpLabel
         OpBranch %merge
         %merge = OpLabel
         %p11 = OpPhi %ptr_cell %cell %entry %null %then
         %w11 = OpFunctionCall %uint %is_null %p11
         out 11 %w11
         %w12 = OpPtrDiff %uint %null %null
         out 12 %w12
         %e13 = OpPtrEqual %bool %null_private %null_private
         %w13 = OpSelect %uint %e13 %u1 %u0
         out 13 %w13
         %first_number = OpAccessChain %ptr_Private_uint %numbers %u0
         %e14 = OpPtrEqual %bool %first_number %null_private
         %w14 = OpSelect %uint %e14 %u1 %u0
         out 14 %w14
         %e15 = OpPtrEqual %bool %local_number %null_function
         %w15 = OpSelect %uint %e15 %u1 %u0
         out 15 %w15");
    for (id, words) in found.iter().enumerate() {
        let odd = id as u32 % 2;
        assert_eq!(*words, [0, 0, 1, 1, 0, odd, odd, 1, 1, 0, odd, odd, 0, 1, 0, 0], "invocation {id}");
    }
}

#[test]
fn what_is_not_null_is_reached_beside_null() {
    // The matrix is row-major with 8 bytes between its rows: component 1 of column 1 is float 3.
    let found = run("%mats = OpAccessChain %ptr_mat %cells %u1
         %either = OpSelect %ptr_mat %odd %null_mat %mats
         OpSelectionMerge %end None
         OpBranchConditional %odd %end %even
         %even = OpLabel
         %value = OpLoad %uint %chosen
         out 0 %value
         %whole = OpLoad %mat %either
         %y = OpCompositeExtract %float %whole 1 1
         %y_word = OpConvertFToU %uint %y
         out 1 %y_word
         OpBranch %end
         %end = OpLabel");
    for (id, words) in found.iter().enumerate() {
        assert_eq!(words[..2], if id % 2 == 1 { [0, 0] } else { [7, 3] });
    }
}

/// Bodies that go through null, in invocation 1 at the latest.
const THROUGH_NULL: &[&str] = &[
    "%v = OpLoad %uint %null\nout 0 %v",
    "OpStore %null %u9",
    "%v = OpLoad %uint %undefined\nout 0 %v",
    "%u = OpUndef %ptr_cell\nOpStore %u %u9",
    "OpCopyMemory %null %cell",
    "OpCopyMemory %cell %null",
    "%v = OpAtomicIAdd %uint %null %u1 %u0 %u1",
    "%v = OpAtomicLoad %uint %null %u1 %u0\nout 0 %v",
    "OpAtomicStore %null %u1 %u0 %u1",
    "%v = OpAtomicCompareExchange %uint %null %u1 %u0 %u0 %u9 %u7",
    // What lies behind null is no better.
    "%p = OpAccessChain %ptr_cell %null_block %u0 %u1\nOpStore %p %u9",
    "%p = OpAccessChain %ptr_cell %null_block %u0 %odd_word\nOpStore %p %u9",
    "%p = OpAccessChain %ptr_cell %null_block %u2 %id\n%v = OpLoad %uint %p\nout 0 %v",
    "%p = OpPtrAccessChain %ptr_cell %null %u1\nOpStore %p %u9",
    "%p = OpPtrAccessChain %ptr_cell %null %id\nOpStore %p %u9",
    "%v = OpArrayLength %uint %null_block 2\nout 0 %v",
    "%v = OpLoad %mat %null_mat\n%x = OpCompositeExtract %float %v 0 0\n%w = OpBitcast %uint %x\nout 0 %w",
    "%p = OpAccessChain %ptr_cell %null_blocks %u1 %u0 %u0\nOpStore %p %u9",
    "%p = OpAccessChain %ptr_cell %null_blocks %odd_word %u0 %u0\nOpStore %p %u9",
    // However it comes there.
    "OpStore %chosen %u9",
    "%v = OpFunctionCall %uint %read %chosen\nout 0 %v",
    "%p = OpFunctionCall %ptr_cell %same %null\nOpStore %p %u9",
    "%p = OpLoad %ptr_cell %local\nOpStore %p %u9",
    "%p = OpLoad %ptr_cell %private_pointer\nOpStore %p %u9",
    "OpStore %private_pointer %null\n%p = OpLoad %ptr_cell %private_pointer\nOpStore %p %u9",
    "%p = OpCompositeExtract %ptr_cell %null_holders 1 1\nOpStore %p %u9",
    "%c = OpAccessChain %ptr_Private_ptr %private_holders %odd_word %u1
     %p = OpLoad %ptr_cell %c
     OpStore %p %u9",
    "OpSelectionMerge %merge None
     OpBranchConditional %odd %then %merge
     %then = OpLabel
     OpBranch %merge
     %merge = OpLabel
     %p = OpPhi %ptr_cell %cell %entry %null %then
     OpStore %p %u9",
    // Device addresses.
    "%p = OpConvertUToPtr %ptr_physical %no_address\nOpStore %p %u9 Aligned 4",
    "%p = OpConvertUToPtr %ptr_physical %no_address\n%v = OpAtomicIAdd %uint %p %u1 %u0 %u1",
    "%s = OpConvertUToPtr %ptr_physical_struct %no_address
     %p = OpAccessChain %ptr_physical %s %u1
     %v = OpLoad %uint %p Aligned 4
     out 0 %v",
    // Variables of the invocation.
    "OpStore %null_private %u9",
    "%v = OpLoad %uint %null_function\nout 0 %v",
    "%v = OpAtomicIAdd %uint %null_private %u1 %u0 %u1",
    "%p = OpAccessChain %ptr_Private_uint %null_numbers %u1 %u1\nOpStore %p %u9",
    "%p = OpAccessChain %ptr_Private_uint %null_numbers %u1 %odd_word\nOpStore %p %u9",
    "%p = OpAccessChain %ptr_Private_uint %numbers %u1 %u1
     %n = OpSelect %ptr_Private_uint %odd %null_private %p
     OpStore %n %u9",
];

#[test]
fn whatever_goes_through_null_traps() {
    for policy in [MemoryPolicy::Trap, MemoryPolicy::Robust] {
        for body in THROUGH_NULL {
            let whole = shader(body);
            let mut buffers = Vec::new();
            let error = text(&whole).run_with(&mut || {
                let (resources, cells) = resources(policy);
                buffers.push(cells);
                resources
            });
            let error = error.expect_err(body);
            assert_eq!(error.kind(), ErrorKind::Trap, "{body}: {}", error.render());
            assert!(error.render().contains("null pointer"), "{body}: {}", error.render());
            // Invocation 0 may have stored to its own, but nothing else changes.
            for cells in buffers {
                let (found, expected) = (cells.bytes(), self::cells().bytes());
                assert_eq!(found[4..], expected[4..], "{body}");
                assert!([7, 9].contains(&found[0]), "{body}");
            }
        }
    }
}

#[test]
fn null_leads_into_no_workgroup_memory() {
    let dispatch = |body: &str| {
        let compute = Workgroup {
            size: 1,
            interface: "%w0 %w1",
            declarations: "
                %ptr_shared = OpTypePointer Workgroup %uint
                %w0 = OpVariable %ptr_shared Workgroup
                %w1 = OpVariable %ptr_shared Workgroup
                %null = OpConstantNull %ptr_shared",
            body: &format!(
                "%o0 = OpAccessChain %ptr_uint %out %0 %0
                 %o1 = OpAccessChain %ptr_uint %out %0 %1
                 %o2 = OpAccessChain %ptr_uint %out %0 %2
                 OpStore %w0 %7
                 OpStore %w1 %8
                 {body}"
            ),
            ..Workgroup::default()
        }
        .compute();
        let out = Buffer::zeroed(12);
        let resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
        let done = compute.dispatch(&resources, [1, 1, 1]);
        done.map(|_| bytemuck::pod_collect_to_vec::<u8, u32>(&out.bytes()))
    };
    let compared = "
        %same = OpPtrEqual %bool %w0 %null
        %same_word = OpSelect %uint %same %1 %0
        OpStore %o0 %same_word
        %first = OpSelect %ptr_shared %same %null %w0
        %v0 = OpLoad %uint %first
        OpStore %o1 %v0
        %v1 = OpLoad %uint %w1
        OpStore %o2 %v1";
    assert_eq!(dispatch(compared).expect("no trap"), [0, 7, 8]);
    for body in [
        "OpStore %null %9",
        "%v = OpLoad %uint %null\nOpStore %o0 %v",
        "%v = OpAtomicIAdd %uint %null %1 %0 %1",
        "%same = OpPtrEqual %bool %w0 %null\n%p = OpSelect %ptr_shared %same %w0 %null\nOpStore %p %9",
    ] {
        let error = dispatch(body).expect_err(body);
        assert_eq!(error.message(), "an access through a null pointer", "{body}");
    }
}

/// Types, with constant indices to a `uint` in each and computed ones.
const POINTEES: &[(&str, &str, &str)] = &[
    ("uint", "", ""),
    ("uint4", "%u1", "%odd_word"),
    ("numbers", "%u2", "%odd_word"),
    ("parts", "%u1", "%u1"),
    ("nested", "%u1 %u3", "%u1 %odd_word"),
];

#[test]
fn null_of_every_type_in_every_storage_class_traps() {
    let classes = [
        ("StorageBuffer", ""),
        ("Uniform", ""),
        ("PushConstant", ""),
        ("ShaderRecordBufferKHR", ""),
        ("PhysicalStorageBuffer", " Aligned 4"),
        ("Private", ""),
        ("Function", ""),
    ];
    let annotations = "
        OpDecorate %numbers ArrayStride 4
        OpMemberDecorate %parts 0 Offset 0
        OpMemberDecorate %parts 1 Offset 4
        OpMemberDecorate %nested 0 Offset 0
        OpMemberDecorate %nested 1 Offset 4
        OpDecorate %held DescriptorSet 0
        OpDecorate %held Binding 1
        OpMemberDecorate %held_block 0 Offset 0
        OpDecorate %held_block Block";
    let mut number = 0;
    for (class, aligned) in classes {
        let writable = !matches!(class, "Uniform" | "PushConstant" | "ShaderRecordBufferKHR");
        for &(pointee, constant, computed) in POINTEES {
            // The prelude has some of the pointers' types.
            let (to_word, own_word) = match class {
                "StorageBuffer" | "Private" | "Function" => (format!("ptr_{class}_uint"), String::new()),
                _ => ("to_word".to_owned(), format!("%to_word = OpTypePointer {class} %uint")),
            };
            let (to_pointee, own_pointee) = match pointee {
                "uint" => (&*to_word, String::new()),
                "nested" if class == "Private" => ("ptr_first", String::new()),
                _ => ("to_pointee", format!("%to_pointee = OpTypePointer {class} %{pointee}")),
            };
            // A descriptor and a variable that the pointer of zeros would name.
            let declarations = format!(
                "%numbers = OpTypeArray %uint %u4
                 %parts = OpTypeStruct %float %uint
                 %nested = OpTypeStruct %float %numbers
                 %held_block = OpTypeStruct %nested
                 %ptr_held = OpTypePointer Uniform %held_block
                 %ptr_held_float = OpTypePointer Uniform %float
                 %held = OpVariable %ptr_held Uniform
                 %ptr_first = OpTypePointer Private %nested
                 %first = OpVariable %ptr_first Private
                 {own_word}
                 {own_pointee}
                 %nothing = OpConstantNull %{pointee}
                 %null = OpConstantNull %{to_pointee}"
            );
            let chain = |indices: &str| match indices {
                "" => format!("%p = OpCopyObject %{to_word} %null"),
                _ => format!("%p = OpAccessChain %{to_word} %null {indices}"),
            };
            let literals = constant.replace("%u", "");
            let part = match pointee {
                "uint" => "%part = OpCopyObject %uint %whole".to_owned(),
                _ => format!("%part = OpCompositeExtract %uint %whole {literals}"),
            };
            let mut bodies = vec![format!("%whole = OpLoad %{pointee} %null{aligned}\n{part}\nout 0 %part")];
            for indices in [constant, computed] {
                bodies.push(format!("{}\n%part = OpLoad %uint %p{aligned}\nout 0 %part", chain(indices)));
                if writable {
                    bodies.push(format!("{}\nOpStore %p %u9{aligned}", chain(indices)));
                }
            }
            if writable {
                bodies.push(format!("OpStore %null %nothing{aligned}"));
            }
            for body in bodies {
                number += 1;
                let body = format!(
                    "%odd_word = OpBitwiseAnd %uint %id %u1
                     %at = OpAccessChain %ptr_held_float %held %u0 %u0
                     %number = OpLoad %float %at
                     %start = OpConvertFToU %uint %number
                     %own = OpAccessChain %ptr_Private_uint %first %u1 %odd_word
                     OpStore %own %start
                     {body}
                     %end = OpLoad %uint %own
                     out 1 %end"
                );
                let error = Shader {
                    capabilities: "OpCapability VariablePointers\nOpCapability PhysicalStorageBufferAddresses",
                    annotations,
                    declarations: &declarations,
                    body: &body,
                    ..Shader::default()
                }
                .run_with(&mut || {
                    let bytes = Buffer::zeroed(64);
                    let resources = Resources::default().bind(0, 1, Descriptor::Buffer(bytes.clone()));
                    Resources { push_constants: Some(bytes), ..resources }
                });
                let error = error.map(|_| ()).expect_err(&body);
                assert_eq!(error.kind(), ErrorKind::Trap, "{class}: {body}: {}", error.render());
                assert_eq!(error.message(), "an access through a null pointer", "{class}: {body}");
            }
        }
    }
    assert_eq!(number, 4 * 5 * 6 + 3 * 5 * 3);
}

#[test]
fn null_is_no_hit_object() {
    let declarations = "
        %object = OpTypeHitObjectEXT
        %ptr_object = OpTypePointer Private %object
        %ptr_local = OpTypePointer Function %object
        %first = OpVariable %ptr_object Private
        %null_object = OpConstantNull %ptr_object
        %null_local = OpConstantNull %ptr_local";
    for null in ["null_object", "null_local"] {
        for body in [
            format!("OpHitObjectRecordEmptyEXT %{null}"),
            format!("%b = OpHitObjectIsEmptyEXT %bool %{null}\n%w = OpSelect %uint %b %u1 %u0\nout 0 %w"),
        ] {
            let body = format!("OpHitObjectRecordEmptyEXT %first\n{body}");
            let error = Shader {
                capabilities: "OpCapability ShaderInvocationReorderEXT\nOpCapability VariablePointers",
                declarations,
                body: &body,
                ..Shader::default()
            }
            .refused();
            assert_eq!(error.message(), "an access through a null pointer", "{body}: {}", error.render());
        }
    }
}
