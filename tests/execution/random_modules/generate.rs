//! Modules at random: what a module holds, and its functions.

mod composite;
mod declare;
mod expression;
mod invocations;
mod loops;
mod statement;

use std::collections::BTreeMap;

use rspirv::spirv::{Decoration, Op, StorageClass};

use super::module::{Body, End, Function, Id, Inst, MAIN, Module, Node, Operand, Ty, Type, Variable};
use super::random::Random;

/// Words that every invocation reads, behind the words that all of them read: the device address
/// and two numbers.
pub const INPUTS: usize = 4;
pub const HEAD: usize = 4;
/// Words that every invocation writes.
pub const OUTPUTS: usize = 8;
/// Words that all of them change by atomic instructions.
pub const SHARED: usize = 8;
/// The bindings; the last one is the buffer of the device address.
pub const BUFFERS: usize = 5;

/// A module, and how it is to be run.
#[derive(Clone, Debug)]
pub struct Generated {
    pub module: Module,
    pub groups: u32,
    pub subgroup: u32,
    /// The size of an invocation's element in the buffer of binding 2 and in that of the device
    /// address.
    pub element_sizes: [u32; 2],
    /// Where floats lie in them, with their widths.
    pub floats: [Vec<(u32, u32)>; 2],
    pub counts: BTreeMap<&'static str, usize>,
    /// Whether it may hold what Vulkan drivers have only lately: fused products, bit instructions
    /// of all widths.
    pub recent: bool,
}

impl Generated {
    pub fn invocations(&self) -> usize {
        (self.module.local_size * self.groups) as usize
    }
}

/// What can be loaded and stored.
#[derive(Clone, Copy, Debug)]
struct Place {
    id: Id,
    class: StorageClass,
    to: Ty,
    /// The variable or parameter that it belongs to.
    object: Id,
}

/// What a function takes.
#[derive(Clone, Copy, Debug)]
enum Parameter {
    Value(Ty),
    Pointer(StorageClass, Ty),
}

#[derive(Clone, Debug)]
struct Signature {
    id: Id,
    parameters: Vec<Parameter>,
    result: Ty,
    cost: u64,
    aliased: bool,
}

/// What leaving the innermost loop, and going on with it, must carry.
#[derive(Clone, Debug, Default)]
struct Around {
    in_loop: Option<(Vec<Ty>, Vec<Ty>)>,
    in_switch: Option<Vec<Ty>>,
    /// Whether nobody may return from here.
    stays: bool,
}

struct Generator {
    random: Random,
    module: Module,
    counts: BTreeMap<&'static str, usize>,
    /// The nodes of the body that is being drawn.
    nodes: Vec<Node>,
    /// Values in scope.
    pool: Vec<(Ty, Id)>,
    places: Vec<Place>,
    variables: Vec<Variable>,
    scalars: Vec<Ty>,
    menu: Vec<Ty>,
    laid_menu: Vec<Ty>,
    callable: Vec<Signature>,
    around: Around,
    /// The type that the function returns.
    result: Ty,
    entry: bool,
    /// Whether all invocations of the workgroup come by here.
    uniform: bool,
    /// How often a statement runs, and what has run.
    times: u64,
    cost: u64,
    depth: usize,
    wide_bits: bool,
    fused: bool,
    /// Whether few branches stand between the statements.
    straight: bool,
    input: Id,
    output: Id,
    shared: Id,
    own: Option<(Id, Ty)>,
    physical: Option<(Ty, u32)>,
    workgroup: Vec<(Id, Ty)>,
    gid: Id,
    lid: Id,
    group_id: Id,
    lane_id: Id,
    own_index: Id,
    local_index: Id,
    subgroup: u32,
}

/// The object that all device addresses lead into.
const PHYSICAL: Id = u32::MAX;

/// What one invocation may cost, in instructions.
const COST: u64 = 2500;

/// The module of a seed and a number.
pub fn generate(seed: u64, index: u64) -> Generated {
    generate_for(seed, index, None)
}

