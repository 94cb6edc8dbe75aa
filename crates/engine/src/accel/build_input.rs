//! Geometry as an acceleration structure build reads it: formats, strides, index types and ranges.
//!
//! The rules are Vulkan's (`VkAccelerationStructureGeometry*Data*`,
//! `VkAccelerationStructureBuildRangeInfoKHR`): with indices, `first_vertex` is added to each
//! before vertex and radius are fetched, and `primitive_offset` moves the indices; without,
//! vertices and radii begin at `primitive_offset + stride * first_vertex` of their buffers. A
//! stride of 0 makes all elements the same. Numbers are widened to `f32` exactly, but for
//! normalised ones, which are rounded once.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::accel::element_format::word;
use crate::accel::geometry_data::{EndCaps, GeometryData, Indexing};
use crate::accel::strided::StridedLayout;
use crate::math::array;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::threads;

pub use crate::accel::element_format::{IndexType, RadiusFormat, VertexFormat, snorm16};
pub use crate::accel::strided::Strided;

/// `VkAccelerationStructureBuildRangeInfoKHR`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BuildRange {
    /// `primitiveCount`; `None` takes all that the indices (or, without them, the vertices) make.
    pub primitive_count: Option<u32>,
    /// `primitiveOffset`, in bytes.
    pub primitive_offset: u32,
    /// `firstVertex`
    pub first_vertex: u32,
}

/// The buffers of one geometry.
#[derive(Clone, Copy, Debug)]
pub struct BuildInput<'a> {
    /// `vertexData`, `vertexStride`
    pub vertices: Strided<'a>,
    /// `vertexFormat`
    pub vertex_format: VertexFormat,
    /// `indexData`, `indexStride`, `indexType`
    pub indices: Option<(Strided<'a>, IndexType)>,
    /// The range.
    pub range: BuildRange,
}

/// The VUIDs of the rules for one kind of geometry.
struct Vuids {
    stride: &'static str,
    index_type: &'static str,
}

const TRIANGLES: Vuids = Vuids {
    stride: "VUID-VkAccelerationStructureGeometryTrianglesDataKHR-vertexStride-03735",
    index_type: "VUID-VkAccelerationStructureGeometryTrianglesDataKHR-indexType-03798",
};
const SPHERES: Vuids = Vuids {
    stride: "VUID-VkAccelerationStructureGeometrySpheresDataNV-vertexStride-10431",
    index_type: "VUID-VkAccelerationStructureGeometrySpheresDataNV-indexData-10437",
};
const LINEAR_SWEPT_SPHERES: Vuids = Vuids {
    stride: "VUID-VkAccelerationStructureGeometryLinearSweptSpheresDataNV-vertexStride-10421",
    index_type: "VUID-VkAccelerationStructureGeometryLinearSweptSpheresDataNV-indexData-10428",
};

/// How much a build makes of its input, known before anything is decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DecodedSize {
    /// The primitives.
    pub primitives: u64,
    /// The most bytes that are held while they are decoded, the input not counted.
    pub bytes: u64,
}

impl DecodedSize {
    /// Primitives of `entries` each, which name `vertices` each.
    fn of(primitives: u64, entries: u64, vertices: u64) -> Self {
        // An entry is a number and an index. A vertex is a number, a point and a radius.
        let bytes = primitives.saturating_mul(12 * entries + 24 * vertices);
        Self { primitives, bytes }
    }
}

/// Where the entries of a geometry's primitives are: an entry names a vertex.
struct Entries<'a> {
    /// The indices, where there are any; without, each entry names the next vertex.
    indices: Option<(StridedLayout, &'a [u8], IndexType)>,
    primitives: u64,
    /// Entries of a primitive.
    each: u64,
}

impl<'a> BuildInput<'a> {
    /// How much [`BuildInput::triangles`] makes.
    ///
    /// # Errors
    /// As there, but for what lies beyond its buffer.
    pub fn triangles_size(&self) -> Result<DecodedSize> {
        Ok(DecodedSize::of(self.entries(&TRIANGLES, 3)?.primitives, 3, 3))
    }

