//! Recorded hits of a GPU, and their comparison with the engine: `anyhit verify`.
//!
//! A [`Recording`] is a safetensors file with geometry, instances, rays, and the result of each
//! ray: `driver.*` from a driver, `reference.*` from an independent computation of higher
//! precision. [`compare`](mod@compare) traces the rays once more and counts what differs.
//! `docs/verify.md` lists the tensors that a file may contain.

pub mod compare;
mod geometry;
mod ray;
mod tensors;

use std::path::Path;
use std::sync::Arc;

use crate::recording::tensors::Tensors;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, read_argument};
use anyhit_engine::accel::geometry::primitive_count;
use anyhit_engine::accel::{InstanceFlags, Tlas, TlasInstance, TraceRay};
use anyhit_engine::math::array;

pub use compare::Comparison;
pub use ray::TracedRay;

/// The contents of a recording: geometries, rays, and the recorded results.
#[derive(Debug)]
pub struct Recording {
    /// The acceleration structure: every instance holds all geometries.
    #[doc(hidden)]
    pub tlas: Arc<Tlas>,
    /// The rays.
    #[doc(hidden)]
    pub rays: Vec<TraceRay>,
    /// The results of a driver, if recorded.
    #[doc(hidden)]
    pub driver: Option<Driver>,
    /// The results of a computation of higher precision, if recorded.
    #[doc(hidden)]
    pub reference: Option<Reference>,
    /// The sphere, as centre and radius, that the intersection shader tests in each box, for all
    /// boxes of all geometries in order.
    spheres: Vec<[f32; 4]>,
    /// Tensors that would define part of the scene, but whose names are unknown.
    #[doc(hidden)]
    pub unknown_tensors: Vec<String>,
    /// Notes on geometry that was left out.
    #[doc(hidden)]
    pub notes: Vec<String>,
    /// By geometry: the index of its first box's sphere.
    first_sphere: Vec<usize>,
}

/// The primitive that each ray hit, as far as it was recorded; by ray, -1 for a miss.
#[derive(Clone, Debug, Default)]
pub struct RecordedPrimitives {
    /// `InstanceId`
    pub instance: Option<Vec<i64>>,
    /// `RayGeometryIndexKHR`
    pub geometry: Option<Vec<i64>>,
    /// `PrimitiveId`
    pub primitive: Option<Vec<i64>>,
}

/// `reference.*`, by ray.
#[derive(Clone, Debug)]
pub struct Reference {
    /// t, negative for a miss.
    pub t: Vec<f64>,
    /// The low part of t, which is a sum of two floats.
    pub t_low: Option<Vec<f64>>,
    /// The primitive.
    pub primitives: RecordedPrimitives,
    /// The least relative distance of a decision from changing; an exact 0 is a tangent.
    pub margin: Option<Vec<f64>>,
    /// Relative distance of the nearest edge of a triangle.
    pub edge_margin: Option<Vec<f64>>,
    /// u of a linear swept sphere.
    pub lss_hit_value: Option<Vec<f64>>,
    /// Barycentrics of the second and third vertex.
    pub barycentrics: Option<Vec<[f64; 2]>>,
}

/// `driver.*`, by ray.
#[derive(Clone, Debug)]
pub struct Driver {
    /// t, negative for a miss and where no closest-hit shader ran.
    pub t: Vec<f64>,
    /// The primitive.
    pub primitives: RecordedPrimitives,
    /// `InstanceCustomIndexKHR`
    pub instance_custom_index: Option<Vec<i64>>,
    /// `HitKindKHR`
    pub hit_kind: Option<Vec<i64>>,
    /// Whether the closest-hit shader ran.
    pub closest_hit_ran: Option<Vec<i64>>,
    /// Whether the miss shader ran.
    pub miss_ran: Option<Vec<i64>>,
    /// How often an any-hit shader that accepts ran.
    pub any_hit_count: Option<Vec<i64>>,
    /// How often an any-hit shader that ignores ran.
    pub candidate_count: Option<Vec<i64>>,
    /// Hit attributes: barycentrics, or what the boxes' intersection shader reported.
    pub attribute: Option<Vec<[f64; 2]>>,
    /// u of a linear swept sphere.
    pub lss_hit_value: Option<Vec<f64>>,
    /// Whether the hit is a linear swept sphere.
    pub is_lss: Option<Vec<i64>>,
    /// Whether the hit is a sphere.
    pub is_sphere: Option<Vec<i64>>,
    /// Positions with radii: four floats of a sphere, twice four of a linear swept sphere.
    pub position_radius: Option<Vec<Vec<f64>>>,
    /// `ObjectRayOriginKHR` and `ObjectRayDirectionKHR`
    pub object_ray: [Option<Vec<[f64; 3]>>; 2],
}

