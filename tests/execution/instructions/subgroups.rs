//! Subgroup instructions: a launch of 40 invocations is one subgroup of 32 and one of 8.

use crate::execution::instructions::run::Shader;

const CAPABILITIES: &str = "
    OpCapability GroupNonUniformVote
    OpCapability GroupNonUniformBallot
    OpCapability GroupNonUniformShuffle
    OpCapability GroupNonUniformShuffleRelative
    OpCapability GroupNonUniformArithmetic
    OpCapability GroupNonUniformClustered
    OpCapability GroupNonUniformQuad
    OpCapability GroupNonUniformRotateKHR
    OpCapability GroupNonUniformPartitionedEXT
    OpCapability QuadControlKHR
    OpCapability SubgroupBallotKHR
    OpCapability SubgroupVoteKHR
    OpCapability Groups
    OpExtension \"SPV_AMD_shader_ballot\"
    %amd_ballot = OpExtInstImport \"SPV_AMD_shader_ballot\"
    %amd_trinary = OpExtInstImport \"SPV_AMD_shader_trinary_minmax\"";

/// Runs a body for all invocations; gives each one's words with its place and its subgroup's size.
fn run(body: &str) -> Vec<([u32; 16], u32, u32)> {
    let found = Shader { capabilities: CAPABILITIES, body, invocations: Some(40), ..Shader::default() }.run();
    let place = |id: usize| (id as u32 % 32, if id < 32 { 32 } else { 8 });
    found.into_iter().enumerate().map(|(id, words)| (words, place(id).0, place(id).1)).collect()
}

