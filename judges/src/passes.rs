//! The passes of SPIRV-Tools that are judged one at a time.

use spirv_tools::opt::Passes;

/// The passes that must keep what a compute shader means, by name. Not among them are those that
/// relax precision, turn what they do not know into something else, touch only what these modules
/// do not hold (debug information, specialization constants, `OpKill`, descriptors in arrays), or
/// are for other stages.
pub const PASSES: &[(&str, Passes)] = &[
    ("AggressiveDCE", Passes::AggressiveDCE),
    ("BlockMerge", Passes::BlockMerge),
    ("CFGCleanup", Passes::CFGCleanup),
    ("CodeSinking", Passes::CodeSinking),
    ("CombineAccessChains", Passes::CombineAccessChains),
    ("CompactIds", Passes::CompactIds),
    ("ConditionalConstantPropagation", Passes::ConditionalConstantPropagation),
    ("CopyPropagateArrays", Passes::CopyPropagateArrays),
    ("DeadBranchElim", Passes::DeadBranchElim),
    ("DeadInsertElim", Passes::DeadInsertElim),
    ("DeadVariableElimination", Passes::DeadVariableElimination),
    ("EliminateDeadConstant", Passes::EliminateDeadConstant),
    ("EliminateDeadFunctions", Passes::EliminateDeadFunctions),
    ("EliminateDeadMembers", Passes::EliminateDeadMembers),
    ("FlattenDecoration", Passes::FlattenDecoration),
    ("FoldSpecConstantOpAndComposite", Passes::FoldSpecConstantOpAndComposite),
    ("GraphicsRobustAccess", Passes::GraphicsRobustAccess),
    ("IfConversion", Passes::IfConversion),
    ("InlineExhaustive", Passes::InlineExhaustive),
    ("InsertExtractElim", Passes::InsertExtractElim),
    ("LocalAccessChainConvert", Passes::LocalAccessChainConvert),
    ("LocalMultiStoreElim", Passes::LocalMultiStoreElim),
    ("LocalRedundancyElimination", Passes::LocalRedundancyElimination),
    ("LocalSingleBlockLoadStoreElim", Passes::LocalSingleBlockLoadStoreElim),
    ("LocalSingleStoreElim", Passes::LocalSingleStoreElim),
    ("LoopInvariantCodeMotion", Passes::LoopInvariantCodeMotion),
    ("LoopPeeling", Passes::LoopPeeling),
    ("LoopUnswitch", Passes::LoopUnswitch),
    ("MergeReturn", Passes::MergeReturn),
    ("PrivateToLocal", Passes::PrivateToLocal),
    ("ReduceLoadSize", Passes::ReduceLoadSize),
    ("RedundancyElimination", Passes::RedundancyElimination),
    ("RemoveDuplicates", Passes::RemoveDuplicates),
    ("RemoveUnusedInterfaceVariables", Passes::RemoveUnusedInterfaceVariables),
    ("SSARewrite", Passes::SSARewrite),
    ("Simplification", Passes::Simplification),
    ("StrengthReduction", Passes::StrengthReduction),
    ("UnifyConstant", Passes::UnifyConstant),
    ("UpgradeMemoryModel", Passes::UpgradeMemoryModel),
    ("VectorDCE", Passes::VectorDCE),
];
