//! Control flow: blocks cut, put under conditions and into loops of one turn, branches written
//! otherwise.

use anyhit_engine::module::Opcode as Op;
use rspirv::spirv::SelectionControl;

use super::build::{Code, Index, Rng};
use super::graph::Graph;
use super::places::{At, in_order, name, sites};
use super::words::{Block, Function, Inst, Module, Place};

/// Cuts a block in front of an instruction.
pub fn split_block(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let all = sites(module)
        .filter(|((function, block, at), _)| can_cut(&module.functions[*function].blocks[*block], *at));
    let (function, block, at) = *in_order(rng, all.map(|(at, inst)| (name(inst), at))).first()?;
    cut(module, function, block, at);
    Some(())
}

/// Whether a block can be cut in front of an instruction.
fn can_cut(block: &Block, at: usize) -> bool {
    let loops = block.merge().is_some_and(|merge| merge.op == Op::LoopMerge);
    // A sampled image must be used in its block.
    let crosses = || {
        let sampled = block.body[..at].iter().filter(|inst| inst.op == Op::SampledImage);
        let mut sampled = sampled.map(|inst| inst.id);
        sampled.any(|id| block.body[at..].iter().any(|inst| inst.operands().any(|operand| operand == id)))
    };
    !loops && at >= block.start() && at <= block.tail() && !crosses()
}

/// Cuts a block; what is behind the cut is the next block. Gives its label.
fn cut(module: &mut Module, function: usize, block: usize, at: usize) -> u32 {
    let label = module.fresh();
    let blocks = &mut module.functions[function].blocks;
    let body = blocks[block].body.split_off(at);
    let (old, place) = (blocks[block].id(), body[0].place.clone());
    blocks[block].body.push(Inst::new(Op::Branch, 0, 0, &[label], &place));
    blocks.insert(block + 1, new_block(label, body));
    let after = blocks[block + 1].successors();
    rename_predecessor(&mut module.functions[function], &after, old, label);
    label
}

fn new_block(label: u32, body: Vec<Inst>) -> Block {
    Block { label: Inst::new(Op::Label, 0, label, &[], &Place::default()), body }
}

/// Tells the phis of some blocks that what came from one block comes from another.
fn rename_predecessor(function: &mut Function, blocks: &[u32], old: u32, new: u32) {
    for block in function.blocks.iter_mut().filter(|block| blocks.contains(&block.id())) {
        for phi in block.phis_mut() {
            for pair in phi.rest.chunks_mut(2).filter(|pair| pair[1] == old) {
                pair[1] = new;
            }
        }
    }
}

/// A stretch of a block that can be cut out: where it begins and ends.
fn stretches(module: &Module, rng: &mut Rng) -> Vec<(At, usize)> {
    let can = |at: &At| can_cut(&module.functions[at.0].blocks[at.1], at.2);
    let starts = in_order(rng, sites(module).filter(|(at, _)| can(at)).map(|(at, inst)| (name(inst), at)));
    let mut all = Vec::new();
    for at in starts {
        let block = &module.functions[at.0].blocks[at.1];
        let ends: Vec<usize> = (at.2..=block.tail()).filter(|end| can_cut(block, *end)).collect();
        all.push((at, ends[rng.below(ends.len())]));
    }
    all
}

/// What a block defines and others use: ids and types; `None` where something cannot be in a
/// variable.
fn escaping(module: &Module, function: usize, block: usize) -> Option<Vec<(u32, u32)>> {
    let index = Index::of(module);
    let blocks = &module.functions[function].blocks;
    let outside = blocks.iter().enumerate().filter(|(at, _)| *at != block);
    let used: std::collections::HashSet<u32> =
        outside.flat_map(|(_, block)| &block.body).flat_map(Inst::operands).collect();
    let escaping = blocks[block].body.iter().filter(|inst| inst.ty != 0 && used.contains(&inst.id));
    let escaping: Vec<_> = escaping.map(|inst| (inst.id, inst.ty)).collect();
    let fits = |(_, ty): &(u32, u32)| index.is_storable(*ty) && !index.holds_address(*ty);
    escaping.iter().all(fits).then_some(escaping)
}

/// Takes what one block defines to another by variables: as that is not always run before.
fn carry(module: &mut Module, code: &mut Code, function: usize, from: usize, to: usize, all: &[(u32, u32)]) {
    for &(id, ty) in all {
        let variable = code.variable(module, ty, None);
        let loaded = module.fresh();
        for block in &mut module.functions[function].blocks {
            for inst in &mut block.body {
                inst.map_operands(|operand| if operand == id { loaded } else { operand });
            }
        }
        let blocks = &mut module.functions[function].blocks;
        for inst in &mut blocks[from].body {
            inst.map_operands(|operand| if operand == loaded { id } else { operand });
        }
        let (tail, place) = (blocks[from].tail(), blocks[from].body[blocks[from].tail()].place.clone());
        blocks[from].body.insert(tail, Inst::new(Op::Store, 0, 0, &[variable, id], &place));
        let place = blocks[to].body[0].place.clone();
        blocks[to].body.insert(0, Inst::new(Op::Load, ty, loaded, &[variable], &place));
    }
}

