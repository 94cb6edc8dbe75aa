//! Runs one entry point on one set of made-up values after the other.

use std::cell::OnceCell;
use std::sync::Arc;
use std::time::Instant;

use crate::smoke::fill::{FillExtent, MadeUpValues, WideIntegers};
use crate::smoke::grid::{groups, launch_size};
use crate::smoke::hits::{self, SmokeGeometry};
use crate::smoke::images::MadeUpImages;
use crate::smoke::judge::Try;
use crate::smoke::learned::{Learned, UsedMemory};
use crate::smoke::one_run::{Once, Way};
use crate::smoke::resources::{self, Given};
use crate::smoke::sets::Set;
use crate::smoke::watch::{Happened, OpRecorder, StandIn};
use crate::smoke::{SmokeOptions, specialized};
use anyhit_base::error::{ErrorKind, Result};
use anyhit_base::sorted::SortedSet;
use anyhit_engine::machine::{LaunchLimits, ShaderIndex};
use anyhit_engine::module::Module;
use anyhit_engine::module::dispatch_axes::{Grid, axes_read};
use anyhit_engine::module::interface::{EntryPoint, InterfaceVariable, Stage};
use anyhit_engine::pipeline::{Compute, Trapped};
use anyhit_engine::program::Program;
use anyhit_sanitize::rule::image::SAMPLER_MATCH;
use anyhit_sanitize::{Findings, Level, Levels, ProgramPlan, Sanitizer};
use anyhit_unit_test::block_counts::BlockCounts;
use anyhit_unit_test::blocks::Blocks;
use anyhit_unit_test::side_by_side::unordered;

/// Sets of values that one shader is tried on at most, for one kind of geometry.
const MOST_SETS: usize = 48;
/// New seeds without a new block after which no more are tried.
const PATIENCE: u32 = 4;
/// That number while there is a trap that no run has got past.
const LONG_PATIENCE: u32 = 12;
/// How often the fuel of a shader is halved once it has run out of it.
const LESS_FUEL: u32 = 7;
/// What a run counts beside its operations: making up its values takes time, too.
const FUEL_OF_A_RUN: u64 = 1 << 14;
/// Bytes that are made up for a run without a count, and how many of those beyond count as one
/// operation.
const FREE_BYTES: u64 = 1 << 25;
const BYTES_OF_AN_OPERATION: u64 = 8;
/// By how much the time of launches becomes shorter once the clock has ended one: what else there
/// is to run the shader for must not take as long again.
const LESS_TIME: u32 = 4;
/// What a ray counts beside its operations.
const FUEL_OF_A_RAY: u64 = 1 << 7;

/// What the runs of an entry point have come to so far.
pub(super) struct Progress {
    /// The blocks that were entered.
    pub blocks: Blocks,
    /// The instructions that were executed, by their word offset.
    pub executed: SortedSet<u32>,
    /// What happened, how often.
    pub happened: Happened,
    /// Sets of values that were tried.
    pub sets: u32,
    /// Operations that may still run.
    pub fuel: u64,
    /// When to stop whatever is still to be tried.
    pub deadline: Option<Instant>,
    /// Limits of each launch that is still to come.
    pub launch_limits: LaunchLimits,
    /// What kept further sets from being tried.
    pub cut_short: Option<&'static str>,
    /// What the sanitizer found.
    pub findings: Findings,
    /// Of what it found, by how the entry point is called, what depends on no input.
    pub certain: Vec<Findings>,
}

impl Progress {
    fn may_go_on(&mut self) -> bool {
        if self.cut_short.is_some() {
            return false;
        }
        if self.fuel == 0 {
            self.cut_short = Some("fuel");
        } else if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            self.cut_short = Some("time");
        }
        self.cut_short.is_none()
    }

    /// Notes that the clock ended a launch, which no fuel tells: what is costly is the operations,
    /// not how many there are, and with other values they would be as costly again.
    fn run_out_of_time(&mut self) {
        self.cut_short = Some("time");
        let LaunchLimits { timeout, batch_timeout, .. } = &mut self.launch_limits;
        for time in [timeout, batch_timeout].into_iter().flatten() {
            *time /= LESS_TIME;
        }
    }

    fn is_whole(&self) -> bool {
        self.blocks.entered() == self.blocks.all()
    }
}

