//! `--shadow` and `--perturb`: how far results depend on rounding.

use std::ops::Range;

use clap::Args;

use crate::cli::{numbers, output};
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::progress::Work;
use anyhit_cases::stability::perturb::perturb_one;
use anyhit_cases::stability::shadow::shadow_one;
use anyhit_cases::stability::{Envelope, Perturbation, perturb, shadow};
use anyhit_debugger::session::ResolvedRequest;
use anyhit_scene::{Assembled, ResolvedScene};

/// How far results depend on rounding.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Rounding")]
pub(super) struct StabilityArgs {
    /// Run every float operation also in f64 and report, by line, where the results differ: lost
    /// bits, and different branches and hits
    #[arg(long, conflicts_with = "perturb")]
    shadow: bool,
    /// Run N more times with every float result perturbed at random within the errors that devices
    /// may make, and report which outputs and branches are unstable; exit with 1 if an output is
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    perturb: Option<u32>,
    /// With --perturb: seed of the perturbations
    #[arg(long, value_name = "SEED", default_value_t = 1, requires = "perturb")]
    seed: u64,
    /// With --perturb: perturb results within the errors that Vulkan allows, or within those
    /// measured on NVIDIA's driver
    #[arg(long, value_name = "WHOSE", default_value = "vulkan", value_parser = ["vulkan", "nvidia"], requires = "perturb")]
    envelope: String,
    /// With --perturb: relative tolerance of floats, absolute below 1 [default: 0.01]
    #[arg(long, value_name = "X", requires = "perturb", value_parser = numbers::not_negative)]
    tolerance: Option<f64>,
}

impl StabilityArgs {
    /// Whether `--shadow` or `--perturb` is given.
    pub(super) fn is_requested(&self) -> bool {
        self.shadow || self.perturb.is_some()
    }

    /// `--shadow`
    pub(super) fn shadow(&self) -> bool {
        self.shadow
    }

    /// Whether `--perturb` is given.
    pub(super) fn perturbs(&self) -> bool {
        self.perturb.is_some()
    }

    /// The perturbation of `--perturb`, `--seed`, `--envelope` and `--tolerance`: of its runs those
    /// that `range` counts from 0.
    ///
    /// # Errors
    /// `InvalidArgument` where the range has none of them.
    pub(super) fn perturbation(&self, range: Option<&Range<u64>>) -> Result<Option<Perturbation>> {
        if let (Some(range), Some(runs)) = (range, self.perturb)
            && range.start >= runs.into()
        {
            return Err(numbers::beyond("run", range, "--perturb", runs.into()));
        }
        let envelope = if self.envelope == "nvidia" { Envelope::Nvidia } else { Envelope::Vulkan };
        let tolerance = self.tolerance.unwrap_or(Perturbation::default().tolerance);
        Ok(self.perturb.map(|runs| {
            let number = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
            let (first_run, runs) = match range {
                Some(range) => (number(range.start).saturating_add(1), runs.min(number(range.end))),
                None => (1, runs),
            };
            Perturbation { runs, first_run, seed: self.seed, envelope, tolerance }
        }))
    }

    /// Runs a whole launch or one ray as `--shadow` or `--perturb` requests, `range` as in
    /// [`StabilityArgs::perturbation`], and prints the findings.
    ///
    /// # Errors
    /// Of the run; `Expectation` where an output is not stable, after the findings are printed.
    pub(super) fn run(
        &self,
        scene: &ResolvedScene,
        assembled: &Assembled,
        one: Option<&ResolvedRequest>,
        json: bool,
        range: Option<&Range<u64>>,
    ) -> Result<()> {
        if let Some(perturbation) = self.perturbation(range)? {
            return perturbed(scene, assembled, one, json, &perturbation);
        }
        let work = Work::new("computing in f64, too");
        let (found, trap) = match one {
            Some(one) => shadow_one(scene, assembled, one),
            None => shadow(scene, assembled),
        }
        .map_err(|error| output::json_error(json, error))?;
        drop(work);
        match json {
            true => output::print(format_args!("{:#}\n", found.json(trap.as_ref())))?,
            false => output::print(found.text())?,
        }
        trap.map_or(Ok(()), Err)
    }
}

fn perturbed(
    scene: &ResolvedScene,
    assembled: &Assembled,
    one: Option<&ResolvedRequest>,
    json: bool,
    perturbation: &Perturbation,
) -> Result<()> {
    let found = match one {
        Some(one) => perturb_one(scene, assembled, one, perturbation),
        None => perturb(scene, assembled, perturbation),
    }
    .map_err(|error| output::json_error(json, error))?;
    match json {
        true => output::print(format_args!("{:#}\n", found.json()))?,
        false => output::print(found.text())?,
    }
    if found.is_stable() {
        return Ok(());
    }
    let count = found.outputs.len() + found.traps.len();
    let message =
        format!("{} {} unstable", grouped(count), if count == 1 { "output is" } else { "outputs are" });
    Err(Error::new(ErrorKind::Expectation, message))
}
