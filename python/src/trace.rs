//! Arrays of rays through a scene.

use std::ops::Range;

use crate::array::{Points, Scalars, bytes, from_bytes};
use crate::error::{invalid, raised_of_ray};
use crate::outcome::stats;
use crate::payload;
use crate::run::interruptible;
use anyhit::{Pipeline, Ray, RayOperands, Scene, Stats, Value};
use anyhit_base::interrupt::Interrupt;
use anyhit_base::threads::map_on_threads;
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The index that stands for a primitive where a ray hit nothing.
const NONE: u32 = u32::MAX;

/// What `Pipeline.trace` is given.
pub(crate) struct RayArguments<'a, 'py> {
    pub(crate) origins: &'a Bound<'py, PyAny>,
    pub(crate) directions: &'a Bound<'py, PyAny>,
    pub(crate) t_min: Option<&'a Bound<'py, PyAny>>,
    pub(crate) t_max: Option<&'a Bound<'py, PyAny>>,
    pub(crate) time: Option<&'a Bound<'py, PyAny>>,
    pub(crate) payload: Option<&'a Bound<'py, PyAny>>,
    /// What is the same for all rays.
    pub(crate) operands: RayOperands,
}

/// What rays brought back: arrays with an element for each ray. Of a ray that hit nothing, `t` is
/// infinite, indices are 2^32 - 1 and positions not a number.
#[pyclass(frozen, get_all, module = "anyhit")]
pub(crate) struct Traced {
    /// Whether the ray hit something, bool.
    hit: Py<PyAny>,
    /// `RayTmaxKHR` of the closest-hit shader, float32.
    t: Py<PyAny>,
    /// `InstanceId`, uint32.
    instance: Py<PyAny>,
    /// `InstanceCustomIndexKHR`, uint32.
    custom_index: Py<PyAny>,
    /// `RayGeometryIndexKHR`, uint32.
    geometry: Py<PyAny>,
    /// `PrimitiveId`, uint32.
    primitive: Py<PyAny>,
    /// `HitKindKHR`, uint32.
    kind: Py<PyAny>,
    /// Barycentrics of a triangle's second and third vertex, or u of a linear swept sphere and 0:
    /// float32, (N, 2).
    attributes: Py<PyAny>,
    /// origin + t * direction, computed in float64: float32, (N, 3).
    positions: Py<PyAny>,
    /// The payloads: of a struct an array of its members' dtype; `None` where no shader takes one.
    payload: Option<Py<PyAny>>,
    /// What the shaders of each ray printed.
    printed: Vec<Vec<String>>,
    /// How many rays were traced, and how often shaders of each stage ran.
    stats: Py<PyDict>,
    /// The scene with what shaders stored, for further rays.
    scene: Py<crate::scene::Scene>,
}

#[pymethods]
impl Traced {
    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.t.bind(py).len()
    }

    /// Traces are equal where their arrays are bit for bit, and what was printed and counted.
    fn __eq__(&self, other: &Self, py: Python<'_>) -> PyResult<bool> {
        for (array, others) in self.arrays().into_iter().zip(other.arrays()) {
            let (Some(array), Some(others)) = (array, others) else {
                if array.is_some() || others.is_some() {
                    return Ok(false);
                }
                continue;
            };
            let (array, others) = (array.bind(py), others.bind(py));
            for part in ["dtype", "shape"] {
                if !array.getattr(part)?.eq(others.getattr(part)?)? {
                    return Ok(false);
                }
            }
            if !array.call_method0("tobytes")?.eq(others.call_method0("tobytes")?)? {
                return Ok(false);
            }
        }
        Ok(self.printed == other.printed && self.stats.bind(py).eq(other.stats.bind(py))?)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let hits: usize = self.hit.bind(py).call_method0("sum")?.extract()?;
        Ok(format!("<anyhit.Traced: {} rays, {hits} hits>", self.__len__(py)?))
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        slf.py().import("anyhit._html")?.getattr("of_traced")?.call1((slf,))?.extract()
    }
}

