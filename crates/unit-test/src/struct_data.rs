//! Bytes of a struct as a shader declares it, written by the names of its members.

use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::NoUninit;

use crate::data::{HostBytes, member_of};
use crate::fit::check_scalars;
use crate::host_struct::HostLayout;
use crate::host_struct::compare::compare;
use crate::layout_mismatch::mismatch;
use crate::rust_layout::RustLayout;
use crate::scalars::{self, Scalars};
use crate::value::Value;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::InputLimit;
use anyhit_engine::machine::Binding;
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::reflect::lookup::{DataBlock, find, find_block, layout_note, padded_size, strides};
use anyhit_engine::reflect::table::StructTable;
use anyhit_engine::reflect::{Layout, Rules};

/// The bytes of a struct, laid out by the `Offset`, `ArrayStride` and `MatrixStride` of a module.
///
/// ```
/// use anyhit::{ErrorKind, Module, StructData};
///
/// # fn main() -> anyhit::Result<()> {
/// let source = "
///     struct Sun { direction: vec3f, power: f32 }
///     struct Params { count: u32, sun: Sun, sizes: array<f32> }
///     @group(0) @binding(0) var<storage, read_write> params: Params;
///     @compute @workgroup_size(1)
///     fn main() { params.count = u32(params.sizes[0] + params.sun.power); }
/// ";
/// let module = Module::from_source("params.wgsl", source)?;
/// let data = StructData::of(&module, "Params")?
///     .set("count", 3)?
///     .set("sun.direction", [0.0, 1.0, 0.0])?
///     .set("sun.power", 2.5)?
///     .set("sizes[1]", 9.0)?;
/// // `count` at 0, `sun` at 16, `sizes` at 32: two elements, as the second one is set.
/// assert_eq!(data.bytes().len(), 40);
/// assert_eq!(data.bytes()[36..], 9.0_f32.to_le_bytes());
/// assert_eq!(data.value()["sun"]["power"].f32(), 2.5);
///
/// // A plain Rust type is compared with the shader's, and the error shows both.
/// #[derive(Clone, Copy, Debug, bytemuck::NoUninit)]
/// #[repr(C)]
/// struct Sun {
///     direction: [f32; 3],
///     power: u32,
/// }
/// let sun = Sun { direction: [0.0; 3], power: 1 };
/// let error = StructData::of(&module, "Sun")?.write(&sun).unwrap_err();
/// assert_eq!(error.kind(), ErrorKind::InvalidArgument);
/// assert!(error.message().contains("the scalars of `Sun` differ from those of the shader's"));
/// # Ok(())
/// # }
/// ```
#[derive(Clone)]
#[must_use]
pub struct StructData {
    module: Arc<Module>,
    ty: TypeId,
    bytes: Vec<u8>,
}

impl StructData {
    /// Zeros for the struct with a name, `SceneInfo`, or a path, `Params.sun`, which goes through
    /// arrays and pointers.
    ///
    /// # Errors
    /// `InvalidArgument` where the module has no such struct with a layout, or several: it lists
    /// them.
    pub fn of(module: &Arc<Module>, name: &str) -> Result<Self> {
        Ok(Self::zeros(module, find(module, name)?))
    }

    /// Zeros for the module's push constants.
    ///
    /// # Errors
    /// `InvalidArgument` where it declares none.
    pub fn push_constants(module: &Arc<Module>) -> Result<Self> {
        Self::block(module, DataBlock::PushConstants)
    }

    /// Zeros for the data of the module's shader records.
    ///
    /// # Errors
    /// `InvalidArgument` where it declares none.
    pub fn shader_record(module: &Arc<Module>) -> Result<Self> {
        Self::block(module, DataBlock::ShaderRecord)
    }

    /// Zeros for the uniform or storage buffer that the module declares at a binding.
    ///
    /// # Errors
    /// `InvalidArgument` where it declares none.
    pub fn buffer(module: &Arc<Module>, set: u32, binding: u32) -> Result<Self> {
        Self::block(module, DataBlock::Buffer(Binding { set, binding }))
    }

    fn block(module: &Arc<Module>, block: DataBlock) -> Result<Self> {
        let layout = find_block(module, block)?;
        let missing = || invalid(format!("the module does not declare {}", block.describe()));
        layout.map(|layout| Self::zeros(module, layout)).ok_or_else(missing)
    }

