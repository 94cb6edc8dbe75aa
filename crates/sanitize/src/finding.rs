//! Findings: each rule that was broken, once for each place and cause, with how often.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rustc_hash::FxHashMap;
use serde::Serialize;

use crate::rule::{Level, Rule};
use crate::warning_reports::WarningReports;
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, Place, Result, ShaderFrame, SourceColumns};
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::math::random::Random;

/// A rule that a shader broke while it ran.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The rule.
    pub rule: &'static Rule,
    /// What happens to it.
    pub level: Level,
    /// How many invocations broke it here, each counted as often as it did.
    pub count: u64,
    /// `LaunchIdKHR` of the first, in compute shaders `GlobalInvocationId`.
    pub launch_id: [u32; 3],
    /// The stack of shader calls where it was found, innermost first.
    pub stack: Vec<ShaderFrame>,
    /// The report: message, places and notes.
    pub error: Error,
}

impl Finding {
    /// The whole report as the terminal shows it.
    pub fn render(&self) -> String {
        self.report().render()
    }

    /// The file and line that the report points to, where the module has debug information.
    pub fn place(&self) -> Option<(&str, usize)> {
        self.error.places().find_map(|(place, _)| file_and_line(place))
    }

    /// The columns of [`Finding::place`] in its line, where they are known.
    pub fn columns(&self) -> Option<SourceColumns> {
        let place = self.error.places().find(|(place, _)| file_and_line(place).is_some());
        place.and_then(|(place, _)| place.columns())
    }

    /// The report with its count, its source and its help.
    pub fn report(&self) -> Error {
        let mut error = self.error.clone().with_rule(self.rule.id, self.level == Level::Warn);
        if self.count > 1 {
            error = error.note(format!("and {} more times", grouped(self.count - 1)));
        }
        error.note(format!("rule: {}", self.rule.source)).note(format!("help: {}", self.rule.help))
    }
}

fn file_and_line(place: &Place) -> Option<(&str, usize)> {
    match place {
        Place::File(path) => Some((path.to_str()?, 1)),
        place => place.file_line().map(|(file, line)| (file, line as usize)),
    }
}

/// Findings, in the order in which they were met.
#[derive(Clone, Debug, Default, Serialize)]
#[serde(transparent)]
pub struct Findings {
    list: Vec<Finding>,
    #[serde(skip)]
    by_key: FxHashMap<SceneKey, usize>,
    /// Each time that one was met, where somebody asks for that.
    #[serde(skip)]
    occurrences: Option<OccurrenceLog>,
}

/// A log of the times that invocations meet findings, shared with whoever reads it.
#[derive(Clone, Debug, Default)]
pub struct OccurrenceLog(Arc<Mutex<Vec<Occurrence>>>);

impl OccurrenceLog {
    /// Takes what was noted since this was asked last.
    pub fn take(&self) -> Vec<Occurrence> {
        std::mem::take(&mut *self.noted())
    }

    fn noted(&self) -> MutexGuard<'_, Vec<Occurrence>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An invocation has met a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occurrence {
    /// The finding, by its place among all.
    pub finding: usize,
    /// `LaunchIdKHR`, in compute shaders `GlobalInvocationId`.
    pub launch_id: [u32; 3],
}

/// What makes two occurrences in one run one finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct FindingKey {
    /// The id of the rule.
    pub rule: &'static str,
    /// The shader and the word of the instruction, and of the instruction or variable that is the
    /// cause.
    pub places: [(ShaderIndex, u32); 2],
}

/// The first of the indices that stand for what is no shader: structures, outputs, a host.
const FIRST_OTHER: u64 = u32::MAX as u64 - 0xFF;

/// What makes two findings of runs one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct SceneKey {
    /// The id of the rule.
    rule: &'static str,
    /// As [`FindingKey::places`], with the shader's index in its scene; among several scenes with a
    /// number of its module, which is the same in each.
    places: [(u64, u32); 2],
}

impl SceneKey {
    fn of(key: &FindingKey) -> Self {
        Self { rule: key.rule, places: key.places.map(|(shader, word)| (shader.0.into(), word)) }
    }

