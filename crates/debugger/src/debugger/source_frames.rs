//! The functions of the source that a stopped invocation is in: those that this crate or the
//! compiler has inlined are frames of their own.

use std::sync::Arc;

use anyhit_engine::module::debug_info::SourceLine;
use anyhit_engine::module::debug_scopes::ScopePosition;
use anyhit_engine::ops::translate::Origin;
use anyhit_engine::program::Program;

/// A function of the source, and where in it an invocation is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFrame {
    /// The function's name.
    pub function: Arc<str>,
    /// The line: of the instruction that runs next, or of the call of the frame above.
    pub line: Option<SourceLine>,
    /// The instruction of the module, and the inlined call of the program that it is in.
    pub origin: Origin,
    /// The lexical scope, and the call that the compiler inlined, where debug information tells.
    pub position: Option<ScopePosition>,
}

/// The frames at an instruction, the innermost first. The last one is the entry point, or a
/// function that is not inlined: its caller is not told by the instruction.
pub fn source_frames(program: &Program, origin: Origin) -> Vec<SourceFrame> {
    let module = &program.module;
    let debug = module.debug_scopes();
    let mut frames = Vec::new();
    let mut origin = origin;
    while let Some(scope) = program.scopes.get(origin.scope as usize) {
        let function = module.function(scope.function);
        let mut position = function.and_then(|function| debug.position(function, origin.offset));
        let mut line = module.debug_info.line_at(origin.offset);
        loop {
            let named = position.and_then(|position| debug.function_name(position.scope)).cloned();
            let name = || module.name(scope.function).unwrap_or_default().into();
            let function = named.filter(|name| !name.is_empty()).unwrap_or_else(name);
            frames.push(SourceFrame { function, line, origin, position });
            let Some(inlined) = position.and_then(|position| position.inlined) else { break };
            // A call stands before those that are inlined into it, so that the chain ends.
            let Some(&call) = debug.inlined_calls.get(inlined as usize) else { break };
            line = debug.call_line(call);
            position = Some(ScopePosition {
                scope: call.scope,
                inlined: call.inlined.filter(|&outer| outer < inlined),
            });
        }
        if scope.call == 0 {
            break;
        }
        origin = Origin { offset: scope.call, scope: scope.parent };
    }
    frames
}
