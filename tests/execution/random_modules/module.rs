//! A module as a tree: types, constants, variables and functions whose bodies nest as structured
//! control flow does. An edge carries arguments and its target has phis for them, so that whoever
//! changes the tree need not know labels.

use std::collections::{HashMap, HashSet};

use rspirv::spirv::{Op, StorageClass};

/// The result of an instruction, or the name of a constant, a variable or a function.
pub type Id = u32;
/// The id of the import of `GLSL.std.450`.
pub const GLSL: Id = 1;
/// The entry point's function.
pub const MAIN: Id = 2;

/// A type, by its place in [`Module::types`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Ty(pub u32);

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Type {
    Void,
    Bool,
    Int {
        width: u32,
        signed: bool,
    },
    Float {
        width: u32,
    },
    Vector(Ty, u32),
    Matrix(Ty, u32),
    /// The stride is 0 where the type has no layout.
    Array {
        element: Ty,
        count: u32,
        stride: u32,
    },
    RuntimeArray {
        element: Ty,
        stride: u32,
    },
    Struct {
        members: Vec<Ty>,
        layout: Option<Layout>,
    },
    Pointer(StorageClass, Ty),
    Function(Ty, Vec<Ty>),
}

/// The layout of a struct in memory.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Layout {
    pub offsets: Vec<u32>,
    /// `MatrixStride` and whether `RowMajor`, of members that hold matrices.
    pub matrices: Vec<Option<(u32, bool)>>,
    pub size: u32,
    pub block: bool,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum ConstantKind {
    Bool(bool),
    Bits(u64),
    Composite(Vec<Id>),
    Null,
    Undef,
}

#[derive(Clone, Debug)]
pub struct Constant {
    pub id: Id,
    pub ty: Ty,
    pub kind: ConstantKind,
}

#[derive(Clone, Debug)]
pub struct Variable {
    pub id: Id,
    /// The pointer's type.
    pub ty: Ty,
    pub initializer: Option<Id>,
    pub decorations: Vec<Vec<u32>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operand {
    Id(Id),
    Literal(u32),
}

#[derive(Clone, Debug)]
pub struct Inst {
    pub op: Op,
    pub ty: Option<Ty>,
    pub id: Id,
    pub operands: Vec<Operand>,
}

/// The phi of a block: what it is on an edge stands with the edge.
#[derive(Clone, Copy, Debug)]
pub struct Phi {
    pub id: Id,
    pub ty: Ty,
}

#[derive(Clone, Debug)]
pub enum Node {
    Inst(Inst),
    If { condition: Id, arms: [Body; 2], phis: Vec<Phi> },
    Switch { selector: Id, cases: Vec<Case>, phis: Vec<Phi> },
    Loop(Box<Loop>),
}

/// A case of a switch; the last one is the default.
#[derive(Clone, Debug)]
pub struct Case {
    /// Literals, as words; several lead to one case.
    pub literals: Vec<Vec<u32>>,
    /// What the switch's own edge carries.
    pub arguments: Vec<Id>,
    pub phis: Vec<Phi>,
    pub body: Body,
}

#[derive(Clone, Debug)]
pub struct Loop {
    pub phis: Vec<Phi>,
    pub start: Vec<Id>,
    pub header: Vec<Inst>,
    /// Where the header leaves the loop: while this holds, the body runs.
    pub condition: Option<Id>,
    pub exit: Vec<Id>,
    pub body: Body,
    pub continue_phis: Vec<Phi>,
    pub continuing: Vec<Node>,
    /// What goes round to the header.
    pub next: Vec<Id>,
    /// Where the continue block may leave the loop: while this holds, the loop goes on.
    pub again: Option<(Id, Vec<Id>)>,
    pub merge_phis: Vec<Phi>,
}

#[derive(Clone, Debug)]
pub struct Body {
    pub nodes: Vec<Node>,
    pub end: End,
}

#[derive(Clone, Debug)]
pub enum End {
    /// To the merge block; in a loop's body to the continue target.
    Fall(Vec<Id>),
    /// To the next case.
    FallThrough(Vec<Id>),
    /// To the merge block of the innermost switch, from within.
    LeaveSwitch(Vec<Id>),
    Break(Vec<Id>),
    Continue(Vec<Id>),
    Return(Option<Id>),
    Unreachable,
}

#[derive(Clone, Debug)]
pub struct Function {
    pub id: Id,
    pub ty: Ty,
    pub control: u32,
    pub parameters: Vec<(Id, Ty)>,
    pub variables: Vec<Variable>,
    pub body: Body,
}

#[derive(Clone, Debug)]
pub struct Module {
    pub types: Vec<Type>,
    known: HashMap<Type, Ty>,
    pub constants: Vec<Constant>,
    known_constants: HashMap<(Ty, ConstantKind), Id>,
    pub globals: Vec<Variable>,
    pub functions: Vec<Function>,
    /// Decorations of ids, without the opcode.
    pub decorations: Vec<Vec<u32>>,
    pub local_size: u32,
    pub physical: bool,
    pub bound: Id,
    /// The type of each id, where it has one.
    pub type_of: Vec<Option<Ty>>,
}

impl Module {
    pub fn new(local_size: u32, physical: bool) -> Self {
        Self {
            types: Vec::new(),
            known: HashMap::new(),
            constants: Vec::new(),
            known_constants: HashMap::new(),
            globals: Vec::new(),
            functions: Vec::new(),
            decorations: Vec::new(),
            local_size,
            physical,
            bound: 3,
            type_of: vec![None; 3],
        }
    }

