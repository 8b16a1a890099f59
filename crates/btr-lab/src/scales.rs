//! Typical magnitudes of a robot. The hints of the effect specs are for a desk arm and must be scaled: the friction of
//! a crane is not that of a finger.

use btr_core::log::Log;
use btr_core::signal::smooth::smooth;
use btr_core::world::{Simulator, WorldError};
use btr_physics::engine::turned_inertia;
use btr_physics::model::Model;
use btr_physics::robot::site::instance;
use btr_physics::robot::{JointKind, Robot};

/// The desk arm to which the hints of the effect specs refer.
const DESK: JointScale =
    JointScale { torque: 1.0, speed: 3.0, top_speed: None, inertia: 0.02, rotor: 0.0, mass: 0.5, length: 0.2 };

/// Largest share of a joint's measured torque that accelerates its rotor, where the motion is prescribed.
const OF_ROTOR: f64 = 2.0;

/// Standard gravity, in m/s².
const G: f64 = 9.81;

/// Typical magnitudes of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
struct JointScale {
    /// Root mean square of the motor's torque, in N·m (N).
    torque: f64,
    /// Largest usual speed, in rad/s (m/s).
    speed: f64,
    /// The largest measured speed, in rad/s (m/s), where positions are measured.
    top_speed: Option<f64>,
    /// Inertia that the joint turns, in kg·m² (kg).
    inertia: f64,
    /// Largest inertia that the measured torques allow for the motor of a prescribed joint, in kg·m² (kg); 0 where
    /// nothing is measured.
    rotor: f64,
    /// The carried link's mass in kg.
    mass: f64,
    /// How far the link reaches from the joint, in m.
    length: f64,
}

/// The scales of all joints, and the largest ones for all other sites.
#[derive(Clone)]
pub(crate) struct RobotScales {
    joints: Vec<(String, String, JointScale)>,
    whole: JointScale,
}

impl RobotScales {
    /// Scales from simulations of the logs with the model at its current values. What a model without friction requires
    /// of a wrist whose motion is prescribed says little; what its motor gave was measured.
    pub(crate) fn of(model: &Model, recorded: &[Log]) -> Result<Self, WorldError> {
        let nominal = model.simulations().nominal();
        let simulated = (0..model.learn.min(recorded.len())).map(|log| model.simulate(model.request(&nominal, log)));
        let mut simulated = simulated.collect::<Result<Vec<Log>, _>>()?;
        for (simulated, recorded) in simulated.iter_mut().zip(recorded) {
            for joint in model.robot.prescribed() {
                let name = joint.compared();
                let Some(measured) = recorded.channel(&name) else { continue };
                let Some(required) = simulated.values_mut(&name) else { continue };
                let (measured, model) = (rms(&measured.values), rms(required));
                if model > 0.0 && measured > model {
                    required.iter_mut().for_each(|torque| *torque *= measured / model);
                }
            }
        }
        let mut scales = RobotScales::seen(&model.robot, &simulated)?;
        for joint in model.robot.prescribed() {
            let ratios = simulated.iter().filter_map(|log| torque_by_acceleration(log, &joint.name));
            let most = OF_ROTOR * ratios.fold(0.0, f64::max);
            let own = scales.joints.iter_mut().filter(|(name, _, _)| *name == joint.name);
            own.for_each(|(_, _, scale)| scale.rotor = most);
        }
        for (joint, _, scale) in &mut scales.joints {
            scale.top_speed =
                recorded[..simulated.len()].iter().filter_map(|log| top_speed(log, joint)).reduce(f64::max);
        }
        scales.whole.top_speed = scales.joints.iter().filter_map(|(_, _, scale)| scale.top_speed).reduce(f64::max);
        Ok(scales)
    }

    /// The largest measured speed at a site, in rad/s (m/s).
    pub(crate) fn top_speed(&self, site: &str) -> Option<f64> {
        self.of_joint(site).top_speed
    }

