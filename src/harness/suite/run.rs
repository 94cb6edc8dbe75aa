//! Runs the tests of a suite in parallel.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use crate::debug::render::{self, RenderOptions};
use crate::debug::session::ResolvedRequest;
use crate::debug::transcript::TranscriptLine;
use crate::debug::{ExplainRequest, Session, command, shell};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::harness::blame::{Writer, writer};
use crate::harness::bless::bless;
use crate::harness::case::Loaded;
use crate::harness::coverage::{Coverage, Recorder};
use crate::harness::expect::{Difference, Fix, Subject};
use crate::harness::many_seeds::ManySeeds;
use crate::harness::observe::fresh_resources;
use crate::harness::rendering;
use crate::harness::run::{RayMeasurements, launch_covered, rays, run_launch, run_ray};
use crate::harness::sanitize_table::scene_levels;
use crate::harness::sanitized::{SanitizedRun, check_scene, run_sanitized, sanitize_one};
use crate::harness::stability::found::ShadowFindings;
use crate::harness::stability::perturb::{perturb, perturb_one};
use crate::harness::stability::shadow::{shadow, shadow_one};
use crate::harness::stability::{Instability, Perturbation};
use crate::harness::suite::{Finished, Outcome, Part, Source, Suite, Test, TestFailure, pictures};
use crate::input::{InputLimit, InputLimits};
use crate::machine::LaunchLimits;
use crate::sanitize::{Findings, Levels};
use crate::scene::file::{GivenRay, RayEntry};
use crate::scene::{Assembled, ResolvedScene, RunLimits};

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
    /// Whether the explanation of the ray is left out of failures.
    pub no_explanation: bool,
    /// Whether explanations are in colour.
    pub colour: bool,
    /// The limits of running; by default those of [`LaunchLimits::TESTS`].
    pub limits: RunLimits,
    /// Where pictures that differ are saved.
    pub pictures: PathBuf,
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
            no_explanation: false,
            colour: false,
            limits: RunLimits { default: LaunchLimits::TESTS, ..RunLimits::default() },
            pictures: PathBuf::new(),
        }
    }
}

/// A suite that has run.
#[derive(Debug, Default)]
pub struct SuiteReport {
    /// Every test that was reported, in order.
    pub finished: Vec<Finished>,
    /// Tests that did not run, because one before failed.
    pub left_out: usize,
    /// Coverage, where it was asked for.
    pub coverage: Coverage,
    /// What the shadows of all tests showed, where they were asked for.
    pub shadow: ShadowFindings,
    /// How many tests passed and were held to stable outputs, where that was asked for.
    pub perturbed: usize,
    /// What the sanitizer found where it was asked for; else what is undefined before anything
    /// runs, as warnings.
    pub findings: Findings,
    /// Files that were written anew.
    pub renewed: Vec<PathBuf>,
    /// Notes for the authors of the tests, a line each, each once: old names that files use.
    pub notes: Vec<String>,
}

impl Suite {
    /// Runs the tests and reports each as soon as all before it are reported: no result and no
    /// order depends on how many run in parallel.
    ///
    /// # Errors
    /// `Io` where a scene file cannot be written anew, and where telling fails.
    pub fn run(
        &self,
        options: &SuiteOptions,
        tell: &mut dyn FnMut(&Finished) -> Result<()>,
    ) -> Result<SuiteReport> {
        let groups: Vec<&[Test]> = self.tests.chunk_by(|one, next| one.case == next.case).collect();
        let jobs = match options.jobs {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            jobs => jobs,
        };
        let mut report = SuiteReport::default();
        let mut fixes = Vec::new();
        let stop = AtomicBool::new(false);
        let mut take = |done: Done| -> Result<()> {
            for mut finished in done.finished {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                renew(&mut finished, options, &mut fixes);
                tell(&finished)?;
                let fails = matches!(finished.outcome, Outcome::Failed(_) | Outcome::Broken(_));
                report.finished.push(finished);
                if fails && options.fail_fast {
                    stop.store(true, Ordering::Relaxed);
                }
            }
            report.findings.extend(done.findings);
            report.coverage.add(done.coverage);
            report.shadow.add(&done.shadow);
            report.perturbed += done.perturbed;
            for note in done.notes {
                if !report.notes.contains(&note) {
                    report.notes.push(note);
                }
            }
            Ok(())
        };
        if jobs == 1 || groups.len() <= 1 {
            for group in groups {
                take(self.group(group, options))?;
                if stop.load(Ordering::Relaxed) {
                    break;
                }
            }
        } else {
            self.side_by_side(&groups, jobs, options, &stop, &mut take)?;
        }
        report.left_out = self.tests.len() - report.finished.len();
        report.renewed = bless(fixes, &self.limits())?;
        Ok(report)
    }

