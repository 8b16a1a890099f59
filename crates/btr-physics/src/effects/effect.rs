//! What an effect is: its parameters, what it says about itself, the hooks by which it acts, and an effect at a site.

use crate::actuation::{JointInput, MotorTorque};
use crate::engine::{Affine, Dof};
use crate::robot::Robot;
use crate::robot::site::matches;
use crate::setup::{Setup, setup_error};
use btr_core::log::Log;
use btr_core::world::WorldError;
use std::fmt;

/// Where an effect can sit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SiteKind {
    /// On joints.
    Joint,
    /// On links; `base` means the root.
    Link,
    /// On the root's mounting or its sensors; its site is `base` (or `*`).
    Base,
    /// On the floor; its site is always `*`.
    Ground,
    /// On the robot as a whole, all joints at once; its site is always `*`.
    Robot,
}

impl SiteKind {
    /// Whether its effects act through the joints they sit on.
    pub(crate) fn is_on_joints(self) -> bool {
        matches!(self, SiteKind::Joint | SiteKind::Robot)
    }
}

/// A parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Param {
    /// Unique in its effect.
    pub name: &'static str,
    /// SI unit as text.
    pub unit: &'static str,
    /// Smallest and largest sensible value.
    pub bounds: (f64, f64),
    /// The value at which the effect is not there: infinite for limits, NaN where the model's own value stands. Shapes
    /// have their usual value here.
    pub off: f64,
    /// A typical value, to start a search from.
    pub hint: f64,
    /// Whether it only shapes the effect (the speed of a Stribeck curve, the order of cogging) and switches nothing on.
    pub shape: bool,
}

impl Param {
    /// A parameter that is off at zero.
    pub(crate) const fn new(name: &'static str, unit: &'static str, bounds: (f64, f64), hint: f64) -> Self {
        Param { name, unit, bounds, off: 0.0, hint, shape: false }
    }

    /// A limit: off where it is infinite.
    pub(crate) const fn limit(name: &'static str, unit: &'static str, bounds: (f64, f64), hint: f64) -> Self {
        Param { name, unit, bounds, off: f64::INFINITY, hint, shape: false }
    }

    /// One that takes the place of a value that the model has anyway.
    pub(crate) const fn own(name: &'static str, unit: &'static str, bounds: (f64, f64), hint: f64) -> Self {
        Param { name, unit, bounds, off: f64::NAN, hint, shape: false }
    }

    /// One that only shapes the effect.
    pub(crate) const fn shape(name: &'static str, unit: &'static str, bounds: (f64, f64), hint: f64) -> Self {
        Param { name, unit, bounds, off: hint, hint, shape: true }
    }
}

/// What an effect says about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectSpec {
    /// Its name everywhere.
    pub name: &'static str,
    /// The law in a line.
    pub law: &'static str,
    /// Where it sits.
    pub site: SiteKind,
    /// Where the law is from.
    pub cite: &'static str,
    /// How it shows in the error of a model that lacks it.
    pub symptom: &'static str,
    /// Its parameters, in the order of [`PlacedEffect::values`].
    pub params: &'static [Param],
    /// Values of its shapes (in their order among the parameters) from which a search for the effect should start.
    pub starts: &'static [&'static [f64]],
    /// Names of effects that most motions cannot tell from it.
    pub similar: &'static [&'static str],
    /// Those among them that it becomes for some values of its parameters, with the values at which it is the other at
    /// its hint.
    pub nested: &'static [(&'static str, &'static [f64])],
}

/// A physical effect. Every hook has a body that does nothing; an effect implements those that it needs. `p` are the
/// values of its parameters, `memory` is its own (one for each joint), zero at the start of a run. An effect that is
/// off is left out of a run altogether.
pub trait Effect: Sync {
    /// What it says about itself.
    fn spec(&self) -> &'static EffectSpec;
    /// Changes a link before the world is built.
    fn link(&self, _p: &[f64], _robot: &mut Robot, _link: usize) {}
    /// Changes gravity or the floor before the world is built.
    fn world(&self, _p: &[f64], _setup: &mut Setup) {}
    /// Adds to what always acts on a joint.
    fn joint(&self, _p: &[f64], _dof: &mut Dof) {}
    /// How many numbers it remembers for each joint, when the step is `dt_s` long.
    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        0
    }
    /// Position and velocity that the servo works with in the coming step, from those that the state gives: the
    /// joint's, or what the effects before this one make of them. Called first.
    fn encoder(&self, _p: &[f64], _memory: &mut [f64], state: &JointInput) -> (f64, f64) {
        (state.q, state.dq)
    }
    /// The command that reaches the motor in the coming step; `q` and `dq` are what the servo sees.
    fn command(&self, _p: &[f64], _memory: &mut [f64], state: &JointInput) -> f64 {
        state.command
    }
    /// Changes the motor's torque of the coming step; `q` and `dq` are what the servo sees.
    fn motor(&self, _p: &[f64], _memory: &mut [f64], _motor: &mut MotorTorque, _state: &JointInput) {}
    /// Turns a torque in terms of what [`encoder`](Effect::encoder) gave into one in terms of what it was given.
    fn transmit(&self, _p: &[f64], _memory: &mut [f64], motor: Affine, _dof: &mut Dof, _state: &JointInput) -> Affine {
        motor
    }
    /// Torque and velocity on the motor's side of a transmission with a state of its own, after a step that brought the
    /// other side to the velocity `dq`.
    fn motor_side(&self, _memory: &[f64], _dq: f64) -> Option<(f64, f64)> {
        None
    }
    /// Adds to what acts on the joint in the coming step.
    fn torque(&self, _p: &[f64], _memory: &mut [f64], _dof: &mut Dof, _state: &JointInput) {}
    /// The position whose reading is `reading`: where a joint starts of which only the reading is known.
    fn start(&self, _p: &[f64], reading: f64) -> f64 {
        reading
    }
    /// What it could not do at this joint: a user's law that gave no number. Asked when a run ends.
    fn trouble(&self, _p: &[f64], _memory: &[f64], _joint: &str) -> Option<WorldError> {
        None
    }
    /// Changes what the sensors of a joint (of the base; of the robot) say, once the run is over and before noise is
    /// added.
    fn sense(&self, _p: &[f64], _joint: &str, _log: &mut Log) {}
}

