//! Scenes made in Rust.

use std::sync::Arc;

use bytemuck::AnyBitPattern;

use crate::bound;
use crate::device_buffers::DeviceBuffers;
use crate::given::{Given, gives_resources};
use crate::texels::Texels;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::accel::Tlas;
use anyhit_engine::geometry::Precision;
use anyhit_engine::machine::{Descriptor, Resources};

pub use crate::instance::Instance;

/// Instances in an acceleration structure, and what the shaders have bound.
///
/// A scene is a value: launches and rays read it, and what shaders write is in their outcomes.
/// [`Pipeline::launch_mut`](anyhit_engine::pipeline::Pipeline::launch_mut) and
/// [`Pipeline::trace_mut`](anyhit_engine::pipeline::Pipeline::trace_mut) write to the scene, never
/// to its clones.
///
/// ```
/// use anyhit::{Instance, Module, Pipeline, Program, Ray, Scene};
///
/// # fn main() -> anyhit::Result<()> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
/// let folder = "spirv-fixtures/pass/sphere/closest-hit";
/// let shader = |name| Program::of(&Module::open(format!("{folder}/{name}"))?, "main");
/// let pipeline = Pipeline::builder().hit([shader("main.rchit.spv")?])?.miss(shader("main.rmiss.spv")?)?.build()?;
///
/// let scene = Scene::new([
///     Instance::sphere([0.0, 0.0, 0.0], 0.5).translate([0.0, 0.0, -3.0]),
///     Instance::sphere([5.0, 0.0, 0.0], 0.5),
/// ])?;
/// let traced = pipeline.trace(&scene, Ray::new([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]))?;
/// assert_eq!((traced.hit().instance, traced.hit().t), (0, 3.5));
/// assert_eq!(traced.payload["normal"].vec3(), [0.0, 0.0, 1.0]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
#[must_use]
pub struct Scene {
    tlas: Arc<Tlas>,
    pub(super) given: Given,
}

impl Scene {
    /// A scene of these instances; `InstanceId` is their order.
    ///
    /// # Errors
    /// `InvalidScene` for numbers that no geometry or instance may have, all of them at once.
    pub fn new(instances: impl IntoIterator<Item = Instance>) -> Result<Self> {
        let (mut made, mut mistakes) = (Vec::new(), Vec::new());
        for (at, instance) in instances.into_iter().enumerate() {
            match instance.make() {
                Ok(instance) => made.push(instance),
                Err(error) => mistakes.push(error.context(format!("instance {at}"))),
            }
        }
        if !mistakes.is_empty() {
            return Err(Error::several(mistakes));
        }
        let mut given = Given::default();
        given.resources.printed = Some(Arc::default());
        Ok(Self { tlas: Tlas::new(made)?, given })
    }

    /// A scene of an acceleration structure and of what is bound.
    #[doc(hidden)]
    pub fn of_parts(tlas: Arc<Tlas>, mut resources: Resources) -> Self {
        resources.printed.get_or_insert_default();
        let mut given = Given::default();
        given.resources = resources;
        Self { tlas, given }
    }

    /// How intersections are computed; exactly unless set. See [`Precision`].
    ///
    /// ```
    /// use anyhit::{Instance, Precision, Scene};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// let scene = Scene::new([Instance::sphere([0.0; 3], 0.5)])?.precision(Precision::Float);
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn precision(mut self, precision: Precision) -> Self {
        let other = self.tlas.at_precision(precision);
        self.given.resources.replace_structure(&self.tlas, &other);
        Self { tlas: other, ..self }
    }

    /// Binds the scene's own acceleration structure, for shaders that trace.
    #[must_use]
    pub fn bind(self, set: u32, binding: u32) -> Self {
        let tlas = self.tlas.clone();
        self.descriptor(set, binding, Descriptor::AccelerationStructure(tlas))
    }

    /// The acceleration structure.
    #[doc(hidden)]
    pub fn tlas(&self) -> &Arc<Tlas> {
        &self.tlas
    }

    /// What is bound.
    #[doc(hidden)]
    pub fn resources(&self) -> &Resources {
        &self.given.resources
    }

    /// Keeps what a run left behind, for the next one.
    pub(super) fn keep(&mut self, left: &Resources) {
        self.given.keep(Resources { printed: Some(Arc::default()), ..left.clone() });
    }

    /// `InstanceCustomIndexKHR` of an instance.
    pub(super) fn custom_index(&self, instance: u32) -> u32 {
        self.tlas.instances().get(instance as usize).map_or(0, |instance| instance.custom_index)
    }

    /// The content of a buffer now, as a row of a plain Rust type.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer is bound there, or its size is no multiple.
    pub fn read_buffer<T: AnyBitPattern>(&self, set: u32, binding: u32) -> Result<Vec<T>> {
        let buffer = self.given.resources.buffer(set, binding).ok_or_else(|| {
            let message = format!("no buffer is bound at set {set}, binding {binding}");
            Error::new(ErrorKind::InvalidArgument, message)
        })?;
        bound::rows(&buffer.bytes())
    }

    /// The buffer at a device address now, as a row of a plain Rust type, from that address on.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer lies there, or its size is no multiple.
    pub fn read_buffer_at<T: AnyBitPattern>(&self, address: u64) -> Result<Vec<T>> {
        bound::rows(&bound::bytes_at(&self.given.resources, address)?)
    }

    /// The texels of an image now.
    ///
    /// # Errors
    /// `InvalidArgument` where no image is bound there.
    pub fn read_image(&self, set: u32, binding: u32) -> Result<Texels> {
        bound::texels(&self.given.resources, set, binding)
    }
}

gives_resources!(Scene);

impl DeviceBuffers {
    /// Gives an address to the acceleration structure of a scene, for
    /// `OpConvertUToAccelerationStructureKHR`; the one that it has, where it has one.
    #[must_use]
    pub fn structure(&mut self, scene: &Scene) -> u64 {
        self.memory_mut().add_structure(scene.tlas())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mistakes_of_all_instances_are_told_at_once() {
        let lying = Instance::aabbs([[[1.0; 3], [0.0; 3]]]);
        let mixed = Instance::sphere([0.0; 3], 1.0).and(Instance::triangles([[0.0; 3]; 3]));
        let error = Scene::new([lying, mixed]).unwrap_err();
        assert!(error.message().starts_with("instance 0: "), "{error:?}");
        assert!(error.others().iter().any(|other| other.message().starts_with("instance 1: ")), "{error:?}");
    }

    #[test]
    fn another_precision_reaches_what_is_bound() {
        let scene = Scene::new([Instance::sphere([0.0; 3], 1.0)]).unwrap().bind(0, 3);
        let scene = scene.precision(Precision::Float).bind(0, 4);
        assert_eq!(scene.tlas().precision(), Precision::Float);
        for binding in scene.resources().descriptors.values() {
            let [Descriptor::AccelerationStructure(bound)] = &binding[..] else { panic!("{binding:?}") };
            assert!(Arc::ptr_eq(bound, scene.tlas()));
        }
    }
}
