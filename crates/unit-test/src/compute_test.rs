//! One compute shader, run by itself.

use std::sync::Arc;

use serde::Serialize;

use crate::block_counts::BlockCounts;
use crate::bound::{Bound, reads_what_is_bound};
use crate::given::{Given, gives_resources};
#[cfg(feature = "debugger")]
use crate::memory;
use crate::scene::Scene;
use anyhit_base::error::{Error, Result};
use anyhit_base::sorted::SortedMap;
#[cfg(feature = "debugger")]
use anyhit_debugger::console::transcript;
#[cfg(feature = "debugger")]
use anyhit_debugger::debugger::Debugger;
use anyhit_engine::machine::printed::PrintedLine;
use anyhit_engine::machine::{Descriptor, LaunchLimits, Resources};
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::WrittenMemory;
use anyhit_engine::pipeline::{Compute, Stats};
use anyhit_engine::program::Program;

/// A compute shader with what it has bound, and how many workgroups of it run.
///
/// ```
/// use anyhit::{ComputeTest, Module};
///
/// # fn main() -> anyhit::Result<()> {
/// const SUM: &str = "
/// @group(0) @binding(0) var<storage, read> numbers: array<u32>;
/// @group(0) @binding(1) var<storage, read_write> sums: array<u32>;
/// var<workgroup> shared_numbers: array<u32, 4>;
///
/// @compute @workgroup_size(4)
/// fn sum(@builtin(local_invocation_index) local: u32, @builtin(global_invocation_id) id: vec3u,
///        @builtin(workgroup_id) group: vec3u) {
///     shared_numbers[local] = numbers[id.x];
///     workgroupBarrier();
///     if (local == 0u) {
///         sums[group.x] = shared_numbers[0] + shared_numbers[1] + shared_numbers[2] + shared_numbers[3];
///     }
/// }";
/// let module = Module::from_source("sum.wgsl", SUM)?;
/// let outcome = ComputeTest::new(&module, "sum")?
///     .buffer(0, 0, &[1u32, 2, 3, 4, 10, 20, 30, 40])
///     .buffer(0, 1, &[0u32; 2])
///     .workgroups([2, 1, 1])
///     .run()?;
/// assert_eq!(outcome.read_buffer::<u32>(0, 1)?, [10, 100]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
#[must_use]
pub struct ComputeTest {
    pub(crate) compute: Compute,
    pub(crate) groups: [u32; 3],
    pub(crate) given: Given,
    /// True if the test sets `SubgroupSize`: no other size is drawn.
    #[cfg(feature = "debugger")]
    pub(crate) sets_subgroup_size: bool,
}

impl ComputeTest {
    /// The compute shader with an entry point's name.
    ///
    /// # Errors
    /// `InvalidArgument` where the module has no compute shader of that name, and what makes a
    /// module unusable.
    pub fn new(module: &Arc<Module>, entry: &str) -> Result<Self> {
        Self::of(Program::with_stage(module, Stage::Compute, entry)?)
    }

    /// The shader of a program that is lowered already.
    ///
    /// # Errors
    /// As [`Compute::new`].
    pub fn of(program: impl Into<Arc<Program>>) -> Result<Self> {
        let compute = Compute::new(program)?.launch_limits(LaunchLimits::UNIT_TESTS);
        Ok(Self {
            compute,
            groups: [1; 3],
            given: Given::default(),
            #[cfg(feature = "debugger")]
            sets_subgroup_size: false,
        })
    }

    /// Sets the number of workgroups along x, y and z; one unless set.
    #[must_use]
    pub fn workgroups(self, groups: [u32; 3]) -> Self {
        Self { groups, ..self }
    }

    /// Binds the acceleration structure of a scene, for ray queries.
    #[must_use]
    pub fn scene(self, set: u32, binding: u32, scene: &Scene) -> Self {
        self.descriptor(set, binding, Descriptor::AccelerationStructure(scene.tlas().clone()))
    }

    /// Sets how many instructions an invocation may execute, counted at back edges and calls.
    #[must_use]
    pub fn fuel(self, instructions: u64) -> Self {
        Self { compute: self.compute.fuel(instructions), ..self }
    }

    /// Sets the limits of the dispatch; unless set, it is stopped after 60 seconds, and workgroups
    /// that run together after 8, as by `anyhit test`. Limits without a time leave
    /// [`ComputeTest::fuel`] alone to end an endless loop.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use anyhit::{ComputeTest, LaunchLimits, Module};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// # let module = Module::open("spirv-fixtures/pass/compute/prefix-sum/main.comp.spv")?;
    /// let limits = LaunchLimits::default().timeout(Duration::from_secs(300));
    /// let test = ComputeTest::new(&module, "main")?.launch_limits(limits);
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn launch_limits(self, limits: LaunchLimits) -> Self {
        Self { compute: self.compute.launch_limits(limits), ..self }
    }

    /// Sets `SubgroupSize`: a power of two from 1 to 128.
    ///
    /// # Errors
    /// `InvalidArgument` for any other size.
    pub fn subgroup_size(self, size: u32) -> Result<Self> {
        Ok(Self {
            compute: self.compute.subgroup_size(size)?,
            #[cfg(feature = "debugger")]
            sets_subgroup_size: true,
            ..self
        })
    }

    /// Runs all workgroups. What they write is in the outcome; the test does not change, so that it
    /// can be run again. Buffers and images that the shader cannot write are not copied.
    ///
    /// # Errors
    /// `Trap`, that of the first workgroup that has one, with its source line; `InvalidArgument`
    /// for a buffer whose size, or an image whose format, is not the shader's, with both, and for
    /// too many workgroups.
    pub fn run(&self) -> Result<ComputeOutcome> {
        self.run_by(|resources| self.compute.dispatch(resources, self.groups))
    }

