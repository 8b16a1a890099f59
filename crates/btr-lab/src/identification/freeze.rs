//! Free parameters that a fit or a diagnosis keeps at the model's values.

use super::input::VerbInput;
use super::problem_error::ProblemError;
use btr_core::space::Dim;
use btr_physics::robot::site::is_like;

impl VerbInput {
    /// The same with the parameters whose names match one of the patterns kept at the model's values. `*` in a pattern
    /// matches any run of characters: `mass@*`, `coulomb_friction.*@*`.
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
        let is_frozen = |dim: &Dim| patterns.iter().any(|pattern| is_like(pattern, &dim.name));
        if let Some(dim) = dims.iter().find(|dim| is_frozen(dim) && dim.nominal.is_none()) {
            return Err(ProblemError::NoValueToFreeze(dim.name.clone()));
        }
        let (frozen, free): (Vec<usize>, Vec<usize>) = (0..dims.len()).partition(|&k| is_frozen(&dims[k]));
        self.frozen = frozen.into_iter().map(|k| dims[k].name.clone()).collect();
        self.problem.set_free(free);
        Ok(self)
    }

    /// The free parameters, without the frozen ones.
    pub fn free_dims(&self) -> impl Iterator<Item = &Dim> {
        let dims = self.problem.model().simulations.dims();
        self.problem.free().iter().map(|&k| &dims[k])
    }
}