    /// The limits that its files were read with.
    fn limits(&self) -> InputLimits {
        let limits = InputLimits::default();
        let bytes = self.cases.iter().filter_map(|source| match source {
            Source::Case(case) => Some(case.files.limits.get(InputLimit::SceneBytes)),
            Source::Broken(..) => None,
        });
        bytes.max().map_or(limits, |most| limits.with(InputLimit::SceneBytes, most))
    }

    /// Runs groups on several threads, and takes what is done in order.
    fn side_by_side(
        &self,
        groups: &[&[Test]],
        jobs: usize,
        options: &SuiteOptions,
        stop: &AtomicBool,
        take: &mut dyn FnMut(Done) -> Result<()>,
    ) -> Result<()> {
        let next = AtomicUsize::new(0);
        let (sender, receiver) = mpsc::channel();
        std::thread::scope(|scope| {
            for _ in 0..jobs.min(groups.len()) {
                let (sender, next) = (sender.clone(), &next);
                scope.spawn(move || {
                    loop {
                        let at = next.fetch_add(1, Ordering::Relaxed);
                        if at >= groups.len() || stop.load(Ordering::Relaxed) {
                            break;
                        }
                        // The receiver is gone once a report has failed.
                        if sender.send((at, self.group(groups[at], options))).is_err() {
                            break;
                        }
                    }
                });
            }
            drop(sender);
            let mut waiting: Vec<Option<Done>> = groups.iter().map(|_| None).collect();
            let mut told = 0;
            for (at, done) in receiver {
                waiting[at] = Some(done);
                while let Some(done) = waiting.get_mut(told).and_then(Option::take) {
                    told += 1;
                    if let Err(error) = take(done) {
                        stop.store(true, Ordering::Relaxed);
                        return Err(error);
                    }
                }
            }
            Ok(())
        })
    }

    /// Runs the chosen tests of one case.
    fn group(&self, tests: &[Test], options: &SuiteOptions) -> Done {
        let begin = Instant::now();
        let (case, file) = match &self.cases[tests[0].case] {
            Source::Case(case) => (case, case.scene.clone()),
            Source::Broken(file, error) => return Done::broken(tests, file, error),
        };
        let loaded = match case.load_limited(&options.limits) {
            Ok(loaded) => loaded,
            Err(error) => return Done::broken(tests, &file, &error),
        };
        let loading = begin.elapsed() / tests.len() as u32;
        let mut recorder = options.coverage.then(Recorder::default);
        let mut finished = Vec::new();
        let mut shadow = ShadowFindings::default();
        let mut perturbed = 0;
        let known = match &options.sanitize {
            Some(_) => Ok(Findings::default()),
            None => known_before(&loaded.scene, &loaded.assembled),
        };
        let mut findings = match known {
            Ok(findings) => findings,
            Err(error) => return Done::broken(tests, &file, &error),
        };
        for test in tests {
            let begin = Instant::now();
            let tester = Tester { loaded: &loaded, test, options, is_variant: case.variant.is_some() };
            let outcome = match test.part {
                Part::Launch => tester.launch(&mut recorder),
                Part::Ray(ray) => tester.ray(ray, &mut recorder),
            };
            let mut outcome = outcome.unwrap_or_else(Outcome::Broken);
            if let (Outcome::Passed, Some(perturbation)) = (&outcome, &options.perturb) {
                if tester.says_what_is_stable() {
                    perturbed += 1;
                } else if let Ok(found) = tester.perturbed(perturbation) {
                    perturbed += 1;
                    let differences = unstable(&found, &file);
                    outcome = tester.outcome(differences, None, tester.part());
                }
            }
            if let (Outcome::Passed, Some(levels)) = (&outcome, &options.sanitize) {
                let found = tester.sanitized(levels).map(|run| run.findings);
                outcome = tester.judge(found, &mut findings);
            }
            if let (Outcome::Passed, Some(drawn), None) = (&outcome, &options.many_seeds, tester.part()) {
                outcome = tester.judge(tester.drawn(drawn), &mut findings);
            }
            if options.shadow {
                // What cannot run one by one is left out, as is what the trap of a test cut off.
                if let Ok((found, _)) = tester.shadow() {
                    shadow.add(&found);
                }
            }
            let took = loading + begin.elapsed();
            finished.push(Finished { name: test.name.clone(), file: file.clone(), outcome, took });
        }
        let coverage = recorder.map(|one| one.coverage(&loaded.scene, &loaded.assembled));
        let notes = [&loaded.scene.notes[..], &loaded.assembled.notes, &loaded.expectations.notes].concat();
        Done { finished, coverage: coverage.unwrap_or_default(), shadow, perturbed, findings, notes }
    }
}