/// A stretch of a block as the body of a loop that turns once.
pub fn loop_once(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let ((function, block, at), end) = *stretches(module, rng).first()?;
    let after = cut(module, function, block, end);
    let body = cut(module, function, block, at);
    let place = module.functions[function].blocks[block].terminator().place.clone();
    let before = module.functions[function].blocks[block].id();
    let (head, next) = (module.fresh(), module.fresh());
    let (uint, bool) = (module.uint(), module.bool());
    let (zero, one) = (module.number(0), module.number(1));
    let mut start = Code::new(module, &place);
    let mut again = Code::new(module, &place);
    let merge = Inst::new(Op::LoopMerge, 0, 0, &[after, next, 0], &place);
    // Tested at the top of the loop, the body need not run before what follows it.
    let escaping = escaping(module, function, block + 1).filter(|_| rng.one_in(2));
    let count_again = module.fresh();
    if let Some(escaping) = escaping {
        let count = start.op(module, Op::Phi, uint, &[zero, before, count_again, next]);
        let first = start.op(module, Op::ULessThan, bool, &[count, one]);
        start.out.push(merge);
        start.run(Op::BranchConditional, &[first, body, after]);
        again.out.push(Inst::new(Op::IAdd, uint, count_again, &[count, one], &place));
        again.run(Op::Branch, &[head]);
        carry(module, &mut start, function, block + 1, block + 2, &escaping);
    } else {
        let condition = match rng.below(3) {
            0 => module.global(Op::ConstantFalse, bool, &[]),
            1 => {
                let truth = again.truth(module, rng);
                again.op(module, Op::LogicalNot, bool, &[truth])
            }
            _ => {
                let count = start.op(module, Op::Phi, uint, &[zero, before, count_again, next]);
                again.out.push(Inst::new(Op::IAdd, uint, count_again, &[count, one], &place));
                again.op(module, Op::ULessThan, bool, &[count_again, one])
            }
        };
        start.out.push(merge);
        start.run(Op::Branch, &[body]);
        again.run(Op::BranchConditional, &[condition, head, after]);
    }
    let blocks = &mut module.functions[function].blocks;
    blocks[block].map_successors(|_| head);
    blocks[block + 1].map_successors(|_| next);
    blocks.insert(block + 2, new_block(next, again.out));
    blocks.insert(block + 1, new_block(head, start.out));
    blocks[0].body.splice(0..0, start.variables.into_iter().chain(again.variables));
    Some(())
}

/// A stretch of a block under a condition that always holds. Where it would not, something else
/// would be done.
pub fn under_condition(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let ((function, block, at), end) = *stretches(module, rng).first()?;
    let after = cut(module, function, block, end);
    let body = cut(module, function, block, at);
    let escaping = escaping(module, function, block + 1)?;
    let place = module.functions[function].blocks[block].terminator().place.clone();
    let mut code = Code::new(module, &place);
    let truth = code.truth(module, rng);
    carry(module, &mut code, function, block + 1, block + 2, &escaping);
    let spoiled = rng.one_in(2).then(|| spoiling(module, function, after, &place)).flatten();
    let other = spoiled.as_ref().map_or(after, Block::id);
    code.run(Op::SelectionMerge, &[after, SelectionControl::NONE.bits()]);
    if rng.one_in(2) {
        code.run(Op::BranchConditional, &[truth, body, other]);
    } else {
        let bool = module.bool();
        let tail = code.out.len() - 1;
        let never = Inst::new(Op::LogicalNot, bool, module.fresh(), &[truth], &place);
        let id = never.id;
        code.out.insert(tail, never);
        code.run(Op::BranchConditional, &[id, other, body]);
    }
    let blocks = &mut module.functions[function].blocks;
    if let Some(spoiled) = spoiled {
        blocks.insert(block + 2, spoiled);
    }
    blocks[block].body.pop();
    blocks[block].body.append(&mut code.out);
    blocks[0].body.splice(0..0, code.variables);
    Some(())
}

