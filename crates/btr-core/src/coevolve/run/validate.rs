//! Validation of plans.

use crate::coevolve::map::MapError;
use crate::coevolve::plan::{Method, Plan, Rule};
use crate::world::Simulator;

/// A plan that cannot be carried out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
// Exhaustive: btr-lab has a remedy for each.
pub enum PlanError {
    /// Controllers to search, but no search for them.
    #[error("there are {0} controller parameters to search, but the plan has no [coevolve.controllers]")]
    NoControllerSearch(usize),
    /// Simulations to search, but no search for them.
    #[error("there are {0} simulation parameters to search, but the plan has no [coevolve.simulators]")]
    NoSimulatorSearch(usize),
    /// A method that searches controllers, on a fixed drive.
    #[error("this method searches controllers, but the experiment's drive has no parameters")]
    NothingToControl,
    /// A posterior without a likelihood.
    #[error("[coevolve.posterior] needs a distance that uses the sensors' noise")]
    NoLikelihood,
    /// A rule of transfer that needs a posterior, without one.
    #[error("the rule `informative` needs [coevolve.posterior]")]
    NoPosterior,
    /// No iteration at all.
    #[error("`iterations` must be at least 1")]
    NoIterations,
    /// A map that cannot be made.
    #[error(transparent)]
    Map(#[from] MapError),
}

/// Whether the plan fits what is to be searched.
pub(super) fn check(plan: &Plan, simulator: &dyn Simulator) -> Result<(), PlanError> {
    let (c, s) = (simulator.controllers().len(), simulator.simulations().len());
    let needs_simulators =
        plan.posterior.is_none() && matches!(plan.method, Method::BackToReality | Method::EstimationExploration);
    match () {
        () if plan.iterations == 0 => Err(PlanError::NoIterations),
        () if c > 0 && plan.controllers.is_none() && plan.method != Method::QualityDiversity => {
            Err(PlanError::NoControllerSearch(c))
        }
        () if s > 0 && needs_simulators && plan.simulators.is_none() => Err(PlanError::NoSimulatorSearch(s)),
        () if plan.posterior.is_some() && !plan.distance.build().whitens() => Err(PlanError::NoLikelihood),
        () if plan.posterior.is_none() && plan.transfer.rule == Rule::Informative => Err(PlanError::NoPosterior),
        () if c == 0 && plan.method != Method::BackToReality => Err(PlanError::NothingToControl),
        () if plan.method == Method::QualityDiversity => Ok(check_map(plan, simulator)?),
        () => Ok(()),
    }
}

fn check_map(plan: &Plan, simulator: &dyn Simulator) -> Result<(), MapError> {
    if plan.posterior.is_some() {
        return Err(MapError::Posterior);
    }
    plan.map.as_ref().ok_or(MapError::Missing)?.check(simulator)
}
