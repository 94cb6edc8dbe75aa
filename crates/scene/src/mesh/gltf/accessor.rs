//! The elements of accessors: those of a buffer view or zeros, with sparse values in place of some
//! (glTF 2.0, 3.6.2).

use crate::mesh::gltf::document::{Accessor, ComponentType, Shape};
use crate::mesh::gltf::{Data, get, invalid};
use crate::mesh::listed::Numbers;
use anyhit_base::error::{ErrorKind, Result};
use anyhit_base::input::{InputLimit, threads};

/// The types that an accessor may have.
pub(super) struct Expected<'a> {
    pub shapes: &'a [Shape],
    pub components: &'a [ComponentType],
}

/// The elements of an accessor, all of them within their buffers.
pub(super) struct Elements<'a> {
    pub accessor: &'a Accessor,
    /// Those of the buffer view; without one all are zeros.
    base: Option<Strided<'a>>,
    /// The indices of elements, and what is in their place.
    sparse: Option<SparseElements<'a>>,
}

/// The indices of the elements that a sparse accessor changes, and the new elements.
type SparseElements<'a> = (Vec<u32>, Strided<'a>);

/// Elements as they lie in a buffer.
struct Strided<'a> {
    /// From the first one on.
    bytes: &'a [u8],
    /// Bytes from one to the next.
    stride: usize,
    /// Bytes of one.
    size: usize,
}

impl<'a> Strided<'a> {
    fn element(&self, at: usize) -> &'a [u8] {
        &self.bytes[at * self.stride..][..self.size]
    }
}

impl Data {
    /// The elements of an accessor that `user`, a path in the document, names.
    ///
    /// # Errors
    /// `InvalidMesh` for an accessor of another type, beyond its buffer or beyond a limit.
    pub(super) fn elements(&self, at: usize, expected: &Expected<'_>, user: &str) -> Result<Elements<'_>> {
        let accessor = get(&self.document.accessors, at, "accessors", user)?;
        let path = format!("accessors[{at}]");
        let wrong = |what: String| invalid(format!("`{path}` {what}")).note(format!("used by `{user}`"));
        let (shape, component) = (accessor.shape, accessor.component_type);
        if !expected.shapes.contains(&shape) || !expected.components.contains(&component) {
            let (shapes, components) = (expected.shapes, expected.components);
            let message = format!("is {shape:?} of {component:?}, expected {shapes:?} of {components:?}");
            return Err(wrong(message));
        }
        let count = accessor.count;
        if count == 0 {
            return Err(wrong("has 0 elements".to_string()));
        }
        let within = |limit, count: u64| {
            let checked = self.limits.check(limit, count, ErrorKind::InvalidMesh);
            checked.map_err(|error| error.context(&path))
        };
        match shape {
            Shape::Scalar => within(InputLimit::MeshTriangles, count as u64 / 3)?,
            _ => within(InputLimit::MeshVertices, count as u64)?,
        }
        if accessor.buffer_view.is_none() {
            within(InputLimit::MeshSparse, count as u64)?;
        }
        let size = accessor.size();
        let base =
            accessor.buffer_view.map(|view| self.strided(view, accessor.byte_offset, count, size, &path));
        let sparse = accessor.sparse.as_ref().map(|sparse| {
            let path = format!("{path}.sparse");
            let changed = sparse.count;
            if changed == 0 || changed > count {
                return Err(wrong(format!("has {changed} sparse values for {count} elements")));
            }
            let (indices, values) = (&sparse.indices, &sparse.values);
            let of_index = indices.component_type.size();
            let places = self.strided(indices.buffer_view, indices.byte_offset, changed, of_index, &path)?;
            let places: Vec<u32> = (0..changed).map(|k| word(places.element(k))).collect();
            if let Some(index) = places.iter().find(|index| **index as usize >= count) {
                return Err(wrong(format!("has a sparse value for element {index} of {count}")));
            }
            Ok((places, self.strided(values.buffer_view, values.byte_offset, changed, size, &path)?))
        });
        Ok(Elements { accessor, base: base.transpose()?, sparse: sparse.transpose()? })
    }

    /// Elements of some bytes in a buffer view.
    fn strided(
        &self,
        view: usize,
        offset: usize,
        count: usize,
        size: usize,
        user: &str,
    ) -> Result<Strided<'_>> {
        let (bytes, stride) = self.view(view, user)?;
        let stride = stride.unwrap_or(size);
        let last = (count - 1).checked_mul(stride).and_then(|begin| begin.checked_add(size));
        let end = last.and_then(|last| last.checked_add(offset)).filter(|end| *end <= bytes.len());
        match end {
            Some(end) if stride >= size => Ok(Strided { bytes: &bytes[offset..end], stride, size }),
            Some(_) => Err(invalid(format!(
                "`bufferViews[{view}].byteStride` is less than the {size} bytes of an element"
            ))),
            None => Err(invalid(format!("`{user}` extends beyond its buffer view, `bufferViews[{view}]`"))),
        }
    }
}

