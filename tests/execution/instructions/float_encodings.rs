//! bfloat16 (`SPV_KHR_bfloat16`) and floats of eight bits (`SPV_EXT_float8`).
//!
//! The judge knows a format by its parameters: the number of a code by the formula
//! (-1)^s 2^(e - bias) (1 + m / 2^t), the code of a number by counting the middles of neighbours
//! that lie below it. All of these are exact in f64.

use anyhit_base::error::{Error, ErrorKind};
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use half::f16;

use crate::execution::instructions::run::Shader;

const CAPABILITIES: &str = "
    OpCapability BFloat16TypeKHR
    OpCapability BFloat16DotProductKHR
    OpCapability Float8EXT
    OpCapability AtomicFloat32AddEXT
    OpExtension \"SPV_KHR_bfloat16\"
    OpExtension \"SPV_EXT_float8\"";
const TYPES: &str = "
    %bf = OpTypeFloat 16 0
    %e4 = OpTypeFloat 8 4214
    %e5 = OpTypeFloat 8 4215
    %bf2 = OpTypeVector %bf 2
    %bf3 = OpTypeVector %bf 3
    %char = OpTypeInt 8 1
    %short = OpTypeInt 16 1";

struct Format {
    significand: u32,
    bias: i32,
    sign: u64,
    /// Codes of finite numbers without a sign.
    finite: u64,
    /// What lies beyond them: an infinity, with a sign, or else the NaN.
    infinity: Option<u64>,
    nan: u64,
}

const BF16: Format =
    Format { significand: 7, bias: 127, sign: 0x8000, finite: 0x7F80, infinity: Some(0x7F80), nan: 0x7FC0 };
const E4M3: Format = Format { significand: 3, bias: 7, sign: 0x80, finite: 0x7F, infinity: None, nan: 0x7F };
const E5M2: Format =
    Format { significand: 2, bias: 15, sign: 0x80, finite: 0x7C, infinity: Some(0x7C), nan: 0x7E };

impl Format {
    /// As though the exponents went on.
    fn number(&self, code: u64) -> f64 {
        let low = (code % (1 << self.significand)) as f64 / f64::from(1 << self.significand);
        match (code >> self.significand) as i32 {
            0 => low * 2f64.powi(1 - self.bias),
            exponent => (1.0 + low) * 2f64.powi(exponent - self.bias),
        }
    }

    fn value(&self, bits: u64) -> f64 {
        let magnitude = match bits % self.sign {
            code if code < self.finite => self.number(code),
            code if Some(code) == self.infinity => f64::INFINITY,
            _ => f64::NAN,
        };
        if bits & self.sign == 0 { magnitude } else { -magnitude }
    }

    fn middle(&self, code: u64) -> f64 {
        (self.number(code) + self.number(code + 1)) / 2.0
    }

    fn middles(&self) -> impl Iterator<Item = f64> {
        (0..self.finite).map(|code| self.middle(code))
    }

    fn nearest(&self, value: f64, saturated: bool) -> u32 {
        if value.is_nan() {
            return self.nan as u32;
        }
        let (mut low, mut high) = (0, self.finite);
        while low < high {
            let at = u64::midpoint(low, high);
            if self.middle(at) < value.abs() { low = at + 1 } else { high = at }
        }
        // A tie belongs to the even one of two codes.
        let tie = low < self.finite && self.middle(low) == value.abs();
        let code = low + u64::from(tie && low % 2 == 1);
        let sign = if value.is_sign_negative() { self.sign } else { 0 };
        let bits = match (code < self.finite, saturated) {
            (true, _) => sign | code,
            (false, true) => sign | (self.finite - 1),
            (false, false) => self.infinity.map_or(self.nan, |infinity| sign | infinity),
        };
        bits as u32
    }
}

/// The bits of a f32 with one NaN, and those of a f64.
fn single(value: f64) -> u32 {
    if value.is_nan() { 0x7FC0_0000 } else { (value as f32).to_bits() }
}

fn double(value: f64) -> [u32; 2] {
    let bits = if value.is_nan() { 0x7FF8_0000_0000_0000 } else { value.to_bits() };
    [bits as u32, (bits >> 32) as u32]
}

