//! Geometry given as the buffers of a build: `vertex_data`, `vertex_format`, ... of
//! `[geometry.NAME]`.

use std::sync::Arc;

use crate::data::DataPieces;
use crate::data_sources::DataSources;
use crate::files::Files;
use crate::open_models::OpenModels;
use crate::read::{Named, Span, Spanned, Table};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::InputLimit;
use anyhit_engine::accel::build_input::{
    BuildInput, BuildRange, DecodedSize, IndexType, RadiusFormat, Strided, VertexFormat, aabbs, aabbs_size,
};
use anyhit_engine::accel::{EndCaps, GeometryData, Indexing};

/// The buffers of one geometry, as a scene writes them.
#[derive(Clone, Debug)]
pub(super) struct BuildEntry {
    span: Span,
    vertices: Buffer,
    /// The vertices at time 1, with the same stride and format.
    vertices_t1: Option<DataPieces>,
    indices: Option<(Buffer, IndexType)>,
    radii: Option<(Buffer, RadiusFormat)>,
    format: VertexFormat,
    range: BuildRange,
    kind: Kind,
}

#[derive(Clone, Debug)]
struct Buffer {
    data: DataPieces,
    stride: Option<u64>,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Triangles(Option<[[f32; 4]; 3]>),
    Aabbs,
    Spheres,
    LinearSweptSpheres(Indexing, EndCaps),
}

impl Named for VertexFormat {
    const WHAT: &'static str = "vertex format";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("r32g32_sfloat", Self::R32G32Sfloat),
        ("r32g32b32_sfloat", Self::R32G32B32Sfloat),
        ("r16g16_sfloat", Self::R16G16Sfloat),
        ("r16g16b16_sfloat", Self::R16G16B16Sfloat),
        ("r16g16b16a16_sfloat", Self::R16G16B16A16Sfloat),
        ("r16g16_snorm", Self::R16G16Snorm),
        ("r16g16b16_snorm", Self::R16G16B16Snorm),
        ("r16g16b16a16_snorm", Self::R16G16B16A16Snorm),
    ];
}

impl Named for RadiusFormat {
    const WHAT: &'static str = "radius format";
    const NAMES: &'static [(&'static str, Self)] =
        &[("r32_sfloat", Self::R32Sfloat), ("r16_sfloat", Self::R16Sfloat)];
}

impl Named for IndexType {
    const WHAT: &'static str = "index type";
    const NAMES: &'static [(&'static str, Self)] =
        &[("uint8", Self::Uint8), ("uint16", Self::Uint16), ("uint32", Self::Uint32)];
}

impl BuildEntry {
    pub(super) fn triangles(table: &Table<'_>, transform: Option<[[f32; 4]; 3]>) -> Option<Self> {
        Self::parse(table, Kind::Triangles(transform))
    }

    pub(super) fn aabbs(table: &Table<'_>) -> Option<Self> {
        let (data, stride) = (table.required("aabb_data"), table.optional("aabb_stride"));
        let range = range(table);
        Some(Self {
            span: table.span(),
            vertices: Buffer { data: data?, stride },
            vertices_t1: None,
            indices: None,
            radii: None,
            format: VertexFormat::R32G32B32Sfloat,
            range,
            kind: Kind::Aabbs,
        })
    }

    pub(super) fn spheres(table: &Table<'_>) -> Option<Self> {
        Self::parse(table, Kind::Spheres)
    }

    pub(super) fn linear_swept_spheres(table: &Table<'_>, mode: Indexing, caps: EndCaps) -> Option<Self> {
        Self::parse(table, Kind::LinearSweptSpheres(mode, caps))
    }

    fn parse(table: &Table<'_>, kind: Kind) -> Option<Self> {
        let vertices = table.required("vertex_data");
        let later = |table: &Table<'_>| table.optional("vertex_data_t1");
        let vertices_t1 = if matches!(kind, Kind::Triangles(_)) { later(table) } else { None };
        let stride = table.optional("vertex_stride");
        let format = table.or("vertex_format", VertexFormat::R32G32B32Sfloat);
        let index_data = table.optional::<DataPieces>("index_data");
        let index_stride = table.optional("index_stride");
        let index_type = table.or("index_type", IndexType::Uint32);
        let radii = match kind {
            Kind::Spheres | Kind::LinearSweptSpheres(..) => {
                let data = table.required("radius_data");
                let stride = table.optional("radius_stride");
                let format = table.or("radius_format", RadiusFormat::R32Sfloat);
                // A missing key is reported by `finish`, after all other keys are read.
                data.map(|data| Some((Buffer { data, stride }, format)))
            }
            Kind::Triangles(_) | Kind::Aabbs => Some(None),
        };
        let range = range(table);
        Some(Self {
            span: table.span(),
            vertices: Buffer { data: vertices?, stride },
            vertices_t1,
            indices: index_data.map(|data| (Buffer { data, stride: index_stride }, index_type)),
            radii: radii?,
            format,
            range,
            kind,
        })
    }

    /// The files that its buffers are read from.
    pub(super) fn named_files(&self) -> Vec<Spanned<String>> {
        let (indices, radii) = (self.indices.iter(), self.radii.iter());
        let buffers = indices.map(|(buffer, _)| buffer).chain(radii.map(|(buffer, _)| buffer));
        let data = [&self.vertices].into_iter().chain(buffers).map(|buffer| &buffer.data);
        data.chain(&self.vertices_t1).flat_map(DataPieces::named_files).collect()
    }

    /// Decodes the buffers.
    ///
    /// # Errors
    /// What the data or the build report, at the geometry's table, and limits: a stride of 0 makes
    /// any number of primitives of a few bytes.
    pub(super) fn load(&self, files: &dyn Files) -> Result<GeometryData> {
        self.load_with(&self.vertices.data, files)
    }

