//! Operands that choose: indices, selectors, lengths, places in a subgroup, of every integer type.

use std::fmt::Write;

use crate::execution::instructions::operand_types::literal;
use crate::execution::instructions::operand_types::refused::not_refused;
use crate::execution::instructions::operand_types::types::{self, KINDS, Kind, Ty};
use crate::execution::instructions::run::Shader;

/// Every integer type.
fn integers() -> impl Iterator<Item = Kind> {
    KINDS.into_iter().filter(|kind| kind.is_integer())
}

/// The value of a `uint` in another integer type.
fn converted(body: &mut String, to: Kind, name: &str, from: &str) {
    let _ = match (to, to.is_signed()) {
        (Kind::U32, _) => writeln!(body, "%{name} = OpCopyObject %uint %{from}"),
        (Kind::I32, _) => writeln!(body, "%{name} = OpBitcast %int %{from}"),
        (_, true) => writeln!(
            body,
            "%{name}_signed = OpBitcast %int %{from}\n%{name} = OpSConvert %{} %{name}_signed",
            to.name()
        ),
        (_, false) => writeln!(body, "%{name} = OpUConvert %{} %{from}", to.name()),
    };
}

#[test]
fn indices_of_every_type_lead_to_the_same_element() {
    const LAYOUT: &str = "
        OpDecorate %words ArrayStride 4
        OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
        OpDecorate %to_uint ArrayStride 4
        OpDecorate %buffer DescriptorSet 0
        OpDecorate %buffer Binding 1";
    for kind in integers() {
        let name = kind.name();
        let one = literal(kind, 1);
        let back = if kind.is_signed() { literal(kind, kind.mask()) } else { one.clone() };
        let declarations = types::declarations()
            + &format!(
                "%four = OpConstant %{name} {four}
                 %one = OpConstant %{name} {one}
                 %back = OpConstant %{name} {back}
                 %words = OpTypeArray %uint %four
                 %block = OpTypeStruct %words
                 %to_block = OpTypePointer StorageBuffer %block
                 %to_uint = OpTypePointer StorageBuffer %uint
                 %buffer = OpVariable %to_block StorageBuffer
                 %local_words = OpTypeArray %uint %four
                 %to_words = OpTypePointer Private %local_words
                 %local = OpVariable %to_words Private
                 %to_vector = OpTypePointer Private %uint4
                 %vector = OpVariable %to_vector Private
                 %numbers = OpConstantComposite %uint4 %u10 %u11 %u12 %u13
                 %matrix = OpTypeMatrix %float2 4
                 %to_matrix = OpTypePointer Private %matrix
                 %to_float = OpTypePointer Private %float
                 %columns = OpVariable %to_matrix Private",
                four = literal(kind, 4)
            );
        let mut body = String::from("%low = OpBitwiseAnd %uint %id %u3\n%high = OpISub %uint %u3 %low\n");
        converted(&mut body, kind, "at", "low");
        // From the last element back: signed types may step below.
        converted(&mut body, kind, "step", "low");
        body += "
            OpStore %vector %numbers
            %vp = OpAccessChain %ptr_Private_uint %vector %at
            %v = OpLoad %uint %vp
            out 0 %v
            %e = OpVectorExtractDynamic %uint %numbers %at
            out 1 %e
            %inserted = OpVectorInsertDynamic %uint4 %numbers %u7 %at
            %i = OpVectorExtractDynamic %uint %inserted %at
            out 2 %i
            %lp = OpInBoundsAccessChain %ptr_Private_uint %local %at
            OpStore %lp %id
            %l = OpLoad %uint %lp
            out 3 %l
            %fp = OpAccessChain %to_float %columns %at %one
            %f = OpConvertUToF %float %id
            OpStore %fp %f
            %fl = OpLoad %float %fp
            %fw = OpConvertFToU %uint %fl
            out 4 %fw
            %p = OpAccessChain %to_uint %buffer %u0 %at
            %b = OpLoad %uint %p
            out 5 %b
            %first = OpAccessChain %to_uint %buffer %u0 %u0
            %q = OpPtrAccessChain %to_uint %first %at
            %c = OpLoad %uint %q
            out 6 %c
            %middle = OpAccessChain %to_uint %buffer %u0 %u2
            %r = OpInBoundsPtrAccessChain %to_uint %middle %back
            %d = OpLoad %uint %r
            out 7 %d
            %distance = OpPtrDiff %int %q %first
            %distance_word = OpBitcast %uint %distance
            out 8 %distance_word
            %constant = OpVectorExtractDynamic %uint %numbers %one
            out 9 %constant
            %bare = OpAccessChain %ptr_StorageBuffer_uint %buffer %u0 %at
            %bare_first = OpAccessChain %ptr_StorageBuffer_uint %buffer %u0 %u0
            %untold = OpPtrDiff %uint %bare %bare_first
            out 10 %untold";
        let shader = Shader {
            capabilities: "OpCapability VariablePointers",
            annotations: LAYOUT,
            declarations: &declarations,
            body: &body,
            ..Shader::default()
        };
        let words = [30u32, 31, 32, 33].map(u32::to_le_bytes).concat();
        let mut resources = || {
            let buffer = anyhit_engine::machine::Buffer::new(&words);
            anyhit_engine::machine::Resources::default().bind(
                0,
                1,
                anyhit_engine::machine::Descriptor::Buffer(buffer),
            )
        };
        let found =
            shader.run_with(&mut resources).unwrap_or_else(|error| panic!("{name}: {}", error.render()));
        for (id, words) in found.iter().enumerate() {
            let (id, low) = (id as u32, id as u32 % 4);
            // From element 2 one back (to 31), or one on (to 33).
            let stepped = if kind.is_signed() { 31 } else { 33 };
            let expected = [10 + low, 10 + low, 7, id, id, 30 + low, 30 + low, stepped, low, 11, low];
            assert_eq!(words[..11], expected, "{name} in invocation {id}");
        }
    }
}

