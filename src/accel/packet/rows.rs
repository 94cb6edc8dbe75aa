//! The rays of a packet side by side (structure of arrays).

use crate::accel::cursor::TraceRay;
use crate::accel::node::Node;
use crate::accel::node_ray::{FAR_AWAY, NodeRay, ROUGH_SCALES, SHRINK, SIMPLE_SCALES, WIDEN};
use crate::accel::packet::MAX_RAYS;
use crate::geometry::{ROUGH_SLACK, ROUGH_UNDERFLOW, Ray, Transform};
use crate::math::eight::Eights;

/// How many rays are operated on at once.
const EIGHT: usize = 8;

/// A number of each ray.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Row(pub [f32; MAX_RAYS]);

impl Row {
    /// Memory for numbers.
    pub const IDLE: Self = Self([0.0; MAX_RAYS]);

    /// The numbers of eight rays.
    #[inline(always)]
    fn load<E: Eights>(&self, eights: E, at: usize) -> E::Eight {
        eights.load(&self.0.as_chunks().0[at % (MAX_RAYS / EIGHT)])
    }

    #[inline(always)]
    fn store<E: Eights>(&mut self, eights: E, at: usize, numbers: E::Eight) {
        self.0.as_chunks_mut().0[at % (MAX_RAYS / EIGHT)] = eights.lanes(numbers);
    }

    /// The greatest of the numbers in all eights in which some rays lie.
    #[inline(always)]
    pub fn greatest<E: Eights>(&self, eights: E, rays: u64) -> f32 {
        let mut all = eights.splat(f32::NEG_INFINITY);
        for at in eights_of(rays) {
            all = eights.if_above(self.load(eights, at), all);
        }
        extreme::<E, true>(eights, all)
    }
}

/// Rays in world space.
#[derive(Clone, Debug)]
pub struct Rays {
    origin: [Row; 3],
    direction: [Row; 3],
    /// Not -0.
    t_min: Row,
}

impl Rays {
    /// Memory for rays.
    pub const IDLE: Self = Self { origin: [Row::IDLE; 3], direction: [Row::IDLE; 3], t_min: Row::IDLE };

    /// Takes up to 64 rays; a bit for each that [is ordinary](Ray::is_ordinary) and whose
    /// t is never negative.
    #[inline(always)]
    pub fn take<E: Eights>(&mut self, eights: E, traces: &[TraceRay]) -> u64 {
        let mut valid = 0;
        let (whole, first) = (traces.len().next_multiple_of(EIGHT).min(MAX_RAYS), traces[0]);
        for at in 0..whole {
            // Beyond the end stands the first once more.
            let ray = traces.get(at).unwrap_or(&first).ray;
            for axis in 0..3 {
                self.origin[axis].0[at] = ray.origin[axis];
                self.direction[axis].0[at] = ray.direction[axis];
            }
            self.t_min.0[at] = ray.t_min + 0.0;
            valid |= u64::from((ray.t_min >= 0.0) & !ray.t_max.is_nan()) << at;
        }
        let (least, most) = (eights.splat(Ray::LEAST), eights.splat(Ray::MOST));
        let zero = eights.splat(0.0);
        let mut ordinary = 0;
        for at in 0..whole / EIGHT {
            let (mut within, mut still) = (0xFF, 0xFF);
            for axis in 0..3 {
                let (origin, direction) = (&self.origin[axis], &self.direction[axis]);
                let origin = eights.abs(origin.load(eights, at));
                let direction = eights.abs(direction.load(eights, at));
                within &= eights.at_least(origin, least) | eights.at_least(zero, origin);
                within &= eights.at_least(most, origin);
                let no_way = eights.at_least(zero, direction);
                within &= eights.at_least(direction, least) | no_way;
                within &= eights.at_least(most, direction);
                still &= no_way;
            }
            ordinary |= u64::from(within & !still) << (at * EIGHT);
        }
        let given = u64::MAX >> (MAX_RAYS - traces.len().min(MAX_RAYS));
        ordinary & valid & given
    }
}

