//! The lists of what is classed by hand, for [`opcode`](super::opcode) and the functions beside it.

use crate::module::Opcode;
use rspirv::spirv::{BuiltIn, Capability, StorageClass};

use crate::ops::lane_kernel::OpFamily;
use crate::ops::{arithmetic, bit, conversion, integer_functions, relational_logical};

/// Reasons to be out of scope.
pub(super) const GRAPHICS: &str = "graphics stages";
pub(super) const MESH: &str = "mesh stages";
pub(super) const KERNELS: &str = "kernels";
pub(super) const COOPERATIVE: &str = "other instructions of cooperative matrices";
pub(super) const TENSORS: &str = "tensors";
pub(super) const MICROMAPS: &str = "displacement micromaps";
/// SPIR-V 3.3.10: "Instruction reserved for future use. Use of this instruction is invalid."
pub(super) const RESERVED: &str = "reserved by the specification: their use is invalid";
/// A graph's nodes are shaders of `VK_PIPELINE_BIND_POINT_EXECUTION_GRAPH_AMDX`.
pub(super) const GRAPHS: &str = "work graphs: neither ray-tracing nor compute pipelines";
/// No extension of Vulkan enables the capability; OpenGL has it.
pub(super) const NOT_VULKAN: &str = "not in Vulkan";

/// A group's name and its members.
pub(super) type Groups<T> = &'static [(&'static str, &'static [T])];

/// The group that has a given member.
pub(super) fn group_of<T: PartialEq>(
    groups: &[(&'static str, &'static [T])],
    sought: T,
) -> Option<&'static str> {
    groups.iter().find(|(_, members)| members.contains(&sought)).map(|&(group, _)| group)
}

/// Sections that are families of kernels.
pub(super) static SECTIONS: &[(&str, &[&OpFamily])] = &[
    ("arithmetic", arithmetic::FAMILIES),
    ("arithmetic", integer_functions::FAMILIES),
    ("bits", bit::FAMILIES),
    ("conversion, carries, bit fields", conversion::FAMILIES),
    ("relations and logic", relational_logical::FAMILIES),
];

/// Opcodes that no section translates because the loader reads them, or the lowering turns them
/// into blocks, calls and variables.
pub(super) const READ_BY_MODULE_AND_PROGRAM: Groups<Opcode> = &[
    (
        "module, types, constants",
        &[
            Opcode::Nop,
            Opcode::SourceContinued,
            Opcode::Source,
            Opcode::SourceExtension,
            Opcode::Name,
            Opcode::MemberName,
            Opcode::String,
            Opcode::Line,
            Opcode::NoLine,
            Opcode::ModuleProcessed,
            Opcode::Extension,
            Opcode::ExtInstImport,
            Opcode::ExtInstWithForwardRefsKHR,
            Opcode::MemoryModel,
            Opcode::EntryPoint,
            Opcode::ExecutionMode,
            Opcode::ExecutionModeId,
            Opcode::Capability,
            Opcode::Decorate,
            Opcode::DecorateId,
            Opcode::DecorateString,
            Opcode::MemberDecorate,
            Opcode::MemberDecorateString,
            Opcode::MemberDecorateIdEXT,
            Opcode::DecorationGroup,
            Opcode::GroupDecorate,
            Opcode::GroupMemberDecorate,
            Opcode::TypeVoid,
            Opcode::TypeBool,
            Opcode::TypeInt,
            Opcode::TypeFloat,
            Opcode::TypeVector,
            Opcode::TypeVectorIdEXT,
            Opcode::TypeCooperativeMatrixKHR,
            Opcode::TypeMatrix,
            Opcode::TypeImage,
            Opcode::TypeSampler,
            Opcode::TypeSampledImage,
            Opcode::TypeArray,
            Opcode::TypeRuntimeArray,
            Opcode::TypeStruct,
            Opcode::TypePointer,
            Opcode::TypeForwardPointer,
            Opcode::TypeUntypedPointerKHR,
            Opcode::TypeBufferEXT,
            Opcode::TypeFunction,
            Opcode::TypeAccelerationStructureKHR,
            Opcode::TypeRayQueryKHR,
            Opcode::TypeHitObjectNV,
            Opcode::TypeHitObjectEXT,
            Opcode::ConstantTrue,
            Opcode::ConstantFalse,
            Opcode::Constant,
            Opcode::ConstantComposite,
            Opcode::ConstantNull,
            Opcode::SpecConstantTrue,
            Opcode::SpecConstantFalse,
            Opcode::SpecConstant,
            Opcode::SpecConstantComposite,
            Opcode::SpecConstantOp,
            Opcode::ConstantCompositeReplicateEXT,
            Opcode::SpecConstantCompositeReplicateEXT,
            Opcode::ConstantSizeOfEXT,
            Opcode::ConstantDataKHR,
            Opcode::SpecConstantDataKHR,
        ],
    ),
    (
        "functions and control flow",
        &[
            Opcode::Function,
            Opcode::FunctionParameter,
            Opcode::FunctionEnd,
            Opcode::FunctionCall,
            Opcode::Variable,
            Opcode::UntypedVariableKHR,
            Opcode::Label,
            Opcode::Phi,
            Opcode::LoopMerge,
            Opcode::SelectionMerge,
            Opcode::Branch,
            Opcode::BranchConditional,
            Opcode::Switch,
            Opcode::Return,
            Opcode::ReturnValue,
            Opcode::Unreachable,
            Opcode::AbortKHR,
            Opcode::IgnoreIntersectionKHR,
            Opcode::TerminateRayKHR,
            Opcode::IgnoreIntersectionNV,
            Opcode::TerminateRayNV,
        ],
    ),
];