    /// Scales from the motions and torques of simulated logs.
    pub(crate) fn seen(robot: &Robot, simulated: &[Log]) -> Result<Self, WorldError> {
        let turned = turned_inertia(robot);
        let mut joints: Vec<(String, String, JointScale)> = robot
            .movable()
            .zip(turned)
            .map(|((index, link), inertia)| {
                let length = robot.extent_m(index);
                let (torque, speed, rotor) = (0.0, 0.0, 0.0);
                let scale = JointScale { torque, speed, top_speed: None, inertia, rotor, mass: link.mass_kg, length };
                (link.joint.name.clone(), link.name.clone(), scale)
            })
            .collect();
        for simulated in simulated {
            for (joint, _, scale) in &mut joints {
                scale.torque = scale.torque.max(rms(simulated.values(&format!("tau_{joint}"))?));
                scale.speed = scale.speed.max(3.0 * rms(simulated.values(&format!("dq_{joint}"))?));
            }
        }
        let largest = |of: fn(&JointScale) -> f64| joints.iter().map(|(_, _, scale)| of(scale)).fold(0.0, f64::max);
        let whole = JointScale {
            torque: largest(|s| s.torque),
            speed: largest(|s| s.speed),
            top_speed: None,
            inertia: largest(|s| s.inertia),
            rotor: 0.0,
            mass: largest(|s| s.mass),
            length: largest(|s| s.length),
        };
        // A joint that does not move gets a share of the others' scale, or the desk arm's. A wrist's torque may well be
        // a hundredth of the shoulder's.
        let or = |x: f64, other: f64, desk: f64| [x, 0.1 * other, desk].into_iter().find(|v| *v > 0.0).unwrap_or(desk);
        for (_, _, scale) in &mut joints {
            scale.torque = or(scale.torque.max(0.01 * whole.torque), whole.torque, DESK.torque);
            scale.speed = or(scale.speed.max(0.1 * whole.speed), whole.speed, DESK.speed);
            scale.mass = or(scale.mass, whole.mass, DESK.mass);
            scale.inertia = or(scale.inertia, whole.inertia, DESK.inertia);
            scale.length = or(scale.length, whole.length, DESK.length);
        }
        Ok(RobotScales { joints, whole })
    }

    /// Estimate from the robot alone, without a motion: motors carry its weight, at a desk arm's speed.
    pub(crate) fn guess(robot: &Robot) -> Self {
        let turned = turned_inertia(robot);
        let mass = robot.mass_kg();
        let scale = |link: usize, inertia: f64| {
            let slides = robot.links[link].joint.kind == JointKind::Prismatic;
            let arm = if slides { 1.0 } else { (inertia / mass).sqrt() };
            let (torque, length) = (mass * G * arm, robot.extent_m(link));
            JointScale { torque, inertia, mass, length, ..DESK }
        };
        let joints: Vec<_> = robot
            .movable()
            .zip(turned)
            .map(|((index, link), inertia)| (link.joint.name.clone(), link.name.clone(), scale(index, inertia)))
            .collect();
        let whole = joints.iter().map(|(_, _, scale)| *scale).max_by(|a, b| a.torque.total_cmp(&b.torque));
        RobotScales { joints, whole: whole.unwrap_or(DESK) }
    }

    /// Factor for the bounds of a parameter in this unit at a site. The mass of a payload is bounded by what the robot
    /// is made to carry, not by the link that carries it: a flange is light. Nor is the inertia of its geared motor,
    /// which the measured torques bound where the motion is prescribed. Drag is not bounded by how fast the model
    /// moves: a robot whose commands are limited in their rate is slower.
    pub(crate) fn of_bounds(&self, unit: &str, site: &str) -> f64 {
        let of_hint = self.of_unit(unit, site);
        match unit {
            "kg" => of_hint.max(self.whole.mass / DESK.mass),
            // Bounds of inertias are for 1 kg·m².
            "kg·m²" | "kg·m^2" => of_hint.max(self.of_joint(site).rotor),
            "N·m·s²/rad²" | "N·m·s^2/rad^2" => of_hint.max(self.of_unit("N·m", site)),
            _ => of_hint,
        }
    }

    fn of_joint(&self, site: &str) -> &JointScale {
        let (name, _) = instance(site);
        let joint = self.joints.iter().find(|(joint, link, _)| joint == name || link == name);
        joint.map_or(&self.whole, |(_, _, scale)| scale)
    }

