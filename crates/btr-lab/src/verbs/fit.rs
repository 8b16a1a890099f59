//! `fit`: the numbers in doubt at their best, with what is known of each.

use crate::identification::{Doubt, NoiseFloor, VerbInput};
use crate::model_text::{adapted, in_finer_steps};
use btr_core::world::WorldError;
use btr_identify::LadderStep;
use btr_identify::fit::{Estimate, FitPoint, FitStop, NullDirection, Objective};
use btr_identify::residual_model::{ResidualModel, TimeStep};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use toml_edit::TomlError;

/// The answer, with the keys of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct FitReport {
    /// Always true: failures are another document.
    pub ok: bool,
    /// Sum of squares in multiples of the noise, with the priors' share.
    pub cost: f64,
    /// Every number in doubt.
    pub parameters: Vec<Estimate>,
    /// Error on the logs that were learnt from, in multiples of the noise floor.
    pub train: f64,
    /// Error on held-out logs.
    pub held_out: Option<f64>,
    /// Combinations that these logs do not tell.
    pub null_directions: Vec<NullDirection>,
    /// How the error fell.
    pub error_ladder: Vec<LadderStep>,
    /// Why the search ended.
    pub stop_reason: FitStop,
    /// Why there are no intervals, where there are none.
    pub withheld: Option<String>,
    /// The noise floors.
    pub noise_floor: Vec<NoiseFloor>,
    /// What makes the answer doubtful: the same checks as `check` makes.
    pub doubts: Vec<Doubt>,
    /// Joints of which nothing is measured: the answer is not about them.
    pub not_judged: Vec<String>,
    /// The integrator's own error in multiples of the noise floor.
    pub integrator_error: f64,
    /// The time step that it takes, in s; finer than the model's own where that would err too much.
    pub time_step_s: f64,
    /// Simulated logs.
    pub rollouts: usize,
    /// Wall time.
    pub seconds: f64,
}

/// Fits what is in doubt; `on_step` hears every step of the ladder. Returns the fit and the time step that it holds
/// for. `residual_model` is the problem's own, or the same served by others.
///
/// # Errors
/// The reason why the model cannot be simulated at its current values.
pub fn fit(
    input: &VerbInput,
    residual_model: &dyn ResidualModel,
    on_step: &dyn Fn(&LadderStep),
) -> Result<(FitReport, FitPoint, TimeStep), WorldError> {
    let began = Instant::now();
    let mut objective = Objective::new(residual_model);
    let fitted = btr_identify::fit::fitted(&mut objective, on_step)?;
    let report = FitReport {
        ok: true,
        cost: fitted.fit.cost,
        parameters: fitted.parameters,
        train: fitted.train,
        held_out: fitted.held_out,
        null_directions: fitted.null_directions,
        error_ladder: fitted.ladder,
        stop_reason: fitted.ended,
        withheld: fitted.withheld,
        noise_floor: input.floors(),
        doubts: input.doubts.clone(),
        not_judged: input.not_judged.clone(),
        integrator_error: fitted.integrator_error,
        time_step_s: input.time_step_s(fitted.step),
        rollouts: fitted.rollouts,
        seconds: began.elapsed().as_secs_f64(),
    };
    Ok((report, fitted.fit, fitted.step))
}

impl VerbInput {
    /// The text of the fitted model for a file in the folder `into`, with the time step that the fit holds for.
    ///
    /// # Errors
    /// A text that is not TOML; it was read before, so this does not happen.
    pub fn fitted_text(&self, fit: &FitPoint, step: TimeStep, into: &Path) -> Result<String, TomlError> {
        let text = adapted(&self.source, &self.problem.model().simulations, &self.values(fit), into)?;
        if step == TimeStep::USUAL { Ok(text) } else { in_finer_steps(&text, step.divides_by()) }
    }

    /// The model's time step at so many halvings, in s.
    pub(super) fn time_step_s(&self, step: TimeStep) -> f64 {
        self.problem.model().setup.dt_s / f64::from(step.divides_by())
    }

    /// The values of what is in doubt at a fit, in the order of the model's space.
    pub fn values(&self, fit: &FitPoint) -> Vec<f64> {
        let dims = self.problem.model().simulations.dims();
        let value = |(&k, dim): (&usize, &btr_core::space::Dim)| {
            self.problem.parameters()[k].value(fit.u[k]).clamp(dim.min, dim.max)
        };
        self.problem.free().iter().zip(dims).map(value).collect()
    }
}
