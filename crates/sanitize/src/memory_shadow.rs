//! Shadow memory: what is kept of the bytes that invocations share, beside the memory itself.
//!
//! [`SharedAccesses`] has the latest accesses to each word, for races; [`WorkgroupShadow`] says
//! which bytes of Workgroup memory are undefined, and why.

use rustc_hash::FxHashMap;

use anyhit_engine::machine::NO_CAUSE;

/// An access: who, and what, by the number of a [`super::races`] event; all zero for none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Access {
    /// The number of the invocation in its launch.
    pub invocation: u32,
    /// The number of the event; 0 where there was no access.
    pub event: u32,
}

impl Access {
    /// The access, unless there was none.
    #[inline]
    pub(super) fn known(self) -> Option<Self> {
        (self.event != 0).then_some(self)
    }
}

/// The accesses to a word, or to a byte, that later ones may race with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cell {
    /// The last store that was not atomic.
    pub store: Access,
    /// The bits that it stored.
    pub value: u32,
    /// The last atomic access; a load only where there was no other.
    pub atomic: Access,
    /// The last load, and one of another invocation.
    pub loads: [Access; 2],
}

/// Some memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum MemoryKey {
    /// A buffer's, by [`anyhit_engine::machine::Buffer::memory_id`].
    Buffer(usize),
    /// That of a workgroup, by its number.
    Workgroup(u32),
    /// An image's, by its address. Four bytes stand for a texel.
    Image(usize),
}

/// Bytes of a page.
const PAGE_BYTES: u64 = 4096;

/// Cells of 4 KiB: one for each word, or one for each byte after the first access to less than a
/// word.
#[derive(Debug)]
struct Page {
    cells: Vec<Cell>,
    by_byte: bool,
}

impl Page {
    fn new() -> Self {
        Self { cells: vec![Cell::default(); PAGE_BYTES as usize / 4], by_byte: false }
    }

    /// Makes a cell of each byte.
    fn split(&mut self) {
        let cells = self
            .cells
            .iter()
            .flat_map(|&cell| cell.value.to_le_bytes().map(|byte| Cell { value: byte.into(), ..cell }));
        *self = Self { cells: cells.collect(), by_byte: true };
    }
}

/// The latest accesses to memory, page by page where there were any.
#[derive(Debug, Default)]
pub(super) struct SharedAccesses {
    memories: Vec<Vec<Option<Box<Page>>>>,
    places: FxHashMap<MemoryKey, usize>,
    /// Memories that no key has.
    free: Vec<usize>,
    /// The memory of the last access.
    last: Option<(MemoryKey, usize)>,
}

impl SharedAccesses {
    /// Forgets all accesses to the memory of workgroups, which have ended.
    pub(super) fn forget_workgroups(&mut self) {
        let Self { memories, places, free, last } = self;
        places.retain(|key, place| {
            let ends = matches!(key, MemoryKey::Workgroup(_));
            if ends {
                // Its pages are used again for another workgroup.
                memories[*place].iter_mut().flatten().for_each(|page| page.cells.fill(Cell::default()));
                free.push(*place);
            }
            !ends
        });
        *last = None;
    }

    /// Calls a function for each cell of some bytes: with the distance from the first byte, and
    /// how many bytes the cell is of, 4 or 1.
    #[inline]
    pub(super) fn visit(
        &mut self,
        key: MemoryKey,
        offset: u64,
        bytes: u32,
        mut visit: impl FnMut(u32, u32, &mut Cell),
    ) {
        let place = self.place(key);
        let pages = &mut self.memories[place];
        let mut at = 0;
        while at < bytes {
            let position = offset + u64::from(at);
            let (number, within) = ((position / PAGE_BYTES) as usize, (position % PAGE_BYTES) as u32);
            let count = (PAGE_BYTES as u32 - within).min(bytes - at);
            if number >= pages.len() {
                pages.resize_with(number + 1, || None);
            }
            let page = pages[number].get_or_insert_with(|| Box::new(Page::new()));
            if !page.by_byte && !(within | count).is_multiple_of(4) {
                page.split();
            }
            let step = if page.by_byte { 1 } else { 4 };
            let first = (within / step) as usize;
            let cells = &mut page.cells[first..first + (count / step) as usize];
            for (cell, from) in cells.iter_mut().zip((at..).step_by(step as usize)) {
                visit(from, step, cell);
            }
            at += count;
        }
    }

    #[inline]
    fn place(&mut self, key: MemoryKey) -> usize {
        if let Some((last, place)) = self.last
            && last == key
        {
            return place;
        }
        let place = *self.places.entry(key).or_insert_with(|| {
            self.free.pop().unwrap_or_else(|| {
                self.memories.push(Vec::new());
                self.memories.len() - 1
            })
        });
        self.last = Some((key, place));
        place
    }
}

