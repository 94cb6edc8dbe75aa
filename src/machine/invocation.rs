//! What builtins read: the state of one invocation beside its registers.

use std::sync::Arc;

use crate::accel::{Candidate, HitKind, Tlas, TraceRay};
use crate::machine::resource::Buffer;
use crate::machine::workgroup::Workgroup;

/// The state of one invocation that builtin variables show to its shader.
#[derive(Clone, Debug, Default)]
pub struct Invocation {
    /// `LaunchIdKHR`; in compute `GlobalInvocationId`
    pub launch_id: [u32; 3],
    /// `LaunchSizeKHR`; in compute the invocations of the whole dispatch
    pub launch_size: [u32; 3],
    /// The trace that called this shader, where one did.
    pub trace: Option<TraceRay>,
    /// `RayTmaxKHR` as this stage sees it.
    pub t_max: f32,
    /// What was hit, in any-hit, closest-hit and intersection shaders.
    pub hit: Option<Hit>,
    /// The shader record's data after the handle.
    pub record: Option<ShaderRecord>,
    /// The index of the shader record that this was called through, in its table.
    pub called_through: u64,
    /// How deep in the tree of traces this runs: 0 in ray generation.
    pub depth: u32,
    /// `SubgroupSize`; 0 stands for [`DEFAULT_SUBGROUP_SIZE`].
    pub subgroup_size: u32,
    /// The workgroup, in compute.
    pub workgroup: Option<Arc<Workgroup>>,
    /// `LocalInvocationIndex`, in compute.
    pub local_index: u32,
    /// The place in the order that subgroups are cut from, in compute.
    pub place: u32,
}

/// `SubgroupSize` unless set otherwise.
pub const DEFAULT_SUBGROUP_SIZE: u32 = 32;

impl Invocation {
    /// `SubgroupSize`
    pub fn subgroup_size(&self) -> u32 {
        if self.subgroup_size == 0 { DEFAULT_SUBGROUP_SIZE } else { self.subgroup_size }
    }

    /// `CurrentRayTimeNV`: 0 for a trace without motion, and where there is none.
    pub fn time(&self) -> f32 {
        self.trace.map_or(0.0, |trace| trace.time)
    }

    /// The place in the launch, x fastest.
    pub fn launch_index(&self) -> u64 {
        let [x, y, z] = self.launch_id.map(u64::from);
        let [width, height, _] = self.launch_size.map(u64::from);
        (z * height + y) * width + x
    }

    /// The place in the order that subgroups are cut from: that of the launch, or in compute that
    /// of the workgroup.
    pub fn place(&self) -> u64 {
        if self.workgroup.is_some() { self.place.into() } else { self.launch_index() }
    }

    /// `SubgroupLocalInvocationId`: subgroups are runs of consecutive places.
    pub fn subgroup_local_invocation_id(&self) -> u32 {
        (self.place() % u64::from(self.subgroup_size())) as u32
    }

    /// `SubgroupId`
    pub fn subgroup_id(&self) -> u64 {
        self.place() / u64::from(self.subgroup_size())
    }
}

/// A hit or candidate together with the structure that holds it.
#[derive(Clone, Debug)]
pub struct Hit {
    /// Where instance and primitive are looked up.
    pub tlas: Arc<Tlas>,
    /// The instance, geometry and primitive.
    pub candidate: Candidate,
    /// `HitKindKHR`
    pub kind: HitKind,
}

/// The data of a shader record: a stretch of a buffer.
#[derive(Clone, Debug)]
pub struct ShaderRecord {
    /// The table's data.
    pub data: Arc<Buffer>,
    /// Where the record's data begins, in bytes.
    pub offset: u64,
    /// How many bytes it has.
    pub size: u64,
}
