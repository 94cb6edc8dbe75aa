//! Statements at random: stores, copies, calls, branches.

use rspirv::spirv::{Op, StorageClass};

use super::super::generate::{COST, Generator, Parameter, Place, Signature};
use super::super::module::{Body, Case, End, Id, Node, Operand, Phi, Ty, Type};

impl Generator {
    /// Draws statements into the open body; how it ends, where it does before its last.
    pub(super) fn statements(&mut self, budget: usize) -> Option<End> {
        for _ in 0..budget {
            if self.cost > COST {
                return None;
            }
            if let Some(end) = self.statement() {
                return Some(end);
            }
        }
        None
    }

    fn statement(&mut self) -> Option<End> {
        let roll = self.random.below(40);
        let branches = self.depth < 3 && (!self.straight || self.random.chance(1, 8));
        match roll {
            0..5 => {
                let ty = self.any_type();
                self.make(ty, 2);
            }
            5..10 => self.store(),
            10..12 => self.update(),
            12..14 => self.copy_memory(),
            14..20 => self.call(),
            20..24 if branches => return self.branch(),
            24..27 if branches => return self.switch(),
            27..31 if branches && self.times < 30 => return self.repeat(),
            31 => {
                let slot = self.random.below(2) as u32;
                let value = self.value(Ty(1), 2);
                self.out(slot, value);
            }
            32 => self.shared_atomic(),
            33 | 34 => self.own_atomic(),
            35 | 36 if self.uniform => self.subgroup_instruction(),
            37 | 38 if self.uniform => self.exchange(),
            38 => self.pointers(),
            20..24 => self.call(),
            24..31 => self.update(),
            _ => {
                let ty = self.any_type();
                if self.times == 1 && self.depth == 0 && self.random.chance(1, 2) {
                    self.local(ty);
                } else {
                    self.make(ty, 1);
                }
            }
        }
        None
    }

    /// A statement without control flow.
    pub(super) fn plain_statement(&mut self) {
        match self.random.below(8) {
            0..3 => self.store(),
            3 | 4 => self.update(),
            5 => self.copy_memory(),
            6 => self.call(),
            _ => self.own_atomic(),
        }
    }

    /// Any place and any part of it.
    fn any_part(&mut self) -> Option<(Place, Vec<u32>)> {
        if self.places.is_empty() {
            return None;
        }
        let at = self.random.below(self.places.len());
        let place = self.places[at];
        let paths = self.module.paths(place.to, &|_| true);
        let path = paths[self.random.below(paths.len())].clone();
        Some((place, path))
    }

    pub(super) fn store(&mut self) {
        let Some((place, path)) = self.any_part() else { return };
        let ty = self.module.at_path(place.to, &path);
        // The value often needs the place itself, as `x = x + x` does.
        if self.random.chance(1, 3) {
            let pointer = self.chain(place, &path);
            self.load(pointer, place.class, ty);
        }
        let value = self.value(ty, 2);
        let pointer = self.chain(place, &path);
        let mut operands = vec![Operand::Id(pointer), Operand::Id(value)];
        operands.extend(self.aligned(place.class, ty));
        self.effect(Op::Store, operands);
        self.count("store");
    }

    /// A place combined with itself, read more than once.
    fn update(&mut self) {
        if self.places.is_empty() {
            return;
        }
        // Parameters more often than not: the last places are the innermost.
        let at = self.random.below(self.places.len()).max(self.random.below(self.places.len()));
        let place = self.places[at];
        let module = &self.module;
        let paths = module.paths(place.to, &|part| module.is_int(part) || module.is_float(part));
        if paths.is_empty() {
            return self.store();
        }
        let path = paths[self.random.below(paths.len())].clone();
        let ty = self.module.at_path(place.to, &path);
        self.count("update");
        let pointer = self.chain(place, &path);
        let a = self.load(pointer, place.class, ty);
        let b = match self.random.below(3) {
            0 => self.value(ty, 1),
            1 => self.load(pointer, place.class, ty),
            _ => {
                let other = self.chain(place, &path);
                self.load(other, place.class, ty)
            }
        };
        let result = if self.module.is_int(ty) {
            let op = self.random.pick(&[Op::IAdd, Op::IAdd, Op::IMul, Op::BitwiseXor, Op::ISub]);
            self.inst(op, ty, &[a, b])
        } else {
            let op = self.random.pick(&[Op::FAdd, Op::FMul, Op::FSub]);
            self.rounding(op, ty, &[a, b])
        };
        let pointer = if self.random.chance(1, 2) { pointer } else { self.chain(place, &path) };
        let mut operands = vec![Operand::Id(pointer), Operand::Id(result)];
        operands.extend(self.aligned(place.class, ty));
        self.effect(Op::Store, operands);
    }

