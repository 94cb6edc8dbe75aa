//! Evaluates the tree of an expression in a stopped invocation.

use crate::debugger::expression::arithmetic;
use crate::debugger::expression::builtin_names::{builtin_of_call, builtin_of_name, is_signed};
use crate::debugger::expression::error::ExpressionError;
use crate::debugger::expression::event_names::EventNames;
use crate::debugger::expression::functions;
use crate::debugger::expression::numbers::{CalculatedValue, ComponentBits, NumberShape, ScalarType};
use crate::debugger::expression::syntax::{BinaryOperator, Node, NodeKind, UnaryOperator};
use crate::debugger::lane_state::LaneState;
use crate::debugger::source_frames::SourceFrame;
use crate::debugger::variable_place::VariablePlace;
use crate::debugger::variables::{Variable, global_variables, value_of_id, variables_in_frame};
use anyhit_base::error::names::nearest;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{Id, Module};
use anyhit_engine::ops::builtin::{Builtin, stage_letter};
use anyhit_engine::program::Program;
use anyhit_engine::reflect::value::TypedValue;

/// What an expression comes to.
#[derive(Clone, Debug)]
pub enum Evaluated {
    /// A value of the shader, which may be set.
    Place(VariablePlace),
    /// A calculated value.
    CalculatedValue(CalculatedValue),
}

impl Evaluated {
    /// The value for a reader.
    ///
    /// # Errors
    /// The reason why it cannot be read.
    pub fn value(&self, state: &dyn LaneState) -> Result<TypedValue, String> {
        match self {
            Self::Place(place) => place.value(state),
            Self::CalculatedValue(numbers) => Ok(numbers.typed_value()),
        }
    }

    /// Whether a condition holds.
    ///
    /// # Errors
    /// The message where it is no scalar, or cannot be read.
    pub fn is_true(&self, state: &dyn LaneState) -> Result<bool, String> {
        let numbers = self.numbers(state)?;
        numbers
            .as_bool()
            .ok_or_else(|| format!("{} is not a condition: use `any` or `all`", numbers.type_name()))
    }

    /// The numbers that it is made of.
    fn numbers(&self, state: &dyn LaneState) -> Result<CalculatedValue, String> {
        match self {
            Self::CalculatedValue(numbers) => Ok(numbers.clone()),
            Self::Place(place) => {
                let numbers = CalculatedValue::of_place(place, state)?;
                numbers.ok_or_else(|| format!("{} is neither a number nor a vector", place.type_name()))
            }
        }
    }

    /// The names of the members of a struct, of what a pointer leads to, and of the components of a
    /// vector.
    pub fn member_names(&self, state: &dyn LaneState) -> Vec<String> {
        let pointee = match self {
            Self::Place(place) if place.is_pointer() => place.pointee(state).ok().map(Self::Place),
            _ => None,
        };
        let of = pointee.as_ref().unwrap_or(self);
        match (of, of.component_count()) {
            (_, Some(count)) => SETS[0].chars().take(count as usize).map(String::from).collect(),
            (Self::Place(place), None) => {
                member_names(place.module(), place.ty()).map(str::to_owned).collect()
            }
            (Self::CalculatedValue(_), None) => Vec::new(),
        }
    }

    /// The number of components of a vector.
    fn component_count(&self) -> Option<u32> {
        match self {
            Self::Place(place) => match *place.module().ty(place.ty()) {
                Type::Vector { count, .. } => Some(count),
                _ => None,
            },
            Self::CalculatedValue(numbers) => match numbers.shape() {
                NumberShape::Vector(count) => Some(count),
                _ => None,
            },
        }
    }

    fn type_name(&self) -> String {
        match self {
            Self::Place(place) => place.type_name(),
            Self::CalculatedValue(numbers) => numbers.type_name(),
        }
    }
}

type EvaluatedNode = Result<Evaluated, ExpressionError>;

/// What expressions are evaluated in: a frame of a stopped invocation.
pub(super) struct Evaluator<'a> {
    program: &'a Program,
    frame: &'a SourceFrame,
    state: &'a dyn LaneState,
    variables: Vec<Variable>,
    /// The event of traversal that names are about instead.
    event: Option<&'a EventNames>,
}

impl<'a> Evaluator<'a> {
    pub(super) fn new(program: &'a Program, frame: &'a SourceFrame, state: &'a dyn LaneState) -> Self {
        let mut variables = variables_in_frame(program, frame, state);
        variables.extend(global_variables(program, state));
        Self { program, frame, state, variables, event: None }
    }

