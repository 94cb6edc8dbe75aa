//! What ended a run under the sanitizer, as a finding: a trap has a rule, too, and so have a limit
//! that was reached and a gap of this crate.

use crate::finding::{Finding, FindingKey, Findings};
use crate::rule::{Level, Rule, image, stop};
use anyhit_base::error::{Error, ErrorKind, Trap, TrapCode, TrapOperands};
use anyhit_engine::accel::RayRule;
use anyhit_engine::machine::ShaderIndex;

impl Findings {
    /// Adds the error that ended the run, unless it is one of the inputs or of the system.
    pub fn add_stop(&mut self, error: &Error) {
        self.add_stop_at_level(error, Level::Deny);
    }

    /// [`Findings::add_stop`], at another level than what is denied.
    pub fn add_stop_at_level(&mut self, error: &Error, level: Level) {
        let Some(finding) = Finding::of_stop(error) else { return };
        let finding = Finding { level, ..finding };
        let trap = error.trap();
        let rule = finding.rule;
        let place = trap.and_then(Trap::frame).map(|frame| (frame.shader, frame.word.unwrap_or(0)));
        let place = place.map_or((ShaderIndex(0), 0), |(shader, word)| (ShaderIndex(shader), word));
        self.add(FindingKey { rule: rule.id, places: [place, (ShaderIndex(0), 0)] }, 1, Some(finding));
    }
}

impl Finding {
    /// The error that ended a run, unless it is one of the inputs or of the system.
    pub fn of_stop(error: &Error) -> Option<Self> {
        let trap = error.trap();
        let rule = match (trap, error.kind()) {
            (Some(trap), _) => rule_of(trap),
            (None, ErrorKind::UnsupportedModule | ErrorKind::UnsupportedFile) => &stop::UNSUPPORTED,
            _ => return None,
        };
        Some(Self {
            rule,
            level: Level::Deny,
            count: 0,
            launch_id: trap.map_or([0; 3], |trap| trap.launch_id),
            stack: trap.map_or_else(Vec::new, |trap| trap.stack.clone()),
            error: error.clone(),
        })
    }
}

/// The rule that a trap breaks, or the limit that it has reached.
fn rule_of(trap: &Trap) -> &'static Rule {
    use TrapCode as C;
    match trap.code {
        C::IndexOutOfBounds | C::BufferOutOfBounds if is_in_record(&trap.operands) => &stop::RECORD_RANGE,
        C::IndexOutOfBounds => match trap.operands {
            TrapOperands::Buffer { index: Some(_), .. } => &stop::BUFFER_BOUNDS,
            _ => &stop::LOCAL_ARRAY_BOUNDS,
        },
        C::BufferOutOfBounds => &stop::BUFFER_BOUNDS,
        C::NullPointer => &stop::NULL_POINTER,
        C::AddressInvalid | C::AddressOutOfBounds => &stop::ADDRESS_RANGE,
        C::AddressMisaligned => &stop::ADDRESS_ALIGNED,
        C::AtomicMisaligned => &stop::ATOMIC_ALIGNED,
        C::DescriptorMissing | C::DescriptorMisaligned => &stop::DESCRIPTOR_MISSING,
        C::ImageOutOfBounds | C::ImageRowAbsent => &stop::IMAGE_PART,
        C::ImageMismatch => &stop::IMAGE_VIEW_MATCH,
        C::SamplerMismatch => &image::SAMPLER_MATCH,
        C::Unreachable => &stop::UNREACHABLE,
        C::Aborted => &stop::ABORT,
        C::OutOfFuel | C::LaunchOutOfFuel | C::LaunchTimedOut | C::BatchTimedOut => &stop::LOOP_ENDLESS,
        C::InvalidTrace | C::InvalidRayQuery => match RayRule::ALL.get(trap.fault_value as usize) {
            Some(&broken) => ray_rule(broken),
            None => &stop::RAY_NAN,
        },
        C::InvalidHitObject => &stop::HO_RECORD_RAY,
        C::AccelerationStructureMissing => &stop::RAY_NOT_TLAS,
        C::RecursionTooDeep => &stop::TRACE_RECURSION,
        C::StackOverflow | C::CallablesTooDeep => &stop::STACK_LIMIT,
        C::ShaderRecordMissing | C::MissRecordMissing => &stop::SBT_MISS_CALLABLE,
        C::ShaderRecordEmpty => &stop::RECORD_RANGE,
        C::HitRecordMissing => &stop::SBT_HIT_RECORD,
        C::PayloadMismatch => &stop::PAYLOAD_IDENTICAL,
        C::InvalidHitKind => &stop::REPORT_HIT_KIND,
        C::RayQueryUninitialized => &stop::RQ_UNINITIALIZED,
        C::RayQueryComplete => &stop::RQ_PROCEED_COMPLETE,
        C::RayQueryNoCandidate => &stop::RQ_CANDIDATE_NONE,
        C::RayQueryNoCommitted => &stop::RQ_COMMITTED_NONE,
        C::RayQueryNotTriangle => &stop::RQ_COMMITTED_KIND,
        C::RayQueryNotAabb => &stop::RQ_GENERATE_KIND,
        C::RayQueryOutsideInterval => &stop::RQ_GENERATE_INTERVAL,
        C::RayQueryMotion => &stop::RQ_GENERATE_MOTION,
        C::RayQueryMicromaps => &stop::RQ_MICROMAP,
        C::NotTriangle | C::NotSphere | C::NotLinearSweptSphere => &stop::PRIMITIVE_GETTER,
        C::BarrierDivergence => &stop::BARRIER_DIVERGENT,
        C::HitObjectNoPrimitive => &stop::HO_RECORD_PRIMITIVE,
        C::HitObjectUnrecorded => &stop::HO_UNRECORDED,
        C::HitObjectEmpty => &stop::HO_EMPTY,
        C::HitObjectNotHit => &stop::HO_NOT_HIT,
        C::NullAnyHit | C::NullClosestHit | C::NullMiss | C::NullIntersection => &stop::SBT_NO_NULL,
        C::Callee | C::ImageUnreadable => unreachable!("bug in anyhit: no report has this code"),
    }
}

