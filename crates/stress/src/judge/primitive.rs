//! Checks the results for one primitive: hit or miss, the surface, t and the attributes.

use crate::case::Shape;
use crate::judge::{Failure, Tally, fail};
use crate::reference::{Expected, ObjectLine};
use anyhit_engine::geometry::block::{self, BoxRay, CullRay, LANES, ShearedRay};
use anyhit_engine::geometry::{
    Bounds, DoubleRay, Intersection, ObjectRay, Precision, Ray, Surface, Transform, Verdict, aabb,
    linear_swept_sphere, sphere, triangle,
};
use anyhit_engine::math::baseline_simd::BaselineSimd;
use anyhit_engine::math::lane_ops::{CpuTier, LaneOps, LaneTask};

/// The result of the primitive tests, for a shape that does not move.
pub(crate) fn intersect(shape: &Shape, ray: &ObjectRay, precision: Precision) -> Option<Intersection> {
    match *shape {
        Shape::Triangle(vertices) => triangle::intersect(ray, vertices, precision),
        Shape::MovingTriangle(_) => None,
        Shape::Aabb([min, max]) => aabb::intersect(ray, min, max, precision),
        Shape::Sphere { center, radius } => sphere::intersect(ray, center, radius, precision),
        Shape::LinearSweptSphere { positions, radii, caps } => {
            linear_swept_sphere::intersect(ray, positions, radii, caps, precision)
        }
    }
}

/// The box around a shape that does not move; `None` if no ray can hit it.
pub(crate) fn bounds(shape: &Shape) -> Option<Bounds> {
    match *shape {
        Shape::Triangle(vertices) => triangle::bounds(vertices),
        Shape::MovingTriangle([first, second]) => {
            Some(triangle::bounds(first)?.union(&triangle::bounds(second)?))
        }
        Shape::Aabb([min, max]) => aabb::bounds(min, max),
        Shape::Sphere { center, radius } => sphere::bounds(center, radius),
        Shape::LinearSweptSphere { positions, radii, .. } => linear_swept_sphere::bounds(positions, radii),
    }
}

/// The SIMD test of a block of triangles.
struct BlockTest<'a> {
    block: &'a block::Triangle4,
    ray: &'a ShearedRay,
}

impl LaneTask for BlockTest<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<V: LaneOps>(self, simd: V) -> u32 {
        self.block.maybe_hit_mask(simd, self.ray)
    }
}

/// The SIMD intersection of one triangle of a block.
struct SimdIntersection<'a> {
    block: &'a block::Triangle4,
    lane: usize,
    ray: &'a ObjectRay,
    /// Whether the ray is in world space.
    in_world: bool,
}

impl LaneTask for SimdIntersection<'_> {
    type Output = Verdict<Intersection>;

    #[inline(always)]
    fn run<V: LaneOps>(self, simd: V) -> Verdict<Intersection> {
        let ray = if self.in_world {
            DoubleRay::in_world(simd, self.ray.world())
        } else {
            DoubleRay::of(simd, self.ray)
        };
        self.block.intersect_simd(simd, self.lane, &ray)
    }
}

/// One primitive of a case and the line of a ray.
pub(crate) struct LineAndPrimitive<'a> {
    /// The primitive at the time.
    pub shape: &'a Shape,
    pub line: &'a ObjectLine,
    pub matrix: Option<&'a [[f32; 4]; 3]>,
    pub precision: Precision,
    pub index: usize,
}

