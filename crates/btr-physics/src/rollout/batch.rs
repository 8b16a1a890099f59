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
    let (most, mut group) = (lanes(), Vec::<PreparedRollout>::new());
    for run in runs {
        let joins = |run: &PreparedRollout| group.len() < most && group.iter().all(|first| first.is_like(run));
        match run {
            Ok(run) if joins(&run) => group.push(run),
            Ok(run) => logs.extend(side_by_side(std::mem::replace(&mut group, vec![run]))),
            Err(error) => {
                logs.extend(side_by_side(std::mem::take(&mut group)));
                logs.push(Err(error));
            }
        }
    }
    logs.extend(side_by_side(group));
    logs
}

/// Number of SIMD lanes on this machine: how many candidates it simulates side by side.
pub fn lanes() -> usize {
    articulated::lanes()
}

/// Simulates rollouts with equally many steps of equal length.
fn side_by_side(runs: Vec<PreparedRollout>) -> Vec<Result<Log, WorldError>> {
    let candidates: Vec<(&Robot, &Setup)> = runs.iter().map(|run| (&*run.robot, &*run.setup)).collect();
    // The narrowest registers that are wide enough.
    let fits = |arch: &Arch| articulated::width(*arch) >= runs.len();
    let arch = articulated::widths().into_iter().rfind(fits).filter(|_| runs.len() > 1);
    match arch.and_then(|arch| articulated::engine_of_several(arch, &candidates)) {
        Some(mut engine) => together(engine.as_mut(), runs),
        None => runs.into_iter().flat_map(alone).collect(),
    }
}

/// Simulates a single rollout on its own engine.
fn alone(run: PreparedRollout) -> Vec<Result<Log, WorldError>> {
    match run.engine() {
        Ok(mut engine) => together(engine.as_mut(), vec![run]),
        Err(error) => vec![Err(error)],
    }
}

/// Simulates a batch, each rollout in its lane of an engine. Rollouts that diverge are dropped; the others continue.
pub(super) fn together(engine: &mut dyn Dynamics, mut runs: Vec<PreparedRollout>) -> Vec<Result<Log, WorldError>> {
    rest(engine, &mut runs);
    for step in 0..=runs.first().map_or(0, PreparedRollout::steps) {
        if runs.iter().all(|run| run.failed.is_some()) {
            break;
        }
        if step > 0 {
            each(engine, &mut runs, &mut |run, engine| run.prepare(step, engine));
            engine.step();
        }
        each(engine, &mut runs, &mut |run, engine| run.observe(step, engine));
    }
    let finish = |(lane, run): (usize, PreparedRollout)| {
        engine.turn_to(lane);
        run.finish(engine)
    };
    runs.into_iter().enumerate().map(finish).collect()
}

/// Calls `action` for each rollout that has not failed, with its lane selected.
fn each(
    engine: &mut dyn Dynamics,
    runs: &mut [PreparedRollout],
    act: &mut dyn FnMut(&mut PreparedRollout, &mut dyn Dynamics),
) {
    for (lane, run) in runs.iter_mut().enumerate().filter(|(_, run)| run.failed.is_none()) {
        engine.turn_to(lane);
        act(run, engine);
    }
}

/// Lets servos, friction and the floor settle before time zero.
fn rest(engine: &mut dyn Dynamics, runs: &mut [PreparedRollout]) {
    for left in (1..=runs.first().map_or(0, |run| run.rests)).rev() {
        each(engine, runs, &mut |run, engine| {
            let time_s = -(left as f64) * run.setup.dt_s;
            run.control.listen(time_s, engine);
            run.control.act(time_s, engine);
        });
        engine.step();
        each(engine, runs, &mut |run, engine| run.check(engine, -(left as f64) * run.setup.dt_s));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::drive::{Drive, NaoWalk};
    use crate::presets::ant;
    use crate::presets::nao::nao;
    use crate::robot::Base;
    use crate::rollout::{RolloutRequest, simulate};
    use crate::setup::Ball;
    use nalgebra::{Point3, Vector3};

    /// A robot, its setup and its drive.
    type Scene = (Robot, Setup, Box<dyn Drive>);

    const CANDIDATES: usize = 8;
    /// The candidate that diverges.
    const TORN: usize = 4;

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
            "ant" => (ant::ant(), setup, Box::new(ant::tripod())),
            "bolted" => {
                let robot = Robot { base: Base::Fixed, ..ant::ant() };
                (robot, Setup { ground: None, ..setup }, Box::new(ant::tripod()))
            }
            _ => {
                let walk = NaoWalk::new(&nao(), &NaoWalk::space().unwrap().nominal(), setup.duration_s).unwrap();
                let ball = (name == "nao with a ball").then_some(ball);
                (nao(), Setup { ball, ..setup }, Box::new(walk))
            }
        }
    }

    /// Some fall over, some slide, some have dry friction and others do not, and one diverges.
    fn candidate(name: &str, number: usize) -> Scene {
        let (mut robot, mut setup, drive) = scene(name);
        drive.place(&mut robot);
        let share = number as f64 / CANDIDATES as f64;
        for (i, link) in robot.links.iter_mut().enumerate() {
            link.mass_kg *= 1.0 + 0.2 * share * (i as f64).sin();
            link.joint.dry_friction = if number % 3 == 1 { 0.02 } else { 0.0 };
            if number == TORN {
                link.joint.damping = -40.0;
            }
        }
        if let Some(ground) = &mut setup.ground {
            ground.friction = 0.2 + 0.6 * share;
        }
        setup.gravity_m_s2 = Vector3::new(3.0 * share, 0.0, -9.81);
        (robot, setup, drive)
    }

    fn run((robot, setup, drive): &Scene) -> PreparedRollout<'_> {
        PreparedRollout::new(RolloutRequest::new(robot, &**drive).setup(setup)).unwrap()
    }

    #[test]
    fn side_by_side_everyone_does_bit_by_bit_what_it_does_alone() {
        for name in ["ant", "nao", "nao with a ball", "bolted"] {
            let scenes: Vec<Scene> = (0..CANDIDATES).map(|number| candidate(name, number)).collect();
            let log = |(robot, setup, drive): &Scene| simulate(RolloutRequest::new(robot, &**drive).setup(setup));
            let alone: Vec<Result<Log, WorldError>> = scenes.iter().map(log).collect();
            assert!(alone.iter().enumerate().all(|(i, log)| log.is_err() == (i == TORN)), "{name}");
            let worlds: Vec<(&Robot, &Setup)> = scenes.iter().map(|(robot, setup, _)| (robot, setup)).collect();
            for arch in articulated::widths() {
                let lanes = articulated::width(arch);
                let few = |from: usize| from..(from + lanes).min(CANDIDATES);
                let together = |from: usize| {
                    let mut engine = articulated::engine_of_several(arch, &worlds[few(from)]).unwrap();
                    together(engine.as_mut(), scenes[few(from)].iter().map(run).collect())
                };
                let logs: Vec<_> = (0..CANDIDATES).step_by(lanes).flat_map(together).collect();
                assert!(logs == alone, "{name} in {lanes} lanes");
            }
        }
    }

    #[test]
    fn robots_of_several_kinds_come_out_in_their_order() {
        let scenes: Vec<Scene> = ["ant", "ant", "nao", "bolted", "ant"].into_iter().map(scene).collect();
        let logs = simulate_all(scenes.iter().map(|scene| Ok(run(scene))).collect());
        for ((robot, setup, drive), log) in scenes.iter().zip(logs) {
            assert_eq!(log, simulate(RolloutRequest::new(robot, &**drive).setup(setup)));
        }
    }
}
