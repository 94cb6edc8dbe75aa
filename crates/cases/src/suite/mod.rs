//! Suites: the tests beneath some paths, filtered, run in parallel, and reported in order.

mod for_tools;
#[cfg(feature = "reports")]
mod junit;
mod kept_finding;
mod options;
mod pictures;
pub mod report;
mod result;
mod run;
mod sarif;
mod summary;
mod tester;

pub use anyhit_unit_test::explain::EXPLAINED_LINES;
pub use for_tools::gitlab;
#[cfg(feature = "reports")]
pub use junit::junit;
pub use kept_finding::KeptFinding;
pub use options::SuiteOptions;
pub use result::{CaseResult, Ended, Problem, SuiteResult, SuiteWhole, TestResult};
pub use sarif::{findings_sarif, suite_sarif};
pub use summary::summary;

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::case::{Case, CaseRay, FoundFiles, scenes};
use crate::expect::Fix;
use crate::shares::{Shard, Timings};
use anyhit_base::error::{Error, Result};
use anyhit_base::escape;
use anyhit_base::sorted::SortedMap;
use anyhit_explain::transcript::{Hint, TranscriptLine};
use anyhit_scene::SceneFiles;

/// The tests of some paths, in order: by path, a launch before the rays of its file.
#[derive(Clone, Debug, Default)]
pub struct Suite {
    cases: Vec<Source>,
    tests: Vec<Test>,
    /// The first test of each case in the whole suite, which tells what is wrong with the case.
    first_tests: SortedMap<usize, Test>,
}

/// A file's case, or why the file is none.
#[derive(Clone, Debug)]
enum Source {
    Case(Box<Case>),
    Broken(PathBuf, Error),
}

/// One test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Test {
    /// Its name: the scene's path, the variant in parentheses, `::` and the name of a ray.
    pub name: String,
    /// Its place among all tests of the suite, from 0.
    place: usize,
    case: usize,
    part: Part,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Launch,
    /// The place of the ray in its file.
    Ray(usize),
}

/// What became of a test.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Its name.
    pub name: String,
    /// The file that it stands in.
    pub file: PathBuf,
    /// How it ended.
    pub outcome: Outcome,
    /// How long it took, its share of loading included.
    pub took: Duration,
}

/// How a test ended.
#[derive(Clone, Debug)]
pub enum Outcome {
    /// As expected.
    Passed,
    /// It fails, as is known; why.
    KnownFailure(String),
    /// Not as expected.
    Failed(Box<TestFailure>),
    /// It could not run.
    Broken(Error),
    /// Not as expected, and what was expected is written anew.
    Renewed,
}

/// Everything that helps to see why a test failed.
#[derive(Clone, Debug)]
pub struct TestFailure {
    /// Each difference at its place in the scene file.
    pub errors: Vec<Error>,
    /// The line of a shader that wrote the first wrong number, or trapped.
    pub line: Option<TranscriptLine>,
    /// The ray or invocation that the first difference is about, explained: the text of
    /// `trace-one-ray`.
    pub explanation: Option<String>,
    /// Whether it is of an invocation of a dispatch.
    pub is_dispatch: bool,
    /// The hints of that explanation.
    pub hints: Vec<Hint>,
    /// The explanation in colour, where that was asked for.
    pub coloured_explanation: Option<String>,
    /// The command that explains it again.
    pub command: Option<String>,
    /// Pictures that were saved.
    pub pictures: Vec<PathBuf>,
    /// What would make it pass, as far as its values are recorded and not derived.
    pub(crate) fixes: Vec<Fix>,
    /// Whether that is all that is wrong.
    pub(crate) mendable: bool,
}

impl Suite {
    /// Finds the tests of files and of folders.
    ///
    /// # Errors
    /// `Io` where a path is not there or a folder cannot be read. A file that is no scene is a test
    /// that cannot run.
    pub fn find(paths: &[PathBuf]) -> Result<Self> {
        Self::find_within(paths, &|_, _| Ok(SceneFiles::default()))
    }

    /// Finds tests of which each is read, with all that it names, as `files_of` says of its file
    /// and of the folder that was searched, or else the file's own.
    ///
    /// # Errors
    /// As [`Suite::find`].
    pub fn find_within(
        paths: &[PathBuf],
        files_of: &dyn Fn(&Path, &Path) -> Result<SceneFiles>,
    ) -> Result<Self> {
        let mut files = Vec::new();
        for path in paths {
            let kind = std::fs::metadata(path).map_err(|error| Error::io(path, error))?;
            match kind.is_dir() {
                true => files.extend(scenes(path)?.into_iter().map(|file| (file, path.as_path()))),
                false => files.push((path.clone(), path.parent().unwrap_or(Path::new("")))),
            }
        }
        let mut suite = Self::default();
        let mut found = FoundFiles::default();
        for (file, tree) in files {
            let file = file.strip_prefix(".").map_or_else(|_| file.clone(), Path::to_path_buf);
            if found.add(&file) {
                suite.add(&file, files_of(&file, tree));
            }
        }
        suite.number();
        Ok(suite)
    }