#[test]
fn votes_and_ballots() {
    let found = run("
        %elected = OpGroupNonUniformElect %bool %u3
        %elected_word = OpSelect %uint %elected %u1 %u0
        out 0 %elected_word
        %small = OpULessThan %bool %id %u32
        %all = OpGroupNonUniformAll %bool %u3 %small
        %all_word = OpSelect %uint %all %u1 %u0
        out 1 %all_word
        %is_three = OpIEqual %bool %id %u3
        %any = OpGroupNonUniformAny %bool %u3 %is_three
        %any_word = OpSelect %uint %any %u1 %u0
        out 2 %any_word
        %rest = OpUMod %uint %id %u2
        %is_odd = OpINotEqual %bool %rest %u0
        %ballot = OpGroupNonUniformBallot %uint4 %u3 %is_odd
        %ballot_word = OpCompositeExtract %uint %ballot 0
        out 3 %ballot_word
        %count = OpGroupNonUniformBallotBitCount %uint %u3 Reduce %ballot
        out 4 %count
        %below = OpGroupNonUniformBallotBitCount %uint %u3 ExclusiveScan %ballot
        out 5 %below
        %upto = OpGroupNonUniformBallotBitCount %uint %u3 InclusiveScan %ballot
        out 6 %upto
        %low = OpGroupNonUniformBallotFindLSB %uint %u3 %ballot
        out 7 %low
        %high = OpGroupNonUniformBallotFindMSB %uint %u3 %ballot
        out 8 %high
        %own = OpGroupNonUniformInverseBallot %bool %u3 %ballot
        %own_word = OpSelect %uint %own %u1 %u0
        out 9 %own_word
        %bit = OpGroupNonUniformBallotBitExtract %bool %u3 %ballot %u5
        %bit_word = OpSelect %uint %bit %u1 %u0
        out 10 %bit_word
        %half_id = OpUDiv %uint %id %u32
        %equal = OpGroupNonUniformAllEqual %bool %u3 %half_id
        %equal_word = OpSelect %uint %equal %u1 %u0
        out 11 %equal_word
        %unequal = OpGroupNonUniformAllEqual %bool %u3 %id
        %unequal_word = OpSelect %uint %unequal %u1 %u0
        out 12 %unequal_word");
    for (words, place, size) in found {
        let first = u32::from(size == 32);
        let ballot = if size == 32 { 0xAAAA_AAAA } else { 0xAA };
        let expected = [
            u32::from(place == 0),
            first,
            first,
            ballot,
            size / 2,
            place / 2,
            place.div_ceil(2),
            1,
            size - 1,
            place % 2,
            1,
            1,
            0,
        ];
        assert_eq!(words[..13], expected, "place {place} of {size}");
    }
}

#[test]
fn values_of_other_invocations() {
    let found = run("
        %first = OpGroupNonUniformBroadcastFirst %uint %u3 %id
        out 0 %first
        %third = OpGroupNonUniformBroadcast %uint %u3 %id %u2
        out 1 %third
        %partner = OpGroupNonUniformShuffleXor %uint %u3 %id %u1
        out 2 %partner
        %reversed_place = OpISub %uint %u7 %id
        %seven = OpBitwiseAnd %uint %reversed_place %u7
        %reversed = OpGroupNonUniformShuffle %uint %u3 %id %seven
        out 3 %reversed
        %up = OpGroupNonUniformShuffleUp %uint %u3 %id %u1
        out 4 %up
        %down = OpGroupNonUniformShuffleDown %uint %u3 %id %u1
        out 5 %down
        %quad = OpGroupNonUniformQuadBroadcast %uint %u3 %id %u3
        out 6 %quad
        %across = OpGroupNonUniformQuadSwap %uint %u3 %id %u2
        out 7 %across
        %rotated = OpGroupNonUniformRotateKHR %uint %u3 %id %u1 %u4
        out 8 %rotated");
    for (words, place, size) in found {
        let base = if size == 32 { 0 } else { 32 };
        let id = base + place;
        let expected = [
            base,
            base + 2,
            id ^ 1,
            base + (7u32.wrapping_sub(id) & 7),
            // Beyond the subgroup nobody takes part.
            if place == 0 { 0 } else { id - 1 },
            if place == size - 1 { 0 } else { id + 1 },
            id / 4 * 4 + 3,
            id ^ 3,
            id / 4 * 4 + (id + 1) % 4,
        ];
        assert_eq!(words[..9], expected, "place {place} of {size}");
    }
}

#[test]
fn sums_and_scans() {
    let found = run("
        %sum = OpGroupNonUniformIAdd %uint %u3 Reduce %id
        out 0 %sum
        %below = OpGroupNonUniformIAdd %uint %u3 ExclusiveScan %id
        out 1 %below
        %upto = OpGroupNonUniformIAdd %uint %u3 InclusiveScan %id
        out 2 %upto
        %cluster = OpGroupNonUniformUMax %uint %u3 ClusteredReduce %id %u4
        out 3 %cluster
        %wide = OpUConvert %ulong %id
        %wide_sum = OpGroupNonUniformIAdd %ulong %u3 Reduce %wide
        %wide_bits = OpUConvert %uint %wide_sum
        out 4 %wide_bits
        %float_id = OpConvertUToF %float %id
        %float_sum = OpGroupNonUniformFAdd %float %u3 Reduce %float_id
        %float_whole = OpConvertFToU %uint %float_sum
        out 5 %float_whole
        %least = OpGroupNonUniformUMin %uint %u3 ExclusiveScan %id
        out 6 %least
        %bits = OpGroupNonUniformBitwiseXor %uint %u3 InclusiveScan %id
        out 7 %bits");
    for (words, place, size) in found {
        let base = if size == 32 { 0 } else { 32 };
        let id = base + place;
        let sum = |range: std::ops::Range<u32>| range.sum::<u32>();
        let expected = [
            sum(base..base + size),
            sum(base..id),
            sum(base..id + 1),
            id / 4 * 4 + 3,
            sum(base..base + size),
            sum(base..base + size),
            if place == 0 { u32::MAX } else { base },
            (base..=id).fold(0, |bits, id| bits ^ id),
        ];
        assert_eq!(words[..8], expected, "place {place} of {size}");
    }
}

#[test]
fn only_those_that_are_here_take_part() {
    let found = run("
        %rest = OpUMod %uint %id %u3
        %third = OpIEqual %bool %rest %u2
        OpSelectionMerge %end None
        OpBranchConditional %third %yes %end
        %yes = OpLabel
        %first = OpGroupNonUniformBroadcastFirst %uint %u3 %id
        out 0 %first
        %ballot = OpGroupNonUniformBallot %uint4 %u3 %true
        %ballot_word = OpCompositeExtract %uint %ballot 0
        out 1 %ballot_word
        OpBranch %end
        %end = OpLabel");
    for (words, place, size) in found {
        let base = if size == 32 { 0 } else { 32 };
        let here: Vec<u32> = (0..size).filter(|place| (base + place) % 3 == 2).collect();
        let ballot = here.iter().map(|place| 1 << place).sum::<u32>();
        let expected = if here.contains(&place) { [base + here[0], ballot] } else { [0, 0] };
        assert_eq!(words[..2], expected, "place {place} of {size}");
    }
}

/// The value of id in all reductions below: its lowest three bits and 1.
fn tested(id: u32) -> u32 {
    (id & 7) + 1
}

#[test]
fn every_reduction_in_clusters_of_four() {
    let found = run("
        %low = OpBitwiseAnd %uint %id %u7
        %v = OpIAdd %uint %low %u1
        %minus = OpSNegate %int %v
        %f = OpConvertUToF %float %v
        %small = OpULessThan %bool %v %u3
        %a = OpGroupNonUniformIMul %uint %u3 ClusteredReduce %v %u4
        out 0 %a
        %b = OpGroupNonUniformFMul %float %u3 ClusteredReduce %f %u4
        %b_word = OpConvertFToU %uint %b
        out 1 %b_word
        %c = OpGroupNonUniformSMin %int %u3 ClusteredReduce %minus %u4
        %c_word = OpBitcast %uint %c
        out 2 %c_word
        %d = OpGroupNonUniformSMax %int %u3 ClusteredReduce %minus %u4
        %d_word = OpBitcast %uint %d
        out 3 %d_word
        %e = OpGroupNonUniformFMin %float %u3 ClusteredReduce %f %u4
        %e_word = OpConvertFToU %uint %e
        out 4 %e_word
        %g = OpGroupNonUniformFMax %float %u3 ClusteredReduce %f %u4
        %g_word = OpConvertFToU %uint %g
        out 5 %g_word
        %h = OpGroupNonUniformBitwiseAnd %uint %u3 ClusteredReduce %v %u4
        out 6 %h
        %i = OpGroupNonUniformBitwiseOr %uint %u3 ClusteredReduce %v %u4
        out 7 %i
        %j = OpGroupNonUniformLogicalAnd %bool %u3 ClusteredReduce %small %u4
        %j_word = OpSelect %uint %j %u1 %u0
        out 8 %j_word
        %k = OpGroupNonUniformLogicalOr %bool %u3 ClusteredReduce %small %u4
        %k_word = OpSelect %uint %k %u1 %u0
        out 9 %k_word
        %l = OpGroupNonUniformLogicalXor %bool %u3 InclusiveScan %small
        %l_word = OpSelect %uint %l %u1 %u0
        out 10 %l_word
        %m = OpGroupNonUniformQuadAllKHR %bool %small
        %m_word = OpSelect %uint %m %u1 %u0
        out 11 %m_word
        %n = OpGroupNonUniformQuadAnyKHR %bool %small
        %n_word = OpSelect %uint %n %u1 %u0
        out 12 %n_word");
    for (words, place, size) in found {
        let base = if size == 32 { 0 } else { 32 };
        let first = place / 4 * 4;
        let cluster: Vec<u32> = (first..first + 4).map(|place| tested(base + place)).collect();
        let (least, most) = (cluster[0], cluster[3]);
        let small = |&value: &u32| value < 3;
        let expected = [
            cluster.iter().product(),
            cluster.iter().product(),
            most.wrapping_neg(),
            least.wrapping_neg(),
            least,
            most,
            cluster.iter().fold(u32::MAX, |bits, value| bits & value),
            cluster.iter().fold(0, |bits, value| bits | value),
            u32::from(cluster.iter().all(small)),
            u32::from(cluster.iter().any(small)),
            (0..=place).filter(|place| tested(base + place) < 3).count() as u32 % 2,
            u32::from(cluster.iter().all(small)),
            u32::from(cluster.iter().any(small)),
        ];
        assert_eq!(words[..13], expected, "place {place} of {size}");
    }
}

#[test]
fn invocations_with_the_same_value_are_a_partition() {
    let found = run("
        %rest = OpUMod %uint %id %u3
        %partition = OpGroupNonUniformPartitionEXT %uint4 %rest
        %word = OpCompositeExtract %uint %partition 0
        out 0 %word
        %sum = OpGroupNonUniformIAdd %uint %u3 PartitionedReduceEXT %id %partition
        out 1 %sum
        %below = OpGroupNonUniformIAdd %uint %u3 PartitionedExclusiveScanEXT %id %partition
        out 2 %below
        %upto = OpGroupNonUniformUMax %uint %u3 PartitionedInclusiveScanEXT %id %partition
        out 3 %upto");
    for (words, place, size) in found {
        let base = if size == 32 { 0 } else { 32 };
        let id = base + place;
        let same: Vec<u32> = (base..base + size).filter(|other| other % 3 == id % 3).collect();
        let ballot: u32 = same.iter().map(|other| 1 << (other - base)).sum();
        let below: u32 = same.iter().filter(|&&other| other < id).sum();
        assert_eq!(words[..4], [ballot, same.iter().sum(), below, id], "place {place} of {size}");
    }
}

#[test]
fn the_older_extensions_do_the_same() {
    let found = run("
        %odd_word = OpBitwiseAnd %uint %id %u1
        %odd = OpIEqual %bool %odd_word %u1
        %ballot = OpSubgroupBallotKHR %uint4 %odd
        %ballot_word = OpCompositeExtract %uint %ballot 0
        out 0 %ballot_word
        %first = OpSubgroupFirstInvocationKHR %uint %id
        out 1 %first
        %read = OpSubgroupReadInvocationKHR %uint %id %u5
        out 2 %read
        %all = OpSubgroupAllKHR %bool %odd
        %all_word = OpSelect %uint %all %u1 %u0
        out 3 %all_word
        %any = OpSubgroupAnyKHR %bool %odd
        %any_word = OpSelect %uint %any %u1 %u0
        out 4 %any_word
        %equal = OpSubgroupAllEqualKHR %bool %odd
        %equal_word = OpSelect %uint %equal %u1 %u0
        out 5 %equal_word
        %sum = OpGroupIAddNonUniformAMD %uint %u3 InclusiveScan %id
        out 6 %sum
        %least = OpGroupUMinNonUniformAMD %uint %u3 Reduce %id
        out 7 %least
        %most = OpGroupUMaxNonUniformAMD %uint %u3 Reduce %id
        out 8 %most
        %signed = OpBitcast %int %id
        %minus = OpSNegate %int %signed
        %signed_least = OpGroupSMinNonUniformAMD %int %u3 Reduce %minus
        %signed_least_word = OpBitcast %uint %signed_least
        out 9 %signed_least_word
        %signed_most = OpGroupSMaxNonUniformAMD %int %u3 Reduce %minus
        %signed_most_word = OpBitcast %uint %signed_most
        out 10 %signed_most_word
        %float_id = OpConvertUToF %float %id
        %float_sum = OpGroupFAddNonUniformAMD %float %u3 ExclusiveScan %float_id
        %float_sum_word = OpConvertFToU %uint %float_sum
        out 11 %float_sum_word
        %float_least = OpGroupFMinNonUniformAMD %float %u3 Reduce %float_id
        %float_least_word = OpConvertFToU %uint %float_least
        out 12 %float_least_word
        %float_most = OpGroupFMaxNonUniformAMD %float %u3 Reduce %float_id
        %float_most_word = OpConvertFToU %uint %float_most
        out 13 %float_most_word");
    for (words, place, size) in found {
        let base = if size == 32 { 0 } else { 32 };
        let (id, last) = (base + place, base + size - 1);
        let expected = [
            if size == 32 { 0xAAAA_AAAA } else { 0xAA },
            base,
            base + 5,
            0,
            1,
            0,
            (base..=id).sum(),
            base,
            last,
            last.wrapping_neg(),
            base.wrapping_neg(),
            (base..id).sum(),
            base,
            last,
        ];
        assert_eq!(words[..14], expected, "place {place} of {size}");
    }
}

/// A body with the constants that the next test needs.
const SWIZZLES: &str = "
    %offsets = OpConstantComposite %uint4 %u1 %u0 %u3 %u3
    %swizzle = OpConstantComposite %uint3 %u7 %u8 %u1
    %low_bits = OpConstant %ulong 0xFF0L";

#[test]
fn invocations_are_swizzled_written_and_counted() {
    let found = Shader {
        invocations: Some(40),
        capabilities: CAPABILITIES,
        declarations: SWIZZLES,
        body: "
            %a = OpExtInst %uint %amd_ballot 1 %id %offsets
            out 0 %a
            %b = OpExtInst %uint %amd_ballot 2 %id %swizzle
            out 1 %b
            %c = OpExtInst %uint %amd_ballot 3 %id %u30 %u5
            out 2 %c
            %d = OpExtInst %uint %amd_ballot 4 %low_bits
            out 3 %d",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        let id = id as u32;
        let (place, base) = (id % 32, id / 32 * 32);
        let size = if base == 0 { 32 } else { 8 };
        let swizzled = (place & 7 | 8) ^ 1;
        let expected = [
            id / 4 * 4 + [1, 0, 3, 3][id as usize % 4],
            // Whoever is not there gives 0.
            if swizzled < size { base + swizzled } else { 0 },
            if place == 5 { 30 } else { id },
            place.clamp(4, 12) - 4,
        ];
        assert_eq!(words[..4], expected, "invocation {id}");
    }
}

#[test]
fn of_three_the_least_the_greatest_and_the_middle() {
    let found = run("
        %low = OpBitwiseAnd %uint %id %u7
        %signed = OpISub %int %low %u3
        %f = OpConvertSToF %float %signed
        %f1 = OpConvertUToF %float %u1
        %f3 = OpConvertUToF %float %u3
        %a = OpExtInst %float %amd_trinary 1 %f3 %f %f1
        %a_bits = OpConvertFToS %uint %a
        out 0 %a_bits
        %b = OpExtInst %uint %amd_trinary 2 %low %u3 %u5
        out 1 %b
        %c = OpExtInst %int %amd_trinary 3 %signed %u1 %u2
        %c_bits = OpBitcast %uint %c
        out 2 %c_bits
        %d = OpExtInst %float %amd_trinary 4 %f1 %f %f3
        %d_bits = OpConvertFToS %uint %d
        out 3 %d_bits
        %e = OpExtInst %uint %amd_trinary 5 %low %u3 %u5
        out 4 %e
        %g = OpExtInst %int %amd_trinary 6 %signed %u1 %u2
        %g_bits = OpBitcast %uint %g
        out 5 %g_bits
        %h = OpExtInst %float %amd_trinary 7 %f1 %f %f3
        %h_bits = OpConvertFToS %uint %h
        out 6 %h_bits
        %i = OpExtInst %uint %amd_trinary 8 %low %u3 %u5
        out 7 %i
        %j = OpExtInst %int %amd_trinary 9 %signed %u2 %u1
        %j_bits = OpBitcast %uint %j
        out 8 %j_bits");
    for (id, (words, ..)) in found.iter().enumerate() {
        let low = id as i32 & 7;
        let signed = low - 3;
        let expected = [
            signed.min(1),
            low.min(3),
            signed.min(1),
            signed.max(3),
            low.max(5),
            signed.max(2),
            signed.clamp(1, 3),
            low.clamp(3, 5),
            signed.clamp(1, 2),
        ];
        assert_eq!(words[..9], expected.map(|value| value as u32), "invocation {id}");
    }
}
