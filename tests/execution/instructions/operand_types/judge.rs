//! What each instruction of the table gives, from the words of the specification: integers as
//! mathematical ones, floats by exact rationals, nothing from the code that is tested.

use num_bigint::BigInt;

use crate::execution::instructions::operand_types::Case;
use crate::execution::instructions::operand_types::exact::{self, to_f64};
use crate::execution::instructions::operand_types::types::{Kind, Ty};

/// What a component of a result must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expected {
    /// These bits; any NaN for a NaN.
    Bits(u64),
    /// So many steps from these bits at the most: what a function of f64 gives, rounded.
    Near(u64, u64),
    /// The specification leaves it open, and so does this crate.
    Undefined,
}

use Expected::{Bits, Near, Undefined};

/// The components of an instruction's result, those of both members of a struct one after the
/// other. The first type is the result's.
pub fn judge(case: &Case, operands: &[Vec<u64>]) -> Vec<Expected> {
    let (name, types) = (case.name, &case.types[..]);
    if let Some(found) = rearranged(case, operands).or_else(|| dot_product(case, operands)) {
        return found;
    }
    if let Some(whole) = whole(name, types, operands) {
        return whole;
    }
    let kinds: Vec<Kind> = types.iter().map(|ty| ty.kind).collect();
    let component = |at: usize, part: usize| -> Expected {
        let scalars: Vec<u64> =
            operands.iter().map(|operand| operand[if operand.len() == 1 { 0 } else { at }]).collect();
        match kinds[1].is_float() && !matches!(name, "Select" | "CopyObject" | "FreezeKHR") {
            true => float(name, part, &kinds, &scalars),
            false => integer(name, part, &kinds, &scalars),
        }
    };
    let parts = if ["IAddCarry", "ISubBorrow", "UMulExtended", "SMulExtended", "ModfStruct"].contains(&name) {
        2
    } else {
        1
    };
    (0..parts)
        .flat_map(|part| (0..types[0].count).map(move |at| (at, part)))
        .map(|(at, part)| component(at, part))
        .collect()
}

/// Instructions that only move bits.
fn rearranged(case: &Case, operands: &[Vec<u64>]) -> Option<Vec<Expected>> {
    let found: Vec<u64> = match case.name {
        "CompositeConstruct" => operands.concat(),
        "VectorShuffle" => case.tail.iter().map(|&at| operands.concat()[at]).collect(),
        "CompositeInsert" => {
            let mut found = operands[1].clone();
            found[case.tail[0]] = operands[0][0];
            found
        }
        "Bitcast" => {
            // The lowest components hold the lowest bits (SPIR-V, OpBitcast).
            let (from, to) = (case.types[1].kind, case.types[0].kind);
            let mut bits = BigInt::from(0);
            for (at, &part) in operands[0].iter().enumerate() {
                bits |= BigInt::from(part) << (at as u32 * from.bits());
            }
            let part = |at: usize| (&bits >> (at as u32 * to.bits())) & BigInt::from(to.mask());
            (0..case.types[0].count).map(|at| u64::try_from(part(at)).expect("few bits")).collect()
        }
        _ => return None,
    };
    Some(found.into_iter().map(Bits).collect())
}

