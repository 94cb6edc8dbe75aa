//! The commands, their names and what they do.

use std::fmt::Write as _;

use crate::debugger::Stepping;

/// What a command does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    Step(Stepping),
    StepBack(Stepping),
    Continue,
    ContinueBack,
    Nan,
    Begin,
    Goto,
    Until,
    Traversal,
    TraversalBack,
    LastWrite,
    Break,
    Log,
    Watch,
    Delete,
    Enable,
    Disable,
    Breakpoints,
    Print,
    Set,
    Display,
    Undisplay,
    Locals,
    Globals,
    Temporaries,
    Backtrace,
    Frame,
    Up,
    Down,
    List,
    Sources,
    Instructions,
    Output,
    Help,
    Quit,
}

/// A command.
#[derive(Debug)]
pub struct Command {
    /// Its name, then other spellings.
    pub names: &'static [&'static str],
    /// What follows the name.
    pub arguments: &'static str,
    /// What it does, in a line.
    pub about: &'static str,
    pub(super) action: Action,
    /// Whether an empty line repeats it.
    pub(super) repeats: bool,
}

const fn command(
    names: &'static [&'static str],
    arguments: &'static str,
    about: &'static str,
    action: Action,
    repeats: bool,
) -> Command {
    Command { names, arguments, about, action, repeats }
}

/// The commands, in the order in which `help` lists them.
#[rustfmt::skip]
pub static COMMANDS: &[Command] = &[
    command(&["step", "s"], "[N]", "step to the next line, into functions and the shaders that a ray calls", Action::Step(Stepping::Into), true),
    command(&["next", "n"], "[N]", "step to the next line of this function", Action::Step(Stepping::Over), true),
    command(&["finish", "fin", "out"], "", "run to the caller", Action::Step(Stepping::Out), true),
    command(&["stepi", "si"], "[N]", "step to the next instruction, into calls", Action::Step(Stepping::IntoInstruction), true),
    command(&["nexti", "ni"], "[N]", "step to the next instruction of this function", Action::Step(Stepping::OverInstruction), true),
    command(&["continue", "c", "run", "r"], "[N]", "run to the next breakpoint, or the end", Action::Continue, true),
    command(&["until", "u"], "PLACE", "run to a place: `until 27`, `until shade`", Action::Until, false),
    command(&["traversal", "t"], "", "step to the next event of a ray's traversal", Action::Traversal, true),
    command(&["nan"], "", "run to the first NaN that an operation produces from non-NaN operands", Action::Nan, false),
    command(&["rstep", "rs", "reverse-step"], "[N]", "step back to the previous line, in any function", Action::StepBack(Stepping::Into), true),
    command(&["rnext", "rn", "reverse-next"], "[N]", "step back to the previous line of this function, or to its call", Action::StepBack(Stepping::Over), true),
    command(&["rfinish", "rout", "reverse-finish"], "", "run back to the line that called this function", Action::StepBack(Stepping::Out), true),
    command(&["rstepi", "rsi", "reverse-stepi"], "[N]", "step back to the previous instruction", Action::StepBack(Stepping::IntoInstruction), true),
    command(&["rcontinue", "rc", "reverse-continue"], "[N]", "run back to the previous breakpoint, or the start", Action::ContinueBack, true),
    command(&["rtraversal", "rt", "reverse-traversal"], "", "step back to the previous event of the traversal", Action::TraversalBack, true),
    command(&["who", "last-write"], "EXPRESSION", "go back to the step that last wrote a value, in any shader", Action::LastWrite, false),
    command(&["begin", "start"], "", "go back to the first line", Action::Begin, false),
    command(&["goto"], "STEP", "go to a step by its number, forwards or backwards", Action::Goto, false),
    command(&["break", "b"], "PLACE [if CONDITION] [from N]", "stop at a line (`27`, `main.rgen:27`), a function, an opcode (`OpTraceRayKHR`), a stage (`any-hit`), or a traversal decision (`primitive=62 instance=2 verdict=opaque`)", Action::Break, false),
    command(&["log"], "PLACE TEXT", "print a text with {expressions} at a place and continue", Action::Log, false),
    command(&["watch", "w"], "EXPRESSION", "stop where a variable, a member of this shader's payload or a part of a buffer is written", Action::Watch, false),
    command(&["breakpoints", "info"], "", "list the breakpoints", Action::Breakpoints, false),
    command(&["delete", "d"], "[N ...]", "delete breakpoints; all without a number", Action::Delete, false),
    command(&["enable"], "[N ...]", "enable breakpoints", Action::Enable, false),
    command(&["disable"], "[N ...]", "disable breakpoints", Action::Disable, false),
    command(&["print", "p"], "EXPRESSION", "print the value of an expression", Action::Print, false),
    command(&["set"], "NAME = EXPRESSION", "set a variable, a member or an element", Action::Set, false),
    command(&["display"], "EXPRESSION", "show a value at every stop", Action::Display, false),
    command(&["undisplay"], "[EXPRESSION]", "stop showing a value; all without an expression", Action::Undisplay, false),
    command(&["locals", "l"], "", "list the variables of this function", Action::Locals, false),
    command(&["globals", "g"], "[NAME]", "list the variables of the shader: payload, builtins, buffers", Action::Globals, false),
    command(&["temporaries", "tmp"], "", "list the compiler's intermediate values in this block", Action::Temporaries, false),
    command(&["where", "backtrace", "bt"], "", "print the calls of functions and shaders that led here", Action::Backtrace, false),
    command(&["frame", "f"], "[N]", "select another call of the backtrace", Action::Frame, false),
    command(&["up"], "[N]", "select the caller", Action::Up, true),
    command(&["down"], "[N]", "select the called function", Action::Down, true),
    command(&["list", "ls"], "[LINE]", "print the source around here, or around a line", Action::List, false),
    command(&["sources"], "", "list the source files", Action::Sources, false),
    command(&["instructions", "x"], "", "print the instructions around here", Action::Instructions, false),
    command(&["output", "o"], "", "print all shader output so far", Action::Output, false),
    command(&["help", "h", "?"], "[COMMAND]", "print this list, or the help of one command", Action::Help, false),
    command(&["quit", "q", "exit"], "", "end the session", Action::Quit, false),
];

