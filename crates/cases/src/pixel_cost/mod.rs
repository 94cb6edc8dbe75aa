//! Cost of each pixel of a launch or dispatch, and of source lines.
//!
//! A launch runs under observers, on all threads where it may, and a dispatch on one. Counts depend
//! neither on threads nor on the machine: [`measure`] returns a [`LaunchCost`], which has a
//! [`PixelCost`] for every invocation, and the [`CallTree`] from which a [`profile`] by source line
//! is made. The shaders write what they would write without observers.
//!
//! Instructions are those of the SPIR-V modules, in every block that the invocation's lane enters,
//! in all shaders that are called for it. Nodes and primitives are of the traversals of its rays
//! and ray queries, each by itself. Divergence is of SPIR-V's subgroups, not of the interpreter's
//! batches. `docs/looking.md` says more.

mod call_tree;
mod counter;
mod heat;
mod plane;
pub mod profile;

pub use call_tree::CallTree;
pub use heat::{Heat, HeatMeasure, worst_pixels};
pub use plane::{InvocationPlane, PlaneKind};

use std::borrow::Cow;

use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::progress::Work;
use anyhit_engine::machine::Resources;
use anyhit_engine::pipeline::{Launch, RunOptions};
use anyhit_scene::Assembled;
use anyhit_scene::frame::SinglePass;

/// The most invocations that a launch may have whose pixels are counted, each of which takes some
/// forty bytes.
const MAX_INVOCATIONS: u64 = 1 << 26;

/// Cost of an invocation of ray generation with all shaders that it calls, or of a compute shader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelCost {
    /// Instructions of the SPIR-V modules.
    pub instructions: u64,
    /// Those of them that ran while another invocation of the subgroup did not run them, too.
    pub divergent: u64,
    /// Nodes of BVHs that were opened.
    pub nodes: u64,
    /// Primitives in the leaves that were reached.
    pub primitives: u64,
    /// Any-hit shaders that ran.
    pub any_hit: u64,
}

/// Cost of a launch or dispatch.
#[derive(Clone, Debug)]
pub struct LaunchCost {
    /// Plane on which the invocations are shown.
    pub plane: InvocationPlane,
    /// Cost of each invocation, by launch index or global invocation ID, x fastest.
    pub pixels: Vec<PixelCost>,
    /// The invocations of a subgroup; `None` where invocations depend on each other's order and so
    /// ran one by one, which says nothing of divergence.
    pub subgroup_size: Option<u32>,
    /// Which shaders ran, called from where.
    pub calls: CallTree,
}

/// Runs the passes of a scene on resources, and counts what one of them costs.
///
/// # Errors
/// The first trap. `InvalidScene` where the scene runs nothing, `UnsupportedModule` for subgroups
/// that are wider than a batch, `InvalidArgument` for too many invocations.
pub fn measure(assembled: &Assembled, single: &SinglePass<'_>, resources: &Resources) -> Result<LaunchCost> {
    check(single)?;
    let _work = Work::new("counting the cost of pixels");
    let mut found = None;
    for (number, pass) in assembled.passes.iter().enumerate() {
        let outcome = if number == single.number() {
            count(assembled, single, resources).map(|cost| found = Some(cost))
        } else {
            assembled.run_pass(pass, resources, RunOptions::default()).map(|_| ())
        };
        outcome.map_err(|error| assembled.in_pass(number, error))?;
    }
    found.ok_or_else(no_launch)
}

/// Runs one pass on resources, and counts what it costs.
fn count(assembled: &Assembled, single: &SinglePass<'_>, resources: &Resources) -> Result<LaunchCost> {
    match single {
        SinglePass::Launch(single) => {
            let resources: Cow<'_, Resources> = single.resources(resources);
            let launch = Launch { pipeline: &single.pipeline, resources: &resources };
            let size = single.size_in(&resources);
            check_count(size)?;
            counter::count(&launch, size)
        }
        SinglePass::Dispatch(single) => {
            let resources = assembled.pass_resources(single.pass, resources);
            let groups = single.dispatch.groups(&resources);
            let size = single.dispatch.invocations(groups);
            check_count(size)?;
            counter::count_dispatch(&single.dispatch.compute, &resources, groups, size)
        }
    }
}

