//! Batched rollouts: candidates for the same robot advance together, each in a lane of one engine; commands, motors,
//! effects and sensors are separate.

use super::prepared::PreparedRollout;
use crate::engine::Dynamics;
use crate::engine::articulated;
use crate::robot::Robot;
use crate::setup::Setup;
use btr_core::log::Log;
use btr_core::world::WorldError;
use pulp::Arch;

/// Simulates several rollouts, in their order. Consecutive ones that differ only in values are batched, up to the
/// number of SIMD lanes; each result equals that of the rollout alone.
pub(super) fn simulate_all(runs: Vec<Result<PreparedRollout, WorldError>>) -> Vec<Result<Log, WorldError>> {
    let mut logs = Vec::with_capacity(runs.len());
    let (max_lanes, mut group) = (lanes(), Vec::<PreparedRollout>::new());
    for run in runs {
        let joins =
            |run: &PreparedRollout| group.len() < max_lanes && group.iter().all(|first| first.can_batch_with(run));
        match run {
            Ok(run) if joins(&run) => group.push(run),
            Ok(run) => logs.extend(run_group(std::mem::replace(&mut group, vec![run]))),
            Err(error) => {
                logs.extend(run_group(std::mem::take(&mut group)));
                logs.push(Err(error));
            }
        }
    }
    logs.extend(run_group(group));
    logs
}

/// Number of SIMD lanes on this machine: how many candidates it simulates side by side.
pub fn lanes() -> usize {
    articulated::lanes()
}

/// Simulates rollouts with equally many steps of equal length.
fn run_group(runs: Vec<PreparedRollout>) -> Vec<Result<Log, WorldError>> {
    let candidates: Vec<(&Robot, &Setup)> = runs.iter().map(|run| (&*run.robot, &*run.setup)).collect();
    // The narrowest registers that are wide enough.
    let fits = |arch: &Arch| articulated::width(*arch) >= runs.len();
    let arch = articulated::widths().into_iter().rfind(fits).filter(|_| runs.len() > 1);
    match arch.and_then(|arch| articulated::engine_of_several(arch, &candidates)) {
        Some(mut engine) => run_batch(engine.as_mut(), runs),
        None => runs.into_iter().flat_map(run_single).collect(),
    }
}

/// Simulates a single rollout on its own engine.
fn run_single(run: PreparedRollout) -> Vec<Result<Log, WorldError>> {
    match run.engine() {
        Ok(mut engine) => run_batch(engine.as_mut(), vec![run]),
        Err(error) => vec![Err(error)],
    }
}

/// Simulates a batch, each rollout in its lane of an engine. Rollouts that diverge are dropped; the others continue.
pub(super) fn run_batch(engine: &mut dyn Dynamics, mut runs: Vec<PreparedRollout>) -> Vec<Result<Log, WorldError>> {
    settle(engine, &mut runs);
    for step in 0..=runs.first().map_or(0, PreparedRollout::steps) {
        if runs.iter().all(|run| run.failed.is_some()) {
            break;
        }
        if step > 0 {
            for_each_running(engine, &mut runs, &mut |run, engine| run.before_step(step, engine));
            engine.step();
        }
        for_each_running(engine, &mut runs, &mut |run, engine| run.after_step(step, engine));
    }
    let finish = |(lane, run): (usize, PreparedRollout)| {
        engine.select_lane(lane);
        run.finish(engine)
    };
    runs.into_iter().enumerate().map(finish).collect()
}

/// Calls `action` for each rollout that has not failed, with its lane selected.
fn for_each_running(
    engine: &mut dyn Dynamics,
    runs: &mut [PreparedRollout],
    action: &mut dyn FnMut(&mut PreparedRollout, &mut dyn Dynamics),
) {
    for (lane, run) in runs.iter_mut().enumerate().filter(|(_, run)| run.failed.is_none()) {
        engine.select_lane(lane);
        action(run, engine);
    }
}

