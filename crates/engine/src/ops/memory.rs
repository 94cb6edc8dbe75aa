//! Memory instructions (SPIR-V 3.3.8): the operations that move words, and how they run.
//!
//! Function, Private, Input, payload and attribute variables are registers of the register file, so
//! a load or store through constant indices is a move, and only a computed index needs a
//! [`MemoryOp::Gather`]. Buffers are addressed by bytes.

use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use smallvec::SmallVec;

use crate::machine::device_memory::DeviceMemory;
use crate::machine::stop::RegSpan;
use crate::machine::{
    AccessFault, Batch, Bindings, Buffer, Invocations, Lanes, Mask, REGISTER_POINTER, Reg, Registers,
    TrapCode,
};
use crate::math::random::Random;
use crate::ops::access::{Access, ComputedRegisters, OperandKind, RegCopy};

/// The value of a computed offset whose index is outside its array: an access through it traps.
pub const OUT_OF_BOUNDS: u32 = u32::MAX;

/// The buffer of a load or store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferRef {
    /// A descriptor known before running.
    Handle(u32),
    /// A descriptor's handle in a register.
    Computed(Reg),
    /// The push constants.
    PushConstants,
    /// The data of each lane's shader record.
    ShaderRecord,
    /// The memory of each lane's workgroup.
    Workgroup,
    /// Whatever lies at the device address in this register and the next.
    Address(Reg),
}

/// The handle that stands for [`BufferRef::PushConstants`] in a [`BufferRef::Computed`].
pub const PUSH_CONSTANTS_HANDLE: u32 = u32::MAX - 1;
/// The handle that stands for [`BufferRef::ShaderRecord`] in a [`BufferRef::Computed`].
pub const SHADER_RECORD_HANDLE: u32 = u32::MAX - 2;
/// The handle that stands for [`BufferRef::Workgroup`] in a [`BufferRef::Computed`].
pub const WORKGROUP_HANDLE: u32 = u32::MAX - 3;

/// A range of a buffer: consecutive scalars of `width` bits (8, 16 or 32).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// The buffer.
    pub buffer: BufferRef,
    /// The constant part of the byte offset.
    pub offset: u32,
    /// The computed part of the byte offset.
    pub index: Option<Reg>,
    /// Bits of a scalar.
    pub width: u32,
    /// The number of scalars.
    pub count: u32,
    /// The alignment that a device address must have, in bytes.
    pub alignment: u32,
}

impl BufferRef {
    fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        match *self {
            Self::Computed(reg) => visit(Access::Read(reg, 1)),
            Self::Address(reg) => visit(Access::Read(reg, 2)),
            _ => {}
        }
    }
}

impl Chunk {
    /// Reports the registers that say where the chunk is.
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        self.buffer.accesses(visit);
        if let Some(index) = self.index {
            visit(Access::Read(index, 1));
        }
    }
}

/// An operation that moves words.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "a variant's line tells its fields")]
pub enum MemoryOp {
    /// Copies a register, in all lanes.
    Move { to: Reg, from: Reg },
    /// Copies a register in the running lanes only.
    MoveMasked { to: Reg, from: Reg },
    /// `to = base + index * stride`, or [`OUT_OF_BOUNDS`] where the index is not below `length`.
    Index { to: Reg, base: Option<Reg>, index: Reg, stride: u32, length: Length },
    /// Reads `count` registers from `first + index[lane]` on; see [`Reg::computed`].
    Gather { to: Reg, count: u32, first: Reg, index: Reg },
    /// Writes `count` registers from `first + index[lane]` on; see [`Reg::computed`].
    Scatter { from: Reg, count: u32, first: Reg, index: Reg },
    /// Reads scalars of a buffer into consecutive registers.
    BufferLoad { to: Reg, chunk: Chunk },
    /// Writes scalars of consecutive registers to a buffer.
    BufferStore { from: Reg, chunk: Chunk },
    /// Says that registers are undefined from here on: those of a variable that begins to live
    /// without an initializer, or of `OpUndef`. It does nothing by itself, and only programs that
    /// are not optimised have it.
    Undefine { first: Reg, count: u32 },
    /// Says that registers are defined from here on: the result of `OpFreezeKHR`. It does nothing
    /// by itself, and only programs that are not optimised have it.
    Freeze { first: Reg, count: u32 },
    /// The number of elements of a runtime array at an offset of a buffer.
    ArrayLength { to: Reg, buffer: BufferRef, offset: u32, stride: u32 },
}

