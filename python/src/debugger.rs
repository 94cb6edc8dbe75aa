//! The debugger: its prompt, and the adapter for editors.

use std::io::{stdin, stdout};
use std::rc::Rc;

use anyhit::Error;
use anyhit_debugger::adapter::Host;
use anyhit_debugger::adapter::server::{self, DiskHost};
use anyhit_debugger::console::Console;
use anyhit_debugger::debugger::Debugger;
use anyhit_scene::{RunLimits, SceneFiles};
use pyo3::prelude::*;

use crate::argument;
use crate::error::raised;
use crate::run::{interruptible, run};

/// A prompt: what reads commands, and whether listings are in colour.
pub(crate) struct Prompt<'a, 'py> {
    /// Is called with each answer, and returns the next command; `None` to leave.
    pub(crate) read: &'a Bound<'py, PyAny>,
    pub(crate) colours: bool,
}

impl Prompt<'_, '_> {
    /// Answers commands until the last one.
    pub(crate) fn run(&self, begin: impl FnOnce() -> anyhit::Result<Debugger> + Send) -> PyResult<()> {
        let (read, colours) = (self.read.clone().unbind(), self.colours);
        let next =
            |text: String| Python::attach(|py| read.bind(py).call1((text,))?.extract::<Option<String>>());
        let session = || -> anyhit::Result<PyResult<()>> {
            let (mut console, mut reply) = Console::new(begin()?, colours);
            loop {
                match next(std::mem::take(&mut reply.text)) {
                    Ok(Some(command)) => reply = console.execute(&command),
                    Ok(None) => return Ok(Ok(())),
                    Err(error) => return Ok(Err(error)),
                }
                if reply.quits {
                    return Ok(Ok(()));
                }
            }
        };
        interruptible(self.read.py(), session)?.map_err(raised)?
    }
}

/// Serves editors: one on standard input and output, or one after the other on a local port, of
/// which 0 is a free one.
#[pyfunction]
#[pyo3(signature = (port=None))]
pub(crate) fn _serve_editors(
    py: Python<'_>,
    #[pyo3(from_py_with = argument::port)] port: Option<u32>,
) -> PyResult<()> {
    run(py, || {
        let host: Rc<dyn Host> =
            Rc::new(DiskHost { files: SceneFiles::default(), limits: RunLimits::default() });
        let Some(port) = port else {
            return server::serve(host, stdin(), &mut stdout().lock(), true)
                .map_err(|error| Error::io("standard output", error));
        };
        let port = u16::try_from(port).map_err(|_| {
            let message = format!("port: {port} is no port: the last one is 65535");
            Error::new(anyhit::ErrorKind::InvalidArgument, message)
        })?;
        server::listen(&host, port, &mut |address| eprintln!("listening on {address}"), &mut |error| {
            eprintln!("the connection ended: {error}")
        })
    })
}
