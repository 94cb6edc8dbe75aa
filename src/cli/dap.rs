//! `anyhit dap`: the debugger for editors, over standard input and output or a port.

use std::io::{stdin, stdout};
use std::rc::Rc;

use clap::Args;

use crate::cli::input::SceneFileArgs;
use crate::cli::limits::LimitArgs;
use crate::cli::output;
use anyhit_base::error::{Error, Result};
use anyhit_debugger::adapter::Host;
use anyhit_debugger::adapter::server::{self, DiskHost};
use anyhit_engine::machine::LaunchLimits;

/// Debug an invocation or a ray in an editor (Debug Adapter Protocol).
///
/// The editor starts this command. Its launch configuration names a scene and a pixel, a ray or an
/// invocation; docs/debugging.md has configurations for several editors.
#[derive(Args, Clone, Debug)]
pub(super) struct DapArgs {
    /// Serve one editor after the other on this local port instead of standard input and output; 0
    /// selects a free port
    #[arg(long, value_name = "N")]
    port: Option<u16>,
    #[command(flatten)]
    files: SceneFileArgs,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// `Io` where the port is taken, or the editor cannot be written to.
pub(super) fn run(args: DapArgs) -> Result<()> {
    let limits = args.limits.limits(LaunchLimits::default());
    let host: Rc<dyn Host> = Rc::new(DiskHost { files: args.files.files()?, limits });
    let Some(port) = args.port else {
        return server::serve(host, stdin(), &mut stdout().lock(), true)
            .map_err(|error| Error::io("standard output", error));
    };
    server::listen(
        &host,
        port,
        &mut |address| output::hint(format_args!("listening on {address}")),
        &mut |error| output::hint(format_args!("the connection ended: {error}")),
    )
}
