//! What a stopped invocation holds: the variables of a frame.

use crate::debug::values::TypedValue;

use super::Debugger;
use super::lane_state::LaneState;
use super::stack::StackFrame;
use super::stopped_lane::StoppedLane;
use super::variable_place::VariablePlace;
use super::variables::{Variable, global_variables, temporaries_in_frame, variables_in_frame};

impl Debugger {
    /// Calls a function with the lane of a frame's shader.
    pub fn with_lane<T>(&mut self, frame: &StackFrame, read: impl FnOnce(&mut dyn LaneState) -> T) -> T {
        read(&mut StoppedLane::new(&mut *self.debuggee, frame.number, frame.shader))
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

    /// The place that a name means in a frame, with members: `payload.colour`, `positions[1]`.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub fn place(&mut self, frame: &StackFrame, text: &str) -> Result<VariablePlace, String> {
        let mut parts = text.split(['.', '[']).map(|part| part.trim_end_matches(']').trim());
        let name = parts.next().unwrap_or_default();
        let variables = [self.locals(frame), self.globals(frame)].concat();
        let found = variables.iter().find(|variable| variable.name == name);
        let mut place = found.ok_or_else(|| format!("no variable `{name}` here"))?.place.clone();
        for part in parts {
            place = match part.parse() {
                Ok(index) => place.child(index)?,
                Err(_) => place.member(part).ok_or_else(|| format!("no member `{part}`"))?,
            };
        }
        Ok(place)
    }

    /// The value of an expression in a frame.
    ///
    /// # Errors
    /// Why it has none, in words, with the column.
    pub fn evaluate(&mut self, frame: &StackFrame, text: &str) -> Result<TypedValue, String> {
        let place = self.place(frame, text)?;
        self.with_lane(frame, |lane| place.value(lane))
    }

    /// After something was set by hand: what ran after this step before is forgotten, and the
    /// invocation goes on from here with what was set.
    pub fn keep_edit(&mut self) {
        let edited = self.checkpoint(true);
        self.history.go_another_way(edited);
        let now = self.course.time;
        self.output.retain(|(time, _)| *time <= now);
    }
}
