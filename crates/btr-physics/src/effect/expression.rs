//! Expressions: the text of a law as steps on a stack of values. They bind as in mathematics and in Python: `-q^2` is
//! `-(q^2)`, `2^3^2` is `2^(3^2)`, and `**` is `^`.

mod parse;
#[cfg(test)]
mod tests;

use super::law::FormulaError;
use parse::{parsed, syntax, too_deep};
use std::f64::consts::PI;

/// The most values that wait for others at a time, so that a step needs no memory of its own.
const MOST_VALUES: usize = 32;

type One = fn(f64) -> f64;
type Two = fn(f64, f64) -> f64;

/// Functions of one value, ...
const ONES: [(&str, One); 20] = [
    ("abs", f64::abs),
    ("sign", sign),
    ("sqrt", f64::sqrt),
    ("exp", f64::exp),
    ("ln", f64::ln),
    ("log", f64::ln),
    ("log10", f64::log10),
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("asin", f64::asin),
    ("acos", f64::acos),
    ("atan", f64::atan),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
    ("floor", f64::floor),
    ("ceil", f64::ceil),
    ("round", f64::round),
    ("trunc", f64::trunc),
];
/// ... of two, ...
const TWOS: [(&str, Two); 3] = [("min", f64::min), ("max", f64::max), ("atan2", f64::atan2)];
/// ... and numbers with a name.
const NUMBERS: [(&str, f64); 2] = [("pi", PI), ("PI", PI)];

/// A sign that is 0 at 0.
fn sign(x: f64) -> f64 {
    if x > 0.0 { 1.0 } else { -f64::from(x < 0.0) }
}

/// Squares are exact to the last bit on every machine.
fn power(x: f64, y: f64) -> f64 {
    if y.to_bits() == 2.0f64.to_bits() { x * x } else { x.powf(y) }
}

/// Whether a name means something in every expression.
pub(super) fn is_known(name: &str) -> bool {
    function(name).is_some() || number(name).is_some()
}

/// A compiled expression.
pub(super) struct Expression {
    ops: Vec<Op>,
}

#[derive(Clone, Copy)]
enum Op {
    Number(f64),
    /// The value of a name, by its place.
    Name(usize),
    One(One),
    Two(Two),
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

/// A function that takes so many values.
#[derive(Clone, Copy)]
enum Function {
    One(One),
    Two(Two),
}

fn function(name: &str) -> Option<Function> {
    let one = ONES.iter().find(|(known, _)| *known == name).map(|(_, one)| Function::One(*one));
    one.or_else(|| TWOS.iter().find(|(known, _)| *known == name).map(|(_, two)| Function::Two(*two)))
}

fn number(name: &str) -> Option<f64> {
    NUMBERS.iter().find(|(known, _)| *known == name).map(|(_, number)| *number)
}
