//! Runs the measurements and prints the table.

use std::cell::RefCell;
use std::time::{Duration, Instant};

use crate::clock;

/// The printed table.
pub struct Table {
    full: bool,
    wanted: Wanted,
    /// The size of the pictures.
    pub picture: [u32; 2],
    measured: RefCell<Vec<Measured>>,
}

enum Wanted {
    All,
    Beginning(String),
    Named(&'static str),
}

/// A row that has run.
#[allow(dead_code, reason = "the comparison with peers reads it")]
pub struct Measured {
    /// Millions of things a second of processor time, or milliseconds of it a run.
    pub value: f64,
    /// Rays or pixels that hit, where they were counted.
    pub hits: Option<u64>,
}

/// How long one run may take in processor time before no further one is begun.
const ENOUGH: Duration = Duration::from_millis(1500);

impl Table {
    /// A table whose rows run at full size, or once and small; only those whose names begin so.
    pub fn new(full: bool, wanted: Option<String>) -> Self {
        let wanted = wanted.map_or(Wanted::All, Wanted::Beginning);
        let picture = if full { [512, 384] } else { [32, 6] };
        Self { full, wanted, picture, measured: RefCell::default() }
    }

    /// A table of the one row of this name, with pictures of another size.
    #[allow(dead_code, reason = "the comparison with peers asks for it")]
    pub fn of_one(name: &'static str, picture: [u32; 2]) -> Self {
        Self { wanted: Wanted::Named(name), picture, ..Self::new(true, None) }
    }

    /// The last row that has run.
    #[allow(dead_code, reason = "the comparison with peers asks for it")]
    pub fn into_last(self) -> Option<Measured> {
        self.measured.into_inner().pop()
    }

    /// Remembers how many rays or pixels of the last row hit.
    pub fn hits(&self, hits: u64) {
        if let Some(last) = self.measured.borrow_mut().last_mut() {
            last.hits = Some(hits);
        }
    }

    /// A size for real measurements, or one that only shows that a row runs.
    pub fn size<T>(&self, full: T, small: T) -> T {
        if self.full { full } else { small }
    }

    /// Whether a row is asked for.
    pub fn wants(&self, name: &str) -> bool {
        match &self.wanted {
            Wanted::All => true,
            Wanted::Beginning(beginning) => name.starts_with(beginning.as_str()),
            Wanted::Named(one) => name == *one,
        }
    }

    /// Whether one of the rows whose names begin alike may be asked for.
    pub fn wants_any(&self, prefix: &str) -> bool {
        match &self.wanted {
            Wanted::All => true,
            Wanted::Beginning(beginning) => {
                prefix.starts_with(beginning.as_str()) || beginning.starts_with(prefix)
            }
            Wanted::Named(one) => one.starts_with(prefix),
        }
    }

    /// Measures work that processes a number of things a run, and prints how many millions of them
    /// a second of processor time gets through, which is returned. What the work returns is printed
    /// behind.
    pub fn rate(&self, name: &str, unit: &str, count: u64, mut work: impl FnMut() -> String) -> Option<f64> {
        if !self.wants(name) {
            return None;
        }
        let (cpu, wall, note) = self.measure(&mut work);
        let rate = |time: Duration| count as f64 / time.as_secs_f64() / 1e6;
        println!("{name:<34} {:>9.3} M{unit}/cpu-s {:>9.3} M{unit}/s   {note}", rate(cpu), rate(wall));
        self.measured.borrow_mut().push(Measured { value: rate(cpu), hits: None });
        Some(rate(cpu))
    }

    /// Measures work, prints how many milliseconds of processor time it takes, and returns them.
    pub fn time(&self, name: &str, mut work: impl FnMut() -> String) -> Option<f64> {
        if !self.wants(name) {
            return None;
        }
        let (cpu, wall, note) = self.measure(&mut work);
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        println!("{name:<34} {:>9.3} ms (cpu) {:>12.3} ms (wall)   {note}", ms(cpu), ms(wall));
        self.measured.borrow_mut().push(Measured { value: ms(cpu), hits: None });
        Some(ms(cpu))
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
