//! The report of `btr fit`.

use super::ladder::{fall, fine_print};
use super::page::{Block, Report, Section};
use super::stages::Stages;
use crate::Subject;
use crate::base_parameters;
use crate::plot::Ink;
use crate::plot::rows::{Pin, Row, RowScale, Rows, rows};
use crate::table::{Table, maybe, number};
use crate::text::{integrator, interval, removable, what_remains};
use btr_core::space::Dim;
use btr_identify::fit::{Estimate, FitStop};
use btr_identify::residual_model::TimeStep;
use btr_lab::verbs::{BaseReport, ErrorUnit, FitReport};

/// The page of `btr fit`; `u` is the point that was fitted, in this time step.
pub fn fit(subject: &Subject, found: &FitReport, reached: (&[f64], TimeStep)) -> String {
    let mut blocks = vec![Block::Lead(sentence(found)), subject.input_block()];
    blocks.extend(removable(&found.without_effect).map(|sentence| Block::Text(sentence + ".")));
    blocks.extend(subject.reserve(&found.doubts));
    let lead = Section { title: "Result".to_owned(), blocks };
    let mut ladder = fall(&found.error_ladder, ErrorUnit::of(&found.noise_floor));
    ladder.blocks.push(Block::Text(format!("The search ended because {}.", why(found.stop_reason))));
    let mut sections = vec![lead, ladder, values(subject, found)];
    sections.extend(not_identifiable(found));
    sections.extend(found.base_parameters.as_ref().map(base));
    let added: Vec<String> = subject.input.added_effects().into_iter().collect();
    let name = if added.is_empty() { "fitted".to_owned() } else { format!("fitted, with {}", added.join(" and ")) };
    let stages = Stages::ends(&found.error_ladder, reached, "with the values above".to_owned(), name);
    let stages = stages.in_floors(&found.noise_floor);
    let (before_and_after, player) = subject.before_and_after(&stages);
    sections.extend(before_and_after);
    let integrator = integrator(found.integrator_error, found.time_step_s);
    sections.push(fine_print(&found.doubts, &found.noise_floor, &integrator, found.rollouts));
    Report { title: format!("{}: fitted", subject.model()), sections, player }.html()
}

fn sentence(found: &FitReport) -> String {
    let first = found.error_ladder.first();
    let (from, to, on) = match (first.and_then(|step| step.held_out), found.held_out) {
        (Some(from), Some(to)) => (from, to, "the held-out logs"),
        _ => (first.map_or(f64::NAN, |step| step.train), found.train, "the training logs"),
    };
    let rest = match &found.withheld {
        None => what_remains(found.degree),
        Some(_) => "something is still missing, so intervals are withheld",
    };
    let times = ErrorUnit::of(&found.noise_floor).times();
    format!("The error on {on} went from {} to {} {times}: {rest}.", number(from), number(to))
}

fn why(ended: FitStop) -> &'static str {
    match ended {
        FitStop::Converged => "it converged",
        FitStop::Effort => "its evaluation budget was used up",
        FitStop::Stuck => "no direction reduced the error any further",
    }
}

/// Every parameter with its interval, between its bounds.
fn values(subject: &Subject, found: &FitReport) -> Section {
    let dims = subject.input.problem.model().simulations.dims();
    let pairs = || found.parameters.iter().filter_map(|e| Some((e, dims.iter().find(|dim| dim.name == e.name)?)));
    let any_at_bound = found.parameters.iter().any(|estimate| estimate.at_bound);
    let legend = [(Ink::Third, "before"), (Ink::Main, "fitted, with its 95 % interval"), (Ink::Alarm, "at its bound")];
    let legend = legend.into_iter().filter(|(ink, _)| any_at_bound || *ink != Ink::Alarm);
    let plot = rows(&Rows {
        title: "Each value between its bounds".to_owned(),
        label: "position between the bounds".to_owned(),
        notes: "value (95 % interval)".to_owned(),
        scale: RowScale::Bounds,
        lines: Vec::new(),
        legend: legend.map(|(ink, name)| (ink, name.to_owned())).collect(),
        rows: pairs().map(|(estimate, dim)| row(estimate, dim)).collect(),
        joined: false,
    });
    let header = ["parameter", "unit", "before", "fitted", "95 % interval", "lower bound", "upper bound"];
    let cells = |(e, dim): (&Estimate, &Dim)| {
        let numbers = [maybe(dim.nominal), number(e.value), interval(e), number(dim.min), number(dim.max)];
        [e.name.clone(), e.unit.clone()].into_iter().chain(numbers).collect()
    };
    let table = Block::Table { header: header.map(str::to_owned).to_vec(), rows: pairs().map(cells).collect() };
    let withheld =
        found.withheld.iter().map(|why| Block::Text(format!("No intervals: {why}. btr diagnose looks for it.")));
    let blocks = withheld.chain([Block::Maps(vec![plot]), table]).collect();
    Section { title: "Values".to_owned(), blocks }
}

fn row(estimate: &Estimate, dim: &Dim) -> Row {
    let ink = if estimate.at_bound { Ink::Alarm } else { Ink::Main };
    let before = dim.nominal.map(|value| Pin::Dot(Ink::Third, dim.to_unit(value)));
    let span = estimate.ci95.map(|[low, high]| Pin::Span(ink, dim.to_unit(low), dim.to_unit(high)));
    let unit = if estimate.unit == "1" { String::new() } else { format!(" {}", estimate.unit) };
    let value = Pin::Dot(ink, dim.to_unit(estimate.value));
    Row {
        name: estimate.name.clone(),
        pins: span.into_iter().chain(before).chain([value]).collect(),
        note: format!("{}{unit} ({})", number(estimate.value), interval(estimate)),
        strong: estimate.at_bound,
    }
}

/// Combinations of parameters that the logs do not determine.
fn not_identifiable(found: &FitReport) -> Option<Section> {
    let sentences: Vec<String> = found.null_directions.iter().map(|direction| direction.sentence.clone()).collect();
    let blocks = vec![Block::List(sentences)];
    (!found.null_directions.is_empty())
        .then(|| Section { title: "Not identifiable from these logs".to_owned(), blocks })
}

/// What the logs tell about all dynamic parameters.
fn base(found: &BaseReport) -> Section {
    let table = |table: Table| {
        let (header, rows) = table.into_parts();
        Block::Table { header, rows }
    };
    let mut blocks = vec![table(base_parameters::combinations(found)), table(base_parameters::remaining(found))];
    blocks.extend(base_parameters::sentences(found).into_iter().map(Block::Text));
    if let Some(possible) = &found.possible {
        blocks.extend([Block::Text(base_parameters::can_be(possible)), table(base_parameters::possible(possible))]);
    }
    Section { title: "Base parameters".to_owned(), blocks }
}
