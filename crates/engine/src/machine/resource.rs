//! Buffers, images, samplers and acceleration structures, and the descriptors that name them.
//!
//! Resources are shared by all threads of a launch, so their memory is made of relaxed atomics:
//! plain loads and stores on every machine, and no undefined behaviour where a shader races.

use std::fmt;
use std::sync::Arc;

use crate::accel::Tlas;
use crate::machine::buffer::Buffer;
use crate::machine::device_memory::{DeviceMemory, STRUCTURE_HANDLE};
use crate::machine::image::Image;
use crate::machine::open_choices::OpenChoices;
use crate::machine::printed::{Printed, PrintedBytes};
use crate::machine::sampler::Sampler;
use anyhit_base::sorted::SortedMap;

/// Where a descriptor is bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Binding {
    /// `DescriptorSet`
    pub set: u32,
    /// `Binding`
    pub binding: u32,
}

/// The set number reserved for descriptor heaps.
const HEAP_SET: u32 = u32::MAX - 1;
/// The set number reserved for push-constant banks (`module::push_constant_bank`).
const BANK_SET: u32 = u32::MAX - 2;

impl Binding {
    /// The resource heap (`SPV_EXT_descriptor_heap`), whose array elements are its descriptors.
    pub const RESOURCE_HEAP: Self = Self { set: HEAP_SET, binding: 0 };
    /// The sampler heap.
    pub const SAMPLER_HEAP: Self = Self { set: HEAP_SET, binding: 1 };

    /// Returns true for a heap and for the data in one.
    pub const fn is_heap(self) -> bool {
        self.set == HEAP_SET
    }

    /// The binding of a push-constant bank other than bank 0 (`SPV_NV_push_constant_bank`).
    pub const fn push_constant_bank(bank: u32) -> Self {
        Self { set: BANK_SET, binding: bank }
    }

    /// The binding of the buffer with the data between the descriptors of this heap.
    #[must_use]
    pub const fn heap_data(self) -> Self {
        Self { set: self.set, binding: self.binding + 2 }
    }
}

/// In words: `set 0, binding 3`, or the name of a heap.
impl fmt::Display for Binding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::RESOURCE_HEAP => f.write_str("the resource heap"),
            Self::SAMPLER_HEAP => f.write_str("the sampler heap"),
            Self { set: HEAP_SET, binding: 2 } => f.write_str("the data in the resource heap"),
            Self { set: HEAP_SET, .. } => f.write_str("the data in the sampler heap"),
            Self { set: BANK_SET, binding } => write!(f, "bank {binding} of the push constants"),
            Self { set, binding } => write!(f, "set {set}, binding {binding}"),
        }
    }
}

/// What a binding's array element refers to.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Descriptor {
    /// A storage or uniform buffer.
    Buffer(Arc<Buffer>),
    /// A sampled or storage image, or a texel buffer.
    Image(Arc<Image>),
    /// A sampler.
    Sampler(Arc<Sampler>),
    /// A combined image sampler.
    ImageSampler(Arc<Image>, Arc<Sampler>),
    /// An acceleration structure.
    #[doc(hidden)]
    AccelerationStructure(Arc<Tlas>),
    /// Whichever of these the variable that reads it declares: where variables of several types
    /// share a binding (`VK_DESCRIPTOR_TYPE_MUTABLE_EXT`, and what its resource heap holds).
    Mutable(Arc<[Descriptor]>),
    /// An element of an array that nothing is bound to.
    Unbound,
}

impl Descriptor {
    /// The descriptors that variables of several types may find here: itself, where it is of one
    /// kind.
    #[doc(hidden)]
    pub fn kinds(&self) -> &[Self] {
        match self {
            Self::Mutable(kinds) => kinds,
            _ => std::slice::from_ref(self),
        }
    }

