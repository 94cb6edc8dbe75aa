//! Cooperative vectors (`SPV_NV_cooperative_vector`).
//!
//! Expected products are sums of f32 in the documented order, of numbers that the `half` crate
//! converts ([the rules](../../../docs/cooperative.md)).

use std::sync::Arc;

use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::math::float_format::FloatFormat;
use anyhit_engine::module::{Module, load};
use anyhit_engine::program::LowerOptions;
use half::f16;

use crate::execution::instructions::run::{INVOCATIONS, Shader};
use crate::execution::instructions::workgroup::compute as compute_shader;
use crate::support::assembly::assemble;

const CAPABILITIES: &str = "
    OpCapability CooperativeVectorNV
    OpCapability CooperativeVectorTrainingNV
    OpCapability ReplicatedCompositesEXT
    OpExtension \"SPV_NV_cooperative_vector\"
    OpExtension \"SPV_EXT_replicated_composites\"";
const ANNOTATIONS: &str = "
    OpDecorate %bytes ArrayStride 2
    OpDecorate %block Block
    OpMemberDecorate %block 0 Offset 0
    OpDecorate %buffer DescriptorSet 0
    OpDecorate %buffer Binding 1
    OpDecorate %inputs DescriptorSet 0
    OpDecorate %inputs Binding 2";
/// Buffers of f16, and the numbers of component types and layouts.
const DECLARATIONS: &str = "
    %char = OpTypeInt 8 1
    %bytes = OpTypeRuntimeArray %half
    %block = OpTypeStruct %bytes
    %ptr_block = OpTypePointer StorageBuffer %block
    %ptr_bytes = OpTypePointer StorageBuffer %bytes
    %buffer = OpVariable %ptr_block StorageBuffer
    %inputs = OpVariable %ptr_block StorageBuffer
    %s8_packed = OpConstant %uint 1000491000
    %u8_packed = OpConstant %uint 1000491001
    %e4m3 = OpConstant %uint 1000491002
    %e5m2 = OpConstant %uint 1000491003
    %u40 = OpConstant %uint 40
    %u64 = OpConstant %uint 64
    %u1000 = OpConstant %uint 1000
    %h_third = OpConstant %half 0.333h
    %half1 = OpTypeVectorIdEXT %half %u1
    %half5 = OpTypeVectorIdEXT %half %u5
    %half7 = OpTypeVectorIdEXT %half %u7
    %float5 = OpTypeVectorIdEXT %float %u5
    %float7 = OpTypeVectorIdEXT %float %u7
    %uint5 = OpTypeVectorIdEXT %uint %u5
    %int5 = OpTypeVectorIdEXT %int %u5
    %int7 = OpTypeVectorIdEXT %int %u7
    %char7 = OpTypeVectorIdEXT %char %u7
    %uint_2 = OpTypeVectorIdEXT %uint %u2
    %ptr_half7 = OpTypePointer Function %half7
    %ptr_half = OpTypePointer Function %half";

fn shader(body: &str) -> Shader<'_> {
    Shader {
        capabilities: CAPABILITIES,
        annotations: ANNOTATIONS,
        declarations: DECLARATIONS,
        body,
        ..Shader::default()
    }
}

/// Runs a shader at every width; returns the words of the invocations and the bytes of the buffer.
fn run_shader(shader: &Shader<'_>, buffer: &[u8], inputs: &[u8]) -> (Vec<[u32; 16]>, Vec<u8>) {
    let mut made: Vec<Arc<Buffer>> = Vec::new();
    let found = shader.run_with(&mut || {
        let own = Buffer::new(buffer);
        made.push(own.clone());
        let resources = Resources::default().bind(0, 1, Descriptor::Buffer(own));
        resources.bind(0, 2, Descriptor::Buffer(Buffer::new(inputs)))
    });
    let found = found.unwrap_or_else(|error| panic!("{}", error.render()));
    let left: Vec<_> = made.iter().map(|buffer| buffer.bytes()).collect();
    assert!(left.iter().all(|bytes| *bytes == left[0]), "the widths leave different memory");
    (found, left[0].clone())
}

fn run(body: &str, buffer: &[u8], inputs: &[u8]) -> (Vec<[u32; 16]>, Vec<u8>) {
    run_shader(&shader(body), buffer, inputs)
}

