//! Parses expressions in the notation that GLSL, HLSL and Slang share: a recursive descent with the
//! precedences of C.

use crate::debugger::expression::error::ExpressionError;
use crate::debugger::expression::lexer::{Token, TokenKind, tokens};
use crate::debugger::expression::numbers::{CalculatedValue, NumberShape, ScalarType};
use crate::debugger::expression::syntax::{BinaryOperator, Node, NodeKind, UnaryOperator};
use crate::debugger::expression::type_names::numeric_type;

/// The longest text that is parsed, and the most brackets and operators within each other.
const MAX_LENGTH: usize = 4096;
const MAX_DEPTH: u32 = 64;
/// The most nodes of an expression, as chains of operators are trees as deep as they are long.
const MAX_NODES: usize = 1024;

/// Parses a whole text.
pub(super) fn parse(text: &str) -> Result<Node, ExpressionError> {
    if text.len() > MAX_LENGTH {
        let message = format!("the expression has more than {MAX_LENGTH} bytes");
        return Err(ExpressionError::new(MAX_LENGTH, message));
    }
    let tokens = tokens(text)?;
    if tokens.len() > MAX_NODES {
        let message = format!("the expression has more than {MAX_NODES} parts");
        return Err(ExpressionError::new(tokens[MAX_NODES].column, message));
    }
    let mut parser = Parser { tokens, at: 0, depth: 0 };
    let node = parser.expression()?;
    match parser.kind() {
        TokenKind::End => Ok(node),
        other => Err(parser.error(format!("expected an operator or the end, found {}", other.describe()))),
    }
}

struct Parser {
    tokens: Vec<Token>,
    at: usize,
    depth: u32,
}

type Parsed = Result<Node, ExpressionError>;

impl Parser {
    fn kind(&self) -> &TokenKind {
        &self.tokens[self.at].kind
    }

    fn column(&self) -> usize {
        self.tokens[self.at].column
    }

    fn advance(&mut self) {
        self.at = (self.at + 1).min(self.tokens.len() - 1);
    }

    fn error(&self, message: impl Into<String>) -> ExpressionError {
        ExpressionError::new(self.column(), message)
    }

    /// Takes an operator or bracket, if it comes next.
    fn take(&mut self, mark: &str) -> bool {
        let found = matches!(self.kind(), TokenKind::Mark(next) if *next == mark);
        if found {
            self.advance();
        }
        found
    }

    fn expect(&mut self, mark: &str) -> Result<(), ExpressionError> {
        match self.take(mark) {
            true => Ok(()),
            false => Err(self.error(format!("expected `{mark}`, found {}", self.kind().describe()))),
        }
    }

    /// Parses what is nested, up to a depth.
    fn nested(&mut self, parse: impl FnOnce(&mut Self) -> Parsed) -> Parsed {
        if self.depth == MAX_DEPTH {
            return Err(self.error(format!("more than {MAX_DEPTH} levels of brackets and operators")));
        }
        self.depth += 1;
        let parsed = parse(self);
        self.depth -= 1;
        parsed
    }

    fn expression(&mut self) -> Parsed {
        self.nested(|parser| {
            let condition = parser.binary(1)?;
            if !parser.take("?") {
                return Ok(condition);
            }
            let then = parser.expression()?;
            parser.expect(":")?;
            let other = parser.expression()?;
            let column = condition.column;
            Ok(Node { column, kind: NodeKind::Conditional(Box::new([condition, then, other])) })
        })
    }

    /// Parses operators that bind at least as tightly as `least`.
    fn binary(&mut self, least: u32) -> Parsed {
        let mut left = self.unary()?;
        loop {
            let TokenKind::Mark(mark) = self.kind() else { return Ok(left) };
            let found = BinaryOperator::ALL.iter().find(|(_, spelling, _)| spelling == mark);
            let Some(&(operator, _, binding)) = found.filter(|(.., binding)| *binding >= least) else {
                return Ok(left);
            };
            let column = self.column();
            self.advance();
            let right = self.nested(|parser| parser.binary(binding + 1))?;
            left = Node { column, kind: NodeKind::Binary(operator, Box::new([left, right])) };
        }
    }