    pub fn ty(&mut self, ty: Type) -> Ty {
        if let Some(&known) = self.known.get(&ty) {
            return known;
        }
        let new = Ty(self.types.len() as u32);
        self.types.push(ty.clone());
        self.known.insert(ty, new);
        new
    }

    pub fn at(&self, ty: Ty) -> &Type {
        &self.types[ty.0 as usize]
    }

    pub fn id(&mut self, ty: Option<Ty>) -> Id {
        let id = self.bound;
        self.bound += 1;
        self.type_of.push(ty);
        id
    }

    pub fn constant(&mut self, ty: Ty, kind: ConstantKind) -> Id {
        if let Some(&known) = self.known_constants.get(&(ty, kind.clone())) {
            return known;
        }
        let id = self.id(Some(ty));
        self.constants.push(Constant { id, ty, kind: kind.clone() });
        self.known_constants.insert((ty, kind), id);
        id
    }

    /// Calls `visit` with every instruction of a tree, and every id that an edge or a condition
    /// uses.
    pub fn visit_body(body: &Body, visit: &mut dyn FnMut(Visit<'_>)) {
        Self::visit_nodes(&body.nodes, visit);
        match &body.end {
            End::Fall(ids)
            | End::FallThrough(ids)
            | End::LeaveSwitch(ids)
            | End::Break(ids)
            | End::Continue(ids) => visit(Visit::Uses(ids)),
            End::Return(Some(id)) => visit(Visit::Uses(&[*id])),
            End::Return(None) | End::Unreachable => {}
        }
    }

    pub fn visit_nodes(nodes: &[Node], visit: &mut dyn FnMut(Visit<'_>)) {
        for node in nodes {
            match node {
                Node::Inst(inst) => visit(Visit::Inst(inst)),
                Node::If { condition, arms, phis } => {
                    visit(Visit::Uses(&[*condition]));
                    visit(Visit::Phis(phis));
                    for arm in arms {
                        Self::visit_body(arm, visit);
                    }
                }
                Node::Switch { selector, cases, phis } => {
                    visit(Visit::Uses(&[*selector]));
                    visit(Visit::Phis(phis));
                    for case in cases {
                        visit(Visit::Phis(&case.phis));
                        visit(Visit::Uses(&case.arguments));
                        Self::visit_body(&case.body, visit);
                    }
                }
                Node::Loop(it) => {
                    for phis in [&it.phis, &it.continue_phis, &it.merge_phis] {
                        visit(Visit::Phis(phis));
                    }
                    visit(Visit::Uses(&it.start));
                    it.header.iter().for_each(|inst| visit(Visit::Inst(inst)));
                    visit(Visit::Uses(&it.exit));
                    visit(Visit::Uses(&it.next));
                    if let Some(condition) = it.condition {
                        visit(Visit::Uses(&[condition]));
                    }
                    Self::visit_body(&it.body, visit);
                    Self::visit_nodes(&it.continuing, visit);
                    if let Some((condition, ids)) = &it.again {
                        visit(Visit::Uses(&[*condition]));
                        visit(Visit::Uses(ids));
                    }
                }
            }
        }
    }

    /// The ids that functions use, those of the constants' parts among them.
    pub fn used(&self) -> HashSet<Id> {
        let mut used = HashSet::new();
        let mut open = vec![MAIN];
        let mut visited = HashSet::new();
        while let Some(function) = open.pop() {
            let Some(function) = self.functions.iter().find(|known| known.id == function) else { continue };
            if !visited.insert(function.id) {
                continue;
            }
            used.insert(function.id);
            used.extend(function.variables.iter().filter_map(|variable| variable.initializer));
            Self::visit_body(&function.body, &mut |visit| match visit {
                Visit::Inst(inst) => {
                    for operand in &inst.operands {
                        if let Operand::Id(id) = operand {
                            used.insert(*id);
                        }
                    }
                    if let (Op::FunctionCall, Operand::Id(callee)) =
                        (inst.op, inst.operands.first().copied().unwrap_or(Operand::Literal(0)))
                    {
                        open.push(callee);
                    }
                }
                Visit::Uses(ids) => used.extend(ids),
                Visit::Phis(_) => {}
            });
        }
        used.extend(self.globals.iter().filter_map(|variable| variable.initializer));
        for constant in self.constants.iter().rev() {
            if let (true, ConstantKind::Composite(parts)) = (used.contains(&constant.id), &constant.kind) {
                used.extend(parts);
            }
        }
        used
    }
}

/// What a walk over a tree meets.
pub enum Visit<'a> {
    Inst(&'a Inst),
    Uses(&'a [Id]),
    Phis(&'a [Phi]),
}
