//! A user's own law as text: on a joint's torque, its command or its reading.
//!
//! A torque that jumps, as with `sign(dq)`, makes a light joint tremble by what the jump does in a step: for dry
//! friction there are effects that hold at rest.
//!
//! A law is made once. Effects live as long as the program, and so do laws: one for each distinct text (and function)
//! that a process meets, less than a kB for an expression.

pub(super) mod error;
mod expression;
pub(super) mod law;

use super::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::actuation::JointInput;
use crate::engine::{Affine, Dof};
use btr_core::log::Log;
use btr_core::world::WorldError;
use error::FormulaError;
use law::{Law, LawInputs, Laws, VARIABLES};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// What `btr effects` says about formulas; each one has a card of its own with its law and its parameters.
pub static FORMULA: EffectSpec = EffectSpec {
    name: "formula",
    law: "law = \"an expression\" on = \"torque\", \"command\" or \"reading\"; its own parameters by name: a = 0.1",
    site: SiteKind::Joint,
    cite: "the model file",
    symptom: "as its law says, beside the motor's torque, or in place of a command or a reading (cmd + ..., q + ...); it knows q, \
           dq, ddq (of the last step), cmd, tau (of the motor, last step), t, its parameters, numbers (0.1, 1e-3, pi), + - * / ^ (or **) \
           ( ), abs sign min max sqrt exp ln (or log) log10 sin cos tan asin acos atan atan2 sinh cosh tanh floor ceil round trunc",
    params: &[],
    starts: &[],
    similar: &[],
    nested: &[],
};

/// What a law gives.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum FormulaTarget {
    /// A torque that is added to the motor's, in N·m (N).
    Torque,
    /// The command that reaches the servo, in place of the one that was sent: `cmd + ...`.
    Command,
    /// The position that the servo and the log read, in place of the joint's: `q + ...`; the velocity stays the
    /// joint's.
    Reading,
}

/// A law as an effect.
struct Formula {
    spec: &'static EffectSpec,
    on: FormulaTarget,
    law: Law,
}

/// What tells laws apart: what they are on, text, names of parameters and, for functions, which one.
type Key = (FormulaTarget, String, Vec<String>, Option<usize>);

/// All laws so far.
static COMPILED: Mutex<BTreeMap<Key, &'static Formula>> = Mutex::new(BTreeMap::new());

/// The effect of an expression with parameters of these names.
///
/// # Errors
/// See [`formula_or_function`].
pub fn formula(on: FormulaTarget, law: &str, params: &[&str]) -> Result<&'static dyn Effect, FormulaError> {
    formula_or_function(on, law, params, &Laws::default())
}

/// The effect of a law with parameters of these names; `laws` are the functions that the text may name.
///
/// # Errors
/// An expression that cannot be read, unknown names, parameters that it does not have; a function that is not there.
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
    let law = Law::new(text, params, laws)?;
    let own = |name: &&str| Param::own(leaked(name), "SI", (f64::NEG_INFINITY, f64::INFINITY), 0.0);
    let params: Vec<Param> = params.iter().map(own).collect();
    let spec = Box::leak(Box::new(EffectSpec { law: leaked(text), params: Vec::leak(params), ..FORMULA }));
    let formula: &'static Formula = Box::leak(Box::new(Formula { spec, on, law }));
    compiled.insert(key, formula);
    Ok(formula)
}

