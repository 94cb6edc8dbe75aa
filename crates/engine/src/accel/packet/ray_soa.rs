//! The rays of a packet as a structure of arrays (SoA).

use crate::accel::node::Node;
use crate::accel::packet::MAX_RAYS;
use crate::accel::trace_ray::TraceRay;
use crate::accel::trav_ray::{APPROXIMATE_SCALES, TravRay};
use crate::accel::world_space_ray::{FAR_AWAY, SHRINK, WIDEN, WORLD_SPACE_SCALES};
use crate::geometry::{APPROXIMATE_ERROR, APPROXIMATE_UNDERFLOW, Ray, Transform};
use crate::math::array;
use crate::math::f32x8::F32x8Ops;

/// The number of rays that one SIMD register holds.
const RAYS_PER_REGISTER: usize = 8;

/// One number for each ray of a packet.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct PerRay(pub [f32; MAX_RAYS]);

impl PerRay {
    /// Placeholder value.
    pub(super) const EMPTY: Self = Self([0.0; MAX_RAYS]);

    /// Loads the numbers of the eight rays of group `at`.
    #[inline(always)]
    fn load<E: F32x8Ops>(&self, simd: E, at: usize) -> E::F32x8 {
        simd.load(&self.0.as_chunks().0[at % (MAX_RAYS / RAYS_PER_REGISTER)])
    }

    #[inline(always)]
    fn store<E: F32x8Ops>(&mut self, simd: E, at: usize, numbers: E::F32x8) {
        self.0.as_chunks_mut().0[at % (MAX_RAYS / RAYS_PER_REGISTER)] = simd.to_array(numbers);
    }

    /// The maximum over all groups of eight that hold one of the given rays.
    #[inline(always)]
    pub(super) fn max_over<E: F32x8Ops>(&self, simd: E, rays: u64) -> f32 {
        let mut all = simd.splat(f32::NEG_INFINITY);
        for at in groups_of_eight(rays) {
            all = simd.max(self.load(simd, at), all);
        }
        min_or_max::<E, true>(simd, all)
    }
}

/// The rays of a packet in world space.
#[derive(Clone, Debug)]
pub(super) struct WorldRays {
    origin: [PerRay; 3],
    direction: [PerRay; 3],
    /// The least t; not -0.
    t_min: PerRay,
}

impl WorldRays {
    /// Placeholder value.
    pub(super) const EMPTY: Self =
        Self { origin: [PerRay::EMPTY; 3], direction: [PerRay::EMPTY; 3], t_min: PerRay::EMPTY };

    /// Takes up to 64 rays; returns a mask of those that [are well scaled](Ray::is_well_scaled) and
    /// whose t is never negative.
    #[inline(always)]
    pub(super) fn take<E: F32x8Ops>(&mut self, simd: E, traces: &[TraceRay]) -> u64 {
        let mut valid = 0;
        let (whole, first) = (traces.len().next_multiple_of(RAYS_PER_REGISTER).min(MAX_RAYS), traces[0]);
        for at in 0..whole {
            // Pad with the first ray.
            let ray = traces.get(at).unwrap_or(&first).ray;
            for axis in 0..3 {
                self.origin[axis].0[at] = ray.origin[axis];
                self.direction[axis].0[at] = ray.direction[axis];
            }
            self.t_min.0[at] = ray.t_min + 0.0;
            valid |= u64::from((ray.t_min >= 0.0) & !ray.t_max.is_nan()) << at;
        }
        let (least, most) = (simd.splat(Ray::MIN_MAGNITUDE), simd.splat(Ray::MAX_MAGNITUDE));
        let zero = simd.splat(0.0);
        let mut well_scaled = 0;
        for at in 0..whole / RAYS_PER_REGISTER {
            let (mut within, mut all_zero) = (0xFF, 0xFF);
            for axis in 0..3 {
                let (origin, direction) = (&self.origin[axis], &self.direction[axis]);
                let origin = simd.abs(origin.load(simd, at));
                let direction = simd.abs(direction.load(simd, at));
                within &= simd.cmp_ge(origin, least) | simd.cmp_ge(zero, origin);
                within &= simd.cmp_ge(most, origin);
                let is_zero = simd.cmp_ge(zero, direction);
                within &= simd.cmp_ge(direction, least) | is_zero;
                within &= simd.cmp_ge(most, direction);
                all_zero &= is_zero;
            }
            well_scaled |= u64::from(within & !all_zero) << (at * RAYS_PER_REGISTER);
        }
        let given = u64::MAX >> (MAX_RAYS - traces.len().min(MAX_RAYS));
        well_scaled & valid & given
    }

