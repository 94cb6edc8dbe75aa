//! Loads and stores: made twice, part by part, as copies; variables for phis and for nobody.

use anyhit_engine::module::Opcode as Op;
use rspirv::spirv::StorageClass;

use super::build::{Code, Index, Rng};
use super::places::{choose, in_order, replace};
use super::values::{load_parts, store_parts};
use super::words::{Inst, Module};

/// Where only this invocation writes while it does not stop.
const OWN: [StorageClass; 7] = [
    StorageClass::Function,
    StorageClass::Private,
    StorageClass::RayPayloadKHR,
    StorageClass::IncomingRayPayloadKHR,
    StorageClass::CallableDataKHR,
    StorageClass::IncomingCallableDataKHR,
    StorageClass::HitAttributeKHR,
];

/// Where nobody writes.
const CONSTANT: [StorageClass; 4] = [
    StorageClass::Input,
    StorageClass::PushConstant,
    StorageClass::ShaderRecordBufferKHR,
    StorageClass::Uniform,
];

/// The storage class of a pointer, where it is one of these.
fn class_of(index: &Index, pointer: u32, classes: &[StorageClass]) -> Option<StorageClass> {
    let (class, _) = index.pointer(pointer)?;
    classes.iter().copied().find(|one| *one as u32 == class)
}

fn own_class(index: &Index, pointer: u32) -> Option<StorageClass> {
    class_of(index, pointer, &OWN)
}

/// A load that has no memory operands.
fn is_plain_load(inst: &Inst) -> bool {
    inst.op == Op::Load && inst.rest.len() == 1
}

/// A store that has no memory operands.
fn is_plain_store(inst: &Inst) -> bool {
    inst.op == Op::Store && inst.rest.len() == 2
}

/// A variable for a phi: stored to where the phi's values come from, loaded behind the phis.
pub fn phi_as_variable(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    let wanted = |inst: &Inst| {
        inst.op == Op::Phi
            && index.is_storable(inst.ty)
            && !index.holds_address(inst.ty)
            && !index.is_decorated(inst.id)
    };
    let (function, block, at) = *choose(module, rng, wanted).first()?;
    let phi = module.functions[function].blocks[block].body.remove(at);
    let mut code = Code::new(module, &phi.place);
    let (variable, _) = code.any_variable(module, phi.ty, rng);
    let start = module.functions[function].blocks[block].start();
    let load = Inst::new(Op::Load, phi.ty, phi.id, &[variable], &phi.place);
    module.functions[function].blocks[block].body.insert(start, load);
    for pair in phi.rest.chunks(2) {
        let blocks = &mut module.functions[function].blocks;
        let from = blocks.iter_mut().find(|block| block.id() == pair[1])?;
        let tail = from.tail();
        let place = from.body[tail].place.clone();
        from.body.insert(tail, Inst::new(Op::Store, 0, 0, &[variable, pair[0]], &place));
    }
    code.insert(module, function, block, start);
    Some(())
}

/// A load made again right behind itself, for some of its uses.
pub fn repeated_load(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    // A uniform buffer of old modules may be written.
    let read = [&OWN[..], &CONSTANT[..3]].concat();
    let wanted = |inst: &Inst| {
        is_plain_load(inst)
            && class_of(&index, inst.rest[0], &read).is_some()
            && index.is_data(inst.ty)
            && !index.is_decorated(inst.id)
    };
    let (function, block, at) = *choose(module, rng, wanted).first()?;
    let inst = module.functions[function].blocks[block].body[at].clone();
    let mut code = Code::new(module, &inst.place);
    let again = code.op(module, Op::Load, inst.ty, &inst.rest);
    let key = rng.draw();
    replace(module, function, inst.id, again, |user| Rng(key ^ super::places::name(user)).one_in(2));
    code.insert(module, function, block, at + 1);
    Some(())
}

/// A load or store of a composite, part by part.
pub fn partwise(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    let read = [&OWN[..], &CONSTANT, &[StorageClass::StorageBuffer]].concat();
    let class = |inst: &Inst| match inst.op {
        Op::Load if is_plain_load(inst) => Some((class_of(&index, inst.rest[0], &read)?, inst.ty)),
        Op::Store if is_plain_store(inst) => {
            Some((own_class(&index, inst.rest[0])?, index.types[&inst.rest[1]]))
        }
        _ => None,
    };
    let wanted = |inst: &Inst| {
        class(inst).is_some_and(|(class, ty)| {
            let own = matches!(class, StorageClass::Function | StorageClass::Private);
            // What is laid out is so in memory that others see, too.
            (if own { index.is_storable(ty) } else { index.is_data(ty) })
                && !index.is_decorated(inst.rest[0])
                && index.parts(ty).is_some_and(|parts| !parts.is_empty())
        })
    };
    let (function, block, at) = *choose(module, rng, wanted).first()?;
    let inst = module.functions[function].blocks[block].body[at].clone();
    let mut code = Code::new(module, &inst.place);
    let (class, ty) = class(&inst)?;
    if inst.op == Op::Store {
        store_parts(&mut code, module, inst.rest[0], class, inst.rest[1], ty)?;
        module.functions[function].blocks[block].body.remove(at);
    } else {
        let parts = load_parts(&mut code, module, inst.rest[0], class, ty)?;
        module.functions[function].blocks[block].body[at] =
            Inst::new(Op::CompositeConstruct, ty, inst.id, &parts, &inst.place);
    }
    code.insert(module, function, block, at);
    Some(())
}

