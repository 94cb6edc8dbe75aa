//! A view of an intersection, for the instructions that read one: a candidate, a committed hit, or
//! the hit of a hit object.

use crate::accel::{Candidate, Primitive, Tlas, TraceRay};
use crate::geometry::{ObjectRay, Surface};
use crate::machine::TrapCode;
use crate::ops::builtin::{columns, floats};

/// An intersection with its ray.
#[derive(Clone, Copy, Debug)]
pub struct IntersectionView<'a> {
    /// The acceleration structure.
    pub tlas: &'a Tlas,
    /// The ray and its time.
    pub trace: &'a TraceRay,
    /// The candidate, or that which was committed.
    pub candidate: &'a Candidate,
    /// The ray parameter; for the candidate of a box, that of its entry.
    pub t: f32,
    /// Whether it is a committed hit, not a candidate.
    pub committed: bool,
}

/// Writes one word.
pub fn write_word(to: &mut [u32], word: u32) -> Result<(), TrapCode> {
    to[0] = word;
    Ok(())
}

/// Writes floats.
pub fn write_floats(to: &mut [u32], values: &[f32]) -> Result<(), TrapCode> {
    floats(to, values);
    Ok(())
}

impl IntersectionView<'_> {
    /// The ray parameter, which the candidate of a box does not have.
    #[inline]
    pub fn t(self, to: &mut [u32]) -> Result<(), TrapCode> {
        if self.candidate.is_box() && !self.committed {
            return Err(TrapCode::RayQueryNotTriangle);
        }
        write_floats(to, &[self.t])
    }

    /// `InstanceCustomIndexKHR`
    pub fn custom_index(self, to: &mut [u32]) -> Result<(), TrapCode> {
        write_word(to, self.candidate.instance_in(self.tlas).custom_index)
    }

    /// `instanceShaderBindingTableRecordOffset`
    pub fn sbt_record_offset(self, to: &mut [u32]) -> Result<(), TrapCode> {
        write_word(to, self.candidate.instance_in(self.tlas).sbt_record_offset)
    }

    /// Barycentrics; (u, 0) of spheres and linear swept spheres.
    #[inline]
    pub fn barycentrics(self, to: &mut [u32]) -> Result<(), TrapCode> {
        self.require_not_box()?;
        write_floats(to, &self.candidate.intersection.attributes)
    }

    /// Whether a triangle shows its front.
    pub fn front_face(self, to: &mut [u32]) -> Result<(), TrapCode> {
        self.require_not_box()?;
        write_word(to, u32::from(self.candidate.intersection.surface == Surface::TriangleFront))
    }

    fn require_not_box(self) -> Result<(), TrapCode> {
        if self.candidate.is_box() { Err(TrapCode::RayQueryNotTriangle) } else { Ok(()) }
    }

    /// A part of the ray in object space.
    pub fn object_ray(self, to: &mut [u32], part: fn(&ObjectRay) -> [f32; 3]) -> Result<(), TrapCode> {
        let ray = self.tlas.object_ray(self.candidate.instance, &self.trace.ray, self.trace.time);
        write_floats(to, &ray.map_or([0.0; 3], |ray| part(&ray)))
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
            Some(Primitive::Triangle(vertices)) => write_floats(to, vertices.as_flattened()),
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
