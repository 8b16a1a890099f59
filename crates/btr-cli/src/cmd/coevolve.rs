//! `btr coevolve`: the loop, live, and what it found.

use super::common;
use crate::args::{CoevolveArgs, Global};
use crate::exit::{DONE, INTERRUPTED, MISSED};
use crate::progress::Progress;
use btr_core::coevolve::{Change, Coevolution, Iteration, Promise, StepOutcome, StopReason};
use btr_core::world::Simulator;
use btr_identify::LadderStep;
use btr_lab::experiment::{Experiment, Source};
use btr_lab::failure::Failure;
use btr_lab::run::Run;
use btr_lab::run::augment::Cause;
use btr_lab::run::execute;
use btr_lab::run::execute::{FinishedRun, RunObserver};
use btr_lab::run::report;
use btr_lab::run::report::{ByDistance, RunReport, TwinComparison};
use btr_report::figures;
use btr_report::table::{Table, maybe, number};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

pub(crate) fn run(args: &CoevolveArgs, global: &Global) -> Result<u8, Failure> {
    let mut source = Source::read(&args.experiment)?;
    source.set(&global.settings)?;
    let folder = match &args.out {
        Some(folder) => folder.clone(),
        None => Path::new("runs").join(source.parse()?.name),
    };
    let mut experiment = Experiment::new(source, global.seed, &folder)?;
    if args.dry_run {
        return dry_run(&experiment, &folder, global);
    }
    let mut watcher = Watcher { global, interrupted: watch_for_interrupts()?, progress: None };
    if !global.quiet {
        experiment.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let ended = execute::coevolve(&mut experiment, &folder, args.resume, &mut watcher);
    watcher.finish();
    match ended? {
        Some(mut ended) => {
            ended.files.extend(figures::write(&experiment, &ended.run, &ended.report)?);
            finish(&ended, args, global)
        }
        None => Ok(say_interrupted(args, &folder)),
    }
}

/// Shows a run on stderr.
struct Watcher<'a> {
    global: &'a Global,
    interrupted: Arc<AtomicBool>,
    progress: Option<Progress>,
}

impl Watcher<'_> {
    fn finish(&self) {
        self.progress.iter().for_each(Progress::finish);
    }
}

impl RunObserver for Watcher<'_> {
    fn begins(&mut self, experiment: &Experiment, run: &Coevolution) {
        self.finish();
        self.progress = Some(Progress::new(experiment.model.clone(), run, self.global));
    }

    fn step(&mut self, run: &Coevolution, step: Option<&StepOutcome>) {
        let Some(progress) = &self.progress else { return };
        progress.update(run);
        let history = run.history();
        match step {
            Some(StepOutcome::Generation) => {
                history.generations.last().into_iter().for_each(|g| progress.generation(g))
            }
            Some(StepOutcome::Iteration) => {
                let of = run.plan().iterations;
                history.iterations.last().into_iter().for_each(|it| progress.iteration(it, of));
            }
            _ => {}
        }
    }

    fn ladder_step(&self, ladder_step: &LadderStep) {
        common::tell(ladder_step, self.global);
    }

    fn warn(&mut self, line: &str) {
        self.say(&format!("warning: {line}"));
    }

    fn say(&mut self, line: &str) {
        self.progress.iter().for_each(|progress| progress.say(line));
    }

    fn stops(&mut self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}

/// The first Ctrl-C lets the step in flight finish, the second one does not.
fn watch_for_interrupts() -> Result<Arc<AtomicBool>, Failure> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = interrupted.clone();
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(INTERRUPTED));
        }
        eprintln!("\nfinishing the step in flight; press again to stop at once");
    })
    .map_err(|e| Failure::new("signal", e.to_string(), None))?;
    Ok(interrupted)
}

fn say_interrupted(args: &CoevolveArgs, folder: &Path) -> u8 {
    eprintln!(
        "interrupted; go on with: btr coevolve {} --out {} --resume",
        args.experiment.display(),
        folder.display()
    );
    INTERRUPTED
}

