//! Instructions whose types follow no line of the table, but a formula.

use crate::execution::instructions::operand_types::Case;
use crate::execution::instructions::operand_types::types::{KINDS, Kind, Ty};

fn case(name: &'static str, types: Vec<Ty>, tail: Vec<usize>) -> Case {
    Case { name, glsl: false, pair: false, types, head: "", tail }
}

/// Every combination of types of these instructions, with the literals behind them.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for result in Ty::all() {
        for operand in Ty::all() {
            let [to, from] = [result, operand].map(|ty| ty.count as u32 * ty.kind.bits());
            if from == to && from > 0 {
                cases.push(case("Bitcast", vec![result, operand], Vec::new()));
            }
        }
    }
    for kind in KINDS {
        let ty = |count| Ty { kind, count };
        for parts in
            [&[1, 1][..], &[1, 1, 1], &[1, 2], &[2, 1], &[1, 1, 1, 1], &[1, 1, 2], &[1, 2, 1], &[2, 1, 1]]
        {
            let types = [parts.iter().sum()].iter().chain(parts).map(|&count| ty(count)).collect();
            cases.push(case("CompositeConstruct", types, Vec::new()));
        }
        for parts in [[2, 2], [1, 3], [3, 1]] {
            cases.push(case("CompositeConstruct", vec![ty(4), ty(parts[0]), ty(parts[1])], Vec::new()));
        }
        for count in 2..=4 {
            cases.push(case("CompositeInsert", vec![ty(count), ty(1), ty(count)], vec![count - 1]));
            for other in 2..=4 {
                // The last components of both, backwards.
                let tail: Vec<usize> = (0..count).map(|at| count + other - 1 - at).collect();
                cases.push(case("VectorShuffle", vec![ty(count), ty(count), ty(other)], tail));
            }
        }
    }
    for name in ["SDot", "UDot", "SUDot", "SDotAccSat", "UDotAccSat", "SUDotAccSat"] {
        cases.extend(dot_products(name));
    }
    cases
}

/// What a dot product of integers exists for.
fn dot_products(name: &'static str) -> Vec<Case> {
    let mut cases = Vec::new();
    let integers = || KINDS.into_iter().filter(|kind| kind.is_integer());
    let unsigned = |kind: &Kind| !kind.is_signed();
    let first_unsigned = name.starts_with("UDot");
    let second_unsigned = !name.starts_with("SDot");
    let accumulator = name.ends_with("AccSat");
    for result in integers().filter(|kind| !first_unsigned || unsigned(kind)) {
        let mut push = |a: Ty, b: Ty, tail: Vec<usize>| {
            let result = Ty { kind: result, count: 1 };
            let types = [result, a, b].into_iter().chain(accumulator.then_some(result)).collect();
            cases.push(case(name, types, tail));
        };
        for a in integers().filter(|kind| kind.bits() <= result.bits() && (!first_unsigned || unsigned(kind)))
        {
            let same = |kind: &Kind| kind.bits() == a.bits() && (!second_unsigned || unsigned(kind));
            for b in integers().filter(same) {
                for count in 2..=4 {
                    push(Ty { kind: a, count }, Ty { kind: b, count }, Vec::new());
                }
            }
        }
        // Packed: the format is a literal, 0 for four components of eight bits.
        for a in [Kind::I32, Kind::U32] {
            for b in [Kind::I32, Kind::U32] {
                push(Ty { kind: a, count: 1 }, Ty { kind: b, count: 1 }, vec![0]);
            }
        }
    }
    cases
}

/// Combinations one type away from these, that are none of them.
pub fn illegal() -> Vec<Case> {
    let legal = cases();
    let mut found: Vec<Case> = Vec::new();
    for name in ["Bitcast", "SDot", "UDot", "SUDot", "SDotAccSat", "UDotAccSat", "SUDotAccSat"] {
        let known: Vec<&Case> = legal.iter().filter(|case| case.name == name).collect();
        for &start in [known[0], known[known.len() / 2], known[known.len() - 1]].iter() {
            for at in 0..start.types.len() {
                for other in Ty::all() {
                    let mut types = start.types.clone();
                    types[at] = other;
                    if !known.iter().any(|case| case.types == types && case.tail == start.tail) {
                        found.push(Case { types, ..start.clone() });
                    }
                }
            }
        }
    }
    // A vector of parts of another type, and of too many or too few.
    let ty = |kind, count| Ty { kind, count };
    for kind in KINDS {
        let other = if kind.bits() == 32 && kind.is_float() { Kind::I32 } else { Kind::F32 };
        for types in [
            vec![ty(kind, 2), ty(kind, 1), ty(other, 1)],
            vec![ty(kind, 3), ty(other, 2), ty(kind, 1)],
            vec![ty(kind, 3), ty(kind, 1), ty(kind, 1)],
            vec![ty(kind, 2), ty(kind, 2), ty(kind, 1)],
            vec![ty(kind, 2), ty(kind, 2)],
        ] {
            found.push(case("CompositeConstruct", types, Vec::new()));
        }
        for types in [
            vec![ty(kind, 2), ty(kind, 2), ty(other, 2)],
            vec![ty(kind, 2), ty(other, 2), ty(kind, 2)],
            vec![ty(other, 2), ty(kind, 2), ty(kind, 2)],
            vec![ty(kind, 3), ty(kind, 2), ty(kind, 2)],
            vec![ty(kind, 2), ty(kind, 1), ty(kind, 2)],
        ] {
            found.push(case("VectorShuffle", types, vec![0, 1]));
        }
    }
    found
}