    fn add(&mut self, file: &Path, files: Result<SceneFiles>) {
        let cases = match files.and_then(|files| Case::of_within(file, &files)) {
            Ok(cases) => cases,
            Err(error) => {
                let (case, name) = (self.cases.len(), escape::path(&file).to_string());
                self.cases.push(Source::Broken(file.to_path_buf(), error));
                self.tests.push(Test { name, place: 0, case, part: Part::Launch });
                return;
            }
        };
        for case in cases {
            let (at, name) = (self.cases.len(), case.name(Path::new("")));
            let name = if name.is_empty() { ".".to_owned() } else { name };
            if case.launch {
                self.tests.push(Test { name: name.clone(), place: 0, case: at, part: Part::Launch });
            }
            let ray = |ray: &CaseRay| Test {
                name: format!("{name}::{}", ray.name),
                place: 0,
                case: at,
                part: Part::Ray(ray.index),
            };
            self.tests.extend(case.rays.iter().map(ray));
            self.cases.push(Source::Case(Box::new(case)));
        }
    }

    /// Keeps the tests whose names hold one of some texts; all where there are none.
    pub fn filter(&mut self, texts: &[String]) {
        self.tests.retain(|test| texts.is_empty() || texts.iter().any(|text| test.name.contains(text)));
        self.number();
    }

    /// Gives each test its place.
    fn number(&mut self) {
        self.first_tests.clear();
        for (place, test) in self.tests.iter_mut().enumerate() {
            test.place = place;
            self.first_tests.entry(test.case).or_insert_with(|| test.clone());
        }
    }

    /// Keeps a share of the tests: the shares of a suite have no test in common, and hold all. They
    /// take about equally long where timings are known; else each has every so manieth test.
    pub fn shard(&mut self, shard: Shard, timings: Option<&Timings>) {
        let holds = match timings {
            None => self.tests.iter().map(|test| shard.holds(test.place)).collect(),
            Some(timings) => {
                let names: Vec<&str> = self.tests.iter().map(|test| test.name.as_str()).collect();
                timings.share_of(&names, shard)
            }
        };
        let mut holds = holds.into_iter();
        self.tests.retain(|_| holds.next().unwrap_or(false));
    }

    /// A suite of its own for each case of which tests are left, with the case's name.
    pub fn by_case(&self) -> Vec<(String, Self)> {
        let of_case = |group: &[Test]| {
            let name = group[0].name.split("::").next().unwrap_or_default().to_owned();
            let tests = group.iter().map(|test| Test { case: 0, ..test.clone() }).collect();
            (name, Self { cases: vec![self.cases[group[0].case].clone()], tests, ..Self::default() })
        };
        self.tests.chunk_by(|one, next| one.case == next.case).map(of_case).collect()
    }

    /// The file of a test, and its line in the file: that of a ray's header, else the first.
    pub fn place_of(&self, test: &Test) -> (&Path, u32) {
        match (&self.cases[test.case], test.part) {
            (Source::Broken(file, _), _) => (file, 1),
            (Source::Case(case), Part::Launch) => (&case.scene, 1),
            (Source::Case(case), Part::Ray(index)) => {
                let ray = case.rays.iter().find(|ray| ray.index == index);
                (&case.scene, ray.map_or(1, |ray| ray.line))
            }
        }
    }

    /// The tests that are left.
    pub fn tests(&self) -> &[Test] {
        &self.tests
    }
}

impl Outcome {
    /// How the test ended.
    pub fn ended(&self) -> Ended {
        match self {
            Self::Passed => Ended::Passed,
            Self::KnownFailure(_) => Ended::KnownFailure,
            Self::Failed(_) => Ended::Failed,
            Self::Broken(_) => Ended::Error,
            Self::Renewed => Ended::Renewed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn suite(names: &[&str]) -> Suite {
        let test = |name: &&str| Test { name: (*name).into(), place: 0, case: 0, part: Part::Launch };
        let mut suite = Suite { tests: names.iter().map(test).collect(), ..Suite::default() };
        suite.number();
        suite
    }

    #[test]
    fn shards_are_disjoint_and_complete() {
        let names: Vec<String> = (0..11).map(|at| format!("t{at}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let mut all = Vec::new();
        for number in 1..=3 {
            let mut suite = suite(&names);
            suite.shard(Shard { number, of: 3 }, None);
            all.extend(suite.tests().iter().map(|test| (test.place, test.name.clone())));
        }
        all.sort();
        assert_eq!(all.iter().map(|(_, name)| name.as_str()).collect::<Vec<_>>(), names);
    }

    #[test]
    fn filters_are_texts_of_which_one_must_be_there() {
        let mut suite = suite(&["lss/a", "lss/b", "sphere/a"]);
        suite.filter(&["b".into(), "sphere".into()]);
        assert_eq!(
            suite.tests().iter().map(|test| test.name.as_str()).collect::<Vec<_>>(),
            ["lss/b", "sphere/a"]
        );
        suite.filter(&[]);
        assert_eq!(suite.tests().len(), 2);
    }
}
