//! Bindings that are the same memory: whose descriptors are of one image, or of overlapping ranges
//! of one buffer.
//!
//! A descriptor's accesses stay inside its range, so that ranges of a buffer which do not overlap
//! are different memory. Ranges that do are one, and what an access says of its place counts from
//! where its own range begins: to compare them, [`AliasedMemory::placed`] counts both from where
//! the buffer begins. That is only known where all elements of a binding begin at the same offset,
//! as the analysis does not know which element an access is to.

use std::borrow::Cow;
use std::sync::Arc;

use super::{AffineExpr, Memory, MemoryAccess};
use crate::machine::{Binding, Descriptor, Resources};
use anyhit_base::sorted::SortedMap;

/// What a binding's accesses have in common with those of others.
pub(super) struct AliasedMemory {
    /// For each binding that shares memory with an earlier one: the first of these.
    first: SortedMap<Binding, Binding>,
    /// The first bindings of those whose memory is accessed by device addresses, too.
    addressed: Vec<Binding>,
    /// What is added to the offsets in a binding to compare them with those of others, modulo 2^32;
    /// `None` where its elements begin at different offsets. Without an entry it is nothing.
    shifts: SortedMap<Binding, Option<u32>>,
}

/// The bytes that a descriptor refers to.
struct Extent {
    /// Equal for all that is one buffer or one image.
    memory: usize,
    start: u64,
    end: u64,
    binding: Binding,
    /// The device address of the first of the bytes.
    address: Option<u64>,
}

impl AliasedMemory {
    /// The aliases among the bindings that are accessed.
    pub(super) fn of(resources: &Resources, accesses: &[&MemoryAccess]) -> Self {
        let mut all = Self { first: SortedMap::new(), addressed: Vec::new(), shifts: SortedMap::new() };
        let mut bindings: Vec<Binding> =
            accesses.iter().filter_map(|access| binding(access.memory)).collect();
        bindings.sort_unstable();
        bindings.dedup();
        let by_address = accesses.iter().any(|access| access.memory == Memory::Addresses);
        let mut extents: Vec<Extent> = Vec::new();
        for &binding in &bindings {
            let descriptors = resources.descriptors.get(&binding).into_iter().flatten();
            for descriptor in descriptors.flat_map(Descriptor::kinds) {
                extents.extend(extent(descriptor, binding, by_address, resources));
            }
        }
        all.unite(&mut extents);
        if by_address {
            all.find_addressed(&extents);
        }
        all
    }

    /// Finds the bindings with overlapping ranges, and how far these lie apart.
    fn unite(&mut self, extents: &mut [Extent]) {
        extents.sort_unstable_by_key(|one| (one.memory, one.start, one.binding));
        // Bindings of which some range overlaps one that begins elsewhere.
        let mut apart: Vec<Binding> = Vec::new();
        let mut group: Option<(&Extent, u64)> = None;
        for one in extents.iter() {
            match &mut group {
                Some((begin, end)) if begin.memory == one.memory && one.start < *end => {
                    *end = (*end).max(one.end);
                    let others = self.unite_bindings(begin.binding, one.binding);
                    if begin.start != one.start {
                        apart.push(others);
                    }
                }
                _ => group = Some((one, one.end)),
            }
        }
        if apart.is_empty() {
            return;
        }
        let apart: Vec<Binding> = apart.into_iter().map(|binding| self.first_of(binding)).collect();
        let concerned = extents.iter().filter(|one| apart.contains(&self.first_of(one.binding)));
        let offsets: Vec<(Binding, u64)> = concerned.map(|one| (one.binding, one.start)).collect();
        offsets.into_iter().for_each(|(binding, offset)| self.shift(binding, offset));
    }

    /// Counts the offsets in a binding from `by` on, or from nowhere if that differs between its
    /// elements.
    fn shift(&mut self, binding: Binding, by: u64) {
        // Offsets are compared modulo 2^32.
        let by = by as u32;
        let known = self.shifts.entry(binding).or_insert(Some(by));
        *known = known.filter(|known| *known == by);
    }