    fn copy_memory(&mut self) {
        let Some((to, path)) = self.any_part() else { return };
        let ty = self.module.at_path(to.to, &path);
        // Source and target do not overlap: they belong to different objects, and parameters to
        // none.
        let known = to.object;
        let apart = move |place: &Place| place.object != known && place.object != 0 && known != 0;
        let aliased = |place: &Place| place.class != to.class || matches!(place.class, StorageClass::Private);
        let Some((from, from_path)) = self
            .place_of(ty, &|place| apart(place) && (aliased(place) || to.class == StorageClass::Function))
        else {
            return self.store();
        };
        let target = self.chain(to, &path);
        let source = self.chain(from, &from_path);
        let class = if from.class == StorageClass::PhysicalStorageBuffer { from.class } else { to.class };
        let mut operands = vec![Operand::Id(target), Operand::Id(source)];
        operands.extend(self.aligned(class, ty));
        self.effect(Op::CopyMemory, operands);
        self.count("copy memory");
    }

    fn affordable(&self, signature: &Signature) -> bool {
        self.cost + signature.cost * self.times < 2 * COST
    }

    fn call(&mut self) {
        let signatures: Vec<Signature> =
            self.callable.iter().filter(|it| self.affordable(it)).cloned().collect();
        if signatures.is_empty() {
            return self.store();
        }
        let signature = signatures[self.random.below(signatures.len())].clone();
        let pointers = self.pointer_arguments(&signature);
        self.call_with(&signature, &pointers);
        // A function is called again, on the same variables or on others.
        while self.random.chance(1, 2) && self.affordable(&signature) {
            self.count("call again");
            let others =
                if self.random.chance(2, 3) { pointers.clone() } else { self.pointer_arguments(&signature) };
            self.call_with(&signature, &others);
        }
    }

    /// The result of a call.
    pub(super) fn call_of(&mut self, ty: Ty) -> Option<Id> {
        let found: Vec<Signature> =
            self.callable.iter().filter(|it| it.result == ty && self.affordable(it)).cloned().collect();
        if found.is_empty() {
            return None;
        }
        let signature = found[self.random.below(found.len())].clone();
        let pointers = self.pointer_arguments(&signature);
        Some(self.call_with(&signature, &pointers))
    }

    /// Pointers to objects that are not the same, unless the function allows it.
    fn pointer_arguments(&mut self, signature: &Signature) -> Vec<Id> {
        let mut used: Vec<Id> = Vec::new();
        let mut found = Vec::new();
        for parameter in &signature.parameters {
            let Parameter::Pointer(class, to) = *parameter else { continue };
            let free = |place: &Place| {
                place.class == class
                    && (signature.aliased || class != StorageClass::Function || !used.contains(&place.object))
            };
            // With logical addressing a pointer to a variable's part is no argument, but for
            // variable pointers.
            let parts = self.module.physical
                || matches!(class, StorageClass::StorageBuffer | StorageClass::Workgroup);
            let whole = |place: &Place| free(place) && place.to == to;
            let part = if parts && self.random.chance(1, 2) { self.place_of(to, &free) } else { None };
            let (place, path) = match part.or_else(|| self.place_of(to, &whole).filter(|it| it.1.is_empty()))
            {
                Some(found) => found,
                None if class == StorageClass::Function => (self.local(to), Vec::new()),
                None => {
                    // There is none in this function's scope: a global one, or a new pointer to it.
                    (self.new_place(class, to), Vec::new())
                }
            };
            used.push(place.object);
            let pointer = self.chain(place, &path);
            found.push(pointer);
        }
        found
    }

