//! Whatever strangers wrote, reading and running it ends soon, without a panic: files of the
//! repository, changed at random with their structure in view.
//!
//! [`subjects`] has what reads, [`seeds`] what is changed, and [`mutators`] change it: [`text`],
//! [`binary`], and `support::mutate` for instructions, operands and types of modules. `fuzz/` gives
//! the same to libFuzzer.
//!
//! `ANYHIT_FUZZ_CASES=1000000 cargo test --profile fuzz --test main robustness::load` draws so many
//! mutants, from number `ANYHIT_FUZZ_FIRST` on, and says how many an hour; `ANYHIT_FUZZ_SEED` draws
//! others. What fails is saved in `target/tmp/robustness/`, and `ANYHIT_FUZZ_INPUT=FILE` runs one
//! such file. `ANYHIT_FUZZ_CORPUS=FOLDER` saves seeds and words that are worth inserting for
//! libFuzzer.
#![allow(clippy::print_stdout, reason = "what was done is told")]

mod binary;
mod mutators;
mod seeds;
mod subjects;
mod text;

use std::collections::HashMap;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use crate::support::mutate::Random;
use crate::support::skipped::{self, test_name};
use mutators::Mutate;
use seeds::Seed;

/// The longest that one input may take.
const PATIENCE: Duration = Duration::from_secs(10);

/// What a test runs, and on what.
struct Fuzz {
    name: &'static str,
    run: fn(&[u8]) -> bool,
    seeds: Vec<Seed>,
    mutate: Mutate,
    /// Mutants of a plain `cargo test`.
    cases: u64,
    /// Of 100 mutants, how many are accepted at least: else changes are so coarse that only the
    /// first check of a reader is ever reached.
    accepted: u64,
}

fn number(variable: &str, default: u64) -> u64 {
    let text = std::env::var(variable).ok();
    text.map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{variable} is a number")))
}

/// Where failing inputs are saved.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("robustness")
}

fn save(name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder().join(name);
    std::fs::create_dir_all(folder()).expect("a folder for failing inputs");
    std::fs::write(&path, bytes).expect("a file for a failing input");
    path
}

/// An input that is running.
struct Running {
    name: String,
    bytes: Vec<u8>,
    begin: Instant,
}

/// Ends the process where an input takes more than [`PATIENCE`], as a thread cannot be stopped.
struct Watchdog {
    running: Mutex<HashMap<thread::ThreadId, Running>>,
    ends: AtomicBool,
}

impl Watchdog {
    fn start() -> Arc<Self> {
        let watchdog = Arc::new(Self { running: Mutex::default(), ends: AtomicBool::new(false) });
        let watched = Arc::clone(&watchdog);
        thread::spawn(move || {
            while !watched.ends.load(Ordering::Relaxed) {
                thread::sleep(Duration::from_millis(500));
                let running = watched.running.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(Running { name, bytes, .. }) =
                    running.values().find(|one| one.begin.elapsed() > PATIENCE)
                {
                    println!("{name} takes more than {PATIENCE:?}: {}", save(name, bytes).display());
                    std::process::abort();
                }
            }
        });
        watchdog
    }

    fn watch<T>(&self, name: &str, bytes: &[u8], run: impl FnOnce() -> T) -> T {
        let lock = || self.running.lock().unwrap_or_else(PoisonError::into_inner);
        let running = Running { name: name.to_owned(), bytes: bytes.to_vec(), begin: Instant::now() };
        lock().insert(thread::current().id(), running);
        let result = run();
        lock().remove(&thread::current().id());
        result
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
    }
}

impl Fuzz {
    /// Saves the seeds, and a dictionary (<https://llvm.org/docs/LibFuzzer.html#dictionaries>).
    fn save_corpus(&self, folder: &Path) {
        let corpus = folder.join(self.name);
        std::fs::create_dir_all(&corpus).expect("a folder for the corpus");
        for (name, bytes) in &self.seeds {
            let name = name.replace(|one: char| !(one.is_alphanumeric() || one == '.'), "-");
            std::fs::write(corpus.join(name), bytes).expect("a file of the corpus");
        }
        let entry = |word: &Vec<u8>| {
            format!("\"{}\"\n", word.iter().map(|byte| format!("\\x{byte:02x}")).collect::<String>())
        };
        let words: String = mutators::words(&self.seeds).iter().map(entry).collect();
        std::fs::write(folder.join(format!("{}.dict", self.name)), words).expect("a dictionary");
    }

