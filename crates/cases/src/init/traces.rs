//! What shaders say of the shader binding table: offset, stride and miss index of their rays, where
//! these are constants.

use std::fmt::Write;

use crate::init::Shader;
use anyhit_base::sorted::SortedSet;
use anyhit_engine::ops::trace_operands::{TraceOperands, merge};

/// Records of one kind that a scene is written with at most.
const MOST: u64 = 16;

/// What a shader binding table needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BindingTable {
    /// Hit records of each instance, which has one geometry.
    pub records: usize,
    /// The records of an instance that have a group, each for rays of another SBT offset; the
    /// others are null.
    pub slots: Vec<usize>,
    /// The miss records: which of the miss shaders each has.
    pub miss: Vec<Option<usize>>,
    /// Why, in comments.
    pub comment: String,
}

impl BindingTable {
    /// The table for the rays of some shaders, with so many hit groups and miss shaders.
    pub(super) fn of(shaders: &[Shader], groups: usize, miss: usize) -> Self {
        let miss = (0..miss).map(Some).collect();
        let mut table = Self { records: 1, slots: vec![0], miss, comment: String::new() };
        let mut traces: Vec<(&str, TraceOperands)> = Vec::new();
        for (at, shader) in shaders.iter().enumerate() {
            // All functions of a module are looked at, once.
            let is_known = shaders[..at].iter().any(|one| std::ptr::eq(&*one.module, &*shader.module));
            if !is_known {
                traces.extend(
                    TraceOperands::all(&shader.module).map(|found| (shader.reference.as_str(), found)),
                );
            }
        }
        if traces.is_empty() {
            return table;
        }
        let offsets = merge(traces.iter().map(|(_, found)| found.sbt_offset.clone()));
        let strides = merge(traces.iter().map(|(_, found)| found.sbt_stride.clone()));
        let misses = merge(traces.iter().map(|(_, found)| found.miss_index.clone()));
        let (mut known, mut unknown) = (Vec::new(), Vec::new());
        for (name, values) in [("SBT offset", &offsets), ("SBT stride", &strides), ("miss index", &misses)] {
            match values {
                Some(values) => known.push(format!("{name} {}", list(values))),
                None => unknown.push(name),
            }
        }
        // Writing to a string does not fail.
        if !known.is_empty() {
            let _ = writeln!(table.comment, "# Rays are traced with {}.", known.join(", "));
        }
        if !unknown.is_empty() {
            let mut names: Vec<_> = traces.iter().map(|(name, _)| format!("`{name}`")).collect();
            names.dedup();
            let _ = writeln!(
                table.comment,
                "# {} of rays in {} are not constants: add the records that they select.",
                unknown.join(" and "),
                names.join(", ")
            );
        }
        let _ = writeln!(
            table.comment,
            "# A hit's record is the instance's sbt_offset + geometry index x SBT stride + SBT offset."
        );
        if let Some(slots) = offsets.as_ref().and_then(records) {
            table.records = slots.iter().max().map_or(1, |last| last + 1);
            // With fewer groups each is for the rays of the first offset.
            let is_whole = groups > 0 && groups.is_multiple_of(slots.len());
            table.slots = if is_whole { slots } else { vec![slots[0]] };
        }
        if let Some(slots) = misses.as_ref().and_then(records) {
            let last = slots.iter().max().map_or(0, |last| last + 1);
            if slots.len() == table.miss.len() {
                let shader = |record| slots.iter().position(|slot| *slot == record);
                table.miss = (0..last).map(shader).collect();
            } else if last > table.miss.len() {
                table.miss.resize(last, None);
            }
        }
        table
    }
}

/// The records with some numbers, ascending; `None` where there would be very many.
fn records(numbers: &SortedSet<u64>) -> Option<Vec<usize>> {
    let few = numbers.last().is_some_and(|last| *last < MOST);
    few.then(|| numbers.iter().map(|number| *number as usize).collect())
}

/// `0`, `0 and 1`, `0, 1 and 2`
fn list(values: &SortedSet<u64>) -> String {
    let words: Vec<_> = values.iter().map(u64::to_string).collect();
    match words.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => words.concat(),
    }
}
