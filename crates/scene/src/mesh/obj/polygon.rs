//! Polygons as triangles: `n` corners always become `n - 2` triangles over the same corners.

use std::cmp::Ordering;

/// Tests of corners after which a polygon counts as too complex.
const MAX_TESTS: u64 = 1 << 30;

type Point = [f64; 2];

/// Returns whether the fan around the first corner covers a polygon: none of its triangles faces
/// away from the polygon's side.
#[inline]
pub(super) fn is_fan(corners: &impl Fn(usize) -> [f32; 3], count: usize) -> bool {
    let normals = || fan_normals(corners, count);
    let [x, y, z] = sum(normals());
    !normals().any(|[a, b, c]| a * x + b * y + c * z < 0.0)
}

/// Twice the vector areas of the triangles of a fan.
#[inline]
fn fan_normals(corners: &impl Fn(usize) -> [f32; 3], count: usize) -> impl Iterator<Item = [f64; 3]> {
    let first = corners(0);
    let side = move |at| {
        let corner = corners(at);
        let axis = |axis: usize| f64::from(corner[axis]) - f64::from(first[axis]);
        [axis(0), axis(1), axis(2)]
    };
    let mut last = side(1);
    (2..count).map(move |at| {
        let (a, b) = (last, side(at));
        last = b;
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    })
}

#[inline]
fn sum(vectors: impl Iterator<Item = [f64; 3]>) -> [f64; 3] {
    vectors.fold([0.0; 3], |[x, y, z], [a, b, c]| [x + a, y + b, z + c])
}

/// Cuts ears off a polygon that its fan does not cover, seen along the axis that its normal is
/// nearest to; `None` where that takes too long.
///
/// A crate such as `earcut` leaves out corners on the line between their neighbours, which opens
/// cracks to the polygons beside them; here they stay.
pub(super) fn ears(corners: &impl Fn(usize) -> [f32; 3], count: usize) -> Option<Vec<[usize; 3]>> {
    ears_within(corners, count, MAX_TESTS)
}

fn ears_within(
    corners: &impl Fn(usize) -> [f32; 3],
    count: usize,
    max_tests: u64,
) -> Option<Vec<[usize; 3]>> {
    if count == 4 {
        // The other diagonal.
        return Some(vec![[3, 0, 1], [1, 2, 3]]);
    }
    let mut ring = Ring::new(projected(corners, count));
    let mut triangles = Vec::with_capacity(count - 2);
    let (mut at, mut left, mut tried, mut tests) = (0, count, 0, 0);
    while left > 2 {
        let is_ear = match (tried / left, ring.turn(at)) {
            (0, Ordering::Greater) => ring.is_empty(at, &mut tests),
            // A polygon that touches or crosses itself may have no ear.
            (0, _) => false,
            (1, turn) => turn != Ordering::Less,
            _ => true,
        };
        let next = ring.next[at];
        if is_ear {
            triangles.push([ring.previous[at], at, next]);
            ring.cut(at);
            (left, tried) = (left - 1, 0);
            // The corner behind the next one, for triangles that are not all around one corner.
            at = ring.next[next];
        } else {
            (at, tried) = (next, tried + 1);
        }
        tests += 1;
        if tests > max_tests {
            return None;
        }
    }
    Some(triangles)
}

/// The corners in a plane in which they go around counter-clockwise.
fn projected(corners: &impl Fn(usize) -> [f32; 3], count: usize) -> Vec<Point> {
    let normal = sum(fan_normals(corners, count));
    let longest = (0..3).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(2);
    let (mut u, mut v) = ((longest + 1) % 3, (longest + 2) % 3);
    if normal[longest] < 0.0 {
        (u, v) = (v, u);
    }
    (0..count).map(|at| [corners(at)[u], corners(at)[v]].map(f64::from)).collect()
}

/// Positive where three points turn to the left.
fn orientation(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
}

/// The corners that are left.
struct Ring {
    points: Vec<Point>,
    next: Vec<usize>,
    previous: Vec<usize>,
    /// The corners that may lie in an ear: those that do not turn to the left.
    blunt: Vec<usize>,
    is_blunt: Vec<bool>,
}

