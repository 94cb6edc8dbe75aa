//! Progress on standard error, where that is a terminal: from the second second on, a line with a
//! bar, or with the time where the length of the work is unknown.

use std::fmt;
use std::io::{IsTerminal, stderr};
use std::sync::{LazyLock, PoisonError, RwLock};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::cli::interrupt;
use anyhit_base::progress::{ProgressDisplay, set_display};

/// Run time of the program before it shows progress.
const PATIENCE: Duration = Duration::from_secs(1);

/// Shortest work that is shown.
const SHORTEST: Duration = Duration::from_millis(100);

/// The time between two drawings.
const TICK: Duration = Duration::from_millis(250);

const COUNTED: &str = "{msg}  {wide_bar} {percent:>3} %  {elapsed_precise}{left}";
const UNCOUNTED: &str = "{msg}  {elapsed_precise}";

static BEGIN: LazyLock<Instant> = LazyLock::new(Instant::now);
static DISPLAY: BarDisplay = BarDisplay { bar: RwLock::new(None) };

/// Shows progress from now on, where anybody sees it.
pub(super) fn prepare() {
    LazyLock::force(&BEGIN);
    let is_dumb = std::env::var_os("TERM").is_none_or(|terminal| terminal == "dumb");
    if stderr().is_terminal() && (cfg!(windows) || !is_dumb) {
        set_display(&DISPLAY);
    }
}

/// Removes the bar; it is drawn no more.
fn clear() {
    DISPLAY.with_bar(ProgressBar::finish_and_clear);
}

/// Runs what prints, with the bar out of the way.
pub(super) fn hidden<R>(print: impl FnOnce() -> R) -> R {
    let bar = DISPLAY.bar.read().unwrap_or_else(PoisonError::into_inner).clone();
    match bar {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}

/// Writes how long the work will still take, once a step tells.
fn left(state: &ProgressState, out: &mut dyn fmt::Write) {
    if state.pos() > 0 {
        // A bar that is too short is better than none.
        let _ = write!(out, "  about {:#} left", HumanDuration(state.eta()));
    }
}

/// The bar of the work under way.
struct BarDisplay {
    bar: RwLock<Option<ProgressBar>>,
}

impl BarDisplay {
    fn with_bar(&self, use_bar: impl FnOnce(&ProgressBar)) {
        if let Some(bar) = &*self.bar.read().unwrap_or_else(PoisonError::into_inner) {
            use_bar(bar);
        }
    }

    fn replace(&self, new: Option<ProgressBar>) -> Option<ProgressBar> {
        std::mem::replace(&mut *self.bar.write().unwrap_or_else(PoisonError::into_inner), new)
    }
}

impl ProgressDisplay for BarDisplay {
    fn begin(&self, what: &str, steps: Option<u64>) {
        let bar = ProgressBar::with_draw_target(steps, ProgressDrawTarget::hidden());
        let template = if steps.is_some() { COUNTED } else { UNCOUNTED };
        let style = ProgressStyle::with_template(template);
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).with_key("left", left));
        bar.set_message(what.to_owned());
        let later = bar.downgrade();
        self.replace(Some(bar));
        let wait = PATIENCE.saturating_sub(BEGIN.elapsed()).max(SHORTEST);
        // Without the thread there is no bar.
        let _ = thread::Builder::new().stack_size(1 << 18).spawn(move || {
            thread::sleep(wait);
            if let Some(bar) = later.upgrade().filter(|bar| !bar.is_finished()) {
                interrupt::before_end(clear);
                bar.set_draw_target(ProgressDrawTarget::stderr());
                bar.enable_steady_tick(TICK);
            }
        });
    }

    fn advance(&self, steps: u64) {
        self.with_bar(|bar| bar.inc(steps));
    }

    fn end(&self) {
        if let Some(bar) = self.replace(None) {
            bar.finish_and_clear();
        }
    }
}
