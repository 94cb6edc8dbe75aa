//! Runs what is measured and prints the rows.

use std::time::{Duration, Instant};

use crate::clock;

/// The printed table.
pub struct Table {
    full: bool,
    wanted: Option<String>,
}

/// How long one run may take in processor time before no further one is begun.
const ENOUGH: Duration = Duration::from_millis(1500);

impl Table {
    /// A table whose rows run at full size, or once and small; only those whose names begin so.
    pub fn new(full: bool, wanted: Option<String>) -> Self {
        Self { full, wanted }
    }

    /// A size for real measurements, or one that only shows that a row runs.
    pub fn size<T>(&self, full: T, small: T) -> T {
        if self.full { full } else { small }
    }

    /// Whether a row is asked for.
    pub fn wants(&self, name: &str) -> bool {
        self.wanted.as_ref().is_none_or(|beginning| name.starts_with(beginning.as_str()))
    }

    /// Whether one of the rows whose names begin alike may be asked for.
    pub fn wants_any(&self, prefix: &str) -> bool {
        self.wants(prefix) || self.wanted.as_ref().is_some_and(|beginning| beginning.starts_with(prefix))
    }

    /// Measures work that processes a number of things a run, and prints how many millions of them
    /// a second of processor time gets through. What the work returns is printed behind.
    pub fn rate(&self, name: &str, unit: &str, count: u64, mut work: impl FnMut() -> String) {
        if !self.wants(name) {
            return;
        }
        let (cpu, wall, note) = self.measure(&mut work);
        let rate = |time: Duration| count as f64 / time.as_secs_f64() / 1e6;
        println!("{name:<34} {:>9.3} M{unit}/cpu-s {:>9.3} M{unit}/s   {note}", rate(cpu), rate(wall));
    }

    /// Measures work and prints how many milliseconds it takes.
    pub fn time(&self, name: &str, mut work: impl FnMut() -> String) {
        if !self.wants(name) {
            return;
        }
        let (cpu, wall, note) = self.measure(&mut work);
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        println!("{name:<34} {:>9.3} ms (cpu) {:>12.3} ms (wall)   {note}", ms(cpu), ms(wall));
    }

    fn measure(&self, work: &mut impl FnMut() -> String) -> (Duration, Duration, String) {
        let mut times = Vec::new();
        let mut walls = Vec::new();
        // The first run also builds what is built on first use.
        let mut note = if self.full { work() } else { String::new() };
        let mut spent = Duration::ZERO;
        while times.len() < 15 && (times.len() < 3 || spent < ENOUGH) {
            let (start, wall) = (clock::process(), Instant::now());
            note = work();
            let took = clock::process() - start;
            walls.push(wall.elapsed());
            times.push(took);
            spent += took;
            if !self.full {
                break;
            }
        }
        times.sort();
        walls.sort();
        (times[times.len() / 2], walls[walls.len() / 2], note)
    }
}
