//! Pieces of data that come from meshes: attributes of vertices, indices, and tables of instances,
//! geometries and materials.

mod tables;

use std::collections::HashMap;

use crate::address_entry::AddressOf;
use crate::instance_entry::InstanceEntry;
use crate::mesh::material::{Texture, TextureSlot};
use crate::mesh::model::{Model, Part};
use crate::mesh_piece::tables::{
    Column, ColumnKind, GeometryColumn, InstanceColumn, MaterialColumn, NOTHING, WithMaterial, geometry,
    instance, material, places,
};
use crate::open_models::MeshSelection;
use crate::read::{Named, OneOrMore, Parse, Span, Spanned, Table, TomlValue, unknown_name};
use anyhit_base::error::names::list_of;
use anyhit_base::error::{Error, Result};
use anyhit_base::sorted::sort;

/// A piece that comes from meshes.
#[derive(Clone, Debug)]
pub struct MeshPiece {
    mesh: Option<Spanned<String>>,
    content: MeshContent,
    /// Bytes from one row to the next, where they are not packed.
    stride: Option<u32>,
}

#[derive(Clone, Debug)]
enum MeshContent {
    /// A row of each vertex.
    Vertices {
        attributes: Vec<Spanned<String>>,
        formats: Vec<AttributeFormat>,
        missing: Option<Vec<f32>>,
        /// The texture whose transform texture coordinates go through.
        texture_transform: Option<TextureSlot>,
    },
    /// Three indices a triangle, of two bytes each or of four.
    Indices { is_short: bool },
    /// A row of each instance of an acceleration structure that has one of the geometries.
    Instances { columns: Vec<Column<WithMaterial<InstanceColumn>>>, tlas: String },
    /// A row of each geometry.
    Geometries(Vec<Column<WithMaterial<GeometryColumn>>>),
    /// A row of each material of the file.
    Materials(Vec<Column<MaterialColumn>>),
    /// A row of each geometry: its own material's.
    OwnMaterials(Vec<Column<MaterialColumn>>),
}

/// How an attribute is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AttributeFormat {
    F32(usize),
    /// Bytes that stand for fractions of 255.
    Unorm8x4,
    /// Bytes that stand for fractions of 127.
    Snorm8x4,
    U16,
    U32,
    U16x4,
    U32x4,
}

impl Named for AttributeFormat {
    const WHAT: &'static str = "format of an attribute";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("f32x2", Self::F32(2)),
        ("f32x3", Self::F32(3)),
        ("f32x4", Self::F32(4)),
        ("f32", Self::F32(1)),
        ("u8x4", Self::Unorm8x4),
        ("unorm8x4", Self::Unorm8x4),
        ("snorm8x4", Self::Snorm8x4),
        ("u16", Self::U16),
        ("u32", Self::U32),
        ("u16x4", Self::U16x4),
        ("u32x4", Self::U32x4),
    ];
}

impl AttributeFormat {
    /// The format of an attribute that a scene does not say.
    fn of(attribute: &str) -> Self {
        match attribute.split_once('_').map_or(attribute, |(kind, _)| kind) {
            "texcoord" => Self::F32(2),
            "tangent" | "color" | "weights" => Self::F32(4),
            "joints" => Self::U16x4,
            _ => Self::F32(3),
        }
    }

    fn size(self) -> u64 {
        match self {
            Self::F32(components) => 4 * components as u64,
            Self::Unorm8x4 | Self::Snorm8x4 | Self::U32 => 4,
            Self::U16 => 2,
            Self::U16x4 => 8,
            Self::U32x4 => 16,
        }
    }

    /// Components that are missing are 0, and the fourth 1 (Vulkan, "Vertex Input Extraction").
    fn encode(self, given: &[f32], bytes: &mut Vec<u8>) {
        let mut all = [0.0, 0.0, 0.0, 1.0];
        all[..given.len()].copy_from_slice(given);
        match self {
            Self::F32(components) => all[..components].iter().for_each(|x| bytes.extend(x.to_le_bytes())),
            Self::Unorm8x4 => bytes.extend(all.map(|x| (x.clamp(0.0, 1.0) * 255.0).round_ties_even() as u8)),
            Self::Snorm8x4 => {
                let byte = |x: f32| (x.clamp(-1.0, 1.0) * 127.0).round_ties_even() as i8;
                bytes.extend(all.map(|x| byte(x).to_le_bytes()[0]));
            }
            Self::U16 => bytes.extend((all[0] as u16).to_le_bytes()),
            Self::U32 => bytes.extend((all[0] as u32).to_le_bytes()),
            Self::U16x4 => all.iter().for_each(|x| bytes.extend((*x as u16).to_le_bytes())),
            Self::U32x4 => all.iter().for_each(|x| bytes.extend((*x as u32).to_le_bytes())),
        }
    }
}

