//! Opacity micromaps: opacity of a triangle's parts (Vulkan, "Ray Opacity Micromap";
//! `VK_KHR_opacity_micromap`, `VK_EXT_opacity_micromap`).
//!
//! At level n a triangle is cut into 4^n microtriangles by halving its edges n times. They are
//! numbered along a space-filling curve: triangle (a, b, c) with the midpoints ab, bc, ca has the
//! children, in this order,
//!
//! ```text
//!   0: (a, ab, ca)    1: (ca, bc, ab)    2: (ab, b, bc)    3: (bc, ca, c)
//! ```
//!
//! each numbered inside in the same way. That is the specification's mapping from barycentrics to
//! an index, stated as a recursion; its way of rounding decides which microtriangle has a point of
//! an edge.

use crate::accel::flags::{InstanceFlags, RayFlags};

/// The deepest subdivision that a micromap may have here (devices: at least 3).
pub const MAX_SUBDIVISION_LEVEL: u32 = 12;

/// Opacity of a microtriangle, numbered as four-state maps store it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Opacity {
    /// Rays pass through.
    Transparent,
    /// A hit is opaque.
    Opaque,
    /// The any-hit shader decides; transparent in two-state mode.
    UnknownTransparent,
    /// The any-hit shader decides; opaque in two-state mode.
    UnknownOpaque,
}

impl Opacity {
    const ALL: [Self; 4] = [Self::Transparent, Self::Opaque, Self::UnknownTransparent, Self::UnknownOpaque];

    /// The state with this number, of the lowest two bits.
    pub fn from_bits(bits: u8) -> Self {
        Self::ALL[usize::from(bits & 3)]
    }

    /// Whether a hit counts as one of opaque geometry; `None` where the ray passes through.
    pub fn is_opaque(self, two_state: bool) -> Option<bool> {
        match (self, two_state) {
            (Self::Transparent, _) | (Self::UnknownTransparent, true) => None,
            (Self::Opaque, _) | (Self::UnknownOpaque, true) => Some(true),
            (Self::UnknownTransparent | Self::UnknownOpaque, false) => Some(false),
        }
    }
}

/// `VkOpacityMicromapFormatKHR`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OpacityFormat {
    /// `VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR`: a bit each, transparent or opaque.
    TwoState,
    /// `VK_OPACITY_MICROMAP_FORMAT_4_STATE_KHR`: two bits each.
    FourState,
}

/// The map of one triangle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MicromapTriangle {
    /// How its states are stored.
    pub format: OpacityFormat,
    /// n of 4^n microtriangles.
    pub subdivision_level: u32,
    /// The states in the order of their numbers, the first in the lowest bits of the first byte.
    pub states: Vec<u8>,
}

impl MicromapTriangle {
    /// How many microtriangles it has.
    pub fn len(&self) -> usize {
        1 << (2 * self.subdivision_level)
    }

    /// Always false: level 0 has one microtriangle.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Bytes that its states take.
    pub fn byte_len(&self) -> usize {
        let per_byte = match self.format {
            OpacityFormat::TwoState => 8,
            OpacityFormat::FourState => 4,
        };
        self.len().div_ceil(per_byte)
    }

    /// The state of a microtriangle.
    fn state(&self, index: usize) -> Opacity {
        match self.format {
            OpacityFormat::TwoState => Opacity::from_bits(self.states[index / 8] >> (index % 8) & 1),
            OpacityFormat::FourState => Opacity::from_bits(self.states[index / 4] >> (index % 4 * 2)),
        }
    }
}

/// What an element of a triangle geometry's micromap index buffer names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MicromapIndex {
    /// A triangle of the micromap.
    Triangle(u32),
    /// `VkOpacityMicromapSpecialIndexKHR`: one opacity for the whole triangle.
    Special(Opacity),
}

/// A micromap as a geometry uses it (`VkAccelerationStructureTrianglesOpacityMicromapKHR`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpacityMicromap {
    /// The triangles of the micromap.
    pub triangles: Vec<MicromapTriangle>,
    /// One for each primitive; without it, primitive n has triangle n.
    pub indices: Option<Vec<MicromapIndex>>,
}

impl OpacityMicromap {
    /// The opacity where a ray meets a primitive, at the barycentrics of its second and third
    /// vertex.
    pub fn opacity(&self, primitive: u32, barycentrics: [f32; 2]) -> Opacity {
        let index = match &self.indices {
            Some(indices) => indices[primitive as usize],
            None => MicromapIndex::Triangle(primitive),
        };
        match index {
            MicromapIndex::Special(opacity) => opacity,
            MicromapIndex::Triangle(triangle) => {
                let triangle = &self.triangles[triangle as usize];
                triangle.state(microtriangle(barycentrics, triangle.subdivision_level))
            }
        }
    }

