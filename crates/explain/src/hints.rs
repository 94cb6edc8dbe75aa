//! Known reasons of surprise, each shown by facts of the transcript.

use rustc_hash::FxHashMap;

use crate::summary_words::{label, primitive};
use crate::transcript::{
    ExitKind, Hint, HintKind, InstanceReport, MemoryChange, PrimitiveOutcome, RecordChoice, ShaderRun, Step,
    Trace, Traversal,
};
use crate::traversal_hints::{time_lost, undecided_candidates, world_ray};
use crate::walk::{self, AnyRay, PlacedRay};
use anyhit_base::count::grouped;
use anyhit_engine::reflect::value::{FloatValue, TypedValue};

/// How many hints of one kind are told.
const MAX_OF_A_KIND: usize = 3;

/// A rule about one ray: the hint in words, where it applies.
type RayRule = fn(&PlacedRay<'_, '_>) -> Option<String>;

/// The rules, by the kind of their hints.
const RAY_RULES: &[(HintKind, RayRule)] = &[
    (HintKind::SelfIntersection, self_intersection),
    (HintKind::StartsOnSurface, starts_on_surface),
    (HintKind::EmptyStructure, empty_structure),
    (HintKind::EmptyCullMask, empty_cull_mask),
    (HintKind::AllMasked, all_masked),
    (HintKind::OnlyOutsideInterval, only_outside_interval),
    (HintKind::AllCulled, all_culled),
    (HintKind::AllIgnored, all_ignored),
    (HintKind::NoRecord, no_record),
    (HintKind::DirectionLength, direction_length),
    (HintKind::NormalAlongRay, normal_along_ray),
    (HintKind::UndecidedCandidates, undecided_candidates),
    (HintKind::WorldRay, world_ray),
    (HintKind::TimeLost, time_lost),
];

/// The hints on what happened from a step on, and on what it changed in memory.
pub fn hints(root: &Step, writes: &[MemoryChange]) -> Vec<Hint> {
    let mut found: Vec<(HintKind, Vec<String>)> =
        RAY_RULES.iter().map(|(kind, _)| (*kind, Vec::new())).collect();
    walk::for_each_ray(root, &mut |ray| {
        for ((_, texts), (_, rule)) in found.iter_mut().zip(RAY_RULES) {
            texts.extend(rule(&ray).map(|hint| format!("{}: {hint}", place(ray.ray))));
        }
    });
    let mut hints: Vec<Hint> = found.into_iter().flat_map(|(kind, texts)| limited(kind, texts)).collect();
    hints.extend(limited(HintKind::NanWritten, nans(root, writes)));
    hints
}

/// The first hints of a kind; the last one says how many there are more. Those that are the same
/// are told once.
fn limited(kind: HintKind, texts: Vec<String>) -> Vec<Hint> {
    let mut counted: Vec<(String, usize)> = Vec::new();
    let mut places: FxHashMap<String, usize> = FxHashMap::default();
    for text in texts {
        match places.get(&text) {
            Some(&at) => counted[at].1 += 1,
            None => {
                places.insert(text.clone(), counted.len());
                counted.push((text, 1));
            }
        }
    }
    let more = counted.len().saturating_sub(MAX_OF_A_KIND);
    counted.truncate(MAX_OF_A_KIND);
    let mut hints: Vec<Hint> = counted
        .into_iter()
        .map(|(text, count)| {
            let times = if count > 1 { format!(" ({} times)", grouped(count)) } else { String::new() };
            Hint { kind, text: text + &times }
        })
        .collect();
    if more > 0
        && let Some(last) = hints.last_mut()
    {
        last.text += &format!(" (and {} more of this kind)", grouped(more));
    }
    hints
}

/// Which ray: its depth and line.
fn place(ray: AnyRay<'_>) -> String {
    let what = match ray {
        AnyRay::Trace(trace) => format!("ray at depth {}", trace.depth),
        AnyRay::Query(_) => "ray query".to_owned(),
    };
    match &ray.traversal().called_at {
        Some(line) => format!("{what}, {}:{}", line.file, line.line),
        None => what,
    }
}

fn self_intersection(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let before = placed.from.hit_again_by(placed.ray)?;
    let hit = placed.ray.hit()?;
    Some(format!(
        "it hits its starting primitive ({}) again, at t {}, where the previous ray hit it at t {}; \
         a larger tMin, or an origin offset along the normal, avoids this",
        primitive(hit),
        hit.t,
        before.t
    ))
}

