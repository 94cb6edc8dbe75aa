//! Opcodes of SPIR-V: those of rspirv's tables, and newer ones.

use rspirv::grammar::{INSTRUCTION_TABLE, LogicalOperand, OperandKind, OperandQuantifier};
use rspirv::spirv;

/// The number of an instruction of SPIR-V, known or not.
///
/// The enumeration of rspirv cannot hold an opcode that is newer than its tables. `Display` prints
/// the name (`OpFAdd`), or `opcode 9999`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Opcode(pub u16);

/// Generates a constant for each opcode, and the grammar of those that rspirv lacks.
macro_rules! opcodes {
    (
        rspirv: $($known:ident)*;
        added: $($added:ident $number:literal [$($kind:ident $quantifier:ident),*])*
    ) => {
        #[expect(non_upper_case_globals, missing_docs, reason = "names of the specification")]
        impl Opcode {
            $(pub const $known: Self = Self(spirv::Op::$known as u16);)*
            $(pub const $added: Self = Self($number);)*
        }

        /// Number, name and operands of the instructions that rspirv lacks.
        pub(super) const ADDED: &[(u16, &str, &[LogicalOperand])] = &[$(
            ($number, stringify!($added), &[$(LogicalOperand {
                kind: OperandKind::$kind,
                quantifier: OperandQuantifier::$quantifier,
            }),*]),
        )*];

        #[cfg(test)]
        const KNOWN: &[&str] = &[$(stringify!($known)),*];
    };
}

impl Opcode {
    /// The opcode of a name, with or without `Op`; `None` for an unknown name.
    pub fn by_name(name: &str) -> Option<Self> {
        let bare = name.strip_prefix("Op").unwrap_or(name);
        let is_name = |known: &str| known == bare || known == name;
        let known =
            INSTRUCTION_TABLE.iter().find(|entry| is_name(entry.opname)).map(|entry| entry.opcode.into());
        known.or_else(|| ADDED.iter().find(|(_, name, _)| is_name(name)).map(|(number, ..)| Self(*number)))
    }

    /// All opcodes of the tables.
    pub fn all() -> impl Iterator<Item = Self> {
        let added = ADDED.iter().map(|&(number, ..)| Self(number));
        INSTRUCTION_TABLE.iter().map(|entry| entry.opcode.into()).chain(added)
    }

    /// Returns true for opcodes that define an undefined value, at module scope or in a function.
    pub fn is_undefined(self) -> bool {
        matches!(self, Self::Undef | Self::PoisonKHR)
    }

    /// Returns true for `OpControlBarrier` and both halves of a split one, whose operands are the
    /// same: `OpControlBarrierArriveEXT` and `OpControlBarrierWaitEXT` (rspirv has INTEL's names).
    pub fn is_control_barrier(self) -> bool {
        matches!(self, Self::ControlBarrier | Self::ControlBarrierArriveINTEL | Self::ControlBarrierWaitINTEL)
    }

    /// The opcode that an operand of `OpSpecConstantOp` contains; above 16 bits an unknown one.
    pub fn of_operand(word: u32) -> Self {
        Self(u16::try_from(word).unwrap_or(u16::MAX))
    }

    /// The opcode in the first word of an instruction.
    pub fn of_word(first: u32) -> Self {
        Self(first as u16)
    }
}

impl From<spirv::Op> for Opcode {
    fn from(op: spirv::Op) -> Self {
        Self(op as u16)
    }
}

