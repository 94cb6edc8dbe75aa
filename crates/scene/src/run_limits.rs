//! The limits of running that the command line gives to a scene.

use std::time::Duration;

use crate::ResolvedScene;
use anyhit_engine::machine::{LaunchFuel, LaunchLimits, PrintedBytes};

/// Limits of running that go before those of a scene, where they are set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunLimits {
    /// Instructions that an invocation may execute.
    pub fuel: Option<u64>,
    /// What all invocations of a launch may execute together.
    pub launch_fuel: Option<LaunchFuel>,
    /// How long a launch may take.
    pub timeout: Option<Duration>,
    /// How long a batch of invocations may take.
    pub batch_timeout: Option<Duration>,
    /// `maxPipelineRayRecursionDepth`
    pub max_recursion_depth: Option<u32>,
    /// How deeply callable shaders may call each other.
    pub max_callable_depth: Option<u32>,
    /// Bytes of registers of the shaders that call each other.
    pub max_stack_size: Option<u64>,
    /// How many bytes of what shaders print are kept.
    pub printed_bytes: Option<u64>,
    /// What holds where neither these limits nor the scene say: [`LaunchLimits::TESTS`] for tests.
    pub default: LaunchLimits,
}

impl RunLimits {
    /// Gives the limits to a scene. What a scene says of itself is a stranger's word: where there
    /// is a default fuel for a launch it lowers that alone, and it keeps no more of what is printed
    /// than is kept by default.
    pub fn give(&self, scene: &mut ResolvedScene) {
        for pipeline in scene.all_pipelines_mut() {
            let launch = &mut pipeline.launch_limits;
            launch.max_fuel = if self.launch_fuel.is_none() { self.default.fuel } else { None };
            launch.fuel = self.launch_fuel.or(launch.fuel).or(self.default.fuel);
            launch.timeout = self.timeout.or(launch.timeout).or(self.default.timeout);
            launch.batch_timeout = self.batch_timeout.or(launch.batch_timeout).or(self.default.batch_timeout);
            pipeline.fuel = self.fuel.or(pipeline.fuel);
            pipeline.max_recursion_depth = self.max_recursion_depth.or(pipeline.max_recursion_depth);
            pipeline.max_callable_depth = self.max_callable_depth.or(pipeline.max_callable_depth);
            pipeline.max_stack_size = self.max_stack_size.or(pipeline.max_stack_size);
        }
        let own = PrintedBytes(scene.printed_bytes.0.min(PrintedBytes::default().0));
        scene.printed_bytes = self.printed_bytes.map_or(own, PrintedBytes);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{DiskFiles, LoadOptions, load_text};
    use anyhit_engine::machine::Watchdog;

    /// The fuel of a launch of so many invocations of a scene, and the bytes printed that it keeps.
    fn given(keys: &str, limits: RunLimits, invocations: u64) -> (u64, u64) {
        let text = format!("version = 1\n[pipeline]\n{keys}");
        let scene = load_text(Path::new("a.toml"), &text, &DiskFiles, &LoadOptions::default());
        let mut scene = scene.unwrap_or_else(|error| panic!("{}", error.render()));
        limits.give(&mut scene);
        (Watchdog::new(scene.pipeline.launch_limits, invocations).fuel(), scene.printed_bytes.0)
    }

    #[test]
    fn a_scene_lowers_what_tests_allow_and_raises_nothing() {
        let test = RunLimits { default: LaunchLimits::TESTS, ..RunLimits::default() };
        let (all, printed) = (1 << 30, 64 << 20);
        assert_eq!(given("", test, 8), (all, printed));
        assert_eq!(given("launch_fuel = 900\nprinted_bytes = 7", test, 8), (900, 7));
        let more = "launch_fuel = 1000000000000\nprinted_bytes = 1000000000000";
        assert_eq!(given(more, test, 8), (all, printed));
        // 2^21 for each of 2^12 invocations.
        assert_eq!(given(more, test, 1 << 12), (1 << 33, printed));
        // However many there are, 2^38 is the most.
        assert_eq!(given("", test, 1 << 40), (1 << 38, printed));
        assert_eq!(LaunchLimits::TESTS.timeout, Some(Duration::from_secs(60)));
        // The flags do, and where there is no default the scene's key holds.
        let (fuel, bytes) = (LaunchFuel::of(1 << 50), 1 << 40);
        let flags = RunLimits { launch_fuel: Some(fuel), printed_bytes: Some(bytes), ..test };
        assert_eq!(given(more, flags, 8), (1 << 50, bytes));
        assert_eq!(given(more, RunLimits::default(), 8), (1_000_000_000_000, printed));
    }
}
