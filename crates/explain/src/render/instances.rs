//! Renders what a traversal reached: instances and primitives.

use crate::page::with_plural;
use crate::render::{TraversalView, Writer};
use crate::transcript::{InstanceOutcome, InstanceReport, PrimitiveOutcome, PrimitiveReport, Traversal};
use anyhit_base::count::grouped;
use anyhit_base::sorted::{SortedMap, sort_by};
use anyhit_base::style::Style;
use anyhit_engine::reflect::value::FloatValue;

/// The number of an instance's primitives, nearest first, that are shown unless all are wanted.
const MAX_PRIMITIVES: usize = 6;
/// The number of instances that are shown unless all are wanted.
const MAX_INSTANCES: usize = 12;

impl Writer<'_> {
    pub(super) fn instances(&mut self, view: &TraversalView<'_>) {
        let Traversal { nodes, instances, .. } = view.traversal;
        if *nodes > 0 {
            let nodes = with_plural(*nodes, "node");
            self.page.line(format_args!("{nodes} of the instance tree opened"));
        }
        // If there are too many, only those that were entered are shown.
        let mut shown: Vec<&InstanceReport> = instances.iter().collect();
        if !self.options.all && shown.len() > MAX_INSTANCES {
            shown.retain(|one| one.verdict == InstanceOutcome::Entered);
            shown.truncate(MAX_INSTANCES);
        }
        for instance in &shown {
            self.instance(instance, view);
        }
        let mut rest: SortedMap<&'static str, u64> = SortedMap::new();
        for instance in instances {
            if !shown.iter().any(|one| one.instance == instance.instance) {
                *rest.entry(instance_outcome_label(instance.verdict)).or_default() += 1;
            }
        }
        for (what, count) in rest {
            let line = format!("{} more: {what}", with_plural(count, "instance"));
            let line = self.page.styled(Style::Faint, line);
            self.page.line(line);
        }
    }

    fn instance(&mut self, instance: &InstanceReport, view: &TraversalView<'_>) {
        let names = match &instance.geometry[..] {
            [] => String::new(),
            names => format!(" `{}`", names.join("`, `")),
        };
        let kind = instance.primitive_kind.as_deref().unwrap_or("no geometry");
        let of = match instance.primitives {
            1 => format!("1 {}", kind.trim_end_matches('s')),
            count => format!("{} {kind}", grouped(count)),
        };
        let verdict = match instance.verdict {
            InstanceOutcome::Entered => self.page.styled(Style::Good, "entered"),
            InstanceOutcome::Masked => {
                let text = "dropped: its mask and the ray's cull mask share no bit";
                self.page.styled(Style::Faint, text)
            }
            InstanceOutcome::Skipped => {
                let boxes = instance.primitive_kind.as_deref().is_some_and(|kind| kind.contains("AABB"));
                let flag = if boxes { "SkipAABBsKHR" } else { "SkipTrianglesKHR" };
                self.page.styled(Style::Faint, format_args!("dropped: the ray's flag {flag} skips {kind}"))
            }
            InstanceOutcome::MissedBox => self.page.styled(
                Style::Faint,
                "dropped: the ray misses its bounding box, or hits it outside the interval",
            ),
            InstanceOutcome::NotReached => self.page.styled(
                Style::Faint,
                "not reached: its bounding box is missed or behind a hit, or traversal ended before",
            ),
        };
        let moves = if instance.moves { ", moving" } else { "" };
        let head = format!("instance {}{names}: {of}{moves}", instance.instance);
        self.page.line(format_args!(
            "{head}; mask {}: {verdict}",
            mask_bits(instance.mask, view.traversal.cull_mask)
        ));
        if instance.verdict == InstanceOutcome::Entered {
            self.tested(instance, view);
        }
    }

    fn tested(&mut self, instance: &InstanceReport, view: &TraversalView<'_>) {
        let tested = &instance.tested;
        let mut counts: SortedMap<PrimitiveOutcome, u64> = SortedMap::new();
        for one in tested {
            *counts.entry(one.verdict).or_default() += 1;
        }
        let words: Vec<String> =
            counts.iter().map(|(verdict, count)| outcome_count(*verdict, *count)).collect();
        let nodes = match instance.nodes {
            0 => String::new(),
            nodes => format!("{} of its tree opened, ", with_plural(nodes, "node")),
        };
        let sum = if words.is_empty() { String::new() } else { format!(": {}", words.join(", ")) };
        let all = grouped(instance.primitives);
        self.page.line(format_args!("  {nodes}{} of {all} primitives tested{sum}", grouped(tested.len())));
        let mut shown: Vec<&PrimitiveReport> =
            tested.iter().filter(|one| self.options.all || one.verdict != PrimitiveOutcome::Missed).collect();
        sort_by(&mut shown, |a, b| distance(a).total_cmp(&distance(b)));
        let left = if self.options.all { 0 } else { shown.len().saturating_sub(MAX_PRIMITIVES) };
        shown.truncate(shown.len() - left);
        for one in shown {
            let primitive = [instance.instance, one.geometry, one.primitive];
            let hit = view.hit.map(|hit| [hit.instance, hit.geometry, hit.primitive]);
            let is_decided = view.shown.contains(&primitive);
            self.primitive(one, hit == Some(primitive), is_decided);
        }
        if left > 0 {
            let text = self.page.styled(Style::Faint, format_args!("... {left} farther (--all shows them)"));
            self.page.line(format_args!("    {text}"));
        }
    }

    fn primitive(&mut self, one: &PrimitiveReport, is_hit: bool, is_decided: bool) {
        let place = format!("geometry {}, primitive {}", one.geometry, one.primitive);
        let met = match (one.t, one.surface) {
            (Some(t), Some(surface)) => format!(", t {t}, {surface}"),
            _ => String::new(),
        };
        let verdict = match one.verdict {
            PrimitiveOutcome::Opaque if is_hit => self.page.styled(Style::Good, "opaque hit, the closest"),
            PrimitiveOutcome::Opaque => {
                self.page.styled(Style::Faint, "opaque hit, then a closer one was found")
            }
            PrimitiveOutcome::Candidate if is_decided => {
                self.page.styled(Style::Good, "candidate, see below")
            }
            PrimitiveOutcome::Candidate => {
                self.page.styled(Style::Faint, "candidate, not evaluated: a closer hit ended traversal")
            }
            PrimitiveOutcome::Behind => {
                let behind = one.behind.map_or_else(String::new, |t| format!(" at t {t}"));
                self.page.styled(Style::Faint, format_args!("dropped: behind a closer hit{behind}"))
            }
            PrimitiveOutcome::OutsideInterval => {
                self.page.styled(Style::Faint, "dropped: outside the interval")
            }
            PrimitiveOutcome::Transparent => {
                self.page.styled(Style::Faint, "passed through: its opacity micromap is transparent there")
            }
            PrimitiveOutcome::CulledByOpacity => {
                self.page.styled(Style::Faint, "dropped: the ray's flags cull its opacity")
            }
            PrimitiveOutcome::CulledByFace => {
                self.page.styled(Style::Faint, "dropped: the ray's flags cull its facing side")
            }
            PrimitiveOutcome::Missed => self.page.styled(Style::Faint, "missed"),
        };
        self.page.line(format_args!("    {place}{met}: {verdict}"));
    }
}

