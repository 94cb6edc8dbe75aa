//! Scenes made in Rust, and one ray through them.

use std::sync::Arc;

use bytemuck::{AnyBitPattern, NoUninit};

use crate::accel::{
    self, Blas, Committed, EndCaps, Geometry, GeometryData, GeometryFlags, Indexing, InstanceFlags, RayFlags,
    Tlas, TraceRay,
};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Ray;
use crate::harness::layout::{Layout, Rules};
use crate::harness::memory;
use crate::harness::value::Value;
use crate::machine::{Buffer, Descriptor, Resources};
use crate::ops::decode::InterfaceRows;
use crate::ops::pointer::storage;
use crate::pipeline::{Event, Launch, Pipeline, RayOperands, Stats, Witness};
use crate::program::Program;

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Instances in an acceleration structure, and what the shaders have bound.
///
/// ```
/// use anyhit::harness::scene::Instance;
/// use anyhit::{Module, Pipeline, Program, Ray, Scene};
///
/// # fn main() -> anyhit::Result<()> {
/// let folder = "spirv-fixtures/pass/sphere/closest-hit";
/// let shader = |name| Program::of(&Module::open(format!("{folder}/{name}"))?, "main");
/// let mut builder = Pipeline::builder();
/// builder.hit([shader("main.rchit.spv")?])?.miss(shader("main.rmiss.spv")?)?;
/// let pipeline = builder.build()?;
///
/// let scene = Scene::new([
///     Instance::sphere([0.0, 0.0, 0.0], 0.5).translate([0.0, 0.0, -3.0]),
///     Instance::sphere([5.0, 0.0, 0.0], 0.5),
/// ])?;
/// let traced = pipeline.trace(&scene, Ray::new([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]))?;
/// let hit = traced.committed.expect("a hit");
/// assert_eq!((hit.candidate.instance, hit.t), (0, 3.5));
/// assert_eq!(traced.payload["normal"].vec3(), [0.0, 0.0, 1.0]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Scene {
    tlas: Arc<Tlas>,
    resources: Resources,
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
        Ok(Self { tlas: Tlas::new(made)?, resources: Resources::default() })
    }

    /// Binds the scene's own acceleration structure, for shaders that trace.
    #[must_use]
    pub fn bind(self, set: u32, binding: u32) -> Self {
        let tlas = self.tlas.clone();
        self.descriptor(set, binding, Descriptor::AccelerationStructure(tlas))
    }

    /// Binds a storage or uniform buffer with these elements.
    #[must_use]
    pub fn buffer<T: NoUninit>(self, set: u32, binding: u32, elements: &[T]) -> Self {
        let buffer = Buffer::new(bytemuck::cast_slice(elements));
        self.descriptor(set, binding, Descriptor::Buffer(buffer))
    }

    /// Binds any descriptor.
    #[must_use]
    pub fn descriptor(mut self, set: u32, binding: u32, descriptor: Descriptor) -> Self {
        self.resources = self.resources.bind(set, binding, descriptor);
        self
    }

    /// Sets the push constants.
    #[must_use]
    pub fn push_constants<T: NoUninit>(mut self, constants: &T) -> Self {
        self.resources.push_constants = Some(Buffer::new(bytemuck::bytes_of(constants)));
        self
    }

    /// The acceleration structure.
    pub fn tlas(&self) -> &Arc<Tlas> {
        &self.tlas
    }

    /// What is bound.
    pub fn resources(&self) -> &Resources {
        &self.resources
    }

    /// The content of a buffer now, as a row of a plain Rust type.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer is bound there, or its size is no multiple.
    pub fn read_buffer<T: AnyBitPattern>(&self, set: u32, binding: u32) -> Result<Vec<T>> {
        let invalid = |message: String| Error::new(ErrorKind::InvalidArgument, message);
        let buffer = self.resources.buffer(set, binding);
        let buffer =
            buffer.ok_or_else(|| invalid(format!("no buffer is bound at set {set}, binding {binding}")))?;
        let (bytes, size) = (buffer.bytes(), size_of::<T>());
        if size == 0 || !bytes.len().is_multiple_of(size) {
            let name = std::any::type_name::<T>();
            let message = format!("a buffer of {} bytes is no row of `{name}`, of {size}", bytes.len());
            return Err(invalid(message));
        }
        Ok(bytes.chunks_exact(size).map(bytemuck::pod_read_unaligned).collect())
    }
}

