//! Cooperative matrices in the registers of a subgroup, and how their operations run.
//!
//! Component (row, column) has the number e = row * columns + column. In a subgroup of S
//! invocations it is component e / S of invocation e % S.

use smallvec::SmallVec;

use crate::machine::{Batch, Bindings, Mask, Reg, Registers};
use crate::module::ty::CooperativeMatrix;
use crate::ops::access::Access;
use crate::ops::cooperative::component::{MatrixComponent, narrow, widen};
use crate::ops::cooperative::product::{BATCH_LANES, WideMatrix};
use crate::ops::cooperative::vector::{MatrixStride, each_stride};
use crate::ops::memory::{Chunk, OutOfBoundsAccess, for_each_access};
use crate::ops::subgroup::{Members, subgroups};

/// The registers of a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MatrixRegisters {
    /// The first of the registers, which hold one component each.
    pub first: Reg,
    /// The number of rows.
    pub rows: u32,
    /// The number of columns.
    pub columns: u32,
    /// The type of the components.
    pub component: MatrixComponent,
}

impl MatrixRegisters {
    /// The number of registers.
    pub fn count(&self) -> u32 {
        register_count(self.rows, self.columns)
    }

    /// The number of components.
    fn components(&self) -> u32 {
        self.rows * self.columns
    }

    /// The words of all components, row by row. Those of invocations that do not run are 0.
    fn collect<const W: usize>(&self, registers: &Registers<W>, members: &Members, size: u32) -> Vec<u32> {
        let mut words = vec![0; self.components() as usize];
        for &(lane, id) in members {
            let own = registers.lane_words(self.first, self.count(), lane);
            for (word, at) in own.zip((id as usize..words.len()).step_by(size as usize)) {
                words[at] = word;
            }
        }
        words
    }

    /// Writes the words of all components, row by row; registers beyond them become 0.
    fn distribute<const W: usize>(
        &self,
        registers: &mut Registers<W>,
        members: &Members,
        size: u32,
        words: &[u32],
    ) {
        for &(lane, id) in members {
            let word = |at: u32| words.get((id + at * size) as usize).copied().unwrap_or(0);
            registers.set_lane_words(self.first, lane, (0..self.count()).map(word));
        }
    }
}

/// The number of registers of a matrix in each invocation.
pub fn register_count(rows: u32, columns: u32) -> u32 {
    CooperativeMatrix::components_of_invocation(rows.into(), columns.into())
}

/// A load or store of a matrix: each invocation accesses its own components.
#[derive(Clone, Debug, PartialEq)]
pub struct MatrixAccess {
    /// The registers.
    pub matrix: MatrixRegisters,
    /// Whether it is a store.
    pub stores: bool,
    /// The bytes of the whole matrix.
    pub memory: Chunk,
    /// The bytes from a component to the next in a row or column.
    pub pitch: u32,
    /// Whether columns, not rows, lie together in memory.
    pub is_column_major: bool,
    /// The bytes between rows or columns.
    pub stride: MatrixStride,
}

impl MatrixAccess {
    /// The bytes from the first component to the end of the last.
    pub fn extent(&self, stride: u32) -> u64 {
        let MatrixRegisters { rows, columns, component, .. } = self.matrix;
        let (lines, length) = if self.is_column_major { (columns, rows) } else { (rows, columns) };
        u64::from(lines.saturating_sub(1)) * u64::from(stride)
            + u64::from(length.saturating_sub(1)) * u64::from(self.pitch)
            + u64::from(component.width() / 8)
    }

    /// The byte offset of a component in the matrix.
    fn offset(&self, at: u32, stride: u32) -> u64 {
        let (row, column) = (at / self.matrix.columns, at % self.matrix.columns);
        let (line, part) = if self.is_column_major { (column, row) } else { (row, column) };
        u64::from(line) * u64::from(stride) + u64::from(part) * u64::from(self.pitch)
    }

    /// The byte offset in the matrix, and the bytes, of each component.
    pub fn components_in_memory<const W: usize>(
        &self,
        registers: &Registers<W>,
        lane: usize,
    ) -> impl Iterator<Item = (u64, u32)> {
        let stride = match self.stride {
            MatrixStride::Known(stride) => stride,
            MatrixStride::Computed(register) => registers[register].0[lane],
        };
        let bytes = self.matrix.component.width() / 8;
        (0..self.matrix.components()).map(move |at| (self.offset(at, stride), bytes))
    }

    fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        self.memory.accesses(visit);
        if let MatrixStride::Computed(stride) = self.stride {
            visit(Access::Read(stride, 1));
        }
        match self.stores {
            true => {
                visit(Access::Read(self.matrix.first, self.matrix.count()));
                visit(Access::Effect);
            }
            false => visit(Access::Write(self.matrix.first, self.matrix.count())),
        }
    }

    fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        each_stride(batch, self.stride, &mut |batch, stride| self.eval_with(batch, bindings, stride));
    }

    fn eval_with<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings, stride: u32) {
        let size = batch.invocations.subgroup_size();
        let id = |lane| batch.invocations.lane(lane).subgroup_local_invocation_id();
        let ids: SmallVec<[u32; 64]> =
            (0..W).map(|lane| if batch.mask.contains(lane) { id(lane) } else { 0 }).collect();
        let chunk = Chunk { count: u32::try_from(self.extent(stride)).unwrap_or(u32::MAX), ..self.memory };
        let width = self.matrix.component.width();
        let parts = |lane: usize| {
            let total = self.matrix.components();
            let numbers = (0..self.matrix.count()).map(move |at| (at, at * size));
            let first = ids[lane];
            numbers.map(move |(at, step)| (at, Some(first + step).filter(|&number| number < total)))
        };
        for_each_access(
            batch,
            bindings,
            &chunk,
            |registers, lane, buffer, offset| {
                for (at, number) in parts(lane) {
                    let word = &mut registers[self.matrix.first.plus(at)].0[lane];
                    let place = number.map(|number| offset + self.offset(number, stride));
                    match (place, self.stores) {
                        (Some(place), true) => buffer.store(place, width, *word)?,
                        (Some(place), false) => *word = buffer.load(place, width)?,
                        (None, true) => {}
                        (None, false) => *word = 0,
                    }
                }
                Some(())
            },
            |registers, lane, access: OutOfBoundsAccess<'_>| {
                let mut load = access.loads(width);
                for (at, number) in parts(lane) {
                    let word = &mut registers[self.matrix.first.plus(at)].0[lane];
                    match (number, self.stores) {
                        (Some(number), true) => {
                            access.store_scalar(self.offset(number, stride), width, *word)
                        }
                        (Some(number), false) => *word = load(self.offset(number, stride)),
                        (None, true) => {}
                        (None, false) => *word = 0,
                    }
                }
            },
        );
    }
}

/// `OpCooperativeMatrixMulAddKHR`
#[derive(Clone, Debug, PartialEq)]
pub struct MatrixProduct {
    /// The result.
    pub result: MatrixRegisters,
    /// The left factor.
    pub left: MatrixRegisters,
    /// The right factor.
    pub right: MatrixRegisters,
    /// What is added.
    pub addend: MatrixRegisters,
    /// Whether the addition of integers saturates.
    pub saturates: bool,
}

