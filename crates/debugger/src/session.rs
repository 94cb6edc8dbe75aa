//! Runs one ray or invocation of a scene and returns its transcript. It uses neither files nor the
//! terminal.

use std::sync::Arc;

use crate::event_log::EventLog;
use crate::memory::Snapshot;
use crate::{command, shell, summary};
use anyhit_base::error::{Error, ErrorKind, ErrorReport, Result};
use anyhit_base::escape;
use anyhit_engine::accel::{RayFlags, Tlas};
use anyhit_engine::geometry::Ray;
use anyhit_engine::machine::{RayQueryEvent, RayQueryStep, Resources};
use anyhit_engine::pipeline::{Event, Launch, Stats, WrittenMemory};
use anyhit_explain::names::Names;
use anyhit_explain::reader::EventReader;
use anyhit_explain::transcript::{LaunchIndex, RunCounts, Transcript, VERSION};
use anyhit_scene::file::{GivenRay, RayEntry};
use anyhit_scene::frame::SingleLaunch;
use anyhit_scene::{Assembled, ResolvedScene, assemble};

/// The ray or invocation to explain.
#[derive(Clone, Debug, PartialEq)]
pub enum ExplainRequest {
    /// The scene's first `[[ray]]`; if there is none, the centre of the launch.
    Default,
    /// The scene's `[[ray]]` of this name.
    Named(String),
    /// The invocation of the ray generation shader at a launch index.
    Pixel([u32; 3]),
    /// A given ray, without ray generation.
    #[doc(hidden)]
    Ray(GivenRay),
    /// A request in a pass of the scene, by its name or number; all others are in the first launch.
    InPass(String, Box<ExplainRequest>),
    /// An invocation of a compute shader.
    Invocation {
        /// Which dispatch of the scene, from 0.
        dispatch: usize,
        /// `GlobalInvocationId`
        id: [u32; 3],
    },
}

/// A pixel: the launch index `[x, y, 0]`.
impl From<[u32; 2]> for ExplainRequest {
    fn from([x, y]: [u32; 2]) -> Self {
        Self::Pixel([x, y, 0])
    }
}

/// A launch index.
impl From<[u32; 3]> for ExplainRequest {
    fn from(launch_id: [u32; 3]) -> Self {
        Self::Pixel(launch_id)
    }
}

/// The name of a `[[ray]]`.
impl From<&str> for ExplainRequest {
    fn from(name: &str) -> Self {
        Self::Named(name.to_owned())
    }
}

/// A ray from the host, without flags, with every bit of the cull mask.
impl From<Ray> for ExplainRequest {
    fn from(ray: Ray) -> Self {
        Self::Ray(ray.into())
    }
}

/// An assembled scene.
#[derive(Debug)]
pub struct Session {
    pub(super) scene: ResolvedScene,
    pub(super) assembled: Assembled,
}

/// The resources at the begin of a pass, from which single rays and invocations of it run.
#[derive(Debug)]
pub struct PassBeginning {
    resources: Resources,
    /// What runs may write: each has a copy of it.
    written: WrittenMemory,
    snapshot: Snapshot,
}

impl Session {
    /// Assembles a scene.
    ///
    /// # Errors
    /// As [`assemble()`].
    pub fn new(scene: ResolvedScene) -> Result<Self> {
        let assembled = assemble(&scene)?;
        Ok(Self::of_assembled(scene, assembled))
    }

    /// A session of a scene that is assembled already.
    pub fn of_assembled(scene: ResolvedScene, mut assembled: Assembled) -> Self {
        assembled.resources.printed = Some(Arc::default());
        Self { scene, assembled }
    }

    /// A session of the same scene with copies of all that shaders may write, for another thread.
    #[must_use]
    pub fn copied(&self) -> Self {
        let resources = &self.assembled.resources;
        let copied = self.assembled.written_memory(resources).copied(resources);
        let resources = Resources { printed: Some(Arc::default()), ..copied };
        Self { scene: self.scene.clone(), assembled: Assembled { resources, ..self.assembled.clone() } }
    }

    /// Runs a ray or an invocation and returns its transcript. A trap is part of the transcript,
    /// and is also returned as an error.
    ///
    /// # Errors
    /// `InvalidArgument` where the request does not fit the scene: a launch index outside the
    /// launch, a ray that breaks a rule, a launch index without a ray generation shader.
    pub fn run(&self, request: &ExplainRequest) -> Result<(Transcript, Option<Error>)> {
        match self.invocation(request)? {
            Some((dispatch, id)) => {
                self.run_before_dispatch(dispatch)?;
                self.run_invocation(dispatch, id, &self.assembled.resources)
            }
            None => self.run_on(request, &self.assembled.resources),
        }
    }

