//! Records of the shader binding table to which no ray or call of a pipeline's shaders can lead.
//!
//! A record is unreached where none of the constants that the shaders give as SBT offset, stride or
//! index selects it, on any geometry of the structures: then it was meant for another index. Where
//! an index is computed, any record may be meant, and nothing is reported. So it is of records
//! that a launch happens not to need.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::finding::{Finding, FindingKey, Findings};
use crate::levels::Levels;
use crate::possible_constants::PossibleConstants;
use crate::rule::{Level, traversal};
use anyhit_base::error::{Error, ErrorKind};
use anyhit_engine::accel::{RecordIndex, Tlas};
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::module::{Function, Id, Instruction, Opcode};
use anyhit_engine::pipeline::{Group, Pipeline, SbtRecord, source_file, source_line_of};
use anyhit_engine::program::Program;

/// How many instructions are named in a report.
const MAX_NAMED: usize = 4;

/// The instruction of a shader that selects records, and the constants that it gives.
#[derive(Clone, Debug)]
struct Selection {
    shader: ShaderIndex,
    /// The word of the instruction.
    word: u32,
    /// What of the table it selects.
    selected: Selected,
}

/// What an instruction selects records by; `None` where that is computed.
#[derive(Clone, Debug)]
enum Selected {
    /// A trace: SBT offsets, SBT strides and miss indices.
    Ray { offsets: Option<Vec<u32>>, strides: Option<Vec<u32>>, misses: Option<Vec<u32>> },
    /// A call: indices of callable records.
    Callable(Option<Vec<u32>>),
    /// Any hit record, as an instruction of hit objects does.
    AnyHit,
    /// Any miss record, as an instruction of hit objects does.
    AnyMiss,
}

/// A ray from the host: SBT offset, SBT stride and miss index.
pub type HostRay = [u32; 3];

/// Reports the records of a pipeline that neither its shaders nor rays from the host select, in any
/// of some structures.
pub fn check_records(
    pipeline: &Pipeline,
    structures: &[Arc<Tlas>],
    host_rays: &[HostRay],
    levels: &Levels,
) -> Findings {
    let mut findings = Findings::default();
    let rule = &traversal::SBT_RECORD_UNREACHED;
    let level = levels.of(rule);
    if level == Level::Allow {
        return findings;
    }
    let selections = selections(pipeline);
    let miss = |selection: &Selected| match selection {
        Selected::Ray { misses, .. } => misses.clone().map(|all| all.into_iter().map(miss_index).collect()),
        Selected::AnyMiss => None,
        _ => Some(Vec::new()),
    };
    let hit = |selection: &Selected| match selection {
        Selected::Ray { offsets, strides, .. } => {
            Some(hit_indices(structures, offsets.as_deref()?, strides.as_deref()?))
        }
        Selected::AnyHit => None,
        _ => Some(Vec::new()),
    };
    let callable = |selection: &Selected| match selection {
        Selected::Callable(indices) => indices.clone().map(|all| all.into_iter().map(u64::from).collect()),
        _ => Some(Vec::new()),
    };
    let host_hits =
        host_rays.iter().flat_map(|&[offset, stride, _]| hit_indices(structures, &[offset], &[stride]));
    let host_misses = host_rays.iter().map(|&[_, _, miss]| miss_index(miss));
    let tables = [
        Table { name: "hit", records: &pipeline.sbt.hit, selects: &hit, by_host: host_hits.collect() },
        Table { name: "miss", records: &pipeline.sbt.miss, selects: &miss, by_host: host_misses.collect() },
        Table {
            name: "callable",
            records: &pipeline.sbt.callable,
            selects: &callable,
            by_host: BTreeSet::new(),
        },
    ];
    for (number, table) in (0..).zip(&tables) {
        let Some(reached) = table.reached(&selections) else { continue };
        let unreached = table.unreached(pipeline, &reached);
        let Some(&first) = unreached.first() else { continue };
        let error = table.report(pipeline, &selections, &reached, &unreached);
        let shader = first_shader(pipeline, table.records, first).unwrap_or(ShaderIndex(u32::MAX));
        let key = FindingKey { rule: rule.id, places: [(shader, number), (shader, first as u32)] };
        let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
        findings.add(key, 1, Some(finding));
    }
    findings
}

/// A part of the shader binding table.
struct Table<'a> {
    name: &'static str,
    records: &'a [Option<SbtRecord>],
    /// The indices that an instruction selects; `None` for any.
    selects: &'a dyn Fn(&Selected) -> Option<Vec<u64>>,
    /// The indices that rays from the host select.
    by_host: BTreeSet<u64>,
}

