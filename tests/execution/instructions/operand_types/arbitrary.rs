//! Operands of whatever type, for every instruction that runs: most are refused, and nothing
//! panics.

use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use anyhit_base::error::{ErrorKind, Result};
use anyhit_engine::machine::Resources;
use anyhit_engine::module::Opcode;
use anyhit_engine::ops::support::{self, Support};
use anyhit_engine::pipeline::{BatchWidth, Launch, Pipeline, RunOptions};
use rspirv::grammar::{OperandKind, OperandQuantifier};

use crate::execution::instructions::operand_types::types::hash;
use crate::support::assembly::assemble;

/// The types of results.
const TYPES: &[&str] = &[
    "void",
    "bool",
    "char",
    "ushort",
    "int",
    "uint",
    "long",
    "half",
    "float",
    "double",
    "bool2",
    "int2",
    "uint2",
    "uint4",
    "half2",
    "float2",
    "float3",
    "float4",
    "double2",
    "matrix",
    "words",
    "record",
    "pair",
    "to_uint",
    "to_float3",
    "image",
    "sampled",
    "structure",
];

/// The values of operands: of each type what is zero, variables, and what they hold.
const VALUES: &[&str] = &[
    "zero_bool",
    "zero_char",
    "zero_ushort",
    "zero_int",
    "zero_uint",
    "zero_long",
    "zero_half",
    "zero_float",
    "zero_double",
    "zero_bool2",
    "zero_int2",
    "zero_uint2",
    "zero_uint4",
    "zero_half2",
    "zero_float2",
    "zero_float3",
    "zero_float4",
    "zero_double2",
    "zero_matrix",
    "zero_words",
    "zero_record",
    "held_uint",
    "held_float3",
    "held_words",
    "held_record",
    "held_query",
    "images",
    "image_value",
    "sampled_value",
    "sampler_value",
    "nothing",
    "structure_value",
    "payload",
    "buffer",
    "three",
    "main",
    "uint",
    "glsl",
];

/// A module with one instruction.
fn module(instruction: &str) -> String {
    let mut text = String::from(
        "OpCapability Shader
         OpCapability RayTracingKHR
         OpCapability RayQueryKHR
         OpCapability Int64
         OpCapability Int16
         OpCapability Int8
         OpCapability Float64
         OpCapability Float16
         %glsl = OpExtInstImport \"GLSL.std.450\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint RayGenerationKHR %main \"main\"
         OpDecorate %images DescriptorSet 0
         OpDecorate %images Binding 1
         OpDecorate %samplers DescriptorSet 0
         OpDecorate %samplers Binding 2
         OpDecorate %structures DescriptorSet 0
         OpDecorate %structures Binding 3
         OpDecorate %buffer DescriptorSet 0
         OpDecorate %buffer Binding 4
         OpDecorate %block Block
         OpDecorate %runtime ArrayStride 4
         OpMemberDecorate %block 0 Offset 0
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %bool = OpTypeBool
         %char = OpTypeInt 8 1
         %ushort = OpTypeInt 16 0
         %int = OpTypeInt 32 1
         %uint = OpTypeInt 32 0
         %long = OpTypeInt 64 1
         %half = OpTypeFloat 16
         %float = OpTypeFloat 32
         %double = OpTypeFloat 64
         %bool2 = OpTypeVector %bool 2
         %int2 = OpTypeVector %int 2
         %uint2 = OpTypeVector %uint 2
         %uint4 = OpTypeVector %uint 4
         %half2 = OpTypeVector %half 2
         %float2 = OpTypeVector %float 2
         %float3 = OpTypeVector %float 3
         %float4 = OpTypeVector %float 4
         %double2 = OpTypeVector %double 2
         %matrix = OpTypeMatrix %float3 2
         %three = OpConstant %uint 3
         %words = OpTypeArray %uint %three
         %record = OpTypeStruct %float %uint2
         %pair = OpTypeStruct %uint %uint
         %runtime = OpTypeRuntimeArray %uint
         %block = OpTypeStruct %runtime
         %image = OpTypeImage %float 2D 0 0 0 1 Unknown
         %sampled = OpTypeSampledImage %image
         %sampler = OpTypeSampler
         %structure = OpTypeAccelerationStructureKHR
         %query = OpTypeRayQueryKHR\n",
    );
    for (class, pointee) in [
        ("Private", "uint"),
        ("Private", "float3"),
        ("Private", "words"),
        ("Private", "record"),
        ("Private", "query"),
    ] {
        let _ = writeln!(
            text,
            "%to_{pointee} = OpTypePointer {class} %{pointee}\n%held_{pointee} = OpVariable %to_{pointee} {class}"
        );
    }
    for (class, pointee, name) in [
        ("UniformConstant", "image", "images"),
        ("UniformConstant", "sampler", "samplers"),
        ("UniformConstant", "structure", "structures"),
        ("RayPayloadKHR", "float3", "payload"),
        ("StorageBuffer", "block", "buffer"),
    ] {
        let _ = writeln!(
            text,
            "%p_{name} = OpTypePointer {class} %{pointee}\n%{name} = OpVariable %p_{name} {class}"
        );
    }
    for value in VALUES {
        if let Some(ty) = value.strip_prefix("zero_") {
            let _ = writeln!(text, "%{value} = OpConstantNull %{ty}");
        }
    }
    let _ = write!(
        text,
        "%idle = OpFunction %void None %main_type
         %idle_entry = OpLabel
         OpReturn
         OpFunctionEnd
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         %image_value = OpLoad %image %images
         %sampler_value = OpLoad %sampler %samplers
         %sampled_value = OpSampledImage %sampled %image_value %sampler_value
         %nothing = OpFunctionCall %void %idle
         %structure_value = OpLoad %structure %structures
         {instruction}
         OpReturn
         OpFunctionEnd"
    );
    text
}

