//! Bottom-level acceleration structures.

use std::fmt;
use std::ops::Deref;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use crate::accel::built_blas::BuiltBlas;
use crate::accel::built_blas::partial::PartialBlas;
use crate::accel::geometry::{Geometry, moves, primitive_count};
use crate::accel::geometry_data::GeometryKind;
use crate::accel::node::Node;
use crate::accel::primitive::Primitive;
use crate::accel::validate;
use crate::geometry::Bounds;
use anyhit_base::error::{Error, Result};

/// A bottom-level acceleration structure: geometries of one kind under one BVH.
///
/// Creating one only validates it. Its boxes and its BVH are built when rays reach it; the BVH is
/// not built if it holds few primitives or few rays reach it. For a few rays whose traversal is
/// explained, only the parts are built that they enter.
pub struct Blas {
    geometries: Vec<Geometry>,
    bounds: OnceLock<Bounds>,
    /// What the first few rays use, until the BVH is built.
    for_few: Mutex<ForFewRays>,
    /// The number of rays that used the list.
    rays: AtomicU32,
    /// The number of rays that used the partial BVH.
    explained_rays: AtomicU32,
    built: OnceLock<BuiltBlas>,
}

/// What the first few rays use instead of the whole BVH.
#[derive(Debug, Default)]
struct ForFewRays {
    /// The list of all primitives.
    list: Option<Arc<BuiltBlas>>,
    /// The parts of the BVH that rays have entered. Boxed: few BLASes have it, and it is large.
    partial: Option<Box<PartialBlas>>,
}

/// The first [`LAZY_BUILD_RAYS`] rays that reach more than [`LAZY_BUILD_PRIMITIVES`] primitives
/// test all of them. Building a BVH takes as long as thirty such rays. Most scenes that trace a few
/// rays never trace more, and the others lose little.
const LAZY_BUILD_RAYS: u32 = 4;
const LAZY_BUILD_PRIMITIVES: usize = 512;
/// As many rays whose traversal is explained, and which always see a BVH, build only what they
/// enter of one over more than [`LAZY_BUILD_PRIMITIVES`] primitives.
const PARTIAL_BUILD_RAYS: u32 = 64;

/// The number of geometries, and the first of them.
impl fmt::Debug for Blas {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 4;
        f.debug_struct("Blas")
            .field("geometry_count", &self.geometries.len())
            .field("geometries", &&self.geometries[..self.geometries.len().min(SHOWN)])
            .finish_non_exhaustive()
    }
}

impl Blas {
    /// Takes the geometries; the tree is built on first use.
    ///
    /// # Errors
    /// `InvalidScene`, naming geometry and primitive, where kinds are mixed
    /// (VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03792), an index is out of range, a
    /// count does not fit, a box is inside out (VUID-VkAabbPositionsKHR-minX-03546 and the next
    /// two), a referenced radius is negative (VUIDs 10426 and 10436), successive indexing lacks
    /// indices (VUID 10427), or a geometry transform is singular
    /// (VUID-VkTransformMatrixKHR-matrix-03799). All mistakes are reported at once.
    pub fn new(geometries: Vec<Geometry>) -> Result<Arc<Self>> {
        Self::check(&geometries)?;
        Ok(Self::of_checked(geometries))
    }

    /// Checks geometries without taking them.
    ///
    /// # Errors
    /// As [`Blas::new`].
    pub fn check(geometries: &[Geometry]) -> Result<()> {
        let mistakes = validate::geometries(geometries);
        if mistakes.is_empty() { Ok(()) } else { Err(Error::several(mistakes)) }
    }

    /// Takes geometries that [`Blas::check`] has found valid.
    pub fn of_checked(geometries: Vec<Geometry>) -> Arc<Self> {
        Arc::new(Self {
            geometries,
            bounds: OnceLock::new(),
            for_few: Mutex::default(),
            rays: AtomicU32::new(0),
            explained_rays: AtomicU32::new(0),
            built: OnceLock::new(),
        })
    }

    /// [`Blas::new`], with a BVH in which the box of a child of the root is too small.
    #[cfg(any(test, feature = "test-support"))]
    pub fn with_small_box(geometries: Vec<Geometry>, slot: usize) -> Result<Arc<Self>> {
        let blas = Self::new(geometries)?;
        let mut built = BuiltBlas::build(&blas.geometries);
        built.shrink_box(slot);
        assert!(blas.built.set(built).is_ok(), "built before");
        Ok(blas)
    }

    /// The geometries in the order of their `RayGeometryIndexKHR`.
    pub fn geometries(&self) -> &[Geometry] {
        &self.geometries
    }

    /// The kind of its primitives; `None` for a BLAS without geometries.
    pub fn kind(&self) -> Option<GeometryKind> {
        self.geometries.first().map(|geometry| geometry.data.kind())
    }

    /// The data of a primitive, bit for bit as given (triangles: after the geometry transform):
    /// what the hit builtins and position fetch return. Triangles that move are where they are at
    /// the ray's time. `None` where there is no such primitive.
    pub fn primitive(&self, geometry: u32, primitive: u32, time: f32) -> Option<Primitive> {
        let geometry = self.geometries.get(geometry as usize)?;
        let there = (primitive as usize) < geometry.data.primitive_count();
        there.then(|| geometry.primitive_at(primitive, time))
    }

    /// Whether vertices of it move.
    pub fn moves(&self) -> bool {
        moves(&self.geometries)
    }

    /// Whether rays have reached it, so that its boxes and perhaps its BVH exist.
    pub fn is_built(&self) -> bool {
        let for_few = self.for_few();
        self.built.get().is_some() || for_few.list.is_some() || for_few.partial.is_some()
    }

