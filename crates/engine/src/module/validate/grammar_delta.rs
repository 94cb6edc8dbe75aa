//! What the grammar of SPIR-V 1.6, revision 7, says and rspirv's tables lack.
//!
//! Generated: `tests/modules/grammar_delta.rs` says how, and compares.

use super::entry::{Entry, Kind, entry};

/// Instructions that rspirv does not know, or with other requirements.
pub(super) const OPCODES: &[Entry] = &[
    entry(4195, "BitcastExtractEXT", &[4232], &[]),
    entry(4545, "ImageGatherQCOM", &[4543, 4544], &[]),
    entry(5121, "AbortKHR", &[5120], &[]),
    entry(5147, "ConstantDataKHR", &[5146], &[]),
    entry(5148, "SpecConstantDataKHR", &[5146], &[]),
    entry(5158, "PoisonKHR", &[5156], &[]),
    entry(5159, "FreezeKHR", &[5156], &[]),
    entry(5293, "CooperativeMatrixConvertUseEXT", &[5429, 5431], &[]),
    entry(5363, "CooperativeMatrixGetCoordinateEXT", &[5438], &[]),
    entry(6258, "PredicatedLoadINTEL", &[6257], &[]),
    entry(6259, "PredicatedStoreINTEL", &[6257], &[]),
    entry(6916, "FDot2MixAcc32VALVE", &[6912, 6914], &[]),
    entry(6917, "FDot2MixAcc16VALVE", &[6913, 6914], &[]),
    entry(6918, "FDot4MixAcc32VALVE", &[6915], &[]),
];

/// The first minor version of instructions, where it is neither 1.0 nor that of an extension alone.
pub(super) const OPCODES_SINCE: &[(u8, &[u32])] = &[
    (1, &[321, 322, 323, 324, 325, 326, 327, 328, 329, 330]),
    (2, &[331, 332]),
    (3, &[333, 334, 335, 336, 337, 338, 339, 340, 341, 342, 343, 344, 345, 346, 347, 348, 349, 350, 351, 352, 353, 354, 355, 356, 357, 358, 359, 360, 361, 362, 363, 364, 365, 366]),
    (4, &[400, 401, 402, 403, 5632, 5633]),
    (6, &[4416, 4450, 4451, 4452, 4453, 4454, 4455, 5380]),
];

/// The last minor version of instructions that a later one lacks.
pub(super) const OPCODES_UNTIL: &[(u8, &[u32])] = &[
    (3, &[231]),
    (5, &[161]),
];

/// Enumerants that rspirv does not know, or with other requirements.
pub(super) const ENUMERANTS: &[(Kind, &[Entry])] = &[
    (Kind::LoopControl, &[
    entry(268435456, "MultipleWaitQueuesQCOM", &[], &[]),
    ]),
    (Kind::SourceLanguage, &[
    entry(14, "Pred", &[], &[]),
    entry(15, "ApilaJai", &[], &[]),
    ]),
    (Kind::ExecutionMode, &[
    entry(5157, "ArithmeticPoisonKHR", &[5156], &[]),
    entry(6031, "OpacityMicromapIdKHR", &[6032], &[]),
    ]),
    (Kind::LinkageType, &[
    entry(3, "WeakAMD", &[5181], &[]),
    ]),
    (Kind::Decoration, &[
    entry(5145, "UTFEncodedKHR", &[5146], &[]),
    entry(5440, "CooperativeMatrixTransposeEXT", &[5429], &[]),
    entry(7040, "IntrinsicSAMSUNG", &[7041], &[]),
    ]),
    (Kind::Capability, &[
    entry(4228, "Float6EXT", &[], &["SPV_EXT_ocp_microscaling_types"]),
    entry(4229, "Float4EXT", &[], &["SPV_EXT_ocp_microscaling_types"]),
    entry(4230, "Float8UnsignedE8M0EXT", &[], &["SPV_EXT_ocp_microscaling_types"]),
    entry(4231, "MXInt8EXT", &[], &["SPV_EXT_ocp_microscaling_types"]),
    entry(4232, "BitcastExtractEXT", &[], &["SPV_EXT_ocp_microscaling_types"]),
    entry(4539, "MultipleWaitQueuesQCOM", &[], &["SPV_QCOM_multiple_wait_queues"]),
    entry(4543, "ImageGatherLinearQCOM", &[], &["SPV_QCOM_image_processing3"]),
    entry(4544, "ImageGatherExtendedModesQCOM", &[], &["SPV_QCOM_image_processing3"]),
    entry(5016, "Int64ImageEXT", &[11], &["SPV_EXT_shader_image_int64"]),
    entry(5120, "AbortKHR", &[], &["SPV_KHR_abort"]),
    entry(5146, "ConstantDataKHR", &[], &["SPV_KHR_constant_data"]),
    entry(5156, "PoisonFreezeKHR", &[], &["SPV_KHR_poison_freeze"]),
    entry(5181, "WeakLinkageAMD", &[5], &["SPV_AMD_weak_linkage"]),
    entry(5381, "RayTracingOpacityMicromapKHR", &[1], &["SPV_KHR_opacity_micromap", "SPV_EXT_opacity_micromap"]),
    entry(5429, "CooperativeMatrixConversionsEXT", &[], &["SPV_EXT_cooperative_matrix_maintenance1"]),
    entry(5430, "CooperativeMatrixReductionsEXT", &[], &["SPV_EXT_cooperative_matrix_maintenance1", "SPV_NV_cooperative_matrix2"]),
    entry(5432, "CooperativeMatrixPerElementOperationsEXT", &[], &["SPV_EXT_cooperative_matrix_maintenance1", "SPV_NV_cooperative_matrix2"]),
    entry(5438, "CooperativeMatrixGetCoordinateEXT", &[], &["SPV_EXT_cooperative_matrix_maintenance1"]),
    entry(5447, "CooperativeMatrixDecodeVectorNV", &[5434], &["SPV_NV_cooperative_matrix_decode_vector"]),
    entry(6032, "RayTracingOpacityMicromapExecutionModeKHR", &[1], &["SPV_KHR_opacity_micromap"]),
    entry(6141, "SplitBarrierEXT", &[], &["SPV_EXT_split_barrier", "SPV_INTEL_split_barrier"]),
    entry(6257, "PredicatedIOINTEL", &[], &["SPV_INTEL_predicated_io"]),
    entry(6265, "RoundedDivideSqrtINTEL", &[], &["SPV_INTEL_rounded_divide_sqrt"]),
    entry(6912, "DotProductFloat16AccFloat32VALVE", &[9], &["SPV_VALVE_mixed_float_dot_product"]),
    entry(6913, "DotProductFloat16AccFloat16VALVE", &[9], &["SPV_VALVE_mixed_float_dot_product"]),
    entry(6914, "DotProductBFloat16AccVALVE", &[5116], &["SPV_VALVE_mixed_float_dot_product"]),
    entry(6915, "DotProductFloat8AccFloat32VALVE", &[4212], &["SPV_VALVE_mixed_float_dot_product"]),
    entry(7041, "IntrinsicSAMSUNG", &[], &["SPV_SAMSUNG_intrinsic"]),
    ]),
    (Kind::TensorAddressingOperands, &[
    entry(4, "DecodeVectorFunc", &[5447], &[]),
    ]),
    (Kind::FPEncoding, &[
    entry(4223, "Float6E2M3EXT", &[4228], &[]),
    entry(4224, "Float6E3M2EXT", &[4228], &[]),
    entry(4225, "Float4E2M1EXT", &[4229], &[]),
    entry(4226, "Float8UnsignedE8M0EXT", &[4230], &[]),
    entry(4227, "MXInt8EXT", &[4231], &[]),
    ]),
];

