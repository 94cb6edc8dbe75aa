//! The table is whole: an instruction that runs and has operands of a type is in it, or stands here
//! with the test that has its types.

use std::collections::BTreeSet;

use anyhit_engine::module::Opcode;
use anyhit_engine::ops::support::{self, Support};
use rspirv::grammar::{ExtInstOp, GLSL_STD_450_INSTRUCTION_TABLE, OperandKind};

use crate::execution::instructions::operand_types::{special, table};

/// Instructions whose operands are numbers, and which other tests of this folder run with every
/// type.
const ELSEWHERE: &[(&str, &[&str])] = &[
    (
        "operand_types/indices.rs",
        &[
            "AccessChain",
            "InBoundsAccessChain",
            "PtrAccessChain",
            "InBoundsPtrAccessChain",
            "PtrDiff",
            "Switch",
            "BranchConditional",
            "GroupNonUniformBallot",
            "GroupNonUniformBallotBitExtract",
            "GroupNonUniformBallotBitCount",
            "GroupNonUniformBallotFindLSB",
            "TypeArray",
        ],
    ),
    ("operand_types/images.rs", &["ImageFetch", "ImageSampleExplicitLod"]),
    (
        "untyped_pointers.rs; places are read as those of operand_types/indices.rs are",
        &[
            "UntypedAccessChainKHR",
            "UntypedInBoundsAccessChainKHR",
            "UntypedPtrAccessChainKHR",
            "UntypedInBoundsPtrAccessChainKHR",
            "CopyMemorySized",
        ],
    ),
    ("heaps.rs", &["BufferPointerEXT", "UntypedImageTexelPointerEXT", "ConstantSizeOfEXT"]),
    (
        "cooperative_matrices.rs",
        &[
            "CooperativeMatrixLoadKHR",
            "CooperativeMatrixStoreKHR",
            "CooperativeMatrixMulAddKHR",
            "CooperativeMatrixLengthKHR",
            "CooperativeMatrixConvertNV",
            "CooperativeMatrixTransposeNV",
        ],
    ),
    (
        "cooperative_vectors.rs",
        &[
            "CooperativeVectorLoadNV",
            "CooperativeVectorStoreNV",
            "CooperativeVectorMatrixMulNV",
            "CooperativeVectorMatrixMulAddNV",
            "CooperativeVectorOuterProductAccumulateNV",
            "CooperativeVectorReduceSumAccumulateNV",
        ],
    ),
    ("float_encodings.rs", &["FDot2MixAcc32VALVE", "FDot2MixAcc16VALVE", "FDot4MixAcc32VALVE"]),
    (
        "operand_types/matrices.rs",
        &[
            "MatrixTimesScalar",
            "VectorTimesMatrix",
            "MatrixTimesVector",
            "MatrixTimesMatrix",
            "OuterProduct",
            "Transpose",
        ],
    ),
    (
        "operand_types/memory.rs",
        &[
            "Load",
            "Store",
            "AtomicLoad",
            "AtomicStore",
            "AtomicExchange",
            "AtomicCompareExchange",
            "AtomicIIncrement",
            "AtomicIDecrement",
            "AtomicIAdd",
            "AtomicISub",
            "AtomicSMin",
            "AtomicUMin",
            "AtomicSMax",
            "AtomicUMax",
            "AtomicAnd",
            "AtomicOr",
            "AtomicXor",
            "AtomicFAddEXT",
            "AtomicFMinEXT",
            "AtomicFMaxEXT",
        ],
    ),
];

