//! `btr effects`: lists the library of physical effects.

use crate::args::Global;
use crate::exit::DONE;
use crate::terminal;
use crate::terminal::{Tone, say};
use btr_lab::failure::Failure;
use btr_lab::verbs::{effects, named, site};
use btr_physics::effects::{EffectSpec, Param, SiteKind};
use btr_report::table::{Table, number};

pub(crate) fn run(name: Option<&str>, global: &Global) -> Result<u8, Failure> {
    let specs = named(name)?;
    if global.json {
        println!("{}", effects(name)?);
    } else if name.is_some() {
        specs.iter().for_each(|spec| tell(spec));
    } else {
        list(&specs);
    }
    Ok(DONE)
}

fn list(specs: &[&EffectSpec]) {
    let mut table = Table::new(&["effect", "on", "parameters"]);
    for spec in specs {
        table.row(vec![spec.name.to_owned(), site(spec), params(spec)]);
    }
    let help = "~ only shapes the effect; `btr effects NAME` tells the law of one, how it shows and where it is from.";
    terminal::table_left(&table);
    println!();
    say(Tone::Plain, help);
}

/// Parameter names and units; neighbours with the same unit share it.
fn params(spec: &EffectSpec) -> String {
    if spec.params.is_empty() {
        return "its own".to_owned();
    }
    let name = |p: &Param| if p.shape { format!("~{}", p.name) } else { p.name.to_owned() };
    let units = spec.params.chunk_by(|a, b| a.unit == b.unit).map(|same| {
        let names: Vec<String> = same.iter().map(name).collect();
        format!("{} ({})", names.join(", "), same[0].unit)
    });
    units.collect::<Vec<_>>().join(", ")
}

fn tell(spec: &EffectSpec) {
    println!("{}\n", spec.name);
    let line = |what: &str, text: &str| say(Tone::Plain, &format!("  {what:<7} {text}"));
    line("law", spec.law);
    line("sits", on(spec));
    line("shows", spec.symptom);
    line("source", spec.cite);
    if !spec.similar.is_empty() {
        line("alike", &format!("{}: hard to distinguish from these", spec.similar.join(", ")));
    }
    if spec.params.is_empty() {
        return;
    }
    let mut table = Table::new(&["parameter", "unit", "min", "max", "off", "typical"]);
    for p in spec.params {
        let off = if p.shape { "shape".to_owned() } else { shown(p.off) };
        let [min, max, hint] = [p.bounds.0, p.bounds.1, p.hint].map(shown);
        table.row(vec![p.name.to_owned(), p.unit.to_owned(), min, max, off, hint]);
    }
    println!();
    terminal::table(&table);
    if spec.params.iter().any(|p| p.shape) {
        println!("\nA shape only shapes the effect; the other parameters switch it on.");
    }
}

/// The sites of an effect and how they are written.
fn on(spec: &EffectSpec) -> &'static str {
    match spec.site {
        SiteKind::Joint => "on joints: site = \"knee\", \"L*,R*\", \"*\"",
        SiteKind::Link => "on links: site = \"shank\", \"base\", \"*\"",
        SiteKind::Base => "on the base: site = \"base\"",
        SiteKind::Ground => "on the ground: site = \"*\"",
        SiteKind::Robot => "on the robot as a whole: site = \"*\"",
    }
}

/// An off value: infinite for limits, NaN where the model's own value applies.
fn shown(x: f64) -> String {
    match x {
        x if x.is_nan() => "own".to_owned(),
        x if x.is_infinite() => "inf".to_owned(),
        x => number(x),
    }
}
