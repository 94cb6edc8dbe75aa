//! Data by member name: a value in TOML, laid out as the struct of a module that it is for.
//!
//! ```toml
//! data = { struct = "Light", shader = "rgen", value = { position = [0, 4, 0], power = 2.5 } }
//! data = { value = { count = 2, lights = [{ power = 1 }, { power = 2 }] }, rest = "zeros" }
//! ```
//! Offsets and strides are the module's own. Without `struct` the value is for the block that the
//! shader declares where the data is bound.

use std::sync::Arc;

use crate::address_entry::AddressOf;
use crate::encoding::{Data, Flattened};
use crate::read::{Diagnostics, Named, OwnedTomlValue, Span, Spanned, Table, TomlValue, integer};
use crate::scalar::float_bytes;
use crate::tree::Toml;
use crate::typed_scalars::TypedScalars;
use anyhit_base::error::names::nearest;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::InputLimit;
use anyhit_base::sorted::sort_by_key;
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::Type;
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::reflect::Layout;
use anyhit_engine::reflect::lookup::{
    DataBlock, distinct, find, find_block, layout_note, longest, name_of, padded_size, strides,
};

/// Names of missing members that an error lists.
const SHOWN: usize = 12;

/// A piece of data that is written by the names of members.
#[derive(Clone, Debug)]
pub struct StructPiece {
    span: Span,
    /// The struct; without, the block where the data is bound.
    name: Option<Spanned<String>>,
    /// The shader whose module has the struct.
    shader: Option<Spanned<String>>,
    value: OwnedTomlValue,
    /// Members without a value are zero.
    rest: bool,
    /// Bytes between the elements of an array of structs.
    stride: Option<Spanned<u32>>,
}

/// What members without a value are.
#[derive(Clone, Copy)]
struct Rest;

impl Named for Rest {
    const WHAT: &'static str = "value of the remaining members";
    const NAMES: &'static [(&'static str, Self)] = &[("zeros", Self)];
}

/// The modules in which structs of a scene are looked up.
pub trait ShaderModules {
    /// The module of a shader by the scene's name for it.
    ///
    /// # Errors
    /// Where no shader has the name, or its module cannot be loaded.
    fn module(&self, shader: &Spanned<String>) -> Result<Arc<Module>>;

    /// The modules that a piece without `shader` is for.
    ///
    /// # Errors
    /// Where one cannot be loaded.
    fn all(&self) -> Result<Vec<Arc<Module>>>;

    /// Those of them whose declarations typed data is compared with: they can be loaded, and the
    /// lengths of their arrays depend on no address.
    fn comparable(&self) -> Vec<Arc<Module>>;
}

/// The modules for data that no shader reads through a block: there are none.
#[derive(Debug)]
pub struct NoShaders;

impl ShaderModules for NoShaders {
    fn module(&self, shader: &Spanned<String>) -> Result<Arc<Module>> {
        Err(shader.span.error("no shader reads this data, so it has no struct layouts"))
    }

    fn all(&self) -> Result<Vec<Arc<Module>>> {
        let message = "no shader reads this data, so it has no struct layouts";
        Err(Error::new(ErrorKind::InvalidScene, message))
    }

    fn comparable(&self) -> Vec<Arc<Module>> {
        Vec::new()
    }
}

/// A piece of data, and the typed scalars in it.
pub type TypedData = (Data, Vec<TypedScalars>);

/// What a [`StructPiece`] is encoded for.
#[allow(missing_debug_implementations, reason = "it borrows closures")]
pub struct StructContext<'a> {
    /// Where structs are looked up.
    pub modules: &'a dyn ShaderModules,
    /// The block that the data fills, if it begins one.
    pub block: Option<DataBlock>,
    /// A piece of data inside a value, `{ address_of = "lights" }`.
    pub piece: &'a dyn Fn(TomlValue<'_>) -> Option<TypedData>,
    /// Where the limits stand, and mistakes go.
    pub report: &'a Diagnostics,
}

impl StructPiece {
    /// Whether a table is such a piece.
    pub fn is_in(table: &Table<'_>) -> bool {
        table.value("struct").is_some() | table.value("value").is_some()
    }

    /// Whether it says which struct it is, and is so whatever a shader declares there.
    pub(super) fn has_name(&self) -> bool {
        self.name.is_some()
    }

