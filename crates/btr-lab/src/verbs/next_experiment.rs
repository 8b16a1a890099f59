//! The next experiment: the drive in which rival explanations differ most, within the range of the logs.

use super::excitation::{Excitation, excitations};
use crate::identification::{IdentificationProblem, VerbInput};
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_identify::diagnose::RivalPoint;
use btr_identify::residual_model::TimeStep;
use btr_physics::drive::Replay;
use btr_physics::model::Scenario;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;

/// Most rivals that are considered.
const MOST_RIVALS: usize = 5;
/// Shortest and longest drive, in s.
const DURATION_S: (f64, f64) = (4.0, 10.0);
/// Separation in noise floors beyond which more is not better.
const ENOUGH: f64 = 10.0;
/// Separation in noise floors below which rivals are indistinguishable: the free parameters can compensate for it.
const APART: f64 = 0.3;
/// How far a joint may leave its range in the logs, as a share of that range.
const MARGIN: f64 = 0.1;

/// The proposed next experiment on the robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextExperiment {
    /// The kind of motion.
    pub kind: String,
    /// The joints that move; the others hold the middle of their ranges.
    pub joints: Vec<String>,
    /// Separation of the favourite from the nearest rival that the experiment distinguishes from it, in multiples of
    /// the noise floor.
    pub separation: f64,
    /// The same separation in the present logs.
    pub separation_so_far: f64,
    /// Description and reason.
    pub sentence: String,
    /// All rivals, whether the experiment distinguishes them from the favourite or not.
    pub rivals: Vec<RivalExplanation>,
    /// The commands.
    #[serde(skip)]
    pub commands: Option<Log>,
}

/// An explanation that the logs cannot distinguish from the favourite.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RivalExplanation {
    /// `effect@site`.
    pub effect: String,
    /// Separation from the favourite, in multiples of the noise floor.
    pub separation: f64,
}

/// The drive that best distinguishes the first of `rivals` from the others. `None` if
/// there are no rivals, or if no drive distinguishes them, or none does so better than the logs.
///
/// # Errors
/// A model that diverges on the logs.
pub fn next_experiment(
    problem: &IdentificationProblem,
    rivals: &[RivalPoint],
) -> Result<Option<NextExperiment>, WorldError> {
    let points: Vec<&Vec<f64>> = rivals.iter().take(1 + MOST_RIVALS).map(|rival| &rival.u).collect();
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
    // A drive in which any rival diverges is not proposed.
    let tried: Vec<Vec<f64>> = drives
        .par_iter()
        .map(|drive| separations(problem, &points, &scenario(problem, drive), &|log| problem.is_within(log, MARGIN)))
        .map(|apart| apart.ok().flatten().unwrap_or_default())
        .collect();
    let separates = |apart: &[f64]| worth(apart) > worth(&so_far.1) && apart.iter().any(|x| *x >= APART);
    // What acts in a joint is best seen where that one moves; where others move, little of it shows.
    let acts_in = joints_of(problem, rivals);
    let moves_it = |k: usize| drives[k].joints.iter().any(|joint| acts_in.contains(&joint.as_str()));
    let of_its_own = |(k, apart): (usize, &Vec<f64>)| if moves_it(k) { apart.clone() } else { Vec::new() };
    let (chosen, apart) = match best(tried.iter().enumerate().map(of_its_own)) {
        (chosen, apart) if separates(&apart) => (chosen, apart),
        _ => best(tried),
    };
    if !separates(&apart) {
        return Ok(None);
    }
    let name = |k: usize| problem.candidates()[rivals[k].candidate].name();
    let rivals =
        apart.iter().enumerate().map(|(k, x)| RivalExplanation { effect: name(k + 1), separation: *x }).collect();
    Ok(Some(proposal(&drives[chosen], &name(0), rivals, &so_far.1)))
}

/// The joints in which the rivals act.
fn joints_of<'a>(problem: &'a IdentificationProblem, rivals: &[RivalPoint]) -> Vec<&'a str> {
    let joints = problem.model().robot.movable().map(|(_, link)| link.joint.name.as_str());
    let sites: Vec<&str> =
        rivals.iter().take(1 + MOST_RIVALS).map(|rival| problem.candidates()[rival.candidate].site.as_str()).collect();
    // A further instance of an effect is `elbow#2`.
    joints.filter(|joint| sites.iter().any(|site| site.split('#').next() == Some(*joint))).collect()
}

fn proposal(drive: &Excitation, favourite: &str, rivals: Vec<RivalExplanation>, so_far: &[f64]) -> NextExperiment {
    type Scores<'a> = Vec<(&'a RivalExplanation, f64)>;
    let (distinguished, alike): (Scores, Scores) =
        rivals.iter().zip(so_far.iter().copied()).partition(|(rival, _)| rival.separation >= APART);
    let names = |rivals: &Scores| rivals.iter().map(|(rival, _)| rival.effect.as_str()).collect::<Vec<_>>().join(", ");
    let separation = least(distinguished.iter().map(|(rival, _)| rival.separation));
    let separation_so_far = least(distinguished.iter().map(|(_, so_far)| *so_far));
    let mut sentence = format!(
        "Drive {} with {}: {favourite} and {} then differ by at least {separation:.1} noise floors, in these logs by {separation_so_far:.1}",
        drive.joints.join(", "),
        drive.description,
        names(&distinguished),
    );
    if !alike.is_empty() {
        sentence += &format!("; this does not distinguish it from {}", names(&alike));
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

/// The drive as a scenario: from the robot's nominal start, with the settings of the first log.
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

/// Separation of the first point's simulation from each other one, in multiples of the noise floor over all measured
/// channels; `None` if any simulation is not `safe`.
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

/// Value of a drive: the sum of squares of its separations, each limited to `ENOUGH`.
fn worth(apart: &[f64]) -> f64 {
    apart.iter().map(|x| x.min(ENOUGH).powi(2)).sum()
}

fn least(apart: impl Iterator<Item = f64>) -> f64 {
    apart.reduce(f64::min).unwrap_or(0.0)
}

/// The separations of the most valuable drive, with its index; ties are broken by the sum of separations.
fn best(all: impl IntoIterator<Item = Vec<f64>>) -> (usize, Vec<f64>) {
    let sum = |apart: &[f64]| apart.iter().sum::<f64>();
    let better = |a: &(usize, Vec<f64>), b: &(usize, Vec<f64>)| {
        worth(&a.1).total_cmp(&worth(&b.1)).then(sum(&a.1).total_cmp(&sum(&b.1))).then(b.0.cmp(&a.0))
    };
    all.into_iter().enumerate().max_by(better).unwrap_or_default()
}

impl VerbInput {
    /// The next experiment for the explanations that a diagnosis could not distinguish.
    pub(super) fn next_experiment(&self, rivals: &[RivalPoint]) -> Option<NextExperiment> {
        // The logs were simulated at these points before, so these simulations do not diverge.
        next_experiment(&self.problem, rivals).ok().flatten()
    }
}
