//! Minimises a failing case: fewer primitives, instances and rays, no motion, short numbers.

use crate::case::{MotionKeys, Placement, Shape, StressCase};
use crate::judge::{Failure, check_caught};
use anyhit_engine::geometry::Precision;

/// A case that fails, no larger than the given one in any respect, and how it fails. Tries each
/// change in turn and keeps it if the case still fails (in whatever way), until none helps.
///
/// # Panics
/// Where the given case does not fail.
pub fn minimise(case: &StressCase, precision: Precision) -> (StressCase, Failure) {
    let fails = |case: &StressCase| check_caught(case, precision).err();
    let failure = fails(case).expect("bug in anyhit: a case that does not fail is minimised");
    let mut minimizer = Minimizer { best: case.clone(), failure, fails };
    // Each kept change makes the case smaller, so that this ends; the bound limits the time.
    for _ in 0..8 {
        let before = minimizer.best.clone();
        minimizer.shorten(0, |case| &mut case.neighbours);
        minimizer.shorten(0, |case| &mut case.others);
        minimizer.shorten(1, |case| &mut case.shapes);
        minimizer.simplify();
        minimizer.equalise();
        let count = minimizer.best.numbers().len();
        for place in 0..count {
            for simpler in simpler(*minimizer.best.numbers()[place]) {
                if minimizer.try_change(|case| *case.numbers()[place] = simpler) {
                    break;
                }
            }
        }
        if minimizer.best == before {
            break;
        }
    }
    (minimizer.best, minimizer.failure)
}

/// The state of the minimisation: the smallest failing case so far.
struct Minimizer<F> {
    best: StressCase,
    failure: Failure,
    fails: F,
}

impl<F: Fn(&StressCase) -> Option<Failure>> Minimizer<F> {
    /// Makes a change if the case then still fails; returns whether it does, and the case differs.
    fn try_change(&mut self, change: impl FnOnce(&mut StressCase)) -> bool {
        let mut candidate = self.best.clone();
        change(&mut candidate);
        if candidate == self.best {
            return false;
        }
        let failure = (self.fails)(&candidate);
        if let Some(failure) = failure {
            (self.best, self.failure) = (candidate, failure);
            return true;
        }
        false
    }

    /// Removes elements of a list, down to `least`: chunks of half its length, then of a quarter,
    /// down to single elements (delta debugging, Zeller and Hildebrandt 2002).
    fn shorten<T>(&mut self, least: usize, list: fn(&mut StressCase) -> &mut Vec<T>) {
        let mut chunk = list(&mut self.best).len();
        while chunk > 0 {
            let mut first = 0;
            loop {
                let count = list(&mut self.best).len();
                if first >= count {
                    break;
                }
                let end = count.min(first + chunk);
                if count - (end - first) < least
                    || !self.try_change(|case| drop(list(case).drain(first..end)))
                {
                    first = end;
                }
            }
            chunk /= 2;
        }
    }

    /// Replaces special properties of the case by their defaults.
    fn simplify(&mut self) {
        self.try_change(|case| case.transform = None);
        self.try_change(|case| case.motion = None);
        self.try_change(|case| case.flags = 0);
        self.try_change(|case| case.hidden = 0);
        let key_of = |motion: &mut Option<MotionKeys>| match motion {
            Some(MotionKeys::Matrix([first, second])) => *second = *first,
            Some(MotionKeys::Srt([first, second])) => *second = *first,
            None => {}
        };
        self.try_change(|case| key_of(&mut case.motion));
        for at in 0..self.best.others.len() {
            self.try_change(|case| case.others[at].transform = None);
            self.try_change(|case| case.others[at].motion = None);
            self.try_change(|case| key_of(&mut case.others[at].motion));
            self.try_change(|case| {
                let Placement { transform, motion, .. } = case.others[at];
                case.others[at] = Placement::new(transform, motion);
            });
        }
        for at in 0..self.best.shapes.len() {
            self.try_change(|case| {
                if let Shape::MovingTriangle([first, _]) = case.shapes[at] {
                    case.shapes[at] = Shape::Triangle(first);
                }
            });
        }
    }

    /// Makes neighbours equal to the ray of the case, or at least its origin, direction and
    /// interval.
    fn equalise(&mut self) {
        for at in 0..self.best.neighbours.len() {
            let StressCase { origin, direction, t_min, t_max, time, flags, .. } = self.best;
            self.try_change(|case| {
                (case.neighbours[at].origin, case.neighbours[at].direction) = (origin, direction)
            });
            self.try_change(|case| case.neighbours[at].origin = origin);
            self.try_change(|case| case.neighbours[at].direction = direction);
            self.try_change(|case| (case.neighbours[at].t_min, case.neighbours[at].t_max) = (t_min, t_max));
            self.try_change(|case| {
                let neighbour = &mut case.neighbours[at];
                (neighbour.time, neighbour.flags, neighbour.cull_mask) = (time, flags, 1);
            });
        }
    }
}

