//! Gives device addresses to the buffers and acceleration structures of a scene.
//!
//! Automatic addresses follow the names of what has them, so that they do not depend on the order
//! of a file, on bindings or on what is included.

use std::sync::Arc;

use crate::ResolvedScene;
use crate::address_entry::AddressChoice;
use crate::addresses::Addresses;
use crate::read::{Diagnostics, Spanned, unknown_name};
use crate::resources::{BufferView, Resource};
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_base::sorted::{SortedMap, SortedSet};
use anyhit_engine::accel::Tlas;

/// What lies at addresses.
enum Target<'a> {
    Buffer(&'a AddressChoice, &'a Place),
    Structure(&'a Arc<Tlas>),
    /// What has no address, in words.
    Other(&'static str),
}

/// What the scene calls by a name: a resource, else an acceleration structure.
fn target<'a>(scene: &'a ResolvedScene, names: &Names<'a>, name: &str) -> Option<Target<'a>> {
    Some(match *names.0.get(name)? {
        Named::Unbound(at) => Target::Buffer(&scene.unbound[at].address, &scene.unbound[at].place),
        Named::Bound(at) => {
            let bound = &scene.resources[at];
            match &bound.resource {
                Resource::StorageBuffer(_) | Resource::UniformBuffer(_) => {
                    Target::Buffer(&bound.address, &bound.place)
                }
                Resource::AccelerationStructure(index) => Target::Structure(&scene.tlas[*index].1),
                Resource::BufferView(view) => return target(scene, names, &view.buffer),
                Resource::NullBuffer => Target::Other("a null buffer"),
                Resource::NullAccelerationStructure => Target::Other("a null acceleration structure"),
                Resource::Sampler(_) => Target::Other("a sampler"),
                Resource::TexelBuffer(_) => Target::Other("a texel buffer"),
                Resource::StorageImage(_)
                | Resource::SampledImage(_)
                | Resource::CombinedImageSampler(..) => Target::Other("an image"),
            }
        }
        Named::Tlas(at) => Target::Structure(&scene.tlas[at].1),
    })
}

#[derive(Clone, Copy)]
enum Named {
    Unbound(usize),
    Bound(usize),
    Tlas(usize),
}

/// Everything in a scene that `address_of` may name.
struct Names<'a>(SortedMap<&'a str, Named>);

impl<'a> Names<'a> {
    fn of(scene: &'a ResolvedScene) -> Self {
        let mut names = SortedMap::new();
        // A resource hides an acceleration structure of its name.
        names.extend(scene.tlas.iter().enumerate().map(|(at, (name, _))| (name.as_str(), Named::Tlas(at))));
        names.extend(
            scene.resources.iter().enumerate().map(|(at, one)| (one.name.as_str(), Named::Bound(at))),
        );
        names.extend(
            scene.unbound.iter().enumerate().map(|(at, one)| (one.name.as_str(), Named::Unbound(at))),
        );
        Self(names)
    }
}

/// Reports every address that is written of something that has none.
pub(super) fn check(scene: &ResolvedScene, report: &Diagnostics) {
    let names = Names::of(scene);
    for of in scene.address_targets() {
        let (name, span) = (&of.target.value, &of.target.span);
        match target(scene, &names, name) {
            None => {
                let has_address =
                    |name: &&str| !matches!(target(scene, &names, name), None | Some(Target::Other(_)));
                let message = format!("no buffer or acceleration structure is named `{name}`");
                let known = || names.0.keys().copied().filter(has_address);
                report.push(unknown_name(&of.target, message, "no such name", known));
            }
            Some(Target::Other(what)) => {
                let message =
                    format!("`{name}` is {what}: only buffers and acceleration structures have addresses");
                report.push(span.error(message));
            }
            Some(Target::Buffer(AddressChoice::Never, place)) => {
                let error = span.error(format!("`{name}` has no address: it sets `address = false`"));
                report.push(error.at_with(place.clone(), "declared here"));
            }
            Some(Target::Structure(_)) if of.offset.value != 0 => {
                report.push(
                    of.offset.span.error("the `offset` of an acceleration structure's address must be 0"),
                );
            }
            Some(Target::Buffer(..) | Target::Structure(_)) => {}
        }
    }
}

