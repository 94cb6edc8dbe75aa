//! Geometries, instances and the acceleration structures that they make.

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use smallvec::SmallVec;

use crate::geometry::GeometryEntry;
use crate::instance_entry::InstanceEntry;
use crate::mesh::listed::AnimationTime;
use crate::mesh::model::MeshFormat;
use crate::models::Expanded;
use crate::resolve::Resolver;
use anyhit_base::threads::map_on_threads;
use anyhit_engine::accel::{Blas, Geometry, Tlas, TlasInstance};

/// The instances of one TLAS.
struct TlasMembers<'a> {
    tlas: &'a str,
    entries: Vec<&'a InstanceEntry>,
    /// Those of the entries; `None` where a BLAS could not be made.
    instances: Option<Vec<TlasInstance>>,
}

/// Names of geometries; most instances have one.
type GeometryNames<'a> = SmallVec<[&'a str; 1]>;

/// The names of the geometries of an instance.
fn names_of(entry: &InstanceEntry) -> GeometryNames<'_> {
    entry.geometry.iter().map(|name| name.value.as_str()).collect()
}

/// A geometry that a BLAS names.
enum Loaded {
    /// It is valid, as far as it is known, and later BLASes name it, too.
    Stored(Box<Geometry>),
    /// The last BLAS that names it has taken it.
    Taken,
    /// What is wrong with it was reported.
    Refused,
}

/// The geometries of BLASes, by name.
#[derive(Default)]
struct LoadedGeometries<'a> {
    loaded: HashMap<&'a str, Loaded>,
    /// How often BLASes that are not made yet name each.
    uses: HashMap<&'a str, usize>,
}

impl<'a> LoadedGeometries<'a> {
    /// Takes a geometry for a BLAS, which `load` makes if it is not loaded yet; `None` where it
    /// cannot be made. It is copied only for BLASes that come later.
    fn take(&mut self, name: &'a str, load: impl FnOnce() -> Option<Geometry>) -> Option<Geometry> {
        let uses = self.uses.entry(name).or_default();
        *uses = uses.saturating_sub(1);
        let entry = self
            .loaded
            .entry(name)
            .or_insert_with(|| load().map_or(Loaded::Refused, |geometry| Loaded::Stored(Box::new(geometry))));
        match entry {
            Loaded::Stored(geometry) if *uses > 0 => Some((**geometry).clone()),
            Loaded::Stored(_) => match std::mem::replace(entry, Loaded::Taken) {
                Loaded::Stored(geometry) => Some(*geometry),
                Loaded::Taken | Loaded::Refused => None,
            },
            Loaded::Taken | Loaded::Refused => None,
        }
    }

    /// Whether a geometry was refused before; it is from now on.
    fn refuse(&mut self, name: &'a str) -> bool {
        matches!(self.loaded.insert(name, Loaded::Refused), Some(Loaded::Refused))
    }
}

