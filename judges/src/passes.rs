//! What SPIRV-Tools is judged on: its passes one at a time, and all of them.

use spirv_tools::opt::Passes;

use crate::Recipe;

/// The passes that must keep what a compute shader means, by name, and `-O`. Not among them are
/// those that relax precision, turn what they do not know into something else, touch only what
/// these modules do not hold (debug information, specialization constants, `OpKill`, descriptors in
/// arrays), or are for other stages.
pub const RECIPES: &[(&str, Recipe)] = &[
    ("AggressiveDCE", Recipe::Pass(Passes::AggressiveDCE)),
    ("BlockMerge", Recipe::Pass(Passes::BlockMerge)),
    ("CFGCleanup", Recipe::Pass(Passes::CFGCleanup)),
    ("CodeSinking", Recipe::Pass(Passes::CodeSinking)),
    ("CombineAccessChains", Recipe::Pass(Passes::CombineAccessChains)),
    ("CompactIds", Recipe::Pass(Passes::CompactIds)),
    ("ConditionalConstantPropagation", Recipe::Pass(Passes::ConditionalConstantPropagation)),
    ("CopyPropagateArrays", Recipe::Pass(Passes::CopyPropagateArrays)),
    ("DeadBranchElim", Recipe::Pass(Passes::DeadBranchElim)),
    ("DeadInsertElim", Recipe::Pass(Passes::DeadInsertElim)),
    ("DeadVariableElimination", Recipe::Pass(Passes::DeadVariableElimination)),
    ("EliminateDeadConstant", Recipe::Pass(Passes::EliminateDeadConstant)),
    ("EliminateDeadFunctions", Recipe::Pass(Passes::EliminateDeadFunctions)),
    ("EliminateDeadMembers", Recipe::Pass(Passes::EliminateDeadMembers)),
    ("FlattenDecoration", Recipe::Pass(Passes::FlattenDecoration)),
    ("FoldSpecConstantOpAndComposite", Recipe::Pass(Passes::FoldSpecConstantOpAndComposite)),
    ("GraphicsRobustAccess", Recipe::Pass(Passes::GraphicsRobustAccess)),
    ("IfConversion", Recipe::Pass(Passes::IfConversion)),
    ("InlineExhaustive", Recipe::Pass(Passes::InlineExhaustive)),
    ("InsertExtractElim", Recipe::Pass(Passes::InsertExtractElim)),
    ("LocalAccessChainConvert", Recipe::Pass(Passes::LocalAccessChainConvert)),
    ("LocalMultiStoreElim", Recipe::Pass(Passes::LocalMultiStoreElim)),
    ("LocalRedundancyElimination", Recipe::Pass(Passes::LocalRedundancyElimination)),
    ("LocalSingleBlockLoadStoreElim", Recipe::Pass(Passes::LocalSingleBlockLoadStoreElim)),
    ("LocalSingleStoreElim", Recipe::Pass(Passes::LocalSingleStoreElim)),
    ("LoopInvariantCodeMotion", Recipe::Pass(Passes::LoopInvariantCodeMotion)),
    ("LoopPeeling", Recipe::Pass(Passes::LoopPeeling)),
    ("LoopUnswitch", Recipe::Pass(Passes::LoopUnswitch)),
    ("MergeReturn", Recipe::Pass(Passes::MergeReturn)),
    ("PrivateToLocal", Recipe::Pass(Passes::PrivateToLocal)),
    ("ReduceLoadSize", Recipe::Pass(Passes::ReduceLoadSize)),
    ("RedundancyElimination", Recipe::Pass(Passes::RedundancyElimination)),
    ("RemoveDuplicates", Recipe::Pass(Passes::RemoveDuplicates)),
    ("RemoveUnusedInterfaceVariables", Recipe::Pass(Passes::RemoveUnusedInterfaceVariables)),
    ("SSARewrite", Recipe::Pass(Passes::SSARewrite)),
    ("Simplification", Recipe::Pass(Passes::Simplification)),
    ("StrengthReduction", Recipe::Pass(Passes::StrengthReduction)),
    ("UnifyConstant", Recipe::Pass(Passes::UnifyConstant)),
    ("UpgradeMemoryModel", Recipe::Pass(Passes::UpgradeMemoryModel)),
    ("VectorDCE", Recipe::Pass(Passes::VectorDCE)),
    ("-O", Recipe::Performance),
];
