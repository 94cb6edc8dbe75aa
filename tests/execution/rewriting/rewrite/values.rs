//! A value made again: through memory, from its parts, by two steps that cancel.

use anyhit_engine::module::Opcode as Op;
use rspirv::spirv::{Capability, StorageClass};

use super::build::{Code, Rng};
use super::words::Module;

/// Ways to make a value again. Each appends instructions and gives the id that stands for the
/// value.
pub type Remake = fn(&mut Code, &mut Module, u32, u32, &mut Rng) -> Option<u32>;

/// Stored in a variable, whole or member by member, and loaded.
pub fn through_variable(
    code: &mut Code,
    module: &mut Module,
    value: u32,
    ty: u32,
    rng: &mut Rng,
) -> Option<u32> {
    if !code.index.is_storable(ty) || (code.index.holds_address(ty) && !code.index.is_address(ty)) {
        return None;
    }
    let (variable, class) = code.any_variable(module, ty, rng);
    let in_parts = rng.one_in(3) && store_parts(code, module, variable, class, value, ty).is_some();
    if !in_parts {
        code.run(Op::Store, &[variable, value]);
    }
    let variable = if rng.one_in(4) {
        let (other, _) = code.any_variable(module, ty, rng);
        code.run(Op::CopyMemory, &[other, variable]);
        other
    } else {
        variable
    };
    if rng.one_in(4) {
        // A second load that only the debugger would see.
        code.op(module, Op::Load, ty, &[variable]);
    }
    Some(code.op(module, Op::Load, ty, &[variable]))
}

/// Stored as a member of a struct or as an element of an array at a computed index, and loaded.
pub fn through_aggregate(
    code: &mut Code,
    module: &mut Module,
    value: u32,
    ty: u32,
    rng: &mut Rng,
) -> Option<u32> {
    if !code.index.is_storable(ty) || code.index.holds_address(ty) {
        return None;
    }
    let at = rng.below(3) as u32;
    let uint = module.uint();
    let (aggregate, index) = if rng.one_in(2) {
        let three = module.number(3);
        (module.new_global(Op::TypeArray, 0, &[ty, three]), module.number(at))
    } else {
        let mut members = [uint; 3];
        members[at as usize] = ty;
        (module.new_global(Op::TypeStruct, 0, &members), module.number(at))
    };
    let is_array = module.globals.iter().any(|inst| inst.id == aggregate && inst.op == Op::TypeArray);
    let (variable, class) = code.any_variable(module, aggregate, rng);
    let pointer = module.pointer(class, ty);
    let mut index_again = index;
    if is_array && rng.one_in(2) {
        // Known only when the shader runs.
        let counter = code.variable(module, uint, None);
        code.run(Op::Store, &[counter, index]);
        index_again = code.op(module, Op::Load, uint, &[counter]);
    }
    let element = code.op(module, Op::AccessChain, pointer, &[variable, index]);
    code.run(Op::Store, &[element, value]);
    if rng.one_in(2) {
        let element = code.op(module, Op::AccessChain, pointer, &[variable, index_again]);
        return Some(code.op(module, Op::Load, ty, &[element]));
    }
    let all = code.op(module, Op::Load, aggregate, &[variable]);
    Some(code.op(module, Op::CompositeExtract, ty, &[all, at]))
}

/// A composite taken apart and put together.
pub fn from_parts(code: &mut Code, module: &mut Module, value: u32, ty: u32, rng: &mut Rng) -> Option<u32> {
    let parts = code.index.parts(ty).filter(|parts| !parts.is_empty())?;
    let (_, count) = code.index.vector(ty);
    match rng.below(3) {
        0 if count > 1 => {
            let picked: Vec<u32> = (0..count).map(|at| at + count * rng.below(2) as u32).collect();
            Some(code.op(module, Op::VectorShuffle, ty, &[&[value, value], &picked[..]].concat()))
        }
        1 => {
            let mut built = code.op(module, Op::Undef, ty, &[]);
            for (at, part) in parts.iter().enumerate() {
                let one = code.op(module, Op::CompositeExtract, *part, &[value, at as u32]);
                built = code.op(module, Op::CompositeInsert, ty, &[one, built, at as u32]);
            }
            Some(built)
        }
        _ => {
            let extract = |code: &mut Code, module: &mut Module, at: usize, part: u32| {
                code.op(module, Op::CompositeExtract, part, &[value, at as u32])
            };
            let all: Vec<u32> =
                parts.iter().enumerate().map(|(at, part)| extract(code, module, at, *part)).collect();
            Some(code.op(module, Op::CompositeConstruct, ty, &all))
        }
    }
}

/// One of two, which are the same.
pub fn selected(code: &mut Code, module: &mut Module, value: u32, ty: u32, rng: &mut Rng) -> Option<u32> {
    let (component, count) = code.index.vector(ty);
    if !matches!(code.index.kind(component), Op::TypeBool | Op::TypeInt | Op::TypeFloat) {
        return None;
    }
    let truth = code.truth(module, rng);
    let bool = module.bool();
    let condition = if count > 1 {
        let bools = module.vector(bool, count);
        code.op(module, Op::CompositeConstruct, bools, &vec![truth; count as usize])
    } else {
        truth
    };
    let other = if rng.one_in(2) { value } else { module.global(Op::ConstantNull, ty, &[]) };
    Some(code.op(module, Op::Select, ty, &[condition, value, other]))
}

