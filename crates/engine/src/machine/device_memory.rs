//! Device addresses: where buffers and acceleration structures lie in one 64-bit address space.
//!
//! Each allocation begins a region of 4 GiB of its own, in the order in which they are made: the
//! upper half of an address names the allocation (from 1 on), the lower half is the offset in it.
//! So addresses are the same on every machine and in every run, no allocation is at the null
//! pointer, and an access past the end of a buffer hits a guard gap instead of the next buffer.
//! A buffer may also lie at a given address; the regions that it touches are then left out.

use std::ops::RangeInclusive;
use std::sync::Arc;

use crate::accel::Tlas;
use crate::machine::buffer::Buffer;

/// Bits of an address that count bytes in a region.
const REGION_BITS: u32 = 32;

/// Bytes that operating systems leave unmapped at address 0, so that small offsets from the null
/// pointer lead nowhere.
const NULL_GUARD: u64 = 1 << 16;

/// What every given address is a multiple of: the largest alignment of a scalar or vector of four
/// words.
const ALIGNMENT: u64 = 16;

/// The allocations that device addresses reach.
#[derive(Clone, Debug, Default)]
pub struct DeviceMemory {
    /// Allocations by their base addresses, ascending.
    allocations: Vec<Allocation>,
    /// The regions used so far.
    regions: u64,
}

#[derive(Clone, Debug)]
struct Allocation {
    base: u64,
    /// Its bytes; 0 for a structure.
    size: u64,
    /// The name of a buffer in its scene.
    name: Option<Arc<str>>,
    content: Content,
}

#[derive(Clone, Debug)]
enum Content {
    Buffer(Arc<Buffer>),
    Structure(Arc<Tlas>),
    /// A buffer that is not made yet.
    Reserved,
}

impl Allocation {
    /// The first address behind it; what has no bytes takes one.
    fn end(&self) -> u64 {
        self.base.saturating_add(self.size.max(1))
    }

    fn buffer(&self) -> Option<&Arc<Buffer>> {
        match &self.content {
            Content::Buffer(buffer) => Some(buffer),
            Content::Structure(_) | Content::Reserved => None,
        }
    }
}

/// Where a buffer begins, the buffer, and its name if it has one.
pub type NearestBuffer<'a> = (u64, &'a Arc<Buffer>, Option<&'a Arc<str>>);

impl DeviceMemory {
    /// Returns whether the same lies at the same addresses.
    pub(super) fn has_equal_contents(&self, other: &Self) -> bool {
        let same = |(own, other): (&Allocation, &Allocation)| {
            own.base == other.base
                && own.name == other.name
                && match (&own.content, &other.content) {
                    (Content::Buffer(own), Content::Buffer(other)) => buffers_equal(own, other),
                    (Content::Structure(own), Content::Structure(other)) => structures_equal(own, other),
                    (Content::Reserved, Content::Reserved) => own.size == other.size,
                    _ => false,
                }
        };
        self.allocations.len() == other.allocations.len()
            && self.allocations.iter().zip(&other.allocations).all(same)
    }

    /// Gives a buffer an address (`vkGetBufferDeviceAddress`); the one that it has, where it has
    /// one.
    pub fn add_buffer(&mut self, buffer: &Arc<Buffer>) -> u64 {
        let content = || Content::Buffer(buffer.clone());
        self.address_of(buffer).unwrap_or_else(|| self.allocate(buffer.size(), None, content()))
    }

    /// Puts a buffer at an address. It may have a name, for messages.
    ///
    /// # Errors
    /// The message where the address cannot be given or the buffer overlaps another allocation.
    pub fn add_buffer_at(
        &mut self,
        address: u64,
        buffer: &Arc<Buffer>,
        name: Option<&str>,
    ) -> Result<(), String> {
        self.insert_at(address, buffer.size(), name, Content::Buffer(buffer.clone()))
    }

    /// Keeps addresses for a buffer of a name and size that comes later; see
    /// [`DeviceMemory::with_named`].
    pub fn reserve(&mut self, name: &str, size: u64) -> u64 {
        self.allocate(size, Some(name.into()), Content::Reserved)
    }

    /// Keeps given addresses for a buffer that comes later.
    ///
    /// # Errors
    /// As [`DeviceMemory::add_buffer_at`].
    pub fn reserve_at(&mut self, address: u64, name: &str, size: u64) -> Result<(), String> {
        self.insert_at(address, size, Some(name), Content::Reserved)
    }

