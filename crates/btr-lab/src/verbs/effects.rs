//! The library of effects, read from the registry.

use crate::failure::Failure;
use crate::suggest;
use btr_physics::effects::{EFFECTS, EffectSpec, FORMULA, Param};
use serde_json::{Value, json};

/// Every effect spec; formulas share one.
fn all() -> impl Iterator<Item = &'static EffectSpec> {
    EFFECTS.iter().map(|effect| effect.spec()).chain([&FORMULA])
}

/// All effect specs, or that of one effect.
///
/// # Errors
/// An unknown effect.
pub fn named(name: Option<&str>) -> Result<Vec<&'static EffectSpec>, Failure> {
    Ok(match name {
        None => all().collect(),
        Some(name) => vec![all().find(|spec| spec.name == name).ok_or_else(|| unknown(name))?],
    })
}

/// The physical effects, or one of them, as the document of `btr effects --json`.
///
/// # Errors
/// An unknown effect.
pub fn effects(name: Option<&str>) -> Result<Value, Failure> {
    let effects: Vec<Value> = named(name)?.into_iter().map(describe).collect();
    Ok(json!({ "ok": true, "effects": effects }))
}

fn unknown(name: &str) -> Failure {
    let help = suggest::remedy(name, all().map(|spec| spec.name));
    Failure::new("unknown_effect", format!("there is no effect `{name}`"), Some(help))
}

/// The kind of site on which it acts.
pub fn site(spec: &EffectSpec) -> String {
    format!("{:?}", spec.site).to_lowercase()
}

fn describe(spec: &EffectSpec) -> Value {
    let finite = |x: f64| x.is_finite().then_some(x);
    let param = |p: &Param| {
        json!({ "name": p.name, "unit": p.unit, "min": p.bounds.0, "max": finite(p.bounds.1), "off": finite(p.off),
                "typical": p.hint, "shape": p.shape })
    };
    let params: Vec<Value> = spec.params.iter().map(param).collect();
    json!({ "effect": spec.name, "site": site(spec), "law": spec.law, "shows": spec.symptom,
            "source": spec.cite, "alike": spec.similar, "starts": spec.starts, "parameters": params })
}