/// The error of a given address whose buffer overlaps another one.
fn overlap(
    given: &[(u64, u64, &str, &Place)],
    address: &Spanned<u64>,
    size: u64,
    name: &str,
) -> Option<Error> {
    let end = |start: u64, size: u64| start.saturating_add(size.max(1));
    let (start, last) = (address.value, end(address.value, size));
    let (other_start, other_size, other, place) =
        given.iter().find(|(start2, size2, ..)| start < end(*start2, *size2) && *start2 < last)?;
    let message = format!(
        "`{name}`, {size} bytes at {start:#x}, overlaps `{other}`, {other_size} bytes at {other_start:#x}"
    );
    Some(address.span.error(message).at_with((*place).clone(), "the other buffer"))
}

impl Addresses {
    /// Gives an address to every buffer that asks for one, and to what `address_of` names.
    ///
    /// # Errors
    /// Those of sizes, and given addresses that overlap, each at its place.
    pub fn assign(scene: &ResolvedScene, errors: &mut Vec<Error>) -> Self {
        let names = Names::of(scene);
        let targets = scene.address_targets();
        let mut wanted: SortedSet<&str> = targets.iter().map(|of| of.target.value.as_str()).collect();
        wanted.extend(scene.kept_addresses.iter().map(String::as_str));
        // A view has an address where its buffer has one.
        let views = scene.resources.iter().filter_map(|one| match &one.resource {
            Resource::BufferView(view) => Some((one.name.as_str(), view)),
            _ => None,
        });
        let views: Vec<(&str, &BufferView)> = views.collect();
        let buffers = views.iter().filter(|(name, _)| wanted.contains(name));
        let buffers: Vec<&str> = buffers.map(|(_, view)| view.buffer.as_str()).collect();
        wanted.extend(buffers);
        let mut all = Self::default();
        let mut given: Vec<(u64, u64, &str, &Place)> = Vec::new();
        let mut automatic: Vec<(&str, u64)> = Vec::new();
        for (&name, named) in &names.0 {
            let (data, choice) = match *named {
                Named::Unbound(at) => (&scene.unbound[at].data, &scene.unbound[at].address),
                Named::Bound(at) => match scene.resources[at].resource.data() {
                    Some(data) => (data, &scene.resources[at].address),
                    None => continue,
                },
                Named::Tlas(_) => continue,
            };
            let unbound = matches!(named, Named::Unbound(_));
            let has = match choice {
                AddressChoice::Never => false,
                AddressChoice::Unsaid => unbound || wanted.contains(name),
                AddressChoice::Automatic | AddressChoice::Given(_) => true,
            };
            if !has {
                continue;
            }
            let size = match data.size() {
                Ok(size) => size,
                Err(error) => {
                    errors.push(error);
                    continue;
                }
            };
            match choice {
                AddressChoice::Given(address) => {
                    let place = match *named {
                        Named::Unbound(at) => &scene.unbound[at].place,
                        Named::Bound(at) | Named::Tlas(at) => &scene.resources[at].place,
                    };
                    if let Some(error) = overlap(&given, address, size, name) {
                        errors.push(error);
                        continue;
                    }
                    given.push((address.value, size, name, place));
                }
                _ => automatic.push((name, size)),
            }
        }
        for (address, size, name, place) in given {
            match all.memory.reserve_at(address, name, size) {
                Ok(()) => drop(all.by_name.insert(name.to_string(), (address, size))),
                Err(message) => {
                    errors.push(Error::new(ErrorKind::InvalidScene, message).at(place.clone()));
                }
            }
        }
        for (name, size) in automatic {
            let address = all.memory.reserve(name, size);
            all.by_name.insert(name.to_string(), (address, size));
        }
        for (name, view) in views {
            if let Some(&(address, _)) = all.by_name.get(&view.buffer) {
                all.by_name.insert(name.to_string(), (address + view.start(), view.range));
            }
        }
        for name in wanted {
            if let Some(Target::Structure(tlas)) = target(scene, &names, name) {
                let address = all.memory.add_structure(tlas);
                all.by_name.insert(name.to_string(), (address, 0));
            }
        }
        all
    }
}