/// An instance's mask and a cull mask in binary, unless all bits are set.
fn mask_bits(mask: u8, cull_mask: u32) -> String {
    let cull = cull_mask & 0xFF;
    if mask == 0xFF && cull == 0xFF {
        return "0xff & 0xff".into();
    }
    format!("{mask:08b} & {cull:08b} = {:08b}", u32::from(mask) & cull)
}

fn outcome_count(verdict: PrimitiveOutcome, count: u64) -> String {
    let what = match verdict {
        PrimitiveOutcome::Opaque => return with_plural(count, "opaque hit"),
        PrimitiveOutcome::Candidate => return with_plural(count, "candidate"),
        PrimitiveOutcome::Behind => "behind a closer hit",
        PrimitiveOutcome::OutsideInterval => "outside the interval",
        PrimitiveOutcome::Transparent => "transparent",
        PrimitiveOutcome::CulledByOpacity => "culled by opacity",
        PrimitiveOutcome::CulledByFace => "culled by face",
        PrimitiveOutcome::Missed => "missed",
    };
    format!("{} {what}", grouped(count))
}

fn instance_outcome_label(verdict: InstanceOutcome) -> &'static str {
    match verdict {
        InstanceOutcome::Entered => "entered",
        InstanceOutcome::Masked => "dropped by mask",
        InstanceOutcome::Skipped => "of a skipped kind",
        InstanceOutcome::MissedBox => "bounding box missed",
        InstanceOutcome::NotReached => "not reached",
    }
}

fn distance(one: &PrimitiveReport) -> f32 {
    match one.t {
        Some(FloatValue::F32(t)) => t,
        _ => f32::INFINITY,
    }
}