    /// A description of its kind; `None` for an unbound one.
    #[doc(hidden)]
    pub fn kind(&self) -> Option<&'static str> {
        Some(match self {
            Self::Buffer(_) => "a buffer",
            Self::Image(_) => "an image",
            Self::Sampler(_) => "a sampler",
            Self::ImageSampler(..) => "an image with a sampler",
            Self::AccelerationStructure(_) => "an acceleration structure",
            Self::Mutable(_) => "a descriptor of several kinds",
            Self::Unbound => return None,
        })
    }

    /// Adds what stands for a missing descriptor: it is all of an unbound one, and of another one
    /// the kinds that it lacks.
    fn complete(&mut self, stand_in: &Self) {
        if let Self::Unbound = self {
            self.clone_from(stand_in);
            return;
        }
        let kinds = self.kinds();
        let is_there = |new: &&Self| kinds.iter().any(|known| known.kind() == new.kind());
        let lacking: Vec<Self> = stand_in.kinds().iter().filter(|new| !is_there(new)).cloned().collect();
        if !lacking.is_empty() {
            *self = Self::Mutable(kinds.iter().cloned().chain(lacking).collect());
        }
    }

    /// What a variable of the shader refers to: the first descriptor that suits its type.
    #[doc(hidden)]
    #[inline]
    pub fn find<'a, T>(&'a self, suits: impl Fn(&'a Descriptor) -> Option<T>) -> Option<T> {
        self.kinds().iter().find_map(suits)
    }
}

/// How an access outside its buffer is handled.
///
/// Outside an image, both do the same: a store is discarded (Vulkan, "Image Writes"), and so is an
/// atomic instruction, which returns 0; a texel that is read, which is undefined without
/// `robustImageAccess`, is that of `robustImageAccess2`: zeros, but for 1 where the format has no
/// A.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MemoryPolicy {
    /// The access traps.
    #[default]
    Trap,
    /// `robustBufferAccess2`: of a load, scalars that lie outside a buffer are 0; what is stored
    /// there is dropped, atomic instructions do nothing and return 0. Device addresses, workgroup
    /// memory, arrays of variables and missing descriptors still trap: Vulkan's robustness does not
    /// reach them. (A null descriptor is none that is missing: [`Buffer::null`].)
    Robust,
}

/// A summary of what is bound at a binding, for messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BindingSummary {
    /// The binding.
    pub binding: Binding,
    /// The kinds of the bound elements, each once.
    pub kinds: Vec<&'static str>,
    /// How many elements there are.
    pub count: usize,
    /// The name of the first resource there, in its scene.
    pub name: Option<Arc<str>>,
}

/// The resources of a launch: descriptor sets, push constants and memory.
#[derive(Clone, Debug, Default)]
pub struct Resources {
    /// Descriptors by binding; the position is the array element.
    pub descriptors: SortedMap<Binding, Vec<Descriptor>>,
    /// What shaders find in the elements of a binding that nothing is bound to, where that is no
    /// mistake.
    pub stand_ins: SortedMap<Binding, Descriptor>,
    /// The names of resources in their scene, for messages.
    pub names: SortedMap<Binding, Arc<str>>,
    /// The bytes of the push constants.
    pub push_constants: Option<Arc<Buffer>>,
    /// Three words of a buffer, from which the host reads the size of a dispatch or launch
    /// (`VkDispatchIndirectCommand`, `VkTraceRaysIndirectCommandKHR`).
    pub indirect: Option<Arc<Buffer>>,
    /// The memory that shaders access through device addresses.
    pub memory: DeviceMemory,
    /// Collects what shaders print; without it printing does nothing.
    pub printed: Option<Arc<Printed>>,
    /// How much of that is kept.
    pub printed_bytes: PrintedBytes,
    /// How an access outside its buffer is handled.
    pub policy: MemoryPolicy,
    /// Whether an access outside its image traps all the same, so that whoever chooses the image
    /// learns that it is too small.
    pub traps_outside_images: bool,
    /// What of that which the specification leaves open is drawn; `None` where all of it is this
    /// crate's own choice.
    pub choices: Option<Arc<OpenChoices>>,
}

impl Resources {
    /// Binds a descriptor to the first array element of a binding.
    #[must_use]
    pub fn bind(mut self, set: u32, binding: u32, descriptor: Descriptor) -> Self {
        self.descriptors.insert(Binding { set, binding }, vec![descriptor]);
        self
    }

    /// Binds a descriptor to an array element of a binding; elements between stay unbound.
    pub fn insert(&mut self, binding: Binding, element: u32, descriptor: Descriptor) {
        let elements = self.descriptors.entry(binding).or_default();
        let count = element as usize + 1;
        if elements.len() < count {
            elements.resize(count, Descriptor::Unbound);
        }
        elements[element as usize] = descriptor;
    }