/// Dot products of integers (`SPV_KHR_integer_dot_product`).
fn dot_product(case: &Case, operands: &[Vec<u64>]) -> Option<Vec<Expected>> {
    let signs = match case.name {
        "SDot" | "SDotAccSat" => [true, true],
        "UDot" | "UDotAccSat" => [false, false],
        "SUDot" | "SUDotAccSat" => [true, false],
        _ => return None,
    };
    let numbers = |at: usize| -> Vec<i128> {
        let ty = case.types[at + 1];
        match ty.count {
            // Four bytes packed in a word.
            1 => (0..4)
                .map(|byte| Kind::I8.number(operands[at][0] >> (8 * byte), signs[at]))
                .map(|number| if signs[at] { number } else { number & 0xFF })
                .collect(),
            _ => operands[at].iter().map(|&bits| ty.kind.number(bits, signs[at])).collect(),
        }
    };
    let result = case.types[0].kind;
    let products = numbers(0).into_iter().zip(numbers(1)).map(|(a, b)| BigInt::from(a) * b);
    let sum: BigInt = products.sum();
    let cut = |value: &BigInt| -> u64 {
        let all = BigInt::from(1) << result.bits();
        u64::try_from(((value % &all) + &all) % &all).expect("few bits")
    };
    if !case.name.ends_with("AccSat") {
        return Some(vec![Bits(cut(&sum))]);
    }
    let [least, greatest]: [BigInt; 2] = match signs[0] {
        true => [-(BigInt::from(1) << (result.bits() - 1)), (BigInt::from(1) << (result.bits() - 1)) - 1],
        false => [0.into(), (BigInt::from(1) << result.bits()) - 1],
    };
    // Only the last addition saturates; what overflows before it is undefined.
    let all_fit = {
        let mut total = BigInt::from(0);
        numbers(0).into_iter().zip(numbers(1)).all(|(a, b)| {
            let product = BigInt::from(a) * b;
            total += &product;
            (&least..=&greatest).contains(&&product) && (&least..=&greatest).contains(&&total)
        })
    };
    if !all_fit {
        return Some(vec![Undefined]);
    }
    let total = sum + result.number(operands[2][0], signs[0]);
    Some(vec![Bits(cut(&total.clamp(least, greatest)))])
}

/// Instructions that are not componentwise.
fn whole(name: &str, types: &[Ty], operands: &[Vec<u64>]) -> Option<Vec<Expected>> {
    let kind = types[1].kind;
    let a = &operands[0];
    let of = |operation: fn(Kind, u64, u64) -> u64| move |x: u64, y: u64| operation(kind, x, y);
    let (add, sub, mul) = (of(exact::add), of(exact::sub), of(exact::mul));
    let dot = |a: &[u64], b: &[u64]| {
        let products: Vec<u64> = a.iter().zip(b).map(|(&a, &b)| mul(a, b)).collect();
        products[1..].iter().fold(products[0], |total, &product| add(total, product))
    };
    let number = |value: f64| exact::of_f64(kind, value);
    let root = |bits: u64| exact::of_f64(kind, to_f64(kind, bits).sqrt());
    let less = |a: u64, b: u64| to_f64(kind, a) < to_f64(kind, b);
    let bits = |found: Vec<u64>| Some(found.into_iter().map(Bits).collect());
    match name {
        "Any" => bits(vec![u64::from(a.contains(&1))]),
        "All" => bits(vec![u64::from(!a.contains(&0))]),
        "Dot" => bits(vec![dot(a, &operands[1])]),
        "VectorExtractDynamic" => {
            let at = types[2].kind.number(operands[1][0], true);
            Some(vec![
                usize::try_from(at).ok().and_then(|at| a.get(at)).map_or(Undefined, |&bits| Bits(bits)),
            ])
        }
        "VectorInsertDynamic" => {
            let at = types[3].kind.number(operands[2][0], true);
            let mut result: Vec<Expected> = a.iter().map(|&bits| Bits(bits)).collect();
            match usize::try_from(at).ok().and_then(|at| result.get_mut(at)) {
                Some(place) => *place = Bits(operands[1][0]),
                None => result.fill(Undefined),
            }
            Some(result)
        }
        "Length" | "Distance" => {
            let v: Vec<u64> = match name {
                "Length" => a.clone(),
                _ => a.iter().zip(&operands[1]).map(|(&a, &b)| sub(a, b)).collect(),
            };
            bits(vec![if v.len() == 1 { number(to_f64(kind, v[0]).abs()) } else { root(dot(&v, &v)) }])
        }
        "Normalize" => {
            let scale = 1.0 / to_f64(kind, dot(a, a)).sqrt();
            // The reciprocal root is rounded in f64 first, then both it and the product.
            if !scale.is_normal() {
                return Some(vec![Undefined; a.len()]);
            }
            let scale = number(scale);
            Some(a.iter().map(|&a| Near(mul(a, scale), 2)).collect())
        }
        "Cross" => {
            let b = &operands[1];
            bits(
                (0..3)
                    .map(|at| (at, (at + 1) % 3, (at + 2) % 3))
                    .map(|(_, x, y)| sub(mul(a[x], b[y]), mul(b[x], a[y])))
                    .collect(),
            )
        }
        "FaceForward" => {
            let keeps = less(dot(&operands[2], &operands[1]), 0);
            bits(a.iter().map(|&a| if keeps { a } else { exact::negate(kind, a) }).collect())
        }
        "Reflect" => {
            let normal = &operands[1];
            let scale = mul(number(2.0), dot(normal, a));
            bits(a.iter().zip(normal).map(|(&i, &n)| sub(i, mul(scale, n))).collect())
        }
        "Refract" => {
            let normal = &operands[1];
            let eta = number(to_f64(types[3].kind, operands[2][0]));
            let along = dot(normal, a);
            let k = sub(number(1.0), mul(mul(eta, eta), sub(number(1.0), mul(along, along))));
            if less(k, 0) {
                return bits(vec![0; a.len()]);
            }
            let scale = add(mul(eta, along), root(k));
            bits(a.iter().zip(normal).map(|(&i, &n)| sub(mul(eta, i), mul(scale, n))).collect())
        }
        _ if name.starts_with("Pack") || name.starts_with("Unpack") => Some(packed(name, a)),
        _ => None,
    }
}