impl fmt::Debug for dyn Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.spec().name)
    }
}

/// A command that follows another, when the step begins and when it ends: `memory` says whether there was one, and
/// holds its last value; `change` turns the distance to go into what is gone of it in this step. NaN switches the motor
/// off and forgets.
pub(super) fn follow(memory: &mut [f64], command: f64, change: impl Fn(f64) -> f64) -> (f64, f64) {
    let [started, told] = memory else { return (command, command) };
    if command.is_nan() {
        *started = 0.0;
        return (command, command);
    }
    let before = if *started > 0.0 { *told } else { command };
    *told = before + change(command - before);
    *started = 1.0;
    (before, *told)
}

/// An effect somewhere, with values for its parameters.
#[derive(Clone, Debug)]
pub struct PlacedEffect {
    /// Which effect.
    pub effect: &'static dyn Effect,
    /// Names of joints or links, as [`site::matches`](crate::robot::site::matches) reads them.
    pub site: String,
    /// One value per parameter of its card.
    pub values: Vec<f64>,
}

impl PlacedEffect {
    /// The effect at a site, switched off.
    pub fn off(effect: &'static dyn Effect, site: impl Into<String>) -> Self {
        PlacedEffect { effect, site: site.into(), values: effect.spec().params.iter().map(|param| param.off).collect() }
    }

    /// The effect at a site with typical values.
    pub fn hinted(effect: &'static dyn Effect, site: impl Into<String>) -> Self {
        PlacedEffect {
            effect,
            site: site.into(),
            values: effect.spec().params.iter().map(|param| param.hint).collect(),
        }
    }

    /// Whether it does nothing: all its parameters but the shapes are off. A formula may have none, and acts.
    pub fn is_off(&self) -> bool {
        let params = self.values.iter().zip(self.effect.spec().params);
        !self.values.is_empty()
            && params.filter(|(_, param)| !param.shape).all(|(value, param)| value.to_bits() == param.off.to_bits())
    }

    /// Whether there is one value for each parameter, and each is a number (of a sign that makes sense) or the
    /// parameter's off.
    pub fn check(&self) -> Result<(), WorldError> {
        let spec = self.effect.spec();
        if self.values.len() != spec.params.len() {
            let (name, wanted, got) = (spec.name, spec.params.len(), self.values.len());
            return Err(setup_error(format!("effect `{name}` takes {wanted} values, not {got}")));
        }
        let fits = |value: f64, param: &Param| {
            let positive = !(param.shape && param.bounds.0 > 0.0) || value > 0.0;
            value.to_bits() == param.off.to_bits()
                || (value.is_finite() && value >= param.bounds.0.min(0.0) && positive)
        };
        match self.values.iter().zip(spec.params).find(|(value, param)| !fits(**value, param)) {
            Some((value, param)) => {
                let (name, unit) = (param.name, if param.unit == "1" { "" } else { param.unit });
                let message = format!("`{}.{name}` cannot be {value} {unit}", spec.name);
                Err(setup_error(message.trim_end().to_owned()))
            }
            None => Ok(()),
        }
    }

    /// Checks that there is something at its site.
    ///
    /// # Errors
    /// [`WorldError::Setup`] when the robot has nothing of that name.
    pub fn check_site(&self, robot: &Robot) -> Result<(), WorldError> {
        match self.effect.spec().site {
            SiteKind::Joint | SiteKind::Robot => self.joints(robot).map(|_| ()),
            SiteKind::Link => self.links(robot).map(|_| ()),
            SiteKind::Base | SiteKind::Ground => Ok(()),
        }
    }

    /// The movable joints that it sits on, as indices among them; none for effects that sit elsewhere.
    pub(crate) fn joints(&self, robot: &Robot) -> Result<Vec<usize>, WorldError> {
        if !self.effect.spec().site.is_on_joints() {
            return Ok(Vec::new());
        }
        let names = robot.movable().map(|(_, link)| link.joint.name.as_str());
        self.found(names.enumerate().filter(|(_, name)| matches(&self.site, name)).map(|(i, _)| i).collect())
    }

    /// The links that it sits on.
    pub(crate) fn links(&self, robot: &Robot) -> Result<Vec<usize>, WorldError> {
        let is_meant = |i: usize, name: &str| matches(&self.site, name) || (i == 0 && self.site == "base");
        let links = robot.links.iter().enumerate();
        self.found(links.filter(|(i, link)| is_meant(*i, &link.name)).map(|(i, _)| i).collect())
    }

    fn found(&self, sites: Vec<usize>) -> Result<Vec<usize>, WorldError> {
        if sites.is_empty() {
            let name = self.effect.spec().name;
            return Err(setup_error(format!("effect `{name}`: the robot has nothing called `{}`", self.site)));
        }
        Ok(sites)
    }
}