    /// Binds another acceleration structure wherever one is bound.
    pub fn replace_structure(&mut self, old: &Arc<Tlas>, new: &Arc<Tlas>) {
        for descriptor in self.descriptors.values_mut().flatten() {
            if matches!(descriptor, Descriptor::AccelerationStructure(bound) if Arc::ptr_eq(bound, old)) {
                *descriptor = Descriptor::AccelerationStructure(new.clone());
            }
        }
        self.memory.replace_structure(old, new);
    }

    /// The buffer at a binding's first array element.
    pub fn buffer(&self, set: u32, binding: u32) -> Option<&Arc<Buffer>> {
        match self.descriptors.get(&Binding { set, binding })?.first()? {
            Descriptor::Buffer(buffer) => Some(buffer),
            _ => None,
        }
    }

    /// The image at a binding's first array element.
    pub fn image(&self, set: u32, binding: u32) -> Option<&Arc<Image>> {
        match self.descriptors.get(&Binding { set, binding })?.first()? {
            Descriptor::Image(image) | Descriptor::ImageSampler(image, _) => Some(image),
            _ => None,
        }
    }

    fn bound(&self) -> Arc<[BindingSummary]> {
        let bound = self.descriptors.iter().filter_map(|(&binding, elements)| {
            let mut kinds: Vec<&str> = Vec::new();
            for kind in elements.iter().flat_map(Descriptor::kinds).filter_map(Descriptor::kind) {
                if !kinds.contains(&kind) {
                    kinds.push(kind);
                }
            }
            let name = self.names.get(&binding).cloned();
            (!kinds.is_empty()).then_some(BindingSummary { binding, kinds, count: elements.len(), name })
        });
        bound.collect()
    }

    /// The descriptors of a program's slots, in the order of the slots.
    pub fn bindings(&self, slots: impl IntoIterator<Item = Binding>) -> Bindings {
        let mut stand_ins = vec![None];
        let descriptors = |binding| {
            let mut elements = self.descriptors.get(&binding).cloned().unwrap_or_default();
            let stand_in = self.stand_ins.get(&binding);
            if let Some(stand_in) = stand_in {
                elements.iter_mut().for_each(|one| one.complete(stand_in));
            }
            stand_ins.push(stand_in.cloned());
            elements
        };
        let slots = std::iter::once(Vec::new()).chain(slots.into_iter().map(descriptors)).collect();
        Bindings {
            bound: self.bound(),
            slots,
            stand_ins,
            push_constants: self.push_constants.clone(),
            memory: self.memory.clone(),
            printed: self.printed.clone(),
            printed_bytes: self.printed_bytes,
            policy: self.policy,
            traps_outside_images: self.traps_outside_images,
            choices: self.choices.clone(),
        }
    }
}

/// Bits of a descriptor handle that hold the array element; the bits above hold the slot, counted
/// from 1: handles with slot bits 0 are null, whatever their element.
pub const ELEMENT_BITS: u32 = 20;

/// The number of slots that a program may have: greater handles stand for memory without
/// descriptor.
pub const MAX_SLOTS: usize = (1 << (32 - ELEMENT_BITS)) - 2;

/// The descriptors of one program, found by handle: slot above, array element below
/// [`ELEMENT_BITS`].
#[derive(Clone, Debug, Default)]
pub struct Bindings {
    /// Descriptors by the upper bits of handles, those of the slot; the first entry, of null, is
    /// empty.
    slots: Vec<Vec<Descriptor>>,
    /// By the same bits: what stands for the elements behind the last one that is bound.
    stand_ins: Vec<Option<Descriptor>>,
    /// Everything that is bound, used or not.
    pub bound: Arc<[BindingSummary]>,
    /// The push constants.
    pub push_constants: Option<Arc<Buffer>>,
    /// The memory that device addresses refer to.
    pub memory: DeviceMemory,
    /// Collects what shaders print.
    pub printed: Option<Arc<Printed>>,
    /// How much of what shaders print is kept.
    pub printed_bytes: PrintedBytes,
    /// How an access outside its buffer is handled.
    pub policy: MemoryPolicy,
    /// Whether an access outside its image traps all the same, so that whoever chooses the image
    /// learns that it is too small.
    pub traps_outside_images: bool,
    /// What of that which the specification leaves open is drawn; `None` where all of it is this
    /// crate's own choice.
    pub choices: Option<Arc<OpenChoices>>,
}

