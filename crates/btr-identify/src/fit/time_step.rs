//! The error of a time step, and when it requires a finer one: in fits, in diagnoses and in comparisons.

use crate::residual_model::TimeStep;

/// Largest integrator error, root mean square in noise floors, that needs no finer step...
const FINE_ENOUGH: f64 = 0.2;
/// ... and the largest divisor of the model's time step.
const FINEST: u32 = 4;

/// Half a step, if one of the integrator's errors, root mean square in noise floors, requires it; `None` for the finest
/// step that is used. Errors after the first that requires it are not asked for, and none for the finest step.
pub fn finer_step(step: TimeStep, errors: impl IntoIterator<Item = f64>) -> Option<TimeStep> {
    let refines = step.divides_by() < FINEST && errors.into_iter().any(|error| error > FINE_ENOUGH);
    refines.then(|| step.halved())
}

/// Factor from the change by halving a step to the change by a step of zero (L. F. Richardson 1911): 2 for a method of
/// first order, 4/3 for one of second order.
pub fn extrapolation(order: i32) -> f64 {
    1.0 + 1.0 / (2.0f64.powi(order) - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_halved_while_its_error_shows_and_at_most_twice() {
        let half = finer_step(TimeStep::USUAL, [0.1, 0.3]);
        assert_eq!(half, Some(TimeStep::USUAL.halved()));
        let quarter = half.and_then(|step| finer_step(step, [0.3]));
        assert_eq!(quarter.map(TimeStep::divides_by), Some(4));
        assert_eq!(quarter.and_then(|step| finer_step(step, [0.3])), None);
        assert_eq!(finer_step(TimeStep::USUAL, [0.2, f64::NAN]), None);
    }

    #[test]
    fn errors_are_asked_for_only_until_one_decides() {
        let asked = std::cell::Cell::new(0);
        let errors = || [0.3, 0.1].into_iter().inspect(|_| asked.set(asked.get() + 1));
        assert!(finer_step(TimeStep::USUAL, errors()).is_some() && asked.get() == 1);
        assert!(finer_step(TimeStep::of_halvings(2), errors()).is_none() && asked.get() == 1);
    }
}
