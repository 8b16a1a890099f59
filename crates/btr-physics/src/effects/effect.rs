//! The effect trait with its hooks, the effect's specification and parameters, and an effect placed at a site.

use crate::actuation::{JointInput, MotorTorque, NeighbourQuantity};
use crate::engine::{Affine, Dof};
use crate::robot::site::matches;
use crate::robot::{Link, Robot, Side};
use crate::setup::{Setup, setup_error};
use btr_core::log::Log;
use btr_core::world::WorldError;
use std::fmt;

/// Kinds of sites that an effect can be placed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SiteKind {
    /// On joints.
    Joint,
    /// On links; `base` means the root.
    Link,
    /// On the root's mounting or its sensors; the site is `base` (or `*`).
    Base,
    /// On the floor; the site is always `*`.
    Ground,
    /// On the robot as a whole, all joints at once; the site is always `*`.
    Robot,
}

impl SiteKind {
    /// Whether effects at these sites act through joints.
    pub fn is_on_joints(self) -> bool {
        matches!(self, SiteKind::Joint | SiteKind::Robot)
    }
}

/// What an effect has to do with the dry friction of its joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DryFriction {
    /// Nothing.
    Unrelated,
    /// It adds some.
    Adds,
    /// It changes how that of others acts, and does nothing where there is none.
    Changes,
}

/// What an effect's torque depends on at a joint whose motion is prescribed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TorqueLaw {
    /// On its joints' motion and its own parameters alone, in proportion to those that are no shapes.
    Proportional,
    /// On its joints' motion, its own parameters, and what else acts in the joint and depends on these alone.
    OfMotion,
    /// On more, such as the motor's torque.
    Other,
}

/// A parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Param {
    /// Name, unique within the effect.
    pub name: &'static str,
    /// SI unit as text.
    pub unit: &'static str,
    /// Smallest and largest sensible value.
    pub bounds: (f64, f64),
    /// The value at which the effect is absent: infinite for limits, NaN where the model's own value applies. Shape
    /// parameters have their typical value here.
    pub off: f64,
    /// Typical value, from which a search starts.
    pub hint: f64,
    /// Whether it only shapes the effect (the speed of a Stribeck curve, the order of cogging) and does not enable it.
    pub shape: bool,
    /// Whether it is a stiffness: off when infinite, and its inverse is felt from 0 on.
    pub stiffness: bool,
}

impl Param {
    /// A parameter that is off at zero.
    pub(crate) const fn new(name: &'static str, unit: &'static str, bounds: (f64, f64), hint: f64) -> Self {
        Param { name, unit, bounds, off: 0.0, hint, shape: false, stiffness: false }
    }

    /// A limit, which is off when infinite.
    pub(crate) const fn limit(name: &'static str, unit: &'static str, bounds: (f64, f64), hint: f64) -> Self {
        Param { name, unit, bounds, off: f64::INFINITY, hint, shape: false, stiffness: false }
    }

    /// A stiffness in series, which is off when infinite.
    pub(crate) const fn stiffness(name: &'static str, unit: &'static str, bounds: (f64, f64), hint: f64) -> Self {
        Param { stiffness: true, ..Param::limit(name, unit, bounds, hint) }
    }

    /// A parameter that replaces a value of the model; off when NaN.
    pub(crate) const fn replacement(name: &'static str, unit: &'static str, bounds: (f64, f64), hint: f64) -> Self {
        Param { name, unit, bounds, off: f64::NAN, hint, shape: false, stiffness: false }
    }

    /// A parameter that only shapes the effect.
    pub(crate) const fn shape(name: &'static str, unit: &'static str, bounds: (f64, f64), hint: f64) -> Self {
        Param { name, unit, bounds, off: hint, hint, shape: true, stiffness: false }
    }
}

