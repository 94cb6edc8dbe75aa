//! Scripts of commands: lines that are executed one after the other and answered as a transcript.

use crate::debugger::Debugger;
use anyhit_base::error::{Error, ErrorKind, Result};

use super::Console;

/// What stands before each command.
pub const PROMPT: &str = "(anyhit) ";

/// Executes the lines of a script, until `quit` or their end. Each command is given to `print`
/// before its answer, so that the whole reads as a transcript; lines with `#` are comments.
///
/// # Errors
/// Where a line cannot be read or printed. The first command that fails ends the script with an
/// error of its own.
pub fn run_script(
    console: &mut Console,
    lines: impl Iterator<Item = Result<String>>,
    print: &mut dyn FnMut(&str) -> Result<()>,
) -> Result<()> {
    for (number, line) in (1..).zip(lines) {
        let line = line?;
        let command = line.trim();
        if command.starts_with('#') {
            print(&format!("{command}\n"))?;
            continue;
        }
        let reply = console.execute(command);
        print(&format!("{PROMPT}{command}\n{}", reply.text))?;
        if reply.quits {
            break;
        }
        if reply.failed {
            let why = reply.text.trim_end();
            let message = format!("line {number} of the script failed: `{command}`: {why}");
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
    }
    Ok(())
}

/// The transcript of commands, one a line.
///
/// # Errors
/// The first command that fails.
pub fn transcript(debugger: Debugger, commands: &str) -> Result<String> {
    let (mut console, reply) = Console::new(debugger, false);
    let mut text = reply.text;
    let lines = commands.lines().map(|line| Ok(line.to_owned()));
    run_script(&mut console, lines, &mut |answer| {
        text += answer;
        Ok(())
    })?;
    Ok(text)
}
