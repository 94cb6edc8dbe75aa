//! What rays meet: instances of geometries, and the hits of unit tests.

use anyhit::{EndCaps, GeometryData, GeometryFlags, Indexing, InstanceFlags, RayFlags};
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;

use crate::array::{copied_rows, slice, typed};
use crate::error::invalid;
use crate::numbers::{F32, Plain};

/// A ray: origin, direction and interval.
#[pyclass(frozen, module = "anyhit")]
#[derive(Clone)]
pub(crate) struct Ray {
    pub(crate) ray: anyhit::Ray,
}

#[pymethods]
impl Ray {
    /// A ray; t counts lengths of the direction.
    #[new]
    #[pyo3(
        signature = (origin, direction, t_min=F32(0.0), t_max=F32(f32::INFINITY)),
        text_signature = "(origin, direction, t_min=0.0, t_max=...)"
    )]
    fn new(origin: [F32; 3], direction: [F32; 3], t_min: F32, t_max: F32) -> Self {
        let ray = anyhit::Ray::new(origin.plain(), direction.plain());
        Self { ray: ray.with_interval(t_min.plain(), t_max.plain()) }
    }

    /// The origin.
    #[getter]
    fn origin(&self) -> [f32; 3] {
        self.ray.origin
    }

    /// The direction.
    #[getter]
    fn direction(&self) -> [f32; 3] {
        self.ray.direction
    }

    /// The least t of a hit.
    #[getter]
    fn t_min(&self) -> f32 {
        self.ray.t_min
    }

    /// The greatest t of a hit.
    #[getter]
    fn t_max(&self) -> f32 {
        self.ray.t_max
    }

    fn __repr__(&self) -> String {
        let anyhit::Ray { origin, direction, t_min, t_max } = self.ray;
        format!("Ray({origin:?}, {direction:?}, t_min={t_min:?}, t_max={t_max:?})")
    }
}

/// Geometries of one kind each, placed in a scene.
#[pyclass(frozen, module = "anyhit", from_py_object)]
#[derive(Clone)]
pub(crate) struct Instance {
    pub(crate) instance: anyhit::Instance,
}

fn of(data: GeometryData) -> Instance {
    Instance { instance: anyhit::Instance::of(data) }
}