    /// Returns a copy of the address space with the buffers that names were reserved for.
    #[must_use]
    pub fn with_named(&self, buffer: impl Fn(&str) -> Option<Arc<Buffer>>) -> Self {
        let mut copy = self.clone();
        for allocation in &mut copy.allocations {
            if let (Content::Reserved, Some(name)) = (&allocation.content, &allocation.name)
                && let Some(buffer) = buffer(name)
            {
                allocation.content = Content::Buffer(buffer);
            }
        }
        copy
    }

    /// Takes over the allocations of another address space, at their addresses.
    ///
    /// # Errors
    /// The message where one overlaps an allocation that is here already.
    pub fn extend(&mut self, other: &Self) -> Result<(), String> {
        for Allocation { base, size, name, content } in &other.allocations {
            self.insert_at(*base, *size, name.as_deref(), content.clone())?;
        }
        Ok(())
    }

    /// Why an address cannot be given to a buffer.
    ///
    /// # Errors
    /// The message for null pointers, odd alignments and the values of descriptors.
    pub fn check_address(address: u64) -> Result<(), String> {
        if Self::is_null(address) {
            return Err(format!(
                "the address {address:#x} is too close to the null pointer: use {NULL_GUARD:#x} or above"
            ));
        }
        if !address.is_multiple_of(ALIGNMENT) {
            return Err(format!("the address {address:#x} is not a multiple of {ALIGNMENT}"));
        }
        if address >> REGION_BITS == u64::from(STRUCTURE_HANDLE) {
            return Err(format!("the address {address:#x} is too large: use one below 0xffffffff00000000"));
        }
        Ok(())
    }

    /// Gives an acceleration structure an address (`vkGetAccelerationStructureDeviceAddressKHR`);
    /// the one that it has, where it has one.
    pub fn add_structure(&mut self, tlas: &Arc<Tlas>) -> u64 {
        let known = self.allocations.iter().find_map(|allocation| match &allocation.content {
            Content::Structure(found) if Arc::ptr_eq(found, tlas) => Some(allocation.base),
            _ => None,
        });
        known.unwrap_or_else(|| self.allocate(0, None, Content::Structure(tlas.clone())))
    }

    /// Puts another acceleration structure at the address of one.
    pub fn replace_structure(&mut self, old: &Arc<Tlas>, new: &Arc<Tlas>) {
        for allocation in &mut self.allocations {
            if let Content::Structure(found) = &mut allocation.content
                && Arc::ptr_eq(found, old)
            {
                *found = new.clone();
            }
        }
    }

    /// Returns a copy of the address space with other buffers at the same addresses.
    #[must_use]
    pub fn with_buffers(&self, mut other: impl FnMut(&Arc<Buffer>) -> Arc<Buffer>) -> Self {
        let mut copy = self.clone();
        for allocation in &mut copy.allocations {
            if let Content::Buffer(buffer) = &mut allocation.content {
                *buffer = other(buffer);
            }
        }
        copy
    }

    /// The address of a buffer that has one, or of a view of it.
    pub fn address_of(&self, buffer: &Buffer) -> Option<u64> {
        self.allocations.iter().find_map(|allocation| {
            let found = allocation.buffer().filter(|found| found.memory_id() == buffer.memory_id())?;
            allocation.base.checked_add(buffer.offset().checked_sub(found.offset())?)
        })
    }

    /// The buffer of a name.
    pub fn named_buffer(&self, name: &str) -> Option<(u64, &Arc<Buffer>)> {
        let named = self.allocations.iter().find(|one| one.name.as_deref() == Some(name))?;
        Some((named.base, named.buffer()?))
    }

    /// All buffers that have a name, by their addresses.
    pub fn named_buffers(&self) -> impl Iterator<Item = (&Arc<str>, &Arc<Buffer>)> {
        self.allocations.iter().filter_map(|one| Some((one.name.as_ref()?, one.buffer()?)))
    }

    /// All buffers.
    pub fn buffers(&self) -> impl Iterator<Item = &Arc<Buffer>> {
        self.allocations.iter().filter_map(Allocation::buffer)
    }

