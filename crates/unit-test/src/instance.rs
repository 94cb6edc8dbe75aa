//! Instances made in Rust: geometry, where it is placed, and what its builtins say.

use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::accel::{
    self, Blas, EndCaps, Geometry, GeometryData, GeometryFlags, Indexing, InstanceFlags, Motion,
};

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Geometry of one kind, placed in a [`Scene`](crate::scene::Scene) or met by a
/// [`Hit`](crate::hit::Hit).
///
/// ```
/// use anyhit::Instance;
///
/// // Two geometries, of which only the first is opaque, moved and with an index of their own.
/// let instance = Instance::triangle([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
///     .opaque()
///     .and(Instance::triangle([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]))
///     .translate([0.0, 0.0, -3.0])
///     .custom_index(7);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[must_use]
pub struct Instance {
    /// The geometries, in the order of `RayGeometryIndexKHR`.
    #[doc(hidden)]
    pub geometries: Vec<Geometry>,
    /// Object to world.
    #[doc(hidden)]
    pub transform: [[f32; 4]; 3],
    /// Transforms at times 0 and 1.
    #[doc(hidden)]
    pub motion: Option<Motion>,
    /// `InstanceCustomIndexKHR`
    #[doc(hidden)]
    pub custom_index: u32,
    /// The mask that rays' cull masks are compared with.
    #[doc(hidden)]
    pub mask: u8,
    /// `instanceShaderBindingTableRecordOffset`
    #[doc(hidden)]
    pub sbt_offset: u32,
    /// The flags of the instance.
    #[doc(hidden)]
    pub flags: InstanceFlags,
}

impl Instance {
    /// One triangle.
    #[must_use]
    pub fn triangle(vertices: [[f32; 3]; 3]) -> Self {
        Self::triangles(vertices)
    }

    /// Triangles, three vertices each.
    #[must_use]
    pub fn triangles(vertices: impl Into<Vec<[f32; 3]>>) -> Self {
        Self::of(GeometryData::Triangles { vertices: vertices.into(), indices: None, transform: None })
    }

    /// One box for an intersection shader: minimum and maximum.
    #[must_use]
    pub fn aabb(minimum: [f32; 3], maximum: [f32; 3]) -> Self {
        Self::aabbs([[minimum, maximum]])
    }

    /// Boxes for an intersection shader: minimum and maximum each.
    #[must_use]
    pub fn aabbs(boxes: impl IntoIterator<Item = [[f32; 3]; 2]>) -> Self {
        let flat = |[[a, b, c], [d, e, f]]: [[f32; 3]; 2]| [a, b, c, d, e, f];
        Self::of(GeometryData::Aabbs(boxes.into_iter().map(flat).collect()))
    }

    /// One sphere.
    #[must_use]
    pub fn sphere(position: [f32; 3], radius: f32) -> Self {
        Self::spheres([(position, radius)])
    }

    /// Spheres: centre and radius each.
    #[must_use]
    pub fn spheres(spheres: impl IntoIterator<Item = ([f32; 3], f32)>) -> Self {
        let (positions, radii) = spheres.into_iter().unzip();
        Self::of(GeometryData::Spheres { positions, radii, indices: None })
    }

    /// One linear swept sphere with both end caps: centres and radii of its ends.
    #[must_use]
    pub fn lss(positions: [[f32; 3]; 2], radii: [f32; 2]) -> Self {
        Self::of(GeometryData::LinearSweptSpheres {
            positions: positions.to_vec(),
            radii: radii.to_vec(),
            indices: None,
            indexing: Indexing::List,
            end_caps: EndCaps::Chained,
        })
    }

    /// A chain of linear swept spheres through these centres and radii; each segment but the first
    /// has its trailing end cap only.
    #[must_use]
    pub fn chain(vertices: impl IntoIterator<Item = ([f32; 3], f32)>) -> Self {
        let (positions, radii): (Vec<_>, Vec<_>) = vertices.into_iter().unzip();
        let indices = Some((0..positions.len().saturating_sub(1) as u32).collect());
        Self::of(GeometryData::LinearSweptSpheres {
            positions,
            radii,
            indices,
            indexing: Indexing::Successive,
            end_caps: EndCaps::Chained,
        })
    }

    /// Any geometry.
    #[must_use]
    pub fn of(data: GeometryData) -> Self {
        Self {
            geometries: vec![Geometry::new(data, GeometryFlags::default())],
            transform: IDENTITY,
            motion: None,
            custom_index: 0,
            mask: 0xFF,
            sbt_offset: 0,
            flags: InstanceFlags::default(),
        }
    }

