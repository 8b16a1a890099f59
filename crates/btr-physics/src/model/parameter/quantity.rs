//! The quantities that a parameter can name, and where they are.

use super::error::{ParameterError, near};
use crate::effects;
use crate::effects::{EFFECTS, Effect, FORMULA, SiteKind};
use crate::robot::site::matches;
use crate::robot::{Actuator, Robot};

/// A quantity.
#[derive(Clone, Copy, Debug)]
pub(super) enum Quantity {
    Mass,
    /// Factor on the link's length.
    Length,
    /// Factor on the link's rotational inertia.
    Inertia,
    /// Displacement of the joint's frame along an axis of its parent's.
    Origin(usize),
    /// Rotation of the joint's frame about one of its own axes.
    Tilt(usize),
    /// Which way a joint counts: below 0, the other way round than the robot's file says.
    Direction,
    /// Friction as the robot's file states it.
    Damping,
    DryFriction,
    Motor(MotorValue),
    GroundFriction,
    Effect(&'static dyn Effect, usize),
    /// A parameter of a user's law, which is declared in the model.
    Formula,
}

/// A value of an actuator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MotorValue {
    Kp,
    Ki,
    Kd,
    MaxTorque,
    Kt,
    Resistance,
    Gain,
    Supply,
}

/// Names of all quantities but the parameters of effects.
const QUANTITIES: [(&str, Quantity); 21] = [
    ("mass", Quantity::Mass),
    ("length", Quantity::Length),
    ("inertia", Quantity::Inertia),
    ("origin_x", Quantity::Origin(0)),
    ("origin_y", Quantity::Origin(1)),
    ("origin_z", Quantity::Origin(2)),
    ("tilt_x", Quantity::Tilt(0)),
    ("tilt_y", Quantity::Tilt(1)),
    ("tilt_z", Quantity::Tilt(2)),
    ("direction", Quantity::Direction),
    ("damping", Quantity::Damping),
    ("friction", Quantity::DryFriction),
    ("kp", Quantity::Motor(MotorValue::Kp)),
    ("ki", Quantity::Motor(MotorValue::Ki)),
    ("kd", Quantity::Motor(MotorValue::Kd)),
    ("max_torque", Quantity::Motor(MotorValue::MaxTorque)),
    ("kt", Quantity::Motor(MotorValue::Kt)),
    ("resistance", Quantity::Motor(MotorValue::Resistance)),
    ("gain", Quantity::Motor(MotorValue::Gain)),
    ("supply", Quantity::Motor(MotorValue::Supply)),
    ("ground_friction", Quantity::GroundFriction),
];

/// The quantity of that name.
pub(super) fn quantity(name: &str) -> Result<Quantity, ParameterError> {
    if let Some((_, quantity)) = QUANTITIES.iter().find(|(known, _)| *known == name) {
        return Ok(*quantity);
    }
    let found = name.split_once('.').and_then(|(effect, param)| {
        if effect == FORMULA.name {
            return Some(Quantity::Formula);
        }
        let effect = effects::find(effect)?;
        Some(Quantity::Effect(effect, effect.spec().params.iter().position(|p| p.name == param)?))
    });
    found.ok_or_else(|| {
        let of_effects = EFFECTS.iter().flat_map(|effect| {
            let spec = effect.spec();
            spec.params.iter().map(|param| format!("{}.{}", spec.name, param.name))
        });
        let known = QUANTITIES.iter().map(|(known, _)| (*known).to_owned());
        ParameterError::Unknown { name: name.to_owned(), near: near(name, known.chain(of_effects)) }
    })
}

impl Quantity {
    /// Whether its sites are joints rather than links; `None` if it belongs to no single one.
    fn is_of_joints(&self) -> Option<bool> {
        Some(match self {
            Quantity::GroundFriction => return None,
            Quantity::Effect(effect, _) => match effect.spec().site {
                SiteKind::Ground | SiteKind::Base | SiteKind::Robot => return None,
                SiteKind::Joint => true,
                SiteKind::Link => false,
            },
            Quantity::Motor(_)
            | Quantity::Formula
            | Quantity::Origin(_)
            | Quantity::Tilt(_)
            | Quantity::Direction
            | Quantity::Damping
            | Quantity::DryFriction => true,
            Quantity::Mass | Quantity::Length | Quantity::Inertia => false,
        })
    }

    /// All its sites, with the links or the links that the joints carry; `None` if it belongs to no single one.
    pub(super) fn sites<'r>(&self, robot: &'r Robot) -> Option<Vec<(usize, &'r str)>> {
        Some(match self.is_of_joints()? {
            true => robot.movable().map(|(i, link)| (i, link.joint.name.as_str())).collect(),
            false => robot.links.iter().enumerate().map(|(i, link)| (i, link.name.as_str())).collect(),
        })
    }

    /// The links that match the site.
    pub(super) fn links(&self, site: &str, robot: &Robot) -> Result<Vec<usize>, ParameterError> {
        let (Some(of_joints), Some(names)) = (self.is_of_joints(), self.sites(robot)) else { return Ok(Vec::new()) };
        let matching = |i: usize, name: &str| matches(site, name) || (!of_joints && i == 0 && site == "base");
        let found: Vec<usize> = names.iter().filter(|(i, name)| matching(*i, name)).map(|(i, _)| *i).collect();
        if found.is_empty() {
            let near = near(site, names.iter().map(|(_, name)| (*name).to_owned()));
            let what = if of_joints { "movable joint" } else { "link" };
            return Err(ParameterError::Site { what, site: site.to_owned(), near });
        }
        Ok(found)
    }
}

/// The values of an actuator with their names.
pub fn motor_values(actuator: &Actuator) -> impl Iterator<Item = (&'static str, f64)> {
    let mut actuator = actuator.clone();
    QUANTITIES.iter().filter_map(move |(name, quantity)| match quantity {
        Quantity::Motor(value) => value.of(&mut actuator).map(|x| (*name, *x)),
        _ => None,
    })
}

impl MotorValue {
    pub(super) fn unit(self) -> &'static str {
        match self {
            MotorValue::Kp => "N·m/rad",
            MotorValue::Ki => "N·m/(rad·s)",
            MotorValue::Kd => "N·m·s/rad",
            MotorValue::MaxTorque => "N·m",
            MotorValue::Kt => "N·m/A",
            MotorValue::Resistance => "ohm",
            MotorValue::Gain => "1/rad",
            MotorValue::Supply => "V",
        }
    }

    /// The value's field in an actuator.
    pub(super) fn of(self, actuator: &mut Actuator) -> Option<&mut f64> {
        match actuator {
            Actuator::Position { kp, ki, kd, max_torque } => match self {
                MotorValue::Kp => Some(kp),
                MotorValue::Ki => Some(ki),
                MotorValue::Kd => Some(kd),
                MotorValue::MaxTorque => Some(max_torque),
                _ => None,
            },
            Actuator::Torque { max_torque } if self == MotorValue::MaxTorque => Some(max_torque),
            Actuator::Voltage { kt, resistance, servo } => match self {
                MotorValue::Kt => Some(kt),
                MotorValue::Resistance => Some(resistance),
                MotorValue::Gain => servo.as_mut().map(|servo| &mut servo.gain),
                MotorValue::Supply => servo.as_mut().map(|servo| &mut servo.supply),
                _ => None,
            },
            _ => None,
        }
    }
}
