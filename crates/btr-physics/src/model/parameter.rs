//! Parameters by name: `mass@LINK`, `length@LINK`, `kp@JOINT`, `ground_friction`, `EFFECT.PARAM@SITE` (with a user's
//! law as well: `formula.PARAM@SITE`, the site as its effect has it).
//!
//! A site may be a comma-separated list and contain `*`; one value then holds for all matches. The value of an effect
//! at one of several joints that the model places it at is that joint's own; the others keep theirs.

use crate::effects;
use crate::effects::{EFFECTS, Effect, FORMULA, PlacedEffect, SiteKind};
use crate::robot::site::matches;
use crate::robot::stretch;
use crate::robot::{Actuator, Robot};
use crate::setup::Setup;
use nalgebra::{UnitQuaternion, Vector3};

/// A quantity of the model that can be set.
#[derive(Clone, Debug)]
pub struct Target {
    name: String,
    quantity: Quantity,
    site: String,
    /// Indices of the links; for quantities of joints, the links that these carry.
    links: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
enum Quantity {
    Mass,
    /// Factor on the link's length.
    Length,
    /// Factor on the link's rotational inertia.
    Inertia,
    /// Displacement of the joint's frame along an axis of its parent's.
    Origin(usize),
    /// Rotation of the joint's frame about one of its own axes.
    Tilt(usize),
    /// Friction as the robot's file states it.
    Damping,
    DryFriction,
    Motor(MotorValue),
    GroundFriction,
    Effect(&'static dyn Effect, usize),
    /// A parameter of a user's law, which is declared in the model.
    Formula,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MotorValue {
    Kp,
    Ki,
    Kd,
    MaxTorque,
    Kt,
    Resistance,
    Gain,
    Supply,
}

const QUANTITIES: [(&str, Quantity); 20] = [
    ("mass", Quantity::Mass),
    ("length", Quantity::Length),
    ("inertia", Quantity::Inertia),
    ("origin_x", Quantity::Origin(0)),
    ("origin_y", Quantity::Origin(1)),
    ("origin_z", Quantity::Origin(2)),
    ("tilt_x", Quantity::Tilt(0)),
    ("tilt_y", Quantity::Tilt(1)),
    ("tilt_z", Quantity::Tilt(2)),
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

/// Errors in a parameter's name.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// No quantity, effect or effect's parameter of that name.
    #[error("`{name}` is not a parameter{}", did_you_mean(near))]
    Unknown {
        /// The given name.
        name: String,
        /// Similar names, most similar first.
        near: Vec<String>,
    },
    /// No joint or link matches the site.
    #[error("the robot has no {what} `{site}`{}", did_you_mean(near))]
    Site {
        /// Joint or link.
        what: &'static str,
        /// The given name.
        site: String,
        /// Similar names, most similar first.
        near: Vec<String>,
    },
    /// A quantity that the site does not have.
    #[error("`{name}`: {why}")]
    Absent {
        /// The parameter.
        name: String,
        /// Why the site lacks it.
        why: String,
    },
}

fn did_you_mean(near: &[String]) -> String {
    if near.is_empty() { String::new() } else { format!("; did you mean `{}`?", near.join("` or `")) }
}

impl Target {
    /// Parses a parameter's name for this robot.
    ///
    /// # Errors
    /// An unknown name or site, with similar ones; a motor value that the joint's actuator does not have; a link
    /// without a long axis.
    pub fn parse(name: &str, robot: &Robot) -> Result<Target, ParameterError> {
        let (what, site) = name.split_once('@').unwrap_or((name, "*"));
        let quantity = quantity(what)?;
        let links = quantity.links(site, robot)?;
        let target = Target { name: name.to_owned(), quantity, site: site.to_owned(), links };
        target.check(robot)?;
        Ok(target)
    }

    /// The name that it was parsed from.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// SI unit as text.
    pub fn unit(&self) -> &'static str {
        match self.quantity {
            Quantity::Mass => "kg",
            Quantity::Length | Quantity::Inertia | Quantity::GroundFriction => "1",
            Quantity::Origin(_) => "m",
            Quantity::Tilt(_) => "rad",
            Quantity::Damping => "N·m·s/rad",
            Quantity::DryFriction => "N·m",
            Quantity::Effect(effect, param) => effect.spec().params[param].unit,
            Quantity::Formula => "SI",
            Quantity::Motor(value) => value.unit(),
        }
    }

    /// The value in this model; `None` where the sites' values differ, where there is no floor, and for limits that are
    /// off.
    pub fn nominal(&self, robot: &Robot, placed: &[PlacedEffect], setup: &Setup) -> Option<f64> {
        match self.quantity {
            Quantity::Length | Quantity::Inertia => Some(1.0),
            Quantity::Origin(_) | Quantity::Tilt(_) => Some(0.0),
            Quantity::Damping => common(self.links.iter().map(|&link| robot.links[link].joint.damping)),
            Quantity::DryFriction => common(self.links.iter().map(|&link| robot.links[link].joint.dry_friction)),
            Quantity::GroundFriction => setup.ground.map(|ground| ground.friction),
            Quantity::Mass => common(self.links.iter().map(|&link| robot.links[link].mass_kg)),
            Quantity::Motor(value) => common(
                self.links.iter().filter_map(|&link| value.of(&mut robot.links[link].joint.actuator.clone()).copied()),
            ),
            Quantity::Effect(effect, param) => {
                let placed_effect = self.covering(effect, robot, placed).map(|index| &placed[index]);
                let value = placed_effect.map_or(effect.spec().params[param].off, |p| p.values[param]);
                value.is_finite().then_some(value)
            }
            Quantity::Formula => common(placed.iter().filter_map(|p| Some(p.values[self.of_formula(p)?]))),
        }
    }

    /// Checks that the model has the law, if it is a law's parameter.
    ///
    /// # Errors
    /// [`ParameterError::Absent`] otherwise.
    pub fn check_formula(&self, placed: &[PlacedEffect]) -> Result<(), ParameterError> {
        if matches!(self.quantity, Quantity::Formula) && placed.iter().all(|p| self.of_formula(p).is_none()) {
            let why = format!("no formula at `{}` has a parameter of that name", self.site);
            return Err(ParameterError::Absent { name: self.name.clone(), why });
        }
        Ok(())
    }

    /// Sets its value. Geometry and inertia are relative to the present ones, so set them only once, on a fresh copy of
    /// the model.
    pub fn set(&self, value: f64, robot: &mut Robot, placed: &mut Vec<PlacedEffect>, setup: &mut Setup) {
        match self.quantity {
            Quantity::Mass => self.links.iter().for_each(|&link| set_mass(robot, link, value)),
            Quantity::Length => self.links.iter().for_each(|&link| stretch::stretch(robot, link, value)),
            Quantity::Inertia => self.links.iter().for_each(|&link| robot.links[link].inertia_kg_m2 *= value),
            Quantity::Origin(axis) => {
                for &link in &self.links {
                    robot.links[link].joint.origin.translation.vector[axis] += value;
                }
            }
            Quantity::Tilt(axis) => {
                let rotation = UnitQuaternion::from_scaled_axis(Vector3::ith(axis, value));
                self.links.iter().for_each(|&link| robot.links[link].joint.origin.rotation *= rotation);
            }
            Quantity::Damping => self.links.iter().for_each(|&link| robot.links[link].joint.damping = value),
            Quantity::DryFriction => self.links.iter().for_each(|&link| robot.links[link].joint.dry_friction = value),
            Quantity::Motor(motor) => {
                for &link in &self.links {
                    if let Some(place) = motor.of(&mut robot.links[link].joint.actuator) {
                        *place = value;
                    }
                }
            }
            Quantity::GroundFriction => {
                if let Some(ground) = &mut setup.ground {
                    ground.friction = value;
                }
            }
            Quantity::Effect(effect, param) => {
                let index = self.place(effect, robot, placed);
                placed[index].values[param] = value;
            }
            Quantity::Formula => {
                for placed_effect in placed {
                    if let Some(param) = self.of_formula(placed_effect) {
                        placed_effect.values[param] = value;
                    }
                }
            }
        }
    }

    /// Index of the parameter in a placed law, if it is the named law at the same site.
    fn of_formula(&self, placed: &PlacedEffect) -> Option<usize> {
        let spec = placed.effect.spec();
        let (what, _) = self.name.split_once('@').unwrap_or((&self.name, ""));
        let (effect, name) = what.split_once('.')?;
        let matching = spec.name == effect && placed.site == self.site;
        matching.then(|| spec.params.iter().position(|param| param.name == name))?
    }

    /// The effect at the site, as an index: as it is placed there, separated from other sites of a placed effect, or
    /// newly placed and off.
    fn place(&self, effect: &'static dyn Effect, robot: &Robot, placed: &mut Vec<PlacedEffect>) -> usize {
        let Some(index) = self.covering(effect, robot, placed) else {
            placed.push(PlacedEffect::off(effect, self.site.clone()));
            return placed.len() - 1;
        };
        let all = self.quantity.sites(robot).unwrap_or_default();
        let names = all.into_iter().map(|(_, name)| name);
        let others: Vec<&str> =
            names.filter(|name| matches(&placed[index].site, name) && !matches(&self.site, name)).collect();
        if self.is_at(effect, &placed[index]) || others.is_empty() {
            return index;
        }
        let own = PlacedEffect { site: self.site.clone(), ..placed[index].clone() };
        placed[index].site = others.join(",");
        placed.push(own);
        placed.len() - 1
    }

    /// The placed effect at exactly this site, or at several sites of which this is a part, as an index.
    fn covering(&self, effect: &dyn Effect, robot: &Robot, placed: &[PlacedEffect]) -> Option<usize> {
        let exactly = placed.iter().position(|p| self.is_at(effect, p));
        let here = |p: &PlacedEffect, link: &usize| {
            let all = self.quantity.sites(robot).unwrap_or_default();
            all.iter().any(|(index, name)| index == link && matches(&p.site, name))
        };
        let covers = |p: &PlacedEffect| {
            let same = p.effect.spec().name == effect.spec().name && !self.links.is_empty();
            same && self.links.iter().all(|link| here(p, link))
        };
        exactly.or_else(|| placed.iter().position(covers))
    }

    fn is_at(&self, effect: &dyn Effect, placed: &PlacedEffect) -> bool {
        placed.effect.spec().name == effect.spec().name && placed.site == self.site
    }

    fn check(&self, robot: &Robot) -> Result<(), ParameterError> {
        let absent = |why: String| Err(ParameterError::Absent { name: self.name.clone(), why });
        for &index in &self.links {
            let link = &robot.links[index];
            match self.quantity {
                Quantity::Motor(value) if value.of(&mut link.joint.actuator.clone()).is_none() => {
                    return absent(format!("the actuator of joint `{}` has no such value", link.joint.name));
                }
                Quantity::Length if stretch::long_axis(robot, index).is_none() => {
                    return absent(format!("link `{}` has no long axis", link.name));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Sets the value of every target.
pub fn apply(targets: &[Target], values: &[f64], robot: &mut Robot, placed: &mut Vec<PlacedEffect>, setup: &mut Setup) {
    for (target, &value) in targets.iter().zip(values) {
        target.set(value, robot, placed, setup);
    }
}

fn quantity(name: &str) -> Result<Quantity, ParameterError> {
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
            | Quantity::Damping
            | Quantity::DryFriction => true,
            Quantity::Mass | Quantity::Length | Quantity::Inertia => false,
        })
    }

    /// All its sites, with the links or the links that the joints carry; `None` if it belongs to no single one.
    fn sites<'r>(&self, robot: &'r Robot) -> Option<Vec<(usize, &'r str)>> {
        Some(match self.is_of_joints()? {
            true => robot.movable().map(|(i, link)| (i, link.joint.name.as_str())).collect(),
            false => robot.links.iter().enumerate().map(|(i, link)| (i, link.name.as_str())).collect(),
        })
    }

    /// The links that match the site.
    fn links(&self, site: &str, robot: &Robot) -> Result<Vec<usize>, ParameterError> {
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
    fn unit(self) -> &'static str {
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
    fn of(self, actuator: &mut Actuator) -> Option<&mut f64> {
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

/// Sets a link's mass at the same shape and density profile: its inertia scales with the mass.
fn set_mass(robot: &mut Robot, link: usize, mass_kg: f64) {
    let link = &mut robot.links[link];
    if link.mass_kg > 0.0 {
        link.inertia_kg_m2 *= mass_kg / link.mass_kg;
    }
    link.mass_kg = mass_kg;
}

/// The common value, if all are bitwise equal, as those from one model file are.
fn common(mut values: impl Iterator<Item = f64>) -> Option<f64> {
    let first = values.next()?;
    values.all(|value| value.to_bits() == first.to_bits()).then_some(first)
}

/// Up to three of `known` that are similar to `name`.
fn near(name: &str, known: impl Iterator<Item = String>) -> Vec<String> {
    let mut scored: Vec<(f64, String)> =
        known.map(|k| (strsim::jaro_winkler(name, &k), k)).filter(|(s, _)| *s > 0.8).collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    scored.into_iter().take(3).map(|(_, known)| known).collect()
}