/// Opcodes that do not run yet and need no capability of their own, or one that others need too.
pub(super) const UNSUPPORTED_OPCODES: Groups<Opcode> =
    &[("images", &[Opcode::ImageGatherQCOM]), ("other arithmetic", &[Opcode::BitcastExtractEXT])];

/// Opcodes out of scope that need no capability by which they could be classed.
pub(super) const OUT_OF_SCOPE_OPCODES: Groups<Opcode> = &[
    (GRAPHICS, &[Opcode::Kill, Opcode::TerminateInvocation]),
    (COOPERATIVE, &[Opcode::CooperativeMatrixGetCoordinateEXT]),
    (
        KERNELS,
        &[
            Opcode::PredicatedLoadINTEL,
            Opcode::PredicatedStoreINTEL,
            Opcode::UntypedPrefetchKHR,
            Opcode::UntypedGroupAsyncCopyKHR,
        ],
    ),
    (
        RESERVED,
        &[
            Opcode::ImageSparseSampleProjImplicitLod,
            Opcode::ImageSparseSampleProjExplicitLod,
            Opcode::ImageSparseSampleProjDrefImplicitLod,
            Opcode::ImageSparseSampleProjDrefExplicitLod,
        ],
    ),
];

/// Capabilities whose instructions do not run yet, unless a section translates them.
pub(super) const UNSUPPORTED_CAPABILITIES: Groups<Capability> = &[
    ("ray queries", &[Capability::RayQueryKHR, Capability::RayQueryPositionFetchKHR]),
    (
        "spheres and swept spheres in ray queries and hit objects",
        &[Capability::RayTracingSpheresGeometryNV, Capability::RayTracingLinearSweptSpheresGeometryNV],
    ),
    ("NV_ray_tracing", &[Capability::RayTracingNV]),
    ("motion blur", &[Capability::RayTracingMotionBlurNV]),
    (
        "subgroups",
        &[
            Capability::GroupNonUniform,
            Capability::GroupNonUniformVote,
            Capability::GroupNonUniformBallot,
            Capability::GroupNonUniformShuffle,
            Capability::GroupNonUniformShuffleRelative,
            Capability::GroupNonUniformArithmetic,
            Capability::GroupNonUniformClustered,
            Capability::GroupNonUniformQuad,
            Capability::GroupNonUniformRotateKHR,
            Capability::GroupNonUniformPartitionedEXT,
            Capability::SubgroupBallotKHR,
            Capability::SubgroupVoteKHR,
            Capability::QuadControlKHR,
        ],
    ),
    (
        "atomics and barriers",
        &[
            Capability::AtomicFloat16AddEXT,
            Capability::AtomicFloat32AddEXT,
            Capability::AtomicFloat64AddEXT,
            Capability::AtomicFloat16MinMaxEXT,
            Capability::AtomicFloat32MinMaxEXT,
            Capability::AtomicFloat64MinMaxEXT,
            Capability::AtomicFloat16VectorNV,
        ],
    ),
    (
        "pointers and device addresses",
        &[
            Capability::PhysicalStorageBufferAddresses,
            Capability::VariablePointers,
            Capability::VariablePointersStorageBuffer,
            Capability::UntypedPointersKHR,
        ],
    ),
    ("images", &[Capability::ImageQuery, Capability::SparseResidency]),
    (
        "other arithmetic",
        &[
            Capability::DotProduct,
            Capability::FMAKHR,
            Capability::IntegerFunctions2INTEL,
            Capability::ReplicatedCompositesEXT,
        ],
    ),
    ("others", &[Capability::ShaderClockKHR, Capability::ExpectAssumeKHR]),
];