fn leaked(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

/// What a law remembers: whether the run has begun, the velocity of the last step, how far the reading is from the
/// joint, and the first thing that it gave that is no finite number: whether there is one, which, and of what scene.
const STARTED: usize = 0;
const BEFORE: usize = 1;
const AHEAD: usize = 2;
const FAILED: usize = 3;
const GIVEN: usize = 4;
const OF: usize = 5;
const MEMORY: usize = OF + VARIABLES.len();

impl Formula {
    fn at(&self, p: &[f64], scene: &LawInputs) -> f64 {
        self.law.at(self.spec.params, p, scene)
    }

    /// The law's value; what is no finite number is remembered.
    fn told(&self, p: &[f64], memory: &mut [f64], scene: &LawInputs) -> f64 {
        let value = self.at(p, scene);
        if !value.is_finite() {
            remember(memory, value, scene);
        }
        value
    }
}

/// A simulation that blows up by itself is no law's mistake.
#[cold]
fn remember(memory: &mut [f64], value: f64, scene: &LawInputs) {
    if memory.len() == MEMORY && memory[FAILED] == 0.0 && scene.iter().all(|x| x.is_finite()) {
        memory[FAILED] = 1.0;
        memory[GIVEN] = value;
        memory[OF..].copy_from_slice(scene);
    }
}

/// What the law sees of a joint. A motor that is switched off is told to stay where it is.
fn scene(memory: &mut [f64], state: &JointInput) -> LawInputs {
    let command = if state.command.is_nan() { state.q } else { state.command };
    let mut ddq = 0.0;
    if let Ok([started, before]) = memory.get_disjoint_mut([STARTED, BEFORE]) {
        if *started > 0.0 {
            ddq = (state.dq - *before) / state.dt_s;
        }
        (*started, *before) = (1.0, state.dq);
    }
    [state.q, state.dq, ddq, command, state.torque, state.time_s]
}

impl Effect for Formula {
    fn spec(&self) -> &'static EffectSpec {
        self.spec
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        MEMORY
    }

    /// What the law says of the step's beginning, and its slope over the velocity as damping in the step: friction that
    /// grows with the speed then cannot make it unstable.
    fn torque(&self, p: &[f64], memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        if self.on != FormulaTarget::Torque {
            return;
        }
        let here = scene(memory, state);
        let dq = state.dq;
        let at = |dq: f64| {
            let mut scene = here;
            scene[1] = dq;
            self.at(p, &scene)
        };
        let nearby = 1e-4 * (1.0 + dq.abs());
        let damping = ((at(dq - nearby) - at(dq + nearby)) / (2.0 * nearby)).max(0.0);
        let constant = at(dq) + damping * dq;
        if !constant.is_finite() {
            let at_fault = [dq, dq - nearby, dq + nearby].into_iter().find(|&dq| !at(dq).is_finite());
            let dq = at_fault.unwrap_or(dq);
            let mut scene = here;
            scene[1] = dq;
            remember(memory, at(dq), &scene);
        }
        dof.torque.add(&Affine { constant, stiffness: 0.0, damping });
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> f64 {
        if self.on != FormulaTarget::Command || state.command.is_nan() {
            return state.command;
        }
        let scene = scene(memory, state);
        self.told(p, memory, &scene)
    }

    fn encoder(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> (f64, f64) {
        if self.on != FormulaTarget::Reading {
            return (state.q, state.dq);
        }
        let scene = scene(memory, state);
        let reading = self.told(p, memory, &scene);
        if let Some(ahead) = memory.get_mut(AHEAD) {
            *ahead = reading - state.q;
        }
        (reading, state.dq)
    }

    /// Within a step the reading moves as the joint does.
    fn transmit(&self, _p: &[f64], memory: &mut [f64], motor: Affine, _dof: &mut Dof, _state: &JointInput) -> Affine {
        match (self.on, memory.get(AHEAD)) {
            (FormulaTarget::Reading, Some(ahead)) => {
                Affine { constant: motor.constant - motor.stiffness * ahead, ..motor }
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
        let of = VARIABLES.into_iter().zip(&memory[OF..]).map(|(name, value)| format!("{name}={value}"));
        let with = self.spec.params.iter().zip(p).map(|(param, value)| format!("{}={value}", param.name));
        let (of, with) = (of.collect::<Vec<_>>().join(", "), with.collect::<Vec<_>>().join(", "));
        let with = if with.is_empty() { with } else { format!(" with {with}") };
        let (law, value) = (self.spec.law, memory[GIVEN]);
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
                midway: false,
                inertia: 0.0,
                torque,
                load: 0.0,
                command,
            };
            *reading = self.at(p, &scene(&mut memory, &state));
        }
    }
}
