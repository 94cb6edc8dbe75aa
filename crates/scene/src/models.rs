//! `[[model]]`: a mesh file whose meshes become geometries and whose nodes become instances.

use std::collections::HashMap;
use std::sync::Arc;

use crate::entry::Entry;
use crate::files::Files;
use crate::geometry::GeometryEntry;
use crate::instance_entry::{InstanceEntry, bits24, instance_flags};
use crate::mesh::listed::AnimationTime;
use crate::mesh::model::Model;
use crate::open_models::{MeshSelection, OpenModels};
use crate::read::{Diagnostics, Named, Parse, Span, Spanned, Table, TomlValue};
use crate::transform_entry::{matrix_of, parse_transform};
use anyhit_base::error::Result;
use anyhit_base::error::names::{list_of, nearest};
use anyhit_base::escape;
use anyhit_engine::accel::{GeometryFlags, InstanceFlags};

/// A model as a scene writes it.
#[derive(Clone, Debug)]
pub struct ModelEntry {
    /// The span of its table.
    pub span: Span,
    /// The file.
    pub file: Spanned<String>,
    /// The time of an animation of the file.
    pub time: Option<AnimationTime>,
    /// What the names of its meshes begin with.
    pub name: Option<Spanned<String>>,
    transform: Option<[[f32; 4]; 3]>,
    /// The acceleration structure that holds its instances.
    pub tlas: String,
    /// Whether its nodes become instances.
    pub instances: bool,
    all: MeshKeys,
    meshes: Vec<(Spanned<String>, MeshKeys)>,
}

/// The keys of all meshes of a model, or of one.
#[derive(Clone, Debug, Default)]
struct MeshKeys {
    mask: Option<u8>,
    custom_index: Option<ModelNumber>,
    sbt_offset: Option<ModelNumber>,
    flags: Option<InstanceFlags>,
    opaque: Option<Opaque>,
    no_duplicate_any_hit: Option<bool>,
}

/// A number, or one that counts what is in the file.
#[derive(Clone, Copy, Debug)]
enum ModelNumber {
    Number(u32),
    Counted(Count),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Count {
    /// The instances of the model.
    Instance,
    /// The meshes of the file.
    Mesh,
    /// The geometries of the file: that of the mesh's first one.
    Geometry,
    /// The materials of the file: that of the mesh's first geometry.
    Material,
}

impl Named for Count {
    const WHAT: &'static str = "index of a model's contents";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("instance", Self::Instance),
        ("mesh", Self::Mesh),
        ("geometry", Self::Geometry),
        ("material", Self::Material),
    ];
}

/// Whether geometries are opaque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Opaque {
    All,
    None,
    /// Those whose material is.
    ByMaterial,
}

impl Parse for Opaque {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        match value.text() {
            Some("alpha_mode") => Some(Self::ByMaterial),
            Some(_) => {
                value.wrong("`opaque` must be true, false, or `\"alpha_mode\"` to follow the materials")
            }
            None => bool::parse(value).map(|all| if all { Self::All } else { Self::None }),
        }
    }
}

fn model_number(table: &Table<'_>, key: &'static str) -> Option<ModelNumber> {
    let value = table.value(key)?;
    match value.text() {
        Some(_) => Count::parse(value).map(ModelNumber::Counted),
        None => bits24(table, key).map(ModelNumber::Number),
    }
}

impl MeshKeys {
    fn parse(table: &Table<'_>) -> Self {
        Self {
            mask: table.optional("mask"),
            custom_index: model_number(table, "custom_index"),
            sbt_offset: model_number(table, "sbt_offset"),
            flags: table.has("flags").then(|| instance_flags(table)),
            opaque: table.optional("opaque"),
            no_duplicate_any_hit: table.optional("no_duplicate_any_hit"),
        }
    }

