//! Subgroup instructions: a launch of 40 invocations is one subgroup of 32 and one of 8.

use crate::run::Shader;

const CAPABILITIES: &str = "
    OpCapability GroupNonUniformVote
    OpCapability GroupNonUniformBallot
    OpCapability GroupNonUniformShuffle
    OpCapability GroupNonUniformShuffleRelative
    OpCapability GroupNonUniformArithmetic
    OpCapability GroupNonUniformClustered
    OpCapability GroupNonUniformQuad
    OpCapability GroupNonUniformRotateKHR";

/// Runs a body for all invocations; gives each one's words with its place and its subgroup's size.
fn run(body: &str) -> Vec<([u32; 16], u32, u32)> {
    let found = Shader { capabilities: CAPABILITIES, body, ..Shader::default() }.run();
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
