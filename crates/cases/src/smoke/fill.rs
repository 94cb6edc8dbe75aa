//! Made-up values for memory.

use std::collections::HashMap;
use std::sync::Arc;

use anyhit_base::error::{ErrorKind, Result};
use anyhit_base::input::InputLimit;
use anyhit_base::sorted::SortedMap;
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::{Buffer, DeviceMemory};
use anyhit_engine::math::random::Random;
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::reflect::{Layout, Rules};

/// Elements that a runtime array, or memory behind an address, is given at least.
const ELEMENTS: usize = 1024;
/// Bytes that one filled buffer may have beyond what its type fixes, at scale 1 and at any.
const MOST_BYTES: [usize; 2] = [1 << 20, 1 << 24];
/// Bytes of one buffer that are given values one by one. Behind them the first elements of each
/// array are, and all others repeat these.
const MOST_FILLED: usize = 1 << 17;
/// Those first elements: a multiple of three, as indices of triangles lie in threes.
const FIRST_ELEMENTS: usize = 6;
/// Parts of one buffer that are given values one by one: more than the bytes above have, unless
/// parts lie on each other or have no bytes at all, or arrays lie in arrays many times over.
const MOST_PARTS: u32 = 1 << 19;
/// How many addresses may lead from one to the next.
const MOST_STEPS: usize = 6;
/// Large enough to end loops over bounces, small enough to lie in a runtime array.
const LARGE: u64 = 1000;

/// What integers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Integers {
    /// 0, 1, 2 or 3; three in a row differ, so that no triangle has an index twice.
    Small,
    /// Small integers as above, but one in eight is 0, and another one 1000.
    Mixed,
    /// All this number.
    All(u64),
}

/// What floats are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Floats {
    /// Uniform in [0, 1).
    Unit,
    /// Uniform in [-4, 4).
    Signed,
    /// All 0: indices that are kept as the bits of floats are 0, too.
    Zero,
    /// All 1.
    One,
}

/// What integers of 64 bits, and pairs of 32, are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WideIntegers {
    /// Small numbers, but where an address is known to be taken from.
    Numbers,
    /// Device addresses.
    Addresses,
    /// As with [`WideIntegers::Numbers`], after addresses were tried.
    Known,
}

/// How much memory there is where the shader's types leave it open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FillExtent {
    /// Invocations along each axis: images have a texel for each.
    pub invocations: [u32; 3],
    /// How much larger than at first they are.
    pub scale: ResourceScale,
}

/// By how much resources of each kind are larger than at first: 1, or more where that was too
/// little.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ResourceScale {
    /// Runtime arrays in buffers and behind addresses.
    pub buffers: u32,
    /// Runtime arrays of descriptors.
    pub descriptors: u32,
    /// The sides of images, and texel buffers.
    pub images: u32,
    /// The layers of images.
    pub layers: u32,
    /// The samples of images.
    pub samples: u32,
}

impl Default for ResourceScale {
    fn default() -> Self {
        Self { buffers: 1, descriptors: 1, images: 1, layers: 1, samples: 1 }
    }
}

impl FillExtent {
    /// Elements of this many bytes that runtime arrays of buffers have.
    pub(super) fn elements(&self, stride: usize) -> usize {
        self.elements_at(self.scale.buffers, stride)
    }

    /// Texels that texel buffers have.
    pub(super) fn texels(&self) -> usize {
        self.elements_at(self.scale.images, 1024)
    }

    fn elements_at(&self, scale: u32, stride: usize) -> usize {
        let sides = self.invocations.iter().map(|&side| u64::from(side));
        let invocations = sides.fold(1, u64::saturating_mul);
        let scale = scale as usize;
        let wanted = ELEMENTS.max(invocations.min(1 << 20) as usize).saturating_mul(scale);
        let most = MOST_BYTES[0].saturating_mul(scale).min(MOST_BYTES[1]);
        (most / stride.max(1)).clamp(1, wanted)
    }
}

/// Numbers for everything that is no address: each follows from the seed, from where it stands (its
/// root: a binding's element, say) and from its place there alone, whatever else is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct ValueSource {
    /// The seed.
    pub seed: u64,
    /// What integers are.
    pub integers: Integers,
    /// What floats are.
    pub floats: Floats,
}

impl ValueSource {
    /// A random number of a place.
    fn bits(&self, root: u64, at: u64) -> u64 {
        mix(mix(self.seed, root), at)
    }

