//! The status line of a verb on logs: on a terminal, what it does, how far it is and for how long. It leaves no line.

use crate::args::Global;
use btr_core::text::printable;
use btr_identify::LadderStep;
use btr_lab::verbs::ErrorUnit;
use btr_physics::model::Model;
use btr_report::table::number;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Redraw period of the line.
const TICK: Duration = Duration::from_millis(200);
/// Rollouts from which their speed is known.
const KNOWN: u64 = 100;

/// The status line of a verb. It ends with this value.
pub(crate) struct Status {
    bar: ProgressBar,
    quiet: bool,
}

impl Status {
    /// A line that says what is done.
    pub(crate) fn new(what: &str, global: &Global) -> Self {
        let live = std::io::stderr().is_terminal() && !global.quiet;
        let target = if live { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(None, target);
        let status = Status { bar, quiet: global.quiet };
        status.styled("{spinner} {wide_msg} {elapsed}", |style| style);
        status.doing(what);
        if live {
            status.bar.enable_steady_tick(TICK);
        }
        status
    }

    fn styled(&self, template: &str, with: impl FnOnce(ProgressStyle) -> ProgressStyle) {
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(with(style));
        }
    }

    /// Says what is done now.
    pub(crate) fn doing(&self, what: &str) {
        self.bar.set_message(printable(what));
    }

    /// Counts the rollouts of a model from now on, of at most this many.
    pub(crate) fn count(&self, model: &Arc<Model>, most: Option<usize>) {
        let (model, began) = (model.clone(), Instant::now());
        let before = model.rollouts.load(Ordering::Relaxed);
        let far = move |_: &ProgressState, line: &mut dyn Write| {
            let done = model.rollouts.load(Ordering::Relaxed) - before;
            let _ = line.write_str(&counted(done, most, began.elapsed()));
        };
        self.styled("{spinner} {wide_msg} {far} · {elapsed}", |style| style.with_key("far", far));
    }

    /// Prints a step of the error ladder above the line.
    pub(crate) fn tell(&self, step: &LadderStep, unit: ErrorUnit) {
        self.say(&ladder_line(step, unit));
    }

    /// Prints a line on stderr, above the status line.
    pub(crate) fn say(&self, line: &str) {
        if !self.quiet {
            self.bar.suspend(|| eprintln!("{line}"));
        }
    }
}

impl Drop for Status {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A step of the error ladder in one line.
pub(crate) fn ladder_line(step: &LadderStep, unit: ErrorUnit) -> String {
    let held_out = step.held_out.map_or(String::new(), |x| format!(", {} held out", number(x)));
    format!("{:<40} {} x {}{held_out}", step.step, number(step.train), unit.name())
}

/// "1234/10200 rollouts, < 3 min left": the limit bounds both.
fn counted(done: u64, most: Option<usize>, elapsed: Duration) -> String {
    let Some(most) = most else { return format!("{done} rollouts") };
    let left = (most as u64).saturating_sub(done);
    let left_s = elapsed.as_secs_f64() * left as f64 / done.max(1) as f64;
    let left = match left_s {
        _ if done < KNOWN => String::new(),
        s if s < 90.0 => format!(", < {:.0} s left", s.max(1.0)),
        s => format!(", < {:.0} min left", s / 60.0),
    };
    format!("{done}/{most} rollouts{left}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_that_is_left_is_bounded_by_the_limit() {
        let after = |done, most| counted(done, most, Duration::from_secs(10));
        assert_eq!(after(500, None), "500 rollouts");
        assert_eq!(after(10, Some(1000)), "10/1000 rollouts");
        assert_eq!(after(500, Some(1000)), "500/1000 rollouts, < 10 s left");
        assert_eq!(after(100, Some(10_000)), "100/10000 rollouts, < 16 min left");
        assert_eq!(after(1200, Some(1000)), "1200/1000 rollouts, < 1 s left");
    }
}
