//! A few of the workers' results, computed again in this process and compared bit by bit.
//!
//! The fingerprint of an answer says that a worker computes the same at the model's nominal values. Another kind of
//! processor, or a build whose numbers differ, may agree there and not at other points.

use serde::Serialize;
use std::num::NonZeroUsize;

/// One in so many results is computed again, unless the executor says otherwise.
pub const CHECKED_ONE_IN: NonZeroUsize = match NonZeroUsize::new(100) {
    Some(one_in) => one_in,
    None => NonZeroUsize::MIN,
};

/// A result of a worker.
pub(crate) trait Numbers {
    /// Its numbers, for a message; none where a simulation failed.
    fn numbers(&self) -> Vec<f64>;
}

/// What this process knows of a batch that workers answer.
pub(crate) struct Expected<'a, T> {
    /// Number of results.
    pub(crate) count: usize,
    /// What the worker's model must give at its nominal values.
    pub(crate) fingerprint: &'a dyn Fn() -> u64,
    /// Computes a result here.
    pub(crate) again: &'a dyn Fn(usize) -> T,
    /// Names a result in a message: which simulation it is of.
    pub(crate) task: &'a dyn Fn(usize) -> String,
}

/// The results of a batch that are computed again. They follow from the batch's hash, so that they do not depend on
/// which worker is the fastest; one in `one_in` of all over many batches.
pub(super) fn chosen(batch: u64, count: usize, one_in: NonZeroUsize) -> impl Iterator<Item = usize> {
    let first = batch % one_in.get() as u64;
    (first as usize..count).step_by(one_in.get())
}

/// What differs between a worker's result and the one computed here; `None` for equal bits.
pub(super) fn difference<T: Numbers + Serialize>(theirs: &T, ours: &T) -> Option<String> {
    // The encoding holds the bits of numbers, so that a missing sample (NaN) equals itself.
    if postcard::to_allocvec(theirs) == postcard::to_allocvec(ours) {
        return None;
    }
    let (theirs, ours) = (theirs.numbers(), ours.numbers());
    if theirs.len() != ours.len() {
        return Some(format!("{} numbers there, {} here", theirs.len(), ours.len()));
    }
    let pairs = || theirs.iter().zip(&ours).filter(|(theirs, ours)| theirs.to_bits() != ours.to_bits());
    Some(match pairs().next() {
        Some((there, here)) => {
            let (differ, all) = (pairs().count(), ours.len());
            format!("{differ} of {all} numbers differ; the first is {there:?} there and {here:?} here")
        }
        None => "the simulation fails there, or here, in another way".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[derive(Serialize)]
    struct Residuals(Vec<f64>);

    impl Numbers for Residuals {
        fn numbers(&self) -> Vec<f64> {
            self.0.clone()
        }
    }

    #[test]
    fn one_in_n_results_of_many_batches_is_chosen() {
        let one_in = NonZeroUsize::new(10).unwrap();
        for count in [1, 3, 64] {
            let chosen: usize = (0..1000).map(|batch| chosen(batch, count, one_in).count()).sum();
            assert_eq!(chosen, 100 * count, "{count}");
        }
    }

    #[test]
    fn the_last_bit_of_a_number_is_a_difference_and_a_missing_sample_is_none() {
        let told = |theirs: &[f64], ours: &[f64]| difference(&Residuals(theirs.to_vec()), &Residuals(ours.to_vec()));
        assert_eq!(told(&[1.0, f64::NAN], &[1.0, f64::NAN]), None);
        assert_eq!(told(&[1.0], &[1.0, 2.0]).unwrap(), "1 numbers there, 2 here");
        let next = 0.5_f64.next_up();
        let expected = "1 of 2 numbers differ; the first is 0.5000000000000001 there and 0.5 here";
        assert_eq!(told(&[0.25, next], &[0.25, 0.5]).unwrap(), expected);
    }
}