/// An offset that an index chooses: `to = base + index * stride`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComputedOffset {
    /// The register of the offset.
    pub to: Reg,
    /// The register of what the offset begins at.
    pub base: Option<Reg>,
    /// The register of the index.
    pub index: Reg,
    /// The distance between elements.
    pub stride: u32,
    /// The number of elements.
    pub length: Length,
}

/// The number of elements that an index may select from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// A known number.
    Known(u32),
    /// Unknown, as for a runtime array: the access itself is checked.
    Unknown,
}

impl MemoryOp {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        match self {
            Self::Move { to, from } | Self::MoveMasked { to, from } => {
                visit(Access::Read(*from, 1));
                visit(Access::Write(*to, 1));
            }
            Self::Index { to, base, index, .. } => {
                visit(Access::Read(*index, 1));
                if let Some(base) = base {
                    visit(Access::Read(*base, 1));
                }
                visit(Access::Write(*to, 1));
            }
            Self::Gather { to, count, index, .. } => {
                visit(Access::Read(*index, 1));
                visit(Access::Write(*to, *count));
            }
            Self::Scatter { from, count, index, .. } => {
                visit(Access::Read(*index, 1));
                visit(Access::Read(*from, *count));
                visit(Access::Effect);
            }
            Self::BufferLoad { to, chunk } => {
                chunk.accesses(visit);
                visit(Access::Write(*to, chunk.count));
            }
            Self::BufferStore { from, chunk } => {
                chunk.accesses(visit);
                visit(Access::Read(*from, chunk.count));
                visit(Access::Effect);
            }
            Self::Undefine { .. } | Self::Freeze { .. } => visit(Access::Effect),
            Self::ArrayLength { to, buffer: which, .. } => {
                which.accesses(visit);
                visit(Access::Write(*to, 1));
            }
        }
    }

    /// The part of a buffer that is loaded or stored.
    pub(super) fn chunk(&self) -> Option<&Chunk> {
        self.load().or_else(|| self.store()).map(|(_, chunk)| chunk)
    }

    /// See [`crate::ops::op::Op::visit_single_registers`].
    #[inline]
    pub(super) fn visit_single_registers(&mut self, mut visit: impl FnMut(&mut Reg, OperandKind)) {
        match self {
            Self::Move { to, from } | Self::MoveMasked { to, from } => {
                visit(from, OperandKind::Use);
                visit(to, OperandKind::Def);
            }
            Self::Index { to, base, index, .. } => {
                visit(index, OperandKind::Use);
                base.iter_mut().for_each(|base| visit(base, OperandKind::Use));
                visit(to, OperandKind::Def);
            }
            Self::BufferLoad { to, chunk } => {
                chunk.index.iter_mut().for_each(|index| visit(index, OperandKind::Use));
                if chunk.count == 1 {
                    visit(to, OperandKind::Def);
                }
            }
            Self::BufferStore { from, chunk } => {
                chunk.index.iter_mut().for_each(|index| visit(index, OperandKind::Use));
                if chunk.count == 1 {
                    visit(from, OperandKind::Use);
                }
            }
            _ => {}
        }
    }

    /// The copy of one register that the operation is.
    #[inline]
    pub fn copy(&self) -> Option<RegCopy> {
        match *self {
            Self::Move { to, from } => Some(RegCopy { to, from, is_masked: false }),
            Self::MoveMasked { to, from } => Some(RegCopy { to, from, is_masked: true }),
            _ => None,
        }
    }

    /// The offset that the operation computes of an index.
    #[inline]
    pub(super) fn computed_offset(&self) -> Option<ComputedOffset> {
        match *self {
            Self::Index { to, base, index, stride, length } => {
                Some(ComputedOffset { to, base, index, stride, length })
            }
            _ => None,
        }
    }

    /// The first register that takes what the operation loads of a buffer.
    pub(super) fn load(&self) -> Option<(Reg, &Chunk)> {
        match self {
            Self::BufferLoad { to, chunk } => Some((*to, chunk)),
            _ => None,
        }
    }

    /// The first register of what the operation stores to a buffer.
    pub(super) fn store(&self) -> Option<(Reg, &Chunk)> {
        match self {
            Self::BufferStore { from, chunk } => Some((*from, chunk)),
            _ => None,
        }
    }

    /// See [`crate::ops::op::Op::only_computes`].
    pub(super) fn only_computes(&self) -> bool {
        matches!(self, Self::Move { .. } | Self::MoveMasked { .. } | Self::Index { .. })
    }

    /// The registers that the operation makes undefined.
    pub fn undefines(&self) -> Option<RegSpan> {
        match *self {
            Self::Undefine { first, count } => Some(RegSpan { first, count }),
            _ => None,
        }
    }

    /// The access to registers that an index chooses.
    #[inline]
    pub fn computed_registers(&self) -> Option<ComputedRegisters> {
        match *self {
            Self::Gather { to, count, first, index } => {
                Some(ComputedRegisters { first, index, count, other: to, writes: false })
            }
            Self::Scatter { from, count, first, index } => {
                Some(ComputedRegisters { first, index, count, other: from, writes: true })
            }
            _ => None,
        }
    }

    /// Runs the operation for the running lanes.
    #[inline]
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        match *self {
            Self::Move { to, from } => {
                let register = batch.registers[from];
                batch.registers[to] = register;
            }
            Self::MoveMasked { to, from } => batch.registers.copy(to, from, batch.mask),
            Self::Index { to, base, index, stride, length } => {
                index_lanes(batch, to, base, index, stride, length)
            }
            Self::Gather { to, count, first, index } => {
                for_each_register(batch, first, index, count, |registers, lane, at| {
                    for word in 0..count {
                        registers[to.plus(word)].0[lane] = registers[at.plus(word)].0[lane];
                    }
                });
            }
            Self::Scatter { from, count, first, index } => {
                for_each_register(batch, first, index, count, |registers, lane, at| {
                    for word in 0..count {
                        registers[at.plus(word)].0[lane] = registers[from.plus(word)].0[lane];
                    }
                });
            }
            Self::BufferLoad { to, chunk } => {
                if broadcast_load(batch, bindings, to, &chunk) {
                    return;
                }
                if let Some((words, firsts)) = word_indices(batch, bindings, &chunk) {
                    for scalar in 0..chunk.count {
                        let register = &mut batch.registers[to.plus(scalar)];
                        for lane in batch.mask.lanes() {
                            register.0[lane] = words[(firsts.0[lane] + scalar) as usize].load(Relaxed);
                        }
                    }
                    return;
                }
                for_each_access(
                    batch,
                    bindings,
                    &chunk,
                    |registers, lane, buffer, offset| {
                        for scalar in 0..chunk.count {
                            let at = offset + u64::from(scalar * (chunk.width / 8));
                            registers[to.plus(scalar)].0[lane] = buffer.load(at, chunk.width)?;
                        }
                        Some(())
                    },
                    |registers, lane, outside| outside.load(registers, lane, to, &chunk),
                );
            }
            Self::BufferStore { from, chunk } => {
                if let Some((words, firsts)) = word_indices(batch, bindings, &chunk) {
                    let registers = batch.registers.span_mut(from, chunk.count);
                    // Lane by lane, as the words of different lanes may overlap.
                    for lane in batch.mask.lanes() {
                        let words = &words[firsts.0[lane] as usize..];
                        for (at, register) in registers.iter().enumerate() {
                            words[at].store(register.0[lane], Relaxed);
                        }
                    }
                    return;
                }
                for_each_access(
                    batch,
                    bindings,
                    &chunk,
                    |registers, lane, buffer, offset| {
                        for scalar in 0..chunk.count {
                            let at = offset + u64::from(scalar * (chunk.width / 8));
                            buffer.store(at, chunk.width, registers[from.plus(scalar)].0[lane])?;
                        }
                        Some(())
                    },
                    |registers, lane, outside| outside.store(registers, lane, from, &chunk),
                );
            }
            Self::Undefine { .. } | Self::Freeze { .. } => {}
            Self::ArrayLength { to, buffer, offset, stride } => {
                for lane in batch.mask.lanes() {
                    match resolve_buffer(&batch.registers, lane, &batch.invocations, bindings, buffer) {
                        Ok((_, _, size)) => {
                            let length = size.saturating_sub(u64::from(offset)) / u64::from(stride.max(1));
                            batch.registers[to].0[lane] = u32::try_from(length).unwrap_or(u32::MAX);
                        }
                        Err(code) => trap(batch, Mask::lane(lane), code),
                    }
                }
            }
        }
    }
}

