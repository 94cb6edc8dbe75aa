//! Rays that no shader is asked about on the way: all that a batch traces of them, together.

use crate::accel::{Committed, Cursor, Tlas, TraceRay};

/// A ray that no shader is asked about: only opaque triangles, spheres and linear swept spheres can be
/// in its way.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlainRay {
    /// With the flags that the pipeline adds.
    pub trace: TraceRay,
    /// Whether nobody sees which hit it has, only whether it has one.
    pub any_will_do: bool,
}

/// Memory for [`PlainRays::trace`].
#[derive(Clone, Debug, Default)]
pub(super) struct PlainRays {
    /// The rays to trace.
    pub rays: Vec<PlainRay>,
    /// What each of them hits.
    pub hits: Vec<Option<Committed>>,
    cursor: Option<Cursor>,
}

impl PlainRays {
    /// Traces the rays, all through one structure.
    pub fn trace(&mut self, tlas: &Tlas) {
        let Self { rays, hits, cursor } = self;
        hits.clear();
        // One memory for all: it stays in the processor's nearest cache.
        let Some(first) = rays.first() else { return };
        let cursor = cursor.get_or_insert_with(|| Cursor::new(tlas, first.trace));
        for ray in rays {
            cursor.reset(tlas, ray.trace);
            if ray.any_will_do {
                cursor.end_at_any_opaque_hit();
            }
            cursor.proceed(tlas);
            hits.push(cursor.committed().copied());
        }
    }
}
