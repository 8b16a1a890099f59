//! The six-legged ant of `ant.toml`, on the ground: it walks, and waves every joint as it likes.

use crate::excite::{Commands, between, clock};
use crate::reality::Subject;
use btr_core::random::Rng;
use btr_physics::drive::{Drive, Sine};
use btr_physics::effects::FormulaTarget;
use btr_physics::presets::ant;
use std::f64::consts::TAU;

/// It has encoders and a gyroscope.
pub(crate) static ANT: Subject = Subject {
    file: "hidden_effects/ant.toml",
    prepare: |_| {},
    training,
    held_out,
    seen: &["q_", "cmd_", "imu_gyro_"],
    silent: &[],
    one_number: &[],
    max_rollouts: 3000,
    outside: &[
        (FormulaTarget::Torque, "-8*max(0,q-0.2)^2"),
        (FormulaTarget::Torque, "0.35*sin(19*t)"),
        (FormulaTarget::Command, "cmd+0.08*sin(3*t)*cmd"),
        (FormulaTarget::Torque, "-0.6*min(1,t)*sin(4*q)"),
    ],
};

/// Length of an episode, in s.
const DURATION_S: f64 = 1.4;

fn training(_joints: usize, rng: &mut Rng) -> Vec<Commands> {
    vec![gait(rng), mixed(rng)]
}

fn held_out(_joints: usize, rng: &mut Rng) -> Vec<Commands> {
    vec![gait(rng), mixed(rng)]
}

/// Everything grows from the stance within 0.3 s.
fn around_stance(offset: impl Fn(usize, f64) -> f64) -> Commands {
    let row = |(joint, centre): (usize, f64)| {
        clock(DURATION_S).map(|t| centre + (t / 0.3).min(1.0) * (offset(joint, t) - offset(joint, 0.0))).collect()
    };
    ant::centres().into_iter().enumerate().map(row).collect()
}

/// A tripod gait, every joint a little as it likes.
fn gait(rng: &mut Rng) -> Commands {
    let mut sine: Sine = ant::tripod();
    for pair in sine.controller.chunks_mut(2) {
        pair[0] = pair[0] * between(rng, 0.6, 1.1) + between(rng, 0.0, 0.1);
        pair[1] += between(rng, -0.3, 0.3);
    }
    sine.omega_rad_s *= between(rng, 0.7, 1.1);
    let centres = ant::centres();
    around_stance(|joint, t| {
        let mut command = vec![0.0; centres.len()];
        sine.command(t, &mut command);
        command[joint] - centres[joint]
    })
}

/// Two sines on every joint, and a new place every third of a second, at times of its own.
fn mixed(rng: &mut Rng) -> Commands {
    let plan = |rng: &mut Rng| Plan {
        sines: [0.4, 1.4].map(|f| [between(rng, 0.04, 0.1), f + between(rng, 0.0, 0.6), between(rng, 0.0, TAU)]),
        lag_s: between(rng, 0.0, 0.33),
        levels: std::array::from_fn(|_| between(rng, -0.15, 0.15)),
    };
    let plans: Vec<Plan> = (0..ant::centres().len()).map(|_| plan(rng)).collect();
    around_stance(|joint, t| {
        let Plan { sines, lag_s, levels } = &plans[joint];
        let level = levels[((t + lag_s) / 0.33) as usize % levels.len()];
        level + sines.iter().map(|[a, f, p]| a * (TAU * f * t + p).sin()).sum::<f64>()
    })
}

/// What one joint does in such an episode: amplitude in rad, frequency in Hz and phase of its sines; its places in rad.
struct Plan {
    sines: [[f64; 3]; 2],
    lag_s: f64,
    levels: [f64; 9],
}
