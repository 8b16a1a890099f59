//! A rotor of its own on the motor's side of a transmission that is not rigid.
//!
//! What is between rotor and link is a spring (and a damper) for the coming step. Rotor, servo and spring are solved
//! together, for the middle of the step (second order), or for its end where they would ring: the rotor's mean velocity
//! is
//! `a + b·(the link's mean velocity)`. With that the spring's torque on the link depends on the link's velocity alone, so that
//! the engine finds the velocity that suits all of them, and no stiffness makes a step unstable.

use crate::actuation::JointInput;
use crate::engine::{Affine, Dof};

/// How many numbers a rotor remembers.
pub(super) const MEMORY: usize = 9;

/// Of what a joint carries, the share that its rotor has where the model does not tell its inertia.
const SHARE: f64 = 0.01;

/// What is between rotor and link during a step.
pub(super) struct Spring {
    /// N·m/rad.
    pub(super) stiffness: f64,
    /// N·m·s/rad.
    pub(super) damping: f64,
    /// How far it is stretched when the step begins, in rad.
    pub(super) stretch: f64,
}

/// What a rotor is doing, its first number: nothing yet, placed beside its link, running.
const PLACED: f64 = 1.0;
const RUNNING: f64 = 2.0;

/// The rotor's angle and velocity where the last step led to, now that the link's is known. It starts with the link.
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

/// Before the first step: moves the rotor to where its motor and what is between it and the link are in balance, as
/// they are in a machine that has been holding its load. `balance` gives that angle for a motor's push at angle 0 and
/// its stiffness.
pub(super) fn load(memory: &mut [f64], motor: &Affine, balance: impl FnOnce(f64, f64) -> f64) {
    let [started, angle, velocity, ..] = memory else { return };
    if *started == PLACED {
        (*started, *angle) = (RUNNING, balance(motor.constant - motor.damping * *velocity, motor.stiffness));
    }
}

/// Takes the rotor's inertia away from the link.
pub(super) fn take_inertia(dof: &mut Dof, state: &JointInput) -> f64 {
    let known = std::mem::replace(&mut dof.armature, 0.0);
    if known > 0.0 { known } else { SHARE * state.inertia }
}

/// The rotor's angle and velocity when the step ends if nothing holds it but its motor.
pub(super) fn loose(memory: &[f64], motor: &Affine, inertia: f64, dt_s: f64) -> (f64, f64) {
    motor.step(memory[1], memory[2], dt_s, inertia)
}

/// What arrives at the link.
pub(super) fn transmit(
    memory: &mut [f64],
    motor: &Affine,
    inertia: f64,
    spring: &Spring,
    state: &JointInput,
) -> Affine {
    let [_, angle, velocity, a, b, constant, damping, kept, _] = memory else { return *motor };
    let dt_s = if state.midway { 0.5 * state.dt_s } else { state.dt_s };
    // So stiff that the rotor would overshoot in the step's second half, it is damped until it does not.
    let settled = |stiffness: f64, damping: f64| match state.midway {
        true => damping.max(dt_s * stiffness - inertia / dt_s),
        false => damping,
    };
    // The spring's torque is pull + impedance·(the rotor's mean velocity - the link's).
    let pull = spring.stiffness * spring.stretch;
    let impedance = dt_s * spring.stiffness + settled(spring.stiffness, spring.damping);
    let servo = dt_s * motor.stiffness + settled(motor.stiffness, motor.damping);
    let push = motor.constant - motor.stiffness * *angle;
    // A rotor that hardly has inertia would swing from step to step: it goes on from the middle of the last step, a
    // whole step and not half of one before the middle of this.
    let light = state.midway && inertia < 0.5 * dt_s * (servo + impedance);
    let inertia = if light { 0.5 * inertia } else { inertia };
    *kept = if light || !state.midway { 0.0 } else { 1.0 };
    let resistance = inertia + dt_s * (servo + impedance);
    *a = (inertia * *velocity + dt_s * (push - pull)) / resistance;
    *b = dt_s * impedance / resistance;
    (*constant, *damping) = (push - servo * *a, servo * *b);
    Affine { constant: pull + impedance * *a, stiffness: 0.0, damping: impedance * (1.0 - *b) }
}

/// The motor's torque and the rotor's velocity where the link moves at `dq`, with the rotor's angle of the last step:
/// what was solved for the step's middle is taken for its end.
pub(super) fn motor_side(memory: &[f64], dq: f64) -> Option<(f64, f64)> {
    let [_, _, _, a, b, constant, damping, ..] = memory else { return None };
    Some((constant - damping * dq, a + b * dq))
}
