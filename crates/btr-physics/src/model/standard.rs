//! The standard dynamic parameters of a model, and its inertial parameters as a whole.

use super::parameter::Target;
use super::{Model, ModelRequest, Scenario};
use crate::effects;
use crate::effects::PlacedEffect;
use crate::engine::Dof;
use crate::engine::assemble::bodies;
use crate::inertials::{MovingInertials, StandardParameter, standard_parameters, where_massless};
use crate::robot::Robot;
use crate::robot::site::matches;
use crate::rollout;
use btr_core::world::WorldError;
use std::borrow::Cow;

impl Model {
    /// Its standard parameters.
    pub fn standard_parameters(&self) -> Vec<StandardParameter> {
        standard_parameters(&self.robot)
    }

    /// What both rollouts must have whose difference is a column of the regressor.
    pub fn regressor_base(&self) -> Vec<PlacedEffect> {
        where_massless(&self.robot)
    }

    /// The values of its standard parameters at point `s` of S, with these values in the place of the model's own and
    /// further effects. Friction and offset are what [`Effect::joint`](crate::effects::Effect::joint) adds: what other
    /// laws do beside it is not linear in a parameter, and stays as it is. An offset is 0: it is no value of a model.
    ///
    /// # Errors
    /// An effect with invalid values or a site that the robot does not have.
    pub fn standard_values(
        &self,
        s: &[f64],
        values: &[(Target, f64)],
        further: &[PlacedEffect],
    ) -> Result<Vec<f64>, WorldError> {
        let (robot, placed) = self.acting(&Scenario::default(), s, values, further)?;
        let bodies: Vec<MovingInertials> = bodies(&robot).iter().skip(1).map(MovingInertials::from).collect();
        let of_joint = |body: &MovingInertials| {
            let joint = &robot.links[body.link].joint;
            let here = placed.iter().filter(|p| p.effect.spec().site.is_on_joints() && matches(&p.site, &joint.name));
            let mut dof = Dof::passive(joint);
            here.for_each(|p| p.effect.joint(&p.values, &mut dof));
            [dof.torque.damping, dof.dry_friction, 0.0, dof.armature]
        };
        let of_bodies = bodies.iter().flat_map(|body| body.inertials.to_array());
        Ok(of_bodies.chain(bodies.iter().flat_map(of_joint)).collect())
    }

    /// The inertial parameters of all moving bodies at a point, one body after the other: the torques of a prescribed
    /// motion are linear in them.
    ///
    /// # Errors
    /// An effect with invalid values or a site that the robot does not have.
    pub fn inertias(&self, at: &ModelRequest) -> Result<Vec<f64>, WorldError> {
        let (robot, _) = self.acting(at.scenario, at.s, at.values, at.effects)?;
        let moving = bodies(&robot);
        Ok(moving.iter().skip(1).flat_map(|body| MovingInertials::from(body).inertials.to_array()).collect())
    }

    /// The robot as effects on its links leave it, and the effects that are not off.
    fn acting(
        &self,
        scenario: &Scenario,
        s: &[f64],
        values: &[(Target, f64)],
        further: &[PlacedEffect],
    ) -> Result<(Robot, Vec<PlacedEffect>), WorldError> {
        let (robot, mut placed, setup) = self.in_scenario(scenario, s, values);
        placed.extend_from_slice(further);
        let placed = effects::in_force(&placed)?;
        let (robot, _) = rollout::apply_static_effects(&robot, &placed, Cow::Borrowed(&setup))?;
        Ok((robot.into_owned(), placed))
    }
}
