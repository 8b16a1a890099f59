//! The next experiment: the drive in which rival explanations differ most, within what the logs showed.

use super::excitation::{Excitation, excitations};
use crate::identification::{IdentificationProblem, VerbInput};
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_identify::residual_model::TimeStep;
use btr_physics::drive::Replay;
use btr_physics::model::Scenario;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;

/// The most rivals that are looked at.
const MOST_RIVALS: usize = 5;
/// Shortest and longest drive, in s.
const DURATION_S: (f64, f64) = (4.0, 10.0);
/// Rivals that are so many noise floors apart are apart: more is not better.
const ENOUGH: f64 = 10.0;
/// Rivals that are less apart are alike: what is in doubt can make up for it.
const APART: f64 = 0.3;
/// How far a joint may leave the range of its logs, as a share of it.
const MARGIN: f64 = 0.1;

/// What to do next on the robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextExperiment {
    /// The kind of motion.
    pub kind: String,
    /// The joints that move; the others hold the middle of their ranges.
    pub joints: Vec<String>,
    /// How far the favourite and the nearest of the rivals that it tells apart are from each other, in multiples of the
    /// noise floor.
    pub separation: f64,
    /// The same in the logs that there are.
    pub separation_so_far: f64,
    /// What to do and why.
    pub sentence: String,
    /// Everybody who is alike, whether it tells them from the favourite or not.
    pub rivals: Vec<RivalExplanation>,
    /// The commands.
    #[serde(skip)]
    pub commands: Option<Log>,
}

/// An explanation that the logs cannot tell from the favourite.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RivalExplanation {
    /// `effect@site`.
    pub effect: String,
    /// How far it is from the favourite, in multiples of the noise floor.
    pub separation: f64,
}

/// The drive that tells the first of `rivals` (candidates with their points) best from the others; none where no drive
/// tells it from anybody or does so better than the logs did, and where there are none to tell apart.
///
/// # Errors
/// A model that blows up on its own logs.
pub fn next_experiment(
    problem: &IdentificationProblem,
    rivals: &[(usize, Vec<f64>)],
) -> Result<Option<NextExperiment>, WorldError> {
    let points: Vec<&Vec<f64>> = rivals.iter().take(1 + MOST_RIVALS).map(|(_, u)| u).collect();
    if points.len() < 2 {
        return Ok(None);
    }
    let model = problem.model();
    let so_far = problem
        .learnt()
        .into_iter()
        .map(|scenario| separations(problem, &points, &model.scenarios[scenario], &|_| true));
    let so_far = best(so_far.collect::<Result<Vec<_>, _>>()?.into_iter().map(Option::unwrap_or_default));
    let longest_s = problem.recorded().iter().map(Log::duration_s).fold(DURATION_S.0, f64::max);
    let drives = excitations(&model.robot, problem.recorded(), model.setup.control_s, longest_s.min(DURATION_S.1))?;
    // A drive in which any of them blows up is no drive to propose.
    let tried: Vec<Vec<f64>> = drives
        .par_iter()
        .map(|drive| separations(problem, &points, &scenario(problem, drive), &|log| problem.is_within(log, MARGIN)))
        .map(|apart| apart.ok().flatten().unwrap_or_default())
        .collect();
    let (chosen, apart) = best(tried);
    if worth(&apart) <= worth(&so_far.1) || apart.iter().all(|x| *x < APART) {
        return Ok(None);
    }
    let name = |k: usize| problem.candidates()[rivals[k].0].name();
    let rivals =
        apart.iter().enumerate().map(|(k, x)| RivalExplanation { effect: name(k + 1), separation: *x }).collect();
    Ok(Some(proposal(&drives[chosen], &name(0), rivals, &so_far.1)))
}

