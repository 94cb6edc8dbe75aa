//! Numbers of primitives within a BLAS.

use crate::accel::geometry::Geometry;
use crate::accel::geometry_data::bytes_of;

/// Numbers the primitives of all geometries in turn, inactive ones included.
#[derive(Clone, Debug)]
pub(super) struct PrimitiveNumbers {
    /// The number of the first primitive of each geometry; empty where there is only one geometry.
    firsts: Vec<u32>,
}

/// The identity of a primitive in a BLAS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GeomPrim {
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
}

impl PrimitiveNumbers {
    /// Numbers the primitives of geometries, which are fewer than 2^32 - 1 (`validate`).
    pub(super) fn new(geometries: &[Geometry]) -> Self {
        let mut firsts = Vec::new();
        if geometries.len() > 1 {
            let mut next = 0;
            firsts.extend(geometries.iter().map(|geometry| {
                let first = next;
                next += geometry.data.primitive_count() as u32;
                first
            }));
        }
        Self { firsts }
    }

    /// The number of the first primitive of a geometry.
    pub(super) fn first_of(&self, geometry: usize) -> u32 {
        self.firsts.get(geometry).copied().unwrap_or(0)
    }

    /// The identity of the primitive with a number.
    #[inline(always)]
    pub(super) fn geom_prim(&self, number: u32) -> GeomPrim {
        if self.firsts.is_empty() { GeomPrim { geometry: 0, primitive: number } } else { self.find(number) }
    }

    /// [`Self::geom_prim`] among several geometries. It is out of the way of registers that hold a
    /// ray where there is only one.
    #[cold]
    #[inline(never)]
    fn find(&self, number: u32) -> GeomPrim {
        // Geometries without primitives share their first number with the next one.
        let geometry = self.firsts.partition_point(|&first| first <= number).saturating_sub(1);
        GeomPrim { geometry: geometry as u32, primitive: number - self.first_of(geometry) }
    }

    /// The bytes of its list.
    pub(super) fn memory_size(&self) -> usize {
        bytes_of(&self.firsts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::flags::GeometryFlags;
    use crate::accel::geometry_data::GeometryData;

    #[test]
    fn numbers_run_through_all_geometries() {
        let boxes = |count| Geometry::new(GeometryData::Aabbs(vec![[0.0; 6]; count]), GeometryFlags::OPAQUE);
        for counts in [vec![], vec![3], vec![2, 3], vec![0, 2, 0, 0, 1, 3, 0]] {
            let geometries: Vec<Geometry> = counts.iter().map(|&count| boxes(count)).collect();
            let numbers = PrimitiveNumbers::new(&geometries);
            let each = counts.iter().zip(0..).flat_map(|(&count, geometry)| {
                (0..count as u32).map(move |primitive| GeomPrim { geometry, primitive })
            });
            for (number, wanted) in (0..).zip(each) {
                assert_eq!(numbers.geom_prim(number), wanted, "{counts:?}");
                assert_eq!(numbers.first_of(wanted.geometry as usize) + wanted.primitive, number);
            }
        }
    }
}