impl Resolver<'_> {
    /// Makes geometries and instances of models: instances after those that the scene lists.
    pub(super) fn expand_models(&mut self) {
        self.open_on_threads();
        let mut expanded = Expanded::default();
        let is_taken = |name: &str| self.geometry.get(name).is_some();
        for entry in &self.models {
            expanded.add(entry, &self.open_models, self.files, self.report, &is_taken);
        }
        self.geometry.merge(expanded.geometries);
        self.instances.extend(expanded.instances);
        self.mesh_names = expanded.names;
        for entry in &self.geometry.entries {
            let name = &entry.name.value;
            let content = entry.content.as_ref();
            let selection =
                content.and_then(|content| content.selection(name, self.files, &self.open_models));
            self.mesh_names.extend(selection.map(|selection| (name.clone(), selection)));
        }
    }

    /// Opens the mesh files at the same time, where there are several. Errors are reported where
    /// the files are used.
    fn open_on_threads(&self) {
        let models = self.models.iter().filter_map(|entry| {
            let format = MeshFormat::of(Path::new(&entry.file.value))?;
            Some((format, &entry.file, entry.time.as_ref()))
        });
        let contents = self.geometry.entries.iter().filter_map(|entry| entry.content.as_ref());
        let mut opened = HashSet::new();
        let others = contents.filter_map(GeometryEntry::mesh_file).map(|(format, file)| (format, file, None));
        let all = models.chain(others);
        let files: Vec<_> = all
            .filter(|(_, file, time)| opened.insert((&file.value, time.map(AnimationTime::key))))
            .collect();
        let (models, source) = (&self.open_models, self.files);
        if files.len() > 1 {
            map_on_threads(files.len(), |at| {
                let (format, file, time) = files[at];
                drop(models.open_as(format, file, time, source));
            });
        }
    }

    /// Loads the geometries of instances that are read from files at the same time, where there are
    /// several: those that can be loaded, by their names. Errors are reported where the others are
    /// used.
    fn load_on_threads(&self) -> HashMap<&str, Loaded> {
        let mut used = HashSet::new();
        let names = self.instances.iter().flat_map(|entry| entry.geometry.iter());
        let names = names.map(|name| name.value.as_str()).filter(|name| used.insert(*name));
        let from_files: Vec<_> = names
            .filter_map(|name| Some((name, self.geometry.get(name)?.content.as_ref()?)))
            .filter(|(_, content)| content.is_part() || content.has_files())
            .collect();
        if from_files.len() < 2 {
            return HashMap::new();
        }
        let (models, files) = (&self.open_models, self.files);
        let loaded = map_on_threads(from_files.len(), |at| from_files[at].1.load(files, models).ok());
        let loaded = from_files.iter().zip(loaded);
        loaded
            .filter_map(|((name, _), geometry)| Some((*name, Loaded::Stored(Box::new(geometry?)))))
            .collect()
    }

    /// Builds a BLAS for every list of geometries, and a TLAS for every name. A name without a
    /// structure is in the list, too, so that its error is not reported as an unknown name.
    pub(super) fn structures(&self) -> Vec<(String, Option<Arc<Tlas>>)> {
        let mut geometries =
            LoadedGeometries { loaded: self.load_on_threads(), ..LoadedGeometries::default() };
        let lists: HashSet<GeometryNames<'_>> = self.instances.iter().map(names_of).collect();
        lists.iter().flatten().for_each(|name| *geometries.uses.entry(name).or_default() += 1);
        drop(lists);
        let mut blases: HashMap<GeometryNames<'_>, Option<Arc<Blas>>> = HashMap::new();
        let mut instances: Vec<TlasMembers<'_>> = Vec::new();
        let mut places: HashMap<&str, usize> = HashMap::new();
        for entry in &self.instances {
            let names = names_of(entry);
            if !blases.contains_key(&names) {
                let blas = self.blas(entry, &mut geometries);
                blases.insert(names.clone(), blas);
            }
            let at = *places.entry(entry.tlas()).or_insert_with(|| {
                let (tlas, entries) = (entry.tlas(), Vec::new());
                instances.push(TlasMembers { tlas, entries, instances: Some(Vec::new()) });
                instances.len() - 1
            });
            let members = &mut instances[at];
            members.entries.push(entry);
            match (&mut members.instances, &blases[&names]) {
                (Some(list), Some(blas)) => list.push(entry.instance(blas.clone())),
                _ => members.instances = None,
            }
        }
        // Geometries without instances are loaded to report their errors.
        for entry in &self.geometry.entries {
            if let (Some(content), false) =
                (&entry.content, geometries.loaded.contains_key(entry.name.value.as_str()))
                && !content.is_part()
            {
                self.report.keep(content.load(self.files, &self.open_models));
            }
        }
        let build = |members| {
            let TlasMembers { tlas, entries, instances } = members;
            let of = |entry| blases.get(&names_of(entry)).cloned().flatten();
            (tlas.to_string(), instances.and_then(|instances| self.tlas(instances, &entries, &of)))
        };
        instances.into_iter().map(build).collect()
    }

    /// The names of the geometries of each instance of a TLAS.
    pub(super) fn geometry_names(&self, tlas: &str) -> Vec<Arc<[String]>> {
        // Many instances share one list.
        let mut known: HashMap<GeometryNames<'_>, Arc<[String]>> = HashMap::new();
        let mut names = |entry| {
            let list = known.entry(names_of(entry));
            list.or_insert_with_key(|names| names.iter().map(|name| (*name).to_owned()).collect()).clone()
        };
        self.instances.iter().filter(|entry| entry.tlas() == tlas).map(&mut names).collect()
    }

    /// Makes a TLAS of the instances of entries; `blas_of` gives the BLAS of each.
    fn tlas<'s>(
        &self,
        instances: Vec<TlasInstance>,
        entries: &[&'s InstanceEntry],
        blas_of: &dyn Fn(&'s InstanceEntry) -> Option<Arc<Blas>>,
    ) -> Option<Arc<Tlas>> {
        let error = match Tlas::with_precision(instances, self.precision) {
            Ok(tlas) => return Some(tlas),
            Err(error) => error,
        };
        // The error of a TLAS has no span: each instance is built by itself to find the wrong ones.
        let before = self.report.len();
        for entry in entries {
            let Some(blas) = blas_of(entry) else { continue };
            if let Err(error) = Tlas::new(vec![entry.instance(blas)]) {
                let message = error.message().trim_start_matches("instance 0: ");
                self.report.push(entry.span.error(message));
            }
        }
        if self.report.len() == before {
            self.report.push(error);
        }
        None
    }

    fn blas<'s>(&'s self, entry: &'s InstanceEntry, loaded: &mut LoadedGeometries<'s>) -> Option<Arc<Blas>> {
        let mut geometries = Vec::with_capacity(entry.geometry.len());
        for name in entry.geometry.iter() {
            let geometry = loaded.take(name.value.as_str(), || {
                let found = self.find(&self.geometry, name, "geometry")?;
                self.report.keep(found.load(self.files, &self.open_models))
            });
            // Each list holds its geometries by itself.
            let count = geometry.as_ref().map_or(0, |geometry| geometry.data.primitive_count());
            if let Err(error) = self.files.reserve_primitives(count as u64) {
                self.report.push(error.at(entry.span.place()));
                return None;
            }
            geometries.push(geometry);
        }
        let geometries: Vec<Geometry> = geometries.into_iter().collect::<Option<_>>()?;
        let Err(error) = Blas::check(&geometries) else { return Some(Blas::of_checked(geometries)) };
        // The error of a BLAS has no span either; each wrong geometry is reported once.
        let before = self.report.len();
        for (name, geometry) in entry.geometry.iter().zip(&geometries) {
            let single = Blas::check(std::slice::from_ref(geometry));
            let (Err(error), Some(found)) = (single, self.find(&self.geometry, name, "geometry")) else {
                continue;
            };
            if !loaded.refuse(name.value.as_str()) {
                self.report.push(found.span.error(error.message().trim_start_matches("geometry 0: ")));
            }
        }
        if self.report.len() == before {
            self.report.push(error.at(entry.span.place()));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::files::EmbeddedFiles;
    use crate::resolve::{LoadOptions, load_text};
    use crate::resolved::ResolvedScene;
    use anyhit_base::error::Result;
    use anyhit_engine::accel::Primitive;

    /// So many spheres side by side, each an instance of its own geometry, as a text of several
    /// pieces.
    fn text(count: usize) -> String {
        let geometry = |at| {
            format!("[geometry.g{at}]\ntype = \"spheres\"\npositions = [[{at}.5, 0, 0]]\nradii = [0.25]\n")
        };
        let instance = |at| format!("[[instance]]\ngeometry = \"g{at}\"\ncustom_index = {at}\n");
        let geometries: String = (0..count).map(geometry).collect();
        format!("version = 1\n{geometries}{}", (0..count).map(instance).collect::<String>())
    }

    fn load(text: &str) -> Result<ResolvedScene> {
        load_text(Path::new("s.toml"), text, &EmbeddedFiles(&[]), &LoadOptions::default())
    }

    #[test]
    fn a_large_scene_has_every_geometry_and_instance() {
        let count = 4000;
        let text = text(count);
        assert!(text.len() > 1 << 18);
        let scene = load(&text).unwrap();
        let (_, tlas) = &scene.tlas[0];
        assert_eq!((tlas.instances().len(), scene.geometry_names[0].len()), (count, count));
        for (at, (instance, names)) in tlas.instances().iter().zip(&scene.geometry_names[0]).enumerate() {
            assert_eq!((instance.custom_index as usize, &names[..]), (at, &[format!("g{at}")][..]));
            let sphere = Primitive::Sphere { position: [at as f32 + 0.5, 0.0, 0.0], radius: 0.25 };
            assert_eq!(instance.blas.primitive(0, 0, 0.0), Some(sphere));
        }
        assert_eq!(scene.document.source().text[..], text);
    }

    #[test]
    fn mistakes_of_a_large_scene_are_shown_where_they_are() {
        let text = text(4000);
        for (from, to, message) in [
            ("custom_index = 3210\n", "custom_index = 99999999\n", "24 bits"),
            ("\"g3210\"", "\"h\"", "no geometry is named `h`"),
            ("[[instance]]\ngeometry = \"g3210\"", "[[instance]]\nx = = \"g3210\"", "not TOML"),
            ("[geometry.g3210]", "[geometry.g321]", "duplicate key"),
        ] {
            let broken = text.replacen(from, to, 1);
            assert_ne!(broken, text);
            let error = load(&broken).unwrap_err().render();
            let line = text[..text.find(from).unwrap()].matches('\n').count() + 1;
            let line = line + from.matches('\n').count() * usize::from(from.starts_with('['));
            assert!(error.contains(message), "{error}");
            assert!(error.contains(&format!("s.toml:{line}:")), "line {line}: {error}");
        }
    }
}
