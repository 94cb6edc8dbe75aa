//! What SPIRV-Tools says of a module, beside what this crate says.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use anyhit::Module;
use spirv_tools::TargetEnv;
use spirv_tools::val::compiled::CompiledValidator;
use spirv_tools::val::{Validator, ValidatorOptions};

use crate::bytes;

#[path = "../../tests/support/verdict.rs"]
mod ours;

pub use ours::{Ours, cites, ours};

/// What the validator says: its complaint where it rejects the module.
pub type Theirs = Result<(), String>;

/// Runs every entry point of a module on made-up inputs: the bugs of ours that this meets.
pub fn run(words: &[u32]) -> Result<(), String> {
    use anyhit_cases::smoke::{SmokeOptions, SmokeReport, SmokeVerdict};
    let Ok(module) = anyhit_engine::module::load(&bytes(words)) else { return Ok(()) };
    let module: Arc<Module> = Arc::new(module);
    let options = SmokeOptions::default().fuel(1 << 10).total_fuel(1 << 14);
    let report = catch_unwind(AssertUnwindSafe(|| SmokeReport::of(&module, options)));
    let report = report.map_err(|_| "SmokeReport::of panicked".to_owned())?;
    match report.worst() {
        SmokeVerdict::Bug => Err(report.text()),
        _ => Ok(()),
    }
}

/// Lets SPIRV-Tools validate a module for Vulkan, with the layouts that features of devices allow.
pub fn theirs(words: &[u32]) -> Theirs {
    let options =
        ValidatorOptions { scalar_block_layout: true, relax_block_layout: Some(true), ..Default::default() };
    let validator = CompiledValidator::with_env(TargetEnv::Vulkan_1_4);
    validator.validate(words, Some(options)).map_err(|error| match error.diagnostic {
        Some(diagnostic) => diagnostic.message,
        None => format!("{:?}", error.inner),
    })
}

/// A message without what differs from module to module: numbers, names of ids and types. The
/// rules' names stay.
pub fn normalised(message: &str) -> String {
    let mut out = String::new();
    let mut rest = message;
    while let Some(first) = rest.chars().next() {
        let behind = &rest[first.len_utf8()..];
        // An apostrophe stands in a word, a quotation mark before one.
        let quoted = matches!(first, '\'' | '`') && !out.ends_with(|last: char| last.is_alphanumeric());
        if let Some(end) = quoted.then(|| behind.find(first)).flatten() {
            out.extend([first, '_', first]);
            rest = &behind[end + 1..];
        } else if rest.starts_with("VUID-") {
            let is_part = |part: char| part.is_ascii_alphanumeric() || part == '-';
            let end = rest.find(|part| !is_part(part)).unwrap_or(rest.len());
            out += &rest[..end];
            rest = &rest[end..];
        } else if first.is_ascii_digit() {
            out.push('#');
            rest = rest.trim_start_matches(|part: char| part.is_ascii_digit());
        } else {
            out.push(first);
            rest = behind;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_told_from_other_texts() {
        assert!(cites("it is not; VUID-StandaloneSpirv-None-04637"));
        assert!(cites("no cycle (SPIR-V, 2.16.1)") && cites("SPIR-V 3.3.10") && cites("SPV_KHR_ray_tracing"));
        assert!(!cites("the operand must be a pointer") && !cites("SPIR-V is binary"));
    }

    #[test]
    fn messages_lose_their_numbers_and_names() {
        assert_eq!(normalised("ID '12[%a]' of 32 bits: `x`"), "ID '_' of # bits: `_`");
        assert_eq!(normalised("a buffer's 3 members, '7's type"), "a buffer's # members, '_'s type");
        assert_eq!(normalised("[VUID-A-A-01234] 5"), "[VUID-A-A-01234] #");
    }
}
