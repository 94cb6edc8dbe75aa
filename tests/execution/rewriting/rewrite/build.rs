//! Types, constants and variables found or made, and instructions put together.

use std::collections::HashMap;

use anyhit_engine::module::Opcode as Op;
use rspirv::spirv::{Capability, Decoration, StorageClass};

use super::words::{Inst, Module, Place};

/// Numbers drawn from a key (splitmix64).
#[derive(Clone, Debug)]
pub struct Rng(pub u64);

impl Rng {
    /// The next number.
    pub fn draw(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut word = self.0;
        word = (word ^ word >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        word = (word ^ word >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        word ^ word >> 31
    }

    /// A number below a bound.
    pub fn below(&mut self, bound: usize) -> usize {
        (self.draw() % bound.max(1) as u64) as usize
    }

    /// True once in so many times.
    pub fn one_in(&mut self, times: usize) -> bool {
        self.below(times) == 0
    }
}

/// What is known about the ids of a module at one moment.
pub struct Index {
    /// The instructions that define types, constants and global variables.
    pub globals: HashMap<u32, Inst>,
    /// The type of every value.
    pub types: HashMap<u32, u32>,
    decorated: HashMap<u32, Vec<u32>>,
    capabilities: Vec<u32>,
}

impl Index {
    /// Reads a module.
    pub fn of(module: &Module) -> Self {
        let mut types = HashMap::new();
        let globals = module.globals.iter().filter(|inst| inst.id != 0);
        let globals: HashMap<u32, Inst> = globals.map(|inst| (inst.id, inst.clone())).collect();
        let functions = &module.functions;
        let locals = functions.iter().flat_map(|function| function.params.iter().chain(function.insts()));
        for inst in module.globals.iter().chain(locals) {
            if inst.id != 0 && inst.ty != 0 {
                types.insert(inst.id, inst.ty);
            }
        }
        let mut decorated: HashMap<u32, Vec<u32>> = HashMap::new();
        let mut capabilities = Vec::new();
        for inst in &module.head {
            match inst.op {
                Op::Decorate | Op::DecorateId | Op::DecorateString => {
                    decorated.entry(inst.rest[0]).or_default().push(inst.rest[1]);
                }
                Op::MemberDecorate => decorated.entry(inst.rest[0]).or_default().push(inst.rest[2]),
                Op::GroupDecorate | Op::GroupMemberDecorate => {
                    inst.operands().for_each(|id| decorated.entry(id).or_default().push(u32::MAX));
                }
                Op::Capability => capabilities.push(inst.rest[0]),
                _ => {}
            }
        }
        Self { globals, types, decorated, capabilities }
    }

    /// The instruction that declares a type.
    pub fn ty(&self, ty: u32) -> Option<&Inst> {
        self.globals.get(&ty).filter(|inst| inst.ty == 0)
    }

    /// The opcode of a type.
    pub fn kind(&self, ty: u32) -> Op {
        self.ty(ty).map_or(Op::Nop, |inst| inst.op)
    }

    /// The value of a 32-bit integer constant that cannot be specialized.
    pub fn number(&self, id: u32) -> Option<u32> {
        let inst = self.globals.get(&id).filter(|inst| inst.op == Op::Constant)?;
        (inst.rest.len() == 1).then(|| inst.rest[0])
    }

    /// Whether an id has decorations other than `RelaxedPrecision`.
    pub fn is_decorated(&self, id: u32) -> bool {
        let relaxed = Decoration::RelaxedPrecision as u32;
        self.decorated.get(&id).is_some_and(|all| all.iter().any(|one| *one != relaxed))
    }

    /// Whether a module declares a capability.
    pub fn has(&self, capability: Capability) -> bool {
        self.capabilities.contains(&(capability as u32))
    }

    /// The parts of a composite type, where their number is fixed.
    pub fn parts(&self, ty: u32) -> Option<Vec<u32>> {
        let inst = self.ty(ty)?;
        match inst.op {
            Op::TypeVector | Op::TypeMatrix => Some(vec![inst.rest[0]; inst.rest[1] as usize]),
            Op::TypeArray => {
                let length = self.number(inst.rest[1])? as usize;
                (length <= 16).then(|| vec![inst.rest[0]; length])
            }
            Op::TypeStruct => Some(inst.rest.clone()),
            _ => None,
        }
    }

    /// A vector's component type and count, a scalar's own.
    pub fn vector(&self, ty: u32) -> (u32, u32) {
        match self.ty(ty) {
            Some(inst) if inst.op == Op::TypeVector => (inst.rest[0], inst.rest[1]),
            _ => (ty, 1),
        }
    }

    /// Whether values of a type may stand in variables of functions: no opaque types, no pointers
    /// without addresses, no explicit layout, nothing that only memory may hold.
    pub fn is_storable(&self, ty: u32) -> bool {
        self.may_hold(ty, false)
    }

    /// Whether values of a type may be taken apart and put together, explicit layout or not.
    pub fn is_data(&self, ty: u32) -> bool {
        self.may_hold(ty, true)
    }

    fn may_hold(&self, ty: u32, laid_out: bool) -> bool {
        let Some(inst) = self.ty(ty) else { return false };
        let plain = laid_out || !self.is_decorated(ty);
        match inst.op {
            Op::TypeBool => true,
            Op::TypeInt => match inst.rest[0] {
                8 => self.has(Capability::Int8),
                16 => self.has(Capability::Int16),
                _ => true,
            },
            Op::TypeFloat => inst.rest.len() == 1 && (inst.rest[0] != 16 || self.has(Capability::Float16)),
            Op::TypeVector | Op::TypeMatrix => self.may_hold(inst.rest[0], laid_out),
            Op::TypeArray => plain && self.may_hold(inst.rest[0], laid_out),
            Op::TypeStruct => plain && inst.rest.iter().all(|member| self.may_hold(*member, laid_out)),
            Op::TypePointer => inst.rest[0] == StorageClass::PhysicalStorageBuffer as u32,
            _ => false,
        }
    }

    /// Whether a type is a pointer to addresses: what holds one must say whether it is aliased.
    pub fn is_address(&self, ty: u32) -> bool {
        self.kind(ty) == Op::TypePointer
    }

    /// Whether a storable type holds an address somewhere within.
    pub fn holds_address(&self, ty: u32) -> bool {
        let parts = self.parts(ty).unwrap_or_default();
        self.is_address(ty) || parts.iter().any(|part| self.holds_address(*part))
    }

    /// Storage class and pointee of a pointer value.
    pub fn pointer(&self, id: u32) -> Option<(u32, u32)> {
        let inst = self.ty(*self.types.get(&id)?)?;
        (inst.op == Op::TypePointer).then(|| (inst.rest[0], inst.rest[1]))
    }
}

impl Module {
    /// An id that nothing uses.
    pub fn fresh(&mut self) -> u32 {
        self.next_id += 1;
        self.next_id - 1
    }

    /// A type or constant without decorations, found or made.
    pub fn global(&mut self, op: Op, ty: u32, rest: &[u32]) -> u32 {
        let head = &self.head;
        let plain = |id: u32| !head.iter().any(|inst| is_decoration(inst.op) && inst.rest[0] == id);
        let same = |inst: &&Inst| inst.op == op && inst.ty == ty && inst.rest == rest && plain(inst.id);
        if let Some(found) = self.globals.iter().find(same) {
            return found.id;
        }
        self.new_global(op, ty, rest)
    }

    /// A new global.
    pub fn new_global(&mut self, op: Op, ty: u32, rest: &[u32]) -> u32 {
        let id = self.fresh();
        self.globals.push(Inst::new(op, ty, id, rest, &Place::default()));
        id
    }

    /// `OpTypeBool`
    pub fn bool(&mut self) -> u32 {
        self.global(Op::TypeBool, 0, &[])
    }

    /// `OpTypeInt 32 0`
    pub fn uint(&mut self) -> u32 {
        self.global(Op::TypeInt, 0, &[32, 0])
    }

    /// A vector type, or its component where there is one.
    pub fn vector(&mut self, component: u32, count: u32) -> u32 {
        if count == 1 { component } else { self.global(Op::TypeVector, 0, &[component, count]) }
    }

    /// A constant of 32-bit unsigned integers.
    pub fn number(&mut self, value: u32) -> u32 {
        let uint = self.uint();
        self.global(Op::Constant, uint, &[value])
    }

    /// `OpTypePointer`
    pub fn pointer(&mut self, class: StorageClass, pointee: u32) -> u32 {
        self.global(Op::TypePointer, 0, &[class as u32, pointee])
    }

    /// `OpTypeFunction`
    pub fn function_type(&mut self, result: u32, params: &[u32]) -> u32 {
        self.global(Op::TypeFunction, 0, &[&[result], params].concat())
    }

    /// `OpTypeVoid`
    pub fn void(&mut self) -> u32 {
        self.global(Op::TypeVoid, 0, &[])
    }

    /// Decorates an id as another one is: how it is rounded and saturated, too.
    pub fn copy_decorations(&mut self, from: u32, to: u32) {
        let same: Vec<Inst> = self
            .head
            .iter()
            .filter(|inst| inst.op == Op::Decorate && inst.rest[0] == from)
            .cloned()
            .collect();
        for mut inst in same {
            inst.rest[0] = to;
            self.head.push(inst);
        }
    }

    /// Decorates an id.
    pub fn decorate(&mut self, id: u32, decoration: Decoration) {
        self.head.push(Inst::new(Op::Decorate, 0, 0, &[id, decoration as u32], &Place::default()));
    }

    /// A variable of the whole invocation.
    pub fn private(&mut self, ty: u32, initializer: Option<u32>) -> u32 {
        let pointer = self.pointer(StorageClass::Private, ty);
        let rest: Vec<u32> = std::iter::once(StorageClass::Private as u32).chain(initializer).collect();
        let id = self.new_global(Op::Variable, pointer, &rest);
        if self.version() >= 0x0001_0400 {
            // Since 1.4 an entry point lists all global variables that it uses.
            for inst in self.head.iter_mut().filter(|inst| inst.op == Op::EntryPoint) {
                inst.ids.push(inst.rest.len() as u16);
                inst.rest.push(id);
            }
        }
        id
    }
}

fn is_decoration(op: Op) -> bool {
    matches!(
        op,
        Op::Decorate | Op::DecorateId | Op::DecorateString | Op::MemberDecorate | Op::MemberDecorateString
    )
}

/// Instructions in the making, all at one place of the source.
pub struct Code {
    /// What is known about ids that were there before.
    pub index: Index,
    /// The source line.
    pub place: Place,
    /// The instructions.
    pub out: Vec<Inst>,
    /// Variables for the function.
    pub variables: Vec<Inst>,
}

impl Code {
    /// No instructions yet.
    pub fn new(module: &Module, place: &Place) -> Self {
        Self { index: Index::of(module), place: place.clone(), out: Vec::new(), variables: Vec::new() }
    }

    /// Appends an instruction with a result.
    pub fn op(&mut self, module: &mut Module, op: Op, ty: u32, rest: &[u32]) -> u32 {
        let id = module.fresh();
        self.out.push(Inst::new(op, ty, id, rest, &self.place));
        id
    }

    /// Appends an instruction without.
    pub fn run(&mut self, op: Op, rest: &[u32]) {
        self.out.push(Inst::new(op, 0, 0, rest, &self.place));
    }

    /// A variable of the function for a type.
    pub fn variable(&mut self, module: &mut Module, ty: u32, initializer: Option<u32>) -> u32 {
        let pointer = module.pointer(StorageClass::Function, ty);
        let id = module.fresh();
        let rest: Vec<u32> = std::iter::once(StorageClass::Function as u32).chain(initializer).collect();
        self.variables.push(Inst::new(Op::Variable, pointer, id, &rest, &Place::default()));
        if self.index.is_address(ty) {
            module.decorate(id, Decoration::AliasedPointer);
        }
        id
    }

    /// A variable, of the function or of the invocation.
    pub fn any_variable(&mut self, module: &mut Module, ty: u32, rng: &mut Rng) -> (u32, StorageClass) {
        if rng.one_in(3) && !self.index.holds_address(ty) {
            (module.private(ty, None), StorageClass::Private)
        } else {
            (self.variable(module, ty, None), StorageClass::Function)
        }
    }

    /// A condition that is true and that nobody knows before the shader runs.
    pub fn truth(&mut self, module: &mut Module, rng: &mut Rng) -> u32 {
        let bool = module.bool();
        let yes = module.global(Op::ConstantTrue, bool, &[]);
        match rng.below(4) {
            0 => {
                let variable = module.private(bool, Some(yes));
                self.op(module, Op::Load, bool, &[variable])
            }
            1 => {
                let variable = self.variable(module, bool, None);
                self.run(Op::Store, &[variable, yes]);
                self.op(module, Op::Load, bool, &[variable])
            }
            2 => {
                let (uint, seven) = (module.uint(), module.number(7));
                let variable = self.variable(module, uint, Some(seven));
                let loaded = self.op(module, Op::Load, uint, &[variable]);
                self.op(module, Op::IEqual, bool, &[loaded, seven])
            }
            _ => {
                let variable = self.variable(module, bool, Some(yes));
                self.op(module, Op::Load, bool, &[variable])
            }
        }
    }

    /// Puts the instructions in front of the one at a position.
    pub fn insert(self, module: &mut Module, function: usize, block: usize, at: usize) {
        let function = &mut module.functions[function];
        function.blocks[block].body.splice(at..at, self.out);
        function.blocks[0].body.splice(0..0, self.variables);
    }
}
