//! Cooperative matrices (`SPV_KHR_cooperative_matrix`), in subgroups of each size that holds one.

use std::sync::Arc;

use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::math::float_format::FloatFormat;
use anyhit_engine::module::{Module, load};
use anyhit_engine::pipeline::Compute;
use half::f16;

use crate::support::assembly::assemble;

/// A compute shader of 64 invocations with a buffer of each scalar type at binding 0, which are one
/// memory, and the body of its entry point.
fn text(declarations: &str, variables: &str, body: &str) -> String {
    let scalars = [("half", 2), ("float", 4), ("int", 4), ("uint", 4), ("char", 1), ("uchar", 1)];
    let mut annotations = String::new();
    let mut buffers = String::new();
    for (scalar, bytes) in scalars {
        annotations += &format!(
            "OpDecorate %array_{scalar} ArrayStride {bytes}
             OpDecorate %block_{scalar} Block
             OpMemberDecorate %block_{scalar} 0 Offset 0
             OpDecorate %buffer_{scalar} DescriptorSet 0
             OpDecorate %buffer_{scalar} Binding 0\n"
        );
        buffers += &format!(
            "%array_{scalar} = OpTypeRuntimeArray %{scalar}
             %block_{scalar} = OpTypeStruct %array_{scalar}
             %ptr_block_{scalar} = OpTypePointer StorageBuffer %block_{scalar}
             %ptr_{scalar} = OpTypePointer StorageBuffer %{scalar}
             %buffer_{scalar} = OpVariable %ptr_block_{scalar} StorageBuffer\n"
        );
    }
    let constants: String = [0, 1, 2, 3, 4, 5, 8, 16, 32, 64, 128, 192, 256, 512, 1024]
        .map(|word| format!("%u{word} = OpConstant %uint {word}\n"))
        .concat();
    format!(
        "OpCapability Shader
         OpCapability Float16
         OpCapability Int8
         OpCapability CooperativeMatrixKHR
         OpCapability CooperativeMatrixConversionsNV
         OpCapability Float8EXT
         OpCapability Float8CooperativeMatrixEXT
         OpCapability BFloat16TypeKHR
         OpCapability BFloat16CooperativeMatrixKHR
         OpCapability VulkanMemoryModel
         OpExtension \"SPV_KHR_cooperative_matrix\"
         OpExtension \"SPV_NV_cooperative_matrix2\"
         OpExtension \"SPV_EXT_float8\"
         OpExtension \"SPV_KHR_bfloat16\"
         OpMemoryModel Logical Vulkan
         OpEntryPoint GLCompute %main \"main\"
         OpExecutionMode %main LocalSize 64 1 1
         {annotations}
         OpDecorate %index_variable BuiltIn LocalInvocationIndex
         OpDecorate %specialized SpecId 1
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %bool = OpTypeBool
         %half = OpTypeFloat 16
         %float = OpTypeFloat 32
         %int = OpTypeInt 32 1
         %uint = OpTypeInt 32 0
         %char = OpTypeInt 8 1
         %uchar = OpTypeInt 8 0
         {constants}
         %specialized = OpSpecConstant %uint 4
         {buffers}
         %ptr_index = OpTypePointer Input %uint
         %index_variable = OpVariable %ptr_index Input
         {declarations}
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         {variables}
         %index = OpLoad %uint %index_variable
         {body}
         OpReturn
         OpFunctionEnd"
    )
}

fn module(declarations: &str, variables: &str, body: &str) -> Result<Module> {
    load(&assemble(&text(declarations, variables, body)))
}

/// Runs one workgroup in subgroups of a size; returns what it leaves in the buffer.
fn run_module(module: Module, size: u32, memory: &[u8]) -> Result<Vec<u8>> {
    let module = Arc::new(module);
    let program = anyhit_engine::program::lower(&module, &module.entry_points[0])?;
    let buffer = Buffer::new(memory);
    let resources = Resources::default().bind(0, 0, Descriptor::Buffer(buffer.clone()));
    let compute = Compute::new(program)?.subgroup_size(size)?;
    compute.dispatch(&resources, [1; 3])?;
    let optimised = buffer.bytes();
    let buffer = Buffer::new(memory);
    let resources = Resources::default().bind(0, 0, Descriptor::Buffer(buffer.clone()));
    compute.unoptimized()?.dispatch(&resources, [1; 3])?;
    assert_eq!(optimised, buffer.bytes(), "the optimiser changes results");
    Ok(optimised)
}

