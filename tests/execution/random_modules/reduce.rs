//! Makes a failing module small: leaves nodes out, takes arms for branches, and puts a value that
//! is there already, or nought, in another's place, for as long as the module still fails.

use std::collections::{HashMap, HashSet};

use super::generate::Generated;
use super::module::{Body, ConstantKind, End, Id, Inst, Module, Node, Operand, Type, Visit};

/// Trials that a reduction may take.
const TRIALS: usize = 6000;

/// The smallest module found that still fails.
pub fn reduce(whole: &Generated, fails: &mut dyn FnMut(&Generated) -> bool) -> Generated {
    let mut best = whole.clone();
    let mut trials = 0;
    loop {
        let mut better = false;
        for step in [
            Step::Node,
            Step::Arm(0),
            Step::Arm(1),
            Step::Case,
            Step::Once,
            Step::Phi,
            Step::Stay,
            Step::Value(0),
            Step::Value(1),
            Step::Value(2),
        ] {
            let mut at = 0;
            while trials < TRIALS {
                let mut smaller = best.clone();
                let Some(sound) = change(&mut smaller.module, step, at) else { break };
                trials += 1;
                if sound && fails(&smaller) {
                    best = smaller;
                    better = true;
                } else {
                    at += 1;
                }
            }
        }
        if !better || trials >= TRIALS {
            return best;
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Step {
    /// A node goes.
    Node,
    /// A branch becomes one of its arms.
    Arm(usize),
    /// A case of a switch goes.
    Case,
    /// A loop becomes one round of it.
    Once,
    /// A phi goes.
    Phi,
    /// An arm that leaves falls instead.
    Stay,
    /// A result becomes an operand of its type.
    Value(usize),
}

/// Makes the n-th change of a kind; `None` where there are no more, false where it cannot be.
fn change(module: &mut Module, step: Step, at: usize) -> Option<bool> {
    let live = module.used();
    let mut functions = std::mem::take(&mut module.functions);
    let mut changer = Changer { module, step, left: at, done: false, instead: HashMap::new() };
    for function in functions.iter_mut().rev().filter(|function| live.contains(&function.id)) {
        changer.body(&mut function.body);
        if changer.done {
            break;
        }
    }
    let Changer { done, instead, .. } = changer;
    module.functions = functions;
    done.then(|| settle(module, instead))
}

struct Changer<'a> {
    module: &'a Module,
    step: Step,
    left: usize,
    done: bool,
    /// What stands for results that are gone.
    instead: HashMap<Id, Id>,
}

impl Changer<'_> {
    /// Whether it is this place's turn.
    fn turn(&mut self) -> bool {
        if self.done {
            return false;
        }
        self.done = self.left == 0;
        self.left = self.left.saturating_sub(1);
        self.done
    }

    fn body(&mut self, body: &mut Body) {
        let mut end = Some(&mut body.end);
        self.nodes(&mut body.nodes, &mut end);
    }

    fn nodes(&mut self, nodes: &mut Vec<Node>, end: &mut Option<&mut End>) {
        // Backwards: uses go before what they use.
        for at in (0..nodes.len()).rev() {
            if self.done {
                return;
            }
            self.node(nodes, at, end);
        }
    }

    fn node(&mut self, nodes: &mut Vec<Node>, at: usize, end: &mut Option<&mut End>) {
        match (self.step, &mut nodes[at]) {
            (Step::Node, _) if self.turn() => {
                nodes.remove(at);
                return;
            }
            (Step::Value(which), Node::Inst(inst)) => {
                if let Some(other) = self.same(inst, which)
                    && self.turn()
                {
                    self.instead.insert(inst.id, other);
                    nodes.remove(at);
                    return;
                }
            }
            (Step::Arm(which), Node::If { .. }) if self.turn() => {
                let Node::If { mut arms, phis, .. } = nodes.remove(at) else { unreachable!("a branch") };
                let arm =
                    std::mem::replace(&mut arms[which], Body { nodes: Vec::new(), end: End::Unreachable });
                if let End::Fall(ids) = &arm.end {
                    self.instead.extend(phis.iter().map(|phi| phi.id).zip(ids.iter().copied()));
                    nodes.splice(at..at, arm.nodes);
                } else if let Some(end) = end {
                    nodes.truncate(at);
                    nodes.extend(arm.nodes);
                    **end = arm.end;
                }
                return;
            }
            (Step::Case, Node::Switch { cases, .. }) => {
                for case in 0..cases.len() - 1 {
                    let reached = case > 0 && matches!(cases[case - 1].body.end, End::FallThrough(_));
                    let falls = matches!(cases[case].body.end, End::FallThrough(_));
                    if !reached && !falls && self.turn() {
                        cases.remove(case);
                        return;
                    }
                }
            }
            (Step::Once, Node::Loop(it)) => {
                let End::Fall(ids) = it.body.end.clone() else { return self.inside(&mut nodes[at]) };
                if !leaves_loop(&it.body.nodes) && self.turn() {
                    let it = it.clone();
                    self.instead.extend(it.phis.iter().map(|phi| phi.id).zip(it.start));
                    self.instead.extend(it.continue_phis.iter().map(|phi| phi.id).zip(ids));
                    let leaves = it.again.map_or(it.exit, |again| again.1);
                    self.instead.extend(it.merge_phis.iter().map(|phi| phi.id).zip(leaves));
                    let mut inside: Vec<Node> = it.header.into_iter().map(Node::Inst).collect();
                    inside.extend(it.body.nodes);
                    inside.extend(it.continuing);
                    nodes.splice(at..=at, inside);
                    return;
                }
            }
            (Step::Phi, Node::Loop(it)) => {
                for which in 1..it.phis.len() {
                    if self.turn() {
                        self.instead.insert(it.phis[which].id, it.start[which]);
                        it.phis.remove(which);
                        it.start.remove(which);
                        it.next.remove(which);
                        return;
                    }
                }
                for which in 0..it.continue_phis.len() {
                    if self.turn() {
                        it.continue_phis.remove(which);
                        if let End::Fall(ids) | End::Continue(ids) = &mut it.body.end {
                            ids.remove(which);
                        }
                        edges(&mut it.body.nodes, &mut |end| {
                            if let End::Continue(ids) = end {
                                ids.remove(which);
                            }
                        });
                        return;
                    }
                }
                for which in 0..it.merge_phis.len() {
                    if self.turn() {
                        it.merge_phis.remove(which);
                        if it.condition.is_some() {
                            it.exit.remove(which);
                        }
                        if let Some((_, ids)) = &mut it.again {
                            ids.remove(which);
                        }
                        let mut leave = |end: &mut End| {
                            if let End::Break(ids) = end {
                                ids.remove(which);
                            }
                        };
                        leave(&mut it.body.end);
                        edges(&mut it.body.nodes, &mut leave);
                        return;
                    }
                }
            }
            (Step::Phi, Node::If { arms, phis, .. }) => {
                for which in 0..phis.len() {
                    if self.turn() {
                        phis.remove(which);
                        for arm in arms {
                            if let End::Fall(ids) = &mut arm.end {
                                ids.remove(which);
                            }
                        }
                        return;
                    }
                }
            }
            (Step::Stay, Node::If { arms, phis, .. }) => {
                for arm in 0..2 {
                    let other = match &arms[1 - arm].end {
                        End::Fall(ids) => ids.clone(),
                        _ if phis.is_empty() => Vec::new(),
                        _ => continue,
                    };
                    if !matches!(arms[arm].end, End::Fall(_)) && self.turn() {
                        arms[arm].end = End::Fall(other);
                        return;
                    }
                }
            }
            _ => {}
        }
        self.inside(&mut nodes[at]);
    }

    fn inside(&mut self, node: &mut Node) {
        match node {
            Node::Inst(_) => {}
            Node::If { arms, .. } => arms.iter_mut().for_each(|arm| self.body(arm)),
            Node::Switch { cases, .. } => cases.iter_mut().for_each(|case| self.body(&mut case.body)),
            Node::Loop(it) => {
                self.nodes(&mut it.continuing, &mut None);
                self.body(&mut it.body);
                let mut header: Vec<Node> = it.header.drain(..).map(Node::Inst).collect();
                self.nodes(&mut header, &mut None);
                it.header = header
                    .into_iter()
                    .filter_map(|node| if let Node::Inst(inst) = node { Some(inst) } else { None })
                    .collect();
            }
        }
    }

    /// The n-th operand with the result's type.
    fn same(&self, inst: &Inst, which: usize) -> Option<Id> {
        let ty = inst.ty?;
        let mut ids = inst.operands.iter().filter_map(|operand| match operand {
            Operand::Id(id) if self.module.type_of[*id as usize] == Some(ty) => Some(*id),
            _ => None,
        });
        ids.nth(which)
    }
}

/// The ends of bodies that belong to the loop around these nodes.
fn edges(nodes: &mut [Node], visit: &mut dyn FnMut(&mut End)) {
    for node in nodes {
        match node {
            Node::If { arms, .. } => {
                for arm in arms {
                    visit(&mut arm.end);
                    edges(&mut arm.nodes, visit);
                }
            }
            Node::Switch { cases, .. } => {
                for case in cases {
                    visit(&mut case.body.end);
                    edges(&mut case.body.nodes, visit);
                }
            }
            Node::Inst(_) | Node::Loop(_) => {}
        }
    }
}

fn leaves_loop(nodes: &[Node]) -> bool {
    let mut found = false;
    edges(&mut nodes.to_vec(), &mut |end| found |= matches!(end, End::Break(_) | End::Continue(_)));
    found
}

/// Puts what stands for results in their place, and nought for those that are gone; false where a
/// pointer is gone.
fn settle(module: &mut Module, mut instead: HashMap<Id, Id>) -> bool {
    let mut known: HashSet<Id> = module.constants.iter().map(|constant| constant.id).collect();
    known.extend(module.globals.iter().map(|global| global.id));
    known.extend(module.functions.iter().map(|function| function.id));
    known.insert(super::module::GLSL);
    let mut used = HashSet::new();
    for function in &module.functions {
        known.extend(function.parameters.iter().map(|parameter| parameter.0));
        known.extend(function.variables.iter().map(|variable| variable.id));
        Module::visit_body(&function.body, &mut |visit| match visit {
            Visit::Inst(inst) => {
                known.insert(inst.id);
                used.extend(inst.operands.iter().filter_map(|operand| match operand {
                    Operand::Id(id) => Some(*id),
                    Operand::Literal(_) => None,
                }));
            }
            Visit::Uses(ids) => used.extend(ids),
            Visit::Phis(phis) => known.extend(phis.iter().map(|phi| phi.id)),
        });
    }
    let gone: Vec<Id> =
        used.into_iter().chain(instead.values().copied()).filter(|id| !known.contains(id)).collect();
    for id in gone {
        if instead.contains_key(&id) {
            continue;
        }
        let Some(ty) = module.type_of[id as usize] else { return false };
        if matches!(module.at(ty), Type::Pointer(..)) {
            return false;
        }
        let nought = module.constant(ty, ConstantKind::Null);
        instead.insert(id, nought);
    }
    let resolve = |id: Id| {
        let mut id = id;
        for _ in 0..instead.len() {
            match instead.get(&id) {
                Some(&other) => id = other,
                None => break,
            }
        }
        id
    };
    for function in &mut module.functions {
        replace_in(&mut function.body, &resolve);
    }
    true
}

fn replace_in(body: &mut Body, resolve: &dyn Fn(Id) -> Id) {
    replace_in_nodes(&mut body.nodes, resolve);
    match &mut body.end {
        End::Fall(ids)
        | End::FallThrough(ids)
        | End::LeaveSwitch(ids)
        | End::Break(ids)
        | End::Continue(ids) => {
            replace_all(ids, resolve);
        }
        End::Return(Some(id)) => *id = resolve(*id),
        End::Return(None) | End::Unreachable => {}
    }
}

fn replace_all(ids: &mut [Id], resolve: &dyn Fn(Id) -> Id) {
    ids.iter_mut().for_each(|id| *id = resolve(*id));
}

fn replace_in_inst(inst: &mut Inst, resolve: &dyn Fn(Id) -> Id) {
    for operand in &mut inst.operands {
        if let Operand::Id(id) = operand {
            *id = resolve(*id);
        }
    }
}

fn replace_in_nodes(nodes: &mut [Node], resolve: &dyn Fn(Id) -> Id) {
    for node in nodes {
        match node {
            Node::Inst(inst) => replace_in_inst(inst, resolve),
            Node::If { condition, arms, .. } => {
                *condition = resolve(*condition);
                arms.iter_mut().for_each(|arm| replace_in(arm, resolve));
            }
            Node::Switch { selector, cases, .. } => {
                *selector = resolve(*selector);
                for case in cases {
                    replace_all(&mut case.arguments, resolve);
                    replace_in(&mut case.body, resolve);
                }
            }
            Node::Loop(it) => {
                replace_all(&mut it.start, resolve);
                it.header.iter_mut().for_each(|inst| replace_in_inst(inst, resolve));
                if let Some(condition) = &mut it.condition {
                    *condition = resolve(*condition);
                }
                replace_all(&mut it.exit, resolve);
                replace_in(&mut it.body, resolve);
                replace_in_nodes(&mut it.continuing, resolve);
                replace_all(&mut it.next, resolve);
                if let Some((condition, ids)) = &mut it.again {
                    *condition = resolve(*condition);
                    replace_all(ids, resolve);
                }
            }
        }
    }
}
