//! Progress bars of long commands, on standard error if that is a terminal.

use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// How often the bar is drawn; work that takes less shows none.
const PERIOD: Duration = Duration::from_millis(250);

/// The characters of a bar.
const WIDTH: u64 = 40;

/// Returns to the beginning of the line, and clears it.
const CLEAR: &str = "\r\x1b[K";

/// A bar that a thread draws until this value is dropped.
pub(super) struct ProgressBar {
    progress: Arc<Progress>,
    drawing: Option<JoinHandle<()>>,
}

/// What the bar shows.
struct Progress {
    label: String,
    done: AtomicU64,
    total: AtomicU64,
    begin: Instant,
    has_ended: Mutex<bool>,
    ending: Condvar,
}

impl ProgressBar {
    /// A bar for so much work; a label stands in front of it.
    pub(super) fn new(label: &str, total: u64) -> Self {
        let progress = Arc::new(Progress {
            label: label.to_owned(),
            done: AtomicU64::new(0),
            total: AtomicU64::new(total),
            begin: Instant::now(),
            has_ended: Mutex::new(false),
            ending: Condvar::new(),
        });
        let drawn = progress.clone();
        let drawing = io::stderr().is_terminal().then(|| thread::spawn(move || drawn.draw_until_end()));
        Self { progress, drawing }
    }

    /// Says how much work there is.
    pub(super) fn set_total(&self, total: u64) {
        self.progress.total.store(total, Relaxed);
    }

    /// Says that more work is done.
    pub(super) fn advance(&self, count: u64) {
        self.progress.done.fetch_add(count, Relaxed);
    }
}

impl Drop for ProgressBar {
    fn drop(&mut self) {
        *self.progress.has_ended.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.progress.ending.notify_one();
        if let Some(drawing) = self.drawing.take() {
            // A bar that could not be drawn is no reason to fail.
            let _ = drawing.join();
        }
    }
}

impl Progress {
    /// Draws the bar again and again, and clears it in the end.
    fn draw_until_end(&self) {
        let mut has_ended = self.has_ended.lock().unwrap_or_else(PoisonError::into_inner);
        let mut is_drawn = false;
        loop {
            let waited = self.ending.wait_timeout_while(has_ended, PERIOD, |has_ended| !*has_ended);
            has_ended = waited.unwrap_or_else(PoisonError::into_inner).0;
            if *has_ended {
                break;
            }
            let (done, total) = (self.done.load(Relaxed), self.total.load(Relaxed));
            let line = line(&self.label, done, total, self.begin.elapsed());
            is_drawn |= io::stderr().write_all(format!("{CLEAR}{line}").as_bytes()).is_ok();
        }
        if is_drawn {
            let _ = io::stderr().write_all(CLEAR.as_bytes());
        }
    }
}

/// The bar as text.
fn line(label: &str, done: u64, total: u64, elapsed: Duration) -> String {
    let total = total.max(1);
    let done = done.min(total);
    let share = done as f64 / total as f64;
    let filled = (share * WIDTH as f64) as usize;
    let bar = "█".repeat(filled) + &"░".repeat(WIDTH as usize - filled);
    let space = if label.is_empty() { "" } else { " " };
    let left = match done {
        0 => String::new(),
        _ => format!("  about {} left", spoken(elapsed.mul_f64((1.0 - share) / share))),
    };
    let seconds = elapsed.as_secs();
    let [hours, minutes, seconds] = [seconds / 3600, seconds / 60 % 60, seconds % 60];
    let percent = (share * 100.0) as u64;
    format!("{label}{space}{bar} {percent:>3} %  {hours:02}:{minutes:02}:{seconds:02}{left}")
}

/// A duration in its greatest unit.
fn spoken(duration: Duration) -> String {
    match duration.as_secs() {
        seconds @ ..100 => format!("{seconds} s"),
        seconds @ ..6000 => format!("{} min", seconds.div_ceil(60)),
        seconds => format!("{} h", seconds.div_ceil(3600)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_tells_how_much_is_done_and_left() {
        let half = format!("{}{}", "█".repeat(20), "░".repeat(20));
        let elapsed = Duration::from_secs(3_725);
        assert_eq!(line("", 50, 100, elapsed), format!("{half}  50 %  01:02:05  about 63 min left"));
        assert_eq!(line("Sin", 0, 100, Duration::ZERO), format!("Sin {}   0 %  00:00:00", "░".repeat(40)));
        let all = "█".repeat(40);
        let elapsed = Duration::from_secs(7);
        assert_eq!(line("", 9, 8, elapsed), format!("{all} 100 %  00:00:07  about 0 s left"));
        assert!(line("", 0, 0, elapsed).contains("   0 %"));
    }

    #[test]
    fn a_bar_ends_where_it_is_dropped() {
        let bar = ProgressBar::new("test", 10);
        bar.set_total(20);
        bar.advance(3);
        let progress = bar.progress.clone();
        drop(bar);
        assert_eq!((progress.done.load(Relaxed), progress.total.load(Relaxed)), (3, 20));
        assert_eq!(Arc::strong_count(&progress), 1);
    }
}
