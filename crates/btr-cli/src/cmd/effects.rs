//! `btr effects`: the library, as the registry knows it.

use crate::args::Global;
use crate::failure::Failure;
use crate::table::{Table, number};
use btr_physics::effect::{Card, EFFECTS, Param, find};
use btr_physics::experiment::nearest;
use serde_json::{Value, json};
use std::process::ExitCode;

pub(crate) fn run(name: Option<&str>, global: &Global) -> Result<ExitCode, Failure> {
    let cards: Vec<&Card> = match name {
        None => EFFECTS.iter().map(|e| e.card()).collect(),
        Some(name) => vec![find(name).map(|e| e.card()).ok_or_else(|| unknown(name))?],
    };
    if global.json {
        let effects: Vec<Value> = cards.iter().map(|card| describe(card)).collect();
        println!("{}", json!({ "ok": true, "effects": effects }));
    } else if name.is_some() {
        cards.iter().for_each(|card| tell(card));
    } else {
        list(&cards);
    }
    Ok(ExitCode::SUCCESS)
}

fn unknown(name: &str) -> Failure {
    let known = || EFFECTS.iter().map(|e| e.card().name);
    let help = match nearest(name, known()) {
        Some(name) => format!("did you mean `{name}`?"),
        None => format!("known: {}", known().collect::<Vec<_>>().join(", ")),
    };
    Failure::new("unknown_effect", format!("there is no effect `{name}`"), Some(help))
}

fn list(cards: &[&Card]) {
    let mut table = Table::new(&["effect", "parameters", "law"]);
    for card in cards {
        let params: Vec<String> = card.params.iter().map(|p| format!("{} ({})", p.name, p.unit)).collect();
        table.row(vec![card.name.to_owned(), params.join(", "), card.law.to_owned()]);
    }
    println!("{}\n\n`btr effects NAME` tells how one shows and where its law is from.", table.render());
}

fn tell(card: &Card) {
    println!("{}\n\n  law     {}\n  shows   {}\n  source  {}\n", card.name, card.law, card.tell, card.cite);
    let mut table = Table::new(&["parameter", "unit", "min", "max", "off", "typical"]);
    for p in card.params {
        let numbers = [p.bounds.0, p.bounds.1, p.off, p.hint].map(shown);
        table.row([p.name.to_owned(), p.unit.to_owned()].into_iter().chain(numbers).collect());
    }
    println!("{}", table.render());
}

/// Off values are infinite for limits and NaN where the model's own value stands.
fn shown(x: f64) -> String {
    match x {
        x if x.is_nan() => "own".to_owned(),
        x if x.is_infinite() => "inf".to_owned(),
        x => number(x),
    }
}

fn describe(card: &Card) -> Value {
    let finite = |x: f64| x.is_finite().then_some(x);
    let param = |p: &Param| {
        json!({ "name": p.name, "unit": p.unit, "min": p.bounds.0, "max": finite(p.bounds.1), "off": finite(p.off),
                "typical": p.hint })
    };
    let params: Vec<Value> = card.params.iter().map(param).collect();
    json!({ "effect": card.name, "site": format!("{:?}", card.site).to_lowercase(), "law": card.law, "shows": card.tell,
            "source": card.cite, "parameters": params })
}