/// A block that would set variables of a function to 0.
fn spoiling(module: &mut Module, function: usize, after: u32, place: &Place) -> Option<Block> {
    let index = Index::of(module);
    let variables = module.functions[function].blocks[0].body.iter().filter(|inst| inst.op == Op::Variable);
    let pointees = variables.filter_map(|inst| Some((inst.id, index.ty(inst.ty)?.rest[1])));
    let fits = |(_, ty): &(u32, u32)| index.is_storable(*ty) && !index.holds_address(*ty);
    let all: Vec<(u32, u32)> = pointees.filter(fits).collect();
    let mut body = Vec::new();
    for (variable, ty) in all {
        let zero = module.global(Op::ConstantNull, ty, &[]);
        body.push(Inst::new(Op::Store, 0, 0, &[variable, zero], place));
    }
    if body.is_empty() {
        return None;
    }
    body.push(Inst::new(Op::Branch, 0, 0, &[after], place));
    Some(new_block(module.fresh(), body))
}

/// Headers of selections of two ways: function, block.
fn selections(module: &Module, rng: &mut Rng) -> Vec<(usize, usize)> {
    let mut all = Vec::new();
    for (function, code) in module.functions.iter().enumerate() {
        let graph = Graph::of(code);
        for (block, code) in code.blocks.iter().enumerate() {
            let selects = code.merge().is_some_and(|merge| merge.op == Op::SelectionMerge);
            let last = code.terminator();
            let two = last.op == Op::BranchConditional && last.rest[1] != last.rest[2];
            if selects && two && graph.is_reachable(block) {
                all.push((u64::from(code.id()), (function, block)));
            }
        }
    }
    in_order(rng, all)
}

/// `if (c) { X }` as `if (c) { if (c) { X } }`, or the other branch so.
pub fn doubled_selection(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let side = rng.below(2);
    for (function, block) in selections(module, rng) {
        let graph = Graph::of(&module.functions[function]);
        let blocks = &module.functions[function].blocks;
        let (head, merge) = (blocks[block].id(), blocks[block].merge()?.rest[0]);
        let last = blocks[block].terminator().clone();
        let inner = last.rest[1 + side];
        let merge_at = graph.at[&merge];
        let start = graph.at[&inner];
        if inner == merge
            || graph.merges.contains(&inner)
            || graph.loop_exits.contains(&inner)
            || graph.predecessors[start] != [block]
            || !graph.is_reachable(merge_at)
            // What it defines may be used behind the selection then.
            || graph.dominates(start, merge_at)
        {
            continue;
        }
        let (region, _) = graph.construct(&module.functions[function], start, merge);
        let region: Vec<u32> = region.into_iter().map(|at| blocks[at].id()).collect();
        let index = Index::of(module);
        let phis = blocks[merge_at].body.iter().filter(|inst| inst.op == Op::Phi);
        if !phis.clone().all(|phi| index.is_storable(phi.ty)) {
            continue;
        }
        let (again, joined) = (module.fresh(), module.fresh());
        let mut join = Vec::new();
        let phis = module.functions[function].blocks[merge_at].phis_mut().count();
        for at in 0..phis {
            let ty = module.functions[function].blocks[merge_at].body[at].ty;
            let (null, id) = (module.global(Op::ConstantNull, ty, &[]), module.fresh());
            let phi = module.functions[function].blocks[merge_at].phis_mut().nth(at)?;
            let (inside, outside): (Vec<_>, Vec<_>) =
                phi.rest.chunks(2).partition(|pair| region.contains(&pair[1]));
            let inside = [&inside.concat()[..], &[null, again]].concat();
            let outside = [&outside.concat()[..], &[id, joined]].concat();
            let place = phi.place.clone();
            *phi = Inst::new(Op::Phi, ty, phi.id, &outside, &place);
            join.push(Inst::new(Op::Phi, ty, id, &inside, &place));
        }
        let code = &mut module.functions[function];
        for block in code.blocks.iter_mut().filter(|block| region.contains(&block.id())) {
            block.map_successors(|label| if label == merge { joined } else { label });
        }
        code.blocks[block].map_successors(|label| if label == inner { again } else { label });
        rename_predecessor(code, &[inner], head, again);
        join.push(Inst::new(Op::Branch, 0, 0, &[merge], &last.place));
        let mut targets = [joined, joined];
        targets[side] = inner;
        let body = vec![
            Inst::new(Op::SelectionMerge, 0, 0, &[joined, 0], &last.place),
            Inst::new(Op::BranchConditional, 0, 0, &[last.rest[0], targets[0], targets[1]], &last.place),
        ];
        code.blocks.insert(block + 1, new_block(joined, join));
        code.blocks.insert(block + 1, new_block(again, body));
        return Some(());
    }
    None
}