/// Geometry of one kind, placed in a [`Scene`].
#[derive(Clone, Debug)]
pub struct Instance {
    geometries: Vec<Geometry>,
    transform: [[f32; 4]; 3],
    custom_index: u32,
    mask: u8,
    sbt_offset: u32,
    flags: InstanceFlags,
}

impl Instance {
    /// Triangles, three vertices each.
    pub fn triangles(vertices: impl Into<Vec<[f32; 3]>>) -> Self {
        Self::of(GeometryData::Triangles { vertices: vertices.into(), indices: None, transform: None })
    }

    /// Boxes for an intersection shader: minimum and maximum each.
    pub fn aabbs(boxes: impl IntoIterator<Item = [[f32; 3]; 2]>) -> Self {
        let flat = |[[a, b, c], [d, e, f]]: [[f32; 3]; 2]| [a, b, c, d, e, f];
        Self::of(GeometryData::Aabbs(boxes.into_iter().map(flat).collect()))
    }

    /// One sphere.
    pub fn sphere(position: [f32; 3], radius: f32) -> Self {
        Self::spheres([(position, radius)])
    }

    /// Spheres: centre and radius each.
    pub fn spheres(spheres: impl IntoIterator<Item = ([f32; 3], f32)>) -> Self {
        let (positions, radii) = spheres.into_iter().unzip();
        Self::of(GeometryData::Spheres { positions, radii, indices: None })
    }

    /// One linear swept sphere with both end caps.
    pub fn lss(positions: [[f32; 3]; 2], radii: [f32; 2]) -> Self {
        Self::of(GeometryData::LinearSweptSpheres {
            positions: positions.to_vec(),
            radii: radii.to_vec(),
            indices: None,
            indexing: Indexing::List,
            end_caps: EndCaps::Chained,
        })
    }

    /// A chain of linear swept spheres through these centres and radii; each segment but the first
    /// has its trailing end cap only.
    pub fn chain(vertices: impl IntoIterator<Item = ([f32; 3], f32)>) -> Self {
        let (positions, radii): (Vec<_>, Vec<_>) = vertices.into_iter().unzip();
        let indices = Some((0..positions.len().saturating_sub(1) as u32).collect());
        Self::of(GeometryData::LinearSweptSpheres {
            positions,
            radii,
            indices,
            indexing: Indexing::Successive,
            end_caps: EndCaps::Chained,
        })
    }

    /// Any geometry.
    pub fn of(data: GeometryData) -> Self {
        Self {
            geometries: vec![Geometry { data, flags: GeometryFlags::default() }],
            transform: IDENTITY,
            custom_index: 0,
            mask: 0xFF,
            sbt_offset: 0,
            flags: InstanceFlags::default(),
        }
    }

    /// Adds the geometries of another instance behind its own: `RayGeometryIndexKHR` counts them.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.geometries.extend(other.geometries);
        self
    }

    /// Makes its geometries opaque: no any-hit shader runs.
    #[must_use]
    pub fn opaque(mut self) -> Self {
        for geometry in &mut self.geometries {
            geometry.flags = GeometryFlags(geometry.flags.0 | GeometryFlags::OPAQUE.0);
        }
        self
    }

    /// Object to world, row-major 3x4 (`VkTransformMatrixKHR`).
    #[must_use]
    pub fn transform(self, transform: [[f32; 4]; 3]) -> Self {
        Self { transform, ..self }
    }

    /// Moves the instance: adds to the last column of its transform.
    #[must_use]
    pub fn translate(mut self, by: [f32; 3]) -> Self {
        for (row, by) in self.transform.iter_mut().zip(by) {
            row[3] += by;
        }
        self
    }

    /// `InstanceCustomIndexKHR`
    #[must_use]
    pub fn custom_index(self, custom_index: u32) -> Self {
        Self { custom_index, ..self }
    }

    /// The mask that rays' cull masks are compared with; 0xFF unless set.
    #[must_use]
    pub fn mask(self, mask: u8) -> Self {
        Self { mask, ..self }
    }

    /// `instanceShaderBindingTableRecordOffset`
    #[must_use]
    pub fn sbt_offset(self, sbt_offset: u32) -> Self {
        Self { sbt_offset, ..self }
    }

    /// Its flags.
    #[must_use]
    pub fn flags(self, flags: InstanceFlags) -> Self {
        Self { flags, ..self }
    }

    fn make(self) -> Result<accel::Instance> {
        Ok(accel::Instance {
            blas: Blas::new(self.geometries)?,
            transform: self.transform,
            custom_index: self.custom_index,
            mask: self.mask,
            sbt_record_offset: self.sbt_offset,
            flags: self.flags,
        })
    }
}

