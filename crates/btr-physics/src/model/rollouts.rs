//! Rollouts of a model: one or many, in its own scenarios or in others.

use super::request::ModelRequest;
use super::task;
use super::{Model, Scenario};
use crate::drive::Drive;
use crate::effects::PlacedEffect;
use crate::robot::{JointKind, Robot};
use crate::rollout;
use crate::rollout::restart;
use crate::rollout::restart::Restart;
use crate::rollout::{RolloutRequest, StateHook};
use crate::setup::{Setup, setup_error};
use btr_core::log::Log;
use btr_core::log::interpolate;
use btr_core::parallel;
use btr_core::space::Space;
use btr_core::world::TimeStep;
use btr_core::world::{Behaviour, Cancelled, Job, Measure, Simulator, WorldError};
use rayon::prelude::*;
use std::sync::atomic::Ordering;

impl Model {
    /// Simulates one rollout and returns its log.
    ///
    /// # Errors
    /// A point outside its space, an effect whose site matches nothing, or a simulation that diverged.
    pub fn simulate(&self, request: ModelRequest) -> Result<Log, WorldError> {
        self.simulate_all(vec![request]).pop().unwrap_or_else(no_rollout)
    }

    /// Simulates several rollouts on the calling thread. Each log is what [`simulate`](Self::simulate) gives for its
    /// request; many rollouts of equal length take less time in one call.
    pub fn simulate_all(&self, requests: Vec<ModelRequest>) -> Vec<Result<Log, WorldError>> {
        let mut hooks = Vec::with_capacity(requests.len());
        let mut inputs = Vec::with_capacity(requests.len());
        self.rollouts.fetch_add(requests.len() as u64, Ordering::Relaxed);
        for request in requests {
            inputs.push(self.inputs(&request));
            hooks.push(request.hook);
        }
        let valid = inputs.iter().zip(hooks).filter_map(|(inputs, hook)| Some(inputs.as_ref().ok()?.rollout(hook)));
        let mut logs = rollout::simulate_all(valid.collect()).into_iter();
        let finish = |inputs: &Result<RunInputs, WorldError>| {
            let inputs = inputs.as_ref().map_err(Clone::clone)?;
            let mut log = logs.next().unwrap_or_else(no_rollout)?;
            self.smooth_required_torques(&mut log, inputs.scenario);
            Ok(log)
        };
        inputs.iter().map(finish).collect()
    }

    /// The torques of what acts in the joints of a rollout whose motion is prescribed; see [`rollout::joint_torques`].
    ///
    /// # Errors
    /// As for [`simulate`](Self::simulate).
    pub fn joint_torques(&self, request: &ModelRequest) -> Result<Log, WorldError> {
        let inputs = self.inputs(request)?;
        let mut log = rollout::joint_torques(inputs.rollout(None))?;
        self.smooth_required_torques(&mut log, inputs.scenario);
        Ok(log)
    }

    /// The same for jobs of a search, on all threads: consecutive jobs of one scenario are simulated in one batch.
    /// `check_cancelled` is called before every batch; once it gives an error, no further batch is simulated.
    ///
    /// # Errors
    /// Cancelled work. A simulation that fails gives an error in its place.
    pub fn simulate_jobs(
        &self,
        jobs: &[Job],
        check_cancelled: &(dyn Fn() -> Result<(), Cancelled> + Sync),
    ) -> Result<Vec<Result<Log, WorldError>>, Cancelled> {
        let batch_size = parallel::side_by_side(rollout::lanes(), jobs.len());
        let with_cancellation = |batch: &[Job]| {
            check_cancelled()?;
            Ok(self.simulate_all(batch.iter().map(|job| self.job(job)).collect()))
        };
        let batches: Result<Vec<_>, Cancelled> =
            jobs.par_chunks(batch_size).with_max_len(1).map(with_cancellation).collect();
        Ok(batches?.into_iter().flatten().collect())
    }

    /// The logs of several rollouts with their fitness.
    pub fn behaviours(&self, requests: Vec<ModelRequest>) -> Vec<Result<Behaviour, WorldError>> {
        let with_fitness = |log: Result<Log, WorldError>| {
            let log = log?;
            let fitness = self.fitness.of(&log)?;
            Ok(Behaviour { log, fitness })
        };
        self.simulate_all(requests).into_iter().map(with_fitness).collect()
    }