/// Numbers of many sizes, with few enough bits that f16 has most of them.
fn number(at: usize) -> f32 {
    let value = ((at * 37 + 11) % 101) as f32 - 50.0;
    f16::from_f32(value * [0.015625, 0.25, 1.0, 3.1][at % 4]).to_f32()
}

fn halves(numbers: impl IntoIterator<Item = f32>) -> Vec<u8> {
    numbers.into_iter().flat_map(|number| f16::from_f32(number).to_le_bytes()).collect()
}

fn half_bits(number: f32) -> u32 {
    f16::from_f32(number).to_bits().into()
}

/// `out` lines for the components of a vector of f16.
fn out_halves(vector: &str, count: usize) -> String {
    let line = |at: usize| {
        format!(
            "%part_{at} = OpCompositeExtract %half {vector} {at}
             %short_{at} = OpBitcast %ushort %part_{at}
             %word_{at} = OpUConvert %uint %short_{at}
             out {at} %word_{at}\n"
        )
    };
    (0..count).map(line).collect()
}

/// `out` lines for the components of a vector of a type of 32 bits.
fn out_words(vector: &str, ty: &str, count: usize) -> String {
    let line = |at: usize| {
        format!(
            "%part_{at} = OpCompositeExtract {ty} {vector} {at}
             %word_{at} = OpBitcast %uint %part_{at}
             out {at} %word_{at}\n"
        )
    };
    // OpBitcast from uint to uint is no conversion.
    let text: String = (0..count).map(line).collect();
    if ty == "%uint" { text.replace("OpBitcast", "OpCopyObject") } else { text }
}

/// The sum of products in ascending order, then the bias, all in f32.
fn product(matrix: &[Vec<f32>], vector: &[f32], bias: Option<&[f32]>) -> Vec<f32> {
    let row = |(at, row): (usize, &Vec<f32>)| {
        let sum = row.iter().zip(vector).fold(0f32, |sum, (a, x)| sum + a * x);
        bias.map_or(sum, |bias| sum + bias[at])
    };
    matrix.iter().enumerate().map(row).collect()
}

/// A matrix of 5 rows and 7 columns.
fn matrix() -> Vec<Vec<f32>> {
    (0..5).map(|row| (0..7).map(|column| number(row * 7 + column)).collect()).collect()
}

fn input(id: usize) -> Vec<f32> {
    (0..7).map(|at| number(id * 5 + at * 3)).collect()
}

/// The vectors of all invocations, 16 bytes each.
fn inputs() -> Vec<u8> {
    halves((0..INVOCATIONS).flat_map(|id| input(id).into_iter().chain([0.0])))
}

/// The bytes of rows, each padded to so many of them.
fn rows(matrix: &[Vec<f32>], stride: usize) -> Vec<u8> {
    let row = |row: &Vec<f32>| {
        let mut bytes = halves(row.iter().copied());
        bytes.resize(stride, 0xFF);
        bytes
    };
    matrix.iter().flat_map(row).collect()
}

fn transposed(matrix: &[Vec<f32>]) -> Vec<Vec<f32>> {
    (0..matrix[0].len()).map(|column| matrix.iter().map(|row| row[column]).collect()).collect()
}

const LOAD_INPUT: &str = "
    %matrix = OpAccessChain %ptr_bytes %buffer %u0
    %vectors = OpAccessChain %ptr_bytes %inputs %u0
    %input_offset = OpIMul %uint %id %u16
    %x = OpCooperativeVectorLoadNV %half7 %vectors %input_offset None\n";