/// Draws a module for subgroups of one size.
pub fn generate_for(seed: u64, index: u64, subgroup: Option<u32>) -> Generated {
    let mut random = Random::new(seed, index);
    let local = random.pick(&[4, 8, 8, 16, 16, 32]);
    let groups = if local == 32 { 1 } else { 1 + random.below(2) as u32 };
    let drawn = random.pick(&[4, 8, 32]);
    let subgroup = subgroup.unwrap_or(drawn);
    let physical = random.chance(1, 3);
    let mut generator = Generator {
        module: Module::new(local, physical),
        random,
        counts: BTreeMap::new(),
        nodes: Vec::new(),
        pool: Vec::new(),
        places: Vec::new(),
        variables: Vec::new(),
        scalars: Vec::new(),
        menu: Vec::new(),
        laid_menu: Vec::new(),
        callable: Vec::new(),
        around: Around::default(),
        result: Ty(0),
        entry: false,
        uniform: false,
        times: 1,
        cost: 0,
        depth: 0,
        wide_bits: false,
        fused: false,
        straight: false,
        input: 0,
        output: 0,
        shared: 0,
        own: None,
        physical: None,
        workgroup: Vec::new(),
        gid: 0,
        lid: 0,
        group_id: 0,
        lane_id: 0,
        own_index: 0,
        local_index: 0,
        subgroup,
    };
    generator.types();
    generator.globals();
    let helpers = generator.random.pick(&[0, 1, 1, 2, 2, 3]);
    for _ in 0..helpers {
        generator.helper();
    }
    generator.main();
    let Generator { module, counts, own, physical, fused, wide_bits, .. } = generator;
    let recent = fused || wide_bits;
    let mut element_sizes = [0; 2];
    let mut floats = [Vec::new(), Vec::new()];
    for (at, ty) in [own.map(|it| it.1), physical.map(|it| it.0)].into_iter().enumerate() {
        let Some(ty) = ty else { continue };
        let Type::Struct { layout: Some(layout), .. } = module.at(ty) else { unreachable!("a struct") };
        element_sizes[at] = layout.size;
        module.float_places(ty, 0, None, &mut floats[at]);
    }
    Generated { module, groups, subgroup, element_sizes, floats, counts, recent }
}

impl Generator {
    fn count(&mut self, kind: &'static str) {
        *self.counts.entry(kind).or_default() += 1;
    }

    /// An instruction whose result nothing else may use.
    fn hidden(&mut self, op: Op, ty: Ty, operands: &[Operand]) -> Id {
        let id = self.module.id(Some(ty));
        self.nodes.push(Node::Inst(Inst { op, ty: Some(ty), id, operands: operands.to_vec() }));
        self.cost += self.times;
        id
    }

    /// An instruction with a result; values join those in scope.
    fn inst(&mut self, op: Op, ty: Ty, operands: &[Id]) -> Id {
        let operands: Vec<Operand> = operands.iter().map(|&id| Operand::Id(id)).collect();
        let id = self.hidden(op, ty, &operands);
        self.know(ty, id);
        id
    }

    fn know(&mut self, ty: Ty, id: Id) {
        if !matches!(self.module.at(ty), Type::Pointer(..) | Type::Void) {
            self.pool.push((ty, id));
        }
    }

    fn effect(&mut self, op: Op, operands: Vec<Operand>) {
        self.nodes.push(Node::Inst(Inst { op, ty: None, id: 0, operands }));
        self.cost += self.times;
    }

    /// A variable of the function, with an initializer or a store.
    fn local(&mut self, ty: Ty) -> Place {
        let pointer = self.module.pointer(StorageClass::Function, ty);
        let id = self.module.id(Some(pointer));
        let initializer =
            (self.times == 1 && self.depth == 0 && self.random.chance(1, 3)).then(|| self.constant(ty));
        self.variables.push(Variable { id, ty: pointer, initializer, decorations: Vec::new() });
        if initializer.is_none() {
            let value = if self.random.chance(1, 2) { self.constant(ty) } else { self.value(ty, 1) };
            self.effect(Op::Store, vec![Operand::Id(id), Operand::Id(value)]);
        }
        let place = Place { id, class: StorageClass::Function, to: ty, object: id };
        self.places.push(place);
        place
    }