impl Table<'_> {
    /// Whether an instruction selects records of this table.
    fn is_selected_by(&self, selection: &Selection) -> bool {
        match self.name {
            "callable" => matches!(selection.selected, Selected::Callable(_)),
            _ => matches!(selection.selected, Selected::Ray { .. }),
        }
    }

    /// The indices that shaders select; `None` where it may be any, or where no shader selects one.
    fn reached(&self, selections: &[Selection]) -> Option<BTreeSet<u64>> {
        let mut reached = self.by_host.clone();
        if !selections.iter().any(|selection| self.is_selected_by(selection)) {
            return None;
        }
        for selection in selections {
            reached.extend((self.selects)(&selection.selected)?);
        }
        Some(reached)
    }

    /// The records with a shader that are not reached, but for those that do what one does that is:
    /// a table may be filled up with one group.
    fn unreached(&self, pipeline: &Pipeline, reached: &BTreeSet<u64>) -> Vec<usize> {
        let is_reached = |at: usize| reached.contains(&(at as u64));
        let records = || self.records.iter().enumerate();
        let is_copy = |record: &SbtRecord| {
            let known = records().filter(|&(at, _)| is_reached(at)).filter_map(|(_, known)| known.as_ref());
            known.into_iter().any(|known| known.group == record.group && bytes(known) == bytes(record))
        };
        let unreached = records().filter_map(|(at, record)| {
            let record = record.as_ref().filter(|_| !is_reached(at))?;
            (shaders(pipeline.group_of(record)).next().is_some() && !is_copy(record)).then_some(at)
        });
        unreached.collect()
    }

    fn report(
        &self,
        pipeline: &Pipeline,
        selections: &[Selection],
        reached: &BTreeSet<u64>,
        unreached: &[usize],
    ) -> Error {
        let name = self.name;
        let list: Vec<String> = unreached.iter().map(|&at| self.describe(pipeline, at)).collect();
        let what = if name == "callable" { "call" } else { "ray" };
        let message = format!("no {what} leads to {name} record {}", list.join(" or "));
        let mut error = Error::new(ErrorKind::Finding, message);
        let mut named: Vec<&Selection> =
            selections.iter().filter(|selection| self.is_selected_by(selection)).collect();
        named.dedup_by_key(|selection| {
            (pipeline.programs[selection.shader.index()].module.words.as_ptr(), selection.word)
        });
        if let Some(first) = named.first() {
            let program = &pipeline.programs[first.shader.index()];
            error = program.place_at(first.word).into_iter().fold(error, Error::at);
        }
        for selection in named.iter().take(MAX_NAMED) {
            let program = &pipeline.programs[selection.shader.index()];
            let line = source_line_of(program, selection.word);
            let does = match &selection.selected {
                Selected::Callable(indices) => {
                    format!("executes callable record {}", numbers(indices.as_deref()))
                }
                Selected::Ray { misses, .. } if name == "miss" => {
                    format!("traces with miss index {}", numbers(misses.as_deref()))
                }
                Selected::Ray { offsets, strides, .. } => format!(
                    "traces with hit record = instance offset + geometry index * {} + {}",
                    numbers(strides.as_deref()),
                    numbers(offsets.as_deref())
                ),
                Selected::AnyHit | Selected::AnyMiss => continue,
            };
            error = error.note(format!("{} `{}`{line} {does}", program.stage.name(), program.name));
        }
        if named.len() > MAX_NAMED {
            error = error.note(format!("and {} more instructions", named.len() - MAX_NAMED));
        }
        let beyond = reached.iter().find(|&&index| index >= self.records.len() as u64);
        if let Some(index) = beyond {
            let count = self.records.len();
            let plural = if count == 1 { "" } else { "s" };
            error = error.note(format!(
                "{name} record {index} is beyond the end of the table of {count} record{plural}"
            ));
        }
        error
    }

    /// `2 (ClosestHit `plane`)`.
    fn describe(&self, pipeline: &Pipeline, at: usize) -> String {
        let group = self.records[at].as_ref().map(|record| pipeline.group_of(record));
        let shader = group.into_iter().flat_map(shaders).next();
        shader.map_or_else(
            || at.to_string(),
            |shader| {
                let program: &Program = &pipeline.programs[shader.index()];
                format!("{at} ({} `{}`{})", program.stage.name(), program.name, source_file(&program.module))
            },
        )
    }
}

/// The data of a record, without its handle.
fn bytes(record: &SbtRecord) -> Option<Vec<u8>> {
    record.data.as_ref().map(|data| data.bytes())
}

/// The shaders of a group, that of the closest hit first.
fn shaders(group: Group) -> impl Iterator<Item = ShaderIndex> {
    let all = match group {
        Group::General(shader) => [Some(shader), None, None],
        Group::Hit(group) => [group.closest_hit, group.any_hit, group.intersection],
    };
    all.into_iter().flatten()
}

