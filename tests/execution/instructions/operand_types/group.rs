//! What subgroup instructions give: a subgroup is 32 consecutive invocations, all of which take
//! part.

use crate::execution::instructions::operand_types::Case;
use crate::execution::instructions::operand_types::exact::{self, to_f64};
use crate::execution::instructions::operand_types::judge::Expected::{self, Bits, Undefined};
use crate::execution::instructions::operand_types::types::Kind;
use crate::execution::instructions::run::INVOCATIONS;

/// Invocations of a subgroup.
const SIZE: usize = 32;

/// The components of the result in a lane; `operands` tells those of any lane.
pub fn judge(case: &Case, lane: usize, operands: &dyn Fn(usize) -> Vec<Vec<u64>>) -> Vec<Expected> {
    let first = lane / SIZE * SIZE;
    let members = || first..(first + SIZE).min(INVOCATIONS);
    let value = |lane: usize| operands(lane).swap_remove(0);
    let kind = case.types[1].kind;
    let nan = |bits: &u64| kind.is_float() && to_f64(kind, *bits).is_nan();
    let zero = |bits: &u64| kind.is_float() && to_f64(kind, *bits) == 0.0;
    let all = |bits: Vec<u64>| bits.into_iter().map(Bits).collect();
    match case.name {
        "GroupNonUniformAll" => return all(vec![u64::from(members().all(|lane| value(lane)[0] == 1))]),
        "GroupNonUniformAny" => return all(vec![u64::from(members().any(|lane| value(lane)[0] == 1))]),
        // Whether two zeros or two NaNs are the same is left open.
        "GroupNonUniformAllEqual" => {
            if members().flat_map(value).any(|bits| nan(&bits) || zero(&bits)) {
                return vec![Undefined];
            }
            return all(vec![u64::from(members().all(|lane| value(lane) == value(first)))]);
        }
        "GroupNonUniformBroadcastFirst" => return all(value(first)),
        "GroupNonUniformShuffle" => return all(value(first + operands(lane)[1][0] as usize)),
        "GroupNonUniformShuffleXor" => {
            return all(value(first + ((lane - first) ^ operands(lane)[1][0] as usize)));
        }
        _ => {}
    }
    let name = case.name.strip_prefix("GroupNonUniform").expect("a subgroup instruction");
    // The invocations that count, from the lowest to the highest.
    let counted: Vec<Vec<u64>> = members()
        .filter(|&other| match case.head {
            "%u3 Reduce" => true,
            "%u3 InclusiveScan" => other <= lane,
            _ => other < lane,
        })
        .map(value)
        .collect();
    let component = |part: usize| {
        let values: Vec<u64> = counted.iter().map(|value| value[part]).collect();
        // Which zero is the lesser one is open, and so is what a NaN counts as.
        if matches!(name, "FMin" | "FMax") && values.iter().any(|bits| nan(bits) || zero(bits)) {
            return Undefined;
        }
        let start = values.first().copied().unwrap_or_else(|| identity(kind, name));
        Bits(values.iter().skip(1).fold(start, |total, &value| combine(kind, name, total, value)))
    };
    (0..case.types[0].count).map(component).collect()
}

/// What changes nothing (SPIR-V 3.3.24, the identity of each operation).
fn identity(kind: Kind, name: &str) -> u64 {
    match name {
        "IMul" | "LogicalAnd" => 1,
        "SMin" => kind.mask() >> 1,
        "SMax" => 1 << (kind.bits() - 1),
        "UMin" | "BitwiseAnd" => kind.mask(),
        "FMul" => exact::of_f64(kind, 1.0),
        "FMin" => exact::of_f64(kind, f64::INFINITY),
        "FMax" => exact::of_f64(kind, f64::NEG_INFINITY),
        _ => 0,
    }
}

fn combine(kind: Kind, name: &str, a: u64, b: u64) -> u64 {
    let chosen = |takes: bool| if takes { b } else { a };
    let [sa, sb] = [a, b].map(|bits| if kind == Kind::Bool { 0 } else { kind.number(bits, true) });
    match name {
        "IAdd" => a.wrapping_add(b) & kind.mask(),
        "IMul" => a.wrapping_mul(b) & kind.mask(),
        "SMin" => chosen(sb < sa),
        "SMax" => chosen(sb > sa),
        "UMin" => a.min(b),
        "UMax" => a.max(b),
        "FAdd" => exact::add(kind, a, b),
        "FMul" => exact::mul(kind, a, b),
        "FMin" => chosen(to_f64(kind, b) < to_f64(kind, a)),
        "FMax" => chosen(to_f64(kind, b) > to_f64(kind, a)),
        "BitwiseAnd" | "LogicalAnd" => a & b,
        "BitwiseOr" | "LogicalOr" => a | b,
        "BitwiseXor" | "LogicalXor" => a ^ b,
        _ => panic!("nobody judges {name}"),
    }
}
