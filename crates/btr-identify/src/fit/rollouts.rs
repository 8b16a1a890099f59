//! Rollouts: many at once, and several small changes in one where each is felt in channels of its own.

use crate::residual_model::{RecordedLog, ResidualModel, ResidualRequest, TimeStep};
use btr_core::parallel::side_by_side;
use btr_core::world::WorldError;
use rayon::prelude::*;
use std::ops::Range;

/// What is made of each of some rollouts' residuals, given its log; as many as are best are simulated side by side.
pub(super) fn each<T: Send>(
    model: &dyn ResidualModel,
    batch_size: usize,
    rollouts: &[ResidualRequest],
    step: TimeStep,
    made: &(dyn Fn(usize, Result<Vec<f64>, WorldError>) -> T + Sync),
) -> Vec<T> {
    let at_once = side_by_side(batch_size, rollouts.len());
    let run = |few: &[ResidualRequest]| {
        let residuals = model.residuals(few, step);
        few.iter().zip(residuals).map(|(rollout, residual)| made(rollout.log, residual)).collect::<Vec<T>>()
    };
    rollouts.par_chunks(at_once).with_max_len(1).flat_map_iter(run).collect()
}

/// Changes that share a simulation, by the channels in which each is felt: first come, first served. What is felt everywhere
/// (no channels) is alone.
pub fn shared<'a>(near: impl Iterator<Item = &'a [String]>) -> Vec<Vec<usize>> {
    let mut shots: Vec<(Vec<usize>, Vec<&str>)> = Vec::new();
    for (index, near) in near.enumerate() {
        let free = |taken: &[&str]| !taken.is_empty() && near.iter().all(|name| !taken.contains(&name.as_str()));
        let found = if near.is_empty() { None } else { shots.iter_mut().find(|(_, taken)| free(taken)) };
        let names = near.iter().map(String::as_str);
        match found {
            Some((members, taken)) => {
                members.push(index);
                taken.extend(names);
            }
            None => shots.push((vec![index], names.collect())),
        }
    }
    shots.into_iter().map(|(members, _)| members).collect()
}

/// The rows of a log's residual in which a change is felt that is near these channels.
pub fn rows_near(log: &RecordedLog, near: &[String]) -> Vec<Range<usize>> {
    if near.is_empty() {
        return std::iter::once(0..log.rows()).collect();
    }
    log.channels.iter().filter(|channel| near.contains(&channel.name)).map(|channel| channel.samples.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_shares_a_simulation_with_what_is_felt_where_it_is() {
        let names = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let near = ["a b", "a b", "c", "", "d", "b", ""].map(names);
        let shots = shared(near.iter().map(Vec::as_slice));
        assert_eq!(shots, [vec![0, 2, 4], vec![1], vec![3], vec![5], vec![6]]);
    }
}