    fn new_place(&mut self, class: StorageClass, to: Ty) -> Place {
        let place = match class {
            StorageClass::Workgroup => {
                let variables: Vec<Id> =
                    self.workgroup.iter().filter(|it| it.1 == to).map(|it| it.0).collect();
                let variable = self.random.pick(&variables);
                let pointer = self.module.pointer(class, to);
                let local_index = self.local_index;
                Place {
                    id: self.inst(Op::AccessChain, pointer, &[variable, local_index]),
                    class,
                    to,
                    object: variable,
                }
            }
            StorageClass::StorageBuffer => {
                let (variable, _) = self.own.expect("a buffer");
                let pointer = self.module.pointer(class, to);
                let (zero, own_index) = (self.word(0), self.own_index);
                Place {
                    id: self.inst(Op::AccessChain, pointer, &[variable, zero, own_index]),
                    class,
                    to,
                    object: variable,
                }
            }
            StorageClass::PhysicalStorageBuffer => {
                let (element, size) = self.physical.expect("a buffer");
                self.physical_place(element, size);
                return *self.places.last().expect("a place");
            }
            _ => unreachable!("private variables are in scope everywhere"),
        };
        self.places.push(place);
        place
    }

    fn call_with(&mut self, signature: &Signature, pointers: &[Id]) -> Id {
        self.count("call");
        if self.times > 1 {
            self.count("call in a loop");
        }
        let mut operands = vec![signature.id];
        let mut pointers = pointers.iter();
        for parameter in &signature.parameters {
            operands.push(match *parameter {
                Parameter::Value(ty) => self.value(ty, 1),
                Parameter::Pointer(..) => *pointers.next().expect("an argument"),
            });
        }
        if signature.parameters.iter().any(|it| matches!(it, Parameter::Pointer(_, to) if matches!(self.module.at(*to), Type::Struct { .. }))) {
            self.count("call with a pointer to a struct");
        }
        if signature.parameters.iter().any(
            |it| matches!(it, Parameter::Value(to) if matches!(self.module.at(*to), Type::Struct { .. })),
        ) {
            self.count("call with a struct");
        }
        self.cost += signature.cost * self.times;
        self.inst(Op::FunctionCall, signature.result, &operands)
    }

    /// Draws a body in a scope of its own.
    pub(super) fn body(&mut self, budget: usize, end: &mut dyn FnMut(&mut Self) -> End) -> Body {
        let outer = std::mem::take(&mut self.nodes);
        let (pool, places) = (self.pool.len(), self.places.len());
        self.depth += 1;
        let end = match self.statements(budget) {
            Some(end) => end,
            None => end(self),
        };
        self.depth -= 1;
        self.pool.truncate(pool);
        self.places.truncate(places);
        Body { nodes: std::mem::replace(&mut self.nodes, outer), end }
    }

    /// The types of a merge block's phis.
    pub(super) fn phi_types(&mut self) -> Vec<Ty> {
        (0..self.random.pick(&[0, 0, 1, 1, 2, 3])).map(|_| self.any_type()).collect()
    }

    pub(super) fn phis(&mut self, types: &[Ty]) -> Vec<Phi> {
        types.iter().map(|&ty| Phi { id: self.module.id(Some(ty)), ty }).collect()
    }

    pub(super) fn know_phis(&mut self, phis: &[Phi]) {
        for phi in phis {
            self.know(phi.ty, phi.id);
        }
        if !phis.is_empty() {
            self.count("phi");
        }
    }

    /// What an edge carries: values in scope as a rule, so that phis take from phis.
    pub(super) fn carried(&mut self, types: &[Ty]) -> Vec<Id> {
        types.iter().map(|&ty| self.value(ty, 0)).collect()
    }

    /// The end of an arm: it falls, or leaves what is around.
    fn arm_end(&mut self, types: &[Ty]) -> End {
        if self.random.chance(2, 5)
            && let Some(end) = self.leaving()
        {
            return end;
        }
        End::Fall(self.carried(types))
    }