/// What needs one of these, and none of the capabilities to come, is out of scope. Those of INTEL
/// and ALTERA are kernels' but for the few listed above.
pub(super) const OUT_OF_SCOPE_CAPABILITIES: Groups<Capability> = &[
    (
        KERNELS,
        &[
            Capability::Kernel,
            Capability::Addresses,
            Capability::DeviceEnqueue,
            Capability::Pipes,
            Capability::PipeStorage,
            Capability::Groups,
            Capability::GroupUniformArithmeticKHR,
            Capability::SubgroupDispatch,
            Capability::NamedBarrier,
            Capability::LiteralSampler,
            Capability::ArithmeticFenceEXT,
        ],
    ),
    (
        GRAPHICS,
        &[
            Capability::Geometry,
            Capability::GeometryStreams,
            Capability::TileImageColorReadAccessEXT,
            Capability::TileImageDepthReadAccessEXT,
            Capability::TileImageStencilReadAccessEXT,
            Capability::FragmentMaskAMD,
            Capability::FragmentShaderSampleInterlockEXT,
            Capability::DemoteToHelperInvocation,
        ],
    ),
    (MESH, &[Capability::MeshShadingEXT, Capability::MeshShadingNV]),
    (
        COOPERATIVE,
        &[
            Capability::CooperativeMatrixNV,
            Capability::CooperativeMatrixConversionQCOM,
            Capability::CooperativeMatrixReductionsNV,
            Capability::CooperativeMatrixTensorAddressingNV,
            Capability::CooperativeMatrixPerElementOperationsNV,
        ],
    ),
    (TENSORS, &[Capability::TensorsARM, Capability::GraphARM, Capability::TensorAddressingNV]),
    (MICROMAPS, &[Capability::DisplacementMicromapNV]),
    (GRAPHS, &[Capability::ShaderEnqueueAMDX]),
    (NOT_VULKAN, &[Capability::BindlessTextureNV]),
];

/// Builtins that do not run yet.
pub(super) const UNSUPPORTED_BUILTINS: Groups<BuiltIn> = &[];

