//! Neighbouring rays of a case, which are traced in one packet with it.

use crate::case::{Neighbour, Shape, StressCase};
use crate::draw::Draw;
use anyhit_engine::math::array;

/// The most tests of a primitive by a ray: the expected hits need one for each pair.
const MAX_TESTS: usize = 4096;

/// Sometimes adds neighbours to a case, for a packet of 8 to 64 rays.
pub fn add_neighbours(draw: &mut Draw, case: &mut StressCase) {
    let primitives = case.shapes.len() * (1 + case.others.len());
    let has_bvh = primitives > 4;
    if !draw.one_in(if has_bvh { 2 } else { 8 }) || matches!(case.shapes[0], Shape::Aabb(_)) {
        return;
    }
    let max_count = (MAX_TESTS / primitives).clamp(7, if has_bvh { 63 } else { 15 });
    let count = if draw.one_in(3) { max_count } else { 1 + draw.below(max_count) };
    if draw.one_in(4) {
        case.flags = [16, 32][draw.below(2)];
    }
    if draw.one_in(3) {
        case.hidden = 0;
    }
    let spread = PacketSpread::draw(draw);
    // A ray with other flags or masks prevents the packet.
    let different = if draw.one_in(10) { draw.below(count) } else { count };
    let neighbours = (0..count).map(|at| {
        let mut neighbour = spread.next(draw, case);
        if at == different {
            let flags = [0, 16, 32, 1][draw.below(4)];
            (neighbour.flags, neighbour.cull_mask) = (flags, [1, 2, 3, 0xFF04][draw.below(4)]);
        }
        neighbour
    });
    case.neighbours = neighbours.collect();
}

/// How the rays of a packet differ.
struct PacketSpread {
    /// How far apart their origins are, relative to the size of the case's origin.
    origin_spread: f32,
    /// How much their directions differ, relative to the size of the case's direction.
    direction_spread: f32,
    /// Whether they pass through corners of primitives.
    is_aimed: bool,
    /// Whether signs of directions are flipped.
    flips_signs: bool,
    /// Whether intervals differ.
    varies_intervals: bool,
}

impl PacketSpread {
    fn draw(draw: &mut Draw) -> Self {
        let spread = |draw: &mut Draw| [0.0, 0.0, 1e-6, 1e-3, 0.1, 1.0][draw.below(6)];
        Self {
            origin_spread: spread(draw),
            direction_spread: spread(draw),
            is_aimed: draw.one_in(3),
            flips_signs: draw.one_in(4),
            varies_intervals: draw.one_in(3),
        }
    }

    fn next(&self, draw: &mut Draw, case: &StressCase) -> Neighbour {
        let StressCase { mut origin, mut direction, mut t_min, mut t_max, time, flags, .. } = *case;
        let (from, long) = (draw.size(origin), draw.size(direction));
        if self.is_aimed && case.transform.is_none() {
            // The direction has the length of the case's direction, so that t is similar.
            let corner = corner(draw, case);
            let to_corner: [f32; 3] = array::from_fn(|i| corner[i] - origin[i]);
            let by = long / draw.size(to_corner);
            direction = to_corner.map(|x| x * by);
        }
        for i in 0..3 {
            origin[i] +=
                self.origin_spread * from * if draw.one_in(2) { draw.unit() } else { draw.small() * 0.25 };
            if self.direction_spread != 0.0 {
                direction[i] += self.direction_spread * long * draw.unit();
            }
            if self.flips_signs && draw.one_in(4) {
                direction[i] = -direction[i];
            }
            // Sometimes a ray does not fit the packet.
            if self.flips_signs && draw.one_in(64) {
                direction[i] *= draw.scale();
            }
        }
        if self.varies_intervals && draw.one_in(2) {
            let end = [0.0, 0.5, 1.0, 2.0, 1e3][draw.below(5)] * draw.scale();
            (t_min, t_max) = [(0.0, end), (end, f32::INFINITY), (end, end)][draw.below(3)];
        }
        let finite = |v: [f32; 3]| v.iter().all(|x| x.is_finite());
        if !finite(origin) || !finite(direction) {
            (origin, direction) = (case.origin, case.direction);
        }
        let time = if draw.one_in(20) { draw.unit().abs() } else { time };
        Neighbour { origin, direction, t_min, t_max, time, flags, cull_mask: 1 }
    }
}

/// A corner or the centre of one of the primitives.
fn corner(draw: &mut Draw, case: &StressCase) -> [f32; 3] {
    match case.shapes[draw.below(case.shapes.len())] {
        Shape::Triangle(vertices) | Shape::MovingTriangle([vertices, _]) => vertices[draw.below(3)],
        Shape::Aabb(corners) => corners[draw.below(2)],
        Shape::Sphere { center, .. } => center,
        Shape::LinearSweptSphere { positions, .. } => positions[draw.below(2)],
    }
}
