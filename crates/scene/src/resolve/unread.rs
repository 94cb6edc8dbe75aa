//! Leaves out parts of a scene that nothing reads: their files must exist, but are not opened.
//!
//! A resource is read if a shader declares its set and binding, or if the scene uses its name
//! elsewhere. An acceleration structure is read if such a resource binds it, or if the host may
//! trace rays. A geometry or a model is read if such a structure has an instance of it, or if the
//! scene uses its name. A doubtful part is read.

use std::collections::HashSet;

use crate::address_entry::AddressChoice;
use crate::descriptor_kind::DescriptorKind;
use crate::file::RayEntry;
use crate::geometry::GeometryEntry;
use crate::instance_entry::InstanceEntry;
use crate::pass_entry::PassWorkEntry;
use crate::read::{Document, Spanned};
use crate::read_file::file_error;
use crate::resolve::Resolver;
use crate::resolve::modules::SceneModules;
use crate::resolved::UnreadPart;
use crate::resources::{Content, ResourceEntry};
use crate::struct_data::ShaderModules;
use crate::tree::{Toml, TomlNode};
use anyhit_engine::ops::heap::binding;

const UNDECLARED: &str = "no shader declares its set and binding";
const UNNAMED: &str = "nothing names it";
const UNBOUND: &str = "no descriptor that a shader declares holds its acceleration structure";
const NO_INSTANCE: &str = "no instance that a ray can reach has it";