/// The command of a name, or of the begin of one that no other command has.
///
/// # Errors
/// That there is none, or several, in words.
pub(super) fn find(word: &str) -> Result<&'static Command, String> {
    if let Some(found) = COMMANDS.iter().find(|command| command.names.contains(&word)) {
        return Ok(found);
    }
    let begins = |command: &&Command| command.names[0].starts_with(word);
    let near: Vec<&Command> = COMMANDS.iter().filter(begins).collect();
    match near[..] {
        [only] => Ok(only),
        [] => Err(format!("unknown command `{word}`; `help` lists all commands")),
        _ => {
            let names: Vec<&str> = near.iter().map(|command| command.names[0]).collect();
            Err(format!("`{word}` is ambiguous: {}", names.join(", ")))
        }
    }
}

/// The names of commands that begin with a text.
pub(super) fn complete(begin: &str) -> impl Iterator<Item = &'static str> {
    let names = COMMANDS.iter().map(|command| command.names[0]);
    names.filter(move |name| name.starts_with(begin))
}

/// How wide the list's first column is.
const USAGE: usize = 28;

/// The list of commands, or what one does.
pub(super) fn help(word: &str) -> Result<String, String> {
    if !word.is_empty() {
        let found = find(word)?;
        let others = found.names[1..].join(", ");
        let others = if others.is_empty() { others } else { format!("\nalso: {others}") };
        return Ok(format!("{} {}\n{}{others}\n", found.names[0], found.arguments, found.about));
    }
    let mut text = String::new();
    for command in COMMANDS {
        let short = command.names.get(1).map_or_else(String::new, |short| format!(", {short}"));
        let usage = format!("{}{short} {}", command.names[0], command.arguments);
        let usage = usage.trim_end();
        let gap = if usage.len() < USAGE { "" } else { "\n" };
        let indent = if gap.is_empty() { USAGE - usage.len() } else { USAGE };
        let _ = writeln!(text, "{usage}{gap}{:indent$}{}", "", command.about);
    }
    Ok(text + "An empty line repeats the last step.\n")
}
