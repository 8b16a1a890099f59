//! User-defined law as text: on a joint's torque, its command or its reading.
//!
//! A discontinuous torque, as with `sign(dq)`, makes a light joint chatter by the effect of the jump in a step. For dry
//! friction there are effects that hold at rest.
//!
//! A law is compiled once. Effects live as long as the program, and so do laws: one for each distinct text (and
//! function) in a process, less than 1 kB for an expression.

pub(super) mod error;
mod expression;
pub(super) mod law;

use super::effect::{Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::actuation::{JointInput, NeighbourQuantity};
use crate::engine::{Affine, Dof};
use btr_core::log::Log;
use btr_core::world::WorldError;
use error::FormulaError;
use law::{ExpressionInputs, Law, Laws, VARIABLES};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Description of formulas in `btr effects`; each formula has its own specification with its law and parameters.
pub static FORMULA: EffectSpec = EffectSpec {
    name: "formula",
    law: "law = \"an expression\" on = \"torque\", \"command\" or \"reading\"; its own parameters by name: a = 0.1",
    site: SiteKind::Joint,
    cite: "the model file",
    symptom: "as its law says, beside the motor's torque, or in place of a command or a reading (cmd + ..., q + \
              ...); it knows q, dq, ddq (of the last step), cmd, tau (of the motor, last step), t; on a torque or a \
              command also q_parent, dq_parent, tau_parent (of the nearest movable joint towards the base) and \
              q_child, dq_child, tau_child (of the first one further out); its parameters, numbers (0.1, 1e-3, pi), \
              + - * / ^ (or **) ( ), abs sign min max sqrt exp ln (or log) log10 sin cos tan \
              asin acos atan atan2 sinh cosh tanh floor ceil round trunc",
    params: &[],
    starts: &[],
    similar: &[],
    nested: &[],
};

/// The quantity that a law computes.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum FormulaTarget {
    /// A torque that is added to the motor's, in N·m (N).
    Torque,
    /// The command that reaches the servo, replacing the one that was sent: `cmd + ...`.
    Command,
    /// The position that the servo and the log read, replacing the joint's: `q + ...`; the velocity stays the joint's.
    Reading,
}

/// A law as an effect.
struct Formula {
    spec: &'static EffectSpec,
    on: FormulaTarget,
    law: Law,
    /// The neighbours' quantities that occur in the law.
    neighbours: Vec<NeighbourQuantity>,
}

/// Identity of a law: its target, its text, the names of its parameters and, for functions, which one.
type Key = (FormulaTarget, String, Vec<String>, Option<usize>);

/// All laws compiled so far.
static COMPILED: Mutex<BTreeMap<Key, &'static Formula>> = Mutex::new(BTreeMap::new());

/// Effect of an expression with parameters of these names.
///
/// # Errors
/// See [`formula_or_function`].
pub fn formula(on: FormulaTarget, law: &str, params: &[&str]) -> Result<&'static dyn Effect, FormulaError> {
    formula_or_function(on, law, params, &Laws::default())
}

/// Effect of a law with parameters of these names; `laws` are the functions that the text may name.
///
/// # Errors
/// An expression with a syntax error, unknown names, parameters that do not occur, a function that is missing.
pub fn formula_or_function(
    on: FormulaTarget,
    text: &str,
    params: &[&str],
    laws: &Laws,
) -> Result<&'static dyn Effect, FormulaError> {
    let names = params.iter().map(|&name| name.to_owned()).collect();
    let key = (on, text.to_owned(), names, laws.identity(text));
    let mut compiled = COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(&known) = compiled.get(&key) {
        return Ok(known);
    }
    let law = Law::new(text, params, laws, on == FormulaTarget::Reading)?;
    let neighbours = law.neighbours(params.len());
    let param = |name: &&str| Param::replacement(leaked(name), "SI", (f64::NEG_INFINITY, f64::INFINITY), 0.0);
    let params: Vec<Param> = params.iter().map(param).collect();
    let spec = Box::leak(Box::new(EffectSpec { law: leaked(text), params: Vec::leak(params), ..FORMULA }));
    let formula: &'static Formula = Box::leak(Box::new(Formula { spec, on, law, neighbours }));
    compiled.insert(key, formula);
    Ok(formula)
}

