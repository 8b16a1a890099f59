//! What the text of a law stands for: an expression, which is compiled, or a function of the program that made the
//! model.

use super::error::FormulaError;
use super::expression;
use super::expression::Expression;
use crate::effects::effect::Param;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// What every law knows of its joint, in the order of [`LawInputs`].
pub(super) const VARIABLES: [&str; 6] = ["q", "dq", "ddq", "cmd", "tau", "t"];

/// Values of `q`, `dq`, `ddq`, `cmd`, `tau` and `t`, in SI units.
pub type LawInputs = [f64; VARIABLES.len()];

/// A law as a function of the scene and of its parameters, whose names come with it in the order of their values. It
/// may be called from any thread, more than once for a step, and for velocities near the joint's own.
pub type LawFunction = dyn Fn(&LawInputs, &[Param], &[f64]) -> f64 + Send + Sync;

/// Stands in the text of a law that is a function, and in no expression.
const OF_A_FUNCTION: char = ':';

/// The functions that a model's laws name: `python:slip` for instance.
#[derive(Clone, Default)]
pub struct Laws(BTreeMap<String, Arc<LawFunction>>);

impl Laws {
    /// Functions by the text that stands for them in a model file, which has a colon in it.
    pub fn new(laws: impl IntoIterator<Item = (String, Arc<LawFunction>)>) -> Self {
        Laws(laws.into_iter().collect())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Tells functions of the same name apart; `None` for what is none.
    pub(super) fn identity(&self, text: &str) -> Option<usize> {
        self.0.get(text).map(|function| Arc::as_ptr(function).cast::<()>() as usize)
    }
}

impl fmt::Debug for Laws {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.0.keys()).finish()
    }
}

/// What can be asked for a value.
pub(super) enum Law {
    Expression(Expression),
    Function(Arc<LawFunction>),
}

impl Law {
    pub(super) fn new(text: &str, params: &[&str], laws: &Laws) -> Result<Self, FormulaError> {
        let is_function = laws.0.contains_key(text);
        let is_taken = |name: &&&str| VARIABLES.contains(*name) || !is_function && expression::is_known(name);
        if let Some(&taken) = params.iter().find(is_taken) {
            return Err(FormulaError::Taken(taken.to_owned()));
        }
        match laws.0.get(text) {
            Some(function) => Ok(Law::Function(function.clone())),
            None if text.contains(OF_A_FUNCTION) => Err(FormulaError::Absent(text.to_owned())),
            None => expression(text, params).map(Law::Expression),
        }
    }

    /// The law's value; NaN where it has none.
    pub(super) fn at(&self, params: &[Param], p: &[f64], scene: &LawInputs) -> f64 {
        match self {
            Law::Expression(expression) => {
                expression.at(|name| scene.get(name).copied().unwrap_or_else(|| p[name - scene.len()]))
            }
            // A simulation that blows up is no function's mistake.
            Law::Function(_) if scene.iter().any(|x| !x.is_finite()) => f64::NAN,
            Law::Function(function) => function(scene, params, p),
        }
    }
}

/// An expression in what every law knows and these parameters, each of which it must have.
fn expression(text: &str, params: &[&str]) -> Result<Expression, FormulaError> {
    let names: Vec<&str> = VARIABLES.iter().chain(params).copied().collect();
    let expression = Expression::new(text, &names)?;
    match params.iter().zip(VARIABLES.len()..).find(|(_, place)| !expression.has(*place)) {
        Some((&unused, _)) => Err(FormulaError::Unused(unused.to_owned())),
        None => Ok(expression),
    }
}