    /// Runs all workgroups as [`ComputeTest::run`] does, one after the other, and counts blocks and
    /// branches of the shader.
    ///
    /// # Errors
    /// As [`ComputeTest::run`].
    #[doc(hidden)]
    pub fn run_counted(&self, counts: &mut BlockCounts) -> Result<ComputeOutcome> {
        self.run_by(|resources| self.compute.run_observed(resources, self.groups, &mut |_| (), counts))
    }

    fn run_by(&self, run: impl FnOnce(&Resources) -> Result<Stats>) -> Result<ComputeOutcome> {
        let program = &self.compute.program;
        self.given.check(program)?;
        let given = &self.given.resources;
        let mut resources = WrittenMemory::of([program], given).copied(given);
        resources.printed = Some(Arc::default());
        let stats = run(&resources).map_err(|error: Error| {
            let [x, y, z] = self.groups;
            error.note(format!("of a dispatch of {x} x {y} x {z} workgroups"))
        })?;
        let printed = resources.printed.take().map_or_else(Vec::new, |printed| printed.take());
        let bound = Bound {
            programs: vec![program.clone()],
            resources,
            roots: Vec::new(),
            readers: SortedMap::new(),
        };
        Ok(ComputeOutcome { stats, printed, bound })
    }

    /// Runs all workgroups as [`ComputeTest::run`] does, and keeps what they write: the next run
    /// begins with it. Clones of the test, and earlier outcomes, do not change.
    ///
    /// # Errors
    /// As [`ComputeTest::run`]; the test stays as it was then.
    pub fn run_mut(&mut self) -> Result<ComputeOutcome> {
        let outcome = self.run()?;
        self.given.keep(outcome.bound.resources.clone());
        Ok(outcome)
    }

    /// Runs an invocation, given by its `GlobalInvocationId`, with its workgroup in the debugger of
    /// `anyhit trace-one-ray --interactive`, and returns the transcript of commands, one a line.
    /// `docs/debugging.md` describes them.
    ///
    /// # Errors
    /// `InvalidArgument` for an invocation outside of the workgroups, and for the first command
    /// that fails, with its line; else the mistakes of [`ComputeTest::run`] in what the test gives.
    /// A trap is part of the transcript.
    #[cfg(feature = "debugger")]
    pub fn debug(&self, id: [u32; 3], commands: &str) -> Result<String> {
        transcript(self.debugger(id)?, commands)
    }

    /// The debugger before the first line of an invocation.
    ///
    /// # Errors
    /// `InvalidArgument` for an invocation outside of the workgroups; else the mistakes of
    /// [`ComputeTest::run`] in what the test gives.
    #[cfg(feature = "debugger")]
    #[doc(hidden)]
    pub fn debugger(&self, id: [u32; 3]) -> Result<Debugger> {
        self.given.check(&self.compute.program)?;
        let mut resources = memory::copied(&self.given.resources);
        resources.printed = Some(Arc::default());
        Debugger::of_compute(&self.compute, &resources, self.groups, id)
    }
}

gives_resources!(ComputeTest);

/// Result of a compute shader. Serde writes counts and printed lines.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
#[must_use]
pub struct ComputeOutcome {
    /// How many invocations ran and how many ray queries were made.
    pub stats: Stats,
    /// What the shader printed (`debugPrintfEXT`).
    pub printed: Vec<PrintedLine>,
    #[serde(skip)]
    pub(super) bound: Bound,
}

reads_what_is_bound!(ComputeOutcome);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instance::Instance;
    use anyhit_base::error::ErrorKind;

    fn module(name: &str) -> Arc<Module> {
        let root =
            std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("spirv-fixtures/pass");
        Module::open(root.join(name)).expect("a fixture")
    }

    #[test]
    fn ray_queries_of_all_workgroups_are_counted_together() {
        let corners = [[0.0, 0.0, 0.0], [15.5, 0.0, 0.0], [0.0, 15.5, 0.0]];
        let scene = Scene::new([Instance::triangles(corners)]).unwrap();
        let test = ComputeTest::new(&module("ray-query/compute/main.comp.spv"), "main").unwrap();
        let test = test.scene(0, 0, &scene).buffer(0, 1, &[0u32; 2]).workgroups([1, 2, 1]);
        // The rays at (x + 1/2, y + 1/2) that hit have x + y <= 14: 15 + 14 + 13 + 12 in the rows 0
        // to 3, and 11 + 10 + 9 + 8 in the rows 4 to 7.
        for _ in 0..2 {
            let outcome = test.run().unwrap();
            assert_eq!(outcome.read_buffer::<u32>(0, 1).unwrap(), [54, 38]);
            assert_eq!(outcome.stats.ray_queries, 128);
        }
    }

    #[test]
    fn mistakes_are_told() {
        let module = module("ray-query/compute/main.comp.spv");
        let error = ComputeTest::new(&module, "mian").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidArgument);
        // Outputs of two workgroups in a buffer of one.
        let scene = Scene::new([]).unwrap();
        let test = ComputeTest::new(&module, "main").unwrap().scene(0, 0, &scene).buffer(0, 1, &[0u32]);
        assert!(test.run().is_ok());
        let error = test.workgroups([1, 2, 1]).run().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Trap);
        assert!(error.render().contains("of a dispatch of 1 x 2 x 1 workgroups"), "{}", error.render());
    }
}
