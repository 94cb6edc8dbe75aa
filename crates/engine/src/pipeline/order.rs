//! The order in which the invocations of a launch run: by launch index, or by tiles.

use std::ops::Range;

use crate::machine::{ChoiceKind, OpenChoices, OrderPart};
use crate::math::array;
use crate::math::permutation::Permutation;
use crate::pipeline::run_options::BatchWidth;

/// The width and height of a tile.
pub(super) const TILE_SIDE: u64 = 8;

/// An order of the launch indices of a grid: each has a position.
#[derive(Clone, Debug)]
pub(super) struct InvocationOrder {
    size: [u64; 3],
    tiled: bool,
    /// The positions of invocations, if they are drawn.
    drawn: Option<Permutation>,
}

/// What of the order in which the invocations of a launch run may make a difference to its results.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrderMatters {
    /// The size of subgroups, where shaders use them.
    pub subgroup_size: Option<u32>,
    /// Whether invocations see what others leave in memory.
    pub is_shared: bool,
}

impl OrderMatters {
    /// How many invocations run together, so that results do not depend on the number asked for: a
    /// batch holds whole subgroups, whose size divides its width, and invocations that depend on
    /// each other run one after the other or 64 at a time.
    pub(super) fn width(self, one_by_one: bool, asked: BatchWidth) -> BatchWidth {
        match self.subgroup_size {
            Some(..=64) => BatchWidth::Of64,
            Some(_) => BatchWidth::Of128,
            None if one_by_one => BatchWidth::One,
            None if self.is_shared => BatchWidth::Of64,
            None => asked,
        }
    }

    /// Draws the positions of so many invocations, as far as it may make a difference: within
    /// subgroups, or only those of whole subgroups.
    pub(super) fn draw(self, choices: &OpenChoices, count: u64) -> Option<Permutation> {
        let drawn = |kind, unit| choices.draw_order(kind, OrderPart::Grid, count, unit);
        let unit = self.subgroup_size.map_or(1, u64::from);
        let of_units =
            (self.is_shared && count > unit).then(|| drawn(ChoiceKind::InvocationOrder, unit)).flatten();
        let of_lanes = self.subgroup_size.and_then(|_| drawn(ChoiceKind::SubgroupComposition, 1));
        of_lanes.or(of_units)
    }
}

impl InvocationOrder {
    /// Launch indices in row-major order, x fastest: for shaders whose results depend on the order.
    pub(super) fn by_index(size: [u32; 3]) -> Self {
        Self { size: array::map(size, u64::from), tiled: false, drawn: None }
    }

    /// Launch indices by tiles of 8 x 8 invocations, row after row of tiles, so that a batch of 64
    /// is a tile: its rays are more coherent than those of 64 invocations in a row.
    pub(super) fn by_tiles(size: [u32; 3]) -> Self {
        Self { tiled: true, ..Self::by_index(size) }
    }

    /// The launch indices in row-major order, each moved to a position that is drawn, if it is.
    pub(super) fn drawn(size: [u32; 3], drawn: Option<Permutation>) -> Self {
        Self { drawn, ..Self::by_index(size) }
    }

    /// The launch index at a position.
    pub(super) fn launch_id(&self, position: u64) -> [u32; 3] {
        let position = self.drawn.as_ref().map_or(position, |drawn| drawn.at(position));
        let [width, height, _] = self.size;
        let (z, within) = (position / (width * height), position % (width * height));
        let (x, y) = match self.tiled {
            false => (within % width, within / width),
            true => {
                let band = within / (width * TILE_SIDE);
                let rows = TILE_SIDE.min(height - band * TILE_SIDE);
                let within = within - band * width * TILE_SIDE;
                let tile = within / (TILE_SIDE * rows);
                let columns = TILE_SIDE.min(width - tile * TILE_SIDE);
                let within = within - tile * TILE_SIDE * rows;
                (tile * TILE_SIDE + within % columns, band * TILE_SIDE + within / columns)
            }
        };
        [x as u32, y as u32, z as u32]
    }