/// A store made twice; into own memory something else may be stored first.
pub fn repeated_store(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    let (function, block, at) = *choose(module, rng, is_plain_store).first()?;
    let mut first = module.functions[function].blocks[block].body[at].clone();
    if own_class(&index, first.rest[0]).is_some() && rng.one_in(2) {
        let ty = index.types[&first.rest[1]];
        if !index.is_storable(ty) || index.holds_address(ty) {
            return None;
        }
        first.rest[1] = module.global(Op::ConstantNull, ty, &[]);
    }
    module.functions[function].blocks[block].body.insert(at, first);
    Some(())
}

/// A variable that gets a value and is read by nobody, or only for what nobody reads.
pub fn dead_variable(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    let wanted = |inst: &Inst| {
        inst.ty != 0 && inst.op != Op::Phi && index.is_storable(inst.ty) && !index.holds_address(inst.ty)
    };
    let (function, block, at) = *choose(module, rng, wanted).first()?;
    let inst = module.functions[function].blocks[block].body[at].clone();
    let mut code = Code::new(module, &inst.place);
    let (variable, _) = code.any_variable(module, inst.ty, rng);
    code.run(Op::Store, &[variable, inst.id]);
    if rng.one_in(2) {
        let loaded = code.op(module, Op::Load, inst.ty, &[variable]);
        let (other, _) = code.any_variable(module, inst.ty, rng);
        code.run(Op::Store, &[other, loaded]);
        code.run(Op::Store, &[variable, loaded]);
    }
    code.insert(module, function, block, at + 1);
    Some(())
}

/// A value loaded and stored at once as `OpCopyMemory`, or a copy as load and store; where there is
/// neither, a variable takes the detour through a copy before it is loaded.
pub fn copied_memory(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    let copies = choose(module, rng, |inst| inst.op == Op::CopyMemory && inst.rest.len() == 2);
    if let Some(&(function, block, at)) = copies.first().filter(|_| rng.one_in(2)) {
        let inst = module.functions[function].blocks[block].body[at].clone();
        let (_, ty) = index.pointer(inst.rest[1])?;
        if index.pointer(inst.rest[0])?.1 == ty {
            let mut code = Code::new(module, &inst.place);
            let loaded = code.op(module, Op::Load, ty, &inst.rest[1..]);
            code.run(Op::Store, &[inst.rest[0], loaded]);
            module.functions[function].blocks[block].body.remove(at);
            code.insert(module, function, block, at);
            return Some(());
        }
    }
    let mut pairs = Vec::new();
    let mut loads = Vec::new();
    for ((function, block, at), inst) in super::places::sites(module) {
        let next = module.functions[function].blocks[block].body.get(at + 1);
        if is_plain_load(inst) && own_class(&index, inst.rest[0]).is_some() && index.is_storable(inst.ty) {
            if next.is_some_and(|next| is_plain_store(next) && next.rest[1] == inst.id) {
                pairs.push((u64::from(inst.id), (function, block, at)));
            }
            if !index.holds_address(inst.ty) {
                loads.push((u64::from(inst.id), (function, block, at)));
            }
        }
    }
    if let Some(&(function, block, at)) = in_order(rng, pairs).first().filter(|_| rng.one_in(2)) {
        let body = &mut module.functions[function].blocks[block].body;
        let (target, source) = (body[at + 1].rest[0], body[at].rest[0]);
        let place = body[at + 1].place.clone();
        body[at + 1] = Inst::new(Op::CopyMemory, 0, 0, &[target, source], &place);
        return Some(());
    }
    let (function, block, at) = *in_order(rng, loads).first()?;
    let inst = module.functions[function].blocks[block].body[at].clone();
    let mut code = Code::new(module, &inst.place);
    let (variable, _) = code.any_variable(module, inst.ty, rng);
    code.run(Op::CopyMemory, &[variable, inst.rest[0]]);
    module.functions[function].blocks[block].body[at].rest[0] = variable;
    code.insert(module, function, block, at);
    Some(())
}
