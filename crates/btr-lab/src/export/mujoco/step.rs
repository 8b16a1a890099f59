//! The time step and the integrator of an MJCF file, beside those of the model.

use super::super::request::number;
use super::super::xml::children;
use roxmltree::Document;

/// MuJoCo's own, in s.
const DEFAULT_S: f64 = 0.002;
/// A step that is longer by this factor is another one, and no rounding.
const LONGER: f64 = 1.000_001;

/// Steps per time constant of the fastest joint with which RK4 is accurate to a few hundredths of a milliradian.
const STEPS: f64 = 2.0;

/// The time step of the file, in s.
pub(super) fn of(document: &Document) -> f64 {
    match stated(document, "timestep") {
        Stated::Value(step) => step.trim().parse().ok().filter(|step| *step > 0.0).unwrap_or(DEFAULT_S),
        Stated::Included | Stated::Nowhere => DEFAULT_S,
    }
}

/// What is to be said of a file whose steps are longer than the model's (in s), or too long for the joint that settles
/// fastest (in 1/s), or whose integrator is of first order.
pub(super) fn advice(document: &Document, model_s: f64, fastest: Option<(&str, f64)>) -> impl Iterator<Item = String> {
    longer(document, model_s, fastest).into_iter().chain(of_first_order(document))
}

/// That the file's steps are too long.
fn longer(document: &Document, model_s: f64, fastest: Option<(&str, f64)>) -> Option<String> {
    let (file_s, whose) = match stated(document, "timestep") {
        Stated::Value(step) => (step.trim().parse().ok()?, ""),
        Stated::Included => return None,
        Stated::Nowhere => (DEFAULT_S, ", MuJoCo's default"),
    };
    // A whole part of the model's.
    let parts = fastest.map_or(1.0, |(_, rate)| (STEPS * model_s * rate).ceil().max(1.0));
    let needed_s = model_s / parts;
    let why = match fastest.filter(|_| parts > 1.0) {
        Some((joint, rate)) => format!("{joint} settles within {:.1e} s", 1.0 / rate),
        None => format!("{} s in the model", number(model_s)),
    };
    (file_s > LONGER * needed_s).then(|| {
        format!(
            "timestep: {} s in the file{whose}, and {why}: set <option timestep=\"{}\"/>, or motions may differ by more \
             than the noise",
            number(file_s),
            number(needed_s)
        )
    })
}

/// That the file's integrator errs in proportion to its step, as all of MuJoCo's but one.
fn of_first_order(document: &Document) -> Option<String> {
    let (integrator, whose) = match stated(document, "integrator") {
        Stated::Value(integrator) => (integrator, ""),
        Stated::Included => return None,
        Stated::Nowhere => ("Euler", ", MuJoCo's default"),
    };
    (integrator != "RK4").then(|| {
        format!(
            "integrator: {integrator}{whose}, errs in proportion to the time step: set <option integrator=\"RK4\"/>, or \
             motions may differ by more than the noise"
        )
    })
}

/// An option of the file.
enum Stated<'a> {
    Value(&'a str),
    /// It may be in an included file.
    Included,
    Nowhere,
}

fn stated<'a>(document: &'a Document, name: &str) -> Stated<'a> {
    let options = children(document.root_element(), "option");
    match options.filter_map(|option| option.attribute(name)).last() {
        Some(value) => Stated::Value(value),
        None if document.descendants().any(|node| node.has_tag_name("include")) => Stated::Included,
        None => Stated::Nowhere,
    }
}
