//! Top-level acceleration structures and instances.

use std::fmt;
use std::sync::{Arc, OnceLock};

use crate::accel::binned_sah::SahCost;
use crate::accel::build_threads::BuildThreads;
use crate::accel::flags::RayFlags;
use crate::accel::geometry_data::GeometryKind;
use crate::accel::instance::TlasInstance;
use crate::accel::motion::or_identity;
use crate::accel::prim_ref::PrimRef;
use crate::accel::rules::is_opaque;
use crate::accel::transform::IDENTITY;
use crate::accel::wide_bvh::WideBvh;
use crate::accel::{motion_bounds, validate_instances};
use crate::geometry::{Bounds, ObjectRay, Precision, Ray, Transform, world_to_object};
use crate::math::lane_ops::CpuTier;
use anyhit_base::error::{Error, Result};

/// Up to this many instances are entered one after another without a BVH, so that no BLAS is built
/// that no ray reaches.
const MAX_LINEAR_INSTANCES: usize = 4;

/// The transform of an instance from world space to its object space.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "a ray that enters an instance would wait for a box")]
pub(super) enum InstanceTransform {
    /// The identity: object space is world space.
    Identity,
    /// A transform that does not depend on time.
    Static(Transform),
    /// A transform that depends on time.
    Moving,
}

/// A top-level acceleration structure.
pub struct Tlas {
    instances: Vec<TlasInstance>,
    /// The transform of each instance.
    transforms: Vec<InstanceTransform>,
    /// The exact inverse transform of each instance, computed when a shader reads it.
    world_to_object: Vec<OnceLock<Box<[[f32; 4]; 3]>>>,
    bvh: OnceLock<Option<(WideBvh, Vec<u32>)>>,
    moves: bool,
    has_micromaps: bool,
    has_boxes: bool,
    /// Whether every geometry is opaque, has no micromap and does not consist of boxes.
    opaque: OnceLock<bool>,
    precision: Precision,
    cpu_tier: CpuTier,
}

/// The number of instances, and the first of them.
impl fmt::Debug for Tlas {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 8;
        f.debug_struct("Tlas")
            .field("instance_count", &self.instances.len())
            .field("instances", &&self.instances[..self.instances.len().min(SHOWN)])
            .finish_non_exhaustive()
    }
}

impl Tlas {
    /// Takes the instances in the order of their `InstanceId`; intersections are exact.
    ///
    /// # Errors
    /// `InvalidScene`, naming the instance, where a field has too many bits, flags contradict each
    /// other, or a transform is not finite or singular (VUID-VkTransformMatrixKHR-matrix-03799;
    /// decided exactly). All mistakes are reported at once.
    pub fn new(instances: Vec<TlasInstance>) -> Result<Arc<Self>> {
        Self::with_precision(instances, Precision::Exact)
    }

    /// [`Tlas::new`] with a choice of how intersections are computed. Below `Exact` a computed t
    /// can lie before its primitive's box, and ties and near-ties may then depend on the tree.
    ///
    /// # Errors
    /// As [`Tlas::new`].
    pub fn with_precision(instances: Vec<TlasInstance>, precision: Precision) -> Result<Arc<Self>> {
        Self::for_cpu_tier(instances, precision, CpuTier::new())
    }

    /// [`Tlas::with_precision`] on a given instruction set.
    pub fn for_cpu_tier(
        instances: Vec<TlasInstance>,
        precision: Precision,
        cpu_tier: CpuTier,
    ) -> Result<Arc<Self>> {
        let mistakes = validate_instances::instances(&instances);
        if !mistakes.is_empty() {
            return Err(Error::several(mistakes));
        }
        let static_transform = |transform: &[[f32; 4]; 3]| {
            Transform::new(transform).expect("bug in anyhit: a singular instance passed validation")
        };
        let to_transform = |instance: &TlasInstance| match &instance.motion {
            Some(_) => InstanceTransform::Moving,
            None if instance.is_identity() => InstanceTransform::Identity,
            None => InstanceTransform::Static(static_transform(&instance.transform)),
        };
        let transforms = instances.iter().map(to_transform).collect();
        let has_micromap = |instance: &TlasInstance| {
            instance.blas.geometries().iter().any(|geometry| geometry.opacity_micromap.is_some())
        };
        let has_micromaps = instances.iter().any(has_micromap);
        let has_boxes = instances.iter().any(|instance| instance.blas.kind() == Some(GeometryKind::Aabbs));
        let moves = instances.iter().any(|instance| instance.motion.is_some() || instance.blas.moves());
        let world_to_object = instances.iter().map(|_| OnceLock::new()).collect();
        let (bvh, opaque) = (OnceLock::new(), OnceLock::new());
        Ok(Arc::new(Self {
            instances,
            transforms,
            world_to_object,
            bvh,
            moves,
            has_micromaps,
            has_boxes,
            opaque,
            precision,
            cpu_tier,
        }))
    }

    /// A copy whose intersections are computed with another precision.
    pub fn at_precision(&self, precision: Precision) -> Arc<Self> {
        let valid = Self::with_precision(self.instances.clone(), precision);
        valid.expect("bug in anyhit: previously valid instances are rejected")
    }

