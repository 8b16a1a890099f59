//! A section per joint: measured and simulated positions and the residual, for one simulation or for one before and one
//! after.

use super::clues::follows;
use super::page::{Block, Section};
use super::views::{FINE, JointView, SimulatedJoint};
use crate::plot::{Ink, Mark, Panel, Series, figure};
use btr_core::log::Log;
use btr_identify::compare::{Comparison, Regime};

/// Number of logs drawn per joint, those with the largest errors first.
pub(super) const LOGS_SHOWN: usize = 3;
/// Points of all lines over time of a page at most, about eleven bytes each; but no line has fewer than these.
const MOST_POINTS: usize = 70_000;
const COARSE: usize = 150;

/// Logs and their simulations.
pub(super) struct ComparedLogs<'a> {
    /// Names of the logs.
    pub(super) names: Vec<&'a str>,
    /// The recordings.
    pub(super) logs: &'a [Log],
    /// Errors of the earlier simulation, where there are two.
    pub(super) before: Option<&'a Comparison>,
    /// Errors of simulations on the way from there, with their names.
    pub(super) between: Vec<(&'a str, &'a Comparison)>,
    /// Errors of the simulation.
    pub(super) after: &'a Comparison,
}

/// The joints of a comparison.
pub(super) fn joints(comparison: &Comparison) -> Vec<String> {
    let mut joints: Vec<String> = Vec::new();
    for track in &comparison.tracks {
        if !joints.contains(&track.joint) {
            joints.push(track.joint.clone());
        }
    }
    joints
}

impl ComparedLogs<'_> {
    /// A section for every joint.
    pub(super) fn sections(&self) -> Vec<Section> {
        joints(self.after).iter().map(|joint| self.section(joint)).collect()
    }

    fn section(&self, joint: &str) -> Section {
        let views = self.views(joint);
        let hint = |comparison: &Comparison| {
            let cells = &comparison.cells;
            cells.iter().find(|c| c.joint == joint && c.regime == Regime::Throughout).map(|cell| cell.hint.clone())
        };
        let mut blocks: Vec<Block> = match self.before {
            None => hint(self.after).map(|hint| Block::Text(format!("{hint}."))).into_iter().collect(),
            Some(before) => vec![Block::List(
                [("before", before), ("after", self.after)]
                    .into_iter()
                    .filter_map(|(when, comparison)| Some(format!("{when}: {}", hint(comparison)?)))
                    .collect(),
            )],
        };
        let (most, all) = (views.len(), self.names.len());
        if all > most {
            blocks.push(Block::Text(format!("The {most} logs with the largest errors are drawn, of {all}.")));
        }
        let most = self.points_of_a_line();
        for view in &views {
            let panels = [over_time(view, most), residual_over_time(view, most)];
            blocks.push(Block::Plots(panels.iter().map(alone).collect()));
        }
        blocks.extend(views.first().map(|worst| Block::Plots(follows(&views, worst).iter().map(alone).collect())));
        Section { title: joint.to_owned(), blocks }
    }

    /// How fine lines over time are drawn: a page of many lines stays small.
    fn points_of_a_line(&self) -> usize {
        let simulations = 1 + usize::from(self.before.is_some()) + self.between.len();
        let lines = joints(self.after).len() * self.logs.len().min(LOGS_SHOWN) * (2 + 2 * simulations);
        (MOST_POINTS / lines.max(1)).clamp(COARSE, FINE)
    }

    fn views(&self, joint: &str) -> Vec<JointView<'_>> {
        let of = |log: usize| {
            let measured = &self.logs[log].channel(&format!("q_{joint}"))?.values;
            let simulated = |comparison| SimulatedJoint::of(comparison, log, joint);
            let between = self.between.iter().filter_map(|(name, comparison)| Some((*name, simulated(comparison)?)));
            Some(JointView {
                log,
                name: self.names[log],
                measured,
                before: self.before.and_then(simulated),
                between: between.collect(),
                after: simulated(self.after)?,
            })
        };
        let mut views: Vec<JointView> = (0..self.logs.len()).filter_map(of).collect();
        views.sort_by(|a, b| b.after.chi().total_cmp(&a.after.chi()));
        views.truncate(LOGS_SHOWN);
        views
    }
}

fn alone(panel: &Panel) -> String {
    figure(std::slice::from_ref(panel), 1)
}

fn over_time(view: &JointView, most: usize) -> Panel {
    let track = view.after.track;
    let line = |values: &[f64]| thin_line(&track.clock_s, values, most);
    let mut series = Vec::new();
    // Commands far outside the range of positions (torques, voltages) are not drawn: they would dominate the axis.
    let (low, high) = extent(view.measured);
    let shown = |c: &f64| c.is_nan() || (*c >= 2.0 * low - high && *c <= 2.0 * high - low);
    if !track.command.is_empty() && track.command.iter().all(shown) {
        series.push(Series::new("command", Ink::Truth, Mark::Dashes, line(&track.command)));
    }
    series.push(Series::new("measured", Ink::Second, Mark::Broad, line(view.measured)));
    series.extend(
        view.series("simulated", |joint, name, ink| {
            Series::new(name, ink, Mark::Line, line(&joint.residual.simulated))
        }),
    );
    Panel {
        title: format!("{} in {}", track.joint, view.name),
        x_label: "time (s)".to_owned(),
        y_label: format!("position ({})", view.unit()),
        series,
        over_log: Some(view.log),
        ..Panel::default()
    }
}

fn residual_over_time(view: &JointView, most: usize) -> Panel {
    let (clock, floor) = (&view.after.track.clock_s, view.after.track.floor);
    let ends = [clock.first(), clock.last()].map(|t| t.copied().unwrap_or(0.0));
    let level = |y: f64| ends.map(|t| (t, y)).to_vec();
    let mut series = view.series("residual", |joint, name, ink| {
        Series::new(name, ink, Mark::Line, thin_line(clock, &joint.track.error, most))
    });
    series.push(Series::new("± noise floor", Ink::Truth, Mark::Dashes, level(floor)));
    series.push(Series::nameless(Ink::Truth, Mark::Dashes, level(-floor)));
    Panel {
        title: format!("Residual in {}", view.name),
        x_label: "time (s)".to_owned(),
        y_label: format!("measured − simulated ({})", view.unit()),
        series,
        over_log: Some(view.log),
        ..Panel::default()
    }
}

fn extent(values: &[f64]) -> (f64, f64) {
    let finite = values.iter().filter(|x| x.is_finite());
    finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)))
}

/// Downsamples a line and keeps every peak: the minimum and the maximum of each segment, in time order.
fn thin_line(clock_s: &[f64], values: &[f64], most: usize) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = clock_s.iter().copied().zip(values.iter().copied()).collect();
    if points.len() <= most {
        return points;
    }
    let ends = |segment: &[(f64, f64)]| {
        let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let pick = [segment.iter().min_by(by_value), segment.iter().max_by(by_value)];
        let mut pick: Vec<(f64, f64)> = pick.into_iter().flatten().copied().collect();
        // A gap in a segment stays a gap.
        pick.extend(segment.iter().find(|point| point.1.is_nan()));
        pick.sort_by(|a, b| a.0.total_cmp(&b.0));
        pick
    };
    points.chunks(points.len().div_ceil(most / 2)).flat_map(ends).collect()
}
