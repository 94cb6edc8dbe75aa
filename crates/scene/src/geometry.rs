//! `[geometry.NAME]` and `[[instance]]` of a scene file.

use std::collections::HashSet;
use std::sync::Arc;

use crate::build_input::BuildEntry;
use crate::files::Files;
use crate::generate::{Chains, Grass, Ground, Hair, SphereScatter};
use crate::mesh::Mesh;
use crate::mesh::model::{MeshFormat, Model};
use crate::micromap::opacity_micromap;
use crate::open_models::{MeshSelection, OpenModels};
use crate::read::{Named, OneOrMore, Parse, Span, Spanned, Table, TomlValue};
use crate::transform_entry::parse_transform;
use crate::tree::Toml;
use anyhit_base::error::{Error, Result};
use anyhit_engine::accel::{EndCaps, Geometry, GeometryData, GeometryFlags, Indexing, OpacityMicromap};

/// One geometry as a scene writes it.
#[derive(Clone, Debug)]
pub struct GeometryEntry {
    /// The span of its table.
    pub span: Span,
    /// Its flags.
    pub flags: GeometryFlags,
    opacity_micromap: Option<Arc<OpacityMicromap>>,
    cluster_id: Option<u32>,
    vertices_t1: Option<Arc<[[f32; 3]]>>,
    shape: Shape,
}

#[derive(Clone, Debug)]
enum Shape {
    Inline(GeometryData),
    Build(Box<BuildEntry>),
    Mesh(Box<MeshEntry>),
    /// A part of a model, with its number.
    Part(Arc<Model>, usize),
    Grass(Grass),
    SphereScatter(SphereScatter),
    Chains(Chains),
    Hair(Hair),
    Ground(Ground),
}

#[derive(Clone, Copy)]
pub(crate) enum Kind {
    Triangles,
    Aabbs,
    Spheres,
    LinearSweptSpheres,
    Obj,
    Gltf,
    Grass,
    SphereScatter,
    Chains,
    Hair,
    Plane,
    Heightfield,
}

impl Named for Kind {
    const WHAT: &'static str = "type of geometry";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("triangles", Self::Triangles),
        ("aabbs", Self::Aabbs),
        ("spheres", Self::Spheres),
        ("linear_swept_spheres", Self::LinearSweptSpheres),
        ("lss", Self::LinearSweptSpheres),
        ("obj", Self::Obj),
        ("gltf", Self::Gltf),
        ("grass", Self::Grass),
        ("sphere_scatter", Self::SphereScatter),
        ("chains", Self::Chains),
        ("hair", Self::Hair),
        ("plane", Self::Plane),
        ("heightfield", Self::Heightfield),
    ];
}

impl Named for Indexing {
    const WHAT: &'static str = "indexing mode";
    const NAMES: &'static [(&'static str, Self)] = &[("list", Self::List), ("successive", Self::Successive)];
}

impl Named for EndCaps {
    const WHAT: &'static str = "kind of end caps";
    const NAMES: &'static [(&'static str, Self)] = &[("none", Self::None), ("chained", Self::Chained)];
}