/// The shader that is tested.
pub(super) struct EntryUnderTest<'a> {
    /// Its module.
    pub module: &'a Arc<Module>,
    /// Its entry point.
    pub entry: &'a EntryPoint,
    /// With the defaults of its specialization constants.
    pub program: Arc<Program>,
    /// With other values of them, made when they are needed; each with its constant in words.
    pub specialized: OnceCell<Vec<(String, Arc<Program>)>>,
    /// What it uses.
    pub variables: Vec<InterfaceVariable>,
    /// The images of its module that are made up already.
    pub images: &'a MadeUpImages,
    /// How to run it.
    pub options: SmokeOptions,
}

impl EntryUnderTest<'_> {
    /// What it is run for.
    pub(super) fn ways(&self) -> Vec<Way> {
        match self.program.stage {
            Stage::ClosestHit | Stage::AnyHit => {
                SmokeGeometry::of_program(&self.program).into_iter().map(Way::Hit).collect()
            }
            Stage::Intersection => vec![Way::Box],
            Stage::Miss => vec![Way::Miss],
            Stage::Callable => vec![Way::Call],
            Stage::Compute => vec![Way::Dispatch],
            _ => vec![Way::Launch],
        }
    }

    /// Runs it on sets of values until every block was entered and it ran to its end, or new ones
    /// lead nowhere new; the first one at least.
    ///
    /// # Errors
    /// What making up its values reports.
    pub(super) fn explore(&self, way: Way, progress: &mut Progress) -> Result<Vec<Try>> {
        let mut tries: Vec<Try> = Vec::new();
        let mut learned = Learned::default();
        let mut dry = 0;
        for at in 0..MOST_SETS {
            let is_settled = Try::verdict(&tries).is_none();
            if at > 0 && (progress.is_whole() && is_settled || !progress.may_go_on()) {
                break;
            }
            let specialized = if at < Set::fixed(0) { &[][..] } else { self.specialized() };
            let patience = if is_settled { PATIENCE } else { LONG_PATIENCE };
            if at >= Set::fixed(specialized.len()) && dry >= patience {
                break;
            }
            let set = Set::nth(at, self.options.seed, specialized.len());
            let program = match set.specialization.checked_sub(1) {
                Some(other) => &specialized[other].1,
                None => &self.program,
            };
            let reached = |progress: &Progress| (progress.blocks.entered(), progress.executed.len());
            let before = reached(progress);
            let (one, values) = self.settle(way, program, set, &mut learned, progress)?;
            if at == 0 {
                self.check_unwatched(way, &one, values, &learned)?;
            }
            if self.options.sanitize {
                let is_trapped = one.trapped.is_some();
                let (found, _) = self.sanitized(way, program, (set, values), is_trapped, &mut learned)?;
                if at == 0 {
                    progress.certain.push(self.certain(way, found.clone(), values, &mut learned));
                }
                progress.findings.extend(found);
            }
            dry = if reached(progress) > before || at < Set::fixed(specialized.len()) { 0 } else { dry + 1 };
            progress.sets += 1;
            tries.push(one);
        }
        Ok(tries)
    }

    /// The programs with other values of specialization constants.
    pub(super) fn specialized(&self) -> &[(String, Arc<Program>)] {
        self.specialized.get_or_init(|| specialized::programs(self.module, self.entry, &self.program))
    }

    /// Runs it until every address that it goes to leads somewhere, and no resource is too small
    /// that a larger one would do for.
    fn settle(
        &self,
        way: Way,
        program: &Arc<Program>,
        set: Set,
        learned: &mut Learned,
        progress: &mut Progress,
    ) -> Result<(Try, MadeUpValues)> {
        let mut wide = WideIntegers::Numbers;
        learned.geometry = None;
        loop {
            let extent = FillExtent { invocations: self.invocations(way, program)?, scale: learned.scale };
            let values = MadeUpValues { numbers: set.numbers, wide, extent };
            let given = match self.given(program, values, learned) {
                Err(error) if error.kind() == ErrorKind::UnsupportedModule && learned.give_up_larger() => {
                    continue;
                }
                given => given?,
            };
            let (mut counts, mut ran) = (BlockCounts::default(), OpRecorder::new(program));
            let mut stand_in = StandIn::new(program, set.numbers);
            let fuel = self.options.fuel >> if learned.is_spent { LESS_FUEL } else { 0 };
            let limits = progress.launch_limits;
            let run = Once {
                way,
                program,
                given: &given,
                set,
                launch_size: self.launch_size(way, set.is_single),
                fuel,
                limits,
            };
            let trapped = run.run(&mut stand_in, Some(&mut (&mut counts, &mut ran)))?;
            learned.is_spent |= trapped.as_ref().is_some_and(|trap| trap.code.is_limit());
            let is_late = trapped.as_ref().is_some_and(|trap| trap.code.is_of_clock());
            if is_late {
                progress.run_out_of_time();
            }
            let happened = stand_in.happened;
            let rays = (happened.traces + happened.ray_queries).saturating_mul(FUEL_OF_A_RAY);
            let made = given.made.saturating_sub(FREE_BYTES) / BYTES_OF_AN_OPERATION;
            progress.fuel = progress.fuel.saturating_sub(ran.spent + rays + made + FUEL_OF_A_RUN);
            let is_last = match &trapped {
                None => true,
                Some(_) if is_late => true,
                Some(trapped) => {
                    let shader = UsedMemory { module: self.module, variables: &self.variables };
                    !learned.learn(shader, trapped, &given, &mut wide, &mut progress.fuel)
                }
            };
            if is_last {
                progress.blocks.enter(program, &counts, ShaderIndex(0));
                progress.executed.extend(ran.executed());
                let sum = &mut progress.happened;
                sum.traces += happened.traces;
                sum.ray_queries += happened.ray_queries;
                sum.any_hits += happened.any_hits;
                sum.reports += happened.reports;
                let mended = learned.mended.take().filter(|_| trapped.is_none());
                return Ok((Try { set, trapped, passed: ran.passed(), mended }, values));
            }
        }
    }

    /// What it finds bound.
    fn given(&self, program: &Program, values: MadeUpValues, learned: &Learned) -> Result<Given> {
        let scene = || hits::scene(learned.geometry);
        let mut given =
            resources::given(program, &self.variables, values, &learned.known, self.images, &scene)?;
        given.resources.traps_outside_images = !learned.leaves_images;
        Ok(given)
    }

    /// Invocations of a launch along each axis: one alone, or as many as the shader tells apart.
    fn launch_size(&self, way: Way, is_single: bool) -> [u32; 3] {
        // Other stages than ray generation stand in a launch that has both axes.
        let asks = if way == Way::Launch { axes_read(self.module, Grid::Launch) } else { [true; 3] };
        if is_single { [1; 3] } else { launch_size(asks) }
    }

    /// Invocations along each axis.
    fn invocations(&self, way: Way, program: &Arc<Program>) -> Result<[u32; 3]> {
        if way != Way::Dispatch {
            return Ok(self.launch_size(way, false));
        }
        let size = Compute::new(program.clone())?.workgroup_size();
        let groups = groups(&program.module, size, true);
        Ok([0, 1, 2].map(|axis| size[axis].saturating_mul(groups[axis])))
    }

    /// Runs it once more without observers, in its optimised form, which must end alike.
    fn check_unwatched(
        &self,
        way: Way,
        watched: &Try,
        values: MadeUpValues,
        learned: &Learned,
    ) -> Result<()> {
        // What ends only for want of fuel takes long enough.
        if learned.is_spent {
            return Ok(());
        }
        let program = &self.program;
        let given = self.given(program, values, learned)?;
        let mut stand_in = StandIn::new(program, watched.set.numbers);
        let (fuel, limits) = (self.options.fuel, self.options.launch_limits);
        let run = Once {
            way,
            program,
            given: &given,
            set: watched.set,
            launch_size: self.launch_size(way, watched.set.is_single),
            fuel,
            limits,
        };
        let trapped = run.run(&mut stand_in, None)?;
        // The clock is no part of what a shader does.
        if trapped.as_ref().is_some_and(|trap| trap.code.is_of_clock()) {
            return Ok(());
        }
        let end = |trapped: &Option<Box<Trapped>>| trapped.as_ref().map(|trap| (trap.code, trap.offset));
        let (watched, unwatched) = (end(&watched.trapped), end(&trapped));
        assert_eq!(watched, unwatched, "bug in anyhit: the optimised shader ends differently");
        Ok(())
    }
}