fn starts_on_surface(placed: &PlacedRay<'_, '_>) -> Option<String> {
    if placed.ray.traversal().t_min.as_f64() != 0.0 || self_intersection(placed).is_some() {
        return None;
    }
    let from = placed.from.at_origin(placed.ray)?;
    Some(format!(
        "it starts at the hit point of the previous ray on {}, with tMin 0: because of rounding, it may \
         hit the same surface again",
        primitive(from)
    ))
}

fn empty_structure(placed: &PlacedRay<'_, '_>) -> Option<String> {
    placed
        .ray
        .traversal()
        .instances
        .is_empty()
        .then(|| "the acceleration structure has no instances".to_owned())
}

fn empty_cull_mask(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let traversal = placed.ray.traversal();
    let is_empty = traversal.cull_mask & 0xFF == 0 && !traversal.instances.is_empty();
    is_empty.then(|| {
        format!("the low 8 bits of its cull mask {:#x} are 0, so it hits no instance", traversal.cull_mask)
    })
}

fn all_masked(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let Traversal { cull_mask, instances, .. } = placed.ray.traversal();
    let is_masked = |one: &InstanceReport| u32::from(one.mask) & cull_mask == 0;
    let applies = cull_mask & 0xFF != 0 && !instances.is_empty() && instances.iter().all(is_masked);
    applies.then(|| {
        let all = instances.iter().fold(0, |all, one| all | one.mask);
        format!(
            "its cull mask {:#04x} shares no bit with any instance mask; the masks combined are {all:#04x}",
            cull_mask & 0xFF
        )
    })
}

/// The verdicts on the primitives that a ray meets and does not hit, with the t of each.
fn met(ray: AnyRay<'_>) -> Vec<(PrimitiveOutcome, FloatValue)> {
    let tested = ray.traversal().instances.iter().flat_map(|instance| &instance.tested);
    tested.filter_map(|one| Some((one.verdict, one.t?))).collect()
}

fn only_outside_interval(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let met = met(placed.ray);
    let are_outside = met.iter().all(|(verdict, _)| *verdict == PrimitiveOutcome::OutsideInterval);
    if placed.ray.hit().is_some() || met.is_empty() || !are_outside {
        return None;
    }
    let Traversal { t_min, t_max, .. } = placed.ray.traversal();
    // The one that is nearest to the interval.
    let off = |t: &FloatValue| (t_min.as_f64() - t.as_f64()).max(t.as_f64() - t_max.as_f64());
    let nearest = met.iter().map(|(_, t)| t).min_by(|a, b| off(a).total_cmp(&off(b)))?;
    Some(format!(
        "every intersection is outside its interval, t {t_min} to {t_max}; the nearest is at t {nearest}"
    ))
}

fn all_culled(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let met = met(placed.ray);
    let is_culled = |verdict: PrimitiveOutcome| {
        matches!(verdict, PrimitiveOutcome::CulledByFace | PrimitiveOutcome::CulledByOpacity)
    };
    let applies =
        placed.ray.hit().is_none() && !met.is_empty() && met.iter().all(|(verdict, _)| is_culled(*verdict));
    applies.then(|| {
        let flags = &placed.ray.traversal().flags;
        let (names, count) = (flags.names.join(" | "), met.len());
        let plural = if count == 1 { "primitive" } else { "primitives" };
        format!("its flags ({names}) cull everything that it intersects: {} {plural}", grouped(count))
    })
}

fn all_ignored(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let AnyRay::Trace(trace) = placed.ray else { return None };
    let is_ignored = |run: &ShaderRun| run.exit.how == ExitKind::Ignored;
    let applies = trace.hit.is_none()
        && trace.record.is_some()
        && !trace.decisions.is_empty()
        && trace.decisions.iter().all(|one| !one.is_box && one.shader.as_ref().is_some_and(is_ignored));
    applies.then(|| {
        let count = trace.decisions.len();
        let plural = if count == 1 { "candidate" } else { "candidates" };
        format!("it misses because any-hit shaders ignored its {} {plural}", grouped(count))
    })
}

