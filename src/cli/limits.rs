//! The arguments that limit how long shaders run, and what they leave behind.

use std::time::Duration;

use clap::Args;

use crate::cli::numbers;
use anyhit_engine::machine::{LaunchFuel, LaunchLimits};
use anyhit_scene::RunLimits;

/// Limits of a whole launch.
#[derive(Args, Clone, Copy, Debug, Default)]
#[command(next_help_heading = "Limits")]
pub(super) struct LaunchLimitArgs {
    /// Maximum number of instructions of all invocations of a launch together, or none [default:
    /// `test` and `smoke`: 2^30, or 2^21 per invocation if that is more, at most 2^38; other
    /// commands: none]
    #[arg(long, value_name = "N", value_parser = fuel)]
    launch_fuel: Option<LaunchFuel>,
    /// Maximum duration of a launch in seconds, or none; where a launch ends then depends on the
    /// machine [default: `test`: 60, `smoke`: 30, other commands: none]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    timeout: Option<Duration>,
    /// Maximum duration of a batch of invocations in seconds, or none; where a batch ends then
    /// depends on the machine [default: `test`: 8, `smoke`: 4, other commands: none]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    batch_timeout: Option<Duration>,
}

/// All limits of running a scene.
#[derive(Args, Clone, Copy, Debug, Default)]
#[command(next_help_heading = "Limits")]
pub(super) struct LimitArgs {
    /// Maximum number of instructions per invocation, checked at back edges, calls and stops
    /// [default: the scene's value, or 268435456]
    #[arg(long, value_name = "N", value_parser = numbers::from_one)]
    fuel: Option<u64>,
    #[command(flatten)]
    launch: LaunchLimitArgs,
    /// Maximum recursion depth of rays [default: the scene's value, or 31]
    #[arg(long, value_name = "N")]
    max_recursion_depth: Option<u32>,
    /// Maximum nesting depth of callable shaders [default: the scene's value, or 1024]
    #[arg(long, value_name = "N", value_parser = callable_depth)]
    max_callable_depth: Option<u32>,
    /// Maximum bytes of registers held by the nested shader calls of an invocation [default: the
    /// scene's value, or 8388608]
    #[arg(long, value_name = "BYTES")]
    max_stack_size: Option<u64>,
    /// Maximum bytes of kept shader output, including 64 per text; texts beyond it are counted
    /// [default: the scene's value, or 67108864]
    #[arg(long, value_name = "BYTES")]
    printed_bytes: Option<u64>,
}

impl LaunchLimitArgs {
    /// The limits, where those not given are the default ones.
    pub(super) fn limits(&self, default: LaunchLimits) -> LaunchLimits {
        LaunchLimits {
            fuel: self.launch_fuel.or(default.fuel),
            max_fuel: default.max_fuel,
            timeout: self.timeout.or(default.timeout),
            batch_timeout: self.batch_timeout.or(default.batch_timeout),
        }
    }
}

impl LimitArgs {
    /// The limits as a scene takes them, with what holds where neither says.
    pub(super) fn limits(&self, default: LaunchLimits) -> RunLimits {
        let LaunchLimitArgs { launch_fuel, timeout, batch_timeout } = self.launch;
        RunLimits {
            fuel: self.fuel,
            launch_fuel,
            timeout,
            batch_timeout,
            max_recursion_depth: self.max_recursion_depth,
            max_callable_depth: self.max_callable_depth,
            max_stack_size: self.max_stack_size,
            printed_bytes: self.printed_bytes,
            default,
        }
    }
}

fn callable_depth(text: &str) -> Result<u32, String> {
    let depth = text.parse().map_err(|_| "expected an integer".to_owned())?;
    anyhit_engine::pipeline::check_callable_depth(depth).map_err(|error| error.message().to_owned())?;
    Ok(depth)
}

fn fuel(text: &str) -> Result<LaunchFuel, String> {
    match text {
        "none" => Ok(LaunchFuel::of(u64::MAX)),
        _ => numbers::from_one(text).map(LaunchFuel::of).map_err(|why| format!("{why}, or `none`")),
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    if text == "none" {
        return Ok(Duration::MAX);
    }
    numbers::seconds(text).map_err(|why| format!("{why}, or `none`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_or_refused() {
        assert_eq!(fuel("12"), Ok(LaunchFuel::of(12)));
        assert_eq!(fuel("none"), Ok(LaunchFuel::of(u64::MAX)));
        assert_eq!(seconds("0.25"), Ok(Duration::from_millis(250)));
        assert_eq!(seconds("none"), Ok(Duration::MAX));
        for wrong in ["", "0", "-1", "nan", "soon"] {
            assert!(seconds(wrong).is_err() && fuel(wrong).is_err(), "{wrong}");
        }
        assert_eq!(callable_depth("1"), Ok(1));
        assert!(callable_depth("0").is_err() && callable_depth("1000000").is_err());
    }
}
