//! A joint's channels compared with each other: command, position, velocity.

use super::frozen::frozen;
use super::influence::pull;
use super::report::{CommandResponse, Finding, Severity, Topic};
use btr_core::log::{Channel, Log, interpolate};
use btr_core::signal::lag::{Lag, lag};
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::smooth::smooth;

/// How late a joint is looked for, in s.
const MOST_LAG_S: f64 = 0.5;
/// A lag that is less certain than this, in s, is not told.
const MOST_DOUBT_S: f64 = 0.05;
/// A servo that is later than this, in s, is an odd one.
const LATE_S: f64 = 0.15;
/// A joint that is less like its command than this hardly follows it, or follows it in another way than most.
const LIKE: f64 = 0.9;
/// A lag below zero needs motions that are as much alike as this, and as this where the command pulls the joint.
const FORETOLD: (f64, f64) = (0.8, 0.97);
/// A command that pulls by so many standard deviations does pull.
const PULLS: f64 = 3.0;
/// One whose joint does nothing but swing towards it is so much like its acceleration.
const SWINGS: f64 = 0.98;
/// One that pushes its joint away is so much like its acceleration turned over, by so many standard deviations.
const PUSHED: (f64, f64) = (0.7, 6.0);
/// So many are enough to doubt that a joint is upside down.
const MAY_PULL: f64 = 2.0;
/// Motions that differ by less than this are about as much alike.
const ABOUT: f64 = 0.1;
/// A joint that is upside down is so much like its command turned over, ...
const TURNED_OVER: f64 = 0.9;
/// ... and moves so far beside it, at least and at most.
const AS_FAR: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// A joint that moves by less than this share of what it is told does not follow.
const SMALL: f64 = 0.2;
/// How far a ratio may be from the one that is expected, ...
const NEAR: f64 = 0.15;
/// ... and that of a position to its command, which servos follow more or less.
const NEARLY: f64 = 0.4;

/// Whether a joint follows its command, and how late; nothing without a command or a reading.
pub(super) fn follows(log: &Log, joint: &str) -> Option<(CommandResponse, Vec<Finding>)> {
    let there = |channel: &&Channel| channel.values.iter().any(|x| x.is_finite());
    let position = log.channel(&format!("q_{joint}")).filter(there)?;
    let command = log.channel(&format!("cmd_{joint}")).filter(there)?;
    let lag = lag(log.clock_s(), &command.values, &position.values, MOST_LAG_S);
    let mut found: Vec<Finding> = pinned(joint, command, position).into_iter().collect();
    found.extend(in_degrees(joint, command, position, lag));
    if let Some(frozen) = frozen(log, joint, command, position) {
        found.push(frozen);
        return Some((CommandResponse { joint: joint.to_owned(), lag }, found));
    }
    found.push(match reversed(log, joint, command, position, lag) {
        Some(reversed) => reversed,
        None => late(log, joint, command, position, lag),
    });
    Some((CommandResponse { joint: joint.to_owned(), lag }, found))
}

/// A joint that stands at its very end while its command asks for more.
fn pinned(joint: &str, command: &Channel, position: &Channel) -> Option<Finding> {
    if command.unit != position.unit {
        return None;
    }
    let there = || position.values.iter().zip(&command.values).filter(|(q, c)| q.is_finite() && c.is_finite());
    let (min, max) = there().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (q, _)| (l.min(*q), h.max(*q)));
    let beyond = 0.1 * (max - min);
    let pinned = |(q, told): &(&f64, &f64)| **q >= max && **told > max + beyond || **q <= min && **told < min - beyond;
    let share = there().filter(pinned).count() as f64 / there().count().max(1) as f64;
    (share > 0.02).then(|| {
        let sentence =
            format!("{joint} stands at its end {:.0} % of the time while its command asks for more", 100.0 * share);
        Finding::new(Topic::Saturation, Severity::Doubtful, joint, sentence)
    })
}

/// A joint that moves as it is told, but 57 times as far, or a 57th of it.
fn in_degrees(joint: &str, command: &Channel, position: &Channel, lag: Option<Lag>) -> Option<Finding> {
    let follows = lag.is_some_and(|lag| lag.correlation >= 0.5);
    if command.unit != "rad" || position.unit != "rad" || !follows || !is_moved(command, position) {
        return None;
    }
    let both = || position.values.iter().zip(&command.values).filter(|(q, told)| (*q * *told).is_finite());
    let ratio = range(both().map(|(q, _)| *q)) / range(both().map(|(_, told)| *told));
    let near = |expected: f64| (ratio / expected - 1.0).abs() < NEARLY;
    let degrees = 1f64.to_degrees();
    let [q, told] = ["q", "cmd"].map(|kind| format!("{kind}_{joint}"));
    let (suspect, sentence) = match () {
        () if near(degrees) => (&q, format!("{q} moves {ratio:.0} times as far as {told}: is {q} in degrees?")),
        () if near(degrees.recip()) => {
            (&told, format!("{told} moves {:.0} times as far as {q}: is {told} in degrees?", ratio.recip()))
        }
        () => return None,
    };
    Some(Finding::new(Topic::Unit, Severity::Bad, suspect, sentence))
}

