//! What is wrong with an expression, and where.

use std::fmt;

/// An expression that cannot be read or has no value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpressionError {
    /// The column in the text, from 1.
    pub column: usize,
    /// What is wrong.
    pub message: String,
}

impl ExpressionError {
    pub(super) fn new(column: usize, message: impl Into<String>) -> Self {
        Self { column, message: message.into() }
    }
}

impl fmt::Display for ExpressionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at character {} of the expression: {}", self.column, self.message)
    }
}

impl std::error::Error for ExpressionError {}
