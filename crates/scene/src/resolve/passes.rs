//! What a scene runs: its pipelines with their records, its dispatches and its passes.

use std::collections::HashMap;

use crate::descriptor_kind::DescriptorKind;
use crate::file::{GeneralEntry, HitEntry, PipelineEntry, RayEntry};
use crate::pass_entry::{DispatchEntry, PassEntry, PassKey, PassWorkEntry, SizeEntry};
use crate::read::{Spanned, unknown_name};
use crate::resolve::Resolver;
use crate::resolved::{
    IndirectSize, Rebinding, RebindingSource, ResolvedDispatch, ResolvedGroup, ResolvedHitGroup,
    ResolvedPass, ResolvedPassWork, ResolvedPipeline, ResolvedRecord, ResolvedShader, ShaderBindingTable,
};
use crate::resources::{Content, ResourceEntry};
use anyhit_base::error::Error;
use anyhit_base::error::names::list_of;
use anyhit_engine::machine::{LaunchFuel, LaunchLimits};
use anyhit_engine::reflect::lookup::DataBlock;

/// The shaders that a pipeline names.
fn shaders_of(entry: &PipelineEntry) -> impl Iterator<Item = Spanned<String>> {
    let general = [&entry.raygen, &entry.miss, &entry.callable];
    let general = general.into_iter().flatten().filter_map(|entry| entry.shader.as_ref());
    let hit = entry.hit.iter().flat_map(|entry| [&entry.closest_hit, &entry.any_hit, &entry.intersection]);
    general.chain(hit.flatten()).cloned()
}