/// Shorter numbers that could replace one, the shortest first.
fn simpler(x: f32) -> Vec<f32> {
    let mut out = Vec::new();
    if x == 0.0 || !x.is_finite() {
        return out;
    }
    out.extend([0.0, 1.0f32.copysign(x)].into_iter().filter(|&y| y != x));
    for kept in [1, 2, 4, 8, 12, 16, 20] {
        let mask = u32::MAX << (24 - kept);
        let shorter = f32::from_bits(x.to_bits() & mask);
        if shorter != x {
            out.push(shorter);
        }
    }
    // +-1 must not be changed to 0 and back.
    if x.abs() == 1.0 { vec![0.0] } else { out }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Neighbour;
    use crate::draw::TransformedRay;
    use anyhit_engine::geometry::Ray;

    #[test]
    fn everything_irrelevant_to_a_failure_is_removed() {
        let ray = Ray::new([3.25, 0.0, 0.0], [0.1, 0.2, 0.3]);
        let ball = |k: usize| Shape::Sphere { center: [k as f32, 0.3, 0.0], radius: 1.0 };
        let mut case =
            StressCase::new((0..77).map(ball).collect(), TransformedRay { ray, matrix: Some([[0.5; 4]; 3]) });
        let Ray { origin, direction, t_min, .. } = ray;
        let neighbour =
            Neighbour { origin, direction, t_min, t_max: 7.0, time: 0.5, flags: 16, cull_mask: 3 };
        case.neighbours = vec![neighbour; 63];
        case.neighbours[40].direction = [0.0, 0.0, -1.0];
        let motion = MotionKeys::Matrix([[[0.1; 4]; 3], [[0.2; 4]; 3]]);
        case.others = vec![Placement::new(Some([[0.7; 4]; 3]), Some(motion)); 9];
        // Eight rays, of which one points down, and a sphere for that.
        let fails = |case: &StressCase| {
            let has_ball = case.shapes.iter().any(|shape| *shape == ball(40));
            let goes_down = case.neighbours.iter().any(|neighbour| neighbour.direction[2] < 0.0);
            (has_ball && goes_down && case.neighbours.len() >= 7).then(|| Failure("it fails".to_owned()))
        };
        let failure = Failure(String::new());
        let mut minimizer = Minimizer { best: case, failure, fails };
        minimizer.shorten(0, |case| &mut case.neighbours);
        minimizer.shorten(0, |case| &mut case.others);
        minimizer.shorten(1, |case| &mut case.shapes);
        minimizer.simplify();
        minimizer.equalise();
        let mut least = StressCase { hidden: 0, ..StressCase::new(vec![ball(40)], ray.into()) };
        let alike = Neighbour { t_max: ray.t_max, time: 0.0, flags: 0, cull_mask: 1, ..neighbour };
        least.neighbours = vec![alike; 7];
        let down = minimizer.best.neighbours.iter().position(|neighbour| neighbour.direction[2] < 0.0);
        least.neighbours[down.expect("one goes down")].direction = [0.0, 0.0, -1.0];
        assert_eq!(minimizer.best, least);
    }

    #[test]
    fn an_instance_keeps_only_what_matters() {
        let keys = [[[0.1; 4]; 3], [[0.2; 4]; 3]];
        let mut case = StressCase::new(vec![], Ray::new([0.0; 3], [1.0; 3]).into());
        let whole = Placement { mask: 3, flags: 2, ..Placement::new(Some([[0.7; 4]; 3]), None) };
        case.others = vec![Placement { motion: Some(MotionKeys::Matrix(keys)), ..whole.clone() }; 3];
        case.shapes = vec![Shape::MovingTriangle([[[1.0; 3]; 3], [[2.0; 3]; 3]]); 2];
        // A second key, and flags.
        let fails = |case: &StressCase| {
            let moves = |other: &Placement| other.motion.is_some() && other.flags == 2;
            case.others.iter().any(moves).then(|| Failure("it fails".to_owned()))
        };
        let mut minimizer = Minimizer { best: case, failure: Failure(String::new()), fails };
        minimizer.shorten(0, |case| &mut case.others);
        minimizer.simplify();
        let still = MotionKeys::Matrix([keys[0]; 2]);
        assert_eq!(minimizer.best.others, [Placement { transform: None, motion: Some(still), ..whole }]);
        assert_eq!(minimizer.best.shapes, [Shape::Triangle([[1.0; 3]; 3]); 2]);
    }
}
