//! What only invocations side by side show: that the lanes of a subgroup use different descriptors,
//! say, which must then be `NonUniform`.
//!
//! A launch whose results depend on the order of its invocations, as where a shader uses what an
//! atomic instruction returns, runs them one after the other, so that no two lanes are ever
//! compared. How atomic instructions of different invocations interleave is open, so such a launch
//! runs once more, on copies, with its invocations side by side.

use std::sync::Arc;

use crate::memory;
use anyhit_engine::machine::Resources;
use anyhit_engine::pipeline::{Compute, Launch, Pipeline};
use anyhit_engine::program::Program;
use anyhit_sanitize::rule::uniformity;
use anyhit_sanitize::{Findings, Levels, ProgramPlan, Sanitizer};

/// Instructions that an invocation may execute side by side with others: one that waits for another
/// never gets on.
const FUEL: u64 = 1 << 22;

/// A run whose invocations are to be compared.
#[derive(Debug)]
pub struct SideBySide<'a> {
    plans: &'a [ProgramPlan],
    /// The resources before the run.
    resources: Resources,
}

impl<'a> SideBySide<'a> {
    /// Keeps what a launch or dispatch of programs begins with, where its invocations run one after
    /// the other, and there is something to compare.
    pub fn of(plans: &'a [ProgramPlan], resources: &Resources) -> Option<Self> {
        let programs = || plans.iter().map(|plan| &plan.program);
        let is_needed = programs().any(|program| program.order_dependent)
            && !programs().any(|program| program.uses_subgroups)
            && plans.iter().any(ProgramPlan::compares_lanes);
        is_needed.then(|| Self { plans, resources: memory::copied(resources) })
    }

    /// Runs the launch, and returns what the comparison shows until it ends or traps.
    pub fn launch(self, pipeline: &Pipeline, size: [u32; 3], levels: &Levels) -> Findings {
        let mut pipeline = Pipeline { fuel: pipeline.fuel.min(FUEL), ..pipeline.clone() };
        pipeline.programs.iter_mut().for_each(|program| *program = unordered(program));
        let levels = levels.clone().restricted_to(uniformity::RULES);
        let mut sanitizer =
            Sanitizer::new(self.plans, &levels).of_pipeline(&pipeline).with_resources(&self.resources);
        let launch = Launch { pipeline: &pipeline, resources: &self.resources };
        // The run in order tells of a trap.
        let _ = launch.run_observed(size, &mut |_| (), &mut sanitizer);
        sanitizer.into_findings()
    }

    /// As [`SideBySide::launch`], of a dispatch.
    pub fn dispatch(self, compute: &Compute, groups: [u32; 3], levels: &Levels) -> Findings {
        let mut compute = compute.clone();
        compute.program = unordered(&compute.program);
        compute.fuel = compute.fuel.min(FUEL);
        let levels = levels.clone().restricted_to(uniformity::RULES);
        let mut sanitizer = Sanitizer::new(self.plans, &levels).with_resources(&self.resources);
        let _ = compute.run_observed(&self.resources, groups, &mut |_| (), &mut sanitizer);
        sanitizer.into_findings()
    }
}

/// A program whose invocations may run side by side.
pub fn unordered(program: &Arc<Program>) -> Arc<Program> {
    match program.order_dependent {
        true => Arc::new(Program { order_dependent: false, ..Program::clone(program) }),
        false => program.clone(),
    }
}