    /// A way out of the loop, the switch or the function.
    fn leaving(&mut self) -> Option<End> {
        let around = self.around.clone();
        // In a loop or a branch that all take alike nobody goes another way.
        if self.uniform {
            return None;
        }
        match self.random.below(6) {
            0 | 1 => around.in_loop.map(|(leave, _)| {
                self.count("break");
                End::Break(self.carried(&leave))
            }),
            2 | 3 => around.in_loop.map(|(_, next)| {
                self.count("continue");
                End::Continue(self.carried(&next))
            }),
            4 => around.in_switch.map(|types| {
                self.count("leave switch");
                End::LeaveSwitch(self.carried(&types))
            }),
            // The entry point ends at its end, where its values are told; one in eight times
            // before.
            _ if !around.stays && (!self.entry || self.random.chance(1, 8)) => {
                self.count(if self.times > 1 { "return in a loop" } else { "early return" });
                Some(self.return_end())
            }
            _ => None,
        }
    }

    pub(super) fn return_end(&mut self) -> End {
        let result = self.result;
        End::Return((result != Ty(0)).then(|| self.value(result, 1)))
    }

    /// A condition, and whether all invocations of a workgroup find the same.
    pub(super) fn condition(&mut self) -> (Id, bool) {
        if self.uniform && self.random.chance(1, 3) {
            let at = 2 + self.random.below(2) as u32;
            let word = self.head_word(at);
            let bit = 1 << self.random.below(3);
            let bit = self.word(bit);
            let masked = self.inst(Op::BitwiseAnd, Ty(1), &[word, bit]);
            let zero = self.word(0);
            return (self.inst(Op::IEqual, Ty(2), &[masked, zero]), true);
        }
        (self.value(Ty(2), 2), false)
    }

    fn branch(&mut self) -> Option<End> {
        self.count("branch");
        let (condition, uniform) = self.condition();
        let was_uniform = self.uniform;
        self.uniform &= uniform;
        let types = self.phi_types();
        let phis = self.phis(&types);
        let budgets = [1 + self.random.below(3), self.random.below(3)];
        let mut arms = budgets.map(|budget| self.body(budget, &mut |it| it.arm_end(&types)));
        if self.random.chance(1, 2) {
            arms.reverse();
        }
        // Whoever left does not come along behind.
        let leaves = arms.iter().any(|arm| !matches!(arm.end, End::Fall(_))) || self.has_left(&arms);
        self.uniform = was_uniform && !leaves;
        let open = arms.iter().any(|arm| matches!(arm.end, End::Fall(_)));
        self.nodes.push(Node::If { condition, arms, phis: phis.clone() });
        if !open {
            self.count("unreachable merge block");
            return Some(End::Unreachable);
        }
        self.know_phis(&phis);
        None
    }

    /// Whether some of the invocations leave from within.
    fn has_left(&self, bodies: &[Body]) -> bool {
        bodies.iter().any(|body| {
            body.nodes.iter().any(|node| match node {
                Node::Inst(_) => false,
                Node::If { arms, .. } => {
                    arms.iter().any(|arm| !matches!(arm.end, End::Fall(_))) || self.has_left(arms)
                }
                Node::Switch { cases, .. } => cases.iter().any(|case| {
                    matches!(case.body.end, End::Break(_) | End::Continue(_) | End::Return(_))
                        || self.has_left(std::slice::from_ref(&case.body))
                }),
                // What leaves a loop within stays here, unless it returns.
                Node::Loop(it) => self.has_left(std::slice::from_ref(&it.body)),
            })
        })
    }