    /// Lets a ray pass boxes that it leaves before it comes to hits of a rounded t.
    ///
    /// The exact t of such a hit is greater than the number before the rounded one, and a box that
    /// holds the hit is left behind it.
    #[inline]
    pub(super) fn skip_boxes_before(&mut self, at: usize, t: f32) {
        self.t_min.0[at] = self.t_min.0[at].max(t.next_down());
    }
}

/// The rays of a packet prepared for the nodes of one tree: the fields of [`TravRay`]s without t
/// shift.
#[derive(Clone, Debug)]
pub(super) struct RaySoA {
    near_origin: [PerRay; 3],
    far_origin: [PerRay; 3],
    near_reciprocal: [PerRay; 3],
    far_reciprocal: [PerRay; 3],
    /// For each axis a mask of the rays that enter upper planes first.
    downwards: [u64; 3],
}

/// Rays of a packet whose directions have the same signs.
#[derive(Clone, Copy, Debug)]
pub(super) struct OctantGroup {
    /// A mask of the rays.
    pub rays: u64,
    /// For each axis the plane that is entered first: 0 the lower, 1 the upper.
    pub near_side: [usize; 3],
}

impl RaySoA {
    /// Placeholder value.
    pub(super) const EMPTY: Self = Self {
        near_origin: [PerRay::EMPTY; 3],
        far_origin: [PerRay::EMPTY; 3],
        near_reciprocal: [PerRay::EMPTY; 3],
        far_reciprocal: [PerRay::EMPTY; 3],
        downwards: [0; 3],
    };

    /// Prepares well-scaled rays for a tree in world space ([`TravRay::set_world_space`]); returns
    /// a mask of those that start near it.
    #[inline(always)]
    pub(super) fn take_world_space<E: F32x8Ops>(
        &mut self,
        simd: E,
        rays: &WorldRays,
        scale: f64,
        mask: u64,
    ) -> u64 {
        let scale = scale as f32;
        if !WORLD_SPACE_SCALES.contains(&scale) {
            return 0;
        }
        let scale = simd.splat(scale);
        let mut prepared = 0;
        self.downwards = [0; 3];
        for at in groups_of_eight(mask) {
            let mut near_by = 0xFF;
            for axis in 0..3 {
                let origin = simd.mul(rays.origin[axis].load(simd, at), scale);
                near_by &= simd.cmp_ge(simd.splat(FAR_AWAY as f32), simd.abs(origin));
                // A direction of -0 counts as upwards, like 0: both have an infinite reciprocal.
                let direction = simd.add(rays.direction[axis].load(simd, at), simd.splat(0.0));
                let reciprocal = simd.div(simd.splat(1.0), simd.mul(direction, scale));
                self.downwards[axis] |= below_zero(simd, direction, at);
                self.near_origin[axis].store(simd, at, origin);
                self.far_origin[axis].store(simd, at, origin);
                let near = simd.mul(reciprocal, simd.splat(SHRINK as f32));
                let far = simd.mul(reciprocal, simd.splat(WIDEN as f32));
                self.near_reciprocal[axis].store(simd, at, near);
                self.far_reciprocal[axis].store(simd, at, far);
            }
            prepared |= u64::from(near_by) << (at * RAYS_PER_REGISTER);
        }
        prepared & mask
    }

