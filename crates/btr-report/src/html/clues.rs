//! Plots of a joint's residual against velocity, position and load, around reversals, its spectrum and autocorrelation.

use super::views::{FINE, JointView};
use crate::plot::{Ink, Mark, Panel, Series};
use btr_core::signal::stats::autocorrelation;
use btr_identify::compare::{JointTrack, spectrum};

/// Time window around a reversal, in s.
const AROUND_REVERSAL_S: (f64, f64) = (-0.1, 0.4);

/// The residual against its possible causes, in all these logs or in the one with the largest error.
pub(super) fn follows(views: &[JointView], worst: &JointView) -> [Panel; 6] {
    let unit = worst.unit();
    let against = |title: &str, x_label: &str, x: &dyn Fn(&JointTrack) -> Vec<f64>| Panel {
        title: title.to_owned(),
        x_label: x_label.to_owned(),
        y_label: format!("measured − simulated ({unit})"),
        series: clouds(views, &|track| {
            let points = x(track).into_iter().zip(track.error.iter().copied());
            points.zip(track.directions()).collect()
        }),
        ..Panel::default()
    };
    let velocity = |track: &JointTrack| track.motion.iter().map(|m| m.velocity).collect();
    let position = |track: &JointTrack| track.motion.iter().map(|m| m.value).collect();
    let load = format!("load: {}", worst.after.track.load_label);
    [
        against("Residual against velocity", &format!("velocity ({unit}/s)"), &velocity),
        against("Residual against position", &format!("position ({unit})"), &position),
        against("Residual against load", &load, &|track| track.load.clone()),
        around_reversals(views, unit),
        spectra(views, unit),
        autocorrelations(views),
    ]
}

/// Points with the direction of motion at each.
type Directed = Vec<((f64, f64), f64)>;

/// Scatter plots: for one simulation by direction of motion, for two simulations one each.
fn clouds(views: &[JointView], points: &dyn Fn(&JointTrack) -> Directed) -> Vec<Series> {
    let mut clouds = [Vec::new(), Vec::new()];
    for view in views {
        for (k, (_, _, version)) in view.versions("").into_iter().enumerate() {
            let finite = |p: &((f64, f64), f64)| p.0.0.is_finite() && p.0.1.is_finite();
            for (point, direction) in points(version.track).into_iter().filter(finite) {
                let backward = usize::from(direction < 0.0);
                clouds[if view.before.is_some() { k } else { backward }].push(point);
            }
        }
    }
    let names = match views.iter().any(|view| view.before.is_some()) {
        true => [("before", Ink::Third), ("after", Ink::Main)],
        false => [("forward", Ink::Main), ("backward", Ink::Second)],
    };
    let series = names.into_iter().zip(&clouds);
    series.map(|((name, ink), cloud)| Series::new(name, ink, Mark::Dots, thin_cloud(cloud))).collect()
}

/// The residual before and after each reversal, by the direction of motion afterwards.
fn around_reversals(views: &[JointView], unit: &str) -> Panel {
    let points = |track: &JointTrack| -> Directed {
        let (clock_s, error, directions) = (&track.clock_s, &track.error, track.directions());
        let around = |at: usize| {
            let (from_s, to_s) = (clock_s[at] + AROUND_REVERSAL_S.0, clock_s[at] + AROUND_REVERSAL_S.1);
            let range = clock_s.partition_point(|t| *t < from_s)..clock_s.partition_point(|t| *t <= to_s);
            let direction = directions[at];
            range.map(move |i| ((clock_s[i] - clock_s[at], error[i]), direction))
        };
        track.reversals().into_iter().flat_map(around).collect()
    };
    Panel {
        title: "Residual around reversals".to_owned(),
        x_label: "time since the reversal (s)".to_owned(),
        y_label: format!("measured − simulated ({unit})"),
        series: clouds(views, &points),
        marks_x: vec![0.0],
        ..Panel::default()
    }
}

/// The tracks of a spectrum: for one simulation every log, for two simulations the worst log in both.
fn lines<'a>(views: &'a [JointView]) -> Vec<(&'a str, Ink, &'a JointTrack)> {
    match views {
        [worst, ..] if worst.before.is_some() => {
            worst.versions("").into_iter().map(|(name, ink, version)| (name, ink, version.track)).collect()
        }
        _ => views.iter().enumerate().map(|(k, view)| (view.name, ink(k), view.after.track)).collect(),
    }
}

fn spectra(views: &[JointView], unit: &str) -> Panel {
    // The spectrum of white noise is flat: sigma² spread over half the rate.
    let flat = |track: &JointTrack, to_hz: f64| {
        let level = track.floor / to_hz.sqrt();
        vec![(0.0, level.log10()), (to_hz, level.log10())]
    };
    let mut series = Vec::new();
    for (k, (name, ink, track)) in lines(views).into_iter().enumerate() {
        let points = spectrum(&track.clock_s, &track.error);
        let to_hz = points.last().map_or(0.0, |point| point.0);
        let decades = points.iter().map(|(hz, density)| (*hz, density.log10())).collect();
        series.push(Series::new(name, ink, Mark::Line, decades));
        if k == 0 && to_hz > 0.0 {
            series.push(Series::nameless(Ink::Truth, Mark::Dashes, flat(track, to_hz)));
        }
    }
    Panel {
        title: "Spectrum of the residual".to_owned(),
        x_label: "frequency (Hz); dashes: the noise floor".to_owned(),
        y_label: format!("log10 of density ({unit}/√Hz)"),
        series,
        ..Panel::default()
    }
}

fn autocorrelations(views: &[JointView]) -> Panel {
    const MOST: usize = 200;
    let mut series = Vec::new();
    for (k, (name, ink, track)) in lines(views).into_iter().enumerate() {
        let clock = &track.clock_s;
        let step_s = (clock[clock.len() - 1] - clock[0]) / clock.len().max(2) as f64;
        let rho = autocorrelation(&track.error, MOST);
        let points = rho.iter().enumerate().map(|(lag, rho)| (lag as f64 * step_s, *rho)).collect();
        series.push(Series::new(name, ink, Mark::Line, points));
        if k == 0 {
            // 95 % of the autocorrelations of white noise lie between these levels.
            let band = 1.96 / (track.error.iter().filter(|e| e.is_finite()).count() as f64).sqrt();
            let level = |y: f64| vec![(0.0, y), (rho.len() as f64 * step_s, y)];
            series.push(Series::nameless(Ink::Truth, Mark::Dashes, level(band)));
            series.push(Series::nameless(Ink::Truth, Mark::Dashes, level(-band)));
        }
    }
    Panel {
        title: "Autocorrelation of the residual".to_owned(),
        x_label: "lag (s); dashes: white noise".to_owned(),
        y_label: "autocorrelation (1)".to_owned(),
        series,
        show_y: vec![0.0, 1.0],
        ..Panel::default()
    }
}

fn ink(k: usize) -> Ink {
    [Ink::Main, Ink::Second].get(k).copied().unwrap_or(Ink::Shade(0.55))
}

/// Every n-th point, at most [`FINE`].
fn thin_cloud(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().copied().step_by(points.len().div_ceil(FINE).max(1)).collect()
}
