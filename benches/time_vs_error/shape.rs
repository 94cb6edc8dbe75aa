//! Primitives by value, as the contenders take them.

use anyhit_engine::accel::{Geometry, GeometryData, GeometryFlags, Primitive};

/// The least and the greatest corner of a box.
pub type Corners = [[f32; 3]; 2];

#[derive(Clone, Copy, Debug)]
pub enum Shape {
    Sphere([f32; 3], f32),
    Swept([[f32; 3]; 2], [f32; 2]),
    Triangle([[f32; 3]; 3]),
    Aabb([[f32; 3]; 2]),
}

impl Shape {
    /// All primitives of a geometry.
    pub fn all(data: &GeometryData) -> Vec<Self> {
        (0..data.primitive_count() as u32)
            .map(|number| match data.primitive(number) {
                Primitive::Sphere { position, radius } => Self::Sphere(position, radius),
                Primitive::LinearSweptSphere { positions, radii, .. } => Self::Swept(positions, radii),
                Primitive::Triangle(vertices) => Self::Triangle(vertices),
                Primitive::Aabb([x0, y0, z0, x1, y1, z1]) => Self::Aabb([[x0, y0, z0], [x1, y1, z1]]),
            })
            .collect()
    }

    pub fn corners(&self) -> Corners {
        let ball = |c: [f32; 3], r: f32| [c.map(|x| (x - r).next_down()), c.map(|x| (x + r).next_up())];
        let union = |a: Corners, b: Corners| {
            [std::array::from_fn(|i| a[0][i].min(b[0][i])), std::array::from_fn(|i| a[1][i].max(b[1][i]))]
        };
        match *self {
            Self::Sphere(center, radius) => ball(center, radius),
            Self::Swept([p, q], [r0, r1]) => union(ball(p, r0), ball(q, r1)),
            Self::Triangle([a, b, c]) => union(union([a, a], [b, b]), [c, c]),
            Self::Aabb(corners) => corners,
        }
    }
}

/// An opaque geometry of these primitives.
pub fn opaque(data: GeometryData) -> Geometry {
    Geometry::new(data, GeometryFlags::OPAQUE)
}
