//! Instructions that read a hit object.

use crate::module::Opcode;

use crate::accel::Committed;
use crate::geometry::ObjectRay;
use crate::machine::TrapCode;
use crate::machine::hit_object::HitObject;
use crate::ops::builtin::ValueShape;
use crate::ops::intersection_view::{IntersectionView, write_floats, write_word};

/// An instruction that reads a hit object.
pub struct HitObjectGetter {
    name: &'static str,
    pub(super) opcodes: &'static [Opcode],
    pub(super) shape: ValueShape,
    pub(super) read: fn(&HitObject, &mut [u32]) -> Result<(), TrapCode>,
}

impl HitObjectGetter {
    /// Whether it reads the time of the ray.
    pub fn reads_time(&self) -> bool {
        self.opcodes.contains(&Opcode::HitObjectGetCurrentTimeEXT)
    }
}

impl std::fmt::Debug for HitObjectGetter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for HitObjectGetter {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

macro_rules! getters {
    ($($name:ident [$($opcode:ident)*] $shape:ident |$from:ident, $to:ident| $read:expr;)*) => {
        pub(super) static GETTERS: &[HitObjectGetter] = &[$(HitObjectGetter {
            name: stringify!($name),
            opcodes: &[$(Opcode::$opcode),*],
            shape: ValueShape::$shape,
            read: |$from, $to| $read,
        }),*];
    };
}

getters! {
    IsEmpty [HitObjectIsEmptyEXT HitObjectIsEmptyNV] Bool |from, to| write_word(to, from.state()?[0].into());
    IsMiss [HitObjectIsMissEXT HitObjectIsMissNV] Bool |from, to| write_word(to, from.state()?[1].into());
    IsHit [HitObjectIsHitEXT HitObjectIsHitNV] Bool |from, to| write_word(to, from.state()?[2].into());
    GetRayTMin [HitObjectGetRayTMinEXT HitObjectGetRayTMinNV] Float
        |from, to| write_floats(to, &[from.encoded()?.trace.ray.t_min]);
    GetRayTMax [HitObjectGetRayTMaxEXT HitObjectGetRayTMaxNV] Float |from, to| write_floats(to, &[from.t_max()?]);
    GetRayFlags [HitObjectGetRayFlagsEXT] Int |from, to| write_word(to, from.encoded()?.trace.flags.0);
    GetWorldRayOrigin [HitObjectGetWorldRayOriginEXT HitObjectGetWorldRayOriginNV] Float3
        |from, to| write_floats(to, &from.encoded()?.trace.ray.origin);
    GetWorldRayDirection [HitObjectGetWorldRayDirectionEXT HitObjectGetWorldRayDirectionNV] Float3
        |from, to| write_floats(to, &from.encoded()?.trace.ray.direction);
    GetCurrentTime [HitObjectGetCurrentTimeEXT HitObjectGetCurrentTimeNV] Float
        |from, to| write_floats(to, &[from.encoded()?.trace.time]);
    GetShaderBindingTableRecordIndex
        [HitObjectGetShaderBindingTableRecordIndexEXT HitObjectGetShaderBindingTableRecordIndexNV] Int
        |from, to| write_word(to, from.encoded()?.record.0 as u32);
    GetInstanceCustomIndex [HitObjectGetInstanceCustomIndexEXT HitObjectGetInstanceCustomIndexNV] Int
        |from, to| view(from)?.custom_index(to);
    GetInstanceId [HitObjectGetInstanceIdEXT HitObjectGetInstanceIdNV] Int
        |from, to| write_word(to, view(from)?.candidate.instance);
    GetGeometryIndex [HitObjectGetGeometryIndexEXT HitObjectGetGeometryIndexNV] Int
        |from, to| write_word(to, view(from)?.candidate.geometry);
    GetPrimitiveIndex [HitObjectGetPrimitiveIndexEXT HitObjectGetPrimitiveIndexNV] Int
        |from, to| write_word(to, view(from)?.candidate.primitive);
    GetHitKind [HitObjectGetHitKindEXT HitObjectGetHitKindNV] Int
        |from, to| write_word(to, from.hit()?.1.committed.hit_kind.0);
    GetObjectRayOrigin [HitObjectGetObjectRayOriginEXT HitObjectGetObjectRayOriginNV] Float3
        |from, to| view(from)?.object_ray(to, ObjectRay::object_origin_f32);
    GetObjectRayDirection [HitObjectGetObjectRayDirectionEXT HitObjectGetObjectRayDirectionNV] Float3
        |from, to| view(from)?.object_ray(to, ObjectRay::object_direction_f32);
    GetObjectToWorld [HitObjectGetObjectToWorldEXT HitObjectGetObjectToWorldNV] Matrix4x3
        |from, to| view(from)?.object_to_world(to);
    GetWorldToObject [HitObjectGetWorldToObjectEXT HitObjectGetWorldToObjectNV] Matrix4x3
        |from, to| view(from)?.world_to_object(to);
    GetIntersectionTriangleVertexPositions [HitObjectGetIntersectionTriangleVertexPositionsEXT] Float3Array3
        |from, to| view(from)?.vertex_positions(to);
    GetClusterId [HitObjectGetClusterIdNV] Int
        |from, to| from.hit().and_then(|(_, hit)| write_word(to, hit.committed.candidate.cluster_id(&hit.tlas)));
    IsSphereHit [HitObjectIsSphereHitNV] Bool |from, to| write_word(to, view_of_hit(from)?.is_some_and(IntersectionView::is_sphere).into());
    IsLSSHit [HitObjectIsLSSHitNV] Bool |from, to| write_word(to, view_of_hit(from)?.is_some_and(IntersectionView::is_lss).into());
    GetSpherePosition [HitObjectGetSpherePositionNV] Float3 |from, to| write_floats(to, &view(from)?.sphere()?.0);
    GetSphereRadius [HitObjectGetSphereRadiusNV] Float |from, to| write_floats(to, &[view(from)?.sphere()?.1]);
    GetLSSPositions [HitObjectGetLSSPositionsNV] Float3Array2 |from, to| write_floats(to, view(from)?.lss()?.0.as_flattened());
    GetLSSRadii [HitObjectGetLSSRadiiNV] FloatArray2 |from, to| write_floats(to, &view(from)?.lss()?.1);
}

fn view(object: &HitObject) -> Result<IntersectionView<'_>, TrapCode> {
    let (encoded, hit) = object.hit()?;
    let Committed { candidate, t, .. } = &hit.committed;
    Ok(IntersectionView { tlas: &hit.tlas, trace: &encoded.trace, candidate, t: *t, committed: true })
}

/// The view of a hit, or `None` for a miss and an empty hit object.
fn view_of_hit(object: &HitObject) -> Result<Option<IntersectionView<'_>>, TrapCode> {
    object.state()?;
    Ok(view(object).ok())
}
