//! Renders a transcript as text.

mod query;

use std::collections::BTreeMap;

use crate::debug::page::{Page, TextStyle, with_thousands_separators};
use crate::debug::transcript::{
    ChangeLocation, Decision, DispatchIndex, ExitKind, HitReport, InstanceOutcome, InstanceReport,
    MemoryChange, NamedValue, PrimitiveOutcome, PrimitiveReport, RecordChoice, ShaderLabel, ShaderRun, Step,
    Trace, Transcript, TranscriptLine, Traversal,
};
use crate::debug::values::{FloatValue, TypedValue, ValueContent};

/// The number of an instance's primitives, nearest first, that are shown unless all are wanted.
const MAX_PRIMITIVES: usize = 6;
/// The number of instances that are shown unless all are wanted.
const MAX_INSTANCES: usize = 12;
/// The number of changes in memory that are shown.
const MAX_WRITES: usize = 16;

/// Structs whose text is longer than this, in bytes, are shown member by member.
const MAX_VALUE_BYTES: usize = 72;

/// Options of the text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderOptions {
    /// Whether to write the escapes of a terminal's colours.
    pub colour: bool,
    /// Whether to show every instance and primitive, however many.
    pub all: bool,
}

/// Renders a transcript as text.
pub fn text(transcript: &Transcript, options: RenderOptions) -> String {
    let mut writer = Writer { page: Page::new(options.colour), all: options.all };
    writer.transcript(transcript);
    writer.page.finish()
}

/// Renders one step and all steps within it as text, under a title.
pub fn step(title: &str, step: &Step, options: RenderOptions) -> String {
    let mut writer = Writer { page: Page::new(options.colour), all: options.all };
    writer.page.line(title);
    writer.page.blank_line();
    writer.step(step);
    writer.page.finish()
}

struct Writer {
    page: Page,
    all: bool,
}

/// The traversal of a ray or ray query, with its result.
struct TraversalView<'a> {
    traversal: &'a Traversal,
    hit: Option<&'a HitReport>,
    /// Instance, geometry and primitive of the candidates that were shown.
    shown: Vec<[u32; 3]>,
}

impl Writer {
    fn transcript(&mut self, transcript: &Transcript) {
        let mut title = vec![transcript.scene.clone()];
        title.extend(transcript.ray_name.iter().map(|name| format!("ray \"{name}\"")));
        title.extend(transcript.pass.iter().map(|pass| format!("pass {pass}")));
        if let Some(launch) = &transcript.launch {
            let [x, y, z] = launch.id;
            let [width, height, depth] = launch.size;
            title.push(match depth {
                1 => format!("pixel ({x}, {y}) of {width} x {height}"),
                _ => format!("launch index ({x}, {y}, {z}) of {width} x {height} x {depth}"),
            });
        }
        if let Some(DispatchIndex { dispatch, id: [x, y, z], groups, workgroup_size }) = &transcript.dispatch
        {
            let [a, b, c] = groups;
            let [width, height, depth] = workgroup_size;
            title.push(format!("invocation ({x}, {y}, {z}) of dispatch {dispatch}"));
            title.push(format!("{a} x {b} x {c} workgroups of {width} x {height} x {depth}"));
        }
        let title = title.join(", ");
        self.page.line(title);
        self.page.blank_line();
        self.step(&transcript.root);
        self.page.blank_line();
        self.result(transcript);
        if !transcript.printed.is_empty() {
            self.page.blank_line();
            self.page.line("printed");
            for line in transcript.printed.iter().flat_map(|text| text.lines()) {
                self.page.line(format!("  {line}"));
            }
        }
    }

    fn step(&mut self, step: &Step) {
        match step {
            Step::Trace(trace) => self.trace(trace),
            Step::RayQuery(query) => self.query(query),
            Step::Shader(run) => self.shader(run),
            Step::Report { t, hit_kind, accepted } => {
                let answer = if *accepted {
                    self.page.styled(TextStyle::Kept, "accepted")
                } else {
                    self.page.styled(
                        TextStyle::Dim,
                        "not accepted: outside the interval, behind a known hit, or ignored by any-hit",
                    )
                };
                self.page.line(format_args!("reported t {t}, hit kind {hit_kind:#x}: {answer}"));
            }
        }
    }

