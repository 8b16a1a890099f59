//! Values that the model states and that may be wrong: those of its effects, masses, inertias, gains, friction and
//! geometry. Free parameters are not among them.

use super::parameters::{DIRECTION, WEAK, direction};
use crate::scales::RobotScales;
use btr_identify::residual_model::{FitParameter, Parametrisation};
use btr_physics::effects::{Effect, FORMULA, Param, PlacedEffect, SiteKind};
use btr_physics::model::Model;
use btr_physics::model::parameter::Target;
use btr_physics::robot::site::{instance, matches, numbered};
use btr_physics::robot::{Base, JointKind, Link, Robot};

/// A usual error of a factor, as a logarithm, and the factor within which a value is searched.
const FACTOR: (f64, f64) = (0.2, 8.0);
/// The same for a link's length.
const STRETCH: (f64, f64) = (0.05, 1.5);
/// A usual error of a value that may be zero, as a share of it or of the effect's typical size.
const SHARE: f64 = 0.3;
/// A usual displacement of a joint and the largest one, in lengths of links.
const DISPLACED: (f64, f64) = (0.05, 0.5);
/// A usual rotation of a joint's frame and the largest one, in rad.
const TILTED: (f64, f64) = (0.05, 0.5);
/// Step of finite differences, in usual errors.
const REACH: f64 = 0.1;

/// A value, or several that belong together.
pub(in crate::identification) struct StatedValue {
    /// The quantity, or the effect whose parameters these are.
    pub name: String,
    /// The joint or link, or the sites of the effect.
    pub site: String,
    /// What to set; one target per parameter.
    pub targets: Vec<Target>,
    /// From the model's values to others.
    pub parameters: Vec<FitParameter>,
}

/// Names of effects and values that most motions cannot distinguish from a wrong value.
pub(in crate::identification) fn similar_to_value(name: &str) -> &'static [&'static str] {
    if let Some(effect) = btr_physics::effects::find(name) {
        return effect.spec().similar;
    }
    match name {
        "mass" => &["payload", "com_offset", "length", "origin"],
        "inertia" => &["link_inertia", "armature"],
        "length" => &["payload", "com_offset", "origin"],
        "origin" => &["com_offset", "payload", "tilt"],
        "tilt" => &["encoder_offset", "com_offset", "gravity_tilt"],
        "kp" | "gain" => &["encoder_scale", "motor_lag"],
        "kd" => &["viscous_friction", "damping"],
        "damping" => &["viscous_friction", "kd"],
        "friction" => &["coulomb_friction", "stribeck_friction"],
        "max_torque" => &["torque_limit", "speed_torque_limit"],
        _ => &[],
    }
}

/// The values that a model states. There are none where small errors grow, as with contact: there a value can only be
/// fitted as a free parameter.
pub(in crate::identification) struct Catalogue<'a> {
    model: &'a Model,
    scales: &'a RobotScales,
}

impl<'a> Catalogue<'a> {
    /// The catalogue of a model; `None` where there is none.
    pub(in crate::identification) fn of(model: &'a Model, scales: &'a RobotScales) -> Option<Self> {
        let offered = model.robot.base == Base::Fixed && !model.has_contact();
        offered.then_some(Catalogue { model, scales })
    }

    /// The values of laws that the model has: its effects, and the friction of the robot's file.
    pub(in crate::identification) fn laws(&self) -> Vec<StatedValue> {
        let effects = self.model.effects.iter().flat_map(|placed| self.of_effect(placed));
        effects.chain(self.moving().flat_map(|link| self.friction(link))).collect()
    }

    /// The values of motors, links and joints.
    pub(in crate::identification) fn parts(&self) -> Vec<StatedValue> {
        let of = |link| [self.of_motor(link), self.of_link(link), self.of_geometry(link), self.of_direction(link)];
        self.moving().flat_map(of).flatten().collect()
    }

