//! Fit parameters for a model and for effects that it lacks: their parametrisations, sizes, bounds and priors.

use crate::scales::RobotScales;
use btr_core::space::{Dim, Scale};
use btr_identify::residual_model::{FitParameter, Parametrisation};
use btr_physics::effects::Param;
use btr_physics::setup::Setup;

/// What the value of a joint's direction is called, before `@JOINT`.
pub(in crate::identification) const DIRECTION: &str = "direction";
/// Spread of the weak prior of an effect's amplitude, in typical sizes.
pub(super) const WEAK: f64 = 33.0;
/// Spread of the prior of a shape, in factors of two.
const SHAPE: f64 = 3.0;
/// Step of finite differences: in standard deviations for free parameters, in typical sizes for amplitudes.
const REACH: (f64, f64) = (0.05, 0.1);
/// The same for a size in which the cost is a stair: a larger step leads to another size altogether.
const STAIR_REACH: f64 = 1e-3;

/// A free parameter: its bounds are two standard deviations away, unless it belongs to an effect. `sd` is the standard
/// deviation that earlier logs leave, in its unit.
pub(in crate::identification) fn free_parameter(dim: &Dim, sd: Option<f64>, scales: &RobotScales) -> FitParameter {
    let nominal = dim.nominal.unwrap_or_else(|| dim.from_unit(0.5));
    if dim.name.split('@').next() == Some(DIRECTION) {
        return FitParameter { amplitude: false, ..direction(dim.name.clone(), nominal.signum()) };
    }
    let named = dim.name.split_once('.').and_then(|(name, rest)| Some((btr_physics::effects::find(name)?, rest)));
    let effect = named.and_then(|(effect, rest)| {
        let (param, site) = rest.split_once('@').unwrap_or((rest, "*"));
        let spec = effect.spec();
        Some((spec.params.iter().find(|p| p.name == param)?, site))
    });
    let is_stair = named.is_some_and(|(effect, _)| effect.is_of_command());
    let (law, size, spread) = match effect {
        Some((param, site)) if is_stair => {
            (Parametrisation::Stair, param.hint.abs() * scales.of_unit(param.unit, site), WEAK)
        }
        // Shapes and limits vary on a logarithmic scale; all other parameters of an effect are amplitudes.
        Some((param, _)) if (param.shape || param.off.is_infinite()) && dim.min > 0.0 && nominal > 0.0 => {
            (Parametrisation::Exponential, std::f64::consts::LN_2, SHAPE)
        }
        Some((param, site)) if dim.scale == Scale::Linear && !param.shape => {
            (Parametrisation::Linear, param.hint.abs() * scales.of_unit(param.unit, site), WEAK)
        }
        _ if dim.min > 0.0 && nominal > 0.0 => (Parametrisation::Exponential, (dim.max / dim.min).ln() / 4.0, 1.0),
        _ => (Parametrisation::Linear, (dim.max - dim.min) / 4.0, 1.0),
    };
    let mut parameter = FitParameter {
        name: dim.name.clone(),
        unit: dim.unit.clone(),
        origin: nominal,
        size,
        law,
        bounds: (0.0, 0.0),
        spread,
        known: None,
        reach: if is_stair {
            STAIR_REACH
        } else if effect.is_some() {
            REACH.1
        } else {
            REACH.0
        },
        amplitude: law == Parametrisation::Linear && effect.is_some_and(|(param, _)| same(param.off, nominal)),
    };
    parameter.bounds = (parameter.coordinate(dim.min), parameter.coordinate(dim.max));
    parameter.known = sd.map(|sd| sd / parameter.slope(0.0).abs());
    parameter
}

/// A size of an effect on commands alone: small changes of it say nothing.
pub(in crate::identification) fn stair(parameter: FitParameter) -> FitParameter {
    FitParameter { law: Parametrisation::Stair, reach: STAIR_REACH, ..parameter }
}

/// A parameter of an effect that is off: `scales` adapt its typical size and its bounds to this robot, `model_value` is
/// the model's value.
pub(in crate::identification) fn parameter(
    name: String,
    param: &Param,
    (scale, of_bounds): (f64, f64),
    model_value: f64,
) -> FitParameter {
    let size = param.hint.abs() * scale;
    let (least, most) = (param.bounds.0 * of_bounds, param.bounds.1 * of_bounds);
    let (law, origin, size, bounds, spread) = match param {
        p if p.shape && p.bounds.0 > 0.0 => {
            let size = std::f64::consts::LN_2;
            (
                Parametrisation::Exponential,
                p.hint * scale,
                size,
                ((p.bounds.0 / p.hint).ln() / size, (p.bounds.1 / p.hint).ln() / size),
                SHAPE,
            )
        }
        p if p.shape => {
            let size = (most - least) / 8.0;
            (
                Parametrisation::Linear,
                p.hint * scale,
                size,
                ((least - p.hint * scale) / size, (most - p.hint * scale) / size),
                4.0,
            )
        }
        p if p.off.is_infinite() => {
            let law = if p.stiffness { Parametrisation::Compliance } else { Parametrisation::Inverse };
            (law, f64::INFINITY, size, (0.0, size / least), WEAK)
        }
        p if p.off.is_nan() => (
            Parametrisation::Linear,
            model_value,
            size,
            ((least - model_value) / size, (most - model_value) / size),
            WEAK,
        ),
        p => (Parametrisation::Linear, p.off, size, (least.min(0.0) / size, most / size), WEAK),
    };
    let unit = param.unit.to_owned();
    let (known, reach, amplitude) = (None, REACH.1, !param.shape);
    FitParameter { name, unit, origin, size, law, bounds, spread, known, reach, amplitude }
}

/// Which way a joint counts: as in the model, or the other way round.
pub(in crate::identification) fn direction(name: String, origin: f64) -> FitParameter {
    FitParameter {
        name,
        unit: "1".to_owned(),
        origin,
        size: -2.0 * origin,
        law: Parametrisation::Switch,
        // Beyond both: it is at no bound.
        bounds: (-0.5, 1.5),
        spread: WEAK,
        known: None,
        reach: STAIR_REACH,
        amplitude: true,
    }
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits()
}

/// The model's value that the effect would replace.
pub(in crate::identification) fn model_value(param: &Param, setup: &Setup) -> f64 {
    match param.name {
        "coefficient" => setup.ground.map_or(f64::NAN, |ground| ground.friction),
        _ => f64::NAN,
    }
}
