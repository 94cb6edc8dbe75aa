//! Renders a transcript as text.

mod instances;
mod many_rays;
mod parts;
mod query;
mod shader;
mod words;

use crate::page::{Page, with_plural};
use crate::transcript::{
    ChangeLocation, Decision, DispatchIndex, Hint, HitReport, MemoryChange, RecordChoice, ShaderRun, Step,
    Trace, Transcript, Traversal,
};
use anyhit_base::count::grouped;
use anyhit_base::style::Style;

pub use parts::{PageFilter, parts};

use words::{change, label, ray, source_suffix, value_rows, vector};

/// The number of changes in memory that are shown.
const MAX_WRITES: usize = 16;

/// Options of the text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderOptions {
    /// Whether to write the escapes of a terminal's colours.
    pub colour: bool,
    /// Whether to show every instance, primitive and ray, however many.
    pub all: bool,
    /// Whether the summary stands before the page.
    pub summary: bool,
    /// With a number, at most so many lines of a shader are shown, the last that began to run;
    /// also those that set no variable.
    pub last_lines: Option<usize>,
}

/// Renders a transcript as text.
pub fn text(transcript: &Transcript, options: RenderOptions) -> String {
    let mut writer = Writer::of(transcript, options);
    writer.transcript(transcript);
    writer.page.finish()
}

/// Renders the summary of a transcript, with the hints.
pub fn summary(transcript: &Transcript, options: RenderOptions) -> String {
    let mut writer = Writer::of(transcript, options);
    writer.title(transcript);
    writer.summary(transcript);
    writer.page.finish()
}

/// Renders one step and all steps within it as text, under a title and hints.
pub fn step(title: &str, hints: &[Hint], step: &Step, options: RenderOptions) -> String {
    let mut writer = Writer {
        page: Page::new(options.colour),
        options,
        root: None,
        place: String::new(),
        depth: 0,
        printed: 0,
    };
    writer.page.line(title);
    writer.page.rows(hints.iter().map(|hint| ("hint", hint.text.clone())));
    writer.page.blank_line();
    writer.step(step);
    writer.page.finish()
}

struct Writer<'a> {
    page: Page,
    options: RenderOptions,
    /// The outermost shader, whose rays are samples.
    root: Option<&'a ShaderRun>,
    /// The pixel or invocation in words; empty where there is none.
    place: String,
    /// The depth of the ray whose shaders are shown.
    depth: u32,
    /// How many texts that shaders printed were shown.
    printed: usize,
}

/// The traversal of a ray or ray query, with its result.
struct TraversalView<'a> {
    traversal: &'a Traversal,
    hit: Option<&'a HitReport>,
    /// Instance, geometry and primitive of the candidates that were shown.
    shown: Vec<[u32; 3]>,
}

impl<'a> Writer<'a> {
    fn of(transcript: &'a Transcript, options: RenderOptions) -> Self {
        let root = match &transcript.root {
            Step::Shader(run) => Some(&**run),
            _ => None,
        };
        let place = match (&transcript.launch, &transcript.dispatch) {
            (Some(launch), _) => match launch.id {
                [x, y, 0] => format!("pixel ({x}, {y})"),
                [x, y, z] => format!("launch index ({x}, {y}, {z})"),
            },
            (None, Some(DispatchIndex { id: [x, y, z], .. })) => format!("invocation ({x}, {y}, {z})"),
            (None, None) => String::new(),
        };
        Self { page: Page::new(options.colour), options, root, place, depth: 0, printed: 0 }
    }

    fn title(&mut self, transcript: &Transcript) {
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
    }

    fn summary(&mut self, transcript: &Transcript) {
        let hint = |hint: &Hint| ("hint", hint.text.clone());
        let lines = transcript.summary.iter().map(|line| (line.about, line.text.clone()));
        self.page.rows(lines.chain(transcript.hints.iter().map(hint)));
    }

