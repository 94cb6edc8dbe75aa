//! One run of a shader on made-up values, for whatever its stage is called for.

use std::sync::Arc;

use crate::smoke::grid::groups;
use crate::smoke::hits::{self, HitPlace, SmokeGeometry};
use crate::smoke::resources::Given;
use crate::smoke::sets::Set;
use crate::smoke::watch::StandIn;
use anyhit_base::error::Result;
use anyhit_engine::accel::TraceRay;
use anyhit_engine::geometry::Ray;
use anyhit_engine::machine::{Invocation, LaunchLimits, LaunchObserver, Observer};
use anyhit_engine::pipeline::group::{Group, HitGroup};
use anyhit_engine::pipeline::{
    Compute, Launch, Pipeline, PipelineObserver, RayOperands, RunOptions, SbtRecord, Trapped,
};
use anyhit_engine::program::Program;

/// Null records of each shader binding table.
const RECORDS: usize = 1024;
/// Bytes of a hit record whose address a shader takes.
const RECORD_SIZE: usize = 256;

/// What a shader is run for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// A launch of a ray generation shader.
    Launch,
    /// A hit of geometry.
    Hit(SmokeGeometry),
    /// A box, for an intersection shader.
    Box,
    /// A ray that hit nothing.
    Miss,
    /// A call.
    Call,
    /// A dispatch of a compute shader.
    Dispatch,
}

impl Way {
    /// Its name in reports.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Launch => "launch",
            Self::Hit(kind) => kind.name(),
            Self::Box => SmokeGeometry::Aabb.name(),
            Self::Miss => "ray",
            Self::Call => "call",
            Self::Dispatch => "dispatch",
        }
    }
}

/// One run.
pub(super) struct Once<'a> {
    /// What the shader is run for.
    pub way: Way,
    /// The shader.
    pub program: &'a Arc<Program>,
    /// What it finds bound.
    pub given: &'a Given,
    /// The values that this is made of.
    pub set: Set,
    /// Invocations of a launch along each axis.
    pub launch_size: [u32; 3],
    /// Instructions that an invocation may execute.
    pub fuel: u64,
    /// The limits of the launch.
    pub limits: LaunchLimits,
}

impl Once<'_> {
    /// Runs the shader, and returns where it trapped.
    ///
    /// # Errors
    /// What the pipeline or the dispatch refuses.
    pub(super) fn run(
        &self,
        stand_in: &mut StandIn<'_>,
        observer: Option<&mut dyn LaunchObserver>,
    ) -> Result<Option<Box<Trapped>>> {
        let &Self { way, program, given, set, launch_size, fuel, limits } = self;
        if let Way::Dispatch = way {
            let compute = Compute::new(program.clone())?.fuel(fuel).launch_limits(limits);
            let groups = groups(&program.module, compute.workgroup_size(), !set.is_single);
            let mut event = |event| stand_in.event(event);
            let ended = match observer {
                None => compute.run_to_trap(&given.resources, groups, RunOptions::default())?,
                Some(one) => compute.run_to_trap_observed(&given.resources, groups, &mut event, one)?,
            };
            return Ok(ended.err());
        }
        let mut builder = Pipeline::builder();
        builder = builder.fuel(fuel).launch_limits(limits);
        let shader = builder.shader(program.clone());
        let data = |group| SbtRecord::with_data(group, &given.record);
        match way {
            Way::Launch => {
                let group = builder.group(Group::General(shader))?;
                builder.sbt().ray_generation = Some(data(group));
            }
            Way::Box => {
                let group = HitGroup { intersection: Some(shader), ..HitGroup::default() };
                let group = builder.group(Group::Hit(group))?;
                builder.sbt().hit.push(Some(data(group)));
            }
            _ => {}
        }
        // A handle of a record needs one: of a group without shaders, so that the stand-in answers.
        let hit = match program.addresses_records {
            true => {
                Some(SbtRecord::with_data(builder.group(Group::Hit(HitGroup::default()))?, &[0; RECORD_SIZE]))
            }
            false => None,
        };
        let sbt = builder.sbt();
        sbt.hit.resize_with(RECORDS, || hit.clone());
        sbt.miss.resize_with(RECORDS, || None);
        sbt.callable.resize_with(RECORDS, || None);
        let pipeline = builder.build()?;
        let launch = Launch { pipeline: &pipeline, resources: &given.resources };
        let place = HitPlace::of(&set, launch_size);
        let mut invocation = Invocation {
            launch_id: place.launch_id,
            launch_size,
            record: SbtRecord::with_data(0, &given.record).shader_record(),
            depth: 1,
            ..Invocation::default()
        };
        let observer = observer.map(|observer| observer as &mut dyn Observer<64>);
        let stand_in = Some(stand_in as &mut dyn PipelineObserver);
        let ended = match way {
            Way::Launch => launch.run_single_threaded(launch_size, stand_in, observer)?,
            Way::Box => {
                let mut operands = RayOperands::from(hits::ray(set.behind));
                (operands.trace.flags, operands.trace.cull_mask) = (place.ray_flags, place.cull_mask);
                launch.trace_single(&hits::one_box(&place)?, operands, stand_in, observer)?
            }
            Way::Hit(kind) => {
                let (hit, trace, t) = kind.hit(set.behind, &place)?;
                (invocation.hit, invocation.trace, invocation.t_max) = (Some(hit), Some(trace), t);
                let attributes = match (&invocation.hit, kind) {
                    (_, SmokeGeometry::Aabb) | (None, _) => given.attributes.clone(),
                    (Some(hit), _) => hit.candidate.intersection.attributes.map(f32::to_bits).to_vec(),
                };
                launch.invoke(shader, invocation, &given.payload, &attributes, stand_in, observer)?
            }
            Way::Miss => {
                let ray = Ray::new([0.25, 0.5, 3.0], [0.6, 0.0, 0.8]).with_interval(0.0, 1000.0);
                let (flags, cull_mask) = (place.ray_flags, place.cull_mask);
                let trace = TraceRay { ray, flags, cull_mask, time: 0.0 };
                (invocation.trace, invocation.t_max) = (Some(trace), ray.t_max);
                launch.invoke(shader, invocation, &given.payload, &[], stand_in, observer)?
            }
            Way::Call | Way::Dispatch => {
                launch.invoke(shader, invocation, &given.payload, &[], stand_in, observer)?
            }
        };
        Ok(ended.err())
    }
}