/// What is undefined in a scene before it runs; nobody need ask for it, so that it only warns.
fn known_before(scene: &ResolvedScene, assembled: &Assembled) -> Result<Findings> {
    let mut findings = check_scene(scene, assembled, &scene_levels(&scene.document)?);
    findings.warn_of_denied("`--sanitize` fails here, and looks at what runs");
    Ok(findings)
}

/// The tests of a case that have run.
struct Done {
    finished: Vec<Finished>,
    coverage: Coverage,
    shadow: ShadowFindings,
    perturbed: usize,
    findings: Findings,
    notes: Vec<String>,
}

impl Done {
    /// The tests of a case that cannot be loaded: the first holds the error, the others name the
    /// first.
    fn broken(tests: &[Test], file: &Path, error: &Error) -> Self {
        let again = || {
            let message = format!("not run, for the same reason as `{}`: {}", tests[0].name, error.message());
            Error::new(error.kind(), message)
        };
        let finished = tests.iter().enumerate().map(|(at, test)| Finished {
            name: test.name.clone(),
            file: file.to_path_buf(),
            outcome: Outcome::Broken(if at == 0 { error.clone() } else { again() }),
            took: Duration::ZERO,
        });
        let (coverage, shadow) = (Coverage::default(), ShadowFindings::default());
        Self {
            finished: finished.collect(),
            coverage,
            shadow,
            perturbed: 0,
            findings: Findings::default(),
            notes: Vec::new(),
        }
    }
}

/// With `bless`, a failure whose values are all recorded is renewed, and others keep a word on why
/// not.
fn renew(finished: &mut Finished, options: &SuiteOptions, fixes: &mut Vec<Fix>) {
    let Outcome::Failed(failure) = &mut finished.outcome else { return };
    if !options.bless {
        return;
    }
    if failure.mendable {
        fixes.append(&mut failure.fixes);
        finished.outcome = Outcome::Renewed;
        return;
    }
    if let Some(error) = failure.errors.last_mut() {
        let why =
            "not written anew: values with `because` are derived, and some differences no value can mend";
        *error = error.clone().note(why);
    }
}

/// One test of a loaded case.
struct Tester<'a> {
    loaded: &'a Loaded,
    test: &'a Test,
    options: &'a SuiteOptions,
    is_variant: bool,
}

