//! Units of columns whose names say none: by their ranges, their slopes and the joints' limits.

use super::column::{Column, Unit};
use super::words::Kind;
use btr_core::log::Log;
use btr_io::TimeUnit;
use btr_physics::robot::{JointKind, Robot};

/// Ends of names whose unit is read with them.
const SAID: [&str; 9] = ["_rad_s", "_deg_s", "_m_s", "_rad", "_deg", "_nm", "_m", "_n", "_v"];
/// How far positions may be beyond a joint's limits, relative to its range.
const BEYOND: f64 = 0.15;
/// A joint without limits rarely turns further than this, in rad.
const FAR: f64 = 12.0;

/// The unit of a clock whose name says none, by its usual step; `None` for seconds.
pub(super) fn of_clock(name: &str, log: &Log) -> Option<TimeUnit> {
    let said = ["_s", "_ms", "_us", "_ns"].iter().any(|end| name.ends_with(end));
    match log.usual_step_s().filter(|_| !said)? {
        step if step < 0.7 => None,
        step if step < 700.0 => Some(TimeUnit::Ms),
        step if step < 700_000.0 => Some(TimeUnit::Us),
        _ => Some(TimeUnit::Ns),
    }
}

/// Decides the units of all columns. Returns what was guessed, in words. A log has one unit for all positions.
pub(super) fn guess(columns: &mut [Column], log: &Log, robot: &Robot) -> Vec<String> {
    let mut told = Vec::new();
    for kind in [JointKind::Revolute, JointKind::Prismatic] {
        let joints: Vec<_> = robot.movable().map(|(_, link)| &link.joint).collect();
        let ours: Vec<usize> = (0..columns.len())
            .filter(|&i| joints[columns[i].joint].kind == kind && !says_its_unit(&columns[i].name))
            .collect();
        for of in [Kind::Position, Kind::Command] {
            let these: Vec<usize> = ours.iter().copied().filter(|&i| columns[i].kind == of).collect();
            let is_foreign = |i: usize| {
                let limits = joints[columns[i].joint].limits;
                looks_foreign(limits, &values(log, i), Unit::foreign(kind).factor())
            };
            if these.iter().copied().any(is_foreign) {
                let what = if of == Kind::Command { "commands" } else { "positions" };
                told.push(format!("{what} are in {}, by their ranges", Unit::foreign(kind).name()));
                these.into_iter().for_each(|i| columns[i].unit = Unit::foreign(kind));
            }
        }
        told.extend(velocities(columns, log, &ours, Unit::foreign(kind)));
    }
    told
}

/// Velocities are in the unit in which they are the slopes of the positions.
fn velocities(columns: &mut [Column], log: &Log, ours: &[usize], foreign: Unit) -> Option<String> {
    let mut votes = 0_i32;
    let these: Vec<usize> = ours.iter().copied().filter(|&i| columns[i].kind == Kind::Velocity).collect();
    for &i in &these {
        let joint = columns[i].joint;
        let position = columns.iter().position(|c| c.joint == joint && c.kind == Kind::Position);
        let Some(position) = position.filter(|p| !says_its_unit(&columns[*p].name)) else { continue };
        let slope = columns[position].unit.factor() * rms(&slopes(log.clock_s(), &values(log, position)));
        let ratio = rms(&values(log, i)) / slope;
        if ratio.is_finite() && ratio > 0.0 {
            let between = foreign.factor().recip().sqrt();
            votes += if ratio > between { 1 } else { -1 };
        }
    }
    if votes <= 0 {
        return None;
    }
    these.into_iter().for_each(|i| columns[i].unit = foreign);
    Some(format!("velocities are in {} per second, by the positions' slopes", foreign.name()))
}

/// Whether a reader takes the unit from the name.
pub(super) fn says_its_unit(name: &str) -> bool {
    let name = name.to_lowercase();
    SAID.iter().any(|end| name.ends_with(end))
}

/// Whether positions are beyond what a joint can do, unless they have another unit.
fn looks_foreign(limits: (f64, f64), values: &[f64], factor: f64) -> bool {
    let (least, most) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    if least > most {
        return false;
    }
    let range = limits.1 - limits.0;
    if !range.is_finite() {
        return least.abs().max(most.abs()) > FAR * if factor < 0.01 { 0.1 } else { 1.0 };
    }
    let fits = |factor: f64| factor * least >= limits.0 - BEYOND * range && factor * most <= limits.1 + BEYOND * range;
    !fits(1.0) && (fits(factor) || least.abs().max(most.abs()) > 2.0 * limits.0.abs().max(limits.1.abs()) / 0.5)
}

fn values(log: &Log, column: usize) -> Vec<f64> {
    let values = log.values(&format!("x{column}")).unwrap_or_default();
    values.iter().copied().filter(|x| x.is_finite()).collect()
}

fn slopes(clock_s: &[f64], values: &[f64]) -> Vec<f64> {
    if clock_s.len() != values.len() {
        return Vec::new();
    }
    (1..values.len()).map(|k| (values[k] - values[k - 1]) / (clock_s[k] - clock_s[k - 1])).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}