    fn transcript(&mut self, transcript: &Transcript) {
        self.title(transcript);
        if self.options.summary {
            self.summary(transcript);
            self.page.blank_line();
        }
        self.step(&transcript.root);
        self.page.blank_line();
        self.result(transcript);
        // Other invocations of the workgroup or subgroup print, too, and rays may be summed up.
        if self.printed < transcript.printed.len() {
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
                    self.page.styled(Style::Good, "accepted")
                } else {
                    self.page.styled(
                        Style::Faint,
                        "not accepted: outside the interval, behind a closer hit, or ignored by any-hit",
                    )
                };
                self.page.line(format_args!("reported t {t}, hit kind {hit_kind:#x}: {answer}"));
            }
        }
    }

    fn trace(&mut self, trace: &Trace) {
        let head = self.page.styled(Style::Heading, format_args!("ray at depth {}", trace.depth));
        self.page.line(format_args!("{head}{}", source_suffix(trace.traversal.called_at.as_ref(), "traced")));
        let outer = std::mem::replace(&mut self.depth, trace.depth);
        self.nested("│ ", |writer| writer.trace_body(trace));
        self.depth = outer;
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
                let text = self.page.styled(Style::Bad, "a trap ended the ray");
                self.page.line(text);
                return;
            }
            (Some(hit), Some(record)) => {
                self.hit(hit);
                self.record(record, trace.shader.as_deref());
            }
            (None, Some(record)) => {
                let head = self.page.styled(Style::Heading, "miss");
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

    fn decision(&mut self, decision: &Decision) {
        let Decision { instance, geometry, primitive, t, is_box, record, shader } = decision;
        let head = self.page.styled(Style::Heading, if *is_box { "box" } else { "candidate" });
        let at = if *is_box { "entered at" } else { "at" };
        self.page.line(format_args!(
            "{head}  instance {instance}, geometry {geometry}, primitive {primitive}, {at} t {t}"
        ));
        self.record(record, None);
        match shader {
            Some(run) => self.nested("  ", |writer| writer.shader(run)),
            None if *is_box => {
                self.page.line("  the group has no intersection shader: dropped");
            }
            None => self.page.line("  the group has no any-hit shader: accepted"),
        }
    }

    fn hit(&mut self, hit: &HitReport) {
        let head = self.page.styled(Style::Heading, "hit");
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
        if let Some(normal) = &hit.normal {
            let object = hit.object_normal.filter(|object| object != normal);
            let object =
                object.map_or_else(String::new, |object| format!(", {} in object space", vector(&object)));
            rows.push(("normal", format!("exact {} in world space{object}", vector(normal))));
        }
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

    fn result(&mut self, transcript: &Transcript) {
        let head = self.page.styled(Style::Heading, "result");
        self.page.line(head);
        for write in transcript.writes.iter().take(MAX_WRITES) {
            self.write(write);
        }
        let more = transcript.writes.len().saturating_sub(MAX_WRITES) + transcript.writes_left_out;
        if more > 0 {
            self.page.line(format_args!("  ... and {} more", with_plural(more as u64, "change")));
        }
        let shaders: Vec<String> = transcript
            .counts
            .shaders
            .iter()
            .map(|(stage, count)| format!("{} {stage}", grouped(count)))
            .collect();
        self.page.line(format_args!(
            "  {} traced,{} shaders run: {}",
            with_plural(transcript.counts.rays, "ray"),
            match transcript.counts.ray_queries {
                0 => String::new(),
                1 => " 1 ray query,".to_owned(),
                count => format!(" {} ray queries,", grouped(count)),
            },
            if shaders.is_empty() { "none".to_owned() } else { shaders.join(", ") }
        ));
        if let Some(trap) = &transcript.trap {
            let text = self.page.styled(Style::Bad, format_args!("trap: {}", trap.message));
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
        let name = self.page.styled(Style::Name, &write.resource);
        let place = match (write.set, write.binding) {
            (Some(set), Some(binding)) => format!(" (set {set}, binding {binding})"),
            _ => String::new(),
        };
        self.page.line(format_args!("  {name}{place}  {at}  {change}"));
    }

    /// Writes a nested part: its lines begin with one more guide.
    fn nested(&mut self, guide: &'static str, write: impl FnOnce(&mut Self)) {
        self.page.push_guide(guide);
        write(self);
        self.page.pop_guide();
    }
}
