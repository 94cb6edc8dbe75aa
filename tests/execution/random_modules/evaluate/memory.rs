//! Pointers, loads, stores and atomic instructions, and whether two invocations meet in memory.

use rspirv::spirv::{BuiltIn, GlslStd450Op as GLOp, Op, StorageClass};

use super::super::arithmetic as exact;
use super::super::reader::{Id, MatrixLayout, Type};
use super::{COMMON, Cell, Claim, Invocation, MANY, Machine, Outcome, defined, known};

/// Where something lies.
enum Spot {
    Own(usize),
    Workgroup(usize),
    Buffer(usize, usize),
    Builtin(BuiltIn),
}

impl Machine<'_> {
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

    pub(super) fn load(&mut self, one: &Invocation, pointer: Id, out: &mut Vec<Cell>) -> Outcome<()> {
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

    pub(super) fn store(&mut self, one: &mut Invocation, pointer: Id, cells: &[Cell]) -> Outcome<()> {
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
    /// How many elements of a block's last member lie in its buffer.
    pub(super) fn array_length(&self, one: &Invocation, w: &[u32]) -> Outcome<Cell> {
        let Type::Pointer(_, block) = *self.type_of(w[3]) else { return Err("no pointer".into()) };
        let Type::Struct(members) = self.ty(block) else { return Err("no block".into()) };
        let Type::Runtime(_, stride) = *self.ty(members[w[4] as usize]) else {
            return Err("no runtime array".into());
        };
        let Spot::Buffer(buffer, at) = self.spot(w[3], self.number(one, w[3])?)? else {
            return Err("no buffer".into());
        };
        let offset = at + self.read.offsets[&(block, w[4])] as usize;
        Ok(defined(((self.memory.buffers[buffer].len() - offset) / stride as usize) as u64))
    }

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

    pub(super) fn chain(&self, one: &Invocation, w: &[u32]) -> Outcome<Cell> {
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
    pub(super) fn part(&self, mut ty: Id, indices: &[u32]) -> Outcome<(usize, Id)> {
        let mut at = 0;
        for &index in indices {
            let (part, by) = self.step(ty, index.into(), false, None)?;
            (ty, at) = (part, at + by as usize);
        }
        Ok((at, ty))
    }

    pub(super) fn atomic(
        &mut self,
        one: &mut Invocation,
        op: Op,
        w: &[u32],
        out: &mut Vec<Cell>,
    ) -> Outcome<()> {
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
