//! Progress of work that may take seconds, for a host that shows it: the program draws a bar.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Shows the progress of work.
pub trait ProgressDisplay: Sync {
    /// Work begins, in words such as "explaining pixels", with so many steps if that is known.
    fn begin(&self, what: &str, steps: Option<u64>);
    /// Steps of the work that began last are done.
    fn advance(&self, steps: u64);
    /// The work that began last has ended.
    fn end(&self);
}

static DISPLAY: OnceLock<&'static dyn ProgressDisplay> = OnceLock::new();

/// Number of live [`Work`] values. Nested work is not shown.
static DEPTH: AtomicUsize = AtomicUsize::new(0);

/// Has all work from now on shown; the first display of a process stays.
pub fn set_display(display: &'static dyn ProgressDisplay) {
    let _ = DISPLAY.set(display);
}

/// Work under way, until this is dropped.
#[derive(Debug)]
#[must_use]
pub struct Work {
    is_shown: bool,
}

impl Work {
    /// Begins work with so many steps. Inside of other work it is not shown.
    pub fn counted(what: &str, steps: u64) -> Self {
        Self::begin(what, Some(steps))
    }

    /// Begins work whose length is unknown. Inside of other work it is not shown.
    pub fn new(what: &str) -> Self {
        Self::begin(what, None)
    }

    fn begin(what: &str, steps: Option<u64>) -> Self {
        let is_shown = DEPTH.fetch_add(1, Ordering::Relaxed) == 0;
        let work = Self { is_shown };
        if let Some(display) = work.shown_on() {
            display.begin(what, steps);
        }
        work
    }

    fn shown_on(&self) -> Option<&'static dyn ProgressDisplay> {
        DISPLAY.get().copied().filter(|_| self.is_shown)
    }

    /// Says that steps are done. Any thread may call it.
    pub fn advance(&self, steps: u64) {
        if let Some(display) = self.shown_on() {
            display.advance(steps);
        }
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        if let Some(display) = self.shown_on() {
            display.end();
        }
        DEPTH.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[derive(Default)]
    struct Log(Mutex<Vec<String>>);

    impl Log {
        fn add(&self, line: String) {
            self.0.lock().unwrap().push(line);
        }
    }

    impl ProgressDisplay for Log {
        fn begin(&self, what: &str, steps: Option<u64>) {
            self.add(format!("{what} {steps:?}"));
        }
        fn advance(&self, steps: u64) {
            self.add(format!("+{steps}"));
        }
        fn end(&self) {
            self.add("end".to_owned());
        }
    }

    /// The only test of the display, which is the process's.
    #[test]
    fn parts_of_work_are_not_shown() {
        let log: &'static Log = Box::leak(Box::default());
        set_display(log);
        let outer = Work::counted("tests", 2);
        let inner = Work::new("a test");
        inner.advance(7);
        drop(inner);
        outer.advance(1);
        drop(outer);
        drop(Work::new("more"));
        let shown = log.0.lock().unwrap().join(", ");
        assert_eq!(shown, "tests Some(2), +1, end, more None, end");
    }
}