/// Instructions whose operands are no numbers of a free type, with the reason.
const NO_NUMBERS: &[(&str, &[&str])] = &[
    (
        "what the loader reads: types, constants, names, decorations",
        &[
            "Source",
            "Name",
            "MemberName",
            "Line",
            "EntryPoint",
            "ExecutionMode",
            "TypeVector",
            "TypeMatrix",
            "TypeImage",
            "TypeSampledImage",
            "TypeRuntimeArray",
            "TypeStruct",
            "TypePointer",
            "TypeFunction",
            "TypeForwardPointer",
            "ConstantComposite",
            "SpecConstantComposite",
            "Decorate",
            "MemberDecorate",
            "GroupDecorate",
            "GroupMemberDecorate",
            "ExecutionModeId",
            "DecorateId",
            "ExtInstWithForwardRefsKHR",
            "ConstantCompositeReplicateEXT",
            "SpecConstantCompositeReplicateEXT",
            "TypeVectorIdEXT",
            "TypeCooperativeMatrixKHR",
            "DecorateString",
            "MemberDecorateString",
            "MemberDecorateIdEXT",
        ],
    ),
    (
        "control flow and calls: labels, functions, and values of a type that is told",
        &[
            "Function",
            "FunctionCall",
            "Variable",
            "UntypedVariableKHR",
            "LoopMerge",
            "SelectionMerge",
            "Branch",
            "ReturnValue",
        ],
    ),
    (
        "composites, copies and pointers: values of any type, literal indices",
        &[
            "CompositeExtract",
            "CopyLogical",
            "CompositeConstructReplicateEXT",
            "CopyMemory",
            "ArrayLength",
            "UntypedArrayLengthKHR",
            "AbortKHR",
            "ConvertPtrToU",
            "ConvertUToPtr",
            "PtrEqual",
            "PtrNotEqual",
            "RawAccessChainNV",
        ],
    ),
    ("an instruction set, whose instructions have tables of their own", &["ExtInst"]),
    ("a bool, or (OpSatConvertSToU) what only kernels have", &["AssumeTrueKHR", "SatConvertSToU"]),
    (
        "floats of 32 bits, and only in compute shaders with a derivative group",
        &[
            "DPdx",
            "DPdy",
            "Fwidth",
            "DPdxFine",
            "DPdyFine",
            "FwidthFine",
            "DPdxCoarse",
            "DPdyCoarse",
            "FwidthCoarse",
        ],
    ),
    (
        "images and samplers; what is a number is read as those of operand_types/images.rs are",
        &[
            "ImageTexelPointer",
            "SampledImage",
            "ImageSampleImplicitLod",
            "ImageSampleDrefImplicitLod",
            "ImageSampleDrefExplicitLod",
            "ImageSampleProjImplicitLod",
            "ImageSampleProjExplicitLod",
            "ImageSampleProjDrefImplicitLod",
            "ImageSampleProjDrefExplicitLod",
            "ImageGather",
            "ImageDrefGather",
            "ImageRead",
            "ImageWrite",
            "Image",
            "ImageQuerySizeLod",
            "ImageQuerySize",
            "ImageQueryLod",
            "ImageQueryLevels",
            "ImageQuerySamples",
            "ImageSparseSampleImplicitLod",
            "ImageSparseSampleExplicitLod",
            "ImageSparseSampleDrefImplicitLod",
            "ImageSparseSampleDrefExplicitLod",
            "ImageSparseFetch",
            "ImageSparseGather",
            "ImageSparseDrefGather",
            "ImageSparseTexelsResident",
            "ImageSparseRead",
            "ImageSampleWeightedQCOM",
            "ImageBoxFilterQCOM",
            "ImageBlockMatchSSDQCOM",
            "ImageBlockMatchSADQCOM",
            "ImageBlockMatchWindowSSDQCOM",
            "ImageBlockMatchWindowSADQCOM",
            "ImageBlockMatchGatherSSDQCOM",
            "ImageBlockMatchGatherSADQCOM",
            "ImageSampleFootprintNV",
        ],
    ),
    (
        "rays, queries and hit objects: handles, and numbers of 32 bits",
        &[
            "TraceRayKHR",
            "ExecuteCallableKHR",
            "ConvertUToAccelerationStructureKHR",
            "ReportIntersectionKHR",
            "TraceNV",
            "TraceMotionNV",
            "TraceRayMotionNV",
            "ExecuteCallableNV",
            "RayQueryInitializeKHR",
            "RayQueryTerminateKHR",
            "RayQueryGenerateIntersectionKHR",
            "RayQueryConfirmIntersectionKHR",
            "RayQueryProceedKHR",
            "RayQueryGetIntersectionTypeKHR",
            "RayQueryGetIntersectionTriangleVertexPositionsKHR",
            "RayQueryGetIntersectionClusterIdNV",
            "RayQueryGetIntersectionSpherePositionNV",
            "RayQueryGetIntersectionSphereRadiusNV",
            "RayQueryGetIntersectionLSSPositionsNV",
            "RayQueryGetIntersectionLSSRadiiNV",
            "RayQueryGetIntersectionLSSHitValueNV",
            "RayQueryIsSphereHitNV",
            "RayQueryIsLSSHitNV",
            "RayQueryGetRayTMinKHR",
            "RayQueryGetRayFlagsKHR",
            "RayQueryGetIntersectionTKHR",
            "RayQueryGetIntersectionInstanceCustomIndexKHR",
            "RayQueryGetIntersectionInstanceIdKHR",
            "RayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR",
            "RayQueryGetIntersectionGeometryIndexKHR",
            "RayQueryGetIntersectionPrimitiveIndexKHR",
            "RayQueryGetIntersectionBarycentricsKHR",
            "RayQueryGetIntersectionFrontFaceKHR",
            "RayQueryGetIntersectionCandidateAABBOpaqueKHR",
            "RayQueryGetIntersectionObjectRayDirectionKHR",
            "RayQueryGetIntersectionObjectRayOriginKHR",
            "RayQueryGetWorldRayDirectionKHR",
            "RayQueryGetWorldRayOriginKHR",
            "RayQueryGetIntersectionObjectToWorldKHR",
            "RayQueryGetIntersectionWorldToObjectKHR",
            "HitObjectRecordHitMotionNV",
            "HitObjectRecordHitWithIndexMotionNV",
            "HitObjectRecordMissMotionNV",
            "HitObjectGetWorldToObjectNV",
            "HitObjectGetObjectToWorldNV",
            "HitObjectGetObjectRayDirectionNV",
            "HitObjectGetObjectRayOriginNV",
            "HitObjectTraceRayMotionNV",
            "HitObjectGetShaderRecordBufferHandleNV",
            "HitObjectGetShaderBindingTableRecordIndexNV",
            "HitObjectRecordEmptyNV",
            "HitObjectTraceRayNV",
            "HitObjectRecordHitNV",
            "HitObjectRecordHitWithIndexNV",
            "HitObjectRecordMissNV",
            "HitObjectExecuteShaderNV",
            "HitObjectGetCurrentTimeNV",
            "HitObjectGetAttributesNV",
            "HitObjectGetHitKindNV",
            "HitObjectGetPrimitiveIndexNV",
            "HitObjectGetGeometryIndexNV",
            "HitObjectGetInstanceIdNV",
            "HitObjectGetInstanceCustomIndexNV",
            "HitObjectGetWorldRayDirectionNV",
            "HitObjectGetWorldRayOriginNV",
            "HitObjectGetRayTMaxNV",
            "HitObjectGetRayTMinNV",
            "HitObjectIsEmptyNV",
            "HitObjectIsHitNV",
            "HitObjectIsMissNV",
            "ReorderThreadWithHitObjectNV",
            "ReorderThreadWithHintNV",
            "HitObjectRecordFromQueryEXT",
            "HitObjectRecordMissEXT",
            "HitObjectRecordMissMotionEXT",
            "HitObjectGetIntersectionTriangleVertexPositionsEXT",
            "HitObjectGetRayFlagsEXT",
            "HitObjectSetShaderBindingTableRecordIndexEXT",
            "HitObjectReorderExecuteShaderEXT",
            "HitObjectTraceReorderExecuteEXT",
            "HitObjectTraceMotionReorderExecuteEXT",
            "ReorderThreadWithHintEXT",
            "ReorderThreadWithHitObjectEXT",
            "HitObjectTraceRayEXT",
            "HitObjectTraceRayMotionEXT",
            "HitObjectRecordEmptyEXT",
            "HitObjectExecuteShaderEXT",
            "HitObjectGetCurrentTimeEXT",
            "HitObjectGetAttributesEXT",
            "HitObjectGetHitKindEXT",
            "HitObjectGetPrimitiveIndexEXT",
            "HitObjectGetGeometryIndexEXT",
            "HitObjectGetInstanceIdEXT",
            "HitObjectGetInstanceCustomIndexEXT",
            "HitObjectGetObjectRayOriginEXT",
            "HitObjectGetObjectRayDirectionEXT",
            "HitObjectGetWorldRayDirectionEXT",
            "HitObjectGetWorldRayOriginEXT",
            "HitObjectGetObjectToWorldEXT",
            "HitObjectGetWorldToObjectEXT",
            "HitObjectGetRayTMaxEXT",
            "HitObjectGetClusterIdNV",
            "HitObjectGetRayTMinEXT",
            "HitObjectGetShaderBindingTableRecordIndexEXT",
            "HitObjectGetShaderRecordBufferHandleEXT",
            "HitObjectIsEmptyEXT",
            "HitObjectIsHitEXT",
            "HitObjectIsMissEXT",
            "HitObjectGetSpherePositionNV",
            "HitObjectGetSphereRadiusNV",
            "HitObjectGetLSSPositionsNV",
            "HitObjectGetLSSRadiiNV",
            "HitObjectIsSphereHitNV",
            "HitObjectIsLSSHitNV",
        ],
    ),
    (
        "subgroups: values of a type that is told, whose rows are in the table, and places that are read as those of operand_types/indices.rs are",
        &[
            "GroupNonUniformBroadcast",
            "GroupNonUniformInverseBallot",
            "GroupNonUniformBallotFindMSB",
            "GroupNonUniformShuffleUp",
            "GroupNonUniformShuffleDown",
            "GroupNonUniformQuadBroadcast",
            "GroupNonUniformQuadSwap",
            "SubgroupBallotKHR",
            "SubgroupFirstInvocationKHR",
            "SubgroupAllKHR",
            "SubgroupAnyKHR",
            "SubgroupAllEqualKHR",
            "GroupNonUniformRotateKHR",
            "SubgroupReadInvocationKHR",
            "GroupIAddNonUniformAMD",
            "GroupFAddNonUniformAMD",
            "GroupFMinNonUniformAMD",
            "GroupUMinNonUniformAMD",
            "GroupSMinNonUniformAMD",
            "GroupFMaxNonUniformAMD",
            "GroupUMaxNonUniformAMD",
            "GroupSMaxNonUniformAMD",
            "GroupNonUniformQuadAllKHR",
            "GroupNonUniformQuadAnyKHR",
            "GroupNonUniformPartitionEXT",
        ],
    ),
];