    /// The integer at a place, counted in integers of its size.
    pub(super) fn integer(&self, root: u64, at: u64) -> u64 {
        // Steps of 1 and 2 modulo 4, never two of 2 one behind the other: three in a row differ.
        let small = || {
            let random = self.bits(root, u64::MAX);
            let (phase, slope) = (random & 3, random >> 48);
            at.wrapping_add(phase).wrapping_add((at / 3).wrapping_mul(slope) >> 16) & 3
        };
        match self.integers {
            Integers::Small => small(),
            Integers::Mixed => match self.bits(root, at) >> 61 {
                0 => 0,
                1 => LARGE,
                _ => small(),
            },
            Integers::All(value) => value,
        }
    }

    /// The float at a place.
    pub(super) fn float(&self, root: u64, at: u64) -> f32 {
        // A multiple of 2^-24 in [0, 1).
        let unit = (self.bits(root, at) >> 40) as f32 / (1 << 24) as f32;
        match self.floats {
            Floats::Unit => unit,
            Floats::Signed => unit * 8.0 - 4.0,
            Floats::Zero => 0.0,
            Floats::One => 1.0,
        }
    }

    /// A number as bits of a float type.
    pub(super) fn float_bits(ty: &Type, value: f32) -> u64 {
        ty.float_format().map_or(0, |format| format.round(value.into()))
    }
}

/// What lies behind an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FillContent {
    /// Unknown: no run has reached it yet.
    Unknown,
    /// What a pointer of this type points to, many times.
    Pointer(TypeId),
    /// An acceleration structure.
    Structure,
}

/// Identifies a place that addresses are taken from: a member of a block by its offset, whatever
/// the array elements on the way.
pub(super) type PlaceId = u64;

/// A range of device memory.
#[derive(Clone, Debug)]
struct Region {
    place: PlaceId,
    content: FillContent,
    /// The pointer types that lead here.
    steps: Vec<TypeId>,
}

/// Which values memory is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MadeUpValues {
    /// What numbers are.
    pub numbers: ValueSource,
    /// What could be an address.
    pub wide: WideIntegers,
    /// How large things are.
    pub extent: FillExtent,
}

/// How much memory is made up for one launch, held against the module's limits.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MadeUpBytes(u64);

impl MadeUpBytes {
    /// Bytes so far.
    pub(super) fn sum(self) -> u64 {
        self.0
    }

    /// Adds a resource before it is made.
    ///
    /// # Errors
    /// `UnsupportedModule` where it is too large by itself ([`InputLimit::SmokeResourceBytes`]), or
    /// with all others ([`InputLimit::SmokeLaunchBytes`]).
    pub(super) fn add(&mut self, module: &Module, bytes: u64) -> Result<()> {
        module.limits.check(InputLimit::SmokeResourceBytes, bytes, ErrorKind::UnsupportedModule)?;
        self.0 = self.0.saturating_add(bytes);
        module.limits.check(InputLimit::SmokeLaunchBytes, self.0, ErrorKind::UnsupportedModule)
    }
}

/// Bytes of a buffer, to be given values.
pub(super) struct FilledBytes {
    bytes: Vec<u8>,
    size: usize,
}

impl FilledBytes {
    fn zeroed(size: usize) -> Self {
        Self { bytes: vec![0; size], size }
    }

    /// All bytes.
    pub(super) fn whole(self) -> Vec<u8> {
        self.bytes
    }

    /// A buffer of them.
    pub(super) fn buffer(&self) -> Arc<Buffer> {
        Buffer::with_size(&self.bytes, self.size)
    }

    fn put(&mut self, offset: usize, size: usize, value: u64) {
        let end = offset.saturating_add(size.min(8)).min(self.size);
        if let Some(to) = self.bytes.get_mut(offset..end) {
            to.copy_from_slice(&value.to_le_bytes()[..to.len()]);
        }
    }

    /// Repeats the bytes from an offset on, of so many elements, up to the end of an array.
    fn repeat(&mut self, offset: usize, stride: usize, given: usize, length: usize) {
        let end = length.saturating_mul(stride).saturating_add(offset).min(self.size);
        let mut done = given.saturating_mul(stride);
        let whole = end.saturating_sub(offset);
        while done > 0 && done < whole {
            let step = done.min(whole - done);
            self.bytes.copy_within(offset..offset + step, offset + done);
            done += step;
        }
    }
}