/// Static description of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectSpec {
    /// Name in model files, output and code.
    pub name: &'static str,
    /// The law in one line.
    pub law: &'static str,
    /// The kind of its sites.
    pub site: SiteKind,
    /// Source of the law.
    pub cite: &'static str,
    /// How it appears in the error of a model that lacks it.
    pub symptom: &'static str,
    /// Its parameters, in the order of [`PlacedEffect::values`].
    pub params: &'static [Param],
    /// Values of its shape parameters (in their order among the parameters) from which a search should start.
    pub starts: &'static [&'static [f64]],
    /// Names of effects that most motions cannot distinguish from it.
    pub similar: &'static [&'static str],
    /// Those of the similar effects that it contains as a special case, with the parameter values at which it equals
    /// the other effect at that effect's hint.
    pub nested: &'static [(&'static str, &'static [f64])],
}

/// A physical effect. Every hook does nothing by default; an effect implements the hooks that it needs. `p` holds the
/// values of its parameters. `memory` is private to the effect (one per joint) and zero at the start of a run. An
/// effect that is off is not part of a run.
pub trait Effect: Sync {
    /// Static description.
    fn spec(&self) -> &'static EffectSpec;
    /// Whether a cause outside the joints (a bus, a supply, firmware) may give it to all of them at once.
    fn is_common(&self) -> bool {
        false
    }
    /// Whether nearly every drive has it: friction and a rotor, which a model of the links alone lacks.
    fn is_usual(&self) -> bool {
        false
    }
    /// Whether what one joint does reaches others through it, beside the robot's links.
    fn joins_limbs(&self) -> bool {
        false
    }
    /// Whether it changes what a joint's encoder reads, and with that the motion that a log describes.
    fn changes_readings(&self) -> bool {
        false
    }
    /// Whether it turns the command into another one whatever the joint does, in periods of the command that its only
    /// parameter is the size of. What it makes of a log's commands is then known without a simulation ([`commanded`]).
    ///
    /// [`commanded`]: super::commanded
    fn is_of_command(&self) -> bool {
        false
    }
    /// How many of it a joint may have that the motion can tell apart: ripples of unlike orders.
    fn instances(&self) -> usize {
        1
    }
    /// Whether it changes how a motor follows its command or drives its joint: where the motion is prescribed, nothing
    /// shows of it.
    fn is_of_motor(&self) -> bool {
        false
    }
    /// Whether a diagnosis tries it; one that is not tried is for models and fits that name it.
    fn is_suspected(&self) -> bool {
        true
    }
    /// Whether it is for joints whose motion is prescribed.
    fn is_for_prescribed_motion(&self) -> bool {
        false
    }
    /// Whether a link, or the joint that carries it, can have it.
    fn acts_on(&self, _robot: &Robot, _link: usize) -> bool {
        true
    }
    /// Whether it acts at a link's end, where the links that this one carries begin.
    fn acts_at_end(&self) -> bool {
        false
    }
    /// Values of its shape parameters from which a search on a link should start: those of its specification, unless
    /// they depend on the robot, or on the largest measured speed of the link's joint, in rad/s (m/s).
    fn starts(&self, _robot: &Robot, _link: usize, _top_speed: Option<f64>) -> Vec<Vec<f64>> {
        self.spec().starts.iter().map(|values| values.to_vec()).collect()
    }
    /// What it has to do with the dry friction of its joint.
    fn dry_friction(&self) -> DryFriction {
        DryFriction::Unrelated
    }
    /// What its torque depends on where the motion is prescribed.
    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::Other
    }
    /// The quantities of neighbouring joints that it uses.
    fn neighbours(&self) -> &[NeighbourQuantity] {
        &[]
    }
    /// Changes a link before the world is built.
    fn link(&self, _p: &[f64], _robot: &mut Robot, _link: usize) {}
    /// Changes gravity or the floor before the world is built.
    fn world(&self, _p: &[f64], _setup: &mut Setup) {}
    /// Adds constant properties of a joint, before the run.
    fn joint(&self, _p: &[f64], _dof: &mut Dof) {}
    /// Whether [`joint`](Self::joint) is all that it does, so that no step has to call it.
    fn is_constant(&self) -> bool {
        false
    }
    /// Number of values in its memory per joint, for steps of `dt_s`.
    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        0
    }
    /// Position and velocity that the servo works with in the coming step, computed from those of the state: the
    /// joint's, or the output of the effects before this one. Called first.
    fn encoder(&self, _p: &[f64], _memory: &mut [f64], state: &JointInput) -> (f64, f64) {
        (state.q, state.dq)
    }
    /// The command that reaches the motor in the coming step; `q` and `dq` are what the servo sees.
    fn command(&self, _p: &[f64], _memory: &mut [f64], state: &JointInput) -> f64 {
        state.command
    }
    /// Changes the motor's torque in the coming step; `q` and `dq` are what the servo sees.
    fn motor(&self, _p: &[f64], _memory: &mut [f64], _motor: &mut MotorTorque, _state: &JointInput) {}
    /// Converts a torque that depends on the output of [`encoder`](Effect::encoder) into one that depends on its input.
    fn transmit(&self, _p: &[f64], _memory: &mut [f64], motor: Affine, _dof: &mut Dof, _state: &JointInput) -> Affine {
        motor
    }
    /// Torque and velocity on the motor's side of a transmission that has a state, after a step in which the link's
    /// side reached the velocity `dq`.
    fn motor_side(&self, _memory: &[f64], _dq: f64) -> Option<(f64, f64)> {
        None
    }
    /// Adds torques and friction that act on the joint in the coming step.
    fn torque(&self, _p: &[f64], _memory: &mut [f64], _dof: &mut Dof, _state: &JointInput) {}
    /// The position whose reading is `reading`: the start of a joint of which only the reading is known.
    fn start(&self, _p: &[f64], reading: f64) -> f64 {
        reading
    }
    /// The error at this joint, if any: a user's law that returned no finite number. Queried at the end of a run.
    fn trouble(&self, _p: &[f64], _memory: &[f64], _joint: &str) -> Option<WorldError> {
        None
    }
    /// Changes the logged readings of a joint (of the base; of the robot) after the run and before noise is added.
    fn sense(&self, _p: &[f64], _joint: &str, _log: &mut Log) {}
}