impl Ring {
    fn new(points: Vec<Point>) -> Self {
        let count = points.len();
        let mut ring = Self {
            next: (1..count).chain([0]).collect(),
            previous: [count - 1].into_iter().chain(0..count - 1).collect(),
            blunt: Vec::new(),
            is_blunt: Vec::new(),
            points,
        };
        ring.is_blunt = (0..count).map(|at| ring.turn(at) != Ordering::Greater).collect();
        ring.blunt = (0..count).filter(|at| ring.is_blunt[*at]).collect();
        ring
    }

    fn ear(&self, at: usize) -> [Point; 3] {
        [self.previous[at], at, self.next[at]].map(|corner| self.points[corner])
    }

    /// `Greater` for a turn to the left.
    fn turn(&self, at: usize) -> Ordering {
        let [a, b, c] = self.ear(at);
        orientation(a, b, c).partial_cmp(&0.0).unwrap_or(Ordering::Equal)
    }

    /// Whether no other corner lies in an ear or on its border.
    fn is_empty(&self, at: usize, tests: &mut u64) -> bool {
        *tests += self.blunt.len() as u64;
        let [a, b, c] = self.ear(at);
        !self.blunt.iter().map(|corner| self.points[*corner]).any(|point| {
            ![a, b, c].contains(&point)
                && orientation(a, b, point) >= 0.0
                && orientation(b, c, point) >= 0.0
                && orientation(c, a, point) >= 0.0
        })
    }

    fn cut(&mut self, at: usize) {
        let (previous, next) = (self.previous[at], self.next[at]);
        self.next[previous] = next;
        self.previous[next] = previous;
        self.is_blunt[at] = false;
        for corner in [previous, next] {
            let is_blunt = self.turn(corner) != Ordering::Greater;
            if is_blunt && !self.is_blunt[corner] {
                self.blunt.push(corner);
            }
            self.is_blunt[corner] = is_blunt;
        }
        self.blunt.retain(|corner| self.is_blunt[*corner]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::math::random::Random;

    /// Twice the areas of triangles of a polygon in the plane z = 0, counter-clockwise.
    fn areas(points: &[[f32; 2]], triangles: &[[usize; 3]]) -> Vec<f64> {
        let point = |at: usize| points[at].map(f64::from);
        triangles.iter().map(|[a, b, c]| orientation(point(*a), point(*b), point(*c))).collect()
    }

    /// Twice the area of a polygon: Gauss's area formula.
    fn area(points: &[[f32; 2]]) -> f64 {
        let pairs = points.iter().zip(points.iter().cycle().skip(1));
        pairs.map(|(a, b)| f64::from(a[0]) * f64::from(b[1]) - f64::from(a[1]) * f64::from(b[0])).sum()
    }

    /// Triangles that all face the polygon's side, and whose edges cancel out but for the polygon's
    /// own, cover each point as often as the polygon goes around it.
    fn check(points: &[[f32; 2]], strict: bool) {
        let corners = |at: usize| [points[at][0], points[at][1], 0.0];
        let triangles = ears(&corners, points.len()).expect("triangles");
        assert_eq!(triangles.len(), points.len() - 2);
        let areas = areas(points, &triangles);
        assert!(
            areas.iter().all(|area| *area > 0.0 || (!strict && *area == 0.0)),
            "{points:?}: {triangles:?}"
        );
        assert!((areas.iter().sum::<f64>() - area(points)).abs() < 1e-9 * area(points), "{points:?}");
        let mut edges: Vec<[usize; 2]> =
            triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
        for at in 0..points.len() {
            let edge = [at, (at + 1) % points.len()];
            edges.swap_remove(edges.iter().position(|one| *one == edge).expect("an edge of the polygon"));
        }
        for [a, b] in edges.clone() {
            assert!(edges.contains(&[b, a]), "{points:?}: {a} {b}");
        }
    }

    #[test]
    fn ears_cover_polygons() {
        // By hand: 4 * 4 less the notch of half of 4 * 3 is 10.
        let notch = [[0., 0.], [4., 0.], [4., 4.], [2., 1.], [0., 4.]];
        assert_eq!(area(&notch), 20.0);
        check(&notch, true);
        // A quad that is concave at its last corner, and one at its second.
        check(&[[0., 0.], [2., 0.5], [0., 4.], [0.5, 0.5]], true);
        check(&[[0., 4.], [0.5, 0.5], [0., 0.], [2., 0.5]], true);
        // Corners on straight sides stay corners, and no triangle is flat.
        check(&[[0., 0.], [1., 0.], [2., 0.], [4., 0.], [4., 4.], [2., 1.], [0., 4.], [0., 2.]], true);
        // A comb.
        let teeth = (0..40).rev().flat_map(|at| [[at as f32 + 0.5, 1.0], [at as f32, 9.0]]);
        let comb: Vec<[f32; 2]> = teeth.chain([[-1.0, 0.0], [40.0, 0.0]]).collect();
        check(&comb, true);
        // A square with a square hole, which a bridge joins: two corners are there twice.
        let hole = [
            [0., 0.],
            [3., 0.],
            [3., 3.],
            [0., 3.],
            [0., 0.],
            [1., 1.],
            [1., 2.],
            [2., 2.],
            [2., 1.],
            [1., 1.],
        ];
        assert_eq!(area(&hole), 16.0);
        check(&hole, true);
    }

    /// Stars around a point never cross themselves, whatever the distances of their corners are.
    #[test]
    fn ears_cover_random_stars() {
        let mut random = Random::new(3);
        for round in 0..300 {
            let count = 5 + random.below(40) as usize;
            let points: Vec<[f32; 2]> = (0..count)
                .map(|at| {
                    let angle =
                        (at as f64 + 0.8 * f64::from(random.unit())) / count as f64 * std::f64::consts::TAU;
                    let distance = 0.1 + f64::from(random.unit());
                    [angle.cos() * distance, angle.sin() * distance].map(|x| x as f32)
                })
                .collect();
            if round % 2 == 0 || area(&points) > 0.0 {
                check(&points, true);
            }
        }
    }

    #[test]
    fn fans_are_kept_where_they_cover_the_polygon() {
        let is_fan_of = |points: &[[f32; 3]]| is_fan(&|at: usize| points[at], points.len());
        assert!(is_fan_of(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.5]]));
        // Concave at the first corner: its fan covers it.
        assert!(is_fan_of(&[[0.5, 0.5, 0.], [0., 0., 0.], [2., 0.5, 0.], [0., 4., 0.]]));
        assert!(!is_fan_of(&[[0., 0., 0.], [2., 0.5, 0.], [0., 4., 0.], [0.5, 0.5, 0.]]));
        // Flat and not a number.
        assert!(is_fan_of(&[[0., 0., 0.], [1., 0., 0.], [2., 0., 0.], [3., 0., 0.]]));
        assert!(is_fan_of(&[[f32::NAN, 0., 0.], [1., 0., 0.], [2., 0., 0.], [3., 0., 0.]]));
    }

