//! Which parameters of the model a fit or a diagnosis keeps at their values, and which have a prior of earlier logs.

use super::VerbInput;
use crate::identification::problem_error::ProblemError;
use btr_core::space::Dim;
use btr_physics::robot::site::is_like;

impl VerbInput {
    /// The same with the parameters whose names match one of the patterns kept at the model's values; what is added to
    /// the model stays free. `*` in a pattern matches any run of characters: `mass@*`, `coulomb_friction.*@*`.
    ///
    /// # Errors
    /// A pattern that matches no parameter; a parameter for which the model has no single value.
    pub fn freezing(mut self, patterns: &[String]) -> Result<Self, ProblemError> {
        let dims = self.problem.model().simulations.dims();
        for pattern in patterns {
            if !dims.iter().any(|dim| is_like(pattern, &dim.name)) {
                let known = dims.iter().map(|dim| dim.name.clone()).collect();
                return Err(ProblemError::FreezesNothing { pattern: pattern.clone(), known });
            }
        }
        let is_frozen =
            |dim: &Dim| !self.added.contains(&dim.name) && patterns.iter().any(|pattern| is_like(pattern, &dim.name));
        if let Some(dim) = dims.iter().find(|dim| is_frozen(dim) && dim.nominal.is_none()) {
            return Err(ProblemError::NoValueToFreeze(dim.name.clone()));
        }
        let (frozen, free): (Vec<usize>, Vec<usize>) = (0..dims.len()).partition(|&k| is_frozen(&dims[k]));
        self.frozen = frozen.into_iter().map(|k| dims[k].name.clone()).collect();
        self.problem.set_free(free);
        if let Some(before) = &mut self.before {
            before.freeze_as(&self.frozen);
        }
        Ok(self)
    }

    /// Keeps the parameters of these names at the model's values.
    fn freeze_as(&mut self, frozen: &[String]) {
        let dims = self.problem.model().simulations.dims();
        let free = (0..dims.len()).filter(|&k| !frozen.contains(&dims[k].name)).collect();
        self.problem.set_free(free);
    }

    /// The free parameters, without the frozen ones.
    pub fn free_dims(&self) -> impl Iterator<Item = &Dim> {
        let dims = self.problem.model().simulations.dims();
        self.problem.free().iter().map(|&k| &dims[k])
    }

    /// The standard deviation that earlier logs leave of a parameter, in its unit.
    pub(crate) fn earlier_sd(&self, name: &str) -> Option<f64> {
        let model = self.problem.model();
        model.prior_sd(model.simulations.dims().iter().position(|dim| dim.name == name)?)
    }

    /// The free parameters whose prior is what earlier logs left, by name.
    pub fn with_prior(&self) -> Vec<String> {
        let names = self.free_dims().map(|dim| dim.name.as_str());
        names.filter(|name| self.earlier_sd(name).is_some()).map(str::to_owned).collect()
    }
}