    /// The null acceleration structure: it has no instances.
    pub fn empty() -> &'static Arc<Self> {
        static EMPTY: OnceLock<Arc<Tlas>> = OnceLock::new();
        EMPTY.get_or_init(|| {
            Self::new(Vec::new()).expect("bug in anyhit: an empty list of instances is rejected")
        })
    }

    /// The instances in the order of their `InstanceId`.
    pub fn instances(&self) -> &[TlasInstance] {
        &self.instances
    }

    /// Whether instances or vertices move.
    pub fn moves(&self) -> bool {
        self.moves
    }

    /// Whether geometries have opacity micromaps.
    pub fn has_micromaps(&self) -> bool {
        self.has_micromaps
    }

    /// How intersections are computed.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Whether packets may trace rays in it: nothing moves, and what is hit does not depend on
    /// which boxes of a BVH are opened, as it may below `Exact`.
    pub(super) fn suits_packets(&self) -> bool {
        self.precision == Precision::Exact && !self.moves
    }

    /// Whether each hit is one of a whole triangle, sphere or linear swept sphere: there are
    /// neither boxes nor opacity micromaps.
    pub(super) fn has_whole_primitives(&self) -> bool {
        !self.has_boxes && !self.has_micromaps
    }

    /// Whether no ray with these flags ever has a candidate for a shader to decide on.
    #[inline]
    pub fn is_fully_opaque(&self, flags: RayFlags) -> bool {
        let opaque = self.opaque.get_or_init(|| {
            self.instances.iter().all(|instance| {
                instance.blas.geometries().iter().all(|geometry| {
                    geometry.data.kind() != GeometryKind::Aabbs
                        && geometry.opacity_micromap.is_none()
                        && is_opaque(RayFlags::default(), instance.flags, geometry.flags)
                })
            })
        });
        *opaque && !flags.contains(RayFlags::NO_OPAQUE)
    }

    /// World to object of an instance at a time within 0 and 1, row-major 3x4, each entry correctly
    /// rounded from the exact inverse (`WorldToObjectKHR`). The identity where there is no inverse.
    ///
    /// # Panics
    /// Where there is no such instance.
    pub fn world_to_object(&self, instance: u32, time: f32) -> [[f32; 4]; 3] {
        let at = instance as usize;
        match &self.transforms[at] {
            InstanceTransform::Identity => IDENTITY,
            InstanceTransform::Static(transform) => {
                **self.world_to_object[at].get_or_init(|| Box::new(transform.world_to_object()))
            }
            InstanceTransform::Moving => {
                or_identity(world_to_object(&self.instances[at].object_to_world(time)))
            }
        }
    }

    /// A ray of a time within 0 and 1 as an instance's primitives see it (`ObjectRayOriginKHR`,
    /// `ObjectRayDirectionKHR`). `None` where the ray itself holds a NaN or an infinity, or the
    /// instance has no inverse at that time.
    ///
    /// # Panics
    /// Where there is no such instance.
    #[inline]
    pub fn object_ray(&self, instance: u32, ray: &Ray, time: f32) -> Option<ObjectRay> {
        match &self.transforms[instance as usize] {
            InstanceTransform::Static(transform) => ObjectRay::in_instance(ray, transform),
            InstanceTransform::Identity => ObjectRay::in_world(ray),
            InstanceTransform::Moving => self.moving_object_ray(instance, ray, time),
        }
    }

    /// [`Tlas::object_ray`] of a moving instance. It is not inlined, so that instances without
    /// motion do not pay for it.
    #[inline(never)]
    fn moving_object_ray(&self, instance: u32, ray: &Ray, time: f32) -> Option<ObjectRay> {
        let matrix = self.instances[instance as usize].motion.as_ref()?.at(time)?;
        ObjectRay::new(ray, Some(&matrix))
    }

    /// The transform of an instance.
    #[inline(always)]
    pub(super) fn transform(&self, instance: u32) -> &InstanceTransform {
        &self.transforms[instance as usize]
    }

    /// [`Tlas::object_ray`], written to `out`; returns whether there is one.
    #[inline]
    pub(super) fn set_object_ray(&self, instance: u32, ray: &Ray, time: f32, out: &mut ObjectRay) -> bool {
        match &self.transforms[instance as usize] {
            InstanceTransform::Identity => out.set_in_world(ray),
            InstanceTransform::Static(transform) => out.set_in_instance(ray, transform),
            InstanceTransform::Moving => {
                let found = self.moving_object_ray(instance, ray, time);
                found.is_some_and(|found| {
                    *out = found;
                    true
                })
            }
        }
    }

    /// The instruction set that traversal uses.
    #[inline]
    pub(super) fn cpu_tier(&self) -> CpuTier {
        self.cpu_tier
    }

    /// Whether the instances are entered one after another.
    #[inline]
    pub(super) fn is_linear(&self) -> bool {
        self.instances.len() <= MAX_LINEAR_INSTANCES
    }

    /// The BVH over the instances' world-space boxes, and the instances in tree order; `None` for a
    /// [linear list](Tlas::is_linear), and if nothing in any of them can be hit. Built on first
    /// use; of a BLAS it needs only the bounds.
    #[inline]
    pub(super) fn bvh(&self) -> Option<&(WideBvh, Vec<u32>)> {
        if self.is_linear() {
            return None;
        }
        self.bvh.get_or_init(|| self.build()).as_ref()
    }

    fn build(&self) -> Option<(WideBvh, Vec<u32>)> {
        let mut boxes = Vec::new();
        for (number, instance) in self.instances.iter().enumerate() {
            let bounds = instance.blas.bounds();
            // A BLAS without active primitives is never hit.
            if bounds == Bounds::EMPTY {
                continue;
            }
            let world_bounds = match (&self.transforms[number], &instance.motion) {
                (InstanceTransform::Moving, Some(motion)) => motion_bounds::bounds(&bounds, motion),
                (InstanceTransform::Identity, _) => bounds,
                _ => bounds.transformed(&instance.transform),
            };
            boxes.push(PrimRef::new(&world_bounds, number as u32));
        }
        let cost = SahCost { max_leaf_size: 1, traversal: 4.0, intersection: 0.0, split_below: 1.0 };
        BuildThreads::build(boxes.len(), |threads| WideBvh::from_prim_refs(boxes, cost, threads))
    }
}
