//! What is known of each joint and link, in the terms that other simulators share.

use super::request::Request;
use btr_physics::effects::{PlacedEffect, UNKNOWN_ROTOR, find, rank};
use btr_physics::engine::carried_inertia;
use btr_physics::model::Outline;
use btr_physics::robot::{Actuator, Joint, JointKind, Link, Robot};
use nalgebra::{Matrix3, Vector3};

/// A joint's known values, in SI units. What a format cannot express stays in `left`.
#[derive(Clone, Debug)]
pub(super) struct JointFacts {
    pub(super) name: String,
    pub(super) is_hinge: bool,
    /// Range; infinite where unlimited.
    pub(super) limits: (f64, f64),
    /// Infinite where unlimited.
    pub(super) speed_limit: f64,
    /// Infinite where unlimited.
    pub(super) torque_limit: f64,
    pub(super) armature: f64,
    /// Inertia of a rotor behind a transmission that is not rigid, where no armature states it.
    pub(super) unknown_rotor: f64,
    pub(super) viscous: f64,
    pub(super) coulomb: f64,
    /// Friction at rest, at least Coulomb's.
    pub(super) static_friction: f64,
    pub(super) stiffness: f64,
    /// Where the spring is at rest.
    pub(super) rest: f64,
    /// Proportional and derivative gain of a position servo.
    pub(super) gains: Option<(f64, f64)>,
    /// Whether a motor drives the joint whose torque the model could limit.
    pub(super) has_motor: bool,
    /// Whether the model says what drives the joint, if it is no position servo.
    pub(super) is_driven_otherwise: bool,
    /// Dead time of the command, in s.
    pub(super) delay_s: f64,
    /// The effects that are in none of these.
    pub(super) left: Vec<PlacedEffect>,
}

/// The joints of a model.
pub(super) fn joints(outline: &Outline) -> Vec<JointFacts> {
    let links = outline.robot.movable().map(|(_, link)| link).zip(carried_inertia(&outline.robot));
    let all = links.zip(&outline.joints);
    all.map(|((link, carried), effects)| JointFacts::of(&link.joint, carried, effects)).collect()
}

/// What is said of a file without any of the joints.
pub(super) fn none_of(joints: &[JointFacts]) -> String {
    let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
    format!(
        "it has none of the model's joints ({}): it is another robot's, or they are in a file that it includes",
        names.join(", ")
    )
}

impl JointFacts {
    fn of(joint: &Joint, carried_inertia: f64, effects: &[PlacedEffect]) -> Self {
        let (gains, torque_limit) = match joint.actuator {
            Actuator::Position { kp, kd, max_torque, .. } => (Some((kp, kd)), max_torque),
            Actuator::Torque { max_torque } => (None, max_torque),
            Actuator::Passive | Actuator::Voltage { .. } | Actuator::Prescribed => (None, f64::INFINITY),
        };
        let mut facts = JointFacts {
            name: joint.name.clone(),
            is_hinge: joint.kind == JointKind::Revolute,
            limits: joint.limits,
            speed_limit: joint.speed_limit,
            torque_limit,
            armature: joint.armature,
            unknown_rotor: UNKNOWN_ROTOR * carried_inertia,
            viscous: joint.damping,
            coulomb: joint.dry_friction,
            static_friction: joint.dry_friction,
            stiffness: 0.0,
            rest: 0.0,
            gains,
            has_motor: matches!(joint.actuator, Actuator::Position { .. } | Actuator::Torque { .. }),
            is_driven_otherwise: matches!(joint.actuator, Actuator::Torque { .. } | Actuator::Passive),
            delay_s: 0.0,
            left: Vec::new(),
        };
        effects.iter().for_each(|placed| facts.take(placed));
        facts
    }

    /// Whether dry friction holds the joint at rest, without creep.
    pub(super) fn rests_by_friction(&self) -> bool {
        let has = |name: &str| self.left.iter().any(|placed| placed.effect.spec().name == name);
        let further = ["stribeck_friction", "load_dependent_friction", "asymmetric_friction"];
        (self.coulomb != 0.0 || further.into_iter().any(has)) && !has("friction_creep")
    }

