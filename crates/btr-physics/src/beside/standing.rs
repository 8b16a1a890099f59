//! Whether a free robot can be simulated through a whole log: its log begins at rest, the model stands when it is put down, and
//! a smaller change of it never has larger consequences than its share. A motion that contact makes chaotic is compared in windows instead.

use super::Beside;
use crate::model::{Model, Scenario};
use btr_core::family::Step;
use btr_core::fit::squares;
use btr_core::log::{Log, interpolate};
use btr_core::world::WorldError;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// How long a free robot may have stood before a log begins at rest, in s: long enough for its start to be settled, or it was put
/// there at that moment, as simulated ones are.
const STOOD_S: [f64; 2] = [1.0, 0.0];
/// The beginning of a log, which tells which, in s.
const BEGINNING_S: f64 = 0.3;
/// Joints rest that move by at most so many noise floors in so many seconds.
const AT_REST: (f64, f64) = (3.0, 0.05);
/// Whatever leans further than this from how it starts, in rad, has fallen.
const UPRIGHT_RAD: f64 = 0.5;
/// Gravity is changed by such shares.
const CHANGES: [f64; 2] = [1e-6, 1e-3];
/// How many times larger, for its size, the answer to the small change may be in the last third of the motion.
const DISORDER: f64 = 2.0;

impl Beside {
    /// Lets the robot rest before every log, if that is where all of them begin and the model can follow them from there.
    pub(super) fn rest(&mut self) -> Result<bool, WorldError> {
        let stands =
            self.model.setup.ground.is_some() && self.model.robot.links.iter().any(|link| !link.shapes.is_empty());
        if !stands || !(0..self.recorded.len()).all(|scenario| self.rests(scenario)) {
            return Ok(false);
        }
        let mut nearest: Option<(f64, Vec<Scenario>)> = None;
        for rest_s in STOOD_S {
            let rested = self.model.scenarios.iter().map(|scenario| Scenario { rest_s, ..scenario.clone() });
            let rested: Vec<Scenario> = rested.collect();
            let missed = self.missed(&rested)?;
            if nearest.as_ref().is_none_or(|(least, _)| missed < *least) {
                nearest = Some((missed, rested));
            }
        }
        let Some((_, rested)) = nearest else { return Ok(false) };
        for scenario in &rested {
            if !is_orderly(&self.model, scenario)? {
                return Ok(false);
            }
        }
        self.situations = rested;
        Ok(true)
    }

    /// How far the joints are from where the logs begin, in squares of noise floors.
    fn missed(&self, situations: &[Scenario]) -> Result<f64, WorldError> {
        let mut missed = 0.0;
        for (situation, recorded) in situations.iter().zip(&self.recorded) {
            let own = self.model.simulations.nominal();
            let simulated = self.model.rollout_in(&own, situation, &[], Step::USUAL)?;
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

    /// Whether no joint moves when a log begins, as far as its readings tell.
    fn rests(&self, scenario: usize) -> bool {
        let start = &self.model.scenarios[scenario].start;
        let mut joints = self.model.robot.movable().map(|(_, link)| &link.joint.name).zip(start);
        let log = &self.recorded[scenario];
        !start.is_empty() && joints.all(|(joint, (_, dq))| dq.abs() * AT_REST.1 <= AT_REST.0 * self.noise(log, joint))
    }
}

/// Whether the model stands when the log begins, and nothing small grows until it ends.
fn is_orderly(model: &Model, situation: &Scenario) -> Result<bool, WorldError> {
    let run = |change: f64| {
        let mut other = model.in_situations(vec![situation.clone()]);
        other.setup.gravity_m_s2 *= 1.0 + change;
        other.rollout(&other.simulations.nominal(), 0, &[], Step::USUAL)
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