/// Lets servos, friction and the floor settle before time zero.
fn settle(engine: &mut dyn Dynamics, runs: &mut [PreparedRollout]) {
    for left in (1..=runs.first().map_or(0, |run| run.rest_steps)).rev() {
        for_each_running(engine, runs, &mut |run, engine| {
            let time_s = -(left as f64) * run.setup.dt_s;
            run.control.update_references(time_s, engine);
            run.control.act(time_s, engine);
        });
        engine.step();
        for_each_running(engine, runs, &mut |run, engine| run.check(engine, -(left as f64) * run.setup.dt_s));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::drive::{Drive, NaoWalk};
    use crate::effects::{PlacedEffect, find};
    use crate::presets::ant;
    use crate::presets::nao::nao;
    use crate::robot::Base;
    use crate::rollout::{RolloutRequest, simulate};
    use crate::setup::Ball;
    use nalgebra::{Point3, Vector3};

    /// A robot, its setup, its drive and its effects.
    type Scene = (Robot, Setup, Box<dyn Drive>, Vec<PlacedEffect>);

    const CANDIDATES: usize = 8;
    /// The candidate that diverges.
    const DIVERGING: usize = 4;
    /// A candidate with dry friction.
    const CREEPING: usize = 7;

    fn scene(name: &str) -> Scene {
        let setup = Setup { dt_s: 0.002, duration_s: 0.6, control_s: 0.055, interpolate: true, ..Setup::default() };
        let ball = Ball {
            radius_m: 0.03,
            mass_kg: 0.05,
            start_m: Point3::new(0.12, 0.02, 0.03),
            friction: 0.5,
            restitution: 0.4,
            rolling_damping_per_s: 0.5,
        };
        match name {
            "ant" => (ant::ant(), setup, Box::new(ant::tripod()), Vec::new()),
            "bolted" => {
                let robot = Robot { base: Base::Fixed, ..ant::ant() };
                (robot, Setup { ground: None, ..setup }, Box::new(ant::tripod()), Vec::new())
            }
            _ => {
                let walk = NaoWalk::new(&nao(), &NaoWalk::space().unwrap().nominal(), setup.duration_s).unwrap();
                let ball = (name == "nao with a ball").then_some(ball);
                (nao(), Setup { ball, ..setup }, Box::new(walk), Vec::new())
            }
        }
    }

    /// Some fall over, some slide, some have dry friction, which creeps in one of them, and one diverges.
    fn candidate(name: &str, number: usize) -> Scene {
        let (mut robot, mut setup, drive, mut effects) = scene(name);
        drive.place(&mut robot);
        let share = number as f64 / CANDIDATES as f64;
        for (i, link) in robot.links.iter_mut().enumerate() {
            link.mass_kg *= 1.0 + 0.2 * share * (i as f64).sin();
            link.joint.dry_friction = if number % 3 == 1 { 0.02 } else { 0.0 };
            if number == DIVERGING {
                link.joint.damping = -40.0;
            }
        }
        if let Some(ground) = &mut setup.ground {
            ground.friction = 0.2 + 0.6 * share;
        }
        setup.gravity_m_s2 = Vector3::new(3.0 * share, 0.0, -9.81);
        if number == CREEPING {
            let creep = find("friction_creep").unwrap();
            effects.push(PlacedEffect { effect: creep, site: "*".to_owned(), values: vec![2.0, 0.01] });
        }
        (robot, setup, drive, effects)
    }

    fn request((robot, setup, drive, effects): &Scene) -> RolloutRequest<'_> {
        RolloutRequest::new(robot, &**drive).setup(setup).effects(effects)
    }

    fn run(scene: &Scene) -> PreparedRollout<'_> {
        PreparedRollout::new(request(scene)).unwrap()
    }

    #[test]
    fn batched_rollouts_equal_single_ones_bit_by_bit() {
        for name in ["ant", "nao", "nao with a ball", "bolted"] {
            let scenes: Vec<Scene> = (0..CANDIDATES).map(|number| candidate(name, number)).collect();
            let single: Vec<Result<Log, WorldError>> = scenes.iter().map(|scene| simulate(request(scene))).collect();
            assert!(single.iter().enumerate().all(|(i, log)| log.is_err() == (i == DIVERGING)), "{name}");
            let worlds: Vec<(&Robot, &Setup)> = scenes.iter().map(|(robot, setup, ..)| (robot, setup)).collect();
            for arch in articulated::widths() {
                let lanes = articulated::width(arch);
                let few = |from: usize| from..(from + lanes).min(CANDIDATES);
                let run_batch = |from: usize| {
                    let mut engine = articulated::engine_of_several(arch, &worlds[few(from)]).unwrap();
                    run_batch(engine.as_mut(), scenes[few(from)].iter().map(run).collect())
                };
                let logs: Vec<_> = (0..CANDIDATES).step_by(lanes).flat_map(run_batch).collect();
                assert!(logs == single, "{name} in {lanes} lanes");
            }
        }
    }

    #[test]
    fn logs_of_different_robots_keep_their_order() {
        let scenes: Vec<Scene> = ["ant", "ant", "nao", "bolted", "ant"].into_iter().map(scene).collect();
        let logs = simulate_all(scenes.iter().map(|scene| Ok(run(scene))).collect());
        for (scene, log) in scenes.iter().zip(logs) {
            assert_eq!(log, simulate(request(scene)));
        }
    }
}