const SIZES: [u32; 4] = [8, 16, 32, 64];

/// What a shader leaves in the buffer, the same with every size of subgroups.
fn run_with(declarations: &str, variables: &str, body: &str, memory: &[u8]) -> Vec<u8> {
    let run = |size| {
        let left = module(declarations, variables, body).and_then(|module| run_module(module, size, memory));
        left.unwrap_or_else(|error| panic!("{}", error.render()))
    };
    let all = SIZES.map(run);
    assert!(all.iter().all(|left| *left == all[0]), "the sizes of subgroups leave different memory");
    all[0].clone()
}

fn refused(declarations: &str, body: &str) -> Error {
    let done = module(declarations, "", body).and_then(|module| run_module(module, 32, &[0; 64]));
    done.expect_err("the shader runs, though it should not")
}

fn number(at: usize) -> f32 {
    let value = ((at * 37 + 11) % 101) as f32 - 50.0;
    f16::from_f32(value * [0.015625, 0.25, 1.0, 3.1][at % 4]).to_f32()
}

fn halves(numbers: impl IntoIterator<Item = f32>) -> Vec<u8> {
    numbers.into_iter().flat_map(|number| f16::from_f32(number).to_le_bytes()).collect()
}

fn singles(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
}

const HALF_TYPES: &str = "
    %matrix_a = OpTypeCooperativeMatrixKHR %half %u3 %u16 %u8 %u0
    %matrix_b = OpTypeCooperativeMatrixKHR %half %u3 %u8 %u4 %u1
    %matrix_c = OpTypeCooperativeMatrixKHR %float %u3 %u16 %u4 %u2
    %matrix_h = OpTypeCooperativeMatrixKHR %half %u3 %u16 %u4 %u2";

/// A is 16 x 8 row by row at 0, B is 8 x 4 column by column at 256, with 16 halves from one column
/// to the next, and C is 16 x 4 at 512. The result follows.
#[test]
fn products_sum_in_f32_and_round_once() {
    let a: Vec<f32> = (0..128).map(number).collect();
    let b: Vec<f32> = (0..32).map(|at| number(at * 3 + 1)).collect();
    let c: Vec<f32> = (0..64).map(|at| number(at * 5) * 1.01).collect();
    let mut memory = halves(a.iter().copied());
    for column in 0..4 {
        memory.extend(halves((0..8).map(|row| b[row * 4 + column])));
        memory.resize(256 + (column + 1) * 32, 0xFF);
    }
    memory.resize(512, 0xFF);
    memory.extend(c.iter().flat_map(|number| number.to_le_bytes()));
    memory.resize(1280, 0);
    let body = "
        %pointer_a = OpAccessChain %ptr_half %buffer_half %u0 %u0
        %pointer_b = OpAccessChain %ptr_half %buffer_half %u0 %u128
        %pointer_c = OpAccessChain %ptr_float %buffer_float %u0 %u128
        %pointer_d = OpAccessChain %ptr_float %buffer_float %u0 %u192
        %pointer_h = OpAccessChain %ptr_half %buffer_half %u0 %u512
        %a = OpCooperativeMatrixLoadKHR %matrix_a %pointer_a %u0 %u8 None
        %b = OpCooperativeMatrixLoadKHR %matrix_b %pointer_b %u1 %u16 None
        %c = OpCooperativeMatrixLoadKHR %matrix_c %pointer_c %u0 %u4 None
        %d = OpCooperativeMatrixMulAddKHR %matrix_c %a %b %c
        %h = OpCooperativeMatrixMulAddKHR %matrix_h %a %b %c
        OpCooperativeMatrixStoreKHR %pointer_d %d %u0 %u4 None
        OpCooperativeMatrixStoreKHR %pointer_h %h %u1 %u16 None";
    let left = run_with(HALF_TYPES, "", body, &memory);
    for row in 0..16 {
        for column in 0..4 {
            let sum =
                (0..8).fold(0f32, |sum, k| sum + a[row * 8 + k] * b[k * 4 + column]) + c[row * 4 + column];
            let found = singles(&left[768..1024])[row * 4 + column];
            assert_eq!(found, sum, "row {row}, column {column}");
            // Column by column, from 1024 on.
            let at = 1024 + (column * 16 + row) * 2;
            let found = f16::from_le_bytes(left[at..at + 2].try_into().unwrap());
            assert_eq!(found, f16::from_f32(sum), "row {row}, column {column} as f16");
        }
    }
}

