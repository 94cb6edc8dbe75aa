//! One ray, or a launch, through a scene made in Rust.

use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::AnyBitPattern;
use serde::Serialize;

use crate::bound::{Bound, reads_what_is_bound};
use crate::data::TypedBytes;
use crate::explain::{Explain, Explanation, TracedRay};
use crate::image_views;
use crate::layout_mismatch::mismatch;
use crate::memory;
use crate::rust_layout::RustLayout;
use crate::scene::Scene;
use crate::typed::record_roots;
use crate::value::Value;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::sorted::SortedMap;
use anyhit_engine::accel::{Committed, HitKind};
use anyhit_engine::machine::Resources;
use anyhit_engine::machine::printed::PrintedLine;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::translate::InterfaceRegisters;
use anyhit_engine::pipeline::{
    Band, BandedLaunch, Event, HostScene, Launch, Pipeline, PipelineObserver, RayOperands, RunOptions, Stats,
    StreamedImage,
};
use anyhit_engine::program::Program;
use anyhit_engine::reflect::{Layout, Rules};

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

impl HostScene for Scene {
    type Launched = Launched;
    type Traced = Traced;

    fn launched(&self, pipeline: &Pipeline, size: [u32; 3]) -> Result<Launched> {
        self.check_launch(pipeline, size)?;
        let (pipeline, resources) = memory::copied_for_run(pipeline, self.resources());
        let stats = Launch { pipeline: &pipeline, resources: &resources }.run(size, RunOptions::default())?;
        Ok(launched(&pipeline, resources, stats))
    }

    fn launched_in_bands(
        &self,
        pipeline: &Pipeline,
        [width, height]: [u32; 2],
        image: &StreamedImage,
        mut take: impl FnMut(Band<'_>) -> Result<()> + Send,
    ) -> Result<Launched> {
        self.check_launch(pipeline, [width, height, 1])?;
        let format = |program: &Arc<Program>| image_views::check_format(program, image.binding, image.format);
        pipeline.programs.iter().try_for_each(format)?;
        let (pipeline, resources) = memory::copied_for_run(pipeline, self.resources());
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        let bands = launch
            .bands([width, height, 1], image)
            .map_err(|why| BandedLaunch::cannot_stream(image, &why))?;
        let stats = bands.run(RunOptions::default(), &mut take)?;
        Ok(launched(&pipeline, resources, stats))
    }

    fn traced(&self, pipeline: &Pipeline, ray: RayOperands) -> Result<Traced> {
        self.trace_observed(pipeline, ray, None)
    }

    fn keep_launched(&mut self, launched: &Launched) {
        self.keep(&launched.bound.resources);
    }

    fn keep_traced(&mut self, traced: &Traced) {
        self.keep(&traced.bound.resources);
    }
}

impl Scene {
    /// The pipeline and a scene whose memory [`Scene::trace_in_place`] may write: copies of what
    /// shaders may write, the rest shared.
    #[doc(hidden)]
    #[must_use]
    pub fn copied_for_run(&self, pipeline: &Pipeline) -> (Pipeline, Self) {
        let (pipeline, resources) = memory::copied_for_run(pipeline, self.resources());
        let mut scene = self.clone();
        scene.keep(&resources);
        (pipeline.into_owned(), scene)
    }

    /// Traces one ray as [`Pipeline::trace`] does, in the memory of the scene, whose clones and
    /// outcomes change with it: for many rays, on what [`Scene::copied_for_run`] returns.
    ///
    /// # Errors
    /// As [`Pipeline::trace`].
    #[doc(hidden)]
    pub fn trace_in_place(&self, pipeline: &Pipeline, ray: impl Into<RayOperands>) -> Result<Traced> {
        let operands = self.checked_operands(pipeline, ray.into())?;
        self.trace_on(pipeline, self.resources().clone(), operands, None)
    }

    /// Traces one ray as [`Pipeline::trace`] does, and returns the events that explain it.
    ///
    /// # Errors
    /// As [`Pipeline::trace`].
    #[doc(hidden)]
    pub fn trace_explained(
        &self,
        pipeline: &Pipeline,
        ray: impl Into<RayOperands>,
    ) -> Result<(Traced, Vec<Event>)> {
        let mut events = Vec::new();
        let traced = self.trace_observed(pipeline, ray.into(), Some(&mut events))?;
        Ok((traced, events))
    }

    fn trace_observed(
        &self,
        pipeline: &Pipeline,
        operands: RayOperands,
        pipeline_observer: Option<&mut dyn PipelineObserver>,
    ) -> Result<Traced> {
        let operands = self.checked_operands(pipeline, operands)?;
        let (pipeline, resources) = memory::copied_for_run(pipeline, self.resources());
        self.trace_on(&pipeline, resources, operands, pipeline_observer)
    }

