//! Products of a matrix with many vectors, or with one.
//!
//! Each component of a result is `((0 + a0 x0) + a1 x1) + ...`, each product and each sum rounded
//! to f32, or modulo 2^32: lanes are computed side by side, so that neither their number nor the
//! processor changes a bit.

use crate::math::lane_ops::CpuTier;

/// A matrix of wide words (see [`component`](super::component)), column by column; each column is
/// padded with zeros.
#[derive(Clone, Debug, Default)]
pub struct WideMatrix {
    words: Vec<u32>,
    rows: usize,
    columns: usize,
}

/// Rows that one lane computes side by side.
const LANE_ROWS: usize = 16;
/// Rows that a batch computes side by side.
const BATCH_ROWS: usize = 4;
/// Lanes that a batch computes side by side.
pub const BATCH_LANES: usize = 16;

/// A number that products are made of.
trait Number: Copy {
    const ZERO: Self;
    fn from_word(word: u32) -> Self;
    fn to_word(self) -> u32;
    /// The sum with a product.
    fn plus_product(self, a: Self, x: Self) -> Self;
}

impl Number for f32 {
    const ZERO: Self = 0.0;
    #[inline(always)]
    fn from_word(word: u32) -> Self {
        Self::from_bits(word)
    }
    #[inline(always)]
    fn to_word(self) -> u32 {
        self.to_bits()
    }
    #[inline(always)]
    fn plus_product(self, a: Self, x: Self) -> Self {
        self + a * x
    }
}

impl Number for i32 {
    const ZERO: Self = 0;
    #[inline(always)]
    fn from_word(word: u32) -> Self {
        word as i32
    }
    #[inline(always)]
    fn to_word(self) -> u32 {
        self as u32
    }
    #[inline(always)]
    fn plus_product(self, a: Self, x: Self) -> Self {
        self.wrapping_add(a.wrapping_mul(x))
    }
}

