//! What going back costs: an invocation of some 10^8 steps is run to its end, and gone back in.
//!
//! `cargo bench --bench debugger` prints how long each takes (`docs/debugging.md`). Without
//! `--bench` (`cargo test --benches`) every row runs once over few steps.

#![allow(clippy::print_stdout, reason = "a table is printed")]

use std::path::Path;
use std::time::Instant;

use anyhit::internals::debug::debugger::{Breakpoint, BreakpointPlace, Debugger, Stepping, StopReason};
use anyhit::internals::debug::session::{ExplainRequest, Session};
use anyhit::internals::scene::{DiskFiles, LoadOptions, load};

const SOURCE: &str = "shaders/pass/debugger/long/main.comp";

fn main() {
    let full = std::env::args().any(|argument| argument == "--bench");
    let scene = if full { "tests/debugger/long.toml" } else { "shaders/pass/debugger/long/scene.toml" };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
    let scene = load(&path, &DiskFiles, &LoadOptions::default()).expect("a scene");
    let session = Session::new(scene).expect("valid shaders");
    let request = ExplainRequest::Invocation { dispatch: 0, id: [0; 3] };
    let mut debugger = Debugger::of_scene(&session, &request).expect("such an invocation");
    debugger.begin();
    let (mut text, mut debugger) = (String::new(), debugger);
    let mut row = |name: &str, debugger: &mut Debugger, act: &mut dyn FnMut(&mut Debugger) -> StopReason| {
        let begin = Instant::now();
        let stop = act(debugger);
        let seconds = begin.elapsed().as_secs_f64();
        text += &format!("{name:44} {seconds:8.3} s  at step {:>11}  {stop:?}\n", debugger.time());
    };
    row("run to the end", &mut debugger, &mut Debugger::resume);
    row("back over the last line", &mut debugger, &mut |it| it.step_back(Stepping::Over));
    row("back over a line of the loop", &mut debugger, &mut |it| it.step_back(Stepping::Over));
    // The line before the loop: a breakpoint that all turns lie before.
    let id = debugger.new_breakpoint_id();
    let place = BreakpointPlace::Line { file: SOURCE.to_owned(), line: 11 };
    debugger.set_breakpoints(vec![Breakpoint::new(id, place)]);
    row("back to a breakpoint before the loop", &mut debugger, &mut Debugger::resume_back);
    row("to the middle", &mut debugger, &mut |it| {
        it.seek(50_000_000);
        StopReason::Step
    });
    row("back to the begin", &mut debugger, &mut |it| {
        it.seek(0);
        StopReason::Beginning
    });
    print!("{text}");
}