    /// What each function begins with: who runs it, and its places.
    fn begin(&mut self) {
        let uvec3 = self.module.vector(Ty(1), 3);
        let gid = self.hidden(Op::Load, uvec3, &[Operand::Id(self.gid)]);
        self.own_index = self.hidden(Op::CompositeExtract, Ty(1), &[Operand::Id(gid), Operand::Literal(0)]);
        self.local_index = self.hidden(Op::Load, Ty(1), &[Operand::Id(self.lid)]);
        let (own_index, local_index) = (self.own_index, self.local_index);
        self.pool.push((Ty(1), own_index));
        if self.entry || self.random.chance(1, 3) {
            let words = self.input_words();
            for word in words {
                self.pool.push((Ty(1), word));
            }
        }
        let zero = self.word(0);
        if let Some((variable, element)) = self.own
            && (self.entry || self.random.chance(1, 3))
        {
            let pointer = self.module.pointer(StorageClass::StorageBuffer, element);
            let id = self.inst(Op::AccessChain, pointer, &[variable, zero, own_index]);
            self.places.push(Place { id, class: StorageClass::StorageBuffer, to: element, object: variable });
        }
        for (variable, element) in self.workgroup.clone() {
            if self.entry || self.random.chance(1, 3) {
                let pointer = self.module.pointer(StorageClass::Workgroup, element);
                let id = self.inst(Op::AccessChain, pointer, &[variable, local_index]);
                if self.entry {
                    // Without a call: functions may read the others.
                    let value = self.value(element, 0);
                    self.effect(Op::Store, vec![Operand::Id(id), Operand::Id(value)]);
                }
                self.places.push(Place { id, class: StorageClass::Workgroup, to: element, object: variable });
            }
        }
        if let Some((element, size)) = self.physical
            && (self.entry || self.random.chance(1, 3))
        {
            self.physical_place(element, size);
        }
    }

    fn input_words(&mut self) -> Vec<Id> {
        let pointer = self.module.pointer(StorageClass::StorageBuffer, Ty(1));
        let (zero, count) = (self.word(0), self.word(INPUTS as u32));
        let base = self.hidden(Op::IMul, Ty(1), &[Operand::Id(self.own_index), Operand::Id(count)]);
        (0..INPUTS)
            .map(|at| {
                let offset = self.word((HEAD + at) as u32);
                let index = self.hidden(Op::IAdd, Ty(1), &[Operand::Id(base), Operand::Id(offset)]);
                let place =
                    self.hidden(Op::AccessChain, pointer, &[self.input, zero, index].map(Operand::Id));
                self.hidden(Op::Load, Ty(1), &[Operand::Id(place)])
            })
            .collect()
    }

    /// A word that all invocations read.
    fn head_word(&mut self, at: u32) -> Id {
        let pointer = self.module.pointer(StorageClass::StorageBuffer, Ty(1));
        let (zero, at) = (self.word(0), self.word(at));
        let place = self.hidden(Op::AccessChain, pointer, &[self.input, zero, at].map(Operand::Id));
        self.hidden(Op::Load, Ty(1), &[Operand::Id(place)])
    }

    /// The invocation's element behind the device address.
    fn physical_place(&mut self, element: Ty, size: u32) {
        let pointer = self.module.pointer(StorageClass::PhysicalStorageBuffer, element);
        let wide = self.module.int(64, false);
        let uvec2 = self.module.vector(Ty(1), 2);
        let (low, high) = (self.head_word(0), self.head_word(1));
        let base = self.hidden(Op::CompositeConstruct, uvec2, &[Operand::Id(low), Operand::Id(high)]);
        let base = self.hidden(Op::Bitcast, wide, &[Operand::Id(base)]);
        let index = self.hidden(Op::UConvert, wide, &[Operand::Id(self.own_index)]);
        let size = self.splat(wide, size.into());
        let offset = self.hidden(Op::IMul, wide, &[Operand::Id(index), Operand::Id(size)]);
        let address = self.hidden(Op::IAdd, wide, &[Operand::Id(base), Operand::Id(offset)]);
        let id = if self.random.chance(1, 2) {
            self.hidden(Op::ConvertUToPtr, pointer, &[Operand::Id(address)])
        } else {
            self.hidden(Op::Bitcast, pointer, &[Operand::Id(address)])
        };
        self.count("physical storage");
        // All addresses lead into one buffer.
        self.places.push(Place {
            id,
            class: StorageClass::PhysicalStorageBuffer,
            to: element,
            object: PHYSICAL,
        });
    }

