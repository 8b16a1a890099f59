//! A model: a robot with its effects, the parameters in doubt, what drives it and how it is judged. The family of
//! simulations that everything else searches.

use crate::abreast::{self, Run};
use crate::drive::{Drive, DrivePlan};
use crate::effect::Placed;
use crate::engine::Dynamics;
use crate::parameter::Target;
use crate::restart::{self, Restart};
use crate::robot::{JointKind, Robot};
use crate::sim::{self, EngineName, Setup};
use crate::task::Fitness;
use btr_core::family::Step;
use btr_core::log::{Log, Role};
use btr_core::parallel;
use btr_core::smooth;
use btr_core::space::Space;
use btr_core::world::{Behaviour, Job, Simulator, WorldError};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// One situation in which the robot is tried.
#[derive(Clone, Debug, Default)]
pub struct Scenario {
    /// For reports.
    pub name: String,
    /// Commands of a recorded log, instead of the model's drive.
    pub replay: Option<Arc<crate::drive::Replay>>,
    /// T_e in s.
    pub duration_s: f64,
    /// When it begins, in s on the clock by which laws count time: what follows a gap of a log begins late.
    pub begins_s: f64,
    /// How long the robot has held the first commands before, in s.
    pub rest_s: f64,
    /// What is known of this situation: payload, gain, supply voltage, ...
    pub settings: Vec<(Target, f64)>,
    /// Joint positions and velocities at the start, by joint in the order of [`Robot::movable`]; the robot's own where
    /// empty.
    pub start: Vec<(f64, f64)>,
    /// States that the robot is moved to on the way, in their order: a chaotic motion is compared in short windows.
    pub restarts: Arc<[Restart]>,
}

/// Everything needed to simulate.
#[derive(Debug)]
pub struct Model {
    /// The robot at its own values.
    pub robot: Robot,
    /// Effects that are present.
    pub effects: Vec<Placed>,
    /// Time steps, ground, sensors.
    pub setup: Setup,
    /// What the dimensions of S act on.
    pub targets: Vec<Target>,
    /// S.
    pub simulations: Space,
    /// What the joints are told, with C.
    pub drive: DrivePlan,
    /// Situations, at least one. Those from `learn` on are held out: no search ever sees them.
    pub scenarios: Vec<Scenario>,
    /// How many of the scenarios are there to learn from.
    pub learn: usize,
    /// f(B).
    pub fitness: Fitness,
    /// Rollouts so far, for the progress display; no result depends on it.
    pub rollouts: AtomicU64,
}

impl Model {
    /// Runs one behaviour and returns what the sensors say, with noise of the model's sensors if a seed is given.
    ///
    /// # Errors
    /// A point outside its space, or a simulation that blew up.
    pub fn simulate(&self, s: &[f64], c: &[f64], scenario: usize, noise: Option<u64>) -> Result<Log, WorldError> {
        self.simulate_in_steps(s, c, scenario, noise, Step::USUAL)
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
        step: Step,
    ) -> Result<Log, WorldError> {
        self.run_once((s, c), &self.scenarios[scenario], &[], step, noise, &mut |_, _| {})
    }

    /// The same model in other situations, all to learn from.
    #[must_use]
    pub fn in_situations(&self, scenarios: Vec<Scenario>) -> Model {
        Model {
            robot: self.robot.clone(),
            effects: self.effects.clone(),
            setup: self.setup.clone(),
            targets: self.targets.clone(),
            simulations: self.simulations.clone(),
            drive: self.drive.clone(),
            learn: scenarios.len(),
            scenarios,
            fitness: self.fitness.clone(),
            rollouts: 0.into(),
        }
    }

    /// Whether there is a floor or a ball to touch.
    pub fn has_contact(&self) -> bool {
        self.setup.ground.is_some() || self.setup.ball.is_some()
    }

    /// With which power of the time step the error of its physics engine falls.
    pub fn order(&self) -> i32 {
        if !self.has_contact() && self.setup.engine == EngineName::Auto { 2 } else { 1 }
    }

    /// Runs simulation `s` of a scenario with its nominal controller and with further effects, without noise.
    ///
    /// # Errors
    /// A point outside S, an effect that fits nothing, or a simulation that blew up.
    pub fn rollout(&self, s: &[f64], scenario: usize, further: &[Placed], step: Step) -> Result<Log, WorldError> {
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
        further: &[Placed],
        step: Step,
    ) -> Result<Log, WorldError> {
        self.run_once((s, &self.drive.space().nominal()), situation, further, step, None, &mut |_, _| {})
    }

