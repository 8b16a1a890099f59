//! How large a change must be to show on the ground. Contact answers a change that is too small with noise of its own,
//! and the typical sizes of effects were made for a desk arm, whose motion shows the least of them.

use crate::identification::problem::IdentificationProblem;
use btr_core::world::WorldError;
use btr_identify::fit::{rows_near, shared, squares};
use btr_identify::residual_model::{FitParameter, Parametrisation, ResidualRequest, TimeStep};
use rayon::prelude::*;

/// What a unit of an amplitude should show, and what the reach of a difference, where it shows best: in noise floors.
const UNIT: f64 = 3.0;
const REACH: f64 = 0.3;
/// How many times larger a unit may become, and how many standard deviations the reach of a number in doubt.
const LARGEST: f64 = 30.0;
const WIDEST: f64 = 0.5;

/// A knob that is moved by so much, from where its shapes put it.
struct ParameterTrial {
    parameter: usize,
    near: Vec<String>,
    shapes: Vec<(usize, f64)>,
    by: f64,
}

/// Enlarges the units of amplitudes, and the reaches of what is in doubt, until they show in the log that the model as
/// it stands explains least. Limits bind where they bind, whatever their unit.
pub(in crate::identification) fn enlarge(problem: &mut IdentificationProblem) -> Result<(), WorldError> {
    let origin = vec![0.0; problem.parameters.len()];
    let Some((log, usual)) = worst(problem, &origin)? else { return Ok(()) };
    let tries = tries(problem);
    let shots = shared(tries.iter().map(|attempt| attempt.near.as_slice()));
    let simulated = |shot: &Vec<usize>| {
        let mut u = origin.clone();
        for ParameterTrial { parameter, shapes, by, .. } in shot.iter().map(|&i| &tries[i]) {
            shapes.iter().for_each(|&(parameter, shape)| u[parameter] = shape);
            u[*parameter] = *by;
        }
        problem.residual(ResidualRequest::of(&u, log), TimeStep::USUAL).ok()
    };
    let answers: Vec<Option<Vec<f64>>> = shots.par_iter().map(simulated).collect();
    let mut shown = vec![None; tries.len()];
    for (shot, answer) in shots.iter().zip(&answers) {
        for &i in shot {
            shown[i] = answer.as_ref().map(|there| shows(problem, log, &tries[i].near, &usual, there));
        }
    }
    for (attempt, shown) in tries.iter().zip(shown) {
        let parameter = &mut problem.parameters[attempt.parameter];
        match shown {
            Some(shown) if parameter.amplitude => grow(parameter, UNIT * attempt.by / shown),
            Some(shown) => {
                parameter.reach = (REACH * attempt.by / shown).clamp(parameter.reach, WIDEST.max(parameter.reach))
            }
            None => {}
        }
    }
    Ok(())
}

/// The log to learn from that the model as it stands explains least, with its residual.
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

/// What is in doubt, by its reach, and the amplitudes of effects, by a unit.
fn tries(problem: &IdentificationProblem) -> Vec<ParameterTrial> {
    let free = problem.free.iter().map(|&parameter| {
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
    free.chain(of_candidates).collect()
}

/// What a change is to a log, in noise floors: the root mean square in the channel where it shows best.
fn shows(problem: &IdentificationProblem, log: usize, near: &[String], usual: &[f64], there: &[f64]) -> f64 {
    let recorded = &problem.logs[log];
    let near = rows_near(recorded, near);
    let seen = recorded.channels.iter().filter(|channel| near.iter().any(|rows| rows.contains(&channel.samples.start)));
    let rms = |samples: std::ops::Range<usize>| {
        let changes = samples.map(|row| there[row] - usual[row]).filter(|change| change.is_finite());
        let (sum, count) = changes.fold((0.0, 0), |(sum, n), change| (sum + change * change, n + 1));
        (sum / f64::from(count.max(1))).sqrt()
    };
    seen.map(|channel| rms(channel.samples.clone())).fold(0.0, f64::max)
}

/// A larger unit for an amplitude, as far as its bounds allow.
fn grow(parameter: &mut FitParameter, factor: f64) {
    let widest = parameter.bounds.0.abs().max(parameter.bounds.1) / 2.0;
    let factor = factor.min(LARGEST).min(widest).max(1.0);
    parameter.size *= factor;
    parameter.bounds = (parameter.bounds.0 / factor, parameter.bounds.1 / factor);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_unit_reaches_as_far_in_its_own_terms() {
        let mut parameter = FitParameter {
            name: "payload.mass@leg".to_owned(),
            unit: "kg".to_owned(),
            origin: 0.0,
            size: 0.01,
            law: Parametrisation::Linear,
            bounds: (0.0, 50.0),
            spread: 33.0,
            reach: 0.1,
            amplitude: true,
        };
        grow(&mut parameter, 8.0);
        assert!((parameter.size - 0.08).abs() < 1e-12);
        assert!((parameter.value(parameter.bounds.1) - 0.5).abs() < 1e-12);
        // Never smaller, and never so large that its bounds leave no room for two.
        grow(&mut parameter, 0.1);
        assert!((parameter.size - 0.08).abs() < 1e-12);
        grow(&mut parameter, 1e3);
        assert!((parameter.bounds.1 - 2.0).abs() < 1e-12);
    }
}
