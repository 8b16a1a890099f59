//! Glitches that show beside a simulation of the log.

use btr_core::log::Log;
use btr_core::world::Simulator;
use btr_identify::quality::{GlitchReport, leave_out_glitches_beside};
use btr_physics::model::Model;
use btr_physics::robot::Base;
use rayon::prelude::*;

/// Leaves out the readings that depart from the model's motion as no error of a model does, and returns them; `logs`
/// are those of the model's scenarios. None for logs on which the model diverges.
pub(crate) fn leave_out(model: &Model, logs: &mut [Log]) -> Vec<Vec<GlitchReport>> {
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let of_log = |(k, log): (usize, &mut Log)| {
        if !is_searched(model) {
            return Vec::new();
        }
        let Ok(simulated) = model.simulate(model.request(&s, k).controller(&c)) else { return Vec::new() };
        leave_out_beside(model, log, simulated, &[])
    };
    logs.par_iter_mut().enumerate().map(of_log).collect()
}

/// Whether glitches are searched beside the model: not for floating robots, whose contacts come at other times in the
/// model, nor for joints that follow their readings.
pub(crate) fn is_searched(model: &Model) -> bool {
    model.robot.base == Base::Fixed && !model.robot.is_prescribed()
}

/// Leaves out the glitches of a log beside a simulation of it; `before` are those that were left out so earlier.
pub(crate) fn leave_out_beside(
    model: &Model,
    log: &mut Log,
    mut simulated: Log,
    before: &[GlitchReport],
) -> Vec<GlitchReport> {
    let follows = |name: &str| model.robot.prescribed().any(|joint| name.strip_prefix("q_") == Some(&joint.name));
    simulated.retain(|name, _| !follows(name));
    leave_out_glitches_beside(log, &simulated, before)
}