#[test]
fn vectors_are_loaded_computed_with_and_stored() {
    let body = format!(
        "{LOAD_INPUT}
         %array = OpAccessChain %ptr_bytes %buffer %u0
         %third = OpCompositeConstructReplicateEXT %half7 %h_third
         %sum = OpFAdd %half7 %x %third
         %product = OpFMul %half7 %sum %x
         %scaled = OpVectorTimesScalar %half7 %product %h_third
         %minus = OpFNegate %half7 %scaled
         %zero = OpConvertUToF %half %u0
         %zeros = OpCompositeConstruct %half7 %zero %zero %zero %zero %zero %zero %zero
         %relu = OpExtInst %half7 %glsl FMax %minus %zeros
         OpCooperativeVectorStoreNV %array %input_offset %relu None
         %picked_at = OpUMod %uint %id %u7
         %picked = OpVectorExtractDynamic %half %relu %picked_at
         %put = OpVectorInsertDynamic %half7 %x %picked %u3
         %inserted = OpCompositeInsert %half7 %h_third %put 6
         {}",
        out_halves("%inserted", 7)
    );
    let (found, left) = run(&body, &vec![0; INVOCATIONS * 16], &inputs());
    let third = f16::from_f32(0.333);
    for (id, words) in found.iter().enumerate() {
        let x: Vec<f16> = input(id).into_iter().map(f16::from_f32).collect();
        // Each operation rounds to f16.
        let relu = |x: &f16| (-((*x + third) * *x * third)).max(f16::ZERO);
        let relus: Vec<f16> = x.iter().map(relu).collect();
        let mut expected: Vec<u32> = x.iter().map(|x| x.to_bits().into()).collect();
        expected[3] = relus[id % 7].to_bits().into();
        expected[6] = third.to_bits().into();
        assert_eq!(words[..7], expected[..], "{id}");
        let stored: Vec<u8> = relus.iter().flat_map(|relu| relu.to_le_bytes()).collect();
        assert_eq!(left[id * 16..][..14], stored[..], "{id}");
    }
}

#[test]
fn functions_variables_and_phis_hold_vectors() {
    let body = format!(
        "{LOAD_INPUT}
         OpStore %variable %x
         %element = OpAccessChain %ptr_half %variable %u2
         OpStore %element %h_third
         %changed = OpLoad %half7 %variable
         %odd = OpBitwiseAnd %uint %id %u1
         %is_odd = OpIEqual %bool %odd %u1
         OpSelectionMerge %end None
         OpBranchConditional %is_odd %yes %end
         %yes = OpLabel
         %doubled = OpFunctionCall %half7 %double_it %changed
         OpBranch %end
         %end = OpLabel
         %either = OpPhi %half7 %changed %entry %doubled %yes
         %undefined = OpUndef %half7
         {}",
        out_halves("%either", 7)
    );
    let shader = Shader {
        declarations: &format!("{DECLARATIONS}\n%double_type = OpTypeFunction %half7 %half7"),
        variables: "%variable = OpVariable %ptr_half7 Function",
        functions: "
            %double_it = OpFunction %half7 None %double_type
            %parameter = OpFunctionParameter %half7
            %double_entry = OpLabel
            %double_sum = OpFAdd %half7 %parameter %parameter
            OpReturnValue %double_sum
            OpFunctionEnd",
        ..shader(&body)
    };
    let (found, _) = run_shader(&shader, &[0; 4], &inputs());
    for (id, words) in found.iter().enumerate() {
        let mut expected = input(id);
        expected[2] = f16::from_f32(0.333).to_f32();
        // Twice a f16 is exact.
        let factor = if id % 2 == 1 { 2.0 } else { 1.0 };
        let expected: Vec<u32> = expected.into_iter().map(|x| half_bits(factor * x)).collect();
        assert_eq!(words[..7], expected[..], "{id}");
    }
}

#[test]
fn conversions_bit_instructions_and_extended_instructions_go_by_component() {
    let body = format!(
        "{LOAD_INPUT}
         %wide = OpFConvert %float7 %x
         %ints = OpConvertFToS %int7 %wide
         %twos = OpCompositeConstructReplicateEXT %int7 %u2_int
         %shifted = OpShiftLeftLogical %int7 %ints %twos
         %inverse = OpNot %int7 %shifted
         %least = OpExtInst %int7 %glsl SMin %inverse %ints
         %difference = OpISub %int7 %least %twos
         %back = OpConvertSToF %float7 %difference
         %fma = OpExtInst %float7 %glsl Fma %back %wide %wide
         {}",
        out_words("%fma", "%float", 7)
    );
    let shader =
        Shader { declarations: &format!("{DECLARATIONS}\n%u2_int = OpConstant %int 2"), ..shader(&body) };
    let (found, _) = run_shader(&shader, &[0; 4], &inputs());
    for (id, words) in found.iter().enumerate() {
        for (at, x) in input(id).into_iter().enumerate() {
            let int = x as i32;
            let back = ((!(int << 2)).min(int) - 2) as f32;
            // The sum and the product of so small numbers are exact in f64.
            let expected = (f64::from(back) * f64::from(x) + f64::from(x)) as f32;
            assert_eq!(f32::from_bits(words[at]), expected, "{id} {at}");
        }
    }
}

