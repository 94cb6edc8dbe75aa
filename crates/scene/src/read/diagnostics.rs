//! The mistakes of a scene and its files, collected so that one run reports many.

use std::cell::{Cell, RefCell};

use crate::read::recorder::RequestRecorder;
use anyhit_base::error::{Error, Result};
use anyhit_base::input::{InputLimit, InputLimits};

/// The mistakes found while a file is read, and notes for its author. The first are kept, as many
/// as the limit `errors-shown` says, and the others counted.
#[derive(Debug, Default)]
pub struct Diagnostics {
    errors: RefCell<Vec<Error>>,
    notes: RefCell<Vec<String>>,
    limits: InputLimits,
    counted: Cell<usize>,
    /// What is requested, where a schema is made.
    recorder: Option<RequestRecorder>,
}

impl Diagnostics {
    /// A report about files with these limits.
    pub fn within(limits: InputLimits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// A report that also notes what is requested.
    pub(super) fn recording() -> Self {
        Self { recorder: Some(RequestRecorder::default()), ..Self::default() }
    }

    pub(super) fn recorder(&self) -> Option<&RequestRecorder> {
        self.recorder.as_ref()
    }

    /// The limits of what is read.
    pub fn limits(&self) -> &InputLimits {
        &self.limits
    }

    /// How many mistakes are kept, and how many notes.
    fn most(&self) -> usize {
        usize::try_from(self.limits.get(InputLimit::ErrorsShown)).unwrap_or(usize::MAX).max(1)
    }

    /// Adds a mistake, once: a file that is named once and needed often is missing once.
    pub fn push(&self, error: Error) {
        let is_same = |known: &Error| known.message() == error.message() && known.places().eq(error.places());
        if error.places().next().is_some() && self.errors.borrow().iter().any(is_same) {
            return;
        }
        if self.is_full() {
            self.count(1 + error.others().len() + error.not_shown());
        } else {
            self.errors.borrow_mut().push(error);
        }
    }

    /// Adds mistakes that are counted and not shown.
    pub fn count(&self, more: usize) {
        self.counted.set(self.counted.get() + more);
    }

    /// Whether further mistakes are only counted, so that nobody need say what they are.
    pub fn is_full(&self) -> bool {
        self.errors.borrow().len() >= self.most()
    }

    /// Adds a note, a line of text.
    pub fn note(&self, note: String) {
        if self.notes.borrow().len() < self.most() {
            self.notes.borrow_mut().push(note);
        }
    }

    /// Removes and returns the notes, a line of text each.
    pub fn take_notes(&self) -> Vec<String> {
        self.notes.take()
    }

    /// Adds the error of a result and keeps its value.
    pub fn keep<T>(&self, result: Result<T>) -> Option<T> {
        result.map_err(|error| self.push(error)).ok()
    }

    /// How many mistakes there are so far.
    pub fn len(&self) -> usize {
        self.errors.borrow().len() + self.counted.get()
    }

    /// Whether there are no mistakes so far.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// # Errors
    /// All mistakes as one error, where there are any: the first are shown.
    pub fn finish(self) -> Result<()> {
        let (most, counted) = (self.most(), self.counted.get());
        let errors = self.errors.into_inner();
        if errors.is_empty() { Ok(()) } else { Err(first_of(errors, most).and_more(counted)) }
    }
}

/// The first of several errors as one, and a count of the others: a report of thousands helps
/// nobody. Empty input is a bug of the caller.
#[cold]
pub(crate) fn first_of(mut errors: Vec<Error>, most: usize) -> Error {
    let count = errors.len();
    errors.truncate(most.max(1));
    let not_shown = count - errors.len();
    Error::several(errors).and_more(not_shown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_base::error::ErrorKind;

    #[test]
    fn of_many_errors_the_first_are_shown_and_the_others_counted() {
        let errors = |count: usize| {
            (0..count).map(|at| Error::new(ErrorKind::InvalidScene, format!("mistake {at}"))).collect()
        };
        let error = first_of(errors(20), 3);
        let text = error.render();
        assert_eq!((error.others().len(), error.not_shown()), (2, 17));
        assert!(text.contains("mistake 2") && !text.contains("mistake 3"), "{text}");
        assert!(text.ends_with("error: 17 more errors are not shown\n"), "{text}");
        assert!(!first_of(errors(3), 3).render().contains("not shown"));
        assert_eq!(first_of(errors(2), 0).not_shown(), 1);
    }
}