    fn trace(&mut self, trace: &Trace) {
        let head = self.page.styled(TextStyle::Heading, format_args!("ray at depth {}", trace.depth));
        self.page.line(format_args!("{head}{}", source_suffix(trace.traversal.called_at.as_ref(), "traced")));
        self.page.nested("│ ", |page| {
            let mut inner = Writer { page: std::mem::replace(page, Page::new(false)), all: self.all };
            inner.trace_body(trace);
            *page = inner.page;
        });
    }

    fn trace_body(&mut self, trace: &Trace) {
        let mut rows = ray(&trace.traversal);
        rows.extend(trace.payload_before.iter().flat_map(|value| value_rows("payload", value)));
        self.page.rows(rows);
        self.page.blank_line();
        let shown = trace.decisions.iter().map(|one| [one.instance, one.geometry, one.primitive]);
        let view =
            TraversalView { traversal: &trace.traversal, hit: trace.hit.as_ref(), shown: shown.collect() };
        self.instances(&view);
        for decision in &trace.decisions {
            self.page.blank_line();
            self.decision(decision);
        }
        self.page.blank_line();
        match (&trace.hit, &trace.record) {
            (_, None) => {
                let text = self.page.styled(TextStyle::Trap, "a trap ended the ray");
                self.page.line(text);
                return;
            }
            (Some(hit), Some(record)) => {
                self.hit(hit);
                self.record(record, trace.shader.as_deref());
            }
            (None, Some(record)) => {
                let head = self.page.styled(TextStyle::Heading, "miss");
                self.page.line(head);
                self.record(record, trace.shader.as_deref());
            }
        }
        match (&trace.shader, &trace.no_shader) {
            (Some(run), _) => {
                self.page.blank_line();
                self.shader(run);
            }
            (None, Some(why)) => self.page.line(format_args!("  no shader runs: {why}")),
            (None, None) => {}
        }
        if let Some(after) = &trace.payload_after {
            self.page.blank_line();
            self.page.rows(value_rows("payload after the ray", after));
        }
    }

