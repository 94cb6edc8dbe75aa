//! Unit tests under the sanitizer.

use std::sync::Arc;

use crate::compute_test::ComputeTest;
use crate::shader_test::ShaderTest;
use crate::side_by_side::SideBySide;
use anyhit_base::error::Result;
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::pipeline::WrittenMemory;
use anyhit_sanitize::module_checks::check_module;
use anyhit_sanitize::{Levels, ProgramPlan, Sanitizer, WarningReports};

impl ShaderTest {
    /// Runs the shader as [`ShaderTest::run`] does, under the sanitizer: it checks what no driver
    /// tells, such as reads of what nobody has written. Returns what it only warns of. What the
    /// test gives, and what answers write, counts as written.
    ///
    /// ```
    /// use anyhit::{Module, ShaderTest};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let module = Module::open("spirv-fixtures/fail/memory/array-index/main.rgen.spv")?;
    /// let test = ShaderTest::new(&module, "main")?.buffer(0, 1, &[0.0f32; 6]);
    /// assert!(test.launch([3, 0, 0], [6, 1, 1]).sanitize()?.is_empty());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `Finding` for what it denies, all in one error; else as [`ShaderTest::run`].
    pub fn sanitize(&self) -> Result<WarningReports> {
        let mut test = self.clone();
        test.program = Arc::new(self.program.for_sanitizer()?);
        let (plans, levels) = ([ProgramPlan::new(&test.program)], Levels::default());
        let mut sanitizer = Sanitizer::new(&plans, &levels);
        let outcome = test.run_observed(Some(&mut sanitizer));
        let mut findings = check_module(&test.program, ShaderIndex(0), &levels);
        findings.extend(sanitizer.into_findings());
        findings.into_warnings(outcome.map(|_| ()))
    }
}

impl ComputeTest {
    /// Runs all workgroups as [`ComputeTest::run`] does, under the sanitizer: it checks what no
    /// driver tells, such as reads of what nobody has written. Returns what it only warns of.
    ///
    /// ```
    /// use anyhit::{ComputeTest, ErrorKind, Module};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// // The time of a clip is taken modulo its length, which is 0 for the second of four.
    /// let module = Module::open("spirv-fixtures/sanitize/frem-zero/broken.comp.spv")?;
    /// let lengths = [2.0f32, 0.0, 0.5, 10.0];
    /// let clips = lengths.iter().flat_map(|&seconds| [seconds, 24.0, 0.0, 1.0]);
    /// let clips: Vec<f32> = [7.5, 0.0, 0.0, 0.0].into_iter().chain(clips).collect();
    /// let test = ComputeTest::new(&module, "main")?.buffer(0, 1, &[0.0f32; 4]).buffer(0, 2, &clips);
    /// let error = test.sanitize().unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Finding);
    /// assert!(error.message().starts_with("the remainder of 7.5 divided by zero"));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `Finding` for what it denies, all in one error; else as [`ComputeTest::run`].
    pub fn sanitize(&self) -> Result<WarningReports> {
        let compute = self.compute.for_sanitizer()?;
        self.given.check(&compute.program)?;
        let given = &self.given.resources;
        let resources = WrittenMemory::of([&compute.program], given).copied(given);
        let (plans, levels) = ([ProgramPlan::new(&compute.program)], Levels::default());
        let side_by_side = SideBySide::of(&plans, &resources);
        let mut sanitizer = Sanitizer::new(&plans, &levels).with_resources(&resources);
        let outcome = compute.run_observed(&resources, self.groups, &mut |_| (), &mut sanitizer);
        let mut findings = check_module(&compute.program, ShaderIndex(0), &levels);
        findings.extend(sanitizer.into_findings());
        if let Some(run) = side_by_side {
            findings.extend(run.dispatch(&compute, self.groups, &levels));
        }
        findings.into_warnings(outcome.map(|_| ()))
    }
}