    /// Factor for a hint in this unit at a site.
    pub(crate) fn of_unit(&self, unit: &str, site: &str) -> f64 {
        let scale = self.of_joint(site);
        let (torque, speed) = (scale.torque / DESK.torque, scale.speed / DESK.speed);
        let factor = match unit {
            "N·m" | "N" | "N·m/rad" => torque,
            "N·m·s/rad" => torque / speed,
            "N·m·s²/rad²" | "N·m·s^2/rad^2" => torque / (speed * speed),
            "1/(N·m)" => 1.0 / torque,
            "rad/(s·N·m)" => DESK.inertia / scale.inertia,
            "1/J" => 1.0 / (torque * speed),
            "rad/s" => speed,
            "kg·m²" | "kg·m^2" => scale.inertia / DESK.inertia,
            "kg" => scale.mass / DESK.mass,
            "m" => scale.length / DESK.length,
            _ => 1.0,
        };
        if factor.is_finite() && factor > 0.0 { factor } else { 1.0 }
    }
}

/// Root mean square of a joint's torque over that of its acceleration; `None` without both.
fn torque_by_acceleration(log: &Log, joint: &str) -> Option<f64> {
    let speed = &log.channel(&format!("dq_{joint}"))?.values;
    let steps = log.clock_s().windows(2).zip(speed.windows(2));
    let accelerations: Vec<f64> = steps.map(|(t, dq)| (dq[1] - dq[0]) / (t[1] - t[0])).collect();
    let ratio = rms(&log.channel(&format!("tau_{joint}"))?.values) / rms(&accelerations);
    ratio.is_finite().then_some(ratio)
}

/// The largest speed of a joint in a log, by its smoothed position; `None` where that is not recorded.
fn top_speed(log: &Log, joint: &str) -> Option<f64> {
    let position = log.channel(&format!("q_{joint}"))?;
    let speeds = smooth(log.clock_s(), &position.values).into_iter().map(|motion| motion.velocity.abs());
    speeds.filter(|speed| speed.is_finite()).reduce(f64::max).filter(|top| *top > 0.0)
}

fn rms(values: &[f64]) -> f64 {
    let finite = || values.iter().filter(|x| x.is_finite());
    (finite().map(|x| x * x).sum::<f64>() / finite().count().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use btr_core::log::Role;

    #[test]
    fn drag_is_scaled_as_torque_over_squared_speed() {
        let whole = JointScale { torque: 2.0, speed: 12.0, ..DESK };
        let scales = RobotScales { joints: Vec::new(), whole };
        let drag = btr_physics::effects::find("quadratic_drag").unwrap().spec();
        assert!((scales.of_unit(drag.params[0].unit, "*") - 2.0 / 16.0).abs() < 1e-12);
        // A model may move faster than the robot, but hardly with more torque.
        assert!((scales.of_bounds(drag.params[0].unit, "*") - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_wrist_is_not_measured_by_the_shoulder() {
        let robot = btr_physics::presets::pendulum::pendulum(1.0, 0.5, btr_physics::robot::Actuator::Passive);
        let mut arm = robot.clone();
        let mut wrist = robot.links[1].clone();
        (wrist.name, wrist.joint.name, wrist.parent) = ("hand".to_owned(), "wrist".to_owned(), Some(1));
        arm.links.push(wrist);
        let mut log = Log::new(vec![0.0, 0.1]).unwrap();
        for (joint, torque) in [("hinge", 10.0), ("wrist", 0.2)] {
            for (channel, value) in [("tau", torque), ("dq", 1.0)] {
                log.insert(format!("{channel}_{joint}"), "", Role::Measured, vec![value; 2]).unwrap();
            }
        }
        let scales = RobotScales::seen(&arm, &[log]).unwrap();
        assert!((scales.of_unit("N·m", "wrist") - 0.2).abs() < 1e-12);
    }

    #[test]
    fn the_largest_speed_is_that_of_the_smoothed_position() {
        let clock: Vec<f64> = (0..1000).map(|i| 0.002 * f64::from(i)).collect();
        let step = |x: f64| (x / 1e-3).round() * 1e-3;
        let position = clock.iter().map(|t| step(0.5 * (6.0 * t).sin())).collect();
        let mut log = Log::new(clock).unwrap();
        assert_eq!(top_speed(&log, "hinge"), None);
        log.insert("q_hinge".to_owned(), "rad", Role::Measured, position).unwrap();
        let top = top_speed(&log, "hinge").unwrap();
        assert!((top - 3.0).abs() < 0.3, "{top}");
    }
}
