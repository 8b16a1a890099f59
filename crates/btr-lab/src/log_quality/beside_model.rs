//! Glitches that show beside a simulation of the log.

use btr_core::log::Log;
use btr_core::world::Simulator;
use btr_identify::quality::{GlitchReport, leave_out_glitches_beside};
use btr_physics::model::Model;
use btr_physics::robot::Base;
use rayon::prelude::*;

/// Leaves out the readings that depart from the model's motion as no error of a model does, and returns them; `logs`
/// are those of the model's scenarios. None for floating robots, whose contacts come at other times in the model, for
/// joints that follow their readings, and for logs on which the model diverges.
pub(crate) fn leave_out(model: &Model, logs: &mut [Log]) -> Vec<Vec<GlitchReport>> {
    if model.robot.base == Base::Floating || model.robot.is_prescribed() {
        return vec![Vec::new(); logs.len()];
    }
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let of_log = |(k, log): (usize, &mut Log)| {
        let Ok(mut simulated) = model.simulate(model.request(&s, k).controller(&c)) else { return Vec::new() };
        let follows = |name: &str| model.robot.prescribed().any(|joint| name.strip_prefix("q_") == Some(&joint.name));
        simulated.retain(|name, _| !follows(name));
        leave_out_glitches_beside(log, &simulated)
    };
    logs.par_iter_mut().enumerate().map(of_log).collect()
}