/// Fills memory by its types, and makes the memory that its addresses lead to.
pub(super) struct Filler<'a> {
    module: &'a Module,
    numbers: ValueSource,
    wide: WideIntegers,
    extent: FillExtent,
    known: &'a SortedMap<PlaceId, FillContent>,
    regions: Vec<Region>,
    by_place: HashMap<PlaceId, usize>,
    steps: Vec<TypeId>,
    root: u64,
    /// Parts of the buffer at hand that may still be given values.
    parts: u32,
    /// What everything that was made so far takes.
    pub made: MadeUpBytes,
}

impl<'a> Filler<'a> {
    /// A filler for the values of a module; `known` says what is behind addresses.
    pub(super) fn new(
        module: &'a Module,
        numbers: ValueSource,
        wide: WideIntegers,
        extent: FillExtent,
        known: &'a SortedMap<PlaceId, FillContent>,
    ) -> Self {
        let (regions, by_place, steps) = (Vec::new(), HashMap::new(), Vec::new());
        let (root, parts, made) = (0, MOST_PARTS, MadeUpBytes::default());
        Self { module, numbers, wide, extent, known, regions, by_place, steps, root, parts, made }
    }

    /// The bytes of a block; `root` distinguishes it from others.
    ///
    /// # Errors
    /// As [`MadeUpBytes::add`].
    pub(super) fn block(&mut self, ty: TypeId, root: u64) -> Result<FilledBytes> {
        let layout = Layout::new(self.module, ty, Rules::Explicit);
        let size = match layout.runtime_stride() {
            Some((offset, stride)) => {
                self.extent.elements(stride).saturating_mul(stride).saturating_add(offset)
            }
            None => layout.size(),
        };
        self.filled(layout, size, root)
    }

    /// The words of a payload, callable data or hit attributes.
    ///
    /// # Errors
    /// As [`MadeUpBytes::add`].
    pub(super) fn words(&mut self, ty: TypeId, root: u64) -> Result<Vec<u32>> {
        let layout = Layout::new(self.module, ty, Rules::Packed);
        let bytes = self.filled(layout, layout.size(), root)?.whole();
        Ok(bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect())
    }

    fn filled(&mut self, layout: Layout<'_>, size: usize, root: u64) -> Result<FilledBytes> {
        self.made.add(self.module, size as u64)?;
        let mut bytes = FilledBytes::zeroed(size);
        (self.root, self.parts) = (root, MOST_PARTS);
        self.fill(layout, 0, mix(0, root), &mut bytes);
        Ok(bytes)
    }

    /// Makes the device memory that the addresses given so far lead to. Returns, beside it, the
    /// places by region whose addresses lead nowhere yet, and the bytes of all that was made.
    ///
    /// # Errors
    /// As [`MadeUpBytes::add`], and what a structure may report.
    pub(super) fn device_memory(
        mut self,
        tlas: &dyn Fn() -> Result<Arc<Tlas>>,
    ) -> Result<(DeviceMemory, Vec<Option<PlaceId>>, u64)> {
        let mut memory = DeviceMemory::default();
        let mut next = 0;
        while let Some(region) = self.regions.get(next).cloned() {
            let address = match region.content {
                FillContent::Unknown => memory.add_buffer(&Buffer::zeroed(0)),
                FillContent::Structure => memory.add_structure(&tlas()?),
                FillContent::Pointer(pointer) => {
                    self.steps = region.steps;
                    memory.add_buffer(&self.pointees(pointer, region.place)?.buffer())
                }
            };
            assert_eq!(address, address_of(next), "bug in anyhit: the address belongs to another region");
            next += 1;
        }
        let unknown = |region: &Region| (region.content == FillContent::Unknown).then_some(region.place);
        Ok((memory, self.regions.iter().map(unknown).collect(), self.made.sum()))
    }

    /// What a pointer points to, several times one behind the other.
    fn pointees(&mut self, pointer: TypeId, place: PlaceId) -> Result<FilledBytes> {
        let Type::Pointer { pointee: Some(pointee), stride, .. } = *self.module.ty(pointer) else {
            return Ok(FilledBytes::zeroed(0));
        };
        let layout = Layout::new(self.module, pointee, Rules::Explicit);
        if layout.runtime_stride().is_some() {
            return self.block(pointee, place);
        }
        let size = layout.size();
        let stride = stride.map_or(size, |stride| stride as usize).max(1);
        let count = self.extent.elements(stride);
        let size = (count - 1).saturating_mul(stride).saturating_add(size);
        self.made.add(self.module, size as u64)?;
        let mut bytes = FilledBytes::zeroed(size);
        (self.root, self.parts) = (place, MOST_PARTS);
        self.array(layout, count, stride, 0, mix(0, place), &mut bytes);
        Ok(bytes)
    }