    /// Makes two bindings one memory, and returns the first of them.
    fn unite_bindings(&mut self, a: Binding, b: Binding) -> Binding {
        let [a, b] = [a, b].map(|one| self.first_of(one));
        let (earlier, later) = (a.min(b), a.max(b));
        if earlier != later {
            self.first.values_mut().filter(|one| **one == later).for_each(|one| *one = earlier);
            self.first.insert(later, earlier);
        }
        earlier
    }

    fn first_of(&self, binding: Binding) -> Binding {
        *self.first.get(&binding).unwrap_or(&binding)
    }

    /// Finds the bindings that device addresses lead to. If one of several aliased bindings has an
    /// address, all have. Their offsets count from address 0 on, as the addresses do.
    fn find_addressed(&mut self, extents: &[Extent]) {
        let addressed = extents.iter().filter(|one| one.address.is_some());
        self.addressed = addressed.map(|one| self.first_of(one.binding)).collect();
        self.addressed.sort_unstable();
        self.addressed.dedup();
        let is_addressed = |binding: Binding| self.addressed.contains(&self.first_of(binding));
        let concerned = extents.iter().filter(|one| is_addressed(one.binding));
        // What has no address shares no bytes with what has one: any offset is right.
        let offsets: Vec<(Binding, u64)> =
            concerned.map(|one| (one.binding, one.address.unwrap_or(one.start))).collect();
        self.shifts.retain(|binding, _| !offsets.iter().any(|(one, _)| one == binding));
        offsets.into_iter().for_each(|(binding, offset)| self.shift(binding, offset));
    }

    /// The representative of a memory among its aliases.
    pub(super) fn representative(&self, memory: Memory) -> Memory {
        match memory {
            Memory::Binding(binding) => match self.first_of(binding) {
                first if self.addressed.contains(&first) => Memory::Addresses,
                first => Memory::Binding(first),
            },
            other => other,
        }
    }

    /// An access with its place in the memory that its binding shares.
    pub(super) fn placed<'a>(&self, access: &'a MemoryAccess) -> Cow<'a, MemoryAccess> {
        let shift = binding(access.memory).and_then(|binding| self.shifts.get(&binding));
        let Some(shift) = shift.filter(|shift| **shift != Some(0)) else { return Cow::Borrowed(access) };
        let mut placed = access.clone();
        let by = shift.map(|shift| AffineExpr::constant(shift.into()));
        placed.place = placed.place.zip(by).and_then(|(mut place, by)| {
            for range in &mut place {
                range.from = range.from.clone().plus(&by)?;
            }
            Some(place)
        });
        Cow::Owned(placed)
    }
}

fn binding(memory: Memory) -> Option<Binding> {
    match memory {
        Memory::Binding(binding) => Some(binding),
        Memory::Addresses | Memory::Unknown => None,
    }
}

