//! How a suite is run.

use std::path::PathBuf;

use crate::many_seeds::ManySeeds;
use crate::source_tree::SourceTree;
use crate::stability::Perturbation;
use anyhit_engine::machine::LaunchLimits;
use anyhit_sanitize::Levels;
use anyhit_scene::RunLimits;
use anyhit_unit_test::explain::EXPLAINED_LINES;

/// How a suite is run.
#[derive(Clone, Debug)]
pub struct SuiteOptions {
    /// How many cases run side by side; 0 is as many as there are processors.
    pub jobs: usize,
    /// Whether launches run at 1, 64 and 128 lanes, which must agree bit for bit.
    pub all_widths: bool,
    /// Whether every test runs without the optimizer, too, and must leave the same behind.
    pub check_optimizer: bool,
    /// Whether recorded expectations are written anew.
    pub bless: bool,
    /// Whether nothing is reported after the first test that does not pass.
    pub fail_fast: bool,
    /// Whether coverage is recorded.
    pub coverage: bool,
    /// Whether every test runs with f64 shadows, too.
    pub shadow: bool,
    /// How every test is run again with its float results moved: one that passes fails where an
    /// output is not stable, unless it says itself what must be.
    pub perturb: Option<Perturbation>,
    /// The levels of the sanitizer's rules over those of each scene, if every test that passes runs
    /// under it, too, and fails where a finding is denied.
    pub sanitize: Option<Levels>,
    /// The seeds for each of which every launch that passes runs once more with drawn choices, and
    /// fails where a finding is denied; the levels of rules go over those of each scene.
    pub many_seeds: Option<ManySeeds>,
    /// A baseline of findings, which are known: they are not reported, and fail nothing.
    pub known: Option<String>,
    /// Whether denied findings fail nothing, as they become a baseline.
    pub becomes_baseline: bool,
    /// Whether the explanation of the ray is left out of failures.
    pub no_explanation: bool,
    /// At most so many lines of each any-hit and intersection shader that decided are shown.
    pub explained_lines: usize,
    /// Whether explanations are in colour.
    pub colour: bool,
    /// The limits of running; by default those of [`LaunchLimits::TESTS`].
    pub limits: RunLimits,
    /// Where pictures that differ are saved.
    pub pictures: PathBuf,
    /// The folder from which annotations and SARIF name files.
    pub repository: SourceTree,
}

impl Default for SuiteOptions {
    fn default() -> Self {
        Self {
            jobs: 0,
            all_widths: false,
            check_optimizer: false,
            bless: false,
            fail_fast: false,
            coverage: false,
            shadow: false,
            perturb: None,
            sanitize: None,
            many_seeds: None,
            known: None,
            becomes_baseline: false,
            no_explanation: false,
            explained_lines: EXPLAINED_LINES,
            colour: false,
            limits: RunLimits { default: LaunchLimits::TESTS, ..RunLimits::default() },
            pictures: PathBuf::new(),
            repository: SourceTree::of_repository(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn launches_of_tests_end_by_default() {
        assert_eq!(SuiteOptions::default().limits.default, LaunchLimits::TESTS);
    }
}