fn leaked(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

/// Layout of a law's memory: whether the run has begun, the velocity of the last step, the difference between reading
/// and joint, and the first value that was not finite: whether there is one, the value, and the inputs it came from,
/// those of the neighbours that occur in the law last.
const STARTED: usize = 0;
const LAST_DQ: usize = 1;
const OFFSET: usize = 2;
const FAILED: usize = 3;
const FAILED_VALUE: usize = 4;
const FAILED_INPUTS: usize = 5;
const MEMORY: usize = FAILED_INPUTS + VARIABLES.len();

impl Formula {
    fn at(&self, p: &[f64], inputs: &ExpressionInputs) -> f64 {
        self.law.at(self.spec.params, p, inputs)
    }

    /// Value of the law; a value that is not finite is recorded.
    fn evaluate(&self, p: &[f64], memory: &mut [f64], inputs: &ExpressionInputs) -> f64 {
        let value = self.at(p, inputs);
        if !value.is_finite() {
            self.record_failure(memory, value, inputs);
        }
        value
    }

    /// Records the first failure of the law. A simulation that diverges by itself is not the law's fault.
    #[cold]
    fn record_failure(&self, memory: &mut [f64], value: f64, inputs: &ExpressionInputs) {
        let neighbours = self.neighbours.iter().map(|&quantity| inputs.neighbour(quantity));
        let mut seen = inputs.own.iter().copied().chain(neighbours);
        let fits = memory.len() == MEMORY + self.neighbours.len();
        if fits && memory[FAILED] == 0.0 && seen.clone().all(f64::is_finite) {
            memory[FAILED] = 1.0;
            memory[FAILED_VALUE] = value;
            memory[FAILED_INPUTS..].fill_with(|| seen.next().unwrap_or(f64::NAN));
        }
    }
}

/// Inputs of the law at a joint. The command of a motor that is switched off is the joint's position.
fn law_inputs<'a>(memory: &mut [f64], state: &JointInput<'a>) -> ExpressionInputs<'a> {
    let command = if state.command.is_nan() { state.q } else { state.command };
    let mut ddq = 0.0;
    if let Ok([started, last_dq]) = memory.get_disjoint_mut([STARTED, LAST_DQ]) {
        if *started > 0.0 {
            ddq = (state.dq - *last_dq) / state.dt_s;
        }
        (*started, *last_dq) = (1.0, state.dq);
    }
    let own = [state.q, state.dq, ddq, command, state.torque, state.time_s];
    ExpressionInputs { own, neighbours: state.neighbours.map_or(&[], |inputs| &inputs[..]) }
}

