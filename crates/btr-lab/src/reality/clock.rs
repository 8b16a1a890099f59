//! Conversion of a real test's log to the test's clock.

use btr_core::log::Log;

/// A log that begins at most this many of its steps after the test has lost its first rows, or stamps each step at its
/// end.
const SOON: f64 = 1.5;
/// How long a log may continue after the test: a share of the test, or a number of steps.
const TAIL: (f64, f64) = (0.05, 3.0);
/// Tolerance for rounded times, as a share of the test.
const ROUNDED: f64 = 1e-9;

/// Converts a log to the clock of a test that lasts `test_s`. A clock that can be the test's is kept: a log that begins
/// at 0.02 s has lost its first rows, and one with negative times began recording before the test, which is cut off.
/// Any other clock counts from its own epoch, and its first row is the test's beginning. Rows after the test are cut
/// off: simulations end there.
pub(super) fn of_test(log: Log, test_s: f64) -> Log {
    let log = begun(log, test_s);
    let ends = log.clock_s().partition_point(|t| *t <= (1.0 + ROUNDED) * test_s);
    if ends >= 2 { log.part(0..ends) } else { log }
}

/// A log with times from the test's beginning.
fn begun(log: Log, test_s: f64) -> Log {
    let (Some(&first_s), Some(&last_s)) = (log.clock_s().first(), log.clock_s().last()) else { return log };
    let step_s = log.usual_step_s().unwrap_or(0.0);
    let ends_in_time = last_s <= test_s + (TAIL.0 * test_s).max(TAIL.1 * step_s);
    if first_s >= 0.0 {
        let at_its_word = first_s <= SOON * step_s || first_s < test_s && ends_in_time;
        return if at_its_word { log } else { log.from_zero() };
    }
    // A time stamp of zero may be rounded.
    let begins = log.clock_s().partition_point(|t| *t < -1e-9);
    let is_left = log.len() - begins >= 2;
    if is_left && -first_s <= test_s { log.part(begins..log.len()) } else { log.from_zero() }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// First and last time of a converted log with time stamps from `first_s` on, for three seconds at 50 Hz.
    fn taken(first_s: f64) -> (f64, f64) {
        let log = of_test(Log::new((0..=150).map(|k| first_s + 0.02 * f64::from(k)).collect()).unwrap(), 3.0);
        (log.clock_s()[0], log.clock_s()[log.len() - 1])
    }

    #[test]
    fn a_clock_that_can_be_the_tests_is_kept() {
        let near = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-6 && (b - d).abs() < 1e-6;
        // Its first row was lost, or steps are stamped at their end; rows shortly after the test are cut off.
        assert!(near(taken(0.02), (0.02, 3.0)) && near(taken(0.1), (0.1, 3.0)), "{:?}", taken(0.1));
        // It began recording before the test.
        assert!(near(taken(-0.1), (0.0, 2.9)), "{:?}", taken(-0.1));
        // Times since the computer was switched on, or since 1970.
        for epoch in [2.0, 1.7e9, -1e4] {
            assert!(near(taken(epoch), (0.0, 3.0)), "{epoch}: {:?}", taken(epoch));
        }
    }
}
