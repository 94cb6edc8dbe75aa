//! Execution models.

use serde::{Serialize, Serializer};

/// An execution model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// `RayGenerationKHR`
    RayGeneration,
    /// `IntersectionKHR`
    Intersection,
    /// `AnyHitKHR`
    AnyHit,
    /// `ClosestHitKHR`
    ClosestHit,
    /// `MissKHR`
    Miss,
    /// `CallableKHR`
    Callable,
    /// `GLCompute`
    Compute,
    /// Any other model, by number.
    Other(u32),
}

impl Stage {
    /// The stage of an execution model's number.
    #[doc(hidden)]
    pub fn of(execution_model: u32) -> Self {
        match execution_model {
            5 => Self::Compute,
            5313 => Self::RayGeneration,
            5314 => Self::Intersection,
            5315 => Self::AnyHit,
            5316 => Self::ClosestHit,
            5317 => Self::Miss,
            5318 => Self::Callable,
            other => Self::Other(other),
        }
    }

    /// The specification's name of the execution model.
    pub fn name(self) -> &'static str {
        match self {
            Self::RayGeneration => "RayGenerationKHR",
            Self::Intersection => "IntersectionKHR",
            Self::AnyHit => "AnyHitKHR",
            Self::ClosestHit => "ClosestHitKHR",
            Self::Miss => "MissKHR",
            Self::Callable => "CallableKHR",
            Self::Compute => "GLCompute",
            Self::Other(0) => "Vertex",
            Self::Other(1) => "TessellationControl",
            Self::Other(2) => "TessellationEvaluation",
            Self::Other(3) => "Geometry",
            Self::Other(4) => "Fragment",
            Self::Other(6) => "Kernel",
            Self::Other(5267) => "TaskNV",
            Self::Other(5268) => "MeshNV",
            Self::Other(5364) => "TaskEXT",
            Self::Other(5365) => "MeshEXT",
            Self::Other(_) => "unknown execution model",
        }
    }
}

/// As the name of the execution model.
impl Serialize for Stage {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}