    fn fill(&mut self, layout: Layout<'_>, offset: usize, place: PlaceId, out: &mut FilledBytes) {
        if offset >= out.size || self.parts == 0 {
            return;
        }
        self.parts -= 1;
        let module = self.module;
        match module.ty(layout.ty) {
            Type::Bool => {
                let value = self.numbers.integer(self.root, offset as u64 / 4) & 1;
                out.put(offset, 4, value);
            }
            Type::Int { width, .. } => {
                let address = if *width == 64 { self.address_if_wanted(place) } else { None };
                let at = (offset / (*width as usize / 8).max(1)) as u64;
                let value = address.unwrap_or_else(|| self.numbers.integer(self.root, at));
                out.put(offset, layout.size(), value);
            }
            ty @ Type::Float { .. } => {
                let value = self.numbers.float(self.root, offset as u64);
                let value = ValueSource::float_bits(ty, value);
                out.put(offset, layout.size(), value);
            }
            Type::Vector { component, count } => {
                let pair = *count == 2 && matches!(module.ty(*component), Type::Int { width: 32, .. });
                if pair && let Some(address) = self.address_if_wanted(place) {
                    return out.put(offset, 8, address);
                }
                let part = layout.part(*component);
                for index in 0..*count as usize {
                    let at = index * part.size();
                    self.fill(part, offset.saturating_add(at), mix(place, at as u64), out);
                }
            }
            Type::Matrix { column, count } => self.identity(layout, *column, *count as usize, offset, out),
            Type::Array { element, length, .. } => {
                let length = array_length(module, *length);
                self.array(layout.part(*element), length, layout.stride(), offset, place, out);
            }
            Type::RuntimeArray { element, .. } => {
                let stride = layout.stride().max(1);
                let length = (out.size - offset) / stride;
                self.array(layout.part(*element), length, stride, offset, place, out);
            }
            Type::Struct { .. } => {
                for (at, part) in layout.members() {
                    self.fill(part, offset.saturating_add(at), mix(place, at as u64), out);
                }
            }
            Type::Pointer { .. } => {
                let address = self.pointer(layout.ty, place);
                out.put(offset, 8, address);
            }
            _ => {}
        }
    }

    fn array(
        &mut self,
        part: Layout<'_>,
        length: usize,
        stride: usize,
        offset: usize,
        place: PlaceId,
        out: &mut FilledBytes,
    ) {
        for index in 0..length {
            let at = index.saturating_mul(stride).saturating_add(offset);
            if at >= MOST_FILLED && index >= FIRST_ELEMENTS && index.is_multiple_of(3) {
                return out.repeat(offset, stride, index, length);
            }
            if at >= out.size || self.parts == 0 {
                return;
            }
            // All elements lead to the same memory: one place.
            self.fill(part, at, place, out);
        }
    }

    /// The identity, or as much of it as the matrix has columns and rows.
    fn identity(
        &mut self,
        layout: Layout<'_>,
        column: TypeId,
        columns: usize,
        offset: usize,
        out: &mut FilledBytes,
    ) {
        let Type::Vector { component, count } = *self.module.ty(column) else { return };
        let float = self.module.ty(component);
        let scalar = layout.part(component).size();
        let end = out.size;
        for at in 0..columns {
            for row in 0..count as usize {
                if self.parts == 0 {
                    return;
                }
                // A column may be as long as a buffer, and there may be as many on each other.
                self.parts -= 1;
                let place = match layout.matrix.filter(|_| layout.rules == Rules::Explicit) {
                    Some(matrix) if matrix.row_major => {
                        row.saturating_mul(matrix.stride as usize).saturating_add(at * scalar)
                    }
                    Some(matrix) => at.saturating_mul(matrix.stride as usize).saturating_add(row * scalar),
                    None => (at * count as usize + row) * scalar,
                };
                let place = offset.saturating_add(place);
                // Further rows lie further behind.
                if place >= end {
                    break;
                }
                let value = ValueSource::float_bits(float, f32::from(u8::from(at == row)));
                out.put(place, scalar, value);
            }
        }
    }

