//! How shaders sample images.

use std::hash::{DefaultHasher, Hash, Hasher};

use anyhit::AddressMode;
use anyhit_scene::read::Named;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::argument::{Argument, items, wrong_class};
use crate::copies::never_changes;
use crate::error::invalid;

/// `VkSamplerCreateInfo`: filters, address modes and levels of detail.
#[pyclass(frozen, eq, module = "anyhit")]
#[derive(Clone, PartialEq)]
pub(crate) struct Sampler {
    pub(crate) sampler: anyhit::Sampler,
}

/// The value with a name.
fn choice<T: Named>(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<T> {
    let name = String::of(argument, given)?;
    T::NAMES.iter().find(|(known, _)| *known == name).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<String> = T::NAMES.iter().map(|(name, _)| format!("{name:?}")).collect();
        invalid(format!("{argument}: {name:?} is none of {}", names.join(", ")))
    })
}

#[pymethods]
impl Sampler {
    /// A sampler with Vulkan's names in small letters: filters `"nearest"` and `"linear"`, one
    /// address mode for all axes or a list of three.
    #[new]
    #[pyo3(signature = (*, mag_filter=None, min_filter=None, mipmap_mode=None, address_mode=None, border_color=None, compare_op=None, min_lod=None, max_lod=None, lod_bias=None, max_anisotropy=None, unnormalized_coordinates=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn new(
        mag_filter: Option<&Bound<'_, PyAny>>,
        min_filter: Option<&Bound<'_, PyAny>>,
        mipmap_mode: Option<&Bound<'_, PyAny>>,
        address_mode: Option<&Bound<'_, PyAny>>,
        border_color: Option<&Bound<'_, PyAny>>,
        compare_op: Option<&Bound<'_, PyAny>>,
        min_lod: Option<&Bound<'_, PyAny>>,
        max_lod: Option<&Bound<'_, PyAny>>,
        lod_bias: Option<&Bound<'_, PyAny>>,
        max_anisotropy: Option<&Bound<'_, PyAny>>,
        unnormalized_coordinates: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let mut sampler = anyhit::Sampler::default();
        for (name, given, to) in [
            ("mag_filter", mag_filter, &mut sampler.mag_filter),
            ("min_filter", min_filter, &mut sampler.min_filter),
            ("mipmap_mode", mipmap_mode, &mut sampler.mipmap_mode),
        ] {
            if let Some(given) = given {
                *to = choice(name, given)?;
            }
        }
        if let Some(given) = address_mode {
            sampler.address_mode = address_modes(given)?;
        }
        if let Some(given) = border_color {
            sampler.border_color = choice("border_color", given)?;
        }
        if let Some(given) = compare_op {
            sampler.compare_op = Some(choice("compare_op", given)?);
        }
        for (name, given, to) in [
            ("min_lod", min_lod, &mut sampler.min_lod),
            ("max_lod", max_lod, &mut sampler.max_lod),
            ("lod_bias", lod_bias, &mut sampler.lod_bias),
            ("max_anisotropy", max_anisotropy, &mut sampler.max_anisotropy),
        ] {
            if let Some(given) = given {
                *to = f32::of(name, given)?;
            }
        }
        if let Some(given) = unnormalized_coordinates {
            sampler.unnormalized_coordinates = bool::of("unnormalized_coordinates", given)?;
        }
        Ok(Self { sampler })
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        let anyhit::Sampler { min_lod, max_lod, lod_bias, max_anisotropy, .. } = self.sampler;
        // -0.0 equals 0.0.
        let numbers = [min_lod, max_lod, lod_bias, max_anisotropy];
        numbers.map(|number| (number + 0.0).to_bits()).hash(&mut hasher);
        [self.sampler.mag_filter, self.sampler.min_filter].map(written).hash(&mut hasher);
        self.sampler.address_mode.map(written).hash(&mut hasher);
        hasher.finish()
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((), Bound<'py, PyDict>)> {
        Ok(((), self.keywords(py)?))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let keywords = self.keywords(py)?.into_iter();
        let keywords: PyResult<Vec<String>> =
            keywords.map(|(name, value)| Ok(format!("{name}={}", value.repr()?))).collect();
        Ok(format!("Sampler({})", keywords?.join(", ")))
    }
}

impl Sampler {
    /// The keywords that make it: those that differ from the defaults.
    fn keywords<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (own, default) = (&self.sampler, anyhit::Sampler::default());
        let keywords = PyDict::new(py);
        for (name, value, default) in [
            ("mag_filter", own.mag_filter, default.mag_filter),
            ("min_filter", own.min_filter, default.min_filter),
            ("mipmap_mode", own.mipmap_mode, default.mipmap_mode),
        ] {
            if value != default {
                keywords.set_item(name, written(value))?;
            }
        }
        if own.address_mode != default.address_mode {
            let modes = own.address_mode.map(written);
            match modes[1..].iter().all(|mode| *mode == modes[0]) {
                true => keywords.set_item("address_mode", modes[0])?,
                false => keywords.set_item("address_mode", modes)?,
            }
        }
        if own.border_color != default.border_color {
            keywords.set_item("border_color", written(own.border_color))?;
        }
        if let Some(compare_op) = own.compare_op {
            keywords.set_item("compare_op", written(compare_op))?;
        }
        for (name, value, default) in [
            ("min_lod", own.min_lod, default.min_lod),
            ("max_lod", own.max_lod, default.max_lod),
            ("lod_bias", own.lod_bias, default.lod_bias),
            ("max_anisotropy", own.max_anisotropy, default.max_anisotropy),
        ] {
            if value != default {
                keywords.set_item(name, value)?;
            }
        }
        if own.unnormalized_coordinates {
            keywords.set_item("unnormalized_coordinates", true)?;
        }
        Ok(keywords)
    }
}

/// The name of a value.
fn written<T: Named + PartialEq>(value: T) -> &'static str {
    T::NAMES.iter().find(|(_, known)| *known == value).map_or("", |(name, _)| name)
}

fn address_modes(given: &Bound<'_, PyAny>) -> PyResult<[AddressMode; 3]> {
    if given.is_instance_of::<PyString>() {
        return Ok([choice("address_mode", given)?; 3]);
    }
    let items = items("address_mode", given, 4);
    let items = items.map_err(|_| wrong_class("address_mode", "str or a list of three", given))?;
    let modes: Vec<AddressMode> =
        items.map(|item| choice("address_mode", &item?)).collect::<PyResult<_>>()?;
    let count = modes.len();
    modes.try_into().map_err(|_| invalid(format!("address_mode: a list of {count} modes, not of three")))
}

never_changes!(Sampler);