fn first_shader(pipeline: &Pipeline, records: &[Option<SbtRecord>], at: usize) -> Option<ShaderIndex> {
    shaders(pipeline.group_of(records.get(at)?.as_ref()?)).next()
}

/// A list of numbers in words.
fn numbers(values: Option<&[u32]>) -> String {
    match values {
        None => "a computed number".into(),
        Some(values) => values.iter().map(u32::to_string).collect::<Vec<_>>().join(" or "),
    }
}

fn miss_index(operand: u32) -> u64 {
    RecordIndex::of_miss(operand).0
}

/// The hit records to which rays with these SBT offsets and strides can lead.
fn hit_indices(structures: &[Arc<Tlas>], offsets: &[u32], strides: &[u32]) -> Vec<u64> {
    // Instances differ in few offsets, and in few numbers of geometries.
    let instances = structures.iter().flat_map(|tlas| tlas.instances());
    let kinds: BTreeSet<(u32, usize)> =
        instances.map(|one| (one.sbt_record_offset, one.blas.geometries().len())).collect();
    let mut indices = BTreeSet::new();
    for (instance_offset, geometries) in kinds {
        for &stride in strides {
            // Every geometry leads to one record where the stride is 0.
            let count = if stride & 0xF == 0 { geometries.min(1) } else { geometries };
            for geometry in 0..count as u32 {
                let index = |&offset: &u32| {
                    RecordIndex::of_hit(instance_offset, geometry, stride & 0xF, offset & 0xF).0
                };
                indices.extend(offsets.iter().map(index));
            }
        }
    }
    indices.into_iter().collect()
}

/// The instructions of a pipeline's shaders that select records.
fn selections(pipeline: &Pipeline) -> Vec<Selection> {
    let mut selections = Vec::new();
    for (shader, program) in (0..).map(ShaderIndex).zip(&pipeline.programs) {
        let module = &*program.module;
        let mut entries = module.entry_points.iter();
        let entry = entries.find(|entry| entry.stage == program.stage && entry.name == program.name);
        let functions = entry.map(|entry| module.call_tree(entry.function)).unwrap_or_default();
        let functions = functions.into_iter().map(|function| &module.functions[function as usize]);
        let mut constants = None;
        for instruction in functions.flat_map(Function::instructions) {
            let constants =
                |id: u32| constants.get_or_insert_with(|| PossibleConstants::of(module)).values(Id(id));
            if let Some(selected) = selected(instruction, module.operands(instruction), constants) {
                selections.push(Selection { shader, word: instruction.offset, selected });
            }
        }
    }
    selections
}

/// What an instruction selects records by, if it does.
fn selected(
    instruction: &Instruction,
    operands: &[u32],
    mut constants: impl FnMut(u32) -> Option<Vec<u32>>,
) -> Option<Selected> {
    // The SBT offset follows the structure, the flags and the mask; a hit object precedes these.
    let first = match instruction.opcode {
        Opcode::TraceRayKHR | Opcode::TraceNV | Opcode::TraceRayMotionNV | Opcode::TraceMotionNV => 3,
        Opcode::HitObjectTraceRayEXT
        | Opcode::HitObjectTraceRayNV
        | Opcode::HitObjectTraceRayMotionEXT
        | Opcode::HitObjectTraceRayMotionNV
        | Opcode::HitObjectTraceReorderExecuteEXT
        | Opcode::HitObjectTraceMotionReorderExecuteEXT => 4,
        Opcode::ExecuteCallableKHR | Opcode::ExecuteCallableNV => {
            return Some(Selected::Callable(operands.first().and_then(|&index| constants(index))));
        }
        Opcode::HitObjectRecordHitNV
        | Opcode::HitObjectRecordHitWithIndexNV
        | Opcode::HitObjectRecordHitMotionNV
        | Opcode::HitObjectRecordHitWithIndexMotionNV
        | Opcode::HitObjectRecordFromQueryEXT
        | Opcode::HitObjectSetShaderBindingTableRecordIndexEXT => return Some(Selected::AnyHit),
        Opcode::HitObjectRecordMissEXT
        | Opcode::HitObjectRecordMissNV
        | Opcode::HitObjectRecordMissMotionEXT
        | Opcode::HitObjectRecordMissMotionNV => return Some(Selected::AnyMiss),
        _ => return None,
    };
    let mut operand = |at: usize| operands.get(at).and_then(|&id| constants(id));
    Some(Selected::Ray { offsets: operand(first), strides: operand(first + 1), misses: operand(first + 2) })
}
