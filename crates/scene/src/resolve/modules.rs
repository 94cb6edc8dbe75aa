//! The modules of a scene's shaders: files that are read at their first use, and loaded early
//! where data is laid out by their structs.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use crate::assemble;
use crate::file::ShaderEntry;
use crate::files::SceneFiles;
use crate::read::{Spanned, unknown_name};
use crate::read_file::read_limited;
use crate::resolve::Resolver;
use crate::resolved::{ResolvedShader, ShaderCode, ShaderModule};
use crate::struct_data::ShaderModules;
use anyhit_base::error::Result;
use anyhit_base::input::InputLimit;
use anyhit_compile::{SourceEntryPoint, SourceSettings};
use anyhit_engine::module::Module;

/// The shaders of a scene as modules.
pub(super) struct SceneModules<'r, 'a> {
    pub resolver: &'r Resolver<'a>,
    /// The shaders that the data is for; all of the scene where there is none.
    pub own: &'r [&'r Spanned<String>],
}

impl ShaderModules for SceneModules<'_, '_> {
    fn module(&self, shader: &Spanned<String>) -> Result<Arc<Module>> {
        let entries = &self.resolver.shader_entries;
        if let Some(entry) = self.entry(shader) {
            return self.resolver.loaded_module(&shader.value, entry);
        }
        let names = || entries.entries.iter().map(|entry| entry.name.value.as_str());
        let message = format!("no shader is named `{}`", shader.value);
        Err(unknown_name(shader, message, "no such name", names))
    }

    fn all(&self) -> Result<Vec<Arc<Module>>> {
        if !self.own.is_empty() {
            return self.own.iter().map(|shader| self.module(shader)).collect();
        }
        self.used().map(|entry| self.resolver.loaded_module("shader", entry)).collect()
    }

    fn comparable(&self) -> Vec<Arc<Module>> {
        let entries: Vec<_> = match self.own.is_empty() {
            true => self.used().collect(),
            false => self.own.iter().filter_map(|shader| self.entry(shader)).collect(),
        };
        let has_address =
            |entry: &ShaderEntry| entry.specialization.iter().any(|(_, value)| value.target().is_some());
        let entries = entries.into_iter().filter(|entry| !has_address(entry));
        // A module that cannot be loaded is reported where it is used.
        entries.filter_map(|entry| self.resolver.loaded_module("shader", entry).ok()).collect()
    }
}

impl SceneModules<'_, '_> {
    /// The entry of a shader, perhaps with an entry point behind its name.
    fn entry(&self, shader: &Spanned<String>) -> Option<&ShaderEntry> {
        let entries = &self.resolver.shader_entries;
        let without_entry = || Some(shader.value.rsplit_once(':')?.0);
        let found = entries.get(&shader.value).or_else(|| entries.get(without_entry()?));
        found.and_then(|entry| entry.content.as_ref())
    }

    /// What the module of a shader is made from, whichever of its entry points is meant.
    pub(super) fn key(&self, shader: &Spanned<String>) -> Option<ModuleKey> {
        self.entry(shader).and_then(ModuleKey::of)
    }

    /// The entries that the scene uses.
    fn used(&self) -> impl Iterator<Item = &ShaderEntry> {
        let resolver = self.resolver;
        let used = |entry: &&ShaderEntry| {
            ModuleKey::of(entry).is_some_and(|key| resolver.module_places.contains_key(&key))
        };
        let entries = resolver.shader_entries.entries.iter().filter_map(|entry| entry.content.as_ref());
        entries.filter(used)
    }
}

/// What a module is made from: two shaders with the same are entry points of one module.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct ModuleKey {
    /// The file.
    pub path: PathBuf,
    /// How it is compiled.
    pub settings: SourceSettings,
}

impl ModuleKey {
    /// Of a shader's entry; `None` where it names no file, which is reported already.
    pub(super) fn of(entry: &ShaderEntry) -> Option<Self> {
        let file = entry.path.as_ref().or(entry.source.as_ref())?;
        let folders = entry.include_folders.iter().map(|folder| folder.span.source.sibling(&folder.value));
        let of_flags = entry.compiler_flags.include_folders().iter();
        let of_flags = of_flags.map(|folder| file.span.source.sibling(folder));
        Some(Self {
            path: file.span.source.sibling(&file.value),
            settings: SourceSettings {
                language: entry.language,
                entry_point: entry.stage.and_then(|stage| {
                    SourceEntryPoint::said(entry.language?, Some(&entry.entry), Some(stage))
                }),
                include_folders: folders.chain(of_flags).collect(),
                flags: entry.compiler_flags.clone(),
            },
        })
    }
}