impl fmt::Debug for dyn Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.spec().name)
    }
}

/// A value that follows the command: its values at the start and at the end of the step. `memory` holds whether there
/// was a command, and the last value; `change` maps the remaining error to the change in this step. A NaN command
/// switches the motor off and resets the memory.
pub(super) fn follow(memory: &mut [f64], command: f64, change: impl Fn(f64) -> f64) -> (f64, f64) {
    let [started, value] = memory else { return (command, command) };
    if command.is_nan() {
        *started = 0.0;
        return (command, command);
    }
    let before = if *started > 0.0 { *value } else { command };
    *value = before + change(command - before);
    *started = 1.0;
    (before, *value)
}

/// A neighbour that a joint does not have although an effect on it uses it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{joint}` has no movable joint {}, which `{}` refers to", direction(.quantity.side()), .quantity.name())]
pub struct MissingNeighbour {
    /// What the effect uses.
    pub quantity: NeighbourQuantity,
    /// The joint.
    pub joint: String,
}

fn direction(side: Side) -> &'static str {
    match side {
        Side::Parent => "towards the base",
        Side::Child => "further out",
    }
}

/// An effect at a site, with values for its parameters.
#[derive(Clone, Debug)]
pub struct PlacedEffect {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Names of joints or links, as [`site::matches`](crate::robot::site::matches) reads them.
    pub site: String,
    /// One value per parameter of its specification.
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

    /// Whether its joint has a rotor of its own, behind a transmission that is not rigid.
    pub fn has_rotor(&self) -> bool {
        let memory = vec![0.0; self.effect.memory(&self.values, 1.0)];
        self.effect.motor_side(&memory, 0.0).is_some()
    }

