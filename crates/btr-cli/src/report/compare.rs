//! The report of `btr compare`.

use super::{Block, Report, Section};
use crate::cmd::compare::{CHANNEL_HEADER, Outcome, channel_rows};
use crate::plot::heat::{Heat, heat};
use crate::plot::{Ink, Mark, Panel, Series, figure};
use btr_core::compare::{Cell, Regime, Residual, Track, spectrum};
use btr_core::stats::autocorrelation;

/// Logs of a joint that are drawn, the worst first.
const LOGS_SHOWN: usize = 3;
/// Columns of the map over time.
const WINDOWS: usize = 12;
/// Points of a line and dots of a cloud, at most.
const FINE: usize = 1200;
/// What is shown around a reversal, in s.
const AROUND_REVERSAL_S: (f64, f64) = (-0.1, 0.4);

pub(crate) fn document(outcome: &Outcome) -> String {
    let mut sections = vec![summary(outcome), failures(outcome)];
    sections.extend(joints(outcome).iter().map(|joint| joint_section(outcome, joint)));
    Report { title: format!("{}: where the model fails", outcome.model), sections }.html()
}

fn joints(outcome: &Outcome) -> Vec<String> {
    let mut joints: Vec<String> = Vec::new();
    for track in &outcome.comparison.tracks {
        if !joints.contains(&track.joint) {
            joints.push(track.joint.clone());
        }
    }
    joints
}

fn summary(outcome: &Outcome) -> Section {
    let logs = outcome.names.join(", ");
    let model = &outcome.model;
    let mut blocks = vec![
        Block::Text(format!("{model}, told what the logs say the robot was told: {logs}.")),
        Block::Table {
            header: CHANNEL_HEADER.iter().map(|&cell| cell.to_owned()).collect(),
            rows: channel_rows(outcome),
        },
        Block::Text(
            "Errors are measured minus simulated. chi is the error in multiples of what the sensor alone would leave (its \
             noise floor); 1 is perfect. lag: how much later than simulated it was measured. step error: what the \
             simulation's time step alone does, in noise floors."
                .to_owned(),
        ),
    ];
    if !outcome.replays.warnings.is_empty() {
        blocks.push(Block::List(outcome.replays.warnings.clone()));
    }
    Section { title: "Channels".to_owned(), blocks }
}

fn failures(outcome: &Outcome) -> Section {
    const LISTED: usize = 12;
    let failures = outcome.comparison.failures();
    let line = |cell: &&Cell| {
        let share = 100.0 * cell.share;
        let Cell { hint, log, t0_s, t1_s, .. } = cell;
        format!("{hint}. {share:.0} % of the squared error, most of it in {log} from {t0_s:.2} to {t1_s:.2} s.")
    };
    let list = match failures.len() {
        0 => Block::Text("No joint fails in any regime: what is left is noise.".to_owned()),
        _ => Block::List(failures.iter().take(LISTED).map(line).collect()),
    };
    let joints = joints(outcome);
    let chi = |joint: &str, regime: Regime| {
        outcome.comparison.cells.iter().find(|c| c.joint == joint && c.regime == regime).map(|cell| cell.chi)
    };
    let rows = Regime::ALL.iter().filter(|regime| joints.iter().any(|joint| chi(joint, **regime).is_some()));
    let by_regime = Heat {
        title: "By regime".to_owned(),
        columns: joints.clone(),
        rows: rows.map(|r| (r.words().to_owned(), joints.iter().map(|joint| chi(joint, *r)).collect())).collect(),
    };
    let over_time = (0..outcome.names.len()).take(LOGS_SHOWN).map(|log| heat(&by_time(outcome, log)));
    let maps = std::iter::once(heat(&by_regime)).chain(over_time).collect();
    let told =
        "Errors of the joints' positions in multiples of the noise floor, by what the joint was doing and over time.";
    Section { title: "Where it fails".to_owned(), blocks: vec![list, Block::Text(told.to_owned()), Block::Maps(maps)] }
}

