//! What the text of a law stands for: an expression, which is compiled, or a function of the program that made the model.

use super::Param;
use exmex::{Express, FlatEx, FloatOpsFactory, MakeOperators, Operator};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// What every law knows of its joint, in the order of [`Scene`].
const VARIABLES: [&str; 6] = ["q", "dq", "ddq", "cmd", "tau", "t"];

/// Values of `q`, `dq`, `ddq`, `cmd`, `tau` and `t`, in SI units.
pub type Scene = [f64; VARIABLES.len()];

/// A law as a function of the scene and of its parameters, whose names come with it in the order of their values. It
/// may be called from any thread, more than once for a step, and for velocities near the joint's own.
pub type Function = dyn Fn(&Scene, &[Param], &[f64]) -> f64 + Send + Sync;

/// The most names in an expression, so that a step needs no memory of its own.
const MOST_NAMES: usize = 16;

/// Stands in the text of a law that is a function, and in no expression.
const OF_A_FUNCTION: char = ':';

/// What is wrong with a law.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FormulaError {
    /// It cannot be read.
    #[error("the law cannot be read: {0}")]
    Syntax(String),
    /// A name that is neither a variable nor a parameter.
    #[error("the law's `{name}` is not known; there are {}", known.join(", "))]
    Unknown {
        /// The name.
        name: String,
        /// Variables and parameters.
        known: Vec<String>,
    },
    /// A parameter that the law does not have.
    #[error("`{0}` does not occur in the law")]
    Unused(String),
    /// A parameter that cannot have this name.
    #[error("`{0}` means something else in every law")]
    Taken(String),
    /// More names than [`MOST_NAMES`].
    #[error("a law can have {MOST_NAMES} different names at most")]
    TooMany,
    /// A function that did not come with the model.
    #[error("the law `{0}` is a function, and there is none of that name here")]
    Absent(String),
}

/// The functions that a model's laws name: `python:slip` for instance.
#[derive(Clone, Default)]
pub struct Laws(BTreeMap<String, Arc<Function>>);

impl Laws {
    /// Functions by the text that stands for them in a model file, which has a colon in it.
    pub fn new(laws: impl IntoIterator<Item = (String, Arc<Function>)>) -> Self {
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

/// The functions inside expressions: those of floats, and a sign that is 0 at 0.
#[derive(Clone, Debug)]
struct Operators;

impl MakeOperators<f64> for Operators {
    fn make<'a>() -> Vec<Operator<'a, f64>> {
        let mut all = FloatOpsFactory::<f64>::make();
        all.push(Operator::make_unary("sign", |x: f64| if x > 0.0 { 1.0 } else { -f64::from(x < 0.0) }));
        all
    }
}

/// What can be asked for a value.
pub(super) enum Law {
    Expression(Box<Expression>),
    Function(Arc<Function>),
}

impl Law {
    pub(super) fn new(text: &str, params: &[&str], laws: &Laws) -> Result<Self, FormulaError> {
        if let Some(&taken) = params.iter().find(|name| VARIABLES.contains(name)) {
            return Err(FormulaError::Taken(taken.to_owned()));
        }
        match laws.0.get(text) {
            Some(function) => Ok(Law::Function(function.clone())),
            None if text.contains(OF_A_FUNCTION) => Err(FormulaError::Absent(text.to_owned())),
            None => Ok(Law::Expression(Box::new(Expression::new(text, params)?))),
        }
    }

    /// The law's value; NaN where it has none.
    pub(super) fn at(&self, params: &[Param], p: &[f64], scene: &Scene) -> f64 {
        match self {
            Law::Expression(expression) => expression.at(p, scene),
            // A simulation that blows up is no function's mistake.
            Law::Function(_) if scene.iter().any(|x| !x.is_finite()) => f64::NAN,
            Law::Function(function) => function(scene, params, p),
        }
    }
}

/// A compiled expression.
pub(super) struct Expression {
    law: FlatEx<f64, Operators>,
    /// For each name in the law, in its order: the place among variables and parameters.
    places: Vec<usize>,
}

impl Expression {
    fn new(text: &str, params: &[&str]) -> Result<Self, FormulaError> {
        let syntax = |e: exmex::ExError| FormulaError::Syntax(e.msg().to_owned());
        let law = FlatEx::<f64, Operators>::parse(text).map_err(syntax)?;
        let known: Vec<&str> = VARIABLES.iter().chain(params).copied().collect();
        let place = |name: &String| known.iter().position(|known| known == name).ok_or_else(|| name.clone());
        let places: Result<Vec<usize>, String> = law.var_names().iter().map(place).collect();
        let places = places.map_err(|name| {
            let known = known.iter().map(|&known| known.to_owned()).collect();
            FormulaError::Unknown { name, known }
        })?;
        if let Some(unused) = (VARIABLES.len()..known.len()).find(|place| !places.contains(place)) {
            return Err(FormulaError::Unused(known[unused].to_owned()));
        }
        if places.len() > MOST_NAMES {
            return Err(FormulaError::TooMany);
        }
        Ok(Expression { law, places })
    }

    fn at(&self, p: &[f64], scene: &Scene) -> f64 {
        let mut values = [0.0; MOST_NAMES];
        for (value, &place) in values.iter_mut().zip(&self.places) {
            *value = if place < scene.len() { scene[place] } else { p[place - scene.len()] };
        }
        self.law.eval(&values[..self.places.len()]).unwrap_or(f64::NAN)
    }
}