    fn switch(&mut self) -> Option<End> {
        self.count("switch");
        let was_uniform = std::mem::replace(&mut self.uniform, false);
        let ints: Vec<Ty> = self.scalars.iter().copied().filter(|&ty| self.module.is_int(ty)).collect();
        let ty = self.random.pick(&ints);
        if self.module.width(ty) != 32 {
            self.count("switch on another width");
        }
        let selector = self.value(ty, 1);
        let range = self.random.pick(&[3, 7]);
        let mask = self.splat(ty, range);
        let selector = if self.random.chance(1, 6) {
            selector
        } else {
            self.inst(Op::BitwiseAnd, ty, &[selector, mask])
        };
        let types = self.phi_types();
        let phis = self.phis(&types);
        let count = 2 + self.random.below(3);
        let mut values: Vec<u64> = (0..=range).collect();
        let edge = u64::MAX >> (64 - self.module.width(ty));
        values.push(edge);
        let case_types: Vec<Vec<Ty>> = (0..count)
            .map(|at| if at > 0 && self.random.chance(1, 2) { self.phi_types() } else { Vec::new() })
            .collect();
        let arguments: Vec<Vec<Id>> = case_types.iter().map(|types| self.carried(types)).collect();
        let outer = self.around.in_switch.replace(types.clone());
        let mut cases = Vec::new();
        for at in 0..count {
            let last = at + 1 == count;
            let mut literals = Vec::new();
            let wanted = if last { self.random.below(2) } else { 1 + self.random.below(2) };
            for _ in 0..wanted {
                if values.is_empty() {
                    break;
                }
                let which = self.random.below(values.len());
                let value = values.swap_remove(which);
                literals.push(super::super::emit::literal(self.module.at(ty), value));
            }
            let case_phis = self.phis(&case_types[at]);
            let pool = self.pool.len();
            self.know_phis(&case_phis);
            let falls = !last && self.random.chance(1, 3);
            let next = case_types.get(at + 1).cloned().unwrap_or_default();
            let budget = self.random.below(3);
            let body = self.body(budget, &mut |it| {
                if falls {
                    it.count("falls through");
                    End::FallThrough(it.carried(&next))
                } else {
                    it.arm_end(&types)
                }
            });
            self.pool.truncate(pool);
            cases.push(Case { literals, arguments: arguments[at].clone(), phis: case_phis, body });
        }
        self.around.in_switch = outer;
        let open = cases.iter().any(|case| {
            matches!(case.body.end, End::Fall(_) | End::LeaveSwitch(_)) || leaves_switch(&case.body)
        });
        let bodies: Vec<Body> = cases.iter().map(|case| case.body.clone()).collect();
        let left =
            bodies.iter().any(|body| matches!(body.end, End::Break(_) | End::Continue(_) | End::Return(_)));
        self.uniform = was_uniform && !left && !self.has_left(&bodies);
        self.nodes.push(Node::Switch { selector, cases, phis: phis.clone() });
        if !open {
            self.count("unreachable merge block");
            return Some(End::Unreachable);
        }
        self.know_phis(&phis);
        None
    }

    /// Draws what may not leave.
    pub(super) fn without_around<T>(&mut self, draw: impl FnOnce(&mut Self) -> T) -> T {
        let around = std::mem::take(&mut self.around);
        let result = draw(self);
        self.around = around;
        result
    }

    /// A pointer that a condition chooses, where pointers are variable.
    fn pointers(&mut self) {
        let classes =
            [StorageClass::StorageBuffer, StorageClass::Workgroup, StorageClass::PhysicalStorageBuffer];
        let candidates: Vec<Place> =
            self.places.iter().copied().filter(|place| classes.contains(&place.class)).collect();
        if candidates.is_empty() {
            return self.store();
        }
        let place = self.random.pick(&candidates);
        let module = &self.module;
        // Not into matrices: a pointer does not tell how they lie.
        let paths = module.paths(place.to, &|part| {
            module.is_scalar(part) || matches!(module.at(part), Type::Struct { .. })
        });
        let paths: Vec<Vec<u32>> = paths
            .into_iter()
            .filter(|path| {
                (0..path.len())
                    .all(|end| !matches!(module.at(module.at_path(place.to, &path[..end])), Type::Matrix(..)))
            })
            .collect();
        let Some(path) = (!paths.is_empty()).then(|| paths[self.random.below(paths.len())].clone()) else {
            return;
        };
        let ty = self.module.at_path(place.to, &path);
        self.count("chosen pointer");
        let (yes, no) = (self.chain(place, &path), self.chain(place, &path));
        let condition = self.value(Ty(2), 1);
        let pointer = self.module.pointer(place.class, ty);
        let id = self.inst(Op::Select, pointer, &[condition, yes, no]);
        self.places.push(Place { id, class: place.class, to: ty, object: 0 });
    }
}

/// Whether some way leads from within a body to the merge block of the switch around it.
fn leaves_switch(body: &Body) -> bool {
    matches!(body.end, End::LeaveSwitch(_))
        || body.nodes.iter().any(|node| match node {
            Node::If { arms, .. } => arms.iter().any(leaves_switch),
            _ => false,
        })
}
