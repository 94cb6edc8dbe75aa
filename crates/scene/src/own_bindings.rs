//! Bindings of passes: which of several resources at one set and binding each of them finds.

use crate::ResolvedScene;
use crate::descriptors::{is_compatible, mismatch};
use crate::pass::OwnBinding;
use crate::resolved::{RebindingSource, ResolvedBinding};
use crate::resources::Resource;
use anyhit_base::error::names::list_of;
use anyhit_base::error::{Error, ErrorKind};
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::Binding;
use anyhit_engine::program::Program;
use anyhit_engine::program::descriptors::{DescriptorType, declared};

impl ResolvedBinding {
    /// Where its descriptor is kept.
    pub fn kept_at(&self) -> Binding {
        Binding { set: self.set, binding: self.binding }
    }

    /// Where shaders declare it.
    pub fn declared_at(&self) -> Binding {
        let [set, binding] = self.declared_at;
        Binding { set, binding }
    }
}

/// The resources that are bound together at one set and binding: the elements of one array.
struct Candidate<'s> {
    kept: Binding,
    elements: Vec<&'s ResolvedBinding>,
}

impl Candidate<'_> {
    /// The passes that it is for; `None` for all that no other is for.
    fn passes(&self) -> Option<&Vec<usize>> {
        self.elements[0].passes.as_ref()
    }

    fn is_compatible(&self, declared: &[DescriptorType]) -> bool {
        let fits = |one: &&ResolvedBinding| declared.iter().any(|ty| is_compatible(*ty, &one.resource));
        self.elements.iter().any(fits)
    }

    /// True if a descriptor is of a declared type, and not only of one that may stand there, too.
    fn is_of(&self, declared: &[DescriptorType]) -> bool {
        let own = |one: &&ResolvedBinding| own_type(&one.resource).is_some_and(|ty| declared.contains(&ty));
        self.elements.iter().any(own)
    }
}

/// The descriptor type of a resource, where it has one of its own.
fn own_type(resource: &Resource) -> Option<DescriptorType> {
    Some(match resource {
        Resource::StorageBuffer(_) => DescriptorType::StorageBuffer,
        Resource::UniformBuffer(_) => DescriptorType::UniformBuffer,
        Resource::StorageImage(_) => DescriptorType::StorageImage,
        Resource::SampledImage(_) => DescriptorType::SampledImage,
        Resource::Sampler(_) => DescriptorType::Sampler,
        Resource::CombinedImageSampler(..) => DescriptorType::CombinedImageSampler,
        Resource::BufferView(view) if view.kind.is_storage() => DescriptorType::StorageBuffer,
        Resource::BufferView(_) => DescriptorType::UniformBuffer,
        _ => return None,
    })
}

/// The sets and bindings that resources share, each with all of these.
fn shared_places(scene: &ResolvedScene) -> SortedMap<Binding, Vec<Candidate<'_>>> {
    let mut places: SortedMap<Binding, Vec<Candidate<'_>>> = SortedMap::new();
    for one in &scene.resources {
        let candidates = places.entry(one.declared_at()).or_default();
        match candidates.iter_mut().find(|candidate| candidate.kept == one.kept_at()) {
            Some(candidate) => candidate.elements.push(one),
            None => candidates.push(Candidate { kept: one.kept_at(), elements: vec![one] }),
        }
    }
    places.retain(|at, candidates| candidates.iter().any(|candidate| candidate.kept != *at));
    places
}

/// What each pass, given by its label and its programs, finds at the sets and bindings that
/// resources share.
///
/// Of the resources that are for the pass, or for all passes where none is, it finds the one that
/// its shaders declare. The errors are those of passes to which none or several fit.
pub(super) fn own_bindings(
    scene: &ResolvedScene,
    passes: &[(String, Vec<&Program>)],
) -> (Vec<Vec<OwnBinding>>, Vec<Error>) {
    let places = shared_places(scene);
    let mut errors = Vec::new();
    let mut all = Vec::new();
    for (number, (label, programs)) in passes.iter().enumerate() {
        let mut own = Vec::new();
        for (&at, candidates) in &places {
            match found_by(number, label, programs, at, candidates) {
                Ok(Some(kept)) if kept != at => own.push(OwnBinding { at, kept }),
                Ok(_) => {}
                Err(error) => errors.push(error),
            }
        }
        all.push(own);
    }
    if errors.is_empty() {
        errors.extend(places.iter().flat_map(|(&at, candidates)| unseen(scene, at, candidates, &all)));
    }
    (all, errors)
}

