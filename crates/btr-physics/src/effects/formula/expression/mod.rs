//! Expressions: the text of a law as steps on a stack of values. They bind as in mathematics and in Python: `-q^2` is
//! `-(q^2)`, `2^3^2` is `2^(3^2)`, and `**` is `^`.

mod op;
mod parse;
#[cfg(test)]
mod tests;

use super::error::FormulaError;
use op::{Op, function, number};
use parse::{parsed, syntax, too_deep};

/// The most values that wait for others at a time, so that a step needs no memory of its own.
const MOST_VALUES: usize = 32;

/// Whether a name means something in every expression.
pub(super) fn is_known(name: &str) -> bool {
    function(name).is_some() || number(name).is_some()
}

/// A compiled expression.
pub(super) struct Expression {
    ops: Vec<Op>,
}

impl Expression {
    /// An expression in these names.
    pub(super) fn new(text: &str, names: &[&str]) -> Result<Self, FormulaError> {
        Expression::checked(parsed(text, names)?)
    }

    fn checked(ops: Vec<Op>) -> Result<Self, FormulaError> {
        let mut waiting = 0usize;
        for op in &ops {
            if matches!(op, Op::Number(x) if !x.is_finite()) {
                return syntax("a part of it is no number, whatever the joint does");
            }
            waiting = match op {
                Op::Number(_) | Op::Name(_) => waiting + 1,
                Op::One(_) => waiting,
                Op::Two(_) => waiting - 1,
            };
            if waiting > MOST_VALUES {
                return too_deep();
            }
        }
        Ok(Expression { ops })
    }

    /// Whether a name occurs, by its place.
    pub(super) fn has(&self, name: usize) -> bool {
        self.ops.iter().any(|op| matches!(op, Op::Name(place) if *place == name))
    }

    /// The value where the names have these.
    pub(super) fn at(&self, value: impl Fn(usize) -> f64) -> f64 {
        let (mut stack, mut top) = ([0.0; MOST_VALUES], 0);
        for op in &self.ops {
            match *op {
                Op::Number(x) => (stack[top], top) = (x, top + 1),
                Op::Name(place) => (stack[top], top) = (value(place), top + 1),
                Op::One(of) => stack[top - 1] = of(stack[top - 1]),
                Op::Two(of) => (stack[top - 2], top) = (of(stack[top - 2], stack[top - 1]), top - 1),
            }
        }
        stack[0]
    }
}
