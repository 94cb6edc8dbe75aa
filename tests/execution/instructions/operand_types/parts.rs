//! `Modf` and `Frexp`, which give a second value through a pointer or in a struct.

use std::fmt::Write;

use crate::execution::instructions::operand_types::exact;
use crate::execution::instructions::operand_types::literal;
use crate::execution::instructions::operand_types::types::{self, KINDS, Kind};
use crate::execution::instructions::run::Shader;

/// Significand and exponent, by halving and doubling.
fn frexp(value: f64) -> (f64, i32) {
    if value == 0.0 || !value.is_finite() {
        return (value, 0);
    }
    let (mut significand, mut exponent) = (value, 0);
    while significand.abs() >= 1.0 {
        (significand, exponent) = (significand / 2.0, exponent + 1);
    }
    while significand.abs() < 0.5 {
        (significand, exponent) = (significand * 2.0, exponent - 1);
    }
    (significand, exponent)
}

#[test]
fn exponents_have_32_or_16_bits() {
    let floats = [Kind::F16, Kind::F32, Kind::F64];
    for float in floats {
        for integer in [Kind::I16, Kind::U16, Kind::I32, Kind::U32] {
            for value in [0.0, 1.0, -3.0, 0.1, 6e-8, 40_000.0] {
                let bits = exact::of_f64(float, value);
                let (_, exponent) = frexp(exact::to_f64(float, bits));
                let [f, i] = [float.name(), integer.name()];
                let declarations = types::declarations()
                    + &format!(
                        "%value = OpConstant %{f} {0}
                         %split = OpTypeStruct %{f} %{i}
                         %to_exponent = OpTypePointer Private %{i}
                         %exponent = OpVariable %to_exponent Private
                         %to_held = OpTypePointer Private %{f}
                         %held = OpVariable %to_held Private",
                        literal(float, bits)
                    );
                // Once of a constant, once of a value that is read.
                let mut body = String::from("OpStore %held %value\n");
                let _ = writeln!(body, "%read = OpLoad %{f} %held");
                for (at, of) in ["value", "read"].into_iter().enumerate() {
                    let _ = writeln!(
                        body,
                        "%s{at} = OpExtInst %split %glsl FrexpStruct %{of}
                         %e{at} = OpCompositeExtract %{i} %s{at} 1
                         %m{at} = OpExtInst %{f} %glsl Frexp %{of} %exponent
                         %p{at} = OpLoad %{i} %exponent
                         %a{at} = OpExtInst %{f} %glsl Ldexp %m{at} %e{at}
                         %same{at} = OpFOrdEqual %bool %a{at} %{of}
                         %sw{at} = OpSelect %uint %same{at} %u1 %u0
                         out {} %sw{at}",
                        3 * at + 2
                    );
                    for (name, place) in [(format!("e{at}"), 3 * at), (format!("p{at}"), 3 * at + 1)] {
                        let _ = match integer {
                            Kind::U32 => writeln!(body, "out {place} %{name}"),
                            Kind::I32 => {
                                writeln!(body, "%w_{name} = OpBitcast %uint %{name}\nout {place} %w_{name}")
                            }
                            // As the row holds it: zero-extended.
                            _ => {
                                writeln!(body, "%w_{name} = OpUConvert %uint %{name}\nout {place} %w_{name}")
                            }
                        };
                    }
                }
                let found = Shader {
                    capabilities: "OpExtension \"SPV_AMD_gpu_shader_int16\"",
                    declarations: &declarations,
                    body: &body,
                    ..Shader::default()
                }
                .run();
                let expected = exponent as u32 & integer.mask() as u32;
                // An unsigned exponent below zero is a large one to Ldexp.
                let back = u32::from(integer.is_signed() || exponent >= 0);
                for words in found {
                    assert_eq!(
                        words[..6],
                        [expected, expected, back, expected, expected, back],
                        "{f} {i} {value}"
                    );
                }
            }
        }
    }
}

#[test]
fn whole_parts_have_the_type_of_the_operand() {
    let mut bodies = Vec::new();
    for kind in KINDS.into_iter().filter(|kind| kind.is_float()) {
        for other in KINDS.into_iter().filter(|&other| other != kind && other != Kind::Bool) {
            let at = bodies.len();
            bodies.push(format!(
                "%v{at} = OpVariable %function_{1} Function\n%r{at} = OpExtInst %{0} %glsl Modf %zero_{0} %v{at}",
                kind.name(),
                other.name()
            ));
        }
        for other in [Kind::I8, Kind::I64, Kind::F32] {
            let at = bodies.len();
            bodies.push(format!(
                "%v{at} = OpVariable %function_{1} Function\n%r{at} = OpExtInst %{0} %glsl Frexp %zero_{0} %v{at}",
                kind.name(),
                other.name()
            ));
        }
    }
    assert_eq!(crate::execution::instructions::operand_types::refused::not_refused(&bodies), []);
}

#[test]
fn exponents_of_every_width_count_whole() {
    // 1 times 2 to the exponent, as an f32: from 2^128 on infinite, up to 2^-150 zero.
    let power = |exponent: i128| match exponent {
        128.. => f32::INFINITY.to_bits(),
        -126..128 => ((exponent + 127) as u32) << 23,
        -149..-126 => 1 << (exponent + 149),
        _ => 0,
    };
    for kind in KINDS.into_iter().filter(|kind| kind.is_integer()) {
        let top = 1u64 << (kind.bits() - 1);
        let mut exponents: Vec<u64> = [0, 1, 5, 127, 128, top - 1, top, top + 1].to_vec();
        exponents.extend([1u64, 2, 126, 127, 128].map(|below| below.wrapping_neg() & kind.mask()));
        // Whose lower 32 bits say something else, where there are more.
        exponents.extend([1u64 << 32, (1 << 32) + 3, 0xFFFF_FFFF].map(|wide| wide & kind.mask()));
        let name = kind.name();
        let mut declarations = types::declarations()
            + &format!(
                "%to_held = OpTypePointer Private %{name}
                 %held = OpVariable %to_held Private
                 %one = OpConstant %float 1.0\n"
            );
        for (at, &bits) in exponents.iter().enumerate() {
            let _ = writeln!(declarations, "%e{at} = OpConstant %{name} {}", literal(kind, bits));
        }
        for (at, &bits) in exponents.iter().enumerate() {
            let body = format!(
                "%constant = OpExtInst %float %glsl Ldexp %one %e{at}
                 %constant_word = OpBitcast %uint %constant
                 out 0 %constant_word
                 OpStore %held %e{at}
                 %exponent = OpLoad %{name} %held
                 %f = OpConvertUToF %float %id
                 %zero = OpFSub %float %f %f
                 %read_one = OpFAdd %float %zero %one
                 %read = OpExtInst %float %glsl Ldexp %read_one %exponent
                 %read_word = OpBitcast %uint %read
                 out 1 %read_word"
            );
            let number = match kind.is_signed() {
                true => i128::from((bits << (64 - kind.bits())) as i64 >> (64 - kind.bits())),
                false => i128::from(bits),
            };
            let found = Shader { declarations: &declarations, body: &body, ..Shader::default() }.run();
            for words in found {
                assert_eq!(words[..2], [power(number); 2], "{name} {number}");
            }
        }
    }
}