/// An integer of up to four bytes.
fn word(bytes: &[u8]) -> u32 {
    let mut word = [0; 4];
    word[..bytes.len()].copy_from_slice(bytes);
    u32::from_le_bytes(word)
}

impl Elements<'_> {
    /// The numbers of the elements as floats: integers, or fractions where the accessor is
    /// normalized (glTF 2.0, 3.11).
    pub(super) fn numbers(&self) -> Numbers {
        let components = self.accessor.shape.components();
        let mut values = vec![0.0; components * self.accessor.count];
        self.read(&mut values);
        Numbers { components, values }
    }

    /// The elements of an accessor of three components.
    pub(super) fn vertices(&self) -> Vec<[f32; 3]> {
        let mut vertices = vec![[0.0; 3]; self.accessor.count];
        self.read(vertices.as_flattened_mut());
        vertices
    }

    /// The elements of an accessor of unsigned integers.
    pub(super) fn indices(&self) -> Vec<u32> {
        let mut indices = vec![0; self.accessor.count];
        self.fill(&mut indices, 1, &|bytes, index| index[0] = word(bytes));
        indices
    }

    /// Reads all numbers into a list that is as long and contains zeros.
    fn read(&self, list: &mut [f32]) {
        use ComponentType as T;
        let normalized = self.accessor.normalized;
        let unsigned = |most: f32| move |x: f32| if normalized { x / most } else { x };
        let signed = |most: f32| move |x: f32| if normalized { (x / most).max(-1.0) } else { x };
        match self.accessor.component_type {
            T::I8 => self.decode(list, &|x| signed(127.0)(i8::from_le_bytes(x).into())),
            T::U8 => self.decode(list, &|x| unsigned(255.0)(u8::from_le_bytes(x).into())),
            T::I16 => self.decode(list, &|x| signed(32767.0)(i16::from_le_bytes(x).into())),
            T::U16 => self.decode(list, &|x| unsigned(65535.0)(u16::from_le_bytes(x).into())),
            T::U32 => self.decode(list, &|x| u32::from_le_bytes(x) as f32),
            T::F32 => self.decode(list, &f32::from_le_bytes),
        }
    }

    fn decode<const SIZE: usize>(&self, list: &mut [f32], number: &(impl Fn([u8; SIZE]) -> f32 + Sync)) {
        self.fill(list, self.accessor.shape.components(), &|bytes, element| {
            let (components, _) = bytes.as_chunks::<SIZE>();
            for (to, bytes) in element.iter_mut().zip(components) {
                *to = number(*bytes);
            }
        });
    }

    /// Fills a list, which has so many entries for each element, by a function that is given the
    /// bytes of an element and its entries. Entries of elements that are zero stay.
    fn fill<T: Send>(&self, list: &mut [T], entries: usize, read: &(impl Fn(&[u8], &mut [T]) + Sync)) {
        /// Elements that a thread decodes at once.
        const PART: usize = 1 << 16;
        if let Some(base) = &self.base {
            threads::fill(list, PART * entries, &|first, part| {
                for (element, at) in part.chunks_exact_mut(entries).zip(first / entries..) {
                    read(base.element(at), element);
                }
            });
        }
        if let Some((places, values)) = &self.sparse {
            for (k, place) in places.iter().enumerate() {
                read(values.element(k), &mut list[*place as usize * entries..][..entries]);
            }
        }
    }
}
