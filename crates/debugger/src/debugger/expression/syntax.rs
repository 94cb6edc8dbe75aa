//! The tree of an expression.

use crate::debugger::expression::numbers::CalculatedValue;

/// A part of an expression, and the column that messages about it name.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) column: usize,
    pub(super) kind: NodeKind,
}

#[derive(Clone, Debug)]
pub(super) enum NodeKind {
    Name(String),
    /// A result id of the module: `%12`.
    Id(u32),
    Number(CalculatedValue),
    Unary(UnaryOperator, Box<Node>),
    Binary(BinaryOperator, Box<[Node; 2]>),
    /// `a ? b : c`
    Conditional(Box<[Node; 3]>),
    /// A member or a swizzle, of a value or of what a pointer points to.
    Member(Box<Node>, String),
    Index(Box<[Node; 2]>),
    /// A function or a constructor.
    Call(String, Vec<Node>),
    /// The number of elements: `a.length()`.
    Length(Box<Node>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum UnaryOperator {
    Minus,
    Plus,
    Not,
    Complement,
    /// What a pointer points to.
    Dereference,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BinaryOperator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Remainder,
    ShiftLeft,
    ShiftRight,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    NotEqual,
    BitAnd,
    BitOr,
    BitXor,
    And,
    Or,
}

impl BinaryOperator {
    /// The operators, each with how tightly it binds.
    pub(super) const ALL: [(Self, &'static str, u32); 18] = [
        (Self::Or, "||", 1),
        (Self::And, "&&", 2),
        (Self::BitOr, "|", 3),
        (Self::BitXor, "^", 4),
        (Self::BitAnd, "&", 5),
        (Self::Equal, "==", 6),
        (Self::NotEqual, "!=", 6),
        (Self::Less, "<", 7),
        (Self::LessEqual, "<=", 7),
        (Self::Greater, ">", 7),
        (Self::GreaterEqual, ">=", 7),
        (Self::ShiftLeft, "<<", 8),
        (Self::ShiftRight, ">>", 8),
        (Self::Add, "+", 9),
        (Self::Subtract, "-", 9),
        (Self::Multiply, "*", 10),
        (Self::Divide, "/", 10),
        (Self::Remainder, "%", 10),
    ];

    /// The operator as it is written.
    pub(super) fn spelling(self) -> &'static str {
        Self::ALL.iter().find(|(operator, ..)| *operator == self).map_or("", |(_, spelling, _)| spelling)
    }
}
