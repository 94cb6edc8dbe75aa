//! Typed bytes as a scene writes them: buffers, push constants, shader records and specialization
//! constants.
//!
//! ```toml
//! data = { f32 = [[1, 0, 0], [0, 1, 0]] }                # nested arrays are flattened
//! data = [{ u32 = 3 }, { align = 16 }, { f32 = [0.5] }]  # pieces follow each other
//! data = { struct = "Light", value = { power = 2 } }     # laid out by a shader's module
//! ```
//! Everything is little-endian, and padding is explicit but in structs: the file determines every
//! byte that a shader's `std430`, `scalar` or `std140` layout reads.

use crate::address_entry::AddressOf;
use crate::camera::CameraPiece;
use crate::data_sources::DataSources;
use crate::encoding::Data;
use crate::files::Files;
use crate::mesh_piece::MeshPiece;
use crate::read::{Diagnostics, OneOrMore, Parse, Spanned, Table, TomlValue};
use crate::read_file::read;
use crate::scalar::Scalar;
use crate::struct_data::{NoShaders, ShaderModules, StructContext, StructPiece};
use crate::tree::Toml;
use crate::typed_scalars::{self, TypedScalars};
use anyhit_base::error::{ErrorKind, Result};
use anyhit_base::input::InputLimit;
use anyhit_engine::reflect::lookup::DataBlock;

/// A sequence of pieces.
#[derive(Clone, Debug)]
pub struct DataPieces(Vec<Spanned<Piece>>);

#[derive(Clone, Debug)]
struct Piece {
    content: Content,
    repeat: u32,
}

#[derive(Clone, Debug)]
enum Content {
    Bytes(Vec<u8>),
    Scalars(Scalar, Vec<u8>),
    /// So many zeros.
    Zeros(u32),
    /// Zeros up to the next multiple of a number of bytes.
    Align(u32),
    /// The whole content of a file.
    File(String),
    /// Matrices of a camera.
    Camera(Box<CameraPiece>),
    /// Attributes, indices or tables of a mesh.
    Mesh(Box<MeshPiece>),
    /// A value by the names of a struct's members.
    Struct(Box<StructPiece>),
    /// A device address.
    Address(AddressOf),
}

impl DataPieces {
    /// Encodes the bytes of data in which everything is known.
    ///
    /// # Errors
    /// As [`DataPieces::resolve`], and `InvalidScene` where there is an address in them.
    pub fn encode(&self, sources: &DataSources<'_>) -> Result<Vec<u8>> {
        Ok(self.encode_typed(sources)?.0)
    }

    /// As [`DataPieces::encode`], with the types of the scalars.
    ///
    /// # Errors
    /// As there.
    pub(super) fn encode_typed(&self, sources: &DataSources<'_>) -> Result<(Vec<u8>, Vec<TypedScalars>)> {
        let (mut data, typed) = self.typed(sources, &NoShaders, None)?;
        match data.first_address() {
            None => Ok((std::mem::take(data.tail()), typed)),
            Some(span) => Err(span.error(
                "addresses are allowed only in buffers, push constants, shader records and \
                 specialization constants",
            )),
        }
    }

    /// The files that are read as they are.
    pub(super) fn named_files(&self) -> impl Iterator<Item = Spanned<String>> {
        self.0.iter().filter_map(|piece| match &piece.value.content {
            Content::File(path) => Some(Spanned { value: path.clone(), span: piece.span.clone() }),
            _ => None,
        })
    }

    /// Reads files and encodes everything but addresses.
    ///
    /// # Errors
    /// `Io` for a missing file, `InvalidScene` where it gets too large.
    pub fn resolve(&self, sources: &DataSources<'_>) -> Result<Data> {
        self.resolve_for(sources, &NoShaders, None)
    }

    /// As [`DataPieces::resolve`], for data that shaders read through a block which they declare.
    ///
    /// # Errors
    /// As there, and those of structs that the shaders do not have.
    pub fn resolve_for(
        &self,
        sources: &DataSources<'_>,
        modules: &dyn ShaderModules,
        block: Option<DataBlock>,
    ) -> Result<Data> {
        let (data, typed) = self.typed(sources, modules, block)?;
        if let (Some(DataBlock::PushConstants), Some(Spanned { span, .. })) = (block, self.0.first())
            && let Some(error) = typed_scalars::check_size(&modules.comparable(), data.size()?, span)
        {
            return Err(error);
        }
        let names_struct =
            |piece: &Piece| matches!(&piece.content, Content::Struct(named) if named.has_name());
        let is_compared = !typed.is_empty() && !self.0.iter().any(|piece| names_struct(&piece.value));
        let compared = block.filter(|_| is_compared);
        if let Some(block) = compared
            && let Some(error) = typed_scalars::check(&modules.comparable(), block, &typed)
        {
            return Err(error);
        }
        Ok(data)
    }