    /// How dry friction gives way, for a format that can express it: its creep, in rad/(s·N·m), and its time constant.
    pub(super) fn take_creep(&mut self) -> Option<(f64, f64)> {
        let at = self.left.iter().position(|placed| placed.effect.spec().name == "friction_creep")?;
        let [creep, time_s] = self.left.remove(at).values[..] else { return None };
        Some((creep, time_s))
    }

    /// The dry friction that stands for one that bends first.
    pub(super) fn presliding(&self) -> Option<f64> {
        let placed = self.left.iter().find(|placed| placed.effect.spec().name == "presliding_friction")?;
        placed.values.first().copied()
    }

    /// Counts the dead time of the command as left.
    pub(super) fn leave_delay(&mut self) {
        self.leave("command_delay", [self.delay_s]);
    }

    /// Counts the spring as left.
    pub(super) fn leave_spring(&mut self) {
        if self.stiffness != 0.0 {
            self.leave("parallel_spring", [self.stiffness, self.rest]);
        }
    }

    /// Counts rotor, spring and dead time as left.
    pub(super) fn leave_dynamics(&mut self) {
        self.leave("armature", [self.armature]);
        self.leave_spring();
        self.leave_delay();
    }

    /// Counts viscous and dry friction as left.
    pub(super) fn leave_friction(&mut self) {
        self.leave("viscous_friction", [self.viscous]);
        self.leave("coulomb_friction", [self.coulomb]);
    }

    /// Counts an effect as left, unless it is off.
    fn leave<const N: usize>(&mut self, name: &str, values: [f64; N]) {
        let effect = find(name).filter(|_| values.iter().any(|value| *value != 0.0));
        let placed = |effect| PlacedEffect { effect, site: self.name.clone(), values: values.to_vec() };
        self.left.extend(effect.map(placed));
        // A dead band compares a late command with the joint.
        self.left.sort_by_key(rank);
    }

    /// Takes an effect into the values.
    fn take(&mut self, placed: &PlacedEffect) {
        match (placed.effect.spec().name, placed.values.as_slice()) {
            ("armature", [inertia]) => self.armature += inertia,
            ("viscous_friction", [coefficient]) => self.viscous += coefficient,
            ("coulomb_friction", [torque]) => {
                self.coulomb += torque;
                self.static_friction += torque;
            }
            ("stribeck_friction", [coulomb, at_rest, _]) => {
                self.coulomb += coulomb;
                self.static_friction += at_rest;
                self.left.push(placed.clone());
            }
            // Without its bending, it is dry friction.
            ("presliding_friction", [torque, _]) => {
                self.coulomb += torque;
                self.static_friction += torque;
                self.left.push(placed.clone());
            }
            ("parallel_spring", [stiffness, rest]) if self.stiffness == 0.0 => {
                (self.stiffness, self.rest) = (*stiffness, *rest);
            }
            ("torque_limit", [torque]) => self.torque_limit = self.torque_limit.min(*torque),
            ("command_delay", [delay]) => self.delay_s += delay,
            _ => self.left.push(placed.clone()),
        }
    }
}

/// The links whose inertia the model changes, against the robot's file: it states them, or it has come to others.
pub(super) fn changed_links<'a>(request: &'a Request) -> impl Iterator<Item = &'a Link> {
    let original = &request.model.robot;
    request.outline.robot.links.iter().filter(|link| {
        let same = |known: &&Link| {
            known.name == link.name
                && known.mass_kg.to_bits() == link.mass_kg.to_bits()
                && known.com_m == link.com_m
                && known.inertia_kg_m2 == link.inertia_kg_m2
        };
        request.stated_links.contains(&link.name) || !original.links.iter().any(|known| same(&known))
    })
}

