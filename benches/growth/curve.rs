//! A curve: the cost of one kind of input in four sizes.

use std::path::{Path, PathBuf};

use crate::fit::{Growth, exponent_above_fixed_cost, exponent_of_peaks, slope};
use crate::measure::{Cost, Work, cost, floor_of_commands};

/// Writes inputs of a size to a folder and returns the work on them.
pub(crate) type Prepare = Box<dyn Fn(&Path, usize) -> Work>;

/// Measurements of one kind of input in four sizes.
pub(crate) struct Curve {
    /// Name: what is measured, by what.
    pub name: &'static str,
    /// The four sizes.
    pub sizes: [usize; 4],
    /// Accepted growth of the time.
    pub time: Growth,
    /// Accepted growth of the memory.
    pub memory: Growth,
    /// Writes inputs of a size to a folder, which is empty, and returns the work on them.
    pub prepare: Prepare,
}

impl Curve {
    /// A curve whose time and memory are linear.
    pub fn linear(
        name: &'static str,
        sizes: [usize; 4],
        prepare: impl Fn(&Path, usize) -> Work + 'static,
    ) -> Self {
        let (time, memory) = (Growth::Linear, Growth::Linear);
        Self { name, sizes, time, memory, prepare: Box::new(prepare) }
    }

    /// This curve with another accepted growth of the time.
    pub fn time(self, time: Growth) -> Self {
        Self { time, ..self }
    }

    /// This curve with another accepted growth of the memory.
    pub fn memory(self, memory: Growth) -> Self {
        Self { memory, ..self }
    }

    /// Largest accepted exponents of time and memory.
    fn limits(&self) -> [f64; 2] {
        [self.time, self.memory].map(Growth::limit)
    }

    /// Measures the sizes, or the smallest one once.
    pub fn measure(&self, full: bool) -> Measured {
        let sizes = if full { &self.sizes[..] } else { &self.sizes[..1] };
        let (mut floor, mut is_command) = (16384.0, false);
        let mut points = Vec::new();
        for &size in sizes {
            let folder = TemporaryFolder::new();
            let mut work = (self.prepare)(&folder.0, size);
            if let (true, Work::Command(..)) = (points.is_empty(), &work) {
                (floor, is_command) = (floor_of_commands(&folder.0), true);
            }
            points.push((size, cost(&mut work, &folder.0, !full)));
        }
        Measured { points, floor, is_command }
    }
}

/// The costs of a curve, by size.
pub(crate) struct Measured {
    points: Vec<(usize, Cost)>,
    /// Bytes below which memory is not that of the input.
    floor: f64,
    /// Each measurement starts a new process.
    is_command: bool,
}

impl Measured {
    /// Exponents of time and memory.
    pub fn exponents(&self, curve: &Curve) -> [f64; 2] {
        let points = |part: fn(&Cost) -> f64| -> Vec<(f64, f64)> {
            self.points.iter().map(|(n, cost)| (*n as f64, part(cost))).collect()
        };
        let times = points(|cost| cost.seconds);
        let time = match curve.time {
            Growth::Linear if self.is_command => exponent_above_fixed_cost(&times),
            _ => slope(&times),
        };
        [time, exponent_of_peaks(&points(|cost| cost.bytes), self.floor)]
    }

    pub fn is_accepted(&self, curve: &Curve) -> bool {
        self.exponents(curve).iter().zip(curve.limits()).all(|(exponent, limit)| *exponent <= limit)
    }

    fn sizes(&self) -> String {
        self.join(|size, _| size.to_string())
    }

    fn times(&self) -> String {
        self.join(|_, cost| match cost.seconds {
            seconds if seconds < 1e-3 => format!("{:.0} us", seconds * 1e6),
            seconds if seconds < 0.1 => format!("{:.1} ms", seconds * 1e3),
            seconds => format!("{:.0} ms", seconds * 1e3),
        })
    }

    fn join(&self, text: impl Fn(usize, &Cost) -> String) -> String {
        self.points.iter().map(|(size, cost)| text(*size, cost)).collect::<Vec<_>>().join(", ")
    }

    /// A line about a curve that is not accepted.
    pub fn failure(&self, curve: &Curve) -> String {
        let [time, memory] = self.exponents(curve);
        format!(
            "{}: exponents {time:.2} of time ({}) and {memory:.2} of memory ({}), sizes {}, times {}, bytes {}",
            curve.name,
            curve.time.name(),
            curve.memory.name(),
            self.sizes(),
            self.times(),
            self.join(|_, cost| cost.bytes.to_string())
        )
    }

    /// A row of the table, as Markdown.
    pub fn row(&self, curve: &Curve) -> String {
        let [time, memory] = self.exponents(curve);
        let each = self.points.last().map_or(0.0, |(size, cost)| cost.bytes / *size as f64);
        let each = if each < 10.0 { format!("{each:.1}") } else { format!("{each:.0}") };
        let verdict = if self.is_accepted(curve) { "yes" } else { "NO" };
        let wanted = match curve.time == curve.memory {
            true => curve.time.name().to_owned(),
            false => format!("{}, memory {}", curve.time.name(), curve.memory.name()),
        };
        format!(
            "| {} | {} | {} | {each} | {time:.2} | {memory:.2} | {wanted}: {verdict} |",
            curve.name,
            self.sizes(),
            self.times()
        )
    }
}

/// A folder that is removed when it goes out of scope.
struct TemporaryFolder(PathBuf);

impl TemporaryFolder {
    fn new() -> Self {
        let path = std::env::temp_dir().join(format!("anyhit-growth-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).expect("a temporary folder");
        Self(path)
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
