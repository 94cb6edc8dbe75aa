//! Thread scaling: several threads of one process against as many single-threaded processes, in
//! turn.
//!
//! The processes share nothing but the machine, so that their total rate is what the machine can
//! do. The ratio of both rates is the cost of sharing a launch.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhit_engine::machine::Resources;
use anyhit_engine::pipeline::{Launch, Pipeline, RunOptions};

use crate::table::Table;
use crate::{clock, frames};

/// How many threads, and processes: powers of two up to the processors, and 4 at least.
fn counts() -> Vec<usize> {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    std::iter::successors(Some(1), |count| Some(count * 2))
        .take_while(|&count| count <= processors.max(4))
        .collect()
}

/// The environment variable that makes a process a worker, and holds its number.
const WORKER: &str = "ANYHIT_BENCH_WORKER";

/// Whether this process is a worker, which draws pictures on request.
pub fn is_worker() -> bool {
    std::env::var_os(WORKER).is_some()
}

/// Millions of pixels a second, and a second of processor time of one thread.
#[derive(Clone, Copy)]
struct Rate {
    wall: f64,
    thread: f64,
}

/// The two pictures that are drawn.
const PICTURES: [(&str, bool); 2] = [("triangles heavy", true), ("arithmetic", false)];

struct Picture {
    pipeline: Pipeline,
    resources: Resources,
    size: [u32; 2],
    time: Duration,
}

impl Picture {
    fn both(table: &Table) -> [Self; 2] {
        let size = table.size([1024, 768], [32, 6]);
        let time = table.size(Duration::from_millis(300), Duration::ZERO);
        PICTURES.map(|(_, heavy)| {
            let (pipeline, resources) = frames::repeatable_launch(table, heavy, size);
            Self { pipeline, resources, size, time }
        })
    }

    /// Draws the picture by a pool of threads, at least once and then again until the time is over.
    fn draw(&self, pool: &rayon::ThreadPool, time: Duration) -> Rate {
        let launch = Launch { pipeline: &self.pipeline, resources: &self.resources };
        let [width, height] = self.size;
        let (start, cpu, mut pixels) = (Instant::now(), clock::process(), 0);
        while pixels == 0 || start.elapsed() < time {
            pool.install(|| launch.run([width, height, 1], RunOptions::default()).expect("no trap"));
            pixels += width * height;
        }
        let rate = |time: Duration| f64::from(pixels) / time.as_secs_f64() / 1e6;
        Rate { wall: rate(start.elapsed()), thread: rate(clock::process() - cpu) }
    }
}

/// A pool whose threads are pinned to a processor each, where the system allows it: from the given
/// one of those that this process may use.
fn pool(first: usize, threads: usize) -> rayon::ThreadPool {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads);
    builder.start_handler(move |at| pin_to(first + at)).build().expect("threads")
}

#[cfg(target_os = "linux")]
fn pin_to(number: usize) {
    use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
    let Ok(all) = sched_getaffinity(None) else { return };
    let mut allowed = (0..CpuSet::MAX_CPU).filter(|&cpu| all.is_set(cpu));
    if let Some(cpu) = allowed.nth(number % all.count().max(1) as usize) {
        let mut one = CpuSet::new();
        one.set(cpu);
        // Where it is refused, threads go where the system puts them.
        let _ = sched_setaffinity(None, &one);
    }
}

#[cfg(not(target_os = "linux"))]
fn pin_to(_: usize) {}

/// Runs a worker: draws a picture with one thread for each number on its input, and prints the
/// rate, until the input ends.
pub fn work(full: bool) {
    let number = std::env::var(WORKER).ok().and_then(|number| number.parse().ok());
    let pictures = Picture::both(&Table::new(full, None));
    let pool = pool(number.expect("the number of this worker"), 1);
    pictures.iter().for_each(|picture| _ = picture.draw(&pool, Duration::ZERO));
    println!("ready");
    for line in std::io::stdin().lines() {
        let picture = &pictures[line.expect("a line").parse::<usize>().expect("a number")];
        let rate = picture.draw(&pool, picture.time);
        println!("{} {}", rate.wall, rate.thread);
    }
}

/// A process of one thread.
struct Worker {
    child: Child,
    output: BufReader<std::process::ChildStdout>,
}

impl Worker {
    fn new(full: bool, number: usize) -> Self {
        let mut command = Command::new(std::env::current_exe().expect("the path of this program"));
        command.env(WORKER, number.to_string()).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = if full { command.arg("--bench") } else { &mut command }.spawn().expect("a process");
        let output = BufReader::new(child.stdout.take().expect("its output"));
        let mut worker = Self { child, output };
        assert_eq!(worker.line(), "ready");
        worker
    }

    fn begin(&mut self, picture: usize) {
        writeln!(self.child.stdin.as_mut().expect("its input"), "{picture}").expect("a line");
    }

    fn rate(&mut self) -> Rate {
        let line = self.line();
        let (wall, thread) = line.split_once(' ').expect("two numbers");
        Rate { wall: wall.parse().expect("a rate"), thread: thread.parse().expect("a rate") }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("a line");
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
    let pictures = Picture::both(table);
    let counts = counts();
    let pools: Vec<_> = counts.iter().map(|&count| pool(0, count)).collect();
    let mut workers: Vec<Worker> =
        (0..counts[counts.len() - 1]).map(|number| Worker::new(table.size(true, false), number)).collect();
    for (number, (picture, (name, _))) in pictures.iter().zip(PICTURES).enumerate() {
        pools.iter().for_each(|pool| _ = picture.draw(pool, Duration::ZERO));
        let mut rounds: Vec<Vec<[Rate; 2]>> = Vec::new();
        for round in 0..table.size(20, 1) {
            let each = counts.iter().zip(&pools).map(|(&count, pool)| {
                let threads = || picture.draw(pool, picture.time);
                let mut processes = || {
                    let some = &mut workers[..count];
                    some.iter_mut().for_each(|worker| worker.begin(number));
                    let rates: Vec<Rate> = some.iter_mut().map(Worker::rate).collect();
                    let sum = |rate: fn(&Rate) -> f64| rates.iter().map(rate).sum::<f64>();
                    Rate { wall: sum(|rate| rate.wall), thread: sum(|rate| rate.thread) / count as f64 }
                };
                // The order alternates, so that a machine that gets slower or faster meanwhile
                // favours neither.
                match round % 2 {
                    0 => [threads(), processes()],
                    _ => {
                        let rate = processes();
                        [threads(), rate]
                    }
                }
            });
            rounds.push(each.collect());
        }
        for (at, count) in counts.iter().enumerate() {
            let of = |value: &dyn Fn(&[[Rate; 2]]) -> f64| {
                quartiles(rounds.iter().map(|round| value(round)).collect())
            };
            println!(
                "threads {count}, {name:<16} {:>7.3} Mpixels/s, {} times one thread; {count} processes {:.3}, ratio {}, \
                 in processor time {}",
                of(&|round| round[at][0].wall)[1],
                shown(of(&|round| round[at][0].wall / round[0][0].wall)),
                of(&|round| round[at][1].wall)[1],
                shown(of(&|round| round[at][0].wall / round[at][1].wall)),
                shown(of(&|round| round[at][0].thread / round[at][1].thread)),
            );
        }
    }
}

/// The lower quartile, the median and the upper quartile.
fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|quarter| values[(values.len() - 1) * quarter / 4])
}

fn shown([low, median, high]: [f64; 3]) -> String {
    format!("{median:.3} ({low:.3} to {high:.3})")
}
