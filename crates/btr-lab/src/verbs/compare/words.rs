//! Numbers in the sentences of a verdict.

/// A multiple, as precise as it is of use.
pub(super) fn times(x: f64) -> String {
    if x < 9.95 { format!("{x:.1}") } else { format!("{x:.0}") }
}

/// "42 ms late", or early.
pub(super) fn late_by(lag_s: f64) -> String {
    let word = if lag_s < 0.0 { "early" } else { "late" };
    format!("{} ms {word}", times(1e3 * lag_s.abs()))
}

/// A size with two digits in a unit that people think in: degrees, mm.
pub(super) fn size(x: f64, unit: &str) -> String {
    let (x, unit) = match unit {
        "rad" => (x.to_degrees(), "degrees"),
        "m" => (1e3 * x, "mm"),
        other => (x, other),
    };
    let x = match x.abs() {
        a if !(1e-3..1e4).contains(&a) => format!("{x:.1e}"),
        a => format!("{x:.*}", (1 - a.log10().floor() as i32).max(0) as usize),
    };
    format!("{x} {unit}")
}
