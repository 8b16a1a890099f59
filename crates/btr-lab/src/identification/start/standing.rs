//! Whether a free robot can be simulated through a whole log: its log begins at rest, the model stands when it is put
//! down, and a smaller change of it never has larger consequences than its share. A motion that contact makes chaotic
//! is compared in windows instead.

use crate::identification::problem::IdentificationProblem;
use btr_core::log::{Log, interpolate};
use btr_core::signal::smooth;
use btr_core::world::WorldError;
use btr_identify::fit::squares;
use btr_identify::residual_model::TimeStep;
use btr_physics::model::{Model, Scenario};
use btr_physics::robot::Link;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// How a free robot came to where its log begins: put down with its joints as they read there, or as they are told, it
/// stood for so long, in s.
#[derive(Clone, Copy)]
struct StandingHistory {
    told: bool,
    stood_s: f64,
}

/// What is thought of, likeliest first: it stood until everything was settled, or not as long, or was put there at that
/// moment, as simulated ones are.
const PASTS: [StandingHistory; 7] = [
    StandingHistory { told: false, stood_s: 1.0 },
    StandingHistory { told: true, stood_s: 1.0 },
    StandingHistory { told: false, stood_s: 0.5 },
    StandingHistory { told: true, stood_s: 0.5 },
    StandingHistory { told: false, stood_s: 0.2 },
    StandingHistory { told: true, stood_s: 0.2 },
    StandingHistory { told: false, stood_s: 0.0 },
];
/// A less likely past is believed where it leaves less than this share of a likelier one's squares.
const LIKELIER: f64 = 0.98;
/// The beginning of a log, which tells which, in s.
const BEGINNING_S: f64 = 0.3;
/// Joints rest that move by at most so many noise floors in so many seconds...
const AT_REST: (f64, f64) = (3.0, 0.05);
/// ... or whose first readings have a slope of at most so many standard deviations: of many joints some always seem to
/// move.
const TELLING: f64 = 4.0;
/// Whatever leans further than this from how it starts, in rad, has fallen.
const UPRIGHT_RAD: f64 = 0.5;
/// Gravity is changed by such shares.
const CHANGES: [f64; 2] = [1e-6, 1e-3];
/// How many times larger, for its size, the answer to the small change may be in the last third of the motion. A foot
/// that lands or slips a step earlier made it up to 3.4 times larger in an ant's walk that could well be followed.
const DISORDER: f64 = 10.0;

impl IdentificationProblem {
    /// Lets the robot rest before every log, as the model at `u` sees it, if that is where all of them begin and the
    /// model can follow them from there.
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

    /// The same for one that rests, where the model at `u` sees another past: what holds a joint (play, friction, a
    /// wrong zero) tells how it came there. Whether it does.
    pub fn rest_otherwise(&mut self, u: &[f64]) -> Result<bool, WorldError> {
        let Some(rested) = self.likeliest(u)? else { return Ok(false) };
        let same = |(a, b): (&Scenario, &Scenario)| a.rest_s.total_cmp(&b.rest_s).is_eq() && a.start == b.start;
        let differs = !rested.iter().zip(&self.situations).all(same);
        self.situations = rested;
        Ok(differs)
    }

    /// The scenarios with the past that leads nearest to where the logs begin; none where one of them begins under way.
    fn likeliest(&self, u: &[f64]) -> Result<Option<Vec<Scenario>>, WorldError> {
        let stands =
            self.model.setup.ground.is_some() && self.model.robot.links.iter().any(|link| !link.shapes.is_empty());
        let starts: Option<Vec<_>> = (0..self.recorded.len()).map(|scenario| self.resting_start(scenario)).collect();
        let Some(starts) = starts.filter(|_| stands) else { return Ok(None) };
        let mut nearest: Option<(f64, Vec<Scenario>)> = None;
        for StandingHistory { told, stood_s: rest_s } in PASTS {
            let after = |(scenario, read): (usize, &Vec<(f64, f64)>)| {
                let start = if told { self.told_start(scenario, read) } else { read.clone() };
                Scenario { rest_s, start, ..self.model.scenarios[scenario].clone() }
            };
            let rested: Vec<Scenario> = starts.iter().enumerate().map(after).collect();
            let missed = self.missed(u, &rested)?;
            if nearest.as_ref().is_none_or(|(least, _)| missed < LIKELIER * *least) {
                nearest = Some((missed, rested));
            }
        }
        Ok(nearest.map(|(_, rested)| rested))
    }

