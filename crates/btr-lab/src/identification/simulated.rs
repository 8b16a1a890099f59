//! Simulations of the model at a point of the identification problem.

use super::catalogue::law_terms;
use super::catalogue::law_terms::TermDefinition;
use super::problem::{Change, IdentificationProblem};
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_identify::diagnose::ResidualLaw;
use btr_identify::residual_model::{EffectCandidate, TimeStep};
use btr_physics::effects::{Effect, FormulaTarget, Param, PlacedEffect};
use btr_physics::model::parameter::Target;
use btr_physics::model::{Model, ModelRequest, Scenario};

/// The model at a point: the values of its free parameters, the values that differ from its own, and further effects.
pub(crate) struct ModelPoint {
    s: Vec<f64>,
    values: Vec<(Target, f64)>,
    effects: Vec<PlacedEffect>,
}

impl ModelPoint {
    /// The same with further effects.
    pub(crate) fn and(mut self, effects: &[PlacedEffect]) -> Self {
        self.effects.extend_from_slice(effects);
        self
    }

    /// The same with these values in the place of the model's.
    pub(crate) fn with(mut self, values: impl IntoIterator<Item = (Target, f64)>) -> Self {
        self.values.extend(values);
        self
    }

    /// The values of the model's standard parameters at this point.
    ///
    /// # Errors
    /// An effect with invalid values.
    pub(crate) fn standard_values(&self, model: &Model) -> Result<Vec<f64>, WorldError> {
        model.standard_values(&self.s, &self.values, &self.effects)
    }

    /// A rollout at this point.
    pub(crate) fn request<'a>(&'a self, scenario: &'a Scenario) -> ModelRequest<'a> {
        ModelRequest::new(&self.s, scenario).values(&self.values).effects(&self.effects)
    }
}

impl IdentificationProblem {
    /// Simulates the log of a scenario at a point; with windows, from the initial state of each window.
    ///
    /// # Errors
    /// A simulation that diverged.
    pub fn simulate(&self, u: &[f64], scenario: usize, step: TimeStep) -> Result<Log, WorldError> {
        self.simulate_in(u, &self.situations[scenario], step)
    }

    /// Simulates a given scenario at a point.
    ///
    /// # Errors
    /// A simulation that diverged.
    pub fn simulate_in(&self, u: &[f64], scenario: &Scenario, step: TimeStep) -> Result<Log, WorldError> {
        self.model.simulate(self.at(u).request(scenario).time_step(step))
    }

    /// The values of the model's own parameters at a point.
    pub(crate) fn inner(&self, u: &[f64]) -> Vec<f64> {
        self.own().map(|k| self.inside(k, self.parameters[k].value(u[k]))).collect()
    }

    /// The model at a point.
    pub(crate) fn at(&self, u: &[f64]) -> ModelPoint {
        ModelPoint { s: self.inner(u), values: self.corrected(u), effects: self.placed(u) }
    }

    /// The values that differ from the model's own at a point.
    fn corrected(&self, u: &[f64]) -> Vec<(Target, f64)> {
        let values = |(candidate, change): (&EffectCandidate, &Change)| match change {
            Change::Values(targets) => {
                let set = targets.iter().cloned().zip(candidate.parameters()).filter(|(_, k)| u[*k] != 0.0);
                set.map(|(target, k)| (target, self.parameters[k].value(u[k]))).collect()
            }
            Change::Effect(_) => Vec::new(),
        };
        self.candidates.iter().zip(&self.changes).flat_map(values).collect()
    }

    /// The effects that are switched on at a point.
    pub fn placed(&self, u: &[f64]) -> Vec<PlacedEffect> {
        let on = |candidate: &&EffectCandidate| candidate.amplitudes.iter().any(|&k| u[k] != 0.0);
        let place = |(candidate, change): (&EffectCandidate, &Change)| match change {
            Change::Effect(effect) if on(&candidate) => Some(self.place(candidate, *effect, u)),
            Change::Effect(_) | Change::Values(_) => None,
        };
        let effects = self.candidates.iter().zip(&self.changes).filter_map(place);
        let terms = self.features.iter().zip(&self.terms).filter(|(feature, _)| on(&&feature.term));
        let terms = terms.map(|(feature, (_, effect))| {
            let values = feature.term.parameters().map(|k| self.parameters[k].value(u[k])).collect();
            PlacedEffect { effect: *effect, site: feature.term.site.clone(), values }
        });
        effects.chain(terms).collect()
    }

    /// The site of a law, the quantity that it changes, and its text.
    pub fn law(&self, law: &ResidualLaw) -> Option<(String, FormulaTarget, String)> {
        let first = *law.terms.first()?;
        let values = |&i: &usize| {
            let parameters = self.features[i].term.parameters();
            (&self.terms[i].0, parameters.map(|k| self.parameters[k].value(law.fit.u[k])).collect())
        };
        let on = self.terms[first].0.on;
        let terms: Vec<(&TermDefinition, Vec<f64>)> = law.terms.iter().map(values).collect();
        Some((self.features[first].term.site.clone(), on, law_terms::law(on, &terms)))
    }

    fn place(&self, candidate: &EffectCandidate, effect: &'static dyn Effect, u: &[f64]) -> PlacedEffect {
        let (mut amplitudes, mut shapes) = (candidate.amplitudes.iter(), candidate.shapes.iter());
        let parameter = |param: &Param| if param.shape { shapes.next() } else { amplitudes.next() };
        let parameters: Vec<Option<&usize>> = effect.spec().params.iter().map(parameter).collect();
        // Rounding must not carry a value across the bound at which its sign would change.
        let least = |param: &Param| param.bounds.0.min(0.0);
        let value = |(parameter, param): (Option<&usize>, &Param)| {
            parameter.map_or(param.off, |&k| self.parameters[k].value(u[k]).max(least(param)))
        };
        let values = parameters.into_iter().zip(effect.spec().params).map(value).collect();
        PlacedEffect { effect, site: candidate.site.clone(), values }
    }

    /// Rounding must not carry a value across its bound.
    fn inside(&self, k: usize, value: f64) -> f64 {
        let dim = &self.model.simulations.dims()[k];
        value.clamp(dim.min, dim.max)
    }
}