    fn instances(&mut self, view: &TraversalView<'_>) {
        let Traversal { nodes, instances, .. } = view.traversal;
        if *nodes > 0 {
            let nodes = with_plural(*nodes, "node");
            self.page.line(format_args!("{nodes} of the tree over the instances opened"));
        }
        // If there are too many, only those that were entered are shown.
        let mut shown: Vec<&InstanceReport> = instances.iter().collect();
        if !self.all && shown.len() > MAX_INSTANCES {
            shown.retain(|one| one.verdict == InstanceOutcome::Entered);
            shown.truncate(MAX_INSTANCES);
        }
        for instance in &shown {
            self.instance(instance, view);
        }
        let mut rest: BTreeMap<&'static str, u64> = BTreeMap::new();
        for instance in instances {
            if !shown.iter().any(|one| one.instance == instance.instance) {
                *rest.entry(instance_outcome_label(instance.verdict)).or_default() += 1;
            }
        }
        for (what, count) in rest {
            let line = format!("{} more: {what}", with_plural(count, "instance"));
            let line = self.page.styled(TextStyle::Dim, line);
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
            count => format!("{} {kind}", with_thousands_separators(count as u64)),
        };
        let verdict = match instance.verdict {
            InstanceOutcome::Entered => self.page.styled(TextStyle::Kept, "entered"),
            InstanceOutcome::Masked => {
                let text = "dropped: its mask and the ray's cull mask share no bit";
                self.page.styled(TextStyle::Dim, text)
            }
            InstanceOutcome::Skipped => {
                let boxes = instance.primitive_kind.as_deref().is_some_and(|kind| kind.contains("AABB"));
                let flag = if boxes { "SkipAABBsKHR" } else { "SkipTrianglesKHR" };
                self.page.styled(TextStyle::Dim, format_args!("dropped: the ray's flag {flag} skips {kind}"))
            }
            InstanceOutcome::MissedBox => self.page.styled(
                TextStyle::Dim,
                "dropped: the ray passes by the box around it, or meets it outside the interval",
            ),
            InstanceOutcome::NotReached => self.page.styled(
                TextStyle::Dim,
                "not reached: its box is missed or lies behind a hit, or the search ended before",
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
        let mut counts: BTreeMap<PrimitiveOutcome, u64> = BTreeMap::new();
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
        let all = with_thousands_separators(instance.primitives as u64);
        self.page.line(format_args!("  {nodes}{} of {all} primitives tested{sum}", tested.len()));
        let mut shown: Vec<&PrimitiveReport> =
            tested.iter().filter(|one| self.all || one.verdict != PrimitiveOutcome::Missed).collect();
        shown.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        let left = if self.all { 0 } else { shown.len().saturating_sub(MAX_PRIMITIVES) };
        shown.truncate(shown.len() - left);
        for one in shown {
            let primitive = [instance.instance, one.geometry, one.primitive];
            let hit = view.hit.map(|hit| [hit.instance, hit.geometry, hit.primitive]);
            let is_decided = view.shown.contains(&primitive);
            self.primitive(one, hit == Some(primitive), is_decided);
        }
        if left > 0 {
            let text =
                self.page.styled(TextStyle::Dim, format_args!("... {left} farther (--all shows them)"));
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
            PrimitiveOutcome::Opaque if is_hit => {
                self.page.styled(TextStyle::Kept, "opaque hit, the closest")
            }
            PrimitiveOutcome::Opaque => {
                self.page.styled(TextStyle::Dim, "opaque hit, then a closer one was found")
            }
            PrimitiveOutcome::Candidate if is_decided => {
                self.page.styled(TextStyle::Kept, "candidate, see below")
            }
            PrimitiveOutcome::Candidate => self
                .page
                .styled(TextStyle::Dim, "candidate whose turn did not come: a closer hit ended the search"),
            PrimitiveOutcome::Behind => {
                let behind = one.behind.map_or_else(String::new, |t| format!(" at t {t}"));
                self.page.styled(TextStyle::Dim, format_args!("dropped: behind a known hit{behind}"))
            }
            PrimitiveOutcome::OutsideInterval => {
                self.page.styled(TextStyle::Dim, "dropped: outside the interval")
            }
            PrimitiveOutcome::Transparent => {
                self.page.styled(TextStyle::Dim, "passed through: its opacity micromap is transparent there")
            }
            PrimitiveOutcome::CulledByOpacity => {
                self.page.styled(TextStyle::Dim, "dropped: the ray's flags cull its opacity")
            }
            PrimitiveOutcome::CulledByFace => {
                self.page.styled(TextStyle::Dim, "dropped: the ray's flags cull the side that it shows")
            }
            PrimitiveOutcome::Missed => self.page.styled(TextStyle::Dim, "missed"),
        };
        self.page.line(format_args!("    {place}{met}: {verdict}"));
    }

    fn decision(&mut self, decision: &Decision) {
        let Decision { instance, geometry, primitive, t, is_box, record, shader } = decision;
        let head = self.page.styled(TextStyle::Heading, if *is_box { "box" } else { "candidate" });
        let at = if *is_box { "entered at" } else { "at" };
        self.page.line(format_args!(
            "{head}  instance {instance}, geometry {geometry}, primitive {primitive}, {at} t {t}"
        ));
        self.record(record, None);
        match shader {
            Some(run) => self.nested(|writer| writer.shader(run)),
            None if *is_box => {
                self.page.line("  the group has no intersection shader: dropped");
            }
            None => self.page.line("  the group has no any-hit shader: accepted"),
        }
    }

    fn hit(&mut self, hit: &HitReport) {
        let head = self.page.styled(TextStyle::Heading, "hit");
        let name = hit.geometry_name.as_ref().map_or_else(String::new, |name| format!(" `{name}`"));
        self.page.line(format_args!(
            "{head}  instance {} (custom index {}), geometry {}{name}, primitive {}",
            hit.instance, hit.custom_index, hit.geometry, hit.primitive
        ));
        let mut rows = vec![
            ("t", hit.t.to_string()),
            ("surface", hit.surface.to_owned()),
            ("hit kind", format!("{:#x}, {}", hit.hit_kind, hit.hit_kind_name)),
        ];
        rows.extend(hit.attributes.iter().map(|one| (one.name, one.value.to_string())));
        rows.push(("hit point", format!("about {}", vector(&hit.position))));
        rows.push((
            "object ray",
            format!(
                "origin {}, direction {}",
                vector(&hit.object_ray_origin),
                vector(&hit.object_ray_direction)
            ),
        ));
        rows.extend(hit.data.iter().map(|one| (one.name, one.value.to_string())));
        self.page.nested("  ", |page| page.rows(rows));
    }

    fn record(&mut self, record: &RecordChoice, run: Option<&ShaderRun>) {
        let sum = match record.arithmetic {
            Some(sum) => format!(
                "hit record = instance offset {} + geometry {} x stride {} + offset {} = {}",
                sum.instance_offset, sum.geometry, sum.stride, sum.offset, record.index
            ),
            None => format!("{} record {}", record.table, record.index),
        };
        let group = match (&record.name, record.group) {
            (_, None) if record.index >= record.records as u64 => {
                format!("no such record: the table has {}", record.records)
            }
            (_, None) => "a null handle".to_owned(),
            (Some(name), Some(_)) => format!("group \"{name}\""),
            (None, Some(group)) => format!("group {group}"),
        };
        let run =
            run.map_or_else(String::new, |run| format!(" -> {} {}", run.shader.stage, label(&run.shader)));
        self.page.line(format_args!("  {sum} -> {group}{run}"));
    }

    fn shader(&mut self, run: &ShaderRun) {
        let head = self.page.styled(TextStyle::Heading, run.shader.stage);
        self.page.line(format_args!("{head} {}", label(&run.shader)));
        self.nested(|writer| writer.shader_body(run));
    }

    fn shader_body(&mut self, run: &ShaderRun) {
        let builtin = |one: &NamedValue| (one.name.to_owned(), annotated(one.name, &one.value));
        let mut rows: Vec<(String, String)> = run.builtins.iter().map(builtin).collect();
        rows.extend(run.attributes.iter().flat_map(|value| value_rows("hit attribute", value)));
        rows.extend(run.payload_before.iter().flat_map(|value| value_rows(payload_label(run), value)));
        self.page.rows(rows);
        for step in &run.steps {
            self.page.blank_line();
            self.step(step);
        }
        if !run.steps.is_empty() {
            self.page.blank_line();
        }
        if let (Some(before), Some(after)) = (&run.payload_before, &run.payload_after) {
            self.payload_change(payload_label(run), before, after);
        }
        let ending = match (run.exit.how, run.shader.stage) {
            (ExitKind::Returned, "AnyHitKHR") => "returned: the candidate is accepted".to_owned(),
            (ExitKind::Returned, _) => "returned".to_owned(),
            (ExitKind::Ignored, _) => "ignored the intersection: the candidate is dropped".to_owned(),
            (ExitKind::Terminated, _) => {
                "terminated the ray: the candidate is accepted, the search ends".to_owned()
            }
            (ExitKind::Trapped, _) => {
                let message = run.exit.message.unwrap_or_default();
                let text = format!("TRAPPED: {message}{}", source_suffix(run.exit.at.as_ref(), ""));
                self.page.styled(TextStyle::Trap, text)
            }
        };
        self.page.line(ending);
    }

    /// Shows the members of a payload that changed, or says that none did.
    fn payload_change(&mut self, word: &str, before: &TypedValue, after: &TypedValue) {
        let pairs = before.parts().into_iter().zip(after.parts());
        let changed: Vec<(String, String)> = pairs
            .filter(|((_, before), (_, after))| before != after)
            .map(|((path, before), (_, after))| {
                let name = if path.is_empty() { word.to_owned() } else { format!("{word}.{path}") };
                (name, change(before, after))
            })
            .collect();
        if changed.is_empty() {
            let text = self.page.styled(TextStyle::Dim, format_args!("{word} unchanged"));
            self.page.line(text);
        }
        self.page.rows(changed);
    }

    fn result(&mut self, transcript: &Transcript) {
        let head = self.page.styled(TextStyle::Heading, "result");
        self.page.line(head);
        for write in transcript.writes.iter().take(MAX_WRITES) {
            self.write(write);
        }
        let more = transcript.writes.len().saturating_sub(MAX_WRITES) + transcript.writes_left_out;
        if more > 0 {
            self.page.line(format_args!("  ... and {} more", with_plural(more as u64, "change")));
        }
        let shaders: Vec<String> =
            transcript.counts.shaders.iter().map(|(stage, count)| format!("{count} {stage}")).collect();
        self.page.line(format_args!(
            "  {} traced,{} shaders run: {}",
            with_plural(transcript.counts.rays, "ray"),
            match transcript.counts.ray_queries {
                0 => String::new(),
                1 => " 1 ray query,".to_owned(),
                count => format!(" {} ray queries,", with_thousands_separators(count)),
            },
            if shaders.is_empty() { "none".to_owned() } else { shaders.join(", ") }
        ));
        if let Some(trap) = &transcript.trap {
            let text = self.page.styled(TextStyle::Trap, format_args!("trap: {}", trap.message));
            self.page.line(format_args!("  {text}"));
        }
    }

    fn write(&mut self, write: &MemoryChange) {
        let at = match (write.at, &write.member) {
            (ChangeLocation::Texel([x, y, 0]), _) => format!("texel ({x}, {y})"),
            (ChangeLocation::Texel([x, y, z]), _) => format!("texel ({x}, {y}, {z})"),
            (ChangeLocation::Byte(_), Some(member)) => member.clone(),
            (ChangeLocation::Byte(offset), None) => format!("byte {offset}"),
        };
        let change = if write.before == write.after {
            format!("{}, unchanged", write.after)
        } else {
            change(&write.before, &write.after)
        };
        let name = self.page.styled(TextStyle::Name, &write.resource);
        let place = match (write.set, write.binding) {
            (Some(set), Some(binding)) => format!(" (set {set}, binding {binding})"),
            _ => String::new(),
        };
        self.page.line(format_args!("  {name}{place}  {at}  {change}"));
    }

    fn nested(&mut self, write: impl FnOnce(&mut Self)) {
        let all = self.all;
        self.page.nested("  ", |page| {
            let mut inner = Writer { page: std::mem::replace(page, Page::new(false)), all };
            write(&mut inner);
            *page = inner.page;
        });
    }
}

/// The rows for the operands of a ray.
fn ray(ray: &Traversal) -> Vec<(String, String)> {
    let flags = match &ray.flags.names[..] {
        [] => "none".to_owned(),
        names => format!("{} ({:#x})", names.join(" | "), ray.flags.bits),
    };
    let rows = [
        ("origin", vector(&ray.origin)),
        ("direction", format!("{}, length {}", vector(&ray.direction), ray.direction_length)),
        ("interval", format!("t from {} to {}", ray.t_min, ray.t_max)),
        ("flags", flags),
        ("cull mask", format!("{:#04x}", ray.cull_mask)),
    ];
    let time = ray.time.iter().map(|time| ("time", time.to_string()));
    let structure = ray.structure.iter().map(|name| ("structure", format!("`{name}`")));
    rows.into_iter().chain(time).chain(structure).map(|(label, text)| (label.to_owned(), text)).collect()
}

/// ` traced at a.rgen:19: the line's text`
fn source_suffix(line: Option<&TranscriptLine>, verb: &str) -> String {
    let Some(TranscriptLine { file, line, text }) = line else { return String::new() };
    let text = text.as_ref().map_or_else(String::new, |text| format!(": {text}"));
    let gap = if verb.is_empty() { "" } else { ", " };
    format!("{gap}{verb} at {file}:{line}{text}")
}

fn label(shader: &ShaderLabel) -> String {
    let name = shader.name.as_ref().map_or_else(String::new, |name| format!("`{name}` "));
    match &shader.file {
        Some(file) => format!("{name}({file}, {})", shader.entry),
        None => format!("{name}({})", shader.entry),
    }
}

fn payload_label(run: &ShaderRun) -> &'static str {
    if run.shader.stage == "CallableKHR" { "callable data" } else { "payload" }
}

/// The value of a builtin, with the names of flags and hit kinds.
fn annotated(name: &str, value: &TypedValue) -> String {
    let ValueContent::Uint(bits) = value.content else { return value.to_string() };
    match name {
        "IncomingRayFlagsKHR" => {
            let flags = crate::debug::names::flags(bits as u32).names;
            let names = if flags.is_empty() { "none".to_owned() } else { flags.join(" | ") };
            format!("{value}: {names}")
        }
        "HitKindKHR" => {
            let kind = crate::debug::names::hit_kind(crate::accel::HitKind(bits as u32));
            format!("{value}: {kind}")
        }
        "CullMaskKHR" => format!("{value}: {bits:#04x}"),
        _ => value.to_string(),
    }
}

/// A row for a value, or a row for each of its members if one row would be too long.
fn value_rows(word: &str, value: &TypedValue) -> Vec<(String, String)> {
    let text = value.to_string();
    if text.len() <= MAX_VALUE_BYTES {
        return vec![(word.to_owned(), text)];
    }
    let path = |path: String| if path.is_empty() { word.to_owned() } else { format!("{word}.{path}") };
    value.parts().into_iter().map(|(part, value)| (path(part), value.to_string())).collect()
}

/// `vec3(0, 0, 0) -> (0.5, 0, 0)`
fn change(before: &TypedValue, after: &TypedValue) -> String {
    format!("{before} -> {}", after.content)
}

fn vector(values: &[FloatValue; 3]) -> String {
    format!("({}, {}, {})", values[0], values[1], values[2])
}

/// An instance's mask and a cull mask in binary, unless all bits are set.
fn mask_bits(mask: u8, cull_mask: u32) -> String {
    let cull = cull_mask & 0xFF;
    if mask == 0xFF && cull == 0xFF {
        return "0xff & 0xff".into();
    }
    format!("{mask:08b} & {cull:08b} = {:08b}", u32::from(mask) & cull)
}

fn with_plural(count: u64, what: &str) -> String {
    format!("{} {what}{}", with_thousands_separators(count), if count == 1 { "" } else { "s" })
}

fn outcome_count(verdict: PrimitiveOutcome, count: u64) -> String {
    let what = match verdict {
        PrimitiveOutcome::Opaque => return with_plural(count, "opaque hit"),
        PrimitiveOutcome::Candidate => return with_plural(count, "candidate"),
        PrimitiveOutcome::Behind => "behind a known hit",
        PrimitiveOutcome::OutsideInterval => "outside the interval",
        PrimitiveOutcome::Transparent => "transparent",
        PrimitiveOutcome::CulledByOpacity => "culled by opacity",
        PrimitiveOutcome::CulledByFace => "culled by face",
        PrimitiveOutcome::Missed => "missed",
    };
    format!("{} {what}", with_thousands_separators(count))
}

fn instance_outcome_label(verdict: InstanceOutcome) -> &'static str {
    match verdict {
        InstanceOutcome::Entered => "entered",
        InstanceOutcome::Masked => "dropped by mask",
        InstanceOutcome::Skipped => "of a skipped kind",
        InstanceOutcome::MissedBox => "box missed",
        InstanceOutcome::NotReached => "not reached",
    }
}

fn distance(one: &PrimitiveReport) -> f32 {
    match one.t {
        Some(FloatValue::F32(t)) => t,
        _ => f32::INFINITY,
    }
}
