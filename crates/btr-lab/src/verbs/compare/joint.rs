//! How far a joint is off, and what its error looks like.

use super::words::{late_by, size, times};
use btr_core::log::{Log, interpolate};
use btr_identify::compare::{ChannelError, Clue, Comparison, Regime, RegimeCell};
use serde::Serialize;

/// Error in noise floors above which a joint has a sentence of its own.
pub(super) const OFF: f64 = 2.0;
/// Share of the squared error that a shift in time must remove to be its cause.
const MOST: f64 = 0.5;
/// A regime is told where its error exceeds that of the whole joint by this factor.
const LARGER: f64 = 1.2;

/// A comparison that is judged.
pub(super) struct Compared<'a> {
    /// The errors.
    pub(super) comparison: &'a Comparison,
    /// The logs.
    pub(super) logs: &'a [Log],
    /// How far runs of the same command differ in a channel, where that is more than its noise.
    pub(super) repeatability: &'a dyn Fn(&str) -> Option<f64>,
}

/// How far a joint is off.
#[derive(Clone, Debug, Serialize)]
pub struct JointVerdict {
    /// The joint.
    pub joint: String,
    /// The channel by which it is judged.
    pub channel: String,
    /// SI unit as text.
    pub unit: String,
    /// Root mean square error, in the unit.
    pub rmse: f64,
    /// The same in noise floors.
    pub x_noise_floor: f64,
    /// What the error looks like; `None` within two noise floors, or where it looks like nothing known.
    pub cause: Option<Cause>,
    /// All of this in one sentence; `None` within two noise floors.
    pub sentence: Option<String>,
}

/// What an error looks like.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// What kind of error it is.
    pub kind: CauseKind,
    /// The share of the joint's squared error that it accounts for.
    pub share: f64,
    /// How late the measured motion is, in s, where that is the cause.
    pub lag_s: Option<f64>,
    /// The quantity that the residual follows, where that is the cause.
    pub follows: Option<Clue>,
}

/// Kinds of causes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// Shifting the measured motion in time removes most of the squared error.
    Late,
    /// The error is about the same everywhere.
    Offset,
    /// The error correlates with a quantity.
    Follows,
}

pub(super) fn of_joint(compared: &Compared, joint: &str, channel: &ChannelError) -> JointVerdict {
    let ChannelError { name, unit, rmse, chi, .. } = channel;
    let cells = || compared.comparison.cells.iter().filter(|cell| cell.joint == joint);
    let whole = cells().find(|cell| cell.regime == Regime::Throughout);
    let is_off = *chi > OFF;
    // What is late follows the velocity as well, but the shift in time then accounts for more.
    let causes = late(compared, channel).into_iter().chain(whole.and_then(looks_like));
    let cause = causes.max_by(|a, b| a.share.total_cmp(&b.share)).filter(|_| is_off);
    let sentence = is_off.then(|| {
        let runs = (compared.repeatability)(name).map_or_else(String::new, |spread| {
            format!(", {} x what runs of the same command differ by", times(rmse / spread))
        });
        let looks = looks(cause, whole, cells());
        format!("{joint}: {} x the noise floor ({} rms){runs}; {looks}", times(*chi), size(*rmse, unit))
    });
    let (joint, channel, unit) = (joint.to_owned(), name.clone(), unit.clone());
    JointVerdict { joint, channel, unit, rmse: *rmse, x_noise_floor: *chi, cause, sentence }
}

/// Whether shifting the measured positions by their lag removes most of the squared error.
fn late(compared: &Compared, channel: &ChannelError) -> Option<Cause> {
    let lag_s = channel.lag_s.filter(|_| channel.name.starts_with("q_"))?;
    let (mut before, mut after) = (0.0, 0.0);
    for residual in compared.comparison.residuals.iter().filter(|residual| residual.channel == channel.name) {
        let clock_s = compared.logs[residual.log].clock_s();
        let (first, last) = (*clock_s.first()?, *clock_s.last()?);
        let earlier_s: Vec<f64> = clock_s.iter().map(|t| t - lag_s).collect();
        let shifted = interpolate(clock_s, &residual.simulated, &earlier_s);
        for (k, &error) in residual.error.iter().enumerate() {
            let left = error + residual.simulated[k] - shifted[k];
            if (first..=last).contains(&earlier_s[k]) && error.is_finite() && left.is_finite() {
                before += (error / residual.floor).powi(2);
                after += (left / residual.floor).powi(2);
            }
        }
    }
    let share = 1.0 - after / before;
    (share > MOST).then_some(Cause { kind: CauseKind::Late, share, lag_s: Some(lag_s), follows: None })
}

/// The clue that the residual follows throughout, with the share of its square that this accounts for.
fn looks_like(whole: &RegimeCell) -> Option<Cause> {
    let found = whole.clue?;
    let cause = |kind, share, follows| Cause { kind, share, lag_s: None, follows };
    Some(match found.clue {
        Clue::Constant => cause(CauseKind::Offset, (whole.bias / whole.rmse).powi(2), None),
        clue => cause(CauseKind::Follows, found.correlation.powi(2), Some(clue)),
    })
}

/// What a joint's error looks like, and where it is largest.
fn looks<'a>(cause: Option<Cause>, whole: Option<&RegimeCell>, cells: impl Iterator<Item = &'a RegimeCell>) -> String {
    let looks = match cause {
        Some(Cause { kind: CauseKind::Late, share, lag_s: Some(lag_s), .. }) => {
            return format!("it arrives {}: {:.0} % of its squared error", late_by(lag_s), 100.0 * share);
        }
        Some(Cause { kind: CauseKind::Offset, .. }) => return "its error is an offset".to_owned(),
        Some(Cause { follows: Some(clue), .. }) => format!("the residual follows {}", clue.words()),
        _ => "the residual follows no single quantity".to_owned(),
    };
    let Some(cell) = largest(whole, cells) else { return looks };
    let own = cell.clue.filter(|own| cause.is_some_and(|cause| cause.follows.is_some_and(|all| all != own.clue)));
    let own = match own.map(|own| own.clue) {
        Some(Clue::Constant) => ", where it is an offset".to_owned(),
        Some(clue) => format!(", where it follows {}", clue.words()),
        None => String::new(),
    };
    format!("{looks}, largest {}{own}", cell.regime.words())
}

/// The regime in which a joint's error is largest, where that says more than the whole.
pub(super) fn largest<'a>(
    whole: Option<&RegimeCell>,
    cells: impl Iterator<Item = &'a RegimeCell>,
) -> Option<&'a RegimeCell> {
    let whole = whole?;
    let told = cells.filter(|cell| cell.regime != Regime::Throughout && cell.chi > LARGER * whole.chi);
    told.max_by(|a, b| telling(a, whole).total_cmp(&telling(b, whole)))
}

/// By how much a regime's share of its joint's squared error exceeds its share of the time.
fn telling(cell: &RegimeCell, whole: &RegimeCell) -> f64 {
    cell.share / whole.share - cell.samples as f64 / whole.samples as f64
}