    /// Prepares well-scaled rays for the tree of an instance ([`Transform::approximate`],
    /// [`TravRay::set_approximate`]); returns a mask of those that start near it and whose
    /// direction has a small error.
    #[inline(always)]
    pub(super) fn take_approximate<E: F32x8Ops>(
        &mut self,
        simd: E,
        rays: &WorldRays,
        transform: &Transform,
        scale: f64,
        mask: u64,
    ) -> u64 {
        let scale = scale as f32;
        let Some((columns, translation)) = transform.approximate_inverse() else { return 0 };
        if !APPROXIMATE_SCALES.contains(&scale) {
            return 0;
        }
        let (one, scale) = (simd.splat(1.0), simd.splat(scale));
        let rows = array::map([0, 1, 2], |axis| array::map(columns, |column| column[axis]));
        let mut prepared = 0;
        self.downwards = [0; 3];
        for at in groups_of_eight(mask) {
            let (mut offset, mut along) = ([one; 3], [one; 3]);
            for k in 0..3 {
                offset[k] = simd.sub(rays.origin[k].load(simd, at), simd.splat(translation[k]));
                along[k] = rays.direction[k].load(simd, at);
            }
            let mut supported = 0xFF;
            for (axis, row) in rows.into_iter().enumerate() {
                let (origin, origin_error) = approximate_component(simd, row, offset);
                let (direction, direction_error) = approximate_component(simd, row, along);
                let origin_error = simd.add(origin_error, simd.splat(APPROXIMATE_UNDERFLOW));
                let origin = simd.mul(origin, scale);
                let size = simd.abs(direction);
                supported &= simd.cmp_ge(simd.splat(FAR_AWAY as f32), simd.abs(origin));
                supported &= simd.cmp_ge(size, simd.mul(direction_error, simd.splat(4.0)));
                let direction = simd.add(direction, simd.splat(0.0));
                let sign = simd.signum(direction);
                self.downwards[axis] |= below_zero(simd, direction, at);
                // Widen the slab on both sides.
                let slack = simd.mul(simd.mul(origin_error, scale), sign);
                let near_reciprocal = simd.div(one, simd.mul(simd.add(size, direction_error), scale));
                let far_reciprocal = simd.div(one, simd.mul(simd.sub(size, direction_error), scale));
                let near = simd.mul(simd.mul(near_reciprocal, simd.splat(SHRINK as f32)), sign);
                let far = simd.mul(simd.mul(far_reciprocal, simd.splat(WIDEN as f32)), sign);
                self.near_origin[axis].store(simd, at, simd.add(origin, slack));
                self.far_origin[axis].store(simd, at, simd.sub(origin, slack));
                self.near_reciprocal[axis].store(simd, at, near);
                self.far_reciprocal[axis].store(simd, at, far);
            }
            prepared |= u64::from(supported) << (at * RAYS_PER_REGISTER);
        }
        prepared & mask
    }

    /// The group of those of some rays, at least one, whose direction signs are those of the first.
    #[inline(always)]
    pub(super) fn first_group(&self, rays: u64) -> OctantGroup {
        let first = rays & rays.wrapping_neg();
        let mut group = OctantGroup { rays, near_side: [0; 3] };
        for axis in 0..3 {
            let downwards = self.downwards[axis];
            group.near_side[axis] = usize::from(downwards & first != 0);
            group.rays &= if downwards & first != 0 { downwards } else { !downwards };
        }
        group
    }

