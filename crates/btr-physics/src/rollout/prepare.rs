//! Steps done once per rollout: checks, effects on the robot and the world, effects on sensor readings.

use crate::effects::{DryFriction, PlacedEffect, SiteKind};
use crate::engine::Dynamics;
use crate::robot::Robot;
use crate::setup::{EngineName, Setup, setup_error};
use btr_core::limits::MOST_REMEMBERED;
use btr_core::log::Log;
use btr_core::world::WorldError;
use std::borrow::Cow;

/// Checks that servos sample at physics steps, never within one, and remember no more readings than fit into memory.
pub(super) fn check_sampling(robot: &Robot, setup: &Setup) -> Result<(), WorldError> {
    for joint in robot.movable().map(|(_, link)| &link.joint) {
        let steps = joint.sampling.map_or(1.0, |sampling| sampling.period_s / setup.dt_s);
        if !(steps.round() >= 1.0 && (steps - steps.round()).abs() < 1e-6 * steps) {
            let name = &joint.name;
            return Err(setup_error(format!(
                "the servo of `{name}` samples every {steps} physics steps, not a whole number"
            )));
        }
        let readings = joint.sampling.map_or(0, |sampling| sampling.velocity_over as usize);
        check_remembered(&joint.name, readings)?;
    }
    Ok(())
}

/// Checks that linkages are valid and that the engine supports them.
pub(super) fn check_linkages(robot: &Robot, setup: &Setup) -> Result<(), WorldError> {
    let followers = robot.followers();
    for (i, (_, link)) in robot.movable().enumerate() {
        let Some(mimic) = &link.joint.mimic else { continue };
        let (name, leader) = (&link.joint.name, &mimic.leader);
        if followers.iter().all(|follower| follower.joint != i) {
            return Err(setup_error(format!("`{name}` mimics `{leader}`, which is not a movable joint")));
        }
        if setup.engine == EngineName::Rapier {
            let what = format!("`{name}` mimics `{leader}`, which the reference engine cannot simulate");
            return Err(setup_error(format!("{what}; leave out engine = \"rapier\"")));
        }
    }
    Ok(())
}

/// Refuses what would take too much memory in each joint.
fn check_remembered(name: &str, values: usize) -> Result<(), WorldError> {
    if values > MOST_REMEMBERED {
        let what = format!("{name} would remember {values} values; at most {MOST_REMEMBERED} are kept");
        return Err(setup_error(format!("{what}: take longer steps")));
    }
    Ok(())
}

/// Checks that the engine supports the effects, and that these fit into memory.
pub(super) fn check_effects(effects: &[PlacedEffect], setup: &Setup) -> Result<(), WorldError> {
    for placed in effects {
        check_remembered(placed.effect.spec().name, placed.effect.memory(&placed.values, setup.dt_s))?;
    }
    let creeps = |placed: &&PlacedEffect| placed.effect.dry_friction() == DryFriction::Changes;
    match effects.iter().find(creeps).filter(|_| setup.engine == EngineName::Rapier) {
        Some(placed) => Err(setup_error(format!(
            "{} is for the default engine: the reference engine holds joints rigidly; leave out engine = \"rapier\"",
            placed.effect.spec().name
        ))),
        None => Ok(()),
    }
}

/// Applies the effects on sensors to the log.
pub(super) fn sense(robot: &Robot, effects: &[PlacedEffect], log: &mut Log) -> Result<(), WorldError> {
    for placed in effects {
        match placed.effect.spec().site {
            SiteKind::Joint => {
                let joints = placed.joints(robot)?;
                for (_, (_, link)) in robot.movable().enumerate().filter(|(i, _)| joints.contains(i)) {
                    placed.effect.sense(&placed.values, &link.joint.name, log);
                }
            }
            _ => placed.effect.sense(&placed.values, &placed.site, log),
        }
    }
    Ok(())
}

/// Applies the effects that change the robot or the setup before the rollout.
pub(crate) fn apply_static_effects<'a>(
    robot: &'a Robot,
    effects: &[PlacedEffect],
    mut setup: Cow<'a, Setup>,
) -> Result<(Cow<'a, Robot>, Cow<'a, Setup>), WorldError> {
    if !robot.is_tree() {
        return Err(setup_error(format!("the links of `{}` are not a tree with parents first", robot.name)));
    }
    let mut robot = Cow::Borrowed(robot);
    if !robot.followers().is_empty() {
        robot.to_mut().settle_followers();
    }
    for placed in effects {
        match placed.effect.spec().site {
            SiteKind::Joint => {}
            SiteKind::Link => {
                for link in placed.links(&robot)? {
                    placed.effect.link(&placed.values, robot.to_mut(), link);
                }
            }
            SiteKind::Base | SiteKind::Ground | SiteKind::Robot => {
                placed.effect.world(&placed.values, setup.to_mut());
            }
        }
    }
    Ok((robot, setup))
}

pub(super) fn check(engine: &dyn Dynamics, time_s: f64) -> Result<(), WorldError> {
    engine.trouble().map_or(Ok(()), |what| Err(WorldError::Diverged { time_s, what }))
}