/// What the layouts of one matrix have in common: `y = A x` and `A x + b` in f16.
#[test]
fn products_of_halves_sum_in_f32_and_round_once() {
    let matrix = matrix();
    let bias: Vec<f32> = (0..5).map(|at| number(at + 90)).collect();
    // The memory of the matrix, its layout, whether it is transposed, and its stride.
    let packed = rows(&matrix, 14);
    let layouts = [
        (rows(&matrix, 16), "%u0", "%false", "%u16"),
        (rows(&transposed(&matrix), 12), "%u1", "%false", "%u12"),
        (packed.clone(), "%u2", "%false", "%u0"),
        (packed, "%u3", "%false", "%u0"),
        (rows(&transposed(&matrix), 10), "%u2", "%true", "%u0"),
        (rows(&transposed(&matrix), 10), "%u3", "%true", "%u0"),
    ];
    for (bytes, layout, transpose, stride) in layouts {
        // The matrix lies at 4, the bias behind it.
        let bias_offset = bytes.len() + 4;
        let memory = [&[0xFF; 4][..], &bytes, &halves(bias.iter().copied())].concat();
        let declarations = format!("{DECLARATIONS}\n%bias_offset = OpConstant %uint {bias_offset}");
        for has_bias in [false, true] {
            let (name, operand) = match has_bias {
                true => ("MulAdd", "%matrix %bias_offset %u0"),
                false => ("Mul", ""),
            };
            let body = format!(
                "{LOAD_INPUT}
                 %y = OpCooperativeVectorMatrix{name}NV %half5 %x %u0 %matrix %u4 %u0 {operand} %u5 %u7 {layout} \
                 {transpose} {stride}
                 {}",
                out_halves("%y", 5)
            );
            let shader = Shader { declarations: &declarations, ..shader(&body) };
            let (found, _) = run_shader(&shader, &memory, &inputs());
            for (id, words) in found.iter().enumerate() {
                let expected = product(&matrix, &input(id), has_bias.then_some(&bias));
                let expected: Vec<u32> = expected.into_iter().map(half_bits).collect();
                assert_eq!(words[..5], expected[..], "{id}, layout {layout}, {transpose}, bias: {has_bias}");
            }
        }
    }
}

/// Each invocation has a matrix of its own, with a stride that is known at run time only.
#[test]
fn matrices_offsets_and_strides_may_differ_between_invocations() {
    let body = format!(
        "{LOAD_INPUT}
         %kind = OpUMod %uint %id %u3
         %start = OpIMul %uint %kind %u2
         %extra = OpIMul %uint %kind %u4
         %stride = OpIAdd %uint %extra %u14
         %bias_start = OpIMul %uint %id %u2
         %y = OpCooperativeVectorMatrixMulAddNV %half5 %x %u0 %matrix %start %u0 %matrix %bias_start %u0 %u5 %u7 \
         %u0 %false %stride
         {}",
        out_halves("%y", 5)
    );
    let memory: Vec<f32> = (0..200).map(number).collect();
    let (found, _) = run(&body, &halves(memory.iter().copied()), &inputs());
    for (id, words) in found.iter().enumerate() {
        let (start, stride) = (id % 3, 7 + 2 * (id % 3));
        let matrix: Vec<Vec<f32>> = (0..5).map(|row| memory[start + row * stride..][..7].to_vec()).collect();
        let expected = product(&matrix, &input(id), Some(&memory[id..][..5]));
        let expected: Vec<u32> = expected.into_iter().map(half_bits).collect();
        assert_eq!(words[..5], expected[..], "{id}");
    }
}

