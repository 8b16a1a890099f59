//! The standard dynamic parameters of a robot: the ten inertial parameters of every moving body, and rotor, friction
//! and offset of every joint. The torques that a motion requires are linear in them, so a unit of one more on a link or
//! in a joint gives its column of the regressor, whatever else is in the model.

use super::{Inertials, PER_BODY};
use crate::effects::{Effect, EffectSpec, Param, PlacedEffect, SiteKind};
use crate::engine::Dof;
use crate::engine::assemble::{MovingBody, bodies};
use crate::robot::{Joint, JointKind, Link, Robot};

/// Number of standard parameters of a joint: viscous friction, Coulomb friction, offset, rotor.
pub const PER_JOINT: usize = 4;

/// A standard dynamic parameter.
#[derive(Clone, Debug)]
pub struct StandardParameter {
    /// `mass@LINK`, `mass*com_x@LINK`, `inertia_xx@LINK`, about the origin of the link's frame and with all links that
    /// are fixed to it; `viscous@JOINT`, `coulomb@JOINT`, `offset@JOINT`, `rotor@JOINT`.
    pub name: String,
    /// SI unit as text.
    pub unit: &'static str,
    /// What it is.
    pub kind: StandardKind,
    /// Which moving body, counted from the base, or the body that its joint moves.
    pub body: usize,
    one_more: PlacedEffect,
}

/// Kinds of standard parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandardKind {
    /// Mass of a body.
    Mass,
    /// First moment or inertia of a body.
    Moment,
    /// Inertia of a rotor, seen at its joint.
    Rotor,
    /// Viscous or Coulomb friction: not negative.
    Friction,
    /// A constant torque.
    Offset,
}

impl StandardParameter {
    /// What adds one unit of it to a model.
    pub fn one_more(&self) -> &PlacedEffect {
        &self.one_more
    }
}

/// The standard parameters of a robot: for each moving body its ten in the order of [`Inertials::to_array`], then for
/// each joint viscous friction, Coulomb friction, offset and rotor.
pub fn standard_parameters(robot: &Robot) -> Vec<StandardParameter> {
    let bodies = bodies(robot);
    let moving = || bodies.iter().enumerate().skip(1);
    let of_links = moving().flat_map(|(i, body)| of_body(i, &robot.links[body.link].name));
    of_links.chain(moving().flat_map(|(i, body)| of_joint(i, &robot.links[body.link].joint))).collect()
}

fn of_body(body: usize, link: &str) -> impl Iterator<Item = StandardParameter> {
    let parameter = |k: usize| {
        let (what, unit) = BODY[k];
        let kind = if k == 0 { StandardKind::Mass } else { StandardKind::Moment };
        let one_more = one_of(&MoreInertials, link, k);
        StandardParameter { name: format!("{what}@{link}"), unit, kind, body, one_more }
    };
    (0..PER_BODY).map(parameter).collect::<Vec<_>>().into_iter()
}

fn of_joint(body: usize, joint: &Joint) -> impl Iterator<Item = StandardParameter> {
    let slides = joint.kind == JointKind::Prismatic;
    let parameter = |k: usize| {
        let (what, kind, units) = JOINT[k];
        let (name, one_more) = (format!("{what}@{}", joint.name), one_of(&MoreInJoint, &joint.name, k));
        StandardParameter { name, unit: units[usize::from(slides)], kind, body, one_more }
    };
    (0..PER_JOINT).map(parameter).collect::<Vec<_>>().into_iter()
}

fn one_of(effect: &'static dyn Effect, site: &str, k: usize) -> PlacedEffect {
    let mut placed = PlacedEffect::off(effect, site);
    placed.values[k] = 1.0;
    placed
}

/// A moving body by its names.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyNames {
    /// The link whose frame is the body's.
    pub link: String,
    /// The joint that moves it.
    pub joint: String,
    /// Further links, which are fixed to it.
    pub fixed: Vec<String>,
}

/// The moving bodies of a robot, in the order of their parameters.
pub fn moving_bodies(robot: &Robot) -> Vec<BodyNames> {
    let first = |mut link: usize| {
        while let Some(parent) = robot.links[link].parent.filter(|_| robot.links[link].joint.kind == JointKind::Fixed) {
            link = parent;
        }
        link
    };
    let names = |(index, link): (usize, &Link)| {
        let fixed = robot.links.iter().enumerate().filter(|(other, _)| *other != index && first(*other) == index);
        let fixed = fixed.map(|(_, other)| other.name.clone()).collect();
        BodyNames { link: link.name.clone(), joint: link.joint.name.clone(), fixed }
    };
    robot.movable().map(names).collect()
}

/// A mass on each moving link that has none: without a mass, a first moment has no place.
pub(crate) fn where_massless(robot: &Robot) -> Vec<PlacedEffect> {
    let links = robot.movable().filter(|(_, link)| link.mass_kg <= 0.0);
    links.map(|(_, link)| one_of(&MoreInertials, &link.name, 0)).collect()
}

/// The inertial parameters of a moving body.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MovingInertials {
    /// Index of its first link, in whose frame they are.
    pub(crate) link: usize,
    pub(crate) inertials: Inertials,
}