    /// The same with a step so fine that its error is as good as none, and noisy sensors.
    pub(crate) fn measured(
        &self,
        s: &[f64],
        situation: &Scenario,
        further: &[Placed],
        noise: u64,
    ) -> Result<Log, WorldError> {
        let own = self.drive.space().nominal();
        self.run_once(
            (s, &own),
            situation,
            further,
            Step::USUAL.halved().halved().halved(),
            Some(noise),
            &mut |_, _| {},
        )
    }

    /// Runs simulation `s` in a situation while `lead` may move the robot to other states; it is called after every step,
    /// with the time in s.
    pub(crate) fn led(
        &self,
        s: &[f64],
        situation: &Scenario,
        further: &[Placed],
        lead: &mut dyn FnMut(f64, &mut dyn Dynamics),
    ) -> Result<Log, WorldError> {
        self.run_once((s, &self.drive.space().nominal()), situation, further, Step::USUAL, None, lead)
    }

    /// Several runs, in their order: what each [`rollout_in`](Self::rollout_in) would give, but faster where they are many in
    /// one situation.
    pub(crate) fn rollouts_in(
        &self,
        points: &[(Vec<f64>, Vec<Placed>)],
        situation: &Scenario,
        step: Step,
    ) -> Vec<Result<Log, WorldError>> {
        let own = self.drive.space().nominal();
        let job = |(s, further): &'_ (Vec<f64>, Vec<Placed>)| self.prepare(s, &own, situation, further, step);
        self.run_ready(&points.iter().map(job).collect::<Vec<_>>())
    }

    /// What the sensors say in each of some runs, without noise, in their order; on all threads, those of one scenario side
    /// by side where they follow each other.
    pub fn simulate_all(&self, jobs: &[Job]) -> Vec<Result<Log, WorldError>> {
        let at_once = parallel::side_by_side(abreast::at_most(), jobs.len());
        jobs.par_chunks(at_once).with_max_len(1).flat_map_iter(|few| self.few(few)).collect()
    }

    fn few(&self, jobs: &[Job]) -> Vec<Result<Log, WorldError>> {
        let ready = |job: &Job| self.prepare(job.s, job.c, &self.scenarios[job.scenario], &[], Step::USUAL);
        self.run_ready(&jobs.iter().map(ready).collect::<Vec<_>>())
    }

    fn run_once(
        &self,
        (s, c): (&[f64], &[f64]),
        situation: &Scenario,
        further: &[Placed],
        step: Step,
        noise: Option<u64>,
        lead: &mut dyn FnMut(f64, &mut dyn Dynamics),
    ) -> Result<Log, WorldError> {
        let ready = self.prepare(s, c, situation, further, step)?;
        let mut restarted = restart::lead(&ready.restarts, ready.setup.dt_s);
        let lead = Box::new(|time_s: f64, engine: &mut dyn Dynamics| {
            restarted(time_s, engine);
            lead(time_s, engine);
        });
        let Ready { robot, effects, setup, drive, .. } = &ready;
        let mut log = sim::simulate_led(robot, effects, setup, drive.as_ref(), noise, lead)?;
        self.smooth_needed(&mut log, situation);
        Ok(log)
    }

    fn run_ready(&self, jobs: &[Result<Ready, WorldError>]) -> Vec<Result<Log, WorldError>> {
        let mut logs = abreast::simulate_all(jobs.iter().map(Ready::run).collect());
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
        further: &[Placed],
        step: Step,
    ) -> Result<Ready<'a>, WorldError> {
        self.simulations.check(s)?;
        self.drive.space().check(c)?;
        self.rollouts.fetch_add(1, Ordering::Relaxed);
        let (mut robot, mut effects, mut setup) = self.in_the(situation, s);
        effects.extend_from_slice(further);
        if situation.replay.is_some() {
            read_back(&mut robot, &effects, situation.start.len())?;
        }
        if step != Step::USUAL {
            setup.sample_s = setup.sample_s.or(Some(setup.dt_s));
            setup.dt_s /= f64::from(step.divides_by());
        }
        let drive = self.drive_at(c, situation)?;
        drive.place(&mut robot);
        let restarts = restart::read_back(&situation.restarts, &robot, &effects)?;
        Ok(Ready { robot, effects, setup, drive, restarts, situation })
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

