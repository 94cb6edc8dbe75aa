//! Where a step takes place.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use anyhit_engine::module::Opcode as Op;

use super::build::{Code, Index, Rng};
use super::operations;
use super::values::Remake;
use super::words::{Inst, Module};

/// How many places a step looks at before it gives up.
pub const TRIES: usize = 12;

/// Some sites, in an order that depends on a key and on what each site is, not on how many there
/// are.
pub fn in_order<T>(rng: &mut Rng, sites: impl IntoIterator<Item = (u64, T)>) -> Vec<T> {
    let key = rng.draw();
    let mut all: Vec<(u64, T)> = sites
        .into_iter()
        .map(|(site, what)| (Rng(key ^ site.wrapping_mul(0x9E37_79B9)).draw(), what))
        .collect();
    all.sort_by_key(|(hash, _)| *hash);
    all.into_iter().take(TRIES).map(|(_, what)| what).collect()
}

/// A number for an instruction that changes to others do not change.
pub fn name(inst: &Inst) -> u64 {
    if inst.id != 0 {
        return u64::from(inst.id);
    }
    let mut hasher = DefaultHasher::new();
    (inst.op, &inst.rest).hash(&mut hasher);
    hasher.finish()
}

/// Function, block, instruction.
pub type At = (usize, usize, usize);

/// All instructions of functions with their places.
pub fn sites(module: &Module) -> impl Iterator<Item = (At, &Inst)> {
    module.functions.iter().enumerate().flat_map(|(function, code)| {
        code.blocks.iter().enumerate().flat_map(move |(block, code)| {
            code.body.iter().enumerate().map(move |(at, inst)| ((function, block, at), inst))
        })
    })
}

/// Instructions of some kind, in the order of a key.
pub fn choose(module: &Module, rng: &mut Rng, wanted: impl Fn(&Inst) -> bool) -> Vec<At> {
    let found = sites(module).filter(|(_, inst)| wanted(inst));
    in_order(rng, found.map(|(at, inst)| (name(inst), at)))
}

/// Makes a value again, behind its definition or in front of one use.
pub fn remake(module: &mut Module, rng: &mut Rng, make: Remake) -> Option<()> {
    if rng.one_in(2) { at_definition(module, rng, make) } else { at_use(module, rng, make) }
}

fn at_definition(module: &mut Module, rng: &mut Rng, make: Remake) -> Option<()> {
    let mut all: Vec<(u64, (At, u32, u32))> = Vec::new();
    for (function, code) in module.functions.iter().enumerate() {
        for param in code.params.iter().filter(|_| !code.blocks.is_empty()) {
            all.push((u64::from(param.id), ((function, 0, code.blocks[0].start()), param.id, param.ty)));
        }
        for (block, code) in code.blocks.iter().enumerate() {
            for (at, inst) in code.body.iter().enumerate().filter(|(_, inst)| inst.ty != 0) {
                let at = (at + 1).max(code.start());
                all.push((u64::from(inst.id), ((function, block, at), inst.id, inst.ty)));
            }
        }
    }
    for (at, id, ty) in in_order(rng, all) {
        let (function, block, position) = at;
        let place = module.functions[function].blocks[block].body[position].place.clone();
        let mut code = Code::new(module, &place);
        if code.index.is_decorated(id) {
            continue;
        }
        let Some(other) = make(&mut code, module, id, ty, rng) else { continue };
        let (every, key) = (rng.one_in(2), rng.draw());
        replace(module, function, id, other, |inst| every || Rng(key ^ name(inst)).one_in(2));
        code.insert(module, function, block, position);
        return Some(());
    }
    None
}

/// Exchanges an id in a function's instructions.
pub fn replace(module: &mut Module, function: usize, id: u32, other: u32, wanted: impl Fn(&Inst) -> bool) {
    let debug = module.debug_set();
    for inst in module.functions[function].insts_mut() {
        if inst.operands().any(|operand| operand == id) && !is_debug(inst, debug) && wanted(inst) {
            inst.map_operands(|operand| if operand == id { other } else { operand });
        }
    }
}

/// Whether an instruction is one of debug information.
pub fn is_debug(inst: &Inst, debug: u32) -> bool {
    inst.op == Op::ExtInst && inst.rest[0] == debug
}

fn at_use(module: &mut Module, rng: &mut Rng, make: Remake) -> Option<()> {
    let index = Index::of(module);
    let debug = module.debug_set();
    let mut all = Vec::new();
    for (at, inst) in sites(module).filter(|(_, inst)| !is_debug(inst, debug)) {
        for position in inst.ids.iter().map(|position| usize::from(*position)) {
            let id = inst.rest[position];
            let Some(ty) = index.types.get(&id) else { continue };
            if index.globals.contains_key(&id) && !operations::takes_any(inst, position) {
                continue;
            }
            all.push((name(inst) ^ (position as u64) << 40, (at, position, id, *ty)));
        }
    }
    for ((function, block, at), position, id, ty) in in_order(rng, all) {
        if index.is_decorated(id) {
            continue;
        }
        let blocks = &module.functions[function].blocks;
        let inst = &blocks[block].body[at];
        // A phi's value is made at the end of the block that it comes from.
        let (block_made, at_made) = if inst.op == Op::Phi {
            let Some(from) = blocks.iter().position(|block| block.id() == inst.rest[position + 1]) else {
                continue;
            };
            (from, blocks[from].tail())
        } else {
            (block, at.min(blocks[block].tail()))
        };
        let mut code = Code::new(module, &blocks[block_made].body[at_made].place.clone());
        let Some(other) = make(&mut code, module, id, ty, rng) else { continue };
        module.functions[function].blocks[block].body[at].rest[position] = other;
        code.insert(module, function, block_made, at_made);
        return Some(());
    }
    None
}

/// Gives all ids other numbers, without gaps.
pub fn renumber(module: &mut Module, rng: &mut Rng) {
    let mut ids = used(module);
    for at in (1..ids.len()).rev() {
        ids.swap(at, rng.below(at + 1));
    }
    number(module, &ids);
}

/// Gives all ids numbers without gaps, in their order.
pub fn compact(module: &mut Module) {
    let ids = used(module);
    number(module, &ids);
}

fn used(module: &mut Module) -> Vec<u32> {
    let mut ids: Vec<u32> = module.all_mut().map(|inst| inst.id).filter(|id| *id != 0).collect();
    // Names and decorations may speak of ids that nothing defines.
    ids.extend(module.head.iter().flat_map(Inst::operands));
    ids.sort_unstable();
    ids.dedup();
    ids
}

fn number(module: &mut Module, ids: &[u32]) {
    let numbers: HashMap<u32, u32> = ids.iter().zip(1..).map(|(id, number)| (*id, number)).collect();
    module.map_ids(|id| numbers[&id]);
    module.highest_id = ids.len() as u32 + 1;
    module.next_id = module.highest_id;
    module.first_id = module.highest_id;
}
