//! Batch sizes of parallel work.

/// Batch size for `jobs` of which up to `most` run best side by side: all threads get equal work in as few turns as
/// possible. The batch size affects time only, never results.
pub fn side_by_side(most: usize, jobs: usize) -> usize {
    shared_among(rayon::current_num_threads(), most.max(1), jobs)
}

fn shared_among(threads: usize, most: usize, jobs: usize) -> usize {
    let turns = jobs.div_ceil(threads * most).max(1);
    jobs.div_ceil(threads * turns).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn batches_take_no_more_turns_than_necessary(threads in 1usize..40, most in 1usize..70, jobs in 1usize..3000) {
            let at_once = shared_among(threads, most, jobs);
            prop_assert!((1..=most).contains(&at_once));
            let turns = jobs.div_ceil(at_once).div_ceil(threads);
            prop_assert_eq!(turns, jobs.div_ceil(threads * most));
            // No thread has more to do than its share, rounded up in each turn.
            prop_assert!(turns * at_once < jobs.div_ceil(threads) + turns);
        }
    }
}
