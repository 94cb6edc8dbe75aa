//! `Modf` and `Frexp`, which give a second value through a pointer or in a struct.

use std::fmt::Write;

use crate::instructions::operand_types::exact;
use crate::instructions::operand_types::literal;
use crate::instructions::operand_types::types::{self, KINDS, Kind};
use crate::instructions::run::Shader;

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
    assert_eq!(crate::instructions::operand_types::refused::not_refused(&bodies), []);
}
