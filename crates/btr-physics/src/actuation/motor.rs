//! Actuators: from a command to a joint torque that the engine can integrate implicitly.

use super::sampled::SampledServo;
use crate::engine::{Affine, Bounded};
use crate::robot::{Actuator, DutyLoop, Joint};

/// What a joint is doing at the beginning of a step, and what it is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointInput {
    /// Simulated time in s.
    pub time_s: f64,
    /// Length of the step in s.
    pub dt_s: f64,
    /// Position in rad (m).
    pub q: f64,
    /// Velocity in rad/s (m/s).
    pub dq: f64,
    /// How `dq` changed in the last step, in rad/s² (m/s²).
    pub acceleration: f64,
    /// Whether the step is solved for its middle, and not for its end.
    pub midway: bool,
    /// Roughly what the joint moves, in kg·m² (kg).
    pub inertia: f64,
    /// What this joint's motor did in the last step, in N·m (N).
    pub torque: f64,
    /// Sum of the sizes of all motors' torques in the last step, in N·m; kept only where an effect acts on all joints at once.
    pub load: f64,
    /// The command that reaches the motor; NaN when it is switched off.
    pub command: f64,
}

impl JointInput {
    /// The velocity in the middle of the step, as the past predicts it: what depends on speed is exact to second order there.
    pub fn dq_midway(&self) -> f64 {
        self.dq + 0.5 * self.dt_s * self.acceleration
    }
}

/// The largest torque of a motor in the direction in which it pushes: a ceiling, and a torque-speed line below which it stays
/// while it drives. A motor that brakes has its whole torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueBound {
    /// At any speed, in N·m (N); infinite when unbounded.
    pub ceiling: f64,
    /// Where the line begins, at rest, in N·m (N); infinite without a line.
    pub stall: f64,
    /// Where the line ends, in rad/s (m/s).
    pub no_load_speed: f64,
}

impl TorqueBound {
    /// No bound at all.
    pub const NONE: TorqueBound = TorqueBound::at_any_speed(f64::INFINITY);

    const fn at_any_speed(ceiling: f64) -> Self {
        TorqueBound { ceiling, stall: f64::INFINITY, no_load_speed: f64::INFINITY }
    }

    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        self.ceiling.is_infinite() && self.stall.is_infinite()
    }

    /// The largest torque at a speed in its own direction (negative while it brakes).
    pub fn at(&self, speed: f64) -> f64 {
        if self.stall.is_infinite() {
            return self.ceiling;
        }
        let share = (1.0 - speed / self.no_load_speed).clamp(0.0, 1.0);
        self.ceiling.min(self.stall * share)
    }

    /// The straight piece of it around a speed in its own direction.
    fn around(&self, speed: f64) -> Affine {
        let torque = self.at(speed);
        if torque < self.ceiling && (0.0..self.no_load_speed).contains(&speed) {
            return Affine { constant: self.stall, stiffness: 0.0, damping: self.stall / self.no_load_speed };
        }
        Affine::constant(torque)
    }

    /// The torque nearest to `wanted` at the velocity `dq`.
    pub fn clamp(&self, wanted: f64, dq: f64) -> f64 {
        wanted.min(self.at(dq)).max(-self.at(-dq))
    }
}

/// A motor's torque before saturation, and its bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorTorque {
    /// What it would do without a bound.
    pub wanted: Affine,
    /// What it can do.
    pub bound: TorqueBound,
}

impl MotorTorque {
    const OFF: MotorTorque = MotorTorque::within(f64::INFINITY, Affine { constant: 0.0, stiffness: 0.0, damping: 0.0 });

    /// What is wanted, within a bound that is the same at every speed.
    const fn within(limit: f64, wanted: Affine) -> Self {
        MotorTorque { wanted, bound: TorqueBound::at_any_speed(limit) }
    }

    /// Lowers the ceiling, where it is not lower already.
    pub(crate) fn limit_to(&mut self, torque: f64) {
        self.bound.ceiling = self.bound.ceiling.min(torque);
    }

    /// Lets the bound fall with the speed; of several lines the one counts that begins lowest.
    pub(crate) fn limit_to_line(&mut self, stall: f64, no_load_speed: f64) {
        if stall < self.bound.stall {
            (self.bound.stall, self.bound.no_load_speed) = (stall, no_load_speed);
        }
    }

    /// Less (or more) of everything: the same command gives this share of the torque.
    pub(crate) fn scale(&mut self, factor: f64) {
        let Affine { constant, stiffness, damping } = self.wanted;
        self.wanted = Affine { constant: constant * factor, stiffness: stiffness * factor, damping: damping * factor };
        self.bound.ceiling *= factor;
        self.bound.stall *= factor;
    }

