//! Expressions of a stopped invocation's variables, in the notation that GLSL, HLSL and Slang
//! share: names, members, indices, swizzles, pointers, operators, constructors and functions.
//!
//! Conversions are those of GLSL. A comparison with `==` is one bool, the other comparisons of
//! vectors are vectors of bools. Floats are calculated with in their own width; functions and
//! products of matrices are instructions that the interpreter runs.

mod arithmetic;
mod builtin_names;
mod error;
mod evaluate;
mod event_names;
mod functions;
mod lexer;
mod numbers;
mod parser;
mod shader_code;
mod syntax;
mod type_names;

pub use error::ExpressionError;
pub use evaluate::Evaluated;
pub use event_names::EventNames;
pub use numbers::{CalculatedValue, NumberShape, ScalarType};

use crate::debugger::lane_state::LaneState;
use crate::debugger::source_frames::SourceFrame;
use crate::debugger::variable_place::VariablePlace;
use anyhit_engine::program::Program;
use builtin_names::builtin_of_name;
use evaluate::Evaluator;
use syntax::{Node, NodeKind};

/// An expression that was parsed, to be evaluated as often as needed.
#[derive(Clone, Debug)]
pub struct Expression {
    root: Node,
}

impl Expression {
    /// Parses an expression.
    ///
    /// # Errors
    /// What is wrong with the text, and where.
    pub fn parse(text: &str) -> Result<Self, ExpressionError> {
        Ok(Self { root: parser::parse(text)? })
    }

    /// Its value in a frame of a stopped invocation.
    ///
    /// # Errors
    /// Which part of it has no value, and why.
    pub fn evaluate(
        &self,
        program: &Program,
        frame: &SourceFrame,
        state: &dyn LaneState,
    ) -> Result<Evaluated, ExpressionError> {
        Evaluator::new(program, frame, state).evaluate(&self.root)
    }
}

/// Evaluates a text in a frame of a stopped invocation.
///
/// # Errors
/// As [`Expression::parse`] and [`Expression::evaluate`].
pub fn evaluate(
    program: &Program,
    frame: &SourceFrame,
    state: &dyn LaneState,
    text: &str,
) -> Result<Evaluated, ExpressionError> {
    Expression::parse(text)?.evaluate(program, frame, state)
}

/// Evaluates a text whose names are what an event of traversal tells, where one is given, and else
/// those of a frame.
///
/// # Errors
/// As [`evaluate`].
pub(super) fn evaluate_at(
    program: &Program,
    frame: &SourceFrame,
    state: &dyn LaneState,
    event: Option<&EventNames>,
    text: &str,
) -> Result<Evaluated, ExpressionError> {
    let root = Expression::parse(text)?.root;
    match event {
        Some(event) => Evaluator::at_event(program, frame, state, event).evaluate(&root),
        None => Evaluator::new(program, frame, state).evaluate(&root),
    }
}

/// The names that an expression can use in a frame.
pub(super) fn visible_names(program: &Program, frame: &SourceFrame, state: &dyn LaneState) -> Vec<String> {
    Evaluator::new(program, frame, state).names().map(str::to_owned).collect()
}

/// Sets what an expression names, `payload.colour.xy`, to the value of another. Returns the places
/// that were set.
///
/// # Errors
/// As `evaluate`, and why a place cannot be set or takes no such value. Columns are those of the
/// text that is wrong.
pub fn assign(
    program: &Program,
    frame: &SourceFrame,
    state: &mut dyn LaneState,
    target: &str,
    value: &str,
) -> Result<Vec<VariablePlace>, ExpressionError> {
    let (target, value) = (parser::parse(target)?, parser::parse(value)?);
    let mut places = Vec::new();
    for (place, words) in assignments(program, frame, &*state, &target, &value)? {
        let set = place.set_words(state, &words);
        set.map_err(|message| ExpressionError::new(target.column, input_of(&target).unwrap_or(message)))?;
        places.push(place);
    }
    Ok(places)
}

/// The places that are set, each with its words.
fn assignments(
    program: &Program,
    frame: &SourceFrame,
    state: &dyn LaneState,
    target: &Node,
    value: &Node,
) -> Result<Vec<(VariablePlace, Vec<u32>)>, ExpressionError> {
    let evaluator = Evaluator::new(program, frame, state);
    if let Some(places) = evaluator.swizzled_places(target)? {
        let numbers = evaluator.numbers_for(value)?;
        let one = numbers.bits().len() == 1;
        if !one && numbers.bits().len() != places.len() {
            let message = format!("{} does not have {} components", numbers.type_name(), places.len());
            return Err(ExpressionError::new(value.column, message));
        }
        let words = places.into_iter().zip(0..).map(|(place, at)| {
            let part = if one { Some(numbers.clone()) } else { numbers.part(at) };
            let words = part.map_or_else(
                || Err("no such component".into()),
                |part| part.words_as(place.module(), place.ty()),
            );
            Ok((place, words.map_err(|message| ExpressionError::new(value.column, message))?))
        });
        return words.collect();
    }
    match evaluator.evaluate(target)? {
        Evaluated::Place(place) => {
            let words = evaluator.words_for(value, &place)?;
            Ok(vec![(place, words)])
        }
        Evaluated::CalculatedValue(_) => {
            let message = input_of(target);
            let message = message.unwrap_or_else(|| "only variables and their parts can be set".into());
            Err(ExpressionError::new(target.column, message))
        }
    }
}

/// Why a builtin, or a part of one, cannot be set.
fn input_of(target: &Node) -> Option<String> {
    match &target.kind {
        NodeKind::Name(name) => {
            let known = builtin_of_name(name)?.name;
            let glsl = known.strip_suffix("KHR").map(|bare| format!("gl_{bare}EXT"));
            let glsl = glsl.unwrap_or_else(|| format!("gl_{known}"));
            let alias = if glsl == *name { String::new() } else { format!(" {glsl},") };
            Some(format!("`{name}` is{alias} an input of the shader"))
        }
        NodeKind::Member(of, _) => input_of(of),
        NodeKind::Index(operands) => input_of(&operands[0]),
        _ => None,
    }
}