    fn moving(&self) -> impl Iterator<Item = &'a Link> {
        self.model.robot.movable().map(|(_, link)| link)
    }

    /// The parameters of an effect that the model has: as one for all its sites, and for each of several joints alone.
    fn of_effect(&self, placed: &PlacedEffect) -> Vec<StatedValue> {
        let spec = placed.effect.spec();
        if placed.is_off() || spec.name == FORMULA.name || self.frees(spec.name, &placed.site) {
            return Vec::new();
        }
        let joints = || self.model.robot.movable().map(|(_, link)| link.joint.name.clone());
        let single: Vec<String> = match spec.site {
            SiteKind::Joint => {
                let number = instance(&placed.site).1;
                joints().filter(|joint| matches(&placed.site, joint)).map(|joint| numbered(&joint, number)).collect()
            }
            _ => Vec::new(),
        };
        let apart = if single.len() > 1 { single } else { Vec::new() };
        let sites = std::iter::once(placed.site.clone()).chain(apart);
        sites.filter_map(|site| self.effect_at(placed.effect, &placed.values, site)).collect()
    }

    fn effect_at(&self, effect: &'static dyn Effect, values: &[f64], site: String) -> Option<StatedValue> {
        let spec = effect.spec();
        let (mut targets, mut parameters) = (Vec::new(), Vec::new());
        for (param, &value) in spec.params.iter().zip(values).filter(|(_, value)| value.is_finite()) {
            let scale = self.scales.of_unit(param.unit, &site);
            let target = self.target(&format!("{}.{}@{site}", spec.name, param.name))?;
            parameters.push(match param {
                p if (p.shape || !p.off.is_finite()) && value > 0.0 => by_factor(&target, value, FACTOR),
                p => linear(&target, value, p, scale),
            });
            targets.push(target);
        }
        (!targets.is_empty()).then(|| StatedValue { name: spec.name.to_owned(), site, targets, parameters })
    }

    /// Gains, limits and electrical constants of a joint's actuator.
    fn of_motor(&self, link: &Link) -> Vec<StatedValue> {
        let values = btr_physics::model::parameter::motor_values(&link.joint.actuator);
        let stated = values.filter(|(_, value)| *value > 0.0 && value.is_finite());
        stated.filter_map(|(name, value)| self.factor(name, &link.joint.name, value, FACTOR)).collect()
    }

    /// Friction as the robot's file states it.
    fn friction(&self, link: &Link) -> Vec<StatedValue> {
        let of = |name: &str, value: f64, effect: &str| {
            if value <= 0.0 || self.frees(name, &link.joint.name) {
                return None;
            }
            let site = link.joint.name.clone();
            let target = self.target(&format!("{name}@{site}"))?;
            let param = &btr_physics::effects::find(effect)?.spec().params[0];
            let parameters = vec![linear(&target, value, param, self.scales.of_unit(param.unit, &site))];
            Some(StatedValue { name: name.to_owned(), site, targets: vec![target], parameters })
        };
        let damping = of("damping", link.joint.damping, "viscous_friction");
        damping.into_iter().chain(of("friction", link.joint.dry_friction, "coulomb_friction")).collect()
    }

    /// Mass, inertia and length of a link.
    fn of_link(&self, link: &Link) -> Vec<StatedValue> {
        if link.mass_kg <= 0.0 {
            return Vec::new();
        }
        let factors = [("mass", link.mass_kg, FACTOR), ("inertia", 1.0, FACTOR), ("length", 1.0, STRETCH)];
        let of = |(name, value, range)| self.factor(name, &link.name, value, range);
        factors.into_iter().filter_map(of).collect()
    }

    /// Where a joint is mounted: displaced in its parent's axes, rotated about the axes across its own. The place of
    /// the first joint of a robot that is bolted to the world does not matter, and to rotate it is to tilt gravity.
    fn of_geometry(&self, link: &Link) -> Vec<StatedValue> {
        let robot = &self.model.robot;
        let (length, joint) = (typical_length(robot), &link.joint);
        let first = link.parent.is_none_or(|parent| is_fixed(robot, parent));
        let along = joint.axis.iamax();
        let displaced = ["origin_x", "origin_y", "origin_z"].into_iter().filter(|_| !first);
        let across = |(axis, _): &(usize, &str)| !first && *axis != along;
        let tilted = ["tilt_x", "tilt_y", "tilt_z"].into_iter().enumerate().filter(across);
        let of = |group: &str, names: Vec<&str>, (usual, most): (f64, f64)| {
            let free = names.iter().any(|name| self.frees(name, &joint.name));
            let targets: Vec<Target> =
                names.iter().filter_map(|name| self.target(&format!("{name}@{}", joint.name))).collect();
            let parameters =
                targets.iter().map(|target| parameter(target, 0.0, Parametrisation::Linear, usual, (-most, most)));
            let parameters: Vec<FitParameter> = parameters.collect();
            let value = StatedValue { name: group.to_owned(), site: joint.name.clone(), targets, parameters };
            (!free && !value.targets.is_empty()).then_some(value)
        };
        let displaced = of("origin", displaced.collect(), (DISPLACED.0 * length, DISPLACED.1 * length));
        let tilted = of("tilt", tilted.map(|(_, name)| name).collect(), TILTED);
        displaced.into_iter().chain(tilted).collect()
    }

    /// Which way a joint counts.
    fn of_direction(&self, link: &Link) -> Vec<StatedValue> {
        let site = link.joint.name.clone();
        let target = self.target(&format!("{DIRECTION}@{site}")).filter(|_| !self.frees(DIRECTION, &site));
        let of = |target: Target| {
            let parameters = vec![direction(target.name().to_owned(), 1.0)];
            StatedValue { name: DIRECTION.to_owned(), site, targets: vec![target], parameters }
        };
        target.map(of).into_iter().collect()
    }

    /// A positive value that may be wrong by a factor.
    fn factor(&self, name: &str, site: &str, value: f64, range: (f64, f64)) -> Option<StatedValue> {
        if self.frees(name, site) {
            return None;
        }
        let target = self.target(&format!("{name}@{site}"))?;
        let parameters = vec![by_factor(&target, value, range)];
        Some(StatedValue { name: name.to_owned(), site: site.to_owned(), targets: vec![target], parameters })
    }

    /// The target of a name; `None` for a quantity that the site does not have, such as the length of a ball.
    fn target(&self, name: &str) -> Option<Target> {
        Target::parse(name, &self.model.robot).ok()
    }

    /// Whether a quantity, or a parameter of an effect, is free at a site or at a part of it.
    fn frees(&self, name: &str, site: &str) -> bool {
        let robot = &self.model.robot;
        let joints = robot.movable().map(|(_, link)| link.joint.name.as_str());
        let names: Vec<&str> = joints.chain(robot.links.iter().map(|link| link.name.as_str())).collect();
        self.model.simulations.dims().iter().any(|dim| {
            let (what, at) = dim.name.split_once('@').unwrap_or((&dim.name, "*"));
            let same = what == name || what.split_once('.').is_some_and(|(effect, _)| effect == name);
            same && instance(at).1 == instance(site).1
                && names.iter().any(|name| matches(at, name) && matches(site, name))
        })
    }
}