    /// Runs a ray or an invocation of ray generation as [`Session::run`] does, on other resources
    /// than those of the scene, which it may change.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub fn run_on(&self, request: &ExplainRequest, all: &Resources) -> Result<(Transcript, Option<Error>)> {
        let (ray_name, request) = self.resolve(request)?;
        let single = self.assembled.single_launch(request.pass.as_deref())?;
        single.run_before(all)?;
        let snapshot = Snapshot::take(&self.scene, &self.assembled.written_memory(all), all);
        self.run_in(&single, (ray_name, request), all, &snapshot)
    }

    /// Runs the passes before a pass ([`Assembled::single_pass`]) on resources other than those of
    /// the scene: many rays and invocations of that pass begin there.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub fn beginning(&self, pass: Option<&str>, resources: Resources) -> Result<PassBeginning> {
        let number = self.assembled.single_pass(pass)?.number();
        self.assembled.run_before(number, &resources)?;
        let written = self.assembled.written_memory(&resources);
        let snapshot = Snapshot::take(&self.scene, &written, &resources);
        Ok(PassBeginning { resources, written, snapshot })
    }

    /// Runs a ray or an invocation as [`Session::run`] does, from the begin of its pass, which
    /// stays as it is.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub fn run_from(
        &self,
        begin: &PassBeginning,
        request: &ExplainRequest,
    ) -> Result<(Transcript, Option<Error>)> {
        let resources = begin.written.copied(&begin.resources);
        if let Some((dispatch, id)) = self.invocation(request)? {
            return self.run_invocation(dispatch, id, &resources);
        }
        let (ray_name, request) = self.resolve(request)?;
        let single = self.assembled.single_launch(request.pass.as_deref())?;
        self.run_in(&single, (ray_name, request), &resources, &begin.snapshot)
    }

    /// Runs a ray, with its name if it has one, or an invocation, in a pass, on resources that hold
    /// what a snapshot does.
    fn run_in(
        &self,
        single: &SingleLaunch<'_>,
        (ray_name, request): (Option<String>, ResolvedRequest),
        all: &Resources,
        snapshot: &Snapshot,
    ) -> Result<(Transcript, Option<Error>)> {
        let resources = single.resources(all);
        let run = Launch { pipeline: &single.pipeline, resources: &resources };
        // A ray from the host has no launch index.
        let log = |id| EventLog::new(all.printed.clone(), id);
        let (mut log, own) = match request.what {
            SingleRun::Pixel(id) => (log(id), id),
            SingleRun::Ray(_) => (log([0; 3]), [0; 3]),
        };
        let (launch, outcome) = match request.what {
            SingleRun::Pixel(id) => {
                let size = single.size_in(&resources);
                (Some(LaunchIndex { id, size }), run.run_one(id, size, Some(&mut log), None))
            }
            SingleRun::Ray(ray) => {
                let tlas = if let Some((_, tlas)) = self.scene.tlas.first() { tlas } else { Tlas::empty() };
                let operands = ray.operands(&single.pipeline)?;
                (None, run.trace(tlas, operands, Some(&mut log)).map(|outcome| outcome.stats))
            }
        };
        log.look();
        let printed = all.printed.as_ref().map_or_else(Vec::new, |all| all.take());
        let own = printed.iter().filter(|line| line.launch_id == own).map(|line| line.text.clone());
        let (events, own) = log.finish(own);
        let (stats, trap) = match outcome {
            // The other invocations of the subgroup are not part of the transcript.
            Ok(_) if single.pipeline.uses_subgroups() => (count_events(&events), None),
            Ok(stats) => (stats, None),
            Err(error) if error.kind() == ErrorKind::Trap => (count_events(&events), Some(error)),
            Err(error) => return Err(error),
        };
        let names = Names::new(&self.scene, single.index, &single.pipeline).with_memory(&all.memory);
        let root = EventReader::new(&single.pipeline, names, events).with_printed(own).root();
        let Some(root) = root else {
            return Err(Error::new(ErrorKind::InvalidScene, "the ray generation record is a null handle"));
        };
        let id = launch.map(|launch| launch.id);
        let (writes, writes_left_out) =
            snapshot.changes(&self.scene, &single.pipeline, all, &single.pass, id);
        let mut transcript = Transcript {
            version: VERSION,
            scene: escape::path(&self.scene.path).to_string(),
            ray_name,
            pass: single.told(),
            launch,
            summary: Vec::new(),
            hints: Vec::new(),
            dispatch: None,
            root,
            writes,
            writes_left_out,
            printed: printed.into_iter().map(|line| line.text).collect(),
            counts: run_counts(&stats),
            trap: trap.as_ref().map(ErrorReport::of),
            lines_cut: false,
        };
        summary::complete(&mut transcript);
        Ok((transcript, trap))
    }

    /// The scene.
    pub fn scene(&self) -> &ResolvedScene {
        &self.scene
    }

    /// The scene's pipeline and resources.
    pub fn assembled(&self) -> &Assembled {
        &self.assembled
    }

    /// Resolves a request to a launch index or a valid ray, and returns it with the ray's name.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub fn resolve(&self, request: &ExplainRequest) -> Result<(Option<String>, ResolvedRequest)> {
        let (pass, request) = match request {
            ExplainRequest::InPass(pass, request) => (Some(pass), &**request),
            request => (None, request),
        };
        let entry = match request {
            ExplainRequest::Pixel(id) => return Ok((None, self.pixel(pass, *id)?)),
            ExplainRequest::Ray(ray) => {
                let key = ray.pass.as_ref().map(|key| &key.value.0);
                let pass = pass.or(key).cloned();
                return Ok((None, ResolvedRequest { pass, what: SingleRun::Ray(check(ray)?) }));
            }
            ExplainRequest::Named(name) => self.named(name)?,
            ExplainRequest::InPass(..) => return Err(invalid("a request can name only one pass")),
            ExplainRequest::Invocation { .. } => {
                let message = "rounding can be examined for rays and launch indices, not for an invocation of a dispatch";
                let path = shell::word(&self.scene.path.to_string_lossy());
                return Err(invalid(message)
                    .note(format!("help: `anyhit run {path} --shadow` examines whole dispatches")));
            }
            // A pass that is asked for is looked at in its middle, whatever rays the scene has.
            ExplainRequest::Default => match self.scene.rays.first().filter(|_| pass.is_none()) {
                Some(entry) => entry,
                None => {
                    let size = self.assembled.single_launch(pass.map(String::as_str))?.size;
                    return Ok((None, self.pixel(pass, size.map(|side| side / 2))?));
                }
            },
        };
        let own = entry.pass().map(|key| &key.value.0);
        let pass = pass.or(own);
        Ok(match entry {
            RayEntry::Pixel { name, pixel, .. } => {
                let [x, y] = pixel.value;
                (name.clone(), self.pixel(pass, [x, y, 0])?)
            }
            RayEntry::Given(ray) => {
                let what = SingleRun::Ray(check(ray)?);
                (ray.name.clone(), ResolvedRequest { pass: pass.cloned(), what })
            }
        })
    }

    fn named(&self, wanted: &str) -> Result<&RayEntry> {
        let name = |entry: &RayEntry| entry.name().cloned();
        self.scene.rays.iter().find(|entry| name(entry).as_deref() == Some(wanted)).ok_or_else(|| {
            // Numbers that are wrong are told as such.
            if let Err(error) = command::ray(wanted) {
                return error;
            }
            let known: Vec<_> =
                self.scene.rays.iter().filter_map(name).map(|name| format!("\"{name}\"")).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            invalid(format!("\"{wanted}\" is neither six numbers nor the name of a ray of the scene"))
                .note(format!("the scene's named rays: {known}"))
        })
    }

    /// A note with a command that can be run instead; its arguments begin with a space.
    pub(super) fn suggestion(&self, arguments: &str, effect: &str) -> String {
        let path = shell::word(&self.scene.path.to_string_lossy());
        format!("help: `anyhit trace-one-ray {path}{arguments}` {effect}")
    }

    /// A launch index of a pass, which must be inside its launch.
    fn pixel(&self, pass: Option<&String>, id: [u32; 3]) -> Result<ResolvedRequest> {
        let single = self.assembled.single_launch(pass.map(String::as_str))?;
        if single.pipeline.sbt.ray_generation.is_none() {
            let message = "the scene has no ray generation shader, so it has no pixels";
            let ray = self.suggestion(" --ray \"0,0,5 0,0,-1\"", "traces a ray given by its numbers");
            let error = invalid(message).note(ray);
            return Err(match self.scene.dispatches.is_empty() {
                true => error,
                false => error
                    .note(self.suggestion(" --invocation 0,0,0", "explains an invocation of its dispatch")),
            });
        }
        let size = single.size;
        // What a buffer holds is known when the passes before have run.
        let is_known = single.pass.indirect.is_none();
        if !is_known || id.iter().zip(&size).all(|(at, side)| at < side) {
            return Ok(ResolvedRequest { pass: pass.cloned(), what: SingleRun::Pixel(id) });
        }
        let words = |all: [u32; 3]| match all {
            [x, y, 0] => format!("{x},{y}"),
            [x, y, z] => format!("{x},{y},{z}"),
        };
        let last = words(size.map(|side| side - 1));
        Err(invalid(format!(
            "pixel {} is outside the launch of {} x {} x {}",
            words(id),
            size[0],
            size[1],
            size[2]
        ))
        .note(format!("pixels range from 0,0 to {last}")))
    }
}