impl Resolver<'_> {
    /// Leaves out what nothing reads, if that saves opening a file.
    pub(super) fn leave_out_unread(&mut self) {
        let mut geometry = self.geometry.entries.iter().filter_map(|entry| entry.content.as_ref());
        let mut resources = self.resource_entries.entries.iter().filter_map(|entry| entry.content.as_ref());
        let names_files =
            !self.models.is_empty() || geometry.any(GeometryEntry::has_files) || resources.any(has_files);
        if !names_files || self.files.read_all() || !self.report.is_empty() {
            return;
        }
        let Some(declared) = self.declared_places() else { return };
        let mentions = Mentions::of(&self.documents);
        self.leave_out_resources(&declared, &mentions);
        self.leave_out_structures(&declared, &mentions);
        self.leave_out_geometry(&mentions);
    }

    /// The sets and bindings that the scene's shaders declare; `None` where not all are known.
    fn declared_places(&self) -> Option<HashSet<[u32; 2]>> {
        let mut shaders = self.pass_shaders(None);
        for named in &self.pipelines.entries {
            shaders.extend(self.pass_shaders(Some(&named.name)));
        }
        let of_passes = self.passes.iter().filter_map(|pass| match &pass.work {
            PassWorkEntry::Dispatch(dispatch) => Some(dispatch),
            PassWorkEntry::Launch { .. } => None,
        });
        shaders.extend(self.dispatches.iter().chain(of_passes).map(|dispatch| dispatch.shader.clone()));
        if shaders.is_empty() {
            return None;
        }
        let (mut declared, mut known) = (HashSet::new(), HashSet::new());
        let modules = SceneModules { resolver: self, own: &[] };
        for shader in shaders.iter().filter(|shader| known.insert(modules.key(shader))) {
            let module = modules.module(shader).ok()?;
            let variables = module.entry_points.iter().flat_map(|entry| module.interface_of(entry));
            declared.extend(variables.filter_map(|one| Some([one.descriptor_set?, one.binding?])));
            let heaps = module.entry_points.iter().flat_map(|entry| module.heaps_of(entry.function));
            let places = heaps.map(binding).flat_map(|heap| [heap, heap.heap_data()]);
            declared.extend(places.map(|at| [at.set, at.binding]));
        }
        Some(declared)
    }

    fn leave_out_resources(&mut self, declared: &HashSet<[u32; 2]>, mentions: &Mentions) {
        let mut unread = Vec::new();
        for (at, entry) in self.resource_entries.entries.iter().enumerate() {
            let Some(content) = entry.content.as_ref().filter(|content| has_files(content)) else { continue };
            let is_unbound = matches!(content.contents[..], [Content::Buffer(DescriptorKind::Unbound, _)]);
            let has_address = content.contents.iter().any(
                |one| matches!(one, Content::Buffer(_, buffer) if buffer.address != AddressChoice::Unsaid),
            );
            let is_declared = !is_unbound && declared.contains(&[content.set, content.binding]);
            if is_declared || has_address || content.output.is_some() || mentions.say(&entry.name.value) {
                continue;
            }
            let files = content.contents.iter().flat_map(files_of).collect();
            unread.push((at, files, if is_unbound { UNNAMED } else { UNDECLARED }));
        }
        for (at, files, reason) in unread {
            let entry = &mut self.resource_entries.entries[at];
            entry.content = None;
            let name = entry.name.value.clone();
            self.leave_out("resource", &name, files, reason);
        }
    }

    /// Leaves out the instances of acceleration structures that no shader reaches, where one of
    /// their geometries is read from a file.
    fn leave_out_structures(&mut self, declared: &HashSet<[u32; 2]>, mentions: &Mentions) {
        if !self.options.only_shaders_trace
            || mentions.list_instances
            || self.rays.iter().any(|ray| matches!(ray, RayEntry::Given(_)))
        {
            return;
        }
        let structures = |entry: &ResourceEntry| {
            let names = entry.contents.iter().filter_map(|content| match content {
                Content::AccelerationStructure(name) => Some(name.value.clone()),
                _ => None,
            });
            names.collect::<Vec<_>>()
        };
        let mut reached: HashSet<String> = HashSet::new();
        for entry in self.resource_entries.entries.iter().filter_map(|entry| entry.content.as_ref()) {
            if declared.contains(&[entry.set, entry.binding]) {
                reached.extend(structures(entry));
            }
        }
        let has_file = |name: &Spanned<String>| {
            let entry = self.geometry.get(&name.value).and_then(|entry| entry.content.as_ref());
            entry.is_none_or(|entry| entry.has_files())
        };
        let placed = self.models.iter().filter(|model| model.instances).map(|model| model.tlas.as_str());
        let listed = self.instances.iter().filter(|entry| entry.geometry.iter().any(has_file));
        let names: HashSet<&str> = placed.chain(listed.map(InstanceEntry::tlas)).collect();
        let names = names.into_iter().filter(|name| !reached.contains(*name) && !mentions.say(name));
        let unreached: HashSet<String> = names.map(str::to_owned).collect();
        if unreached.is_empty() {
            return;
        }
        self.instances.retain(|entry| !unreached.contains(entry.tlas()));
        for model in self.models.iter_mut().filter(|model| unreached.contains(&model.tlas)) {
            model.instances = false;
        }
        for entry in &mut self.resource_entries.entries {
            let holds =
                |content: &ResourceEntry| structures(content).iter().any(|name| unreached.contains(name));
            if entry.content.as_ref().is_some_and(holds) {
                entry.content = None;
            }
        }
        let mut names: Vec<_> = unreached.into_iter().collect();
        names.sort_unstable();
        for name in names {
            self.leave_out("acceleration structure", &name, Vec::new(), UNBOUND);
        }
    }

    fn leave_out_geometry(&mut self, mentions: &Mentions) {
        let names = self.instances.iter().flat_map(|entry| entry.geometry.iter());
        let placed: HashSet<&str> = names.map(|name| name.value.as_str()).collect();
        // A name that no geometry has may be one of a model.
        let names_models = placed.iter().any(|name| self.geometry.get(name).is_none());
        let mut unread = Vec::new();
        for (at, entry) in self.geometry.entries.iter().enumerate() {
            let Some(content) = entry.content.as_ref().filter(|content| content.has_files()) else {
                continue;
            };
            if !placed.contains(entry.name.value.as_str()) && !mentions.say(&entry.name.value) {
                unread.push((at, content.named_files()));
            }
        }
        for (at, files) in unread {
            let entry = &mut self.geometry.entries[at];
            entry.content = None;
            let name = entry.name.value.clone();
            self.leave_out("geometry", &name, files, NO_INSTANCE);
        }
        if mentions.name_meshes || names_models {
            return;
        }
        for model in std::mem::take(&mut self.models) {
            if model.instances {
                self.models.push(model);
                continue;
            }
            let name = model.name.as_ref().unwrap_or(&model.file).value.clone();
            self.leave_out("model", &name, vec![model.file], NO_INSTANCE);
        }
    }

    /// Notes what is left out, and checks that its files are there.
    fn leave_out(&mut self, kind: &str, name: &str, files: Vec<Spanned<String>>, reason: &'static str) {
        for file in &files {
            let path = file.span.source.sibling(&file.value);
            let found = self.files.exists(&path);
            self.report.keep(found.map_err(|error| file_error(error, &file.span, &path)));
        }
        let files = files.into_iter().map(|file| file.value).collect();
        self.unread.push(UnreadPart {
            what: format!("{kind} `{name}`"),
            name: name.to_owned(),
            files,
            reason,
        });
    }
}