    /// Evaluates what an event of traversal tells.
    pub(super) fn at_event(
        program: &'a Program,
        frame: &'a SourceFrame,
        state: &'a dyn LaneState,
        event: &'a EventNames,
    ) -> Self {
        Self { program, frame, state, variables: Vec::new(), event: Some(event) }
    }

    pub(super) fn evaluate(&self, node: &Node) -> EvaluatedNode {
        let error = |message: String| ExpressionError::new(node.column, message);
        match &node.kind {
            NodeKind::Number(numbers) => Ok(Evaluated::CalculatedValue(numbers.clone())),
            NodeKind::Name(name) => self.name(name).map_err(error),
            NodeKind::Id(id) => self.id(Id(*id)).map_err(error),
            NodeKind::Unary(UnaryOperator::Dereference, operand) => {
                let found = self.evaluate(operand)?;
                let Evaluated::Place(place) = &found else {
                    return Err(error(format!("{} is not a pointer", found.type_name())));
                };
                place.pointee(self.state).map(Evaluated::Place).map_err(error)
            }
            NodeKind::Unary(operator, operand) => {
                let operand = self.numbers(operand)?;
                arithmetic::unary(*operator, &operand).map(Evaluated::CalculatedValue).map_err(error)
            }
            NodeKind::Binary(operator, operands) => {
                let [left, right] = &**operands;
                let left = self.numbers(left)?;
                // The second operand of these counts only if the first does not decide.
                let decided = match operator {
                    BinaryOperator::And => left.as_bool() == Some(false),
                    BinaryOperator::Or => left.as_bool() == Some(true),
                    _ => false,
                };
                if decided {
                    return Ok(Evaluated::CalculatedValue(CalculatedValue::of_bool(
                        *operator == BinaryOperator::Or,
                    )));
                }
                let right = self.numbers(right)?;
                arithmetic::binary(*operator, &left, &right).map(Evaluated::CalculatedValue).map_err(error)
            }
            NodeKind::Conditional(parts) => {
                let [condition, then, other] = &**parts;
                let holds = self.evaluate(condition)?.is_true(self.state);
                let holds = holds.map_err(|message| ExpressionError::new(condition.column, message))?;
                self.evaluate(if holds { then } else { other })
            }
            NodeKind::Member(of, name) => self.member(&self.evaluate(of)?, name).map_err(error),
            NodeKind::Index(operands) => {
                let [of, index] = &**operands;
                let found = self.evaluate(of)?;
                let number = self.numbers(index)?;
                let index = number.as_index().ok_or_else(|| {
                    let message = format!("{} is not an index", number.typed_value());
                    ExpressionError::new(index.column, message)
                })?;
                self.element(&found, index).map_err(error)
            }
            NodeKind::Length(of) => {
                let count = match self.evaluate(of)? {
                    Evaluated::Place(place) => array_in(&place).child_count(self.state).map_err(error)?,
                    Evaluated::CalculatedValue(numbers) => {
                        numbers.shape().part().map_or(1, |(_, count)| count).into()
                    }
                };
                let ty = ScalarType::Int(32);
                Ok(Evaluated::CalculatedValue(CalculatedValue::scalar(ty, count & u64::from(u32::MAX))))
            }
            NodeKind::Call(name, arguments) => {
                if let ([], Some(builtin)) = (&arguments[..], builtin_of_call(name)) {
                    return match self.event {
                        Some(_) => self.name(builtin.name),
                        None => self.builtin(name, builtin),
                    }
                    .map_err(error);
                }
                let mut values = Vec::new();
                for argument in arguments {
                    values.push(self.numbers(argument)?);
                }
                match functions::call(name, &values) {
                    Some(result) => result.map(Evaluated::CalculatedValue).map_err(error),
                    None => Err(error(missing("function", name, "", functions::names()))),
                }
            }
        }
    }

    fn numbers(&self, node: &Node) -> Result<CalculatedValue, ExpressionError> {
        let found = self.evaluate(node)?;
        found.numbers(self.state).map_err(|message| ExpressionError::new(node.column, message))
    }

