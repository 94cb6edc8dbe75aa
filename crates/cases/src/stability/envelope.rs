//! The devices whose errors are simulated.

use anyhit_scene::read::Named;

/// The device whose errors are simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Envelope {
    /// The errors that Vulkan allows.
    #[default]
    Vulkan,
    /// The errors that NVIDIA's driver was measured to make.
    Nvidia,
}

impl Envelope {
    /// The name in sentences.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vulkan => "Vulkan",
            Self::Nvidia => "NVIDIA's driver",
        }
    }
}

impl Named for Envelope {
    const WHAT: &'static str = "an envelope";
    const NAMES: &'static [(&'static str, Self)] = &[("vulkan", Self::Vulkan), ("nvidia", Self::Nvidia)];
}
