//! The lines of its source that a shader ran, and what it printed there.

use serde::Serialize;

use anyhit_engine::reflect::value::TypedValue;

/// A line that ran, once or several times.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExecutedLine {
    /// The file's name as the compiler wrote it.
    pub file: String,
    /// The line's number, from 1.
    pub line: u32,
    /// The line's text without its indent, where it is known.
    pub text: Option<String>,
    /// The function that it is in.
    pub function: String,
    /// How many times it ran.
    pub count: u64,
    /// The variables that it set.
    pub values: Vec<AssignedValue>,
}

/// A variable that a line set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AssignedValue {
    /// The variable's name in the source.
    pub name: String,
    /// How many times the line set it.
    pub count: u64,
    /// What it held after the first time.
    pub first: TypedValue,
    /// What it held after the last time.
    pub last: TypedValue,
}

/// A text that a shader printed (`NonSemantic.DebugPrintf`).
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PrintedText {
    /// The text.
    pub text: String,
    /// Which one it is of all that the invocation printed, from 0.
    pub number: usize,
    /// How many of the shader's `steps` were before it.
    pub steps_before: usize,
    /// The file of the line that printed it, where that was followed.
    pub file: Option<String>,
    /// The number of that line.
    pub line: Option<u32>,
}

impl ExecutedLine {
    /// Notes that the line set a variable.
    pub fn assign(&mut self, name: &str, value: TypedValue) {
        match self.values.iter_mut().find(|known| known.name == name) {
            Some(known) => {
                known.count += 1;
                known.last = value;
            }
            None => {
                let name = name.to_owned();
                self.values.push(AssignedValue { name, count: 1, first: value.clone(), last: value });
            }
        }
    }
}