impl Traced {
    /// The arrays; `None` for the payloads where no shader takes one.
    fn arrays(&self) -> [Option<&Py<PyAny>>; 10] {
        let Self { hit, t, instance, custom_index, geometry, primitive, kind, attributes, positions, .. } =
            self;
        let all = [hit, t, instance, custom_index, geometry, primitive, kind, attributes, positions];
        let mut arrays = [None; 10];
        arrays[..9].copy_from_slice(&all.map(Some));
        arrays[9] = self.payload.as_ref();
        arrays
    }
}

/// The number of rays that run one after the other, before another thread may take some.
const SHARE: usize = 1024;

/// What consecutive rays brought back.
#[derive(Default)]
struct Columns {
    hit: Vec<bool>,
    t: Vec<f32>,
    instance: Vec<u32>,
    custom_index: Vec<u32>,
    geometry: Vec<u32>,
    primitive: Vec<u32>,
    kind: Vec<u32>,
    /// Two for each ray.
    attributes: Vec<f32>,
    /// Three for each ray.
    positions: Vec<f32>,
    payload: Vec<u8>,
    printed: Vec<Vec<String>>,
    stats: Stats,
}

impl Columns {
    fn push(&mut self, ray: Ray, traced: anyhit::Traced) {
        let hit = (!traced.missed()).then(|| traced.hit());
        let Ray { origin, direction, .. } = ray;
        let along = |axis: usize, t: f32| {
            (f64::from(origin[axis]) + f64::from(t) * f64::from(direction[axis])) as f32
        };
        self.hit.push(hit.is_some());
        self.t.push(hit.map_or(f32::INFINITY, |hit| hit.t));
        self.instance.push(hit.map_or(NONE, |hit| hit.instance));
        self.custom_index.push(hit.map_or(NONE, |hit| hit.custom_index));
        self.geometry.push(hit.map_or(NONE, |hit| hit.geometry));
        self.primitive.push(hit.map_or(NONE, |hit| hit.primitive));
        self.kind.push(hit.map_or(NONE, |hit| hit.kind.0));
        self.attributes.extend(hit.map_or([0.0; 2], |hit| hit.attributes));
        self.positions.extend(hit.map_or([f32::NAN; 3], |hit| [0, 1, 2].map(|axis| along(axis, hit.t))));
        self.payload.extend(traced.payload.bytes());
        self.printed.push(traced.printed);
        self.stats = std::mem::take(&mut self.stats).plus(&traced.stats);
    }

    fn append(&mut self, mut next: Self) {
        self.hit.append(&mut next.hit);
        self.t.append(&mut next.t);
        self.instance.append(&mut next.instance);
        self.custom_index.append(&mut next.custom_index);
        self.geometry.append(&mut next.geometry);
        self.primitive.append(&mut next.primitive);
        self.kind.append(&mut next.kind);
        self.attributes.append(&mut next.attributes);
        self.positions.append(&mut next.positions);
        self.payload.append(&mut next.payload);
        self.printed.append(&mut next.printed);
        self.stats = std::mem::take(&mut self.stats).plus(&next.stats);
    }

    /// The columns as arrays, whose memory they become.
    fn into_arrays(self, py: Python<'_>, payload: Option<&Value>, scene: Scene) -> PyResult<Traced> {
        let count = self.t.len();
        let numbers = |column: Vec<u32>| column.into_pyarray(py).into_any().unbind();
        let rows = |column: Vec<f32>, width: usize| -> PyResult<Py<PyAny>> {
            Ok(column.into_pyarray(py).reshape([count, width])?.into_any().unbind())
        };
        let payload = payload
            .map(|shape| {
                let (element, sides) = payload::dtype(py, shape)?;
                let sides = std::iter::once(count).chain(sides).map(|side| side as isize);
                let sides: Vec<isize> = sides.collect();
                Ok::<_, PyErr>(from_bytes(py, self.payload, &element, &sides)?.unbind())
            })
            .transpose()?;
        Ok(Traced {
            hit: self.hit.into_pyarray(py).into_any().unbind(),
            t: self.t.into_pyarray(py).into_any().unbind(),
            instance: numbers(self.instance),
            custom_index: numbers(self.custom_index),
            geometry: numbers(self.geometry),
            primitive: numbers(self.primitive),
            kind: numbers(self.kind),
            attributes: rows(self.attributes, 2)?,
            positions: rows(self.positions, 3)?,
            payload,
            printed: self.printed,
            stats: stats(py, &self.stats)?.unbind(),
            scene: Py::new(py, crate::scene::Scene::new(scene))?,
        })
    }
}