    fn name(&self, name: &str) -> Result<Evaluated, String> {
        if let Some(event) = self.event {
            return match event.value(builtin_of_name(name).map_or(name, |builtin| builtin.name)) {
                Some(value) => Ok(Evaluated::CalculatedValue(value)),
                None => Err(format!("the event has no `{name}`; it has {}", event.names())),
            };
        }
        let place = |place: VariablePlace| match place.why_unavailable() {
            Some(why) => Err(format!("`{name}` has no value: {why}")),
            None => Ok(Evaluated::Place(place)),
        };
        let known = || self.variables.iter().filter(|variable| variable.name == name);
        if let Some(variable) = known().find(|variable| variable.is_declared) {
            return place(variable.place.clone());
        }
        let mut anonymous = self.anonymous();
        if let Some(member) = anonymous.find_map(|variable| self.member_place(&variable.place, name)) {
            return place(member);
        }
        if let Some(constant) = self.constant(name) {
            return place(constant);
        }
        if let Some(later) = known().next() {
            let line = later.declared_line.map_or_else(String::new, |line| format!(" before line {line}"));
            return Err(format!("`{name}` is not declared{line}"));
        }
        match builtin_of_name(name) {
            Some(builtin) => self.builtin(name, builtin),
            None => Err(missing("variable", name, " here", self.names())),
        }
    }

    /// The names of all variables, and of what is named without them.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        let module = &self.program.module;
        let members = self.anonymous().flat_map(|variable| member_names(module, variable.place.ty()));
        let named = self.variables.iter().filter(|variable| !variable.is_anonymous);
        named.map(|variable| variable.name.as_str()).chain(members)
    }

    /// The variables whose members are named without them.
    fn anonymous(&self) -> impl Iterator<Item = &Variable> {
        self.variables.iter().filter(|variable| variable.is_anonymous || variable.name == "this")
    }

    /// The constant of a name: of those of the module, specialisation constants have names.
    fn constant(&self, name: &str) -> Option<VariablePlace> {
        let module = &self.program.module;
        let named = module.constants.iter().find(|constant| module.name(constant.id) == Some(name))?;
        Some(value_of_id(self.program, self.frame, self.state, named.id))
    }

    fn builtin(&self, name: &str, builtin: &'static Builtin) -> Result<Evaluated, String> {
        let stage = self.program.stage;
        let words = builtin.stages.contains(stage_letter(stage)).then(|| self.state.builtin(builtin));
        let words = words.flatten().ok_or_else(|| format!("a {} shader has no `{name}`", stage.name()))?;
        Ok(Evaluated::CalculatedValue(match words[..] {
            [word] if is_signed(name) => CalculatedValue::scalar(ScalarType::Int(32), word.into()),
            _ => CalculatedValue::of_builtin(builtin, &words),
        }))
    }

    fn id(&self, id: Id) -> Result<Evaluated, String> {
        let module = &self.program.module;
        if module.type_of(id).is_none() {
            return Err(format!("%{} is not a value", id.0));
        }
        let place = value_of_id(self.program, self.frame, self.state, id);
        match place.why_unavailable() {
            Some(why) => Err(format!("%{} has no value: {why}", id.0)),
            None => Ok(Evaluated::Place(place)),
        }
    }

    /// The member of a struct, or of what pointers lead to.
    fn member_place(&self, of: &VariablePlace, name: &str) -> Option<VariablePlace> {
        of.member(name).or_else(|| {
            let pointee = of.pointee(self.state).ok().filter(|pointee| !pointee.is_pointer())?;
            pointee.member(name)
        })
    }

    fn member(&self, of: &Evaluated, name: &str) -> Result<Evaluated, String> {
        if let Evaluated::Place(place) = of {
            if place.is_pointer() {
                let pointee = place.pointee(self.state)?;
                return self.member(&Evaluated::Place(pointee), name);
            }
            if let Some(member) = place.member(name) {
                return Ok(Evaluated::Place(member));
            }
            let module = place.module();
            if let Type::Struct { .. } = module.ty(place.ty()) {
                let what = format!("member of {}", place.type_name());
                return Err(missing(&what, name, "", member_names(module, place.ty())));
            }
        }
        let is_scalar =
            matches!(of, Evaluated::CalculatedValue(numbers) if numbers.shape() == NumberShape::Scalar);
        let count = of.component_count().or(is_scalar.then_some(1));
        let count = count.ok_or_else(|| format!("{} has no members", of.type_name()))?;
        let indices =
            swizzle(name, count).ok_or_else(|| format!("{} has no component `{name}`", of.type_name()))?;
        if let (Evaluated::Place(place), [only]) = (of, &indices[..]) {
            return place.child(*only).map(Evaluated::Place);
        }
        // Of a variable only the components that are named need have been written.
        let component = |at: u64| match of {
            Evaluated::Place(place) => Evaluated::Place(place.child(at)?).numbers(self.state),
            Evaluated::CalculatedValue(numbers) => Ok(match numbers.part(at) {
                Some(part) => part,
                None => numbers.clone(),
            }),
        };
        let parts: Result<Vec<CalculatedValue>, String> = indices.into_iter().map(component).collect();
        let parts = parts?;
        let ty = parts[0].ty();
        let bits: ComponentBits = parts.iter().map(|part| part.bits()[0]).collect();
        let shape = match bits.len() {
            1 => NumberShape::Scalar,
            count => NumberShape::Vector(count as u32),
        };
        Ok(Evaluated::CalculatedValue(CalculatedValue::new(ty, shape, bits)))
    }

    fn element(&self, of: &Evaluated, index: u64) -> Result<Evaluated, String> {
        match of {
            Evaluated::Place(place) if place.is_pointer() => {
                let pointee = place.pointee(self.state)?;
                self.element(&Evaluated::Place(pointee), index)
            }
            Evaluated::Place(place) => {
                let array = array_in(place);
                if let Ok(count) = array.child_count(self.state)
                    && index >= count
                {
                    return Err(format!("{index} is outside the {count} elements of {}", array.type_name()));
                }
                array.child(index).map(Evaluated::Place)
            }
            Evaluated::CalculatedValue(numbers) => {
                let part = numbers.part(index).map(Evaluated::CalculatedValue);
                part.ok_or_else(|| format!("{index} is outside {}", numbers.type_name()))
            }
        }
    }

    /// The places of several components of a vector that a swizzle names: `v.xz`.
    pub(super) fn swizzled_places(&self, node: &Node) -> Result<Option<Vec<VariablePlace>>, ExpressionError> {
        let NodeKind::Member(of, name) = &node.kind else { return Ok(None) };
        let Evaluated::Place(place) = self.evaluate(of)? else { return Ok(None) };
        let Type::Vector { count, .. } = *place.module().ty(place.ty()) else { return Ok(None) };
        let Some(indices) = swizzle(name, count).filter(|indices| indices.len() > 1) else { return Ok(None) };
        if (1..indices.len()).any(|at| indices[..at].contains(&indices[at])) {
            let message = format!("`{name}` names a component twice: it cannot be set");
            return Err(ExpressionError::new(node.column, message));
        }
        let places = indices.iter().map(|&at| place.child(at));
        let places: Result<Vec<_>, String> = places.collect();
        places.map(Some).map_err(|message| ExpressionError::new(node.column, message))
    }

    /// The words of a value for a place of a type.
    pub(super) fn words_for(&self, node: &Node, to: &VariablePlace) -> Result<Vec<u32>, ExpressionError> {
        let found = self.evaluate(node)?;
        let words = match &found {
            // Structs and arrays are copied as they are.
            Evaluated::Place(place) if place.ty() == to.ty() => place.words(self.state),
            _ => found.numbers(self.state).and_then(|numbers| numbers.words_as(to.module(), to.ty())),
        };
        words.map_err(|message| ExpressionError::new(node.column, message))
    }

    /// The numbers of a value, for the components of a swizzle.
    pub(super) fn numbers_for(&self, node: &Node) -> Result<CalculatedValue, ExpressionError> {
        self.numbers(node)
    }
}

