//! Rollouts of a model: one or many, of its own situations or of others.

use super::task;
use super::{Model, Scenario};
use crate::drive::Drive;
use crate::effects::PlacedEffect;
use crate::engine::Dynamics;
use crate::robot::{JointKind, Robot};
use crate::rollout::batch;
use crate::rollout::batch::PreparedRollout;
use crate::rollout::restart;
use crate::rollout::restart::Restart;
use crate::setup::Setup;
use btr_core::log::Log;
use btr_core::parallel;
use btr_core::signal::smooth;
use btr_core::space::Space;
use btr_core::world::TimeStep;
use btr_core::world::{Behaviour, Job, Measure, Simulator, WorldError};
use rayon::prelude::*;
use std::sync::atomic::Ordering;

impl Model {
    /// Runs one behaviour and returns what the sensors say, with noise of the model's sensors if a seed is given.
    ///
    /// # Errors
    /// A point outside its space, or a simulation that blew up.
    pub fn simulate(&self, s: &[f64], c: &[f64], scenario: usize, noise: Option<u64>) -> Result<Log, WorldError> {
        self.simulate_in_steps(s, c, scenario, noise, TimeStep::USUAL)
    }

    /// The same, computed with the model's own time step or a finer one; sampled alike.
    ///
    /// # Errors
    /// See [`simulate`](Self::simulate).
    pub fn simulate_in_steps(
        &self,
        s: &[f64],
        c: &[f64],
        scenario: usize,
        noise: Option<u64>,
        step: TimeStep,
    ) -> Result<Log, WorldError> {
        self.run_once((s, c), &self.scenarios[scenario], &[], step, noise, &mut |_, _| {})
    }

    /// Runs simulation `s` of a scenario with its nominal controller and with further effects, without noise.
    ///
    /// # Errors
    /// A point outside S, an effect that fits nothing, or a simulation that blew up.
    pub fn rollout(
        &self,
        s: &[f64],
        scenario: usize,
        further: &[PlacedEffect],
        step: TimeStep,
    ) -> Result<Log, WorldError> {
        self.rollout_in(s, &self.scenarios[scenario], further, step)
    }

    /// The same in a situation of its own.
    ///
    /// # Errors
    /// See [`rollout`](Self::rollout).
    pub fn rollout_in(
        &self,
        s: &[f64],
        situation: &Scenario,
        further: &[PlacedEffect],
        step: TimeStep,
    ) -> Result<Log, WorldError> {
        self.run_once((s, &self.drive.space().nominal()), situation, further, step, None, &mut |_, _| {})
    }

    /// The same with a step so fine that its error is as good as none, and noisy sensors.
    pub fn measured(
        &self,
        s: &[f64],
        situation: &Scenario,
        further: &[PlacedEffect],
        noise: u64,
    ) -> Result<Log, WorldError> {
        let own = self.drive.space().nominal();
        self.run_once(
            (s, &own),
            situation,
            further,
            TimeStep::USUAL.halved().halved().halved(),
            Some(noise),
            &mut |_, _| {},
        )
    }

    /// Runs simulation `s` in a situation while `lead` may move the robot to other states; it is called after every step,
    /// with the time in s.
    pub fn led(
        &self,
        s: &[f64],
        situation: &Scenario,
        further: &[PlacedEffect],
        lead: &mut dyn FnMut(f64, &mut dyn Dynamics),
    ) -> Result<Log, WorldError> {
        self.run_once((s, &self.drive.space().nominal()), situation, further, TimeStep::USUAL, None, lead)
    }

