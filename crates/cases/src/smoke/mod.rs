//! Smoke tests: every entry point of a module, run on made-up inputs until that leads nowhere new.
//!
//! What a shader would find bound is made up from what it declares, from a seed: integers are 0 to
//! 3, floats lie in [0, 1), matrices are the identity; runtime arrays have 1024 elements, arrays of
//! descriptors 16, images 16 texels a side or one for each invocation, and all their levels. Each
//! number follows from its set, binding, array element and byte offset alone, so that neither the
//! order of declarations nor what an optimizer removes changes the others. Pointers lead to memory
//! of what they point to. A 64-bit integer or a pair of 32-bit ones becomes an address where the
//! shader is seen to go to memory through it: the run is repeated until every address leads
//! somewhere. Where it goes beyond a buffer or image, these become larger.
//!
//! A ray generation shader is launched over 8 x 4 invocations, or 32 in a row where it asks for one
//! axis of its launch index alone; a compute shader is dispatched in 2 x 2 workgroups, or fewer
//! where it does not ask where along an axis it is. Closest-hit and any-hit
//! shaders see a hit of each kind of geometry that they may be called for, intersection shaders a
//! box, miss shaders a ray. Where a shader traces, the ray really is traced through a scene with
//! all kinds of primitives; in the place of the shaders that are not there, the payload is filled
//! like all else, one time in four as by a miss (floats -1, integers 0). So are callable data.
//!
//! One such set of values shows little of a shader: others follow until every block of it was
//! entered, or new seeds enter no new one. The report says how many blocks that were, and how many
//! rays were traced. A trap that other values get past is a note; one that no values get past is
//! told, and that the values were made up.

mod fill;
mod grid;
mod hits;
mod images;
mod judge;
mod learned;
mod one_run;
mod report;
mod resources;
mod sets;
mod specialized;
mod subject;
mod watch;

use std::cell::OnceCell;
use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::smoke::images::MadeUpImages;
use crate::smoke::judge::Try;
use crate::smoke::one_run::Way;
use crate::smoke::subject::{EntryUnderTest, Progress};
use crate::smoke::watch::{Happened, tracing};
use anyhit_base::error::{Error, ErrorClass, ErrorKind, ErrorReport, Result};
use anyhit_base::sorted::SortedSet;
use anyhit_engine::machine::{LaunchLimits, ShaderIndex};
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::{EntryPoint, Stage};
use anyhit_engine::program::{self, Program, obstacles};
use anyhit_sanitize::module_checks::check_module;
use anyhit_sanitize::{Findings, Levels};
use anyhit_unit_test::blocks::Blocks;

pub use report::{BlockCoverage, EntryReport, RunReport, SmokeReport, SmokeTrap, SmokeVerdict};

/// How to run a smoke test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub struct SmokeOptions {
    /// The seed of all values.
    pub seed: u64,
    /// Instructions that an invocation may execute, counted at back edges, calls and stops.
    pub fuel: u64,
    /// The limits of each launch or dispatch.
    pub launch_limits: LaunchLimits,
    /// Operations, counted once for all lanes of a batch, after which no further set of values is
    /// tried on an entry point. The first is always tried.
    pub total_fuel: u64,
    /// Time after which no further set of values is tried. What is reported then depends on the
    /// machine, and says so.
    pub time_limit: Option<Duration>,
    /// Whether every set of values is run under the sanitizer, too.
    pub sanitize: bool,
}

impl SmokeOptions {
    /// Sets the seed of all values.
    #[must_use]
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Sets how many instructions an invocation may execute.
    #[must_use]
    pub fn fuel(self, instructions: u64) -> Self {
        Self { fuel: instructions, ..self }
    }

    /// Sets the limits of each launch.
    #[must_use]
    pub fn launch_limits(self, limits: LaunchLimits) -> Self {
        Self { launch_limits: limits, ..self }
    }

    /// Sets how many operations may run, counted once for all lanes of a batch, before no further
    /// set of values is tried.
    #[must_use]
    pub fn total_fuel(self, instructions: u64) -> Self {
        Self { total_fuel: instructions, ..self }
    }

    /// Sets how long the search for values that reach more may take.
    #[must_use]
    pub fn time_limit(self, limit: Duration) -> Self {
        Self { time_limit: Some(limit), ..self }
    }

    /// Runs every set of values under the sanitizer, too.
    #[must_use]
    pub fn sanitize(self) -> Self {
        Self { sanitize: true, ..self }
    }
}

impl Default for SmokeOptions {
    fn default() -> Self {
        // A call costs all instructions of the function called, of which a module is known to have
        // 164,798 once it is inlined.
        let (fuel, launch_limits) = (1 << 21, LaunchLimits::SMOKE);
        Self { seed: 1, fuel, launch_limits, total_fuel: 1 << 27, time_limit: None, sanitize: false }
    }
}