#[test]
fn an_index_is_treated_as_signed_and_stays_outside_whatever_its_width() {
    // SPIR-V, OpAccessChain: each index "is treated as signed", so 200 of 8 bits is -56; and 2^32 +
    // 1 is not 1.
    let cases = [
        (Kind::I8, 0x80),
        (Kind::U8, 200),
        (Kind::I16, 0xFFFF),
        (Kind::U16, 0xFF00),
        (Kind::I32, 0xFFFF_FFFF),
        (Kind::U32, 0x8000_0000),
        (Kind::I64, 0x1_0000_0001),
        (Kind::I64, u64::MAX),
        (Kind::U64, 0x1_0000_0001),
    ];
    for (kind, bits) in cases {
        let declarations = types::declarations()
            + &format!(
                "%at = OpConstant %{0} {1}
                 %most = OpConstant %uint 65536
                 %words = OpTypeArray %uint %most
                 %to_words = OpTypePointer Private %words
                 %local = OpVariable %to_words Private
                 %numbers = OpConstantComposite %uint4 %u10 %u11 %u12 %u13",
                kind.name(),
                literal(kind, bits)
            );
        for body in [
            "%p = OpAccessChain %ptr_Private_uint %local %at\n%v = OpLoad %uint %p\nout 0 %v",
            "%v = OpVectorExtractDynamic %uint %numbers %at\nout 0 %v",
        ] {
            let error = Shader { declarations: &declarations, body, ..Shader::default() }.refused();
            assert!(
                error.render().contains("out-of-bounds") || error.render().contains("outside"),
                "{kind:?}: {}",
                error.render()
            );
        }
    }
}

#[test]
fn selectors_of_every_width_compare_whole() {
    for kind in integers() {
        let top = 1u64 << (kind.bits() - 1);
        let values: Vec<u64> = [0, 1, 3, top - 1, top, kind.mask(), kind.mask() - 1].to_vec();
        let mut declarations = types::declarations();
        let mut body = String::from("%chosen_0 = OpUMod %uint %id %u8\n");
        // The selector is one of the values, or (the eighth) another number.
        let _ = writeln!(declarations, "%c_other = OpConstant %{} {}", kind.name(), literal(kind, 77));
        let mut last = "c_other".to_owned();
        for (at, &value) in values.iter().enumerate() {
            let _ = writeln!(declarations, "%c{at} = OpConstant %{} {}", kind.name(), literal(kind, value));
            let _ = writeln!(
                body,
                "%is{at} = OpIEqual %bool %chosen_0 %u{at}\n%s{at} = OpSelect %{} %is{at} %c{at} %{last}",
                kind.name()
            );
            last = format!("s{at}");
        }
        let cases: String = values
            .iter()
            .enumerate()
            .map(|(at, &value)| format!(" {} %l{at}", literal(kind, value)))
            .collect();
        let _ = writeln!(
            body,
            "OpSelectionMerge %merge None\nOpSwitch %{last} %other{cases}\n%other = OpLabel\nOpBranch %merge"
        );
        let mut phi = String::from(" %u9 %other");
        for at in 0..values.len() {
            let _ = writeln!(body, "%l{at} = OpLabel\nOpBranch %merge");
            let _ = write!(phi, " %u{at} %l{at}");
        }
        let _ = writeln!(body, "%merge = OpLabel\n%found = OpPhi %uint{phi}\nout 0 %found");
        let found = Shader { declarations: &declarations, body: &body, ..Shader::default() }.run();
        for (id, words) in found.iter().enumerate() {
            let expected = if id % 8 == 7 { 9 } else { id as u32 % 8 };
            assert_eq!(words[0], expected, "{} in invocation {id}", kind.name());
        }
    }
}