/// The error of every joint in each twelfth of a log.
fn by_time(outcome: &Outcome, log: usize) -> Heat {
    let tracks: Vec<&Track> = outcome.comparison.tracks.iter().filter(|track| track.log == log).collect();
    let long_s = tracks.iter().filter_map(|track| track.clock_s.last().copied()).fold(0.0, f64::max);
    let width_s = long_s / WINDOWS as f64;
    let chi = |track: &Track, window: usize| {
        let (from, to) = (window as f64 * width_s, (window + 1) as f64 * width_s);
        let within = track.clock_s.iter().zip(&track.error).filter(|(t, e)| **t >= from && **t < to && e.is_finite());
        let (n, squares) = within.fold((0.0, 0.0), |(n, sum), (_, e)| (n + 1.0, sum + (e / track.floor).powi(2)));
        (n > 0.0).then(|| f64::sqrt(squares / n))
    };
    let row = |window: usize| {
        let name = format!("{:.1} to {:.1} s", window as f64 * width_s, (window + 1) as f64 * width_s);
        (name, tracks.iter().map(|track| chi(track, window)).collect())
    };
    Heat {
        title: format!("Over {}", outcome.names[log]),
        columns: tracks.iter().map(|track| track.joint.clone()).collect(),
        rows: (0..WINDOWS).map(row).collect(),
    }
}

/// A joint in one log: its residual and its track.
struct View<'a> {
    name: &'a str,
    track: &'a Track,
    residual: &'a Residual,
    measured: &'a [f64],
}

fn views<'a>(outcome: &'a Outcome, joint: &str) -> Vec<View<'a>> {
    let channel = format!("q_{joint}");
    let of = |track: &'a Track| {
        let all = &outcome.comparison.residuals;
        let residual = all.iter().find(|r| r.log == track.log && r.channel == channel)?;
        let measured = &outcome.replays.logs[track.log].channel(&channel)?.values;
        Some(View { name: &outcome.names[track.log], track, residual, measured })
    };
    let mut views: Vec<View> = outcome.comparison.tracks.iter().filter(|t| t.joint == joint).filter_map(of).collect();
    let chi = |view: &View| {
        let there = view.track.error.iter().filter(|e| e.is_finite());
        let (n, sum) = there.fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e * e));
        sum / (n * view.track.floor.powi(2))
    };
    views.sort_by(|a, b| chi(b).total_cmp(&chi(a)));
    views.truncate(LOGS_SHOWN);
    views
}

fn joint_section(outcome: &Outcome, joint: &str) -> Section {
    let views = views(outcome, joint);
    let mut blocks = Vec::new();
    let whole = outcome.comparison.cells.iter().find(|c| c.joint == joint && c.regime == Regime::Throughout);
    blocks.extend(whole.map(|cell| Block::Text(format!("{}.", cell.hint))));
    let hidden = outcome.names.len() - views.len();
    if hidden > 0 {
        let most = views.len();
        blocks
            .push(Block::Text(format!("Drawn are the {most} logs in which it errs most, of {}.", outcome.names.len())));
    }
    for view in &views {
        let panels = [over_time(view), residual_over_time(view)];
        blocks.push(Block::Plots(panels.iter().map(alone).collect()));
    }
    let panels = views.first().map(|worst| {
        let unit = &worst.residual.unit;
        let speed = |track: &Track| track.motion.iter().map(|m| m.velocity).collect();
        let place = |track: &Track| track.motion.iter().map(|m| m.value).collect();
        let load = format!("load: {}", worst.track.load_label);
        [
            cloud(&views, "Residual against velocity", &format!("velocity ({unit}/s)"), speed),
            cloud(&views, "Residual against position", &format!("position ({unit})"), place),
            cloud(&views, "Residual against load", &load, |track| track.load.clone()),
            around_reversals(&views),
            spectra(&views),
            autocorrelations(&views),
        ]
    });
    blocks.extend(panels.map(|panels| Block::Plots(panels.iter().map(alone).collect())));
    Section { title: joint.to_owned(), blocks }
}

