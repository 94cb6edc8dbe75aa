//! The limits of running that the command line gives to a scene.

use std::time::Duration;

use crate::machine::{LaunchFuel, LaunchLimits, PrintedBytes};
use crate::scene::ResolvedScene;

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
    /// How many bytes of what shaders print are kept.
    pub printed_bytes: Option<u64>,
    /// What holds where neither these limits nor the scene say: [`LaunchLimits::TESTS`] for tests.
    pub default: LaunchLimits,
}

impl RunLimits {
    /// Gives the limits to a scene.
    pub fn give(&self, scene: &mut ResolvedScene) {
        let launch = &mut scene.launch_limits;
        launch.fuel = self.launch_fuel.or(launch.fuel).or(self.default.fuel);
        launch.timeout = self.timeout.or(launch.timeout).or(self.default.timeout);
        launch.batch_timeout = self.batch_timeout.or(launch.batch_timeout).or(self.default.batch_timeout);
        scene.fuel = self.fuel.or(scene.fuel);
        scene.max_recursion_depth = self.max_recursion_depth.or(scene.max_recursion_depth);
        scene.max_callable_depth = self.max_callable_depth.or(scene.max_callable_depth);
        scene.printed_bytes = self.printed_bytes.map_or(scene.printed_bytes, PrintedBytes);
    }
}
