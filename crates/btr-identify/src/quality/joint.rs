//! A joint's channels compared with each other: command, position, velocity.

use super::dead_time;
use super::frozen::frozen;
use super::influence::pull;
use super::report::{CommandResponse, Finding, FindingCause, Severity, Topic};
use btr_core::log::{Channel, Log, interpolate};
use btr_core::signal::lag::{Lag, lag};
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::smooth::smooth;

/// Largest lag that is searched, in s.
const MOST_LAG_S: f64 = 0.5;
/// Largest standard deviation of a reported lag, in s.
const MOST_SD_S: f64 = 0.05;
/// Largest plausible lag of a servo, in s.
const LATE_S: f64 = 0.15;
/// Smallest correlation of a joint with its command that is not doubtful.
const FOLLOWS: f64 = 0.9;
/// Smallest correlation for a negative lag to count: in general, and where the command pulls the joint.
const NEGATIVE_LAG: (f64, f64) = (0.8, 0.97);
/// Significance from which a command pulls its joint, in standard deviations.
const PULLS: f64 = 3.0;
/// Correlation of command and acceleration from which a joint is a mass on a spring.
const SWINGS: f64 = 0.98;
/// A command that pushes its joint away has at least this negative correlation with its acceleration, and this
/// negative significance in standard deviations.
const PUSHED: (f64, f64) = (0.7, 6.0);
/// Significance, in standard deviations, from which an inverted joint is no longer plausible.
const MAY_PULL: f64 = 2.0;
/// Correlations that differ by less than this are about equal.
const ABOUT: f64 = 0.1;
/// An inverted joint's correlation with its command is at most minus this, ...
const INVERTED: f64 = 0.9;
/// ... and the range of its slope.
const INVERTED_SLOPE: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// A joint that moves by less than this share of its command's range does not follow it.
const SMALL: f64 = 0.2;
/// Relative tolerance of the ratio of two velocities, ...
const NEAR: f64 = 0.15;
/// ... and of a position to its command, which servos follow only roughly.
const NEARLY: f64 = 0.4;

/// Whether a joint follows its command, with which lag and dead time; `None` without commands or readings.
pub(super) fn follows(log: &Log, joint: &str) -> Option<(CommandResponse, Vec<Finding>)> {
    let has_values = |channel: &&Channel| channel.values.iter().any(|x| x.is_finite());
    let position = log.channel(&format!("q_{joint}")).filter(has_values)?;
    let command = log.channel(&format!("cmd_{joint}")).filter(has_values)?;
    let lag = lag(log.clock_s(), &command.values, &position.values, MOST_LAG_S);
    let response = CommandResponse { joint: joint.to_owned(), lag, dead_time: dead_time::of(log, command, position) };
    let mut found: Vec<Finding> = pinned(joint, command, position).into_iter().collect();
    found.extend(in_degrees(joint, command, position, lag));
    if let Some(frozen) = frozen(log, joint, command, position) {
        found.push(frozen);
        return Some((response, found));
    }
    found.push(match reversed(log, joint, command, position, lag) {
        Some(reversed) => reversed,
        None => late(log, joint, command, position, lag),
    });
    Some((response, found))
}

/// A joint that is at the end of its range while its command lies beyond it.
fn pinned(joint: &str, command: &Channel, position: &Channel) -> Option<Finding> {
    if command.unit != position.unit {
        return None;
    }
    let pairs = || position.values.iter().zip(&command.values).filter(|(q, c)| q.is_finite() && c.is_finite());
    let (min, max) = pairs().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (q, _)| (l.min(*q), h.max(*q)));
    let beyond = 0.1 * (max - min);
    let pinned = |(q, c): &(&f64, &f64)| **q >= max && **c > max + beyond || **q <= min && **c < min - beyond;
    let share = pairs().filter(pinned).count() as f64 / pairs().count().max(1) as f64;
    (share > 0.02).then(|| {
        let sentence = format!(
            "{joint} is at the end of its range {:.0} % of the time while its command is beyond",
            100.0 * share
        );
        Finding::new(Topic::Saturation, Severity::Doubtful, joint, sentence)
    })
}

