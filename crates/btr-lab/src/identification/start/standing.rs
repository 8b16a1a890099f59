//! Standing starts: whether a floating robot can be simulated through a whole log. This requires that its log begins at
//! rest, that the model stands when it is put down, and that small changes have proportionally small consequences. A
//! motion that contact makes chaotic is compared by multiple shooting instead.

use crate::identification::problem::IdentificationProblem;
use btr_core::log::{Log, interpolate};
use btr_core::signal::smooth;
use btr_core::world::WorldError;
use btr_identify::fit::squares;
use btr_identify::residual_model::TimeStep;
use btr_physics::model::{Model, Scenario};
use btr_physics::robot::Link;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// History of a floating robot before its log: it was put down with its joints at their first readings or at their
/// first commands, and stood for a time in s.
#[derive(Clone, Copy)]
struct StandingHistory {
    at_commands: bool,
    stood_s: f64,
}

/// Possible histories, most likely first: it stood until it was settled, or for less time, or was put down at the log's
/// beginning, as in a simulation.
const PASTS: [StandingHistory; 7] = [
    StandingHistory { at_commands: false, stood_s: 1.0 },
    StandingHistory { at_commands: true, stood_s: 1.0 },
    StandingHistory { at_commands: false, stood_s: 0.5 },
    StandingHistory { at_commands: true, stood_s: 0.5 },
    StandingHistory { at_commands: false, stood_s: 0.2 },
    StandingHistory { at_commands: true, stood_s: 0.2 },
    StandingHistory { at_commands: false, stood_s: 0.0 },
];
/// A less likely history is chosen if it leaves less than this share of the squares of a likelier one.
const LIKELIER: f64 = 0.98;
/// Duration of a log's beginning, which decides between histories, in s.
const BEGINNING_S: f64 = 0.3;
/// A joint rests if it moves by at most this many noise floors in this time in s...
const AT_REST: (f64, f64) = (3.0, 0.05);
/// ... or if the slope of its first readings is at most this many standard deviations: of many joints some always seem
/// to move.
const TELLING: f64 = 4.0;
/// A robot that leans further than this from its start, in rad, has fallen.
const UPRIGHT_RAD: f64 = 0.5;
/// Relative changes of gravity.
const CHANGES: [f64; 2] = [1e-6, 1e-3];
/// How many times larger, relative to its size, the response to the small change may be in the last third of the
/// motion. In an ant's walk that could well be followed, a foot that landed or slipped a step earlier made it up to 3.4
/// times larger.
const DISORDER: f64 = 10.0;

impl IdentificationProblem {
    /// Gives every log a standing start, as estimated by the model at `u`, if all logs begin at rest and the model can
    /// follow them from there. Returns whether it does.
    pub fn rest(&mut self, u: &[f64]) -> Result<bool, WorldError> {
        let Some(rested) = self.likeliest(u)? else { return Ok(false) };
        for scenario in &rested {
            if !is_orderly(&self.model, scenario)? {
                return Ok(false);
            }
        }
        (self.situations, self.rests) = (rested, true);
        Ok(true)
    }

    /// Updates the standing starts with the histories that the model at `u` estimates: play, friction or a wrong zero
    /// of a joint changes which history fits. Returns whether they differ.
    pub fn rest_from_another_past(&mut self, u: &[f64]) -> Result<bool, WorldError> {
        let Some(rested) = self.likeliest(u)? else { return Ok(false) };
        let same = |(a, b): (&Scenario, &Scenario)| a.rest_s.total_cmp(&b.rest_s).is_eq() && a.start == b.start;
        let differs = !rested.iter().zip(&self.situations).all(same);
        self.situations = rested;
        Ok(differs)
    }

    /// The scenarios with the history that leads nearest to the beginnings of the logs; `None` if any log begins in
    /// motion.
    fn likeliest(&self, u: &[f64]) -> Result<Option<Vec<Scenario>>, WorldError> {
        let stands =
            self.model.setup.ground.is_some() && self.model.robot.links.iter().any(|link| !link.shapes.is_empty());
        let starts: Option<Vec<_>> = (0..self.recorded.len()).map(|scenario| self.resting_start(scenario)).collect();
        let Some(starts) = starts.filter(|_| stands) else { return Ok(None) };
        let mut nearest: Option<(f64, Vec<Scenario>)> = None;
        for StandingHistory { at_commands, stood_s: rest_s } in PASTS {
            let after = |(scenario, read): (usize, &Vec<(f64, f64)>)| {
                let start = if at_commands { self.commanded_start(scenario, read) } else { read.clone() };
                Scenario { rest_s, start, ..self.model.scenarios[scenario].clone() }
            };
            let rested: Vec<Scenario> = starts.iter().enumerate().map(after).collect();
            let squared_error = self.squared_error(u, &rested)?;
            if nearest.as_ref().is_none_or(|(least, _)| squared_error < LIKELIER * *least) {
                nearest = Some((squared_error, rested));
            }
        }
        Ok(nearest.map(|(_, rested)| rested))
    }