    /// The data, and the typed scalars in it with their places.
    fn typed(
        &self,
        sources: &DataSources<'_>,
        modules: &dyn ShaderModules,
        block: Option<DataBlock>,
    ) -> Result<(Data, Vec<TypedScalars>)> {
        let files = sources.files;
        let (mut data, mut typed) = (Data::default(), Vec::new());
        for Spanned { value: piece, span } in &self.0 {
            if let Content::Scalars(scalar, content) = &piece.content {
                let (scalar, offset, bytes) = (*scalar, data.size()? as usize, content.clone());
                typed.push(TypedScalars { offset, scalar, bytes, repeat: piece.repeat, span: span.clone() });
            }
            if let Content::Address(of) = &piece.content {
                let all = 8 * u64::from(piece.repeat);
                files
                    .limits()
                    .check(InputLimit::BufferBytes, all, ErrorKind::InvalidScene)
                    .and_then(|()| files.reserve(all))
                    .map_err(|error| error.at(span.place()))?;
                data.push_address(of.clone(), piece.repeat);
                continue;
            }
            if let Content::Align(to) = piece.content {
                for _ in 0..piece.repeat.min(1) {
                    data.align(to);
                }
                continue;
            }
            if let Content::Struct(named) = &piece.content {
                let report = Diagnostics::within(files.limits());
                let inner = |value: TomlValue<'_>| {
                    let pieces = Self::parse(value)?;
                    value.report().keep(pieces.typed(sources, modules, None))
                };
                // Only what begins a buffer is the block that a shader declares there.
                let block = block.filter(|_| data.is_empty());
                let context = StructContext { modules, block, piece: &inner, report: &report };
                let content = named.encode(&context);
                report.finish()?;
                let (content, late) = content.unwrap_or_default();
                let all = content.len() as u64 * u64::from(piece.repeat);
                grown(data.tail(), all, files).map_err(|error| error.at(span.place()))?;
                for _ in 0..piece.repeat {
                    data.append(&content, &late);
                }
                continue;
            }
            let bytes = data.tail();
            let content = match &piece.content {
                Content::Bytes(content) | Content::Scalars(_, content) => content.clone(),
                Content::Zeros(count) => {
                    let all = u64::from(*count) * u64::from(piece.repeat);
                    let size = grown(bytes, all, files).map_err(|error| error.at(span.place()))?;
                    bytes.resize(size, 0);
                    continue;
                }
                Content::File(path) => read(files, path, span)?,
                Content::Camera(camera) => camera.encode(span, sources)?,
                Content::Mesh(mesh) => {
                    let Some(meshes) = &sources.meshes else {
                        return Err(span.error(
                            "mesh data is allowed only in resources, push constants and shader records",
                        ));
                    };
                    let all = mesh.size(meshes)?.saturating_mul(piece.repeat.into());
                    grown(bytes, all, files).map_err(|error| error.at(span.place()))?;
                    let start = bytes.len();
                    bytes.reserve_exact(all as usize);
                    let mut late = mesh.encode(span, meshes, bytes)?;
                    let end = bytes.len();
                    match piece.repeat {
                        0 => bytes.truncate(start),
                        repeat if late.is_empty() => {
                            (1..repeat).for_each(|_| bytes.extend_from_within(start..end));
                        }
                        repeat => {
                            let content = bytes.split_off(start);
                            late.iter_mut().for_each(|(at, _)| *at -= start);
                            (0..repeat).for_each(|_| data.append(&content, &late));
                        }
                    }
                    continue;
                }
                Content::Align(_) | Content::Address(_) | Content::Struct(_) => continue,
            };
            let all = content.len() as u64 * u64::from(piece.repeat);
            let size = grown(bytes, all, files).map_err(|error| error.at(span.place()))?;
            if bytes.is_empty() && piece.repeat == 1 {
                *bytes = content;
                continue;
            }
            bytes.reserve_exact(size - bytes.len());
            for _ in 0..piece.repeat {
                bytes.extend_from_slice(&content);
            }
        }
        typed.retain(|typed| typed.scalar != Scalar::U8);
        Ok((data, typed))
    }
}

