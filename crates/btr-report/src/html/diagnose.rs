//! The report of `btr diagnose`.

use super::candidates::{base, candidates};
use super::ladder::{fall, fine_print};
use super::page::{Block, Report, Section};
use super::stages::Stages;
use crate::Subject;
use crate::bounds::about_bounds;
use crate::fell::fell;
use crate::finding::{capped, evidence, helps, likelihood, rivals};
use crate::plot::{Ink, Mark, Panel, Series, figure};
use crate::table::number;
use crate::text::{
    CORRECTED, ESTIMATES, alike, corrected, estimate, findings, fit_command, integrator, remedy, removable, stand_in,
    what_remains,
};
use btr_core::log::Log;
use btr_identify::LadderStep;
use btr_identify::diagnose::Verdict;
use btr_identify::fit::{Degree, Estimate};
use btr_identify::residual_model::TimeStep;
use btr_lab::verbs::{DiagnoseReport, EffectReport, ErrorUnit, LawReport, NextExperiment, Support, ValueReport};
use btr_physics::effects;

/// The page of `btr diagnose`; `u` is the point that was fitted, in this time step.
pub fn diagnose(subject: &Subject, found: &DiagnoseReport, (u, step): (&[f64], TimeStep)) -> String {
    let so_far = if found.cut_short { "The search was cut short; so far: " } else { "" };
    let mut lead = vec![Block::Lead(format!("{so_far}{}", sentence(found))), subject.input_block()];
    let sentence_of = |text: String| Block::Text(format!("{}.", text.replacen("at their", "At their", 1)));
    lead.extend(about_bounds(found).into_iter().map(sentence_of));
    lead.extend(removable(&found.without_effect).map(|sentence| Block::Text(sentence + ".")));
    lead.extend(subject.reserve(&found.doubts));
    lead.extend(fit_command(found, subject).map(Block::Code));
    let mut sections = vec![Section { title: "Verdict".to_owned(), blocks: lead }];
    sections.extend(found.effects.iter().map(|effect| what_it_is(effect, found)));
    sections.extend(found.wrong_values.iter().map(|value| what_is_wrong(value, found)));
    sections.extend(found.residual_law.as_ref().map(law));
    sections.extend(found.next_experiment.as_ref().map(next));
    sections.push(fall(&found.error_ladder, ErrorUnit::of(&found.noise_floor)));
    sections.push(candidates(found));
    let stages = Stages::all(&found.error_ladder, (u, step), what_was_found(found)).in_floors(&found.noise_floor);
    let (before_and_after, player) = subject.before_and_after(&stages);
    sections.extend(before_and_after);
    let integrator = integrator(found.integrator_error, found.time_step_s);
    sections.push(fine_print(&found.doubts, &found.noise_floor, &integrator, found.rollouts));
    Report { title: format!("{}: what is missing", subject.model()), sections, player }.html()
}

/// "coulomb_friction on yaw and backlash on elbow".
fn named(found: &DiagnoseReport) -> String {
    let (effects, values) = findings(found);
    effects
        .into_iter()
        .chain(values.into_iter().map(|value| format!("another {value}")))
        .collect::<Vec<_>>()
        .join(" and ")
}

fn what_was_found(found: &DiagnoseReport) -> String {
    match &*named(found) {
        "" => "with the free parameters fitted".to_owned(),
        names => format!("with {names}, and the free parameters fitted"),
    }
}

/// The verdict in one sentence.
fn sentence(found: &DiagnoseReport) -> String {
    let judged = found.error_ladder.iter().all(|step| step.held_out.is_some());
    let on = if judged { "the held-out logs" } else { "the logs" };
    let error = |step: &LadderStep| number(step.held_out.unwrap_or(step.train));
    let last = found.error_ladder.last().map_or_else(String::new, error);
    let before = base(&found.error_ladder, 0).map_or_else(String::new, error);
    let times = ErrorUnit::of(&found.noise_floor).times();
    let names = named(found);
    let share = format!("{:.0}\u{a0}% of its square is not noise", 100.0 * found.unexplained_share);
    let notes = found.shows_noise().into_iter().chain(found.shows_where_judged());
    let noted = |sentence: String| format!(" Note that {sentence}.");
    let where_judged: String = notes.map(noted).collect();
    let limited = (found.degree == Degree::ExplainedToRepeatability).then(|| what_remains(found.degree).to_owned());
    let limited = alike(found, |_| true).into_iter().chain(limited);
    let left_over: String = {
        let stand_ins = found.stand_ins.iter().map(stand_in);
        limited.chain(found.shows_left_over()).chain(stand_ins).map(noted).collect()
    };
    let help = helps(found);
    match (found.verdict, names.is_empty()) {
        (Verdict::EffectMissing, _) => {
            format!(
                "The model lacks {names}: with it, the error on {on} falls from {before} to {last} {times}.{left_over}"
            )
        }
        (Verdict::ValueWrong, _) => {
            format!(
                "A value of the model is wrong: with {names}, the error on {on} falls from {before} to {last} {times}.{left_over}"
            )
        }
        (Verdict::PartlyExplained, _) => {
            format!(
                "{names} explains most of the error, and something else is missing: the error on {on} falls from {before} to {last} {times}; {share}.{where_judged}"
            )
        }
        (Verdict::NothingMissing, _) => {
            format!(
                "Nothing is missing: the error on {on} is {last} {times}, and {}.{left_over}",
                what_remains(found.degree)
            )
        }
        (Verdict::Unexplained, true) if found.cut_short => format!(
            "Something is missing that nothing tried explains: the error on {on} stays at {last} {times}; {share}.{where_judged}"
        ),
        (Verdict::Unexplained, true) => format!(
            "Something is missing that no effect of the library explains: the error on {on} stays at {last} {times}; {share}.{where_judged}"
        ),
        (Verdict::Unexplained, false) => format!(
            "{names} {help} explain the residual: the error on {on} falls from {before} to {last} {times}; {share}.{where_judged}"
        ),
    }
}