#[test]
fn places_in_a_subgroup_may_have_any_width() {
    for kind in integers().filter(|kind| !kind.is_signed()) {
        let name = kind.name();
        let mut body =
            String::from("%other = OpBitwiseXor %uint %id %u1\n%within = OpBitwiseAnd %uint %other %i31\n");
        converted(&mut body, kind, "place", "within");
        let _ = writeln!(
            body,
            "%shuffled = OpGroupNonUniformShuffle %uint %u3 %id %place
             out 0 %shuffled
             %odd_word = OpBitwiseAnd %uint %id %u1
             %odd = OpIEqual %bool %odd_word %u1
             %ballot = OpGroupNonUniformBallot %uint4 %u3 %odd
             %bit = OpGroupNonUniformBallotBitExtract %bool %u3 %ballot %place
             %bit_word = OpSelect %uint %bit %u1 %u0
             out 1 %bit_word
             %count = OpGroupNonUniformBallotBitCount %{name} %u3 Reduce %ballot
             %lowest = OpGroupNonUniformBallotFindLSB %{name} %u3 %ballot"
        );
        for (at, from) in [(2, "count"), (3, "lowest")] {
            let _ = match kind {
                Kind::U32 => writeln!(body, "out {at} %{from}"),
                _ => writeln!(body, "%w_{from} = OpUConvert %uint %{from}\nout {at} %w_{from}"),
            };
        }
        if kind == Kind::U64 {
            // 2^32 + 1 is not invocation 1: nobody is there, and nobody gives 0.
            body += "%far = OpGroupNonUniformShuffle %uint %u3 %u7 %beyond\nout 4 %far\n";
        }
        let declarations =
            types::declarations() + "%i31 = OpConstant %uint 31\n%beyond = OpConstant %ulong 0x100000001L\n";
        let found = Shader {
            capabilities: "OpCapability GroupNonUniformShuffle\nOpCapability GroupNonUniformBallot",
            declarations: &declarations,
            body: &body,
            invocations: Some(64),
            ..Shader::default()
        }
        .run();
        for (id, words) in found.iter().enumerate() {
            let id = id as u32;
            assert_eq!(words[..5], [id ^ 1, !id & 1, 16, 1, 0], "{name} in invocation {id}");
        }
    }
}

#[test]
fn what_is_no_integer_chooses_nothing() {
    let mut bodies = Vec::new();
    for ty in Ty::all().filter(|ty| ty.count > 1 || !ty.kind.is_integer()) {
        let name = ty.name();
        bodies.push(format!(
            "OpSelectionMerge %m_{0} None\nOpSwitch %zero_{name} %m_{0} 1 %m_{0}\n%m_{0} = OpLabel",
            bodies.len()
        ));
        bodies.push(format!("%x_{} = OpVectorExtractDynamic %uint %zero_uint2 %zero_{name}", bodies.len()));
    }
    for ty in Ty::all().filter(|ty| ty.count > 1 || ty.kind != Kind::Bool) {
        bodies.push(format!(
            "OpSelectionMerge %m_{0} None\nOpBranchConditional %zero_{1} %t_{0} %m_{0}\n%t_{0} = OpLabel\nOpBranch %m_{0}\n%m_{0} = OpLabel",
            bodies.len(),
            ty.name()
        ));
    }
    assert_eq!(not_refused(&bodies), []);
}

#[test]
fn a_length_is_an_integer_above_zero() {
    for (kind, bits) in [(Kind::I8, 0xFF), (Kind::I64, u64::MAX), (Kind::U16, 0), (Kind::F32, 0x3F80_0000)] {
        let declarations = types::declarations()
            + &format!(
                "%length = OpConstant %{} {}
                 %words = OpTypeArray %uint %length
                 %to_words = OpTypePointer Private %words
                 %local = OpVariable %to_words Private",
                kind.name(),
                literal(kind, bits)
            );
        let body = "%p = OpAccessChain %ptr_Private_uint %local %u0\nOpStore %p %u1";
        let error = Shader { declarations: &declarations, body, ..Shader::default() }.refused();
        assert_eq!(error.kind(), anyhit::ErrorKind::InvalidModule, "{kind:?}: {}", error.render());
    }
}
