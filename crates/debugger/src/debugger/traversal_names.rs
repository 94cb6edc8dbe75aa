//! What a traversal does, by name.

use anyhit_engine::accel::observer::{InstanceVerdict, PrimitiveVerdict};
use anyhit_engine::pipeline::Event;

/// Whether a step through a traversal stops at an event.
pub fn is_step_of_traversal(event: &Event) -> bool {
    matches!(
        event,
        Event::Trace { .. }
            | Event::Node(_)
            | Event::Instance(..)
            | Event::Primitive(..)
            | Event::Candidate { .. }
            | Event::Opaque(_)
            | Event::Traversed { .. }
            | Event::RayQuery(_)
    )
}

/// A name for a verdict of the traversal, as breakpoints and listings write it.
pub fn verdict_name(verdict: PrimitiveVerdict) -> &'static str {
    match verdict {
        PrimitiveVerdict::Missed => "missed",
        PrimitiveVerdict::OutsideInterval(_) => "outside-interval",
        PrimitiveVerdict::Transparent(_) => "transparent",
        PrimitiveVerdict::CulledByOpacity(_) => "culled-by-opacity",
        PrimitiveVerdict::CulledByFace(_) => "culled-by-face",
        PrimitiveVerdict::Behind(_) => "behind",
        PrimitiveVerdict::Opaque(_) => "opaque",
        PrimitiveVerdict::Candidate(_) => "candidate",
    }
}

/// A name for what became of an instance.
pub fn instance_verdict_name(verdict: InstanceVerdict) -> &'static str {
    match verdict {
        InstanceVerdict::Entered => "entered",
        InstanceVerdict::Masked => "masked",
        InstanceVerdict::Skipped => "skipped",
        InstanceVerdict::Missed => "missed-box",
    }
}