/// The array that an index goes into: that of a struct that holds nothing else, as Slang wraps
/// structured buffers and arrays in memory.
fn array_in(place: &VariablePlace) -> VariablePlace {
    let module = place.module();
    let is_array = |ty| matches!(module.ty(ty), Type::Array { .. } | Type::RuntimeArray { .. });
    match module.ty(place.ty()) {
        Type::Struct { members, .. } if members.len() == 1 && is_array(members[0].ty) => {
            place.child(0).unwrap_or_else(|_| place.clone())
        }
        _ => place.clone(),
    }
}

fn member_names(module: &Module, ty: TypeId) -> impl Iterator<Item = &str> {
    let members = match module.ty(ty) {
        Type::Struct { members, .. } => &members[..],
        _ => &[],
    };
    members.iter().map(|member| member.name.as_str())
}

/// The names of the components of a vector.
const SETS: [&str; 3] = ["xyzw", "rgba", "stpq"];

/// The components that a swizzle names, of a vector of so many.
fn swizzle(name: &str, count: u32) -> Option<Vec<u64>> {
    let set = SETS.iter().find(|set| name.chars().all(|one| set.contains(one)))?;
    let indices: Option<Vec<u64>> = name.chars().map(|one| set.find(one).map(|at| at as u64)).collect();
    indices.filter(|all| (1..=4).contains(&all.len()) && all.iter().all(|&at| at < count.into()))
}

/// The message that nothing has a name, with one that is near.
fn missing<'n>(what: &str, name: &str, place: &str, names: impl Iterator<Item = &'n str>) -> String {
    match nearest(name, names.filter(|name| !name.is_empty())) {
        Some(near) => format!("no {what} `{name}`{place}; did you mean `{near}`?"),
        None => format!("no {what} `{name}`{place}"),
    }
}
