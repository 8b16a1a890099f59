//! Live progress of a run on stderr: a status line on a terminal, and one line per iteration.

use crate::args::Global;
use btr_core::coevolve::{Coevolution, Generation, Iteration, Method, Plan, Side};
use btr_lab::run::conclusions::tests;
use btr_physics::model::Model;
use btr_report::table::{maybe, number};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Redraw period of the status line.
const TICK: Duration = Duration::from_millis(200);

/// The live display of a run.
pub(crate) struct Progress {
    bar: ProgressBar,
    verbose: bool,
    quiet: bool,
    /// Whether the model has a fitness.
    has_fitness: bool,
    /// Share of the work done when this process began, excluded from the speed of a resumed run.
    from: f64,
    began: Instant,
}

impl Progress {
    pub(crate) fn new(model: Arc<Model>, state: &Coevolution, global: &Global) -> Self {
        let live = std::io::stderr().is_terminal() && !global.quiet;
        let target = if live { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(None, target);
        let (began, has_fitness) = (Instant::now(), !model.fitness.weights().is_empty());
        let speed = move |_: &ProgressState, line: &mut dyn Write| {
            let rollouts = model.rollouts.load(Ordering::Relaxed) as f64;
            let _ = write!(line, "{:.0} evaluations/s", rollouts / began.elapsed().as_secs_f64().max(1e-9));
        };
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} · {speed} · {elapsed}") {
            bar.set_style(style.with_key("speed", speed));
        }
        if live {
            bar.enable_steady_tick(TICK);
        }
        Progress { bar, verbose: global.verbose, quiet: global.quiet, has_fitness, from: done(state), began }
    }

    /// Updates the status line, after a generation or a real test.
    pub(crate) fn update(&self, state: &Coevolution) {
        self.bar.set_message(self.line(state));
    }

    /// Prints a generation with `-v`.
    pub(crate) fn generation(&self, g: &Generation) {
        if self.verbose {
            let side = if g.side == Side::Controllers { "controllers, fitness" } else { "simulators, phi" };
            self.say(&format!(
                "  {}.{} {side}: best {} mean {}",
                g.iteration,
                g.generation,
                number(g.best),
                number(g.mean)
            ));
        }
    }

    /// Prints an iteration.
    pub(crate) fn iteration(&self, it: &Iteration, of: usize) {
        let half = |name: &str| {
            let [low, high] = it.posterior.as_ref()?.parameters.get(name)?.ci95?;
            Some(format!("±{}", number((high - low) / 2.0)))
        };
        let assignment =
            |(name, x): (&String, &f64)| format!("{name}={}{}", number(*x), half(name).unwrap_or_default());
        let parameters: Vec<String> = it.parameters.iter().map(assignment).collect();
        let (promised, real) = (maybe(it.fitness_sim), maybe(it.fitness_real));
        let fitness = if self.has_fitness {
            format!("fitness {promised} in simulation, {real} in reality · ")
        } else {
            String::new()
        };
        let (before, after) = (maybe(it.phi_predicted), maybe(it.phi));
        self.say(&format!("iteration {}/{of} · {fitness}phi {before} → {after} · {}", it.i, tests(it.real_tests)));
        if it.phi.is_some() {
            self.say(&format!("  {}", parameters.join(" ")));
        }
    }

    /// Prints a line above the status line.
    pub(crate) fn say(&self, line: &str) {
        if !self.quiet {
            self.bar.suspend(|| eprintln!("{line}"));
        }
    }

    /// Removes the status line.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn line(&self, state: &Coevolution) -> String {
        let plan = state.plan();
        let mut line = format!("iteration {}/{}", state.iteration(), plan.iterations);
        let last = state.history().generations.last().filter(|g| g.iteration == state.iteration());
        if let Some(g) = last {
            let step = match g.side {
                Side::Controllers => "controllers",
                Side::Simulators => "simulators",
            };
            let of = generations(plan, g.side);
            let what = if g.side == Side::Controllers { "fitness" } else { "phi" };
            let _ = write!(line, " · {step} {}/{of} · {what} {}", g.generation, number(g.best));
        }
        if let Some(it) = state.history().iterations.last() {
            let _ = write!(line, " · real {} · phi {}", maybe(it.best_real), maybe(it.phi));
        }
        let _ = write!(line, " · {} · ETA {}", tests(state.ledger().spent()), self.eta(state));
        line
    }

    /// Estimated time left, at the speed of this process so far.
    fn eta(&self, state: &Coevolution) -> String {
        let share = (done(state) - self.from) / (1.0 - self.from);
        if share <= 0.0 {
            return "?".to_owned();
        }
        let left = self.began.elapsed().as_secs_f64() * (1.0 - share) / share;
        if left < 90.0 { format!("{left:.0} s") } else { format!("{:.0} min", left / 60.0) }
    }
}

/// Share of the plan's iterations that are done; the generations of each search count for half an iteration.
fn done(state: &Coevolution) -> f64 {
    let plan = state.plan();
    let closed = state.history().iterations.len();
    let current = state.history().generations.iter().filter(|g| g.iteration > closed);
    let within: f64 = current.map(|g| 0.5 / generations(plan, g.side).max(1) as f64).sum();
    ((closed as f64 + within) / plan.iterations as f64).min(1.0)
}

/// Generations per iteration of one of the searches.
fn generations(plan: &Plan, side: Side) -> usize {
    match side {
        Side::Controllers => match (&plan.map, &plan.controllers) {
            (Some(map), _) if plan.method == Method::QualityDiversity => map.generations,
            (_, phase) => phase.as_ref().map_or(1, |phase| phase.generations),
        },
        Side::Simulators => plan.simulator_generations(),
    }
}
