//! Runs the tests of a suite in parallel.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::harness::bless::bless;
use crate::harness::coverage::{Coverage, Recorder};
use crate::harness::expect::Fix;
use crate::harness::sanitized::check_scene;
use crate::harness::stability::found::ShadowFindings;
use crate::harness::suite::options::SuiteOptions;
use crate::harness::suite::tester::{Tester, unstable};
use crate::harness::suite::{Finished, Outcome, Part, Source, Suite, Test};
use crate::input::{InputLimit, InputLimits};
use crate::sanitize::Findings;
use crate::scene::sanitize_table::scene_levels;
use crate::scene::{Assembled, ResolvedScene};

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
            let tester = Tester { loaded: &loaded, test, options, variant: case.variant.as_deref() };
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
            if let (Outcome::Passed, Some(drawn)) = (&outcome, &options.many_seeds) {
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
