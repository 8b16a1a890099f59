//! Draws of a fitted model's free parameters, for domain randomisation: as wide as what the fit left.

use crate::experiment::Source;
use crate::failure::Failure;
use crate::model_text::at;
use btr_core::space::Dim;
use btr_core::text::Mention;
use btr_identify::fit::{Marginal, Posterior};
use serde::Deserialize;
use std::path::Path;

/// What of the document of a fit is read.
#[derive(Deserialize)]
struct FitDocument {
    posterior: Option<Posterior>,
}

/// The posterior in the JSON document of a fit.
///
/// # Errors
/// A file that cannot be read or is no such document; a fit that has none.
pub fn posterior_of(path: &Path) -> Result<Posterior, Failure> {
    let refused = |message: String| {
        Failure::new("fit", format!("{}: {message}", path.display()), Some(Mention::FitDocument.into()))
    };
    let text = btr_io::read_text(path).map_err(|error| refused(error.to_string()))?;
    let document: FitDocument =
        serde_json::from_str(&text).map_err(|error| refused(format!("not the JSON document of a fit: {error}")))?;
    document.posterior.ok_or_else(|| refused("this fit has no posterior: it had no free parameters".into()))
}

/// The model at `many` draws from a posterior of its free parameters.
///
/// # Errors
/// See [`drawn_values`].
pub fn draws(source: &Source, posterior: &Posterior, many: usize, seed: u64) -> Result<Vec<Source>, Failure> {
    let model = crate::experiment::model(source)?;
    let placed = |values: Vec<f64>| {
        let named = posterior.parameters.iter().map(|of| of.name.as_str()).zip(values);
        let failed = |error| Failure::new("model", format!("{}: {error}", source.path.display()), None);
        Ok(Source { text: at(&source.text, &model, named).map_err(failed)?, ..source.clone() })
    };
    drawn_values(source, posterior, many, seed)?.into_iter().map(placed).collect()
}

/// Values of the posterior's parameters, in its order, for each of `many` draws.
///
/// # Errors
/// A posterior of another model, or one that was damaged.
pub fn drawn_values(source: &Source, posterior: &Posterior, many: usize, seed: u64) -> Result<Vec<Vec<f64>>, Failure> {
    let space = crate::experiment::model(source)?.simulations;
    let dim = |of: &Marginal| space.index_of(&of.name).map(|k| &space.dims()[k]).ok_or_else(|| unknown(source, of));
    let dims: Vec<&Dim> = posterior.parameters.iter().map(dim).collect::<Result<_, _>>()?;
    let drawn = posterior.draws(many, seed).map_err(|message| Failure::new("fit", message, None))?;
    // Logarithms of bounds are rounded.
    let within =
        |values: Vec<f64>| values.iter().zip(&dims).map(|(value, dim)| value.clamp(dim.min, dim.max)).collect();
    Ok(drawn.into_iter().map(within).collect())
}

fn unknown(source: &Source, of: &Marginal) -> Failure {
    let message = format!("{} has no free parameter {}, which the fit has", source.path.display(), of.name);
    let help = "name the model that this fit has written";
    Failure::new("fit", message, Some(help.into()))
}

/// The middle 95 % of values.
pub(super) fn middle(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| values.get((share * values.len().saturating_sub(1) as f64).round() as usize).copied();
    [at(0.025), at(0.975)].map(|end| end.unwrap_or(f64::NAN))
}