impl Recording {
    /// Reads a file, which may be a pipe, with the default limit of its bytes.
    ///
    /// # Errors
    /// `Io` where it cannot be read; otherwise as [`Recording::of`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::open_within(path, &InputLimits::default())
    }

    /// Reads a file with these limits.
    ///
    /// # Errors
    /// As [`Recording::open`], and `InvalidArgument` where it is larger than the limit
    /// `file-bytes`.
    #[doc(hidden)]
    pub fn open_within(path: impl AsRef<Path>, limits: &InputLimits) -> Result<Self> {
        let path = path.as_ref();
        Self::of_file(path, &read_argument(path, InputLimit::FileBytes, limits)?)
    }

    /// Reads the bytes of a file, whose name stands in errors.
    ///
    /// # Errors
    /// As [`Recording::of`].
    #[doc(hidden)]
    pub fn of_file(path: &Path, bytes: &[u8]) -> Result<Self> {
        let name = escape::path(&path).to_string();
        Self::of(bytes).map_err(|error| error.context(name).at(Place::File(path.to_path_buf())))
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// `InvalidRecording`, naming the tensor, where one is missing, of another type or shape, or
    /// holds values that are invalid for a geometry, instance or ray.
    pub fn of(bytes: &[u8]) -> Result<Self> {
        let tensors = Tensors::of(bytes)?;
        let mut notes = Vec::new();
        let geometries = geometry::read(&tensors, &mut notes)?;
        let first_sphere: Vec<usize> = geometries
            .iter()
            .scan(0, |sum, geometry| {
                let first = *sum;
                *sum += geometry.data.primitive_count();
                Some(first)
            })
            .collect();
        let boxes = primitive_count(&geometries);
        let blas = anyhit_engine::accel::Blas::new(geometries).map_err(invalid)?;
        let spheres = procedural_spheres(&tensors, blas.geometries(), boxes)?;
        let tlas = Tlas::new(instances(&tensors, &blas)?).map_err(invalid)?;
        let rays = ray::read(&tensors)?;
        let (driver, reference) = (driver(&tensors, rays.len())?, reference(&tensors, rays.len())?);
        if driver.is_none() && reference.is_none() {
            let message =
                "the recording contains neither `driver.t` nor `reference.t`: nothing to compare with";
            return Err(Error::new(ErrorKind::InvalidRecording, message));
        }
        let unknown_tensors = tensors.unknown_tensors();
        Ok(Self { tlas, rays, driver, reference, spheres, unknown_tensors, notes, first_sphere })
    }

    /// The kind of primitive of its geometries.
    #[doc(hidden)]
    pub fn kind(&self) -> Option<anyhit_engine::accel::GeometryKind> {
        self.tlas.instances().first().and_then(|instance| instance.blas.kind())
    }
}

/// Turns an error of a scene into one of the recording.
fn invalid(error: Error) -> Error {
    let messages = std::iter::once(error.message()).chain(error.others().iter().map(Error::message));
    let errors = messages.map(|message| Error::new(ErrorKind::InvalidRecording, message));
    Error::several(errors.collect())
}