/// Calls a function for each running lane with the register that its index selects, from which on
/// `count` registers must exist; lanes whose index is out of bounds trap.
#[inline(always)]
fn for_each_register<const W: usize>(
    batch: &mut Batch<W>,
    first: Reg,
    index: Reg,
    count: u32,
    mut access: impl FnMut(&mut Registers<W>, usize, Reg),
) {
    let indices = batch.registers[index];
    let (mut outside, mut null) = (Mask::NONE, Mask::NONE);
    for lane in batch.mask.lanes() {
        match computed_register(&batch.registers, first, indices.0[lane], count) {
            Ok(at) => access(&mut batch.registers, lane, at),
            Err(TrapCode::NullPointer) => null = null | Mask::lane(lane),
            Err(_) => outside = outside | Mask::lane(lane),
        }
    }
    trap(batch, outside, TrapCode::IndexOutOfBounds);
    trap(batch, null, TrapCode::NullPointer);
}

/// The register that an index selects, from which on `count` registers must exist; see
/// [`Reg::computed`].
///
/// # Errors
/// `IndexOutOfBounds`, `NullPointer`
#[inline(always)]
pub fn computed_register<const W: usize>(
    registers: &Registers<W>,
    first: Reg,
    index: u32,
    count: u32,
) -> Result<Reg, TrapCode> {
    let at = first.computed(index);
    if index != OUT_OF_BOUNDS && u64::from(at.0) + u64::from(count) <= registers.len() as u64 {
        return Ok(at);
    }
    let null = first.0 >= REGISTER_POINTER && index < REGISTER_POINTER;
    Err(if null { TrapCode::NullPointer } else { TrapCode::IndexOutOfBounds })
}