    fn mutant(&self, case: u64) -> Vec<u8> {
        let mut random = Random::of(self.name, case ^ number("ANYHIT_FUZZ_SEED", 1) << 40);
        let seed = random.pick(&self.seeds).expect("there are seeds");
        let other = random.pick(&self.seeds).expect("there are seeds");
        (self.mutate)(seed, other, &mut random)
    }

    fn check(self) {
        for (name, bytes) in &self.seeds {
            assert!(catch_unwind(|| (self.run)(bytes)).is_ok(), "{name} itself");
        }
        if let Some(folder) = std::env::var_os("ANYHIT_FUZZ_CORPUS") {
            self.save_corpus(Path::new(&folder));
        }
        let (first, cases) = (number("ANYHIT_FUZZ_FIRST", 0), number("ANYHIT_FUZZ_CASES", self.cases));
        let (accepted, longest) = (AtomicU64::new(0), AtomicU64::new(0));
        let watchdog = Watchdog::start();
        let start = Instant::now();
        let failures: Vec<String> = (first..first + cases)
            .into_par_iter()
            .filter_map(|case| {
                let bytes = self.mutant(case);
                let name = format!("{}-{case}", self.name);
                let begin = Instant::now();
                let ended = watchdog.watch(&name, &bytes, || catch_unwind(|| (self.run)(&bytes)));
                longest.fetch_max(begin.elapsed().as_millis() as u64, Ordering::Relaxed);
                match ended {
                    Ok(is_accepted) => {
                        accepted.fetch_add(u64::from(is_accepted), Ordering::Relaxed);
                        None
                    }
                    Err(_) => Some(format!("{name} panics: {}", save(&name, &bytes).display())),
                }
            })
            .collect();
        let (accepted, longest) = (accepted.into_inner(), longest.into_inner());
        println!(
            "{}: {cases} mutants, {accepted} accepted, {} failed, longest {longest} ms, {:.0} an hour",
            self.name,
            failures.len(),
            cases as f64 / start.elapsed().as_secs_f64() * 3600.0
        );
        assert!(failures.is_empty(), "{}", failures.join("\n"));
        assert!(
            cases < 100 || accepted * 100 >= cases * self.accepted,
            "only {accepted} of {cases} accepted"
        );
        assert!(cases < 100 || accepted < cases, "all {cases} mutants are accepted: nothing is changed");
    }
}

#[test]
fn load() {
    let seeds = seeds::modules();
    Fuzz { name: "load", run: subjects::load, seeds, mutate: mutators::module, cases: 4000, accepted: 20 }
        .check();
}

#[test]
fn execute() {
    let seeds = seeds::modules();
    let run = subjects::execute;
    Fuzz { name: "execute", run, seeds, mutate: mutators::module, cases: 2000, accepted: 10 }.check();
}

#[test]
fn smoke() {
    let mut seeds = seeds::modules();
    seeds.retain(|(_, bytes)| bytes.len() < 1 << 13);
    Fuzz { name: "smoke", run: subjects::smoke, seeds, mutate: mutators::module, cases: 300, accepted: 5 }
        .check();
}

#[cfg(feature = "wgsl")]
#[test]
fn wgsl() {
    let seeds = seeds::wgsl();
    Fuzz { name: "wgsl", run: subjects::wgsl, seeds, mutate: mutators::text, cases: 1500, accepted: 2 }
        .check();
}

#[test]
fn scene() {
    let seeds = seeds::scenes();
    Fuzz { name: "scene", run: subjects::scene, seeds, mutate: mutators::scene, cases: 1000, accepted: 5 }
        .check();
}