/// A joint that follows its command with a gain of about 57 or 1/57: one of the two is in degrees.
fn in_degrees(joint: &str, command: &Channel, position: &Channel, lag: Option<Lag>) -> Option<Finding> {
    let follows = lag.is_some_and(|lag| lag.correlation >= 0.5);
    if command.unit != "rad" || position.unit != "rad" || !follows || !is_moved(command, position) {
        return None;
    }
    let both = || position.values.iter().zip(&command.values).filter(|(q, c)| (*q * *c).is_finite());
    let ratio = range(both().map(|(q, _)| *q)) / range(both().map(|(_, c)| *c));
    let near = |expected: f64| (ratio / expected - 1.0).abs() < NEARLY;
    let degrees = 1f64.to_degrees();
    let [q, cmd] = ["q", "cmd"].map(|kind| format!("{kind}_{joint}"));
    let (suspect, sentence) = match () {
        () if near(degrees) => (&q, format!("{q} moves {ratio:.0} times as far as {cmd}: is {q} in degrees?")),
        () if near(degrees.recip()) => {
            (&cmd, format!("{cmd} moves {:.0} times as far as {q}: is {cmd} in degrees?", ratio.recip()))
        }
        () => return None,
    };
    Some(Finding::new(Topic::Unit, Severity::Bad, suspect, sentence).because(FindingCause::Degrees))
}

/// Difference of the largest and the smallest value.
fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    (high - low).max(0.0)
}

/// Whether a joint's command changes and the joint moves enough for its response to be measured.
fn is_moved(command: &Channel, position: &Channel) -> bool {
    let noise = NoiseEstimate::of(&position.values).map_or(0.0, |noise| noise.sigma());
    let range_of = |channel: &'_ Channel| range(channel.values.iter().copied().filter(|x| x.is_finite()));
    range_of(command) > 0.0 && range_of(position) >= 20.0 * noise
}

/// A joint that moves against its command: the command pushes it away, or the inverted motion correlates better with
/// it, or as well at a shorter lag.
fn reversed(log: &Log, joint: &str, command: &Channel, position: &Channel, straight: Option<Lag>) -> Option<Finding> {
    if command.unit != position.unit || !is_moved(command, position) {
        return None;
    }
    let say = |correlation: f64| {
        let sentence = format!(
            "{joint} moves opposite to its command (correlation {correlation:.2}): is its encoder or its command \
             reversed?"
        );
        Some(Finding::new(Topic::Sign, Severity::Bad, joint, sentence).because(FindingCause::Reversed))
    };
    // A joint that is driven above its resonance moves against its command as well, and a load may move it anywhere.
    let influence = pull(log.clock_s(), &command.values, &position.values);
    let significance = influence.map_or(0.0, |influence| influence.significance);
    if let Some(push) = influence.filter(|of| of.correlation <= -PUSHED.0 && of.significance <= -PUSHED.1) {
        return say(-push.correlation);
    }
    let inverted: Vec<f64> = position.values.iter().map(|q| -q).collect();
    let against = lag(log.clock_s(), &command.values, &inverted, MOST_LAG_S)?;
    // A motion that precedes the command is not caused by it.
    if against.seconds < -3.0 * against.sd_s - log.usual_step_s().unwrap_or(0.0) || against.correlation < 0.5 {
        return None;
    }
    let (correlation, slope) = position_correlation(log, command, position, against.seconds);
    let is_inverted = correlation <= -INVERTED && INVERTED_SLOPE.contains(&-slope);
    // A sine that lags by half a period looks inverted, and may correlate slightly better that way.
    let slack = if is_inverted && significance < 0.0 { ABOUT } else { 0.0 };
    let better = straight.is_none_or(|lag| {
        let sooner = lag.seconds > LATE_S && against.seconds.abs() < lag.seconds;
        lag.correlation < against.correlation - ABOUT || sooner && lag.correlation < against.correlation + slack
    });
    let sure = significance <= -PULLS || is_inverted && significance < MAY_PULL;
    if better && sure { say(against.correlation) } else { None }
}