    /// The size of the grid.
    pub(super) fn size(&self) -> [u32; 3] {
        array::map(self.size, |side| side as u32)
    }

    /// The launch indices at a range of positions, as runs along a scanline in which x increases by
    /// 1: the first index and the length of each run.
    pub(super) fn scanline_runs(&self, positions: Range<u64>) -> impl Iterator<Item = ([u32; 3], usize)> {
        let (order, Range { mut start, end }) = (self.clone(), positions);
        std::iter::from_fn(move || {
            let first = order.launch_id(start);
            let x = u64::from(first[0]);
            let stop = if order.tiled { (x / TILE_SIDE + 1) * TILE_SIDE } else { u64::MAX };
            let longest = if order.drawn.is_some() { 1 } else { u64::MAX };
            let run = (stop.min(order.size[0]) - x).min(longest).min(end - start);
            start += run;
            (run > 0).then_some((first, run as usize))
        })
    }

    /// The row-major linear index of a launch index, x fastest.
    pub(super) fn linear_index(&self, id: [u32; 3]) -> u64 {
        let [x, y, z] = array::map(id, u64::from);
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// A lower bound of the linear indices of all invocations at these positions or later ones.
    pub(super) fn min_linear_index(&self, positions: &Range<u64>) -> u64 {
        if self.drawn.is_some() {
            return 0;
        }
        if !self.tiled {
            return positions.start;
        }
        let [width, height, _] = self.size;
        let slice = positions.start / (width * height) * (width * height);
        slice + (positions.start - slice) / (width * TILE_SIDE) * (width * TILE_SIDE)
    }
}

/// An order of the workgroups of a dispatch: each has a position.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroupOrder {
    /// `NumWorkgroups`
    count: [u64; 3],
    /// How many rows of workgroups go together, column after column.
    band: u64,
}

impl GroupOrder {
    /// Workgroups in row-major order.
    pub(super) fn by_index(count: [u32; 3]) -> Self {
        Self { count: array::map(count, u64::from), band: 1 }
    }

    /// Workgroups of so many invocations along each axis by tiles of them, so that the workgroups
    /// which share a batch of 64 cover about as many rows as columns: their rays are more coherent
    /// than those of workgroups in a row.
    pub(super) fn by_tiles(count: [u32; 3], size: [u32; 3]) -> Self {
        let [width, height, depth] = array::map(size, u64::from);
        let together = TILE_SIDE * TILE_SIDE / (width * height * depth).max(1);
        let mut band = 1;
        while band * 2 <= together && height * band * 2 <= width * (together / (band * 2)) {
            band *= 2;
        }
        Self { band, ..Self::by_index(count) }
    }

    /// The row of workgroups with which the band of a position begins, counted through all slices;
    /// how many rows the band has, and the position in it.
    fn band_at(&self, position: u64) -> (u64, u64, u64) {
        let [width, height, _] = self.count;
        let (slice, within) = (position / (width * height), position % (width * height));
        let first = within / (width * self.band) * self.band;
        (slice * height + first, self.band.min(height - first), within - first * width)
    }

    /// The index of the workgroup at a position, x fastest.
    pub(super) fn index(&self, position: u64) -> u64 {
        if self.band == 1 {
            return position;
        }
        let (first, rows, within) = self.band_at(position);
        (first + within % rows) * self.count[0] + within / rows
    }

