//! What SPIRV-Tools is judged on: its passes one at a time, and all of them.

use spirv_tools::opt::Passes;

use crate::Recipe;

macro_rules! recipes {
    ($($pass:ident)*) => {
        &[$((stringify!($pass), Recipe::Pass(Passes::$pass)),)* ("-O", Recipe::Performance)]
    };
}

/// The passes that must keep what a compute shader means, by name, and `-O`. Not among them are
/// those that relax precision, turn what they do not know into something else, touch only what
/// these modules do not hold (debug information, specialization constants, `OpKill`, descriptors in
/// arrays), or are for other stages.
pub const RECIPES: &[(&str, Recipe)] = recipes! {
    AggressiveDCE
    BlockMerge
    CFGCleanup
    CodeSinking
    CombineAccessChains
    CompactIds
    ConditionalConstantPropagation
    CopyPropagateArrays
    DeadBranchElim
    DeadInsertElim
    DeadVariableElimination
    EliminateDeadConstant
    EliminateDeadFunctions
    EliminateDeadMembers
    FlattenDecoration
    FoldSpecConstantOpAndComposite
    GraphicsRobustAccess
    IfConversion
    InlineExhaustive
    InsertExtractElim
    LocalAccessChainConvert
    LocalMultiStoreElim
    LocalRedundancyElimination
    LocalSingleBlockLoadStoreElim
    LocalSingleStoreElim
    LoopInvariantCodeMotion
    LoopPeeling
    LoopUnswitch
    MergeReturn
    PrivateToLocal
    ReduceLoadSize
    RedundancyElimination
    RemoveDuplicates
    RemoveUnusedInterfaceVariables
    SSARewrite
    Simplification
    StrengthReduction
    UnifyConstant
    UpgradeMemoryModel
    VectorDCE
};
