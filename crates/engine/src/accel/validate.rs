//! What Vulkan's valid usage demands of geometries and instances.

use crate::accel::geometry::Geometry;
use crate::accel::geometry_data::{GeometryData, GeometryKind, Indexing};
use crate::accel::primitive::Primitive;
use crate::geometry::Transform;
use anyhit_base::error::{Error, ErrorKind};

/// `VkPhysicalDeviceAccelerationStructurePropertiesKHR::maxPrimitiveCount`: the limit that every
/// device supports.
const MAX_PRIMITIVES: usize = (1 << 29) - 1;
/// `maxGeometryCount` and `maxInstanceCount`.
pub(super) const MAX_GEOMETRIES: usize = (1 << 24) - 1;

/// The mistakes in the geometries of a BLAS, at most one for each geometry and rule.
pub(super) fn geometries(geometries: &[Geometry]) -> Vec<Error> {
    let mut mistakes = Vec::new();
    if geometries.len() > MAX_GEOMETRIES {
        let text = format!(
            "a BLAS of {} geometries exceeds the limit 2^24 - 1 (maxGeometryCount)",
            geometries.len()
        );
        mistakes.push(Error::new(ErrorKind::InvalidScene, text));
    }
    for (index, geometry) in geometries.iter().enumerate() {
        let mut found = |text: String| {
            mistakes.push(Error::new(ErrorKind::InvalidScene, format!("geometry {index}: {text}")));
        };
        let (first, kind) = (geometries[0].data.kind(), geometry.data.kind());
        if kind != first {
            found(format!(
                "{kind} in a BLAS of {first}: all geometries of a BLAS must have the same type \
                 (VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03792)"
            ));
        }
        match &geometry.data {
            GeometryData::Triangles { vertices, indices, transform } => {
                check_triples(vertices.len(), indices.as_deref(), &mut found);
                check_indices(indices.as_deref(), vertices.len(), 0, "vertex", &mut found);
                if transform.as_ref().is_some_and(|matrix| Transform::new(matrix).is_none()) {
                    found(
                        "the geometry transform is singular or not finite \
                         (VUID-VkTransformMatrixKHR-matrix-03799)"
                            .to_owned(),
                    );
                }
            }
            GeometryData::Aabbs(boxes) => check_boxes(boxes, &mut found),
            GeometryData::Spheres { positions, radii, indices } => {
                check_radii_count(positions.len(), radii.len(), &mut found);
                check_indices(indices.as_deref(), positions.len(), 0, "position", &mut found);
            }
            GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, .. } => {
                check_radii_count(positions.len(), radii.len(), &mut found);
                let last_offset = match indexing {
                    Indexing::List => 0,
                    Indexing::Successive => 1,
                };
                match (indexing, indices) {
                    (Indexing::Successive, None) => found(
                        "successive indexing requires indices \
                         (VUID-VkAccelerationStructureGeometryLinearSweptSpheresDataNV-indexingMode-10427)"
                            .to_owned(),
                    ),
                    (Indexing::List, Some(indices)) if !indices.len().is_multiple_of(2) => {
                        found(format!("the number of indices ({}) is not even", indices.len()));
                    }
                    _ => {}
                }
                check_indices(indices.as_deref(), positions.len(), last_offset, "position", &mut found);
            }
        }
        let primitives = geometry.data.primitive_count();
        if let Some(later) = &geometry.vertices_t1 {
            match &geometry.data {
                GeometryData::Triangles { vertices, .. } if later.len() == vertices.len() => {}
                GeometryData::Triangles { vertices, .. } => {
                    found(format!("{} vertices at time 1, but {} at time 0", later.len(), vertices.len()));
                }
                _ => found(format!(
                    "vertices at time 1 of {kind}: only triangles can move \
                     (VkAccelerationStructureGeometryMotionTrianglesDataNV)"
                )),
            }
        }
        if let Some(micromap) = &geometry.opacity_micromap {
            if kind != GeometryKind::Triangles {
                found(format!("an opacity micromap on {kind}: only triangles can have one"));
            } else if let Some(mistake) = micromap.mistake(primitives) {
                found(mistake);
            }
        }
    }
    let counts = geometries.iter().map(|geometry| geometry.data.primitive_count());
    mistakes.extend(too_many(counts).map(|text| Error::new(ErrorKind::InvalidScene, text)));
    if mistakes.is_empty() {
        // Only now does every primitive name vertices that exist.
        mistakes.extend(geometries.iter().enumerate().filter_map(|(index, geometry)| {
            let text = negative_radius(&geometry.data)?;
            Some(Error::new(ErrorKind::InvalidScene, format!("geometry {index}: {text}")))
        }));
    }
    mistakes
}