    /// The bytes of its geometries' arrays, and of what is built of them.
    pub fn memory_size(&self) -> usize {
        let given: usize = self.geometries.iter().map(|geometry| geometry.data.memory_size()).sum();
        given + self.built.get().map_or(0, BuiltBlas::memory_size)
    }

    /// Whether its whole BVH is built. Few primitives have none, and neither have many that only a
    /// few rays reached.
    pub fn has_bvh(&self) -> bool {
        self.built.get().is_some_and(|built| built.bvh().is_some())
    }

    /// Whether the few rays that have reached it tested a list of its many primitives, which is
    /// dropped when more rays make it build its BVH.
    pub fn is_listed(&self) -> bool {
        self.for_few().list.is_some()
    }

    fn for_few(&self) -> MutexGuard<'_, ForFewRays> {
        let mut locked = self.for_few.lock().unwrap_or_else(PoisonError::into_inner);
        if self.for_few.is_poisoned() {
            // A thread may have panicked in the middle of a division.
            locked.partial = None;
            self.for_few.clear_poison();
        }
        locked
    }

    /// The box around all active primitives, in object space; empty where there are none. Builds
    /// nothing else, unless vertices move.
    pub fn bounds(&self) -> Bounds {
        match self.built.get() {
            Some(built) => *built.bounds(),
            None if self.moves() => *self.built().bounds(),
            None => match &self.for_few().partial {
                Some(partial) => *partial.built().bounds(),
                None => *self.bounds.get_or_init(|| BuiltBlas::bounds_of(&self.geometries)),
            },
        }
    }

    /// The primitives in the form that traversal takes; builds on first use.
    #[inline]
    pub(super) fn built(&self) -> &BuiltBlas {
        self.built.get_or_init(|| {
            // The build needs the memory of the list, which no further ray uses.
            self.for_few().list = None;
            BuiltBlas::build(&self.geometries)
        })
    }

    /// The primitives as [`Blas::built`] has them, if they are built already.
    #[inline]
    pub(super) fn built_already(&self) -> Option<&BuiltBlas> {
        self.built.get()
    }

    /// The primitives for a ray that reaches them. `may_use_list` says that results do not depend
    /// on the BVH, so that the first few rays may test a list of all primitives.
    #[inline]
    pub(super) fn primitives_for_ray(&self, may_use_list: bool) -> BlasForRay<'_> {
        match self.built.get() {
            Some(built) => BlasForRay::Built(built),
            None => self.list_or_build(may_use_list),
        }
    }

    /// The primitives for a ray that reaches them and whose traversal is explained: it sees a BVH,
    /// of which [`Blas::grow`] builds what it enters.
    pub(super) fn primitives_for_explained_ray(&self) -> BlasForRay<'_> {
        match self.built.get() {
            Some(built) => BlasForRay::Built(built),
            None => self.part_or_build(),
        }
    }

    /// Builds what a ray may open of a BVH that is built in part, and returns what is built then;
    /// `None` where the whole is built. `hit_children` returns a mask of the children of a node
    /// that the ray may hit.
    pub(super) fn grow(&self, hit_children: &mut dyn FnMut(&Node) -> u32) -> Option<Arc<BuiltBlas>> {
        if self.built.get().is_some() {
            return None;
        }
        Some(self.for_few().partial.as_mut()?.grow(&self.geometries, hit_children))
    }

    #[cold]
    fn list_or_build(&self, may_use_list: bool) -> BlasForRay<'_> {
        if may_use_list
            && primitive_count(&self.geometries) > LAZY_BUILD_PRIMITIVES
            && self.rays.fetch_add(1, Ordering::Relaxed) < LAZY_BUILD_RAYS
        {
            let mut for_few = self.for_few();
            if self.built.get().is_none() {
                let make = || Arc::new(BuiltBlas::without_bvh(&self.geometries));
                return BlasForRay::Shared(for_few.list.get_or_insert_with(make).clone());
            }
        }
        self.build()
    }

    #[cold]
    fn part_or_build(&self) -> BlasForRay<'_> {
        if primitive_count(&self.geometries) > LAZY_BUILD_PRIMITIVES
            && !self.moves()
            && self.explained_rays.fetch_add(1, Ordering::Relaxed) < PARTIAL_BUILD_RAYS
        {
            let mut for_few = self.for_few();
            if self.built.get().is_none() {
                if for_few.partial.is_none() {
                    for_few.partial =
                        PartialBlas::begin(&self.geometries, LAZY_BUILD_PRIMITIVES).map(Box::new);
                }
                if let Some(partial) = &for_few.partial {
                    return BlasForRay::Shared(partial.built());
                }
            }
        }
        self.build()
    }

    fn build(&self) -> BlasForRay<'_> {
        let built = self.built();
        // Rays that still use the list or a part keep it alive.
        *self.for_few() = ForFewRays::default();
        BlasForRay::Built(built)
    }
}

/// The primitives of a BLAS for a ray that has reached it.
pub(super) enum BlasForRay<'a> {
    /// The form that is built once and kept.
    Built(&'a BuiltBlas),
    /// What the first few rays use: a list of the primitives, or a part of their BVH.
    Shared(Arc<BuiltBlas>),
}

impl Deref for BlasForRay<'_> {
    type Target = BuiltBlas;

    #[inline(always)]
    fn deref(&self) -> &BuiltBlas {
        match self {
            Self::Built(built) => built,
            Self::Shared(built) => built,
        }
    }
}
