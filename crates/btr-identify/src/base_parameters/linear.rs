//! A residual model that is linear in its parameters.

use super::regroup::NO_EFFECT;
use crate::residual_model::{
    FitParameter, ModelDescription, Parametrisation, ResidualModel, ResidualRequest, TimeStep,
};
use btr_core::world::WorldError;

/// A bound that no coordinate reaches.
const FAR: f64 = 1e100;

/// Residuals and how they change with each parameter.
#[derive(Clone, Debug)]
pub struct LinearModel {
    description: ModelDescription,
    /// For each log, its residual at the parameters' values; NaN where nothing was measured.
    residuals: Vec<Vec<f64>>,
    /// For each log and parameter, by how much the prediction grows with one unit of it, in noise floors; empty where
    /// it does not.
    columns: Vec<Vec<Vec<f64>>>,
}

/// A parameter of a linear model.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearParameter {
    /// Its name.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// Its value.
    pub value: f64,
}

impl LinearModel {
    /// A model with the logs of another one. Coordinates are chosen so that columns have a length of 1 on the training
    /// logs, except those without effect.
    pub fn new(
        of: ModelDescription,
        parameters: &[LinearParameter],
        residuals: Vec<Vec<f64>>,
        columns: Vec<Vec<Vec<f64>>>,
    ) -> Self {
        let squares = |k: usize| -> f64 {
            let learnt = columns.iter().zip(&of.logs).filter(|(_, log)| !log.held_out);
            learnt.flat_map(|(of_log, _)| &of_log[k]).filter(|x| x.is_finite()).map(|x| x * x).sum()
        };
        let lengths: Vec<f64> = (0..parameters.len()).map(|k| squares(k).sqrt()).collect();
        let longest = lengths.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let unit = |length: f64| if length > NO_EFFECT * longest { length.recip() } else { longest.recip() };
        let parameters = parameters.iter().zip(&lengths).map(|(of, length)| parameter(of, unit(*length))).collect();
        let description = ModelDescription {
            clocks_s: of.clocks_s,
            measured: of.measured,
            is_decoupled: of.is_decoupled,
            has_runs: of.has_runs,
            noise_bound: of.noise_bound,
            ..ModelDescription::new(parameters, of.logs)
        };
        LinearModel { description, residuals, columns }
    }

    /// The values of the parameters where the residuals were taken.
    pub fn values(&self) -> Vec<f64> {
        self.description.parameters.iter().map(|parameter| parameter.origin).collect()
    }

    /// The residual of a log at a point.
    fn residual(&self, of: &ResidualRequest) -> Vec<f64> {
        let mut residual = self.residuals[of.log].clone();
        let moved = of.u.iter().zip(&self.description.parameters).zip(&self.columns[of.log]);
        for ((u, parameter), column) in moved.filter(|((u, _), _)| **u != 0.0) {
            let by = u * parameter.size;
            residual.iter_mut().zip(column).for_each(|(r, x)| *r -= by * x);
        }
        residual
    }
}

/// A parameter without bounds and prior.
fn parameter(of: &LinearParameter, size: f64) -> FitParameter {
    FitParameter {
        name: of.name.clone(),
        unit: of.unit.clone(),
        origin: of.value,
        size,
        law: Parametrisation::Linear,
        bounds: (-FAR, FAR),
        spread: f64::INFINITY,
        known: None,
        reach: 1.0,
        amplitude: false,
    }
}

impl ResidualModel for LinearModel {
    fn description(&self) -> ModelDescription {
        self.description.clone()
    }

    fn residuals(&self, requests: &[ResidualRequest], _: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        requests.iter().map(|of| Ok(self.residual(of))).collect()
    }
}
