//! What a scene runs: the records of its shader binding table, its dispatches and its passes.

use crate::scene::file::{DispatchEntry, GeneralEntry, HitEntry, PassEntry};
use crate::scene::read::{Spanned, list_of};
use crate::scene::resolve::Resolver;
use crate::scene::resolved::{
    ResolvedDispatch, ResolvedGroup, ResolvedHitGroup, ResolvedPass, ResolvedRecord, ResolvedShader,
    ShaderBindingTable,
};
use crate::scene::struct_lookup::DataBlock;

impl Resolver<'_> {
    /// Resolves the shader records, and with them the groups and modules.
    pub(super) fn binding_table(&mut self) -> ShaderBindingTable {
        let Some(pipeline) = self.pipeline.clone() else { return ShaderBindingTable::default() };
        ShaderBindingTable {
            raygen: pipeline
                .raygen
                .iter()
                .map(|entry| self.general(entry, ResolvedGroup::RayGeneration))
                .collect(),
            miss: pipeline.miss.iter().map(|entry| self.general(entry, ResolvedGroup::Miss)).collect(),
            hit: pipeline.hit.iter().map(|entry| self.hit(entry)).collect(),
            callable: pipeline
                .callable
                .iter()
                .map(|entry| self.general(entry, ResolvedGroup::Callable))
                .collect(),
        }
    }

    /// The shaders that the scene's own push constants are for: those of the pipeline, and of
    /// dispatches that give none of their own.
    pub(super) fn push_constant_readers(&self) -> Vec<Spanned<String>> {
        let mut readers = Vec::new();
        if let Some(pipeline) = &self.pipeline {
            let general = [&pipeline.raygen, &pipeline.miss, &pipeline.callable];
            readers.extend(general.into_iter().flatten().filter_map(|entry| entry.shader.clone()));
            for entry in &pipeline.hit {
                let shaders = [&entry.closest_hit, &entry.any_hit, &entry.intersection];
                readers.extend(shaders.into_iter().flatten().cloned());
            }
        }
        let of_passes = self.passes.iter().filter_map(|pass| match &pass.value {
            PassEntry::Dispatch(entry) => Some(entry),
            PassEntry::Launch { .. } => None,
        });
        let dispatches = self.dispatches.iter().chain(of_passes);
        readers.extend(
            dispatches.filter(|entry| entry.push_constants.is_none()).map(|entry| entry.shader.clone()),
        );
        readers
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
        Some(ResolvedDispatch { shader, groups: entry.groups, push_constants })
    }

    /// Resolves the passes of `[[pass]]`; their dispatches are the scene's.
    pub(super) fn passes(&mut self, dispatches: &mut Vec<ResolvedDispatch>) -> Vec<ResolvedPass> {
        let entries = std::mem::take(&mut self.passes);
        if let (Some(pass), false) = (entries.first(), dispatches.is_empty()) {
            let message =
                "`[[pass]]` lists all launches and dispatches in order: there is no `[[dispatch]]` beside it";
            self.report.push(pass.span.error(message));
        }
        let mut passes = Vec::new();
        for entry in &entries {
            match &entry.value {
                PassEntry::Launch { raygen, size, push_constants } => {
                    let Some(index) = self.raygen_record(raygen) else { continue };
                    let push_constants = push_constants
                        .as_ref()
                        .map(|data| self.data(Some(data), DataBlock::PushConstants, &[]));
                    let size = size.unwrap_or(self.launch);
                    passes.push(ResolvedPass::Launch { raygen: index, size, push_constants });
                }
                PassEntry::Dispatch(entry) => {
                    let Some(dispatch) = self.dispatch(entry) else { continue };
                    passes.push(ResolvedPass::Dispatch(dispatches.len()));
                    dispatches.push(dispatch);
                }
            }
        }
        passes
    }

    /// The index of the ray generation record with a name, or with a shader of that name.
    fn raygen_record(&self, wanted: &Spanned<String>) -> Option<usize> {
        let records = self.pipeline.as_ref().map_or(&[][..], |pipeline| &pipeline.raygen[..]);
        let shader = |record: &GeneralEntry| record.shader.as_ref().map(|shader| shader.value.clone());
        let named = records.iter().position(|record| record.name.as_ref() == Some(&wanted.value));
        let found = named
            .or_else(|| records.iter().position(|record| shader(record).as_ref() == Some(&wanted.value)));
        if found.is_none() {
            let names: Vec<String> =
                records.iter().filter_map(|record| record.name.clone().or_else(|| shader(record))).collect();
            let error =
                wanted.span.error(format!("the pipeline has no `raygen` of the name `{}`", wanted.value));
            self.report.push(match names.is_empty() {
                true => error,
                false => error.note(format!("there are: {}", list_of(names.iter().map(String::as_str)))),
            });
        }
        found
    }

    fn general(&mut self, entry: &GeneralEntry, kind: fn(ResolvedShader) -> ResolvedGroup) -> ResolvedRecord {
        let shader = entry.shader.as_ref().and_then(|name| self.shader(name));
        let group = shader.map(|shader| self.group(kind(shader)));
        let own: Vec<_> = entry.shader.iter().collect();
        let data = self.data(entry.record.as_ref(), DataBlock::ShaderRecord, &own);
        ResolvedRecord { name: entry.name.clone(), group, data }
    }

    fn hit(&mut self, entry: &HitEntry) -> ResolvedRecord {
        let mut shader = |name: &Option<Spanned<String>>| name.as_ref().and_then(|name| self.shader(name));
        let (closest_hit, any_hit) = (shader(&entry.closest_hit), shader(&entry.any_hit));
        let intersection = shader(&entry.intersection);
        let some = closest_hit.is_some() || any_hit.is_some() || intersection.is_some();
        let group = some.then(|| {
            self.group(ResolvedGroup::Hit(Box::new(ResolvedHitGroup { closest_hit, any_hit, intersection })))
        });
        let own = [&entry.closest_hit, &entry.any_hit, &entry.intersection];
        let own: Vec<_> = own.into_iter().flatten().collect();
        let data = self.data(entry.record.as_ref(), DataBlock::ShaderRecord, &own);
        ResolvedRecord { name: entry.name.clone(), group, data }
    }

    /// The index of a group, which is added if it is new.
    fn group(&mut self, group: ResolvedGroup) -> usize {
        self.groups.iter().position(|known| *known == group).unwrap_or_else(|| {
            self.groups.push(group);
            self.groups.len() - 1
        })
    }
}