    /// Adds the geometries of another instance behind its own: `RayGeometryIndexKHR` counts them.
    /// Each keeps its own opacity; transform, index, mask and the rest are those of the first.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.geometries.extend(other.geometries);
        self
    }

    /// Makes the geometries that it has so far opaque: no any-hit shader runs.
    #[must_use]
    pub fn opaque(self) -> Self {
        self.geometry_flags(GeometryFlags::OPAQUE)
    }

    /// Adds flags to the geometries that it has so far.
    #[must_use]
    pub fn geometry_flags(mut self, flags: GeometryFlags) -> Self {
        for geometry in &mut self.geometries {
            geometry.flags = GeometryFlags(geometry.flags.0 | flags.0);
        }
        self
    }

    /// `ClusterIDNV` of the geometries that it has so far; -1 unless set.
    #[must_use]
    pub fn cluster_id(mut self, cluster_id: u32) -> Self {
        for geometry in &mut self.geometries {
            geometry.cluster_id = Some(cluster_id);
        }
        self
    }

    /// Object to world, row-major 3x4 (`VkTransformMatrixKHR`).
    #[must_use]
    pub fn transform(self, transform: [[f32; 4]; 3]) -> Self {
        Self { transform, ..self }
    }

    /// Moves the instance: adds to the last column of its transform.
    #[must_use]
    pub fn translate(mut self, by: [f32; 3]) -> Self {
        for (row, by) in self.transform.iter_mut().zip(by) {
            row[3] += by;
        }
        self
    }

    /// How it moves while the time of rays goes from 0 to 1: in place of a transform. An instance
    /// that has both is an error of the scene.
    #[must_use]
    pub fn motion(self, motion: Motion) -> Self {
        Self { motion: Some(motion), ..self }
    }

    /// Where the vertices of its last geometry, triangles, are at time 1; its own are those of time
    /// 0.
    #[must_use]
    pub fn vertices_t1(mut self, vertices: impl Into<Vec<[f32; 3]>>) -> Self {
        if let Some(geometry) = self.geometries.last_mut() {
            geometry.vertices_t1 = Some(vertices.into().into());
        }
        self
    }

    /// `InstanceCustomIndexKHR`
    #[must_use]
    pub fn custom_index(self, custom_index: u32) -> Self {
        Self { custom_index, ..self }
    }

    /// The mask that rays' cull masks are compared with; 0xFF unless set.
    #[must_use]
    pub fn mask(self, mask: u8) -> Self {
        Self { mask, ..self }
    }

    /// `instanceShaderBindingTableRecordOffset`
    #[must_use]
    pub fn sbt_offset(self, sbt_offset: u32) -> Self {
        Self { sbt_offset, ..self }
    }

    /// Its flags.
    #[must_use]
    pub fn flags(self, flags: InstanceFlags) -> Self {
        Self { flags, ..self }
    }

    /// The first geometry in words, for errors.
    pub(super) fn describe(&self) -> String {
        self.geometries.iter().map(|geometry| format!("{:?}", geometry.data)).collect::<Vec<_>>().join("\n")
    }

    /// # Errors
    /// `InvalidScene` for numbers that no geometry may have, for unknown bits in flags, and for a
    /// transform beside a motion.
    pub(super) fn make(self) -> Result<accel::TlasInstance> {
        if self.motion.is_some() && self.transform != IDENTITY {
            let message = "an instance with a motion also has a transform, which would be ignored";
            return Err(Error::new(ErrorKind::InvalidScene, message).note(
                "leave out `.transform` and `.translate`: the two keys of `Motion` place the instance",
            ));
        }
        let unknown = |what: &str, bits: u32, known: u32, constants: &str| match bits & !known {
            0 => Ok(()),
            unknown => {
                let message = format!("the {what} flags {bits:#x} contain bit {}", unknown.trailing_zeros());
                let how = format!("combine the constants of `{constants}`");
                Err(Error::new(ErrorKind::InvalidScene, message).note(how))
            }
        };
        unknown("instance", self.flags.0, 0x3F, "InstanceFlags")?;
        for geometry in &self.geometries {
            unknown("geometry", geometry.flags.0, 3, "GeometryFlags")?;
        }
        Ok(accel::TlasInstance {
            blas: Blas::new(self.geometries)?,
            transform: self.transform,
            motion: self.motion,
            custom_index: self.custom_index,
            mask: self.mask,
            sbt_record_offset: self.sbt_offset,
            flags: self.flags,
        })
    }
}