impl Resolver<'_> {
    /// Resolves a reference to a shader, `name` or `name:entry`.
    pub(super) fn shader(&mut self, reference: &Spanned<String>) -> Option<ResolvedShader> {
        let whole = self.shader_entries.get(&reference.value).is_some();
        let (name, entry) = match reference.value.rsplit_once(':') {
            Some((name, entry)) if !whole => (name, Some(entry)),
            _ => (reference.value.as_str(), None),
        };
        let name = Spanned { value: name.to_string(), span: reference.span.clone() };
        let found = self.find(&self.shader_entries, &name, "shader")?.clone();
        let module = self.module(&name.value, &found)?;
        Some(ResolvedShader {
            module,
            entry: entry.map_or(found.entry, str::to_string),
            specialization: found.specialization,
            place: reference.span.place(),
        })
    }

    /// The index of a file with shaders; it is read at the first use.
    fn module(&mut self, name: &str, entry: &ShaderEntry) -> Option<usize> {
        let key = ModuleKey::of(entry)?;
        if let Some(&known) = self.module_places.get(&key) {
            return Some(known);
        }
        let module = match self.read_early.get_mut().remove(&key) {
            Some(early) => {
                let place = entry.path.as_ref().or(entry.source.as_ref())?.span.place();
                ShaderModule { name: name.to_string(), place, ..early }
            }
            None => self.report.keep(self.read_module(name, entry)?)?,
        };
        self.module_places.insert(key, self.modules.len());
        self.modules.push(module);
        Some(self.modules.len() - 1)
    }

    /// Reads a file with shaders; `None` for an entry that names none, which is reported already.
    fn read_module(&self, name: &str, entry: &ShaderEntry) -> Option<Result<ShaderModule>> {
        let (file, compiled) = match (&entry.path, &entry.source) {
            (Some(path), _) => (path, true),
            (None, Some(source)) => (source, false),
            (None, None) => return None,
        };
        let key = ModuleKey::of(entry)?;
        let limit = if compiled { InputLimit::ModuleBytes } else { InputLimit::SourceBytes };
        let bytes = match read_limited(self.files, &file.value, &file.span, limit) {
            Ok(bytes) => bytes,
            Err(error) => return Some(Err(error)),
        };
        let code = match compiled {
            true => ShaderCode::SpirV(bytes),
            false => ShaderCode::Source(bytes, key.settings),
        };
        Some(Ok(ShaderModule { name: name.to_string(), path: key.path, code, place: file.span.place() }))
    }

    /// The module of a shader, with the shader's specialization.
    fn loaded_module(&self, name: &str, entry: &ShaderEntry) -> Result<Arc<Module>> {
        let nameless = || entry.span.error("a shader needs the `path` of its .spv file, or its `source`");
        let key = ModuleKey::of(entry).ok_or_else(nameless)?;
        let known = self.loaded.borrow().get(&key).cloned();
        let module = known.unwrap_or_else(|| {
            let module = self.load_module(name, entry, &key);
            self.loaded.borrow_mut().insert(key.clone(), module.clone());
            module
        });
        let mut module = module?;
        if !entry.specialization.is_empty() {
            let specialized = Arc::make_mut(&mut module);
            for (key, value) in &entry.specialization {
                value.specialize(specialized, key, None)?;
            }
        }
        Ok(module)
    }

    fn load_module(&self, name: &str, entry: &ShaderEntry, key: &ModuleKey) -> Result<Arc<Module>> {
        let files = SceneFiles::like(self.files);
        let load = |module| assemble::read(module, &files).map(Arc::new);
        if let Some(&index) = self.module_places.get(key) {
            return load(&self.modules[index]);
        }
        let module =
            self.read_module(name, entry).expect("bug in anyhit: an entry with a key has no file")?;
        let loaded = load(&module);
        self.read_early.borrow_mut().insert(key.clone(), module);
        loaded
    }

    /// The modules that are loaded, by their indices.
    pub(super) fn loaded_modules(&self) -> HashMap<usize, Arc<Module>> {
        let loaded = self.loaded.borrow();
        let found = loaded
            .iter()
            .filter_map(|(key, module)| Some((*self.module_places.get(key)?, module.clone().ok()?)));
        found.collect()
    }
}
