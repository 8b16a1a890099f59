//! Size of changes that exceed the noise of contact. The response to a small change is dominated by contact noise, and
//! the typical sizes of effects are for a desk arm, whose motion shows even small changes.

use crate::identification::problem::IdentificationProblem;
use btr_core::world::WorldError;
use btr_identify::fit::{rows_near, shared, squares};
use btr_identify::residual_model::{FitParameter, Parametrisation, ResidualRequest, TimeStep};
use rayon::prelude::*;

/// Target responses in the most sensitive channel, in noise floors: to a unit of an amplitude, and to the step of a
/// finite difference.
const UNIT: f64 = 3.0;
const REACH: f64 = 0.3;
/// Largest factor for a unit, and largest step of a parameter of the model in standard deviations.
const LARGEST: f64 = 30.0;
const WIDEST: f64 = 0.5;

/// A change of one parameter, at given shapes.
struct ParameterTrial {
    parameter: usize,
    near: Vec<String>,
    shapes: Vec<(usize, f64)>,
    by: f64,
}

/// Enlarges the units of amplitudes and the steps of the model's own parameters until their responses show in the log
/// that the model explains least at its current values. The units of limits stay unchanged.
pub(in crate::identification) fn enlarge(problem: &mut IdentificationProblem) -> Result<(), WorldError> {
    let origin = vec![0.0; problem.parameters.len()];
    let Some((log, baseline)) = worst(problem, &origin)? else { return Ok(()) };
    let trials = trials(problem);
    let shots = shared(trials.iter().map(|trial| trial.near.as_slice()));
    let simulated = |shot: &Vec<usize>| {
        let mut u = origin.clone();
        for ParameterTrial { parameter, shapes, by, .. } in shot.iter().map(|&i| &trials[i]) {
            shapes.iter().for_each(|&(parameter, shape)| u[parameter] = shape);
            u[*parameter] = *by;
        }
        problem.residual(ResidualRequest::of(&u, log), TimeStep::USUAL).ok()
    };
    let answers: Vec<Option<Vec<f64>>> = shots.par_iter().map(simulated).collect();
    let mut shown = vec![None; trials.len()];
    for (shot, answer) in shots.iter().zip(&answers) {
        for &i in shot {
            shown[i] = answer.as_ref().map(|changed| response(problem, log, &trials[i].near, &baseline, changed));
        }
    }
    for (trial, shown) in trials.iter().zip(shown) {
        let parameter = &mut problem.parameters[trial.parameter];
        match shown {
            Some(shown) if parameter.amplitude => grow(parameter, UNIT * trial.by / shown),
            Some(shown) => {
                parameter.reach = (REACH * trial.by / shown).clamp(parameter.reach, WIDEST.max(parameter.reach));
            }
            None => {}
        }
    }
    Ok(())
}

/// The training log that the model explains least at its current values, with its residual.
fn worst(problem: &IdentificationProblem, origin: &[f64]) -> Result<Option<(usize, Vec<f64>)>, WorldError> {
    let mut worst: Option<(f64, usize, Vec<f64>)> = None;
    for log in (0..problem.logs.len()).filter(|&log| !problem.logs[log].held_out) {
        let residual = problem.residual(ResidualRequest::of(origin, log), TimeStep::USUAL)?;
        let finite: Vec<f64> = residual.iter().copied().filter(|r| r.is_finite()).collect();
        let size = squares(&finite);
        if worst.as_ref().is_none_or(|(most, ..)| size > *most) {
            worst = Some((size, log, residual));
        }
    }
    Ok(worst.map(|(_, log, residual)| (log, residual)))
}

/// Changes of the model's own parameters by their steps, and of the amplitudes of effects by a unit.
fn trials(problem: &IdentificationProblem) -> Vec<ParameterTrial> {
    let own = problem.own().map(|parameter| {
        let by = problem.parameters[parameter].reach;
        ParameterTrial { parameter, near: Vec::new(), shapes: Vec::new(), by }
    });
    let of_candidates = problem.candidates.iter().zip(&problem.near).flat_map(|(candidate, near)| {
        let shapes: Vec<(usize, f64)> =
            candidate.shapes.iter().copied().zip(candidate.starts[0].iter().copied()).collect();
        let linear = candidate
            .amplitudes
            .iter()
            .filter(|&&parameter| problem.parameters[parameter].law == Parametrisation::Linear);
        linear.map(move |&parameter| {
            let by = problem.parameters[parameter].clamp(1.0);
            ParameterTrial { parameter, near: near.clone(), shapes: shapes.clone(), by }
        })
    });
    own.chain(of_candidates).collect()
}

/// Response of a log to a change, in noise floors: the root mean square in the most sensitive channel.
fn response(problem: &IdentificationProblem, log: usize, near: &[String], baseline: &[f64], changed: &[f64]) -> f64 {
    let recorded = &problem.logs[log];
    let near = rows_near(recorded, near);
    let seen = recorded.channels.iter().filter(|channel| near.iter().any(|rows| rows.contains(&channel.samples.start)));
    let rms = |samples: std::ops::Range<usize>| {
        let changes = samples.map(|row| changed[row] - baseline[row]).filter(|change| change.is_finite());
        let (sum, count) = changes.fold((0.0, 0), |(sum, n), change| (sum + change * change, n + 1));
        (sum / f64::from(count.max(1))).sqrt()
    };
    seen.map(|channel| rms(channel.samples.clone())).fold(0.0, f64::max)
}

/// Enlarges the unit of an amplitude, as far as its bounds allow.
fn grow(parameter: &mut FitParameter, factor: f64) {
    let widest = parameter.bounds.0.abs().max(parameter.bounds.1) / 2.0;
    let factor = factor.min(LARGEST).min(widest).max(1.0);
    parameter.size *= factor;
    parameter.bounds = (parameter.bounds.0 / factor, parameter.bounds.1 / factor);
    parameter.known = parameter.known.map(|sd| sd / factor);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_unit_keeps_the_bounds_in_physical_units() {
        let mut parameter = FitParameter {
            name: "payload.mass@leg".to_owned(),
            unit: "kg".to_owned(),
            origin: 0.0,
            size: 0.01,
            law: Parametrisation::Linear,
            bounds: (0.0, 50.0),
            spread: 33.0,
            known: Some(4.0),
            reach: 0.1,
            amplitude: true,
        };
        grow(&mut parameter, 8.0);
        assert!((parameter.size - 0.08).abs() < 1e-12);
        assert!((parameter.value(parameter.bounds.1) - 0.5).abs() < 1e-12);
        assert!((parameter.prior_sd() * parameter.size - 0.04).abs() < 1e-12);
        // A unit never shrinks, and its bounds always leave room for two units.
        grow(&mut parameter, 0.1);
        assert!((parameter.size - 0.08).abs() < 1e-12);
        grow(&mut parameter, 1e3);
        assert!((parameter.bounds.1 - 2.0).abs() < 1e-12);
    }
}
