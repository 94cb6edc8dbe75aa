//! Runs the measurements and prints the table.

use std::cell::RefCell;
use std::time::{Duration, Instant};

use crate::clock;

/// The printed table.
pub struct Table {
    full: bool,
    wanted: RowFilter,
    /// The size of the pictures.
    pub picture: [u32; 2],
    measured: RefCell<Vec<Measured>>,
}

enum RowFilter {
    All,
    Prefix(String),
    Exact(&'static str),
}

/// A row that has run.
#[allow(dead_code, reason = "the comparison with peers reads it")]
pub struct Measured {
    /// Millions of items for each second of processor time, or milliseconds of it for each run.
    pub value: f64,
    /// Rays or pixels that hit, where they were counted.
    pub hits: Option<u64>,
}

/// The processor time after which no further run is started.
const MAX_TIME: Duration = Duration::from_millis(1500);

impl Table {
    /// A table whose rows run at full size, or once and small; only those whose names begin with
    /// `wanted`.
    pub fn new(full: bool, wanted: Option<String>) -> Self {
        let wanted = wanted.map_or(RowFilter::All, RowFilter::Prefix);
        let picture = if full { [512, 384] } else { [32, 6] };
        Self { full, wanted, picture, measured: RefCell::default() }
    }

    /// A table of the one row of this name, with pictures of another size.
    #[allow(dead_code, reason = "the comparison with peers asks for it")]
    pub fn of_one(name: &'static str, picture: [u32; 2]) -> Self {
        Self { wanted: RowFilter::Exact(name), picture, ..Self::new(true, None) }
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

    /// Whether a row is to be measured.
    pub fn wants(&self, name: &str) -> bool {
        match &self.wanted {
            RowFilter::All => true,
            RowFilter::Prefix(prefix) => name.starts_with(prefix.as_str()),
            RowFilter::Exact(one) => name == *one,
        }
    }

    /// Whether any row whose name begins with `prefix` may be wanted.
    pub fn wants_any(&self, prefix: &str) -> bool {
        match &self.wanted {
            RowFilter::All => true,
            RowFilter::Prefix(wanted) => prefix.starts_with(wanted.as_str()) || wanted.starts_with(prefix),
            RowFilter::Exact(one) => one.starts_with(prefix),
        }
    }

    /// Measures work that processes a number of items in each run. Prints and returns the
    /// throughput in millions of items for each second of processor time. The text that the work
    /// returns is printed behind it.
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
        while times.len() < 15 && (times.len() < 3 || spent < MAX_TIME) {
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