/// The lag of a joint behind its command.
fn late(log: &Log, joint: &str, command: &Channel, position: &Channel, lag: Option<Lag>) -> Finding {
    let say = |topic, severity, sentence| Finding::new(topic, severity, joint, sentence);
    if !is_moved(command, position) {
        let sentence = format!("{joint} hardly moves: the log contains almost no information about it");
        return say(Topic::Excitation, Severity::Doubtful, sentence);
    }
    // A torque or a voltage is followed by the acceleration, not by the position.
    if command.unit != position.unit {
        let sentence = format!("{joint} is commanded in {}; its lag cannot be determined from positions", command.unit);
        return say(Topic::CommandLag, Severity::Fine, sentence);
    }
    let of_positions = lag.map_or(0.0, |lag| position_correlation(log, command, position, lag.seconds).0);
    let pull = pull(log.clock_s(), &command.values, &position.values);
    let pulled = pull.is_some_and(|pull| pull.significance >= PULLS);
    // A mass on a spring lags although no clock is wrong.
    let swings = pull.is_some_and(|pull| pull.correlation >= SWINGS);
    let before = |lag: &Lag| lag.seconds < -3.0 * lag.sd_s - 1e-3;
    let least = |lag: &Lag| match (before(lag), pulled) {
        (false, _) => 0.5,
        (true, false) => NEGATIVE_LAG.0,
        (true, true) => NEGATIVE_LAG.1,
    };
    let Some(lag) = lag.filter(|lag| lag.correlation >= least(lag)) else {
        return uncorrelated(joint, command, position, pulled);
    };
    if lag.sd_s > MOST_SD_S {
        let sentence = format!("{joint} follows its command, but its motion does not determine the lag");
        return say(Topic::CommandLag, Severity::Doubtful, sentence);
    }
    let (severity, why) = match () {
        () if before(&lag) => (Severity::Bad, ": clocks or channels are mixed up"),
        () if lag.seconds > LATE_S && !swings => (Severity::Doubtful, LATE),
        () if lag.correlation < FOLLOWS && of_positions < FOLLOWS && !pulled => (
            Severity::Doubtful,
            ": its motion correlates poorly with its command; is it the same joint's, in the same unit?",
        ),
        () => (Severity::Fine, ""),
    };
    let (ms, sd) = (1e3 * lag.seconds, 1e3 * lag.sd_s);
    let sentence =
        format!("{joint} follows its command after {ms:.1} ± {sd:.1} ms (correlation {:.2}){why}", lag.correlation);
    let finding = say(Topic::CommandLag, severity, sentence);
    if why == LATE { finding.because(FindingCause::Late) } else { finding }
}

/// Said of a joint that is late.
const LATE: &str = ": late for a servo; are commands and positions stamped by one clock?";

/// A joint whose motion does not correlate with its command: other forces may move it more, or it is at a limit.
fn uncorrelated(joint: &str, command: &Channel, position: &Channel, pulled: bool) -> Finding {
    let say = |topic, severity, sentence| Finding::new(topic, severity, joint, sentence);
    let range_of = |channel: &Channel| range(channel.values.iter().copied().filter(|x| x.is_finite()));
    let (commanded, moved, unit) = (range_of(command), range_of(position), &position.unit);
    let ranges = format!("{joint} moves by {moved:.2e} {unit} while its command changes by {commanded:.2e} {unit}");
    match () {
        () if pulled => {
            let sentence =
                format!("{joint} responds to its command, but its motion does not correlate with it: no lag is given");
            say(Topic::CommandLag, Severity::Fine, sentence)
        }
        () if moved < SMALL * commanded => {
            say(Topic::CommandLag, Severity::Doubtful, format!("{ranges}: it does not follow its command"))
        }
        () => {
            let why = "other forces move it, or these are not the same joint's";
            let sentence = format!("{ranges}, without correlation: {why}; whether it follows is unknown");
            say(Topic::CommandLag, Severity::Doubtful, sentence)
        }
    }
}