/// The conversions between words and vectors (`GLSL.std.450`).
fn packed(name: &str, a: &[u64]) -> Vec<Expected> {
    let float = |bits: u64| to_f64(Kind::F32, bits);
    // Normalised numbers are rounded to even here; a NaN counts as 0.
    let normal = |bits: u64, low: f64, scale: f64| {
        (float(bits).clamp(low, 1.0) * scale).round_ties_even() as i64 as u64
    };
    let joined = |width: u32, parts: &mut dyn Iterator<Item = u64>| {
        let mask = (1u64 << width) - 1;
        vec![Bits(parts.enumerate().map(|(at, part)| (part & mask) << (at as u32 * width)).sum())]
    };
    let split = |width: u32, of: &dyn Fn(u64) -> u64| -> Vec<Expected> {
        let parts = if width == 32 { 2 } else { 32 / width };
        (0..parts).map(|at| Bits(of(a[0] >> (at * width) & ((1 << width) - 1)))).collect()
    };
    let quotient = |number: i64, by: i64| {
        exact::div(
            Kind::F32,
            exact::of_integer(Kind::F32, number.into()),
            exact::of_integer(Kind::F32, by.into()),
        )
    };
    match name {
        "PackSnorm4x8" => joined(8, &mut a.iter().map(|&a| normal(a, -1.0, 127.0))),
        "PackUnorm4x8" => joined(8, &mut a.iter().map(|&a| normal(a, 0.0, 255.0))),
        "PackSnorm2x16" => joined(16, &mut a.iter().map(|&a| normal(a, -1.0, 32_767.0))),
        "PackUnorm2x16" => joined(16, &mut a.iter().map(|&a| normal(a, 0.0, 65_535.0))),
        "PackHalf2x16" => {
            if a.iter().any(|&a| float(a).is_nan()) {
                return vec![Undefined];
            }
            joined(16, &mut a.iter().map(|&a| exact::of_f64(Kind::F16, float(a))))
        }
        "PackDouble2x32" => joined(32, &mut a.iter().copied()),
        "UnpackDouble2x32" => split(32, &|part| part),
        "UnpackHalf2x16" => split(16, &|part| exact::of_f64(Kind::F32, to_f64(Kind::F16, part))),
        "UnpackUnorm4x8" => split(8, &|part| quotient(part as i64, 255)),
        "UnpackUnorm2x16" => split(16, &|part| quotient(part as i64, 65_535)),
        "UnpackSnorm4x8" => split(8, &|part| quotient(i64::from(part as i8).max(-127), 127)),
        _ => split(16, &|part| quotient(i64::from(part as i16).max(-32_767), 32_767)),
    }
}

