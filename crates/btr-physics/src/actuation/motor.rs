//! Actuators: from a command to a joint torque that the engine can integrate implicitly.

use super::joint_input::JointInput;
use super::sampled::SampledServo;
use super::torque::MotorTorque;
use crate::engine::Affine;
use crate::robot::{Actuator, DutyLoop, Joint};

/// An actuator with its internal state.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    actuator: Actuator,
    /// ∫(cmd − q)dt so far, in rad·s.
    integral: f64,
    /// Stiffness with which a prescribed joint is held, in N·m/rad.
    hold: f64,
    /// State of a digital servo, if it is one.
    sampled: Option<SampledServo>,
}

/// Stiffness of a prescribed joint's spring relative to inertia/dt². The joint lags by the inverse of this, as a
/// fraction of one step's motion.
const HOLD: f64 = 1e4;

impl Motor {
    /// `carried_inertia` is the inertia that the joint moves, in kg·m² (kg); only prescribed joints use it.
    ///
    /// A prescribed joint is driven by an implicit spring far stiffer than its inertia, not moved kinematically. So its
    /// acceleration acts on the other links, and the spring's force is the torque that the motion requires.
    pub(crate) fn new(joint: &Joint, carried_inertia: f64, dt_s: f64) -> Self {
        let hold = HOLD * carried_inertia.max(f64::MIN_POSITIVE) / (dt_s * dt_s);
        let sampled = joint.sampling.as_ref().map(SampledServo::new);
        Motor { actuator: joint.actuator.clone(), integral: 0.0, hold, sampled }
    }

    /// Whether it is a digital servo, with a sampled and held output.
    pub(crate) fn is_sampled(&self) -> bool {
        self.sampled.is_some()
    }

    /// Whether the command is the joint's position itself.
    pub(crate) fn is_prescribed(&self) -> bool {
        self.actuator == Actuator::Prescribed
    }

    /// The torque for the coming step. A NaN command switches the motor off (no current, no back-EMF) and clears its
    /// integral.
    pub(crate) fn torque(&mut self, state: &JointInput) -> MotorTorque {
        let command = state.command;
        if command.is_nan() {
            self.integral = 0.0;
            self.sampled.iter_mut().for_each(SampledServo::reset);
            return MotorTorque::OFF;
        }
        if let Some(torque) = self.held_torque(state) {
            return torque;
        }
        match self.actuator {
            Actuator::Passive => MotorTorque::OFF,
            Actuator::Position { kp, ki, kd, max_torque } => {
                self.integral += (command - state.q) * state.dt_s;
                let constant = kp * command + ki * self.integral;
                MotorTorque::within(max_torque, Affine { constant, stiffness: kp, damping: kd })
            }
            Actuator::Torque { max_torque } => MotorTorque::within(max_torque, Affine::constant(command)),
            Actuator::Voltage { kt, resistance, ref servo } => {
                let requested = match servo {
                    Some(servo) => duty_torque(kt, resistance, servo, state),
                    None => Affine { constant: kt / resistance * command, ..back_emf(kt, resistance) },
                };
                MotorTorque::within(f64::INFINITY, requested)
            }
            Actuator::Prescribed => {
                let requested = Affine { constant: self.hold * command, stiffness: self.hold, damping: 0.0 };
                MotorTorque::within(f64::INFINITY, requested)
            }
        }
    }

    /// The held output of a digital servo; `None` for all other motors.
    fn held_torque(&mut self, state: &JointInput) -> Option<MotorTorque> {
        let Motor { actuator, sampled: Some(sampled), integral, .. } = self else { return None };
        let command = state.command;
        match *actuator {
            Actuator::Position { kp, ki, kd, max_torque } => {
                let torque = sampled.hold(state, |read| {
                    *integral += (command - read.q) * read.period_s;
                    kp * (command - read.q) + ki * *integral - kd * read.dq
                });
                let bounded = torque.min(max_torque).max(-max_torque);
                Some(MotorTorque::within(max_torque, Affine::constant(bounded)))
            }
            Actuator::Voltage { kt, resistance, servo: Some(ref servo) } => {
                let duty = sampled.hold(state, |read| servo.gain * (command - read.q));
                let duty = duty.min(servo.max_duty).max(-servo.max_duty);
                let constant = kt / resistance * servo.supply * duty;
                let requested = Affine { constant, ..back_emf(kt, resistance) };
                Some(MotorTorque::within(f64::INFINITY, requested))
            }
            _ => None,
        }
    }
}

/// The torque of a short-circuited motor.
fn back_emf(kt: f64, resistance: f64) -> Affine {
    Affine { damping: kt * kt / resistance, ..Affine::default() }
}

/// The torque of a motor in a duty loop: its duty is bounded, its back-EMF is not.
fn duty_torque(kt: f64, resistance: f64, servo: &DutyLoop, state: &JointInput) -> Affine {
    let full = kt / resistance * servo.supply;
    let stiffness = full * servo.gain;
    let requested = Affine { constant: stiffness * state.command, stiffness, ..back_emf(kt, resistance) };
    let (q, _) = requested.step(state.q, state.dq, state.dt_s, state.inertia);
    let duty = servo.gain * (state.command - q);
    if duty.abs() > servo.max_duty {
        return Affine { constant: full * servo.max_duty.copysign(duty), ..back_emf(kt, resistance) };
    }
    requested
}