impl MatrixProduct {
    fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        for operand in self.operands() {
            visit(Access::Read(operand.first, operand.count()));
        }
        visit(Access::Write(self.result.first, self.result.count()));
    }

    /// The operands.
    pub fn operands(&self) -> [MatrixRegisters; 3] {
        [self.left, self.right, self.addend]
    }

    fn eval<const W: usize>(&self, batch: &mut Batch<W>) {
        let size = batch.invocations.subgroup_size();
        for members in subgroups(batch) {
            let [left, right, addend] = self.operands().map(|operand| {
                let mut words = operand.collect(&batch.registers, &members, size);
                widen(batch.registers.cpu_tier(), &mut words, operand.component);
                words
            });
            let words = self.multiply(&batch.registers, &left, &right, &addend);
            self.result.distribute(&mut batch.registers, &members, size, &words);
        }
    }

    /// The components of the result, row by row, from wide words.
    fn multiply<const W: usize>(
        &self,
        registers: &Registers<W>,
        left: &[u32],
        right: &[u32],
        addend: &[u32],
    ) -> Vec<u32> {
        let cpu_tier = registers.cpu_tier();
        let [rows, shared] = [self.left.rows, self.left.columns].map(|count| count as usize);
        let columns = self.right.columns as usize;
        let is_float = self.result.component.is_float();
        let mut matrix = WideMatrix::zeros(rows, shared);
        for (at, row) in left.chunks_exact(shared).enumerate() {
            matrix.set_line(at, row, false);
        }
        // Each column of the right factor is a lane.
        let lanes = columns.next_multiple_of(BATCH_LANES);
        let mut inputs = Vec::with_capacity(shared * lanes);
        for row in right.chunks_exact(columns) {
            inputs.extend_from_slice(row);
            inputs.resize(inputs.len() + lanes - columns, 0);
        }
        let mut sums = vec![0; matrix.sum_rows() * lanes];
        matrix.times_lanes(cpu_tier, is_float, lanes, &inputs, &mut sums);
        let mut words: Vec<u32> =
            sums.chunks_exact(lanes).take(rows).flat_map(|row| &row[..columns]).copied().collect();
        for (word, &addend) in words.iter_mut().zip(addend) {
            *word = self.add(*word, addend);
        }
        narrow(cpu_tier, &mut words, self.result.component);
        words
    }

    /// The sum of wide words.
    fn add(&self, sum: u32, addend: u32) -> u32 {
        let (width, signed) = match self.result.component {
            MatrixComponent::Float(_) => return (f32::from_bits(sum) + f32::from_bits(addend)).to_bits(),
            MatrixComponent::Int { width, signed } => (width, signed),
        };
        if !self.saturates {
            return sum.wrapping_add(addend);
        }
        let by = 32 - width;
        match signed {
            true => {
                let [sum, addend] = [sum, addend].map(|word| i64::from((word << by) as i32 >> by));
                (sum + addend).clamp(-1 << (width - 1), (1 << (width - 1)) - 1) as u32
            }
            false => {
                let [sum, addend] = [sum, addend].map(|word| u64::from(word << by >> by));
                (sum + addend).min(u64::from(u32::MAX >> by)) as u32
            }
        }
    }
}

/// `OpCooperativeMatrixTransposeNV`
#[derive(Clone, Debug, PartialEq)]
pub struct MatrixTranspose {
    /// The result.
    pub result: MatrixRegisters,
    /// The operand.
    pub operand: MatrixRegisters,
}

impl MatrixTranspose {
    fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        visit(Access::Read(self.operand.first, self.operand.count()));
        visit(Access::Write(self.result.first, self.result.count()));
    }

    fn eval<const W: usize>(&self, batch: &mut Batch<W>) {
        let size = batch.invocations.subgroup_size();
        let [rows, columns] = [self.operand.rows, self.operand.columns].map(|count| count as usize);
        for members in subgroups(batch) {
            let words = self.operand.collect(&batch.registers, &members, size);
            let transposed: Vec<u32> = (0..columns)
                .flat_map(|column| (0..rows).map(move |row| row * columns + column))
                .map(|at| words[at])
                .collect();
            self.result.distribute(&mut batch.registers, &members, size, &transposed);
        }
    }
}

/// An operation on matrices.
#[derive(Clone, Debug, PartialEq)]
pub enum MatrixOp {
    /// A load or store.
    Access(MatrixAccess),
    /// A product.
    Product(MatrixProduct),
    /// A transposition.
    Transpose(MatrixTranspose),
}

impl MatrixOp {
    pub(super) fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        match self {
            Self::Access(access) => access.accesses(visit),
            Self::Product(product) => product.accesses(visit),
            Self::Transpose(transpose) => transpose.accesses(visit),
        }
    }

    pub(super) fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        match self {
            Self::Access(access) => access.eval(batch, bindings),
            Self::Product(product) => product.eval(batch),
            Self::Transpose(transpose) => transpose.eval(batch),
        }
    }
}

/// The lanes that hold a component in the register of a matrix at a position.
pub fn owners<const W: usize>(batch: &Batch<W>, matrix: &MatrixRegisters, at: u32) -> Mask<W> {
    let size = batch.invocations.subgroup_size();
    let id = |lane| batch.invocations.lane(lane).subgroup_local_invocation_id();
    batch.mask & Mask::from_fn(|lane| batch.mask.contains(lane) && id(lane) + at * size < matrix.components())
}
