//! The product of a matrix in memory with a cooperative vector
//! (`OpCooperativeVectorMatrixMulNV`, `OpCooperativeVectorMatrixMulAddNV`), and how it runs.

use crate::machine::{Batch, Bindings, Buffer, Mask, Reg, Registers};
use crate::math::lane_ops::CpuTier;
use crate::ops::access::Access;
use crate::ops::cooperative::component::{MatrixComponent, convert, narrow, widen};
use crate::ops::cooperative::product::WideMatrix;
use crate::ops::memory::{Chunk, OutOfBoundsAccess, for_each_access};

/// Consecutive registers that hold components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComponentRegisters {
    /// The first register.
    pub first: Reg,
    /// The number of registers.
    pub count: u32,
    /// The type of the components.
    pub component: MatrixComponent,
}

/// The bytes between the beginnings of two rows or columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatrixStride {
    /// Known before running.
    Known(u32),
    /// In a register.
    Computed(Reg),
}

/// A matrix times a cooperative vector, plus a bias.
#[derive(Clone, Debug, PartialEq)]
pub struct VectorProduct {
    /// The first register of the result, which has a register for each row.
    pub to: Reg,
    /// The component type of the result.
    pub result: MatrixComponent,
    /// The rows of the matrix.
    pub rows: u32,
    /// The columns of the matrix.
    pub columns: u32,
    /// The vector, one component in each register.
    pub input: ComponentRegisters,
    /// Whether a register of the vector holds four components of its type.
    pub is_packed: bool,
    /// The type to which the vector is converted.
    pub interpretation: MatrixComponent,
    /// The bytes of the matrix.
    pub matrix: Chunk,
    /// The component type of the matrix.
    pub matrix_component: MatrixComponent,
    /// Whether columns, not rows, lie together in memory.
    pub is_column_major: bool,
    /// The bytes between rows or columns.
    pub stride: MatrixStride,
    /// The bias.
    pub bias: Option<ComponentRegisters>,
}

/// Runs a function for the running lanes with each stride that they have.
pub(super) fn each_stride<const W: usize>(
    batch: &mut Batch<W>,
    stride: MatrixStride,
    run: &mut dyn FnMut(&mut Batch<W>, u32),
) {
    let register = match stride {
        MatrixStride::Known(stride) => return run(batch, stride),
        MatrixStride::Computed(register) => register,
    };
    let strides = batch.registers[register];
    let running = batch.mask;
    let (mut left, mut trapped) = (running, Mask::NONE);
    while let Some(lane) = left.lowest() {
        let same = left & Mask::equal(&strides, strides.0[lane]);
        left = left.without(same);
        batch.mask = same;
        run(batch, strides.0[lane]);
        trapped = trapped | same.without(batch.mask);
    }
    batch.mask = running.without(trapped);
}

/// Lanes that multiply the same matrix.
struct Group<const W: usize> {
    /// The memory and the offset of the matrix.
    place: (usize, u64),
    lanes: Mask<W>,
    matrix: WideMatrix,
}

