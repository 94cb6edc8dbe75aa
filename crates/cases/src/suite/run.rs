//! Runs the tests of a suite in parallel.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::bless::bless;
use crate::coverage::{Coverage, Recorder};
use crate::expect::Fix;
use crate::in_order::{in_order, job_count};
use crate::module_files::module_files;
use crate::sanitized::check_scene;
use crate::source_tree::SourceTree;
use crate::stability::found::ShadowFindings;
use crate::suite::kept_finding::KeptFinding;
use crate::suite::options::SuiteOptions;
use crate::suite::result::{CaseResult, Ended, SuiteResult, TestResult};
use crate::suite::tester::{Tester, unstable};
use crate::suite::{Finished, Outcome, Part, Source, Suite, Test, report};
use anyhit_base::error::{Error, ErrorClass, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits};
use anyhit_engine::math::random::Random;
use anyhit_engine::module::Module;
use anyhit_sanitize::Findings;
use anyhit_scene::sanitize_table::scene_levels;
use anyhit_scene::{Assembled, ResolvedScene};

impl Suite {
    /// Runs the tests and reports each as soon as all before it are reported: no result and no
    /// order depends on how many run in parallel.
    ///
    /// # Errors
    /// `Io` where a scene file cannot be written anew, and where telling fails.
    pub fn run(
        &self,
        options: &SuiteOptions,
        tell: &mut dyn FnMut(&Finished, &TestResult) -> Result<()>,
    ) -> Result<SuiteResult> {
        let groups: Vec<&[Test]> = self.tests.chunk_by(|one, next| one.case == next.case).collect();
        let coverage = options.coverage.then(Coverage::default);
        let mut result = SuiteResult { coverage, ..SuiteResult::default() };
        let mut fixes = Vec::new();
        let stop = AtomicBool::new(false);
        let (tree, here) = (&options.repository, SourceTree::of_current_folder());
        let mut take = |done: Done| -> Result<()> {
            let kept = KeptFinding::all(&done.findings, tree, &done.file);
            if !(done.notes.is_empty() && kept.is_empty()) {
                result.cases.push(CaseResult { place: done.case, notes: done.notes, findings: kept });
            }
            for mut ran in done.tests {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                renew(&mut ran.finished, options, &mut fixes);
                let told = TestResult {
                    findings: KeptFinding::all(&ran.findings, tree, &done.file),
                    shadow: ran.shadow,
                    held_stable: ran.held_stable,
                    ..result_of(ran.place, &ran.finished, tree, &here)
                };
                tell(&ran.finished, &told)?;
                if matches!(told.ended, Ended::Failed | Ended::Error) && options.fail_fast {
                    stop.store(true, Ordering::Relaxed);
                }
                result.tests.push(told);
                if let (Some(sum), Some(coverage)) = (&mut result.coverage, ran.coverage) {
                    sum.add(coverage);
                }
            }
            Ok(())
        };
        // Threads that have no case of their own run tests of one case.
        let jobs = job_count(options.jobs);
        let each = jobs.div_ceil(groups.len().max(1));
        in_order(groups.len(), jobs, &stop, &|at| self.group(groups[at], each, options), &mut take)?;
        result.left_out = self.tests.len() - result.tests.len();
        let written = bless(fixes, &self.limits())?;
        result.written = written.iter().map(|path| escape::path(&path).to_string()).collect();
        Ok(result)
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

    /// Runs the chosen tests of one case on a number of threads.
    fn group(&self, tests: &[Test], jobs: usize, options: &SuiteOptions) -> Done {
        let begin = Instant::now();
        let (case, file) = match &self.cases[tests[0].case] {
            Source::Case(case) => (case, case.scene.clone()),
            Source::Broken(file, error) => return self.broken(tests, file, error),
        };
        let loaded = match case.load_limited(&options.limits) {
            Ok(loaded) => loaded,
            Err(error) => return self.broken(tests, &file, &error),
        };
        let loading = begin.elapsed() / tests.len() as u32;
        let known = match &options.sanitize {
            Some(_) => Ok(Findings::default()),
            None => known_before(&loaded.scene, &loaded.assembled),
        };
        let numbers = LazyLock::new(|| (module_numbers(&loaded.assembled), path_number(&case.scene)));
        let among_others = |findings: Findings| match findings.is_empty() {
            true => findings,
            false => findings.among_others(&numbers.0, numbers.1),
        };
        let findings = match known {
            Ok(findings) => among_others(findings),
            Err(error) => return self.broken(tests, &file, &error),
        };
        let run = |test: &Test| {
            let begin = Instant::now();
            // One recorder a test: what tests cover adds up, whichever share runs them.
            let mut recorder = options.coverage.then(Recorder::default);
            let mut findings = Findings::default();
            let mut held_stable = false;
            let tester = Tester { loaded: &loaded, test, options, variant: case.variant.as_deref() };
            let outcome = match test.part {
                Part::Launch => tester.launch(&mut recorder),
                Part::Ray(ray) => tester.ray(ray, &mut recorder),
            };
            let mut outcome = outcome.unwrap_or_else(Outcome::Broken);
            if let (Outcome::Passed, Some(perturbation)) = (&outcome, &options.perturb) {
                if tester.says_what_is_stable() {
                    held_stable = true;
                } else if let Ok(found) = tester.perturbed(perturbation) {
                    held_stable = true;
                    let differences = unstable(&found, &file);
                    outcome = tester.outcome(differences, None, tester.part());
                }
            }
            if let (Outcome::Passed, Some(levels)) = (&outcome, &options.sanitize) {
                outcome = tester.judge_sanitized(tester.sanitized(levels), &mut findings);
            }
            if let (Outcome::Passed, Some(drawn)) = (&outcome, &options.many_seeds) {
                outcome = tester.judge(tester.drawn(drawn), &mut findings);
            }
            // What cannot run one by one is left out, as is what the trap of a test cut off.
            let shadow = options.shadow.then(|| tester.shadow().ok()).flatten().map(|(found, _)| found);
            let coverage = recorder.map(|one| one.coverage(&loaded.scene, &loaded.assembled));
            let took = loading + begin.elapsed();
            let finished = Finished { name: test.name.clone(), file: file.clone(), outcome, took };
            let findings = among_others(findings);
            TestRun { place: test.place, finished, findings, shadow, held_stable, coverage }
        };
        let mut ran = Vec::with_capacity(tests.len());
        let mut take = |test| {
            ran.push(test);
            Ok(())
        };
        in_order(tests.len(), jobs, &AtomicBool::new(false), &|at| run(&tests[at]), &mut take)
            .expect("bug in anyhit: a test that ran is kept");
        let notes = [&loaded.scene.notes[..], &loaded.assembled.notes, &loaded.expectations.notes].concat();
        Done { case: tests[0].case, file, tests: ran, findings, notes }
    }

    /// The tests of a case that cannot be loaded: the first of the suite holds the error, the
    /// others name the first, in whichever share it is.
    fn broken(&self, tests: &[Test], file: &Path, error: &Error) -> Done {
        let first = self.first_tests.get(&tests[0].case).unwrap_or(&tests[0]);
        let again = || {
            let message = format!("not run, for the same reason as `{}`: {}", first.name, error.message());
            Error::new(error.kind(), message)
        };
        let ran = tests.iter().map(|test| TestRun {
            place: test.place,
            finished: Finished {
                name: test.name.clone(),
                file: file.to_path_buf(),
                outcome: Outcome::Broken(if test.place == first.place { error.clone() } else { again() }),
                took: Duration::ZERO,
            },
            findings: Findings::default(),
            shadow: None,
            held_stable: false,
            coverage: None,
        });
        Done {
            case: tests[0].case,
            file: file.to_path_buf(),
            tests: ran.collect(),
            findings: Findings::default(),
            notes: Vec::new(),
        }
    }
}

/// What is undefined in a scene before it runs; nobody need ask for it, so that it only warns.
fn known_before(scene: &ResolvedScene, assembled: &Assembled) -> Result<Findings> {
    let mut findings = check_scene(scene, assembled, &scene_levels(&scene.document)?);
    if !findings.is_empty() {
        findings = findings.in_modules(&module_files(scene, assembled));
    }
    findings.warn_of_denied("with `--sanitize`, this is an error, and the run is checked too");
    Ok(findings)
}

/// A number of the module of each shader of a scene, which is the same in each scene.
fn module_numbers(assembled: &Assembled) -> Vec<u64> {
    let number = |module: &Module| Random::of(0, module.words.iter().map(|&word| word.into())).bits();
    assembled.programs().map(|program| number(&program.module)).collect()
}

/// A number of a scene, by its file.
fn path_number(file: &Path) -> u64 {
    Random::of(0, file.as_os_str().as_encoded_bytes().iter().map(|&byte| byte.into())).bits()
}

/// The tests of a case that have run.
struct Done {
    /// The case's place in the suite.
    case: usize,
    /// The case's file.
    file: PathBuf,
    tests: Vec<TestRun>,
    /// What is undefined before anything runs.
    findings: Findings,
    notes: Vec<String>,
}

/// A test that has run.
struct TestRun {
    place: usize,
    finished: Finished,
    findings: Findings,
    shadow: Option<ShadowFindings>,
    held_stable: bool,
    coverage: Option<Coverage>,
}

/// The result of the test at a place of the suite. Annotations name files from the root of `tree`,
/// the JSON from the current folder `here`.
fn result_of(place: usize, finished: &Finished, tree: &SourceTree, here: &SourceTree) -> TestResult {
    let (message, class) = match &finished.outcome {
        Outcome::Passed | Outcome::Renewed => (None, None),
        Outcome::KnownFailure(why) => (Some(why.clone()), None),
        Outcome::Failed(failure) => {
            let message = failure.errors.first().map_or("not as expected", |error| error.message());
            // A missing recorded file counts as a failed expectation.
            let classes = failure.errors.iter().map(Error::class);
            let severe = classes.filter(|class| matches!(class, ErrorClass::Trap | ErrorClass::Finding));
            (Some(message.to_owned()), Some(severe.max().unwrap_or(ErrorClass::Expectation)))
        }
        Outcome::Broken(error) => (Some(error.message().to_owned()), Some(error.class())),
    };
    TestResult {
        place,
        name: finished.name.clone(),
        path: tree.path_of(&finished.file.to_string_lossy(), None),
        file: escape::path(&finished.file).to_string(),
        ended: finished.outcome.ended(),
        message,
        class,
        text: report::text(finished, false),
        problem: report::problem(finished, tree),
        json: report::test_json(finished, here),
        microseconds: u64::try_from(finished.took.as_micros()).unwrap_or(u64::MAX),
        findings: Vec::new(),
        shadow: None,
        held_stable: false,
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
        let why = "not renewed: values with `because` are derived, and a new value cannot resolve every \
             difference";
        *error = error.clone().note(why);
    }
}