impl LineAndPrimitive<'_> {
    /// The hit of the line; `None` for a box, whose entry depends on the interval.
    pub(crate) fn expected(&self) -> Option<Expected> {
        match *self.shape {
            Shape::Triangle(vertices) => self.line.triangle(vertices),
            Shape::Aabb(_) | Shape::MovingTriangle(_) => None,
            Shape::Sphere { center, radius } => self.line.sphere(center, radius),
            Shape::LinearSweptSphere { positions, radii, caps } => {
                self.line.linear_swept_sphere(positions, radii, caps)
            }
        }
    }

    /// Checks the block test, with the primitive in one lane and the other lanes empty.
    pub(crate) fn check_block(
        &self,
        ray: &ObjectRay,
        expected: Option<&Expected>,
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let lane = self.index % LANES;
        // The ray of [`CullRay::new`], and in an instance also the approximate one in f32.
        let transform = self.matrix.and_then(Transform::new);
        let approximate = transform.and_then(|transform| transform.approximate(ray.world()));
        let cull_rays = |bounds: &Bounds| {
            let approximate = approximate.and_then(|approximate| CullRay::approximate(&approximate, bounds));
            [Some(CullRay::new(ray, bounds)), approximate].into_iter().flatten()
        };
        let (hit_mask, is_hit) = match *self.shape {
            Shape::Triangle(vertices) => {
                let Some(bounds) = triangle::bounds(vertices) else { return Ok(()) };
                let mut block = block::Triangle4::EMPTY;
                block.set(lane, vertices);
                let world = Some(ray.world()).filter(|_| ray.is_in_world() && ShearedRay::covers(&bounds));
                let world_space = world.and_then(ShearedRay::world_space);
                let well_scaled = world.filter(|ray| ray.is_well_scaled()).map(ShearedRay::well_scaled);
                let sheared =
                    cull_rays(&bounds).map(|ray| ShearedRay::of(&ray)).chain(world_space).chain(well_scaled);
                let both = |ray: &ShearedRay| {
                    block.maybe_hit_mask(BaselineSimd, ray)
                        & CpuTier::new().run(BlockTest { block: &block, ray })
                };
                (sheared.fold(u32::MAX, |hit_mask, ray| hit_mask & both(&ray)), expected.is_some())
            }
            Shape::MovingTriangle(_) => return Ok(()),
            Shape::Aabb([min, max]) => {
                let Some(bounds) = aabb::bounds(min, max) else { return Ok(()) };
                let mut block = block::Aabb4::EMPTY;
                block.set(lane, min, max);
                let is_hit = self.line.aabb(min, max, ray.t_min(), ray.t_max()).is_some();
                (block.maybe_hit_mask(&BoxRay::new(ray, &bounds)), is_hit)
            }
            Shape::Sphere { center, radius } => {
                let Some(bounds) = sphere::bounds(center, radius) else { return Ok(()) };
                let mut block = block::Sphere4::EMPTY;
                block.set(lane, center, radius);
                (
                    cull_rays(&bounds)
                        .fold(u32::MAX, |hit_mask, ray| hit_mask & block.maybe_hit_mask(BaselineSimd, &ray)),
                    expected.is_some(),
                )
            }
            Shape::LinearSweptSphere { positions, radii, .. } => {
                let Some(bounds) = linear_swept_sphere::bounds(positions, radii) else { return Ok(()) };
                let mut block = block::LinearSweptSphere4::EMPTY;
                block.set(lane, positions, radii);
                let both = |ray: &CullRay| {
                    block.maybe_hit_mask(BaselineSimd, ray) & block.maybe_hit_mask_tight(BaselineSimd, ray)
                };
                (cull_rays(&bounds).fold(u32::MAX, |hit_mask, ray| hit_mask & both(&ray)), expected.is_some())
            }
        };
        let kept = hit_mask >> lane & 1 != 0;
        tally.culled += u64::from(!kept);
        if is_hit && !kept {
            return fail(format!("primitive {}: the block test culls it, but the line hits it", self.index));
        }
        Ok(())
    }

    /// Checks the result for one interval.
    pub(crate) fn check(
        &self,
        ray: &Ray,
        expected: Option<&Expected>,
        tally: &mut Tally,
    ) -> Result<Option<Intersection>, Failure> {
        tally.rays += 1;
        let Ray { t_min, t_max, .. } = *ray;
        let index = self.index;
        let Some(object) = ObjectRay::new(ray, self.matrix) else {
            return fail(format!("no object-space ray over {t_min:e}..{t_max:e}"));
        };
        let found = intersect(self.shape, &object, self.precision);
        let location = || format!("primitive {index} over {t_min:e}..{t_max:e}");
        if let (Shape::Triangle(vertices), Precision::Exact) = (self.shape, self.precision) {
            let mut block = block::Triangle4::EMPTY;
            let lane = index % LANES;
            block.set(lane, *vertices);
            // In world space the ray has two representations.
            for in_world in [false, true].into_iter().filter(|in_world| !in_world || self.matrix.is_none()) {
                let with_simd =
                    CpuTier::new().run(SimdIntersection { block: &block, lane, ray: &object, in_world });
                let agrees = match with_simd {
                    Verdict::Hit(hit) => found == Some(hit),
                    Verdict::Miss => found.is_none(),
                    Verdict::Undecided => true,
                };
                if !agrees {
                    return fail(format!("{}: {with_simd:?} with SIMD, otherwise {found:?}", location()));
                }
            }
        }
        if let Shape::Aabb([min, max]) = *self.shape {
            let entry = self.line.aabb(min, max, t_min, t_max);
            match (&found, entry) {
                (None, None) => {}
                (Some(hit), Some(t)) if t.rounds_to(hit.t) => tally.hits += 1,
                (Some(hit), Some(_)) => return fail(format!("{}: t {:e} is wrong", location(), hit.t)),
                (found, entry) => {
                    return fail(format!("{}: hit {}, not {}", location(), found.is_some(), entry.is_some()));
                }
            }
            return Ok(found);
        }
        let is_open = matches!(self.shape, Shape::Triangle(_));
        let expected = expected.filter(|expected| expected.t.is_within(t_min, t_max, is_open));
        let (hit, expected) = match (found, expected) {
            (None, None) => return Ok(None),
            (Some(hit), Some(expected)) => (hit, expected),
            (found, expected) => {
                return fail(format!("{}: hit {}, not {}", location(), found.is_some(), expected.is_some()));
            }
        };
        if hit.surface != expected.surface {
            return fail(format!("{}: {:?}, not {:?}", location(), hit.surface, expected.surface));
        }
        if !expected.t.rounds_to(hit.t) {
            return fail(format!("{}: t {:e} is wrong", location(), hit.t));
        }
        for (value, exact) in hit.attributes.iter().zip(&expected.attributes) {
            let clamped =
                hit.surface == Surface::Side && [f32::MIN_POSITIVE, 1.0f32.next_down()].contains(value);
            if !clamped && !exact.rounds_to(*value) {
                return fail(format!("{}: attribute {value:e} is wrong", location()));
            }
        }
        tally.hits += 1;
        Ok(Some(hit))
    }
}
