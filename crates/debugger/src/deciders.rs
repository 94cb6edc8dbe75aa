//! The any-hit and intersection shaders that decided what became of a ray.

use crate::line_recorder::FollowedRuns;
use anyhit_explain::transcript::{Decision, ExitKind, ShaderRun, Step, Trace};
use anyhit_explain::walk::{self, AnyRay};

/// How many runs of shaders are followed for one ray: its hit, and the nearest candidates before it
/// that a shader dropped.
const OF_A_RAY: usize = 2;
/// How many are followed in all.
const OF_ALL: usize = 6;

impl FollowedRuns {
    /// The runs of any-hit and intersection shaders that decided the rays from a step on.
    pub fn of_deciders(root: &Step) -> Self {
        let mut runs = Vec::new();
        for ray in walk::rays(root) {
            if let AnyRay::Trace(trace) = ray {
                deciders(trace).into_iter().for_each(|run| add(run, &mut runs));
            }
        }
        runs.truncate(OF_ALL);
        Self::Only(runs)
    }
}

/// Adds a run and the any-hit shaders of the hits that it reports.
fn add(run: &ShaderRun, runs: &mut Vec<u64>) {
    runs.push(run.run);
    for step in &run.steps {
        if let Step::Shader(called) = step
            && called.shader.stage == "AnyHitKHR"
        {
            runs.push(called.run);
        }
    }
}

/// The shader that accepted the hit, and those that dropped candidates nearer than it, the nearest
/// first.
fn deciders(trace: &Trace) -> Vec<&ShaderRun> {
    let hit = trace.hit.as_ref();
    let is_hit = |one: &&Decision| {
        hit.is_some_and(|hit| {
            [one.instance, one.geometry, one.primitive] == [hit.instance, hit.geometry, hit.primitive]
        })
    };
    let accepted = trace.decisions.iter().rfind(is_hit).and_then(|one| one.shader.as_ref());
    let is_nearer = |one: &&Decision| hit.is_none_or(|hit| one.t.as_f64() <= hit.t.as_f64());
    let dropped = trace.decisions.iter().filter(|one| !is_hit(one)).filter(is_nearer);
    let dropped = dropped.filter_map(|one| one.shader.as_ref().filter(|run| drops(one, run)));
    accepted.into_iter().chain(dropped).take(OF_A_RAY).collect()
}

/// Whether a shader did not accept its candidate.
fn drops(decision: &Decision, run: &ShaderRun) -> bool {
    match decision.is_box {
        true => !run.steps.iter().any(|step| matches!(step, Step::Report { accepted: true, .. })),
        false => matches!(run.exit.how, ExitKind::Ignored | ExitKind::Trapped),
    }
}
