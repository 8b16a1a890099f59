//! A law by its text: an expression, which is compiled, or a function of the program that built the model.

use super::error::FormulaError;
use super::expression;
use super::expression::Expression;
use crate::effects::effect::Param;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// Variables of every law, in the order of [`LawInputs`].
pub(super) const VARIABLES: [&str; 6] = ["q", "dq", "ddq", "cmd", "tau", "t"];

/// Values of `q`, `dq`, `ddq`, `cmd`, `tau` and `t`, in SI units.
pub type LawInputs = [f64; VARIABLES.len()];

/// A law as a function of the inputs, the parameters (in the order of their values) and the values. It may be called
/// from any thread, several times per step, and for velocities near the joint's own.
pub type LawFunction = dyn Fn(&LawInputs, &[Param], &[f64]) -> f64 + Send + Sync;

/// Character that occurs in the text of every function and in no expression.
const OF_A_FUNCTION: char = ':';

/// Functions that a model's laws may name, `python:slip` for instance.
#[derive(Clone, Default)]
pub struct Laws(BTreeMap<String, Arc<LawFunction>>);

impl Laws {
    /// Functions by the text that names them in a model file, which contains a colon.
    pub fn new(laws: impl IntoIterator<Item = (String, Arc<LawFunction>)>) -> Self {
        Laws(laws.into_iter().collect())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Distinguishes functions of the same name; `None` if there is no such function.
    pub(super) fn identity(&self, text: &str) -> Option<usize> {
        self.0.get(text).map(|function| Arc::as_ptr(function).cast::<()>() as usize)
    }
}

impl fmt::Debug for Laws {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.0.keys()).finish()
    }
}

/// A law that can be evaluated.
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

    /// Value of the law; NaN where it has none.
    pub(super) fn at(&self, params: &[Param], p: &[f64], inputs: &LawInputs) -> f64 {
        match self {
            Law::Expression(expression) => {
                expression.at(|name| inputs.get(name).copied().unwrap_or_else(|| p[name - inputs.len()]))
            }
            // A simulation that diverges is not the function's fault.
            Law::Function(_) if inputs.iter().any(|x| !x.is_finite()) => f64::NAN,
            Law::Function(function) => function(inputs, params, p),
        }
    }
}

/// Compiles an expression in the variables and these parameters, each of which must occur.
fn expression(text: &str, params: &[&str]) -> Result<Expression, FormulaError> {
    let names: Vec<&str> = VARIABLES.iter().chain(params).copied().collect();
    let expression = Expression::new(text, &names)?;
    match params.iter().zip(VARIABLES.len()..).find(|(_, index)| !expression.has(*index)) {
        Some((&unused, _)) => Err(FormulaError::Unused(unused.to_owned())),
        None => Ok(expression),
    }
}