#[test]
fn integers_are_extended_wrapped_and_saturated() {
    let declarations = "
        %matrix_a = OpTypeCooperativeMatrixKHR %char %u3 %u8 %u16 %u0
        %matrix_b = OpTypeCooperativeMatrixKHR %uchar %u3 %u16 %u8 %u1
        %matrix_c = OpTypeCooperativeMatrixKHR %int %u3 %u8 %u8 %u2
        %large = OpConstant %int 2147483000
        %addend = OpConstantComposite %matrix_c %large
        %zero = OpConstantNull %matrix_c";
    // A (1), C (4) and the result (8) are signed; the sum with C saturates (16).
    let body = "
        %pointer_a = OpAccessChain %ptr_char %buffer_char %u0 %u0
        %pointer_b = OpAccessChain %ptr_uchar %buffer_uchar %u0 %u128
        %pointer_c = OpAccessChain %ptr_int %buffer_int %u0 %u64
        %pointer_d = OpAccessChain %ptr_int %buffer_int %u0 %u128
        %pointer_e = OpAccessChain %ptr_int %buffer_int %u0 %u256
        %a = OpCooperativeMatrixLoadKHR %matrix_a %pointer_a %u0 %u16 None
        %b = OpCooperativeMatrixLoadKHR %matrix_b %pointer_b %u0 %u8 None
        %c = OpCooperativeMatrixMulAddKHR %matrix_c %a %b %addend 13
        %d = OpCooperativeMatrixMulAddKHR %matrix_c %a %b %addend 29
        %e = OpCooperativeMatrixMulAddKHR %matrix_c %a %b %zero
        OpCooperativeMatrixStoreKHR %pointer_c %c %u0 %u8 None
        OpCooperativeMatrixStoreKHR %pointer_d %d %u0 %u8 None
        OpCooperativeMatrixStoreKHR %pointer_e %e %u0 %u8 None";
    let mut memory: Vec<u8> = (0..256).map(|at| (at * 89 + 7) as u8).collect();
    memory.resize(1280, 0);
    let left = run_with(declarations, "", body, &memory);
    let word = |at: usize| i32::from_le_bytes(left[at..at + 4].try_into().unwrap());
    for row in 0..8 {
        for column in 0..8 {
            let b = |k: usize| i64::from(memory[128 + k * 8 + column]);
            let a = |k: usize| memory[row * 16 + k];
            let signed: i64 = (0..16).map(|k| i64::from(a(k) as i8) * b(k)).sum();
            let unsigned: i64 = (0..16).map(|k| i64::from(a(k)) * b(k)).sum();
            let at = (row * 8 + column) * 4;
            let sum = signed + 2_147_483_000;
            assert_eq!(word(256 + at), sum as i32, "row {row}, column {column}");
            assert_eq!(i64::from(word(512 + at)), sum.min(i32::MAX.into()), "row {row}, column {column}");
            assert_eq!(i64::from(word(1024 + at)), unsigned, "row {row}, column {column}");
        }
    }
}

