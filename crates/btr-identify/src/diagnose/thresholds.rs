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
/// Largest share by which sums of squares differ that says nothing, however many samples there are: so much do two
/// simulators of one model differ in what they make of it.
pub const INDISTINCT: f64 = 0.0025;
/// Largest error on held-out logs, if there are any, for the findings to explain it where small errors grow, so that
/// the noise floors are only roughly known. Without that, both errors must be noise.
pub const EXPLAINED: f64 = 1.5;
/// Smallest share of the squared error above the noise that the findings explain, for the rest to be called a rest,
/// unless it is below [`EXPLAINED`]: stand-ins for an unknown effect explain nine tenths now and then.
pub const MOSTLY: f64 = 0.98;
/// A finding that explains less than this share of the squared error above the noise...
pub const NEGLIGIBLE: f64 = 0.01;
/// ... and removes less than this mean square, in multiples of the noise's, from training and held-out logs, is not
/// established even where all is explained: two simulators of one model differ by as much, and a stand-in for the
/// difference is as good as the next one.
pub const NOISE: f64 = 1.0;
/// The largest probability of such a finding.
pub const AT_MOST_LITTLE: f64 = 0.9;
/// Smallest share that a finding explains by itself, while others leave an error, to be established...
pub const CONSIDERABLE: f64 = 0.05;
/// ... or, where it shows in its joint's channel alone, smallest share of what would be left there without it, ...
pub const NEEDED: f64 = 0.8;
/// ... and smallest share of the logs in which it must lower the error.
pub const IN_MOST_LOGS: f64 = 0.8;
/// ... and largest share by which its size may change if one of the training logs is left out.
pub const STABLE: f64 = 0.5;
/// Largest probability of a finding whose size changes by more: two that are small at once look like a third one that
/// differs from log to log.
pub const AT_MOST_UNSTABLE: f64 = 0.9;
/// Largest probability of a finding whose size may be none by its interval.
pub const AT_MOST_UNCERTAIN: f64 = 0.9;
/// So many instances of an effect and a similar one beside them follow nearly any law: a spring and two ripples any
/// torque that depends on the position...
pub const SERIES: usize = 2;
/// ... and the largest probability of each of them.
pub const AT_MOST_IN_SERIES: f64 = 0.9;
/// Largest probability of each of two findings at one place: of fourteen generated robots with such findings that
/// seemed certain, two had an effect there that is not in the library.
pub const AT_MOST_AT_ONE_PLACE: f64 = 0.85;
/// Largest probability of a finding while a free parameter is at its bound: what two stand-ins for an unknown effect do
/// not explain, the free parameters make up for as far as they may.
pub const AT_MOST_AT_BOUNDS: f64 = 0.9;
/// Largest error on the training logs that is noise beyond doubt: of 360 generated robots whose effects were named
/// rightly, 358 end below 1.05. An error between this and the noise bound may have another cause than what is named.
pub const CLEAN: f64 = 1.08;
/// Largest probability of a finding while an error is left.
pub const AT_MOST: f64 = 0.9;
/// Where all but noise is explained, nothing lowers B by more than about 10 any more. A candidate that explains too
/// little to be named and lowers it by more than this shows that something is left...
pub const LEFT_OVER: f64 = 25.0;
/// ... and the largest probability of a finding then: small differences between simulators show like that as well as
/// what a stand-in for an unknown effect leaves.
pub const AT_MOST_WITH_LEFT_OVER: f64 = 0.9;