/// How far values are apart.
fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    (high - low).max(0.0)
}

/// Whether a joint is told and moves enough to tell anything.
fn is_moved(command: &Channel, position: &Channel) -> bool {
    let noise = NoiseEstimate::of(&position.values).map_or(0.0, |noise| noise.sigma());
    let there = |channel: &'_ Channel| range(channel.values.iter().copied().filter(|x| x.is_finite()));
    there(command) > 0.0 && there(position) >= 20.0 * noise
}

/// A joint that moves against its command: the command pushes it away, or the inverted motion correlates better with
/// it, or as well at a shorter lag.
fn reversed(log: &Log, joint: &str, command: &Channel, position: &Channel, straight: Option<Lag>) -> Option<Finding> {
    if command.unit != position.unit || !is_moved(command, position) {
        return None;
    }
    let say = |correlation: f64| {
        let sentence = format!(
            "{joint} follows its command upside down (likeness {correlation:.2}): is its encoder reversed, or its command?"
        );
        Some(Finding::new(Topic::Sign, Severity::Bad, joint, sentence))
    };
    // A swing beyond its resonance moves against its command as well, and a load moves a joint anywhere.
    let pulled = pull(log.clock_s(), &command.values, &position.values);
    let telling = pulled.map_or(0.0, |pulled| pulled.telling);
    if let Some(pushed) = pulled.filter(|pulled| pulled.correlation <= -PUSHED.0 && pulled.telling <= -PUSHED.1) {
        return say(-pushed.correlation);
    }
    let upside_down: Vec<f64> = position.values.iter().map(|q| -q).collect();
    let against = lag(log.clock_s(), &command.values, &upside_down, MOST_LAG_S)?;
    // What comes before its command does not come of it.
    if against.seconds < -3.0 * against.sd_s - log.usual_step_s().unwrap_or(0.0) || against.correlation < 0.5 {
        return None;
    }
    let (correlation, slope) = alike(log, command, position, against.seconds);
    let turned_over = correlation <= -TURNED_OVER && AS_FAR.contains(&-slope);
    // A wave that comes half a period late looks like one that is turned over, and may look so a little more.
    let slack = if turned_over && telling < 0.0 { ABOUT } else { 0.0 };
    let better = straight.is_none_or(|lag| {
        let sooner = lag.seconds > LATE_S && against.seconds.abs() < lag.seconds;
        lag.correlation < against.correlation - ABOUT || sooner && lag.correlation < against.correlation + slack
    });
    let sure = telling <= -PULLS || turned_over && telling < MAY_PULL;
    if better && sure { say(against.correlation) } else { None }
}

/// How late a joint follows.
fn late(log: &Log, joint: &str, command: &Channel, position: &Channel, lag: Option<Lag>) -> Finding {
    let say = |topic, severity, sentence| Finding::new(topic, severity, joint, sentence);
    if !is_moved(command, position) {
        let sentence = format!("{joint} is hardly moved: it tells next to nothing about itself");
        return say(Topic::Excitation, Severity::Doubtful, sentence);
    }
    // A torque or a voltage is followed by the acceleration, not by the position.
    if command.unit != position.unit {
        let sentence = format!("{joint} is told in {}; its lag cannot be seen from positions", command.unit);
        return say(Topic::CommandLag, Severity::Fine, sentence);
    }
    let of_positions = lag.map_or(0.0, |lag| alike(log, command, position, lag.seconds).0);
    let pull = pull(log.clock_s(), &command.values, &position.values);
    let pulled = pull.is_some_and(|pull| pull.telling >= PULLS);
    // A mass on a spring is late without anybody's clock being wrong.
    let swings = pull.is_some_and(|pull| pull.correlation >= SWINGS);
    let before = |lag: &Lag| lag.seconds < -3.0 * lag.sd_s - 1e-3;
    let least = |lag: &Lag| match (before(lag), pulled) {
        (false, _) => 0.5,
        (true, false) => FORETOLD.0,
        (true, true) => FORETOLD.1,
    };
    let Some(lag) = lag.filter(|lag| lag.correlation >= least(lag)) else {
        return unlike(joint, command, position, pulled);
    };
    if lag.sd_s > MOST_DOUBT_S {
        let sentence = format!("{joint} follows its command, but its motion does not tell how late");
        return say(Topic::CommandLag, Severity::Doubtful, sentence);
    }
    let (severity, why) = match () {
        () if before(&lag) => (Severity::Bad, ": clocks or channels are mixed up"),
        () if lag.seconds > LATE_S && !swings => {
            (Severity::Doubtful, ": late for a servo; are commands and positions stamped by one clock?")
        }
        () if lag.correlation < LIKE && of_positions < LIKE && !pulled => {
            (Severity::Doubtful, ": its motion is not much like its command; is it that joint's, in that unit?")
        }
        () => (Severity::Fine, ""),
    };
    let (ms, sd) = (1e3 * lag.seconds, 1e3 * lag.sd_s);
    let sentence =
        format!("{joint} follows its command after {ms:.1} ± {sd:.1} ms (likeness {:.2}){why}", lag.correlation);
    say(Topic::CommandLag, severity, sentence)
}