    /// Checks a ray's payload and the scene; a payload that is not given is zeros.
    fn checked_operands(&self, pipeline: &Pipeline, mut operands: RayOperands) -> Result<RayOperands> {
        let words = pipeline.payload_words();
        if operands.payload.is_empty() {
            operands.payload = vec![0; words];
        } else if let Some((program, registers)) = largest_payload(pipeline)
            && operands.payload.len() != words
        {
            let given = RustLayout::untold("the given payload".into(), operands.payload.len() * 4);
            return Err(mismatch(layout(program, registers), "the payload", &given, None));
        }
        operands.trace.flags.check_known().map_err(|message| {
            Error::new(ErrorKind::InvalidArgument, message)
                .note("combine the constants of `RayFlags`: `RayFlags::OPAQUE | RayFlags::SKIP_AABBS`")
        })?;
        self.check(pipeline)?;
        Ok(operands)
    }

    /// Traces a ray on resources, which it may write.
    fn trace_on(
        &self,
        pipeline: &Pipeline,
        resources: Resources,
        operands: RayOperands,
        pipeline_observer: Option<&mut dyn PipelineObserver>,
    ) -> Result<Traced> {
        let launch = Launch { pipeline, resources: &resources };
        let outcome = launch.trace(self.tlas(), operands.clone(), pipeline_observer)?;
        let data = largest_payload(pipeline).map(|(program, registers)| {
            let words = outcome.payload.iter().copied();
            TypedBytes::new(&program.module, registers.ty, "the payload", words)
        });
        let given = self.resources().clone();
        let (own, tlas) = (pipeline.clone(), self.tlas().clone());
        let ray = TracedRay { pipeline: own, tlas, operands, resources: given };
        let explanation = Arc::new(Explanation::Ray(Box::new(ray)));
        let mut payload = data.as_ref().map_or_else(Value::nothing, TypedBytes::value);
        payload.explained_by(&explanation);
        let custom_index = outcome.committed.map_or(0, |hit| self.custom_index(hit.candidate.instance));
        let printed = resources.printed.as_ref().map_or_else(Vec::new, |printed| printed.take());
        Ok(Traced {
            committed: outcome.committed,
            payload,
            stats: outcome.stats,
            printed: printed.into_iter().map(|line| line.text).collect(),
            custom_index,
            data,
            bound: bound(pipeline, resources),
            explanation,
        })
    }

    fn check_launch(&self, pipeline: &Pipeline, size: [u32; 3]) -> Result<()> {
        if size.contains(&0) {
            let message = format!("a launch of {} x {} x {} has no invocations", size[0], size[1], size[2]);
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
        self.check(pipeline)
    }

    /// Checks the pipeline's parts, and compares what the scene's buffers were made from with what
    /// the shaders declare.
    fn check(&self, pipeline: &Pipeline) -> Result<()> {
        pipeline.check_parts()?;
        pipeline.programs.iter().try_for_each(|program| self.given.check(program))
    }
}

/// The largest payload that a shader declares, and that shader.
fn largest_payload(pipeline: &Pipeline) -> Option<(&Arc<Program>, &InterfaceRegisters)> {
    let payloads = pipeline
        .programs
        .iter()
        .filter_map(|program| Some((program, program.interface_registers(storage::INCOMING_RAY_PAYLOAD)?)));
    payloads.max_by_key(|(_, registers)| registers.count)
}

fn launched(pipeline: &Pipeline, resources: Resources, stats: Stats) -> Launched {
    let printed = resources.printed.as_ref().map_or_else(Vec::new, |printed| printed.take());
    Launched { stats, printed, bound: bound(pipeline, resources) }
}

fn bound(pipeline: &Pipeline, resources: Resources) -> Bound {
    let programs = pipeline.programs.clone();
    Bound { programs, resources, roots: record_roots(pipeline), readers: SortedMap::new() }
}

fn layout<'a>(program: &'a Program, registers: &InterfaceRegisters) -> Layout<'a> {
    Layout::new(&program.module, registers.ty, Rules::Packed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instance::Instance;
    use anyhit_engine::accel::Motion;
    use anyhit_engine::geometry::Ray;
    use anyhit_engine::module::Module;
    use anyhit_engine::module::interface::Stage;

    fn shader(name: &str) -> Program {
        let root =
            std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("spirv-fixtures/pass");
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
        let (traced, events) = room().trace_explained(&structs(), ray).unwrap();
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
