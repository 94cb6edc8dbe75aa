//! Reads the tensors of a safetensors file as plain vectors; errors name the tensor.

use half::f16;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, Metadata, TensorView};

use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::contained;
use anyhit_base::sorted::sort;

/// The tensors of a file.
pub(super) struct Tensors<'a> {
    tensors: SafeTensors<'a>,
    metadata: Metadata,
}

const RAY: &[&str] = &["origin", "direction", "tmin", "tmax", "flags", "cull_mask"];
const INSTANCE: &[&str] = &["object_to_world", "mask", "flags", "custom_index", "sbt_offset"];
const GEOMETRY: &[&str] = &[
    "vertices",
    "indices",
    "opaque",
    "no_duplicate_any_hit",
    "transform",
    "aabb",
    "positions",
    "radii",
    "indexing_mode",
    "end_caps",
];

/// One tensor with its name.
struct Tensor<'a> {
    name: &'a str,
    view: TensorView<'a>,
}

impl<'a> Tensors<'a> {
    /// Reads the header.
    pub(super) fn of(bytes: &'a [u8]) -> Result<Self> {
        let wrong =
            |error| Error::new(ErrorKind::InvalidRecording, format!("not a safetensors file: {error}"));
        contained("safetensors", ErrorKind::InvalidRecording, || {
            let tensors = SafeTensors::deserialize(bytes).map_err(wrong)?;
            let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(wrong)?;
            Ok(Self { tensors, metadata })
        })
    }

    /// The value of a key in the file's metadata.
    pub(super) fn metadata_value(&self, key: &str) -> Option<&str> {
        self.metadata.metadata().as_ref()?.get(key).map(String::as_str)
    }

    /// Tensors that would define part of the scene, but whose names are unknown, sorted.
    pub(super) fn unknown_tensors(&self) -> Vec<String> {
        let known = |name: &str| match name.split_once('.') {
            Some(("ray", part)) => RAY.contains(&part),
            Some(("instance", part)) => INSTANCE.contains(&part),
            Some(("procedural", part)) => part == "sphere",
            Some((geometry, part)) if geometry.starts_with("geometry") => GEOMETRY.contains(&part),
            // Other recorded results do not change the scene.
            Some(("driver" | "reference", _)) => true,
            _ => false,
        };
        let names = self.tensors.names().into_iter().filter(|name| !known(name));
        let mut names: Vec<_> = names.map(str::to_owned).collect();
        sort(&mut names);
        names
    }

    /// A tensor of a geometry of this number or beyond.
    pub(super) fn geometry_from(&self, count: usize) -> Option<&str> {
        let number = |name: &str| name.strip_prefix("geometry")?.split_once('.')?.0.parse::<usize>().ok();
        let names = self.tensors.names().into_iter();
        names.filter(|name| number(name).is_some_and(|number| number >= count)).min()
    }

    /// The error that a required tensor is missing.
    pub(super) fn missing(&self, name: &str) -> Error {
        let error = Error::new(ErrorKind::InvalidRecording, format!("the tensor `{name}` is missing"));
        let mut names = self.tensors.names();
        sort(&mut names);
        let shown: Vec<_> = names.iter().take(40).map(|name| format!("`{name}`")).collect();
        error.note(format!("the file contains: {}", shown.join(", ")))
    }

    /// One float for each ray.
    pub(super) fn floats(&self, name: &str, rays: usize) -> Result<Option<Vec<f64>>> {
        self.of_length(name, rays)?.map(|tensor| tensor.floats()).transpose()
    }

