//! Where a joint stands still.

use super::noise::NoiseEstimate;

/// A joint stands where it stays for this long, in s, ...
const STAYS_S: f64 = 0.3;
/// ... within so many standard deviations of the reading's noise, ...
const NOISE: f64 = 6.0;
/// ... or within this share of what it usually travels in that time. Friction yields by micrometres before it slips.
const OF_TRAVEL: f64 = 2.5e-3;

/// For each reading of a position, whether the joint stands still around it: whether it stays for 0.3 s within the
/// reading's noise, or within a four-hundredth of what it usually travels in that time. Nothing is said where readings
/// are missing, and nothing stands in a constant series.
pub fn standing(clock_s: &[f64], positions: &[f64]) -> Vec<bool> {
    let mut stands = vec![false; positions.len()];
    let windows: Vec<(usize, usize)> = windows(clock_s).collect();
    let travels = windows.iter().map(|(from, to)| positions[*to] - positions[*from]).filter(|x| x.is_finite());
    let (sum, count) = travels.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
    let travel = if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 };
    let Some(noise) = NoiseEstimate::of(positions).filter(|_| travel > 0.0) else { return stands };
    // Without the least noise that is assumed, which grows with the range.
    let noise = noise.white.hypot(noise.quantum / f64::sqrt(12.0));
    let band = (NOISE * noise).max(OF_TRAVEL * travel);
    let mut marked = 0;
    for (from, to) in windows {
        // What is missing at an end may have moved, and most windows can be passed over by their ends.
        let stays = (positions[to] - positions[from]).abs() <= band;
        if stays && range(&positions[from..=to]) <= band {
            stands[marked.max(from)..=to].fill(true);
            marked = to + 1;
        }
    }
    stands
}

/// The first and the last sample of each stretch that is just long enough.
fn windows(clock_s: &[f64]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let mut to = 0;
    (0..clock_s.len()).map_while(move |from| {
        while clock_s[to] - clock_s[from] < STAYS_S {
            to += 1;
            if to == clock_s.len() {
                return None;
            }
        }
        Some((from, to))
    })
}

/// How far apart the present values are.
fn range(values: &[f64]) -> f64 {
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.iter().fold(ends, |(low, high), x| (low.min(*x), high.max(*x)));
    high - low
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
    fn a_slow_pass_is_no_standstill_however_far_the_joint_has_come() {
        // A hundred radians at about one radian a second, then 0.01 rad/s.
        let (mut clock_s, _) = readings(0.0);
        clock_s.extend((2000..24_000).map(|i| f64::from(i) * 0.005));
        let mut rng = stream(4, &[]);
        let place = |t: f64| if t < 100.0 { t + 0.3 * (2.0 * t).sin() } else { 99.74 + 0.01 * (t - 100.0) };
        let positions: Vec<f64> = clock_s.iter().map(|t| place(*t) + 1e-5 * normal(&mut rng)).collect();
        assert!(!standing(&clock_s, &positions).contains(&true));
    }

    #[test]
    fn nothing_is_said_of_readings_that_are_missing() {
        let (clock_s, mut positions) = readings(1e-5);
        clock_s.iter().zip(&mut positions).filter(|(t, _)| (1.0..1.5).contains(*t)).for_each(|(_, q)| *q = f64::NAN);
        let stands = standing(&clock_s, &positions);
        assert!(clock_s.iter().zip(&stands).all(|(t, stands)| !stands || *t > 3.9));
        assert!(!standing(&clock_s, &vec![f64::NAN; clock_s.len()]).contains(&true));
        assert!(!standing(&clock_s, &vec![0.5; clock_s.len()]).contains(&true));
    }
}