/// The rays of a call: slices in the memory of the arrays.
struct Rays<'a> {
    count: usize,
    origins: &'a [[f32; 3]],
    directions: &'a [[f32; 3]],
    t_min: &'a [f32],
    t_max: &'a [f32],
    time: &'a [f32],
    payload: &'a [u32],
    payload_words: usize,
    operands: &'a RayOperands,
}

/// The element of a ray, of which there is one for all or one for each.
fn of<T: Copy>(elements: &[T], at: usize) -> T {
    elements[if elements.len() == 1 { 0 } else { at }]
}

impl Rays<'_> {
    fn operands(&self, at: usize) -> RayOperands {
        let ray = Ray::new(of(self.origins, at), of(self.directions, at));
        let mut operands = self.operands.clone();
        operands.trace.ray = ray.with_interval(of(self.t_min, at), of(self.t_max, at));
        operands.trace.time = of(self.time, at);
        let words = at * self.payload_words..(at + 1) * self.payload_words;
        operands.payload = self.payload.get(words).unwrap_or_default().to_vec();
        operands
    }

    /// Traces the rays of a range, one after the other, in the memory of the scene.
    ///
    /// # Errors
    /// The first one, with the number of its ray.
    fn trace(
        &self,
        pipeline: &Pipeline,
        scene: &Scene,
        range: Range<usize>,
    ) -> Result<Columns, (usize, anyhit::Error)> {
        let mut columns = Columns::default();
        let interrupt = Interrupt::current();
        for at in range {
            // What has run so far is discarded.
            if interrupt.as_ref().is_some_and(Interrupt::is_raised) {
                break;
            }
            let operands = self.operands(at);
            let ray = operands.trace.ray;
            columns.push(ray, scene.trace_in_place(pipeline, operands).map_err(|error| (at, error))?);
        }
        Ok(columns)
    }

    /// Traces all rays; side by side unless one may see what another one leaves.
    ///
    /// # Errors
    /// That of the first ray, whatever ran first.
    fn trace_all(&self, pipeline: &Pipeline, scene: &Scene) -> Result<Columns, (usize, anyhit::Error)> {
        if share_memory(pipeline) {
            return self.trace(pipeline, scene, 0..self.count);
        }
        let shares = map_on_threads(self.count.div_ceil(SHARE), |share| {
            let range = share * SHARE..self.count.min((share + 1) * SHARE);
            self.trace(pipeline, scene, range)
        });
        let mut shares = shares.into_iter();
        let mut columns = shares.next().unwrap_or_else(|| Ok(Columns::default()))?;
        for share in shares {
            columns.append(share?);
        }
        Ok(columns)
    }
}

/// Whether a ray may leave something that another one sees: then they run in their order.
fn share_memory(pipeline: &Pipeline) -> bool {
    let prints = |program: &anyhit::Program| {
        program.module.instruction_sets.iter().any(|set| set == "NonSemantic.DebugPrintf")
    };
    let stores = |program: &anyhit::Program| program.accesses.iter().any(|access| access.stores);
    pipeline.order_dependent() || pipeline.programs.iter().any(|one| prints(one) || stores(one))
}

