//! The map of failures: joint x regime, over all logs.

use super::clue::Clue;
use super::pair::LogPair;
use super::regime::Regime;
use super::track::JointTrack;
use btr_core::signal::stats::correlation;
use indexmap::IndexMap;

/// Fewest samples of a cell.
const FEWEST: usize = 10;
/// Error, in noise floors, above which a cell is a failure: below it, the noise floor itself is too uncertain.
const ABOVE_NOISE: f64 = 1.3;
/// The window of a failure holds this share of its squared error.
const WINDOW_SHARE: f64 = 0.8;
/// Smallest correlation of a clue that is reported.
const FOLLOWS: f64 = 0.35;
/// Smallest share of the mean square for the mean error to count as an offset.
const OFFSET_SHARE: f64 = 0.7;

/// A joint in a regime.
#[derive(Clone, Debug, PartialEq)]
pub struct RegimeCell {
    /// The joint.
    pub joint: String,
    /// The regime.
    pub regime: Regime,
    /// The log that holds most of the cell's squared error, by name.
    pub log: String,
    /// Begin of the window that holds most of it, in s.
    pub t0_s: f64,
    /// End of that window, in s.
    pub t1_s: f64,
    /// Samples.
    pub samples: usize,
    /// Root mean square error in rad (m).
    pub rmse: f64,
    /// The same in noise floors.
    pub chi: f64,
    /// Mean error in rad (m).
    pub bias: f64,
    /// Its share of the squared error of all joints.
    pub share: f64,
    /// By how much that exceeds its share of the time.
    pub excess: f64,
    /// The clue that the error correlates with best; `None` without any.
    pub clue: Option<FoundClue>,
    /// A summary in one sentence.
    pub hint: String,
}

/// A clue that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundClue {
    /// The clue.
    pub clue: Clue,
    /// Pearson's correlation of residual and clue.
    pub correlation: f64,
}

impl RegimeCell {
    /// Whether the error is more than noise.
    pub(super) fn is_failure(&self) -> bool {
        self.chi > ABOVE_NOISE && (self.excess > 0.0 || self.regime == Regime::Throughout)
    }
}

/// All cells, joint by joint.
pub(super) fn cells(tracks: &[JointTrack], episodes: &[LogPair]) -> Vec<RegimeCell> {
    let squares = |track: &JointTrack| -> f64 {
        track.error.iter().filter(|e| e.is_finite()).map(|e| (e / track.floor).powi(2)).sum()
    };
    let samples = |track: &JointTrack| track.error.iter().filter(|e| e.is_finite()).count() as f64;
    let whole = (tracks.iter().map(squares).sum(), tracks.iter().map(samples).sum());
    let mut joints: IndexMap<&str, Vec<&JointTrack>> = IndexMap::new();
    tracks.iter().for_each(|track| joints.entry(&track.joint).or_default().push(track));
    let of_joint = |tracks: &Vec<&JointTrack>| -> Vec<RegimeCell> {
        Regime::ALL.into_iter().filter_map(|regime| cell(regime, tracks, whole, episodes)).collect()
    };
    joints.values().flat_map(of_joint).collect()
}

/// A joint's cell; `whole` is the squared error (in noise floors) and the number of samples of all joints.
fn cell(regime: Regime, tracks: &[&JointTrack], whole: (f64, f64), episodes: &[LogPair]) -> Option<RegimeCell> {
    let parts: Vec<RegimePart> = tracks.iter().filter_map(|track| RegimePart::new(track, regime)).collect();
    let errors = || parts.iter().flat_map(|part| part.indices.iter().map(|i| (part.track.error[*i], part.track.floor)));
    let samples = errors().count();
    if samples < FEWEST {
        return None;
    }
    let n = samples as f64;
    let (sum, square, in_floors) = errors().fold((0.0, 0.0, 0.0), |(sum, square, in_floors), (e, floor)| {
        (sum + e, square + e * e, in_floors + (e / floor).powi(2))
    });
    let worst = parts.iter().max_by(|a, b| a.squares().total_cmp(&b.squares()))?;
    let (t0_s, t1_s) = worst.window();
    let share = if whole.0 > 0.0 { in_floors / whole.0 } else { 0.0 };
    let mut cell = RegimeCell {
        joint: worst.track.joint.clone(),
        regime,
        log: episodes[worst.track.log].name.to_owned(),
        t0_s,
        t1_s,
        samples,
        rmse: (square / n).sqrt(),
        chi: (in_floors / n).sqrt(),
        bias: sum / n,
        share,
        excess: share - n / whole.1,
        clue: None,
        hint: String::new(),
    };
    cell.clue = clue(&cell, &parts);
    cell.hint = hint(&cell);
    Some(cell)
}