impl Tester<'_> {
    fn shadow(&self) -> Result<(ShadowFindings, Option<Error>)> {
        let (scene, assembled) = (&self.loaded.scene, &self.loaded.assembled);
        match self.part() {
            None => shadow(scene, assembled),
            Some(at) => shadow_one(scene, assembled, &ResolvedRequest::of(&scene.rays[at])?),
        }
    }

    /// Whether the test has an `[expect.stable]` of its own.
    fn says_what_is_stable(&self) -> bool {
        match self.part() {
            None => self.loaded.expectations.stable.is_some(),
            Some(at) => self.loaded.rays[at].as_ref().is_some_and(|one| one.rest.stable.is_some()),
        }
    }

    /// What depends on rounding. An error where that cannot be seen: invocations cannot run one by
    /// one, or the test is of a trap.
    fn perturbed(&self, perturbation: &Perturbation) -> Result<Instability> {
        let (scene, assembled) = (&self.loaded.scene, &self.loaded.assembled);
        match self.part() {
            None => perturb(scene, assembled, perturbation),
            Some(at) => perturb_one(scene, assembled, &ResolvedRequest::of(&scene.rays[at])?, perturbation),
        }
    }

    /// What the sanitizer finds in the test.
    fn sanitized(&self, levels: &Levels) -> Result<SanitizedRun> {
        let (scene, assembled) = (&self.loaded.scene, &self.loaded.assembled);
        let levels = &scene_levels(&scene.document)?.overridden_by(levels);
        let resources = fresh_resources(&assembled.resources);
        match self.part() {
            None => run_sanitized(scene, assembled, &resources, levels),
            Some(at) => {
                let which = ResolvedRequest::of(&scene.rays[at])?;
                sanitize_one(scene, assembled, &which, &resources, levels)
            }
        }
    }

    /// What depends on drawn choices in the launch.
    fn drawn(&self, drawn: &ManySeeds) -> Result<Findings> {
        let (scene, assembled) = (&self.loaded.scene, &self.loaded.assembled);
        let levels = scene_levels(&scene.document)?.overridden_by(&drawn.levels);
        ManySeeds { levels, ..drawn.clone() }.run(scene, assembled)
    }

    /// The outcome of a test that passed but for findings, which are kept.
    fn judge(&self, found: Result<Findings>, all: &mut Findings) -> Outcome {
        match found {
            Ok(found) => {
                let denied = found.denied().map(|one| Difference::of(one.report())).collect();
                all.extend(found);
                self.outcome(denied, None, self.part())
            }
            Err(error) => Outcome::Broken(error),
        }
    }

    /// The ray's place in the file, where the test is of a ray.
    fn part(&self) -> Option<usize> {
        match self.test.part {
            Part::Launch => None,
            Part::Ray(at) => Some(at),
        }
    }

    fn launch(&self, recorder: &mut Option<Recorder>) -> Result<Outcome> {
        let (scene, assembled) = (&self.loaded.scene, &self.loaded.assembled);
        let expectations = &self.loaded.expectations;
        let observed = if self.options.all_widths && recorder.is_none() {
            match self.loaded.widths() {
                Ok(observed) => observed,
                Err(error) if error.kind() == ErrorKind::Expectation => {
                    return Ok(self.failed(vec![Difference::of(error)], None));
                }
                Err(error) => return Err(error),
            }
        } else {
            let mut observed = match recorder {
                Some(recorder) => launch_covered(scene, assembled, recorder),
                None => run_launch(scene, assembled),
            };
            if !expectations.rays.is_empty() {
                observed.rays = rays(
                    scene,
                    assembled,
                    &mut RayMeasurements { recorder: recorder.as_mut(), ..RayMeasurements::default() },
                );
            }
            self.loaded.add_costs(&mut observed)?;
            observed
        };
        if self.options.check_optimizer {
            match self.loaded.check_launch(&observed) {
                Err(error) if error.kind() == ErrorKind::Expectation => {
                    return Ok(self.failed(vec![Difference::of(error)], None));
                }
                checked => checked?,
            }
        }
        let mut differences = expectations.differences(&observed);
        differences.extend(rendering::differences(self.loaded, &observed, self.is_variant)?);
        Ok(self.outcome(differences, expectations.known_failure.as_ref().map(|why| &why.value), None))
    }

    fn ray(&self, at: usize, recorder: &mut Option<Recorder>) -> Result<Outcome> {
        let Some(expect) = self.loaded.rays.get(at).and_then(Option::as_ref) else {
            let message = format!("the file has no ray {at} with expectations any more");
            return Err(Error::new(ErrorKind::InvalidScene, message));
        };
        let (costs, stable) = (expect.rest.wants_costs(), expect.rest.stable.as_ref());
        let mut watch = RayMeasurements { recorder: recorder.as_mut(), costs, stable };
        let observed = run_ray(&self.loaded.scene, &self.loaded.assembled, at, &mut watch);
        if let [(_, Err(error))] = &observed.rays[..]
            && error.kind() != ErrorKind::Trap
        {
            return Err(error.clone().at(expect.span.place()));
        }
        if self.options.check_optimizer {
            match self.loaded.check_ray(at, &observed) {
                Err(error) if error.kind() == ErrorKind::Expectation => {
                    return Ok(self.failed(vec![Difference::of(error)], Some(at)));
                }
                checked => checked?,
            }
        }
        let differences = expect.differences(&observed);
        let known = expect.rest.known_failure.as_ref().map(|why| &why.value);
        Ok(self.outcome(differences, known, Some(at)))
    }

    fn outcome(&self, differences: Vec<Difference>, known: Option<&String>, ray: Option<usize>) -> Outcome {
        match (differences.is_empty(), known) {
            (true, Some(why)) => Outcome::KnownFailure(why.clone()),
            (true, None) => Outcome::Passed,
            (false, _) => {
                // A mistake in what is expected is not a failed expectation.
                let mistake = |one: &&Difference| {
                    let told = [ErrorKind::Expectation, ErrorKind::Trap, ErrorKind::Finding];
                    !told.contains(&one.error.kind()) && one.fix.is_none()
                };
                let mistakes: Vec<Error> =
                    differences.iter().filter(mistake).map(|one| one.error.clone()).collect();
                match mistakes.is_empty() {
                    false => Outcome::Broken(Error::several(mistakes)),
                    true => self.failed(differences, ray),
                }
            }
        }
    }

    fn failed(&self, differences: Vec<Difference>, ray: Option<usize>) -> Outcome {
        // The first that is about some ray or number in particular can be explained.
        let shown = || differences.iter().filter(|difference| !difference.counted);
        let told = shown().position(|difference| difference.subject != Subject::Launch).unwrap_or(0);
        let Some(first) = shown().nth(told) else { return Outcome::Passed };
        let mendable = differences.iter().all(|difference| difference.fix.is_some());
        let mut failure = TestFailure {
            errors: Vec::new(),
            line: None,
            explanation: None,
            command: None,
            pictures: Vec::new(),
            fixes: differences.iter().filter_map(|difference| difference.fix.clone()).collect(),
            mendable,
        };
        // What was stopped by a limit runs no second time.
        let stopped = differences.iter().any(|one| one.error.trap().is_some_and(|trap| trap.code.is_limit()));
        let skip = self.options.bless && mendable || stopped;
        let writer = if skip { None } else { writer(self.loaded, &first.subject, ray) };
        failure.line = writer.as_ref().and_then(|writer| writer.line.clone()).or_else(|| place(&first.error));
        if !skip {
            self.explain(&first.subject, ray, writer.as_ref(), &mut failure);
        }
        let note = writer.as_ref().and_then(Writer::note);
        for (at, difference) in shown().enumerate() {
            let mut error = difference.error.clone();
            if let Some(note) = note.as_ref().filter(|_| at == told) {
                error = error.note(note);
            }
            failure.errors.push(error);
        }
        if !skip {
            let mut saved: Vec<&str> = Vec::new();
            for picture in differences.iter().filter_map(|difference| difference.picture.as_ref()) {
                // Several measures of one image need its pictures once.
                if saved.contains(&picture.name.as_str()) {
                    continue;
                }
                saved.push(&picture.name);
                match pictures::save(&self.options.pictures, &self.test.name, picture) {
                    Ok(paths) => failure.pictures.extend(paths),
                    Err(error) => failure.errors.push(error),
                }
            }
        }
        Outcome::Failed(Box::new(failure))
    }

    /// Explains the ray that a difference is about.
    fn explain(
        &self,
        subject: &Subject,
        ray: Option<usize>,
        writer: Option<&Writer>,
        failure: &mut TestFailure,
    ) {
        let scene = &self.loaded.scene;
        let by_name = |name: &String| scene.rays.iter().find(|ray| ray.name() == Some(name));
        let assembled = &self.loaded.assembled;
        let size = assembled.single_launch(None).map_or(assembled.size, |single| single.size);
        let wrote = writer.and_then(|writer| writer.invocation).map(|(number, id)| {
            let pass = assembled.is_frame().then(|| assembled.passes[number].key(number));
            in_pass(pass, ExplainRequest::Pixel(id))
        });
        let request = match (ray, subject) {
            (Some(ray), _) => scene.rays.get(ray).map(request),
            (None, Subject::Ray(name, _)) => by_name(name).map(request),
            (None, Subject::Invocation(id)) => Some(ExplainRequest::Pixel(*id)),
            (None, _) if wrote.is_some() => wrote,
            (None, Subject::Texel(_, [x, y])) if *x < size[0] && *y < size[1] => {
                Some(ExplainRequest::Pixel([*x, *y, 0]))
            }
            _ => None,
        };
        let Some(request) = request else { return };
        failure.command = Some(command_line(&scene.path.display().to_string(), &request));
        if self.options.no_explanation {
            return;
        }
        // Without an explanation the difference still stands.
        let Ok((transcript, _)) = Session::new(scene.clone()).and_then(|session| session.run(&request))
        else {
            return;
        };
        failure.explanation = Some(render::text(
            &transcript,
            RenderOptions { colour: self.options.colour, ..RenderOptions::default() },
        ));
    }
}