opcodes! {
    rspirv:
        Nop Undef SourceContinued Source SourceExtension Name MemberName String Line Extension ExtInstImport
        ExtInst MemoryModel EntryPoint ExecutionMode Capability TypeVoid TypeBool TypeInt TypeFloat
        TypeVector TypeMatrix TypeImage TypeSampler TypeSampledImage TypeArray TypeRuntimeArray TypeStruct
        TypeOpaque TypePointer TypeFunction TypeEvent TypeDeviceEvent TypeReserveId TypeQueue TypePipe
        TypeForwardPointer ConstantTrue ConstantFalse Constant ConstantComposite ConstantSampler
        ConstantNull SpecConstantTrue SpecConstantFalse SpecConstant SpecConstantComposite SpecConstantOp
        Function FunctionParameter FunctionEnd FunctionCall Variable ImageTexelPointer Load Store CopyMemory
        CopyMemorySized AccessChain InBoundsAccessChain PtrAccessChain ArrayLength GenericPtrMemSemantics
        InBoundsPtrAccessChain Decorate MemberDecorate DecorationGroup GroupDecorate GroupMemberDecorate
        VectorExtractDynamic VectorInsertDynamic VectorShuffle CompositeConstruct CompositeExtract
        CompositeInsert CopyObject Transpose SampledImage ImageSampleImplicitLod ImageSampleExplicitLod
        ImageSampleDrefImplicitLod ImageSampleDrefExplicitLod ImageSampleProjImplicitLod
        ImageSampleProjExplicitLod ImageSampleProjDrefImplicitLod ImageSampleProjDrefExplicitLod ImageFetch
        ImageGather ImageDrefGather ImageRead ImageWrite Image ImageQueryFormat ImageQueryOrder
        ImageQuerySizeLod ImageQuerySize ImageQueryLod ImageQueryLevels ImageQuerySamples ConvertFToU
        ConvertFToS ConvertSToF ConvertUToF UConvert SConvert FConvert QuantizeToF16 ConvertPtrToU
        SatConvertSToU SatConvertUToS ConvertUToPtr PtrCastToGeneric GenericCastToPtr
        GenericCastToPtrExplicit Bitcast SNegate FNegate IAdd FAdd ISub FSub IMul FMul UDiv SDiv FDiv UMod
        SRem SMod FRem FMod VectorTimesScalar MatrixTimesScalar VectorTimesMatrix MatrixTimesVector
        MatrixTimesMatrix OuterProduct Dot IAddCarry ISubBorrow UMulExtended SMulExtended Any All IsNan
        IsInf IsFinite IsNormal SignBitSet LessOrGreater Ordered Unordered LogicalEqual LogicalNotEqual
        LogicalOr LogicalAnd LogicalNot Select IEqual INotEqual UGreaterThan SGreaterThan UGreaterThanEqual
        SGreaterThanEqual ULessThan SLessThan ULessThanEqual SLessThanEqual FOrdEqual FUnordEqual
        FOrdNotEqual FUnordNotEqual FOrdLessThan FUnordLessThan FOrdGreaterThan FUnordGreaterThan
        FOrdLessThanEqual FUnordLessThanEqual FOrdGreaterThanEqual FUnordGreaterThanEqual ShiftRightLogical
        ShiftRightArithmetic ShiftLeftLogical BitwiseOr BitwiseXor BitwiseAnd Not BitFieldInsert
        BitFieldSExtract BitFieldUExtract BitReverse BitCount DPdx DPdy Fwidth DPdxFine DPdyFine FwidthFine
        DPdxCoarse DPdyCoarse FwidthCoarse EmitVertex EndPrimitive EmitStreamVertex EndStreamPrimitive
        ControlBarrier MemoryBarrier AtomicLoad AtomicStore AtomicExchange AtomicCompareExchange
        AtomicCompareExchangeWeak AtomicIIncrement AtomicIDecrement AtomicIAdd AtomicISub AtomicSMin
        AtomicUMin AtomicSMax AtomicUMax AtomicAnd AtomicOr AtomicXor Phi LoopMerge SelectionMerge Label
        Branch BranchConditional Switch Kill Return ReturnValue Unreachable LifetimeStart LifetimeStop
        GroupAsyncCopy GroupWaitEvents GroupAll GroupAny GroupBroadcast GroupIAdd GroupFAdd GroupFMin
        GroupUMin GroupSMin GroupFMax GroupUMax GroupSMax ReadPipe WritePipe ReservedReadPipe
        ReservedWritePipe ReserveReadPipePackets ReserveWritePipePackets CommitReadPipe CommitWritePipe
        IsValidReserveId GetNumPipePackets GetMaxPipePackets GroupReserveReadPipePackets
        GroupReserveWritePipePackets GroupCommitReadPipe GroupCommitWritePipe EnqueueMarker EnqueueKernel
        GetKernelNDrangeSubGroupCount GetKernelNDrangeMaxSubGroupSize GetKernelWorkGroupSize
        GetKernelPreferredWorkGroupSizeMultiple RetainEvent ReleaseEvent CreateUserEvent IsValidEvent
        SetUserEventStatus CaptureEventProfilingInfo GetDefaultQueue BuildNDRange
        ImageSparseSampleImplicitLod ImageSparseSampleExplicitLod ImageSparseSampleDrefImplicitLod
        ImageSparseSampleDrefExplicitLod ImageSparseSampleProjImplicitLod ImageSparseSampleProjExplicitLod
        ImageSparseSampleProjDrefImplicitLod ImageSparseSampleProjDrefExplicitLod ImageSparseFetch
        ImageSparseGather ImageSparseDrefGather ImageSparseTexelsResident NoLine AtomicFlagTestAndSet
        AtomicFlagClear ImageSparseRead SizeOf TypePipeStorage ConstantPipeStorage CreatePipeFromPipeStorage
        GetKernelLocalSizeForSubgroupCount GetKernelMaxNumSubgroups TypeNamedBarrier NamedBarrierInitialize
        MemoryNamedBarrier ModuleProcessed ExecutionModeId DecorateId GroupNonUniformElect
        GroupNonUniformAll GroupNonUniformAny GroupNonUniformAllEqual GroupNonUniformBroadcast
        GroupNonUniformBroadcastFirst GroupNonUniformBallot GroupNonUniformInverseBallot
        GroupNonUniformBallotBitExtract GroupNonUniformBallotBitCount GroupNonUniformBallotFindLSB
        GroupNonUniformBallotFindMSB GroupNonUniformShuffle GroupNonUniformShuffleXor
        GroupNonUniformShuffleUp GroupNonUniformShuffleDown GroupNonUniformIAdd GroupNonUniformFAdd
        GroupNonUniformIMul GroupNonUniformFMul GroupNonUniformSMin GroupNonUniformUMin GroupNonUniformFMin
        GroupNonUniformSMax GroupNonUniformUMax GroupNonUniformFMax GroupNonUniformBitwiseAnd
        GroupNonUniformBitwiseOr GroupNonUniformBitwiseXor GroupNonUniformLogicalAnd
        GroupNonUniformLogicalOr GroupNonUniformLogicalXor GroupNonUniformQuadBroadcast
        GroupNonUniformQuadSwap CopyLogical PtrEqual PtrNotEqual PtrDiff ColorAttachmentReadEXT
        DepthAttachmentReadEXT StencilAttachmentReadEXT TypeTensorARM TensorReadARM TensorWriteARM
        TensorQuerySizeARM GraphConstantARM GraphEntryPointARM GraphARM GraphInputARM GraphSetOutputARM
        GraphEndARM TypeGraphARM TerminateInvocation TypeUntypedPointerKHR UntypedVariableKHR
        UntypedAccessChainKHR UntypedInBoundsAccessChainKHR SubgroupBallotKHR SubgroupFirstInvocationKHR
        UntypedPtrAccessChainKHR UntypedInBoundsPtrAccessChainKHR UntypedArrayLengthKHR UntypedPrefetchKHR
        FmaKHR SubgroupAllKHR SubgroupAnyKHR SubgroupAllEqualKHR GroupNonUniformRotateKHR
        SubgroupReadInvocationKHR ExtInstWithForwardRefsKHR UntypedGroupAsyncCopyKHR TraceRayKHR
        ExecuteCallableKHR ConvertUToAccelerationStructureKHR IgnoreIntersectionKHR TerminateRayKHR SDot
        UDot SUDot SDotAccSat UDotAccSat SUDotAccSat TypeCooperativeMatrixKHR CooperativeMatrixLoadKHR
        CooperativeMatrixStoreKHR CooperativeMatrixMulAddKHR CooperativeMatrixLengthKHR
        ConstantCompositeReplicateEXT SpecConstantCompositeReplicateEXT CompositeConstructReplicateEXT
        TypeRayQueryKHR RayQueryInitializeKHR RayQueryTerminateKHR RayQueryGenerateIntersectionKHR
        RayQueryConfirmIntersectionKHR RayQueryProceedKHR RayQueryGetIntersectionTypeKHR
        ImageSampleWeightedQCOM ImageBoxFilterQCOM ImageBlockMatchSSDQCOM ImageBlockMatchSADQCOM
        BitCastArrayQCOM ImageBlockMatchWindowSSDQCOM ImageBlockMatchWindowSADQCOM
        ImageBlockMatchGatherSSDQCOM ImageBlockMatchGatherSADQCOM CompositeConstructCoopMatQCOM
        CompositeExtractCoopMatQCOM ExtractSubArrayQCOM GroupIAddNonUniformAMD GroupFAddNonUniformAMD
        GroupFMinNonUniformAMD GroupUMinNonUniformAMD GroupSMinNonUniformAMD GroupFMaxNonUniformAMD
        GroupUMaxNonUniformAMD GroupSMaxNonUniformAMD FragmentMaskFetchAMD FragmentFetchAMD ReadClockKHR
        AllocateNodePayloadsAMDX EnqueueNodePayloadsAMDX TypeNodePayloadArrayAMDX
        FinishWritingNodePayloadAMDX NodePayloadArrayLengthAMDX IsNodePayloadValidAMDX ConstantStringAMDX
        SpecConstantStringAMDX GroupNonUniformQuadAllKHR GroupNonUniformQuadAnyKHR TypeBufferEXT
        BufferPointerEXT UntypedImageTexelPointerEXT MemberDecorateIdEXT ConstantSizeOfEXT
        HitObjectRecordHitMotionNV HitObjectRecordHitWithIndexMotionNV HitObjectRecordMissMotionNV
        HitObjectGetWorldToObjectNV HitObjectGetObjectToWorldNV HitObjectGetObjectRayDirectionNV
        HitObjectGetObjectRayOriginNV HitObjectTraceRayMotionNV HitObjectGetShaderRecordBufferHandleNV
        HitObjectGetShaderBindingTableRecordIndexNV HitObjectRecordEmptyNV HitObjectTraceRayNV
        HitObjectRecordHitNV HitObjectRecordHitWithIndexNV HitObjectRecordMissNV HitObjectExecuteShaderNV
        HitObjectGetCurrentTimeNV HitObjectGetAttributesNV HitObjectGetHitKindNV
        HitObjectGetPrimitiveIndexNV HitObjectGetGeometryIndexNV HitObjectGetInstanceIdNV
        HitObjectGetInstanceCustomIndexNV HitObjectGetWorldRayDirectionNV HitObjectGetWorldRayOriginNV
        HitObjectGetRayTMaxNV HitObjectGetRayTMinNV HitObjectIsEmptyNV HitObjectIsHitNV HitObjectIsMissNV
        ReorderThreadWithHitObjectNV ReorderThreadWithHintNV TypeHitObjectNV ImageSampleFootprintNV
        TypeVectorIdEXT CooperativeVectorMatrixMulNV CooperativeVectorOuterProductAccumulateNV
        CooperativeVectorReduceSumAccumulateNV CooperativeVectorMatrixMulAddNV CooperativeMatrixConvertNV
        EmitMeshTasksEXT SetMeshOutputsEXT GroupNonUniformPartitionEXT WritePackedPrimitiveIndices4x8NV
        FetchMicroTriangleVertexPositionNV FetchMicroTriangleVertexBarycentricNV CooperativeVectorLoadNV
        CooperativeVectorStoreNV HitObjectRecordFromQueryEXT HitObjectRecordMissEXT
        HitObjectRecordMissMotionEXT HitObjectGetIntersectionTriangleVertexPositionsEXT
        HitObjectGetRayFlagsEXT HitObjectSetShaderBindingTableRecordIndexEXT
        HitObjectReorderExecuteShaderEXT HitObjectTraceReorderExecuteEXT
        HitObjectTraceMotionReorderExecuteEXT TypeHitObjectEXT ReorderThreadWithHintEXT
        ReorderThreadWithHitObjectEXT HitObjectTraceRayEXT HitObjectTraceRayMotionEXT
        HitObjectRecordEmptyEXT HitObjectExecuteShaderEXT HitObjectGetCurrentTimeEXT
        HitObjectGetAttributesEXT HitObjectGetHitKindEXT HitObjectGetPrimitiveIndexEXT
        HitObjectGetGeometryIndexEXT HitObjectGetInstanceIdEXT HitObjectGetInstanceCustomIndexEXT
        HitObjectGetObjectRayOriginEXT HitObjectGetObjectRayDirectionEXT HitObjectGetWorldRayDirectionEXT
        HitObjectGetWorldRayOriginEXT HitObjectGetObjectToWorldEXT HitObjectGetWorldToObjectEXT
        HitObjectGetRayTMaxEXT ReportIntersectionKHR IgnoreIntersectionNV TerminateRayNV TraceNV
        TraceMotionNV TraceRayMotionNV RayQueryGetIntersectionTriangleVertexPositionsKHR
        TypeAccelerationStructureKHR ExecuteCallableNV RayQueryGetIntersectionClusterIdNV
        HitObjectGetClusterIdNV HitObjectGetRayTMinEXT HitObjectGetShaderBindingTableRecordIndexEXT
        HitObjectGetShaderRecordBufferHandleEXT HitObjectIsEmptyEXT HitObjectIsHitEXT HitObjectIsMissEXT
        TypeCooperativeMatrixNV CooperativeMatrixLoadNV CooperativeMatrixStoreNV CooperativeMatrixMulAddNV
        CooperativeMatrixLengthNV BeginInvocationInterlockEXT EndInvocationInterlockEXT
        CooperativeMatrixReduceNV CooperativeMatrixLoadTensorNV CooperativeMatrixStoreTensorNV
        CooperativeMatrixPerElementOpNV TypeTensorLayoutNV TypeTensorViewNV CreateTensorLayoutNV
        TensorLayoutSetDimensionNV TensorLayoutSetStrideNV TensorLayoutSliceNV TensorLayoutSetClampValueNV
        CreateTensorViewNV TensorViewSetDimensionNV TensorViewSetStrideNV DemoteToHelperInvocation
        IsHelperInvocationEXT TensorViewSetClipNV TensorLayoutSetBlockSizeNV CooperativeMatrixTransposeNV
        ConvertUToImageNV ConvertUToSamplerNV ConvertImageToUNV ConvertSamplerToUNV ConvertUToSampledImageNV
        ConvertSampledImageToUNV SamplerImageAddressingModeNV RawAccessChainNV
        RayQueryGetIntersectionSpherePositionNV RayQueryGetIntersectionSphereRadiusNV
        RayQueryGetIntersectionLSSPositionsNV RayQueryGetIntersectionLSSRadiiNV
        RayQueryGetIntersectionLSSHitValueNV HitObjectGetSpherePositionNV HitObjectGetSphereRadiusNV
        HitObjectGetLSSPositionsNV HitObjectGetLSSRadiiNV HitObjectIsSphereHitNV HitObjectIsLSSHitNV
        RayQueryIsSphereHitNV RayQueryIsLSSHitNV SubgroupShuffleINTEL SubgroupShuffleDownINTEL
        SubgroupShuffleUpINTEL SubgroupShuffleXorINTEL SubgroupBlockReadINTEL SubgroupBlockWriteINTEL
        SubgroupImageBlockReadINTEL SubgroupImageBlockWriteINTEL SubgroupImageMediaBlockReadINTEL
        SubgroupImageMediaBlockWriteINTEL UCountLeadingZerosINTEL UCountTrailingZerosINTEL AbsISubINTEL
        AbsUSubINTEL IAddSatINTEL UAddSatINTEL IAverageINTEL UAverageINTEL IAverageRoundedINTEL
        UAverageRoundedINTEL ISubSatINTEL USubSatINTEL IMul32x16INTEL UMul32x16INTEL
        ConstantFunctionPointerINTEL FunctionPointerCallINTEL AsmTargetINTEL AsmINTEL AsmCallINTEL
        AtomicFMinEXT AtomicFMaxEXT AssumeTrueKHR ExpectKHR DecorateString MemberDecorateString
        VmeImageINTEL TypeVmeImageINTEL TypeAvcImePayloadINTEL TypeAvcRefPayloadINTEL TypeAvcSicPayloadINTEL
        TypeAvcMcePayloadINTEL TypeAvcMceResultINTEL TypeAvcImeResultINTEL
        TypeAvcImeResultSingleReferenceStreamoutINTEL TypeAvcImeResultDualReferenceStreamoutINTEL
        TypeAvcImeSingleReferenceStreaminINTEL TypeAvcImeDualReferenceStreaminINTEL TypeAvcRefResultINTEL
        TypeAvcSicResultINTEL SubgroupAvcMceGetDefaultInterBaseMultiReferencePenaltyINTEL
        SubgroupAvcMceSetInterBaseMultiReferencePenaltyINTEL SubgroupAvcMceGetDefaultInterShapePenaltyINTEL
        SubgroupAvcMceSetInterShapePenaltyINTEL SubgroupAvcMceGetDefaultInterDirectionPenaltyINTEL
        SubgroupAvcMceSetInterDirectionPenaltyINTEL SubgroupAvcMceGetDefaultIntraLumaShapePenaltyINTEL
        SubgroupAvcMceGetDefaultInterMotionVectorCostTableINTEL
        SubgroupAvcMceGetDefaultHighPenaltyCostTableINTEL
        SubgroupAvcMceGetDefaultMediumPenaltyCostTableINTEL SubgroupAvcMceGetDefaultLowPenaltyCostTableINTEL
        SubgroupAvcMceSetMotionVectorCostFunctionINTEL SubgroupAvcMceGetDefaultIntraLumaModePenaltyINTEL
        SubgroupAvcMceGetDefaultNonDcLumaIntraPenaltyINTEL
        SubgroupAvcMceGetDefaultIntraChromaModeBasePenaltyINTEL SubgroupAvcMceSetAcOnlyHaarINTEL
        SubgroupAvcMceSetSourceInterlacedFieldPolarityINTEL
        SubgroupAvcMceSetSingleReferenceInterlacedFieldPolarityINTEL
        SubgroupAvcMceSetDualReferenceInterlacedFieldPolaritiesINTEL SubgroupAvcMceConvertToImePayloadINTEL
        SubgroupAvcMceConvertToImeResultINTEL SubgroupAvcMceConvertToRefPayloadINTEL
        SubgroupAvcMceConvertToRefResultINTEL SubgroupAvcMceConvertToSicPayloadINTEL
        SubgroupAvcMceConvertToSicResultINTEL SubgroupAvcMceGetMotionVectorsINTEL
        SubgroupAvcMceGetInterDistortionsINTEL SubgroupAvcMceGetBestInterDistortionsINTEL
        SubgroupAvcMceGetInterMajorShapeINTEL SubgroupAvcMceGetInterMinorShapeINTEL
        SubgroupAvcMceGetInterDirectionsINTEL SubgroupAvcMceGetInterMotionVectorCountINTEL
        SubgroupAvcMceGetInterReferenceIdsINTEL
        SubgroupAvcMceGetInterReferenceInterlacedFieldPolaritiesINTEL SubgroupAvcImeInitializeINTEL
        SubgroupAvcImeSetSingleReferenceINTEL SubgroupAvcImeSetDualReferenceINTEL
        SubgroupAvcImeRefWindowSizeINTEL SubgroupAvcImeAdjustRefOffsetINTEL
        SubgroupAvcImeConvertToMcePayloadINTEL SubgroupAvcImeSetMaxMotionVectorCountINTEL
        SubgroupAvcImeSetUnidirectionalMixDisableINTEL SubgroupAvcImeSetEarlySearchTerminationThresholdINTEL
        SubgroupAvcImeSetWeightedSadINTEL SubgroupAvcImeEvaluateWithSingleReferenceINTEL
        SubgroupAvcImeEvaluateWithDualReferenceINTEL SubgroupAvcImeEvaluateWithSingleReferenceStreaminINTEL
        SubgroupAvcImeEvaluateWithDualReferenceStreaminINTEL
        SubgroupAvcImeEvaluateWithSingleReferenceStreamoutINTEL
        SubgroupAvcImeEvaluateWithDualReferenceStreamoutINTEL
        SubgroupAvcImeEvaluateWithSingleReferenceStreaminoutINTEL
        SubgroupAvcImeEvaluateWithDualReferenceStreaminoutINTEL SubgroupAvcImeConvertToMceResultINTEL
        SubgroupAvcImeGetSingleReferenceStreaminINTEL SubgroupAvcImeGetDualReferenceStreaminINTEL
        SubgroupAvcImeStripSingleReferenceStreamoutINTEL SubgroupAvcImeStripDualReferenceStreamoutINTEL
        SubgroupAvcImeGetStreamoutSingleReferenceMajorShapeMotionVectorsINTEL
        SubgroupAvcImeGetStreamoutSingleReferenceMajorShapeDistortionsINTEL
        SubgroupAvcImeGetStreamoutSingleReferenceMajorShapeReferenceIdsINTEL
        SubgroupAvcImeGetStreamoutDualReferenceMajorShapeMotionVectorsINTEL
        SubgroupAvcImeGetStreamoutDualReferenceMajorShapeDistortionsINTEL
        SubgroupAvcImeGetStreamoutDualReferenceMajorShapeReferenceIdsINTEL
        SubgroupAvcImeGetBorderReachedINTEL SubgroupAvcImeGetTruncatedSearchIndicationINTEL
        SubgroupAvcImeGetUnidirectionalEarlySearchTerminationINTEL
        SubgroupAvcImeGetWeightingPatternMinimumMotionVectorINTEL
        SubgroupAvcImeGetWeightingPatternMinimumDistortionINTEL SubgroupAvcFmeInitializeINTEL
        SubgroupAvcBmeInitializeINTEL SubgroupAvcRefConvertToMcePayloadINTEL
        SubgroupAvcRefSetBidirectionalMixDisableINTEL SubgroupAvcRefSetBilinearFilterEnableINTEL
        SubgroupAvcRefEvaluateWithSingleReferenceINTEL SubgroupAvcRefEvaluateWithDualReferenceINTEL
        SubgroupAvcRefEvaluateWithMultiReferenceINTEL
        SubgroupAvcRefEvaluateWithMultiReferenceInterlacedINTEL SubgroupAvcRefConvertToMceResultINTEL
        SubgroupAvcSicInitializeINTEL SubgroupAvcSicConfigureSkcINTEL SubgroupAvcSicConfigureIpeLumaINTEL
        SubgroupAvcSicConfigureIpeLumaChromaINTEL SubgroupAvcSicGetMotionVectorMaskINTEL
        SubgroupAvcSicConvertToMcePayloadINTEL SubgroupAvcSicSetIntraLumaShapePenaltyINTEL
        SubgroupAvcSicSetIntraLumaModeCostFunctionINTEL SubgroupAvcSicSetIntraChromaModeCostFunctionINTEL
        SubgroupAvcSicSetBilinearFilterEnableINTEL SubgroupAvcSicSetSkcForwardTransformEnableINTEL
        SubgroupAvcSicSetBlockBasedRawSkipSadINTEL SubgroupAvcSicEvaluateIpeINTEL
        SubgroupAvcSicEvaluateWithSingleReferenceINTEL SubgroupAvcSicEvaluateWithDualReferenceINTEL
        SubgroupAvcSicEvaluateWithMultiReferenceINTEL
        SubgroupAvcSicEvaluateWithMultiReferenceInterlacedINTEL SubgroupAvcSicConvertToMceResultINTEL
        SubgroupAvcSicGetIpeLumaShapeINTEL SubgroupAvcSicGetBestIpeLumaDistortionINTEL
        SubgroupAvcSicGetBestIpeChromaDistortionINTEL SubgroupAvcSicGetPackedIpeLumaModesINTEL
        SubgroupAvcSicGetIpeChromaModeINTEL SubgroupAvcSicGetPackedSkcLumaCountThresholdINTEL
        SubgroupAvcSicGetPackedSkcLumaSumThresholdINTEL SubgroupAvcSicGetInterRawSadsINTEL
        VariableLengthArrayINTEL SaveMemoryINTEL RestoreMemoryINTEL ArbitraryFloatSinCosPiALTERA
        ArbitraryFloatCastALTERA ArbitraryFloatCastFromIntALTERA ArbitraryFloatCastToIntALTERA
        ArbitraryFloatAddALTERA ArbitraryFloatSubALTERA ArbitraryFloatMulALTERA ArbitraryFloatDivALTERA
        ArbitraryFloatGTALTERA ArbitraryFloatGEALTERA ArbitraryFloatLTALTERA ArbitraryFloatLEALTERA
        ArbitraryFloatEQALTERA ArbitraryFloatRecipALTERA ArbitraryFloatRSqrtALTERA ArbitraryFloatCbrtALTERA
        ArbitraryFloatHypotALTERA ArbitraryFloatSqrtALTERA ArbitraryFloatLogINTEL ArbitraryFloatLog2INTEL
        ArbitraryFloatLog10INTEL ArbitraryFloatLog1pINTEL ArbitraryFloatExpINTEL ArbitraryFloatExp2INTEL
        ArbitraryFloatExp10INTEL ArbitraryFloatExpm1INTEL ArbitraryFloatSinINTEL ArbitraryFloatCosINTEL
        ArbitraryFloatSinCosINTEL ArbitraryFloatSinPiINTEL ArbitraryFloatCosPiINTEL ArbitraryFloatASinINTEL
        ArbitraryFloatASinPiINTEL ArbitraryFloatACosINTEL ArbitraryFloatACosPiINTEL ArbitraryFloatATanINTEL
        ArbitraryFloatATanPiINTEL ArbitraryFloatATan2INTEL ArbitraryFloatPowINTEL ArbitraryFloatPowRINTEL
        ArbitraryFloatPowNINTEL LoopControlINTEL AliasDomainDeclINTEL AliasScopeDeclINTEL
        AliasScopeListDeclINTEL FixedSqrtALTERA FixedRecipALTERA FixedRsqrtALTERA FixedSinALTERA
        FixedCosALTERA FixedSinCosALTERA FixedSinPiALTERA FixedCosPiALTERA FixedSinCosPiALTERA
        FixedLogALTERA FixedExpALTERA PtrCastToCrossWorkgroupALTERA CrossWorkgroupCastToPtrALTERA
        ReadPipeBlockingALTERA WritePipeBlockingALTERA FPGARegALTERA RayQueryGetRayTMinKHR
        RayQueryGetRayFlagsKHR RayQueryGetIntersectionTKHR RayQueryGetIntersectionInstanceCustomIndexKHR
        RayQueryGetIntersectionInstanceIdKHR
        RayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR
        RayQueryGetIntersectionGeometryIndexKHR RayQueryGetIntersectionPrimitiveIndexKHR
        RayQueryGetIntersectionBarycentricsKHR RayQueryGetIntersectionFrontFaceKHR
        RayQueryGetIntersectionCandidateAABBOpaqueKHR RayQueryGetIntersectionObjectRayDirectionKHR
        RayQueryGetIntersectionObjectRayOriginKHR RayQueryGetWorldRayDirectionKHR
        RayQueryGetWorldRayOriginKHR RayQueryGetIntersectionObjectToWorldKHR
        RayQueryGetIntersectionWorldToObjectKHR AtomicFAddEXT TypeBufferSurfaceINTEL
        TypeStructContinuedINTEL ConstantCompositeContinuedINTEL SpecConstantCompositeContinuedINTEL
        CompositeConstructContinuedINTEL ConvertFToBF16INTEL ConvertBF16ToFINTEL ControlBarrierArriveINTEL
        ControlBarrierWaitINTEL ArithmeticFenceEXT TaskSequenceCreateALTERA TaskSequenceAsyncALTERA
        TaskSequenceGetALTERA TaskSequenceReleaseALTERA TypeTaskSequenceALTERA SubgroupBlockPrefetchINTEL
        Subgroup2DBlockLoadINTEL Subgroup2DBlockLoadTransformINTEL Subgroup2DBlockLoadTransposeINTEL
        Subgroup2DBlockPrefetchINTEL Subgroup2DBlockStoreINTEL SubgroupMatrixMultiplyAccumulateINTEL
        BitwiseFunctionINTEL UntypedVariableLengthArrayINTEL ConditionalExtensionINTEL
        ConditionalEntryPointINTEL ConditionalCapabilityINTEL SpecConstantTargetINTEL
        SpecConstantArchitectureINTEL SpecConstantCapabilitiesINTEL ConditionalCopyObjectINTEL GroupIMulKHR
        GroupFMulKHR GroupBitwiseAndKHR GroupBitwiseOrKHR GroupBitwiseXorKHR GroupLogicalAndKHR
        GroupLogicalOrKHR GroupLogicalXorKHR RoundFToTF32INTEL MaskedGatherINTEL MaskedScatterINTEL
        ConvertHandleToImageINTEL ConvertHandleToSamplerINTEL ConvertHandleToSampledImageINTEL;
    added:
        BitcastExtractEXT 4195 [IdResultType One, IdResult One, IdRef One, IdRef One]
        ImageGatherQCOM 4545 [IdResultType One, IdResult One, IdRef One, IdRef One, IdRef One, IdRef One, ImageOperands ZeroOrOne]
        AbortKHR 5121 [IdRef One, IdRef One]
        ConstantDataKHR 5147 [IdResultType One, IdResult One, LiteralInteger ZeroOrMore]
        SpecConstantDataKHR 5148 [IdResultType One, IdResult One, LiteralInteger ZeroOrMore]
        PoisonKHR 5158 [IdResultType One, IdResult One]
        FreezeKHR 5159 [IdResultType One, IdResult One, IdRef One]
        CooperativeMatrixGetCoordinateEXT 5363 [IdResultType One, IdResult One, IdRef One, IdRef One]
        PredicatedLoadINTEL 6258 [IdResultType One, IdResult One, IdRef One, IdRef One, IdRef One, MemoryAccess ZeroOrOne]
        PredicatedStoreINTEL 6259 [IdRef One, IdRef One, IdRef One, MemoryAccess ZeroOrOne]
        FDot2MixAcc32VALVE 6916 [IdResultType One, IdResult One, IdRef One, IdRef One, IdRef One]
        FDot2MixAcc16VALVE 6917 [IdResultType One, IdResult One, IdRef One, IdRef One, IdRef One]
        FDot4MixAcc32VALVE 6918 [IdResultType One, IdResult One, IdRef One, IdRef One, IdRef One]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_opcode_of_rspirv_has_a_constant() {
        let names: Vec<&str> = INSTRUCTION_TABLE.iter().map(|entry| entry.opname).collect();
        assert_eq!(KNOWN, names);
    }

    /// An added opcode that rspirv knows by now can be moved to the first list.
    #[test]
    fn added_opcodes_are_those_that_rspirv_lacks() {
        for (number, name, _) in ADDED {
            assert_eq!(spirv::Op::from_u32((*number).into()), None, "{name}");
        }
    }

    #[test]
    fn opcodes_have_names() {
        assert_eq!(Opcode::FAdd.to_string(), "OpFAdd");
        assert_eq!(Opcode::FreezeKHR.to_string(), "OpFreezeKHR");
        assert_eq!(Opcode(9999).to_string(), "opcode 9999");
        assert_eq!(
            ["OpFAdd", "FAdd", "FreezeKHR"].map(|name| Opcode::by_name(name).unwrap().0),
            [129, 129, 5159]
        );
        assert_eq!(Opcode::by_name("FAddd"), None);
    }
}
