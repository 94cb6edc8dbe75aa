//! The columns of tables of instances, geometries and materials, and the addresses among them.

use std::collections::HashMap;

use crate::address_entry::AddressOf;
use crate::instance_entry::InstanceEntry;
use crate::mesh::material::{Material, TextureSlot};
use crate::mesh::model::Part;
use crate::mesh_piece::SceneMeshes;
use crate::read::{Named, Parse, Span, Spanned, Table, TomlValue};
use crate::scalar::{Rows, Scalar};
use crate::transform_entry::matrix_of;
use crate::tree::Toml;

/// What the kinds of columns have in common.
pub(super) trait ColumnKind: Named + PartialEq {
    /// Its bytes.
    fn size(self) -> u64;
    /// The columns that count something, from 0.
    const NUMBERS: &'static [Self];
    /// True of one whole number.
    fn is_integer(self) -> bool;
}

/// A column of a table.
#[derive(Clone, Debug)]
pub(super) enum Column<K> {
    /// What the row itself has.
    Own(K),
    /// A whole number that the row itself has, as another type.
    Narrow { kind: K, width: IntegerWidth },
    /// The address of the element of a buffer that the row's number `by` counts to.
    Address { of: AddressOf, stride: u64, by: K },
    /// Bytes of the scene's own, the same in every row.
    Constant(Vec<u8>),
    /// Bytes of the scene's own for each row.
    Given { rows: Vec<Vec<u8>>, span: Span },
}

/// The type of a column of whole numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum IntegerWidth {
    U8,
    U16,
    U32,
    U64,
}

impl Named for IntegerWidth {
    const WHAT: &'static str = "type of a column";
    const NAMES: &'static [(&'static str, Self)] =
        &[("u8", Self::U8), ("u16", Self::U16), ("u32", Self::U32), ("u64", Self::U64)];
}

impl IntegerWidth {
    fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 => 4,
            Self::U64 => 8,
        }
    }

    /// The bytes of a number, all ones for what is not there; `None` where it does not fit, as what
    /// would be all ones does not.
    pub(super) fn encode(self, number: u32) -> Option<Vec<u8>> {
        let wide = if number == NOTHING { u64::MAX } else { u64::from(number) };
        let most = u64::MAX >> (64 - 8 * self.bytes());
        (number == NOTHING || wide < most).then(|| wide.to_le_bytes()[..self.bytes()].to_vec())
    }
}

impl<K: ColumnKind> Column<K> {
    pub(super) fn size(&self) -> u64 {
        match self {
            Self::Own(kind) => kind.size(),
            Self::Narrow { width, .. } => width.bytes() as u64,
            Self::Address { .. } => 8,
            Self::Constant(bytes) => bytes.len() as u64,
            Self::Given { rows, .. } => rows.first().map_or(0, Vec::len) as u64,
        }
    }
}

impl<K: ColumnKind> Parse for Column<K> {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if !matches!(value.toml(), Toml::Table(_)) {
            return K::parse(value).map(Self::Own);
        }
        let table = Table::new(value)?;
        let mut given: Vec<Rows> = Scalar::ALL.iter().filter_map(|scalar| scalar.rows(&table)).collect();
        given.extend(table.optional::<RowOfEvery>("every").map(|every| Rows::Every(every.0)));
        given.extend(table.optional::<u16>("zeros").map(|count| Rows::Every(vec![0; count.into()])));
        let is_own = ["every", "zeros"].into_iter().chain(Scalar::ALL.map(Scalar::name));
        if is_own.into_iter().any(|key| table.has(key)) {
            table.finish();
            return match <[Rows; 1]>::try_from(given) {
                Ok([Rows::Every(bytes)]) => Some(Self::Constant(bytes)),
                Ok([Rows::Each(rows)]) => Some(Self::Given { rows, span: value.span() }),
                // A mistake in it is reported already.
                Err(none) if none.is_empty() => None,
                Err(_) => value.wrong("a column must have numbers of one type"),
            };
        }
        if table.has("column") {
            let (kind, width) = (table.required::<Spanned<K>>("column"), table.required("type"));
            table.finish();
            let (Spanned { value: kind, span }, width) = (kind?, width?);
            if !kind.is_integer() {
                value.report().push(span.error("`type` applies only to columns of integers"));
                return None;
            }
            return Some(Self::Narrow { kind, width });
        }
        let target = table.required::<Spanned<String>>("address_of");
        let by = table.required::<Spanned<K>>("by");
        let stride = table.required::<Spanned<u64>>("stride");
        let offset = table.optional::<Spanned<u64>>("offset");
        table.finish();
        let (target, by, stride) = (target?, by?, stride?);
        if !K::NUMBERS.contains(&by.value) {
            let names = K::NAMES.iter().filter(|(_, kind)| K::NUMBERS.contains(kind));
            let names: Vec<_> = names.map(|(name, _)| *name).collect();
            let error = by.span.error("`by` must name a column of indices");
            value.report().push(error.note(format!("one of: {}", names.join(", "))));
            return None;
        }
        let offset = offset.unwrap_or(Spanned { value: 0, span: target.span.clone() });
        let fits = stride.value.checked_mul(u32::MAX.into()).and_then(|end| end.checked_add(offset.value));
        if fits.is_none() {
            value.report().push(stride.span.error("the stride is so large that addresses overflow"));
            return None;
        }
        Some(Self::Address { of: AddressOf { target, offset }, stride: stride.value, by: by.value })
    }
}

