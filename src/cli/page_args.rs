//! Options of `trace-one-ray` that choose what of the page is shown.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::cli::numbers;
use anyhit_base::atomic_file;
use anyhit_base::error::Result;
use anyhit_debugger::Session;
use anyhit_debugger::line_recorder::FollowedRuns;
use anyhit_explain::Transcript;
use anyhit_explain::render::PageFilter;

/// The shaders whose lines are shown with the values of variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Locals {
    /// The closest-hit or miss shader of the first ray, or of the ray of --sample
    Hit,
    /// Every shader that runs
    All,
    /// No shader
    None,
}

/// What of the page is shown.
#[derive(Args, Clone, Debug)]
pub(super) struct PageArgs {
    /// Print only the summary
    #[arg(long, conflicts_with_all = ["json", "interactive"])]
    pub summary: bool,
    /// Shaders whose lines are shown, with the variables that they set [default: hit; all with
    /// --shader or --at]
    #[arg(long, value_enum, value_name = "SHADERS")]
    locals: Option<Locals>,
    /// Show only rays at this depth; rays from ray generation have depth 1
    #[arg(long, value_name = "N", conflicts_with_all = ["json", "interactive"], value_parser = numbers::from_one_u32)]
    depth: Option<u32>,
    /// Show only this ray of the outermost shader, with everything that follows from it; rays and
    /// ray queries are numbered from 0 in the order in which they are traced
    #[arg(long, value_name = "N", conflicts_with_all = ["interactive"])]
    sample: Option<usize>,
    /// Show only invocations of the shader with this name, file, entry point or stage
    #[arg(long, value_name = "NAME", conflicts_with_all = ["json", "interactive"])]
    shader: Option<String>,
    /// Show only the events at this line: rays traced, values set, texts printed
    #[arg(long, value_name = "FILE:LINE", value_parser = line, conflicts_with_all = ["json", "interactive"])]
    at: Option<(String, u32)>,
    /// Show where this run differs from another: `pixel=X,Y`, `precision=float`, `double` or
    /// `exact`, another scene file, or a file with the output of --json
    #[arg(long, value_name = "OTHER", conflicts_with_all = ["json", "interactive", "summary"])]
    pub compare: Option<String>,
    /// Draw the ray (or the ray of --sample), the boxes of instances and the primitives tested, as
    /// .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture, conflicts_with = "compare")]
    draw: Option<PathBuf>,
    /// Write the ray, the boxes of instances and the primitives tested as a Wavefront OBJ
    #[arg(long, value_name = "FILE", conflicts_with = "compare")]
    obj: Option<PathBuf>,
}

impl PageArgs {
    /// What of the page is shown.
    pub(super) fn filter(&self) -> PageFilter {
        PageFilter {
            depth: self.depth,
            sample: self.sample,
            shader: self.shader.clone(),
            at: self.at.clone(),
        }
    }

    /// The shader runs whose lines are followed; `all` where nothing is asked for.
    pub(super) fn followed(&self, transcript: &Transcript, all: bool) -> FollowedRuns {
        let all = all || self.shader.is_some() || self.at.is_some();
        match self.locals {
            Some(Locals::All) => FollowedRuns::All,
            None if all => FollowedRuns::All,
            Some(Locals::None) => FollowedRuns::Only(Vec::new()),
            Some(Locals::Hit) | None => FollowedRuns::of_sample(transcript, self.sample.unwrap_or(0)),
        }
    }

    /// Writes the pictures that are asked for.
    ///
    /// # Errors
    /// `InvalidArgument` where there is no ray to draw, `Io` where a file cannot be written.
    pub(super) fn draw(&self, session: &Session, transcript: &Transcript) -> Result<()> {
        if self.draw.is_none() && self.obj.is_none() {
            return Ok(());
        }
        let drawing = session.drawing(transcript, self.sample.unwrap_or(0))?;
        if let Some(path) = &self.draw {
            let bytes = match path.extension().is_some_and(|extension| extension == "png") {
                true => drawing.png()?,
                false => drawing.svg().into_bytes(),
            };
            atomic_file::write(path, bytes)?;
        }
        match &self.obj {
            Some(path) => atomic_file::write(path, drawing.obj()),
            None => Ok(()),
        }
    }
}

/// The file of a picture.
fn picture(text: &str) -> std::result::Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("svg" | "png") => Ok(path),
        _ => Err(format!("`{text}` does not end in .svg or .png")),
    }
}

/// A file and a line: `main.rgen:19`.
fn line(text: &str) -> std::result::Result<(String, u32), String> {
    let (file, line) = text.rsplit_once(':').ok_or("expected FILE:LINE, such as `main.rgen:19`")?;
    let line = numbers::from_one_u32(line).map_err(|_| format!("`{line}` is not a line number"))?;
    if file.is_empty() {
        return Err("the file is missing before `:`".to_owned());
    }
    Ok((file.to_owned(), line))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_a_file_and_a_number() {
        assert_eq!(line("main.rgen:19"), Ok(("main.rgen".to_owned(), 19)));
        assert_eq!(line("C:/a.rgen:3"), Ok(("C:/a.rgen".to_owned(), 3)));
        assert!(
            line("main.rgen").is_err()
                && line("main.rgen:x").is_err()
                && line("main.rgen:0").is_err()
                && line(":3").is_err()
        );
    }
}