#[test]
fn components_are_computed_with_one_by_one() {
    let declarations = format!(
        "{HALF_TYPES}
         %ptr_variable = OpTypePointer Function %matrix_c
         %ptr_part = OpTypePointer Function %float
         %ptr_counter = OpTypePointer Function %uint
         %three = OpConstant %float 3.0
         %quarter = OpConstant %float 0.25
         %half_two = OpConstant %half 2h"
    );
    let variables = "
        %variable = OpVariable %ptr_variable Function
        %counter = OpVariable %ptr_counter Function";
    // (x / 4 - 3) (-x), then twice that as f16, and 1 more than each component.
    let body = "
        %pointer = OpAccessChain %ptr_float %buffer_float %u0 %u0
        %x = OpCooperativeMatrixLoadKHR %matrix_c %pointer %u0 %u4 None
        %threes = OpCompositeConstruct %matrix_c %three
        %scaled = OpMatrixTimesScalar %matrix_c %x %quarter
        %difference = OpFSub %matrix_c %scaled %threes
        %minus = OpFNegate %matrix_c %x
        %product = OpFMul %matrix_c %difference %minus
        %narrow = OpFConvert %matrix_h %product
        %twos = OpCompositeConstruct %matrix_h %half_two
        %twice = OpFMul %matrix_h %narrow %twos
        %wide = OpFConvert %matrix_c %twice
        OpStore %variable %wide
        OpStore %counter %u0
        %one = OpConvertUToF %float %u1
        %length = OpCooperativeMatrixLengthKHR %uint %matrix_c
        OpBranch %head
        %head = OpLabel
        %at = OpLoad %uint %counter
        %goes_on = OpULessThan %bool %at %length
        OpLoopMerge %end %continue None
        OpBranchConditional %goes_on %loop %end
        %loop = OpLabel
        %part = OpAccessChain %ptr_part %variable %at
        %value = OpLoad %float %part
        %more = OpFAdd %float %value %one
        OpStore %part %more
        OpBranch %continue
        %continue = OpLabel
        %next = OpIAdd %uint %at %u1
        OpStore %counter %next
        OpBranch %head
        %end = OpLabel
        %result = OpLoad %matrix_c %variable
        OpCooperativeMatrixStoreKHR %pointer %result %u0 %u4 None";
    let numbers: Vec<f32> = (0..64).map(|at| number(at * 7) / 8.0).collect();
    let memory: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    let left = run_with(&declarations, variables, body, &memory);
    for (at, (found, x)) in singles(&left).into_iter().zip(numbers).enumerate() {
        let narrow = f16::from_f32((x * 0.25 - 3.0) * -x);
        let expected = (narrow * f16::from_f32(2.0)).to_f32() + 1.0;
        assert_eq!(found, expected, "{at}");
    }
}

/// Component e belongs to invocation e % S, as its component e / S.
#[test]
fn components_are_spread_over_the_subgroup() {
    let declarations = format!("{HALF_TYPES}\n%matrix_i = OpTypeCooperativeMatrixKHR %uint %u3 %u16 %u8 %u2");
    // Each invocation stores its first component, its last one and the number of them.
    let body = "
        %pointer = OpAccessChain %ptr_uint %buffer_uint %u0 %u0
        %x = OpCooperativeMatrixLoadKHR %matrix_i %pointer %u0 %u8 None
        %length = OpCooperativeMatrixLengthKHR %uint %matrix_i
        %first = OpCompositeExtract %uint %x 0
        %second = OpCompositeExtract %uint %x 1
        %start = OpIMul %uint %index %u3
        %at_first = OpIAdd %uint %start %u128
        %at_second = OpIAdd %uint %at_first %u1
        %at_length = OpIAdd %uint %at_first %u2
        %out_first = OpAccessChain %ptr_uint %buffer_uint %u0 %at_first
        %out_second = OpAccessChain %ptr_uint %buffer_uint %u0 %at_second
        %out_length = OpAccessChain %ptr_uint %buffer_uint %u0 %at_length
        OpStore %out_first %first
        OpStore %out_second %second
        OpStore %out_length %length";
    let mut memory: Vec<u8> = (0..128u32).flat_map(u32::to_le_bytes).collect();
    memory.resize(512 + 64 * 12, 0);
    for size in SIZES {
        let module = module(&declarations, "", body).expect("a module");
        let left = run_module(module, size, &memory).unwrap_or_else(|error| panic!("{}", error.render()));
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&left[512..]);
        for (index, words) in words.as_chunks::<3>().0.iter().enumerate() {
            let id = index as u32 % size;
            assert_eq!(*words, [id, id + size, 128 / size], "invocation {index}, subgroups of {size}");
        }
    }
}