    /// The buffer in whose regions an address lies, and the offset there, which may be beyond the
    /// buffer's end.
    #[inline]
    pub fn buffer(&self, address: u64) -> Option<(&Buffer, u64)> {
        let allocation = self.allocation(address)?;
        Some((allocation.buffer()?, address - allocation.base))
    }

    /// The buffer that lies nearest to an address, where it begins, and its name.
    pub fn nearest_buffer(&self, address: u64) -> Option<NearestBuffer<'_>> {
        let buffers =
            self.allocations.iter().filter_map(|one| Some((one.base, one.buffer()?, one.name.as_ref())));
        buffers.min_by_key(|&(base, buffer, _)| {
            let end = base.saturating_add(buffer.size());
            base.saturating_sub(address).max(address.saturating_sub(end))
        })
    }

    /// An address in words, `materials + 0x40`, where it lies in a buffer that has a name or at
    /// its end.
    pub fn describe(&self, address: u64) -> Option<String> {
        let allocation = self.allocation(address)?;
        let (name, offset) = (allocation.name.as_ref()?, address - allocation.base);
        match offset {
            0 => Some(name.to_string()),
            _ if offset <= allocation.size => Some(format!("{name} + {offset:#x}")),
            _ => None,
        }
    }

    /// Whether an address is the null pointer, or a small offset from it.
    pub fn is_null(address: u64) -> bool {
        address < NULL_GUARD
    }

    /// The acceleration structure at an address.
    pub fn structure(&self, address: u64) -> Option<&Arc<Tlas>> {
        let allocation = self.allocation(address)?;
        match &allocation.content {
            Content::Structure(tlas) if allocation.base == address => Some(tlas),
            _ => None,
        }
    }

    #[inline]
    fn allocation(&self, address: u64) -> Option<&Allocation> {
        let after = self.allocations.partition_point(|allocation| allocation.base <= address);
        let allocation = self.allocations.get(after.checked_sub(1)?)?;
        // Behind the last of its regions there is nothing.
        let last = allocation.base.saturating_add(allocation.size) >> REGION_BITS;
        (address >> REGION_BITS <= last).then_some(allocation)
    }

    fn allocate(&mut self, size: u64, name: Option<Arc<str>>, content: Content) -> u64 {
        let count = (size >> REGION_BITS) + 1;
        let mut first = self.regions + 1;
        // Given addresses are few; those of other automatic ones lie below.
        while let Some(end) = self.taken(first..=first + count - 1) {
            first = end + 1;
        }
        self.regions = first + count - 1;
        let base = first << REGION_BITS;
        let at = self.allocations.partition_point(|allocation| allocation.base <= base);
        self.allocations.insert(at, Allocation { base, size, name, content });
        base
    }

    /// The last region of an allocation that touches one of these regions.
    fn taken(&self, regions: RangeInclusive<u64>) -> Option<u64> {
        let after = self.allocations.partition_point(|one| one.base >> REGION_BITS <= *regions.end());
        let before = &self.allocations[after.checked_sub(1)?];
        let end = (before.end() - 1) >> REGION_BITS;
        (end >= *regions.start()).then_some(end)
    }

    fn insert_at(
        &mut self,
        address: u64,
        size: u64,
        name: Option<&str>,
        content: Content,
    ) -> Result<(), String> {
        Self::check_address(address)?;
        let new = Allocation { base: address, size, name: name.map(Into::into), content };
        let last = address.checked_add(size.max(1) - 1);
        if last.is_none_or(|last| last >> REGION_BITS >= u64::from(STRUCTURE_HANDLE)) {
            return Err(format!("{size} bytes at {address:#x} extend beyond the last address"));
        }
        let at = self.allocations.partition_point(|allocation| allocation.base <= address);
        let around = [at.checked_sub(1), Some(at)].into_iter().flatten();
        let overlaps = |one: &&Allocation| one.base < new.end() && address < one.end();
        if let Some(other) = around.filter_map(|at| self.allocations.get(at)).find(overlaps) {
            let what = match (&other.name, &other.content) {
                (Some(name), _) => format!("`{name}`"),
                (None, Content::Structure(_)) => "an acceleration structure".to_owned(),
                (None, _) => "another buffer".to_owned(),
            };
            return Err(format!(
                "{size} bytes at {address:#x} overlap {what}, {} bytes at {:#x}",
                other.size, other.base
            ));
        }
        self.allocations.insert(at, new);
        Ok(())
    }
}

