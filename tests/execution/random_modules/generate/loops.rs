//! Loops at random: left at their header, at their end or from within, with phis that take from
//! each other and continue constructs that do work.

use rspirv::spirv::Op;

use super::super::generate::{Around, Generator};
use super::super::module::{Body, End, Id, Inst, Loop, Node, Ty};

/// Where a loop asks whether to go on.
#[derive(Clone, Copy, PartialEq)]
enum Asks {
    Header,
    Body,
    End,
}

impl Generator {
    /// A loop of at most four rounds.
    pub(super) fn repeat(&mut self) -> Option<End> {
        self.count("loop");
        if self.times > 1 {
            self.count("loop in a loop");
        }
        let asks = self.random.pick(&[Asks::Header, Asks::Header, Asks::Body, Asks::End]);
        // Where the number of rounds is fixed, all invocations turn together.
        let uniform = self.uniform && self.random.chance(1, 2);
        let ints: Vec<Ty> = self.scalars.iter().copied().filter(|&ty| self.module.is_int(ty)).collect();
        let counter = self.random.pick(&ints);
        let limit = if uniform || self.random.chance(1, 2) {
            let rounds = 1 + self.random.below(4) as u64;
            self.splat(counter, rounds)
        } else {
            let value = self.value(counter, 1);
            let three = self.splat(counter, 3);
            self.inst(Op::BitwiseAnd, counter, &[value, three])
        };
        let zero = self.splat(counter, 0);
        let mut types = vec![counter];
        for _ in 0..self.random.below(4) {
            let ty = self.any_type();
            types.push(ty);
            // Another one of the type, so that they can swap.
            if self.random.chance(1, 2) {
                types.push(ty);
            }
        }
        let mut start = vec![zero];
        for &ty in &types[1..] {
            let value = self.value(ty, 1);
            start.push(value);
        }
        let phis = self.phis(&types);
        let leave_types = self.phi_types();
        let next_types = self.phi_types();
        let merge_phis = self.phis(&leave_types);
        let continue_phis = self.phis(&next_types);

        let was_uniform = std::mem::replace(&mut self.uniform, uniform);
        let times = self.times;
        self.times *= 3;
        let outer = std::mem::take(&mut self.nodes);
        self.know_phis(&phis);
        // The header: few instructions, and no branches.
        for _ in 0..self.random.below(2) {
            let ty = self.draw_scalar();
            let (a, b) = (self.value(ty, 0), self.value(ty, 0));
            if self.module.is_int(ty) {
                self.inst(Op::IAdd, ty, &[a, b]);
            }
        }
        let round = phis[0].id;
        let more = |it: &mut Self, round: Id| {
            let op = it.random.pick(&[Op::ULessThan, Op::SLessThan]);
            it.inst(op, Ty(2), &[round, limit])
        };
        let condition = (asks == Asks::Header).then(|| more(self, round));
        let exit = if asks == Asks::Header { self.carried(&leave_types) } else { Vec::new() };
        let header: Vec<Inst> = std::mem::take(&mut self.nodes).into_iter().filter_map(as_inst).collect();
        let after_header = self.pool.len();
        let places = self.places.len();

        // The body.
        // Nobody leaves a loop in which all turn together.
        let around = Around {
            in_loop: (!uniform).then(|| (leave_types.clone(), next_types.clone())),
            in_switch: None,
            stays: uniform || self.around.stays,
        };
        let around = std::mem::replace(&mut self.around, around);
        if asks == Asks::Body {
            let goes_on = more(self, round);
            let leave = Body { nodes: Vec::new(), end: End::Break(self.carried(&leave_types)) };
            let stay = Body { nodes: Vec::new(), end: End::Fall(Vec::new()) };
            self.nodes.push(Node::If { condition: goes_on, arms: [stay, leave], phis: Vec::new() });
        }
        let before = std::mem::take(&mut self.nodes);
        let budget = 1 + self.random.below(4);
        let mut body = self.body(budget, &mut |it| End::Fall(it.carried(&next_types)));
        body.nodes.splice(0..0, before);
        self.around = around;
        self.pool.truncate(after_header);
        self.places.truncate(places);

        // The continue construct.
        self.know_phis(&continue_phis);
        self.uniform = false;
        let continuing = self.without_around(|it| it.continue_construct());
        self.uniform = uniform;
        let outer_nodes = std::mem::replace(&mut self.nodes, continuing);
        let one = self.splat(counter, 1);
        let next_round = self.inst(Op::IAdd, counter, &[round, one]);
        let mut next = vec![next_round];
        for at in 1..types.len() {
            let others: Vec<Id> = (1..types.len())
                .filter(|&other| other != at && types[other] == types[at])
                .map(|other| phis[other].id)
                .collect();
            next.push(if !others.is_empty() && self.random.chance(1, 2) {
                self.count("phis that swap");
                self.random.pick(&others)
            } else {
                self.value(types[at], 1)
            });
        }
        let again = (asks == Asks::End).then(|| {
            let condition = more(self, next_round);
            (condition, self.carried(&leave_types))
        });
        let continuing = std::mem::replace(&mut self.nodes, outer_nodes);
        self.pool.truncate(after_header);
        self.places.truncate(places);
        self.times = times;
        self.nodes = outer;
        let returns = leaves_function(&body);
        self.uniform = was_uniform && !returns;
        self.nodes.push(Node::Loop(Box::new(Loop {
            phis,
            start,
            header,
            condition,
            exit,
            body,
            continue_phis,
            continuing,
            next,
            again,
            merge_phis: merge_phis.clone(),
        })));
        // What the header knows is known behind the loop.
        self.know_phis(&merge_phis);
        None
    }

    fn continue_construct(&mut self) -> Vec<Node> {
        let outer = std::mem::take(&mut self.nodes);
        let pool = self.pool.len();
        if self.random.chance(1, 2) {
            self.count("continue construct that does work");
            for _ in 0..1 + self.random.below(2) {
                // Neither loops nor ways out: those belong to the body.
                match self.random.below(4) {
                    0 => {
                        let ty = self.any_type();
                        self.make(ty, 1);
                    }
                    _ => self.plain_statement(),
                }
            }
        }
        // What is computed here stays known up to the back edge.
        let _ = pool;
        std::mem::replace(&mut self.nodes, outer)
    }
}

fn as_inst(node: Node) -> Option<Inst> {
    match node {
        Node::Inst(inst) => Some(inst),
        _ => None,
    }
}

/// Whether some way leads from within a body out of the function.
fn leaves_function(body: &Body) -> bool {
    matches!(body.end, End::Return(_))
        || body.nodes.iter().any(|node| match node {
            Node::Inst(_) => false,
            Node::If { arms, .. } => arms.iter().any(leaves_function),
            Node::Switch { cases, .. } => cases.iter().any(|case| leaves_function(&case.body)),
            Node::Loop(it) => leaves_function(&it.body),
        })
}
