//! Output files of a run: figures as SVG, its page, and logs as MCAP for robot viewers.

use crate::best_test::BestTest;
use crate::html;
use crate::plot::figure;
use crate::plot::paper::{GenerationTrace, Individual, Parameter, RunProgress, Tracking, following, progress};
use btr_core::coevolve;
use btr_core::coevolve::Side;
use btr_core::log::{Log, interpolate};
use btr_core::world::Simulator;
use btr_io::Meta;
use btr_lab::experiment::Experiment;
use btr_lab::failure::Failure;
use btr_lab::run::Run;
use btr_lab::run::execute::adapted;
use btr_lab::run::report::RunReport;
use btr_physics::robot::urdf;
use std::path::PathBuf;

/// Number of joints whose following is drawn, as in the paper.
const JOINTS: usize = 3;

/// Writes figures, the page and logs into the run's folder. Returns their paths.
///
/// # Errors
/// A file that cannot be written; a simulation that diverges.
pub fn write(experiment: &Experiment, run: &Run, report: &RunReport) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    let panels = searches(experiment, report).map(|searches| progress(&searches)).unwrap_or_default();
    if !panels.is_empty() {
        files.push(run.write("progress.svg", figure(&panels, 2).as_bytes())?);
    }
    let best = BestTest::of(experiment, run)?;
    let joints = best.as_ref().map(|best| following(&tracking(best.real, &best.before, &best.after)));
    let joints = joints.unwrap_or_default();
    if !joints.is_empty() {
        files.push(run.write("following.svg", figure(&joints, 2).as_bytes())?);
    }
    let page = html::run(experiment, report, best.as_ref(), (&panels, &joints));
    files.push(run.write("report.html", page.as_bytes())?);
    if let Some(best) = &best {
        let meta = meta(experiment, run)?;
        for (name, log) in [("real", best.real), ("simulated_before", &best.before), ("simulated_after", &best.after)] {
            files.push(run.write_log(&format!("{name}.mcap"), log, &meta)?);
        }
    }
    Ok(files)
}

fn meta(experiment: &Experiment, run: &Run) -> Result<Meta, Failure> {
    let (robot, ..) = experiment.model.at(run.state().simulation(), 0);
    Ok(Meta {
        base_link: robot.links.first().map(|link| link.name.clone()),
        urdf: Some(urdf::to_urdf(&robot)),
        model_toml: Some(adapted(experiment, run)?),
        notes: [("seed".to_owned(), experiment.seed.to_string())].into(),
    })
}

/// The searches of a run, if simulations were searched.
fn searches(experiment: &Experiment, report: &RunReport) -> Option<RunProgress> {
    report.generations.iter().find(|g| g.side == Side::Simulators)?;
    let of = |side: Side| report.generations.iter().filter(move |g| g.side == side);
    let trace = |side: Side| {
        of(side).map(|g| GenerationTrace { iteration: g.iteration, best: g.best, mean: g.mean }).collect::<Vec<_>>()
    };
    let truth = report.revealed.as_ref().map(|r| &r.truth.parameters);
    let dims = experiment.model.simulations().dims().iter();
    Some(RunProgress {
        fitness: trace(Side::Controllers),
        fitness_label: "fitness".to_owned(),
        phi: trace(Side::Simulators),
        phi_label: format!("phi ({})", experiment.plan.distance.name()),
        parameters: dims
            .map(|d| Parameter {
                name: d.name.clone(),
                unit: d.unit.clone(),
                truth: truth.and_then(|t| t.get(&d.name)).copied(),
                intervals: intervals(report, &d.name),
            })
            .collect(),
        drawn: experiment.plan.posterior.is_some(),
        individuals: of(Side::Simulators).enumerate().flat_map(|(k, g)| individuals(k, g)).collect(),
    })
}

/// The 95 % intervals of a parameter, each at the last generation of its iteration.
fn intervals(report: &RunReport, name: &str) -> Vec<(usize, [f64; 2])> {
    let simulators: Vec<&coevolve::Generation> =
        report.generations.iter().filter(|g| g.side == Side::Simulators).collect();
    let interval = |it: &coevolve::Iteration| {
        let last = simulators.iter().rposition(|g| g.iteration == it.i)?;
        Some((last, it.posterior.as_ref()?.parameters.get(name)?.ci95?))
    };
    report.iterations.iter().filter_map(interval).collect()
}

fn individuals(generation: usize, g: &coevolve::Generation) -> impl Iterator<Item = Individual> + '_ {
    let scored = g.points.iter().zip(&g.scores);
    scored.filter_map(move |(values, phi)| Some(Individual { generation, phi: (*phi)?, values: values.clone() }))
}

/// The [`JOINTS`] joints whose simulation changed most, in the order of the log.
fn tracking(real: &Log, before: &Log, after: &Log) -> Vec<Tracking> {
    let names = real.channels().filter_map(|(name, _)| name.strip_prefix("q_"));
    let mut joints: Vec<(f64, usize, Tracking)> = names
        .enumerate()
        .filter_map(|(k, joint)| {
            let at = |log: &Log, prefix: &str| {
                let values = &log.channel(&format!("{prefix}_{joint}"))?.values;
                Some(interpolate(log.clock_s(), values, real.clock_s()))
            };
            let tracking = Tracking {
                joint: joint.to_owned(),
                unit: real.channel(&format!("q_{joint}"))?.unit.clone(),
                time_s: real.clock_s().to_vec(),
                reference: at(real, "cmd")?,
                real: at(real, "q")?,
                before: at(before, "q")?,
                after: at(after, "q")?,
            };
            let change: f64 = tracking.before.iter().zip(&tracking.after).map(|(a, b)| (a - b) * (a - b)).sum();
            Some((change, k, tracking))
        })
        .collect();
    joints.sort_by(|a, b| b.0.total_cmp(&a.0));
    joints.truncate(JOINTS);
    joints.sort_by_key(|(_, k, _)| *k);
    joints.into_iter().map(|(_, _, tracking)| tracking).collect()
}
