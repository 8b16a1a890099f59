//! Second looks at the logs, beside a fitted model.
//!
//! The more inertia a model has, the more torque the noise of the motion becomes: a model that lacks rotors and loads
//! has noise floors that no model reaches.
//!
//! Glitches show beside a fitted model that the error of the model as it stands has hidden. The criteria are the same
//! as beside the latter: single short departures, far above what the errors of
//! their neighbours allow. An effect that is missing bends the error over many samples, and is not explained away. What
//! is found counts only where the model explains nearly all of the rest.

mod attenuation;

use crate::fit::measure::held_out_squares;
use crate::fit::objective::{LogSet, Objective};
use crate::fit::residual_vector::chi;
use crate::fit::solve::FitPoint;
use crate::residual_model::{Derivation, ResidualModel};

/// The steps of the ladder that follow.
pub(crate) const LEFT_OUT: &str = "glitches left out";
pub(crate) const NEW_FLOORS: &str = "noise floors of this model";
/// How often each log is simulated for noise floors, at most: as measured, with eight draws of more noise, and with the
/// new floors.
const FLOOR_ROLLOUTS: usize = 10;
/// Largest error beside what is left out, in largest errors that count as noise: at fast onsets on a slow clock, the
/// error of a wrong model is as short as a glitch.
const NEARLY: f64 = 2.0;

/// The model without the glitches that show beside it at a fit; `None` where there are none, or where the rest is not
/// explained.
pub(crate) fn without_glitches(objective: &Objective, fit: &FitPoint) -> Option<Box<dyn ResidualModel>> {
    if objective.is_stopped() {
        return None;
    }
    let cleaner = objective.model.derive(&Derivation::WithoutGlitchesAt(fit.u.clone()))?;
    let again = objective.going_on(cleaner.as_ref(), &fit.u);
    let fit = FitPoint::at(&again, fit.active.clone(), fit.u.clone(), &[]).ok()?;
    let judged = held_out_squares(&again, &fit.u)?;
    let learnt = chi(fit.squares(), again.samples(LogSet::Learn));
    let error = learnt.max(chi(judged, again.samples(LogSet::HeldOut).max(1)));
    objective.count(&again);
    (error <= NEARLY * objective.noise_bound()).then_some(cleaner)
}

/// The model with the noise floors of torques at a fit; `None` where they stay about the same.
pub(crate) fn with_torque_floors(objective: &Objective, fit: &FitPoint) -> Option<Box<dyn ResidualModel>> {
    if !objective.description.is_decoupled || objective.is_stopped() {
        return None;
    }
    objective.add_rollouts(FLOOR_ROLLOUTS * objective.description.logs.len());
    objective.model.derive(&Derivation::WithTorqueFloorsAt(fit.u.clone()))
}