/// What speaks for a finding.
fn support(support: &Support, fell: Option<&str>) -> String {
    let alike = match support.alike.as_slice() {
        [] => "Nothing else that was fitted explains these logs about as well.".to_owned(),
        alike => format!("These logs cannot tell it from {}.", alike.join(", ")),
    };
    let (delta, why) = (number(support.delta_bic), evidence(support, fell));
    let rest = rivals(support).map_or_else(String::new, |rest| format!("{rest}; "));
    let reasons = capped(support).map_or_else(String::new, |capped| format!(" ({capped})"));
    let sure = likelihood(support);
    format!("Probability among all fitted candidates: {sure}{reasons}; {rest}delta BIC {delta}; {why}. {alike}")
}

/// A section on an effect: its probability, its parameters and its description.
fn what_it_is(effect: &EffectReport, found: &DiagnoseReport) -> Section {
    let parameters = Block::Table {
        header: ESTIMATES.map(str::to_owned).to_vec(),
        rows: effect.parameters.iter().map(estimate).collect(),
    };
    let mut blocks = vec![Block::Text(support(&effect.support, fell(found, &effect.names()).as_deref())), parameters];
    blocks.extend(withheld(effect.parameters.iter(), found));
    if let Some(spec) = effects::find(&effect.effect).map(|effect| effect.spec()) {
        let lines = [("Law", spec.law), ("How it shows", spec.symptom), ("Source", spec.cite)];
        blocks.push(Block::List(lines.iter().map(|(what, text)| format!("{what}: {text}")).collect()));
    }
    Section { title: format!("{} on {}", effect.effect, effect.site), blocks }
}

/// Why estimates have no intervals, if they have none.
fn withheld<'a>(mut estimates: impl Iterator<Item = &'a Estimate>, found: &DiagnoseReport) -> Option<Block> {
    let judged = |step: &LadderStep| match step.held_out {
        Some(held_out) if found.leaves_something() => held_out.max(step.train),
        held_out => held_out.unwrap_or(step.train),
    };
    let error = number(found.error_ladder.last().map_or(f64::NAN, judged));
    let times = ErrorUnit::of(&found.noise_floor).times();
    estimates.any(|p| p.ci95.is_none() && !p.at_bound).then(|| {
        Block::Text(format!(
            "Intervals are withheld: at {error} {times} the error still has structure, and any interval would be wrong."
        ))
    })
}

/// A section on a value: its probability, what the model states and what the logs show.
fn what_is_wrong(value: &ValueReport, found: &DiagnoseReport) -> Section {
    let parameters = Block::Table {
        header: CORRECTED.map(str::to_owned).to_vec(),
        rows: value.parameters.iter().map(corrected).collect(),
    };
    let mut blocks = vec![
        Block::Text(support(&value.support, fell(found, &[format!("{}@{}", value.value, value.site)]).as_deref())),
        parameters,
    ];
    blocks.extend(value.parameters.iter().filter_map(remedy).map(|remedy| Block::Text(format!("{remedy}."))));
    blocks.extend(withheld(value.parameters.iter().map(|value| &value.estimate), found));
    Section { title: format!("{} of {}", value.value, value.site), blocks }
}

fn law(law: &LawReport) -> Section {
    let beside =
        if law.beside.is_empty() { String::new() } else { format!(" in addition to {}", law.beside.join(", ")) };
    let text = format!(
        "As a formula on {}{beside}, this law explains {:.0} % of the squared error above the noise on held-out data:",
        law.site,
        100.0 * law.explains
    );
    let pasted = Block::Text("To try it, paste this into the model:".to_owned());
    let blocks = vec![Block::Text(text), Block::Code(law.law.clone()), pasted, Block::Code(law.toml.clone())];
    Section { title: "Law of the residual".to_owned(), blocks }
}

fn next(next: &NextExperiment) -> Section {
    let rows = next.rivals.iter().map(|rival| vec![rival.effect.clone(), number(rival.separation)]);
    let header = ["rival", "separation (noise floors)"].map(str::to_owned).to_vec();
    let text = "btr diagnose with --next FILE.csv writes these commands, for btr simulate --log and for the robot.";
    let plots = next.commands.as_ref().map_or_else(Vec::new, |commands| drive(commands, &next.joints));
    let blocks = vec![
        Block::Text(next.sentence.clone()),
        Block::Table { header, rows: rows.collect() },
        Block::Plots(plots),
        Block::Text(text.to_owned()),
    ];
    Section { title: "Next experiment".to_owned(), blocks }
}

/// The commands of the joints that move.
fn drive(commands: &Log, joints: &[String]) -> Vec<String> {
    let panel = |joint: &String| {
        let channel = commands.channel(&format!("cmd_{joint}"))?;
        let points = commands.clock_s().iter().copied().zip(channel.values.iter().copied()).collect();
        Some(Panel {
            title: format!("{joint}, next experiment"),
            x_label: "time (s)".to_owned(),
            y_label: format!("command ({})", channel.unit),
            series: vec![Series::nameless(Ink::Main, Mark::Line, points)],
            ..Panel::default()
        })
    };
    joints.iter().filter_map(panel).map(|panel| figure(&[panel], 1)).collect()
}
