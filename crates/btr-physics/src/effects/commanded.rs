//! What an effect makes of commands by itself, without a simulation.

use super::effect::Effect;
use crate::actuation::JointInput;

/// The commands, `dt_s` apart, as they reach the servo behind an effect that depends on nothing else
/// ([`Effect::is_of_command`]); `p` holds its values.
pub fn commanded(effect: &dyn Effect, p: &[f64], commands: &[f64], dt_s: f64) -> Vec<f64> {
    let mut memory = vec![0.0; effect.memory(p, dt_s)];
    let state = |(i, &command): (usize, &f64)| JointInput {
        time_s: i as f64 * dt_s,
        dt_s,
        q: command,
        dq: 0.0,
        acceleration: 0.0,
        midpoint: false,
        inertia: 0.0,
        torque: 0.0,
        load: 0.0,
        command,
        mean_s: 0.0,
        neighbours: None,
    };
    commands.iter().enumerate().map(|told| effect.command(p, &mut memory, &state(told))).collect()
}