/// The first minor version of enumerants, where it is neither 1.0 nor that of an extension alone.
pub(super) const ENUMERANTS_SINCE: &[(Kind, u8, &[u32])] = &[
    (Kind::ImageOperands, 4, &[4096, 8192]),
    (Kind::ImageOperands, 5, &[256, 512, 1024, 2048]),
    (Kind::ImageOperands, 6, &[16384]),
    (Kind::LoopControl, 1, &[4, 8]),
    (Kind::LoopControl, 4, &[16, 32, 64, 128, 256]),
    (Kind::MemorySemantics, 5, &[4096, 8192, 16384, 32768]),
    (Kind::MemoryAccess, 5, &[8, 16, 32]),
    (Kind::AddressingModel, 5, &[5348]),
    (Kind::MemoryModel, 5, &[3]),
    (Kind::ExecutionMode, 1, &[33, 34, 35, 36]),
    (Kind::ExecutionMode, 2, &[37, 38, 39]),
    (Kind::ExecutionMode, 4, &[4459, 4460, 4461, 4462, 4463]),
    (Kind::StorageClass, 3, &[12]),
    (Kind::StorageClass, 4, &[5402]),
    (Kind::StorageClass, 5, &[5349]),
    (Kind::Decoration, 1, &[45]),
    (Kind::Decoration, 2, &[46, 47]),
    (Kind::Decoration, 4, &[27, 4469, 4470, 5634, 5635]),
    (Kind::Decoration, 5, &[5300, 5355, 5356]),
    (Kind::BuiltIn, 3, &[4416, 4417, 4418, 4419, 4420, 4424, 4425, 4426, 4438, 4440]),
    (Kind::Scope, 5, &[5]),
    (Kind::GroupOperation, 3, &[3]),
    (Kind::Capability, 0, &[18]),
    (Kind::Capability, 1, &[58, 59, 60]),
    (Kind::Capability, 3, &[61, 62, 63, 64, 65, 66, 67, 68, 4427, 4433, 4434, 4435, 4436, 4437, 4439, 4441, 4442]),
    (Kind::Capability, 4, &[4464, 4465, 4466, 4467, 4468]),
    (Kind::Capability, 5, &[69, 70, 4448, 4449, 4450, 5301, 5302, 5303, 5304, 5305, 5306, 5307, 5308, 5309, 5310, 5311, 5312, 5345, 5346, 5347]),
    (Kind::Capability, 6, &[71, 5379, 6016, 6017, 6018, 6019]),
    (Kind::PackedVectorFormat, 6, &[0]),
];

/// The last minor version of enumerants that a later one lacks.
pub(super) const ENUMERANTS_UNTIL: &[(Kind, u8, &[u32])] = &[
    (Kind::Decoration, 3, &[3]),
];

/// Capabilities of SPIR-V itself that no feature, extension or version of Vulkan enables.
pub(super) const NOT_IN_VULKAN: &[u32] = &[4, 5, 6, 7, 8, 13, 14, 15, 17, 18, 19, 20, 21, 36, 37, 38, 58, 59, 60, 71];