    /// How much [`BuildInput::spheres`] makes.
    ///
    /// # Errors
    /// As there, but for what lies beyond its buffer.
    pub fn spheres_size(&self) -> Result<DecodedSize> {
        Ok(DecodedSize::of(self.entries(&SPHERES, 1)?.primitives, 1, 1))
    }

    /// How much [`BuildInput::linear_swept_spheres`] makes.
    ///
    /// # Errors
    /// As there, but for what lies beyond its buffer.
    pub fn linear_swept_spheres_size(&self, indexing: Indexing) -> Result<DecodedSize> {
        let entries = self.segments(indexing)?;
        Ok(DecodedSize::of(entries.primitives, entries.each, 2))
    }

    /// Triangles, with their build-time transform.
    ///
    /// # Errors
    /// `InvalidScene` for a stride or offset that is no multiple of the component's size, an index
    /// type that no build takes, and whatever lies beyond its buffer.
    pub fn triangles(&self, transform: Option<[[f32; 4]; 3]>) -> Result<GeometryData> {
        let entries = self.entries(&TRIANGLES, 3)?;
        let Fetched { points: vertices, indices, .. } = self.fetch(&entries, 0, None)?;
        Ok(GeometryData::Triangles { vertices, indices: Some(indices), transform })
    }

    /// Spheres; radii lie in a buffer of their own.
    ///
    /// # Errors
    /// As [`BuildInput::triangles`].
    pub fn spheres(&self, radii: Strided<'_>, format: RadiusFormat) -> Result<GeometryData> {
        let entries = self.entries(&SPHERES, 1)?;
        let Fetched { points: positions, indices, radii } = self.fetch(&entries, 0, Some((radii, format)))?;
        Ok(GeometryData::Spheres { positions, radii, indices: Some(indices) })
    }

    /// Linear swept spheres.
    ///
    /// # Errors
    /// As [`BuildInput::triangles`], and where successive indexing lacks indices (VUID 10427).
    pub fn linear_swept_spheres(
        &self,
        radii: Strided<'_>,
        format: RadiusFormat,
        indexing: Indexing,
        end_caps: EndCaps,
    ) -> Result<GeometryData> {
        let entries = self.segments(indexing)?;
        // In successive mode an index also names the vertex behind its own.
        let last_offset = u64::from(indexing == Indexing::Successive);
        let Fetched { points: positions, indices, radii } =
            self.fetch(&entries, last_offset, Some((radii, format)))?;
        Ok(GeometryData::LinearSweptSpheres { positions, radii, indices: Some(indices), indexing, end_caps })
    }