#[test]
fn gltf() {
    let seeds = seeds::gltf();
    Fuzz { name: "gltf", run: subjects::gltf, seeds, mutate: mutators::gltf, cases: 5000, accepted: 5 }
        .check();
}

#[test]
fn obj() {
    let seeds = seeds::obj();
    Fuzz { name: "obj", run: subjects::obj, seeds, mutate: mutators::text, cases: 5000, accepted: 5 }.check();
}

#[test]
fn picture() {
    let seeds = seeds::pictures();
    Fuzz {
        name: "picture",
        run: subjects::picture,
        seeds,
        mutate: mutators::bytes,
        cases: 3000,
        accepted: 5,
    }
    .check();
}

#[test]
fn recording() {
    let seeds = seeds::recordings();
    let run = subjects::recording;
    Fuzz { name: "recording", run, seeds, mutate: mutators::bytes, cases: 1000, accepted: 5 }.check();
}

#[test]
fn command_line() {
    let seeds = seeds::command_lines();
    let run = subjects::command_line;
    Fuzz { name: "command_line", run, seeds, mutate: mutators::text, cases: 2000, accepted: 5 }.check();
}

#[cfg(feature = "cli")]
#[test]
fn share_result() {
    let seeds = seeds::share_results();
    let run = subjects::share_result;
    Fuzz { name: "share_result", run, seeds, mutate: mutators::text, cases: 1500, accepted: 2 }.check();
}

/// A reader's panic is an error of the file where it was in the reader, and a failure where it was
/// in this project's own code.
#[test]
fn panics_of_our_own_are_no_errors_of_a_file() {
    use anyhit_base::error::{Error, ErrorKind, Result};
    let told =
        anyhit_base::input::contained("a-reader", ErrorKind::InvalidMesh, || -> Result<()> { panic!("x") });
    let note = told.unwrap_err().notes()[0].clone();
    assert!(note.contains("tests/input/robustness.rs:") || note.contains("tests\\robustness.rs:"), "{note}");
    let begin = note.find('`').expect("a place") + 1;
    let refused = |place: &str| {
        let error = Error::new(ErrorKind::InvalidMesh, "x").note(format!("{}{place}`", &note[..begin]));
        catch_unwind(|| subjects::refused(&error))
    };
    let absolute = subjects::root().join("crates/scene/src/mesh/gltf.rs:7:9");
    for ours in [
        "crates/scene/src/mesh/gltf.rs:7:9",
        "crates\\scene\\src\\mesh\\gltf.rs:7:9",
        &absolute.to_string_lossy(),
    ] {
        assert!(refused(ours).is_err(), "{ours}");
    }
    for others in
        ["/home/a/.cargo/registry/src/index/gltf-1.4.1/src/lib.rs:7:9", "/rustc/0/library/core/src/a.rs:1:1"]
    {
        assert!(matches!(refused(others), Ok(false)), "{others}");
    }
}

/// An input that failed: that of the test whose name its file's begins with.
#[test]
fn a_saved_input() {
    let Some(path) = skipped::variable(test_name!(), "ANYHIT_FUZZ_INPUT") else { return };
    let path = Path::new(&path);
    let bytes = std::fs::read(path).expect("a readable file");
    let name = path.file_name().expect("a file").to_string_lossy();
    let (subject, _) = name.split_once('-').expect("a file whose name is SUBJECT-NUMBER");
    let run = match subject {
        "load" => subjects::load,
        "execute" => subjects::execute,
        "smoke" => subjects::smoke,
        #[cfg(feature = "wgsl")]
        "wgsl" => subjects::wgsl,
        "scene" => subjects::scene,
        "gltf" => subjects::gltf,
        "obj" => subjects::obj,
        "picture" => subjects::picture,
        "recording" => subjects::recording,
        "command_line" => subjects::command_line,
        #[cfg(feature = "cli")]
        "share_result" => subjects::share_result,
        other => panic!("no subject is called {other}"),
    };
    println!("{subject}: accepted: {}", run(&bytes));
}
