//! The regressor of a robot whose motion is prescribed: by how much the required torques grow with a unit of each of
//! its standard parameters. Its columns are differences of simulations, so that they are differentiated and smoothed as
//! the compared torques are.

use super::problem::IdentificationProblem;
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_identify::base_parameters::{LinearModel, LinearParameter};
use btr_identify::residual_model::{ResidualModel, TimeStep};
use btr_physics::effects::PlacedEffect;
use btr_physics::inertials::StandardParameter;
use btr_physics::model::parameter::Target;
use rayon::prelude::*;

/// For each log of a scenario, its index and its column.
type Columns = Vec<(usize, Vec<f64>)>;

impl IdentificationProblem {
    /// The problem at a point as a linear model of the robot's standard parameters.
    ///
    /// # Errors
    /// The reason why the model cannot be simulated there.
    pub(crate) fn regressor(&self, u: &[f64], step: TimeStep) -> Result<LinearModel, WorldError> {
        let standard = self.model.standard_parameters();
        let values = self.at(u).standard_values(&self.model)?;
        let residuals = self.residuals_at(u, step)?;
        let mut columns = vec![vec![Vec::new(); standard.len()]; self.logs.len()];
        for scenario in 0..self.situations.len() {
            for (k, of_logs) in self.columns(u, scenario, &standard, step)?.into_iter().enumerate() {
                of_logs.into_iter().for_each(|(log, column)| columns[log][k] = column);
            }
        }
        let parameter = |(parameter, value): (&StandardParameter, f64)| LinearParameter {
            name: parameter.name.clone(),
            unit: parameter.unit.to_owned(),
            value,
        };
        let parameters: Vec<LinearParameter> = standard.iter().zip(values).map(parameter).collect();
        Ok(LinearModel::new(self.description(), &parameters, residuals, columns))
    }

    /// The values of the standard parameters at a point without those of these effects on joints, by name.
    ///
    /// # Errors
    /// An effect with invalid values.
    pub(crate) fn without_values(&self, u: &[f64], names: &[&str]) -> Result<Vec<f64>, WorldError> {
        let joints = self.model.robot.movable().map(|(_, link)| &link.joint.name);
        let all = joints.flat_map(|joint| names.iter().map(move |name| format!("{name}@{joint}")));
        let off = |name: String| Target::parse(&name, &self.model.robot).ok().map(|target| (target, 0.0));
        self.at(u).with(all.filter_map(off)).standard_values(&self.model)
    }

    /// The residual of every log at a point.
    fn residuals_at(&self, u: &[f64], step: TimeStep) -> Result<Vec<Vec<f64>>, WorldError> {
        let scenarios = (0..self.situations.len()).into_par_iter();
        let simulated: Vec<Log> =
            scenarios.map(|scenario| self.simulate(u, scenario, step)).collect::<Result<_, WorldError>>()?;
        let of_log = |log: usize| self.against(log, &simulated[self.parts[log].scenario]);
        (0..self.logs.len()).map(of_log).collect()
    }

    /// The columns of a scenario's logs, one per parameter.
    fn columns(
        &self,
        u: &[f64],
        scenario: usize,
        standard: &[StandardParameter],
        step: TimeStep,
    ) -> Result<Vec<Columns>, WorldError> {
        let base = self.model.regressor_base();
        let logs: Vec<usize> = (0..self.logs.len()).filter(|&log| self.parts[log].scenario == scenario).collect();
        let residuals = |effects: &[PlacedEffect]| {
            let point = self.at(u).and(&base).and(effects);
            let simulated = self.model.simulate(point.request(&self.situations[scenario]).time_step(step))?;
            logs.iter().map(|&log| self.against(log, &simulated)).collect::<Result<Vec<_>, WorldError>>()
        };
        let usual = residuals(&[])?;
        let of_parameter = |parameter: &StandardParameter| {
            let moved = residuals(std::slice::from_ref(parameter.one_more()))?;
            let grown = |(usual, moved): (&Vec<f64>, Vec<f64>)| usual.iter().zip(moved).map(|(a, b)| a - b).collect();
            Ok(logs.iter().copied().zip(usual.iter().zip(moved).map(grown)).collect())
        };
        standard.par_iter().map(of_parameter).collect()
    }
}
