//! What instructions read of an intersection: a candidate, a committed hit, or what a hit object
//! encodes.

use crate::accel::{Candidate, Primitive, Tlas, TraceRay};
use crate::geometry::{ObjectRay, Surface};
use crate::machine::TrapCode;
use crate::ops::builtin::{columns, floats};

/// An intersection with its ray.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    /// The acceleration structure.
    pub tlas: &'a Tlas,
    /// The ray and its time.
    pub trace: &'a TraceRay,
    /// What the ray meets.
    pub candidate: &'a Candidate,
    /// Where; for a box's candidate its entry.
    pub t: f32,
    /// Whether it is a hit, not a candidate.
    pub committed: bool,
}

/// Writes one word.
pub fn word(to: &mut [u32], word: u32) -> Result<(), TrapCode> {
    to[0] = word;
    Ok(())
}

/// Writes floats.
pub fn put(to: &mut [u32], values: &[f32]) -> Result<(), TrapCode> {
    floats(to, values);
    Ok(())
}

impl Seen<'_> {
    /// The ray parameter, which a box's candidate has none of.
    pub fn t(self, to: &mut [u32]) -> Result<(), TrapCode> {
        if self.candidate.is_box() && !self.committed {
            return Err(TrapCode::RayQueryNotTriangle);
        }
        put(to, &[self.t])
    }

    /// `InstanceCustomIndexKHR`
    pub fn custom_index(self, to: &mut [u32]) -> Result<(), TrapCode> {
        word(to, self.candidate.instance_in(self.tlas).custom_index)
    }

    /// `instanceShaderBindingTableRecordOffset`
    pub fn sbt_record_offset(self, to: &mut [u32]) -> Result<(), TrapCode> {
        word(to, self.candidate.instance_in(self.tlas).sbt_record_offset)
    }

    /// Barycentrics; (u, 0) of spheres and linear swept spheres.
    pub fn barycentrics(self, to: &mut [u32]) -> Result<(), TrapCode> {
        self.no_box()?;
        put(to, &self.candidate.intersection.attributes)
    }

    /// Whether a triangle shows its front.
    pub fn front_face(self, to: &mut [u32]) -> Result<(), TrapCode> {
        self.no_box()?;
        word(to, u32::from(self.candidate.intersection.surface == Surface::TriangleFront))
    }

    fn no_box(self) -> Result<(), TrapCode> {
        if self.candidate.is_box() { Err(TrapCode::RayQueryNotTriangle) } else { Ok(()) }
    }

    /// A part of the ray in object space.
    pub fn object_ray(self, to: &mut [u32], part: fn(&ObjectRay) -> [f32; 3]) -> Result<(), TrapCode> {
        let ray = self.tlas.object_ray(self.candidate.instance, &self.trace.ray, self.trace.time);
        put(to, &ray.map_or([0.0; 3], |ray| part(&ray)))
    }

    /// `ObjectToWorldKHR`
    pub fn object_to_world(self, to: &mut [u32]) -> Result<(), TrapCode> {
        columns(to, &self.candidate.instance_in(self.tlas).object_to_world(self.trace.time));
        Ok(())
    }

    /// `WorldToObjectKHR`
    pub fn world_to_object(self, to: &mut [u32]) -> Result<(), TrapCode> {
        columns(to, &self.tlas.world_to_object(self.candidate.instance, self.trace.time));
        Ok(())
    }

    /// The vertices of a triangle.
    pub fn vertex_positions(self, to: &mut [u32]) -> Result<(), TrapCode> {
        match self.candidate.primitive_in(self.tlas, self.trace.time) {
            Some(Primitive::Triangle(vertices)) => put(to, vertices.as_flattened()),
            _ => Err(TrapCode::NotTriangle),
        }
    }

    /// Whether it is a sphere.
    pub fn is_sphere(self) -> bool {
        self.candidate.intersection.surface == Surface::Sphere
    }

    /// Whether it is a linear swept sphere.
    pub fn is_lss(self) -> bool {
        matches!(self.candidate.intersection.surface, Surface::Side | Surface::Cap0 | Surface::Cap1)
    }

    /// Centre and radius of a sphere.
    pub fn sphere(self) -> Result<([f32; 3], f32), TrapCode> {
        match self.candidate.primitive_in(self.tlas, self.trace.time) {
            Some(Primitive::Sphere { position, radius }) => Ok((position, radius)),
            _ => Err(TrapCode::NotSphere),
        }
    }

    /// Centres and radii of a linear swept sphere.
    pub fn lss(self) -> Result<([[f32; 3]; 2], [f32; 2]), TrapCode> {
        match self.candidate.primitive_in(self.tlas, self.trace.time) {
            Some(Primitive::LinearSweptSphere { positions, radii, .. }) => Ok((positions, radii)),
            _ => Err(TrapCode::NotLinearSweptSphere),
        }
    }
}
