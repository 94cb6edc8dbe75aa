//! Runs a scene once for each of many seeds, from which is drawn what the specifications leave open
//! (`machine::open_choices` lists it), and compares what the runs leave behind.
//!
//! A difference is a finding. It names the choice that suffices for it: first the one kind of
//! choice, then, by leaving out draws, the one invocation and the one ray or variable.

mod chains;
pub mod compute_test;
mod contraction;
mod executed_kernel;
mod first_reads;
mod float_arithmetic;
mod float_licence;
mod float_results;
mod lane_bits;
mod live_registers;
mod minimise;
mod orders;
mod report;
mod robust_texels;
mod runs;
mod undefined;
mod undefined_results;
mod values;
mod word_kind;
mod workgroup_memory;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use crate::many_seeds::minimise::minimise;
use crate::many_seeds::orders::{SmallestOrder, smallest};
use crate::many_seeds::report::DifferenceReport;
use crate::many_seeds::runs::{Drawing, RunDifference, Runs};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_base::progress::Work;
use anyhit_debugger::session::ResolvedRequest;
use anyhit_debugger::shell;
use anyhit_engine::machine::{ChoiceKind, ChoiceLog, ChoiceSite};
use anyhit_sanitize::choices::{is_drawn, rule_of};
use anyhit_sanitize::{Findings, Levels};
use anyhit_scene::{Assembled, ResolvedScene};

/// How many runs may be spent on leaving out draws of one finding.
const MINIMISING_RUNS: usize = 100;

/// Which seeds choices are drawn from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ManySeeds {
    /// The seeds.
    pub seeds: Range<u64>,
    /// The levels of rules. A choice whose rule is allowed is not drawn.
    pub levels: Levels,
    /// What is drawn of how floats are calculated with.
    pub floats: FloatChoices,
    /// The command that repeats the runs, but for its seeds; `None` for runs that no command
    /// repeats.
    pub command: Option<String>,
}

/// The command that runs a scene, without any options.
pub fn run_command(scene: &ResolvedScene) -> String {
    format!("anyhit run {}", shell::word(&escape::path(&scene.path).to_string()))
}

/// What is drawn of how floats are calculated with, within what the module allows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum FloatChoices {
    /// Nothing is drawn of it.
    #[default]
    Exact,
    /// Sums of products.
    Contracted,
    /// All of fast math: also the order of sums, how exact operations are, zeros and denormals.
    Fast,
}

impl FloatChoices {
    /// The least of them in which a choice is drawn.
    pub fn that_include(kind: ChoiceKind) -> Self {
        match kind {
            kind if kind.is_contracted() => Self::Contracted,
            kind if kind.is_of_fast_math() => Self::Fast,
            _ => Self::Exact,
        }
    }
}

impl ManySeeds {
    /// Runs a scene's launches and dispatches with this crate's own choices and then once for each
    /// seed, each time on a copy of its resources. Findings count the seeds. A scene that traps by
    /// itself has none.
    ///
    /// # Errors
    /// Those of lowering a shader without optimization, and `InvalidArgument` for an empty range of
    /// seeds.
    pub fn run(&self, scene: &ResolvedScene, assembled: &Assembled) -> Result<Findings> {
        self.search(scene, assembled, None)
    }

    /// Runs one ray of a scene, or one invocation, as [`ManySeeds::run`] runs its launches. What it
    /// hits and the payload count as outputs, too.
    ///
    /// # Errors
    /// As [`ManySeeds::run`], and where the ray does not fit the scene.
    pub fn run_one(
        &self,
        scene: &ResolvedScene,
        assembled: &Assembled,
        which: &ResolvedRequest,
    ) -> Result<Findings> {
        self.search(scene, assembled, Some(which))
    }

    fn search(
        &self,
        scene: &ResolvedScene,
        assembled: &Assembled,
        which: Option<&ResolvedRequest>,
    ) -> Result<Findings> {
        if self.seeds.is_empty() {
            let Range { start, end } = &self.seeds;
            let message = format!("the range of seeds {start}..{end} is empty");
            return Err(Error::new(ErrorKind::InvalidArgument, message)
                .note("use at least one seed: `many_seeds(8)`"));
        }
        let runs = match Runs::new(scene, assembled, which, &self.levels) {
            Ok(runs) => runs,
            Err(error) if error.kind() == ErrorKind::Trap => return Ok(Findings::default()),
            Err(error) => return Err(error),
        };
        let levels = &self.levels;
        let is_wanted =
            |kind: &ChoiceKind| self.floats >= FloatChoices::that_include(*kind) && is_drawn(*kind, levels);
        let (values, others): (BTreeSet<_>, BTreeSet<_>) =
            ChoiceKind::ALL.into_iter().filter(is_wanted).partition(|kind| kind.is_of_values());
        let command = self.command.as_deref();
        let mut search = Search { scene, runs, levels, command, findings: Findings::default() };
        let work = Work::counted("running with random choices", self.seeds.end - self.seeds.start);
        for seed in self.seeds.clone() {
            search.seed(seed, &others);
            search.seed(seed, &values);
            work.advance(1);
        }
        Ok(search.findings)
    }
}

/// The search for findings.
struct Search<'a> {
    scene: &'a ResolvedScene,
    runs: Runs<'a>,
    levels: &'a Levels,
    /// The command that repeats the runs, but for its seeds.
    command: Option<&'a str>,
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
        let (runs, scene, level, command) = (&self.runs, self.scene, self.levels.of(rule), self.command);
        self.findings.add_of_output(rule, runs.output_hash(&difference), || {
            let least = Self::least(runs, drawing, sites);
            let order = Self::smallest_order(runs, &least);
            let orders = order.map(|order| match order {
                SmallestOrder::Exchange(limits) | SmallestOrder::OneByOne(limits) => limits,
            });
            let least = Drawing { orders, ..least };
            let log = ChoiceLog::new(true);
            let logged = Drawing { log: Some(log.clone()), ..least };
            let difference = runs.difference(&logged).unwrap_or(difference);
            let draws: BTreeMap<_, _> = log.take();
            let is_one_by_one = matches!(order, Some(SmallestOrder::OneByOne(_)));
            let (drawing, draws, difference) = (&logged, &draws, &difference);
            DifferenceReport { scene, runs, command, kind, drawing, draws, difference, is_one_by_one }
                .finding(rule, level)
        });
    }

    /// What of the orders of the only pass in which something is drawn suffices, if only orders
    /// are.
    fn smallest_order(runs: &Runs<'_>, drawing: &Drawing) -> Option<SmallestOrder> {
        let is_order =
            |kind: &ChoiceKind| matches!(kind, ChoiceKind::InvocationOrder | ChoiceKind::SubgroupComposition);
        let mut sites = drawing.only.iter().flat_map(|only| only.iter());
        let (Some(site), None) = (sites.next(), sites.next()) else { return None };
        drawing.kinds.iter().all(is_order).then(|| smallest(runs, drawing, site.pass))?
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
