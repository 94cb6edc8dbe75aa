//! Expressions and stretches of blocks as functions of their own.

use std::collections::{HashMap, HashSet};

use anyhit_engine::module::Opcode as Op;
use rspirv::spirv::StorageClass;

use super::build::{Code, Index, Rng};
use super::operations::is_pure;
use super::places::{choose, in_order, is_debug, name, replace, sites};
use super::words::{Block, Function, Inst, Module, Place};

/// An instruction with some of those that it takes its operands from, all of one block.
struct Expression {
    function: usize,
    block: usize,
    /// Ascending; the last is the result.
    insts: Vec<usize>,
    /// What it takes from elsewhere, but for constants: ids and types.
    inputs: Vec<(u32, u32)>,
}

/// Whether values of a type may be given to functions.
fn may_be_given(index: &Index, ty: u32) -> bool {
    index.is_storable(ty) && !index.holds_address(ty)
}

fn expression(module: &Module, index: &Index, rng: &mut Rng) -> Option<Expression> {
    let glsl = module.imported("GLSL.std.450");
    let wanted =
        |inst: &Inst| is_pure(inst, glsl) && !index.is_decorated(inst.id) && may_be_given(index, inst.ty);
    for (function, block, at) in choose(module, rng, wanted) {
        let body = &module.functions[function].blocks[block].body;
        let mut insts = vec![at];
        for earlier in (0..at).rev() {
            let used = insts.iter().any(|at| body[*at].operands().any(|id| id == body[earlier].id));
            if used && wanted(&body[earlier]) && !rng.one_in(3) {
                insts.insert(0, earlier);
            }
        }
        let inside: HashSet<u32> = insts.iter().map(|at| body[*at].id).collect();
        let mut inputs: Vec<(u32, u32)> = Vec::new();
        for id in insts.iter().flat_map(|at| body[*at].operands()) {
            let local = !inside.contains(&id) && !index.globals.contains_key(&id);
            if let Some(ty) = index.types.get(&id).filter(|_| local)
                && !inputs.iter().any(|(known, _)| *known == id)
            {
                inputs.push((id, *ty));
            }
        }
        if inputs.iter().all(|(_, ty)| may_be_given(index, *ty)) {
            return Some(Expression { function, block, insts, inputs });
        }
    }
    None
}

/// A function in the making.
struct Helper {
    params: Vec<Inst>,
    body: Vec<Inst>,
    label: u32,
}

impl Helper {
    fn new(module: &mut Module) -> Self {
        Self { params: Vec::new(), body: Vec::new(), label: module.fresh() }
    }

    fn param(&mut self, module: &mut Module, ty: u32) -> u32 {
        let id = module.fresh();
        self.params.push(Inst::new(Op::FunctionParameter, ty, id, &[], &Place::default()));
        id
    }

    /// Makes it the last of the module's functions.
    fn finish(self, module: &mut Module, result: u32, last: Inst) -> u32 {
        let params: Vec<u32> = self.params.iter().map(|param| param.ty).collect();
        let ty = module.function_type(result, &params);
        let id = module.fresh();
        let head = Inst::new(Op::Function, result, id, &[0, ty], &Place::default());
        let label = Inst::new(Op::Label, 0, self.label, &[], &Place::default());
        let mut body = self.body;
        body.push(last);
        let function = Function::new(head, self.params, vec![Block { label, body }]);
        module.functions.push(function);
        id
    }
}

/// A copy of an expression's instructions with new ids. `read` gives the id for an operand.
fn copy(
    module: &mut Module,
    body: &mut Vec<Inst>,
    expression: &[Inst],
    mut read: impl FnMut(&mut Module, &mut Vec<Inst>, u32, &Place) -> u32,
) -> u32 {
    let mut made: HashMap<u32, u32> = HashMap::new();
    let mut last = 0;
    for inst in expression {
        let mut inst = inst.clone();
        let operands: Vec<u32> = inst.operands().collect();
        let new: Vec<u32> = operands
            .into_iter()
            .map(|id| made.get(&id).copied().unwrap_or_else(|| read(module, body, id, &inst.place)))
            .collect();
        let mut new = new.into_iter();
        inst.map_operands(|_| new.next().expect("as many as there were"));
        last = module.fresh();
        made.insert(inst.id, last);
        inst.id = last;
        body.push(inst);
    }
    last
}

/// An expression as a function of its inputs, which returns it.
pub fn by_value(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    let found = expression(module, &index, rng)?;
    let insts = taken(module, &found);
    let result = insts.last()?.clone();
    let mut helper = Helper::new(module);
    let params: HashMap<u32, u32> =
        found.inputs.iter().map(|(id, ty)| (*id, helper.param(module, *ty))).collect();
    let value = copy(module, &mut helper.body, &insts, |_, _, id, _| params.get(&id).copied().unwrap_or(id));
    let last = Inst::new(Op::ReturnValue, 0, 0, &[value], &result.place);
    let id = helper.finish(module, result.ty, last);
    let arguments: Vec<u32> = found.inputs.iter().map(|(id, _)| *id).collect();
    let call = [&[id], &arguments[..]].concat();
    module.functions[found.function].blocks[found.block].body[*found.insts.last()?] =
        Inst::new(Op::FunctionCall, result.ty, result.id, &call, &result.place);
    Some(())
}

