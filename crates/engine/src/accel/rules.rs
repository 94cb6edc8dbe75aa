//! The rules by which flags keep or cull a primitive, as pure functions (Vulkan, chapter "Ray
//! Traversal", sections on culling and opacity).

use crate::accel::flags::{GeometryFlags, InstanceFlags, RayFlags};
use crate::accel::geometry_data::GeometryKind;
use crate::geometry::Surface;

/// Whether an instance is visible: its mask and the low 8 bits of the cull mask share a bit.
#[inline]
pub fn is_visible(mask: u8, cull_mask: u32) -> bool {
    u32::from(mask) & cull_mask & 0xFF != 0
}

/// Whether the ray skips a kind of primitive. Bit 256 skips all built-in kinds, bit 512 boxes.
#[inline]
pub fn is_skipped(ray: RayFlags, kind: GeometryKind) -> bool {
    match kind {
        GeometryKind::Aabbs => ray.contains(RayFlags::SKIP_AABBS),
        GeometryKind::Triangles | GeometryKind::Spheres | GeometryKind::LinearSweptSpheres => {
            ray.contains(RayFlags::SKIP_TRIANGLES)
        }
    }
}

/// Whether the ray skips some kind of primitive.
#[inline]
pub fn skips_any(ray: RayFlags) -> bool {
    ray.contains(RayFlags::SKIP_TRIANGLES) || ray.contains(RayFlags::SKIP_AABBS)
}

/// Whether a primitive counts as opaque: the flags of the ray override those of the instance, which
/// override those of the geometry.
#[inline]
pub fn is_opaque(ray: RayFlags, instance: InstanceFlags, geometry: GeometryFlags) -> bool {
    if ray.contains(RayFlags::OPAQUE) {
        true
    } else if ray.contains(RayFlags::NO_OPAQUE) {
        false
    } else if instance.contains(InstanceFlags::FORCE_OPAQUE) {
        true
    } else if instance.contains(InstanceFlags::FORCE_NO_OPAQUE) {
        false
    } else {
        geometry.contains(GeometryFlags::OPAQUE)
    }
}

/// Whether the ray culls primitives of this opacity.
#[inline]
pub fn is_culled_by_opacity(ray: RayFlags, opaque: bool) -> bool {
    ray.contains(if opaque { RayFlags::CULL_OPAQUE } else { RayFlags::CULL_NO_OPAQUE })
}

/// Applies the instance's `TRIANGLE_FLIP_FACING` to a surface. (A transform that mirrors does not
/// flip the facing.)
#[inline]
pub fn apply_flip_facing(surface: Surface, instance: InstanceFlags) -> Surface {
    match surface {
        Surface::TriangleFront if instance.contains(InstanceFlags::TRIANGLE_FLIP_FACING) => {
            Surface::TriangleBack
        }
        Surface::TriangleBack if instance.contains(InstanceFlags::TRIANGLE_FLIP_FACING) => {
            Surface::TriangleFront
        }
        other => other,
    }
}

/// Whether the ray culls triangles by the side that it sees, in any instance.
#[inline]
pub fn culls_faces(ray: RayFlags) -> bool {
    ray.contains(RayFlags::CULL_FRONT_FACING_TRIANGLES) || ray.contains(RayFlags::CULL_BACK_FACING_TRIANGLES)
}

/// Whether the ray culls a triangle seen from this side (after `apply_flip_facing`). Other kinds
/// have no side to cull.
#[inline]
pub fn is_culled_by_face(ray: RayFlags, instance: InstanceFlags, surface: Surface) -> bool {
    if instance.contains(InstanceFlags::TRIANGLE_FACING_CULL_DISABLE) {
        return false;
    }
    match surface {
        Surface::TriangleFront => ray.contains(RayFlags::CULL_FRONT_FACING_TRIANGLES),
        Surface::TriangleBack => ray.contains(RayFlags::CULL_BACK_FACING_TRIANGLES),
        Surface::Aabb | Surface::Sphere | Surface::Side | Surface::Cap0 | Surface::Cap1 => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opacity_is_resolved_ray_over_instance_over_geometry() {
        // Vulkan, "Ray Opacity": (ray, instance, geometry) -> opaque.
        let rows = [
            (0, 0, 0, false),
            (0, 0, 1, true),
            (0, 4, 0, true),
            (0, 8, 1, false),
            (1, 8, 0, true),
            (2, 4, 1, false),
            (1, 0, 0, true),
            (2, 0, 1, false),
            (0, 4, 1, true),
            (0, 8, 0, false),
        ];
        for (ray, instance, geometry, opaque) in rows {
            let ours = is_opaque(RayFlags(ray), InstanceFlags(instance), GeometryFlags(geometry));
            assert_eq!(ours, opaque, "ray {ray}, instance {instance}, geometry {geometry}");
        }
        // Another geometry flag beside it changes nothing.
        assert!(!is_opaque(RayFlags(0), InstanceFlags(0), GeometryFlags::NO_DUPLICATE_ANY_HIT));
    }

    #[test]
    fn opacity_culls_drop_their_own_kind_only() {
        assert!(is_culled_by_opacity(RayFlags(64), true) && !is_culled_by_opacity(RayFlags(64), false));
        assert!(is_culled_by_opacity(RayFlags(128), false) && !is_culled_by_opacity(RayFlags(128), true));
        assert!(!is_culled_by_opacity(RayFlags(0), true) && !is_culled_by_opacity(RayFlags(0), false));
    }

    #[test]
    fn faces_are_culled_after_the_flip_unless_disabled() {
        // (instance flags, wound side seen, culled by 16, culled by 32)
        let rows = [
            (0, Surface::TriangleFront, false, true),
            (0, Surface::TriangleBack, true, false),
            (2, Surface::TriangleFront, true, false),
            (2, Surface::TriangleBack, false, true),
            (1, Surface::TriangleFront, false, false),
            (1, Surface::TriangleBack, false, false),
            (3, Surface::TriangleFront, false, false),
            (0, Surface::Sphere, false, false),
            (2, Surface::Side, false, false),
        ];
        for (instance, wound, by_back, by_front) in rows {
            let instance = InstanceFlags(instance);
            let seen = apply_flip_facing(wound, instance);
            let culled = |flags| is_culled_by_face(RayFlags(flags), instance, seen);
            assert_eq!((culled(16), culled(32)), (by_back, by_front), "{instance:?} {wound:?}");
            assert!(!culled(0));
        }
    }

    #[test]
    fn skip_triangles_skips_every_built_in_kind() {
        use GeometryKind::*;
        for (kind, by_256, by_512) in [
            (Triangles, true, false),
            (Spheres, true, false),
            (LinearSweptSpheres, true, false),
            (Aabbs, false, true),
        ] {
            assert_eq!(is_skipped(RayFlags(256), kind), by_256, "{kind}");
            assert_eq!(is_skipped(RayFlags(512), kind), by_512, "{kind}");
            assert!(!is_skipped(RayFlags(0), kind));
        }
    }

    #[test]
    fn only_the_low_eight_bits_of_the_cull_mask_count() {
        assert!(is_visible(0x0F, 0x18));
        assert!(!is_visible(0x0F, 0xF0));
        assert!(!is_visible(0xFF, 0xFFFF_FF00));
        assert!(!is_visible(0, 0xFF));
    }
}