impl Effect for Formula {
    fn spec(&self) -> &'static EffectSpec {
        self.spec
    }

    fn torque_law(&self) -> TorqueLaw {
        let of_motion = self.law.is_of_motion() && self.neighbours.iter().all(|quantity| !quantity.is_torque());
        if self.on == FormulaTarget::Torque && of_motion { TorqueLaw::OfMotion } else { TorqueLaw::Other }
    }

    fn neighbours(&self) -> &[NeighbourQuantity] {
        &self.neighbours
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        MEMORY + self.neighbours.len()
    }

    /// Torque at the start of the step, with its slope over the velocity as damping in the step, so that friction that
    /// grows with the speed cannot make the step unstable.
    fn torque(&self, p: &[f64], memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        if self.on != FormulaTarget::Torque {
            return;
        }
        let inputs = law_inputs(memory, state);
        let dq = state.dq;
        let at = |dq: f64| {
            let mut varied = inputs;
            varied.own[1] = dq;
            self.at(p, &varied)
        };
        let nearby = 1e-4 * (1.0 + dq.abs());
        let damping = ((at(dq - nearby) - at(dq + nearby)) / (2.0 * nearby)).max(0.0);
        let constant = at(dq) + damping * dq;
        if !constant.is_finite() {
            let at_fault = [dq, dq - nearby, dq + nearby].into_iter().find(|&dq| !at(dq).is_finite());
            let dq = at_fault.unwrap_or(dq);
            let mut varied = inputs;
            varied.own[1] = dq;
            self.record_failure(memory, at(dq), &varied);
        }
        dof.torque.add(&Affine { constant, stiffness: 0.0, damping });
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> f64 {
        if self.on != FormulaTarget::Command || state.command.is_nan() {
            return state.command;
        }
        let inputs = law_inputs(memory, state);
        self.evaluate(p, memory, &inputs)
    }

    fn encoder(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> (f64, f64) {
        if self.on != FormulaTarget::Reading {
            return (state.q, state.dq);
        }
        let inputs = law_inputs(memory, state);
        let reading = self.evaluate(p, memory, &inputs);
        if let Some(offset) = memory.get_mut(OFFSET) {
            *offset = reading - state.q;
        }
        (reading, state.dq)
    }

    /// Within a step the reading moves with the joint.
    fn transmit(&self, _p: &[f64], memory: &mut [f64], motor: Affine, _dof: &mut Dof, _state: &JointInput) -> Affine {
        match (self.on, memory.get(OFFSET)) {
            (FormulaTarget::Reading, Some(offset)) => {
                Affine { constant: motor.constant - motor.stiffness * offset, ..motor }
            }
            _ => motor,
        }
    }

    fn trouble(&self, p: &[f64], memory: &[f64], joint: &str) -> Option<WorldError> {
        if memory.get(FAILED).is_none_or(|failed| *failed == 0.0) {
            return None;
        }
        let on = match self.on {
            FormulaTarget::Torque => "torque",
            FormulaTarget::Command => "command",
            FormulaTarget::Reading => "reading",
        };
        let names = VARIABLES.into_iter().chain(self.neighbours.iter().map(|quantity| quantity.name()));
        let of = names.zip(&memory[FAILED_INPUTS..]).map(|(name, value)| format!("{name}={value}"));
        let with = self.spec.params.iter().zip(p).map(|(param, value)| format!("{}={value}", param.name));
        let (of, with) = (of.collect::<Vec<_>>().join(", "), with.collect::<Vec<_>>().join(", "));
        let with = if with.is_empty() { with } else { format!(" with {with}") };
        let (law, value) = (self.spec.law, memory[FAILED_VALUE]);
        Some(WorldError::Law { what: format!("the law `{law}` on the {on} of `{joint}` gave {value} at {of}{with}") })
    }

    fn sense(&self, p: &[f64], joint: &str, log: &mut Log) {
        if self.on != FormulaTarget::Reading {
            return;
        }
        let clock = log.clock_s().to_vec();
        let [q, dq, cmd, tau] = ["q", "dq", "cmd", "tau"].map(|kind| {
            log.values(&format!("{kind}_{joint}")).map_or_else(|_| vec![0.0; clock.len()], <[f64]>::to_vec)
        });
        let mut memory = [0.0; MEMORY];
        let Some(readings) = log.values_mut(&format!("q_{joint}")) else { return };
        for (i, reading) in readings.iter_mut().enumerate() {
            let dt_s = if i > 0 { clock[i] - clock[i - 1] } else { 1.0 };
            let (time_s, command, torque) = (clock[i], cmd[i], tau[i]);
            let state = JointInput {
                time_s,
                dt_s,
                q: q[i],
                dq: dq[i],
                acceleration: 0.0,
                midpoint: false,
                inertia: 0.0,
                torque,
                load: 0.0,
                command,
                mean_s: 0.0,
                neighbours: None,
            };
            *reading = self.at(p, &law_inputs(&mut memory, &state));
        }
    }
}
