//! Base parameters: what logs of motion and torque tell about all of a robot's dynamic parameters.

use crate::identification::{ProblemError, VerbInput};
use crate::model_text::{StatedBody, with_bodies};
use btr_identify::base_parameters;
use btr_identify::base_parameters::{BaseParameters, Family, LinearModel, Membership};
use btr_identify::fit::FitPoint;
use btr_identify::residual_model::TimeStep;
use btr_physics::engine::turned_inertia;
use btr_physics::inertials::{
    BodyNames, Inertials, PER_BODY, PER_JOINT, PossibleParameters, StandardKind, StandardParameter, StatedInertials,
    moving_bodies,
};
use btr_physics::model::Model;
use btr_physics::robot::{Actuator, Base, Link};
use serde::Serialize;
use toml_edit::TomlError;

/// The answer, with the keys of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct BaseReport {
    /// The combinations that the logs tell, and the error that is left.
    #[serde(flatten)]
    pub base: BaseParameters,
    /// Whether rigid bodies can have them, and which; none where the model has no possible bodies to start from.
    pub possible: Option<PossibleReport>,
}

/// Values of all parameters that rigid bodies can have: those nearest to the model's among the ones that give the
/// estimated combinations best.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PossibleReport {
    /// Whether they give the estimates.
    pub membership: Membership,
    /// Root mean square of the combinations' deviations from the estimates, in standard deviations.
    pub distance: f64,
    /// Error with these values on training logs, in multiples of the noise floor.
    pub train: f64,
    /// Error with these values on held-out logs.
    pub held_out: Option<f64>,
    /// The bodies, from the base on.
    pub links: Vec<PossibleBody>,
}

/// A body with its joint, as a model's file states it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PossibleBody {
    /// The link in whose frame its inertial parameters are; links that are fixed to it are part of it.
    pub link: String,
    /// Its inertial parameters.
    #[serde(flatten)]
    pub inertials: StatedInertials,
    /// The joint that moves it.
    pub joint: String,
    /// Viscous friction, in N·m·s/rad (N·s/m).
    pub viscous: f64,
    /// Coulomb friction, in N·m (N).
    pub coulomb: f64,
    /// Constant torque that the motor has to deliver, in N·m (N).
    pub offset: f64,
    /// Rotor inertia seen at the joint, in kg·m² (kg).
    pub rotor: f64,
    /// Links that are fixed to it.
    #[serde(skip)]
    pub fixed: Vec<String>,
    /// Values of the effects on its joint with which the model has these, by name.
    #[serde(skip)]
    pub values: Vec<(String, f64)>,
}

/// The values of effects that are standard parameters of a joint, each with the place of the parameter.
const VALUES: [(&str, usize); 3] =
    [("viscous_friction.coefficient", 0), ("coulomb_friction.torque", 1), ("armature.inertia", 3)];

impl<'a> From<&'a PossibleBody> for StatedBody<'a> {
    fn from(body: &'a PossibleBody) -> Self {
        StatedBody {
            link: &body.link,
            fixed: &body.fixed,
            inertials: &body.inertials,
            joint: &body.joint,
            offset: body.offset,
            values: body.values.clone(),
        }
    }
}

impl PossibleReport {
    /// A model's text with these bodies, frictions, rotors and offsets.
    ///
    /// # Errors
    /// A text that is not TOML; it was parsed before, so this does not happen.
    pub(super) fn written_into(&self, text: &str) -> Result<String, TomlError> {
        with_bodies(text, &self.links.iter().map(StatedBody::from).collect::<Vec<_>>())
    }
}

impl VerbInput {
    /// Checks that base parameters can be asked for.
    ///
    /// # Errors
    /// [`ProblemError::NotPrescribed`] where the motion of a joint is simulated, [`ProblemError::FreeLength`] where a
    /// length is a parameter.
    pub fn check_base_parameters(&self) -> Result<(), ProblemError> {
        let model = self.problem.model();
        let floats = model.robot.base == Base::Floating;
        let simulated = |link: &&Link| floats || link.joint.actuator != Actuator::Prescribed;
        let simulated = model.robot.movable().map(|(_, link)| link).filter(simulated);
        let simulated: Vec<String> = simulated.map(|link| link.joint.name.clone()).collect();
        let length = model.simulations.dims().iter().find(|dim| dim.name.starts_with("length@"));
        match (simulated.is_empty(), length) {
            (false, _) => Err(ProblemError::NotPrescribed(simulated)),
            (true, Some(length)) => Err(ProblemError::FreeLength(length.name.clone())),
            (true, None) => Ok(()),
        }
    }
}