#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[inline]
fn index_lanes<const W: usize>(
    batch: &mut Batch<W>,
    to: Reg,
    base: Option<Reg>,
    index: Reg,
    stride: u32,
    length: Length,
) {
    const MAX_OFFSET: u32 = OUT_OF_BOUNDS - 1;
    // The number of indices whose product with the stride does not exceed the greatest offset.
    let max_index_count = (MAX_OFFSET / stride.max(1)).saturating_add(1);
    let count = match length {
        Length::Known(length) => length.min(max_index_count),
        Length::Unknown => max_index_count,
    };
    let registers = &batch.registers;
    let mut register = [0; W];
    let any_outside = registers.cpu_tier().run_loop(
        #[inline(always)]
        || {
            let zero = Lanes::splat(0);
            let (indices, bases) = (&registers[index], base.map_or(&zero, |base| &registers[base]));
            let running = batch.mask.words();
            let mut any_outside = 0;
            for lane in 0..W {
                let (index, base) = (indices.0[lane], bases.0[lane]);
                let product = index.wrapping_mul(stride);
                let inside = index < count;
                let fits = inside & (base <= MAX_OFFSET.wrapping_sub(product));
                register[lane] = if fits { product.wrapping_add(base) } else { OUT_OF_BOUNDS };
                any_outside |= u32::from(!inside) & running.0[lane];
            }
            any_outside
        },
    );
    if any_outside != 0 {
        let outside = Mask::from_fn(|lane| registers[index].0[lane] >= count);
        batch.out_of_bounds_indices.record(batch.op, batch.mask & outside, &batch.registers[index]);
    }
    batch.registers[to].0 = register;
}

