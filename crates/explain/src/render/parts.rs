//! Renders parts of a transcript: the rays and shader runs that a filter lets through.

use crate::render::words::{label, source_suffix};
use crate::render::{RenderOptions, Writer, shader};
use crate::summary_words;
use crate::transcript::{ShaderLabel, ShaderRun, Step, Transcript, TranscriptLine};
use crate::walk::{self, AnyRay};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::sorted::sort;

/// Which parts of a transcript are shown: those that fit all that is given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PageFilter {
    /// Rays at this depth; with a shader or a line, the shaders that such rays call.
    pub depth: Option<u32>,
    /// What followed from this ray of the outermost shader, counted from 0.
    pub sample: Option<usize>,
    /// Runs of the shader with this name, file, entry point or stage.
    pub shader: Option<String>,
    /// What happened at this line of the file with this name, or these last components of a path.
    pub at: Option<(String, u32)>,
}

impl PageFilter {
    /// Whether it lets everything through.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Whether a shader is the one that is wanted.
    fn names(&self, one: &ShaderLabel) -> bool {
        let Some(wanted) = &self.shader else { return true };
        let stem = |file: &String| file.strip_suffix(".spv").is_some_and(|stem| stem == wanted);
        one.name.as_ref() == Some(wanted)
            || one.file.as_ref().is_some_and(|file| file == wanted || stem(file))
            || one.entry == *wanted
            || one.stage.trim_end_matches("KHR").eq_ignore_ascii_case(wanted.trim_end_matches("KHR"))
    }

    /// Whether a line is the one that is wanted.
    fn is_at(&self, file: &str, line: u32) -> bool {
        let Some((wanted, number)) = &self.at else { return true };
        let ends =
            file.strip_suffix(wanted.as_str()).is_some_and(|rest| rest.is_empty() || rest.ends_with('/'));
        ends && *number == line
    }

    fn is_called_at(&self, line: Option<&TranscriptLine>) -> bool {
        self.at.is_none() || line.is_some_and(|line| self.is_at(&line.file, line.line))
    }
}

/// Renders the parts of a transcript that a filter lets through, each under its place.
///
/// # Errors
/// `InvalidArgument` where there are none, with what there is.
pub fn parts(transcript: &Transcript, filter: &PageFilter, options: RenderOptions) -> Result<String> {
    let mut writer = Writer::of(transcript, options);
    writer.title(transcript);
    let mut search = Search { filter, writer, found: 0 };
    match (&transcript.root, filter.sample) {
        (root, None) => search.step(root, &[], None),
        (root, Some(number)) => {
            let samples = walk::samples(root);
            let step = *samples.get(number).ok_or_else(|| {
                invalid(format!("ray {number} does not exist: the outermost shader traces {}", samples.len()))
                    .note("--sample numbers rays from 0")
            })?;
            let path = match root {
                Step::Shader(run) => vec![summary_words::label(&run.shader)],
                _ => Vec::new(),
            };
            search.step(step, &path, Some(number));
        }
    }
    if search.found == 0 {
        return Err(nothing(transcript));
    }
    Ok(search.writer.page.finish())
}

fn nothing(transcript: &Transcript) -> Error {
    let rays = walk::rays(&transcript.root);
    let depth = |ray: AnyRay<'_>| match ray {
        AnyRay::Trace(trace) => trace.depth,
        AnyRay::Query(_) => 0,
    };
    let deepest = rays.into_iter().map(depth).max().unwrap_or(0);
    let mut shaders: Vec<String> =
        walk::runs(&transcript.root).into_iter().map(|run| summary_words::label(&run.shader)).collect();
    sort(&mut shaders);
    shaders.dedup();
    invalid("no ray or shader matches --depth, --sample, --shader and --at together")
        .note(format!("the deepest ray is at depth {deepest}; the shaders that ran: {}", shaders.join(", ")))
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}

struct Search<'a> {
    filter: &'a PageFilter,
    writer: Writer<'a>,
    found: usize,
}

impl Search<'_> {
    /// Shows what fits in a step; `path` is the shaders and rays around it.
    fn step(&mut self, step: &Step, path: &[String], number: Option<usize>) {
        let mut inner = path.to_vec();
        if let Some(ray) = AnyRay::of_step(step) {
            let is_deep = match (ray, self.filter.depth) {
                (_, None) => true,
                (AnyRay::Trace(trace), Some(depth)) => trace.depth == depth,
                (AnyRay::Query(_), Some(_)) => false,
            };
            let is_meant = self.filter.shader.is_none() && is_deep;
            if is_meant && self.filter.is_called_at(ray.traversal().called_at.as_ref()) {
                self.show(path, |writer| writer.step(step));
                return;
            }
            let name = match ray {
                AnyRay::Trace(trace) => format!("ray at depth {}", trace.depth),
                AnyRay::Query(_) => "ray query".to_owned(),
            };
            inner.push(match number {
                Some(number) => format!("{name} (number {number})"),
                None => name,
            });
        }
        let outer = self.writer.depth;
        if let Step::Trace(trace) = step {
            self.writer.depth = trace.depth;
        }
        for run in walk::shaders(step) {
            self.run(run, &inner);
        }
        self.writer.depth = outer;
    }

    fn run(&mut self, run: &ShaderRun, path: &[String]) {
        let is_deep = self.filter.depth.is_none_or(|depth| self.writer.depth == depth);
        let is_named = is_deep && self.filter.names(&run.shader);
        match (&self.filter.at, &self.filter.shader) {
            (None, Some(_)) if is_named => {
                self.show(path, |writer| writer.shader(run));
                return;
            }
            (Some(_), _) if is_named => self.lines(run, path),
            _ => {}
        }
        let path: Vec<String> = path.iter().cloned().chain([summary_words::label(&run.shader)]).collect();
        let mut rays = 0;
        for step in &run.steps {
            let is_ray = AnyRay::of_step(step).is_some();
            self.step(step, &path, is_ray.then_some(rays));
            rays += usize::from(is_ray);
        }
    }

    /// Shows what a shader ran, printed or ended with at the wanted line.
    fn lines(&mut self, run: &ShaderRun, path: &[String]) {
        let filter = self.filter;
        let ran: Vec<_> = run.lines.iter().filter(|line| filter.is_at(&line.file, line.line)).collect();
        let is_at = |file: &Option<String>, line: Option<u32>| {
            file.as_ref().zip(line).is_some_and(|(file, line)| filter.is_at(file, line))
        };
        let printed: Vec<_> = run.printed.iter().filter(|text| is_at(&text.file, text.line)).collect();
        let ended = run.exit.at.as_ref().filter(|line| filter.is_at(&line.file, line.line));
        if ran.is_empty() && printed.is_empty() && ended.is_none() {
            return;
        }
        self.show(path, |writer| {
            writer.page.line(format_args!("{} {}", run.shader.stage, label(&run.shader)));
            let width = shader::width(&ran);
            ran.into_iter().for_each(|line| writer.executed_line(line, width));
            printed.into_iter().for_each(|text| writer.printed(text));
            if let Some(at) = ended {
                let message = run.exit.message.unwrap_or_default();
                writer.page.line(format_args!("TRAPPED: {message}{}", source_suffix(Some(at), "")));
            }
        });
    }

    fn show(&mut self, path: &[String], write: impl FnOnce(&mut Writer<'_>)) {
        if self.found > 0 {
            self.writer.page.blank_line();
        }
        self.found += 1;
        if !path.is_empty() {
            self.writer.page.line(format_args!("in {}:", path.join(" > ")));
        }
        write(&mut self.writer);
    }
}