    /// Whether it does nothing: all its parameters except the shapes are off. A formula without parameters is on.
    pub fn is_off(&self) -> bool {
        let params = self.values.iter().zip(self.effect.spec().params);
        !self.values.is_empty()
            && params.filter(|(_, param)| !param.shape).all(|(value, param)| value.to_bits() == param.off.to_bits())
    }

    /// Checks that there is one value for each parameter, and that each is finite with a valid sign or equals the
    /// parameter's `off`.
    pub fn check(&self) -> Result<(), WorldError> {
        let spec = self.effect.spec();
        if self.values.len() != spec.params.len() {
            let (name, expected, count) = (spec.name, spec.params.len(), self.values.len());
            return Err(setup_error(format!("effect `{name}` takes {expected} values, not {count}")));
        }
        let fits = |value: f64, param: &Param| {
            let positive = !(param.shape && param.bounds.0 > 0.0) || value > 0.0;
            value.to_bits() == param.off.to_bits()
                || (value.is_finite() && (value >= 0.0 || param.bounds.0 < 0.0) && positive)
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

    /// Checks that its site names something on the robot.
    ///
    /// # Errors
    /// [`WorldError::Setup`] if the robot has nothing of that name.
    pub fn check_site(&self, robot: &Robot) -> Result<(), WorldError> {
        match self.effect.spec().site {
            SiteKind::Joint | SiteKind::Robot => self.joints(robot).map(|_| ()),
            SiteKind::Link => self.links(robot).map(|_| ()),
            SiteKind::Base | SiteKind::Ground => Ok(()),
        }
    }

    /// Checks that its joints have the neighbours that it uses.
    ///
    /// # Errors
    /// The first joint that lacks one.
    pub fn check_neighbours(&self, robot: &Robot) -> Result<(), MissingNeighbour> {
        let used = self.effect.neighbours();
        if used.is_empty() {
            return Ok(());
        }
        let acts = |(link, _): &(usize, &Link)| self.effect.acts_on(robot, *link);
        for ((_, link), neighbours) in robot.movable().zip(robot.neighbours()).filter(|(link, _)| acts(link)) {
            let missing = used.iter().find(|quantity| neighbours.on(quantity.side()).is_none());
            if let Some(&quantity) = missing.filter(|_| matches(&self.site, &link.joint.name)) {
                return Err(MissingNeighbour { quantity, joint: link.joint.name.clone() });
            }
        }
        Ok(())
    }

    /// The joints at its site, as indices among the movable joints; none for effects on other kinds of sites.
    pub(crate) fn joints(&self, robot: &Robot) -> Result<Vec<usize>, WorldError> {
        if !self.effect.spec().site.is_on_joints() {
            return Ok(Vec::new());
        }
        let joints = robot.movable().enumerate();
        let here = |link: usize, name: &str| matches(&self.site, name) && self.effect.acts_on(robot, link);
        self.non_empty(joints.filter(|(_, (link, of))| here(*link, &of.joint.name)).map(|(i, _)| i).collect())
    }

    /// The links at its site.
    pub(crate) fn links(&self, robot: &Robot) -> Result<Vec<usize>, WorldError> {
        let is_at_site = |i: usize, name: &str| matches(&self.site, name) || (i == 0 && self.site == "base");
        let links = robot.links.iter().enumerate();
        self.non_empty(links.filter(|(i, link)| is_at_site(*i, &link.name)).map(|(i, _)| i).collect())
    }

    fn non_empty(&self, sites: Vec<usize>) -> Result<Vec<usize>, WorldError> {
        if sites.is_empty() {
            let name = self.effect.spec().name;
            let has_none = match (self.effect.is_for_prescribed_motion(), self.effect.neighbours().is_empty()) {
                (true, false) => " is for joints with a neighbour whose motion is prescribed, and there is none at",
                (true, true) => " is for joints whose motion is prescribed, and there is none at",
                (false, _) => ": the robot has no site",
            };
            return Err(setup_error(format!("effect `{name}`{has_none} `{}`", self.site)));
        }
        Ok(sites)
    }
}