#[cold]
fn trap_lanes<const W: usize>(batch: &mut Batch<W>, mask: Mask<W>, code: TrapCode) {
    let op = batch.op;
    batch.trap(mask, code, op);
}

/// Traps lanes at the running operation.
#[inline]
pub fn trap<const W: usize>(batch: &mut Batch<W>, mask: Mask<W>, code: TrapCode) {
    if !mask.is_empty() {
        trap_lanes(batch, mask, code);
    }
}

/// The buffer that a lane accesses, with the offset and size of the part that it may access.
#[inline]
fn resolve_buffer<'a, const W: usize>(
    registers: &Registers<W>,
    lane: usize,
    invocations: &'a Invocations<W>,
    bindings: &'a Bindings,
    buffer: BufferRef,
) -> Result<(&'a Buffer, u64, u64), TrapCode> {
    let whole = |buffer: Option<&'a Buffer>| {
        buffer.map(|buffer| (buffer, 0, buffer.size())).ok_or(TrapCode::DescriptorMissing)
    };
    let record = || match invocations.record(lane) {
        Some(record) => Ok((&*record.data, record.offset, record.size)),
        None => Err(TrapCode::ShaderRecordEmpty),
    };
    let workgroup = || whole(invocations.workgroup(lane).map(|group| &*group.memory));
    match buffer {
        BufferRef::Handle(handle) => whole(bindings.buffer(handle)),
        BufferRef::PushConstants => whole(bindings.push_constants.as_deref()),
        BufferRef::ShaderRecord => record(),
        BufferRef::Workgroup => workgroup(),
        BufferRef::Computed(reg) => match registers[reg].0[lane] {
            PUSH_CONSTANTS_HANDLE => whole(bindings.push_constants.as_deref()),
            SHADER_RECORD_HANDLE => record(),
            WORKGROUP_HANDLE => workgroup(),
            handle => match whole(bindings.buffer(handle)) {
                Err(_) if handle == OUT_OF_BOUNDS => Err(TrapCode::IndexOutOfBounds),
                Err(_) if Bindings::slot_of(handle).is_none() => Err(TrapCode::NullPointer),
                found => found,
            },
        },
        BufferRef::Address(reg) => {
            let address = address(registers, reg, lane);
            let null = DeviceMemory::is_null(address);
            let found = bindings.memory.buffer(address);
            let (buffer, start) =
                found.ok_or(if null { TrapCode::NullPointer } else { TrapCode::AddressInvalid })?;
            Ok((buffer, start, buffer.size().saturating_sub(start)))
        }
    }
}

fn address<const W: usize>(registers: &Registers<W>, reg: Reg, lane: usize) -> u64 {
    u64::from(registers[reg].0[lane]) | u64::from(registers[reg.plus(1)].0[lane]) << 32
}