    /// These, and those of all meshes where these have none.
    fn or(&self, all: &Self) -> Self {
        Self {
            mask: self.mask.or(all.mask),
            custom_index: self.custom_index.or(all.custom_index),
            sbt_offset: self.sbt_offset.or(all.sbt_offset),
            flags: self.flags.or(all.flags),
            opaque: self.opaque.or(all.opaque),
            no_duplicate_any_hit: self.no_duplicate_any_hit.or(all.no_duplicate_any_hit),
        }
    }
}

impl Parse for ModelEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let file = table.required("file");
        let name = table.optional("name");
        let time = animation_time(&table);
        let transform = parse_transform(&table);
        let tlas = table.or("tlas", "main".to_string());
        let instances = table.or("instances", true);
        let all = MeshKeys::parse(&table);
        let mut meshes = Vec::new();
        if let Some(of_meshes) = table.value("meshes").and_then(Table::new) {
            for (name, value) in of_meshes.iter() {
                let Some(table) = Table::new(value) else { continue };
                meshes.push((name, MeshKeys::parse(&table)));
                table.finish();
            }
        }
        table.finish();
        Some(Self { span: value.span(), file: file?, time, name, transform, tlas, instances, all, meshes })
    }
}

/// Reads `time` and `animation`.
fn animation_time(table: &Table<'_>) -> Option<AnimationTime> {
    let time = table.optional::<Spanned<f32>>("time");
    let animation = table.optional::<Spanned<String>>("animation");
    let Some(time) = time else {
        if let Some(animation) = animation {
            let error = animation.span.error("`animation` requires a time");
            table.report().push(error.note("help: add `time = 0.0`, in seconds"));
        }
        return None;
    };
    if !time.value.is_finite() {
        table.report().push(time.span.error("`time` must be finite"));
        return None;
    }
    Some(AnimationTime { time: time.value, animation: animation.map(|name| name.value) })
}

/// What the models of a scene are made into.
#[derive(Debug, Default)]
pub struct Expanded {
    /// A geometry of each primitive.
    pub geometries: Vec<Entry<GeometryEntry>>,
    /// An instance of each node.
    pub instances: Vec<InstanceEntry>,
    /// The names of geometries, meshes and models.
    pub names: HashMap<String, Result<MeshSelection>>,
}