/// A ray without flags, seen by all masks, with SBT offset 0, SBT stride 1 and miss index 0; its
/// payload begins as zeros.
impl From<Ray> for RayOperands {
    fn from(ray: Ray) -> Self {
        Self {
            trace: TraceRay { ray, flags: RayFlags(0), cull_mask: 0xFF },
            sbt_offset: 0,
            sbt_stride: 1,
            miss_index: 0,
            payload: Vec::new(),
        }
    }
}

impl RayOperands {
    /// Sets the ray's flags.
    #[must_use]
    pub fn flags(mut self, flags: RayFlags) -> Self {
        self.trace.flags = flags;
        self
    }

    /// Sets the cull mask.
    #[must_use]
    pub fn cull_mask(mut self, cull_mask: u32) -> Self {
        self.trace.cull_mask = cull_mask;
        self
    }

    /// Sets SBT offset and stride.
    #[must_use]
    pub fn sbt(self, sbt_offset: u32, sbt_stride: u32) -> Self {
        Self { sbt_offset, sbt_stride, ..self }
    }

    /// Sets the miss index.
    #[must_use]
    pub fn miss(self, miss_index: u32) -> Self {
        Self { miss_index, ..self }
    }

    /// Sets the payload from a plain Rust type, whose size is a multiple of four bytes: see
    /// [`layout`](crate::harness::layout) for how its scalars lie.
    #[must_use]
    pub fn payload<T: NoUninit>(self, payload: &T) -> Self {
        let bytes = bytemuck::bytes_of(payload);
        let word = |chunk: &[u8]| {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            u32::from_le_bytes(word)
        };
        Self { payload: bytes.chunks(4).map(word).collect(), ..self }
    }
}

/// What one ray brought back.
#[derive(Clone, Debug)]
pub struct Traced {
    /// The closest hit; `None` for a miss.
    pub committed: Option<Committed>,
    /// The payload, by the names of its members.
    pub payload: Value,
    /// How many shaders ran.
    pub stats: Stats,
}

impl Traced {
    /// The payload as a plain Rust type: see [`layout`](crate::harness::layout).
    ///
    /// # Errors
    /// `InvalidArgument` where the size differs; it shows both types.
    pub fn payload<T: AnyBitPattern>(&self) -> Result<T> {
        self.payload.read()
    }
}

impl Pipeline {
    /// Traces one ray through a scene, without a ray generation shader. Buffers are those of the
    /// scene: what shaders write is seen there afterwards.
    ///
    /// # Errors
    /// `Trap` where a shader misbehaves; `InvalidArgument` for a payload whose size fits no shader,
    /// with both layouts.
    pub fn trace(&self, scene: &Scene, ray: impl Into<RayOperands>) -> Result<Traced> {
        self.trace_watched(scene, ray, &mut ())
    }

    /// The same, with the events that explain it.
    ///
    /// # Errors
    /// As [`Pipeline::trace`].
    pub fn trace_explained(
        &self,
        scene: &Scene,
        ray: impl Into<RayOperands>,
    ) -> Result<(Traced, Vec<Event>)> {
        let mut events = Vec::new();
        let traced = self.trace_watched(scene, ray, &mut events)?;
        Ok((traced, events))
    }

    fn trace_watched(
        &self,
        scene: &Scene,
        ray: impl Into<RayOperands>,
        witness: &mut impl Witness,
    ) -> Result<Traced> {
        let mut operands = ray.into();
        let payload = self
            .programs
            .iter()
            .filter_map(|program| Some((program, program.interface_rows(storage::INCOMING_RAY_PAYLOAD)?)));
        let largest = payload.max_by_key(|(_, rows)| rows.count);
        let words = memory::payload_words(self);
        if operands.payload.is_empty() {
            operands.payload = vec![0; words];
        } else if let Some((program, rows)) = largest
            && operands.payload.len() != words
        {
            let size = operands.payload.len() * 4;
            return Err(layout(program, rows).mismatch("the payload", "the payload given", size));
        }
        let launch = Launch { pipeline: self, resources: &scene.resources };
        let outcome = launch.trace(&scene.tlas, operands, witness)?;
        let bytes: Vec<u8> = outcome.payload.iter().flat_map(|word| word.to_le_bytes()).collect();
        let payload =
            largest.map_or_else(Value::nothing, |(program, rows)| layout(program, rows).read(&bytes));
        Ok(Traced { committed: outcome.committed, payload, stats: outcome.stats })
    }
}

