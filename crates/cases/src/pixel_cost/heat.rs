//! One number for each pixel of a launch, and where it is greatest.

use crate::pixel_cost::{InvocationPlane, LaunchCost, PixelCost, PlaneKind};
use anyhit_base::error::{Error, ErrorKind, Result};

/// What a heat map shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeatMeasure {
    /// [`PixelCost::instructions`]
    Instructions,
    /// [`PixelCost::nodes`]
    Nodes,
    /// [`PixelCost::primitives`]
    Primitives,
    /// [`PixelCost::any_hit`]
    AnyHit,
    /// [`PixelCost::divergent`] as a percentage of the instructions.
    Divergence,
    /// How far what the invocation writes to images is from f64 arithmetic: the greatest error of
    /// a float component, in units in the last place of an f32.
    Ulps,
}

impl HeatMeasure {
    /// All measures.
    pub const ALL: [Self; 6] =
        [Self::Instructions, Self::Nodes, Self::Primitives, Self::AnyHit, Self::Divergence, Self::Ulps];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Instructions => "instructions",
            Self::Nodes => "nodes",
            Self::Primitives => "primitives",
            Self::AnyHit => "any-hit",
            Self::Divergence => "divergence",
            Self::Ulps => "ulps",
        }
    }

    /// Title of the measure, at most a line.
    fn title(self, kind: PlaneKind) -> String {
        let word = kind.word();
        match self {
            Self::Instructions => format!("SPIR-V instructions per {word}"),
            Self::Nodes => format!("BVH nodes opened per {word}"),
            Self::Primitives => format!("primitives tested per {word}"),
            Self::AnyHit => format!("any-hit invocations per {word}"),
            Self::Divergence => "% of instructions executed by part of a subgroup".to_owned(),
            Self::Ulps => "error against f64, in ulps of f32".to_owned(),
        }
    }

    /// The measure of a cost; `None` for what is not among the counts of a launch.
    fn of(self, pixel: &PixelCost) -> Option<f64> {
        let count = match self {
            Self::Instructions => pixel.instructions,
            Self::Nodes => pixel.nodes,
            Self::Primitives => pixel.primitives,
            Self::AnyHit => pixel.any_hit,
            Self::Divergence => {
                return Some(100.0 * pixel.divergent as f64 / pixel.instructions.max(1) as f64);
            }
            Self::Ulps => return None,
        };
        Some(count as f64)
    }
}

/// One number for each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Heat {
    /// What the numbers are.
    pub measure: HeatMeasure,
    /// Kind of the invocations.
    pub kind: PlaneKind,
    /// Width and height.
    pub extent: [u32; 2],
    /// The numbers, rows from the top.
    pub values: Vec<f64>,
}

impl LaunchCost {
    /// The numbers of a measure that is among the counts, on a plane.
    ///
    /// # Errors
    /// `UnsupportedModule` of divergence where it cannot be seen.
    pub fn heat(&self, measure: HeatMeasure, plane: &InvocationPlane) -> Result<Heat> {
        if measure == HeatMeasure::Divergence && self.subgroup_size.is_none() {
            let message = "the divergence of this launch cannot be counted";
            return Err(Error::new(ErrorKind::UnsupportedModule, message).note(
                "either its results depend on the order of invocations, which then run one by one, \
                    or its subgroups have more than 64",
            ));
        }
        let values: Vec<f64> = self.pixels.iter().filter_map(|pixel| measure.of(pixel)).collect();
        Ok(Heat::new(measure, plane, &values))
    }
}

impl Heat {
    /// Numbers of all invocations in launch order, on a plane.
    pub fn new(measure: HeatMeasure, plane: &InvocationPlane, values: &[f64]) -> Self {
        Self { measure, kind: plane.kind, extent: plane.extent, values: plane.values(values) }
    }

    /// Title of the measure, at most a line.
    pub fn title(&self) -> String {
        self.measure.title(self.kind)
    }

    /// The sum.
    pub fn total(&self) -> f64 {
        self.values.iter().sum()
    }

    /// The mean; 0 of nothing.
    pub fn mean(&self) -> f64 {
        self.total() / self.values.len().max(1) as f64
    }