    /// A function that those behind it can call.
    fn helper(&mut self) {
        let (pool, places) = (self.pool.len(), self.places.len());
        let aliased = self.random.chance(1, 3);
        self.entry = false;
        self.uniform = false;
        self.cost = 0;
        self.times = 1;
        let id = self.module.id(None);
        let mut parameters = Vec::new();
        let mut declared = Vec::new();
        for _ in 0..self.random.pick(&[0, 1, 1, 1, 2, 2, 3]) {
            let (class, to) = match self.random.below(10) {
                0 => (StorageClass::Private, self.any_type()),
                1 if !self.workgroup.is_empty() => {
                    (StorageClass::Workgroup, self.random.pick(&self.workgroup).1)
                }
                2 | 3 if self.own.is_some() => (StorageClass::StorageBuffer, self.own.unwrap().1),
                4 | 5 if self.physical.is_some() => {
                    (StorageClass::PhysicalStorageBuffer, self.physical.unwrap().0)
                }
                _ => (StorageClass::Function, self.any_type()),
            };
            let private = self.places.iter().filter(|place| place.class == StorageClass::Private);
            let private: Vec<Ty> = private.map(|place| place.to).collect();
            let (class, to) = match class {
                StorageClass::Private if private.is_empty() => (StorageClass::Function, to),
                StorageClass::Private => (class, self.random.pick(&private)),
                _ => (class, to),
            };
            parameters.push(Parameter::Pointer(class, to));
        }
        for _ in 0..self.random.below(3) {
            let ty = self.any_type();
            parameters.push(Parameter::Value(ty));
        }
        let void =
            parameters.iter().any(|one| matches!(one, Parameter::Pointer(..))) && self.random.chance(1, 3);
        let result = if void { Ty(0) } else { self.any_type() };
        let mut types = Vec::new();
        for parameter in &parameters {
            let ty = match *parameter {
                Parameter::Value(ty) => ty,
                Parameter::Pointer(class, to) => self.module.pointer(class, to),
            };
            let id = self.module.id(Some(ty));
            types.push(ty);
            declared.push((id, ty));
            match *parameter {
                Parameter::Value(_) => self.pool.push((ty, id)),
                Parameter::Pointer(class, to) => {
                    if aliased || class != StorageClass::Function {
                        self.module.decorations.push(vec![id, Decoration::Aliased as u32]);
                    }
                    let object = match class {
                        StorageClass::Function => id,
                        StorageClass::StorageBuffer => self.own.map_or(0, |own| own.0),
                        StorageClass::PhysicalStorageBuffer => PHYSICAL,
                        _ => 0,
                    };
                    self.places.push(Place { id, class, to, object });
                }
            }
        }
        self.result = result;
        self.begin();
        for _ in 0..self.random.below(3) {
            let ty = self.any_type();
            self.local(ty);
        }
        let budget = 1 + self.random.below(6);
        let end = self.statements(budget);
        let end = end.unwrap_or_else(|| self.return_end());
        let body = Body { nodes: std::mem::take(&mut self.nodes), end };
        let ty = self.module.ty(Type::Function(result, types));
        let variables = std::mem::take(&mut self.variables);
        // `None`, `Inline`, `DontInline`, `Pure` and `Const` say nothing about results.
        let control = self.random.pick(&[0, 0, 0, 1, 2]);
        self.module.functions.push(Function { id, ty, control, parameters: declared, variables, body });
        self.callable.push(Signature { id, parameters, result, cost: self.cost + 2, aliased });
        self.pool.truncate(pool);
        self.places.truncate(places);
    }