/// Builtins out of scope.
pub(super) const OUT_OF_SCOPE_BUILTINS: Groups<BuiltIn> = &[
    (
        GRAPHICS,
        &[
            BuiltIn::Position,
            BuiltIn::PointSize,
            BuiltIn::ClipDistance,
            BuiltIn::CullDistance,
            BuiltIn::VertexId,
            BuiltIn::InvocationId,
            BuiltIn::Layer,
            BuiltIn::ViewportIndex,
            BuiltIn::TessLevelOuter,
            BuiltIn::TessLevelInner,
            BuiltIn::TessCoord,
            BuiltIn::PatchVertices,
            BuiltIn::FragCoord,
            BuiltIn::PointCoord,
            BuiltIn::FrontFacing,
            BuiltIn::SampleId,
            BuiltIn::SamplePosition,
            BuiltIn::SampleMask,
            BuiltIn::FragDepth,
            BuiltIn::HelperInvocation,
            BuiltIn::VertexIndex,
            BuiltIn::InstanceIndex,
            BuiltIn::BaseVertex,
            BuiltIn::BaseInstance,
            BuiltIn::DrawIndex,
            BuiltIn::PrimitiveShadingRateKHR,
            BuiltIn::ViewIndex,
            BuiltIn::ShadingRateKHR,
            BuiltIn::TileOffsetQCOM,
            BuiltIn::TileDimensionQCOM,
            BuiltIn::TileApronSizeQCOM,
            BuiltIn::BaryCoordNoPerspAMD,
            BuiltIn::BaryCoordNoPerspCentroidAMD,
            BuiltIn::BaryCoordNoPerspSampleAMD,
            BuiltIn::BaryCoordSmoothAMD,
            BuiltIn::BaryCoordSmoothCentroidAMD,
            BuiltIn::BaryCoordSmoothSampleAMD,
            BuiltIn::BaryCoordPullModelAMD,
            BuiltIn::FragStencilRefEXT,
            BuiltIn::ViewportMaskNV,
            BuiltIn::SecondaryPositionNV,
            BuiltIn::SecondaryViewportMaskNV,
            BuiltIn::PositionPerViewNV,
            BuiltIn::ViewportMaskPerViewNV,
            BuiltIn::FullyCoveredEXT,
            BuiltIn::BaryCoordKHR,
            BuiltIn::BaryCoordNoPerspKHR,
            BuiltIn::FragSizeEXT,
            BuiltIn::FragInvocationCountEXT,
        ],
    ),
    (
        MESH,
        &[
            BuiltIn::TaskCountNV,
            BuiltIn::PrimitiveCountNV,
            BuiltIn::PrimitiveIndicesNV,
            BuiltIn::ClipDistancePerViewNV,
            BuiltIn::CullDistancePerViewNV,
            BuiltIn::LayerPerViewNV,
            BuiltIn::MeshViewCountNV,
            BuiltIn::MeshViewIndicesNV,
            BuiltIn::PrimitivePointIndicesEXT,
            BuiltIn::PrimitiveLineIndicesEXT,
            BuiltIn::PrimitiveTriangleIndicesEXT,
            BuiltIn::CullPrimitiveEXT,
        ],
    ),
    (
        KERNELS,
        &[
            BuiltIn::WorkDim,
            BuiltIn::GlobalSize,
            BuiltIn::EnqueuedWorkgroupSize,
            BuiltIn::GlobalOffset,
            BuiltIn::GlobalLinearId,
            BuiltIn::SubgroupMaxSize,
            BuiltIn::NumEnqueuedSubgroups,
        ],
    ),
    (GRAPHS, &[BuiltIn::RemainingRecursionLevelsAMDX, BuiltIn::ShaderIndexAMDX]),
    (
        MICROMAPS,
        &[
            BuiltIn::HitMicroTriangleVertexPositionsNV,
            BuiltIn::HitMicroTriangleVertexBarycentricsNV,
            BuiltIn::HitKindFrontFacingMicroTriangleNV,
            BuiltIn::HitKindBackFacingMicroTriangleNV,
        ],
    ),
];

/// Storage classes that do not run yet.
pub(super) const UNSUPPORTED_STORAGE: Groups<StorageClass> = &[];

/// Storage classes out of scope.
pub(super) const OUT_OF_SCOPE_STORAGE: Groups<StorageClass> = &[
    (GRAPHICS, &[StorageClass::Output, StorageClass::TileImageEXT, StorageClass::TileAttachmentQCOM]),
    (MESH, &[StorageClass::TaskPayloadWorkgroupEXT]),
    (GRAPHS, &[StorageClass::NodePayloadAMDX]),
    (
        KERNELS,
        &[
            StorageClass::CrossWorkgroup,
            StorageClass::Generic,
            StorageClass::AtomicCounter,
            StorageClass::CodeSectionINTEL,
            StorageClass::DeviceOnlyALTERA,
            StorageClass::HostOnlyALTERA,
        ],
    ),
];
