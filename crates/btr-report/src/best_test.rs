//! The best real test of a run beside its simulations.

use btr_core::log::Log;
use btr_lab::experiment::Experiment;
use btr_lab::failure::Failure;
use btr_lab::run::Run;

/// The best real test, and what the simulations of the beginning and of the end do with its controller.
pub(crate) struct BestTest<'a> {
    pub(crate) number: usize,
    pub(crate) real: &'a Log,
    pub(crate) before: Log,
    pub(crate) after: Log,
}

impl<'a> BestTest<'a> {
    /// None where no controller was tested.
    ///
    /// # Errors
    /// A simulation that diverges.
    pub(crate) fn of(experiment: &Experiment, run: &'a Run) -> Result<Option<Self>, Failure> {
        let best = run.state().best_tested().and_then(|entry| Some((&entry.trial, &entry.behaviour()?.log)));
        let Some((trial, real)) = best else { return Ok(None) };
        let simulate = |s: &[f64]| {
            experiment.model.simulate(experiment.model.request(s, trial.scenario).controller(&trial.controller))
        };
        let (before, after) = (simulate(run.state().start())?, simulate(run.state().simulation())?);
        Ok(Some(BestTest { number: trial.number, real, before, after }))
    }
}