#[test]
fn shared_memory_and_specialized_shapes() {
    let declarations = "
        %shared_array = OpTypeArray %half %u64
        %ptr_shared = OpTypePointer Workgroup %shared_array
        %ptr_shared_half = OpTypePointer Workgroup %half
        %shared = OpVariable %ptr_shared Workgroup
        %matrix = OpTypeCooperativeMatrixKHR %half %u3 %specialized %u8 %u2";
    // The matrix goes through shared memory and comes back transposed.
    let body = "
        %pointer = OpAccessChain %ptr_half %buffer_half %u0 %u0
        %back = OpAccessChain %ptr_half %buffer_half %u0 %u64
        %middle = OpAccessChain %ptr_shared_half %shared %u0
        %x = OpCooperativeMatrixLoadKHR %matrix %pointer %u0 %u8 None
        OpCooperativeMatrixStoreKHR %middle %x %u1 %specialized None
        OpControlBarrier %u2 %u2 %u0
        %y = OpCooperativeMatrixLoadKHR %matrix %middle %u1 %specialized None
        OpCooperativeMatrixStoreKHR %back %y %u1 %specialized None";
    let memory = halves((0..128).map(|at| at as f32));
    for rows in [4, 8] {
        for size in SIZES {
            let mut module = module(declarations, "", body).expect("a module");
            module.specialize(1, rows as u32).expect("a constant");
            let left = run_module(module, size, &memory).unwrap_or_else(|error| panic!("{}", error.render()));
            let mut expected: Vec<f32> = (0..128).map(|at| at as f32).collect();
            for row in 0..rows {
                for column in 0..8 {
                    expected[64 + column * rows + row] = (row * 8 + column) as f32;
                }
            }
            assert_eq!(left, halves(expected), "{rows} rows, subgroups of {size}");
        }
    }
}

#[test]
fn accumulators_become_factors_and_are_transposed() {
    let declarations = format!(
        "{HALF_TYPES}
         %factor = OpTypeCooperativeMatrixKHR %half %u3 %u16 %u4 %u0
         %transposed = OpTypeCooperativeMatrixKHR %half %u3 %u4 %u16 %u1"
    );
    let body = "
        %pointer = OpAccessChain %ptr_half %buffer_half %u0 %u0
        %first = OpAccessChain %ptr_half %buffer_half %u0 %u64
        %second = OpAccessChain %ptr_half %buffer_half %u0 %u128
        %x = OpCooperativeMatrixLoadKHR %matrix_h %pointer %u0 %u4 None
        %y = OpCooperativeMatrixConvertNV %factor %x
        %z = OpCooperativeMatrixTransposeNV %transposed %x
        OpCooperativeMatrixStoreKHR %first %y %u0 %u4 None
        OpCooperativeMatrixStoreKHR %second %z %u0 %u16 None";
    let mut numbers: Vec<f32> = (0..64).map(|at| at as f32).chain([0.0; 128]).collect();
    let left = run_with(&declarations, "", body, &halves(numbers.iter().copied()));
    for row in 0..16 {
        for column in 0..4 {
            numbers[64 + row * 4 + column] = (row * 4 + column) as f32;
            numbers[128 + column * 16 + row] = (row * 4 + column) as f32;
        }
    }
    assert_eq!(left, halves(numbers));
}

#[test]
fn small_floats_are_exact_factors() {
    let declarations = "
        %e4m3 = OpTypeFloat 8 4214
        %bfloat = OpTypeFloat 16 0
        %matrix_a = OpTypeCooperativeMatrixKHR %e4m3 %u3 %u4 %u8 %u0
        %matrix_b = OpTypeCooperativeMatrixKHR %bfloat %u3 %u8 %u4 %u1
        %matrix_c = OpTypeCooperativeMatrixKHR %float %u3 %u4 %u4 %u2
        %none = OpConstantNull %matrix_c";
    let body = "
        %pointer_a = OpAccessChain %ptr_uchar %buffer_uchar %u0 %u0
        %pointer_b = OpAccessChain %ptr_half %buffer_half %u0 %u16
        %pointer_c = OpAccessChain %ptr_float %buffer_float %u0 %u32
        %a = OpCooperativeMatrixLoadKHR %matrix_a %pointer_a %u0 %u8 None
        %b = OpCooperativeMatrixLoadKHR %matrix_b %pointer_b %u0 %u4 None
        %c = OpCooperativeMatrixMulAddKHR %matrix_c %a %b %none
        OpCooperativeMatrixStoreKHR %pointer_c %c %u0 %u4 None";
    let (e4m3, bfloat) = (FloatFormat::E4M3, FloatFormat::BFloat16);
    let a: Vec<u8> = (0..32).map(|at| e4m3.round((f64::from(at) - 15.0) * 0.375) as u8).collect();
    let b: Vec<u16> = (0..32).map(|at| bfloat.round(f64::from(at) * 0.7 - 9.0) as u16).collect();
    let mut memory = a.clone();
    memory.extend(b.iter().flat_map(|bits| bits.to_le_bytes()));
    memory.resize(192, 0);
    let left = run_with(declarations, "", body, &memory);
    let found = singles(&left[128..]);
    for row in 0..4 {
        for column in 0..4 {
            let product = |k: usize| {
                e4m3.value(a[row * 8 + k].into()) as f32 * bfloat.value(b[k * 4 + column].into()) as f32
            };
            let sum = (0..8).fold(0f32, |sum, k| sum + product(k));
            assert_eq!(found[row * 4 + column], sum, "row {row}, column {column}");
        }
    }
}