    /// Says what is wrong with it for a geometry of so many primitives.
    pub(super) fn mistake(&self, primitives: usize) -> Option<String> {
        for (at, triangle) in self.triangles.iter().enumerate() {
            let level = triangle.subdivision_level;
            if level > MAX_SUBDIVISION_LEVEL {
                return Some(format!(
                    "the subdivision level {level} of micromap triangle {at} exceeds \
                     {MAX_SUBDIVISION_LEVEL}"
                ));
            }
            if triangle.states.len() < triangle.byte_len() {
                return Some(format!(
                    "micromap triangle {at} has {} bytes of states, but its {} microtriangles need {}",
                    triangle.states.len(),
                    triangle.len(),
                    triangle.byte_len()
                ));
            }
        }
        let Some(indices) = &self.indices else {
            return (self.triangles.len() < primitives).then(|| {
                format!("found {} micromap triangles for {primitives} primitives", self.triangles.len())
            });
        };
        if indices.len() < primitives {
            return Some(format!("found {} micromap indices for {primitives} primitives", indices.len()));
        }
        let outside = |index: &MicromapIndex| matches!(index, MicromapIndex::Triangle(at) if *at as usize >= self.triangles.len());
        let at = indices.iter().position(outside)?;
        Some(format!("micromap index {at} refers to {:?} of {}", indices[at], self.triangles.len()))
    }
}

/// Whether unknown opacities are decided without a shader.
#[inline]
pub fn is_two_state(ray: RayFlags, instance: InstanceFlags) -> bool {
    ray.contains(RayFlags::FORCE_OPACITY_MICROMAP_2_STATE)
        || instance.contains(InstanceFlags::FORCE_OPACITY_MICROMAP_2_STATE)
}