/// The base parameters of the input's robot, with everything that is not linear in them as fitted.
///
/// # Errors
/// See [`VerbInput::check_base_parameters`]; the reason why the model cannot be simulated.
pub fn base_parameters(input: &VerbInput, fit: &FitPoint, step: TimeStep) -> Result<BaseReport, ProblemError> {
    input.check_base_parameters()?;
    let standard = input.problem.model().standard_parameters();
    let regressor = input.problem.regressor(&fit.u, step)?;
    let base = base_parameters::base_parameters(&regressor, &groups(&standard))?;
    let otherwise = input.problem.without_values(&fit.u, &VALUES.map(|(name, _)| name))?;
    let possible = possible(input.problem.model(), &regressor, &base, &otherwise)?;
    Ok(BaseReport { base, possible })
}

/// The possible values that are nearest to the model's. `otherwise` has what the model states of each standard
/// parameter in another way than by [`VALUES`].
fn possible(
    model: &Model,
    regressor: &LinearModel,
    base: &BaseParameters,
    otherwise: &[f64],
) -> Result<Option<PossibleReport>, ProblemError> {
    let (bodies, values) = (moving_bodies(&model.robot), regressor.values());
    let family = Possible(PossibleParameters::around(&values, &typical(model, base, &values), bodies.len()));
    let Some(found) = base_parameters::nearest(base, &family) else { return Ok(None) };
    let (train, held_out) = base_parameters::errors_at(regressor, &found.values)?;
    let (of_bodies, of_joints) = found.values.split_at(PER_BODY * bodies.len());
    let joints = of_joints.chunks_exact(PER_JOINT).zip(otherwise[of_bodies.len()..].chunks_exact(PER_JOINT));
    let parts = of_bodies.chunks_exact(PER_BODY).zip(joints);
    let links = bodies.into_iter().zip(parts).map(|(names, (body, joint))| possible_body(names, body, joint)).collect();
    let (membership, distance) = (found.membership, found.distance);
    Ok(Some(PossibleReport { membership, distance, train, held_out, links }))
}

fn possible_body(
    BodyNames { link, joint, fixed }: BodyNames,
    body: &[f64],
    (of_joint, otherwise): (&[f64], &[f64]),
) -> PossibleBody {
    let inertials = Inertials::from_array(std::array::from_fn(|k| body[k]));
    let [viscous, coulomb, offset, rotor] = std::array::from_fn(|k| of_joint[k]);
    // What is stated otherwise stays as it is.
    let value = |(name, k): (&str, usize)| (format!("{name}@{joint}"), (of_joint[k] - otherwise[k]).max(0.0));
    let values = VALUES.map(value).to_vec();
    PossibleBody { link, inertials: (&inertials).into(), joint, viscous, coulomb, offset, rotor, fixed, values }
}

/// The order of magnitude of each parameter: that of its estimate where it leads a combination, and that of the inertia
/// which it moves for a rotor.
fn typical(model: &Model, base: &BaseParameters, values: &[f64]) -> Vec<f64> {
    let standard = model.standard_parameters();
    let carried = turned_inertia(&model.robot);
    let estimate = |name: &str| base.combinations.iter().find(|c| c.parts[0].parameter == name).map(|c| c.value.abs());
    let size = |(parameter, value): (&StandardParameter, &f64)| match parameter.kind {
        StandardKind::Rotor => carried.get(parameter.body - 1).copied().unwrap_or(1.0),
        _ => estimate(&parameter.name).unwrap_or(value.abs()),
    };
    standard.iter().zip(values).map(size).collect()
}

/// The standard parameters of rigid bodies, as a family to search.
struct Possible(PossibleParameters);

impl Family for Possible {
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.0.bounds()
    }

    fn at(&self, x: &[f64]) -> Option<Vec<f64>> {
        self.0.at(x)
    }
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
