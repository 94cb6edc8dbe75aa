//! Images as arrays: texels of the format and dimension that shaders declare.

use std::sync::Arc;

use anyhit::{Dimension, Format, Image, ImageShape, Program, Texels};
use anyhit_engine::machine::Binding;
use anyhit_engine::machine::format::Class;
use anyhit_engine::ops::image::declared::declared_format;
use anyhit_engine::ops::image::view::View;
use anyhit_engine::program::descriptors::image_of_slot;
use anyhit_scene::image::format_named;
use numpy::{PyArrayDescr, PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::array::{from_bytes, shape_text, slice, typed};
use crate::error::{invalid, raised};
use crate::numbers::Number;

/// What a shader declares of an image.
#[derive(Clone, Copy)]
pub(crate) struct Declared {
    format: Format,
    dimension: Dimension,
}

/// The image that a shader of these declares at a binding.
pub(crate) fn declared<'a>(
    programs: impl IntoIterator<Item = &'a Arc<Program>>,
    binding: Binding,
) -> Option<Declared> {
    programs.into_iter().find_map(|program| {
        let slot = program.slots.iter().find(|slot| slot.binding == binding)?;
        let ty = image_of_slot(program, slot)?;
        let view = View::of(&program.module, &ty)?;
        Some(Declared { format: declared_format(&program.module, &ty), dimension: view.dimension })
    })
}

/// Numbers of an array, one for each component of a texel.
#[derive(Clone)]
pub(crate) struct TexelArray {
    /// The lengths of the array.
    lengths: Vec<usize>,
    /// As a shader writes them: bits of a binary32, or integers extended to 64 bits.
    words: Arc<[u64]>,
    class: Class,
    is_wide: bool,
    /// The format that the caller names.
    format: Option<Format>,
}

impl TexelArray {
    /// The texels of an array of float32, or of uint32, int32, uint64 or int64, with the name of a
    /// format or without one.
    pub(crate) fn of(texels: &Bound<'_, PyAny>, format: Option<&str>) -> PyResult<Self> {
        let format = format.map(named).transpose()?;
        let given = match (format, texels.cast::<PyUntypedArray>()) {
            (Some(format), _) => (format.class(), format.is_wide()),
            (None, Ok(array)) => match (array.dtype().kind(), array.dtype().itemsize()) {
                (b'u', 8) => (Class::Uint, true),
                (b'u', 4) => (Class::Uint, false),
                (b'i', 8) => (Class::Sint, true),
                (b'i', 4) => (Class::Sint, false),
                _ => (Class::Float, false),
            },
            (None, Err(_)) => (Class::Float, false),
        };
        let (class, is_wide) = given;
        let (words, lengths) = match given {
            (Class::Float, _) => words::<f32>(texels, |number| number.to_bits().into()),
            (Class::Uint, false) => words::<u32>(texels, u64::from),
            (Class::Uint, true) => words::<u64>(texels, |number| number),
            (Class::Sint, false) => words::<i32>(texels, |number| i64::from(number) as u64),
            (Class::Sint, true) => words::<i64>(texels, |number| number as u64),
        }?;
        Ok(Self { lengths, words: words.into(), class, is_wide, format })
    }

    /// The image, as a shader declares it; a plane of 32-bit components where none does.
    pub(crate) fn image(&self, declared: Option<Declared>) -> PyResult<Arc<Image>> {
        let own = match (self.class, self.is_wide) {
            (Class::Float, _) => "rgba32f",
            (Class::Uint, false) => "rgba32ui",
            (Class::Uint, true) => "r64ui",
            (Class::Sint, false) => "rgba32i",
            (Class::Sint, true) => "r64i",
        };
        let format = self.format.or(declared.map(|declared| declared.format));
        let format = format.map_or_else(|| named(own), Ok)?;
        if (format.class(), format.is_wide()) != (self.class, self.is_wide) {
            return Err(invalid(format!(
                "texels: an array of {}, but the shader declares the format {}: use `texels.astype(numpy.{})`",
                dtype(self.class, self.is_wide),
                format.name(),
                dtype(format.class(), format.is_wide())
            )));
        }
        let dimension = declared.map_or(Dimension::D2, |declared| declared.dimension);
        let (shape, channels) = self.shape(dimension, format)?;
        let (size, is_signed) = (format.texel_size() as usize, format.class() == Class::Sint);
        let one = if self.class == Class::Float { u64::from(1f32.to_bits()) } else { 1 };
        let mut bytes = Vec::with_capacity(self.words.len() / channels * size);
        for own in self.words.chunks_exact(channels) {
            let mut texel = [0, 0, 0, one];
            texel[..channels].copy_from_slice(own);
            bytes.extend_from_slice(&format.encode(texel, is_signed).to_le_bytes()[..size]);
        }
        Image::new(format, shape, &bytes).map_err(raised)
    }

