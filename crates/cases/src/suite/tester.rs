//! Runs one test of a case, and explains why it fails.

use std::path::Path;

use crate::blame::{Blame, blame};
use crate::case::Loaded;
use crate::coverage::Recorder;
#[cfg(feature = "reports")]
use crate::expect::PictureDifference;
use crate::expect::{Difference, Subject};
use crate::many_seeds::{ManySeeds, run_command};
use crate::observe::fresh_resources;
use crate::rendering;
use crate::run::{RayMeasurements, launch_covered, rays, run_launch, run_ray};
use crate::sanitized::{SanitizedRun, run_sanitized, sanitize_one};
use crate::stability::found::ShadowFindings;
use crate::stability::perturb::{perturb, perturb_one};
use crate::stability::shadow::{shadow, shadow_one};
use crate::stability::{Instability, Perturbation};
use crate::suite::options::SuiteOptions;
use crate::suite::{Outcome, Part, Test, TestFailure, pictures};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_debugger::line_recorder::FollowedRuns;
use anyhit_debugger::session::ResolvedRequest;
use anyhit_debugger::source_text::source_text;
use anyhit_debugger::{ExplainRequest, Session, command, shell};
use anyhit_explain::Transcript;
use anyhit_explain::render::{self, RenderOptions};
use anyhit_explain::transcript::TranscriptLine;
use anyhit_sanitize::{Findings, Levels};
use anyhit_scene::file::{GivenRay, RayEntry};
use anyhit_scene::files::Files;
use anyhit_scene::sanitize_table::scene_levels;

/// Of how many differences the origin is searched, each by a run of its own.
const BLAMED: usize = 6;
/// Of larger tests only that of the first difference is.
const BLAMED_INVOCATIONS: u64 = 4096;

/// One test of a loaded case.
pub(super) struct Tester<'a> {
    /// The case.
    pub loaded: &'a Loaded,
    /// The test.
    pub test: &'a Test,
    /// How it is run, and what is told of its failure.
    pub options: &'a SuiteOptions,
    /// The variant of the scene that is tested.
    pub variant: Option<&'a str>,
}