/// The tables.
#[derive(Clone, Copy)]
enum TableName {
    Instances,
    Geometries,
    Materials,
}

impl Named for TableName {
    const WHAT: &'static str = "table of a mesh";
    const NAMES: &'static [(&'static str, Self)] =
        &[("instances", Self::Instances), ("geometries", Self::Geometries), ("materials", Self::Materials)];
}

/// A texture of a mesh, `{ mesh = "floor", texture = "base_color" }`.
#[derive(Clone, Debug)]
pub struct TextureReference {
    mesh: Spanned<String>,
    texture: TextureChoice,
    /// The span of its table.
    pub span: Span,
}

#[derive(Clone, Copy, Debug)]
enum TextureChoice {
    /// That of the geometry's material.
    TextureSlot(TextureSlot),
    /// By its number in the file.
    Number(u32),
    /// All of the file, each an element of an array.
    All,
    /// One of all, by its number: the materials say whether it has colours.
    OneOfAll(u32),
}

impl Parse for TextureReference {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let mesh = table.required("mesh");
        let base_color = TextureChoice::TextureSlot(TextureSlot::BaseColor);
        let mut texture = table.value("texture").map_or(Some(base_color), |value| match value.text() {
            Some(_) => TextureSlot::parse(value).map(TextureChoice::TextureSlot),
            None => u32::parse(value).map(TextureChoice::Number),
        });
        if let Some(all) = table.value("textures") {
            texture = match all.text() {
                Some("all") if !table.has("texture") => Some(TextureChoice::All),
                Some("all") => all.wrong("`texture` and `textures` exclude each other"),
                _ => all.wrong("`textures` must be `\"all\"`: each texture becomes an element of an array"),
            };
        }
        table.finish();
        Some(Self { mesh: mesh?, texture: texture?, span: value.span() })
    }
}

impl TextureReference {
    /// Whether it is of all textures of a file, which only an array of descriptors holds.
    pub fn is_all(&self) -> bool {
        matches!(self.texture, TextureChoice::All)
    }

    /// One for each texture of the file.
    ///
    /// # Errors
    /// As [`SceneMeshes::find`].
    pub fn each(&self, meshes: &SceneMeshes<'_>) -> Result<Vec<Self>> {
        let count = meshes.find(&self.mesh)?.model.textures.len() as u32;
        let one = |at| Self { texture: TextureChoice::OneOfAll(at), ..self.clone() };
        Ok((0..count).map(one).collect())
    }

    /// The texture, and whether its texels of 8 bits are colours, where that is known.
    ///
    /// # Errors
    /// `InvalidScene` where there is none, or the mesh has several.
    pub fn find<'m>(&self, meshes: &SceneMeshes<'m>) -> Result<(&'m Texture, Option<bool>)> {
        let MeshSelection { model, parts, .. } = meshes.find(&self.mesh)?;
        let slot = match self.texture {
            TextureChoice::TextureSlot(slot) => slot,
            TextureChoice::All => {
                let message = "`textures = \"all\"` fills the elements of an array of descriptors, not the layers \
                     of an image";
                return Err(self.span.error(message));
            }
            TextureChoice::OneOfAll(number) => {
                return Ok((&model.textures[number as usize], model.texture_has_colors(number as usize)));
            }
            TextureChoice::Number(number) => {
                let count = model.textures.len();
                let message =
                    || format!("texture {number} is out of range: there are {count} (counted from 0)");
                let texture =
                    model.textures.get(number as usize).ok_or_else(|| self.span.error(message()))?;
                return Ok((texture, None));
            }
        };
        let mut found = parts.iter().map(|part| model.texture(*part, slot));
        let first = found.next().flatten();
        if found.any(|other| other != first) {
            let message =
                format!("the geometries of `{}` have different textures `{}`", self.mesh.value, slot.name());
            let names = parts.iter().map(|part| model.parts[*part].name.as_str());
            let error = self.mesh.span.error(message);
            return Err(error.note(format!("name one of its geometries: {}", list_of(names))));
        }
        let Some(texture) = first else {
            let names = TextureSlot::NAMES
                .iter()
                .filter(|(_, slot)| parts.first().is_some_and(|part| model.texture(*part, *slot).is_some()));
            let names = list_of(names.map(|(name, _)| *name));
            let error = self.span.error(format!("`{}` has no texture `{}`", self.mesh.value, slot.name()));
            return Err(match names.is_empty() {
                true => error.note("its material has no texture"),
                false => error.note(format!("its material has: {names}")),
            });
        };
        Ok((texture, Some(slot.is_color())))
    }
}