impl WideMatrix {
    /// A matrix of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self { words: vec![0; rows.next_multiple_of(LANE_ROWS) * columns], rows, columns }
    }

    /// Sets a row, or a column if `is_column`.
    pub fn set_line(&mut self, at: usize, words: &[u32], is_column: bool) {
        let stride = self.stride();
        if is_column {
            self.words[at * stride..at * stride + words.len()].copy_from_slice(words);
            return;
        }
        for (column, &word) in words.iter().enumerate() {
            self.words[column * stride + at] = word;
        }
    }

    fn stride(&self) -> usize {
        self.rows.next_multiple_of(LANE_ROWS)
    }

    /// The products with the vectors of so many lanes, a multiple of 16. `inputs` holds the words
    /// of all lanes for each column of the matrix, `sums` those for each of
    /// [`WideMatrix::sum_rows`].
    pub fn times_lanes(
        &self,
        cpu_tier: CpuTier,
        is_float: bool,
        lanes: usize,
        inputs: &[u32],
        sums: &mut [u32],
    ) {
        cpu_tier.run_loop(
            #[inline(always)]
            || match is_float {
                true => self.sum_lanes::<f32>(lanes, inputs, sums),
                false => self.sum_lanes::<i32>(lanes, inputs, sums),
            },
        );
    }

    /// The product with one vector; `sums` has [`WideMatrix::sum_rows`] words.
    pub fn times_one(&self, cpu_tier: CpuTier, is_float: bool, input: &[u32], sums: &mut [u32]) {
        cpu_tier.run_loop(
            #[inline(always)]
            || match is_float {
                true => self.sum_one::<f32>(input, sums),
                false => self.sum_one::<i32>(input, sums),
            },
        );
    }

    /// The number of rows with their padding.
    pub fn sum_rows(&self) -> usize {
        self.stride()
    }

    #[inline(always)]
    fn sum_lanes<N: Number>(&self, lanes: usize, inputs: &[u32], sums: &mut [u32]) {
        let stride = self.stride();
        for row in (0..self.rows).step_by(BATCH_ROWS) {
            for first in (0..lanes).step_by(BATCH_LANES) {
                let mut totals = [[N::ZERO; BATCH_LANES]; BATCH_ROWS];
                for column in 0..self.columns {
                    let input = &inputs[column * lanes + first..][..BATCH_LANES];
                    let factors = &self.words[column * stride + row..][..BATCH_ROWS];
                    for at in 0..BATCH_ROWS {
                        let factor = N::from_word(factors[at]);
                        for lane in 0..BATCH_LANES {
                            totals[at][lane] =
                                totals[at][lane].plus_product(factor, N::from_word(input[lane]));
                        }
                    }
                }
                for at in 0..BATCH_ROWS {
                    let sum = &mut sums[(row + at) * lanes + first..][..BATCH_LANES];
                    for lane in 0..BATCH_LANES {
                        sum[lane] = totals[at][lane].to_word();
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn sum_one<N: Number>(&self, input: &[u32], sums: &mut [u32]) {
        let stride = self.stride();
        for row in (0..stride).step_by(LANE_ROWS) {
            let mut totals = [N::ZERO; LANE_ROWS];
            for column in 0..self.columns {
                let factors = &self.words[column * stride + row..][..LANE_ROWS];
                let input = N::from_word(input[column]);
                for at in 0..LANE_ROWS {
                    totals[at] = totals[at].plus_product(N::from_word(factors[at]), input);
                }
            }
            for at in 0..LANE_ROWS {
                sums[row + at] = totals[at].to_word();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The products by the definition, one after the other.
    fn expected(matrix: &[Vec<f32>], vector: &[f32]) -> Vec<u32> {
        let row = |row: &Vec<f32>| row.iter().zip(vector).fold(0f32, |sum, (a, x)| sum + a * x).to_bits();
        matrix.iter().map(row).collect()
    }

    #[test]
    fn lanes_and_single_vectors_sum_in_the_same_order() {
        for (rows, columns) in [(1, 1), (3, 5), (4, 16), (17, 33), (64, 64)] {
            // Numbers of very different sizes, so that the order of a sum shows.
            let value =
                |at: usize| ((at * 2_654_435_761) % 1000) as f32 * 1.1f32.powi(at as i32 % 50) - 300.0;
            let matrix: Vec<Vec<f32>> = (0..rows)
                .map(|row| (0..columns).map(|column| value(row * columns + column)).collect())
                .collect();
            let mut wide = WideMatrix::zeros(rows, columns);
            for (at, row) in matrix.iter().enumerate() {
                wide.set_line(at, &row.iter().map(|value| value.to_bits()).collect::<Vec<_>>(), false);
            }
            let vector =
                |lane: usize| -> Vec<f32> { (0..columns).map(|at| value(at * 7 + lane * 13)).collect() };
            let inputs: Vec<u32> = (0..columns)
                .flat_map(|at| (0..64).map(move |lane| (at, lane)))
                .map(|(at, lane)| vector(lane)[at].to_bits())
                .collect();
            for (_, tier) in CpuTier::available() {
                let mut sums = vec![0; wide.sum_rows() * 64];
                wide.times_lanes(tier, true, 64, &inputs, &mut sums);
                for lane in 0..64 {
                    let expected = expected(&matrix, &vector(lane));
                    let found: Vec<u32> = (0..rows).map(|row| sums[row * 64 + lane]).collect();
                    assert_eq!(found, expected, "{rows} x {columns}, lane {lane}");
                    let input: Vec<u32> = vector(lane).iter().map(|value| value.to_bits()).collect();
                    let mut one = vec![0; wide.sum_rows()];
                    wide.times_one(tier, true, &input, &mut one);
                    assert_eq!(one[..rows], expected[..], "{rows} x {columns}, lane {lane} alone");
                }
            }
        }
    }

    #[test]
    fn integers_wrap() {
        let mut matrix = WideMatrix::zeros(1, 2);
        matrix.set_line(0, &[0x8000_0001], true);
        matrix.set_line(1, &[3], true);
        let mut sums = vec![0; matrix.sum_rows()];
        matrix.times_one(CpuTier::new(), false, &[2, u32::MAX], &mut sums);
        // 2 (2^31 + 1) - 3 = 2^32 - 1
        assert_eq!(sums[0], u32::MAX);
    }
}
