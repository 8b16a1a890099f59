//! `fit`: estimates of the free parameters with their uncertainties.

use super::base_parameters::BaseReport;
use crate::experiment::LeftOutLog;
use crate::identification::{Doubt, FittedGlitch, NoiseFloor, VerbInput};
use crate::model_text::{FittedValue, adapted, in_finer_steps};
use crate::output::written_by_btr;
use btr_core::space::Dim;
use btr_core::world::WorldError;
use btr_identify::LadderStep;
use btr_identify::fit::{
    Degree, Estimate, FitPoint, FitStart, FitStop, NullDirection, Objective, Posterior, RemainingError, fitted_from,
};
use btr_identify::residual_model::{ResidualModel, TimeStep};
use indexmap::{IndexMap, IndexSet};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use toml_edit::TomlError;

/// The result of `fit`, with the keys of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct FitReport {
    /// Always true: failures have another document.
    pub ok: bool,
    /// Sum of squares in multiples of the noise, including the priors.
    pub cost: f64,
    /// Estimates of all free parameters.
    pub parameters: Vec<Estimate>,
    /// Values of the free parameters in the model before the fit, by name; not of effects that were added.
    pub in_model: IndexMap<String, f64>,
    /// Error on training logs, in multiples of the noise floor.
    pub train: f64,
    /// Error on held-out logs, in multiples of the noise floor.
    pub held_out: Option<f64>,
    /// How far the error is explained.
    pub degree: Degree,
    /// What is left in each channel, on held-out logs if there are any.
    pub remaining: Vec<RemainingError>,
    /// Effects of the model, as `effect@site`, whose fitted values are those at which they do nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub without_effect: Vec<String>,
    /// Combinations that are not identifiable from these logs.
    pub null_directions: Vec<NullDirection>,
    /// What logs and priors leave of all free parameters together, for draws of them.
    pub posterior: Option<Posterior>,
    /// Error after each step.
    pub error_ladder: Vec<LadderStep>,
    /// Why the search ended.
    pub stop_reason: FitStop,
    /// Why there are no intervals, if there are none.
    pub withheld: Option<String>,
    /// What the logs tell about all of the robot's dynamic parameters, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_parameters: Option<BaseReport>,
    /// The noise floors.
    pub noise_floor: Vec<NoiseFloor>,
    /// Findings of `check` that make the result doubtful.
    pub doubts: Vec<Doubt>,
    /// Glitches that only the fitted model showed and that were left out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub glitches: Vec<FittedGlitch>,
    /// Logs that could not be used.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOutLog>,
    /// Joints without measurements: the result does not cover them.
    pub not_judged: Vec<String>,
    /// Parameters that kept the model's values, by name.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frozen: Vec<String>,
    /// Free parameters whose prior is what earlier logs left (`sd` in the model file), by name.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub with_prior: Vec<String>,
    /// Discretisation error in multiples of the noise floor.
    pub integrator_error: f64,
    /// Time step of the fit, in s; finer than the model's if that is too coarse.
    pub time_step_s: f64,
    /// Number of simulated logs.
    pub rollouts: usize,
    /// Wall time.
    pub seconds: f64,
}

/// Fits the free parameters; `on_step` is called with every step of the error ladder. Returns the fit and its time
/// step. `residual_model` is the input's problem, and `before` that of the input before effects were added, if there
/// were any: both are evaluated locally or by workers.
///
/// # Errors
/// The reason why the model cannot be simulated at its current values, or where the fit should begin.
pub fn fit(
    input: &VerbInput,
    residual_model: &dyn ResidualModel,
    before: Option<&dyn ResidualModel>,
    on_step: &dyn Fn(&LadderStep),
) -> Result<(FitReport, FitPoint, TimeStep), WorldError> {
    let began = Instant::now();
    let mut objective = Objective::new(residual_model);
    let screened = || input.screened(before?);
    let start = FitStart {
        values: input.start.clone().unwrap_or_default(),
        step: "at the other model's values".to_owned(),
        search: Some(&screened),
    };
    let fitted = fitted_from(&mut objective, &start, on_step)?;
    let glitches = input.in_files(&fitted.glitches);
    let is_at_bound = |name: &str| fitted.parameters.iter().any(|estimate| estimate.at_bound && estimate.name == name);
    let without_effect = input.idle_effects(input.values(&fitted.fit), is_at_bound);
    let report = FitReport {
        ok: true,
        cost: fitted.fit.cost,
        in_model: input.in_model(),
        parameters: fitted.parameters,
        train: fitted.train,
        held_out: fitted.held_out,
        degree: fitted.degree,
        doubts: input.doubts_with(&glitches, &fitted.left),
        remaining: fitted.left,
        without_effect,
        null_directions: fitted.null_directions,
        posterior: fitted.posterior,
        error_ladder: fitted.ladder,
        stop_reason: fitted.ended,
        withheld: fitted.withheld,
        base_parameters: None,
        noise_floor: input.floors_in(&fitted.logs),
        glitches,
        not_judged: input.not_judged.clone(),
        left_out: input.left_out.clone(),
        frozen: input.frozen.clone(),
        with_prior: input.with_prior(),
        integrator_error: fitted.integrator_error,
        time_step_s: input.time_step_s(fitted.step),
        rollouts: fitted.rollouts,
        seconds: began.elapsed().as_secs_f64(),
    };
    Ok((report, fitted.fit, fitted.step))
}

