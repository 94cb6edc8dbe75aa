//! Rules about what must be the same in all lanes of a subgroup: the resource of an access whose
//! operand is not decorated `NonUniform`, and indices into push constants.

use crate::checks::subgroup::differing_lanes;
use crate::plan::{ResourceOperand, UniformReason, Uniformity};
use crate::rule::uniformity;
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::device_memory::STRUCTURE_HANDLE;
use anyhit_engine::machine::stop::RegSpan;
use anyhit_engine::machine::{Batch, Bindings, Mask, OpIndex, Reg};
use anyhit_engine::module::names::capability_name;
use anyhit_engine::module::{Id, Module};
use anyhit_engine::program::Program;

/// Checks that what must be uniform is.
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    uniformity: &Uniformity,
) {
    match uniformity {
        Uniformity::PushConstants(index) => {
            let differing = differing_lanes(batch, RegSpan { first: *index, count: 1 }, 0);
            sanitizer.tell(batch, &uniformity::PUSH_ARRAY_UNIFORM, op, differing, |_| {
                "lanes of a subgroup read different elements of an array in the push constants".to_owned()
            });
        }
        Uniformity::HitObjects(index) => {
            let differing = differing_lanes(batch, RegSpan { first: *index, count: 1 }, 0);
            sanitizer.tell(batch, &uniformity::HO_ARRAY_INDEX, op, differing, |_| {
                "lanes of a subgroup use different hit objects of an array, by an index that is not NonUniform"
                    .to_owned()
            });
        }
        Uniformity::Resources { does, operands } => {
            operands.iter().for_each(|operand| check_resource(sanitizer, batch, op, does, operand));
        }
    }
}

fn check_resource<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    does: &str,
    operand: &ResourceOperand,
) {
    let &ResourceOperand { id, reason, from_record, register, words } = operand;
    let mut differing = differing_lanes(batch, RegSpan { first: register, count: words }, 0);
    let by_records = from_record && differing.is_empty();
    if by_records {
        differing = differing_by_records(batch, register);
    }
    if words == 2 && !differing.is_empty() {
        // A structure by its device address needs no descriptor.
        differing = differing & Mask::equal(&batch.registers[register.plus(1)], STRUCTURE_HANDLE);
    }
    let handle = |lane: usize| batch.registers[register].0[lane];
    let Some(one) = differing.lowest().map(handle) else { return };
    let Some(other) = differing.lanes().map(handle).find(|other| *other != one) else { return };
    let rule = match reason {
        _ if by_records => &uniformity::RECORD_NONUNIFORM,
        UniformReason::Undecorated => &uniformity::NONUNIFORM_RESOURCE,
        UniformReason::Misplaced(_) => &uniformity::NONUNIFORM_PLACEMENT,
        UniformReason::Capability(_) => &uniformity::NONUNIFORM_CAPABILITY,
    };
    sanitizer.tell_of_program(batch, rule, op, differing, |program| {
        let [one, other] = [one, other].map(|handle| describe(program, handle));
        let id = id_name(&program.module, id);
        let chosen = if by_records { ", chosen by their shader records" } else { "" };
        let but = match reason {
            UniformReason::Undecorated => format!("{id}, the operand of the access, is not NonUniform"),
            UniformReason::Misplaced(decorated) => {
                let decorated = id_name(&program.module, decorated);
                format!("{id}, the operand of the access, is not NonUniform, though {decorated} is")
            }
            UniformReason::Capability(capability) => {
                format!("the module does not declare {}", capability_name(capability))
            }
        };
        format!("lanes of a subgroup {does} {one} and {other}{chosen}, and {but}")
    });
}

/// The lanes that use different resources than others of their subgroup with another shader record.
/// Elsewhere in this crate a subgroup has one record.
fn differing_by_records<const W: usize>(batch: &Batch<W>, register: Reg) -> Mask<W> {
    let subgroup = |lane: usize| batch.invocations.lane(lane).subgroup_id();
    let handle = |lane: usize| batch.registers[register].0[lane];
    let differs = |lane: usize| {
        let mut others = batch.mask.lanes();
        others.any(|other| subgroup(other) == subgroup(lane) && handle(other) != handle(lane))
    };
    if Mask::equal(&batch.registers[register], batch.mask.lowest().map_or(0, handle)).covers(batch.mask) {
        return Mask::NONE;
    }
    Mask::from_fn(|lane| batch.mask.contains(lane) && differs(lane))
}

/// A descriptor as a report names it.
fn describe(program: &Program, handle: u32) -> String {
    let slot = Bindings::slot_of(handle);
    match slot.and_then(|(slot, element)| Some((program.slots.get(slot)?, element))) {
        Some((slot, element)) => format!("`{}[{element}]`", slot.name),
        None => "no descriptor".to_owned(),
    }
}

/// An id by number, and by name where it has one.
fn id_name(module: &Module, id: Id) -> String {
    match module.name(id).filter(|name| !name.is_empty()) {
        Some(name) => format!("%{} (`{name}`)", id.0),
        None => format!("%{}", id.0),
    }
}
