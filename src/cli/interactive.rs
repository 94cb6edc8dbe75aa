//! The debugger's prompt: lines from a terminal, with history and completion, or from a script.

use std::cell::RefCell;
use std::io::{BufRead, IsTerminal, stdin, stdout};
use std::path::PathBuf;

use rustyline::completion::Completer;
use rustyline::config::CompletionType;
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::history::FileHistory;
use rustyline::validate::Validator;
use rustyline::{Config, Context, Editor, Helper};

use crate::cli::output;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_debugger::console::{Console, PROMPT, run_script};
use anyhit_debugger::debugger::Debugger;

/// Reads commands and answers them, until `quit` or the end of the input. A script's commands are
/// printed before their answers, so that the whole reads as a transcript.
///
/// # Errors
/// Where the terminal or the script cannot be read, or nothing can be printed. In a script, the
/// first command that fails ends the session with an error of its own.
pub(super) fn run(debugger: Debugger, colours: bool) -> Result<()> {
    let (console, reply) = Console::new(debugger, colours);
    let is_terminal = stdin().is_terminal() && stdout().is_terminal();
    if is_terminal {
        output::print("`help` lists the commands, Tab completes them, `quit` ends the session\n")?;
    }
    output::print(&reply.text)?;
    match is_terminal {
        true => from_terminal(console),
        false => from_script(console),
    }
}

fn from_script(mut console: Console) -> Result<()> {
    let failed = |error| Error::new(ErrorKind::Io, format!("standard input: {error}"));
    let lines = stdin().lock().lines().map(|line| line.map_err(failed));
    run_script(&mut console, lines, &mut |text| output::print(text))
}

fn from_terminal(console: Console) -> Result<()> {
    let failed = |error: ReadlineError| Error::new(ErrorKind::Io, format!("the terminal: {error}"));
    let config = Config::builder().completion_type(CompletionType::List).build();
    let mut editor: Editor<Prompt, FileHistory> = Editor::with_config(config).map_err(failed)?;
    editor.set_helper(Some(Prompt { console: RefCell::new(console) }));
    let history = history_file();
    if let Some(path) = &history {
        // Without a history the prompt works as well.
        let _ = editor.load_history(path);
    }
    loop {
        match editor.readline(PROMPT) {
            Ok(line) => {
                if !line.trim().is_empty() {
                    let _ = editor.add_history_entry(line.trim());
                }
                let Some(prompt) = editor.helper_mut() else { break };
                let reply = prompt.console.get_mut().execute(&line);
                output::print(&reply.text)?;
                if reply.quits {
                    break;
                }
            }
            Err(ReadlineError::Interrupted) => {}
            Err(ReadlineError::Eof) => break,
            Err(error) => return Err(failed(error)),
        }
    }
    if let Some(path) = &history {
        if let Some(folder) = path.parent() {
            let _ = std::fs::create_dir_all(folder);
        }
        let _ = editor.save_history(path);
    }
    Ok(())
}

/// Where the history is kept: in the user's state folder, where one is known.
fn history_file() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let state = folder("XDG_STATE_HOME").or_else(|| Some(folder("HOME")?.join(".local/state")));
    let state = state.or_else(|| folder("LOCALAPPDATA"))?;
    Some(state.join("anyhit").join("debugger-history"))
}

/// Completes commands and names at the prompt.
struct Prompt {
    /// Completion evaluates what is before a dot.
    console: RefCell<Console>,
}

impl Helper for Prompt {}
impl Highlighter for Prompt {}
impl Validator for Prompt {}

impl Hinter for Prompt {
    type Hint = String;
}

impl Completer for Prompt {
    type Candidate = String;

    fn complete(
        &self,
        line: &str,
        position: usize,
        _: &Context<'_>,
    ) -> rustyline::Result<(usize, Vec<String>)> {
        Ok(self.console.borrow_mut().complete(&line[..position]))
    }
}
