//! Quantiles of series with missing samples.

/// The value below which this share of the present samples lies.
pub(super) fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut present: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    let at = (share * present.len().saturating_sub(1) as f64).round() as usize;
    (!present.is_empty()).then(|| *present.select_nth_unstable_by(at, f64::total_cmp).1)
}
