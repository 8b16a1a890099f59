//! How work is shared out.

/// How many of `jobs` to hand out at once where up to `most` are done best side by side: fewer where else some threads would have
/// nothing to do. What comes out depends on it in nothing but time.
pub(crate) fn side_by_side(most: usize, jobs: usize) -> usize {
    jobs.div_ceil(rayon::current_num_threads()).clamp(1, most.max(1))
}