impl VectorProduct {
    pub(super) fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        self.matrix.accesses(visit);
        if let MatrixStride::Computed(stride) = self.stride {
            visit(Access::Read(stride, 1));
        }
        visit(Access::Read(self.input.first, self.input.count));
        if let Some(bias) = self.bias {
            visit(Access::Read(bias.first, bias.count));
        }
        visit(Access::Write(self.to, self.rows));
    }

    /// The number of lines (rows or columns) in memory, and the components of a line.
    fn lines(&self) -> (u32, u32) {
        if self.is_column_major { (self.columns, self.rows) } else { (self.rows, self.columns) }
    }

    /// The bytes from the first component of the matrix to the end of the last.
    pub fn extent(&self, stride: u32) -> u64 {
        let (lines, length) = self.lines();
        let line = u64::from(length) * u64::from(self.matrix_component.width() / 8);
        u64::from(lines.saturating_sub(1)) * u64::from(stride) + line
    }

    /// The register of the stride, if it is not known before running.
    pub fn stride_register(&self) -> Option<Reg> {
        match self.stride {
            MatrixStride::Known(_) => None,
            MatrixStride::Computed(register) => Some(register),
        }
    }

    /// The byte offset in the matrix, and the bytes, of each row or column that a lane reads.
    pub fn lines_in_memory<const W: usize>(
        &self,
        registers: &Registers<W>,
        lane: usize,
    ) -> impl Iterator<Item = (u64, u32)> + use<W> {
        let stride = match self.stride {
            MatrixStride::Known(stride) => stride,
            MatrixStride::Computed(register) => registers[register].0[lane],
        };
        let (lines, length) = self.lines();
        let bytes = length * (self.matrix_component.width() / 8);
        (0..lines).map(move |line| (u64::from(line) * u64::from(stride), bytes))
    }

    pub(super) fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        each_stride(batch, self.stride, &mut |batch, stride| self.eval_with(batch, bindings, stride));
    }

    fn eval_with<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings, stride: u32) {
        let count = u32::try_from(self.extent(stride)).unwrap_or(u32::MAX);
        let chunk = Chunk { count, ..self.matrix };
        let mut group: Option<Group<W>> = None;
        let mut outside: Vec<(usize, WideMatrix)> = Vec::new();
        for_each_access(
            batch,
            bindings,
            &chunk,
            |registers, lane, buffer, offset| {
                let place = (std::ptr::from_ref(buffer).addr(), offset);
                match &mut group {
                    Some(group) if group.place == place => group.lanes = group.lanes | Mask::lane(lane),
                    _ => {
                        if let Some(group) = group.take() {
                            self.multiply(registers, group.lanes, &group.matrix);
                        }
                        let matrix = self.load_matrix(buffer, offset, stride);
                        group = Some(Group { place, lanes: Mask::lane(lane), matrix });
                    }
                }
                Some(())
            },
            |_, lane, access| outside.push((lane, self.load_outside(access, stride))),
        );
        if let Some(group) = group {
            self.multiply(&mut batch.registers, group.lanes, &group.matrix);
        }
        for (lane, matrix) in outside {
            self.multiply(&mut batch.registers, Mask::lane(lane), &matrix);
        }
    }

    /// Reads a matrix that lies inside a buffer.
    fn load_matrix(&self, buffer: &Buffer, offset: u64, stride: u32) -> WideMatrix {
        let width = self.matrix_component.width();
        self.read_lines(&mut |line, words| {
            load_line(buffer, offset + u64::from(line) * u64::from(stride), width, words);
        })
    }

    /// Reads a matrix of which a part lies outside its buffer.
    fn load_outside(&self, access: OutOfBoundsAccess<'_>, stride: u32) -> WideMatrix {
        let width = self.matrix_component.width();
        let mut load = access.loads(width);
        self.read_lines(&mut |line, words| {
            for (at, word) in (0u64..).zip(words) {
                *word = load(u64::from(line) * u64::from(stride) + at * u64::from(width / 8));
            }
        })
    }

    fn read_lines(&self, read: &mut dyn FnMut(u32, &mut [u32])) -> WideMatrix {
        let (lines, length) = self.lines();
        let mut matrix = WideMatrix::zeros(self.rows as usize, self.columns as usize);
        let (cpu_tier, mut words) = (CpuTier::new(), vec![0; length as usize]);
        for line in 0..lines {
            read(line, &mut words);
            widen(cpu_tier, &mut words, self.matrix_component);
            matrix.set_line(line as usize, &words, self.is_column_major);
        }
        matrix
    }

    /// Multiplies the vectors of lanes by one matrix.
    fn multiply<const W: usize>(&self, registers: &mut Registers<W>, lanes: Mask<W>, matrix: &WideMatrix) {
        // A batch costs as much as a few of its lanes.
        const FEW_LANES: u32 = 8;
        match lanes.count() < FEW_LANES || !W.is_multiple_of(16) {
            true => lanes.lanes().for_each(|lane| self.multiply_lane(registers, lane, matrix)),
            false => self.multiply_batch(registers, lanes, matrix),
        }
    }

    fn multiply_lane<const W: usize>(&self, registers: &mut Registers<W>, lane: usize, matrix: &WideMatrix) {
        let cpu_tier = registers.cpu_tier();
        let mut input: Vec<u32> = registers.lane_words(self.input.first, self.input.count, lane).collect();
        if self.is_packed {
            input = input.iter().flat_map(|word| word.to_le_bytes().map(u32::from)).collect();
        }
        convert(cpu_tier, &mut input, self.input.component, self.interpretation);
        let mut sums = vec![0; matrix.sum_rows()];
        matrix.times_one(cpu_tier, self.result.is_float(), &input, &mut sums);
        if let Some(bias) = self.bias {
            let addends = registers.lane_words(bias.first, bias.count, lane).collect();
            self.add_bias(cpu_tier, bias.component, &mut sums, addends);
        }
        narrow(cpu_tier, &mut sums, self.result);
        sums.truncate(self.rows as usize);
        registers.set_lane_words(self.to, lane, sums);
    }

    #[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
    fn multiply_batch<const W: usize>(
        &self,
        registers: &mut Registers<W>,
        lanes: Mask<W>,
        matrix: &WideMatrix,
    ) {
        let cpu_tier = registers.cpu_tier();
        let words = |registers: &mut Registers<W>, first, count| -> Vec<u32> {
            let mut words = Vec::with_capacity(count as usize * W);
            registers.span_mut(first, count).iter().for_each(|lanes| words.extend_from_slice(&lanes.0));
            words
        };
        let mut inputs = words(registers, self.input.first, self.input.count);
        if self.is_packed {
            let byte =
                |at: usize| inputs[at / 4 * W..][..W].iter().map(move |word| word >> (at % 4 * 8) & 0xFF);
            inputs = (0..self.columns as usize).flat_map(byte).collect();
        }
        convert(cpu_tier, &mut inputs, self.input.component, self.interpretation);
        let mut sums = vec![0; matrix.sum_rows() * W];
        matrix.times_lanes(cpu_tier, self.result.is_float(), W, &inputs, &mut sums);
        if let Some(bias) = self.bias {
            let addends = words(registers, bias.first, bias.count);
            self.add_bias(cpu_tier, bias.component, &mut sums, addends);
        }
        narrow(cpu_tier, &mut sums, self.result);
        let chosen = lanes.words();
        for (to, sum) in registers.span_mut(self.to, self.rows).iter_mut().zip(sums.chunks_exact(W)) {
            for lane in 0..W {
                to.0[lane] = sum[lane] & chosen.0[lane] | to.0[lane] & !chosen.0[lane];
            }
        }
    }

    /// Adds components, zero-extended to words, to wide words.
    fn add_bias(
        &self,
        cpu_tier: CpuTier,
        component: MatrixComponent,
        sums: &mut [u32],
        mut addends: Vec<u32>,
    ) {
        widen(cpu_tier, &mut addends, component);
        let is_float = self.result.is_float();
        cpu_tier.run_loop(
            #[inline(always)]
            || {
                for (sum, &addend) in sums.iter_mut().zip(&addends) {
                    *sum = match is_float {
                        true => (f32::from_bits(*sum) + f32::from_bits(addend)).to_bits(),
                        false => sum.wrapping_add(addend),
                    };
                }
            },
        );
    }
}

/// Reads consecutive components inside a buffer.
fn load_line(buffer: &Buffer, offset: u64, width: u32, to: &mut [u32]) {
    let bytes = u64::from(width / 8);
    if !offset.is_multiple_of(4) {
        for (at, word) in (0u64..).zip(to) {
            *word = buffer.load(offset + at * bytes, width).unwrap_or(0);
        }
        return;
    }
    let each = (32 / width) as usize;
    let words = &buffer.words()[(offset / 4) as usize..];
    for (parts, word) in to.chunks_mut(each).zip(words) {
        let mut word = word.load(std::sync::atomic::Ordering::Relaxed);
        for part in parts {
            *part = word & (u32::MAX >> (32 - width));
            word = word.checked_shr(width).unwrap_or(0);
        }
    }
}
