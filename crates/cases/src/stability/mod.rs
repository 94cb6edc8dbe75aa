//! How far a shader's results depend on rounding.
//!
//! [`shadow()`] executes every float operation of the run also in f64, and says on which
//! lines the two differ. [`perturb()`] repeats a run with every result moved at random within what
//! Vulkan allows, and says which outputs and branches change. Both observe invocations one by one,
//! as [`Observer`](anyhit_engine::machine::Observer)s of the interpreter: a run without observers
//! costs nothing more.

mod allowed;
mod calculate;
mod envelope;
pub mod found;
mod instability;
pub mod outputs;
mod packed_shadows;
pub mod perturb;
mod place;
mod probe;
mod rays;
mod report;
pub mod shadow;
mod shadow_context;
mod shadow_interpreter;
mod shadow_value;
mod shadows;
mod stable;
mod texel_shadows;

pub(crate) use allowed::device_result;
pub use envelope::Envelope;
pub use found::ShadowFindings;
pub(crate) use instability::UnstableOutput;
pub use instability::{Instability, Perturbation};
pub use perturb::perturb;
pub use place::SourceLocation;
pub use shadow::shadow;
pub use stable::StableExpectation;

use anyhit_scene::Assembled;
use anyhit_unit_test::memory;

/// Copies a scene and the contents of its buffers and images, so that runs on one do not change the
/// other.
pub fn deep_copy(assembled: &Assembled) -> Assembled {
    Assembled { resources: memory::copied(&assembled.resources), ..assembled.clone() }
}