#[test]
fn floats_of_other_widths_are_exact_factors() {
    // The interpretation of the vector and of the matrix, and what rounds a number to it.
    let eight = |format: FloatFormat| {
        move |number: f32| {
            let most = if format == FloatFormat::E4M3 { 448.0 } else { 57344.0 };
            format.value(format.round(f64::from(number).clamp(-most, most))) as f32
        }
    };
    let bytes = |format: FloatFormat| {
        move |numbers: &[f32]| -> Vec<u8> {
            numbers.iter().map(|&number| format.round(number.into()) as u8).collect()
        }
    };
    let single =
        |numbers: &[f32]| -> Vec<u8> { numbers.iter().flat_map(|number| number.to_le_bytes()).collect() };
    type Encode<'a> = &'a dyn Fn(&[f32]) -> Vec<u8>;
    type Round<'a> = &'a dyn Fn(f32) -> f32;
    let (e4m3, e5m2) = (FloatFormat::E4M3, FloatFormat::E5M2);
    let cases: [(&str, usize, Encode<'_>, Round<'_>); 3] = [
        ("%u1", 4, &single, &|number| number),
        ("%e4m3", 1, &bytes(e4m3), &eight(e4m3)),
        ("%e5m2", 1, &bytes(e5m2), &eight(e5m2)),
    ];
    for (interpretation, width, encode, round) in cases {
        let matrix: Vec<Vec<f32>> =
            matrix().iter().map(|row| row.iter().map(|&number| round(number / 8.0)).collect()).collect();
        let flat: Vec<f32> = matrix.concat();
        let stride = format!("%u{}", 7 * width);
        let body = format!(
            "{LOAD_INPUT}
             %y = OpCooperativeVectorMatrixMulNV %float5 %x {interpretation} %matrix %u0 {interpretation} %u5 %u7 \
             %u0 %false {stride}
             {}",
            out_words("%y", "%float", 5)
        );
        let (found, _) = run(&body, &encode(&flat), &inputs());
        for (id, words) in found.iter().enumerate() {
            let vector: Vec<f32> = input(id).into_iter().map(round).collect();
            let expected = product(&matrix, &vector, None);
            let found: Vec<f32> = words[..5].iter().map(|&word| f32::from_bits(word)).collect();
            assert_eq!(found, expected, "{id} {interpretation}");
        }
    }
}

#[test]
fn integers_saturate_on_the_way_in_and_wrap_in_the_sum() {
    let matrix: Vec<i8> = (0..35).map(|at| (at * 91 % 255 - 127) as i8).collect();
    let bias: [i32; 5] = [i32::MAX, i32::MIN, -1, 0, 12_345];
    let mut memory: Vec<u8> = matrix.iter().map(|&number| number as u8).collect();
    memory.resize(40, 0);
    memory.extend(bias.iter().flat_map(|number| number.to_le_bytes()));
    // f16 to signed 8 bits, unsigned 8 bits, and from signed 8 bits.
    type Convert = fn(f32) -> i32;
    let cases: [(&str, &str, u32, Convert); 3] = [
        ("%x", "%u3", 0, |x| x.round_ties_even().clamp(-128.0, 127.0) as i32),
        ("%x", "%u7", 0, |x| x.round_ties_even().clamp(0.0, 255.0) as i32),
        ("%narrow", "%u3", 2, |x| i32::from(x as i8)),
    ];
    for (vector, interpretation, flag, convert) in cases {
        // The result is signed (8), and so is the vector (2) in the last case.
        let flags = 8 | flag;
        let body = format!(
            "{LOAD_INPUT}
             %narrow = OpConvertFToS %char7 %x
             %y = OpCooperativeVectorMatrixMulAddNV %int5 {vector} {interpretation} %matrix %u0 %u3 %matrix %u40 \
             %u5 %u5 %u7 %u0 %false %u7 {flags}
             {}",
            out_words("%y", "%int", 5)
        );
        let (found, _) = run(&body, &memory, &inputs());
        for (id, words) in found.iter().enumerate() {
            let vector: Vec<i32> = input(id).into_iter().map(convert).collect();
            for row in 0..5 {
                let products = (0..7).map(|column| i32::from(matrix[row * 7 + column]) * vector[column]);
                let expected = products.sum::<i32>().wrapping_add(bias[row]);
                assert_eq!(words[row] as i32, expected, "{id}, row {row}, {interpretation}");
            }
        }
    }
}