/// The bytes of one row of the scene's own, in a table: `{ f32 = [0, 0, 1] }`.
struct RowOfEvery(Vec<u8>);

impl Parse for RowOfEvery {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let given: Vec<Vec<u8>> = Scalar::ALL.iter().filter_map(|scalar| scalar.column(&table)).collect();
        let has_one = Scalar::ALL.iter().any(|scalar| table.has(scalar.name()));
        table.finish();
        match <[Vec<u8>; 1]>::try_from(given) {
            Ok([bytes]) => Some(Self(bytes)),
            Err(none) if none.is_empty() && has_one => None,
            Err(_) => value.wrong("one list of numbers with their type, such as `{ f32 = [0, 0, 1] }`"),
        }
    }
}

/// Writes the enum of a table's columns from a row each, name and bytes, and from a list of those
/// that count.
macro_rules! columns {
    ($name:ident $what:literal counts [$($number:ident)*] floats [$($float:ident)*] $($variant:ident $text:literal $size:literal;)*) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum $name {
            $($variant,)*
        }

        impl Named for $name {
            const WHAT: &'static str = $what;
            const NAMES: &'static [(&'static str, Self)] = &[$(($text, Self::$variant)),*];
        }

        impl ColumnKind for $name {
            const NUMBERS: &'static [Self] = &[$(Self::$number),*];

            fn size(self) -> u64 {
                match self {
                    $(Self::$variant => $size,)*
                }
            }

            fn is_integer(self) -> bool {
                const FLOATS: &[$name] = &[$($name::$float),*];
                self.size() == 4 && !FLOATS.contains(&self)
            }
        }
    };
}

columns! {
    InstanceColumn "column of the table of instances"
    counts [Mesh Geometry Material CustomIndex SbtOffset]
    floats []
    ObjectToWorld "object_to_world" 64;
    WorldToObject "world_to_object" 64;
    ObjectToWorldRows "object_to_world_3x4" 48;
    WorldToObjectRows "world_to_object_3x4" 48;
    Mesh "mesh" 4;
    Geometry "geometry" 4;
    GeometryCount "geometry_count" 4;
    Material "material" 4;
    CustomIndex "custom_index" 4;
    Mask "mask" 4;
    SbtOffset "sbt_offset" 4;
    Padding "padding" 4;
}

impl InstanceColumn {
    pub(super) const DEFAULT: &'static [Self] = &[
        Self::ObjectToWorld,
        Self::WorldToObject,
        Self::Mesh,
        Self::Geometry,
        Self::GeometryCount,
        Self::Material,
    ];
}

columns! {
    GeometryColumn "column of the table of geometries"
    counts [FirstVertex FirstIndex FirstTriangle Mesh Material]
    floats []
    FirstVertex "first_vertex" 4;
    VertexCount "vertex_count" 4;
    FirstIndex "first_index" 4;
    IndexCount "index_count" 4;
    FirstTriangle "first_triangle" 4;
    TriangleCount "triangle_count" 4;
    Mesh "mesh" 4;
    Material "material" 4;
    Padding "padding" 4;
}