    /// The entries of linear swept spheres.
    fn segments(&self, indexing: Indexing) -> Result<Entries<'a>> {
        if indexing == Indexing::Successive && self.indices.is_none() {
            return Err(invalid(
                "successive indexing requires indices \
                 (VUID-VkAccelerationStructureGeometryLinearSweptSpheresDataNV-indexingMode-10427)",
            ));
        }
        self.entries(&LINEAR_SWEPT_SPHERES, if indexing == Indexing::List { 2 } else { 1 })
    }

    /// The entries of primitives of `each` entries.
    fn entries(&self, vuids: &Vuids, each: u64) -> Result<Entries<'a>> {
        let component = self.vertex_format.component_size();
        let stride = self.vertices.stride.unwrap_or(self.vertex_format.size());
        if !stride.is_multiple_of(component) || stride > u64::from(u32::MAX) {
            let what = format!(
                "the vertex stride {stride} is not a multiple of {component} bytes ({})",
                vuids.stride
            );
            return Err(invalid(what));
        }
        let offset = u64::from(self.range.primitive_offset);
        let count = self.range.primitive_count.map(u64::from);
        let Some((indices, index_type)) = self.indices else {
            if !offset.is_multiple_of(component) {
                let vuid = "VUID-VkAccelerationStructureBuildRangeInfoKHR-primitiveOffset-03657";
                return Err(invalid(format!(
                    "the primitive offset {offset} is not a multiple of {component} bytes ({vuid})"
                )));
            }
            let begin = offset + stride * u64::from(self.range.first_vertex);
            let layout = StridedLayout { begin, stride, size: self.vertex_format.size() };
            let primitives = count.or_else(|| layout.count(self.vertices.bytes).map(|count| count / each));
            let Some(primitives) = primitives else {
                return Err(invalid(
                    "with a stride of 0 and no indices, the number of primitives is required",
                ));
            };
            check_count(primitives)?;
            return Ok(Entries { indices: None, primitives, each });
        };
        if index_type == IndexType::Uint8 {
            return Err(invalid(format!(
                "8-bit indices are not allowed: a build requires uint16, uint32 or none ({})",
                vuids.index_type
            )));
        }
        let size = index_type.size();
        if !offset.is_multiple_of(size) {
            let vuid = "VUID-VkAccelerationStructureBuildRangeInfoKHR-primitiveOffset-03656";
            return Err(invalid(format!(
                "the primitive offset {offset} is not a multiple of {size} bytes ({vuid})"
            )));
        }
        let layout = StridedLayout { begin: offset, stride: indices.stride.unwrap_or(size), size };
        let primitives = count.or_else(|| layout.count(indices.bytes).map(|count| count / each));
        let primitives = primitives
            .ok_or_else(|| invalid("with an index stride of 0, the number of primitives is required"))?;
        check_count(primitives)?;
        Ok(Entries { indices: Some((layout, indices.bytes, index_type)), primitives, each })
    }

    /// The vertices named, each once and in ascending order so that neighbours stay neighbours, the
    /// entries renamed to match, and their radii.
    fn fetch(
        &self,
        entries: &Entries<'_>,
        last_offset: u64,
        radii: Option<(Strided<'_>, RadiusFormat)>,
    ) -> Result<Fetched> {
        let numbers = entries.numbers(self.range.first_vertex)?;
        let names = Names::of(&numbers, last_offset);

        // Without indices the range moves the buffers, otherwise it has moved the indices.
        let begin = |stride: u64| match self.indices {
            None => u64::from(self.range.primitive_offset) + stride * u64::from(self.range.first_vertex),
            Some(_) => 0,
        };
        let size = self.vertex_format.size();
        let stride = self.vertices.stride.unwrap_or(size);
        let layout = StridedLayout { begin: begin(stride), stride, size };
        let format = self.vertex_format;
        let points = fetch(&layout, self.vertices.bytes, &names, "vertex", |bytes| format.read(bytes))?;
        let radii = match radii {
            None => Vec::new(),
            Some((radii, format)) => {
                let stride = radii.stride.unwrap_or(format.size());
                if stride > u64::from(u32::MAX) {
                    return Err(invalid(format!(
                        "the radius stride {stride} exceeds 32 bits (VUIDs 10422, 10432)"
                    )));
                }
                let layout = StridedLayout { begin: begin(stride), stride, size: format.size() };
                fetch(&layout, radii.bytes, &names, "radius", |bytes| format.read(bytes))?
            }
        };
        Ok(Fetched { points, indices: numbers.renamed(&names), radii })
    }
}

impl<'a> Entries<'a> {
    /// The vertices that the primitives name, `first_vertex` included where there are indices.
    fn numbers(&self, first_vertex: u32) -> Result<Numbers<'a>> {
        let count = self.primitives * self.each;
        if let Some((layout, all, _)) = &self.indices
            && count > 0
            && layout.element(all, count - 1).is_err()
            && let Some((entry, end)) =
                (0..count).find_map(|entry| Some((entry, layout.element(all, entry).err()?)))
        {
            return Err(invalid(format!(
                "index {entry} ends at byte {end}, past the end of the {} bytes of indices",
                all.len()
            )));
        }
        Ok(Numbers { indices: self.indices, first_vertex: first_vertex.into(), count: count as usize })
    }
}

/// The entries that a thread decodes at once.
const PART: usize = 1 << 16;

/// Which vertices the primitives of a geometry name, in their order. All indices lie in their
/// buffer.
struct Numbers<'a> {
    indices: Option<(StridedLayout, &'a [u8], IndexType)>,
    first_vertex: u64,
    count: usize,
}