impl Parse for GeometryEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        // The type decides which other keys are accepted.
        let Some(kind) = table.value("type") else {
            return value.wrong("a geometry needs its `type`: `triangles`, `spheres`, `lss`, `obj`, ...");
        };
        let kind = Kind::parse(kind)?;
        let mut flags = 0;
        for (key, flag) in
            [("opaque", GeometryFlags::OPAQUE), ("no_duplicate_any_hit", GeometryFlags::NO_DUPLICATE_ANY_HIT)]
        {
            flags |= if table.or(key, false) { flag.0 } else { 0 };
        }
        let opacity_micromap = opacity_micromap(&table);
        let cluster_id = table.optional("cluster_id");
        let vertices_t1 = vertices_t1(&table, kind);
        let shape = match kind {
            Kind::Triangles => triangles(&table),
            Kind::Aabbs => aabbs(&table),
            Kind::Spheres => spheres(&table),
            Kind::LinearSweptSpheres => linear_swept_spheres(&table),
            Kind::Obj => MeshEntry::parse(&table, MeshFormat::Obj),
            Kind::Gltf => MeshEntry::parse(&table, MeshFormat::Gltf),
            Kind::Grass => Grass::parse(&table).map(Shape::Grass),
            Kind::SphereScatter => SphereScatter::parse(&table).map(Shape::SphereScatter),
            Kind::Chains => Chains::parse(&table).map(Shape::Chains),
            Kind::Hair => Hair::parse(&table).map(Shape::Hair),
            Kind::Plane => Ground::parse_plane(&table).map(Shape::Ground),
            Kind::Heightfield => Ground::parse_heightfield(&table).map(Shape::Ground),
        };
        table.finish();
        let (span, flags) = (value.span(), GeometryFlags(flags));
        Some(Self { span, flags, opacity_micromap, cluster_id, vertices_t1, shape: shape? })
    }
}

impl GeometryEntry {
    /// Loads or generates it.
    ///
    /// # Errors
    /// `Io` or `InvalidMesh` about its file.
    pub fn load(&self, files: &dyn Files, models: &OpenModels) -> Result<Geometry> {
        // A vertex with what belongs to it takes about 32 bytes a primitive.
        let made = self.generated().saturating_mul(32);
        files.reserve(made).map_err(|error| error.at(self.span.place()))?;
        let vertices_t1 = match &self.shape {
            Shape::Build(entry) => entry.load_t1(files)?,
            _ => self.vertices_t1.clone(),
        };
        Ok(Geometry {
            opacity_micromap: self.opacity_micromap.clone(),
            cluster_id: self.cluster_id,
            vertices_t1,
            ..Geometry::new(self.data(files, models)?, self.flags)
        })
    }

    /// How many primitives a generator makes; 0 where none does.
    fn generated(&self) -> u64 {
        let product = |sides: [u32; 2]| u64::from(sides[0]) * u64::from(sides[1]);
        match &self.shape {
            Shape::Grass(grass) => grass.count.into(),
            Shape::SphereScatter(scatter) => scatter.count.into(),
            Shape::Chains(chains) => product([chains.count, chains.segments.saturating_add(1)]),
            Shape::Hair(hair) => product([hair.count, hair.segments.saturating_add(1)]),
            Shape::Ground(ground) => product(ground.divisions).saturating_mul(2),
            _ => 0,
        }
    }

    /// A geometry of a part of a model.
    pub(crate) fn of_part(span: Span, flags: GeometryFlags, model: Arc<Model>, part: usize) -> Self {
        let shape = Shape::Part(model, part);
        Self { span, flags, opacity_micromap: None, cluster_id: None, vertices_t1: None, shape }
    }

    /// Whether it is a part of a model.
    pub(crate) fn is_part(&self) -> bool {
        matches!(self.shape, Shape::Part(..))
    }

    /// The files that it is read from; not the one of a part of a model.
    pub(super) fn named_files(&self) -> Vec<Spanned<String>> {
        match &self.shape {
            Shape::Mesh(entry) => vec![entry.file.clone()],
            Shape::Build(entry) => entry.named_files(),
            _ => Vec::new(),
        }
    }

    /// The mesh file that it is read from, and its format.
    pub(super) fn mesh_file(&self) -> Option<(MeshFormat, &Spanned<String>)> {
        match &self.shape {
            Shape::Mesh(entry) => Some((entry.format, &entry.file)),
            _ => None,
        }
    }

    /// Whether it is read from files of its own.
    pub(super) fn has_files(&self) -> bool {
        !self.named_files().is_empty()
    }