/// Correlation of a joint's positions with its commands `lag_s` earlier, and the slope of the positions over these. The
/// lag itself is estimated from velocities, which correlate with no motion where the command is a step.
fn position_correlation(log: &Log, command: &Channel, position: &Channel, lag_s: f64) -> (f64, f64) {
    let earlier_s: Vec<f64> = log.clock_s().iter().map(|t| t - lag_s).collect();
    let commands = interpolate(log.clock_s(), &command.values, &earlier_s);
    let pairs = || commands.iter().zip(&position.values).filter(|(a, b)| (*a * *b).is_finite());
    let n = pairs().count().max(1) as f64;
    let (a, b) = pairs().fold((0.0, 0.0), |(x, y), (a, b)| (x + a / n, y + b / n));
    let (aa, bb, ab) = pairs().fold((0.0, 0.0, 0.0), |(aa, bb, ab), (x, y)| {
        (aa + (x - a).powi(2), bb + (y - b).powi(2), ab + (x - a) * (y - b))
    });
    (ab / (aa * bb).sqrt(), ab / aa)
}

/// Whether a measured velocity is the slope of the position.
pub(super) fn velocity(log: &Log, joint: &str) -> Option<Finding> {
    let position = log.channel(&format!("q_{joint}"))?;
    let velocity = log.channel(&format!("dq_{joint}"))?;
    let slopes = smooth(log.clock_s(), &position.values);
    let measured = smooth(log.clock_s(), &velocity.values);
    let pairs = slopes.iter().zip(&measured).map(|(q, dq)| (q.velocity, dq.value)).filter(|(a, b)| (a * b).is_finite());
    let (aa, bb, ab) = pairs.fold((0.0, 0.0, 0.0), |(aa, bb, ab), (a, b)| (aa + a * a, bb + b * b, ab + a * b));
    let (ratio, correlation) = (ab / aa, ab / (aa * bb).sqrt());
    let moves = NoiseEstimate::of(&position.values).is_some_and(|noise| {
        let usual_s = log.usual_step_s().unwrap_or(1.0);
        // The slope of smoothed noise alone stays below this.
        (aa / slopes.len() as f64).sqrt() > 0.3 * noise.sigma() / usual_s
    });
    if !moves || !correlation.is_finite() {
        return None;
    }
    let near = |expected: f64| (ratio / expected - 1.0).abs() < NEAR;
    let degrees = 1f64.to_degrees();
    let [q, dq] = ["q", "dq"].map(|kind| format!("{kind}_{joint}"));
    let (topic, severity, suspect, what) = match () {
        () if correlation.abs() < 0.5 => (Topic::Sign, Severity::Doubtful, &dq, "does not correlate with".to_owned()),
        () if near(degrees) => (Topic::Unit, Severity::Bad, &dq, "is 57 times".to_owned()),
        () if near(degrees.recip()) => (Topic::Unit, Severity::Bad, &q, "is a 57th of".to_owned()),
        () if near(-1.0) => (Topic::Sign, Severity::Bad, &dq, "has the opposite sign of".to_owned()),
        () if !(0.7..1.4).contains(&ratio) => (Topic::Unit, Severity::Doubtful, &dq, format!("is {ratio:.2} times")),
        () => return None,
    };
    let (cause, question) = match (topic, severity) {
        (Topic::Unit, Severity::Bad) => (Some(FindingCause::Degrees), format!(": is {suspect} in degrees?")),
        (Topic::Sign, Severity::Bad) => (Some(FindingCause::Reversed), ": is one of them reversed?".to_owned()),
        _ => (None, String::new()),
    };
    let sentence = format!("{dq} {what} the slope of {q}{question}");
    Some(Finding { cause, ..Finding::new(topic, severity, suspect, sentence) })
}