/// Rays as the boxes of one tree see them: the numbers of [`NodeRay`]s that count t from 0.
#[derive(Clone, Debug)]
pub struct Rows {
    near_origin: [Row; 3],
    far_origin: [Row; 3],
    near_reciprocal: [Row; 3],
    far_reciprocal: [Row; 3],
    /// Per axis a bit for each ray that enters upper planes first.
    downwards: [u64; 3],
}

/// Rays of a packet that enter the same planes first.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// A bit for each.
    pub rays: u64,
    /// Per axis which plane is entered first: 0 the lower, 1 the upper.
    pub near_side: [usize; 3],
}

impl Rows {
    /// Memory for rays.
    pub const IDLE: Self = Self {
        near_origin: [Row::IDLE; 3],
        far_origin: [Row::IDLE; 3],
        near_reciprocal: [Row::IDLE; 3],
        far_reciprocal: [Row::IDLE; 3],
        downwards: [0; 3],
    };

    /// Takes ordinary rays into a tree in world space ([`NodeRay::set_simple`]); a bit for each that starts
    /// near it.
    #[inline(always)]
    pub fn take_simple<E: Eights>(&mut self, eights: E, rays: &Rays, scale: f64, which: u64) -> u64 {
        let scale = scale as f32;
        if !SIMPLE_SCALES.contains(&scale) {
            return 0;
        }
        let scale = eights.splat(scale);
        let mut fit = 0;
        self.downwards = [0; 3];
        for at in eights_of(which) {
            let mut near_by = 0xFF;
            for axis in 0..3 {
                let origin = eights.mul(rays.origin[axis].load(eights, at), scale);
                near_by &= eights.at_least(eights.splat(FAR_AWAY as f32), eights.abs(origin));
                // A direction of -0 counts as upwards, like 0: both have an infinite reciprocal.
                let direction = eights.add(rays.direction[axis].load(eights, at), eights.splat(0.0));
                let reciprocal = eights.div(eights.splat(1.0), eights.mul(direction, scale));
                self.downwards[axis] |= below_zero(eights, direction, at);
                self.near_origin[axis].store(eights, at, origin);
                self.far_origin[axis].store(eights, at, origin);
                let near = eights.mul(reciprocal, eights.splat(SHRINK as f32));
                let far = eights.mul(reciprocal, eights.splat(WIDEN as f32));
                self.near_reciprocal[axis].store(eights, at, near);
                self.far_reciprocal[axis].store(eights, at, far);
            }
            fit |= u64::from(near_by) << (at * EIGHT);
        }
        fit & which
    }

    /// Takes ordinary rays into an instance's tree ([`Transform::rough`], [`NodeRay::set_rough`]); a bit for
    /// each that starts near it and whose direction is known well.
    #[inline(always)]
    pub fn take_rough<E: Eights>(
        &mut self,
        eights: E,
        rays: &Rays,
        transform: &Transform,
        scale: f64,
        which: u64,
    ) -> u64 {
        let scale = scale as f32;
        let Some((columns, translation)) = transform.rough_inverse() else { return 0 };
        if !ROUGH_SCALES.contains(&scale) {
            return 0;
        }
        let (one, scale) = (eights.splat(1.0), eights.splat(scale));
        let rows = [0, 1, 2].map(|axis| columns.map(|column| column[axis]));
        let mut fit = 0;
        self.downwards = [0; 3];
        for at in eights_of(which) {
            let (mut offset, mut along) = ([one; 3], [one; 3]);
            for k in 0..3 {
                offset[k] = eights.sub(rays.origin[k].load(eights, at), eights.splat(translation[k]));
                along[k] = rays.direction[k].load(eights, at);
            }
            let mut fits = 0xFF;
            for (axis, row) in rows.into_iter().enumerate() {
                let (origin, origin_error) = rough_component(eights, row, offset);
                let (direction, direction_error) = rough_component(eights, row, along);
                let origin_error = eights.add(origin_error, eights.splat(ROUGH_UNDERFLOW));
                let origin = eights.mul(origin, scale);
                let size = eights.abs(direction);
                fits &= eights.at_least(eights.splat(FAR_AWAY as f32), eights.abs(origin));
                fits &= eights.at_least(size, eights.mul(direction_error, eights.splat(4.0)));
                let direction = eights.add(direction, eights.splat(0.0));
                let sign = eights.sign(direction);
                self.downwards[axis] |= below_zero(eights, direction, at);
                // Outwards on both sides, whichever comes first.
                let slack = eights.mul(eights.mul(origin_error, scale), sign);
                let slow = eights.div(one, eights.mul(eights.add(size, direction_error), scale));
                let fast = eights.div(one, eights.mul(eights.sub(size, direction_error), scale));
                let near = eights.mul(eights.mul(slow, eights.splat(SHRINK as f32)), sign);
                let far = eights.mul(eights.mul(fast, eights.splat(WIDEN as f32)), sign);
                self.near_origin[axis].store(eights, at, eights.add(origin, slack));
                self.far_origin[axis].store(eights, at, eights.sub(origin, slack));
                self.near_reciprocal[axis].store(eights, at, near);
                self.far_reciprocal[axis].store(eights, at, far);
            }
            fit |= u64::from(fits) << (at * EIGHT);
        }
        fit & which
    }

