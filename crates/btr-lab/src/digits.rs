//! Numbers for people.

/// A number with four significant digits, without an exponent between 1e-4 and 1e6; `-` where it is not finite.
pub fn number(x: f64) -> String {
    match x.abs() {
        _ if !x.is_finite() => "-".to_owned(),
        0.0 => "0".to_owned(),
        a if !(1e-4..1e6).contains(&a) => format!("{x:.3e}"),
        a => format!("{x:.*}", (3 - a.log10().floor() as i32).clamp(0, 6) as usize),
    }
}

/// A number as [`number`] writes it, or a dash where there is none.
pub fn maybe(x: Option<f64>) -> String {
    x.map_or_else(|| "-".to_owned(), number)
}

/// An interval, or a dash where there is none.
pub fn span(interval: Option<[f64; 2]>) -> String {
    interval.map_or_else(|| "-".to_owned(), |[low, high]| format!("{} .. {}", number(low), number(high)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_four_digits() {
        let shown: Vec<String> = [0.0, 1.0, -12.3456, 0.012345, 123456.7, 1e-9, f64::NAN].map(number).into();
        assert_eq!(shown, ["0", "1.000", "-12.35", "0.01235", "123457", "1.000e-9", "-"]);
    }
}
