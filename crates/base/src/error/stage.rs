//! Execution models.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

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
    #[must_use]
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

/// By the name of the execution model.
impl<'de> Deserialize<'de> for Stage {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let mut named = (0..=6).chain(5267..=5365).map(Self::of);
        let stage = named.find(|stage| stage.name() == name && Self::Other(u32::MAX).name() != name);
        stage.ok_or_else(|| D::Error::custom(format!("`{name}` is not an execution model")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names are those of the specification's table of execution models.
    #[test]
    fn execution_models_are_read_by_name() {
        let read = |name: &str| serde_json::from_str::<Stage>(&format!("\"{name}\"")).ok();
        assert_eq!(read("AnyHitKHR"), Some(Stage::AnyHit));
        assert_eq!(read("GLCompute"), Some(Stage::Compute));
        assert_eq!(read("MeshEXT"), Some(Stage::Other(5365)));
        assert_eq!([read("unknown execution model"), read("anyhit")], [None, None]);
    }
}