    /// Reads its keys.
    pub fn parse(table: &Table<'_>) -> Option<Self> {
        let name = table.optional("struct");
        let shader = table.optional("shader");
        let rest = table.optional::<Rest>("rest").is_some();
        let stride = table.optional::<Spanned<u32>>("stride");
        let Some(value) = table.value("value") else {
            let message = "a struct needs a `value`: a table of its members, or an array of tables";
            table.report().push(table.span().error(message));
            return None;
        };
        if let Some(Spanned { span, .. }) = stride.as_ref().filter(|stride| stride.value == 0) {
            table.report().push(span.error("the stride must not be 0"));
        }
        let value = value.to_owned_value();
        Some(Self { span: table.span(), name, shader, value, rest, stride })
    }

    /// The bytes of the value, and the pieces that are encoded later with their places, ascending.
    /// Mistakes go to the report; then there are none.
    pub fn encode(&self, context: &StructContext<'_>) -> Option<Flattened> {
        let at = |error: Error| {
            let named = self.name.as_ref().map_or(&self.span, |name| &name.span);
            if error.places().next().is_some() {
                return error;
            }
            // Here the scene is at fault, not an argument.
            let own = Error::new(ErrorKind::InvalidScene, error.message()).at(named.place());
            error.notes().iter().fold(own, |own, note| own.note(note))
        };
        let modules = match &self.shader {
            Some(shader) => context.modules.module(shader).map(|module| vec![module]),
            None => context.modules.all(),
        };
        let modules = context.report.keep(modules.map_err(at))?;
        let layout = context.report.keep(self.layout(&modules, context.block).map_err(at))?;
        // The mistakes of the value are collected by themselves: the first shows the layout.
        let report = Diagnostics::within(*context.report.limits());
        let mut writer =
            Writer { context, report: &report, bytes: Vec::new(), late: Vec::new(), missing: Vec::new() };
        let value = self.value.value(&report);
        let size = writer.whole(self, layout, value);
        if !self.rest && !writer.missing.is_empty() {
            let missing = writer.missing.iter().take(SHOWN).map(|name| format!("`{name}`"));
            let mut list = missing.collect::<Vec<_>>().join(", ");
            if writer.missing.len() > SHOWN {
                list += &format!(" and {} more", writer.missing.len() - SHOWN);
            }
            let label = "add them, or write `rest = \"zeros\"` beside `value`";
            let error = self.value.span().error_with(format!("missing value for {list}"), label);
            report.push(error);
        }
        let (mut bytes, mut late) = (writer.bytes, writer.late);
        sort_by_key(&mut late, |(at, _)| *at);
        match report.finish() {
            Ok(()) => {
                bytes.resize(size?, 0);
                Some((bytes, late))
            }
            Err(error) => {
                let known = error.notes().first().is_some_and(|note| note.starts_with("struct "));
                context.report.push(if known { error } else { error.note_lines(layout_note(layout)) });
                None
            }
        }
    }

    /// The layout of the value in the modules that it may be for.
    fn layout<'m>(&self, modules: &'m [Arc<Module>], block: Option<DataBlock>) -> Result<Layout<'m>> {
        let mut found = Vec::new();
        let mut first_error = None;
        for module in modules {
            let layout = match (&self.name, block) {
                (Some(name), _) => find(module, &name.value).map(Some),
                (None, Some(block)) => find_block(module, block),
                (None, None) => {
                    let message = "`value` needs the name of a `struct`: the data here is not the start of a \
                         shader's block";
                    return Err(Error::new(ErrorKind::InvalidScene, message));
                }
            };
            match layout {
                Ok(layout) => found.extend(layout),
                Err(error) if first_error.is_none() => first_error = Some(error),
                Err(_) => {}
            }
        }
        let found = distinct(found);
        if let Some(longest) = longest(&found) {
            return Ok(longest);
        }
        match (&found[..], first_error) {
            ([], Some(error)) => Err(error),
            ([], None) => {
                let what = block.map_or_else(|| "a struct".to_owned(), DataBlock::describe);
                let message = match (modules.is_empty(), &self.shader) {
                    (true, _) => "the scene has no shader that declares structs".to_owned(),
                    (_, Some(shader)) => {
                        format!("the shader `{}` does not declare {what}", shader.value)
                    }
                    (_, None) => format!("no shader of the scene declares {what}"),
                };
                Err(Error::new(ErrorKind::InvalidScene, message))
            }
            _ => {
                let what = self.name.as_ref().map_or_else(
                    || block.map_or_else(String::new, DataBlock::describe),
                    |name| format!("`{}`", name.value),
                );
                let message =
                    format!("{what} differs between the shaders: select one with `shader = \"NAME\"`");
                let notes = found.iter().take(4).map(|layout| layout_note(*layout));
                let error = Error::new(ErrorKind::InvalidScene, message);
                Err(notes.fold(error, Error::note_lines))
            }
        }
    }
}

