//! The stack of calls: shaders that called each other, and in each its functions.

use crate::machine::OpIndex;
use crate::machine::ShaderIndex;
use crate::module::interface::Stage;

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
        let mut frames = Vec::new();
        for (number, stopped) in shaders.iter().enumerate().rev() {
            let sites = self.sources.shader(stopped.shader);
            let calls = stopped.calls.iter().rev().filter_map(|&return_to| sites.call_before(return_to));
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
        }
        frames
    }
}