/// Loads, lowers and, where that succeeds, runs it for one invocation.
fn run(text: &str) -> Result<()> {
    let module = Arc::new(anyhit_engine::module::load(&assemble(text))?);
    let program = anyhit_engine::program::lower(&module, &module.entry_points[0])?;
    let pipeline = Pipeline::builder().ray_generation(program)?.build()?;
    let resources = Resources::default();
    Launch { pipeline: &pipeline, resources: &resources }
        .run([1, 1, 1], RunOptions::of(BatchWidth::One))
        .map(|_| ())
}

#[test]
fn nothing_panics_whatever_the_operands_are() {
    let mut wrong = Vec::new();
    let mut counts = [0; 2];
    let rounds = std::env::var("PROPTEST_CASES").ok().and_then(|count| count.parse().ok()).unwrap_or(12);
    for opcode in Opcode::all() {
        let Some(Support::Supported(group)) = support::opcode(opcode) else { continue };
        if ["module, types, constants", "functions and control flow"].contains(&group) {
            continue;
        }
        let rounds = if opcode == Opcode::ExtInst { 32 * rounds } else { rounds };
        for round in 0..rounds {
            let mut draws = 0;
            let mut draw = |count: usize| {
                draws += 1;
                hash(&[opcode.0.into(), round, draws]) as usize % count
            };
            let (mut result, mut operands) = ("", String::new());
            for operand in opcode.operands() {
                let times = match operand.quantifier {
                    OperandQuantifier::One => 1,
                    OperandQuantifier::ZeroOrOne => draw(2),
                    OperandQuantifier::ZeroOrMore => draw(4),
                };
                for _ in 0..times {
                    let _ = match operand.kind {
                        OperandKind::IdResult => {
                            result = "%r = ";
                            Ok(())
                        }
                        OperandKind::IdResultType => write!(operands, " %{}", TYPES[draw(TYPES.len())]),
                        OperandKind::IdScope | OperandKind::IdMemorySemantics => write!(operands, " %three"),
                        OperandKind::IdRef if opcode == Opcode::ExtInst && !operands.contains("glsl") => {
                            write!(operands, " %glsl")
                        }
                        OperandKind::IdRef => write!(operands, " %{}", VALUES[draw(VALUES.len())]),
                        OperandKind::LiteralExtInstInteger => write!(operands, " {}", 1 + draw(81)),
                        _ => write!(operands, " {}", draw(4)),
                    };
                }
            }
            let instruction = format!("{result}{opcode}{operands}");
            match catch_unwind(AssertUnwindSafe(|| run(&module(&instruction)))) {
                Ok(Ok(())) => counts[0] += 1,
                Ok(Err(error)) if error.message().contains("bug in anyhit") => wrong.push(instruction),
                Ok(Err(error)) => counts[usize::from(error.kind() == ErrorKind::InvalidModule)] += 1,
                Err(_) => wrong.push(instruction),
            }
        }
    }
    assert!(wrong.is_empty(), "{counts:?}, and these panic:\n{}", wrong.join("\n"));
    assert!(counts[1] > 1000, "{counts:?}");
}