/// What the pieces of a scene may name: meshes, and the instances of its acceleration structures.
#[derive(Clone, Copy, Debug)]
pub struct SceneMeshes<'a> {
    /// The meshes by their names.
    pub names: &'a HashMap<String, Result<MeshSelection>>,
    /// All instances.
    pub instances: &'a [InstanceEntry],
}

impl<'m> SceneMeshes<'m> {
    /// The mesh of a name.
    ///
    /// # Errors
    /// `InvalidScene` that lists the names if there is none.
    pub fn find(&self, name: &Spanned<String>) -> Result<&'m MeshSelection> {
        let found = self.names.get(&name.value).map(|found| found.as_ref().map_err(Clone::clone));
        found.unwrap_or_else(|| {
            let mut names: Vec<&str> = self.names.keys().map(String::as_str).collect();
            sort(&mut names);
            let message = format!("no mesh is named `{}`", name.value);
            let otherwise = "a mesh is a geometry with a `file`, or a mesh of a `[[model]]`";
            Err(unknown_name(name, message, otherwise, || names.iter().copied()))
        })
    }
}

impl MeshPiece {
    /// Reads the keys of a piece from meshes; `None` where it has none of them.
    pub fn parse(table: &Table<'_>) -> Option<Self> {
        let mesh = table.optional::<Spanned<String>>("mesh");
        let attributes = table.optional::<OneOrMore<Spanned<String>>>("attribute");
        let name = table.optional::<TableName>("table");
        let material = table.optional::<OneOrMore<Column<MaterialColumn>>>("material");
        if !["mesh", "attribute", "table", "material"].iter().any(|key| table.has(key)) {
            return None;
        }
        let stride = table.optional::<u32>("stride");
        let wrong = |message: &str| {
            table.report().push(table.span().error(message));
            None
        };
        let content = match (attributes, name, material) {
            (Some(attributes), None, None) => vertices(table, attributes.0)?,
            (None, Some(TableName::Instances), None) => MeshContent::Instances {
                columns: columns(table, &of_rows(InstanceColumn::DEFAULT)),
                tlas: table.or("tlas", "main".to_string()),
            },
            (None, Some(TableName::Geometries), None) => {
                MeshContent::Geometries(columns(table, &of_rows(GeometryColumn::DEFAULT)))
            }
            (None, Some(TableName::Materials), None) => {
                MeshContent::Materials(columns(table, MaterialColumn::DEFAULT))
            }
            (None, None, Some(columns)) => MeshContent::OwnMaterials(columns.0),
            // A mistake in one of them is reported already.
            (None, None, None) if ["attribute", "table", "material"].iter().any(|key| table.has(key)) => {
                return None;
            }
            _ => {
                return wrong("a piece with `mesh` needs one of `attribute`, `table` and `material`");
            }
        };
        if mesh.is_none() && !matches!(content, MeshContent::Instances { .. }) {
            return wrong("`mesh` is missing: the name of a geometry or model, or of a mesh of one");
        }
        let piece = Self { mesh, content, stride };
        let row = piece.row();
        if stride.is_some_and(|stride| u64::from(stride) < row) {
            return wrong(&format!("the `stride` is less than the {row} bytes of a row"));
        }
        Some(piece)
    }