impl Bindings {
    /// Whether accesses outside their buffer do not trap.
    pub fn is_robust(&self) -> bool {
        self.policy == MemoryPolicy::Robust
    }

    /// The handle of a slot's array element.
    pub fn handle(slot: u32, element: u32) -> u32 {
        Self::element_handle((slot + 1) << ELEMENT_BITS, element)
    }

    /// The handle of an array element, from that of the slot's first one.
    pub fn element_handle(first: u32, element: u32) -> u32 {
        first | element.min((1 << ELEMENT_BITS) - 1)
    }

    /// The slot and the array element of a handle; `None` for null. The slot need not exist.
    pub fn slot_of(handle: u32) -> Option<(usize, u32)> {
        let slot = (handle >> ELEMENT_BITS).checked_sub(1)?;
        Some((slot as usize, handle & ((1 << ELEMENT_BITS) - 1)))
    }

    /// The descriptor with a handle.
    #[inline]
    pub fn descriptor(&self, handle: u32) -> Option<&Descriptor> {
        let (slot, element) = (handle >> ELEMENT_BITS, handle & ((1 << ELEMENT_BITS) - 1));
        let found = self.slots.get(slot as usize)?.get(element as usize);
        found.or_else(|| self.stand_in(slot as usize))
    }

    #[cold]
    fn stand_in(&self, slot: usize) -> Option<&Descriptor> {
        self.stand_ins.get(slot)?.as_ref()
    }

    /// The handle of a buffer that a slot holds.
    pub fn handle_of(&self, buffer: &Buffer) -> Option<u32> {
        let is_it = |kind: &Descriptor| matches!(kind, Descriptor::Buffer(found) if found.is_same(buffer));
        self.slots.iter().skip(1).enumerate().find_map(|(slot, elements)| {
            let element =
                elements.iter().position(|one| one.find(|kind| is_it(kind).then_some(())).is_some())?;
            Some(Self::handle(slot as u32, element as u32))
        })
    }

    /// The buffer with a handle.
    #[inline]
    pub fn buffer(&self, handle: u32) -> Option<&Buffer> {
        self.descriptor(handle)?.find(|descriptor| match descriptor {
            Descriptor::Buffer(buffer) => Some(&**buffer),
            _ => None,
        })
    }

    /// The acceleration structure that a value of two words refers to: a descriptor's handle below
    /// [`STRUCTURE_HANDLE`], else a device address. 0 is the null structure, which every ray
    /// misses.
    #[inline]
    pub fn acceleration_structure(&self, words: [u32; 2]) -> Option<&Arc<Tlas>> {
        match words {
            [0, 0] => Some(Tlas::empty()),
            [handle, STRUCTURE_HANDLE] => self.tlas(handle),
            [low, high] => self.memory.structure(u64::from(low) | u64::from(high) << 32),
        }
    }