fn dry_run(experiment: &Experiment, folder: &Path, global: &Global) -> Result<u8, Failure> {
    let (s, c) = (experiment.model.simulations(), experiment.model.controllers());
    let plan = &experiment.plan;
    if global.json {
        let dims: Vec<_> = s.dims().iter().map(|d| &d.name).collect();
        println!("{}", serde_json::json!({ "ok": true, "dry_run": true, "parameters": dims, "controllers": c.len() }));
        return Ok(DONE);
    }
    println!("{}: {} iterations, output in {}", experiment.name, plan.iterations, folder.display());
    println!("real tests: {}", plan.real_tests.map_or_else(|| "no limit".to_owned(), |n| format!("at most {n}")));
    for (what, space) in [("S, simulations", s), ("C, controllers", c)] {
        println!("\n{what}: {} parameters", space.len());
        for d in space.dims() {
            println!("  {:<32} {} .. {} {}", d.name, number(d.min), number(d.max), d.unit);
        }
    }
    Ok(DONE)
}

fn finish(ended: &FinishedRun, args: &CoevolveArgs, global: &Global) -> Result<u8, Failure> {
    let FinishedRun { run, report, files, waiting } = ended;
    if global.json {
        println!("{}", ended.document()?);
    } else {
        show(report);
        if let Some(cause) = report.diagnosis.as_ref().filter(|_| report.disengaged) {
            next_step(cause, run.folder(), args, global);
        }
        if let Some(what) = waiting {
            println!("\nwaiting for a real test: {what}");
        }
        println!("\nfiles");
        files.iter().for_each(|f| println!("  {}", f.display()));
    }
    Ok(exit_code(run, report))
}

/// A goal that was asked for and missed, or a space of simulations that cannot explain reality, is not a success.
fn exit_code(run: &Run, report: &RunReport) -> u8 {
    let goal = run.state().plan().fitness_goal.is_some();
    match report.stop_reason {
        Some(StopReason::GoalReached) | None => DONE,
        Some(StopReason::Disengaged | StopReason::NoRealData) => MISSED,
        Some(_) if goal => MISSED,
        Some(_) => DONE,
    }
}

fn show(report: &RunReport) {
    println!("{}", iterations(report).render());
    println!(
        "\nstopped: {}   real tests: {}   simulated: {} ({} failed)",
        report.stop_reason.as_ref().map_or("waiting for reality", reason_text),
        report.real_tests,
        report.simulated_evaluations,
        report.failed_evaluations
    );
    for doubt in &report.doubts {
        println!("bad: {}", doubt.sentence());
    }
    let at_bound = report.iterations.last().map_or(&[][..], |last| &last.evidence.at_bound);
    for grown in &report.augmentations {
        println!("S has grown after iteration {}: {}", grown.after_iteration, grown.parameters.join(", "));
    }
    show_drift(report);
    if report.disengaged {
        show_disengagement(report);
    } else if !at_bound.is_empty() {
        println!("at a bound of S, the truth may lie beyond: {}", at_bound.join(", "));
    }
    if let Some(best) = report.recommended.as_ref().filter(|_| !report.fitness.is_empty()) {
        println!("best in reality: fitness {}, in transfers/{:04}", number(best.fitness_real), best.test);
    }
    show_map(report);
    show_gap(report);
    show_posterior(report);
    if let Some(revealed) = report.revealed.as_ref().filter(|_| report.iterations.iter().any(|it| it.phi.is_some())) {
        show_revealed(report, revealed);
    }
    show_logs(report);
    show_by_distance(report);
}

fn reason_text(reason: &StopReason) -> &'static str {
    match reason {
        StopReason::GoalReached => "the goal was reached",
        StopReason::NothingBetter => "no controller of the map promises much more than the best one tried",
        StopReason::IterationsDone => "all iterations are done",
        StopReason::RealTestsSpent => "the real tests are spent",
        StopReason::Disengaged => "disengaged",
        StopReason::NoRealData => "no real test gave anything",
    }
}

