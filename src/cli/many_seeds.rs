//! `--many-seeds` and `--seed-range`: runs in which is drawn what the specifications leave open.

use std::ops::Range;

use clap::{ArgGroup, Args};

use crate::cli::sanitize::SanitizeArgs;
use crate::error::Result;
use crate::harness::many_seeds::ManySeeds;
use crate::sanitize::Findings;
use crate::scene::{Assembled, ResolvedScene};

/// Runs with drawn choices.
#[derive(Args, Clone, Debug)]
#[command(group = ArgGroup::new("seeds").multiple(true))]
pub(super) struct ManySeedsArgs {
    /// Run N more times, and draw what the specifications leave open: the order of any-hit shaders
    /// and how often they run, which of two hits at equal t counts, and more; exit code 6 if an
    /// output depends on it
    #[arg(long, value_name = "N", groups = ["checks", "seeds"])]
    many_seeds: Option<u64>,
    /// Draw from the seeds A to B - 1 alone, a share of --many-seeds
    #[arg(long, value_name = "A..B", groups = ["checks", "seeds"], value_parser = seed_range)]
    seed_range: Option<Range<u64>>,
    /// With --many-seeds: also draw which products of floats are added without being rounded, where
    /// neither NoContraction nor a fast-math mode forbids it
    #[arg(long, requires = "seeds")]
    contract: bool,
}

impl ManySeedsArgs {
    /// Whether one of the flags is given.
    pub(super) fn is_requested(&self) -> bool {
        self.many_seeds.is_some() || self.seed_range.is_some()
    }

    /// The seeds that the flags ask for: those of the range that are below the number. The levels
    /// of rules are those that flags set.
    ///
    /// # Errors
    /// `InvalidArgument` for a rule that does not exist.
    pub(super) fn given(&self, sanitize: &SanitizeArgs) -> Result<Option<ManySeeds>> {
        let all = 0..self.many_seeds.unwrap_or(u64::MAX);
        let seeds = match &self.seed_range {
            Some(range) => range.start..range.end.min(all.end),
            None => all,
        };
        let levels = sanitize.given_levels()?;
        Ok(self.is_requested().then_some(ManySeeds { seeds, levels, contracts: self.contract }))
    }

    /// Runs a scene's launches and dispatches for the seeds, on copies of its resources, where the
    /// flags ask for it.
    ///
    /// # Errors
    /// Of the arguments, and of lowering.
    pub(super) fn run(
        &self,
        sanitize: &SanitizeArgs,
        scene: &ResolvedScene,
        assembled: &Assembled,
    ) -> Result<Option<Findings>> {
        let Some(drawn) = self.given(sanitize)? else { return Ok(None) };
        let levels = sanitize.levels(scene)?;
        ManySeeds { levels, ..drawn }.run(scene, assembled).map(Some)
    }
}

/// `A..B`
fn seed_range(text: &str) -> Result<Range<u64>, String> {
    let number = |text: &str| text.parse::<u64>().map_err(|error| format!("{text:?}: {error}"));
    let (first, end) = text.split_once("..").ok_or("it has the form A..B, as 0..64")?;
    Ok(number(first)?..number(end)?)
}
