//! Rules about the instructions of a subgroup, by which lanes read each other's values.

rules! {
    BROADCAST_UNIFORM "broadcast-uniform" UndefinedBehavior
        "All active lanes of a subgroup broadcast from the same lane."
        "SPIR-V 3.3.24, OpGroupNonUniformBroadcast: behavior is undefined when Id is not dynamically uniform"
        "use subgroupShuffle where each lane reads from a lane of its own"
    BROADCAST_INACTIVE "broadcast-inactive" UndefinedValue
        "A broadcast is from an active lane of the subgroup."
        "SPIR-V 3.3.24, OpGroupNonUniformBroadcast: the value of an inactive invocation is undefined"
        "use subgroupBroadcastFirst, which reads the lowest active lane, or broadcast before the branch"
    SHUFFLE_INACTIVE "shuffle-inactive" UndefinedValue
        "A lane reads the value of an active lane of its subgroup."
        "SPIR-V 3.3.24, OpGroupNonUniformShuffle*: the value of an inactive invocation is undefined"
        "read only from lanes whose bit is set in subgroupBallot(true)"
    ROTATE_INACTIVE "rotate-inactive" UndefinedValue
        "A rotation within a subgroup or cluster reads from active lanes."
        "SPIR-V 3.3.24, OpGroupNonUniformRotateKHR: the value of an inactive invocation is undefined"
        "rotate before lanes branch apart, or only where the subgroup is full"
    QUAD_INDEX "quad-index" UndefinedValue
        "A quad operation reads from an active lane of the quad, by an index below 4 that is the same in it."
        "SPIR-V 3.3.24, OpGroupNonUniformQuadBroadcast, QuadSwap: the value of an inactive invocation is undefined"
        "exchange values before lanes branch apart, and launch whole quads"
    BALLOT_INDEX "ballot-index" UndefinedValue
        "The index of a bit of a ballot is below the size of the subgroup."
        "SPIR-V 3.3.24, OpGroupNonUniformBallotBitExtract: the result is undefined for a greater Index"
        "compare the index with gl_SubgroupSize first"
    BALLOT_FIND_NONE "ballot-find-none" UndefinedValue
        "A ballot in which a bit is sought has one that is set."
        "SPIR-V 3.3.24, OpGroupNonUniformBallotFindLSB and FindMSB: the result is undefined if no bit is set"
        "test the ballot, or subgroupAny, before subgroupBallotFindLSB"
    INVERSE_BALLOT_UNIFORM "inverse-ballot-uniform" UndefinedBehavior
        "All active lanes of a subgroup give the same ballot to an inverse ballot."
        "SPIR-V 3.3.24, OpGroupNonUniformInverseBallot: behavior is undefined unless Value is the same in all"
        "use subgroupBallotBitExtract(mask, gl_SubgroupInvocationID) for a mask of each lane's own"
    CLUSTER_SIZE "cluster-size" UndefinedBehavior
        "A cluster of lanes is no larger than the subgroup."
        "SPIR-V 3.3.24, ClusterSize: behavior is undefined where it is greater than the size of the subgroup"
        "reduce in clusters of at most gl_SubgroupSize lanes, or over the whole subgroup (subgroupAdd)"
    STALE_SUBGROUP "stale-subgroup" Lint
        "A lane's index or election, a mask or a ballot is not used behind a trace, a report or a reordering."
        "Vulkan, \"Shader Call Instructions\": they may repack invocations, whose subgroups change"
        "elect, take the ballot, and load the builtin, behind the instruction again"
    BARRIER_SUBGROUP_DIVERGENT "barrier-subgroup-divergent" Lint
        "All lanes of a subgroup reach its barriers together."
        "SPIR-V 3.3.21, OpControlBarrier: of scope Subgroup, it waits for the lanes alone that have come here together"
        "put the barrier behind the branch, where the lanes are together again"
    STALE_RAYTMAX "stale-raytmax" Lint
        "RayTmaxKHR from before an accepted report is not compared behind it."
        "Vulkan, RayTmaxKHR: in an intersection shader, it changes with each report that is accepted"
        "read gl_RayTmaxEXT again behind reportIntersectionEXT, or leave the test to the report"
    STALE_CLOCK "stale-clock" Lint
        "The clocks of a subgroup from before and behind an instruction that may repack lanes are not subtracted."
        "SPV_KHR_shader_clock: the subgroup's clock is that of where it runs, which repacking may change"
        "use clockRealtimeEXT, or measure within one shader call"
}
