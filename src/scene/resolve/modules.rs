//! The modules whose structs lay out a scene's data, loaded when data asks for them.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use crate::error::Result;
use crate::module::Module;
use crate::scene::assemble;
use crate::scene::file::ShaderEntry;
use crate::scene::files::SceneFiles;
use crate::scene::read::{Spanned, list_of, nearest};
use crate::scene::resolve::Resolver;
use crate::scene::struct_data::ShaderModules;

/// The shaders of a scene as modules.
pub(super) struct SceneModules<'r, 'a> {
    pub resolver: &'r Resolver<'a>,
    /// The shaders that the data is for; all of the scene where there is none.
    pub own: &'r [&'r Spanned<String>],
}

impl ShaderModules for SceneModules<'_, '_> {
    fn module(&self, shader: &Spanned<String>) -> Result<Arc<Module>> {
        let entries = &self.resolver.shader_entries;
        let without_entry = || Some(shader.value.rsplit_once(':')?.0);
        let found = entries.get(&shader.value).or_else(|| entries.get(without_entry()?));
        if let Some(entry) = found.and_then(|entry| entry.content.as_ref()) {
            return self.resolver.loaded_module(&shader.value, entry);
        }
        let names = || entries.entries.iter().map(|entry| entry.name.value.as_str());
        let label = match nearest(&shader.value, names()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "no such name".to_owned(),
        };
        let error = shader.span.error_with(format!("no shader is named `{}`", shader.value), label);
        Err(error.note(format!("there are: {}", list_of(names()))))
    }

    fn all(&self) -> Result<Vec<Arc<Module>>> {
        if !self.own.is_empty() {
            return self.own.iter().map(|shader| self.module(shader)).collect();
        }
        let resolver = self.resolver;
        let used = |entry: &&ShaderEntry| {
            let file = entry.path.as_ref().or(entry.source.as_ref());
            file.is_some_and(|file| {
                resolver.module_places.contains_key(&file.span.source.sibling(&file.value))
            })
        };
        let entries = resolver.shader_entries.entries.iter().filter_map(|entry| entry.content.as_ref());
        entries.filter(used).map(|entry| resolver.loaded_module("shader", entry)).collect()
    }
}

impl Resolver<'_> {
    /// The module of a shader, with the shader's specialization.
    fn loaded_module(&self, name: &str, entry: &ShaderEntry) -> Result<Arc<Module>> {
        let file = entry.path.as_ref().or(entry.source.as_ref());
        let path = file.map_or_else(Default::default, |file| file.span.source.sibling(&file.value));
        let known = self.loaded.borrow().get(&path).cloned();
        let module = known.unwrap_or_else(|| {
            let module = self.load_module(name, entry, &path);
            self.loaded.borrow_mut().insert(path.clone(), module.clone());
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

    fn load_module(&self, name: &str, entry: &ShaderEntry, path: &Path) -> Result<Arc<Module>> {
        let files = SceneFiles { limits: self.files.limits(), root: self.files.root().cloned() };
        let load = |module| assemble::read(module, &files).map(Arc::new);
        if let Some(&index) = self.module_places.get(path) {
            return load(&self.modules[index]);
        }
        let module = self.read_module(name, entry).unwrap_or_else(|| {
            Err(entry.span.error("a shader needs the `path` of its .spv file, or its `source`"))
        });
        load(&module?)
    }

    /// The modules that are loaded, by their indices.
    pub(super) fn loaded_modules(&self) -> HashMap<usize, Arc<Module>> {
        let loaded = self.loaded.borrow();
        let found = loaded
            .iter()
            .filter_map(|(path, module)| Some((*self.module_places.get(path)?, module.clone().ok()?)));
        found.collect()
    }
}
