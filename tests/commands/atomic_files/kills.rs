//! Kills commands at random moments.

use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant, SystemTime};

use super::{Workplace, Writer, blessed};

/// Kills of each command where `ANYHIT_KILLS` says no number.
const KILLS: usize = 9;

/// When a command first changed something in its folder, and when it ended, from its start.
#[derive(Clone, Copy)]
struct Course {
    changed: Duration,
    ended: Duration,
}

impl Workplace {
    fn start(&self, writer: &Writer) -> Child {
        self.reset(writer);
        let mut command = self.command(writer);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().expect("the command starts")
    }

    /// Whether something has changed in the folder since a command was started.
    fn is_changed(&self, writer: &Writer) -> bool {
        let target = fs::metadata(self.path(writer.target));
        target.map_or(0, |target| target.len()) != writer.old.len() as u64 || !self.others(writer).is_empty()
    }

    /// Lets a command run to its end.
    fn course(&self, writer: &Writer) -> Course {
        let mut child = self.start(writer);
        let begin = Instant::now();
        let mut changed = None;
        loop {
            if changed.is_none() && self.is_changed(writer) {
                changed = Some(begin.elapsed());
            }
            if let Some(status) = child.try_wait().expect("a child") {
                assert_eq!(status.code(), Some(writer.code), "{}", writer.name);
                let ended = begin.elapsed();
                return Course { changed: changed.unwrap_or(ended), ended };
            }
        }
    }

    /// Starts a command and kills it: some time after its start, or after its first change.
    fn kill(&self, writer: &Writer, after_change: bool, wait: Duration) {
        let mut child = self.start(writer);
        let mut begin = Instant::now();
        let mut is_waiting = after_change;
        while child.try_wait().expect("a child").is_none() {
            if is_waiting && self.is_changed(writer) {
                (is_waiting, begin) = (false, Instant::now());
            }
            if !is_waiting && begin.elapsed() >= wait {
                break;
            }
        }
        // It may have ended by itself.
        let _ = child.kill();
        child.wait().expect("a child");
    }
}

/// A number from 0 to 1, another in every run.
fn random() -> f64 {
    RandomState::new().hash_one(0) as f64 / u64::MAX as f64
}

/// Whether a file is what a command leaves that runs to its end.
fn is_new(writer: &Writer, found: &[u8]) -> bool {
    let text = String::from_utf8_lossy(found);
    match writer.name {
        "bless" => text == blessed(&String::from_utf8_lossy(&writer.old)),
        "junit" => {
            let suites = junit_parser::from_reader(found);
            suites
                .is_ok_and(|suites| suites.suites.iter().map(|suite| suite.cases.len()).sum::<usize>() == 24)
        }
        // As many records end as begin.
        "coverage" => {
            let count = |line: &str| text.lines().filter(|found| found.starts_with(line)).count();
            count("SF:") > 0 && count("SF:") == count("end_of_record") && text.ends_with("end_of_record\n")
        }
        "render" | "run" => image::load_from_memory(found).is_ok(),
        "compile" => anyhit_engine::module::load(found).is_ok(),
        name => panic!("what does {name} write?"),
    }
}

/// A name that our temporary files have: `.`, the file's name, `.`, eight letters, the end.
fn is_temporary(name: &str, target: &str) -> bool {
    name.strip_prefix('.')
        .and_then(|rest| rest.strip_prefix(target))
        .and_then(|rest| rest.strip_suffix(".anyhit-tmp"))
        .is_some_and(|drawn| drawn.len() == 9)
}

#[test]
#[expect(clippy::print_stdout, reason = "the figures of a long run")]
fn a_command_that_is_killed_leaves_the_old_file_or_the_new_one() {
    let kills = std::env::var("ANYHIT_KILLS").ok().and_then(|kills| kills.parse().ok()).unwrap_or(KILLS);
    let mut summary = Vec::new();
    let place = Workplace::new();
    for writer in &place.writers() {
        let course = place.course(writer);
        let [mut old, mut new, mut left] = [0; 3];
        for number in 0..kills {
            let writing = course.ended - course.changed;
            // Anywhere in its course, about when it writes, and from the moment that it is seen to.
            let (after_change, wait) = match number % 3 {
                0 => (false, course.ended.mul_f64(1.1 * random())),
                1 => (false, (course.changed + writing.mul_f64(1.5 * random())).mul_f64(0.95)),
                _ => (true, writing.mul_f64(random())),
            };
            place.kill(writer, after_change, wait);
            let found = fs::read(place.path(writer.target)).expect("the file is there");
            if found == writer.old {
                old += 1;
            } else {
                let head = String::from_utf8_lossy(&found[..found.len().min(80)]);
                let what = format!("{} after {wait:?}: {} bytes: {head}", writer.name, found.len());
                assert!(is_new(writer, &found), "{what}");
                new += 1;
            }
            for name in place.others(writer) {
                assert!(is_temporary(&name, writer.target), "{}: {name}", writer.name);
                left += 1;
                fs::remove_file(place.path(&name)).expect("the process is dead");
            }
        }
        summary.push(format!("{}: {kills} kills, {old} old, {new} new, {left} temporary files", writer.name));
        place.clear(writer);
    }
    println!("{}", summary.join("\n"));
}

#[test]
fn what_a_killed_command_left_is_removed_by_a_later_one() {
    let place = Workplace::new();
    let writer = &place.writers()[0];
    // As kills leave them, two hours ago and just now; and one that is somebody else's.
    let ours = ".rays.test.toml.aB3dE6gH.anyhit-tmp";
    let names = [ours, ".rays.test.toml.aB3dE6gI.anyhit-tmp", ".tmpAbCdEf"];
    for (name, hours) in names.into_iter().zip([2, 0, 2]) {
        let file = fs::File::create(place.path(name)).expect("a writable folder");
        file.set_modified(SystemTime::now() - Duration::from_secs(hours * 3600)).expect("its own file");
    }
    place.course(writer);
    assert_eq!(place.others(writer), names[1..]);
}
