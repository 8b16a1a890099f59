//! Expressions: the text of a law, compiled to operations on a stack. Operator precedence is that of mathematics and
//! Python: `-q^2` is `-(q^2)`, `2^3^2` is `2^(3^2)`, and `**` is `^`.

mod op;
mod parse;
#[cfg(test)]
mod tests;

use super::error::FormulaError;
use op::{Op, function, number};
use parse::{parsed, syntax, too_deep};

/// Maximum stack depth, so that evaluation needs no allocation.
const MAX_DEPTH: usize = 32;

/// Whether a name is a built-in function or number.
pub(super) fn is_known(name: &str) -> bool {
    function(name).is_some() || number(name).is_some()
}

/// A compiled expression.
pub(super) struct Expression {
    ops: Vec<Op>,
}

impl Expression {
    /// Compiles an expression in these names.
    pub(super) fn new(text: &str, names: &[&str]) -> Result<Self, FormulaError> {
        Expression::checked(parsed(text, names)?)
    }

    fn checked(ops: Vec<Op>) -> Result<Self, FormulaError> {
        let mut depth = 0usize;
        for op in &ops {
            if matches!(op, Op::Number(x) if !x.is_finite()) {
                return syntax("a constant part of it is not a finite number");
            }
            depth = match op {
                Op::Number(_) | Op::Name(_) => depth + 1,
                Op::One(_) => depth,
                Op::Two(_) => depth - 1,
            };
            if depth > MAX_DEPTH {
                return too_deep();
            }
        }
        Ok(Expression { ops })
    }

    /// Whether a name occurs, by its index.
    pub(super) fn has(&self, name: usize) -> bool {
        self.ops.iter().any(|op| matches!(op, Op::Name(index) if *index == name))
    }

    /// Evaluates the expression with these values of the names.
    pub(super) fn at(&self, value: impl Fn(usize) -> f64) -> f64 {
        let (mut stack, mut top) = ([0.0; MAX_DEPTH], 0);
        for op in &self.ops {
            match *op {
                Op::Number(x) => (stack[top], top) = (x, top + 1),
                Op::Name(index) => (stack[top], top) = (value(index), top + 1),
                Op::One(of) => stack[top - 1] = of(stack[top - 1]),
                Op::Two(of) => (stack[top - 2], top) = (of(stack[top - 2], stack[top - 1]), top - 1),
            }
        }
        stack[0]
    }
}
