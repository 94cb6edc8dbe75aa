//! Rays that no shader is asked about on the way: all that a batch traces of them, together.

use crate::accel::{Committed, Packet, Tlas, TraceRay};

/// Memory for [`PlainRays::trace`].
#[derive(Clone, Debug, Default)]
pub(super) struct PlainRays {
    /// The rays to trace, of the same flags (with those that the pipeline adds): only opaque triangles,
    /// spheres and linear swept spheres can be in their way.
    pub rays: Vec<TraceRay>,
    /// What each of them hits.
    pub hits: Vec<Option<Committed>>,
    packet: Option<Box<Packet>>,
}

impl PlainRays {
    /// Traces the rays, all through one structure. `any_will_do`: nobody sees which hit a ray has, only
    /// whether it has one.
    pub fn trace(&mut self, tlas: &Tlas, any_will_do: bool) {
        let packet = self.packet.get_or_insert_default();
        let decided = packet.trace(tlas, &self.rays, any_will_do, &mut self.hits);
        assert!(decided, "bug in anyhit: a shader decides about a plain ray");
    }
}