    /// The vertices at time 1 of triangles that move: the same ones in the same order.
    ///
    /// # Errors
    /// As [`BuildEntry::load`].
    pub(super) fn load_t1(&self, files: &dyn Files) -> Result<Option<Arc<[[f32; 3]]>>> {
        let Some(later) = &self.vertices_t1 else { return Ok(None) };
        Ok(match self.load_with(later, files)? {
            GeometryData::Triangles { vertices, .. } => Some(vertices.into()),
            _ => None,
        })
    }

    fn load_with(&self, vertices: &DataPieces, files: &dyn Files) -> Result<GeometryData> {
        let at_table = |error: Error| self.span.error(error.message());
        // A buffer of a build is no attribute of a mesh: those are geometries already.
        let models = OpenModels::default();
        let sources = DataSources::files(files, &models);
        let bytes = |buffer: &Buffer| buffer.data.encode(&sources);
        let vertices = vertices.encode(&sources)?;
        let vertices = Strided { bytes: &vertices, stride: self.vertices.stride };
        if let Kind::Aabbs = self.kind {
            self.reserve(aabbs_size(vertices, self.range).map_err(at_table)?, files)?;
            return aabbs(vertices, self.range).map_err(at_table);
        }
        let index_bytes = self.indices.as_ref().map(|(buffer, _)| bytes(buffer)).transpose()?;
        let indices = self.indices.as_ref().zip(index_bytes.as_ref());
        let indices = indices
            .map(|((buffer, index_type), bytes)| (Strided { bytes, stride: buffer.stride }, *index_type));
        let input = BuildInput { vertices, vertex_format: self.format, indices, range: self.range };
        let size = match self.kind {
            Kind::LinearSweptSpheres(mode, _) => input.linear_swept_spheres_size(mode),
            Kind::Spheres => input.spheres_size(),
            Kind::Triangles(_) | Kind::Aabbs => input.triangles_size(),
        };
        self.reserve(size.map_err(at_table)?, files)?;
        let radius_bytes = self.radii.as_ref().map(|(buffer, _)| bytes(buffer)).transpose()?;
        let radii = self.radii.as_ref().zip(radius_bytes.as_ref());
        let radii =
            radii.map(|((buffer, format), bytes)| (Strided { bytes, stride: buffer.stride }, *format));
        let decoded = match (self.kind, radii) {
            (Kind::Triangles(transform), _) => input.triangles(transform),
            (Kind::Spheres, Some((radii, format))) => input.spheres(radii, format),
            (Kind::LinearSweptSpheres(mode, caps), Some((radii, format))) => {
                input.linear_swept_spheres(radii, format, mode, caps)
            }
            (Kind::Aabbs | Kind::Spheres | Kind::LinearSweptSpheres(..), _) => {
                unreachable!("bug in anyhit: spheres were parsed without radii")
            }
        };
        decoded.map_err(at_table)
    }

    /// Compares what is about to be decoded with the limits of the scene. Acceleration structures
    /// count the primitives, each list of geometries its own; this compares those of one geometry.
    fn reserve(&self, size: DecodedSize, files: &dyn Files) -> Result<()> {
        let primitives =
            files.limits().check(InputLimit::ScenePrimitives, size.primitives, ErrorKind::InvalidScene);
        primitives.and_then(|()| files.reserve(size.bytes)).map_err(|error| error.at(self.span.place()))
    }
}

fn range(table: &Table<'_>) -> BuildRange {
    BuildRange {
        primitive_count: table.optional("primitive_count"),
        primitive_offset: table.or("primitive_offset", 0),
        first_vertex: table.or("first_vertex", 0),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::{LoadOptions, SceneFiles, load_text};
    use anyhit_base::input::{InputLimit, InputLimits};

    fn message(geometry: &str, limits: InputLimits) -> String {
        let text = format!("version = 1\n[geometry.a]\n{geometry}\n");
        let files = SceneFiles { limits, ..SceneFiles::default() };
        load_text(Path::new("s.toml"), &text, &files, &LoadOptions::default()).unwrap_err().render()
    }

    const REPEATED: [&str; 5] = [
        "type = 'triangles'\nvertex_data = { f32 = [0, 0, 0] }\nvertex_stride = 0",
        "type = 'triangles'\nvertex_data = { f32 = [0, 0, 0] }\nindex_data = { u32 = 0 }\nindex_stride = 0",
        "type = 'spheres'\nvertex_data = { f32 = [0, 0, 0] }\nvertex_stride = 0\nradius_data = { f32 = 1 }\n\
         radius_stride = 0",
        "type = 'lss'\nvertex_data = { f32 = [0, 0, 0] }\nvertex_stride = 0\nradius_data = { f32 = 1 }\n\
         radius_stride = 0",
        "type = 'aabbs'\naabb_data = { f32 = [0, 0, 0, 1, 1, 1] }\naabb_stride = 0",
    ];

    #[test]
    fn a_repeated_element_makes_no_more_than_the_limits_say() {
        for geometry in REPEATED {
            let many = format!("{geometry}\nprimitive_count = 536870911");
            let text = message(&many, InputLimits::default());
            let wanted = "536870911 primitives of one scene exceed the limit `scene-primitives` of 67108864";
            assert!(text.contains(wanted) && text.contains("s.toml:2:"), "{text}");
            // A primitive takes at least 36 bytes while it is decoded.
            let few = format!("{geometry}\nprimitive_count = 1000");
            let text = message(&few, InputLimits::default().with(InputLimit::SceneMemory, 35_000));
            assert!(text.contains("the limit `scene-memory` of 35000"), "{text}");
        }
    }
}