impl GeometryColumn {
    pub(super) const DEFAULT: &'static [Self] = &[
        Self::FirstVertex,
        Self::VertexCount,
        Self::FirstIndex,
        Self::IndexCount,
        Self::Mesh,
        Self::Material,
    ];
}

columns! {
    MaterialColumn "column of the table of materials"
    counts [
        BaseColorTexture MetallicRoughnessTexture NormalTexture
        OcclusionTexture EmissiveTexture SpecularTexture AlphaTexture
    ]
    floats [
        EmissiveStrength Metallic Roughness AlphaCutoff NormalScale OcclusionStrength Ior Transmission Shininess
        Dissolve
    ]
    BaseColor "base_color" 16;
    Emissive "emissive" 12;
    EmissiveStrength "emissive_strength" 4;
    Metallic "metallic" 4;
    Roughness "roughness" 4;
    AlphaCutoff "alpha_cutoff" 4;
    AlphaMode "alpha_mode" 4;
    NormalScale "normal_scale" 4;
    OcclusionStrength "occlusion_strength" 4;
    DoubleSided "double_sided" 4;
    Ior "ior" 4;
    Transmission "transmission" 4;
    Ambient "ambient" 12;
    Diffuse "diffuse" 12;
    Specular "specular" 12;
    Shininess "shininess" 4;
    Dissolve "dissolve" 4;
    Illumination "illumination" 4;
    BaseColorTexture "base_color_texture" 4;
    MetallicRoughnessTexture "metallic_roughness_texture" 4;
    NormalTexture "normal_texture" 4;
    OcclusionTexture "occlusion_texture" 4;
    EmissiveTexture "emissive_texture" 4;
    SpecularTexture "specular_texture" 4;
    AlphaTexture "alpha_texture" 4;
    BaseColorTransform "base_color_transform" 24;
    MetallicRoughnessTransform "metallic_roughness_transform" 24;
    NormalTransform "normal_transform" 24;
    OcclusionTransform "occlusion_transform" 24;
    EmissiveTransform "emissive_transform" 24;
    BaseColorTexcoord "base_color_texcoord" 4;
    MetallicRoughnessTexcoord "metallic_roughness_texcoord" 4;
    NormalTexcoord "normal_texcoord" 4;
    OcclusionTexcoord "occlusion_texcoord" 4;
    EmissiveTexcoord "emissive_texcoord" 4;
    Padding "padding" 4;
}

impl MaterialColumn {
    pub(super) const DEFAULT: &'static [Self] = &[
        Self::BaseColor,
        Self::Emissive,
        Self::EmissiveStrength,
        Self::Metallic,
        Self::Roughness,
        Self::AlphaCutoff,
        Self::AlphaMode,
        Self::BaseColorTexture,
        Self::MetallicRoughnessTexture,
        Self::NormalTexture,
        Self::EmissiveTexture,
    ];
}

/// A column of a row that has a material: its own, or one of the material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WithMaterial<K> {
    /// Of the row itself.
    Row(K),
    /// Of the row's material.
    Material(MaterialColumn),
}

/// The names and numbers of a kind of column and of those of materials.
macro_rules! with_material {
    ($($kind:ident)*) => {
        $(impl Named for WithMaterial<$kind> {
            const WHAT: &'static str = $kind::WHAT;
            const NAMES: &'static [(&'static str, Self)] = &{
                // Both end with the padding.
                const COUNT: usize = $kind::NAMES.len() + MaterialColumn::NAMES.len() - 1;
                let mut all = [("padding", Self::Row($kind::Padding)); COUNT];
                let mut at = 0;
                while at < $kind::NAMES.len() - 1 {
                    all[at] = ($kind::NAMES[at].0, Self::Row($kind::NAMES[at].1));
                    at += 1;
                }
                while at < COUNT - 1 {
                    let (name, column) = MaterialColumn::NAMES[at + 1 - $kind::NAMES.len()];
                    all[at] = (name, Self::Material(column));
                    at += 1;
                }
                all
            };
        }

        impl ColumnKind for WithMaterial<$kind> {
            const NUMBERS: &'static [Self] = &{
                const COUNT: usize = $kind::NUMBERS.len() + MaterialColumn::NUMBERS.len();
                let mut all = [Self::Row($kind::Padding); COUNT];
                let mut at = 0;
                while at < COUNT {
                    all[at] = match at < $kind::NUMBERS.len() {
                        true => Self::Row($kind::NUMBERS[at]),
                        false => Self::Material(MaterialColumn::NUMBERS[at - $kind::NUMBERS.len()]),
                    };
                    at += 1;
                }
                all
            };

            fn size(self) -> u64 {
                match self {
                    Self::Row(kind) => kind.size(),
                    Self::Material(column) => column.size(),
                }
            }

            fn is_integer(self) -> bool {
                match self {
                    Self::Row(kind) => kind.is_integer(),
                    Self::Material(column) => column.is_integer(),
                }
            }
        })*
    };
}