/// Outputs that are not stable, and the branches that went another way then.
fn unstable(found: &Instability, file: &Path) -> Vec<Difference> {
    if found.is_stable() {
        return Vec::new();
    }
    let new = |line: String| {
        let error = Error::new(ErrorKind::Expectation, format!("not stable: {line}"));
        Difference::of(error.at(Place::File(file.to_path_buf())))
    };
    found.lines().into_iter().map(new).collect()
}

fn request(ray: &RayEntry) -> ExplainRequest {
    let request = match ray {
        RayEntry::Pixel { pixel, .. } => ExplainRequest::Pixel([pixel.value[0], pixel.value[1], 0]),
        RayEntry::Given(given) => ExplainRequest::Ray(given.clone()),
    };
    in_pass(ray.pass().map(|key| key.value.0.clone()), request)
}

fn in_pass(pass: Option<String>, request: ExplainRequest) -> ExplainRequest {
    match pass {
        Some(pass) => ExplainRequest::InPass(pass, Box::new(request)),
        None => request,
    }
}

/// The command line that asks for the same, as a shell takes it.
fn command_line(scene: &str, request: &ExplainRequest) -> String {
    format!("anyhit trace-one-ray {}{}", shell::word(scene), arguments(request))
}

fn arguments(request: &ExplainRequest) -> String {
    match request {
        ExplainRequest::Pixel([x, y, 0]) => format!(" --pixel {x},{y}"),
        ExplainRequest::Pixel([x, y, z]) => format!(" --pixel {x},{y},{z}"),
        ExplainRequest::Ray(ray) => match &ray.name {
            // What looks like six numbers is read as these.
            Some(name) if !matches!(command::ray(name), Ok(Some(_))) => named(name),
            _ => numbers(ray),
        },
        ExplainRequest::Named(name) => named(name),
        ExplainRequest::Invocation { dispatch, id: [x, y, z] } => {
            format!(" --invocation {x},{y},{z} --dispatch {dispatch}")
        }
        ExplainRequest::Default => String::new(),
        ExplainRequest::InPass(pass, request) => {
            format!("{} --pass {}", arguments(request), shell::word(pass))
        }
    }
}

