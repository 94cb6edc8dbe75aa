//! Geometries, instances and the acceleration structures that they make.

use std::collections::HashMap;
use std::sync::Arc;

use crate::accel::{Blas, Geometry, Tlas, TlasInstance};
use crate::scene::geometry::InstanceEntry;
use crate::scene::read::Span;
use crate::scene::resolve::Resolver;

/// The instances of one TLAS; `None` where a BLAS could not be made.
struct Members<'a> {
    tlas: &'a str,
    placed: Vec<Option<Placed<'a>>>,
}

/// An instance and where it is written.
struct Placed<'a> {
    instance: TlasInstance,
    span: &'a Span,
}

impl Resolver<'_> {
    /// A BLAS for every list of geometries, a TLAS for every name. A name is there even where its
    /// structure could not be made, so that one mistake is not reported as another.
    pub(super) fn structures(&self) -> Vec<(String, Option<Arc<Tlas>>)> {
        let mut loaded: HashMap<&str, Option<Geometry>> = HashMap::new();
        let mut blases: HashMap<Vec<&str>, Option<Arc<Blas>>> = HashMap::new();
        let mut instances: Vec<Members<'_>> = Vec::new();
        let mut places: HashMap<&str, usize> = HashMap::new();
        for entry in &self.instances {
            let names: Vec<&str> = entry.geometry.iter().map(|name| name.value.as_str()).collect();
            if !blases.contains_key(&names) {
                let blas = self.blas(entry, &mut loaded);
                blases.insert(names.clone(), blas);
            }
            let placed = blases[&names].clone();
            let placed = placed.map(|blas| Placed { instance: entry.instance(blas), span: &entry.span });
            let at = *places.entry(&entry.tlas).or_insert_with(|| {
                instances.push(Members { tlas: &entry.tlas, placed: Vec::new() });
                instances.len() - 1
            });
            instances[at].placed.push(placed);
        }
        // A geometry that no instance shows may still hold a mistake.
        for entry in &self.geometry.entries {
            if let (Some(content), false) = (&entry.content, loaded.contains_key(entry.name.value.as_str())) {
                self.report.keep(content.load(self.files));
            }
        }
        let build = |members: Members<'_>| {
            let placed = members.placed.into_iter().collect::<Option<Vec<_>>>();
            (members.tlas.to_string(), placed.and_then(|placed| self.tlas(&placed)))
        };
        instances.into_iter().map(build).collect()
    }

    /// What the geometries of each instance of a TLAS are called.
    pub(super) fn geometry_names(&self, tlas: &str) -> Vec<Vec<String>> {
        let names = |entry: &InstanceEntry| entry.geometry.iter().map(|name| name.value.clone()).collect();
        self.instances.iter().filter(|entry| entry.tlas == tlas).map(names).collect()
    }

    fn tlas(&self, list: &[Placed<'_>]) -> Option<Arc<Tlas>> {
        let instances = list.iter().map(|placed| placed.instance.clone()).collect();
        let error = match Tlas::with_precision(instances, self.precision) {
            Ok(tlas) => return Some(tlas),
            Err(error) => error,
        };
        // A TLAS knows no lines: by itself, each wrong instance shows its own.
        let before = self.report.len();
        for Placed { instance, span } in list {
            if let Err(error) = Tlas::new(vec![instance.clone()]) {
                let message = error.message().trim_start_matches("instance 0: ");
                self.report.push(span.error(message));
            }
        }
        if self.report.len() == before {
            self.report.push(error);
        }
        None
    }

    fn blas<'s>(
        &'s self,
        entry: &'s InstanceEntry,
        loaded: &mut HashMap<&'s str, Option<Geometry>>,
    ) -> Option<Arc<Blas>> {
        let mut geometries = Vec::new();
        for name in &entry.geometry {
            let geometry = loaded.entry(name.value.as_str()).or_insert_with(|| {
                let found = self.find(&self.geometry, name, "geometry")?;
                self.report.keep(found.load(self.files))
            });
            // Each list holds its geometries by itself.
            let count = geometry.as_ref().map_or(0, |geometry| geometry.data.primitive_count());
            if let Err(error) = self.files.reserve_primitives(count as u64) {
                self.report.push(error.at(entry.span.place()));
                return None;
            }
            geometries.push(geometry.clone());
        }
        let geometries: Vec<Geometry> = geometries.into_iter().collect::<Option<_>>()?;
        let error = match Blas::new(geometries) {
            Ok(blas) => return Some(blas),
            Err(error) => error,
        };
        // A BLAS knows no lines, either; what is wrong with a geometry is reported once.
        let before = self.report.len();
        for name in &entry.geometry {
            let Some(geometry) = loaded.get_mut(name.value.as_str()) else { continue };
            let alone = geometry.clone().map(|geometry| Blas::new(vec![geometry]));
            let (Some(Err(error)), Some(found)) = (alone, self.find(&self.geometry, name, "geometry")) else {
                continue;
            };
            *geometry = None;
            self.report.push(found.span.error(error.message().trim_start_matches("geometry 0: ")));
        }
        if self.report.len() == before {
            self.report.push(error.at(entry.span.place()));
        }
        None
    }
}