fn taken(module: &Module, found: &Expression) -> Vec<Inst> {
    let body = &module.functions[found.function].blocks[found.block].body;
    found.insts.iter().map(|at| body[*at].clone()).collect()
}

/// An expression as a function that writes it through a pointer: into a variable that holds one of
/// the inputs before, or nothing. What follows from it may go through the same variable, and every
/// call may be made on a copy first.
pub fn by_pointer(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    let found = expression(module, &index, rng)?;
    let mut insts = taken(module, &found);
    let ty = insts.last()?.ty;
    let mut code = Code::new(module, &insts.last()?.place.clone());
    let (variable, class) = code.any_variable(module, ty, rng);
    let pointer = module.pointer(class, ty);
    let mut inputs = found.inputs.clone();
    let mut at = *found.insts.last()?;
    // The input that the variable holds at the call.
    let mut held = inputs.iter().find(|(_, of)| *of == ty).map(|(id, _)| *id).filter(|_| !rng.one_in(4));
    if let Some(held) = held {
        code.run(Op::Store, &[variable, held]);
    }
    let mut steps: Vec<(usize, Vec<Inst>)> = Vec::new();
    loop {
        let result = insts.last()?.clone();
        code.place = result.place.clone();
        let mut helper = Helper::new(module);
        let place = helper.param(module, pointer);
        let others: Vec<(u32, u32)> = inputs.iter().copied().filter(|(id, _)| Some(*id) != held).collect();
        let params: HashMap<u32, u32> =
            others.iter().map(|(id, ty)| (*id, helper.param(module, *ty))).collect();
        let once = rng.one_in(2);
        let mut loaded = None;
        let value = copy(module, &mut helper.body, &insts, |module, body, id, line| {
            if Some(id) != held {
                return params.get(&id).copied().unwrap_or(id);
            }
            if let Some(loaded) = loaded.filter(|_| once) {
                return loaded;
            }
            let id = module.fresh();
            body.push(Inst::new(Op::Load, ty, id, &[place], line));
            loaded = Some(id);
            id
        });
        helper.body.push(Inst::new(Op::Store, 0, 0, &[place, value], &result.place));
        let (void, last) = (module.void(), Inst::new(Op::Return, 0, 0, &[], &result.place));
        let id = helper.finish(module, void, last);
        let arguments: Vec<u32> = others.iter().map(|(id, _)| *id).collect();
        if class == StorageClass::Function && rng.one_in(3) {
            let other = code.variable(module, ty, None);
            code.run(Op::CopyMemory, &[other, variable]);
            code.op(module, Op::FunctionCall, void, &[&[id, other], &arguments[..]].concat());
        }
        code.op(module, Op::FunctionCall, void, &[&[id, variable], &arguments[..]].concat());
        code.out.push(Inst::new(Op::Load, ty, result.id, &[variable], &result.place));
        steps.push((at, std::mem::take(&mut code.out)));
        // What follows from it may take the value from the variable itself.
        let body = &module.functions[found.function].blocks[found.block].body;
        let glsl = module.imported("GLSL.std.450");
        let next = body.iter().enumerate().skip(at + 1).find(|(_, inst)| {
            is_pure(inst, glsl)
                && inst.ty == ty
                && !code.index.is_decorated(inst.id)
                && inst.operands().any(|id| id == result.id)
        });
        let next = next.map(|(at, inst)| (at, inst.clone())).filter(|_| steps.len() < 6 && !rng.one_in(4));
        let Some((next, inst)) = next else { break };
        held = Some(result.id);
        inputs = Vec::new();
        for id in inst.operands() {
            let Some(of) = code.index.types.get(&id).filter(|_| !code.index.globals.contains_key(&id)) else {
                continue;
            };
            if !inputs.iter().any(|(known, _)| *known == id) {
                inputs.push((id, *of));
            }
        }
        if !inputs.iter().all(|(_, of)| may_be_given(&code.index, *of)) {
            break;
        }
        insts = vec![inst];
        at = next;
    }
    let code_of = &mut module.functions[found.function];
    for (at, out) in steps.into_iter().rev() {
        code_of.blocks[found.block].body.splice(at..=at, out);
    }
    code_of.blocks[0].body.splice(0..0, code.variables);
    Some(())
}

/// A stretch of a block as a function: what it takes from outside are parameters, what others take
/// from it is written through pointers, or returned.
pub fn stretch(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    let starts = in_order(rng, sites(module).map(|(at, inst)| (name(inst), at)));
    for (function, block, first) in starts {
        let code = &module.functions[function].blocks[block];
        if first < code.start() || first >= code.tail() {
            continue;
        }
        let end = first + 1 + rng.below((code.tail() - first).min(14));
        let Some(found) = Stretch::of(module, &index, function, block, first..end) else { continue };
        return found.take_out(module, rng);
    }
    None
}

