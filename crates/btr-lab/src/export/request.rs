//! What is exported, and what comes of it.

use btr_physics::model::{Model, Outline};

/// What is exported.
pub(super) struct Request<'a> {
    /// The model's file, as a name in comments.
    pub(super) name: String,
    pub(super) model: &'a Model,
    pub(super) outline: &'a Outline,
    /// The links whose inertia the model's file states.
    pub(super) stated_links: &'a [String],
    /// The same as the outline at draws of the free parameters, where what is uncertain is to be said; otherwise empty.
    pub(super) drawn: &'a [Outline],
    /// The file to change; empty where there is none.
    pub(super) text: &'a str,
    /// The physics step of the other simulator, in s.
    pub(super) step_s: f64,
}

/// An exported model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Exported {
    /// The file.
    pub text: String,
    /// What it says that the model says, a line each.
    pub carried: Vec<String>,
    /// What of the model it does not say, a line each.
    pub left: Vec<String>,
    /// What the user may want to see to in the file, a line each.
    pub advice: Vec<String>,
    /// The effects that the file does not say, as JSON; `None` where it says all.
    pub effects: Option<String>,
}

/// What is smaller is rounding.
const ROUNDING: f64 = 1e-15;

/// A number with ten digits, more than any log tells.
pub(super) fn number(x: f64) -> String {
    let rounded = format!("{x:.9e}").parse().unwrap_or(x);
    // Sums of numbers that cancel each other may leave their rounding, or -0.
    format!("{}", if f64::abs(rounded) < ROUNDING { 0.0 } else { rounded })
}

/// Numbers, separated by spaces.
pub(super) fn numbers<const N: usize>(numbers: [f64; N]) -> String {
    numbers.map(number).join(" ")
}