    /// N floats for each ray.
    pub(super) fn float_rows<const N: usize>(
        &self,
        name: &str,
        rays: usize,
    ) -> Result<Option<Vec<[f64; N]>>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        tensor.check_rows(N)?;
        tensor.check_count(rays)?;
        Ok(Some(tensor.floats()?.chunks_exact(N).map(array).collect()))
    }

    /// Floats for each ray; their number is one of `lengths`.
    pub(super) fn rows_of_lengths(
        &self,
        name: &str,
        rays: usize,
        lengths: &[usize],
    ) -> Result<Option<Vec<Vec<f64>>>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        tensor.check_count(rays)?;
        let length = tensor.view.shape().iter().skip(1).product();
        if !lengths.contains(&length) {
            return Err(tensor.wrong(&format!("expected rows of one of {lengths:?} numbers")));
        }
        Ok(Some(tensor.floats()?.chunks_exact(length).map(<[f64]>::to_vec).collect()))
    }

    /// Rows of N single-precision floats.
    pub(super) fn rows<const N: usize>(&self, name: &str) -> Result<Option<Vec<[f32; N]>>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        tensor.check_rows(N)?;
        Ok(Some(tensor.singles()?.chunks_exact(N).map(array).collect()))
    }

    /// Row-major 3x4 matrices: I x 3 x 4 or I x 12; a single one may be 3 x 4 or 12.
    pub(super) fn matrices(&self, name: &str) -> Result<Option<Vec<[f32; 12]>>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        if !matches!(tensor.view.shape(), [_, 3, 4] | [_, 12] | [3, 4] | [12]) {
            return Err(tensor.wrong("expected I x 3 x 4"));
        }
        Ok(Some(tensor.singles()?.chunks_exact(12).map(array).collect()))
    }

    /// N single-precision floats for each ray; the tensor is required.
    pub(super) fn rows_of<const N: usize>(&self, name: &str, rays: usize) -> Result<Vec<[f32; N]>> {
        let tensor = self.tensor(name).ok_or_else(|| self.missing(name))?;
        tensor.check_rows(N)?;
        tensor.check_count(rays)?;
        Ok(tensor.singles()?.chunks_exact(N).map(array).collect())
    }

    /// One row-major 3x4 matrix.
    pub(super) fn matrix(&self, name: &str) -> Result<Option<[[f32; 4]; 3]>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        if !matches!(tensor.view.shape(), [3, 4] | [1, 3, 4] | [12]) {
            return Err(tensor.wrong("expected 3 x 4"));
        }
        let m = tensor.singles()?;
        Ok(Some(std::array::from_fn(|row| std::array::from_fn(|column| m[4 * row + column]))))
    }

    /// Points of two, three or four components: a missing third is 0, a fourth is ignored. 16-bit
    /// integers are signed normalised numbers (`VK_FORMAT_R16G16B16A16_SNORM`).
    pub(super) fn points(&self, name: &str) -> Result<Option<Vec<[f32; 3]>>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        let [_, components @ 2..=4] = *tensor.view.shape() else {
            return Err(tensor.wrong("expected V x 3 (or V x 2, V x 4)"));
        };
        let values = match tensor.view.dtype() {
            Dtype::I16 => tensor.words()?.iter().map(|&word| snorm16(word)).collect(),
            _ => tensor.singles()?,
        };
        let point = |row: &[f32]| [row[0], row[1], row.get(2).copied().unwrap_or(0.0)];
        Ok(Some(values.chunks_exact(components).map(point).collect()))
    }

    /// The number of values in a row of a tensor.
    pub(super) fn row_length(&self, name: &str) -> Option<usize> {
        Some(self.tensor(name)?.view.shape().iter().skip(1).product())
    }

    /// Whether any number of a tensor of integers is not 0.
    pub(super) fn any(&self, name: &str) -> Result<bool> {
        let Some(tensor) = self.tensor(name) else { return Ok(false) };
        Ok(tensor.words()?.iter().any(|&word| word > 0))
    }

    /// Single-precision floats, V or V x 1.
    pub(super) fn singles(&self, name: &str) -> Result<Option<Vec<f32>>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        tensor.check_rows(1)?;
        Ok(Some(tensor.singles()?))
    }

    /// One single-precision float for each ray; a single one is used for all.
    pub(super) fn ray_singles(&self, name: &str, rays: usize) -> Result<Option<Vec<f32>>> {
        self.one_or_each(name, rays, |tensor| tensor.singles())
    }

    /// One integer for each ray.
    pub(super) fn integers(&self, name: &str, rays: usize) -> Result<Option<Vec<i64>>> {
        self.of_length(name, rays)?.map(|tensor| tensor.words()).transpose()
    }

    /// One integer of at most `bits` bits for each of `count` items; a single one is used for all.
    pub(super) fn unsigned(&self, name: &str, count: usize, bits: u32) -> Result<Option<Vec<u32>>> {
        self.one_or_each(name, count, |tensor| tensor.unsigned(bits))
    }

    fn one_or_each<T: Copy>(
        &self,
        name: &str,
        count: usize,
        read: impl Fn(&Tensor<'_>) -> Result<Vec<T>>,
    ) -> Result<Option<Vec<T>>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        if tensor.view.shape().iter().product::<usize>() == 1 {
            return Ok(Some(vec![read(&tensor)?[0]; count]));
        }
        tensor.check_rows(1)?;
        tensor.check_count(count)?;
        read(&tensor).map(Some)
    }

    /// Integers of 32 bits in any shape.
    pub(super) fn indices(&self, name: &str) -> Result<Option<Vec<u32>>> {
        self.tensor(name).map(|tensor| tensor.unsigned(32)).transpose()
    }

    /// A single integer.
    pub(super) fn integer(&self, name: &str) -> Result<Option<i64>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        match tensor.words()?.as_slice() {
            [word] => Ok(Some(*word)),
            _ => Err(tensor.wrong("expected one number")),
        }
    }

    fn of_length(&self, name: &str, count: usize) -> Result<Option<Tensor<'_>>> {
        let Some(tensor) = self.tensor(name) else { return Ok(None) };
        tensor.check_rows(1)?;
        tensor.check_count(count)?;
        Ok(Some(tensor))
    }

    fn tensor(&self, name: &str) -> Option<Tensor<'_>> {
        // The name in the file lives as long as the tensor.
        let view = self.tensors.tensor(name).ok()?;
        let name = self.tensors.names().into_iter().find(|known| *known == name)?;
        Some(Tensor { name, view })
    }
}

