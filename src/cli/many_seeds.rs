//! `--many-seeds` and `--seed-range`: runs in which is drawn what the specifications leave open.

use std::ops::Range;
use std::path::Path;

use clap::{ArgGroup, Args};

use crate::cli::numbers;
use crate::cli::sanitize::SanitizeArgs;
use crate::cli::stability::StabilityArgs;
use anyhit_base::error::Result;
use anyhit_cases::many_seeds::{FloatChoices, ManySeeds};
use anyhit_debugger::session::ResolvedRequest;
use anyhit_debugger::shell;
use anyhit_sanitize::Findings;
use anyhit_scene::{Assembled, ResolvedScene};

/// Runs with drawn choices.
#[derive(Args, Clone, Debug)]
#[command(group = ArgGroup::new("seeds").multiple(true))]
#[command(next_help_heading = "Seeds")]
pub(super) struct ManySeedsArgs {
    /// Run N more times and randomise behaviour that the specifications leave open: the order and
    /// number of any-hit invocations, the choice between hits at equal t, and more; exit with 6 if
    /// an output depends on it
    #[arg(long, value_name = "N", groups = ["checks", "seeds"], value_parser = numbers::from_one)]
    many_seeds: Option<u64>,
    /// Use only the seeds A to B - 1, as a shard of --many-seeds; with --perturb N: perform only
    /// the runs A + 1 to B of the N
    #[arg(long, value_name = "A..B", groups = ["checks", "seeds"], value_parser = numbers::seed_range)]
    seed_range: Option<Range<u64>>,
    /// With --many-seeds: also randomise contraction (adding a product of floats without rounding
    /// it), where neither NoContraction nor a fast-math mode forbids it
    #[arg(long, requires = "seeds")]
    contract: bool,
    /// With --many-seeds: also randomise other fast math, within Vulkan's precision requirements
    /// and what the module allows: the order of sums, quotients, elementary functions, the sign
    /// of zeros, denormals; implies --contract
    #[arg(long, requires = "seeds")]
    fast_math: bool,
}

impl ManySeedsArgs {
    /// Whether one of the flags is given, and a range not for `--perturb`.
    pub(super) fn is_requested(&self, stability: &StabilityArgs) -> bool {
        self.many_seeds.is_some() || self.seed_range.is_some() && !stability.perturbs()
    }

    /// The range of `--seed-range` that counts runs of `--perturb`.
    pub(super) fn perturbed_runs(&self) -> Option<&Range<u64>> {
        self.seed_range.as_ref().filter(|_| self.many_seeds.is_none())
    }

    /// The seeds that the flags ask for: those of the range that are below the number. The levels
    /// of rules are those that flags set.
    ///
    /// # Errors
    /// `InvalidArgument` for a rule that does not exist, and where no seed of the range is below
    /// the number.
    pub(super) fn given(
        &self,
        sanitize: &SanitizeArgs,
        stability: &StabilityArgs,
    ) -> Result<Option<ManySeeds>> {
        let floats = match (self.fast_math, self.contract) {
            (true, _) => FloatChoices::Fast,
            (false, true) => FloatChoices::Contracted,
            (false, false) => FloatChoices::Exact,
        };
        let all = 0..self.many_seeds.unwrap_or(u64::MAX);
        let seeds = match &self.seed_range {
            Some(range) if range.start >= all.end && self.is_requested(stability) => {
                return Err(numbers::beyond("seed", range, "--many-seeds", all.end));
            }
            Some(range) => range.start..range.end.min(all.end),
            None => all,
        };
        let levels = sanitize.given_levels()?;
        Ok(self.is_requested(stability).then_some(ManySeeds { seeds, levels, floats, command: None }))
    }

    /// Runs a scene's launches and dispatches for the seeds, on copies of its resources, where the
    /// flags ask for it. `command` repeats the runs, but for the seeds.
    ///
    /// # Errors
    /// Of the arguments, and of lowering.
    pub(super) fn run(
        &self,
        sanitize: &SanitizeArgs,
        stability: &StabilityArgs,
        scene: &ResolvedScene,
        assembled: &Assembled,
        command: String,
    ) -> Result<Option<Findings>> {
        let Some(drawn) = self.of_scene(sanitize, stability, scene, command)? else { return Ok(None) };
        drawn.run(scene, assembled).map(Some)
    }

    /// Runs one ray of a scene, or one invocation, for the seeds, as [`ManySeedsArgs::run`] does.
    ///
    /// # Errors
    /// As [`ManySeedsArgs::run`].
    pub(super) fn run_one(
        &self,
        sanitize: &SanitizeArgs,
        stability: &StabilityArgs,
        scene: &ResolvedScene,
        assembled: &Assembled,
        which: &ResolvedRequest,
        command: String,
    ) -> Result<Option<Findings>> {
        let Some(drawn) = self.of_scene(sanitize, stability, scene, command)? else { return Ok(None) };
        drawn.run_one(scene, assembled, which).map(Some)
    }

    /// The seeds, with the levels of a scene.
    fn of_scene(
        &self,
        sanitize: &SanitizeArgs,
        stability: &StabilityArgs,
        scene: &ResolvedScene,
        command: String,
    ) -> Result<Option<ManySeeds>> {
        let Some(drawn) = self.given(sanitize, stability)? else { return Ok(None) };
        let levels = sanitize.levels(scene)?;
        Ok(Some(ManySeeds { levels, command: Some(command), ..drawn }))
    }
}

/// A command that is printed to be typed: a subcommand with its file and those flags that are
/// given, each with its value.
pub(super) fn command_line(
    subcommand: &str,
    file: Option<&Path>,
    flags: &[(&str, Option<String>)],
) -> String {
    let mut line = format!("anyhit {subcommand}");
    if let Some(file) = file {
        line += &format!(" {}", shell::word(&file.to_string_lossy()));
    }
    for (flag, value) in flags {
        if let Some(value) = value {
            line += &format!(" {flag} {}", shell::word(value));
        }
    }
    line
}
