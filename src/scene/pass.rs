//! The passes of a scene: launches and dispatches, run in order on the same memory.

use std::sync::Arc;

use crate::machine::Buffer;
use crate::pipeline::{Compute, SbtRecord};
use crate::scene::resolved::Rebinding;

/// One pass of a frame.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// What it finds instead of what is bound.
    pub rebindings: Vec<Rebinding>,
    /// What it runs.
    pub work: PassWork,
}

/// What a pass runs.
#[derive(Clone, Debug)]
pub enum PassWork {
    /// A launch of a pipeline.
    Launch(LaunchPass),
    /// The dispatch with this index in
    /// [`Assembled::dispatches`](crate::scene::Assembled::dispatches).
    Dispatch(usize),
}

/// A launch of a pipeline.
#[derive(Clone, Debug)]
pub struct LaunchPass {
    /// The index of a named pipeline; `None` for `[pipeline]`.
    pub pipeline: Option<usize>,
    /// The record of the ray generation shader; `None` for that of the pipeline.
    pub record: Option<SbtRecord>,
    /// Width, height and depth.
    pub size: [u32; 3],
    /// Push constants of its own, in place of the scene's.
    pub push_constants: Option<Arc<Buffer>>,
}

/// A dispatch of a compute shader.
#[derive(Clone, Debug)]
pub struct Dispatch {
    /// The shader.
    pub compute: Compute,
    /// The number of workgroups along x, y and z.
    pub groups: [u32; 3],
    /// Push constants of its own, in place of the scene's.
    pub push_constants: Option<Arc<Buffer>>,
}

impl Pass {
    /// The launch, where it is one.
    pub fn launch(&self) -> Option<&LaunchPass> {
        match &self.work {
            PassWork::Launch(launch) => Some(launch),
            PassWork::Dispatch(_) => None,
        }
    }

    /// By what commands choose it: its name, or its number.
    pub fn key(&self, number: usize) -> String {
        self.name.clone().unwrap_or_else(|| number.to_string())
    }

    /// How messages call it: its name, or its number.
    pub fn label(&self, number: usize) -> String {
        self.name.as_ref().map_or_else(|| number.to_string(), |name| format!("`{name}`"))
    }
}