/// Indices of an array, in any shape.
fn indices(given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<u32>>> {
    given
        .map(|given| {
            let array = typed::<u32>("indices", given)?;
            Ok(slice("indices", &array)?.to_vec())
        })
        .transpose()
}

#[pymethods]
impl Instance {
    /// Triangles: corners as an array of shape (N, 3, 3), or vertices (V, 3) with indices (N, 3).
    #[staticmethod]
    #[pyo3(signature = (vertices, indices=None))]
    fn triangles(vertices: &Bound<'_, PyAny>, indices: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let vertices = copied_rows("vertices", vertices, &[&[3], &[3, 3]])?;
        Ok(of(GeometryData::Triangles { vertices, indices: self::indices(indices)?, transform: None }))
    }

    /// Spheres: centres (N, 3) and radii (N,).
    #[staticmethod]
    fn spheres(positions: &Bound<'_, PyAny>, radii: &Bound<'_, PyAny>) -> PyResult<Self> {
        let positions = copied_rows("positions", positions, &[&[3]])?;
        Ok(of(GeometryData::Spheres { positions, radii: self::radii(radii)?, indices: None }))
    }

    /// Linear swept spheres: positions (V, 3) and radii (V,) of their ends. Without indices two
    /// vertices each are a segment; indices (N,) name the first vertex of each segment, whose other
    /// end is the next vertex: chains. End caps are those of the start of each chain and of all
    /// ends, unless `end_caps` is false.
    #[staticmethod]
    #[pyo3(signature = (positions, radii, indices=None, end_caps=true))]
    fn lss(
        positions: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        indices: Option<&Bound<'_, PyAny>>,
        end_caps: bool,
    ) -> PyResult<Self> {
        let indices = self::indices(indices)?;
        Ok(of(GeometryData::LinearSweptSpheres {
            positions: copied_rows("positions", positions, &[&[3]])?,
            radii: self::radii(radii)?,
            indexing: if indices.is_some() { Indexing::Successive } else { Indexing::List },
            indices,
            end_caps: if end_caps { EndCaps::Chained } else { EndCaps::None },
        }))
    }

    /// Boxes for an intersection shader: minimum and maximum, (N, 2, 3).
    #[staticmethod]
    fn aabbs(boxes: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(of(GeometryData::Aabbs(copied_rows("boxes", boxes, &[&[2, 3]])?)))
    }

    /// Adds the geometries of another instance behind its own: `RayGeometryIndexKHR` counts them.
    /// Transform, index, mask and the rest are those of the first.
    fn and_(&self, other: &Self) -> Self {
        Self { instance: self.instance.clone().and(other.instance.clone()) }
    }

    /// Makes the geometries that it has so far opaque: no any-hit shader runs.
    fn opaque(&self) -> Self {
        Self { instance: self.instance.clone().opaque() }
    }

    /// Adds flags of `VkGeometryFlagBitsKHR` to the geometries that it has so far.
    fn geometry_flags(&self, flags: u32) -> Self {
        Self { instance: self.instance.clone().geometry_flags(GeometryFlags(flags)) }
    }

    /// Object to world: three rows of four numbers, (3, 4).
    fn transform(&self, matrix: &Bound<'_, PyAny>) -> PyResult<Self> {
        let rows = copied_rows::<4>("matrix", matrix, &[&[4]])?;
        let rows: [[f32; 4]; 3] =
            rows.try_into().map_err(|rows: Vec<_>| invalid(format!("matrix: {} rows, not 3", rows.len())))?;
        Ok(Self { instance: self.instance.clone().transform(rows) })
    }

    /// Moves it: adds to the last column of its transform.
    fn translate(&self, by: [F32; 3]) -> Self {
        Self { instance: self.instance.clone().translate(by.plain()) }
    }

    /// Sets `InstanceCustomIndexKHR`.
    fn custom_index(&self, custom_index: u32) -> Self {
        Self { instance: self.instance.clone().custom_index(custom_index) }
    }

    /// Sets the mask that the cull masks of rays are compared with; 0xFF unless set.
    fn mask(&self, mask: u8) -> Self {
        Self { instance: self.instance.clone().mask(mask) }
    }

    /// Sets `instanceShaderBindingTableRecordOffset`.
    fn sbt_offset(&self, sbt_offset: u32) -> Self {
        Self { instance: self.instance.clone().sbt_offset(sbt_offset) }
    }

    /// Sets flags of `VkGeometryInstanceFlagBitsKHR`.
    fn flags(&self, flags: u32) -> Self {
        Self { instance: self.instance.clone().flags(InstanceFlags(flags)) }
    }
}

/// Radii: (N,), or a single number.
fn radii(given: &Bound<'_, PyAny>) -> PyResult<Vec<f32>> {
    let array = typed::<f32>("radii", given)?;
    if array.shape().len() > 1 {
        return Err(invalid(format!(
            "radii: an array of {} dimensions, not of shape (N,)",
            array.shape().len()
        )));
    }
    Ok(slice("radii", &array)?.to_vec())
}

/// A primitive and the ray that really hits it, from which every builtin of a hit shader follows.
#[pyclass(frozen, module = "anyhit")]
#[derive(Clone)]
pub(crate) struct Hit {
    pub(crate) hit: anyhit::Hit,
}

#[pymethods]
impl Hit {
    /// The hit of an instance by a ray: of what the ray meets first.
    #[new]
    #[pyo3(
        signature = (instance, ray, *, ray_flags=0, cull_mask=0xFF, time=F32(0.0)),
        text_signature = "(instance, ray, *, ray_flags=0, cull_mask=255, time=0.0)"
    )]
    fn new(instance: &Instance, ray: &Ray, ray_flags: u32, cull_mask: u32, time: F32) -> Self {
        let hit = anyhit::Hit::of(instance.instance.clone()).ray(ray.ray);
        Self { hit: hit.ray_flags(RayFlags(ray_flags)).cull_mask(cull_mask).time(time.plain()) }
    }

    /// The hit of a sphere.
    #[staticmethod]
    fn sphere(position: [F32; 3], radius: F32, ray: &Ray) -> Self {
        Self { hit: anyhit::Hit::sphere(position.plain(), radius.plain()).ray(ray.ray) }
    }

    /// The hit of a linear swept sphere with both end caps: centres and radii of its ends.
    #[staticmethod]
    fn lss(positions: [[F32; 3]; 2], radii: [F32; 2], ray: &Ray) -> Self {
        Self { hit: anyhit::Hit::lss(positions.plain(), radii.plain()).ray(ray.ray) }
    }

    /// The hit of a triangle.
    #[staticmethod]
    fn triangle(vertices: [[F32; 3]; 3], ray: &Ray) -> Self {
        Self { hit: anyhit::Hit::triangle(vertices.plain()).ray(ray.ray) }
    }

    /// A box for an intersection shader, and the ray that enters it.
    #[staticmethod]
    fn aabb(minimum: [F32; 3], maximum: [F32; 3], ray: &Ray) -> Self {
        Self { hit: anyhit::Hit::aabb(minimum.plain(), maximum.plain()).ray(ray.ray) }
    }
}
