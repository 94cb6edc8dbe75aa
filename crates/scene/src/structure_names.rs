//! What a scene calls the parts of its acceleration structures, and where it describes them.

use std::sync::Arc;

use crate::ResolvedScene;
use crate::read::Span;
use crate::tree::{Toml, TomlMember};
use anyhit_base::error::Place;
use anyhit_engine::accel::Tlas;
use anyhit_sanitize::StructureNames;

impl StructureNames for ResolvedScene {
    fn structures(&self) -> &[(String, Arc<Tlas>)] {
        &self.tlas
    }

    fn geometries(&self, structure: usize, instance: u32) -> &[String] {
        let names = self.geometry_names.get(structure);
        names.and_then(|names| names.get(instance as usize)).map_or(&[], |names| names)
    }

    fn geometry_place(&self, name: &str) -> Option<Place> {
        let Toml::Table(geometries) = &member(self, "geometry")?.node.value else { return None };
        let member = geometries.iter().find(|member| &*member.key == name)?;
        Some(Span { source: self.document.source().clone(), range: member.key_range() }.place())
    }

    /// Of instances that the scene's own file lists; those of files that it includes stand before
    /// them.
    fn instance_place(&self, structure: usize, instance: u32) -> Option<Place> {
        if member(self, "include").is_some() {
            return None;
        }
        let Toml::Array(instances) = &member(self, "instance")?.node.value else { return None };
        let wanted = &self.tlas.get(structure)?.0;
        let is_of_structure = |value: &Toml| {
            let Toml::Table(members) = value else { return false };
            match members.iter().find(|member| &*member.key == "tlas").map(|member| &member.node.value) {
                Some(Toml::String(name)) => **name == **wanted,
                _ => wanted == "main",
            }
        };
        let found = instances.iter().filter(|one| is_of_structure(&one.value)).nth(instance as usize)?;
        Some(Span { source: self.document.source().clone(), range: found.range() }.place())
    }
}

/// A key of the scene's own file.
fn member<'a>(scene: &'a ResolvedScene, key: &str) -> Option<&'a TomlMember> {
    let Toml::Table(members) = &scene.document.node().value else { return None };
    members.iter().find(|member| &*member.key == key)
}
