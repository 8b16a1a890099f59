//! Operations of a compiled expression, and the built-in functions and numbers.

use std::f64::consts::PI;

pub(super) type One = fn(f64) -> f64;
pub(super) type Two = fn(f64, f64) -> f64;

/// Functions of one value.
pub(super) const ONES: [(&str, One); 20] = [
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
/// Functions of two values.
pub(super) const TWOS: [(&str, Two); 3] = [("min", f64::min), ("max", f64::max), ("atan2", f64::atan2)];
/// Named numbers.
pub(super) const NUMBERS: [(&str, f64); 2] = [("pi", PI), ("PI", PI)];

/// Sign of a number; 0 at 0.
pub(super) fn sign(x: f64) -> f64 {
    if x > 0.0 { 1.0 } else { -f64::from(x < 0.0) }
}

/// Power. Squares are computed as a product, so that they are bit-identical on every machine.
pub(super) fn power(x: f64, y: f64) -> f64 {
    if y.to_bits() == 2.0f64.to_bits() { x * x } else { x.powf(y) }
}

#[derive(Clone, Copy)]
pub(super) enum Op {
    Number(f64),
    /// Value of a name, by its index.
    Name(usize),
    One(One),
    Two(Two),
}

/// Built-in function, by its number of arguments.
#[derive(Clone, Copy)]
pub(super) enum BuiltinFunction {
    One(One),
    Two(Two),
}

pub(super) fn function(name: &str) -> Option<BuiltinFunction> {
    let one = ONES.iter().find(|(known, _)| *known == name).map(|(_, one)| BuiltinFunction::One(*one));
    one.or_else(|| TWOS.iter().find(|(known, _)| *known == name).map(|(_, two)| BuiltinFunction::Two(*two)))
}

pub(super) fn number(name: &str) -> Option<f64> {
    NUMBERS.iter().find(|(known, _)| *known == name).map(|(_, number)| *number)
}
