//! A command that arrives smoothed: a filter, a current loop, a slow servo.
//!
//! What the servo is told is the mean of the lag's value over the step, exact for a command that is held over it: at
//! the step's end the lag would seem shorter by half a step.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind, follow};
use crate::actuation::JointInput;

pub(in crate::effects) struct MotorLag;

static SPEC: EffectSpec = EffectSpec {
    name: "motor_lag",
    law: "time_constant·du/dt = cmd - u: the servo sees u, a first-order lag that starts at the first command",
    site: SiteKind::Joint,
    cite: "first-order lag, as in any textbook of control",
    symptom: "steps are answered round instead of sharp; slow motions trail by the time constant, fast ones shrink",
    params: &[Param::new("time_constant", "s", (0.0, 0.5), 0.03)],
    starts: &[],
    similar: &["command_delay", "encoder_delay"],
    nested: &[],
};

/// The memory says whether there was a command, and holds what the servo was told last.
impl Effect for MotorLag {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        2
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> f64 {
        let steps = state.dt_s / p[0];
        let gone = -(-steps).exp_m1();
        let (before, _) = follow(memory, state.command, |error| error * gone);
        // The mean of an exponential that covers the share `gone` of the way.
        state.command - (state.command - before) * gone / steps
    }
}