    /// A lower bound of the indices of all workgroups at this position or later ones.
    pub(super) fn min_index(&self, position: u64) -> u64 {
        if self.band == 1 {
            return position;
        }
        let (first, rows, within) = self.band_at(position);
        first * self.count[0] + within / rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn every_index_has_one_position() {
        for size in [[1, 1, 1], [8, 8, 1], [64, 1, 1], [1, 64, 1], [13, 21, 1], [16, 9, 3], [7, 17, 2]] {
            let count = size.iter().map(|&side| u64::from(side)).product::<u64>();
            let drawn = Some(Permutation::draw(count, 1, &mut Random::new(1)));
            for order in [
                InvocationOrder::by_index(size),
                InvocationOrder::by_tiles(size),
                InvocationOrder::drawn(size, drawn.clone()),
            ] {
                let mut numbers: Vec<u64> =
                    (0..count).map(|at| order.linear_index(order.launch_id(at))).collect();
                for start in 0..count {
                    let least = numbers[start as usize..].iter().min().copied();
                    assert!(least >= Some(order.min_linear_index(&(start..count))), "{size:?} {start}");
                }
                numbers.sort_unstable();
                assert!(numbers.into_iter().eq(0..count), "{size:?}");
            }
        }
    }

    #[test]
    fn scanline_runs_are_launch_indices() {
        for size in [[13, 21, 1], [16, 9, 3], [64, 2, 1], [3, 3, 3]] {
            let count = size.iter().map(|&side| u64::from(side)).product::<u64>();
            let drawn = Some(Permutation::draw(count, 4, &mut Random::new(2)));
            for order in [
                InvocationOrder::by_index(size),
                InvocationOrder::by_tiles(size),
                InvocationOrder::drawn(size, drawn.clone()),
            ] {
                for positions in [0..count, 1..count - 1, 5..7, 4..4] {
                    let ids = positions.clone().map(|at| order.launch_id(at));
                    let indices = order
                        .scanline_runs(positions)
                        .flat_map(|([x, y, z], run)| (x..x + run as u32).map(move |x| [x, y, z]));
                    assert!(indices.eq(ids), "{size:?}");
                }
            }
        }
    }

    #[test]
    fn a_batch_is_a_tile() {
        let order = InvocationOrder::by_tiles([20, 16, 1]);
        let tile = |first: u64| (first..first + 64).map(|at| order.launch_id(at)).collect::<Vec<_>>();
        let wanted = |x: u32, y: u32| (0..64).map(|at| [x + at % 8, y + at / 8, 0]).collect::<Vec<_>>();
        assert_eq!(tile(0), wanted(0, 0));
        assert_eq!(tile(64), wanted(8, 0));
        // The third tile of each row is 4 wide.
        assert_eq!(order.launch_id(128), [16, 0, 0]);
        assert_eq!(order.launch_id(132), [16, 1, 0]);
        assert_eq!(tile(160), wanted(0, 8));
    }

    #[test]
    fn every_workgroup_has_one_position() {
        let counts = [[1, 1, 1], [16, 12, 1], [5, 7, 3], [1, 9, 2], [33, 1, 1]];
        for (count, size) in counts.into_iter().flat_map(|count| {
            [[32, 1, 1], [8, 4, 1], [4, 4, 1], [1, 1, 1], [64, 1, 1], [1, 32, 1], [16, 16, 4]]
                .map(|size| (count, size))
        }) {
            let order = GroupOrder::by_tiles(count, size);
            let all = count.map(u64::from).iter().product::<u64>();
            let mut indices: Vec<_> = (0..all).map(|at| order.index(at)).collect();
            for start in 0..all {
                let least = indices[start as usize..].iter().min().copied();
                assert!(least >= Some(order.min_index(start)), "{count:?} {size:?} {start}");
            }
            indices.sort_unstable();
            assert!(indices.into_iter().eq(0..all), "{count:?} {size:?}");
        }
    }

    #[test]
    fn workgroups_that_share_a_batch_are_a_tile() {
        // By hand: 16 workgroups a row. Two of 32 x 1 are 32 x 2, two of 8 x 4 are 8 x 8, four of
        // 4 x 4 are 8 x 8; those of 64 x 1 and 1 x 32 follow each other.
        for (size, wanted) in [
            ([32, 1, 1], [0, 16, 1, 17]),
            ([8, 4, 1], [0, 16, 1, 17]),
            ([4, 4, 1], [0, 16, 1, 17]),
            ([16, 1, 1], [0, 16, 32, 48]),
            ([64, 1, 1], [0, 1, 2, 3]),
            ([1, 32, 1], [0, 1, 2, 3]),
        ] {
            let order = GroupOrder::by_tiles([16, 12, 1], size);
            assert_eq!([0, 1, 2, 3].map(|at| order.index(at)), wanted, "{size:?}");
        }
    }
}