    /// What it takes of a mesh file, as one geometry of this name; `None` if it has no file.
    pub(crate) fn selection(
        &self,
        name: &str,
        files: &dyn Files,
        models: &OpenModels,
    ) -> Option<Result<MeshSelection>> {
        let Shape::Mesh(entry) = &self.shape else { return None };
        Some(entry.open(files, models).and_then(|(model, placed)| {
            let is_placed = placed.iter().any(|(_, transform)| *transform != glam::DMat4::IDENTITY);
            if is_placed {
                let message = format!("nodes transform `{name}`, but not its attributes");
                let error = entry.file.span.error(message);
                return Err(error.note(
                    "select one mesh without its nodes with `mesh`, or create instances with `[[model]]`",
                ));
            }
            let parts = placed.iter().map(|(part, _)| *part).collect();
            let geometries = HashSet::from([name.to_string()]);
            Ok(MeshSelection { model, parts, merged: true, geometries })
        }))
    }

    fn data(&self, files: &dyn Files, models: &OpenModels) -> Result<GeometryData> {
        Ok(match &self.shape {
            Shape::Inline(data) => data.clone(),
            Shape::Build(entry) => entry.load(files)?,
            Shape::Mesh(entry) => {
                let (model, placed) = entry.open(files, models)?;
                let mesh = model.merged(&placed, &files.limits());
                let mesh = mesh.map_err(|error| error.at_with(entry.file.span.place(), "named here"))?;
                triangles_of(mesh, entry.transform)
            }
            Shape::Part(model, part) => {
                let mesh = model.triangles(*part);
                triangles_of(mesh.map_err(|error| error.at_with(self.span.place(), "named here"))?, None)
            }
            Shape::Grass(grass) => grass.generate(),
            Shape::SphereScatter(scatter) => scatter.generate(),
            Shape::Chains(chains) => chains.generate(),
            Shape::Hair(hair) => hair.generate(),
            Shape::Ground(ground) => ground.generate(),
        })
    }
}

fn triangles_of(mesh: Mesh, transform: Option<[[f32; 4]; 3]>) -> GeometryData {
    GeometryData::Triangles { vertices: mesh.vertices, indices: Some(mesh.indices), transform }
}

/// What a geometry takes of a mesh file.
#[derive(Clone, Debug)]
struct MeshEntry {
    format: MeshFormat,
    file: Spanned<String>,
    /// The mesh or object.
    name: Option<Spanned<String>>,
    primitive: Option<Spanned<u32>>,
    merge: bool,
    transform: Option<[[f32; 4]; 3]>,
}

impl MeshEntry {
    fn parse(table: &Table<'_>, format: MeshFormat) -> Option<Shape> {
        let name = table.optional(Self::key(format));
        let (primitive, merge) = (table.optional::<Spanned<u32>>("primitive"), table.or("merge", false));
        let transform = parse_transform(table);
        let file = table.required("file")?;
        if let (Some(primitive), true) = (&primitive, merge) {
            table.report().push(primitive.span.error("`primitive` and `merge` exclude each other"));
            return None;
        }
        Some(Shape::Mesh(Box::new(Self { format, file, name, primitive, merge, transform })))
    }

