//! Simulations of the logs by the model as it stands, and glitches that show beside them.

use btr_core::log::Log;
use btr_core::world::Simulator;
use btr_identify::quality::{GlitchReport, leave_out_glitches_beside};
use btr_physics::model::Model;
use btr_physics::robot::Base;
use rayon::prelude::*;

/// The model's motion in each of its scenarios; `None` where it diverges, and where nothing is searched beside it.
pub(crate) fn simulated(model: &Model) -> Vec<Option<Log>> {
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let of_scenario = |k: usize| model.simulate(model.request(&s, k).controller(&c)).ok();
    let scenarios = (0..model.scenarios.len()).into_par_iter();
    scenarios.map(|k| is_searched(model).then(|| of_scenario(k)).flatten()).collect()
}

/// Leaves out the readings that depart from the model's motion as no error of a model does, and returns them; `logs`
/// and `simulated` are those of the model's scenarios.
pub(crate) fn leave_out(model: &Model, logs: &mut [Log], simulated: &[Option<Log>]) -> Vec<Vec<GlitchReport>> {
    let of_log = |(log, simulated): (&mut Log, &Option<Log>)| {
        simulated.clone().map_or_else(Vec::new, |simulated| leave_out_beside(model, log, simulated, &[]))
    };
    logs.par_iter_mut().zip(simulated).map(of_log).collect()
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