    /// How far the joints are from where the logs begin, in squares of noise floors.
    fn missed(&self, u: &[f64], situations: &[Scenario]) -> Result<f64, WorldError> {
        let mut missed = 0.0;
        for (situation, recorded) in situations.iter().zip(&self.recorded) {
            let simulated = self.simulate_in(u, situation, TimeStep::USUAL)?;
            let early = recorded.clock_s().partition_point(|t| *t <= BEGINNING_S);
            for (_, link) in self.model.robot.movable() {
                let name = format!("q_{}", link.joint.name);
                let Some(channel) = recorded.channel(&name) else { continue };
                let noise = self.noise(recorded, &link.joint.name);
                let said = interpolate(simulated.clock_s(), simulated.values(&name)?, &recorded.clock_s()[..early]);
                let errors = channel.values.iter().zip(said).map(|(a, b)| (a - b) / noise);
                missed += errors.filter(|error| error.is_finite()).map(|error| error * error).sum::<f64>();
            }
        }
        Ok(missed)
    }

    /// Where the joints are when a log begins, without velocity; `None` if one moves, as far as its readings tell.
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

    /// Where the joints are told to be when a log begins; where they read to be if nothing tells.
    fn told_start(&self, scenario: usize, read: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let told = |((_, link), read): ((usize, &Link), &(f64, f64))| {
            let commands = self.recorded[scenario].channel(&format!("cmd_{}", link.joint.name));
            let first = commands.and_then(|channel| channel.values.first().copied()).filter(|q| q.is_finite());
            first.map_or(*read, |q| (q, 0.0))
        };
        self.model.robot.movable().zip(read).map(told).collect()
    }
}

/// Whether the model stands when the log begins, and nothing small grows until it ends.
fn is_orderly(model: &Model, situation: &Scenario) -> Result<bool, WorldError> {
    let run = |change: f64| {
        let mut other = model.in_situations(vec![situation.clone()]);
        other.setup.gravity_m_s2 *= 1.0 + change;
        other.simulate(other.request(&other.simulations.nominal(), 0))
    };
    let usual = run(0.0)?;
    if leans_rad(model, &usual)? > UPRIGHT_RAD {
        return Ok(false);
    }
    let [small, large] = CHANGES.map(|change| run(change).and_then(|log| answers(model, &usual, &log, change)));
    // What slips or sticks need not answer in proportion; but chaos makes much of little.
    Ok(squares(&small?) <= DISORDER.powi(2) * squares(&large?))
}

/// How far the root leans at the beginning of a log, from how the robot was put down.
fn leans_rad(model: &Model, log: &Log) -> Result<f64, WorldError> {
    let first = |name: &str| Ok::<f64, WorldError>(log.values(name)?[0]);
    let turned = Quaternion::new(first("base_qw")?, first("base_qx")?, first("base_qy")?, first("base_qz")?);
    let up = |rotation: UnitQuaternion<f64>| rotation * Vector3::z();
    Ok(up(UnitQuaternion::from_quaternion(turned)).angle(&up(model.robot.start.rotation)))
}

/// How the joints answer a change, by its size, in the last third of a motion.
fn answers(model: &Model, usual: &Log, other: &Log, change: f64) -> Result<Vec<f64>, WorldError> {
    let mut answers = Vec::new();
    for (_, link) in model.robot.movable() {
        let name = format!("q_{}", link.joint.name);
        let late = usual.len() * 2 / 3;
        let pairs = usual.values(&name)?.iter().zip(other.values(&name)?).skip(late);
        answers.extend(pairs.map(|(a, b)| (b - a) / change));
    }
    Ok(answers)
}
