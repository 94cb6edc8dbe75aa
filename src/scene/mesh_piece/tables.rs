//! The columns of tables of instances, geometries and materials, and the addresses among them.

use std::collections::HashMap;

use crate::scene::address_entry::AddressOf;
use crate::scene::instance_entry::InstanceEntry;
use crate::scene::mesh::material::{Material, TextureSlot};
use crate::scene::mesh::model::Part;
use crate::scene::mesh_piece::SceneMeshes;
use crate::scene::read::{Named, Parse, Spanned, Table, TomlValue};
use crate::scene::transform_entry::matrix_of;
use crate::scene::tree::Toml;

/// What the kinds of columns have in common.
pub(super) trait ColumnKind: Named + PartialEq {
    /// Its bytes.
    fn size(self) -> u64;
    /// The columns that count something, from 0.
    const NUMBERS: &'static [Self];
}

/// A column of a table.
#[derive(Clone, Debug)]
pub(super) enum Column<K> {
    /// What the row itself has.
    Own(K),
    /// The address of the element of a buffer that the row's number `by` counts to.
    Address { of: AddressOf, stride: u64, by: K },
}

impl<K: ColumnKind> Column<K> {
    pub(super) fn size(&self) -> u64 {
        match self {
            Self::Own(kind) => kind.size(),
            Self::Address { .. } => 8,
        }
    }
}

impl<K: ColumnKind> Parse for Column<K> {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if !matches!(value.toml(), Toml::Table(_)) {
            return K::parse(value).map(Self::Own);
        }
        let table = Table::new(value)?;
        let target = table.required::<Spanned<String>>("address_of");
        let by = table.required::<Spanned<K>>("by");
        let stride = table.required::<Spanned<u64>>("stride");
        let offset = table.optional::<Spanned<u64>>("offset");
        table.finish();
        let (target, by, stride) = (target?, by?, stride?);
        if !K::NUMBERS.contains(&by.value) {
            let names = K::NAMES.iter().filter(|(_, kind)| K::NUMBERS.contains(kind));
            let names: Vec<_> = names.map(|(name, _)| *name).collect();
            let error = by.span.error("`by` is a column that counts elements, from 0");
            value.report().push(error.note(format!("one of: {}", names.join(", "))));
            return None;
        }
        let offset = offset.unwrap_or(Spanned { value: 0, span: target.span.clone() });
        let fits = stride.value.checked_mul(u32::MAX.into()).and_then(|end| end.checked_add(offset.value));
        if fits.is_none() {
            value.report().push(stride.span.error("a stride so large that addresses overflow"));
            return None;
        }
        Some(Self::Address { of: AddressOf { target, offset }, stride: stride.value, by: by.value })
    }
}

/// Writes the enum of a table's columns from a row each, name and bytes, and from a list of those
/// that count.
macro_rules! columns {
    ($name:ident $what:literal counts [$($number:ident)*] $($variant:ident $text:literal $size:literal;)*) => {
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
        }
    };
}

columns! {
    InstanceColumn "column of the table of instances"
    counts [Mesh Geometry Material CustomIndex SbtOffset]
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

/// What stands in a table for something that is not there.
pub(super) const NOTHING: u32 = u32::MAX;

/// The place of a geometry in its file.
#[derive(Clone, Copy)]
pub(super) struct PlaceInFile {
    mesh: u32,
    part: u32,
    material: u32,
}

/// The place of each geometry that is one part of a file.
pub(super) fn places<'m>(meshes: &SceneMeshes<'m>) -> HashMap<&'m str, PlaceInFile> {
    let mut places = HashMap::new();
    for selection in meshes.names.values().flatten() {
        let [part] = selection.parts[..] else { continue };
        let found = &selection.model.parts[part];
        let place =
            PlaceInFile { mesh: found.mesh as u32, part: part as u32, material: found.material as u32 };
        places.extend(selection.geometries.iter().map(|name| (name.as_str(), place)));
    }
    places
}

/// Appends what an instance has in a column.
pub(super) fn instance(
    entry: &InstanceEntry,
    column: InstanceColumn,
    places: &HashMap<&str, PlaceInFile>,
    bytes: &mut Vec<u8>,
) {
    let place = entry.geometry.first().and_then(|name| places.get(name.value.as_str()));
    let word = |of: fn(&PlaceInFile) -> u32| place.map_or(NOTHING, of).to_le_bytes();
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

/// Appends what a geometry has in a column, behind so many vertices and triangles of others.
pub(super) fn geometry(part: &Part, column: GeometryColumn, before: [usize; 2], bytes: &mut Vec<u8>) {
    let [vertices, triangles] = before;
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