/// Two steps that cancel: to the other sign and back, a number added and taken away, bits turned
/// twice.
pub fn there_and_back(
    code: &mut Code,
    module: &mut Module,
    value: u32,
    ty: u32,
    rng: &mut Rng,
) -> Option<u32> {
    let (component, count) = code.index.vector(ty);
    let kind = code.index.ty(component)?.clone();
    if !code.index.is_storable(component) {
        return None;
    }
    let same = |op: Op| (op, ty);
    let (there, back) = match kind.op {
        Op::TypeFloat if kind.rest[0] == 32 => {
            let uint = module.uint();
            ((Op::Bitcast, module.vector(uint, count)), same(Op::Bitcast))
        }
        Op::TypeInt => {
            let (width, signed) = (kind.rest[0], kind.rest[1]);
            match rng.below(6) {
                0 => {
                    let other = module.global(Op::TypeInt, 0, &[width, 1 - signed]);
                    ((Op::Bitcast, module.vector(other, count)), same(Op::Bitcast))
                }
                1 => (same(Op::Not), same(Op::Not)),
                2 => (same(Op::SNegate), same(Op::SNegate)),
                3 if width == 32 && code.index.has(Capability::Int64) => {
                    let wide = module.global(Op::TypeInt, 0, &[64, signed]);
                    let wide = module.vector(wide, count);
                    if signed == 1 {
                        ((Op::SConvert, wide), same(Op::SConvert))
                    } else {
                        ((Op::UConvert, wide), same(Op::UConvert))
                    }
                }
                way => {
                    let (there, back) = match way {
                        4 => (Op::BitwiseXor, Op::BitwiseXor),
                        _ => (Op::IAdd, Op::ISub),
                    };
                    let words = if width == 64 {
                        vec![rng.draw() as u32 >> 8, 0]
                    } else {
                        vec![rng.draw() as u32 & 0x7F]
                    };
                    let number = module.global(Op::Constant, component, &words);
                    let number = if count == 1 {
                        number
                    } else {
                        module.global(Op::ConstantComposite, ty, &vec![number; count as usize])
                    };
                    let first = code.op(module, there, ty, &[value, number]);
                    return Some(code.op(module, back, ty, &[first, number]));
                }
            }
        }
        _ => return None,
    };
    let first = code.op(module, there.0, there.1, &[value]);
    Some(code.op(module, back.0, back.1, &[first]))
}

/// A condition doubled, or denied twice.
pub fn doubled_condition(
    code: &mut Code,
    module: &mut Module,
    value: u32,
    ty: u32,
    rng: &mut Rng,
) -> Option<u32> {
    let (component, count) = code.index.vector(ty);
    if code.index.kind(component) != Op::TypeBool {
        return None;
    }
    Some(match rng.below(4) {
        0 => code.op(module, Op::LogicalAnd, ty, &[value, value]),
        1 => code.op(module, Op::LogicalOr, ty, &[value, value]),
        2 => {
            let not = code.op(module, Op::LogicalNot, ty, &[value]);
            code.op(module, Op::LogicalNot, ty, &[not])
        }
        _ => {
            // As a number, and asked whether it is not 0.
            let uint = module.uint();
            let numbers = module.vector(uint, count);
            let (zero, one) =
                (module.global(Op::ConstantNull, numbers, &[]), module.number(1 + rng.below(9) as u32));
            let one = if count == 1 {
                one
            } else {
                module.global(Op::ConstantComposite, numbers, &vec![one; count as usize])
            };
            let number = code.op(module, Op::Select, numbers, &[value, one, zero]);
            code.op(module, Op::INotEqual, ty, &[number, zero])
        }
    })
}

/// `OpCopyObject`
pub fn copied(code: &mut Code, module: &mut Module, value: u32, ty: u32, _: &mut Rng) -> Option<u32> {
    code.index.is_storable(ty).then(|| code.op(module, Op::CopyObject, ty, &[value]))
}

/// Stores a composite into a variable part by part.
pub fn store_parts(
    code: &mut Code,
    module: &mut Module,
    pointer: u32,
    class: StorageClass,
    value: u32,
    ty: u32,
) -> Option<()> {
    let parts = code.index.parts(ty).filter(|parts| !parts.is_empty())?;
    for (at, part) in parts.into_iter().enumerate() {
        let (place, index) = (module.pointer(class, part), module.number(at as u32));
        let one = code.op(module, Op::CompositeExtract, part, &[value, at as u32]);
        let element = code.op(module, Op::AccessChain, place, &[pointer, index]);
        code.run(Op::Store, &[element, one]);
    }
    Some(())
}

/// Loads a composite from a variable part by part.
pub fn load_parts(
    code: &mut Code,
    module: &mut Module,
    pointer: u32,
    class: StorageClass,
    ty: u32,
) -> Option<Vec<u32>> {
    let parts = code.index.parts(ty).filter(|parts| !parts.is_empty())?;
    let mut all = Vec::new();
    for (at, part) in parts.into_iter().enumerate() {
        let (place, index) = (module.pointer(class, part), module.number(at as u32));
        let element = code.op(module, Op::AccessChain, place, &[pointer, index]);
        all.push(code.op(module, Op::Load, part, &[element]));
    }
    Some(all)
}
