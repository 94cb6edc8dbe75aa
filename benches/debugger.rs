//! Cost of `continue` and of stepping back, in an invocation of about 10^8 steps, and in one of a
//! workgroup of 64 invocations with 10^6 loop iterations each.
//!
//! `cargo bench --bench debugger` prints how long each takes (`docs/debugging.md`). Without
//! `--bench` (`cargo test --benches`) every row runs once over few steps.

#![allow(clippy::print_stdout, reason = "a table is printed")]

use std::path::Path;
use std::time::Instant;

use anyhit_debugger::debugger::{Breakpoint, BreakpointPlace, Debugger, Stepping, StopReason};
use anyhit_debugger::session::{ExplainRequest, Session};
use anyhit_scene::{DiskFiles, LoadOptions, load};

const LONG: &str = "shaders/pass/debugger/long/main.comp";
const WORKGROUP: &str = "shaders/pass/debugger/workgroup/main.comp";

fn main() {
    let full = std::env::args().any(|argument| argument == "--bench");
    let begun = |name: &str| {
        let scene = match full {
            true => format!("tests/debugger/scripts/{name}.toml"),
            false => format!("shaders/pass/debugger/{name}/scene.toml"),
        };
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
        let scene = load(&path, &DiskFiles, &LoadOptions::default()).expect("a scene");
        let session = Session::new(scene).expect("valid shaders");
        let request = ExplainRequest::Invocation { dispatch: 0, id: [0; 3] };
        let mut debugger = Debugger::of_scene(&session, &request).expect("such an invocation");
        debugger.begin();
        debugger
    };
    let mut text = String::new();
    let mut row = |name: &str, debugger: &mut Debugger, act: &mut dyn FnMut(&mut Debugger) -> StopReason| {
        let begin = Instant::now();
        let stop = act(debugger);
        let seconds = begin.elapsed().as_secs_f64();
        text += &format!("{name:44} {seconds:8.3} s  at step {:>11}  {stop:?}\n", debugger.time());
    };
    let mut debugger = begun("long");
    row("run to the end", &mut debugger, &mut Debugger::resume);
    row("back over the last line", &mut debugger, &mut |it| it.step_back(Stepping::Over));
    row("back over a line of the loop", &mut debugger, &mut |it| it.step_back(Stepping::Over));
    // The line before the loop: a breakpoint that all turns lie before.
    break_at(&mut debugger, LONG, 11);
    row("back to a breakpoint before the loop", &mut debugger, &mut Debugger::resume_back);
    row("to the middle", &mut debugger, &mut |it| {
        it.seek(50_000_000);
        StopReason::Step
    });
    row("back to the begin", &mut debugger, &mut |it| {
        it.seek(0);
        StopReason::Beginning
    });
    let mut debugger = begun("workgroup");
    row("a workgroup of 64: run to the end", &mut debugger, &mut Debugger::resume);
    row("a workgroup of 64: back over the last line", &mut debugger, &mut |it| it.step_back(Stepping::Over));
    // The line after `if (turns == 0u)`, which nothing reaches.
    let mut debugger = begun("workgroup");
    break_at(&mut debugger, WORKGROUP, 24);
    row("the same with a breakpoint that is not hit", &mut debugger, &mut Debugger::resume);
    print!("{text}");
}

/// Sets a breakpoint at a line, and no other.
fn break_at(debugger: &mut Debugger, file: &str, line: u32) {
    let id = debugger.new_breakpoint_id();
    let place = BreakpointPlace::Line { file: file.to_owned(), line };
    debugger.set_breakpoints(vec![Breakpoint::new(id, place)]);
}
