//! A module's words.

use std::collections::HashSet;

use rspirv::spirv::{
    AddressingModel, BuiltIn, Capability, Decoration, ExecutionMode, ExecutionModel, MemoryModel, Op,
    StorageClass,
};

use super::module::{
    Body, ConstantKind, End, Function, GLSL, Id, Inst, MAIN, Module, Node, Operand, Phi, Ty, Type,
};

/// The words of a module; what nothing uses is left out.
pub fn words(module: &Module) -> Vec<u32> {
    let used = module.used();
    let mut emitter = Emitter { module, words: Vec::with_capacity(4096), next: 0, used };
    // Types are numbered behind the values, labels behind the types.
    emitter.next = module.bound + module.types.len() as u32;
    emitter.module();
    emitter.words[3] = emitter.next;
    emitter.words
}

struct Emitter<'a> {
    module: &'a Module,
    words: Vec<u32>,
    next: Id,
    used: HashSet<Id>,
}

/// Edges of a block: where from, and what they carry.
type Edges = Vec<(Id, Vec<Id>)>;

/// Where the ends of bodies lead.
#[derive(Default)]
struct Targets {
    /// The continue target and the merge block of the innermost loop, the merge block of the
    /// innermost switch, the next case.
    next: Id,
    leave: Id,
    leave_switch: Id,
    through: Id,
    continues: Edges,
    breaks: Edges,
    leaves: Edges,
    falls_through: Edges,
}

fn text(value: &str) -> Vec<u32> {
    let mut bytes = value.as_bytes().to_vec();
    bytes.push(0);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes.chunks(4).map(|part| u32::from_le_bytes(part.try_into().unwrap())).collect()
}

