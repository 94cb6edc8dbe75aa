//! Makes a failing case small: fewer primitives, instances and rays, nothing that moves, short numbers.

use crate::geometry::Precision;
use crate::stress::case::{Case, Moves, Placement, Shape};
use crate::stress::judge::{Failure, check_caught};

/// A case that fails, no greater than the given one in any respect, and how it fails. Tries each
/// change in turn and keeps it where the case still fails (in whatever way), until none helps.
///
/// # Panics
/// Where the given case does not fail.
pub fn minimise(case: &Case, precision: Precision) -> (Case, Failure) {
    let fails = |case: &Case| check_caught(case, precision).err();
    let failure = fails(case).expect("bug in anyhit: a case that does not fail is made smaller");
    let mut search = Search { best: case.clone(), failure, fails };
    // A change that is kept makes the case smaller, so that this ends; the bound is for time.
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

/// The least case so far that fails.
struct Search<F> {
    best: Case,
    failure: Failure,
    fails: F,
}

impl<F: Fn(&Case) -> Option<Failure>> Search<F> {
    /// Makes a change where the case still fails; says whether it does, and is another one.
    fn keeps(&mut self, change: impl FnOnce(&mut Case)) -> bool {
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

    /// Leaves out elements of a list, down to `least`: half of it at once, then quarters, then single ones.
    fn shorten<T>(&mut self, least: usize, list: fn(&mut Case) -> &mut Vec<T>) {
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

    /// What is special about the case becomes what it is in others.
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

    /// Neighbours become the ray of the case, or at least start, head, and end as it does.
    fn equalise(&mut self) {
        for at in 0..self.best.neighbours.len() {
            let Case { origin, direction, t_min, t_max, time, flags, .. } = self.best;
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

/// Shorter numbers that could stand for one, the shortest first.
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