fn no_record(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let AnyRay::Trace(Trace { record: Some(record), hit, .. }) = placed.ray else { return None };
    let RecordChoice { table, index, arithmetic, records, group: None, .. } = record else { return None };
    let sum = match arithmetic {
        Some(sum) => format!(
            " (instance offset {} + geometry {} x stride {} + offset {})",
            sum.instance_offset, sum.geometry, sum.stride, sum.offset
        ),
        None => String::new(),
    };
    let what = if *index >= *records as u64 {
        format!("does not exist: the table has {records}")
    } else {
        "is a null handle".to_owned()
    };
    let ran = if hit.is_some() { "closest-hit" } else { "miss" };
    Some(format!("{table} record {index}{sum} {what}, so no {ran} shader runs"))
}

fn direction_length(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let AnyRay::Trace(Trace { hit: Some(hit), shader: Some(run), .. }) = placed.ray else { return None };
    let length = placed.ray.traversal().direction_length;
    let builtin = run.builtins.iter().find(|one| matches!(one.name, "RayTmaxKHR" | "HitTNV"))?;
    ((length.as_f64() - 1.0).abs() > 0.01).then(|| {
        let name = builtin.source_name.unwrap_or(builtin.name);
        let distance = FloatValue::F32((hit.t.as_f64() * length.as_f64()) as f32);
        format!(
            "its shader reads {name}, which is in units of the direction's length: t {} is a distance of \
             about {distance}, as that length is {length}",
            hit.t
        )
    })
}

fn normal_along_ray(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let AnyRay::Trace(Trace { hit: Some(hit), shader: Some(run), .. }) = placed.ray else { return None };
    let traversal = placed.ray.traversal();
    // A normal in object space is no direction of the world where the instance is transformed.
    if traversal.instances.get(hit.instance as usize)?.transformed {
        return None;
    }
    let direction = traversal.direction.map(FloatValue::as_f64);
    let size = traversal.direction_length.as_f64();
    run.lines.iter().find_map(|line| {
        line.values.iter().find_map(|value| {
            let normal = value.last.content.as_vec3()?;
            let dot = normal.iter().zip(&direction).map(|(a, b)| a * b).sum::<f64>() / size;
            (value.name.to_lowercase().contains("normal") && dot > 1e-3).then(|| {
                format!(
                    "`{}` of {}:{} points along the ray, not against it: their dot product is {:.3}",
                    value.name, line.file, line.line, dot
                )
            })
        })
    })
}

/// The shaders that left a NaN where there was none, and the memory that got one.
fn nans(root: &Step, writes: &[MemoryChange]) -> Vec<String> {
    let mut texts = Vec::new();
    for run in walk::runs(root) {
        let has = |value: &Option<TypedValue>| value.as_ref().is_some_and(|value| value.content.has_nan());
        let made = run.lines.iter().find(|line| {
            line.values.iter().any(|value| value.last.content.has_nan() || value.first.content.has_nan())
        });
        let left = has(&run.payload_after) && !has(&run.payload_before);
        let name = label(&run.shader);
        match made {
            Some(line) => {
                let value = line
                    .values
                    .iter()
                    .find(|value| value.last.content.has_nan() || value.first.content.has_nan());
                let value = value.map_or_else(String::new, |value| format!("`{}`", value.name));
                texts.push(format!("{name}: {value} becomes NaN at {}:{}", line.file, line.line));
            }
            None if left && !leaves_nan(&run.steps) => {
                texts.push(format!("{name} leaves a NaN in the payload"));
            }
            None => {}
        }
    }
    let is_new = |write: &&MemoryChange| write.after.content.has_nan() && !write.before.content.has_nan();
    let written = writes.iter().filter(is_new);
    texts.extend(written.map(|write| format!("a NaN is written to `{}`", write.resource)));
    texts
}

/// Whether a ray among steps came back with a NaN in its payload.
fn leaves_nan(steps: &[Step]) -> bool {
    steps.iter().any(|step| match step {
        Step::Trace(trace) => trace.payload_after.as_ref().is_some_and(|value| value.content.has_nan()),
        _ => false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_is_told_once_and_of_many_a_few() {
        let texts = |texts: &[&str]| -> Vec<String> {
            let hints = limited(HintKind::AllMasked, texts.iter().map(|&text| text.to_owned()).collect());
            hints.into_iter().map(|hint| hint.text).collect()
        };
        assert_eq!(texts(&["a", "b", "a"]), ["a (2 times)", "b"]);
        assert_eq!(texts(&["a", "b", "c", "d", "e"]), ["a", "b", "c (and 2 more of this kind)"]);
    }
}