    /// Sum of squared errors of the joints at the beginnings of the logs, in noise floors.
    fn squared_error(&self, u: &[f64], situations: &[Scenario]) -> Result<f64, WorldError> {
        let mut squared_error = 0.0;
        for (situation, recorded) in situations.iter().zip(&self.recorded) {
            let simulated = self.simulate_in(u, situation, TimeStep::USUAL)?;
            let early = recorded.clock_s().partition_point(|t| *t <= BEGINNING_S);
            for (_, link) in self.model.robot.movable() {
                let name = format!("q_{}", link.joint.name);
                let Some(channel) = recorded.channel(&name) else { continue };
                let noise = self.noise(recorded, &link.joint.name);
                let predicted =
                    interpolate(simulated.clock_s(), simulated.values(&name)?, &recorded.clock_s()[..early]);
                let errors = channel.values.iter().zip(predicted).map(|(a, b)| (a - b) / noise);
                squared_error += errors.filter(|error| error.is_finite()).map(|error| error * error).sum::<f64>();
            }
        }
        Ok(squared_error)
    }

    /// Initial positions of the joints of a log at rest; `None` if the readings of a joint show motion.
    fn resting_start(&self, scenario: usize) -> Option<Vec<(f64, f64)>> {
        let log = &self.recorded[scenario];
        let start = &self.model.scenarios[scenario].start;
        let joints = self.model.robot.movable().map(|(_, link)| &link.joint.name).zip(start);
        let resting = |(joint, (q, dq)): (&String, &(f64, f64))| {
            let noise = self.noise(log, joint);
            let still = || {
                let readings = &log.channel(&format!("q_{joint}"))?.values;
                smooth::resting(log.clock_s(), readings, noise, TELLING)
            };
            let known = (dq.abs() * AT_REST.1 <= AT_REST.0 * noise).then_some(*q);
            known.or_else(still).map(|q| (q, 0.0))
        };
        if start.is_empty() { None } else { joints.map(resting).collect() }
    }

    /// Initial positions from the first commands of a log; from the readings for joints without commands.
    fn commanded_start(&self, scenario: usize, read: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let commanded = |((_, link), read): ((usize, &Link), &(f64, f64))| {
            let commands = self.recorded[scenario].channel(&format!("cmd_{}", link.joint.name));
            let first = commands.and_then(|channel| channel.values.first().copied()).filter(|q| q.is_finite());
            first.map_or(*read, |q| (q, 0.0))
        };
        self.model.robot.movable().zip(read).map(commanded).collect()
    }
}

/// Whether the model stands when the log begins, and small changes do not grow until it ends.
fn is_orderly(model: &Model, situation: &Scenario) -> Result<bool, WorldError> {
    let run = |change: f64| {
        let mut other = model.in_situations(vec![situation.clone()]);
        other.setup.gravity_m_s2 *= 1.0 + change;
        other.simulate(other.request(&other.simulations.nominal(), 0))
    };
    let baseline = run(0.0)?;
    if leans_rad(model, &baseline)? > UPRIGHT_RAD {
        return Ok(false);
    }
    let [small, large] = CHANGES.map(|change| run(change).and_then(|log| responses(model, &baseline, &log, change)));
    // Slip and stiction need not respond in proportion, but chaos amplifies small changes.
    Ok(squares(&small?) <= DISORDER.powi(2) * squares(&large?))
}

/// Angle between the root's vertical axis at the beginning of a log and at the robot's start, in rad.
fn leans_rad(model: &Model, log: &Log) -> Result<f64, WorldError> {
    let first = |name: &str| Ok::<f64, WorldError>(log.values(name)?[0]);
    let turned = Quaternion::new(first("base_qw")?, first("base_qx")?, first("base_qy")?, first("base_qz")?);
    let up = |rotation: UnitQuaternion<f64>| rotation * Vector3::z();
    Ok(up(UnitQuaternion::from_quaternion(turned)).angle(&up(model.robot.start.rotation)))
}

/// Response of the joints to a change, relative to its size, in the last third of a motion.
fn responses(model: &Model, baseline: &Log, other: &Log, change: f64) -> Result<Vec<f64>, WorldError> {
    let mut responses = Vec::new();
    for (_, link) in model.robot.movable() {
        let name = format!("q_{}", link.joint.name);
        let late = baseline.len() * 2 / 3;
        let pairs = baseline.values(&name)?.iter().zip(other.values(&name)?).skip(late);
        responses.extend(pairs.map(|(a, b)| (b - a) / change));
    }
    Ok(responses)
}
