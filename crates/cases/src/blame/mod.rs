//! Finds who wrote a wrong number: runs again and observes the operations that store to it.

mod payload_writes;
mod resource_writes;

use crate::case::Loaded;
use crate::expect::Subject;
use crate::observe::fresh_resources;
use anyhit_debugger::session::ExplainRequest;
use anyhit_engine::pipeline::RunOptions;
use anyhit_explain::transcript::TranscriptLine;
use anyhit_scene::pass::PassWork;

/// What is known of the origin of a wrong number.
#[derive(Clone, Debug, Default)]
pub struct Blame {
    /// The invocation that wrote it; of a number that nothing wrote, one that may have been meant
    /// to.
    pub request: Option<ExplainRequest>,
    /// The line that wrote it.
    pub line: Option<TranscriptLine>,
    /// Who wrote it, or that nobody did, as notes of an error.
    pub notes: Vec<String>,
}

/// Finds who wrote the word that a difference is about; `ray` is the place of the ray that was
/// tested by itself.
pub fn blame(loaded: &Loaded, subject: &Subject, ray: Option<usize>) -> Blame {
    let named = |name: &String| loaded.scene.rays.iter().position(|ray| ray.name() == Some(name));
    let ray = match subject {
        Subject::Ray(name, _) => named(name),
        _ => ray,
    };
    let found = match (subject, ray) {
        (Subject::Payload(word) | Subject::Ray(_, Some(word)), Some(ray)) => {
            payload_writes::blame(loaded, &loaded.scene.rays[ray], *word as u32)
        }
        (Subject::Buffer(..) | Subject::UnboundBuffer(..) | Subject::Texel(..), _) => {
            resource_writes::blame(loaded, subject, ray)
        }
        (Subject::Invocation(id), None) => trapped_pass(loaded)
            .or_else(|| loaded.assembled.passes.iter().position(|pass| pass.launch().is_some()))
            .map(|number| Blame { request: Some(request(loaded, number, *id)), ..Blame::default() }),
        _ => None,
    };
    found.unwrap_or_default()
}

/// What asks for an invocation of a pass.
fn request(loaded: &Loaded, number: usize, id: [u32; 3]) -> ExplainRequest {
    let pass = &loaded.assembled.passes[number];
    let listed = !loaded.scene.passes.is_empty() || loaded.assembled.is_frame();
    let request = match &pass.work {
        PassWork::Dispatch(dispatch) => ExplainRequest::Invocation { dispatch: *dispatch, id },
        PassWork::Launch(_) => ExplainRequest::Pixel(id),
    };
    match listed {
        true => ExplainRequest::InPass(pass.key(number), Box::new(request)),
        false => request,
    }
}

/// The pass that traps.
fn trapped_pass(loaded: &Loaded) -> Option<usize> {
    let resources = fresh_resources(&loaded.assembled);
    let passes = &loaded.assembled.passes;
    passes.iter().position(|pass| loaded.assembled.run_pass(pass, &resources, RunOptions::default()).is_err())
}

/// The note on the last write, where `was_unchanged` says that it left what was there before.
fn last_write(line: Option<&TranscriptLine>, shader: &str, was_unchanged: bool) -> String {
    let unchanged = if was_unchanged { ", with an unchanged value," } else { "" };
    match line {
        Some(TranscriptLine { file, line, text }) => {
            let text = text.as_ref().map_or_else(String::new, |text| format!(": {text}"));
            format!("last written{unchanged} at {file}:{line}{text}")
        }
        None => format!(
            "last written{unchanged} by {shader}, whose module has no line information: \
            compile it with -g"
        ),
    }
}
