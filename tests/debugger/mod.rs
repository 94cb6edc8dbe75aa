//! The debugger, its protocol, and explanations of rays.

#[cfg(feature = "debugger")]
mod console;
#[cfg(feature = "debugger")]
mod dap;
#[cfg(feature = "debugger")]
mod documented_configurations;
#[cfg(feature = "wgsl")]
mod explanations;
mod expressions;
mod source_variables;
#[cfg(feature = "debugger")]
mod steps;
mod trace_one_ray;
#[cfg(feature = "debugger")]
mod walks;