impl Emitter<'_> {
    fn op(&mut self, op: Op, operands: &[u32]) {
        self.words.push((operands.len() as u32 + 1) << 16 | op as u32);
        self.words.extend(operands);
    }

    fn ty(&self, ty: Ty) -> Id {
        self.module.bound + ty.0
    }

    fn label(&mut self) -> Id {
        self.next += 1;
        self.next - 1
    }

    fn module(&mut self) {
        let module = self.module;
        self.words.extend([0x0723_0203, 0x0001_0600, 0, 0, 0]);
        for capability in self.capabilities() {
            self.op(Op::Capability, &[capability as u32]);
        }
        if self.uses(|inst| inst.op == Op::FmaKHR) {
            self.op(Op::Extension, &text("SPV_KHR_fma"));
        }
        self.op(Op::ExtInstImport, &[&[GLSL], &text("GLSL.std.450")[..]].concat());
        let addressing =
            if module.physical { AddressingModel::PhysicalStorageBuffer64 } else { AddressingModel::Logical };
        self.op(Op::MemoryModel, &[addressing as u32, MemoryModel::GLSL450 as u32]);
        let mut entry = vec![ExecutionModel::GLCompute as u32, MAIN];
        entry.extend(text("main"));
        let globals: Vec<_> = module.globals.iter().filter(|global| self.used.contains(&global.id)).collect();
        entry.extend(globals.iter().map(|global| global.id));
        self.op(Op::EntryPoint, &entry);
        self.op(Op::ExecutionMode, &[MAIN, ExecutionMode::LocalSize as u32, module.local_size, 1, 1]);
        let types = self.types();
        for width in [16, 32, 64] {
            if types.iter().any(|&ty| *module.at(ty) == Type::Float { width }) {
                self.op(Op::ExecutionMode, &[MAIN, ExecutionMode::SignedZeroInfNanPreserve as u32, width]);
                self.op(Op::ExecutionMode, &[MAIN, ExecutionMode::DenormPreserve as u32, width]);
            }
        }
        for global in &globals {
            for decoration in &global.decorations {
                self.op(Op::Decorate, &[&[global.id], &decoration[..]].concat());
            }
        }
        for decoration in &module.decorations {
            if self.used.contains(&decoration[0]) || self.is_parameter(decoration[0]) {
                self.op(Op::Decorate, decoration);
            }
        }
        for &ty in &types {
            self.decorate_type(ty);
        }
        // Constants need types, arrays' types need constants.
        let mut lengths = Vec::new();
        for &ty in &types {
            self.declare_type(ty, &mut lengths);
        }
        for constant in &module.constants {
            if !self.used.contains(&constant.id) {
                continue;
            }
            let ty = self.ty(constant.ty);
            match &constant.kind {
                ConstantKind::Bool(true) => self.op(Op::ConstantTrue, &[ty, constant.id]),
                ConstantKind::Bool(false) => self.op(Op::ConstantFalse, &[ty, constant.id]),
                ConstantKind::Null => self.op(Op::ConstantNull, &[ty, constant.id]),
                ConstantKind::Undef => self.op(Op::Undef, &[ty, constant.id]),
                ConstantKind::Composite(parts) => {
                    self.op(Op::ConstantComposite, &[&[ty, constant.id], &parts[..]].concat());
                }
                ConstantKind::Bits(bits) => {
                    let words = literal(module.at(constant.ty), *bits);
                    self.op(Op::Constant, &[&[ty, constant.id], &words[..]].concat());
                }
            }
        }
        for global in &globals {
            self.variable(global.ty, global.id, global.initializer);
        }
        for function in &module.functions {
            if self.used.contains(&function.id) {
                self.function(function);
            }
        }
    }

    fn is_parameter(&self, id: Id) -> bool {
        let live = self.module.functions.iter().filter(|function| self.used.contains(&function.id));
        live.flat_map(|function| &function.parameters).any(|parameter| parameter.0 == id)
    }

    fn uses(&self, wanted: impl Fn(&Inst) -> bool) -> bool {
        let mut found = false;
        for function in self.module.functions.iter().filter(|function| self.used.contains(&function.id)) {
            Module::visit_body(&function.body, &mut |visit| {
                if let super::module::Visit::Inst(inst) = visit {
                    found |= wanted(inst);
                }
            });
        }
        found
    }

    /// The types in use, each behind those that it is made of.
    fn types(&self) -> Vec<Ty> {
        let module = self.module;
        let mut order = Vec::new();
        let mut seen = vec![false; module.types.len()];
        let mut need = |ty: Ty| add_type(module, ty, &mut seen, &mut order);
        need(Ty(0));
        for constant in &module.constants {
            if self.used.contains(&constant.id) {
                need(constant.ty);
            }
        }
        for global in &module.globals {
            if self.used.contains(&global.id) {
                need(global.ty);
            }
        }
        for function in &module.functions {
            if !self.used.contains(&function.id) {
                continue;
            }
            need(function.ty);
            for variable in &function.variables {
                need(variable.ty);
            }
            Module::visit_body(&function.body, &mut |visit| match visit {
                super::module::Visit::Inst(inst) => inst.ty.iter().for_each(|&ty| need(ty)),
                super::module::Visit::Phis(phis) => phis.iter().for_each(|phi| need(phi.ty)),
                super::module::Visit::Uses(_) => {}
            });
        }
        order
    }

    /// Whether pointers of a class are chosen, or handed to functions.
    fn passes_pointers(&self, class: StorageClass) -> bool {
        let is_such = |ty: Ty| matches!(self.module.at(ty), Type::Pointer(of, _) if *of == class);
        let live = self.module.functions.iter().filter(|function| self.used.contains(&function.id));
        live.flat_map(|function| &function.parameters).any(|parameter| is_such(parameter.1))
            || self.uses(|inst| inst.op == Op::Select && inst.ty.is_some_and(is_such))
    }

    fn capabilities(&self) -> Vec<Capability> {
        let module = self.module;
        let mut found = vec![Capability::Shader];
        let types = self.types();
        let mut floats = false;
        for &ty in &types {
            let needs = match *module.at(ty) {
                Type::Int { width: 8, .. } => Capability::Int8,
                Type::Int { width: 16, .. } => Capability::Int16,
                Type::Int { width: 64, .. } => Capability::Int64,
                Type::Float { width: 16 } => Capability::Float16,
                Type::Float { width: 64 } => Capability::Float64,
                _ => Capability::Shader,
            };
            floats |= matches!(module.at(ty), Type::Float { .. });
            if !found.contains(&needs) {
                found.push(needs);
            }
        }
        if floats {
            found.extend([Capability::SignedZeroInfNanPreserve, Capability::DenormPreserve]);
        }
        if found.contains(&Capability::Int8) {
            found.push(Capability::StorageBuffer8BitAccess);
        }
        if found.contains(&Capability::Int16) || found.contains(&Capability::Float16) {
            found.push(Capability::StorageBuffer16BitAccess);
        }
        if module.physical {
            found.push(Capability::PhysicalStorageBufferAddresses);
        }
        // Only where they are needed: many an optimizer leaves modules alone that declare them.
        if self.passes_pointers(StorageClass::StorageBuffer) {
            found.push(Capability::VariablePointersStorageBuffer);
        }
        if self.passes_pointers(StorageClass::Workgroup) {
            found.push(Capability::VariablePointersStorageBuffer);
            found.push(Capability::VariablePointers);
        }
        if self.uses(|inst| inst.op == Op::FmaKHR) {
            found.push(Capability::FMAKHR);
        }
        if self.uses(|inst| {
            (Op::GroupNonUniformElect as u32..=Op::GroupNonUniformQuadSwap as u32).contains(&(inst.op as u32))
        }) {
            found.extend([
                Capability::GroupNonUniform,
                Capability::GroupNonUniformVote,
                Capability::GroupNonUniformBallot,
                Capability::GroupNonUniformArithmetic,
                Capability::GroupNonUniformShuffle,
                Capability::GroupNonUniformShuffleRelative,
            ]);
        }
        let wide_atomic = self.uses(|inst| {
            let atomic = (Op::AtomicLoad as u32..=Op::AtomicXor as u32).contains(&(inst.op as u32));
            let is_wide = |ty: Ty| matches!(self.module.at(ty), Type::Int { width: 64, .. });
            let mut operands = inst.operands.iter();
            atomic
                && (inst.ty.is_some_and(is_wide)
                    || operands.any(|operand| match operand {
                        Operand::Id(id) => self.module.type_of[*id as usize].is_some_and(is_wide),
                        Operand::Literal(_) => false,
                    }))
        });
        if wide_atomic {
            found.push(Capability::Int64Atomics);
        }
        found
    }

    fn decorate_type(&mut self, ty: Ty) {
        let id = self.ty(ty);
        match self.module.at(ty) {
            Type::Array { stride, .. } | Type::RuntimeArray { stride, .. } if *stride > 0 => {
                self.op(Op::Decorate, &[id, Decoration::ArrayStride as u32, *stride]);
            }
            Type::Struct { layout: Some(layout), .. } => {
                if layout.block {
                    self.op(Op::Decorate, &[id, Decoration::Block as u32]);
                }
                for (at, offset) in layout.offsets.iter().enumerate() {
                    let at = at as u32;
                    self.op(Op::MemberDecorate, &[id, at, Decoration::Offset as u32, *offset]);
                    if let Some((stride, rows)) = layout.matrices[at as usize] {
                        self.op(Op::MemberDecorate, &[id, at, Decoration::MatrixStride as u32, stride]);
                        let order = if rows { Decoration::RowMajor } else { Decoration::ColMajor };
                        self.op(Op::MemberDecorate, &[id, at, order as u32]);
                    }
                }
            }
            _ => {}
        }
    }

    fn declare_type(&mut self, ty: Ty, lengths: &mut Vec<(u32, Id)>) {
        let id = self.ty(ty);
        match self.module.at(ty).clone() {
            Type::Void => self.op(Op::TypeVoid, &[id]),
            Type::Bool => self.op(Op::TypeBool, &[id]),
            Type::Int { width, signed } => self.op(Op::TypeInt, &[id, width, signed.into()]),
            Type::Float { width } => self.op(Op::TypeFloat, &[id, width]),
            Type::Vector(of, count) => self.op(Op::TypeVector, &[id, self.ty(of), count]),
            Type::Matrix(of, count) => self.op(Op::TypeMatrix, &[id, self.ty(of), count]),
            Type::Array { element, count, .. } => {
                let length = match lengths.iter().find(|known| known.0 == count) {
                    Some(known) => known.1,
                    None => {
                        // `u32` is the second type of every module.
                        let length = self.label();
                        self.op(Op::Constant, &[self.ty(Ty(1)), length, count]);
                        lengths.push((count, length));
                        length
                    }
                };
                self.op(Op::TypeArray, &[id, self.ty(element), length]);
            }
            Type::RuntimeArray { element, .. } => self.op(Op::TypeRuntimeArray, &[id, self.ty(element)]),
            Type::Struct { members, .. } => {
                let members: Vec<u32> = members.iter().map(|&member| self.ty(member)).collect();
                self.op(Op::TypeStruct, &[&[id], &members[..]].concat());
            }
            Type::Pointer(class, to) => self.op(Op::TypePointer, &[id, class as u32, self.ty(to)]),
            Type::Function(result, parameters) => {
                let parameters: Vec<u32> = parameters.iter().map(|&one| self.ty(one)).collect();
                self.op(Op::TypeFunction, &[&[id, self.ty(result)], &parameters[..]].concat());
            }
        }
    }

    fn variable(&mut self, ty: Ty, id: Id, initializer: Option<Id>) {
        let Type::Pointer(class, _) = *self.module.at(ty) else { unreachable!("a variable's type") };
        let operands = [self.ty(ty), id, class as u32];
        match initializer {
            Some(initializer) => self.op(Op::Variable, &[&operands[..], &[initializer]].concat()),
            None => self.op(Op::Variable, &operands),
        }
    }

    fn function(&mut self, function: &Function) {
        let Type::Function(result, _) = *self.module.at(function.ty) else {
            unreachable!("a function's type")
        };
        self.op(Op::Function, &[self.ty(result), function.id, function.control, self.ty(function.ty)]);
        for &(id, ty) in &function.parameters {
            self.op(Op::FunctionParameter, &[self.ty(ty), id]);
        }
        let label = self.label();
        self.op(Op::Label, &[label]);
        for variable in &function.variables {
            if self.used.contains(&variable.id) {
                self.variable(variable.ty, variable.id, variable.initializer);
            }
        }
        let end = self.body(&function.body, label, 0, &mut Targets::default());
        assert!(end.is_none(), "a function's body returns");
        self.op(Op::FunctionEnd, &[]);
    }

    /// A body from an open block on, which ends in `next` where it falls; gives the edge that
    /// falls.
    fn body(&mut self, body: &Body, label: Id, next: Id, targets: &mut Targets) -> Option<(Id, Vec<Id>)> {
        let label = self.nodes(&body.nodes, label, targets);
        let (target, edges) = match &body.end {
            End::Fall(ids) => {
                self.op(Op::Branch, &[next]);
                return Some((label, ids.clone()));
            }
            End::Return(None) => {
                self.op(Op::Return, &[]);
                return None;
            }
            End::Return(Some(id)) => {
                self.op(Op::ReturnValue, &[*id]);
                return None;
            }
            End::Unreachable => {
                self.op(Op::Unreachable, &[]);
                return None;
            }
            End::FallThrough(ids) => {
                targets.falls_through.push((label, ids.clone()));
                (targets.through, ())
            }
            End::LeaveSwitch(ids) => {
                targets.leaves.push((label, ids.clone()));
                (targets.leave_switch, ())
            }
            End::Break(ids) => {
                targets.breaks.push((label, ids.clone()));
                (targets.leave, ())
            }
            End::Continue(ids) => {
                targets.continues.push((label, ids.clone()));
                (targets.next, ())
            }
        };
        let () = edges;
        self.op(Op::Branch, &[target]);
        None
    }

    /// Nodes from an open block on; gives the block that is open then.
    fn nodes(&mut self, nodes: &[Node], mut label: Id, targets: &mut Targets) -> Id {
        for node in nodes {
            match node {
                Node::Inst(inst) => self.inst(inst),
                Node::If { condition, arms, phis } => {
                    let merge = self.label();
                    // An arm without anything is the merge block itself, one time in two.
                    let direct = |arm: &Body| {
                        arm.nodes.is_empty() && matches!(arm.end, End::Fall(_)) && condition % 2 == 0
                    };
                    let skips = arms.iter().position(direct);
                    let labels: Vec<Id> =
                        (0..2).map(|at| if skips == Some(at) { merge } else { self.label() }).collect();
                    self.op(Op::SelectionMerge, &[merge, 0]);
                    self.op(Op::BranchConditional, &[*condition, labels[0], labels[1]]);
                    let mut edges = Vec::new();
                    for (at, arm) in arms.iter().enumerate() {
                        if skips == Some(at) {
                            let End::Fall(ids) = &arm.end else { unreachable!("an arm that falls") };
                            edges.push((label, ids.clone()));
                            continue;
                        }
                        self.op(Op::Label, &[labels[at]]);
                        edges.extend(self.body(arm, labels[at], merge, targets));
                    }
                    self.op(Op::Label, &[merge]);
                    self.phis(phis, &edges);
                    label = merge;
                }
                Node::Switch { selector, cases, phis } => {
                    let merge = self.label();
                    let labels: Vec<Id> = cases.iter().map(|_| self.label()).collect();
                    self.op(Op::SelectionMerge, &[merge, 0]);
                    let mut operands = vec![*selector, labels[cases.len() - 1]];
                    for (case, label) in cases.iter().zip(&labels) {
                        for literal in &case.literals {
                            operands.extend(literal);
                            operands.push(*label);
                        }
                    }
                    self.op(Op::Switch, &operands);
                    let outer = (targets.leave_switch, targets.through);
                    let outer_leaves = std::mem::take(&mut targets.leaves);
                    let outer_falls = std::mem::take(&mut targets.falls_through);
                    targets.leave_switch = merge;
                    let mut edges = Vec::new();
                    for (at, case) in cases.iter().enumerate() {
                        self.op(Op::Label, &[labels[at]]);
                        let mut incoming = std::mem::take(&mut targets.falls_through);
                        incoming.push((label, case.arguments.clone()));
                        self.phis(&case.phis, &incoming);
                        targets.through = labels.get(at + 1).copied().unwrap_or_default();
                        edges.extend(self.body(&case.body, labels[at], merge, targets));
                    }
                    edges.append(&mut targets.leaves);
                    (targets.leave_switch, targets.through) = outer;
                    targets.leaves = outer_leaves;
                    targets.falls_through = outer_falls;
                    self.op(Op::Label, &[merge]);
                    self.phis(phis, &edges);
                    label = merge;
                }
                Node::Loop(it) => {
                    let [header, body, next, merge] =
                        [self.label(), self.label(), self.label(), self.label()];
                    let back =
                        if it.again.is_some() || !it.continuing.is_empty() { self.label() } else { next };
                    // The block of the back edge is known only when the continue construct is
                    // written: where it is more than one block, it ends in a block of its own.
                    self.op(Op::Branch, &[header]);
                    self.op(Op::Label, &[header]);
                    self.phis(&it.phis, &[(label, it.start.clone()), (back, it.next.clone())]);
                    it.header.iter().for_each(|inst| self.inst(inst));
                    self.op(Op::LoopMerge, &[merge, next, 0]);
                    let mut inner = Targets { next, leave: merge, ..Targets::default() };
                    match it.condition {
                        Some(condition) => {
                            self.op(Op::BranchConditional, &[condition, body, merge]);
                            inner.breaks.push((header, it.exit.clone()));
                        }
                        None => self.op(Op::Branch, &[body]),
                    }
                    self.op(Op::Label, &[body]);
                    let falls = self.body(&it.body, body, next, &mut inner);
                    inner.continues.extend(falls);
                    self.op(Op::Label, &[next]);
                    let continues = std::mem::take(&mut inner.continues);
                    self.phis(&it.continue_phis, &continues);
                    self.nodes(&it.continuing, next, &mut Targets::default());
                    if back != next {
                        self.op(Op::Branch, &[back]);
                        self.op(Op::Label, &[back]);
                    }
                    match &it.again {
                        Some((condition, ids)) => {
                            self.op(Op::BranchConditional, &[*condition, header, merge]);
                            inner.breaks.push((back, ids.clone()));
                        }
                        None => self.op(Op::Branch, &[header]),
                    }
                    self.op(Op::Label, &[merge]);
                    self.phis(&it.merge_phis, &inner.breaks);
                    label = merge;
                }
            }
        }
        label
    }

    /// A block that nothing reaches has no phis: their values are unknown to all.
    fn phis(&mut self, phis: &[Phi], edges: &[(Id, Vec<Id>)]) {
        for (at, phi) in phis.iter().enumerate() {
            let ty = self.ty(phi.ty);
            if edges.is_empty() {
                self.op(Op::Undef, &[ty, phi.id]);
                continue;
            }
            let mut operands = vec![ty, phi.id];
            for (label, ids) in edges {
                operands.extend([ids[at], *label]);
            }
            self.op(Op::Phi, &operands);
        }
    }

    fn inst(&mut self, inst: &Inst) {
        let start = self.words.len();
        self.words.push(0);
        if let Some(ty) = inst.ty {
            let ty = self.ty(ty);
            self.words.extend([ty, inst.id]);
        }
        for operand in &inst.operands {
            self.words.push(match operand {
                Operand::Id(word) | Operand::Literal(word) => *word,
            });
        }
        self.words[start] = ((self.words.len() - start) as u32) << 16 | inst.op as u32;
    }
}

