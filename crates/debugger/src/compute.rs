//! Explains one invocation of a dispatch.

use crate::memory::Snapshot;
use crate::session::{ExplainRequest, Session, count_events, invalid, run_counts};
use crate::{shell, summary};
use anyhit_base::error::{Error, ErrorReport, Result};
use anyhit_base::escape;
use anyhit_engine::machine::Resources;
use anyhit_engine::pipeline::{Event, RunPart};
use anyhit_explain::names::Names;
use anyhit_explain::reader::EventReader;
use anyhit_explain::transcript::{DispatchIndex, MemoryChange, Transcript, VERSION};
use anyhit_scene::pass::{Dispatch, Pass, PassWork};

impl Session {
    /// The invocation of a dispatch that a request means. By default that is the one in the middle
    /// of the pass, or of the first dispatch of a scene that neither launches nor has rays.
    ///
    /// # Errors
    /// `InvalidArgument` where the pass is none, or a launch.
    pub(super) fn invocation(&self, request: &ExplainRequest) -> Result<Option<(usize, [u32; 3])>> {
        let middle = |number: usize| {
            let dispatch = self.assembled.dispatches.get(number)?;
            Some((number, dispatch.invocations(dispatch.given_groups).map(|side| side / 2)))
        };
        Ok(match request {
            ExplainRequest::Invocation { dispatch, id } => Some((*dispatch, *id)),
            ExplainRequest::Default if self.scene.rays.is_empty() && !self.scene.launches() => middle(0),
            ExplainRequest::InPass(key, request) => {
                let number = self.assembled.pass_number(key)?;
                let pass = &self.assembled.passes[number];
                match (&pass.work, &**request) {
                    (PassWork::Dispatch(dispatch), ExplainRequest::Default) => middle(*dispatch),
                    (PassWork::Dispatch(dispatch), ExplainRequest::Invocation { id, .. }) => {
                        Some((*dispatch, *id))
                    }
                    (PassWork::Launch(_), ExplainRequest::Invocation { .. }) => {
                        let message = format!("pass {} is a launch, not a dispatch", pass.label(number));
                        let arguments = format!(" --pass {} --pixel 0,0", shell::word(key));
                        let note = self.suggestion(&arguments, "explains a pixel of it");
                        return Err(invalid(message).note(note));
                    }
                    _ => None,
                }
            }
            _ => None,
        })
    }

    /// The dispatch of a number.
    ///
    /// # Errors
    /// `InvalidArgument` where the scene has no such dispatch.
    pub(super) fn dispatch(&self, number: usize) -> Result<&Dispatch> {
        let count = self.assembled.dispatches.len();
        self.assembled.dispatches.get(number).ok_or_else(|| match count {
            0 => invalid("the scene dispatches no compute shader, so it has no invocations")
                .note(self.suggestion(" --pixel 0,0", "explains a pixel of its launch")),
            _ => invalid(format!("the scene has no dispatch {number}"))
                .note(format!("dispatches are numbered from 0 to {}", count - 1)),
        })
    }

    /// The pass of a dispatch, with its number.
    fn pass_of(&self, dispatch: usize) -> (usize, &Pass) {
        let is_wanted = |pass: &Pass| matches!(pass.work, PassWork::Dispatch(at) if at == dispatch);
        let passes = &self.assembled.passes;
        let at = passes.iter().position(is_wanted).expect("bug in anyhit: a dispatch without a pass");
        (at, &passes[at])
    }

    /// Runs the passes before a dispatch on the session's resources; returns the dispatch's own.
    ///
    /// # Errors
    /// As [`Session::dispatch`], and those of the run.
    pub(super) fn run_before_dispatch(&self, number: usize) -> Result<&Pass> {
        self.dispatch(number)?;
        let (at, pass) = self.pass_of(number);
        self.assembled.run_before(at, &self.assembled.resources)?;
        Ok(pass)
    }

    /// Runs the workgroup of an invocation of a dispatch, on resources as the dispatch finds them,
    /// and returns the transcript of the invocation with the changes that itself made.
    pub(super) fn run_invocation(
        &self,
        number: usize,
        id: [u32; 3],
        all: &Resources,
    ) -> Result<(Transcript, Option<Error>)> {
        let dispatch = self.dispatch(number)?;
        let (at, pass) = self.pass_of(number);
        let pipeline = dispatch.compute.as_pipeline()?;
        let resources = self.assembled.pass_resources(pass, all);
        let groups = dispatch.groups(&resources);
        // What was printed before is not the invocation's.
        let take = || all.printed.as_ref().map_or_else(Vec::new, |printed| printed.take());
        take();
        let written = self.assembled.written_memory(all);
        let (mut snapshot, mut writes, mut left_out) = (None, Vec::<MemoryChange>::new(), 0);
        let observed = dispatch.compute.run_invocation(&resources, groups, id, &mut |part| match part {
            RunPart::Begins => snapshot = Some(Snapshot::take(&self.scene, &written, all)),
            RunPart::Ends => {
                let Some(before) = snapshot.take() else { return };
                let (more, also) = before.changes(&self.scene, &pipeline, all, pass, None);
                writes.extend(more);
                left_out += also;
            }
        })?;
        let printed = take().into_iter().filter(|line| line.launch_id == id);
        let printed: Vec<String> = printed.map(|line| line.text).collect();
        let counts = run_counts(&count_events(&observed.events));
        let module = self.scene.dispatches[number].shader.module;
        let names = Names::of_dispatch(&self.scene, module, &pipeline).with_memory(&resources.memory);
        // When it printed between its ray queries is not told: the texts stand behind these.
        let is_end = |event: &Event| matches!(event, Event::Leave { .. });
        let end = observed.events.iter().rposition(is_end).unwrap_or(observed.events.len());
        let own = printed.iter().map(|text| (end, text.clone())).collect();
        let root = EventReader::new(&pipeline, names, observed.events).with_printed(own).root();
        let root = root.ok_or_else(|| invalid("a limit ended the workgroup before the invocation began"))?;
        let mut transcript = Transcript {
            version: VERSION,
            scene: escape::path(&self.scene.path).to_string(),
            ray_name: None,
            pass: (!self.scene.passes.is_empty()).then(|| pass.key(at)),
            launch: None,
            summary: Vec::new(),
            hints: Vec::new(),
            dispatch: Some(DispatchIndex {
                dispatch: number,
                id,
                groups,
                workgroup_size: dispatch.compute.workgroup_size(),
            }),
            root,
            writes,
            writes_left_out: left_out,
            printed,
            counts,
            trap: observed.trap.as_ref().map(ErrorReport::of),
            lines_cut: false,
        };
        summary::complete(&mut transcript);
        Ok((transcript, observed.trap))
    }
}