/// The byte offset of a lane's access, or its device address.
#[inline]
pub(super) fn fault_value<const W: usize>(registers: &Registers<W>, lane: usize, chunk: &Chunk) -> u64 {
    let index = chunk.index.map_or(0, |reg| registers[reg].0[lane]);
    let base = if let BufferRef::Address(reg) = chunk.buffer { address(registers, reg, lane) } else { 0 };
    base.wrapping_add(u64::from(chunk.offset) + u64::from(index))
}

/// The buffer of a lane's access with the byte offset there, checked; else the trap, with the
/// offset or address of the access.
#[inline]
fn locate<'a, const W: usize>(
    registers: &Registers<W>,
    lane: usize,
    invocations: &'a Invocations<W>,
    bindings: &'a Bindings,
    chunk: &Chunk,
) -> Result<(&'a Buffer, u64), (TrapCode, u64)> {
    let index = chunk.index.map_or(0, |reg| registers[reg].0[lane]);
    let offset = u64::from(chunk.offset) + u64::from(index);
    let fault_value = fault_value(registers, lane, chunk);
    let found = resolve_buffer(registers, lane, invocations, bindings, chunk.buffer);
    let (buffer, start, size) = found.map_err(|code| (code, fault_value))?;
    let outside = offset + u64::from(chunk.width / 8 * chunk.count) > size;
    match chunk.buffer {
        _ if index == OUT_OF_BOUNDS => Err((TrapCode::IndexOutOfBounds, fault_value)),
        BufferRef::Address(_) if outside => Err((TrapCode::AddressOutOfBounds, fault_value)),
        BufferRef::Address(_) if !fault_value.is_multiple_of(chunk.alignment.max(1).into()) => {
            Err((TrapCode::AddressMisaligned, fault_value))
        }
        _ if outside => Err((TrapCode::BufferOutOfBounds, fault_value)),
        _ => Ok((buffer, start + offset)),
    }
}

/// The location of a lane's access: the buffer and the byte offset there; `None` where it lies
/// outside.
pub fn access_location<'a, const W: usize>(
    batch: &'a Batch<W>,
    lane: usize,
    bindings: &'a Bindings,
    chunk: &Chunk,
) -> Option<(&'a Buffer, u64)> {
    locate(&batch.registers, lane, &batch.invocations, bindings, chunk).ok()
}

/// The buffer of an access, where it is the same for all lanes, as it mostly is.
#[inline]
fn lane_invariant_buffer<'a>(bindings: &'a Bindings, chunk: &Chunk) -> Option<&'a Buffer> {
    match chunk.buffer {
        BufferRef::Handle(handle) => bindings.buffer(handle),
        BufferRef::PushConstants => bindings.push_constants.as_deref(),
        _ => None,
    }
}

/// Loads a value once, into all lanes, as nothing reads it in those that do not run; `false` where
/// lanes may access different locations.
#[inline]
fn broadcast_load<const W: usize>(batch: &mut Batch<W>, bindings: &Bindings, to: Reg, chunk: &Chunk) -> bool {
    let Some(buffer) = lane_invariant_buffer(bindings, chunk).filter(|_| chunk.index.is_none()) else {
        return false;
    };
    let offset = u64::from(chunk.offset);
    if offset + u64::from(chunk.width / 8 * chunk.count) > buffer.size() {
        return false;
    }
    for scalar in 0..chunk.count {
        let at = offset + u64::from(scalar * (chunk.width / 8));
        let Some(word) = buffer.load(at, chunk.width) else { return false };
        batch.registers.set(to.plus(scalar), word);
    }
    true
}