/// Traces the rays of a call.
pub(crate) fn trace(
    py: Python<'_>,
    pipeline: &Pipeline,
    scene: &Scene,
    arguments: &RayArguments<'_, '_>,
) -> PyResult<Traced> {
    let origins = Points::of("origins", arguments.origins)?;
    let directions = Points::of("directions", arguments.directions)?;
    let t_min = arguments.t_min.map(|given| Scalars::of("t_min", given)).transpose()?;
    let t_max = arguments.t_max.map(|given| Scalars::of("t_max", given)).transpose()?;
    let time = arguments.time.map(|given| Scalars::of("time", given)).transpose()?;
    let shape = payload::of_pipeline(pipeline);
    let payload = payload_words(py, shape.as_ref(), arguments.payload)?;

    let origin_rows = origins.rows()?;
    let direction_rows = directions.rows()?;
    let t_min_numbers = t_min.as_ref().map_or(Ok(&[0.0][..]), Scalars::numbers)?;
    let t_max_numbers = t_max.as_ref().map_or(Ok(&[f32::INFINITY][..]), Scalars::numbers)?;
    let times = time.as_ref().map_or(Ok(&[0.0][..]), Scalars::numbers)?;
    let single = |numbers: &Option<Scalars<'_>>| numbers.as_ref().is_none_or(Scalars::is_single);
    let lengths = [
        ("origins", (!origins.is_single()).then_some(origin_rows.len())),
        ("directions", (!directions.is_single()).then_some(direction_rows.len())),
        ("t_min", (!single(&t_min)).then_some(t_min_numbers.len())),
        ("t_max", (!single(&t_max)).then_some(t_max_numbers.len())),
        ("time", (!single(&time)).then_some(times.len())),
        ("payload", payload.as_ref().map(|(rows, _)| *rows)),
    ];
    let rays = Rays {
        count: common_length(&lengths)?,
        origins: origin_rows,
        directions: direction_rows,
        t_min: t_min_numbers,
        t_max: t_max_numbers,
        time: times,
        payload: payload.as_ref().map_or(&[][..], |(_, words)| words),
        payload_words: pipeline.payload_words(),
        operands: &arguments.operands,
    };
    let (pipeline, scene) = scene.copied_for_run(pipeline);
    let columns = interruptible(py, || rays.trace_all(&pipeline, &scene))?;
    columns.map_err(|(at, error)| raised_of_ray(error, at))?.into_arrays(py, shape.as_ref(), scene)
}

/// How many rays there are: as many as each array has rows.
fn common_length(lengths: &[(&str, Option<usize>)]) -> PyResult<usize> {
    let mut first: Option<(&str, usize)> = None;
    for &(name, length) in lengths {
        match (first, length) {
            (None, Some(length)) => first = Some((name, length)),
            (Some((other, wanted)), Some(length)) if length != wanted => {
                return Err(invalid(format!("{name} has {length} rows, and {other} {wanted}")));
            }
            _ => {}
        }
    }
    Ok(first.map_or(1, |(_, length)| length))
}

/// The rows of the payload that the caller gives, and their words.
fn payload_words(
    py: Python<'_>,
    shape: Option<&Value>,
    given: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<(usize, Vec<u32>)>> {
    let Some(given) = given else { return Ok(None) };
    let Some(shape) = shape else {
        return Err(invalid("payload: no shader of the pipeline takes one"));
    };
    let (wanted, sides) = payload::dtype(py, shape)?;
    let dtype = given.getattr("dtype").map_err(|_| {
        invalid(
            "payload: an array of the pipeline's `payload_dtype`: `numpy.zeros(n, pipeline.payload_dtype)`",
        )
    })?;
    if !dtype.eq(&wanted)? {
        return Err(invalid(format!("payload: an array of {dtype}, not of {wanted}")));
    }
    let dimensions: Vec<usize> = given.getattr("shape")?.extract()?;
    if dimensions.get(1..) != Some(&sides[..]) {
        let inner: String = sides.iter().map(|side| format!(", {side}")).collect();
        return Err(invalid(format!("payload: an array of shape {dimensions:?}, not (N{inner})")));
    }
    let bytes = bytes("payload", given)?;
    Ok(Some((dimensions[0], bytes.as_chunks().0.iter().map(|&word| u32::from_le_bytes(word)).collect())))
}
