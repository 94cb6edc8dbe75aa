//! Any bytes: load them and ask what there is to ask. `cargo +nightly fuzz run load
//! fuzz/corpus/load spirv-fixtures` begins with the compiled modules of the repository.

#![no_main]

use anyhit::module::load;
use anyhit::module::ty::TypeId;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(module) = load(bytes) else { return };
    for index in 0..module.types.len().min(64) {
        let ty = TypeId(index as u32);
        let _ = (module.describe_type(ty), module.size_of(ty), module.scalar_count(ty));
    }
    for entry in module.entry_points.iter().take(4) {
        let _ = module.interface_of(entry);
    }
    for block in module.functions.iter().flat_map(|function| &function.blocks) {
        for instruction in &block.instructions {
            let _ = module.debug_info.line_at(instruction.offset);
            let _ = (module.operand_ids(instruction), module.branch_targets(instruction));
        }
    }
});
