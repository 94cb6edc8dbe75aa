//! Device addresses: where buffers and acceleration structures lie in one 64-bit address space.
//!
//! Each allocation begins a region of 4 GiB of its own, in the order in which they are made: the
//! upper half of an address names the allocation (from 1 on), the lower half is the offset in it.
//! So addresses are the same on every machine and in every run, no allocation is at the null
//! pointer, and an access past the end of a buffer hits a guard gap instead of the next buffer.

use std::sync::Arc;

use crate::accel::Tlas;
use crate::machine::resource::Buffer;

/// Bits of an address that count bytes in a region.
const REGION_BITS: u32 = 32;

/// The allocations that device addresses reach.
#[derive(Clone, Debug, Default)]
pub struct DeviceMemory {
    /// Allocations with their base addresses, ascending.
    allocations: Vec<(u64, Allocation)>,
    /// The regions used so far.
    regions: u64,
}

#[derive(Clone, Debug)]
enum Allocation {
    Buffer(Arc<Buffer>),
    Structure(Arc<Tlas>),
}

impl DeviceMemory {
    /// Gives a buffer an address (`vkGetBufferDeviceAddress`); the one that it has, where it has
    /// one.
    pub fn add_buffer(&mut self, buffer: &Arc<Buffer>) -> u64 {
        self.address_of(buffer)
            .unwrap_or_else(|| self.allocate(buffer.size(), Allocation::Buffer(buffer.clone())))
    }

    /// Gives an acceleration structure an address (`vkGetAccelerationStructureDeviceAddressKHR`);
    /// the one that it has, where it has one.
    pub fn add_structure(&mut self, tlas: &Arc<Tlas>) -> u64 {
        let known = self.allocations.iter().find_map(|(base, allocation)| match allocation {
            Allocation::Structure(found) if Arc::ptr_eq(found, tlas) => Some(*base),
            _ => None,
        });
        known.unwrap_or_else(|| self.allocate(0, Allocation::Structure(tlas.clone())))
    }

    /// Returns a copy of the address space with other buffers at the same addresses.
    #[must_use]
    pub fn with_buffers(&self, mut other: impl FnMut(&Arc<Buffer>) -> Arc<Buffer>) -> Self {
        let mut copy = self.clone();
        for (_, allocation) in &mut copy.allocations {
            if let Allocation::Buffer(buffer) = allocation {
                *buffer = other(buffer);
            }
        }
        copy
    }

    /// The address of a buffer that has one.
    pub fn address_of(&self, buffer: &Arc<Buffer>) -> Option<u64> {
        self.allocations.iter().find_map(|(base, allocation)| match allocation {
            Allocation::Buffer(found) if Arc::ptr_eq(found, buffer) => Some(*base),
            _ => None,
        })
    }

    /// The buffer in whose regions an address lies, and the offset there, which may be beyond the
    /// buffer's end.
    #[inline]
    pub fn buffer(&self, address: u64) -> Option<(&Buffer, u64)> {
        match self.allocation(address)? {
            (base, Allocation::Buffer(buffer)) => Some((buffer, address - base)),
            _ => None,
        }
    }

    /// The buffer that lies nearest to an address, and where it begins.
    pub fn nearest_buffer(&self, address: u64) -> Option<(u64, &Arc<Buffer>)> {
        let buffers = self.allocations.iter().filter_map(|(base, allocation)| match allocation {
            Allocation::Buffer(buffer) => Some((*base, buffer)),
            Allocation::Structure(_) => None,
        });
        buffers.min_by_key(|&(base, buffer)| {
            let end = base.saturating_add(buffer.size());
            base.saturating_sub(address).max(address.saturating_sub(end))
        })
    }

    /// Whether an address is the null pointer, or a small offset from it.
    pub fn is_null(address: u64) -> bool {
        /// Bytes that operating systems leave unmapped at address 0, for the same purpose.
        const GUARD: u64 = 1 << 16;
        address < GUARD
    }

    /// The acceleration structure at an address.
    pub fn structure(&self, address: u64) -> Option<&Arc<Tlas>> {
        match self.allocation(address)? {
            (base, Allocation::Structure(tlas)) if *base == address => Some(tlas),
            _ => None,
        }
    }

    #[inline]
    fn allocation(&self, address: u64) -> Option<&(u64, Allocation)> {
        let after = self.allocations.partition_point(|(base, _)| *base <= address);
        // Behind the last allocation's regions there is nothing.
        let inside = address >> REGION_BITS <= self.regions;
        self.allocations.get(after.checked_sub(1)?).filter(|_| inside)
    }

    fn allocate(&mut self, size: u64, allocation: Allocation) -> u64 {
        let base = (self.regions + 1) << REGION_BITS;
        self.regions += (size >> REGION_BITS) + 1;
        self.allocations.push((base, allocation));
        base
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_follow_the_order_of_allocation() {
        let mut memory = DeviceMemory::default();
        let (a, b) = (Buffer::zeroed(16), Buffer::zeroed(0));
        assert_eq!(memory.add_buffer(&a), 0x1_0000_0000);
        assert_eq!(memory.add_buffer(&b), 0x2_0000_0000);
        assert_eq!(memory.add_buffer(&a), 0x1_0000_0000);
        let tlas = Tlas::new(Vec::new()).unwrap();
        assert_eq!(memory.add_structure(&tlas), 0x3_0000_0000);
        assert_eq!(memory.add_structure(&tlas), 0x3_0000_0000);
        assert_eq!(memory.address_of(&b), Some(0x2_0000_0000));
        assert_eq!(memory.address_of(&Buffer::zeroed(16)), None);
    }

    #[test]
    fn the_nearest_buffer_is_found_from_both_sides() {
        let mut memory = DeviceMemory::default();
        assert!(memory.nearest_buffer(5).is_none());
        let (a, b) = (Buffer::zeroed(16), Buffer::zeroed(8));
        let (first, second) = (memory.add_buffer(&a), memory.add_buffer(&b));
        let near = |address| memory.nearest_buffer(address).map(|(start, _)| start);
        assert_eq!([0, first - 1, first, first + 16, first + 100].map(near), [Some(first); 5]);
        assert_eq!([second - 100, second, u64::MAX].map(near), [Some(second); 3]);
    }

    #[test]
    fn an_address_leads_to_its_allocation_alone() {
        let mut memory = DeviceMemory::default();
        let buffer = Buffer::zeroed(16);
        let base = memory.add_buffer(&buffer);
        let tlas = Tlas::new(Vec::new()).unwrap();
        let structure = memory.add_structure(&tlas);
        let offset = |address| memory.buffer(address).map(|(_, offset)| offset);
        assert_eq!(offset(base), Some(0));
        assert_eq!(offset(base + 20), Some(20));
        assert_eq!([0, base - 1, structure, structure + (1 << 32), u64::MAX].map(offset), [None; 5]);
        assert!(memory.structure(structure).is_some_and(|found| Arc::ptr_eq(found, &tlas)));
        assert!(memory.structure(structure + 8).is_none() && memory.structure(base).is_none());
    }
}
