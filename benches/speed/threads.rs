//! How threads help: several threads of one process beside as many processes of one thread each, in turn.
//!
//! What processes reach together is what the machine gives: they share nothing but the machine itself, its memory, its
//! cores and whatever else runs on them. So the ratio of both is what sharing a launch costs.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhit::machine::Resources;
use anyhit::pipeline::{Launch, Pipeline};

use crate::frames;
use crate::table::Table;

/// Set where this process is one of those that are compared.
const WORKER: &str = "ANYHIT_BENCH_WORKER";

/// Whether this process is only to draw the picture when it is told to.
pub fn is_worker() -> bool {
    std::env::var_os(WORKER).is_some()
}

struct Picture {
    pipeline: Pipeline,
    resources: Resources,
    size: [u32; 2],
    time: Duration,
}

impl Picture {
    fn new(table: &Table) -> Self {
        let size = table.size([1024, 768], [32, 6]);
        let (pipeline, resources) = frames::heavy(table, size);
        Self { pipeline, resources, size, time: table.size(Duration::from_millis(700), Duration::ZERO) }
    }

    /// Draws the picture by a pool of threads, at least once and then again until the time is over; millions of pixels
    /// a second.
    fn draw(&self, pool: &rayon::ThreadPool, time: Duration) -> f64 {
        let launch = Launch { pipeline: &self.pipeline, resources: &self.resources };
        let [width, height] = self.size;
        let (start, mut pixels) = (Instant::now(), 0);
        while pixels == 0 || start.elapsed() < time {
            pool.install(|| launch.run::<64>([width, height, 1], &|_| ()).expect("no trap"));
            pixels += width * height;
        }
        f64::from(pixels) / start.elapsed().as_secs_f64() / 1e6
    }
}

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads")
}

/// Draws with one thread whenever a line comes, and tells how fast that was; until no line comes.
pub fn work(full: bool) {
    let picture = Picture::new(&Table::new(full, None));
    let pool = pool(1);
    picture.draw(&pool, Duration::ZERO);
    println!("ready");
    for _ in std::io::stdin().lines() {
        println!("{}", picture.draw(&pool, picture.time));
    }
}

/// A process of one thread.
struct Worker {
    child: Child,
    told: BufReader<std::process::ChildStdout>,
}

impl Worker {
    fn new(full: bool) -> Self {
        let mut command = Command::new(std::env::current_exe().expect("the path of this program"));
        command.env(WORKER, "1").stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = if full { command.arg("--bench") } else { &mut command }.spawn().expect("a process");
        let told = BufReader::new(child.stdout.take().expect("its output"));
        let mut worker = Self { child, told };
        assert_eq!(worker.line(), "ready");
        worker
    }

    fn begin(&mut self) {
        writeln!(self.child.stdin.as_mut().expect("its input")).expect("a line");
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.told.read_line(&mut line).expect("a line");
        line.trim().to_owned()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}

pub fn run(table: &Table) {
    if !table.wants_any("threads") {
        return;
    }
    let picture = Picture::new(table);
    let counts = [1, 2, 4];
    let pools = counts.map(pool);
    let mut workers: Vec<Worker> = (0..counts[2]).map(|_| Worker::new(table.size(true, false))).collect();
    pools.iter().for_each(|pool| _ = picture.draw(pool, Duration::ZERO));
    let mut rates: [[Vec<f64>; 2]; 3] = Default::default();
    for _ in 0..table.size(7, 1) {
        for (at, &count) in counts.iter().enumerate() {
            rates[at][0].push(picture.draw(&pools[at], picture.time));
            let some = &mut workers[..count];
            some.iter_mut().for_each(Worker::begin);
            let rate = |worker: &mut Worker| worker.line().parse::<f64>().expect("a rate");
            rates[at][1].push(some.iter_mut().map(rate).sum());
        }
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    for (at, count) in counts.into_iter().enumerate() {
        let [threads, processes] = &rates[at];
        let ratios = |to: &Vec<f64>| median(threads.iter().zip(to).map(|(own, to)| own / to).collect());
        println!(
            "threads {count}, triangles heavy           {:>9.3} Mpixels/s, {:.2} times as many as one; {count} processes {:.3}, ratio {:.3}",
            median(threads.clone()),
            ratios(&rates[0][0]),
            median(processes.clone()),
            ratios(processes),
        );
    }
}