/// Exact values of f32 alone.
fn half(value: f64) -> u32 {
    if value.is_nan() { 0x7E00 } else { f16::from_f32(value as f32).to_bits().into() }
}

fn shader<'a>(body: &'a str, annotations: &'a str, declarations: &'a str) -> Shader<'a> {
    Shader { capabilities: CAPABILITIES, annotations, declarations, body, ..Shader::default() }
}

/// Converts every code of a format, told as `small` with a `bits` and its integer type.
fn every_code(small: &str, integer: &str, others: [&str; 2]) -> Vec<[u32; 16]> {
    let [one, two] = others;
    let body = format!(
        "%bits = OpUConvert %{integer} %id
         %x = OpBitcast %{small} %bits
         %to_single = OpFConvert %float %x
         %to_double = OpFConvert %double %x
         %to_half = OpFConvert %half %x
         %one = OpFConvert %{one} %x
         %two = OpFConvert %{two} %x
         %one_saturated = OpFConvert %{one} %x
         %two_saturated = OpFConvert %{two} %x
         %signed = OpConvertFToS %int %x
         %unsigned = OpConvertFToU %ulong %x
         %signed8 = OpConvertFToS %char %x
         %o0 = OpBitcast %uint %to_single
         out 0 %o0
         %wide = OpBitcast %uint2 %to_double
         %o1 = OpCompositeExtract %uint %wide 0
         out 1 %o1
         %o2 = OpCompositeExtract %uint %wide 1
         out 2 %o2
         %half_bits = OpBitcast %ushort %to_half
         %o3 = OpUConvert %uint %half_bits
         out 3 %o3
         {}
         %o8 = OpBitcast %uint %signed
         out 8 %o8
         %o9 = OpUConvert %uint %unsigned
         out 9 %o9
         %o10 = OpSConvert %uint %signed8
         out 10 %o10",
        [("one", one, 4), ("two", two, 5), ("one_saturated", one, 6), ("two_saturated", two, 7)]
            .map(|(name, ty, at)| stored(name, ty, at))
            .concat()
    );
    let saturated = |name: &str, ty: &str| match ty {
        "bf" => String::new(),
        _ => format!("OpDecorate %{name}_saturated SaturatedToLargestFloat8NormalConversionEXT\n"),
    };
    let annotations = saturated("one", one) + &saturated("two", two);
    let invocations = if small == "bf" { 1 << 16 } else { 1 << 8 };
    Shader { invocations: Some(invocations), ..shader(&body, &annotations, TYPES) }.run()
}

fn stored(name: &str, ty: &str, at: usize) -> String {
    let integer = if ty == "bf" { "ushort" } else { "uchar" };
    format!(
        "%{name}_bits = OpBitcast %{integer} %{name}
         %o{at} = OpUConvert %uint %{name}_bits
         out {at} %o{at}\n"
    )
}

