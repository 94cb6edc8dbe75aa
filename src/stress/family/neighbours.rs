//! Neighbouring rays of a case, which are traced in one packet with it.

use crate::stress::case::{Neighbour, Shape, StressCase};
use crate::stress::draw::Draw;

/// The known hits need a test of each primitive by each ray: the most such tests.
const TESTS: usize = 4096;

/// Sometimes gives a case neighbours: a packet has 8 to 64 rays.
pub fn surround(draw: &mut Draw, case: &mut StressCase) {
    let primitives = case.shapes.len() * (1 + case.others.len());
    let has_tree = primitives > 4;
    if !draw.one_in(if has_tree { 2 } else { 8 }) || matches!(case.shapes[0], Shape::Aabb(_)) {
        return;
    }
    let most = (TESTS / primitives).clamp(7, if has_tree { 63 } else { 15 });
    let count = if draw.one_in(3) { most } else { 1 + draw.below(most) };
    if draw.one_in(4) {
        case.flags = [16, 32][draw.below(2)];
    }
    if draw.one_in(3) {
        case.hidden = 0;
    }
    let way = Way::draw(draw);
    // A ray of other flags or masks prevents the packet.
    let odd = if draw.one_in(10) { draw.below(count) } else { count };
    let neighbours = (0..count).map(|at| {
        let mut neighbour = way.next(draw, case);
        if at == odd {
            let flags = [0, 16, 32, 1][draw.below(4)];
            (neighbour.flags, neighbour.cull_mask) = (flags, [1, 2, 3, 0xFF04][draw.below(4)]);
        }
        neighbour
    });
    case.neighbours = neighbours.collect();
}

/// How the rays of a packet differ.
struct Way {
    /// How far apart they start and by how much their directions differ, in sizes of each.
    apart: f32,
    turned: f32,
    /// Whether they go through corners of primitives.
    is_aimed: bool,
    /// Whether signs of directions are flipped.
    is_mixed: bool,
    /// Whether intervals differ.
    is_cut: bool,
}

impl Way {
    fn draw(draw: &mut Draw) -> Self {
        let spread = |draw: &mut Draw| [0.0, 0.0, 1e-6, 1e-3, 0.1, 1.0][draw.below(6)];
        Self {
            apart: spread(draw),
            turned: spread(draw),
            is_aimed: draw.one_in(3),
            is_mixed: draw.one_in(4),
            is_cut: draw.one_in(3),
        }
    }

    fn next(&self, draw: &mut Draw, case: &StressCase) -> Neighbour {
        let StressCase { mut origin, mut direction, mut t_min, mut t_max, time, flags, .. } = *case;
        let (from, long) = (draw.size(origin), draw.size(direction));
        if self.is_aimed && case.transform.is_none() {
            // Of the case's length, so that t is similar.
            let corner = corner(draw, case);
            let way: [f32; 3] = std::array::from_fn(|i| corner[i] - origin[i]);
            let by = long / draw.size(way);
            direction = way.map(|x| x * by);
        }
        for i in 0..3 {
            origin[i] += self.apart * from * if draw.one_in(2) { draw.unit() } else { draw.small() * 0.25 };
            if self.turned != 0.0 {
                direction[i] += self.turned * long * draw.unit();
            }
            if self.is_mixed && draw.one_in(4) {
                direction[i] = -direction[i];
            }
            // Now and then a ray that does not fit the packet.
            if self.is_mixed && draw.one_in(64) {
                direction[i] *= draw.scale();
            }
        }
        if self.is_cut && draw.one_in(2) {
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

/// A corner or the middle of one of the primitives.
fn corner(draw: &mut Draw, case: &StressCase) -> [f32; 3] {
    match case.shapes[draw.below(case.shapes.len())] {
        Shape::Triangle(vertices) | Shape::MovingTriangle([vertices, _]) => vertices[draw.below(3)],
        Shape::Aabb(corners) => corners[draw.below(2)],
        Shape::Sphere { center, .. } => center,
        Shape::LinearSweptSphere { positions, .. } => positions[draw.below(2)],
    }
}
