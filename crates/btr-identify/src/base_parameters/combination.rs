//! A combination of parameters that logs can tell, and its name.

use serde::Serialize;

/// Significant digits of a coefficient in a name.
const DIGITS: i32 = 3;

/// A linear combination of parameters: one leads it, with the coefficient 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Combination {
    /// As a sum: `mass*com_x@upper + 0.3*mass@forearm`.
    pub name: String,
    /// SI unit of the leading parameter, as text.
    pub unit: String,
    /// Its parameters with their coefficients, the leading one first.
    pub parts: Vec<CombinationPart>,
    /// The model's value.
    pub model: f64,
    /// The estimate.
    pub value: f64,
    /// Standard deviation of the estimate; none where the residual still has structure.
    pub sd: Option<f64>,
    /// The same in percent of the estimate's size.
    pub sd_percent: Option<f64>,
}

/// A parameter in a combination.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CombinationPart {
    /// Its name.
    pub parameter: String,
    /// What one unit of it adds.
    pub coefficient: f64,
}

impl Combination {
    pub(super) fn new(parts: Vec<CombinationPart>, unit: String, model: f64, value: f64, sd: Option<f64>) -> Self {
        let sd_percent = sd.map(|sd| 100.0 * sd / value.abs()).filter(|percent| percent.is_finite());
        Combination { name: sum(&parts), unit, parts, model, value, sd, sd_percent }
    }
}

/// The parts as a sum.
fn sum(parts: &[CombinationPart]) -> String {
    let term = |(i, part): (usize, &CombinationPart)| {
        let size = rounded(part.coefficient.abs());
        let factor = if (size - 1.0).abs() < f64::EPSILON { String::new() } else { format!("{size}*") };
        let sign = match (i, part.coefficient < 0.0) {
            (0, false) => "",
            (0, true) => "-",
            (_, false) => " + ",
            (_, true) => " - ",
        };
        format!("{sign}{factor}{}", part.parameter)
    };
    parts.iter().enumerate().map(term).collect()
}

/// A positive number to a few significant digits.
fn rounded(x: f64) -> f64 {
    let unit = 10.0_f64.powi(DIGITS - 1 - x.log10().floor() as i32);
    if unit.is_finite() { (x * unit).round() / unit } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_sum_with_rounded_coefficients() {
        let part = |coefficient: f64, name: &str| CombinationPart { parameter: name.to_owned(), coefficient };
        let parts =
            [part(1.0, "mass*com_x@upper"), part(0.299_999_999, "mass@hand"), part(-1.0, "b"), part(-12.5, "c")];
        assert_eq!(sum(&parts), "mass*com_x@upper + 0.3*mass@hand - b - 12.5*c");
        assert_eq!((rounded(123_456.0), rounded(0.001_234_56)), (123_000.0, 0.001_23));
    }
}