    /// The acceleration structure with a handle.
    fn tlas(&self, handle: u32) -> Option<&Arc<Tlas>> {
        self.descriptor(handle)?.find(|descriptor| match descriptor {
            Descriptor::AccelerationStructure(tlas) => Some(tlas),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stand_ins_fill_what_nothing_is_bound_to() {
        let (at, other) = (Binding { set: 0, binding: 0 }, Binding { set: 0, binding: 1 });
        let mut resources = Resources::default();
        resources.insert(at, 2, Descriptor::Buffer(Buffer::zeroed(4)));
        resources.stand_ins.insert(at, Descriptor::Buffer(Buffer::null()));
        let bindings = resources.bindings([at, other]);
        let null = |slot, element| bindings.buffer(Bindings::handle(slot, element)).map(Buffer::is_null);
        assert_eq!(
            [0, 1, 2, 3, 1000].map(|element| null(0, element)),
            [true, true, false, true, true].map(Some)
        );
        assert_eq!(null(1, 0), None);
        assert!(bindings.descriptor(0).is_none() && bindings.descriptor(u32::MAX).is_none());
    }

    #[test]
    fn stand_ins_add_the_kinds_that_a_shared_binding_lacks() {
        let at = Binding { set: 0, binding: 0 };
        let buffer = Buffer::zeroed(4);
        let mut resources = Resources::default().bind(0, 0, Descriptor::Buffer(buffer.clone()));
        let kinds =
            [Descriptor::Buffer(Buffer::null()), Descriptor::AccelerationStructure(Tlas::empty().clone())];
        resources.stand_ins.insert(at, Descriptor::Mutable(kinds.into()));
        let bindings = resources.bindings([at]);
        let handle = Bindings::handle(0, 0);
        assert!(bindings.buffer(handle).is_some_and(|found| found.is_same(&buffer)));
        assert!(bindings.acceleration_structure([handle, STRUCTURE_HANDLE]).is_some());
        assert_eq!(bindings.bound[0].kinds, ["a buffer"]);
    }

    #[test]
    fn no_descriptor_has_the_handle_of_null() {
        let resources = Resources::default().bind(0, 0, Descriptor::Buffer(Buffer::zeroed(4)));
        let bindings = resources.bindings([Binding { set: 0, binding: 0 }]);
        assert!(bindings.buffer(Bindings::handle(0, 0)).is_some());
        assert!([0, 1, 0xF_FFFF].iter().all(|&null| bindings.descriptor(null).is_none()));
        assert_eq!(Bindings::slot_of(0xF_FFFF), None);
        assert_eq!(Bindings::slot_of(Bindings::handle(3, 5)), Some((3, 5)));
    }

    #[test]
    fn scalars_of_every_width_and_alignment() {
        let buffer = Buffer::new(&[0, 1, 2, 3, 4, 5, 6]);
        assert_eq!(buffer.load(0, 32), Some(0x0302_0100));
        assert_eq!(buffer.load(3, 16), Some(0x0403));
        assert_eq!(buffer.load(6, 8), Some(6));
        assert_eq!(buffer.load(6, 16), None);
        assert_eq!(buffer.load(u64::MAX, 32), None);
        assert_eq!(buffer.store(3, 16, 0xBBAA), Some(()));
        assert_eq!(buffer.bytes(), [0, 1, 2, 0xAA, 0xBB, 5, 6]);
        assert_eq!(buffer.store(4, 32, 0), None);
    }

    #[test]
    fn views_are_bytes_of_one_memory() {
        let whole = Buffer::new(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
        let view = whole.view(4, 5, "arena").unwrap();
        assert_eq!((view.offset(), view.size(), view.words().len()), (4, 5, 2));
        assert_eq!(view.bytes(), [4, 5, 6, 7, 8]);
        assert_eq!((view.load(4, 8), view.load(4, 16), view.load(1, 32)), (Some(8), None, Some(0x0807_0605)));
        // What is stored through one is loaded through the other, and nothing beside it changes.
        view.store(3, 16, 0xBBAA).unwrap();
        assert_eq!(whole.bytes(), [0, 1, 2, 3, 4, 5, 6, 0xAA, 0xBB, 9, 10]);
        whole.store(4, 32, u32::MAX).unwrap();
        assert_eq!(view.bytes(), [0xFF, 0xFF, 0xFF, 0xFF, 0xBB]);
        assert_eq!(view.memory_id(), whole.memory_id());
        assert!(!view.is_same(&whole) && view.is_same(&whole.view(4, 5, "arena").unwrap()));
        assert_ne!(Buffer::zeroed(0).memory_id(), Buffer::zeroed(0).memory_id());
        // Beyond the end, or between words.
        assert!(
            [(4, 8), (12, 0), (2, 1), (8, u64::MAX)]
                .iter()
                .all(|&(at, size)| { whole.view(at, size, "arena").is_none() })
        );
    }

    #[test]
    fn a_view_of_a_view_begins_at_both_offsets() {
        let whole = Buffer::zeroed(64);
        let inner = whole.view(16, 32, "a").unwrap().view(8, 4, "b").unwrap();
        assert_eq!((inner.offset(), inner.size()), (24, 4));
        assert!(whole.view(16, 32, "a").unwrap().view(28, 8, "b").is_none());
    }
}