    /// The motor's law in a state: what is wanted there, within its bound.
    pub fn at(&self, q: f64, dq: f64) -> f64 {
        self.bound.clamp(self.wanted.at(q, dq), dq)
    }

    /// The largest and the least torque, as they depend on the velocity around that of the coming step's middle.
    fn bounds(&self, state: &JointInput) -> [Affine; 2] {
        let dq = state.dq_midway();
        let least = self.bound.around(-dq);
        [self.bound.around(dq), Affine { constant: -least.constant, ..least }]
    }

    /// For an engine that keeps the bound in the step that it solves; `None` where there is none.
    pub(crate) fn bounded(&self, state: &JointInput) -> Option<Bounded> {
        if self.bound.is_none() {
            return None;
        }
        let [most, least] = self.bounds(state);
        Some(Bounded { wanted: self.wanted, most, least })
    }

    /// For an engine that does not: the bound if the wanted torque would exceed it when the step ends, as far as the joint's
    /// own inertia tells.
    ///
    /// Judged by the step's end and not by its beginning, a strongly damped servo on a light link does not chatter between
    /// its bounds.
    pub fn saturated(&self, state: &JointInput) -> Affine {
        if self.bound.is_none() {
            return self.wanted;
        }
        // What an implicit step (see `Affine::step`) ends with is push·inertia/(inertia + dt·resistance).
        let Affine { constant, stiffness, damping } = self.wanted;
        let resistance = damping + state.dt_s * stiffness;
        let push = constant - stiffness * state.q - resistance * state.dq;
        let limit = self.bound.at(state.dq_midway().copysign(state.dq_midway() * push));
        if push.abs() * state.inertia <= limit * (state.inertia + state.dt_s * resistance) {
            return self.wanted;
        }
        let [most, least] = self.bounds(state);
        if push > 0.0 { most } else { least }
    }

    /// Its bound, if that is exceeded by `torque` at the velocity `dq`.
    pub(crate) fn beyond(&self, torque: f64, dq: f64, state: &JointInput) -> Option<Affine> {
        let [most, least] = self.bounds(state);
        if torque > self.bound.at(dq) {
            return Some(most);
        }
        (torque < -self.bound.at(-dq)).then_some(least)
    }
}

/// An actuator with its memory.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    actuator: Actuator,
    /// ∫(cmd − q)dt so far, in rad·s.
    integral: f64,
    /// Stiffness with which a prescribed joint is held, in N·m/rad.
    hold: f64,
    /// The clock of a digital servo.
    sampled: Option<SampledServo>,
}

/// How much stiffer than inertia/dt² a prescribed joint is held: it lags by this fraction of one step's motion.
const HOLD: f64 = 1e4;

impl Motor {
    /// `carried_inertia` is what the joint moves, in kg·m² (kg); only prescribed joints use it.
    ///
    /// A prescribed joint is pulled by an implicit spring far stiffer than its inertia, rather than moved kinematically: so
    /// its acceleration acts on the other links, and the spring's force is the torque that the motion needs.
    pub(crate) fn new(joint: &Joint, carried_inertia: f64, dt_s: f64) -> Self {
        let hold = HOLD * carried_inertia.max(f64::MIN_POSITIVE) / (dt_s * dt_s);
        let sampled = joint.sampling.as_ref().map(SampledServo::new);
        Motor { actuator: joint.actuator.clone(), integral: 0.0, hold, sampled }
    }

    /// Whether it works at instants and holds between them.
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
            self.sampled.iter_mut().for_each(SampledServo::forget);
            return MotorTorque::OFF;
        }
        if let Some(torque) = self.held(state) {
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
                let wanted = match servo {
                    Some(servo) => duty_torque(kt, resistance, servo, state),
                    None => Affine { constant: kt / resistance * command, ..back_emf(kt, resistance) },
                };
                MotorTorque::within(f64::INFINITY, wanted)
            }
            Actuator::Prescribed => {
                let wanted = Affine { constant: self.hold * command, stiffness: self.hold, damping: 0.0 };
                MotorTorque::within(f64::INFINITY, wanted)
            }
        }
    }

    /// What a digital servo holds; `None` for all other motors.
    fn held(&mut self, state: &JointInput) -> Option<MotorTorque> {
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
                let wanted = Affine { constant, ..back_emf(kt, resistance) };
                Some(MotorTorque::within(f64::INFINITY, wanted))
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
    let wanted = Affine { constant: stiffness * state.command, stiffness, ..back_emf(kt, resistance) };
    let (q, _) = wanted.step(state.q, state.dq, state.dt_s, state.inertia);
    let duty = servo.gain * (state.command - q);
    if duty.abs() > servo.max_duty {
        return Affine { constant: full * servo.max_duty.copysign(duty), ..back_emf(kt, resistance) };
    }
    wanted
}