impl EntryUnderTest<'_> {
    /// What depends neither on the values of inputs nor on how many invocations there are, of what
    /// was found on the first set of values: it is found on each set that is tried before new seeds
    /// follow and on which the shader runs to its end, one invocation or workgroup among them.
    fn certain(&self, way: Way, found: Findings, values: MadeUpValues, learned: &mut Learned) -> Findings {
        /// Fewer sets show nothing.
        const LEAST: usize = 2;
        if found.is_empty() {
            return found;
        }
        let (mut on_others, mut is_single) = (Vec::new(), false);
        for at in 1..Set::fixed(0) {
            let set = Set::nth(at, self.options.seed, 0);
            let values = MadeUpValues { numbers: set.numbers, ..values };
            // Values that cannot be made show nothing, either.
            let on_set = self.sanitized(way, &self.program, (set, values), false, learned);
            let Ok((on_set, true)) = on_set else {
                continue;
            };
            on_others.push(on_set);
            is_single |= set.is_single;
        }
        if on_others.len() < LEAST || !is_single {
            return Findings::default();
        }
        found.only_in_all(&on_others)
    }

    /// What the sanitizer finds in a run on a set of values, and whether the run came to its end;
    /// `is_trapped` says whether it traps without the sanitizer, too.
    fn sanitized(
        &self,
        way: Way,
        program: &Arc<Program>,
        (set, values): (Set, MadeUpValues),
        is_trapped: bool,
        learned: &mut Learned,
    ) -> Result<(Findings, bool)> {
        // What ends for want of fuel takes long enough.
        if learned.is_spent {
            return Ok((Findings::default(), false));
        }
        // Results do not matter here, and lanes are compared side by side.
        let program = &unordered(&Arc::new(program.for_sanitizer()?));
        // The inputs may be such that the shader never gets: nothing is denied.
        let mut levels = Levels::default();
        levels.set_all(Level::Warn);
        // The made-up samplers are of all kinds at once.
        levels.set(SAMPLER_MATCH.id, Level::Allow)?;
        let plans = [ProgramPlan::new(program)];
        let (mut wide, mut fuel) = (values.wide, self.options.fuel);
        loop {
            let extent = FillExtent { scale: learned.scale, ..values.extent };
            let values = MadeUpValues { wide, extent, ..values };
            let given = match self.given(program, values, learned) {
                Err(error) if error.kind() == ErrorKind::UnsupportedModule && learned.give_up_larger() => {
                    continue;
                }
                given => given?,
            };
            let mut stand_in = StandIn::new(program, set.numbers);
            let run = Once {
                way,
                program,
                given: &given,
                set,
                launch_size: self.launch_size(way, set.is_single),
                fuel: self.options.fuel,
                limits: self.options.launch_limits,
            };
            let mut sanitizer = Sanitizer::new(&plans, &levels);
            let trapped = run.run(&mut stand_in, Some(&mut sanitizer))?;
            let has_ended = trapped.is_none();
            // Only what the optimizer eliminates traps here and nowhere else: it lacks the same
            // memory.
            let trapped = trapped.filter(|trap| !is_trapped && !trap.code.is_limit());
            let shader = UsedMemory { module: self.module, variables: &self.variables };
            if let Some(trap) = &trapped
                && learned.learn(shader, trap, &given, &mut wide, &mut fuel)
            {
                continue;
            }
            learned.mended = None;
            let mut findings = sanitizer.into_findings();
            if let Some(trap) = trapped {
                findings.add_stop_at_level(&trap.error, Level::Warn);
            }
            return Ok((findings, has_ended));
        }
    }
}