    /// The bytes of a row without those that fill it up to the stride.
    fn row(&self) -> u64 {
        match &self.content {
            MeshContent::Vertices { formats, .. } => formats.iter().map(|format| format.size()).sum(),
            MeshContent::Indices { is_short } => {
                if *is_short {
                    2
                } else {
                    4
                }
            }
            MeshContent::Instances { columns, .. } => size(columns),
            MeshContent::Geometries(columns) => size(columns),
            MeshContent::Materials(columns) | MeshContent::OwnMaterials(columns) => size(columns),
        }
    }

    fn selection<'m>(&self, meshes: &SceneMeshes<'m>) -> Result<Option<&'m MeshSelection>> {
        match &self.mesh {
            None => Ok(None),
            Some(name) => meshes.find(name).map(Some),
        }
    }

    /// How many bytes it has.
    ///
    /// # Errors
    /// `InvalidScene` where no mesh has its name.
    pub fn size(&self, meshes: &SceneMeshes<'_>) -> Result<u64> {
        let selection = self.selection(meshes)?;
        let sum = |of: fn(&Part) -> usize| match selection {
            None => 0,
            Some(MeshSelection { model, parts, .. }) => {
                parts.iter().map(|part| of(&model.parts[*part]) as u64).sum()
            }
        };
        let rows = match &self.content {
            MeshContent::Vertices { .. } => sum(|part| part.vertices),
            MeshContent::Indices { .. } => 3 * sum(|part| part.triangles),
            MeshContent::Instances { tlas, .. } => instances(meshes, selection, tlas).count() as u64,
            MeshContent::Geometries(_) | MeshContent::OwnMaterials(_) => sum(|_| 1),
            MeshContent::Materials(_) => {
                selection.map_or(0, |selection| selection.model.materials.len() as u64)
            }
        };
        let row = self.stride.map_or(self.row(), u64::from);
        Ok(rows.saturating_mul(row))
    }

    /// Appends its bytes, and gives the places of the addresses among them, ascending.
    ///
    /// # Errors
    /// `InvalidScene` where no mesh has its name or the mesh lacks an attribute;
    /// `InvalidMesh` for a broken file.
    pub fn encode(
        &self,
        span: &Span,
        meshes: &SceneMeshes<'_>,
        bytes: &mut Vec<u8>,
    ) -> Result<Vec<(usize, AddressOf)>> {
        let stride = self.stride.map(|stride| stride as usize);
        let mut rows = Rows { bytes, addresses: Vec::new(), row: self.row() as usize, stride };
        let selection = self.selection(meshes)?;
        if let MeshContent::Instances { columns, tlas } = &self.content {
            let places = places(meshes);
            check_rows(columns, instances(meshes, selection, tlas).count())?;
            for (row, entry) in instances(meshes, selection, tlas).enumerate() {
                rows.push_columns(span, columns, row, |column, bytes| {
                    instance(entry, column, &places, bytes);
                })?;
            }
            return Ok(rows.addresses);
        }
        let Some(MeshSelection { model, parts, merged, .. }) = selection else { return Ok(Vec::new()) };
        let named = |error: Error| match &self.mesh {
            Some(name) => error.at_with(name.span.place(), "named here"),
            None => error,
        };
        match &self.content {
            MeshContent::Vertices { attributes, formats, missing, texture_transform } => {
                for part in parts {
                    let missing = missing.as_deref();
                    vertex_rows(model, *part, attributes, formats, missing, *texture_transform, &mut rows)
                        .map_err(named)?;
                }
            }
            MeshContent::Indices { is_short } => {
                let mut base = 0;
                for part in parts {
                    let indices = model.triangles(*part).map_err(named)?.indices;
                    for index in indices {
                        let index = index + base;
                        match (is_short, u16::try_from(index)) {
                            (false, _) => rows.push(|bytes| bytes.extend(index.to_le_bytes())),
                            (true, Ok(short)) => rows.push(|bytes| bytes.extend(short.to_le_bytes())),
                            (true, Err(_)) => {
                                return Err(span.error(format!("index {index} does not fit into `u16`")));
                            }
                        }
                    }
                    if *merged {
                        base += model.parts[*part].vertices as u32;
                    }
                }
            }
            MeshContent::Geometries(columns) => {
                check_rows(columns, parts.len())?;
                let mut at = [0; 2];
                for (row, part) in parts.iter().map(|part| &model.parts[*part]).enumerate() {
                    let look = &model.materials[part.material];
                    rows.push_columns(span, columns, row, |column, bytes| {
                        geometry(part, look, column, at, bytes);
                    })?;
                    at = [at[0] + part.vertices, at[1] + part.triangles];
                }
            }
            MeshContent::Materials(columns) => {
                check_rows(columns, model.materials.len())?;
                for (row, one) in model.materials.iter().enumerate() {
                    rows.push_columns(span, columns, row, |column, bytes| material(one, column, bytes))?;
                }
            }
            MeshContent::OwnMaterials(columns) => {
                check_rows(columns, parts.len())?;
                for (row, part) in parts.iter().enumerate() {
                    let one = &model.materials[model.parts[*part].material];
                    rows.push_columns(span, columns, row, |column, bytes| material(one, column, bytes))?;
                }
            }
            MeshContent::Instances { .. } => {}
        }
        Ok(rows.addresses)
    }
}