    fn key(format: MeshFormat) -> &'static str {
        match format {
            MeshFormat::Obj => "object",
            MeshFormat::Gltf => "mesh",
        }
    }

    /// The file, and which of its parts are taken, each with the transform of its node.
    fn open(&self, files: &dyn Files, models: &OpenModels) -> Result<(Arc<Model>, PlacedParts)> {
        let model = models.open_as(self.format, &self.file, None, files)?;
        let key = Self::key(self.format);
        let at = |error: Error| error.at_with(self.file.span.place(), "named here");
        let mut placed = match &self.name {
            None => model.placed(&files.limits()).map_err(at)?,
            Some(name) => {
                let parts = model.parts_named(&name.value, key).map_err(at)?;
                parts.into_iter().map(|part| (part, glam::DMat4::IDENTITY)).collect()
            }
        };
        let count = placed.len();
        if let Some(Spanned { value: primitive, span }) = &self.primitive {
            if self.name.is_none() && model.meshes.len() > 1 {
                let message = format!("`primitive` is an index into one {key}, but the file has several");
                return Err(span.error(message).note(format!("available: {}", model.contents())));
            }
            let Some(one) = placed.get(*primitive as usize) else {
                return Err(span.error(format!(
                    "primitive {primitive} is out of range: there are {count} (counted from 0)"
                )));
            };
            placed = vec![*one];
        } else if count > 1 && !self.merge {
            let what = match &self.name {
                Some(name) => format!("`{}`", name.value),
                None => "the file".to_string(),
            };
            let error =
                self.file.span.error(format!("{what} has {count} primitives, but a geometry holds one"));
            return Err(error.note(format!("available: {}", model.contents())).note(format!(
                "select one with `{key}` and `primitive`, merge all with `merge = true`, or create one \
                 geometry for each with `[[model]]`"
            )));
        }
        Ok((model, placed))
    }
}

/// Parts of a mesh file, each with the transform of its node.
type PlacedParts = Vec<(usize, glam::DMat4)>;

fn triangles(table: &Table<'_>) -> Option<Shape> {
    if table.has("vertex_data") {
        return BuildEntry::triangles(table, parse_transform(table)).map(Box::new).map(Shape::Build);
    }
    let vertices = table.required::<Spanned<Vec<[f32; 3]>>>("vertices");
    let indices = table.optional::<Spanned<Flat>>("indices");
    let transform = parse_transform(table);
    let vertices = vertices?;
    check_indices(table, indices.as_ref(), vertices.value.len(), "vertices");
    let (corner_count, span) = match &indices {
        Some(indices) => (indices.value.0.len(), &indices.span),
        None => (vertices.value.len(), &vertices.span),
    };
    if corner_count % 3 != 0 {
        table.report().push(span.error(format!("{corner_count} corners are not a multiple of three")));
        return None;
    }
    let indices = indices.map(|i| i.value.0);
    Some(Shape::Inline(GeometryData::Triangles { vertices: vertices.value, indices, transform }))
}

/// Reads `vertices_t1`: the vertices at time 1.
fn vertices_t1(table: &Table<'_>, kind: Kind) -> Option<Arc<[[f32; 3]]>> {
    if !matches!(kind, Kind::Triangles) {
        // For other types the key is unknown, and is reported as such.
        return None;
    }
    let later = table.optional::<Spanned<Vec<[f32; 3]>>>("vertices_t1")?;
    let count = table.value("vertices").and_then(|first| first.elements()).map_or(0, Iterator::count);
    if later.value.len() != count {
        let message = format!("{} vertices at time 1, but {count} at time 0", later.value.len());
        table.report().push(later.span.error(message));
    }
    Some(later.value.into())
}

fn aabbs(table: &Table<'_>) -> Option<Shape> {
    if table.has("aabb_data") {
        return BuildEntry::aabbs(table).map(Box::new).map(Shape::Build);
    }
    let boxes = table.required::<Vec<Corners>>("boxes")?;
    Some(Shape::Inline(GeometryData::Aabbs(boxes.into_iter().map(|corners| corners.0).collect())))
}

/// `[min, max]` of three numbers each, or six numbers.
struct Corners([f32; 6]);

impl Parse for Corners {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let Some(mut elements) = value.elements() else { return value.expected("a box, `[[min], [max]]`") };
        if elements.next().is_some_and(|first| matches!(first.toml(), Toml::Array(_))) {
            let [min, max] = <[[f32; 3]; 2]>::parse(value)?;
            return Some(Self([min[0], min[1], min[2], max[0], max[1], max[2]]));
        }
        <[f32; 6]>::parse(value).map(Self)
    }
}

