//! How work is shared out.

/// How many of `jobs` to hand out at once where up to `most` are done best side by side: so many that all threads have as
/// much to do, in as few turns as that takes. What comes out depends on it in nothing but time.
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
        fn nobody_waits_for_more_turns_than_it_takes(threads in 1usize..40, most in 1usize..70, jobs in 1usize..3000) {
            let at_once = shared_among(threads, most, jobs);
            prop_assert!((1..=most).contains(&at_once));
            let turns = jobs.div_ceil(at_once).div_ceil(threads);
            prop_assert_eq!(turns, jobs.div_ceil(threads * most));
            // No thread has more to do than its share, rounded up in each turn.
            prop_assert!(turns * at_once < jobs.div_ceil(threads) + turns);
        }
    }
}
