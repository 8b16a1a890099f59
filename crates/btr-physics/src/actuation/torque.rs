//! A motor's torque before saturation, and its bound.

use super::joint_input::JointInput;
use crate::engine::{Affine, Bounded};

/// Bound on a motor's torque: a constant ceiling, and a torque-speed line that applies while the motor drives. A
/// braking motor is bounded by the ceiling and the stall torque alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueBound {
    /// Bound at any speed, in N·m (N); infinite when unbounded.
    pub ceiling: f64,
    /// Stall torque, where the line meets zero speed, in N·m (N); infinite without a line.
    pub stall: f64,
    /// No-load speed, where the line meets zero torque, in rad/s (m/s).
    pub no_load_speed: f64,
}

impl TorqueBound {
    /// No bound at all.
    pub const NONE: TorqueBound = TorqueBound::at_any_speed(f64::INFINITY);

    const fn at_any_speed(ceiling: f64) -> Self {
        TorqueBound { ceiling, stall: f64::INFINITY, no_load_speed: f64::INFINITY }
    }

    /// Whether there is no bound.
    pub fn is_none(&self) -> bool {
        self.ceiling.is_infinite() && self.stall.is_infinite()
    }

    /// The largest torque at a speed in the torque's own direction (negative while it brakes).
    pub fn at(&self, speed: f64) -> f64 {
        if self.stall.is_infinite() {
            return self.ceiling;
        }
        let share = (1.0 - speed / self.no_load_speed).clamp(0.0, 1.0);
        self.ceiling.min(self.stall * share)
    }

    /// The linear piece of the bound around a speed in the torque's own direction.
    fn around(&self, speed: f64) -> Affine {
        let torque = self.at(speed);
        if torque < self.ceiling && (0.0..self.no_load_speed).contains(&speed) {
            return Affine { constant: self.stall, stiffness: 0.0, damping: self.stall / self.no_load_speed };
        }
        Affine::constant(torque)
    }

    /// The torque closest to `requested` within the bound at the velocity `dq`.
    pub fn clamp(&self, requested: f64, dq: f64) -> f64 {
        requested.min(self.at(dq)).max(-self.at(-dq))
    }
}

/// A motor's torque before saturation, and its bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorTorque {
    /// Torque without the bound.
    pub requested: Affine,
    /// The bound.
    pub bound: TorqueBound,
}

impl MotorTorque {
    pub(super) const OFF: MotorTorque =
        MotorTorque::within(f64::INFINITY, Affine { constant: 0.0, stiffness: 0.0, damping: 0.0 });

    /// A requested torque within a bound that is the same at every speed.
    pub(super) const fn within(limit: f64, requested: Affine) -> Self {
        MotorTorque { requested, bound: TorqueBound::at_any_speed(limit) }
    }

    /// Lowers the ceiling to `torque`, unless it is lower already.
    pub(crate) fn limit_to(&mut self, torque: f64) {
        self.bound.ceiling = self.bound.ceiling.min(torque);
    }

    /// Adds a torque-speed line. Of several lines the one with the lowest stall torque applies.
    pub(crate) fn limit_to_line(&mut self, stall: f64, no_load_speed: f64) {
        if stall < self.bound.stall {
            (self.bound.stall, self.bound.no_load_speed) = (stall, no_load_speed);
        }
    }

    /// Scales the torque and its bound: the same command gives this multiple of the torque.
    pub(crate) fn scale(&mut self, factor: f64) {
        let Affine { constant, stiffness, damping } = self.requested;
        self.requested =
            Affine { constant: constant * factor, stiffness: stiffness * factor, damping: damping * factor };
        self.bound.ceiling *= factor;
        self.bound.stall *= factor;
    }

    /// The torque in a state, within its bound.
    pub fn at(&self, q: f64, dq: f64) -> f64 {
        self.bound.clamp(self.requested.at(q, dq), dq)
    }

    /// The upper and the lower bound, linear in the velocity around the extrapolated one in the coming step's middle.
    fn bounds(&self, state: &JointInput) -> [Affine; 2] {
        let dq = state.dq_midpoint();
        let lower = self.bound.around(-dq);
        [self.bound.around(dq), Affine { constant: -lower.constant, ..lower }]
    }

    /// For an engine that enforces bounds within the step; `None` without a bound.
    pub(crate) fn bounded(&self, state: &JointInput) -> Option<Bounded> {
        if self.bound.is_none() {
            return None;
        }
        let [upper, lower] = self.bounds(state);
        Some(Bounded { requested: self.requested, upper, lower })
    }

    /// For an engine that does not: the bound if the requested torque would exceed it at the step's end, judged by the
    /// joint's own inertia; otherwise the requested torque.
    ///
    /// Judging by the step's end, not its beginning, keeps a strongly damped servo on a light link from chattering
    /// between its bounds.
    pub fn saturated(&self, state: &JointInput) -> Affine {
        if self.bound.is_none() {
            return self.requested;
        }
        // The torque at the end of an implicit step (see `Affine::step`) is push·inertia/(inertia + dt·resistance).
        let Affine { constant, stiffness, damping } = self.requested;
        let resistance = damping + state.dt_s * stiffness;
        let push = constant - stiffness * state.q - resistance * state.dq;
        let limit = self.bound.at(state.dq_midpoint().copysign(state.dq_midpoint() * push));
        if push.abs() * state.inertia <= limit * (state.inertia + state.dt_s * resistance) {
            return self.requested;
        }
        let [upper, lower] = self.bounds(state);
        if push > 0.0 { upper } else { lower }
    }

    /// The bound that `torque` exceeds at the velocity `dq`, if any.
    pub(crate) fn exceeded_bound(&self, torque: f64, dq: f64, state: &JointInput) -> Option<Affine> {
        let [upper, lower] = self.bounds(state);
        if torque > self.bound.at(dq) {
            return Some(upper);
        }
        (torque < -self.bound.at(-dq)).then_some(lower)
    }
}
