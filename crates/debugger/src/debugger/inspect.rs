//! What a stopped invocation holds: the variables of a frame.

use anyhit_engine::module::ty::Type;
use anyhit_engine::module::{Id, Opcode};
use anyhit_engine::reflect::value::TypedValue;

use super::Debugger;
use super::expression::{self, Evaluated, EventNames};
use super::lane_state::LaneState;
use super::stack::StackFrame;
use super::stopped_lane::StoppedLane;
use super::variable_place::VariablePlace;
use super::variables::{Variable, global_variables, temporaries_in_frame, value_of_id, variables_in_frame};

impl Debugger {
    /// Calls a function with the lane of a frame's shader.
    pub fn with_lane<T>(&mut self, frame: &StackFrame, read: impl FnOnce(&mut dyn LaneState) -> T) -> T {
        let (debuggee, course) = (&mut *self.debuggee, &mut self.course);
        read(&mut StoppedLane::new(debuggee, course, frame))
    }

    /// How many shaders had begun before that of a frame.
    pub fn run_number(&self, frame: &StackFrame) -> Option<u64> {
        self.course.run(frame.number)
    }

    /// The local variables of a frame.
    pub fn locals(&mut self, frame: &StackFrame) -> Vec<Variable> {
        let program = self.sources.shader(frame.shader).program.clone();
        self.with_lane(frame, |lane| variables_in_frame(&program, &frame.source, lane))
    }

    /// The variables of the module of a frame's shader: payload, builtins, buffers and others.
    pub fn globals(&mut self, frame: &StackFrame) -> Vec<Variable> {
        let program = self.sources.shader(frame.shader).program.clone();
        self.with_lane(frame, |lane| global_variables(&program, lane))
    }

    /// The values of the compiler's own in the block that a frame is in.
    pub fn temporaries(&mut self, frame: &StackFrame) -> Vec<Variable> {
        let program = self.sources.shader(frame.shader).program.clone();
        self.with_lane(frame, |lane| temporaries_in_frame(&program, &frame.source, lane))
    }

    /// The names that an expression can use in a frame: its variables, those of its shader, and
    /// members of blocks without a name.
    pub fn visible_names(&mut self, frame: &StackFrame) -> Vec<String> {
        let program = self.sources.shader(frame.shader).program.clone();
        self.with_lane(frame, |lane| expression::visible_names(&program, &frame.source, lane))
    }

    /// The names of the members or components of an expression's value; empty where it has none.
    pub fn member_names(&mut self, frame: &StackFrame, text: &str) -> Vec<String> {
        self.with_value(frame, text, |value, lane| Ok(value.member_names(lane))).unwrap_or_default()
    }

    /// Calls a function with what an expression comes to in a frame, and its lane.
    fn with_value<T>(
        &mut self,
        frame: &StackFrame,
        text: &str,
        read: impl FnOnce(Evaluated, &dyn LaneState) -> Result<T, String>,
    ) -> Result<T, String> {
        self.with_value_at(frame, None, text, read)
    }

    /// As [`Debugger::with_value`]; with the number of an event of traversal, names are what that
    /// tells.
    fn with_value_at<T>(
        &mut self,
        frame: &StackFrame,
        event: Option<usize>,
        text: &str,
        read: impl FnOnce(Evaluated, &dyn LaneState) -> Result<T, String>,
    ) -> Result<T, String> {
        let program = self.sources.shader(frame.shader).program.clone();
        let event = event.and_then(|event| self.course.events.get(event)).map(EventNames::of);
        self.with_lane(frame, |lane| {
            let evaluated = expression::evaluate_at(&program, &frame.source, lane, event.as_ref(), text);
            read(evaluated.map_err(|error| error.to_string())?, lane)
        })
    }

    /// The place that an expression names in a frame: `payload.colour`, `positions[1]`.
    ///
    /// # Errors
    /// Why it names none, in words.
    pub fn place(&mut self, frame: &StackFrame, text: &str) -> Result<VariablePlace, String> {
        self.with_value(frame, text, |value, _| match value {
            Evaluated::Place(place) => Ok(place),
            Evaluated::CalculatedValue(_) => Err(format!("`{text}` is calculated and has no location")),
        })
    }

    /// The value of an expression in a frame.
    ///
    /// # Errors
    /// Why it has none, in words, with the column.
    pub fn evaluate(&mut self, frame: &StackFrame, text: &str) -> Result<TypedValue, String> {
        self.with_value(frame, text, |value, lane| value.value(lane))
    }

    /// The value of an expression in a frame, or of what an event of traversal tells.
    pub(super) fn evaluate_at(
        &mut self,
        frame: &StackFrame,
        event: Option<usize>,
        text: &str,
    ) -> Result<TypedValue, String> {
        self.with_value_at(frame, event, text, |value, lane| value.value(lane))
    }

    /// Checks that a text is an expression.
    ///
    /// # Errors
    /// What is wrong with it, in words, with the column.
    pub fn check_expression(text: &str) -> Result<(), String> {
        expression::Expression::parse(text).map(drop).map_err(|error| error.to_string())
    }

    /// Whether a condition holds in a frame, or at an event of traversal.
    ///
    /// # Errors
    /// Why it cannot be told, in words.
    pub(super) fn holds(
        &mut self,
        frame: &StackFrame,
        event: Option<usize>,
        text: &str,
    ) -> Result<bool, String> {
        self.with_value_at(frame, event, text, |value, lane| value.is_true(lane))
    }

    /// What the function has returned that was innermost when the stack was this, where its caller
    /// is stopped behind the call.
    pub fn returned(&mut self, left: &[StackFrame]) -> Option<TypedValue> {
        let [callee, caller, ..] = left else { return None };
        let now = self.stack().into_iter().next()?;
        let is_back = now.number == caller.number && now.source.origin.scope == caller.source.origin.scope;
        let program = self.sources.shader(caller.shader).program.clone();
        let module = &program.module;
        // A call that the compiler has inlined is no instruction.
        let call = caller.source.origin.offset as usize;
        let &[word, _, result] = module.words.get(call..call + 3)? else { return None };
        if !is_back || callee.number != caller.number || Opcode::of_word(word) != Opcode::FunctionCall {
            return None;
        }
        let is_void = module.type_of(Id(result)).is_none_or(|ty| matches!(module.ty(ty), Type::Void));
        if is_void {
            return None;
        }
        self.with_lane(&now, |lane| value_of_id(&program, &now.source, lane, Id(result)).value(lane).ok())
    }
}

/// Checks that a frame is of the followed lane.
///
/// # Errors
/// That it is not, in words.
pub(super) fn check_followed(frame: &StackFrame) -> Result<(), String> {
    match frame.lane {
        None => Ok(()),
        Some(lane) => Err(format!("lane {lane} is not the followed lane: it can only be inspected")),
    }
}
