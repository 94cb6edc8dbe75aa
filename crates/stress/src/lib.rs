//! Fuzzing of intersection and traversal against an exact reference: `anyhit stress`.
//!
//! A [`StressCase`] is a ray, perhaps in a packet with others, and primitives of one kind in one or
//! several instances, which may move. The [`family`] module generates cases in which intersectors
//! fail, [`judge`] compares every answer with [`mod@reference`], which computes in rational numbers
//! and shares no code with `geometry`, and [`minimise`] makes a failure small enough to read. Case
//! number n of a seed is the same on every machine, whatever the number of threads.

pub mod case;
pub mod check_math;
pub mod draw;
pub mod family;
pub mod judge;
pub mod minimise;
mod obvhs_tree;
pub mod reference;
pub mod scene;

pub use case::{Shape, StressCase};
pub use judge::{Failure, Tally, check};

use std::ops::Range;
use std::time::{Duration, Instant};

use crate::draw::Draw;
use crate::family::FAMILIES;
use anyhit_base::threads::map_on_threads;
use anyhit_engine::geometry::Precision;

/// The number of cases that run between two checks of the time limit.
const ROUND: u64 = 1000;

/// A run ends after so many failures, unless its number of cases is fixed; so many are kept.
pub const MAX_FAILURES: usize = 10;

/// The settings of a run.
#[derive(Clone, Copy, Debug)]
pub struct StressSettings {
    /// The seed from which the cases are generated.
    pub seed: u64,
    /// The run ends after at least this many rays.
    pub rays: Option<u64>,
    /// The run ends after at least this time.
    pub time: Option<Duration>,
    /// The precision that is tested; below `Exact`, failures are expected.
    pub precision: Precision,
}

/// Cases of a fixed number: all of them run, however many fail.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FixedCases {
    /// The seeds, each of which generates so many cases.
    pub seeds: Range<u64>,
    /// The number of cases of a seed.
    pub cases: u64,
}

/// A case with a wrong result.
#[derive(Clone, Debug)]
pub struct FoundFailure {
    /// The seed.
    pub seed: u64,
    /// The case's number for the seed.
    pub number: u64,
    /// The wrong result of the minimised case.
    pub failure: Failure,
    /// The minimised case.
    pub case: StressCase,
}

/// The results of a run.
#[derive(Clone, Debug)]
pub struct StressReport {
    /// The number of cases.
    pub cases: u64,
    /// The counts of each family of [`FAMILIES`].
    pub families: Vec<Tally>,
    /// How many cases had a wrong result.
    pub wrong: u64,
    /// The first of them.
    pub failures: Vec<FoundFailure>,
    /// The time that the run has taken.
    pub time: Duration,
}

impl StressReport {
    /// The tally of all families together.
    pub fn total(&self) -> Tally {
        self.families.iter().fold(Tally::default(), |sum, one| sum.plus(one))
    }
}

/// The case with a number.
pub fn case(seed: u64, number: u64) -> StressCase {
    let family = &FAMILIES[(number % FAMILIES.len() as u64) as usize];
    // Seeds of draws must differ in more than a few bits: SplitMix64 scatters them.
    let mut draw = Draw::new(seed.wrapping_mul(0xD134_2543_DE82_EF95).wrapping_add(number));
    let mut case = (family.draw)(&mut draw).named(family.name);
    family::add_neighbours(&mut draw, &mut case);
    case
}

/// Runs until the settings or ten failures end it; `progress` is called from time to time.
pub fn run(settings: &StressSettings, mut progress: impl FnMut(&StressReport)) -> StressReport {
    let start = Instant::now();
    let mut report = StressReport::empty();
    loop {
        report.add_round(settings.seed, report.cases..report.cases + ROUND, settings.precision);
        report.time = start.elapsed();
        progress(&report);
        let over = settings.rays.is_some_and(|rays| report.total().rays >= rays)
            || settings.time.is_some_and(|time| report.time >= time)
            || report.failures.len() >= MAX_FAILURES;
        if over {
            return report;
        }
    }
}