    /// Those of some rays, at least one, that enter the same planes first as the first of them.
    #[inline(always)]
    pub fn first_group(&self, rays: u64) -> Group {
        let first = rays & rays.wrapping_neg();
        let mut group = Group { rays, near_side: [0; 3] };
        for axis in 0..3 {
            let downwards = self.downwards[axis];
            group.near_side[axis] = usize::from(downwards & first != 0);
            group.rays &= if downwards & first != 0 { downwards } else { !downwards };
        }
        group
    }

    /// A ray of intervals that meets every box that one of a group meets.
    ///
    /// Let them go upwards on an axis. With the greatest near origin and the least near reciprocal,
    /// `(low - o) / d` is the least of all where it is positive, and where it is not it does not count:
    /// no t is negative. `(high - o) / d` is the greatest with the least far origin and the greatest
    /// far reciprocal where it is not negative, and where it is every ray misses. The rest is
    /// mirrored.
    #[inline(always)]
    pub fn around<E: Eights>(&self, eights: E, rays: &Rays, group: &Group) -> NodeRay {
        // What is added to it does not count: neither extreme takes a NaN.
        let mut members = Row([f32::NAN; MAX_RAYS]);
        for (at, member) in members.0.iter_mut().enumerate() {
            if group.rays >> at & 1 != 0 {
                *member = 0.0;
            }
        }
        let members = (&members, group.rays);
        let mut ray = NodeRay::from(extreme_of::<E, false>(eights, &rays.t_min, members));
        ray.near_side = group.near_side;
        for axis in 0..3 {
            let (near, far) = (&self.near_origin[axis], &self.far_origin[axis]);
            let (slow, fast) = (&self.near_reciprocal[axis], &self.far_reciprocal[axis]);
            if group.near_side[axis] == 0 {
                ray.near_origin[axis] = extreme_of::<E, true>(eights, near, members);
                ray.far_origin[axis] = extreme_of::<E, false>(eights, far, members);
                ray.near_reciprocal[axis] = extreme_of::<E, false>(eights, slow, members);
                ray.far_reciprocal[axis] = extreme_of::<E, true>(eights, fast, members);
            } else {
                ray.near_origin[axis] = extreme_of::<E, false>(eights, near, members);
                ray.far_origin[axis] = extreme_of::<E, true>(eights, far, members);
                ray.near_reciprocal[axis] = extreme_of::<E, true>(eights, slow, members);
                ray.far_reciprocal[axis] = extreme_of::<E, false>(eights, fast, members);
            }
        }
        ray
    }

    /// One ray of a group.
    #[inline(always)]
    pub fn single(&self, rays: &Rays, at: usize, group: &Group) -> NodeRay {
        let mut ray = NodeRay::from(rays.t_min.0[at]);
        ray.near_side = group.near_side;
        for axis in 0..3 {
            ray.near_origin[axis] = self.near_origin[axis].0[at];
            ray.far_origin[axis] = self.far_origin[axis].0[at];
            ray.near_reciprocal[axis] = self.near_reciprocal[axis].0[at];
            ray.far_reciprocal[axis] = self.far_reciprocal[axis].0[at];
        }
        ray
    }