    /// Everything that a rollout needs.
    fn inputs<'a>(&self, request: &ModelRequest<'a>) -> Result<RunInputs<'a>, WorldError> {
        let &ModelRequest { s, scenario, values, effects: further, time_step: step, .. } = request;
        let nominal = self.drive.space().nominal();
        let c = request.controller.unwrap_or(&nominal);
        self.simulations.check(s)?;
        self.drive.space().check(c)?;
        let (mut robot, mut effects, mut setup) = self.in_scenario(scenario, s, values);
        effects.extend_from_slice(further);
        if scenario.replay.is_some() {
            undo_encoder_effects(&mut robot, &effects, scenario.start.len())?;
        }
        if step != TimeStep::USUAL {
            setup.sample_s = setup.sample_s.or(Some(setup.dt_s));
            setup.dt_s /= f64::from(step.divides_by());
        }
        let drive = self.drive_at(c, scenario)?;
        drive.place(&mut robot);
        let restarts = restart::undo_encoder_effects(&scenario.restarts, &robot, &effects)?;
        Ok(RunInputs { robot, effects, setup, drive, noise_seed: request.noise_seed, restarts, scenario })
    }

    /// Smooths the torques that measured motions require, which are as noisy as these; measured torques are smoothed
    /// alike, on the clock of the recorded log.
    fn smooth_required_torques(&self, log: &mut Log, scenario: &Scenario) {
        let Some(replay) = &scenario.replay else { return };
        let joints = self.robot.movable().enumerate().filter(|(i, _)| replay.follows(*i));
        for (_, (_, link)) in joints {
            let clock_s = log.clock_s().to_vec();
            if let Some(torques) = log.values_mut(&format!("tau_{}", link.joint.name)) {
                let recorded = replay.smoothed(&interpolate(&clock_s, torques, replay.clock_s()));
                torques.copy_from_slice(&interpolate(replay.clock_s(), &recorded, &clock_s));
            }
        }
    }
}

impl Simulator for Model {
    fn measure(&self, name: &str) -> Option<Measure> {
        task::measure(name)
    }

    fn side_by_side(&self) -> usize {
        rollout::lanes()
    }

    fn run_all(&self, jobs: &[Job]) -> Vec<Result<Behaviour, WorldError>> {
        self.behaviours(jobs.iter().map(|job| self.job(job)).collect())
    }

    fn simulations(&self) -> &Space {
        &self.simulations
    }

    fn controllers(&self) -> &Space {
        self.drive.space()
    }

    fn scenarios(&self) -> usize {
        self.learn
    }

    fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError> {
        self.run_all(&[Job { s, c, scenario }]).pop().unwrap_or_else(no_rollout)
    }
}

/// The inputs of a model's rollout, before its working memory is allocated.
struct RunInputs<'a> {
    robot: Robot,
    effects: Vec<PlacedEffect>,
    setup: Setup,
    drive: Box<dyn Drive>,
    noise_seed: Option<u64>,
    restarts: Vec<Restart>,
    scenario: &'a Scenario,
}

impl RunInputs<'_> {
    /// The rollout's request. Restarts are applied before the hook is called.
    fn rollout<'a>(&'a self, hook: Option<StateHook<'a>>) -> RolloutRequest<'a> {
        let mut restarts = restart::apply_restarts(&self.restarts, self.setup.dt_s);
        let with_hook: StateHook<'a> = match hook {
            Some(mut hook) => Box::new(move |time_s, engine| {
                restarts(time_s, engine);
                hook(time_s, engine);
            }),
            None => Box::new(restarts),
        };
        let request = RolloutRequest::new(&self.robot, self.drive.as_ref()).effects(&self.effects).setup(&self.setup);
        request.noise_seed(self.noise_seed).hook(with_hook)
    }
}

fn no_rollout<T>() -> Result<T, WorldError> {
    Err(setup_error("nothing was simulated".to_owned()))
}

/// Converts recorded start positions, which are encoder readings, to true positions, by inverting the effects on
/// encoders.
fn undo_encoder_effects(robot: &mut Robot, effects: &[PlacedEffect], recorded: usize) -> Result<(), WorldError> {
    for placed in effects.iter().filter(|placed| !placed.is_off()) {
        let joints = placed.joints(robot)?;
        let moving = robot.links.iter_mut().skip(1).filter(|link| link.joint.kind != JointKind::Fixed);
        for (i, link) in moving.enumerate().take(recorded) {
            if joints.contains(&i) {
                link.joint.start = placed.effect.start(&placed.values, link.joint.start);
            }
        }
    }
    Ok(())
}
