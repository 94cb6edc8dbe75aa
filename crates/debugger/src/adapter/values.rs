//! Variables and expressions.

use std::collections::HashSet;

use emmy_dap_types::requests::{
    EvaluateArguments, SetExpressionArguments, SetVariableArguments, VariablesArguments,
};
use emmy_dap_types::responses::{
    EvaluateResponse, SetExpressionResponse, SetVariableResponse, VariablesResponse,
};
use emmy_dap_types::types::{EvaluateArgumentsContext, Variable as ShownVariable, VariablesArgumentsFilter};
use serde_json::json;

use crate::debugger::lane_state::LaneState;
use crate::debugger::{StackFrame, Variable, VariablePlace};

use super::protocol::{Answer, Refusal, Request, body};
use super::stopped::{Handle, ScopeKind};
use super::{Adapter, Launched};

/// The most parts of a value that are listed at a time.
const MOST_PARTS: u64 = 10_000;

/// A value with the name that it is shown under.
struct Named {
    name: String,
    place: VariablePlace,
    /// The expression that stands for it, where there is one.
    expression: Option<String>,
    /// Whether its declaration has been reached.
    is_declared: bool,
}

impl Adapter {
    pub(super) fn variables(&mut self, request: &Request) -> Answer {
        let arguments: VariablesArguments = request.arguments()?;
        let launched = self.stopped()?;
        let handle = launched.stopped.handle(arguments.variables_reference)?.clone();
        let index = |number: Option<i64>| number.and_then(|number| u64::try_from(number).ok()).unwrap_or(0);
        let first = index(arguments.start);
        // 0 stands for all.
        let count = Some(index(arguments.count)).filter(|&count| count > 0).unwrap_or(u64::MAX);
        let range = first..first.saturating_add(count.min(MOST_PARTS));
        let (frame, named, total) = match handle {
            Handle::Scope(frame, kind) => {
                let all = match arguments.filter {
                    Some(VariablesArgumentsFilter::Indexed) => Vec::new(),
                    _ => launched.in_scope(&frame, kind),
                };
                let total = all.len() as u64;
                let these = all.into_iter().skip(first as usize);
                (frame, these.take((range.end - range.start) as usize).collect::<Vec<_>>(), total)
            }
            Handle::Place { frame, place, expression } => {
                let read = |lane: &mut dyn LaneState| {
                    (place.children(range.clone(), lane), place.child_count(lane).unwrap_or(0))
                };
                let (parts, total) = launched.console.debugger.with_lane(&frame, read);
                let wanted = |name: &str| match arguments.filter {
                    Some(VariablesArgumentsFilter::Indexed) => name.starts_with('['),
                    Some(VariablesArgumentsFilter::Named) => !name.starts_with('['),
                    None => true,
                };
                let named = parts.into_iter().filter(|(name, _)| wanted(name)).map(|(name, place)| {
                    let expression = expression.as_ref().map(|whole| match name.as_str() {
                        "*" => format!("*{whole}"),
                        index if index.starts_with('[') => format!("{whole}{index}"),
                        member => format!("{whole}.{member}"),
                    });
                    Named { name, place, expression, is_declared: true }
                });
                (frame, named.collect(), total)
            }
        };
        // A client that does not ask page by page learns that there are more.
        let left = first.saturating_add(count).min(total).saturating_sub(range.end);
        let is_cut = left > 0 && !named.is_empty();
        let mut variables: Vec<_> = named.into_iter().map(|named| launched.shown(&frame, named)).collect();
        if is_cut {
            variables.push(ShownVariable {
                name: "...".into(),
                value: format!("{left} more are not listed: print one by its index, `[{}]`", range.end),
                ..ShownVariable::default()
            });
        }
        body(VariablesResponse { variables })
    }

    pub(super) fn evaluate(&mut self, request: &Request) -> Answer {
        let arguments: EvaluateArguments = request.arguments()?;
        let launched = self.stopped()?;
        let frame = launched.frame(arguments.frame_id)?;
        let expression = arguments.expression.trim();
        if let Some(EvaluateArgumentsContext::Clipboard) = arguments.context {
            return launched.copied(&frame, expression);
        }
        // What has a place can be opened; all else is a value only.
        let Ok(place) = launched.console.debugger.place(&frame, expression) else {
            let value = launched.console.debugger.evaluate(&frame, expression)?;
            return body(EvaluateResponse {
                result: value.content.to_string().trim().to_owned(),
                type_field: Some(value.ty),
                ..EvaluateResponse::default()
            });
        };
        let expression = Some(expression.to_owned());
        let named = Named { name: String::new(), place, expression, is_declared: true };
        let shown = launched.shown(&frame, named);
        body(EvaluateResponse {
            result: shown.value,
            type_field: shown.type_field,
            variables_reference: shown.variables_reference,
            named_variables: shown.named_variables,
            indexed_variables: shown.indexed_variables,
            memory_reference: shown.memory_reference,
            ..EvaluateResponse::default()
        })
    }

