//! Programs with other values of specialization constants than their defaults.

use std::sync::Arc;

use anyhit_base::sorted::{SortedSet, sort_by_key};
use anyhit_engine::module::Module;
use anyhit_engine::module::constant::ConstantValue;
use anyhit_engine::module::interface::EntryPoint;
use anyhit_engine::module::ty::Type;
use anyhit_engine::program::{self, Program};

/// How many there are at most.
const MOST: usize = 16;

/// The entry point with one specialization constant at a time at another value, and which in words:
/// a Boolean the other way, a number 0 or 1. Values that the module cannot have (an array without
/// elements), and those that change the size of workgroups, are left out.
pub(super) fn programs(
    module: &Arc<Module>,
    entry: &EntryPoint,
    default: &Arc<Program>,
) -> Vec<(String, Arc<Program>)> {
    let mut found = Vec::new();
    let mut seen = SortedSet::new();
    let mut constants: Vec<_> = module.constants.iter().filter(|constant| constant.specializable).collect();
    sort_by_key(&mut constants, |constant| constant.spec_id);
    for constant in constants {
        let (Some(id), ConstantValue::Scalar(default_bits)) = (constant.spec_id, &constant.value) else {
            continue;
        };
        if !seen.insert(id) {
            continue;
        }
        let others: Vec<(u64, &str)> = match *module.ty(constant.ty) {
            Type::Int { .. } => vec![(0, "0"), (1, "1")],
            Type::Float { width, .. } => vec![(0, "0"), (one(width), "1")],
            _ => vec![(0, "false"), (1, "true")],
        };
        for (bits, words) in others.into_iter().filter(|(bits, _)| bits != default_bits) {
            if found.len() >= MOST {
                return found;
            }
            let mut other = (**module).clone();
            if other.specialize_bits(id, bits).is_err() {
                continue;
            }
            let Ok(program) = program::lower(&Arc::new(other), entry) else { continue };
            let size = |program: &Program| program.workgroup.map(|layout| layout.size);
            if size(&program) != size(default) {
                continue;
            }
            let name = module.name(constant.id).map(|name| format!(" `{name}`")).unwrap_or_default();
            found.push((format!("specialization constant {id}{name} = {words}"), Arc::new(program)));
        }
    }
    found
}

/// 1 as a float of a width.
fn one(width: u32) -> u64 {
    match width {
        16 => 0x3C00,
        64 => 0x3FF0_0000_0000_0000,
        _ => 0x3F80_0000,
    }
}
