//! A shader's value that can be read and written, by Rust types and by the names of its members.

use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::{AnyBitPattern, NoUninit};

use crate::fit;
use crate::host_struct::HostType;
use crate::layout_mismatch::mismatch;
use crate::rust_layout::{Known, RustLayout};
use crate::scalars::{self, Scalars};
use crate::value::Value;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::TypeId;
use anyhit_engine::reflect::{Layout, Rules};

/// A payload or callable data: bytes with the type that the shader gives them.
#[derive(Clone)]
pub struct TypedBytes {
    module: Arc<Module>,
    ty: TypeId,
    /// What it is, for errors: "the payload".
    what: &'static str,
    bytes: Vec<u8>,
}

impl TypedBytes {
    /// Words of the registers that hold a value of a type.
    pub(super) fn new(
        module: &Arc<Module>,
        ty: TypeId,
        what: &'static str,
        words: impl Iterator<Item = u32>,
    ) -> Self {
        Self { module: module.clone(), ty, what, bytes: words.flat_map(u32::to_le_bytes).collect() }
    }

    fn layout(&self) -> Layout<'_> {
        Layout::new(&self.module, self.ty, Rules::Packed)
    }

    /// The words for the registers.
    pub(super) fn words(&self) -> impl Iterator<Item = u32> + '_ {
        self.bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned)
    }

    /// The value by the names of its members: `data.value()["normal"].vec3()`.
    #[must_use]
    pub fn value(&self) -> Value {
        self.layout().read(&self.bytes)
    }

    /// The value as a plain Rust type: its scalars follow each other as
    /// `docs/testing.md` says under "Reading values".
    ///
    /// # Errors
    /// `InvalidArgument` where size or types differ; it shows both layouts.
    pub fn read<T: AnyBitPattern + Debug>(&self) -> Result<T> {
        if self.bytes.len() != size_of::<T>() {
            let rust = RustLayout::of(&bytemuck::Zeroable::zeroed() as &T);
            return Err(mismatch(self.layout(), self.what, &rust, None));
        }
        let value = bytemuck::pod_read_unaligned(&self.bytes);
        let rust = RustLayout::of::<T>(&value);
        // What a row of numbers reads is in the eye of the reader.
        if let Known::Classes(_) = rust.known {
            fit::check_scalars(self.layout(), self.what, &rust, &|| self.bytes.clone())?;
        }
        Ok(value)
    }

    /// Overwrites it with a plain Rust value.
    ///
    /// # Errors
    /// As [`TypedBytes::read`].
    pub fn write<T: NoUninit + Debug>(&mut self, value: &T) -> Result<()> {
        self.take(&HostBytes::of(value))
    }

    /// Overwrites a member, or all of it where the path is empty: `data.set("path[1].weight",
    /// 0.5f32)`.
    ///
    /// # Errors
    /// `InvalidArgument` where there is no such member, or it has another type.
    pub fn set(&mut self, path: &str, value: impl Scalars) -> Result<()> {
        let layout = Layout::new(&self.module, self.ty, Rules::Packed);
        let (offset, member) = layout.locate(path).map_err(|wrong| {
            Error::new(ErrorKind::InvalidArgument, format!("{}: {wrong}", self.what)).note_lines(format!(
                "{} in the shader:\n{}",
                self.module.describe_type(self.ty),
                layout.describe().join("\n")
            ))
        })?;
        let size = member.size();
        let bytes = self.bytes.get_mut(offset..offset + size).unwrap_or_default();
        scalars::write(member, bytes, &member_of(path, self.what), &value.nested())
    }

    /// Overwrites it with bytes of a Rust value.
    pub(super) fn take(&mut self, given: &HostBytes) -> Result<()> {
        self.check(given)?;
        self.bytes.copy_from_slice(&given.bytes);
        Ok(())
    }

    /// # Errors
    /// `InvalidArgument` where a Rust value is none of this type.
    pub(super) fn check(&self, given: &HostBytes) -> Result<()> {
        if given.bytes.len() != self.bytes.len() {
            return Err(mismatch(self.layout(), self.what, &given.rust, None));
        }
        fit::check_scalars(self.layout(), self.what, &given.rust, &|| given.bytes.clone())
    }
}

/// A member for errors: "`normal` of the payload".
pub(super) fn member_of(path: &str, whole: &str) -> String {
    if path.is_empty() { whole.to_owned() } else { format!("`{path}` of {whole}") }
}

/// Bytes of a Rust value, or of an array of another language, and their layout if it is known.
#[derive(Clone, Debug)]
pub struct HostBytes {
    /// The layout of its type, as far as it is known.
    pub rust: RustLayout,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl HostBytes {
    /// Those of a value.
    pub fn of<T: NoUninit + Debug>(value: &T) -> Self {
        Self { rust: RustLayout::of(value), bytes: bytemuck::bytes_of(value).to_vec() }
    }

    /// Those of the elements of a slice.
    pub fn of_slice<T: NoUninit>(elements: &[T]) -> Self {
        Self { rust: RustLayout::of_slice(elements), bytes: bytemuck::cast_slice(elements).to_vec() }
    }

    /// An array of scalars of a type of Rust, by its name, with lengths from the outermost; `None`
    /// for another name.
    pub fn of_array(scalar: &str, lengths: &[usize], bytes: Vec<u8>) -> Option<Self> {
        RustLayout::of_array(scalar, lengths, bytes.len()).map(|rust| Self { rust, bytes })
    }

    /// Structs of another language, one behind the other.
    pub fn of_structs(host: HostType, bytes: Vec<u8>) -> Self {
        Self { rust: RustLayout::of_structs(host, bytes.len()), bytes }
    }

    /// True if they have no type.
    pub fn is_raw(&self) -> bool {
        matches!(self.rust.known, Known::Bytes)
    }

    /// Bytes without a type.
    pub fn raw(bytes: &[u8]) -> Self {
        Self { rust: RustLayout::of_slice(bytes), bytes: bytes.to_vec() }
    }
}