/// A joint whose motion is not like its command: others may move it more, or it stands at a limit.
fn unlike(joint: &str, command: &Channel, position: &Channel, pulled: bool) -> Finding {
    let say = |topic, severity, sentence| Finding::new(topic, severity, joint, sentence);
    let told = |channel: &Channel| range(channel.values.iter().copied().filter(|x| x.is_finite()));
    let (asked, moved, unit) = (told(command), told(position), &position.unit);
    let beside = format!("{joint} moves by {moved:.2e} {unit} while its command changes by {asked:.2e} {unit}");
    match () {
        () if pulled => {
            let sentence =
                format!("{joint} does what it is told, though its motion is not like its command: no lag is told");
            say(Topic::CommandLag, Severity::Fine, sentence)
        }
        () if moved < SMALL * asked => {
            say(Topic::CommandLag, Severity::Doubtful, format!("{beside}: it does not follow its command"))
        }
        () => {
            let why = "others move it, or these are not one joint's";
            let sentence = format!("{beside}, and not like it: {why}; whether it follows is not told");
            say(Topic::CommandLag, Severity::Doubtful, sentence)
        }
    }
}

/// How much a joint's positions are like its commands so much earlier, and how far they go beside these. A lag is told by
/// velocities, and those of a step are like no motion's.
fn alike(log: &Log, command: &Channel, position: &Channel, lag_s: f64) -> (f64, f64) {
    let earlier_s: Vec<f64> = log.clock_s().iter().map(|t| t - lag_s).collect();
    let told = interpolate(log.clock_s(), &command.values, &earlier_s);
    let pairs = || told.iter().zip(&position.values).filter(|(a, b)| (*a * *b).is_finite());
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
    let said = smooth(log.clock_s(), &velocity.values);
    let pairs = slopes.iter().zip(&said).map(|(q, dq)| (q.velocity, dq.value)).filter(|(a, b)| (a * b).is_finite());
    let (aa, bb, ab) = pairs.fold((0.0, 0.0, 0.0), |(aa, bb, ab), (a, b)| (aa + a * a, bb + b * b, ab + a * b));
    let (ratio, correlation) = (ab / aa, ab / (aa * bb).sqrt());
    let moves = NoiseEstimate::of(&position.values).is_some_and(|noise| {
        let usual_s = log.usual_step_s().unwrap_or(1.0);
        // The slope of smoothed noise is below this.
        (aa / slopes.len() as f64).sqrt() > 0.3 * noise.sigma() / usual_s
    });
    if !moves || !correlation.is_finite() {
        return None;
    }
    let near = |expected: f64| (ratio / expected - 1.0).abs() < NEAR;
    let degrees = 1f64.to_degrees();
    let [q, dq] = ["q", "dq"].map(|kind| format!("{kind}_{joint}"));
    let (topic, severity, suspect, what) = match () {
        () if correlation.abs() < 0.5 => (Topic::Sign, Severity::Doubtful, &dq, "has little to do with".to_owned()),
        () if near(degrees) => (Topic::Unit, Severity::Bad, &dq, "is 57 times".to_owned()),
        () if near(degrees.recip()) => (Topic::Unit, Severity::Bad, &q, "is a 57th of".to_owned()),
        () if near(-1.0) => (Topic::Sign, Severity::Bad, &dq, "has the opposite sign of".to_owned()),
        () if !(0.7..1.4).contains(&ratio) => (Topic::Unit, Severity::Doubtful, &dq, format!("is {ratio:.2} times")),
        () => return None,
    };
    let ask = match (topic, severity) {
        (Topic::Unit, Severity::Bad) => format!(": is {suspect} in degrees?"),
        (Topic::Sign, Severity::Bad) => ": is one of them reversed?".to_owned(),
        _ => String::new(),
    };
    Some(Finding::new(topic, severity, suspect, format!("{dq} {what} the slope of {q}{ask}")))
}
