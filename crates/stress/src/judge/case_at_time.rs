//! A case at one time: its instances and vertices are interpolated. The hits of a ray are found by
//! testing every primitive, without bounding boxes and BVHs.

use std::cell::OnceCell;
use std::cmp::Ordering;

use crate::case::{Placement, Shape, StressCase};
use crate::judge::primitive::{bounds, intersect};
use crate::judge::{Failure, fail};
use crate::obvhs_tree::ObvhsTree;
use crate::reference::motion::{is_between, is_transform};
use anyhit_base::sorted::sort_by;
use anyhit_engine::accel::motion::interpolate;
use anyhit_engine::accel::{InstanceFlags, RayFlags, TraceRay};
use anyhit_engine::geometry::{Intersection, ObjectRay, Precision, Ray, Surface, Transform};
use anyhit_engine::math::array;

type Matrix = [[f32; 4]; 3];

/// The primitives and instances of a case at a time.
pub(crate) struct CaseAtTime {
    pub time: f32,
    /// The shapes at the time, without motion.
    pub shapes: Vec<Shape>,
    pub instances: Vec<InstanceAtTime>,
    /// The tree of another builder over the shapes.
    tree: OnceCell<ObvhsTree>,
}

/// An instance at a time.
pub(crate) struct InstanceAtTime {
    placement: Placement,
    /// The interpolated matrix, if the instance moves and has one at the time.
    moved_matrix: Option<Matrix>,
    /// Object to world; without one it is the identity.
    pub matrix: Option<Matrix>,
    /// The transform, if there is a matrix and it has an inverse.
    transform: Option<Transform>,
}

/// A hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ExactHit {
    pub instance: usize,
    pub shape: usize,
    /// The intersection; its surface depends on the flags of the instance.
    pub found: Intersection,
}

impl CaseAtTime {
    /// Interpolates a case at a time from 0 to 1.
    pub(crate) fn new(case: &StressCase, time: f32) -> Self {
        let shapes = case.shapes.iter().map(|shape| match shape {
            Shape::MovingTriangle([first, second]) => {
                let number = |i: usize, j: usize| interpolate(first[i][j], second[i][j], time);
                Shape::Triangle(array::from_fn(|i| array::from_fn(|j| number(i, j))))
            }
            still => *still,
        });
        let instances = case.placements().into_iter().map(|placement| {
            let moved_matrix = placement.motion.and_then(|moves| moves.motion().at(time));
            let matrix = match placement.motion {
                None => placement.transform,
                // An instance without a matrix has no inverse either: the zero matrix has none.
                Some(_) => Some(moved_matrix.unwrap_or([[0.0; 4]; 3])),
            };
            let transform = matrix.as_ref().and_then(Transform::new);
            InstanceAtTime { placement, moved_matrix, matrix, transform }
        });
        Self { time, shapes: shapes.collect(), instances: instances.collect(), tree: OnceCell::new() }
    }

    /// Checks the matrix of an instance at the time.
    pub(crate) fn check_transform(&self, instance: usize) -> Result<(), Failure> {
        let InstanceAtTime { placement, moved_matrix, .. } = &self.instances[instance];
        let Some(moves) = &placement.motion else { return Ok(()) };
        if !is_transform(moves, self.time, moved_matrix.as_ref()) {
            return fail(format!("instance {instance} at {:e}: {moved_matrix:?} is wrong", self.time));
        }
        Ok(())
    }

    /// Checks a primitive at the time of the ray.
    pub(crate) fn check_shape(&self, case: &StressCase, shape: usize) -> Result<(), Failure> {
        let (Shape::MovingTriangle(keys), Shape::Triangle(found)) =
            (&case.shapes[shape], &self.shapes[shape])
        else {
            return Ok(());
        };
        let [first, second] = keys.map(|vertices| vertices.as_flattened().to_vec());
        let all = first.iter().zip(&second).zip(found.as_flattened());
        for ((&first, &second), &number) in all {
            if !is_between([first, second], self.time, number) {
                return fail(format!("primitive {shape} at {:e}: {number:e} is wrong", self.time));
            }
        }
        Ok(())
    }

    /// The ray in the object space of an instance.
    pub(crate) fn object_ray(&self, instance: usize, ray: &Ray) -> Option<ObjectRay> {
        let instance_at_time = &self.instances[instance];
        match instance_at_time.matrix {
            None => ObjectRay::in_world(ray),
            Some(_) => ObjectRay::in_instance(ray, instance_at_time.transform.as_ref()?),
        }
    }

    /// All hits of a ray of this time, in the order of their keys (t, instance, primitive).
    pub(crate) fn hits(&self, trace: &TraceRay, precision: Precision) -> Vec<ExactHit> {
        self.hits_among(trace, precision, |_, test| (0..self.shapes.len()).for_each(test))
    }