#[test]
fn packed_words_hold_four_components_each() {
    let matrix: Vec<u8> = (0..35).map(|at| (at * 57 + 3) as u8).collect();
    for (interpretation, number, is_signed) in [("%s8_packed", "%u3", true), ("%u8_packed", "%u7", false)] {
        let body = format!(
            "%matrix = OpAccessChain %ptr_bytes %buffer %u0
             %scattered = OpIMul %uint %id %factor
             %other = OpNot %uint %scattered
             %x = OpCompositeConstruct %uint_2 %scattered %other
             %y = OpCooperativeVectorMatrixMulNV %uint5 %x {interpretation} %matrix %u0 {number} %u5 %u7 %u0 %false %u7
             {}",
            out_words("%y", "%uint", 5)
        );
        let shader = Shader {
            declarations: &format!("{DECLARATIONS}\n%factor = OpConstant %uint 1640531527"),
            ..shader(&body)
        };
        let (found, _) = run_shader(&shader, &matrix, &[0; 4]);
        let value = |byte: u8| if is_signed { i32::from(byte as i8) } else { i32::from(byte) };
        for (id, words) in found.iter().enumerate() {
            let scattered = (id as u32).wrapping_mul(1_640_531_527);
            // Lower components are in lower bits.
            let bytes = [scattered.to_le_bytes(), (!scattered).to_le_bytes()].concat();
            for row in 0..5 {
                let products = (0..7).map(|column| value(matrix[row * 7 + column]) * value(bytes[column]));
                assert_eq!(words[row] as i32, products.sum::<i32>(), "{id}, row {row}");
            }
        }
    }
}

#[test]
fn training_adds_outer_products_and_sums_to_memory() {
    // Integers as large as these are exact in f16 and f32, in any order.
    let vectors = (0..INVOCATIONS).flat_map(|id| (0..8).map(move |at| ((id + at) % 3) as f32));
    let vectors: Vec<f32> = vectors.collect();
    let body = "
        %matrix = OpAccessChain %ptr_bytes %buffer %u0
        %vectors = OpAccessChain %ptr_bytes %inputs %u0
        %input_offset = OpIMul %uint %id %u16
        %x = OpCooperativeVectorLoadNV %half5 %vectors %input_offset None
        %second_offset = OpIAdd %uint %input_offset %u2
        %y = OpCooperativeVectorLoadNV %half7 %vectors %second_offset None
        OpCooperativeVectorOuterProductAccumulateNV %matrix %u0 %x %y %u0 %u0 %u16
        OpCooperativeVectorOuterProductAccumulateNV %matrix %columns %x %y %u1 %u1 %u20
        OpCooperativeVectorOuterProductAccumulateNV %matrix %optimal %x %y %u3 %u1
        OpCooperativeVectorReduceSumAccumulateNV %matrix %sums %y";
    let shader = Shader {
        declarations: &format!(
            "{DECLARATIONS}
             %columns = OpConstant %uint 80
             %optimal = OpConstant %uint 220
             %sums = OpConstant %uint 360"
        ),
        ..shader(body)
    };
    let (_, left) = run_shader(&shader, &[0; 376], &halves(vectors.iter().copied()));
    let x = |id: usize, at: usize| vectors[id * 8 + at];
    let single = |at: usize| f32::from_le_bytes(left[at..at + 4].try_into().unwrap());
    let half = |at: usize| f16::from_le_bytes(left[at..at + 2].try_into().unwrap()).to_f32();
    for column in 0..7 {
        for row in 0..5 {
            let expected: f32 = (0..INVOCATIONS).map(|id| x(id, row) * x(id, column + 1)).sum();
            assert_eq!(half(row * 16 + column * 2), expected, "row {row}, column {column}");
            assert_eq!(single(80 + column * 20 + row * 4), expected, "row {row}, column {column}");
            assert_eq!(single(220 + row * 28 + column * 4), expected, "row {row}, column {column}");
        }
        let expected: f32 = (0..INVOCATIONS).map(|id| x(id, column + 1)).sum();
        assert_eq!(half(360 + column * 2), expected, "{column}");
    }
}