/// Whether nothing moves a link.
fn is_fixed(robot: &Robot, link: usize) -> bool {
    let link = &robot.links[link];
    link.parent.is_none_or(|parent| link.joint.kind == JointKind::Fixed && is_fixed(robot, parent))
}

/// The mean distance of joints from their parents', in m.
fn typical_length(robot: &Robot) -> f64 {
    let distances = robot.links.iter().skip(1).map(|link| link.joint.origin.translation.vector.norm());
    let (sum, count) = distances.filter(|d| *d > 0.0).fold((0.0, 0.0), |(sum, n), d| (sum + d, n + 1.0));
    if count > 0.0 { sum / count } else { 0.1 }
}

fn by_factor(target: &Target, value: f64, (usual, most): (f64, f64)) -> FitParameter {
    parameter(target, value, Parametrisation::Exponential, usual, (value / most, value * most))
}

/// A value that may be zero, with the bounds of an effect's parameter.
fn linear(target: &Target, value: f64, param: &Param, scale: f64) -> FitParameter {
    let size = SHARE * value.abs().max(param.hint.abs() * scale);
    let bounds = (param.bounds.0.min(0.0) * scale, param.bounds.1 * scale);
    parameter(target, value, Parametrisation::Linear, size, (bounds.0.min(value), bounds.1.max(value)))
}

/// A parameter of a stated value, between two values.
fn parameter(target: &Target, value: f64, law: Parametrisation, size: f64, bounds: (f64, f64)) -> FitParameter {
    let (name, unit) = (target.name().to_owned(), target.unit().to_owned());
    let parameter = FitParameter {
        name,
        unit,
        origin: value,
        size,
        law,
        bounds: (0.0, 0.0),
        spread: WEAK,
        known: None,
        reach: REACH,
        amplitude: true,
    };
    FitParameter { bounds: (parameter.coordinate(bounds.0), parameter.coordinate(bounds.1)), ..parameter }
}
