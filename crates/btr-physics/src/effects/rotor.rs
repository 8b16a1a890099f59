//! Separate rotor on the motor's side of a transmission that is not rigid.
//!
//! Rotor and link are coupled by a spring and a damper in the coming step. Rotor, servo and spring are solved together,
//! for the middle of the step (second order), or for its end where they would ring: the rotor's mean velocity is `a +
//! b·(the link's mean velocity)`. The spring's torque on the link then depends on the link's velocity alone, so the
//! engine finds a velocity consistent with all of them, and no stiffness makes a step unstable.

use crate::actuation::JointInput;
use crate::engine::{Affine, Dof};

/// Number of values in a rotor's memory.
pub(super) const MEMORY: usize = 9;

/// Rotor inertia as a fraction of the inertia that the joint carries, where the model has no rotor inertia.
pub const UNKNOWN_ROTOR: f64 = 0.01;

/// Coupling between rotor and link during a step.
pub(super) struct Spring {
    /// N·m/rad.
    pub(super) stiffness: f64,
    /// N·m·s/rad.
    pub(super) damping: f64,
    /// Deflection at the start of the step, in rad.
    pub(super) stretch: f64,
}

/// State of a rotor, the first value of its memory: 0 before the first step, then placed at its link, then running.
const PLACED: f64 = 1.0;
const RUNNING: f64 = 2.0;

/// Rotor's angle and velocity after the last step, from the link's new position. It starts at the link's state.
pub(super) fn arrive(memory: &mut [f64], state: &JointInput) -> (f64, f64) {
    let [started, angle, velocity, a, b, _, _, kept, link] = memory else { return (state.q, state.dq) };
    let before = std::mem::replace(link, state.q);
    if *started > 0.0 {
        let mean = *a + *b * (state.q - before) / state.dt_s;
        *velocity = mean + *kept * (mean - *velocity);
        *angle += state.dt_s * mean;
    } else {
        (*started, *angle, *velocity) = (PLACED, state.q, state.dq);
    }
    (*angle, *velocity)
}

/// Before the first step: moves the rotor to the angle at which its motor and the coupling are in equilibrium, as in a
/// machine that has been holding its load. `balance` returns that angle for the motor's torque at angle 0 and its
/// stiffness.
pub(super) fn load(memory: &mut [f64], motor: &Affine, balance: impl FnOnce(f64, f64) -> f64) {
    let [started, angle, velocity, ..] = memory else { return };
    if *started == PLACED {
        (*started, *angle) = (RUNNING, balance(motor.constant - motor.damping * *velocity, motor.stiffness));
    }
}

/// Removes the rotor's inertia from the link and returns it.
pub(super) fn take_inertia(dof: &mut Dof, state: &JointInput) -> f64 {
    let known = std::mem::replace(&mut dof.armature, 0.0);
    if known > 0.0 { known } else { UNKNOWN_ROTOR * state.inertia }
}

/// Rotor's angle and velocity at the end of the step if only its motor acts on it.
pub(super) fn loose(memory: &[f64], motor: &Affine, inertia: f64, dt_s: f64) -> (f64, f64) {
    motor.step(memory[1], memory[2], dt_s, inertia)
}

/// Torque that reaches the link.
pub(super) fn transmit(
    memory: &mut [f64],
    motor: &Affine,
    inertia: f64,
    spring: &Spring,
    state: &JointInput,
) -> Affine {
    let [_, angle, velocity, a, b, constant, damping, kept, _] = memory else { return *motor };
    let dt_s = if state.midpoint { 0.5 * state.dt_s } else { state.dt_s };
    // If the stiffness would let the rotor overshoot in the second half of the step, damping is added to prevent it.
    let damped = |stiffness: f64, damping: f64| match state.midpoint {
        true => damping.max(dt_s * stiffness - inertia / dt_s),
        false => damping,
    };
    // The spring's torque is pull + impedance·(the rotor's mean velocity - the link's mean velocity).
    let pull = spring.stiffness * spring.stretch;
    let impedance = dt_s * spring.stiffness + damped(spring.stiffness, spring.damping);
    let servo = dt_s * motor.stiffness + damped(motor.stiffness, motor.damping);
    let push = motor.constant - motor.stiffness * *angle;
    // A rotor with very little inertia would oscillate from step to step. It continues from the middle of the last
    // step, a whole step instead of half a step before the middle of this one.
    let light = state.midpoint && inertia < 0.5 * dt_s * (servo + impedance);
    let inertia = if light { 0.5 * inertia } else { inertia };
    *kept = if light || !state.midpoint { 0.0 } else { 1.0 };
    let resistance = inertia + dt_s * (servo + impedance);
    *a = (inertia * *velocity + dt_s * (push - pull)) / resistance;
    *b = dt_s * impedance / resistance;
    (*constant, *damping) = (push - servo * *a, servo * *b);
    Affine { constant: pull + impedance * *a, stiffness: 0.0, damping: impedance * (1.0 - *b) }
}

/// Motor's torque and rotor's velocity if the link moves at `dq`, with the rotor's angle of the last step: the solution
/// for the middle of the step is used for its end.
pub(super) fn motor_side(memory: &[f64], dq: f64) -> Option<(f64, f64)> {
    let [_, _, _, a, b, constant, damping, ..] = memory else { return None };
    Some((constant - damping * dq, a + b * dq))
}
