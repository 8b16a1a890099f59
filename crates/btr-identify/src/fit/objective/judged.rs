//! Residuals on held-out logs that were judged lately.

use crate::fit::residual_vector::ResidualVector;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// How many numbers are kept (32 MiB).
const MOST_KEPT: usize = 1 << 22;

/// Residuals on the held-out logs, by the bits of their points.
#[derive(Default)]
pub(in crate::fit) struct Judged(Mutex<HashMap<Vec<u64>, Arc<ResidualVector>>>);

impl Judged {
    /// The residual at a point, if it is kept.
    pub(in crate::fit) fn get(&self, u: &[f64]) -> Option<Arc<ResidualVector>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(&bits(u)).cloned()
    }

    /// Keeps residuals at points; forgets earlier ones where they have become too much.
    pub(in crate::fit) fn keep<'a>(&self, residuals: impl Iterator<Item = (&'a [f64], ResidualVector)>) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.values().map(|residual| residual.len()).sum::<usize>() > MOST_KEPT {
            kept.clear();
        }
        kept.extend(residuals.map(|(u, residual)| (bits(u), Arc::new(residual))));
    }
}

fn bits(u: &[f64]) -> Vec<u64> {
    u.iter().map(|x| x.to_bits()).collect()
}