/// The number of the microtriangle at the barycentrics of the second and third vertex.
fn microtriangle([u, v]: [f32; 2], level: u32) -> usize {
    let parts = 1i64 << level;
    // Exact: a scaling by a power of two, and sums of numbers that differ by less than 2^29.
    let (u, v) = (f64::from(u.clamp(0.0, 1.0)) * parts as f64, f64::from(v.clamp(0.0, 1.0)) * parts as f64);
    let (mut column, row) = ((u as i64).min(parts - 1), (v as i64).min(parts - 1));
    let past = column + row - (parts - 1);
    let is_upper = u.fract() + v.fract() >= 1.0 && past < 0;
    if past > 0 {
        column -= past;
    }
    // Its centroid, in thirds of a microtriangle's edge, never lies on an edge of the subdivision.
    let part = if is_upper { 2 } else { 1 };
    let total = 3 * parts;
    let (mut b, mut c) = (3 * column + part, 3 * row + part);
    let mut a = total - b - c;
    let mut index = 0;
    for _ in 0..level {
        let child;
        (child, a, b, c) = if 2 * a > total {
            (0, a - b - c, 2 * b, 2 * c)
        } else if 2 * b > total {
            (2, 2 * a, b - a - c, 2 * c)
        } else if 2 * c > total {
            (3, 2 * b, 2 * a, c - a - b)
        } else {
            (1, total - 2 * b, total - 2 * a, total - 2 * c)
        };
        index = 4 * index + child;
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;

    type Corner = [f64; 2];

    /// The microtriangles in the order of their numbers, by the recursion of this file's head.
    fn subdivided([a, b, c]: [Corner; 3], level: u32) -> Vec<[Corner; 3]> {
        if level == 0 {
            return vec![[a, b, c]];
        }
        let middle = |p: Corner, q: Corner| [(p[0] + q[0]) / 2.0, (p[1] + q[1]) / 2.0];
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        let children = [[a, ab, ca], [ca, bc, ab], [ab, b, bc], [bc, ca, c]];
        children.into_iter().flat_map(|child| subdivided(child, level - 1)).collect()
    }

    #[test]
    fn centroids_are_numbered_along_the_curve() {
        for level in 0..=6 {
            let all = subdivided([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], level);
            for (index, corners) in all.iter().enumerate() {
                let at = |axis: usize| (corners.iter().map(|corner| corner[axis]).sum::<f64>() / 3.0) as f32;
                assert_eq!(microtriangle([at(0), at(1)], level), index, "level {level}");
            }
        }
    }

    #[test]
    fn numbers_of_level_two_by_hand() {
        // The specification's mapping worked out on paper, in quarters: integer parts (i, j),
        // k = !(i + j), less 1 in an upper half; then bits b0 = !(i ^ k), t = (i ^ j) & b0,
        // f = prefix xor of t from above, b1 = ((f ^ i) & !b0) | t, interleaved.
        //   (0, 0) lower: k = 11, b0 = 00, t = 00, b1 = 00              -> 0
        //   (1, 0) lower: k = 10, b0 = !(01 ^ 10) = 00, b1 = 01         -> 2
        //   (0, 1) lower: k = 10, b0 = 01, t = 01, f = 01, b1 = 01      -> 3
        //   (1, 1) lower: k = 01, b0 = !(00) = 11 -> & 11 = 11, t = 00, b1 = 00 -> 5
        //   (3, 0) lower: k = 00, b0 = 00, b1 = 11                      -> 10
        //   (0, 3) lower: k = 00, b0 = 11, t = 11, b1 = 11              -> 15
        let lower = |i: f32, j: f32| microtriangle([(i + 0.25) / 4.0, (j + 0.25) / 4.0], 2);
        assert_eq!([lower(0., 0.), lower(1., 0.), lower(0., 1.)], [0, 2, 3]);
        assert_eq!([lower(1., 1.), lower(3., 0.), lower(0., 3.)], [5, 10, 15]);
    }

    #[test]
    fn points_of_edges_and_corners_belong_somewhere() {
        // Corners: the first is number 0, the second the last of child 2's, the third the last.
        assert_eq!([microtriangle([0.0, 0.0], 1), microtriangle([1.0, 0.0], 1)], [0, 2]);
        assert_eq!(microtriangle([0.0, 1.0], 1), 3);
        // A point of the edge between 0 and 1: u + v is half, so the upper one.
        assert_eq!(microtriangle([0.25, 0.25], 1), 1);
        // The long edge's middle: both integer parts are 1, the first is drawn back to 0.
        assert_eq!(microtriangle([0.5, 0.5], 1), 3);
        assert_eq!(microtriangle([f32::NAN, 2.0], 12) >> 22, 3);
        assert!(microtriangle([1.0, 1.0], MAX_SUBDIVISION_LEVEL) < 1 << 24);
    }

    #[test]
    fn states_are_read_from_the_lowest_bits_up() {
        let map = |format, states| MicromapTriangle { format, subdivision_level: 1, states };
        let read = |map: &MicromapTriangle| (0..4).map(|index| map.state(index)).collect::<Vec<_>>();
        let four = map(OpacityFormat::FourState, vec![0b11_10_01_00]);
        assert_eq!(read(&four), Opacity::ALL);
        let two = map(OpacityFormat::TwoState, vec![0b0110]);
        assert_eq!(
            read(&two),
            [Opacity::Transparent, Opacity::Opaque, Opacity::Opaque, Opacity::Transparent]
        );
        assert_eq!([four.byte_len(), two.byte_len()], [1, 1]);
    }

    #[test]
    fn two_state_mode_settles_what_is_unknown() {
        let all = |two_state| Opacity::ALL.map(|opacity| opacity.is_opaque(two_state));
        assert_eq!(all(false), [None, Some(true), Some(false), Some(false)]);
        assert_eq!(all(true), [None, Some(true), None, Some(true)]);
    }

    #[test]
    fn mistakes_are_named() {
        let triangle =
            MicromapTriangle { format: OpacityFormat::FourState, subdivision_level: 2, states: vec![0; 4] };
        let map = |triangle: &MicromapTriangle, indices| OpacityMicromap {
            triangles: vec![triangle.clone()],
            indices,
        };
        assert_eq!(map(&triangle, None).mistake(1), None);
        assert!(map(&triangle, None).mistake(2).is_some_and(|text| text.contains("for 2 primitives")));
        let short = MicromapTriangle { states: vec![0; 3], ..triangle.clone() };
        assert!(map(&short, None).mistake(1).is_some_and(|text| text.contains("16 microtriangles need 4")));
        let deep = MicromapTriangle { subdivision_level: 13, ..triangle.clone() };
        assert!(map(&deep, None).mistake(1).is_some_and(|text| text.contains("level 13")));
        let indices = vec![MicromapIndex::Special(Opacity::Opaque), MicromapIndex::Triangle(1)];
        assert!(map(&triangle, Some(indices)).mistake(2).is_some_and(|text| text.contains("index 1")));
    }
}
