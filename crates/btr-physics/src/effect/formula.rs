//! A user's own law as text: on a joint's torque, its command or its reading.
//!
//! A torque that jumps, as with `sign(dq)`, makes a light joint tremble by what the jump does in a step: for dry friction
//! there are effects that hold at rest.
//!
//! A law is made once. Effects live as long as the program, and so do laws: one for each distinct text (and function) that a
//! process meets, less than a kB for an expression.

use super::law::{FormulaError, Law, Laws, Scene};
use super::{Card, Effect, Param, SiteKind};
use crate::engine::{Affine, Dof};
use crate::motor::JointState;
use btr_core::log::Log;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// What `btr effects` says about formulas; each one has a card of its own with its law and its parameters.
pub static FORMULA: Card = Card {
    name: "formula",
    law: "law = \"an expression\" on = \"torque\", \"command\" or \"reading\"; its own parameters by name: a = 0.1",
    site: SiteKind::Joint,
    cite: "the model file",
    tell: "as its law says; it knows q, dq, ddq (of the last step), cmd, tau (of the motor, last step), t, its parameters, \
           numbers (0.1, 1e-3, pi), + - * / ^ (or **) ( ), abs sign min max sqrt exp ln (or log) log10 sin cos tan \
           asin acos atan atan2 sinh cosh tanh floor ceil round trunc",
    params: &[],
    starts: &[],
    alike: &[],
    contains: &[],
};

/// What a law gives.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum On {
    /// A torque beside the motor's, in N·m (N).
    Torque,
    /// The command that reaches the servo.
    Command,
    /// The position that the servo and the log read; the velocity stays the joint's.
    Reading,
}

/// A law as an effect.
struct Formula {
    card: &'static Card,
    on: On,
    law: Law,
}

/// What tells laws apart: what they are on, text, names of parameters and, for functions, which one.
type Key = (On, String, Vec<String>, Option<usize>);

/// All laws so far.
static COMPILED: Mutex<BTreeMap<Key, &'static Formula>> = Mutex::new(BTreeMap::new());

/// The effect of an expression with parameters of these names.
///
/// # Errors
/// See [`formula_or_function`].
pub fn formula(on: On, law: &str, params: &[&str]) -> Result<&'static dyn Effect, FormulaError> {
    formula_or_function(on, law, params, &Laws::default())
}

/// The effect of a law with parameters of these names; `laws` are the functions that the text may name.
///
/// # Errors
/// An expression that cannot be read, unknown names, parameters that it does not have; a function that is not there.
pub fn formula_or_function(
    on: On,
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
    let card = Box::leak(Box::new(Card { law: leaked(text), params: Vec::leak(params), ..FORMULA }));
    let formula: &'static Formula = Box::leak(Box::new(Formula { card, on, law }));
    compiled.insert(key, formula);
    Ok(formula)
}

fn leaked(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

impl Formula {
    fn at(&self, p: &[f64], scene: &Scene) -> f64 {
        self.law.at(self.card.params, p, scene)
    }
}

/// What the law sees of a joint. A motor that is switched off is told to stay where it is.
fn scene(memory: &mut [f64], state: &JointState) -> Scene {
    let command = if state.command.is_nan() { state.q } else { state.command };
    let mut ddq = 0.0;
    if let [started, before, ..] = memory {
        if *started > 0.0 {
            ddq = (state.dq - *before) / state.dt_s;
        }
        (*started, *before) = (1.0, state.dq);
    }
    [state.q, state.dq, ddq, command, state.torque, state.time_s]
}

/// The memory says whether the run has begun, and holds the velocity of the last step and how far the reading is from the
/// joint.
impl Effect for Formula {
    fn card(&self) -> &'static Card {
        self.card
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        3
    }

    /// What the law says of the step's beginning, and its slope over the velocity as damping in the step: friction that
    /// grows with the speed then cannot make it unstable.
    fn torque(&self, p: &[f64], memory: &mut [f64], dof: &mut Dof, state: &JointState) {
        if self.on != On::Torque {
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
        dof.torque.add(&Affine { constant: at(dq) + damping * dq, stiffness: 0.0, damping });
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointState) -> f64 {
        if self.on != On::Command || state.command.is_nan() {
            return state.command;
        }
        self.at(p, &scene(memory, state))
    }

    fn encoder(&self, p: &[f64], memory: &mut [f64], state: &JointState) -> (f64, f64) {
        if self.on != On::Reading {
            return (state.q, state.dq);
        }
        let reading = self.at(p, &scene(memory, state));
        if let [.., ahead] = memory {
            *ahead = reading - state.q;
        }
        (reading, state.dq)
    }

    /// Within a step the reading moves as the joint does.
    fn transmit(&self, _p: &[f64], memory: &mut [f64], motor: Affine, _dof: &mut Dof, _state: &JointState) -> Affine {
        match (self.on, memory) {
            (On::Reading, [.., ahead]) => Affine { constant: motor.constant - motor.stiffness * *ahead, ..motor },
            _ => motor,
        }
    }

    fn sense(&self, p: &[f64], joint: &str, log: &mut Log) {
        if self.on != On::Reading {
            return;
        }
        let clock = log.clock_s().to_vec();
        let [q, dq, cmd, tau] = ["q", "dq", "cmd", "tau"].map(|kind| {
            log.values(&format!("{kind}_{joint}")).map_or_else(|_| vec![0.0; clock.len()], <[f64]>::to_vec)
        });
        let mut memory = [0.0; 3];
        let Some(readings) = log.values_mut(&format!("q_{joint}")) else { return };
        for (i, reading) in readings.iter_mut().enumerate() {
            let dt_s = if i > 0 { clock[i] - clock[i - 1] } else { 1.0 };
            let (time_s, command, torque) = (clock[i], cmd[i], tau[i]);
            let state = JointState {
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
