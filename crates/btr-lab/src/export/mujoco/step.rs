//! The time step of an MJCF file, beside that of the model.

use super::super::request::number;
use super::super::xml::children;
use roxmltree::Document;

/// MuJoCo's own, in s.
const DEFAULT_S: f64 = 0.002;
/// A step that is longer by this factor is another one, and no rounding.
const LONGER: f64 = 1.000_001;

/// What is to be said of a file whose steps are longer than the model's, in s.
pub(super) fn advice(document: &Document, model_s: f64) -> Option<String> {
    let options = children(document.root_element(), "option");
    let stated = options.filter_map(|option| option.attribute("timestep")).last();
    let includes = document.descendants().any(|node| node.has_tag_name("include"));
    let (file_s, whose) = match stated {
        Some(step) => (step.trim().parse().ok()?, ""),
        // It may be stated there.
        None if includes => return None,
        None => (DEFAULT_S, ", MuJoCo's default"),
    };
    let (file, model) = (number(file_s), number(model_s));
    (file_s > LONGER * model_s).then(|| {
        format!(
            "timestep: {file} s in the file{whose}, and {model} s in the model: set <option timestep=\"{model}\"/>, or \
             motions may differ by more than the noise"
        )
    })
}