/// A regime of a joint in one log.
struct RegimePart<'a> {
    track: &'a JointTrack,
    indices: Vec<usize>,
}

impl<'a> RegimePart<'a> {
    fn new(track: &'a JointTrack, regime: Regime) -> Option<Self> {
        let (_, mask) = track.regimes.iter().find(|(of, _)| *of == regime)?;
        let indices = (0..mask.len()).filter(|i| mask[*i]).collect();
        Some(RegimePart { track, indices })
    }

    fn square(&self, k: usize) -> f64 {
        self.track.error[self.indices[k]].powi(2)
    }

    fn squares(&self) -> f64 {
        (0..self.indices.len()).map(|k| self.square(k)).sum::<f64>() / self.track.floor.powi(2)
    }

    /// The shortest time in which most of the squared error happens.
    fn window(&self) -> (f64, f64) {
        let time = |k: usize| self.track.clock_s[self.indices[k]];
        let last = self.indices.len() - 1;
        let enough = WINDOW_SHARE * (0..=last).map(|k| self.square(k)).sum::<f64>();
        let (mut best, mut held, mut from) = ((time(0), time(last)), 0.0, 0);
        for to in 0..=last {
            held += self.square(to);
            while from < to && held - self.square(from) >= enough {
                held -= self.square(from);
                from += 1;
            }
            if held >= enough && time(to) - time(from) < best.1 - best.0 {
                best = (time(from), time(to));
            }
        }
        best
    }
}

/// The clue that the error of a cell correlates with best.
fn clue(cell: &RegimeCell, parts: &[RegimePart]) -> Option<FoundClue> {
    if cell.bias.powi(2) > OFFSET_SHARE * cell.rmse.powi(2) {
        return Some(FoundClue { clue: Clue::Constant, correlation: cell.bias.signum() });
    }
    let errors: Vec<f64> = gather(parts, |track| Some(&track.error));
    let clues = &parts.first()?.track.clues;
    let found = clues.iter().enumerate().filter_map(|(k, (clue, _))| {
        let series = gather(parts, |track| track.clues.get(k).filter(|(of, _)| of == clue).map(|(_, series)| series));
        Some(FoundClue { clue: *clue, correlation: correlation(&errors, &series)? })
    });
    let best = found.max_by(|a, b| a.correlation.abs().total_cmp(&b.correlation.abs()))?;
    (best.correlation.abs() >= FOLLOWS).then_some(best)
}

/// A series of every part, one after the other; NaN where a part does not have it.
fn gather<'a>(parts: &'a [RegimePart], series: impl Fn(&'a JointTrack) -> Option<&'a Vec<f64>>) -> Vec<f64> {
    let values = |part: &'a RegimePart| {
        let series = series(part.track);
        part.indices.iter().map(move |i| series.and_then(|s| s.get(*i)).copied().unwrap_or(f64::NAN))
    };
    parts.iter().flat_map(values).collect()
}

/// "knee, after reversals: 3.1 noise floors; the residual follows the sign of the velocity".
fn hint(cell: &RegimeCell) -> String {
    let summary = match cell.clue {
        _ if cell.chi <= ABOVE_NOISE => "nothing but noise".to_owned(),
        Some(FoundClue { clue: Clue::Constant, .. }) => {
            format!("the residual is an offset of {:+.2} noise floors", cell.chi * cell.bias / cell.rmse)
        }
        Some(FoundClue { clue, correlation }) => {
            format!("the residual follows {} (correlation {correlation:+.2})", clue.words())
        }
        None => "the residual follows no single quantity".to_owned(),
    };
    format!("{}, {}: {:.1} noise floors; {summary}", cell.joint, cell.regime.words(), cell.chi)
}
