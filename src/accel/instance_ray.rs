//! A ray in the instance whose tree it is in, with what its tests need; parts that only some tests
//! need are made by the first of them.

use crate::accel::built_blas::{BuiltBlas, Drops, LeafRay};
use crate::accel::cursor::TraceRay;
use crate::accel::node::NodeRef;
use crate::accel::tlas::{Placed, Tlas};
use crate::accel::trav_ray::TravRay;
use crate::accel::wide_bvh::WideBvh;
use crate::geometry::block::{BlockRay, ShearedRay};
use crate::geometry::{ApproximateRay, DoubleRay, ObjectRay, Ray, Transform};
use crate::math::f32x4::FmaOps;
use crate::math::f64x4::F64x4Ops;

/// The instance that the upper end of the stack belongs to.
#[derive(Clone, Debug)]
pub struct InstanceRay {
    pub instance: u32,
    /// How many entries of the stack lie below it.
    pub base: usize,
    pub trav_ray: TravRay,
    object_ray: ObjectRay,
    has_object_ray: bool,
    /// Whether object space is the world's, and the ray ordinary.
    is_well_scaled: bool,
    block_ray: BlockRay,
    /// The same for triangles.
    sheared_ray: ShearedRay,
    /// Whether there is a ray for blocks, if it is known already.
    drops: bool,
    has_block_ray: bool,
    ray_space: RaySpace,
    /// Where it came as one.
    approximate_ray: ApproximateRay,
}

impl InstanceRay {
    /// Memory for a level.
    pub const IDLE: Self = Self {
        instance: 0,
        base: 0,
        trav_ray: TravRay::IDLE,
        object_ray: ObjectRay::IDLE,
        has_object_ray: false,
        is_well_scaled: false,
        block_ray: BlockRay::IDLE,
        sheared_ray: ShearedRay::IDLE,
        drops: false,
        has_block_ray: false,
        ray_space: RaySpace::Object,
        approximate_ray: ApproximateRay::IDLE,
    };

    /// Takes the ray into an instance; `false` where it surely meets nothing before `cull_t` there.
    #[inline(always)]
    pub fn enter(
        &mut self,
        tlas: &Tlas,
        instance: u32,
        bvh: Option<&WideBvh>,
        trace: &TraceRay,
        cull_t: f32,
    ) -> bool {
        self.instance = instance;
        self.has_object_ray = false;
        self.has_block_ray = false;
        self.is_well_scaled = false;
        let entered = match (bvh, tlas.transform(instance)) {
            (Some(bvh), Placed::InWorld) => {
                self.ray_space = RaySpace::World;
                self.is_well_scaled = self.trav_ray.set_world_space(&trace.ray, bvh.scale());
                self.is_well_scaled
            }
            (Some(bvh), Placed::Still(transform)) => self.enter_approximately(transform, bvh, &trace.ray),
            _ => false,
        };
        entered || self.enter_prepared(tlas, bvh, trace, cull_t)
    }

    /// The same in f32 with bounds; `false` where that is not enough.
    #[inline(never)]
    fn enter_approximately(&mut self, transform: &Transform, bvh: &WideBvh, ray: &Ray) -> bool {
        let Some(approximate_ray) = transform.approximate(ray) else { return false };
        self.ray_space = RaySpace::Approximate;
        self.approximate_ray = approximate_ray;
        self.trav_ray.set_approximate(&approximate_ray, ray.t_min, bvh.scale())
    }

    /// The same where the ray in object space must be known.
    #[inline(never)]
    fn enter_prepared(&mut self, tlas: &Tlas, bvh: Option<&WideBvh>, trace: &TraceRay, cull_t: f32) -> bool {
        self.ray_space = RaySpace::Object;
        self.has_object_ray =
            tlas.set_object_ray(self.instance, &trace.ray, trace.time, &mut self.object_ray);
        if !self.has_object_ray {
            return false;
        }
        let Some(bvh) = bvh else {
            // Blocks are dropped all the same.
            self.prepare_culling(tlas, trace);
            return true;
        };
        let trav_ray = TravRay::new(&self.object_ray, cull_t, bvh.bounds(), bvh.scale());
        trav_ray.map(|trav_ray| self.trav_ray = trav_ray).is_some()
    }

    /// Finds out how the ray comes to an instance's blocks.
    #[inline(always)]
    fn prepare_culling(&mut self, tlas: &Tlas, trace: &TraceRay) {
        self.ray_space = match tlas.transform(self.instance) {
            Placed::InWorld => RaySpace::World,
            Placed::Still(transform) => match transform.approximate(&trace.ray) {
                Some(ray) => {
                    self.approximate_ray = ray;
                    RaySpace::Approximate
                }
                None => RaySpace::Object,
            },
            Placed::Moving => RaySpace::Object,
        };
    }