/// The size of a buffer that grows, within its own limit and that of the scene.
fn grown(bytes: &[u8], more: u64, files: &dyn Files) -> Result<usize> {
    let all = (bytes.len() as u64).saturating_add(more);
    files.limits().check(InputLimit::BufferBytes, all, ErrorKind::InvalidScene)?;
    files.reserve(more)?;
    Ok(all as usize)
}

impl Parse for DataPieces {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        OneOrMore::parse(value).map(|pieces| Self(pieces.0))
    }
}

impl Parse for Piece {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if !matches!(value.toml(), Toml::Table(_)) {
            return value.expected("typed data such as `{ f32 = [1, 2] }`");
        }
        let table = Table::new(value)?;
        let errors_before = value.report().len();
        let mut contents: Vec<Content> = Scalar::ALL
            .iter()
            .filter_map(|scalar| Some(Content::Scalars(*scalar, scalar.column(&table)?)))
            .collect();
        contents.extend(table.optional::<Hex>("hex").map(|hex| Content::Bytes(hex.0)));
        contents.extend(table.optional::<u32>("zeros").map(Content::Zeros));
        contents.extend(table.optional::<Spanned<u32>>("align").and_then(|to| align(&table, &to)));
        contents.extend(table.optional::<String>("file").map(Content::File));
        if StructPiece::is_in(&table) {
            contents.extend(StructPiece::parse(&table).map(|piece| Content::Struct(Box::new(piece))));
        }
        contents.extend(CameraPiece::parse(&table).map(|piece| Content::Camera(Box::new(piece))));
        contents.extend(MeshPiece::parse(&table).map(|piece| Content::Mesh(Box::new(piece))));
        contents.extend(address_of(&table).map(Content::Address));
        let repeat = table.or("repeat", 1);
        table.finish();
        if value.report().len() > errors_before {
            return None;
        }
        match <[Content; 1]>::try_from(contents) {
            Ok([content]) => Some(Self { content, repeat }),
            Err(contents) if contents.is_empty() => {
                value.wrong("no data: write a type and its values, such as `{ f32 = [1, 2] }`")
            }
            Err(_) => value.wrong("several kinds of data in one piece: write an array of pieces"),
        }
    }
}

/// Reads `address_of` and, beside it alone, `offset`.
fn address_of(table: &Table<'_>) -> Option<AddressOf> {
    let target: Spanned<String> = table.optional("address_of")?;
    let start = Spanned { value: 0, span: target.span.clone() };
    let offset = table.value("offset").map_or(Some(start), Spanned::parse)?;
    Some(AddressOf { target, offset })
}

fn align(table: &Table<'_>, to: &Spanned<u32>) -> Option<Content> {
    // Alignments above 4096 are assumed to be mistakes.
    if to.value.is_power_of_two() && to.value <= 4096 {
        return Some(Content::Align(to.value));
    }
    table.report().push(to.span.error("an alignment must be a power of two, at most 4096"));
    None
}

/// Bytes as hexadecimal digits; white space and `_` between them are ignored.
struct Hex(Vec<u8>);

impl Parse for Hex {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let text = String::parse(value)?;
        let digits = text.chars().filter(|c| !c.is_whitespace() && *c != '_').map(|c| c.to_digit(16));
        let Some(digits) = digits.collect::<Option<Vec<u32>>>() else {
            return value.wrong("not hexadecimal digits");
        };
        if digits.len() % 2 == 1 {
            return value
                .wrong(format!("odd number of hexadecimal digits ({}): each byte has two", digits.len()));
        }
        Some(Self(digits.chunks(2).map(|pair| (pair[0] * 16 + pair[1]) as u8).collect()))
    }
}

/// One scalar with its type, `{ u64 = 7 }`, or an address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ScalarPiece {
    /// Its bytes, and their type where one is given.
    Bytes(Vec<u8>, Option<Scalar>),
    /// A device address, 8 bytes.
    Address(AddressOf),
}