/// The files that the content of a descriptor names.
fn files_of(content: &Content) -> Vec<Spanned<String>> {
    match content {
        Content::Buffer(_, buffer) => buffer.named_files(),
        Content::Image(_, image) => image.named_files(),
        _ => Vec::new(),
    }
}

fn has_files(entry: &ResourceEntry) -> bool {
    entry.contents.iter().any(|content| !files_of(content).is_empty())
}

/// The names that a scene says, but for those that it gives to something.
#[derive(Debug, Default)]
struct Mentions {
    words: HashSet<String>,
    /// Whether data list the instances of an acceleration structure.
    list_instances: bool,
    /// Whether something names a mesh.
    name_meshes: bool,
}

impl Mentions {
    fn of(documents: &[Document]) -> Self {
        let mut mentions = Self::default();
        documents.iter().for_each(|document| mentions.add(&mut Vec::new(), document.read_node()));
        mentions
    }

    /// Whether a name is said, perhaps that of an element or a member of what has it.
    fn say(&self, name: &str) -> bool {
        self.words.contains(name)
    }

    fn add<'t>(&mut self, keys: &mut Vec<&'t str>, node: &'t TomlNode) {
        match &node.value {
            Toml::String(text) => self.add_text(keys, text),
            Toml::Array(elements) => elements.iter().for_each(|element| self.add(keys, element)),
            Toml::Table(members) => {
                for member in members {
                    // `resources = { NAME = "OTHER" }` of a pass.
                    if let [_, .., "resources"] = keys[..] {
                        self.add_word(&member.key);
                    }
                    keys.push(&member.key);
                    self.add(keys, &member.node);
                    keys.pop();
                }
            }
            _ => {}
        }
    }

    fn add_text(&mut self, keys: &[&str], text: &str) {
        match keys {
            [.., "file" | "path" | "source" | "include"] => return,
            // What they name is looked up where it is known whether they are read.
            ["instance", "geometry" | "tlas"] | ["model", "tlas" | "name"] | ["resources", _, "tlas"] => {
                return;
            }
            [.., "mesh"] => self.name_meshes = true,
            [.., "table"] if text == "instances" => self.list_instances = true,
            _ => {}
        }
        self.add_word(text);
    }

    fn add_word(&mut self, text: &str) {
        let ends = text.match_indices(['[', '.']).map(|(end, _)| &text[..end]);
        for word in std::iter::once(text).chain(ends) {
            if !self.words.contains(word) {
                self.words.insert(word.to_owned());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::{LoadOptions, ResolvedScene, SceneFiles, load_text};
    use anyhit_base::error::Result;

    const SHADER: &str =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../../spirv-fixtures/pass/compute/prefix-sum/main.comp.spv");

    /// A dispatch that declares binding 1 of set 0, and more.
    fn scene(folder: &Path, more: &str, read_all: bool) -> Result<ResolvedScene> {
        load(folder, more, read_all, LoadOptions { only_shaders_trace: true, ..LoadOptions::default() })
    }

    fn load(folder: &Path, more: &str, read_all: bool, options: LoadOptions) -> Result<ResolvedScene> {
        let text = format!(
            "version = 1\n[shaders.sum]\npath = '{SHADER}'\n[[dispatch]]\nshader = 'sum'\n\
             [resources.sums]\ntype = 'storage_buffer'\nbinding = 1\nsize = 4096\n{more}"
        );
        let files = SceneFiles { read_all, ..SceneFiles::default() };
        load_text(&folder.join("s.toml"), &text, &files, &options)
    }

    const PICTURE: &str = "[resources.map]\ntype = 'sampled_image'\nbinding = 9\nfile = 'broken.png'\n";
    const DATA: &str =
        "[resources.broken]\ntype = 'storage_buffer'\nbinding = 9\ndata = { file = 'broken.png' }\n";
    const MESH: &str = "[geometry.mesh]\ntype = 'obj'\nfile = 'broken.obj'\n";
    const INSTANCE: &str = "[[instance]]\ngeometry = 'mesh'\ntlas = 'world'\n";
    const MODEL: &str = "[[model]]\nfile = 'broken.gltf'\nname = 'house'\ntlas = 'world'\n";
    const WORLD: &str = "[resources.world_tlas]\ntype = 'acceleration_structure'\ntlas = 'world'\n";

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        for file in ["broken.png", "broken.obj", "broken.gltf"] {
            std::fs::write(folder.path().join(file), "no picture and no mesh").expect("a file");
        }
        folder
    }

    #[test]
    fn what_nothing_reads_is_not_opened() {
        let folder = folder();
        for (more, parts) in [
            (PICTURE.to_owned(), vec![("resource `map`", "no shader declares its set and binding")]),
            (MESH.to_owned(), vec![("geometry `mesh`", "no instance that a ray can reach has it")]),
            (
                format!("{MESH}{INSTANCE}{WORLD}binding = 9\n"),
                vec![
                    (
                        "acceleration structure `world`",
                        "no descriptor that a shader declares holds its acceleration structure",
                    ),
                    ("geometry `mesh`", "no instance that a ray can reach has it"),
                ],
            ),
            (
                MODEL.to_owned(),
                vec![
                    (
                        "acceleration structure `world`",
                        "no descriptor that a shader declares holds its acceleration structure",
                    ),
                    ("model `house`", "no instance that a ray can reach has it"),
                ],
            ),
            (
                format!("{MODEL}instances = false\n"),
                vec![("model `house`", "no instance that a ray can reach has it")],
            ),
            (
                "[resources.own]\ntype = 'buffer'\ndata = { file = 'broken.png' }\n".to_owned(),
                vec![("resource `own`", "nothing names it")],
            ),
        ] {
            let scene = scene(folder.path(), &more, false).expect("nothing is opened");
            let found: Vec<_> = scene.unread.iter().map(|part| (part.what.as_str(), part.reason)).collect();
            assert_eq!(found, parts, "{more}");
            assert!(scene.tlas.is_empty(), "{more}");
        }
        // A buffer has any bytes: only reading all finds it.
        assert_eq!(scene(folder.path(), DATA, false).expect("a scene").unread[0].files, ["broken.png"]);
        assert!(scene(folder.path(), DATA, true).expect("a scene").unread.is_empty());
    }

    #[test]
    fn what_something_reads_is_opened() {
        let folder = folder();
        for more in [
            // Declared, an output, at an address, or named.
            PICTURE.replace("binding = 9", "binding = 1"),
            format!("{PICTURE}[expect.image]\nname = 'map'\n"),
            format!("{MESH}{INSTANCE}{WORLD}binding = 1\n"),
            format!("{MESH}{INSTANCE}[[ray]]\norigin = [0, 0, 1]\ndirection = [0, 0, -1]\n"),
            format!(
                "{MESH}{INSTANCE}[resources.rows]\ntype = 'storage_buffer'\nbinding = 7\n\
                 data = {{ table = 'instances', tlas = 'world' }}\n"
            ),
            format!("{MODEL}{WORLD}binding = 1\n"),
            format!(
                "{MODEL}instances = false\n[resources.rows]\ntype = 'storage_buffer'\nbinding = 7\n\
                 data = {{ mesh = 'house', attribute = 'normal' }}\n"
            ),
        ] {
            let error = scene(folder.path(), &more, false).err().unwrap_or_else(|| panic!("{more}")).render();
            assert!(error.contains("broken."), "{more}: {error}");
        }
        // A host may trace rays.
        let host = load(folder.path(), &format!("{MESH}{INSTANCE}"), false, LoadOptions::default());
        assert!(host.expect_err("an error").render().contains("broken.obj"));
        for more in [PICTURE, MESH, MODEL] {
            let error = scene(folder.path(), more, true).expect_err("an error").render();
            assert!(error.contains("broken."), "{more}: {error}");
        }
    }

    #[test]
    fn a_file_that_nothing_reads_must_be_there() {
        let folder = folder();
        for more in [PICTURE, DATA, MESH, MODEL] {
            let more = more.replace("broken", "absent");
            let error = scene(folder.path(), &more, false).expect_err("an error").render();
            assert!(error.contains("absent.") && error.contains("s.toml:"), "{error}");
        }
    }
}
