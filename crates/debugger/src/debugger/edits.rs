//! What is set by hand: what ran after it is forgotten, and the invocation goes on with it.

use anyhit_engine::reflect::value::TypedValue;

use super::Debugger;
use super::condition::WatchedWords;
use super::course::Time;
use super::expression;
use super::inspect::check_followed;
use super::stack::StackFrame;
use super::variable_place::VariablePlace;

/// What was set by hand.
#[derive(Clone, Debug)]
pub(super) struct Edit {
    /// The step that was next.
    pub time: Time,
    /// The frame, counted from the innermost.
    pub frame: usize,
    /// What was set, as it was written.
    pub target: String,
    /// What it was set to, as it was written.
    pub value: String,
    /// The words: those that were set, and where others were given them, theirs.
    pub words: Vec<WatchedWords>,
}

impl Debugger {
    /// Sets what an expression names to the value of another, and goes on with it: what ran after
    /// this step before is forgotten. Returns the new value.
    ///
    /// # Errors
    /// Why it cannot be set, in words.
    pub fn assign(&mut self, frame: &StackFrame, target: &str, value: &str) -> Result<TypedValue, String> {
        check_followed(frame)?;
        let place = self.place(frame, target);
        if place.is_ok_and(|place| self.is_passed_on(frame, &place)) {
            return Err(format!("`{target}` was passed to the running shader: set it there"));
        }
        let program = self.sources.shader(frame.shader).program.clone();
        let set =
            self.with_lane(frame, |lane| expression::assign(&program, &frame.source, lane, target, value));
        let places = set.map_err(|error| error.to_string())?;
        let edited = self.checkpoint(true);
        self.history.go_another_way(edited);
        let time = self.course.time;
        self.output.retain(|one| one.time <= time);
        self.edits.retain(|edit| edit.time <= time);
        self.breakpoints.iter_mut().for_each(|one| one.hits.forget_after(time));
        self.watches.iter_mut().for_each(|one| one.hits.forget_after(time));
        if let Some(number) = self.stack().iter().position(|one| one == frame) {
            let words = self.edited_words(frame, &places);
            let (target, value) = (target.to_owned(), value.to_owned());
            self.edits.push(Edit { time, frame: number, target, value, words });
            if let Some(ahead) = &mut self.ahead
                && let Err(error) = ahead.follow(&self.edits)
            {
                self.ahead = None;
                self.print(format!("the sanitizer reports no further findings: {error}"));
            }
        }
        self.evaluate(frame, target)
    }

    /// The words of places of a frame, and where others were given them, theirs.
    fn edited_words(&mut self, frame: &StackFrame, places: &[VariablePlace]) -> Vec<WatchedWords> {
        let mut all = Vec::new();
        for place in places {
            let Ok(mut words) = self.watched_words(frame, place) else { continue };
            let mut number = frame.number;
            while let Some(outer) = self.given_by(&words, number) {
                all.push(std::mem::replace(&mut words, outer));
                number -= 1;
            }
            all.push(words);
        }
        all
    }

    /// When words were last set by hand, up to a step.
    pub(super) fn last_edit(&self, words: &WatchedWords, now: Time) -> Option<Time> {
        let is_meant = |edit: &&Edit| edit.time <= now && edit.words.iter().any(|one| one.overlap(words));
        self.edits.iter().filter(is_meant).map(|edit| edit.time).max()
    }
}