/// Writes a value into bytes.
struct Writer<'a> {
    context: &'a StructContext<'a>,
    report: &'a Diagnostics,
    bytes: Vec<u8>,
    /// What is encoded later, with its place.
    late: Vec<(usize, AddressOf)>,
    /// The paths of members that the value does not have.
    missing: Vec<String>,
}

impl Writer<'_> {
    /// Writes the value of a piece; returns how many bytes it has.
    fn whole(&mut self, piece: &StructPiece, layout: Layout<'_>, value: TomlValue<'_>) -> Option<usize> {
        let Some(elements) = value.elements() else {
            self.write(layout, value, "", 0)?;
            return self.grow(self.bytes.len().max(padded_size(layout)), value);
        };
        let Type::Struct { members, .. } = layout.module.ty(layout.ty) else { return None };
        if let ([member], None) = (&members[..], &piece.name) {
            // A block that only wraps an array: a structured buffer.
            let (offset, part) = layout.member(0);
            self.write(part, value, &member.name, offset)?;
            let end = self.bytes.len().max(layout.size());
            return self.grow(end, value);
        }
        if layout.runtime_stride().is_some() {
            return self.wrong(value, "a struct that ends in a runtime array cannot be an array element");
        }
        let stride = match (&piece.stride, &strides(layout)[..]) {
            (Some(stride), _) if (stride.value as usize) < layout.size() => {
                let message = format!("the stride is less than the {} bytes of the struct", layout.size());
                self.report.push(stride.span.error(message));
                return None;
            }
            (Some(stride), _) => stride.value as usize,
            (None, &[stride]) => stride as usize,
            (None, []) => {
                return self.wrong(
                    value,
                    "the module has neither an array of the struct nor a pointer with a stride: set \
                     `stride` in bytes beside `value`",
                );
            }
            (None, several) => {
                let several: Vec<_> = several.iter().map(u32::to_string).collect();
                let message =
                    format!("the module has arrays of the struct with the strides {}: ", several.join(", "));
                return self.wrong(value, message + "set `stride` beside `value`");
            }
        };
        let mut count = 0usize;
        for element in elements {
            self.write(layout, element, &format!("[{count}]"), count.checked_mul(stride)?);
            count += 1;
        }
        self.grow(count.checked_mul(stride)?, value)
    }

    /// Reports a mistake.
    fn wrong<T>(&self, value: TomlValue<'_>, message: impl Into<String>) -> Option<T> {
        self.report.push(value.span().error(message));
        None
    }

    /// Makes room up to an end, within the limit of buffers.
    fn grow(&mut self, end: usize, value: TomlValue<'_>) -> Option<usize> {
        let checked =
            self.report.limits().check(InputLimit::BufferBytes, end as u64, ErrorKind::InvalidScene);
        if let Err(error) = checked {
            self.report.push(error.at(value.span().place()));
            return None;
        }
        if self.bytes.len() < end {
            self.bytes.resize(end, 0);
        }
        Some(end)
    }

    fn put(&mut self, at: usize, bytes: &[u8], value: TomlValue<'_>) -> Option<()> {
        let end = at.checked_add(bytes.len())?;
        self.grow(end, value)?;
        self.bytes[at..end].copy_from_slice(bytes);
        Some(())
    }

    fn write(&mut self, layout: Layout<'_>, value: TomlValue<'_>, path: &str, at: usize) -> Option<()> {
        let module = layout.module;
        let is_table = matches!(value.toml(), Toml::Table(_));
        match module.ty(layout.ty) {
            Type::Struct { members, .. } => match (is_table, &members[..]) {
                (_, [only]) if only.name.is_empty() && has_names_inside(layout, is_table) => {
                    let (offset, part) = layout.member(0);
                    self.write(part, value, path, at.checked_add(offset)?)?;
                    self.grow(at.checked_add(layout.size())?, value).map(|_| ())
                }
                (true, [only]) if is_storage(layout) && !has_key(value, &only.name) => {
                    self.piece(layout, value, path, at)
                }
                (true, _) => self.members(layout, value, path, at),
                (false, [only]) if value.elements().is_some() => {
                    if name_of(module, layout.ty).is_some_and(is_column_storage) {
                        return self.transposed(layout, value, path, at);
                    }
                    let (offset, part) = layout.member(0);
                    self.write(part, value, &format!("{path}.{}", only.name), at.checked_add(offset)?)
                }
                // What naga makes of a matrix whose columns do not lie as those of uniform buffers.
                (false, _)
                    if name_of(module, layout.ty).is_some_and(|name| name.starts_with("std140_mat")) =>
                {
                    let columns = layout.members().collect::<Vec<_>>();
                    self.list(layout, value, path, Some(columns.len()), |this, index, element, path| {
                        let (offset, part) = columns[index];
                        this.write(part, element, path, at.checked_add(offset)?)
                    })
                }
                _ => self.mismatch(layout, value, path, "a table of its members"),
            },
            _ if is_table => self.piece(layout, value, path, at),
            Type::Bool | Type::Int { .. } | Type::Float { .. } => {
                let bytes = self.scalar(layout, value, path)?;
                self.put(at, &bytes, value)
            }
            Type::Pointer { .. } => match value.toml() {
                Toml::Integer(..) => {
                    let address = integer(value, 0, u64::MAX.into(), "u64")?;
                    self.put(at, &(address as u64).to_le_bytes(), value)
                }
                _ => self.mismatch(layout, value, path, "`{ address_of = \"BUFFER\" }` or a number"),
            },
            Type::Vector { .. } | Type::Matrix { .. } => {
                let places = layout.parts();
                self.list(layout, value, path, Some(places.len()), |this, index, element, path| {
                    let (offset, part) = places[index];
                    this.write(part, element, path, at.checked_add(offset)?)
                })
            }
            Type::Array { length, .. } => {
                let length = array_length(module, *length);
                self.array(layout, value, path, at, Some(length))
            }
            Type::RuntimeArray { .. } => self.array(layout, value, path, at, None),
            _ => self.wrong(
                value,
                format!("`{path}` is {}, which data cannot represent", module.describe_type(layout.ty)),
            ),
        }
    }

    fn array(
        &mut self,
        layout: Layout<'_>,
        value: TomlValue<'_>,
        path: &str,
        at: usize,
        length: Option<usize>,
    ) -> Option<()> {
        let (Type::Array { element, .. } | Type::RuntimeArray { element, .. }) = *layout.module.ty(layout.ty)
        else {
            return None;
        };
        let (part, stride) = (Layout { ty: element, ..layout }, layout.stride());
        let given = value.elements().map(Iterator::count);
        self.list(layout, value, path, length, |this, index, element, path| {
            this.write(part, element, path, at.checked_add(index.checked_mul(stride)?)?)
        })?;
        // The last element of a runtime array is as long as its stride, too.
        if let (None, Some(given)) = (length, given) {
            self.grow(at.checked_add(given.checked_mul(stride)?)?, value)?;
        }
        Some(())
    }

    /// Writes the elements of a list, which has as many as are wanted.
    fn list(
        &mut self,
        layout: Layout<'_>,
        value: TomlValue<'_>,
        path: &str,
        wanted: Option<usize>,
        mut write: impl FnMut(&mut Self, usize, TomlValue<'_>, &str) -> Option<()>,
    ) -> Option<()> {
        let Some(elements) = value.elements() else {
            let what = match layout.module.ty(layout.ty) {
                Type::Matrix { .. } => "an array of its columns",
                _ => "an array",
            };
            return self.mismatch(layout, value, path, what);
        };
        let mut given = 0;
        for element in elements {
            if wanted.is_none_or(|wanted| given < wanted) {
                write(self, given, element, &format!("{path}[{given}]"));
            }
            given += 1;
        }
        match wanted.filter(|wanted| given != *wanted) {
            None => Some(()),
            Some(wanted) if given < wanted && matches!(layout.module.ty(layout.ty), Type::Array { .. }) => {
                self.missing.push(match wanted - given {
                    1 => format!("{path}[{given}]"),
                    _ => format!("{path}[{given}] to [{}]", wanted - 1),
                });
                Some(())
            }
            Some(wanted) => {
                let ty = layout.module.describe_type(layout.ty);
                self.wrong(value, format!("`{path}` is {ty}: expected {wanted} elements, found {given}"))
            }
        }
    }

    fn members(&mut self, layout: Layout<'_>, value: TomlValue<'_>, path: &str, at: usize) -> Option<()> {
        let module = layout.module;
        let Type::Struct { members, .. } = module.ty(layout.ty) else { return None };
        let what = module.describe_type(layout.ty);
        let inside = |name: &str| format!("{path}{}{name}", if path.is_empty() { "" } else { "." });
        if members.iter().all(|member| member.name.is_empty()) {
            return self
                .wrong(value, format!("the members of {what} have no names: OpMemberName is stripped"));
        }
        let table = Table::new(value)?;
        for (key, value) in table.iter() {
            let found = members.iter().zip(layout.members()).find(|(member, _)| member.name == key.value);
            if let Some((_, (offset, part))) = found {
                if let Some(at) = at.checked_add(offset) {
                    self.write(part, value, &inside(&key.value), at);
                }
                continue;
            }
            let near = nearest(&key.value, members.iter().map(|member| member.name.as_str()));
            let label =
                near.map_or_else(|| "no such member".to_owned(), |near| format!("did you mean `{near}`?"));
            let message = format!("{what} has no member `{}`", key.value);
            self.report.push(key.span.error_with(message, label).note_lines(layout_note(layout)));
        }
        for (member, (_, part)) in members.iter().zip(layout.members()) {
            // A runtime array that is not given has no elements.
            let open = matches!(module.ty(part.ty), Type::RuntimeArray { .. });
            if !open && !table.has_name(&member.name) {
                self.missing.push(inside(&member.name));
            }
        }
        self.grow(at.checked_add(layout.size())?, value)?;
        Some(())
    }

    /// A matrix that Slang stores as an array of its columns, where the value has its rows.
    fn transposed(&mut self, layout: Layout<'_>, value: TomlValue<'_>, path: &str, at: usize) -> Option<()> {
        let (offset, data) = layout.member(0);
        let Type::Array { element, length, .. } = *layout.module.ty(data.ty) else { return None };
        let (part, stride) = (layout.scalar(element), data.stride());
        let (rows, columns) = (layout.lanes(element), array_length(layout.module, length));
        let at = at.checked_add(offset)?;
        self.list(layout, value, path, Some(rows), |this, row, element, path| {
            this.list(layout, element, path, Some(columns), |this, column, element, path| {
                this.write(part, element, path, at.checked_add(column * stride + row * part.size())?)
            })
        })
    }

    /// A piece of data as the value of a member: an address, a file, numbers of a given type.
    fn piece(&mut self, layout: Layout<'_>, value: TomlValue<'_>, path: &str, at: usize) -> Option<()> {
        let errors_before = value.report().len();
        let Some((data, typed)) = (self.context.piece)(value) else {
            if value.report().len() == errors_before {
                return self.wrong(value, format!("`{path}` cannot be read as a piece of data"));
            }
            return None;
        };
        let (bytes, late) = data.flattened();
        let module = layout.module;
        let what = module.describe_type(layout.ty);
        let wrong_size =
            |size: usize| format!("`{path}` is {what} of {size} bytes, but the piece has {}", bytes.len());
        if let Type::Vector { .. } | Type::Matrix { .. } = layout.module.ty(layout.ty) {
            // The scalars of a piece follow each other as they do in memory.
            let mut scalars = layout.scalars();
            sort_by_key(&mut scalars, |(offset, _)| *offset);
            let width = scalars.first().map_or(0, |(_, part)| part.size());
            if scalars.len() * width != bytes.len() || width == 0 || !late.is_empty() {
                return self.wrong(value, wrong_size(scalars.len() * width));
            }
            let ty = scalars.first().map(|(_, part)| module.ty(part.ty));
            if let Some(wrong) = ty.and_then(|ty| typed.iter().find_map(|typed| typed.misfit_in(ty))) {
                return self.wrong(value, format!("`{path}` is {what}: found {wrong}"));
            }
            for ((offset, _), scalar) in scalars.iter().zip(bytes.chunks(width)) {
                self.put(at.checked_add(*offset)?, scalar, value)?;
            }
            return Some(());
        }
        let stride = layout.stride().max(1);
        match layout.module.ty(layout.ty) {
            Type::RuntimeArray { .. } if !bytes.len().is_multiple_of(stride) => {
                let message =
                    format!("`{path}` has elements of {stride} bytes, but the piece has {}", bytes.len());
                return self.wrong(value, message);
            }
            Type::RuntimeArray { .. } => {}
            // An array may end with its last element or with that one's padding.
            Type::Array { length, .. }
                if bytes.len() == array_length(layout.module, *length).saturating_mul(stride) => {}
            _ if bytes.len() == layout.size() => {}
            _ => return self.wrong(value, wrong_size(layout.size())),
        }
        if let Some(wrong) = typed.iter().find_map(|typed| typed.misfit(layout, path)) {
            let (error, help) = wrong.error();
            self.report.push(error.note(help));
            return None;
        }
        self.put(at, &bytes, value)?;
        self.late.extend(late.into_iter().map(|(place, piece)| (at + place, piece)));
        Some(())
    }

    fn scalar(&self, layout: Layout<'_>, value: TomlValue<'_>, path: &str) -> Option<Vec<u8>> {
        let number = matches!(value.toml(), Toml::Integer(..));
        match layout.module.ty(layout.ty) {
            Type::Bool => match value.toml() {
                Toml::Boolean(flag) => Some(u32::from(*flag).to_le_bytes().to_vec()),
                _ => self.mismatch(layout, value, path, "true or false"),
            },
            &Type::Int { width, signed } => {
                let whole = match value.toml() {
                    // Compilers store the bools of a buffer as 32-bit integers.
                    Toml::Boolean(flag) if width == 32 => i128::from(*flag),
                    _ if !number => return self.mismatch(layout, value, path, "an integer"),
                    _ if signed => {
                        let most = 1i128 << (width - 1);
                        integer(value, -most, most - 1, &layout.module.describe_type(layout.ty))?
                    }
                    _ => integer(value, 0, (1i128 << width) - 1, &layout.module.describe_type(layout.ty))?,
                };
                Some(whole.to_le_bytes()[..width as usize / 8].to_vec())
            }
            ty @ Type::Float { .. } => {
                if !number && !matches!(value.toml(), Toml::Float(_)) {
                    return self.mismatch(layout, value, path, "a number");
                }
                match ty.float_format() {
                    Some(format) => float_bytes(value, format, &layout.module.describe_type(layout.ty)),
                    None => self.wrong(value, format!("the format of the float `{path}` is not known")),
                }
            }
            _ => None,
        }
    }

    /// Reports a value of another type than the member's.
    fn mismatch<T>(&self, layout: Layout<'_>, value: TomlValue<'_>, path: &str, needed: &str) -> Option<T> {
        let ty = layout.module.describe_type(layout.ty);
        let what = if path.is_empty() { ty } else { format!("`{path}` is {ty}") };
        let found = value.toml().what();
        let message = format!("{what}: expected {needed}, found {found}");
        self.report.push(value.span().error_with(message, "here"));
        None
    }
}

/// Whether a struct is what Slang makes of a matrix or an array, with one member for its content.
fn is_storage(layout: Layout<'_>) -> bool {
    name_of(layout.module, layout.ty)
        .is_some_and(|name| name.starts_with("_MatrixStorage_") || name.starts_with("_Array_"))
}

/// Whether a struct only wraps what a value is for, as naga's do for a variable of WGSL that is no
/// struct with a runtime array: the one member has no name, and a table is for the members inside.
fn has_names_inside(layout: Layout<'_>, is_table: bool) -> bool {
    let (_, inner) = layout.member(0);
    match inner.module.ty(inner.ty) {
        Type::Struct { members, .. } => members.iter().any(|member| !member.name.is_empty()),
        _ => !is_table,
    }
}

fn has_key(value: TomlValue<'_>, key: &str) -> bool {
    Table::new(value).is_some_and(|table| table.has_name(key))
}

/// Whether a struct is what Slang makes of a matrix whose columns follow each other.
fn is_column_storage(name: &str) -> bool {
    name.starts_with("_MatrixStorage_") && name.contains("_ColMajor")
}