    /// The address for a number that may be meant as one.
    fn address_if_wanted(&mut self, place: PlaceId) -> Option<u64> {
        let known = self.known.get(&place).copied();
        if self.steps.len() >= MOST_STEPS || known.is_none() && self.wide != WideIntegers::Addresses {
            return None;
        }
        let content = known.unwrap_or(FillContent::Unknown);
        let mut steps = self.steps.clone();
        if let FillContent::Pointer(pointer) = content {
            steps.push(pointer);
        }
        Some(self.region(place, content, steps))
    }

    /// The address of what a pointer of a type points to: null where it is the third of its kind in
    /// a row, so that lists end.
    fn pointer(&mut self, pointer: TypeId, place: PlaceId) -> u64 {
        let before = self.steps.iter().filter(|known| **known == pointer).count();
        if before >= 2 || self.steps.len() >= MOST_STEPS {
            return 0;
        }
        let steps = self.steps.iter().copied().chain([pointer]).collect();
        self.region(place, FillContent::Pointer(pointer), steps)
    }

    fn region(&mut self, place: PlaceId, content: FillContent, steps: Vec<TypeId>) -> u64 {
        let next = self.regions.len();
        // There is one structure, which has one address, wherever it is taken from.
        let one = |region: &Region| content == FillContent::Structure && region.content == content;
        let first = self.regions.iter().position(one).unwrap_or(next);
        let index = *self.by_place.entry(place).or_insert(first);
        if index == next {
            self.regions.push(Region { place, content, steps });
        }
        address_of(index)
    }
}

/// The address of the region with an index: [`DeviceMemory`] gives them out in order, and none here
/// needs more than one.
fn address_of(index: usize) -> u64 {
    (index as u64 + 1) << 32
}

/// The index of the region that an address lies in.
pub(super) fn region_of(address: u64) -> Option<usize> {
    usize::try_from(address >> 32).ok()?.checked_sub(1)
}

/// A number for a part of a place.
pub(super) fn mix(place: PlaceId, part: u64) -> PlaceId {
    Random::new(place ^ part.wrapping_mul(0xD6E8_FEB8_6659_FD93).wrapping_add(1)).bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_repeats_its_first_elements_up_to_its_end() {
        let mut bytes = FilledBytes { bytes: (1..=30).collect(), size: 30 };
        // Two elements of three bytes, repeated up to the end of seven.
        bytes.repeat(2, 3, 2, 7);
        let six = [3, 4, 5, 6, 7, 8];
        let wanted = [&[1, 2][..], &six, &six, &six, &six[..3], &[24, 25, 26, 27, 28, 29, 30]].concat();
        assert_eq!(bytes.bytes, wanted);
        // The buffer ends before the array does.
        bytes.repeat(20, 4, 1, 9);
        assert_eq!(bytes.bytes[20..], [3, 4, 5, 24, 3, 4, 5, 24, 3, 4]);
    }

    #[test]
    fn three_small_integers_in_a_row_differ() {
        let mut seen = [0; 4];
        for root in 0..200 {
            let numbers = ValueSource { seed: root / 7, integers: Integers::Small, floats: Floats::Unit };
            let row: Vec<u64> = (0..300).map(|at| numbers.integer(root, at)).collect();
            for three in row.windows(3) {
                assert!(three[0] != three[1] && three[1] != three[2] && three[0] != three[2], "{row:?}");
            }
            // One member of a struct of four integers is not the same in each element of an array.
            let member: Vec<u64> = row.iter().copied().step_by(4).collect();
            seen[(0..4).filter(|value| member.contains(value)).count() - 1] += 1;
        }
        // A slope below 2^-7 or so, one in a hundred, leaves a member the same.
        assert!(seen[0] < 10 && seen[3] > 150, "{seen:?}");
    }

    #[test]
    fn large_integers_and_zeros_stand_among_small_ones() {
        let numbers = ValueSource { seed: 1, integers: Integers::Mixed, floats: Floats::Signed };
        let row: Vec<u64> = (0..8000).map(|at| numbers.integer(5, at)).collect();
        let count = |wanted: u64| row.iter().filter(|value| **value == wanted).count();
        // 1/8 are 1000; 1/8 and a quarter of the other 6/8 are 0. Four standard deviations are 120
        // and 165.
        assert!(count(1000).abs_diff(1000) < 120 && count(0).abs_diff(2500) < 175, "{}", count(0));
        let floats: Vec<f32> = (0..1000).map(|at| numbers.float(5, at)).collect();
        assert!(floats.iter().all(|float| (-4.0..4.0).contains(float)));
        assert!(floats.iter().any(|float| *float < -2.0) && floats.iter().any(|float| *float > 2.0));
    }
}