/// The links of a file that changed links are part of, each with what is fused with it: MuJoCo's compiler fuses links
/// that are fixed to each other when it reads a URDF, and the file then has one body for them. `has` says whether the
/// file has a link.
pub(super) fn changed_bodies(request: &Request, has: impl Fn(&str) -> bool) -> Vec<Link> {
    let robot = &request.outline.robot;
    let mut bodies: Vec<usize> = changed_links(request)
        .filter_map(|changed| {
            let mut at = robot.links.iter().position(|link| link.name == changed.name)?;
            while let Some(parent) = robot.links[at].parent.filter(|_| is_fused(&robot.links[at], &has)) {
                at = parent;
            }
            Some(at)
        })
        .collect();
    bodies.sort_unstable();
    bodies.dedup();
    bodies.into_iter().map(|at| fused(robot, at, &has)).collect()
}

/// Whether a link is part of the one that it is fixed to.
fn is_fused(link: &Link, has: &impl Fn(&str) -> bool) -> bool {
    link.joint.kind == JointKind::Fixed && !has(&link.name)
}

/// A link with the links that are fused with it.
fn fused(robot: &Robot, at: usize, has: &impl Fn(&str) -> bool) -> Link {
    let is_part = |(_, link): &(usize, &Link)| link.parent == Some(at) && is_fused(link, has);
    let parts = robot.links.iter().enumerate().filter(is_part).map(|(part, _)| fused(robot, part, has));
    parts.fold(robot.links[at].clone(), |whole, part| {
        let pose = part.joint.origin;
        let turned = pose.rotation.to_rotation_matrix();
        let (of_whole, of_part) = (whole.com_m.coords, (pose * part.com_m).coords);
        let mass_kg = whole.mass_kg + part.mass_kg;
        if mass_kg <= 0.0 {
            return whole;
        }
        let com = (of_whole * whole.mass_kg + of_part * part.mass_kg) / mass_kg;
        // Steiner's theorem.
        let about = |mass: f64, of: Vector3<f64>| {
            let arm = of - com;
            (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass
        };
        let inertia_kg_m2 = whole.inertia_kg_m2
            + turned.matrix() * part.inertia_kg_m2 * turned.matrix().transpose()
            + about(whole.mass_kg, of_whole)
            + about(part.mass_kg, of_part);
        Link { mass_kg, com_m: com.into(), inertia_kg_m2, ..whole }
    })
}

/// The joints that the model has moved or turned against the robot's file, a line each: no format carries that.
pub(super) fn moved_joints<'a>(outline: &'a Outline, original: &'a Robot) -> impl Iterator<Item = String> + 'a {
    let is_as_it_was = |joint: &Joint| {
        let same = |known: &Joint| known.name == joint.name && known.origin == joint.origin && known.axis == joint.axis;
        original.links.iter().any(|link| same(&link.joint))
    };
    let moved = outline.robot.movable().map(|(_, link)| &link.joint).filter(move |joint| !is_as_it_was(joint));
    moved.map(|joint| format!("{}: where the joint is, or its axis", joint.name))
}

/// The first joint that counts the other way round than the robot's file says.
pub(super) fn reversed_joint<'a>(outline: &'a Outline, original: &Robot) -> Option<&'a str> {
    let is_reversed = |joint: &&Joint| {
        original.links.iter().any(|link| link.joint.name == joint.name && link.joint.axis.dot(&joint.axis) < 0.0)
    };
    outline.robot.movable().map(|(_, link)| &link.joint).find(is_reversed).map(|joint| joint.name.as_str())
}

/// What the model says of motors and no format carries, a line each.
pub(super) fn motors(outline: &Outline) -> Vec<String> {
    let of_joint = |joint: &Joint| {
        let motor = match &joint.actuator {
            Actuator::Position { ki, .. } if *ki != 0.0 => Some(format!("the integral gain of its servo, {ki:.4}")),
            Actuator::Voltage { .. } => Some("its motor, which is driven by a voltage".to_owned()),
            _ => None,
        };
        let sampling = joint.sampling.map(|sampling| format!("its servo samples every {:.4} s", sampling.period_s));
        motor.into_iter().chain(sampling).map(|what| format!("{}: {what}", joint.name)).collect::<Vec<_>>()
    };
    outline.robot.movable().flat_map(|(_, link)| of_joint(&link.joint)).collect()
}