/// Runs a fixed number of cases, or those of their rounds that `holds` chooses by their places. The
/// first failures by seed and number are kept.
pub fn run_fixed(
    fixed: &FixedCases,
    precision: Precision,
    holds: impl Fn(usize) -> bool,
    mut progress: impl FnMut(&StressReport),
) -> StressReport {
    let start = Instant::now();
    let mut report = StressReport::empty();
    let rounds = fixed.cases.div_ceil(ROUND);
    let all = fixed.seeds.clone().flat_map(|seed| (0..rounds).map(move |round| (seed, round * ROUND)));
    for (_, (seed, first)) in all.enumerate().filter(|(place, _)| holds(*place)) {
        report.add_round(seed, first..fixed.cases.min(first + ROUND), precision);
        report.time = start.elapsed();
        progress(&report);
    }
    report
}

impl StressReport {
    fn empty() -> Self {
        Self {
            cases: 0,
            families: vec![Tally::default(); FAMILIES.len()],
            wrong: 0,
            failures: Vec::new(),
            time: Duration::ZERO,
        }
    }

    /// Runs some cases of a seed.
    fn add_round(&mut self, seed: u64, numbers: Range<u64>, precision: Precision) {
        let count = numbers.end - numbers.start;
        self.cases += count;
        let results: Vec<(u64, Result<Tally, Failure>)> = map_on_threads(count as usize, |at| {
            let number = numbers.start + at as u64;
            (number, judge::check_caught(&case(seed, number), precision))
        });
        for (number, result) in results {
            let Ok(tally) = result else {
                self.wrong += 1;
                if self.failures.len() < MAX_FAILURES {
                    let (case, failure) = minimise::minimise(&case(seed, number), precision);
                    self.failures.push(FoundFailure { seed, number, failure, case });
                }
                continue;
            };
            let family = &mut self.families[(number % FAMILIES.len() as u64) as usize];
            *family = family.plus(&tally);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_depends_on_its_number_alone() {
        for number in 0..2 * FAMILIES.len() as u64 {
            assert_eq!(format!("{:?}", case(7, number)), format!("{:?}", case(7, number)));
        }
        assert_ne!(case(7, 0), case(8, 0));
    }

    /// The judge must find errors: simple f32 arithmetic is wrong in every run.
    #[test]
    fn float_precision_is_found_wrong_and_the_case_is_minimised() {
        let settings = StressSettings { seed: 1, rays: Some(1), time: None, precision: Precision::Float };
        let report = run(&settings, |_| ());
        assert_eq!(report.failures.len(), MAX_FAILURES);
        for found in &report.failures {
            let again = check(&found.case, Precision::Float).expect_err("the smaller case fails, too");
            assert_eq!(again.to_string(), found.failure.to_string());
        }
    }

    #[test]
    fn parts_of_a_fixed_number_of_cases_are_disjoint_and_complete() {
        let fixed = FixedCases { seeds: 3..5, cases: 2500 };
        let run = |holds: &dyn Fn(usize) -> bool| run_fixed(&fixed, Precision::Exact, holds, |_| ());
        let whole = run(&|_| true);
        let parts = [0, 1].map(|part| run(&|place| place % 2 == part));
        // Two seeds of three rounds each: every other one.
        assert_eq!([whole.cases, parts[0].cases, parts[1].cases], [5000, 2500, 2500]);
        let sum = parts[0].total().plus(&parts[1].total());
        assert_eq!(whole.total(), sum);
        assert!(whole.failures.is_empty(), "{:#?}", whole.failures);
    }

    #[test]
    fn exact_answers_are_found_right() {
        let settings =
            StressSettings { seed: 2, rays: Some(200_000), time: None, precision: Precision::Exact };
        let report = run(&settings, |_| ());
        assert!(report.failures.is_empty(), "{:#?}", report.failures);
        for (family, tally) in FAMILIES.iter().zip(&report.families) {
            assert!(tally.rays > 0, "{}: {tally:?}", family.name);
            assert!(tally.hits > 0 || family.name == "bits", "{}: {tally:?}", family.name);
            let in_trees = ["meshes", "grids", "strands", "swarms", "soups", "places", "moving", "moved"];
            assert!(tally.trees > 0 || !in_trees.contains(&family.name), "{}: {tally:?}", family.name);
            let in_packets = ["meshes", "strands", "swarms", "places"];
            assert!(tally.packets > 0 || !in_packets.contains(&family.name), "{}: {tally:?}", family.name);
        }
    }
}