/// Which bytes of the Workgroup memory of running workgroups are undefined, by causes.
#[derive(Debug, Default)]
pub(super) struct WorkgroupShadow {
    /// The number of the first workgroup that runs.
    first: u32,
    /// By workgroup from the first one on: the cause of each byte, once it is accessed.
    groups: Vec<Vec<u32>>,
}

impl WorkgroupShadow {
    /// The cause of bytes that nobody has written.
    pub(super) const UNWRITTEN: u32 = u32::MAX;

    /// Other workgroups run, from one on.
    pub(super) fn begin(&mut self, first: u32) {
        self.first = first;
        self.groups.iter_mut().for_each(Vec::clear);
    }

    /// The causes of the bytes of a workgroup, which `fill` makes where they are not yet known.
    #[inline]
    pub(super) fn causes(&mut self, group: u32, fill: impl FnOnce(&mut Vec<u32>)) -> &mut [u32] {
        let at = group.wrapping_sub(self.first) as usize;
        if at >= self.groups.len() {
            self.groups.resize_with(at + 1, Vec::new);
        }
        let causes = &mut self.groups[at];
        if causes.is_empty() {
            fill(causes);
        }
        causes
    }
}

/// The cause of an undefined byte among some, with its place; those that are written count before
/// those that nobody has written.
pub(super) fn undefined_byte(causes: &[u32]) -> Option<(usize, u32)> {
    if causes.iter().all(|&cause| cause == NO_CAUSE) {
        return None;
    }
    causes.iter().copied().enumerate().filter(|&(_, cause)| cause != NO_CAUSE).min_by_key(|&(_, cause)| cause)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUFFER: MemoryKey = MemoryKey::Buffer(1);

    fn cells(accesses: &mut SharedAccesses, offset: u64, bytes: u32) -> Vec<(u32, u32, Cell)> {
        let mut all = Vec::new();
        accesses.visit(BUFFER, offset, bytes, |at, size, cell| all.push((at, size, *cell)));
        all
    }

    #[test]
    fn words_become_bytes_where_a_part_of_one_is_accessed() {
        let mut accesses = SharedAccesses::default();
        let stored = |value| Cell { store: Access { invocation: 7, event: 3 }, value, ..Cell::default() };
        // Two words at both sides of the end of a page.
        accesses.visit(BUFFER, 4092, 8, |_, _, cell| *cell = stored(0x0403_0201));
        assert_eq!(cells(&mut accesses, 4092, 8), [(0, 4, stored(0x0403_0201)), (4, 4, stored(0x0403_0201))]);
        assert_eq!(cells(&mut accesses, 4094, 1), [(0, 1, stored(3))]);
        let read = cells(&mut accesses, 4094, 6);
        assert_eq!(read, [(0, 1, stored(3)), (1, 1, stored(4)), (2, 4, stored(0x0403_0201))]);
        assert_eq!(cells(&mut accesses, 4088, 1), [(0, 1, Cell::default())]);
    }

    #[test]
    fn accesses_of_workgroups_are_forgotten_and_others_kept() {
        let mut accesses = SharedAccesses::default();
        let mark = |_: u32, _: u32, cell: &mut Cell| cell.value = 1;
        accesses.visit(MemoryKey::Workgroup(0), 0, 4, mark);
        accesses.visit(BUFFER, 0, 4, mark);
        accesses.forget_workgroups();
        let mut values = Vec::new();
        for key in [MemoryKey::Workgroup(0), MemoryKey::Workgroup(1), BUFFER] {
            accesses.visit(key, 0, 4, |_, _, cell| values.push(cell.value));
        }
        assert_eq!(values, [0, 0, 1]);
    }

    #[test]
    fn bytes_of_a_workgroup_are_unknown_until_they_are_filled_in() {
        let mut shadow = WorkgroupShadow::default();
        shadow.begin(4);
        let fill = |causes: &mut Vec<u32>| causes.resize(2, WorkgroupShadow::UNWRITTEN);
        shadow.causes(5, fill)[1] = NO_CAUSE;
        assert_eq!(shadow.causes(5, fill), [WorkgroupShadow::UNWRITTEN, NO_CAUSE]);
        assert_eq!(undefined_byte(&[NO_CAUSE, WorkgroupShadow::UNWRITTEN, 3]), Some((2, 3)));
        assert_eq!(undefined_byte(&[NO_CAUSE; 4]), None);
        shadow.begin(5);
        assert_eq!(shadow.causes(5, fill), [WorkgroupShadow::UNWRITTEN; 2]);
    }
}
