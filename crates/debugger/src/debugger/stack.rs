//! The stack of calls: shaders that called each other, and in each its functions.

use anyhit_engine::machine::OpIndex;
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::module::interface::Stage;

use super::Debugger;
use super::debuggee::{DebuggedLane, StoppedShader};
use super::source_frames::{SourceFrame, source_frames};
use super::source_map::SourcePosition;

/// A function that has been called and not returned, of one of the shaders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StackFrame {
    /// The number of its shader among those that have begun and not ended, from the outermost.
    pub number: usize,
    /// The shader.
    pub shader: ShaderIndex,
    /// The shader's stage.
    pub stage: Stage,
    /// The name of the shader's entry point.
    pub entry_point: String,
    /// The operation or terminator of the shader that is next, or that waits.
    pub op: OpIndex,
    /// The function, and the instruction in it that is next or waits.
    pub source: SourceFrame,
    /// Where it is.
    pub position: Option<SourcePosition>,
    /// The lane that has called it, if it is not the followed one.
    pub lane: Option<usize>,
}

/// The stack at a stop, kept to the next one: shaders that wait for another are read once.
#[derive(Debug, Default)]
pub struct KeptStack {
    /// The functions that have been called and not returned, the outermost first.
    pub frames: Vec<StackFrame>,
    /// By frame: how many shaders had begun before its own.
    pub runs: Vec<u64>,
    /// By shader, the outermost first: how many had begun before it, and its first frame.
    shaders: Vec<(u64, usize)>,
}

impl KeptStack {
    /// Reads the stack of a stopped invocation, and returns how many of the outermost frames are
    /// those of the last time.
    ///
    /// A shader cannot run while another does that it waits for, so that its frames are still the
    /// same as long as that one has not ended.
    pub fn read(&mut self, debugger: &Debugger) -> usize {
        let active = &debugger.course.active;
        while let Some(&(run, first)) = self.shaders.last() {
            let number = self.shaders.len() - 1;
            self.frames.truncate(first);
            self.shaders.pop();
            if active.get(number).is_some_and(|active| active.run == run) {
                break;
            }
        }
        let kept = self.frames.len();
        self.runs.truncate(kept);
        while let Some(stopped) = debugger.debuggee.shader(self.shaders.len()) {
            let number = self.shaders.len();
            let run = debugger.course.run(number).unwrap_or_default();
            self.shaders.push((run, self.frames.len()));
            let frames = debugger.frames_of(number, &stopped, None);
            self.frames.extend(frames.into_iter().rev());
            self.runs.resize(self.frames.len(), run);
        }
        kept
    }
}

impl Debugger {
    /// The functions that have been called and not returned, the innermost first; none at the end.
    pub fn stack(&self) -> Vec<StackFrame> {
        self.frames(&self.debuggee.shaders(), None)
    }

    /// All lanes that run with the followed one, itself included; none where it runs alone.
    pub fn lanes(&self) -> Vec<DebuggedLane> {
        self.debuggee.lanes()
    }

    /// The functions that another lane has called and not returned from, the innermost first.
    pub fn stack_of(&self, lane: usize) -> Vec<StackFrame> {
        self.frames(&self.debuggee.shaders_of(lane), Some(lane))
    }

    /// The functions that a lane is in, given its shaders.
    fn frames(&self, shaders: &[StoppedShader], lane: Option<usize>) -> Vec<StackFrame> {
        let shaders = shaders.iter().enumerate().rev();
        shaders.flat_map(|(number, stopped)| self.frames_of(number, stopped, lane)).collect()
    }

    /// The functions that a lane is in, in one of its shaders.
    fn frames_of(&self, number: usize, stopped: &StoppedShader, lane: Option<usize>) -> Vec<StackFrame> {
        let sites = self.sources.shader(stopped.shader);
        let calls = stopped.calls.iter().rev().filter_map(|&return_to| sites.call_before(return_to));
        let mut frames = Vec::new();
        for op in std::iter::once(stopped.op).chain(calls) {
            let Some(&origin) = sites.program.origins.get(op.index()) else { continue };
            frames.extend(source_frames(&sites.program, origin).into_iter().map(|source| {
                StackFrame {
                    number,
                    shader: stopped.shader,
                    stage: sites.program.stage,
                    entry_point: sites.program.name.clone(),
                    op,
                    // The first operations of a function may have no line.
                    position: sites
                        .position_of(&source)
                        .or_else(|| self.sources.line(sites.first_line(source.origin.scope))),
                    source,
                    lane,
                }
            }));
        }
        frames
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::debugger::{Stepping, StopReason};
    use crate::session::{ExplainRequest, Session};
    use anyhit_scene::{DiskFiles, LoadOptions, load};

    /// Any-hit and closest-hit shaders, closest-hit shaders that trace, and callable shaders.
    const SCENES: [&str; 3] = [
        "shaders/pass/debugger/hair/scene.toml",
        "scenes/swept-spheres.toml",
        "shaders/pass/callable/operations/scene.toml",
    ];

    /// Steps through the centre of a scene's launch, reads the stack at each step whose number
    /// `reads` accepts, and returns how many frames of callers were kept and how many were read.
    fn steps(scene: &str, reads: fn(usize) -> bool) -> [usize; 2] {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join(scene);
        let session = Session::new(load(&path, &DiskFiles, &LoadOptions::default()).unwrap()).unwrap();
        let mut debugger = Debugger::of_scene(&session, &ExplainRequest::Default).unwrap();
        let (mut kept_stack, mut counts) = (KeptStack::default(), [0; 2]);
        let mut stop = debugger.begin();
        for number in 0..3000 {
            if !matches!(stop, StopReason::Entry | StopReason::Step) {
                break;
            }
            if reads(number) {
                let kept = kept_stack.read(&debugger);
                let mut whole = debugger.stack();
                whole.reverse();
                assert_eq!(kept_stack.frames, whole, "{scene}, step {number}");
                let runs = whole.iter().map(|frame| debugger.run_number(frame).unwrap());
                assert_eq!(kept_stack.runs, runs.collect::<Vec<_>>());
                let innermost = whole.last().map(|frame| frame.number);
                let callers = whole.iter().filter(|frame| Some(frame.number) < innermost).count();
                counts = [counts[0] + kept, counts[1] + callers];
            }
            stop = debugger.step(Stepping::IntoInstruction);
        }
        counts
    }

    #[test]
    fn a_kept_stack_is_the_whole_one_and_callers_are_read_once() {
        for scene in SCENES {
            let [kept, callers] = steps(scene, |_| true);
            assert!(kept * 10 > callers * 8, "{scene}: {kept} of {callers} frames of callers were kept");
            steps(scene, |number| number % 7 < 2);
        }
    }
}
