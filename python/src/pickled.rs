//! Instances as bytes, for pickling: little-endian words, lists behind their lengths.

use anyhit::{EndCaps, GeometryData, GeometryFlags, Indexing, Instance, InstanceFlags, Motion};
use anyhit_engine::accel::Geometry;
use pyo3::PyResult;

use crate::error::invalid;

/// The number of an absent list, which is longer than any list.
const ABSENT: u32 = u32::MAX;

/// Writes words.
#[derive(Default)]
struct Writer(Vec<u8>);

impl Writer {
    fn word(&mut self, word: u32) {
        self.0.extend(word.to_le_bytes());
    }

    fn floats(&mut self, floats: &[f32]) {
        floats.iter().for_each(|float| self.word(float.to_bits()));
    }

    fn length(&mut self, length: usize) -> PyResult<()> {
        let length = u32::try_from(length).ok().filter(|&length| length != ABSENT);
        self.word(length.ok_or_else(|| invalid("an instance of more than 2^32 - 2 numbers is not pickled"))?);
        Ok(())
    }

    fn rows<const N: usize>(&mut self, rows: &[[f32; N]]) -> PyResult<()> {
        self.length(rows.len())?;
        self.floats(rows.as_flattened());
        Ok(())
    }

    fn indices(&mut self, indices: Option<&[u32]>) -> PyResult<()> {
        match indices {
            None => self.word(ABSENT),
            Some(indices) => {
                self.length(indices.len())?;
                indices.iter().for_each(|&index| self.word(index));
            }
        }
        Ok(())
    }

    fn geometry(&mut self, geometry: &Geometry) -> PyResult<()> {
        match &geometry.data {
            GeometryData::Triangles { vertices, indices, .. } => {
                self.word(0);
                self.rows(vertices)?;
                self.indices(indices.as_deref())?;
            }
            GeometryData::Aabbs(boxes) => {
                self.word(1);
                self.rows(boxes)?;
            }
            GeometryData::Spheres { positions, radii, indices } => {
                self.word(2);
                self.rows(positions)?;
                self.rows(radii.as_chunks::<1>().0)?;
                self.indices(indices.as_deref())?;
            }
            GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, end_caps } => {
                self.word(3);
                self.rows(positions)?;
                self.rows(radii.as_chunks::<1>().0)?;
                self.indices(indices.as_deref())?;
                self.word((*indexing == Indexing::Successive).into());
                self.word((*end_caps == EndCaps::Chained).into());
            }
        }
        self.word(geometry.flags.0);
        self.indices(geometry.cluster_id.as_ref().map(std::slice::from_ref))?;
        match &geometry.vertices_t1 {
            None => self.word(ABSENT),
            Some(vertices) => self.rows(vertices)?,
        }
        Ok(())
    }
}

/// An instance, made by methods of Python, as bytes.
pub(crate) fn to_bytes(instance: &Instance) -> PyResult<Vec<u8>> {
    let mut out = Writer::default();
    out.length(instance.geometries.len())?;
    instance.geometries.iter().try_for_each(|geometry| out.geometry(geometry))?;
    out.floats(instance.transform.as_flattened());
    match &instance.motion {
        None => out.word(0),
        Some(Motion::Matrix(keys)) => {
            out.word(1);
            out.floats(keys.as_flattened().as_flattened());
        }
        Some(other) => return Err(invalid(format!("{other:?} is not pickled"))),
    }
    out.word(instance.custom_index);
    out.word(instance.mask.into());
    out.word(instance.sbt_offset);
    out.word(instance.flags.0);
    Ok(out.0)
}

/// Reads words.
struct Reader<'a>(&'a [[u8; 4]]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> PyResult<&'a [[u8; 4]]> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or_else(broken)?;
        self.0 = rest;
        Ok(taken)
    }

    fn word(&mut self) -> PyResult<u32> {
        Ok(u32::from_le_bytes(self.take(1)?[0]))
    }

    /// A word that is 0 or 1.
    fn bool(&mut self) -> PyResult<bool> {
        match self.word()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(broken()),
        }
    }

    fn matrix(&mut self) -> PyResult<[[f32; 4]; 3]> {
        let floats: Vec<f32> = self.take(12)?.iter().map(|&word| f32::from_le_bytes(word)).collect();
        floats.as_chunks::<4>().0.try_into().map_err(|_| broken())
    }

    /// Rows behind their number; `None` for an absent list.
    fn rows_or_none<const N: usize>(&mut self) -> PyResult<Option<Vec<[f32; N]>>> {
        let count = self.word()?;
        if count == ABSENT {
            return Ok(None);
        }
        let words = self.take((count as usize).checked_mul(N).ok_or_else(broken)?)?;
        let floats: Vec<f32> = words.iter().map(|&word| f32::from_le_bytes(word)).collect();
        Ok(Some(floats.as_chunks::<N>().0.to_vec()))
    }

    fn rows<const N: usize>(&mut self) -> PyResult<Vec<[f32; N]>> {
        self.rows_or_none()?.ok_or_else(broken)
    }

    fn indices(&mut self) -> PyResult<Option<Vec<u32>>> {
        let count = self.word()?;
        if count == ABSENT {
            return Ok(None);
        }
        Ok(Some(self.take(count as usize)?.iter().map(|&word| u32::from_le_bytes(word)).collect()))
    }

    fn geometry(&mut self) -> PyResult<Geometry> {
        let data = match self.word()? {
            0 => {
                let (vertices, indices) = (self.rows()?, self.indices()?);
                GeometryData::Triangles { vertices, indices, transform: None }
            }
            1 => GeometryData::Aabbs(self.rows()?),
            kind @ (2 | 3) => {
                let (positions, radii) = (self.rows()?, self.rows::<1>()?.into_flattened());
                let indices = self.indices()?;
                if kind == 2 {
                    GeometryData::Spheres { positions, radii, indices }
                } else {
                    let indexing = if self.bool()? { Indexing::Successive } else { Indexing::List };
                    let end_caps = if self.bool()? { EndCaps::Chained } else { EndCaps::None };
                    GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, end_caps }
                }
            }
            _ => return Err(broken()),
        };
        let mut geometry = Geometry::new(data, GeometryFlags(self.word()?));
        geometry.cluster_id = match self.indices()?.as_deref() {
            None => None,
            Some(&[id]) => Some(id),
            Some(_) => return Err(broken()),
        };
        geometry.vertices_t1 = self.rows_or_none::<3>()?.map(Into::into);
        Ok(geometry)
    }
}

fn broken() -> pyo3::PyErr {
    invalid("a pickled instance is broken")
}

/// The instance of [`to_bytes`].
///
/// # Errors
/// `InvalidArgument` for other bytes.
pub(crate) fn from_bytes(bytes: &[u8]) -> PyResult<Instance> {
    let (words, rest) = bytes.as_chunks::<4>();
    let mut words = Reader(words);
    let count = words.word()?;
    let geometries: PyResult<Vec<_>> = (0..count).map(|_| words.geometry()).collect();
    let mut instance = Instance::of(GeometryData::Aabbs(Vec::new()));
    instance.geometries = geometries?;
    instance.transform = words.matrix()?;
    instance.motion = match words.bool()? {
        true => Some(Motion::Matrix([words.matrix()?, words.matrix()?])),
        false => None,
    };
    instance.custom_index = words.word()?;
    instance.mask = u8::try_from(words.word()?).map_err(|_| broken())?;
    instance.sbt_offset = words.word()?;
    instance.flags = InstanceFlags(words.word()?);
    if words.0.is_empty() && rest.is_empty() { Ok(instance) } else { Err(broken()) }
}
