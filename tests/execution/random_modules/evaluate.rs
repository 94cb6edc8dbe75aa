//! What a module means: a plain walk over its words, one invocation at a time, from the
//! specification.
//!
//! Values are lists of scalars, and each scalar may be undefined; what would let an undefined one
//! be seen, like everything else that the specification leaves undefined, ends the walk.
//! Invocations of a workgroup run one after the other up to a barrier or a subgroup instruction,
//! where they meet.

mod compute;
mod memory;
mod subgroup;

use rspirv::spirv::{Op, StorageClass};

use super::arithmetic as exact;
use super::reader::{Cell, Code, Id, Read, Type};

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

/// As [`run`], and whether a result was met that Vulkan leaves open: a division by what is very
/// small or very large, a subnormal number.
pub fn run_watched(
    words: &[u32],
    memory: &Memory,
    groups: u32,
    subgroup: u32,
) -> Result<(Memory, bool), String> {
    let read = super::reader::read(words);
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
                    if super::reader::has_result(code.op) {
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
            Op::ArrayLength => out.push(self.array_length(one, w)?),
            Op::Bitcast => self.bitcast(one, w, out)?,
            op if (Op::AtomicLoad as u32..=Op::AtomicXor as u32).contains(&(op as u32)) => {
                self.atomic(one, op, w, out)?;
            }
            op => self.arithmetic(one, op, w, out)?,
        }
        Ok(())
    }
}

fn read_type(read: &Read, id: Id) -> Id {
    read.type_of[id as usize]
}