impl Expanded {
    /// Makes geometries and instances of a model.
    pub fn add(
        &mut self,
        entry: &ModelEntry,
        models: &OpenModels,
        files: &dyn Files,
        report: &Diagnostics,
        is_taken: &dyn Fn(&str) -> bool,
    ) {
        let Some(model) = report.keep(models.open(&entry.file, entry.time.as_ref(), files)) else { return };
        let prefix = entry.name.as_ref().map_or(String::new(), |name| format!("{}.", name.value));
        let keys = entry.keys_of_meshes(&model, report);
        let span = entry.name.as_ref().map_or(&entry.file.span, |name| &name.span);
        let clash = |name: &str, known: bool| {
            if known || is_taken(name) {
                let error = span.error(format!("two geometries or meshes are named `{name}`"));
                report
                    .push(error.note("set `name = \"...\"` on the model to prefix the names of its meshes"));
            }
        };
        let whole = |name: &str| Spanned { value: name.to_string(), span: entry.file.span.clone() };
        let full = |part: usize| format!("{prefix}{}", model.parts[part].name);
        let mut lists: Vec<Arc<[Spanned<String>]>> = Vec::new();
        for (mesh, keys) in model.meshes.iter().zip(&keys) {
            let parts = mesh.first..mesh.first + mesh.count;
            let mut list = Vec::new();
            for part in parts.clone() {
                let name = full(part);
                clash(&name, self.names.contains_key(&name));
                let opaque = match keys.opaque {
                    None | Some(Opaque::None) => false,
                    Some(Opaque::All) => true,
                    Some(Opaque::ByMaterial) => model.materials[model.parts[part].material].alpha_mode == 0,
                };
                let mut flags = if opaque { GeometryFlags::OPAQUE.0 } else { 0 };
                if keys.no_duplicate_any_hit == Some(true) {
                    flags |= GeometryFlags::NO_DUPLICATE_ANY_HIT.0;
                }
                let content = GeometryEntry::of_part(
                    entry.file.span.clone(),
                    GeometryFlags(flags),
                    model.clone(),
                    part,
                );
                self.geometries.push(Entry { name: whole(&name), content: Some(content) });
                self.select(name.clone(), &model, vec![part], &full);
                list.push(whole(&name));
            }
            if mesh.count != 1 {
                let name = format!("{prefix}{}", mesh.name);
                clash(&name, self.names.contains_key(&name));
                self.select(name, &model, parts.collect(), &full);
            }
            lists.push(list.into());
        }
        if let Some(name) = &entry.name {
            clash(&name.value, self.names.contains_key(&name.value));
            self.select(name.value.clone(), &model, (0..model.parts.len()).collect(), &full);
        }
        if !entry.instances {
            return;
        }
        if model.nodes.is_empty() {
            report.note(format!(
                "{}: no visible node of its scene has a mesh, so that the model has no instances; place its \
                 geometries with `[[instance]]`",
                escape::path(&model.path)
            ));
        }
        let own = entry.transform.map(|rows| matrix_of(&rows));
        let tlas: Arc<str> = entry.tlas.as_str().into();
        for (at, node) in (0..).zip(&model.nodes) {
            let mesh = &model.meshes[node.mesh];
            if mesh.count == 0 {
                continue;
            }
            let keys = &keys[node.mesh];
            let number = |number: Option<ModelNumber>| match number {
                None => 0,
                Some(ModelNumber::Number(number)) => number,
                Some(ModelNumber::Counted(Count::Instance)) => at,
                Some(ModelNumber::Counted(Count::Mesh)) => node.mesh as u32,
                Some(ModelNumber::Counted(Count::Geometry)) => mesh.first as u32,
                Some(ModelNumber::Counted(Count::Material)) => model.parts[mesh.first].material as u32,
            };
            let world = own.map_or(node.world, |own| own * node.world).transpose();
            let row = |row: glam::DVec4| row.as_vec4().to_array();
            self.instances.push(InstanceEntry {
                span: entry.span.clone(),
                geometry: lists[node.mesh].clone(),
                tlas: Some(tlas.clone()),
                transform: [row(world.x_axis), row(world.y_axis), row(world.z_axis)],
                motion: None,
                custom_index: number(keys.custom_index),
                mask: keys.mask.unwrap_or(0xff),
                sbt_offset: number(keys.sbt_offset),
                flags: keys.flags.unwrap_or_default(),
            });
        }
    }

    fn select(
        &mut self,
        name: String,
        model: &Arc<Model>,
        parts: Vec<usize>,
        full: &dyn Fn(usize) -> String,
    ) {
        let geometries = parts.iter().map(|part| full(*part)).collect();
        let selection = MeshSelection { model: model.clone(), parts, merged: false, geometries };
        self.names.insert(name, Ok(selection));
    }
}

impl ModelEntry {
    /// The keys of each mesh of the file.
    fn keys_of_meshes(&self, model: &Model, report: &Diagnostics) -> Vec<MeshKeys> {
        let mut keys = vec![self.all.clone(); model.meshes.len()];
        for (name, own) in &self.meshes {
            let Some(at) = model.meshes.iter().position(|mesh| mesh.name == name.value) else {
                let names = || model.meshes.iter().map(|mesh| mesh.name.as_str());
                let label = match nearest(&name.value, names()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => "no such mesh".to_string(),
                };
                let error = name.span.error_with(format!("the file has no mesh `{}`", name.value), label);
                report.push(error.note(format!("meshes in the file: {}", list_of(names()))));
                continue;
            };
            keys[at] = own.or(&self.all);
        }
        keys
    }
}