fn named(name: &str) -> String {
    // Quotes that are not needed make plain which words the name has.
    match shell::word(name) {
        plain if plain == name => format!(" --ray \"{name}\""),
        quoted => format!(" --ray {quoted}"),
    }
}

/// A ray by its numbers, with all in which it differs from what the command takes otherwise.
fn numbers(ray: &GivenRay) -> String {
    let words = |values: [f32; 3]| values.map(|value| value.to_string()).join(",");
    let mut line = format!(" --ray \"{} {}\"", words(ray.origin), words(ray.direction));
    let mut add = |differs: bool, option: &str, value: String| {
        if differs {
            line += &format!(" --{option} {value}");
        }
    };
    add(ray.t_min != 0.0, "t-min", ray.t_min.to_string());
    add(ray.t_max != f32::INFINITY, "t-max", ray.t_max.to_string());
    add(ray.flags != 0, "flags", ray.flags.to_string());
    add(ray.cull_mask != 0xFF, "cull-mask", ray.cull_mask.to_string());
    add(ray.time != 0.0, "time", ray.time.to_string());
    add(ray.sbt_offset != 0, "sbt-offset", ray.sbt_offset.to_string());
    add(ray.sbt_stride != 1, "sbt-stride", ray.sbt_stride.to_string());
    add(ray.miss_index != 0, "miss-index", ray.miss_index.to_string());
    line
}

/// The shader's line that an error points at: of a trap, not of an expectation.
fn place(error: &Error) -> Option<TranscriptLine> {
    if error.kind() != ErrorKind::Trap {
        return None;
    }
    error.places().find_map(|(place, _)| match place {
        Place::Line { file, line, .. } => {
            Some(TranscriptLine { file: file.clone(), line: *line, text: None })
        }
        Place::Text { file, text, span } => Some(TranscriptLine {
            file: file.clone(),
            line: text[..span.start].matches('\n').count() as u32 + 1,
            text: text.get(span.clone()).map(str::to_owned),
        }),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn launches_of_tests_end_by_default() {
        assert_eq!(SuiteOptions::default().limits.default, LaunchLimits::TESTS);
    }
}
