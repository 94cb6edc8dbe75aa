//! One ray, or a launch, through a scene made in Rust.

use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::{AnyBitPattern, NoUninit};

use serde::Serialize;

use crate::accel::{Committed, HitKind, RayFlags, TraceRay};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Ray;
use crate::harness::bound::{Bound, reads_what_is_bound};
use crate::harness::data::{HostBytes, TypedBytes};
use crate::harness::explain::{Explain, Explanation, TracedRay};
use crate::harness::image_views;
use crate::harness::layout::{Layout, Rules};
use crate::harness::memory;
use crate::harness::rust_layout::RustLayout;
use crate::harness::scene::Scene;
use crate::harness::typed::record_roots;
use crate::harness::value::Value;
use crate::machine::Resources;
use crate::machine::printed::PrintedLine;
use crate::ops::pointer::storage;
use crate::ops::translate::InterfaceRegisters;
use crate::pipeline::{
    Band, BandedLaunch, Event, Launch, Pipeline, PipelineObserver, RayOperands, Stats, StreamedImage,
};
use crate::program::Program;
use crate::sorted::SortedMap;

/// A ray without flags, seen by all masks, with SBT offset 0, SBT stride 1 and miss index 0; its
/// payload begins as zeros.
impl From<Ray> for RayOperands {
    fn from(ray: Ray) -> Self {
        Self {
            trace: TraceRay { ray, flags: RayFlags(0), cull_mask: 0xFF, time: 0.0 },
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

    /// Sets the time, from 0 to 1: where an instance that moves is met.
    #[must_use]
    pub fn time(mut self, time: f32) -> Self {
        self.trace.time = time;
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
    /// `docs/testing.md`, "Reading values", for how its scalars lie.
    #[must_use]
    pub fn payload<T: NoUninit + Debug>(self, payload: &T) -> Self {
        let word = |chunk: &[u8]| {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            u32::from_le_bytes(word)
        };
        Self { payload: HostBytes::of(payload).bytes.chunks(4).map(word).collect(), ..self }
    }
}

/// The closest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
#[must_use]
pub struct HitRecord {
    /// `InstanceId`
    pub instance: u32,
    /// `InstanceCustomIndexKHR`
    pub custom_index: u32,
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
    /// `RayTmaxKHR` of the closest-hit shader; of a box, what its intersection shader reported.
    pub t: f32,
    /// `HitKindKHR`
    pub kind: HitKind,
    /// The barycentrics of a triangle's second and third vertex; u of a linear swept sphere, then
    /// 0.
    pub attributes: [f32; 2],
    /// Whether no any-hit shader was asked.
    pub opaque: bool,
}

impl HitRecord {
    pub(super) fn of(committed: &Committed, custom_index: u32) -> Self {
        let Committed { candidate, t, hit_kind } = committed;
        Self {
            instance: candidate.instance,
            custom_index,
            geometry: candidate.geometry,
            primitive: candidate.primitive,
            t: *t,
            kind: *hit_kind,
            attributes: candidate.intersection.attributes,
            opaque: candidate.opaque,
        }
    }
}

/// What one ray brought back.
#[derive(Clone, Debug)]
#[non_exhaustive]
#[must_use]
pub struct Traced {
    /// The closest hit as the traversal keeps it; `None` for a miss. See [`Traced::hit`].
    #[doc(hidden)]
    pub committed: Option<Committed>,
    /// The payload, by the names of its members.
    pub payload: Value,
    /// How many shaders ran.
    pub stats: Stats,
    /// What its shaders printed (`debugPrintfEXT`).
    pub printed: Vec<String>,
    custom_index: u32,
    pub(super) data: Option<TypedBytes>,
    pub(super) bound: Bound,
    explanation: Arc<Explanation>,
}

impl Traced {
    /// The payload as a plain Rust type: see `docs/testing.md`, "Reading values".
    ///
    /// # Errors
    /// `InvalidArgument` where size or types differ; it shows both layouts.
    pub fn payload<T: AnyBitPattern + Debug>(&self) -> Result<T> {
        match &self.data {
            Some(data) => data.read(),
            None => self.payload.read(),
        }
    }

    /// Whether the ray hit nothing.
    #[must_use]
    pub fn missed(&self) -> bool {
        self.committed.is_none()
    }

    /// The closest hit.
    ///
    /// # Panics
    /// Where the ray missed; the message explains the ray.
    #[track_caller]
    #[must_use]
    pub fn hit(&self) -> HitRecord {
        let Some(committed) = &self.committed else {
            panic!("the ray hit nothing\n\n{}", self.explain());
        };
        HitRecord::of(committed, self.custom_index)
    }
}

reads_what_is_bound!(Traced);

impl Explain for Traced {
    fn explain(&self) -> String {
        self.explanation.text()
    }
}

/// What a launch left behind. Serde writes counts and printed lines.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
#[must_use]
pub struct Launched {
    /// How many rays were traced and shaders run.
    pub stats: Stats,
    /// What shaders printed (`debugPrintfEXT`), in launch order.
    pub printed: Vec<PrintedLine>,
    #[serde(skip)]
    pub(super) bound: Bound,
}

reads_what_is_bound!(Launched);

impl Pipeline {
    /// Runs the ray generation shader over a grid of (width, height, depth). What shaders write is
    /// in what is returned; the scene does not change and can be launched again, by several
    /// threads at once, too. Buffers and images that no shader can write are not copied.
    /// [`Pipeline::launch_mut`] writes to the scene.
    ///
    /// ```
    /// use anyhit::{Module, Pipeline, Program, Scene};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// let module = Module::open("spirv-fixtures/pass/arithmetic/elementary/main.rgen.spv")?;
    /// let pipeline = Pipeline::builder().ray_generation(Program::of(&module, "main")?)?.build()?;
    /// let inputs = [[4.0f32, 0.0, 0.0, 0.0], [9.0, 0.0, 0.0, 0.0]];
    /// let scene = Scene::new([])?.buffer(0, 2, &inputs).buffer(0, 1, &[[0.0f32; 4]; 16]);
    ///
    /// let launched = pipeline.launch(&scene, [2, 1, 1])?;
    /// let outputs = launched.buffer(0, 1)?;
    /// assert_eq!(outputs["outputs"][1][3]["w"].f32(), 9.0);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// All threads of rayon's pool run it. In a process that was forked after a launch, which has
    /// none of them, the calling thread does; the results are the same.
    ///
    /// # Errors
    /// `Trap`, that of the lowest launch index, where a shader misbehaves; `InvalidScene` without a
    /// ray generation shader; `InvalidArgument` for a grid without or with too many invocations,
    /// and for a buffer whose size, or an image whose format, is not the shaders', with both.
    pub fn launch(&self, scene: &Scene, size: [u32; 3]) -> Result<Launched> {
        self.check_launch(scene, size)?;
        let (pipeline, resources) = memory::copied_for_run(self, scene.resources());
        let stats = Launch { pipeline: &pipeline, resources: &resources }.run::<64>(size, &|_| ())?;
        Ok(pipeline.launched(resources, stats))
    }

    /// Runs the ray generation shader as [`Pipeline::launch`] does, and leaves in the scene what
    /// shaders write: the next launch finds it. Clones of the scene, and outcomes of earlier
    /// launches, do not change.
    ///
    /// ```
    /// use anyhit::{Module, Pipeline, Program, Scene};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// // Each invocation adds its index, counted from 1, to its number.
    /// let module = Module::open("spirv-fixtures/pass/harness/conversions/accumulate.rgen.spv")?;
    /// let pipeline = Pipeline::builder().ray_generation(Program::of(&module, "main")?)?.build()?;
    /// # let picture = anyhit::Image::plane(anyhit::Format::new(anyhit::Component::Uint32, 1), 2, 1)?;
    /// let mut scene = Scene::new([])?.buffer(0, 0, &[10u32, 20]).image(0, 1, picture);
    ///
    /// let first = pipeline.launch_mut(&mut scene, [2, 1, 1])?;
    /// pipeline.launch_mut(&mut scene, [2, 1, 1])?;
    /// assert_eq!(scene.read_buffer::<u32>(0, 0)?, [12, 24]);
    /// assert_eq!(first.read_buffer::<u32>(0, 0)?, [11, 22]);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`Pipeline::launch`]; the scene stays as it was then.
    pub fn launch_mut(&self, scene: &mut Scene, size: [u32; 3]) -> Result<Launched> {
        let launched = self.launch(scene, size)?;
        scene.keep(&launched.bound.resources);
        Ok(launched)
    }

    /// Runs the ray generation shader over a grid of (width, height), and hands out the image that
    /// it fills, which is as wide and high, in bands of rows: the top one first, each while the
    /// next is being filled. So the image may be larger than memory. The scene binds everything but
    /// this image. Results are those of [`Pipeline::launch`] with the whole image, bit for bit.
    ///
    /// `examples/bands.rs` shows it.
    ///
    /// # Errors
    /// As [`Pipeline::launch`], and what `take` returns: no further band is handed out then.
    /// `InvalidArgument` where the image must be there as a whole, with the reason: that a shader
    /// may reach other rows of it than that of its launch index (or the same counted from the last
    /// one), or that it is not known not to.
    pub fn launch_bands(
        &self,
        scene: &Scene,
        [width, height]: [u32; 2],
        image: &StreamedImage,
        take: impl FnMut(Band<'_>) -> Result<()> + Send,
    ) -> Result<Launched> {
        self.check_launch(scene, [width, height, 1])?;
        let format = |program: &Arc<Program>| image_views::check_format(program, image.binding, image.format);
        self.programs.iter().try_for_each(format)?;
        let (pipeline, resources) = memory::copied_for_run(self, scene.resources());
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        let bands = launch
            .bands([width, height, 1], image)
            .map_err(|why| BandedLaunch::cannot_stream(image, &why))?;
        let stats = bands.run::<64>(&|_| (), take)?;
        Ok(pipeline.launched(resources, stats))
    }

    /// Traces one ray through a scene, without a ray generation shader. What shaders write is in
    /// what is returned; the scene does not change. [`Pipeline::trace_mut`] writes to the scene.
    ///
    /// # Errors
    /// `Trap` where a shader misbehaves; `InvalidArgument` for a payload or a buffer whose size
    /// fits no shader, or an image of another format than declared, with both, and for a ray that
    /// breaks a rule, with its VUID, or has unknown flags.
    pub fn trace(&self, scene: &Scene, ray: impl Into<RayOperands>) -> Result<Traced> {
        self.trace_observed(scene, ray.into(), None)
    }

    /// Traces one ray as [`Pipeline::trace`] does, and leaves in the scene what shaders write: the
    /// next ray finds it.
    ///
    /// # Errors
    /// As [`Pipeline::trace`]; the scene stays as it was then.
    pub fn trace_mut(&self, scene: &mut Scene, ray: impl Into<RayOperands>) -> Result<Traced> {
        let traced = self.trace(scene, ray)?;
        scene.keep(&traced.bound.resources);
        Ok(traced)
    }

    /// The pipeline and a scene whose memory [`Pipeline::trace_in_place`] may write: copies of what
    /// shaders may write, the rest shared.
    #[doc(hidden)]
    #[must_use]
    pub fn copied_for_run(&self, scene: &Scene) -> (Self, Scene) {
        let (pipeline, resources) = memory::copied_for_run(self, scene.resources());
        let mut scene = scene.clone();
        scene.keep(&resources);
        (pipeline.into_owned(), scene)
    }

    /// Traces one ray as [`Pipeline::trace`] does, in the memory of the scene, whose clones and
    /// outcomes change with it: for many rays, on what [`Pipeline::copied_for_run`] returns.
    ///
    /// # Errors
    /// As [`Pipeline::trace`].
    #[doc(hidden)]
    pub fn trace_in_place(&self, scene: &Scene, ray: impl Into<RayOperands>) -> Result<Traced> {
        let operands = self.checked_operands(scene, ray.into())?;
        self.trace_on(scene, scene.resources().clone(), operands, None)
    }

    /// Traces one ray as [`Pipeline::trace`] does, and returns the events that explain it.
    ///
    /// # Errors
    /// As [`Pipeline::trace`].
    #[doc(hidden)]
    pub fn trace_explained(
        &self,
        scene: &Scene,
        ray: impl Into<RayOperands>,
    ) -> Result<(Traced, Vec<Event>)> {
        let mut events = Vec::new();
        let traced = self.trace_observed(scene, ray.into(), Some(&mut events))?;
        Ok((traced, events))
    }

    fn trace_observed(
        &self,
        scene: &Scene,
        operands: RayOperands,
        pipeline_observer: Option<&mut dyn PipelineObserver>,
    ) -> Result<Traced> {
        let operands = self.checked_operands(scene, operands)?;
        let (pipeline, resources) = memory::copied_for_run(self, scene.resources());
        pipeline.trace_on(scene, resources, operands, pipeline_observer)
    }

    /// The largest payload that a shader declares, and that shader.
    fn largest_payload(&self) -> Option<(&Arc<Program>, &InterfaceRegisters)> {
        let payloads = self.programs.iter().filter_map(|program| {
            Some((program, program.interface_registers(storage::INCOMING_RAY_PAYLOAD)?))
        });
        payloads.max_by_key(|(_, registers)| registers.count)
    }

    /// Checks a ray's payload and the scene; a payload that is not given is zeros.
    fn checked_operands(&self, scene: &Scene, mut operands: RayOperands) -> Result<RayOperands> {
        let words = self.payload_words();
        if operands.payload.is_empty() {
            operands.payload = vec![0; words];
        } else if let Some((program, registers)) = self.largest_payload()
            && operands.payload.len() != words
        {
            let given = RustLayout::untold("the given payload".into(), operands.payload.len() * 4);
            return Err(layout(program, registers).mismatch("the payload", &given, None));
        }
        operands.trace.flags.check_known().map_err(|message| {
            Error::new(ErrorKind::InvalidArgument, message)
                .note("combine the constants of `RayFlags`: `RayFlags::OPAQUE | RayFlags::SKIP_AABBS`")
        })?;
        self.check(scene)?;
        Ok(operands)
    }

    /// Traces a ray on resources, which it may write.
    fn trace_on(
        &self,
        scene: &Scene,
        resources: Resources,
        operands: RayOperands,
        pipeline_observer: Option<&mut dyn PipelineObserver>,
    ) -> Result<Traced> {
        let launch = Launch { pipeline: self, resources: &resources };
        let outcome = launch.trace(scene.tlas(), operands.clone(), pipeline_observer)?;
        let data = self.largest_payload().map(|(program, registers)| {
            let words = outcome.payload.iter().copied();
            TypedBytes::new(&program.module, registers.ty, "the payload", words)
        });
        let given = scene.resources().clone();
        let (pipeline, tlas) = (self.clone(), scene.tlas().clone());
        let ray = TracedRay { pipeline, tlas, operands, resources: given };
        let explanation = Arc::new(Explanation::Ray(Box::new(ray)));
        let mut payload = data.as_ref().map_or_else(Value::nothing, TypedBytes::value);
        payload.explained_by(&explanation);
        let custom_index = outcome.committed.map_or(0, |hit| scene.custom_index(hit.candidate.instance));
        let printed = resources.printed.as_ref().map_or_else(Vec::new, |printed| printed.take());
        Ok(Traced {
            committed: outcome.committed,
            payload,
            stats: outcome.stats,
            printed: printed.into_iter().map(|line| line.text).collect(),
            custom_index,
            data,
            bound: self.bound(resources),
            explanation,
        })
    }

    fn check_launch(&self, scene: &Scene, size: [u32; 3]) -> Result<()> {
        if size.contains(&0) {
            let message = format!("a launch of {} x {} x {} has no invocations", size[0], size[1], size[2]);
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
        self.check(scene)
    }

    fn launched(&self, resources: Resources, stats: Stats) -> Launched {
        let printed = resources.printed.as_ref().map_or_else(Vec::new, |printed| printed.take());
        Launched { stats, printed, bound: self.bound(resources) }
    }

    /// Checks the pipeline's parts, and compares what the scene's buffers were made from with what
    /// the shaders declare.
    fn check(&self, scene: &Scene) -> Result<()> {
        self.check_parts()?;
        self.programs.iter().try_for_each(|program| scene.given.check(program))
    }

    fn bound(&self, resources: Resources) -> Bound {
        let programs = self.programs.clone();
        Bound { programs, resources, roots: record_roots(self), readers: SortedMap::new() }
    }
}

fn layout<'a>(program: &'a Program, registers: &InterfaceRegisters) -> Layout<'a> {
    Layout::new(&program.module, registers.ty, Rules::Packed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Motion;
    use crate::harness::instance::Instance;
    use crate::module::Module;
    use crate::module::interface::Stage;

    fn shader(name: &str) -> Program {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass");
        Program::of(&Module::open(root.join(name)).expect("a fixture"), "main").expect("a supported shader")
    }

    fn structs() -> Pipeline {
        let mut builder = Pipeline::builder();
        builder = builder.hit([shader("payload/structs/main.rchit.spv")]).unwrap();
        builder = builder.miss(shader("payload/structs/main.rmiss.spv")).unwrap();
        builder.build().unwrap()
    }

    /// A floor z = 0 for x < 2.5 and a wall x = 8.
    fn room() -> Scene {
        let floor = [[2.5, -10.0, 0.0], [2.5, 10.0, 0.0], [-20.0, 0.0, 0.0]];
        let wall = [[8.0, -1.0, -1.0], [8.0, 1.0, -1.0], [8.0, 0.0, 2.0]];
        Scene::new([Instance::triangles(floor), Instance::triangles(wall)]).unwrap().bind(0, 0)
    }

    #[test]
    fn a_buffer_of_another_size_is_told_with_both_layouts() {
        let mut builder = Pipeline::builder();
        builder = builder.ray_generation(shader("arithmetic/elementary/main.rgen.spv")).unwrap();
        let scene = Scene::new([]).unwrap().buffer(0, 2, &[[4.0f32; 4]]).buffer(0, 1, &[0.0f32; 3]);
        let error = builder.build().unwrap().launch(&scene, [1, 1, 1]).unwrap_err().render();
        assert!(error.contains("buffer 1 of set 0: `[f32; 3]` has 12 bytes"), "{error}");
        assert!(error.contains("in the shader"), "{error}");
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
        assert!(text.contains("has 12 bytes, but the shader's struct Payload has 92 bytes"), "{text}");
        assert!(text.contains("68  ivec2 counts"), "{text}");
    }

    #[test]
    fn what_moves_is_met_at_the_time_of_the_ray() {
        let moved = |z: f32| [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, z]];
        let sphere = Instance::sphere([0.0; 3], 0.5).motion(Motion::Matrix([moved(0.0), moved(-4.0)]));
        let triangle = |z: f32| [[4.0, -1.0, z], [6.0, -1.0, z], [5.0, 1.0, z]];
        let triangle = Instance::triangle(triangle(0.0)).vertices_t1(triangle(2.0)).opaque();
        let scene = Scene::new([sphere, triangle]).unwrap();
        let pipeline = Pipeline::builder().build().unwrap();
        let t = |x: f32, time: f32| {
            let ray = RayOperands::from(Ray::new([x, 0.0, 4.0], [0.0, 0.0, -1.0])).time(time);
            pipeline.trace(&scene, ray).unwrap().committed.map(|hit| hit.t)
        };
        // The sphere's upper end is at 1/2 - 4 time, the triangle at 2 time.
        assert_eq!([t(0.0, 0.0), t(0.0, 0.25), t(0.0, 1.0)], [Some(3.5), Some(4.5), Some(7.5)]);
        assert_eq!([t(5.0, 0.0), t(5.0, 0.25), t(5.0, 1.0)], [Some(4.0), Some(3.5), Some(2.0)]);
    }

    #[test]
    fn instances_choose_masks_records_and_order() {
        let near = Instance::sphere([0.0; 3], 0.5).translate([0.0, 0.0, 2.0]).mask(1);
        let scene = Scene::new([Instance::sphere([0.0; 3], 0.5).custom_index(9), near]).unwrap();
        let pipeline =
            Pipeline::builder().hit([shader("sphere/closest-hit/main.rchit.spv")]).unwrap().build().unwrap();
        let ray = RayOperands::from(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
        let hit = |ray: RayOperands| pipeline.trace(&scene, ray).unwrap().committed.map(|hit| hit.candidate);
        assert_eq!(hit(ray.clone()).unwrap().instance, 1);
        assert_eq!(hit(ray.clone().cull_mask(2)).unwrap().instance, 0);
    }

    #[test]
    fn a_record_beyond_its_table_traps_and_without_a_table_nothing_runs() {
        let scene = Scene::new([Instance::sphere([0.0; 3], 0.5)]).unwrap();
        let hits = RayOperands::from(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
        let misses = RayOperands::from(Ray::new([9.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
        let mut builder = Pipeline::builder();
        let without = builder.clone().build().unwrap();
        builder = builder.hit([shader("sphere/closest-hit/main.rchit.spv")]).unwrap();
        builder = builder.miss(shader("sphere/closest-hit/main.rmiss.spv")).unwrap();
        let pipeline = builder.build().unwrap();
        for (ray, code, record) in [
            (hits.sbt(5, 1), "the hit shader binding table has no record", "record 5 (instance offset"),
            (misses.miss(1), "the miss shader binding table has no record", "record 1 (the miss index)"),
        ] {
            assert!(without.trace(&scene, ray.clone()).unwrap().stats.shaders.is_empty());
            let error = pipeline.trace(&scene, ray).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Trap);
            let text = error.render();
            for words in [code, record, "of a table with 1 record"] {
                assert!(text.contains(words), "no `{words}` in: {text}");
            }
        }
    }
}