impl From<&MovingBody> for MovingInertials {
    fn from(body: &MovingBody) -> Self {
        let inertials = Inertials::of(body.mass_kg, &body.com_m, &body.inertia_kg_m2);
        MovingInertials { link: body.link, inertials }
    }
}

/// Names and units of a body's parameters.
const BODY: [(&str, &str); PER_BODY] = [
    ("mass", "kg"),
    ("mass*com_x", "kg·m"),
    ("mass*com_y", "kg·m"),
    ("mass*com_z", "kg·m"),
    ("inertia_xx", "kg·m^2"),
    ("inertia_yy", "kg·m^2"),
    ("inertia_zz", "kg·m^2"),
    ("inertia_xy", "kg·m^2"),
    ("inertia_xz", "kg·m^2"),
    ("inertia_yz", "kg·m^2"),
];

/// Names, kinds and units of a joint's parameters; of a hinge and of a slide.
const JOINT: [(&str, StandardKind, [&str; 2]); PER_JOINT] = [
    ("viscous", StandardKind::Friction, ["N·m·s/rad", "N·s/m"]),
    ("coulomb", StandardKind::Friction, ["N·m", "N"]),
    ("offset", StandardKind::Offset, ["N·m", "N"]),
    ("rotor", StandardKind::Rotor, ["kg·m^2", "kg"]),
];

/// Any number, of either sign.
const fn any(name: &'static str, unit: &'static str) -> Param {
    Param::new(name, unit, (-1e9, 1e9), 1.0)
}

const fn spec(name: &'static str, site: SiteKind, law: &'static str, params: &'static [Param]) -> EffectSpec {
    let (cite, symptom) = ("Newton and Euler", "");
    EffectSpec { name, law, site, cite, symptom, params, starts: &[], similar: &[], nested: &[] }
}

/// Changes the inertial parameters of a link. No effect of the library: its result need not be a possible body.
struct MoreInertials;

static MORE_INERTIALS: EffectSpec = spec(
    "more_inertials",
    SiteKind::Link,
    "adds to the link's mass, first moments and inertia about its frame's origin",
    &[
        any(BODY[0].0, BODY[0].1),
        any(BODY[1].0, BODY[1].1),
        any(BODY[2].0, BODY[2].1),
        any(BODY[3].0, BODY[3].1),
        any(BODY[4].0, BODY[4].1),
        any(BODY[5].0, BODY[5].1),
        any(BODY[6].0, BODY[6].1),
        any(BODY[7].0, BODY[7].1),
        any(BODY[8].0, BODY[8].1),
        any(BODY[9].0, BODY[9].1),
    ],
);

impl Effect for MoreInertials {
    fn spec(&self) -> &'static EffectSpec {
        &MORE_INERTIALS
    }

    fn link(&self, p: &[f64], robot: &mut Robot, link: usize) {
        let own = robot.links[link].inertials().to_array();
        let sum = std::array::from_fn(|k| own[k] + p[k]);
        robot.links[link].set_inertials(&Inertials::from_array(sum));
    }
}

/// Changes friction, offset and rotor of a joint, in the same way.
struct MoreInJoint;

static MORE_IN_JOINT: EffectSpec = spec(
    "more_in_joint",
    SiteKind::Joint,
    "adds to the joint's viscous friction, Coulomb friction, offset and rotor",
    &[
        any(JOINT[0].0, JOINT[0].2[0]),
        any(JOINT[1].0, JOINT[1].2[0]),
        any(JOINT[2].0, JOINT[2].2[0]),
        any(JOINT[3].0, JOINT[3].2[0]),
    ],
);

impl Effect for MoreInJoint {
    fn spec(&self) -> &'static EffectSpec {
        &MORE_IN_JOINT
    }

    fn joint(&self, p: &[f64], dof: &mut Dof) {
        dof.torque.damping += p[0];
        dof.dry_friction += p[1];
        // The motor has to deliver it.
        dof.torque.constant -= p[2];
        dof.armature += p[3];
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::presets::nao::nao;

    /// A unit of one parameter is a unit of that one and of no other, whatever is fixed to the link.
    #[test]
    fn one_more_adds_one_to_its_own_parameter_alone() {
        let robot = nao();
        let values = |robot: &Robot| -> Vec<f64> {
            let all = bodies(robot);
            all.iter().skip(1).flat_map(|body| MovingInertials::from(body).inertials.to_array()).collect()
        };
        let (before, parameters) = (values(&robot), standard_parameters(&robot));
        let of_bodies = parameters.iter().filter(|p| matches!(p.kind, StandardKind::Mass | StandardKind::Moment));
        for (k, parameter) in of_bodies.enumerate() {
            let mut changed = robot.clone();
            let placed = parameter.one_more();
            let links = placed.links(&robot).unwrap();
            links.iter().for_each(|link| placed.effect.link(&placed.values, &mut changed, *link));
            for (i, (after, before)) in values(&changed).iter().zip(&before).enumerate() {
                let grown = f64::from(u8::from(i == k));
                assert!((after - before - grown).abs() < 1e-9, "{}: {i}", parameter.name);
            }
        }
        assert_eq!(parameters.len(), robot.movable().count() * (PER_BODY + PER_JOINT));
        let names = moving_bodies(&robot);
        assert_eq!(names.iter().map(|body| 1 + body.fixed.len()).sum::<usize>() + 1, robot.links.len());
    }
}
