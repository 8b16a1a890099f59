//! What a model comes to: its robot with all that is known of it, for other simulators.

use super::Model;
use crate::effects::{PlacedEffect, SiteKind, in_force};
use crate::robot::Robot;
use crate::rollout::apply_static_effects;
use btr_core::world::WorldError;
use std::borrow::Cow;

/// A robot at a model's values, and the effects that act on it.
#[derive(Clone, Debug)]
pub struct Outline {
    /// The robot, with the effects on its links: a payload is part of the link's mass.
    pub robot: Robot,
    /// The effects in each joint, in the order of [`Robot::movable`].
    pub joints: Vec<Vec<PlacedEffect>>,
    /// The effects on the base, the ground or the whole robot.
    pub others: Vec<PlacedEffect>,
}

impl Model {
    /// The robot at the model's values, which are those of its file.
    ///
    /// # Errors
    /// An effect at a site that the robot does not have, or with values that it does not allow.
    pub fn outline(&self) -> Result<Outline, WorldError> {
        let (mut robot, mut effects, mut setup) = (self.robot.clone(), self.effects.clone(), self.setup.clone());
        for (target, value) in self.targets.iter().zip(self.simulations.nominal()) {
            target.set(value, &mut robot, &mut effects, &mut setup);
        }
        let effects = in_force(&effects)?;
        let robot = apply_static_effects(&robot, &effects, Cow::Owned(setup))?.0.into_owned();
        let mut joints = vec![Vec::new(); robot.movable().count()];
        let mut others = Vec::new();
        for placed in effects {
            match placed.effect.spec().site {
                SiteKind::Joint => {
                    placed.joints(&robot)?.into_iter().for_each(|joint| joints[joint].push(placed.clone()));
                }
                // Applied to the robot.
                SiteKind::Link => {}
                SiteKind::Base | SiteKind::Ground | SiteKind::Robot => others.push(placed),
            }
        }
        Ok(Outline { robot, joints, others })
    }
}
