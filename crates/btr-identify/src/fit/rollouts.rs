//! Rollouts: many at once, and several small changes in one rollout where they affect disjoint channels.

use crate::residual_model::{RecordedLog, ResidualRequest};
use btr_core::parallel::side_by_side;
use btr_core::world::WorldError;
use rayon::prelude::*;
use std::ops::Range;

/// Answers requests, in their order.
pub(super) type Answer<'a> = dyn Fn(&[ResidualRequest]) -> Vec<Result<Vec<f64>, WorldError>> + Sync + 'a;

/// Applies `convert` to the log and residual of each request. Requests are simulated in batches of the best size.
pub(super) fn each<T: Send>(
    batch_size: usize,
    requests: &[ResidualRequest],
    simulate: &Answer,
    convert: &(dyn Fn(usize, Result<Vec<f64>, WorldError>) -> T + Sync),
) -> Vec<T> {
    let size = side_by_side(batch_size, requests.len());
    let run = |batch: &[ResidualRequest]| {
        let residuals = simulate(batch);
        batch.iter().zip(residuals).map(|(request, residual)| convert(request.log, residual)).collect::<Vec<T>>()
    };
    requests.par_chunks(size).with_max_len(1).flat_map_iter(run).collect()
}

/// Groups changes that can share a simulation, given the channels that each affects: each change joins the first group
/// without common channels. A change that affects all channels (an empty list) is alone.
pub fn shared<'a>(near: impl Iterator<Item = &'a [String]>) -> Vec<Vec<usize>> {
    let mut groups: Vec<(Vec<usize>, Vec<&str>)> = Vec::new();
    for (index, near) in near.enumerate() {
        let free = |taken: &[&str]| !taken.is_empty() && near.iter().all(|name| !taken.contains(&name.as_str()));
        let found = if near.is_empty() { None } else { groups.iter_mut().find(|(_, taken)| free(taken)) };
        let names = near.iter().map(String::as_str);
        match found {
            Some((members, taken)) => {
                members.push(index);
                taken.extend(names);
            }
            None => groups.push((vec![index], names.collect())),
        }
    }
    groups.into_iter().map(|(members, _)| members).collect()
}

/// The rows of a log's residual that belong to these channels; all rows without any.
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
    fn changes_that_affect_a_common_channel_never_share_a_simulation() {
        let names = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let near = ["a b", "a b", "c", "", "d", "b", ""].map(names);
        let groups = shared(near.iter().map(Vec::as_slice));
        assert_eq!(groups, [vec![0, 2, 4], vec![1], vec![3], vec![5], vec![6]]);
    }
}