impl SmokeReport {
    /// Runs every entry point of a module.
    ///
    /// ```
    /// use anyhit::{Module, SmokeOptions, SmokeReport};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let module = Module::open("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv")?;
    /// let report = SmokeReport::of(&module, SmokeOptions::default());
    /// assert!(report.is_ok(), "{}", report.text());
    /// let entry = &report.entry_points[0];
    /// assert_eq!(entry.runs[0].with, "sphere");
    /// // It has no branches: one block.
    /// let reached = entry.coverage.as_ref().expect("an entry point that runs");
    /// assert_eq!((reached.blocks_entered, reached.blocks), (1, 1));
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn of(module: &Arc<Module>, options: SmokeOptions) -> Self {
        let deadline = options.time_limit.and_then(|limit| Instant::now().checked_add(limit));
        let images = MadeUpImages::default();
        let entries = module.entry_points.iter();
        let reports = entries.map(|entry| entry_point(module, entry, options, deadline, &images));
        Self { seed: options.seed, entry_points: reports.collect() }
    }
}

fn entry_point(
    module: &Arc<Module>,
    entry: &EntryPoint,
    options: SmokeOptions,
    deadline: Option<Instant>,
    images: &MadeUpImages,
) -> EntryReport {
    let mut report = EntryReport {
        name: entry.name.clone(),
        stage: entry.stage.name(),
        result: SmokeVerdict::Ok,
        reasons: Vec::new(),
        errors: Vec::new(),
        coverage: None,
        runs: Vec::new(),
        findings: Findings::default(),
    };
    let lowered = guarded(|| program::lower(module, entry));
    let program = match lowered {
        Ok(Ok(program)) => Arc::new(program),
        Ok(Err(error)) => {
            report.result = match (entry.stage, error.kind()) {
                (Stage::Other(_), _) => SmokeVerdict::OutOfScope,
                (_, ErrorKind::InvalidModule) => SmokeVerdict::Invalid,
                _ if error.class() == ErrorClass::Limit => SmokeVerdict::Limit,
                _ => SmokeVerdict::Unsupported,
            };
            report.reasons = obstacles(module, entry, &error);
            report.errors = ErrorReport::all(&error);
            return report;
        }
        Err(bug) => {
            report.result = SmokeVerdict::Bug;
            report.errors.push(bug_report(&bug));
            report.reasons.push(bug);
            return report;
        }
    };
    let variables = module.interface_of(entry);
    let specialized = OnceCell::new();
    let subject = EntryUnderTest { module, entry, program, specialized, variables, images, options };
    let mut progress = Progress {
        blocks: Blocks::of(module, entry),
        executed: SortedSet::new(),
        happened: Happened::default(),
        sets: 0,
        fuel: options.total_fuel,
        deadline,
        launch_limits: options.launch_limits,
        cut_short: None,
        findings: Findings::default(),
        certain: Vec::new(),
    };
    let mut explored: Vec<(Way, Vec<Try>)> = Vec::new();
    for way in subject.ways() {
        let run = match guarded(|| subject.explore(way, &mut progress)) {
            Ok(Ok(tries)) => {
                let run = ended(&subject, way, &tries);
                explored.push((way, tries));
                run
            }
            Ok(Err(error)) => {
                report.reasons.push(error.to_string());
                report.errors.push(ErrorReport::of(&error));
                RunReport { with: way.name(), result: verdict(&error), trap: None, note: None }
            }
            Err(bug) => {
                report.errors.push(bug_report(&bug));
                report.reasons.push(bug);
                RunReport { with: way.name(), result: SmokeVerdict::Bug, trap: None, note: None }
            }
        };
        report.runs.push(run);
    }
    excuse_kinds(&mut report.runs, &explored);
    let counted = report.runs.iter().filter(|run| !run.is_note());
    report.result = counted.map(|run| run.result).max().unwrap_or(SmokeVerdict::Ok);
    report.coverage = Some(reached(&subject.program, &progress));
    if options.sanitize {
        // What the module alone shows depends on no input.
        report.findings = check_module(&subject.program, ShaderIndex(0), &Levels::default());
    }
    let found = progress.findings.with_defaults_of_all(&progress.certain, "on synthetic inputs");
    report.findings.extend(found);
    report
}