impl Numbers<'_> {
    /// Calls a function with the vertices that a range of entries names, in their order.
    #[inline(always)]
    fn each(&self, range: Range<usize>, mut visit: impl FnMut(u64)) {
        let first = self.first_vertex;
        let Some((layout, all, index_type)) = &self.indices else {
            return range.for_each(|at| visit(at as u64));
        };
        if layout.stride == layout.size && !range.is_empty() {
            // The indices are side by side.
            let size = layout.size as usize;
            let bytes = &all[layout.begin as usize..][range.start * size..range.end * size];
            return match index_type {
                IndexType::Uint32 => {
                    let indices = bytes.as_chunks::<4>().0.iter();
                    indices.for_each(|index| visit(first + u64::from(u32::from_le_bytes(*index))));
                }
                _ => {
                    let indices = bytes.as_chunks::<2>().0.iter();
                    indices.for_each(|index| visit(first + u64::from(u16::from_le_bytes(*index))));
                }
            };
        }
        for at in range {
            let bytes = layout.element(all, at as u64).expect("bug in anyhit: an index is not in its buffer");
            let index = match index_type {
                IndexType::Uint32 => u32::from_le_bytes(word(bytes, 0)),
                _ => u16::from_le_bytes(word(bytes, 0)).into(),
            };
            visit(first + u64::from(index));
        }
    }

    /// Makes something of each part of the entries.
    fn parts<T: Send>(&self, make: &(dyn Fn(Range<usize>) -> T + Sync)) -> Vec<T> {
        let part = |at: usize| at * PART..self.count.min((at + 1) * PART);
        threads::map(self.count.div_ceil(PART), &|at| make(part(at)))
    }

    /// The place of each entry's vertex among those that are named.
    fn renamed(&self, names: &Names) -> Vec<u32> {
        let mut indices = vec![0; self.count];
        threads::fill(&mut indices, PART, &|begin, part| {
            let end = begin + part.len();
            let mut places = part.iter_mut();
            let mut put = |place| {
                if let Some(to) = places.next() {
                    *to = place;
                }
            };
            match names {
                Names::From { first, .. } => self.each(begin..end, |number| put((number - first) as u32)),
                Names::Listed(list) => {
                    self.each(begin..end, |number| put(list.partition_point(|&name| name < number) as u32));
                }
            }
        });
        indices
    }
}

/// The vertices that a geometry keeps, ascending, each once.
enum Names {
    /// All of so many from one on, which is the rule.
    From { first: u64, count: usize },
    /// The vertices of a list.
    Listed(Vec<u64>),
}

impl Names {
    /// The vertices that entries name, and those up to `last_offset` behind each.
    fn of(numbers: &Numbers<'_>, last_offset: u64) -> Self {
        if numbers.indices.is_none() {
            return Self::From { first: 0, count: numbers.count };
        }
        let bounds = numbers.parts(&|range| {
            let mut bounds = [u64::MAX, 0];
            numbers.each(range, |number| bounds = [bounds[0].min(number), bounds[1].max(number)]);
            bounds
        });
        let bounds = bounds.into_iter().reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
        let Some([first, last]) = bounds else { return Self::From { first: 0, count: 0 } };
        let span = last + last_offset - first + 1;
        let all = |range, visit: &mut dyn FnMut(u64)| {
            numbers.each(range, |number| (number..=number + last_offset).for_each(&mut *visit));
        };
        if span / 64 > numbers.count as u64 {
            let mut list = Vec::with_capacity(numbers.count * (1 + last_offset as usize));
            all(0..numbers.count, &mut |number| list.push(number));
            list.sort_unstable();
            list.dedup();
            return Self::Listed(list);
        }
        // A bit for each vertex.
        let words: Vec<AtomicU64> = (0..span.div_ceil(64)).map(|_| AtomicU64::new(0)).collect();
        numbers.parts(&|range| {
            all(range, &mut |number| {
                let (word, bit) = (&words[((number - first) / 64) as usize], 1 << ((number - first) % 64));
                // Most vertices are named several times.
                if word.load(Relaxed) & bit == 0 {
                    word.fetch_or(bit, Relaxed);
                }
            });
        });
        let count: u64 = words.iter().map(|word| u64::from(word.load(Relaxed).count_ones())).sum();
        if count == span {
            return Self::From { first, count: count as usize };
        }
        let mut list = Vec::with_capacity(count as usize);
        for (begin, word) in (first..).step_by(64).zip(&words) {
            let word = word.load(Relaxed);
            list.extend((0..64).filter(|bit| word >> bit & 1 == 1).map(|bit| begin + bit));
        }
        Self::Listed(list)
    }