    /// The least numbers that as many percent of the pixels do not exceed (their nearest ranks):
    /// `[0, 100]` are the least and the greatest number.
    pub fn percentiles<const N: usize>(&self, percents: [u32; N]) -> [f64; N] {
        let mut sorted = self.values.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let count = sorted.len() as u64;
        percents.map(|percent| {
            let rank = (u64::from(percent) * count).div_ceil(100).max(1);
            sorted.get(rank as usize - 1).copied().unwrap_or(0.0)
        })
    }

    /// As [`worst_pixels`].
    pub fn worst(&self, most: usize) -> (Vec<([u32; 2], f64)>, usize) {
        worst_pixels(self.extent, &self.values, most)
    }
}

/// Returns the pixels with the greatest numbers above 0, at most `most`, and how many other pixels
/// have the same number as the last one. Of pixels with this number, those in the list are spread
/// over the picture.
pub fn worst_pixels(extent: [u32; 2], values: &[f64], most: usize) -> (Vec<([u32; 2], f64)>, usize) {
    let mut order: Vec<usize> = (0..values.len()).filter(|&at| values[at] > 0.0).collect();
    let by_value = |one: &usize, other: &usize| values[*other].total_cmp(&values[*one]).then(one.cmp(other));
    let mut ties = 0;
    if order.len() > most {
        let (_, &mut last, _) = order.select_nth_unstable_by(most.saturating_sub(1), by_value);
        let least = values[last];
        let equal: Vec<usize> = (0..values.len()).filter(|&at| values[at] == least).collect();
        order.retain(|&at| values[at] > least);
        let left = most - order.len();
        ties = equal.len() - left;
        order.extend((0..left).map(|at| equal[(2 * at + 1) * equal.len() / (2 * left)]));
    }
    order.sort_unstable_by(by_value);
    let width = extent[0].max(1) as usize;
    let pixel = |at: usize| ([(at % width) as u32, (at / width) as u32], values[at]);
    (order.into_iter().map(pixel).collect(), ties)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heat(values: &[f64]) -> Heat {
        let plane = InvocationPlane::of_launch([values.len() as u32 / 2, 2, 1]);
        Heat::new(HeatMeasure::Nodes, &plane, values)
    }

    #[test]
    fn percentiles_are_nearest_ranks() {
        // The example of the nearest-rank method: of five numbers the 30th percentile is the second
        // and the 40th, too, the 50th the third.
        let five = Heat { values: vec![50.0, 15.0, 40.0, 20.0, 35.0], ..heat(&[0.0; 2]) };
        assert_eq!(five.percentiles([0, 5, 30, 40, 50, 100]), [15.0, 15.0, 20.0, 20.0, 35.0, 50.0]);
        assert_eq!(five.total(), 160.0);
        assert_eq!(five.mean(), 32.0);
    }

    #[test]
    fn the_worst_pixels_come_first_and_equal_ones_are_spread() {
        let six = heat(&[1.0, 7.0, 0.0, 7.0, 9.0, 7.0]);
        // Of three equal ones two: the first and the third.
        assert_eq!(six.worst(3), (vec![([1, 1], 9.0), ([1, 0], 7.0), ([2, 1], 7.0)], 1));
        assert_eq!(six.worst(0).0, []);
        assert_eq!(six.worst(10).0.len(), 5, "a pixel that costs nothing is not among the worst");
        // Of nine equal ones three: the second, fifth and eighth.
        let nine = Heat { extent: [3, 3], values: vec![4.0; 9], ..six };
        assert_eq!(nine.worst(3), (vec![([1, 0], 4.0), ([1, 1], 4.0), ([1, 2], 4.0)], 6));
    }

    #[test]
    fn divergence_is_a_share_of_the_instructions() {
        let pixel = PixelCost { instructions: 8, divergent: 2, ..PixelCost::default() };
        assert_eq!(HeatMeasure::Divergence.of(&pixel), Some(25.0));
        assert_eq!(HeatMeasure::Divergence.of(&PixelCost::default()), Some(0.0));
    }
}