    /// Several runs, in their order: what each [`rollout_in`](Self::rollout_in) would give, but faster where they are many that
    /// last as long.
    pub fn rollouts_in<'a>(&self, points: &[ModelPoint<'a>], step: TimeStep) -> Vec<Result<Log, WorldError>> {
        let own = self.drive.space().nominal();
        let job = |point: &ModelPoint<'a>| self.prepare(point.s, &own, point.situation, point.further, step);
        self.run_ready(&points.iter().map(job).collect::<Vec<_>>())
    }

    /// What the sensors say in each of some runs, without noise, in their order; on all threads, those of one scenario side
    /// by side where they follow each other.
    /// `check_cancelled` is called before every few of them; what it unwinds with ends the rest.
    pub fn simulate_all(&self, jobs: &[Job], check_cancelled: &(dyn Fn() + Sync)) -> Vec<Result<Log, WorldError>> {
        let at_once = parallel::side_by_side(batch::at_most(), jobs.len());
        let with_cancellation = |few| {
            check_cancelled();
            self.few(few)
        };
        jobs.par_chunks(at_once).with_max_len(1).flat_map_iter(with_cancellation).collect()
    }

    fn few(&self, jobs: &[Job]) -> Vec<Result<Log, WorldError>> {
        let ready = |job: &Job| self.prepare(job.s, job.c, &self.scenarios[job.scenario], &[], TimeStep::USUAL);
        self.run_ready(&jobs.iter().map(ready).collect::<Vec<_>>())
    }

    /// What each job gives with effects of its own beside those of the model, in the order of the jobs.
    pub fn behave_with(&self, jobs: &[(Job, &[PlacedEffect])]) -> Vec<Result<Behaviour, WorldError>> {
        let ready = |(job, further): &(Job, &[PlacedEffect])| {
            self.prepare(job.s, job.c, &self.scenarios[job.scenario], further, TimeStep::USUAL)
        };
        let logs = self.run_ready(&jobs.iter().map(ready).collect::<Vec<_>>());
        logs.into_iter().map(|log| self.judged(log?)).collect()
    }

    /// A log with its fitness.
    fn judged(&self, log: Log) -> Result<Behaviour, WorldError> {
        let fitness = self.fitness.of(&log)?;
        Ok(Behaviour { log, fitness })
    }

    fn run_once(
        &self,
        (s, c): (&[f64], &[f64]),
        situation: &Scenario,
        further: &[PlacedEffect],
        step: TimeStep,
        noise: Option<u64>,
        lead: &mut dyn FnMut(f64, &mut dyn Dynamics),
    ) -> Result<Log, WorldError> {
        let ready = self.prepare(s, c, situation, further, step)?;
        let mut restarted = restart::lead(&ready.restarts, ready.setup.dt_s);
        let lead = Box::new(|time_s: f64, engine: &mut dyn Dynamics| {
            restarted(time_s, engine);
            lead(time_s, engine);
        });
        let PreparedRun { robot, effects, setup, drive, .. } = &ready;
        let mut log = crate::rollout::simulate_led(robot, effects, setup, drive.as_ref(), noise, lead)?;
        self.smooth_needed(&mut log, situation);
        Ok(log)
    }

    fn run_ready(&self, jobs: &[Result<PreparedRun, WorldError>]) -> Vec<Result<Log, WorldError>> {
        let mut logs = batch::simulate_all(jobs.iter().map(PreparedRun::run).collect());
        for (log, job) in logs.iter_mut().zip(jobs) {
            if let (Ok(log), Ok(ready)) = (log, job) {
                self.smooth_needed(log, ready.situation);
            }
        }
        logs
    }

    /// All that a run needs.
    fn prepare<'a>(
        &self,
        s: &[f64],
        c: &[f64],
        situation: &'a Scenario,
        further: &[PlacedEffect],
        step: TimeStep,
    ) -> Result<PreparedRun<'a>, WorldError> {
        self.simulations.check(s)?;
        self.drive.space().check(c)?;
        self.rollouts.fetch_add(1, Ordering::Relaxed);
        let (mut robot, mut effects, mut setup) = self.in_the(situation, s);
        effects.extend_from_slice(further);
        if situation.replay.is_some() {
            read_back(&mut robot, &effects, situation.start.len())?;
        }
        if step != TimeStep::USUAL {
            setup.sample_s = setup.sample_s.or(Some(setup.dt_s));
            setup.dt_s /= f64::from(step.divides_by());
        }
        let drive = self.drive_at(c, situation)?;
        drive.place(&mut robot);
        let restarts = restart::read_back(&situation.restarts, &robot, &effects)?;
        Ok(PreparedRun { robot, effects, setup, drive, restarts, situation })
    }

    /// The torques that measured motions need are as rough as these: smoothed, as the measured torques are.
    fn smooth_needed(&self, log: &mut Log, situation: &Scenario) {
        let Some(replay) = &situation.replay else { return };
        let joints = self.robot.movable().enumerate().filter(|(i, _)| replay.follows(*i));
        for (_, (_, link)) in joints {
            let clock_s = log.clock_s().to_vec();
            if let Some(torques) = log.values_mut(&format!("tau_{}", link.joint.name)) {
                smooth::in_place(&clock_s, torques);
            }
        }
    }
}

impl Simulator for Model {
    fn measure(&self, name: &str) -> Option<Measure> {
        task::measure(name)
    }

    fn side_by_side(&self) -> usize {
        batch::at_most()
    }

    fn run_all(&self, jobs: &[Job]) -> Vec<Result<Behaviour, WorldError>> {
        self.few(jobs).into_iter().map(|log| self.judged(log?)).collect()
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
        self.judged(self.simulate(s, c, scenario, None)?)
    }
}

/// What a run is to be of.
pub struct ModelPoint<'a> {
    /// A point of S.
    pub s: &'a [f64],
    /// Effects beside those of the model.
    pub further: &'a [PlacedEffect],
    /// When and from where it runs.
    pub situation: &'a Scenario,
}

/// A run of a model, before anything is allocated for it.
struct PreparedRun<'a> {
    robot: Robot,
    effects: Vec<PlacedEffect>,
    setup: Setup,
    drive: Box<dyn Drive>,
    restarts: Vec<Restart>,
    situation: &'a Scenario,
}

impl PreparedRun<'_> {
    /// The run itself, without noise.
    fn run<'a>(job: &'a Result<PreparedRun, WorldError>) -> Result<PreparedRollout<'a>, WorldError> {
        let ready = job.as_ref().map_err(Clone::clone)?;
        let lead = Box::new(restart::lead(&ready.restarts, ready.setup.dt_s));
        PreparedRollout::new(&ready.robot, &ready.effects, &ready.setup, ready.drive.as_ref(), None, lead)
    }
}

/// A recorded start is what the encoders said: where the joints were depends on the effects on these.
fn read_back(robot: &mut Robot, effects: &[PlacedEffect], recorded: usize) -> Result<(), WorldError> {
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
