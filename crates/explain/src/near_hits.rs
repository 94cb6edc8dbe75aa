//! Hits near a point, found without comparing the point with all hits.

use std::collections::BTreeSet;

use rustc_hash::FxHashMap;

/// Points, each with a radius, in grids of cells that are at least twice as wide as the radius: one
/// grid for each power of two. Keys separate points that are never found together.
#[derive(Clone, Debug, Default)]
pub(super) struct NearHits {
    /// Numbers of points by grid, key and cell, ascending.
    cells: FxHashMap<(u64, [u32; 3], [i64; 3]), Vec<usize>>,
    /// Grids that have points.
    grids: BTreeSet<u64>,
}

impl NearHits {
    /// Adds a point; numbers ascend. A radius that is negative or NaN contains nothing.
    pub(super) fn add(&mut self, number: usize, key: [u32; 3], point: [f64; 3], radius: f64) {
        if radius >= 0.0 {
            let grid = grid_of(radius);
            self.grids.insert(grid);
            self.cells.entry((grid, key, cell(grid, point))).or_default().push(number);
        }
    }

    /// Returns the lowest number that is accepted, of those whose points are at most their radius
    /// away and whose radius is at least `least`. `accepts` may also see others of the key.
    pub(super) fn first(
        &self,
        key: [u32; 3],
        point: [f64; 3],
        least: f64,
        accepts: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let mut first = None;
        for &grid in self.grids.range(grid_of(least)..) {
            let [x, y, z] = cell(grid, point);
            for at in 0..27 {
                let near = |middle: i64, step: i64| middle.saturating_add(step % 3 - 1);
                let cell = [near(x, at), near(y, at / 3), near(z, at / 9)];
                let numbers = self.cells.get(&(grid, key, cell)).into_iter().flatten().copied();
                let mut before = numbers.take_while(|number| first.is_none_or(|first| *number < first));
                first = before.find(|number| accepts(*number)).or(first);
            }
        }
        first
    }
}

/// Number of the grid of a radius: the biased exponent of the width of its cells, a power of two
/// that is more than twice the radius. Radii that are larger belong to the same or later grids.
fn grid_of(radius: f64) -> u64 {
    let exponent = radius.max(0.0).to_bits() >> 52;
    (exponent + 2).min(0x7FF)
}

/// Cell of a point. The division by a power of two is exact, and numbers that are too large for a
/// cell's are limited: points that are near to each other are never further than one cell apart.
fn cell(grid: u64, point: [f64; 3]) -> [i64; 3] {
    let width = f64::from_bits(grid << 52);
    point.map(|coordinate| (coordinate / width).floor() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points around cells' borders and at far and infinite places, with radii of many magnitudes:
    /// the same is found as by comparing with all.
    #[test]
    fn the_first_of_all_near_points_is_found() {
        let places = [-0.0, 0.0, 1.0, -1.0, 0.999, 1.001, 3.0e-39, 1e-3, 7.5, 1e30, -1e30, f64::INFINITY];
        let radii = [0.0, 1e-45, 1e-3, 0.5, 2.0, 3.0, 1e29, 1e30, f64::INFINITY, f64::NAN, -1.0];
        let mut points = Vec::new();
        for x in places {
            for y in [0.0, 0.5, x] {
                points.extend(radii.map(|radius| ([x, y, -x], radius)));
            }
        }
        let far = |a: [f64; 3], b: [f64; 3]| (0..3).map(|at| (a[at] - b[at]).powi(2)).sum::<f64>().sqrt();
        let mut index = NearHits::default();
        for (number, &(point, radius)) in points.iter().enumerate() {
            index.add(number, [number as u32 % 2, 0, 0], point, radius);
        }
        for &(from, _) in &points {
            for (key, least) in [(0, 0.0), (1, 0.0), (0, 0.75), (1, 5.0)] {
                let is_near = |number: usize| {
                    let (point, radius) = points[number];
                    number % 2 == key && least <= radius && far(from, point) <= radius
                };
                let wanted = (0..points.len()).find(|number| is_near(*number));
                assert_eq!(index.first([key as u32, 0, 0], from, least, is_near), wanted, "{from:?}");
            }
        }
    }

    /// Of many hits, those that are far away, or of which the radius is too small, are not looked
    /// at.
    #[test]
    fn far_points_are_not_compared() {
        let mut index = NearHits::default();
        (0..1000).for_each(|number| index.add(number, [0; 3], [number as f64, 0.0, 0.0], 1e-3));
        let looked = std::cell::Cell::new(0);
        let count = |_| {
            looked.set(looked.get() + 1);
            false
        };
        assert_eq!(index.first([0; 3], [500.0, 0.0, 0.0], 0.0, count), None);
        assert_eq!(looked.replace(0), 1);
        assert_eq!(index.first([0; 3], [500.0, 0.0, 0.0], 1.0, count), None);
        assert_eq!(looked.get(), 0);
    }
}