fn columns<K: ColumnKind>(table: &Table<'_>, default: &[K]) -> Vec<Column<K>> {
    match table.optional::<OneOrMore<Column<K>>>("columns") {
        Some(columns) => columns.0,
        None => default.iter().map(|kind| Column::Own(*kind)).collect(),
    }
}

/// Columns that rows have, not their materials.
fn of_rows<K: Copy>(columns: &[K]) -> Vec<WithMaterial<K>> {
    columns.iter().map(|column| WithMaterial::Row(*column)).collect()
}

/// Checks that a table has as many rows as the scene gives numbers for.
fn check_rows<K>(columns: &[Column<K>], count: usize) -> Result<()> {
    for column in columns {
        if let Column::Given { rows, span } = column
            && rows.len() != count
        {
            let message = format!("the column has {} rows, but the table has {count}", rows.len());
            return Err(span
                .error(message)
                .note("a number without a list applies to every row: `{ u32 = 7 }`"));
        }
    }
    Ok(())
}

/// The bytes of a row.
fn size<K: ColumnKind>(columns: &[Column<K>]) -> u64 {
    columns.iter().map(Column::size).sum()
}

fn vertices(table: &Table<'_>, mut attributes: Vec<Spanned<String>>) -> Option<MeshContent> {
    let formats = table.optional::<Spanned<OneOrMore<AttributeFormat>>>("format");
    if table.has("format") && formats.is_none() {
        return None;
    }
    let missing = table.optional::<Spanned<OneOrMore<f32>>>("missing");
    if let Some(missing) = missing.as_ref().filter(|missing| missing.value.0.len() > 4) {
        table.report().push(missing.span.error("an attribute must have at most four numbers"));
        return None;
    }
    for attribute in &mut attributes {
        if matches!(attribute.value.as_str(), "texcoord" | "color" | "joints" | "weights") {
            attribute.value += "_0";
        }
    }
    if let [only] = &attributes[..]
        && only.value == "index"
    {
        let is_short = match formats.as_ref().map(|formats| (&formats.value.0[..], &formats.span)) {
            None | Some(([AttributeFormat::U32], _)) => false,
            Some(([AttributeFormat::U16], _)) => true,
            Some((_, span)) => {
                table.report().push(span.error("the format of indices must be `u16` or `u32`"));
                return None;
            }
        };
        return Some(MeshContent::Indices { is_short });
    }
    let formats = match formats {
        None => attributes.iter().map(|attribute| AttributeFormat::of(&attribute.value)).collect(),
        Some(Spanned { value: OneOrMore(formats), span }) => {
            if formats.len() != attributes.len() {
                let message = format!("{} formats for {} attributes", formats.len(), attributes.len());
                table.report().push(span.error(message));
                return None;
            }
            formats
        }
    };
    let missing = missing.map(|missing| missing.value.0);
    let texture_transform = table.optional("texture_transform");
    Some(MeshContent::Vertices { attributes, formats, missing, texture_transform })
}

/// Rows of one size.
struct Rows<'b> {
    bytes: &'b mut Vec<u8>,
    /// The addresses among them with their places.
    addresses: Vec<(usize, AddressOf)>,
    row: usize,
    stride: Option<usize>,
}

