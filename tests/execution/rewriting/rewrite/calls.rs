//! Calls: made on copies first, or replaced by what they call.

use std::collections::{HashMap, HashSet};

use anyhit_engine::module::Opcode as Op;
use rspirv::spirv::StorageClass;

use super::build::{Code, Index, Rng};
use super::operations::is_pure;
use super::places::{choose, is_debug};
use super::words::{Inst, Module};

/// A call made a first time on copies of the variables that it is given; what that gives is thrown
/// away.
pub fn on_copy(module: &mut Module, rng: &mut Rng) -> Option<()> {
    for (function, block, at) in choose(module, rng, |inst| inst.op == Op::FunctionCall) {
        let call = module.functions[function].blocks[block].body[at].clone();
        if !changes_only_its_parameters(module, call.rest[0], &mut HashSet::new()) {
            continue;
        }
        let mut code = Code::new(module, &call.place);
        let mut arguments = Vec::new();
        for argument in &call.rest[1..] {
            let Some((class, ty)) = code.index.pointer(*argument) else {
                arguments.push(*argument);
                continue;
            };
            if class != StorageClass::Function as u32
                || !code.index.is_storable(ty)
                || code.index.holds_address(ty)
            {
                break;
            }
            let variable = code.variable(module, ty, None);
            if rng.one_in(2) {
                code.run(Op::CopyMemory, &[variable, *argument]);
            } else {
                let loaded = code.op(module, Op::Load, ty, &[*argument]);
                code.run(Op::Store, &[variable, loaded]);
            }
            arguments.push(variable);
        }
        if arguments.len() + 1 < call.rest.len() {
            continue;
        }
        code.op(module, Op::FunctionCall, call.ty, &[&call.rest[..1], &arguments].concat());
        code.insert(module, function, block, at);
        return Some(());
    }
    None
}

/// Whether a function, with all that it calls, writes nothing but its own variables and what its
/// parameters point at, and stops nobody.
fn changes_only_its_parameters(module: &Module, function: u32, asked: &mut HashSet<u32>) -> bool {
    if !asked.insert(function) {
        return true;
    }
    let Some(code) = module.functions.iter().find(|code| code.head.id == function) else { return false };
    let (glsl, debug) = (module.imported("GLSL.std.450"), module.debug_set());
    let mut own: HashSet<u32> = code.params.iter().map(|param| param.id).collect();
    let mut calls = Vec::new();
    // Twice, as blocks need not stand in the order in which they run.
    for _ in 0..2 {
        for inst in code.insts() {
            let chain = matches!(inst.op, Op::AccessChain | Op::InBoundsAccessChain);
            if inst.op == Op::Variable || (chain && own.contains(&inst.rest[0])) {
                own.insert(inst.id);
            }
        }
    }
    let index = Index::of(module);
    let fine = code.insts().all(|inst| match inst.op {
        Op::Store | Op::CopyMemory => inst.rest.len() == 2 && own.contains(&inst.rest[0]),
        Op::Load => inst.rest.len() == 1,
        Op::FunctionCall => {
            calls.push(inst.rest[0]);
            let mut pointers = inst.rest[1..].iter().filter(|id| index.pointer(**id).is_some());
            pointers.all(|id| own.contains(id))
        }
        Op::Variable | Op::AccessChain | Op::InBoundsAccessChain | Op::Phi | Op::Undef => true,
        Op::Branch | Op::BranchConditional | Op::Switch | Op::Return | Op::ReturnValue => true,
        Op::SelectionMerge | Op::LoopMerge => true,
        _ => is_pure(inst, glsl) || is_debug(inst, debug),
    });
    fine && calls.into_iter().all(|called| changes_only_its_parameters(module, called, asked))
}

/// A call of a function of one block replaced by that block.
pub fn inlined(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let debug = module.debug_set();
    for (function, block, at) in choose(module, rng, |inst| inst.op == Op::FunctionCall) {
        let call = module.functions[function].blocks[block].body[at].clone();
        let index = Index::of(module);
        let callee = module.functions.iter().find(|code| code.head.id == call.rest[0])?.clone();
        let [body] = &callee.blocks[..] else { continue };
        let last = body.terminator();
        if !matches!(last.op, Op::Return | Op::ReturnValue) || index.is_decorated(call.id) {
            continue;
        }
        let mut ids: HashMap<u32, u32> =
            callee.params.iter().map(|param| param.id).zip(call.rest[1..].iter().copied()).collect();
        let mut code = Code::new(module, &call.place);
        let mut variables = body.body.iter().filter(|inst| inst.op == Op::Variable);
        if !variables.all(|inst| !index.is_decorated(inst.id)) {
            continue;
        }
        for inst in body.body.iter().filter(|inst| !is_debug(inst, debug) && !inst.is_terminator()) {
            let mut inst = inst.clone();
            if inst.id != 0 {
                let new = module.fresh();
                module.copy_decorations(inst.id, new);
                ids.insert(inst.id, new);
                inst.id = new;
            }
            inst.map_operands(|id| ids.get(&id).copied().unwrap_or(id));
            if inst.op == Op::Variable {
                if inst.rest.len() > 1 {
                    // At each call it begins with this anew.
                    let value = inst.rest.pop()?;
                    inst.ids.pop();
                    code.out.push(Inst::new(Op::Store, 0, 0, &[inst.id, value], &call.place));
                }
                code.variables.push(inst);
            } else {
                code.out.push(inst);
            }
        }
        if last.op == Op::ReturnValue {
            let value = ids.get(&last.rest[0]).copied().unwrap_or(last.rest[0]);
            code.out.push(Inst::new(Op::CopyObject, call.ty, call.id, &[value], &call.place));
        }
        module.functions[function].blocks[block].body.remove(at);
        code.insert(module, function, block, at);
        return Some(());
    }
    None
}