fn iterations(report: &RunReport) -> Table {
    let judged = !report.fitness.is_empty();
    let doubted = report.iterations.iter().any(|it| it.fitness_ci95.is_some());
    let fitness: &[&str] = match (judged, doubted) {
        (false, _) => &[],
        (true, true) => &["f promised", "95 %", "f real", "best real"],
        (true, false) => &["f simulated", "f real", "best real", "rank agreement"],
    };
    let mut table = Table::new(&[&["iteration", "tests", "phi predicted", "phi"], fitness].concat());
    for it in &report.iterations {
        let mut row = vec![it.i.to_string(), it.real_tests.to_string(), maybe(it.phi_predicted), maybe(it.phi)];
        if judged && doubted {
            row.extend([maybe(it.fitness_sim), span(it.fitness_ci95), maybe(it.fitness_real), maybe(it.best_real)]);
        } else if judged {
            let cells = [it.fitness_sim, it.fitness_real, it.best_real, it.evidence.rank_agreement];
            row.extend(cells.map(maybe));
        }
        table.row(row);
    }
    table
}

/// How much of the map is filled, and what became of its promises.
fn show_map(report: &RunReport) {
    let Some(map) = &report.map else { return };
    let elites = &map.outlook.elites;
    let most = |of: &dyn Fn(&Promise) -> Option<f64>| maybe(elites.iter().filter_map(of).max_by(f64::total_cmp));
    let mut table = Table::new(&["cells", "filled", "best simulated", "best promised", "best real", "tests"]);
    table.row(vec![
        map.outlook.cells.to_string(),
        map.filled.to_string(),
        most(&|elite| Some(elite.simulated)),
        most(&|elite| Some(elite.promised)),
        most(&|elite| elite.real),
        report.real_tests.to_string(),
    ]);
    println!("\nthe map of controllers\n{}", table.render());
}

/// From where to where.
fn span(interval: Option<[f64; 2]>) -> String {
    interval.map_or_else(|| "-".to_owned(), |[low, high]| format!("{} .. {}", number(low), number(high)))
}

/// By how much reality falls short of promises, and which of these held.
fn show_gap(report: &RunReport) {
    let Some(gap) = report.reality_gap.filter(|gap| gap.within[1] > 0) else { return };
    let interval = gap.ci95.map_or_else(String::new, |_| format!(" (95 %: {})", span(gap.ci95)));
    println!(
        "reality gap: {}{interval} from promised to real fitness, over {}; {} of {} within their interval",
        number(gap.mean),
        tests(gap.tests),
        gap.within[0],
        gap.within[1]
    );
}

/// What the tests tell of S, where the run estimated a posterior and nobody knows the truth.
fn show_posterior(report: &RunReport) {
    let Some(estimate) = report.iterations.last().and_then(|last| last.posterior.as_ref()) else { return };
    if report.revealed.is_none() {
        let mut table = Table::new(&["parameter", "estimate", "95 %"]);
        for (name, belief) in &estimate.parameters {
            table.row(vec![name.clone(), number(belief.value), span(belief.ci95)]);
        }
        println!("\n{}", table.render());
    }
    if estimate.parameters.values().all(|belief| belief.ci95.is_none()) {
        println!("the estimates do not explain the tests and are not to be used");
    }
    if estimate.not_told.is_empty() {
        println!("told: all {} parameters, by {}", estimate.parameters.len(), tests(told_by(report)));
    } else {
        println!("not told by these tests: {}", estimate.not_told.join(", "));
    }
    for open in &estimate.open_directions {
        let parts = open.parameters.iter().map(|(name, share)| format!("{share:+.2} {name}"));
        println!("hardly told at all: {}", parts.collect::<Vec<_>>().join(" "));
    }
}

/// After how many real tests everything was told, as it has been since.
fn told_by(report: &RunReport) -> usize {
    let told = |it: &&Iteration| it.posterior.as_ref().is_some_and(|estimate| estimate.not_told.is_empty());
    report.iterations.iter().rev().take_while(told).last().map_or(0, |it| it.real_tests)
}

