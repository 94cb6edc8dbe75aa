//! The stack of calls: shaders that called each other, and in each its functions.

use crate::machine::OpIndex;
use crate::machine::ShaderIndex;
use crate::module::interface::Stage;

use super::Debugger;
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
    /// The operation or terminator of the shader that is next, or that waits.
    pub op: OpIndex,
    /// The inlined call that the function is, an index into the program's scopes.
    pub scope: u32,
    /// The instruction that is next or waits in this function, in words from the start of the
    /// module.
    pub offset: u32,
    /// The function's name.
    pub function: String,
    /// Where it is.
    pub position: Option<SourcePosition>,
    /// Whether it is the entry point of its shader.
    pub is_entry: bool,
}

impl Debugger {
    /// The functions that have been called and not returned, the innermost first; none at the end.
    pub fn stack(&self) -> Vec<StackFrame> {
        let mut frames = Vec::new();
        for (number, stopped) in self.debuggee.shaders().iter().enumerate().rev() {
            let sites = self.sources.shader(stopped.shader);
            let calls = stopped.calls.iter().rev().filter_map(|&return_to| sites.call_before(return_to));
            for op in std::iter::once(stopped.op).chain(calls) {
                let (mut scope, mut offset) = (sites.site(op).scope, sites.offset(op));
                loop {
                    let within = sites.program.scopes[scope as usize];
                    let is_called = scope != 0 && within.call == 0;
                    frames.push(StackFrame {
                        number,
                        shader: stopped.shader,
                        stage: sites.program.stage,
                        op,
                        scope,
                        offset,
                        function: sites.function_name(scope),
                        position: sites.position(offset),
                        is_entry: scope == 0,
                    });
                    if scope == 0 || is_called {
                        break;
                    }
                    (scope, offset) = (within.parent, within.call);
                }
            }
        }
        frames
    }
}