/// A component of an instruction whose first operand is no float.
fn integer(name: &str, part: usize, kinds: &[Kind], args: &[u64]) -> Expected {
    let result = kinds[0];
    let cut = |value: i128| Bits(value as u64 & result.mask());
    let low = |value: BigInt| -> Expected {
        let bits: BigInt = value & BigInt::from(result.mask());
        Bits(u64::try_from(bits).expect("few bits"))
    };
    let truth = |holds: bool| Bits(holds.into());
    let a = args[0];
    let b = args.get(1).copied().unwrap_or(0);
    let c = args.get(2).copied().unwrap_or(0);
    if kinds[1] == Kind::Bool {
        return match name {
            "LogicalEqual" => truth(a == b),
            "LogicalNotEqual" => truth(a != b),
            "LogicalOr" => truth(a + b > 0),
            "LogicalAnd" => truth(a * b > 0),
            "LogicalNot" => truth(a == 0),
            "Select" => Bits(if a == 1 { b } else { c }),
            "CopyObject" | "FreezeKHR" | "ExpectKHR" => Bits(a),
            _ => panic!("nobody judges {name} on bools"),
        };
    }
    if matches!(name, "CopyObject" | "FreezeKHR" | "ExpectKHR") {
        return Bits(a);
    }
    if result.is_float() {
        return Bits(match name {
            "ConvertSToF" => exact::of_integer(result, kinds[1].number(a, true)),
            "ConvertUToF" => exact::of_integer(result, kinds[1].number(a, false)),
            _ => panic!("nobody judges {name} of integers to floats"),
        });
    }
    let width = kinds[1].bits();
    // As numbers without and with a sign.
    let [ua, ub, uc] = [(0, a), (1, b), (2, c)]
        .map(|(at, bits)| kinds.get(at + 1).map_or(0, |kind| kind.number(bits, false)));
    let [sa, sb, sc] = [(0, a), (1, b), (2, c)]
        .map(|(at, bits)| kinds.get(at + 1).map_or(0, |kind| kind.number(bits, true)));
    let (least, greatest, top) = (-1i128 << (width - 1), (1i128 << (width - 1)) - 1, (1i128 << width) - 1);
    let highest = |value: i128| i128::from(127 - (value as u128).leading_zeros() as i32);
    match name {
        "SNegate" => cut(-sa),
        "IAdd" => cut(ua + ub),
        "ISub" => cut(ua - ub),
        "IMul" => low(BigInt::from(ua) * ub),
        "UDiv" | "UMod" | "SDiv" | "SRem" | "SMod" if ub == 0 => Undefined,
        "SDiv" | "SRem" | "SMod" if sa == least && sb == -1 => Undefined,
        "UDiv" => cut(ua / ub),
        "UMod" => cut(ua % ub),
        "SDiv" => cut(sa / sb),
        "SRem" => cut(sa % sb),
        "SMod" => cut((sa % sb + sb) % sb),
        "Not" => cut(-1 - sa),
        "BitwiseOr" => cut(ua | ub),
        "BitwiseXor" => cut(ua ^ ub),
        "BitwiseAnd" => cut(ua & ub),
        "IAddCarry" => cut(if part == 0 { ua + ub } else { (ua + ub) >> width }),
        "ISubBorrow" => cut(if part == 0 { ua - ub } else { i128::from(ua < ub) }),
        "UMulExtended" => low((BigInt::from(ua) * ub) >> (part as u32 * width)),
        "SMulExtended" => low((BigInt::from(sa) * sb) >> (part as u32 * width)),
        // A shift by the width or more is undefined; here everything is shifted out.
        "ShiftLeftLogical" => cut(if ub < i128::from(width) { ua << ub } else { 0 }),
        "ShiftRightLogical" => cut(if ub < i128::from(width) { ua >> ub } else { 0 }),
        "ShiftRightArithmetic" => cut(sa >> ub.min(i128::from(width) - 1)),
        "BitFieldInsert" => {
            let (offset, count) = (uc, kinds[4].number(args[3], false));
            if offset + count > i128::from(width) {
                return Undefined;
            }
            let mask = ((1i128 << count) - 1) << offset;
            cut(ua & !mask | (ub << offset) & mask)
        }
        "BitFieldSExtract" | "BitFieldUExtract" => {
            if ub + uc > i128::from(width) {
                return Undefined;
            }
            let field = ua >> ub & ((1 << uc) - 1);
            let negative = name == "BitFieldSExtract" && uc > 0 && field >> (uc - 1) == 1;
            cut(if negative { field - (1 << uc) } else { field })
        }
        "BitReverse" => {
            cut((0..width).filter(|&bit| ua >> bit & 1 == 1).map(|bit| 1i128 << (width - 1 - bit)).sum())
        }
        "BitCount" => cut((0..width).filter(|&bit| ua >> bit & 1 == 1).count() as i128),
        "IEqual" => truth(ua == ub),
        "INotEqual" => truth(ua != ub),
        "UGreaterThan" => truth(ua > ub),
        "UGreaterThanEqual" => truth(ua >= ub),
        "ULessThan" => truth(ua < ub),
        "ULessThanEqual" => truth(ua <= ub),
        "SGreaterThan" => truth(sa > sb),
        "SGreaterThanEqual" => truth(sa >= sb),
        "SLessThan" => truth(sa < sb),
        "SLessThanEqual" => truth(sa <= sb),
        "UConvert" => cut(ua),
        "SConvert" => cut(sa),
        "SAbs" => cut(sa.abs()),
        "SSign" => cut(sa.signum()),
        "UMin" => cut(ua.min(ub)),
        "SMin" => cut(sa.min(sb)),
        "UMax" => cut(ua.max(ub)),
        "SMax" => cut(sa.max(sb)),
        "UClamp" if ub > uc => Undefined,
        "SClamp" if sb > sc => Undefined,
        "UClamp" => cut(ua.clamp(ub, uc)),
        "SClamp" => cut(sa.clamp(sb, sc)),
        "FindILsb" => cut(if ua == 0 { -1 } else { ua.trailing_zeros().into() }),
        "FindUMsb" => cut(if ua == 0 { -1 } else { highest(ua) }),
        "FindSMsb" => match if sa < 0 { -1 - sa } else { sa } {
            0 => cut(-1),
            other => cut(highest(other)),
        },
        "UCountLeadingZerosINTEL" => {
            cut(if ua == 0 { width.into() } else { i128::from(width) - 1 - highest(ua) })
        }
        "UCountTrailingZerosINTEL" => cut(if ua == 0 { width.into() } else { ua.trailing_zeros().into() }),
        "AbsISubINTEL" => cut((sa - sb).abs()),
        "AbsUSubINTEL" => cut((ua - ub).abs()),
        "IAddSatINTEL" => cut((sa + sb).clamp(least, greatest)),
        "UAddSatINTEL" => cut((ua + ub).min(top)),
        "ISubSatINTEL" => cut((sa - sb).clamp(least, greatest)),
        "USubSatINTEL" => cut((ua - ub).max(0)),
        "IAverageINTEL" => cut((sa + sb).div_euclid(2)),
        "UAverageINTEL" => cut((ua + ub).div_euclid(2)),
        "IAverageRoundedINTEL" => cut((sa + sb + 1).div_euclid(2)),
        "UAverageRoundedINTEL" => cut((ua + ub + 1).div_euclid(2)),
        "IMul32x16INTEL" => cut(sa * Kind::I16.number(b, true)),
        "UMul32x16INTEL" => cut(ua * Kind::U16.number(b, false)),
        _ => panic!("nobody judges {name} on integers"),
    }
}