    /// The frustum of a group by interval arithmetic: a ray that hits every box that one of them
    /// hits.
    ///
    /// Let the directions on an axis be positive. The greatest near origin and the least near
    /// reciprocal give the least `(low - o) / d` if that is positive; if not it does not matter, as
    /// t is not negative. The least far origin and the greatest far reciprocal give the greatest
    /// `(high - o) / d` if that is not negative; if it is every ray misses. Negative directions are
    /// mirrored.
    #[inline(always)]
    pub(super) fn frustum<E: F32x8Ops>(&self, simd: E, rays: &WorldRays, group: &OctantGroup) -> TravRay {
        let members = GroupMembers::of(group);
        let mut ray = TravRay::with_t_min(members.min(simd, &rays.t_min));
        ray.near_side = group.near_side;
        for axis in 0..3 {
            let (near, far) = (&self.near_origin[axis], &self.far_origin[axis]);
            let (near_reciprocal, far_reciprocal) = (&self.near_reciprocal[axis], &self.far_reciprocal[axis]);
            if group.near_side[axis] == 0 {
                ray.near_origin[axis] = members.max(simd, near);
                ray.far_origin[axis] = members.min(simd, far);
                ray.negated_near_reciprocal[axis] = -members.min(simd, near_reciprocal);
                ray.negated_far_reciprocal[axis] = -members.max(simd, far_reciprocal);
            } else {
                ray.near_origin[axis] = members.min(simd, near);
                ray.far_origin[axis] = members.max(simd, far);
                ray.negated_near_reciprocal[axis] = -members.max(simd, near_reciprocal);
                ray.negated_far_reciprocal[axis] = -members.min(simd, far_reciprocal);
            }
        }
        ray
    }

    /// A single ray of a group.
    #[inline(always)]
    pub(super) fn single(&self, rays: &WorldRays, at: usize, group: &OctantGroup) -> TravRay {
        let mut ray = TravRay::with_t_min(rays.t_min.0[at]);
        ray.near_side = group.near_side;
        for axis in 0..3 {
            ray.near_origin[axis] = self.near_origin[axis].0[at];
            ray.far_origin[axis] = self.far_origin[axis].0[at];
            ray.negated_near_reciprocal[axis] = -self.near_reciprocal[axis].0[at];
            ray.negated_far_reciprocal[axis] = -self.far_reciprocal[axis].0[at];
        }
        ray
    }

    /// A mask of the rays of a group that may hit the box of a child of a node up to their limits:
    /// the test of [`Node::intersect`] for each ray.
    #[inline(always)]
    pub(super) fn maybe_hit_mask<E: F32x8Ops>(
        &self,
        simd: E,
        rays: &WorldRays,
        group: &OctantGroup,
        node: &Node,
        slot: usize,
        limits: &PerRay,
    ) -> u64 {
        let mut planes = [[simd.splat(0.0); 2]; 3];
        for (axis, planes) in planes.iter_mut().enumerate() {
            let side = group.near_side[axis] & 1;
            *planes =
                [simd.splat(node.plane(axis, side, slot)), simd.splat(node.plane(axis, side ^ 1, slot))];
        }
        let mut maybe_hit = 0;
        for at in groups_of_eight(group.rays) {
            let mut near = rays.t_min.load(simd, at);
            let mut far = limits.load(simd, at);
            for (axis, [first, last]) in planes.into_iter().enumerate() {
                let enter = simd.sub(first, self.near_origin[axis].load(simd, at));
                let leave = simd.sub(last, self.far_origin[axis].load(simd, at));
                let near_reciprocal = self.near_reciprocal[axis].load(simd, at);
                let far_reciprocal = self.far_reciprocal[axis].load(simd, at);
                near = simd.max(simd.mul(enter, near_reciprocal), near);
                far = simd.min(simd.mul(leave, far_reciprocal), far);
            }
            maybe_hit |= u64::from(simd.cmp_ge(far, near)) << (at * RAYS_PER_REGISTER);
        }
        maybe_hit & group.rays
    }
}