/// The words of the buffer that all lanes access, and the index of each running lane's first word;
/// `None` unless all accesses are of whole words inside the buffer.
#[inline]
fn word_indices<'a, const W: usize>(
    batch: &Batch<W>,
    bindings: &'a Bindings,
    chunk: &Chunk,
) -> Option<(&'a [AtomicU32], Lanes<W>)> {
    let buffer = lane_invariant_buffer(bindings, chunk)
        .filter(|_| chunk.width == 32 && chunk.offset.is_multiple_of(4))?;
    let end = u64::from(chunk.offset) + u64::from(chunk.count * 4);
    // The greatest index stands for one that is out of bounds, whatever the size of the buffer.
    let max_index = u32::try_from(buffer.size().checked_sub(end)?).unwrap_or(u32::MAX).min(OUT_OF_BOUNDS - 1);
    let indices = &batch.registers[chunk.index?];
    let mut firsts = Lanes::splat(0);
    let outside = batch.registers.cpu_tier().run_loop(
        #[inline(always)]
        || {
            let running = batch.mask.words();
            let mut outside = 0;
            for lane in 0..W {
                let index = indices.0[lane] & running.0[lane];
                outside |= u32::from(index > max_index) | index & 3;
                firsts.0[lane] = (index >> 2) + (chunk.offset >> 2);
            }
            outside
        },
    );
    (outside == 0).then(|| (buffer.words(), firsts))
}

/// Calls a function for each running lane, in ascending order, with the buffer and the byte offset
/// of its access; lanes whose access is outside trap, or are passed to `outside` where the policy
/// is [`MemoryPolicy::Robust`](crate::machine::MemoryPolicy::Robust).
#[inline(always)]
pub fn for_each_access<const W: usize>(
    batch: &mut Batch<W>,
    bindings: &Bindings,
    chunk: &Chunk,
    mut access: impl FnMut(&mut Registers<W>, usize, &Buffer, u64) -> Option<()>,
    mut outside: impl FnMut(&mut Registers<W>, usize, OutOfBoundsAccess<'_>),
) {
    let mut failed = SmallVec::<[(usize, TrapCode, u64); 1]>::new();
    let shared = lane_invariant_buffer(bindings, chunk);
    let bytes = u64::from(chunk.width / 8 * chunk.count);
    for lane in batch.mask.lanes() {
        if let Some(buffer) = shared {
            let index = chunk.index.map_or(0, |reg| batch.registers[reg].0[lane]);
            let offset = u64::from(chunk.offset) + u64::from(index);
            if index != OUT_OF_BOUNDS
                && offset + bytes <= buffer.size()
                && access(&mut batch.registers, lane, buffer, offset).is_some()
            {
                continue;
            }
        }
        let found = locate(&batch.registers, lane, &batch.invocations, bindings, chunk);
        let done = found.and_then(|(buffer, offset)| {
            let done = access(&mut batch.registers, lane, buffer, offset);
            done.ok_or((TrapCode::BufferOutOfBounds, offset))
        });
        if let Err((code, fault_value)) = done {
            failed.push((lane, code, fault_value));
        }
    }
    for (lane, code, fault_value) in failed {
        let found = resolve_buffer(&batch.registers, lane, &batch.invocations, bindings, chunk.buffer);
        let bounds = matches!(code, TrapCode::BufferOutOfBounds | TrapCode::IndexOutOfBounds);
        let robust = |buffer: &Buffer| bindings.is_robust() || buffer.is_null();
        if let (true, Ok((buffer, start, size))) = (bounds, &found)
            && robust(buffer)
            && !is_workgroup(&batch.registers, lane, chunk.buffer)
        {
            let offset = if code == TrapCode::IndexOutOfBounds { u64::MAX } else { fault_value };
            let drawn = match &bindings.choices {
                Some(choices) if bindings.is_robust() && !buffer.is_null() => {
                    choices.draw_robust_read(batch.invocations.launch_id(lane), batch.op, offset)
                }
                _ => None,
            };
            let access_outside = OutOfBoundsAccess { buffer, start: *start, size: *size, offset, drawn };
            outside(&mut batch.registers, lane, access_outside);
            continue;
        }
        let handle = match chunk.buffer {
            BufferRef::Handle(handle) => Some(handle),
            BufferRef::Computed(reg) => Some(batch.registers[reg].0[lane]),
            _ => None,
        };
        let fault = match (found, handle) {
            _ if matches!(chunk.buffer, BufferRef::Address(_)) => AccessFault::address(fault_value, bindings),
            (Ok((buffer, _, size)), handle) => {
                let view = buffer.view_of().map(|name| (name.clone(), buffer.offset()));
                Some(AccessFault::Buffer { handle, size, view })
            }
            (Err(_), Some(handle)) => Some(AccessFault::descriptor(handle, bindings)),
            (Err(_), None) => None,
        };
        fault.into_iter().for_each(|fault| batch.record_access_fault(lane, fault));
        batch.fault_value[lane] = fault_value;
        trap_lanes(batch, Mask::lane(lane), code);
    }
}

/// Whether a lane's access is to the memory of its workgroup.
#[inline]
pub fn is_workgroup<const W: usize>(registers: &Registers<W>, lane: usize, buffer: BufferRef) -> bool {
    match buffer {
        BufferRef::Workgroup => true,
        BufferRef::Computed(reg) => registers[reg].0[lane] == WORKGROUP_HANDLE,
        _ => false,
    }
}

/// An access that lies outside its buffer, at least in part.
#[derive(Clone, Copy, Debug)]
pub struct OutOfBoundsAccess<'a> {
    buffer: &'a Buffer,
    start: u64,
    size: u64,
    /// `u64::MAX` where an index was outside its array: then no scalar lies inside.
    offset: u64,
    /// The seed of what is read outside, where that is drawn.
    drawn: Option<u64>,
}