    /// The key with other numbers for what holds its places.
    fn renumbered(self, number: impl Fn(u64) -> u64) -> Self {
        Self { places: self.places.map(|(holder, word)| (number(holder), word)), ..self }
    }
}

impl Findings {
    /// All findings.
    pub fn iter(&self) -> std::slice::Iter<'_, Finding> {
        self.list.iter()
    }

    /// All findings, each with what tells it from others of its rule: the numbers of shaders and
    /// the words of instructions.
    pub fn with_keys(&self) -> Vec<([u64; 4], &Finding)> {
        let mut keys = vec![[0; 4]; self.list.len()];
        for (key, &at) in &self.by_key {
            let [(shader, word), (cause, cause_word)] = key.places;
            keys[at] = [shader, word.into(), cause, cause_word.into()];
        }
        keys.into_iter().zip(&self.list).collect()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Notes from now on each time that a finding is met.
    pub(super) fn note_occurrences(&mut self, log: &OccurrenceLog) {
        self.occurrences = Some(log.clone());
    }

    /// Notes that invocations have met the finding of a key, where that is asked for.
    pub(super) fn note(&mut self, key: &FindingKey, launch_ids: impl Iterator<Item = [u32; 3]>) {
        if let (Some(log), Some(&finding)) = (&self.occurrences, self.by_key.get(&SceneKey::of(key))) {
            log.noted().extend(launch_ids.map(|launch_id| Occurrence { finding, launch_id }));
        }
    }

    /// The findings whose level is [`Level::Deny`].
    pub fn denied(&self) -> impl Iterator<Item = &Finding> {
        self.list.iter().filter(|finding| finding.level == Level::Deny)
    }

    /// The findings of a pipeline whose first shader has another index among all shaders of a
    /// scene.
    #[must_use]
    pub fn of_shaders_from(mut self, first: usize) -> Self {
        let own = |holder| if holder < FIRST_OTHER { holder + first as u64 } else { holder };
        self.by_key = self.by_key.into_iter().map(|(key, at)| (key.renumbered(own), at)).collect();
        self
    }

    /// The findings of a scene, whose shaders are each told by the first that is the same: of a
    /// shader that several groups or pipelines have, a finding is one.
    #[must_use]
    pub fn of_same_shaders(self, first_same: &[usize]) -> Self {
        let number = |holder| first_same.get(holder as usize).map_or(holder, |&first| first as u64);
        let mut merged = Self { occurrences: self.occurrences.clone(), ..Self::default() };
        for (key, finding) in self.into_keyed() {
            merged.sum_up(key.renumbered(number), finding);
        }
        merged
    }

    /// The findings of a scene among those of others, each shader told by a number of its module
    /// (those of the scene's shaders, in their order), all else by a number of the scene.
    #[must_use]
    pub fn among_others(self, modules: &[u64], scene: u64) -> Self {
        let of_scene = |holder| Random::of(scene, [holder]).bits();
        let number = |holder| modules.get(holder as usize).copied().unwrap_or_else(|| of_scene(holder));
        let mut among_others = Self::default();
        for (key, finding) in self.into_keyed() {
            among_others.sum_up(key.renumbered(number), finding);
        }
        among_others
    }

    /// The findings with their keys, in their order.
    fn into_keyed(self) -> impl Iterator<Item = (SceneKey, Finding)> {
        let keys: FxHashMap<usize, SceneKey> = self.by_key.into_iter().map(|(key, at)| (at, key)).collect();
        let keyed = move |(at, finding)| keys.get(&at).map(|&key| (key, finding));
        self.list.into_iter().enumerate().filter_map(keyed)
    }

    /// Adds a finding, or its count to the one of the same key.
    fn sum_up(&mut self, key: SceneKey, finding: Finding) {
        match self.by_key.get(&key) {
            Some(&known) => self.list[known].count += finding.count,
            None => {
                self.by_key.insert(key, self.list.len());
                self.list.push(finding);
            }
        }
    }

    /// The findings of a scene, each with the module of its shader; `modules` are those of all
    /// shaders, in their order.
    #[must_use]
    pub fn in_modules(mut self, modules: &[String]) -> Self {
        for (key, &at) in &self.by_key {
            let [(holder, _), _] = key.places;
            if let Some(module) = modules.get(holder as usize) {
                let error = &mut self.list[at].error;
                *error = error.clone().in_module(module);
            }
        }
        self
    }

    /// Drops the findings for which a condition does not hold.
    pub(super) fn retain(&mut self, keep: impl Fn(&Finding) -> bool) {
        let kept: Vec<bool> = self.list.iter().map(&keep).collect();
        let mut places = kept.iter().scan(0, |next, &kept| {
            *next += usize::from(kept);
            Some(kept.then(|| *next - 1))
        });
        let places: Vec<Option<usize>> = places.by_ref().collect();
        self.by_key.retain(|_, at| places[*at].map(|place| *at = place).is_some());
        self.list.retain(keep);
    }

    /// The findings that all of some other runs have, too.
    #[must_use]
    pub fn only_in_all(self, others: &[Self]) -> Self {
        let mut common = Self::default();
        for (key, finding) in self.into_keyed() {
            if others.iter().all(|other| other.by_key.contains_key(&key)) {
                common.sum_up(key, finding);
            }
        }
        common
    }

    /// The findings with the default levels of those that all of some runs have, and a note more on
    /// the others.
    #[must_use]
    pub fn with_defaults_of_all(mut self, runs: &[Self], note_on_others: &str) -> Self {
        for (key, &at) in &self.by_key {
            let finding = &mut self.list[at];
            if !runs.is_empty() && runs.iter().all(|run| run.by_key.contains_key(key)) {
                finding.level = finding.rule.kind.default_level();
            } else {
                finding.error = finding.error.clone().note(note_on_others);
            }
        }
        self
    }

    /// Keeps what is denied alone, and only warns of it, with a note.
    pub fn warn_of_denied(&mut self, note: &str) {
        self.retain(|finding| finding.level == Level::Deny);
        for finding in &mut self.list {
            finding.level = Level::Warn;
            finding.error = finding.error.clone().note(note);
        }
    }

    /// Drops what is denied.
    pub fn forget_denied(&mut self) {
        self.retain(|finding| finding.level != Level::Deny);
    }

    /// The reports of what is only warned of.
    ///
    /// # Errors
    /// What is denied, all in one error; else the error of the run.
    pub fn into_warnings(self, outcome: Result<()>) -> Result<WarningReports> {
        let denied: Vec<Error> = self.denied().map(Finding::report).collect();
        if !denied.is_empty() {
            return Err(Error::several(denied));
        }
        outcome?;
        Ok(self.iter().map(Finding::report).collect::<Vec<Error>>().into())
    }

    /// Counts a finding about an output of a run, which a hash tells apart from others; a new one
    /// has its report.
    pub fn add_of_output(&mut self, rule: &'static Rule, output: u64, new: impl FnOnce() -> Finding) {
        let of_outputs = ShaderIndex(u32::MAX - 1);
        let halves = [output as u32, (output >> 32) as u32];
        let key = FindingKey { rule: rule.id, places: halves.map(|half| (of_outputs, half)) };
        let new = (!self.knows(&key)).then(new);
        self.add(key, 1, new);
    }

    /// Whether there is a finding of a key.
    pub(super) fn knows(&self, key: &FindingKey) -> bool {
        self.by_key.contains_key(&SceneKey::of(key))
    }

    /// Counts an occurrence in so many lanes; a new finding has its report.
    pub(super) fn add(&mut self, key: FindingKey, lanes: u32, new: Option<Finding>) {
        let key = SceneKey::of(&key);
        if let Some(&at) = self.by_key.get(&key) {
            self.list[at].count += u64::from(lanes);
        } else if let Some(finding) = new {
            self.by_key.insert(key, self.list.len());
            self.list.push(Finding { count: lanes.into(), ..finding });
        }
    }

    /// Adds the findings of another run.
    pub fn extend(&mut self, other: Self) {
        for (key, finding) in other.into_keyed() {
            self.sum_up(key, finding);
        }
    }
}

impl<'a> IntoIterator for &'a Findings {
    type Item = &'a Finding;
    type IntoIter = std::slice::Iter<'a, Finding>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