/// A component of an approximate ray, and a bound of its error.
#[inline(always)]
fn approximate_component<E: F32x8Ops>(simd: E, row: [f32; 3], v: [E::F32x8; 3]) -> (E::F32x8, E::F32x8) {
    let x = simd.mul(simd.splat(row[0]), v[0]);
    let y = simd.mul(simd.splat(row[1]), v[1]);
    let z = simd.mul(simd.splat(row[2]), v[2]);
    let sizes = simd.add(simd.add(simd.abs(x), simd.abs(y)), simd.abs(z));
    (simd.add(simd.add(x, y), z), simd.mul(sizes, simd.splat(APPROXIMATE_ERROR)))
}

/// A mask of the rays of a group of eight whose number is below 0.
#[inline(always)]
fn below_zero<E: F32x8Ops>(simd: E, numbers: E::F32x8, at: usize) -> u64 {
    u64::from(!simd.cmp_ge(numbers, simd.splat(0.0)) & 0xFF) << (at * RAYS_PER_REGISTER)
}

/// The rays of a group, over which a number of each is minimised or maximised.
struct GroupMembers {
    /// 0 for each ray of the group and NaN for the others: minimum and maximum ignore a sum with
    /// NaN.
    addends: PerRay,
    /// A mask of the rays of the group.
    rays: u64,
}

impl GroupMembers {
    #[inline(always)]
    fn of(group: &OctantGroup) -> Self {
        let mut addends = PerRay([f32::NAN; MAX_RAYS]);
        for (at, addend) in addends.0.iter_mut().enumerate() {
            if group.rays >> at & 1 != 0 {
                *addend = 0.0;
            }
        }
        Self { addends, rays: group.rays }
    }

    /// The least of the numbers of the rays.
    #[inline(always)]
    fn min<E: F32x8Ops>(&self, simd: E, numbers: &PerRay) -> f32 {
        self.min_or_max::<E, false>(simd, numbers)
    }

    /// The greatest of the numbers of the rays.
    #[inline(always)]
    fn max<E: F32x8Ops>(&self, simd: E, numbers: &PerRay) -> f32 {
        self.min_or_max::<E, true>(simd, numbers)
    }

    #[inline(always)]
    fn min_or_max<E: F32x8Ops, const MAX: bool>(&self, simd: E, numbers: &PerRay) -> f32 {
        let mut all = simd.splat(if MAX { f32::NEG_INFINITY } else { f32::INFINITY });
        for at in groups_of_eight(self.rays) {
            let next = simd.add(numbers.load(simd, at), self.addends.load(simd, at));
            all = if MAX { simd.max(next, all) } else { simd.min(next, all) };
        }
        min_or_max::<E, MAX>(simd, all)
    }
}

/// The maximum or minimum of eight lanes.
#[inline(always)]
fn min_or_max<E: F32x8Ops, const MAX: bool>(simd: E, numbers: E::F32x8) -> f32 {
    let lanes = simd.to_array(numbers);
    let beyond = |a: f32, b: f32| if (a > b) == MAX { a } else { b };
    let four = array::map([0, 1, 2, 3], |at| beyond(lanes[at], lanes[at + 4]));
    beyond(beyond(four[0], four[2]), beyond(four[1], four[3]))
}

/// The groups of eight that hold one of the given rays.
#[inline(always)]
fn groups_of_eight(rays: u64) -> GroupsOfEight {
    // The highest bit of each byte that is not 0: the sum carries into it, or it is set itself.
    let low = u64::from_ne_bytes([0x7F; 8]);
    GroupsOfEight { marks: (((rays & low) + low) | rays) & !low }
}

/// What is left of [`groups_of_eight`]: a bit in the byte of each.
struct GroupsOfEight {
    marks: u64,
}

impl Iterator for GroupsOfEight {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let at = self.marks.trailing_zeros() as usize / RAYS_PER_REGISTER;
        self.marks &= self.marks.wrapping_sub(1);
        (at < MAX_RAYS / RAYS_PER_REGISTER).then_some(at)
    }
}
