//! What a log shows of its sensors' noise.

use super::column::{Column, Unit};
use super::words::Kind;
use btr_core::log::Log;
use btr_core::signal::noise::NoiseEstimate;

/// What the readings of a log show, in the units of `[noise]`; zero is nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ShownNoise {
    pub(super) position: f64,
    pub(super) position_quantum: f64,
    pub(super) torque: f64,
}

impl ShownNoise {
    /// The noise of a log's columns `x0`, `x1`, ..., each in its own unit.
    pub(super) fn of(columns: &[Column], log: &Log) -> Self {
        let estimates = |kind: Kind| {
            let of_kind = columns.iter().enumerate().filter(move |(_, column)| column.kind == kind);
            of_kind.filter_map(|(i, column)| {
                let estimate = NoiseEstimate::of(log.values(&format!("x{i}")).ok()?)?;
                Some((estimate, factor(column))).filter(|(estimate, _)| !estimate.is_negligible())
            })
        };
        ShownNoise {
            position: median(estimates(Kind::Position).map(|(estimate, factor)| factor * estimate.white)),
            position_quantum: median(estimates(Kind::Position).map(|(estimate, factor)| factor * estimate.quantum)),
            torque: median(estimates(Kind::Torque).map(|(estimate, factor)| factor * estimate.sigma())),
        }
    }
}

/// Times this, values of a column are in SI units: by its unit, or by what its name says.
fn factor(column: &Column) -> f64 {
    match column.unit {
        Unit::Native if column.name.to_lowercase().ends_with("_deg") => Unit::Degrees.factor(),
        unit => unit.factor(),
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