    /// Checks that the tree of another builder leads to the same hits: where it does not, a box is
    /// too small.
    pub(crate) fn check_tree(
        &self,
        trace: &TraceRay,
        precision: Precision,
        hits: &[ExactHit],
    ) -> Result<(), Failure> {
        let tree = self.tree.get_or_init(|| ObvhsTree::new(self.shapes.iter().map(bounds)));
        let found = self.hits_among(trace, precision, |ray, test| tree.visit(ray, test));
        match hits.iter().find(|hit| !found.contains(hit)) {
            Some(lost) => fail(format!("a BVH over the bounds of the primitives misses {lost:?}")),
            None if found.len() != hits.len() => {
                fail("a BVH over the bounds of the primitives finds extra hits")
            }
            None => Ok(()),
        }
    }

    /// The hits among the shapes that `visit` names for each instance, given its ray.
    fn hits_among(
        &self,
        trace: &TraceRay,
        precision: Precision,
        visit: impl Fn(&ObjectRay, &mut dyn FnMut(usize)),
    ) -> Vec<ExactHit> {
        let mut hits = Vec::new();
        for (instance, instance_at_time) in self.instances.iter().enumerate() {
            // Vulkan, "Ray Culling": the low eight bits of the masks have no bit in common.
            if u32::from(instance_at_time.placement.mask) & trace.cull_mask == 0 {
                continue;
            }
            let Some(ray) = self.object_ray(instance, &trace.ray) else { continue };
            visit(&ray, &mut |shape| {
                let Some(found) = intersect(&self.shapes[shape], &ray, precision) else { return };
                if let Some(surface) = instance_at_time.presented_surface(found.surface, trace.flags) {
                    hits.push(ExactHit { instance, shape, found: Intersection { surface, ..found } });
                }
            });
        }
        let key = |hit: &ExactHit| (hit.instance, hit.shape);
        let order = |a: &ExactHit, b: &ExactHit| a.found.t.partial_cmp(&b.found.t).unwrap_or(Ordering::Equal);
        sort_by(&mut hits, |a, b| order(a, b).then_with(|| key(a).cmp(&key(b))));
        hits
    }
}

impl InstanceAtTime {
    /// The surface that is hit, given the instance's flags; `None` where the ray's flags cull it.
    fn presented_surface(&self, surface: Surface, flags: RayFlags) -> Option<Surface> {
        let has = |flag: InstanceFlags| self.placement.flags & flag.0 != 0;
        let is_flipped = has(InstanceFlags::TRIANGLE_FLIP_FACING);
        let is_front = match surface {
            Surface::TriangleFront => !is_flipped,
            Surface::TriangleBack => is_flipped,
            other => return Some(other),
        };
        let (surface, culls) = if is_front {
            (Surface::TriangleFront, RayFlags::CULL_FRONT_FACING_TRIANGLES)
        } else {
            (Surface::TriangleBack, RayFlags::CULL_BACK_FACING_TRIANGLES)
        };
        let is_culled = flags.0 & culls.0 != 0 && !has(InstanceFlags::TRIANGLE_FACING_CULL_DISABLE);
        (!is_culled).then_some(surface)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::geometry::Bounds;

    #[test]
    fn a_box_that_is_too_small_is_found_by_the_other_tree() {
        let ball = |k: usize| Shape::Sphere { center: [4.0 * k as f32, 0.0, 0.0], radius: 1.0 };
        let ray = Ray::new([-4.0, 0.5, 0.0], [1.0, 0.0, 0.0]);
        let case = StressCase::new((0..9).map(ball).collect(), ray.into());
        let check = |shrunk: Option<usize>| {
            let case_at_time = CaseAtTime::new(&case, 0.0);
            let boxes = case.shapes.iter().enumerate().map(|(at, shape)| {
                let around = bounds(shape)?;
                Some(if shrunk == Some(at) { Bounds { max: around.min, ..around } } else { around })
            });
            assert!(case_at_time.tree.set(ObvhsTree::new(boxes)).is_ok(), "built before");
            let trace = case.trace();
            let hits = case_at_time.hits(&trace, Precision::Exact);
            assert_eq!(hits.len(), 9);
            case_at_time.check_tree(&trace, Precision::Exact, &hits)
        };
        assert_eq!(check(None), Ok(()));
        for shrunk in 0..9 {
            let Failure(what) = check(Some(shrunk)).expect_err("a ball is lost");
            assert!(what.contains("misses") && what.contains(&format!("shape: {shrunk},")), "{what}");
        }
    }
}