#[test]
fn shared_memory_holds_vectors() {
    let body = format!(
        "{LOAD_INPUT}
         OpCooperativeVectorStoreNV %shared %u4 %x None
         %again = OpCooperativeVectorLoadNV %half7 %shared %u4 None
         {}",
        out_halves("%again", 7)
    );
    for (element, length) in [("%uint", "%u16"), ("%half", "%u20"), ("%uint4", "%u4")] {
        let declarations = format!(
            "{DECLARATIONS}
             %shared_array = OpTypeArray {element} {length}
             %ptr_shared = OpTypePointer Workgroup %shared_array
             %shared = OpVariable %ptr_shared Workgroup"
        );
        let text = compute(&declarations, &body);
        let (found, _) = run_compute(&text, &[0; 4], &inputs());
        let expected: Vec<u32> = input(0).into_iter().map(half_bits).collect();
        assert_eq!(found[..7], expected[..], "{element}");
    }
}

/// A compute shader of one invocation, made of a ray generation shader.
fn compute(declarations: &str, body: &str) -> String {
    let shader = Shader { declarations, ..shader(body) };
    shader
        .text()
        .replace(
            "OpEntryPoint RayGenerationKHR %main \"main\"",
            "OpEntryPoint GLCompute %main \"main\"\nOpExecutionMode %main LocalSize 1 1 1",
        )
        .replace("LaunchIdKHR", "GlobalInvocationId")
}

/// Runs a compute shader; returns what it leaves in the output and the buffer.
fn run_compute(text: &str, buffer: &[u8], inputs: &[u8]) -> (Vec<u32>, Vec<u8>) {
    let module = load(&assemble(text)).expect("a module");
    run_module(module, buffer, inputs)
}

fn run_module(module: Module, buffer: &[u8], inputs: &[u8]) -> (Vec<u32>, Vec<u8>) {
    let (out, own) = (Buffer::zeroed(64), Buffer::new(buffer));
    let resources = Resources::default()
        .bind(0, 0, Descriptor::Buffer(out.clone()))
        .bind(0, 1, Descriptor::Buffer(own.clone()))
        .bind(0, 2, Descriptor::Buffer(Buffer::new(inputs)));
    let compute = compute_shader(&Arc::new(module), LowerOptions::default());
    compute.dispatch(&resources, [1; 3]).unwrap_or_else(|error| panic!("{}", error.render()));
    (bytemuck::pod_collect_to_vec(&out.bytes()), own.bytes())
}

#[test]
fn specialization_constants_are_counts_of_components() {
    let declarations = format!(
        "{DECLARATIONS}
         %count = OpSpecConstant %uint 2
         %any = OpTypeVectorIdEXT %half %count
         %ones = OpSpecConstantCompositeReplicateEXT %any %h_third"
    );
    let body = "
        %array = OpAccessChain %ptr_bytes %buffer %u0
        OpCooperativeVectorStoreNV %array %u2 %ones None";
    let text = compute(&declarations, body)
        .replace("OpDecorate %bytes", "OpDecorate %count SpecId 5\nOpDecorate %bytes");
    let module = load(&assemble(&text)).expect("a module");
    let stored = |count: usize| {
        let third = f16::from_f32(0.333).to_bits();
        let mut halves = vec![0; 10];
        halves[1..=count].fill(third);
        halves.into_iter().flat_map(u16::to_le_bytes).collect::<Vec<u8>>()
    };
    assert_eq!(run_module(module.clone(), &[0; 20], &[0; 4]).1, stored(2));
    let mut nine = module.clone();
    nine.specialize(5, 9).expect("a constant");
    assert_eq!(run_module(nine, &[0; 20], &[0; 4]).1, stored(9));
    let error = module.clone().specialize(5, 0).expect_err("a vector without components");
    assert_eq!(error.kind(), ErrorKind::InvalidArgument);
    assert!(error.to_string().contains("a vector of 0 components"), "{error}");
}

