//! The device addresses of a scene's buffers and acceleration structures.

use std::sync::Arc;

use crate::address_entry::AddressOf;
use anyhit_base::error::Result;
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::{Buffer, DeviceMemory};

/// The addresses of a scene.
#[derive(Clone, Debug, Default)]
pub struct Addresses {
    /// By name: where it begins and how large it is.
    pub(super) by_name: SortedMap<String, (u64, u64)>,
    /// What lies there; buffers are made when all addresses are known.
    pub(super) memory: DeviceMemory,
}

impl Addresses {
    /// The address that a piece asks for.
    ///
    /// # Errors
    /// If its target has none, or the offset lies past its end.
    pub(super) fn address(&self, of: &AddressOf) -> Result<u64> {
        let Some(&(start, size)) = self.by_name.get(&of.target.value) else {
            return Err(of.target.span.error(format!("`{}` has no address", of.target.value)));
        };
        let offset = of.offset.value;
        if offset > size {
            let message =
                format!("offset {offset} is past the end of `{}`, which has {size} bytes", of.target.value);
            return Err(of.offset.span.error(message));
        }
        Ok(start + offset)
    }

    /// The names of what has an address.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.by_name.keys().map(String::as_str)
    }

    /// The address of a buffer or an acceleration structure, by its name.
    pub fn of_name(&self, name: &str) -> Option<u64> {
        self.by_name.get(name).map(|&(start, _)| start)
    }

    /// The address space with the buffers themselves, by name.
    pub(super) fn memory(&self, buffers: &SortedMap<&str, Arc<Buffer>>) -> DeviceMemory {
        self.memory.with_named(|name| buffers.get(name).cloned())
    }
}
