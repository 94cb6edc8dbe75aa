//! The ray in the space of the instance that it traverses, in the forms that its tests need. Forms
//! that only some tests need are made on first use.

use crate::accel::built_blas::{BuiltBlas, Culling, LeafRay};
use crate::accel::geometry_data::GeometryKind;
use crate::accel::node::NodeRef;
use crate::accel::tlas::{InstanceTransform, Tlas};
use crate::accel::trace_ray::TraceRay;
use crate::accel::trav_ray::TravRay;
use crate::accel::wide_bvh::WideBvh;
use crate::geometry::block::{CullRay, ShearedRay};
use crate::geometry::{ApproximateRay, DoubleRay, ObjectRay, Ray, Transform};
use crate::math::f32x4::FmaOps;
use crate::math::f64x4::F64x4Ops;

/// The current instance of a traversal, and the ray in its space.
#[derive(Clone, Debug)]
pub(super) struct InstanceRay {
    pub instance: u32,
    /// The number of stack entries below those of this instance.
    pub stack_base: usize,
    pub trav_ray: TravRay,
    object_ray: ObjectRay,
    has_object_ray: bool,
    /// Whether object space is world space and the ray is well scaled.
    is_well_scaled: bool,
    cull_ray: CullRay,
    /// The ray that culls triangles.
    sheared_ray: ShearedRay,
    /// Whether the ray culls primitives; valid once `has_cull_ray` is set.
    culls: bool,
    has_cull_ray: bool,
    ray_space: RaySpace,
    /// The ray in f32; valid for [`RaySpace::Approximate`].
    approximate_ray: ApproximateRay,
}

impl InstanceRay {
    /// Placeholder value.
    pub(super) const EMPTY: Self = Self {
        instance: 0,
        stack_base: 0,
        trav_ray: TravRay::EMPTY,
        object_ray: ObjectRay::EMPTY,
        has_object_ray: false,
        is_well_scaled: false,
        cull_ray: CullRay::EMPTY,
        sheared_ray: ShearedRay::EMPTY,
        culls: false,
        has_cull_ray: false,
        ray_space: RaySpace::Object,
        approximate_ray: ApproximateRay::EMPTY,
    };

    /// Prepares the ray for an instance; `false` if it certainly hits nothing up to `cull_t` there.
    #[inline(always)]
    pub(super) fn enter(
        &mut self,
        tlas: &Tlas,
        instance: u32,
        bvh: Option<&WideBvh>,
        trace: &TraceRay,
        cull_t: f32,
    ) -> bool {
        self.instance = instance;
        self.has_object_ray = false;
        self.has_cull_ray = false;
        self.is_well_scaled = false;
        let entered = match (bvh, tlas.transform(instance)) {
            (Some(bvh), InstanceTransform::Identity) => {
                self.ray_space = RaySpace::World;
                self.is_well_scaled = self.trav_ray.set_world_space(&trace.ray, bvh.world_space());
                self.is_well_scaled
            }
            (Some(bvh), InstanceTransform::Static(transform)) => {
                self.enter_approximately(transform, bvh, &trace.ray)
            }
            _ => false,
        };
        entered || self.enter_in_object_space(tlas, bvh, trace, cull_t)
    }

    /// Enters an instance in world space with a ray whose slabs the caller has made.
    #[inline(always)]
    pub(super) fn enter_with_world_slabs(&mut self, instance: u32) {
        self.instance = instance;
        self.has_object_ray = false;
    }

    /// [`Self::enter`] by an f32 ray with error bounds; `false` if those do not suffice.
    #[inline(never)]
    fn enter_approximately(&mut self, transform: &Transform, bvh: &WideBvh, ray: &Ray) -> bool {
        let Some(approximate_ray) = transform.approximate(ray) else { return false };
        self.ray_space = RaySpace::Approximate;
        self.approximate_ray = approximate_ray;
        self.trav_ray.set_approximate(&approximate_ray, ray.t_min, bvh.scale())
    }

    /// [`Self::enter`] by the f64 ray in object space.
    #[inline(never)]
    fn enter_in_object_space(
        &mut self,
        tlas: &Tlas,
        bvh: Option<&WideBvh>,
        trace: &TraceRay,
        cull_t: f32,
    ) -> bool {
        // No other way into an instance takes a direction of zero, which is not well scaled.
        if trace.ray.goes_nowhere()
            && tlas.instances()[self.instance as usize].blas.kind() != Some(GeometryKind::Aabbs)
        {
            return false;
        }
        self.ray_space = RaySpace::Object;
        self.has_object_ray =
            tlas.set_object_ray(self.instance, &trace.ray, trace.time, &mut self.object_ray);
        if !self.has_object_ray {
            return false;
        }
        let Some(bvh) = bvh else {
            // Without a BVH blocks of primitives are still culled.
            self.prepare_culling(tlas, trace);
            return true;
        };
        let trav_ray = TravRay::new(&self.object_ray, cull_t, bvh.bounds(), bvh.scale());
        trav_ray.map(|trav_ray| self.trav_ray = trav_ray).is_some()
    }

    /// Chooses the form of the ray that culls blocks of primitives.
    #[inline(always)]
    fn prepare_culling(&mut self, tlas: &Tlas, trace: &TraceRay) {
        self.ray_space = match tlas.transform(self.instance) {
            InstanceTransform::Identity => RaySpace::World,
            InstanceTransform::Static(transform) => match transform.approximate(&trace.ray) {
                Some(ray) => {
                    self.approximate_ray = ray;
                    RaySpace::Approximate
                }
                None => RaySpace::Object,
            },
            InstanceTransform::Moving => RaySpace::Object,
        };
    }

