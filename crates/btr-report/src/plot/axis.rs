//! Axes: range, ticks and tick labels.

/// The range of an axis and the step between its ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axis {
    /// Smallest value shown.
    pub(crate) min: f64,
    /// Largest value shown.
    pub(crate) max: f64,
    /// Distance between ticks: 1, 2 or 5 times a power of ten.
    pub(crate) step: f64,
}

impl Axis {
    /// The axis that shows all finite values, with about `ticks` ticks; `margin` is the share left free at each end.
    pub(crate) fn over(values: impl Iterator<Item = f64>, ticks: usize, margin: f64) -> Self {
        let finite = values.filter(|x| x.is_finite());
        let (min, max) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(x), hi.max(x)));
        let (min, max) = match () {
            () if min > max => (0.0, 1.0),
            // A constant gets a margin proportional to its size.
            () if max - min <= 1e-12 * min.abs().max(max.abs()) => (min - 0.5 * room(min), max + 0.5 * room(max)),
            () => (min, max),
        };
        let free = margin * (max - min);
        let (min, max) = (min - free, max + free);
        Axis { min, max, step: nice_step((max - min) / ticks.max(1) as f64) }
    }

    /// Position of the value between the ends, 0 to 1.
    pub(crate) fn share(&self, value: f64) -> f64 {
        (value - self.min) / (self.max - self.min)
    }

    /// The ticks with their labels.
    pub(crate) fn ticks(&self) -> Vec<(f64, String)> {
        let first = (self.min / self.step).ceil();
        let last = (self.max / self.step).floor();
        // Counting in steps keeps 0.3 from becoming 0.30000000000000004.
        let count = (last - first).clamp(0.0, 100.0) as usize;
        (0..=count).map(|i| (first + i as f64) * self.step).map(|x| (x, self.text(x))).collect()
    }

    fn text(&self, value: f64) -> String {
        let digits = -self.step.log10().floor();
        let large = self.min.abs().max(self.max.abs());
        if (1e-4..1e6).contains(&large) {
            let text = format!("{value:.*}", digits.clamp(0.0, 12.0) as usize);
            return text
                .strip_prefix('-')
                .filter(|t| t.bytes().all(|b| matches!(b, b'0' | b'.')))
                .unwrap_or(&text)
                .into();
        }
        let digits = (large.log10().floor() + digits).clamp(0.0, 12.0) as usize;
        format!("{value:.digits$e}")
    }
}

/// Ticks of an axis of decimal logarithms, written as the numbers themselves: powers of ten, and between few of them
/// also their twofold and fivefold.
pub(crate) fn decades(axis: &Axis) -> Vec<(f64, String)> {
    let (first, last) = (axis.min.floor() as i32, axis.max.ceil() as i32);
    let within: &[f64] = if axis.max - axis.min < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let all = (first..=last).flat_map(|power| within.iter().map(move |factor| factor * 10.0_f64.powi(power)));
    let shown = all.filter(|x| (axis.min..=axis.max).contains(&x.log10()));
    let text = |x: f64| if (1e-3..1e5).contains(&x) { format!("{x}") } else { format!("{x:e}") };
    shown.map(|x| (x.log10(), text(x))).collect()
}

fn room(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { x.abs() }
}

/// The smallest of 1, 2, 5 times a power of ten that is not smaller.
fn nice_step(rough: f64) -> f64 {
    let power = 10.0_f64.powf(rough.log10().floor());
    let nice = [1.0, 2.0, 5.0, 10.0].into_iter().find(|f| f * power >= rough * (1.0 - 1e-9));
    nice.unwrap_or(10.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(min: f64, max: f64) -> Vec<String> {
        Axis::over([min, max].into_iter(), 5, 0.0).ticks().into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(texts(0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(texts(-0.3, 0.3), ["-0.2", "0.0", "0.2"]);
        assert_eq!(texts(0.0, 143.0), ["0", "50", "100"]);
        assert_eq!(texts(0.0, 3e-6), ["0e0", "1e-6", "2e-6", "3e-6"]);
    }

    #[test]
    fn decades_are_written_as_numbers() {
        let texts = |min: f64, max: f64| -> Vec<String> {
            decades(&Axis { min, max, step: 1.0 }).into_iter().map(|(_, text)| text).collect()
        };
        assert_eq!(texts(-0.1, 1.4), ["1", "2", "5", "10", "20"]);
        assert_eq!(texts(-1.2, 5.1), ["0.1", "1", "10", "100", "1000", "10000", "1e5"]);
    }

    #[test]
    fn constants_and_nothing_get_an_axis_too() {
        let constant = Axis::over([2.0, 2.0].into_iter(), 5, 0.0);
        assert_eq!((constant.min, constant.max), (1.0, 3.0));
        let nothing = Axis::over([f64::NAN].into_iter(), 5, 0.0);
        assert_eq!((nothing.min, nothing.max), (0.0, 1.0));
    }
}