struct Stretch {
    function: usize,
    block: usize,
    range: std::ops::Range<usize>,
    inputs: Vec<(u32, u32)>,
    outputs: Vec<(u32, u32)>,
}

impl Stretch {
    fn of(
        module: &Module,
        index: &Index,
        function: usize,
        block: usize,
        range: std::ops::Range<usize>,
    ) -> Option<Self> {
        let debug = module.debug_set();
        let code = &module.functions[function];
        let body = &code.blocks[block].body[range.clone()];
        if body.iter().any(|inst| is_debug(inst, debug)) {
            return None;
        }
        let inside: HashSet<u32> = body.iter().map(|inst| inst.id).filter(|id| *id != 0).collect();
        let variables: HashSet<u32> = code
            .insts()
            .filter(|inst| inst.op == Op::Variable)
            .chain(&code.params)
            .map(|inst| inst.id)
            .collect();
        let mut inputs: Vec<(u32, u32)> = Vec::new();
        for id in body.iter().flat_map(Inst::operands) {
            let Some(ty) = index.types.get(&id) else { continue };
            if inside.contains(&id)
                || index.globals.contains_key(&id)
                || inputs.iter().any(|(known, _)| *known == id)
            {
                continue;
            }
            // Without variable pointers only a variable or a parameter may be given.
            let is_variable = index.pointer(id).is_some_and(|(class, _)| {
                let classes = [StorageClass::Function, StorageClass::Private, StorageClass::Workgroup];
                variables.contains(&id) && classes.iter().any(|own| *own as u32 == class)
            });
            if (!is_variable && !may_be_given(index, *ty)) || (is_variable && index.is_decorated(id)) {
                return None;
            }
            inputs.push((id, *ty));
        }
        let outside = code.blocks.iter().enumerate().flat_map(|(at, other)| {
            let taken = if at == block { range.clone() } else { 0..0 };
            let insts = other.body.iter().enumerate();
            insts.filter(move |(position, _)| !taken.contains(position)).map(|(_, inst)| inst)
        });
        let used: HashSet<u32> = outside.flat_map(Inst::operands).collect();
        let defined = body.iter().filter(|inst| inst.ty != 0 && used.contains(&inst.id));
        let outputs: Vec<(u32, u32)> = defined.map(|inst| (inst.id, inst.ty)).collect();
        let fits = |(id, ty): &(u32, u32)| may_be_given(index, *ty) && !index.is_decorated(*id);
        outputs.iter().all(fits).then_some(Self { function, block, range, inputs, outputs })
    }

    fn take_out(self, module: &mut Module, rng: &mut Rng) -> Option<()> {
        let Self { function, block, range, inputs, outputs } = self;
        let body = &mut module.functions[function].blocks[block].body;
        let start = range.start;
        let mut insts: Vec<Inst> = body.drain(range).collect();
        let place = insts.last()?.place.clone();
        let mut code = Code::new(module, &insts.first()?.place.clone());
        let mut helper = Helper::new(module);
        let params: HashMap<u32, u32> =
            inputs.iter().map(|(id, ty)| (*id, helper.param(module, *ty))).collect();
        for inst in &mut insts {
            inst.map_operands(|id| params.get(&id).copied().unwrap_or(id));
        }
        helper.body = insts;
        let mut arguments: Vec<u32> = inputs.iter().map(|(id, _)| *id).collect();
        let returned = outputs.first().copied().filter(|_| rng.one_in(2));
        let written = &outputs[usize::from(returned.is_some())..];
        let mut loads = Vec::new();
        for (id, ty) in written {
            let variable = code.variable(module, *ty, None);
            let pointer = module.pointer(StorageClass::Function, *ty);
            let param = helper.param(module, pointer);
            helper.body.push(Inst::new(Op::Store, 0, 0, &[param, *id], &place));
            arguments.push(variable);
            loads.push((*id, *ty, variable));
        }
        let result = returned.map_or_else(|| module.void(), |(_, ty)| ty);
        let last = match returned {
            Some((id, _)) => Inst::new(Op::ReturnValue, 0, 0, &[id], &place),
            None => Inst::new(Op::Return, 0, 0, &[], &place),
        };
        let callee = helper.finish(module, result, last);
        let call = code.op(module, Op::FunctionCall, result, &[&[callee], &arguments[..]].concat());
        if let Some((id, _)) = returned {
            replace(module, function, id, call, |_| true);
        }
        for (id, ty, variable) in loads {
            let loaded = code.op(module, Op::Load, ty, &[variable]);
            replace(module, function, id, loaded, |_| true);
        }
        code.insert(module, function, block, start);
        Some(())
    }
}
