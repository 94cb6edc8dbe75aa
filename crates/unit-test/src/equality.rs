//! Equality of outcomes that hold more than what the run left.

use crate::bound::Bound;
use crate::data::TypedBytes;
use crate::mock::TraceCall;
use crate::shader_outcome::ShaderOutcome;
use crate::trace::Traced;

impl PartialEq for Bound {
    fn eq(&self, other: &Self) -> bool {
        self.resources.has_equal_contents(&other.resources)
    }
}

impl PartialEq for TypedBytes {
    fn eq(&self, other: &Self) -> bool {
        self.value() == other.value()
    }
}

impl PartialEq for TraceCall {
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
            && self.trace == other.trace
            && [self.sbt_offset, self.sbt_stride, self.miss_index]
                == [other.sbt_offset, other.sbt_stride, other.miss_index]
            && self.given == other.given
            && self.payload == other.payload
            && self.into_hit_object == other.into_hit_object
    }
}

/// Equal by what the invocation left: how it ended, payload and attributes, calls with their
/// answers, what it printed, buffers and images.
impl PartialEq for ShaderOutcome {
    fn eq(&self, other: &Self) -> bool {
        self.exit == other.exit
            && self.payload == other.payload
            && self.attributes == other.attributes
            && self.reports == other.reports
            && self.traces == other.traces
            && self.executes == other.executes
            && self.calls == other.calls
            && self.printed == other.printed
            && self.bound == other.bound
    }
}

/// Equal by the closest hit, the payload, counts, printed lines, buffers and images.
impl PartialEq for Traced {
    fn eq(&self, other: &Self) -> bool {
        let hit = |traced: &Self| (!traced.missed()).then(|| traced.hit());
        hit(self) == hit(other)
            && self.payload == other.payload
            && self.stats == other.stats
            && self.printed == other.printed
            && self.bound == other.bound
    }
}
