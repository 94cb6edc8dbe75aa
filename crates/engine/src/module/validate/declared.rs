//! What a module declares: capabilities with those that they imply, extensions, the version.

use rspirv::spirv::Capability;
use rustc_hash::FxHashSet;

use crate::module::validate::entry::Kind;
use crate::module::validate::requirement::Requirement;
use crate::module::words::Walker;
use crate::module::{Module, Opcode};

/// Capabilities that allow 16-bit values in memory, and with them every rounding mode of a
/// conversion (`FPRoundingMode`).
pub(super) const STORAGE_16_BIT: &[u32] = &[
    Capability::StorageBuffer16BitAccess as u32,
    Capability::UniformAndStorageBuffer16BitAccess as u32,
    Capability::StoragePushConstant16 as u32,
    Capability::StorageInputOutput16 as u32,
    Capability::WorkgroupMemoryExplicitLayout16BitAccessKHR as u32,
];

/// The declarations of a module.
pub(super) struct Declared<'m> {
    /// Numbers of the declared capabilities and of those that they imply, transitively.
    capabilities: FxHashSet<u32>,
    extensions: FxHashSet<&'m str>,
    /// Minor version of SPIR-V 1.
    pub(super) version: u8,
}

impl<'m> Declared<'m> {
    /// Declarations stand in their sections, before all else (SPIR-V 2.4, Logical Layout of a
    /// Module): one that stands elsewhere declares nothing.
    pub(super) fn of(module: &'m Module) -> Self {
        let mut walker = Walker::new(&module.words, module.limits);
        let mut open = Vec::new();
        let mut extensions = 0;
        while let Ok(Some(span)) = walker.next() {
            match span.opcode {
                Opcode::Capability => open.push(module.words[span.start + 1]),
                Opcode::Extension => extensions += 1,
                _ => break,
            }
        }
        let mut capabilities = FxHashSet::default();
        while let Some(capability) = open.pop() {
            if capabilities.insert(capability)
                && let Some(requirement) = Requirement::of_enumerant(Kind::Capability, capability)
            {
                // The capabilities in a capability's row of the grammar are those that it implies.
                open.extend(requirement.capabilities);
            }
        }
        let extensions = module.extensions.iter().take(extensions).map(String::as_str).collect();
        Self { capabilities, extensions, version: module.version.1 }
    }

    pub(super) fn has(&self, capability: u32) -> bool {
        self.capabilities.contains(&capability)
    }

    /// Returns true if the module declares one of several capabilities.
    pub(super) fn has_any(&self, capabilities: &[u32]) -> bool {
        capabilities.iter().any(|&one| self.has(one))
    }

    /// Returns true if the module declares one of several extensions.
    pub(super) fn has_any_extension(&self, extensions: &[&str]) -> bool {
        extensions.iter().any(|one| self.extensions.contains(one))
    }
}
