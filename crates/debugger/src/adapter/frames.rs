//! The stack and its scopes.

use emmy_dap_types::requests::{ScopesArguments, StackTraceArguments};
use emmy_dap_types::responses::{ScopesResponse, StackTraceResponse};
use emmy_dap_types::types::{
    Scope, ScopePresentationhint, StackFrame as ShownFrame, StackFrameModuleid, StackFramePresentationhint,
};

use crate::debugger::{StackFrame, VariableKind};
use anyhit_base::error::Stage;

use super::disassembly::reference;
use super::protocol::{Answer, Request, body};
use super::stopped::{Handle, ScopeKind, StackRow};
use super::{Adapter, Launched};

/// The scopes of a frame, in the order in which they are shown, with the kinds of their variables.
const SCOPES: &[(ScopeKind, &str, &[VariableKind])] = &[
    (ScopeKind::Locals, "Locals", &[VariableKind::Parameter, VariableKind::Local]),
    (
        ScopeKind::Payload,
        "Payload and attributes",
        &[
            VariableKind::Payload,
            VariableKind::CallableData,
            VariableKind::HitAttribute,
            VariableKind::ShaderRecord,
        ],
    ),
    (ScopeKind::Builtins, "Builtins", &[VariableKind::Builtin]),
    (
        ScopeKind::Globals,
        "Globals and resources",
        &[
            VariableKind::PushConstant,
            VariableKind::Global,
            VariableKind::Workgroup,
            VariableKind::Buffer,
            VariableKind::Resource,
        ],
    ),
    (ScopeKind::Registers, "Registers", &[VariableKind::Temporary]),
];

impl ScopeKind {
    /// The kinds of its variables.
    pub(super) fn kinds(self) -> &'static [VariableKind] {
        SCOPES.iter().find(|(kind, ..)| *kind == self).map_or(&[], |(.., kinds)| kinds)
    }
}

impl Adapter {
    /// Reads the stack where the invocation has stopped.
    pub(super) fn renew_stack(&mut self) {
        let Some(launched) = &mut self.launched else { return };
        let rows = launched.rows_of(launched.console.debugger.stack());
        launched.stopped.renew(rows);
    }

    pub(super) fn stack_trace(&mut self, request: &Request) -> Answer {
        let arguments: StackTraceArguments = request.arguments()?;
        let client = self.client;
        let launched = self.stopped()?;
        let lane = launched.lane_of(arguments.thread_id)?;
        if let Some(other) = lane.filter(|_| !launched.stopped.knows(lane)) {
            let rows = launched.rows_of(launched.console.debugger.stack_of(other));
            launched.stopped.add_stack(lane, rows);
        }
        let rows = launched.stopped.rows(lane);
        let total = rows.len();
        let first = arguments.start_frame.map_or(0, |first| usize::try_from(first).unwrap_or(0));
        // 0 stands for all.
        let levels = arguments.levels.filter(|&levels| levels > 0);
        let levels = levels.map_or(usize::MAX, |levels| usize::try_from(levels).unwrap_or(usize::MAX));
        let shown = rows.skip(first).take(levels).map(|(id, row)| match row {
            StackRow::Call(name) => ShownFrame {
                id,
                name: name.clone(),
                presentation_hint: Some(StackFramePresentationhint::Label),
                ..ShownFrame::default()
            },
            StackRow::Function(frame) => {
                let position = frame.position;
                let column = frame.source.line.map_or(0, |line| line.column);
                ShownFrame {
                    id,
                    name: frame_name(frame),
                    source: position.map(|position| launched.sources.source(position.file)),
                    line: position.map_or(0, |at| client.line(launched.sources.shown_line(at))),
                    column: position.map_or(0, |_| client.column(column)),
                    instruction_pointer_reference: Some(reference(
                        frame.shader.index(),
                        frame.source.origin.offset,
                    )),
                    module_id: Some(StackFrameModuleid::Number(frame.shader.index() as i64)),
                    ..ShownFrame::default()
                }
            }
        });
        body(StackTraceResponse { stack_frames: shown.collect(), total_frames: Some(total as i64) })
    }

    pub(super) fn scopes(&mut self, request: &Request) -> Answer {
        let arguments: ScopesArguments = request.arguments()?;
        let launched = self.stopped()?;
        let frame = launched.stopped.frame(arguments.frame_id)?.clone();
        let globals = launched.console.debugger.globals(&frame);
        let locals = launched.console.debugger.locals(&frame).len();
        let mut scopes = Vec::new();
        for (kind, name, kinds) in SCOPES {
            let count = match kind {
                ScopeKind::Locals => Some(locals),
                // They are counted when somebody opens the scope.
                ScopeKind::Registers => None,
                _ => Some(globals.iter().filter(|one| kinds.contains(&one.kind)).count()),
            };
            if count == Some(0) && *kind != ScopeKind::Locals {
                continue;
            }
            scopes.push(Scope {
                name: (*name).to_owned(),
                presentation_hint: match kind {
                    ScopeKind::Locals => Some(ScopePresentationhint::Locals),
                    ScopeKind::Registers => Some(ScopePresentationhint::Registers),
                    _ => None,
                },
                variables_reference: launched.stopped.add(Handle::Scope(frame.clone(), *kind)),
                named_variables: count.map(|count| count as i64),
                expensive: *kind == ScopeKind::Registers,
                ..Scope::default()
            });
        }
        body(ScopesResponse { scopes })
    }
}

impl Launched {
    /// The rows of a stack: of a shader that waits for another one, also the instruction that it
    /// waits in.
    fn rows_of(&self, frames: Vec<StackFrame>) -> Vec<StackRow> {
        let mut rows: Vec<StackRow> = Vec::new();
        let mut inner = None;
        for frame in frames {
            if inner.is_some_and(|number| number != frame.number) {
                let opcode = self.console.debugger.sources().shader(frame.shader).opcode(frame.op);
                rows.push(StackRow::Call(format!("[{opcode}]")));
            }
            inner = Some(frame.number);
            rows.push(StackRow::Function(Box::new(frame)));
        }
        rows
    }
}

/// A function's name, with the stage of its shader where it is the entry point.
fn frame_name(frame: &StackFrame) -> String {
    let function = &frame.source.function;
    let function = if function.is_empty() { frame.entry_point.as_str() } else { function };
    format!("{function} [{}]", stage_name(frame.stage))
}

/// A stage as people say it.
pub(super) fn stage_name(stage: Stage) -> &'static str {
    match stage {
        Stage::RayGeneration => "ray generation",
        Stage::Intersection => "intersection",
        Stage::AnyHit => "any-hit",
        Stage::ClosestHit => "closest-hit",
        Stage::Miss => "miss",
        Stage::Callable => "callable",
        Stage::Compute => "compute",
        Stage::Other(_) => stage.name(),
    }
}
