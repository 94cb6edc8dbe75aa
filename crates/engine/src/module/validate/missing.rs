//! How a missing declaration is worded, and the id that it is about.

use crate::module::grammar::InstructionGrammar;
use crate::module::span::Span;
use crate::module::validate::requirement::capability_name;
use crate::module::{Id, Module, Opcode};

/// The id that an instruction is about: its result, else the id that it decorates or executes.
pub(super) fn subject(module: &Module, span: Span) -> Option<Id> {
    let known = InstructionGrammar::of(span.opcode)?;
    let at = match span.opcode {
        _ if known.has_result => span.start + 1 + usize::from(known.has_type),
        Opcode::Decorate
        | Opcode::DecorateId
        | Opcode::DecorateString
        | Opcode::MemberDecorate
        | Opcode::ExecutionMode
        | Opcode::ExecutionModeId => span.start + 1,
        Opcode::EntryPoint => span.start + 2,
        _ => return None,
    };
    (at < span.end).then(|| Id(module.words[at]))
}

/// Says that none of several capabilities is declared, and how to declare the most common.
pub(super) fn missing_capabilities(all: &[u32]) -> (String, String) {
    let names: Vec<String> = all.iter().map(|&one| capability_name(one).into_owned()).collect();
    let fix = format!("declare `OpCapability {}`", preferred(&names).unwrap_or_default());
    let what = match &names[..] {
        [one] => format!("the capability {one}, which the module does not declare"),
        _ => format!("one of the capabilities {}, none of which the module declares", either(&names)),
    };
    (what, fix)
}

/// `A, B or C`.
pub(super) fn either<T: AsRef<str>>(names: &[T]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match &names[..] {
        [before @ .., last] if !before.is_empty() => format!("{} or {last}", before.join(", ")),
        names => names.concat(),
    }
}

/// The name that a fix proposes, of several: one of SPIR-V or of KHR before one of EXT, and that
/// before those of a single vendor and of OpenCL.
pub(super) fn preferred<T: AsRef<str>>(names: &[T]) -> Option<&str> {
    const VENDORS: [&str; 7] = ["NV", "AMD", "AMDX", "INTEL", "ARM", "QCOM", "ALTERA"];
    let rank = |name: &&str| match *name {
        "Kernel" | "Addresses" => 3,
        name if name.starts_with("SPV_KHR_") => 0,
        name if name.starts_with("SPV_EXT_") || name.ends_with("EXT") => 1,
        name if VENDORS.iter().any(|vendor| {
            name.ends_with(vendor) || name.strip_prefix("SPV_").is_some_and(|rest| rest.starts_with(vendor))
        }) =>
        {
            2
        }
        _ => 0,
    };
    names.iter().map(AsRef::as_ref).min_by_key(rank)
}
