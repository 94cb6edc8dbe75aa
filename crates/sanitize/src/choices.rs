//! Which rule is about which choice that `--many-seeds` draws.

use crate::levels::Levels;
use crate::rule::{Level, Rule, choice, memory};
use anyhit_engine::machine::ChoiceKind;

/// The rule about a choice.
pub fn rule_of(kind: ChoiceKind) -> &'static Rule {
    match kind {
        ChoiceKind::AnyHitOrder => &choice::ANYHIT_ORDER,
        ChoiceKind::AnyHitDuplicate => &choice::ANYHIT_DUPLICATE,
        ChoiceKind::IntersectionRepeat => &choice::INTERSECTION_REPEAT,
        ChoiceKind::TieOrder => &choice::TIE_ORDER,
        ChoiceKind::InvocationOrder => &choice::INVOCATION_ORDER,
        ChoiceKind::SubgroupComposition | ChoiceKind::SubgroupSize => &choice::LANE_DEPENDENT_RESULT,
        ChoiceKind::RobustRead => &choice::ROBUST_READ,
        ChoiceKind::UndefinedValue => &choice::UNDEFINED_DRAWN,
        ChoiceKind::UndefinedResult => &choice::UNDEFINED_RESULT,
        ChoiceKind::WorkgroupMemory => &choice::WORKGROUP_DRAWN,
        ChoiceKind::RobustTexel => &choice::ROBUST_TEXEL,
        ChoiceKind::Contraction => &choice::CONTRACTION,
        ChoiceKind::DotOrder => &choice::DOT_ORDER,
        ChoiceKind::Reassociation => &choice::REASSOCIATION,
        ChoiceKind::Division => &choice::DIVISION_ROUNDING,
        ChoiceKind::FunctionPrecision => &choice::FUNCTION_PRECISION,
        ChoiceKind::ZeroSign => &choice::ZERO_SIGN,
        ChoiceKind::DenormalFlush => &choice::DENORMAL_FLUSH,
    }
}

/// Whether a choice is drawn where rules have these levels: it is not where its own rule is
/// allowed, or that by which the sanitizer tells of the same undefined value.
pub fn is_drawn(kind: ChoiceKind, levels: &Levels) -> bool {
    let told_otherwise = match kind {
        ChoiceKind::WorkgroupMemory => Some(&memory::UNINIT_WORKGROUP),
        _ => None,
    };
    [rule_of(kind)].into_iter().chain(told_otherwise).all(|rule| levels.of(rule) != Level::Allow)
}

/// The rules about choices.
pub fn rules() -> impl Iterator<Item = &'static Rule> {
    choice::RULES.iter().copied()
}