    fn zeros(module: &Arc<Module>, layout: Layout<'_>) -> Self {
        // A module may claim any size: one beyond the limit is left empty, and `set` refuses it.
        let size = padded_size(layout);
        let most = module.limits.get(InputLimit::BufferBytes);
        let bytes = vec![0; if size as u64 <= most { size } else { 0 }];
        Self { module: module.clone(), ty: layout.ty, bytes }
    }

    fn layout(&self) -> Layout<'_> {
        Layout::new(&self.module, self.ty, Rules::Explicit)
    }

    /// Sets a member by its path: `set("lights[1].position", [0.0, 1.0, 0.0])`. A pointer takes an
    /// address, a `u64`. A runtime array at the end grows to the element that is set.
    ///
    /// # Errors
    /// `InvalidArgument` where there is no such member, or it has another type: it shows the
    /// layout.
    pub fn set(mut self, path: &str, value: impl Scalars) -> Result<Self> {
        let module = self.module.clone();
        let layout = Layout::new(&module, self.ty, Rules::Explicit);
        let name = module.describe_type(self.ty);
        let shown = |error: Error| error.note_lines(layout_note(layout));
        let located = layout.locate(path).map_err(|wrong| shown(invalid(format!("{name}: {wrong}"))));
        let (offset, member) = located?;
        let value = value.nested();
        let mut end = offset.saturating_add(match *module.ty(member.ty) {
            Type::RuntimeArray { .. } => scalars::length(&value).saturating_mul(member.stride()),
            _ => member.size(),
        });
        if let Some((start, stride)) = layout.runtime_stride().filter(|(start, _)| end > *start) {
            end = start.saturating_add((end - start).div_ceil(stride.max(1)).saturating_mul(stride));
        }
        self.module.limits.check(InputLimit::BufferBytes, end as u64, ErrorKind::InvalidArgument)?;
        if self.bytes.len() < end {
            self.bytes.resize(end, 0);
        }
        scalars::write(member, &mut self.bytes[offset..], &member_of(path, &name), &value).map_err(shown)?;
        Ok(self)
    }

    /// Overwrites all of it with a plain Rust value, whose size and kinds of scalars must be the
    /// struct's.
    ///
    /// # Errors
    /// `InvalidArgument` with both layouts side by side.
    pub fn write<T: NoUninit + Debug>(mut self, value: &T) -> Result<Self> {
        let given = HostBytes::of(value);
        self.compare(&given)?;
        self.bytes = given.bytes;
        Ok(self)
    }

    /// # Errors
    /// `InvalidArgument` where a Rust type is no layout of this struct.
    fn compare(&self, given: &HostBytes) -> Result<()> {
        let (layout, rust) = (self.layout(), &given.rust);
        let size = layout.size();
        // Rust's type may be padded at its end, as an element of an array is.
        let strides = strides(layout);
        let fits = match layout.runtime_stride() {
            Some((start, stride)) => rust.size >= start && (rust.size - start).is_multiple_of(stride.max(1)),
            None => {
                rust.size == size || strides.contains(&(rust.size as u32)) || {
                    strides.is_empty() && (size..size + 16).contains(&rust.size)
                }
            }
        };
        match fits {
            true => check_scalars(layout, "the struct", &given.rust, &|| given.bytes.clone()),
            false => Err(mismatch(layout, "the struct", rust, None)),
        }
    }

    /// Compares the layout of a host's struct with this one: the offset, width and class (float or
    /// integer) of each scalar, the order of members by name, and the stride of arrays of it.
    ///
    /// [`host_layout!`](crate::host_layout) has an example.
    ///
    /// # Errors
    /// `Expectation` with both layouts side by side, and the first byte at which they differ.
    pub fn check_host_layout<T: HostLayout>(&self) -> Result<()> {
        let host = T::host_type();
        compare(self.layout(), &host, host.name()).error().map_or(Ok(()), Err)
    }

    /// The bytes, little-endian; padding is zero.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The value by the names of its members: `data.value()["sun"]["power"].f32()`.
    #[must_use]
    pub fn value(&self) -> Value {
        self.layout().read(&self.bytes)
    }

    /// Offset, size, stride, type and name of each member as text, as `anyhit inspect --layout`
    /// prints it.
    #[must_use]
    pub fn describe(&self) -> String {
        StructTable::of(self.layout()).text()
    }

    /// Its bytes with a name for errors.
    #[doc(hidden)]
    pub fn given(&self) -> HostBytes {
        let name = self.module.describe_type(self.ty);
        let rust = RustLayout::of_block(name, self.bytes.len(), self.layout().lines());
        HostBytes { rust, bytes: self.bytes.clone() }
    }
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}