fn procedural_spheres(
    tensors: &Tensors<'_>,
    geometries: &[anyhit_engine::accel::Geometry],
    boxes: usize,
) -> Result<Vec<[f32; 4]>> {
    const NAME: &str = "procedural.sphere";
    let procedural =
        geometries.iter().any(|geometry| geometry.data.kind() == anyhit_engine::accel::GeometryKind::Aabbs);
    match (procedural, tensors.rows::<4>(NAME)?) {
        (false, _) => Ok(Vec::new()),
        (true, None) => {
            Err(tensors.missing(NAME).note("it contains centre and radius of the sphere in each box"))
        }
        (true, Some(spheres)) if spheres.len() != boxes => {
            let message = format!("`{NAME}` has {} rows for {boxes} boxes", spheres.len());
            Err(Error::new(ErrorKind::InvalidRecording, message))
        }
        (true, Some(spheres)) => Ok(spheres),
    }
}

fn instances(tensors: &Tensors<'_>, blas: &Arc<anyhit_engine::accel::Blas>) -> Result<Vec<TlasInstance>> {
    const IDENTITY: [f32; 12] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0.];
    let transforms = tensors.matrices("instance.object_to_world")?.unwrap_or_else(|| vec![IDENTITY]);
    let count = transforms.len();
    let field = |part: &str, bits: u32| tensors.unsigned(&format!("instance.{part}"), count, bits);
    let (masks, flags) = (field("mask", 8)?, field("flags", 8)?);
    let (custom, offsets) = (field("custom_index", 24)?, field("sbt_offset", 24)?);
    let of = |all: &Option<Vec<u32>>, at: usize, without: u32| all.as_ref().map_or(without, |all| all[at]);
    let instance = |(at, m): (usize, &[f32; 12])| TlasInstance {
        blas: blas.clone(),
        transform: array::from_fn(|row| array::from_fn(|column| m[4 * row + column])),
        motion: None,
        // Only the low 24 bits, if there are more instances than that.
        custom_index: of(&custom, at, (100 + at as u32) & 0xFF_FFFF),
        mask: of(&masks, at, 0xFF) as u8,
        sbt_record_offset: of(&offsets, at, 0),
        flags: InstanceFlags(of(&flags, at, 0)),
    };
    Ok(transforms.iter().enumerate().map(instance).collect())
}

fn primitives(tensors: &Tensors<'_>, of: &str, rays: usize) -> Result<RecordedPrimitives> {
    Ok(RecordedPrimitives {
        instance: tensors.integers(&format!("{of}.instance_id"), rays)?,
        geometry: tensors.integers(&format!("{of}.geometry_index"), rays)?,
        primitive: tensors.integers(&format!("{of}.primitive_id"), rays)?,
    })
}

fn reference(tensors: &Tensors<'_>, rays: usize) -> Result<Option<Reference>> {
    let Some(t) = tensors.floats("reference.t", rays)? else { return Ok(None) };
    Ok(Some(Reference {
        t,
        t_low: tensors.floats("reference.t_low", rays)?,
        primitives: primitives(tensors, "reference", rays)?,
        margin: tensors.floats("reference.margin", rays)?,
        edge_margin: tensors.floats("reference.edge_margin", rays)?,
        lss_hit_value: tensors.floats("reference.lss_hit_value", rays)?,
        barycentrics: tensors.float_rows("reference.barycentrics", rays)?,
    }))
}

fn driver(tensors: &Tensors<'_>, rays: usize) -> Result<Option<Driver>> {
    let Some(t) = tensors.floats("driver.t", rays)? else { return Ok(None) };
    let integers = |part: &str| tensors.integers(&format!("driver.{part}"), rays);
    Ok(Some(Driver {
        t,
        primitives: primitives(tensors, "driver", rays)?,
        instance_custom_index: integers("instance_custom_index")?,
        hit_kind: integers("hit_kind")?,
        closest_hit_ran: integers("closest_hit_ran")?,
        miss_ran: integers("miss_ran")?,
        any_hit_count: integers("any_hit_count")?,
        candidate_count: integers("candidate_count")?,
        attribute: tensors.float_rows("driver.attribute", rays)?,
        lss_hit_value: tensors.floats("driver.lss_hit_value", rays)?,
        is_lss: integers("is_lss")?,
        is_sphere: integers("is_sphere")?,
        position_radius: tensors.rows_of_lengths("driver.position_radius", rays, &[4, 8])?,
        object_ray: [
            tensors.float_rows("driver.object_ray_origin", rays)?,
            tensors.float_rows("driver.object_ray_direction", rays)?,
        ],
    }))
}
