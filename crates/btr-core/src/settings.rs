//! Checks of the numbers people write into experiment files, made while they are read.

use crate::limits::MOST_COUNTED;
use serde::de::{Deserialize, Deserializer, Error};

/// A probability, in [0, 1].
pub(crate) fn probability<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |p| (0.0..=1.0).contains(p), "a probability between 0 and 1")
}

/// A positive, finite number.
pub(crate) fn positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |x| *x > 0.0 && f64::is_finite(*x), "a positive number")
}

/// A positive, finite number, or nothing.
pub(crate) fn maybe_positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    checked_if_given(deserializer, |x| *x > 0.0 && f64::is_finite(*x), "a positive number")
}

/// A finite number that is not negative.
pub(crate) fn not_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |x| *x >= 0.0 && f64::is_finite(*x), "a number of 0 or more")
}

/// A share of something, above 0 and up to 1.
pub(crate) fn share<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |x| *x > 0.0 && *x <= 1.0, "a share above 0 and up to 1")
}

/// A count, possibly 0.
pub(crate) fn count<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    not_too_many(usize::deserialize(deserializer)?)
}

/// A count, possibly 0, or nothing.
pub(crate) fn maybe_count<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<usize>, D::Error> {
    Option::deserialize(deserializer)?.map(not_too_many).transpose()
}

/// A count of one or more.
pub(crate) fn at_least_one<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    checked(deserializer, |n| *n >= 1, "a count of 1 or more").and_then(not_too_many)
}

/// A count of two or more.
pub(crate) fn at_least_two<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    checked(deserializer, |n| *n >= 2, "a count of 2 or more").and_then(not_too_many)
}

/// A count of two or more, or nothing.
pub(crate) fn maybe_at_least_two<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<usize>, D::Error> {
    let count = checked_if_given(deserializer, |n| *n >= 2, "a count of 2 or more")?;
    count.map(not_too_many).transpose()
}

/// Bits per parameter of a Gray code.
pub(crate) fn bits<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    checked(deserializer, |n| (1..=u32::BITS).contains(n), "a number of bits between 1 and 32")
}

/// The finest binning of a series.
pub(crate) const MOST_BINS: usize = 1024;

/// Bins of a histogram.
pub(crate) fn bins<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    checked(deserializer, |n| (2..=MOST_BINS).contains(n), "a number of bins between 2 and 1024")
}

/// Refuses a count that would take all memory, or for ever.
fn not_too_many<E: Error>(count: usize) -> Result<usize, E> {
    accepted(count, |n| *n <= MOST_COUNTED, &format!("a count of {MOST_COUNTED} or less"))
}

fn checked<'de, D, T>(deserializer: D, good: impl Fn(&T) -> bool, expected: &str) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + std::fmt::Debug,
{
    accepted(T::deserialize(deserializer)?, good, expected)
}

fn checked_if_given<'de, D, T>(
    deserializer: D,
    good: impl Fn(&T) -> bool,
    expected: &str,
) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + std::fmt::Debug,
{
    Option::deserialize(deserializer)?.map(|value| accepted(value, good, expected)).transpose()
}

fn accepted<T: std::fmt::Debug, E: Error>(value: T, good: impl Fn(&T) -> bool, expected: &str) -> Result<T, E> {
    if good(&value) { Ok(value) } else { Err(E::custom(format!("expected {expected}, not {value:?}"))) }
}