#[test]
fn matrices_outside_their_buffer_trap() {
    let product = |offset: &str, stride: &str| {
        format!(
            "{LOAD_INPUT}
             %y = OpCooperativeVectorMatrixMulNV %half5 %x %u0 %matrix {offset} %u0 %u5 %u7 %u0 %false {stride}
             {}",
            out_halves("%y", 5)
        )
    };
    // Five rows of 14 bytes, 16 bytes apart: 78 bytes. 22 are left behind offset 1000 of 1022.
    for (body, buffer, message) in [
        (
            product("%u1000", "%u16"),
            1022,
            "78 bytes at offset 1000 of `` (set 0, binding 1, element 0), which has 1022 bytes",
        ),
        (product("%u0", "%u16"), 77, "78 bytes at offset 0 of"),
        (product("%id", "%u16"), 80, "78 bytes at offset 3 of"),
    ] {
        let error = shader(&body)
            .run_with(&mut || {
                let resources = Resources::default().bind(0, 1, Descriptor::Buffer(Buffer::zeroed(buffer)));
                resources.bind(0, 2, Descriptor::Buffer(Buffer::new(&inputs())))
            })
            .expect_err("a trap");
        let text = error.render();
        assert!(text.contains(message), "{text}");
        assert!(text.contains("a buffer is accessed outside its range"), "{text}");
    }
}

#[test]
fn what_the_extension_does_not_allow_is_refused() {
    let refusals = [
        (
            "%y = OpFMod %half7 %x %x",
            "OpFMod is not defined for cooperative vectors, such as coopvecNV<float16_t, 7>",
        ),
        ("%y = OpExtInst %half7 %glsl Sin %x", "Sin is not defined for cooperative vectors"),
        (
            "%y = OpVectorShuffle %half7 %x %x 0 1 2 3 4 5 6",
            "OpVectorShuffle is not defined for cooperative vectors",
        ),
        ("%y = OpFAdd %half5 %x %x", "instead of the type of the result"),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %u0 %matrix %u0 %u0 %u4 %u7 %u0 %false %u16",
            "a result of 5 components, but M is 4",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %u0 %matrix %u0 %u0 %u5 %u6 %u0 %false %u16",
            "a vector of 7 components, but K is 6",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %u0 %matrix %u0 %u0 %u5 %u7 %u0 %true %u16",
            "RowMajorNV and ColumnMajorNV is not transposed",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %u0 %matrix %u0 %u0 %u5 %u7 %u0 %false",
            "the layout of the matrix requires MatrixStride",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %u0 %matrix %u0 %u0 %u5 %u7 %u9 %false %u16",
            "9 is not a layout of matrices",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %u30 %matrix %u0 %u0 %u5 %u7 %u0 %false %u16",
            "30 is not a component type",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %u2 %matrix %u0 %u2 %u5 %u7 %u0 %false %u16",
            "the component type Float64NV is not supported",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %u3 %matrix %u0 %u3 %u5 %u7 %u0 %false %u16",
            "of both floats and integers (int8_t, int8_t, float16_t) is not supported",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %s8_packed %matrix %u0 %u3 %u5 %u7 %u0 %false %u16",
            "packed components in a vector that is not of uint",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %u0 %matrix %u0 %s8_packed %u5 %u7 %u0 %false %u16",
            "a packed component type describes registers, not memory",
        ),
        (
            "%y = OpCooperativeVectorMatrixMulNV %half5 %x %id %matrix %u0 %u0 %u5 %u7 %u0 %false %u16",
            "must be a constant",
        ),
        (
            "%block_pointer = OpAccessChain %ptr_block %buffer
             %y = OpCooperativeVectorLoadNV %half5 %block_pointer %u0 None",
            "must be a pointer to an array of scalars or vectors",
        ),
        (
            "%y = OpCooperativeVectorLoadNV %uint4 %matrix %u0 None",
            "a cooperative vector is required, not uvec4",
        ),
        (
            "OpCooperativeVectorOuterProductAccumulateNV %matrix %u0 %x %x %u0 %e4m3 %u16",
            "into memory of floate4m3_t is not supported",
        ),
    ];
    for (instruction, message) in refusals {
        let error = shader(&format!("{LOAD_INPUT}\n{instruction}")).refused();
        let text = error.render();
        assert!(text.contains(message), "{instruction}: {text}");
        assert!(matches!(error.kind(), ErrorKind::InvalidModule | ErrorKind::UnsupportedModule), "{text}");
    }
}

/// The capability makes the types known; without it they are opaque.
#[test]
fn vectors_need_their_capability() {
    let body = "%y = OpUndef %half5";
    let error = Shader { capabilities: "OpCapability ReplicatedCompositesEXT", ..shader(body) }.refused();
    assert!(error.render().contains("OpTypeVectorIdEXT"), "{}", error.render());
}