/// The errors for resources at a set and binding that no pass finds there, nor names.
fn unseen(
    scene: &ResolvedScene,
    at: Binding,
    candidates: &[Candidate<'_>],
    own: &[Vec<OwnBinding>],
) -> Vec<Error> {
    let found = |own: &Vec<OwnBinding>| own.iter().find(|own| own.at == at).map_or(at, |own| own.kept);
    let is_found =
        |one: &Candidate<'_>| one.passes().is_some() || own.iter().any(|own| found(own) == one.kept);
    let is_named = |one: &Candidate<'_>| {
        let named = scene.passes.iter().flat_map(|pass| &pass.rebindings).map(|rebinding| &rebinding.source);
        let mut named = named.filter_map(|source| match source {
            RebindingSource::Bound([set, binding, _]) => Some(Binding { set: *set, binding: *binding }),
            RebindingSource::Unbound(_) => None,
        });
        named.any(|named| named == one.kept)
    };
    let unseen = candidates.iter().filter(|one| !is_found(one) && !is_named(one));
    let error = |one: &Candidate<'_>| {
        let other = candidates.iter().find(|other| other.kept != one.kept).map(|other| other.elements[0]);
        let message = format!("two resources at {at}");
        let error = Error::new(ErrorKind::InvalidScene, message);
        let error = error.at_with(one.elements[0].place.clone(), "no pass uses this one");
        let error = match other {
            Some(other) => error.at_with(other.place.clone(), "the other one"),
            None => error,
        };
        error.note(
            "each pass uses the resource of the type that its shaders declare; assign resources \
            to passes with `passes`",
        )
    };
    unseen.map(error).collect()
}

/// Where the descriptors are kept that a pass finds at a set and binding; `None` where it finds
/// none.
fn found_by(
    pass: usize,
    label: &str,
    programs: &[&Program],
    at: Binding,
    candidates: &[Candidate<'_>],
) -> Result<Option<Binding>, Error> {
    let is_for_it = |one: &&Candidate<'_>| one.passes().is_some_and(|passes| passes.contains(&pass));
    let mut pool: Vec<&Candidate<'_>> = candidates.iter().filter(is_for_it).collect();
    if pool.is_empty() {
        pool.extend(candidates.iter().filter(|one| one.passes().is_none()));
    }
    let readers = || programs.iter().filter(|program| program.bindings().any(|one| one == at));
    let mut types: Vec<DescriptorType> = Vec::new();
    for ty in readers().flat_map(|program| declared(&program.module, at)) {
        if !types.contains(&ty) {
            types.push(ty);
        }
    }
    let first = pool.first().map(|one| one.kept);
    let Some(reader) = readers().next().filter(|_| !types.is_empty() && first.is_some()) else {
        return Ok(first);
    };
    let fitting: Vec<&Candidate<'_>> = pool.iter().copied().filter(|one| one.is_compatible(&types)).collect();
    let exact: Vec<&Candidate<'_>> = fitting.iter().copied().filter(|one| one.is_of(&types)).collect();
    match (&fitting[..], &exact[..]) {
        ([one], _) | (_, [one]) => Ok(Some(one.kept)),
        ([], _) => Err(mismatch(reader, at, pool[0].elements[0])),
        _ => {
            let names = list_of(fitting.iter().map(|one| one.elements[0].name.as_str()));
            let message = format!("{names} are all bound at {at} of pass {label}");
            let [first, second] = [fitting[0], fitting[1]].map(|one| one.elements[0].place.clone());
            Err(Error::new(ErrorKind::InvalidScene, message)
                .at(second)
                .at_with(first, "the other one")
                .note("assign each resource to passes with `passes`"))
        }
    }
}
