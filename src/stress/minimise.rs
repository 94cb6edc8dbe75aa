//! Minimises a failing case: fewer primitives, instances and rays, no motion, short numbers.

use crate::geometry::Precision;
use crate::stress::case::{Moves, Placement, Shape, StressCase};
use crate::stress::judge::{Failure, check_caught};

/// A case that fails, no larger than the given one in any respect, and how it fails. Tries each
/// change in turn and keeps it if the case still fails (in whatever way), until none helps.
///
/// # Panics
/// Where the given case does not fail.
pub fn minimise(case: &StressCase, precision: Precision) -> (StressCase, Failure) {
    let fails = |case: &StressCase| check_caught(case, precision).err();
    let failure = fails(case).expect("bug in anyhit: a case that does not fail is made smaller");
    let mut search = Search { best: case.clone(), failure, fails };
    // Each kept change makes the case smaller, so that this ends; the bound limits the time.
    for _ in 0..8 {
        let before = search.best.clone();
        search.shorten(0, |case| &mut case.neighbours);
        search.shorten(0, |case| &mut case.others);
        search.shorten(1, |case| &mut case.shapes);
        search.simplify();
        search.equalise();
        let count = search.best.numbers().len();
        for place in 0..count {
            for simpler in simpler(*search.best.numbers()[place]) {
                if search.keeps(|case| *case.numbers()[place] = simpler) {
                    break;
                }
            }
        }
        if search.best == before {
            break;
        }
    }
    (search.best, search.failure)
}

/// The smallest failing case so far.
struct Search<F> {
    best: StressCase,
    failure: Failure,
    fails: F,
}

impl<F: Fn(&StressCase) -> Option<Failure>> Search<F> {
    /// Keeps a change if the case still fails; returns whether it does, and the case differs.
    fn keeps(&mut self, change: impl FnOnce(&mut StressCase)) -> bool {
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

    /// Leaves out elements of a list, down to `least`: half of it at once, then quarters, then
    /// single ones.
    fn shorten<T>(&mut self, least: usize, list: fn(&mut StressCase) -> &mut Vec<T>) {
        let mut many = list(&mut self.best).len();
        while many > 0 {
            let mut first = 0;
            loop {
                let count = list(&mut self.best).len();
                if first >= count {
                    break;
                }
                let end = count.min(first + many);
                if count - (end - first) < least || !self.keeps(|case| drop(list(case).drain(first..end))) {
                    first = end;
                }
            }
            many /= 2;
        }
    }

    /// Replaces special properties of the case by their defaults.
    fn simplify(&mut self) {
        self.keeps(|case| case.transform = None);
        self.keeps(|case| case.motion = None);
        self.keeps(|case| case.flags = 0);
        self.keeps(|case| case.hidden = 0);
        let key_of = |motion: &mut Option<Moves>| match motion {
            Some(Moves::Matrix([first, second])) => *second = *first,
            Some(Moves::Srt([first, second])) => *second = *first,
            None => {}
        };
        self.keeps(|case| key_of(&mut case.motion));
        for at in 0..self.best.others.len() {
            self.keeps(|case| case.others[at].transform = None);
            self.keeps(|case| case.others[at].motion = None);
            self.keeps(|case| key_of(&mut case.others[at].motion));
            self.keeps(|case| {
                let Placement { transform, motion, .. } = case.others[at];
                case.others[at] = Placement::new(transform, motion);
            });
        }
        for at in 0..self.best.shapes.len() {
            self.keeps(|case| {
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
            self.keeps(|case| {
                (case.neighbours[at].origin, case.neighbours[at].direction) = (origin, direction)
            });
            self.keeps(|case| case.neighbours[at].origin = origin);
            self.keeps(|case| case.neighbours[at].direction = direction);
            self.keeps(|case| (case.neighbours[at].t_min, case.neighbours[at].t_max) = (t_min, t_max));
            self.keeps(|case| {
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
    use crate::geometry::Ray;
    use crate::stress::case::Neighbour;

    #[test]
    fn all_that_a_failure_does_not_need_goes() {
        let ray = Ray::new([3.25, 0.0, 0.0], [0.1, 0.2, 0.3]);
        let ball = |k: usize| Shape::Sphere { center: [k as f32, 0.3, 0.0], radius: 1.0 };
        let mut case = StressCase::new((0..77).map(ball).collect(), (ray, Some([[0.5; 4]; 3])));
        let Ray { origin, direction, t_min, .. } = ray;
        let neighbour =
            Neighbour { origin, direction, t_min, t_max: 7.0, time: 0.5, flags: 16, cull_mask: 3 };
        case.neighbours = vec![neighbour; 63];
        case.neighbours[40].direction = [0.0, 0.0, -1.0];
        let motion = Moves::Matrix([[[0.1; 4]; 3], [[0.2; 4]; 3]]);
        case.others = vec![Placement::new(Some([[0.7; 4]; 3]), Some(motion)); 9];
        // Eight rays, of which one points down, and a sphere for that.
        let fails = |case: &StressCase| {
            let has_ball = case.shapes.iter().any(|shape| *shape == ball(40));
            let goes_down = case.neighbours.iter().any(|neighbour| neighbour.direction[2] < 0.0);
            (has_ball && goes_down && case.neighbours.len() >= 7).then(|| Failure("it fails".to_owned()))
        };
        let failure = Failure(String::new());
        let mut search = Search { best: case, failure, fails };
        search.shorten(0, |case| &mut case.neighbours);
        search.shorten(0, |case| &mut case.others);
        search.shorten(1, |case| &mut case.shapes);
        search.simplify();
        search.equalise();
        let mut least = StressCase { hidden: 0, ..StressCase::new(vec![ball(40)], (ray, None)) };
        let alike = Neighbour { t_max: ray.t_max, time: 0.0, flags: 0, cull_mask: 1, ..neighbour };
        least.neighbours = vec![alike; 7];
        let down = search.best.neighbours.iter().position(|neighbour| neighbour.direction[2] < 0.0);
        least.neighbours[down.expect("one goes down")].direction = [0.0, 0.0, -1.0];
        assert_eq!(search.best, least);
    }

    #[test]
    fn an_instance_keeps_what_matters_alone() {
        let keys = [[[0.1; 4]; 3], [[0.2; 4]; 3]];
        let mut case = StressCase::new(vec![], (Ray::new([0.0; 3], [1.0; 3]), None));
        let whole = Placement { mask: 3, flags: 2, ..Placement::new(Some([[0.7; 4]; 3]), None) };
        case.others = vec![Placement { motion: Some(Moves::Matrix(keys)), ..whole.clone() }; 3];
        case.shapes = vec![Shape::MovingTriangle([[[1.0; 3]; 3], [[2.0; 3]; 3]]); 2];
        // A second key, and flags.
        let fails = |case: &StressCase| {
            let moves = |other: &Placement| other.motion.is_some() && other.flags == 2;
            case.others.iter().any(moves).then(|| Failure("it fails".to_owned()))
        };
        let mut search = Search { best: case, failure: Failure(String::new()), fails };
        search.shorten(0, |case| &mut case.others);
        search.simplify();
        let still = Moves::Matrix([keys[0]; 2]);
        assert_eq!(search.best.others, [Placement { transform: None, motion: Some(still), ..whole }]);
        assert_eq!(search.best.shapes, [Shape::Triangle([[1.0; 3]; 3]); 2]);
    }
}