impl Rows<'_> {
    /// Appends a row of columns, by its number and how one is written.
    ///
    /// # Errors
    /// `InvalidScene` for a number that does not fit into its column.
    fn push_columns<K: ColumnKind>(
        &mut self,
        span: &Span,
        columns: &[Column<K>],
        row: usize,
        write: impl Fn(K, &mut Vec<u8>),
    ) -> Result<()> {
        let mut found = std::mem::take(&mut self.addresses);
        let mut too_large = None;
        self.push(|bytes| {
            // A number that the row has, which is not kept.
            let number = |kind: K, bytes: &mut Vec<u8>| {
                let at = bytes.len();
                write(kind, bytes);
                bytes.split_off(at).try_into().map_or(NOTHING, u32::from_le_bytes)
            };
            for column in columns {
                match column {
                    Column::Own(kind) => write(*kind, bytes),
                    Column::Constant(constant) => bytes.extend(constant),
                    Column::Given { rows, .. } => bytes.extend(&rows[row]),
                    Column::Narrow { kind, width } => {
                        let number = number(*kind, bytes);
                        let fitting = width.encode(number);
                        if fitting.is_none() {
                            too_large = Some(number);
                        }
                        bytes.extend(fitting.unwrap_or_else(|| vec![0; column.size() as usize]));
                    }
                    Column::Address { of, stride, by } => {
                        let at = bytes.len();
                        let number = number(*by, bytes);
                        // What is not there has the null address.
                        if number != NOTHING {
                            let mut of = of.clone();
                            of.offset.value += stride * u64::from(number);
                            found.push((at, of));
                        }
                        bytes.extend([0; 8]);
                    }
                }
            }
        });
        self.addresses = found;
        match too_large {
            None => Ok(()),
            Some(number) => {
                Err(span.error(format!("the number {number} in row {row} is too large for its column")))
            }
        }
    }

    fn push(&mut self, write: impl FnOnce(&mut Vec<u8>)) {
        write(self.bytes);
        if let Some(stride) = self.stride {
            let end = self.bytes.len() + stride - self.row;
            self.bytes.resize(end, 0);
        }
    }
}

fn vertex_rows(
    model: &Model,
    part: usize,
    attributes: &[Spanned<String>],
    formats: &[AttributeFormat],
    missing: Option<&[f32]>,
    texture_transform: Option<TextureSlot>,
    rows: &mut Rows<'_>,
) -> Result<()> {
    let known = &model.parts[part];
    let mapping = texture_transform.map(|slot| model.materials[known.material].mappings[slot as usize]);
    let mut numbers = Vec::new();
    for attribute in attributes {
        numbers.push(match (known.attributes.contains(&attribute.value), missing) {
            (true, _) => {
                let mut numbers = model.attribute(part, &attribute.value)?;
                if let Some(mapping) = mapping.filter(|_| attribute.value.starts_with("texcoord_")) {
                    let (pairs, _) = numbers.values.as_chunks_mut::<2>();
                    pairs.iter_mut().for_each(|pair| *pair = mapping.apply(*pair));
                }
                Some(numbers)
            }
            (false, Some(_)) => None,
            (false, None) => {
                let message = format!("`{}` has no attribute `{}`", known.name, attribute.value);
                let names = known.attributes.iter().map(String::as_str).chain(["index"]);
                let error = attribute.span.error(message).note(format!("it has: {}", list_of(names)));
                return Err(error.note("set a default for missing attributes with `missing = [0, 0, 1]`"));
            }
        });
    }
    for vertex in 0..known.vertices {
        rows.push(|bytes| {
            for (numbers, format) in numbers.iter().zip(formats) {
                match numbers {
                    Some(numbers) => {
                        let first = vertex * numbers.components;
                        format.encode(&numbers.values[first..first + numbers.components], bytes);
                    }
                    None => format.encode(missing.unwrap_or_default(), bytes),
                }
            }
        });
    }
    Ok(())
}

/// The instances of an acceleration structure that have one of the geometries of a selection.
fn instances<'m>(
    meshes: &SceneMeshes<'m>,
    selection: Option<&'m MeshSelection>,
    tlas: &'m str,
) -> impl Iterator<Item = &'m InstanceEntry> {
    let of_selection = move |entry: &&InstanceEntry| match selection {
        None => true,
        Some(selection) => entry.geometry.iter().any(|name| selection.geometries.contains(&name.value)),
    };
    meshes.instances.iter().filter(move |entry| entry.tlas() == tlas).filter(of_selection)
}
