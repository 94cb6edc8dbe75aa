//! Commands from outside: what they print, write and return.

#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod action;
mod atomic_files;
mod bare_modules;
mod cli;
mod looking;
mod looking_compute;
mod page_blocks;
mod printed_commands;
mod shares;
mod shares_recipes;
mod smoke;
#[cfg(feature = "wgsl")]
mod smoke_values;
mod stability;
#[cfg(unix)]
mod terminal;
mod test_command;
