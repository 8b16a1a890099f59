//! Quantiles of series with missing samples.

/// The value below which this share of what is there lies.
pub(super) fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut there: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    let at = (share * there.len().saturating_sub(1) as f64).round() as usize;
    (!there.is_empty()).then(|| *there.select_nth_unstable_by(at, f64::total_cmp).1)
}