/// What is wrong if geometries of these numbers of primitives have too many together.
fn too_many(counts: impl Iterator<Item = usize>) -> Option<String> {
    let total = counts.fold(0, usize::saturating_add);
    (total > MAX_PRIMITIVES).then(|| {
        format!(
            "a BLAS of {total} primitives exceeds the limit 2^29 - 1 for all geometries \
             (maxPrimitiveCount, VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03794 for boxes, \
             03795 for triangles)"
        )
    })
}

fn check_triples(vertices: usize, indices: Option<&[u32]>, found: &mut impl FnMut(String)) {
    match indices {
        Some(indices) if !indices.len().is_multiple_of(3) => {
            found(format!("the number of indices ({}) is not a multiple of 3", indices.len()));
        }
        None if !vertices.is_multiple_of(3) => {
            found(format!("the number of vertices ({vertices}) is not a multiple of 3"))
        }
        _ => {}
    }
}

/// Every index, and `last_offset` after it, must name an entry.
fn check_indices(
    indices: Option<&[u32]>,
    entries: usize,
    last_offset: usize,
    entry: &str,
    found: &mut impl FnMut(String),
) {
    let outside = |&(_, &index): &(usize, &u32)| index as usize + last_offset >= entries;
    let Some((at, index)) = indices.unwrap_or_default().iter().enumerate().find(outside) else { return };
    let reaches =
        if last_offset == 0 { String::new() } else { format!(" (and {entry} {})", u64::from(*index) + 1) };
    found(format!("indices[{at}] names {entry} {index}{reaches} of {entries}"));
}

fn check_radii_count(positions: usize, radii: usize, found: &mut impl FnMut(String)) {
    if positions != radii {
        found(format!("{positions} positions with {radii} radii: each position needs one radius"));
    }
}

fn check_boxes(boxes: &[[f32; 6]], found: &mut impl FnMut(String)) {
    const AXES: [(&str, &str); 3] = [("X", "minX-03546"), ("Y", "minY-03547"), ("Z", "minZ-03548")];
    for (primitive, corners) in boxes.iter().enumerate() {
        // A NaN here marks the box as inactive.
        if corners[0].is_nan() {
            continue;
        }
        for (axis, (name, vuid)) in AXES.iter().enumerate() {
            let (min, max) = (corners[axis], corners[axis + 3]);
            let in_order = min <= max;
            if !in_order {
                return found(format!(
                    "primitive {primitive}: min{name} {min} is not at most max{name} {max} \
                     (VUID-VkAabbPositionsKHR-{vuid})"
                ));
            }
        }
    }
}

/// The first primitive with a negative radius. (A NaN makes it inactive, which is valid.)
fn negative_radius(data: &GeometryData) -> Option<String> {
    let vuid = match data {
        GeometryData::Spheres { .. } => "VUID-VkAccelerationStructureGeometrySpheresDataNV-radiusData-10436",
        GeometryData::LinearSweptSpheres { .. } => {
            "VUID-VkAccelerationStructureGeometryLinearSweptSpheresDataNV-radiusData-10426"
        }
        GeometryData::Triangles { .. } | GeometryData::Aabbs(_) => return None,
    };
    if let GeometryData::Spheres { radii, .. } | GeometryData::LinearSweptSpheres { radii, .. } = data
        && radii.iter().fold(0.0, |least: f32, &radius| if radius < least { radius } else { least }) == 0.0
    {
        return None;
    }
    // Those that no primitive names may be negative.
    (0..data.primitive_count() as u32).find_map(|primitive| {
        let radii = match data.primitive(primitive) {
            Primitive::Sphere { radius, .. } => [radius; 2],
            Primitive::LinearSweptSphere { radii, .. } => radii,
            Primitive::Triangle(_) | Primitive::Aabb(_) => return None,
        };
        let radius = radii.into_iter().find(|&radius| radius < 0.0)?;
        Some(format!("primitive {primitive} has the negative radius {radius} ({vuid})"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_geometries_together_may_be_too_many() {
        assert_eq!(too_many([1 << 28, (1 << 28) - 1].into_iter()), None);
        let message = too_many([1 << 28, 0, 1 << 28].into_iter()).expect("one too many");
        assert!(
            message.contains("536870912 primitives") && message.contains("03795 for triangles"),
            "{message}"
        );
    }
}
