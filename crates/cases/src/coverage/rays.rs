//! Ray-tracing coverage: which hit groups and shaders, outcomes, flags and surfaces rays came to.

use serde::{Deserialize, Serialize};

use anyhit_base::escape;
use anyhit_base::sorted::SortedMap;
use anyhit_engine::accel::{GeometryKind, RecordIndex};
use anyhit_engine::geometry::Surface;
use anyhit_engine::machine::{Exit, RayQueryStep, ShaderIndex};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::{Event, Group, Pipeline};
use anyhit_explain::names::{Names, flags};
use anyhit_scene::ResolvedScene;

/// What rays used of a pipeline, and how often; 0 where they could have and never did.
pub type Use = SortedMap<String, u64>;

/// How often rays came to what.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RayCounts {
    /// Hit groups by the names of their shaders: candidates and closest hits that chose them.
    pub hit_groups: Use,
    /// Miss shaders.
    pub miss: Use,
    /// Callable shaders.
    pub callable: Use,
    /// How any-hit shaders ended; empty where there are none.
    pub any_hit: Use,
    /// What intersection shaders' reports came to; empty where there are none.
    pub reports: Use,
    /// Ray flags, and `none`.
    pub flags: Use,
    /// Closest hits by surface; those that the scenes hold and nothing hit are 0.
    pub surfaces: Use,
    /// Ray flags of ray queries, and `none`.
    pub query_flags: Use,
    /// What ray queries committed, by surface; those that the scenes hold and no query committed
    /// are 0 where there are queries.
    pub query_commits: Use,
    /// By record, until they get their names.
    #[serde(skip)]
    hit_records: SortedMap<RecordIndex, u64>,
    #[serde(skip)]
    miss_records: SortedMap<RecordIndex, u64>,
    #[serde(skip)]
    callables: SortedMap<ShaderIndex, u64>,
}

fn count(of: &mut Use, what: &str) {
    *of.entry(what.to_owned()).or_default() += 1;
}

fn count_flags(of: &mut Use, bits: u32) {
    let names = flags(bits).names;
    if names.is_empty() {
        count(of, "none");
    }
    names.iter().for_each(|name| count(of, name));
}

impl RayCounts {
    pub(super) fn event(&mut self, event: &Event) {
        match event {
            Event::Trace { trace, .. } => count_flags(&mut self.flags, trace.flags.0),
            Event::RayQuery(event) => match &event.step {
                RayQueryStep::Initialize(_, trace) => count_flags(&mut self.query_flags, trace.flags.0),
                RayQueryStep::Commit(hit) => {
                    count(&mut self.query_commits, surface(hit.candidate.intersection.surface));
                }
                _ => {}
            },
            Event::Candidate { record, .. } => *self.hit_records.entry(*record).or_default() += 1,
            Event::Traversed { committed: Some(hit), record, .. } => {
                *self.hit_records.entry(*record).or_default() += 1;
                count(&mut self.surfaces, surface(hit.candidate.intersection.surface));
            }
            Event::Traversed { committed: None, record, .. } => {
                *self.miss_records.entry(*record).or_default() += 1;
            }
            Event::Enter { shader, stage: Stage::Callable, .. } => {
                *self.callables.entry(*shader).or_default() += 1;
            }
            Event::Leave { stage: Stage::AnyHit, exit, .. } => {
                let how = match exit {
                    Exit::Returned => "accepted",
                    Exit::Ignored => "ignored",
                    Exit::Terminated => "terminated",
                    Exit::Trapped(_) => "trapped",
                };
                count(&mut self.any_hit, how);
            }
            Event::Report { accepted, .. } => {
                count(&mut self.reports, if *accepted { "accepted" } else { "rejected" });
            }
            _ => {}
        }
    }