    /// The joint references that controller `c` stands for, on the control clock; sensors stay empty.
    ///
    /// # Errors
    /// A point outside C.
    pub fn references(&self, c: &[f64], scenario: usize) -> Result<Log, WorldError> {
        self.drive.space().check(c)?;
        let drive = self.drive_at(c, &self.scenarios[scenario])?;
        let ticks = (self.scenarios[scenario].duration_s / self.setup.control_s).round() as usize;
        let clock: Vec<f64> = (0..=ticks).map(|k| k as f64 * self.setup.control_s).collect();
        let names: Vec<&str> = self.robot.movable().map(|(_, link)| link.joint.name.as_str()).collect();
        let mut rows = vec![Vec::with_capacity(clock.len()); names.len()];
        let mut command = vec![0.0; names.len()];
        for &t in &clock {
            drive.command(t, &mut command);
            rows.iter_mut().zip(&command).for_each(|(row, &x)| row.push(x));
        }
        let mut log = Log::new(clock)?;
        for (name, row) in names.iter().zip(rows) {
            log.insert(format!("cmd_{name}"), "rad", Role::Command, row)?;
        }
        Ok(log)
    }

    /// The robot as a controller finds it: the same in simulation and reality.
    ///
    /// # Errors
    /// A point outside C.
    pub fn beginning(&self, c: &[f64], scenario: usize) -> Result<Robot, WorldError> {
        let (mut robot, situation) = (self.robot.clone(), &self.scenarios[scenario]);
        match situation.replay {
            Some(_) => place(&mut robot, &situation.start),
            None => self.drive_at(c, situation)?.place(&mut robot),
        }
        Ok(robot)
    }

    /// The robot, effects and setup of simulation `s` in a scenario. What a scenario knows wins over S.
    pub fn at(&self, s: &[f64], scenario: usize) -> (Robot, Vec<Placed>, Setup) {
        self.in_the(&self.scenarios[scenario], s)
    }

    fn in_the(&self, situation: &Scenario, s: &[f64]) -> (Robot, Vec<Placed>, Setup) {
        let (mut robot, mut effects, mut setup) = (self.robot.clone(), self.effects.clone(), self.setup.clone());
        let known = situation.settings.iter().map(|(target, value)| (target, *value));
        for (target, value) in self.targets.iter().zip(s.iter().copied()).chain(known) {
            target.set(value, &mut robot, &mut effects, &mut setup);
        }
        setup.duration_s = situation.duration_s;
        setup.begins_s = situation.begins_s;
        setup.rest_s = situation.rest_s;
        setup.start_velocities = situation.start.iter().map(|(_, dq)| *dq).collect();
        place(&mut robot, &situation.start);
        (robot, effects, setup)
    }

    /// The references depend on the controller alone: they are worked out for the robot at its own values, as a real
    /// robot's controller would, whatever the simulation is.
    fn drive_at(&self, c: &[f64], situation: &Scenario) -> Result<Box<dyn Drive>, WorldError> {
        match &situation.replay {
            Some(replay) => Ok(Box::new(replay.clone())),
            None => self.drive.at(&self.robot, c, situation.duration_s),
        }
    }
}

/// A run of a model, before anything is allocated for it.
struct Ready<'a> {
    robot: Robot,
    effects: Vec<Placed>,
    setup: Setup,
    drive: Box<dyn Drive>,
    restarts: Vec<Restart>,
    situation: &'a Scenario,
}

impl Ready<'_> {
    /// The run itself, without noise.
    fn run<'a>(job: &'a Result<Ready, WorldError>) -> Result<Run<'a>, WorldError> {
        let ready = job.as_ref().map_err(Clone::clone)?;
        let lead = Box::new(restart::lead(&ready.restarts, ready.setup.dt_s));
        Run::new(&ready.robot, &ready.effects, &ready.setup, ready.drive.as_ref(), None, lead)
    }
}

/// Joint positions at the start, in the order of the movable joints.
fn place(robot: &mut Robot, start: &[(f64, f64)]) {
    let moving = robot.links.iter_mut().skip(1).filter(|link| link.joint.kind != JointKind::Fixed);
    moving.zip(start).for_each(|(link, (q, _))| link.joint.start = *q);
}

/// A recorded start is what the encoders said: where the joints were depends on the effects on these.
fn read_back(robot: &mut Robot, effects: &[Placed], recorded: usize) -> Result<(), WorldError> {
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

impl Simulator for Model {
    fn side_by_side(&self) -> usize {
        abreast::at_most()
    }

    fn run_all(&self, jobs: &[Job]) -> Vec<Result<Behaviour, WorldError>> {
        let behaviour = |log: Result<Log, WorldError>| {
            let log = log?;
            let fitness = self.fitness.of(&log)?;
            Ok(Behaviour { log, fitness })
        };
        self.few(jobs).into_iter().map(behaviour).collect()
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
        let log = self.simulate(s, c, scenario, None)?;
        let fitness = self.fitness.of(&log)?;
        Ok(Behaviour { log, fitness })
    }
}
