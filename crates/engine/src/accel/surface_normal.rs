//! The exact normal of what a ray has hit.

use crate::accel::hit::HitPrimitive;
use crate::accel::primitive::Primitive;
use crate::accel::tlas::Tlas;
use crate::accel::trace_ray::TraceRay;
use crate::geometry::SurfaceNormal;

/// The exact unit normal, at the time of the ray, of the triangle, sphere or linear swept sphere
/// that a ray hits. `None` for a box, whose surface an intersection shader decides, for an apex,
/// and where the ray does not hit the primitive.
pub fn surface_normal(tlas: &Tlas, trace: &TraceRay, hit: HitPrimitive) -> Option<SurfaceNormal> {
    let instance = tlas.instances().get(hit.instance as usize)?;
    let ray = tlas.object_ray(hit.instance, &trace.ray, trace.time)?;
    match instance.blas.primitive(hit.geometry, hit.primitive, trace.time)? {
        Primitive::Triangle(vertices) => SurfaceNormal::of_triangle(&ray, vertices),
        Primitive::Sphere { position, radius } => SurfaceNormal::of_sphere(&ray, position, radius),
        Primitive::LinearSweptSphere { positions, radii, .. } => {
            SurfaceNormal::of_linear_swept_sphere(&ray, positions, radii)
        }
        Primitive::Aabb(_) => None,
    }
}