#[test]
fn what_does_not_run_is_refused() {
    let undefined = "
        %a = OpUndef %matrix_a
        %b = OpUndef %matrix_b
        %c = OpUndef %matrix_c
        %pointer = OpAccessChain %ptr_half %buffer_half %u0 %u0\n";
    for (instruction, message) in [
        ("%x = OpCooperativeMatrixMulAddKHR %matrix_c %b %a %c", "A is declared for the use MatrixBKHR"),
        ("%x = OpCooperativeMatrixMulAddKHR %matrix_c %a %wrong %c", "16x8 times 16x4 plus 16x4 is not 16x4"),
        ("%x = OpCooperativeMatrixLoadKHR %matrix_a %pointer %u0", "requires Stride"),
        ("%x = OpCooperativeMatrixLoadKHR %matrix_a %pointer %u5 %u8", "5 is not a layout"),
        (
            "%x = OpCooperativeMatrixLoadKHR %float %pointer %u0 %u8",
            "a cooperative matrix is required, not float",
        ),
        (
            "%x = OpFMod %matrix_a %a %a",
            "OpFMod is not defined for cooperative matrices, such as coopmat<float16_t, 16, 8>",
        ),
        ("%x = OpFConvert %matrix_c %a", "which differ in scope, shape or use"),
        ("%x = OpCooperativeMatrixTransposeNV %matrix_c %c", "to a matrix B of the transposed shape"),
        ("%x = OpCooperativeMatrixConvertNV %matrix_b %c", "the operand must be an accumulator"),
        (
            "%x = OpCooperativeMatrixLoadKHR %workgroup %pointer %u0 %u8",
            "of scope Workgroup is not supported",
        ),
        (
            "%x = OpCooperativeMatrixLoadKHR %vast %pointer %u0 %u8",
            "1024 rows and 8 columns is not supported",
        ),
    ] {
        let declarations = format!(
            "{HALF_TYPES}
             %matrix_w = OpTypeCooperativeMatrixKHR %half %u3 %u16 %u4 %u1
             %workgroup = OpTypeCooperativeMatrixKHR %half %u2 %u16 %u4 %u1
             %vast = OpTypeCooperativeMatrixKHR %half %u3 %u1024 %u8 %u1
             %wrong = OpUndef %matrix_w"
        );
        let error = refused(&declarations, &format!("{undefined}{instruction}"));
        let text = error.render();
        assert!(text.contains(message), "{instruction}: {text}");
        assert!(matches!(error.kind(), ErrorKind::InvalidModule | ErrorKind::UnsupportedModule), "{text}");
    }
}

#[test]
fn matrices_outside_their_buffer_trap_and_small_subgroups_are_refused() {
    let body = "
        %pointer = OpAccessChain %ptr_half %buffer_half %u0 %u4
        %x = OpCooperativeMatrixLoadKHR %matrix_a %pointer %u0 %u8 None
        OpCooperativeMatrixStoreKHR %pointer %x %u0 %u8 None";
    let run = |size: u32, bytes: usize| {
        run_module(module(HALF_TYPES, "", body).expect("a module"), size, &vec![0; bytes])
    };
    // 16 rows of 16 bytes, from 8 on.
    assert!(run(32, 264).is_ok());
    let text = run(32, 263).expect_err("a trap").render();
    assert!(text.contains("256 bytes at offset 8 of"), "{text}");
    let error = run(4, 264).expect_err("a small subgroup");
    assert_eq!(error.kind(), ErrorKind::InvalidArgument);
    assert!(error.to_string().contains("subgroups of at least 8 invocations"), "{error}");
}