/// What a descriptor refers to; `None` where it has no memory that shaders store to.
fn extent(
    descriptor: &Descriptor,
    binding: Binding,
    by_address: bool,
    resources: &Resources,
) -> Option<Extent> {
    match descriptor {
        Descriptor::Buffer(buffer) => {
            let (start, size) = (buffer.offset(), buffer.size());
            let address = if by_address { resources.memory.address_of(buffer) } else { None };
            let memory = buffer.memory_id();
            (size > 0).then(|| Extent { memory, start, end: start.saturating_add(size), binding, address })
        }
        Descriptor::Image(image) | Descriptor::ImageSampler(image, _) => {
            let memory = Arc::as_ptr(image).addr();
            Some(Extent { memory, start: 0, end: 1, binding, address: None })
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use smallvec::SmallVec;

    use super::super::affine::{AffineRange, Symbol};
    use super::*;
    use crate::machine::Buffer;

    fn at(binding: u32) -> Binding {
        Binding { set: 0, binding }
    }

    /// An access to the word of an invocation's index.
    fn access(memory: Memory) -> MemoryAccess {
        let index = AffineExpr::of(SmallVec::from_slice(&[Symbol::Index(0)]), 4);
        let range = AffineRange { count: 4, ..AffineRange::exactly(index) };
        MemoryAccess { memory, stores: true, atomic: None, place: Some(SmallVec::from_iter([range])) }
    }

    /// The aliases of buffers that are all accessed.
    fn aliases(buffers: &[(u32, Arc<Buffer>)], address: Option<&Arc<Buffer>>) -> AliasedMemory {
        let mut resources = Resources::default();
        let mut accesses: Vec<MemoryAccess> = Vec::new();
        for (binding, buffer) in buffers {
            let known = resources.descriptors.get(&at(*binding)).map_or(0, Vec::len);
            resources.insert(at(*binding), known as u32, Descriptor::Buffer(buffer.clone()));
            accesses.push(access(Memory::Binding(at(*binding))));
        }
        if let Some(buffer) = address {
            resources.memory.add_buffer_at(0x1_0000_0010, buffer, None).unwrap();
            accesses.push(access(Memory::Addresses));
        }
        AliasedMemory::of(&resources, &accesses.iter().collect::<Vec<_>>())
    }

    /// The memory of a binding, and the constant term of its access to the first word there.
    fn placed(aliases: &AliasedMemory, binding: u32) -> (Memory, Option<i64>) {
        let memory = Memory::Binding(at(binding));
        let constant = aliases.placed(&access(memory)).place.as_ref().map(|place| place[0].from.split().0);
        (aliases.representative(memory), constant)
    }

    #[test]
    fn ranges_that_do_not_overlap_are_different_memory() {
        let arena = Buffer::zeroed(256);
        let view = |offset, range| arena.view(offset, range, "arena").unwrap();
        let apart = aliases(&[(0, view(0, 64)), (1, view(64, 192))], None);
        assert_eq!(placed(&apart, 0), (Memory::Binding(at(0)), Some(0)));
        assert_eq!(placed(&apart, 1), (Memory::Binding(at(1)), Some(0)));
        // One byte more, and they are one.
        let one = aliases(&[(0, view(0, 65)), (1, view(64, 192))], None);
        assert_eq!(placed(&one, 0), (Memory::Binding(at(0)), Some(0)));
        assert_eq!(placed(&one, 1), (Memory::Binding(at(0)), Some(64)));
        // A third one joins two that do not overlap, whatever their order.
        for order in [[3, 4, 5], [5, 3, 4], [4, 5, 3]] {
            let joined = [(order[0], view(0, 64)), (order[1], view(128, 64)), (order[2], arena.clone())];
            let joined = aliases(&joined, None);
            assert_eq!(placed(&joined, order[0]), (Memory::Binding(at(3)), Some(0)));
            assert_eq!(placed(&joined, order[1]), (Memory::Binding(at(3)), Some(128)));
            assert_eq!(placed(&joined, order[2]), (Memory::Binding(at(3)), Some(0)));
        }
        // A range without bytes overlaps nothing.
        let none = aliases(&[(0, arena.clone()), (1, view(64, 0))], None);
        assert_eq!(placed(&none, 1), (Memory::Binding(at(1)), Some(0)));
    }

    #[test]
    fn elements_that_begin_at_different_offsets_are_nowhere_known() {
        let arena = Buffer::zeroed(256);
        let view = |offset, range| arena.view(offset, range, "arena").unwrap();
        let overlapping = aliases(&[(0, view(0, 128)), (0, view(64, 128))], None);
        assert_eq!(placed(&overlapping, 0), (Memory::Binding(at(0)), None));
        // As long as they do not overlap each other or another binding, each is memory of its own.
        let apart = [(0, view(0, 64)), (0, view(64, 64))];
        assert_eq!(placed(&aliases(&apart, None), 0), (Memory::Binding(at(0)), Some(0)));
        let met = [apart[0].clone(), apart[1].clone(), (1, view(96, 64))];
        assert_eq!(placed(&aliases(&met, None), 0), (Memory::Binding(at(0)), None));
        assert_eq!(placed(&aliases(&met, None), 1), (Memory::Binding(at(0)), Some(96)));
    }

    #[test]
    fn offsets_of_what_has_an_address_count_as_the_address_does() {
        let (arena, other) = (Buffer::zeroed(256), Buffer::zeroed(64));
        let view = arena.view(64, 64, "arena").unwrap();
        let all = aliases(&[(0, arena.clone()), (1, view), (2, other)], Some(&arena));
        assert_eq!(placed(&all, 0), (Memory::Addresses, Some(0x10)));
        assert_eq!(placed(&all, 1), (Memory::Addresses, Some(0x50)));
        assert_eq!(placed(&all, 2), (Memory::Binding(at(2)), Some(0)));
    }
}
