//! Runs small ray generation shaders, written as SPIR-V text, at every width of a batch.

use std::sync::Arc;

use anyhit_base::error::{Error, Result};
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::{BatchWidth, Launch, Pipeline, RunOptions};

use crate::support::assembly::assemble;

/// Invocations of a launch: a full batch of 64 and a part of one.
pub const INVOCATIONS: usize = 72;
/// Words that each invocation may write.
const WORDS: usize = 16;

/// A shader's text beside the prelude.
#[derive(Clone, Default)]
pub struct Shader<'a> {
    /// Capabilities and extensions, before the memory model.
    pub capabilities: &'a str,
    /// More entry points (callable shaders become the callable records), execution modes, strings,
    /// names and decorations.
    pub annotations: &'a str,
    /// Types, constants and variables of module scope.
    pub declarations: &'a str,
    /// Variables of the entry point.
    pub variables: &'a str,
    /// The body of the entry point, with `out N %value` for a store of a `uint` to the
    /// invocation's N-th word.
    pub body: &'a str,
    /// How many invocations, where not [`INVOCATIONS`].
    pub invocations: Option<usize>,
    /// Whole functions behind the entry point.
    pub functions: &'a str,
    /// The fuel of an invocation, where not that of every pipeline.
    pub fuel: Option<u64>,
}