fn alone(panel: &Panel) -> String {
    figure(std::slice::from_ref(panel), 1)
}

fn over_time(view: &View) -> Panel {
    let clock = &view.track.clock_s;
    let line = |values: &[f64]| thin_line(clock, values);
    let mut series = Vec::new();
    // A torque or a voltage does not belong on an axis of positions: it would hide them.
    let (low, high) = extent(view.measured);
    let shown = |c: &f64| c.is_nan() || (*c >= 2.0 * low - high && *c <= 2.0 * high - low);
    if !view.track.command.is_empty() && view.track.command.iter().all(shown) {
        series.push(Series::new("command", Ink::Truth, Mark::Dashes, line(&view.track.command)));
    }
    series.push(Series::new("measured", Ink::Second, Mark::Line, line(view.measured)));
    series.push(Series::new("simulated", Ink::Main, Mark::Line, line(&view.residual.simulated)));
    Panel {
        title: format!("{} in {}", view.track.joint, view.name),
        x_label: "time (s)".to_owned(),
        y_label: format!("position ({})", view.residual.unit),
        series,
        ..Panel::default()
    }
}

fn residual_over_time(view: &View) -> Panel {
    let (clock, floor) = (&view.track.clock_s, view.track.floor);
    let ends = [clock.first(), clock.last()].map(|t| t.copied().unwrap_or(0.0));
    let level = |y: f64| ends.map(|t| (t, y)).to_vec();
    Panel {
        title: format!("Residual in {}", view.name),
        x_label: "time (s)".to_owned(),
        y_label: format!("measured − simulated ({})", view.residual.unit),
        series: vec![
            Series::new("residual", Ink::Main, Mark::Line, thin_line(clock, &view.track.error)),
            Series::new("± noise floor", Ink::Truth, Mark::Dashes, level(floor)),
            Series::nameless(Ink::Truth, Mark::Dashes, level(-floor)),
        ],
        ..Panel::default()
    }
}

/// The residual against something, forward and backward motion apart.
fn cloud(views: &[View], title: &str, x_label: &str, x: impl Fn(&Track) -> Vec<f64>) -> Panel {
    let mut clouds = [Vec::new(), Vec::new()];
    for view in views {
        let directions = view.track.directions();
        let points = x(view.track).into_iter().zip(view.track.error.iter().copied());
        for (point, direction) in points.zip(&directions).filter(|(p, _)| p.0.is_finite() && p.1.is_finite()) {
            clouds[usize::from(*direction < 0.0)].push(point);
        }
    }
    residuals_of(views, title, x_label, by_direction(clouds))
}

fn by_direction([forward, backward]: [Vec<(f64, f64)>; 2]) -> Vec<Series> {
    vec![
        Series::new("forward", Ink::Main, Mark::Dots, thin_cloud(&forward)),
        Series::new("backward", Ink::Second, Mark::Dots, thin_cloud(&backward)),
    ]
}

fn residuals_of(views: &[View], title: &str, x_label: &str, series: Vec<Series>) -> Panel {
    let unit = views.first().map_or("", |view| &view.residual.unit);
    let y_label = format!("measured − simulated ({unit})");
    Panel { title: title.to_owned(), x_label: x_label.to_owned(), y_label, series, ..Panel::default() }
}

/// The residual before and after each reversal, by the direction afterwards.
fn around_reversals(views: &[View]) -> Panel {
    let mut clouds = [Vec::new(), Vec::new()];
    for track in views.iter().map(|view| view.track) {
        let (clock_s, error, directions) = (&track.clock_s, &track.error, track.directions());
        for at in track.reversals() {
            let (from_s, to_s) = (clock_s[at] + AROUND_REVERSAL_S.0, clock_s[at] + AROUND_REVERSAL_S.1);
            let range = clock_s.partition_point(|t| *t < from_s)..clock_s.partition_point(|t| *t <= to_s);
            let points = range.map(|i| (clock_s[i] - clock_s[at], error[i])).filter(|point| point.1.is_finite());
            clouds[usize::from(directions[at] < 0.0)].extend(points);
        }
    }
    let panel = residuals_of(views, "Residual around reversals", "time since the reversal (s)", by_direction(clouds));
    Panel { marks_x: vec![0.0], ..panel }
}

