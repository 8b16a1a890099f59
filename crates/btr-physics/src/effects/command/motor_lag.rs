//! First-order lag of the command: a filter, a current loop, a slow servo.
//!
//! The servo sees the mean of the lag's output over the step, which is exact for a command held over the step. The
//! output at the end of the step would make the lag seem shorter by half a step.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind, follow};

pub(in crate::effects) struct MotorLag;

static SPEC: EffectSpec = EffectSpec {
    name: "motor_lag",
    law: "time_constant·du/dt = cmd - u: the servo sees u, a first-order lag that starts at the first command",
    site: SiteKind::Joint,
    cite: "first-order lag, as in any control textbook",
    symptom: "step responses are rounded; slow motions trail by the time constant, fast ones lose amplitude",
    params: &[Param::new("time_constant", "s", (0.0, 0.5), 0.03)],
    starts: &[],
    similar: &["command_delay", "encoder_delay"],
    nested: &[],
};

/// The memory holds whether there was a command, and the lag's output at the end of the last step.
impl Effect for MotorLag {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn is_common(&self) -> bool {
        true
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        2
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> f64 {
        let steps = state.dt_s / p[0];
        let covered = -(-steps).exp_m1();
        let (before, _) = follow(memory, state.command, |error| error * covered);
        // Mean of an exponential that covers the fraction `covered` of the error.
        state.command - (state.command - before) * covered / steps
    }
}
