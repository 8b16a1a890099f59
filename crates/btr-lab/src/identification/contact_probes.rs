//! How large a change must be to show on the ground. Contact answers a change that is too small with noise of its own, and the
//! typical sizes of effects were made for a desk arm, whose motion shows the least of them.

use super::IdentificationProblem;
use btr_core::world::WorldError;
use btr_identify::fit::{rows_near, shared, squares};
use btr_identify::residual_model::{FitParameter, Parametrisation, ResidualModel, ResidualRequest, TimeStep};
use rayon::prelude::*;

/// What a unit of an amplitude should show, and what the reach of a difference, where it shows best: in noise floors.
const UNIT: f64 = 3.0;
const REACH: f64 = 0.3;
/// How many times larger a unit may become, and how many standard deviations the reach of a number in doubt.
const LARGEST: f64 = 30.0;
const WIDEST: f64 = 0.5;

/// A knob that is moved by so much, from where its shapes put it.
struct ParameterTrial {
    knob: usize,
    near: Vec<String>,
    shapes: Vec<(usize, f64)>,
    by: f64,
}

/// Enlarges the units of amplitudes, and the reaches of what is in doubt, until they show in the log that the model as
/// it stands explains least. Limits bind where they bind, whatever their unit.
pub(super) fn enlarge(beside: &mut IdentificationProblem) -> Result<(), WorldError> {
    let origin = vec![0.0; beside.knobs.len()];
    let Some((log, usual)) = worst(beside, &origin)? else { return Ok(()) };
    let tries = tries(beside);
    let shots = shared(tries.iter().map(|attempt| attempt.near.as_slice()));
    let simulated = |shot: &Vec<usize>| {
        let mut u = origin.clone();
        for ParameterTrial { knob, shapes, by, .. } in shot.iter().map(|&i| &tries[i]) {
            shapes.iter().for_each(|&(knob, shape)| u[knob] = shape);
            u[*knob] = *by;
        }
        beside.residual(ResidualRequest::of(&u, log), TimeStep::USUAL).ok()
    };
    let answers: Vec<Option<Vec<f64>>> = shots.par_iter().map(simulated).collect();
    let mut shown = vec![None; tries.len()];
    for (shot, answer) in shots.iter().zip(&answers) {
        for &i in shot {
            shown[i] = answer.as_ref().map(|there| shows(beside, log, &tries[i].near, &usual, there));
        }
    }
    for (attempt, shown) in tries.iter().zip(shown) {
        let knob = &mut beside.knobs[attempt.knob];
        match shown {
            Some(shown) if knob.amplitude => grow(knob, UNIT * attempt.by / shown),
            Some(shown) => knob.reach = (REACH * attempt.by / shown).clamp(knob.reach, WIDEST.max(knob.reach)),
            None => {}
        }
    }
    Ok(())
}

/// The log to learn from that the model as it stands explains least, with its residual.
fn worst(beside: &IdentificationProblem, origin: &[f64]) -> Result<Option<(usize, Vec<f64>)>, WorldError> {
    let mut worst: Option<(f64, usize, Vec<f64>)> = None;
    for log in (0..beside.logs.len()).filter(|&log| !beside.logs[log].held_out) {
        let residual = beside.residual(ResidualRequest::of(origin, log), TimeStep::USUAL)?;
        let finite: Vec<f64> = residual.iter().copied().filter(|r| r.is_finite()).collect();
        let size = squares(&finite);
        if worst.as_ref().is_none_or(|(most, ..)| size > *most) {
            worst = Some((size, log, residual));
        }
    }
    Ok(worst.map(|(_, log, residual)| (log, residual)))
}

/// What is in doubt, by its reach, and the amplitudes of effects, by a unit.
fn tries(beside: &IdentificationProblem) -> Vec<ParameterTrial> {
    let doubtful = beside.doubtful.iter().map(|&knob| {
        let by = beside.knobs[knob].reach;
        ParameterTrial { knob, near: Vec::new(), shapes: Vec::new(), by }
    });
    let of_candidates = beside.candidates.iter().zip(&beside.near).flat_map(|(candidate, near)| {
        let shapes: Vec<(usize, f64)> =
            candidate.shapes.iter().copied().zip(candidate.starts[0].iter().copied()).collect();
        let linear = candidate.amplitudes.iter().filter(|&&knob| beside.knobs[knob].law == Parametrisation::Linear);
        linear.map(move |&knob| {
            let by = beside.knobs[knob].clamp(1.0);
            ParameterTrial { knob, near: near.clone(), shapes: shapes.clone(), by }
        })
    });
    doubtful.chain(of_candidates).collect()
}

/// What a change is to a log, in noise floors: the root mean square in the channel where it shows best.
fn shows(beside: &IdentificationProblem, log: usize, near: &[String], usual: &[f64], there: &[f64]) -> f64 {
    let recorded = &beside.logs[log];
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
fn grow(knob: &mut FitParameter, factor: f64) {
    let widest = knob.bounds.0.abs().max(knob.bounds.1) / 2.0;
    let factor = factor.min(LARGEST).min(widest).max(1.0);
    knob.size *= factor;
    knob.bounds = (knob.bounds.0 / factor, knob.bounds.1 / factor);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_unit_reaches_as_far_in_its_own_terms() {
        let mut knob = FitParameter {
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
        grow(&mut knob, 8.0);
        assert!((knob.size - 0.08).abs() < 1e-12);
        assert!((knob.value(knob.bounds.1) - 0.5).abs() < 1e-12);
        // Never smaller, and never so large that its bounds leave no room for two.
        grow(&mut knob, 0.1);
        assert!((knob.size - 0.08).abs() < 1e-12);
        grow(&mut knob, 1e3);
        assert!((knob.bounds.1 - 2.0).abs() < 1e-12);
    }
}