impl Parse for ScalarPiece {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        match Piece::parse(value)?.content {
            Content::Bytes(bytes) if bytes.len() <= 8 => Some(Self::Bytes(bytes, None)),
            Content::Scalars(Scalar::U8, bytes) if bytes.len() <= 8 => Some(Self::Bytes(bytes, None)),
            Content::Scalars(scalar, bytes) if bytes.len() == scalar.size() => {
                Some(Self::Bytes(bytes, Some(scalar)))
            }
            Content::Address(of) => Some(Self::Address(of)),
            _ => value.wrong("a specialization constant must be one scalar"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::EmbeddedFiles;
    use crate::open_models::OpenModels;
    use crate::read::Document;

    fn encode(text: &str) -> Result<Vec<u8>> {
        let document = Document::parse("t.toml", text)?;
        let report = Diagnostics::default();
        let table = document.root(&report);
        let data: Option<DataPieces> = table.required("x");
        table.finish();
        report.finish()?;
        let files = EmbeddedFiles(&[("b.bin", &[9, 8, 7])]);
        data.unwrap().encode(&DataSources::files(&files, &OpenModels::default()))
    }

    #[test]
    fn scalars_are_little_endian() {
        assert_eq!(encode("x = { u32 = 0x0403_0201 }").unwrap(), [1, 2, 3, 4]);
        assert_eq!(encode("x = { f32 = [[1], [-2.0]] }").unwrap(), [0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0]);
        // 1.5 = 0 01111 1000000000 in binary16
        assert_eq!(encode("x = { f16 = 1.5 }").unwrap(), [0, 0x3e]);
        assert_eq!(encode("x = { i16 = -2 }").unwrap(), [0xfe, 0xff]);
        // 1.5 = 0 01111111 1000000 in bfloat16, 0 0111 100 in E4M3, 0 01111 10 in E5M2
        assert_eq!(encode("x = { bf16 = [1.5, -inf] }").unwrap(), [0xc0, 0x3f, 0x80, 0xff]);
        assert_eq!(encode("x = [{ e4m3 = [1.5, 448] }, { e5m2 = 1.5 }]").unwrap(), [0x3c, 0x7e, 0x3e]);
        assert_eq!(encode("x = { bool = [true, false] }").unwrap(), [1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(encode("x = { f64 = 1 }").unwrap(), [0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
    }

    #[test]
    fn pieces_follow_each_other() {
        let text = "x = [{ u8 = 1 }, { align = 4 }, { hex = 'ff 0_1' }, { zeros = 2 }, { file = 'b.bin' }]";
        assert_eq!(encode(text).unwrap(), [1, 0, 0, 0, 0xff, 1, 0, 0, 9, 8, 7]);
        assert_eq!(encode("x = { u8 = [1, 2], repeat = 3 }").unwrap(), [1, 2, 1, 2, 1, 2]);
    }

    #[test]
    fn mistakes_are_shown_at_their_places() {
        for (text, wanted) in [
            ("x = 3", "typed data"),
            ("x = {}", "no data"),
            ("x = { f32 = 1, u32 = 1 }", "array of pieces"),
            ("x = { u8 = 256 }", "out of range: u8 ranges from 0 to 255"),
            ("x = { f16 = 65520 }", "out of the range of f16"),
            ("x = { e4m3 = 465 }", "out of the range of e4m3"),
            ("x = { e4m3 = inf }", "e4m3 has no infinity"),
            ("x = { f32 = 1e-46 }", "is too small for f32: it rounds to 0"),
            ("x = { f16 = 1e-9 }", "is too small for f16: it rounds to 0"),
            ("x = { f32 = 16777217 }", "is not exactly representable as f32: the nearest value is 16777216"),
            ("x = { e5m2 = 61440 }", "out of the range of e5m2"),
            ("x = { hex = 'abc' }", "each byte has two"),
            ("x = { align = 3 }", "power of two"),
            ("x = { f31 = 3 }", "did you mean `f32`?"),
            ("x = { u8 = 1, repeat = 4_000_000_000 }", "the limit `buffer-bytes`"),
            ("x = { zeros = 4_000_000_000 }", "the limit `buffer-bytes`"),
        ] {
            let error = encode(text).unwrap_err();
            assert!(error.render().contains(wanted), "{text}: {error:?}");
            assert!(error.render().contains("t.toml:1:"), "{text}: {error:?}");
        }
        let error = encode("x = { file = 'c.bin' }").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Io);
        assert!(error.render().contains("t.toml:1:5"), "{error:?}");
    }
}