with_material! { InstanceColumn GeometryColumn }

/// What stands in a table for something that is not there.
pub(super) const NOTHING: u32 = u32::MAX;

/// The place of a geometry in its file, and its material.
#[derive(Clone, Copy)]
pub(super) struct PlaceInFile<'m> {
    mesh: u32,
    part: u32,
    material: u32,
    look: &'m Material,
}

/// The place of each geometry that is one part of a file.
pub(super) fn places<'m>(meshes: &SceneMeshes<'m>) -> HashMap<&'m str, PlaceInFile<'m>> {
    let mut places = HashMap::new();
    for selection in meshes.names.values().flatten() {
        let [part] = selection.parts[..] else { continue };
        let found = &selection.model.parts[part];
        let place = PlaceInFile {
            mesh: found.mesh as u32,
            part: part as u32,
            material: found.material as u32,
            look: &selection.model.materials[found.material],
        };
        places.extend(selection.geometries.iter().map(|name| (name.as_str(), place)));
    }
    places
}

/// Appends what an instance has in a column.
pub(super) fn instance(
    entry: &InstanceEntry,
    column: WithMaterial<InstanceColumn>,
    places: &HashMap<&str, PlaceInFile<'_>>,
    bytes: &mut Vec<u8>,
) {
    let place = entry.geometry.first().and_then(|name| places.get(name.value.as_str()));
    let word = |of: fn(&PlaceInFile<'_>) -> u32| place.map_or(NOTHING, of).to_le_bytes();
    let column = match (column, place) {
        (WithMaterial::Row(column), _) => column,
        (WithMaterial::Material(column), Some(place)) => return material(place.look, column, bytes),
        (WithMaterial::Material(column), None) => return material(&Material::default(), column, bytes),
    };
    match column {
        InstanceColumn::ObjectToWorld => square(&entry.transform, bytes),
        InstanceColumn::WorldToObject => square(&inverse(&entry.transform), bytes),
        InstanceColumn::ObjectToWorldRows => rows_of(&entry.transform, bytes),
        InstanceColumn::WorldToObjectRows => rows_of(&inverse(&entry.transform), bytes),
        InstanceColumn::Mesh => bytes.extend(word(|place| place.mesh)),
        InstanceColumn::Geometry => bytes.extend(word(|place| place.part)),
        InstanceColumn::Material => bytes.extend(word(|place| place.material)),
        InstanceColumn::GeometryCount => bytes.extend((entry.geometry.len() as u32).to_le_bytes()),
        InstanceColumn::CustomIndex => bytes.extend(entry.custom_index.to_le_bytes()),
        InstanceColumn::Mask => bytes.extend(u32::from(entry.mask).to_le_bytes()),
        InstanceColumn::SbtOffset => bytes.extend(entry.sbt_offset.to_le_bytes()),
        InstanceColumn::Padding => bytes.extend([0; 4]),
    }
}

/// A matrix of four columns of four.
fn square(rows: &[[f32; 4]; 3], bytes: &mut Vec<u8>) {
    for column in 0..4 {
        rows.iter().for_each(|row| bytes.extend(row[column].to_le_bytes()));
        bytes.extend((if column == 3 { 1.0_f32 } else { 0.0 }).to_le_bytes());
    }
}

fn rows_of(rows: &[[f32; 4]; 3], bytes: &mut Vec<u8>) {
    rows.as_flattened().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
}

/// The inverse, computed in f64 and rounded once.
fn inverse(rows: &[[f32; 4]; 3]) -> [[f32; 4]; 3] {
    let back = matrix_of(rows).inverse().transpose();
    [back.x_axis, back.y_axis, back.z_axis].map(|row| row.as_vec4().to_array())
}

/// Appends what a geometry with its material has in a column, behind so many vertices and triangles
/// of others.
pub(super) fn geometry(
    part: &Part,
    look: &Material,
    column: WithMaterial<GeometryColumn>,
    before: [usize; 2],
    bytes: &mut Vec<u8>,
) {
    let [vertices, triangles] = before;
    let column = match column {
        WithMaterial::Row(column) => column,
        WithMaterial::Material(column) => return material(look, column, bytes),
    };
    let word = match column {
        GeometryColumn::FirstVertex => vertices,
        GeometryColumn::VertexCount => part.vertices,
        GeometryColumn::FirstIndex => 3 * triangles,
        GeometryColumn::IndexCount => 3 * part.triangles,
        GeometryColumn::FirstTriangle => triangles,
        GeometryColumn::TriangleCount => part.triangles,
        GeometryColumn::Mesh => part.mesh,
        GeometryColumn::Material => part.material,
        GeometryColumn::Padding => 0,
    };
    bytes.extend((word as u32).to_le_bytes());
}

/// Appends what a material has in a column.
pub(super) fn material(one: &Material, column: MaterialColumn, bytes: &mut Vec<u8>) {
    use MaterialColumn as C;
    let texture = |slot: TextureSlot| {
        let index = one.textures[slot as usize];
        index.map_or(NOTHING, |index| index as u32)
    };
    let transform = |slot: TextureSlot| one.mappings[slot as usize].transform.as_flattened();
    let texcoord = |slot: TextureSlot| one.mappings[slot as usize].texcoord;
    let floats: &[f32] = match column {
        C::BaseColor => &one.base_color,
        C::Emissive => &one.emissive,
        C::EmissiveStrength => &[one.emissive_strength],
        C::Metallic => &[one.metallic],
        C::Roughness => &[one.roughness],
        C::AlphaCutoff => &[one.alpha_cutoff],
        C::NormalScale => &[one.normal_scale],
        C::OcclusionStrength => &[one.occlusion_strength],
        C::Ior => &[one.ior],
        C::Transmission => &[one.transmission],
        C::Ambient => &one.ambient,
        C::Diffuse => &one.base_color[..3],
        C::Specular => &one.specular,
        C::Shininess => &[one.shininess],
        C::Dissolve => &one.base_color[3..],
        C::BaseColorTransform => transform(TextureSlot::BaseColor),
        C::MetallicRoughnessTransform => transform(TextureSlot::MetallicRoughness),
        C::NormalTransform => transform(TextureSlot::Normal),
        C::OcclusionTransform => transform(TextureSlot::Occlusion),
        C::EmissiveTransform => transform(TextureSlot::Emissive),
        _ => &[],
    };
    floats.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    let word = match column {
        C::AlphaMode => one.alpha_mode,
        C::DoubleSided => one.double_sided.into(),
        C::Illumination => one.illumination,
        C::BaseColorTexture => texture(TextureSlot::BaseColor),
        C::MetallicRoughnessTexture => texture(TextureSlot::MetallicRoughness),
        C::NormalTexture => texture(TextureSlot::Normal),
        C::OcclusionTexture => texture(TextureSlot::Occlusion),
        C::EmissiveTexture => texture(TextureSlot::Emissive),
        C::SpecularTexture => texture(TextureSlot::Specular),
        C::AlphaTexture => texture(TextureSlot::Alpha),
        C::BaseColorTexcoord => texcoord(TextureSlot::BaseColor),
        C::MetallicRoughnessTexcoord => texcoord(TextureSlot::MetallicRoughness),
        C::NormalTexcoord => texcoord(TextureSlot::Normal),
        C::OcclusionTexcoord => texcoord(TextureSlot::Occlusion),
        C::EmissiveTexcoord => texcoord(TextureSlot::Emissive),
        C::Padding => 0,
        _ => return,
    };
    bytes.extend(word.to_le_bytes());
}