impl OutOfBoundsAccess<'_> {
    /// The buffer and the offset there of a scalar that lies inside, `at` bytes into the access.
    fn inside(&self, at: u64, width: u32) -> Option<(&Buffer, u64)> {
        let offset = self.offset.checked_add(at)?;
        let end = offset.checked_add(u64::from(width / 8))?;
        (end <= self.size).then_some((self.buffer, self.start + offset))
    }

    /// Loads the scalars: each that lies outside is 0, or drawn.
    fn load<const W: usize>(self, registers: &mut Registers<W>, lane: usize, to: Reg, chunk: &Chunk) {
        let mut load = self.loads(chunk.width);
        for scalar in 0..chunk.count {
            registers[to.plus(scalar)].0[lane] = load(u64::from(scalar * (chunk.width / 8)));
        }
    }

    /// Returns a function that loads the scalar at so many bytes into the access: one that lies
    /// outside is 0, or drawn.
    pub(super) fn loads(self, width: u32) -> impl FnMut(u64) -> u32 {
        let mut random = self.drawn.map(Random::new);
        move |at| {
            let inside = self.inside(at, width);
            let word = inside.and_then(|(buffer, offset)| buffer.load(offset, width));
            word.or_else(|| self.elsewhere(random.as_mut()?, width)).unwrap_or(0)
        }
    }

    /// A scalar from anywhere in the range that is bound, as `robustBufferAccess` allows it for a
    /// read outside of it.
    fn elsewhere(&self, random: &mut Random, width: u32) -> Option<u32> {
        let bytes = u64::from(width / 8);
        let count = self.size / bytes;
        (count > 0).then(|| self.buffer.load(self.start + random.below(count) * bytes, width))?
    }

    /// Stores the scalar at so many bytes into the access, unless it lies outside.
    pub(super) fn store_scalar(&self, at: u64, width: u32, word: u32) {
        if let Some((buffer, offset)) = self.inside(at, width) {
            buffer.store(offset, width, word);
        }
    }

    /// Stores the scalars, except those that lie outside.
    fn store<const W: usize>(self, registers: &Registers<W>, lane: usize, from: Reg, chunk: &Chunk) {
        for scalar in 0..chunk.count {
            let inside = self.inside(u64::from(scalar * (chunk.width / 8)), chunk.width);
            if let Some((buffer, offset)) = inside {
                buffer.store(offset, chunk.width, registers[from.plus(scalar)].0[lane]);
            }
        }
    }
}
