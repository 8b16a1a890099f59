//! The dead time between a command and the motion that it causes: communication and buffers, apart from the servo's own
//! response.
//!
//! A joint at rest answers a step of its command after the dead time, and slowly at first: a velocity servo by theta
//! ~ t, a motor with inertia by theta ~ t², one whose torque builds up by theta ~ t³. Readings leave their noise
//! later, by more the smaller the step. So the onset is a parameter of a fit: the response is that of a linear
//! system of first to third order to a step that comes late, with the onset profiled by least squares, as change
//! points are (D. V. Hinkley, "Inference about the change-point in a sequence of random variables", Biometrika 57,
//! 1970). The order is the one that fits all responses of the joint best (H. Akaike, "A new look at the statistical
//! model identification", IEEE Transactions on Automatic Control 19, 1974). Where the readings do not show that the
//! torque builds up, for it is fast or they are noisy, that time counts as dead time; the interval does not allow
//! for this.

mod fit;
mod steps;
#[cfg(test)]
mod tests;

use super::stats::{kendall_tau_b, quantile, robust_std};
use super::student::student_95;
use fit::{Onset, onset};
use steps::{Response, responses};

/// What onsets say of a joint's dead time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DeadTime {
    /// It is known.
    Known {
        /// Median over the onsets, in s; slightly negative ones are noise.
        seconds: f64,
        /// 95 % interval, in s, by the onsets' spread, with half a step of the clock to both sides.
        ci95_s: [f64; 2],
        /// Number of onsets.
        onsets: usize,
    },
    /// The motion begins at different times after the steps.
    Scattered {
        /// The earliest and the latest onset, in s.
        range_s: [f64; 2],
        /// Whether it begins later after small steps, as with friction.
        small_late: bool,
        /// Number of onsets.
        onsets: usize,
    },
    /// Fewer than three steps from rest.
    TooFew {
        /// Number of onsets.
        onsets: usize,
    },
}

/// Onsets scatter if their standard deviation is this many times what noise and clock explain.
const SCATTERED: f64 = 3.0;
/// Rank correlation of step size and onset from which small steps come later, and the number of onsets that shows it.
const SMALL_LATE: (f64, usize) = (-0.6, 6);
/// Onsets of large and small steps that differ by less than this many times what noise and clock explain are alike.
const ALIKE: f64 = 2.0;
/// Standard deviation of a median beyond that of a mean, for normal errors.
const OF_MEDIAN: f64 = 1.2533;

/// The dead time in a joint's response to its command, both on one clock; NaN are missing. The command's changes take
/// effect at their samples. Command and position may be in any units.
pub fn dead_time(clock_s: &[f64], command: &[f64], position: &[f64]) -> DeadTime {
    let steps = clock_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let Some(step_s) = quantile(steps, 0.5).filter(|step_s| *step_s > 0.0) else {
        return DeadTime::TooFew { onsets: 0 };
    };
    let responses = responses(clock_s, command, position, step_s);
    let of_order = |order: usize| -> Vec<(f64, Onset)> {
        let sized = |response: &Response| Some((response.size, onset(response, order, step_s)?));
        responses.iter().filter_map(sized).collect()
    };
    let misfit = |onsets: &[(f64, Onset)]| onsets.iter().map(|(_, onset)| onset.misfit).sum::<f64>();
    let orders = [of_order(1), of_order(2), of_order(3)];
    let best = orders.iter().min_by(|a, b| misfit(a).total_cmp(&misfit(b)));
    judge(best.map_or(&[], Vec::as_slice), step_s)
}

/// What these onsets, each with the size of its response, say together.
fn judge(found: &[(f64, Onset)], step_s: f64) -> DeadTime {
    let onsets = found.len();
    let after_s = |which: &dyn Fn(f64) -> bool| -> Vec<f64> {
        found.iter().filter(|(size, _)| which(*size)).map(|(_, onset)| onset.after_s).collect()
    };
    let all = after_s(&|_| true);
    let (Some(t), Some(seconds)) = (student_95(onsets), median(all.clone())) else {
        return DeadTime::TooFew { onsets };
    };
    let spread_s = robust_std(all.iter().map(|x| x - seconds)).unwrap_or(0.0);
    let fit_s = median(found.iter().map(|(_, onset)| onset.sd_s).collect()).unwrap_or(0.0);
    let expected_s = fit_s.hypot(0.5 * step_s);
    let sizes: Vec<f64> = found.iter().map(|(size, _)| *size).collect();
    let middle = median(sizes.clone()).unwrap_or(0.0);
    let of_half = |which: &dyn Fn(f64) -> bool| median(after_s(which)).unwrap_or(seconds);
    let later_s = of_half(&|size| size < middle) - of_half(&|size| size >= middle);
    let ranked = onsets >= SMALL_LATE.1 && kendall_tau_b(&sizes, &all).is_some_and(|tau| tau <= SMALL_LATE.0);
    let small_late = ranked && later_s > ALIKE * expected_s;
    if small_late || spread_s > SCATTERED * expected_s {
        let range_s = all.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| [l.min(*x), h.max(*x)]);
        return DeadTime::Scattered { range_s, small_late, onsets };
    }
    let half_s = t * OF_MEDIAN * spread_s.max(fit_s) / (onsets as f64).sqrt() + 0.5 * step_s;
    DeadTime::Known { seconds, ci95_s: [seconds - half_s, seconds + half_s], onsets }
}

/// The median, between the two in the middle of an even number.
fn median(values: Vec<f64>) -> Option<f64> {
    let reversed = values.iter().map(|x| -x).collect();
    Some(0.5 * (quantile(values, 0.5)? - quantile(reversed, 0.5)?))
}