/// What the runs for one way of being called come to.
fn ended(subject: &EntryUnderTest<'_>, way: Way, tries: &[Try]) -> RunReport {
    let describe = |one: &Try| match one.set.specialization.checked_sub(1) {
        Some(other) => format!("{}, {}", one.set.words(), subject.specialized()[other].0),
        None => one.set.words(),
    };
    let many = |count: usize| format!("{count} set{} of values", if count == 1 { "" } else { "s" });
    if let Some(trap) = Try::verdict(tries) {
        let here = tries.iter().filter(|one| one.traps_at(trap)).count();
        let past = tries.iter().filter(|one| one.passes(trap.offset)).count();
        let mut note = format!(
            "on synthetic inputs; {} tried: {here} trapped here, {past} passed this instruction",
            many(tries.len())
        );
        if let Some(first) = tries.iter().find(|one| one.traps_at(trap)) {
            note += &format!("; the first: {}", describe(first));
        }
        let error = trap.error.clone().note(note);
        let trap = Some(SmokeTrap::of(&error, trap.offset));
        return RunReport { with: way.name(), result: SmokeVerdict::Trap, trap, note: None };
    }
    let mut notes: Vec<String> = Vec::new();
    for trap in Try::excused(tries) {
        let mut here = tries.iter().filter(|one| one.traps_at(trap));
        let count = here.clone().count();
        let first = here.next().map(describe).unwrap_or_default();
        let of = many(tries.len());
        notes.push(format!("on synthetic inputs, {count} of {of} trapped ({first}): {}", trap.error));
    }
    let mut needed = tries.iter().filter_map(|one| one.mended.as_ref());
    notes.extend(needed.next().map(|(what, trap)| format!("runs with {what}; otherwise: {}", trap.error)));
    let note = (!notes.is_empty()).then(|| notes.join("\n"));
    RunReport { with: way.name(), result: SmokeVerdict::Ok, trap: None, note }
}

/// Where one kind of geometry passes, another kind's trap is a note: a shader need not be meant for
/// all. But where the operands of a trace break a rule, another kind must get past that trace.
fn excuse_kinds(runs: &mut [RunReport], explored: &[(Way, Vec<Try>)]) {
    let passing: Vec<&str> =
        runs.iter().filter(|run| run.result == SmokeVerdict::Ok).map(|run| run.with).collect();
    let Some(other) = passing.first() else { return };
    for run in runs.iter_mut().filter(|run| run.result == SmokeVerdict::Trap) {
        let Some((_, own)) = explored.iter().find(|(way, _)| way.name() == run.with) else { continue };
        let Some(trap) = Try::verdict(own) else { continue };
        let mut others = explored.iter().flat_map(|(_, tries)| tries);
        let past = |one: &Try| one.set.has_different_floats() && one.passes(trap.offset);
        if !judge::is_of_rays(trap) || others.any(past) {
            run.note = Some(format!("{other} passes: this shader may not be used with {}", run.with));
        }
    }
}

/// What all runs of an entry point reached.
fn reached(program: &Program, progress: &Progress) -> BlockCoverage {
    let module = &*program.module;
    let [traces, queries] = tracing(program);
    let executed = |all: &SortedSet<u32>| all.intersection(&progress.executed).count();
    let Happened { traces: traced, ray_queries, any_hits, reports } = progress.happened;
    let (mut missing, mut known) = (Vec::new(), HashSet::new());
    for offset in progress.blocks.missing() {
        let place = match module.debug_info.line_at(offset) {
            Some(line) => {
                let file = module.debug_info.files.get(line.file as usize).map_or("", |file| &file.name);
                format!("{file}:{}", line.line)
            }
            None => format!("word {offset}"),
        };
        if known.insert(place.clone()) {
            missing.push(place);
        }
    }
    BlockCoverage {
        blocks_entered: progress.blocks.entered(),
        blocks: progress.blocks.all(),
        blocks_not_entered: missing,
        trace_instructions_reached: executed(&traces),
        trace_instructions: traces.len(),
        query_instructions_reached: executed(&queries),
        query_instructions: queries.len(),
        rays_traced: traced,
        ray_queries,
        any_hits,
        reports,
        sets: progress.sets,
        cut_short: progress.cut_short,
    }
}

fn verdict(error: &Error) -> SmokeVerdict {
    match error.kind() {
        _ if error.class() == ErrorClass::Limit => SmokeVerdict::Limit,
        ErrorKind::UnsupportedModule => SmokeVerdict::Unsupported,
        ErrorKind::InvalidModule => SmokeVerdict::Invalid,
        _ => SmokeVerdict::Bug,
    }
}

/// A bug of this crate in the shape of an error, of no class of its own.
fn bug_report(bug: &str) -> ErrorReport {
    let class = ErrorClass::Other.name();
    ErrorReport {
        message: bug.to_owned(),
        class,
        notes: Vec::new(),
        report: format!("error: {bug}\n"),
        trap: None,
    }
}

/// Keeps a panic from ending the whole test: it is a bug, but of one entry point.
fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic");
        format!("bug in anyhit: {}", text.trim_start_matches("bug in anyhit: "))
    })
}