    fn len(&self) -> usize {
        match self {
            Self::From { count, .. } => *count,
            Self::Listed(list) => list.len(),
        }
    }

    fn get(&self, at: usize) -> u64 {
        match self {
            Self::From { first, .. } => first + at as u64,
            Self::Listed(list) => list[at],
        }
    }
}

/// The elements of a buffer that names stand for.
fn fetch<T: Copy + Default + Send>(
    layout: &StridedLayout,
    bytes: &[u8],
    names: &Names,
    what: &str,
    read: impl Fn(&[u8]) -> T + Sync,
) -> Result<Vec<T>> {
    let is_inside = |at: &usize| layout.element(bytes, names.get(*at)).is_ok();
    if names.len() > 0 && !is_inside(&(names.len() - 1)) {
        let outside = (0..names.len()).find(|at| !is_inside(at)).unwrap_or(0);
        let at = names.get(outside);
        let end = layout.element(bytes, at).err().unwrap_or(0);
        let size = bytes.len();
        return Err(invalid(format!(
            "{what} {at} ends at byte {end}, past the end of its buffer of {size} bytes"
        )));
    }
    let mut elements = vec![T::default(); names.len()];
    threads::fill(&mut elements, PART, &|begin, part| {
        for (element, at) in part.iter_mut().zip(begin..) {
            let bytes = layout.element(bytes, names.get(at));
            *element = read(bytes.expect("bug in anyhit: a vertex is not in its buffer"));
        }
    });
    Ok(elements)
}

/// Boxes from a buffer of `VkAabbPositionsKHR`, a stride apart.
///
/// # Errors
/// `InvalidScene` for a stride or an offset that is no multiple of 8, and boxes beyond the buffer.
pub fn aabbs(boxes: Strided<'_>, range: BuildRange) -> Result<GeometryData> {
    let (layout, count) = boxes_of(boxes, range)?;
    let read = |at: u64| {
        let bytes = layout.element(boxes.bytes, at).map_err(|end| {
            invalid(format!(
                "box {at} ends at byte {end}, past the end of its buffer of {} bytes",
                boxes.bytes.len()
            ))
        })?;
        Ok(array::from_fn(|corner| f32::from_le_bytes(word(bytes, 4 * corner))))
    };
    Ok(GeometryData::Aabbs((0..count).map(read).collect::<Result<_>>()?))
}

/// How much [`aabbs`] makes.
///
/// # Errors
/// As there, but for boxes beyond the buffer.
pub fn aabbs_size(boxes: Strided<'_>, range: BuildRange) -> Result<DecodedSize> {
    let (layout, primitives) = boxes_of(boxes, range)?;
    // A list whose length is not known beforehand grows by doubling.
    Ok(DecodedSize { primitives, bytes: primitives * 2 * layout.size })
}

/// Where boxes lie, and how many.
fn boxes_of(boxes: Strided<'_>, range: BuildRange) -> Result<(StridedLayout, u64)> {
    const SIZE: u64 = 24;
    let stride = boxes.stride.unwrap_or(SIZE);
    for (what, number, vuid) in [
        ("stride", stride, "VUID-VkAccelerationStructureGeometryAabbsDataKHR-stride-03545"),
        (
            "primitive offset",
            range.primitive_offset.into(),
            "VUID-VkAccelerationStructureBuildRangeInfoKHR-primitiveOffset-03659",
        ),
    ] {
        if !number.is_multiple_of(8) {
            return Err(invalid(format!("the {what} {number} is not a multiple of 8 bytes ({vuid})")));
        }
    }
    let layout = StridedLayout { begin: range.primitive_offset.into(), stride, size: SIZE };
    let count = range.primitive_count.map(u64::from).or_else(|| layout.count(boxes.bytes));
    let count = count.ok_or_else(|| invalid("with a stride of 0, the number of primitives is required"))?;
    check_count(count)?;
    Ok((layout, count))
}

