//! A law by its text: an expression, which is compiled, or a function of the program that built the model.

use super::error::FormulaError;
use super::expression;
use super::expression::Expression;
use crate::actuation::NeighbourQuantity;
use crate::effects::effect::Param;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// Variables of every law, in the order of [`LawInputs`].
pub(super) const VARIABLES: [&str; 6] = ["q", "dq", "ddq", "cmd", "tau", "t"];

/// Inputs of an expression: the joint's own, and those of its neighbours in the order of [`NeighbourQuantity::ALL`],
/// which are empty in a run without them.
#[derive(Clone, Copy)]
pub(super) struct ExpressionInputs<'a> {
    pub(super) own: LawInputs,
    pub(super) neighbours: &'a [f64],
}

impl ExpressionInputs<'_> {
    /// Value of a neighbour's quantity.
    pub(super) fn neighbour(&self, quantity: NeighbourQuantity) -> f64 {
        self.neighbours.get(quantity as usize).copied().unwrap_or(f64::NAN)
    }
}

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
    /// A law with parameters of these names; `reading` if it is on a reading, which has no neighbours.
    pub(super) fn new(text: &str, params: &[&str], laws: &Laws, reading: bool) -> Result<Self, FormulaError> {
        let is_function = laws.0.contains_key(text);
        let is_name = |name: &str| expression::is_known(name) || neighbour(name).is_some();
        let is_taken = |name: &&&str| VARIABLES.contains(*name) || !is_function && is_name(name);
        if let Some(&taken) = params.iter().find(is_taken) {
            return Err(FormulaError::Taken(taken.to_owned()));
        }
        match laws.0.get(text) {
            Some(function) => Ok(Law::Function(function.clone())),
            None if text.contains(OF_A_FUNCTION) => Err(FormulaError::Absent(text.to_owned())),
            None => expression(text, params, reading).map(Law::Expression),
        }
    }

    /// The neighbours' quantities that occur in it, where it has this number of parameters.
    pub(super) fn neighbours(&self, params: usize) -> Vec<NeighbourQuantity> {
        let first = VARIABLES.len() + params;
        match self {
            Law::Expression(expression) => {
                NeighbourQuantity::ALL.into_iter().filter(|&of| expression.has(first + of as usize)).collect()
            }
            Law::Function(_) => Vec::new(),
        }
    }

    /// Whether it depends on motion and time alone; of a function, this is not known.
    pub(super) fn is_of_motion(&self) -> bool {
        let torque = VARIABLES.iter().position(|name| *name == "tau");
        match self {
            Law::Expression(expression) => torque.is_none_or(|torque| !expression.has(torque)),
            Law::Function(_) => false,
        }
    }

    /// Value of the law; NaN where it has none.
    pub(super) fn at(&self, params: &[Param], p: &[f64], inputs: &ExpressionInputs) -> f64 {
        let ExpressionInputs { own, neighbours } = inputs;
        match self {
            Law::Expression(expression) => {
                let after = |name: usize| p.get(name).or_else(|| neighbours.get(name - p.len()));
                let value = |name: usize| own.get(name).or_else(|| after(name - own.len()));
                expression.at(|name| value(name).copied().unwrap_or(f64::NAN))
            }
            // A simulation that diverges is not the function's fault.
            Law::Function(_) if own.iter().any(|x| !x.is_finite()) => f64::NAN,
            Law::Function(function) => function(own, params, p),
        }
    }
}

/// The neighbours' quantity of that name.
fn neighbour(name: &str) -> Option<NeighbourQuantity> {
    NeighbourQuantity::ALL.into_iter().find(|quantity| quantity.name() == name)
}

/// Compiles an expression in the variables, these parameters, each of which must occur, and the neighbours' quantities.
fn expression(text: &str, params: &[&str], reading: bool) -> Result<Expression, FormulaError> {
    let neighbours = NeighbourQuantity::ALL.map(NeighbourQuantity::name);
    let names = [&VARIABLES[..], params, if reading { &[] } else { &neighbours }].concat();
    let expression = Expression::new(text, &names).map_err(|error| match error {
        FormulaError::Unknown { name, .. } if neighbour(&name).is_some() => FormulaError::NotInReading(name),
        error => error,
    })?;
    match params.iter().zip(VARIABLES.len()..).find(|(_, index)| !expression.has(*index)) {
        Some((&unused, _)) => Err(FormulaError::Unused(unused.to_owned())),
        None => Ok(expression),
    }
}