    /// Takes the ray into an instance whose boxes it does not test here.
    #[inline(always)]
    pub fn arrive(&mut self, tlas: &Tlas, instance: u32, built: &BuiltBlas, trace: &TraceRay) {
        self.instance = instance;
        self.has_object_ray = false;
        self.is_well_scaled = false;
        self.has_block_ray = false;
        if !built.tests_leaves(tlas.precision()) && built.drops() != Drops::Never {
            self.prepare_culling(tlas, trace);
        }
    }

    /// The ray for all primitives of a leaf at once.
    #[inline(always)]
    pub fn for_leaf<'a>(&'a mut self, tlas: &'a Tlas, trace: &'a TraceRay) -> ForLeaf<'a> {
        ForLeaf { instance_ray: self, tlas, trace }
    }

    /// The ray in object space.
    #[inline(always)]
    pub fn object_ray(&mut self, tlas: &Tlas, trace: &TraceRay) -> &ObjectRay {
        if !self.has_object_ray {
            // A ray that is not finite or an instance without inverse was refused before.
            tlas.set_object_ray(self.instance, &trace.ray, trace.time, &mut self.object_ray);
            self.has_object_ray = true;
        }
        &self.object_ray
    }

    /// A bit for each of a leaf's primitives that the ray may meet: [`BuiltBlas::met`].
    #[inline(always)]
    pub fn met<F: FmaOps, const CLOSELY: bool>(
        &mut self,
        simd: F,
        tlas: &Tlas,
        built: &BuiltBlas,
        leaf: NodeRef,
        trace: &TraceRay,
    ) -> u32 {
        if !self.has_block_ray {
            self.has_block_ray = true;
            self.make_block_ray(tlas, built, trace);
        }
        if self.drops {
            built.met::<F, CLOSELY>(simd, leaf, (&self.block_ray, &self.sheared_ray))
        } else {
            built.full_mask(leaf)
        }
    }

    #[inline(always)]
    fn make_block_ray(&mut self, tlas: &Tlas, built: &BuiltBlas, trace: &TraceRay) {
        let drops = built.drops();
        if drops == Drops::Never {
            self.drops = false;
            return;
        }
        if built.has_triangles() {
            let ray = self.sheared_ray_for(built, trace);
            self.drops = ray.is_some();
            self.sheared_ray = ray.unwrap_or(ShearedRay::IDLE);
            return;
        }
        let ray = match self.ray_space {
            RaySpace::World => BlockRay::world_space(&trace.ray, built.bounds()),
            RaySpace::Approximate => BlockRay::approximate(&self.approximate_ray, built.bounds()),
            RaySpace::Object => None,
        };
        self.drops = ray.is_some() || drops == Drops::Always;
        if let Some(ray) = ray {
            self.block_ray = ray;
        } else if self.drops {
            self.block_ray = BlockRay::new(self.object_ray(tlas, trace), built.bounds());
        }
    }

    /// The ray for blocks of triangles, where there is a simple one.
    #[inline(always)]
    fn sheared_ray_for(&self, built: &BuiltBlas, trace: &TraceRay) -> Option<ShearedRay> {
        let bounds = built.bounds();
        match self.ray_space {
            RaySpace::World => {
                // Of an ordinary ray the tree's scale has said it.
                if self.is_well_scaled {
                    return Some(ShearedRay::well_scaled(&trace.ray));
                }
                if ShearedRay::reaches(bounds) { ShearedRay::world_space(&trace.ray) } else { None }
            }
            RaySpace::Approximate => {
                BlockRay::approximate(&self.approximate_ray, bounds).as_ref().map(ShearedRay::of)
            }
            RaySpace::Object => None,
        }
    }
}

/// The ray of a level, for a leaf.
pub struct ForLeaf<'a> {
    instance_ray: &'a mut InstanceRay,
    tlas: &'a Tlas,
    trace: &'a TraceRay,
}

impl LeafRay for ForLeaf<'_> {
    #[inline(always)]
    fn double<D: F64x4Ops>(&mut self, simd: D) -> DoubleRay<D> {
        if self.instance_ray.is_well_scaled {
            DoubleRay::in_world(simd, &self.trace.ray)
        } else {
            DoubleRay::of(simd, self.object())
        }
    }

    #[inline(always)]
    fn object(&mut self) -> &ObjectRay {
        self.instance_ray.object_ray(self.tlas, self.trace)
    }
}

/// How the ray came into the instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RaySpace {
    /// As a simple ray of the world.
    World,
    /// In f32 with bounds.
    Approximate,
    /// In f64 with bounds.
    Object,
}
