//! What rays meet: instances of geometries, and the hits of unit tests.

use std::hash::{DefaultHasher, Hash, Hasher};

use anyhit::{EndCaps, GeometryData, GeometryFlags, Indexing, InstanceFlags, Motion, RayFlags};
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::argument::{self, Bytes, Vertices};
use crate::array::{copied_rows, slice, typed};
use crate::copies::never_changes;
use crate::error::invalid;
use crate::pickled;
use crate::used::Use;

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
        signature = (origin, direction, t_min=0.0, t_max=f32::INFINITY),
        text_signature = "(origin, direction, t_min=0.0, t_max=...)"
    )]
    fn new(
        #[pyo3(from_py_with = argument::origin)] origin: [f32; 3],
        #[pyo3(from_py_with = argument::direction)] direction: [f32; 3],
        #[pyo3(from_py_with = argument::t_min)] t_min: f32,
        #[pyo3(from_py_with = argument::t_max)] t_max: f32,
    ) -> Self {
        Self { ray: anyhit::Ray::new(origin, direction).with_interval(t_min, t_max) }
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

    fn __eq__(&self, other: &Self) -> bool {
        self.ray == other.ray
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        hash_ray(&self.ray, &mut hasher);
        hasher.finish()
    }

    fn __getnewargs__(&self) -> ([f32; 3], [f32; 3], f32, f32) {
        let anyhit::Ray { origin, direction, t_min, t_max } = self.ray;
        (origin, direction, t_min, t_max)
    }

    fn __repr__(&self) -> String {
        let anyhit::Ray { origin, direction, t_min, t_max } = self.ray;
        format!("Ray({origin:?}, {direction:?}, t_min={t_min:?}, t_max={t_max:?})")
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        slf.py().import("anyhit._html")?.getattr("of_ray")?.call1((slf,))?.extract()
    }
}

/// Hashes the numbers of a ray; -0.0 as 0.0, which it equals.
fn hash_ray(ray: &anyhit::Ray, hasher: &mut DefaultHasher) {
    let anyhit::Ray { origin, direction, t_min, t_max } = *ray;
    let numbers = origin.into_iter().chain(direction).chain([t_min, t_max]);
    numbers.for_each(|number| (number + 0.0).to_bits().hash(hasher));
}

/// Hashes the integers of an instance and the sizes of its geometries.
fn hash_instance(instance: &anyhit::Instance, hasher: &mut DefaultHasher) {
    let counts = instance.geometries.iter().map(|geometry| geometry.data.primitive_count());
    counts.for_each(|count| count.hash(hasher));
    (instance.custom_index, instance.mask, instance.sbt_offset, instance.flags.0).hash(hasher);
}

/// Geometries of one kind each, placed in a scene.
#[pyclass(frozen, module = "anyhit")]
#[derive(Clone)]
pub(crate) struct Instance {
    pub(crate) instance: anyhit::Instance,
    used: Use,
}

fn of(data: GeometryData) -> Instance {
    Instance { instance: anyhit::Instance::of(data), used: Use::free() }
}

impl Instance {
    fn with(&self, method: &'static str, change: impl FnOnce(anyhit::Instance) -> anyhit::Instance) -> Self {
        self.used.mark();
        Self { instance: change(self.instance.clone()), used: Use::of("Instance", method) }
    }
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
        #[pyo3(from_py_with = argument::end_caps)] end_caps: bool,
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
    fn and_(&self, #[pyo3(from_py_with = argument::other)] other: Self) -> Self {
        self.with("and_", |instance| instance.and(other.instance))
    }

    /// Makes the geometries that it has so far opaque: no any-hit shader runs.
    fn opaque(&self) -> Self {
        self.with("opaque", |instance| instance.opaque())
    }

    /// Adds flags of `VkGeometryFlagBitsKHR` to the geometries that it has so far.
    fn geometry_flags(&self, #[pyo3(from_py_with = argument::flags)] flags: u32) -> Self {
        self.with("geometry_flags", |instance| instance.geometry_flags(GeometryFlags(flags)))
    }

    /// Object to world: three rows of four numbers, (3, 4).
    fn transform(&self, matrix: &Bound<'_, PyAny>) -> PyResult<Self> {
        let rows = self::matrix("matrix", matrix)?;
        Ok(self.with("transform", |instance| instance.transform(rows)))
    }

    /// Moves it while the time of rays goes from 0 to 1: its transforms at both ends, (3, 4), in
    /// place of a transform.
    fn motion(&self, start: &Bound<'_, PyAny>, end: &Bound<'_, PyAny>) -> PyResult<Self> {
        let motion = Motion::Matrix([matrix("start", start)?, matrix("end", end)?]);
        Ok(self.with("motion", |instance| instance.motion(motion)))
    }

    /// Sets where the vertices of its last geometry, triangles, are at time 1: (V, 3). Its own are
    /// those of time 0.
    fn vertices_t1(&self, vertices: &Bound<'_, PyAny>) -> PyResult<Self> {
        let vertices: Vec<[f32; 3]> = copied_rows("vertices", vertices, &[&[3], &[3, 3]])?;
        Ok(self.with("vertices_t1", |instance| instance.vertices_t1(vertices)))
    }

    /// Sets the cluster of its last geometry.
    fn cluster_id(&self, #[pyo3(from_py_with = argument::cluster_id)] cluster_id: u32) -> Self {
        self.with("cluster_id", |instance| instance.cluster_id(cluster_id))
    }

    /// Moves it: adds to the last column of its transform.
    fn translate(&self, #[pyo3(from_py_with = argument::by)] by: [f32; 3]) -> Self {
        self.with("translate", |instance| instance.translate(by))
    }

