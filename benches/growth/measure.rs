//! Measures time and memory of a function, or of a command in a separate process.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

use peak_alloc::PeakAlloc;

use crate::clock;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// Names the file that a process for one command writes its cost to.
const COST_FILE: &str = "ANYHIT_GROWTH_COST";

/// Processor time after which a point is not measured again.
const ENOUGH: Duration = Duration::from_millis(400);
const RUNS: usize = 7;

/// Something to measure.
pub(crate) enum Work {
    /// A command of the program `anyhit`: its arguments, and its exit code.
    Command(Vec<String>, i32),
    /// A call of the library.
    Call(Box<dyn FnMut()>),
}

impl Work {
    /// A command that succeeds.
    pub fn command<const N: usize>(arguments: [&str; N]) -> Self {
        Self::command_that_exits(0, arguments)
    }

    /// A command that exits with this code.
    pub fn command_that_exits<const N: usize>(code: i32, arguments: [&str; N]) -> Self {
        Self::Command(arguments.map(str::to_owned).to_vec(), code)
    }

    /// A call of the library.
    pub fn call(call: impl FnMut() + 'static) -> Self {
        Self::Call(Box::new(call))
    }
}

/// Cost of a piece of work.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// Processor time in seconds.
    pub seconds: f64,
    /// Bytes that are allocated at most at a time, beyond those before.
    pub bytes: f64,
}

/// Returns the median time of several runs, or of one, and the smallest peak of memory.
pub fn cost(work: &mut Work, folder: &Path, once: bool) -> Cost {
    let mut costs: Vec<Cost> = Vec::new();
    let spent = |costs: &[Cost]| costs.iter().map(|cost| cost.seconds).sum::<f64>();
    while costs.is_empty() || !once && costs.len() < RUNS && spent(&costs) < ENOUGH.as_secs_f64() {
        costs.push(match work {
            Work::Call(call) => cost_of(call),
            Work::Command(arguments, code) => cost_of_command(arguments, *code, folder),
        });
    }
    costs.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    let bytes = costs.iter().map(|cost| cost.bytes).fold(f64::INFINITY, f64::min);
    Cost { seconds: costs[costs.len() / 2].seconds, bytes }
}

/// Returns the bytes that a command allocates before it does anything.
pub fn floor_of_commands(folder: &Path) -> f64 {
    static FLOOR: OnceLock<f64> = OnceLock::new();
    *FLOOR.get_or_init(|| cost_of_command(&["--version".to_owned()], 0, folder).bytes)
}

fn cost_of<T>(call: impl FnOnce() -> T) -> Cost {
    let before = ALLOCATOR.current_usage();
    ALLOCATOR.reset_peak_usage();
    let start = clock::process();
    let result = call();
    let seconds = (clock::process() - start).as_secs_f64();
    drop(result);
    Cost { seconds, bytes: ALLOCATOR.peak_usage().saturating_sub(before) as f64 }
}

/// Runs a command in a separate process, because a command exits its process.
fn cost_of_command(arguments: &[String], code: i32, folder: &Path) -> Cost {
    let file = folder.join("cost");
    let program = std::env::current_exe().expect("the path of this program");
    let mut command = Command::new(program);
    command.args(arguments).env(COST_FILE, &file).current_dir(folder).stdin(Stdio::null());
    let output = command.output().expect("a process");
    assert!(
        output.status.code() == Some(code),
        "anyhit {}: {}, expected exit code {code}\n{}{}",
        arguments.join(" "),
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    let text = std::fs::read_to_string(&file).expect("the cost of a command");
    let mut numbers = text.split_whitespace().map(|word| word.parse().expect("a number"));
    let mut next = || numbers.next().expect("two numbers");
    Cost { seconds: next(), bytes: next() }
}

/// Runs the command of this process and writes its cost, if this is a process for one.
pub fn run_as_command() -> Option<ExitCode> {
    let file = PathBuf::from(std::env::var_os(COST_FILE)?);
    let mut code = ExitCode::FAILURE;
    let cost = cost_of(|| code = anyhit::cli::main());
    std::fs::write(file, format!("{} {}", cost.seconds, cost.bytes)).expect("a temporary file");
    Some(code)
}
