//! Lints about rays that follow each other in one invocation: rays that lose the time, and rays
//! that begin on the surface that was hit before.

use std::sync::Arc;

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::structures::{StructureNames, primitive_name};
use crate::surface_point::SurfacePoint;
use anyhit_engine::accel::{Committed, Tlas, TraceRay};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::Event;

/// How many hit points of an invocation are kept.
const MAX_SURFACES: usize = 8;

/// What is wrong with a ray.
#[derive(Clone, Debug)]
pub(super) enum RayLint {
    /// It begins on a surface that was hit.
    FromSurface(SurfacePoint),
    /// It has no time, and the ray that called its shader had this one.
    LosesTime(f32),
}

/// What the rays of one invocation have done.
#[derive(Clone, Debug, Default)]
struct InvocationRays {
    surfaces: SmallVec<[SurfacePoint; 2]>,
    /// The stages of its shaders in progress.
    stages: SmallVec<[Stage; 4]>,
    /// The times of its rays in progress; `None` for a ray without one.
    times: SmallVec<[Option<f32>; 4]>,
    /// The time of the last ray that a hit object recorded.
    recorded_time: Option<f32>,
}

/// What is known of the rays in progress, by launch index.
#[derive(Debug, Default)]
pub(super) struct TraversalLints {
    current: [u32; 3],
    rays: FxHashMap<[u32; 3], InvocationRays>,
}

impl TraversalLints {
    /// The following events belong to this invocation.
    pub(super) fn invocation(&mut self, launch_id: [u32; 3]) {
        self.current = launch_id;
    }

    /// A ray begins; `has_time` says whether its instruction gives it a time.
    pub(super) fn trace(
        &mut self,
        launch_id: [u32; 3],
        tlas: &Arc<Tlas>,
        trace: &TraceRay,
        has_time: bool,
    ) -> SmallVec<[RayLint; 2]> {
        let rays = self.rays.entry(launch_id).or_default();
        let mut found = SmallVec::new();
        let surface = rays.surfaces.iter().rev().find(|point| point.is_origin_of(tlas, trace));
        found.extend(surface.map(|point| RayLint::FromSurface(point.clone())));
        // A closest-hit or miss shader without a ray in progress is executed by a hit object.
        let is_executed = || matches!(rays.stages.last(), Some(Stage::ClosestHit | Stage::Miss));
        let caller_time = match rays.times.last() {
            Some(&time) => time,
            None => rays.recorded_time.filter(|_| is_executed()),
        };
        if !has_time && tlas.moves() {
            found.extend(caller_time.map(RayLint::LosesTime));
        }
        rays.times.push(has_time.then_some(trace.time));
        found
    }

    /// A ray's traversal is over.
    pub(super) fn traversed(
        &mut self,
        launch_id: [u32; 3],
        tlas: &Arc<Tlas>,
        trace: &TraceRay,
        committed: Option<&Committed>,
        to_hit_object: bool,
    ) {
        let rays = self.rays.entry(launch_id).or_default();
        if to_hit_object {
            rays.recorded_time = rays.times.last().copied().flatten();
        }
        if let Some(committed) = committed {
            if rays.surfaces.len() == MAX_SURFACES {
                rays.surfaces.remove(0);
            }
            let hit = committed.candidate.hit_primitive();
            rays.surfaces.push(SurfacePoint::new(tlas, trace, hit, committed.t));
        }
    }

    /// A ray and its shaders have ended.
    pub(super) fn traced(&mut self, launch_id: [u32; 3]) {
        if let Some(rays) = self.rays.get_mut(&launch_id) {
            rays.times.pop();
        }
    }

    /// A shader of the current invocation begins or ends.
    pub(super) fn shader(&mut self, event: &Event) {
        match event {
            Event::Enter { stage, .. } => self.rays.entry(self.current).or_default().stages.push(*stage),
            Event::Leave { stage: Stage::RayGeneration, .. } => {
                self.rays.remove(&self.current);
            }
            Event::Leave { .. } => {
                if let Some(rays) = self.rays.get_mut(&self.current) {
                    rays.stages.pop();
                }
            }
            _ => {}
        }
    }
}

impl RayLint {
    /// The message and the notes of a report.
    pub(super) fn words(&self, names: &dyn StructureNames, tlas: &Arc<Tlas>) -> (String, Vec<String>) {
        match self {
            Self::FromSurface(point) => {
                let primitive = primitive_name(names, tlas, point.hit);
                (
                    "a ray begins on the surface that the ray before hit, with a t_min of 0".to_owned(),
                    vec![format!("the surface is {primitive}")],
                )
            }
            Self::LosesTime(time) => (
                format!("a ray has no time, where the ray that called its shader has {time:?}"),
                vec!["it sees the moving geometry at time 0".to_owned()],
            ),
        }
    }
}