/// A component of an instruction whose first operand is a float.
fn float(name: &str, part: usize, kinds: &[Kind], args: &[u64]) -> Expected {
    let (result, kind) = (kinds[0], kinds[1]);
    let a = args[0];
    let b = args.get(1).copied().unwrap_or(0);
    let c = args.get(2).copied().unwrap_or(0);
    let value = |bits: u64| to_f64(kind, bits);
    let number = |value: f64| exact::of_f64(kind, value);
    let through = |function: fn(f64) -> f64| number(function(value(a)));
    let (add, sub, mul, div) = (
        |a, b| exact::add(kind, a, b),
        |a, b| exact::sub(kind, a, b),
        |a, b| exact::mul(kind, a, b),
        |a, b| exact::div(kind, a, b),
    );
    match name {
        "IsNan" | "IsInf" | "Ordered" | "Unordered" | "LessOrGreater" => {
            return relation(name, value(a), value(b));
        }
        _ if name.starts_with("FOrd") || name.starts_with("FUnord") => {
            return relation(name, value(a), value(b));
        }
        "ConvertFToU" | "ConvertFToS" => {
            // What does not fit is undefined; here it saturates, and a NaN gives 0.
            let signed = name == "ConvertFToS";
            let bits = result.bits() - u32::from(signed);
            let greatest = (BigInt::from(1) << bits) - 1;
            let least = if signed { -(BigInt::from(1) << bits) } else { 0.into() };
            let found = match (exact::truncated(kind, a), value(a)) {
                (Some(whole), _) => whole.clamp(least, greatest),
                (None, nan) if nan.is_nan() => 0.into(),
                (None, value) => {
                    if value > 0.0 {
                        greatest
                    } else {
                        least
                    }
                }
            };
            return Bits(i128::try_from(found).expect("few bits") as u64 & result.mask());
        }
        "FConvert" => return Bits(exact::round(result, &exact::read(kind, a))),
        "Ldexp" => return Bits(exact::scale(kind, a, kinds[2].own_number(b))),
        _ => {}
    }
    let (x, y, z) = (value(a), value(b), value(c));
    let nan = x.is_nan() || y.is_nan() || z.is_nan();
    let zeros = x == 0.0 && y == 0.0 && a != b;
    // The lesser of two, as `FMin` defines it.
    let least = |a: u64, b: u64| if value(b) < value(a) { b } else { a };
    let most = |a: u64, b: u64| if value(a) < value(b) { b } else { a };
    Bits(match name {
        "ExpectKHR" => a,
        "FNegate" => exact::negate(kind, a),
        "FAdd" => add(a, b),
        "FSub" => sub(a, b),
        "FMul" => mul(a, b),
        "FDiv" => div(a, b),
        "FmaKHR" => exact::fma(kind, a, b, c),
        // Derived from x - y * trunc(x / y) and x - y * floor(x / y) (Vulkan, precision of
        // operations).
        "FRem" => sub(a, mul(b, number(value(div(a, b)).trunc()))),
        "FMod" => sub(a, mul(b, number(value(div(a, b)).floor()))),
        "VectorTimesScalar" => mul(a, b),
        "QuantizeToF16" => {
            let half = exact::of_f64(Kind::F16, x);
            let kept = to_f64(Kind::F16, half);
            // A denormal of f16 becomes a zero.
            number(if kept.abs() < 2f64.powi(-14) { 0f64.copysign(x) } else { kept })
        }
        "Round" => through(f64::round),
        "RoundEven" => through(f64::round_ties_even),
        "Trunc" => through(f64::trunc),
        "FAbs" => through(f64::abs),
        "FSign" => number(if x > 0.0 {
            1.0
        } else if x < 0.0 {
            -1.0
        } else {
            x
        }),
        "Floor" => through(f64::floor),
        "Ceil" => through(f64::ceil),
        "Fract" => sub(a, through(f64::floor)),
        "ModfStruct" if x.is_infinite() && part == 0 => number(0f64.copysign(x)),
        "ModfStruct" if part == 0 => number((x - x.trunc()).copysign(x)),
        "ModfStruct" => through(f64::trunc),
        "Radians" => mul(a, number(std::f64::consts::PI / 180.0)),
        "Degrees" => mul(a, number(180.0 / std::f64::consts::PI)),
        "Sqrt" => through(f64::sqrt),
        "FMin" | "FMax" | "FClamp" if nan => return Undefined,
        "FMin" | "FMax" | "NMin" | "NMax" if zeros => return Undefined,
        "FMin" => least(a, b),
        "FMax" => most(a, b),
        "NMin" => {
            if x.is_nan() {
                b
            } else {
                least(a, b)
            }
        }
        "NMax" => {
            if x.is_nan() {
                b
            } else {
                most(a, b)
            }
        }
        "FClamp" if y > z => return Undefined,
        "FClamp" => least(most(a, b), c),
        // min(max(x, low), high), where a NaN gives way to the other operand.
        "NClamp" if y.is_nan() || z.is_nan() || y > z => return Undefined,
        "NClamp" => {
            if x.is_nan() {
                b
            } else {
                least(most(a, b), c)
            }
        }
        "FMix" => add(mul(a, sub(number(1.0), c)), mul(b, c)),
        "Step" => number(if y < x { 0.0 } else { 1.0 }),
        "SmoothStep" if nan || x >= y => return Undefined,
        "SmoothStep" => {
            let t = div(sub(c, a), sub(b, a));
            let t = if value(t) < 0.0 { 0 } else { t };
            let t = if value(t) > 1.0 { number(1.0) } else { t };
            mul(mul(t, t), sub(number(3.0), mul(number(2.0), t)))
        }
        "Fma" => add(mul(a, b), c),
        _ => return elementary(name, kind, x, y),
    })
}