/// So many real tests.
fn tests(count: usize) -> String {
    if count == 1 { "1 real test".to_owned() } else { format!("{count} real tests") }
}

/// When the robot has changed, and in what.
fn show_drift(report: &RunReport) {
    for drift in &report.drifts {
        let change = |c: &Change| {
            format!("{} {} -> {} ({} sd)", c.parameter, number(c.before), number(c.after), number(c.deviations))
        };
        let changed: Vec<String> = drift.changed.iter().map(change).collect();
        let what = match (drift.explained, changed.is_empty()) {
            (true, false) => changed.join(", "),
            (true, true) => "what has changed is not told yet".to_owned(),
            (false, _) => "S does not hold what has changed".to_owned(),
        };
        println!("the robot has changed before test {}: {what}", drift.before_test);
    }
    if let Some(test) = report.suspicion {
        println!(
            "nothing explains test {test} beside those before it: the robot has changed, or S lacks something; one more \
             iteration repeats test {} to tell",
            test.saturating_sub(1)
        );
    }
}

fn show_disengagement(report: &RunReport) {
    let Some(last) = report.iterations.last() else { return };
    let e = &last.evidence;
    println!("\ndisengaged: the space of simulations does not reproduce what the robot does");
    if last.posterior.is_some() {
        println!("  no simulation in it explains the real tests: {} x noise, from every start", maybe(last.phi));
        if let Some(cause) = &report.diagnosis {
            show_cause(cause);
        }
        return;
    }
    println!("  phi stands at {} of where it began and no longer falls", maybe(e.phi_share));
    println!("  fresh transfers are mispredicted by {} of where it began", maybe(e.predicted_share));
    println!("  rank agreement of controllers, promised against real: {}", maybe(e.rank_agreement));
    println!("  pressure of controllers on simulations: {}", maybe(e.pressure_on_simulations));
    println!("  pressure of simulations on controllers: {}", maybe(e.pressure_on_controllers));
    if let Some(cause) = &report.diagnosis {
        show_cause(cause);
    }
    if !e.at_bound.is_empty() {
        println!("  at a bound of S, the truth may lie beyond: {}", e.at_bound.join(", "));
    }
}

/// Why the run disengaged: what is missing, how large it is, and what these tests cannot tell from it.
fn show_cause(cause: &Cause) {
    println!("  {}", cause.sentence());
    for found in &cause.effects {
        for parameter in &found.parameters {
            let interval = parameter.ci95.map_or_else(String::new, |_| format!(" (95 %: {})", span(parameter.ci95)));
            println!("    {} = {} {}{interval}", parameter.name, number(parameter.value), parameter.unit);
        }
        if !found.alike.is_empty() {
            println!("    these tests cannot tell it from {}", found.alike.join(", "));
        }
    }
}

/// What to type so that the run goes on with what it lacks.
fn next_step(cause: &Cause, folder: &Path, args: &CoevolveArgs, global: &Global) {
    let missing = cause.missing();
    if missing.is_empty() {
        return;
    }
    let (model, larger) = (args.experiment.display(), args.experiment.with_extension("larger.toml"));
    // The settings of the command line are part of the experiment; `btr add` writes them into the file.
    let settings: String = global.settings.iter().map(|setting| format!(" --set '{setting}'")).collect();
    let seed = global.seed.map_or_else(String::new, |seed| format!(" --seed {seed}"));
    let (larger, folder) = (larger.display(), folder.display());
    println!(
        "  next: btr add {model} {}{settings} -o {larger} && btr coevolve {larger}{seed} --out {folder} --resume",
        missing.join(" ")
    );
}

