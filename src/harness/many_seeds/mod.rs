//! Runs a scene once for each of many seeds, from which is drawn what the specifications leave open
//! (`machine::open_choices` lists it), and compares what the runs leave behind.
//!
//! A difference is a finding. It names the choice that suffices for it: first the one kind of
//! choice, then, by leaving out draws, the one invocation and the one ray or variable.

mod contraction;
mod minimise;
mod report;
mod runs;
mod undefined;
mod values;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use crate::error::{ErrorKind, Result};
use crate::harness::many_seeds::minimise::minimise;
use crate::harness::many_seeds::report::DifferenceReport;
use crate::harness::many_seeds::runs::{Drawing, RunDifference, Runs};
use crate::machine::{ChoiceKind, ChoiceLog, ChoiceSite};
use crate::sanitize::choices::rule_of;
use crate::sanitize::{Findings, Level, Levels};
use crate::scene::{Assembled, ResolvedScene};

/// How many runs may be spent on leaving out draws of one finding.
const MINIMISING_RUNS: usize = 100;

/// Which seeds choices are drawn from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ManySeeds {
    /// The seeds.
    pub seeds: Range<u64>,
    /// The levels of rules. A choice whose rule is allowed is not drawn.
    pub levels: Levels,
    /// Whether sums and products of floats are contracted, too, where the module allows it.
    pub contracts: bool,
}

impl ManySeeds {
    /// Runs a scene's launches and dispatches with this crate's own choices and then once for each
    /// seed, each time on a copy of its resources. Findings count the seeds. A scene that traps by
    /// itself has none.
    ///
    /// # Errors
    /// Those of lowering a shader without optimization.
    pub fn run(&self, scene: &ResolvedScene, assembled: &Assembled) -> Result<Findings> {
        let runs = match Runs::new(scene, assembled) {
            Ok(runs) => runs,
            Err(error) if error.kind() == ErrorKind::Trap => return Ok(Findings::default()),
            Err(error) => return Err(error),
        };
        let levels = &self.levels;
        let is_drawn = |kind: &ChoiceKind| {
            let is_wanted = *kind != ChoiceKind::Contraction || self.contracts;
            is_wanted && levels.of(rule_of(*kind)) != Level::Allow
        };
        let (values, others): (BTreeSet<_>, BTreeSet<_>) =
            ChoiceKind::ALL.into_iter().filter(is_drawn).partition(|kind| kind.is_of_values());
        let mut search = Search { scene, runs, levels, findings: Findings::default() };
        for seed in self.seeds.clone() {
            search.seed(seed, &others);
            search.seed(seed, &values);
        }
        Ok(search.findings)
    }
}

/// The search for findings.
struct Search<'a> {
    scene: &'a ResolvedScene,
    runs: Runs<'a>,
    levels: &'a Levels,
    findings: Findings,
}

impl Search<'_> {
    /// Runs a seed with some choices, and where that makes a difference with each choice by itself.
    fn seed(&mut self, seed: u64, kinds: &BTreeSet<ChoiceKind>) {
        if kinds.is_empty() {
            return;
        }
        let all = Drawing::of(seed, kinds.clone());
        let Some(difference) = self.runs.difference(&all) else { return };
        let log = ChoiceLog::new(false);
        self.runs.difference(&Drawing { log: Some(log.clone()), ..all });
        // A kind that was drawn nowhere makes no difference.
        let sites: Vec<ChoiceSite> = log.take().into_keys().collect();
        let met: BTreeSet<ChoiceKind> = sites.iter().map(|site| site.kind).collect();
        let mut is_told = false;
        for &kind in &met {
            let alone = Drawing::of(seed, [kind].into());
            if let Some(difference) = self.runs.difference(&alone) {
                is_told = true;
                let sites: Vec<ChoiceSite> = sites.iter().filter(|site| site.kind == kind).copied().collect();
                self.tell(&alone, sites, difference);
            }
        }
        if !is_told {
            self.tell(&Drawing::of(seed, met), sites, difference);
        }
    }

    /// Adds the finding of a difference: that of the run with the fewest draws that still has one.
    fn tell(&mut self, drawing: &Drawing, sites: Vec<ChoiceSite>, difference: RunDifference) {
        let Some(&kind) = drawing.kinds.first() else { return };
        let rule = rule_of(kind);
        let (runs, scene, level) = (&self.runs, self.scene, self.levels.of(rule));
        self.findings.add_of_output(rule, runs.output_hash(&difference), || {
            let least = Self::least(runs, drawing, sites);
            let log = ChoiceLog::new(true);
            let logged = Drawing { log: Some(log.clone()), ..least };
            let difference = runs.difference(&logged).unwrap_or(difference);
            let draws: BTreeMap<_, _> = log.take();
            DifferenceReport { scene, runs, kind, drawing: &logged, draws: &draws, difference: &difference }
                .finding(rule, level)
        });
    }

    /// The drawing of the fewest sites that still makes a difference.
    fn least(runs: &Runs<'_>, drawing: &Drawing, sites: Vec<ChoiceSite>) -> Drawing {
        let only = |sites: &[ChoiceSite]| Drawing {
            only: Some(Arc::new(sites.iter().copied().collect())),
            ..drawing.clone()
        };
        let differs = |sites: &[ChoiceSite]| runs.difference(&only(sites)).is_some();
        // The draws of one kind may depend on those of another: then all of them stay.
        if !differs(&sites) {
            return drawing.clone();
        }
        only(&minimise(sites, MINIMISING_RUNS, differs))
    }
}