fn proposal(drive: &Excitation, favourite: &str, rivals: Vec<RivalExplanation>, so_far: &[f64]) -> NextExperiment {
    type Scores<'a> = Vec<(&'a RivalExplanation, f64)>;
    let (told, alike): (Scores, Scores) =
        rivals.iter().zip(so_far.iter().copied()).partition(|(rival, _)| rival.separation >= APART);
    let names = |rivals: &Scores| rivals.iter().map(|(rival, _)| rival.effect.as_str()).collect::<Vec<_>>().join(", ");
    let separation = least(told.iter().map(|(rival, _)| rival.separation));
    let separation_so_far = least(told.iter().map(|(_, so_far)| *so_far));
    let mut sentence = format!(
        "Drive {} with {}: {favourite} and {} then differ by at least {separation:.1} noise floors, in these logs by {separation_so_far:.1}",
        drive.joints.join(", "),
        drive.told,
        names(&told),
    );
    if !alike.is_empty() {
        sentence += &format!("; this does not tell it from {}", names(&alike));
    }
    sentence.push('.');
    NextExperiment {
        kind: drive.kind.to_owned(),
        joints: drive.joints.clone(),
        separation,
        separation_so_far,
        sentence,
        rivals,
        commands: Some(drive.commands.clone()),
    }
}

/// The drive as a situation: from where the robot is at its own start, with what is known of the first log.
fn scenario(problem: &IdentificationProblem, drive: &Excitation) -> Scenario {
    let model = problem.model();
    Scenario {
        name: drive.kind.to_owned(),
        replay: Some(Arc::new(Replay::new(&drive.commands, &model.robot))),
        duration_s: drive.commands.duration_s(),
        settings: model.scenarios.first().map_or(Vec::new(), |first| first.settings.clone()),
        ..Scenario::default()
    }
}

/// How far the first point's simulation is from each other's, in multiples of the noise floor over all measured
/// channels; `None` where one of them is not `safe`.
fn separations(
    problem: &IdentificationProblem,
    points: &[&Vec<f64>],
    scenario: &Scenario,
    safe: &dyn Fn(&Log) -> bool,
) -> Result<Option<Vec<f64>>, WorldError> {
    let logs: Vec<Log> =
        points.iter().map(|u| problem.simulate_in(u, scenario, TimeStep::USUAL)).collect::<Result<_, _>>()?;
    if !logs.iter().all(safe) {
        return Ok(None);
    }
    let channels = problem.logs().first().map_or(&[][..], |log| &log.channels);
    let apart = |other: &Log| -> Result<f64, WorldError> {
        let (mut squares, mut samples) = (0.0, 0);
        for channel in channels {
            let pairs = logs[0].values(&channel.name)?.iter().zip(other.values(&channel.name)?);
            squares += pairs.map(|(a, b)| ((a - b) / channel.sigma).powi(2)).sum::<f64>();
            samples += other.len();
        }
        Ok((squares / samples.max(1) as f64).sqrt())
    };
    logs.iter().skip(1).map(apart).collect::<Result<Vec<f64>, _>>().map(Some)
}

/// What a drive is worth: the sum of squares of its separations, as far as they matter.
fn worth(apart: &[f64]) -> f64 {
    apart.iter().map(|x| x.min(ENOUGH).powi(2)).sum()
}

fn least(apart: impl Iterator<Item = f64>) -> f64 {
    apart.reduce(f64::min).unwrap_or(0.0)
}

/// The most telling, with its index; of equals the one in which all together are further apart.
fn best(all: impl IntoIterator<Item = Vec<f64>>) -> (usize, Vec<f64>) {
    let sum = |apart: &[f64]| apart.iter().sum::<f64>();
    let better = |a: &(usize, Vec<f64>), b: &(usize, Vec<f64>)| {
        worth(&a.1).total_cmp(&worth(&b.1)).then(sum(&a.1).total_cmp(&sum(&b.1))).then(b.0.cmp(&a.0))
    };
    all.into_iter().enumerate().max_by(better).unwrap_or_default()
}

impl VerbInput {
    /// The next experiment for what a diagnosis could not tell apart.
    pub(super) fn next_experiment(&self, rivals: &[(usize, Vec<f64>)]) -> Option<NextExperiment> {
        // The logs themselves were simulated at these points before, so nothing blows up there.
        next_experiment(&self.problem, rivals).ok().flatten()
    }
}
