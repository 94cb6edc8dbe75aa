//! Drawn choices in unit tests of compute shaders.

use crate::many_seeds::ManySeeds;
use anyhit_base::error::Result;
use anyhit_sanitize::WarningReports;
use anyhit_unit_test::compute_test::ComputeTest;

/// A unit test that runs with drawn choices.
pub trait SeededRuns {
    /// Runs the test once more for each of so many seeds, from which is drawn what the
    /// specifications leave open: in what order invocations run, what memory of workgroups holds
    /// before it is written. Returns the differences of outputs that are only warned of.
    ///
    /// ```
    /// use anyhit::{ComputeTest, ErrorKind, Module, SeededRuns};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// // Which invocation writes last is left open.
    /// const LAST: &str = "
    /// @group(0) @binding(0) var<storage, read_write> last: u32;
    /// @compute @workgroup_size(64)
    /// fn race(@builtin(global_invocation_id) id: vec3u) { last = id.x; }";
    /// let test = ComputeTest::new(&Module::from_source("race.wgsl", LAST)?, "race")?;
    /// let error = test.buffer(0, 0, &[0u32]).many_seeds(8).unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Finding);
    /// assert!(error.message().starts_with("`last`"), "{error}");
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `Finding` for the differences that are denied, all in one error; `InvalidArgument` for no
    /// seed; else those of a run of the test.
    fn many_seeds(&self, seeds: u64) -> Result<WarningReports>;
}

impl SeededRuns for ComputeTest {
    fn many_seeds(&self, seeds: u64) -> Result<WarningReports> {
        let outcome = self.run();
        let (scene, assembled) = self.scene_of_dispatch()?;
        let findings = ManySeeds { seeds: 0..seeds, ..ManySeeds::default() }.run(&scene, &assembled)?;
        findings.into_warnings(outcome.map(|_| ()))
    }
}