/// Whether a selection is left for nothing but its merge block and, where they are allowed, the
/// merge blocks and continue targets of loops.
fn is_closed(function: &Function, graph: &Graph, block: usize, merge: u32, loops: bool) -> bool {
    let (_, exits) = graph.construct(function, block, merge);
    exits.iter().all(|label| *label == merge || (loops && graph.loop_exits.contains(label)))
}

/// `if (c)` as `switch (c ? 1 : 0)`.
pub fn switch_for_branch(module: &mut Module, rng: &mut Rng) -> Option<()> {
    for (function, block) in selections(module, rng) {
        let code = &module.functions[function];
        let graph = Graph::of(code);
        let merge = code.blocks[block].merge()?.rest[0];
        let last = code.blocks[block].terminator().clone();
        let [condition, yes, no] = [last.rest[0], last.rest[1], last.rest[2]];
        let leaves = |label: u32| label != merge && graph.loop_exits.contains(&label);
        // Cases must not run into each other here.
        let alone = |label: u32| label == merge || graph.predecessors[graph.at[&label]] == [block];
        if !is_closed(code, &graph, block, merge, true)
            || leaves(yes)
            || leaves(no)
            || !alone(yes)
            || !alone(no)
        {
            continue;
        }
        let uint = module.uint();
        let (zero, one) = (module.number(0), module.number(1));
        let selector = module.fresh();
        let (default, case) = if rng.one_in(2) { (no, [1, yes]) } else { (yes, [0, no]) };
        let body = &mut module.functions[function].blocks[block].body;
        body.pop();
        let at = body.len() - 1;
        body.insert(at, Inst::new(Op::Select, uint, selector, &[condition, one, zero], &last.place));
        let switch = [&[selector, default], &case[..]].concat();
        body.push(Inst::new(Op::Switch, 0, 0, &switch, &last.place));
        return Some(());
    }
    None
}

/// `if (c) A else B` as `if (!c) B else A`.
pub fn negated_branch(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let sites = super::places::choose(module, rng, |inst| inst.op == Op::BranchConditional);
    let (function, block, at) = *sites.first()?;
    let (bool, not) = (module.bool(), module.fresh());
    let code = &mut module.functions[function].blocks[block];
    let (tail, last) = (code.tail(), code.body[at].clone());
    let [condition, yes, no] = [last.rest[0], last.rest[1], last.rest[2]];
    code.body[at] = Inst::new(Op::BranchConditional, 0, 0, &[not, no, yes], &last.place);
    code.body.insert(tail, Inst::new(Op::LogicalNot, bool, not, &[condition], &last.place));
    Some(())
}

/// A whole selection as the body of a loop that turns once.
pub fn loop_around_selection(module: &mut Module, rng: &mut Rng) -> Option<()> {
    for (function, block) in selections(module, rng) {
        let code = &module.functions[function];
        let graph = Graph::of(code);
        let merge = code.blocks[block].merge()?.rest[0];
        let merge_at = graph.at[&merge];
        let loops = code.blocks[merge_at].merge().is_some_and(|merge| merge.op == Op::LoopMerge);
        let tail = code.blocks[block].tail();
        let start = code.blocks[merge_at].start();
        if loops
            || graph.continues.contains(&merge)
            || !graph.is_reachable(merge_at)
            || !can_cut(&code.blocks[merge_at], start)
            || !can_cut(&code.blocks[block], tail)
            || !is_closed(code, &graph, block, merge, false)
        {
            continue;
        }
        let place = code.blocks[block].terminator().place.clone();
        let (head, next, bool) = (module.fresh(), module.fresh(), module.bool());
        // Behind the merge block's phis the loop ends.
        let after = cut(module, function, merge_at, start);
        module.functions[function].blocks[merge_at].map_successors(|_| next);
        let mut code = Code::new(module, &place);
        let condition = if rng.one_in(2) {
            module.global(Op::ConstantFalse, bool, &[])
        } else {
            let truth = code.truth(module, rng);
            code.op(module, Op::LogicalNot, bool, &[truth])
        };
        code.run(Op::BranchConditional, &[condition, head, after]);
        module.functions[function].blocks.insert(merge_at + 1, new_block(next, code.out));
        let tail = module.functions[function].blocks[block].tail();
        let inner = cut(module, function, block, tail);
        let body = vec![
            Inst::new(Op::LoopMerge, 0, 0, &[after, next, 0], &place),
            Inst::new(Op::Branch, 0, 0, &[inner], &place),
        ];
        let blocks = &mut module.functions[function].blocks;
        blocks[block].map_successors(|_| head);
        blocks.insert(block + 1, new_block(head, body));
        blocks[0].body.splice(0..0, code.variables);
        return Some(());
    }
    None
}