fn relation(name: &str, a: f64, b: f64) -> Expected {
    let nan = a.is_nan() || b.is_nan();
    let ordered = |name: &str| match name {
        "Equal" => a == b,
        "NotEqual" => !nan && a != b,
        "LessThan" => a < b,
        "GreaterThan" => a > b,
        "LessThanEqual" => a <= b,
        "GreaterThanEqual" => a >= b,
        _ => panic!("nobody judges the relation {name}"),
    };
    Bits(u64::from(match name {
        "IsNan" => a.is_nan(),
        "IsInf" => a.is_infinite(),
        "Ordered" => !nan,
        "Unordered" => nan,
        "LessOrGreater" => ordered("NotEqual"),
        _ => match name.strip_prefix("FUnord") {
            Some(name) => nan || ordered(name),
            None => ordered(name.strip_prefix("FOrd").expect("a relation")),
        },
    }))
}

/// Elementary functions, by those of f64 in the standard library, where they are defined.
fn elementary(name: &str, kind: Kind, x: f64, y: f64) -> Expected {
    let (defined, found) = match name {
        "Sin" => (x.is_finite(), x.sin()),
        "Cos" => (x.is_finite(), x.cos()),
        "Tan" => (x.is_finite(), x.tan()),
        "Asin" => (x.abs() <= 1.0, x.asin()),
        "Acos" => (x.abs() <= 1.0, x.acos()),
        "Atan" => (true, x.atan()),
        "Sinh" => (true, x.sinh()),
        "Cosh" => (true, x.cosh()),
        "Tanh" => (true, x.tanh()),
        // The standard library's own loses small arguments.
        "Asinh" => (x.abs() > 1e-2, x.asinh()),
        "Acosh" => (x >= 1.0, x.acosh()),
        "Atanh" => (x.abs() < 1.0 && x.abs() > 1e-2, x.atanh()),
        "Exp" => (true, x.exp()),
        "Log" => (x > 0.0, x.ln()),
        "Exp2" => (true, x.exp2()),
        "Log2" => (x > 0.0, x.log2()),
        "InverseSqrt" => (x > 0.0, 1.0 / x.sqrt()),
        "Atan2" => ((x, y) != (0.0, 0.0) && !(x.is_infinite() && y.is_infinite()), x.atan2(y)),
        "Pow" => (x > 0.0, x.powf(y)),
        _ => panic!("nobody judges {name} on floats"),
    };
    if defined { Near(exact::of_f64(kind, found), 1) } else { Undefined }
}
