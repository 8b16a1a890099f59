//! Parameters by name: `mass@LINK`, `length@LINK`, `inertia@LINK`, `origin_x@JOINT`, `tilt_x@JOINT`, `direction@JOINT`,
//! `damping@JOINT`, `friction@JOINT`, `kp@JOINT`, `ground_friction`, `EFFECT.PARAM@SITE` (with a user's law as well:
//! `formula.PARAM@SITE`, the site as its effect has it).
//!
//! A site may be a comma-separated list and contain `*`; one value then holds for all matches, or each match gets a
//! target of its own ([`Target::each`]). The value of an effect at one of several joints that the model places it at is
//! that joint's own; the others keep theirs. `SITE#2` is a second instance of the same effect there.

mod each;
mod error;
mod quantity;

pub use error::ParameterError;
pub use quantity::motor_values;

use crate::effects::{Effect, PlacedEffect, SiteKind};
use crate::robot::Robot;
use crate::robot::site::{instance, matches, numbered};
use crate::robot::stretch;
use crate::setup::Setup;
use nalgebra::{UnitQuaternion, Vector3};
use quantity::{Quantity, quantity};

/// A quantity of the model that can be set.
#[derive(Clone, Debug)]
pub struct Target {
    name: String,
    quantity: Quantity,
    site: String,
    /// Indices of the links; for quantities of joints, the links that these carry.
    links: Vec<usize>,
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

    /// The effect whose parameter it is, and which one; `None` for a value of the robot and for a formula's.
    pub fn of_effect(&self) -> Option<(&'static dyn Effect, usize)> {
        match self.quantity {
            Quantity::Effect(effect, param) => Some((effect, param)),
            _ => None,
        }
    }

    /// Whether it is a parameter of a user's law.
    pub fn is_of_formula(&self) -> bool {
        matches!(self.quantity, Quantity::Formula)
    }

    /// Whether it changes the masses and inertias of links, and nothing else.
    pub fn is_inertial(&self) -> bool {
        match self.quantity {
            Quantity::Mass | Quantity::Inertia => true,
            Quantity::Effect(effect, _) => effect.spec().site == SiteKind::Link,
            _ => false,
        }
    }

    /// The links at its site; for quantities of joints, the links that these carry.
    pub fn links(&self) -> &[usize] {
        &self.links
    }

    /// All sites that its quantity may have: links, or the links that joints carry, with their names.
    pub fn sites<'r>(&self, robot: &'r Robot) -> Vec<(usize, &'r str)> {
        self.quantity.sites(robot).unwrap_or_default()
    }

    /// SI unit as text.
    pub fn unit(&self) -> &'static str {
        match self.quantity {
            Quantity::Mass => "kg",
            Quantity::Length | Quantity::Inertia | Quantity::Direction | Quantity::GroundFriction => "1",
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
            Quantity::Length | Quantity::Inertia | Quantity::Direction => Some(1.0),
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
            Quantity::Direction if value < 0.0 => self.links.iter().for_each(|&link| robot.reverse(link)),
            Quantity::Direction => {}
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
        let all = self.sites(robot);
        let names = all.into_iter().map(|(_, name)| name);
        let others: Vec<&str> =
            names.filter(|name| matches(&placed[index].site, name) && !matches(&self.site, name)).collect();
        if self.is_at(effect, &placed[index]) || others.is_empty() {
            return index;
        }
        let own = PlacedEffect { site: self.site.clone(), ..placed[index].clone() };
        placed[index].site = numbered(&others.join(","), instance(&self.site).1);
        placed.push(own);
        placed.len() - 1
    }

    /// The placed effect at exactly this site, or at several sites of which this is a part, as an index.
    fn covering(&self, effect: &dyn Effect, robot: &Robot, placed: &[PlacedEffect]) -> Option<usize> {
        let exactly = placed.iter().position(|p| self.is_at(effect, p));
        let here = |p: &PlacedEffect, link: &usize| {
            let all = self.sites(robot);
            all.iter().any(|(index, name)| index == link && matches(&p.site, name))
        };
        let covers = |p: &PlacedEffect| {
            let same = p.effect.spec().name == effect.spec().name && instance(&p.site).1 == instance(&self.site).1;
            same && !self.links.is_empty() && self.links.iter().all(|link| here(p, link))
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