fn add_type(module: &Module, ty: Ty, seen: &mut Vec<bool>, order: &mut Vec<Ty>) {
    if std::mem::replace(&mut seen[ty.0 as usize], true) {
        return;
    }
    let mut need = |ty| add_type(module, ty, seen, order);
    match module.at(ty) {
        Type::Vector(of, _) | Type::Matrix(of, _) | Type::Pointer(_, of) => need(*of),
        Type::RuntimeArray { element, .. } => need(*element),
        Type::Array { element, .. } => {
            need(Ty(1));
            need(*element);
        }
        Type::Struct { members, .. } => members.iter().for_each(|&member| need(member)),
        Type::Function(result, parameters) => {
            need(*result);
            parameters.iter().for_each(|&parameter| need(parameter));
        }
        Type::Void | Type::Bool | Type::Int { .. } | Type::Float { .. } => {}
    }
    order.push(ty);
}

/// The words of a literal: narrow ones are extended by their sign where their type has one.
pub fn literal(ty: &Type, bits: u64) -> Vec<u32> {
    match ty {
        Type::Int { width: 64, .. } | Type::Float { width: 64 } => vec![bits as u32, (bits >> 32) as u32],
        Type::Int { width, signed: true } => vec![((bits << (64 - width)) as i64 >> (64 - width)) as u32],
        _ => vec![bits as u32],
    }
}

/// The decorations of a variable at a binding of set 0.
pub fn bound_at(binding: u32) -> Vec<Vec<u32>> {
    vec![vec![Decoration::DescriptorSet as u32, 0], vec![Decoration::Binding as u32, binding]]
}

/// The decoration of a variable that is a builtin.
pub fn is_builtin(builtin: BuiltIn) -> Vec<Vec<u32>> {
    vec![vec![Decoration::BuiltIn as u32, builtin as u32]]
}