fn spheres(table: &Table<'_>) -> Option<Shape> {
    if table.has("vertex_data") {
        return BuildEntry::spheres(table).map(Box::new).map(Shape::Build);
    }
    let positions = table.required::<Vec<[f32; 3]>>("positions");
    let radii = table.required::<Spanned<OneOrMore<f32>>>("radii");
    let indices = table.optional::<Spanned<Flat>>("indices");
    let positions = positions?;
    let radii = radii_of(table, radii?, positions.len())?;
    check_indices(table, indices.as_ref(), positions.len(), "positions");
    Some(Shape::Inline(GeometryData::Spheres { positions, radii, indices: indices.map(|i| i.value.0) }))
}

fn linear_swept_spheres(table: &Table<'_>) -> Option<Shape> {
    let indexing = table.or("mode", Indexing::List);
    let end_caps = table.or("caps", EndCaps::Chained);
    if table.has("vertex_data") {
        return BuildEntry::linear_swept_spheres(table, indexing, end_caps).map(Box::new).map(Shape::Build);
    }
    let positions = table.required::<Vec<[f32; 3]>>("positions");
    let radii = table.required::<Spanned<OneOrMore<f32>>>("radii");
    let indices = table.optional::<Spanned<Flat>>("indices");
    let positions = positions?;
    let radii = radii_of(table, radii?, positions.len())?;
    if indexing == Indexing::Successive && !table.has("indices") {
        let rule = "VUID-VkAccelerationStructureGeometryLinearSweptSpheresDataNV-indexingMode-10427";
        let message = "mode \"successive\" requires `indices`, one per segment";
        table.report().push(table.span().error(message).note(rule));
        return None;
    }
    // In successive mode index k also names vertex k + 1.
    let usable = positions.len() - usize::from(indexing == Indexing::Successive && !positions.is_empty());
    check_indices(table, indices.as_ref(), usable, "positions that begin a segment");
    let odd = |indices: &&Spanned<Flat>| indexing == Indexing::List && indices.value.0.len() % 2 == 1;
    if let Some(indices) = indices.as_ref().filter(odd) {
        table.report().push(indices.span.error("mode \"list\" requires two indices per segment"));
        return None;
    }
    let indices = indices.map(|i| i.value.0);
    Some(Shape::Inline(GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, end_caps }))
}

/// Integers in arrays of any depth, flattened: `[0, 1, 2]` or `[[0, 1, 2], [2, 1, 3]]`.
#[derive(Clone, Debug)]
struct Flat(Vec<u32>);

impl Parse for Flat {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let Some(elements) = value.elements() else { return value.expected("an array of indices") };
        let mut all = Some(Vec::new());
        for element in elements {
            let part = if matches!(element.toml(), Toml::Array(_)) {
                Self::parse(element).map(|flat| flat.0)
            } else {
                u32::parse(element).map(|index| vec![index])
            };
            match (&mut all, part) {
                (Some(all), Some(part)) => all.extend(part),
                _ => all = None,
            }
        }
        all.map(Self)
    }
}

fn check_indices(table: &Table<'_>, indices: Option<&Spanned<Flat>>, count: usize, of: &str) {
    let Some(indices) = indices else { return };
    if let Some(index) = indices.value.0.iter().find(|index| **index as usize >= count) {
        table
            .report()
            .push(indices.span.error(format!("index {index} is out of range: there are {count} {of}")));
    }
}

fn radii_of(table: &Table<'_>, radii: Spanned<OneOrMore<f32>>, count: usize) -> Option<Vec<f32>> {
    let OneOrMore(values) = radii.value;
    match values.as_slice() {
        // One number, or an array of one, stands for all.
        [radius] => Some(vec![*radius; count]),
        _ if values.len() == count => Some(values),
        _ => {
            let message = format!("{} radii for {count} positions", values.len());
            table.report().push(radii.span.error(message));
            None
        }
    }
}
