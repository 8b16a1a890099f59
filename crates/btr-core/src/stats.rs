//! Statistics of plain series.

/// Arithmetic mean; NaN of nothing.
pub fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// Standard deviation of the series itself (divided by N, not N - 1); NaN of nothing.
pub fn std(x: &[f64]) -> f64 {
    let mean = mean(x);
    (x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
}

/// Kendall's tau-b: how far two rankings agree, from -1 (reversed) to 1 (the same); ties are allowed.
/// M. G. Kendall, "The treatment of ties in ranking problems", Biometrika 33, 1945.
///
/// `None` where it is not defined: unequal lengths, fewer than two pairs, a series that is constant or holds a NaN.
/// Every pair is looked at, O(n²): meant for populations, not for logs.
pub fn kendall_tau_b(x: &[f64], y: &[f64]) -> Option<f64> {
    if x.len() != y.len() || x.iter().chain(y).any(|v| v.is_nan()) {
        return None;
    }
    let (mut agreement, mut untied_x, mut untied_y) = (0i64, 0i64, 0i64);
    for i in 1..x.len() {
        for j in 0..i {
            let (a, b) = (order(x[i], x[j]), order(y[i], y[j]));
            agreement += a * b;
            untied_x += a * a;
            untied_y += b * b;
        }
    }
    if untied_x == 0 || untied_y == 0 {
        return None;
    }
    // The root of a square is exact, so that a perfect ranking gives exactly 1.
    Some(agreement as f64 / (untied_x as f64 * untied_y as f64).sqrt())
}

/// 1, 0 or -1 as `a` is above, equal to or below `b`.
fn order(a: f64, b: f64) -> i64 {
    i64::from(a > b) - i64::from(a < b)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    /// Few distinct values, so that ties are common; infinite ones are failed evaluations.
    fn pairs() -> impl Strategy<Value = Vec<(f64, f64)>> {
        let value = || prop_oneof![(0u8..5).prop_map(f64::from), Just(f64::INFINITY)];
        prop::collection::vec((value(), value()), 0..12)
    }

    proptest! {
        #[test]
        fn tau_is_the_textbooks_count(pairs in pairs()) {
            let (x, y): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
            let (mut concordant, mut discordant, mut only_x_tied, mut only_y_tied) = (0.0, 0.0, 0.0, 0.0);
            for i in 0..x.len() {
                for j in i + 1..x.len() {
                    match (x[i].total_cmp(&x[j]), y[i].total_cmp(&y[j])) {
                        (a, b) if a.is_eq() && b.is_eq() => {}
                        (a, _) if a.is_eq() => only_x_tied += 1.0,
                        (_, b) if b.is_eq() => only_y_tied += 1.0,
                        (a, b) if a == b => concordant += 1.0,
                        _ => discordant += 1.0,
                    }
                }
            }
            let untied: f64 = concordant + discordant;
            let textbook = (concordant - discordant) / ((untied + only_x_tied) * (untied + only_y_tied)).sqrt();
            match kendall_tau_b(&x, &y) {
                Some(tau) => prop_assert!((tau - textbook).abs() < 1e-12),
                None => prop_assert!(textbook.is_nan()),
            }
        }

        #[test]
        fn tau_is_symmetric_and_knows_reversal(pairs in pairs()) {
            let (x, y): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
            let reversed: Vec<f64> = y.iter().map(|v| -v).collect();
            prop_assert_eq!(kendall_tau_b(&x, &y), kendall_tau_b(&y, &x));
            prop_assert_eq!(kendall_tau_b(&x, &y), kendall_tau_b(&x, &reversed).map(|tau| -tau));
        }
    }

    #[test]
    fn known_values() {
        assert_eq!(kendall_tau_b(&[1.0, 2.0, 3.0], &[10.0, 20.0, 30.0]), Some(1.0));
        // 3 concordant, 2 discordant, 1 tie in x of 6 pairs.
        let tau = kendall_tau_b(&[1.0, 1.0, 2.0, 3.0], &[2.0, 1.0, 4.0, 1.5]).unwrap();
        assert!((tau - 1.0 / 30f64.sqrt()).abs() < 1e-15, "{tau}");
        assert_eq!(kendall_tau_b(&[1.0, 1.0], &[1.0, 2.0]), None);
        assert_eq!(kendall_tau_b(&[1.0, f64::NAN], &[1.0, 2.0]), None);
        assert!((std(&[1.0, 3.0]) - 1.0).abs() < 1e-15 && (mean(&[1.0, 3.0]) - 2.0).abs() < 1e-15);
    }
}
