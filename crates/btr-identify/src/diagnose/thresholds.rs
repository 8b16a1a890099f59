//! Thresholds of decisions. All errors are root mean squares in multiples of the noise floor.

/// An effect must lower B by more than this...
pub const DECISIVE: f64 = 10.0;
/// ... and the sum of squares by more than this share...
pub const LEARNT_FALL: f64 = 0.05;
/// ... and that of the held-out logs by more than this.
pub const HELD_OUT_FALL: f64 = 0.04;
/// A difference of B not worth more than a bare mention (R. E. Kass and A. E. Raftery, "Bayes factors", Journal of
/// the American Statistical Association 90, 1995): the rival with the fewest parameters is named.
pub const TIE: f64 = 2.0;
/// Largest error, on held-out logs if there are any, for the effects found to explain it.
pub const EXPLAINED: f64 = 1.5;
