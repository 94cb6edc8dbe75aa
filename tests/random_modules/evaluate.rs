//! What a module means: a plain walk over its words, one invocation at a time, from the specification.
//!
//! Values are lists of scalars, and each scalar may be undefined; what would let an undefined one be
//! seen, like everything else that the specification leaves undefined, ends the walk. Invocations of a
//! workgroup run one after the other up to a barrier or a subgroup instruction, where they meet.

use rspirv::spirv::{BuiltIn, GlslStd450Op as GLOp, GroupOperation, Op, StorageClass};

use crate::arithmetic as exact;
use crate::reader::{Cell, Code, Id, MatrixLayout, Read, Type};

/// The buffers of a dispatch, by binding; the last one is that of the device address.
#[derive(Clone, Debug, PartialEq)]
pub struct Memory {
    pub buffers: Vec<Vec<u8>>,
    pub address: u64,
}

/// Instructions that an invocation may run.
const FUEL: u32 = 60_000;

/// Runs a module; what it leaves in memory, or what it does that means nothing.
pub fn run(words: &[u32], memory: &Memory, groups: u32, subgroup: u32) -> Result<Memory, String> {
    run_watched(words, memory, groups, subgroup).map(|(memory, _)| memory)
}

/// The same, and whether a division was met whose result Vulkan leaves open.
pub fn run_watched(
    words: &[u32],
    memory: &Memory,
    groups: u32,
    subgroup: u32,
) -> Result<(Memory, bool), String> {
    let read = crate::reader::read(words);
    let mut machine = Machine {
        read: &read,
        memory: memory.clone(),
        owners: memory.buffers.iter().map(|buffer| vec![0; buffer.len()]).collect(),
        workgroup: Vec::new(),
        claims: Vec::new(),
        epoch: 0,
        groups,
        subgroup,
        open: std::cell::Cell::new(false),
    };
    for group in 0..groups {
        machine.group(group)?;
    }
    let open = machine.open.get();
    Ok((machine.memory, open))
}

struct Machine<'a> {
    read: &'a Read,
    memory: Memory,
    /// By buffer and byte: the invocation that it belongs to, from 1 on.
    owners: Vec<Vec<u32>>,
    workgroup: Vec<Cell>,
    claims: Vec<Claim>,
    /// Barriers so far.
    epoch: u32,
    groups: u32,
    subgroup: u32,
    open: std::cell::Cell<bool>,
}

/// Who has read and written a cell of a workgroup's memory since the last barrier, from 1 on.
#[derive(Clone, Copy, Default)]
struct Claim {
    epoch: u32,
    writer: u32,
    reader: u32,
}

/// More than one invocation.
const MANY: u32 = u32::MAX;

/// What all invocations read, and what they change by atomic instructions.
const COMMON: [usize; 2] = [0, 3];

struct Invocation {
    values: Vec<Cell>,
    own: Vec<Cell>,
    at: usize,
    label: Id,
    before: Id,
    /// Where calls return to, and what holds their results.
    calls: Vec<(usize, Id, Id)>,
    group: u32,
    local: u32,
    fuel: u32,
    done: bool,
}

type Outcome<T> = Result<T, String>;

fn defined(bits: u64) -> Cell {
    Cell { bits, defined: true }
}

fn truth(value: bool) -> Cell {
    defined(value.into())
}

fn known(cell: Cell) -> Outcome<u64> {
    if cell.defined { Ok(cell.bits) } else { Err("undefined: an undefined value is seen".into()) }
}

/// Where something lies.
enum Spot {
    Own(usize),
    Workgroup(usize),
    Buffer(usize, usize),
    Builtin(BuiltIn),
}