impl Tester<'_> {
    /// What the shadow interpreter finds in the test.
    pub(super) fn shadow(&self) -> Result<(ShadowFindings, Option<Error>)> {
        let (scene, assembled) = (&self.loaded.scene, &self.loaded.assembled);
        match self.part() {
            None => shadow(scene, assembled),
            Some(at) => shadow_one(scene, assembled, &ResolvedRequest::of(&scene.rays[at])?),
        }
    }

    /// Whether the test has an `[expect.stable]` of its own.
    pub(super) fn says_what_is_stable(&self) -> bool {
        match self.part() {
            None => self.loaded.expectations.stable.is_some(),
            Some(at) => self.loaded.rays[at].as_ref().is_some_and(|one| one.rest.stable.is_some()),
        }
    }

    /// What depends on rounding. An error where that cannot be seen: invocations cannot run one by
    /// one, or the test is of a trap.
    pub(super) fn perturbed(&self, perturbation: &Perturbation) -> Result<Instability> {
        let (scene, assembled) = (&self.loaded.scene, &self.loaded.assembled);
        match self.part() {
            None => perturb(scene, assembled, perturbation),
            Some(at) => perturb_one(scene, assembled, &ResolvedRequest::of(&scene.rays[at])?, perturbation),
        }
    }

    /// What the sanitizer finds in the test.
    pub(super) fn sanitized(&self, levels: &Levels) -> Result<SanitizedRun> {
        let (scene, assembled) = (&self.loaded.scene, &self.loaded.assembled);
        let levels = &scene_levels(&scene.document)?.overridden_by(levels);
        let resources = fresh_resources(assembled);
        match self.part() {
            None => run_sanitized(scene, assembled, &resources, levels),
            Some(at) => {
                let which = ResolvedRequest::of(&scene.rays[at])?;
                sanitize_one(scene, assembled, &which, &resources, levels)
            }
        }
    }

    /// What depends on drawn choices in the test.
    pub(super) fn drawn(&self, drawn: &ManySeeds) -> Result<Findings> {
        let (scene, assembled) = (&self.loaded.scene, &self.loaded.assembled);
        let levels = scene_levels(&scene.document)?.overridden_by(&drawn.levels);
        let path = escape::path(&scene.path).to_string();
        let ray = self.part().map(|at| &scene.rays[at]);
        let mut command = match ray {
            None => run_command(scene),
            Some(ray) => command_line(&path, &request(ray)),
        };
        if let Some(variant) = self.variant {
            command += &format!(" --variant {}", shell::word(variant));
        }
        let drawn = ManySeeds { levels, command: Some(command), ..drawn.clone() };
        match ray {
            None => drawn.run(scene, assembled),
            Some(ray) => drawn.run_one(scene, assembled, &ResolvedRequest::of(ray)?),
        }
    }

    /// The outcome of a test that passed but for what the sanitizer says. It runs what is
    /// eliminated otherwise: a trap that the test does not expect is a failure, too.
    pub(super) fn judge_sanitized(&self, run: Result<SanitizedRun>, all: &mut Findings) -> Outcome {
        let (outcome, found) = match run {
            Ok(SanitizedRun { outcome, findings }) => (outcome.err(), Ok(findings)),
            Err(error) => (None, Err(error)),
        };
        let trap = outcome
            .filter(|error| error.kind() == ErrorKind::Trap && self.loaded.expectations.trap.is_none());
        match (self.judge(found, all), trap) {
            (Outcome::Passed, Some(trap)) => {
                let trap = trap.context("a shader trapped under the sanitizer");
                self.outcome(vec![Difference::of(trap)], None, self.part())
            }
            (outcome, _) => outcome,
        }
    }

    /// The outcome of a test that passed but for findings, which are kept.
    pub(super) fn judge(&self, found: Result<Findings>, all: &mut Findings) -> Outcome {
        match found {
            Ok(mut found) => {
                if let Some(known) = &self.options.known {
                    found.forget_known(known);
                }
                let denied = found.denied().filter(|_| !self.options.becomes_baseline);
                let denied = denied.map(|one| Difference::of(one.report())).collect();
                all.extend(found);
                self.outcome(denied, None, self.part())
            }
            Err(error) => Outcome::Broken(error),
        }
    }

    /// The ray's place in the file, where the test is of a ray.
    pub(super) fn part(&self) -> Option<usize> {
        match self.test.part {
            Part::Launch => None,
            Part::Ray(at) => Some(at),
        }
    }

    /// Runs the launch, and compares it with what is expected.
    pub(super) fn launch(&self, recorder: &mut Option<Recorder>) -> Result<Outcome> {
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
        differences.extend(rendering::differences(self.loaded, &observed, self.variant.is_some())?);
        Ok(self.outcome(differences, expectations.known_failure.as_ref().map(|why| &why.value), None))
    }

    /// Runs a ray of the file, and compares it with what is expected.
    pub(super) fn ray(&self, at: usize, recorder: &mut Option<Recorder>) -> Result<Outcome> {
        let Some(expect) = self.loaded.rays.get(at).and_then(Option::as_ref) else {
            let message = format!("the file no longer has a ray {at} with expectations");
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

    /// The outcome of a test, given how it differs from what is expected.
    pub(super) fn outcome(
        &self,
        differences: Vec<Difference>,
        known: Option<&String>,
        ray: Option<usize>,
    ) -> Outcome {
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
            is_dispatch: false,
            hints: Vec::new(),
            coloured_explanation: None,
            command: None,
            pictures: Vec::new(),
            fixes: differences.iter().filter_map(|difference| difference.fix.clone()).collect(),
            mendable,
        };
        // What was stopped by a limit runs no second time.
        let stopped = differences.iter().any(|one| one.error.trap().is_some_and(|trap| trap.code.is_limit()));
        let skip = self.options.bless && mendable || stopped;
        let blame = if skip { Blame::default() } else { blame(self.loaded, &first.subject, ray) };
        failure.line = blame.line.clone().or_else(|| place(&first.error));
        if !skip {
            self.explain(&first.subject, ray, &blame, &mut failure);
        }
        let is_small = self.loaded.assembled.invocations() <= BLAMED_INVOCATIONS;
        for (at, difference) in shown().enumerate() {
            let notes = match at == told {
                true => blame.notes.clone(),
                // What is wrong elsewhere has an origin, too; its page the command shows.
                false if !skip && is_small && at < BLAMED => self.notes_on(difference, ray),
                false => Vec::new(),
            };
            failure.errors.push(notes.into_iter().fold(difference.error.clone(), Error::note));
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
                    Err(error) => {
                        failure.errors.push(error);
                        continue;
                    }
                }
                #[cfg(feature = "reports")]
                self.add_page(picture, &mut failure);
            }
        }
        Outcome::Failed(Box::new(failure))
    }

    /// Who wrote what a difference is about.
    fn notes_on(&self, difference: &Difference, ray: Option<usize>) -> Vec<String> {
        match difference.subject {
            Subject::Launch | Subject::Invocation(_) => Vec::new(),
            _ => blame(self.loaded, &difference.subject, ray).notes,
        }
    }

    /// Saves the page about a picture that differs. Without it the pictures still stand.
    #[cfg(feature = "reports")]
    fn add_page(&self, picture: &PictureDifference, failure: &mut TestFailure) {
        let explains = !self.options.no_explanation;
        let (folder, test) = (&self.options.pictures, &self.test.name);
        let is_variant = self.variant.is_some();
        match pictures::save_page(folder, test, picture, self.loaded, explains, is_variant) {
            Ok(path) => failure.pictures.push(path),
            Err(error) => failure.errors.push(error),
        }
    }

    /// Explains the ray or invocation that a difference is about.
    fn explain(&self, subject: &Subject, ray: Option<usize>, blame: &Blame, failure: &mut TestFailure) {
        let scene = &self.loaded.scene;
        let by_name = |name: &String| scene.rays.iter().find(|ray| ray.name() == Some(name));
        let request = match (ray, subject) {
            (Some(ray), _) => scene.rays.get(ray).map(request),
            (None, Subject::Ray(name, _)) => by_name(name).map(request),
            _ => blame.request.clone(),
        };
        let Some(request) = request else { return };
        let mut command = command_line(&escape::path(&scene.path).to_string(), &request);
        if let Some(variant) = self.variant {
            command += &format!(" --variant {}", shell::word(variant));
        }
        failure.command = Some(command);
        if self.options.no_explanation {
            return;
        }
        // Without an explanation the difference still stands.
        let lines = self.options.explained_lines;
        let follow = |transcript: &Transcript| match lines {
            0 => FollowedRuns::Only(Vec::new()),
            _ => FollowedRuns::of_deciders(&transcript.root),
        };
        let mut read = |name: &str| source_text(&scene.path, name, &mut |path| scene.files.read(path).ok());
        let explained = Session::new(scene.clone())
            .and_then(|session| session.run_with_lines(&request, &follow, &mut read));
        let Ok((transcript, _)) = explained else { return };
        failure.is_dispatch = transcript.dispatch.is_some();
        failure.hints.clone_from(&transcript.hints);
        let options = RenderOptions { summary: true, last_lines: Some(lines), ..RenderOptions::default() };
        let text = |colour| render::text(&transcript, RenderOptions { colour, ..options });
        failure.explanation = Some(text(false));
        failure.coloured_explanation = self.options.colour.then(|| text(true));
    }
}

/// Outputs that are not stable, and the branches that went another way then.
pub(super) fn unstable(found: &Instability, file: &Path) -> Vec<Difference> {
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
            let dispatch = if *dispatch == 0 { String::new() } else { format!(" --dispatch {dispatch}") };
            format!(" --invocation {x},{y},{z}{dispatch}")
        }
        ExplainRequest::Default => String::new(),
        ExplainRequest::InPass(pass, request) => {
            // The pass says which dispatch.
            let request = match **request {
                ExplainRequest::Invocation { id, .. } => ExplainRequest::Invocation { dispatch: 0, id },
                ref request => request.clone(),
            };
            format!("{} --pass {}", arguments(&request), shell::word(pass))
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
    error.places().find_map(|(place, _)| TranscriptLine::of(place))
}
