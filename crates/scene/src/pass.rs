//! The passes of a scene: launches and dispatches, run in order on the same memory.

use std::sync::Arc;

use crate::indirect::indirect_size;
use crate::resolved::{IndirectSize, Rebinding};
use anyhit_engine::machine::{Binding, Buffer, Resources};
use anyhit_engine::math::array;
use anyhit_engine::pipeline::{Compute, SbtRecord};

/// One pass of a frame.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// What it finds at sets and bindings that several resources share.
    pub own_bindings: Vec<OwnBinding>,
    /// What it finds instead of what is bound.
    pub rebindings: Vec<Rebinding>,
    /// Where its size is read, if a buffer holds it.
    pub indirect: Option<IndirectSize>,
    /// What it runs.
    pub work: PassWork,
}

/// What a pass runs.
#[derive(Clone, Debug)]
pub enum PassWork {
    /// A launch of a pipeline.
    Launch(LaunchPass),
    /// The dispatch with this index in
    /// [`Assembled::dispatches`](crate::Assembled::dispatches).
    Dispatch(usize),
}

/// A launch of a pipeline.
#[derive(Clone, Debug)]
pub struct LaunchPass {
    /// The index of a named pipeline; `None` for `[pipeline]`.
    pub pipeline: Option<usize>,
    /// The record of the ray generation shader; `None` for that of the pipeline.
    pub record: Option<SbtRecord>,
    /// Width, height and depth, unless a buffer holds them.
    pub given_size: [u32; 3],
    /// Push constants of its own, in place of the scene's.
    pub push_constants: Option<Arc<Buffer>>,
}

/// A dispatch of a compute shader.
#[derive(Clone, Debug)]
pub struct Dispatch {
    /// The shader.
    pub compute: Compute,
    /// The number of workgroups along x, y and z, unless a buffer holds them.
    pub given_groups: [u32; 3],
    /// Push constants of its own, in place of the scene's.
    pub push_constants: Option<Arc<Buffer>>,
}

/// The set of which no shader declares a binding. The resources that share their set and binding
/// with others are kept there, each at a binding number of its own, until a pass needs them.
pub const OWN_SET: u32 = u32::MAX;

/// A set and binding at which one pass finds other descriptors than most passes do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OwnBinding {
    /// Where its shaders declare them.
    pub at: Binding,
    /// Where they are kept.
    pub kept: Binding,
}

impl LaunchPass {
    /// Width, height and depth, in the resources as the pass finds them.
    pub fn size(&self, resources: &Resources) -> [u32; 3] {
        indirect_size(resources).unwrap_or(self.given_size)
    }
}

impl Dispatch {
    /// The number of workgroups along x, y and z, in the resources as the pass finds them.
    pub fn groups(&self, resources: &Resources) -> [u32; 3] {
        indirect_size(resources).unwrap_or(self.given_groups)
    }

    /// Number of invocations of so many workgroups along x, y and z; at most 2^32 - 1 each.
    pub fn invocations(&self, groups: [u32; 3]) -> [u32; 3] {
        let size = self.compute.workgroup_size();
        array::from_fn(|axis| groups[axis].saturating_mul(size[axis]))
    }
}

impl Pass {
    /// Where the descriptors are kept that it finds at a set and binding.
    pub fn kept(&self, at: Binding) -> Binding {
        self.own_bindings.iter().find(|own| own.at == at).map_or(at, |own| own.kept)
    }

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