/// The vertices that primitives name, each once.
struct Fetched {
    points: Vec<[f32; 3]>,
    /// Which point each entry of each primitive is.
    indices: Vec<u32>,
    /// One a point; none for triangles.
    radii: Vec<f32>,
}

/// Compares a number of primitives with what every device supports: `maxPrimitiveCount` of at least
/// 2^29 - 1. It is a rule for inputs and does not bound memory: whoever reads a stranger's input
/// compares a [`DecodedSize`] with limits first.
fn check_count(primitives: u64) -> Result<()> {
    if primitives > (1 << 29) - 1 {
        return Err(invalid(format!(
            "{primitives} primitives exceed the limit 2^29 - 1 (maxPrimitiveCount)"
        )));
    }
    Ok(())
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidScene, message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Primitive;
    use crate::accel::element_format::tests::{floats, halves, shorts};
    use crate::math::random::Random;

    const TRIANGLE: BuildRange = BuildRange { primitive_count: None, primitive_offset: 0, first_vertex: 0 };

    fn packed(bytes: &[u8]) -> Strided<'_> {
        Strided { bytes, stride: None }
    }

    fn message(result: Result<GeometryData>) -> String {
        result.expect_err("a mistake").message().to_owned()
    }

    #[test]
    fn first_vertex_moves_indices_and_primitive_offset_the_index_buffer() {
        let positions = floats(&(0..30).map(|x| x as f32).collect::<Vec<_>>());
        let radii = halves(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        let indices = shorts(&[77, 77, 2, 3, 5]);
        let input = BuildInput {
            vertices: packed(&positions),
            vertex_format: VertexFormat::R32G32B32Sfloat,
            indices: Some((packed(&indices), IndexType::Uint16)),
            range: BuildRange { primitive_count: None, primitive_offset: 4, first_vertex: 3 },
        };
        let format = RadiusFormat::R16Sfloat;
        let data = input
            .linear_swept_spheres(packed(&radii), format, Indexing::Successive, EndCaps::Chained)
            .unwrap();
        // Indices 2, 3, 5 and first vertex 3: segments 5-6, 6-7 (the chain goes on) and 8-9.
        assert_eq!(data.primitive_count(), 3);
        let segment = |at: u32| match data.primitive(at) {
            Primitive::LinearSweptSphere { positions, radii, caps } => (positions.map(|p| p[0]), radii, caps),
            other => panic!("{other:?}"),
        };
        assert_eq!(segment(0), ([15.0, 18.0], [5.0, 6.0], [true, true]));
        assert_eq!(segment(1), ([18.0, 21.0], [6.0, 7.0], [false, true]));
        assert_eq!(segment(2), ([24.0, 27.0], [8.0, 9.0], [true, true]));
        let count = BuildInput { range: BuildRange { primitive_count: Some(1), ..input.range }, ..input };
        let data = count.spheres(packed(&radii), format).unwrap();
        assert_eq!(data.primitive_count(), 1);
        assert_eq!(data.primitive(0), Primitive::Sphere { position: [15.0, 16.0, 17.0], radius: 5.0 });
    }

    #[test]
    fn without_indices_the_range_moves_both_buffers() {
        // Both skip 8 bytes; then one vertex of 16 and one radius of 8.
        let positions = floats(&[-1., -1., -1., -1., -1., -1., 1., 2., 3., 0., 4., 5., 6., 0.]);
        let radii = floats(&[-1., -1., -1., -1., 0.5, 9., 0.25, 9.]);
        let input = BuildInput {
            vertices: Strided { bytes: &positions, stride: Some(16) },
            vertex_format: VertexFormat::R32G32B32Sfloat,
            indices: None,
            range: BuildRange { primitive_count: None, primitive_offset: 8, first_vertex: 1 },
        };
        let radii = Strided { bytes: &radii, stride: Some(8) };
        let data = input.spheres(radii, RadiusFormat::R32Sfloat).unwrap();
        assert_eq!(data.primitive_count(), 2);
        assert_eq!(data.primitive(0), Primitive::Sphere { position: [1.0, 2.0, 3.0], radius: 0.5 });
        assert_eq!(data.primitive(1), Primitive::Sphere { position: [4.0, 5.0, 6.0], radius: 0.25 });
    }

    #[test]
    fn a_stride_of_zero_repeats_the_first_element() {
        let positions = floats(&[0., 0., 0., 4., 0., 0.]);
        let radius = floats(&[0.5]);
        let input = BuildInput {
            vertices: packed(&positions),
            vertex_format: VertexFormat::R32G32B32Sfloat,
            indices: None,
            range: TRIANGLE,
        };
        let radii = Strided { bytes: &radius, stride: Some(0) };
        let data = input
            .linear_swept_spheres(radii, RadiusFormat::R32Sfloat, Indexing::List, EndCaps::None)
            .unwrap();
        let wanted = Primitive::LinearSweptSphere {
            positions: [[0.0; 3], [4.0, 0.0, 0.0]],
            radii: [0.5; 2],
            caps: [false; 2],
        };
        assert_eq!(data.primitive(0), wanted);
        let still = BuildInput { vertices: Strided { bytes: &positions, stride: Some(0) }, ..input };
        assert!(message(still.spheres(radii, RadiusFormat::R32Sfloat)).contains("is required"));
        let range = BuildRange { primitive_count: Some(3), ..TRIANGLE };
        let still = BuildInput { range, ..still };
        assert_eq!(still.spheres(radii, RadiusFormat::R32Sfloat).unwrap().primitive_count(), 3);
    }

    #[test]
    fn sizes_are_known_before_anything_is_decoded() {
        // Of each entry a number of 8 bytes and an index of 4 are held, of each vertex a number, a
        // point of 12 and a radius of 4.
        let (entry, vertex) = (8 + 4, 8 + 12 + 4);
        let positions = floats(&[0.0; 3]);
        let range = BuildRange { primitive_count: Some((1 << 29) - 1), ..TRIANGLE };
        let input = BuildInput {
            vertices: Strided { bytes: &positions, stride: Some(0) },
            vertex_format: VertexFormat::R32G32B32Sfloat,
            indices: Some((Strided { bytes: &positions, stride: Some(0) }, IndexType::Uint32)),
            range,
        };
        let size = |entries: u64, vertices: u64| {
            let primitives = (1 << 29) - 1;
            DecodedSize { primitives, bytes: primitives * (entries * entry + vertices * vertex) }
        };
        assert_eq!(input.triangles_size().unwrap(), size(3, 3));
        assert_eq!(input.spheres_size().unwrap(), size(1, 1));
        assert_eq!(input.linear_swept_spheres_size(Indexing::List).unwrap(), size(2, 2));
        assert_eq!(input.linear_swept_spheres_size(Indexing::Successive).unwrap(), size(1, 2));
        // Boxes have six numbers of 4 bytes, and their list may grow to twice its length.
        let boxes = Strided { bytes: &[0; 24], stride: Some(0) };
        let all = aabbs_size(boxes, range).unwrap();
        assert_eq!(all, DecodedSize { primitives: (1 << 29) - 1, bytes: ((1 << 29) - 1) * 24 * 2 });
        let more = BuildRange { primitive_count: Some(1 << 29), ..TRIANGLE };
        let error = BuildInput { range: more, ..input }.triangles_size().unwrap_err();
        assert!(error.message().contains("maxPrimitiveCount"), "{error}");
        assert!(aabbs_size(boxes, more).is_err());
    }

    /// Against the definition: the names sorted, each once.
    #[test]
    fn vertices_keep_their_order_for_every_number_of_threads() {
        let mut random = Random::new(5);
        let positions = floats(&(0..3 * 70_000).map(|x| x as f32).collect::<Vec<_>>());
        // All vertices of a range, some of one, and few that lie far apart.
        let in_turn: Vec<u32> = (0..210_000).map(|at| 7 + at % 69_000).collect();
        let drawn = [(150_000, 30_000), (90, 69_000)]
            .map(|(count, spread)| (0..count).map(|_| 7 + random.below(spread) as u32).collect());
        for numbers in [in_turn].into_iter().chain(drawn) {
            let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
            let mut names = numbers.clone();
            names.sort_unstable();
            names.dedup();
            let vertices = names.iter().map(|&name| [0, 1, 2].map(|axis| (3 * name + axis) as f32));
            let indices = numbers.iter().map(|number| names.binary_search(number).unwrap() as u32);
            let wanted = GeometryData::Triangles {
                vertices: vertices.collect(),
                indices: Some(indices.collect()),
                transform: None,
            };
            let input = BuildInput {
                vertices: packed(&positions),
                vertex_format: VertexFormat::R32G32B32Sfloat,
                indices: Some((packed(&bytes), IndexType::Uint32)),
                range: TRIANGLE,
            };
            for threads in [1, 2, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                assert_eq!(pool.install(|| input.triangles(None)).unwrap(), wanted);
            }
        }
    }

    #[test]
    fn vertices_that_are_left_out_are_not_decoded() {
        let positions = floats(&[0., 0., 0., 1., 0., 0., 2., 0., 0., 3., 0., 0.]);
        let indices = shorts(&[3, 0, 3]);
        let input = BuildInput {
            vertices: packed(&positions),
            vertex_format: VertexFormat::R32G32B32Sfloat,
            indices: Some((packed(&indices), IndexType::Uint16)),
            range: TRIANGLE,
        };
        // Vertices 0 and 3 are kept, so 3 is the second one.
        let wanted = GeometryData::Triangles {
            vertices: vec![[0.; 3], [3., 0., 0.]],
            indices: Some(vec![1, 0, 1]),
            transform: None,
        };
        assert_eq!(input.triangles(None).unwrap(), wanted);
    }

    #[test]
    fn mistakes_name_their_rule() {
        let positions = floats(&[0.0; 9]);
        let indices = shorts(&[0, 1, 3]);
        let input = BuildInput {
            vertices: packed(&positions),
            vertex_format: VertexFormat::R32G32B32Sfloat,
            indices: Some((packed(&indices), IndexType::Uint16)),
            range: TRIANGLE,
        };
        assert!(
            message(input.triangles(None))
                .contains("vertex 3 ends at byte 48, past the end of its buffer of 36 bytes")
        );
        let odd = BuildInput { vertices: Strided { bytes: &positions, stride: Some(6) }, ..input };
        assert!(message(odd.triangles(None)).contains("vertexStride-03735"));
        let radii = packed(&positions);
        assert!(message(odd.spheres(radii, RadiusFormat::R32Sfloat)).contains("vertexStride-10431"));
        let bytes = BuildInput { indices: Some((packed(&indices), IndexType::Uint8)), ..input };
        assert!(message(bytes.triangles(None)).contains("indexType-03798"));
        assert!(message(bytes.spheres(radii, RadiusFormat::R32Sfloat)).contains("indexData-10437"));
        let swept = |input: BuildInput<'_>| {
            input.linear_swept_spheres(radii, RadiusFormat::R32Sfloat, Indexing::Successive, EndCaps::None)
        };
        assert!(message(swept(bytes)).contains("indexData-10428"));
        assert!(message(swept(odd)).contains("vertexStride-10421"));
        assert!(message(swept(BuildInput { indices: None, ..input })).contains("indexingMode-10427"));
        let moved = |primitive_offset| BuildRange { primitive_offset, ..TRIANGLE };
        let shifted = BuildInput { range: moved(1), ..input };
        assert!(message(shifted.triangles(None)).contains("primitiveOffset-03656"));
        let shifted = BuildInput { range: moved(2), indices: None, ..input };
        assert!(message(shifted.triangles(None)).contains("primitiveOffset-03657"));
        let many = BuildRange { primitive_count: Some(2), ..TRIANGLE };
        let many = BuildInput { range: many, ..input };
        assert!(
            message(many.triangles(None)).contains("index 3 ends at byte 8, past the end of the 6 bytes")
        );
        assert!(
            message(aabbs(Strided { bytes: &positions, stride: Some(25) }, TRIANGLE))
                .contains("stride-03545")
        );
        assert!(message(aabbs(packed(&positions), moved(4))).contains("primitiveOffset-03659"));
        let far = BuildRange { primitive_count: Some(2), ..TRIANGLE };
        assert!(
            message(aabbs(packed(&positions), far))
                .contains("box 1 ends at byte 48, past the end of its buffer of 36 bytes")
        );
        assert_eq!(aabbs(packed(&positions), moved(8)).unwrap().primitive_count(), 1);
    }
}
