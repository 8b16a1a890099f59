//! The time step and the integrator of an MJCF file, beside those of the model.

use super::super::request::number;
use super::super::xml::children;
use roxmltree::Document;

/// MuJoCo's own, in s.
const DEFAULT_S: f64 = 0.002;
/// A step that is longer by this factor is another one, and no rounding.
const LONGER: f64 = 1.000_001;

/// What is to be said of a file whose steps are longer than the model's (in s), or whose integrator is of first order.
pub(super) fn advice(document: &Document, model_s: f64) -> impl Iterator<Item = String> {
    longer(document, model_s).into_iter().chain(of_first_order(document))
}

/// That the file's steps are longer.
fn longer(document: &Document, model_s: f64) -> Option<String> {
    let (file_s, whose) = match stated(document, "timestep") {
        Stated::Value(step) => (step.trim().parse().ok()?, ""),
        Stated::Included => return None,
        Stated::Nowhere => (DEFAULT_S, ", MuJoCo's default"),
    };
    let (file, model) = (number(file_s), number(model_s));
    (file_s > LONGER * model_s).then(|| {
        format!(
            "timestep: {file} s in the file{whose}, and {model} s in the model: set <option timestep=\"{model}\"/>, or \
             motions may differ by more than the noise"
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