/// Numbers of parameters from which changes by noise alone are told: a difference of files that nobody reads.
const MANY: usize = 12;

impl FitReport {
    /// Whether a parameter has moved for certain: its value in the model lies outside its interval.
    pub fn has_moved(&self, estimate: &Estimate) -> bool {
        let outside = |(value, [low, high]): (&f64, [f64; 2])| !(low..=high).contains(value);
        self.in_model.get(&estimate.name).zip(estimate.ci95).is_some_and(outside)
    }

    /// Where many parameters have changed by no more than their uncertainty: how many, and what names them.
    pub fn moved_by_noise(&self) -> Option<(usize, Vec<String>)> {
        let still = |e: &&Estimate| self.in_model.contains_key(&e.name) && e.ci95.is_some() && !self.has_moved(e);
        let still: Vec<&str> = self.parameters.iter().filter(still).map(|e| e.name.as_str()).collect();
        let of_kind = |name: &str| name.split_once('@').map(|(kind, _)| kind.to_owned());
        let all = |kind: &str| {
            let same = self.parameters.iter().filter(|e| of_kind(&e.name).as_deref() == Some(kind));
            same.count() == still.iter().filter(|name| of_kind(name).as_deref() == Some(kind)).count()
        };
        let pattern = |name: &&str| match of_kind(name) {
            Some(kind) if all(&kind) => format!("{kind}@*"),
            _ => (*name).to_owned(),
        };
        let names: IndexSet<String> = still.iter().map(pattern).collect();
        (still.len() >= MANY).then(|| (still.len(), names.into_iter().collect()))
    }
}

impl VerbInput {
    /// The text of the fitted model for a file in the folder `into`, with the time step of the fit. A parameter with an
    /// interval has its standard deviation, as the prior of a fit to further logs. With base parameters, it has the
    /// possible values of all of them.
    ///
    /// # Errors
    /// A text that is not TOML; it was parsed before, so this does not happen.
    pub fn fitted_text(
        &self,
        report: &FitReport,
        fit: &FitPoint,
        step: TimeStep,
        into: &Path,
    ) -> Result<String, TomlError> {
        let sd = |name: &str| report.parameters.iter().find(|estimate| estimate.name == name)?.prior_sd;
        let values = self.values(fit).map(|(name, value)| FittedValue { name, value, sd: sd(name) });
        let text = written_by_btr(&adapted(&self.source, self.problem.model(), values, into)?);
        let possible = report.base_parameters.as_ref().and_then(|base| base.possible.as_ref());
        let text = possible.map_or_else(|| Ok(text.clone()), |possible| possible.written_into(&text))?;
        let setup = &self.problem.model().setup;
        if step == TimeStep::USUAL { Ok(text) } else { in_finer_steps(&text, setup, step.divides_by()) }
    }

    /// The model's time step after the halvings of `step`, in s.
    pub(super) fn time_step_s(&self, step: TimeStep) -> f64 {
        self.problem.model().setup.dt_s / f64::from(step.divides_by())
    }

    /// The free parameters at a fit: their names and values.
    pub(super) fn values(&self, fit: &FitPoint) -> impl Iterator<Item = (&str, f64)> {
        let value = |(&k, dim): (&usize, &Dim)| self.problem.parameters()[k].value(fit.u[k]).clamp(dim.min, dim.max);
        let values: Vec<f64> = self.problem.free().iter().zip(self.free_dims()).map(value).collect();
        self.free_dims().map(|dim| dim.name.as_str()).zip(values)
    }
}