/// A request that was checked against its scene.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedRequest {
    /// The pass, by its name or number; `None` for the first launch.
    pub pass: Option<String>,
    /// What runs in it.
    pub what: SingleRun,
}

/// A ray, or an invocation of ray generation.
#[derive(Clone, Debug, PartialEq)]
pub enum SingleRun {
    /// A launch index.
    Pixel([u32; 3]),
    /// A valid ray.
    #[doc(hidden)]
    Ray(GivenRay),
}

impl ResolvedRequest {
    /// Resolves a `[[ray]]` of a scene.
    ///
    /// # Errors
    /// As `check`.
    pub fn of(entry: &RayEntry) -> Result<Self> {
        let what = match entry {
            RayEntry::Pixel { pixel, .. } => SingleRun::Pixel([pixel.value[0], pixel.value[1], 0]),
            RayEntry::Given(ray) => SingleRun::Ray(check(ray)?),
        };
        Ok(Self { pass: entry.pass().map(|key| key.value.0.clone()), what })
    }
}

/// Checks a ray against the valid usage of a trace (VUID-RuntimeSpirv-OpTraceRayKHR-06355 to
/// 06358).
pub fn check(ray: &GivenRay) -> Result<GivenRay> {
    let finite = |what: &str, values: &[f32; 3]| match values.iter().position(|value| !value.is_finite()) {
        Some(at) => {
            let axis = ["x", "y", "z"][at];
            Err(invalid(format!("the ray's {what} has {axis} = {}: it must be finite", values[at])))
        }
        None => Ok(()),
    };
    finite("origin", &ray.origin)?;
    finite("direction", &ray.direction)?;
    if ray.direction == [0.0; 3] {
        return Err(invalid("the ray's direction is zero"));
    }
    if !(ray.t_min >= 0.0 && ray.t_min <= ray.t_max) {
        let message = format!(
            "the interval {} to {} must start at 0 or later and must not end before its start",
            ray.t_min, ray.t_max
        );
        return Err(invalid(message).note("VUID-RuntimeSpirv-OpTraceRayKHR-06356 and 06357"));
    }
    if !(0.0..=1.0).contains(&ray.time) {
        let message = format!("the ray's time is {}: it must be from 0 to 1", ray.time);
        return Err(invalid(message).note("VUID-RuntimeSpirv-OpTraceRayMotionNV-06366"));
    }
    RayFlags(ray.flags).check_known().map_err(|message| {
        let names = anyhit_explain::names::all_flags();
        invalid(message).note(format!("the flags are {names}, or the sum of their numbers"))
    })?;
    let exclusive = |bits: u32| (ray.flags & bits).count_ones() <= 1;
    if !(exclusive(1 | 2 | 64 | 128) && exclusive(256 | 16 | 32) && exclusive(256 | 512)) {
        let names = anyhit_explain::names::flags(ray.flags).names.join(", ");
        return Err(invalid(format!("the ray flags {names} exclude each other"))
            .note("SPIR-V allows at most one of OpaqueKHR, NoOpaqueKHR, CullOpaqueKHR, CullNoOpaqueKHR; of SkipTrianglesKHR and the culls by face; of SkipTrianglesKHR and SkipAABBsKHR"));
    }
    Ok(ray.clone())
}

pub(super) fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}

/// Counts rays and shaders of a run from its events, for a run that returned no counts.
pub(super) fn count_events(events: &[Event]) -> Stats {
    let mut stats = Stats::default();
    for event in events {
        match event {
            Event::Trace { trace, .. } => {
                stats.rays += 1;
                stats.zero_directions += u64::from(trace.ray.goes_nowhere());
            }
            Event::RayQuery(RayQueryEvent { step: RayQueryStep::Initialize(_, trace), .. }) => {
                stats.ray_queries += 1;
                stats.zero_directions += u64::from(trace.ray.goes_nowhere());
            }
            Event::Enter { stage, .. } => {
                let entry = stats.shaders.entry(*stage).or_default();
                entry.invocations += 1;
                entry.batches += 1;
            }
            _ => {}
        }
    }
    stats
}

pub(super) fn run_counts(stats: &Stats) -> RunCounts {
    RunCounts {
        rays: stats.rays,
        ray_queries: stats.ray_queries,
        shaders: stats.shaders.iter().map(|(stage, stats)| (stage.name(), stats.invocations)).collect(),
    }
}
