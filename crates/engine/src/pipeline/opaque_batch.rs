//! Rays that can hit only opaque geometry, so that no shader runs during traversal and a packet
//! traces them together.

use crate::accel::{Committed, Packet, Tlas, TraceRay};

/// The rays of a batch that can hit only opaque geometry, and the memory to trace them.
#[derive(Clone, Debug, Default)]
pub(super) struct OpaqueBatch {
    /// The rays to trace. They share their flags, those that the pipeline adds included; they can
    /// hit only opaque triangles, spheres and linear swept spheres.
    pub rays: Vec<TraceRay>,
    /// The closest hit of each ray.
    pub hits: Vec<Option<Committed>>,
    packet: Option<Box<Packet>>,
}

impl OpaqueBatch {
    /// Traces the rays in one acceleration structure. With `occlusion_only` each ray finds any hit,
    /// not the closest.
    pub(super) fn trace(&mut self, tlas: &Tlas, occlusion_only: bool) {
        let packet = self.packet.get_or_insert_default();
        let decided = packet.trace(tlas, &self.rays, occlusion_only, &mut self.hits);
        assert!(decided, "bug in anyhit: a shader decides about a ray of an opaque batch");
    }
}
