//! The content of a glTF file that is not read.

use std::collections::BTreeSet;

use crate::mesh::gltf::document::{Document, Mode, Primitive};
use crate::mesh::gltf::extension::{COMPRESSED, READ};
use anyhit_base::error::names::list_of;
use anyhit_base::error::{Error, ErrorKind, Result};

/// The extensions that do not change triangles, besides those of materials, textures and lights.
const WITHOUT_GEOMETRY: &[&str] = &[
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "KHR_animation_pointer",
    "KHR_audio_emitter",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Returns true if the triangles of a file are the same without an extension.
fn leaves_geometry(extension: &str) -> bool {
    let what = extension.split_once('_').map_or("", |(_, what)| what);
    let is_of_look = ["materials_", "texture_", "lights_"].iter().any(|begin| what.starts_with(begin));
    is_of_look || WITHOUT_GEOMETRY.contains(&extension)
}

/// Checks that the extensions that a file requires are read, or do not change its triangles.
pub(super) fn check_required(document: &Document) -> Result<()> {
    let is_known = |name: &str| READ.contains(&name) || COMPRESSED.contains(&name) || leaves_geometry(name);
    match document.extensions_required.iter().find(|name| !is_known(name)) {
        None => Ok(()),
        Some(name) => {
            let message = format!("{name}: the file requires this extension, which is not read");
            Err(Error::new(ErrorKind::UnsupportedFile, message)
                .note("help: export the model without this extension"))
        }
    }
}

/// Why a primitive is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Skipped {
    Points,
    Lines,
    WithoutPositions,
}

impl Skipped {
    /// The reasons with the content of such primitives.
    const ALL: [(Self, &str); 3] = [
        (Self::Points, "points"),
        (Self::Lines, "lines"),
        (Self::WithoutPositions, "triangles without positions"),
    ];

    /// Why a primitive is not read; `None` if it is.
    pub(super) fn of(primitive: &Primitive) -> Option<Self> {
        match primitive.mode {
            Mode::Points => Some(Self::Points),
            Mode::Lines => Some(Self::Lines),
            // glTF 2.0, 3.7.2.1: primitives without positions are not drawn.
            _ if !primitive.attributes.contains_key("POSITION") => Some(Self::WithoutPositions),
            _ => None,
        }
    }
}

/// Counts that only a walk through the nodes yields.
#[derive(Debug, Default)]
pub(super) struct Ignored {
    /// Animations besides the one that is read.
    pub animations: usize,
    /// Nodes with a mesh that are hidden.
    pub hidden: usize,
    /// Nodes with a skin whose mesh has no joints.
    pub skins: usize,
}

/// Lists what is not read, each kind with its number.
pub(super) fn list(document: &Document, ignored: &Ignored) -> Vec<String> {
    let mut all = Vec::new();
    let mut add = |count: usize, one: &str, more: &str| match count {
        0 => {}
        1 => all.push(format!("1 {one}")),
        count => all.push(format!("{count} {more}")),
    };
    add(ignored.animations, "animation", "animations");
    add(ignored.skins, "skin of a mesh without joints", "skins of meshes without joints");
    add(ignored.hidden, "hidden node", "hidden nodes");
    add(document.scenes.len().saturating_sub(1), "further scene", "further scenes");
    let primitives = || document.meshes.iter().flat_map(|mesh| &mesh.primitives);
    for (reason, content) in Skipped::ALL {
        let count = primitives().filter(|primitive| Skipped::of(primitive) == Some(reason)).count();
        add(count, &format!("primitive of {content}"), &format!("primitives of {content}"));
    }
    let pictures = document.textures.iter().filter(|texture| texture.source.is_none()).count();
    add(pictures, "texture without a picture", "textures without a picture");
    let used = document.extensions_used.iter().chain(&document.extensions_required);
    let of_objects = (document.materials.iter().map(|material| &material.extensions))
        .chain(document.textures.iter().map(|texture| &texture.extensions))
        .chain(document.nodes.iter().map(|node| &node.extensions))
        .chain(primitives().map(|primitive| &primitive.extensions));
    let mut extensions: BTreeSet<&str> = used.map(String::as_str).collect();
    extensions.extend(of_objects.flat_map(|extensions| extensions.keys()).map(String::as_str));
    extensions.retain(|name| !READ.contains(name));
    let names = list_of(extensions.iter().copied());
    match extensions.len() {
        0 => {}
        1 => all.push(format!("the extension {names}")),
        _ => all.push(format!("the extensions {names}")),
    }
    all
}
