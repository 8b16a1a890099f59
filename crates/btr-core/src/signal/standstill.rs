//! Where a joint stands still.

use super::noise::NoiseEstimate;

/// A joint stands where it stays for this long, in s, ...
const STAYS_S: f64 = 0.3;
/// ... within so many standard deviations of the reading's noise, or within this share of its whole range. Friction
/// yields by micrometres before it slips.
const WITHIN: (f64, f64) = (6.0, 5e-4);

/// For each reading of a position, whether the joint stands still around it. A series that is constant has no range to
/// compare with: nothing stands there.
pub fn standing(clock_s: &[f64], positions: &[f64]) -> Vec<bool> {
    let mut stands = vec![false; positions.len()];
    let (low, high) = bounds(positions);
    let Some(noise) = NoiseEstimate::of(positions).filter(|_| low < high) else { return stands };
    let band = (WITHIN.0 * noise.sigma()).max(WITHIN.1 * (high - low));
    let mut marked = 0;
    let mut from = 0;
    for to in 0..positions.len() {
        while clock_s[to] - clock_s[from] >= STAYS_S {
            let (low, high) = bounds(&positions[from..=to]);
            if high - low <= band {
                stands[marked.max(from)..=to].fill(true);
                marked = to + 1;
            }
            from += 1;
        }
    }
    stands
}

/// The smallest and the largest of the present values.
fn bounds(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::{normal, stream};

    /// A sine of one radian over ten seconds at 200 Hz, held from 4 s to 6 s, with noise.
    fn readings(noise: f64) -> (Vec<f64>, Vec<f64>) {
        let mut rng = stream(3, &[]);
        let clock_s: Vec<f64> = (0..2000).map(|i| f64::from(i) * 0.005).collect();
        let moved_s = |t: f64| if t < 4.0 { t } else { (t - 2.0).max(4.0) };
        let positions = clock_s.iter().map(|t| moved_s(*t).sin() + noise * normal(&mut rng)).collect();
        (clock_s, positions)
    }

    #[test]
    fn a_joint_stands_while_it_is_held_and_not_where_it_turns_back() {
        for noise in [1e-6, 1e-4] {
            let (clock_s, positions) = readings(noise);
            let stands = standing(&clock_s, &positions);
            for (t, stands) in clock_s.iter().zip(&stands) {
                let inside = (4.02..5.98).contains(t);
                let outside = !(3.98..6.02).contains(t);
                assert!(!inside || *stands, "{t} s, noise {noise}");
                assert!(!outside || !*stands, "{t} s, noise {noise}");
            }
        }
    }

    #[test]
    fn what_never_moves_or_is_missing_does_not_stand() {
        let clock_s: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.01).collect();
        assert!(!standing(&clock_s, &[0.5; 100]).contains(&true));
        assert!(!standing(&clock_s, &[f64::NAN; 100]).contains(&true));
    }
}