impl Tensor<'_> {
    fn wrong(&self, wanted: &str) -> Error {
        let shape = self.view.shape().iter().map(usize::to_string).collect::<Vec<_>>().join(" x ");
        let shape = if shape.is_empty() { "a single number".to_owned() } else { shape };
        let message = format!("tensor `{}` is {} of {:?}: {wanted}", self.name, shape, self.view.dtype());
        Error::new(ErrorKind::InvalidRecording, message)
    }

    /// Rows of N numbers; for N = 1 also a plain list.
    fn check_rows(&self, n: usize) -> Result<()> {
        match *self.view.shape() {
            [_] if n == 1 => Ok(()),
            [_, columns] if columns == n => Ok(()),
            _ if n == 1 => Err(self.wrong("expected a list of numbers")),
            _ => Err(self.wrong(&format!("expected rows of {n}"))),
        }
    }

    fn check_count(&self, count: usize) -> Result<()> {
        match self.view.shape().first() {
            Some(&rows) if rows == count => Ok(()),
            _ => Err(self.wrong(&format!("expected {count} rows"))),
        }
    }

    /// Floats of 16, 32 or 64 bits.
    fn floats(&self) -> Result<Vec<f64>> {
        let data = self.view.data();
        Ok(match self.view.dtype() {
            Dtype::F16 => numbers(data, |bytes| f16::from_le_bytes(bytes).into()),
            Dtype::F32 => numbers(data, |bytes| f32::from_le_bytes(bytes).into()),
            Dtype::F64 => numbers(data, f64::from_le_bytes),
            _ => return Err(self.wrong("expected F32 or F64")),
        })
    }

    /// Floats that single precision represents exactly.
    fn singles(&self) -> Result<Vec<f32>> {
        let data = self.view.data();
        Ok(match self.view.dtype() {
            Dtype::F16 => numbers(data, |bytes| f16::from_le_bytes(bytes).into()),
            Dtype::F32 => numbers(data, f32::from_le_bytes),
            // Data for a device has single precision; an array in double precision may hold such
            // values.
            Dtype::F64 => {
                let doubles = numbers(data, f64::from_le_bytes);
                let exact = |x: &f64| x.is_nan() || f64::from(*x as f32) == *x;
                if let Some(at) = doubles.iter().position(|x| !exact(x)) {
                    let number = doubles[at];
                    return Err(self.wrong(&format!(
                        "number {at} is {number:?}, which is not an F32, but the device reads F32"
                    )));
                }
                doubles.into_iter().map(|x| x as f32).collect()
            }
            _ => return Err(self.wrong("expected F32 (or F16), which the device reads")),
        })
    }

    /// Integers of any width, and Booleans.
    fn words(&self) -> Result<Vec<i64>> {
        let data = self.view.data();
        Ok(match self.view.dtype() {
            Dtype::BOOL | Dtype::U8 => numbers(data, |bytes| u8::from_le_bytes(bytes).into()),
            Dtype::I8 => numbers(data, |bytes| i8::from_le_bytes(bytes).into()),
            Dtype::U16 => numbers(data, |bytes| u16::from_le_bytes(bytes).into()),
            Dtype::I16 => numbers(data, |bytes| i16::from_le_bytes(bytes).into()),
            Dtype::U32 => numbers(data, |bytes| u32::from_le_bytes(bytes).into()),
            Dtype::I32 => numbers(data, |bytes| i32::from_le_bytes(bytes).into()),
            Dtype::I64 => numbers(data, i64::from_le_bytes),
            Dtype::U64 => {
                let words = numbers(data, u64::from_le_bytes);
                let words = words.into_iter().map(i64::try_from).collect::<Result<_, _>>();
                words.map_err(|_| self.wrong("a number does not fit 63 bits"))?
            }
            _ => return Err(self.wrong("expected integers")),
        })
    }

    fn unsigned(&self, bits: u32) -> Result<Vec<u32>> {
        let words = self.words()?;
        if let Some((at, word)) = words.iter().enumerate().find(|(_, word)| !(0..1 << bits).contains(*word)) {
            return Err(self.wrong(&format!("number {at} is {word}, which does not fit {bits} bits")));
        }
        Ok(words.into_iter().map(|word| word as u32).collect())
    }
}

fn numbers<T, const N: usize>(data: &[u8], number: impl Fn([u8; N]) -> T) -> Vec<T> {
    data.as_chunks::<N>().0.iter().map(|bytes| number(*bytes)).collect()
}

fn array<T: Copy, const N: usize>(row: &[T]) -> [T; N] {
    std::array::from_fn(|at| row[at])
}

/// Vulkan, "Conversion from Normalized Fixed-Point to Floating-Point".
fn snorm16(word: i64) -> f32 {
    (word as f32 / 32767.0).max(-1.0)
}