impl Machine<'_> {
    fn group(&mut self, group: u32) -> Outcome<()> {
        let read = self.read;
        self.workgroup = vec![Cell::default(); read.workgroup_cells as usize];
        self.claims = vec![Claim::default(); self.workgroup.len()];
        self.epoch += 1;
        let mut all: Vec<Invocation> = (0..read.local_size)
            .map(|local| Invocation {
                values: vec![Cell::default(); read.value_cells as usize],
                own: vec![Cell::default(); read.own_cells as usize],
                at: read.functions[&read.entry] as usize,
                label: 0,
                before: 0,
                calls: Vec::new(),
                group,
                local,
                fuel: FUEL,
                done: false,
            })
            .collect();
        for variable in read.variables.values() {
            let Some(initializer) = variable.initializer else { continue };
            let value = read.constant_cells(initializer);
            match variable.class {
                StorageClass::Private => {
                    for one in &mut all {
                        one.own[variable.cells as usize..][..value.len()].copy_from_slice(&value);
                    }
                }
                StorageClass::Workgroup => {
                    self.workgroup[variable.cells as usize..][..value.len()].copy_from_slice(&value)
                }
                _ => {}
            }
        }
        for one in &mut all {
            self.enter(one, read.entry);
        }
        loop {
            for one in &mut all {
                if !one.done {
                    self.walk(one)?;
                }
            }
            if all.iter().all(|one| one.done) {
                return Ok(());
            }
            let at = all[0].at;
            if all.iter().any(|one| one.done || one.at != at) {
                return Err("undefined: invocations do not meet".into());
            }
            let code = read.code[at];
            if code.op == Op::ControlBarrier {
                self.epoch += 1;
            } else {
                let size = self.subgroup as usize;
                for members in all.chunks_mut(size) {
                    self.together(code, members)?;
                }
            }
            all.iter_mut().for_each(|one| one.at += 1);
        }
    }

    /// A function's variables begin anew with each call.
    fn enter(&self, one: &mut Invocation, function: Id) {
        for id in self.read.function_variables.get(&function).into_iter().flatten() {
            let variable = &self.read.variables[id];
            let size = self.read.cells[variable.pointee as usize] as usize;
            let cells = &mut one.own[variable.cells as usize..][..size];
            match variable.initializer {
                Some(initializer) => cells.copy_from_slice(&self.read.constant_cells(initializer)),
                None => cells.fill(Cell::default()),
            }
        }
    }

    fn words(&self, code: Code) -> &[u32] {
        &self.read.words[code.start as usize..(code.start + code.count) as usize]
    }

    fn value<'b>(&'b self, one: &'b Invocation, id: Id) -> &'b [Cell] {
        let (at, count) = (self.read.slot[id as usize] as usize, self.size(self.read.type_of[id as usize]));
        if self.read.is_constant[id as usize] {
            &self.read.constants[at..at + count]
        } else {
            &one.values[at..at + count]
        }
    }

    fn number(&self, one: &Invocation, id: Id) -> Outcome<u64> {
        known(self.value(one, id)[0])
    }

    fn size(&self, ty: Id) -> usize {
        self.read.cells[ty as usize] as usize
    }

    fn ty(&self, ty: Id) -> &Type {
        &self.read.types[ty as usize]
    }

    fn type_of(&self, id: Id) -> &Type {
        self.ty(self.read.type_of[id as usize])
    }

    /// The type of a vector's components, or the type itself.
    fn scalar(&self, ty: Id) -> &Type {
        match self.ty(ty) {
            Type::Vector(of, _) | Type::Matrix(of, _) => self.scalar(*of),
            other => other,
        }
    }

    fn width(&self, ty: Id) -> u32 {
        match self.scalar(ty) {
            Type::Int(width, _) | Type::Float(width) => *width,
            _ => 64,
        }
    }

    fn set(&self, one: &mut Invocation, id: Id, cells: &[Cell]) {
        let at = self.read.slot[id as usize] as usize;
        one.values[at..at + cells.len()].copy_from_slice(cells);
    }

    /// Runs an invocation to its end, or to where others must come along.
    fn walk(&mut self, one: &mut Invocation) -> Outcome<()> {
        let read = self.read;
        let mut result: Vec<Cell> = Vec::new();
        loop {
            one.fuel = one.fuel.checked_sub(1).ok_or("costly: no end in sight")?;
            let code = read.code[one.at];
            let w = &read.words[code.start as usize..(code.start + code.count) as usize];
            match code.op {
                Op::Label => {
                    one.before = std::mem::replace(&mut one.label, w[1]);
                    one.at += 1;
                    self.phis(one)?;
                }
                Op::SelectionMerge | Op::LoopMerge | Op::Nop | Op::MemoryBarrier => one.at += 1,
                Op::Branch => one.at = read.labels[w[1] as usize] as usize,
                Op::BranchConditional => {
                    let target = if self.number(one, w[1])? == 1 { w[2] } else { w[3] };
                    one.at = read.labels[target as usize] as usize;
                }
                Op::Switch => {
                    let selector = self.number(one, w[1])?;
                    let width = self.width(read.type_of[w[1] as usize]);
                    let words = if width == 64 { 2 } else { 1 };
                    let cases = w[3..].chunks(words + 1).find(|case| {
                        let high = if words == 2 { u64::from(case[1]) << 32 } else { 0 };
                        (u64::from(case[0]) | high) & exact::mask(width) == selector
                    });
                    one.at = read.labels[cases.map_or(w[2], |case| case[words]) as usize] as usize;
                }
                Op::Return | Op::ReturnValue => {
                    let Some((at, label, id)) = one.calls.pop() else {
                        one.done = true;
                        return Ok(());
                    };
                    if code.op == Op::ReturnValue {
                        let value = self.value(one, w[1]).to_vec();
                        self.set(one, id, &value);
                    }
                    (one.at, one.label) = (at, label);
                }
                Op::Unreachable => return Err("undefined: OpUnreachable".into()),
                Op::FunctionCall => {
                    let mut at = read.functions[&w[3]] as usize;
                    let mut arguments = w[4..].iter();
                    while read.code[at].op == Op::FunctionParameter {
                        let parameter = read.words[read.code[at].start as usize + 2];
                        let value = self.value(one, *arguments.next().expect("an argument")).to_vec();
                        self.set(one, parameter, &value);
                        at += 1;
                    }
                    one.calls.push((one.at + 1, one.label, w[2]));
                    self.enter(one, w[3]);
                    one.at = at;
                }
                Op::ControlBarrier => return Ok(()),
                op if (Op::GroupNonUniformElect as u32..=Op::GroupNonUniformQuadSwap as u32)
                    .contains(&(op as u32)) =>
                {
                    return Ok(());
                }
                _ => {
                    result.clear();
                    self.instruction(one, code, &mut result)?;
                    if crate::reader::has_result(code.op) {
                        let w = self.words(code);
                        debug_assert_eq!(result.len(), self.size(w[1]), "{:?}", code.op);
                        self.set(one, w[2], &result);
                    }
                    one.at += 1;
                }
            }
        }
    }

    /// All phis of a block take their values at once.
    fn phis(&self, one: &mut Invocation) -> Outcome<()> {
        let mut taken: Vec<(Id, Vec<Cell>)> = Vec::new();
        while self.read.code[one.at].op == Op::Phi {
            let w = self.words(self.read.code[one.at]);
            let edge = w[3..].chunks(2).find(|edge| edge[1] == one.before).ok_or("a phi lacks an edge")?;
            taken.push((w[2], self.value(one, edge[0]).to_vec()));
            one.at += 1;
        }
        for (id, cells) in taken {
            self.set(one, id, &cells);
        }
        Ok(())
    }

    fn spot(&self, pointer: Id, bits: u64) -> Outcome<Spot> {
        let Type::Pointer(class, _) = *self.type_of(pointer) else { return Err("no pointer".into()) };
        if class == StorageClass::PhysicalStorageBuffer {
            let last = self.memory.buffers.len() - 1;
            let offset = bits.checked_sub(self.memory.address).ok_or("undefined: an address below all")?;
            return Ok(Spot::Buffer(last, offset as usize));
        }
        let variable = &self.read.variables[&((bits >> 32) as u32)];
        let offset = bits as u32 as usize;
        let cell = variable.cells as usize + offset;
        Ok(match class {
            StorageClass::Function | StorageClass::Private => Spot::Own(cell),
            StorageClass::Workgroup => Spot::Workgroup(cell),
            StorageClass::Input => Spot::Builtin(variable.builtin.ok_or("an input")?),
            _ => Spot::Buffer(variable.binding.ok_or("a binding")? as usize, offset),
        })
    }

    fn load(&mut self, one: &Invocation, pointer: Id, out: &mut Vec<Cell>) -> Outcome<()> {
        let bits = self.number(one, pointer)?;
        let Type::Pointer(_, pointee) = *self.type_of(pointer) else { return Err("no pointer".into()) };
        let size = self.size(pointee);
        match self.spot(pointer, bits)? {
            Spot::Own(at) => out.extend(&one.own[at..at + size]),
            Spot::Workgroup(at) => {
                self.claim(one, at..at + size, false)?;
                out.extend(&self.workgroup[at..at + size]);
            }
            Spot::Buffer(buffer, at) => {
                let layout = self.read.pointer_layout.get(&pointer).copied().flatten();
                let mut failed = None;
                let me = one.group * self.read.local_size + one.local + 1;
                let mut owners = std::mem::take(&mut self.owners[buffer]);
                self.places(pointee, at, layout, &mut |at, width| {
                    let bytes = width as usize / 8;
                    if !owns(&mut owners, at..at + bytes, me, buffer) {
                        failed = Some(RACE);
                    }
                    match self.memory.buffers[buffer].get(at..at + bytes) {
                        Some(found) => {
                            let bits =
                                found.iter().rev().fold(0u64, |bits, byte| bits << 8 | u64::from(*byte));
                            out.push(defined(bits));
                        }
                        None => failed = Some("undefined: a load outside of a buffer"),
                    }
                });
                self.owners[buffer] = owners;
                if let Some(problem) = failed {
                    return Err(problem.into());
                }
            }
            Spot::Builtin(builtin) => {
                let vector = |x: u32, rest: u64| [defined(x.into()), defined(rest), defined(rest)];
                let (group, local, size) = (one.group, one.local, self.read.local_size);
                match builtin {
                    BuiltIn::GlobalInvocationId => out.extend(vector(group * size + local, 0)),
                    BuiltIn::LocalInvocationId => out.extend(vector(local, 0)),
                    BuiltIn::WorkgroupId => out.extend(vector(group, 0)),
                    BuiltIn::NumWorkgroups => out.extend(vector(self.groups, 1)),
                    BuiltIn::LocalInvocationIndex => out.push(defined(local.into())),
                    BuiltIn::SubgroupLocalInvocationId => out.push(defined((local % self.subgroup).into())),
                    BuiltIn::SubgroupSize => out.push(defined(self.subgroup.into())),
                    BuiltIn::SubgroupId => out.push(defined((local / self.subgroup).into())),
                    other => return Err(format!("{other:?}")),
                }
            }
        }
        Ok(())
    }

    fn store(&mut self, one: &mut Invocation, pointer: Id, cells: &[Cell]) -> Outcome<()> {
        let bits = self.number(one, pointer)?;
        let Type::Pointer(_, pointee) = *self.type_of(pointer) else { return Err("no pointer".into()) };
        match self.spot(pointer, bits)? {
            Spot::Own(at) => one.own[at..at + cells.len()].copy_from_slice(cells),
            Spot::Workgroup(at) => {
                self.claim(one, at..at + cells.len(), true)?;
                self.workgroup[at..at + cells.len()].copy_from_slice(cells);
            }
            Spot::Buffer(buffer, at) => {
                let layout = self.read.pointer_layout.get(&pointer).copied().flatten();
                let mut spots = Vec::new();
                self.places(pointee, at, layout, &mut |at, width| spots.push((at, width as usize / 8)));
                let me = one.group * self.read.local_size + one.local + 1;
                for ((at, bytes), cell) in spots.into_iter().zip(cells) {
                    let bits = known(*cell)?;
                    if !owns(&mut self.owners[buffer], at..at + bytes, me, buffer) {
                        return Err(RACE.into());
                    }
                    let Some(to) = self.memory.buffers[buffer].get_mut(at..at + bytes) else {
                        return Err("undefined: a store outside of a buffer".into());
                    };
                    to.copy_from_slice(&bits.to_le_bytes()[..bytes]);
                }
            }
            Spot::Builtin(_) => return Err("a store to an input".into()),
        }
        Ok(())
    }

    /// Notes who reads or writes workgroup memory between two barriers.
    fn claim(&mut self, one: &Invocation, cells: std::ops::Range<usize>, writes: bool) -> Outcome<()> {
        let me = one.local + 1;
        for claim in &mut self.claims[cells] {
            if claim.epoch != self.epoch {
                *claim = Claim { epoch: self.epoch, writer: 0, reader: 0 };
            }
            let others = |who: u32| who != 0 && who != me;
            if others(claim.writer) || writes && others(claim.reader) {
                return Err(RACE.into());
            }
            match writes {
                true => claim.writer = me,
                false if others(claim.reader) => claim.reader = MANY,
                false => claim.reader = me,
            }
        }
        Ok(())
    }

    /// The offset and the width of each scalar of a type in a buffer, in order.
    fn places(&self, ty: Id, at: usize, layout: MatrixLayout, visit: &mut dyn FnMut(usize, u32)) {
        match self.ty(ty) {
            Type::Int(width, _) | Type::Float(width) => visit(at, *width),
            Type::Pointer(..) => visit(at, 64),
            Type::Vector(of, count) => {
                let width = self.width(*of);
                let step = match layout {
                    Some((stride, true)) => stride as usize,
                    _ => width as usize / 8,
                };
                (0..*count as usize).for_each(|index| visit(at + index * step, width));
            }
            Type::Matrix(column, count) => {
                let (stride, rows) = layout.expect("a matrix's stride");
                let step = if rows { self.width(*column) as usize / 8 } else { stride as usize };
                (0..*count as usize).for_each(|index| self.places(*column, at + index * step, layout, visit));
            }
            Type::Array(element, count, stride) => {
                for index in 0..*count as usize {
                    self.places(*element, at + index * *stride as usize, layout, visit);
                }
            }
            Type::Struct(members) => {
                for (index, member) in members.iter().enumerate() {
                    let key = (ty, index as u32);
                    let layout = self.read.matrices.get(&key).copied();
                    self.places(*member, at + self.read.offsets[&key] as usize, layout, visit);
                }
            }
            _ => {}
        }
    }

    /// How far a part of a type lies from its beginning: in cells, or in bytes of a buffer.
    fn step(&self, ty: Id, index: u64, bytes: bool, layout: MatrixLayout) -> Outcome<(Id, u64)> {
        let outside = |count: u32| {
            if index >= u64::from(count) {
                Err(format!("undefined: index {index} of {count}"))
            } else {
                Ok(())
            }
        };
        Ok(match self.ty(ty) {
            Type::Struct(members) => {
                let member = members[index as usize];
                let cells = members[..index as usize].iter().map(|&member| self.size(member) as u64).sum();
                (member, if bytes { self.read.offsets[&(ty, index as u32)].into() } else { cells })
            }
            Type::Vector(of, count) => {
                outside(*count)?;
                let step = match layout {
                    Some((stride, true)) => stride,
                    _ => self.width(*of) / 8,
                };
                (*of, if bytes { index * u64::from(step) } else { index })
            }
            Type::Matrix(column, count) => {
                outside(*count)?;
                let step = match layout {
                    Some((_, true)) => self.width(*column) / 8,
                    Some((stride, false)) => stride,
                    None => 0,
                };
                (*column, index * if bytes { u64::from(step) } else { self.size(*column) as u64 })
            }
            Type::Array(element, count, stride) => {
                outside(*count)?;
                (*element, index * if bytes { u64::from(*stride) } else { self.size(*element) as u64 })
            }
            Type::Runtime(element, stride) => (*element, index * u64::from(*stride)),
            other => return Err(format!("an index into {other:?}")),
        })
    }

    fn chain(&self, one: &Invocation, w: &[u32]) -> Outcome<Cell> {
        let bits = self.number(one, w[3])?;
        let Type::Pointer(class, mut ty) = *self.type_of(w[3]) else { return Err("no pointer".into()) };
        let bytes = matches!(class, StorageClass::StorageBuffer | StorageClass::PhysicalStorageBuffer);
        let mut layout = self.read.pointer_layout.get(&w[3]).copied().flatten();
        let mut offset = 0u64;
        for &id in &w[4..] {
            let index = self.number(one, id)?;
            let width = self.width(self.read.type_of[id as usize]);
            // Indices are signed.
            let index =
                u64::try_from(exact::signed(index, width)).map_err(|_| "undefined: a negative index")?;
            if let Type::Struct(_) = self.ty(ty) {
                layout = self.read.matrices.get(&(ty, index as u32)).copied();
            }
            let (part, by) = self.step(ty, index, bytes, layout)?;
            (ty, offset) = (part, offset + by);
        }
        Ok(defined(bits + offset))
    }

    /// The first cell and the type of the part that literal indices name.
    fn part(&self, mut ty: Id, indices: &[u32]) -> Outcome<(usize, Id)> {
        let mut at = 0;
        for &index in indices {
            let (part, by) = self.step(ty, index.into(), false, None)?;
            (ty, at) = (part, at + by as usize);
        }
        Ok((at, ty))
    }

    /// An instruction that reads and writes values and memory.
    fn instruction(&mut self, one: &mut Invocation, code: Code, out: &mut Vec<Cell>) -> Outcome<()> {
        let read = self.read;
        let w = &read.words[code.start as usize..(code.start + code.count) as usize];
        match code.op {
            Op::Undef => out.extend(vec![Cell::default(); self.size(w[1])]),
            Op::Load => self.load(one, w[3], out)?,
            Op::Store => {
                let cells = self.value(one, w[2]).to_vec();
                self.store(one, w[1], &cells)?;
            }
            Op::CopyMemory => {
                self.load(one, w[2], out)?;
                self.store(one, w[1], out)?;
            }
            Op::AccessChain | Op::InBoundsAccessChain => {
                let pointer = self.chain(one, w)?;
                out.push(pointer);
            }
            Op::CopyObject | Op::CopyLogical => out.extend(self.value(one, w[3])),
            Op::CompositeConstruct => w[3..].iter().for_each(|&part| out.extend(self.value(one, part))),
            Op::CompositeExtract => {
                let (at, ty) = self.part(read.type_of[w[3] as usize], &w[4..])?;
                out.extend(&self.value(one, w[3])[at..at + self.size(ty)]);
            }
            Op::CompositeInsert => {
                let (at, ty) = self.part(w[1], &w[5..])?;
                out.extend(self.value(one, w[4]));
                out[at..at + self.size(ty)].copy_from_slice(self.value(one, w[3]));
            }
            Op::VectorShuffle => {
                let both = [self.value(one, w[3]), self.value(one, w[4])].concat();
                out.extend(w[5..].iter().map(|&at| both.get(at as usize).copied().unwrap_or_default()));
            }
            Op::VectorExtractDynamic => {
                let index = self.number(one, w[4])? as usize;
                out.push(*self.value(one, w[3]).get(index).ok_or("undefined: a component that is none")?);
            }
            Op::VectorInsertDynamic => {
                let index = self.number(one, w[5])? as usize;
                out.extend(self.value(one, w[3]));
                *out.get_mut(index).ok_or("undefined: a component that is none")? = self.value(one, w[4])[0];
            }
            Op::Select => {
                let conditions = self.value(one, w[3]);
                let (yes, no) = (self.value(one, w[4]), self.value(one, w[5]));
                for at in 0..yes.len() {
                    let condition = conditions[if conditions.len() == 1 { 0 } else { at }];
                    out.push(if known(condition)? == 1 { yes[at] } else { no[at] });
                }
            }
            Op::Transpose => {
                let Type::Matrix(column, columns) = *self.type_of(w[3]) else {
                    return Err("no matrix".into());
                };
                let rows = self.size(column);
                let cells = self.value(one, w[3]);
                for row in 0..rows {
                    out.extend((0..columns as usize).map(|column| cells[column * rows + row]));
                }
            }
            Op::ConvertUToPtr | Op::ConvertPtrToU => out.extend(self.value(one, w[3])),
            Op::Bitcast => self.bitcast(one, w, out)?,
            op if (Op::AtomicLoad as u32..=Op::AtomicXor as u32).contains(&(op as u32)) => {
                self.atomic(one, op, w, out)?;
            }
            op => self.arithmetic(one, op, w, out)?,
        }
        Ok(())
    }

    fn bitcast(&self, one: &Invocation, w: &[u32], out: &mut Vec<Cell>) -> Outcome<()> {
        let (from, to) = (self.width(read_type(self.read, w[3])) as usize, self.width(w[1]) as usize);
        let mut bits = Vec::new();
        for cell in self.value(one, w[3]) {
            let value = known(*cell)?;
            bits.extend((0..from).map(|at| value >> at & 1));
        }
        out.extend(
            bits.chunks(to).map(|part| defined(part.iter().rev().fold(0, |value, bit| value << 1 | bit))),
        );
        Ok(())
    }

    fn atomic(&mut self, one: &mut Invocation, op: Op, w: &[u32], out: &mut Vec<Cell>) -> Outcome<()> {
        let pointer = if op == Op::AtomicStore { w[1] } else { w[3] };
        let Type::Pointer(_, pointee) = *self.type_of(pointer) else { return Err("no pointer".into()) };
        let width = self.width(pointee);
        let mut before = Vec::new();
        self.load(one, pointer, &mut before)?;
        let old = known(before[0])?;
        let operand = |at: usize| self.number(one, w[at]);
        let of = |op: Op, b: u64| exact::integers(op, old, b, width).ok_or("an atomic instruction");
        let extended =
            |op: GLOp, b: u64| exact::extended_integers(op, &[old, b], width).ok_or("an atomic instruction");
        let new = match op {
            Op::AtomicLoad => old,
            Op::AtomicStore => operand(4)?,
            Op::AtomicExchange => operand(6)?,
            Op::AtomicCompareExchange => {
                if operand(8)? == old {
                    operand(7)?
                } else {
                    old
                }
            }
            Op::AtomicIIncrement => of(Op::IAdd, 1)?,
            Op::AtomicIDecrement => of(Op::ISub, 1)?,
            Op::AtomicIAdd => of(Op::IAdd, operand(6)?)?,
            Op::AtomicISub => of(Op::ISub, operand(6)?)?,
            Op::AtomicAnd => of(Op::BitwiseAnd, operand(6)?)?,
            Op::AtomicOr => of(Op::BitwiseOr, operand(6)?)?,
            Op::AtomicXor => of(Op::BitwiseXor, operand(6)?)?,
            Op::AtomicSMin => extended(GLOp::SMin, operand(6)?)?,
            Op::AtomicUMin => extended(GLOp::UMin, operand(6)?)?,
            Op::AtomicSMax => extended(GLOp::SMax, operand(6)?)?,
            Op::AtomicUMax => extended(GLOp::UMax, operand(6)?)?,
            other => return Err(format!("{other:?}")),
        };
        self.store(one, pointer, &[defined(new)])?;
        if op != Op::AtomicStore {
            out.push(defined(old));
        }
        Ok(())
    }

    /// Instructions that take numbers and give numbers.
    fn arithmetic(&self, one: &Invocation, op: Op, w: &[u32], out: &mut Vec<Cell>) -> Outcome<()> {
        let (extended, operands) = match op {
            Op::ExtInst => (Some(GLOp::from_u32(w[4]).ok_or("an extended instruction")?), &w[5..]),
            _ => (None, &w[3..]),
        };
        let mut values: [&[Cell]; 4] = [&[]; 4];
        for (at, &operand) in operands.iter().enumerate() {
            values[at] = self.value(one, operand);
        }
        let of = read_type(self.read, operands[0]);
        let (from, width) = (self.scalar(of).clone(), self.width(of));
        let to = self.scalar(w[1]).clone();
        let to_width = self.width(w[1]);
        let number = |operand: usize, at: usize| {
            known(values[operand][if values[operand].len() == 1 { 0 } else { at }])
        };
        let undefined = || format!("undefined: {op:?} {extended:?}");
        match op {
            Op::Any | Op::All => {
                let mut found = Vec::new();
                for cell in values[0] {
                    found.push(known(*cell)? == 1);
                }
                out.push(truth(if op == Op::Any { found.contains(&true) } else { !found.contains(&false) }));
                return Ok(());
            }
            Op::IAddCarry | Op::ISubBorrow | Op::UMulExtended | Op::SMulExtended => {
                let mut high = Vec::new();
                let width = self.width(of);
                for at in 0..values[0].len() {
                    let (a, b) = (number(0, at)?, number(1, at)?);
                    let (low, more) = match op {
                        Op::IAddCarry => {
                            (a.wrapping_add(b), u64::from((u128::from(a) + u128::from(b)) >> width != 0))
                        }
                        Op::ISubBorrow => (a.wrapping_sub(b), u64::from(a < b)),
                        Op::UMulExtended => {
                            (a.wrapping_mul(b), ((u128::from(a) * u128::from(b)) >> width) as u64)
                        }
                        _ => {
                            let product = exact::signed(a, width) * exact::signed(b, width);
                            (product as u64, (product >> width) as u64)
                        }
                    };
                    out.push(defined(low & exact::mask(width)));
                    high.push(defined(more & exact::mask(width)));
                }
                out.extend(high);
                return Ok(());
            }
            Op::OuterProduct => {
                for at in 0..values[1].len() {
                    for row in 0..values[0].len() {
                        let product =
                            exact::floats(Op::FMul, known(values[0][row])?, known(values[1][at])?, to_width);
                        out.push(defined(product.ok_or_else(undefined)?));
                    }
                }
                return Ok(());
            }
            _ => {}
        }
        for at in 0..self.size(w[1]) {
            let a = number(0, at)?;
            let cell = match (op, extended, &from) {
                (Op::LogicalNot, ..) => truth(a == 0),
                (Op::LogicalAnd, ..) => truth(a == 1 && number(1, at)? == 1),
                (Op::LogicalOr, ..) => truth(a == 1 || number(1, at)? == 1),
                (Op::LogicalEqual, ..) => truth(a == number(1, at)?),
                (Op::LogicalNotEqual, ..) => truth(a != number(1, at)?),
                (Op::IsNan, ..) => truth(exact::float(a, width).is_nan()),
                (Op::IsInf, ..) => truth(exact::float(a, width).is_infinite()),
                (Op::SNegate, ..) => defined(a.wrapping_neg() & exact::mask(width)),
                (Op::Not, ..) => defined(!a & exact::mask(width)),
                (Op::BitCount, ..) => defined((0..width).map(|bit| a >> bit & 1).sum()),
                (Op::BitReverse, ..) => {
                    defined((0..width).map(|bit| (a >> bit & 1) << (width - 1 - bit)).sum())
                }
                (Op::BitFieldInsert, ..) => {
                    let (insert, offset, count) = (number(1, at)?, number(2, at)?, number(3, at)?);
                    if u128::from(offset) + u128::from(count) > width.into() {
                        return Err(undefined());
                    }
                    let field = if count == 0 { 0 } else { exact::mask(count as u32) << offset };
                    defined(a & !field | insert.checked_shl(offset as u32).unwrap_or(0) & field)
                }
                (Op::BitFieldUExtract | Op::BitFieldSExtract, ..) => {
                    let (offset, count) = (number(1, at)?, number(2, at)?);
                    if u128::from(offset) + u128::from(count) > width.into() {
                        return Err(undefined());
                    }
                    defined(match count {
                        0 => 0,
                        _ if op == Op::BitFieldUExtract => a >> offset & exact::mask(count as u32),
                        _ => exact::signed(a >> offset, count as u32) as u64 & exact::mask(width),
                    })
                }
                (Op::UConvert, ..) => defined(a & exact::mask(to_width)),
                (Op::SConvert, ..) => defined(exact::signed(a, width) as u64 & exact::mask(to_width)),
                (Op::ConvertUToF, ..) => defined(exact::integer_to_float(a.into(), to_width)),
                (Op::ConvertSToF, ..) => defined(exact::integer_to_float(exact::signed(a, width), to_width)),
                (Op::ConvertFToU | Op::ConvertFToS, ..) => {
                    let Type::Int(..) = to else { return Err(undefined()) };
                    let found =
                        exact::float_to_integer(exact::float(a, width), to_width, op == Op::ConvertFToS);
                    defined(found.ok_or_else(undefined)?)
                }
                (Op::FConvert, ..) => defined(exact::rounded(exact::float(a, width), to_width)),
                (Op::FNegate, ..) => defined(a ^ 1 << (width - 1)),
                (Op::FmaKHR, ..) => defined(exact::fused(a, number(1, at)?, number(2, at)?, width)),
                (Op::VectorTimesScalar | Op::MatrixTimesScalar, ..) => {
                    defined(exact::floats(Op::FMul, a, number(1, at)?, width).ok_or_else(undefined)?)
                }
                (Op::ExtInst, Some(extended), Type::Float(_)) => {
                    let count = operands.len();
                    let mut all = [a; 3];
                    for (operand, value) in all.iter_mut().enumerate().take(count).skip(1) {
                        *value = number(operand, at)?;
                    }
                    defined(exact::extended_floats(extended, &all, width).ok_or_else(undefined)?)
                }
                (Op::ExtInst, Some(extended), _) => {
                    let count = operands.len();
                    let mut all = [a; 3];
                    for (operand, value) in all.iter_mut().enumerate().take(count).skip(1) {
                        *value = number(operand, at)?;
                    }
                    defined(exact::extended_integers(extended, &all, width).ok_or_else(undefined)?)
                }
                (_, _, Type::Float(_)) => {
                    let b = number(1, at)?;
                    if op == Op::FDiv {
                        // The range in which the precision of `OpFDiv` is given.
                        let most = match width {
                            16 => 2f64.powi(14),
                            32 => 2f64.powi(126),
                            _ => 2f64.powi(1022),
                        };
                        let fixed = (1.0 / most..=most).contains(&exact::float(b, width).abs());
                        self.open.set(self.open.get() || !fixed);
                    }
                    match exact::compares_floats(op, exact::float(a, width), exact::float(b, width)) {
                        Some(holds) => truth(holds),
                        None => defined(exact::floats(op, a, b, width).ok_or_else(undefined)?),
                    }
                }
                _ => {
                    let b = number(1, at)?;
                    match exact::compares(op, a, b, width) {
                        Some(holds) => truth(holds),
                        None => defined(exact::integers(op, a, b, width).ok_or_else(undefined)?),
                    }
                }
            };
            out.push(cell);
        }
        Ok(())
    }

    /// A subgroup instruction: all members of a subgroup take part.
    fn together(&self, code: Code, members: &mut [Invocation]) -> Outcome<()> {
        let w = self.words(code).to_vec();
        let count = members.len();
        let size = self.size(w[1]);
        let width = self.width(w[1]);
        let is_float = matches!(self.scalar(w[1]), Type::Float(_));
        let mut results: Vec<Vec<Cell>> = vec![Vec::new(); count];
        let last = *w.last().expect("an operand");
        let operand = if matches!(code.op, Op::GroupNonUniformElect) { w[1] } else { w[4] };
        let value = |at: usize, id: Id| self.value(&members[at], id).to_vec();
        let scan = |at: usize, operation: GroupOperation| match operation {
            GroupOperation::Reduce => 0..count,
            GroupOperation::InclusiveScan => 0..at + 1,
            _ => 0..at,
        };
        for at in 0..count {
            let from = |source: u64| -> Outcome<Vec<Cell>> {
                // What an invocation that is none has is not defined.
                Ok(if source < count as u64 {
                    value(source as usize, operand)
                } else {
                    vec![Cell::default(); size]
                })
            };
            let own = |id: Id| self.number(&members[at], id);
            results[at] = match code.op {
                Op::GroupNonUniformElect => vec![truth(at == 0)],
                Op::GroupNonUniformAll | Op::GroupNonUniformAny => {
                    let mut all = Vec::new();
                    for one in 0..count {
                        all.push(known(value(one, operand)[0])? == 1);
                    }
                    vec![truth(if code.op == Op::GroupNonUniformAll {
                        !all.contains(&false)
                    } else {
                        all.contains(&true)
                    })]
                }
                Op::GroupNonUniformAllEqual => {
                    let first = value(0, operand);
                    let mut same = true;
                    for one in 0..count {
                        for (a, b) in value(one, operand).iter().zip(&first) {
                            same &= known(*a)? == known(*b)?;
                        }
                    }
                    vec![truth(same)]
                }
                Op::GroupNonUniformBallot => {
                    let mut words = [0u64; 4];
                    for one in 0..count {
                        words[one / 32] |= known(value(one, operand)[0])? << (one % 32);
                    }
                    words.map(defined).to_vec()
                }
                Op::GroupNonUniformBroadcast => from(own(last)?)?,
                Op::GroupNonUniformBroadcastFirst => from(0)?,
                Op::GroupNonUniformShuffle => from(own(last)?)?,
                Op::GroupNonUniformShuffleXor => from(at as u64 ^ own(last)?)?,
                Op::GroupNonUniformShuffleUp => from((at as u64).wrapping_sub(own(last)?))?,
                Op::GroupNonUniformShuffleDown => from(at as u64 + own(last)?)?,
                Op::GroupNonUniformInverseBallot | Op::GroupNonUniformBallotBitExtract => {
                    let bit =
                        if code.op == Op::GroupNonUniformInverseBallot { at as u64 } else { own(last)? };
                    let ballot = value(at, operand);
                    let word = *ballot.get(bit as usize / 32).ok_or("undefined: no such bit")?;
                    vec![truth(known(word)? >> (bit % 32) & 1 == 1)]
                }
                Op::GroupNonUniformBallotBitCount => {
                    let ballot = value(at, last);
                    let mut sum = 0;
                    // Bits of the subgroup's own invocations count.
                    for bit in scan(at, GroupOperation::from_u32(w[4]).ok_or("a group operation")?) {
                        sum += known(ballot[bit / 32])? >> (bit % 32) & 1;
                    }
                    vec![defined(sum)]
                }
                op => {
                    let operation = GroupOperation::from_u32(w[4]).ok_or("a group operation")?;
                    let mut all: Vec<Vec<u64>> = Vec::new();
                    for one in scan(at, operation) {
                        let cells = value(one, w[5]);
                        all.push(cells.into_iter().map(known).collect::<Result<_, _>>()?);
                    }
                    let mut result = Vec::new();
                    for component in 0..size {
                        let mut values = all.iter().map(|cells| cells[component]);
                        let combine = |a: u64, b: u64| -> Option<u64> {
                            match op {
                                Op::GroupNonUniformIAdd => exact::integers(Op::IAdd, a, b, width),
                                Op::GroupNonUniformIMul => exact::integers(Op::IMul, a, b, width),
                                Op::GroupNonUniformBitwiseAnd => Some(a & b),
                                Op::GroupNonUniformBitwiseOr => Some(a | b),
                                Op::GroupNonUniformBitwiseXor => Some(a ^ b),
                                Op::GroupNonUniformLogicalAnd => Some(a & b),
                                Op::GroupNonUniformLogicalOr => Some(a | b),
                                Op::GroupNonUniformLogicalXor => Some(a ^ b),
                                Op::GroupNonUniformUMin => {
                                    exact::extended_integers(GLOp::UMin, &[a, b], width)
                                }
                                Op::GroupNonUniformUMax => {
                                    exact::extended_integers(GLOp::UMax, &[a, b], width)
                                }
                                Op::GroupNonUniformSMin => {
                                    exact::extended_integers(GLOp::SMin, &[a, b], width)
                                }
                                Op::GroupNonUniformSMax => {
                                    exact::extended_integers(GLOp::SMax, &[a, b], width)
                                }
                                _ => None,
                            }
                        };
                        // "The identity I for Operation": of an exclusive scan's first invocation.
                        let identity = match op {
                            Op::GroupNonUniformIMul | Op::GroupNonUniformLogicalAnd => 1,
                            Op::GroupNonUniformBitwiseAnd | Op::GroupNonUniformUMin => exact::mask(width),
                            Op::GroupNonUniformSMin => exact::mask(width) >> 1,
                            Op::GroupNonUniformSMax => 1 << (width - 1),
                            _ => 0,
                        };
                        let start = values.next().unwrap_or(identity);
                        let mut sum = start;
                        for value in values {
                            sum =
                                combine(sum, value).filter(|_| !is_float).ok_or_else(|| format!("{op:?}"))?;
                        }
                        result.push(defined(sum));
                    }
                    result
                }
            };
        }
        for (one, result) in members.iter_mut().zip(&results) {
            self.set(one, w[2], result);
        }
        Ok(())
    }
}

const RACE: &str = "undefined: two invocations meet in memory";

/// Whether bytes of a buffer belong to an invocation, which takes those that belong to nobody yet.
fn owns(owners: &mut [u32], bytes: std::ops::Range<usize>, me: u32, buffer: usize) -> bool {
    COMMON.contains(&buffer)
        || owners.get_mut(bytes).is_none_or(|owners| {
            owners.iter_mut().all(|owner| {
                if *owner == 0 {
                    *owner = me;
                }
                *owner == me
            })
        })
}

fn read_type(read: &Read, id: Id) -> Id {
    read.type_of[id as usize]
}