    /// Gives what was counted with a pipeline its names, and what was never used a zero.
    pub(super) fn name(&mut self, scene: &ResolvedScene, index: Option<usize>, pipeline: &Pipeline) {
        let names = Names::new(scene, index, pipeline);
        let label = |shader: ShaderIndex| {
            let label = names.shader(shader);
            let path = names.module(shader).map(|module| escape::path(&module.path).to_string());
            let path = path.unwrap_or_default();
            if label.entry == "main" { path } else { format!("{path}:{}", label.entry) }
        };
        let records = std::mem::take(&mut self.hit_records);
        for (at, record) in (0..).map(RecordIndex).zip(&pipeline.sbt.hit) {
            let Some(record) = record else { continue };
            let Group::Hit(group) = pipeline.group_of(record) else { continue };
            let shaders = [group.closest_hit, group.any_hit, group.intersection];
            let shaders: Vec<_> = shaders.into_iter().flatten().map(label).collect();
            let count = records.get(&at).copied().unwrap_or(0);
            *self.hit_groups.entry(shaders.join(" + ")).or_default() += count;
        }
        let records = std::mem::take(&mut self.miss_records);
        for (at, record) in (0..).map(RecordIndex).zip(&pipeline.sbt.miss) {
            let Some(record) = record else { continue };
            let Group::General(shader) = pipeline.group_of(record) else { continue };
            *self.miss.entry(label(shader)).or_default() += records.get(&at).copied().unwrap_or(0);
        }
        let callables = std::mem::take(&mut self.callables);
        for (shader, program) in (0..).map(ShaderIndex).zip(&pipeline.programs) {
            let outcomes: &[&str] = match program.stage {
                Stage::Callable => {
                    *self.callable.entry(label(shader)).or_default() +=
                        callables.get(&shader).copied().unwrap_or(0);
                    continue;
                }
                Stage::AnyHit => &["accepted", "ignored", "terminated"],
                Stage::Intersection => &["accepted", "rejected"],
                _ => continue,
            };
            let of = if program.stage == Stage::AnyHit { &mut self.any_hit } else { &mut self.reports };
            for &outcome in outcomes {
                of.entry(outcome.to_owned()).or_default();
            }
        }
    }

    /// Gives the surfaces that a scene holds a zero where nothing came to them.
    pub(super) fn name_surfaces(&mut self, scene: &ResolvedScene) {
        let instances = scene.tlas.iter().flat_map(|(_, tlas)| tlas.instances());
        for kind in instances.filter_map(|instance| instance.blas.kind()) {
            let surfaces: &[Surface] = match kind {
                GeometryKind::Triangles => &[Surface::TriangleFront, Surface::TriangleBack],
                GeometryKind::Aabbs => &[Surface::Aabb],
                GeometryKind::Spheres => &[Surface::Sphere],
                GeometryKind::LinearSweptSpheres => &[Surface::Side, Surface::Cap0, Surface::Cap1],
            };
            for &one in surfaces {
                self.surfaces.entry(surface(one).to_owned()).or_default();
                if !self.query_flags.is_empty() {
                    self.query_commits.entry(surface(one).to_owned()).or_default();
                }
            }
        }
    }

    pub(super) fn add(&mut self, other: Self) {
        let sums = [
            (&mut self.hit_groups, other.hit_groups),
            (&mut self.miss, other.miss),
            (&mut self.callable, other.callable),
            (&mut self.any_hit, other.any_hit),
            (&mut self.reports, other.reports),
            (&mut self.flags, other.flags),
            (&mut self.surfaces, other.surfaces),
            (&mut self.query_flags, other.query_flags),
            (&mut self.query_commits, other.query_commits),
        ];
        for (sum, other) in sums {
            for (what, count) in other {
                let known = sum.entry(what).or_default();
                *known = known.saturating_add(count);
            }
        }
    }

    /// All that is counted, with a word for each kind.
    pub fn kinds(&self) -> [(&'static str, &Use); 9] {
        [
            ("hit groups", &self.hit_groups),
            ("miss shaders", &self.miss),
            ("callable shaders", &self.callable),
            ("any-hit outcomes", &self.any_hit),
            ("reports", &self.reports),
            ("ray flags", &self.flags),
            ("surfaces", &self.surfaces),
            ("ray-query flags", &self.query_flags),
            ("ray-query commits", &self.query_commits),
        ]
    }
}

fn surface(surface: Surface) -> &'static str {
    match surface {
        Surface::TriangleFront => "triangle, front",
        Surface::TriangleBack => "triangle, back",
        Surface::Aabb => "box",
        Surface::Sphere => "sphere",
        Surface::Side => "linear swept sphere, side",
        Surface::Cap0 => "linear swept sphere, cap 0",
        Surface::Cap1 => "linear swept sphere, cap 1",
    }
}