impl Resolver<'_> {
    /// Resolves `[pipeline]` and the named pipelines.
    pub(super) fn all_pipelines(&mut self) -> (ResolvedPipeline, Vec<ResolvedPipeline>) {
        let own = self.pipeline.clone();
        let own = own.map_or_else(ResolvedPipeline::default, |entry| self.resolve_pipeline(&entry, None));
        let named: Vec<_> = self.pipelines.entries.clone();
        let named = named.into_iter().map(|entry| {
            let name = Some(entry.name.value);
            match &entry.content {
                Some(content) => self.resolve_pipeline(&content.0, name),
                None => ResolvedPipeline { name, ..ResolvedPipeline::default() },
            }
        });
        (own, named.collect())
    }

    /// Resolves the shader records, and with them the groups and modules.
    fn resolve_pipeline(&mut self, entry: &PipelineEntry, name: Option<String>) -> ResolvedPipeline {
        let first = self.groups.len();
        let mut general = |entries: &[GeneralEntry], kind: fn(ResolvedShader) -> ResolvedGroup| {
            entries.iter().map(|entry| self.general(entry, kind, first)).collect()
        };
        let raygen = general(&entry.raygen, ResolvedGroup::RayGeneration);
        let miss = general(&entry.miss, ResolvedGroup::Miss);
        let hit = entry.hit.iter().map(|entry| self.hit(entry, first)).collect();
        let mut general = |entries: &[GeneralEntry], kind: fn(ResolvedShader) -> ResolvedGroup| {
            entries.iter().map(|entry| self.general(entry, kind, first)).collect()
        };
        let callable = general(&entry.callable, ResolvedGroup::Callable);
        ResolvedPipeline {
            name,
            groups: self.groups[first..].to_vec(),
            sbt: ShaderBindingTable { raygen, miss, hit, callable },
            flags: entry.flags,
            max_recursion_depth: entry.max_recursion_depth,
            subgroup_size: entry.subgroup_size,
            max_callable_depth: entry.max_callable_depth,
            max_stack_size: entry.max_stack_size,
            fuel: entry.fuel,
            launch_limits: LaunchLimits {
                fuel: entry.launch_fuel.map(LaunchFuel::of),
                ..LaunchLimits::default()
            },
        }
    }

    /// The shaders that the scene's own push constants are for: those of launches and dispatches
    /// that give none of their own.
    pub(super) fn push_constant_readers(&self) -> Vec<Spanned<String>> {
        let mut readers = Vec::new();
        if self.passes.is_empty() {
            readers.extend(self.pipeline.iter().flat_map(shaders_of));
        }
        let mut dispatches: Vec<&DispatchEntry> = self.dispatches.iter().collect();
        for pass in &self.passes {
            match &pass.work {
                PassWorkEntry::Launch { push_constants: Some(_), .. } => {}
                PassWorkEntry::Launch { pipeline, .. } => {
                    readers.extend(self.pass_shaders(pipeline.as_ref()))
                }
                PassWorkEntry::Dispatch(entry) => dispatches.push(entry),
            }
        }
        let without_own = dispatches.into_iter().filter(|entry| entry.push_constants.is_none());
        readers.extend(without_own.map(|entry| entry.shader.clone()));
        readers
    }

    /// The shaders of the pipeline that a pass names.
    pub(super) fn pass_shaders(&self, pipeline: Option<&Spanned<String>>) -> Vec<Spanned<String>> {
        let entry = match pipeline {
            None => self.pipeline.as_ref(),
            Some(name) => {
                self.pipelines.get(&name.value).and_then(|entry| entry.content.as_ref()).map(|named| &named.0)
            }
        };
        entry.map_or_else(Vec::new, |entry| shaders_of(entry).collect())
    }

    pub(super) fn dispatches(&mut self) -> Vec<ResolvedDispatch> {
        let entries = std::mem::take(&mut self.dispatches);
        entries.iter().filter_map(|entry| self.dispatch(entry)).collect()
    }

    fn dispatch(&mut self, entry: &DispatchEntry) -> Option<ResolvedDispatch> {
        let shader = self.shader(&entry.shader)?;
        let own = [&entry.shader];
        let push_constants = entry.push_constants.as_ref();
        let push_constants = push_constants.map(|data| self.data(Some(data), DataBlock::PushConstants, &own));
        let (groups, indirect) = self.size(&entry.groups)?;
        Some(ResolvedDispatch { shader, groups, indirect, push_constants })
    }

    /// The size of a dispatch or launch, and where it is read if a buffer holds it; `None` where
    /// that is reported as a mistake.
    fn size(&self, entry: &SizeEntry) -> Option<([u32; 3], Option<IndirectSize>)> {
        let (buffer, offset) = match entry {
            SizeEntry::Given(size) => return Some((*size, None)),
            SizeEntry::InBuffer { buffer, offset } => (buffer, offset),
        };
        let found = self.find(&self.resource_entries, buffer, "resource")?;
        if class(found) != A_BUFFER || matches!(found.contents[..], [Content::Null(_)]) {
            let message =
                format!("`{}` is {}: a size can only be read from a buffer", buffer.value, class(found));
            self.report.push(buffer.span.error(message).at_with(found.span.place(), "declared here"));
            return None;
        }
        let place = offset.as_ref().map_or_else(|| buffer.span.place(), |offset| offset.span.place());
        let offset = match offset {
            Some(Spanned { value, span }) if !value.is_multiple_of(4) => {
                let message = format!("{value} is not a multiple of 4 bytes");
                self.report.push(span.error(message).note(
                    "VUID-vkCmdDispatchIndirect-offset-02710, \
                     VUID-vkCmdTraceRaysIndirectKHR-indirectDeviceAddress-03634",
                ));
                return None;
            }
            offset => offset.as_ref().map_or(0, |offset| offset.value),
        };
        let source = self.source_of(buffer, found);
        Some(([1; 3], Some(IndirectSize { buffer: buffer.value.clone(), source, offset, place })))
    }

    /// Where a resource is kept.
    fn source_of(&self, name: &Spanned<String>, entry: &ResourceEntry) -> RebindingSource {
        if is_unbound(entry) {
            return RebindingSource::Unbound(name.value.clone());
        }
        let kept = self.kept_places.get(&name.value);
        let [set, binding] = kept.map_or([entry.set, entry.binding], |kept| kept.at);
        RebindingSource::Bound([set, binding, entry.element])
    }

    /// Resolves the passes of `[[pass]]`; their dispatches are the scene's.
    pub(super) fn passes(
        &mut self,
        dispatches: &mut Vec<ResolvedDispatch>,
        pipelines: &[ResolvedPipeline],
    ) -> Vec<ResolvedPass> {
        let entries = std::mem::take(&mut self.passes);
        if let (Some(pass), false) = (entries.first(), dispatches.is_empty()) {
            let message = "`[[pass]]` and `[[dispatch]]` exclude each other: list dispatches as passes";
            self.report.push(pass.span.error(message));
        }
        self.check_pass_names(&entries);
        let mut passes = Vec::new();
        for entry in &entries {
            let rebindings = self.rebindings(entry);
            let work = match &entry.work {
                PassWorkEntry::Launch { pipeline, raygen, size, push_constants } => {
                    let push_constants = push_constants.as_ref().map(|data| {
                        let readers = self.pass_shaders(pipeline.as_ref());
                        let readers: Vec<_> = readers.iter().collect();
                        self.data(Some(data), DataBlock::PushConstants, &readers)
                    });
                    let Some(pipeline) = self.pass_pipeline(pipeline.as_ref(), pipelines) else { continue };
                    let Some(index) = self.raygen_record(entry, pipeline, raygen.as_ref()) else { continue };
                    let size = match size {
                        Some(size) => self.size(size),
                        None => {
                            self.note_default_launch(&format!(" of pass {}", passes.len()));
                            Some((self.launch, None))
                        }
                    };
                    let Some((size, indirect)) = size else { continue };
                    let indirect = indirect.map(Box::new);
                    ResolvedPassWork::Launch { pipeline, raygen: index, size, indirect, push_constants }
                }
                PassWorkEntry::Dispatch(entry) => {
                    let Some(dispatch) = self.dispatch(entry) else { continue };
                    dispatches.push(dispatch);
                    ResolvedPassWork::Dispatch(dispatches.len() - 1)
                }
            };
            let name = entry.name.as_ref().map(|name| name.value.clone());
            passes.push(ResolvedPass { name, rebindings, work });
        }
        passes
    }

    /// Reports names that mean two passes.
    fn check_pass_names(&self, entries: &[PassEntry]) {
        let mut known: HashMap<&str, &Spanned<String>> = HashMap::new();
        for name in entries.iter().filter_map(|entry| entry.name.as_ref()) {
            if name.value.parse::<usize>().is_ok() {
                let message =
                    format!("`{}` cannot name a pass: numbers are the indices of passes", name.value);
                self.report.push(name.span.error(message));
            }
            if let Some(other) = known.insert(&name.value, name) {
                let error = name.span.error(format!("two passes are named `{}`", name.value));
                self.report.push(error.at_with(other.span.place(), "the other one"));
            }
        }
    }

    /// The index of a named pipeline, `Some(None)` for `[pipeline]`; `None` for a name without a
    /// pipeline.
    fn pass_pipeline(
        &self,
        wanted: Option<&Spanned<String>>,
        pipelines: &[ResolvedPipeline],
    ) -> Option<Option<usize>> {
        let Some(wanted) = wanted else { return Some(None) };
        let found = pipelines.iter().position(|one| one.name.as_ref() == Some(&wanted.value));
        if found.is_none() {
            let names = || pipelines.iter().filter_map(|one| one.name.as_deref());
            let message = format!("no pipeline is named `{}`", wanted.value);
            self.report.push(unknown_name(wanted, message, "no `[pipelines]` table has this name", names));
        }
        found.map(Some)
    }

    /// The index of the ray generation record with a name, or with a shader of that name; the first
    /// where no name is given.
    fn raygen_record(
        &self,
        pass: &PassEntry,
        pipeline: Option<usize>,
        wanted: Option<&Spanned<String>>,
    ) -> Option<usize> {
        let entry = match pipeline {
            None => self.pipeline.as_ref(),
            // Mistakes of its own are reported already.
            Some(index) => Some(&self.pipelines.entries[index].content.as_ref()?.0),
        };
        let records = entry.map_or(&[][..], |entry| &entry.raygen[..]);
        let Some(wanted) = wanted else {
            if records.is_empty() {
                self.report.push(pass.span.error("the pipeline of this pass has no `raygen`"));
                return None;
            }
            return Some(0);
        };
        let shader = |record: &GeneralEntry| record.shader.as_ref().map(|shader| shader.value.clone());
        let named = records.iter().position(|record| record.name.as_ref() == Some(&wanted.value));
        let found = named
            .or_else(|| records.iter().position(|record| shader(record).as_ref() == Some(&wanted.value)));
        if found.is_none() {
            let names: Vec<String> =
                records.iter().filter_map(|record| record.name.clone().or_else(|| shader(record))).collect();
            let error = wanted.span.error(format!("the pipeline has no `raygen` named `{}`", wanted.value));
            self.report.push(match names.is_empty() {
                true => error,
                false => error.note(format!("available: {}", list_of(names.iter().map(String::as_str)))),
            });
        }
        found
    }

    /// What a pass finds instead of what is bound.
    fn rebindings(&self, entry: &PassEntry) -> Vec<Rebinding> {
        let all = entry.resources.iter();
        all.filter_map(|(at, source)| self.report.keep(self.rebinding(at, source)?)).collect()
    }

    /// `None` for a name without a resource, or one whose mistakes are reported already.
    fn rebinding(&self, at: &Spanned<String>, source: &Spanned<String>) -> Option<Result<Rebinding, Error>> {
        let find = |name: &Spanned<String>| self.find(&self.resource_entries, name, "resource");
        let (bound, other) = (find(at), find(source));
        let (bound, other) = (bound?, other?);
        if is_unbound(bound) {
            let message = format!("`{}` is not bound, so a pass cannot replace it", at.value);
            return Some(Err(at.span.error(message).note(
                "write the resource that shaders use to the left of `=`, its replacement to the right",
            )));
        }
        let (wanted, found) = (class(bound), class(other));
        if wanted == ARRAY {
            let message = format!("`{}` is {ARRAY}: a pass can replace only single descriptors", at.value);
            return Some(Err(at.span.error(message)));
        }
        if wanted != found {
            let message = format!("`{}` is {found}, but `{}` is {wanted}", source.value, at.value);
            return Some(Err(source.span.error(message).at_with(bound.span.place(), "bound here")));
        }
        let source = self.source_of(source, other);
        Some(Ok(Rebinding { at: [bound.set, bound.binding, bound.element], source }))
    }

    /// Checks that pixels are inside the launches that their rays are of, and that there are such
    /// launches.
    pub(super) fn check_rays(&self, passes: &[ResolvedPass], launches: bool, dispatches: usize) {
        for ray in &self.rays {
            let size = match ray.pass() {
                Some(key) => match self.launch_of_ray(key, passes, launches, dispatches) {
                    Ok(size) => size,
                    Err(error) => {
                        self.report.push(error);
                        continue;
                    }
                },
                None => passes.iter().find_map(launch_size).unwrap_or(self.launch),
            };
            // With `--size`, pixels of the scene's rays may be outside the launch.
            let RayEntry::Pixel { pixel: Spanned { value: [x, y], span }, .. } = ray else { continue };
            if self.options.size.is_none() && (*x >= size[0] || *y >= size[1]) {
                let [width, height, _] = size;
                self.report
                    .push(span.error(format!("pixel {x},{y} is outside the launch of {width} x {height}")));
            }
        }
    }

    /// The size of the launch that a ray names.
    fn launch_of_ray(
        &self,
        key: &Spanned<PassKey>,
        passes: &[ResolvedPass],
        launches: bool,
        dispatches: usize,
    ) -> Result<[u32; 3], Error> {
        if passes.is_empty() {
            let number = key.value.0.parse::<usize>();
            return match number {
                Ok(0) if launches => Ok(self.launch),
                Ok(number) if number < dispatches + usize::from(launches) => Err(no_launch(key)),
                _ => Err(key.span.error(format!("the scene has no pass `{}`", key.value))),
            };
        }
        let names = || passes.iter().map(|pass| pass.name.as_deref());
        match key.value.find(names()) {
            Some(at) => launch_size(&passes[at]).ok_or_else(|| no_launch(key)),
            None => {
                let error = key.span.error(format!("the scene has no pass `{}`", key.value));
                Err(error.note(PassKey::known(names())))
            }
        }
    }

    fn general(
        &mut self,
        entry: &GeneralEntry,
        kind: fn(ResolvedShader) -> ResolvedGroup,
        first: usize,
    ) -> ResolvedRecord {
        let shader = entry.shader.as_ref().and_then(|name| self.shader(name));
        let group = shader.map(|shader| self.group(kind(shader), first));
        let own: Vec<_> = entry.shader.iter().collect();
        let data = self.data(entry.record.as_ref(), DataBlock::ShaderRecord, &own);
        ResolvedRecord { name: entry.name.clone(), group, data }
    }

    fn hit(&mut self, entry: &HitEntry, first: usize) -> ResolvedRecord {
        let mut shader = |name: &Option<Spanned<String>>| name.as_ref().and_then(|name| self.shader(name));
        let (closest_hit, any_hit) = (shader(&entry.closest_hit), shader(&entry.any_hit));
        let intersection = shader(&entry.intersection);
        let some = closest_hit.is_some() || any_hit.is_some() || intersection.is_some();
        let group = some.then(|| {
            let group = ResolvedHitGroup { closest_hit, any_hit, intersection };
            self.group(ResolvedGroup::Hit(Box::new(group)), first)
        });
        let own = [&entry.closest_hit, &entry.any_hit, &entry.intersection];
        let own: Vec<_> = own.into_iter().flatten().collect();
        let data = self.data(entry.record.as_ref(), DataBlock::ShaderRecord, &own);
        ResolvedRecord { name: entry.name.clone(), group, data }
    }

    /// The index of a group in its pipeline, whose groups begin at `first`; it is added if it is
    /// new.
    fn group(&mut self, group: ResolvedGroup, first: usize) -> usize {
        self.groups[first..].iter().position(|known| *known == group).unwrap_or_else(|| {
            self.groups.push(group);
            self.groups.len() - 1 - first
        })
    }
}