impl Shader<'_> {
    /// What each invocation leaves in its words; the same at every width.
    pub fn run(&self) -> Vec<[u32; WORDS]> {
        self.run_with(&mut Resources::default).unwrap_or_else(|error| panic!("{}", error.render()))
    }

    /// As [`Shader::run`] with resources beside the output, made anew for each width.
    pub fn run_with(&self, resources: &mut dyn FnMut() -> Resources) -> Result<Vec<[u32; WORDS]>> {
        let module = Arc::new(anyhit_engine::module::load(&assemble(&self.text()))?);
        let program = anyhit_engine::program::lower(&module, &module.entry_points[0])?;
        let mut builder = Pipeline::builder();
        builder = builder.ray_generation(program)?;
        for entry in module.entry_points.iter().filter(|entry| entry.stage == Stage::Callable) {
            builder = builder.callable(anyhit_engine::program::lower(&module, entry)?)?;
        }
        if let Some(fuel) = self.fuel {
            builder = builder.fuel(fuel);
        }
        let pipeline = builder.build()?;
        let reference = pipeline.unoptimized()?;
        let count = self.invocations.unwrap_or(INVOCATIONS);
        let one = launch(&pipeline, resources(), count, BatchWidth::One);
        let others = [
            ("128 lanes", launch(&pipeline, resources(), count, BatchWidth::Of128)),
            ("64 lanes", launch(&pipeline, resources(), count, BatchWidth::Of64)),
            ("1 lane without the optimizer", launch(&reference, resources(), count, BatchWidth::One)),
            ("128 lanes without the optimizer", launch(&reference, resources(), count, BatchWidth::Of128)),
            ("64 lanes without the optimizer", launch(&reference, resources(), count, BatchWidth::Of64)),
        ];
        for (name, other) in others {
            match (&one, &other) {
                (Ok(one), Ok(other)) => {
                    if let Some(id) = (0..count).find(|&id| one[id] != other[id]) {
                        panic!("invocation {id}: 1 lane {:?}, {name} {:?}", one[id], other[id]);
                    }
                }
                (Err(one), Err(other)) => assert_eq!(one.render(), other.render(), "1 lane beside {name}"),
                (one, other) => panic!("1 lane beside {name}: {one:?} / {other:?}"),
            }
        }
        one
    }

    /// The shader's program.
    pub fn program(&self) -> anyhit::Program {
        let module = Arc::new(anyhit_engine::module::load(&assemble(&self.text())).expect("a module"));
        anyhit_engine::program::lower(&module, &module.entry_points[0]).expect("a program")
    }

    /// The error of a shader that must not run to its end.
    pub fn refused(&self) -> Error {
        self.run_with(&mut Resources::default).expect_err("the shader runs, though it should not")
    }

    /// The whole module.
    pub fn text(&self) -> String {
        let mut constants = String::new();
        for value in 0..=32 {
            constants += &format!("%u{value} = OpConstant %uint {value}\n");
        }
        let mut body = String::new();
        for (at, line) in self.body.lines().enumerate() {
            let words: Vec<&str> = line.split(';').next().unwrap_or_default().split_whitespace().collect();
            match words[..] {
                ["out", index, value] => {
                    body += &format!(
                        "%out_index_{at} = OpIAdd %uint %out_base %u{index}\n\
                         %out_pointer_{at} = OpAccessChain %ptr_StorageBuffer_uint %out %u0 %out_index_{at}\n\
                         OpStore %out_pointer_{at} {value}\n"
                    );
                }
                _ => body += &format!("{line}\n"),
            }
        }
        format!(
            "OpCapability Shader
             OpCapability RayTracingKHR
             OpCapability Int64
             OpCapability Int16
             OpCapability Int8
             OpCapability Float64
             OpCapability Float16
             OpCapability GroupNonUniform
             {capabilities}
             %glsl = OpExtInstImport \"GLSL.std.450\"
             %printf = OpExtInstImport \"NonSemantic.DebugPrintf\"
             {memory_model}
             OpEntryPoint RayGenerationKHR %main \"main\"
             {annotations}
             OpDecorate %launch_id BuiltIn LaunchIdKHR
             OpDecorate %out_words ArrayStride 4
             OpDecorate %out_block Block
             OpMemberDecorate %out_block 0 Offset 0
             OpDecorate %out DescriptorSet 0
             OpDecorate %out Binding 0
             %void = OpTypeVoid
             %main_type = OpTypeFunction %void
             %bool = OpTypeBool
             %int = OpTypeInt 32 1
             %uint = OpTypeInt 32 0
             %uchar = OpTypeInt 8 0
             %ushort = OpTypeInt 16 0
             %ulong = OpTypeInt 64 0
             %long = OpTypeInt 64 1
             %half = OpTypeFloat 16
             %float = OpTypeFloat 32
             %double = OpTypeFloat 64
             %uint2 = OpTypeVector %uint 2
             %uint3 = OpTypeVector %uint 3
             %uint4 = OpTypeVector %uint 4
             %float2 = OpTypeVector %float 2
             %float3 = OpTypeVector %float 3
             %float4 = OpTypeVector %float 4
             %true = OpConstantTrue %bool
             %false = OpConstantFalse %bool
             {constants}
             %ptr_Input_uint3 = OpTypePointer Input %uint3
             %launch_id = OpVariable %ptr_Input_uint3 Input
             %out_words = OpTypeRuntimeArray %uint
             %out_block = OpTypeStruct %out_words
             %ptr_StorageBuffer_out_block = OpTypePointer StorageBuffer %out_block
             %ptr_StorageBuffer_uint = OpTypePointer StorageBuffer %uint
             %ptr_Function_uint = OpTypePointer Function %uint
             %ptr_Private_uint = OpTypePointer Private %uint
             %out = OpVariable %ptr_StorageBuffer_out_block StorageBuffer
             {declarations}
             %main = OpFunction %void None %main_type
             %entry = OpLabel
             {variables}
             %launch_id_value = OpLoad %uint3 %launch_id
             %id = OpCompositeExtract %uint %launch_id_value 0
             %out_base = OpIMul %uint %id %u16
             {body}
             OpReturn
             OpFunctionEnd
             {functions}",
            capabilities = self.capabilities,
            memory_model = match self.capabilities.contains("PhysicalStorageBufferAddresses") {
                true => "OpMemoryModel PhysicalStorageBuffer64 GLSL450",
                false => "OpMemoryModel Logical GLSL450",
            },
            annotations = self.annotations,
            declarations = self.declarations,
            variables = self.variables,
            functions = self.functions,
        )
    }
}

fn launch(
    pipeline: &Pipeline,
    resources: Resources,
    count: usize,
    width: BatchWidth,
) -> Result<Vec<[u32; WORDS]>> {
    let out = Buffer::zeroed(count * WORDS * 4);
    let resources = resources.bind(0, 0, Descriptor::Buffer(out.clone()));
    let launch = Launch { pipeline, resources: &resources };
    launch.run([count as u32, 1, 1], RunOptions::of(width))?;
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&out.bytes());
    Ok(words.chunks_exact(WORDS).map(|words| words.try_into().unwrap()).collect())
}
