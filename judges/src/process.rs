//! SPIRV-Tools in a process of its own: an assertion of it that does not hold, or a wrong pointer,
//! ends that process and not the judge.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::passes::RECIPES;
use crate::verdict::{Theirs, theirs};
use crate::{bytes, optimise, words};

/// The number that asks for the validator; those below are of [`RECIPES`].
const VALIDATE: u8 = u8::MAX;

/// What an answer begins with.
const DONE: u8 = 0;
const COMPLAINT: u8 = 1;

/// A process that runs SPIRV-Tools, started when it is first asked and again after it ended.
pub struct ToolProcess {
    program: PathBuf,
    child: Option<Child>,
}

impl ToolProcess {
    /// The program is that of `src/bin/spirv_tools.rs`.
    pub fn new(program: &Path) -> Self {
        Self { program: program.to_owned(), child: None }
    }

    /// What the validator says of a module; `None` where its process ended.
    pub fn validate(&mut self, module: &[u32]) -> Option<Theirs> {
        self.ask(VALIDATE, module).map(|answer| answer.map(drop))
    }

    /// What the optimizer makes of a module by one of [`RECIPES`], given by its number, or its
    /// complaint; `None` where its process ended.
    pub fn optimise(&mut self, recipe: usize, module: &[u32]) -> Option<Result<Vec<u32>, String>> {
        self.ask(u8::try_from(recipe).expect("few recipes"), module)
    }

    fn ask(&mut self, task: u8, module: &[u32]) -> Option<Result<Vec<u32>, String>> {
        let child = self.child.get_or_insert_with(|| {
            let mut command = Command::new(&self.program);
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
            command.spawn().expect("the program starts")
        });
        let answer = exchange(child, task, module).ok();
        if answer.is_none() {
            self.stop();
        }
        answer
    }

    fn stop(&mut self) {
        if let Some(mut child) = self.child.take() {
            drop(child.stdin.take());
            let _ = child.wait();
        }
    }
}

impl Drop for ToolProcess {
    fn drop(&mut self) {
        self.stop();
    }
}

fn exchange(child: &mut Child, task: u8, module: &[u32]) -> io::Result<Result<Vec<u32>, String>> {
    let (Some(input), Some(output)) = (&mut child.stdin, &mut child.stdout) else {
        return Err(io::ErrorKind::BrokenPipe.into());
    };
    send(input, task, &bytes(module))?;
    let (kind, answer) = receive(output)?;
    Ok(match kind {
        DONE => Ok(words(&answer)),
        _ => Err(String::from_utf8_lossy(&answer).into_owned()),
    })
}

/// A message: its kind, its length in bytes as a little-endian u32, and its bytes.
fn send(to: &mut impl Write, kind: u8, message: &[u8]) -> io::Result<()> {
    let mut all = vec![kind];
    all.extend((message.len() as u32).to_le_bytes());
    all.extend(message);
    to.write_all(&all)?;
    to.flush()
}

fn receive(from: &mut impl Read) -> io::Result<(u8, Vec<u8>)> {
    let mut head = [0; 5];
    from.read_exact(&mut head)?;
    let mut message = vec![0; u32::from_le_bytes([head[1], head[2], head[3], head[4]]) as usize];
    from.read_exact(&mut message)?;
    Ok((head[0], message))
}

/// Answers until nobody asks any more: the process itself.
pub fn serve() -> io::Result<()> {
    let (mut input, mut output) = (io::stdin().lock(), io::stdout().lock());
    while let Ok((task, message)) = receive(&mut input) {
        let module = words(&message);
        let answer = match task {
            VALIDATE => theirs(&module).map(|()| Vec::new()),
            recipe => optimise(&module, RECIPES[usize::from(recipe)].1),
        };
        match answer {
            Ok(words) => send(&mut output, DONE, &bytes(&words))?,
            Err(complaint) => send(&mut output, COMPLAINT, complaint.as_bytes())?,
        }
    }
    Ok(())
}