/// The size of a pass that is a launch.
fn launch_size(pass: &ResolvedPass) -> Option<[u32; 3]> {
    match pass.work {
        ResolvedPassWork::Launch { size, .. } => Some(size),
        ResolvedPassWork::Dispatch(_) => None,
    }
}

fn no_launch(key: &Spanned<PassKey>) -> Error {
    let message = format!("pass `{}` dispatches a compute shader, but a ray needs a launch", key.value);
    key.span.error(message)
}

fn is_unbound(entry: &ResourceEntry) -> bool {
    matches!(entry.contents[..], [Content::Buffer(DescriptorKind::Unbound, _)])
}

const A_BUFFER: &str = "a buffer";

const ARRAY: &str = "an array of descriptors";

/// What a resource is: one of the same kind may stand in its descriptor. Whether an image is stored
/// to, sampled, or has a sampler beside it is a matter of the descriptor, which stays.
fn class(entry: &ResourceEntry) -> &'static str {
    let kind = match &entry.contents[..] {
        [Content::Buffer(kind, _) | Content::Image(kind, _) | Content::Null(kind)] => *kind,
        [Content::View(view)] => view.kind,
        [Content::Sampler(_)] => DescriptorKind::Sampler,
        [Content::AccelerationStructure(_)] => DescriptorKind::AccelerationStructure,
        _ => return ARRAY,
    };
    match kind {
        DescriptorKind::StorageBuffer
        | DescriptorKind::UniformBuffer
        | DescriptorKind::StorageBufferDynamic
        | DescriptorKind::UniformBufferDynamic
        | DescriptorKind::HeapData
        | DescriptorKind::PushConstantBank
        | DescriptorKind::Unbound => A_BUFFER,
        DescriptorKind::StorageImage
        | DescriptorKind::SampledImage
        | DescriptorKind::CombinedImageSampler => "an image",
        DescriptorKind::UniformTexelBuffer | DescriptorKind::StorageTexelBuffer => "a texel buffer",
        DescriptorKind::Sampler => "a sampler",
        DescriptorKind::AccelerationStructure => "an acceleration structure",
    }
}
