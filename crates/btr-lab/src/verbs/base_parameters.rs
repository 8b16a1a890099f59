//! Base parameters: what logs of motion and torque tell about all of a robot's dynamic parameters.

use crate::identification::{ProblemError, VerbInput};
use btr_identify::base_parameters;
use btr_identify::base_parameters::BaseParameters;
use btr_identify::fit::FitPoint;
use btr_identify::residual_model::TimeStep;
use btr_physics::inertials::{StandardKind, StandardParameter};
use btr_physics::robot::{Actuator, Base, Link};
use serde::Serialize;

/// The answer, with the keys of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct BaseReport {
    /// The combinations that the logs tell, and the error that is left.
    #[serde(flatten)]
    pub base: BaseParameters,
}

impl VerbInput {
    /// Checks that the motion of every joint is prescribed.
    ///
    /// # Errors
    /// [`ProblemError::NotPrescribed`] otherwise.
    pub fn check_prescribed(&self) -> Result<(), ProblemError> {
        let robot = &self.problem.model().robot;
        let simulated = |link: &&Link| robot.base == Base::Floating || link.joint.actuator != Actuator::Prescribed;
        let simulated = robot.movable().map(|(_, link)| link).filter(simulated);
        let simulated: Vec<String> = simulated.map(|link| link.joint.name.clone()).collect();
        if simulated.is_empty() { Ok(()) } else { Err(ProblemError::NotPrescribed(simulated)) }
    }
}

/// The base parameters of the input's robot, with everything that is not linear in them as fitted.
///
/// # Errors
/// [`ProblemError::NotPrescribed`]; the reason why the model cannot be simulated.
pub fn base_parameters(input: &VerbInput, fit: &FitPoint, step: TimeStep) -> Result<BaseReport, ProblemError> {
    input.check_prescribed()?;
    let standard = input.problem.model().standard_parameters();
    let regressor = input.problem.regressor(&fit.u, step)?;
    let base = base_parameters::base_parameters(&regressor, &groups(&standard))?;
    Ok(BaseReport { base })
}

/// Which parameters lead combinations: friction, then the moments of one body after another from the base on, as in the
/// literature. Masses are added to the moments of the body that carries them, rotors to inertias.
fn groups(standard: &[StandardParameter]) -> Vec<usize> {
    let bodies = standard.iter().map(|parameter| parameter.body).max().unwrap_or(0);
    let group = |parameter: &StandardParameter| match parameter.kind {
        StandardKind::Friction | StandardKind::Offset => 0,
        StandardKind::Moment => parameter.body,
        StandardKind::Mass => bodies + 1,
        StandardKind::Rotor => bodies + 2,
    };
    standard.iter().map(group).collect()
}
