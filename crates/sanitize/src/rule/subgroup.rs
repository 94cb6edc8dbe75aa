//! Rules about the instructions of a subgroup, by which lanes read each other's values.

rules! {
    BROADCAST_UNIFORM "broadcast-uniform" UndefinedBehavior
        "All active lanes of a subgroup broadcast from the same lane."
        "SPIR-V 3.3.24, OpGroupNonUniformBroadcast: behavior is undefined when Id is not dynamically uniform"
        "use subgroupShuffle if lanes read from different lanes"
    BROADCAST_INACTIVE "broadcast-inactive" UndefinedValue
        "A broadcast reads from an active lane of the subgroup."
        "SPIR-V 3.3.24, OpGroupNonUniformBroadcast: the value of an inactive invocation is undefined"
        "use subgroupBroadcastFirst, which reads the lowest active lane, or broadcast before the branch"
    SHUFFLE_INACTIVE "shuffle-inactive" UndefinedValue
        "A lane reads the value of an active lane of its subgroup."
        "SPIR-V 3.3.24, OpGroupNonUniformShuffle*: the value of an inactive invocation is undefined"
        "read only from lanes whose bit is set in subgroupBallot(true)"
    ROTATE_INACTIVE "rotate-inactive" UndefinedValue
        "A rotation within a subgroup or cluster reads from active lanes."
        "SPIR-V 3.3.24, OpGroupNonUniformRotateKHR: the value of an inactive invocation is undefined"
        "rotate before control flow diverges, or only in full subgroups"
    QUAD_INDEX "quad-index" UndefinedValue
        "A quad operation reads from an active lane of the quad, with an index below 4 that is uniform \
         within the quad."
        "SPIR-V 3.3.24, OpGroupNonUniformQuadBroadcast, QuadSwap: the value of an inactive invocation is undefined"
        "exchange values before control flow diverges, and launch whole quads"
    BALLOT_INDEX "ballot-index" UndefinedValue
        "The index of a bit of a ballot is below the size of the subgroup."
        "SPIR-V 3.3.24, OpGroupNonUniformBallotBitExtract: the result is undefined for a greater Index"
        "compare the index with gl_SubgroupSize first"
    BALLOT_FIND_NONE "ballot-find-none" UndefinedValue
        "A ballot that is searched for a bit has at least one bit set."
        "SPIR-V 3.3.24, OpGroupNonUniformBallotFindLSB and FindMSB: the result is undefined if no bit is set"
        "test the ballot, or subgroupAny, before subgroupBallotFindLSB"
    INVERSE_BALLOT_UNIFORM "inverse-ballot-uniform" UndefinedBehavior
        "All active lanes of a subgroup pass the same ballot to an inverse ballot."
        "SPIR-V 3.3.24, OpGroupNonUniformInverseBallot: behavior is undefined unless Value is the same in all"
        "use subgroupBallotBitExtract(mask, gl_SubgroupInvocationID) for a mask that differs between lanes"
    CLUSTER_SIZE "cluster-size" UndefinedBehavior
        "A cluster of lanes is no larger than the subgroup."
        "SPIR-V 3.3.24, ClusterSize: behavior is undefined where it is greater than the size of the subgroup"
        "reduce in clusters of at most gl_SubgroupSize lanes, or over the whole subgroup (subgroupAdd)"
    STALE_SUBGROUP "stale-subgroup" Lint
        "A lane index, an election, a mask or a ballot is not used after a trace, a report or a reordering."
        "Vulkan, \"Shader Call Instructions\": they may repack invocations into other subgroups"
        "repeat the election, the ballot or the load of the builtin after the instruction"
    BARRIER_SUBGROUP_DIVERGENT "barrier-subgroup-divergent" Lint
        "All lanes of a subgroup reach its barriers together."
        "SPIR-V 3.3.21, OpControlBarrier: with scope Subgroup, it waits only for the lanes that reach it \
         together"
        "move the barrier after the branch, where the lanes have reconverged"
    STALE_RAYTMAX "stale-raytmax" Lint
        "A RayTmaxKHR that was read before an accepted report is not compared after it."
        "Vulkan, RayTmaxKHR: in an intersection shader, it changes with each accepted report"
        "read gl_RayTmaxEXT again after reportIntersectionEXT, or leave the test to the report"
    STALE_CLOCK "stale-clock" Lint
        "Subgroup clock readings from before and after an instruction that may repack lanes are not \
         subtracted."
        "SPV_KHR_shader_clock: a subgroup's clock depends on where the subgroup runs, which repacking may \
         change"
        "use clockRealtimeEXT, or measure within one shader call"
}
