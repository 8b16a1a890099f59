//! Looks for effects in the beginnings of logs by themselves; whoever explains those goes on to the whole.

use super::race::{FOLLOWER, Rival, race};
use super::screen::{Start, screen};
use super::state::State;
use crate::fit::judge::{NOISE, chi};
use crate::fit::{Bench, Effort, Fit, Logs};

/// Those of the candidates `offered` that lead in the beginnings of logs, as they fit the whole of them, and who was
/// screened for that. Nobody where beginnings tell no more than the whole.
pub(super) fn from_beginnings(bench: &Bench, state: &State, offered: &[usize]) -> (Vec<Rival>, Vec<Start>) {
    let Some(family) = bench.family.beginnings() else { return Default::default() };
    // With the effects found so far; if there are none, with the parameters in doubt as they were given: the ends of logs may
    // have led them astray.
    let origin = || vec![0.0; state.fit.u.len()];
    let u = if state.chosen.is_empty() { origin() } else { state.fit.u.clone() };
    let short = bench.going_on(&*family, &u);
    let Some(mut base) = Fit::at(&short, state.fit.active.clone(), u, &[]) else { return Default::default() };
    base.renew_step_error(&short);
    base.solve(&short, Effort::FULL);
    let mut bases = vec![base];
    let starts = screen(&short, &mut bases, offered);
    let leaders = race(&short, &bases, &starts, None);
    bench.count(&short);
    let lengthened = |rival: Rival| {
        let mut fit = Fit::at(bench, rival.fit.active.clone(), rival.fit.u, &state.fit.step_error)?;
        fit.solve(bench, FOLLOWER);
        if chi(fit.squares(), bench.samples(Logs::Learn)) <= NOISE {
            // Only now is the motion known whose step error is to be taken off.
            fit.renew_step_error(bench);
            fit.solve(bench, FOLLOWER);
        }
        Some(Rival { fit, ..rival })
    };
    (leaders.into_iter().filter_map(lengthened).collect(), starts)
}
