//! Trajectory of the centre of mass for a given trajectory of the zero-moment point (ZMP).
//!
//! On the cart-table model p = x − x"·h/g (Kajita et al., "Biped walking pattern generation by using preview control of
//! zero-moment point", ICRA 2003) the bounded solution for a ZMP known in advance has a closed form: x is p convolved
//! with exp(−ω|t|)·ω/2, ω = √(g/h). It splits into two first-order lags of rate ω, one backward in time (which gives
//! the capture point) and one forward.

/// Standard gravity in m/s².
pub(super) const GRAVITY: f64 = 9.81;

/// One coordinate of the centre of mass at height `height_m` for the ZMP `zmp_m`, both sampled every `step_s` and in m.
/// It starts at rest over the first value and comes to rest over the last one.
pub fn com_for_zmp(zmp_m: &[f64], height_m: f64, step_s: f64) -> Vec<f64> {
    let omega_step = (GRAVITY / height_m).sqrt() * step_s;
    let mut com = zmp_m.to_vec();
    com.reverse();
    lag(&mut com, omega_step);
    com.reverse();
    if let (Some(first), Some(start)) = (com.first_mut(), zmp_m.first()) {
        *first = *start;
    }
    lag(&mut com, omega_step);
    com
}

/// First-order lag of a signal that is linear between samples; exact for any step.
fn lag(signal: &mut [f64], omega_step: f64) {
    let decay = (-omega_step).exp();
    let Some(&first) = signal.first() else { return };
    let (mut before, mut output) = (first, first);
    for value in &mut signal[1..] {
        let behind = (*value - before) / omega_step;
        output = *value - behind + (output - before + behind) * decay;
        before = *value;
        *value = output;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The model's equation, by finite differences: p = x − x"·h/g.
        #[test]
        fn com_obeys_the_cart_table(height in 0.1..1.0f64, place in 0.02..0.2f64, rate in 1.0..6.0f64) {
            let step = 1e-3;
            let zmp: Vec<f64> = (0..4000).map(|i| place * (rate * i as f64 * step).sin().powi(3)).collect();
            let com = com_for_zmp(&zmp, height, step);
            for i in 1500..2500 {
                let acceleration = (com[i + 1] - 2.0 * com[i] + com[i - 1]) / (step * step);
                prop_assert!((com[i] - acceleration * height / GRAVITY - zmp[i]).abs() < 1e-4 * place.max(0.1));
            }
        }
    }

    #[test]
    fn a_resting_zmp_keeps_the_com_over_it() {
        assert!(com_for_zmp(&[0.03; 50], 0.2, 0.01).iter().all(|x| (x - 0.03).abs() < 1e-15));
    }
}