fn no_launch() -> Error {
    let message = "the scene has no launch and no dispatch whose invocations can be counted";
    Error::new(ErrorKind::InvalidScene, message)
}

/// Refuses a pass that cannot be counted, before anything runs.
fn check(single: &SinglePass<'_>) -> Result<()> {
    let (uses_subgroups, subgroup_size) = match single {
        SinglePass::Launch(launch) if launch.pipeline.sbt.ray_generation.is_none() => {
            return Err(no_launch());
        }
        SinglePass::Launch(launch) => (launch.pipeline.uses_subgroups(), launch.pipeline.subgroup_size),
        SinglePass::Dispatch(dispatch) => {
            let compute = &dispatch.dispatch.compute;
            (compute.program.uses_subgroups, compute.subgroup_size)
        }
    };
    if uses_subgroups && subgroup_size > 64 {
        let message = "the cost of pixels cannot be counted in subgroups of more than 64 invocations";
        return Err(Error::new(ErrorKind::UnsupportedModule, message)
            .note("set `subgroup_size` of the scene's pipeline to 64 or less"));
    }
    check_count(single.size())
}

/// Refuses more invocations than can be counted.
fn check_count(size: [u32; 3]) -> Result<()> {
    let count = size.iter().fold(1_u64, |count, &side| count.saturating_mul(side.into()));
    if count > MAX_INVOCATIONS {
        let message = format!(
            "the cost of {} invocations cannot be counted: the limit is {}",
            grouped(count),
            grouped(MAX_INVOCATIONS)
        );
        return Err(Error::new(ErrorKind::InvalidArgument, message)
            .note("reduce the launch, for example with `--size`"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit::demo;
    use anyhit_engine::pipeline::{Event, PipelineObserver};
    use anyhit_scene::{LoadOptions, assemble};

    /// Counts the events of traversals that are explained.
    struct ExplainedTests {
        width: usize,
        at: usize,
        counts: Vec<[u64; 2]>,
    }

    impl PipelineObserver for ExplainedTests {
        fn invocation(&mut self, [x, y, _]: [u32; 3]) {
            self.at = y as usize * self.width + x as usize;
        }

        fn event(&mut self, event: Event) {
            match event {
                Event::Node(_) => self.counts[self.at][0] += 1,
                Event::Primitive(..) => self.counts[self.at][1] += 1,
                _ => {}
            }
        }
    }

    #[test]
    fn nodes_and_primitives_are_those_of_explained_rays() {
        let options = LoadOptions { size: Some([96, 40]), ..LoadOptions::default() };
        let assembled = assemble(&demo::scene(&options).expect("the demo")).expect("a scene");
        let single = assembled.single_launch(None).expect("a launch");
        let pass = assembled.single_pass(None).expect("a launch");
        let mut explained = ExplainedTests { width: 96, at: 0, counts: vec![[0; 2]; 96 * 40] };
        let launch = Launch { pipeline: &single.pipeline, resources: &assembled.resources };
        launch.run_observed(single.size, &mut explained, &mut ()).expect("it runs");
        let cost = measure(&assembled, &pass, &assembled.resources).expect("it runs");
        let counts: Vec<_> = cost.pixels.iter().map(|pixel| [pixel.nodes, pixel.primitives]).collect();
        assert!(counts == explained.counts);
    }

    #[test]
    fn counts_do_not_depend_on_threads() {
        let options = LoadOptions { size: Some([96, 40]), ..LoadOptions::default() };
        let assembled = assemble(&demo::scene(&options).expect("the demo")).expect("a scene");
        let single = assembled.single_pass(None).expect("a launch");
        let costs = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| measure(&assembled, &single, &assembled.resources)).expect("it runs")
        });
        let [one, three] = &costs;
        assert!(one.pixels.iter().filter(|pixel| pixel.nodes > 0).count() > 1000);
        assert!(one.pixels == three.pixels);
        assert_eq!(one.subgroup_size, three.subgroup_size);
        assert_eq!(one.calls.blocks(), three.calls.blocks());
    }
}