/// The upper word of an acceleration structure's value that tells a descriptor's handle from a
/// device address: no allocation lies that high.
pub const STRUCTURE_HANDLE: u32 = u32::MAX;

/// Returns whether two buffers have the same bytes.
pub(super) fn buffers_equal(own: &Buffer, other: &Buffer) -> bool {
    own.is_null() == other.is_null() && own.size() == other.size() && own.has_equal_bytes(other)
}

/// Returns whether two structures have the same instances of the same geometries.
pub(super) fn structures_equal(own: &Arc<Tlas>, other: &Arc<Tlas>) -> bool {
    if Arc::ptr_eq(own, other) {
        return true;
    }
    let (own, others) = (own.instances(), other.instances());
    own.len() == others.len()
        && own.iter().zip(others).all(|(own, other)| {
            own.transform == other.transform
                && own.motion == other.motion
                && own.custom_index == other.custom_index
                && own.mask == other.mask
                && own.sbt_record_offset == other.sbt_record_offset
                && own.flags == other.flags
                && own.blas.geometries() == other.blas.geometries()
        })
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
        let near = |address| memory.nearest_buffer(address).map(|(start, ..)| start);
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

    #[test]
    fn a_given_address_leaves_the_regions_of_others() {
        let mut memory = DeviceMemory::default();
        memory.add_buffer_at(0x1_0000_1000, &Buffer::zeroed(32), Some("a")).unwrap();
        // Region 1 is touched, so the first automatic address is in region 2; region 3 is taken by
        // the end of what begins before it.
        memory.add_buffer_at(0x3_0000_0000 - 16, &Buffer::zeroed(32), None).unwrap();
        assert_eq!(memory.add_buffer(&Buffer::zeroed(8)), 0x4_0000_0000);
        let offset = |address| memory.buffer(address).map(|(_, offset)| offset);
        assert_eq!([0x1_0000_0fff, 0x1_0000_1000, 0x1_0000_1010].map(offset), [None, Some(0), Some(16)]);
        assert_eq!([0x3_0000_0004, 0x4_0000_0004].map(offset), [Some(20), Some(4)]);
        assert_eq!(memory.describe(0x1_0000_1010).as_deref(), Some("a + 0x10"));
        assert_eq!(memory.describe(0x1_0000_1000).as_deref(), Some("a"));
        assert_eq!(memory.describe(0x1_0000_1021), None);
        assert_eq!(memory.nearest_buffer(0x1_0000_1040).unwrap().2.map(|name| &**name), Some("a"));
        assert_eq!(memory.named_buffer("a").map(|(base, _)| base), Some(0x1_0000_1000));
    }

    #[test]
    fn an_address_that_cannot_be_given_says_why() {
        let mut memory = DeviceMemory::default();
        memory.add_buffer_at(0x2_0000_0000, &Buffer::zeroed(32), Some("a")).unwrap();
        for (address, why) in [
            (0xfff0, "too close to the null pointer"),
            (0x1_0000_0008, "not a multiple of 16"),
            (u64::MAX - 15, "too large"),
            (0xffff_fffe_ffff_fff0, "extend beyond the last address"),
            (0x2_0000_0010, "overlap `a`, 32 bytes at 0x200000000"),
            (0x1_ffff_fff0, "overlap `a`"),
        ] {
            let error = memory.add_buffer_at(address, &Buffer::zeroed(32), None).unwrap_err();
            assert!(error.contains(why), "{address:#x}: {error}");
        }
        memory.add_buffer_at(0x2_0000_0020, &Buffer::zeroed(32), None).unwrap();
    }

    #[test]
    fn a_view_lies_inside_its_buffer() {
        let mut memory = DeviceMemory::default();
        let buffer = Buffer::zeroed(64);
        let base = memory.add_buffer(&buffer);
        let view = buffer.view(16, 8, "arena").unwrap();
        assert_eq!(memory.address_of(&view), Some(base + 16));
        assert_eq!(memory.add_buffer(&view), base + 16);
    }

    #[test]
    fn a_reserved_buffer_comes_later() {
        let mut memory = DeviceMemory::default();
        let base = memory.reserve("b", 16);
        assert!(memory.buffer(base).is_none());
        let buffer = Buffer::zeroed(16);
        let filled = memory.with_named(|name| (name == "b").then(|| buffer.clone()));
        assert_eq!(filled.address_of(&buffer), Some(base));
    }
}
