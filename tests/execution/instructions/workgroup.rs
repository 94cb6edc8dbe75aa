//! Compute shaders of several invocations a workgroup, written as SPIR-V text beside a prelude.

use std::sync::Arc;

use anyhit::Module;
use anyhit_engine::pipeline::Compute;
use anyhit_engine::program::LowerOptions;

use crate::support::assembly::assemble;

/// A shader's text beside the prelude, which has the types `%bool`, `%int`, `%uint`, `%uint3` and
/// `%ulong`, the constants `%0` to `%9` and `%264` (AcquireRelease and workgroup memory) of
/// `%uint`, and `%out`, a block of elements of one type at set 0, binding 0. The body finds the
/// invocation's number in its workgroup in `%i`, and in the dispatch in `%g`.
#[derive(Clone, Default)]
pub struct Workgroup<'a> {
    /// Invocations of a workgroup.
    pub size: u32,
    /// The type of the elements of `%out`: `uint` where not `ulong`.
    pub is_wide: bool,
    /// Capabilities beside `Shader`, `Int64` and `VariablePointers`.
    pub capabilities: &'a str,
    /// Variables of the entry point's interface.
    pub interface: &'a str,
    /// Decorations of what is declared beside the prelude.
    pub annotations: &'a str,
    /// Types, constants and variables of module scope.
    pub declarations: &'a str,
    /// Variables of the entry point.
    pub variables: &'a str,
    /// The body of the entry point.
    pub body: &'a str,
    /// Whole functions behind the entry point.
    pub functions: &'a str,
}

impl Workgroup<'_> {
    pub fn module(&self) -> Arc<Module> {
        let Self {
            size,
            is_wide,
            capabilities,
            interface,
            annotations,
            declarations,
            variables,
            body,
            functions,
        } = self;
        let (element, stride) = if *is_wide { ("ulong", 8) } else { ("uint", 4) };
        let constants: String =
            (0..10).chain([264]).map(|word| format!("%{word} = OpConstant %uint {word}\n")).collect();
        let module = assemble(&format!(
            "OpCapability Shader
             OpCapability Int64
             OpCapability VariablePointers
             {capabilities}
             OpMemoryModel Logical GLSL450
             OpEntryPoint GLCompute %main \"main\" %index %global %out {interface}
             OpExecutionMode %main LocalSize {size} 1 1
             OpDecorate %index BuiltIn LocalInvocationIndex
             OpDecorate %global BuiltIn GlobalInvocationId
             OpDecorate %words ArrayStride {stride}
             OpDecorate %block Block
             OpMemberDecorate %block 0 Offset 0
             OpDecorate %out DescriptorSet 0
             OpDecorate %out Binding 0
             {annotations}
             %void = OpTypeVoid
             %function = OpTypeFunction %void
             %bool = OpTypeBool
             %int = OpTypeInt 32 1
             %uint = OpTypeInt 32 0
             %ulong = OpTypeInt 64 0
             %uint3 = OpTypeVector %uint 3
             {constants}
             %ptr_in = OpTypePointer Input %uint
             %ptr_in3 = OpTypePointer Input %uint3
             %index = OpVariable %ptr_in Input
             %global = OpVariable %ptr_in3 Input
             %words = OpTypeRuntimeArray %{element}
             %block = OpTypeStruct %words
             %ptr_block = OpTypePointer StorageBuffer %block
             %ptr_{element} = OpTypePointer StorageBuffer %{element}
             %out = OpVariable %ptr_block StorageBuffer
             {declarations}
             %main = OpFunction %void None %function
             %entry = OpLabel
             {variables}
             %i = OpLoad %uint %index
             %global_id = OpLoad %uint3 %global
             %g = OpCompositeExtract %uint %global_id 0
             {body}
             OpReturn
             OpFunctionEnd
             {functions}"
        ));
        Arc::new(anyhit_engine::module::load(&module).unwrap_or_else(|error| panic!("{}", error.render())))
    }

    pub fn compute(&self) -> Compute {
        compute(&self.module(), LowerOptions::default())
    }
}

/// The compute shader of a module's first entry point.
pub fn compute(module: &Arc<Module>, options: LowerOptions) -> Compute {
    let program = anyhit_engine::program::lower_with(module, &module.entry_points[0], options);
    let program = program.unwrap_or_else(|error| panic!("{}", error.render()));
    Compute::new(program).expect("a compute shader")
}