/// `GLSL.std.450`
const GLSL_ELSEWHERE: &[(&str, &[&str])] = &[
    ("operand_types/parts.rs", &["Modf", "Frexp", "FrexpStruct"]),
    ("operand_types/matrices.rs", &["Determinant", "MatrixInverse"]),
];

#[test]
fn every_instruction_with_numeric_operands_is_in_the_table() {
    let tabled: BTreeSet<&str> =
        table().iter().filter(|(_, glsl)| !glsl).map(|(rule, _)| rule.name).collect();
    let special: BTreeSet<&str> = special::cases().iter().map(|case| case.name).collect();
    let listed = |lists: &[(&str, &[&str])], name: &str| lists.iter().any(|(_, names)| names.contains(&name));
    let mut missing = Vec::new();
    let mut seen = 0;
    for opcode in Opcode::all() {
        let takes_ids = opcode.operands().iter().any(|operand| operand.kind == OperandKind::IdRef);
        let runs = support::opcode(opcode).is_some_and(Support::is_supported);
        if !takes_ids || !runs {
            continue;
        }
        seen += 1;
        let text = opcode.to_string();
        let name = text.trim_start_matches("Op");
        let known = tabled.contains(name) || special.contains(name);
        if !known && !listed(ELSEWHERE, name) && !listed(NO_NUMBERS, name) {
            missing.push(text);
        }
    }
    assert!(seen > 200, "{seen}");
    assert!(missing.is_empty(), "no types for: {}", missing.join(" "));
}

#[test]
fn every_instruction_of_glsl_is_in_the_table() {
    let tabled: BTreeSet<&str> =
        table().iter().filter(|(_, glsl)| *glsl).map(|(rule, _)| rule.name).collect();
    let mut missing = Vec::new();
    for entry in GLSL_STD_450_INSTRUCTION_TABLE.iter() {
        let ExtInstOp::GlslStd450(number) = entry.opcode else { continue };
        let runs = support::glsl(number as u32).is_some_and(Support::is_supported);
        let listed = GLSL_ELSEWHERE.iter().any(|(_, names)| names.contains(&entry.opname));
        if runs && !listed && !tabled.contains(entry.opname) {
            missing.push(entry.opname);
        }
    }
    assert!(missing.is_empty(), "no types for: {}", missing.join(" "));
}