    fn unary(&mut self) -> Parsed {
        let operator = match self.kind() {
            TokenKind::Mark("-") => UnaryOperator::Minus,
            TokenKind::Mark("+") => UnaryOperator::Plus,
            TokenKind::Mark("!") => UnaryOperator::Not,
            TokenKind::Mark("~") => UnaryOperator::Complement,
            TokenKind::Mark("*") => UnaryOperator::Dereference,
            _ => return self.postfix(),
        };
        let column = self.column();
        self.advance();
        let operand = self.nested(Self::unary)?;
        Ok(Node { column, kind: NodeKind::Unary(operator, Box::new(operand)) })
    }

    fn postfix(&mut self) -> Parsed {
        let mut node = self.primary()?;
        loop {
            let column = self.column();
            node = if self.take(".") || self.take("->") {
                let column = self.column();
                let name = self.name("the name of a member")?;
                if name == "length" && matches!(self.kind(), TokenKind::Mark("(")) {
                    self.advance();
                    self.expect(")")?;
                    Node { column, kind: NodeKind::Length(Box::new(node)) }
                } else {
                    Node { column, kind: NodeKind::Member(Box::new(node), name) }
                }
            } else if self.take("[") {
                let index = self.expression()?;
                self.expect("]")?;
                Node { column, kind: NodeKind::Index(Box::new([node, index])) }
            } else {
                return Ok(node);
            };
        }
    }

    fn name(&mut self, what: &str) -> Result<String, ExpressionError> {
        match self.kind().clone() {
            TokenKind::Name(name) => {
                self.advance();
                Ok(name)
            }
            other => Err(self.error(format!("expected {what}, found {}", other.describe()))),
        }
    }

    fn primary(&mut self) -> Parsed {
        let column = self.column();
        let kind = match self.kind().clone() {
            TokenKind::Number(number) => {
                self.advance();
                NodeKind::Number(number)
            }
            TokenKind::Name(name) => {
                self.advance();
                return self.named(column, name);
            }
            TokenKind::Mark("%") => {
                self.advance();
                let id = match self.kind() {
                    TokenKind::Number(number) => number.as_index(),
                    _ => None,
                };
                let id = id.and_then(|id| u32::try_from(id).ok());
                let id = id.ok_or_else(|| self.error("expected the number of an id"))?;
                self.advance();
                NodeKind::Id(id)
            }
            TokenKind::Mark("(") => {
                self.advance();
                let inner = self.expression()?;
                self.expect(")")?;
                return self.cast(column, inner);
            }
            other => {
                let message = format!("expected a value, found {}", other.describe());
                return Err(self.error(message));
            }
        };
        Ok(Node { column, kind })
    }

    /// Parses what follows a name: arguments, or more of a qualified name.
    fn named(&mut self, column: usize, mut name: String) -> Parsed {
        while self.take("::") {
            name = format!("{name}::{}", self.name("the rest of a name")?);
        }
        if !self.take("(") {
            let kind = match name.as_str() {
                "true" | "false" => {
                    NodeKind::Number(CalculatedValue::scalar(ScalarType::Bool, u64::from(name == "true")))
                }
                _ => NodeKind::Name(name),
            };
            return Ok(Node { column, kind });
        }
        let mut arguments = Vec::new();
        if !self.take(")") {
            loop {
                arguments.push(self.expression()?);
                if self.take(")") {
                    break;
                }
                if !self.take(",") {
                    let found = self.kind().describe();
                    return Err(self.error(format!("expected `,` or `)`, found {found}")));
                }
            }
        }
        Ok(Node { column, kind: NodeKind::Call(name, arguments) })
    }

    /// Parses the operand of a cast, `(float) x`, if the bracket holds the name of a type.
    fn cast(&mut self, column: usize, inner: Node) -> Parsed {
        let NodeKind::Name(name) = &inner.kind else { return Ok(inner) };
        let is_type = matches!(numeric_type(name), Some((_, NumberShape::Scalar | NumberShape::Vector(_))));
        let follows = match self.kind() {
            TokenKind::Name(_) | TokenKind::Number(_) => true,
            TokenKind::Mark(mark) => ["(", "-", "!", "~"].contains(mark),
            TokenKind::End => false,
        };
        if !is_type || !follows {
            return Ok(inner);
        }
        let name = name.clone();
        let operand = self.nested(Self::unary)?;
        Ok(Node { column, kind: NodeKind::Call(name, vec![operand]) })
    }
}