fn layout<'a>(program: &'a Program, rows: &InterfaceRows) -> Layout<'a> {
    Layout::new(&program.module, rows.ty, Rules::Packed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::module::Module;
    use crate::module::interface::Stage;

    fn shader(name: &str) -> Program {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass");
        Program::of(&Module::open(root.join(name)).expect("a fixture"), "main").expect("a supported shader")
    }

    fn structs() -> Pipeline {
        let mut builder = Pipeline::builder();
        builder.hit([shader("payload/structs/main.rchit.spv")]).unwrap();
        builder.miss(shader("payload/structs/main.rmiss.spv")).unwrap();
        builder.build().unwrap()
    }

    /// A floor z = 0 for x < 2.5 and a wall x = 8.
    fn room() -> Scene {
        let floor = [[2.5, -10.0, 0.0], [2.5, 10.0, 0.0], [-20.0, 0.0, 0.0]];
        let wall = [[8.0, -1.0, -1.0], [8.0, 1.0, -1.0], [8.0, 0.0, 2.0]];
        Scene::new([Instance::triangles(floor), Instance::triangles(wall)]).unwrap().bind(0, 0)
    }

    #[test]
    fn a_ray_bounces_and_brings_back_its_payload() {
        let ray = Ray::new([1.0, 0.0, 4.0], [0.0, 0.0, -1.0]);
        let (traced, events) = structs().trace_explained(&room(), ray).unwrap();
        assert_eq!(traced.committed.unwrap().t, 4.0);
        let payload = &traced.payload;
        assert_eq!(payload["depth"].u32(), 2);
        assert_eq!(payload["counts"].ivec::<2>(), [2, 0]);
        assert_eq!(payload["bounces"][1]["at"].vec3(), [8.0, 0.0, 0.0]);
        assert_eq!(payload["bounces"][2]["primitive"].i32(), 0);
        assert_eq!(payload["path"].vec4(), [4.0, 7.0, 0.0, 2.0]);
        // Zeros turned stay zeros.
        assert_eq!(payload["turned"].matrix::<2, 2>(), [[0.0; 2]; 2]);
        assert_eq!(traced.stats.shaders[&Stage::ClosestHit].invocations, 2);
        let traces = events.iter().filter(|event| matches!(event, Event::Trace { .. })).count();
        assert_eq!(traces, 2);
    }

    #[test]
    fn a_payload_of_another_size_is_refused_with_its_layout() {
        let ray = RayOperands::from(Ray::new([1.0, 0.0, 4.0], [0.0, 0.0, -1.0])).payload(&[0u32; 3]);
        let text = structs().trace(&room(), ray).unwrap_err().render();
        // depth 4, three bounces of 16, mat2 16, ivec2 8, four floats 16
        assert!(text.contains("has 12 bytes, the shader's struct Payload 92 bytes"), "{text}");
        assert!(text.contains("68  ivec2 counts"), "{text}");
    }

    #[test]
    fn instances_choose_masks_records_and_order() {
        let near = Instance::sphere([0.0; 3], 0.5).translate([0.0, 0.0, 2.0]).mask(1);
        let scene = Scene::new([Instance::sphere([0.0; 3], 0.5).custom_index(9), near]).unwrap();
        let mut builder = Pipeline::builder();
        builder.hit([shader("sphere/closest-hit/main.rchit.spv")]).unwrap();
        let pipeline = builder.build().unwrap();
        let ray = RayOperands::from(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
        let hit = |ray: RayOperands| pipeline.trace(&scene, ray).unwrap().committed.map(|hit| hit.candidate);
        assert_eq!(hit(ray.clone()).unwrap().instance, 1);
        assert_eq!(hit(ray.clone().cull_mask(2)).unwrap().instance, 0);
        // No hit record 5: nothing runs, but the hit counts.
        let traced = pipeline.trace(&scene, ray.sbt(5, 1)).unwrap();
        assert!(traced.committed.is_some() && traced.stats.shaders.is_empty());
    }

    #[test]
    fn mistakes_of_all_instances_are_told_at_once() {
        let lying = Instance::aabbs([[[1.0; 3], [0.0; 3]]]);
        let mixed = Instance::sphere([0.0; 3], 1.0).and(Instance::triangles([[0.0; 3]; 3]));
        let error = Scene::new([lying, mixed]).unwrap_err();
        assert!(error.message().starts_with("instance 0: "), "{error:?}");
        assert!(error.others().iter().any(|other| other.message().starts_with("instance 1: ")), "{error:?}");
    }
}