    /// Prepares a ray of a packet for an instance whose BVH the packet traverses.
    #[inline(always)]
    pub(super) fn enter_with_packet(
        &mut self,
        tlas: &Tlas,
        instance: u32,
        built: &BuiltBlas,
        trace: &TraceRay,
    ) {
        self.instance = instance;
        self.has_object_ray = false;
        self.is_well_scaled = false;
        self.has_cull_ray = false;
        if !built.tests_whole_leaves(tlas.precision()) && built.culling() != Culling::Never {
            self.prepare_culling(tlas, trace);
        }
    }

    /// The ray for the tests of whole leaves.
    #[inline(always)]
    pub(super) fn leaf_ray<'a, const WELL_SCALED: bool>(
        &'a mut self,
        tlas: &'a Tlas,
        trace: &'a TraceRay,
    ) -> InstanceLeafRay<'a, WELL_SCALED> {
        InstanceLeafRay { instance_ray: self, tlas, trace }
    }

    /// The ray in object space.
    #[inline(always)]
    pub(super) fn object_ray(&mut self, tlas: &Tlas, trace: &TraceRay) -> &ObjectRay {
        if !self.has_object_ray {
            // A ray that is not finite or an instance without inverse was refused before.
            tlas.set_object_ray(self.instance, &trace.ray, trace.time, &mut self.object_ray);
            self.has_object_ray = true;
        }
        &self.object_ray
    }

    /// A mask of the primitives of a leaf that the ray may hit, by [`BuiltBlas::maybe_hit_mask`].
    #[inline(always)]
    pub(super) fn maybe_hit_mask<F: FmaOps, const TIGHT: bool>(
        &mut self,
        simd: F,
        tlas: &Tlas,
        built: &BuiltBlas,
        leaf: NodeRef,
        trace: &TraceRay,
    ) -> u32 {
        if !self.has_cull_ray {
            self.has_cull_ray = true;
            self.make_cull_ray(tlas, built, trace);
        }
        if self.culls {
            built.maybe_hit_mask::<F, TIGHT>(simd, leaf, &self.cull_ray, &self.sheared_ray)
        } else {
            built.full_mask(leaf)
        }
    }

    #[inline(always)]
    fn make_cull_ray(&mut self, tlas: &Tlas, built: &BuiltBlas, trace: &TraceRay) {
        let culling = built.culling();
        if culling == Culling::Never {
            self.culls = false;
            return;
        }
        if built.has_triangles() {
            let ray = self.make_sheared_ray(built, trace);
            self.culls = ray.is_some();
            self.sheared_ray = ray.unwrap_or(ShearedRay::EMPTY);
            return;
        }
        let ray = match self.ray_space {
            RaySpace::World => CullRay::world_space(&trace.ray, built.bounds()),
            RaySpace::Approximate => CullRay::approximate(&self.approximate_ray, built.bounds()),
            RaySpace::Object => None,
        };
        self.culls = ray.is_some() || culling == Culling::Always;
        if let Some(ray) = ray {
            self.cull_ray = ray;
        } else if self.culls {
            self.cull_ray = CullRay::new(self.object_ray(tlas, trace), built.bounds());
        }
    }

    /// The ray that culls triangles, if it can be prepared in f32.
    #[inline(always)]
    fn make_sheared_ray(&self, built: &BuiltBlas, trace: &TraceRay) -> Option<ShearedRay> {
        let bounds = built.bounds();
        match self.ray_space {
            RaySpace::World => {
                // For a well-scaled ray the scale of the tree implies this.
                if self.is_well_scaled {
                    return Some(ShearedRay::well_scaled(&trace.ray));
                }
                if ShearedRay::covers(bounds) { ShearedRay::world_space(&trace.ray) } else { None }
            }
            RaySpace::Approximate => {
                CullRay::approximate(&self.approximate_ray, bounds).as_ref().map(ShearedRay::of)
            }
            RaySpace::Object => None,
        }
    }
}

/// The ray of an instance for tests of whole leaves. `WELL_SCALED` says that object space is world
/// space and that the ray is well scaled.
pub(super) struct InstanceLeafRay<'a, const WELL_SCALED: bool> {
    instance_ray: &'a mut InstanceRay,
    tlas: &'a Tlas,
    trace: &'a TraceRay,
}

impl<const WELL_SCALED: bool> LeafRay for InstanceLeafRay<'_, WELL_SCALED> {
    #[inline(always)]
    fn double_ray<D: F64x4Ops>(&mut self, simd: D) -> DoubleRay<D> {
        let InstanceRay { instance, is_well_scaled, ray_space, .. } = *self.instance_ray;
        if WELL_SCALED || is_well_scaled {
            return DoubleRay::in_world(simd, &self.trace.ray);
        }
        if ray_space == RaySpace::Approximate
            && let InstanceTransform::Static(transform) = self.tlas.transform(instance)
            && let Some(ray) = DoubleRay::in_instance(simd, &self.trace.ray, transform)
        {
            return ray;
        }
        DoubleRay::of(simd, self.object_ray())
    }

    #[inline(always)]
    fn object_ray(&mut self) -> &ObjectRay {
        self.instance_ray.object_ray(self.tlas, self.trace)
    }
}

/// The form in which the ray entered the instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RaySpace {
    /// Object space is world space: the f32 ray as given.
    World,
    /// The f32 ray in object space, with error bounds.
    Approximate,
    /// The f64 ray in object space, with error bounds.
    Object,
}