/// Whether an access that trapped is one to the shader record.
fn is_in_record(operands: &TrapOperands) -> bool {
    matches!(operands, TrapOperands::Buffer { storage_class: Some("ShaderRecordBufferKHR"), .. })
}

fn ray_rule(broken: RayRule) -> &'static Rule {
    match broken {
        RayRule::NotNan => &stop::RAY_NAN,
        RayRule::Finite => &stop::RAY_INFINITE,
        RayRule::NotNegative => &stop::RAY_NEGATIVE_T,
        RayRule::InOrder => &stop::RAY_INTERVAL_INVERTED,
        RayRule::OpacityFlags => &stop::RAY_OPACITY_FLAGS,
        RayRule::TriangleFlags => &stop::RAY_FACE_FLAGS,
        RayRule::SkipFlags => &stop::RAY_BOTH_SKIPS,
        RayRule::SkipTrianglesWithPipelineSkipAabbs | RayRule::SkipAabbsWithPipelineSkipTriangles => {
            &stop::RAY_SKIP_VS_PIPELINE
        }
        RayRule::Time => &stop::RAY_MOTION_TIME,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rule::{RuleKind, all};

    #[test]
    fn every_trap_has_a_rule_and_limits_are_no_bugs() {
        for &code in TrapCode::ALL {
            let rule = rule_of(&Trap::new(code));
            let passes_limit = rule.kind == RuleKind::Limit;
            let is_limit =
                code.is_limit() || matches!(code, TrapCode::StackOverflow | TrapCode::CallablesTooDeep);
            assert_eq!(passes_limit, is_limit, "{code:?}");
            // Its level cannot be set, as the run does not go on behind it; but samplers are looked
            // at without a trap, too.
            let has_level = all().any(|other| std::ptr::eq(other, rule));
            assert_eq!(has_level, code == TrapCode::SamplerMismatch, "{code:?}");
        }
    }

    #[test]
    fn what_is_beyond_a_record_breaks_the_rule_of_records() {
        let rule = |code, storage_class| {
            let mut trap = Trap::new(code);
            trap.operands = TrapOperands::Buffer {
                descriptor: None,
                storage_class,
                offset: 16,
                bytes: 4,
                size: Some(16),
                index: Some(4),
                length: Some(4),
                of: None,
            };
            rule_of(&trap).id
        };
        let record = Some("ShaderRecordBufferKHR");
        assert_eq!(rule(TrapCode::BufferOutOfBounds, record), "record-range");
        assert_eq!(rule(TrapCode::IndexOutOfBounds, record), "record-range");
        assert_eq!(rule(TrapCode::BufferOutOfBounds, Some("PushConstant")), "buffer-bounds");
        assert_eq!(rule(TrapCode::BufferOutOfBounds, None), "buffer-bounds");
    }

    #[test]
    fn a_trap_is_a_finding_once() {
        let mut findings = Findings::default();
        let mut trap = Trap::new(TrapCode::InvalidTrace);
        trap.fault_value = RayRule::InOrder as u64;
        let error = Error::trapped(trap);
        findings.add_stop(&error);
        findings.add_stop(&error);
        let found: Vec<_> =
            findings.iter().map(|one| (one.rule.id, one.count, one.rule.kind.class())).collect();
        assert_eq!(found, [("ray-interval-inverted", 2, "bug")]);
        // A file that cannot be read is none.
        findings.add_stop(&Error::new(ErrorKind::Io, "no such file"));
        assert_eq!(findings.len(), 1);
    }
}
