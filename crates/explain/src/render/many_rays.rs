//! Sums up the rays of a shader that traces many.

use crate::render::Writer;
use crate::summary_words::{counts, label, outcome, primitive};
use crate::transcript::{ShaderRun, Trace, TranscriptLine};
use crate::walk::AnyRay;
use anyhit_base::count::grouped;
use anyhit_base::style::Style;
use anyhit_engine::math::array;

/// How many rays a shader traces at most that are shown one by one.
const MAX_RAYS: usize = 4;
/// How many rays are listed of a line.
const MAX_ROWS: usize = 32;
/// How long the text of a payload is in the list, in characters.
const MAX_PAYLOAD: usize = 48;

/// The rays that a shader traced at one line.
pub(super) struct RayTable<'a> {
    line: Option<&'a TranscriptLine>,
    verb: &'static str,
    /// The ray's step, its number among the shader's rays, and it.
    rays: Vec<(usize, usize, AnyRay<'a>)>,
    /// Whether they are of the outermost shader.
    are_samples: bool,
}

impl RayTable<'_> {
    /// Whether a step of the shader is one of its rays.
    pub(super) fn holds(&self, step: usize) -> bool {
        self.rays.iter().any(|(at, ..)| *at == step)
    }

    /// Whether a step of the shader is the first of its rays.
    pub(super) fn begins(&self, step: usize) -> bool {
        self.rays.first().is_some_and(|(at, ..)| *at == step)
    }
}

impl Writer<'_> {
    /// The rays of a shader by line, where they are too many to be shown one by one.
    pub(super) fn tables<'r>(&self, run: &'r ShaderRun) -> Vec<RayTable<'r>> {
        let steps = run.steps.iter().enumerate();
        let rays = steps.filter_map(|(at, step)| Some((at, AnyRay::of_step(step)?)));
        let rays: Vec<(usize, AnyRay<'r>)> = rays.collect();
        if self.options.all || rays.len() <= MAX_RAYS {
            return Vec::new();
        }
        let are_samples = self.root.is_some_and(|root| root.run == run.run);
        let mut tables: Vec<RayTable<'r>> = Vec::new();
        for (number, &(at, ray)) in rays.iter().enumerate() {
            let line = ray.traversal().called_at.as_ref();
            let verb = match ray {
                AnyRay::Trace(_) => "traced",
                AnyRay::Query(_) => "initialised",
            };
            let place = |line: Option<&TranscriptLine>| line.map(|line| (line.file.clone(), line.line));
            let same = tables.iter_mut().find(|one| one.verb == verb && place(one.line) == place(line));
            match same {
                Some(table) => table.rays.push((at, number, ray)),
                None => tables.push(RayTable { line, verb, rays: vec![(at, number, ray)], are_samples }),
            }
        }
        tables
    }

    /// One line for each ray, after one for all.
    pub(super) fn table(&mut self, table: &RayTable<'_>) {
        let rays: Vec<AnyRay<'_>> = table.rays.iter().map(|(.., ray)| *ray).collect();
        let what = if table.verb == "traced" { "ray" } else { "ray query" };
        let plural = match (what, rays.len()) {
            (what, 1) => what.to_owned(),
            ("ray query", _) => "ray queries".to_owned(),
            (what, _) => format!("{what}s"),
        };
        let head = self.page.styled(Style::Heading, format_args!("{} {plural}", grouped(rays.len())));
        let line = table.line.map_or_else(String::new, |line| format!(" at {}:{}", line.file, line.line));
        self.page.line(format_args!("{head} {}{line}: {}", table.verb, counts(&rays)));
        let rows: Vec<[String; 5]> = table
            .rays
            .iter()
            .take(MAX_ROWS)
            .map(|(_, number, ray)| {
                let [fate, t, shader, payload] = cells(*ray);
                [number.to_string(), fate, t, shader, payload]
            })
            .collect();
        let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: [usize; 5] = array::from_fn(width);
        for row in &rows {
            let [number, cells @ ..] = row;
            let cells: Vec<String> =
                cells.iter().zip(&widths[1..]).map(|(cell, &width)| format!("{cell:<width$}")).collect();
            let number = format!("{number:>0$}", widths[0]);
            let number = self.page.styled(Style::Name, number);
            self.page.line(format_args!("  {number}  {}", cells.join("  ")));
        }
        if let Some(rest) = rays.get(MAX_ROWS..).filter(|rest| !rest.is_empty()) {
            let text = format!("  ... {} more: {}", grouped(rest.len()), counts(rest));
            self.page.line(self.page.styled(Style::Faint, text));
        }
        let first = table.rays.first().map_or(0, |(_, number, _)| *number);
        let how = match table.are_samples {
            true => format!("--sample {first} shows the first of them, --all shows all"),
            false => "--all shows each".to_owned(),
        };
        self.page.line(self.page.styled(Style::Faint, format_args!("  {how}")));
    }
}

/// What a ray hit, its t, the shader that ran and the payload after it.
fn cells(ray: AnyRay<'_>) -> [String; 4] {
    let (fate, t) = match ray.hit() {
        Some(hit) => (format!("hit {}", primitive(hit)), format!("t {}", hit.t)),
        None => (outcome(ray), String::new()),
    };
    let (shader, payload) = match ray {
        AnyRay::Trace(Trace { shader, payload_after, .. }) => {
            let shader = shader.as_ref().map_or_else(|| "no shader".to_owned(), |run| label(&run.shader));
            let payload = payload_after.as_ref().map_or_else(String::new, |value| {
                let text = value.content.to_string();
                match text.char_indices().nth(MAX_PAYLOAD) {
                    Some((end, _)) => format!("payload{}...", &text[..end]),
                    None => format!("payload{text}"),
                }
            });
            (shader, payload)
        }
        AnyRay::Query(_) => (String::new(), String::new()),
    };
    [fate, t, shader, payload]
}