/// The codes of a format and of the other two.
type Case = (&'static str, &'static str, Format, [(&'static str, Format); 2]);

#[test]
fn every_code_converts_to_every_other_format() {
    let cases: [Case; 3] = [
        ("bf", "ushort", BF16, [("e4", E4M3), ("e5", E5M2)]),
        ("e4", "uchar", E4M3, [("bf", BF16), ("e5", E5M2)]),
        ("e5", "uchar", E5M2, [("e4", E4M3), ("bf", BF16)]),
    ];
    for (small, integer, format, [one, two]) in cases {
        let found = every_code(small, integer, [one.0, two.0]);
        for (bits, words) in found.iter().enumerate() {
            let value = format.value(bits as u64);
            let [low, high] = double(value);
            let saturates = |name: &str| name != "bf";
            let expected = [
                single(value),
                low,
                high,
                half(value),
                one.1.nearest(value, false),
                two.1.nearest(value, false),
                one.1.nearest(value, saturates(one.0)),
                two.1.nearest(value, saturates(two.0)),
                // Beyond their range, which is left open, integers saturate; a NaN is 0.
                value as i32 as u32,
                value as u64 as u32,
                i32::from(value as i8) as u32,
            ];
            assert_eq!(words[..11], expected, "{small} {bits:#x}");
        }
    }
}

const INPUT: &str = "
    OpDecorate %inputs_words ArrayStride 8
    OpDecorate %inputs_block Block
    OpMemberDecorate %inputs_block 0 Offset 0
    OpDecorate %inputs DescriptorSet 0
    OpDecorate %inputs Binding 1
    OpDecorate %d_e4s SaturatedToLargestFloat8NormalConversionEXT
    OpDecorate %d_e5s SaturatedToLargestFloat8NormalConversionEXT
    OpDecorate %f_e4s SaturatedToLargestFloat8NormalConversionEXT
    OpDecorate %f_e5s SaturatedToLargestFloat8NormalConversionEXT
    OpDecorate %i_e4s SaturatedToLargestFloat8NormalConversionEXT
    OpDecorate %u_e5s SaturatedToLargestFloat8NormalConversionEXT";

/// Runs a body for each of 64 bits, told as `%input` of a type.
fn for_each(ty: &str, inputs: &[u64], body: &str) -> Vec<[u32; 16]> {
    let declarations = format!(
        "{TYPES}
         %inputs_words = OpTypeRuntimeArray %{ty}
         %inputs_block = OpTypeStruct %inputs_words
         %ptr_inputs_block = OpTypePointer StorageBuffer %inputs_block
         %ptr_input = OpTypePointer StorageBuffer %{ty}
         %inputs = OpVariable %ptr_inputs_block StorageBuffer"
    );
    let body = format!(
        "%pointer = OpAccessChain %ptr_input %inputs %u0 %id
         %input = OpLoad %{ty} %pointer
         {body}"
    );
    let used = |line: &&str| {
        let id = line.split_whitespace().nth(1).unwrap_or_default();
        !id.contains('_') || !id.ends_with('s') || id == "%inputs_words" || body.contains(&format!("{id} "))
    };
    let annotations: Vec<&str> = INPUT.lines().filter(used).collect();
    let bytes: Vec<u8> = inputs.iter().flat_map(|bits| bits.to_le_bytes()).collect();
    let annotations = annotations.join("\n");
    let shader = Shader { invocations: Some(inputs.len()), ..shader(&body, &annotations, &declarations) };
    let found =
        shader.run_with(&mut || Resources::default().bind(0, 1, Descriptor::Buffer(Buffer::new(&bytes))));
    found.unwrap_or_else(|error| panic!("{}", error.render()))
}

#[test]
fn middles_of_neighbours_and_what_lies_beside_them_round_once() {
    let edges = [0.0, f64::from_bits(1), 1e-40, 1e300, f64::INFINITY, f64::NAN, f32::MAX.into(), 1e38];
    let numbers = E4M3.middles().chain(E5M2.middles()).chain(BF16.middles().step_by(97)).chain(edges);
    let near = numbers.flat_map(|x| [x, x.next_up(), x.next_down(), f64::from((x as f32).next_up())]);
    let values: Vec<f64> = near.flat_map(|x| [x, -x]).collect();
    let mut body = String::from("%narrow = OpFConvert %float %input\n");
    let results = [
        ("d_bf", "bf", "input"),
        ("d_e4", "e4", "input"),
        ("d_e5", "e5", "input"),
        ("d_e4s", "e4", "input"),
        ("d_e5s", "e5", "input"),
        ("f_bf", "bf", "narrow"),
        ("f_e4", "e4", "narrow"),
        ("f_e5", "e5", "narrow"),
        ("f_e4s", "e4", "narrow"),
        ("f_e5s", "e5", "narrow"),
    ];
    for (at, (name, ty, from)) in results.iter().enumerate() {
        body += &format!("%{name} = OpFConvert %{ty} %{from}\n{}", stored(name, ty, at));
    }
    let bits: Vec<u64> = values.iter().map(|value| value.to_bits()).collect();
    for (words, &value) in for_each("double", &bits, &body).iter().zip(&values) {
        let narrow = f64::from(value as f32);
        let expected = [
            // A double is rounded to binary32 first: SPV_KHR_bfloat16, "Conversion Instructions".
            BF16.nearest(narrow, false),
            E4M3.nearest(value, false),
            E5M2.nearest(value, false),
            E4M3.nearest(value, true),
            E5M2.nearest(value, true),
            BF16.nearest(narrow, false),
            E4M3.nearest(narrow, false),
            E5M2.nearest(narrow, false),
            E4M3.nearest(narrow, true),
            E5M2.nearest(narrow, true),
        ];
        assert_eq!(words[..10], expected, "{value:e}");
    }
}

#[test]
fn integers_of_every_width_become_small_floats() {
    let near = |x: i64| [x - 1, x, x + 1];
    let powers = (0..63).map(|bit| 1i64 << bit);
    // Middles of bfloat16 and of E5M2 in their binades: 2^k + 2^(k - 8) and 2^k + 2^(k - 3).
    let middles = (8..62).flat_map(|k| [(1i64 << k) + (1 << (k - 8)), (1i64 << k) + (1 << (k - 3))]);
    // As an f32 this is 2^24 + 2^16, a tie; the integer lies above it.
    let twice = [(1i64 << 40) + (1 << 32) + 1, i64::MIN, i64::MAX, 448, 464, 480, 57_344, 61_440];
    let all = powers.chain(middles).flat_map(near).chain(twice).chain(-20..20);
    let values: Vec<i64> = all.flat_map(|x| [x, x.wrapping_neg()]).collect();
    let mut body = String::from(
        "%as8 = OpSConvert %char %input
         %as16 = OpSConvert %short %input
         %as32 = OpSConvert %int %input
         %us8 = OpUConvert %uchar %unsigned
         %us32 = OpUConvert %uint %unsigned\n",
    );
    body = format!("%unsigned = OpBitcast %ulong %input\n{body}");
    let results = [
        ("i_bf", "bf", "ConvertSToF", "input"),
        ("i_e4", "e4", "ConvertSToF", "input"),
        ("i_e5", "e5", "ConvertSToF", "input"),
        ("i_e4s", "e4", "ConvertSToF", "input"),
        ("u_bf", "bf", "ConvertUToF", "unsigned"),
        ("u_e5", "e5", "ConvertUToF", "unsigned"),
        ("u_e5s", "e5", "ConvertUToF", "unsigned"),
        ("a_e4", "e4", "ConvertSToF", "as8"),
        ("b_e5", "e5", "ConvertSToF", "as16"),
        ("c_bf", "bf", "ConvertSToF", "as32"),
        ("c_e4", "e4", "ConvertSToF", "as32"),
        ("v_bf", "bf", "ConvertUToF", "us8"),
        ("w_e5", "e5", "ConvertUToF", "us32"),
    ];
    for (at, (name, ty, conversion, from)) in results.iter().enumerate() {
        body += &format!("%{name} = Op{conversion} %{ty} %{from}\n{}", stored(name, ty, at));
    }
    let bits: Vec<u64> = values.iter().map(|&value| value as u64).collect();
    // Numbers that f64 rounds lie far beyond both ranges of eight bits.
    let exact = |x: i64| x as f64;
    for (words, &value) in for_each("long", &bits, &body).iter().zip(&values) {
        let unsigned = value as u64;
        let expected = [
            BF16.nearest((value as f32).into(), false),
            E4M3.nearest(exact(value), false),
            E5M2.nearest(exact(value), false),
            E4M3.nearest(exact(value), true),
            BF16.nearest((unsigned as f32).into(), false),
            E5M2.nearest(unsigned as f64, false),
            E5M2.nearest(unsigned as f64, true),
            E4M3.nearest((value as i8).into(), false),
            E5M2.nearest((value as i16).into(), false),
            BF16.nearest((value as i32 as f32).into(), false),
            E4M3.nearest((value as i32).into(), false),
            BF16.nearest((unsigned as u8).into(), false),
            E5M2.nearest((unsigned as u32).into(), false),
        ];
        assert_eq!(words[..13], expected, "{value}");
    }
}

#[test]
fn values_go_through_memory_composites_calls_and_choices() {
    let annotations = "
        OpDecorate %pair ArrayStride 1
        OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
        OpMemberDecorate %block 1 Offset 2
        OpMemberDecorate %block 2 Offset 4
        OpMemberDecorate %block 3 Offset 8
        OpMemberDecorate %block 4 Offset 14
        OpDecorate %buffer DescriptorSet 0
        OpDecorate %buffer Binding 1
        OpDecorate %special SpecId 3";
    let declarations = format!(
        "{TYPES}
         %pair = OpTypeArray %e4 %u2
         %block = OpTypeStruct %bf %pair %e5 %bf3 %bf3
         %ptr_block = OpTypePointer StorageBuffer %block
         %ptr_bf = OpTypePointer StorageBuffer %bf
         %ptr_e4 = OpTypePointer StorageBuffer %e4
         %ptr_e5 = OpTypePointer StorageBuffer %e5
         %ptr_bf3 = OpTypePointer StorageBuffer %bf3
         %buffer = OpVariable %ptr_block StorageBuffer
         %ptr_Function_bf3 = OpTypePointer Function %bf3
         %ptr_Function_bf = OpTypePointer Function %bf
         %bf_type = OpTypeFunction %bf %bf %bool
         %special = OpSpecConstant %bf 0x4040
         %special_single = OpSpecConstantOp %float FConvert %special
         %one = OpConstant %bf 0x3f80
         %two = OpConstant %bf 0x4000
         %ones = OpConstantComposite %bf3 %one %two %special
         %nothing = OpConstantNull %e5"
    );
    let functions = "
        %choose = OpFunction %bf None %bf_type
        %x = OpFunctionParameter %bf
        %which = OpFunctionParameter %bool
        %start = OpLabel
        OpSelectionMerge %end None
        OpBranchConditional %which %yes %end
        %yes = OpLabel
        OpBranch %end
        %end = OpLabel
        %phi = OpPhi %bf %two %start %x %yes
        %selected = OpSelect %bf %which %phi %phi
        OpReturnValue %selected
        OpFunctionEnd";
    // The stores are of one value by all invocations.
    let body = "
        %p0 = OpAccessChain %ptr_bf %buffer %u0
        %a = OpLoad %bf %p0
        %p1 = OpAccessChain %ptr_e4 %buffer %u1 %u1
        %b = OpLoad %e4 %p1
        %p2 = OpAccessChain %ptr_e5 %buffer %u2
        %c = OpLoad %e5 %p2
        %p3 = OpAccessChain %ptr_bf3 %buffer %u3
        %v = OpLoad %bf3 %p3
        %odd = OpBitwiseAnd %uint %id %u1
        %is_odd = OpINotEqual %bool %odd %u0
        %chosen = OpFunctionCall %bf %choose %a %is_odd
        %inserted = OpCompositeInsert %bf3 %chosen %v 1
        %index = OpUMod %uint %id %u3
        %dynamic = OpVectorExtractDynamic %bf %inserted %index
        %mixed = OpVectorShuffle %bf3 %inserted %ones 0 4 5
        %second = OpCompositeExtract %bf %mixed 1
        %third = OpCompositeExtract %bf %mixed 2
        %fa = OpFConvert %float %dynamic
        %oa = OpBitcast %uint %fa
        out 0 %oa
        %fb = OpFConvert %float %b
        %ob = OpBitcast %uint %fb
        out 1 %ob
        %fc = OpFConvert %float %c
        %oc = OpBitcast %uint %fc
        out 2 %oc
        %fd = OpFConvert %float %second
        %od = OpBitcast %uint %fd
        out 3 %od
        %fe = OpFConvert %float %third
        %oe = OpBitcast %uint %fe
        out 4 %oe
        %of = OpBitcast %uint %special_single
        out 5 %of
        %whole = OpConvertFToS %int %nothing
        %og = OpBitcast %uint %whole
        out 6 %og
        %three = OpAccessChain %ptr_e4 %buffer %u1 %u0
        OpStore %three %b
        %p4 = OpAccessChain %ptr_bf3 %buffer %u4
        OpStore %p4 %ones";
    let mut buffers = Vec::new();
    // a = -1.5 bf16; pair = 2, 448; c = -inf E5M2; v = 8, 16, 32 bf16.
    let bytes = [0xC0, 0xBF, 0x40, 0x7E, 0xFC, 0, 0, 0, 0x00, 0x41, 0x80, 0x41, 0x00, 0x42, 0, 0, 0, 0, 0, 0];
    let shader = Shader { functions, ..shader(body, annotations, &declarations) };
    let found = shader.run_with(&mut || {
        let buffer = Buffer::new(&bytes);
        buffers.push(buffer.clone());
        Resources::default().bind(0, 1, Descriptor::Buffer(buffer))
    });
    let found = found.unwrap_or_else(|error| panic!("{}", error.render()));
    for (id, words) in found.iter().enumerate() {
        let chosen = if id % 2 == 1 { -1.5 } else { 2.0 };
        let dynamic: f32 = [8.0, chosen, 32.0][id % 3];
        let floats = words[..6].iter().map(|&word| f32::from_bits(word)).collect::<Vec<_>>();
        assert_eq!(floats, [dynamic, 448.0, f32::NEG_INFINITY, 2.0, 3.0, 3.0]);
        assert_eq!(words[6], 0);
    }
    for buffer in buffers {
        // The first of the pair is 448 now, and the last vector 1, 2, 3.
        let expected = [0xC0, 0xBF, 0x7E, 0x7E, 0xFC, 0, 0, 0, 0x00, 0x41, 0x80, 0x41, 0x00, 0x42];
        assert_eq!(buffer.bytes()[..14], expected);
        assert_eq!(buffer.bytes()[14..], [0x80, 0x3F, 0x00, 0x40, 0x40, 0x40]);
    }
}

#[test]
fn a_dot_product_of_bfloat16_is_rounded_at_the_end() {
    let declarations = format!(
        "{TYPES}
         %one = OpConstant %bf 0x3f80
         %little = OpConstant %bf 0x3b80
         %ones = OpConstantComposite %bf3 %one %one %one"
    );
    let body = "
        %bits = OpUConvert %ushort %u0
        %zero = OpBitcast %bf %bits
        %v = OpCompositeConstruct %bf3 %one %little %little
        %dot = OpDot %bf %v %ones
        %dot_bits = OpBitcast %ushort %dot
        %o = OpUConvert %uint %dot_bits
        out 0 %o";
    // 1 + 2^-8 + 2^-8 = 1 + 2^-7, the bfloat16 that follows 1; with rounded sums it would be 1.
    assert!(shader(body, "", &declarations).run().iter().all(|words| words[0] == 0x3F81));
    let error = Shader {
        capabilities: "OpCapability BFloat16TypeKHR\nOpCapability Float8EXT",
        ..shader(body, "", &declarations)
    }
    .refused();
    assert_eq!(error.kind(), ErrorKind::InvalidModule);
    assert!(error.message().contains("BFloat16DotProductKHR"), "{}", error.render());
}

/// `SPV_VALVE_mixed_float_dot_product`: products in f32 and their sum, then the accumulator.
#[test]
fn dot_products_with_an_accumulator_are_summed_in_its_type() {
    let capabilities = format!(
        "{CAPABILITIES}
         OpCapability DotProductFloat16AccFloat32VALVE
         OpCapability DotProductFloat16AccFloat16VALVE
         OpCapability DotProductBFloat16AccVALVE
         OpCapability DotProductFloat8AccFloat32VALVE
         OpExtension \"SPV_VALVE_mixed_float_dot_product\""
    );
    let declarations = format!(
        "{TYPES}
         %half2 = OpTypeVector %half 2
         %e5x4 = OpTypeVector %e5 4
         %large = OpConstant %half 0x7bff
         %half_one = OpConstant %half 0x3c00
         %larges = OpConstantComposite %half2 %large %half_one
         %many = OpConstant %float 1.5
         %half_three = OpConstant %half 0x4200
         %half_pair = OpConstantComposite %half2 %half_three %half_one
         %bf_one = OpConstant %bf 0x3f80
         %bf_little = OpConstant %bf 0x3b80
         %bf_pair = OpConstantComposite %bf2 %bf_one %bf_little
         %bf_ones = OpConstantComposite %bf2 %bf_one %bf_one
         %five = OpConstant %e5 0x3c
         %fives = OpConstantComposite %e5x4 %five %five %five %five"
    );
    let body = "
        %f = OpFDot2MixAcc32VALVE %float %larges %larges %many
        %f_bits = OpBitcast %uint %f
        out 0 %f_bits
        %h = OpFDot2MixAcc16VALVE %half %half_pair %half_pair %half_three
        %h_bits = OpBitcast %ushort %h
        %h_word = OpUConvert %uint %h_bits
        out 1 %h_word
        %b = OpFDot2MixAcc16VALVE %bf %bf_pair %bf_ones %bf_little
        %b_bits = OpBitcast %ushort %b
        %b_word = OpUConvert %uint %b_bits
        out 2 %b_word
        %b32 = OpFDot2MixAcc32VALVE %float %bf_pair %bf_ones %many
        %b32_bits = OpBitcast %uint %b32
        out 3 %b32_bits
        %e = OpFDot4MixAcc32VALVE %float %fives %fives %many
        %e_bits = OpBitcast %uint %e
        out 4 %e_bits";
    let mixed = Shader { capabilities: &capabilities, ..shader(body, "", &declarations) };
    // 65504^2 is beyond f16 and exact in f32, where 1 and 1.5 are lost behind it; 9 + 1 + 3;
    // 1 + 2^-8 + 2^-8 rounded once; 1 + 2^-8 + 1.5; four products of 1.
    let expected = [
        (65504.0_f32 * 65504.0).to_bits(),
        u32::from(f16::from_f32(13.0).to_bits()),
        0x3F81,
        (2.5 + 0.003_906_25_f32).to_bits(),
        5.5_f32.to_bits(),
    ];
    assert!(mixed.run().iter().all(|words| words[..5] == expected), "{:x?}", mixed.run()[0]);
    for (wrong, what) in [
        ("%x = OpFDot2MixAcc32VALVE %float %fives %fives %many", "no such types are multiplied"),
        ("%x = OpFDot2MixAcc16VALVE %half %half_pair %half_pair %many", "the accumulator that of the result"),
        ("%x = OpFDot4MixAcc32VALVE %float %half_pair %half_pair %many", "no such types are multiplied"),
    ] {
        let error = Shader { body: wrong, ..mixed.clone() }.refused();
        assert_eq!(error.kind(), ErrorKind::InvalidModule, "{}", error.render());
        assert!(error.message().contains(what), "{}", error.render());
    }
    let error =
        shader("%x = OpFDot2MixAcc16VALVE %half %half_pair %half_pair %half_three", "", &declarations)
            .refused();
    assert!(error.message().contains("DotProductFloat16AccFloat16VALVE"), "{}", error.render());
}

fn refused(body: &str) -> Error {
    let declarations = format!(
        "{TYPES}
         %ptr_bf = OpTypePointer Private %bf
         %variable = OpVariable %ptr_bf Private
         %one = OpConstant %bf 0x3f80
         %eight = OpConstant %e4 0x50
         %eights = OpConstant %e5 0x48
         %e4x2 = OpTypeVector %e4 2
         %pair = OpConstantComposite %e4x2 %eight %eight
         %ones = OpConstantComposite %bf2 %one %one
         %single = OpConstant %float 1"
    );
    let annotations = if body.contains("%saturated") {
        "OpDecorate %saturated SaturatedToLargestFloat8NormalConversionEXT"
    } else {
        ""
    };
    shader(body, annotations, &declarations).refused()
}

#[test]
fn what_the_extensions_do_not_list_is_invalid() {
    const BFLOAT16: &str = "SPV_KHR_bfloat16, Validation Rules";
    const FLOAT8: &str = "SPV_EXT_float8, Validation Rules";
    for (body, rule) in [
        ("%x = OpFAdd %bf %one %one", BFLOAT16),
        ("%x = OpFNegate %bf %one", BFLOAT16),
        ("%x = OpVectorTimesScalar %bf2 %ones %one", BFLOAT16),
        ("%x = OpFOrdEqual %bool %one %one", BFLOAT16),
        ("%x = OpIsNan %bool %one", BFLOAT16),
        ("%x = OpExtInst %bf %glsl FAbs %one", BFLOAT16),
        ("%x = OpAtomicLoad %bf %variable %u1 %u0", BFLOAT16),
        ("%x = OpGroupNonUniformBroadcastFirst %bf %u3 %one", BFLOAT16),
        ("%x = OpFMul %e4 %eight %eight", FLOAT8),
        ("%x = OpDot %e4 %pair %pair", FLOAT8),
        ("%x = OpFOrdLessThan %bool %eights %eights", FLOAT8),
        ("%saturated = OpFConvert %float %eight", "SPV_EXT_float8, Decoration"),
        ("%saturated = OpFConvert %bf %eight", "SPV_EXT_float8, Decoration"),
        ("%saturated = OpBitcast %e4 %some", "SPV_EXT_float8, Decoration"),
        ("%x = OpConvertSToF %float %one", "SPIR-V 3.3.11"),
        ("%x = OpConvertFToU %bf %single", "SPIR-V 3.3.11"),
    ] {
        let body = match body.contains("%some") {
            true => format!("%some = OpUConvert %uchar %u1\n{body}"),
            false => body.to_owned(),
        };
        let error = refused(&body);
        assert_eq!(error.kind(), ErrorKind::InvalidModule, "{body}: {}", error.render());
        assert!(error.message().contains(rule), "{body}: {}", error.render());
    }
    // What is valid and does not run is said so.
    let error = refused("%x = OpExtInst %e4 %glsl FAbs %eight");
    assert_eq!(error.kind(), ErrorKind::UnsupportedModule, "{}", error.render());
    // The components of a cooperative matrix may be such floats (SPV_KHR_cooperative_matrix).
    for conversion in ["OpFConvert %narrow %wide", "OpBitcast %narrow %wide", "OpFNegate %narrow %some"] {
        let (name, annotation) = match conversion.contains("Convert") {
            true => ("%saturated", "OpDecorate %saturated SaturatedToLargestFloat8NormalConversionEXT"),
            false => ("%x", ""),
        };
        let declarations = format!(
            "{TYPES}
             %narrow = OpTypeCooperativeMatrixKHR %e4 %u3 %u9 %u9 %u0
             %other = OpTypeCooperativeMatrixKHR %float %u3 %u9 %u9 %u0
             %wide = OpUndef %other
             %some = OpUndef %narrow"
        );
        let error = shader(&format!("{name} = {conversion}"), annotation, &declarations).refused();
        assert_eq!(error.kind(), ErrorKind::UnsupportedModule, "{conversion}: {}", error.render());
    }
    // BFloat16ArithmeticINTEL (SPV_INTEL_bfloat16_arithmetic).
    let declarations = format!("{TYPES}\n%one = OpConstant %bf 0x3f80");
    let capabilities = format!("{CAPABILITIES}\nOpCapability 6226");
    let arithmetic = shader("%x = OpFAdd %bf %one %one", "", &declarations);
    let error = Shader { capabilities: &capabilities, ..arithmetic }.refused();
    assert_eq!(error.kind(), ErrorKind::UnsupportedModule, "{}", error.render());
}

#[test]
fn a_float_has_as_many_bits_as_its_encoding() {
    for (ty, kind, told) in [
        ("OpTypeFloat 8", ErrorKind::InvalidModule, "8 bits without an FP Encoding"),
        ("OpTypeFloat 32 0", ErrorKind::InvalidModule, "an FP Encoding of another width"),
        ("OpTypeFloat 16 4214", ErrorKind::InvalidModule, "an FP Encoding of another width"),
        // One that is not known here, of which a value is needed.
        ("OpTypeFloat 8 6214", ErrorKind::UnsupportedModule, "OpTypeFloat"),
    ] {
        let declarations = format!("%odd = {ty}\n%nothing = OpConstantNull %odd");
        let error = shader("%x = OpCopyObject %odd %nothing", "", &declarations).refused();
        assert_eq!(error.kind(), kind, "{ty}: {}", error.render());
        assert!(error.message().contains(told), "{ty}: {}", error.render());
    }
}