    /// Sets `InstanceCustomIndexKHR`.
    fn custom_index(&self, #[pyo3(from_py_with = argument::custom_index)] custom_index: u32) -> Self {
        self.with("custom_index", |instance| instance.custom_index(custom_index))
    }

    /// Sets the mask that the cull masks of rays are compared with; 0xFF unless set.
    fn mask(&self, #[pyo3(from_py_with = argument::mask)] mask: u8) -> Self {
        self.with("mask", |instance| instance.mask(mask))
    }

    /// Sets `instanceShaderBindingTableRecordOffset`.
    fn sbt_offset(&self, #[pyo3(from_py_with = argument::sbt_offset)] sbt_offset: u32) -> Self {
        self.with("sbt_offset", |instance| instance.sbt_offset(sbt_offset))
    }

    /// Sets flags of `VkGeometryInstanceFlagBitsKHR`.
    fn flags(&self, #[pyo3(from_py_with = argument::flags)] flags: u32) -> Self {
        self.with("flags", |instance| instance.flags(InstanceFlags(flags)))
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.instance == other.instance
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        hash_instance(&self.instance, &mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        self.used.mark();
        let restore = py.import("anyhit._anyhit")?.getattr("_instance")?;
        Ok((restore, (PyBytes::new(py, &pickled::to_bytes(&self.instance)?),)))
    }
}

/// Restores a pickled instance.
#[pyfunction]
pub(crate) fn _instance(#[pyo3(from_py_with = argument::data)] data: Bytes) -> PyResult<Instance> {
    Ok(Instance { instance: pickled::from_bytes(&data.0)?, used: Use::free() })
}

/// A transform: three rows of four numbers.
pub(crate) fn matrix(name: &str, given: &Bound<'_, PyAny>) -> PyResult<[[f32; 4]; 3]> {
    let rows = copied_rows::<4>(name, given, &[&[4]])?;
    rows.try_into().map_err(|rows: Vec<_>| invalid(format!("{name}: {} rows, not 3", rows.len())))
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

/// What a pickled hit is made of: instance, ray and keywords.
type HitArguments<'py> = ((Instance, Option<Ray>), Bound<'py, PyDict>);

#[pymethods]
impl Hit {
    /// The hit of an instance by a ray: of what the ray meets first.
    #[new]
    #[pyo3(
        signature = (instance, ray, *, ray_flags=0, cull_mask=0xFF, time=0.0),
        text_signature = "(instance, ray, *, ray_flags=0, cull_mask=255, time=0.0)"
    )]
    fn new(
        #[pyo3(from_py_with = argument::instance)] instance: Instance,
        #[pyo3(from_py_with = argument::ray)] ray: Ray,
        #[pyo3(from_py_with = argument::ray_flags)] ray_flags: u32,
        #[pyo3(from_py_with = argument::cull_mask)] cull_mask: u8,
        #[pyo3(from_py_with = argument::time)] time: f32,
    ) -> Self {
        let hit = anyhit::Hit::of(instance.instance).ray(ray.ray);
        Self { hit: hit.ray_flags(RayFlags(ray_flags)).cull_mask(cull_mask.into()).time(time) }
    }

    /// The hit of a sphere.
    #[staticmethod]
    fn sphere(
        #[pyo3(from_py_with = argument::position)] position: [f32; 3],
        #[pyo3(from_py_with = argument::radius)] radius: f32,
        #[pyo3(from_py_with = argument::ray)] ray: Ray,
    ) -> Self {
        Self { hit: anyhit::Hit::sphere(position, radius).ray(ray.ray) }
    }

    /// The hit of a linear swept sphere with both end caps: centres and radii of its ends.
    #[staticmethod]
    fn lss(
        #[pyo3(from_py_with = argument::two_ends)] positions: Vertices<2>,
        #[pyo3(from_py_with = argument::two_radii)] radii: [f32; 2],
        #[pyo3(from_py_with = argument::ray)] ray: Ray,
    ) -> Self {
        Self { hit: anyhit::Hit::lss(positions.0, radii).ray(ray.ray) }
    }

    /// The hit of a triangle.
    #[staticmethod]
    fn triangle(
        #[pyo3(from_py_with = argument::vertices)] vertices: Vertices<3>,
        #[pyo3(from_py_with = argument::ray)] ray: Ray,
    ) -> Self {
        Self { hit: anyhit::Hit::triangle(vertices.0).ray(ray.ray) }
    }

    /// A box for an intersection shader, and the ray that enters it.
    #[staticmethod]
    fn aabb(
        #[pyo3(from_py_with = argument::minimum)] minimum: [f32; 3],
        #[pyo3(from_py_with = argument::maximum)] maximum: [f32; 3],
        #[pyo3(from_py_with = argument::ray)] ray: Ray,
    ) -> Self {
        Self { hit: anyhit::Hit::aabb(minimum, maximum).ray(ray.ray) }
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.hit == other.hit
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        hash_instance(&self.hit.instance, &mut hasher);
        self.hit.ray.iter().for_each(|ray| hash_ray(ray, &mut hasher));
        (self.hit.ray_flags.0, self.hit.cull_mask).hash(&mut hasher);
        hasher.finish()
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<HitArguments<'py>> {
        let instance = Instance { instance: self.hit.instance.clone(), used: Use::free() };
        let keywords = PyDict::new(py);
        keywords.set_item("ray_flags", self.hit.ray_flags.0)?;
        keywords.set_item("cull_mask", self.hit.cull_mask)?;
        keywords.set_item("time", self.hit.time)?;
        Ok(((instance, self.hit.ray.map(|ray| Ray { ray })), keywords))
    }
}

never_changes!(Ray, Instance, Hit);