    /// The shape of an image of a dimension, and how many numbers a texel has.
    fn shape(&self, dimension: Dimension, format: Format) -> PyResult<(ImageShape, usize)> {
        let sides: &[&str] = match dimension {
            Dimension::D1 | Dimension::Buffer => &["width"],
            Dimension::D1Array => &["layers", "width"],
            Dimension::D2 => &["height", "width"],
            Dimension::D3 => &["depth", "height", "width"],
            Dimension::Cube => &["6", "height", "width"],
            _ => &["layers", "height", "width"],
        };
        let axes = dimension.axes();
        let wrong = || {
            let lengths = shape_text(&self.lengths);
            let sides = sides.join(", ");
            invalid(format!("texels: an array of shape {lengths}, not ({sides}, 4) or ({sides})"))
        };
        let channels = match self.lengths.len().checked_sub(sides.len()) {
            // One component, without an axis of its own.
            Some(0) if format.channels == 1 => 1,
            Some(1) => *self.lengths.last().unwrap_or(&0),
            _ => return Err(wrong()),
        };
        if !(1..=4).contains(&channels) {
            return Err(wrong());
        }
        let side =
            |length: usize| u32::try_from(length).map_err(|_| invalid("texels: the array is too large"));
        let lengths: Vec<u32> =
            self.lengths[..sides.len()].iter().map(|&one| side(one)).collect::<Result<_, _>>()?;
        let (layers, own) = lengths.split_at(sides.len() - axes);
        let mut extent = [1; 3];
        own.iter().rev().zip(&mut extent).for_each(|(&length, to)| *to = length);
        let layers = layers.first().copied().unwrap_or(1);
        Ok((ImageShape { dimension, extent, layers, levels: 1, samples: 1 }, channels))
    }
}

/// The format with a name of GLSL.
fn named(name: &str) -> PyResult<Format> {
    format_named(name).ok_or_else(|| {
        let names: Vec<&str> = Format::NAMED.iter().map(|(name, _)| *name).collect();
        invalid(format!("format: there is no format `{name}`: write one of {}", names.join(", ")))
    })
}

/// The numbers of an array as words, and its lengths.
fn words<T: Number>(texels: &Bound<'_, PyAny>, word: impl Fn(T) -> u64) -> PyResult<(Vec<u64>, Vec<usize>)> {
    let array = typed::<T>("texels", texels)?;
    let words = slice("texels", &array)?.iter().map(|&number| word(number)).collect();
    Ok((words, array.shape().to_vec()))
}

/// The dtype of the components of texels.
fn dtype(class: Class, is_wide: bool) -> &'static str {
    match (class, is_wide) {
        (Class::Float, _) => "float32",
        (Class::Uint, false) => "uint32",
        (Class::Uint, true) => "uint64",
        (Class::Sint, false) => "int32",
        (Class::Sint, true) => "int64",
    }
}

/// R, G, B and A of all texels of the first level, as a shader reads them: an array (height, width,
/// 4) of float32, or of the integers that the format holds. Images of other dimensions have their
/// own axes in front of the last.
pub(crate) fn texels<'py>(py: Python<'py>, texels: &Texels) -> PyResult<Bound<'py, PyAny>> {
    let image = texels.image();
    let (format, shape) = (image.format(), *image.shape());
    let (class, size) = (format.class(), format.texel_size() as usize);
    let width = if format.is_wide() && class != Class::Float { 8 } else { 4 };
    let bytes: Vec<u8> = py.detach(|| {
        let level = image.level_bytes(0);
        if format == Format::RGBA32F {
            return level;
        }
        let components = level.chunks_exact(size).flat_map(|texel| {
            let mut bits = [0; 16];
            bits[..size].copy_from_slice(texel);
            format.decode(u128::from_le_bytes(bits))
        });
        components.flat_map(|part| part.to_le_bytes().into_iter().take(width)).collect()
    });
    let [x, y, z] = shape.extent;
    let mut sides = match shape.dimension.axes() {
        1 => vec![x],
        2 => vec![y, x],
        _ => vec![z, y, x],
    };
    if shape.dimension.is_arrayed() || shape.dimension.is_cube() {
        sides.insert(0, shape.layers);
    }
    let samples = (shape.samples > 1).then_some(shape.samples);
    let sides: Vec<isize> = sides.into_iter().chain(samples).chain([4]).map(|side| side as isize).collect();
    let dtype = PyArrayDescr::new(py, dtype(class, format.is_wide()))?;
    from_bytes(py, bytes, &dtype, &sides)
}