fn show_revealed(report: &RunReport, revealed: &TwinComparison) {
    let Some(last) = report.iterations.last() else { return };
    println!("\nthe hidden twin");
    let intervals: &[&str] = if last.posterior.is_some() { &["95 %"] } else { &[] };
    let (before, after) = (["parameter", "truth", "estimate"], ["error %", "error % at first"]);
    let mut table = Table::new(&[&before, intervals, &after].concat());
    for (name, truth) in &revealed.truth.parameters {
        let cell = |map: &indexmap::IndexMap<String, f64>| maybe(map.get(name).copied());
        let mut row = vec![name.clone(), number(*truth), cell(&last.parameters)];
        if let Some(estimate) = &last.posterior {
            row.push(span(estimate.parameters.get(name).and_then(|belief| belief.ci95)));
        }
        row.extend([cell(&revealed.error_percent), cell(&revealed.error_percent_before)]);
        table.row(row);
    }
    println!("{}", table.render());
    if !revealed.truth.effects.is_empty() {
        println!("hidden effects: {}", revealed.truth.effects.join(", "));
    }
    let state: Vec<String> = revealed.state_match.iter().map(|(unit, x)| format!("{} {unit}", number(*x))).collect();
    println!("state match (rms of simulated − real, best controller): {}", state.join(", "));
}

fn show_logs(report: &RunReport) {
    let mut table = Table::new(&["log", "", "channel", "mean |error| before", "after", "fit % before", "after"]);
    for score in &report.logs {
        table.row(vec![
            score.log.clone(),
            if score.held_out { "held out" } else { "learnt" }.to_owned(),
            format!("{} ({})", score.channel, score.unit),
            number(score.before.mean_abs),
            number(score.after.mean_abs),
            number(score.before.fit_percent),
            number(score.after.fit_percent),
        ]);
    }
    if table.is_empty() {
        return;
    }
    println!("\nrecorded logs\n{}", table.render());
    for (held_out, title) in [(false, "learnt"), (true, "held out")] {
        let scores: Vec<_> =
            report.logs.iter().filter(|s| s.held_out == held_out && s.after.mean_abs.is_finite()).collect();
        let mean = |of: &dyn Fn(&&report::LogScore) -> f64| scores.iter().map(of).sum::<f64>() / scores.len() as f64;
        if !scores.is_empty() {
            let (before, after) = (mean(&|s| s.before.mean_abs), mean(&|s| s.after.mean_abs));
            println!("{title}: mean |error| {} before, {} after", number(before), number(after));
            if after > before {
                println!("  the adapted model is worse than the one it began with: do not use it");
            }
        }
    }
}

fn show_by_distance(report: &RunReport) {
    let Some(first) = report.by_distance.first() else { return };
    println!(
        "\nerror % of each parameter by distance; in brackets how far it must move, alone or to another\n\
         distance's estimate, before the distance tells; misled: it claims to tell, and errs by more"
    );
    let distances: Vec<&str> = report.by_distance.iter().map(|by| by.distance.as_str()).collect();
    let mut table = Table::new(&[&["parameter"], distances.as_slice()].concat());
    for (k, name) in ["phi before", "phi after"].into_iter().enumerate() {
        let phis = report.by_distance.iter().map(|by| number(by.phi[k]));
        table.row(std::iter::once(name.to_owned()).chain(phis).collect());
    }
    if first.phi_of_truth.is_some() {
        let phis = report.by_distance.iter().map(|by| maybe(by.phi_of_truth));
        table.row(std::iter::once("phi of the truth".to_owned()).chain(phis).collect());
    }
    for name in first.parameters.keys() {
        let cell = |by: &ByDistance| {
            let wrong = by.error_percent.get(name).copied();
            let error = maybe(wrong);
            match by.resolution_percent.get(name).copied().flatten() {
                Some(told) if wrong.is_some_and(|wrong| wrong.abs() > told) => format!("{error} [misled]"),
                Some(resolution) => format!("{error} [{}%]", number(resolution)),
                None => format!("{error} [unseen]"),
            }
        };
        table.row(std::iter::once(name.clone()).chain(report.by_distance.iter().map(cell)).collect());
    }
    println!("{}", table.render());
    let fooled = |by: &&ByDistance| by.phi_of_truth.is_some_and(|truth| truth > by.telling);
    for by in report.by_distance.iter().filter(fooled) {
        println!(
            "{} prefers its own estimate to the truth: on this recording what it says is not to be relied on",
            by.distance
        );
    }
}