    fn main(&mut self) {
        self.entry = true;
        self.uniform = true;
        self.cost = 0;
        self.times = 1;
        self.result = Ty(0);
        self.begin();
        for _ in 0..1 + self.random.below(4) {
            let ty = self.any_type();
            self.local(ty);
        }
        let budget = 3 + self.random.below(9);
        let end = self.statements(budget);
        let end = end.unwrap_or_else(|| {
            self.finish();
            End::Return(None)
        });
        let body = Body { nodes: std::mem::take(&mut self.nodes), end };
        let ty = self.module.ty(Type::Function(Ty(0), Vec::new()));
        let variables = std::mem::take(&mut self.variables);
        self.module.functions.push(Function {
            id: MAIN,
            ty,
            control: 0,
            parameters: Vec::new(),
            variables,
            body,
        });
    }

    /// What is left in places and values meets the outputs.
    fn finish(&mut self) {
        for slot in 2..OUTPUTS {
            let mut mixed = None;
            for _ in 0..3 {
                let part = self.some_word();
                mixed = Some(match mixed {
                    None => part,
                    Some(before) => {
                        let factor = self.word(31);
                        let product =
                            self.hidden(Op::IMul, Ty(1), &[Operand::Id(before), Operand::Id(factor)]);
                        self.hidden(Op::BitwiseXor, Ty(1), &[Operand::Id(product), Operand::Id(part)])
                    }
                });
            }
            self.out(slot as u32, mixed.expect("three parts"));
        }
    }

    /// Some scalar of a place or a value, as a word.
    fn some_word(&mut self) -> Id {
        let scalar = |module: &Module, ty: Ty| module.is_scalar(ty);
        if self.random.chance(2, 3) && !self.places.is_empty() {
            let place = {
                let places = std::mem::take(&mut self.places);
                let place = self.random.pick(&places);
                self.places = places;
                place
            };
            let paths = self.module.paths(place.to, &|ty| scalar(&self.module, ty));
            let path = paths[self.random.below(paths.len())].clone();
            let ty = self.module.at_path(place.to, &path);
            let pointer = self.chain(place, &path);
            let value = self.load(pointer, place.class, ty);
            return self.as_word(ty, value);
        }
        let at = self.random.below(self.pool.len());
        let (ty, value) = self.pool[at];
        let paths = self.module.paths(ty, &|ty| scalar(&self.module, ty));
        let path = paths[self.random.below(paths.len())].clone();
        let part = self.module.at_path(ty, &path);
        let value = self.extract(ty, value, &path);
        self.as_word(part, value)
    }

    fn out(&mut self, slot: u32, value: Id) {
        let pointer = self.module.pointer(StorageClass::StorageBuffer, Ty(1));
        let (zero, count, slot) = (self.word(0), self.word(OUTPUTS as u32), self.word(slot));
        let base = self.hidden(Op::IMul, Ty(1), &[Operand::Id(self.own_index), Operand::Id(count)]);
        let index = self.hidden(Op::IAdd, Ty(1), &[Operand::Id(base), Operand::Id(slot)]);
        let place = self.hidden(Op::AccessChain, pointer, &[self.output, zero, index].map(Operand::Id));
        self.effect(Op::Store, vec![Operand::Id(place), Operand::Id(value)]);
        self.count("output");
    }

    /// The operands that say how memory is aligned, where they are needed.
    fn aligned(&self, class: StorageClass, ty: Ty) -> Vec<Operand> {
        if class != StorageClass::PhysicalStorageBuffer {
            return Vec::new();
        }
        let scalars = self.module.paths(ty, &|part| self.module.is_scalar(part));
        let widths = scalars.iter().map(|path| self.module.width(self.module.at_path(ty, path)));
        vec![Operand::Literal(2), Operand::Literal(widths.max().unwrap_or(32) / 8)]
    }
}
