//! By which clock a real test's log counts.

use btr_core::log::Log;

/// A log that begins so many of its steps after the test began has only lost its first rows, or stamps what it did when
/// it was done.
const SOON: f64 = 1.5;
/// A log may go on for this share of the test, or so many steps, after it.
const TAIL: (f64, f64) = (0.05, 3.0);
/// Times are rounded to this share of the test.
const ROUNDED: f64 = 1e-9;

/// A log on the clock of a test that lasts `test_s`. Where its own clock can be the test's, it is taken at its word:
/// what begins at 0.02 s has lost what came before, and what has times below zero began to record before the test,
/// which is left out. Any other clock counts from an epoch of its own, and its first row is the test's beginning. What
/// comes after the test is left out, too: no simulation goes on so long.
pub(super) fn of_test(log: Log, test_s: f64) -> Log {
    let log = begun(log, test_s);
    let ends = log.clock_s().partition_point(|t| *t <= (1.0 + ROUNDED) * test_s);
    if ends >= 2 { log.part(0..ends) } else { log }
}

/// A log counted from the test's beginning.
fn begun(log: Log, test_s: f64) -> Log {
    let (Some(&first_s), Some(&last_s)) = (log.clock_s().first(), log.clock_s().last()) else { return log };
    let step_s = log.usual_step_s().unwrap_or(0.0);
    let ends_in_time = last_s <= test_s + (TAIL.0 * test_s).max(TAIL.1 * step_s);
    if first_s >= 0.0 {
        let at_its_word = first_s <= SOON * step_s || first_s < test_s && ends_in_time;
        return if at_its_word { log } else { log.from_zero() };
    }
    // A stamp of zero may be rounded.
    let begins = log.clock_s().partition_point(|t| *t < -1e-9);
    let is_left = log.len() - begins >= 2;
    if is_left && -first_s <= test_s { log.part(begins..log.len()) } else { log.from_zero() }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// When rows begin and end that were stamped from `first_s` on, for three seconds at 50 Hz.
    fn taken(first_s: f64) -> (f64, f64) {
        let log = of_test(Log::new((0..=150).map(|k| first_s + 0.02 * f64::from(k)).collect()).unwrap(), 3.0);
        (log.clock_s()[0], log.clock_s()[log.len() - 1])
    }

    #[test]
    fn a_clock_that_can_be_the_tests_is_taken_at_its_word() {
        let near = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-6 && (b - d).abs() < 1e-6;
        // Its first row was lost, or it is stamped when a step is done; what comes a little after the test is left out.
        assert!(near(taken(0.02), (0.02, 3.0)) && near(taken(0.1), (0.1, 3.0)), "{:?}", taken(0.1));
        // It was recording before.
        assert!(near(taken(-0.1), (0.0, 2.9)), "{:?}", taken(-0.1));
        // Counted from when the computer was switched on, or from 1970.
        for epoch in [2.0, 1.7e9, -1e4] {
            assert!(near(taken(epoch), (0.0, 3.0)), "{epoch}: {:?}", taken(epoch));
        }
    }
}