    /// A bit for each ray of a group that does not surely miss the box of a node's child before its limit:
    /// for each the test of [`Node::intersect`].
    #[inline(always)]
    pub fn met<E: Eights>(
        &self,
        eights: E,
        rays: &Rays,
        group: &Group,
        (node, slot): (&Node, usize),
        limits: &Row,
    ) -> u64 {
        let mut planes = [[eights.splat(0.0); 2]; 3];
        for (axis, planes) in planes.iter_mut().enumerate() {
            let side = group.near_side[axis] & 1;
            *planes =
                [eights.splat(node.plane(axis, side, slot)), eights.splat(node.plane(axis, side ^ 1, slot))];
        }
        let mut met = 0;
        for at in eights_of(group.rays) {
            let mut near = rays.t_min.load(eights, at);
            let mut far = limits.load(eights, at);
            for (axis, [first, last]) in planes.into_iter().enumerate() {
                let enter = eights.sub(first, self.near_origin[axis].load(eights, at));
                let leave = eights.sub(last, self.far_origin[axis].load(eights, at));
                let slow = self.near_reciprocal[axis].load(eights, at);
                let fast = self.far_reciprocal[axis].load(eights, at);
                near = eights.if_above(eights.mul(enter, slow), near);
                far = eights.if_below(eights.mul(leave, fast), far);
            }
            met |= u64::from(eights.at_least(far, near)) << (at * EIGHT);
        }
        met & group.rays
    }
}

/// A component of a rough ray, and the bound of its error.
#[inline(always)]
fn rough_component<E: Eights>(eights: E, row: [f32; 3], v: [E::Eight; 3]) -> (E::Eight, E::Eight) {
    let x = eights.mul(eights.splat(row[0]), v[0]);
    let y = eights.mul(eights.splat(row[1]), v[1]);
    let z = eights.mul(eights.splat(row[2]), v[2]);
    let sizes = eights.add(eights.add(eights.abs(x), eights.abs(y)), eights.abs(z));
    (eights.add(eights.add(x, y), z), eights.mul(sizes, eights.splat(ROUGH_SLACK)))
}

/// A bit for each ray of an eight whose number is below 0.
#[inline(always)]
fn below_zero<E: Eights>(eights: E, numbers: E::Eight, at: usize) -> u64 {
    u64::from(!eights.at_least(numbers, eights.splat(0.0)) & 0xFF) << (at * EIGHT)
}

/// The greatest or the least of a row's numbers; a row and a bit say which count.
#[inline(always)]
fn extreme_of<E: Eights, const GREATEST: bool>(eights: E, row: &Row, (members, rays): (&Row, u64)) -> f32 {
    let mut all = eights.splat(if GREATEST { f32::NEG_INFINITY } else { f32::INFINITY });
    for at in eights_of(rays) {
        let next = eights.add(row.load(eights, at), members.load(eights, at));
        all = if GREATEST { eights.if_above(next, all) } else { eights.if_below(next, all) };
    }
    extreme::<E, GREATEST>(eights, all)
}

/// The greatest or the least of eight numbers.
#[inline(always)]
fn extreme<E: Eights, const GREATEST: bool>(eights: E, numbers: E::Eight) -> f32 {
    let lanes = eights.lanes(numbers);
    let beyond = |a: f32, b: f32| if (a > b) == GREATEST { a } else { b };
    let four = [0, 1, 2, 3].map(|at| beyond(lanes[at], lanes[at + 4]));
    beyond(beyond(four[0], four[2]), beyond(four[1], four[3]))
}

/// The eights in which some rays lie.
#[inline(always)]
fn eights_of(rays: u64) -> impl Iterator<Item = usize> {
    (0..MAX_RAYS / EIGHT).filter(move |at| rays >> (at * EIGHT) & 0xFF != 0)
}