    /// One polygon in planes across each axis, seen from both sides.
    #[test]
    fn polygons_face_any_side() {
        let notch = [[0., 0.], [4., 0.], [4., 4.], [2., 1.], [0., 4.]];
        for axis in 0..3 {
            for is_turned in [false, true] {
                let corner = |at: usize| {
                    let [u, v] = notch[if is_turned { 4 - at } else { at }];
                    let mut point = [u, v, 0.5 * u];
                    point.rotate_right(axis);
                    point
                };
                let normal = sum(fan_normals(&corner, 5));
                for [a, b, c] in ears(&corner, 5).expect("triangles") {
                    let of_ear = sum(fan_normals(&|at: usize| corner([a, b, c][at]), 3));
                    let product: f64 = normal.iter().zip(of_ear).map(|(x, y)| x * y).sum();
                    assert!(product > 0.0, "{axis} {is_turned} {a} {b} {c}");
                }
            }
        }
    }

    #[test]
    fn what_crosses_itself_still_becomes_triangles() {
        for points in [&[[0., 0.], [1., 1.], [1., 0.], [0., 1.], [3., 0.5]][..], &[[0., 0.]; 6]] {
            let corner = |at: usize| [points[at][0], points[at][1], 0.0];
            assert_eq!(ears(&corner, points.len()).expect("triangles").len(), points.len() - 2);
        }
        let notch = [[0., 0.], [4., 0.], [4., 4.], [2., 1.], [0., 4.]];
        let corner = |at: usize| [notch[at][0], notch[at][1], 0.0];
        assert_eq!(ears_within(&corner, 5, 2), None);
    }
}