fn spectra(views: &[View]) -> Panel {
    let unit = views.first().map_or("", |view| &view.residual.unit);
    // The spectrum of white noise is flat: sigma² spread over half the rate.
    let flat = |view: &View, to_hz: f64| {
        let level = view.track.floor / to_hz.sqrt();
        vec![(0.0, level.log10()), (to_hz, level.log10())]
    };
    let mut series = Vec::new();
    for (k, view) in views.iter().enumerate() {
        let points = spectrum(&view.track.clock_s, &view.track.error);
        let to_hz = points.last().map_or(0.0, |point| point.0);
        let decades = points.iter().map(|(hz, density)| (*hz, density.log10())).collect();
        series.push(Series::new(view.name, ink(k), Mark::Line, decades));
        if k == 0 && to_hz > 0.0 {
            series.push(Series::nameless(Ink::Truth, Mark::Dashes, flat(view, to_hz)));
        }
    }
    Panel {
        title: "Spectrum of the residual (dashes: the noise floor)".to_owned(),
        x_label: "frequency (Hz)".to_owned(),
        y_label: format!("log10 of density ({unit}/√Hz)"),
        series,
        ..Panel::default()
    }
}

fn autocorrelations(views: &[View]) -> Panel {
    const MOST: usize = 200;
    let mut series = Vec::new();
    for (k, view) in views.iter().enumerate() {
        let clock = &view.track.clock_s;
        let step_s = (clock[clock.len() - 1] - clock[0]) / clock.len().max(2) as f64;
        let rho = autocorrelation(&view.track.error, MOST);
        let points = rho.iter().enumerate().map(|(lag, rho)| (lag as f64 * step_s, *rho)).collect();
        series.push(Series::new(view.name, ink(k), Mark::Line, points));
        if k == 0 {
            // Nineteen in twenty autocorrelations of white noise lie between these.
            let band = 1.96 / (view.track.error.iter().filter(|e| e.is_finite()).count() as f64).sqrt();
            let level = |y: f64| vec![(0.0, y), (rho.len() as f64 * step_s, y)];
            series.push(Series::nameless(Ink::Truth, Mark::Dashes, level(band)));
            series.push(Series::nameless(Ink::Truth, Mark::Dashes, level(-band)));
        }
    }
    Panel {
        title: "Autocorrelation of the residual (dashes: white noise)".to_owned(),
        x_label: "lag (s)".to_owned(),
        y_label: "autocorrelation (1)".to_owned(),
        series,
        show_y: vec![0.0, 1.0],
        ..Panel::default()
    }
}

fn ink(k: usize) -> Ink {
    [Ink::Main, Ink::Second].get(k).copied().unwrap_or(Ink::Shade(0.55))
}

fn extent(values: &[f64]) -> (f64, f64) {
    let there = values.iter().filter(|x| x.is_finite());
    there.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)))
}

/// A line of few points that keeps every peak: the lowest and the highest of each stretch, in their order.
fn thin_line(clock_s: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = clock_s.iter().copied().zip(values.iter().copied()).collect();
    if points.len() <= FINE {
        return points;
    }
    let ends = |stretch: &[(f64, f64)]| {
        let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let pick = [stretch.iter().min_by(by_value), stretch.iter().max_by(by_value)];
        let mut pick: Vec<(f64, f64)> = pick.into_iter().flatten().copied().collect();
        // A hole in a stretch stays a hole.
        pick.extend(stretch.iter().find(|point| point.1.is_nan()));
        pick.sort_by(|a, b| a.0.total_cmp(&b.0));
        pick
    };
    points.chunks(points.len().div_ceil(FINE / 2)).flat_map(ends).collect()
}

/// Every so-manieth point.
fn thin_cloud(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().copied().step_by(points.len().div_ceil(FINE).max(1)).collect()
}