    pub(super) fn set_variable(&mut self, request: &Request) -> Answer {
        let arguments: SetVariableArguments = request.arguments()?;
        let launched = self.stopped()?;
        let handle = launched.stopped.handle(arguments.variables_reference)?.clone();
        let (frame, target) = match handle {
            Handle::Scope(frame, kind) => {
                let all = launched.in_scope(&frame, kind);
                let found = all.into_iter().find(|named| named.name == arguments.name);
                (frame, found.and_then(|named| named.expression))
            }
            Handle::Place { frame, expression, .. } => {
                let member = &arguments.name;
                let part = expression.map(|whole| match member.starts_with('[') {
                    true => format!("{whole}{member}"),
                    false => format!("{whole}.{member}"),
                });
                (frame, part)
            }
        };
        let Some(target) = target else {
            return Err(Refusal::new(format!("`{}` cannot be set", arguments.name)));
        };
        let shown = launched.set(&frame, &target, &arguments.value)?;
        self.tell_of_edit();
        body(SetVariableResponse {
            value: shown.value,
            type_field: shown.type_field,
            variables_reference: Some(shown.variables_reference),
            ..SetVariableResponse::default()
        })
    }

    pub(super) fn set_expression(&mut self, request: &Request) -> Answer {
        let arguments: SetExpressionArguments = request.arguments()?;
        let launched = self.stopped()?;
        let frame = launched.frame(arguments.frame_id)?;
        let shown = launched.set(&frame, arguments.expression.trim(), &arguments.value)?;
        self.tell_of_edit();
        body(SetExpressionResponse {
            value: shown.value,
            type_field: shown.type_field,
            variables_reference: Some(shown.variables_reference),
            ..SetExpressionResponse::default()
        })
    }

    /// Other values may have changed with one that was set.
    pub(super) fn tell_of_edit(&mut self) {
        if self.client.takes_invalidated {
            self.outbox.event("invalidated", json!({ "areas": ["variables"] }));
        }
    }
}

impl Launched {
    /// A frame by its number, or the innermost one.
    pub(super) fn frame(&self, number: Option<i64>) -> Result<StackFrame, String> {
        match number {
            Some(number) => self.stopped.frame(number).cloned(),
            None => self.stopped.innermost().cloned(),
        }
    }

    /// The variables of a scope. Of several with one name, all but the first have their lines, too.
    fn in_scope(&mut self, frame: &StackFrame, kind: ScopeKind) -> Vec<Named> {
        let variables = match kind {
            ScopeKind::Locals => self.console.debugger.locals(frame),
            ScopeKind::Registers => self.console.debugger.temporaries(frame),
            _ => self.console.debugger.globals(frame),
        };
        let mut seen = HashSet::new();
        let wanted = variables.into_iter().filter(|variable| kind.kinds().contains(&variable.kind));
        let mut named = Vec::new();
        for variable in wanted {
            let is_first = seen.insert(variable.name.clone());
            let Variable { name, declared_line, is_declared, is_anonymous, place, .. } = variable;
            let expression = (is_first && !is_anonymous).then(|| name.clone());
            let name = match declared_line.filter(|_| !is_first) {
                Some(line) => format!("{name} (line {line})"),
                None => name,
            };
            named.push(Named { name, place, expression, is_declared });
        }
        named
    }

    /// A value as a client shows it.
    fn shown(&mut self, frame: &StackFrame, named: Named) -> ShownVariable {
        let Named { name, place, expression, is_declared } = named;
        let read = |lane: &mut dyn LaneState| {
            let lane: &dyn LaneState = lane;
            let parts = place.child_count(lane).unwrap_or(0);
            let is_indexed =
                parts > 0 && place.children(0..1, lane).iter().all(|(name, _)| name.starts_with('['));
            (place.value(lane), parts, is_indexed, place.memory_and_offset(lane))
        };
        let (value, parts, is_indexed, memory) = self.console.debugger.with_lane(frame, read);
        let value = match value {
            _ if !is_declared => "not declared yet".to_owned(),
            Ok(value) => value.content.to_string().trim().to_owned(),
            Err(why) => format!("<{why}>"),
        };
        let memory_reference = memory.map(|(buffer, offset)| self.stopped.memory_reference(&buffer, offset));
        let type_field = Some(place.type_name());
        let has_parts = parts > 0 && is_declared;
        let count = Some(parts as i64).filter(|_| has_parts);
        let handle = || Handle::Place { frame: frame.clone(), place, expression: expression.clone() };
        ShownVariable {
            name,
            value,
            type_field,
            variables_reference: if has_parts { self.stopped.add(handle()) } else { 0 },
            named_variables: count.filter(|_| !is_indexed),
            indexed_variables: count.filter(|_| is_indexed),
            evaluate_name: expression,
            memory_reference,
            ..ShownVariable::default()
        }
    }

    /// Sets what an expression stands for; returns it as it is then.
    fn set(&mut self, frame: &StackFrame, target: &str, value: &str) -> Result<ShownVariable, String> {
        let value = self.console.debugger.assign(frame, target, value)?;
        // The step that is next may no longer trap.
        (self.trap, self.exception) = (None, None);
        self.forget_output();
        let name = target.to_owned();
        // Several components of a vector are no place of their own.
        let Ok(place) = self.console.debugger.place(frame, target) else {
            let (value, type_field) = (value.content.to_string(), Some(value.ty));
            return Ok(ShownVariable { name, value, type_field, ..ShownVariable::default() });
        };
        let expression = Some(name.clone());
        Ok(self.shown(frame, Named { name, place, expression, is_declared: true }))
    }
}
