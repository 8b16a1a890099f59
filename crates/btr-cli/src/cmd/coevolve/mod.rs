//! `btr coevolve`: runs the loop, shows its progress and prints its result.

mod disengagement;
mod dry_run;
mod posterior;
mod summary;
mod truth;

use super::common::watch_for_interrupts;
use crate::args::{CoevolveArgs, Global};
use crate::cmd::models::studio::RunPage;
use crate::exit::{DONE, INTERRUPTED, MISSED};
use crate::progress::Progress;
use crate::status::ladder_line;
use btr_core::coevolve::{Coevolution, StepOutcome, StopReason};
use btr_identify::LadderStep;
use btr_lab::experiment::{Experiment, Source};
use btr_lab::failure::Failure;
use btr_lab::run::Run;
use btr_lab::run::execute;
use btr_lab::run::execute::{FinishedRun, RunObserver, RunStart};
use btr_lab::run::report::RunReport;
use btr_lab::verbs::ErrorUnit;
use btr_report::figures;
use disengagement::next_step;
use dry_run::dry_run;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use summary::show;

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
    let shown = Arc::new(AtomicBool::new(false));
    let interrupted = watch_for_interrupts(while_interrupted(shown.clone()), experiment.context.clone())?;
    let page_request = args.studio.then(|| PageRequest { folder: &folder, experiment: &args.experiment });
    let mut watcher = Watcher { global, interrupted: interrupted.clone(), progress: None, page_request, page: None };
    if !global.quiet {
        experiment.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let start = if args.resume { RunStart::Resume } else { RunStart::Begin };
    let ended = execute::coevolve(&mut experiment, &folder, start, &mut watcher);
    watcher.finish();
    let page = watcher.page;
    let code = match ended? {
        Some(mut ended) => {
            ended.files.extend(figures::write(&experiment, &ended.run, &ended.report)?);
            finish(&ended, args, global)?
        }
        None => say_interrupted(args, &folder),
    };
    if let Some(page) = page {
        shown.store(true, Ordering::Relaxed);
        page.wait(|| interrupted.load(Ordering::Relaxed));
    }
    Ok(code)
}

/// What is done on Ctrl-C: the run ends, or its page where it has ended and is only `shown`.
fn while_interrupted(shown: Arc<AtomicBool>) -> impl Fn() -> &'static str {
    move || match shown.load(Ordering::Relaxed) {
        true => "ending the page",
        false => "ending a real test, or finishing the step",
    }
}

/// A page that shows the run.
struct PageRequest<'a> {
    folder: &'a Path,
    experiment: &'a Path,
}

/// Shows a run on stderr.
struct Watcher<'a> {
    global: &'a Global,
    interrupted: Arc<AtomicBool>,
    progress: Option<Progress>,
    /// The page that is asked for and was not begun.
    page_request: Option<PageRequest<'a>>,
    page: Option<RunPage>,
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
        if let Some(PageRequest { folder, experiment }) = self.page_request.take() {
            // A run does not fail because nobody sees it.
            match RunPage::open(folder, experiment) {
                Ok(page) => self.page = Some(page),
                Err(why) => self.warn(&why.message.to_string()),
            }
        }
    }

    fn step(&mut self, run: &Coevolution, step: Option<&StepOutcome>) {
        let Some(progress) = &self.progress else { return };
        progress.update(run);
        let history = run.history();
        match step {
            Some(StepOutcome::Generation) => {
                history.generations.last().into_iter().for_each(|g| progress.generation(g));
            }
            Some(StepOutcome::Iteration) => {
                let of = run.plan().iterations;
                history.iterations.last().into_iter().for_each(|it| progress.iteration(it, of));
            }
            _ => {}
        }
    }

    fn ladder_step(&self, ladder_step: &LadderStep) {
        let line = ladder_line(ladder_step, ErrorUnit::NoiseFloor);
        match &self.progress {
            Some(progress) => progress.say(&line),
            None if !self.global.quiet => eprintln!("{line}"),
            None => {}
        }
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

fn say_interrupted(args: &CoevolveArgs, folder: &Path) -> u8 {
    let (experiment, folder) = (args.experiment.display(), folder.display());
    // The terminal may be gone.
    let _ = writeln!(std::io::stderr(), "interrupted; resume with: btr coevolve {experiment} --out {folder} --resume");
    INTERRUPTED
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

/// A missed goal and a space of simulations that cannot explain reality are not a success.
fn exit_code(run: &Run, report: &RunReport) -> u8 {
    let goal = run.state().plan().fitness_goal.is_some();
    match report.stop_reason {
        Some(StopReason::GoalReached) | None => DONE,
        Some(StopReason::Disengaged | StopReason::NoRealData) => MISSED,
        Some(_) if goal => MISSED,
        Some(_) => DONE,
    }
}
