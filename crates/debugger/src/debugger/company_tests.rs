//! Whether an invocation is debugged alone, with the others of its workgroup in batches that nobody
//! observes, or with all of them observed one after the other: no answer may tell.

use std::path::Path;

use crate::console::Console;
use crate::session::Session;
use anyhit_engine::pipeline::Company;
use anyhit_scene::{DiskFiles, LoadOptions, load, load_bytes};

use super::start::company_in;
use super::{Debugger, Stepping, StopReason};

const WORKGROUP: &str = "shaders/pass/debugger/workgroup/scene.toml";
const EARLY_RETURN: &str = "shaders/fail/compute/early-return/scene.toml";

/// The companies in which nothing but speed may differ. The first observes each step of each
/// invocation, one after the other.
const COMPANIES: [Company; 3] = [Company::Observed, Company::Batch, Company::Alone];

/// An invocation of a scene's dispatch, the scene's text changed.
fn debugger(scene: &str, change: (&str, &str), id: u32, company: Option<Company>) -> Debugger {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join(scene);
    let text = std::fs::read_to_string(&path).unwrap().replace(change.0, change.1);
    let scene = load_bytes(&path, text.into_bytes(), &DiskFiles, &LoadOptions::default()).unwrap();
    let session = Session::new(scene).unwrap();
    Debugger::of_dispatch(&session, 0, [id, 0, 0], company).unwrap()
}

/// An invocation of the workgroup that turns so often.
fn turning(turns: u32, id: u32, company: Option<Company>) -> Debugger {
    debugger(WORKGROUP, ("u32 = 2 ", &format!("u32 = {turns} ")), id, company)
}

/// What a debugger answers to commands.
fn transcript(debugger: Debugger, commands: &[&str]) -> String {
    let (mut console, begin) = Console::new(debugger, false);
    let answers = commands.iter().map(|command| {
        let reply = console.execute(command);
        assert!(!reply.failed, "{command}: {}", reply.text);
        format!("({command}) {}", reply.text)
    });
    begin.text + &answers.collect::<String>()
}

/// The answers of one company after the other are those of the first.
#[track_caller]
fn assert_same(debuggers: impl Iterator<Item = Debugger>, commands: &[&str]) -> String {
    let mut all = debuggers.map(|debugger| transcript(debugger, commands));
    let first = all.next().unwrap();
    all.for_each(|other| assert_eq!(first, other));
    first
}

/// The generator of the shader after so many turns: x -> 1664525 x + 1013904223 modulo 2^32.
fn state_after(turns: u32, own: u32) -> u32 {
    (0..turns).fold(own, |state, _| state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223))
}

/// Of 1600 turns one, that of number 1023, comes to line 30. When the invocation with index 5 is
/// there, five have been there before it and are at the barrier; those behind it have not begun.
#[test]
fn going_back_after_continuing_answers_as_in_any_company() {
    let commands = [
        "break 24",
        "continue",
        "where",
        "globals",
        "who last",
        "where",
        "locals",
        "print turn",
        "print count",
        "print states[4]",
        "print states[6]",
        "watch last",
        "continue",
        "continue",
        "rcontinue",
        "delete",
        "rnext",
        "who random",
        "where",
        "goto 20001",
        "locals",
        "who random",
        "locals",
        "until 38",
        "print states[63]",
        "print count",
        "rcontinue",
    ];
    let companies = COMPANIES.map(Some).into_iter().chain([None]);
    let text = assert_same(companies.map(|company| turning(1600, 5, company)), &commands);
    assert!(text.contains("(continue) the end of the run\n"), "{text}");
    assert!(text.contains("(print turn) turn = uint 1023\n"), "{text}");
    let before = format!("(print states[4]) states[4] = uint {}\n", state_after(1600, 4));
    assert!(text.contains(&format!("(print count) count = uint 5\n{before}")), "{text}");
    assert!(text.contains("(print states[6]) states[6] = uint 0\n"), "{text}");
    let last = format!("(print states[63]) states[63] = uint {}\n", state_after(1600, 63));
    assert!(text.contains(&format!("{last}(print count) count = uint 64\n")), "{text}");
}

#[test]
fn each_step_is_the_same_after_continuing_as_when_it_is_stepped_to() {
    let commands = ["where", "locals", "globals", "temporaries"];
    let mut stepped = turning(2, 63, Some(Company::Observed));
    stepped.begin();
    let mut stepped = Console::embedded(stepped);
    let mut answers = Vec::new();
    loop {
        let stop = stepped.debugger().step(Stepping::IntoInstruction);
        if matches!(stop, StopReason::End) {
            break;
        }
        let texts = commands.map(|command| stepped.execute(command).text);
        answers.push((stepped.debugger().time(), texts));
    }
    let mut continued = turning(2, 63, None);
    continued.begin();
    assert!(matches!(continued.resume(), StopReason::End));
    let mut continued = Console::embedded(continued);
    assert!(answers.len() > 40, "{} steps", answers.len());
    for (time, texts) in answers.into_iter().rev() {
        continued.debugger().seek(time);
        assert_eq!(commands.map(|command| continued.execute(command).text), texts, "step {time}");
    }
}

/// Behind what five others and what all others did before the barrier, a checkpoint is due; time
/// alone asks for none here.
#[test]
fn others_that_worked_for_long_need_not_run_again() {
    let commands = ["continue", "where", "rstep", "where", "who random", "where", "begin", "locals"];
    let mut debugger = turning(6000, 5, None);
    debugger.history.keep_no_more();
    debugger.history.work_interval = 1000;
    debugger.begin();
    assert!(matches!(debugger.resume(), StopReason::End));
    assert_eq!(debugger.history.segments(), 3);
    let times = [0, 1, 2].map(|number| debugger.history.segment(number).0.course.time);
    assert_eq!(times[..2], [0, 0]);
    debugger.seek(times[2]);
    let (file, line) = ("shaders/pass/debugger/workgroup/main.comp", 36);
    let position = debugger.stack()[0].position.unwrap();
    assert_eq!(debugger.sources().describe(position), format!("{file}:{line}"));
    debugger.seek(0);
    let again = transcript(debugger, &commands);
    assert_eq!(again, transcript(turning(6000, 5, None), &commands));
}

/// Of the second workgroup 36 invocations come to the barrier, and 28 return before it.
#[test]
fn a_trap_of_the_workgroup_is_the_same_in_any_company() {
    for id in [64, 99, 100, 127] {
        let commands = ["continue", "where", "rcontinue", "where"];
        let companies = COMPANIES.map(Some).into_iter().chain([None]);
        let scene = |company| debugger(EARLY_RETURN, ("", ""), id, company);
        let text = assert_same(companies.map(scene), &commands);
        assert!(text.contains("barrier"), "{text}");
    }
}

/// One workgroup stores to a word of `sums` by one invocation only; of two, both store to it.
#[test]
fn invocations_share_batches_only_where_no_other_stores_to_their_memory() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join(WORKGROUP);
    let session = Session::new(load(&path, &DiskFiles, &LoadOptions::default()).unwrap()).unwrap();
    let compute = &session.dispatch(0).unwrap().compute;
    let resources = &session.assembled().resources;
    assert_eq!(company_in(compute, resources, [1, 1, 1]), Company::Alone);
    assert_eq!(company_in(compute, resources, [2, 1, 1]), Company::Batch);
}
