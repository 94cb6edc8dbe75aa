//! Rules that are known from a module alone: a table of checks, each of which looks at the
//! instructions and declarations of an entry point.
//!
//! Compilers keep to most of them. What breaks them was written by hand, by a compiler of its own,
//! or in the parts of a language that map to SPIR-V one to one (memory scopes and semantics,
//! buffer references, inline assembly).

pub(super) mod code;
mod declarations;
mod images;
mod memory;
mod ordering;
mod progress;
mod volatile;

#[cfg(test)]
mod tests;

use crate::finding::{Finding, FindingKey, Findings};
use crate::levels::Levels;
use crate::module_checks::code::EntryCode;
use crate::report::at_word;
use crate::rule::{Level, Rule, contract, image, module};
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::program::Program;

/// A place that breaks a rule.
#[derive(Debug)]
struct Fault {
    /// Where its instruction begins, in words from the start of the module.
    offset: u32,
    message: String,
}

/// A rule, and what finds the places of an entry point that break it.
type Check = (&'static Rule, fn(&EntryCode<'_>, &mut Vec<Fault>));

static CHECKS: &[Check] = &[
    (&module::UNIFORM_STORE, memory::uniform_store),
    (&module::NON_WRITABLE, memory::non_writable),
    (&module::NON_READABLE, memory::non_readable),
    (&module::ATTR_READONLY, memory::attr_readonly),
    (&module::RECORD_BLOCK, memory::record_block),
    (&module::ALIGNED_OPERAND, memory::aligned_operand),
    (&module::ATOMIC_CLASS, memory::atomic_class),
    (&module::POINTER_CONVERT, memory::pointer_convert),
    (&module::LAUNCH_ORDER, progress::launch_order),
    (&contract::VOLATILE_SUBGROUP, volatile::volatile_subgroup),
    (&contract::VOLATILE_RAYTMAX, volatile::volatile_raytmax),
    (&module::VOLATILE_LOAD, volatile::volatile_load),
    (&module::BARRIER_SEMANTICS, ordering::barrier_semantics),
    (&module::MEMORY_SCOPE, ordering::memory_scope),
    (&module::INVOCATION_SCOPE, ordering::invocation_scope),
    (&module::BARRIER_CLASS, ordering::barrier_class),
    (&module::INTERFACE_INITIALIZER, declarations::interface_initializer),
    (&module::PAYLOAD_LOCATION, declarations::payload_location),
    (&module::PAYLOAD_ALIASING, declarations::payload_aliasing),
    (&module::WORKGROUP_IN_RT, declarations::workgroup_in_rt),
    (&module::NO_REPACK_MODE, declarations::no_repack_mode),
    (&module::AS_LOAD_SOURCE, memory::as_load_source),
    (&module::REORDER_HINT_BITS, declarations::reorder_hint_bits),
    (&module::FASTMATH_MODES, declarations::fastmath_modes),
    (&module::BITOP_WIDTH, declarations::bitop_width),
    (&module::GATHER_COMPONENT, declarations::gather_component),
    (&image::IMAGE_SAMPLE_OPERAND, images::sample_operand),
    (&image::IMAGE_OFFSET, images::dynamic_offset),
];

/// Checks the entry point of a program.
pub fn check_module(program: &Program, shader: ShaderIndex, levels: &Levels) -> Findings {
    let mut findings = Findings::default();
    let mut entries = program.module.entry_points.iter();
    let entry = entries.find(|entry| entry.stage == program.stage && entry.name == program.name);
    let Some(entry) = entry else { return findings };
    let code = EntryCode::new(&program.module, entry);
    for (rule, check) in CHECKS {
        let level = levels.of(rule);
        if level == Level::Allow {
            continue;
        }
        let mut faults = Vec::new();
        check(&code, &mut faults);
        for fault in faults {
            let key = FindingKey { rule: rule.id, places: [(shader, fault.offset), (shader, 0)] };
            let error = located(program, fault);
            let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
            findings.add(key, 1, Some(finding));
        }
    }
    findings
}

/// The error of a fault, with its source line where the module tells it: of an instruction its own,
/// of a declaration the file.
fn located(program: &Program, fault: Fault) -> Error {
    let Fault { offset, message } = fault;
    let error = Error::new(ErrorKind::Finding, message);
    let first = program.module.functions.first().map_or(u32::MAX, |function| function.offset);
    let error = if offset < first {
        let files = program.module.debug_info.files.first();
        let file = files.filter(|file| !file.name.is_empty());
        let file = file.map(|file| Place::File(file.name.clone().into()));
        file.into_iter().fold(error, Error::at).at(Place::Word(offset as usize))
    } else {
        at_word(program, offset, error)
    };
    error.note(format!("in {} `{}`", program.stage.name(), program.name))
}
